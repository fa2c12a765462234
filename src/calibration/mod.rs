//! A panel's curve and wavefront error from what a detector saw: the panel shows known frames, the powers come back as
//! numbers; all of it and more from a camera's photos ([`camera_frames`], [`calibrate_camera`]); and cards whose errors an eye sees.
//!
//! ```
//! use holodrive::calibration::{Order, fit_curve};
//! use std::{f64::consts::TAU, path::Path};
//!
//! // Powers in the first order of a panel whose 256 levels span 2.2π.
//! let phase = |level: u16| 1.1 * TAU * f64::from(level) / 255.0;
//! let powers: Vec<(u16, f64)> = (0..256).map(|l| (l, 0.1 + 3.0 * (0.5 * phase(l)).sin().powi(2))).collect();
//! let found = fit_curve(&powers, 256, Order::First, Some(1), Path::new("powers.csv"))?;
//! assert!((found.range - 1.1 * TAU).abs() < 1e-4);
//! # Ok::<(), holodrive::Error>(())
//! ```

mod camera;
mod cards;
mod curve;
mod flatness;
mod series;
mod sweep;
pub mod zernike;

pub use camera::{
    CameraBench, CameraFit, CameraPhoto, CameraReport, CameraView, MAPPING, Mapping, PHOTO_ENDINGS, RANDOM,
    calibrate_camera, camera_frames, camera_photo_file, photo_file, photo_name,
};
pub use cards::{Card, card_frames, cards};
pub use curve::{CurveFit, CurveReport, MeasuredCurve, fit, fit_curve, measure_curve};
pub use flatness::{Flatness, step_frames, wavefront_from_files, wavefront_from_steps, write_correction};
pub use series::FrameSeries;
pub use sweep::{Grating, Order, Power, Region, Sweep, grating_frame, read_powers};

use crate::error::{Error, Result};
use crate::panel::{CorrectionFile, Curve, PanelProfile, Response};
use std::path::Path;

/// Refuses a file that is to be a profile and is not named so.
fn profile_name(path: &Path) -> Result<()> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return Ok(());
    }
    Err(Error::parameter("profile", format!("{}: a profile's name ends in .toml", path.display())))
}

impl PanelProfile {
    /// The profile with a curve measured at a wavelength [m]: it takes the place of one for the same wavelength (within
    /// 1 nm) and of curves without a wavelength, which nobody measured.
    pub fn with_measured_curve(&self, wavelength: f64, curve: Curve) -> Self {
        let mut out = self.clone();
        out.responses.retain(|r| r.wavelength.is_some_and(|own| (own - wavelength).abs() > 1e-9));
        out.responses.insert(0, Response { wavelength: Some(wavelength), curve });
        out.unverified.retain(|key| key != "response");
        if !out.wavelengths.iter().any(|own| (own - wavelength).abs() <= 1e-9) {
            // First, so that it is the one that the profile is used for where none is named.
            out.wavelengths.insert(0, wavelength);
        }
        out
    }

    /// The profile with a wavefront correction measured at a wavelength [m], in place of one for the same wavelength.
    pub fn with_correction(&self, wavelength: f64, file: &Path) -> Self {
        let mut out = self.clone();
        out.corrections.retain(|c| c.wavelength.is_some_and(|own| (own - wavelength).abs() > 1e-9));
        out.corrections.push(CorrectionFile { file: file.to_path_buf(), wavelength: Some(wavelength) });
        out
    }
}

#[cfg(test)]
mod tests;
