//! Frames in time: a sequence played in order, each frame once, with its times.

use super::frame::DisplayFrame;
use super::monitor::{Monitor, MonitorChoice};
use super::presenter::Presenter;
use super::session::Display;
use super::show::{OnAbsence, ShowEnd};
use super::window::{PanelWindow, Standing, WindowSettings};
use crate::error::{Error, Result};
use crate::progress::Progress;
use serde::Serialize;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, sync_channel};
use std::time::{Duration, Instant};

/// Longest wait between two looks at the window's events and the stop flag.
const TURN: Duration = Duration::from_millis(5);
/// Assumed of a monitor that does not tell its refresh rate [Hz].
const USUAL_REFRESH: f64 = 60.0;

/// Frames of which the time that their presentation took is kept: the last ones of a long play.
const MOST_TIMES: usize = 65_536;

/// Rates that make sense [Hz]; their periods are durations that can be waited for.
const RATES: std::ops::RangeInclusive<f64> = 1e-3..=1e4;

/// How a sequence is played.
#[derive(Clone, Debug)]
pub struct PlaySettings {
    /// The monitor to show it on.
    pub monitor: MonitorChoice,
    /// How the window is made.
    pub window: WindowSettings,
    /// Frames per second [Hz]; none: one at each refresh of the monitor.
    pub rate: Option<f64>,
    /// How long the last frame stays; none: until a key, the window's closing or the stop flag ends it.
    pub hold: Option<Duration>,
    /// How many frames are made ahead of the one on the panel.
    pub ahead: usize,
    /// What to do when the monitor goes away.
    pub on_absence: OnAbsence,
    /// From a frame's being presented until the modulator has settled on it [s].
    pub settle: f64,
    /// The progress of whatever makes the frames: it is stopped when the play ends.
    pub making: Option<Arc<Progress>>,
}

/// When one frame was due and came. Times are from the first frame [s], on a monotonic clock.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FrameTime {
    /// Running number, from 0.
    pub number: u64,
    /// When it should have been handed over: up to half a refresh before or after, at the nearest vertical blank.
    pub due: f64,
    /// When it had been made; before the first was shown this is below zero.
    pub ready: f64,
    /// When the window system had taken it.
    pub presented: f64,
    /// When the modulator had settled on it; none where another frame came before.
    pub settled: Option<f64>,
    /// Refreshes of the monitor by which it was handed over late.
    pub missed: u64,
    /// Whether it was late because it had not been made in time.
    pub starved: bool,
    /// False when the window system would not take it: it was not on the panel.
    pub taken: bool,
    /// The monitor's count of vertical blanks just before it was handed over, where the X server tells.
    pub vertical_blank: Option<u64>,
}

/// What was played, where and how well.
#[derive(Clone, Debug, Serialize)]
pub struct PlayReport {
    /// The monitor.
    pub monitor: Monitor,
    /// Who put the frames into the window.
    pub presenter: Presenter,
    /// The graphics adapter, if one was at work.
    pub adapter: Option<String>,
    /// Frames handed to the window system.
    pub frames: u64,
    /// Refreshes of the monitor that showed an old frame because the next one was late.
    pub missed: u64,
    /// Frames that had not been made when they were due.
    pub starved: u64,
    /// Frames that the window system would not take.
    pub refused: u64,
    /// Frames that were replaced before the modulator had settled on them.
    pub unsettled: u64,
    /// From a frame's being handed over until the window system had taken it, of the last 65,536: the median, and the
    /// longest [s].
    pub presenting: [f64; 2],
    /// Mean time between frames [s].
    pub mean_interval: f64,
    /// Longest time between frames [s].
    pub longest_interval: f64,
    /// From the call until the window system had taken the first frame [s].
    pub first_presented: f64,
    /// How often another window had come above and was covered again.
    pub covered: u64,
    /// Why it ended.
    pub end: ShowEnd,
    /// What alters levels on this monitor, where that was allowed.
    pub warnings: Vec<String>,
}

