//! What was typed, resolved: the panel in its light, and the settings of each step.

use super::args::{ColorArgs, DepthMapArgs, EncodingArgs, HologramArgs, PanelArgs, PlacementArg, PlacementArgs};
use super::args::{SceneArgs, ShowArgs};
use super::args::{ViewerArgs, Wavelengths, White};
use super::load::Reading;
use super::report::Report;
use crate::encode::{EncodeOptions, Encoding, Reference};
use crate::hologram::HologramSettings;
use crate::illumination::IlluminationSettings;
use crate::light_field::{LightField, Pupil, Retina, Viewer};
use crate::names::Named;
use crate::panel::{Correction, PanelProfile, Setup, Wavefront};
use crate::pipeline::{Bench, Settings};
use crate::points::placement::SequenceAnchors;
use crate::points::trace::TraceSettings;
use crate::points::{Multiplexing, Placement, SceneSettings, SubFrames, WhitePoint};
use crate::scene::gltf::{Choice, Clip, LoadOptions};
use crate::units::show_length;
use crate::{Error, Result};
use glam::{DVec2, DVec3};
use std::path::Path;

/// The panel in the light of one laser.
pub(super) fn setup(args: &PanelArgs, report: &mut Report) -> Result<Setup> {
    let profile = PanelProfile::find(&args.panel)?;
    report.warn(profile.warnings());
    let setup = Setup::new(profile, args.wavelength)?;
    report.value("panel", &setup.profile.name);
    report.value("wavelength", setup.wavelength);
    Ok(setup)
}

/// The panel in the light of one laser, or of three where they were asked for.
pub(super) fn setup_in_color(args: &PanelArgs, color: &ColorArgs, report: &mut Report) -> Result<Setup> {
    let setup = setup(args, report)?;
    let setup = match color.wavelengths {
        None => return Ok(setup),
        Some(Wavelengths::Panel) => setup.in_color(None)?,
        Some(Wavelengths::Of(wavelengths)) => setup.in_color(Some(wavelengths))?,
    };
    if let Some(lasers) = &setup.lasers {
        report.value("wavelength", ());
        report.value("wavelengths", lasers.wavelengths());
        report.value("white_powers", lasers.white());
    }
    Ok(setup)
}

/// The wavefront correction that was named: a file, `none`, or the profile's own.
pub(super) fn correction(named: Option<&str>) -> Result<Correction> {
    Ok(match named {
        None => Correction::Profile,
        Some("none") => Correction::None,
        Some(file) => Correction::Given(Wavefront::read(Path::new(file), None)?),
    })
}

/// The correction that the panel's patterns carry at its wavelength; told where there is one.
pub(super) fn told_correction(setup: &Setup, report: &mut Report) -> Result<Option<Wavefront>> {
    let (found, warnings) = setup.correction(setup.wavelength)?;
    report.warn(warnings);
    if let Some(found) = &found {
        report.add("correction", &found.name, format!("correction   {}", found.name));
    }
    Ok(found)
}

pub(super) fn scene(light: &SceneArgs, placement: &PlacementArgs, default_white: White) -> Result<SceneSettings> {
    let error = light.quality.error();
    let usual = IlluminationSettings::default().for_error(error)?;
    Ok(SceneSettings {
        load: LoadOptions {
            camera: light.file.camera.as_deref().map(Choice::from),
            clip: light.file.animation.as_deref().map_or(Clip::First, |name| Clip::Of(Choice::from(name))),
            time: light.file.time,
            viewer_light: light.file.viewer_light,
            allow_outside: light.file.allow_outside,
            environment: light.file.panorama(),
            sky: light.file.sky(),
            ..LoadOptions::default()
        },
        illumination: IlluminationSettings {
            form_factor: light.form_factor,
            bounces: light.bounces,
            final_gather: light.final_gather,
            photons: light.photons.unwrap_or(usual.photons),
            seed: light.random.seed,
            ..usual
        },
        trace: TraceSettings {
            width: light.rays.0 as u32,
            height: light.rays.1 as u32,
            bounces: light.bounces,
            mirror_depth: light.mirror_depth,
            seed: light.random.seed,
            ..TraceSettings::default().for_error(error)
        },
        points: light.points,
        placement: self::placement(placement),
        phase: placement.phase(light.random.seed),
        white: match light.white.unwrap_or(default_white) {
            White::Auto => WhitePoint::Auto,
            White::None => WhitePoint::Unlimited,
            White::At(value) => WhitePoint::At(value),
        },
        anchors: SequenceAnchors::default(),
        estimate: true,
    })
}

pub(super) fn placement(args: &PlacementArgs) -> Placement {
    match args.kind() {
        PlacementArg::Window => Placement::Window { eye: args.viewer, near: args.near(), far: args.far() },
        PlacementArg::Model => Placement::Model { eye: args.viewer, z: args.distance(), scale: args.scale },
    }
}

/// How inputs that are no scenes are read.
pub(super) fn reading(map: &DepthMapArgs, placement: &PlacementArgs) -> Reading {
    Reading {
        depth: map.reading(),
        placement: placement.is_asked().then(|| self::placement(placement)),
        axes: placement.axes,
        is_phase_typed: placement.phase.is_some(),
        viewer: placement.viewer,
    }
}

pub(super) fn hologram(args: &HologramArgs) -> HologramSettings {
    HologramSettings { error: args.error, method: args.engine, memory: args.memory, ..HologramSettings::default() }
}

