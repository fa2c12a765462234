//! An array: its sides, its numbers, where they stand.

use super::super::{Class, Element, Values};
use super::Read;
use super::bytes::{Bytes, Cursor, text};
use super::chunks::{self, Chunked, Filter, Index};
use super::objects::messages;
use crate::field::Complex32;

const SIDES: u16 = 0x01;
const TYPE: u16 = 0x03;
const LAYOUT: u16 = 0x08;
const FILTERS: u16 = 0x0b;
/// Deepest array that is read.
const MOST_SIDES: usize = 8;

/// What an array's elements are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Number(Element),
    /// Two floats at these places of an element of so many bytes: real and imaginary part.
    Pair {
        parts: [(usize, Element); 2],
        bytes: usize,
    },
}

impl Kind {
    pub(super) fn name(self) -> String {
        match self {
            Self::Pair { .. } => "complex".into(),
            Self::Number(element) => {
                let class = match element.class {
                    Class::Float => "float",
                    Class::Signed => "int",
                    _ => "uint",
                };
                format!("{class}{}", 8 * element.bytes)
            }
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::Number(element) => element.bytes,
            Self::Pair { bytes, .. } => bytes,
        }
    }
}

enum Layout<'a> {
    Compact(&'a [u8]),
    Contiguous { address: Option<u64>, length: u64 },
    Chunked(Chunked),
}

/// An array as the file describes it.
pub(super) struct Dataset<'a> {
    pub(super) shape: Vec<usize>,
    pub(super) kind: Kind,
    layout: Layout<'a>,
    filters: Vec<Filter>,
}

impl<'a> Dataset<'a> {
    /// The array at an address; none for what is no array of numbers.
    pub(super) fn read(bytes: &Bytes<'a>, address: u64) -> Read<Option<Self>> {
        let (mut shape, mut kind, mut layout, mut filters) = (None, None, None, Vec::new());
        for message in messages(bytes, address)? {
            let at = Cursor::of(message.bytes);
            match message.kind {
                SIDES => shape = Some(sides(at)?),
                TYPE => kind = of_type(at)?,
                LAYOUT => layout = Some(self::layout(at)?),
                FILTERS => filters = self::filters(at)?,
                _ => {}
            }
        }
        let (Some(shape), Some(kind), Some(layout)) = (shape, kind, layout) else { return Ok(None) };
        Ok(Some(Self { shape, kind, layout, filters }))
    }

    /// All its values.
    pub(super) fn values(&self, bytes: &Bytes) -> Read<Values> {
        let wide = self.kind.bytes();
        let count = self.shape.iter().try_fold(wide, |n, &side| n.checked_mul(side));
        // Deflate makes at most 1032 bytes of one.
        let whole = count.filter(|&n| n / 1100 <= bytes.len()).ok_or("promises more values than the file can hold")?;
        let stored: Vec<u8> = match &self.layout {
            Layout::Compact(bytes) => bytes.to_vec(),
            Layout::Contiguous { address: Some(address), length } => bytes.at(*address, *length)?.to_vec(),
            // What was never written is zero.
            Layout::Contiguous { address: None, .. } => vec![0; whole],
            Layout::Chunked(chunked) => chunks::read(bytes, chunked, &self.shape, wide, &self.filters)?,
        };
        let stored = stored.get(..whole).ok_or("has fewer values than its sides say")?;
        Ok(match self.kind {
            Kind::Number(element) => element.values(stored),
            Kind::Pair { parts, bytes } => {
                let part = |b: &[u8], (at, element): (usize, Element)| element.real(&b[at..at + element.bytes]) as f32;
                let pairs = stored.chunks_exact(bytes).map(|b| Complex32::new(part(b, parts[0]), part(b, parts[1])));
                Values::Complex(pairs.collect())
            }
        })
    }
}

fn sides(mut at: Cursor) -> Read<Vec<usize>> {
    let (version, rank) = (at.byte()?, usize::from(at.byte()?));
    at.skip(if version == 1 { 6 } else { 2 })?;
    if rank > MOST_SIDES {
        return Err(format!("an array of {rank} sides"));
    }
    (0..rank).map(|_| usize::try_from(at.long()?).map_err(|_| "a side is too long".into())).collect()
}

