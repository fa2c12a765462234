//! A bench of panel, lens and camera in double precision that shares nothing with the model that is fitted to it: pixels cut
//! into parts, phases blended by a sampled Gaussian, sums of exponentials for the transform, a camera placed in space.

use holodrive::calibration::CameraPhoto;
use holodrive::field::Complex64;
use holodrive::random::Random;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// A panel with faults that its profile does not know, in a laser's beam, behind it a lens and a camera.
pub(crate) struct HiddenBench {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// [m]
    pub(crate) pitch: f64,
    /// [m]
    pub(crate) wavelength: f64,
    /// Focal length of the lens [m].
    pub(crate) lens: f64,
    /// Columns and rows of the camera.
    pub(crate) camera: [usize; 2],
    /// [m]
    pub(crate) camera_pitch: f64,
    /// Parts along each side of a pixel.
    pub(crate) parts: usize,
}

/// Crosstalk [pixels], share of the light that stays unmodulated and its phase against level 0 [rad], noise of the camera
/// against its full scale.
pub(crate) const CROSSTALK: f64 = 0.4;
pub(crate) const UNMODULATED: f64 = 0.08;
pub(crate) const UNMODULATED_PHASE: f64 = 0.7;
pub(crate) const NOISE: f64 = 0.01;

const ZERO: Complex64 = Complex64::new(0.0, 0.0);

impl HiddenBench {
    /// A place of the panel from −1 to 1 along both axes, rows downwards.
    pub(crate) fn place(&self, column: f64, row: f64) -> [f64; 2] {
        [(2.0 * column + 1.0) / self.width as f64 - 1.0, (2.0 * row + 1.0) / self.height as f64 - 1.0]
    }

    /// Phase of a level of 256 there [rad]: about 2.2π, an S that differs over the panel.
    pub(crate) fn curve(&self, level: u16, [x, y]: [f64; 2]) -> f64 {
        let l = f64::from(level) / 255.0;
        let range = 2.2 * PI * (1.0 + 0.05 * x - 0.04 * y + 0.02 * x * y - 0.015 * x * x);
        range * (l + (0.045 + 0.01 * x) * (TAU * l).sin() - 0.06 * l * (1.0 - l))
    }

    /// The wavefront error there [rad]: 1.5 waves from lowest to highest, defocus, astigmatism, coma and a dent.
    pub(crate) fn wavefront(&self, [x, y]: [f64; 2]) -> f64 {
        let dent = 0.05 * (-((x - 0.3).powi(2) + (y + 0.2).powi(2)) / 0.5).exp();
        let bend = 0.55 * x * x - 0.024 * y * y + 0.25 * x * y + 0.12 * x * (x * x + y * y - 1.2);
        1.61 * TAU * (bend + dent)
    }

    /// Amplitude of the laser's beam there: a Gaussian off the panel's middle.
    pub(crate) fn beam(&self, [x, y]: [f64; 2]) -> f64 {
        let aspect = self.height as f64 / self.width as f64;
        (-((x - 0.2).powi(2) + ((y + 0.25) * aspect).powi(2)) / 1.44).exp()
    }

