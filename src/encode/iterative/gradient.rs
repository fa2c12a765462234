//! Gradient descent on the phases of the panel's pixels, with Adam's steps (Kingma & Ba, arXiv:1412.6980, algorithm 1).
//!
//! For light U = A·exp(iφ) with the linear propagation A and the error L(U), the derivative is
//! ∂L/∂φ = −2·Im(conj(A*·∂L/∂U*)·exp(iφ)); A* is the adjoint propagation. The scale s in L is the best one at every step,
//! where L does not depend on it to first order. Levels: the light is that of the nearest level, and its derivative moves
//! the wish ("straight through", Bengio et al., arXiv:1308.3432). On a panel of less than a turn a wish stops at the ends
//! of the range: in the gap it would move without effect and jump from one end to the other.

use super::{Judged, Padding, Problem, Quantiser, Range, Solution, Start, Target, phase_curve};
use crate::error::{Error, Result};
use crate::field::Complex32;
use crate::panel::{PanelProfile, PhasePattern};
use crate::progress::Progress;
use rayon::prelude::*;

/// Settings of [`gradient_descent`].
#[derive(Clone, Debug, PartialEq)]
pub struct GradientDescent {
    /// Number of steps.
    pub iterations: usize,
    /// Largest step of a pixel's phase [rad]; it falls to a twentieth towards the end along half a cosine.
    pub step: f64,
    /// Where to start.
    pub start: Start,
    /// How the panel's borders are treated (amplitude targets).
    pub padding: Padding,
}

impl Default for GradientDescent {
    fn default() -> Self {
        Self { iterations: 200, step: 0.1, start: Start::Random { seed: 1 }, padding: Padding::Dark }
    }
}

/// Finds phases for a panel by gradient descent; the best of all steps is returned.
///
/// # Errors
/// [`Error::Parameter`] for a target that does not fit the panel, settings out of their domain, or a panel that modulates
/// amplitude; [`Error::Interrupted`] when asked to stop.
pub fn gradient_descent(
    target: &Target,
    profile: &PanelProfile,
    wavelength: f64,
    settings: &GradientDescent,
    progress: &Progress,
) -> Result<Solution> {
    if settings.iterations == 0 || !(settings.step > 0.0 && settings.step.is_finite()) {
        let what = format!("{} iterations of {} rad; both must be positive", settings.iterations, settings.step);
        return Err(Error::parameter("iterations", what));
    }
    let grid = profile.grid()?;
    let curve = phase_curve(profile, wavelength)?;
    let quantiser = Quantiser::new(&curve);
    let range = quantiser.range(&curve);
    let problem = Problem::new(target, grid, wavelength, settings.padding)?;
    let mut wish = settings.start.phases(grid, wavelength)?;
    if let Some(range) = range {
        wish.par_iter_mut().for_each(|wish| *wish = range.nearest(*wish));
    }
    let mut moments = vec![[0.0f32; 2]; grid.len()];
    let mut history = Vec::with_capacity(settings.iterations + 1);
    let mut best: Option<(f64, Vec<f32>)> = None;
    progress.start("gradient descent", settings.iterations as u64);
    for iteration in 0..=settings.iterations {
        progress.check()?;
        let panel: Vec<Complex32> = wish.par_iter().map(|&p| quantiser.show(p).1).collect();
        let judged = problem.judge(&panel);
        history.push(judged.error);
        if best.as_ref().is_none_or(|(error, _)| judged.error < *error) {
            best = Some((judged.error, wish.clone()));
        }
        if iteration == settings.iterations {
            break;
        }
        let pulled = gradient_field(&problem, &judged);
        let share = iteration as f64 / settings.iterations as f64;
        let step = settings.step * (0.05 + 0.95 * 0.5 * (1.0 + (std::f64::consts::PI * share).cos()));
        adam(&mut wish, &mut moments, &pulled, &panel, iteration, step, range);
        progress.advance(1);
    }
    let (_, wish) = best.ok_or(Error::Interrupted)?;
    let phase: Vec<f32> = wish.iter().map(|&p| quantiser.show(p).0).collect();
    let panel: Vec<Complex32> = phase.iter().map(|&p| Complex32::from_polar(1.0, p)).collect();
    let judged = problem.judge(&panel);
    let psnr = problem.psnr(&judged);
    Ok(Solution { pattern: PhasePattern::new(grid, wavelength, phase)?, history, psnr, scale: judged.scale })
}

/// A*·∂L/∂U* on the panel's pixels, for L = Σw(s|U| − a)²/Σwa² or Σ|sU − T|²/Σ|T|².
pub(super) fn gradient_field(problem: &Problem<'_>, judged: &Judged) -> Vec<Complex32> {
    let (scale, factor) = (judged.scale as f32, (judged.scale / problem.norm) as f32);
    let mut spectrum = problem.planes.zero();
    for (k, field) in judged.fields.iter().enumerate() {
        let pull: Vec<Complex32> = match problem.target {
            Target::Amplitude(planes) => {
                let plane = &planes[k];
                let pull = |(i, u): (usize, &Complex32)| {
                    let weight = plane.weight.as_ref().map_or(1.0, |w| w[i]);
                    let modulus = u.norm();
                    // A dark sample has no direction to grow in: its derivative is taken as zero.
                    let ratio = if modulus > 0.0 { plane.amplitude[i] / modulus } else { scale };
                    u * (weight * factor * (scale - ratio))
                };
                field.par_iter().enumerate().map(pull).collect()
            }
            Target::Complex { samples, .. } => {
                field.par_iter().zip(samples).map(|(u, t)| (u * scale - t) * factor).collect()
            }
        };
        problem.planes.adjoint(k, &pull, &mut spectrum);
    }
    problem.planes.panel(spectrum)
}

/// ∂L/∂φ of one pixel.
pub(super) fn slope(pulled: Complex32, phasor: Complex32) -> f32 {
    -2.0 * (pulled.conj() * phasor).im
}

fn adam(
    wish: &mut [f32],
    moments: &mut [[f32; 2]],
    pulled: &[Complex32],
    panel: &[Complex32],
    iteration: usize,
    step: f64,
    range: Option<Range>,
) {
    const BETA: [f32; 2] = [0.9, 0.99];
    let count = iteration as i32 + 1;
    let unbiased = BETA.map(|beta| 1.0 / (1.0 - beta.powi(count)));
    // Slopes scale with 1/pixels and may underflow squared in single precision: they are taken times the pixel count.
    let gain = wish.len() as f32;
    let work = wish.par_iter_mut().zip(moments).zip(pulled.par_iter().zip(panel));
    work.for_each(|((wish, moment), (pulled, phasor))| {
        let slope = slope(*pulled, *phasor) * gain;
        moment[0] = BETA[0] * moment[0] + (1.0 - BETA[0]) * slope;
        moment[1] = BETA[1] * moment[1] + (1.0 - BETA[1]) * slope * slope;
        let change = moment[0] * unbiased[0] / ((moment[1] * unbiased[1]).sqrt() + 1e-8);
        let moved = *wish - step as f32 * change;
        *wish = range.map_or(moved.rem_euclid(std::f32::consts::TAU), |range| moved.clamp(range.low, range.high));
    });
}
