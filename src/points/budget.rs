//! How many points: as many as are asked for, and no more than can be seen apart.
//!
//! Rays stand on a grid of equal cells, one in each: strata, so that no part of the picture is sampled more densely than
//! another and an edge is found within one cell. A budget therefore chooses the grid. Two things limit what is seen:
//!
//! - the *eye* separates 1/60° (20/20 vision): 2·w / (E·tan 1/60°) cells over a window of half width w at distance E;
//! - the *panel* separates spots of max(p, λ|z|/D) at depth z, with its pitch p and extent D: λ/(2 sin θ) with either the
//!   whole cone sin θ = λ/2p of a pixel or, far from the panel, the cone of the whole panel.

use super::placed::place;
use super::placement::{Phase, Placing};
use super::trace::{TraceSettings, Traced, trace};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::illumination::Illumination;
use crate::progress::Progress;
use glam::DVec2;
use serde::Serialize;

/// Angle that a healthy eye separates [rad]: one minute of arc.
pub const EYE_ANGLE: f64 = std::f64::consts::PI / 180.0 / 60.0;

/// Rays of the first look: the share of a shape's area on such a grid is right to a few tenths of a per cent.
const PILOT: f64 = 10_000.0;
/// What a number of points may be off.
const NEAR: f64 = 0.03;

/// How many points a scene should become.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Budget {
    /// About this many, at most what the panel resolves.
    Points(usize),
    /// What an eye resolves, at most what the panel does.
    Eye,
    /// What the panel resolves.
    Panel,
}

/// Cells across and down that can be told apart in the viewing window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Resolution {
    /// By an eye at its place: 1/60°.
    pub eye: [f64; 2],
    /// By the panel, at the depth of those asked for where it is best.
    pub panel: [f64; 2],
}

/// What set the number of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Limit {
    /// What was asked for.
    Budget,
    /// The eye's resolution.
    Eye,
    /// The panel's resolution.
    Panel,
}

/// A grid of rays and why it is this one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Rays {
    /// Across and down.
    pub size: [u32; 2],
    /// What set it.
    pub limit: Limit,
    /// What can be resolved.
    pub resolution: Resolution,
}

impl Resolution {
    /// Of a placing on a panel at a wavelength [m], for content between two depths z [m].
    pub fn new(placing: &Placing, depths: (f64, f64), panel: &Grid, wavelength: f64) -> Self {
        let eye = 2.0 * placing.window / (placing.eye.z * EYE_ANGLE.tan());
        let at = |z: f64| {
            let spot = DVec2::new(
                panel.pitch_x.max(wavelength * z.abs() / panel.extent_x()),
                panel.pitch_y.max(wavelength * z.abs() / panel.extent_y()),
            );
            2.0 * placing.view_at(z) / spot
        };
        let panel = at(depths.0).max(at(depths.1));
        Self { eye: eye.to_array(), panel: panel.to_array() }
    }
}

