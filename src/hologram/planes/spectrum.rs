//! From the painted planes to the panel: the exact angular spectrum, and what the separable kernels left out.
//!
//! The transform of plane k, moment r, is multiplied by
//!
//! ```text
//! exp(i2π ζ_k f_z) · i^r p_r(2πh·c) · √((1 − a)(1 − b)/(1 − a − b)),   a = λ²f_x², b = λ²f_y²
//! c = f_z − separable fit of f_z
//! ```
//!
//! summed over k and r, and transformed back. p_r gathers the powers u^r of the Legendre series
//! e^{ixu} = Σ (2l + 1) i^l j_l(x) P_l(u) up to l = R − 1, u = d/h: the least error over a slab with even depths.
//! ζ_k f_z is split by column and row, with a small rest C: [`dispersion`](crate::hologram::dispersion).

use super::slabs::legendre;
use super::table::mean_square;
use crate::error::Result;
use crate::field::{Complex32, Fft1, Field, Grid, zeroed};
use crate::hologram::definition::Optics;
use crate::hologram::dispersion::{Column, Dispersion, aligned};
use crate::hologram::lanes::{Aligned, InstructionSet, Lanes, cos_sin, dispatch};
use crate::progress::Progress;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Columns or rows that one task takes together: two cache lines of complex f32.
const STRIP: usize = 16;

/// Distance of neighbouring columns in a strip's buffer beyond their length: keeps power-of-two heights off one cache set.
const GAP: usize = 16;

/// The periodic grid of the planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::hologram) struct PlaneGrid {
    /// Columns and rows of the transforms, multiples of 16.
    pub(in crate::hologram) size: [usize; 2],
    /// Rows that can be painted; those below are dark.
    pub(in crate::hologram) painted: usize,
    /// Panel column and row that stand at index 0 of the planes.
    pub(in crate::hologram) origin: [i64; 2],
}

impl PlaneGrid {
    /// The grid of the transforms.
    pub(in crate::hologram) fn grid(&self, optics: &Optics) -> Grid {
        let ([width, height], [pitch_x, pitch_y]) = (self.size, optics.pitch);
        Grid { width, height, pitch_x, pitch_y, center: [0.0; 2] }
    }
}

/// One plane on its way into the spectrum.
struct Plane<'a> {
    /// Its moments, rows transformed.
    moments: &'a [Vec<Complex32>],
    /// ζ/λ, ζ the plane's signed distance before the panel.
    ratio: f64,
    /// ζ·(S(f_y) − 1/λ) modulo one, by row of the transform [turns].
    rows: Aligned,
    /// Whether it is the first: the spectrum begins with it.
    first: bool,
}

/// What a plane's moments are multiplied by in one column of the spectrum.
struct ColumnFactor<'a> {
    a: f64,
    /// ζ·S(f_x) modulo one [turns].
    base: f32,
    /// C, and the amplitude.
    residual: &'a [f32],
    amplitude: &'a [f32],
}

/// What the columns share.
struct Shared {
    layout: PlaneGrid,
    /// Where the taper is dark: largest λ²f² along each axis.
    limit: [f64; 2],
    dispersion: Dispersion,
    /// λ²·mean f² of each axis and 2πh/λ.
    mean: [f64; 2],
    kappa: f64,
    columns: Fft1<f32>,
    set: InstructionSet,
}

/// The spectrum on the panel: planes are added one after another, then it is transformed back.
///
/// Columns stand one after another, `height` + [`GAP`] samples each.
pub(super) struct Spectrum {
    shared: Shared,
    wavelength: f64,
    rows: Fft1<f32>,
    sum: Vec<Complex32>,
    /// Whether no plane was added yet.
    dark: bool,
}

