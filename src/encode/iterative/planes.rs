//! The panel's field on several depth planes, and the adjoint way back: what every iteration repeats.
//!
//! Each way is one filter: transform, multiply, transform back, with the columns' three steps in one pass and without
//! the rows that are dark or not wanted. There and back for K planes is 2K filters, which cost less than 2K pairs of
//! whole transforms.

use crate::error::{Error, Result};
use crate::field::{Complex32, Fft2, Grid, zeroed};
use crate::progress::Progress;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::sync::Mutex;

/// How the borders of the panel are treated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Padding {
    /// Dark round the panel: transforms of twice the size, no wrapping round.
    #[default]
    Dark,
    /// The panel repeats itself without end: a quarter of the work, and light that leaves at one border comes in at the
    /// other.
    Periodic,
}

/// Planned propagation from one grid to equal grids at several depths.
pub(super) struct Planes {
    grid: Grid,
    /// Size of the transforms.
    width: usize,
    height: usize,
    transform: Fft2<f32>,
    /// Transfer functions for frequencies of both signs, column by column: (width/2 + 1) columns of height/2 + 1.
    transfers: Vec<Vec<Complex32>>,
    /// Memory of transforms, kept from step to step: new pages cost more than the arithmetic.
    kept: Mutex<Vec<Vec<Complex32>>>,
}

impl Planes {
    /// Plans for depths z [m]. `half` limits the field to |f_x| and |f_y| below it [cycles/m].
    ///
    /// Transfer functions are those of the angular spectrum with the limits of Matsushima & Shimobaba (2009).
    pub(super) fn new(
        grid: Grid,
        wavelength: f64,
        depths: &[f64],
        half: Option<[f64; 2]>,
        padding: Padding,
        progress: &Progress,
    ) -> Result<Self> {
        if depths.is_empty() || depths.iter().any(|z| !z.is_finite()) {
            return Err(Error::parameter("planes", format!("{depths:?} must be one or more finite depths")));
        }
        let factor = if padding == Padding::Dark { 2 } else { 1 };
        let padded = Grid { width: grid.width * factor, height: grid.height * factor, ..grid };
        let (columns, rows) = (padded.width / 2 + 1, padded.height / 2 + 1);
        let transfers = depths
            .iter()
            .map(|&z| {
                let band = |extent: f64| extent * 0.5 / (wavelength * (0.5 * extent).hypot(z));
                let limits = [band(padded.extent_x()), band(padded.extent_y())];
                let limit = |axis: usize| half.map_or(limits[axis], |h| h[axis].min(limits[axis]));
                let (limit_x, limit_y) = (limit(0), limit(1));
                let mut transfer = vec![Complex32::new(0.0, 0.0); columns * rows];
                transfer.par_chunks_mut(rows).enumerate().for_each(|(kx, column)| {
                    if progress.stopped() {
                        return;
                    }
                    let fx = kx as f64 / padded.extent_x();
                    for (ky, h) in column.iter_mut().enumerate() {
                        let fy = ky as f64 / padded.extent_y();
                        let fz2 = wavelength.powi(-2) - fx * fx - fy * fy;
                        if fx <= limit_x && fy <= limit_y && fz2 > 0.0 {
                            let turns = z * fz2.sqrt();
                            let (sin, cos) = (TAU * (turns - turns.round())).sin_cos();
                            *h = Complex32::new(cos as f32, sin as f32);
                        }
                    }
                });
                transfer
            })
            .collect();
        progress.check()?;
        let transform = Fft2::new(padded.width, padded.height);
        Ok(Self { grid, width: padded.width, height: padded.height, transform, transfers, kept: Mutex::default() })
    }

    /// Number of planes.
    pub(super) fn count(&self) -> usize {
        self.transfers.len()
    }

    /// The field on plane `k` of a field on the panel.
    pub(super) fn field(&self, k: usize, panel: &[Complex32], progress: &Progress) -> Result<Vec<Complex32>> {
        self.through(k, panel, |u, h| *u *= h, progress)
    }

