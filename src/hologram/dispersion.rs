//! The phase of the exact angular spectrum, in f32 at any distance: what is large is reduced in f64, by row and by column.
//!
//! With a = λ²f_x², b = λ²f_y² and ρ = d/λ,
//!
//! ```text
//! f_z·d = ρ·√(1 − a − b) = ρ·√(1 − a) + ρ·(√(1 − b) − 1) + ρ·C
//! C = √(1 − a − b) − √(1 − a) − √(1 − b) + 1
//!   = −ab·(1/(√(1−a−b) + √(1−b)) + 1/(1 + √(1−a))) / ((1 + √(1−b))·(√(1−a−b) + √(1−a)))
//! ```
//!
//! The first two terms are reduced modulo one turn in f64. C, so written, has no cancellation and is right to a few units
//! in the last place of f32: the phase errs by 3e-7·ρ|C| turns, |C| ≈ ab/4.

use super::lanes::{Aligned, Lanes};
use crate::field::Grid;

/// What all distances share on one grid of frequencies.
#[derive(Clone, Debug)]
pub(in crate::hologram) struct Dispersion {
    /// a = λ²f_x² by column of the transform.
    pub(in crate::hologram) columns: Vec<f64>,
    /// b = λ²f_y² by row of the transform.
    pub(in crate::hologram) rows: Vec<f64>,
    /// b and √(1 − b) for the inner loops.
    pub(in crate::hologram) squares: Aligned,
    pub(in crate::hologram) roots: Aligned,
}

impl Dispersion {
    /// For transforms on a grid.
    pub(in crate::hologram) fn new(grid: &Grid, wavelength: f64) -> Self {
        let (mut squares, mut roots) = (aligned(grid.height), aligned(grid.height));
        let rows: Vec<f64> = (0..grid.height).map(|k| grid.sine_y(k, wavelength).powi(2)).collect();
        for (k, &b) in rows.iter().enumerate() {
            squares.values_mut()[k] = b as f32;
            roots.values_mut()[k] = (1.0 - b).max(0.0).sqrt() as f32;
        }
        let columns = (0..grid.width).map(|k| grid.sine_x(k, wavelength).powi(2)).collect();
        Self { columns, rows, squares, roots }
    }

    /// ρ·(√(1 − b) − 1) + `more(row)` modulo one, by row [turns].
    pub(in crate::hologram) fn by_row(&self, ratio: f64, more: impl Fn(usize) -> f64) -> Aligned {
        let mut rows = aligned(self.rows.len());
        for (k, (row, &b)) in rows.values_mut().iter_mut().zip(&self.rows).enumerate() {
            let b = b.min(1.0);
            *row = reduced(more(k) - ratio * b / (1.0 + (1.0 - b).sqrt()));
        }
        rows
    }

    /// ρ·√(1 − a) + `more` modulo one, of a column with a ≤ 1 [turns].
    pub(in crate::hologram) fn by_column(&self, ratio: f64, column: usize, more: f64) -> f32 {
        reduced(more + ratio * (1.0 - self.columns[column]).sqrt())
    }
}

/// Turns less the nearest whole ones.
pub(in crate::hologram) fn reduced(turns: f64) -> f32 {
    (turns - turns.round()) as f32
}

/// Memory for `count` values at least, of unspecified contents.
pub(in crate::hologram) fn aligned(count: usize) -> Aligned {
    let mut values = Aligned::default();
    values.reserve(count);
    values
}

/// What the residual takes from its column.
#[derive(Clone, Copy)]
pub(in crate::hologram) struct Column<L> {
    a: L,
    /// √(1 − a).
    pub(in crate::hologram) root: L,
    outer: L,
}

impl<L: Lanes> Column<L> {
    /// # Safety
    /// The instruction set of `L` must be enabled.
    #[inline(always)]
    pub(in crate::hologram) unsafe fn new(a: f64) -> Self {
        // SAFETY: the caller's promise.
        unsafe {
            let one = L::splat(1.0);
            let root = L::splat((1.0 - a).sqrt() as f32);
            Self { a: L::splat(a as f32), root, outer: one.div(one.add(root)) }
        }
    }

    /// −C and √(1 − a − b) at b and √(1 − b); the sum a + b is taken as 0.99 where it is more.
    ///
    /// # Safety
    /// The instruction set of `L` must be enabled.
    #[inline(always)]
    pub(in crate::hologram) unsafe fn residual(self, b: L, root_b: L) -> (L, L) {
        // SAFETY: the caller's promise.
        unsafe {
            let one = L::splat(1.0);
            let root = one.sub(self.a).sub(b).max(L::splat(0.01)).sqrt();
            let sum = one.div(root.add(root_b)).add(self.outer);
            (self.a.mul(b).mul(sum).div(one.add(root_b).mul(root.add(self.root))), root)
        }
    }
}
