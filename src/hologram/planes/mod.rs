//! Spectral wavefront recording planes: the cost of a point no longer grows with its distance from the panel.
//!
//! 1. K planes are laid *inside* the cloud. Each point is painted on its nearest plane with its exact band-limited
//!    wave, which there is small: the product of two one-dimensional kernels from a table ([`table`], [`paint`]).
//! 2. The planes are carried to the panel one after another by the exact angular spectrum ([`spectrum`]): whatever their
//!    number, memory is that of one plane and of the sum.
//! 3. What is not separable in the kernels, e^{i2πd·c(f_x, f_y)} with |d| ≤ h, is a Legendre series in d: rank R paints
//!    the moments a·(d/h)^r, r < R, too, and the spectrum adds them with the factors of the best polynomial of degree
//!    R − 1 over the slab (a Taylor series would err 1.5 times as much at R = 2, 2.5 times at R = 3).
//!
//! Error model, against the definition: e₁ = 0.035·(h/λ)·sin⁴θ_max for R = 1 and e₁^R·(1, 0.57, 0.18 …) beyond, the
//! kernels' cut tails, and the table's interpolation; [`Parameters::error`].

mod paint;
mod spectrum;
mod table;

use super::definition::Optics;
use super::lanes::InstructionSet;
use super::sources::{Source, tilt};
use crate::error::Result;
use crate::field::{Complex32, Field, Grid, zeroed};
use crate::progress::Progress;
use paint::{Brush, Canvas, Dab, paint};
use rayon::prelude::*;
use spectrum::{Layout, Spectrum};
use table::{Fineness, Table, mean_square};

/// How the planes are laid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Parameters {
    /// Number of planes K.
    pub(crate) planes: usize,
    /// Number of moments R.
    pub(crate) rank: usize,
    /// Pixels painted beyond a point's cone.
    pub(crate) tail: f64,
    /// How finely the kernels are tabulated.
    pub(crate) table: Fineness,
}

/// What planes need to know of the sources together, gathered in one pass.
#[derive(Clone, Debug)]
pub(crate) struct Cloud {
    /// The sources whose light meets the panel.
    sources: Vec<Source>,
    /// Smallest and largest signed distance ζ = −z: light runs from −ζ to the panel at 0 [m].
    depths: [f64; 2],
    /// Lowest and highest panel column, and row.
    places: [[f64; 2]; 2],
    /// Period that keeps aliases off the panel, without the tail [px].
    period: [f64; 2],
    /// How much steeper than a whole cone the panel sees the sources, at least 1.
    steepness: f64,
}

impl Cloud {
    /// Gathers the sources whose light meets the panel.
    pub(crate) fn new(optics: &Optics, grid: &Grid, sources: &[Source]) -> Self {
        let meets = |s: &Source| {
            let spans = s.span(grid);
            (0..2).all(|axis| {
                let reach = reach(optics, axis, s.distance) + 64.0 * optics.pitch[axis];
                spans[axis][0] <= reach && spans[axis][1] >= -reach
            })
        };
        let sources: Vec<Source> = sources.par_iter().filter(|s| meets(s)).copied().collect();
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let (mut depths, mut places) = (none, [none; 2]);
        let pixels = [grid.width as f64, grid.height as f64];
        let mut period = pixels;
        for s in &sources {
            let depth = s.sign * s.distance;
            depths = [depths[0].min(depth), depths[1].max(depth)];
            for (axis, at) in [grid.column(s.x), grid.row(s.y)].into_iter().enumerate() {
                places[axis] = [places[axis][0].min(at), places[axis][1].max(at)];
                // An alias, one period away, must lie beyond the point's reach from the farthest pixel.
                let farthest = at.abs().max((pixels[axis] - 1.0 - at).abs());
                period[axis] = period[axis].max(farthest + reach(optics, axis, s.distance) / optics.pitch[axis]);
            }
        }
        let limit = optics.taper.map(|taper| optics.wavelength * taper.limit);
        let steepness = (tilt(&sources, grid, limit) / (limit[0] * limit[1] / 3.0)).max(1.0);
        Self { sources, depths, places, period, steepness }
    }
}

