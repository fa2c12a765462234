//! From the scene's metres to the panel's: the one place that scales a room to a hologram.
//!
//! *Window*: the camera's frustum is carried onto the pyramid from the viewer's eye through the panel, so that what the
//! viewer sees is the camera's picture, with depth mapped into a chosen range. The map of depth, 1/(E − z) = α + β/w
//! for camera depth w and eye distance E, is a homography: straight lines stay straight and planes stay planes.
//!
//! *Model*: a similarity transform; the scene is a miniature behind the panel, true for every view.

use crate::error::{Error, Result};
use crate::field::Grid;
use crate::names::{Name, Named};
use crate::random::Random;
use crate::scene::bvh::Ray;
use crate::scene::{Camera, Projection, Scene};
use glam::{DMat3, DMat4, DVec2, DVec3};

/// Where the scene stands relative to the panel. Depths are z of the hologram frame [m]: negative behind the panel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// The camera's picture, seen through the panel as through a window.
    Window {
        /// Distance E of the viewer's eye in front of the panel [m].
        eye: f64,
        /// Where the nearest point stands, z [m].
        near: f64,
        /// Where the farthest point stands, z [m]; at most `near`.
        far: f64,
    },
    /// The scene as a miniature.
    Model {
        /// Distance E of the viewer's eye in front of the panel [m].
        eye: f64,
        /// Where the middle of the scene's box stands, z [m].
        z: f64,
        /// Hologram metres for one scene metre; `None` fits the scene into the panel's view.
        scale: Option<f64>,
    },
}

impl Default for Placement {
    /// A window seen from 0.6 m with the scene 100 to 150 mm behind an 8 µm panel: every point sends its whole
    /// diffraction cone through the panel's middle, and the eye's accommodation (0.7 m) is comfortable.
    fn default() -> Self {
        Self::Window { eye: 0.6, near: -0.1, far: -0.15 }
    }
}

impl Placement {
    /// The same, nearer to the viewer by `by` [m].
    pub fn nearer(self, by: f64) -> Self {
        match self {
            Self::Window { eye, near, far } => Self::Window { eye, near: near + by, far: far + by },
            Self::Model { eye, z, scale } => Self::Model { eye, z: z + by, scale },
        }
    }
}

/// Initial phase of the point sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// All points in step: smooth fields, strong forward light, lattice orders of regular points.
    Zero,
    /// Independent uniform phases: light goes into the whole cone, as from a matte surface; speckle.
    Random {
        /// Seed of the phases.
        seed: u64,
    },
    /// −k × (distance from the eye): all waves reach the eye in step.
    Path,
}

impl Phase {
    /// The phase of point number `index` at a distance from the eye [m], for a vacuum wavelength [m] [rad].
    pub fn of(self, index: usize, distance: f64, wavelength: f64) -> f64 {
        match self {
            Self::Zero => 0.0,
            Self::Random { seed } => Random::new(seed, index as u64).phase(),
            Self::Path => path_phase(distance, wavelength),
        }
    }
}

/// −k·distance, reduced to 0 … 2π [rad], for a vacuum wavelength [m]: the phase with which a wave from that distance [m]
/// arrives in step.
pub(crate) fn path_phase(distance: f64, wavelength: f64) -> f64 {
    let turns = -distance / wavelength;
    std::f64::consts::TAU * (turns - turns.floor())
}

impl Named for Phase {
    const KIND: &'static str = "phase";
    const NAMES: &'static [Name<Self>] = &[
        ("zero", || Self::Zero, "all points in step"),
        ("random", || Self::Random { seed: 1 }, "as from a matte surface"),
        ("path", || Self::Path, "all waves reach the eye in step"),
    ];
}

