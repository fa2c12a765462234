//! `show` of frames in time: which input is one, and prepared frames on a monitor or on the simulated panel.

#[cfg(feature = "display")]
use super::args::Ahead;
use super::args::ShowArgs;
use super::bar::Bar;
use super::report::{Report, count, seconds};
use super::resolve;
#[cfg(feature = "display")]
use crate::display::{DisplayFrame, PlaySettings};
use crate::field::npy_stack::LevelStack;
use crate::light_field::LightField;
use crate::panel::{Frame, PanelProfile};
use crate::pipeline::{self, Bench};
use crate::progress::Progress;
use crate::reconstruction::{self, Picture, View};
use crate::scene::gltf;
use crate::sequence::prepared::pictures_in;
use crate::sequence::{ContactSheet, Prepared, Shown, Source};
use crate::{Error, Result, files};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Most frames on a contact sheet.
pub(super) const SHEET: usize = 24;
/// Columns of a picture on it.
pub(super) const CELL: usize = 240;

/// Frames in time, as the input says.
#[derive(Clone, Debug)]
pub(super) enum Sequence {
    Prepared(Source),
    Animated(PathBuf),
}

/// The sequence that the input is, if it is one.
pub(super) fn asked(args: &ShowArgs) -> Result<Option<Sequence>> {
    let (input, wanted) = (&args.input, &args.sequence);
    let standard = input.as_os_str() == "-";
    let prepared = |source| Ok(Some(Sequence::Prepared(source)));
    let extension = input.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    if !args.more.is_empty() && (standard || wanted.raw.is_some()) {
        return Err(Error::parameter("raw", "takes one input; leave the further ones out"));
    }
    if let Some((width, height)) = wanted.raw {
        let format = wanted.raw_format;
        return prepared(Source::Raw { path: (!standard).then(|| input.clone()), width, height, format });
    }
    if standard {
        return Err(Error::parameter(
            "input",
            "- is raw video on standard input; say the size of its frames by --raw WxH",
        ));
    }
    if !args.more.is_empty() {
        let all: Vec<PathBuf> = std::iter::once(input).chain(&args.more).cloned().collect();
        let picture = |path: &Path| {
            path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png") || e.eq_ignore_ascii_case("bmp"))
        };
        if let Some(other) = all.iter().find(|path| !picture(path)) {
            return Err(Error::input(other, "several inputs are frames, and those are .png or .bmp"));
        }
        return prepared(Source::Pictures(all));
    }
    if input.is_dir() && !LightField::is_folder(input) {
        return prepared(Source::Pictures(pictures_in(input)?));
    }
    if extension == "npy" && LevelStack::open(input)?.is_some() {
        return prepared(Source::Array(input.clone()));
    }
    let in_time = wanted.fps.is_some() || wanted.repeat || wanted.from.is_some() || wanted.to.is_some();
    match extension.as_str() {
        _ if !in_time && wanted.events.is_none() => Ok(None),
        _ if gltf::is_scene(input) => Ok(Some(Sequence::Animated(input.clone()))),
        "png" | "bmp" if !input.to_string_lossy().contains(['+', '@']) => {
            prepared(Source::Pictures(vec![input.clone()]))
        }
        _ => Err(Error::parameter(
            "fps",
            "--fps, --loop, --from, --to and --events are for frames in time; this input has one",
        )),
    }
}

/// Opens a prepared sequence as often as it is played.
#[derive(Clone)]
struct Opener {
    source: Source,
    profile: PanelProfile,
    named: bool,
    wavelength: Option<f64>,
    /// Ends the wait for raw video.
    stop: Arc<Progress>,
}

impl Opener {
    fn open(&self) -> Result<Prepared> {
        Prepared::open(self.source.clone(), &self.profile, self.named, self.wavelength, &self.stop)
    }
}

/// Refuses what is for one frame.
pub(super) fn check(args: &ShowArgs) -> Result<()> {
    let refused =
        |flag, what| Err(Error::parameter(flag, format!("{what} for one frame; leave them out with frames in time")));
    match (args.color.wavelengths, args.subframes) {
        (Some(_), _) => refused("wavelengths", "three lasers are"),
        (None, 1) => Ok(()),
        _ => refused("subframes", "are"),
    }
}

