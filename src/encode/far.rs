//! A picture in the focal plane of a lens behind the panel, by gradient descent on the phases, with the panel in the loop and, where
//! there is one, a camera.
//!
//! The lens shows U(ν) = Σ u(n)·exp(−i2πν·n), ν in cycles a pixel along columns and rows. The picture asks for amplitudes √T on the
//! samples of a rectangle, half a speckle apart; all other light is free. Each step lowers L = Σ(s|U| − √T)²/ΣT with the best
//! scale s, by the light of the panel as its profile knows it: levels' curve, beam, wavefront error, crosstalk, unmodulated light.
//!
//! With a camera, |U| in the residual is what was photographed, and only the derivative is the model's (Peng et al., "Neural
//! holography with camera-in-the-loop training", *ACM Trans. Graph.* 39, 185 (2020)): what the model does not know is corrected
//! all the same.

mod search;

pub use search::{FarReport, FarSettings, Photograph, far_frame};

use crate::error::{Error, Result};
use crate::field::{Complex32, Fft1, fast_length};
use crate::panel::PanelProfile;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// A picture and where in the focal plane it stands.
#[derive(Clone, Debug)]
pub struct FarPicture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear light of each pixel, row-major, row 0 on top; any scale.
    pub light: Vec<f32>,
    /// Left, top, right and bottom of the room for it [cycles/pixel, rows downwards]: it stands in its middle, in its own shape.
    pub room: [f64; 4],
}

/// The samples of a picture in the focal plane, and the way to them.
pub struct FarPlane {
    size: [usize; 2],
    rows: Fft1<f32>,
    columns: Fft1<f32>,
    /// First sample along columns and rows, in samples of the padded transform from the axis.
    first: [isize; 2],
    count: [usize; 2],
    /// √T, row-major.
    wanted: Vec<f32>,
}

impl FarPlane {
    /// For a panel of that profile.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a picture that is dark, negative or not finite, or for which there is no room.
    pub fn new(picture: &FarPicture, profile: &PanelProfile) -> Result<Self> {
        let refuse = |what: String| Err(Error::parameter("picture", what));
        let FarPicture { width, height, light, room } = picture;
        if light.len() != width * height || light.is_empty() {
            return refuse(format!("{} pixels for {width}×{height}", light.len()));
        }
        if let Some(i) = light.iter().position(|v| !(v.is_finite() && *v >= 0.0)) {
            return refuse(format!("light at column {}, row {} is negative or not finite", i % width, i / width));
        }
        let [left, top, right, bottom] = *room;
        if !(left < right && top < bottom && room.iter().all(|f| f.abs() <= 0.5)) {
            return refuse(format!("{room:?} is no room within half a cycle a pixel for it"));
        }
        let size = [profile.width, profile.height];
        let padded = size.map(|n| fast_length(2 * n, 2, &[1]));
        // In its own shape: frequencies over pitches are angles.
        let across = (right - left) / profile.pitch_x;
        let down = (bottom - top) / profile.pitch_y;
        let aspect = *width as f64 / *height as f64;
        let (w, h) = if across / down > aspect { (down * aspect, down) } else { (across, across / aspect) };
        let sides = [w * profile.pitch_x, h * profile.pitch_y];
        let middle = [0.5 * (left + right), 0.5 * (top + bottom)];
        let count = [0, 1].map(|a| (sides[a] * padded[a] as f64).round() as usize);
        if count[0].min(count[1]) < 8 {
            return refuse(format!("{} × {} samples are no room for it", count[0], count[1]));
        }
        let first = [0, 1].map(|a| ((middle[a] - 0.5 * sides[a]) * padded[a] as f64).round() as isize);
        let wanted: Vec<f32> = (0..count[0] * count[1]).map(|k| averaged(picture, count, k).sqrt()).collect();
        if wanted.iter().all(|v| *v == 0.0) {
            return refuse("it is dark everywhere".into());
        }
        let (rows, columns) = (Fft1::new(padded[0]), Fft1::new(padded[1]));
        Ok(Self { size, rows, columns, first, count, wanted })
    }

