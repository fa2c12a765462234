//! Dense complex matrices in double precision: the judge's integrals are products of them.

use crate::error::Result;
use crate::field::Complex64;
use crate::progress::Progress;
use rayon::prelude::*;

/// Rows of one task: each block of the other matrix is read that many times.
const ROWS: usize = 32;
/// Columns of one task: two rows of it with their accumulators stay in the first cache.
const COLUMNS: usize = 64;
/// Terms of the sum that are taken before the next rows: 64 × 64 complex numbers stay in the second cache.
const DEPTH: usize = 64;

/// A matrix, row-major, real and imaginary parts apart.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Matrix {
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) re: Vec<f64>,
    pub(super) im: Vec<f64>,
}

impl Matrix {
    /// The matrix of these elements (row, column).
    pub(super) fn new(rows: usize, columns: usize, element: impl Fn(usize, usize) -> Complex64 + Sync) -> Self {
        let (mut re, mut im) = (vec![0.0; rows * columns], vec![0.0; rows * columns]);
        let lines = re.par_chunks_mut(columns.max(1)).zip(im.par_chunks_mut(columns.max(1)));
        lines.enumerate().for_each(|(row, (re, im))| {
            for (column, (re, im)) in re.iter_mut().zip(im).enumerate() {
                let value = element(row, column);
                (*re, *im) = (value.re, value.im);
            }
        });
        Self { rows, columns, re, im }
    }

    /// One element.
    pub(super) fn at(&self, row: usize, column: usize) -> Complex64 {
        let i = row * self.columns + column;
        Complex64::new(self.re[i], self.im[i])
    }

    /// A·B; every element's terms are added in one order, whatever the number of threads.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    ///
    /// # Panics
    /// When A has not as many columns as B rows.
    pub(super) fn times(&self, b: &Self, progress: &Progress) -> Result<Self> {
        assert_eq!(self.columns, b.rows, "matrices that fit");
        let across = b.columns.div_ceil(COLUMNS);
        let blocks: Vec<Block> = (0..self.rows.div_ceil(ROWS) * across)
            .into_par_iter()
            .map(|task| {
                let (row, column) = (task / across * ROWS, task % across * COLUMNS);
                let size = (ROWS.min(self.rows - row), COLUMNS.min(b.columns - column));
                let mut block =
                    Block { row, column, size, re: vec![[0.0; COLUMNS]; size.0], im: vec![[0.0; COLUMNS]; size.0] };
                block.fill(self, b, progress);
                block
            })
            .collect();
        progress.check()?;
        let mut out = Self {
            rows: self.rows,
            columns: b.columns,
            re: vec![0.0; self.rows * b.columns],
            im: vec![0.0; self.rows * b.columns],
        };
        for block in blocks {
            for line in 0..block.size.0 {
                let at = (block.row + line) * b.columns + block.column;
                out.re[at..at + block.size.1].copy_from_slice(&block.re[line][..block.size.1]);
                out.im[at..at + block.size.1].copy_from_slice(&block.im[line][..block.size.1]);
            }
        }
        Ok(out)
    }

    /// A·B·C, in the order that takes the fewer multiplications.
    ///
    /// # Errors
    /// As [`Matrix::times`].
    pub(super) fn between(&self, a: &Self, c: &Self, progress: &Progress) -> Result<Self> {
        let left_first = a.rows * self.columns * (self.rows + c.columns);
        let right_first = c.columns * self.rows * (self.columns + a.rows);
        if left_first <= right_first {
            a.times(self, progress)?.times(c, progress)
        } else {
            a.times(&self.times(c, progress)?, progress)
        }
    }
}

/// A part of a product.
struct Block {
    row: usize,
    column: usize,
    size: (usize, usize),
    re: Vec<[f64; COLUMNS]>,
    im: Vec<[f64; COLUMNS]>,
}

impl Block {
    fn fill(&mut self, a: &Matrix, b: &Matrix, progress: &Progress) {
        let width = self.size.1;
        // Columns beyond the matrix are zeros: loops of constant length are fast.
        let (mut b_re, mut b_im) = (vec![[0.0; COLUMNS]; DEPTH], vec![[0.0; COLUMNS]; DEPTH]);
        for first in (0..a.columns).step_by(DEPTH) {
            if progress.stopped() {
                return;
            }
            let depth = DEPTH.min(a.columns - first);
            for k in 0..depth {
                let at = (first + k) * b.columns + self.column;
                b_re[k][..width].copy_from_slice(&b.re[at..at + width]);
                b_im[k][..width].copy_from_slice(&b.im[at..at + width]);
            }
            // Two terms at once: sums go to the cache and back half as often. Terms beyond the matrix are zeros.
            for k in depth..depth.next_multiple_of(2) {
                (b_re[k], b_im[k]) = ([0.0; COLUMNS], [0.0; COLUMNS]);
            }
            for line in 0..self.size.0 {
                let at = (self.row + line) * a.columns + first;
                let (mut x, mut y) = ([0.0; DEPTH], [0.0; DEPTH]);
                x[..depth].copy_from_slice(&a.re[at..at + depth]);
                y[..depth].copy_from_slice(&a.im[at..at + depth]);
                let (re, im) = (&mut self.re[line], &mut self.im[line]);
                for k in (0..depth).step_by(2) {
                    let (x0, y0, x1, y1) = (x[k], y[k], x[k + 1], y[k + 1]);
                    let (p0, q0, p1, q1) = (&b_re[k], &b_im[k], &b_re[k + 1], &b_im[k + 1]);
                    for i in 0..COLUMNS {
                        re[i] += (x0 * p0[i] - y0 * q0[i]) + (x1 * p1[i] - y1 * q1[i]);
                        im[i] += (x0 * q0[i] + y0 * p0[i]) + (x1 * q1[i] + y1 * p1[i]);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    fn random(rows: usize, columns: usize, seed: u64) -> Matrix {
        let number = |row: usize, column: usize| {
            let mut random = Random::new(seed, (row * 1000 + column) as u64);
            Complex64::new(random.uniform() - 0.5, random.uniform() - 0.5)
        };
        Matrix::new(rows, columns, number)
    }

    #[test]
    fn a_product_is_the_sum_of_its_terms_at_any_size() {
        for (rows, inner, columns) in [(1, 1, 1), (3, 70, 5), (37, 129, 65), (64, 64, 64), (5, 3, 200)] {
            let (a, b) = (random(rows, inner, 1), random(inner, columns, 2));
            let product = a.times(&b, &Progress::new()).expect("product");
            for row in 0..rows {
                for column in 0..columns {
                    let wanted: Complex64 = (0..inner).map(|k| a.at(row, k) * b.at(k, column)).sum();
                    assert!((product.at(row, column) - wanted).norm() < 1e-12, "{rows} {inner} {columns}");
                }
            }
        }
    }

    #[test]
    fn both_orders_of_a_double_product_agree_and_it_can_be_stopped() {
        let middle = random(40, 90, 3);
        let (few, many) = (random(7, 40, 4), random(90, 150, 5));
        let (left, right) = (random(150, 40, 6), random(90, 7, 7));
        for (a, c) in [(few, many), (left, right)] {
            let both = middle.between(&a, &c, &Progress::new()).expect("product");
            let first =
                a.times(&middle, &Progress::new()).expect("product").times(&c, &Progress::new()).expect("product");
            let error = both.re.iter().zip(&first.re).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 1e-12, "{error}");
            let stopped = Progress::new();
            stopped.stop();
            assert!(middle.between(&a, &c, &stopped).is_err());
        }
    }
}
