//! Frames made for the eye that looks: through its pupil they show what a light field says.
//!
//! A frame's phases are found by descent on the difference between what pupils see of it and what they see of the
//! light field, for pupils and foci drawn anew for each step: for a known eye one place, for an eye box places all over it,
//! several sub-frames together. Speckle, the panel's levels, range, dead space and crosstalk are inside the loss, and no light
//! is asked to be anywhere but in the pupils. Frames start from the picture itself: for a known eye on a wave that converges on
//! it, for an eye box on waves that converge on places a pupil apart, other ones in each frame ([`ViewEncoding::encode`]). The idea of driving a hologram by what pupils see is Chakravarthula et al.'s
//! (*Pupil-aware holography*, 2022) and Choi et al.'s (*Holographic parallax*, 2023).

mod aside;
mod cost;
mod descent;
mod optics;
mod pupils;
mod spots;
mod start;
mod whole;

pub use cost::{Expected, ViewCost, frames_for};
pub use start::carried_over;

use super::model::PanelModel;
use super::{EncodeReport, Encoded};
use crate::error::{Error, Result};
use crate::field::Complex32;
use crate::light_field::retina::Targets;
use crate::light_field::{LightField, Look, Pupil, Retina, Viewer};
use crate::panel::{EncodingRecord, Illumination, Modulation, Pattern, PhasePattern, Setup, drive};
use crate::progress::Progress;
use crate::random::Random;
use descent::{Descent, Found, Looks, Problem, Sight, Start};
use glam::DVec2;
use optics::{Columns, Optics};
use pupils::Pupils;
use serde::Serialize;
use spots::Spots;
use start::converging;
use std::f64::consts::TAU;
use std::time::Instant;
use whole::Planes;

/// Settings of the encoding.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewEncoding {
    /// Steps of the descent; `None`: 36 for an eye whose place is known, 120 for an eye box, 300 for all of the light, a third of
    /// these from frames that were shown before.
    pub iterations: Option<usize>,
    /// Seed of the looks.
    pub seed: u64,
}

impl Default for ViewEncoding {
    fn default() -> Self {
        Self { iterations: None, seed: 1 }
    }
}

impl ViewEncoding {
    /// Steps of the descent for a viewer.
    pub fn steps(&self, viewer: &Viewer) -> usize {
        let usual = match viewer.pupil {
            Pupil::All => 300,
            Pupil::Diameter(_) if is_known(viewer) => 36,
            Pupil::Diameter(_) => 120,
        };
        self.iterations.unwrap_or(usual)
    }
}

/// Whether there is one place to look from.
fn is_known(viewer: &Viewer) -> bool {
    viewer.eye_box == DVec2::ZERO && viewer.pupil != Pupil::All
}

/// What is to be shown, to whom, on which panel, in one laser's light.
#[derive(Clone, Copy)]
pub struct ViewTarget<'a> {
    /// The views, of one channel.
    pub light: &'a LightField,
    /// Who looks.
    pub viewer: &'a Viewer,
    /// The lattice that the views lie on.
    pub retina: &'a Retina,
    /// The panel.
    pub setup: &'a Setup,
    /// Vacuum wavelength of the laser [m].
    pub wavelength: f64,
}

/// What the descent took and gave.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ViewReport {
    /// Steps.
    pub iterations: usize,
    /// Frames that were found together.
    pub frames: usize,
    /// Likeness of the best frames so far on looks that no step draws [dB]: before the first step and at each check; peak is white.
    pub psnr: Vec<f64>,
    /// Share of the panel's light that goes into the eye box's pupils.
    pub efficiency: f64,
    /// Time per step [s].
    pub step_seconds: f64,
    /// Time in all [s].
    pub seconds: f64,
}

/// Frames for an eye.
#[derive(Clone, Debug)]
pub struct Viewed {
    /// The frames, shown in turn.
    pub frames: Vec<Encoded>,
    /// The phases that they ask for, to start from when something moves [rad].
    pub wishes: Vec<Vec<f32>>,
    /// How good they are.
    pub report: ViewReport,
}

impl Viewed {
    /// The frames one by one; one `None` for those of a laser without light.
    pub fn frames_or_none(found: Option<Self>) -> Vec<Option<Encoded>> {
        found.map_or_else(|| vec![None], |viewed| viewed.frames.into_iter().map(Some).collect())
    }
}

/// Looks whose pictures steps draw from, and looks that frames are judged by.
const POOL: usize = 256;
const KNOWN_POOL: usize = 32;
const KEPT: usize = 8;
/// Looks of a step through pupils: of a known eye, and all over an eye box, where eight leave pictures that jump from spot to spot
/// (parallax of 5 mm by up to 5.6 % where 16 err by 4.1 %).
const LOOKS: usize = 8;
const BOX_LOOKS: usize = 16;

