//! Slices of a picture with depth, or of a focal stack, made layers of light.

use super::{Layer, bytes, compute};
use crate::error::{Error, Result};
use crate::field::{Complex32, Field, Grid};
use crate::points::slices::{LightColor, Slices};
use crate::progress::Progress;
use crate::random::Random;

/// How slices become light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SliceSettings {
    /// Whether surfaces hide what is behind them.
    pub occlude: bool,
    /// Seed of a random phase for each sample; without one all start at zero.
    pub random_phase: Option<u64>,
    /// Memory [bytes].
    pub memory: u64,
}

/// The field of all slices in one colour of light on the panel, and the number of lit samples.
///
/// # Errors
/// As [`compute`]; [`Error::Parameter`] where nothing has light of this colour.
pub fn of_slices(
    slices: &Slices,
    light: LightColor,
    panel: &Grid,
    wavelength: f64,
    settings: &SliceSettings,
    progress: &Progress,
) -> Result<(Field, usize)> {
    let needed = slices.bytes() + bytes(&slices.lattice, panel, wavelength, slices.depths().iter().copied())?;
    if needed > settings.memory {
        let hint = "give more memory or fewer layers".to_owned();
        let budget = settings.memory >> 20;
        return Err(Error::Memory { what: "layers", needed: needed.div_ceil(1 << 20), budget, hint });
    }
    let mut lit = 0;
    let mut layers = Vec::new();
    for index in 0..slices.depths().len() {
        progress.check()?;
        let slice = slices.slice(index, light);
        let wave = |(i, &a): (usize, &f32)| {
            if a == 0.0 {
                return Complex32::default();
            }
            let phase = settings.random_phase.map(|seed| Random::new(seed, ((index as u64) << 40) + i as u64).phase());
            let (sin, cos) = phase.unwrap_or(0.0).sin_cos();
            Complex32::new(a * cos as f32, a * sin as f32)
        };
        lit += slice.amplitudes.iter().filter(|a| **a > 0.0).count();
        let samples = slice.amplitudes.iter().enumerate().map(wave).collect();
        let opaque = if settings.occlude && slice.covered.contains(&true) { slice.covered } else { Vec::new() };
        layers.push(Layer { z: slice.z, light: samples, opaque });
    }
    if lit == 0 {
        return Err(Error::parameter("input", "is black everywhere in this light, so it makes no field"));
    }
    Ok((compute(&layers, &slices.lattice, panel, wavelength, settings.memory, progress)?, lit))
}
