//! Phase patterns found by iteration: what a panel of these very levels should show so that light has given amplitudes on
//! given planes, or a given complex field within a band.
//!
//! The panel stands inside the loop: every light that is judged comes from phases that the panel has, with its dead space
//! and under the wave that falls on it, so a panel of few levels or of less than a turn is optimised for, not rounded to
//! at the end.
//!
//! *Monotone.* A step that would raise the error is not taken: it is tried again, shorter. [`Solution::history`] holds the
//! error of what was kept, and never rises.

mod gerchberg_saxton;
mod gradient;
mod planes;

pub use gerchberg_saxton::{Constraint, GerchbergSaxton, gerchberg_saxton};
pub use gradient::{GradientDescent, gradient_descent};
pub use planes::Padding;

use crate::encode::model::PanelModel;
use crate::error::{Error, Result};
use crate::field::{Complex32, Grid};
use crate::panel::PhasePattern;
use crate::progress::Progress;
use crate::random::Random;
use planes::Planes;
use rayon::prelude::*;
use std::f32::consts::TAU;

/// What the light should be.
#[derive(Clone, Debug)]
pub enum Target {
    /// Amplitudes on planes: the light's phase there is free.
    Amplitude(Vec<TargetPlane>),
    /// The complex field on the panel, limited to |f_x| and |f_y| below `half` [cycles/m]: what it becomes at every depth
    /// is right with it. Light outside the band is free, and stopped by an aperture.
    Complex {
        /// The field's samples on the panel's pixels, within the band.
        samples: Vec<Complex32>,
        /// Half widths of the band [cycles/m].
        half: [f64; 2],
    },
}

/// Wanted amplitudes at one depth, on samples of the panel's own grid.
#[derive(Clone, Debug)]
pub struct TargetPlane {
    /// Depth in the hologram frame [m].
    pub z: f64,
    /// Amplitude of each sample, row-major, of any scale (one for all planes).
    pub amplitude: Vec<f32>,
    /// How much each sample counts, 0 … 1; zero leaves the light free there. Absent: all count.
    pub weight: Option<Vec<f32>>,
    /// Wanted phases [rad], for [`Constraint::AmplitudeAndPhase`]. Absent: the same everywhere.
    pub phase: Option<Vec<f32>>,
}

/// The phases that an iteration starts from.
#[derive(Clone, Debug, PartialEq)]
pub enum Start {
    /// Zero everywhere.
    Constant,
    /// Uniform on one turn, by seed: light spreads over the whole band, with speckle.
    Random {
        /// The seed.
        seed: u64,
    },
    /// π(x² + y²)/(λ·focal length): a lens whose light spreads smoothly, without speckle.
    Quadratic {
        /// Focal length [m]; positive makes the light diverge.
        focal_length: f64,
    },
    /// Random phases that change smoothly, by seed: between speckle and none.
    Smooth {
        /// The seed.
        seed: u64,
        /// Distance over which the phase changes [pixels], 2 or more.
        length: f64,
    },
    /// Given phases [rad]: a warm start.
    Phase(Vec<f32>),
}

/// What an iteration found.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The best pattern, its phases those that the panel has.
    pub pattern: PhasePattern,
    /// Normalised squared error at the start and after each iteration, Σw(s|U| − a)²/Σwa² with the best scale s (complex:
    /// Σ|sU − T|²/Σ|T|²); never rises.
    pub history: Vec<f64>,
    /// Steps that would have raised the error and were not taken.
    pub rejected: usize,
    /// Peak signal-to-noise ratio of the amplitude on each plane, over the samples that count, with each plane's greatest
    /// wanted amplitude as peak [dB]; of the complex field against its greatest modulus for a complex target.
    pub psnr: Vec<f64>,
    /// Scale s of the last line.
    pub scale: f64,
    /// Share of the panel's light that lies where the target counts, mean of the planes (complex: within the band).
    pub efficiency: f64,
}

