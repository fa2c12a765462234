//! Yoshikawa's difference method, for the record: along a row the wave is carried from pixel to pixel by products.
//!
//! Along a block of B pixels about u = 0 the path in wavelengths is nearly t(u) = t₀ + f₁u + f₂u². Then
//!
//! ```text
//! z(u+1) = z(u)·q(u),   q(u+1) = q(u)·g,   q = exp(i2π(f₁ + f₂(2u + 1))),   g = exp(i4πf₂)
//! ```
//!
//! and no sine is computed but for the seeds (H. Yoshikawa, S. Iwase & T. Oneda, *Proc. SPIE* 3956, 48 (2000), who
//! carry the phase; here it is the wave itself). Sixteen rows go side by side, each with its own seeds, so that nothing
//! is taken for separable.
//!
//! # Error
//!
//! What is left out is the third order: at most (π/λr²)·s(1 − s²)·(Bp/2)³ rad at a block's end, s = sin θ, and 1/√7 of
//! it in the mean; the amplitude is that of the middle, s·Bp/2r off at the ends. q's error enters every step and g's
//! the square of their number: so g − 1 is carried instead of g (its sine by Taylor, not by a fit that is 1e-6 off), q
//! is normalised, and what stays is about 5e-7·B from q's seed and 6e-8·B^1.5 from rounding. On processors with wide
//! vectors a sine by polynomial costs no more than two complex products, so [`super::tiles`] is faster at any error.

use super::definition::Optics;
use super::lanes::{Aligned, InstructionSet, Lanes, cos_sin, dispatch};
use super::sources::{PointSum, PointWave};
use super::tiles::{Axis, Class, Limit, taper};
use crate::error::Result;
use crate::field::{Field, Grid};
use rayon::prelude::*;

/// Rows that are carried side by side.
const ROWS: usize = 16;

/// Block lengths.
const BLOCKS: [usize; 6] = [256, 192, 128, 96, 64, 32];

/// Blocks whose results wait together to be added to the field.
const WAVE: usize = 256;

/// The longest block for an error, with its bound; sources no nearer than `distance`, seen under sines up to `sine`.
pub(crate) fn block(optics: &Optics, distance: f64, sine: f64, error: f64) -> (usize, f64) {
    let pitch = optics.pitch[0];
    let bound = |block: usize| {
        let half = 0.5 * block as f64 * pitch;
        let bend = sine * (1.0 - sine * sine);
        let third =
            std::f64::consts::PI / (optics.wavelength * distance * distance) * bend * half.powi(3) / 7f64.sqrt();
        let amplitude = sine * half / distance / 3f64.sqrt();
        third + amplitude + 5e-7 * block as f64 + 6e-8 * (block as f64).powf(1.5)
    };
    let longest = BLOCKS.into_iter().find(|&block| bound(block) <= error).unwrap_or(32);
    (longest, bound(longest))
}

/// Blocks of a grid.
pub(crate) fn blocks(grid: &Grid, block: usize) -> usize {
    grid.width.div_ceil(block) * grid.height.div_ceil(ROWS)
}

/// Memory of one wave of blocks [bytes].
pub(crate) fn bytes(block: usize) -> u64 {
    (WAVE * (2 * ROWS * block + 2 * (block + 16)) * 4) as u64
}

/// Predicted work on AVX-512 for so many pairs [core-seconds].
pub(crate) fn core_seconds(pairs: f64, block: usize) -> f64 {
    pairs * (1.9e-10 + 6e-9 / block as f64)
}

