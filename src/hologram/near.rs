//! Points near the panel: the definition's integral as a short sum of products of one-dimensional kernels.
//!
//! f_z is not a sum over axes, but near the panel it nearly is. With S(f) = √(1/λ² − f²),
//!
//! ```text
//! e^{i2π d f_z}/f_z = e^{i2π d (S(f_x) + S(f_y) − 1/λ)} / (S(f_x)·S(f_y)) · G(f_x, f_y)
//! G = S(f_x)·S(f_y)/f_z · e^{i2π d (f_z − S(f_x) − S(f_y) + 1/λ)}
//! ```
//!
//! where G is smooth even at the corner of the band: with a = λ²f_x² and b = λ²f_y² its phase is about 2πd/λ·ab/4 and
//! its modulus λ⁻¹·(1 + ab/2). (Left undivided, 1/f_z alone varies by b/2: 1e-3 at 8 µm.) As a function of f_y², G is
//! interpolated at R Chebyshev nodes; for an exponential of phase κ over the interval the error is 2(κ/4)^R/R!. So the
//! field is Σ_R X_r(x)·Y_r(y), each the transform of a tapered one-dimensional spectrum, exact at every sub-pixel
//! position: at node n, X has the spectrum e^{i2πd(f_z − S_n)}·S_n/f_z and Y has e^{i2πdS(f_y)}·L_n(f_y²)/S(f_y), whose
//! product is the integrand itself.

use super::definition::Optics;
use super::sources::{PointSum, PointWave};
use crate::error::Result;
use crate::field::{Complex32, Complex64, Fft1, Field, Grid};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Highest number of products: beyond it the direct form is nearer.
const HIGHEST_RANK: usize = 32;

/// Error at which the expansion of G is cut.
const ACCURACY: f64 = 2e-6;

/// Pixels beyond the cone after which the taper's own tail, exp(−(0.0895·px)²)/(π·px), is dropped: 3e-6. Of a band that ends at
/// half a cycle a pixel; of a narrower one by as much more.
const TAIL: f64 = 34.0;

/// Pixels beyond the cone after which the kernel is zero to 1e-10: the distance to its alias; likewise.
const SILENCE: f64 = 64.0;

/// Points whose kernels are held together.
const BATCH: usize = 256;

/// Rows that one task adds to.
const BAND: usize = 16;

/// Number of products that a point at this distance takes, if this form serves it.
pub(crate) fn rank(optics: &Optics, distance: f64) -> Option<usize> {
    // Where the taper is 1e-4, at the corner of the band: phase and logarithm of the modulus of G.
    let [a, b] = optics.taper.map(|taper| (optics.wavelength * taper.limit).powi(2));
    let (root_a, root_b, root) = ((1.0 - a).sqrt(), (1.0 - b).sqrt(), (1.0 - a - b).sqrt());
    // √(1−a−b) − √(1−a) − √(1−b) + 1 without cancellation.
    let residual = a * b * (1.0 / (root + root_b) + 1.0 / (1.0 + root_a)) / ((1.0 + root_b) * (root + root_a));
    let kappa = TAU * distance / optics.wavelength * residual + (root_a * root_b / root).ln();
    let mut error = 2.0;
    for rank in 1..=HIGHEST_RANK {
        error *= kappa / 4.0 / rank as f64;
        if error <= ACCURACY {
            return Some(rank);
        }
    }
    None
}

/// Pixels that a kernel reaches along an axis, `tail` pixels beyond the cone.
fn reach(optics: &Optics, axis: usize, distance: f64, tail: f64) -> f64 {
    let cone = optics.spread(axis, distance, optics.taper.map(|taper| taper.limit));
    cone / optics.pitch[axis] + tail / optics.filled(axis)
}

/// Memory of a batch of kernels [bytes].
pub(crate) fn bytes(optics: &Optics, sources: &[PointWave], indexes: &[usize]) -> u64 {
    let largest = indexes.iter().map(|&i| {
        let distance = sources[i].distance;
        let span: f64 = (0..2).map(|axis| 2.0 * reach(optics, axis, distance, TAIL) + 2.0).sum();
        rank(optics, distance).unwrap_or(1) as u64 * span as u64 * 8
    });
    largest.max().unwrap_or(0) * BATCH.min(indexes.len()) as u64
}

