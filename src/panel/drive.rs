//! Pattern → drive levels, in the one fixed order.

use super::drive_curve::Modulation;
use super::frame::{Applied, Frame, FrameMetadata};
use super::profile::PanelProfile;
use super::regional::PixelCurve;
use super::wavefront::Wavefront;
use super::{FringePattern, PhasePattern};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::field::grid::light;
use rayon::prelude::*;

/// What a panel should show: phases or amplitudes.
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {
    /// For a panel that modulates phase.
    Phase(PhasePattern),
    /// For a panel that modulates amplitude.
    Fringe(FringePattern),
}

impl Pattern {
    /// Where the pixels stand.
    pub fn grid(&self) -> Grid {
        match self {
            Self::Phase(p) => p.grid,
            Self::Fringe(p) => p.grid,
        }
    }
    /// Wavelength [m].
    pub fn wavelength(&self) -> f64 {
        match self {
            Self::Phase(p) => p.wavelength,
            Self::Fringe(p) => p.wavelength,
        }
    }
    /// Phases [rad] or amplitudes, row-major.
    pub fn values(&self) -> &[f32] {
        match self {
            Self::Phase(p) => &p.phase,
            Self::Fringe(p) => &p.transmittance,
        }
    }
    /// What is modulated.
    pub fn modulation(&self) -> Modulation {
        match self {
            Self::Phase(_) => Modulation::Phase,
            Self::Fringe(_) => Modulation::Amplitude,
        }
    }
}

/// A frame of levels, and how well the panel follows the pattern.
#[derive(Clone, Debug)]
pub struct Driven {
    /// The levels.
    pub frame: Frame,
    /// Root mean square of (shown − wished) phase on the circle [rad], or amplitude.
    pub rms_error: f64,
    /// Share of pixels whose wish lies outside the panel's range and got the nearest end of it.
    pub unreachable: f64,
    /// What a user should know.
    pub warnings: Vec<String>,
}

/// Turns a pattern into drive levels: the fixed order of the house.
///
/// 1. pattern + correction: the wavefront correction's phase is added (phase panels);
/// 2. wrap: the sum is taken modulo one turn;
/// 3. curve: each phase gets the level whose phase is nearest on the circle (each amplitude the nearest amplitude),
///    by the profile's curve at the pattern's wavelength.
///
/// Step 4, pack, is [`super::SignalLayout::pack`]: it keeps every level and only lays its bits into the video signal.
/// The metadata says what was applied; its encoding and origin are left for the caller to fill.
///
/// # Errors
/// [`Error::Parameter`] when pattern and panel do not fit in size, pitch or modulation, when a wish is not finite, and for a
/// profile as [`PanelProfile::checked`]; [`Error::OutOfRange`] for a wavelength that no laser has; [`Error::Calibration`] when the correction or the curve does not fit.
pub fn drive(pattern: &Pattern, correction: Option<&Wavefront>, profile: &PanelProfile) -> Result<Driven> {
    let (grid, wavelength) = (pattern.grid(), pattern.wavelength());
    profile.checked()?;
    light(wavelength)?;
    fit(grid, profile)?;
    if pattern.modulation() != profile.modulation() {
        let what = match profile.modulation() {
            Modulation::Phase => format!("an amplitude pattern on {}, which modulates phase", profile.name),
            Modulation::Amplitude => format!("a phase pattern on {}, which modulates amplitude", profile.name),
        };
        return Err(Error::parameter("pattern", what));
    }
    let (curve, mut warnings) = profile.pixel_curve(wavelength)?;
    warnings.extend(profile.warnings());
    if let Some(correction) = correction {
        if profile.modulation() == Modulation::Amplitude {
            let what = format!("{} modulates amplitude; a wavefront correction needs a phase panel", profile.name);
            return Err(Error::parameter("correction", what));
        }
        warnings.extend(correction.check(grid.width, grid.height, wavelength)?);
    }
    let wishes = pattern.values();
    if let Some(i) = wishes.iter().position(|v| !v.is_finite()) {
        let what = format!("the value at column {}, row {} is not finite", i % grid.width, i / grid.width);
        return Err(Error::parameter("pattern", what));
    }
    let levels = quantise(wishes, correction.map(|c| c.phase.as_slice()), &curve, grid.width);
    let mut metadata = FrameMetadata::new(profile, wavelength);
    metadata.applied = Applied {
        correction: correction.map(|c| c.name.clone()),
        curve: Some(format!("{} at {}", profile.name, crate::units::show_length(wavelength))),
        packing: None,
    };
    if levels.unreachable > 0.0 {
        warnings.push(format!(
            "{:.1} % of the pixels ask for more than the panel's range and got its nearest end",
            100.0 * levels.unreachable
        ));
    }
    let frame = Frame { width: grid.width, height: grid.height, bits: profile.bits, levels: levels.levels, metadata };
    Ok(Driven { frame, rms_error: levels.rms_error, unreachable: levels.unreachable, warnings })
}

