//! The steps, one by one.

use super::args::{ComputeArgs, PointsArgs, PropagateArgs, ReconstructArgs, White};
use super::bar::Bar;
use super::colour;
use super::layers;
use super::light::report_gamut;
use super::load::{Input, hologram_settings, input, load_points, panel_in_color, placed_by};
use super::report::{Report, seconds};
use glam::DVec2;
use holodrive::field::npy;
use holodrive::hologram::Computed;
use holodrive::names::Named;
use holodrive::panel::simulated::Simulation;
use holodrive::panel::{Faults, Frame, PanelProfile, wavefront};
use holodrive::pipeline::{self, Lit};
use holodrive::points::{Placement, PointCloud, images, ply};
use holodrive::propagation::{self, Propagator};
use holodrive::reconstruction::{self, Picture, Scale, View, ViewSettings, orders, write_rgb_png};
use holodrive::units::show_length;
use holodrive::{Error, Result};
use std::path::Path;
use std::time::Instant;

pub(super) fn points(args: &PointsArgs) -> Result<Report> {
    let mut report = Report::new("points");
    let panel = panel_in_color(&args.panel, &args.color, &mut report)?;
    let Input::Scene(path) = input(&args.scene)? else {
        return Err(Error::input(&args.scene, "is no scene: .gltf or .glb"));
    };
    let bar = Bar::new();
    let points = load_points(
        &Input::Scene(path),
        (&args.light, &args.placement, White::None),
        &panel,
        &bar.progress,
        &mut report,
    )?;
    if let Some(lasers) = &panel.lasers {
        report_gamut(lasers, &lasers.points(&points.cloud).1, &mut report);
    }
    let (mut cloud, mut metadata) = (points.cloud, points.metadata);
    let Some(lit) = points.lit else { return Err(Error::input(&args.scene, "is no scene")) };
    if args.frame == ply::Frame::World {
        metadata = ply::Metadata { frame: ply::Frame::World, eye: None, window: None, ..metadata };
        for (point, world) in cloud.points.iter_mut().zip(&lit.world) {
            point.position = world.position;
        }
    }
    bar.progress.check()?;
    if let Some(picture) = &args.picture {
        write_traced(picture, &lit)?;
        report.file("picture", "picture", picture);
    }
    if let Some(map) = &args.depth_map {
        let Placement::Window { near, far, .. } = placed_by(&args.placement) else {
            return Err(Error::parameter(
                "depth-map",
                "is for --placement window, whose --near and --far it runs between",
            ));
        };
        let size = [lit.view.width as u32, lit.view.height as u32];
        images::write_depths(map, size, &lit.view.depths, args.placement.depth_scale, [near, far])?;
        report.file("depth_map", "depth map", map);
    }
    ply::write(&args.output, &cloud, &metadata)?;
    report.output("points", &args.output);
    Ok(report)
}

/// The traced picture: linear as .npy, shown as .png.
pub(super) fn write_traced(path: &Path, lit: &Lit) -> Result<()> {
    let view = &lit.view;
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        let texts = [("Description", "traced picture, sRGB-coded linear radiance".to_string())];
        write_rgb_png(path, view.width, view.height, &view.picture, lit.white.white, &texts)
    } else {
        npy::write_picture(path, view.width, view.height, &view.picture)
    }
}

pub(super) fn report_field(computed: &Computed, report: &mut Report) {
    let did = &computed.report;
    report.add("method", did.method.name(), "");
    report.add("method_reason", did.reason.clone(), "");
    report.add("error_bound", did.error_bound, "");
    report.add(
        "field_seconds",
        did.seconds,
        format!(
            "field        {:>8}  {} ({}): {}; error below {:.1e}",
            seconds(did.seconds),
            did.method.name(),
            did.instruction_set.name(),
            did.reason,
            did.error_bound
        ),
    );
    report.add("predicted_seconds", did.predicted_seconds, "");
    report.add("instruction_set", did.instruction_set.name(), "");
    report.add("memory", did.memory, "");
    report.add("pairs", did.coverage.pairs, "");
}

