//! Gradient descent on the phases of the panel's pixels, with Adam's steps (Kingma & Ba, arXiv:1412.6980, algorithm 1).
//!
//! For light U = A·exp(iφ) with the linear propagation A and the error L(U), the derivative is
//! ∂L/∂φ = −2·Im(conj(A*·∂L/∂U*)·exp(iφ)); A* is the adjoint propagation. The scale s in L is the best one at every step,
//! where L does not depend on it to first order. Levels: the light is that of the nearest level, and its derivative moves
//! the wish ("straight through", Bengio et al., arXiv:1308.3432). On a panel of less than a turn a wish stops at the ends
//! of the range: in the gap it would move without effect and jump from one end to the other.

use super::{Judged, Padding, Problem, Solution, Start, Target};
use crate::encode::model::{PanelModel, Range};
use crate::error::{Error, Result};
use crate::field::Complex32;
use crate::panel::{Illumination, PanelProfile};
use crate::progress::Progress;
use rayon::prelude::*;

/// Settings of [`gradient_descent`].
#[derive(Clone, Debug, PartialEq)]
pub struct GradientDescent {
    /// Number of steps that are tried.
    pub iterations: usize,
    /// Largest step of a pixel's phase [rad]; it falls to a twentieth towards the end along half a cosine, and to half
    /// whenever a step would have raised the error.
    pub step: f64,
    /// Where to start.
    pub start: Start,
    /// How the panel's borders are treated (amplitude targets).
    pub padding: Padding,
    /// The wave that falls on the panel.
    pub illumination: Illumination,
}

impl Default for GradientDescent {
    fn default() -> Self {
        Self {
            iterations: 200,
            step: 0.1,
            start: Start::Random { seed: 1 },
            padding: Padding::Dark,
            illumination: Illumination::Normal,
        }
    }
}

/// Finds phases for a panel by gradient descent. A step that would raise the error is not taken; the next one starts from
/// the same phases with half its length and without momentum.
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
    let model = PanelModel::new(profile, wavelength, settings.illumination)?;
    let problem = Problem::new(target, model.grid, wavelength, settings.padding, progress)?;
    let mut wish = settings.start.phases(model.grid, wavelength)?;
    model.lit(&mut wish);
    progress.start("gradient descent", settings.iterations as u64);
    let mut light = model.light(&wish);
    let mut judged = problem.judge(&light.total)?;
    let mut adam = Adam::new(wish.len());
    adam.turn(&model.slopes(&wish, &gradient_field(&problem, &judged)?, &light.modulated));
    let mut history = vec![judged.error];
    let (mut rejected, mut trust) = (0, 1.0);
    for iteration in 0..settings.iterations {
        progress.check()?;
        let share = iteration as f64 / settings.iterations as f64;
        let step = trust * settings.step * (0.05 + 0.95 * 0.5 * (1.0 + (std::f64::consts::PI * share).cos()));
        let next = adam.step(&wish, step as f32, model.range);
        progress.check()?;
        let next_light = model.light(&next);
        let next_judged = problem.judge(&next_light.total)?;
        if next_judged.error <= judged.error {
            (wish, light, judged) = (next, next_light, next_judged);
            trust = f64::min(1.0, 1.1 * trust);
            if iteration + 1 < settings.iterations {
                adam.turn(&model.slopes(&wish, &gradient_field(&problem, &judged)?, &light.modulated));
            }
        } else {
            rejected += 1;
            trust *= 0.5;
            adam.forget();
        }
        history.push(judged.error);
        progress.advance(1);
    }
    problem.solution(&model, wavelength, &wish, history, rejected)
}

/// A*·∂L/∂U* on the panel's pixels, for L = Σw(s|U| − a)²/Σwa² or Σ|sU − T|²/Σ|T|².
pub(super) fn gradient_field(problem: &Problem<'_>, judged: &Judged) -> Result<Vec<Complex32>> {
    let (scale, factor) = (judged.scale as f32, (judged.scale / problem.norm) as f32);
    let mut sum: Option<Vec<Complex32>> = None;
    for (k, field) in judged.fields.iter().enumerate() {
        let pull: Vec<Complex32> = match problem.target {
            Target::Amplitude(planes) => {
                let plane = &planes[k];
                let pull = |(i, u): (usize, &Complex32)| {
                    let weight = plane.weight.as_ref().map_or(1.0, |w| w[i]);
                    let modulus = u.norm_sqr().sqrt();
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
        let back = problem.planes.adjoint(k, &pull, problem.progress)?;
        match &mut sum {
            None => sum = Some(back),
            Some(sum) => sum.par_iter_mut().zip(&back).for_each(|(sum, u)| *sum += u),
        }
    }
    Ok(sum.unwrap_or_default())
}

/// Adam's moments of every pixel's slope.
struct Adam {
    slopes: Vec<f32>,
    moments: Vec<[f32; 2]>,
    /// Slopes taken into the first and the second moments since they were empty.
    counts: [i32; 2],
}

impl Adam {
    const BETA: [f32; 2] = [0.9, 0.99];

    fn new(pixels: usize) -> Self {
        Self { slopes: vec![0.0; pixels], moments: vec![[0.0; 2]; pixels], counts: [0; 2] }
    }

    /// Takes in the slopes at new phases.
    fn turn(&mut self, slopes: &[f32]) {
        // Slopes scale with 1/pixels and may underflow squared in single precision: they are taken times the pixel count.
        let gain = self.slopes.len() as f32;
        self.counts = self.counts.map(|count| count + 1);
        self.slopes.par_iter_mut().zip(&mut self.moments).zip(slopes).for_each(|((kept, moment), slope)| {
            let slope = slope * gain;
            *kept = slope;
            moment[0] = Self::BETA[0] * moment[0] + (1.0 - Self::BETA[0]) * slope;
            moment[1] = Self::BETA[1] * moment[1] + (1.0 - Self::BETA[1]) * slope * slope;
        });
    }

    /// Drops the momentum: the next step follows the slopes where they were taken last.
    fn forget(&mut self) {
        self.counts[0] = 1;
        let fresh = 1.0 - Self::BETA[0];
        self.moments.par_iter_mut().zip(&self.slopes).for_each(|(moment, slope)| moment[0] = fresh * slope);
    }

    /// Wishes after a step of that length [rad].
    fn step(&self, wish: &[f32], step: f32, range: Option<Range>) -> Vec<f32> {
        let unbiased = [0, 1].map(|k| 1.0 / (1.0 - Self::BETA[k].powi(self.counts[k])));
        let work = wish.par_iter().zip(&self.moments).map(|(wish, moment)| {
            let change = moment[0] * unbiased[0] / ((moment[1] * unbiased[1]).sqrt() + 1e-8);
            let moved = wish - step * change;
            range.map_or(moved, |range| moved.clamp(range.low, range.high))
        });
        work.collect()
    }
}
