//! Every field is measured after it is made, at random pixels against the definition in double precision.
//!
//! # What the error is relative to
//!
//! The field that is there: ε = ‖u − v‖/‖u‖ over the panel's pixels, u the exact field and v the computed one. Where waves
//! cancel, or all but miss the panel, ‖u‖ is small, and an error that is small beside the points' power need not be small
//! beside ‖u‖.
//!
//! # How it is measured
//!
//! Of n pixels half are drawn evenly and half with the light that was found, both without regard to the engine: with the
//! density p = ½/N + ½|v|²/Σ|v|² the mean of |u − v|²/p is ‖u − v‖² whatever the field is, a ghost where nothing should be
//! shows by the even half and a wrong value where the light is by the other. ‖u‖² = Σ|v|² + mean((|u|² − |v|²)/p). The
//! *limit* is what the error passes in one of a hundred measurements if its squares are even about their mean: 2.33 of the
//! mean's standard errors above it. n follows from a time: [`SHARE`] of what the field takes, [`FEWEST`] to [`MOST`] pixels;
//! a grid of no more pixels is measured whole.

mod near;
mod waves;
pub(super) mod whole;

use super::sources::{PointSum, PointWave};
use crate::error::Result;
use crate::field::{Complex32, Complex64, Grid};
use crate::random::Random;
use near::Near;
use rayon::prelude::*;
use std::borrow::Cow;
use std::time::Instant;
use waves::Waves;

/// Part of the field's time that the measurement may take.
const SHARE: f64 = 0.04;

/// Least time that it may take, whatever the field's [core-seconds].
const LEAST: f64 = 2e-4;

/// Pixels at least, and at most.
const FEWEST: usize = 16;
const MOST: usize = 512;

/// Time of a far point and a pixel [core-seconds].
const PAIR: f64 = 6e-9;

/// Standard errors above the mean that one measurement of a hundred passes.
const CONFIDENCE: f64 = 2.33;

/// Error of the exact sum, over the points' power: of paths of a million wavelengths in double precision, and of what lies
/// beyond the taper's end.
const ROUNDING: f64 = 1e-9;

/// Seed of the pixels.
const SEED: u64 = 0x05ee_d0ff_1e1d;

/// Points that one task sums.
const PART: usize = 2048;

/// The error of a field, measured at random pixels against the definition.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Measured {
    /// Relative L2 error ‖u − v‖/‖u‖, estimated.
    pub error: f64,
    /// What the error passes with a probability of about 1 %, with what the measurement itself may be off by.
    pub limit: f64,
    /// Pixels that were computed exactly.
    pub pixels: usize,
    /// ‖u − v‖ over what bare spheres of random phases would have on the panel.
    pub of_power: f64,
    /// Wall time of the measurement [s].
    pub seconds: f64,
}

impl Measured {
    /// A field that holds what is no number.
    const NOT_FINITE: Self =
        Self { error: f64::INFINITY, limit: f64::INFINITY, pixels: 0, of_power: f64::INFINITY, seconds: 0.0 };

    /// The worse of two.
    pub(super) fn or_worse(self, other: Self) -> Self {
        let seconds = self.seconds + other.seconds;
        Self { seconds, ..if self.limit >= other.limit { self } else { other } }
    }
}

