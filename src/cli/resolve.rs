//! What was typed, resolved: the panel in its light, and the settings of each step.

use super::args::{ColorArgs, EncodingArgs, HologramArgs, PanelArgs, PlacementArg, PlacementArgs, SceneArgs, ShowArgs};
use super::args::{Wavelengths, White};
use super::report::Report;
use holodrive::encode::{EncodeOptions, Encoding, Reference};
use holodrive::hologram::HologramSettings;
use holodrive::illumination::IlluminationSettings;
use holodrive::names::Named;
use holodrive::panel::{Correction, PanelProfile, Setup, Wavefront};
use holodrive::pipeline::{Bench, Settings};
use holodrive::points::placement::{Phase, SequenceAnchors};
use holodrive::points::trace::TraceSettings;
use holodrive::points::{Multiplexing, Placement, SceneSettings, SubFrames, WhitePoint};
use holodrive::scene::gltf::{Choice, Clip, LoadOptions};
use holodrive::{Error, Result};
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

pub(super) fn scene(light: &SceneArgs, placement: &PlacementArgs, default_white: White) -> SceneSettings {
    SceneSettings {
        load: LoadOptions {
            camera: light.file.camera.as_deref().map(Choice::from),
            clip: light.file.animation.as_deref().map_or(Clip::First, |name| Clip::Of(Choice::from(name))),
            time: light.file.time,
            viewer_light: light.file.viewer_light,
            ..LoadOptions::default()
        },
        illumination: IlluminationSettings {
            form_factor: light.form_factor,
            bounces: light.bounces,
            final_gather: light.final_gather,
            photons: light.photons,
            seed: light.random.seed,
            ..IlluminationSettings::default()
        },
        trace: TraceSettings {
            width: light.rays.0 as u32,
            height: light.rays.1 as u32,
            bounces: light.bounces,
            mirror_depth: light.mirror_depth,
            seed: light.random.seed,
            ..TraceSettings::default()
        },
        points: light.points,
        placement: self::placement(placement),
        phase: match placement.phase {
            Phase::Random { .. } => Phase::Random { seed: light.random.seed },
            other => other,
        },
        white: match light.white.unwrap_or(default_white) {
            White::Auto => WhitePoint::Auto,
            White::None => WhitePoint::Unlimited,
            White::At(value) => WhitePoint::At(value),
        },
        anchors: SequenceAnchors::default(),
    }
}

pub(super) fn placement(args: &PlacementArgs) -> Placement {
    match args.placement {
        PlacementArg::Window => Placement::Window { eye: args.viewer, near: args.near, far: args.far },
        PlacementArg::Model => Placement::Model { eye: args.viewer, z: args.distance, scale: args.scale },
    }
}

pub(super) fn hologram(args: &HologramArgs) -> HologramSettings {
    HologramSettings { error: args.error, method: args.engine, memory: args.memory, ..HologramSettings::default() }
}

/// The encoding that was chosen, or the panel's usual one, with the settings that were typed; those of another encoding are
/// refused by name.
pub(super) fn encode(args: &EncodingArgs, setup: &Setup) -> Result<EncodeOptions> {
    let mut encoding = args.encoding.clone().unwrap_or_else(|| Encoding::usual(setup.profile.modulation()));
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

/// All steps of `show`, and the panel with the correction that was named.
pub(super) fn settings(args: &ShowArgs, setup: Setup) -> Result<(Setup, Settings)> {
    let setup = Setup { correction: correction(args.encoding.correction.as_deref())?, ..setup };
    let multiplexing = if args.sparse { Multiplexing::Sparse } else { Multiplexing::Phases };
    let sub_frames = match args.subframes {
        1 => None,
        count => Some(SubFrames::new(count, multiplexing, args.light.random.seed)?),
    };
    let settings = Settings {
        scene: scene(&args.light, &args.placement, White::Auto),
        channel: args.hologram.channel,
        sub_frames,
        hologram: hologram(&args.hologram),
        encode: encode(&args.encoding, &setup)?,
        bench: Bench { zero_order_stop: args.zero_order_stop, ..Bench::default() },
    };
    Ok((setup, settings))
}
