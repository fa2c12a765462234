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
use crate::points::budget::{Budget, Limit, Rays, Resolution};
use crate::points::colour::{Gamut, Lasers};
use crate::points::exposure::{Exposed, Exposure};
use crate::points::placement::{self, Held, Phase, Placing, WorldPoint};
use crate::points::trace::{self, TraceReport, TraceSettings, Traced};
use crate::points::{self, Channel, Placed, Placement, PointCloud, PointSource};
use crate::progress::Progress;
use crate::propagation::Aperture;
use crate::random::Random;
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
    pub exposure: Exposure,
    /// What a sequence of frames holds still.
    pub held: Held,
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
            exposure: Exposure::Full,
            held: Held::default(),
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
    pub exposed: Exposed,
    /// What had to be assumed.
    pub warnings: Vec<String>,
}

/// The traced picture and where each of its pixels stands before the panel: the target of every reconstruction.
#[derive(Clone, Debug)]
pub struct SceneView {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear RGB radiance, row 0 on top.
    pub picture: Vec<[f32; 3]>,
    /// Depth z of each pixel's point in the hologram frame [m]; a pixel without a point has that of the nearest one.
    pub depths: Vec<Option<f64>>,
    /// Depths worth focusing on, z [m]: nearest and farthest object, mirror image.
    pub focus: Vec<(String, f64)>,
    /// Eye, window and camera.
    pub placing: Placing,
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
    let bvh = SceneBvh::new(&loaded.scene);
    let illumination = Illumination::new(&bvh, settings.illumination, progress)?;
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
    let placing = settings.placement.prepare_for(&loaded.scene, &settings.held, camera, aspect, panel)?;
    let cast = |settings: &TraceSettings| trace::trace(illumination, &placing.camera, settings, progress);
    let (traced, rays) = match settings.points {
        None => (cast(&settings.trace)?, None),
        Some(budget) => within_budget(budget, &settings.trace, cast, &placing, panel, wavelength)?,
    };
    if traced.points.is_empty() {
        let what = if illumination.is_dark() {
            "its lights give no light; raise their intensity or emission"
        } else {
            "no ray of its camera meets light; look at the camera and the lights"
        };
        return Err(Error::input(scene, what));
    }
    let mut world = world_points(&traced);
    let exposed = settings.exposure.apply(&mut world, &traced.picture)?;
    let placed = points::place(&world, &placing, settings.phase, panel, wavelength);
    let view = SceneView::new(&traced, &placed, placing);
    let warnings = loaded.warnings.iter().map(ToString::to_string).collect();
    Ok(Lit { placed, world, view, illumination: *illumination.report(), trace: traced.report, rays, exposed, warnings })
}

fn world_points(traced: &Traced) -> Vec<WorldPoint> {
    traced.points.iter().map(|p| WorldPoint { position: p.position, radiance: p.radiance }).collect()
}

