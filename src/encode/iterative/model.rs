//! The panel inside the loop: what light a wished phase becomes, with the levels, the curve, the range, the dead space and
//! the wave that falls on it.

use crate::error::{Error, Result};
use crate::field::{Complex32, Complex64, Grid};
use crate::panel::simulated::illuminate;
use crate::panel::{DriveCurve, Illumination, Modulation, PanelProfile};
use rayon::prelude::*;
use std::f32::consts::TAU;

/// A phase panel as an iteration sees it.
pub(super) struct PanelModel {
    pub(super) grid: Grid,
    /// Phase that the panel shows for a wish in each of the bins of one turn, and its phasor times the fill factor.
    shown: Vec<(f32, Complex32)>,
    /// Light of the dead space, seen along the axis: (1 − F)·d.
    dead: f32,
    /// The wave that falls on each pixel; absent: 1 everywhere.
    incident: Option<Vec<Complex32>>,
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
        if profile.modulation() != Modulation::Phase {
            let what = format!("{} modulates amplitude; the iterations here need a phase panel", profile.name);
            return Err(Error::parameter("panel", what));
        }
        let grid = profile.grid()?;
        let curve = profile.drive_curve(wavelength)?.0;
        let fill = profile.fill_factor;
        let shown = (0..Self::BINS)
            .map(|bin| {
                let wish = (bin as f64 + 0.5) / Self::BINS as f64 * std::f64::consts::TAU;
                let level = curve.nearest(wish).0;
                let phasor: Complex64 = curve.phasor(level) * fill;
                let phase = curve.values()[usize::from(level)].rem_euclid(std::f64::consts::TAU);
                (phase as f32, Complex32::new(phasor.re as f32, phasor.im as f32))
            })
            .collect();
        let incident = match illumination {
            Illumination::Normal => None,
            other => {
                let mut wave = vec![Complex32::new(1.0, 0.0); grid.len()];
                illuminate(&mut wave, grid, wavelength, other)?;
                Some(wave)
            }
        };
        let dead = ((1.0 - fill) * profile.dead_space) as f32;
        Ok(Self { grid, shown, dead, incident, range: range(&curve) })
    }

    /// Phase that the panel shows for a wished phase [rad], in [0, 2π), with its phasor times the fill factor.
    pub(super) fn show(&self, wish: f32) -> (f32, Complex32) {
        let turn = wish * (1.0 / TAU);
        let bin = ((turn - turn.floor()) * Self::BINS as f32) as usize;
        self.shown[bin.min(Self::BINS - 1)]
    }

    /// The light of a panel with these wishes.
    pub(super) fn light(&self, wishes: &[f32]) -> Light {
        let one = Complex32::new(1.0, 0.0);
        let each = |(i, wish): (usize, &f32)| {
            let incident = self.incident.as_ref().map_or(one, |wave| wave[i]);
            let modulated = self.show(*wish).1 * incident;
            (modulated + incident * self.dead, modulated)
        };
        let (total, modulated) = wishes.par_iter().enumerate().map(each).unzip();
        Light { total, modulated }
    }

    /// The wish of pixel `i` whose light comes nearest to a wished light of any modulus.
    pub(super) fn wish(&self, i: usize, light: Complex32) -> f32 {
        let wished = match &self.incident {
            None => light - self.dead,
            Some(wave) => light * wave[i].conj() - self.dead * wave[i].norm_sqr(),
        };
        wished.im.atan2(wished.re)
    }

    /// Phases of a panel in normal light turned into those that make the same light of the incident wave.
    pub(super) fn lit(&self, phases: &mut [f32]) {
        if let Some(wave) = &self.incident {
            phases.par_iter_mut().zip(wave).for_each(|(phase, wave)| *phase -= wave.im.atan2(wave.re));
        }
        if let Some(range) = self.range {
            phases.par_iter_mut().for_each(|phase| *phase = range.nearest(*phase));
        }
    }
}

/// The range of a panel whose phases leave a gap on the circle, wider than eight steps of its levels.
fn range(curve: &DriveCurve) -> Option<Range> {
    let span = curve.range();
    let step = span / (curve.levels().max(2) - 1) as f64;
    let low = curve.values().iter().fold(f64::INFINITY, |low, &v| low.min(v));
    (std::f64::consts::TAU - span > 8.0 * step).then_some(Range { low: low as f32, high: (low + span) as f32 })
}
