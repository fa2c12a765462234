//! Pictures of intensity, and how they are shown.

use crate::error::{Error, Result};
use crate::field::Grid;
use crate::files::{self, pictures};
use crate::scene::texture::srgb_from_linear;
use glam::DVec2;
use std::io::Write;
use std::path::Path;

/// A picture of linear light, row 0 on top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Linear values, row-major; any scale.
    pub values: Vec<f32>,
}

/// Which linear value is shown as white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// This value.
    White(f32),
    /// The value that this part (0 to 1) of the pixels does not pass.
    Percentile(f64),
}

impl Picture {
    /// Sums of sampled values over `width × height` equal cells of the rectangle ±`half` [m] about the grid's middle.
    ///
    /// Each sample stands for its pixel's area and is shared among the cells that it touches by area, so the sum over
    /// the picture is the sum over the rectangle.
    ///
    /// # Panics
    /// When there are fewer samples than the grid has.
    pub fn from_samples(grid: &Grid, samples: &[f32], half: DVec2, width: usize, height: usize) -> Self {
        let columns = overlaps(grid.width, |i| grid.x(i) - grid.center[0], grid.pitch_x, half.x, width);
        let rows = overlaps(grid.height, |i| grid.center[1] - grid.y(i), grid.pitch_y, half.y, height);
        let mut sums = vec![0f64; width * height];
        let mut line = vec![0f64; width];
        for (row, shares) in rows.iter().enumerate() {
            if shares.is_empty() {
                continue;
            }
            line.fill(0.0);
            let samples = &samples[row * grid.width..(row + 1) * grid.width];
            for (&value, shares) in samples.iter().zip(&columns) {
                for &(cell, share) in shares {
                    line[cell] += f64::from(value) * share;
                }
            }
            for &(cell, share) in shares {
                for (sum, value) in sums[cell * width..(cell + 1) * width].iter_mut().zip(&line) {
                    *sum += value * share;
                }
            }
        }
        Self { width, height, values: sums.into_iter().map(|v| v as f32).collect() }
    }

    /// The mean of pictures of one size: what a slow eye sees of frames shown one after another. None of none.
    ///
    /// # Panics
    /// When their sizes differ.
    pub fn mean(pictures: &[Self]) -> Option<Self> {
        let first = pictures.first()?;
        let mut values = vec![0.0; first.values.len()];
        for picture in pictures {
            assert!((picture.width, picture.height) == (first.width, first.height), "pictures of one size");
            values.iter_mut().zip(&picture.values).for_each(|(sum, v)| *sum += v / pictures.len() as f32);
        }
        Some(Self { values, ..*first })
    }

    /// The value shown as white.
    pub fn white(&self, scale: Scale) -> f32 {
        match scale {
            Scale::White(value) => value,
            Scale::Percentile(part) => {
                let mut sorted = self.values.clone();
                sorted.sort_by(f32::total_cmp);
                let at = ((sorted.len() - 1) as f64 * part.clamp(0.0, 1.0)).round() as usize;
                sorted.get(at).copied().unwrap_or(0.0)
            }
        }
    }

    /// Values divided by the white one, clipped to [0, 1] and sRGB-coded: what a screen is given.
    pub fn coded(&self, scale: Scale) -> Vec<f32> {
        let white = self.white(scale);
        let gain = if white > 0.0 { 1.0 / white } else { 0.0 };
        self.values.iter().map(|v| srgb_from_linear((v * gain).clamp(0.0, 1.0))).collect()
    }

    /// Writes the picture as an sRGB-coded 8-bit gray PNG with text chunks (keyword, text).
    pub fn write_png(&self, path: &Path, scale: Scale, texts: &[(&str, String)]) -> Result<()> {
        let bytes: Vec<u8> = self.coded(scale).iter().map(|v| (v * 255.0).round() as u8).collect();
        write_png(path, self.width, self.height, png::ColorType::Grayscale, &bytes, texts)
    }
}