impl Spectrum {
    /// A dark one; `depth` is h [m].
    pub(super) fn new(optics: &Optics, layout: &PlaneGrid, depth: f64, set: InstructionSet) -> Self {
        let [width, height] = layout.size;
        let lambda = optics.wavelength;
        let shared = Shared {
            layout: *layout,
            limit: optics.taper.map(|taper| (lambda * taper.reach(5.0)).powi(2)),
            dispersion: Dispersion::new(&layout.grid(optics), lambda),
            mean: [0, 1].map(|axis| lambda * lambda * mean_square(optics, axis)),
            kappa: TAU * depth / lambda,
            columns: Fft1::new(height),
            set,
        };
        Self { shared, wavelength: lambda, rows: Fft1::new(width), sum: zeroed(width * (height + GAP)), dark: true }
    }

    /// Memory of the spectrum and of the threads that work on it [bytes].
    pub(super) fn bytes(layout: &PlaneGrid, rank: usize) -> u64 {
        let [width, height] = layout.size;
        let column = height + GAP;
        // Of each thread: columns of each moment with the transform's scratch, C and amplitude, or rows on the way back.
        let strip = (STRIP * (rank + 1) * column * 8 + STRIP * height * 8).max((STRIP + 1) * width * 8);
        (width * column * 8 + rayon::current_num_threads() * strip) as u64
    }

    /// Adds a plane at the signed distance ζ before the panel [m]; its moments are transformed in place.
    pub(super) fn add(&mut self, distance: f64, moments: &mut [Vec<Complex32>], progress: &Progress) -> Result<()> {
        let [width, height] = self.shared.layout.size;
        for moment in moments.iter_mut() {
            moment.par_chunks_mut(width * STRIP).for_each_init(
                || self.rows.scratch(),
                |scratch, rows| {
                    if !progress.stopped() {
                        self.rows.forward(rows, scratch);
                    }
                },
            );
        }
        progress.check()?;
        let (shared, ratio) = (&self.shared, distance / self.wavelength);
        let first = std::mem::replace(&mut self.dark, false);
        let plane = Plane { moments, ratio, rows: shared.dispersion.by_row(ratio, |_| 0.0), first };
        self.sum.par_chunks_mut((height + GAP) * STRIP).enumerate().for_each_init(
            || Strip::new(shared, plane.moments.len()),
            |strip, (index, sum)| {
                if !progress.stopped() {
                    strip.add(index * STRIP, shared, &plane, sum);
                    progress.advance(STRIP as u64);
                }
            },
        );
        progress.check()
    }

    /// Transforms back: the field in the panel's window.
    pub(super) fn finish(mut self, grid: &Grid, progress: &Progress) -> Result<Field> {
        let shared = &self.shared;
        let ([width, height], origin) = (shared.layout.size, shared.layout.origin);
        let stride = height + GAP;
        let scale = 1.0 / (width as f32 * height as f32);
        self.sum.par_chunks_mut(stride * STRIP).enumerate().for_each_init(
            || shared.columns.scratch(),
            |scratch, (index, columns)| {
                for (column, a) in columns.chunks_exact_mut(stride).zip(&shared.dispersion.columns[index * STRIP..]) {
                    if *a <= shared.limit[0] && !progress.stopped() {
                        shared.columns.inverse(&mut column[..height], scratch);
                    }
                }
            },
        );
        progress.check()?;
        let sum = &self.sum;
        let mut field = Field::zeros(*grid, self.wavelength);
        field.samples.par_chunks_mut(grid.width * STRIP).enumerate().for_each_init(
            || (vec![Complex32::default(); STRIP * width], self.rows.scratch()),
            |(lines, scratch), (block, samples)| {
                if progress.stopped() {
                    return;
                }
                let count = samples.len() / grid.width;
                let places: [usize; STRIP] = std::array::from_fn(|i| wrap(block * STRIP + i, origin[1], height));
                for (column, from) in sum.chunks_exact(stride).enumerate() {
                    for (i, &row) in places[..count].iter().enumerate() {
                        lines[i * width + column] = from[row] * scale;
                    }
                }
                for (line, row) in lines.chunks_exact_mut(width).zip(samples.chunks_exact_mut(grid.width)) {
                    self.rows.inverse(line, scratch);
                    for (column, u) in row.iter_mut().enumerate() {
                        *u = line[wrap(column, origin[0], width)];
                    }
                }
            },
        );
        progress.check()?;
        Ok(field)
    }
}