/// Adds the sources of a class to the field.
pub(crate) fn add(field: &mut Field, sum: &PointSum, class: &Class, block: usize, set: InstructionSet) -> Result<()> {
    let PointSum { optics, grid, progress, .. } = *sum;
    let table = class.edges(sum);
    let limit = Limit::new(sum.cull, &table);
    let axes = [Axis::new(optics, 0, limit), Axis::new(optics, 1, limit)];
    let tangent = class.tangent(optics, limit);
    let members = class.members(sum.sources);
    let rows = RowBlock { axes: &axes, wavenumber: 1.0 / optics.wavelength, limit, block };
    let across = grid.width.div_ceil(block);
    let tiles: Vec<usize> = (0..blocks(grid, block)).collect();
    let half = [0.5 * block as f64 * grid.pitch_x, 0.5 * ROWS as f64 * grid.pitch_y];
    for wave in tiles.chunks(WAVE) {
        let results: Vec<[Aligned; 2]> = wave
            .par_iter()
            .map(|&tile| {
                let at = [tile % across * block, tile / across * ROWS];
                let center = grid.middle(at, [block, ROWS]);
                let mut sums = [Aligned::default(), Aligned::default()];
                sums.iter_mut().for_each(|sum| sum.reserve(block * ROWS));
                let mut line = Aligned::default();
                line.reserve(2 * (block + 16));
                for (i, s) in members.iter().enumerate() {
                    if i % 64 == 0 && progress.stopped() {
                        break;
                    }
                    let (dx, dy) = (center[0] - s.x, center[1] - s.y);
                    let lit = |d: f64, axis: usize| d.abs() - half[axis] <= tangent[axis] * s.distance;
                    if lit(dx, 0) && lit(dy, 1) {
                        let point = BlockWave::new(&rows, s, dx, dy);
                        let (rows, sums, line) = (&rows, &mut sums, &mut line);
                        // SAFETY: the set was detected; buffers have block·16 and 2·(block + 16) values.
                        unsafe {
                            dispatch!(set, carry(rows: &RowBlock, point: BlockWave, sums: &mut [Aligned; 2], line: &mut Aligned));
                        }
                    }
                }
                progress.advance(members.len() as u64);
                sums
            })
            .collect();
        progress.check()?;
        for (&tile, [re, im]) in wave.iter().zip(&results) {
            let at = [tile % across * block, tile / across * ROWS];
            for row in 0..ROWS.min(grid.height - at[1]) {
                let to = (at[1] + row) * grid.width + at[0];
                let columns = block.min(grid.width - at[0]);
                for (column, u) in field.samples[to..to + columns].iter_mut().enumerate() {
                    u.re += re.values()[column * ROWS + row];
                    u.im += im.values()[column * ROWS + row];
                }
            }
        }
    }
    Ok(())
}

struct RowBlock<'a> {
    axes: &'a [Axis; 2],
    wavenumber: f64,
    limit: Limit<'a>,
    block: usize,
}

/// A point seen from the middle of a block.
#[derive(Clone, Copy)]
struct BlockWave {
    /// Sines and 1/r.
    sine: [f64; 2],
    inverse: f64,
    /// Phase [turns].
    base: f32,
    /// ±r/λ.
    turns: f32,
    amplitude: f32,
    sign: f32,
    /// Δ along both axes and the cone's limit, for the hard cut [m].
    offset: [f64; 2],
    distance: f64,
}

impl BlockWave {
    fn new(rows: &RowBlock, s: &PointWave, dx: f64, dy: f64) -> Self {
        let r = (dx * dx + dy * dy + s.distance * s.distance).sqrt().max(0.1 / rows.wavenumber);
        let turns = s.sign * r * rows.wavenumber;
        let phase = turns + s.turns;
        Self {
            sine: [dx / r, dy / r],
            inverse: 1.0 / r,
            base: (phase - phase.round()) as f32,
            turns: turns as f32,
            amplitude: (s.amplitude / r) as f32,
            sign: s.sign as f32,
            offset: [dx, dy],
            distance: s.distance,
        }
    }
}

/// T of one axis at indexes `u` from the middle: real and imaginary part, for a wave of either direction.
///
/// # Safety
/// As [`Lanes`].
#[inline(always)]
unsafe fn edge<L: Lanes>(rows: &RowBlock, point: &BlockWave, axis: usize, u: L) -> (L, L) {
    let a = &rows.axes[axis];
    let s = point.sine[axis];
    let step = a.pitch * point.inverse;
    // SAFETY: the caller's promise; a level has its eight runs of sixteen.
    unsafe {
        let one = L::splat(1.0);
        match rows.limit {
            Limit::None => (one, L::splat(0.0)),
            Limit::Hard => {
                let position = u.fma(L::splat(a.pitch as f32), L::splat(point.offset[axis] as f32));
                let inside = position.max(L::splat(0.0).sub(position));
                (one.where_le(inside, L::splat((point.distance * a.tangent) as f32)), L::splat(0.0))
            }
            Limit::Soft(table) => {
                let side = if s < 0.0 { -a.scale } else { a.scale };
                let bend = 1.0 - s * s;
                let (t0, t1) = (side * s + a.offset, side * bend * step);
                let t2 = -1.5 * t1 * s * step;
                let t = L::splat(t2 as f32).fma(u, L::splat(t1 as f32)).fma(u, L::splat(t0 as f32));
                let level = table.level(a.edge * bend * point.inverse);
                let (re, im) = taper::<L>(t, level);
                (re, im.mul(L::splat(point.sign)))
            }
        }
    }
}