/// Traces a scene into a number of points: a few rays tell what share of them becomes points, and how deep they stand.
fn within_budget(
    budget: Budget,
    settings: &TraceSettings,
    cast: impl Fn(&TraceSettings) -> Result<Traced>,
    placing: &Placing,
    panel: &Grid,
    wavelength: f64,
) -> Result<(Traced, Option<Rays>)> {
    /// Rays of the first look: the share of a shape's area on such a grid is right to a few tenths of a per cent.
    const PILOT: f64 = 10_000.0;
    /// What a number of points may be off.
    const NEAR: f64 = 0.03;
    let shape = [settings.width, settings.height];
    let scale = (PILOT / (f64::from(shape[0]) * f64::from(shape[1]))).sqrt().min(1.0);
    let [width, height] = shape.map(|side| (f64::from(side) * scale).ceil().max(1.0) as u32);
    let pilot = cast(&TraceSettings { width, height, edge_rays: 1, ..*settings })?;
    let share = |traced: &Traced| traced.points.len() as f64 / (f64::from(traced.width) * f64::from(traced.height));
    let placed = points::place(&world_points(&pilot), placing, Phase::Zero, panel, wavelength);
    let Some(depths) = placed.cloud.depth_range() else { return Ok((pilot, None)) };
    let resolution = Resolution::new(placing, depths, panel, wavelength);
    let mut rays = budget.rays(shape, share(&pilot), resolution)?;
    let mut best: Option<(f64, Traced, Rays)> = None;
    // Fine structure may fool the first look; the second knows the finer grid's share.
    for _ in 0..3 {
        let traced = cast(&TraceSettings { width: rays.size[0], height: rays.size[1], jitter: true, ..*settings })?;
        let off = match (budget, rays.limit) {
            (Budget::Points(count), Limit::Budget) => (traced.points.len() as f64 / count as f64).ln().abs(),
            _ => 0.0,
        };
        let next = if off > NEAR && !traced.points.is_empty() {
            Some(budget.rays(shape, share(&traced), resolution)?).filter(|next| next.size != rays.size)
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

/// Points → field on the panel, by the engine that the planner chooses.
pub fn field(
    cloud: &PointCloud,
    channel: Channel,
    panel: &Grid,
    wavelength: f64,
    settings: &HologramSettings,
    progress: &Progress,
) -> Result<Computed> {
    let points = cloud.channel(channel);
    let plan = hologram::plan(&points, panel, wavelength, settings)?;
    hologram::compute(&points, panel, wavelength, &plan, progress)
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
        let plan = hologram::plan(&points, panel, wavelength, settings)?;
        hologram::compute(&points, panel, wavelength, &plan, progress).map(Some)
    };
    let [red, green, blue] = each;
    let [long, middle, short] = lasers.wavelengths();
    Ok(ColorFields { computed: [one((red, long))?, one((green, middle))?, one((blue, short))?], gamut })
}

/// How sub-frames that are shown faster than the eye sees share a cloud's light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SubFrames {
    /// All points in each, with phases of their own: speckle patterns that are averaged, contrast as 1/√N.
    Phases,
    /// Every N-th point in each: neighbours do not interfere where their spots overlap.
    Sparse,
}

/// Points → the cloud's field in sub-frame `index` of `count`; phases are random by `seed` and sub-frame.
pub fn sub_field(
    cloud: &PointCloud,
    channel: Channel,
    (index, count, kind, seed): (usize, usize, SubFrames, u64),
    panel: &Grid,
    wavelength: f64,
    settings: &HologramSettings,
    progress: &Progress,
) -> Result<Computed> {
    let mut points = cloud.channel(channel);
    let stream = seed.wrapping_add(1 + index as u64);
    points.iter_mut().enumerate().for_each(|(i, p)| p.phase = Random::new(stream, i as u64).phase());
    if kind == SubFrames::Sparse {
        points = points.into_iter().skip(index).step_by(count.max(1)).collect();
    }
    let plan = hologram::plan(&points, panel, wavelength, settings)?;
    hologram::compute(&points, panel, wavelength, &plan, progress)
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

impl SceneView {
    fn new(traced: &trace::Traced, placed: &Placed, placing: Placing) -> Self {
        let mut depths = vec![None; traced.picture.len()];
        for (point, at) in traced.points.iter().zip(&placed.cloud.points) {
            depths[point.pixel as usize] = Some(at.position.z);
        }
        spread(&mut depths, traced.width as usize);
        Self {
            width: traced.width as usize,
            height: traced.height as usize,
            picture: traced.picture.clone(),
            depths,
            focus: focus_depths(traced, placed),
            placing,
        }
    }
}

/// Gives pixels without a depth that of the nearest pixel that has one (counted in steps across and down).
fn spread(depths: &mut [Option<f64>], width: usize) {
    let mut front: std::collections::VecDeque<usize> = (0..depths.len()).filter(|&i| depths[i].is_some()).collect();
    while let Some(at) = front.pop_front() {
        let (column, last) = (at % width, depths.len() - 1);
        let left = (column > 0).then(|| at - 1);
        let right = (column + 1 < width && at < last).then(|| at + 1);
        let (up, down) = (at.checked_sub(width), Some(at + width).filter(|&d| d <= last));
        for next in [left, right, up, down].into_iter().flatten() {
            if depths[next].is_none() {
                depths[next] = depths[at];
                front.push_back(next);
            }
        }
    }
}

/// Depths of the nearest and the farthest object that fills at least 1 % of the picture, and of mirror images.
fn focus_depths(traced: &trace::Traced, placed: &Placed) -> Vec<(String, f64)> {
    let mut by_object = std::collections::BTreeMap::<u32, Vec<f64>>::new();
    let mut mirrored = Vec::new();
    for (point, at) in traced.points.iter().zip(&placed.cloud.points) {
        if point.bounces > 0 {
            mirrored.push(at.position.z);
        } else {
            by_object.entry(point.instance).or_default().push(at.position.z);
        }
    }
    let enough = traced.points.len() / 100;
    let median = |depths: &mut Vec<f64>| {
        depths.sort_by(f64::total_cmp);
        depths[depths.len() / 2]
    };
    let mut objects: Vec<f64> = by_object.values_mut().filter(|d| d.len() > enough).map(median).collect();
    objects.sort_by(f64::total_cmp);
    let mut focus = Vec::new();
    if let (Some(&far), Some(&near)) = (objects.first(), objects.last()) {
        focus.push(("near".to_string(), near));
        if far < near {
            focus.push(("far".to_string(), far));
        }
    }
    if mirrored.len() > enough {
        focus.push(("mirror".to_string(), median(&mut mirrored)));
    }
    focus
}
