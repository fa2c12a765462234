//! `show --live`: a hologram that follows its scene's file and the operator's keys, and the operator's view of it.

use super::args::{ShowArgs, White};
use super::bar::Bar;
use super::controls::{Changed, Choices, Controls, KEYS, TURN_STEP};
use super::encoding::encode_settings;
use super::load::{self, Panel, hologram_settings, scene_settings};
use super::report::{Report, count, seconds};
use super::screen::show_settings;
use super::show::finish;
use holodrive::display::{Display, DisplayFrame, Key, KeyPress, OperatorChoice, PanelLoop, ShowEnd, Turn};
use holodrive::live::{Board, Detail, Happened, PICTURE, Refined, Seen, Viewer, Watch, Wish, Worker, draw};
use holodrive::names::Named;
use holodrive::panel::Frame;
use holodrive::points::Placement;
use holodrive::units::show_length;
use holodrive::{Error, Result, files};
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Longest wait between two looks at what has happened.
const LONGEST_TURN: Duration = Duration::from_millis(5);
/// Time between two looks at the scene's files.
const WATCH: Duration = Duration::from_millis(200);
/// A show that follows its scene.
struct Live<'a> {
    args: &'a ShowArgs,
    panel: Panel,
    choices: Choices,
    controls: Controls,
    worker: Worker,
    viewer: Viewer,
    watch: Watch,
    shown: PanelLoop<'a>,
    newest: Option<Arc<Refined>>,
    seen: Option<Seen>,
    /// From the wish until the panel had it: of the newest hologram.
    presented: f64,
    warning: Option<String>,
    events: Option<std::fs::File>,
    begin: Instant,
    counts: Counts,
}

#[derive(Default)]
struct Counts {
    shown: [usize; 3],
    to_coarse: Vec<f64>,
    to_full: Vec<f64>,
    cancelled: Vec<f64>,
    failed: usize,
}

pub(super) fn show(args: &ShowArgs, path: &Path, mut report: Report) -> Result<Report> {
    let Some(mut settings) = show_settings(args)? else {
        return Err(Error::parameter("live", "needs the panel's monitor: --monitor (see `holodrive monitors`)"));
    };
    let place: OperatorChoice = args.operator.parse()?;
    let panel = load::panel(&args.panel, &mut report)?;
    let mut display = Display::connect()?;
    let monitors = display.monitors()?;
    let monitor = settings.monitor.find(&monitors)?;
    let home = place.find(&monitors, &monitor)?;
    if home.is_none() && place == OperatorChoice::Auto {
        report.warn(["there is no monitor beside the panel's: no operator's view"]);
    }
    // The panel is taken with all levels at zero, before anything is computed.
    let levels = vec![0; panel.profile.width * panel.profile.height];
    let idle = Frame::new(&panel.profile, panel.wavelength, levels)?;
    settings.window.take_keyboard = home.is_none();
    let idle = Arc::new(DisplayFrame::packed(&[&idle])?);
    let bar = Bar::new();
    let mut shown = PanelLoop::open(&mut display, &idle, &settings, &bar.progress)?;
    report.warn(shown.panel().warnings());
    if let Some(home) = home {
        shown.open_operator(&home, &Arc::new(picture(&Board { keys: &KEYS, ..Board::default() })?))?;
    }
    let (choices, controls) = (Choices::new(args, &panel), Controls::new());
    let wish = wish(args, &panel, &choices, &controls)?;
    let scene = scene_settings(&args.light, &args.placement, White::Auto);
    let at = (panel.profile.clone(), args.hologram.channel);
    let (worker, files) = Worker::start(path, scene, at, hologram_settings(&args.hologram), wish)?;
    files::output_folder(&args.output)?;
    let events = args.sequence.events.as_ref();
    let events = events.map(|path| std::fs::File::create(path).map_err(Error::io(path))).transpose()?;
    let [_, _, width, height] = PICTURE;
    let (rays, side) = (args.light.rays, width.min(height));
    let size = if rays.0 >= rays.1 {
        (side, (side * rays.1 / rays.0).max(1))
    } else {
        ((side * rays.0 / rays.1).max(1), side)
    };
    let mut live = Live {
        args,
        panel,
        choices,
        controls,
        worker,
        viewer: Viewer::start(size),
        watch: Watch::new(files),
        shown,
        newest: None,
        seen: None,
        presented: 0.0,
        warning: None,
        events,
        begin: Instant::now(),
        counts: Counts::default(),
    };
    live.shown.hold_from(live.begin, settings.hold);
    let end = live.run()?;
    live.report(&mut report);
    let Live { shown, worker, viewer, .. } = live;
    drop((worker, viewer));
    shown.close(end)?.end.as_asked()?;
    finish(report, &args.output)
}

