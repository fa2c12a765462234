//! One leg of the light's way: from planes behind it to the next plane that hides something, or to the panel.
//!
//! What leaves one plane is a few passes, without a transform of the whole padded grid before or after:
//!
//! 1. rows that hold light are transformed, [`Leg::emit`] and [`Leg::shutter`];
//! 2. column by column, 16 together: transform, product with the factor of the distance, sum over the leg's planes, and
//!    after the last of them transform back, [`Leg::add`];
//! 3. rows that are wanted are transformed back, [`Leg::shutter`] and [`Leg::land`].

use super::window::{STRIP, Window};
use crate::error::Result;
use crate::field::{Complex32, Fft1, Field, Grid, zeroed};
use crate::hologram::definition::Optics;
use crate::hologram::dispersion::{Column, Dispersion, aligned};
use crate::hologram::lanes::{Aligned, InstructionSet, Lanes, cos_sin, dispatch};
use crate::progress::Progress;
use rayon::prelude::*;

/// Distance of neighbouring columns beyond their length: keeps heights of powers of two off one set of the cache.
const GAP: usize = 16;

/// Highest a + b that is carried: steeper waves, at pitches below 0.71 λ only, run along the panel.
const STEEPEST: f64 = 0.99;

/// Memory of all legs, whose transforms are at most of the given sizes [bytes].
pub(super) fn bytes(lattice: &Grid, sizes: &[[usize; 2]]) -> u64 {
    let of = |[width, height]: [usize; 2]| {
        let thread = STRIP * width.max(height + GAP) + width + height;
        [width * (height + GAP), width * lattice.height, rayon::current_num_threads() * thread]
    };
    let most = |part: usize| sizes.iter().map(|&size| of(size)[part]).max().unwrap_or(0);
    (0..3).map(most).sum::<usize>() as u64 * size_of::<Complex32>() as u64
}

/// What all legs share, one after another; memory that was not written is not taken.
pub(super) struct Buffers {
    /// Rows of the lattice, transformed, of the leg's width.
    rows: Vec<Complex32>,
    /// Columns of the leg's spectrum one after another, `height` + [`GAP`] samples each.
    sum: Vec<Complex32>,
}

impl Buffers {
    /// For legs of the given sizes.
    pub(super) fn new(lattice: &Grid, sizes: &[[usize; 2]]) -> Self {
        let most = |of: fn([usize; 2], usize) -> usize| sizes.iter().map(|&s| of(s, lattice.height)).max().unwrap_or(0);
        Self {
            rows: zeroed(most(|[width, _], rows| width * rows)),
            sum: zeroed(most(|[width, height], _| width * (height + GAP))),
        }
    }
}

/// What leaves a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Emission {
    /// A field.
    Field,
    /// Amplitudes of points: their field has the factor ±i·W·W/f_z, + where the points stand behind the panel.
    Points {
        /// Whether the sign is +.
        behind: bool,
    },
}

/// The factor of a distance: exp(i2πf_z·d) onto the window, times that of the light.
pub(super) struct Factor {
    light: Emission,
    ratio: f32,
    /// Phase modulo one turn and gain, by column; without gain the column is dark.
    columns: Vec<[f32; 2]>,
    /// Phase modulo one turn and gain, by row.
    phases: Aligned,
    gains: Aligned,
}

impl Factor {
    /// Whether a column is dark throughout.
    pub(super) fn dark(&self, column: usize) -> bool {
        self.columns[column][1] <= 0.0
    }
}

/// Transforms and tables of one size.
pub(super) struct Leg {
    optics: Optics,
    /// The periodic grid.
    grid: Grid,
    dispersion: Dispersion,
    /// W by column and row.
    tapers: [Vec<f64>; 2],
    rows: Fft1<f32>,
    columns: Fft1<f32>,
    set: InstructionSet,
}

impl Leg {
    /// Plans transforms of one size.
    pub(super) fn new(optics: &Optics, [width, height]: [usize; 2], set: InstructionSet) -> Result<Self> {
        let grid = Grid::new(width, height, optics.pitch[0], optics.pitch[1])?;
        let tapers = [
            (0..width).map(|k| optics.taper[0].at(grid.frequency_x(k))).collect(),
            (0..height).map(|k| optics.taper[1].at(grid.frequency_y(k))).collect(),
        ];
        let dispersion = Dispersion::new(&grid, optics.wavelength);
        let (rows, columns) = (Fft1::new(width), Fft1::new(height));
        Ok(Self { optics: *optics, grid, dispersion, tapers, rows, columns, set })
    }

