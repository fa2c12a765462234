//! The inner loops of the tile engine: factors of a batch of points on one tile, and their product.
//!
//! About the tile's centre, with u columns and v rows from it, r(u, v) = r(u, 0) + r(0, v) − r(0, 0) + ε, so a batch of
//! points is a complex matrix product of X (points × columns) and Y (points × rows). |ε| is bounded in
//! [`super::shape`].

use super::edge::{EdgeTable, SEGMENTS};
use super::shape::Kernel;
use crate::hologram::Cull;
use crate::hologram::definition::Optics;
use crate::hologram::lanes::{Aligned, Lanes, cos_sin};
use std::f64::consts::PI;

/// Points of a batch: X of 32 columns and one block of Y stay in a first-level cache of 32 KB.
pub(super) const BATCH: usize = 64;

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

/// Columns that a tile's width is a multiple of.
pub(super) const COLUMNS: usize = 32;

/// Points of a batch relative to a tile's centre.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Relative {
    /// From the point to the tile's centre [m].
    pub(super) dx: f64,
    /// From the point to the tile's centre [m].
    pub(super) dy: f64,
    /// Distance from the panel, |z| [m].
    pub(super) distance: f64,
    /// Amplitude.
    pub(super) amplitude: f64,
    /// Initial phase [turns].
    pub(super) turns: f64,
    /// +1 for a diverging wave, −1 for a converging one.
    pub(super) sign: f64,
}

/// What the kernels need to know about one axis of the panel and of the class's edge table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axis {
    /// Step of the coordinate per index; negative for rows, which run against y [m].
    pub(crate) pitch: f64,
    /// Tangent of the cone's half angle.
    pub(crate) tangent: f64,
    /// Segment coordinate of a direction's sine: scale·sine + offset.
    pub(crate) scale: f64,
    /// As `scale`.
    pub(crate) offset: f64,
    /// q = edge·(1 − sine²)/r [m].
    pub(crate) edge: f64,
}

impl Axis {
    /// Constants of axis 0 (columns) or 1 (rows).
    pub(crate) fn new(optics: &Optics, axis: usize, limit: Limit) -> Self {
        let (taper, wavelength) = (optics.taper[axis], optics.wavelength);
        let density = match limit {
            Limit::Soft(table) => table.density(),
            Limit::None | Limit::Hard => 0.0,
        };
        Self {
            pitch: if axis == 0 { optics.pitch[0] } else { -optics.pitch[1] },
            tangent: optics.cone(axis, 1.0),
            scale: density / (wavelength * taper.width),
            offset: 0.5 * SEGMENTS as f64 - density * taper.middle / taper.width,
            edge: 1.0 / (PI * wavelength * taper.width * taper.width),
        }
    }
}

/// How a factor is limited at the cone's edge.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Limit<'a> {
    /// Not at all.
    None,
    /// Cut at |Δ| = |z|·tangent.
    Hard,
    /// Tapered.
    Soft(&'a EdgeTable),
}

impl<'a> Limit<'a> {
    /// The limit with its table.
    pub(crate) fn new(cull: Cull, table: &'a EdgeTable) -> Self {
        match cull {
            Cull::Soft => Self::Soft(table),
            Cull::Hard => Self::Hard,
            Cull::None => Self::None,
        }
    }
}

/// A phase and an amplitude along one axis of the tile, as polynomials of the index from its centre.
#[derive(Clone, Copy)]
pub(super) struct Factor<'a> {
    /// Turns: base + f[0]·u + f[1]·u² + f[2]·u³.
    pub(super) base: f32,
    f: [f32; 3],
    /// amplitude·(1 + slope·u).
    pub(super) amplitude: f32,
    slope: f32,
    sign: f32,
    edge: Edge<'a>,
}

#[derive(Clone, Copy)]
enum Edge<'a> {
    Flat,
    /// Zero where |offset + u| > half.
    Hard {
        offset: f32,
        half: f32,
    },
    /// Segment coordinate t[0] + t[1]·u + t[2]·u² into a level.
    Soft {
        t: [f32; 3],
        level: &'a [f32],
    },
}

