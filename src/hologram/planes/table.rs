//! The one-dimensional kernel that a point is painted with: g(x; d), tabulated in depth and sub-pixel position.
//!
//! ```text
//! g(x; d) = ∫ W(f)/√(1 − λ²f²) · exp(i2π d (α(f) − ᾱ)) · exp(i2πfx) df
//! α(f) = √(1/λ² − f²) − 1/λ − λ³ m f²/4
//! ```
//!
//! The last term of α, with m the mean of the other axis' f², is what makes α_x(f_x) + α_y(f_y) + λ³ m_x m_y/4 the best
//! separable fit of f_z − 1/λ: the product of two such kernels is the point's band-limited wave but for the residual
//! that the spectrum corrects ([`super::spectrum`]).

use crate::field::{Complex64, Fft1};
use crate::hologram::definition::Optics;
use crate::hologram::lanes::{Aligned, Lanes};
use crate::progress::Progress;
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex};

/// Zeros on both sides of a row, so that a vector may start before it and end behind it.
const PAD: usize = 16;

/// How finely kernels are tabulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fineness {
    /// 32 positions a pixel, 0.3 rad a level.
    Coarse,
    /// 64 positions a pixel, 0.25 rad a level.
    Fine,
}

impl Fineness {
    fn phases(self) -> usize {
        match self {
            Self::Coarse => 32,
            Self::Fine => 64,
        }
    }
    /// Largest change of phase, from the middle of the band's range of phases, between two levels [rad]: four-point
    /// Lagrange interpolation errs by 0.0234·x⁴ there.
    fn level_step(self) -> f64 {
        match self {
            Self::Coarse => 0.3,
            Self::Fine => 0.25,
        }
    }
    /// Relative L2 error of a field that is exact otherwise, measured.
    pub(super) fn error(self) -> f64 {
        match self {
            Self::Coarse => 2.7e-4,
            Self::Fine => 1.2e-4,
        }
    }
}

/// Second-order mean of the separable fit along an axis: ⟨f²⟩ over |f| ≤ b [cycles²/m²].
pub(in crate::hologram) fn mean_square(optics: &Optics, axis: usize) -> f64 {
    optics.taper[axis].middle.powi(2) / 3.0
}

/// What a table is made from.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Key {
    optics: Optics,
    axis: usize,
    depth: f64,
    tail: f64,
    fineness: Fineness,
}

/// Tables that are kept for the next computation: two axes' for the fine and the coarse pass of a live view.
const KEPT: usize = 4;

/// Kernels of one axis.
#[derive(Debug)]
pub(in crate::hologram) struct Table {
    /// ᾱ [cycles/m], taken out of the kernel and put back as a point's phase.
    pub(in crate::hologram) mean: f64,
    /// Pixels from a row's middle to its ends.
    pub(in crate::hologram) half: usize,
    step: f64,
    phases: usize,
    /// Pixels of a row, [`PAD`] included.
    row: usize,
    values: Aligned,
}

/// Where a kernel stands in its table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::hologram) struct Place {
    /// The pixel at or before its middle.
    pub(in crate::hologram) pixel: isize,
    /// Line of the first of four levels and two sub-pixel positions.
    pub(in crate::hologram) line: usize,
    /// Part of a level beyond the second of the four.
    pub(in crate::hologram) u: f32,
    /// Part of a position beyond the first of the two.
    pub(in crate::hologram) t: f32,
}

impl Table {
    /// Half width of a row for depths up to `depth`, `tail` pixels beyond the cone.
    pub(in crate::hologram) fn half_width(optics: &Optics, axis: usize, depth: f64, tail: f64) -> usize {
        (optics.cone(axis, depth) / optics.pitch[axis] + tail).ceil() as usize + 2
    }
    /// Depth of a level, and number of levels, for depths up to `depth`.
    fn levels(optics: &Optics, axis: usize, depth: f64, fineness: Fineness) -> (f64, usize) {
        let (lowest, highest) = range(optics, axis);
        let step = fineness.level_step() / (TAU * 0.5 * (highest - lowest)).max(1e-3);
        (step, (depth / step) as usize + 4)
    }
    /// Memory [bytes].
    pub(in crate::hologram) fn bytes(optics: &Optics, axis: usize, depth: f64, tail: f64, fineness: Fineness) -> u64 {
        let row = 2 * Self::half_width(optics, axis, depth, tail) + 2 + 2 * PAD;
        (Self::levels(optics, axis, depth, fineness).1 * (fineness.phases() + 1) * 2 * row * 4) as u64
    }

