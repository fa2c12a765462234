//! `show` of an animated scene: each frame a hologram, computed ahead and played, or looked at on the simulated panel.

use super::args::{ShowArgs, White};
use super::bar::Bar;
use super::encoding::encode_settings;
use super::load::{self, Panel, hologram_settings, luminance_picture, scene_settings};
use super::report::{Report, count, seconds};
use super::sequence::{CELL, SHEET, frame_path};
use super::show::finish;
use glam::DVec2;
use holodrive::encode::EncodeSettings;
use holodrive::field::Grid;
use holodrive::hologram::HologramSettings;
use holodrive::panel::simulated::Simulation;
use holodrive::pipeline;
use holodrive::points::{Placement, WhitePoint};
use holodrive::progress::Progress;
use holodrive::reconstruction::{self, Picture, View};
use holodrive::sequence::{Animation, ContactSheet, Made};
use holodrive::{Result, files};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// Frames per second where none are said and no monitor sets a rate [Hz].
const USUAL_RATE: f64 = 12.0;

/// What one frame took.
#[derive(Clone, Debug, Serialize)]
struct Took {
    number: usize,
    time: f64,
    points: usize,
    light_seconds: f64,
    trace_seconds: f64,
    field_seconds: f64,
    seconds: f64,
    still: bool,
    light_kept: bool,
    /// Light of the encoded field on the panel: what the brightness of frames is compared by.
    scale: Option<f64>,
}

impl Took {
    fn of(made: &Made) -> Self {
        Self {
            number: made.number,
            time: made.time,
            points: made.lit.placed.cloud.points.len(),
            light_seconds: if made.light_kept { 0.0 } else { made.lit.illumination.seconds },
            trace_seconds: if made.still { 0.0 } else { made.lit.trace.seconds },
            field_seconds: if made.still { 0.0 } else { made.field.seconds },
            seconds: made.seconds,
            still: made.still,
            light_kept: made.light_kept,
            scale: made.encoded.frame.metadata.encoding.as_ref().map(|encoding| encoding.scale),
        }
    }
}

/// What the frames of an animation are made with.
struct Maker {
    animation: Animation,
    panel: Panel,
    hologram: HologramSettings,
    encode: EncodeSettings,
}

impl Maker {
    fn make(&self, args: &ShowArgs, progress: &Progress, take: &mut dyn FnMut(Made) -> Result<bool>) -> Result<()> {
        let at = (&self.panel.profile, self.panel.wavelength, args.hologram.channel);
        self.animation.make(at, &self.hologram, &self.encode, progress, take)
    }
}

pub(super) fn show(args: &ShowArgs, path: &Path, mut report: Report) -> Result<Report> {
    let begin = Instant::now();
    let panel = load::panel(&args.panel, &mut report)?;
    let settings = scene_settings(&args.light, &args.placement, White::Auto);
    let rate = args.sequence.fps.unwrap_or(USUAL_RATE);
    let animation = Animation::new(path, &settings, rate, args.sequence.from, args.sequence.to)?;
    #[cfg(feature = "display")]
    let screen = super::screen::Screen::asked(args)?;
    let content = match settings.placement {
        Placement::Window { near, far, .. } => Some([near, far]),
        Placement::Model { z, .. } => Some([z, z]),
    };
    let encode = encode_settings(&args.encoding, &panel, content, &mut report)?;
    let hologram = hologram_settings(&args.hologram);
    files::output_folder(&args.output.join("frames"))?;
    let bar = Bar::new();
    let mut maker = Maker { animation, panel, hologram, encode };
    let frames = maker.animation.times.len();
    report.add("animation_frames", frames, "");
    maker.animation.first_look(&maker.panel.grid, &bar.progress)?;
    let held = &maker.animation.scene;
    report.add_serialised("held_depths", &held.anchors.depths, "");
    report.add("held_white", if let WhitePoint::At(white) = held.white { white } else { 0.0 }, "");
    let look = begin.elapsed().as_secs_f64();
    let line = format!(
        "first look   {:>8}  {} frames, one camera, depth range and white for all",
        seconds(look),
        count(frames)
    );
    report.add("first_look_seconds", look, line);
    #[cfg(feature = "display")]
    if let Some(screen) = screen {
        play(args, &maker, screen, &bar.progress, &mut report)?;
        drop(bar);
        return finish(report, &args.output);
    }
    let (mut took, mut sheet) = (Vec::new(), ContactSheet::new(SHEET));
    maker.make(args, &bar.progress, &mut |made| {
        made.encoded.frame.write(&frame_path(&args.output, made.number))?;
        if made.number == 0 {
            report.warn(made.lit.warnings.iter());
        }
        took.push(Took::of(&made));
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
    finish(report, &args.output)
}

/// The traced picture, and the reconstruction focused on the nearest object.
fn pictures(args: &ShowArgs, made: &Made, progress: &Progress) -> Result<Vec<Picture>> {
    let view = &made.lit.view;
    let (field, mut settings) = pipeline::simulated_light(&made.encoded.frame, &Simulation::default(), progress)?;
    settings.block_zero_order(args.zero_order_stop, field.wavelength);
    let z = args.sequence.focus.unwrap_or_else(|| view.focus.first().map_or(0.0, |(_, z)| *z));
    let size = (CELL, ((CELL * view.height) as f64 / view.width as f64).round().clamp(1.0, 4.0 * CELL as f64) as usize);
    let traced = luminance_picture(&made.lit);
    let cells = Grid::new(traced.width, traced.height, 1.0, 1.0)?;
    let half = 0.5 * DVec2::new(traced.width as f64, traced.height as f64);
    let traced = Picture::from_samples(&cells, &traced.values, half, size.0, size.1);
    let at = View::Plane { z };
    let seen = reconstruction::picture(&field, &at, view.placing.view_at(z), size, &settings, progress)?;
    Ok(vec![traced, seen])
}

fn report_frames(took: &[Took], rate: f64, report: &mut Report) {
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
    use holodrive::Error;
    use holodrive::display::{DisplayFrame, PlaySettings};
    use std::sync::mpsc::sync_channel;
    use std::sync::{Arc, Mutex};

    let signal = &maker.panel.profile.signal;
    let frames = maker.animation.times.len();
    let all = args.sequence.ahead == Ahead::All;
    // A loop keeps them, too.
    if all || args.sequence.repeat {
        state_memory(frames, (signal.width, signal.height))?;
    }
    let mut playing = PlaySettings {
        // The clip runs at its own speed, whatever the monitor's rate is.
        rate: Some(args.sequence.fps.unwrap_or(USUAL_RATE)),
        settle: maker.panel.profile.settle_time.unwrap_or(0.0),
        ..screen.play_settings()
    };
    let (took, warnings) = (Mutex::new(Vec::new()), Mutex::new(Vec::new()));
    let ready = |made: &Made| -> Result<Arc<DisplayFrame>> {
        made.encoded.frame.write(&frame_path(&args.output, made.number))?;
        if let Ok(mut took) = took.lock() {
            took.push(Took::of(made));
        }
        if let (0, Ok(mut warnings)) = (made.number, warnings.lock()) {
            warnings.clone_from(&made.lit.warnings);
        }
        Ok(Arc::new(DisplayFrame::packed(&[&made.encoded.frame])?))
    };
    let outcome = if all {
        let mut kept: Vec<Arc<DisplayFrame>> = Vec::new();
        maker.make(args, progress, &mut |made| {
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
                let made = maker.make(args, &making, &mut |made| Ok(sender.send(ready(&made)).is_ok()));
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