/// Index on the periodic grid of a panel's column or row.
fn wrap(index: usize, origin: i64, size: usize) -> usize {
    (index as i64 - origin).rem_euclid(size as i64) as usize
}

/// Buffers of one thread for a strip of columns.
struct Strip {
    /// Columns of each moment, [`STRIP`] of `height` + [`GAP`] each.
    columns: Vec<Vec<Complex32>>,
    /// C and the amplitude of one column of the spectrum.
    residual: Aligned,
    amplitude: Aligned,
    scratch: Vec<Complex32>,
}

impl Strip {
    fn new(shared: &Shared, rank: usize) -> Self {
        let height = shared.layout.size[1];
        Self {
            columns: vec![vec![Complex32::default(); STRIP * (height + GAP)]; rank],
            residual: aligned(height),
            amplitude: aligned(height),
            scratch: shared.columns.scratch(),
        }
    }

    /// Transforms columns `first`… of a plane's moments and adds them to those of the spectrum.
    fn add(&mut self, first: usize, shared: &Shared, plane: &Plane, sum: &mut [Complex32]) {
        let PlaneGrid { size: [width, height], painted, .. } = shared.layout;
        let stride = height + GAP;
        // Beyond its taper a column is dark, and its residual phase without bound.
        let lit: [bool; STRIP] = std::array::from_fn(|i| shared.dispersion.columns[first + i] <= shared.limit[0]);
        for (moment, columns) in plane.moments.iter().zip(&mut self.columns) {
            for row in 0..painted {
                let from = &moment[row * width + first..row * width + first + STRIP];
                for (i, &u) in from.iter().enumerate() {
                    columns[i * stride + row] = u;
                }
            }
            for (column, _) in columns.chunks_exact_mut(stride).zip(lit).filter(|&(_, lit)| lit) {
                column[painted..].fill(Complex32::default());
                shared.columns.forward(&mut column[..height], &mut self.scratch);
            }
        }
        for i in (0..STRIP).filter(|&i| lit[i]) {
            let a = shared.dispersion.columns[first + i];
            let range = i * stride..i * stride + height;
            let moments: Vec<&[Complex32]> = self.columns.iter().map(|columns| &columns[range.clone()]).collect();
            let (moments, sum) = (&moments[..], &mut sum[range]);
            let (residual, amplitude) = (&mut self.residual, &mut self.amplitude);
            let limit = shared.limit[1] as f32;
            // SAFETY: the set was detected; all columns have `height` values, a multiple of every lane count.
            unsafe {
                dispatch!(shared.set, prepare(shared: &Shared, a: f64, limit: f32, residual: &mut Aligned, amplitude: &mut Aligned));
            }
            let base = shared.dispersion.by_column(plane.ratio, first + i, 0.0);
            let column =
                &ColumnFactor { a, base, residual: self.residual.values(), amplitude: self.amplitude.values() };
            // SAFETY: as above.
            unsafe {
                dispatch!(shared.set, accumulate(shared: &Shared, plane: &Plane, column: &ColumnFactor, moments: &[&[Complex32]], sum: &mut [Complex32]));
            }
        }
    }
}