/// Predicted work [core-seconds]: transforms and spectra of the kernels, and the products on the patch; fitted to 30 to
/// 3,000 points within 6 cm of a panel of 1080p at 8 µm.
pub(crate) fn core_seconds(optics: &Optics, sources: &[PointWave], indexes: &[usize]) -> f64 {
    let one = |&i: &usize| {
        let [columns, rows] = [0, 1].map(|axis| 2.0 * reach(optics, axis, sources[i].distance, TAIL));
        let period = |axis: usize| (2.0 * reach(optics, axis, sources[i].distance, SILENCE)) as usize + 2;
        let lines = (period(0).next_power_of_two() + period(1).next_power_of_two()) as f64;
        let rank = rank(optics, sources[i].distance).unwrap_or(HIGHEST_RANK) as f64;
        rank * (lines * (1.05e-7 + 7e-9 * rank) + columns * rows * 1.4e-9)
    };
    indexes.iter().map(one).sum()
}

/// Adds near sources to the field.
pub(crate) fn add(field: &mut Field, sum: &PointSum, indexes: &[usize]) -> Result<()> {
    let PointSum { optics, grid, sources, progress, .. } = *sum;
    for batch in indexes.chunks(BATCH) {
        let kernels: Vec<Option<Kernel>> = batch
            .par_iter()
            .map_init(Plans::default, |plans, &i| {
                if progress.stopped() {
                    return None;
                }
                Kernel::new(optics, &sources[i], grid, plans)
            })
            .collect();
        progress.check()?;
        field.samples.par_chunks_mut(grid.width * BAND).enumerate().for_each(|(band, samples)| {
            for (i, row) in samples.chunks_exact_mut(grid.width).enumerate() {
                if progress.stopped() {
                    return;
                }
                kernels.iter().flatten().for_each(|kernel| kernel.add_row(band * BAND + i, row));
            }
        });
        progress.check()?;
        progress.advance(batch.len() as u64);
    }
    Ok(())
}

/// Transforms of the lengths in use, and their scratch.
#[derive(Default)]
struct Plans(Vec<(Fft1<f64>, Vec<Complex64>)>);

impl Plans {
    /// Σ_k spectrum(k)·exp(+i2πkm/n), in place: the trapezoid rule of the integral over f, whose weight 1/(n·pitch) is
    /// in the spectrum.
    fn sum(&mut self, spectrum: &mut [Complex64]) {
        let n = spectrum.len();
        // Looked up here first: the process' own plans are behind a lock.
        let at = self.0.iter().position(|(plan, _)| plan.len() == n).unwrap_or_else(|| {
            let plan = Fft1::new(n);
            let scratch = plan.scratch();
            self.0.push((plan, scratch));
            self.0.len() - 1
        });
        let (plan, scratch) = &mut self.0[at];
        plan.inverse(spectrum, scratch);
    }
}

/// The field of one point: Σ_r x[r]·y[r] on a patch of pixels.
struct Kernel {
    first: [usize; 2],
    x: Vec<Vec<Complex32>>,
    y: Vec<Vec<Complex32>>,
}