    /// Kernels for |d| ≤ `depth`, `tail` pixels beyond the cone; unspecified when asked to stop.
    ///
    /// The last few tables are kept, so that a fixed geometry (live viewing, animation, iterations) has its own at once.
    pub(in crate::hologram) fn new(
        optics: &Optics,
        axis: usize,
        depth: f64,
        tail: f64,
        fineness: Fineness,
        progress: &Progress,
    ) -> Arc<Self> {
        static TABLES: Mutex<Vec<(Key, Arc<Table>)>> = Mutex::new(Vec::new());
        let key = Key { optics: *optics, axis, depth, tail, fineness };
        // A thread that panicked left whole tables behind.
        let kept = || TABLES.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some((_, table)) = kept().iter().find(|(known, _)| *known == key) {
            return Arc::clone(table);
        }
        let table = Arc::new(Self::build(optics, axis, depth, tail, fineness, progress));
        if !progress.stopped() {
            let mut kept = kept();
            if kept.len() == KEPT {
                kept.remove(0);
            }
            kept.push((key, Arc::clone(&table)));
        }
        table
    }

    fn build(optics: &Optics, axis: usize, depth: f64, tail: f64, fineness: Fineness, progress: &Progress) -> Self {
        let (step, levels) = Self::levels(optics, axis, depth, fineness);
        let phases = fineness.phases();
        let half = Self::half_width(optics, axis, depth, tail);
        let row = (2 * half + 2 + 2 * PAD).next_multiple_of(16);
        let taper = optics.taper[axis];
        let pitch = optics.pitch[axis];
        let (lowest, highest) = range(optics, axis);
        let mean = 0.5 * (lowest + highest);
        // One transform at `phases` samples a pixel gives all sub-pixel positions; the period leaves the kernel's tail
        // (exp(−(0.0895·px)²), 64 px to 1e-14) room to die.
        let period = (2 * (half + 64)).next_power_of_two();
        let count = period * phases;
        let df = 1.0 / (period as f64 * pitch);
        let top = (taper.reach(5.0) / df) as isize;
        let lambda = optics.wavelength;
        let spectrum: Vec<(usize, f64, f64)> = (-top..=top)
            .map(|k| {
                let f = k as f64 * df;
                // Linear interpolation between positions lowers a wave by the mean factor 1 − θ²/12, θ its phase from
                // one position to the next; what is left after dividing by it is 0.037·θ².
                let theta = TAU * f * pitch / phases as f64;
                let weight = taper.at(f) / (1.0 - (lambda * f).powi(2)).sqrt() * (1.0 + theta * theta / 12.0) * df;
                (k.rem_euclid(count as isize) as usize, weight, alpha(optics, axis, f) - mean)
            })
            .collect();
        let plan = Fft1::new(count);
        let mut values = Aligned::default();
        values.reserve(levels * (phases + 1) * 2 * row);
        let level_values = (phases + 1) * 2 * row;
        values.values_mut()[..levels * level_values].par_chunks_mut(level_values).enumerate().for_each_init(
            || (vec![Complex64::default(); count], plan.scratch()),
            |(line, scratch), (level, out)| {
                if progress.stopped() {
                    return;
                }
                // One level before zero and two behind the last serve the four-point interpolation.
                let d = (level as f64 - 1.0) * step;
                line.fill(Complex64::default());
                for &(k, weight, alpha) in &spectrum {
                    line[k] = Complex64::cis(TAU * d * alpha) * weight;
                }
                plan.inverse(line, scratch);
                for (phase, rows) in out.chunks_exact_mut(2 * row).enumerate() {
                    let (re, im) = rows.split_at_mut(row);
                    for i in 0..2 * half + 2 {
                        let at = (i as isize - half as isize) * phases as isize - phase as isize;
                        let u = line[at.rem_euclid(count as isize) as usize];
                        (re[PAD + i], im[PAD + i]) = (u.re as f32, u.im as f32);
                    }
                }
            },
        );
        Self { mean, half, step, phases, row, values }
    }