    /// The adjoint: what a field on plane `k` is on the panel.
    pub(super) fn adjoint(&self, k: usize, field: &[Complex32], progress: &Progress) -> Result<Vec<Complex32>> {
        self.through(k, field, |u, h| *u *= h.conj(), progress)
    }

    fn through(
        &self,
        k: usize,
        field: &[Complex32],
        apply: impl Fn(&mut Complex32, Complex32) + Sync,
        progress: &Progress,
    ) -> Result<Vec<Complex32>> {
        progress.check()?;
        let (width, height, rows) = (self.width, self.height, self.height / 2 + 1);
        let transfer = &self.transfers[k];
        let kept = self.kept.lock().ok().and_then(|mut kept| kept.pop());
        let mut samples = kept.unwrap_or_else(|| vec![Complex32::default(); width * height]);
        // Rows below the panel's count as dark, whatever is in them.
        samples.par_chunks_mut(width).zip(field.par_chunks(self.grid.width)).for_each(|(row, source)| {
            row[..source.len()].copy_from_slice(source);
            row[source.len()..].fill(Complex32::default());
        });
        let multiply = |kx: usize, column: &mut [Complex32]| {
            let from = &transfer[kx.min(width - kx) * rows..][..rows];
            let (lower, upper) = column.split_at_mut(rows);
            lower.iter_mut().zip(from).for_each(|(u, h)| apply(u, *h));
            // Negative frequencies: ky and height − ky have one transfer.
            let mirrored = from[1..].iter().rev().skip(usize::from(height.is_multiple_of(2)));
            upper.iter_mut().zip(mirrored).for_each(|(u, h)| apply(u, *h));
        };
        self.transform.filter(&mut samples, self.grid.height, self.grid.height, multiply, progress);
        progress.check()?;
        if width == self.grid.width {
            return Ok(samples);
        }
        let mut out = zeroed(self.grid.len());
        let rows = out.par_chunks_mut(self.grid.width).zip(samples.par_chunks(width));
        rows.for_each(|(out, row)| out.copy_from_slice(&row[..out.len()]));
        if let Ok(mut kept) = self.kept.lock() {
            kept.push(samples);
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{Complex64, Field, relative_error};
    use crate::random::Random;

    fn noise(grid: Grid, seed: u64) -> Vec<Complex32> {
        let mut random = Random::new(seed, 0);
        (0..grid.len()).map(|_| Complex32::new(random.uniform_f32() - 0.5, random.uniform_f32() - 0.5)).collect()
    }

    #[test]
    fn planes_are_those_of_the_propagation_room_and_the_adjoint_is_one() {
        let grid = Grid::new(45, 32, 8e-6, 6e-6).expect("grid");
        let depths = [0.003, -0.002, 0.0];
        let planes = Planes::new(grid, 532e-9, &depths, None, Padding::Dark, &Progress::new()).expect("planes");
        let panel = noise(grid, 1);
        for (k, &z) in depths.iter().enumerate() {
            let field = Field::new(grid, 532e-9, panel.clone()).expect("field");
            let expected = crate::propagation::propagate(&field, z, &Progress::new()).expect("propagate");
            let seen = planes.field(k, &panel, &Progress::new()).expect("field");
            assert!(relative_error(&seen, &expected.samples) < 1e-5, "z = {z}");
            // ⟨A u, v⟩ = ⟨u, A* v⟩.
            let other = noise(grid, 2 + k as u64);
            let back = planes.adjoint(k, &other, &Progress::new()).expect("adjoint");
            let product = |a: &[Complex32], b: &[Complex32]| -> Complex64 {
                a.iter()
                    .zip(b)
                    .map(|(a, b)| {
                        Complex64::new(a.re.into(), a.im.into()) * Complex64::new(b.re.into(), -f64::from(b.im))
                    })
                    .sum()
            };
            let (left, right) = (product(&seen, &other), product(&panel, &back));
            assert!((left - right).norm() < 1e-5 * left.norm().max(1.0), "{left} {right}");
        }
        assert!(Planes::new(grid, 532e-9, &[], None, Padding::Dark, &Progress::new()).is_err());
        assert!(Planes::new(grid, 532e-9, &[f64::NAN], None, Padding::Dark, &Progress::new()).is_err());
    }
}