/// What does not change from frame to frame of a sequence, so that what stands still in the scene stands still before
/// the panel. `None`: what the one scene at hand says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SequenceAnchors {
    /// Box of the scene in all its poses (low, high) [m]: what a camera that the file lacks frames, and what is fitted.
    pub bounds: Option<(DVec3, DVec3)>,
    /// Camera distances [m] that stand at the nearest and farthest depth of a window; points beyond stand there too.
    pub depths: Option<[f64; 2]>,
}

/// A placement made definite for one scene, camera and panel.
#[derive(Clone, Debug)]
pub struct Placing {
    /// The camera whose rays make the points.
    pub camera: Camera,
    /// Width over height of the rays' picture.
    pub aspect: f64,
    /// The viewer's eye in the hologram frame [m].
    pub eye: DVec3,
    /// Half width and half height of the viewing window on the panel plane [m].
    pub window: DVec2,
    map: Map,
}

/// How a window maps camera depths: what the ends of which range become.
#[derive(Clone, Copy, Debug)]
struct DepthMap {
    near: f64,
    far: f64,
    /// The range of camera depths; `None`: that of the points at hand.
    held: Option<[f64; 2]>,
}

/// The definite map of depth: reach(z) = reach(near) + slope·(s(w) − s(nearest)) for camera depth w, with s = 1/w and
/// reach = 1/(E − z) before a perspective camera (exact at both ends of the depth range), s = w and reach = z before an
/// orthographic one.
#[derive(Clone, Copy, Debug)]
struct DepthScale {
    perspective: bool,
    eye: f64,
    near: f64,
    far: f64,
    nearest: f64,
    farthest: f64,
    slope: f64,
}

impl DepthMap {
    fn scale(&self, placing: &Placing, [nearest, farthest]: [f64; 2]) -> DepthScale {
        let perspective = matches!(placing.camera.projection, Projection::Perspective { .. });
        let (near, far) = (self.near, self.far);
        let mut scale = DepthScale { perspective, eye: placing.eye.z, near, far, nearest, farthest, slope: 0.0 };
        let (near_s, far_s) = (scale.s(nearest), scale.s(farthest));
        if near_s != far_s {
            scale.slope = (scale.reach(near) - scale.reach(far)) / (near_s - far_s);
        }
        scale
    }
}

impl DepthScale {
    fn s(&self, w: f64) -> f64 {
        if self.perspective { 1.0 / w } else { w }
    }

    fn reach(&self, z: f64) -> f64 {
        if self.perspective { 1.0 / (self.eye - z) } else { z }
    }

    /// Depth z of a camera depth.
    fn z(&self, w: f64) -> f64 {
        // Beyond depths that are held a point stands on the nearest or farthest plane.
        let value =
            self.reach(self.near) + self.slope * (self.s(w.clamp(self.nearest, self.farthest)) - self.s(self.nearest));
        if self.perspective { self.eye - 1.0 / value } else { value }
    }

    fn hologram_from_camera(&self, placing: &Placing, p: DVec3) -> DVec3 {
        let (half_width, half_height) = placing.camera.half_size(placing.aspect);
        let w = -p.z;
        let z = self.z(w);
        let (x, y) = if self.perspective { (p.x / w, p.y / w) } else { (p.x, p.y) };
        let spread = (self.eye - z) / self.eye;
        DVec3::new(x / half_width * placing.window.x * spread, y / half_height * placing.window.y * spread, z)
    }

