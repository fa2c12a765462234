//! The whole way, on one screen: a scene becomes points, points fields, fields frames, frames light, and light pictures.
//!
//! Each function is one arrow of the picture in the crate's documentation; [`run`] walks them all, and so does every
//! command, live view and animation. One laser, three lasers and sub-frames differ only in their list of [`exposures`].

use crate::encode::{self, EncodeOptions, Encoded};
use crate::error::Result;
use crate::field::{Complex32, Field};
use crate::hologram::{self, Computed, HologramSettings};
use crate::panel::simulated::{self, Simulation};
use crate::panel::{Frame, Origin, Setup};
use crate::points::{Channel, Exposure, LitScene, PointCloud, ScenePoints, SceneSettings, Share, SubFrames};
use crate::progress::Progress;
use crate::reconstruction::{ExposureLight, Gallery, Light, Target, ViewSettings};
use glam::DVec3;
use std::path::Path;

/// How each step is done.
#[derive(Clone, Debug, Default)]
pub struct Settings {
    /// Scene → points.
    pub scene: SceneSettings,
    /// Which light of a coloured cloud one laser shows.
    pub channel: Channel,
    /// Several frames for one picture, in one laser.
    pub sub_frames: Option<SubFrames>,
    /// Points → fields.
    pub hologram: HologramSettings,
    /// Fields → frames.
    pub encode: EncodeOptions,
    /// Frames → light.
    pub bench: Bench,
}

/// The simulated bench: the panel's faults, and the stop behind it.
#[derive(Clone, Debug, Default)]
pub struct Bench {
    /// What the panel does beside what it should.
    pub simulation: Simulation,
    /// Angle about the axis that a stop in the Fourier plane of the encoding's relay blocks [rad].
    pub zero_order_stop: f64,
}

/// glTF → light on surfaces → points before the panel.
///
/// # Errors
/// As [`LitScene::load`] and [`LitScene::points`].
pub fn points(scene: &Path, settings: &SceneSettings, setup: &Setup, progress: &Progress) -> Result<ScenePoints> {
    let lit = LitScene::load(scene, settings, progress)?;
    lit.points(lit.camera(), settings, &setup.grid, setup.wavelength, progress)
}

/// The patterns that together make one picture on this bench: one, one for each of three lasers, or the sub-frames. Where
/// the cloud's phases are those of paths to an eye, it stands at `path_eye`.
pub fn exposures(setup: &Setup, settings: &Settings, path_eye: Option<DVec3>) -> Vec<Exposure> {
    match (&setup.lasers, settings.sub_frames) {
        (Some(lasers), _) => Exposure::of_lasers(lasers, path_eye),
        (None, Some(frames)) => Exposure::of_sub_frames(frames, settings.channel, setup.wavelength),
        (None, None) => vec![Exposure { wavelength: setup.wavelength, share: Share::Whole(settings.channel) }],
    }
}

/// Points → field of one exposure on the panel, by the engine that the planner chooses; `None` for one of three lasers
/// that has no light.
///
/// # Errors
/// As [`hologram::plan`] and [`hologram::compute`].
pub fn field(
    cloud: &PointCloud,
    exposure: &Exposure,
    setup: &Setup,
    settings: &HologramSettings,
    progress: &Progress,
) -> Result<Option<Computed>> {
    let points = exposure.points(cloud);
    if matches!(exposure.share, Share::Laser { .. }) && points.iter().all(|p| p.amplitude == 0.0) {
        return Ok(None);
    }
    let plan = hologram::plan(&points, &setup.grid, exposure.wavelength, settings)?;
    hologram::compute(&points, &setup.grid, exposure.wavelength, &plan, progress).map(Some)
}

/// Field → frame of drive levels; `origin` goes into its metadata, and its depths tell iterations where to look.
///
/// # Errors
/// As [`EncodeOptions::settings`] and [`encode::encode`].
pub fn frame(
    field: &Field,
    setup: &Setup,
    options: &EncodeOptions,
    origin: Origin,
    progress: &Progress,
) -> Result<Encoded> {
    let (settings, warnings) = options.settings(setup, field.wavelength, origin.depth)?;
    let mut encoded = encode::encode(field, &setup.profile, &settings, progress)?;
    encoded.report.warnings.splice(0..0, warnings);
    encoded.frame.metadata.origin = origin;
    Ok(encoded)
}

