//! The steps from a scene to a field, one by one.

use super::args::{ComputeArgs, PointsArgs, PropagateArgs, White};
use super::bar::Bar;
use super::holograms::Maker;
use super::layers;
use super::light::report_gamut;
use super::load::{Input, Points, input};
use super::output;
use super::report::{Report, seconds};
use super::resolve;
use crate::field::{npy, stored};
use crate::panel::PanelProfile;
use crate::pipeline::Settings;
use crate::points::{Placement, ScenePoints, images, ply};
use crate::propagation::{self, Propagator};
use crate::reconstruction::write_rgb_png;
use crate::units::{show_length, show_pitch};
use crate::{Error, Result};
use std::path::Path;
use std::time::Instant;

pub(super) fn points(args: &PointsArgs) -> Result<Report> {
    let mut report = Report::new("points");
    report.warn(&args.idle);
    output::check(&args.output, &["ply"])?;
    args.picture.as_deref().map_or(Ok(()), |picture| output::check(picture, &["npy", "png"]))?;
    let setup = resolve::setup_in_color(&args.panel, &args.color, &mut report)?;
    let source = input(&args.scene)?;
    if !matches!(source, Input::Scene(_) | Input::Points(_)) {
        return Err(Error::input(&args.scene, "is no scene (.gltf, .glb, .obj, .stl) and no point cloud"));
    }
    let bar = Bar::new();
    let settings = resolve::scene(&args.light, &args.placement, White::None)?;
    let reading = resolve::reading(&args.map, &args.placement);
    let points = Points::load(&source, &settings, &reading, &setup, &bar.progress, &mut report)?;
    if let Some(lasers) = &setup.lasers {
        report_gamut(lasers, &lasers.gamut(&points.cloud), &mut report);
    }
    let (mut cloud, mut metadata) = (points.cloud, points.metadata);
    let Some((_, scene)) = points.scene else {
        for (flag, path) in [("picture", &args.picture), ("depth-map", &args.depth_map)] {
            if let Some(path) = path {
                let what = "a point cloud has no surfaces to trace";
                report.warn([format!("--{flag} {}: is not written: {what}", path.display())]);
            }
        }
        if args.frame == ply::Frame::World {
            let what = "is for scenes; a cloud's points are written where they stand before the panel";
            return Err(Error::parameter("frame", what));
        }
        bar.progress.check()?;
        ply::write(&args.output, &cloud, &metadata)?;
        report.output("points", &args.output);
        return Ok(report);
    };
    if args.frame == ply::Frame::World {
        metadata = ply::Metadata { frame: ply::Frame::World, eye: None, window: None, ..metadata };
        for (point, world) in cloud.points.iter_mut().zip(&scene.world) {
            point.position = world.position;
        }
    }
    bar.progress.check()?;
    if let Some(picture) = &args.picture {
        write_traced(picture, &scene)?;
        report.file("picture", "picture", picture);
    }
    if let Some(map) = &args.depth_map {
        let Placement::Window { near, far, .. } = settings.placement else {
            let what = "is for --placement window, whose --near and --far it runs between";
            return Err(Error::parameter("depth-map", what));
        };
        let size = [scene.view.width as u32, scene.view.height as u32];
        images::write_depths(map, size, &scene.view.depths, args.map.depth_scale.unwrap_or_default(), [near, far])?;
        report.file("depth_map", "depth map", map);
    }
    ply::write(&args.output, &cloud, &metadata)?;
    report.output("points", &args.output);
    Ok(report)
}

/// The traced picture: linear as .npy, shown as .png.
pub(super) fn write_traced(path: &Path, scene: &ScenePoints) -> Result<()> {
    let view = &scene.view;
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        let texts = [("Description", "traced picture, sRGB-coded linear radiance".to_string())];
        write_rgb_png(path, view.width, view.height, &view.picture, scene.white.white, &texts)
    } else {
        npy::write_picture(path, view.width, view.height, &view.picture)
    }
}

pub(super) fn compute(args: &ComputeArgs) -> Result<Report> {
    let mut report = Report::new("compute");
    report.warn(&args.idle);
    output::check(&args.output, &output::FIELDS)?;
    let setup = resolve::setup_in_color(&args.panel, &args.color, &mut report)?;
    let bar = Bar::new();
    let source = input(&args.input)?;
    if args.layers.is_some() || matches!(source, Input::Stack(_)) {
        layers::compute(args, &source, &setup, &bar.progress, &mut report)?;
        return Ok(report);
    }
    if let Some(segment) = args.views {
        super::segment_views::compute(args, &source, segment, &setup, &bar.progress, &mut report)?;
        return Ok(report);
    }
    let settings = Settings {
        scene: resolve::scene(&args.light, &args.placement, White::Auto)?,
        channel: args.channel.channel,
        hologram: resolve::hologram(&args.hologram),
        ..Settings::default()
    };
    let reading = resolve::reading(&args.map, &args.placement);
    let points = Points::load(&source, &settings.scene, &reading, &setup, &bar.progress, &mut report)?;
    let maker = Maker { input: &args.input, setup: &setup, settings: &settings, progress: &bar.progress };
    maker.fields(&points, &args.output, &mut report)?;
    Ok(report)
}

pub(super) fn propagate(args: &PropagateArgs) -> Result<Report> {
    let mut report = Report::new("propagate");
    output::check(&args.output, &output::FIELDS)?;
    let profile = args.panel.as_deref().map(PanelProfile::find).transpose()?;
    let pitch = args.pitch.or(profile.as_ref().map(|p| [p.pitch_x, p.pitch_y]));
    let wavelength = args.wavelength.or(profile.as_ref().map(PanelProfile::default_wavelength));
    let held = stored::read(&args.input)?;
    report.warn(&held.warnings);
    let (field, metadata) = held.field(&args.input, pitch, wavelength)?;
    if let Some(own) = &held.metadata {
        let other = |own: f64, now: f64| (own - now).abs() > 1e-6 * now;
        let [pitch, light] = [field.grid.pitch(), [field.wavelength; 2]];
        if other(own.pitch[0], pitch[0]) || other(own.pitch[1], pitch[1]) || other(own.wavelength, light[0]) {
            let [its, taken] = [(own.pitch, own.wavelength), (pitch, light[0])]
                .map(|(pitch, wavelength)| format!("{} at {}", show_pitch(pitch), show_length(wavelength)));
            report.warn([format!("{}: made for {its}, taken for {taken}", args.input.display())]);
        }
    }
    report.add("read", &held.origin, format!("{:<12} {}", "read", held.origin));
    let bar = Bar::new();
    let begin = Instant::now();
    bar.progress.start("propagate", 0);
    let settings = propagation::Settings { kernel: args.kernel, ..propagation::Settings::default() };
    let planned = Propagator::new(field.grid, field.grid, settings)?;
    let out = planned.propagate(&field, args.distance, &bar.progress)?;
    let content = npy::Content { z: metadata.content.z + args.distance, ..metadata.content };
    stored::write_field(&args.output, &out, &content, &metadata.origin)?;
    let elapsed = begin.elapsed().as_secs_f64();
    report.add("distance", args.distance, "");
    report.add("wavelength", field.wavelength, "");
    report.add("memory", planned.memory(), "");
    report.add("energy_kept", out.energy() / field.energy(), "");
    report.add("seconds", elapsed, format!("propagated over {} in {}", show_length(args.distance), seconds(elapsed)));
    report.output("field", &args.output);
    Ok(report)
}