/// Plays `frames` in order, each of them once, none left out: a late frame delays those after it.
///
/// Frames are made on another thread, up to [`PlaySettings::ahead`] in advance. With the graphics presenter each waits for
/// the vertical blank by itself; with the software presenter on X11 it is handed over just after one. `told` is called
/// with each frame's times, in their order, as soon as the modulator has settled on it, or when another frame comes before.
///
/// # Errors
///
/// Those of [`PanelWindow::open`]; the first error among `frames`; [`Error::Parameter`] for an empty sequence or a
/// rate outside 0.001 to 10,000 Hz; [`Error::Interrupted`] when it was stopped before the first frame.
pub fn play<F: Into<Arc<DisplayFrame>>>(
    display: &mut Display,
    frames: impl Iterator<Item = Result<F>> + Send,
    settings: &PlaySettings,
    told: &mut dyn FnMut(&FrameTime),
    progress: &Progress,
) -> Result<PlayReport> {
    if let Some(rate) = settings.rate.filter(|rate| !RATES.contains(rate)) {
        let (least, most) = (RATES.start(), RATES.end());
        return Err(Error::parameter("fps", format!("{rate} frames per second; give {least} to {most}")));
    }
    if !(settings.settle.is_finite() && settings.settle >= 0.0) {
        return Err(Error::parameter("settle", format!("{} s is no time to settle", settings.settle)));
    }
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(settings.ahead.max(1));
        scope.spawn(move || {
            for frame in frames {
                let failed = frame.is_err();
                // The player has gone, or nothing can follow an error.
                let ready = frame.map(|frame| Ready { frame: frame.into(), at: Instant::now() });
                if sender.send(ready).is_err() || failed {
                    break;
                }
            }
        });
        let played = first(&receiver, progress)
            .and_then(|first| Ok((Player::open(display, &first, settings)?, first)))
            .and_then(|(player, first)| player.run(display, (first, &receiver), settings, told, progress));
        // The thread ends when it sends in vain; what it is making it would finish first.
        drop(receiver);
        if let Some(making) = &settings.making {
            making.stop();
        }
        played
    })
}

/// A frame that has been made.
struct Ready {
    frame: Arc<DisplayFrame>,
    at: Instant,
}

/// Waits for the first frame.
fn first(frames: &Receiver<Result<Ready>>, progress: &Progress) -> Result<Ready> {
    loop {
        match frames.recv_timeout(TURN) {
            Ok(first) => return first,
            Err(RecvTimeoutError::Timeout) => progress.check()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Error::parameter("frames", "there is none to play"));
            }
        }
    }
}

struct Player {
    panel: PanelWindow,
    presenter: Presenter,
    adapter: Option<String>,
    /// Time of a refresh [s].
    refresh: f64,
    /// Time between frames [s].
    period: f64,
    origin: Instant,
    first_presented: f64,
    longest: f64,
    last: f64,
    counts: Counts,
    /// Frames that are on the panel, or were, and have not been told of.
    untold: VecDeque<FrameTime>,
    settle: f64,
    /// Of the last frames [s].
    presenting: VecDeque<f64>,
}

#[derive(Default)]
struct Counts {
    missed: u64,
    starved: u64,
    refused: u64,
    unsettled: u64,
}

/// Why the player stopped waiting.
enum Waited {
    Due,
    End(ShowEnd),
    /// The monitor had been away: the times start anew.
    Returned,
}

/// What comes after a frame.
enum Next {
    Frame {
        ready: Ready,
        starved: bool,
    },
    /// The sequence has ended.
    Over,
    End(ShowEnd),
}

impl Player {
    fn open(display: &mut Display, first: &Ready, settings: &PlaySettings) -> Result<Self> {
        let start = Instant::now();
        let panel = PanelWindow::open(display, &settings.monitor, &first.frame, &settings.window)?;
        let refresh = 1.0 / panel.monitor().refresh.filter(|rate| RATES.contains(rate)).unwrap_or(USUAL_REFRESH);
        Ok(Self {
            presenter: panel.presenter().unwrap_or_default(),
            adapter: panel.adapter(),
            refresh,
            period: settings.rate.map_or(refresh, |rate| 1.0 / rate),
            origin: Instant::now(),
            first_presented: start.elapsed().as_secs_f64(),
            longest: 0.0,
            last: 0.0,
            counts: Counts::default(),
            untold: VecDeque::new(),
            settle: settings.settle,
            presenting: VecDeque::new(),
            panel,
        })
    }

