//! Arrays in chunks: where each stands, unpacked and laid into the whole.

use super::super::lzf;
use super::Read;
use super::bytes::Bytes;
use flate2::read::ZlibDecoder;
use std::io::Read as _;

/// Most nodes of a tree of chunks, and most chunks.
const MOST: usize = 1 << 20;

/// How an array is packed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Filter {
    Deflate,
    /// By LZF, as h5py does.
    Lzf,
    /// Bytes of the same weight stand together.
    Shuffle,
    /// A sum behind the bytes, which is left off.
    Sum,
}

/// Where chunks are found.
#[derive(Clone, Copy, Debug)]
pub(super) enum Index {
    /// A tree; none where nothing was written.
    Tree(Option<u64>),
    /// The one chunk; its length where it is packed.
    Single { length: Option<u64>, address: Option<u64> },
    /// One after another.
    Implicit(Option<u64>),
    /// A table.
    Fixed(Option<u64>),
}

/// An array in chunks.
pub(super) struct Chunked {
    /// Sides of a chunk, and the bytes of an element behind them.
    pub(super) sides: Vec<usize>,
    pub(super) index: Index,
}

/// One chunk: its first place along each side, where it stands, and which filters were left out.
struct Chunk {
    at: Vec<usize>,
    address: u64,
    length: u64,
    without: u32,
}

/// All bytes of an array, row by row; what was never written is zero.
pub(super) fn read(
    bytes: &Bytes,
    chunked: &Chunked,
    shape: &[usize],
    wide: usize,
    filters: &[Filter],
) -> Read<Vec<u8>> {
    let (own, sides) = chunked.sides.split_last().ok_or("its chunks have no sides")?;
    if sides.len() != shape.len() || sides.contains(&0) || *own != wide {
        return Err("its chunks do not fit its sides".into());
    }
    let chunk = sides.iter().try_fold(wide, |n, &side| n.checked_mul(side));
    let chunk = chunk.filter(|&n| n / 1100 <= bytes.len()).ok_or("its chunks are larger than the file can hold")?;
    let mut out = vec![0; shape.iter().product::<usize>() * wide];
    let found = find(bytes, chunked, shape, sides, chunk)?;
    for part in found {
        let stored = bytes.at(part.address, part.length)?;
        let unpacked = unpack(stored, filters, part.without, chunk, wide)?;
        lay(&unpacked, &part.at, sides, shape, wide, &mut out);
    }
    Ok(out)
}

fn find(bytes: &Bytes, chunked: &Chunked, shape: &[usize], sides: &[usize], whole: usize) -> Read<Vec<Chunk>> {
    let counts: Vec<usize> = shape.iter().zip(sides).map(|(side, chunk)| side.div_ceil(*chunk)).collect();
    let count = counts.iter().try_fold(1usize, |n, &c| n.checked_mul(c)).filter(|&n| n <= MOST);
    let count = count.ok_or("has too many chunks")?;
    let place = |number: usize| {
        let mut left = number;
        let mut at: Vec<usize> = counts
            .iter()
            .zip(sides)
            .rev()
            .map(|(count, side)| {
                let index = left % count;
                left /= count;
                index * side
            })
            .collect();
        at.reverse();
        at
    };
    let whole = whole as u64;
    Ok(match chunked.index {
        Index::Tree(None) | Index::Implicit(None) | Index::Fixed(None) | Index::Single { address: None, .. } => {
            Vec::new()
        }
        Index::Single { length, address: Some(address) } => {
            vec![Chunk { at: place(0), address, length: length.unwrap_or(whole), without: 0 }]
        }
        Index::Implicit(Some(first)) => {
            let at = |number: usize| Chunk {
                at: place(number),
                address: first.saturating_add(number as u64 * whole),
                length: whole,
                without: 0,
            };
            (0..count).map(at).collect()
        }
        Index::Tree(Some(tree)) => {
            let (mut out, mut visited) = (Vec::new(), 0);
            of_tree(bytes, tree, shape.len(), &mut visited, &mut out)?;
            out
        }
        Index::Fixed(Some(table)) => of_table(bytes, table, count, whole, place)?,
    })
}