impl ViewEncoding {
    /// Finds `count` frames that show the target when they follow each other faster than an eye sees, from the phases
    /// `start` where there are some: those of frames shown before ([`Viewed::wishes`]), for another eye [`carried_over`]. They help where
    /// what is seen has moved by little: where others are better (26 dB and less say that it may be so), these are taken, and as many
    /// steps made as from nothing.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a panel that modulates amplitude, phases that do not fit, light that is dark;
    /// [`Error::OutOfRange`] for no frames or steps; [`Error::Interrupted`] when asked to stop.
    pub fn encode(
        &self,
        target: &ViewTarget,
        count: usize,
        start: Option<Vec<Vec<f32>>>,
        progress: &Progress,
    ) -> Result<Viewed> {
        let begin = Instant::now();
        if count == 0 || count > 1000 {
            return Err(Error::out_of_range("subframes", count, "must be 1 to 1000"));
        }
        target.viewer.check()?;
        let (correction, warnings) = target.setup.correction(target.wavelength)?;
        let profile = &target.setup.profile;
        let model = PanelModel::bent(profile, target.wavelength, Illumination::Normal, correction.as_ref())?;
        let targets = Targets::new(target.retina, target.light, target.wavelength, progress)?;
        if target.light.is_dark() {
            return Err(Error::parameter("light field", "is dark everywhere; there is nothing to show"));
        }
        let steps = self.steps(target.viewer);
        let steps = if start.is_some() && self.iterations.is_none() { steps / 3 } else { steps };
        let own = Self { iterations: Some(steps), ..self.clone() };
        let anew = || -> Result<Vec<Vec<f32>>> {
            let Spots(spots) = Spots::new(target.viewer, target.retina, count);
            let of = |(index, spots): (usize, &Vec<DVec2>)| {
                let random = &mut Random::new(self.seed ^ 0x5907, index as u64);
                let mut wishes = converging(target, &targets, &model, spots, random, progress)?;
                model.lit(&mut wishes);
                Ok(wishes)
            };
            spots.iter().enumerate().map(of).collect()
        };
        let start = match start {
            Some(start) if start.len() == count && start.iter().all(|w| w.len() == model.grid.len()) => {
                Start { wishes: start, others: Some((&anew, self.steps(target.viewer))) }
            }
            Some(_) => return Err(Error::parameter("start", "its phases do not fit the frames")),
            None => Start { wishes: anew()?, others: None },
        };
        let stepping = Instant::now();
        let (found, efficiency) = if target.retina.pupil.is_finite() {
            let optics = Optics::new(&model.grid, target.retina, target.wavelength);
            let found = own.descend(&Pupils { optics: &optics, targets: &targets }, start, target, &model, progress)?;
            let efficiency = efficiency(target, &optics, &model, &found.wishes);
            (found, efficiency)
        } else {
            let planes = Planes::new(&targets, target)?;
            (own.descend(&planes, start, target, &model, progress)?, 1.0)
        };
        let iterations = found.iterations;
        let step_seconds = stepping.elapsed().as_secs_f64() / iterations.max(1) as f64;
        let history: Vec<f64> = found.history.iter().map(|loss| -10.0 * loss.max(1e-30).log10()).collect();
        let frame = |wishes: &Vec<f32>| -> Result<Encoded> {
            let phase = wishes.iter().map(|w| w.rem_euclid(TAU as f32)).collect();
            let pattern = Pattern::Phase(PhasePattern::new(model.grid, target.wavelength, phase)?);
            // The wishes have the correction in them.
            let mut driven = drive(&pattern, None, profile)?;
            driven.frame.metadata.applied.correction = correction.as_ref().map(|correction| correction.name.clone());
            let parameters = serde_json::json!({
                "iterations": iterations, "seed": self.seed, "frames": count,
                "eye": target.viewer.eye.to_array(), "eye_box": target.viewer.eye_box.to_array(),
                "pupil": target.retina.pupil,
            });
            let scale = 1.0 / found.scale.max(f64::MIN_POSITIVE);
            driven.frame.metadata.encoding =
                Some(EncodingRecord::new("view", Modulation::Phase, parameters, None, scale));
            let report = EncodeReport {
                method: "view",
                efficiency,
                field_error: f64::NAN,
                clipped: 0.0,
                dropped: 0.0,
                quantisation_error: driven.rms_error,
                unreachable: driven.unreachable,
                warnings: [warnings.clone(), driven.warnings].concat(),
            };
            Ok(Encoded { frame: driven.frame, report })
        };
        let frames = found.wishes.iter().map(frame).collect::<Result<Vec<_>>>()?;
        let report = ViewReport {
            iterations,
            frames: count,
            psnr: history,
            efficiency,
            step_seconds,
            seconds: begin.elapsed().as_secs_f64(),
        };
        Ok(Viewed { frames, wishes: found.wishes, report })
    }

