//! From the painted planes to the panel: the exact angular spectrum, and what the separable kernels left out.
//!
//! The transform of plane k, moment r, is multiplied by
//!
//! ```text
//! exp(i2π ζ_k f_z) · (i2πh·c)^r/r! · √((1 − a)(1 − b)/(1 − a − b)),   a = λ²f_x², b = λ²f_y²
//! c = f_z − separable fit of f_z
//! ```
//!
//! summed over k and r, and transformed back. ζ_k f_z is split as ζ_k S(f_x) + ζ_k (S(f_y) − 1/λ) + ζ_k/λ·C: the first
//! two are reduced modulo one turn in f64, and C, written without cancellation, is small enough for f32.

use super::table::mean_square;
use crate::error::Result;
use crate::field::{Complex32, Field};
use crate::hologram::definition::Optics;
use crate::hologram::lanes::{Aligned, InstructionSet, Lanes, cos_sin, dispatch};
use crate::progress::Progress;
use rayon::prelude::*;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Columns or rows that one task takes together: two cache lines of complex f32.
const STRIP: usize = 16;

/// Distance of neighbouring columns in a strip's buffer beyond their length: keeps power-of-two heights off one cache set.
const GAP: usize = 16;

/// The periodic grid of the planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layout {
    /// Columns and rows of the transforms, multiples of 16.
    pub(super) size: [usize; 2],
    /// Rows that can be painted; those below are dark.
    pub(super) painted: usize,
    /// Panel column and row that stand at index 0 of the planes.
    pub(super) origin: [i64; 2],
}

/// One plane: its moments and signed distance ζ before the panel [m].
#[derive(Debug)]
pub(super) struct Plane {
    pub(super) distance: f64,
    pub(super) moments: Vec<Vec<Complex32>>,
}

/// Phases of one plane, in turns.
struct Carrier {
    /// ζ·(S(f_y) − 1/λ) modulo one, by row of the transform.
    rows: Aligned,
    /// ζ/λ.
    ratio: f32,
}

/// What the columns share.
struct Shared<'a> {
    optics: &'a Optics,
    /// b = λ²f_y² and √(1 − b), by row of the transform.
    squares: Aligned,
    roots: Aligned,
    carriers: Vec<Carrier>,
    /// λ²·mean f² of each axis and 2πh/λ.
    mean: [f64; 2],
    kappa: f64,
    set: InstructionSet,
}

/// Propagates the planes to the panel and adds them up. `depth` is h.
pub(super) fn propagate(
    field: &mut Field,
    optics: &Optics,
    layout: &Layout,
    planes: &mut [Plane],
    depth: f64,
    set: InstructionSet,
    progress: &Progress,
) -> Result<()> {
    let [width, height] = layout.size;
    let mut planner = FftPlanner::<f32>::new();
    let rows = [planner.plan_fft_forward(width), planner.plan_fft_inverse(width)];
    let columns = [planner.plan_fft_forward(height), planner.plan_fft_inverse(height)];
    for plane in planes.iter_mut() {
        for moment in &mut plane.moments {
            moment.par_chunks_mut(width * STRIP).for_each_init(
                || vec![Complex32::default(); rows[0].get_inplace_scratch_len()],
                |scratch, rows_of| {
                    if !progress.stopped() {
                        rows[0].process_with_scratch(rows_of, scratch);
                    }
                },
            );
        }
    }
    progress.check()?;
    let lambda = optics.wavelength;
    let frequency = |k: usize, n: usize, pitch: f64| {
        let signed = if k < n.div_ceil(2) { k as f64 } else { k as f64 - n as f64 };
        signed / (n as f64 * pitch)
    };
    let (mut squares, mut roots) = (aligned(height), aligned(height));
    let fy: Vec<f64> = (0..height).map(|k| frequency(k, height, optics.pitch[1])).collect();
    for (k, f) in fy.iter().enumerate() {
        let b = (lambda * f).powi(2);
        squares.values_mut()[k] = b as f32;
        roots.values_mut()[k] = (1.0 - b).max(0.0).sqrt() as f32;
    }
    let carriers = planes
        .iter()
        .map(|plane| {
            let mut rows = aligned(height);
            for (row, f) in rows.values_mut().iter_mut().zip(&fy) {
                let b = (lambda * f).powi(2).min(1.0);
                let turns = -plane.distance / lambda * b / (1.0 + (1.0 - b).sqrt());
                *row = (turns - turns.round()) as f32;
            }
            Carrier { rows, ratio: (plane.distance / lambda) as f32 }
        })
        .collect();
    let mean = [0, 1].map(|axis| lambda * lambda * mean_square(optics, axis));
    let shared = Shared { optics, squares, roots, carriers, mean, kappa: TAU * depth / lambda, set };
    let grid = field.grid;
    let mut turned = vec![Complex32::default(); width * grid.height];
    let planes = &*planes;
    turned.par_chunks_mut(grid.height * STRIP).enumerate().for_each_init(
        || Strip::new(layout, planes[0].moments.len(), &columns),
        |strip, (index, out)| {
            if !progress.stopped() {
                strip.run(index * STRIP, layout, planes, &shared, &columns, out);
                progress.advance(STRIP as u64);
            }
        },
    );
    progress.check()?;
    let turned = &turned;
    let inverse = &rows[1];
    field.samples.par_chunks_mut(grid.width * STRIP).enumerate().for_each_init(
        || (vec![Complex32::default(); STRIP * width], vec![Complex32::default(); inverse.get_inplace_scratch_len()]),
        |(lines, scratch), (block, samples)| {
            let count = samples.len() / grid.width;
            for column in 0..width {
                let from = column * grid.height + block * STRIP;
                for (i, &u) in turned[from..from + count].iter().enumerate() {
                    lines[i * width + column] = u;
                }
            }
            for (line, row) in lines.chunks_exact_mut(width).zip(samples.chunks_exact_mut(grid.width)) {
                inverse.process_with_scratch(line, scratch);
                for (column, u) in row.iter_mut().enumerate() {
                    *u += line[wrap(column, layout.origin[0], width)];
                }
            }
        },
    );
    Ok(())
}

