//! The tile engine's products in 16-bit integers, for processors with AVX-512 VNNI.
//!
//! `vpdpwssd` multiplies and adds twice as many 16-bit numbers as an FMA does f32, and a complex product takes three real
//! ones: re = P₁ − P₂, im = P₃ − P₁ − P₂ with P₁ = Σ x_r·y_r, P₂ = Σ x_i·y_i, P₃ = Σ (x_r + x_i)(y_r + y_i). Integer sums
//! are exact, so nothing is lost in the differences; what is lost is the rounding of the factors
//! ([`INTEGER_NOISE`](super::shape::INTEGER_NOISE)).
//!
//! Sums do not overflow: they are taken modulo 2³², where P₁, P₂ and P₃ may wrap, but |re|, |im| ≤ Σ|x||y| ≤
//! [`BATCH`]·[`LARGEST`]² < 2³¹, so what the differences leave modulo 2³² is the value itself.

use super::batch::{BATCH, Batch};
use super::factor::{self, Factor, Relative, Tile};
use super::fixed::{FULL, Indexes, LONGEST, Strength, UNIT, Wave, evaluate, pair};
use super::kernel::{Panels, ROWS, stride};
use super::shape::COLUMNS;
use crate::hologram::lanes::Avx512;
use std::arch::x86_64::*;

/// Pairs of points of a batch.
const PAIRS: usize = BATCH / 2;

/// Bound on a rounded factor's modulus: the largest cosine times the largest multiplier (which its and its slope's
/// roundings may lift by 1.5), or a tapered factor that f32 has rounded up, and half a place of either part.
const LARGEST: i64 = {
    let flat = LONGEST * (FULL + 1.5) / 32_768.0 + 0.708;
    let tapered = UNIT * 1.000_1 + 0.708;
    (if flat > tapered { flat } else { tapered }) as i64 + 1
};

// |re|, |im| of a batch's sums fit 32 bits; a part's and a sum of parts' fit 16.
const _: () = assert!(BATCH as i64 * LARGEST * LARGEST < 1 << 31 && 2 * LARGEST < 1 << 15);

/// Where factors go, in 32-bit lanes: steps of a pair of points, of a part, of a block of vectors, vectors of a block.
struct Layout {
    pair: usize,
    part: usize,
    block: usize,
    vectors: usize,
}

/// The factors of one axis of a batch; [`UNIT`] stands for `unit`.
struct Panel {
    axis: usize,
    unit: f64,
    layout: Layout,
    to: *mut i32,
}

/// A block of a tile, whose rows are `width` values.
struct Block {
    re: *mut f32,
    im: *mut f32,
    width: usize,
}

/// Adds a batch of points to the tile in `panels`.
///
/// # Safety
/// The processor has the features below. `panels` has been cleared for the tile's size; width is a multiple of
/// [`COLUMNS`], height of [`ROWS`]; at most [`BATCH`] points.
#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx512vnni,avx2,fma")]
pub(super) unsafe fn add_batch(tile: &Tile, points: &[Relative], panels: &mut Panels) {
    assert!(points.len() <= BATCH && tile.width.is_multiple_of(COLUMNS) && tile.height.is_multiple_of(ROWS));
    let half = [0.5 * (tile.width as f64 - 1.0), 0.5 * (tile.height as f64 - 1.0)];
    let batch = Batch::new(tile, points, half);
    let unit = [batch.peak(0, |k| batch.amplitude[k], half[0]), batch.peak(1, |_| 1.0, half[1])];
    if unit[0] == 0.0 {
        return;
    }
    let stride = stride(tile.height);
    let x = panels.x.values_mut();
    let y = panels.y.values_mut();
    assert!(x.len() >= PAIRS * 3 * tile.width && y.len() >= PAIRS * 3 * stride);
    let (x, y) = (x.as_mut_ptr().cast::<i32>(), y.as_mut_ptr().cast::<i32>());
    let layout = Layout { pair: 3 * COLUMNS, part: COLUMNS, block: PAIRS * 3 * COLUMNS, vectors: COLUMNS / 16 };
    let columns = Panel { axis: 0, unit: unit[0], layout, to: x };
    let layout = Layout { pair: 3 * stride, part: stride, block: 16, vectors: 1 };
    let rows = Panel { axis: 1, unit: unit[1], layout, to: y };
    // SAFETY: as asserted.
    unsafe {
        fill(tile, points, &batch, &columns);
        fill(tile, points, &batch, &rows);
    }
    let scale = (unit[0] * unit[1] / (UNIT * UNIT)) as f32;
    let (re, im) = (panels.re.values_mut(), panels.im.values_mut());
    assert!(re.len() >= tile.width * tile.height && im.len() >= tile.width * tile.height);
    for column in 0..tile.width / COLUMNS {
        for row in 0..tile.height / ROWS {
            let at = row * ROWS * tile.width + column * COLUMNS;
            // SAFETY: the block lies inside the tile, every pair's factors were filled above.
            unsafe {
                let to = Block { re: re.as_mut_ptr().add(at), im: im.as_mut_ptr().add(at), width: tile.width };
                let (x, y) = (x.add(column * columns.layout.block), y.add(row * ROWS));
                product(points.len().div_ceil(2), x, y, stride, &to, scale);
            }
        }
    }
}