    /// Descends by what is seen: of pupils eight looks a step from a pool of them, of planes one, another one each step.
    fn descend<S: Sight>(
        &self,
        sight: &S,
        start: Start<'_>,
        target: &ViewTarget,
        model: &PanelModel,
        progress: &Progress,
    ) -> Result<Found> {
        let iterations = self.steps(target.viewer);
        let whole = target.viewer.pupil == Pupil::All;
        let pool = match (whole, is_known(target.viewer)) {
            (true, _) => iterations.clamp(1, POOL),
            (false, true) => KNOWN_POOL,
            (false, false) => POOL,
        };
        // The start is near what is sought, and long steps would leave it: after 50 steps for a known eye Cornell's room is 44.2 dB
        // alike with 0.2, 48.8 with 0.05 (the layers 40.9 and 40.2); after 130 for 10 × 10 mm nine frames of the layers are 25.9
        // with 0.1 and 27.1 with 0.05 (960 × 540). Many steps for a known eye are the better the shorter they are. Planes are
        // further off, and so is what a panel shows whose pixels run into each other; smooth steps may be longer (a picture in a
        // Gaussian beam on 0.4 pixels of crosstalk is half a decibel better with 0.15 than with 0.1).
        let smooth = aside::is_smooth(target, model);
        let (rate, most) = match (smooth, model.blends()) {
            (true, _) => (0.15, 1.0),
            (false, true) => (0.1, 1.0),
            (false, false) => (0.05, 2.0),
        };
        let slower = if is_known(target.viewer) { (50.0 / iterations.max(1) as f64).sqrt().min(most) } else { 1.0 };
        let rate = if whole { 0.1 } else { rate * slower };
        let scattered = Spots::are_scattered(target.viewer);
        let looks = match (whole, scattered) {
            (true, _) => 1,
            (false, false) => LOOKS,
            (false, true) => BOX_LOOKS,
        };
        let descent = Descent { iterations, rate, looks, seed: self.seed, smooth };
        let drawn = Looks::new(sight, self::looks(target, pool, self.seed));
        let kept = Looks::new(sight, self::looks(target, if whole { KEPT / 2 } else { KEPT }, self.seed ^ 0x6e97));
        Problem { sight, model, progress }.descend(start, &drawn, &kept, &descent)
    }
}

/// Looks all over the eye box, focused between the nearest and the farthest depth, evenly in dioptres; every fourth at an end.
/// Of planes two in five are such that something of the scene is in focus, each depth that it has as often as another.
fn looks(target: &ViewTarget, count: usize, seed: u64) -> Vec<Look> {
    let viewer = target.viewer;
    let dioptres = target.light.depth.map(|z| 1.0 / (viewer.eye.z - z));
    let depths = if viewer.pupil == Pupil::All { whole::depths(target.light, viewer) } else { Vec::new() };
    let look = |index: usize| {
        let mut random = Random::new(seed ^ 0x1005, index as u64);
        // Places a little beyond the box stand for its edge, which few would meet otherwise.
        let mut place = |side: f64| (1.2 * (random.uniform() - 0.5)).clamp(-0.5, 0.5) * side;
        let pupil = viewer.eye.truncate() + DVec2::new(place(viewer.eye_box.x), place(viewer.eye_box.y));
        // A stratum each, so that few looks cover the depth as well.
        let share = match index % 4 {
            0 => ((index / 4) % 2) as f64,
            _ => (index as f64 + random.uniform()) / count as f64 * 1.1 - 0.05,
        };
        let reach = 1.0 / (dioptres[1] + (dioptres[0] - dioptres[1]) * share);
        let focus = if depths.is_empty() || index % 5 < 3 {
            viewer.eye.z - reach
        } else {
            let bin = &depths[(random.uniform() * depths.len() as f64) as usize % depths.len()];
            f64::from(bin[(random.uniform() * bin.len() as f64) as usize % bin.len()])
        };
        Look { pupil, focus }
    };
    (0..count).map(look).collect()
}

/// Share of the light of the panel's pixels that goes into pupils anywhere in the eye box.
fn efficiency(target: &ViewTarget, optics: &Optics, model: &PanelModel, wishes: &[Vec<f32>]) -> f64 {
    let viewer = target.viewer;
    let corners = [-0.5, 0.0, 0.5].map(|x| [-0.5, 0.0, 0.5].map(|y| DVec2::new(x, y) * viewer.eye_box)).concat();
    let apertures: Vec<_> =
        corners.iter().map(|off| optics.aperture(&Look { pupil: viewer.eye.truncate() + *off, focus: 0.0 })).collect();
    let columns = Columns::within(&apertures, optics.retina.padded[0]);
    let (mut inside, mut all) = (0.0, 0.0);
    for wishes in wishes {
        let light: Vec<Complex32> = model.light(wishes).total;
        let width = model.grid.width;
        let plane = optics.eye_plane(&columns, |row, out| out.copy_from_slice(&light[row * width..][..width]));
        inside += optics.inside(&plane, &columns, viewer);
        all += light.iter().map(|u| f64::from(u.norm_sqr())).sum::<f64>();
    }
    if all > 0.0 { inside / all } else { 0.0 }
}
