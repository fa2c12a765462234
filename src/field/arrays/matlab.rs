//! MATLAB's `.mat` of versions 5 to 7: what `save` writes without `-v7.3`, SciPy's `savemat` and Octave's `save -7`.
//!
//! After a head of 128 bytes stand elements: a type, a length, that many bytes (MathWorks, *MAT-File Format*, chapter 1). A
//! matrix is an element of elements: flags, sides, name, real part, imaginary part. Values stand column by column.

use super::{Array, Element, Values, choose, sides};
use crate::error::{Error, Result};
use crate::field::Complex32;
use flate2::read::ZlibDecoder;
use std::io::Read;
use std::path::Path;

/// Bytes of a file's head.
pub(super) const HEAD: usize = 128;
pub(super) const INT8: u32 = 1;
pub(super) const INT32: u32 = 5;
pub(super) const UINT32: u32 = 6;
pub(super) const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Flag of a matrix with imaginary parts.
pub(super) const COMPLEX: u32 = 0x0800;
/// Deflate makes at most this many bytes of one.
const MOST_INFLATION: usize = 1032;
/// Bytes of a packed matrix in which its flags, sides and name stand.
const MATRIX_HEAD: usize = 4096;

/// One element: its type and its bytes.
struct Part<'a> {
    kind: u32,
    bytes: &'a [u8],
}

/// Elements, one after another.
struct Parts<'a> {
    rest: &'a [u8],
    big: bool,
}

impl<'a> Parts<'a> {
    fn word(&self, at: usize) -> Option<u32> {
        let bytes = self.rest.get(at..at + 4)?.try_into().ok()?;
        Some(if self.big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    /// The next element, or as much of its bytes as there is; none after the last.
    fn next(&mut self) -> Option<Part<'a>> {
        let tag = self.word(0)?;
        // A short element has its length in the type's upper half, and four bytes of values.
        let (kind, begin, length, padded) = match tag >> 16 {
            0 => (tag, 8, self.word(4)? as usize, (self.word(4)? as usize).checked_next_multiple_of(8)?),
            short => (tag & 0xffff, 4, short.min(4) as usize, 4),
        };
        // Packed elements are not padded.
        let padded = if kind == COMPRESSED { length } else { padded };
        let values = &self.rest[begin.min(self.rest.len())..];
        let bytes = &values[..length.min(values.len())];
        self.rest = &values[padded.min(values.len())..];
        Some(Part { kind, bytes })
    }
}

/// The type of values on the disk.
fn stored(kind: u32, big: bool) -> Option<Element> {
    use super::Class::{Float, Signed, Unsigned};
    let (class, bytes) = match kind {
        INT8 => (Signed, 1),
        2 => (Unsigned, 1),
        3 => (Signed, 2),
        4 => (Unsigned, 2),
        INT32 => (Signed, 4),
        UINT32 => (Unsigned, 4),
        7 => (Float, 4),
        9 => (Float, 8),
        12 => (Signed, 8),
        13 => (Unsigned, 8),
        _ => return None,
    };
    Some(Element { class, bytes, big })
}

/// What a matrix's first elements say.
struct Matrix<'a> {
    name: String,
    class: u32,
    complex: bool,
    shape: Vec<usize>,
    parts: Parts<'a>,
}

impl<'a> Matrix<'a> {
    /// Of the bytes of a matrix, the first of which may be all there is; none for what holds no numbers.
    fn of(bytes: &'a [u8], big: bool) -> Option<Self> {
        let mut parts = Parts { rest: bytes, big };
        let flags = parts.next().filter(|part| part.kind == UINT32)?;
        let flags = Parts { rest: flags.bytes, big }.word(0)?;
        let sides = parts.next().filter(|part| part.kind == INT32)?;
        let side = |b: &[u8]| usize::try_from(stored(INT32, big)?.real(b) as i64).ok();
        let shape = sides.bytes.chunks_exact(4).map(side).collect::<Option<Vec<usize>>>()?;
        let name = parts.next().filter(|part| part.kind == INT8)?;
        let name = String::from_utf8_lossy(name.bytes).into_owned();
        let (class, complex) = (flags & 0xff, flags & COMPLEX != 0);
        (6..=15).contains(&class).then_some(Self { name, class, complex, shape, parts })
    }

