//! Near points: the definition's integral at single places, as products of one-dimensional sums.
//!
//! As in [`crate::hologram::near`], f_z at a node of f_y² gives the integrand's part along x, and Lagrange's polynomials over
//! the nodes its part along y; here in double precision throughout, with as many nodes as 1e-7 takes.

use super::real::cis;
use crate::field::{Complex64, Grid};
use crate::hologram::Cull;
use crate::hologram::definition::Optics;
use crate::hologram::sources::PointWave;
use std::f64::consts::{PI, TAU};

/// Error at which the expansion is cut.
pub(super) const ACCURACY: f64 = 1e-7;

/// Error of the far form up to which it stands for the integral, whatever is asked.
const FAR: f64 = 2e-5;

/// Fresnel number of the taper's edge below which the far form is not used, whatever its error.
const NEAREST_EDGE: f64 = 0.94;

/// Most nodes: beyond, the far form is exact enough for any pitch.
const MOST: usize = 400;

/// Time of one term [core-seconds].
const TERM: f64 = 1e-8;

pub(super) struct Near;

impl Near {
    /// Whether a point at this distance is integrated where the far form may err by so much.
    pub(super) fn is_needed(optics: &Optics, cull: Cull, distance: f64, error: f64) -> bool {
        let far = optics.far_error(distance) <= FAR.max(error) && optics.edge_fresnel_number(distance) >= NEAREST_EDGE;
        cull == Cull::Soft && !far
    }

    /// Number of nodes.
    fn rank(optics: &Optics, distance: f64) -> usize {
        let [a, b] = optics.taper.map(|taper| (optics.wavelength * taper.limit).powi(2));
        let (root_a, root_b, root) = ((1.0 - a).sqrt(), (1.0 - b).sqrt(), (1.0 - a - b).sqrt());
        let residual = a * b * (1.0 / (root + root_b) + 1.0 / (1.0 + root_a)) / ((1.0 + root_b) * (root + root_a));
        // The taper's tail lies a seventh beyond its limit; the residual goes with the fourth power.
        let kappa = 1.7 * TAU * distance / optics.wavelength * residual + (root_a * root_b / root).ln().max(1e-9);
        let mut error = 2.0;
        (1..MOST)
            .find(|&rank| {
                error *= kappa / 4.0 / rank as f64;
                error <= ACCURACY && rank as f64 > kappa / 4.0
            })
            .unwrap_or(MOST)
    }

    /// Where the field has died away [m] and the number of frequencies on one side of zero.
    fn lattice(optics: &Optics, axis: usize, distance: f64) -> (f64, usize) {
        let taper = optics.taper[axis];
        let reach = optics.spread(axis, distance, optics.taper.map(|taper| taper.reach(3.2))) + 1.67 / taper.width;
        (reach, (2.1 * reach * taper.reach(5.0)).ceil() as usize + 4)
    }

    /// Columns or rows that a point reaches.
    fn span(optics: &Optics, grid: &Grid, axis: usize, source: &PointWave) -> Option<std::ops::Range<usize>> {
        let reach = Self::lattice(optics, axis, source.distance).0 / optics.pitch[axis];
        let (at, count) = match axis {
            0 => (grid.column(source.x), grid.width),
            _ => (grid.row(source.y), grid.height),
        };
        let (first, end) = ((at - reach).ceil().max(0.0), (at + reach).floor() + 1.0);
        (first < end.min(count as f64)).then(|| first as usize..(end as usize).min(count))
    }

    /// Columns, rows and terms of the lines of a point.
    fn line_sizes(optics: &Optics, grid: &Grid, source: &PointWave) -> [f64; 3] {
        let length = |axis: usize| Self::span(optics, grid, axis, source).map_or(0.0, |span| span.len() as f64);
        [length(0), length(1), Self::rank(optics, source.distance) as f64]
    }

    /// Memory of a point's [`Lines`] [bytes].
    pub(super) fn line_bytes(optics: &Optics, grid: &Grid, source: &PointWave) -> usize {
        let [columns, rows, rank] = Self::line_sizes(optics, grid, source);
        (16.0 * rank * (columns + rows)) as usize
    }