/// Whether the taper is flat over a whole block.
fn flat(rows: &RowBlock, point: &BlockWave) -> bool {
    let a = &rows.axes[0];
    let reach = (point.sine[0].abs() + 0.5 * rows.block as f64 * a.pitch * point.inverse) * a.scale + a.offset;
    match rows.limit {
        Limit::None => true,
        Limit::Hard => point.offset[0].abs() + 0.5 * rows.block as f64 * a.pitch <= point.distance * a.tangent,
        Limit::Soft(_) => reach <= 0.0,
    }
}

/// Adds one point to a block of sixteen rows.
///
/// # Safety
/// The instruction set of `L` must be enabled; `sums` have block × 16 values, `line` 2·(block + 16).
#[inline(always)]
unsafe fn carry<L: Lanes>(rows: &RowBlock, point: BlockWave, sums: &mut [Aligned; 2], line: &mut Aligned) {
    let block = rows.block;
    let lanes: [f32; 16] = std::array::from_fn(|i| i as f32);
    let half = 0.5 * (block as f64 - 1.0);
    let [re, im] = sums;
    let (re, im, line) = (re.values_mut(), im.values_mut(), line.values_mut());
    assert!(re.len() >= block * ROWS && im.len() >= block * ROWS && line.len() >= 2 * (block + 16));
    let bright = flat(rows, &point);
    // SAFETY: lengths were checked; a vector never passes its row of sixteen or the line's last sixteen.
    unsafe {
        let lane = L::load(lanes.as_ptr());
        if !bright {
            let mut u = 0;
            while u < block {
                let (a, b) = edge::<L>(rows, &point, 0, lane.add(L::splat((u as f64 - half) as f32)));
                a.store(line.as_mut_ptr().add(u));
                b.store(line.as_mut_ptr().add(block + 16 + u));
                u += L::COUNT;
            }
        }
        let mut row = 0;
        while row < ROWS {
            let one = L::splat(1.0);
            let v = lane.add(L::splat(row as f32 - 0.5 * (ROWS as f32 - 1.0)));
            // ρ = r(v)/r = √(1 + δ).
            let e = v.mul(L::splat((rows.axes[1].pitch * point.inverse) as f32));
            let delta = e.mul(e.add(L::splat(2.0 * point.sine[1] as f32)));
            let rho = one.add(delta).max(L::splat(1e-6)).sqrt();
            let inverse = one.div(rho);
            let base = delta.mul(L::splat(point.turns)).div(one.add(rho)).add(L::splat(point.base));
            let sine = L::splat(point.sine[0] as f32).mul(inverse);
            let scale = point.sign * (rows.axes[0].pitch * rows.wavenumber) as f32;
            let first = sine.mul(L::splat(scale));
            let bend = sine.fnma(sine, one);
            let second = bend.mul(inverse).mul(L::splat(0.5 * scale * (rows.axes[0].pitch * point.inverse) as f32));
            let start = L::splat(-half as f32);
            let (c, s) = cos_sin(second.fma(start, first).fma(start, base));
            let (qc, qs) = cos_sin(second.fma(L::splat((1.0 - 2.0 * half) as f32), first));
            // One step of Newton's towards |q| = 1.
            let scale = qs.fma(qs, qc.mul(qc)).fnma(L::splat(0.5), L::splat(1.5));
            let mut q = (qc.mul(scale), qs.mul(scale));
            // g − 1 by Taylor in the angle's square.
            let angle = second.mul(L::splat(2.0 * std::f32::consts::TAU));
            let square = angle.mul(angle);
            let fall = square.fma(L::splat(1.0 / 24.0), L::splat(-0.5)).mul(square);
            let rise = square.fma(L::splat(1.0 / 120.0), L::splat(-1.0 / 6.0)).fma(square, one).mul(angle);
            let amplitude = L::splat(point.amplitude).mul(inverse);
            let (yr, yi) = edge::<L>(rows, &point, 1, v);
            let (yr, yi) = (yr.mul(amplitude), yi.mul(amplitude));
            let mut z = (s.fnma(yi, c.mul(yr)), s.fma(yr, c.mul(yi)));
            let times = |a: (L, L), b: (L, L)| (a.1.fnma(b.1, a.0.mul(b.0)), a.1.fma(b.0, a.0.mul(b.1)));
            for u in 0..block {
                let at = u * ROWS + row;
                let wave = if bright { z } else { times(z, (L::splat(line[u]), L::splat(line[block + 16 + u]))) };
                L::load(re.as_ptr().add(at)).add(wave.0).store(re.as_mut_ptr().add(at));
                L::load(im.as_ptr().add(at)).add(wave.1).store(im.as_mut_ptr().add(at));
                z = times(z, q);
                q = (q.1.fnma(rise, q.0.fma(fall, q.0)), q.1.fma(fall, q.0.fma(rise, q.1)));
            }
            row += L::COUNT;
        }
    }
}
