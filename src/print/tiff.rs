//! The plate's file: an uncompressed tiled BigTIFF whose every byte has its place before the first tile is computed.
//!
//! So a tile is written where it belongs by whoever has computed it, in any order, from any number of processes, and the
//! finished file is the same. Tiles begin on multiples of [`ALIGN`] bytes, so that no two of them share a page of a network
//! file system. TIFF 6.0; BigTIFF as Adobe and libtiff have it (magic 43, offsets of eight bytes).

use super::geometry::{file_raster, tile_counts};
use super::plate::{Plate, Raster};
use crate::error::{Error, Result};
use crate::units::show_length;
use std::fs::File;
use std::path::Path;

/// Tiles begin on multiples of this.
const ALIGN: u64 = 4096;

/// Where everything stands in the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout {
    /// Header, tags and lists of tiles, and zeros up to the first tile.
    pub(super) head: Vec<u8>,
    /// Bytes of one tile.
    pub(super) tile_bytes: u64,
    /// From one tile to the next [bytes]; what lies between is zero.
    pub(super) stride: u64,
    /// Number of tiles.
    pub(super) tiles: u64,
    first: u64,
}

/// TIFF's types of values.
#[derive(Clone, Copy)]
enum Kind {
    Ascii = 2,
    Short = 3,
    Long = 4,
    Rational = 5,
    Long8 = 16,
}

/// Pixels a centimetre for a pitch [m]: the exact fraction where 32 bits hold it, else the nearest that they hold.
pub(super) fn resolution(pitch: f64) -> [u32; 2] {
    // Whole femtometres: finer than any pitch is known.
    let (mut a, mut b) = (10_000_000_000_000u64, (pitch * 1e15).round().max(1.0) as u64);
    let (mut before, mut now) = ([0u64, 1], [1u64, 0]);
    // Convergents of the continued fraction; the last is the fraction itself in lowest terms.
    while b != 0 {
        let next = [0, 1].map(|i| (a / b).saturating_mul(now[i]).saturating_add(before[i]));
        if next.iter().any(|&v| v > u64::from(u32::MAX)) {
            break;
        }
        (before, now) = (now, next);
        (a, b) = (b, a % b);
    }
    now.map(|v| v.max(1) as u32)
}

impl Layout {
    /// The layout of a plate's file.
    pub(super) fn new(plate: &Plate) -> Self {
        let Raster { width, height, pitch_x, pitch_y } = file_raster(plate);
        let counts = tile_counts(plate);
        let tiles = counts[0] * counts[1];
        let tile_bytes = plate.file.tile * plate.file.tile * u64::from(plate.fringe.bits) / 8;
        let stride = tile_bytes.next_multiple_of(ALIGN);
        let what = format!(
            "holodrive plate {}: {}-bit fringes, pitch {} x {}, wavelength {}; white is the highest level",
            plate.name,
            plate.fringe.bits,
            show_length(pitch_x),
            show_length(pitch_y),
            show_length(plate.wavelength)
        );
        let text = |text: &str| {
            let mut bytes: Vec<u8> = text.bytes().map(|b| if b.is_ascii() && b != 0 { b } else { b'?' }).collect();
            bytes.push(0);
            (Kind::Ascii, bytes.len() as u64, bytes)
        };
        let short = |v: u16| (Kind::Short, 1, v.to_le_bytes().to_vec());
        let long = |v: u64| (Kind::Long, 1, (v as u32).to_le_bytes().to_vec());
        let ratio = |pitch: f64| (Kind::Rational, 1, resolution(pitch).iter().flat_map(|v| v.to_le_bytes()).collect());
        let list = |values: &dyn Fn(u64) -> u64| {
            let bytes: Vec<u8> = (0..tiles).flat_map(|i| values(i).to_le_bytes()).collect();
            (Kind::Long8, tiles, bytes)
        };
        // The lists' own length does not depend on what is in them: the first tile's place is found with zeros.
        let build = |first: u64| {
            let tags = vec![
                (256u16, long(width)),
                (257, long(height)),
                (258, short(u16::from(plate.fringe.bits))),
                (259, short(1)),
                // Black is zero.
                (262, short(1)),
                (270, text(&what)),
                (277, short(1)),
                (282, ratio(pitch_x)),
                (283, ratio(pitch_y)),
                // Pixels a centimetre.
                (296, short(3)),
                (305, text(concat!("holodrive ", env!("CARGO_PKG_VERSION")))),
                (322, long(plate.file.tile)),
                (323, long(plate.file.tile)),
                (324, list(&|i| first + i * stride)),
                (325, list(&|_| tile_bytes)),
                (339, short(1)),
            ];
            let mut head = b"II\x2b\x00\x08\x00\x00\x00".to_vec();
            head.extend(16u64.to_le_bytes());
            head.extend((tags.len() as u64).to_le_bytes());
            let mut beside = 16 + 8 + 20 * tags.len() as u64 + 8;
            let mut values = Vec::new();
            for (tag, (kind, count, bytes)) in &tags {
                head.extend(tag.to_le_bytes());
                head.extend((*kind as u16).to_le_bytes());
                head.extend(count.to_le_bytes());
                if bytes.len() <= 8 {
                    let mut inline = bytes.clone();
                    inline.resize(8, 0);
                    head.extend(inline);
                } else {
                    head.extend(beside.to_le_bytes());
                    let mut padded = bytes.clone();
                    padded.resize(bytes.len().next_multiple_of(8), 0);
                    beside += padded.len() as u64;
                    values.extend(padded);
                }
            }
            head.extend(0u64.to_le_bytes());
            head.extend(values);
            head
        };
        let first = (build(0).len() as u64).next_multiple_of(ALIGN);
        let mut head = build(first);
        head.resize(first as usize, 0);
        Self { head, tile_bytes, stride, tiles, first }
    }