    fn run(
        mut self,
        display: &mut Display,
        (first, frames): (Ready, &Receiver<Result<Ready>>),
        settings: &PlaySettings,
        told: &mut dyn FnMut(&FrameTime),
        progress: &Progress,
    ) -> Result<PlayReport> {
        self.untold.push_back(FrameTime {
            number: 0,
            due: 0.0,
            ready: self.since_origin(first.at),
            presented: 0.0,
            settled: None,
            missed: 0,
            starved: false,
            taken: true,
            vertical_blank: None,
        });
        // Where blanks are told, a frame goes to the blank that is nearest to its time: be there half a refresh before.
        let early = if self.panel.tells_vertical_blanks() { 0.5 * self.refresh } else { 0.0 };
        let mut due = self.period;
        let end = loop {
            match self.wait(display, Some(due - early), (settings.on_absence, &mut *told), progress)? {
                Waited::Due => {}
                Waited::Returned => due = self.now(),
                Waited::End(end) => break end,
            }
            let (ready, starved) = match self.next(display, frames, (settings.on_absence, &mut *told), progress)? {
                Next::Frame { ready, starved } => (ready, starved),
                Next::Over => break self.hold(display, (settings, &mut *told), progress)?,
                Next::End(end) => break end,
            };
            let vertical_blank = self.panel.wait_for_vertical_blank(Duration::from_secs_f64(2.0 * self.refresh))?;
            let handed_over = self.now();
            // What is not settled now never will be.
            self.tell(handed_over, true, told);
            let shown = self.panel.present(&ready.frame)?;
            let presented = self.since_origin(shown.at);
            if self.presenting.len() == MOST_TIMES {
                self.presenting.pop_front();
            }
            self.presenting.push_back(presented - handed_over);
            let missed = ((handed_over - due) / self.refresh).round().max(0.0) as u64;
            self.untold.push_back(FrameTime {
                number: shown.number,
                due,
                ready: self.since_origin(ready.at),
                presented,
                settled: None,
                missed,
                starved,
                taken: shown.taken,
                vertical_blank,
            });
            self.tell(self.now(), false, told);
            self.counts.missed += missed;
            self.counts.starved += u64::from(starved);
            self.counts.refused += u64::from(!shown.taken);
            self.longest = self.longest.max(presented - self.last);
            self.last = presented;
            // Each frame has its full time on the panel: after a late one, the next does not hurry. At the monitor's own
            // rate its blanks set the time.
            due = if missed > 0 || settings.rate.is_none() { handed_over } else { due } + self.period;
        };
        self.tell(self.now(), true, told);
        self.report(display, end)
    }

    /// Tells of the frames that have settled by `now`; of all where what has not is about to be replaced.
    fn tell(&mut self, now: f64, all: bool, told: &mut dyn FnMut(&FrameTime)) {
        while let Some(mut time) = self.untold.pop_front() {
            let settles = time.presented + self.settle;
            if settles <= now && time.taken {
                time.settled = Some(settles);
            } else if all || !time.taken {
                self.counts.unsettled += u64::from(time.taken);
            } else {
                self.untold.push_front(time);
                return;
            }
            told(&time);
        }
    }

    /// Takes the next frame; waits for it where it has not been made yet.
    fn next(
        &mut self,
        display: &mut Display,
        frames: &Receiver<Result<Ready>>,
        (on_absence, told): (OnAbsence, &mut dyn FnMut(&FrameTime)),
        progress: &Progress,
    ) -> Result<Next> {
        let mut starved = false;
        loop {
            match frames.try_recv() {
                Ok(ready) => return Ok(Next::Frame { ready: ready?, starved }),
                Err(TryRecvError::Disconnected) => return Ok(Next::Over),
                Err(TryRecvError::Empty) => {
                    starved = true;
                    let soon = self.now() + 1e-3;
                    if let Waited::End(end) = self.wait(display, Some(soon), (on_absence, &mut *told), progress)? {
                        return Ok(Next::End(end));
                    }
                }
            }
        }
    }

