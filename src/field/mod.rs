//! The scalar light field on a plane: complex samples on a [`Grid`] at one wavelength.

pub mod arrays;
pub mod fft;
pub mod grid;
mod memory;
pub mod npy;
mod npy_head;
pub mod npy_stack;
pub(crate) mod npy_zip;
mod phasor;
pub mod stored;

pub(crate) use fft::{Fft1, fast_length};
pub use fft::{Fft2, FftNum};
pub use grid::Grid;
pub(crate) use memory::zeroed;
pub use num_complex::{Complex, Complex32, Complex64};
pub(crate) use phasor::{angle, phasor};

use crate::error::{Error, Result};
use rayon::prelude::*;

/// Complex amplitude of a monochromatic scalar wave, sampled on the plane of its grid.
///
/// Row-major, row 0 on top (largest y), `width × height` samples. The time factor is exp(−iωt), so a longer optical
/// path is a larger phase; intensity is |u|², in units of the points' radiance.
#[derive(Clone, Debug, PartialEq)]
pub struct Field<T = f32> {
    /// Where the samples stand.
    pub grid: Grid,
    /// Vacuum wavelength λ [m].
    pub wavelength: f64,
    /// Samples u, row-major, `grid.len()` of them.
    pub samples: Vec<Complex<T>>,
}

impl<T: bytemuck::Zeroable> Field<T> {
    /// The dark field; its memory is taken page by page when it is first written.
    pub fn zeros(grid: Grid, wavelength: f64) -> Self {
        Self { grid, wavelength, samples: zeroed(grid.len()) }
    }
}

impl<T> Field<T> {
    /// Refuses samples whose number is not the grid's.
    pub(crate) fn check_samples(&self) -> Result<()> {
        let Self { grid, samples, .. } = self;
        if samples.len() == grid.len() {
            return Ok(());
        }
        let what = format!("{} samples for a grid of {}×{}", samples.len(), grid.width, grid.height);
        Err(Error::parameter("field", what))
    }
}

impl Field<f32> {
    /// A field from its samples; refused when their number is not the grid's.
    pub fn new(grid: Grid, wavelength: f64, samples: Vec<Complex32>) -> Result<Self> {
        let field = Self { grid, wavelength, samples };
        field.check_samples()?;
        Ok(field)
    }

    /// The wave exp(iφ) of these phases [rad]; refused when their number is not the grid's.
    ///
    /// ```
    /// use holodrive::field::{Field, Grid};
    /// let flat = Field::of_phases(Grid::new(2, 2, 8e-6, 8e-6)?, 532e-9, &[0.0; 4])?;
    /// assert_eq!(flat.energy(), 4.0);
    /// # Ok::<(), holodrive::Error>(())
    /// ```
    pub fn of_phases(grid: Grid, wavelength: f64, phases: &[f32]) -> Result<Self> {
        Self::new(grid, wavelength, phases.par_iter().copied().map(Complex32::cis).collect())
    }

    /// Σ|u|², without the pixel's area: what a unitary step keeps.
    pub fn energy(&self) -> f64 {
        // Row by row, so that the sum is the same for any number of threads.
        let row = |row: &[Complex32]| -> f64 { row.iter().map(|u| f64::from(u.norm_sqr())).sum() };
        let rows = self.samples.par_chunks(self.grid.width.max(1)).map(row);
        rows.collect::<Vec<_>>().into_iter().sum()
    }
    /// |u|² at each sample.
    pub fn intensity(&self) -> Vec<f32> {
        self.samples.par_iter().map(Complex::norm_sqr).collect()
    }
    /// The same samples in double precision.
    pub fn to_f64(&self) -> Field<f64> {
        let samples = self.samples.iter().map(|u| Complex64::new(u.re.into(), u.im.into())).collect();
        Field { grid: self.grid, wavelength: self.wavelength, samples }
    }
}

impl Field<f64> {
    /// The same samples rounded to single precision.
    pub fn to_f32(&self) -> Field<f32> {
        let samples = self.samples.iter().map(|u| Complex32::new(u.re as f32, u.im as f32)).collect();
        Field { grid: self.grid, wavelength: self.wavelength, samples }
    }
}

/// Relative L2 distance of complex fields, √(Σ|a−b|² / Σ|b|²); phases count, so a global sign or piston shows.
///
/// Infinite when `b` is dark and `a` is not, zero when both are.
pub fn relative_error<A, B>(a: &[Complex<A>], b: &[Complex<B>]) -> f64
where
    A: Copy + Into<f64>,
    B: Copy + Into<f64>,
{
    assert_eq!(a.len(), b.len(), "fields of one size are compared");
    let (mut difference, mut norm) = (0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (re, im): (f64, f64) = (b.re.into(), b.im.into());
        difference += (a.re.into() - re).powi(2) + (a.im.into() - im).powi(2);
        norm += re * re + im * im;
    }
    if difference == 0.0 { 0.0 } else { (difference / norm).sqrt() }
}