    /// Where each sample stands, in the order of the picture [cycles/pixel along columns and rows].
    pub fn frequencies(&self) -> Vec<[f64; 2]> {
        let padded = [self.rows.len(), self.columns.len()];
        let at = |axis: usize, i: usize| (self.first[axis] + i as isize) as f64 / padded[axis] as f64;
        let [columns, rows] = self.count;
        (0..columns * rows).map(|k| [at(0, k % columns), at(1, k / columns)]).collect()
    }

    /// Place of a sample in the padded transform.
    fn place(&self, axis: usize, i: usize) -> usize {
        let length = [self.rows.len(), self.columns.len()][axis] as isize;
        (self.first[axis] + i as isize).rem_euclid(length) as usize
    }

    /// U of the panel's light at the samples, but for a phase that each sample has from where the panel's middle is.
    fn forward(&self, light: &[Complex32]) -> Vec<Complex32> {
        let ([width, height], [columns, rows]) = (self.size, self.count);
        let zero = Complex32::new(0.0, 0.0);
        let mut half = vec![zero; columns * height];
        half.par_chunks_mut(columns).zip(light.par_chunks(width)).for_each_init(
            || (vec![zero; self.rows.len()], self.rows.scratch()),
            |(line, scratch), (out, row)| {
                line[..width].copy_from_slice(row);
                line[width..].fill(zero);
                self.rows.forward(line, scratch);
                out.iter_mut().enumerate().for_each(|(i, out)| *out = line[self.place(0, i)]);
            },
        );
        let mut turned = vec![zero; columns * rows];
        turned.par_chunks_mut(rows).enumerate().for_each_init(
            || (vec![zero; self.columns.len()], self.columns.scratch()),
            |(line, scratch), (i, out)| {
                (0..height).for_each(|j| line[j] = half[j * columns + i]);
                line[height..].fill(zero);
                self.columns.forward(line, scratch);
                out.iter_mut().enumerate().for_each(|(j, out)| *out = line[self.place(1, j)]);
            },
        );
        (0..columns * rows).map(|k| turned[(k % columns) * rows + k / columns]).collect()
    }

    /// The adjoint of [`Self::forward`].
    fn backward(&self, pulls: &[Complex32]) -> Vec<Complex32> {
        let ([width, height], [columns, rows]) = (self.size, self.count);
        let zero = Complex32::new(0.0, 0.0);
        let mut half = vec![zero; columns * height];
        half.par_chunks_mut(height).enumerate().for_each_init(
            || (vec![zero; self.columns.len()], self.columns.scratch()),
            |(line, scratch), (i, out)| {
                line.fill(zero);
                (0..rows).for_each(|j| line[self.place(1, j)] = pulls[j * columns + i]);
                self.columns.inverse(line, scratch);
                out.copy_from_slice(&line[..height]);
            },
        );
        let mut light = vec![zero; width * height];
        light.par_chunks_mut(width).enumerate().for_each_init(
            || (vec![zero; self.rows.len()], self.rows.scratch()),
            |(line, scratch), (j, out)| {
                line.fill(zero);
                (0..columns).for_each(|i| line[self.place(0, i)] = half[i * height + j]);
                self.rows.inverse(line, scratch);
                out.copy_from_slice(&line[..width]);
            },
        );
        light
    }

    /// Phases that spread the panel's light evenly over the picture, without speckle: a carrier and a lens.
    fn start(&self) -> Vec<f32> {
        let padded = [self.rows.len() as f64, self.columns.len() as f64];
        let axis = |a: usize, i: usize| {
            let (size, n) = (self.size[a] as f64, i as f64 - 0.5 * (self.size[a] as f64 - 1.0));
            let half = 0.5 * self.count[a] as f64 / padded[a];
            let middle = self.first[a] as f64 / padded[a] + half;
            middle * n + half * n * n / size
        };
        let width = self.size[0];
        (0..width * self.size[1])
            .into_par_iter()
            .map(|i| (TAU * (axis(0, i % width) + axis(1, i / width)).rem_euclid(1.0)) as f32)
            .collect()
    }

