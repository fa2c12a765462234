//! What a panel does to light at each of its levels, and which level comes nearest to a wish.

use crate::field::Complex64;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// What a panel (or a pattern) modulates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Modulation {
    /// Phase at constant amplitude.
    Phase,
    /// Amplitude transmittance at constant phase.
    Amplitude,
}

/// Parts of a turn in which the search for a phase begins: more than most panels have levels.
const BINS: usize = 1024;

/// How many of the sorted phases lie below the beginning of each part of a turn.
fn below(sorted: &[(f64, u16)]) -> Vec<u32> {
    let begin = |bin: usize| TAU * bin as f64 / BINS as f64;
    (0..BINS).map(|bin| sorted.partition_point(|v| v.0 < begin(bin)) as u32).collect()
}

/// The first index at which a sequence stops being strictly monotone.
pub(crate) fn non_monotone(values: &[f64]) -> Option<usize> {
    let rising = values.len() < 2 || values[1] > values[0];
    values.windows(2).position(|w| if rising { w[1] <= w[0] } else { w[1] >= w[0] }).map(|i| i + 1)
}

/// A panel's modulation at one wavelength, level by level, with the search for the nearest level.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveCurve {
    modulation: Modulation,
    /// Unwrapped phase [rad] or amplitude of each level.
    values: Vec<f64>,
    /// Usable levels by rising value (phases wrapped to [0, 2π)).
    sorted: Vec<(f64, u16)>,
    /// For each of [`BINS`] equal parts of a turn how many usable phases lie below its beginning; none for amplitudes.
    below: Vec<u32>,
    /// Distance within which a reachable wish finds its level: the widest step between neighbours, gap excluded.
    step: f64,
}

impl DriveCurve {
    /// From unwrapped phases [rad], one a level.
    ///
    /// Of a range beyond one turn only the levels of the first turn are used: neighbouring phases then have
    /// neighbouring levels, which keeps fly-back edges and crosstalk small.
    pub fn phase(values: Vec<f64>) -> Self {
        let first = values.first().copied().unwrap_or(0.0);
        // A curve that rises or falls throughout leaves its first turn once; a mirror's unordered codes are all kept.
        let usable = match non_monotone(&values) {
            None => values.iter().position(|v| (v - first).abs() >= TAU - 1e-9).unwrap_or(values.len()),
            Some(_) => values.len(),
        };
        let mut sorted: Vec<(f64, u16)> =
            values[..usable].iter().enumerate().map(|(l, v)| (v.rem_euclid(TAU), l as u16)).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut steps: Vec<f64> = sorted.windows(2).map(|w| w[1].0 - w[0].0).collect();
        steps.push(sorted[0].0 + TAU - sorted[sorted.len() - 1].0);
        steps.sort_by(f64::total_cmp);
        // The widest step may be the gap that a range below one turn leaves; the next one is a step of the curve.
        let step = if steps.len() > 1 { steps[steps.len() - 2] } else { TAU };
        Self { modulation: Modulation::Phase, values, below: below(&sorted), sorted, step }
    }

    /// From the phases of all levels [rad] and a controller's table: only the table's levels are used. Its phases are counted
    /// times `factor`.
    pub(super) fn table(values: Vec<f64>, output: &[u16], factor: f64) -> Self {
        let phase = |gray: usize| (factor * TAU * gray as f64 / output.len() as f64).rem_euclid(TAU);
        let mut sorted: Vec<(f64, u16)> =
            output.iter().enumerate().map(|(gray, &level)| (phase(gray), level)).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // Of two grays with one level the one that the profile's curve shows remains.
        let shown = |level: u16, phase: f64| (values[usize::from(level)] - phase + PI).rem_euclid(TAU) - PI;
        sorted.retain(|&(phase, level)| shown(level, phase).abs() < 1e-9);
        let step = TAU / output.len() as f64;
        Self { modulation: Modulation::Phase, values, below: below(&sorted), sorted, step }
    }

    /// From amplitude transmittances, one a level.
    pub fn amplitude(values: Vec<f64>) -> Self {
        let mut sorted: Vec<(f64, u16)> = values.iter().enumerate().map(|(l, &v)| (v, l as u16)).collect();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let step = sorted.windows(2).map(|w| w[1].0 - w[0].0).fold(0.0, f64::max);
        Self { modulation: Modulation::Amplitude, values, below: Vec::new(), sorted, step }
    }

    /// What the levels modulate.
    pub fn modulation(&self) -> Modulation {
        self.modulation
    }
    /// Number of levels.
    pub fn levels(&self) -> usize {
        self.values.len()
    }
    /// Unwrapped phase [rad], or amplitude, of each level.
    pub fn values(&self) -> &[f64] {
        &self.values
    }
    /// Levels that [`DriveCurve::nearest`] may answer, with their value (phases in [0, 2π)), by rising value.
    pub fn usable(&self) -> &[(f64, u16)] {
        &self.sorted
    }
    /// Span of the phases [rad] or amplitudes.
    pub fn range(&self) -> f64 {
        let (low, high) =
            self.values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
        high - low
    }
    /// Levels that one turn of phase spans (fractional), where the range and the mean slope tell it.
    pub fn levels_for_2pi(&self) -> Option<f64> {
        (self.modulation == Modulation::Phase && self.range() > 0.0)
            .then(|| TAU * (self.values.len() - 1) as f64 / self.range())
    }
    /// What a level does to unit light: exp(iφ), or t.
    pub fn phasor(&self, level: u16) -> Complex64 {
        let value = self.values[usize::from(level).min(self.values.len() - 1)];
        match self.modulation {
            Modulation::Phase => Complex64::cis(value),
            Modulation::Amplitude => Complex64::new(value, 0.0),
        }
    }

    /// The level nearest to a phase [rad] on the circle, or to an amplitude, and its signed miss (available − wished).
    pub fn nearest(&self, wish: f64) -> (u16, f64) {
        match self.modulation {
            Modulation::Phase => {
                let wish = wish.rem_euclid(TAU);
                // As `partition_point` says, from a place that is at most one bin before it; the bin itself may be rounded up.
                let bin = ((wish * (BINS as f64 / TAU)) as usize).clamp(1, BINS) - 1;
                let mut at = self.below[bin] as usize;
                while at < self.sorted.len() && self.sorted[at].0 < wish {
                    at += 1;
                }
                let above = self.sorted.get(at).map_or((self.sorted[0].0 + TAU, self.sorted[0].1), |v| *v);
                let below = match at {
                    0 => {
                        let last = self.sorted[self.sorted.len() - 1];
                        (last.0 - TAU, last.1)
                    }
                    _ => self.sorted[at - 1],
                };
                closer(wish, below, above)
            }
            Modulation::Amplitude => {
                let at = self.sorted.partition_point(|v| v.0 < wish);
                let above = self.sorted[at.min(self.sorted.len() - 1)];
                let below = self.sorted[at.saturating_sub(1)];
                closer(wish, below, above)
            }
        }
    }

    /// Whether a miss of [`DriveCurve::nearest`] is more than rounding: the wish lies outside what the panel can show.
    pub fn unreachable(&self, miss: f64) -> bool {
        // Half a step is rounding; the margin keeps wishes exactly between two levels on the reachable side.
        miss.abs() > 0.5 * self.step + 1e-6
    }
}

fn closer(wish: f64, below: (f64, u16), above: (f64, u16)) -> (u16, f64) {
    let (under, over) = (wish - below.0, above.0 - wish);
    if under.abs() <= over.abs() { (below.1, -under) } else { (above.1, over) }
}
