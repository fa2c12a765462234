//! `show`: the whole way, with its pictures and data in one folder.

use super::animate;
use super::args::ShowArgs;
use super::bar::Bar;
use super::holograms::Maker;
use super::load::{self, Input, Points};
use super::pictures::report_gallery;
use super::report::{Report, seconds};
use super::resolve;
use super::sequence::{self, Sequence};
use super::steps::write_traced;
use holodrive::field::npy::{self, Content};
use holodrive::panel::{Frame, Setup};
use holodrive::pipeline::{self, Settings};
use holodrive::points::{ScenePoints, ply};
use holodrive::progress::Progress;
use holodrive::reconstruction::Target;
use holodrive::{Error, Result, files};
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

/// Frames of one picture, and what is known of it.
struct Shown {
    /// Those of three lasers, where there are three: none for one without light.
    frames: Vec<Option<Frame>>,
    content: Content,
    scene: Option<ScenePoints>,
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
    let (setup, settings) = resolve::settings(args, setup)?;
    check(args, &source, &setup)?;
    // A monitor that is not there is found out before the work, not after it.
    #[cfg(feature = "display")]
    let screen = super::screen::Screen::asked(args)?;
    files::output_folder(&args.output)?;
    let bar = Bar::new();
    let shown = frames(args, &source, &setup, &settings, &bar.progress, &mut report)?;
    let to_frame = begin.elapsed().as_secs_f64();
    report.add("to_frame_seconds", to_frame, format!("to the frame {:>8}", seconds(to_frame)));
    #[cfg(feature = "display")]
    if let Some(screen) = screen {
        bar.progress.start("", 0);
        let frames = lit_and_dark(shown.frames, &setup)?;
        screen.show(&frames.iter().collect::<Vec<_>>(), &bar.progress, &mut report)?;
        return report.written_to(&args.output);
    }
    let looked = Instant::now();
    let scene = shown.scene.as_ref().filter(|_| settings.sub_frames.is_none());
    let target = Target::new(shown.content, scene);
    let frames: Vec<_> = shown.frames.iter().map(Option::as_ref).collect();
    let gallery = pipeline::pictures(&frames, &setup, &target, &settings.bench, &bar.progress)?;
    gallery.write(&args.output)?;
    drop(bar);
    report_gallery(&gallery, scene, frames.len(), looked, &mut report);
    let total = begin.elapsed().as_secs_f64();
    report.add("seconds", total, format!("in all       {:>8}", seconds(total)));
    report.written_to(&args.output)
}

/// Refuses exposures that the input cannot have, or that the panel's signal cannot carry to a monitor, before the work.
fn check(args: &ShowArgs, source: &Input, setup: &Setup) -> Result<()> {
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
    let out = &args.output;
    let maker = Maker { input: &args.input, setup, settings, progress };
    match source {
        Input::Frame(path) => {
            let profile = Some(&setup.profile).filter(|_| args.panel.panel != "generic");
            let (frame, warnings) = match Frame::read(path, profile, args.panel.wavelength) {
                // A foreign picture has no metadata: it is read for the default panel.
                Err(_) if profile.is_none() => Frame::read(path, Some(&setup.profile), args.panel.wavelength)?,
                other => other?,
            };
            report.warn(warnings);
            let content = Content { depth: frame.metadata.origin.depth, ..Content::default() };
            Ok(Shown { frames: vec![Some(frame)], content, scene: None })
        }
        Input::Field(path) => {
            let pitch = [setup.grid.pitch_x, setup.grid.pitch_y];
            let wavelength = args.panel.wavelength.or(npy::read_metadata(path)?.map(|m| m.wavelength));
            let (field, metadata) = npy::read_field(path, Some(pitch), wavelength.or(Some(setup.wavelength)))?;
            let frame = maker.frame(&field, &metadata.content, None, report)?;
            frame.write(&out.join("frame.png"))?;
            Ok(Shown { frames: vec![Some(frame)], content: metadata.content, scene: None })
        }
        _ => {
            let scale = args.map.depth_scale;
            let points = Points::load(source, &settings.scene, scale, setup, progress, report)?;
            ply::write(&out.join("points.ply"), &points.cloud, &points.metadata)?;
            if let Some(scene) = &points.scene {
                write_traced(&out.join("traced.png"), scene)?;
                report.value("focus", &scene.view.focus);
            }
            let frames = maker.frames(&points, out, report)?;
            if frames.iter().all(Option::is_none) {
                return Err(Error::input(&args.input, "has no light for any of the lasers"));
            }
            Ok(Shown { frames, content: points.content(), scene: points.scene })
        }
    }
}

/// The frames in their order for a video signal; one without light has level 0 everywhere.
#[cfg(feature = "display")]
fn lit_and_dark(frames: Vec<Option<Frame>>, setup: &Setup) -> Result<Vec<Frame>> {
    let dark = || Frame::new(&setup.profile, setup.wavelength, vec![0; setup.grid.len()]);
    frames.into_iter().map(|frame| frame.map_or_else(dark, Ok)).collect()
}