impl Kernel {
    /// The patch of a source; `None` where it misses the panel.
    fn new(optics: &Optics, source: &PointWave, grid: &Grid, plans: &mut Plans) -> Option<Self> {
        let rank = rank(optics, source.distance).unwrap_or(HIGHEST_RANK);
        let span = |axis: usize, position: f64, count: usize| {
            let reach = reach(optics, axis, source.distance, TAIL);
            let first = (position - reach).ceil().max(0.0);
            let last = (position + reach).floor().min(count as f64 - 1.0);
            (first <= last).then_some(Line { axis, position, first: first as usize, last: last as usize })
        };
        let (columns, rows) = (span(0, grid.column(source.x), grid.width)?, span(1, grid.row(source.y), grid.height)?);
        let inverse = 1.0 / optics.wavelength;
        let highest = optics.taper[1].reach(5.0).powi(2);
        let nodes: Vec<f64> = (0..rank)
            .map(|n| 0.5 * highest * (1.0 - (std::f64::consts::PI * (n as f64 + 0.5) / rank as f64).cos()))
            .collect();
        let fz = |square: f64| (inverse * inverse - square).max(0.0).sqrt();
        let turns = |cycles: f64| Complex64::cis((cycles - cycles.floor()) * TAU);
        let factor = Complex64::new(0.0, source.amplitude);
        let (mut x, mut y) = (Vec::with_capacity(rank), Vec::with_capacity(rank));
        for (n, &node) in nodes.iter().enumerate() {
            let at_node = fz(node);
            let spectrum = |f: f64| {
                let z = fz(f * f + node);
                factor * turns(source.distance * (z - at_node)) * (at_node / z)
            };
            let mut line = columns.kernel(optics, source.distance, plans, spectrum);
            // A converging wave is the conjugate of a diverging one; the phase φ is not conjugated.
            let phase = turns(source.turns);
            for u in &mut line {
                *u = if source.sign < 0.0 { u.conj() } else { *u } * phase;
            }
            x.push(line.iter().map(|u| Complex32::new(u.re as f32, u.im as f32)).collect());
            let spectrum = |f: f64| {
                let lagrange: f64 =
                    (0..rank).filter(|&m| m != n).map(|m| (f * f - nodes[m]) / (node - nodes[m])).product();
                let s = fz(f * f);
                turns(source.distance * s) * (lagrange / s)
            };
            let mut line = rows.kernel(optics, source.distance, plans, spectrum);
            if source.sign < 0.0 {
                line.iter_mut().for_each(|u| *u = u.conj());
            }
            y.push(line.iter().map(|u| Complex32::new(u.re as f32, u.im as f32)).collect());
        }
        Some(Self { first: [columns.first, rows.first], x, y })
    }

    fn add_row(&self, row: usize, samples: &mut [Complex32]) {
        let rows = self.y[0].len();
        if row < self.first[1] || row >= self.first[1] + rows {
            return;
        }
        let span = &mut samples[self.first[0]..self.first[0] + self.x[0].len()];
        for (x, y) in self.x.iter().zip(&self.y) {
            let y = y[row - self.first[1]];
            for (u, x) in span.iter_mut().zip(x) {
                *u += x * y;
            }
        }
    }
}

/// The pixels of one axis that a kernel is wanted at.
struct Line {
    axis: usize,
    /// Fractional index of the source.
    position: f64,
    first: usize,
    last: usize,
}

impl Line {
    /// ∫ W(f)·spectrum(f)·exp(i2πfΔ) df at the pixels, Δ from the source's position.
    fn kernel(
        &self,
        optics: &Optics,
        distance: f64,
        plans: &mut Plans,
        spectrum: impl Fn(f64) -> Complex64,
    ) -> Vec<Complex64> {
        let (pitch, taper) = (optics.pitch[self.axis], optics.taper[self.axis]);
        let period = 2.0 * reach(optics, self.axis, distance, SILENCE);
        let n = (period as usize + 2).next_power_of_two();
        let step = 1.0 / (n as f64 * pitch);
        let nearest = self.position.floor();
        let offset = self.position - nearest;
        let mut values = vec![Complex64::default(); n];
        // On pixels all frequencies that differ by 1/pitch are one: those beyond the Nyquist limit are added to their alias.
        let top = (taper.reach(5.0) / step) as isize;
        for k in -top..=top {
            let f = k as f64 * step;
            let turns = -f * pitch * offset;
            let wave = Complex64::cis((turns - turns.floor()) * TAU);
            values[k.rem_euclid(n as isize) as usize] += spectrum(f) * wave * (taper.at(f) * step);
        }
        plans.sum(&mut values);
        let at = |i: usize| (i as isize - nearest as isize).rem_euclid(n as isize) as usize;
        (self.first..=self.last).map(|i| values[at(i)]).collect()
    }
}
