//! Onto a plane with another pitch and anywhere beside the axis: the angular spectrum, evaluated where it is wanted.
//!
//! An inverse Fourier transform gives the field on the input's own lattice only. Here the sum over frequencies
//!
//! ```text
//! u(x_m) = 1/n · Σ_k U_k·H(f_k)·exp(i2πf_k x_m),   x_m = x_0 + m·p,   f_k = k/(n·p_in)
//! ```
//!
//! is done for any first position x_0 and pitch p as a chirp-z transform: with α = p/(n·p_in),
//! k·m = (k² + m² − (m − k)²)/2 makes it a convolution with exp(−iπα d²), which three transforms of length ≥ n + M − 1
//! compute (Rabiner, Schafer & Rader, *Bell Syst. Tech. J.* 48, 1249 (1969)). The frequency grid is the exact one.
//! Chirps are computed in f64, reduced to one turn, and then narrowed.
//!
//! # Soft band limit
//!
//! A frequency f reaches the offset X(f) = d·λf/√(1 − λ²f²) to within a Fresnel width √(λd). The sharp limit of
//! [`super`], X within half of input plus output extent, therefore costs per cents where a window is not much larger
//! than that width. Here the limit falls as an error function from 1 at that offset to 0 a guard of eight Fresnel widths
//! further out, and the period n·p_in is that much longer, so that nothing wraps round: what is left out is below 1e-6.

use super::{Aperture, Settings, turned, turns_and_decay};
use crate::error::Result;
use crate::field::{Complex, Fft1, FftNum, Field, Grid, fast_length, grid};
use crate::progress::Progress;
use rayon::prelude::*;

/// Columns or rows that one task takes together.
const STRIP: usize = 16;

/// Width of the soft edge in Fresnel widths √(λd).
const GUARD: f64 = 8.0;

/// Half of it in widths of the error function: erfc(3.7)/2 = 8e-8.
const EDGE: f64 = 3.7;

/// Frequencies of less weight are left out.
const DARK: f64 = 1e-12;

/// A planned propagation between two grids of any pitches, sizes and middles, over one distance.
#[derive(Clone, Debug)]
pub struct ScaledPropagator<T: FftNum> {
    input: Grid,
    output: Grid,
    wavelength: f64,
    distance: f64,
    settings: Settings,
    /// Frequencies along x and y.
    counts: [usize; 2],
    lines: [Fft1<T>; 2],
}

impl<T: FftNum> ScaledPropagator<T> {
    /// Plans from `input` to `output`, `distance` d [m] in front of (d > 0, with the light) or behind (d < 0) it.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a wavelength that is not positive, or a distance that is not finite; [`Error::Memory`]
    /// when the spectra pass the budget.
    pub fn new(input: Grid, output: Grid, wavelength: f64, distance: f64, settings: Settings) -> Result<Self> {
        grid::light(wavelength)?;
        grid::finite("distance", distance)?;
        let guard = if settings.band_limit { GUARD * (wavelength * distance.abs()).sqrt() } else { 0.0 };
        let counts =
            [(input.width, output.extent_x(), input.pitch_x), (input.height, output.extent_y(), input.pitch_y)].map(
                |(size, extent, pitch)| {
                    let least = size + ((extent + 2.0 * guard) / pitch).ceil() as usize;
                    fast_length(least, 1, &[1])
                },
            );
        let planned = Self { input, output, wavelength, distance, settings, counts, lines: counts.map(Fft1::new) };
        settings.allow(planned.memory())?;
        Ok(planned)
    }

    /// Weight of a frequency along x (axis 0) or y (axis 1): 1 where its wave meets the output window.
    pub fn weight(&self, axis: usize, f: f64) -> f64 {
        if !self.settings.band_limit || self.distance == 0.0 {
            return 1.0;
        }
        let extent = |grid: &Grid| if axis == 0 { grid.extent_x() } else { grid.extent_y() };
        let sine = self.wavelength * f;
        if sine.abs() >= 1.0 {
            return 0.0;
        }
        let at = self.distance * sine / (1.0 - sine * sine).sqrt();
        let aside = (at - (self.output.center[axis] - self.input.center[axis])).abs();
        let guard = GUARD * (self.wavelength * self.distance.abs()).sqrt();
        let middle = 0.5 * (extent(&self.input) + extent(&self.output) + guard);
        0.5 * libm::erfc((aside - middle) * 2.0 * EDGE / guard)
    }

    /// Number of frequencies along x and y; their spacing is 1/(number × input pitch).
    pub fn counts(&self) -> [usize; 2] {
        self.counts
    }

    /// Memory that [`ScaledPropagator::propagate`] takes besides input and output [bytes].
    pub fn memory(&self) -> u64 {
        let rows = self.input.height + self.output.height;
        let chirp = |axis: usize, m: usize| 2 * (self.counts[axis] + m);
        let (x, y) = (chirp(0, self.output.width), chirp(1, self.output.height));
        // Of each thread: a strip's columns, and convolution and scratch of both axes.
        let thread = 4 * STRIP * self.counts[1].max(self.counts[0]) + 2 * (x + y);
        let samples = self.counts[0] * rows + rayon::current_num_threads() * thread + 2 * (x + y);
        (samples * size_of::<Complex<T>>()) as u64
    }

