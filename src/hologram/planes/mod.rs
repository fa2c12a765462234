//! Spectral wavefront recording planes: the cost of a point no longer grows with its distance from the panel.
//!
//! 1. K planes are laid *inside* the cloud, where it has points ([`slabs`]). Each point is painted on its nearest plane with its exact band-limited
//!    wave, which there is small: the product of two one-dimensional kernels from a table ([`table`], [`paint`]).
//! 2. The planes are carried to the panel one after another by the exact angular spectrum ([`spectrum`]): whatever their
//!    number, memory is that of one plane and of the sum.
//! 3. What is not separable in the kernels, e^{i2πd·c(f_x, f_y)} with |d| ≤ h, is a Legendre series in d: rank R paints
//!    the moments a·(d/h)^r, r < R, too, and the spectrum adds them with the factors of the best polynomial of degree
//!    R − 1 over the slab (a Taylor series would err 1.5 times as much at R = 2, 2.5 times at R = 3).
//!
//! Error model, against the definition: e₁ = 0.035·(h/λ)·sin⁴θ_max for R = 1 and e₁^R·(1, 0.57, 0.18 …) beyond, more where
//! sines are large, the kernels' cut tails, and the table's interpolation; [`Parameters::error`].

mod cost;
mod paint;
mod slabs;
mod spectrum;
mod table;

use super::definition::Optics;
use super::lanes::InstructionSet;
use super::sources::{PointWave, tilt};
use crate::error::Result;
use crate::field::{Complex32, Field, Grid, fast_length, zeroed};
use crate::progress::Progress;
use paint::{Brush, Canvas, Patches, paint};
use rayon::prelude::*;
use slabs::Depths;
use spectrum::Spectrum;
use std::borrow::Cow;
use std::sync::Arc;

pub(in crate::hologram) use paint::Splat;
pub(in crate::hologram) use slabs::Slabs;
pub(in crate::hologram) use spectrum::PlaneGrid;
pub(in crate::hologram) use table::{Fineness, Table, mean_square};

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

/// Parameters that keep an error, and what they take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Chosen {
    pub(crate) parameters: Parameters,
    /// Predicted relative L2 error of the field.
    pub(crate) error: f64,
    /// Predicted work on the widest instruction set [core-seconds].
    pub(crate) core_seconds: f64,
    /// Memory beside points and field [bytes].
    pub(crate) bytes: u64,
}

/// What planes need to know of the sources together, gathered in one pass.
#[derive(Clone, Debug)]
pub(crate) struct Cloud<'a> {
    pub(in crate::hologram) optics: &'a Optics,
    /// The panel.
    pub(in crate::hologram) grid: &'a Grid,
    /// The sources whose light meets the panel; copied only where some do not.
    pub(in crate::hologram) sources: Cow<'a, [PointWave]>,
    /// Light by signed distance ζ = −z: it runs from −ζ to the panel at 0 [m].
    depths: Depths,
    /// Lowest and highest panel column, and row.
    places: [[f64; 2]; 2],
    /// Period that keeps aliases off the panel, without the tail [px].
    period: [f64; 2],
    /// How much steeper than a whole cone the panel sees the sources, at least 1.
    steepness: f64,
}

impl<'a> Cloud<'a> {
    /// Gathers the sources whose light meets the panel.
    pub(crate) fn new(optics: &'a Optics, grid: &'a Grid, sources: &'a [PointWave]) -> Self {
        let slopes = [0, 1].map(|axis| reach(optics, axis, 1.0));
        let meets = |s: &PointWave| {
            let spans = s.span(grid);
            (0..2).all(|axis| {
                let reach = slopes[axis] * s.distance + 64.0 * optics.pitch[axis];
                spans[axis][0] <= reach && spans[axis][1] >= -reach
            })
        };
        let sources = if sources.par_iter().all(meets) {
            Cow::Borrowed(sources)
        } else {
            Cow::Owned(sources.par_iter().filter(|s| meets(s)).copied().collect())
        };
        let pixels = [grid.width as f64, grid.height as f64];
        // Lowest and highest place, and period, of each axis: whatever the order, the same.
        let one = |s: &PointWave| {
            let at = [grid.column(s.x), grid.row(s.y)];
            [0, 1].map(|axis| {
                // An alias, one period away, must lie beyond the point's reach from the farthest pixel.
                let farthest = at[axis].abs().max((pixels[axis] - 1.0 - at[axis]).abs());
                [at[axis], at[axis], farthest + slopes[axis] * s.distance / optics.pitch[axis]]
            })
        };
        let none = pixels.map(|pixels| [f64::INFINITY, f64::NEG_INFINITY, pixels]);
        let wider = |a: [f64; 3], b: [f64; 3]| [a[0].min(b[0]), a[1].max(b[1]), a[2].max(b[2])];
        let axes = sources.par_iter().map(one).reduce(|| none, |a, b| [wider(a[0], b[0]), wider(a[1], b[1])]);
        let places = axes.map(|[low, high, _]| [low, high]);
        let period = axes.map(|[_, _, period]| period);
        let limit = optics.taper.map(|taper| optics.wavelength * taper.limit);
        let steepness = (tilt(&sources, grid, limit) / (limit[0] * limit[1] / 3.0)).max(1.0);
        let depths = Depths::new(&sources, |s| (s.sign * s.distance, s.amplitude));
        Self { optics, grid, sources, depths, places, period, steepness }
    }
}