    /// Work for all pixels that a point reaches [core-seconds].
    pub(super) fn whole_seconds(optics: &Optics, grid: &Grid, source: &PointWave) -> f64 {
        let [columns, rows, rank] = Self::line_sizes(optics, grid, source);
        let [x, y] = [0, 1].map(|axis| Self::lattice(optics, axis, source.distance).1 as f64);
        (columns * x + rows * y) * (3e-9 + 1e-9 * rank) + rank * (columns * rows * 1.2e-9 + (x + y) * TERM)
    }

    /// Expected work for a pixel anywhere [core-seconds].
    pub(super) fn core_seconds(optics: &Optics, grid: &Grid, source: &PointWave) -> f64 {
        let (x, y) = (Self::lattice(optics, 0, source.distance), Self::lattice(optics, 1, source.distance));
        let met = (2.0 * x.0 / grid.extent_x()).min(1.0) * (2.0 * y.0 / grid.extent_y()).min(1.0);
        met * Self::rank(optics, source.distance) as f64 * (x.1 + y.1) as f64 * TERM
    }

    /// Adds a point's field at places [m] to their sums.
    pub(super) fn add(optics: &Optics, source: &PointWave, places: &[[f64; 2]], sums: &mut [Complex64]) {
        let axes = [Self::lattice(optics, 0, source.distance), Self::lattice(optics, 1, source.distance)];
        let offset = |place: &[f64; 2]| [place[0] - source.x, place[1] - source.y];
        let meets = |d: [f64; 2]| d[0].abs() <= axes[0].0 && d[1].abs() <= axes[1].0;
        if !places.iter().any(|place| meets(offset(place))) {
            return;
        }
        let parts = Parts::new(optics, source.distance, [axes[0].1, axes[1].1]);
        for (place, sum) in places.iter().zip(sums) {
            let d = offset(place);
            if meets(d) {
                let diverging = parts.at(d);
                let wave = if source.sign < 0.0 { diverging.conj() } else { diverging };
                *sum += wave * Complex64::cis(source.turns * TAU) * source.amplitude;
            }
        }
    }
}

/// The field of a point on the pixels that it reaches: Σ_n x[n]·y[n], column by row.
pub(super) struct Lines {
    first: [usize; 2],
    x: Vec<Vec<Complex64>>,
    y: Vec<Vec<Complex64>>,
}

impl Lines {
    /// `None` for a point that reaches no pixel.
    pub(super) fn new(optics: &Optics, grid: &Grid, source: &PointWave) -> Option<Self> {
        let counts = [0, 1].map(|axis| Near::lattice(optics, axis, source.distance).1);
        let (columns, rows) = (Near::span(optics, grid, 0, source)?, Near::span(optics, grid, 1, source)?);
        let parts = Parts::new(optics, source.distance, counts);
        let factor = Complex64::cis(source.turns * TAU) * source.amplitude;
        let turned = |u: Complex64| if source.sign < 0.0 { u.conj() } else { u };
        let lines = |axis: usize, spectra: &[Vec<Complex64>], places: Vec<f64>| -> Vec<Vec<Complex64>> {
            let mut lines = vec![Vec::with_capacity(places.len()); spectra.len()];
            for place in places {
                let cosines = parts.cosines(axis, place);
                for (line, spectrum) in lines.iter_mut().zip(spectra) {
                    let u = along(spectrum, &cosines);
                    line.push(turned(u) * if axis == 0 { factor } else { Complex64::from(1.0) });
                }
            }
            lines
        };
        let x = lines(0, &parts.x, columns.clone().map(|column| grid.x(column) - source.x).collect());
        let y = lines(1, &parts.y, rows.clone().map(|row| grid.y(row) - source.y).collect());
        Some(Self { first: [columns.start, rows.start], x, y })
    }

    /// Adds one row of the grid.
    pub(super) fn add_row(&self, row: usize, samples: &mut [Complex64]) {
        let Some(row) = row.checked_sub(self.first[1]).filter(|row| *row < self.y[0].len()) else { return };
        let samples = &mut samples[self.first[0]..][..self.x[0].len()];
        for (x, y) in self.x.iter().zip(&self.y) {
            let y = y[row];
            samples.iter_mut().zip(x).for_each(|(u, x)| *u += x * y);
        }
    }
}