/// Plays prepared frames, or looks at each on the simulated panel.
pub(super) fn prepared(args: &ShowArgs, source: &Source, mut report: Report) -> Result<Report> {
    check(args)?;
    if args.sequence.repeat && matches!(source, Source::Raw { path: None, .. }) {
        return Err(Error::parameter(
            "loop",
            "standard input cannot be played again; write it to a file and name that",
        ));
    }
    let named = args.panel.panel != "generic";
    let setup = resolve::setup(&args.panel, &mut report)?;
    let bar = Bar::new();
    // On a monitor the play stops the reading at its end; otherwise only Ctrl-C does.
    let stop = if args.monitor.is_some() { Arc::default() } else { Arc::clone(&bar.progress) };
    let profile = setup.profile.clone();
    let opener = Opener { source: source.clone(), profile, named, wavelength: args.panel.wavelength, stop };
    let frames = opener.open()?;
    let notes = frames.notes();
    #[cfg(feature = "display")]
    if let Some(screen) = super::screen::Screen::asked(args, &setup)? {
        files::output_folder(&args.output)?;
        let again = args.sequence.repeat.then(|| opener.clone());
        let played = Repeated { frames, again, shown: false };
        let playing = PlaySettings {
            rate: args.sequence.fps,
            settle: setup.profile.settle_time.unwrap_or(0.0),
            making: Some(Arc::clone(&opener.stop)),
            ..screen.play_settings()
        };
        let outcome = if args.sequence.ahead == Ahead::All {
            // What was opened to be played as it comes is read here.
            all_ahead(played.frames, &opener, &bar.progress).and_then(|all| {
                let rounds = if args.sequence.repeat { usize::MAX } else { 1 };
                let frames = (0..rounds).flat_map(|_| all.iter().cloned().map(Ok));
                screen.sequence(frames, &playing, &bar.progress, &mut report)
            })
        } else {
            screen.sequence(played, &playing, &bar.progress, &mut report)
        };
        drop(bar);
        report.warn(notes.lock().map(|notes| notes.clone()).unwrap_or_default());
        outcome?;
        return report.written_to(&args.output);
    }
    let begin = Instant::now();
    files::output_folder(&args.output)?;
    let mut sheet = ContactSheet::new(SHEET);
    bar.progress.start("frames", 0);
    let mut number = 0;
    for shown in frames {
        bar.progress.check()?;
        simulate(args, number, shown?, &mut sheet, &bar.progress, &mut report)?;
        number += 1;
    }
    drop(bar);
    report.warn(notes.lock().map(|notes| notes.clone()).unwrap_or_default());
    if number == 0 {
        return Err(Error::input(&args.input, "has no frame"));
    }
    sheet.write(&args.output.join("contact.png"))?;
    let elapsed = begin.elapsed().as_secs_f64();
    report.add("frames", number, "");
    report.add("contact_sheet", sheet.numbers(), "");
    let line = format!(
        "frames       {:>8}  {} on the simulated panel; contact.png shows them",
        seconds(elapsed),
        count(number)
    );
    report.add("seconds", elapsed, line);
    report.written_to(&args.output)
}

/// Where frame `number` is written.
pub(super) fn frame_path(output: &Path, number: usize) -> PathBuf {
    output.join(format!("frames/frame-{number:05}.png"))
}

/// Writes the frame, and puts its picture on the sheet.
fn simulate(
    args: &ShowArgs,
    number: usize,
    shown: Shown,
    sheet: &mut ContactSheet,
    progress: &Progress,
    report: &mut Report,
) -> Result<()> {
    if number == 0 {
        files::output_folder(&args.output.join("frames"))?;
    }
    let path = frame_path(&args.output, number);
    let levels = shown.clone().levels()?;
    match levels.as_slice() {
        [one] => one.write(&path)?,
        _ => shown.signal()?.write(&path)?,
    }
    if !sheet.wants(number) {
        return Ok(());
    }
    if let (Some(frame), Some(z)) = (levels.first(), args.sequence.focus) {
        report.check_side("focus", z, frame.metadata.origin.depth);
    }
    let pictures: Vec<Picture> = levels.iter().map(|frame| look(args, frame, progress)).collect::<Result<_>>()?;
    sheet.add(number, format!("#{number}"), Picture::mean(&pictures).into_iter().collect())
}

