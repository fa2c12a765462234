//! Gerchberg & Saxton's projections (*Optik* 35, 237 (1972)) over several planes, with weights that even out what is too
//! dark (Di Leonardo, Ianni & Ruocco, *Optics Express* 15, 1913 (2007)), a second constraint on the phase (Chang et al.,
//! *Applied Optics* 54, 6994 (2015)), and free light where nothing counts.

use super::{Judged, Padding, Problem, Solution, Start, Target, TargetPlane};
use crate::encode::model::PanelModel;
use crate::error::{Error, Result};
use crate::field::{Complex32, Complex64};
use crate::panel::{Illumination, PanelProfile};
use crate::progress::Progress;
use rayon::prelude::*;

/// What a projection replaces where the target counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Constraint {
    /// The amplitude; the phase is whatever the light has.
    #[default]
    Amplitude,
    /// Amplitude and phase: [`TargetPlane::phase`], or the same everywhere, with the piston that fits best. Light of
    /// smooth phase has no speckle; the panel's noise goes where nothing counts.
    AmplitudeAndPhase,
}

/// Settings of [`gerchberg_saxton`].
#[derive(Clone, Debug, PartialEq)]
pub struct GerchbergSaxton {
    /// Number of projections that are tried.
    pub iterations: usize,
    /// Exponent of the weights' update, 0 … 1: 0 is the plain algorithm, 1 corrects each sample by its whole ratio.
    pub weighting: f64,
    /// What is replaced.
    pub constraint: Constraint,
    /// Share of the panel's light that the picture is asked to take, all planes together, above 0 and at most 1; the rest
    /// goes where nothing counts. Without such places it has no effect.
    pub efficiency: f64,
    /// Where to start.
    pub start: Start,
    /// How the panel's borders are treated.
    pub padding: Padding,
    /// The wave that falls on the panel.
    pub illumination: Illumination,
}

impl Default for GerchbergSaxton {
    fn default() -> Self {
        Self {
            iterations: 100,
            weighting: 0.1,
            constraint: Constraint::Amplitude,
            efficiency: 0.5,
            start: Start::Random { seed: 1 },
            padding: Padding::Dark,
            illumination: Illumination::Normal,
        }
    }
}

/// Longest change, as multiple of the projection's own: what a panel of phases gives back of a change is less than was
/// asked, so that asking for more goes faster while the error falls.
const LONGEST: f32 = 4.0;

/// Finds phases for a panel by projections.
///
/// On each plane the wanted amplitude (times the weight that it has grown) replaces the light's where it counts, its phase
/// stays (unless it is constrained too); light elsewhere stays as it is. The changes on all planes go back to the panel,
/// whose levels take the phase. A change that would raise the error is not made: it is tried again at half its size; sizes
/// grow again while the error falls.
///
/// # Errors
/// [`Error::Parameter`] for a complex target or one that does not fit the panel, settings out of their domain, or a panel
/// that modulates amplitude; [`Error::Interrupted`] when asked to stop.
pub fn gerchberg_saxton(
    target: &Target,
    profile: &PanelProfile,
    wavelength: f64,
    settings: &GerchbergSaxton,
    progress: &Progress,
) -> Result<Solution> {
    let Target::Amplitude(wanted) = target else {
        return Err(Error::parameter("target", "projections need amplitudes on planes, not a complex field"));
    };
    if !(settings.efficiency > 0.0 && settings.efficiency <= 1.0) {
        return Err(Error::out_of_range("efficiency", settings.efficiency, "must be above 0 and at most 1"));
    }
    if settings.iterations == 0 || !(0.0..=1.0).contains(&settings.weighting) {
        let what =
            format!("{} iterations, weighting {}: 1 or more, and 0 … 1", settings.iterations, settings.weighting);
        return Err(Error::parameter("iterations", what));
    }
    let model = PanelModel::new(profile, wavelength, settings.illumination)?;
    let problem = Problem::new(target, model.grid, wavelength, settings.padding, progress)?;
    let count = model.grid.len();
    let mut wish = settings.start.phases(model.grid, wavelength)?;
    model.lit(&mut wish);
    let projection = Projection {
        problem: &problem,
        wanted,
        settings,
        demand: wanted
            .iter()
            .any(|plane| plane.weight.iter().flatten().any(|w| *w == 0.0))
            .then(|| (problem.norm / (settings.efficiency * count as f64)).sqrt() as f32),
        share: {
            // Planes that ask at the same place share its change, so that together they ask no more than one would.
            let asking = |i: usize| wanted.iter().map(|plane| plane.weight.as_ref().map_or(1.0, |w| w[i])).sum::<f32>();
            1.0 / (0..count).map(asking).fold(1.0, f32::max)
        },
    };
    // Weighted amplitudes: what each sample is asked to have.
    let mut asked: Vec<Vec<f32>> = wanted.iter().map(|plane| plane.amplitude.clone()).collect();
    progress.start("Gerchberg-Saxton", settings.iterations as u64);
    let mut light = model.light(&wish);
    let mut judged = problem.judge(&light.total)?;
    let mut history = vec![judged.error];
    let (mut rejected, mut size) = (0, 1.0f32);
    let mut change = projection.change(&judged, &mut asked, 1.0)?;
    for iteration in 0..settings.iterations {
        progress.check()?;
        let step = |i: usize| light.total[i] + change[i] * size;
        let turned = |i: usize| {
            if progress.stopped() { wish[i] } else { model.wish(i, step(i), wish[i], light.modulated[i]) }
        };
        let next: Vec<f32> = (0..count).into_par_iter().map(turned).collect();
        progress.check()?;
        let next_light = model.light(&next);
        let next_judged = problem.judge(&next_light.total)?;
        if next_judged.error <= judged.error {
            (wish, light, judged) = (next, next_light, next_judged);
            if iteration + 1 < settings.iterations {
                change = projection.change(&judged, &mut asked, size)?;
            }
            size = f32::min(LONGEST, 1.2 * size);
        } else {
            rejected += 1;
            size *= 0.5;
        }
        history.push(judged.error);
        progress.advance(1);
    }
    problem.solution(&model, wavelength, &wish, history, rejected)
}

