//! Spectral wavefront recording planes: the cost of a point no longer grows with its distance from the panel.
//!
//! 1. K planes are laid *inside* the cloud. Each point is painted on its nearest plane with its exact band-limited
//!    wave, which there is small: the product of two one-dimensional kernels from a table ([`table`], [`paint`]).
//! 2. The planes are carried to the panel by the exact angular spectrum, in one pass ([`spectrum`]).
//! 3. What is not separable in the kernels, e^{i2πd·c(f_x, f_y)} with |d| ≤ h, is a Taylor series in d: rank R paints
//!    the moments a·(d/h)^r, r < R, too, and the spectrum adds them with their exact factor.
//!
//! Error model, against the definition: e₁ = 0.035·(h/λ)·sin⁴θ_max for R = 1 and e₁^R·(1, 0.85, 0.45 …) beyond, the
//! kernels' cut tails, and the table's interpolation; [`Parameters::error`].

mod paint;
mod spectrum;
mod table;

use super::definition::Optics;
use super::lanes::InstructionSet;
use super::sources::{Source, tilt};
use crate::error::Result;
use crate::field::{Complex32, Field, Grid};
use crate::progress::Progress;
use paint::{Brush, Canvas, Dab, paint};
use rayon::prelude::*;
use spectrum::{Layout, Plane, propagate};
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

/// Signed distances ζ = −z of the sources that are met: light runs from −ζ to the panel at 0.
fn depths(sources: &[Source]) -> [f64; 2] {
    sources.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], s| {
        let depth = s.sign * s.distance;
        [low.min(depth), high.max(depth)]
    })
}

