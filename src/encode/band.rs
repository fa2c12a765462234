//! Limiting a field to a window of spatial frequencies.

use crate::error::{Error, Result};
use crate::field::{Complex32, Fft2, Field};
use crate::progress::Progress;
use crate::propagation::Aperture;

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

/// A centred window of `share` (0 … 1) of the grid's limits, with room for the rounding of frequencies on its border.
pub(super) fn centered(field: &Field, share: [f64; 2]) -> Aperture {
    let slack = 1.0 + 1e-9;
    Aperture::centered(field.grid.limit_x() * share[0] * slack, field.grid.limit_y() * share[1] * slack)
}

/// A centred window of shares above 0 and at most 1 of the grid's limits.
pub(super) fn of_share(field: &Field, share: [f64; 2]) -> Result<Aperture> {
    match share.iter().find(|share| !(**share > 0.0 && **share <= 1.0)) {
        Some(share) => Err(Error::parameter("band", format!("{share} must be above 0 and at most 1"))),
        None => Ok(centered(field, share)),
    }
}

/// The warning that is due when much of the light was dropped.
pub(super) fn lost(dropped: f64) -> Vec<String> {
    if dropped <= 0.1 {
        return Vec::new();
    }
    vec![format!("{:.0} % of the light lies outside the encoding's band and is lost", 100.0 * dropped)]
}