impl Budget {
    /// Traces a scene into this number of points: a few rays tell what share of them becomes points, and how deep they
    /// stand. Of `settings` only the shape of the grid is kept. No grid is returned where no ray meets light.
    ///
    /// # Errors
    /// As [`trace`] and [`Budget::rays`].
    pub fn trace(
        self,
        light: &Illumination,
        settings: &TraceSettings,
        placing: &Placing,
        panel: &Grid,
        wavelength: f64,
        progress: &Progress,
    ) -> Result<(Traced, Option<Rays>)> {
        let cast = |settings: &TraceSettings| trace(light, &placing.camera, settings, progress);
        let shape = [settings.width, settings.height];
        let scale = (PILOT / (f64::from(shape[0]) * f64::from(shape[1]))).sqrt().min(1.0);
        let [width, height] = shape.map(|side| (f64::from(side) * scale).ceil().max(1.0) as u32);
        let pilot = cast(&TraceSettings { width, height, edge_rays: 1, ..*settings })?;
        let share = |traced: &Traced| traced.points.len() as f64 / (f64::from(traced.width) * f64::from(traced.height));
        let placed = place(&pilot.world_points(), placing, Phase::Zero, panel, wavelength);
        let Some(depths) = placed.cloud.depth_range() else { return Ok((pilot, None)) };
        let resolution = Resolution::new(placing, depths, panel, wavelength);
        let mut rays = self.rays(shape, share(&pilot), resolution)?;
        let mut best: Option<(f64, Traced, Rays)> = None;
        // Fine structure may fool the first look; the second knows the finer grid's share.
        for _ in 0..3 {
            let traced = cast(&TraceSettings { width: rays.size[0], height: rays.size[1], jitter: true, ..*settings })?;
            let off = match (self, rays.limit) {
                (Self::Points(count), Limit::Budget) => (traced.points.len() as f64 / count as f64).ln().abs(),
                _ => 0.0,
            };
            let next = if off > NEAR && !traced.points.is_empty() {
                Some(self.rays(shape, share(&traced), resolution)?).filter(|next| next.size != rays.size)
            } else {
                None
            };
            if best.as_ref().is_none_or(|(least, ..)| off < *least) {
                best = Some((off, traced, rays));
            }
            match next {
                Some(next) => rays = next,
                None => break,
            }
        }
        Ok(best.map_or((pilot, None), |(_, traced, rays)| (traced, Some(rays))))
    }

    /// The grid of rays of the shape width : height that gives the points when a share `lit` of the rays becomes one
    /// (more than 1 where rays give several).
    ///
    /// Neither side passes the limits of [`Resolution`]; at least one ray is cast.
    ///
    /// # Errors
    /// [`Error::Parameter`] for no points, and for a share that is not positive.
    pub fn rays(self, shape: [u32; 2], lit: f64, resolution: Resolution) -> Result<Rays> {
        if !(lit > 0.0 && lit.is_finite()) {
            return Err(Error::parameter("points", "no ray meets light, so there is nothing to count"));
        }
        let shape = shape.map(|side| f64::from(side.max(1)));
        let wanted = match self {
            Self::Points(0) => return Err(Error::parameter("points", "a budget of no points")),
            Self::Points(count) => (count as f64 / lit / (shape[0] * shape[1])).sqrt(),
            Self::Eye | Self::Panel => f64::INFINITY,
        };
        // Largest scale of the shape at which both sides keep within a resolution.
        let within = |cells: [f64; 2]| (cells[0] / shape[0]).min(cells[1] / shape[1]);
        let eye = if self == Self::Eye { within(resolution.eye) } else { f64::INFINITY };
        let panel = within(resolution.panel);
        let scale = wanted.min(eye).min(panel);
        let limit = if scale == wanted {
            Limit::Budget
        } else if scale == eye {
            Limit::Eye
        } else {
            Limit::Panel
        };
        let size = match limit {
            Limit::Budget => nearest(shape, wanted, resolution.panel),
            Limit::Eye | Limit::Panel => shape.map(|side| floor(side * scale)),
        };
        Ok(Rays { size, limit, resolution })
    }
}

/// The sides about scale × shape whose product is nearest to that area, not beyond `most`.
///
/// Rounding each by itself would miss a small budget by a tenth: of the two ways to round each side, the best.
fn nearest(shape: [f64; 2], scale: f64, most: [f64; 2]) -> [u32; 2] {
    let area = shape[0] * shape[1] * scale * scale;
    let sides = |i: usize| {
        let low = floor(shape[i] * scale);
        [low, (low + 1).min(floor(most[i]))]
    };
    let all = sides(0).into_iter().flat_map(|w| sides(1).map(|h| [w, h]));
    let off = |[w, h]: [u32; 2]| (f64::from(w) * f64::from(h) / area).ln().abs();
    all.min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or([1, 1])
}

