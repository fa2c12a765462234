//! Levels → light of a panel whose source, wavefront, curve and crosstalk are smooth functions with few numbers.

use super::shapes::{Products, legendre_lines, level_shapes, place};
use crate::field::{Complex32, phasor};
use crate::panel::crosstalk::{mixed, spread};
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Degree of the logarithm of the source's amplitude.
pub(super) const SOURCE_DEGREE: usize = 4;
/// Degree of the wavefront.
pub(super) const WAVE_DEGREE: usize = 6;
/// Functions of the level that make up a curve.
pub(super) const CURVE: usize = 5;
/// Degree over the panel of each one's share.
pub(super) const CURVE_DEGREE: usize = 2;

/// A panel's pixels, and the functions over them.
#[derive(Clone, Debug)]
pub(super) struct PanelLight {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) source: Products,
    pub(super) wave: Products,
    pub(super) over: Products,
    /// Functions of each level.
    pub(super) shapes: Vec<[f32; CURVE]>,
    lines: Vec<Vec<f32>>,
}

impl PanelLight {
    pub(super) fn new(width: usize, height: usize, levels: usize) -> Self {
        let shapes = level_shapes(CURVE, levels);
        Self {
            width,
            height,
            source: Products::new(1, SOURCE_DEGREE),
            wave: Products::new(2, WAVE_DEGREE),
            over: Products::new(0, CURVE_DEGREE),
            shapes: shapes.iter().map(|s| std::array::from_fn(|m| s[m] as f32)).collect(),
            lines: legendre_lines(WAVE_DEGREE, width),
        }
    }

    /// Σ c·P of each pixel of a row.
    fn along(&self, products: &Products, coefficients: &[f64], row: usize, out: &mut [f32]) {
        let factors = products.row(coefficients, place(row as f64, self.height));
        out.fill(0.0);
        for (factor, line) in factors.iter().zip(&self.lines) {
            out.iter_mut().zip(line).for_each(|(out, p)| *out += factor * p);
        }
    }

    /// The wave that falls on each pixel, with the panel's wavefront error: exp(s + i·w), times the carriers of column and
    /// row.
    pub(super) fn incident(&self, source: &[f64], wave: &[f64], carriers: [&[Complex32]; 2]) -> Vec<Complex32> {
        let mut out = vec![Complex32::new(0.0, 0.0); self.width * self.height];
        out.par_chunks_mut(self.width).enumerate().for_each_init(
            || (vec![0.0; self.width], vec![0.0; self.width]),
            |(s, w), (row, out)| {
                self.along(&self.source, source, row, s);
                self.along(&self.wave, wave, row, w);
                let y = carriers[1][row];
                for (i, u) in out.iter_mut().enumerate() {
                    *u = phasor(w[i] * (1.0 / TAU)) * s[i].exp() * (carriers[0][i] * y);
                }
            },
        );
        out
    }

    /// The phase that each pixel's level asks for [rad]; `curve` has a factor for each function of the level and each
    /// product over the panel, the products within.
    pub(super) fn phases(&self, curve: &[f64], levels: &[u16]) -> Vec<f32> {
        let mut out = vec![0.0f32; levels.len()];
        let terms = self.over.len();
        out.par_chunks_mut(self.width).zip(levels.par_chunks(self.width)).enumerate().for_each_init(
            || vec![0.0; self.width],
            |shares, (row, (out, levels))| {
                for m in 0..CURVE {
                    self.along(&self.over, &curve[m * terms..][..terms], row, shares);
                    for ((out, level), share) in out.iter_mut().zip(levels).zip(shares.iter()) {
                        *out += share * self.shapes[usize::from(*level)][m];
                    }
                }
            },
        );
        out
    }

    /// A function of the level at each pixel, blended over its neighbours by the crosstalk.
    pub(super) fn shape(&self, m: usize, levels: &[u16], crosstalk: f64) -> Vec<f32> {
        let values: Vec<f32> = levels.par_iter().map(|&level| self.shapes[usize::from(level)][m]).collect();
        spread(&values, self.width, crosstalk)
    }

    /// The mean of exp(iφ) over each pixel, φ the pixels' phases blended by a Gaussian of that standard deviation [pixels].
    pub(super) fn blended(&self, phases: &[f32], crosstalk: f64) -> Vec<Complex32> {
        mixed(phases, self.width, crosstalk, |phase| phasor(phase * (1.0 / TAU)))
    }
}
