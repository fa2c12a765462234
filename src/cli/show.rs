//! `show`: the whole way, with its pictures and data in one folder.

use super::args::{ShowArgs, White};
use super::bar::Bar;
use super::colour;
use super::commands::{content, origin, report_field, write_traced, write_view};
use super::encoding::encode_field;
use super::load::{self, Input, Panel, Points, hologram_settings, load_points, luminance_picture};
use super::report::{Report, count, seconds};
use super::sequence;
use holodrive::field::Field;
use holodrive::field::npy::{self, Content};
use holodrive::panel::simulated::Simulation;
use holodrive::panel::{Frame, Origin};
use holodrive::pipeline::{self, Lit};
use holodrive::points::colour::Lasers;
use holodrive::points::ply;
use holodrive::progress::Progress;
use holodrive::reconstruction::{self, Picture, Scale, View, metrics};
use holodrive::units::show_length;
use holodrive::{Error, Result, files};
use std::path::Path;
use std::time::Instant;

/// Runs the whole way; a folder that was made for nothing is taken away again.
pub(super) fn show(args: &ShowArgs) -> Result<Report> {
    let new = !args.output.exists();
    let outcome = run(args);
    if new && outcome.is_err() {
        // Only an empty folder goes; one with results in it stays.
        let _ = std::fs::remove_dir(&args.output);
    }
    outcome
}

fn run(args: &ShowArgs) -> Result<Report> {
    let begin = Instant::now();
    let mut report = Report::new("show");
    if args.live {
        return live(args, report);
    }
    if let Some(sequence) = sequence::asked(args)? {
        return sequence::show(args, sequence, report);
    }
    let source = load::input(&args.input)?;
    let panel = load::panel_in_color(&args.panel, &args.color, &mut report)?;
    let out = &args.output;
    #[cfg(not(feature = "display"))]
    if args.monitor.is_some() {
        return Err(Error::unsupported("this build has no display; build it with the feature `display` (the default)"));
    }
    if let Some(lasers) = &panel.lasers {
        if matches!(source, Input::Frame(_) | Input::Field(_)) {
            let what = "three lasers are for scenes, point clouds and pictures with depth; this input is of one";
            return Err(Error::parameter("wavelengths", what));
        }
        if args.monitor.is_some() {
            colour::carried(&panel)?;
        }
        return in_color(args, &source, (&panel, lasers), begin, report);
    }
    if args.subframes != 1 {
        return in_sub_frames(args, &source, &panel, begin, report);
    }
    // A monitor that is not there is found out before the work, not after it.
    #[cfg(feature = "display")]
    let screen = super::screen::Screen::asked(args)?;
    files::output_folder(out)?;
    let bar = Bar::new();
    let (frame, lit, content) = match &source {
        Input::Frame(path) => {
            let profile = Some(&panel.profile).filter(|_| args.panel.panel != "generic");
            let (frame, warnings) = match Frame::read(path, profile, args.panel.wavelength) {
                // A foreign picture has no metadata: it is read for the default panel.
                Err(_) if profile.is_none() => Frame::read(path, Some(&panel.profile), args.panel.wavelength)?,
                other => other?,
            };
            report.warn(warnings);
            let content = Content { depth: frame.metadata.origin.depth, ..Content::default() };
            (frame, None, content)
        }
        Input::Field(path) => {
            let pitch = [panel.grid.pitch_x, panel.grid.pitch_y];
            let wavelength = args.panel.wavelength.or(npy::read_metadata(path)?.map(|m| m.wavelength));
            let (field, metadata) = npy::read_field(path, Some(pitch), wavelength.or(Some(panel.wavelength)))?;
            let frame = encode(args, &panel, &field, &metadata.content, &bar.progress, &mut report)?;
            (frame, None, metadata.content)
        }
        _ => {
            let points =
                load_points(&source, (&args.light, &args.placement, White::Auto), &panel, &bar.progress, &mut report)?;
            write_points(out, &points, &mut report)?;
            let settings = hologram_settings(&args.hologram);
            let computed = pipeline::field(
                &points.cloud,
                args.hologram.channel,
                &panel.grid,
                panel.wavelength,
                &settings,
                &bar.progress,
            )?;
            report_field(&computed, &mut report);
            let content = content(&points.cloud, &points.metadata);
            npy::write_field(&out.join("field.npy"), &computed.field, &content, &origin(&args.input, &points.cloud))?;
            let frame = encode(args, &panel, &computed.field, &content, &bar.progress, &mut report)?;
            (frame, points.lit, content)
        }
    };
    let to_frame = begin.elapsed().as_secs_f64();
    report.add("to_frame_seconds", to_frame, format!("to the frame {:>8}", seconds(to_frame)));
    #[cfg(feature = "display")]
    if let Some(screen) = screen {
        bar.progress.start("", 0);
        screen.show(&[&frame], &bar.progress, &mut report)?;
        return finish(report, out);
    }
    look(&frame, lit.as_ref(), &content, args, &bar.progress, &mut report)?;
    drop(bar);
    let total = begin.elapsed().as_secs_f64();
    report.add("seconds", total, format!("in all       {:>8}", seconds(total)));
    finish(report, out)
}

