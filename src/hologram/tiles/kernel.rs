//! The inner loops of the tile engine: factors of a batch of points on one tile, and their product.
//!
//! About the tile's centre, with u columns and v rows from it, r(u, v) = r(u, 0) + r(0, v) − r(0, 0) + ε, so a batch of
//! points is a complex matrix product of X (points × columns) and Y (points × rows). |ε| is bounded in
//! [`super::shape`].

use super::batch::{BATCH, Batch};
use super::factor::{Relative, Tile, evaluate};
use super::shape::{COLUMNS, Kernel};
use crate::hologram::lanes::{Aligned, Lanes};

/// Points of a batch for the matrix unit: its sums are read and written less often.
pub(super) const LONG_BATCH: usize = 2 * BATCH;

/// Points of a batch for a kernel.
pub(super) const fn batch(kernel: Kernel) -> usize {
    match kernel {
        Kernel::Bfloat => LONG_BATCH,
        Kernel::Paths | Kernel::Float | Kernel::Integer => BATCH,
    }
}

/// Rows of the product's register block.
pub(super) const ROWS: usize = 4;

/// Memory of one thread: the factors of a batch and the tile that they are summed into.
#[derive(Debug, Default)]
pub(super) struct Panels {
    pub(super) x: Aligned,
    pub(super) y: Aligned,
    line: Aligned,
    /// Real and imaginary part, `width × height` each.
    pub(super) re: Aligned,
    /// As `re`.
    pub(super) im: Aligned,
}

/// Memory of [`Panels`] for a tile [bytes].
pub(super) fn bytes(width: usize, height: usize, kernel: Kernel) -> u64 {
    let factors = BATCH * 2 * width + row_factors(height, kernel) + 2 * (height.max(width) + 32);
    4 * (factors + 2 * width * height + 5 * 16) as u64
}

/// Values that the factors of rows take; those of columns take [`BATCH`]·2 each with every kernel.
fn row_factors(height: usize, kernel: Kernel) -> usize {
    match kernel {
        Kernel::Bfloat => LONG_BATCH * 2 * height,
        Kernel::Integer => BATCH / 2 * 3 * stride(height),
        Kernel::Paths | Kernel::Float => BATCH * 2 * height.next_multiple_of(ROWS),
    }
}

/// Stride of the rows' factors in products of integers: whole vectors, an odd number of cache lines, so that the lines
/// of one block of rows do not fall on the same sets of the first-level cache.
pub(super) const fn stride(height: usize) -> usize {
    let lines = height.div_ceil(16);
    16 * (lines + (lines + 1) % 2)
}

impl Panels {
    /// Room for a tile, dark.
    pub(super) fn clear(&mut self, width: usize, height: usize, kernel: Kernel) {
        self.x.reserve(BATCH * 2 * width);
        self.y.reserve(row_factors(height, kernel));
        self.line.reserve(2 * (height.max(width) + 32));
        for part in [&mut self.re, &mut self.im] {
            part.reserve(width * height);
            part.values_mut().fill(0.0);
        }
    }
}

