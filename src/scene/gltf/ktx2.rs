//! KTX2 images whose texels are plain: 8-bit unsigned with one to four channels, stored as they are or by Zstandard.
//!
//! (Khronos KTX File Format Specification 2.0: header, level index, `supercompressionScheme` 0 and 2.) Basis Universal
//! (ETC1S and UASTC) is read by the crate `basisu`, with the feature of that name. Block compression (BC, ETC, ASTC) is
//! refused by name: a loader that needs it belongs to a graphics driver.

use std::io::Read;

/// What a file begins with.
pub(super) const IDENTIFIER: &[u8; 12] = b"\xabKTX 20\xbb\r\n\x1a\n";

/// Where the level index begins: after the identifier, nine words, four words and two long words.
const LEVEL_INDEX: usize = 80;

/// Channels of the Vulkan formats that are read, as the places of red, green, blue and alpha among them; 4 is none.
fn channels(format: u32) -> Option<(usize, [usize; 4])> {
    Some(match format {
        // VK_FORMAT_R8_UNORM, R8_SRGB: glTF's textures use red alone as it is, and colour as gray would be guessing.
        9 | 15 => (1, [0, 4, 4, 4]),
        // R8G8_UNORM, _SRGB.
        16 | 22 => (2, [0, 1, 4, 4]),
        // R8G8B8_UNORM, _SRGB; B8G8R8_UNORM, _SRGB.
        23 | 29 => (3, [0, 1, 2, 4]),
        30 | 36 => (3, [2, 1, 0, 4]),
        // R8G8B8A8_UNORM, _SRGB; B8G8R8A8_UNORM, _SRGB.
        37 | 43 => (4, [0, 1, 2, 3]),
        44 | 50 => (4, [2, 1, 0, 3]),
        _ => return None,
    })
}

/// Decodes the largest level of a single two-dimensional picture to RGBA; `most` bounds its bytes.
pub(super) fn decode(bytes: &[u8], side: u32, most: u64) -> Result<image::RgbaImage, String> {
    let cut = || "it is a KTX2 image that ends too early".to_owned();
    let word = |i: usize| {
        let at = IDENTIFIER.len() + 4 * i;
        bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes).ok_or_else(cut)
    };
    let long =
        |at: usize| bytes.get(at..at + 8).and_then(|b| b.try_into().ok()).map(u64::from_le_bytes).ok_or_else(cut);
    let (format, width, height) = (word(0)?, word(2)?, word(3)?);
    let (depth, layers, faces, scheme) = (word(4)?, word(5)?, word(6)?, word(8)?);
    if depth > 1 || layers > 1 || faces != 1 || height == 0 || width == 0 {
        return Err("it is a KTX2 image that is no single two-dimensional picture".to_owned());
    }
    if width > side || height > side {
        return Err(format!("it is a KTX2 image of {width} × {height} texels; at most {side} a side are read"));
    }
    let convert = "only plain 8-bit texels, uncompressed or by Zstandard, are read from KTX2; convert it to PNG";
    #[cfg(feature = "basisu")]
    if format == 0 {
        return basis_universal(bytes, width, height, most);
    }
    let Some((count, places)) = channels(format) else {
        return Err(match format {
            0 => format!("it is a KTX2 image in Basis Universal; {convert}"),
            _ => format!("it is a KTX2 image of Vulkan format {format}; {convert}"),
        });
    };
    let size = u64::from(width) * u64::from(height) * count as u64;
    if size > most {
        return Err(format!("it is a KTX2 image of {size} bytes; at most {most} are read"));
    }
    let (offset, length) = (long(LEVEL_INDEX)?, long(LEVEL_INDEX + 8)?);
    let stored = usize::try_from(offset)
        .ok()
        .zip(offset.checked_add(length).and_then(|end| usize::try_from(end).ok()))
        .and_then(|(begin, end)| bytes.get(begin..end))
        .ok_or_else(cut)?;
    let mut texels = Vec::new();
    match scheme {
        0 => texels.extend_from_slice(stored),
        2 => {
            let damaged = |why: String| format!("it is a KTX2 image whose texels cannot be unpacked ({why})");
            let mut source = stored;
            let unpacking =
                ruzstd::decoding::StreamingDecoder::new(&mut source).map_err(|why| damaged(why.to_string()))?;
            // One byte more than is wanted tells a file that lies about its size, without unpacking it all.
            unpacking.take(size + 1).read_to_end(&mut texels).map_err(|why| damaged(why.to_string()))?;
        }
        _ => return Err(format!("it is a KTX2 image of supercompression {scheme}; {convert}")),
    }
    if texels.len() as u64 != size {
        return Err(format!("it is a KTX2 image of {} bytes of texels, not {size}", texels.len()));
    }
    let rgba = texels.chunks_exact(count).flat_map(|texel| {
        // A missing colour is black, a missing alpha opaque.
        [0, 1, 2, 3].map(|c| texel.get(places[c]).copied().unwrap_or(if c == 3 { 255 } else { 0 }))
    });
    image::RgbaImage::from_raw(width, height, rgba.collect()).ok_or_else(cut)
}