    /// Its size.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.grid.width, self.grid.height]
    }

    /// The factor for light over a distance [m] onto a window.
    pub(super) fn factor(&self, light: Emission, distance: f64, to: Window) -> Factor {
        let (grid, ratio) = (&self.grid, distance / self.optics.wavelength);
        // 1/N of the inverse transform. A sample of points' transform stands for the lattice's cell of frequencies, and
        // its sum is 1/N of the integral; 1/f_z = λ/√(1 − a − b).
        let scale = 1.0 / grid.len() as f64;
        let (scale, quarter) = match light {
            Emission::Field => (scale, 0.0),
            Emission::Points { behind } => {
                let area = 1.0 / (grid.pitch_x * grid.pitch_y);
                (scale * area * self.optics.wavelength, if behind { 0.25 } else { -0.25 })
            }
        };
        let weight = |axis: usize, k: usize, f: f64| {
            let taper = if light == Emission::Field { 1.0 } else { self.tapers[axis][k] };
            taper * to.weight(&self.optics, axis, f, distance)
        };
        let column = |k: usize| {
            let f = grid.frequency_x(k);
            if self.dispersion.columns[k] > STEEPEST {
                return [0.0; 2];
            }
            [self.dispersion.by_column(ratio, k, f * to.first[0] + quarter), (scale * weight(0, k, f)) as f32]
        };
        let mut gains = aligned(grid.height);
        for (k, gain) in gains.values_mut().iter_mut().take(grid.height).enumerate() {
            *gain = weight(1, k, grid.frequency_y(k)) as f32;
        }
        Factor {
            light,
            ratio: ratio as f32,
            columns: (0..grid.width).map(column).collect(),
            phases: self.dispersion.by_row(ratio, |k| grid.frequency_y(k) * to.first[1]),
            gains,
        }
    }

    /// Transforms the rows of a layer's light.
    pub(super) fn emit(&self, buffers: &mut Buffers, lattice: &Grid, light: &[Complex32], progress: &Progress) {
        let width = self.grid.width;
        let rows = &mut buffers.rows[..width * lattice.height];
        rows.par_chunks_mut(width * STRIP).zip(light.par_chunks(lattice.width * STRIP)).for_each_init(
            || self.rows.scratch(),
            |scratch, (rows, light)| {
                for (row, light) in rows.chunks_exact_mut(width).zip(light.chunks_exact(lattice.width)) {
                    if progress.stopped() {
                        return;
                    }
                    // A picture cut by depth has many rows without light.
                    if light.iter().all(|u| *u == Complex32::default()) {
                        row.fill(Complex32::default());
                        continue;
                    }
                    row[..lattice.width].copy_from_slice(light);
                    row[lattice.width..].fill(Complex32::default());
                    self.rows.forward(row, scratch);
                }
            },
        );
    }

    /// Multiplies what was emitted by a factor and adds it to the spectrum, or begins the spectrum with it where `first`;
    /// where `last`, transforms the columns back.
    pub(super) fn add(
        &self,
        buffers: &mut Buffers,
        lattice: &Grid,
        factor: &Factor,
        first: bool,
        last: bool,
        progress: &Progress,
    ) {
        let [width, height] = self.size();
        let stride = height + GAP;
        let rows = &buffers.rows[..width * lattice.height];
        buffers.sum[..width * stride].par_chunks_mut(stride * STRIP).enumerate().for_each_init(
            || (vec![Complex32::default(); STRIP * stride], self.columns.scratch()),
            |(columns, scratch), (strip, sum)| {
                let at = strip * STRIP;
                if progress.stopped() {
                    return;
                }
                for (row, line) in rows.chunks_exact(width).enumerate() {
                    for (i, &u) in line[at..at + STRIP].iter().enumerate() {
                        columns[i * stride + row] = u;
                    }
                }
                for (i, sum) in sum.chunks_exact_mut(stride).enumerate() {
                    if progress.stopped() {
                        return;
                    }
                    let (column, sum) = (&mut columns[i * stride..][..height], &mut sum[..height]);
                    if !factor.dark(at + i) {
                        column[lattice.height..].fill(Complex32::default());
                        self.columns.forward(column, scratch);
                        self.multiply(factor, at + i, column, sum, first);
                    } else if first {
                        sum.fill(Complex32::default());
                    }
                    if last {
                        self.columns.inverse(sum, scratch);
                    }
                }
            },
        );
    }

    /// Adds the factor times a column of a transform to the sum, or begins the sum with it where `first`.
    pub(super) fn multiply(
        &self,
        factor: &Factor,
        column: usize,
        from: &[Complex32],
        sum: &mut [Complex32],
        first: bool,
    ) {
        let (a, at) = (self.dispersion.columns[column], factor.columns[column]);
        let dispersion = &self.dispersion;
        // SAFETY: the set was detected; lengths are checked.
        unsafe {
            dispatch!(self.set, multiply(dispersion: &Dispersion, factor: &Factor, a: f64, at: [f32; 2], from: &[Complex32], sum: &mut [Complex32], first: bool));
        }
    }

    /// Transforms back the rows that reach the next plane, darkens what is hidden there and what left the lattice (it would
    /// come round on the next leg), and transforms the rest for that leg.
    pub(super) fn shutter(
        &self,
        buffers: &mut Buffers,
        lattice: &Grid,
        opaque: &[bool],
        next: &Self,
        progress: &Progress,
    ) {
        let width = next.grid.width;
        let rows = &mut buffers.rows[..width * lattice.height];
        let opaque = opaque.par_chunks(lattice.width * STRIP);
        rows.par_chunks_mut(width * STRIP).zip(opaque).enumerate().for_each_init(
            || (self.lines(), next.rows.scratch()),
            |((lines, back), scratch), (block, (rows, opaque))| {
                self.rows_back(&buffers.sum, block * STRIP, lines, back, progress);
                for ((row, opaque), line) in rows
                    .chunks_exact_mut(width)
                    .zip(opaque.chunks_exact(lattice.width))
                    .zip(lines.chunks_exact(self.grid.width))
                {
                    if progress.stopped() {
                        return;
                    }
                    for ((u, &from), &hidden) in row.iter_mut().zip(line).zip(opaque) {
                        *u = if hidden { Complex32::default() } else { from };
                    }
                    row[lattice.width..].fill(Complex32::default());
                    next.rows.forward(row, scratch);
                }
            },
        );
    }

    /// Transforms back the rows that reach the panel.
    pub(super) fn land(&self, buffers: &Buffers, field: &mut Field, progress: &Progress) {
        let width = field.grid.width;
        field.samples.par_chunks_mut(width * STRIP).enumerate().for_each_init(
            || self.lines(),
            |(lines, scratch), (block, rows)| {
                self.rows_back(&buffers.sum, block * STRIP, lines, scratch, progress);
                for (row, line) in rows.chunks_exact_mut(width).zip(lines.chunks_exact(self.grid.width)) {
                    row.copy_from_slice(&line[..width]);
                }
            },
        );
    }

    /// Memory of one thread for rows on the way back, and their transforms' scratch.
    fn lines(&self) -> (Vec<Complex32>, Vec<Complex32>) {
        (vec![Complex32::default(); STRIP * self.grid.width], self.rows.scratch())
    }

    /// Rows `first`… of the spectrum whose columns are back already.
    fn rows_back(
        &self,
        sum: &[Complex32],
        first: usize,
        lines: &mut [Complex32],
        scratch: &mut [Complex32],
        progress: &Progress,
    ) {
        let [width, height] = self.size();
        if progress.stopped() {
            return;
        }
        // The height is a multiple of STRIP: so many rows there are.
        for (column, from) in sum[..width * (height + GAP)].chunks_exact(height + GAP).enumerate() {
            for (i, &u) in from[first..first + STRIP].iter().enumerate() {
                lines[i * width + column] = u;
            }
        }
        for line in lines.chunks_exact_mut(width) {
            if progress.stopped() {
                return;
            }
            self.rows.inverse(line, scratch);
        }
    }
}