/// Adds a batch of points to the tile in `panels`.
///
/// # Safety
/// The instruction set of `L` must be enabled. `panels` has been cleared for the tile's size; width is a multiple of
/// [`COLUMNS`], height of [`ROWS`]; at most [`BATCH`] points.
#[inline(always)]
pub(super) unsafe fn add_batch<L: Lanes>(tile: &Tile, points: &[Relative], panels: &mut Panels) {
    assert!(points.len() <= BATCH && tile.width.is_multiple_of(COLUMNS) && tile.height.is_multiple_of(ROWS));
    let block = block_columns::<L>();
    let [half_x, half_y] = [tile.width, tile.height].map(|size| 0.5 * (size as f64 - 1.0));
    let lanes: [f32; 16] = std::array::from_fn(|i| i as f32);
    let (x, y, line) = (panels.x.values_mut(), panels.y.values_mut(), panels.line.values_mut());
    let lines = tile.height.next_multiple_of(16);
    let batch = Batch::new(tile, points, [half_x, half_y]);
    for k in 0..points.len() {
        let fx = batch.factor(tile, points, k, 0, half_x);
        let fy = batch.factor(tile, points, k, 1, half_y);
        // SAFETY: block·2·BATCH values for each block of columns, so the offsets end below BATCH·2·width; `line` has
        // 2·lines values and `y` 2·BATCH·height, as cleared.
        unsafe {
            let lane = L::load(lanes.as_ptr());
            let mut u = 0;
            while u < tile.width {
                let (re, im) = evaluate(&fx, lane.add(L::splat(u as f32 - half_x as f32)));
                let to = x.as_mut_ptr().add((u / block * BATCH + k) * 2 * block + u % block);
                re.store(to);
                im.store(to.add(block));
                u += L::COUNT;
            }
            let mut v = 0;
            while v < tile.height {
                let (re, im) = evaluate(&fy, lane.add(L::splat(v as f32 - half_y as f32)));
                re.store(line.as_mut_ptr().add(v));
                im.store(line.as_mut_ptr().add(lines + v));
                v += L::COUNT;
            }
            for rows in 0..tile.height / ROWS {
                let to = y.as_mut_ptr().add((rows * BATCH + k) * 2 * ROWS);
                let from = line.as_ptr().add(rows * ROWS);
                std::ptr::copy_nonoverlapping(from, to, ROWS);
                std::ptr::copy_nonoverlapping(from.add(lines), to.add(ROWS), ROWS);
            }
        }
    }
    let (re, im) = (panels.re.values_mut(), panels.im.values_mut());
    for columns in 0..tile.width / block {
        for rows in 0..tile.height / ROWS {
            let x = &panels.x.values()[columns * BATCH * 2 * block..];
            let y = &panels.y.values()[rows * BATCH * 2 * ROWS..];
            let at = rows * ROWS * tile.width + columns * block;
            // SAFETY: the block lies inside the tile, the panels were filled above for every point.
            unsafe {
                let (re, im) = (re.as_mut_ptr().add(at), im.as_mut_ptr().add(at));
                if L::COUNT == 16 {
                    product::<L, 2>(points.len(), x.as_ptr(), y.as_ptr(), re, im, tile.width);
                } else {
                    product::<L, 1>(points.len(), x.as_ptr(), y.as_ptr(), re, im, tile.width);
                }
            }
        }
    }
}

/// Columns of the register block: two vectors where there are 32 registers, one where there are 16.
const fn block_columns<L: Lanes>() -> usize {
    if L::COUNT == 16 { 32 } else { L::COUNT }
}

/// Adds Σ_k y_k·x_k to a block of `ROWS` × `V` vectors of the tile.
#[inline(always)]
unsafe fn product<L: Lanes, const V: usize>(
    count: usize,
    mut x: *const f32,
    mut y: *const f32,
    re: *mut f32,
    im: *mut f32,
    stride: usize,
) {
    // SAFETY: the caller's promise.
    unsafe {
        let zero = L::splat(0.0);
        let mut sum_re = [[zero; V]; ROWS];
        let mut sum_im = [[zero; V]; ROWS];
        for _ in 0..count {
            let mut xr = [zero; V];
            let mut xi = [zero; V];
            for v in 0..V {
                xr[v] = L::load(x.add(v * L::COUNT));
                xi[v] = L::load(x.add((V + v) * L::COUNT));
            }
            for i in 0..ROWS {
                let (yr, yi) = (L::splat(*y.add(i)), L::splat(*y.add(ROWS + i)));
                for v in 0..V {
                    sum_re[i][v] = yi.fnma(xi[v], yr.fma(xr[v], sum_re[i][v]));
                    sum_im[i][v] = yi.fma(xr[v], yr.fma(xi[v], sum_im[i][v]));
                }
            }
            x = x.add(2 * V * L::COUNT);
            y = y.add(2 * ROWS);
        }
        for i in 0..ROWS {
            for v in 0..V {
                let at = i * stride + v * L::COUNT;
                L::load(re.add(at)).add(sum_re[i][v]).store(re.add(at));
                L::load(im.add(at)).add(sum_im[i][v]).store(im.add(at));
            }
        }
    }
}