impl Parameters {
    /// Half depth of a slab, h [m].
    fn half_depth(&self, optics: &Optics, depths: [f64; 2]) -> f64 {
        (0.5 * (depths[1] - depths[0]) / self.planes as f64).max(optics.wavelength)
    }
    /// Predicted relative L2 error of the field; its parts are independent, so their squares add up. `steepness` is
    /// that of [`steepness`].
    pub(crate) fn error(&self, optics: &Optics, sources: &[Source], steepness: f64) -> f64 {
        if sources.is_empty() {
            return 0.0;
        }
        let sine = optics.taper.map(|taper| (optics.wavelength * taper.limit).powi(2));
        let h = self.half_depth(optics, depths(sources));
        let first = 0.035 * steepness * h / optics.wavelength * sine[0] * sine[1];
        let rank = first.powi(self.rank as i32) * [1.0, 0.85, 0.45, 0.2][self.rank.min(4) - 1];
        let narrow = (0..2).map(|axis| optics.cone(axis, h) / optics.pitch[axis]).fold(f64::INFINITY, f64::min);
        let parts = [rank, tail_error(self.tail, narrow), self.table.error()];
        MARGIN * parts.iter().map(|part| part * part).sum::<f64>().sqrt()
    }
    /// The cheapest for a wanted error within a memory budget [bytes], with its cost in core-seconds, or the smallest
    /// where none fits; `None` where up to four moments do not reach the error.
    pub(crate) fn choose(
        optics: &Optics,
        grid: &Grid,
        sources: &[Source],
        error: f64,
        memory: u64,
    ) -> Option<(Self, f64)> {
        let table = if error < 5e-4 { Fineness::Fine } else { Fineness::Coarse };
        let steepness = steepness(optics, grid, sources);
        let mut best: Option<(Self, f64, u64)> = None;
        for rank in 1..=4 {
            for planes in [1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24, 32] {
                let Some(parameters) = (8..36)
                    .map(|tail| Self { planes, rank, tail: f64::from(tail), table })
                    .find(|parameters| parameters.error(optics, sources, steepness) <= error)
                else {
                    continue;
                };
                let cost = parameters.core_seconds(optics, grid, sources);
                let bytes = parameters.bytes(optics, grid, sources);
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
    pub(crate) fn core_seconds(&self, optics: &Optics, grid: &Grid, sources: &[Source]) -> f64 {
        if sources.is_empty() {
            return 0.0;
        }
        let layout = layout(optics, grid, sources, self);
        let pixels = (layout.size[0] * layout.size[1]) as f64;
        let h = self.half_depth(optics, depths(sources));
        // Mean area of a kernel: depths are even over the slab, so widths are even from the tail to tail + cone.
        let area = |axis: usize| {
            let cone = optics.cone(axis, h) / optics.pitch[axis];
            let tail = 2.0 * self.tail + 26.0;
            (tail + cone) + cone * cone / (3.0 * (tail + cone))
        };
        let dab = 1.0e-6 + self.rank as f64 * area(0) * area(1) * 0.13e-9;
        let levels: u64 = (0..2).map(|axis| Table::bytes(optics, axis, h, self.tail, self.table)).sum();
        pixels * 5.5e-9 * ((self.planes * self.rank) as f64 + 1.0) + sources.len() as f64 * dab + levels as f64 * 1e-8
    }
    /// Memory beside points and field [bytes].
    pub(crate) fn bytes(&self, optics: &Optics, grid: &Grid, sources: &[Source]) -> u64 {
        if sources.is_empty() {
            return 0;
        }
        let layout = layout(optics, grid, sources, self);
        let h = self.half_depth(optics, depths(sources));
        let planes = self.planes * self.rank * layout.size[0] * layout.painted * 8;
        let turned = layout.size[0] * grid.height * 8;
        let side = |axis: usize| 2 * Table::half_width(optics, axis, h, self.tail) + paint::BIN + 16;
        let patches = 64 * side(0) * side(1) * 8 * self.rank;
        let tables: u64 = (0..2).map(|axis| Table::bytes(optics, axis, h, self.tail, self.table)).sum();
        (planes + turned + patches + sources.len() * 72) as u64 + tables
    }
}

/// Error of kernels cut `tail` pixels beyond a cone of `cone` pixels: the taper's transform, exp(−(0.0895·px)²), times
/// a power, fitted to measured errors at tails of 10 to 22 px and cones of 2 to 124 px.
fn tail_error(tail: f64, cone: f64) -> f64 {
    let at_ten = (6.9e-3 * (8.0 / (cone + 0.1)).sqrt()).max(2.4e-3);
    at_ten * (10.0 / tail).powf(1.3) * (-(0.0895f64.powi(2)) * (tail * tail - 100.0)).exp()
}

/// What the predicted error stands above the measured one of a cloud before the panel, for clouds that show the panel
/// their cones' edges only.
const MARGIN: f64 = 1.6;

/// How much steeper than a whole cone the panel sees the sources, at least 1.
pub(crate) fn steepness(optics: &Optics, grid: &Grid, sources: &[Source]) -> f64 {
    let limit = optics.taper.map(|taper| optics.wavelength * taper.limit);
    (tilt(sources.iter(), grid, limit) / (limit[0] * limit[1] / 3.0)).max(1.0)
}

/// Sources whose light meets the panel.
pub(crate) fn met(optics: &Optics, grid: &Grid, sources: &[Source]) -> Vec<Source> {
    let meets = |s: &Source| {
        let spans = s.span(grid);
        (0..2).all(|axis| {
            let reach = reach(optics, axis, s.distance) + 64.0 * optics.pitch[axis];
            spans[axis][0] <= reach && spans[axis][1] >= -reach
        })
    };
    sources.iter().filter(|s| meets(s)).copied().collect()
}

/// Where a point's light has died away on the panel, but for the taper's tail [m]: erfc(2.6)/2 = 1.2e-4.
fn reach(optics: &Optics, axis: usize, distance: f64) -> f64 {
    let sine = (optics.wavelength * optics.taper[axis].reach(2.6)).min(0.9);
    distance * sine / (1.0 - sine * sine).sqrt()
}

/// The periodic grid: large enough that no point's light comes round onto the panel.
fn layout(optics: &Optics, grid: &Grid, sources: &[Source], parameters: &Parameters) -> Layout {
    let h = parameters.half_depth(optics, depths(sources));
    let mut layout = Layout { size: [0; 2], painted: 0, origin: [0; 2] };
    for (axis, pixels) in [grid.width as f64, grid.height as f64].into_iter().enumerate() {
        let halo = Table::half_width(optics, axis, h, parameters.tail) as f64 + 18.0;
        let (mut low, mut high, mut size) = (f64::INFINITY, f64::NEG_INFINITY, pixels);
        for s in sources {
            let at = if axis == 0 { grid.column(s.x) } else { grid.row(s.y) };
            (low, high) = (low.min(at), high.max(at));
            // An alias, one period away, must lie beyond the point's reach from the farthest pixel.
            let farthest = at.abs().max((pixels - 1.0 - at).abs());
            size = size.max(farthest + reach(optics, axis, s.distance) / optics.pitch[axis] + parameters.tail);
        }
        let painted = high - low + 2.0 * halo + 2.0;
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

/// Adds sources to the field; they are those that [`met`] leaves.
pub(crate) fn add(
    field: &mut Field,
    optics: &Optics,
    sources: &[Source],
    parameters: &Parameters,
    set: InstructionSet,
    progress: &Progress,
) -> Result<()> {
    if sources.is_empty() {
        return Ok(());
    }
    let grid = field.grid;
    let depths = depths(sources);
    let h = parameters.half_depth(optics, depths);
    let layout = layout(optics, &grid, sources, parameters);
    progress.start("hologram: planes", sources.len() as u64 + layout.size[0] as u64);
    let same = optics.pitch[0] == optics.pitch[1];
    let table = |axis| Table::new(optics, axis, h, parameters.tail, parameters.table);
    let first = table(0);
    let second = (!same).then(|| table(1));
    let tables = [&first, second.as_ref().unwrap_or(&first)];
    progress.check()?;
    let lambda = optics.wavelength;
    let middle = |k: usize| depths[0] + h * (2 * k + 1) as f64;
    let nearest = |depth: f64| (((depth - depths[0]) / (2.0 * h)) as usize).min(parameters.planes - 1);
    // The kernels carry exp(i2πd(α − ᾱ)) of each axis: the rest of d·f_z is the point's phase.
    let carrier = 1.0 / lambda
        + tables[0].mean
        + tables[1].mean
        + 0.25 * lambda.powi(3) * mean_square(optics, 0) * mean_square(optics, 1);
    let mut dabs: Vec<Vec<Dab>> = vec![Vec::new(); parameters.planes];
    for s in sources {
        let depth = s.sign * s.distance;
        let k = nearest(depth);
        let d = depth - middle(k);
        let turns = d * carrier + s.turns + 0.25 * s.sign;
        let (sin, cos) = ((turns - turns.round()) * std::f64::consts::TAU).sin_cos();
        let a = s.amplitude * lambda;
        let at = [grid.column(s.x) - layout.origin[0] as f64, grid.row(s.y) - layout.origin[1] as f64];
        dabs[k].push(Dab { at, d, factor: [(a * cos) as f32, (a * sin) as f32] });
    }
    let slope = [0, 1].map(|axis| optics.cone(axis, 1.0) / optics.pitch[axis]);
    let brush = Brush { tables, slope, tail: parameters.tail, rank: parameters.rank, depth: h };
    let mut planes = Vec::new();
    for (k, dabs) in dabs.iter().enumerate().filter(|(_, dabs)| !dabs.is_empty()) {
        let mut moments: Vec<Vec<Complex32>> = Vec::new();
        for _ in 0..parameters.rank {
            let mut plane = vec![Complex32::default(); layout.size[0] * layout.painted];
            // Pages are touched in parallel here instead of one by one while painting.
            plane.par_chunks_mut(1 << 16).for_each(|part| part.fill(Complex32::default()));
            moments.push(plane);
        }
        let mut canvas = Canvas { width: layout.size[0], moments: &mut moments };
        if !paint(&mut canvas, &brush, dabs, set, progress) {
            progress.check()?;
        }
        planes.push(Plane { distance: middle(k), moments });
    }
    propagate(field, optics, &layout, &mut planes, h, set, progress)
}