/// Adds a wavefront correction to a frame that has none yet: its phases are read back through the curve, and steps 1–3
/// of [`drive`] are done on them.
///
/// # Errors
/// [`Error::Parameter`] when a correction has been applied already; otherwise as [`drive`].
pub fn correct(frame: &Frame, correction: &Wavefront) -> Result<Driven> {
    if let Some(applied) = &frame.metadata.applied.correction {
        let what = format!("`{applied}` is in the frame already; it would be applied twice");
        return Err(Error::parameter("correction", what));
    }
    let profile = &frame.metadata.panel;
    let phase = profile.pixel_curve(frame.metadata.wavelength)?.0.values(&frame.levels, frame.width)?;
    let pattern = PhasePattern::new(profile.grid()?, frame.metadata.wavelength, phase)?;
    let mut driven = drive(&Pattern::Phase(pattern), Some(correction), profile)?;
    driven.frame.metadata.encoding = frame.metadata.encoding.clone();
    driven.frame.metadata.origin = frame.metadata.origin.clone();
    Ok(driven)
}

/// Refuses a grid that is not the panel's.
pub(crate) fn fit(grid: Grid, profile: &PanelProfile) -> Result<()> {
    // Pitches are read from text: equal ones agree to rounding.
    let same = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-6;
    let (pitch_x, pitch_y) = (profile.pitch_x, profile.pitch_y);
    if (grid.width, grid.height) != (profile.width, profile.height)
        || !same(grid.pitch_x, pitch_x)
        || !same(grid.pitch_y, pitch_y)
    {
        let show = crate::units::show_length;
        let what = format!(
            "{}×{} samples of {}×{}; panel {} has {}×{} of {}×{}",
            grid.width,
            grid.height,
            show(grid.pitch_x),
            show(grid.pitch_y),
            profile.name,
            profile.width,
            profile.height,
            show(pitch_x),
            show(pitch_y)
        );
        return Err(Error::parameter("grid", what));
    }
    Ok(())
}

pub(crate) struct Levels {
    pub(crate) levels: Vec<u16>,
    pub(crate) rms_error: f64,
    pub(crate) unreachable: f64,
}

/// Nearest level of each wish (+ correction); rows in parallel, sums in row order.
pub(crate) fn quantise(wishes: &[f32], correction: Option<&[f32]>, curve: &PixelCurve, width: usize) -> Levels {
    let mut levels = vec![0; wishes.len()];
    let rows: Vec<(f64, usize)> = levels
        .par_chunks_mut(width)
        .enumerate()
        .map(|(row, levels)| {
            let (mut squares, mut unreachable) = (0.0, 0);
            for (i, level) in levels.iter_mut().enumerate() {
                let at = row * width + i;
                let wish = f64::from(wishes[at]) + correction.map_or(0.0, |c| f64::from(c[at]));
                let (nearest, miss) = curve.nearest(i, row, wish);
                *level = nearest;
                squares += miss * miss;
                unreachable += usize::from(curve.mean.unreachable(miss));
            }
            (squares, unreachable)
        })
        .collect();
    let count = wishes.len().max(1) as f64;
    let squares: f64 = rows.iter().map(|r| r.0).sum();
    let unreachable: usize = rows.iter().map(|r| r.1).sum();
    Levels { levels, rms_error: (squares / count).sqrt(), unreachable: unreachable as f64 / count }
}
