//! Limiting a field to what a stop in the Fourier plane lets through.

use super::Aperture;
use crate::error::Result;
use crate::field::{Complex32, Fft2, Field};
use crate::progress::Progress;

/// The field's part within the window, and the share of its energy that lay outside.
///
/// The transform is periodic over the grid: what leaves at one border of a sharp window rings in at the other.
///
/// # Errors
/// [`Error::Interrupted`] when asked to stop.
pub fn limit(field: &Field, aperture: &Aperture, progress: &Progress) -> Result<(Field, f64)> {
    let grid = field.grid;
    let mut samples = field.samples.clone();
    let before = field.energy();
    let transfer = |kx: usize, column: &mut [Complex32]| {
        let fx = grid.frequency_x(kx);
        for (ky, u) in column.iter_mut().enumerate() {
            if !aperture.passes(fx, grid.frequency_y(ky)) {
                *u = Complex32::new(0.0, 0.0);
            }
        }
    };
    Fft2::new(grid.width, grid.height).filter(&mut samples, grid.height, grid.height, transfer, progress);
    progress.check()?;
    let limited = Field { grid, wavelength: field.wavelength, samples };
    let dropped = if before > 0.0 { (1.0 - limited.energy() / before).max(0.0) } else { 0.0 };
    Ok((limited, dropped))
}
