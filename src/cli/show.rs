//! `show`: the whole way, with its pictures and data in one folder.

use super::animate;
use super::args::{DEFAULT_OUTPUT, ShowArgs};
use super::bar::Bar;
use super::eye;
use super::field::{self, For, Held};
use super::holograms::Maker;
use super::load::{self, Input, Points};
use super::report::{Report, seconds};
use super::resolve;
use super::sequence::{self, Sequence};
use super::shown::{Shown, Views, usual};
use super::steps::write_traced;
use crate::encode::Encoding;
use crate::field::npy::Content;
use crate::light_field::{LightField, Retina};
use crate::panel::{Frame, Setup};
use crate::pipeline::Settings;
use crate::points::ply;
use crate::progress::Progress;
use crate::{Error, Result, files};
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
    report.warn(&args.idle);
    if args.live {
        #[cfg(feature = "display")]
        return super::live::show(args, report);
    }
    #[cfg(not(feature = "display"))]
    super::without_display(args.live || args.monitor.is_some())?;
    match sequence::asked(args)? {
        Some(Sequence::Animated(path)) => return animate::show(args, &path, report),
        Some(Sequence::Prepared(source)) => return sequence::prepared(args, &source, report),
        None => {}
    }
    let source = load::input(&args.input)?;
    let setup = resolve::setup_in_color(&args.panel, &args.color, &mut report)?;
    let usual = usual(args, &source, &setup);
    let for_eyes = matches!(source, Input::Scene(_) | Input::Points(_) | Input::Images(..));
    if let (true, Encoding::DoublePhase(_), None) = (for_eyes, &usual, &args.encoding.encoding) {
        report.warn(["the panel's light does not fill the eye's pupil there: double-phase instead of view"]);
    }
    let (setup, settings) = resolve::settings(args, setup, usual)?;
    check(args, &source, &setup, &settings)?;
    // A monitor that is not there is found out before the work, not after it.
    #[cfg(feature = "display")]
    let screen = super::screen::Screen::asked(args, &setup)?;
    // A frame that is on its way to a monitor needs no folder.
    let is_named = args.output.as_os_str() != DEFAULT_OUTPUT;
    let writes = args.monitor.is_none() || is_named || !matches!(source, Input::Frame(_));
    if writes {
        files::output_folder(&args.output)?;
    }
    let bar = Bar::new();
    let shown = frames(args, &source, &setup, &settings, &bar.progress, &mut report)?;
    let to_frame = begin.elapsed().as_secs_f64();
    report.add("to_frame_seconds", to_frame, format!("to the frame {:>8}", seconds(to_frame)));
    #[cfg(feature = "display")]
    if let Some(screen) = screen {
        bar.progress.start("", 0);
        let frames = lit_and_dark(shown.frames, &setup)?;
        screen.show(&frames.iter().collect::<Vec<_>>(), &bar.progress, &mut report)?;
        return if writes { report.written_to(&args.output) } else { Ok(report) };
    }
    shown.look(args, &setup, &settings, &bar.progress, &mut report)?;
    drop(bar);
    let total = begin.elapsed().as_secs_f64();
    report.add("seconds", total, format!("in all       {:>8}", seconds(total)));
    report.written_to(&args.output)
}

/// Refuses exposures that the input cannot have, or that the panel's signal cannot carry to a monitor, before the work.
fn check(args: &ShowArgs, source: &Input, setup: &Setup, settings: &Settings) -> Result<()> {
    settings.viewer.check()?;
    if let Some(Encoding::View(_)) = settings.encode.encoding {
        if args.sparse {
            return Err(Error::parameter("sparse", "view finds its frames together; leave it out"));
        }
        if matches!(source, Input::Frame(_) | Input::Field(_) | Input::Stack(_)) {
            let why = "view is made from the views of a scene, a point cloud, a picture with depth or a light field";
            return Err(Error::parameter("encoding", why));
        }
        if !matches!(source, Input::Views(_)) {
            resolve::check_viewer(&settings.viewer, setup)?;
        }
    } else if matches!(source, Input::Views(_)) {
        let why = "a light field is shown by view, on a panel that modulates phase";
        return Err(Error::parameter("encoding", why));
    }
    let (flag, what, count) = match &setup.lasers {
        Some(_) => ("wavelengths", "three lasers", 3),
        None => ("subframes", "sub-frames", args.subframes),
    };
    if count == 1 {
        return Ok(());
    }
    if matches!(source, Input::Frame(_) | Input::Field(_)) {
        let why =
            format!("{what} are for scenes, point clouds and pictures with depth; this input has its one pattern");
        return Err(Error::parameter(flag, why));
    }
    let packing = setup.profile.signal.packing;
    if args.monitor.is_some() && packing.frames() < count {
        let why = format!(
            "{what} take {count} frames, and panel {} shows {} at a time ({}); make them without --monitor and show each \
             by itself",
            setup.profile.name,
            packing.frames(),
            packing.name()
        );
        return Err(Error::parameter(flag, why));
    }
    Ok(())
}