    /// Keeps the last frame as long as asked, and at least its own time.
    fn hold(
        &mut self,
        display: &mut Display,
        (settings, told): (&PlaySettings, &mut dyn FnMut(&FrameTime)),
        progress: &Progress,
    ) -> Result<ShowEnd> {
        let until = settings.hold.map(|hold| self.last + hold.as_secs_f64().max(self.period));
        loop {
            match self.wait(display, until, (settings.on_absence, &mut *told), progress)? {
                Waited::Due => return Ok(ShowEnd::Held),
                Waited::End(end) => return Ok(end),
                Waited::Returned => {}
            }
        }
    }

    fn now(&self) -> f64 {
        self.origin.elapsed().as_secs_f64()
    }

    /// A time counted from the first frame [s].
    fn since_origin(&self, at: Instant) -> f64 {
        match at.checked_duration_since(self.origin) {
            Some(after) => after.as_secs_f64(),
            None => -(self.origin - at).as_secs_f64(),
        }
    }

    /// Waits until `due` (none: for ever), dealing with the window's events.
    fn wait(
        &mut self,
        display: &mut Display,
        due: Option<f64>,
        (on_absence, told): (OnAbsence, &mut dyn FnMut(&FrameTime)),
        progress: &Progress,
    ) -> Result<Waited> {
        let mut absent = false;
        loop {
            if progress.stopped() {
                return Ok(Waited::End(ShowEnd::Stopped));
            }
            self.tell(self.now(), false, told);
            let left = due.map_or(TURN, |due| Duration::from_secs_f64((due - self.now()).max(0.0)));
            // The window system's own waiting is good to a millisecond or two.
            display.turn(left.saturating_sub(Duration::from_millis(2)).min(TURN))?;
            match self.panel.attend(display)? {
                Standing::Ended => return Ok(Waited::End(ShowEnd::Closed)),
                Standing::Absent { why } if on_absence == OnAbsence::End => {
                    return Ok(Waited::End(ShowEnd::Absent { why }));
                }
                Standing::Absent { .. } => {
                    absent = true;
                    std::thread::sleep(TURN);
                    continue;
                }
                Standing::Shown if absent => return Ok(Waited::Returned),
                Standing::Shown => {}
            }
            let Some(due) = due else { continue };
            let left = due - self.now();
            if left <= 0.0 {
                return Ok(Waited::Due);
            }
            if left <= 2e-3 {
                std::thread::sleep(Duration::from_secs_f64(left));
                return Ok(Waited::Due);
            }
        }
    }

    fn report(mut self, display: &mut Display, end: ShowEnd) -> Result<PlayReport> {
        let frames = self.panel.frames();
        let presenting = self.presenting.make_contiguous();
        presenting.sort_by(f64::total_cmp);
        let median = presenting.get(presenting.len() / 2).copied().unwrap_or(0.0);
        let longest = presenting.last().copied().unwrap_or(0.0);
        let report = PlayReport {
            monitor: self.panel.monitor().clone(),
            presenter: self.presenter,
            adapter: self.adapter,
            frames,
            missed: self.counts.missed,
            starved: self.counts.starved,
            refused: self.counts.refused,
            unsettled: self.counts.unsettled,
            presenting: [median, longest],
            mean_interval: if frames > 1 { self.last / (frames - 1) as f64 } else { 0.0 },
            longest_interval: self.longest,
            first_presented: self.first_presented,
            covered: self.panel.covered(),
            end,
            warnings: self.panel.warnings().to_vec(),
        };
        drop(self.panel);
        display.turn(Duration::ZERO)?;
        Ok(report)
    }
}