    /// Best scale, and peak signal-to-noise ratio [dB], of amplitudes; those that are not finite do not count.
    fn judge(&self, amplitudes: &[f32]) -> (f32, f64) {
        let (mut cross, mut own) = (0.0, 0.0);
        let counted = || amplitudes.iter().zip(&self.wanted).filter(|(a, _)| a.is_finite());
        for (a, wanted) in counted() {
            cross += f64::from(a * wanted);
            own += f64::from(a * a);
        }
        let scale = if own > 0.0 { cross / own } else { 0.0 };
        let (mut squares, mut count, mut peak) = (0.0, 0.0, 0.0f64);
        for (a, wanted) in counted() {
            squares += (scale * f64::from(*a) - f64::from(*wanted)).powi(2);
            (count, peak) = (count + 1.0, peak.max(f64::from(*wanted)));
        }
        (scale as f32, 10.0 * (peak * peak * count / squares.max(f64::MIN_POSITIVE)).log10())
    }
}

/// Mean light of the part of a picture that one of `count` samples covers.
fn averaged(picture: &FarPicture, count: [usize; 2], k: usize) -> f32 {
    const PARTS: usize = 4;
    let (column, row) = (k % count[0], k / count[0]);
    let place = |i: usize, part: usize, count: usize, size: usize| {
        let share = (i as f64 + (part as f64 + 0.5) / PARTS as f64) / count as f64;
        ((share * size as f64) as usize).min(size - 1)
    };
    let mut sum = 0.0;
    for v in 0..PARTS {
        for u in 0..PARTS {
            let (x, y) = (place(column, u, count[0], picture.width), place(row, v, count[1], picture.height));
            sum += picture.light[y * picture.width + x];
        }
    }
    sum / (PARTS * PARTS) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panel::Setup;
    use crate::random::Random;

    pub(super) fn picture() -> FarPicture {
        let (width, height) = (60, 40);
        let bar = |i: usize| if (i % width / 10).is_multiple_of(2) { 1.0 } else { 0.2 + 0.01 * (i / width) as f32 };
        let light = (0..width * height).map(bar).collect();
        FarPicture { width, height, light, room: [-0.2, -0.2, 0.2, -0.05] }
    }

    pub(super) fn setup() -> Setup {
        Setup::new(PanelProfile::phase(96, 64, 8e-6, 8, 532e-9).expect("profile"), None).expect("setup")
    }

    /// The way there against the sum of the definition, and the way back against the way there.
    #[test]
    fn the_light_is_the_sum_over_the_pixels_and_the_way_back_its_adjoint() {
        let setup = setup();
        let plane = FarPlane::new(&picture(), &setup.profile).expect("plane");
        let mut random = Random::new(3, 1);
        let mut field = |count: usize| -> Vec<Complex32> {
            (0..count).map(|_| Complex32::new(random.uniform() as f32 - 0.5, random.uniform() as f32 - 0.5)).collect()
        };
        let (light, pulls) = (field(96 * 64), field(plane.wanted.len()));
        let seen = plane.forward(&light);
        for (k, nu) in plane.frequencies().into_iter().enumerate().step_by(97) {
            let turn = |i: usize| TAU * (nu[0] * (i % 96) as f64 + nu[1] * (i / 96) as f64);
            let (mut re, mut im) = (0.0, 0.0);
            for (i, u) in light.iter().enumerate() {
                let (sin, cos) = (-turn(i)).sin_cos();
                re += f64::from(u.re) * cos - f64::from(u.im) * sin;
                im += f64::from(u.re) * sin + f64::from(u.im) * cos;
            }
            assert!((f64::from(seen[k].re) - re).hypot(f64::from(seen[k].im) - im) < 1e-3, "{k}");
        }
        let product = |a: &[Complex32], b: &[Complex32]| -> f64 {
            a.iter().zip(b).map(|(a, b)| f64::from((a.conj() * b).re)).sum()
        };
        let [there, back] = [product(&pulls, &seen), product(&plane.backward(&pulls), &light)];
        assert!((there - back).abs() < 1e-4 * there.abs().max(1.0), "{there} {back}");
    }
}