impl Factor<'_> {
    /// One that nothing limits: the phase's powers [turns], and the amplitude, which grows by the part `slope` an index.
    #[cfg(target_arch = "x86_64")]
    pub(super) fn flat([base, first, second, third]: [f32; 4], amplitude: f32, slope: f32) -> Self {
        Self { base, f: [first, second, third], amplitude, slope, sign: 1.0, edge: Edge::Flat }
    }
}

/// Third-order expansion of the sphere along an axis: `offset` = Δ on it at the tile's centre, `half` its half size in
/// indexes, `inverse` = 1/r.
#[inline(always)]
pub(super) fn factor<'a>(job: &Job<'a>, axis: &Axis, p: &Relative, offset: f64, inverse: f64, half: f64) -> Factor<'a> {
    let step = axis.pitch * inverse;
    let s = offset * inverse;
    let bend = 1.0 - s * s;
    let scale = p.sign * axis.pitch * job.wavenumber;
    let second = 0.5 * scale * bend * step;
    let f = [(scale * s) as f32, second as f32, (-second * s * step) as f32];
    let edge = match job.limit {
        Limit::None => Edge::Flat,
        Limit::Hard => {
            let limit = p.distance * axis.tangent;
            if offset.abs() + half * axis.pitch.abs() <= limit {
                Edge::Flat
            } else {
                let position = (offset / axis.pitch) as f32;
                Edge::Hard { offset: position, half: (limit / axis.pitch.abs()) as f32 }
            }
        }
        Limit::Soft(table) => {
            let side = if s < 0.0 { -axis.scale } else { axis.scale };
            let t0 = side * s + axis.offset;
            let t1 = side * bend * step;
            let t2 = -1.5 * t1 * s * step;
            if t0 + t1.abs() * half + t2.abs() * half * half <= 0.0 {
                Edge::Flat
            } else {
                let level = table.level(axis.edge * bend * inverse);
                Edge::Soft { t: [t0 as f32, t1 as f32, t2 as f32], level }
            }
        }
    };
    Factor { base: 0.0, f, amplitude: 1.0, slope: (-s * step) as f32, sign: p.sign as f32, edge }
}

/// The factor at indexes `u`: (re, im).
///
/// # Safety
/// As [`Lanes`].
#[inline(always)]
pub(super) unsafe fn evaluate<L: Lanes>(factor: &Factor, u: L) -> (L, L) {
    // SAFETY: the caller's promise; a level has its eight runs of sixteen.
    unsafe {
        let [f1, f2, f3] = factor.f.map(|f| L::splat(f));
        let phase = f3.fma(u, f2).fma(u, f1).fma(u, L::splat(factor.base));
        let (c, s) = cos_sin(phase);
        let a = L::splat(factor.amplitude);
        let amplitude = L::splat(factor.slope).mul(a).fma(u, a);
        match factor.edge {
            Edge::Flat => (c.mul(amplitude), s.mul(amplitude)),
            Edge::Hard { offset, half } => {
                let position = u.add(L::splat(offset));
                let inside = position.max(L::splat(0.0).sub(position));
                let amplitude = amplitude.where_le(inside, L::splat(half));
                (c.mul(amplitude), s.mul(amplitude))
            }
            Edge::Soft { t: [t0, t1, t2], level } => {
                let t = L::splat(t2).fma(u, L::splat(t1)).fma(u, L::splat(t0));
                let (re, im) = taper::<L>(t, level);
                let (re, im) = (re.mul(amplitude), im.mul(amplitude.mul(L::splat(factor.sign))));
                (s.fnma(im, c.mul(re)), s.fma(re, c.mul(im)))
            }
        }
    }
}

/// T at segment coordinates `t`: (re, im) for a diverging wave.
///
/// # Safety
/// As [`Lanes`]; `level` is one of an [`EdgeTable`].
#[inline(always)]
pub(crate) unsafe fn taper<L: Lanes>(t: L, level: &[f32]) -> (L, L) {
    // SAFETY: the caller's promise; a level has its eight runs of sixteen.
    unsafe {
        let t = t.max(L::splat(0.0)).min(L::splat(15.999_99));
        let index = t.index();
        let w = t.sub(L::number(index));
        let coefficient = |n: usize| L::lookup(level.as_ptr().add(n * SEGMENTS), index);
        let re = coefficient(3).fma(w, coefficient(2)).fma(w, coefficient(1)).fma(w, coefficient(0));
        let im = coefficient(7).fma(w, coefficient(6)).fma(w, coefficient(5)).fma(w, coefficient(4));
        (re, im)
    }
}

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