/// See [`Leg::multiply`].
///
/// # Safety
/// The instruction set of `L` must be enabled.
#[inline(always)]
unsafe fn multiply<L: Lanes>(
    dispersion: &Dispersion,
    factor: &Factor,
    a: f64,
    [base, gain]: [f32; 2],
    from: &[Complex32],
    sum: &mut [Complex32],
    first: bool,
) {
    let (squares, roots) = (dispersion.squares.values(), dispersion.roots.values());
    let (phases, gains) = (factor.phases.values(), factor.gains.values());
    let count = sum.len();
    let lengths = [squares.len(), roots.len(), phases.len(), gains.len(), from.len()];
    assert!(count.is_multiple_of(16) && lengths.iter().all(|&n| n >= count));
    let points = factor.light != Emission::Field;
    let mut k = 0;
    // SAFETY: lengths were checked, and are multiples of every lane count.
    unsafe {
        let column = Column::<L>::new(a);
        let (base, ratio, gain) = (L::splat(base), L::splat(factor.ratio), L::splat(gain));
        let steepest = L::splat((STEEPEST - a) as f32);
        while k < count {
            let b = L::load(squares.as_ptr().add(k));
            let (c, root) = column.residual(b, L::load(roots.as_ptr().add(k)));
            let phase = c.fnma(ratio, L::load(phases.as_ptr().add(k)).add(base));
            let (cos, sin) = cos_sin(phase);
            let mut gain = L::load(gains.as_ptr().add(k)).mul(gain).where_le(b, steepest);
            if points {
                gain = gain.div(root);
            }
            let (gr, gi) = (cos.mul(gain), sin.mul(gain));
            let (ur, ui) = L::load_complex(from.as_ptr().cast::<f32>().add(2 * k));
            let to = sum.as_mut_ptr().cast::<f32>().add(2 * k);
            // Fresh memory is not read: see [`crate::field::zeroed`].
            let (re, im) = if first { (L::splat(0.0), L::splat(0.0)) } else { L::load_complex(to) };
            L::store_complex(gi.fnma(ui, gr.fma(ur, re)), gi.fma(ur, gr.fma(ui, im)), to);
            k += L::COUNT;
        }
    }
}