#[cfg(feature = "display")]
fn live(args: &ShowArgs, report: Report) -> Result<Report> {
    let in_time = &args.sequence;
    if in_time.fps.is_some()
        || in_time.repeat
        || in_time.from.is_some()
        || in_time.to.is_some()
        || !args.more.is_empty()
    {
        return Err(Error::parameter("live", "shows a scene at one --time; leave --fps, --loop, --from and --to out"));
    }
    if args.color.wavelengths.is_some() || args.subframes != 1 {
        return Err(Error::parameter("live", "shows one frame of one laser; leave --wavelengths and --subframes out"));
    }
    match load::input(&args.input)? {
        Input::Scene(path) => super::live::show(args, &path, report),
        _ => Err(Error::input(&args.input, "is no scene (.gltf, .glb); --live follows a scene")),
    }
}

#[cfg(not(feature = "display"))]
fn live(_: &ShowArgs, _: Report) -> Result<Report> {
    Err(Error::unsupported("this build has no display; build it with the feature `display` (the default)"))
}

/// The whole way in several frames that are seen as one.
fn in_sub_frames(args: &ShowArgs, source: &Input, panel: &Panel, begin: Instant, mut report: Report) -> Result<Report> {
    super::subframes::check(args, panel)?;
    #[cfg(feature = "display")]
    let screen = super::screen::Screen::asked(args)?;
    if matches!(source, Input::Frame(_) | Input::Field(_)) {
        let what = "sub-frames are for scenes, point clouds and pictures with depth; a field has its phases";
        return Err(Error::parameter("subframes", what));
    }
    files::output_folder(&args.output)?;
    let bar = Bar::new();
    let points = load_points(source, (&args.light, &args.placement, White::Auto), panel, &bar.progress, &mut report)?;
    write_points(&args.output, &points, &mut report)?;
    let frames = super::subframes::frames(args, panel, &points, &bar.progress, &mut report)?;
    let to_frame = begin.elapsed().as_secs_f64();
    report.add("to_frame_seconds", to_frame, format!("to the frames{:>8}", seconds(to_frame)));
    #[cfg(feature = "display")]
    if let Some(screen) = screen {
        bar.progress.start("", 0);
        screen.show(&frames.iter().collect::<Vec<_>>(), &bar.progress, &mut report)?;
        return finish(report, &args.output);
    }
    let content = content(&points.cloud, &points.metadata);
    super::subframes::look(&frames, args, &content, &bar.progress, &mut report)?;
    drop(bar);
    let total = begin.elapsed().as_secs_f64();
    report.add("seconds", total, format!("in all       {:>8}", seconds(total)));
    finish(report, &args.output)
}

/// The whole way in three colours.
fn in_color(
    args: &ShowArgs,
    source: &Input,
    (panel, lasers): (&Panel, &Lasers),
    begin: Instant,
    mut report: Report,
) -> Result<Report> {
    #[cfg(feature = "display")]
    let screen = super::screen::Screen::asked(args)?;
    files::output_folder(&args.output)?;
    let bar = Bar::new();
    let points = load_points(source, (&args.light, &args.placement, White::Auto), panel, &bar.progress, &mut report)?;
    write_points(&args.output, &points, &mut report)?;
    let colors = colour::frames(args, (panel, lasers), &points, &bar.progress, &mut report)?;
    let to_frame = begin.elapsed().as_secs_f64();
    report.add("to_frame_seconds", to_frame, format!("to the frames{:>8}", seconds(to_frame)));
    #[cfg(feature = "display")]
    if let Some(screen) = screen {
        bar.progress.start("", 0);
        let frames = colors.for_signal()?;
        screen.show(&frames.iter().collect::<Vec<_>>(), &bar.progress, &mut report)?;
        return finish(report, &args.output);
    }
    let content = content(&points.cloud, &points.metadata);
    colour::look(&colors, points.lit.as_ref(), &content, args, &bar.progress, &mut report)?;
    drop(bar);
    let total = begin.elapsed().as_secs_f64();
    report.add("seconds", total, format!("in all       {:>8}", seconds(total)));
    finish(report, &args.output)
}

pub(super) fn finish(mut report: Report, out: &Path) -> Result<Report> {
    report.add("output", out.display().to_string(), format!("pictures and data in {}", out.display()));
    let text = serde_json::to_string_pretty(&report.json()).unwrap_or_default();
    files::write_bytes(&out.join("report.json"), text.as_bytes())?;
    Ok(report)
}