pub(super) fn compute(args: &ComputeArgs) -> Result<Report> {
    let mut report = Report::new("compute");
    let panel = panel_in_color(&args.panel, &args.color, &mut report)?;
    let bar = Bar::new();
    let source = input(&args.input)?;
    if args.layers.is_some() || matches!(source, Input::Stack(_)) {
        layers::compute(args, &source, &panel, &bar.progress, &mut report)?;
        return Ok(report);
    }
    if let Some(segment) = args.views {
        super::true_views::compute(args, (&source, segment), &panel, &bar.progress, &mut report)?;
        return Ok(report);
    }
    let points = load_points(&source, (&args.light, &args.placement, White::Auto), &panel, &bar.progress, &mut report)?;
    if let Some(lasers) = &panel.lasers {
        colour::compute(args, (&panel, lasers), &points, &bar.progress, &mut report)?;
        return Ok(report);
    }
    let settings = hologram_settings(&args.hologram);
    let computed =
        pipeline::field(&points.cloud, args.hologram.channel, &panel.grid, panel.wavelength, &settings, &bar.progress)?;
    report_field(&computed, &mut report);
    bar.progress.check()?;
    let content = content(&points.cloud, &points.metadata);
    npy::write_field(&args.output, &computed.field, &content, &origin(&args.input, &points.cloud))?;
    report.output("field", &args.output);
    Ok(report)
}

pub(super) fn origin(input: &Path, cloud: &PointCloud) -> String {
    format!("{} points of {}", cloud.points.len(), input.display())
}

/// Where the content of a hologram stands, for the reconstructions to come.
pub(super) fn content(cloud: &PointCloud, metadata: &ply::Metadata) -> npy::Content {
    npy::Content {
        z: 0.0,
        depth: cloud.depth_range().map(|(far, near)| [near, far]),
        eye: metadata.eye,
        window: metadata.window,
    }
}

pub(super) fn propagate(args: &PropagateArgs) -> Result<Report> {
    let mut report = Report::new("propagate");
    let profile = args.panel.as_deref().map(PanelProfile::find).transpose()?;
    let pitch = args.pitch.or(profile.as_ref().map(|p| [p.pitch_x, p.pitch_y]));
    let wavelength = args.wavelength.or(profile.as_ref().map(PanelProfile::default_wavelength));
    let (field, metadata) = npy::read_field(&args.input, pitch, wavelength)?;
    let bar = Bar::new();
    let begin = Instant::now();
    bar.progress.start("propagate", 0);
    let settings = propagation::Settings { kernel: args.kernel, ..propagation::Settings::default() };
    let planned = Propagator::new(field.grid, field.grid, settings)?;
    let out = planned.propagate(&field, args.distance, &bar.progress)?;
    let content = npy::Content { z: metadata.content.z + args.distance, ..metadata.content };
    npy::write_field(&args.output, &out, &content, &metadata.origin)?;
    let elapsed = begin.elapsed().as_secs_f64();
    report.add("distance", args.distance, "");
    report.add("wavelength", field.wavelength, "");
    report.add("memory", planned.memory(), "");
    report.add("energy_kept", out.energy() / field.energy(), "");
    report.add("seconds", elapsed, format!("propagated over {} in {}", show_length(args.distance), seconds(elapsed)));
    report.output("field", &args.output);
    Ok(report)
}

