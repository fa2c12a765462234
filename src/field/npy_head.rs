//! The head of a `.npy`: which type, which sides, which order.

use std::io::Read;

/// Longest head that is read: a dictionary of three entries has about a hundred bytes.
const MOST: usize = 1 << 16;
const MAGIC: &[u8] = b"\x93NUMPY";

/// What the head of a `.npy` says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Head {
    /// Sides.
    pub(crate) shape: Vec<usize>,
    /// NumPy's name of the type, as `<f4`.
    pub(crate) kind: String,
    /// Whether the first side is the fastest.
    pub(crate) fortran: bool,
    /// Bytes of all values; none where that has no meaning.
    pub(crate) promised: Option<u64>,
    /// The head itself.
    pub(crate) bytes: Vec<u8>,
}

impl Head {
    /// Reads the head, after which the values begin; its fault in words.
    pub(crate) fn read(reader: &mut impl Read) -> Result<Self, String> {
        let cut = |_| "its head is cut off".to_string();
        // Magic, version, and a length of two or four bytes: a length is believed when it is small.
        let mut bytes = vec![0; 10];
        reader.read_exact(&mut bytes).map_err(cut)?;
        if &bytes[..6] != MAGIC {
            return Err("it does not begin as one".into());
        }
        let mut length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        if bytes[6] > 1 {
            bytes.resize(12, 0);
            reader.read_exact(&mut bytes[10..]).map_err(cut)?;
            length |= usize::from(u16::from_le_bytes([bytes[10], bytes[11]])) << 16;
        }
        if length > MOST {
            return Err(format!("its head of {length} bytes is none"));
        }
        let begin = bytes.len();
        bytes.resize(begin + length, 0);
        reader.read_exact(&mut bytes[begin..]).map_err(cut)?;
        let text = String::from_utf8_lossy(&bytes[begin..]).into_owned();
        let entry = |name: &str| {
            let at = [format!("'{name}'"), format!("\"{name}\"")]
                .iter()
                .find_map(|quoted| text.find(quoted.as_str()).map(|at| text[at + quoted.len()..].trim_start()));
            at.and_then(|rest| rest.strip_prefix(':')).map(str::trim_start).ok_or(format!("its head has no {name}"))
        };
        let kind = kind(entry("descr")?).ok_or("the type in its head is not understood")?;
        let shape = sides(entry("shape")?).ok_or("the shape in its head is not understood")?;
        let fortran = entry("fortran_order")?.starts_with("True");
        let wide = wide(&kind);
        let promised = wide.and_then(|wide| shape.iter().try_fold(wide, |n, &side| n.checked_mul(side as u64)));
        Ok(Self { shape, kind, fortran, promised, bytes })
    }
}

/// A type's name: what stands in quotes; of a record all of its list.
fn kind(text: &str) -> Option<String> {
    let quote = text.chars().next()?;
    let end = match quote {
        '\'' | '"' => text[1..].find(quote)? + 1,
        '[' => text.rfind(']')?,
        _ => return None,
    };
    Some(text[1..end].to_owned())
}

/// Bytes of an element of that type, where its name says it.
fn wide(kind: &str) -> Option<u64> {
    let rest = kind.trim_start_matches(['<', '>', '|', '=']);
    let mut rest = rest.chars();
    let letter = rest.next()?;
    let count: u64 = rest.as_str().parse().ok()?;
    // Text in Unicode has four bytes a letter.
    if letter == 'U' { count.checked_mul(4) } else { Some(count) }
}

fn sides(text: &str) -> Option<Vec<usize>> {
    let inside = text.strip_prefix('(')?.split_once(')')?.0;
    let words = inside.split(',').map(|word| word.trim().trim_end_matches('L')).filter(|word| !word.is_empty());
    words.map(|word| word.parse().ok()).collect()
}

/// The head of an array in C order, padded so that the values begin at a multiple of 64 bytes of it.
pub(crate) fn of(kind: &str, shape: &[usize]) -> Vec<u8> {
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({}), }}", sides.trim_end());
    let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
    let mut out = MAGIC.to_vec();
    out.extend([1, 0]);
    out.extend((length as u16).to_le_bytes());
    out.extend(format!("{text:<width$}\n", width = length - 1).into_bytes());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_text(text: &str) -> Result<Head, String> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.bytes());
        Head::read(&mut &bytes[..])
    }

    #[test]
    fn heads_of_any_program_are_read_and_none_takes_memory() {
        let head = of_text("{'descr': '<c8', 'fortran_order': True, 'shape': (3, 2), }\n").expect("head");
        assert_eq!(
            (head.kind.as_str(), &head.shape[..], head.fortran, head.promised),
            ("<c8", &[3, 2][..], true, Some(48))
        );
        let head = of_text("{\"shape\":(5L,),\"fortran_order\":False,\"descr\":\"|S3\"}").expect("head");
        assert_eq!(
            (head.kind.as_str(), &head.shape[..], head.fortran, head.promised),
            ("|S3", &[5][..], false, Some(15))
        );
        assert_eq!(of_text("{'descr': '<U2', 'fortran_order': False, 'shape': ()}").expect("head").promised, Some(8));
        let huge =
            of_text("{'descr': '<f8', 'fortran_order': False, 'shape': (4000000000, 4000000000, 4)}").expect("head");
        assert_eq!(huge.promised, None);
        let record =
            of_text("{'descr': [('a', '<f4'), ('b', '<i2')], 'fortran_order': False, 'shape': (2,)}").expect("head");
        assert_eq!(record.promised, None);
        for text in [
            "",
            "{}",
            "{'descr': 5, 'fortran_order': False, 'shape': (2,)}",
            "{'descr': '<f4', 'fortran_order': False, 'shape': 7}",
        ] {
            assert!(of_text(text).is_err(), "{text}");
        }
        let mut long = b"\x93NUMPY\x02\x00\xff\xff\xff\x7f".to_vec();
        long.extend([b' '; 64]);
        assert!(Head::read(&mut &long[..]).unwrap_err().contains("bytes is none"));
        assert_eq!(Head::read(&mut &of("<f4", &[3, 4])[..]).expect("ours").promised, Some(48));
    }
}