fn picture(board: &Board) -> Result<DisplayFrame> {
    let canvas = draw(board);
    DisplayFrame::from_rgb(canvas.width as u32, canvas.height as u32, canvas.pixels)
}

/// What the flags and keys ask for.
fn wish(args: &ShowArgs, panel: &Panel, choices: &Choices, controls: &Controls) -> Result<Wish> {
    let wavelength = choices.wavelengths.get(controls.wavelength).copied().unwrap_or(panel.wavelength);
    let mut encoding = args.encoding.clone();
    encoding.encoding = choices.encodings.get(controls.encoding).cloned();
    let content = match scene_settings(&args.light, &args.placement, White::Auto).placement {
        Placement::Window { near, far, .. } => Some([near, far]),
        Placement::Model { z, .. } => Some([z, z]),
    };
    let at = Panel { profile: panel.profile.clone(), grid: panel.grid, wavelength, lasers: None };
    // Warnings of a profile were told at the beginning.
    let encode = encode_settings(&encoding, &at, content, &mut Report::default())?;
    let turn = controls.turn.map(|steps| f64::from(steps) * TURN_STEP);
    Ok(Wish { turn, shift: controls.shifted(), wavelength, encode })
}

impl Live<'_> {
    fn run(&mut self) -> Result<ShowEnd> {
        let mut looked = Instant::now();
        loop {
            match self.shown.turn(LONGEST_TURN)? {
                Turn::Ended(end) => return Ok(end),
                Turn::OperatorClosed => {
                    self.warn("the operator's view came onto the panel's monitor again and again; it was closed");
                }
                Turn::Shown | Turn::Returned | Turn::Absent { .. } => {}
            }
            let keys = self.shown.keys();
            self.keys(&keys)?;
            if looked.elapsed() >= WATCH {
                looked = Instant::now();
                if self.watch.changed() {
                    self.wish(true)?;
                }
            }
            while let Some(happened) = self.worker.poll()? {
                self.happened(happened)?;
            }
            self.look()?;
        }
    }

    /// Depth of the nearest object of the newest hologram.
    fn near(&self) -> f64 {
        let focus = self.newest.as_ref().and_then(|newest| newest.lit.view.focus.first());
        focus.map_or(self.args.placement.near, |(_, z)| *z)
    }

    fn keys(&mut self, keys: &[KeyPress]) -> Result<()> {
        let before = self.controls.clone();
        let (mut hologram, mut look) = (false, false);
        for press in keys {
            match self.controls.press(*press, &self.choices, self.near()) {
                Changed::Nothing => {}
                Changed::Hologram => (hologram, look) = (true, look || press.key == Key::Letter('r')),
                Changed::Look => look = true,
            }
        }
        if hologram && self.wish(false)?.is_none() {
            // What cannot be is not set.
            self.controls = before;
        }
        if look {
            self.ask();
            self.redraw()?;
        }
        Ok(())
    }

    /// Wishes for what the keys have set; none where that cannot be.
    fn wish(&mut self, reload: bool) -> Result<Option<u64>> {
        match wish(self.args, &self.panel, &self.choices, &self.controls) {
            Ok(wish) => {
                let version = self.worker.wish(wish, reload);
                self.event(&json!({ "event": "wish", "version": version, "reload": reload }));
                Ok(Some(version))
            }
            Err(error) => {
                self.warn(&error.to_string());
                self.redraw()?;
                Ok(None)
            }
        }
    }

    fn ask(&mut self) {
        if let Some(newest) = &self.newest {
            self.viewer.ask(newest, self.controls.look_at(self.near(), self.args.zero_order_stop));
        }
    }

    fn happened(&mut self, happened: Happened) -> Result<()> {
        match happened {
            Happened::Refined(refined) => self.present(Arc::new(*refined))?,
            Happened::Loaded(files) => {
                self.watch = Watch::new(files);
                self.warning = None;
                self.event(&json!({ "event": "loaded" }));
            }
            Happened::Failed(why) => {
                self.counts.failed += 1;
                self.event(&json!({ "event": "failed", "what": why }));
                self.warn(&why);
                self.redraw()?;
            }
            Happened::Cancelled(after) => {
                self.counts.cancelled.push(after);
                self.event(&json!({ "event": "cancelled", "after": after }));
            }
        }
        Ok(())
    }

    fn present(&mut self, refined: Arc<Refined>) -> Result<()> {
        let ready = Instant::now();
        self.shown.panel_mut().present(&Arc::new(DisplayFrame::packed(&[&refined.frame])?))?;
        self.presented = refined.seconds + ready.elapsed().as_secs_f64();
        self.counts.shown[refined.detail as usize] += 1;
        match refined.detail {
            Detail::Coarse => self.counts.to_coarse.push(self.presented),
            Detail::Middle => {}
            Detail::Full => {
                self.counts.to_full.push(self.presented);
                refined.frame.write(&self.args.output.join("frame.png"))?;
            }
        }
        let (wavelength, encoding) = (refined.frame.metadata.wavelength, self.encoding(&refined));
        self.event(&json!({
            "event": "shown", "version": refined.version, "detail": refined.detail,
            "points": refined.lit.placed.cloud.points.len(), "since_wish": self.presented,
            "light_seconds": refined.light_seconds, "field_seconds": refined.field.seconds,
            "encode_seconds": refined.encode_seconds, "wavelength": wavelength, "encoding": encoding,
            "turn": self.controls.turn.map(|steps| f64::from(steps) * TURN_STEP),
            "shift": self.controls.shifted().to_array(),
        }));
        self.newest = Some(refined);
        self.ask();
        self.redraw()
    }

    fn encoding(&self, refined: &Refined) -> String {
        refined.frame.metadata.encoding.as_ref().map(|encoding| encoding.method.clone()).unwrap_or_default()
    }

    /// Shows the operator what has been reconstructed.
    fn look(&mut self) -> Result<()> {
        let mut new = None;
        while let Some(seen) = self.viewer.poll()? {
            new = Some(seen);
        }
        let Some(seen) = new else { return Ok(()) };
        let told = json!({
            "event": "seen", "version": seen.version, "detail": seen.detail, "focus": seen.look.focus,
            "eye": seen.look.eye, "pupil": seen.look.pupil, "seconds": seen.seconds,
            "size": [seen.picture.width, seen.picture.height],
        });
        self.seen = Some(seen);
        self.redraw()?;
        self.event(&told);
        Ok(())
    }

    fn redraw(&mut self) -> Result<()> {
        if self.shown.operator().is_none() {
            return Ok(());
        }
        let lines = self.lines();
        let board = Board {
            seen: self.seen.as_ref().map(|seen| &seen.picture),
            frame: self.newest.as_ref().map(|newest| &newest.frame),
            lines,
            keys: &KEYS,
            warning: self.warning.as_deref(),
        };
        let picture = Arc::new(picture(&board)?);
        self.shown.operator().map_or(Ok(()), |operator| operator.present(&picture))
    }

    fn lines(&self) -> Vec<(String, String)> {
        let mut lines: Vec<(&str, String)> = Vec::new();
        let degrees = self.controls.turn.map(|steps| 5 * steps);
        let [x, y, z] = (1e3 * self.controls.shifted()).to_array();
        if let Some(newest) = &self.newest {
            let points = count(newest.lit.placed.cloud.points.len()).replace('\u{202f}', " ");
            lines.push(("hologram", format!("{} {}, {points} points", newest.version, newest.detail.name())));
            lines.push(("light", seconds(newest.light_seconds)));
            lines.push(("field", format!("{}, {}", seconds(newest.field.seconds), newest.field.method.name())));
            lines.push(("encoding", format!("{}, {}", seconds(newest.encode_seconds), self.encoding(newest))));
            lines.push(("on panel", format!("{} after the change", seconds(self.presented))));
            lines.push(("laser", show_length(newest.frame.metadata.wavelength)));
        }
        if let Some(seen) = &self.seen {
            let look = &seen.look;
            let side = if look.focus < 0.0 { "behind" } else { "before" };
            lines.push(("focus", format!("{:.1} mm {side} the panel", 1e3 * look.focus.abs())));
            lines.push(match look.eye {
                None => ("seen", "on the plane in focus".into()),
                Some([x, y]) => {
                    ("eye", format!("{:+.1}, {:+.1} mm, pupil {:.0} mm", 1e3 * x, 1e3 * y, 1e3 * look.pupil))
                }
            });
            lines.push((
                "picture",
                format!("{}, hologram {} {}", seconds(seen.seconds), seen.version, seen.detail.name()),
            ));
        }
        lines.push(("turned", format!("{:+}, {:+} degrees", degrees[0], degrees[1])));
        lines.push(("shifted", format!("{x:+.1}, {y:+.1}, {z:+.0} mm")));
        lines.push(("panel", format!("{} on {}", self.panel.profile.name, self.shown.panel().monitor().name)));
        lines.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    /// One line for the operator.
    fn warn(&mut self, what: &str) {
        eprintln!("warning: {what}");
        self.warning = Some(what.to_owned());
    }

    fn event(&mut self, event: &Value) {
        let Some(file) = &mut self.events else { return };
        let mut event = event.clone();
        event["at"] = self.begin.elapsed().as_secs_f64().into();
        if writeln!(file, "{event}").is_err() {
            // Whoever listened has gone; the show goes on.
            self.events = None;
        }
    }

    fn report(&self, report: &mut Report) {
        let median = |values: &[f64]| {
            let mut sorted = values.to_vec();
            sorted.sort_by(f64::total_cmp);
            sorted.get(sorted.len() / 2).copied()
        };
        let longest = self.counts.cancelled.iter().copied().fold(0.0, f64::max);
        report.add_serialised(
            "display",
            &json!({ "monitor": self.shown.panel().monitor(), "frames": self.shown.panel().frames() }),
            "",
        );
        report.add("shown", self.counts.shown.to_vec(), "");
        report.add("to_coarse", median(&self.counts.to_coarse), "");
        report.add("to_full", median(&self.counts.to_full), "");
        report.add("cancelled", self.counts.cancelled.len(), "");
        report.add("longest_cancel", longest, "");
        let line = format!(
            "live on {}: {} changes; a coarse hologram after {}, a full one after {} (medians); {} computations stopped, at most {} after",
            self.shown.panel().monitor().name,
            self.counts.to_coarse.len(),
            median(&self.counts.to_coarse).map_or("-".into(), seconds),
            median(&self.counts.to_full).map_or("-".into(), seconds),
            self.counts.cancelled.len(),
            seconds(longest),
        );
        report.add("failed", self.counts.failed, line);
    }
}
