//! The inner loop where the sphere is not separable over a tile: every pixel from its own path.

use super::factor::{Axis, Limit, Relative, Tile, taper};
use super::kernel::Panels;
use super::shape::COLUMNS;
use crate::hologram::lanes::{Lanes, cos_sin};

/// Adds a batch of points to the tile pixel by pixel, with the exact path: for angles and distances at which the
/// sphere is not separable over a tile. `dx`, `dy` are still those to the tile's centre.
///
/// # Safety
/// As [`super::kernel::add_batch`].
#[inline(always)]
pub(super) unsafe fn add_exact<L: Lanes>(tile: &Tile, points: &[Relative], panels: &mut Panels) {
    assert!(tile.width.is_multiple_of(COLUMNS));
    let (half_x, half_y) = (0.5 * (tile.width as f64 - 1.0), 0.5 * (tile.height as f64 - 1.0));
    let lanes: [f32; 16] = std::array::from_fn(|i| i as f32);
    let (re, im) = (panels.re.values_mut(), panels.im.values_mut());
    for row in 0..tile.height {
        for p in points {
            let dy = p.dy + (row as f64 - half_y) * tile.axes[1].pitch;
            // A tenth of a wavelength keeps the expansion finite on a pixel that the point sits on.
            let r = (p.dx * p.dx + dy * dy + p.distance * p.distance).sqrt().max(0.1 / tile.wavenumber);
            let exact = Exact::new(tile, p, dy, r);
            let mut u = 0;
            while u < tile.width {
                // SAFETY: a vector at column u of a row of the tile.
                unsafe {
                    let at = row * tile.width + u;
                    let lane = L::load(lanes.as_ptr()).add(L::splat(u as f32 - half_x as f32));
                    let (a, b) = exact.at(lane);
                    let (re, im) = (re.as_mut_ptr().add(at), im.as_mut_ptr().add(at));
                    L::load(re).add(a).store(re);
                    L::load(im).add(b).store(im);
                }
                u += L::COUNT;
            }
        }
    }
}

/// The sphere along a row, in units of its radius r at the middle: ρ = √(1 + δ), δ = e(2s + e), e = u·pitch/r.
struct Exact<'a> {
    base: f32,
    /// pitch/r and s = Δx/r.
    step: f32,
    s: f32,
    /// r/λ with the wave's sign.
    turns: f32,
    amplitude: f32,
    sign: f32,
    edge: ExactEdge<'a>,
}

enum ExactEdge<'a> {
    Flat,
    /// Zero beyond this |s + e|.
    Hard(f32),
    /// Segment coordinates scale·sine + offset of each axis, the sine of y at ρ = 1, the levels.
    Soft {
        scale: [f32; 2],
        offset: [f32; 2],
        sine_y: f32,
        levels: [&'a [f32]; 2],
    },
}

impl<'a> Exact<'a> {
    fn new(tile: &Tile<'a>, p: &Relative, dy: f64, r: f64) -> Self {
        let turns = p.sign * r * tile.wavenumber + p.turns;
        let (s, sine_y) = (p.dx / r, (dy / r).abs());
        let mut amplitude = p.amplitude / r;
        let edge = match tile.limit {
            Limit::None => ExactEdge::Flat,
            Limit::Hard => {
                if dy.abs() > p.distance * tile.axes[1].tangent {
                    amplitude = 0.0;
                }
                ExactEdge::Hard((p.distance * tile.axes[0].tangent / r) as f32)
            }
            Limit::Soft(table) => {
                let of = |axis: &Axis, sine: f64| {
                    (axis.scale as f32, axis.offset as f32, table.level(axis.edge * (1.0 - sine * sine) / r))
                };
                let (x, y) = (of(&tile.axes[0], s), of(&tile.axes[1], sine_y));
                ExactEdge::Soft { scale: [x.0, y.0], offset: [x.1, y.1], sine_y: sine_y as f32, levels: [x.2, y.2] }
            }
        };
        Self {
            base: (turns - turns.floor()) as f32,
            step: (tile.axes[0].pitch / r) as f32,
            s: s as f32,
            turns: (p.sign * r * tile.wavenumber) as f32,
            amplitude: amplitude as f32,
            sign: p.sign as f32,
            edge,
        }
    }

    #[inline(always)]
    unsafe fn at<L: Lanes>(&self, u: L) -> (L, L) {
        // SAFETY: the caller's promise.
        unsafe {
            let one = L::splat(1.0);
            let e = u.mul(L::splat(self.step));
            let s = L::splat(self.s);
            let sine = s.add(e);
            let delta = e.mul(s.add(sine));
            // δ > −1 but for rounding on a pixel within a tenth of a wavelength of the point.
            let rho = one.add(delta).max(L::splat(1e-6)).sqrt();
            let inverse = one.div(rho);
            let phase = delta.mul(L::splat(self.turns)).div(one.add(rho)).add(L::splat(self.base));
            let (c, sn) = cos_sin(phase);
            let amplitude = L::splat(self.amplitude).mul(inverse);
            let position = sine.max(L::splat(0.0).sub(sine));
            match &self.edge {
                ExactEdge::Flat => (c.mul(amplitude), sn.mul(amplitude)),
                ExactEdge::Hard(half) => {
                    let amplitude = amplitude.where_le(position, L::splat(*half));
                    (c.mul(amplitude), sn.mul(amplitude))
                }
                ExactEdge::Soft { scale, offset, sine_y, levels } => {
                    let tx = position.mul(inverse).fma(L::splat(scale[0]), L::splat(offset[0]));
                    let ty = L::splat(*sine_y).mul(inverse).fma(L::splat(scale[1]), L::splat(offset[1]));
                    let (xr, xi) = taper::<L>(tx, levels[0]);
                    let (yr, yi) = taper::<L>(ty, levels[1]);
                    let re = xi.fnma(yi, xr.mul(yr)).mul(amplitude);
                    let im = xi.fma(yr, xr.mul(yi)).mul(amplitude.mul(L::splat(self.sign)));
                    (sn.fnma(im, c.mul(re)), sn.fma(re, c.mul(im)))
                }
            }
        }
    }
}
