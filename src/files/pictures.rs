//! Pictures of other programs, decoded in memory that follows from the length of their files: what a header promises is not
//! believed.

use crate::error::{Error, Result};
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes that a byte of a file unfolds to at most: deflate's limit, and about that of LZW and JPEG.
const MOST_OF_A_BYTE: u64 = 1100;

/// What any picture may take, however small its file is [bytes]: 3840 × 2160 pixels of four bytes.
const FREE: u64 = 1 << 25;

/// Longest file that is read [bytes].
const LONGEST: u64 = 1 << 31;

/// Decodes a picture by what its bytes are. The error is one line without the file's name.
pub(crate) fn decode(bytes: &[u8]) -> std::result::Result<image::DynamicImage, String> {
    let mut reader = image::ImageReader::with_format(Cursor::new(bytes), checked_format(bytes)?);
    reader.limits(limits(bytes.len() as u64));
    reader.decode().map_err(|why| why.to_string())
}

/// Columns and rows of a picture by what its bytes are. The error is one line without the file's name.
pub(crate) fn dimensions(bytes: &[u8]) -> std::result::Result<(u32, u32), String> {
    let unreadable = |why: image::ImageError| why.to_string();
    let format = checked_format(bytes)?;
    let mut reader = image::ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits(bytes.len() as u64));
    reader.into_dimensions().map_err(unreadable)
}

/// Kind of a picture, if what its directory says can be.
fn checked_format(bytes: &[u8]) -> std::result::Result<image::ImageFormat, String> {
    let format = image::guess_format(bytes).map_err(|why| why.to_string())?;
    if format == image::ImageFormat::Tiff && !tiff_directory_fits(&mut Cursor::new(bytes), bytes.len() as u64) {
        return Err("its directory promises more than the file holds".to_owned());
    }
    Ok(format)
}

/// Opens a picture.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for what is no picture, or unfolds to more than its file can hold.
pub(crate) fn open(path: &Path) -> Result<image::DynamicImage> {
    decode(&read(path)?).map_err(|why| Error::input(path, format!("not a picture that can be read: {why}")))
}

/// A picture's file, if it is none too long.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a longer one.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>> {
    let file = std::fs::File::open(path).map_err(Error::io(path))?;
    let mut bytes = Vec::new();
    file.take(LONGEST + 1).read_to_end(&mut bytes).map_err(Error::io(path))?;
    if bytes.len() as u64 > LONGEST {
        return Err(Error::input(
            path,
            format!("is longer than {} MB, the most that is read of a picture", LONGEST >> 20),
        ));
    }
    Ok(bytes)
}

/// What decoding a file of that length [bytes] may take.
pub(crate) fn limits(length: u64) -> image::Limits {
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(FREE + length.saturating_mul(MOST_OF_A_BYTE));
    limits
}

/// Whether each entry of a TIFF's first directory has no more values than the file has bytes for: its reader makes room for
/// them first, and prints a line of its own for a text that is too long.
pub(crate) fn tiff_directory_fits(file: &mut (impl Read + Seek), length: u64) -> bool {
    directory(file, length).unwrap_or(false)
}

fn directory(file: &mut (impl Read + Seek), length: u64) -> Option<bool> {
    let mut head = [0; 16];
    let there = file.read(&mut head).ok()?;
    let big = match &head[..4] {
        b"II*\0" | b"II+\0" => false,
        b"MM\0*" | b"MM\0+" => true,
        _ => return Some(false),
    };
    let long = head[2] == b'+' || head[3] == b'+';
    let number = |bytes: &[u8]| {
        let of = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        if big { bytes.iter().fold(0, of) } else { bytes.iter().rev().fold(0, of) }
    };
    let at = if long && there == 16 { number(&head[8..16]) } else { number(&head[4..8]) };
    let (count_bytes, entry_bytes, value_bytes) = if long { (8, 20, 8) } else { (2, 12, 4) };
    file.seek(SeekFrom::Start(at)).ok()?;
    let mut count = [0; 8];
    file.read_exact(&mut count[..count_bytes]).ok()?;
    let entries = number(&count[..count_bytes]);
    if entries.saturating_mul(entry_bytes) > length {
        return Some(false);
    }
    let mut entry = [0; 20];
    for _ in 0..entries {
        let entry = &mut entry[..entry_bytes as usize];
        file.read_exact(entry).ok()?;
        let size = match number(&entry[2..4]) {
            1 | 2 | 6 | 7 => 1,
            3 | 8 => 2,
            4 | 9 | 11 | 13 => 4,
            5 | 10 | 12 | 16..=18 => 8,
            _ => continue,
        };
        if number(&entry[4..4 + value_bytes]).saturating_mul(size) > length {
            return Some(false);
        }
    }
    Some(true)
}