    /// The field on the output window.
    pub fn propagate(&self, field: &Field<T>, progress: &Progress) -> Result<Field<T>> {
        self.propagate_through(field, None, progress)
    }

    /// The same through a stop in the Fourier plane of a 1:1 relay before the distance.
    pub fn propagate_through(
        &self,
        field: &Field<T>,
        aperture: Option<&Aperture>,
        progress: &Progress,
    ) -> Result<Field<T>> {
        assert_eq!((field.grid, field.wavelength), (self.input, self.wavelength), "the field is the planned one");
        field.check_samples()?;
        progress.check()?;
        let Self { wavelength, distance, .. } = *self;
        let axes = [self.axis(0), self.axis(1)];
        let [x, y] = &axes;
        let zero = Complex::new(T::zero(), T::zero());
        let (height, out_height, out_width) = (self.input.height, self.output.height, self.output.width);
        if x.range.count == 0 || y.range.count == 0 {
            return Ok(Field { grid: self.output, wavelength, samples: vec![zero; self.output.len()] });
        }
        // Rows to frequencies, those in the band.
        let mut rows = vec![zero; height * x.range.count];
        rows.par_chunks_mut(x.range.count).zip(field.samples.par_chunks(self.input.width)).for_each_init(
            || (vec![zero; x.n], self.lines[0].scratch()),
            |(line, scratch), (out, row)| {
                if !progress.stopped() {
                    spectrum(&self.lines[0], row.iter().copied(), line, scratch);
                    x.range.copy(line, out);
                }
            },
        );
        progress.check()?;
        // Columns to frequencies, carried, and back onto the output's rows.
        let mut columns = vec![zero; x.range.count * out_height];
        columns.par_chunks_mut(out_height * STRIP).enumerate().for_each_init(
            || (y.chirp.buffer(), vec![zero; y.n], self.lines[1].scratch()),
            |(buffer, line, scratch), (strip, out)| {
                if progress.stopped() {
                    return;
                }
                let mut lit = vec![zero; y.range.count];
                for (i, out) in out.chunks_exact_mut(out_height).enumerate() {
                    let column = strip * STRIP + i;
                    spectrum(&self.lines[1], rows.iter().skip(column).step_by(x.range.count).copied(), line, scratch);
                    y.range.copy(line, &mut lit);
                    let fx = x.frequency(column);
                    for (k, u) in lit.iter_mut().enumerate() {
                        // Rows run against y.
                        let fy = y.frequency(k);
                        if aperture.is_some_and(|stop| !stop.passes(fx, -fy)) {
                            *u = zero;
                            continue;
                        }
                        let (turns, decay) =
                            turns_and_decay(self.settings.kernel, wavelength, fx * fx + fy * fy, distance);
                        let weight = decay * x.weights[column] * y.weights[k];
                        *u = *u * turned(turns + fx * x.shift + fy * y.shift, weight);
                    }
                    y.chirp.run(&lit, buffer, out);
                }
            },
        );
        drop(rows);
        progress.check()?;
        let mut samples = vec![zero; self.output.len()];
        samples.par_chunks_mut(out_width).enumerate().for_each_init(
            || (x.chirp.buffer(), vec![zero; x.range.count]),
            |(buffer, line), (row, out)| {
                if !progress.stopped() {
                    line.iter_mut().zip(columns.iter().skip(row).step_by(out_height)).for_each(|(u, &c)| *u = c);
                    x.chirp.run(line, buffer, out);
                }
            },
        );
        progress.check()?;
        Ok(Field { grid: self.output, wavelength, samples })
    }

    /// Axis 0 along x, axis 1 along the rows, against y.
    fn axis(&self, axis: usize) -> Axis<T> {
        let (input, output, n) = (&self.input, &self.output, self.counts[axis]);
        let (pitches, m, shift) = if axis == 0 {
            ([input.pitch_x, output.pitch_x], output.width, output.x(0) - input.x(0))
        } else {
            ([input.pitch_y, output.pitch_y], output.height, input.y(0) - output.y(0))
        };
        let half = (n / 2) as i64;
        // The highest frequency of an even number, whose sign is undecided, is left out.
        let (low, high) = (if n % 2 == 0 { 1 - half } else { -half }, n as i64 - half - 1);
        let sign = if axis == 0 { 1 } else { -1 };
        let weight = |k: i64| self.weight(axis, grid::frequency(sign * k, n, pitches[0]));
        let first = (low..=high).find(|&k| weight(k) > DARK).unwrap_or(low);
        let last = (first..=high).rev().find(|&k| weight(k) > DARK);
        let range = Range { first, count: last.map_or(0, |last| (last - first + 1) as usize) };
        let weights = (0..range.count).map(|k| weight(first + k as i64)).collect();
        let chirp = Chirp::new(&range, m, pitches[1] / (n as f64 * pitches[0]), 1.0 / n as f64);
        Axis { n, pitch: pitches[0], range, weights, shift, chirp }
    }
}

