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
//! *limit* is what the error passes in about one of a hundred measurements: Student's quantile for n pixels, with Johnson's
//! term for squares that are skew (J. Am. Stat. Assoc. 73 (1978) 536). n follows from a time: [`SHARE`] of what the field
//! takes, [`FEWEST`] to [`MOST`] pixels. A grid of no more pixels is measured whole, and so is a small one whose whole exact sum
//! takes no longer than the pixels would: near points cost little more for all pixels than for a few.

mod near;
mod real;
mod waves;
pub(super) mod whole;

use super::sources::{PointSum, PointWave};
use crate::error::Result;
use crate::field::{Complex32, Complex64, Grid};
use crate::hologram::Cull;
use crate::random::Random;
use near::Near;
use rayon::prelude::*;
use std::borrow::Cow;
use std::time::Instant;
use waves::{BATCH, QUICK, Waves};

/// Part of the field's time that the measurement may take.
const SHARE: f64 = 0.04;

/// Least time that it may take, whatever the field's [core-seconds]: nobody waits for it.
const LEAST: f64 = 2e-2;

/// Pixels at least, and at most.
const FEWEST: usize = 16;
const MOST: usize = 512;

/// Pixels of a grid that may be measured whole, and memory for near points' lines then [bytes]: a few MB beside the engine's.
const WHOLE: usize = 1 << 16;
const LINES: usize = 2 << 20;

/// Time of a far point and a pixel, in double precision and quickly [core-seconds].
const PAIR: f64 = 1.1e-8;
const QUICK_PAIR: f64 = 7e-9;

/// Part of the error asked that the quick sum may err by.
const QUICK_SHARE: f64 = 0.02;

/// Part of the error asked that the far form may err by where it stands for the integral: points a few hundred pixels before a
/// plate would take a thousand times longer.
const FORM_SHARE: f64 = 0.02;

/// The normal distribution's quantile that one measurement of a hundred passes.
const CONFIDENCE: f64 = 2.326;

/// Error of the exact sum, over the points' power: of paths of a million wavelengths in double precision, and of what lies
/// beyond the taper's end.
const ROUNDING: f64 = 1e-9;

/// Rounding of a field's samples.
const SAMPLES: f64 = 6e-8;

/// Seed of the pixels.
const SEED: u64 = 0x05ee_d0ff_1e1d;

/// Most parts that the points are summed in, and places of a task.
const PARTS: usize = 256;
const PLACES: usize = 64;

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
    /// All of the panel's: the error is known, not estimated.
    pub whole: bool,
    /// ‖u − v‖ over what bare spheres of random phases would have on the panel.
    pub of_power: f64,
    /// Wall time of the measurement [s].
    pub seconds: f64,
}

impl Measured {
    /// A field that holds what is no number.
    const NOT_FINITE: Self = Self {
        error: f64::INFINITY,
        limit: f64::INFINITY,
        pixels: 0,
        whole: false,
        of_power: f64::INFINITY,
        seconds: 0.0,
    };

    /// The worse of two.
    pub(super) fn or_worse(self, other: Self) -> Self {
        let seconds = self.seconds + other.seconds;
        Self { seconds, ..if self.limit >= other.limit { self } else { other } }
    }
}

/// What a measurement is made for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    /// What the field took [core-seconds].
    pub(super) core_seconds: f64,
    /// Error that was asked.
    pub(super) error: f64,
    /// Eight times the pixels.
    pub(super) thorough: bool,
}