/// One tile's size and what its points have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Job<'a> {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) axes: &'a [Axis; 2],
    /// 1/λ [1/m].
    pub(super) wavenumber: f64,
    pub(super) limit: Limit<'a>,
}

/// Adds a batch of points to the tile in `panels`.
///
/// # Safety
/// The instruction set of `L` must be enabled. `panels` has been cleared for the job's size; width is a multiple of
/// [`COLUMNS`], height of [`ROWS`]; at most [`BATCH`] points.
#[inline(always)]
pub(super) unsafe fn add_batch<L: Lanes>(job: &Job, points: &[Relative], panels: &mut Panels) {
    assert!(points.len() <= BATCH && job.width.is_multiple_of(COLUMNS) && job.height.is_multiple_of(ROWS));
    let block = block_columns::<L>();
    let (half_x, half_y) = (0.5 * (job.width as f64 - 1.0), 0.5 * (job.height as f64 - 1.0));
    let lanes: [f32; 16] = std::array::from_fn(|i| i as f32);
    let (x, y, line) = (panels.x.values_mut(), panels.y.values_mut(), panels.line.values_mut());
    let lines = job.height.next_multiple_of(16);
    for (k, p) in points.iter().enumerate() {
        let r = (p.dx * p.dx + p.dy * p.dy + p.distance * p.distance).sqrt();
        let inverse = 1.0 / r;
        let turns = p.sign * r * job.wavenumber + p.turns;
        let mut fx = factor(job, &job.axes[0], p, p.dx, inverse, half_x);
        fx.base = (turns - turns.floor()) as f32;
        fx.amplitude = (p.amplitude * inverse) as f32;
        let fy = factor(job, &job.axes[1], p, p.dy, inverse, half_y);
        // SAFETY: block·2·BATCH values for each block of columns, so the offsets end below BATCH·2·width; `line` has
        // 2·lines values and `y` 2·BATCH·height, as cleared.
        unsafe {
            let lane = L::load(lanes.as_ptr());
            let mut u = 0;
            while u < job.width {
                let (re, im) = evaluate(&fx, lane.add(L::splat(u as f32 - half_x as f32)));
                let to = x.as_mut_ptr().add((u / block * BATCH + k) * 2 * block + u % block);
                re.store(to);
                im.store(to.add(block));
                u += L::COUNT;
            }
            let mut v = 0;
            while v < job.height {
                let (re, im) = evaluate(&fy, lane.add(L::splat(v as f32 - half_y as f32)));
                re.store(line.as_mut_ptr().add(v));
                im.store(line.as_mut_ptr().add(lines + v));
                v += L::COUNT;
            }
            for rows in 0..job.height / ROWS {
                let to = y.as_mut_ptr().add((rows * BATCH + k) * 2 * ROWS);
                for i in 0..ROWS {
                    *to.add(i) = *line.get_unchecked(rows * ROWS + i);
                    *to.add(ROWS + i) = *line.get_unchecked(lines + rows * ROWS + i);
                }
            }
        }
    }
    let (re, im) = (panels.re.values_mut(), panels.im.values_mut());
    for columns in 0..job.width / block {
        for rows in 0..job.height / ROWS {
            let x = &panels.x.values()[columns * BATCH * 2 * block..];
            let y = &panels.y.values()[rows * BATCH * 2 * ROWS..];
            let at = rows * ROWS * job.width + columns * block;
            // SAFETY: the block lies inside the tile, the panels were filled above for every point.
            unsafe {
                let (re, im) = (re.as_mut_ptr().add(at), im.as_mut_ptr().add(at));
                if L::COUNT == 16 {
                    product::<L, 2>(points.len(), x.as_ptr(), y.as_ptr(), re, im, job.width);
                } else {
                    product::<L, 1>(points.len(), x.as_ptr(), y.as_ptr(), re, im, job.width);
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
