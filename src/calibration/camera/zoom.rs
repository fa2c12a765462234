//! Fourier sums of a panel's light at any places within a window of the Fourier plane.
//!
//! A lens shows U(ν) = Σ u(n)·exp(−i2πν·n), ν in cycles a pixel. A camera sees a window of it. The light of `step` pixels
//! is gathered onto a lattice by a Kaiser–Bessel kernel, which keeps frequencies within a quarter of a cycle a lattice
//! step of the window's middle; the lattice, padded twofold, is transformed; and between the transform's samples the same
//! kernel interpolates (Fessler & Sutton, *IEEE Trans. Signal Process.* 51, 560 (2003)). Each stage is twofold
//! oversampled; with six samples of kernel the sums are right to 1e-4.

use crate::field::{Complex32, Fft2};
use crate::progress::Progress;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Samples that a kernel covers along an axis.
pub(super) const TAPS: usize = 6;

/// Shape of the kernel for twofold oversampling.
const SHAPE: f64 = 13.86;

/// Table entries of the kernel a sample.
const FINE: usize = 512;

/// Kaiser–Bessel kernel at a distance of `t` samples.
fn kernel(t: f64) -> f64 {
    let inside = 1.0 - (2.0 * t / TAPS as f64).powi(2);
    if inside < 0.0 { 0.0 } else { bessel_i0(SHAPE * inside.sqrt()) / bessel_i0(SHAPE) }
}

/// Its Fourier transform at `f` cycles a sample, |f| < 0.7.
fn kernel_spectrum(f: f64) -> f64 {
    let root = (SHAPE * SHAPE - (PI * TAPS as f64 * f).powi(2)).max(1e-12).sqrt();
    TAPS as f64 * root.sinh() / root / bessel_i0(SHAPE)
}

/// Modified Bessel function of the first kind and order zero, by its series.
fn bessel_i0(x: f64) -> f64 {
    let quarter = 0.25 * x * x;
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..60 {
        term *= quarter / f64::from(k * k);
        sum += term;
    }
    sum
}

/// The lattice along one axis.
#[derive(Clone, Debug)]
struct Axis {
    /// Pixels of the panel.
    pixels: usize,
    /// Lattice samples.
    count: usize,
    /// Length of the padded transform.
    padded: usize,
    /// Kernel weights of the pixels under a lattice sample.
    weights: Vec<f32>,
    /// First pixel under lattice sample 0 (before the panel's first: negative).
    first: isize,
    /// Factors on lattice samples that undo the interpolation's kernel.
    undo: Vec<f32>,
}

impl Axis {
    fn new(pixels: usize, step: usize) -> Self {
        let count = pixels.div_ceil(step) + TAPS;
        let middle = 0.5 * (pixels as f64 - 1.0);
        // Position of lattice sample 0 in pixels, and the pixels within half a kernel of it.
        let origin = middle - 0.5 * (count as f64 - 1.0) * step as f64;
        let reach = 0.5 * (TAPS * step) as f64;
        let first = (origin - reach).ceil() as isize;
        let last = (origin + reach).floor() as isize;
        let weights = (first..=last).map(|i| kernel((i as f64 - origin) / step as f64) as f32).collect();
        let padded = crate::field::fast_length(2 * count, 2, &[1]);
        let half = (count / 2) as f64;
        let undo = (0..count).map(|j| (1.0 / kernel_spectrum((j as f64 - half) / padded as f64)) as f32).collect();
        Self { pixels, count, padded, weights, first, undo }
    }

    /// A lattice sample's place in the padded transform: the middle one at 0.
    fn place(&self, j: usize) -> usize {
        (j + self.padded - self.count / 2) % self.padded
    }
}

/// A window of the Fourier plane about `center`, `1 / (2·step)` cycles a pixel wide.
#[derive(Clone, Debug)]
pub(super) struct Zoom {
    x: Axis,
    y: Axis,
    pub(super) step: usize,
    /// Middle of the window [cycles/pixel].
    pub(super) center: [f64; 2],
    plan: Fft2<f32>,
    table: Vec<f32>,
}

/// Where a sum is wanted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    x: u32,
    y: u32,
    wx: [f32; TAPS],
    wy: [f32; TAPS],
}

/// Half the width of a window of lattice steps of so many pixels [cycles/pixel].
pub(super) fn window(step: usize) -> f64 {
    0.25 / step as f64
}

impl Zoom {
    pub(super) fn new(width: usize, height: usize, step: usize, center: [f64; 2]) -> Self {
        let (x, y) = (Axis::new(width, step), Axis::new(height, step));
        let plan = Fft2::new(x.padded, y.padded);
        let table = (0..=FINE * TAPS / 2 + 1).map(|i| kernel(i as f64 / FINE as f64) as f32).collect();
        Self { x, y, step, center, plan, table }
    }

    /// Half the window's width [cycles/pixel].
    pub(super) fn half(&self) -> f64 {
        window(self.step)
    }

    /// Lattice samples along x and y.
    pub(super) fn counts(&self) -> [usize; 2] {
        [self.x.count, self.y.count]
    }

    /// Position of a lattice sample from the panel's middle [pixels], along x (axis 0) or y.
    pub(super) fn position(&self, axis: usize, j: usize) -> f64 {
        let count = self.counts()[axis];
        (j as f64 - 0.5 * (count as f64 - 1.0)) * self.step as f64
    }

