//! The exact sphere, separable over small tiles: sums of points as complex matrix products.
//!
//! About the centre of a tile the distance splits as r(u, v) = r(u, 0) + r(0, v) − r(0, 0) + ε with the phase error
//! k|ε| ≤ k·|x₀y₀|·uv/r³ ([`Shape`] chooses the tile so that its mean stays below the wanted error). No small-angle
//! assumption enters: each factor is the sphere's own expansion about the tile, with f64 set-up per point and tile.
//! Where no tile is small enough (wide angles, near points) each pixel takes its own exact path.
//!
//! The products are of f32; of 16-bit integers where the processor multiplies those in pairs and their rounding is a small
//! part of the wanted error; or of bfloat16 where it has a matrix unit and the error allows that.
//!
//! The engines `direct` and `tiles` are this one, with tiles small enough for 1e-4, or for the error that was asked.

mod batch;
#[cfg(target_arch = "x86_64")]
mod bfloat;
mod edge;
mod factor;
#[cfg(target_arch = "x86_64")]
mod fixed;
#[cfg(target_arch = "x86_64")]
mod integer;
mod kernel;
mod pixels;
mod shape;

pub(crate) use edge::EdgeTable;
pub(crate) use factor::{Axis, Limit, taper};
pub(crate) use shape::{Kernel, Products, Shape};

use super::Cull;
use super::definition::Optics;
#[cfg(target_arch = "x86_64")]
use super::lanes::matrix::Amx;
use super::lanes::{InstructionSet, dispatch};
use super::sources::{PointSum, PointWave, contrast, tilt};
use crate::error::Result;
use crate::field::{Complex32, Field};
use factor::{Relative, Tile};
use kernel::{LONG_BATCH, Panels, add_batch};
use pixels::add_exact;
use rayon::prelude::*;
use shape::Lighting;

/// Tiles whose results wait together to be added to the field.
const WAVE: usize = 64;

/// Where T has fallen to 1e-5 of the middle, in widths of the taper at q = 0.
const EDGES: f64 = 3.02;

/// Points of similar distance, summed with one tile shape.
#[derive(Clone, Debug)]
pub(crate) struct Class {
    /// Indexes into the sources.
    sources: Vec<usize>,
    /// Tile of the class.
    pub(crate) shape: Shape,
    /// Smallest and largest distance [m].
    distance: [f64; 2],
}

impl Class {
    /// Number of points.
    pub(crate) fn len(&self) -> usize {
        self.sources.len()
    }
    /// Memory for this class's tables and one wave of tiles [bytes].
    pub(crate) fn bytes(&self, optics: &Optics, cull: Cull) -> u64 {
        let tile = kernel::bytes(self.shape.width, self.shape.height, self.shape.kernel);
        let table = if cull == Cull::Soft {
            let [lowest, highest] = self.q_range(optics);
            EdgeTable::bytes(lowest, highest)
        } else {
            0
        };
        WAVE as u64 * tile + table + (size_of::<PointWave>() * self.sources.len()) as u64
    }
    /// Predicted work on AVX-512 [core-seconds]: that of each point on each tile that its cone touches.
    pub(crate) fn core_seconds(&self, sum: &PointSum) -> f64 {
        let PointSum { optics, grid, sources, cull, .. } = *sum;
        let (width, height) = (self.shape.width as f64, self.shape.height as f64);
        let tile = self.shape.seconds();
        let count = |source: &PointWave| {
            let spans = source.span(grid);
            let tiles = |axis: usize, size: f64| {
                let pitch = optics.pitch[axis];
                let cone = if cull == Cull::None { f64::INFINITY } else { optics.cone(axis, source.distance) };
                let span = (spans[axis][1].min(cone) - spans[axis][0].max(-cone)).max(0.0);
                // A span that is not on tile borders touches one tile more; one that fills the panel does not.
                let whole = [grid.width, grid.height][axis].div_ceil(size as usize) as f64;
                (span / (size * pitch) + 1.0).min(whole)
            };
            tiles(0, width) * tiles(1, height)
        };
        let parts: Vec<f64> =
            self.sources.par_chunks(4096).map(|part| part.iter().map(|&i| count(&sources[i])).sum()).collect();
        let tiles = grid.width.div_ceil(self.shape.width) * grid.height.div_ceil(self.shape.height);
        parts.iter().sum::<f64>() * tile + tiles as f64 * 3e-6
    }
    /// Distance of the nearest source [m].
    pub(crate) fn nearest(&self) -> f64 {
        self.distance[0]
    }
    /// The class's sources, in the order of their x.
    pub(crate) fn members(&self, sources: &[PointWave]) -> Vec<PointWave> {
        self.sources.par_iter().map(|&i| sources[i]).collect()
    }
    /// The taper's table for the class's distances; empty where waves are not tapered, dark when asked to stop.
    pub(crate) fn edges(&self, sum: &PointSum) -> EdgeTable {
        match sum.cull {
            Cull::Soft => {
                let [lowest, highest] = self.q_range(sum.optics);
                EdgeTable::new(lowest, highest, sum.progress)
            }
            Cull::Hard | Cull::None => EdgeTable::default(),
        }
    }
    /// Half width of the cone per metre of distance, out to where the taper is dark.
    pub(crate) fn tangent(&self, optics: &Optics, limit: Limit) -> [f64; 2] {
        [0, 1].map(|axis| match limit {
            Limit::Soft(table) => {
                let sine = (optics.wavelength * optics.taper[axis].reach(table.half)).min(0.9);
                // The other axis tilts the cone: |Δx| = r·sine with r up to the corner's.
                let other = (optics.wavelength * optics.taper[1 - axis].reach(table.half)).min(0.9);
                sine / (1.0 - sine * sine - other * other).max(0.01).sqrt()
            }
            Limit::Hard => optics.cone(axis, 1.0),
            Limit::None => f64::INFINITY,
        })
    }
    fn q_range(&self, optics: &Optics) -> [f64; 2] {
        let widths = optics.taper.map(|taper| taper.width);
        let q = |width: f64, r: f64| 1.0 / (std::f64::consts::PI * optics.wavelength * r * width * width);
        // At the cone's corner r is larger and 1 − sine² smaller than on the axis: at most a factor 4 at 0.6/λ.
        let corner = optics.taper.map(|t| (optics.wavelength * t.reach(EDGES)).powi(2)).iter().sum::<f64>().min(0.9);
        let low = q(widths[0].max(widths[1]), self.distance[1]) * (1.0 - corner).powf(1.5);
        [low, q(widths[0].min(widths[1]), self.distance[0])]
    }
}

