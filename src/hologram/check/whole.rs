//! The exact sum on a whole grid, in double precision: what is left where no faster engine keeps the wanted error.
//!
//! Far points by [`Waves`], each near one as products of its lines ([`Near`]): some tens of times as fast as the oracle, which
//! stays the obvious form that both are tested against.

use super::near::{Lines, Near};
use super::waves::Waves;
use super::{Exact, PAIR};
use crate::error::Result;
use crate::field::{Complex64, Field};
use crate::hologram::sources::PointSum;
use rayon::prelude::*;

/// Memory for the lines of near points that are added together [bytes].
const LINES: usize = 64 << 20;

/// Far points that are summed before the job is asked whether to go on.
const PART: usize = 1 << 14;

/// Error of the sum: the far form where it stands for the integral, and the expansion of near points.
pub(in crate::hologram) const ERROR: f64 = 3e-5;

/// Predicted work [core-seconds].
pub(in crate::hologram) fn core_seconds(sum: &PointSum) -> f64 {
    let exact = Exact::new(sum);
    let near: f64 = exact.near.iter().map(|s| Near::whole_seconds(sum.optics, sum.grid, s)).sum();
    exact.far.len() as f64 * sum.grid.len() as f64 * PAIR + near
}

/// Memory that [`field`] takes [bytes].
pub(in crate::hologram) fn memory(sum: &PointSum) -> u64 {
    let exact = Exact::new(sum);
    let lines = exact.near.iter().map(|s| Near::line_bytes(sum.optics, sum.grid, s));
    let (all, largest) =
        lines.fold((0usize, 0), |(all, largest), bytes| (all.saturating_add(bytes), largest.max(bytes)));
    // Samples in double and in single precision, and the lines that are held at a time.
    24 * sum.grid.len() as u64 + all.min(LINES).max(largest) as u64
}

/// The field on the whole grid.
pub(in crate::hologram) fn field(sum: &PointSum) -> Result<Field> {
    let PointSum { optics, grid, cull, progress, .. } = *sum;
    let exact = Exact::new(sum);
    progress.start("hologram: exact sum", (grid.height + exact.near.len()) as u64);
    let waves = Waves::new(optics, cull);
    let mut field = Field::<f64>::zeros(*grid, optics.wavelength);
    field.samples.par_chunks_mut(grid.width).enumerate().for_each(|(row, samples)| {
        for (column, u) in samples.iter_mut().enumerate() {
            for part in exact.far.chunks(PART) {
                if progress.stopped() {
                    return;
                }
                *u += waves.sum(part, [grid.x(column), grid.y(row)]);
            }
        }
        progress.advance(1);
    });
    progress.check()?;
    let mut rest = &exact.near[..];
    while !rest.is_empty() {
        let mut bytes = 0;
        let fits = |s: &&_| {
            bytes += Near::line_bytes(optics, grid, s);
            bytes <= LINES
        };
        let (now, later) = rest.split_at(rest.iter().take_while(fits).count().max(1));
        let one = |s: &_| if progress.stopped() { None } else { Lines::new(optics, grid, s) };
        let lines: Vec<Option<Lines>> = now.par_iter().map(one).collect();
        progress.check()?;
        field.samples.par_chunks_mut(grid.width).enumerate().for_each(|(row, samples): (usize, &mut [Complex64])| {
            lines.iter().flatten().take_while(|_| !progress.stopped()).for_each(|lines| lines.add_row(row, samples));
        });
        progress.check()?;
        progress.advance(now.len() as u64);
        rest = later;
    }
    Ok(field.to_f32())
}
