//! Gerchberg & Saxton's projections (*Optik* 35, 237 (1972)) over several planes, with weights that even out what is too
//! dark (Di Leonardo, Ianni & Ruocco, *Optics Express* 15, 1913 (2007)), and free light where nothing counts.

use super::{Padding, Problem, Quantiser, Solution, Start, Target, phase_curve};
use crate::error::{Error, Result};
use crate::field::Complex32;
use crate::panel::{PanelProfile, PhasePattern};
use crate::progress::Progress;
use rayon::prelude::*;

/// Settings of [`gerchberg_saxton`].
#[derive(Clone, Debug, PartialEq)]
pub struct GerchbergSaxton {
    /// Number of projections.
    pub iterations: usize,
    /// Exponent of the weights' update, 0 … 1: 0 is the plain algorithm, 1 corrects each sample by its whole ratio.
    pub weighting: f64,
    /// Share of the panel's light that the picture is asked to take, all planes together, above 0 and at most 1; the rest
    /// goes where nothing counts. Without such places it has no effect.
    pub efficiency: f64,
    /// Where to start.
    pub start: Start,
    /// How the panel's borders are treated.
    pub padding: Padding,
}

impl Default for GerchbergSaxton {
    fn default() -> Self {
        Self {
            iterations: 100,
            weighting: 0.6,
            efficiency: 0.7,
            start: Start::Random { seed: 1 },
            padding: Padding::Dark,
        }
    }
}

/// Finds phases for a panel by projections; the best of all iterations is returned.
///
/// On each plane the wanted amplitude (times the weight that it has grown) replaces the light's where it counts, its phase
/// stays; light elsewhere stays as it is. The changes on all planes go back to the panel, whose levels take the phase.
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
        return Err(Error::parameter("efficiency", format!("{} must be above 0 and at most 1", settings.efficiency)));
    }
    if settings.iterations == 0 || !(0.0..=1.0).contains(&settings.weighting) {
        let what =
            format!("{} iterations, weighting {}: 1 or more, and 0 … 1", settings.iterations, settings.weighting);
        return Err(Error::parameter("iterations", what));
    }
    let grid = profile.grid()?;
    let quantiser = Quantiser::new(&phase_curve(profile, wavelength)?);
    let problem = Problem::new(target, grid, wavelength, settings.padding)?;
    let mut wish = settings.start.phases(grid, wavelength)?;
    // Weighted amplitudes: what each sample is asked to have.
    let mut asked: Vec<Vec<f32>> = wanted.iter().map(|plane| plane.amplitude.clone()).collect();
    let free = wanted.iter().any(|plane| plane.weight.iter().flatten().any(|w| *w == 0.0));
    let demand = (problem.norm / (settings.efficiency * grid.len() as f64)).sqrt() as f32;
    // Planes that ask at the same place share its change, so that together they ask no more than one would.
    let asking = |i: usize| wanted.iter().map(|plane| plane.weight.as_ref().map_or(1.0, |w| w[i])).sum::<f32>();
    let share = 1.0 / (0..grid.len()).map(asking).fold(1.0, f32::max);
    let mut history = Vec::with_capacity(settings.iterations + 1);
    let mut best: Option<(f64, Vec<f32>)> = None;
    progress.start("Gerchberg-Saxton", settings.iterations as u64);
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
        // A fixed demand drives light into the free places until the rest is right; a demand that follows the light would
        // settle for whatever there is.
        let scale = if free { demand } else { judged.scale as f32 };
        let mut spectrum = problem.planes.zero();
        for ((k, field), asked) in judged.fields.iter().enumerate().zip(&mut asked) {
            let plane = &wanted[k];
            let exponent = settings.weighting as f32;
            let change: Vec<Complex32> = field
                .par_iter()
                .zip(asked.par_iter_mut())
                .enumerate()
                .map(|(i, (u, asked))| {
                    let weight = plane.weight.as_ref().map_or(1.0, |w| w[i]);
                    let (modulus, wish) = (u.norm(), plane.amplitude[i]);
                    if modulus == 0.0 {
                        return Complex32::new(0.0, 0.0);
                    }
                    if exponent > 0.0 && wish > 0.0 {
                        // A sample that fades to nothing in a vortex must not run away with its weight.
                        *asked *= (wish / (scale * modulus)).clamp(0.1, 10.0).powf(exponent);
                        *asked = asked.clamp(0.0, 10.0 * wish);
                    }
                    u * ((*asked / (scale * modulus) - 1.0) * weight * share)
                })
                .collect();
            problem.planes.adjoint(k, &change, &mut spectrum);
        }
        // The change alone goes back: light beyond the window and in the free places stays as it is.
        let change = problem.planes.panel(spectrum);
        wish = panel.par_iter().zip(&change).map(|(u, c)| (u + c).im.atan2((u + c).re)).collect();
        progress.advance(1);
    }
    let (_, wish) = best.ok_or(Error::Interrupted)?;
    let phase: Vec<f32> = wish.iter().map(|&p| quantiser.show(p).0).collect();
    let panel: Vec<Complex32> = phase.iter().map(|&p| Complex32::from_polar(1.0, p)).collect();
    let judged = problem.judge(&panel);
    let psnr = problem.psnr(&judged);
    Ok(Solution { pattern: PhasePattern::new(grid, wavelength, phase)?, history, psnr, scale: judged.scale })
}
