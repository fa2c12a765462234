//! The tile engine's products in bfloat16, for processors with a matrix unit.
//!
//! With the rows' factors once as (re, −im) and once as (im, re), both parts of a complex product are products of pairs
//! with the columns' (re, im): nothing is multiplied in vain. Factors are rounded to 8 bits
//! ([`BFLOAT_NOISE`](super::shape::BFLOAT_NOISE)), each to its own size, so it does not matter how bright others are;
//! sums are f32.

use super::batch::{BATCH, Batch};
use super::factor::{Factor, Relative, Tile, evaluate};
use super::kernel::{LONG_BATCH, Panels};
use super::shape::COLUMNS;
use crate::hologram::lanes::Avx512;
use crate::hologram::lanes::matrix::{BLOCK, SIDE, Unit};
use std::arch::x86_64::*;

/// Adds a batch of points to the tile in `panels`.
///
/// # Safety
/// The processor has the features below and the unit. `panels` has been cleared for the tile's size and this kernel; width
/// is a multiple of [`COLUMNS`], height of [`SIDE`]; at most [`LONG_BATCH`] points.
#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx2,fma")]
pub(super) unsafe fn add_batch<U: Unit>(tile: &Tile, points: &[Relative], panels: &mut Panels) {
    assert!(points.len() <= LONG_BATCH && tile.width.is_multiple_of(COLUMNS) && tile.height.is_multiple_of(SIDE));
    let half = [0.5 * (tile.width as f64 - 1.0), 0.5 * (tile.height as f64 - 1.0)];
    let count = points.len().div_ceil(SIDE);
    let (x, y) = (panels.x.values_mut(), panels.y.values_mut());
    assert!(x.len() >= LONG_BATCH * tile.width && y.len() >= 2 * LONG_BATCH * tile.height);
    let (x, y) = (x.as_mut_ptr().cast::<u32>(), y.as_mut_ptr().cast::<u32>());
    for (part, points) in points.chunks(BATCH).enumerate() {
        let batch = Batch::new(tile, points, half);
        for sixteen in 0..points.len().div_ceil(SIDE) {
            let block = part * BATCH / SIDE + sixteen;
            let factors = |axis: usize| -> [Factor; SIDE] {
                std::array::from_fn(|i| batch.factor(tile, points, sixteen * SIDE + i, axis, half[axis]))
            };
            // SAFETY: count blocks of sixteen points for each vector of columns, twice for each of rows, as asserted.
            unsafe {
                for (point, factor) in factors(0).iter().enumerate() {
                    let mut at = start(half[0]);
                    for vector in 0..tile.width / SIDE {
                        let place = ((vector / 2 * count + block) * 2 + vector % 2) * BLOCK + point * SIDE;
                        let (re, im) = evaluate(factor, Avx512(at));
                        _mm512_store_epi32(x.add(place).cast(), pairs(re.0, im.0));
                        at = _mm512_add_ps(at, _mm512_set1_ps(SIDE as f32));
                    }
                }
                let factors = factors(1);
                let mut at = start(half[1]);
                for vector in 0..tile.height / SIDE {
                    let mut lines = [_mm512_setzero_si512(); SIDE];
                    for (line, factor) in lines.iter_mut().zip(&factors) {
                        let (re, im) = evaluate(factor, Avx512(at));
                        *line = pairs(re.0, _mm512_sub_ps(_mm512_setzero_ps(), im.0));
                    }
                    let to = y.add((vector * count + block) * 2 * BLOCK);
                    for (row, line) in transpose(lines).into_iter().enumerate() {
                        // (re, −im), then (im, re).
                        let exchanged = _mm512_xor_si512(_mm512_rol_epi32::<16>(line), _mm512_set1_epi32(0x8000));
                        _mm512_store_epi32(to.add(row * SIDE).cast(), line);
                        _mm512_store_epi32(to.add(BLOCK + row * SIDE).cast(), exchanged);
                    }
                    at = _mm512_add_ps(at, _mm512_set1_ps(SIDE as f32));
                }
            }
        }
    }
    let (re, im) = (panels.re.values_mut(), panels.im.values_mut());
    assert!(re.len() >= tile.width * tile.height && im.len() >= tile.width * tile.height);
    // SAFETY: the unit is present; blocks lie inside the tile, all their factors were filled above.
    unsafe {
        U::begin();
        for column in 0..tile.width / COLUMNS {
            for row in 0..tile.height / SIDE {
                let at = row * SIDE * tile.width + column * COLUMNS;
                let (x, y) = (x.add(column * count * 2 * BLOCK), y.add(row * count * 2 * BLOCK));
                U::product(count, y, x, re.as_mut_ptr().add(at), im.as_mut_ptr().add(at), tile.width);
            }
        }
        U::end();
    }
}