fn write_points(out: &Path, points: &Points, report: &mut Report) -> Result<()> {
    ply::write(&out.join("points.ply"), &points.cloud, &points.metadata)?;
    if let Some(lit) = &points.lit {
        write_traced(&out.join("traced.png"), lit)?;
        report.add_serialised("focus", &lit.view.focus, "");
    }
    Ok(())
}

fn encode(
    args: &ShowArgs,
    panel: &Panel,
    field: &Field,
    content: &Content,
    progress: &Progress,
    report: &mut Report,
) -> Result<Frame> {
    let origin = Origin { source: Some(args.input.display().to_string()), depth: content.depth, ..Origin::default() };
    let frame = encode_field(field, &args.encoding, panel, &origin, progress, report)?;
    frame.write(&args.output.join("frame.png"))?;
    Ok(frame)
}

/// Reconstructions of the simulated panel's light, and how like the traced picture they are.
fn look(
    frame: &Frame,
    lit: Option<&Lit>,
    content: &Content,
    args: &ShowArgs,
    progress: &Progress,
    report: &mut Report,
) -> Result<()> {
    let (begin, out) = (Instant::now(), &args.output);
    let (field, mut settings) = pipeline::simulated_light(frame, &Simulation::default(), progress)?;
    settings.block_zero_order(args.zero_order_stop, field.wavelength);
    let Some(lit) = lit else {
        for (name, z) in reconstruction::planes_of(content.depth) {
            let view = View::Plane { z };
            let half = view.seen_half(&field.grid, content.eye);
            let (grid, values) = reconstruction::intensity(&field, &view, half, &settings, progress)?;
            let picture = Picture { width: grid.width, height: grid.height, values };
            write_view(
                &out.join(format!("reconstruction-{name}.png")),
                &picture,
                Scale::Percentile(0.995),
                &view,
                half,
            )?;
        }
        report_pictures(begin, report);
        return Ok(());
    };
    let size = (lit.view.width, lit.view.height);
    let placing = &lit.view.placing;
    let half_at = |z: f64| placing.view_at(z);
    let target = luminance_picture(lit);
    let white = lit.white.white;

    let step = reconstruction::focus_step(&field, &settings, half_at(content.depth.map_or(0.0, |d| d[0])), size);
    let (sharp, planes) =
        reconstruction::all_in_focus(&field, &lit.view.depths, size, half_at, step, &settings, progress)?;
    let likeness = metrics::likeness(&sharp, &target, white);
    // One gain for all pictures of one frame: what is bright in one is as bright in the others.
    let scale = if likeness.gain > 0.0 {
        Scale::White((f64::from(white) / likeness.gain) as f32)
    } else {
        Scale::Percentile(0.995)
    };
    let write = |name: &str, picture: &Picture, view: &View| {
        let path = out.join(format!("reconstruction-{name}.png"));
        write_view(&path, picture, scale, view, half_at(view.focus()))
    };
    write("sharp", &sharp, &View::Plane { z: content.depth.map_or(0.0, |d| d[0]) })?;
    for (name, z) in &lit.view.focus {
        progress.start(&format!("focus {name}"), 0);
        let view = View::Plane { z: *z };
        let seen = reconstruction::picture(&field, &view, half_at(*z), size, &settings, progress)?;
        write(name, &seen, &view)?;
        report.add(&format!("focus_{name}"), *z, format!("focus on {name}: {} behind the panel", show_length(-z)));
    }
    if let Some((_, focus)) = lit.view.focus.first() {
        let view = View::Eye { position: placing.eye.to_array(), pupil: 4e-3, focus: *focus };
        let seen = reconstruction::picture(&field, &view, half_at(*focus), size, &settings, progress)?;
        let own = metrics::likeness(&seen, &target, white);
        let scale = Scale::White((f64::from(white) / own.gain.max(f64::MIN_POSITIVE)) as f32);
        write_view(&out.join("reconstruction-eye.png"), &seen, scale, &view, half_at(*focus))?;
    }
    report_likeness(&likeness, "reconstruction", planes, report);
    report_pictures(begin, report);
    Ok(())
}

/// How like the traced picture `what` is that was put together from so many planes.
pub(super) fn report_likeness(likeness: &metrics::Likeness, what: &str, planes: usize, report: &mut Report) {
    report.add_serialised(
        "likeness",
        likeness,
        format!(
            "simulated {what}, all in focus from {} planes, against the traced picture: PSNR {:.1} dB, SSIM {:.3}; on 5 × 5 blocks {:.1} dB",
            count(planes),
            likeness.psnr,
            likeness.ssim,
            likeness.psnr_blocks
        ),
    );
}

/// What the pictures took.
pub(super) fn report_pictures(begin: Instant, report: &mut Report) {
    let elapsed = begin.elapsed().as_secs_f64();
    report.add("reconstruction_seconds", elapsed, format!("pictures     {:>8}", seconds(elapsed)));
}