/// Factors of every pair along an axis.
#[inline]
#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx512vnni,avx2,fma")]
unsafe fn fill(tile: &Tile, points: &[Relative], batch: &Batch, panel: &Panel) {
    let Panel { axis, ref layout, to, .. } = *panel;
    let size = [tile.width, tile.height][axis];
    let (half, vectors) = (0.5 * (size as f64 - 1.0), size.div_ceil(16));
    let inverse = 1.0 / panel.unit;
    let amplitude = |k: usize| inverse * if axis == 0 { batch.amplitude[k] } else { 1.0 };
    let wave = |k: usize| {
        let [base, first, second, third] = &batch.waves[axis];
        Wave([base[k], first[k], second[k], third[k]])
    };
    let strength = |k: usize| Strength::of(amplitude(k), batch.slope[axis][k]);
    let tapered = |k: usize| {
        let mut found = batch.tapered(tile, points.get(k)?, k, axis, half);
        found.amplitude = (amplitude(k) * UNIT) as f32;
        Some(found)
    };
    let start = Indexes::from(-half as f32);
    for number in 0..points.len().div_ceil(2) {
        let [first, second] = [2 * number, 2 * number + 1];
        let place = |vector: usize| {
            number * layout.pair + vector / layout.vectors * layout.block + vector % layout.vectors * 16
        };
        let mut at = start;
        if batch.edge[axis][first] > 0.0 || batch.edge[axis][second] > 0.0 {
            let [first, second] = [tapered(first), tapered(second)];
            for vector in 0..vectors {
                // SAFETY: this function enables the instruction set; the place is inside the panel, as the caller
                // asserted.
                unsafe {
                    let (a, b) = (rounded(&first, at.u), rounded(&second, at.u));
                    let (re, im) = (pair(a.0, b.0), pair(a.1, b.1));
                    put([re, im, _mm512_add_epi16(re, im)], to.add(place(vector)), layout.part);
                }
                at = at.next();
            }
        } else {
            let (waves, strengths) = ([wave(first), wave(second)], [strength(first), strength(second)]);
            for vector in 0..vectors {
                // SAFETY: as above.
                unsafe { put(evaluate(waves, strengths, at), to.add(place(vector)), layout.part) };
                at = at.next();
            }
        }
    }
}

/// A factor as integers; dark where there is none.
///
/// # Safety
/// As [`Lanes`](crate::hologram::lanes::Lanes).
#[inline]
#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx512vnni,avx2,fma")]
unsafe fn rounded(factor: &Option<Factor>, u: __m512) -> (__m512i, __m512i) {
    match factor {
        Some(factor) => {
            // SAFETY: the caller's promise.
            let (re, im) = unsafe { factor::evaluate(factor, Avx512(u)) };
            (_mm512_cvtps_epi32(re.0), _mm512_cvtps_epi32(im.0))
        }
        None => (_mm512_setzero_si512(), _mm512_setzero_si512()),
    }
}

/// Writes the three parts of sixteen indexes of a pair, `step` lanes apart.
///
/// # Safety
/// Sixteen lanes at each place are writable.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
unsafe fn put(parts: [__m512i; 3], to: *mut i32, step: usize) {
    // SAFETY: the caller's promise.
    unsafe {
        _mm512_storeu_epi32(to, parts[0]);
        _mm512_storeu_epi32(to.add(step), parts[1]);
        _mm512_storeu_epi32(to.add(2 * step), parts[2]);
    }
}

/// Adds scale·Σ y·x to a block of `ROWS` rows × `COLUMNS` columns of the tile.
#[inline]
#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx512vnni,avx2,fma")]
unsafe fn product(pairs: usize, mut x: *const i32, mut y: *const i32, stride: usize, block: &Block, scale: f32) {
    let Block { re, im, width } = *block;
    const V: usize = COLUMNS / 16;
    let mut sums = [[[_mm512_setzero_si512(); V]; ROWS]; 3];
    for _ in 0..pairs {
        for (part, sums) in sums.iter_mut().enumerate() {
            // SAFETY: the caller's promise.
            let column = |v: usize| unsafe { _mm512_loadu_epi32(x.add(part * COLUMNS + v * 16)) };
            let columns: [__m512i; V] = [column(0), column(1)];
            for (row, sums) in sums.iter_mut().enumerate() {
                // SAFETY: as above.
                let y = _mm512_set1_epi32(unsafe { *y.add(part * stride + row) });
                for (sum, x) in sums.iter_mut().zip(columns) {
                    *sum = _mm512_dpwssd_epi32(*sum, x, y);
                }
            }
        }
        // SAFETY: as above; after the last pair one past it.
        (x, y) = unsafe { (x.add(3 * COLUMNS), y.add(3 * stride)) };
    }
    let scale = _mm512_set1_ps(scale);
    let [first, second, third] = sums;
    for row in 0..ROWS {
        for v in 0..V {
            let (p, q, both) = (first[row][v], second[row][v], third[row][v]);
            let parts = [(re, _mm512_sub_epi32(p, q)), (im, _mm512_sub_epi32(_mm512_sub_epi32(both, p), q))];
            for (to, sum) in parts {
                // SAFETY: the block lies inside the tile.
                unsafe {
                    let to = to.add(row * width + v * 16);
                    _mm512_storeu_ps(to, _mm512_fmadd_ps(scale, _mm512_cvtepi32_ps(sum), _mm512_loadu_ps(to)));
                }
            }
        }
    }
}
