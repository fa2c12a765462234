//! Factors: a point's wave along one axis of a tile, with the taper or the cut that limits it.

use super::edge::{EdgeTable, SEGMENTS};
use crate::hologram::Cull;
use crate::hologram::definition::Optics;
use crate::hologram::lanes::{Lanes, cos_sin};
use std::f64::consts::PI;

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

/// One tile's size and what its points have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tile<'a> {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) axes: &'a [Axis; 2],
    /// 1/λ [1/m].
    pub(super) wavenumber: f64,
    pub(super) limit: Limit<'a>,
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
    pub(super) fn flat([base, first, second, third]: [f32; 4], amplitude: f32, slope: f32) -> Self {
        Self { base, f: [first, second, third], amplitude, slope, sign: 1.0, edge: Edge::Flat }
    }
}

/// Third-order expansion of the sphere along an axis: `offset` = Δ on it at the tile's centre, `half` its half size in
/// indexes, `inverse` = 1/r.
#[inline(always)]
pub(super) fn factor<'a>(
    tile: &Tile<'a>,
    axis: &Axis,
    p: &Relative,
    offset: f64,
    inverse: f64,
    half: f64,
) -> Factor<'a> {
    let step = axis.pitch * inverse;
    let s = offset * inverse;
    let bend = 1.0 - s * s;
    let scale = p.sign * axis.pitch * tile.wavenumber;
    let second = 0.5 * scale * bend * step;
    let f = [(scale * s) as f32, second as f32, (-second * s * step) as f32];
    let edge = match tile.limit {
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
