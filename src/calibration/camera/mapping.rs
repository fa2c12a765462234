//! Where a camera's pixels stand in the Fourier plane: a homography and a radial distortion.
//!
//! With q the pixel's place from the sensor's middle in halves of its width, q' = q·(1 + k·|q|²) and
//! ν = ((h₀q'ₓ + h₁q'ᵧ + h₂) / d, (h₃q'ₓ + h₄q'ᵧ + h₅) / d), d = 1 + h₆q'ₓ + h₇q'ᵧ: a flat sensor, however turned, mirrored or
//! tilted, behind a lens whose distortion is centred on it.

use super::solve::solve;
use crate::error::{Error, Result};
use serde::Serialize;

/// Numbers of a mapping.
pub const MAPPING: usize = 9;

/// Camera pixels → Fourier plane.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Mapping {
    /// Columns and rows of the sensor.
    pub size: [usize; 2],
    /// h₀ … h₇ [cycles/pixel of the panel, along its columns and rows from the upper left], and k.
    pub values: [f64; MAPPING],
}

impl Mapping {
    /// A sensor square to the axis: `scale` cycles a pixel of the panel for each pixel of the camera.
    pub fn square(size: [usize; 2], scale: f64) -> Self {
        let half = 0.5 * size[0] as f64;
        Self { size, values: [scale * half, 0.0, 0.0, 0.0, scale * half, 0.0, 0.0, 0.0, 0.0] }
    }

    fn place(&self, pixel: [f64; 2]) -> [f64; 2] {
        let half = 0.5 * self.size[0] as f64;
        [0, 1].map(|axis| (pixel[axis] + 0.5 - 0.5 * self.size[axis] as f64) / half)
    }

    /// Frequency ν [cycles/pixel] that a place on the sensor sees; pixel (column, row) has its middle at whole numbers.
    pub fn frequency(&self, pixel: [f64; 2]) -> [f64; 2] {
        let h = &self.values;
        let q = self.place(pixel);
        let radial = 1.0 + h[8] * (q[0] * q[0] + q[1] * q[1]);
        let [x, y] = q.map(|q| q * radial);
        let d = 1.0 + h[6] * x + h[7] * y;
        [(h[0] * x + h[1] * y + h[2]) / d, (h[3] * x + h[4] * y + h[5]) / d]
    }

    /// The same with its derivatives after the numbers.
    pub(super) fn with_slopes(&self, pixel: [f64; 2]) -> ([f64; 2], [[f64; MAPPING]; 2]) {
        let h = &self.values;
        let q = self.place(pixel);
        let square = q[0] * q[0] + q[1] * q[1];
        let [x, y] = q.map(|q| q * (1.0 + h[8] * square));
        let d = 1.0 + h[6] * x + h[7] * y;
        let nu = [(h[0] * x + h[1] * y + h[2]) / d, (h[3] * x + h[4] * y + h[5]) / d];
        let mut out = [[0.0; MAPPING]; 2];
        for axis in 0..2 {
            let first = 3 * axis;
            (out[axis][first], out[axis][first + 1], out[axis][first + 2]) = (x / d, y / d, 1.0 / d);
            (out[axis][6], out[axis][7]) = (-nu[axis] * x / d, -nu[axis] * y / d);
            let along = [(h[first] - nu[axis] * h[6]) / d, (h[first + 1] - nu[axis] * h[7]) / d];
            out[axis][8] = (along[0] * q[0] + along[1] * q[1]) * square;
        }
        (nu, out)
    }

    /// ∂ν/∂(column, row).
    pub(super) fn jacobian(&self, pixel: [f64; 2]) -> [[f64; 2]; 2] {
        let at = |dx: f64, dy: f64| self.frequency([pixel[0] + dx, pixel[1] + dy]);
        let (l, r, u, d) = (at(-0.5, 0.0), at(0.5, 0.0), at(0.0, -0.5), at(0.0, 0.5));
        [[r[0] - l[0], d[0] - u[0]], [r[1] - l[1], d[1] - u[1]]]
    }

