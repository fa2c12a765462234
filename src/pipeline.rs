//! The whole way, on one screen: a scene becomes points, points a field, a field a frame, a frame light again.
//!
//! Each function is one arrow of the picture in the crate's documentation; [`run`] walks them all.

use crate::encode::{self, EncodeSettings, Encoded};
use crate::error::{Error, Result};
use crate::field::{Complex32, Field, Grid};
use crate::hologram::{self, Computed, HologramSettings};
use crate::illumination::{Illumination, IlluminationReport, IlluminationSettings};
use crate::panel::simulated::{self, Simulation};
use crate::panel::{Frame, PanelProfile};
use crate::points::budget::{Budget, Rays};
use crate::points::colour::{Gamut, Lasers};
use crate::points::placement::{self, Phase, SequenceAnchors, WorldPoint};
use crate::points::trace::{self, TraceReport, TraceSettings};
use crate::points::{self, Channel, Placed, Placement, PointCloud, PointSource, SceneView, WhiteLevel, WhitePoint};
use crate::progress::Progress;
use crate::propagation::Aperture;
use crate::reconstruction::ViewSettings;
use crate::scene::{Camera, SceneBvh, gltf};
use glam::DVec3;
use std::path::Path;

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
        }
    }
}

/// A scene's light as points, and what an eye sees of it.
#[derive(Clone, Debug)]
pub struct Lit {
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
    /// What had to be assumed.
    pub warnings: Vec<String>,
}

/// glTF → light on surfaces → points before the panel.
pub fn light(
    scene: &Path,
    settings: &SceneSettings,
    panel: &Grid,
    wavelength: f64,
    progress: &Progress,
) -> Result<Lit> {
    progress.start("scene", 0);
    let loaded = gltf::load(scene, &settings.load)?;
    let camera = loaded.scene.cameras.first().ok_or_else(|| Error::input(scene, "has no camera"))?;
    let bvh = SceneBvh::new(loaded.scene.clone());
    let illumination = Illumination::new(bvh, settings.illumination, progress)?;
    seen(scene, (&loaded, camera), &illumination, settings, (panel, wavelength), progress)
}

/// Light on surfaces → points before the panel, for a camera; `scene` stands in errors.
pub fn seen(
    scene: &Path,
    (loaded, camera): (&gltf::Loaded, &Camera),
    illumination: &Illumination,
    settings: &SceneSettings,
    (panel, wavelength): (&Grid, f64),
    progress: &Progress,
) -> Result<Lit> {
    let aspect = f64::from(settings.trace.width) / f64::from(settings.trace.height);
    let placing = settings.placement.prepare_for(&loaded.scene, &settings.anchors, camera, aspect, panel)?;
    let (traced, rays) = match settings.points {
        None => (trace::trace(illumination, &placing.camera, &settings.trace, progress)?, None),
        Some(budget) => budget.trace(illumination, &settings.trace, &placing, panel, wavelength, progress)?,
    };
    if traced.points.is_empty() {
        let what = if illumination.is_dark() {
            "its lights give no light; raise their intensity or emission"
        } else {
            "no ray of its camera meets light; look at the camera and the lights"
        };
        return Err(Error::input(scene, what));
    }
    let mut world = traced.world_points();
    let white = settings.white.apply(&mut world, &traced.picture)?;
    let placed = points::place(&world, &placing, settings.phase, panel, wavelength);
    let view = SceneView::new(&traced, &placed, placing);
    let warnings = loaded.warnings.iter().map(ToString::to_string).collect();
    Ok(Lit { placed, world, view, illumination: *illumination.report(), trace: traced.report, rays, white, warnings })
}

/// Points → field on the panel, by the engine that the planner chooses.
pub fn field(
    cloud: &PointCloud,
    channel: Channel,
    panel: &Grid,
    wavelength: f64,
    settings: &HologramSettings,
    progress: &Progress,
) -> Result<Computed> {
    field_of(&cloud.channel(channel), panel, wavelength, settings, progress)
}