/// A number's bits, whose order as an integer is that of the numbers.
fn ordered(x: f64) -> i64 {
    let bits = x.to_bits() as i64;
    if bits < 0 { bits ^ i64::MAX } else { bits }
}

/// Sorts sources into classes, a factor √2 of distance each, and chooses their tiles; leaves some out when asked to
/// stop.
pub(crate) fn classify(sum: &PointSum, indexes: &[usize], products: Products, error: f64) -> Vec<Class> {
    let PointSum { optics, grid, sources, cull, progress } = *sum;
    let Some(nearest) = indexes.iter().map(|&i| sources[i].distance).min_by(f64::total_cmp) else {
        return Vec::new();
    };
    let nearest = nearest.max(optics.wavelength);
    let octave = |distance: f64| ((distance / nearest).max(1.0).log2() * 2.0) as usize;
    let count = indexes.iter().map(|&i| octave(sources[i].distance)).max().unwrap_or(0) + 1;
    let mut classes = vec![Vec::new(); count];
    for &i in indexes {
        classes[octave(sources[i].distance)].push(i);
    }
    classes
        .into_iter()
        .filter(|members| !members.is_empty() && !progress.stopped())
        .map(|members| {
            // Neighbours in x are culled alike, so the branches of culling are predictable; ties keep their order.
            let mut keys: Vec<(i64, usize)> = members.par_iter().map(|&i| (ordered(sources[i].x), i)).collect();
            keys.par_sort_unstable();
            let members: Vec<usize> = keys.into_iter().map(|(_, i)| i).collect();
            let limit = [0, 1].map(|axis| match cull {
                Cull::Soft => optics.wavelength * optics.taper[axis].reach(EDGES),
                Cull::Hard => optics.wavelength * optics.taper[axis].limit,
                Cull::None => 1.0,
            });
            let chosen: Vec<PointWave> = members.par_iter().map(|&i| sources[i]).collect();
            let widest = |source: &PointWave| {
                let sine = source.sines(grid, limit).map(|[low, high]| low.abs().max(high.abs()));
                ([source.distance; 2], sine)
            };
            let (distance, sine) = chosen.par_iter().map(widest).reduce(
                || ([f64::INFINITY, 0.0], [0.0; 2]),
                |(d, s), (e, t)| ([d[0].min(e[0]), d[1].max(e[1])], [s[0].max(t[0]), s[1].max(t[1])]),
            );
            let lighting = Lighting {
                panel: [grid.width, grid.height],
                distance: distance[0].max(1e-12),
                sine,
                tilt: tilt(&chosen, grid, limit),
                contrast: contrast(&chosen, grid, limit),
            };
            let shape = Shape::choose(optics, &lighting, products, error);
            Class { sources: members, shape, distance }
        })
        .collect()
}

