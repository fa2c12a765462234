//! Two-dimensional discrete Fourier transforms: the only place that normalises.
//!
//! Forward: U(k) = Σ u(n)·exp(−i2πkn/N), no factor. Inverse: exp(+i2πkn/N) and 1/(width·height). Row-major.
//!
//! ```
//! use holodrive::field::{Complex64, Fft2, Grid};
//! use holodrive::progress::Progress;
//!
//! // A plane wave of frequency (f_x, f_y) has its whole spectrum in the sample of that frequency.
//! let grid = Grid::new(16, 12, 8e-6, 8e-6)?;
//! let (fx, fy) = (grid.frequency_x(3), grid.frequency_y(10));
//! let wave = |i: usize| (fx * grid.x(i % 16) + fy * grid.y(i / 16)) * std::f64::consts::TAU;
//! let mut samples: Vec<Complex64> = (0..grid.len()).map(|i| Complex64::cis(wave(i))).collect();
//! Fft2::new(16, 12).forward(&mut samples, &Progress::new());
//! for (i, u) in samples.iter().enumerate() {
//!     assert!((u.norm() - if i == 10 * 16 + 3 { 192.0 } else { 0.0 }).abs() < 1e-10);
//! }
//! # Ok::<(), holodrive::Error>(())
//! ```

use crate::progress::Progress;
use num_complex::Complex;
use rayon::prelude::*;
pub use rustfft::FftNum;
use rustfft::{Fft, FftPlanner};
use std::any::{Any, TypeId};
use std::collections::HashMap;
use std::sync::{Arc, LazyLock, Mutex};

/// Planned transforms of lines of one length, neither direction with a factor; usable from any number of threads.
#[derive(Clone)]
pub(crate) struct Fft1<T: FftNum> {
    forward: Arc<dyn Fft<T>>,
    inverse: Arc<dyn Fft<T>>,
}

impl<T: FftNum> std::fmt::Debug for Fft1<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Fft1 {}", self.len())
    }
}

impl<T: FftNum> Fft1<T> {
    /// Transforms of a length; each length is planned once in the life of the process.
    pub(crate) fn new(length: usize) -> Self {
        /// A planner of each precision; it keeps its plans.
        static PLANNERS: LazyLock<Mutex<HashMap<TypeId, Box<dyn Any + Send>>>> = LazyLock::new(Mutex::default);
        // A thread that panicked while it planned left the planner as it was.
        let mut planners = PLANNERS.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let planner = planners.entry(TypeId::of::<T>()).or_insert_with(|| Box::new(FftPlanner::<T>::new()));
        let mut fresh = FftPlanner::new();
        let planner = planner.downcast_mut::<FftPlanner<T>>().unwrap_or(&mut fresh);
        Self { forward: planner.plan_fft_forward(length), inverse: planner.plan_fft_inverse(length) }
    }
    /// Samples of a line.
    pub(crate) fn len(&self) -> usize {
        self.forward.len()
    }
    /// `count` dark samples.
    fn dark(count: usize) -> Vec<Complex<T>> {
        vec![Complex::new(T::zero(), T::zero()); count]
    }
    /// Memory that a thread's transforms need, in either direction.
    pub(crate) fn scratch(&self) -> Vec<Complex<T>> {
        Self::dark(self.forward.get_inplace_scratch_len().max(self.inverse.get_inplace_scratch_len()))
    }
    /// Σ u(n)·exp(−i2πkn/N) of each line, in place.
    pub(crate) fn forward(&self, lines: &mut [Complex<T>], scratch: &mut [Complex<T>]) {
        self.forward.process_with_scratch(lines, scratch);
    }
    /// Σ u(n)·exp(+i2πkn/N) of each line, in place, without 1/N.
    pub(crate) fn inverse(&self, lines: &mut [Complex<T>], scratch: &mut [Complex<T>]) {
        self.inverse.process_with_scratch(lines, scratch);
    }
}

/// The smallest `step`·2^a·3^b·5^c, times one of `others`, that is not below `least`: lengths that transforms are fast at.
pub(crate) fn fast_length(least: usize, step: usize, others: &[usize]) -> usize {
    let rest = |mut n: usize| {
        for prime in [2, 3, 5] {
            while n.is_multiple_of(prime) {
                n /= prime;
            }
        }
        n
    };
    let is_fast = |&m: &usize| others.contains(&rest(m));
    (least.div_ceil(step).max(1)..).find(is_fast).map_or(least, |m| step * m)
}

