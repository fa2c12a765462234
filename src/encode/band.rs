//! Windows of spatial frequencies that an encoding's object may take.

use crate::error::{Error, Result};
use crate::field::Field;
use crate::progress::Progress;
use crate::propagation::Aperture;
pub use crate::propagation::limit;

/// The part of a field that an encoding takes as its object, the first of its steps, and the share that is dropped.
pub(super) fn object(field: &Field, aperture: &Aperture, progress: &Progress) -> Result<(Field, f64)> {
    let limited = limit(field, aperture, progress)?;
    progress.advance(1);
    progress.check()?;
    Ok(limited)
}

/// A centred window of `share` (0 … 1) of the grid's limits, with room for the rounding of frequencies on its border.
pub(super) fn centered(field: &Field, share: [f64; 2]) -> Aperture {
    let slack = 1.0 + 1e-9;
    Aperture::centered(field.grid.limit_x() * share[0] * slack, field.grid.limit_y() * share[1] * slack)
}

/// A centred window of shares above 0 and at most 1 of the grid's limits.
pub(super) fn of_share(field: &Field, share: [f64; 2]) -> Result<Aperture> {
    match share.iter().find(|share| !(**share > 0.0 && **share <= 1.0)) {
        Some(share) => Err(Error::out_of_range("band", share, "must be above 0 and at most 1")),
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
