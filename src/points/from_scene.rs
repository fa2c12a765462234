//! A scene in its light, and the points that it becomes before a panel.

use super::budget::{Budget, Rays};
use super::light_error::light_error;
use super::placement::{Phase, SequenceAnchors, WorldPoint};
use super::trace::{self, TraceReport, TraceSettings};
use super::{Placed, Placement, SceneView, WhiteLevel, WhitePoint, place};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::field::npy::Content;
use crate::illumination::{Illumination, IlluminationReport, IlluminationSettings};
use crate::progress::Progress;
use crate::scene::{Camera, Scene, SceneBvh, gltf};
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How a scene becomes points.
#[derive(Clone, Debug)]
pub struct SceneSettings {
    /// Camera, animation.
    pub load: gltf::LoadOptions,
    /// Radiosity and direct light.
    pub illumination: IlluminationSettings,
    /// Rays.
    pub trace: TraceSettings,
    /// How many points; then only the shape of the rays' grid is taken from `trace`. `None` casts its rays as they are.
    pub points: Option<Budget>,
    /// Where the scene stands before the panel.
    pub placement: Placement,
    /// Initial phase of the points.
    pub phase: Phase,
    /// What is done with light brighter than a picture's white.
    pub white: WhitePoint,
    /// What a sequence of frames keeps fixed.
    pub anchors: SequenceAnchors,
    /// Whether the error of the picture's light is estimated.
    pub estimate: bool,
}

impl Default for SceneSettings {
    fn default() -> Self {
        Self {
            load: gltf::LoadOptions::default(),
            illumination: IlluminationSettings::default(),
            trace: TraceSettings::default(),
            points: None,
            placement: Placement::default(),
            phase: Phase::Random { seed: 1 },
            white: WhitePoint::Unlimited,
            anchors: SequenceAnchors::default(),
            estimate: false,
        }
    }
}

/// A scene and the light on its surfaces: ready to be seen from any camera.
pub struct LitScene {
    path: PathBuf,
    loaded: gltf::Loaded,
    illumination: Illumination,
}

/// A scene as points before a panel, and what an eye sees of it.
#[derive(Clone, Debug)]
pub struct ScenePoints {
    /// The points before the panel.
    pub placed: Placed,
    /// The same points where the camera's rays put them [m].
    pub world: Vec<WorldPoint>,
    /// What the viewer should see.
    pub view: SceneView,
    /// What the radiosity took, and its energy.
    pub illumination: IlluminationReport,
    /// What the rays took.
    pub trace: TraceReport,
    /// What a budget of points chose, if there was one.
    pub rays: Option<Rays>,
    /// White, and what is brighter.
    pub white: WhiteLevel,
    /// Root mean square error of the light over blocks of 5 × 5 rays, over its mean, as far as it is noise; where it was
    /// asked for, and enough is seen to tell.
    pub light_error: Option<f64>,
    /// What had to be assumed.
    pub warnings: Vec<String>,
}

impl ScenePoints {
    /// Where it stands, for reconstructions of its field.
    pub fn content(&self) -> Content {
        let placing = &self.view.placing;
        Content {
            z: 0.0,
            depth: self.placed.cloud.depth_range().map(|(far, near)| [near, far]),
            eye: Some(placing.eye.to_array()),
            window: Some(placing.window.to_array()),
        }
    }

    /// The eye to which the points' phases are those of paths, if they are.
    pub fn path_eye(&self, phase: Phase) -> Option<DVec3> {
        Some(self.view.placing.eye).filter(|_| phase == Phase::Path)
    }
}

impl LitScene {
    /// Reads a scene and lights it.
    ///
    /// # Errors
    /// As [`gltf::load`] and [`Illumination::new`].
    pub fn load(path: &Path, settings: &SceneSettings, progress: &Progress) -> Result<Self> {
        progress.start("scene", 0);
        Self::new(path, gltf::load(path, &settings.load)?, settings.illumination, progress)
    }

    /// Lights a scene that was read from `path`, which stands in errors.
    ///
    /// # Errors
    /// As [`Illumination::new`]; [`Error::Input`] for a scene without camera.
    pub fn new(path: &Path, loaded: gltf::Loaded, settings: IlluminationSettings, progress: &Progress) -> Result<Self> {
        let bvh = Arc::new(SceneBvh::new(loaded.scene.clone()));
        Self::with_bvh(path, loaded, bvh, settings, progress)
    }

    /// The same with the scene's tree, where it has been built.
    ///
    /// # Errors
    /// As [`LitScene::new`].
    pub fn with_bvh(
        path: &Path,
        loaded: gltf::Loaded,
        bvh: Arc<SceneBvh>,
        settings: IlluminationSettings,
        progress: &Progress,
    ) -> Result<Self> {
        if loaded.scene.cameras.is_empty() {
            return Err(Error::input(path, "has no camera"));
        }
        let illumination = Illumination::new(bvh, settings, progress)?;
        Ok(Self { path: path.to_path_buf(), loaded, illumination })
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.loaded.scene
    }

    /// Its first camera: the one that was chosen when it was read.
    pub fn camera(&self) -> &Camera {
        &self.loaded.scene.cameras[0]
    }

    /// The light on its surfaces.
    pub fn illumination(&self) -> &Illumination {
        &self.illumination
    }

    /// The scene's light towards a camera as points before a panel, at a wavelength [m].
    ///
    /// # Errors
    /// [`Error::Input`] where no ray meets light; as [`Placement::prepare_for`] and [`trace::trace`].
    pub fn points(
        &self,
        camera: &Camera,
        settings: &SceneSettings,
        panel: &Grid,
        wavelength: f64,
        progress: &Progress,
    ) -> Result<ScenePoints> {
        let light = &self.illumination;
        let aspect = f64::from(settings.trace.width) / f64::from(settings.trace.height);
        let placing = settings.placement.prepare_for(self.scene(), &settings.anchors, camera, aspect, panel)?;
        let (traced, rays) = match settings.points {
            None => (trace::trace(light, &placing.camera, &settings.trace, progress)?, None),
            Some(budget) => budget.trace(light, &settings.trace, &placing, panel, wavelength, progress)?,
        };
        if traced.points.is_empty() {
            let what = if light.is_dark() {
                "its lights give no light; raise their intensity or emission"
            } else {
                "no ray of its camera meets light: look at the camera, at the lights, and whether all that is seen is black, turned away, \
                 or mirrors nothing (an environment is something to mirror)"
            };
            return Err(Error::input(&self.path, what));
        }
        let light_error = if settings.estimate {
            let rays = TraceSettings { width: traced.width, height: traced.height, ..settings.trace };
            light_error(light, &placing.camera, &rays, progress)?
        } else {
            None
        };
        let mut world = traced.world_points();
        let white = settings.white.apply(&mut world, &traced.picture)?;
        let placing = placing.fixed_by(&world);
        let placed = place(&world, &placing, settings.phase, panel, wavelength);
        let view = SceneView::new(&traced, &placed, placing);
        let warnings = self.loaded.warnings.iter().map(ToString::to_string).collect();
        let illumination = *light.report();
        Ok(ScenePoints { placed, world, view, illumination, trace: traced.report, rays, white, light_error, warnings })
    }
}
