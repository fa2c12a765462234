//! What is seen of a field or a frame: on a plane, through an eye, and as the eye moves through its box.

use super::args::ReconstructArgs;
use super::bar::Bar;
use super::field::{For, Held};
use super::holograms::named;
use super::load::{Input, input};
use super::output;
use super::report::{Report, seconds};
use crate::field::npy;
use crate::panel::simulated::Simulation;
use crate::panel::{Faults, Frame, PanelProfile, Wavefront};
use crate::pipeline::{self, Bench};
use crate::progress::Progress;
use crate::reconstruction::{self, ExposureLight, Picture, Reconstruction, Scale, View, ViewSettings, orders};
use crate::units::show_length;
use crate::{Error, Result};
use glam::DVec2;
use serde_json::json;
use std::time::Instant;

pub(super) fn reconstruct(args: &ReconstructArgs) -> Result<Report> {
    let mut report = Report::new("reconstruct");
    report.warn(&args.idle);
    let bar = Bar::new();
    output::check(&args.output, &output::PICTURES)?;
    let profile = args.panel.as_deref().map(PanelProfile::find).transpose()?;
    let progress = &bar.progress;
    let wanted = For { flags: &args.field, panel: profile.as_ref(), wavelength: args.wavelength, progress };
    let (ExposureLight { field, settings, .. }, content) = match input(&args.input)? {
        Input::Field(path) => match wanted.read(&path, &mut report)? {
            Held::Field { field, content, .. } => {
                (ExposureLight { field, settings: ViewSettings::default(), laser: 0 }, content)
            }
            Held::Levels(frame) => light_of(args, &frame, progress, &mut report)?,
        },
        Input::Frame(path) => light_of(args, &wanted.frame(&path, &mut report)?, progress, &mut report)?,
        _ => return Err(Error::input(&args.input, "is neither a frame (.png, .bmp) nor a field (.npy, .mat, .h5)")),
    };
    let view = match (args.eye, args.focus, args.distance) {
        (Some(position), Some(focus), _) => {
            report.check_side("focus", focus, content.depth);
            View::Eye { position, pupil: args.pupil, focus }
        }
        (_, _, Some(distance)) => {
            report.check_side("distance", distance, content.depth);
            View::Plane { z: distance - content.z }
        }
        _ => {
            return Err(Error::parameter(
                "distance",
                "give --distance for a sensor's plane, or --eye X,Y,Z with --focus for what an eye sees",
            ));
        }
    };
    let half = match (args.half, args.size) {
        (Some([x, y]), _) => DVec2::new(x, y),
        (None, None) => view.seen_half(&field.grid, content.eye),
        (None, Some(size)) => reconstruction::square_half(view.seen_half(&field.grid, content.eye), size),
    };
    let begin = Instant::now();
    if let (Some(views), Some(eye_box)) = (args.views, args.eye_box) {
        let look = |view: &View, size| reconstruction::picture(&field, view, half, size, &settings, &bar.progress);
        let size = args.size.unwrap_or((field.grid.width, field.grid.height));
        let places = EyeBox { views, eye_box };
        return eye_box_views(args, &view, half, &places, |view| look(view, size), &bar.progress, report);
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
    let (size, white) = ([picture.width, picture.height], picture.white(Scale::Percentile(args.white)));
    Reconstruction::Gray(picture).write(&args.output, None, white, &view, half)?;
    let elapsed = begin.elapsed().as_secs_f64();
    report.section(json!({ "focus": view.focus(), "half": half.to_array(), "size": size, "simulated": true }));
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

/// The light of a frame on the simulated panel, and where its content stands.
fn light_of(
    args: &ReconstructArgs,
    frame: &Frame,
    progress: &Progress,
    report: &mut Report,
) -> Result<(ExposureLight, npy::Content)> {
    let typed = &args.simulation;
    let wavefront_error = typed.wavefront_error.as_deref().map(|path| Wavefront::read(path, None)).transpose()?;
    let faults = Faults { crosstalk: typed.crosstalk, wavefront_error, ..Faults::default() };
    let simulation = Simulation { subsamples: typed.subpixels, faults, ..Simulation::default() };
    let bench = Bench { simulation, zero_order_stop: typed.zero_order_stop };
    let light = pipeline::light(frame, &bench, progress)?;
    if let Some(encoding) = &frame.metadata.encoding {
        let share = orders(&light.field, encoding);
        let line = format!(
            "light        {:.1} % object, {:.1} % zero order, {:.1} % conjugate, {:.1} % elsewhere (simulated)",
            100.0 * share.object,
            100.0 * share.zero,
            100.0 * share.conjugate,
            100.0 * share.rest
        );
        report.add("orders", share, line);
    }
    Ok((light, npy::Content { depth: frame.metadata.origin.depth, ..npy::Content::default() }))
}

/// Places of the eye, beside each other and one above the other, and the box that they fill [m].
struct EyeBox {
    views: (usize, usize),
    eye_box: [f64; 2],
}

/// Writes a picture from each place of the eye, all with the white of the brightest.
fn eye_box_views(
    args: &ReconstructArgs,
    view: &View,
    half: DVec2,
    EyeBox { views: (columns, rows), eye_box }: &EyeBox,
    look: impl Fn(&View) -> Result<Picture>,
    progress: &Progress,
    mut report: Report,
) -> Result<Report> {
    let (columns, rows) = (*columns, *rows);
    let View::Eye { position, pupil, focus } = *view else {
        return Err(Error::parameter("views", "are those of an eye: give --eye and --focus"));
    };
    if columns * rows > 1024 {
        return Err(Error::parameter("views", format!("{columns}×{rows} are too many: 1024 at most")));
    }
    let begin = Instant::now();
    let place = |at: usize, count: usize, side: f64| match count {
        1 => 0.0,
        _ => (at as f64 / (count - 1) as f64 - 0.5) * side,
    };
    progress.start("views", (columns * rows) as u64);
    let mut seen: Vec<(String, View, Picture)> = Vec::new();
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        progress.check()?;
        // Row 0 is the highest place, as in a picture.
        let (dx, dy) = (place(column, columns, eye_box[0]), -place(row, rows, eye_box[1]));
        let moved = View::Eye { position: [position[0] + dx, position[1] + dy, position[2]], pupil, focus };
        seen.push((format!("-{column}-{row}"), moved, look(&moved)?));
        progress.advance(1);
    }
    let white = seen.iter().map(|(_, _, picture)| picture.white(Scale::Percentile(args.white))).fold(0.0, f32::max);
    let mut written = Vec::new();
    for (suffix, moved, picture) in seen {
        let path = named(&args.output, &suffix);
        Reconstruction::Gray(picture).write(&path, None, white, &moved, half)?;
        if let View::Eye { position, .. } = moved {
            written.push(json!({ "file": path.display().to_string(), "eye": position }));
        }
    }
    let elapsed = begin.elapsed().as_secs_f64();
    report.section(json!({ "focus": focus, "simulated": true }));
    report.add("seconds", elapsed, format!("{columns} × {rows} simulated views in {}", seconds(elapsed)));
    report.add("views", written, format!("pictures     {} …", named(&args.output, "-0-0").display()));
    Ok(report)
}
