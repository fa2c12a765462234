//! Error diffusion on the complex field: each pixel shows the nearest phase that it has, and hands the complex error on to
//! neighbours that are still to come (Tsang & Poon, *Optics Express* 21, 23680 (2013); weights of Floyd & Steinberg).
//!
//! The sum of errors is small over every neighbourhood, so the noise has no low frequencies: it lies where the record's
//! aperture stops it. Serpentine rows, every second one from right to left, keep the errors from drifting to one side.

use super::{EncodedPattern, amplitude_at, band};
use crate::error::{Error, Result};
use crate::field::{Complex32, Field};
use crate::panel::{DriveCurve, EncodingRecord, Modulation, Pattern, PhasePattern};
use crate::progress::Progress;
use serde_json::json;

/// Settings of the error diffusion.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorDiffusion {
    /// Whether every second row runs from right to left.
    pub serpentine: bool,
    /// Half widths of the object's band along x and y, as shares of the panel's 1/(2·pitch), 0 … 1.
    pub band: [f64; 2],
    /// The amplitude that becomes 1 is the one below which this share of the samples lies; larger ones are clipped.
    pub percentile: f64,
}

impl Default for ErrorDiffusion {
    fn default() -> Self {
        Self { serpentine: true, band: [0.5, 0.5], percentile: 0.95 }
    }
}

pub(super) fn pattern(
    field: &Field,
    settings: &ErrorDiffusion,
    curve: &DriveCurve,
    incident: &[Complex32],
    progress: &Progress,
) -> Result<EncodedPattern> {
    let aperture = band::of_share(field, settings.band)?;
    let (target, dropped) = band::object(field, &aperture, progress)?;
    let greatest = amplitude_at(&target, settings.percentile)?;
    if greatest == 0.0 {
        return Err(Error::parameter("band", "no light within the encoding's band; widen it"));
    }
    let mut clipped = 0usize;
    let wishes = target.samples.iter().map(|u| {
        let modulus = u.norm() / greatest;
        clipped += usize::from(modulus > 1.0 + 1e-6);
        // Errors stay bounded for wishes within the unit circle only.
        u / (greatest * modulus.max(1.0))
    });
    let mut samples: Vec<Complex32> = wishes.collect();
    let show = |wish: Complex32| -> f32 {
        // Of the incident wave only the phase counts: a lens' fall of amplitude is a per mille.
        let (level, _) = curve.nearest(f64::from(wish.arg()));
        curve.values()[usize::from(level)].rem_euclid(std::f64::consts::TAU) as f32
    };
    let mut phase = vec![0.0; samples.len()];
    diffuse(&mut samples, field.grid.width, settings.serpentine, |i, wish| {
        let wave = incident[i];
        phase[i] = show(wish * wave.conj());
        wish - Complex32::from_polar(1.0, phase[i] + wave.arg())
    });
    progress.advance(1);
    let parameters = json!({
        "serpentine": settings.serpentine, "band": settings.band, "percentile": settings.percentile, "amplitude": greatest,
    });
    let scale = 1.0 / f64::from(greatest);
    let record = EncodingRecord::new("error-diffusion", Modulation::Phase, parameters, Some(aperture), scale);
    let clipped = clipped as f64 / phase.len() as f64;
    let pattern = Pattern::Phase(PhasePattern::new(field.grid, field.wavelength, phase)?);
    Ok(EncodedPattern { pattern, record, target, clipped, dropped, warnings: band::lost(dropped) })
}

/// Turns values between 0 and 1 into 0 or 1 by serpentine error diffusion.
pub(crate) fn binarise(values: &mut [f32], width: usize) {
    let mut open = vec![0.0; values.len()];
    diffuse(values, width, true, |i, wish: f32| {
        open[i] = if wish > 0.5 { 1.0 } else { 0.0 };
        wish - open[i]
    });
    values.copy_from_slice(&open);
}

/// Runs over rows; `show(i, wish)` returns the error that pixel i leaves, which its neighbours share as 7, 3, 5 and 1
/// sixteenths: ahead, below behind, below, below ahead. What would leave the picture is dropped.
fn diffuse<T>(wishes: &mut [T], width: usize, serpentine: bool, mut show: impl FnMut(usize, T) -> T)
where
    T: Copy + std::ops::Mul<f32, Output = T> + std::ops::AddAssign,
{
    let height = wishes.len() / width;
    for row in 0..height {
        let leftwards = serpentine && row % 2 == 1;
        for step in 0..width {
            let column = if leftwards { width - 1 - step } else { step };
            let at = row * width + column;
            let error = show(at, wishes[at]);
            let (first, last) = (step == 0, step + 1 == width);
            let (ahead, behind) = if leftwards { (at.wrapping_sub(1), at + 1) } else { (at + 1, at.wrapping_sub(1)) };
            if !last {
                wishes[ahead] += error * (7.0 / 16.0);
            }
            if row + 1 < height {
                if !first {
                    wishes[behind + width] += error * (3.0 / 16.0);
                }
                wishes[at + width] += error * (5.0 / 16.0);
                if !last {
                    wishes[ahead + width] += error * (1.0 / 16.0);
                }
            }
        }
    }
}
