//! Painting: each point as the outer product of two tabulated kernels, onto the plane that is nearest to it.
//!
//! Points are sorted into bins of pixels; a bin is painted into a patch of its own that stays in the second-level cache,
//! patches of a wave are painted in parallel, and then added to the plane row by row in the bins' order, so that the
//! sum does not depend on the number of threads.

use super::table::Table;
use crate::error::Result;
use crate::field::Complex32;
use crate::hologram::lanes::{Aligned, InstructionSet, Lanes, dispatch};
use crate::progress::Progress;
use rayon::prelude::*;

/// Points painted together: a patch's row is loaded and stored once for all of them.
pub(super) const GROUP: usize = 3;

/// Cells of splats that are painted one after another [px].
pub(super) const CELL: usize = 16;

/// Side of a bin for kernels of the given half sizes [px]: a patch is the bin and the kernels' reach around it, and what
/// of it is reach is painted, cleared and added more than once. Larger bins have less of that, as long as the patch
/// stays in the second-level cache, or does not in either size.
pub(super) fn bin(half: [usize; 2], rank: usize) -> usize {
    const CACHE: usize = 768 << 10;
    let patch = |bin: usize| half.iter().map(|half| bin + 2 * half).product::<usize>() * 8 * rank;
    if patch(128) > CACHE && patch(64) <= CACHE { 64 } else { 128 }
}

/// Most splats of one patch: a crowded bin is shared among threads, and f32 sums of more terms lose digits.
const LARGEST: usize = 4096;

/// Patches that are painted before they are added: few, so that they stay in a cache, but some for every thread. The
/// order in which they are added does not depend on their number.
pub(super) fn wave() -> usize {
    (4 * rayon::current_num_threads()).max(16)
}

/// Rows that one task adds to.
const BAND: usize = 16;

/// A point relative to its plane.
#[derive(Clone, Copy, Debug)]
pub(in crate::hologram) struct Splat {
    /// Fractional column and row on the plane.
    pub(in crate::hologram) at: [f64; 2],
    /// Signed depth from the plane [m].
    pub(in crate::hologram) d: f64,
    /// Amplitude and phase, without what the kernels carry.
    pub(in crate::hologram) factor: [f32; 2],
}

/// What all splats share.
#[derive(Debug)]
pub(super) struct Brush<'a> {
    /// Kernels along x and y.
    pub(super) tables: [&'a Table; 2],
    /// Half width of the painted span per metre of depth [px/m], along x and y.
    pub(super) slope: [f64; 2],
    /// Pixels painted beyond the cone.
    pub(super) tail: f64,
    /// Number of moments: plane r takes the splat times (d/h)^r.
    pub(super) rank: usize,
    /// Largest |d|, h [m].
    pub(super) depth: f64,
    /// Side of a bin [px], a multiple of [`CELL`].
    pub(super) bin: usize,
}

/// The moments of one plane, rows of `width` samples each.
#[derive(Debug)]
pub(super) struct Canvas<'a> {
    pub(super) width: usize,
    pub(super) moments: &'a mut [Vec<Complex32>],
}

/// Patches of a wave; kept from plane to plane, since memory that was not touched before is slow.
#[derive(Debug, Default)]
pub(super) struct Patches(Vec<Patch>);

#[derive(Debug, Default)]
struct Patch {
    first: [usize; 2],
    width: usize,
    height: usize,
    re: Aligned,
    im: Aligned,
}

/// Memory for sorting, of one splat [bytes].
pub(super) const ORDER_BYTES: usize = size_of::<(u64, u32, u32)>() + size_of::<u32>();

/// Memory of one wave of patches, for kernels of the given half sizes [px], and of the threads that paint [bytes].
pub(super) fn bytes(half: [usize; 2], rank: usize) -> u64 {
    let bin = bin(half, rank);
    let [width, height] = half.map(|half| 2 * half + bin + 20);
    let lines = 4 * (GROUP * 2 * (width + 32) + 2 * (GROUP + 1) * (height + 32));
    (wave() * (width + 16) * height * 8 * rank + rayon::current_num_threads() * lines) as u64
}