/// The transform of samples followed by zeros.
fn spectrum<T: FftNum>(
    plan: &Fft1<T>,
    samples: impl Iterator<Item = Complex<T>>,
    line: &mut [Complex<T>],
    scratch: &mut [Complex<T>],
) {
    line.fill(Complex::new(T::zero(), T::zero()));
    line.iter_mut().zip(samples).for_each(|(u, sample)| *u = sample);
    plan.forward(line, scratch);
}

/// Signed indexes of the frequencies in the band.
#[derive(Clone, Copy, Debug)]
struct Range {
    first: i64,
    count: usize,
}

impl Range {
    /// Copies them, in order, out of a transform.
    fn copy<T: FftNum>(&self, line: &[Complex<T>], out: &mut [Complex<T>]) {
        for (i, u) in out.iter_mut().enumerate() {
            *u = line[(self.first + i as i64).rem_euclid(line.len() as i64) as usize];
        }
    }
}

/// One axis of one propagation.
struct Axis<T: FftNum> {
    n: usize,
    /// Distance of the samples [m]; the period is n times that.
    pitch: f64,
    range: Range,
    /// Of each frequency in the range.
    weights: Vec<f64>,
    /// From the input's first sample to the output's [m].
    shift: f64,
    chirp: Chirp<T>,
}

impl<T: FftNum> Axis<T> {
    /// Frequency of index `k` of the band [cycles/m].
    fn frequency(&self, k: usize) -> f64 {
        grid::frequency(self.range.first + k as i64, self.n, self.pitch)
    }
}

/// Σ_k a_k·exp(i2πα(first + k)m)·scale for m = 0 … M − 1.
struct Chirp<T: FftNum> {
    length: usize,
    /// exp(iπα k²), times the scale.
    before: Vec<Complex<T>>,
    /// exp(iπα m²).
    after: Vec<Complex<T>>,
    /// Transform of exp(−iπα d²), over the length.
    kernel: Vec<Complex<T>>,
    plan: Fft1<T>,
}

impl<T: FftNum> Chirp<T> {
    fn new(range: &Range, m: usize, alpha: f64, scale: f64) -> Self {
        let least = range.count + m;
        let length = fast_length(least, 1, &[1]);
        let plan = Fft1::new(length);
        // d² reaches 1e9 and α is below one: the product is exact to 1e-7 turns in f64 before it is reduced.
        let wave = |index: i64, sign: f64, scale: f64| {
            let square = (index as f64) * (index as f64);
            turned(sign * 0.5 * alpha * square, scale)
        };
        let before = (0..range.count).map(|k| wave(range.first + k as i64, 1.0, scale)).collect();
        let after = (0..m).map(|m| wave(m as i64, 1.0, 1.0)).collect();
        let mut kernel = vec![Complex::new(T::zero(), T::zero()); length];
        // d = m − first − k, at index m − k of the circular convolution; 1/length of the inverse goes in here.
        for offset in -(range.count as i64 - 1)..m as i64 {
            let at = offset.rem_euclid(length as i64) as usize;
            kernel[at] = wave(offset - range.first, -1.0, 1.0 / length as f64);
        }
        plan.forward(&mut kernel, &mut plan.scratch());
        Self { length, before, after, kernel, plan }
    }

    /// Memory for [`Chirp::run`]: the convolution and its transforms' scratch.
    fn buffer(&self) -> [Vec<Complex<T>>; 2] {
        [vec![Complex::new(T::zero(), T::zero()); self.length], self.plan.scratch()]
    }

    fn run(&self, values: &[Complex<T>], [line, scratch]: &mut [Vec<Complex<T>>; 2], out: &mut [Complex<T>]) {
        line[values.len()..].fill(Complex::new(T::zero(), T::zero()));
        for ((u, &value), &chirp) in line.iter_mut().zip(values).zip(&self.before) {
            *u = value * chirp;
        }
        self.plan.forward(line, scratch);
        line.iter_mut().zip(&self.kernel).for_each(|(u, &k)| *u = *u * k);
        self.plan.inverse(line, scratch);
        for ((out, &u), &chirp) in out.iter_mut().zip(line.iter()).zip(&self.after) {
            *out = u * chirp;
        }
    }
}

/// Carries `field` over `distance` [m] onto `output`, of any pitch and place, by the exact angular spectrum.
pub fn propagate_scaled<T: FftNum>(
    field: &Field<T>,
    distance: f64,
    output: Grid,
    progress: &Progress,
) -> Result<Field<T>> {
    ScaledPropagator::new(field.grid, output, field.wavelength, distance, Settings::default())?
        .propagate(field, progress)
}