    /// Two points in camera space of a line of sight, `at` a depth z in the hologram frame, of an eye at depth `eye`: where it
    /// begins, and one before it.
    fn line(&self, placing: &Placing, at: impl Fn(f64) -> DVec3, eye: f64) -> (DVec3, DVec3) {
        let half_size: DVec2 = placing.camera.half_size(placing.aspect).into();
        // Camera metres (or their ratios) over hologram metres on the panel's plane.
        let scale = half_size / placing.window;
        let lateral = |p: DVec3| p.truncate() * scale * self.eye;
        if !self.perspective {
            let point = |z: f64, w: f64| (lateral(at(z)) / (self.eye - z)).extend(-w);
            let (near, far) = (point(self.near, self.nearest), point(self.far, self.farthest));
            if self.slope == 0.0 {
                return (near.truncate().extend(0.0), near.truncate().extend(-1.0));
            }
            let start = near + (far - near) * (-self.nearest / (self.farthest - self.nearest));
            return (start, far);
        }
        if self.slope == 0.0 {
            return (DVec3::ZERO, (lateral(at(self.near)) / (self.eye - self.near)).extend(-1.0));
        }
        // From 1/(E − z) = α + β/w: w = β·(E − z)/(1 − α·(E − z)), which is finite at the eye's own plane.
        let beta = self.slope;
        let alpha = self.reach(self.near) - beta / self.nearest;
        let point = |z: f64| {
            let reach = self.eye - z;
            let share = beta / (1.0 - alpha * reach);
            (lateral(at(z)) * share).extend(-reach * share)
        };
        // What stands behind the camera is not seen from farther off either.
        (point(eye.min(self.eye)), point(self.far))
    }
}

/// Least and greatest of depths.
fn range(depths: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    [depths.clone().fold(f64::INFINITY, f64::min), depths.fold(f64::NEG_INFINITY, f64::max)]
}

/// The rays of one eye point in the world ([`Placing::rays`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EyeRays {
    /// Where the ray through the panel's middle begins, and by how much that moves for a metre along x and y [m].
    from: [DVec3; 3],
    /// The same for a second point on it.
    to: [DVec3; 3],
}

impl EyeRays {
    /// The ray through a point of the panel's plane [m].
    pub fn through(&self, on_panel: DVec2) -> Ray {
        let at = |[middle, x, y]: [DVec3; 3]| middle + x * on_panel.x + y * on_panel.y;
        let from = at(self.from);
        Ray { origin: from, direction: (at(self.to) - from).normalize() }
    }
}

#[derive(Clone, Debug)]
enum Map {
    Window(DepthMap),
    Model { hologram_from_world: DMat4 },
}

/// A point in the world with the radiance that it sends to the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldPoint {
    /// Where the camera's ray put it [m].
    pub position: DVec3,
    /// Linear RGB radiance.
    pub radiance: [f32; 3],
}

impl Placement {
    /// Checks the placement and makes it definite for a scene seen by `camera` on a panel.
    ///
    /// # Errors
    /// [`Error::Parameter`] for an eye that is not in front of panel and points, or an inverted depth range.
    pub fn prepare(&self, scene: &Scene, camera: &Camera, picture_aspect: f64, panel: &Grid) -> Result<Placing> {
        self.prepare_for(scene, &SequenceAnchors::default(), camera, picture_aspect, panel)
    }