/// The encoding that was chosen, or the usual one, with the settings that were typed; those of another encoding are
/// refused by name.
pub(super) fn encode(args: &EncodingArgs, usual: Encoding) -> Result<EncodeOptions> {
    let mut encoding = args.encoding.clone().unwrap_or(usual);
    let chosen = encoding.name();
    let without = |flag: &'static str| Err(Error::parameter(flag, format!("{chosen} has no use for it; leave it out")));
    if let Some(angles) = args.reference_angle {
        let reference = Some(Reference::Angle(angles));
        match &mut encoding {
            Encoding::OffAxisBipolar(fringe) | Encoding::OffAxisIntensity(fringe) => fringe.reference = reference,
            Encoding::Binary(binary) => binary.fringe.reference = reference,
            _ => return without("reference-angle"),
        }
    }
    if args.depths.len() > 64 {
        return Err(Error::out_of_range("depths", args.depths.len(), "planes; at most 64"));
    }
    let iterations = args.iterations.map(|n| n as usize);
    match &mut encoding {
        Encoding::Planes(planes) => {
            planes.iterations = iterations.unwrap_or(planes.iterations);
            planes.depths.clone_from(&args.depths);
            planes.start = args.start.unwrap_or(planes.start);
        }
        _ if !args.depths.is_empty() => return without("depths"),
        _ if args.start.is_some() => return without("start"),
        Encoding::View(view) => {
            view.iterations = iterations;
            let typed = [
                ("blaze", args.blaze.is_some()),
                ("lens", args.lens.is_some()),
                ("band-stop", args.band_stop.is_some()),
            ];
            if let Some((flag, _)) = typed.into_iter().find(|(_, typed)| *typed) {
                return without(flag);
            }
        }
        Encoding::Gradient(gradient) => gradient.iterations = iterations.unwrap_or(gradient.iterations),
        _ if iterations.is_some() => return without("iterations"),
        _ => {}
    }
    Ok(EncodeOptions {
        encoding: Some(encoding),
        blaze: args.blaze.unwrap_or([0.0; 2]),
        lens: args.lens,
        stop: args.band_stop.unwrap_or(0.0),
    })
}

/// Where the eye stands: on its axis at --viewer, if nothing else is said.
pub(super) fn viewer(args: &ViewerArgs, placement: Option<&PlacementArgs>, views: Option<&LightField>) -> Viewer {
    let mut viewer = Viewer::default();
    if let Some(placement) = placement {
        viewer.eye.z = placement.viewer;
    }
    if let Some(views) = views {
        viewer.eye = views.eyes.center.extend(views.eyes.distance);
    }
    viewer.eye = args.eye.map_or(viewer.eye, DVec3::from_array);
    viewer.pupil = args.pupil;
    viewer.eye_box = args.eye_box.map_or(viewer.eye_box, DVec2::from_array);
    viewer
}

/// Several frames for one picture, if there are several.
pub(super) fn sub_frames(count: usize, sparse: bool, seed: u64) -> Result<Option<SubFrames>> {
    let multiplexing = if sparse { Multiplexing::Sparse } else { Multiplexing::Phases };
    if count == 1 { Ok(None) } else { SubFrames::new(count, multiplexing, seed).map(Some) }
}

/// Refuses what a light field is not for.
pub(super) fn check_viewer(viewer: &Viewer, setup: &Setup) -> Result<()> {
    Retina::of(viewer, &setup.grid, setup.wavelength)?;
    let half_angle = setup.wavelength / (2.0 * setup.grid.pitch_x.max(setup.grid.pitch_y));
    let reach = half_angle * viewer.eye.z;
    if viewer.eye.x.abs() > 2.0 * reach || viewer.eye.y.abs() > 2.0 * reach {
        let place = format!("{}, {}", show_length(viewer.eye.x), show_length(viewer.eye.y));
        let limit = format!("is out of reach: the panel sends its light to ±{} there", show_length(reach));
        return Err(Error::out_of_range("eye", place, limit));
    }
    Ok(())
}

/// Refuses a viewer that frames in time are not made for.
pub(super) fn check_in_time(settings: &Settings, setup: &Setup) -> Result<()> {
    match settings.encode.encoding {
        Some(Encoding::View(_)) if settings.viewer.pupil == Pupil::All => {
            Err(Error::parameter("pupil", "all: frames in time are made for a pupil with a diameter"))
        }
        Some(Encoding::View(_)) => check_viewer(&settings.viewer, setup),
        _ => Ok(()),
    }
}

/// All steps of `show`, and the panel with the correction that was named; `usual` is the encoding where none is.
pub(super) fn settings(args: &ShowArgs, setup: Setup, usual: Encoding) -> Result<(Setup, Settings)> {
    let setup = Setup { correction: correction(args.encoding.correction.as_deref())?, ..setup };
    let sub_frames = sub_frames(args.subframes, args.sparse, args.light.random.seed)?;
    let mut encode = encode(&args.encoding, usual)?;
    if let Some(Encoding::View(view)) = &mut encode.encoding {
        view.seed = args.light.random.seed;
    }
    let settings = Settings {
        scene: scene(&args.light, &args.placement, White::Auto)?,
        channel: args.channel.channel,
        sub_frames,
        hologram: hologram(&args.hologram),
        encode,
        viewer: viewer(&args.viewer, Some(&args.placement), None),
        bench: Bench { zero_order_stop: args.zero_order_stop, ..Bench::default() },
    };
    Ok((setup, settings))
}
