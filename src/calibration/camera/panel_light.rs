//! Levels → light of a panel whose source, wavefront, curve and crosstalk are smooth functions with few numbers.

use super::shapes::{Products, legendre_lines, level_shapes, place};
use crate::field::{Complex32, phasor};
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
/// Places along each side of a pixel at which its phase is taken: neighbours' fields reach into it.
const SUB: usize = 3;

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
        crate::panel::simulated::blurred(&values, self.width, crosstalk.max(0.02))
    }

    /// The mean of exp(iφ) over each pixel, φ the pixels' phases blended by a Gaussian of that standard deviation [pixels].
    pub(super) fn blended(&self, phases: &[f32], crosstalk: f64) -> Vec<Complex32> {
        let weights = weights(crosstalk);
        let reach = weights[0].len() / 2;
        let (width, height) = (self.width, self.height);
        let mut out = vec![Complex32::new(0.0, 0.0); phases.len()];
        let share = 1.0 / (SUB * SUB) as f32;
        out.par_chunks_mut(width).enumerate().for_each_init(
            || vec![0.0f32; width + 2 * reach],
            |line, (row, out)| {
                for wy in &weights {
                    line.fill(0.0);
                    for (t, weight) in wy.iter().enumerate() {
                        let from = (row + t).saturating_sub(reach).min(height - 1);
                        let source = &phases[from * width..][..width];
                        line[reach..reach + width].iter_mut().zip(source).for_each(|(v, p)| *v += weight * p);
                    }
                    let (first, last) = (line[reach], line[reach + width - 1]);
                    line[..reach].fill(first);
                    line[reach + width..].fill(last);
                    line.iter_mut().for_each(|v| *v *= 1.0 / TAU);
                    for wx in &weights {
                        for (i, u) in out.iter_mut().enumerate() {
                            let turns: f32 = wx.iter().zip(&line[i..]).map(|(w, v)| w * v).sum();
                            *u += phasor(turns) * share;
                        }
                    }
                }
            },
        );
        out
    }
}

/// For each place within a pixel: the shares of the pixel and its neighbours there.
fn weights(crosstalk: f64) -> Vec<Vec<f32>> {
    let sigma = crosstalk.max(0.02);
    let reach = (3.5 * sigma + 0.5).ceil() as i32;
    let below = |x: f64| 0.5 * libm::erf(x / (sigma * std::f64::consts::SQRT_2));
    (0..SUB)
        .map(|s| {
            let at = (s as f64 + 0.5) / SUB as f64 - 0.5;
            let all: Vec<f64> =
                (-reach..=reach).map(|k| below(f64::from(k) + 0.5 - at) - below(f64::from(k) - 0.5 - at)).collect();
            let sum: f64 = all.iter().sum();
            all.iter().map(|w| (w / sum) as f32).collect()
        })
        .collect()
}