/// Measures the error of a field that took `core_seconds`; `thorough` with eight times the pixels.
pub(super) fn measure(sum: &PointSum, field: &[Complex32], core_seconds: f64, thorough: bool) -> Result<Measured> {
    let start = Instant::now();
    let grid = sum.grid;
    let row = |row: &[Complex32]| row.iter().map(|u| f64::from(u.re).powi(2) + f64::from(u.im).powi(2)).sum();
    let rows: Vec<f64> = field.par_chunks(grid.width).map(row).collect();
    let found: f64 = rows.iter().sum();
    // Squares of f32 do not pass f64: the sum is finite where all samples are.
    if !found.is_finite() {
        return Ok(Measured::NOT_FINITE);
    }
    let exact = Exact::new(sum);
    let budget = (SHARE * core_seconds).max(LEAST) * if thorough { 8.0 } else { 1.0 };
    let fewest = if thorough { 8 * FEWEST } else { FEWEST };
    let count = ((budget / exact.core_seconds()) as usize).clamp(fewest, MOST.max(fewest));
    let even = 1.0 / grid.len() as f64;
    let (pixels, whole) = if grid.len() <= count {
        ((0..grid.len()).collect(), true)
    } else {
        (draw(field, &rows, grid, count, thorough), false)
    };
    let values = exact.at(sum, &pixels)?;
    let density = |i: usize| {
        let light = f64::from(field[i].re).powi(2) + f64::from(field[i].im).powi(2);
        if whole {
            even
        } else if found > 0.0 {
            0.5 * even + 0.5 * light / found
        } else {
            even
        }
    };
    let n = pixels.len() as f64;
    let (mut mean, mut square, mut more) = (0.0, 0.0, 0.0);
    for (&i, exact) in pixels.iter().zip(&values) {
        let v = Complex64::new(f64::from(field[i].re), f64::from(field[i].im));
        let weight = 1.0 / density(i);
        let error = (exact - v).norm_sqr() * weight;
        (mean, square) = (mean + error / n, square + error * error / n);
        more += (exact.norm_sqr() - v.norm_sqr()) * weight / n;
    }
    // Exactly dark although points shine: the smallest light that they could send there would be all wrong.
    let is_dark = found == 0.0 && exact.power > 0.0;
    let lit = (found + more).max(f64::from(f32::MIN_POSITIVE).powi(2));
    let spread = if whole { 0.0 } else { ((square - mean * mean).max(0.0) / (n - 1.0).max(1.0)).sqrt() };
    let relative = |square: f64| if square > 0.0 { (square / lit).sqrt() } else { 0.0 };
    let power = exact.power;
    // What the exact sum itself is off by, beside a field that is little of its points' power.
    let rounding = if power > 0.0 { ROUNDING * (power / lit).sqrt() } else { 0.0 };
    Ok(Measured {
        error: if is_dark { 1.0 } else { relative(mean) },
        limit: if is_dark { 1.0 } else { relative(mean + CONFIDENCE * spread) + rounding },
        pixels: pixels.len(),
        of_power: if power > 0.0 { (mean / power).sqrt() } else { 0.0 },
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// Draws pixels: the even ones first, those that go with the light found; `rows` is the light of each row.
fn draw(field: &[Complex32], rows: &[f64], grid: &Grid, count: usize, thorough: bool) -> Vec<usize> {
    let light: f64 = rows.iter().sum();
    let lit = if light > 0.0 { count / 2 } else { 0 };
    (0..count)
        .map(|i| {
            let mut random = Random::new(SEED + u64::from(thorough), i as u64);
            if i >= lit {
                return ((random.uniform() * grid.len() as f64) as usize).min(grid.len() - 1);
            }
            // Stratified: one draw in each of as many equal parts of the light.
            let mut rest = (i as f64 + random.uniform()) / lit as f64 * light;
            let row = rows.iter().position(|&row| {
                let here = rest < row;
                rest -= if here { 0.0 } else { row };
                here
            });
            let row = row.unwrap_or(grid.height - 1);
            let samples = &field[row * grid.width..][..grid.width];
            let column = samples.iter().position(|u| {
                rest -= f64::from(u.re).powi(2) + f64::from(u.im).powi(2);
                rest < 0.0
            });
            row * grid.width + column.unwrap_or(grid.width - 1)
        })
        .collect()
}

/// The definition's sum, far points by their form and near ones by the integral.
struct Exact<'a> {
    far: Cow<'a, [PointWave]>,
    near: Vec<PointWave>,
    /// Squared norm on the panel of the points' bare spheres with random phases, none more than its whole light.
    power: f64,
    /// Work of the near points for one pixel [core-seconds].
    near_seconds: f64,
}

impl<'a> Exact<'a> {
    fn new(sum: &PointSum<'a>) -> Self {
        let PointSum { optics, grid, sources, cull, .. } = *sum;
        let is_near = |s: &PointWave| Near::is_needed(optics, cull, s.distance);
        let (far, near): (Cow<[PointWave]>, Vec<PointWave>) = if sources.par_iter().any(is_near) {
            let (near, far) = sources.iter().partition(|s| is_near(s));
            (Cow::Owned(far), near)
        } else {
            (Cow::Borrowed(sources), Vec::new())
        };
        let [bx, by] = optics.taper.map(|taper| 2.0 * taper.middle);
        let whole = optics.wavelength.powi(2) * bx * by / (optics.pitch[0] * optics.pitch[1]);
        let one = |s: &PointWave| {
            let [dx, dy] = [s.x - grid.center[0], s.y - grid.center[1]];
            let square = dx * dx + dy * dy + s.distance * s.distance;
            s.amplitude * s.amplitude * (grid.len() as f64 / square.max(1e-30)).min(whole)
        };
        let parts: Vec<f64> = sources.par_chunks(PART).map(|part| part.iter().map(one).sum()).collect();
        let near_seconds = near.iter().map(|s| Near::core_seconds(optics, grid, s)).sum();
        Self { far, near, power: parts.iter().sum(), near_seconds }
    }

    /// Work for one pixel [core-seconds].
    fn core_seconds(&self) -> f64 {
        (self.far.len() as f64 * PAIR + self.near_seconds).max(1e-12)
    }

    /// The exact field at pixels, in their order.
    fn at(&self, sum: &PointSum, pixels: &[usize]) -> Result<Vec<Complex64>> {
        let PointSum { optics, grid, cull, progress, .. } = *sum;
        let places: Vec<[f64; 2]> = pixels.iter().map(|i| [grid.x(i % grid.width), grid.y(i / grid.width)]).collect();
        let waves = Waves::new(optics, cull);
        let near: Vec<Vec<Complex64>> = self
            .near
            .par_chunks(16)
            .map(|part| {
                let mut sums = vec![Complex64::default(); places.len()];
                part.iter().take_while(|_| !progress.stopped()).for_each(|s| Near::add(optics, s, &places, &mut sums));
                sums
            })
            .collect();
        let parts: Vec<&[PointWave]> = self.far.chunks(PART).collect();
        let tasks: Vec<(usize, &[PointWave])> =
            (0..places.len()).flat_map(|pixel| parts.iter().map(move |part| (pixel, *part))).collect();
        let far: Vec<Complex64> = tasks
            .par_iter()
            .map(
                |&(pixel, part)| {
                    if progress.stopped() { Complex64::default() } else { waves.sum(part, places[pixel]) }
                },
            )
            .collect();
        progress.check()?;
        let mut sums = vec![Complex64::default(); places.len()];
        for ((pixel, _), value) in tasks.iter().zip(&far) {
            sums[*pixel] += value;
        }
        for part in &near {
            sums.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
        }
        Ok(sums)
    }
}

#[cfg(test)]
mod tests;
