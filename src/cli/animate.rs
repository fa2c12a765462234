//! `show` of an animated scene: each frame a hologram, computed ahead and played, or looked at on the simulated panel.

use super::args::ShowArgs;
use super::bar::Bar;
use super::report::{Report, count, seconds, step};
use super::resolve;
use super::sequence::{self, CELL, SHEET, frame_path};
use crate::encode::Encoding;
use crate::field::Grid;
use crate::panel::Setup;
use crate::pipeline::{self, Bench};
use crate::points::{Placement, WhitePoint};
use crate::progress::Progress;
use crate::reconstruction::{self, ColorPicture, Picture, View};
use crate::sequence::{Animation, AnimationFrame, AnimationFrameReport, ContactSheet};
use crate::{Result, files};
use glam::DVec2;
use std::path::Path;
use std::time::Instant;

/// Frames per second where none are said and no monitor sets a rate [Hz].
const USUAL_RATE: f64 = 12.0;

/// What frames are made with.
struct Maker {
    animation: Animation,
    setup: Setup,
}

impl Maker {
    fn make(&self, progress: &Progress, take: &mut dyn FnMut(AnimationFrame) -> Result<bool>) -> Result<()> {
        self.animation.make(&self.setup, progress, take)
    }
}

pub(super) fn show(args: &ShowArgs, path: &Path, mut report: Report) -> Result<Report> {
    sequence::check(args)?;
    let begin = Instant::now();
    let setup = resolve::setup(&args.panel, &mut report)?;
    let usual = Encoding::usual(setup.profile.modulation());
    let (setup, mut settings) = resolve::settings(args, setup, usual)?;
    resolve::check_in_time(&settings, &setup)?;
    // All frames look for the object at the same depths.
    let content = match settings.scene.placement {
        Placement::Window { near, far, .. } => [near, far],
        Placement::Model { z, .. } => [z, z],
    };
    settings.scene.estimate = false;
    settings.encode.fix_depths(content);
    // What cannot be is found out before the work.
    if !matches!(settings.encode.encoding, Some(Encoding::View(_))) {
        report.warn(settings.encode.settings(&setup, setup.wavelength, Some(content))?.1);
    }
    let rate = args.sequence.fps.unwrap_or(USUAL_RATE);
    let animation = Animation::new(path, &settings, rate, args.sequence.from, args.sequence.to)?;
    #[cfg(feature = "display")]
    let screen = super::screen::Screen::asked(args, &setup)?;
    files::output_folder(&args.output.join("frames"))?;
    let bar = Bar::new();
    let mut maker = Maker { animation, setup };
    let frames = maker.animation.times.len();
    report.value("animation_frames", frames);
    maker.animation.first_look(&maker.setup.grid, &bar.progress)?;
    let scene = &maker.animation.settings.scene;
    report.value("held_depths", scene.anchors.depths);
    report.value("held_white", if let WhitePoint::At(white) = scene.white { white } else { 0.0 });
    let look = begin.elapsed().as_secs_f64();
    let what = format!("{} frames, one camera, depth range and white for all", count(frames));
    report.add("first_look_seconds", look, step("first look", look, what));
    #[cfg(feature = "display")]
    if let Some(screen) = screen {
        play(args, &maker, screen, &bar.progress, &mut report)?;
        drop(bar);
        return report.written_to(&args.output);
    }
    let (mut took, mut sheet) = (Vec::new(), ContactSheet::new(SHEET));
    maker.make(&bar.progress, &mut |made| {
        made.encoded.frame.write(&frame_path(&args.output, made.number))?;
        if made.number == 0 {
            report.warn(made.points.warnings.iter());
        }
        took.push(made.report());
        if sheet.wants(made.number) {
            let label = format!("#{} {:.3} s", made.number, made.time);
            sheet.add(made.number, label, pictures(args, &made, &bar.progress.part())?)?;
        }
        Ok(true)
    })?;
    drop(bar);
    sheet.write(&args.output.join("contact.png"))?;
    report.add("contact_sheet", sheet.numbers(), "");
    report_frames(&took, rate, &mut report);
    let total = begin.elapsed().as_secs_f64();
    report.add(
        "seconds",
        total,
        format!("in all       {:>8}  contact.png: traced above, simulated reconstruction below", seconds(total)),
    );
    report.written_to(&args.output)
}

/// The traced picture, and the reconstruction focused on the nearest object.
fn pictures(args: &ShowArgs, made: &AnimationFrame, progress: &Progress) -> Result<Vec<Picture>> {
    let view = &made.points.view;
    let bench = Bench { zero_order_stop: args.zero_order_stop, ..Bench::default() };
    let light = pipeline::light(&made.encoded.frame, &bench, progress)?;
    let z = args.sequence.focus.unwrap_or_else(|| view.focus.first().map_or(0.0, |(_, z)| *z));
    let size = (CELL, ((CELL * view.height) as f64 / view.width as f64).round().clamp(1.0, 4.0 * CELL as f64) as usize);
    let traced = ColorPicture { width: view.width, height: view.height, rgb: view.picture.clone() }.luminance();
    let cells = Grid::new(traced.width, traced.height, 1.0, 1.0)?;
    let half = 0.5 * DVec2::new(traced.width as f64, traced.height as f64);
    let traced = Picture::from_samples(&cells, &traced.values, half, size.0, size.1);
    let at = View::Plane { z };
    let seen = reconstruction::picture(&light.field, &at, view.placing.view_at(z), size, &light.settings, progress)?;
    Ok(vec![traced, seen])
}