fn of_tree(bytes: &Bytes, node: u64, rank: usize, visited: &mut usize, out: &mut Vec<Chunk>) -> Read<()> {
    *visited += 1;
    if *visited > MOST {
        return Err("its tree of chunks does not end".into());
    }
    let mut at = bytes.from(node)?;
    at.expect(b"TREE")?;
    let (kind, level, count) = (at.byte()?, at.byte()?, at.short()?);
    if kind != 1 {
        return Err("its tree of chunks is another".into());
    }
    at.skip(16)?;
    for _ in 0..count {
        let (length, without) = (at.word()? as u64, at.word()? as u32);
        let place = (0..rank).map(|_| Ok(at.long()? as usize)).collect::<Read<Vec<_>>>()?;
        at.skip(8)?;
        let child = at.long()?;
        if level > 0 {
            of_tree(bytes, child, rank, visited, out)?;
        } else {
            out.push(Chunk { at: place, address: child, length, without });
        }
    }
    Ok(())
}

/// Chunks of a table of fixed length.
fn of_table(
    bytes: &Bytes,
    table: u64,
    count: usize,
    whole: u64,
    place: impl Fn(usize) -> Vec<usize>,
) -> Read<Vec<Chunk>> {
    let mut at = bytes.from(table)?;
    at.expect(b"FAHD")?;
    at.skip(1)?;
    let (packed, entry, page_bits) = (at.byte()? == 1, usize::from(at.byte()?), at.byte()?);
    let entries = at.long()? as usize;
    let Some(block) = at.address()? else { return Ok(Vec::new()) };
    if entries < count || entry < if packed { 13 } else { 8 } || page_bits > 32 {
        return Err("its table of chunks does not fit".into());
    }
    let mut at = bytes.from(block)?;
    at.expect(b"FADB")?;
    at.skip(2 + 8)?;
    let page = 1usize << page_bits;
    let paged = entries > page;
    if paged {
        // A bit for each page, and a sum.
        at.skip(entries.div_ceil(page).div_ceil(8) + 4)?;
    }
    let mut out = Vec::new();
    for number in 0..count {
        if paged && number > 0 && number % page == 0 {
            at.skip(4)?;
        }
        let address = at.address()?;
        let length = if packed { at.number(entry - 12)? } else { whole };
        let without = if packed { at.word()? as u32 } else { 0 };
        if let Some(address) = address {
            out.push(Chunk { at: place(number), address, length, without });
        }
    }
    Ok(out)
}

/// The bytes of a chunk, its filters undone from the last to the first.
fn unpack(stored: &[u8], filters: &[Filter], without: u32, whole: usize, wide: usize) -> Read<Vec<u8>> {
    let mut bytes = stored.to_vec();
    for (number, filter) in filters.iter().enumerate().rev() {
        if without.checked_shr(number as u32).unwrap_or(0) & 1 == 1 {
            continue;
        }
        bytes = match filter {
            Filter::Deflate => {
                let mut out = Vec::new();
                // A sum may stand behind what is packed.
                let read = ZlibDecoder::new(&bytes[..]).take(whole as u64 + 4).read_to_end(&mut out);
                read.map_err(|_| "a chunk is damaged")?;
                out
            }
            Filter::Lzf => lzf::unpack(&bytes, whole).ok_or("a chunk is damaged")?,
            Filter::Shuffle => {
                let count = bytes.len() / wide;
                let mut out = bytes.clone();
                for (i, byte) in out.iter_mut().take(count * wide).enumerate() {
                    *byte = bytes[i % wide * count + i / wide];
                }
                out
            }
            Filter::Sum => {
                bytes.truncate(bytes.len().saturating_sub(4));
                bytes
            }
        };
    }
    if bytes.len() < whole {
        return Err("a chunk is cut off".into());
    }
    Ok(bytes)
}

/// Lays a chunk into the whole; what passes the edges is left out.
fn lay(chunk: &[u8], at: &[usize], sides: &[usize], shape: &[usize], wide: usize, out: &mut [u8]) {
    let Some((&last, rest)) = sides.split_last() else { return };
    let axis = rest.len();
    if at.len() != shape.len() || at[axis] >= shape[axis] {
        return;
    }
    let run = last.min(shape[axis] - at[axis]) * wide;
    let lines: usize = rest.iter().product();
    for line in 0..lines {
        // The line's place along each side but the last; one beyond an edge has none.
        let (mut left, mut to, mut step, mut inside) = (line, at[axis], shape[axis], true);
        for side in (0..axis).rev() {
            let here = at[side].saturating_add(left % sides[side]);
            left /= sides[side];
            inside &= here < shape[side];
            to += if inside { here * step } else { 0 };
            step *= shape[side];
        }
        if inside {
            let from = line * last * wide;
            out[to * wide..to * wide + run].copy_from_slice(&chunk[from..from + run]);
        }
    }
}