    /// exp(−i2πν_c·n) of the panel's columns (axis 0) or rows, counted from the panel's middle.
    pub(super) fn carrier(&self, axis: usize) -> Vec<Complex32> {
        let pixels = [self.x.pixels, self.y.pixels][axis];
        (0..pixels)
            .map(|i| {
                let turn = self.center[axis] * (i as f64 - 0.5 * (pixels as f64 - 1.0));
                let (sin, cos) = (-TAU * turn.fract()).sin_cos();
                Complex32::new(cos as f32, sin as f32)
            })
            .collect()
    }

    /// The lattice of a panel's light, to which the carrier has been applied.
    pub(super) fn gather(&self, light: &[Complex32]) -> Vec<Complex32> {
        let (x, y) = (&self.x, &self.y);
        let zero = Complex32::new(0.0, 0.0);
        let reach = x.weights.len();
        let before = (-x.first).max(0) as usize;
        let long = before + x.pixels + reach + x.count * self.step;
        let mut rows = vec![zero; x.count * y.pixels];
        rows.par_chunks_mut(x.count).zip(light.par_chunks(x.pixels)).for_each_init(
            || vec![zero; long],
            |line, (out, row)| {
                line[before..before + x.pixels].copy_from_slice(row);
                for (j, out) in out.iter_mut().enumerate() {
                    let begin = (before as isize + x.first) as usize + j * self.step;
                    let taken = &line[begin..begin + reach];
                    let (mut re, mut im) = (0.0f32, 0.0f32);
                    for (u, w) in taken.iter().zip(&x.weights) {
                        re += u.re * w;
                        im += u.im * w;
                    }
                    *out = Complex32::new(re, im);
                }
            },
        );
        let mut lattice = vec![zero; x.count * y.count];
        lattice.par_chunks_mut(x.count).enumerate().for_each(|(j, out)| {
            let begin = y.first + (j * self.step) as isize;
            for (t, w) in y.weights.iter().enumerate() {
                let row = begin + t as isize;
                if (0..y.pixels as isize).contains(&row) {
                    let row = &rows[row as usize * x.count..][..x.count];
                    out.iter_mut().zip(row).for_each(|(out, u)| *out += u * w);
                }
            }
        });
        lattice
    }

    /// The padded transform of a lattice, times a factor for each lattice sample.
    pub(super) fn transform(
        &self,
        lattice: &[Complex32],
        factor: impl Fn(usize, usize) -> Complex32 + Sync,
    ) -> Vec<Complex32> {
        let (x, y) = (&self.x, &self.y);
        let mut plane = vec![Complex32::new(0.0, 0.0); x.padded * y.padded];
        for (j, row) in lattice.chunks_exact(x.count).enumerate() {
            let out = &mut plane[y.place(j) * x.padded..][..x.padded];
            for (i, u) in row.iter().enumerate() {
                out[x.place(i)] = u * factor(i, j) * (x.undo[i] * y.undo[j]);
            }
        }
        self.plan.forward(&mut plane, &Progress::new());
        plane
    }

    /// Columns and rows of the padded transform.
    pub(super) fn padded(&self) -> [usize; 2] {
        [self.x.padded, self.y.padded]
    }

    /// Frequency of a sample of the padded transform [cycles/pixel] within the window, or beyond it.
    pub(super) fn frequency(&self, axis: usize, k: usize) -> f64 {
        let n = self.padded()[axis];
        let signed = if 2 * k < n { k as f64 } else { k as f64 - n as f64 };
        self.center[axis] + signed / (n as f64 * self.step as f64)
    }

    /// Place of a frequency [cycles/pixel], and the factor that undoes the gathering's kernel; `None` beyond the window.
    pub(super) fn place(&self, frequency: [f64; 2]) -> Option<(Place, f64)> {
        let mut gain = 1.0;
        let mut found = [(0u32, [0.0f32; TAPS]); 2];
        for axis in 0..2 {
            let f = (frequency[axis] - self.center[axis]) * self.step as f64;
            if f.is_nan() || f.abs() > 0.25 {
                return None;
            }
            gain /= kernel_spectrum(f);
            let n = self.padded()[axis];
            let at = f * n as f64;
            let first = (at - 0.5 * TAPS as f64).ceil();
            let begin = (first as isize).rem_euclid(n as isize) as u32;
            let mut weights = [0.0; TAPS];
            for (t, weight) in weights.iter_mut().enumerate() {
                let distance = (first + t as f64 - at).abs() * FINE as f64;
                let (low, share) = (distance as usize, distance.fract() as f32);
                let low = low.min(self.table.len() - 2);
                *weight = self.table[low] + share * (self.table[low + 1] - self.table[low]);
            }
            found[axis] = (begin, weights);
        }
        Some((Place { x: found[0].0, y: found[1].0, wx: found[0].1, wy: found[1].1 }, gain))
    }

    /// The sum at a place, from a padded transform.
    pub(super) fn sample(&self, plane: &[Complex32], place: &Place) -> Complex32 {
        let (width, height) = (self.x.padded, self.y.padded);
        let (x, y) = (place.x as usize, place.y as usize);
        let mut sum = Complex32::new(0.0, 0.0);
        for (t, wy) in place.wy.iter().enumerate() {
            let row = if y + t < height { y + t } else { y + t - height };
            let row = &plane[row * width..][..width];
            let mut line = Complex32::new(0.0, 0.0);
            if x + TAPS <= width {
                for (u, w) in row[x..x + TAPS].iter().zip(&place.wx) {
                    line += u * w;
                }
            } else {
                for (s, w) in place.wx.iter().enumerate() {
                    line += row[(x + s) % width] * w;
                }
            }
            sum += line * wy;
        }
        sum
    }
}
