//! Finding a panel's curve and bend from what a detector saw: the panel shows known frames, the powers come back as numbers.

pub mod cards;
pub mod curve;
pub mod flatness;
pub mod zernike;

pub use cards::{Card, cards};
pub use curve::{CurveFit, Power, Region, fit, fit_curve, read_powers, sweep_frame};
pub use flatness::{bend_from_steps, step_frames};

use crate::panel::{CorrectionFile, Curve, PanelProfile, Response};
use std::path::Path;

impl PanelProfile {
    /// The profile with a curve measured at a wavelength [m]: it takes the place of one for the same wavelength (within
    /// 1 nm) and of curves without a wavelength, which nobody measured.
    pub fn with_measured_curve(&self, wavelength: f64, curve: Curve) -> Self {
        let mut out = self.clone();
        out.responses.retain(|r| r.wavelength.is_some_and(|own| (own - wavelength).abs() > 1e-9));
        out.responses.insert(0, Response { wavelength: Some(wavelength), curve });
        out.unverified.retain(|key| key != "response");
        if !out.wavelengths.iter().any(|own| (own - wavelength).abs() <= 1e-9) {
            out.wavelengths.push(wavelength);
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
