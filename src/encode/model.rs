//! The panel inside the loop: what light a wished phase becomes, with the levels, the curve, the range, the dead space, the
//! crosstalk and the wave that falls on it.

use crate::error::{Error, Result};
use crate::field::{Complex32, Complex64, Grid, angle, phasor};
use crate::panel::crosstalk::{mixed, mixed_slopes};
use crate::panel::simulated::illuminate;
use crate::panel::{DriveCurve, Illumination, Modulation, PanelProfile, Wavefront};
use rayon::prelude::*;
use std::f32::consts::TAU;

/// A phase panel as an iteration sees it.
pub(super) struct PanelModel {
    pub(super) grid: Grid,
    /// For a wish in each of the bins of one turn: the phase that the panel shows, unwrapped as its curve has it, and its
    /// phasor times the fill factor.
    shown: Vec<(f32, Complex32)>,
    fill: f32,
    /// Standard deviation of the Gaussian that blends neighbouring pixels' phases [pixels].
    crosstalk: f64,
    /// Light that no level changes, seen along the axis: the dead space's (1 − F)·d, and what else comes back unmodulated.
    pub(super) dead: f32,
    /// The wave that falls on each pixel; absent: 1 everywhere.
    pub(super) incident: Option<Vec<Complex32>>,
    /// Ends between which the panel can move, where it has less than a turn.
    pub(super) range: Option<Range>,
}

/// Light of all pixels.
pub(super) struct Light {
    /// All of it.
    pub(super) total: Vec<Complex32>,
    /// What turns with the pixels' phases: all but the dead space's.
    pub(super) modulated: Vec<Complex32>,
}

/// Phases between which a panel of less than a turn can move [rad].
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    pub(super) low: f32,
    pub(super) high: f32,
}

impl Range {
    /// The same phase on the circle within the range, or the nearer end.
    pub(super) fn nearest(self, phase: f32) -> f32 {
        let above = self.low + (phase - self.low).rem_euclid(TAU);
        if above <= self.high {
            return above;
        }
        if above - self.high < self.low + TAU - above { self.high } else { self.low }
    }
}

impl PanelModel {
    /// Bins a turn: a wish within half a bin of the border between two levels may get either, both equally good to 2e-4.
    const BINS: usize = 1 << 14;

    pub(super) fn new(profile: &PanelProfile, wavelength: f64, illumination: Illumination) -> Result<Self> {
        Self::bent(profile, wavelength, illumination, None)
    }

    /// The same of a panel whose wavefront error is the opposite of this correction: the incident wave has it, so that wishes
    /// carry the correction themselves, and what comes back unmodulated or runs between pixels does as it does on the panel.
    pub(super) fn bent(
        profile: &PanelProfile,
        wavelength: f64,
        illumination: Illumination,
        correction: Option<&Wavefront>,
    ) -> Result<Self> {
        if profile.modulation() != Modulation::Phase {
            let what = format!("{} modulates amplitude; the iterations here need a phase panel", profile.name);
            return Err(Error::parameter("panel", what));
        }
        let grid = profile.grid()?;
        let curve = profile.drive_curve(wavelength)?.0;
        let [kept, lost] = [1.0 - profile.unmodulated, profile.unmodulated].map(f64::sqrt);
        let fill = profile.fill_factor * kept;
        let shown = (0..Self::BINS)
            .map(|bin| {
                let wish = (bin as f64 + 0.5) / Self::BINS as f64 * std::f64::consts::TAU;
                let level = curve.nearest(wish).0;
                let phasor: Complex64 = curve.phasor(level) * fill;
                let phase = curve.values()[usize::from(level)];
                (phase as f32, Complex32::new(phasor.re as f32, phasor.im as f32))
            })
            .collect();
        let beam = profile.beam_amplitude()?;
        let incident = if illumination == Illumination::Normal && beam.is_none() && correction.is_none() {
            None
        } else {
            let mut wave = match beam {
                Some(beam) => beam.iter().map(|&amplitude| Complex32::new(amplitude, 0.0)).collect(),
                None => vec![Complex32::new(1.0, 0.0); grid.len()],
            };
            illuminate(&mut wave, grid, wavelength, illumination)?;
            if let Some(correction) = correction {
                correction.check(grid.width, grid.height, wavelength)?;
                wave.par_iter_mut().zip(&correction.phase).for_each(|(u, phase)| *u *= phasor(-phase * (1.0 / TAU)));
            }
            Some(wave)
        };
        let dead = ((1.0 - profile.fill_factor) * profile.dead_space * kept + lost) as f32;
        let (fill, crosstalk) = (fill as f32, profile.crosstalk);
        Ok(Self { grid, shown, fill, crosstalk, dead, incident, range: range(&curve) })
    }