impl Start {
    pub(super) fn phases(&self, grid: Grid, wavelength: f64) -> Result<Vec<f32>> {
        match self {
            Self::Constant => Ok(vec![0.0; grid.len()]),
            Self::Random { seed } => {
                Ok((0..grid.len()).into_par_iter().map(|i| Random::new(*seed, i as u64).uniform_f32() * TAU).collect())
            }
            Self::Quadratic { focal_length } => {
                if !(focal_length.is_finite() && *focal_length != 0.0) {
                    return Err(Error::parameter(
                        "focal_length",
                        format!("{focal_length} m must be finite and not zero"),
                    ));
                }
                let turns = |i: usize| {
                    let (x, y) = (grid.x(i % grid.width), grid.y(i / grid.width));
                    (x * x + y * y) / (2.0 * wavelength * focal_length)
                };
                Ok((0..grid.len()).into_par_iter().map(|i| turns(i).rem_euclid(1.0) as f32 * TAU).collect())
            }
            Self::Smooth { seed, length } => {
                if !(*length >= 2.0 && length.is_finite()) {
                    return Err(Error::out_of_range("length", length, "must be 2 pixels or more"));
                }
                // A lattice of random phases over three turns, joined by smooth steps.
                let lattice = |x: usize, y: usize| 3.0 * TAU * Random::new(*seed, (y << 32 | x) as u64).uniform_f32();
                let ease = |t: f64| (t * t * (3.0 - 2.0 * t)) as f32;
                let of = |i: usize| {
                    let (x, y) = ((i % grid.width) as f64 / length, (i / grid.width) as f64 / length);
                    let (u, v) = (ease(x.fract()), ease(y.fract()));
                    let (x, y) = (x as usize, y as usize);
                    let upper = lattice(x, y) * (1.0 - u) + lattice(x + 1, y) * u;
                    let lower = lattice(x, y + 1) * (1.0 - u) + lattice(x + 1, y + 1) * u;
                    upper * (1.0 - v) + lower * v
                };
                Ok((0..grid.len()).into_par_iter().map(of).collect())
            }
            Self::Phase(phase) if phase.len() == grid.len() => Ok(phase.clone()),
            Self::Phase(phase) => {
                let what = format!("{} phases for {}×{} pixels", phase.len(), grid.width, grid.height);
                Err(Error::parameter("start", what))
            }
        }
    }
}

/// A target with its planned planes, and the judgement of a panel's field against it.
struct Problem<'a> {
    target: &'a Target,
    planes: Planes,
    /// Σwa² over all planes, or Σ|T|².
    norm: f64,
    /// Asked within each transform, which are the longest steps.
    progress: &'a Progress,
}

/// A judged field.
struct Judged {
    /// Fields on the planes.
    fields: Vec<Vec<Complex32>>,
    scale: f64,
    /// Σw|U|².
    counted: f64,
    error: f64,
}

impl<'a> Problem<'a> {
    fn new(target: &'a Target, grid: Grid, wavelength: f64, padding: Padding, progress: &'a Progress) -> Result<Self> {
        let count = grid.len();
        let refuse = |what: String| Err(Error::parameter("target", what));
        let (planes, norm) = match target {
            Target::Amplitude(wanted) => {
                for (k, plane) in wanted.iter().enumerate() {
                    let weights = plane.weight.as_ref().map_or(count, Vec::len);
                    if plane.amplitude.len() != count || weights != count {
                        let (width, height) = (grid.width, grid.height);
                        return refuse(format!("plane {k} does not have the panel's {width}×{height} samples"));
                    }
                    if plane.phase.as_ref().is_some_and(|p| p.len() != count || p.iter().any(|v| !v.is_finite())) {
                        return refuse(format!("plane {k} does not have a finite phase for each sample"));
                    }
                    let bad = |v: &f32| !(v.is_finite() && *v >= 0.0);
                    if plane.amplitude.iter().any(bad) || plane.weight.iter().flatten().any(bad) {
                        return refuse(format!("plane {k} holds a value that is negative or not finite"));
                    }
                }
                let depths: Vec<f64> = wanted.iter().map(|plane| plane.z).collect();
                let norm: f64 = wanted.iter().map(|p| (0..count).map(|i| p.counted(i)).sum::<f64>()).sum();
                (Planes::new(grid, wavelength, &depths, None, padding, progress)?, norm)
            }
            Target::Complex { samples, half } => {
                if samples.len() != count || samples.iter().any(|u| !u.is_finite()) {
                    return refuse(format!("{} finite samples are needed, one a pixel", count));
                }
                let norm = samples.iter().map(|u| f64::from(u.norm_sqr())).sum();
                // The band is defined on the panel's own transform, as the band filter of the encodings is.
                (Planes::new(grid, wavelength, &[0.0], Some(*half), Padding::Periodic, progress)?, norm)
            }
        };
        if norm == 0.0 {
            return refuse("it is dark wherever it counts".into());
        }
        Ok(Self { target, planes, norm, progress })
    }

