//! What a printer makes of a plate's levels and lines, and how it is undone.
//!
//! *Tone.* A level L (as a share of the highest) comes out with the amplitude transmittance a(L), which rises or falls
//! throughout. For the wanted share t of the swing the level a⁻¹(a_least + t·(a_most − a_least)) is printed: the amplitude is
//! linear in what was wanted, and a process that makes negatives is turned round. In error diffusion L is the share of
//! open pixels, and a the mean amplitude of what was printed for it.
//!
//! *Lines.* Lines of the highest level come out wider by b than they were drawn (narrower where b < 0). A fringe of the
//! spatial frequency f that is to be open over the phases |φ| < h is drawn open over |φ| < h − π·b·f instead, half of b on each
//! edge. b may differ along x and y; across an edge at an angle α to y it is b_x·cos²α + b_y·sin²α.

use super::fringe_settings::{Binarisation, FringeSettings};
use crate::config::ConfigFile;
use crate::encode::Quantity;
use crate::error::Result;
use crate::units;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A printer's measured behaviour; [`super::calibrate`] finds it on the scan of a card.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transfer {
    /// Levels as shares of the highest, rising from 0 to 1; empty where the tone was not measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<f64>,
    /// Amplitude transmittance that each came out with, on any scale.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub amplitude: Vec<f64>,
    /// By how much lines of the highest level come out wider than they were drawn, along x and y [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line_bias: Option<[f64; 2]>,
}

#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "line_bias: give a length, \"-0.2um\", or one along x and one along y, [\"-0.2um\", \"0um\"]"
)]
enum BiasKey {
    Both(String),
    Each([String; 2]),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TransferFile {
    #[serde(default)]
    levels: Vec<f64>,
    #[serde(default)]
    amplitude: Vec<f64>,
    line_bias: Option<BiasKey>,
}

impl TransferFile {
    pub(super) fn read(&self, at: ConfigFile) -> Result<Transfer> {
        let length = |text: &String| at.read("transfer.line_bias", text, units::length);
        let line_bias = match &self.line_bias {
            None => None,
            Some(BiasKey::Both(both)) => Some([length(both)?; 2]),
            Some(BiasKey::Each([x, y])) => Some([length(x)?, length(y)?]),
        };
        Ok(Transfer { levels: self.levels.clone(), amplitude: self.amplitude.clone(), line_bias })
    }
}

/// More levels than a curve is measured at.
const MOST_LEVELS: usize = 4096;

/// Lines do not grow by more than this [m].
const MOST_BIAS: f64 = 1e-3;

impl Transfer {
    /// The first number outside its domain, in words.
    pub(super) fn check(&self, fringe: &FringeSettings) -> Result<(), String> {
        let Self { levels, amplitude, line_bias } = self;
        if levels.len() != amplitude.len() {
            let (levels, amplitudes) = (levels.len(), amplitude.len());
            return Err(format!("transfer has {levels} levels and {amplitudes} amplitudes; give one for each"));
        }
        if !levels.is_empty() {
            let rises = |values: &[f64]| values.windows(2).all(|pair| pair[0] < pair[1]);
            let ends = (levels.first(), levels.last()) == (Some(&0.0), Some(&1.0));
            if !(ends && rises(levels) && (2..=MOST_LEVELS).contains(&levels.len())) {
                return Err(format!("transfer.levels must rise from 0 to 1, in 2 to {MOST_LEVELS} of them"));
            }
            let climbs = |sign: f64| amplitude.windows(2).all(|pair| sign * pair[0] <= sign * pair[1]);
            if !amplitude.iter().all(|a| (0.0..=1e3).contains(a)) || !(climbs(1.0) || climbs(-1.0)) {
                return Err("transfer.amplitude must rise or fall throughout, from 0 on".into());
            }
            if amplitude.first() == amplitude.last() {
                return Err("transfer.amplitude is the same at all levels: nothing was printed".into());
            }
            if fringe.quantity == Quantity::Phase {
                return Err("transfer.amplitude is for plates that absorb; quantity = \"phase\" takes none".into());
            }
        }
        match line_bias {
            Some(_) if fringe.bits != 1 => Err("transfer.line_bias is for bits = 1; leave it out".into()),
            Some(bias) if !bias.iter().all(|b| b.abs() <= MOST_BIAS) => {
                Err(format!("transfer.line_bias must lie between -{MOST_BIAS} and {MOST_BIAS} m"))
            }
            Some(_) if fringe.binarisation == Binarisation::DirectSearch => Err(
                "transfer.line_bias undoes lines, not the dots of a direct search; take binarisation = \"threshold\""
                    .into(),
            ),
            Some(_) if levels.is_empty() && fringe.binarisation == Binarisation::Diffusion => {
                Err("transfer.line_bias undoes lines, not the dots of error diffusion; give levels and amplitude, or \
                 binarisation = \"threshold\""
                    .into())
            }
            _ => Ok(()),
        }
    }

