//! An animated scene, frame by frame.
//!
//! What stands still in the scene must stand still before the panel. So three things are the same for all frames: the box
//! that a camera frames which the file lacks (and that a miniature is fitted by), the camera distances that stand at the
//! window's nearest and farthest depth, and what is white. They are found by a first look at some of the poses
//! ([`Animation::first_look`]). The file is read once, its textures are decoded once, and the light on surfaces is
//! computed again only where a surface or a lamp has moved; where nothing has, the frame before is handed on.

use crate::encode::{Encoded, Encoding};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::hologram::{Computed, HologramReport};
use crate::light_field::LightSource;
use crate::panel::{Origin, Setup};
use crate::pipeline::{self, Settings};
use crate::points::trace::{self, TraceSettings};
use crate::points::white::white_level;
use crate::points::{LitScene, ScenePoints, WhitePoint};
use crate::progress::Progress;
use crate::scene::{Camera, Scene, gltf};
use glam::DVec3;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Most frames of one animation.
pub const MAX_FRAMES: usize = 100_000;
/// Poses that the first look takes, evenly over the frames.
const LOOKS: usize = 16;
/// Rays along the longer side of the first look.
const LOOK_RAYS: f64 = 64.0;
/// What the depths of poses between those looked at may lie outside: this part of the range on either side.
const DEPTH_MARGIN: f64 = 0.02;

/// Which poses become frames, and how.
#[derive(Clone, Debug)]
pub struct Animation {
    /// The scene file.
    pub path: PathBuf,
    /// How each pose becomes a frame; its time and what the sequence keeps fixed are set here.
    pub settings: Settings,
    /// Time of each frame in the clip [s].
    pub times: Vec<f64>,
}

/// One frame of an animation.
#[derive(Clone, Debug)]
pub struct AnimationFrame {
    /// Running number, from 0.
    pub number: usize,
    /// Its time in the clip [s].
    pub time: f64,
    /// Points and picture.
    pub points: Arc<ScenePoints>,
    /// What the field took; none for frames that are made for an eye.
    pub field: Option<HologramReport>,
    /// Levels for the panel.
    pub encoded: Arc<Encoded>,
    /// Whether nothing had moved since the frame before, which this one is again.
    pub still: bool,
    /// Whether the light on surfaces of the frame before could be kept.
    pub light_kept: bool,
    /// Time that it took [s].
    pub seconds: f64,
}

/// What one frame took.
#[derive(Clone, Debug, Serialize)]
pub struct AnimationFrameReport {
    /// Running number, from 0.
    pub number: usize,
    /// Its time in the clip [s].
    pub time: f64,
    /// Number of points.
    pub points: usize,
    /// Time of the light on surfaces [s]; 0 where it was kept.
    pub light_seconds: f64,
    /// Time of the rays [s]; 0 where nothing had moved.
    pub trace_seconds: f64,
    /// Time of the field [s]; 0 where nothing had moved.
    pub field_seconds: f64,
    /// Time in all [s].
    pub seconds: f64,
    /// Whether nothing had moved.
    pub still: bool,
    /// Whether the light on surfaces could be kept.
    pub light_kept: bool,
    /// Light of the encoded field on the panel: what the brightness of frames is compared by.
    pub scale: Option<f64>,
}

impl AnimationFrame {
    /// What it took.
    pub fn report(&self) -> AnimationFrameReport {
        let unless = |kept: bool, seconds: f64| if kept { 0.0 } else { seconds };
        AnimationFrameReport {
            number: self.number,
            time: self.time,
            points: self.points.placed.cloud.points.len(),
            light_seconds: unless(self.light_kept, self.points.illumination.seconds),
            trace_seconds: unless(self.still, self.points.trace.seconds),
            field_seconds: unless(self.still, self.field.as_ref().map_or(0.0, |field| field.seconds)),
            seconds: self.seconds,
            still: self.still,
            light_kept: self.light_kept,
            scale: self.encoded.frame.metadata.encoding.as_ref().map(|encoding| encoding.scale),
        }
    }
}

