//! The bend of a panel from phase-stepped interferograms (Bruning et al., *Applied Optics* 13, 2693 (1974)).
//!
//! The panel shows N frames of uniform phase 2πk/N; a detector that sees panel pixel by pixel, superposed with a reference
//! wave, reads I_k = a + b·cos(φ + 2πk/N). Then φ = atan2(−Σ I_k·sin(2πk/N), Σ I_k·cos(2πk/N)): no a, no b, and
//! harmonics of the curve's errors up to the (N − 2)th cancel.

use crate::error::{Error, Result};
use crate::panel::drive::Pattern;
use crate::panel::{Frame, PanelProfile, PhasePattern, Wavefront, drive};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The N frames of uniform phase to show, three or more.
///
/// # Errors
/// [`Error::Parameter`] for fewer than three steps; otherwise as [`drive`].
pub fn step_frames(profile: &PanelProfile, wavelength: f64, steps: usize) -> Result<Vec<Frame>> {
    if steps < 3 {
        return Err(Error::parameter("steps", format!("{steps}; a phase needs three or more")));
    }
    let grid = profile.grid()?;
    (0..steps)
        .map(|k| {
            let phase = vec![(TAU * k as f64 / steps as f64) as f32; grid.len()];
            let pattern = Pattern::Phase(PhasePattern::new(grid, wavelength, phase)?);
            Ok(drive(&pattern, None, profile)?.frame)
        })
        .collect()
}

/// The bend [rad, one turn] from N interferograms on the panel's pixels, in the order of [`step_frames`].
///
/// # Errors
/// [`Error::Parameter`] for fewer than three pictures or one of another size, or when their fringes have no contrast.
pub fn bend_from_steps(
    pictures: &[Vec<f32>],
    width: usize,
    height: usize,
    wavelength: f64,
    name: &str,
) -> Result<Wavefront> {
    let steps = pictures.len();
    if steps < 3 {
        return Err(Error::parameter("interferograms", format!("{steps}; a phase needs three or more")));
    }
    if let Some(k) = pictures.iter().position(|picture| picture.len() != width * height) {
        let what = format!("picture {k} has {} pixels, the panel {width}×{height}", pictures[k].len());
        return Err(Error::parameter("interferograms", what));
    }
    let turns: Vec<(f64, f64)> = (0..steps).map(|k| (TAU * k as f64 / steps as f64).sin_cos()).collect();
    let sums: Vec<(f64, f64)> = (0..width * height)
        .into_par_iter()
        .map(|i| {
            let terms = pictures.iter().zip(&turns).map(|(picture, (sin, cos))| {
                let v = f64::from(picture[i]);
                (v * sin, v * cos)
            });
            terms.fold((0.0, 0.0), |sum, term| (sum.0 + term.0, sum.1 + term.1))
        })
        .collect();
    if sums.iter().all(|(s, c)| s.hypot(*c) <= 1e-6) {
        return Err(Error::parameter("interferograms", "they do not differ: no fringes moved with the steps"));
    }
    let phase = sums.iter().map(|(s, c)| (-s).atan2(*c) as f32).collect();
    Wavefront::new(name, width, height, Some(wavelength), phase)
}