/// Decodes the largest level of a picture in Basis Universal.
#[cfg(feature = "basisu")]
fn basis_universal(bytes: &[u8], width: u32, height: u32, most: u64) -> Result<image::RgbaImage, String> {
    use basisu::{DecodeFlags, TargetFormat, Transcoder};
    let size = 4 * u64::from(width) * u64::from(height);
    if size > most {
        return Err(format!("it is a KTX2 image of {size} bytes; at most {most} are read"));
    }
    let damaged =
        |why: basisu::Error| format!("it is a KTX2 image in Basis Universal that cannot be unpacked ({why:?})");
    let picture = Transcoder::new(bytes).map_err(damaged)?;
    if !picture.supports(TargetFormat::Rgba32) {
        return Err("it is a KTX2 image in Basis Universal of high dynamic range, which is not read".to_owned());
    }
    let texels = picture.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).map_err(damaged)?;
    image::RgbaImage::from_raw(width, height, texels)
        .ok_or_else(|| format!("it is a KTX2 image in Basis Universal that is not of {width} × {height} texels"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of one level.
    fn file(format: u32, size: (u32, u32), scheme: u32, data: &[u8]) -> Vec<u8> {
        let mut bytes = IDENTIFIER.to_vec();
        for word in [format, 1, size.0, size.1, 0, 0, 1, 1, scheme, 0, 0, 0, 0] {
            bytes.extend(u32::to_le_bytes(word));
        }
        for long in [0, 0, 104, data.len() as u64, 0] {
            bytes.extend(u64::to_le_bytes(long));
        }
        bytes.extend(data);
        bytes
    }

    fn read(bytes: &[u8]) -> Result<Vec<u8>, String> {
        decode(bytes, 1024, 1 << 20).map(image::RgbaImage::into_raw)
    }

    #[test]
    fn plain_texels_come_back_in_their_order() {
        let rgb = file(23, (2, 1), 0, &[1, 2, 3, 4, 5, 6]);
        assert_eq!(read(&rgb).expect("rgb"), [1, 2, 3, 255, 4, 5, 6, 255]);
        assert_eq!(read(&file(44, (1, 1), 0, &[1, 2, 3, 4])).expect("bgra"), [3, 2, 1, 4]);
        assert_eq!(read(&file(16, (1, 1), 0, &[7, 8])).expect("rg"), [7, 8, 0, 255]);
        // A Zstandard frame by hand: magic, single segment with a size of one byte (6), one raw last block of 6 bytes.
        let packed = [0x28, 0xb5, 0x2f, 0xfd, 0x20, 6, 0x31, 0, 0, 1, 2, 3, 4, 5, 6];
        assert_eq!(read(&file(23, (2, 1), 2, &packed)).expect("zstd"), [1, 2, 3, 255, 4, 5, 6, 255]);
    }

    /// UASTC: blocks of one colour each (mode 8: five bits of code, four bytes of colour).
    #[cfg(feature = "basisu")]
    #[test]
    fn basis_universal_gives_the_colours_of_its_blocks() {
        let block = |rgba: [u8; 4]| (0x17 | u128::from(u32::from_le_bytes(rgba)) << 5).to_le_bytes();
        let blocks = [block([10, 20, 30, 255]), block([200, 100, 0, 128])].concat();
        let (descriptor, data) = (104u32, 104u32 + 44);
        let mut bytes = IDENTIFIER.to_vec();
        for word in [0, 1, 6, 3, 0, 0, 1, 1, 0, descriptor, 44, 0, 0, 0, 0, 0, 0] {
            bytes.extend(u32::to_le_bytes(word));
        }
        for long in [u64::from(data), blocks.len() as u64, blocks.len() as u64] {
            bytes.extend(long.to_le_bytes());
        }
        // Data format descriptor: model 166 (UASTC), primaries 1, transfer 2 (sRGB), blocks of 4 × 4, one sample of RGBA.
        for word in
            [44u32, 0, 2 | 40 << 16, 166 | 1 << 8 | 2 << 16, 3 | 3 << 8, 16, 0, 3 << 24 | 127 << 16, 0, 0, u32::MAX]
        {
            bytes.extend(word.to_le_bytes());
        }
        bytes.extend(&blocks);
        let picture = decode(&bytes, 1024, 1 << 20).expect("picture");
        assert_eq!(picture.dimensions(), (6, 3));
        assert_eq!(picture.get_pixel(3, 2).0, [10, 20, 30, 255]);
        assert_eq!(picture.get_pixel(4, 0).0, [200, 100, 0, 128]);
        for end in 0..bytes.len() {
            assert!(read(&bytes[..end]).is_err(), "{end}");
        }
    }

    #[test]
    fn what_is_not_read_says_why() {
        let good = file(23, (2, 1), 0, &[1, 2, 3, 4, 5, 6]);
        for end in 0..good.len() {
            assert!(read(&good[..end]).is_err(), "{end}");
        }
        for (bytes, expected) in [
            (file(0, (4, 4), 1, &[0; 16]), "Basis"),
            (file(131, (4, 4), 0, &[0; 16]), "format 131"),
            (file(23, (2, 1), 3, &[0; 6]), "supercompression 3"),
            (file(23, (2, 1), 0, &[0; 5]), "5 bytes"),
            (file(23, (2, 1), 2, &[0; 9]), "unpacked"),
            (file(23, (2000, 1), 0, &[0; 6]), "2000"),
            (file(23, (1024, 1024), 0, &[0; 6]), "at most"),
            (file(23, (2, 0), 0, &[]), "two-dimensional"),
        ] {
            let said = read(&bytes).expect_err("refused");
            assert!(said.contains(expected), "{said}");
        }
    }
}