/// C = λ(f_z − S(f_x) − S(f_y)) + 1 and the amplitude of one column, zero beyond `limit` on b.
///
/// # Safety
/// The instruction set of `L` must be enabled; the columns have equal lengths, multiples of the lanes.
#[inline(always)]
unsafe fn prepare<L: Lanes>(shared: &Shared, a: f64, limit: f32, residual: &mut Aligned, amplitude: &mut Aligned) {
    let (squares, roots) = (shared.dispersion.squares.values(), shared.dispersion.roots.values());
    let (residual, amplitude) = (residual.values_mut(), amplitude.values_mut());
    assert!(squares.len() == roots.len() && residual.len() == squares.len() && amplitude.len() == squares.len());
    let mut k = 0;
    // SAFETY: lengths were compared, and are multiples of sixteen by [`Aligned`].
    unsafe {
        let column = Column::<L>::new(a);
        while k < squares.len() {
            let b = L::load(squares.as_ptr().add(k));
            let root_b = L::load(roots.as_ptr().add(k));
            // Both axes stay below the corner of [`Optics`], 0.93; more is dark, and only kept finite here.
            let (c, root) = column.residual(b, root_b);
            L::splat(0.0).sub(c).store(residual.as_mut_ptr().add(k));
            let gain = column.root.mul(root_b).div(root).where_le(b, L::splat(limit));
            gain.store(amplitude.as_mut_ptr().add(k));
            k += L::COUNT;
        }
    }
}

/// Adds the moments of one plane, one column, to the sum, or begins the sum with those of the first.
///
/// # Safety
/// The instruction set of `L` must be enabled.
#[inline(always)]
unsafe fn accumulate<L: Lanes>(
    shared: &Shared,
    plane: &Plane,
    column: &ColumnFactor,
    moments: &[&[Complex32]],
    sum: &mut [Complex32],
) {
    let count = sum.len();
    let ColumnFactor { a, base, residual, amplitude } = *column;
    let first = plane.first;
    let (squares, rows) = (shared.dispersion.squares.values(), plane.rows.values());
    let lengths = [residual.len(), amplitude.len(), squares.len(), rows.len()];
    assert!(count.is_multiple_of(16) && lengths.iter().all(|&n| n >= count));
    assert!(moments.iter().all(|moment| moment.len() == count));
    let [mx, my] = shared.mean;
    // x = κ(C + (m_y·a + m_x·b − m_x·m_y)/4), the residual phase at the slab's edge.
    let mut k = 0;
    // SAFETY: lengths were checked.
    unsafe {
        let constant = L::splat((0.25 * (my * a - mx * my)) as f32);
        let slope = L::splat((0.25 * mx) as f32);
        let scale = L::splat(shared.kappa as f32);
        let (base, ratio) = (L::splat(base), L::splat(plane.ratio as f32));
        while k < count {
            let c = L::load(residual.as_ptr().add(k));
            let phase = c.fma(ratio, L::load(rows.as_ptr().add(k)).add(base));
            let (cos, sin) = cos_sin(phase);
            let gain = L::load(amplitude.as_ptr().add(k));
            let (mut hr, mut hi) = (cos.mul(gain), sin.mul(gain));
            let x = L::load(squares.as_ptr().add(k)).fma(slope, constant).add(c).mul(scale);
            let to = sum.as_mut_ptr().cast::<f32>().add(2 * k);
            // Fresh memory is not read: see [`zeroed`].
            let (mut re, mut im) = if first { (L::splat(0.0), L::splat(0.0)) } else { L::load_complex(to) };
            let weights = legendre::<L>(x, moments.len());
            for (moment, weight) in moments.iter().zip(weights) {
                let (ur, ui) = L::load_complex(moment.as_ptr().cast::<f32>().add(2 * k));
                let (gr, gi) = (hr.mul(weight), hi.mul(weight));
                re = gi.fnma(ui, gr.fma(ur, re));
                im = gi.fma(ur, gr.fma(ui, im));
                // The next moment's factor is a quarter turn on: i^r.
                (hr, hi) = (L::splat(0.0).sub(hi), hr);
            }
            L::store_complex(re, im, to);
            k += L::COUNT;
        }
    }
}