    /// The place on the sensor that sees a frequency, by Newton's method; `None` where it does not come to rest.
    pub fn pixel(&self, frequency: [f64; 2]) -> Option<[f64; 2]> {
        let mut pixel = self.size.map(|s| 0.5 * s as f64 - 0.5);
        for _ in 0..30 {
            let nu = self.frequency(pixel);
            let j = self.jacobian(pixel);
            let miss = [frequency[0] - nu[0], frequency[1] - nu[1]];
            let det = j[0][0] * j[1][1] - j[0][1] * j[1][0];
            let step = [(j[1][1] * miss[0] - j[0][1] * miss[1]) / det, (j[0][0] * miss[1] - j[1][0] * miss[0]) / det];
            if !step.iter().all(|s| s.is_finite()) {
                return None;
            }
            pixel = [pixel[0] + step[0], pixel[1] + step[1]];
            if step[0].hypot(step[1]) < 1e-6 {
                return Some(pixel);
            }
        }
        None
    }

    /// The mapping that takes pixels to their frequencies with the least sum of squares, from this one on. With fewer than
    /// eight pairs only the affine part moves.
    ///
    /// # Errors
    /// [`Error::Parameter`] for fewer than three pairs, or pairs on a line.
    pub fn fitted(&self, pairs: &[([f64; 2], [f64; 2])]) -> Result<Self> {
        let free: &[usize] = if pairs.len() >= 8 { &[0, 1, 2, 3, 4, 5, 6, 7, 8] } else { &[0, 1, 2, 3, 4, 5] };
        if pairs.len() < 3 {
            return Err(Error::parameter("dots", format!("{} found; a mapping needs three or more", pairs.len())));
        }
        let mut out = self.clone();
        let n = free.len();
        for _ in 0..20 {
            let (mut normal, mut right) = (vec![0.0; n * n], vec![0.0; n]);
            for (pixel, wanted) in pairs {
                let (nu, slopes) = out.with_slopes(*pixel);
                for axis in 0..2 {
                    let miss = wanted[axis] - nu[axis];
                    for (a, &i) in free.iter().enumerate() {
                        right[a] += slopes[axis][i] * miss;
                        for (b, &j) in free.iter().enumerate() {
                            normal[a * n + b] += slopes[axis][i] * slopes[axis][j];
                        }
                    }
                }
            }
            for a in 0..n {
                normal[a * n + a] *= 1.0 + 1e-9;
            }
            let step = solve(&normal, &right)
                .ok_or_else(|| Error::parameter("dots", "they stand on a line; a mapping needs them spread"))?;
            free.iter().zip(&step).for_each(|(&i, s)| out.values[i] += s);
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mapping_is_found_from_pairs_and_turned_round() {
        let mut truth = Mapping::square([640, 480], 2e-4);
        truth.values = [0.06, 0.004, 0.002, -0.005, 0.058, -0.003, 0.03, -0.02, 0.015];
        let pairs: Vec<_> = (0..40)
            .map(|i| {
                let pixel = [f64::from(i % 8) * 80.0 + 20.0, f64::from(i / 8) * 90.0 + 30.0];
                (pixel, truth.frequency(pixel))
            })
            .collect();
        let found = Mapping::square([640, 480], 2e-4).fitted(&pairs).expect("fit");
        for (a, b) in found.values.iter().zip(&truth.values) {
            assert!((a - b).abs() < 1e-8, "{a} {b}");
        }
        let pixel = truth.pixel([0.031, -0.02]).expect("inside");
        let nu = truth.frequency(pixel);
        assert!((nu[0] - 0.031).hypot(nu[1] + 0.02) < 1e-9);
        // Derivatives against differences.
        let at = [500.0, 100.0];
        let (_, slopes) = truth.with_slopes(at);
        for (axis, slopes) in slopes.iter().enumerate() {
            for (i, slope) in slopes.iter().enumerate() {
                let moved = |d: f64| {
                    let mut m = truth.clone();
                    m.values[i] += d;
                    m.frequency(at)[axis]
                };
                assert!(((moved(1e-6) - moved(-1e-6)) / 2e-6 - slope).abs() < 1e-6, "{i} {axis}");
            }
        }
        assert!(truth.fitted(&pairs[..2]).is_err());
    }
}