    /// As [`Placement::prepare`], with what is held still over the frames of a sequence.
    ///
    /// # Errors
    /// As [`Placement::prepare`].
    pub fn prepare_for(
        &self,
        scene: &Scene,
        anchors: &SequenceAnchors,
        camera: &Camera,
        picture_aspect: f64,
        panel: &Grid,
    ) -> Result<Placing> {
        let (width, height) = (panel.extent_x(), panel.extent_y());
        let (eye, frontmost) = match *self {
            Self::Window { eye, near, .. } => (eye, near),
            Self::Model { eye, z, .. } => (eye, z),
        };
        if !(eye.is_finite() && eye > 0.0 && eye > frontmost) {
            let what =
                format!("the eye at {eye} m must stand in front of the panel and of the points at {frontmost} m");
            return Err(Error::parameter("eye", what));
        }
        // The largest window of the picture's shape that the panel holds: what is traced is what is looked at.
        let window_height = height.min(width / picture_aspect);
        let window = 0.5 * DVec2::new(window_height * picture_aspect, window_height);
        match *self {
            Self::Window { eye, near, far } => {
                if !(near.is_finite() && far.is_finite() && far <= near) {
                    let what = format!("near {near} m and far {far} m (z): far must be at or behind near");
                    return Err(Error::parameter("near/far", what));
                }
                let map = Map::Window(DepthMap { near, far, held: anchors.depths });
                Ok(Placing {
                    camera: camera.clone(),
                    aspect: picture_aspect,
                    eye: DVec3::new(0.0, 0.0, eye),
                    window,
                    map,
                })
            }
            Self::Model { eye, z, scale } => {
                let axes = DMat3::from_mat4(camera.world_from_camera);
                let (center, half) = box_along(scene, anchors.bounds, axes)
                    .ok_or_else(|| Error::parameter("placement", "the scene has no triangles to place"))?;
                let scale = match scale {
                    Some(scale) if scale.is_finite() && scale > 0.0 => scale,
                    Some(scale) => return Err(Error::out_of_range("scale", scale, "must be greater than zero")),
                    None => fitted_scale(window, half, eye, z)?,
                };
                // hologram = scale·axesᵀ·(world − center) + (0, 0, z)
                let rotate = DMat4::from_mat3(axes.transpose() * scale);
                let hologram_from_world =
                    DMat4::from_translation(DVec3::new(0.0, 0.0, z)) * rotate * DMat4::from_translation(-center);
                let world_from_hologram = hologram_from_world.inverse();
                let eye = DVec3::new(0.0, 0.0, eye);
                let aspect = picture_aspect;
                let camera = Camera {
                    name: "eye".into(),
                    world_from_camera: DMat4::from_mat3_translation(axes, world_from_hologram.transform_point3(eye)),
                    projection: Projection::Perspective { yfov: 2.0 * (window.y / eye.z).atan(), aspect: Some(aspect) },
                    before: 0.0,
                };
                Ok(Placing { camera, aspect, eye, window, map: Map::Model { hologram_from_world } })
            }
        }
    }
}

/// Middle (world) and half size (along `axes`) of the scene's box, or of one that is held [m].
fn box_along(scene: &Scene, held: Option<(DVec3, DVec3)>, axes: DMat3) -> Option<(DVec3, DVec3)> {
    let inverse = axes.transpose();
    let corner = |i: usize, (low, high): (DVec3, DVec3)| {
        DVec3::select(glam::BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), low, high)
    };
    let own = scene.triangles.iter().filter(|_| held.is_none()).flat_map(|t| t.corners());
    let held = held.into_iter().flat_map(|ends| (0..8).map(move |i| corner(i, ends)));
    let bounds = held.chain(own).map(|p| inverse * p).fold(None, |b, p| match b {
        None => Some((p, p)),
        Some((low, high)) => Some((p.min(low), p.max(high))),
    });
    bounds.map(|(low, high): (DVec3, DVec3)| (axes * (0.5 * (low + high)), 0.5 * (high - low)))
}

/// The largest scale at which the box's near face still fits the view, s·h ≤ window·(E − z − s·h_z)/E for each axis,
/// with a rim of 5 %.
pub(super) fn fitted_scale(window: DVec2, half: DVec3, eye: f64, z: f64) -> Result<f64> {
    let fits = |window: f64, side: f64| window * (eye - z) / (eye * side + window * half.z);
    let scale = 0.95 * fits(window.x, half.x).min(fits(window.y, half.y));
    if scale.is_finite() && scale > 0.0 {
        Ok(scale)
    } else {
        Err(Error::parameter("placement", "the scene has no extent, so it cannot be fitted; give a scale"))
    }
}

impl Placing {
    pub(super) fn positions(&self, points: &[WorldPoint]) -> Vec<DVec3> {
        match &self.map {
            Map::Model { hologram_from_world } => {
                points.iter().map(|p| hologram_from_world.transform_point3(p.position)).collect()
            }
            Map::Window(depths) => self.through_window(points, *depths),
        }
    }