    /// Where the kernel of depth `d` at a position stands.
    pub(in crate::hologram) fn place(&self, d: f64, position: f64) -> Place {
        let depth = d.abs() / self.step;
        let level = depth as usize;
        let pixel = position.floor();
        let fine = (position - pixel) * self.phases as f64;
        let phase = (fine as usize).min(self.phases - 1);
        Place {
            pixel: pixel as isize,
            line: level * (self.phases + 1) + phase,
            u: (depth - level as f64) as f32,
            t: (fine - phase as f64) as f32,
        }
    }

    /// Its lines, real and imaginary parts of `row` values each, one level after another; `row`; the index in a row of
    /// the kernel's middle; lines of a level.
    #[cfg(feature = "gpu")]
    pub(in crate::hologram) fn lines(&self) -> (&[f32], usize, usize, usize) {
        (self.values.values(), self.row, self.half + PAD, self.phases + 1)
    }

    /// Writes g(i − position; d) for the pixels i = first … first + count − 1 (`count` a multiple of the lanes) to `re`
    /// and `im`, zero beyond the row.
    ///
    /// # Safety
    /// The instruction set of `L` must be enabled; |d| must lie within the table; `re` and `im` must hold `count`.
    #[inline(always)]
    pub(super) unsafe fn write<L: Lanes>(
        &self,
        d: f64,
        position: f64,
        first: isize,
        count: usize,
        re: *mut f32,
        im: *mut f32,
    ) {
        let Place { pixel, line, u, t } = self.place(d, position);
        let lagrange = [
            -u * (u - 1.0) * (u - 2.0) / 6.0,
            (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0,
            -(u + 1.0) * u * (u - 2.0) / 2.0,
            (u + 1.0) * u * (u - 1.0) / 6.0,
        ];
        let sign = if d < 0.0 { -1.0 } else { 1.0 };
        let rows: [usize; 8] = std::array::from_fn(|n| (line + n / 2 * (self.phases + 1) + n % 2) * 2 * self.row);
        let values = self.values.values();
        assert!(rows[7] + 2 * self.row <= values.len(), "depth within the table");
        let weights: [f32; 8] = std::array::from_fn(|n| lagrange[n / 2] * if n % 2 == 0 { 1.0 - t } else { t });
        let mut at = first - pixel + self.half as isize + PAD as isize;
        let mut i = 0;
        // SAFETY: `at` is checked to lie in its row with a whole vector, rows lie in the table as asserted.
        unsafe {
            let weights = weights.map(|w| L::splat(w));
            while i < count {
                let (mut a, mut b) = (L::splat(0.0), L::splat(0.0));
                if at >= 0 && at as usize + L::COUNT <= self.row {
                    for n in 0..8 {
                        let from = values.as_ptr().add(rows[n] + at as usize);
                        a = weights[n].fma(L::load(from), a);
                        b = weights[n].fma(L::load(from.add(self.row)), b);
                    }
                    b = b.mul(L::splat(sign));
                }
                a.store(re.add(i));
                b.store(im.add(i));
                at += L::COUNT as isize;
                i += L::COUNT;
            }
        }
    }
}

/// α(f) of an axis [cycles/m].
fn alpha(optics: &Optics, axis: usize, f: f64) -> f64 {
    let (lambda, other) = (optics.wavelength, mean_square(optics, 1 - axis));
    // √(1/λ² − f²) − 1/λ without cancellation.
    -lambda * f * f / (1.0 + (1.0 - (lambda * f).powi(2)).sqrt()) - lambda.powi(3) * other * f * f / 4.0
}

/// Lowest and highest α in the band.
fn range(optics: &Optics, axis: usize) -> (f64, f64) {
    (alpha(optics, axis, optics.taper[axis].limit), 0.0)
}
