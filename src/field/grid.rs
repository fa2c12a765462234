//! The only code that turns sample indexes into metres and cycles per metre. (Quadratures over frequency have steps of
//! their own.)
//!
//! ```
//! use holodrive::field::Grid;
//!
//! let grid = Grid::new(1920, 1080, 8e-6, 8e-6)?;
//! // Centred, row 0 on top; pixels are cells about their samples.
//! assert!((grid.x(0) + 959.5 * 8e-6).abs() < 1e-15 && grid.y(0) > grid.y(1));
//! assert_eq!(grid.column(grid.x(7)), 7.0);
//! // Transform column 1 has one cycle over the panel; the last one runs the other way.
//! assert_eq!(grid.frequency_x(1), 1.0 / grid.extent_x());
//! assert_eq!(grid.frequency_x(1919), -grid.frequency_x(1));
//! # Ok::<(), holodrive::Error>(())
//! ```

use crate::error::{Error, Result};
use crate::units::{WAVELENGTHS, show_length};

/// A rectangular lattice of samples on a plane of constant z.
///
/// The lattice is centred on `center`: column `c` stands at x = center.x + (c − (width−1)/2)·pitch_x and row `r` at
/// y = center.y + ((height−1)/2 − r)·pitch_y, so row 0 is on top. A pixel is the cell round its sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Distance of neighbouring columns [m].
    pub pitch_x: f64,
    /// Distance of neighbouring rows [m].
    pub pitch_y: f64,
    /// Middle of the lattice in the hologram frame, (x, y) [m].
    pub center: [f64; 2],
}

impl Grid {
    /// A centred grid; refuses an empty one and a pitch that is not positive and finite.
    pub fn new(width: usize, height: usize, pitch_x: f64, pitch_y: f64) -> Result<Self> {
        if width == 0 || height == 0 {
            return Err(Error::out_of_range("size", format_args!("{width}×{height}"), "has no pixels"));
        }
        // 2³² samples are 34 GB of complex64: larger fields are streamed as tiles, never held.
        if width.checked_mul(height).is_none_or(|n| n > 1 << 32) {
            let size = format_args!("{width}×{height}");
            return Err(Error::out_of_range("size", size, "is too large for one field"));
        }
        positive("pitch", pitch_x)?;
        positive("pitch", pitch_y)?;
        Ok(Self { width, height, pitch_x, pitch_y, center: [0.0; 2] })
    }
    /// The same lattice about another middle [m].
    pub fn centered_at(mut self, center: [f64; 2]) -> Self {
        self.center = center;
        self
    }
    /// Number of samples.
    #[allow(clippy::len_without_is_empty)] // a grid has at least one sample
    pub fn len(&self) -> usize {
        self.width * self.height
    }
    /// Pixel pitch along x and y [m].
    pub fn pitch(&self) -> [f64; 2] {
        [self.pitch_x, self.pitch_y]
    }
    /// Position of a column [m].
    pub fn x(&self, column: usize) -> f64 {
        self.center[0] + offset(column as f64, self.width as f64, self.pitch_x)
    }
    /// Position of a row [m]; falls as the row rises.
    pub fn y(&self, row: usize) -> f64 {
        self.center[1] - offset(row as f64, self.height as f64, self.pitch_y)
    }
    /// Middle of the block of `size` columns and rows whose first are `at`; it may overhang the lattice [m].
    pub fn middle(&self, at: [usize; 2], size: [usize; 2]) -> [f64; 2] {
        let half = size.map(|size| 0.5 * (size as f64 - 1.0));
        [self.x(at[0]) + half[0] * self.pitch_x, self.y(at[1]) - half[1] * self.pitch_y]
    }
    /// Lowest and highest x, and y, of the outermost pixels' edges [m].
    pub fn edges(&self) -> [[f64; 2]; 2] {
        let (x, y) = (0.5 * self.pitch_x, 0.5 * self.pitch_y);
        [[self.x(0) - x, self.x(self.width - 1) + x], [self.y(self.height - 1) - y, self.y(0) + y]]
    }
    /// The (fractional) column that stands at x [m]: inverse of [`Grid::x`].
    pub fn column(&self, x: f64) -> f64 {
        (x - self.center[0]) / self.pitch_x + (self.width as f64 - 1.0) * 0.5
    }
    /// The (fractional) row that stands at y [m]: inverse of [`Grid::y`].
    pub fn row(&self, y: f64) -> f64 {
        (self.height as f64 - 1.0) * 0.5 - (y - self.center[1]) / self.pitch_y
    }
    /// Full width, pixels included [m].
    pub fn extent_x(&self) -> f64 {
        self.width as f64 * self.pitch_x
    }
    /// Full height, pixels included [m].
    pub fn extent_y(&self) -> f64 {
        self.height as f64 * self.pitch_y
    }
    /// Spatial frequency of transform column `k` [cycles/m]: k/(width·pitch) for the lower half, negative above.
    pub fn frequency_x(&self, k: usize) -> f64 {
        frequency(signed(k, self.width), self.width, self.pitch_x)
    }
    /// Spatial frequency along +y of transform row `k` [cycles/m]. Rows run downwards, so it is −k/(height·pitch)
    /// for the lower half: exp(+i2π·f_y·y) has its transform there.
    pub fn frequency_y(&self, k: usize) -> f64 {
        frequency(-signed(k, self.height), self.height, self.pitch_y)
    }
    /// Sine of the angle along x at which the wave of transform column `k` leaves, λ·f_x.
    pub fn sine_x(&self, k: usize, wavelength: f64) -> f64 {
        wavelength * signed(k, self.width) as f64 / self.extent_x()
    }
    /// Sine of the angle along y at which the wave of transform row `k` leaves, λ·f_y.
    pub fn sine_y(&self, k: usize, wavelength: f64) -> f64 {
        -wavelength * signed(k, self.height) as f64 / self.extent_y()
    }
    /// Highest |f_x| that the lattice carries: 1/(2·pitch_x) [cycles/m].
    pub fn limit_x(&self) -> f64 {
        0.5 / self.pitch_x
    }
    /// Highest |f_y| that the lattice carries: 1/(2·pitch_y) [cycles/m].
    pub fn limit_y(&self) -> f64 {
        0.5 / self.pitch_y
    }
}