fn report_frames(took: &[AnimationFrameReport], rate: f64, report: &mut Report) {
    report.add_serialised("frames_made", &took, "");
    let mut each: Vec<f64> = took.iter().map(|frame| frame.seconds).collect();
    each.sort_by(f64::total_cmp);
    let (Some(least), Some(most)) = (each.first(), each.last()) else { return };
    let median = each[each.len() / 2];
    report.add("frame_seconds", median, "");
    let kept = took.iter().filter(|frame| frame.light_kept).count();
    let still = took.iter().filter(|frame| frame.still).count();
    let line = format!(
        "each frame   {:>8}  (median of {}; {} to {}; {} at {rate} a second); light kept for {}, {} as the one before",
        seconds(median),
        count(took.len()),
        seconds(*least),
        seconds(*most),
        seconds(1.0 / rate),
        count(kept),
        count(still)
    );
    report.add("keeps_up", median <= 1.0 / rate, line);
    let scales: Vec<f64> = took.iter().filter_map(|frame| frame.scale).filter(|scale| *scale > 0.0).collect();
    let (low, high) = scales.iter().fold((f64::INFINITY, 0.0f64), |(low, high), &s| (low.min(s), high.max(s)));
    if high > 0.0 {
        // Light goes as the square of the encoding's scale.
        let unequal = (high / low).powi(2);
        let line =
            format!("brightness   frames differ by a factor of {unequal:.2}, as each uses the panel's whole range");
        report.add("brightness_ratio", unequal, line);
    }
}

/// Frames are made by a thread of their own, kept as they are played, and played again from there.
#[cfg(feature = "display")]
fn play(
    args: &ShowArgs,
    maker: &Maker,
    screen: super::screen::Screen,
    progress: &std::sync::Arc<Progress>,
    report: &mut Report,
) -> Result<()> {
    use super::args::Ahead;
    use super::sequence::state_memory;
    use crate::Error;
    use crate::display::{DisplayFrame, PlaySettings};
    use std::sync::mpsc::sync_channel;
    use std::sync::{Arc, Mutex};

    let signal = &maker.setup.profile.signal;
    let frames = maker.animation.times.len();
    let all = args.sequence.ahead == Ahead::All;
    // A loop keeps them, too.
    if all || args.sequence.repeat {
        state_memory(frames, (signal.width, signal.height))?;
    }
    let mut playing = PlaySettings {
        // The clip runs at its own speed, whatever the monitor's rate is.
        rate: Some(args.sequence.fps.unwrap_or(USUAL_RATE)),
        settle: maker.setup.profile.settle_time.unwrap_or(0.0),
        ..screen.play_settings()
    };
    let (took, warnings) = (Mutex::new(Vec::new()), Mutex::new(Vec::new()));
    let ready = |made: &AnimationFrame| -> Result<Arc<DisplayFrame>> {
        made.encoded.frame.write(&frame_path(&args.output, made.number))?;
        if let Ok(mut took) = took.lock() {
            took.push(made.report());
        }
        if let (0, Ok(mut warnings)) = (made.number, warnings.lock()) {
            warnings.clone_from(&made.points.warnings);
        }
        Ok(Arc::new(DisplayFrame::packed(&[&made.encoded.frame])?))
    };
    let outcome = if all {
        let mut kept: Vec<Arc<DisplayFrame>> = Vec::new();
        maker.make(progress, &mut |made| {
            kept.push(ready(&made)?);
            Ok(true)
        })?;
        progress.start("", 0);
        let rounds = if args.sequence.repeat { usize::MAX } else { 1 };
        screen.sequence((0..rounds).flat_map(|_| kept.iter().cloned().map(Ok)), &playing, progress, report)
    } else {
        let making = Arc::new(Progress::new());
        let (sender, receiver) = sync_channel::<Result<Arc<DisplayFrame>>>(1);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let sender = sender;
                let made = maker.make(&making, &mut |made| Ok(sender.send(ready(&made)).is_ok()));
                match made {
                    // The play has ended, and nobody listens.
                    Ok(()) | Err(Error::Interrupted) => {}
                    Err(error) => drop(sender.send(Err(error))),
                }
            });
            let (mut made, mut kept, mut next) = (receiver.into_iter(), Vec::new(), 0);
            let frames = std::iter::from_fn(|| {
                if let Some(frame) = made.next() {
                    if let (true, Ok(frame)) = (args.sequence.repeat, &frame) {
                        kept.push(Arc::clone(frame));
                    }
                    return Some(frame);
                }
                // None is kept where it is not to begin again.
                next += 1;
                kept.get((next - 1) % kept.len().max(1)).cloned().map(Ok)
            });
            playing.making = Some(Arc::clone(&making));
            screen.sequence(frames, &playing, progress, report)
        })
    };
    let took = took.into_inner().unwrap_or_default();
    report.warn(warnings.into_inner().unwrap_or_default());
    report_frames(&took, args.sequence.fps.unwrap_or(USUAL_RATE), report);
    outcome
}