impl Parameters {
    /// Half depth of a slab, h [m].
    fn half_depth(&self, optics: &Optics, cloud: &Cloud) -> f64 {
        (0.5 * (cloud.depths[1] - cloud.depths[0]) / self.planes as f64).max(optics.wavelength)
    }
    /// Predicted relative L2 error of the field; its parts are independent, so their squares add up.
    pub(crate) fn error(&self, optics: &Optics, cloud: &Cloud) -> f64 {
        if cloud.sources.is_empty() {
            return 0.0;
        }
        let sine = optics.taper.map(|taper| (optics.wavelength * taper.limit).powi(2));
        let h = self.half_depth(optics, cloud);
        let first = 0.035 * cloud.steepness * h / optics.wavelength * sine[0] * sine[1];
        let rank = first.powi(self.rank as i32) * [1.0, 0.57, 0.18, 0.046][self.rank.min(4) - 1];
        let narrow = (0..2).map(|axis| optics.cone(axis, h) / optics.pitch[axis]).fold(f64::INFINITY, f64::min);
        let parts = [rank, tail_error(self.tail, narrow), self.table.error()];
        MARGIN * parts.iter().map(|part| part * part).sum::<f64>().sqrt()
    }
    /// The cheapest for a wanted error within a memory budget [bytes], with its cost in core-seconds, or the smallest
    /// where none fits; `None` where up to four moments do not reach the error.
    pub(crate) fn choose(optics: &Optics, grid: &Grid, cloud: &Cloud, error: f64, memory: u64) -> Option<(Self, f64)> {
        let table = if error < 5e-4 { Fineness::Fine } else { Fineness::Coarse };
        let mut best: Option<(Self, f64, u64)> = None;
        for rank in 1..=4 {
            for planes in [1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24, 32] {
                let Some(parameters) = (8..36)
                    .map(|tail| Self { planes, rank, tail: f64::from(tail), table })
                    .find(|parameters| parameters.error(optics, cloud) <= error)
                else {
                    continue;
                };
                let cost = parameters.core_seconds(optics, grid, cloud);
                let bytes = parameters.bytes(optics, grid, cloud);
                let better = |(_, least, size): (Self, f64, u64)| {
                    if size > memory { bytes < size } else { bytes <= memory && cost < least }
                };
                if best.is_none_or(better) {
                    best = Some((parameters, cost, bytes));
                }
            }
        }
        best.map(|(parameters, cost, _)| (parameters, cost))
    }
    /// Predicted work [core-seconds] on the widest instruction set.
    pub(crate) fn core_seconds(&self, optics: &Optics, grid: &Grid, cloud: &Cloud) -> f64 {
        if cloud.sources.is_empty() {
            return 0.0;
        }
        let layout = layout(optics, grid, cloud, self);
        let pixels = (layout.size[0] * layout.size[1]) as f64;
        let h = self.half_depth(optics, cloud);
        // Mean area of a kernel: depths are even over the slab, so widths are even from the tail to tail + cone.
        let area = |axis: usize| {
            let cone = optics.cone(axis, h) / optics.pitch[axis];
            let tail = 2.0 * self.tail + 26.0;
            (tail + cone) + cone * cone / (3.0 * (tail + cone))
        };
        let dab = 0.75e-6 + self.rank as f64 * area(0) * area(1) * 0.1e-9;
        let levels: u64 = (0..2).map(|axis| Table::bytes(optics, axis, h, self.tail, self.table)).sum();
        // The larger the transforms, the less of them stays in caches.
        let pass = 7.5e-9 * (pixels / 5.5e6).powf(0.2);
        let spectra = pixels * pass * ((self.planes * self.rank) as f64 + 1.0);
        spectra + cloud.sources.len() as f64 * dab + levels as f64 * 1e-8
    }
    /// Memory beside points and field [bytes].
    pub(crate) fn bytes(&self, optics: &Optics, grid: &Grid, cloud: &Cloud) -> u64 {
        if cloud.sources.is_empty() {
            return 0;
        }
        let layout = layout(optics, grid, cloud, self);
        let h = self.half_depth(optics, cloud);
        let plane = (self.rank * layout.size[0] * layout.painted * 8) as u64;
        let half = [0, 1].map(|axis| Table::half_width(optics, axis, h, self.tail));
        let axes = if optics.pitch[0] == optics.pitch[1] { 0..1 } else { 0..2 };
        let tables: u64 = axes.map(|axis| Table::bytes(optics, axis, h, self.tail, self.table)).sum();
        let points = cloud.sources.len() as u64 * (size_of::<Source>() + size_of::<Dab>() + paint::ORDER_BYTES) as u64;
        plane + Spectrum::bytes(&layout, self.rank) + paint::bytes(half, self.rank) + tables + points
    }
}

/// Error of kernels cut `tail` pixels beyond a cone of `cone` pixels: the taper's transform, exp(−(0.0895·px)²), times
/// a power, fitted to measured errors at tails of 10 to 22 px and cones of 2 to 124 px.
fn tail_error(tail: f64, cone: f64) -> f64 {
    let at_ten = (6.9e-3 * (8.0 / (cone + 0.1)).sqrt()).max(2.4e-3);
    at_ten * (10.0 / tail).powf(1.3) * (-(0.0895f64.powi(2)) * (tail * tail - 100.0)).exp()
}

/// What the predicted error stands above the measured one of a cloud before the panel, for clouds that show the panel
/// their cones' edges only: 1.69 times measured where eight lanes paint no more than the tail (sixteen paint up to
/// fifteen pixels beyond it, and err a tenth less).
const MARGIN: f64 = 1.85;

/// Where a point's light has died away on the panel, but for the taper's tail [m]: erfc(2.6)/2 = 1.2e-4.
fn reach(optics: &Optics, axis: usize, distance: f64) -> f64 {
    let sine = (optics.wavelength * optics.taper[axis].reach(2.6)).min(0.9);
    distance * sine / (1.0 - sine * sine).sqrt()
}