/// Adds the sources of a class to the field.
pub(crate) fn add(field: &mut Field, sum: &PointSum, class: &Class, set: InstructionSet) -> Result<()> {
    let PointSum { optics, grid, progress, .. } = *sum;
    let table = class.edges(sum);
    let limit = Limit::new(sum.cull, &table);
    let axes = [Axis::new(optics, 0, limit), Axis::new(optics, 1, limit)];
    let Shape { width, height, kernel, .. } = class.shape;
    let tile = Tile { width, height, axes: &axes, wavenumber: 1.0 / optics.wavelength, limit };
    let most = kernel::batch(kernel);
    let members = class.members(sum.sources);
    let tangent = class.tangent(optics, limit);
    let across = grid.width.div_ceil(width);
    let tiles: Vec<usize> = (0..across * grid.height.div_ceil(height)).collect();
    let work = (members.len() as u64).max(1);
    for wave in tiles.chunks(WAVE) {
        let results: Vec<Option<Panels>> = wave
            .par_iter()
            .map(|&number| {
                let at = [number % across * width, number / across * height];
                let mut panels = Panels::default();
                panels.clear(width, height, kernel);
                let center = grid.middle(at, [width, height]);
                let half = [0.5 * width as f64 * grid.pitch_x, 0.5 * height as f64 * grid.pitch_y];
                let reach = half[0] + tangent[0] * class.distance[1];
                let first = members.partition_point(|s| s.x < center[0] - reach);
                let last = members.partition_point(|s| s.x <= center[0] + reach);
                let mut batch = [Relative::default(); LONG_BATCH];
                let (mut count, mut lit) = (0, false);
                for s in &members[first..last] {
                    let (dx, dy) = (center[0] - s.x, center[1] - s.y);
                    let dark =
                        dx.abs() - half[0] > tangent[0] * s.distance || dy.abs() - half[1] > tangent[1] * s.distance;
                    if dark {
                        continue;
                    }
                    let (distance, amplitude) = (s.distance, s.amplitude);
                    batch[count] = Relative { dx, dy, distance, amplitude, turns: s.turns, sign: s.sign };
                    count += 1;
                    if count == most {
                        if progress.stopped() {
                            return None;
                        }
                        flush(set, &tile, &batch[..count], &mut panels, kernel);
                        (count, lit) = (0, true);
                    }
                }
                if count > 0 {
                    flush(set, &tile, &batch[..count], &mut panels, kernel);
                }
                progress.advance(work);
                (lit || count > 0).then_some(panels)
            })
            .collect();
        progress.check()?;
        // Tiles without light are left as they are; rows of tiles are bands of the field that one thread each adds to.
        let first = wave[0] / across;
        let last = wave[wave.len() - 1] / across;
        let bands = field.samples.par_chunks_mut(grid.width * height).enumerate().skip(first).take(last + 1 - first);
        bands.for_each(|(row, band)| {
            for (&number, panels) in wave.iter().zip(&results).filter(|(number, _)| **number / across == row) {
                if let Some(panels) = panels {
                    scatter(band, grid.width, number % across * width, width, panels);
                }
            }
        });
    }
    Ok(())
}

fn flush(set: InstructionSet, tile: &Tile, points: &[Relative], panels: &mut Panels, kernel: Kernel) {
    // SAFETY: the set was detected on this machine, integers and bfloat16 were chosen for one that has them; the panels
    // were cleared for this tile and kernel.
    unsafe {
        match kernel {
            Kernel::Paths => dispatch!(set, add_exact(tile: &Tile, points: &[Relative], panels: &mut Panels)),
            #[cfg(target_arch = "x86_64")]
            Kernel::Integer => integer::add_batch(tile, points, panels),
            #[cfg(target_arch = "x86_64")]
            Kernel::Bfloat => bfloat::add_batch::<Amx>(tile, points, panels),
            _ => {
                dispatch!(set, add_batch(tile: &Tile, points: &[Relative], panels: &mut Panels));
            }
        }
    }
}

/// Adds a tile of `width` columns to a band of rows of the field, from `column` on, without what overhangs.
fn scatter(band: &mut [Complex32], stride: usize, column: usize, width: usize, panels: &Panels) {
    let count = width.min(stride - column);
    for (row, samples) in band.chunks_exact_mut(stride).enumerate() {
        let from = row * width;
        let parts = panels.re.values()[from..from + count].iter().zip(&panels.im.values()[from..from + count]);
        for (u, (re, im)) in samples[column..column + count].iter_mut().zip(parts) {
            u.re += re;
            u.im += im;
        }
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests;