/// Index on the periodic grid of a panel's column or row.
fn wrap(index: usize, origin: i64, size: usize) -> usize {
    (index as i64 - origin).rem_euclid(size as i64) as usize
}

fn aligned(count: usize) -> Aligned {
    let mut values = Aligned::default();
    values.reserve(count);
    values
}

/// Buffers of one thread for a strip of columns.
struct Strip {
    /// Columns of each moment, then their sum; [`STRIP`] of `height` + [`GAP`] each.
    columns: Vec<Vec<Complex32>>,
    sum: Vec<Complex32>,
    /// C and the amplitude of one column of the spectrum.
    residual: Vec<Aligned>,
    amplitude: Vec<Aligned>,
    scratch: Vec<Complex32>,
}

impl Strip {
    fn new(layout: &Layout, rank: usize, plans: &[Arc<dyn Fft<f32>>; 2]) -> Self {
        let height = layout.size[1];
        let zero = Complex32::default();
        let scratch = plans.iter().map(|plan| plan.get_inplace_scratch_len()).max().unwrap_or(0);
        Self {
            columns: vec![vec![zero; STRIP * (height + GAP)]; rank],
            sum: vec![zero; STRIP * (height + GAP)],
            residual: vec![aligned(height); STRIP],
            amplitude: vec![aligned(height); STRIP],
            scratch: vec![zero; scratch],
        }
    }