/// Paints splats, which must lie on the canvas with their whole kernels.
pub(super) fn paint(
    canvas: &mut Canvas,
    brush: &Brush,
    splats: &[Splat],
    Patches(patches): &mut Patches,
    set: InstructionSet,
    progress: &Progress,
) -> Result<()> {
    let bins = bins(splats, canvas.width, brush.bin);
    patches.resize_with(patches.len().max(wave().min(bins.len())), Patch::default);
    for wave in bins.chunks(wave()) {
        patches.par_iter_mut().zip(wave).for_each(|(patch, bin)| {
            if !progress.stopped() {
                paint_bin(patch, brush, splats, bin, set, progress);
            }
        });
        progress.check()?;
        let patches = &patches[..wave.len()];
        for (r, plane) in canvas.moments.iter_mut().enumerate() {
            let width = canvas.width;
            plane.par_chunks_mut(width * BAND).enumerate().for_each(|(band, rows)| {
                let first = band * BAND;
                for patch in patches {
                    // SAFETY: the set was detected on this machine.
                    unsafe {
                        dispatch!(set, add_patch(patch: &Patch, r: usize, first: usize, width: usize, rows: &mut [Complex32]));
                    }
                }
            });
        }
        progress.advance(wave.iter().map(|bin| bin.len() as u64).sum());
    }
    Ok(())
}

/// Indexes of the splats of each bin that has any, bins in row-major order, within a bin near ones beside each other; a
/// crowded bin comes in several parts.
fn bins(splats: &[Splat], width: usize, bin: usize) -> Vec<Vec<u32>> {
    let across = width.div_ceil(bin) as u64;
    let side = bin as u64;
    let cells = side / CELL as u64;
    let key = |splat: &Splat| {
        let [x, y] = splat.at.map(|p| p as u64);
        let bin = (y / side) * across + x / side;
        // Cells in boustrophedon order: a group's kernels are of similar size and place, so little of their union is
        // wasted.
        let (cx, cy) = (x % side / CELL as u64, y % side / CELL as u64);
        (bin * cells + cy) * cells + if cy % 2 == 0 { cx } else { cells - 1 - cx }
    };
    // Positive floats are in the order of their bits; equal ones keep their order by the index.
    let entry = |(i, splat): (usize, &Splat)| (key(splat), (splat.d.abs() as f32).to_bits(), i as u32);
    let mut order: Vec<(u64, u32, u32)> = splats.par_iter().enumerate().map(entry).collect();
    order.par_sort_unstable();
    order
        .chunk_by(|a, b| a.0 / (cells * cells) == b.0 / (cells * cells))
        .flat_map(|bin| bin.chunks(LARGEST))
        .map(|bin| bin.iter().map(|entry| entry.2).collect())
        .collect()
}

/// Half size of a splat's kernel [px].
fn reach(brush: &Brush, axis: usize, d: f64) -> f64 {
    d.abs() * brush.slope[axis] + brush.tail
}

/// First pixel of the splats' kernels, and the one behind their last, along each axis.
fn span(brush: &Brush, splats: &[Splat], members: &[u32]) -> [[usize; 2]; 2] {
    let mut span = [[usize::MAX, 0]; 2];
    for &i in members {
        let splat = &splats[i as usize];
        for (axis, span) in span.iter_mut().enumerate() {
            let reach = reach(brush, axis, splat.d);
            let first = (splat.at[axis] - reach).max(0.0) as usize;
            let last = (splat.at[axis] + reach) as usize + 2;
            *span = [span[0].min(first), span[1].max(last)];
        }
    }
    span
}