impl Animation {
    /// Frames at `rate` [Hz] from `from` to `to` [s], the clip's own first and last key where they are not given. The last
    /// time itself has no frame: played in a loop it is the first one again.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a file without animation, a rate that is not positive, an interval without extent, or more
    /// than [`MAX_FRAMES`]; as [`gltf::File::open`].
    pub fn new(path: &Path, settings: &Settings, rate: f64, from: Option<f64>, to: Option<f64>) -> Result<Self> {
        let file = gltf::File::open_with(path, &settings.scene.load)?;
        let Some([first, last]) = file.clip_times(&settings.scene.load.clip)? else {
            return Err(Error::input(
                path,
                "has no animation; without a rate and an interval it is shown as it stands",
            ));
        };
        let (from, to) = (from.unwrap_or(first), to.unwrap_or(last));
        if !(rate.is_finite() && rate > 0.0) {
            return Err(Error::parameter("fps", format!("{rate} frames per second; give a number above zero")));
        }
        if !(from.is_finite() && to.is_finite() && from < to) {
            return Err(Error::parameter("from/to", format!("{from} s to {to} s has no extent")));
        }
        // A whole number of frames may come out a rounding above itself.
        let count = ((to - from) * rate - 1e-6).ceil().max(1.0);
        if count > MAX_FRAMES as f64 {
            return Err(Error::parameter("fps", format!("{count} frames; at most {MAX_FRAMES}")));
        }
        let times = (0..count as usize).map(|n| from + n as f64 / rate).collect();
        Ok(Self { path: path.to_path_buf(), settings: settings.clone(), times })
    }

    /// Looks at some of the poses and fixes what all frames have in common.
    ///
    /// # Errors
    /// As [`pipeline::points`].
    pub fn first_look(&mut self, panel: &Grid, progress: &Progress) -> Result<()> {
        let step = self.times.len().div_ceil(LOOKS).max(1);
        let mut times: Vec<f64> = self.times.iter().copied().step_by(step).collect();
        times.extend(self.times.last());
        progress.start("first look", 2 * times.len() as u64);
        let mut file = gltf::File::open_with(&self.path, &self.settings.scene.load)?;
        let mut bounds: Option<(DVec3, DVec3)> = None;
        for &time in &times {
            progress.check()?;
            let own = self.pose(&mut file, time)?.scene.bounds();
            bounds = match (bounds, own) {
                (Some((low, high)), Some((l, h))) => Some((low.min(l), high.max(h))),
                (known, own) => known.or(own),
            };
            progress.advance(1);
        }
        self.settings.scene.anchors.bounds = bounds;
        self.settings.scene.load.framed = bounds;
        let (mut depths, mut white) = ([f64::INFINITY, f64::NEG_INFINITY], 0.0f32);
        for &time in &times {
            let loaded = self.pose(&mut file, time)?;
            let (seen, level) = self.glance(loaded, panel, &progress.part())?;
            depths = [depths[0].min(seen[0]), depths[1].max(seen[1])];
            white = white.max(level);
            progress.check()?;
            progress.advance(1);
        }
        if depths[0] <= depths[1] {
            let margin = DEPTH_MARGIN * (depths[1] - depths[0]);
            self.settings.scene.anchors.depths = Some([(depths[0] - margin).max(0.5 * depths[0]), depths[1] + margin]);
        }
        if self.settings.scene.white == WhitePoint::Auto && white > 0.0 {
            self.settings.scene.white = WhitePoint::At(white);
        }
        Ok(())
    }

    fn pose(&self, file: &mut gltf::File, time: f64) -> Result<gltf::Loaded> {
        file.pose(&gltf::LoadOptions { time, ..self.settings.scene.load.clone() })
    }