pub(super) fn reconstruct(args: &ReconstructArgs) -> Result<Report> {
    let mut report = Report::new("reconstruct");
    let bar = Bar::new();
    let (field, mut settings, content) = match input(&args.input)? {
        Input::Field(path) => {
            let profile = args.panel.as_deref().map(PanelProfile::find).transpose()?;
            let pitch = profile.as_ref().map(|p| [p.pitch_x, p.pitch_y]);
            let beside = npy::read_metadata(&path)?;
            let wavelength = args
                .wavelength
                .or(beside.as_ref().map(|m| m.wavelength))
                .or(profile.as_ref().map(PanelProfile::default_wavelength));
            let (field, metadata) = npy::read_field(&path, pitch, wavelength)?;
            (field, ViewSettings::default(), metadata.content)
        }
        Input::Frame(path) => {
            let profile = args.panel.as_deref().map(PanelProfile::find).transpose()?;
            let (frame, warnings) = Frame::read(&path, profile.as_ref(), args.wavelength)?;
            report.warn(warnings);
            let wavefront_error = args.bend.as_deref().map(|path| wavefront::read(path, None)).transpose()?;
            let faults = Faults { crosstalk: args.crosstalk, wavefront_error, ..Faults::default() };
            let simulation = Simulation { subsamples: args.subpixels, faults, ..Simulation::default() };
            let (field, mut settings) = pipeline::simulated_light(&frame, &simulation, &bar.progress)?;
            settings.block_zero_order(args.zero_order_stop, field.wavelength);
            if let Some(encoding) = &frame.metadata.encoding {
                let light = orders(&field, encoding);
                let line = format!(
                    "light        {:.1} % object, {:.1} % zero order, {:.1} % conjugate, {:.1} % elsewhere (simulated)",
                    100.0 * light.object,
                    100.0 * light.zero,
                    100.0 * light.conjugate,
                    100.0 * light.rest
                );
                report.add_serialised("orders", &light, line);
            }
            let content = npy::Content { depth: frame.metadata.origin.depth, ..npy::Content::default() };
            (field, settings, content)
        }
        _ => return Err(Error::input(&args.input, "is neither a frame (.png, .bmp) nor a field (.npy)")),
    };
    settings.propagation = propagation::Settings::default();
    let view = match (args.eye, args.focus, args.distance) {
        (Some(position), Some(focus), _) => {
            report.check_side("focus", focus, content.depth);
            View::Eye { position, pupil: args.pupil, focus }
        }
        (_, _, Some(distance)) => {
            report.check_side("distance", distance, content.depth);
            View::Plane { z: distance - content.z }
        }
        _ => return Err(Error::parameter("distance", "give --distance, or --eye with --focus")),
    };
    let half = args.half.map_or_else(|| view.seen_half(&field.grid, content.eye), |[x, y]| DVec2::new(x, y));
    let begin = Instant::now();
    if let (Some(views), Some(eye_box)) = (args.views, args.eye_box) {
        return super::parallax::views(args, (&field, &settings), &view, half, (views, eye_box), &bar.progress, report);
    }
    bar.progress.start("reconstruct", 0);
    let picture = match args.size {
        Some(size) => reconstruction::picture(&field, &view, half, size, &settings, &bar.progress)?,
        None => {
            let (grid, values) = reconstruction::intensity(&field, &view, half, &settings, &bar.progress)?;
            Picture { width: grid.width, height: grid.height, values }
        }
    };
    bar.progress.check()?;
    write_view(&args.output, &picture, Scale::Percentile(args.white), &view, half)?;
    let elapsed = begin.elapsed().as_secs_f64();
    report.add("focus", view.focus(), "");
    report.add("half", half.to_array().to_vec(), "");
    report.add("size", vec![picture.width, picture.height], "");
    report.add("simulated", true, "");
    let side = if view.focus() < 0.0 { "behind" } else { "in front of" };
    report.add(
        "seconds",
        elapsed,
        format!(
            "simulated picture in focus {} {side} the panel, {} × {} mm, in {}",
            show_length(view.focus().abs()),
            (half.x * 2e5).round() / 1e2,
            (half.y * 2e5).round() / 1e2,
            seconds(elapsed)
        ),
    );
    report.output("picture", &args.output);
    Ok(report)
}

/// Writes a reconstruction as .png (shown) or .npy (linear).
pub(super) fn write_view(path: &Path, picture: &Picture, scale: Scale, view: &View, half: DVec2) -> Result<()> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        return npy::write_intensity(path, picture.width, picture.height, &picture.values);
    }
    let described = serde_json::json!({
        "simulated": true,
        "focus": view.focus(),
        "half": half.to_array(),
        "white": picture.white(scale),
        "convention": npy::CONVENTION,
    });
    let texts = [
        ("Description", "simulated reconstruction, sRGB-coded intensity".to_string()),
        ("holodrive", described.to_string()),
    ];
    picture.write_png(path, scale, &texts)
}