    /// The light of the panel's parts for these levels.
    fn light(&self, levels: &[u16]) -> Vec<Complex64> {
        let n = self.parts;
        let (width, height) = (self.width * n, self.height * n);
        let sigma = CROSSTALK * n as f64;
        let reach = (5.0 * sigma).ceil() as isize;
        let weights: Vec<f64> = (-reach..=reach).map(|d| (-0.5 * (d as f64 / sigma).powi(2)).exp()).collect();
        let sum: f64 = weights.iter().sum();
        let phase = |part: usize, row: usize| {
            let (column, row) = (part / n, row / n);
            self.curve(levels[row * self.width + column], self.place(column as f64, row as f64))
        };
        let clamped = |at: isize, size: usize| at.clamp(0, size as isize - 1) as usize;
        let mut along = vec![0.0; width * height];
        along.par_chunks_mut(width).enumerate().for_each(|(j, out)| {
            let line: Vec<f64> = (0..width).map(|i| phase(i, j)).collect();
            for (i, out) in out.iter_mut().enumerate() {
                let terms = weights.iter().enumerate();
                *out = terms.map(|(t, w)| w * line[clamped(i as isize + t as isize - reach, width)]).sum::<f64>() / sum;
            }
        });
        let (kept, lost) = ((1.0 - UNMODULATED).sqrt(), Complex64::from_polar(UNMODULATED.sqrt(), UNMODULATED_PHASE));
        let mut out = vec![ZERO; width * height];
        out.par_chunks_mut(width).enumerate().for_each(|(j, out)| {
            for (i, out) in out.iter_mut().enumerate() {
                let terms = weights.iter().enumerate();
                let line = |t: usize| clamped(j as isize + t as isize - reach, height) * width + i;
                let phase = terms.map(|(t, w)| w * along[line(t)]).sum::<f64>() / sum;
                let at = self.place((i as f64 + 0.5) / n as f64 - 0.5, (j as f64 + 0.5) / n as f64 - 0.5);
                let wave = Complex64::from_polar(self.beam(at), self.wavefront(at));
                *out = wave * (Complex64::cis(phase) * kept + lost);
            }
        });
        out
    }

    /// The mean light of each pixel.
    pub(crate) fn pixels(&self, levels: &[u16]) -> Vec<Complex64> {
        let (light, n) = (self.light(levels), self.parts);
        let part = |i: usize, k: usize| {
            let (column, row) = (i % self.width * n + k % n, i / self.width * n + k / n);
            light[row * self.width * n + column]
        };
        (0..self.width * self.height)
            .map(|i| (0..n * n).map(|k| part(i, k)).sum::<Complex64>() / (n * n) as f64)
            .collect()
    }

    /// What a place on the sensor sees [cycles/pixel, rows downwards]: a sensor turned by 188°, tilted by 6° and −4°, shifted,
    /// behind a lens with a little distortion.
    pub(crate) fn frequency(&self, column: f64, row: f64) -> [f64; 2] {
        let p = self.camera_pitch;
        let across = (column + 0.5 - 0.5 * self.camera[0] as f64) * p;
        let up = -(row + 0.5 - 0.5 * self.camera[1] as f64) * p;
        let (sin, cos) = 188f64.to_radians().sin_cos();
        let (x, y) = (cos * across - sin * up, sin * across + cos * up);
        let (sin_y, cos_y) = 6f64.to_radians().sin_cos();
        let (sin_x, cos_x) = (-4f64).to_radians().sin_cos();
        let (x, z) = (x * cos_y, x * sin_y);
        let (y, z) = (y * cos_x - z * sin_x, y * sin_x + z * cos_x);
        // A ray through the lens's middle to that place, where it crosses the focal plane.
        let f = self.lens;
        let (x, y) = ((x + 5.5e-4 * f) * f / (f + z), (y - 3.5e-4 * f) * f / (f + z));
        let distortion = 1.0 + 4.0 * (x * x + y * y) / (f * f);
        let scale = distortion * self.pitch / (self.wavelength * f);
        [x * scale, -y * scale]
    }

    /// A photo of these levels, exposed so that a thousandth of the pixels is above 85 % of full scale: 8 bits with noise.
    pub(crate) fn photo(&self, levels: &[u16], seed: u64) -> CameraPhoto {
        self.exposed(levels, seed, 999)
    }

    /// The same with so many of a thousand pixels below 85 % of full scale.
    pub(crate) fn exposed(&self, levels: &[u16], seed: u64, below: usize) -> CameraPhoto {
        let clean = self.brightness(levels);
        let mut sorted = clean.clone();
        sorted.sort_by(f64::total_cmp);
        let top = sorted[sorted.len() * below / 1000];
        let mut random = Random::new(seed, 5);
        let mut shown = |v: &f64| {
            let noise = (-2.0 * (1.0 - random.uniform()).ln()).sqrt() * (TAU * random.uniform()).cos();
            let value = 0.85 * v / top + 0.012 + NOISE * noise;
            (255.0 * value).round().clamp(0.0, 255.0) as f32 / 255.0
        };
        let values = clean.iter().map(&mut shown).collect();
        CameraPhoto::new(self.camera[0], self.camera[1], values).expect("a photo")
    }