/// Offset of sample `index` of `count` from their middle [m]; both may be of any integer type.
pub(crate) fn offset(index: f64, count: f64, pitch: f64) -> f64 {
    (index - (count - 1.0) * 0.5) * pitch
}

/// Smallest and largest length [m] that is taken for one: beyond them phases and areas lose their digits.
pub(crate) const LENGTHS: std::ops::RangeInclusive<f64> = 1e-12..=1e9;

/// Distances of a panel's pixels [m]: what lies beyond is a slip of the unit.
pub(crate) const PITCHES: std::ops::RangeInclusive<f64> = 50e-9..=1e-3;

/// Refuses a wavelength [m] that no panel is made for.
pub(crate) fn light(wavelength: f64) -> Result<()> {
    if WAVELENGTHS.contains(&wavelength) {
        return Ok(());
    }
    let value = if wavelength.is_finite() { show_length(wavelength) } else { format!("{wavelength} m") };
    Err(Error::out_of_range("wavelength", value, "must be 100nm to 30um; look at its unit"))
}

/// Refuses a length [m] that is not positive and finite, or none of a bench.
pub(crate) fn positive(name: &'static str, length: f64) -> Result<()> {
    if LENGTHS.contains(&length) {
        return Ok(());
    }
    let limit = if length.is_finite() && length > 0.0 {
        "must lie between 1e-12 and 1e9 m"
    } else {
        "must be greater than zero and finite"
    };
    Err(Error::out_of_range(name, format_args!("{length:e} m"), limit))
}

/// Refuses a distance [m] that is not finite.
pub(crate) fn finite(name: &'static str, distance: f64) -> Result<()> {
    if distance.is_finite() {
        return Ok(());
    }
    Err(Error::out_of_range(name, format_args!("{distance} m"), "is not finite"))
}

/// Spatial frequency of `cycles` over `count` samples [cycles/m].
pub(crate) fn frequency(cycles: i64, count: usize, pitch: f64) -> f64 {
    cycles as f64 / (count as f64 * pitch)
}

/// Index of a discrete transform as a signed number of cycles: −⌊n/2⌋ … ⌈n/2⌉−1.
fn signed(k: usize, n: usize) -> i64 {
    if k < n.div_ceil(2) { k as i64 } else { k as i64 - n as i64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lattice_is_centred_with_row_0_on_top() {
        let grid = Grid::new(4, 3, 2.0, 3.0).expect("grid");
        assert_eq!([0, 1, 2, 3].map(|c| grid.x(c)), [-3.0, -1.0, 1.0, 3.0]);
        assert_eq!([0, 1, 2].map(|r| grid.y(r)), [3.0, 0.0, -3.0]);
        let grid = grid.centered_at([10.0, -5.0]);
        for i in 0..3 {
            assert_eq!(grid.column(grid.x(i)), i as f64);
            assert_eq!(grid.row(grid.y(i)), i as f64);
        }
    }

    #[test]
    fn frequencies_are_the_exact_transform_grid() {
        let grid = Grid::new(4, 5, 0.5, 1.0).expect("grid");
        assert_eq!([0, 1, 2, 3].map(|k| grid.frequency_x(k)), [0.0, 0.5, -1.0, -0.5]);
        assert_eq!([0, 1, 2, 3, 4].map(|k| grid.frequency_y(k)), [0.0, -0.2, -0.4, 0.4, 0.2]);
    }

    #[test]
    fn degenerate_grids_are_refused() {
        for (w, h, p) in [(0, 1, 1.0), (1, 0, 1.0), (1, 1, 0.0), (1, 1, f64::NAN), (1 << 20, 1 << 20, 1.0)] {
            assert!(Grid::new(w, h, p, 1.0).is_err());
        }
    }
}
