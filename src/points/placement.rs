//! From the scene's metres to the panel's: the one place that scales a room to a hologram.
//!
//! *Window*: the camera's frustum is carried onto the pyramid from the viewer's eye through the panel, so that what the
//! viewer sees is the camera's picture, with depth mapped into a chosen range. The map of depth, 1/(E − z) = α + β/w
//! for camera depth w and eye distance E, is a homography: straight lines stay straight and planes stay planes.
//!
//! *Model*: a similarity transform; the scene is a miniature behind the panel, true for every view.

use super::{Channel, PointCloud, PointSource};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::names::{Name, Named};
use crate::random::Random;
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

/// Points in the hologram frame with what the panel can do with them.
#[derive(Clone, Debug, Default)]
pub struct Placed {
    /// The points, coloured, in the order of the world points.
    pub cloud: PointCloud,
    /// Points whose light the panel cannot send to the eye: sin of the angle beyond λ/2p.
    pub beyond_cone: usize,
    /// Their part of the light (0 to 1).
    pub beyond_cone_light: f64,
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
fn fitted_scale(window: DVec2, half: DVec3, eye: f64, z: f64) -> Result<f64> {
    let fits = |window: f64, side: f64| window * (eye - z) / (eye * side + window * half.z);
    let scale = 0.95 * fits(window.x, half.x).min(fits(window.y, half.y));
    if scale.is_finite() && scale > 0.0 {
        Ok(scale)
    } else {
        Err(Error::parameter("placement", "the scene has no extent, so it cannot be fitted; give a scale"))
    }
}

/// Carries traced points into the hologram frame: position, amplitude √radiance × distance from the eye, phase.
///
/// The grid and wavelength say which directions the panel reaches; points beyond are kept and counted.
pub fn place(points: &[WorldPoint], placing: &Placing, phase: Phase, panel: &Grid, wavelength: f64) -> Placed {
    let positions = placing.positions(points);
    let mut placed = Placed::default();
    let (mut all_light, mut lost_light) = (0.0, 0.0);
    let mut rgb = Vec::with_capacity(points.len());
    let sine_limit = wavelength * DVec2::new(panel.limit_x(), panel.limit_y());
    for (index, (point, position)) in points.iter().zip(positions).enumerate() {
        let to_eye = placing.eye - position;
        let distance = to_eye.length();
        let light = f64::from(Channel::Luminance.of(point.radiance));
        all_light += light;
        if to_eye.x.abs() > sine_limit.x * distance || to_eye.y.abs() > sine_limit.y * distance {
            placed.beyond_cone += 1;
            lost_light += light;
        }
        let amplitude = |radiance: f32| (f64::from(radiance.max(0.0)).sqrt() * distance) as f32;
        let phase = match phase {
            Phase::Zero => 0.0,
            Phase::Random { seed } => Random::new(seed, index as u64).phase(),
            Phase::Path => path_phase(distance, wavelength),
        };
        rgb.push(point.radiance.map(amplitude));
        placed.cloud.points.push(PointSource {
            position,
            amplitude: amplitude(Channel::Luminance.of(point.radiance)),
            phase,
        });
    }
    placed.cloud.rgb = Some(rgb);
    placed.beyond_cone_light = if all_light > 0.0 { lost_light / all_light } else { 0.0 };
    placed
}

/// −k·distance, reduced to 0 … 2π [rad], for a vacuum wavelength [m]: the phase with which a wave from that distance [m]
/// arrives in step.
pub(crate) fn path_phase(distance: f64, wavelength: f64) -> f64 {
    let turns = -distance / wavelength;
    std::f64::consts::TAU * (turns - turns.floor())
}

impl Placing {
    fn positions(&self, points: &[WorldPoint]) -> Vec<DVec3> {
        match &self.map {
            Map::Model { hologram_from_world } => {
                points.iter().map(|p| hologram_from_world.transform_point3(p.position)).collect()
            }
            Map::Window(depths) => self.through_window(points, *depths),
        }
    }

    fn through_window(&self, points: &[WorldPoint], DepthMap { near, far, held }: DepthMap) -> Vec<DVec3> {
        let camera_from_world = self.camera.world_from_camera.inverse();
        let seen: Vec<DVec3> = points.iter().map(|p| camera_from_world.transform_point3(p.position)).collect();
        let (half_width, half_height) = self.camera.half_size(self.aspect);
        let depths = seen.iter().map(|p| -p.z);
        let [nearest, farthest] = held.unwrap_or_else(|| {
            [depths.clone().fold(f64::INFINITY, f64::min), depths.fold(f64::NEG_INFINITY, f64::max)]
        });
        let perspective = matches!(self.camera.projection, Projection::Perspective { .. });
        // 1/(E − z) = α + β·s with s = 1/w: exact at both ends of the depth range.
        let s = |w: f64| if perspective { 1.0 / w } else { w };
        let reach = |z: f64| if perspective { 1.0 / (self.eye.z - z) } else { z };
        let (near_s, far_s) = (s(nearest), s(farthest));
        let slope = if near_s == far_s { 0.0 } else { (reach(near) - reach(far)) / (near_s - far_s) };
        seen.iter()
            .map(|p| {
                let w = -p.z;
                // Beyond depths that are held a point stands on the nearest or farthest plane.
                let value = reach(near) + slope * (s(w.clamp(nearest, farthest)) - near_s);
                let z = if perspective { self.eye.z - 1.0 / value } else { value };
                let (x, y) = if perspective { (p.x / w, p.y / w) } else { (p.x, p.y) };
                let spread = (self.eye.z - z) / self.eye.z;
                DVec3::new(x / half_width * self.window.x * spread, y / half_height * self.window.y * spread, z)
            })
            .collect()
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
