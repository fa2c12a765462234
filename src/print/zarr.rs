//! A plate as a Zarr array, version 3, whose shards are its tiles.
//!
//! Codec `sharding_indexed` (zarr-specs, version 1.0): a shard's chunks one after another, then their places and lengths
//! as 64-bit numbers, then CRC-32C of those. One bit a pixel is a `bool` array with the codec `numcodecs.packbits`: a byte
//! that counts the padding bits, then eight pixels a byte, the first one high.

use super::plate::Raster;
use super::reader::{Exported, Reader};
use super::tiff::packed;
use crate::error::Result;
use crate::files;
use crate::progress::Progress;
use serde_json::json;
use std::path::Path;

/// Chunks inside of a shard have sides of at most this many pixels.
const CHUNK: u64 = 512;

pub(super) fn write(reader: &mut Reader, output: &Path, progress: &Progress) -> Result<Exported> {
    let plate = reader.plate().clone();
    let Raster { width, height, .. } = reader.raster();
    let across = width.div_ceil(plate.file.tile);
    // A multiple of eight that divides the tile; tiles are multiples of 64.
    let chunk = (1..=CHUNK.min(plate.file.tile) / 8)
        .map(|n| 8 * n)
        .filter(|n| plate.file.tile.is_multiple_of(*n))
        .max()
        .unwrap_or(64);
    let inner = if plate.fringe.bits == 1 {
        json!([{"name": "numcodecs.packbits", "configuration": {}}, {"name": "bytes"}])
    } else {
        json!([{"name": "bytes"}])
    };
    let metadata = json!({
        "zarr_format": 3,
        "node_type": "array",
        "shape": [height, width],
        "data_type": if plate.fringe.bits == 1 { "bool" } else { "uint8" },
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [plate.file.tile, plate.file.tile]}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "fill_value": if plate.fringe.bits == 1 { json!(false) } else { json!(0) },
        "codecs": [{"name": "sharding_indexed", "configuration": {
            "chunk_shape": [chunk, chunk],
            "codecs": inner,
            "index_codecs": [{"name": "bytes", "configuration": {"endian": "little"}}, {"name": "crc32c"}],
            "index_location": "end"
        }}],
        "dimension_names": ["y", "x"],
        "attributes": {
            "plate": plate.name,
            "pitch": [plate.raster.pitch_x, plate.raster.pitch_y],
            "wavelength": plate.wavelength,
            "rows": "row 0 on top",
        },
    });
    progress.start("shards", reader.tiles());
    let mut written = Exported { files: 0, bytes: 0 };
    for index in 0..reader.tiles() {
        progress.check()?;
        let levels = reader.tile(index)?;
        let bytes = shard(&levels, plate.file.tile as usize, chunk as usize, plate.fringe.bits);
        let folder = output.join("c").join((index / across).to_string());
        if index % across == 0 {
            files::output_folder(&folder)?;
        }
        files::write_bytes(&folder.join((index % across).to_string()), &bytes)?;
        written.files += 1;
        written.bytes += bytes.len() as u64;
        progress.advance(1);
    }
    // Last, so that an array that can be opened is whole.
    let text = serde_json::to_string_pretty(&metadata).unwrap_or_default() + "\n";
    files::write_bytes(&output.join("zarr.json"), text.as_bytes())?;
    written.files += 1;
    written.bytes += text.len() as u64;
    Ok(written)
}

fn shard(levels: &[u8], side: usize, chunk: usize, bits: u8) -> Vec<u8> {
    let (mut out, mut places) = (Vec::new(), Vec::new());
    for top in (0..side).step_by(chunk) {
        for left in (0..side).step_by(chunk) {
            let start = out.len();
            let rows = (top..top + chunk).map(|row| &levels[row * side + left..row * side + left + chunk]);
            if bits == 1 {
                out.push(0);
            }
            rows.for_each(|row| out.extend(packed(row, bits)));
            places.extend((start as u64).to_le_bytes());
            places.extend(((out.len() - start) as u64).to_le_bytes());
        }
    }
    let check = crc32c(&places);
    out.extend(places);
    out.extend(check.to_le_bytes());
    out
}

/// CRC-32C (Castagnoli, reflected polynomial 0x82F63B78), bit by bit: a shard's index is short.
fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0x82f6_3b78 & (crc & 1).wrapping_neg()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_are_castagnolis() {
        // RFC 3720, B.4: 32 zero bytes, and the check value of "123456789".
        assert_eq!(crc32c(&[0; 32]), 0x8a91_36aa);
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
    }
}
