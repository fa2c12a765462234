//! Nearest levels by table, for frames that must be made between two refreshes.

use super::drive_curve::{DriveCurve, Modulation};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Parts of a turn in the table. A 10-bit curve crosses from level to level in every sixtieth of them.
const PARTS: usize = 1 << 16;
/// Stands in the table where a part holds more than one level.
const MIXED: u32 = u32::MAX;
/// By how much a part is widened when its levels are looked for [parts]: rounding of a phase of up to 10⁶ turns.
const MARGIN: f64 = 1e-4;

/// The levels of a phase curve, found as [`DriveCurve::nearest`] finds them, more than ten times as fast.
///
/// The wishes for which a level is the nearest form one arc of the circle. A part of a turn at whose both ends the same
/// level is the nearest lies within its arc; only in the others the curve itself has to be asked.
#[derive(Clone, Debug)]
pub struct NearestTable {
    curve: DriveCurve,
    parts: Vec<u32>,
}

impl NearestTable {
    /// Of a phase curve; none of an amplitude curve.
    pub fn new(curve: &DriveCurve) -> Option<Self> {
        if curve.modulation() == Modulation::Amplitude {
            return None;
        }
        let at = |part: f64| curve.nearest(part * TAU / PARTS as f64).0;
        let level = |part: usize| {
            let (low, high) = (at(part as f64 - MARGIN), at((part + 1) as f64 + MARGIN));
            if low == high { u32::from(low) } else { MIXED }
        };
        let parts = (0..PARTS).into_par_iter().map(level).collect();
        Some(Self { curve: curve.clone(), parts })
    }

    /// The level nearest to a phase [rad] on the circle.
    pub fn nearest(&self, wish: f64) -> u16 {
        let turns = wish * (1.0 / TAU);
        // Towards zero; a floor is a call of a function on older processors.
        let part = turns - (turns as i64) as f64;
        let part = if part < 0.0 { part + 1.0 } else { part };
        match self.parts.get((part * PARTS as f64) as usize) {
            Some(&level) if level != MIXED => level as u16,
            _ => self.curve.nearest(wish).0,
        }
    }

    /// The levels of phases [rad], each with its correction [rad] added; the index of the first that is not finite, if one
    /// is.
    ///
    /// # Errors
    /// That index.
    pub fn levels(&self, phases: &[f32], correction: Option<&[f32]>) -> Result<Vec<u16>, usize> {
        /// Enough for a thread to be worth waking.
        const BLOCK: usize = 1 << 15;
        let mut levels = vec![0; phases.len()];
        let finite = |(block, levels): (usize, &mut [u16])| {
            let start = block * BLOCK;
            let phases = &phases[start..start + levels.len()];
            let mut finite = true;
            match correction {
                Some(correction) => {
                    let correction = &correction[start..start + levels.len()];
                    for ((level, &phase), &correction) in levels.iter_mut().zip(phases).zip(correction) {
                        finite &= phase.is_finite();
                        *level = self.nearest(f64::from(phase) + f64::from(correction));
                    }
                }
                None => {
                    for (level, &phase) in levels.iter_mut().zip(phases) {
                        finite &= phase.is_finite();
                        *level = self.nearest(f64::from(phase));
                    }
                }
            }
            finite
        };
        if levels.par_chunks_mut(BLOCK).enumerate().map(finite).reduce(|| true, |a, b| a & b) {
            return Ok(levels);
        }
        Err(phases.iter().position(|phase| !phase.is_finite()).unwrap_or(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panel::{Curve, PhaseSign};
    use crate::random::Random;

    #[test]
    fn the_table_finds_the_levels_that_the_curve_finds() {
        let curves = [
            Curve::Linear { levels_for_2pi: 256.0 }.resolve(256, 5e-7, None, PhaseSign::Increasing),
            Curve::Linear { levels_for_2pi: 100.0 }.resolve(256, 5e-7, None, PhaseSign::Decreasing),
            Curve::Linear { levels_for_2pi: 320.0 }.resolve(256, 5e-7, None, PhaseSign::Increasing),
            Curve::Linear { levels_for_2pi: 1024.0 }.resolve(1024, 5e-7, None, PhaseSign::Increasing),
            Curve::Linear { levels_for_2pi: 65_536.0 }.resolve(65_536, 5e-7, None, PhaseSign::Increasing),
            Curve::Polynomial { coefficients: vec![0.3, 2.0, 2.5] }.resolve(16, 5e-7, None, PhaseSign::Increasing),
            // Unequal, out of order, two of them alike.
            Curve::Piston { height: vec![0.0, 30e-9, 10e-9, 200e-9, 30e-9] }.resolve(
                5,
                5e-7,
                None,
                PhaseSign::Increasing,
            ),
            Curve::Linear { levels_for_2pi: 2.0 }.resolve(2, 5e-7, None, PhaseSign::Increasing),
        ];
        for (number, curve) in curves.iter().enumerate() {
            let table = NearestTable::new(curve).expect("a phase curve");
            let mut random = Random::new(number as u64, 7);
            let mut phases: Vec<f32> = (0..200_000)
                .map(|i| {
                    let turns = (random.bits() >> 11) as f64 / (1u64 << 53) as f64;
                    // One turn, then many, of both signs.
                    ((if i % 2 == 0 { turns } else { 2e4 * (turns - 0.5) }) * TAU) as f32
                })
                .collect();
            phases.extend([0.0, -0.0, TAU as f32, -TAU as f32, f32::MIN_POSITIVE, -1e-30, 1e-30]);
            let correction: Vec<f32> = phases.iter().rev().copied().collect();
            let levels = table.levels(&phases, Some(&correction)).expect("finite");
            for ((&phase, &correction), &level) in phases.iter().zip(&correction).zip(&levels) {
                let wish = f64::from(phase) + f64::from(correction);
                assert_eq!(level, curve.nearest(wish).0, "curve {number} at {wish}");
                assert_eq!(table.nearest(f64::from(phase)), curve.nearest(f64::from(phase)).0);
            }
        }
    }

    #[test]
    fn what_is_not_finite_is_named() {
        let curve = Curve::Linear { levels_for_2pi: 256.0 }.resolve(256, 5e-7, None, PhaseSign::Increasing);
        let table = NearestTable::new(&curve).expect("a phase curve");
        let mut phases = vec![1.0; 100_000];
        assert!(table.levels(&phases, None).is_ok());
        phases[77_777] = f32::NAN;
        phases[99_999] = f32::INFINITY;
        assert_eq!(table.levels(&phases, None), Err(77_777));
        let amplitude = Curve::LinearAmplitude.resolve(256, 5e-7, None, PhaseSign::Increasing);
        assert!(NearestTable::new(&amplitude).is_none());
    }
}