fn paint_bin(
    patch: &mut Patch,
    brush: &Brush,
    splats: &[Splat],
    bin: &[u32],
    set: InstructionSet,
    progress: &Progress,
) {
    let span = span(brush, splats, bin);
    patch.first = [span[0][0], span[1][0]];
    patch.width = (span[0][1] - span[0][0]).next_multiple_of(16);
    patch.height = span[1][1] - span[1][0];
    let size = patch.width * patch.height * brush.rank;
    for part in [&mut patch.re, &mut patch.im] {
        part.reserve(size);
        part.values_mut()[..size].fill(0.0);
    }
    // SAFETY: the set was detected on this machine.
    unsafe {
        dispatch!(set, paint_groups(patch: &mut Patch, brush: &Brush, splats: &[Splat], bin: &[u32], progress: &Progress));
    }
}

/// # Safety
/// The instruction set of `L` must be enabled.
#[inline(always)]
unsafe fn paint_groups<L: Lanes>(patch: &mut Patch, brush: &Brush, splats: &[Splat], bin: &[u32], progress: &Progress) {
    let (width, height) = (patch.width, patch.height);
    // Kernels of a group: x as re and im of `width`, y as re and im of one splat, then (re, im) of all splats by row.
    let tall = height.next_multiple_of(16) + 16;
    let mut lines = Aligned::default();
    lines.reserve(GROUP * 2 * (width + 16) + 2 * tall + GROUP * 2 * tall);
    let (xs, rest) = lines.values_mut().split_at_mut(GROUP * 2 * (width + 16));
    let (line, ys) = rest.split_at_mut(2 * tall);
    for group in bin.chunks(GROUP) {
        // All points may lie in one bin.
        if progress.stopped() {
            return;
        }
        let own = span(brush, splats, group);
        let [span_x, span_y] = [0, 1].map(|axis| own[axis].map(|at| at - patch.first[axis]));
        // Whole vectors, from an aligned one: the patch's width is a multiple of sixteen.
        let first = span_x[0] / L::COUNT * L::COUNT;
        let columns = (span_x[1].min(width) - first).next_multiple_of(L::COUNT);
        let rows = span_y[1].min(height) - span_y[0];
        if group.len() < GROUP {
            xs[group.len() * 2 * columns..GROUP * 2 * columns].fill(0.0);
            ys[..rows * GROUP * 2].fill(0.0);
        }
        // SAFETY: `columns` ≤ width and `rows` rounded up ≤ tall fit their lines; spans lie inside the patch.
        unsafe {
            for (n, &i) in group.iter().enumerate() {
                let splat = &splats[i as usize];
                let x = xs.as_mut_ptr().add(n * 2 * columns);
                let start = (patch.first[0] + first) as isize;
                brush.tables[0].write::<L>(splat.d, splat.at[0], start, columns, x, x.add(columns));
                let start = (patch.first[1] + span_y[0]) as isize;
                let y = line.as_mut_ptr();
                let padded = rows.next_multiple_of(L::COUNT);
                brush.tables[1].write::<L>(splat.d, splat.at[1], start, padded, y, y.add(tall));
                let [a, b] = splat.factor;
                for row in 0..rows {
                    let (re, im) = (line[row], line[tall + row]);
                    ys[(row * GROUP + n) * 2] = re * a - im * b;
                    ys[(row * GROUP + n) * 2 + 1] = re * b + im * a;
                }
            }
            for r in 0..brush.rank {
                if r > 0 {
                    let scale: [f32; GROUP] = std::array::from_fn(|n| {
                        group.get(n).map_or(0.0, |&i| (splats[i as usize].d / brush.depth) as f32)
                    });
                    for y in ys[..rows * GROUP * 2].chunks_exact_mut(GROUP * 2) {
                        for n in 0..GROUP {
                            y[2 * n] *= scale[n];
                            y[2 * n + 1] *= scale[n];
                        }
                    }
                }
                let at = (r * height + span_y[0]) * width + first;
                let (re, im) = (patch.re.values_mut(), patch.im.values_mut());
                assert!(at + (rows - 1) * width + columns <= re.len() && re.len() == im.len());
                let (re, im) = (re.as_mut_ptr().add(at), im.as_mut_ptr().add(at));
                let products = Products { xs: xs.as_ptr(), columns, ys: ys.as_ptr(), rows };
                update::<L>(Target { re, im, stride: width }, products);
            }
        }
    }
}