/// The input's way to frames, as much of it as is still to go; data are written as they are made.
fn frames(
    args: &ShowArgs,
    source: &Input,
    setup: &Setup,
    settings: &Settings,
    progress: &Progress,
    report: &mut Report,
) -> Result<Shown> {
    let wanted = For { flags: &args.field, panel: Some(&setup.profile), wavelength: args.panel.wavelength, progress };
    let out = &args.output;
    let maker = Maker { input: &args.input, setup, settings, progress };
    match source {
        Input::Frame(path) => {
            // A foreign picture has no metadata: it is read for the default panel.
            let named = args.panel.panel != "generic" || Frame::read(path, None, None).is_err();
            let wanted = For { panel: Some(&setup.profile).filter(|_| named), ..wanted };
            let frame = wanted.frame(path, report)?;
            let content = Content { depth: frame.metadata.origin.depth, ..Content::default() };
            Ok(Shown::new(vec![Some(frame)], focused(args, content, report)))
        }
        Input::Field(path) => match wanted.read(path, report)? {
            Held::Levels(frame) => Ok(Shown::new(vec![Some(*frame)], focused(args, Content::default(), report))),
            Held::Field { field, content, are_phases } => {
                let mut settings = settings.clone();
                if args.encoding.encoding.is_none() {
                    settings.encode.encoding = Some(field::usual(setup.profile.modulation(), are_phases));
                }
                let maker = Maker { settings: &settings, ..maker };
                let content = focused(args, content, report);
                let frame = maker.frame(&field, &content, None, report)?;
                frame.write(&out.join("frame.png"))?;
                Ok(Shown::new(vec![Some(frame)], content))
            }
        },
        Input::Views(path) => {
            let file = LightField::read(path)?;
            let viewer = resolve::viewer(&args.viewer, None, Some(&file));
            resolve::check_viewer(&viewer, setup)?;
            let settings = Settings { viewer, ..settings.clone() };
            let maker = Maker { settings: &settings, ..maker };
            let light = eye::light_field(&eye::Content::Views(file), setup, &settings, progress, report)?;
            let frames = maker.eye_frames(&light, None, out, report)?;
            let content = Content { depth: Some(light.depth), ..Content::default() };
            Ok(Shown { views: Views::Found(light, viewer), ..Shown::new(frames, content) })
        }
        _ => {
            let reading = resolve::reading(&args.map, &args.placement);
            let points = Points::load(source, &settings.scene, &reading, setup, progress, report)?;
            ply::write(&out.join("points.ply"), &points.cloud, &points.metadata)?;
            if let Some((_, scene)) = &points.scene {
                write_traced(&out.join("traced.png"), scene)?;
                report.value("focus", &scene.view.focus);
            }
            let viewer = settings.viewer;
            let (frames, views) = if matches!(settings.encode.encoding, Some(Encoding::View(_))) {
                let content = eye::Content::Points(&points);
                let light = eye::light_field(&content, setup, settings, progress, report)?;
                (maker.eye_frames(&light, Some(&points), out, report)?, Views::Found(light, viewer))
            } else {
                // A frame for a monitor is made without pictures of it.
                let judged = args.monitor.is_none() && Retina::of(&viewer, &setup.grid, setup.wavelength).is_ok();
                (maker.frames(&points, out, report)?, if judged { Views::Wanted(viewer) } else { Views::Unknown })
            };
            if frames.iter().all(Option::is_none) {
                return Err(Error::input(&args.input, "has no light for any of the lasers"));
            }
            Ok(Shown { frames, content: points.content(), points: Some(points), views })
        }
    }
}

/// Content that is looked at where a flag says: of other programs' fields and frames nothing else is known.
fn focused(args: &ShowArgs, content: Content, report: &mut Report) -> Content {
    let (flag, typed) = match (args.sequence.focus, args.placement.distance) {
        (Some(focus), _) => ("focus", focus),
        (None, Some(distance)) => ("distance", distance),
        (None, None) => return content,
    };
    report.check_side(flag, typed, content.depth);
    report.add("focus", typed, "");
    Content { depth: Some([typed; 2]), ..content }
}

/// The frames in their order for a video signal; one without light has level 0 everywhere.
#[cfg(feature = "display")]
fn lit_and_dark(frames: Vec<Option<Frame>>, setup: &Setup) -> Result<Vec<Frame>> {
    let dark = || Frame::new(&setup.profile, setup.wavelength, vec![0; setup.grid.len()]);
    frames.into_iter().map(|frame| frame.map_or_else(dark, Ok)).collect()
}