    /// Where a tile begins [bytes].
    pub(super) fn offset(&self, tile: u64) -> u64 {
        self.first + tile * self.stride
    }
    /// Length of the file [bytes].
    pub(super) fn length(&self) -> u64 {
        self.offset(self.tiles)
    }
}

/// Levels of `bits` bits as the file stores them: first pixel in the high bits.
pub(super) fn packed(levels: &[u8], bits: u8) -> Vec<u8> {
    if bits == 8 {
        return levels.to_vec();
    }
    levels.chunks(8).map(|eight| eight.iter().enumerate().fold(0, |byte, (i, &l)| byte | l << (7 - i))).collect()
}

/// Levels out of stored bytes.
pub(super) fn unpacked(bytes: &[u8], bits: u8) -> Vec<u8> {
    if bits == 8 {
        return bytes.to_vec();
    }
    bytes.iter().flat_map(|&byte| (0..8).map(move |i| byte >> (7 - i) & 1)).collect()
}

/// Reads `length` bytes at a place of a file.
///
/// # Errors
/// [`Error::Io`].
pub(super) fn read_at(file: &File, path: &Path, offset: u64, length: u64) -> Result<Vec<u8>> {
    let mut bytes = vec![0; length as usize];
    #[cfg(unix)]
    std::os::unix::fs::FileExt::read_exact_at(file, &mut bytes, offset).map_err(Error::io(path))?;
    #[cfg(not(unix))]
    {
        use std::io::{Read, Seek, SeekFrom};
        let mut file = file;
        file.seek(SeekFrom::Start(offset)).and_then(|_| file.read_exact(&mut bytes)).map_err(Error::io(path))?;
    }
    Ok(bytes)
}

/// Writes bytes at a place of a file.
///
/// # Errors
/// [`Error::Io`].
pub(super) fn write_at(file: &File, path: &Path, offset: u64, bytes: &[u8]) -> Result<()> {
    #[cfg(unix)]
    return std::os::unix::fs::FileExt::write_all_at(file, bytes, offset).map_err(Error::io(path));
    #[cfg(not(unix))]
    {
        use std::io::{Seek, SeekFrom, Write};
        let mut file = file;
        file.seek(SeekFrom::Start(offset)).and_then(|_| file.write_all(bytes)).map_err(Error::io(path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resolutions_are_exact_fractions() {
        assert_eq!(resolution(1e-6), [10_000, 1]);
        assert_eq!(resolution(0.35e-6), [200_000, 7]);
        assert_eq!(resolution(0.44e-6), [250_000, 11]);
        // 2540 dpi are 10 µm, 5080 dpi 5 µm.
        assert_eq!(resolution(5e-6), [2000, 1]);
        let [a, b] = resolution(0.333_333_333e-6);
        assert!((f64::from(a) / f64::from(b) * 0.333_333_333e-6 - 0.01).abs() < 1e-11);
    }

    #[test]
    fn bits_are_packed_first_pixel_high() {
        let levels: Vec<u8> = (0..64).map(|i| u8::from(i % 3 == 0)).collect();
        assert_eq!(packed(&levels, 1)[0], 0b1001_0010);
        assert_eq!(unpacked(&packed(&levels, 1), 1), levels);
    }
}
