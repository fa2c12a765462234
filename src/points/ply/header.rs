//! The text head of a PLY file.

use crate::error::{Error, Result};
use std::io::BufRead;
use std::path::Path;

/// A head longer than this is not a head: bounds what a file without `end_header` makes us read.
const LONGEST_HEADER: usize = 1 << 20;

/// How the values after the head are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// A PLY number type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
    pub(super) fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }
    /// The value of the first `size()` bytes.
    pub(super) fn decode(self, bytes: &[u8], encoding: Encoding) -> f64 {
        let mut b = [0u8; 8];
        let n = self.size();
        b[..n].copy_from_slice(&bytes[..n]);
        if encoding == Encoding::Big {
            b[..n].reverse();
        }
        let (two, four) = ([b[0], b[1]], [b[0], b[1], b[2], b[3]]);
        match self {
            Self::I8 => f64::from(b[0] as i8),
            Self::U8 => f64::from(b[0]),
            Self::I16 => f64::from(i16::from_le_bytes(two)),
            Self::U16 => f64::from(u16::from_le_bytes(two)),
            Self::I32 => f64::from(i32::from_le_bytes(four)),
            Self::U32 => f64::from(u32::from_le_bytes(four)),
            Self::F32 => f64::from(f32::from_le_bytes(four)),
            Self::F64 => f64::from_le_bytes(b),
        }
    }
}

/// One property: a scalar, or a list with the type of its count.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    pub(super) list_count: Option<Scalar>,
}

/// One element and how often it stands in the file.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

/// The parsed head.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) comments: Vec<String>,
    pub(super) elements: Vec<Element>,
}

/// Reads the head; afterwards `input` stands on the first byte of data.
pub(super) fn read(input: &mut impl BufRead, path: &Path) -> Result<Header> {
    let mut length = 0;
    let mut number = 0;
    let mut encoding = None;
    let mut comments = Vec::new();
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let mut line = Vec::new();
        let limit = (LONGEST_HEADER - length) as u64 + 1;
        std::io::Read::take(&mut *input, limit).read_until(b'\n', &mut line).map_err(Error::io(path))?;
        length += line.len();
        number += 1;
        if line.last() != Some(&b'\n') {
            return Err(Error::input(path, "not a PLY file, or truncated: its header does not end"));
        }
        let line = String::from_utf8_lossy(&line);
        let line = line.trim_end();
        let refuse = |what: &str| Err(Error::input(path, format!("header line {number}: {what}: `{line}`")));
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        if number == 1 {
            if words.first() == Some(&"ply") && line.contains('\r') {
                let what = "its lines end by a carriage return alone, as on very old machines; end them by a line feed";
                return Err(Error::input(path, what));
            }
            if words != ["ply"] {
                return Err(Error::input(path, "not a PLY file: its first line is not `ply`"));
            }
            continue;
        }
        match words.as_slice() {
            ["format", name, _version] => {
                encoding = Some(match *name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return refuse("unknown format"),
                });
            }
            ["comment" | "obj_info", ..] => {
                comments.push(line.split_once(char::is_whitespace).map_or("", |(_, rest)| rest).to_string());
            }
            ["element", name, count] => match count.parse() {
                Ok(count) => elements.push(Element { name: (*name).into(), count, properties: Vec::new() }),
                Err(_) => return refuse("the count is not a number"),
            },
            ["property", rest @ ..] => {
                let (list_count, kind, name) = match rest {
                    ["list", count, kind, name] => (Some(*count), *kind, *name),
                    [kind, name] => (None, *kind, *name),
                    _ => return refuse("not a property"),
                };
                let Some(element) = elements.last_mut() else { return refuse("a property before any element") };
                let (Some(scalar), Some(list_count)) =
                    (Scalar::parse(kind), list_count.map_or(Some(None), |c| Scalar::parse(c).map(Some)))
                else {
                    return refuse("unknown number type");
                };
                element.properties.push(Property { name: name.into(), scalar, list_count });
            }
            ["end_header"] => break,
            [] => {}
            _ => return refuse("not understood"),
        }
    }
    let encoding = encoding.ok_or_else(|| Error::input(path, "its header names no format"))?;
    Ok(Header { encoding, comments, elements })
}