    /// Camera distances of the nearest and farthest point [m] and the level of white, by few rays and coarse light.
    fn glance(&self, loaded: gltf::Loaded, panel: &Grid, progress: &Progress) -> Result<([f64; 2], f32)> {
        let settings = &self.settings.scene;
        let lit = LitScene::new(&self.path, loaded, settings.illumination.coarse(), progress)?;
        let (width, height) = (f64::from(settings.trace.width), f64::from(settings.trace.height));
        let scale = (LOOK_RAYS / width.max(height)).min(1.0);
        let [w, h] = [width, height].map(|side| (side * scale).round().max(1.0) as u32);
        let rays = TraceSettings { width: w, height: h, edge_rays: 1, ..settings.trace };
        // Where a miniature is seen from is the placement's matter.
        let placement = &settings.placement;
        let placing = placement.prepare_for(lit.scene(), &settings.anchors, lit.camera(), width / height, panel)?;
        let traced = trace::trace(lit.illumination(), &placing.camera, &rays, progress)?;
        let camera_from_world = placing.camera.world_from_camera.inverse();
        let ends = traced
            .points
            .iter()
            .map(|point| -camera_from_world.transform_point3(point.position).z)
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[near, far], w| [near.min(w), far.max(w)]);
        Ok((ends, white_level(&traced.picture)))
    }

    /// Makes the frames in order and hands each to `take`, until that returns false.
    ///
    /// # Errors
    /// As the steps of [`pipeline`]; those of `take`.
    pub fn make(
        &self,
        setup: &Setup,
        progress: &Progress,
        take: &mut dyn FnMut(AnimationFrame) -> Result<bool>,
    ) -> Result<()> {
        let mut file = gltf::File::open_with(&self.path, &self.settings.scene.load)?;
        // The pose whose light was computed, its camera, and the last frame that it gave.
        let mut kept: Option<(LitScene, Camera, AnimationFrame)> = None;
        // The phases that the last frame for an eye asks for.
        let mut wishes = Vec::new();
        for (number, &time) in self.times.iter().enumerate() {
            let begin = Instant::now();
            progress.start("scene", 0);
            let pose = self.pose(&mut file, time)?;
            let seen_from = first_camera(&self.path, &pose.scene)?.clone();
            let before = kept.take().filter(|(lit, ..)| same_light(&pose.scene, lit.scene()));
            let light_kept = before.is_some();
            let (lit, frame) = match before {
                Some((lit, camera, frame)) if camera == seen_from => {
                    (lit, AnimationFrame { number, time, still: true, light_kept, ..frame })
                }
                before => {
                    let lit = match before {
                        Some((lit, ..)) => lit,
                        None => LitScene::new(&self.path, pose, self.settings.scene.illumination, progress)?,
                    };
                    let frame =
                        self.frame(number, Posed { lit: &lit, camera: &seen_from }, setup, &mut wishes, progress)?;
                    (lit, AnimationFrame { light_kept, ..frame })
                }
            };
            let frame = AnimationFrame { seconds: begin.elapsed().as_secs_f64(), ..frame };
            if !take(frame.clone())? {
                return Ok(());
            }
            kept = Some((lit, seen_from, frame));
        }
        Ok(())
    }

    /// A frame of its own for a pose; one for an eye goes on from the phases of the frame before, and leaves its own.
    fn frame(
        &self,
        number: usize,
        pose: Posed,
        setup: &Setup,
        wishes: &mut Vec<Vec<f32>>,
        progress: &Progress,
    ) -> Result<AnimationFrame> {
        let (settings, time) = (&self.settings, self.times[number]);
        let points = pose.lit.points(pose.camera, &settings.scene, &setup.grid, setup.wavelength, progress)?;
        let cloud = &points.placed.cloud;
        let exposures = pipeline::exposures(setup, settings, None);
        let [exposure] = exposures.as_slice() else {
            return Err(Error::parameter("exposures", "an animation has one for each of its frames"));
        };
        let dark = || Error::input(&self.path, "has no light for the laser");
        let origin = Origin {
            source: Some(self.path.display().to_string()),
            points: Some(cloud.points.len()),
            depth: points.content().depth,
            notes: vec![format!("frame {number} of {}, at {time:.6} s", self.times.len())],
            ..Origin::default()
        };
        let (encoded, field) = if let Some(Encoding::View(view)) = &settings.encode.encoding {
            let source = LightSource::Scene { lit: pose.lit, points: &points };
            let (light, _) = pipeline::light_field(&source, setup, settings, progress)?;
            let found = pipeline::views(&light, &settings.viewer, &exposures, setup, view, wishes, progress)?;
            let viewed = found.into_iter().flatten().next().ok_or_else(dark)?;
            *wishes = viewed.wishes;
            let mut encoded = viewed.frames.into_iter().next().ok_or_else(dark)?;
            encoded.frame.metadata.origin = origin;
            (encoded, None)
        } else {
            let computed = pipeline::field(cloud, exposure, setup, &settings.hologram, progress)?;
            let Computed { field, report } = computed.ok_or_else(dark)?;
            (pipeline::frame(&field, setup, &settings.encode, origin, progress)?, Some(report))
        };
        Ok(AnimationFrame {
            number,
            time,
            points: Arc::new(points),
            field,
            encoded: Arc::new(encoded),
            still: false,
            light_kept: false,
            seconds: 0.0,
        })
    }
}

/// A pose in its light, and the camera that it is seen by.
struct Posed<'a> {
    lit: &'a LitScene,
    camera: &'a Camera,
}

fn first_camera<'a>(path: &Path, scene: &'a Scene) -> Result<&'a Camera> {
    scene.cameras.first().ok_or_else(|| Error::input(path, "has no camera"))
}

/// Whether the light on the surfaces of two poses of one file is the same: the same triangles in the same light.
fn same_light(a: &Scene, b: &Scene) -> bool {
    // Materials of one file are those of its triangles in the order of first use.
    a.triangles.len() == b.triangles.len()
        && a.materials == b.materials
        && a.triangles.iter().zip(&b.triangles).all(|(a, b)| {
            a.positions == b.positions && a.normals == b.normals && a.colors == b.colors && a.material == b.material
        })
        && a.lights.len() == b.lights.len()
        && a.lights.iter().zip(&b.lights).all(|(a, b)| {
            a.kind == b.kind && a.position == b.position && a.direction == b.direction && a.intensity == b.intensity
        })
}