/// What numbers of a type are; none for what is no number.
fn of_type(mut at: Cursor) -> Read<Option<Kind>> {
    let (mut kind, head) = (None, at);
    let (class, flags) = (at.byte()?, at.number(3)?);
    let bytes = at.word()?;
    match class & 15 {
        0 | 1 => kind = number(head)?.map(|(element, _)| Kind::Number(element)),
        6 if flags & 0xffff == 2 && bytes <= 64 => {
            let mut parts = [None, None];
            for _ in 0..2 {
                let name = text(at.rest());
                let length = name.len() + 1;
                at.skip(if class >> 4 < 3 { length.next_multiple_of(8) } else { length })?;
                // The place of a member has as many bytes as the size of the whole needs: here one.
                let place = at.number(if class >> 4 < 3 { 4 } else { 1 })? as usize;
                at.skip(if class >> 4 == 1 { 28 } else { 0 })?;
                let Some((element, length)) = number(at)? else { return Ok(None) };
                at.skip(length)?;
                let which = match name.to_lowercase().as_str() {
                    "r" | "re" | "real" => 0,
                    "i" | "im" | "imag" => 1,
                    _ => return Ok(None),
                };
                if element.class != Class::Float || place + element.bytes > bytes {
                    return Ok(None);
                }
                parts[which] = Some((place, element));
            }
            if let [Some(re), Some(im)] = parts {
                kind = Some(Kind::Pair { parts: [re, im], bytes });
            }
        }
        _ => {}
    }
    Ok(kind)
}

/// A plain number, and the bytes of its description.
fn number(mut at: Cursor) -> Read<Option<(Element, usize)>> {
    let (class, flags, bytes) = (at.byte()? & 15, at.number(3)?, at.word()?);
    let big = flags & 1 != 0;
    let found = match (class, bytes) {
        (0, 1 | 2 | 4 | 8) => {
            let class = if flags & 8 != 0 { Class::Signed } else { Class::Unsigned };
            Some((Element { class, bytes, big }, 8 + 4))
        }
        // The order of a VAX is no order.
        (1, 2 | 4 | 8) if flags & 0x40 == 0 => Some((Element::float(bytes, big), 8 + 12)),
        _ => None,
    };
    Ok(found)
}

fn layout(mut at: Cursor) -> Read<Layout> {
    let version = at.byte()?;
    // Version 5 differs in how long a packed chunk may be, which its entries say themselves.
    if !(3..=5).contains(&version) {
        return Err(format!("its values are laid out in a way (version {version}) that is not read"));
    }
    match at.byte()? {
        0 => {
            let length = at.short()?;
            Ok(Layout::Compact(at.take(length)?))
        }
        1 => Ok(Layout::Contiguous { address: at.address()?, length: at.long()? }),
        2 if version == 3 => {
            let rank = usize::from(at.byte()?);
            let tree = at.address()?;
            let sides = (0..rank).map(|_| at.word()).collect::<Read<Vec<_>>>()?;
            Ok(Layout::Chunked(Chunked { sides, index: Index::Tree(tree) }))
        }
        2 => {
            let flags = at.byte()?;
            let (rank, wide) = (usize::from(at.byte()?), usize::from(at.byte()?));
            let sides = (0..rank).map(|_| Ok(at.number(wide)? as usize)).collect::<Read<Vec<_>>>()?;
            let index = match at.byte()? {
                1 => {
                    let length = if flags & 2 != 0 { Some(at.long()?) } else { None };
                    at.skip(if flags & 2 != 0 { 4 } else { 0 })?;
                    Index::Single { length, address: at.address()? }
                }
                2 => Index::Implicit(at.address()?),
                3 => {
                    at.skip(1)?;
                    Index::Fixed(at.address()?)
                }
                _ => {
                    return Err(
                        "its chunks are found in a way that is not read; write it with libver='earliest'".into()
                    );
                }
            };
            Ok(Layout::Chunked(Chunked { sides, index }))
        }
        _ => Err("its values stand in other files".into()),
    }
}

fn filters(mut at: Cursor) -> Read<Vec<Filter>> {
    let (version, count) = (at.byte()?, at.byte()?);
    at.skip(if version == 1 { 6 } else { 0 })?;
    (0..count)
        .map(|_| {
            let id = at.short()?;
            let named = version == 1 || id >= 256;
            let name = if named { at.short()? } else { 0 };
            at.skip(2)?;
            let values = at.short()?;
            at.skip(if version == 1 { name.next_multiple_of(8) } else { name })?;
            at.skip(4 * values + if version == 1 && values % 2 == 1 { 4 } else { 0 })?;
            match id {
                1 => Ok(Filter::Deflate),
                2 => Ok(Filter::Shuffle),
                3 => Ok(Filter::Sum),
                32000 => Ok(Filter::Lzf),
                _ => Err(format!("packed by filter {id}; deflate is read: write it with compression='gzip'")),
            }
        })
        .collect()
}
