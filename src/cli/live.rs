//! `show --live`: a hologram that follows its scene's file and the operator's keys, and the operator's view of it.

use super::args::ShowArgs;
use super::bar::Bar;
use super::controls::{Changed, Choices, Controls, KEYS, TURN_STEP};
use super::load::{self, Input};
use super::panel_command::Ready;
use super::report::{Report, count, seconds};
use super::resolve;
use super::screen::show_settings;
use super::tracker::Tracker;
use crate::display::{Display, DisplayFrame, Key, KeyPress, OperatorChoice, PanelLoop, ShowEnd, Turn};
use crate::encode::Encoding;
use crate::live::{
    Board, Detail, LiveHologram, OperatorPicture, PICTURE, Request, Viewer, Watch, Worker, WorkerEvent, draw,
};
use crate::names::Named;
use crate::panel::{Frame, Setup};
use crate::points::Placement;
use crate::units::show_length;
use crate::{Error, Result, files};
use glam::DVec3;
use serde_json::{Value, json};
use std::io::Write;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Longest wait between two looks at what has happened.
const LONGEST_TURN: Duration = Duration::from_millis(5);
/// Time between two looks at the scene's files.
const WATCH: Duration = Duration::from_millis(200);
/// A show that follows its scene.
struct Live<'a> {
    args: &'a ShowArgs,
    setup: Setup,
    choices: Choices,
    controls: Controls,
    worker: Worker,
    viewer: Viewer,
    watch: Watch,
    shown: PanelLoop<'a>,
    newest: Option<Arc<LiveHologram>>,
    seen: Option<OperatorPicture>,
    /// Where the eye is, but for the keys [m].
    eye: DVec3,
    tracker: Option<Tracker>,
    /// From the request until the panel had it: of the newest hologram.
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

pub(super) fn show(args: &ShowArgs, mut report: Report) -> Result<Report> {
    let in_time = &args.sequence;
    let played = in_time.fps.is_some() || in_time.repeat || in_time.from.is_some() || in_time.to.is_some();
    if played || !args.more.is_empty() {
        return Err(Error::parameter("live", "shows a scene at one --time; leave --fps, --loop, --from and --to out"));
    }
    if args.color.wavelengths.is_some() || args.subframes != 1 {
        return Err(Error::parameter("live", "shows one frame of one laser; leave --wavelengths and --subframes out"));
    }
    let Input::Scene(path) = load::input(&args.input)? else {
        return Err(Error::input(&args.input, "is no scene (.gltf, .glb); --live follows a scene"));
    };
    let Some(mut settings) = show_settings(args)? else {
        return Err(Error::parameter("live", "needs the panel's monitor: --monitor (see `holodrive monitors`)"));
    };
    let place: OperatorChoice = args.operator.parse()?;
    let setup = resolve::setup(&args.panel, &mut report)?;
    let usual = Encoding::usual(setup.profile.modulation());
    let (setup, steps) = resolve::settings(args, setup, usual)?;
    resolve::check_in_time(&steps, &setup)?;
    let mut display = Display::connect()?;
    let monitors = display.monitors()?;
    let monitor = settings.monitor.find(&monitors)?;
    let home = place.find(&monitors, &monitor)?;
    if home.is_none() && place == OperatorChoice::Auto {
        report.warn(["there is no monitor beside the panel's: no operator's view"]);
    }
    let _ready = Ready::make(&args.panel, &setup)?;
    // The panel is taken with all levels at zero, before anything is computed.
    let idle = Frame::new(&setup.profile, setup.wavelength, vec![0; setup.grid.len()])?;
    settings.window.take_keyboard = home.is_none();
    let idle = Arc::new(DisplayFrame::packed(&[&idle])?);
    let bar = Bar::new();
    let mut shown = PanelLoop::open(&mut display, &idle, &settings, &bar.progress)?;
    report.warn(shown.panel().warnings());
    if let Some(home) = home {
        shown.open_operator(&home, &Arc::new(picture(&Board { keys: &KEYS, ..Board::default() })?))?;
    }
    let (choices, controls) = (Choices::new(args, &setup), Controls::new());
    let mut tracker = args.eye_from.as_deref().map(Tracker::new);
    let mut eye = steps.viewer.eye;
    if let Some(tracker) = &mut tracker {
        eye = tracker.look()?.ok_or_else(|| Error::parameter("eye-from", "says nothing: X,Y,Z"))?;
    }
    let first = request(args, &setup, &choices, &controls, eye)?;
    let viewer_bench = steps.bench.clone();
    let (worker, files) = Worker::start(&path, setup.clone(), steps, first)?;
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
        setup,
        choices,
        controls,
        eye,
        tracker,
        worker,
        viewer: Viewer::start(size, viewer_bench),
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
    report.written_to(&args.output)
}