impl Parameters {
    /// Kernels along x and y, one table for both where they are the same; `half` is the slabs' half depth [m].
    pub(in crate::hologram) fn tables(&self, optics: &Optics, half: f64, progress: &Progress) -> [Arc<Table>; 2] {
        let table = |axis| Table::new(optics, axis, half, self.tail, self.table, progress);
        let first = table(0);
        let second = if is_square(optics) { Arc::clone(&first) } else { table(1) };
        [first, second]
    }
    /// Memory of each of the tables that there are [bytes].
    pub(in crate::hologram) fn table_bytes(&self, optics: &Optics, half: f64) -> Vec<u64> {
        let axes = if is_square(optics) { 0..1 } else { 0..2 };
        axes.map(|axis| Table::bytes(optics, axis, half, self.tail, self.table)).collect()
    }
    /// Where the planes stand.
    pub(in crate::hologram) fn slabs(&self, cloud: &Cloud) -> Slabs {
        cloud.depths.slabs(self.planes, cloud.optics.wavelength)
    }
    /// Predicted relative L2 error of the field.
    pub(crate) fn error(&self, cloud: &Cloud) -> f64 {
        let slabs = self.slabs(cloud);
        self.error_with(cloud, &slabs, cloud.depths.unevenness(&slabs, self.rank))
    }
    /// Its parts are independent, so their squares add up.
    fn error_with(&self, cloud: &Cloud, slabs: &Slabs, unevenness: f64) -> f64 {
        if cloud.sources.is_empty() {
            return 0.0;
        }
        let optics = cloud.optics;
        let sine = optics.taper.map(|taper| (optics.wavelength * taper.limit).powi(2));
        let h = slabs.half;
        let more = inseparable(sine);
        let first = 0.035 * cloud.steepness * h / optics.wavelength * sine[0] * sine[1] * more;
        // The series of moments converges ever more slowly, and in the corners of a wide band later than elsewhere.
        let slow = 1.0 - first / CONVERGING;
        if slow <= 0.0 {
            return f64::INFINITY;
        }
        let power = self.rank as i32;
        let scale = [1.0, 0.57, 0.18, 0.046][self.rank.min(4) - 1] * (more / slow).powi(power - 1);
        let rank = first.powi(power) * scale * unevenness;
        // A kernel is as wide as its band is narrow: where that ends below half a cycle a pixel, in more pixels.
        let tail = |axis: usize| {
            let filled = optics.filled(axis);
            tail_error(self.tail * filled, optics.cone(axis, h) / optics.pitch[axis] * filled)
        };
        let parts = [rank, tail(0).max(tail(1)), self.table.error()];
        // Points in one place have their errors in one place, too: measured up to 1.55 times those of scattered ones.
        let crowded = if cloud.places.iter().all(|[low, high]| high - low < 4.0) { 1.6 } else { 1.0 };
        crowded * more * margin(cloud.steepness) * parts.iter().map(|part| part * part).sum::<f64>().sqrt()
    }
    /// The cheapest for a wanted error within a memory budget [bytes], or the smallest where none fits; `None` where up to
    /// four moments do not reach the error.
    pub(crate) fn choose(cloud: &Cloud, error: f64, memory: u64) -> Option<Chosen> {
        let table = if error < 5e-4 { Fineness::Fine } else { Fineness::Coarse };
        let mut best: Option<Chosen> = None;
        let mut most = 0;
        for count in [1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 24, 32] {
            let slabs = cloud.depths.slabs(count, cloud.optics.wavelength);
            // Layers, or one depth, need no more planes than there are.
            let planes = slabs.depths.len().max(1);
            if std::mem::replace(&mut most, planes) == planes {
                break;
            }
            for rank in 1..=4 {
                let unevenness = cloud.depths.unevenness(&slabs, rank);
                let good = (8..36)
                    .map(|tail| Self { planes, rank, tail: f64::from(tail), table })
                    .map(|parameters| (parameters, parameters.error_with(cloud, &slabs, unevenness)))
                    .find(|(_, found)| *found <= error);
                let Some((parameters, found)) = good else { continue };
                let core_seconds = parameters.core_seconds(cloud, &slabs);
                let bytes = parameters.bytes(cloud, &slabs);
                let better = |best: &Chosen| {
                    if best.bytes > memory {
                        bytes < best.bytes
                    } else {
                        bytes <= memory && core_seconds < best.core_seconds
                    }
                };
                if best.as_ref().is_none_or(better) {
                    best = Some(Chosen { parameters, error: found, core_seconds, bytes });
                }
            }
        }
        best
    }
}

