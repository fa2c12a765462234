//! T(v, q) = ½ erfc(v/√(1 − iq)), the blurred edge of the far form, as piecewise cubics for the inner loops.
//!
//! In units of the taper's own width (v = (|f| − b)/s) one family serves both axes, every pitch and wavelength. A level
//! is one q: sixteen segments over [−V, V], each a cubic through its four Chebyshev nodes, real and imaginary part;
//! lanes look their segment up in registers.

use crate::field::Complex64;
use crate::hologram::definition::erfc;
use crate::progress::Progress;
use rayon::prelude::*;

/// Segments of a level; what [`Lanes::lookup`](crate::hologram::lanes::Lanes::lookup) indexes.
pub(super) const SEGMENTS: usize = 16;

/// f32 values of a level: (re, im) × four coefficients × sixteen segments.
pub(super) const LEVEL: usize = 2 * 4 * SEGMENTS;

/// Levels for a range of q.
#[derive(Debug, Default)]
pub(crate) struct EdgeTable {
    /// Half the range of v, V: beyond it T is 0 or 1 to 1e-5.
    pub(crate) half: f64,
    /// q of the first level.
    pub(crate) lowest: f64,
    /// Number of levels.
    pub(crate) count: usize,
    /// Levels of 128 values: real and imaginary part, four powers each, sixteen segments each.
    pub(crate) values: Vec<f32>,
}

impl EdgeTable {
    /// Distance of neighbouring levels in q: |∂T/∂q| ≤ 0.2, and at most half a step is rounded off: 5e-5 at the edge
    /// alone.
    pub(crate) const STEP: f64 = 5e-4;

    /// Levels that cover `lowest..=highest`; dark ones when asked to stop.
    pub(super) fn new(lowest: f64, highest: f64, progress: &Progress) -> Self {
        // |exp(−v²/(1 − iq))| = exp(−v²/(1 + q²)); erfc(3.02)/2 = 1e-5.
        let half = 3.02 * (1.0 + highest * highest).sqrt();
        let count = ((highest - lowest) / Self::STEP).ceil() as usize + 1;
        let mut values = vec![0.0; count * LEVEL];
        values.par_chunks_mut(LEVEL).enumerate().for_each(|(i, level)| {
            if !progress.stopped() {
                fill(level, lowest + i as f64 * Self::STEP, half);
            }
        });
        Self { half, lowest, count, values }
    }
    /// The level nearest to q.
    pub(crate) fn level(&self, q: f64) -> &[f32] {
        let index = ((q - self.lowest) / Self::STEP + 0.5).max(0.0) as usize;
        let index = index.min(self.count - 1);
        &self.values[index * LEVEL..(index + 1) * LEVEL]
    }
    /// Segments per unit of v.
    pub(super) fn density(&self) -> f64 {
        SEGMENTS as f64 / (2.0 * self.half)
    }
    /// Memory [bytes].
    pub(super) fn bytes(lowest: f64, highest: f64) -> u64 {
        (((highest - lowest) / Self::STEP).ceil() as u64 + 1) * LEVEL as u64 * 4
    }
}

fn fill(level: &mut [f32], q: f64, half: f64) {
    let root = Complex64::new(1.0, -q).sqrt();
    let nodes: [f64; 4] = std::array::from_fn(|n| 0.5 - 0.5 * ((2 * n + 1) as f64 * std::f64::consts::PI / 8.0).cos());
    for segment in 0..SEGMENTS {
        let at = |w: f64| 0.5 * erfc(((segment as f64 + w) * 2.0 * half / SEGMENTS as f64 - half) / root);
        let cubic = interpolate(nodes, nodes.map(at));
        for (power, c) in cubic.iter().enumerate() {
            level[power * SEGMENTS + segment] = c.re as f32;
            level[(4 + power) * SEGMENTS + segment] = c.im as f32;
        }
    }
}

/// Coefficients (constant first) of the cubic through four values: Newton's divided differences, multiplied out.
fn interpolate(nodes: [f64; 4], mut values: [Complex64; 4]) -> [Complex64; 4] {
    for order in 1..4 {
        for i in (order..4).rev() {
            values[i] = (values[i] - values[i - 1]) / (nodes[i] - nodes[i - order]);
        }
    }
    let mut cubic = [values[3], Complex64::default(), Complex64::default(), Complex64::default()];
    for i in (0..3).rev() {
        for power in (1..4).rev() {
            cubic[power] = cubic[power - 1] - cubic[power] * nodes[i];
        }
        cubic[0] = values[i] - cubic[0] * nodes[i];
    }
    cubic
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hologram::tiles::shape::OVERSHOOT;

    #[test]
    fn levels_equal_the_function() {
        for (lowest, highest) in [(0.0, 0.01), (0.3, 0.31), (1.0, 1.06), (1.6, 1.7)] {
            let table = EdgeTable::new(lowest, highest, &Progress::new());
            for q in [lowest, 0.5 * (lowest + highest), highest] {
                let level = table.level(q);
                let root = Complex64::new(1.0, -q).sqrt();
                let mut worst = 0.0f64;
                for i in 0..2000 {
                    let t = i as f64 / 2000.0 * 16.0;
                    let (segment, w) = (t as usize, t.fract());
                    let part = |o: usize| {
                        (0..4).rev().fold(0.0, |s, p| s * w + f64::from(level[(o + p) * SEGMENTS + segment]))
                    };
                    let exact = 0.5 * erfc((t / table.density() - table.half) / root);
                    worst = worst.max((Complex64::new(part(0), part(4)) - exact).norm());
                }
                // Chebyshev cubic: 2(h/4)⁴/4!·|T⁗|, |T⁗| ≤ 3, h ≤ 6.04·√(1+q²)/16, and half a level.
                let h = 2.0 * table.half / 16.0;
                let bound = 0.25 * (h / 4.0).powi(4) + 5e-5;
                assert!(worst < bound, "q {q}: {worst:.2e} over {bound:.2e}");
            }
        }
    }

    #[test]
    fn no_edge_overshoots_more_than_stated() {
        // The overshoot grows with q towards the half plane's, 1.1706; tables are made for q up to some units.
        let mut before = 0.0;
        for q in [0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0] {
            let table = EdgeTable::new(q, q, &Progress::new());
            let level = table.level(q);
            let mut largest = 0.0f64;
            for i in 0..64_000 {
                let t = i as f64 / 4_000.0;
                let (segment, w) = (t as usize, t.fract());
                let part =
                    |o: usize| (0..4).rev().fold(0.0, |s, p| s * w + f64::from(level[(o + p) * SEGMENTS + segment]));
                largest = largest.max(part(0).hypot(part(4)));
            }
            println!("q {q}: {largest:.4}");
            assert!(largest < OVERSHOOT - 0.003, "q {q}: {largest}");
            assert!(largest >= before - 1e-4 || q > 3.0, "q {q}: {largest} after {before}");
            before = largest;
        }
        assert!(before > 1.1, "{before}");
    }
}