    fn through_window(&self, points: &[WorldPoint], depths: DepthMap) -> Vec<DVec3> {
        let camera_from_world = self.camera.world_from_camera.inverse();
        let seen: Vec<DVec3> = points.iter().map(|p| camera_from_world.transform_point3(p.position)).collect();
        let scale = depths.scale(self, depths.held.unwrap_or_else(|| range(seen.iter().map(|p| -p.z))));
        seen.iter().map(|p| scale.hologram_from_camera(self, *p)).collect()
    }

    /// The same placement with the depths that it takes from these points: then it places any other point as well.
    pub fn fixed_by(mut self, points: &[WorldPoint]) -> Self {
        let camera_from_world = self.camera.world_from_camera.inverse();
        if let Map::Window(depths) = &mut self.map {
            let seen = points.iter().map(|p| -camera_from_world.transform_point3(p.position).z);
            depths.held.get_or_insert_with(|| range(seen));
        }
        self
    }

    /// The ray in the world that an eye point `eye` sees at the point `on_panel` of the panel's plane [m], both in the
    /// hologram frame.
    ///
    /// A window's map of depth is a homography, so that a straight ray in the one space is one in the other; an
    /// orthographic camera's is not, and its ray is the chord between the nearest and the farthest depth. Of a window whose
    /// depths are not fixed ([`Placing::fixed_by`]) all of the scene stands on one plane.
    pub fn ray(&self, eye: DVec3, on_panel: DVec2) -> Ray {
        let (from, to) = self.line(eye, on_panel);
        Ray { origin: from, direction: (to - from).normalize() }
    }

    /// All rays of one eye point: what [`Placing::ray`] says for each, at less cost.
    pub fn rays(&self, eye: DVec3) -> EyeRays {
        let [(from, to), (from_x, to_x), (from_y, to_y)] =
            [DVec2::ZERO, DVec2::X, DVec2::Y].map(|on_panel| self.line(eye, on_panel));
        EyeRays { from: [from, from_x - from, from_y - from], to: [to, to_x - to, to_y - to] }
    }

    /// Two points in the world on the line of sight of an eye through a point of the panel [m]; both are affine in that point.
    fn line(&self, eye: DVec3, on_panel: DVec2) -> (DVec3, DVec3) {
        let along = DVec3::new(on_panel.x, on_panel.y, 0.0) - eye;
        // The point of the line of sight at depth z.
        let at = |z: f64| eye + along * ((eye.z - z) / eye.z);
        match &self.map {
            Map::Model { hologram_from_world } => {
                let world = hologram_from_world.inverse();
                (world.transform_point3(eye), world.transform_point3(at(0.0)))
            }
            Map::Window(depths) => {
                let scale = depths.scale(self, depths.held.unwrap_or([1.0, 1.0]));
                let (from, to) = scale.line(self, at, eye.z);
                let world = self.camera.world_from_camera;
                (world.transform_point3(from), world.transform_point3(to))
            }
        }
    }

    /// Depth z at which a point of the world stands [m].
    pub fn depth_of(&self, world: DVec3) -> f64 {
        match &self.map {
            Map::Model { hologram_from_world } => hologram_from_world.transform_point3(world).z,
            Map::Window(depths) => {
                let scale = depths.scale(self, depths.held.unwrap_or([1.0, 1.0]));
                scale.z(-self.camera.world_from_camera.inverse().transform_point3(world).z)
            }
        }
    }

    /// The similarity transform of a model; a window has none, since it is true for one eye only.
    pub fn hologram_from_world(&self) -> Option<DMat4> {
        match self.map {
            Map::Model { hologram_from_world } => Some(hologram_from_world),
            Map::Window(_) => None,
        }
    }

    /// The rectangle of the plane `z` that the eye sees through the window: half width and half height [m].
    pub fn view_at(&self, z: f64) -> DVec2 {
        self.window * ((self.eye.z - z) / self.eye.z)
    }
}