    /// Columns `first`… of the spectrum: transforms, multiplies, adds up, transforms back, and writes the panel's rows.
    fn run(
        &mut self,
        first: usize,
        layout: &Layout,
        planes: &[Plane],
        shared: &Shared,
        plans: &[Arc<dyn Fft<f32>>; 2],
        out: &mut [Complex32],
    ) {
        let [width, height] = layout.size;
        let stride = height + GAP;
        let rows = out.len() / STRIP;
        let lambda = shared.optics.wavelength;
        // Beyond its taper a column is dark, and its residual phase without bound.
        let limit = shared.optics.taper.map(|taper| (lambda * taper.reach(5.0)).powi(2));
        let a: [f64; STRIP] = std::array::from_fn(|i| {
            let k = (first + i) as f64;
            let signed = if first + i < width.div_ceil(2) { k } else { k - width as f64 };
            (lambda * signed / (width as f64 * shared.optics.pitch[0])).powi(2)
        });
        self.sum.fill(Complex32::default());
        for i in (0..STRIP).filter(|&i| a[i] <= limit[0]) {
            let (residual, amplitude) = (&mut self.residual[i], &mut self.amplitude[i]);
            let (a, limit) = (a[i], limit[1] as f32);
            // SAFETY: the set was detected; all columns have `height` values, a multiple of every lane count.
            unsafe {
                dispatch!(shared.set, prepare(shared: &Shared, a: f64, limit: f32, residual: &mut Aligned, amplitude: &mut Aligned));
            }
        }
        for (plane, carrier) in planes.iter().zip(&shared.carriers) {
            for (moment, columns) in plane.moments.iter().zip(&mut self.columns) {
                for row in 0..layout.painted {
                    let from = &moment[row * width + first..row * width + first + STRIP];
                    for (i, &u) in from.iter().enumerate() {
                        columns[i * stride + row] = u;
                    }
                }
                for (i, column) in columns.chunks_exact_mut(stride).enumerate() {
                    if a[i] <= limit[0] {
                        column[layout.painted..].fill(Complex32::default());
                        plans[0].process_with_scratch(&mut column[..height], &mut self.scratch);
                    }
                }
            }
            for i in (0..STRIP).filter(|&i| a[i] <= limit[0]) {
                // ζ·S(f_x) in f64, reduced.
                let turns = plane.distance / lambda * (1.0 - a[i]).sqrt();
                let base = (turns - turns.round()) as f32;
                let a = a[i];
                let range = i * stride..i * stride + height;
                let moments: Vec<&[Complex32]> = self.columns.iter().map(|columns| &columns[range.clone()]).collect();
                let moments = &moments[..];
                let sum = &mut self.sum[range.clone()];
                let (residual, amplitude) = (self.residual[i].values(), self.amplitude[i].values());
                // SAFETY: as above.
                unsafe {
                    dispatch!(shared.set, accumulate(shared: &Shared, carrier: &Carrier, base: f32, a: f64, residual: &[f32], amplitude: &[f32], moments: &[&[Complex32]], sum: &mut [Complex32]));
                }
            }
        }
        let scale = 1.0 / (width as f32 * height as f32);
        for (column, out) in self.sum.chunks_exact_mut(stride).zip(out.chunks_exact_mut(rows)) {
            plans[1].process_with_scratch(&mut column[..height], &mut self.scratch);
            for (row, u) in out.iter_mut().enumerate() {
                *u = column[wrap(row, layout.origin[1], height)] * scale;
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
    let (squares, roots) = (shared.squares.values(), shared.roots.values());
    let (residual, amplitude) = (residual.values_mut(), amplitude.values_mut());
    assert!(squares.len() == roots.len() && residual.len() == squares.len() && amplitude.len() == squares.len());
    let mut k = 0;
    // SAFETY: lengths were compared, and are multiples of sixteen by [`Aligned`].
    unsafe {
        let one = L::splat(1.0);
        let (va, root_a) = (L::splat(a as f32), L::splat((1.0 - a).sqrt() as f32));
        let outer = one.div(one.add(root_a));
        while k < squares.len() {
            let b = L::load(squares.as_ptr().add(k));
            let root_b = L::load(roots.as_ptr().add(k));
            // Both axes stay below the corner of [`Optics`], 0.93; more is dark, and only kept finite here.
            let root = one.sub(va).sub(b).max(L::splat(0.01)).sqrt();
            let sum = one.div(root.add(root_b)).add(outer);
            let c = va.mul(b).mul(sum).div(one.add(root_b).mul(root.add(root_a)));
            L::splat(0.0).sub(c).store(residual.as_mut_ptr().add(k));
            let gain = root_a.mul(root_b).div(root).where_le(b, L::splat(limit));
            gain.store(amplitude.as_mut_ptr().add(k));
            k += L::COUNT;
        }
    }
}

/// Adds the moments of one plane, one column, to the sum.
///
/// # Safety
/// The instruction set of `L` must be enabled.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // one column's state, kept out of structs that would be built per column
unsafe fn accumulate<L: Lanes>(
    shared: &Shared,
    carrier: &Carrier,
    base: f32,
    a: f64,
    residual: &[f32],
    amplitude: &[f32],
    moments: &[&[Complex32]],
    sum: &mut [Complex32],
) {
    let count = sum.len();
    let (squares, rows) = (shared.squares.values(), carrier.rows.values());
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
        let (base, ratio) = (L::splat(base), L::splat(carrier.ratio));
        while k < count {
            let c = L::load(residual.as_ptr().add(k));
            let phase = c.fma(ratio, L::load(rows.as_ptr().add(k)).add(base));
            let (cos, sin) = cos_sin(phase);
            let gain = L::load(amplitude.as_ptr().add(k));
            let (mut hr, mut hi) = (cos.mul(gain), sin.mul(gain));
            let x = L::load(squares.as_ptr().add(k)).fma(slope, constant).add(c).mul(scale);
            let to = sum.as_mut_ptr().cast::<f32>().add(2 * k);
            let (mut re, mut im) = L::load_complex(to);
            for (r, moment) in moments.iter().enumerate() {
                if r > 0 {
                    let step = x.mul(L::splat(1.0 / r as f32));
                    (hr, hi) = (L::splat(0.0).sub(hi.mul(step)), hr.mul(step));
                }
                let (ur, ui) = L::load_complex(moment.as_ptr().cast::<f32>().add(2 * k));
                re = hi.fnma(ui, hr.fma(ur, re));
                im = hi.fma(ur, hr.fma(ui, im));
            }
            L::store_complex(re, im, to);
            k += L::COUNT;
        }
    }
}