/// Writes linear RGB as an sRGB-coded 8-bit PNG; `white` is the linear value shown as white.
pub fn write_rgb_png(
    path: &Path,
    width: usize,
    height: usize,
    rgb: &[[f32; 3]],
    white: f32,
    texts: &[(&str, String)],
) -> Result<()> {
    let gain = if white > 0.0 { 1.0 / white } else { 0.0 };
    let code = |v: f32| (srgb_from_linear((v * gain).clamp(0.0, 1.0)) * 255.0).round() as u8;
    let bytes: Vec<u8> = rgb.iter().flatten().map(|&v| code(v)).collect();
    write_png(path, width, height, png::ColorType::Rgb, &bytes, texts)
}

/// Writes 8-bit RGB that is sRGB-coded already, with text chunks (keyword, text).
pub fn write_coded_png(path: &Path, width: usize, height: usize, rgb: &[u8], texts: &[(&str, String)]) -> Result<()> {
    write_png(path, width, height, png::ColorType::Rgb, rgb, texts)
}

/// What the encoder of a PNG refuses, as the file's error.
pub(super) fn refused(path: &Path, error: png::EncodingError) -> Error {
    match error {
        png::EncodingError::IoError(source) => Error::Io { path: path.into(), source },
        other => Error::input(path, other.to_string()),
    }
}

fn write_png(
    path: &Path,
    width: usize,
    height: usize,
    color: png::ColorType,
    bytes: &[u8],
    texts: &[(&str, String)],
) -> Result<()> {
    files::write_whole(path, |out| encode(out, width, height, color, bytes, texts).map_err(|e| refused(path, e)))
}

/// Encodes 8-bit pixels as a PNG, sRGB, with text chunks (keyword, text).
pub(super) fn encode(
    out: impl Write,
    width: usize,
    height: usize,
    color: png::ColorType,
    bytes: &[u8],
    texts: &[(&str, String)],
) -> std::result::Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(out, width as u32, height as u32);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    for (keyword, text) in texts {
        encoder.add_itxt_chunk((*keyword).into(), text.clone())?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()
}

/// Reads a gray (or the luminance of a colour) picture of 8 or 16 bits as it is stored, 0 … 1: columns, rows, values.
///
/// # Errors
/// [`Error::Input`] for a file that is no picture, or one of more than 2²⁸ pixels.
pub fn read_gray(path: &Path) -> Result<(usize, usize, Vec<f32>)> {
    let refused = |why: String| Error::input(path, format!("not a readable picture: {why}"));
    let bytes = pictures::read(path)?;
    let (width, height) = pictures::dimensions(&bytes).map_err(refused)?;
    if u64::from(width) * u64::from(height) > 1 << 28 {
        return Err(Error::input(path, format!("{width}×{height} pixels are too many")));
    }
    let gray = pictures::decode(&bytes).map_err(refused)?.into_luma16();
    let values = gray.into_raw().into_iter().map(|v| f32::from(v) / 65535.0).collect();
    Ok((width as usize, height as usize, values))
}

/// For each sample, which cells of ±half it touches and with what share of its pixel.
fn overlaps(count: usize, at: impl Fn(usize) -> f64, pitch: f64, half: f64, cells: usize) -> Vec<Vec<(usize, f64)>> {
    let cell = 2.0 * half / cells as f64;
    (0..count)
        .map(|i| {
            let (low, high) = (at(i) - 0.5 * pitch + half, at(i) + 0.5 * pitch + half);
            let first = (low / cell).floor().max(0.0) as usize;
            let last = ((high / cell).ceil().max(0.0) as usize).min(cells);
            (first..last)
                .filter_map(|c| {
                    let share = (high.min((c + 1) as f64 * cell) - low.max(c as f64 * cell)) / pitch;
                    (share > 0.0).then_some((c, share))
                })
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_share_samples_by_area_and_keep_the_sum() {
        let grid = Grid::new(7, 5, 1.0, 1.0).expect("grid");
        let samples: Vec<f32> = (0..35).map(|i| i as f32).collect();
        let all = Picture::from_samples(&grid, &samples, DVec2::new(3.5, 2.5), 3, 4);
        let (sum, expected): (f32, f32) = (all.values.iter().sum(), samples.iter().sum());
        assert!((sum - expected).abs() < 1e-3 * expected, "{sum} {expected}");
        let same = Picture::from_samples(&grid, &samples, DVec2::new(3.5, 2.5), 7, 5);
        assert!(same.values.iter().zip(&samples).all(|(a, b)| (a - b).abs() < 1e-5), "not mirrored, row 0 on top");
    }
}