/// Columns that one task transforms together: four cache lines a row, so that few pages are opened for much of each, and with
/// their transforms within a second-level cache.
const fn strip_width<T>() -> usize {
    256 / size_of::<Complex<T>>()
}

/// Rows that one task transforms together.
const ROWS: usize = 16;

/// A planned transform of one size, forward and inverse, usable from any number of threads.
///
/// In place but for a strip of columns a thread. The same bits for any number of threads.
///
/// A transform that is asked to stop ends within a few rows or columns on each thread; the samples are then of no use, and
/// the caller's next [`Progress::check`] fails.
#[derive(Clone)]
pub struct Fft2<T: FftNum> {
    width: usize,
    height: usize,
    row: Fft1<T>,
    column: Fft1<T>,
}

impl<T: FftNum> std::fmt::Debug for Fft2<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Fft2 {}×{}", self.width, self.height)
    }
}

impl<T: FftNum> Fft2<T> {
    /// Plans transforms of `width × height` samples.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, row: Fft1::new(width), column: Fft1::new(height) }
    }

    /// Σ u·exp(−i2π(…)), in place.
    pub fn forward(&self, samples: &mut [Complex<T>], progress: &Progress) {
        self.rows(samples, Fft1::forward, self.height, progress);
        let all = [self.height; 2];
        self.columns(samples, all, progress, |plan, _, strip, scratch| plan.column.forward(strip, scratch));
    }

    /// (1/N) Σ u·exp(+i2π(…)), in place.
    pub fn inverse(&self, samples: &mut [Complex<T>], progress: &Progress) {
        self.rows(samples, Fft1::inverse, self.height, progress);
        let scale = self.scale();
        self.columns(samples, [self.height; 2], progress, |plan, _, strip, scratch| {
            plan.column.inverse(strip, scratch);
            for u in strip {
                *u = u.scale(scale);
            }
        });
    }

    /// Inverse transform of (transfer × transform of the samples), in place: one column pass instead of two.
    ///
    /// `transfer(kx, column)` multiplies the transform column `kx` (`height` samples, indexed by ky) in place. Rows
    /// from `filled_rows` on are taken for zero, whatever they hold; rows from `wanted_rows` on are left unspecified.
    pub fn filter(
        &self,
        samples: &mut [Complex<T>],
        filled_rows: usize,
        wanted_rows: usize,
        transfer: impl Fn(usize, &mut [Complex<T>]) + Sync,
        progress: &Progress,
    ) {
        self.rows(samples, Fft1::forward, filled_rows, progress);
        let scale = self.scale();
        self.columns(samples, [filled_rows, wanted_rows], progress, |plan, first, strip, scratch| {
            plan.column.forward(strip, scratch);
            if progress.stopped() {
                return;
            }
            for (i, column) in strip.chunks_exact_mut(plan.height).enumerate() {
                transfer(first + i, column);
                for u in column {
                    *u = u.scale(scale);
                }
            }
            plan.column.inverse(strip, scratch);
        });
        self.rows(samples, Fft1::inverse, wanted_rows, progress);
    }

    fn scale(&self) -> T {
        let count = T::from_usize(self.width * self.height).unwrap_or_else(T::one);
        T::one() / count
    }

    fn rows(
        &self,
        samples: &mut [Complex<T>],
        transform: impl Fn(&Fft1<T>, &mut [Complex<T>], &mut [Complex<T>]) + Sync,
        rows: usize,
        progress: &Progress,
    ) {
        assert_eq!(samples.len(), self.width * self.height, "samples fit the planned size");
        let rows = &mut samples[..rows * self.width];
        // A task of several rows amortises its scratch; the split does not change any row's result.
        rows.par_chunks_mut(self.width * ROWS).for_each_init(
            || self.row.scratch(),
            |scratch, rows| {
                if !progress.stopped() {
                    transform(&self.row, rows, scratch);
                }
            },
        );
    }

    /// Runs `work(plan, first column, strip, scratch)` on copies of strips of columns, one column after the other, and puts them
    /// back. Rows from `filled` on are taken for zero and not read, those from `wanted` on are not written.
    fn columns(
        &self,
        samples: &mut [Complex<T>],
        [filled, wanted]: [usize; 2],
        progress: &Progress,
        work: impl Fn(&Self, usize, &mut [Complex<T>], &mut [Complex<T>]) + Sync,
    ) {
        let height = self.height;
        if progress.stopped() {
            return;
        }
        let rows = filled.max(wanted);
        let mut strips: Vec<Vec<&mut [Complex<T>]>> = Vec::new();
        strips.resize_with(self.width.div_ceil(strip_width::<T>()), || Vec::with_capacity(rows));
        for row in samples.chunks_mut(self.width).take(rows) {
            strips.iter_mut().zip(row.chunks_mut(strip_width::<T>())).for_each(|(strip, piece)| strip.push(piece));
        }
        strips.into_par_iter().enumerate().for_each_init(
            || (Fft1::dark(height * strip_width::<T>()), self.column.scratch()),
            |(columns, scratch), (number, mut strip)| {
                if progress.stopped() {
                    return;
                }
                let columns = &mut columns[..strip.first().map_or(0, |piece| piece.len()) * height];
                gather(&strip[..filled], columns, height);
                work(self, number * strip_width::<T>(), columns, scratch);
                scatter(columns, &mut strip[..wanted], height);
            },
        );
    }
}