/// Measures the error of a field.
pub(super) fn measure(sum: &PointSum, field: &[Complex32], wanted: Wanted) -> Result<Measured> {
    let start = Instant::now();
    let grid = sum.grid;
    let row = |row: &[Complex32]| row.iter().map(|u| f64::from(u.re).powi(2) + f64::from(u.im).powi(2)).sum();
    let rows: Vec<f64> = field.par_chunks(grid.width).map(row).collect();
    let found: f64 = rows.iter().sum();
    // Squares of f32 do not pass f64: the sum is finite where all samples are.
    if !found.is_finite() {
        return Ok(Measured::NOT_FINITE);
    }
    let Wanted { core_seconds, error, thorough } = wanted;
    let exact = Exact::new(sum, FORM_SHARE * error);
    let is_quick = found > 0.0 && QUICK * (exact.power / found).sqrt() <= QUICK_SHARE * error;
    let pixel = exact.core_seconds(if is_quick { QUICK_PAIR } else { PAIR });
    let budget = (SHARE * core_seconds).max(LEAST) * if thorough { 8.0 } else { 1.0 };
    let fewest = if thorough { 8 * FEWEST } else { FEWEST };
    let count = ((budget / pixel) as usize).clamp(fewest, MOST.max(fewest));
    let even = 1.0 / grid.len() as f64;
    let soon = || whole::seconds(sum, &exact) <= budget.max(count as f64 * pixel);
    let whole = grid.len() <= count || (grid.len() <= WHOLE && soon());
    let (pixels, values) = if whole {
        ((0..grid.len()).collect(), whole::samples(sum, &exact, LINES, || ())?)
    } else {
        let pixels = draw(field, &rows, grid, count, thorough);
        let values = exact.at(sum, &pixels, is_quick)?;
        (pixels, values)
    };
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
    let mut errors = Vec::with_capacity(pixels.len());
    let mut more = 0.0;
    for (&i, exact) in pixels.iter().zip(&values) {
        let v = Complex64::new(f64::from(field[i].re), f64::from(field[i].im));
        let weight = 1.0 / density(i);
        errors.push((exact - v).norm_sqr() * weight);
        more += (exact.norm_sqr() - v.norm_sqr()) * weight / n;
    }
    let mean = errors.iter().sum::<f64>() / n;
    // Exactly dark although points shine: the smallest light that they could send there would be all wrong.
    let is_dark = found == 0.0 && exact.power > 0.0;
    let lit = (found + more).max(f64::from(f32::MIN_POSITIVE).powi(2));
    let most = if whole { mean } else { upper_limit(&errors, mean) };
    let relative = |square: f64| if square > 0.0 { (square / lit).sqrt() } else { 0.0 };
    let power = exact.power;
    // What the exact sum itself is off by, beside a field that is little of its points' power.
    let accuracy = if is_quick && !whole { QUICK } else { ROUNDING };
    let rounding = if power > 0.0 { (accuracy + exact.form) * (power / lit).sqrt() + SAMPLES } else { 0.0 };
    Ok(Measured {
        error: if is_dark { 1.0 } else { relative(mean) },
        limit: if is_dark { 1.0 } else { relative(most) + rounding },
        pixels: pixels.len(),
        whole,
        of_power: if power > 0.0 { (mean / power).sqrt() } else { 0.0 },
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// What the mean that values are drawn about passes with a probability of about 1 %: the larger of Student's quantile above
/// theirs with Johnson's term of their skewness, and of what their mean must be below were they squares of a complex Gaussian
/// error, whose skewness a few of them do not show.
fn upper_limit(values: &[f64], mean: f64) -> f64 {
    let n = values.len() as f64;
    let moment = |power: i32| values.iter().map(|value| (value - mean).powi(power)).sum::<f64>();
    let (variance, third) = (moment(2) / (n - 1.0).max(1.0), moment(3) / n);
    if variance <= 0.0 {
        return mean;
    }
    let (z, free) = (CONFIDENCE, (n - 1.0).max(1.0));
    // Cornish and Fisher's expansion, to 1 % from eight values on.
    let student =
        z + (z.powi(3) + z) / (4.0 * free) + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * free * free);
    let skew = third.max(0.0) * (1.0 + 2.0 * student * student) / (6.0 * variance * n);
    // Wilson and Hilferty's quantile of the sum of n exponential values.
    let gaussian = 1.0 / (1.0 - 1.0 / (9.0 * n) - z / (9.0 * n).sqrt()).powi(3);
    (mean + student * (variance / n).sqrt() + skew).max(mean * gaussian)
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
    /// Error of the far form of the nearest point that it stands for, and of the near ones' expansion.
    form: f64,
}

impl<'a> Exact<'a> {
    /// `form` is an error of the far form that does not matter.
    fn new(sum: &PointSum<'a>, form: f64) -> Self {
        let PointSum { optics, grid, sources, cull, .. } = *sum;
        let is_near = |s: &PointWave| Near::is_needed(optics, cull, s.distance, form);
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
        let parts: Vec<f64> = sources.par_chunks(2048).map(|part| part.iter().map(one).sum()).collect();
        let near_seconds = near.iter().map(|s| Near::core_seconds(optics, grid, s)).sum();
        let nearest = far.iter().map(|s| s.distance).fold(f64::INFINITY, f64::min);
        let of_far = if cull == Cull::Soft { optics.far_error(nearest) } else { 0.0 };
        let form = if near.is_empty() { of_far } else { of_far.max(near::ACCURACY) };
        Self { far, near, power: parts.iter().sum(), near_seconds, form }
    }

    /// Work for one pixel where a far point takes `pair` [core-seconds].
    fn core_seconds(&self, pair: f64) -> f64 {
        (self.far.len() as f64 * pair + self.near_seconds).max(1e-12)
    }

    /// The exact field at pixels, in their order.
    fn at(&self, sum: &PointSum, pixels: &[usize], is_quick: bool) -> Result<Vec<Complex64>> {
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
        // The same parts for any number of threads.
        let part = self.far.len().div_ceil(PARTS).max(1).next_multiple_of(BATCH);
        let tasks: Vec<(usize, &[PointWave])> = self
            .far
            .chunks(part)
            .flat_map(|points| (0..places.len()).step_by(PLACES).map(move |first| (first, points)))
            .collect();
        let one = |&(first, points): &(usize, &[PointWave])| {
            let places = &places[first..places.len().min(first + PLACES)];
            let mut sums = vec![Complex64::default(); places.len()];
            for batch in points.chunks(BATCH).take_while(|_| !progress.stopped()) {
                if is_quick {
                    waves.add_quickly(batch, places, &mut sums);
                } else {
                    waves.add(batch, places, &mut sums);
                }
            }
            sums
        };
        let far: Vec<Vec<Complex64>> = tasks.par_iter().map(one).collect();
        progress.check()?;
        let mut sums = vec![Complex64::default(); places.len()];
        let far = tasks.iter().zip(&far).map(|((first, _), part)| (*first, part));
        for (first, part) in far.chain(near.iter().map(|part| (0, part))) {
            sums[first..].iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
        }
        Ok(sums)
    }
}

#[cfg(test)]
mod tests;