/// The same for points of one colour.
pub fn field_of(
    points: &[PointSource],
    panel: &Grid,
    wavelength: f64,
    settings: &HologramSettings,
    progress: &Progress,
) -> Result<Computed> {
    let plan = hologram::plan(points, panel, wavelength, settings)?;
    hologram::compute(points, panel, wavelength, &plan, progress)
}

/// A cloud's fields in the light of three lasers.
#[derive(Clone, Debug)]
pub struct ColorFields {
    /// Fields in red, green and blue; a laser without any light has none.
    pub computed: [Option<Computed>; 3],
    /// Light that the lasers cannot make.
    pub gamut: Gamut,
}

/// Points → three fields on the panel, one for each laser. Where phases are those of paths to an eye, it stands at
/// `path_eye`: they differ from laser to laser.
pub fn color_fields(
    cloud: &PointCloud,
    lasers: &Lasers,
    path_eye: Option<DVec3>,
    panel: &Grid,
    settings: &HologramSettings,
    progress: &Progress,
) -> Result<ColorFields> {
    let (each, gamut) = lasers.points(cloud);
    let one = |(mut points, wavelength): (Vec<PointSource>, f64)| {
        if let Some(eye) = path_eye {
            points.iter_mut().for_each(|p| p.phase = placement::path_phase((eye - p.position).length(), wavelength));
        }
        if points.iter().all(|p| p.amplitude == 0.0) {
            return Ok(None);
        }
        field_of(&points, panel, wavelength, settings, progress).map(Some)
    };
    let [red, green, blue] = each;
    let [long, middle, short] = lasers.wavelengths();
    Ok(ColorFields { computed: [one((red, long))?, one((green, middle))?, one((blue, short))?], gamut })
}

/// Field → frame of drive levels for a panel.
pub fn frame(field: &Field, panel: &PanelProfile, settings: &EncodeSettings, progress: &Progress) -> Result<Encoded> {
    encode::encode(field, panel, settings, progress)
}

/// Frame → the object's field behind the simulated panel, and the stop that keeps its other orders out.
///
/// The encoding's scale is divided out, so that intensities are those of the field that was encoded.
pub fn simulated_light(frame: &Frame, settings: &Simulation, progress: &Progress) -> Result<(Field, ViewSettings)> {
    let mut field = simulated::simulate(frame, settings, progress)?;
    let mut view = ViewSettings::default();
    if let Some(encoding) = &frame.metadata.encoding {
        view.aperture = encoding.aperture;
        if encoding.scale.is_finite() && encoding.scale > 0.0 {
            let gain = (1.0 / encoding.scale) as f32;
            field.samples.iter_mut().for_each(|u: &mut Complex32| *u *= gain);
        }
    }
    Ok((field, view))
}

/// What came out of the whole way.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Points and picture.
    pub lit: Lit,
    /// Field on the panel.
    pub computed: Computed,
    /// Frame for the panel.
    pub encoded: Encoded,
    /// Field behind the simulated panel.
    pub behind: Field,
    /// Stop in the Fourier plane through which it is looked at.
    pub aperture: Option<Aperture>,
}

/// Scene → points → field → frame → light behind the simulated panel.
pub fn run(
    scene: &Path,
    profile: &PanelProfile,
    wavelength: f64,
    settings: (&SceneSettings, &HologramSettings, &EncodeSettings),
    progress: &Progress,
) -> Result<Outcome> {
    let grid = profile.grid()?;
    let lit = light(scene, settings.0, &grid, wavelength, progress)?;
    let computed = field(&lit.placed.cloud, Channel::Luminance, &grid, wavelength, settings.1, progress)?;
    let encoded = frame(&computed.field, profile, settings.2, progress)?;
    let (behind, view) = simulated_light(&encoded.frame, &Simulation::default(), progress)?;
    Ok(Outcome { lit, computed, encoded, behind, aperture: view.aperture })
}