/// Rows that are turned together: eight complex f32 are a cache line of a column.
const TURNED: usize = 8;

/// Writes pieces of rows as the beginnings of columns of `height` samples, the rest zero.
fn gather<T: FftNum>(rows: &[&mut [Complex<T>]], columns: &mut [Complex<T>], height: usize) {
    let count = columns.len() / height;
    for column in columns.chunks_exact_mut(height) {
        column[rows.len()..].fill(Complex::new(T::zero(), T::zero()));
    }
    let (blocks, rest) = rows.as_chunks::<TURNED>();
    for (block, rows) in blocks.iter().enumerate() {
        let rows = rows.each_ref().map(|row| &row[..count]);
        for i in 0..count {
            let column = &mut columns[i * height + block * TURNED..][..TURNED];
            column.iter_mut().zip(&rows).for_each(|(u, row)| *u = row[i]);
        }
    }
    for (row, line) in (rows.len() - rest.len()..).zip(rest) {
        line.iter().enumerate().for_each(|(i, &u)| columns[i * height + row] = u);
    }
}

/// Writes the beginnings of columns of `height` samples back into the rows.
fn scatter<T: FftNum>(columns: &[Complex<T>], rows: &mut [&mut [Complex<T>]], height: usize) {
    let (count, all) = (columns.len() / height, rows.len());
    let (blocks, rest) = rows.as_chunks_mut::<TURNED>();
    for (block, rows) in blocks.iter_mut().enumerate() {
        let mut rows = rows.each_mut().map(|row| &mut row[..count]);
        for i in 0..count {
            let column = &columns[i * height + block * TURNED..][..TURNED];
            rows.iter_mut().zip(column).for_each(|(row, &u)| row[i] = u);
        }
    }
    for (row, line) in (all - rest.len()..).zip(rest) {
        line.iter_mut().enumerate().for_each(|(i, u)| *u = columns[i * height + row]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{Complex32, Complex64, relative_error};
    use crate::random::Random;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn noise(n: usize) -> Vec<Complex64> {
        let mut random = Random::new(3, 0);
        (0..n).map(|_| Complex64::new(random.uniform() - 0.5, random.uniform() - 0.5)).collect()
    }

    /// The definition, term by term.
    fn naive(u: &[Complex64], width: usize, height: usize) -> Vec<Complex64> {
        let turn = |k: usize, n: usize, size: usize| -std::f64::consts::TAU * ((k * n) % size) as f64 / size as f64;
        (0..width * height)
            .map(|k| {
                let (kx, ky) = (k % width, k / width);
                (0..width * height)
                    .map(|n| u[n] * Complex64::cis(turn(kx, n % width, width) + turn(ky, n / width, height)))
                    .sum()
            })
            .collect()
    }

    #[test]
    fn fast_lengths_have_no_other_primes() {
        assert_eq!([7, 11, 13, 97, 2160].map(|n| fast_length(n, 1, &[1])), [8, 12, 15, 100, 2160]);
        assert_eq!([7, 11, 13].map(|n| fast_length(n, 1, &[1, 7, 11])), [7, 11, 14]);
        assert_eq!([0, 16, 17, 97].map(|n| fast_length(n, 16, &[1])), [16, 16, 32, 128]);
        assert_eq!(fast_length(97, 16, &[1, 7]), 112);
    }

    #[test]
    fn forward_equals_the_definition_on_odd_and_non_square_sizes() {
        for (width, height) in [(1, 1), (7, 5), (16, 33), (37, 18), (20, 1)] {
            let u = noise(width * height);
            let expected = naive(&u, width, height);
            let mut fast = u.clone();
            Fft2::new(width, height).forward(&mut fast, &Progress::new());
            assert!(relative_error(&fast, &expected) < 1e-13, "{width}×{height}");
            let mut single: Vec<Complex32> = u.iter().map(|u| Complex32::new(u.re as f32, u.im as f32)).collect();
            Fft2::new(width, height).forward(&mut single, &Progress::new());
            // f32 rounding: about 6e-8·√log₂N at these sizes.
            assert!(relative_error(&single, &expected) < 1e-6, "{width}×{height} in f32");
        }
    }

    #[test]
    fn inverse_undoes_forward_and_filter_is_both_at_once() {
        for (width, height) in [(18, 25), (40, 7)] {
            let u = noise(width * height);
            let plan = Fft2::new(width, height);
            let mut there = u.clone();
            let progress = Progress::new();
            plan.forward(&mut there, &progress);
            for (k, u) in there.iter_mut().enumerate() {
                *u *= Complex64::cis(0.1 * (k % width) as f64 - 0.3 * (k / width) as f64);
            }
            plan.inverse(&mut there, &progress);
            let mut filtered = u.clone();
            let turn = |kx: usize, column: &mut [Complex64]| {
                for (ky, u) in column.iter_mut().enumerate() {
                    *u *= Complex64::cis(0.1 * kx as f64 - 0.3 * ky as f64);
                }
            };
            plan.filter(&mut filtered, height, height, turn, &progress);
            assert!(relative_error(&filtered, &there) < 1e-13);
            let mut back = u.clone();
            plan.forward(&mut back, &progress);
            plan.inverse(&mut back, &progress);
            assert!(relative_error(&back, &u) < 1e-13);
        }
    }

    #[test]
    fn filter_takes_rows_for_dark_and_leaves_others_alone() {
        // More than one strip of columns, and heights that blocks of rows do not divide.
        for (width, height, filled, wanted) in [(37, 29, 11, 29), (37, 29, 29, 5), (16, 30, 9, 17), (5, 8, 0, 8)] {
            let plan = Fft2::new(width, height);
            let progress = Progress::new();
            let turn = |kx: usize, column: &mut [Complex64]| {
                column.iter_mut().enumerate().for_each(|(ky, u)| *u *= Complex64::cis(0.2 * (kx + ky * ky) as f64));
            };
            let mut dark = noise(width * height);
            dark[filled * width..].fill(Complex64::default());
            let mut garbage = dark.clone();
            garbage[filled * width..].fill(Complex64::new(f64::NAN, 1.0));
            plan.filter(&mut dark, height, height, turn, &progress);
            plan.filter(&mut garbage, filled, wanted, turn, &progress);
            assert_eq!(garbage[..wanted * width], dark[..wanted * width], "{width}×{height}, {filled}, {wanted}");
        }
    }

    #[test]
    fn a_transform_that_is_asked_to_stop_begins_no_more_strips() {
        let (width, height) = (320, 4096);
        let plan = Fft2::new(width, height);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("pool");
        let (progress, columns) = (Progress::new(), AtomicUsize::new(0));
        let mut u = noise(width * height);
        // Asked in the third column: each of three threads may end the strip that it has begun.
        let count = |_: usize, _: &mut [Complex64]| {
            if columns.fetch_add(1, Ordering::Relaxed) == 2 {
                progress.stop();
            }
        };
        pool.install(|| plan.filter(&mut u, height, height, count, &progress));
        let columns = columns.into_inner();
        assert!((3..=3 * strip_width::<f64>()).contains(&columns), "{columns} columns of {width}");
        // Asked before: nothing is done.
        let before = u.clone();
        plan.forward(&mut u, &progress);
        plan.inverse(&mut u, &progress);
        plan.filter(&mut u, height, height, |_, _| panic!("a column after the stop"), &progress);
        assert_eq!(u, before);
    }
}