/// Most values of an EXR, all channels together.
#[cfg(feature = "exr")]
const MOST_VALUES: u64 = 1 << 28;

/// Whether an EXR of that length [bytes] can hold what its head promises, in pixels and in each of its tiles: its reader makes
/// room for a whole tile, however large it is said to be. The error is one line without the file's name.
#[cfg(feature = "exr")]
pub(crate) fn exr_fits(head: &exr::meta::MetaData, length: u64) -> std::result::Result<(), String> {
    use exr::meta::BlockDescription;
    let most = (length.saturating_mul(MOST_OF_A_BYTE)).min(MOST_VALUES);
    let mut promised = 0u64;
    for header in &head.headers {
        let channels = header.channels.list.len() as u64;
        let values = |[x, y]: [usize; 2]| (x as u64).saturating_mul(y as u64).saturating_mul(channels);
        promised = promised.saturating_add(values([header.layer_size.x(), header.layer_size.y()]));
        if let BlockDescription::Tiles(tiles) = &header.blocks {
            // A tile may be larger than a small picture.
            let tile = values([tiles.tile_size.x(), tiles.tile_size.y()]);
            if tile > most.max(FREE / 8) {
                return Err(format!("has tiles of {tile} values: damaged?"));
            }
        }
    }
    if promised > most {
        return Err(format!("promises {promised} values, and has {length} bytes: damaged?"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A TIFF of one pixel, with a text of that many letters.
    fn tiff(letters: u32) -> Vec<u8> {
        let mut out = b"II*\0\x08\0\0\0\x0a\0".to_vec();
        let mut entry = |tag: u16, kind: u16, count: u32, value: u32| {
            out.extend([tag, kind].map(u16::to_le_bytes).concat());
            out.extend([count, value].map(u32::to_le_bytes).concat());
        };
        for (tag, value) in [(256, 1), (257, 1), (258, 8), (259, 1), (262, 1)] {
            entry(tag, 3, 1, value);
        }
        entry(270, 2, letters, 0);
        for (tag, value) in [(273, 134), (277, 1), (278, 1), (279, 1)] {
            entry(tag, 4, 1, value);
        }
        out.extend([0, 0, 0, 0, 200]);
        out
    }

    #[test]
    fn a_directory_that_promises_too_much_is_refused_before_it_is_read() {
        let whole = tiff(4);
        assert_eq!(decode(&whole).expect("picture").into_luma8().into_raw(), [200]);
        for letters in [whole.len() as u32 + 1, 1 << 30, u32::MAX] {
            assert!(decode(&tiff(letters)).unwrap_err().contains("promises more"));
        }
        for cut in 0..whole.len() {
            assert!(decode(&whole[..cut]).is_err(), "{cut}");
        }
    }

    #[test]
    fn a_picture_takes_no_more_than_its_file_can_hold() {
        let mut png = Vec::new();
        let mut encoder = png::Encoder::new(&mut png, 30_000, 30_000);
        encoder.set_color(png::ColorType::Rgba);
        let mut writer = encoder.write_header().expect("header");
        writer.write_chunk(png::chunk::IDAT, &[0x78, 0x9c, 3, 0, 0, 0, 0, 1]).expect("chunk");
        std::mem::forget(writer);
        let why = decode(&png).unwrap_err();
        assert!(why.to_lowercase().contains("limit") && !why.contains('\n'), "{why}");
    }
}