/// Kernels of a group: Σ_n y[row][n]·x[n] over `rows` × `columns` values.
#[derive(Clone, Copy)]
struct Products {
    xs: *const f32,
    columns: usize,
    ys: *const f32,
    rows: usize,
}

/// Where they are added: values of a patch, `stride` from row to row.
#[derive(Clone, Copy)]
struct Target {
    re: *mut f32,
    im: *mut f32,
    stride: usize,
}

/// Adds products to a patch.
#[inline(always)]
unsafe fn update<L: Lanes>(to: Target, products: Products) {
    let (columns, mut column) = (products.columns, 0);
    // SAFETY: the caller's promise.
    unsafe {
        if L::COUNT == 16 {
            while column + 2 * L::COUNT <= columns {
                strip::<L, 2>(to, products, column);
                column += 2 * L::COUNT;
            }
        }
        while column < columns {
            strip::<L, 1>(to, products, column);
            column += L::COUNT;
        }
    }
}

#[inline(always)]
unsafe fn strip<L: Lanes, const V: usize>(to: Target, products: Products, column: usize) {
    let (Target { re, im, stride }, Products { xs, columns, ys, rows }) = (to, products);
    // SAFETY: the caller's promise.
    unsafe {
        let zero = L::splat(0.0);
        let mut xr = [[zero; V]; GROUP];
        let mut xi = [[zero; V]; GROUP];
        for n in 0..GROUP {
            for v in 0..V {
                let from = xs.add(n * 2 * columns + column + v * L::COUNT);
                xr[n][v] = L::load(from);
                xi[n][v] = L::load(from.add(columns));
            }
        }
        for row in 0..rows {
            let to_re = re.add(row * stride + column);
            let to_im = im.add(row * stride + column);
            let mut a = [zero; V];
            let mut b = [zero; V];
            for v in 0..V {
                a[v] = L::load(to_re.add(v * L::COUNT));
                b[v] = L::load(to_im.add(v * L::COUNT));
            }
            for n in 0..GROUP {
                let y = ys.add((row * GROUP + n) * 2);
                let (yr, yi) = (L::splat(*y), L::splat(*y.add(1)));
                for v in 0..V {
                    a[v] = yi.fnma(xi[n][v], yr.fma(xr[n][v], a[v]));
                    b[v] = yi.fma(xr[n][v], yr.fma(xi[n][v], b[v]));
                }
            }
            for v in 0..V {
                a[v].store(to_re.add(v * L::COUNT));
                b[v].store(to_im.add(v * L::COUNT));
            }
        }
    }
}

/// Adds moment `r` of a patch to the rows of a plane that begin at `first`.
///
/// # Safety
/// The instruction set of `L` must be enabled.
#[inline(always)]
unsafe fn add_patch<L: Lanes>(patch: &Patch, r: usize, first: usize, width: usize, rows: &mut [Complex32]) {
    let count = rows.len() / width;
    let low = first.max(patch.first[1]);
    let high = (first + count).min(patch.first[1] + patch.height);
    let columns = patch.width.min(width - patch.first[0]);
    for row in low..high {
        let from = (r * patch.height + row - patch.first[1]) * patch.width;
        let to = (row - first) * width + patch.first[0];
        let (re, im) = (&patch.re.values()[from..from + columns], &patch.im.values()[from..from + columns]);
        let line = &mut rows[to..to + columns];
        let whole = columns / L::COUNT * L::COUNT;
        for i in (0..whole).step_by(L::COUNT) {
            // SAFETY: i + COUNT ≤ columns, the length of all three.
            unsafe {
                let u = line.as_mut_ptr().add(i).cast::<f32>();
                let (ur, ui) = L::load_complex(u);
                let (re, im) = (L::load(re.as_ptr().add(i)), L::load(im.as_ptr().add(i)));
                L::store_complex(ur.add(re), ui.add(im), u);
            }
        }
        for i in whole..columns {
            line[i].re += re[i];
            line[i].im += im[i];
        }
    }
}