    fn what(&self) -> String {
        let kind = match (self.complex, self.class) {
            (true, _) => "complex",
            (false, 6) => "double",
            (false, 7) => "single",
            _ => "integer",
        };
        format!("{} {kind}", sides(&self.shape))
    }

    /// Its values, if all are there.
    fn values(mut self) -> Option<Values> {
        let count = self.shape.iter().try_fold(1usize, |n, side| n.checked_mul(*side))?;
        let big = self.parts.big;
        let mut part = || {
            let part = self.parts.next()?;
            let element = stored(part.kind, big)?;
            (part.bytes.len() / element.bytes == count).then_some((element, part.bytes))
        };
        let (element, real) = part()?;
        let floats = |element: Element, bytes: &[u8]| -> Vec<f64> {
            bytes.chunks_exact(element.bytes).map(|b| element.real(b)).collect()
        };
        if self.complex {
            let (other, imaginary) = part()?;
            let pairs = floats(element, real).into_iter().zip(floats(other, imaginary));
            return Some(Values::Complex(pairs.map(|(re, im)| Complex32::new(re as f32, im as f32)).collect()));
        }
        // Doubles that are whole numbers are stored as small ones: the class says what they are.
        Some(match self.class {
            6 | 7 => Values::Real(floats(element, real)),
            _ => element.values(real),
        })
    }
}

/// Reads one matrix.
pub(super) fn read(path: &Path, name: Option<&str>) -> Result<Array> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    let damaged =
        |what: &str| Error::input(path, format!("not a MATLAB file of version 5 to 7, or a damaged one: {what}"));
    let big = match bytes.get(126..HEAD) {
        Some(b"IM") => false,
        Some(b"MI") => true,
        _ => return Err(damaged("its head does not say its byte order (version 4 is not read)")),
    };
    let mut there = Vec::new();
    let mut parts = Parts { rest: &bytes[HEAD..], big };
    while let Some(part) = parts.next() {
        let unpacked = (part.kind == COMPRESSED).then(|| unpack(part.bytes, MATRIX_HEAD).unwrap_or_default());
        let matrix = match (&unpacked, part.kind) {
            // The matrix's own type and length stand before it.
            (Some(head), _) => head.get(8..).and_then(|head| Matrix::of(head, big)),
            (None, MATRIX) => Matrix::of(part.bytes, big),
            _ => None,
        };
        if let Some(matrix) = matrix {
            let plane = matrix.shape.iter().filter(|&&side| side > 1).count() >= 2;
            if name.is_some() || plane {
                there.push((matrix.name.clone(), matrix.what(), part));
            }
        }
    }
    let (own, what, part) = choose(path, name, &there)?;
    let cut = || damaged(&format!("`{own}` is cut off"));
    let unpacked = match part.kind {
        COMPRESSED => Some(unpack(part.bytes, part.bytes.len().saturating_mul(MOST_INFLATION)).ok_or_else(cut)?),
        _ => None,
    };
    let whole = unpacked.as_deref().map_or(Some(part.bytes), |bytes| bytes.get(8..));
    let matrix = whole.and_then(|bytes| Matrix::of(bytes, big)).ok_or_else(cut)?;
    let shape = matrix.shape.clone();
    let values = matrix.values().ok_or_else(cut)?;
    Ok(Array::from_fortran(shape, values, format!("`{own}`, {what}, MATLAB's order")))
}

/// At most so many bytes of what is packed.
fn unpack(bytes: &[u8], most: usize) -> Option<Vec<u8>> {
    let mut out = Vec::new();
    ZlibDecoder::new(bytes).take(most as u64).read_to_end(&mut out).ok()?;
    Some(out)
}
