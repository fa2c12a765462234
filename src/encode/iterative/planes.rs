//! The panel's field on several depth planes at once, and the adjoint way back: what every iteration repeats.
//!
//! One transform of the panel's field serves all planes; each costs one inverse transform, and one more on the way back.
//! With K planes an iteration takes K + 1 pairs of transforms.

use crate::error::{Error, Result};
use crate::field::{Complex32, Fft2, Grid};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

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
    /// Transfer functions for frequencies of both signs: (width/2 + 1) × (height/2 + 1) each.
    transfers: Vec<Vec<Complex32>>,
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
                transfer.par_chunks_mut(columns).enumerate().for_each(|(ky, row)| {
                    let fy = ky as f64 / padded.extent_y();
                    for (kx, h) in row.iter_mut().enumerate() {
                        let fx = kx as f64 / padded.extent_x();
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
        let transform = Fft2::new(padded.width, padded.height);
        Ok(Self { grid, width: padded.width, height: padded.height, transform, transfers })
    }

    /// Number of planes.
    pub(super) fn count(&self) -> usize {
        self.transfers.len()
    }

    /// Spectrum of a field on the panel.
    pub(super) fn spectrum(&self, field: &[Complex32]) -> Vec<Complex32> {
        let mut samples = self.padded(field);
        self.transform.forward(&mut samples);
        samples
    }

    /// The field on plane `k`, from the panel's spectrum.
    pub(super) fn field(&self, k: usize, spectrum: &[Complex32]) -> Vec<Complex32> {
        let mut samples = spectrum.to_vec();
        self.transfer(k, &mut samples, |u, h| *u *= h);
        self.transform.inverse(&mut samples);
        self.cropped(samples)
    }

    /// Adds the adjoint of plane `k` on a field there to a spectrum of the panel.
    pub(super) fn adjoint(&self, k: usize, field: &[Complex32], spectrum: &mut [Complex32]) {
        let mut samples = self.padded(field);
        self.transform.forward(&mut samples);
        self.transfer(k, &mut samples, |u, h| *u *= h.conj());
        spectrum.par_iter_mut().zip(&samples).for_each(|(sum, u)| *sum += u);
    }

    /// The panel's field of a spectrum.
    pub(super) fn panel(&self, mut spectrum: Vec<Complex32>) -> Vec<Complex32> {
        self.transform.inverse(&mut spectrum);
        self.cropped(spectrum)
    }

    /// A dark spectrum.
    pub(super) fn zero(&self) -> Vec<Complex32> {
        vec![Complex32::new(0.0, 0.0); self.width * self.height]
    }

    fn transfer(&self, k: usize, samples: &mut [Complex32], apply: impl Fn(&mut Complex32, Complex32) + Sync) {
        let (width, height) = (self.width, self.height);
        let columns = width / 2 + 1;
        let transfer = &self.transfers[k];
        samples.par_chunks_mut(width).enumerate().for_each(|(ky, row)| {
            let from = &transfer[ky.min(height - ky) * columns..][..columns];
            for (kx, u) in row.iter_mut().enumerate() {
                apply(u, from[kx.min(width - kx)]);
            }
        });
    }

    fn padded(&self, field: &[Complex32]) -> Vec<Complex32> {
        if self.width == self.grid.width {
            return field.to_vec();
        }
        let mut samples = self.zero();
        for (row, source) in samples.chunks_mut(self.width).zip(field.chunks(self.grid.width)) {
            row[..source.len()].copy_from_slice(source);
        }
        samples
    }

    fn cropped(&self, samples: Vec<Complex32>) -> Vec<Complex32> {
        if self.width == self.grid.width {
            return samples;
        }
        samples.chunks(self.width).take(self.grid.height).flat_map(|row| &row[..self.grid.width]).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::{Complex64, Field, relative_error};
    use crate::progress::Progress;
    use crate::random::Random;

    fn noise(grid: Grid, seed: u64) -> Vec<Complex32> {
        let mut random = Random::new(seed, 0);
        (0..grid.len()).map(|_| Complex32::new(random.uniform_f32() - 0.5, random.uniform_f32() - 0.5)).collect()
    }

    #[test]
    fn planes_are_those_of_the_propagation_room_and_the_adjoint_is_one() {
        let grid = Grid::new(45, 32, 8e-6, 6e-6).expect("grid");
        let depths = [0.003, -0.002, 0.0];
        let planes = Planes::new(grid, 532e-9, &depths, None, Padding::Dark).expect("planes");
        let panel = noise(grid, 1);
        let spectrum = planes.spectrum(&panel);
        for (k, &z) in depths.iter().enumerate() {
            let field = Field::new(grid, 532e-9, panel.clone()).expect("field");
            let expected = crate::propagation::propagate(&field, z, &Progress::new()).expect("propagate");
            let seen = planes.field(k, &spectrum);
            assert!(relative_error(&seen, &expected.samples) < 1e-5, "z = {z}");
            // ⟨A u, v⟩ = ⟨u, A* v⟩.
            let other = noise(grid, 2 + k as u64);
            let mut back = planes.zero();
            planes.adjoint(k, &other, &mut back);
            let back = planes.panel(back);
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
        assert!(Planes::new(grid, 532e-9, &[], None, Padding::Dark).is_err());
        assert!(Planes::new(grid, 532e-9, &[f64::NAN], None, Padding::Dark).is_err());
    }
}