    /// Phase that the panel shows for a wished phase [rad], as its curve counts it, with its phasor times the fill factor.
    pub(super) fn show(&self, wish: f32) -> (f32, Complex32) {
        let turn = wish * (1.0 / TAU);
        let bin = ((turn - turn.floor()) * Self::BINS as f32) as usize;
        self.shown[bin.min(Self::BINS - 1)]
    }

    /// The light of a panel with these wishes.
    pub(super) fn light(&self, wishes: &[f32]) -> Light {
        let one = Complex32::new(1.0, 0.0);
        let lit = |i: usize, phasor: Complex32| {
            let incident = self.incident.as_ref().map_or(one, |wave| wave[i]);
            let modulated = phasor * incident;
            (modulated + incident * self.dead, modulated)
        };
        let (total, modulated) = if self.crosstalk > 0.0 {
            self.mixed(wishes).par_iter().enumerate().map(|(i, &u)| lit(i, u * self.fill)).unzip()
        } else {
            wishes.par_iter().enumerate().map(|(i, &wish)| lit(i, self.show(wish).1)).unzip()
        };
        Light { total, modulated }
    }

    /// Phases of the levels that the panel shows for wishes.
    fn phases(&self, wishes: &[f32]) -> Vec<f32> {
        wishes.par_iter().map(|&wish| self.show(wish).0).collect()
    }

    /// Phasors of the pixels where neighbours blend: the mean over each.
    fn mixed(&self, wishes: &[f32]) -> Vec<Complex32> {
        mixed(&self.phases(wishes), self.grid.width, self.crosstalk, |phase| phasor(phase * (1.0 / TAU)))
    }

    /// The light of all pixels where neighbours blend, which no pixel's own wish tells; `None` without crosstalk.
    pub(super) fn blended(&self, wishes: &[f32]) -> Option<Vec<Complex32>> {
        if !self.blends() {
            return None;
        }
        let mut light = self.mixed(wishes);
        light.par_iter_mut().for_each(|u| *u = *u * self.fill + self.dead);
        if let Some(wave) = &self.incident {
            light.par_iter_mut().zip(wave).for_each(|(u, wave)| *u *= wave);
        }
        Some(light)
    }

    /// Standard deviation of the Gaussian that blends neighbours [pixels].
    pub(super) fn crosstalk(&self) -> f64 {
        self.crosstalk
    }

    /// Whether neighbours blend.
    pub(super) fn blends(&self) -> bool {
        self.crosstalk > 0.0
    }

    /// ∂L/∂wish of all pixels where A*·∂L/∂U* is given; `modulated` is the light of these wishes that turns with them.
    pub(super) fn slopes(&self, wishes: &[f32], pulled: &[Complex32], modulated: &[Complex32]) -> Vec<f32> {
        if self.blends() {
            return self.blended_slopes(wishes, pulled.to_vec());
        }
        pulled.par_iter().zip(modulated).map(|(pulled, u)| slope(*pulled, *u)).collect()
    }

    /// The same where neighbours blend, through all places of a pixel.
    pub(super) fn blended_slopes(&self, wishes: &[f32], mut pulled: Vec<Complex32>) -> Vec<f32> {
        let fill = self.fill;
        match &self.incident {
            // conj(p)·w·F·exp(iφ) is conj(p·conj(w)·F)·exp(iφ).
            Some(wave) => pulled.par_iter_mut().zip(wave).for_each(|(p, w)| *p *= w.conj() * fill),
            None => pulled.par_iter_mut().for_each(|p| *p *= fill),
        }
        mixed_slopes(&self.phases(wishes), self.grid.width, self.crosstalk, &pulled)
    }