/// Down to a whole number of cells, at least one.
fn floor(cells: f64) -> u32 {
    // 65 536 is the largest side that pictures have here.
    // The hair keeps a whole number whole.
    (cells * (1.0 + 1e-12)).floor().clamp(1.0, 65_536.0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::Placement;
    use crate::scene::{Camera, Projection, Scene};
    use glam::DVec3;

    fn placing(panel: &Grid) -> Placing {
        let mut camera = Camera::looking_at(DVec3::Z, DVec3::ZERO, 0.7);
        camera.projection = Projection::Perspective { yfov: 0.7, aspect: None };
        Placement::default().prepare(&Scene::default(), &camera, 1.0, panel).expect("placing")
    }

    #[test]
    fn limits_are_the_analytic_ones() {
        let panel = Grid::new(1920, 1080, 8e-6, 8e-6).expect("panel");
        let placing = placing(&panel);
        // A window of 8.64 mm from 600 mm is 49.5 minutes of arc.
        let near = Resolution::new(&placing, (-0.1, -0.15), &panel, 632.8e-9);
        assert!((near.eye[0] - 8.64e-3 / (0.6 * 2.908_882e-4)).abs() < 1e-3, "{near:?}");
        // At 150 mm the cone is that of a pixel: spots of one pitch on the 10.8 mm that are seen there.
        assert!((near.panel[0] - 10.8e-3 / 8e-6).abs() < 1e-6, "{near:?}");
        // Down, the panel's 8.64 mm limit the cone from 109 mm on; at 100 mm it is that of a pixel on 10.08 mm.
        assert!((near.panel[1] - 10.08e-3 / 8e-6).abs() < 1e-6, "{near:?}");
        // At 10 m the whole panel is the aperture: λz/D is 412 µm across and 732 µm down.
        let far = Resolution::new(&placing, (-10.0, -10.0), &panel, 632.8e-9);
        let view = 8.64e-3 * 10.6 / 0.6;
        assert!((far.panel[0] - view * 15.36e-3 / (632.8e-9 * 10.0)).abs() < 1e-6, "{far:?}");
        assert!((far.panel[1] - view * 8.64e-3 / (632.8e-9 * 10.0)).abs() < 1e-6, "{far:?}");
    }

    #[test]
    fn grids_meet_the_budget_and_pass_no_limit() {
        let resolution = Resolution { eye: [50.0, 40.0], panel: [1350.0, 1080.0] };
        for (count, lit, shape) in [
            (100_000, 0.6, [500, 500]),
            (100_000, 1.7, [1920, 1080]),
            (1000, 1.0, [4, 3]),
            (300, 0.25, [1, 1]),
            (7, 0.9, [16, 9]),
        ] {
            let rays = Budget::Points(count).rays(shape, lit, resolution).expect("rays");
            let points = f64::from(rays.size[0]) * f64::from(rays.size[1]) * lit;
            let allowed = if count > 100 { 0.03 } else { 0.3 };
            assert!((points / count as f64 - 1.0).abs() < allowed, "{count}: {rays:?} give {points}");
            assert_eq!(rays.limit, Limit::Budget);
        }
        let most = Budget::Points(10_000_000).rays([1, 1], 0.5, resolution).expect("rays");
        assert_eq!((most.size, most.limit), ([1080, 1080], Limit::Panel));
        let wide = Budget::Panel.rays([5, 4], 0.5, resolution).expect("rays");
        assert_eq!((wide.size, wide.limit), ([1350, 1080], Limit::Panel));
        let seen = Budget::Eye.rays([1, 1], 0.5, resolution).expect("rays");
        assert_eq!((seen.size, seen.limit), ([40, 40], Limit::Eye));
        // A panel coarser than the eye: the panel decides.
        let coarse = Resolution { eye: [5000.0; 2], ..resolution };
        assert_eq!(Budget::Eye.rays([1, 1], 0.5, coarse).expect("rays").limit, Limit::Panel);
        assert!(Budget::Points(0).rays([1, 1], 0.5, resolution).is_err());
        assert!(Budget::Points(9).rays([1, 1], 0.0, resolution).is_err());
    }
}