/// e₁ from which on more moments do not help.
const CONVERGING: f64 = 0.5;

/// Error of kernels cut `tail` pixels beyond a cone of `cone` pixels: the taper's transform, exp(−(0.0895·px)²), times
/// a power, fitted to measured errors at tails of 10 to 22 px and cones of 2 to 124 px.
fn tail_error(tail: f64, cone: f64) -> f64 {
    // Shorter ones than that err more than the fit says, measured down to eight.
    let short = 1.0 + 0.12 * (12.0 - tail).max(0.0);
    let at_ten = (6.9e-3 * (8.0 / (cone + 0.1)).sqrt()).max(2.4e-3);
    short * at_ten * (10.0 / tail).powf(1.3) * (-(0.0895f64.powi(2)) * (tail * tail - 100.0)).exp()
}

/// How much larger what is not separable of f_z is than its first term λ³ f_x² f_y²/4, near the band's corner, from the
/// squares of its sines: 1.004 at 8 µm, 3 at the finest pitches.
fn inseparable(sine: [f64; 2]) -> f64 {
    let [a, b] = sine.map(|square| (1.21 * square).min(0.49));
    4.0 * ((1.0 - a).sqrt() + (1.0 - b).sqrt() - 1.0 - (1.0 - a - b).sqrt()) / (a * b)
}

/// What the stated error stands above the model's, by how steeply the panel sees the cloud (1 whole cones, 3 nothing but
/// their corners): towards the corners the light fades and the kernels' cut tails do not. Measured at most 1.36 up to a
/// steepness of 1.5, 1.9 at 2.0, 3.8 at 2.4 and 7.1 at 2.74, on clouds that are shifted out of the panel's view.
fn margin(steepness: f64) -> f64 {
    let corner = (0.5 * (steepness - 1.0)).clamp(0.0, 1.0);
    1.45 / (1.0 - corner.powf(1.1)).max(1e-3)
}

/// Whether both axes have the same kernels.
fn is_square(optics: &Optics) -> bool {
    optics.pitch[0] == optics.pitch[1]
}

/// Where a point's light has died away on the panel, but for the taper's tail [m]: erfc(2.6)/2 = 1.2e-4.
fn reach(optics: &Optics, axis: usize, distance: f64) -> f64 {
    optics.spread(axis, distance, optics.taper.map(|taper| taper.reach(2.6)))
}

/// Factors beside 2, 3 and 5 of lengths that the CPU's transforms are fast at.
const LENGTH_FACTORS: [usize; 3] = [1, 7, 11];

