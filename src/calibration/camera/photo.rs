//! Photos of the Fourier plane.

use crate::error::{Error, Result};
use crate::field::npy;
use crate::reconstruction::read_gray;
use std::path::Path;

/// What a camera saw: brightness of its pixels in any unit, in proportion to the light.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPhoto {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Brightness, row-major, row 0 on top.
    pub values: Vec<f32>,
}

impl CameraPhoto {
    /// A photo from its pixels.
    ///
    /// # Errors
    /// [`Error::Parameter`] for another number of them, fewer than 32 a side, one that is not finite, or all alike.
    pub fn new(width: usize, height: usize, values: Vec<f32>) -> Result<Self> {
        let refuse = |what: String| Err(Error::parameter("photo", what));
        if values.len() != width * height || width < 32 || height < 32 || width.max(height) > 1 << 15 {
            return refuse(format!("{} pixels of {width}×{height}; 32 … 32768 a side are wanted", values.len()));
        }
        if let Some(i) = values.iter().position(|v| !v.is_finite()) {
            return refuse(format!("the pixel at column {}, row {} is not finite", i % width, i / width));
        }
        if values.iter().all(|v| *v == values[0]) {
            return refuse("all pixels are alike: no light, or too much".into());
        }
        Ok(Self { width, height, values })
    }

    /// Reads a photo: `.npy` of numbers, H×W, or a gray picture (.png, .tif, .bmp; 8 or 16 bits, linear in the light).
    ///
    /// # Errors
    /// [`Error::Input`] for a file that is neither, or not right as [`CameraPhoto::new`] says.
    pub fn read(path: &Path) -> Result<Self> {
        let (width, height, values) = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
            let array = npy::read_real(path)?;
            if array.channels != 1 {
                return Err(Error::input(path, "a photo has two dimensions, height × width"));
            }
            (array.width, array.height, array.values)
        } else {
            read_gray(path)?
        };
        Self::new(width, height, values).map_err(|why| Error::input(path, why.to_string()))
    }

    /// Brightness from which a pixel may have taken all that it can.
    pub(super) fn full(&self) -> f32 {
        0.996 * self.values.iter().copied().fold(f32::NEG_INFINITY, f32::max)
    }

    /// Between pixels, bilinear; `None` outside.
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> Option<f32> {
        if !(x >= 0.0 && y >= 0.0 && x < (self.width - 1) as f64 && y < (self.height - 1) as f64) {
            return None;
        }
        let (i, j) = (x as usize, y as usize);
        let (u, v) = (x.fract() as f32, y.fract() as f32);
        let row = |j: usize| self.values[j * self.width + i] * (1.0 - u) + self.values[j * self.width + i + 1] * u;
        Some(row(j) * (1.0 - v) + row(j + 1) * v)
    }
}