/// The one-dimensional spectra of a point: for each node those along x and y.
struct Parts {
    x: Vec<Vec<Complex64>>,
    y: Vec<Vec<Complex64>>,
    step: [f64; 2],
}

impl Parts {
    fn new(optics: &Optics, distance: f64, counts: [usize; 2]) -> Self {
        let rank = Near::rank(optics, distance);
        let tops = optics.taper.map(|taper| taper.reach(5.0));
        let step = [tops[0] / counts[0] as f64, tops[1] / counts[1] as f64];
        let line = |axis: usize| -> Vec<(f64, f64)> {
            let frequency = |k: usize| (k as f64 + 0.5) * step[axis];
            (0..counts[axis]).map(|k| (frequency(k), 2.0 * step[axis] * optics.taper[axis].at(frequency(k)))).collect()
        };
        let (fx, fy) = (line(0), line(1));
        let highest = tops[1] * tops[1];
        let angle = |n: usize| PI * (n as f64 + 0.5) / rank as f64;
        let nodes: Vec<f64> = (0..rank).map(|n| 0.5 * highest * (1.0 - angle(n).cos())).collect();
        // Barycentric weights of Chebyshev's nodes of the first kind.
        let weights: Vec<f64> = (0..rank).map(|n| if n % 2 == 0 { angle(n).sin() } else { -angle(n).sin() }).collect();
        let inverse = 1.0 / optics.wavelength;
        let fz = |square: f64| (inverse * inverse - square).max(0.0).sqrt();
        let x = nodes.iter().map(|&node| {
            let at_node = fz(node);
            let z: Vec<f64> = fx.iter().map(|(f, _)| fz(f * f + node)).collect();
            let turns: Vec<f64> = z.iter().map(|z| distance * (z - at_node)).collect();
            let weights = fx.iter().zip(&z).map(|((_, w), z)| w * at_node / z);
            cis(&turns).into_iter().zip(weights).map(|(wave, weight)| wave * weight).collect()
        });
        let x = x.collect();
        let mut y = vec![Vec::with_capacity(fy.len()); rank];
        let turns: Vec<f64> = fy.iter().map(|(f, _)| distance * fz(f * f)).collect();
        for (&(f, w), wave) in fy.iter().zip(cis(&turns)) {
            let wave = Complex64::i() * wave * (w / fz(f * f));
            let terms: Vec<f64> = nodes.iter().zip(&weights).map(|(node, weight)| weight / (f * f - node)).collect();
            let all: f64 = terms.iter().sum();
            let exactly = terms.iter().position(|term| !term.is_finite());
            for (n, line) in y.iter_mut().enumerate() {
                line.push(wave * exactly.map_or(terms[n] / all, |at| f64::from(u8::from(at == n))));
            }
        }
        Self { x, y, step }
    }

    /// The integral at an offset [m].
    fn at(&self, d: [f64; 2]) -> Complex64 {
        let (cx, cy) = (self.cosines(0, d[0]), self.cosines(1, d[1]));
        self.x.iter().zip(&self.y).map(|(x, y)| along(x, &cx) * along(y, &cy)).sum()
    }

    /// cos 2πfΔ of an axis' frequencies.
    fn cosines(&self, axis: usize, offset: f64) -> Vec<f64> {
        let count = [&self.x, &self.y][axis][0].len();
        let turns: Vec<f64> = (0..count).map(|k| (k as f64 + 0.5) * self.step[axis] * offset).collect();
        cis(&turns).into_iter().map(|wave| wave.re).collect()
    }
}

/// ∫ of an even spectrum along one axis.
fn along(spectrum: &[Complex64], cosines: &[f64]) -> Complex64 {
    // Four sums side by side: one alone would wait for itself.
    let mut sums = [Complex64::default(); 4];
    let (fours, fours_of) = (spectrum.chunks_exact(4), cosines.chunks_exact(4));
    let rest =
        fours.remainder().iter().zip(fours_of.remainder()).map(|(value, cosine)| value * cosine).sum::<Complex64>();
    for (values, cosines) in fours.zip(fours_of) {
        for i in 0..4 {
            sums[i] += values[i] * cosines[i];
        }
    }
    rest + (sums[0] + sums[1]) + (sums[2] + sums[3])
}