/// The periodic grid: large enough that no point's light comes round onto the panel, for transforms of 16·2^a·3^b·5^c
/// times one of `factors` samples.
pub(in crate::hologram) fn layout(
    cloud: &Cloud,
    parameters: &Parameters,
    slabs: &Slabs,
    factors: &[usize],
) -> PlaneGrid {
    let (optics, grid, h) = (cloud.optics, cloud.grid, slabs.half);
    let mut layout = PlaneGrid { size: [0; 2], painted: 0, origin: [0; 2] };
    for (axis, pixels) in [grid.width as f64, grid.height as f64].into_iter().enumerate() {
        let halo = Table::half_width(optics, axis, h, parameters.tail) as f64 + 18.0;
        let [low, high] = cloud.places[axis];
        let painted = high - low + 2.0 * halo + 2.0;
        let size = pixels.max(cloud.period[axis] + parameters.tail);
        layout.size[axis] = fast_length(size.max(painted).ceil() as usize, 16, factors);
        layout.origin[axis] = (low - halo).floor() as i64;
        if axis == 1 {
            layout.painted = (painted.ceil() as usize).min(layout.size[1]);
        }
    }
    layout
}

/// What the phase of a point goes with by its depth from its plane [cycles/m]: the kernels carry exp(i2πd(α − ᾱ)) of
/// each axis, this is the rest of f_z.
pub(in crate::hologram) fn carrier(optics: &Optics, tables: [&Table; 2]) -> f64 {
    let lambda = optics.wavelength;
    1.0 / lambda
        + tables[0].mean
        + tables[1].mean
        + 0.25 * lambda.powi(3) * mean_square(optics, 0) * mean_square(optics, 1)
}

/// A source relative to the plane at the signed distance `middle` [m].
pub(in crate::hologram) fn splat(cloud: &Cloud, layout: &PlaneGrid, carrier: f64, s: &PointWave, middle: f64) -> Splat {
    let (optics, grid) = (cloud.optics, cloud.grid);
    let d = s.sign * s.distance - middle;
    let turns = d * carrier + s.turns + 0.25 * s.sign;
    let (sin, cos) = ((turns - turns.round()) * std::f64::consts::TAU).sin_cos();
    let a = s.amplitude * optics.wavelength;
    let at = [grid.column(s.x) - layout.origin[0] as f64, grid.row(s.y) - layout.origin[1] as f64];
    Splat { at, d, factor: [(a * cos) as f32, (a * sin) as f32] }
}

/// The cloud's field on the panel.
pub(crate) fn field(cloud: &Cloud, parameters: &Parameters, set: InstructionSet, progress: &Progress) -> Result<Field> {
    let Cloud { optics, grid, sources, .. } = cloud;
    if sources.is_empty() {
        return Ok(Field::zeros(**grid, optics.wavelength));
    }
    let slabs = parameters.slabs(cloud);
    let h = slabs.half;
    let layout = layout(cloud, parameters, &slabs, &LENGTH_FACTORS);
    progress.start("hologram: planes", sources.len() as u64 + (layout.size[0] * slabs.depths.len()) as u64);
    let tables = parameters.tables(optics, h, progress);
    let tables = tables.each_ref().map(|table| &**table);
    progress.check()?;
    let carrier = carrier(optics, tables);
    let slope = [0, 1].map(|axis| optics.cone(axis, 1.0) / optics.pitch[axis]);
    let bin = paint::bin(tables.map(|table| table.half), parameters.rank);
    let brush = Brush { tables, slope, tail: parameters.tail, rank: parameters.rank, depth: h, bin };
    // One plane's moments serve all planes, one after another. Pages are first touched by the threads that clear them.
    let samples = layout.size[0] * layout.painted;
    let mut moments: Vec<Vec<Complex32>> = (0..parameters.rank).map(|_| zeroed(samples)).collect();
    let mut spectrum = Spectrum::new(optics, &layout, h, set);
    let mut patches = Patches::default();
    for (k, members) in slabs.members(sources, |s| s.sign * s.distance).iter().enumerate() {
        let middle = slabs.plane(k);
        let one = |&i: &u32| splat(cloud, &layout, carrier, &sources[i as usize], middle);
        let splats: Vec<Splat> = members.par_iter().map(one).collect();
        for moment in &mut moments {
            moment.par_chunks_mut(1 << 16).for_each(|part| {
                if !progress.stopped() {
                    part.fill(Complex32::default());
                }
            });
        }
        let mut canvas = Canvas { width: layout.size[0], moments: &mut moments };
        paint(&mut canvas, &brush, &splats, &mut patches, set, progress)?;
        spectrum.add(middle, &mut moments, progress)?;
    }
    spectrum.finish(grid, progress)
}
