//! A finished plate in other formats, streamed from its file: Zarr, frames and bands for printers, shapes for mask writers.

pub use super::format::Format;
use super::plate::Raster;
use super::reader::{Exported, Reader};
use super::tiff::packed;
use super::{mask, zarr};
use crate::error::{Error, Result};
use crate::files;
use crate::names::Named;
use crate::progress::Progress;
use serde::Serialize;
use std::path::Path;

/// How a plate is cut into exposures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Frames {
    /// Columns and rows of a frame; none: those of the printer's field, where its plate has one.
    pub size: Option<[u64; 2]>,
    /// Rows of bands as wide as the plate, in place of frames.
    pub band: Option<u64>,
    /// Pixels that neighbours share.
    pub overlap: u64,
    /// Whether every second row of frames runs from right to left.
    pub serpentine: bool,
    /// Whether levels fall linearly over the overlap, so that two exposures add up to one (8 bits only).
    pub window: bool,
}

/// Writes a finished plate in another format to `output`; pictures are cut into `frames`, shapes where that is asked for.
///
/// # Errors
/// Those of a plate that is missing, incomplete or damaged; [`Error::Parameter`] for a format that cannot hold it; [`Error::Io`].
pub fn export(folder: &Path, format: Format, frames: &Frames, output: &Path, progress: &Progress) -> Result<Exported> {
    let mut reader = Reader::open(folder)?;
    let Raster { width, height, .. } = reader.raster();
    if format == Format::Zarr {
        return zarr::write(&mut reader, output, progress);
    }
    if format.is_mask() {
        mask::check(&reader, format, format.name())?;
    }
    let size = match (frames.size, frames.band) {
        (Some(size), _) => Some(size),
        (None, Some(rows)) => Some([width, rows]),
        (None, None) if format.is_mask() => None,
        (None, None) => reader.plate().printer.as_ref().and_then(|printer| printer.field),
    };
    // A plate that fits one exposure is one.
    let size = size.or((!format.is_mask() && width * height <= MOST).then_some([width, height]));
    match size {
        Some(size) => write_frames(&mut reader, frames, size, output, format, progress),
        None if format.is_mask() => {
            let size = [width, height];
            mask::check_size(format, format.name(), size)?;
            progress.start("rectangles", 0);
            let bytes = mask::write(&mut reader, format, [0; 2], size, output, progress)?;
            Ok(Exported { files: 1, bytes })
        }
        None => {
            let what = "the plate is too large for one picture: give the size of an exposure, --frame 1920x1080, or --band 2048";
            Err(Error::parameter("frame", what))
        }
    }
}

/// Longest side of a frame [px]: a plate's.
const LONGEST: u64 = 1 << 22;
/// Pixels of a frame at most; one is held in memory.
const MOST: u64 = 1 << 28;

/// One exposure.
#[derive(Serialize)]
struct Exposure {
    file: String,
    /// First column and row in the plate's file.
    column: u64,
    row: u64,
    /// Where its middle stands, from the middle of the file, +y up [m].
    x: f64,
    y: f64,
}

fn write_frames(
    reader: &mut Reader,
    frames: &Frames,
    frame: [u64; 2],
    output: &Path,
    format: Format,
    progress: &Progress,
) -> Result<Exported> {
    let [width, height] = frame;
    let smallest = width.min(height);
    if !(1..=LONGEST).contains(&width) || !(1..=LONGEST).contains(&height) || width * height > MOST {
        let what =
            format!("{width}x{height}: sides of 1 to {LONGEST}, {MOST} pixels at most; lower bands, smaller frames");
        return Err(Error::parameter("frame", what));
    }
    if format.is_mask() {
        mask::check_size(format, format.name(), frame)?;
        if frames.overlap > 0 {
            return Err(Error::parameter("overlap", "shapes of neighbouring files do not overlap; leave it out"));
        }
    }
    if frames.overlap * 2 > smallest {
        return Err(Error::parameter("overlap", format!("{} is more than half of a frame", frames.overlap)));
    }
    let plate = reader.plate().clone();
    if frames.window && (plate.fringe.bits == 1 || frames.overlap == 0) {
        return Err(Error::parameter(
            "window",
            "levels fall over an overlap of 8-bit frames; this plate or overlap has none",
        ));
    }
    let Raster { width: file_width, height: file_height, pitch_x, pitch_y } = reader.raster();
    let size = [file_width, file_height];
    let step = [width - frames.overlap, height - frames.overlap];
    let count = |size: u64, step: u64| (size.saturating_sub(frames.overlap)).div_ceil(step).max(1);
    let counts = [count(size[0], step[0]), count(size[1], step[1])];
    files::output_folder(output)?;
    progress.start("frames", counts[0] * counts[1]);
    let mut exposures = Vec::new();
    let mut written = Exported { files: 0, bytes: 0 };
    for down in 0..counts[1] {
        for i in 0..counts[0] {
            progress.check()?;
            let across = if frames.serpentine && down % 2 == 1 { counts[0] - 1 - i } else { i };
            let [column, row] = [across * step[0], down * step[1]];
            let extension = if format == Format::Oasis { "oas" } else { format.name() };
            let name = format!("frame-{down:05}-{across:05}.{extension}");
            let path = output.join(&name);
            // What a panel or printer exposes is of one size where that was asked for; all else ends with the plate.
            let inside = [width.min(file_width - column), height.min(file_height - row)];
            let frame = if frames.size.is_some() { frame } else { inside };
            written.files += 1;
            written.bytes += if format.is_mask() {
                mask::write(reader, format, [column, row], inside, &path, progress)?
            } else {
                let mut levels = reader.rectangle([column, row], frame)?;
                if frames.window {
                    let first = [across == 0, down == 0];
                    let last = [across + 1 == counts[0], down + 1 == counts[1]];
                    window(&mut levels, frame, frames.overlap, first, last);
                }
                let bytes = match format {
                    Format::Bmp => bmp(&levels, frame, plate.fringe.bits, [pitch_x, pitch_y]),
                    _ => png_bytes(&levels, frame, plate.fringe.bits, [pitch_x, pitch_y], &path)?,
                };
                files::write_bytes(&path, &bytes)?;
                bytes.len() as u64
            };
            let middle = |from: u64, side: u64, whole: u64| from as f64 + 0.5 * side as f64 - 0.5 * whole as f64;
            exposures.push(Exposure {
                file: name,
                column,
                row,
                x: middle(column, frame[0], size[0]) * pitch_x,
                y: -middle(row, frame[1], size[1]) * pitch_y,
            });
            progress.advance(1);
        }
    }
    let list = serde_json::json!({
        "plate": plate.name,
        "size": size,
        "pitch": [pitch_x, pitch_y],
        "wavelength": plate.wavelength,
        "bits": plate.fringe.bits,
        "frame": frame,
        "overlap": frames.overlap,
        "window": if frames.window { "linear" } else { "none" },
        "order": if frames.serpentine { "boustrophedon" } else { "rows" },
        "exposures": exposures,
    });
    let text = serde_json::to_string_pretty(&list).unwrap_or_default() + "\n";
    // Last, so that a folder with a list is a whole set.
    files::write_bytes(&output.join("frames.json"), text.as_bytes())?;
    written.files += 1;
    written.bytes += text.len() as u64;
    Ok(written)
}