    /// Light on each pixel of the camera.
    fn brightness(&self, levels: &[u16]) -> Vec<f64> {
        let light = self.light(levels);
        let n = self.parts;
        let (width, height) = (self.width * n, self.height * n);
        let [columns, rows] = self.camera;
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for k in 0..441 {
            let share = |i: usize, size: usize| i as f64 / 20.0 * size as f64 - 0.5;
            let nu = self.frequency(share(k % 21, columns), share(k / 21, rows));
            (0..2).for_each(|a| (low[a], high[a]) = (low[a].min(nu[a]), high[a].max(nu[a])));
        }
        // Six samples a speckle, sums of exponentials.
        let step = [1.0 / (6.0 * self.width as f64), 1.0 / (6.0 * self.height as f64)];
        let count = [0, 1].map(|a| ((high[a] - low[a]) / step[a]).ceil() as usize + 10);
        let first = [0, 1].map(|a| low[a] - 4.0 * step[a]);
        let turn = |axis: usize, part: usize, k: usize| {
            let size = [self.width, self.height][axis] as f64;
            let at = (part as f64 + 0.5) / n as f64 - 0.5 * size;
            Complex64::cis(-TAU * (first[axis] + k as f64 * step[axis]) * at)
        };
        let turns: Vec<Complex64> =
            (0..width * count[0]).into_par_iter().map(|q| turn(0, q / count[0], q % count[0])).collect();
        let mut lines = vec![ZERO; height * count[0]];
        lines.par_chunks_mut(count[0]).zip(light.par_chunks(width)).for_each(|(out, light)| {
            for (u, turns) in light.iter().zip(turns.chunks_exact(count[0])) {
                out.iter_mut().zip(turns).for_each(|(out, turn)| *out += u * turn);
            }
        });
        let mut plane = vec![ZERO; count[0] * count[1]];
        plane.par_chunks_mut(count[0]).enumerate().for_each(|(k, out)| {
            for (j, line) in lines.chunks_exact(count[0]).enumerate() {
                let turn = turn(1, j, k);
                out.iter_mut().zip(line).for_each(|(out, u)| *out += u * turn);
            }
        });
        let seen = |nu: [f64; 2]| -> f64 {
            let at = [0, 1].map(|a| (nu[a] - first[a]) / step[a]);
            let weights = at.map(|p| lagrange(p.fract()));
            let begin = at.map(|p| (p as usize).saturating_sub(2));
            let mut sum = ZERO;
            for (b, wy) in weights[1].iter().enumerate() {
                for (a, wx) in weights[0].iter().enumerate() {
                    sum += plane[(begin[1] + b) * count[0] + begin[0] + a] * (wx * wy);
                }
            }
            sum.norm_sqr()
        };
        let on_pixel = |q: usize| {
            let (column, row) = ((q % columns) as f64, (q / columns) as f64);
            let place = |k: usize| [(k % 3) as f64 / 3.0 - 1.0 / 3.0, (k / 3) as f64 / 3.0 - 1.0 / 3.0];
            let parts = (0..9).map(place).map(|[x, y]| seen(self.frequency(column + x, row + y)));
            parts.sum::<f64>() / 9.0
        };
        (0..columns * rows).into_par_iter().map(on_pixel).collect()
    }
}

/// Lagrange's weights of six samples for a place after the third.
fn lagrange(share: f64) -> [f64; 6] {
    std::array::from_fn(|i| {
        (0..6).filter(|j| *j != i).map(|j| (share - (j as f64 - 2.0)) / (i as f64 - j as f64)).product()
    })
}
