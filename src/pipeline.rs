//! The whole way, on one screen: a scene becomes points, points fields, fields frames, frames light, and light pictures.
//!
//! Each function is one arrow of the picture in the crate's documentation; [`run`] walks them all, and so does every
//! command, live view and animation. One laser, three lasers and sub-frames differ only in their list of [`exposures`].

mod settings;

pub use settings::{Bench, Hologram, Outcome, Settings};

use crate::encode::view::{ViewTarget, Viewed};
use crate::encode::{self, EncodeOptions, Encoded, Encoding, ViewEncoding};
use crate::error::Result;
use crate::field::{Complex32, Field};
use crate::hologram::{self, Computed, HologramSettings};
use crate::light_field::{LightField, LightFieldReport, LightSource, Retina, Viewer};
use crate::panel::simulated;
use crate::panel::{Frame, Origin, Setup};
use crate::points::{Exposure, LitScene, PointCloud, ScenePoints, SceneSettings, Share};
use crate::progress::Progress;
use crate::reconstruction::{Colour, ExposureLight, Gallery, Light, Seeing, SeenGallery, Target, ViewSettings};
use glam::DVec3;
use std::path::Path;

/// glTF → light on its surfaces.
///
/// # Errors
/// As [`LitScene::load`].
pub fn scene(scene: &Path, settings: &SceneSettings, progress: &Progress) -> Result<LitScene> {
    LitScene::load(scene, settings, progress)
}