/// The first sixteen indexes from the tile's centre.
#[inline]
#[target_feature(enable = "avx512f")]
fn start(half: f64) -> __m512 {
    let lanes: [f32; SIDE] = std::array::from_fn(|i| i as f32 - half as f32);
    // SAFETY: sixteen values.
    unsafe { _mm512_loadu_ps(lanes.as_ptr()) }
}

/// Pairs of numbers rounded to bfloat16, as [`pair`](crate::hologram::lanes::matrix::pair).
#[inline]
#[target_feature(enable = "avx512f")]
fn pairs(low: __m512, high: __m512) -> __m512i {
    let rounded = |x: __m512| _mm512_add_epi32(_mm512_castps_si512(x), _mm512_set1_epi32(0x8000));
    let (low, high) = (_mm512_srli_epi32::<16>(rounded(low)), rounded(high));
    // The upper half of `high`, the lower one of `low`.
    _mm512_ternarylogic_epi32::<0xca>(_mm512_set1_epi32(0xffff_0000_u32 as i32), high, low)
}

/// Rows become columns: of pairs of lines, of fours, then of the four quarters.
#[inline]
#[target_feature(enable = "avx512f")]
fn transpose(lines: [__m512i; SIDE]) -> [__m512i; SIDE] {
    let mut pairs = lines;
    for i in (0..SIDE).step_by(2) {
        pairs[i] = _mm512_unpacklo_epi32(lines[i], lines[i + 1]);
        pairs[i + 1] = _mm512_unpackhi_epi32(lines[i], lines[i + 1]);
    }
    // quarters[4g + j]: of lines 4g … 4g + 3, column j of each quarter of a vector.
    let mut quarters = pairs;
    for i in (0..SIDE).step_by(4) {
        quarters[i] = _mm512_unpacklo_epi64(pairs[i], pairs[i + 2]);
        quarters[i + 1] = _mm512_unpackhi_epi64(pairs[i], pairs[i + 2]);
        quarters[i + 2] = _mm512_unpacklo_epi64(pairs[i + 1], pairs[i + 3]);
        quarters[i + 3] = _mm512_unpackhi_epi64(pairs[i + 1], pairs[i + 3]);
    }
    let mut columns = quarters;
    for j in 0..4 {
        let [a, b, c, d] = [0, 4, 8, 12].map(|group| quarters[group + j]);
        let (even_low, odd_low) = (_mm512_shuffle_i32x4::<0x88>(a, b), _mm512_shuffle_i32x4::<0xdd>(a, b));
        let (even_high, odd_high) = (_mm512_shuffle_i32x4::<0x88>(c, d), _mm512_shuffle_i32x4::<0xdd>(c, d));
        columns[j] = _mm512_shuffle_i32x4::<0x88>(even_low, even_high);
        columns[8 + j] = _mm512_shuffle_i32x4::<0xdd>(even_low, even_high);
        columns[4 + j] = _mm512_shuffle_i32x4::<0x88>(odd_low, odd_high);
        columns[12 + j] = _mm512_shuffle_i32x4::<0xdd>(odd_low, odd_high);
    }
    columns
}
