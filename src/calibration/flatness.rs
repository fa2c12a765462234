//! The wavefront error of a panel from phase-stepped interferograms (Bruning et al., *Applied Optics* 13, 2693 (1974)).
//!
//! The panel shows N frames of uniform phase 2πk/N; a detector that sees panel pixel by pixel, superposed with a reference
//! wave, reads I_k = a + b·cos(φ + 2πk/N). Then φ = atan2(−Σ I_k·sin(2πk/N), Σ I_k·cos(2πk/N)): no a, no b, and
//! harmonics of the curve's errors up to the (N − 2)th cancel.

use super::profile_name;
use super::series::{Entry, FrameSeries};
use crate::error::{Error, Result};
use crate::field::npy;
use crate::panel::{PanelProfile, Pattern, PhasePattern, Wavefront, drive};
use crate::reconstruction::read_gray;
use crate::units::show_length;
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

/// The N frames of uniform phase to show, 3 to 64.
///
/// # Errors
/// [`Error::OutOfRange`] for another number of steps; otherwise as [`drive`].
pub fn step_frames(profile: &PanelProfile, wavelength: f64, steps: usize) -> Result<FrameSeries<'_>> {
    if !(3..=64).contains(&steps) {
        return Err(Error::out_of_range("steps", steps, "must be 3 … 64: a phase needs three or more"));
    }
    let grid = profile.grid()?;
    let make = move |k: usize| {
        let phase = vec![(TAU * k as f64 / steps as f64) as f32; grid.len()];
        let pattern = Pattern::Phase(PhasePattern::new(grid, wavelength, phase)?);
        let frame = drive(&pattern, None, profile)?.frame;
        let degrees = 360.0 * k as f64 / steps as f64;
        Ok(Entry { name: format!("step-{k:02}.png"), cells: degrees.to_string(), frame })
    };
    Ok(FrameSeries::new("degrees", steps, make))
}

/// An interferogram on the panel's pixels.
///
/// # Errors
/// [`Error::Input`] for a picture of another size, or one that is not finite.
fn interferogram(path: &Path, width: usize, height: usize) -> Result<Vec<f32>> {
    let (w, h, values) = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        let array = npy::read_real(path)?;
        if array.channels != 1 {
            return Err(Error::input(path, "an interferogram has two dimensions, height × width"));
        }
        (array.width, array.height, array.values)
    } else {
        read_gray(path)?
    };
    if (w, h) != (width, height) {
        let what = format!("is {w}×{h}, the panel {width}×{height}: map the camera's picture onto the panel's pixels");
        return Err(Error::input(path, what));
    }
    if let Some(at) = values.iter().position(|v| !v.is_finite()) {
        return Err(Error::input(path, format!("value at row {}, column {} is not finite", at / w, at % w)));
    }
    Ok(values)
}

/// The wavefront error [rad, one turn] from files of interferograms, .png or .npy, in the order of [`step_frames`].
///
/// # Errors
/// As [`wavefront_from_steps`]; [`Error::Input`] for a picture that does not fit.
pub fn wavefront_from_files(profile: &PanelProfile, wavelength: f64, files: &[PathBuf]) -> Result<Wavefront> {
    let (width, height) = (profile.width, profile.height);
    let pictures = files.iter().map(|path| interferogram(path, width, height)).collect::<Result<Vec<_>>>()?;
    wavefront_from_steps(&pictures, width, height, wavelength, "measured wavefront error")
}

/// The wavefront error [rad, one turn] from N interferograms on the panel's pixels, in the order of [`step_frames`].
///
/// # Errors
/// [`Error::Parameter`] for fewer than three pictures or one of another size, or when their fringes have no contrast.
pub fn wavefront_from_steps(
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

/// How flat a panel is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Flatness {
    /// From the lowest phase to the highest [rad].
    pub span: f64,
    /// Standard deviation of the phase [rad].
    pub rms: f64,
}

impl Flatness {
    /// Of a wavefront error.
    pub fn of(error: &Wavefront) -> Self {
        let count = error.phase.len().max(1) as f64;
        let mean = error.phase.iter().map(|p| f64::from(*p)).sum::<f64>() / count;
        let square = error.phase.iter().map(|p| (f64::from(*p) - mean).powi(2)).sum::<f64>() / count;
        let ends = error.phase.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &p| (l.min(p), h.max(p)));
        Self { span: f64::from(ends.1 - ends.0), rms: square.sqrt() }
    }
}

/// Writes the correction of a wavefront error, and where asked the profile with that correction: both or neither.
///
/// # Errors
/// As [`Wavefront::write`]; [`Error::Parameter`] for a profile whose name does not end in `.toml`.
pub fn write_correction(
    error: Wavefront,
    output: &Path,
    profile: &PanelProfile,
    wavelength: f64,
    into: Option<&Path>,
) -> Result<()> {
    error.conjugate().write(output)?;
    let Some(into) = into else { return Ok(()) };
    let beside = if into.parent() == output.parent() { output.file_name().map(Path::new) } else { None };
    let made = profile.with_correction(wavelength, beside.unwrap_or(output));
    let name = &profile.name;
    let remarks = [format!("{name} with the correction of its wavefront error at {}", show_length(wavelength))];
    let written = profile_name(into).and_then(|()| made.write(into, &remarks));
    if written.is_err() {
        for path in [output.to_path_buf(), npy::metadata_path(output)] {
            // What was written before the refusal goes again.
            let _ = std::fs::remove_file(path);
        }
    }
    written
}