fn picture(board: &Board) -> Result<DisplayFrame> {
    let canvas = draw(board);
    DisplayFrame::from_rgb(canvas.width as u32, canvas.height as u32, canvas.pixels)
}

/// What the flags and keys ask for.
fn request(args: &ShowArgs, setup: &Setup, choices: &Choices, controls: &Controls, eye: DVec3) -> Result<Request> {
    let wavelength = choices.wavelengths.get(controls.wavelength).copied().unwrap_or(setup.wavelength);
    let mut flags = args.encoding.clone();
    flags.encoding = choices.encodings.get(controls.encoding).cloned();
    let content = match resolve::placement(&args.placement) {
        Placement::Window { near, far, .. } => [near, far],
        Placement::Model { z, .. } => [z, z],
    };
    let mut encode = resolve::encode(&flags, Encoding::usual(setup.profile.modulation()))?;
    encode.fix_depths(content);
    // What cannot be is not asked for; warnings of a profile were told at the beginning.
    let eye = eye + controls.eye_aside();
    if let Some(Encoding::View(_)) = encode.encoding {
        resolve::check_viewer(&crate::light_field::Viewer::at(eye), setup)?;
    } else {
        encode.settings(setup, wavelength, Some(content))?;
    }
    let turn = controls.turn.map(|steps| f64::from(steps) * TURN_STEP);
    Ok(Request { turn, shift: controls.shifted(), wavelength, eye, encode })
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
                    self.request(true)?;
                }
            }
            self.follow()?;
            while let Some(event) = self.worker.poll()? {
                self.heard(event)?;
            }
            self.look()?;
        }
    }

    /// Goes where the eye has gone.
    fn follow(&mut self) -> Result<()> {
        match self.tracker.as_mut().map_or(Ok(None), Tracker::look) {
            Ok(Some(eye)) if eye != self.eye => {
                let before = std::mem::replace(&mut self.eye, eye);
                if self.request(false)?.is_none() {
                    self.eye = before;
                }
            }
            Ok(_) => {}
            Err(error) => self.warn(&error.to_string()),
        }
        Ok(())
    }

    /// Whether frames are made for the eye.
    fn is_view(&self) -> bool {
        matches!(self.choices.encodings.get(self.controls.encoding), Some(Encoding::View(_)))
    }

    /// Depth of the nearest object of the newest hologram.
    fn near(&self) -> f64 {
        let focus = self.newest.as_ref().and_then(|newest| newest.points.view.focus.first());
        focus.map_or(self.args.placement.near(), |(_, z)| *z)
    }

    fn keys(&mut self, keys: &[KeyPress]) -> Result<()> {
        let before = self.controls.clone();
        let (mut hologram, mut look) = (false, false);
        for press in keys {
            match self.controls.press(*press, &self.choices, self.near()) {
                Changed::Nothing => {}
                Changed::Hologram => (hologram, look) = (true, look || press.key == Key::Letter('r')),
                // A hologram that is made for the eye goes with it.
                Changed::Look => {
                    (hologram, look) = (
                        hologram || (self.is_view() && matches!(press.key, Key::Letter('i' | 'j' | 'k' | 'l' | 'p'))),
                        true,
                    )
                }
            }
        }
        if hologram && self.request(false)?.is_none() {
            // What cannot be is not set.
            self.controls = before;
        }
        if look {
            self.ask();
            self.redraw()?;
        }
        Ok(())
    }

    /// Requests what the keys have set; none where that cannot be.
    fn request(&mut self, reload: bool) -> Result<Option<u64>> {
        match request(self.args, &self.setup, &self.choices, &self.controls, self.eye) {
            Ok(request) => {
                let version = self.worker.request(request, reload);
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
            let mut look = self.controls.look_at(self.near());
            if self.tracker.is_some() && self.is_view() {
                let eye = self.eye - newest.points.view.placing.eye + self.controls.eye_aside();
                look.eye = Some([eye.x, eye.y]);
            }
            self.viewer.ask(newest, look);
        }
    }

    fn heard(&mut self, event: WorkerEvent) -> Result<()> {
        match event {
            WorkerEvent::Ready(hologram) => self.present(Arc::new(*hologram))?,
            WorkerEvent::Loaded(files) => {
                self.watch = Watch::new(files);
                self.warning = None;
                self.event(&json!({ "event": "loaded" }));
            }
            WorkerEvent::Failed(why) => {
                self.counts.failed += 1;
                self.event(&json!({ "event": "failed", "what": why }));
                self.warn(&why);
                self.redraw()?;
            }
            WorkerEvent::Cancelled(after) => {
                self.counts.cancelled.push(after);
                self.event(&json!({ "event": "cancelled", "after": after }));
            }
        }
        Ok(())
    }

    fn present(&mut self, hologram: Arc<LiveHologram>) -> Result<()> {
        let ready = Instant::now();
        self.shown.panel_mut().present(&Arc::new(DisplayFrame::packed(&[&hologram.frame])?))?;
        self.presented = hologram.seconds + ready.elapsed().as_secs_f64();
        self.counts.shown[hologram.detail as usize] += 1;
        match hologram.detail {
            Detail::Coarse => self.counts.to_coarse.push(self.presented),
            Detail::Middle => {}
            Detail::Full => {
                self.counts.to_full.push(self.presented);
                hologram.frame.write(&self.args.output.join("frame.png"))?;
            }
        }
        let (wavelength, encoding) = (hologram.frame.metadata.wavelength, self.encoding(&hologram));
        self.event(&json!({
            "event": "shown", "version": hologram.version, "detail": hologram.detail,
            "points": hologram.points.placed.cloud.points.len(), "since_wish": self.presented,
            "light_seconds": hologram.light_seconds, "field_seconds": hologram.field.as_ref().map(|field| field.seconds),
            "encode_seconds": hologram.encode_seconds, "wavelength": wavelength, "encoding": encoding,
            "turn": self.controls.turn.map(|steps| f64::from(steps) * TURN_STEP),
            "shift": self.controls.shifted().to_array(), "eye": (self.eye + self.controls.eye_aside()).to_array(),
        }));
        self.newest = Some(hologram);
        self.ask();
        self.redraw()
    }

    fn encoding(&self, hologram: &LiveHologram) -> String {
        hologram.frame.metadata.encoding.as_ref().map(|encoding| encoding.method.clone()).unwrap_or_default()
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
            let points = count(newest.points.placed.cloud.points.len()).replace('\u{202f}', " ");
            lines.push(("hologram", format!("{} {}, {points} points", newest.version, newest.detail.name())));
            lines.push(("light", seconds(newest.light_seconds)));
            if let Some(field) = &newest.field {
                lines.push(("field", format!("{}, {}", seconds(field.seconds), field.method.name())));
            }
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
        lines.push(("panel", format!("{} on {}", self.setup.profile.name, self.shown.panel().monitor().name)));
        lines.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
    }

    /// One line for the operator.
    fn warn(&mut self, what: &str) {
        eprintln!("warning: {}", super::refusal::one_line(what));
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