/// The periodic grid: large enough that no point's light comes round onto the panel.
fn layout(optics: &Optics, grid: &Grid, cloud: &Cloud, parameters: &Parameters) -> Layout {
    let h = parameters.half_depth(optics, cloud);
    let mut layout = Layout { size: [0; 2], painted: 0, origin: [0; 2] };
    for (axis, pixels) in [grid.width as f64, grid.height as f64].into_iter().enumerate() {
        let halo = Table::half_width(optics, axis, h, parameters.tail) as f64 + 18.0;
        let [low, high] = cloud.places[axis];
        let painted = high - low + 2.0 * halo + 2.0;
        let size = pixels.max(cloud.period[axis] + parameters.tail);
        layout.size[axis] = transform_size(size.max(painted).ceil() as usize);
        layout.origin[axis] = (low - halo).floor() as i64;
        if axis == 1 {
            layout.painted = (painted.ceil() as usize).min(layout.size[1]);
        }
    }
    layout
}

/// The smallest 16·2^a·3^b·5^c that is not below `n`: lengths that the transforms are fast at.
fn transform_size(n: usize) -> usize {
    (n.div_ceil(16)..)
        .find(|&m| {
            let mut rest = m;
            for prime in [2, 3, 5] {
                while rest.is_multiple_of(prime) {
                    rest /= prime;
                }
            }
            rest == 1
        })
        .map_or(n, |m| 16 * m)
}

/// The cloud's field on the panel.
pub(crate) fn field(
    grid: &Grid,
    optics: &Optics,
    cloud: &Cloud,
    parameters: &Parameters,
    set: InstructionSet,
    progress: &Progress,
) -> Result<Field> {
    let Cloud { sources, depths, .. } = cloud;
    if sources.is_empty() {
        return Ok(Field::zeros(*grid, optics.wavelength));
    }
    let h = parameters.half_depth(optics, cloud);
    let layout = layout(optics, grid, cloud, parameters);
    progress.start("hologram: planes", sources.len() as u64 + (layout.size[0] * parameters.planes) as u64);
    let same = optics.pitch[0] == optics.pitch[1];
    let table = |axis| Table::new(optics, axis, h, parameters.tail, parameters.table, progress);
    let first = table(0);
    let second = (!same).then(|| table(1));
    let tables = [&first, second.as_ref().unwrap_or(&first)];
    progress.check()?;
    let lambda = optics.wavelength;
    let middle = |k: usize| depths[0] + h * (2 * k + 1) as f64;
    let nearest = |s: &Source| {
        let depth = s.sign * s.distance;
        (((depth - depths[0]) / (2.0 * h)) as usize).min(parameters.planes - 1)
    };
    // The kernels carry exp(i2πd(α − ᾱ)) of each axis: the rest of d·f_z is the point's phase.
    let carrier = 1.0 / lambda
        + tables[0].mean
        + tables[1].mean
        + 0.25 * lambda.powi(3) * mean_square(optics, 0) * mean_square(optics, 1);
    let dab = |s: &Source, middle: f64| {
        let d = s.sign * s.distance - middle;
        let turns = d * carrier + s.turns + 0.25 * s.sign;
        let (sin, cos) = ((turns - turns.round()) * std::f64::consts::TAU).sin_cos();
        let a = s.amplitude * lambda;
        let at = [grid.column(s.x) - layout.origin[0] as f64, grid.row(s.y) - layout.origin[1] as f64];
        Dab { at, d, factor: [(a * cos) as f32, (a * sin) as f32] }
    };
    let slope = [0, 1].map(|axis| optics.cone(axis, 1.0) / optics.pitch[axis]);
    let bin = paint::bin(tables.map(|table| table.half), parameters.rank);
    let brush = Brush { tables, slope, tail: parameters.tail, rank: parameters.rank, depth: h, bin };
    // One plane's moments serve all planes, one after another. Pages are first touched by the threads that clear them.
    let samples = layout.size[0] * layout.painted;
    let mut moments: Vec<Vec<Complex32>> = (0..parameters.rank).map(|_| zeroed(samples)).collect();
    let mut spectrum = Spectrum::new(optics, &layout, h, set);
    for k in 0..parameters.planes {
        let dabs: Vec<Dab> = sources.par_iter().filter(|s| nearest(s) == k).map(|s| dab(s, middle(k))).collect();
        if dabs.is_empty() {
            continue;
        }
        for moment in &mut moments {
            moment.par_chunks_mut(1 << 16).for_each(|part| {
                if !progress.stopped() {
                    part.fill(Complex32::default());
                }
            });
        }
        let mut canvas = Canvas { width: layout.size[0], moments: &mut moments };
        paint(&mut canvas, &brush, &dabs, set, progress)?;
        spectrum.add(middle(k), &mut moments, progress)?;
    }
    spectrum.finish(grid, progress)
}