struct Projection<'a> {
    problem: &'a Problem<'a>,
    wanted: &'a [TargetPlane],
    settings: &'a GerchbergSaxton,
    /// A fixed demand (scale of the light) drives light into the free places until the rest is right; a demand that follows
    /// the light would settle for whatever there is. Absent where there is no free place.
    demand: Option<f32>,
    share: f32,
}

impl Projection<'_> {
    /// What the panel's light should change by. `size` tempers the weights' update.
    fn change(&self, judged: &Judged, asked: &mut [Vec<f32>], size: f32) -> Result<Vec<Complex32>> {
        let scale = self.demand.unwrap_or(judged.scale as f32);
        let exponent = self.settings.weighting as f32 * size.min(1.0);
        let mut sum: Option<Vec<Complex32>> = None;
        for ((k, field), asked) in judged.fields.iter().enumerate().zip(asked) {
            let plane = &self.wanted[k];
            let phased = match self.settings.constraint {
                Constraint::Amplitude => None,
                Constraint::AmplitudeAndPhase => Some(plane.phasors(field)),
            };
            let each = |(i, (u, asked)): (usize, (&Complex32, &mut f32))| {
                if self.problem.progress.stopped() {
                    return Complex32::new(0.0, 0.0);
                }
                let weight = plane.weight.as_ref().map_or(1.0, |w| w[i]);
                let (modulus, wish) = (u.norm_sqr().sqrt(), plane.amplitude[i]);
                if exponent > 0.0 && wish > 0.0 && modulus > 0.0 {
                    // A sample that fades to nothing in a vortex must not run away with its weight.
                    *asked *= (wish / (scale * modulus)).clamp(0.1, 10.0).powf(exponent);
                    *asked = asked.clamp(0.0, 10.0 * wish);
                }
                let wished = match &phased {
                    Some(phasors) => phasors(i) * (*asked / scale),
                    None if modulus > 0.0 => u * (*asked / (scale * modulus)),
                    None => return Complex32::new(0.0, 0.0),
                };
                (wished - u) * (weight * self.share)
            };
            let change: Vec<Complex32> = field.par_iter().zip(asked.par_iter_mut()).enumerate().map(each).collect();
            // The change alone goes back: light beyond the window and in the free places stays as it is.
            let back = self.problem.planes.adjoint(k, &change, self.problem.progress)?;
            match &mut sum {
                None => sum = Some(back),
                Some(sum) => sum.par_iter_mut().zip(&back).for_each(|(sum, u)| *sum += u),
            }
        }
        Ok(sum.unwrap_or_default())
    }
}

impl TargetPlane {
    /// The wanted phasor at each sample, turned by the piston that fits a field best.
    fn phasors<'a>(&'a self, field: &[Complex32]) -> impl Fn(usize) -> Complex32 + Sync + 'a {
        let wanted =
            |i: usize| self.phase.as_ref().map_or(Complex32::new(1.0, 0.0), |p| Complex32::from_polar(1.0, p[i]));
        let term = |(i, u): (usize, &Complex32)| {
            let weight = self.weight.as_ref().map_or(1.0, |w| w[i]) * self.amplitude[i];
            let v = u * wanted(i).conj() * weight;
            Complex64::new(v.re.into(), v.im.into())
        };
        let overlap: Complex64 = field.iter().enumerate().map(term).sum();
        let piston = if overlap.norm() > 0.0 { overlap / overlap.norm() } else { Complex64::new(1.0, 0.0) };
        let piston = Complex32::new(piston.re as f32, piston.im as f32);
        move |i| {
            let phasor = self.phase.as_ref().map_or(Complex32::new(1.0, 0.0), |p| Complex32::from_polar(1.0, p[i]));
            phasor * piston
        }
    }
}
