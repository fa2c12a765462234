//! Least squares over all numbers of the bench: Levenberg and Marquardt's steps.

use super::model::{Lit, Model, Seen};
use super::solve::{cholesky, inverse, substitute};
use crate::error::Result;
use crate::progress::Progress;
use rayon::prelude::*;

/// Numbers and what is known of them.
#[derive(Clone, Debug)]
pub(super) struct Fitted {
    pub(super) values: Vec<f64>,
    /// Mean square of the misses in units of their expected deviation.
    pub(super) misfit: f64,
    /// Covariance of the free numbers, from the curvature and the misfit.
    pub(super) covariance: Vec<f64>,
    pub(super) free: Vec<usize>,
    pub(super) steps: usize,
}

fn cost(model: &Model, values: &[f64], lit: &Lit, photos: &[Seen]) -> f64 {
    let mut sum = 0.0;
    for (p, photo) in photos.iter().enumerate() {
        let found = model.predicted(values, lit, p, photo);
        let misses = found.iter().zip(photo.values.iter().zip(&photo.weights));
        sum += misses.map(|(m, (y, w))| f64::from((m - y) * w).powi(2)).sum::<f64>();
    }
    sum
}

/// Scale and background of each photo that suit the rest best.
pub(super) fn expose(model: &Model, values: &mut [f64], lit: &Lit, photos: &[Seen]) {
    for (p, photo) in photos.iter().enumerate() {
        let at = model.layout.exposure.start + 2 * p;
        (values[at], values[at + 1]) = (0.0, 0.0);
        let found = model.predicted(values, lit, p, photo);
        let mut s = [0.0f64; 5];
        for (m, (y, w)) in found.iter().zip(photo.values.iter().zip(&photo.weights)) {
            let (m, y, w) = (f64::from(*m), f64::from(*y), f64::from(*w).powi(2));
            [w, w * m, w * y, w * m * m, w * m * y].iter().zip(&mut s).for_each(|(v, s)| *s += v);
        }
        let slope = (s[0] * s[4] - s[1] * s[2]) / (s[0] * s[3] - s[1] * s[1]);
        let mean = s[2] / s[1];
        // Before the model fits, its speckles are not the photo's: then the means must agree.
        let scale = if slope.is_finite() && slope > 0.3 * mean { slope } else { mean };
        (values[at], values[at + 1]) = (scale.ln(), (s[2] - scale * s[1]) / s[0]);
    }
}

/// Normal equations of the free numbers and the sum of squares.
fn normal(
    model: &Model,
    values: &[f64],
    lit: &Lit,
    photos: &[Seen],
    free: &[usize],
    progress: &Progress,
) -> Result<(Vec<f64>, Vec<f64>, f64)> {
    let n = free.len();
    let (mut matrix, mut right, mut sum) = (vec![0.0; n * n], vec![0.0; n], 0.0);
    for (p, photo) in photos.iter().enumerate() {
        progress.check()?;
        let (found, mut columns) = model.slopes(values, lit, p, photo, free);
        let misses: Vec<f32> =
            photo.values.iter().zip(&found).zip(&photo.weights).map(|((y, m), w)| (y - m) * w).collect();
        sum += misses.iter().map(|m| f64::from(*m).powi(2)).sum::<f64>();
        for column in &mut columns {
            column.iter_mut().zip(&photo.weights).for_each(|(c, w)| *c *= w);
        }
        // Sums over blocks in single precision, over the blocks in double.
        let dot = |a: &[f32], b: &[f32]| -> f64 {
            a.chunks(256)
                .zip(b.chunks(256))
                .map(|(a, b)| f64::from(a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>()))
                .sum()
        };
        let rows: Vec<(Vec<f64>, f64)> =
            columns.par_iter().map(|a| (columns.iter().map(|b| dot(a, b)).collect(), dot(a, &misses))).collect();
        for (a, (row, r)) in rows.iter().enumerate() {
            matrix[a * n..][..n].iter_mut().zip(row).for_each(|(m, v)| *m += v);
            right[a] += r;
        }
        progress.advance(1);
    }
    Ok((matrix, right, sum))
}

/// At most `steps` steps of the free numbers, until one changes the sum of squares by less than a part in `rest`.
pub(super) fn descend(
    model: &Model,
    photos: &[Seen],
    start: &[f64],
    free: &[usize],
    steps: usize,
    rest: f64,
    progress: &Progress,
) -> Result<Fitted> {
    let n = free.len();
    let mut values = start.to_vec();
    let mut lit = model.lit(&values);
    let mut damping = 1e-3;
    let count: f64 = photos.iter().flat_map(|p| &p.weights).filter(|w| **w > 0.0).count() as f64;
    let mut taken = 0;
    loop {
        let (matrix, right, now) = normal(model, &values, &lit, photos, free, progress)?;
        let mut last = taken >= steps;
        let mut tries = 0;
        while !last {
            let mut damped = matrix.clone();
            (0..n).for_each(|a| damped[a * n + a] *= 1.0 + damping + 1e-10);
            let moved = cholesky(&damped, n).map(|lower| {
                let step = substitute(&lower, &right);
                let mut moved = values.clone();
                free.iter().zip(&step).for_each(|(&i, s)| moved[i] += s);
                moved[model.layout.crosstalk] = moved[model.layout.crosstalk].clamp(0.05, 1.5);
                moved
            });
            if let Some(moved) = moved {
                let new = model.lit(&moved);
                let then = cost(model, &moved, &new, photos);
                if then < now {
                    (values, lit) = (moved, new);
                    damping = (damping * 0.2).max(1e-7);
                    last = now - then < rest * now;
                    break;
                }
            }
            damping *= 10.0;
            tries += 1;
            last = tries > 6;
        }
        taken += 1;
        if last {
            let (matrix, _, now) = normal(model, &values, &lit, photos, free, progress)?;
            let misfit = now / count;
            let mut curved = matrix;
            (0..n).for_each(|a| curved[a * n + a] *= 1.0 + 1e-10);
            let covariance = cholesky(&curved, n)
                .map_or_else(Vec::new, |lower| inverse(&lower, n).iter().map(|v| v * misfit).collect());
            return Ok(Fitted { values, misfit, covariance, free: free.to_vec(), steps: taken });
        }
    }
}