/// Light on surfaces → points before the panel.
///
/// # Errors
/// As [`LitScene::points`].
pub fn points(lit: &LitScene, settings: &SceneSettings, setup: &Setup, progress: &Progress) -> Result<ScenePoints> {
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

/// Distance beyond which points were meant to stand elsewhere [m]: a cloud in millimetres.
const FAR: f64 = 20.0;

/// Points → field of one exposure on the panel, by the engine that the planner chooses; `None` for one of three lasers
/// that has no light.
///
/// # Errors
/// As [`PointCloud::check`], [`hologram::plan`] and [`hologram::compute`].
pub fn field(
    cloud: &PointCloud,
    exposure: &Exposure,
    setup: &Setup,
    settings: &HologramSettings,
    progress: &Progress,
) -> Result<Option<Computed>> {
    cloud.check()?;
    let points = exposure.points(cloud);
    if matches!(exposure.share, Share::Laser { .. }) && points.iter().all(|p| p.amplitude == 0.0) {
        return Ok(None);
    }
    let plan = hologram::plan(&points, &setup.grid, exposure.wavelength, settings)?;
    let mut computed = hologram::compute(&points, &setup.grid, exposure.wavelength, &plan, progress)?;
    if points.is_empty() {
        computed.report.warnings.push("there are no points: the field is dark".into());
    } else if points.iter().all(|p| p.position.z.abs() > FAR) {
        computed.report.warnings.push(format!("all points stand more than {FAR} m from the panel; look at their unit"));
    }
    Ok(Some(computed))
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

/// Scene in its light → what an eye anywhere in the viewer's box sees of it: what an encoding for the eye shows, and what every
/// encoding is judged by.
///
/// # Errors
/// As [`Retina::of`] and [`LightSource::views`].
pub fn light_field(
    source: &LightSource,
    setup: &Setup,
    settings: &Settings,
    progress: &Progress,
) -> Result<(LightField, Option<LightFieldReport>)> {
    let retina = Retina::of(&settings.viewer, &setup.grid, setup.wavelength)?;
    source.views(&settings.viewer, &retina, &settings.light_field(setup.lasers.is_some()), progress)
}

/// Light field → frames that show it to the viewer: those of sub-frames are found together, those of three lasers one by one;
/// `None` for a laser that has no light. They go on from the phases `start`, where these are those of as many frames.
///
/// # Errors
/// As [`ViewEncoding::encode`].
pub fn views(
    light: &LightField,
    viewer: &Viewer,
    exposures: &[Exposure],
    setup: &Setup,
    settings: &ViewEncoding,
    start: &[Vec<f32>],
    progress: &Progress,
) -> Result<Vec<Option<Viewed>>> {
    let retina = Retina::of(viewer, &setup.grid, setup.wavelength)?;
    let together = exposures.chunk_by(|a, b| a.is_shown_with(b));
    let found = together.map(|exposures| {
        let light = &*light.of_exposure(&exposures[0]);
        let target = ViewTarget { light, viewer, retina: &retina, setup, wavelength: exposures[0].wavelength };
        let start = (start.len() == exposures.len()).then(|| start.to_vec());
        (!light.is_dark()).then(|| settings.encode(&target, exposures.len(), start, progress)).transpose()
    });
    found.collect()
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

/// Light → what the viewer sees of it through the pupil, judged against the light field.
///
/// Frames as those of [`pictures`].
///
/// # Errors
/// As [`light`] and [`SeenGallery::of`].
pub fn seen(
    frames: &[Option<&Frame>],
    setup: &Setup,
    seeing: &Seeing,
    bench: &Bench,
    progress: &Progress,
) -> Result<SeenGallery> {
    let lit = frames.iter().enumerate().filter_map(|(index, frame)| Some((index, (*frame)?)));
    let laser = |index| if setup.lasers.is_some() { index } else { 0 };
    let each = lit.map(|(index, frame)| Ok(ExposureLight { laser: laser(index), ..light(frame, bench, progress)? }));
    SeenGallery::of(each, seeing, progress)
}

/// Scene → points → fields → frames → light → pictures; or scene → light field → frames, for an encoding that is made for the
/// eye.
///
/// # Errors
/// Those of the steps.
pub fn run(scene: &Path, setup: &Setup, settings: &Settings, progress: &Progress) -> Result<Outcome> {
    let lit = self::scene(scene, &settings.scene, progress)?;
    let points = points(&lit, &settings.scene, setup, progress)?;
    let (cloud, viewer, content) = (&points.placed.cloud, &settings.viewer, points.content());
    let views_seen = light_field(&LightSource::Scene { lit: &lit, points: &points }, setup, settings, progress)?.0;
    let origin = Origin { source: Some(scene.display().to_string()), depth: content.depth, ..Origin::default() };
    let exposures = exposures(setup, settings, points.path_eye(settings.scene.phase));
    let holograms: Vec<_> = if let Some(Encoding::View(view)) = &settings.encode.encoding {
        let found = views(&views_seen, viewer, &exposures, setup, view, &[], progress)?;
        let frames = found.into_iter().flat_map(Viewed::frames_or_none).zip(exposures);
        frames.map(|(e, exposure)| e.map(|encoded| Hologram { exposure, computed: None, encoded })).collect()
    } else {
        let hologram = |exposure: Exposure| {
            let Some(computed) = field(cloud, &exposure, setup, &settings.hologram, progress)? else { return Ok(None) };
            let encoded = frame(&computed.field, setup, &settings.encode, origin.clone(), progress)?;
            Ok(Some(Hologram { exposure, computed: Some(computed), encoded }))
        };
        exposures.into_iter().map(hologram).collect::<Result<_>>()?
    };
    let frames: Vec<_> = holograms.iter().map(|h| h.as_ref().map(|h| &h.encoded.frame)).collect();
    let target = Target::new(content, (settings.sub_frames.is_none()).then_some(&points));
    let pictures = pictures(&frames, setup, &target, &settings.bench, progress)?;
    let colour = Colour::of(setup.lasers, setup.wavelength, settings.channel);
    let seeing = Seeing::of_scene(&views_seen, viewer, colour, &points);
    let seen = seen(&frames, setup, &seeing, &settings.bench, progress)?;
    Ok(Outcome { points, holograms, pictures, seen })
}