/// Frame → the object's field behind the simulated panel, and the stop that keeps its other orders out.
///
/// The encoding's scale is divided out, so that intensities are those of the field that was encoded.
///
/// # Errors
/// As [`simulated::simulate`].
pub fn light(frame: &Frame, bench: &Bench, progress: &Progress) -> Result<ExposureLight> {
    let mut field = simulated::simulate(frame, &bench.simulation, progress)?;
    let mut settings = ViewSettings::default();
    if let Some(encoding) = &frame.metadata.encoding {
        settings.aperture = encoding.aperture;
        settings.block_zero_order(bench.zero_order_stop, field.wavelength);
        if encoding.scale.is_finite() && encoding.scale > 0.0 {
            let gain = (1.0 / encoding.scale) as f32;
            field.samples.iter_mut().for_each(|u: &mut Complex32| *u *= gain);
        }
    }
    Ok(ExposureLight { field, settings, laser: 0 })
}

/// Light → the pictures that a person looks at: of a scene, or of whatever stands at the content's depths.
///
/// Frames are those of three lasers in their order, `None` for a dark one; without lasers they are sub-frames, of which a
/// slow eye sees the mean: their fields are made one after another, since many do not fit the memory.
///
/// # Errors
/// As [`light`] and [`Gallery::of`].
pub fn pictures(
    frames: &[Option<&Frame>],
    setup: &Setup,
    target: &Target,
    bench: &Bench,
    progress: &Progress,
) -> Result<Gallery> {
    let together = if setup.lasers.is_some() { frames.len() } else { 1 };
    let galleries = frames.chunks(together.max(1)).map(|frames| {
        let lit = frames.iter().enumerate().filter_map(|(laser, frame)| Some((laser, (*frame)?)));
        let exposures = lit.map(|(laser, frame)| Ok(ExposureLight { laser, ..light(frame, bench, progress)? }));
        let light = Light { lasers: setup.lasers, exposures: exposures.collect::<Result<_>>()? };
        Gallery::of(&light, target, progress)
    });
    Gallery::mean(galleries, frames.len() / together.max(1))
}

/// One exposure's way from field to frame.
#[derive(Clone, Debug)]
pub struct Hologram {
    /// Its laser and its share of the points.
    pub exposure: Exposure,
    /// The field on the panel.
    pub computed: Computed,
    /// The frame for the panel.
    pub encoded: Encoded,
}

/// What came out of the whole way.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The scene as points, and the traced picture.
    pub points: ScenePoints,
    /// Field and frame of each exposure; `None` for one of three lasers that has no light.
    pub holograms: Vec<Option<Hologram>>,
    /// What is seen of them on the simulated bench, with figures.
    pub pictures: Gallery,
}

/// Scene → points → fields → frames → light → pictures.
///
/// # Errors
/// Those of the steps.
pub fn run(scene: &Path, setup: &Setup, settings: &Settings, progress: &Progress) -> Result<Outcome> {
    let points = points(scene, &settings.scene, setup, progress)?;
    let cloud = &points.placed.cloud;
    let content = points.content();
    let origin = Origin { source: Some(scene.display().to_string()), depth: content.depth, ..Origin::default() };
    let hologram = |exposure: Exposure| {
        let Some(computed) = field(cloud, &exposure, setup, &settings.hologram, progress)? else { return Ok(None) };
        let encoded = frame(&computed.field, setup, &settings.encode, origin.clone(), progress)?;
        Ok(Some(Hologram { exposure, computed, encoded }))
    };
    let exposures = exposures(setup, settings, points.path_eye(settings.scene.phase));
    let holograms = exposures.into_iter().map(hologram).collect::<Result<Vec<_>>>()?;
    let frames: Vec<_> = holograms.iter().map(|h| h.as_ref().map(|h| &h.encoded.frame)).collect();
    let target = Target::new(content, (settings.sub_frames.is_none()).then_some(&points));
    let pictures = pictures(&frames, setup, &target, &settings.bench, progress)?;
    Ok(Outcome { points, holograms, pictures })
}
