//! Fringes of two amplitudes, for mirrors that send light along the axis or away from it.
//!
//! *Threshold* (Lee, *Applied Optics* 18, 3661 (1979)): open where the phase of u·r* is within ±πw of zero. The first
//! order of such a grating has the amplitude sin(πw)/π, so w = arcsin(|u|/A)/π makes it |u|/(πA): at most 1/π, 10.1 % of
//! the light. *Error diffusion*: the bipolar fringe, its rounding errors handed on (see [`super::error_diffusion`]): noisier
//! orders, an exact mean. *Direct search*: pixels of the thresholded fringe are turned over while that lowers the error of
//! the field within the band (Seldowitz, Allebach & Sweeney, *Applied Optics* 26, 2788 (1987)).

use super::fringe::{Fringe, Quantity};
use super::off_axis::{self, OffAxis, OffAxisKind};
use super::{EncodedPattern, amplitude_at, band, error_diffusion};
use crate::error::Result;
use crate::field::{Complex32, Field};
use crate::panel::simulated::illuminate;
use crate::panel::{EncodingRecord, FringePattern, Modulation, Pattern};
use crate::progress::Progress;
use crate::propagation::Aperture;
use rayon::prelude::*;
use serde_json::json;
use std::f32::consts::PI;

/// How a fringe becomes open or closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Binarisation {
    /// Pulse width by amplitude.
    #[default]
    Threshold,
    /// Serpentine error diffusion of the bipolar fringe.
    ErrorDiffusion,
    /// The threshold's result, improved pixel by pixel.
    DirectSearch {
        /// Passes over all pixels.
        sweeps: usize,
    },
}

/// Settings of the binary fringes.
#[derive(Clone, Debug, PartialEq)]
pub struct BinaryFringe {
    /// How a fringe becomes open or closed.
    pub method: Binarisation,
    /// Reference wave and normalisation, as for the bipolar fringes.
    pub fringe: OffAxis,
}

impl BinaryFringe {
    /// A method with the default carrier and half the band across it: one bit a pixel leaves its rounding noise in the
    /// rest of the band.
    pub fn new(method: Binarisation) -> Self {
        Self { method, fringe: OffAxis { across: 0.5, ..OffAxis::default() } }
    }
}

impl Binarisation {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Threshold => "binary-threshold",
            Self::ErrorDiffusion => "binary-diffusion",
            Self::DirectSearch { .. } => "binary-search",
        }
    }
}

pub(super) fn pattern(field: &Field, settings: &BinaryFringe, progress: &Progress) -> Result<EncodedPattern> {
    let made = off_axis::pattern(field, &settings.fringe, OffAxisKind::Bipolar, progress)?;
    let EncodedPattern { pattern, record, target, clipped, dropped, warnings } = made;
    let (grid, wavelength) = (field.grid, field.wavelength);
    let EncodingRecord { mut parameters, illumination, aperture, .. } = record;
    let greatest = amplitude_at(&target, settings.fringe.percentile)?;
    let mut reference = vec![Complex32::new(1.0, 0.0); grid.len()];
    illuminate(&mut reference, grid, wavelength, illumination)?;
    let fringe = Fringe::new(Quantity::Bipolar, greatest, 1.0);
    let threshold = || target.samples.par_iter().zip(&reference).map(|(&u, &r)| fringe.pulse(u, r)).collect();
    let (open, scale) = match settings.method {
        Binarisation::Threshold => (threshold(), 1.0 / (PI * greatest)),
        Binarisation::ErrorDiffusion => {
            let mut open = pattern.values().to_vec();
            error_diffusion::binarise(&mut open, grid.width);
            (open, 0.25 / greatest)
        }
        Binarisation::DirectSearch { sweeps } => {
            parameters.insert("sweeps".into(), json!(sweeps));
            let mut open: Vec<f32> = threshold();
            if let Some(aperture) = &aperture {
                search(&mut open, &target, &reference, aperture, sweeps, progress)?;
            }
            (open, 1.0 / (PI * greatest))
        }
    };
    let method = settings.method.name().into();
    let modulation = Modulation::Amplitude;
    let record = EncodingRecord { method, modulation, parameters, illumination, aperture, scale: scale.into() };
    let pattern = Pattern::Fringe(FringePattern::new(grid, wavelength, open)?);
    Ok(EncodedPattern { pattern, record, target, clipped, dropped, warnings })
}

/// Turns pixels over while that lowers Σ|filter(open·r) − s·u|², s the best scale of the pattern given.
///
/// With e the error field and h the band filter's response, turning pixel x over by δ = ±1 changes the sum by
/// 2δ·Re(e*(x)·r(x)) + h(0), and e by δ·r(x)·h. Faint taps of h are left out within a sweep; every sweep begins with the
/// exact error.
fn search(
    open: &mut [f32],
    wanted: &Field,
    reference: &[Complex32],
    aperture: &Aperture,
    sweeps: usize,
    progress: &Progress,
) -> Result<()> {
    /// Taps of h below this share of h(0) are left to the next sweep's exact error.
    const FAINT: f32 = 1e-3;
    let (grid, wavelength) = (wanted.grid, wanted.wavelength);
    let (width, height) = (grid.width, grid.height);
    let mut impulse = Field::zeros(grid, wavelength);
    impulse.samples[0] = Complex32::new(1.0, 0.0);
    let response = band::limit(&impulse, aperture, progress)?.0.samples;
    let taps: Vec<(usize, usize, Complex32)> = response
        .iter()
        .enumerate()
        .filter(|(_, h)| h.norm() > FAINT * response[0].re)
        .map(|(i, h)| (i % width, i / width, *h))
        .collect();
    let own = response[0].re;
    progress.start("direct search", sweeps as u64);
    // The scale stays: with the best one for every sweep, the darkest pattern would be the best.
    let mut scale = None;
    for _ in 0..sweeps {
        progress.check()?;
        let samples = open.iter().zip(reference).map(|(t, r)| r * t).collect();
        let mut error = band::limit(&Field { grid, wavelength, samples }, aperture, progress)?.0.samples;
        let cross: f64 = error.iter().zip(&wanted.samples).map(|(g, u)| f64::from((g * u.conj()).re)).sum();
        let scale = *scale.get_or_insert((cross / wanted.energy()) as f32);
        error.iter_mut().zip(&wanted.samples).for_each(|(e, u)| *e -= u * scale);
        for at in 0..open.len() {
            if at.is_multiple_of(width) {
                progress.check()?;
            }
            let change = 1.0 - 2.0 * open[at];
            if 2.0 * change * (error[at].conj() * reference[at]).re + own >= 0.0 {
                continue;
            }
            open[at] += change;
            let (x, y) = (at % width, at / width);
            for &(dx, dy, h) in &taps {
                // The band filter is periodic, and so is its response.
                let to = (y + dy) % height * width + (x + dx) % width;
                error[to] += reference[at] * h * change;
            }
        }
        progress.advance(1);
    }
    Ok(())
}