    /// The light of a panel's field, with its best scale and error.
    fn judge(&self, panel: &[Complex32]) -> Result<Judged> {
        let field = |k: usize| self.planes.field(k, panel, self.progress);
        let fields = (0..self.planes.count()).map(field).collect::<Result<Vec<_>>>()?;
        // ⟨|U|, a⟩, ⟨|U|, |U|⟩ over what counts, in row order on every machine.
        let (mut cross, mut own) = (0.0, 0.0);
        for (k, field) in fields.iter().enumerate() {
            let parts: Vec<(f64, f64)> = field
                .par_chunks(1 << 14)
                .enumerate()
                .map(|(chunk, field)| {
                    if self.progress.stopped() {
                        return (0.0, 0.0);
                    }
                    let sums = field.iter().enumerate().map(|(i, u)| self.products(k, (chunk << 14) + i, *u));
                    sums.fold((0.0, 0.0), |sum, term| (sum.0 + term.0, sum.1 + term.1))
                })
                .collect();
            self.progress.check()?;
            for part in parts {
                cross += part.0;
                own += part.1;
            }
        }
        let scale = if own > 0.0 { cross / own } else { 0.0 };
        Ok(Judged { fields, scale, counted: own, error: (1.0 - scale * cross / self.norm).max(0.0) })
    }

    fn products(&self, k: usize, i: usize, u: Complex32) -> (f64, f64) {
        match self.target {
            Target::Amplitude(planes) => {
                let plane = &planes[k];
                let weight = f64::from(plane.weight.as_ref().map_or(1.0, |w| w[i]));
                let power = f64::from(u.norm_sqr());
                (weight * power.sqrt() * f64::from(plane.amplitude[i]), weight * power)
            }
            Target::Complex { samples, .. } => (f64::from((u * samples[i].conj()).re), f64::from(u.norm_sqr())),
        }
    }

    /// Peak signal-to-noise ratio of each plane [dB] at the judged scale.
    fn psnr(&self, judged: &Judged) -> Vec<f64> {
        let scale = judged.scale;
        let decibel = |peak: f64, squares: f64, weight: f64| -10.0 * (squares / weight / (peak * peak)).log10();
        match self.target {
            Target::Amplitude(planes) => planes
                .iter()
                .zip(&judged.fields)
                .map(|(plane, field)| {
                    let (mut squares, mut weights, mut peak) = (0.0, 0.0, 0.0f64);
                    for (i, u) in field.iter().enumerate() {
                        let weight = f64::from(plane.weight.as_ref().map_or(1.0, |w| w[i]));
                        let wanted = f64::from(plane.amplitude[i]);
                        squares += weight * (scale * f64::from(u.norm()) - wanted).powi(2);
                        weights += weight;
                        peak = peak.max(if weight > 0.0 { wanted } else { 0.0 });
                    }
                    decibel(peak, squares, weights)
                })
                .collect(),
            Target::Complex { samples, .. } => {
                let peak = samples.iter().map(|u| f64::from(u.norm())).fold(0.0, f64::max);
                vec![decibel(peak, judged.error * self.norm, samples.len() as f64)]
            }
        }
    }
}

impl TargetPlane {
    fn counted(&self, i: usize) -> f64 {
        let weight = f64::from(self.weight.as_ref().map_or(1.0, |w| w[i]));
        weight * f64::from(self.amplitude[i]).powi(2)
    }
}

impl Problem<'_> {
    /// What a kept state is, as a solution.
    fn solution(
        &self,
        model: &PanelModel,
        wavelength: f64,
        wish: &[f32],
        history: Vec<f64>,
        rejected: usize,
    ) -> Result<Solution> {
        let judged = self.judge(&model.light(wish).total)?;
        let phase = wish.par_iter().map(|&p| model.show(p).0.rem_euclid(TAU)).collect();
        let efficiency = judged.counted / (self.planes.count() * model.grid.len()) as f64;
        let psnr = self.psnr(&judged);
        let pattern = PhasePattern::new(model.grid, wavelength, phase)?;
        Ok(Solution { pattern, history, rejected, psnr, scale: judged.scale, efficiency })
    }
}

#[cfg(test)]
mod tests;
