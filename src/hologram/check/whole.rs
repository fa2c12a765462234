//! The exact sum on a whole grid, in double precision: what is left where no faster engine keeps the wanted error.
//!
//! Far points by [`Waves`], each near one as products of its lines ([`Near`]): some tens of times as fast as the oracle, which
//! stays the obvious form that both are tested against.

use super::near::{Lines, Near};
use super::waves::{BATCH, Waves};
use super::{Exact, PAIR};
use crate::error::Result;
use crate::field::{Complex64, Field};
use crate::hologram::sources::PointSum;
use rayon::prelude::*;

/// Memory for the lines of near points that are added together [bytes].
const LINES: usize = 64 << 20;

/// Error of the sum: the far form where it stands for the integral, and the expansion of near points.
pub(in crate::hologram) const ERROR: f64 = 3e-5;

/// Predicted work [core-seconds].
pub(in crate::hologram) fn core_seconds(sum: &PointSum) -> f64 {
    seconds(sum, &Exact::new(sum, 0.0))
}

/// The same, of points that were divided.
pub(super) fn seconds(sum: &PointSum, exact: &Exact) -> f64 {
    let near: f64 = exact.near.iter().map(|s| Near::whole_seconds(sum.optics, sum.grid, s)).sum();
    exact.far.len() as f64 * sum.grid.len() as f64 * PAIR + near
}

/// Memory that [`field`] takes [bytes].
pub(in crate::hologram) fn memory(sum: &PointSum) -> u64 {
    let exact = Exact::new(sum, 0.0);
    let lines = exact.near.iter().map(|s| Near::line_bytes(sum.optics, sum.grid, s));
    let (all, largest) =
        lines.fold((0usize, 0), |(all, largest), bytes| (all.saturating_add(bytes), largest.max(bytes)));
    // Samples in double and in single precision, and the lines that are held at a time.
    24 * sum.grid.len() as u64 + all.min(LINES).max(largest) as u64
}

/// The field on the whole grid.
pub(in crate::hologram) fn field(sum: &PointSum) -> Result<Field> {
    let PointSum { optics, grid, progress, .. } = *sum;
    let exact = Exact::new(sum, 0.0);
    progress.start("hologram: exact sum", (grid.height + exact.near.len()) as u64);
    let samples = samples(sum, &exact, LINES, || progress.advance(1))?;
    Ok(Field { grid: *grid, wavelength: optics.wavelength, samples }.to_f32())
}

/// Its samples in double precision, near points' lines within `most` bytes; `advance` is called for each row and near point.
pub(super) fn samples(sum: &PointSum, exact: &Exact, most: usize, advance: impl Fn() + Sync) -> Result<Vec<Complex64>> {
    let PointSum { optics, grid, cull, progress, .. } = *sum;
    let waves = Waves::new(optics, cull);
    let mut samples = vec![Complex64::default(); grid.len()];
    samples.par_chunks_mut(grid.width).enumerate().for_each(|(row, samples)| {
        let places: Vec<[f64; 2]> = (0..grid.width).map(|column| [grid.x(column), grid.y(row)]).collect();
        for batch in exact.far.chunks(BATCH).take_while(|_| !progress.stopped()) {
            waves.add(batch, &places, samples);
        }
        advance();
    });
    progress.check()?;
    let mut rest = &exact.near[..];
    while !rest.is_empty() {
        let mut bytes = 0;
        let fits = |s: &&_| {
            bytes += Near::line_bytes(optics, grid, s);
            bytes <= most
        };
        let (now, later) = rest.split_at(rest.iter().take_while(fits).count().max(1));
        let one = |s: &_| if progress.stopped() { None } else { Lines::new(optics, grid, s) };
        let lines: Vec<Option<Lines>> = now.par_iter().map(one).collect();
        progress.check()?;
        samples.par_chunks_mut(grid.width).enumerate().for_each(|(row, samples): (usize, &mut [Complex64])| {
            lines.iter().flatten().take_while(|_| !progress.stopped()).for_each(|lines| lines.add_row(row, samples));
        });
        progress.check()?;
        now.iter().for_each(|_| advance());
        rest = later;
    }
    Ok(samples)
}