    /// The wish of pixel `i` whose light comes nearest to a wished light of any modulus, from the wish that it has and the
    /// light that this gives.
    ///
    /// With crosstalk no wish has its own light; it moves by as much as its light should turn.
    pub(super) fn wish(&self, i: usize, light: Complex32, before: f32, modulated: Complex32) -> f32 {
        let wished = match &self.incident {
            None => light - self.dead,
            Some(wave) => light * wave[i].conj() - self.dead * wave[i].norm_sqr(),
        };
        if self.crosstalk == 0.0 {
            return angle(wished);
        }
        let shown = self.incident.as_ref().map_or(modulated, |wave| modulated * wave[i].conj());
        let turn = wished * shown.conj();
        // Where the panel has no more range the wish must not run away.
        let moved = before + angle(turn);
        self.range.map_or(moved, |range| range.nearest(moved))
    }

    /// Phases of a panel in normal light turned into those that make the same light of the incident wave.
    pub(super) fn lit(&self, phases: &mut [f32]) {
        if let Some(wave) = &self.incident {
            phases.par_iter_mut().zip(wave).for_each(|(phase, wave)| *phase -= wave.arg());
        }
        if let Some(range) = self.range {
            phases.par_iter_mut().for_each(|phase| *phase = range.nearest(*phase));
        }
    }
}

/// ∂L/∂φ of one pixel whose modulated light is given.
pub(super) fn slope(pulled: Complex32, modulated: Complex32) -> f32 {
    -2.0 * (pulled.conj() * modulated).im
}

/// The range of a panel whose phases leave a gap on the circle, wider than eight steps of its levels.
fn range(curve: &DriveCurve) -> Option<Range> {
    let span = curve.range();
    let step = span / (curve.levels().max(2) - 1) as f64;
    let low = curve.values().iter().fold(f64::INFINITY, |low, &v| low.min(v));
    (std::f64::consts::TAU - span > 8.0 * step).then_some(Range { low: low as f32, high: (low + span) as f32 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{npy, relative_error};
    use crate::panel::{Faults, Pattern, PhasePattern, Simulation, drive, simulate};
    use crate::progress::Progress;
    use crate::random::Random;

    /// What the encoder counts on is what the simulated panel shows: beam, unmodulated light, dead space, crosstalk and bend.
    #[test]
    fn the_light_of_a_bent_panel_in_its_beam_is_the_simulated_panels() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("beam.npy");
        let (width, height) = (24, 16);
        let beam: Vec<f32> = (0..width * height).map(|i| (-1e-3 * (i as f32 - 150.0).powi(2) / 300.0).exp()).collect();
        npy::write_intensity(&path, width, height, &beam).expect("write");
        let mut profile = PanelProfile::phase(width, height, 8e-6, 8, 532e-9).expect("profile");
        (profile.fill_factor, profile.dead_space, profile.crosstalk) = (0.9, 0.7, 0.4);
        (profile.unmodulated, profile.beam) = (0.08, Some(path));
        let bend: Vec<f32> = (0..width * height).map(|i| 0.02 * i as f32).collect();
        let error = Wavefront::new("bend", width, height, Some(532e-9), bend).expect("wavefront");
        let correction = error.clone().conjugate();
        let model = PanelModel::bent(&profile, 532e-9, Illumination::Normal, Some(&correction)).expect("model");
        let mut random = Random::new(1, 2);
        let wishes: Vec<f32> = (0..width * height).map(|_| random.phase() as f32).collect();
        let pattern = PhasePattern::new(model.grid, 532e-9, wishes.clone()).expect("pattern");
        let frame = drive(&Pattern::Phase(pattern), None, &profile).expect("frame").frame;
        let faults = Faults { wavefront_error: Some(error), ..Faults::default() };
        let shown = simulate(&frame, &Simulation { faults, ..Simulation::default() }, &Progress::new()).expect("light");
        let off = relative_error(&model.light(&wishes).total, &shown.samples);
        assert!(off < 1e-3, "{off}");
        assert!(relative_error(&model.blended(&wishes).expect("blends"), &shown.samples) < 1e-3);
    }
}