/// Lets levels fall towards edges that another frame overlaps; both ramps add up to one.
fn window(levels: &mut [u8], [width, height]: [u64; 2], overlap: u64, first: [bool; 2], last: [bool; 2]) {
    let weight = |at: u64, side: u64, axis: usize| {
        let from_low = (at as f64 + 0.5) / overlap as f64;
        let from_high = (side as f64 - at as f64 - 0.5) / overlap as f64;
        let low = if first[axis] { 1.0 } else { from_low.min(1.0) };
        let high = if last[axis] { 1.0 } else { from_high.min(1.0) };
        low * high
    };
    let across: Vec<f64> = (0..width).map(|c| weight(c, width, 0)).collect();
    for (row, line) in (0..height).zip(levels.chunks_exact_mut(width as usize)) {
        let down = weight(row, height, 1);
        for (level, across) in line.iter_mut().zip(&across) {
            *level = (f64::from(*level) * across * down).round() as u8;
        }
    }
}

/// Rows of levels, each padded to whole bytes, the first pixel high.
fn rows(levels: &[u8], width: u64, bits: u8) -> impl Iterator<Item = Vec<u8>> {
    levels.chunks_exact(width as usize).map(move |row| packed(row, bits))
}

fn png_bytes(levels: &[u8], [width, height]: [u64; 2], bits: u8, pitch: [f64; 2], path: &Path) -> Result<Vec<u8>> {
    let refused = |e: png::EncodingError| Error::input(path, e.to_string());
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width as u32, height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(if bits == 1 { png::BitDepth::One } else { png::BitDepth::Eight });
    let [xppu, yppu] = pitch.map(|pitch| (1.0 / pitch).round() as u32);
    encoder.set_pixel_dims(Some(png::PixelDimensions { xppu, yppu, unit: png::Unit::Meter }));
    let mut writer = encoder.write_header().map_err(refused)?;
    let data: Vec<u8> = rows(levels, width, bits).flatten().collect();
    writer.write_image_data(&data).map_err(refused)?;
    writer.finish().map_err(refused)?;
    Ok(out)
}

/// A Windows bitmap of 1 or 8 bits with a gray palette, rows from the bottom up.
fn bmp(levels: &[u8], [width, height]: [u64; 2], bits: u8, pitch: [f64; 2]) -> Vec<u8> {
    let colors: u32 = 1 << bits;
    let stride = ((width * u64::from(bits)).div_ceil(32) * 4) as usize;
    let first = 14 + 40 + 4 * colors;
    let data = stride as u32 * height as u32;
    let mut out = b"BM".to_vec();
    for value in [first + data, 0, first, 40, width as u32, height as u32] {
        out.extend(value.to_le_bytes());
    }
    for value in [1u16, u16::from(bits)] {
        out.extend(value.to_le_bytes());
    }
    let [x, y] = pitch.map(|pitch| (1.0 / pitch).round() as u32);
    for value in [0, data, x, y, colors, 0] {
        out.extend(value.to_le_bytes());
    }
    for i in 0..colors {
        let gray = (i * 255 / (colors - 1)) as u8;
        out.extend([gray, gray, gray, 0]);
    }
    let lines: Vec<Vec<u8>> = rows(levels, width, bits).collect();
    for mut line in lines.into_iter().rev() {
        line.resize(stride, 0);
        out.extend(line);
    }
    out
}
