//! A phase over the panel's pixels: the wavefront error of a panel, or the correction that undoes it.

use crate::error::{Error, Result};
use crate::units::show_length;
use serde::{Deserialize, Serialize};

/// A phase for each pixel of a panel, at the wavelength at which it was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wavefront {
    /// Where it comes from, as metadata and reports name it.
    pub name: String,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Wavelength at which the phases hold [m]; absent where the file does not say.
    pub wavelength: Option<f64>,
    /// Phase of each pixel [rad], row-major, row 0 on top. It may have been wrapped to one turn.
    pub phase: Vec<f32>,
}

impl Wavefront {
    /// A wavefront from its phases [rad]; refused when their number is not `width × height` or one is not finite.
    pub fn new(name: &str, width: usize, height: usize, wavelength: Option<f64>, phase: Vec<f32>) -> Result<Self> {
        if phase.len() != width * height {
            return Err(Error::calibration(name, format!("{} phases for {width}×{height} pixels", phase.len())));
        }
        if let Some(i) = phase.iter().position(|p| !p.is_finite()) {
            let what = format!("the phase at column {}, row {} is not finite", i % width, i / width);
            return Err(Error::calibration(name, what));
        }
        Ok(Self { name: name.into(), width, height, wavelength, phase })
    }

    /// The opposite phase: the correction of a measured wavefront error.
    pub fn conjugate(mut self) -> Self {
        for phase in &mut self.phase {
            *phase = -*phase;
        }
        self
    }

    /// Checks that it fits `width × height` pixels at a wavelength [m], and returns what to warn of.
    ///
    /// Phases wrapped to one turn cannot be carried to another wavelength: they are used as they are within 10 % (with
    /// a warning beyond 1 nm) and refused further away.
    pub fn check(&self, width: usize, height: usize, wavelength: f64) -> Result<Vec<String>> {
        if (self.width, self.height) != (width, height) {
            let what = format!(
                "the wavefront is {}×{} pixels, the panel {width}×{height}; take the file of this panel",
                self.width, self.height
            );
            return Err(Error::calibration(&self.name, what));
        }
        let Some(own) = self.wavelength else {
            return Ok(vec![format!("{}: the wavefront's wavelength is not known", self.name)]);
        };
        let distance = (own - wavelength).abs();
        let (has, wished) = (show_length(own), show_length(wavelength));
        if distance > 0.1 * own {
            let what =
                format!("the wavefront was measured at {has}, the light has {wished}; take the file for {wished}");
            return Err(Error::calibration(&self.name, what));
        }
        if distance > 1e-9 {
            return Ok(vec![format!("{}: the wavefront for {has} is used at {wished}", self.name)]);
        }
        Ok(Vec::new())
    }
}
