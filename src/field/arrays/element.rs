//! Numbers as files hold them, and what becomes of them.

use crate::field::Complex32;
use half::f16;

/// What kind of number an element is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    Float,
    Signed,
    Unsigned,
    /// Two floats, real part first.
    Complex,
}

/// The type of an array's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Element {
    pub(crate) class: Class,
    /// Bytes of one element.
    pub(crate) bytes: usize,
    /// Whether the high byte comes first.
    pub(crate) big: bool,
}

/// The values of an array, narrowed to what fields, phases and levels need.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Complex numbers.
    Complex(Vec<Complex32>),
    /// Floats.
    Real(Vec<f64>),
    /// Whole numbers.
    Whole(Vec<i64>),
}

impl Values {
    /// How many there are.
    pub fn count(&self) -> usize {
        match self {
            Self::Complex(values) => values.len(),
            Self::Real(values) => values.len(),
            Self::Whole(values) => values.len(),
        }
    }

    /// What they are, in a word.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Complex(_) => "complex",
            Self::Real(_) => "float",
            Self::Whole(_) => "integer",
        }
    }

    /// The same values in another order: `at[i]` is where the value stood that comes to place i.
    pub(super) fn taken(self, at: &[usize]) -> Self {
        fn take<T: Copy>(values: &[T], at: &[usize]) -> Vec<T> {
            at.iter().map(|&i| values[i]).collect()
        }
        match self {
            Self::Complex(values) => Self::Complex(take(&values, at)),
            Self::Real(values) => Self::Real(take(&values, at)),
            Self::Whole(values) => Self::Whole(take(&values, at)),
        }
    }
}

impl Element {
    /// A float of so many bytes.
    pub(crate) fn float(bytes: usize, big: bool) -> Self {
        Self { class: Class::Float, bytes, big }
    }

    /// The type that NumPy calls `<f4`, `|u1`, `>c16` …; none for other than numbers.
    pub(crate) fn of_numpy(name: &str) -> Option<Self> {
        let name = name.trim_matches('\'');
        let (order, rest) = name.split_at_checked(1)?;
        let (kind, bytes) = rest.split_at_checked(1)?;
        let (bytes, big) = (bytes.parse().ok()?, order == ">");
        let class = match (kind, bytes) {
            ("f", 2 | 4 | 8) => Class::Float,
            ("i", 1 | 2 | 4 | 8) => Class::Signed,
            ("u", 1 | 2 | 4 | 8) | ("b", 1) => Class::Unsigned,
            ("c", 8 | 16) => Class::Complex,
            _ => return None,
        };
        Some(Self { class, bytes, big })
    }

    /// The values of so many whole elements.
    pub(crate) fn values(self, bytes: &[u8]) -> Values {
        let elements = bytes.chunks_exact(self.bytes);
        match self.class {
            Class::Float => Values::Real(elements.map(|b| self.real(b)).collect()),
            Class::Signed | Class::Unsigned => Values::Whole(elements.map(|b| self.whole(b)).collect()),
            Class::Complex => {
                let part = Self::float(self.bytes / 2, self.big);
                let number = |b: &[u8]| {
                    let (re, im) = b.split_at(part.bytes);
                    Complex32::new(part.real(re) as f32, part.real(im) as f32)
                };
                Values::Complex(elements.map(number).collect())
            }
        }
    }

    /// The eight low bytes of an element, low byte first.
    fn low(self, bytes: &[u8]) -> [u8; 8] {
        let mut low = [0; 8];
        low[..self.bytes].copy_from_slice(bytes);
        if self.big {
            low[..self.bytes].reverse();
        }
        low
    }

    /// An element as a float.
    pub(crate) fn real(self, bytes: &[u8]) -> f64 {
        let low = self.low(bytes);
        let [a, b, c, d, ..] = low;
        match (self.class, self.bytes) {
            (Class::Float, 2) => f16::from_le_bytes([a, b]).to_f64(),
            (Class::Float, 4) => f32::from_le_bytes([a, b, c, d]).into(),
            (Class::Float, _) => f64::from_le_bytes(low),
            _ => self.whole(bytes) as f64,
        }
    }

    /// An element as a whole number; beyond 2⁶³ the largest.
    fn whole(self, bytes: &[u8]) -> i64 {
        let low = u64::from_le_bytes(self.low(bytes));
        match self.class {
            Class::Signed => {
                let unused = 64 - 8 * self.bytes as u32;
                ((low << unused) as i64) >> unused
            }
            _ => i64::try_from(low).unwrap_or(i64::MAX),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_any_type_and_order_are_what_they_were() {
        let of = |name: &str, bytes: &[u8]| Element::of_numpy(name).expect(name).values(bytes);
        assert_eq!(of("<f4", &1.5f32.to_le_bytes()), Values::Real(vec![1.5]));
        assert_eq!(of("'>f8'", &(-2.25f64).to_be_bytes()), Values::Real(vec![-2.25]));
        assert_eq!(of("<f2", &[0x00, 0x3e]), Values::Real(vec![1.5]));
        assert_eq!(of(">i2", &(-3i16).to_be_bytes()), Values::Whole(vec![-3]));
        assert_eq!(of("<i8", &(-3i64).to_le_bytes()), Values::Whole(vec![-3]));
        assert_eq!(of("|u1", &[255, 1]), Values::Whole(vec![255, 1]));
        assert_eq!(of("<u8", &u64::MAX.to_le_bytes()), Values::Whole(vec![i64::MAX]));
        let pair: Vec<u8> = [0.5f64, -4.0].iter().flat_map(|v| v.to_be_bytes()).collect();
        assert_eq!(of(">c16", &pair), Values::Complex(vec![Complex32::new(0.5, -4.0)]));
        for foreign in ["|S3", "<U2", "|O", "<f16", "", "é", "<f", "<M8[ns]"] {
            assert_eq!(Element::of_numpy(foreign), None, "{foreign}");
        }
    }
}
