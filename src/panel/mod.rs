//! Panels: what they are, what they are driven with, and what light they make of it.
//!
//! The order in which a pattern becomes a signal is fixed:
//!
//! ```text
//! pattern + wavefront correction ─▶ wrap to one turn ─▶ level curve ─▶ Frame ─▶ packing ─▶ VideoFrame
//! ```
//!
//! ```
//! use holodrive::panel::{PanelProfile, Pattern, PhasePattern, Simulation, drive, simulate};
//! use holodrive::progress::Progress;
//! use std::f32::consts::PI;
//!
//! let panel = PanelProfile::phase(4, 4, 8e-6, 8, 532e-9)?;
//! let pattern = PhasePattern::new(panel.grid()?, 532e-9, vec![PI; 16])?;
//! let frame = drive(&Pattern::Phase(pattern), None, &panel)?.frame;
//! assert_eq!(frame.levels[0], 128);
//! let light = simulate(&frame, &Simulation::default(), &Progress::new())?;
//! assert!((light.samples[0].re + 1.0).abs() < 1e-6);
//! # Ok::<(), holodrive::Error>(())
//! ```
//!
//! What has been done stands in the frame's metadata ([`frame::Applied`]), so that nothing is done twice.

mod beam;
mod bounds;
pub(crate) mod crosstalk;
pub mod drive;
mod drive_curve;
mod embedded;
mod fidelity;
pub mod frame;
mod frame_file;
mod nearest_table;
pub mod packing;
pub mod profile;
mod profile_file;
mod profile_keys;
mod profile_text;
pub mod regional;
pub mod response;
mod setup;
mod signal;
pub mod simulated;
pub mod vendor;
mod wavefront;
mod wavefront_file;

pub use drive::{Driven, Pattern, correct, drive};
pub use drive_curve::{DriveCurve, Modulation};
pub use fidelity::{Fidelity, drive_measured};
pub use frame::{Applied, EncodingRecord, Frame, FrameMetadata, Illumination, Origin};
pub use nearest_table::NearestTable;
pub use packing::VideoFrame;
pub use profile::{CorrectionFile, PanelCommands, PanelKind, PanelProfile};
pub use regional::PixelCurve;
pub use response::{Curve, PhaseSign, Response};
pub use setup::{Correction, Setup};
pub use signal::{Packing, SignalLayout};
pub use simulated::{Faults, Residue, Simulation, simulate, simulate_sequence};
pub use wavefront::Wavefront;

use crate::error::{Error, Result};
use crate::field::Grid;

/// Phases that a phase panel should show.
#[derive(Clone, Debug, PartialEq)]
pub struct PhasePattern {
    /// Where the pixels stand.
    pub grid: Grid,
    /// Wavelength at which the phases hold [m].
    pub wavelength: f64,
    /// Phase of each pixel [rad], any turn, row-major.
    pub phase: Vec<f32>,
}

/// Amplitude transmittances that an amplitude panel should show.
#[derive(Clone, Debug, PartialEq)]
pub struct FringePattern {
    /// Where the pixels stand.
    pub grid: Grid,
    /// Wavelength of the light that the fringes are for [m].
    pub wavelength: f64,
    /// Amplitude transmittance of each pixel, 0 … 1, row-major.
    pub transmittance: Vec<f32>,
}

impl PhasePattern {
    /// A pattern from its phases [rad]; refused when their number is not the grid's.
    pub fn new(grid: Grid, wavelength: f64, phase: Vec<f32>) -> Result<Self> {
        fits(grid, phase.len())?;
        Ok(Self { grid, wavelength, phase })
    }
}

impl FringePattern {
    /// A pattern from its amplitude transmittances; refused when their number is not the grid's.
    pub fn new(grid: Grid, wavelength: f64, transmittance: Vec<f32>) -> Result<Self> {
        fits(grid, transmittance.len())?;
        Ok(Self { grid, wavelength, transmittance })
    }
}

fn fits(grid: Grid, count: usize) -> Result<()> {
    if count == grid.len() {
        return Ok(());
    }
    Err(Error::parameter("pattern", format!("{count} values for a grid of {}×{}", grid.width, grid.height)))
}