fn look(args: &ShowArgs, frame: &Frame, progress: &Progress) -> Result<Picture> {
    let content = frame.metadata.origin.depth;
    let bench = Bench { zero_order_stop: args.zero_order_stop, ..Bench::default() };
    let light = pipeline::light(frame, &bench, &progress.part())?;
    let z = args.sequence.focus.unwrap_or_else(|| content.map_or(0.0, |[near, far]| 0.5 * (near + far)));
    let view = View::Plane { z };
    let half = view.seen_half(&light.field.grid, None);
    let size = (CELL, ((CELL as f64 * half.y / half.x).round() as usize).clamp(1, 4 * CELL));
    reconstruction::picture(&light.field, &view, half, size, &light.settings, &progress.part())
}

/// Frames of a sequence for the monitor, again and again where that is asked.
#[cfg(feature = "display")]
struct Repeated {
    frames: Prepared,
    again: Option<Opener>,
    shown: bool,
}

#[cfg(feature = "display")]
impl Iterator for Repeated {
    type Item = Result<DisplayFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(shown) = self.frames.next() {
                self.shown = true;
                return Some(shown.and_then(for_display));
            }
            // A sequence without any frame does not begin again.
            match &self.again {
                Some(opener) if self.shown => match opener.open() {
                    Ok(frames) => self.frames = frames,
                    Err(error) => return Some(Err(error)),
                },
                _ => return None,
            }
        }
    }
}

/// Most memory that frames ahead may take [bytes].
#[cfg(feature = "display")]
pub(super) const AHEAD_MEMORY: u64 = 8 << 30;

/// Refuses frames ahead that do not fit, and says what those that do will take.
#[cfg(feature = "display")]
pub(super) fn state_memory(frames: usize, (width, height): (usize, usize)) -> Result<()> {
    let needed = 3 * frames as u64 * width as u64 * height as u64;
    if needed > AHEAD_MEMORY {
        let (needed, budget) = (needed >> 20, AHEAD_MEMORY >> 20);
        let hint = "play them as they are made (--ahead 4), or fewer of them (--to, --fps)".into();
        return Err(Error::Memory { what: "frames ahead", needed, budget, hint });
    }
    eprintln!("{} frames ahead take {} MB of memory", count(frames), (needed + (1 << 19)) >> 20);
    Ok(())
}

/// All frames of the sequence in memory.
#[cfg(feature = "display")]
fn all_ahead(frames: Prepared, opener: &Opener, progress: &Progress) -> Result<Vec<Arc<DisplayFrame>>> {
    progress.start("frames", 0);
    let mut all = Vec::new();
    let expected = match &opener.source {
        Source::Pictures(paths) => Some(paths.len()),
        Source::Array(path) => LevelStack::open(path)?.map(|stack| stack.frames),
        Source::Raw { .. } => None,
    };
    let signal = &opener.profile.signal;
    let size = (signal.width, signal.height);
    if let Some(expected) = expected {
        state_memory(expected.div_ceil(signal.packing.frames()), size)?;
    }
    for shown in frames {
        progress.check()?;
        all.push(Arc::new(for_display(shown?)?));
        if 3 * (all.len() * size.0 * size.1) as u64 > AHEAD_MEMORY {
            state_memory(all.len(), size)?;
        }
    }
    if expected.is_none() {
        state_memory(all.len(), size)?;
    }
    Ok(all)
}

#[cfg(feature = "display")]
fn for_display(shown: Shown) -> Result<DisplayFrame> {
    DisplayFrame::from_video(shown.signal()?)
}