    /// The levels that make what is wanted, where the tone was measured and the plate's levels are drawn as tones.
    pub(super) fn tone(&self, fringe: &FringeSettings) -> Option<Tone> {
        let tones = fringe.bits != 1 || fringe.binarisation == Binarisation::Diffusion;
        (tones && !self.levels.is_empty()).then(|| Tone::new(&self.levels, &self.amplitude))
    }

    /// How much lines grow, where it was measured and the plate is drawn in lines [m].
    pub(super) fn lines(&self, fringe: &FringeSettings) -> Option<[f64; 2]> {
        self.line_bias.filter(|_| {
            let dots = matches!(fringe.binarisation, Binarisation::Diffusion | Binarisation::DirectSearch);
            fringe.bits == 1 && !dots
        })
    }
}

/// Phase by which each edge of a fringe of a spatial frequency [cycles/m] is drawn further in [rad].
pub(super) fn edge_phase(bias: [f64; 2], [fx, fy]: [f64; 2]) -> f64 {
    let square = fx * fx + fy * fy;
    if square > 0.0 { PI * (bias[0] * fx * fx + bias[1] * fy * fy) / square.sqrt() } else { 0.0 }
}

/// Entries of a table of levels: between two of them an 8-bit level does not differ.
const ENTRIES: usize = 4096;

/// The level for each wanted share of the swing.
#[derive(Clone, Debug)]
pub(super) struct Tone {
    table: Vec<f32>,
}

impl Tone {
    fn new(levels: &[f64], amplitude: &[f64]) -> Self {
        let (first, last) = (amplitude[0], amplitude[amplitude.len() - 1]);
        let sign = if last > first { 1.0 } else { -1.0 };
        let (least, swing) = (first.min(last), (last - first).abs());
        let level = |wanted: f64| {
            let target = least + wanted * swing;
            // The place among the samples in the order in which they climb.
            let at = amplitude.partition_point(|a| sign * a < sign * target).clamp(1, amplitude.len() - 1);
            let (a, b) = (amplitude[at - 1], amplitude[at]);
            let share = if a == b { 0.5 } else { ((target - a) / (b - a)).clamp(0.0, 1.0) };
            levels[at - 1] + share * (levels[at] - levels[at - 1])
        };
        Self { table: (0..=ENTRIES).map(|i| level(i as f64 / ENTRIES as f64) as f32).collect() }
    }

    /// The level, as a share of the highest, that comes out as a share `wanted` of the swing.
    pub(super) fn level(&self, wanted: f32) -> f32 {
        let at = wanted.clamp(0.0, 1.0) * ENTRIES as f32;
        let below = (at as usize).min(ENTRIES - 1);
        let (a, b) = (self.table[below], self.table[below + 1]);
        a + (at - below as f32) * (b - a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tone_makes_amplitudes_linear_in_what_is_wanted() {
        let levels: Vec<f64> = (0..=32).map(|i| f64::from(i) / 32.0).collect();
        // a = 0.05 + 0.9·L^2.2, and its negative.
        let curve = |level: f64| 0.05 + 0.9 * level.powf(2.2);
        for negative in [false, true] {
            let made = |level: f64| if negative { curve(1.0 - level) } else { curve(level) };
            let amplitude: Vec<f64> = levels.iter().map(|&l| made(l)).collect();
            let tone = Tone::new(&levels, &amplitude);
            for wanted in [0.0, 0.1, 0.37, 0.5, 0.9, 1.0] {
                let got = (made(f64::from(tone.level(wanted as f32))) - 0.05) / 0.9;
                // The curve is straight between its 33 samples; its bend there is 2.2·1.2·0.9/8/32² of the swing.
                assert!((got - wanted).abs() < 1e-3, "{negative}: {wanted} became {got}");
            }
        }
        // A foot and a shoulder that are flat.
        let tone = Tone::new(&[0.0, 0.25, 0.75, 1.0], &[0.0, 0.0, 1.0, 1.0]);
        assert!((tone.level(0.5) - 0.5).abs() < 1e-6 && tone.level(0.001) >= 0.25 && tone.level(0.999) <= 0.75);
    }

    #[test]
    fn edges_move_by_half_of_the_bias() {
        // Lines 1 µm wider at a period of 4 µm: an eighth of a turn on each edge.
        assert!((edge_phase([1e-6, 0.0], [0.25e6, 0.0]) - PI / 4.0).abs() < 1e-12);
        assert!((edge_phase([1e-6, 0.0], [0.0, 0.25e6])).abs() < 1e-12);
        let even = edge_phase([-1e-6; 2], [0.15e6, 0.2e6]);
        assert!((even + PI / 4.0).abs() < 1e-12, "the same in every direction: {even}");
    }
}
