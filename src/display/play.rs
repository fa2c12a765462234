//! Frames in time: a sequence played in order, each frame once, with its times.

use super::frame::DisplayFrame;
use super::frame_times::{FrameStatistics, FrameTime, FrameTimes};
use super::panel_loop::{PanelLoop, ShowEnd, ShowSettings, Turn, WindowReport};
use super::session::Display;
use crate::error::{Error, Result};
use crate::progress::Progress;
use serde::Serialize;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, sync_channel};
use std::time::{Duration, Instant};

/// Longest wait between two looks at the window's events and the stop flag.
const LONGEST_TURN: Duration = Duration::from_millis(5);
/// The window system's own waiting is good to a millisecond or two; the rest is slept.
const SLEPT: Duration = Duration::from_millis(2);
/// Rates that make sense [Hz]; their periods are durations that can be waited for.
const RATES: std::ops::RangeInclusive<f64> = 1e-3..=1e4;

/// How a sequence is played.
#[derive(Clone, Debug)]
pub struct PlaySettings {
    /// Where and how it is shown. [`ShowSettings::hold`]: how long the last frame stays, at least its own time.
    pub show: ShowSettings,
    /// Frames per second [Hz]; none: one at each refresh of the monitor.
    pub rate: Option<f64>,
    /// How many frames are made ahead of the one on the panel.
    pub ahead: usize,
    /// From a frame's being presented until the modulator has settled on it [s].
    pub settle: f64,
    /// The progress of whatever makes the frames: it is stopped when the play ends.
    pub making: Option<Arc<Progress>>,
}

/// What was played, where and how well.
#[derive(Clone, Debug, Serialize)]
pub struct PlayReport {
    /// Of the window.
    #[serde(flatten)]
    pub window: WindowReport,
    /// Of the frames' times.
    #[serde(flatten)]
    pub times: FrameStatistics,
}

/// Plays `frames` in order, each of them once, none left out: a late frame delays those after it.
///
/// Frames are made on another thread, up to [`PlaySettings::ahead`] in advance. With the graphics presenter each waits for
/// the vertical blank by itself; with the software presenter on X11 it is handed over just after one. `told` is called
/// with each frame's times, in their order, as soon as the modulator has settled on it, or when another frame comes before.
///
/// # Errors
///
/// Those of [`super::PanelWindow::open`]; the first error among `frames`; [`Error::Parameter`] for an empty sequence,
/// [`Error::OutOfRange`] for a rate outside 0.001 to 10,000 Hz; [`Error::Interrupted`] when it was stopped before the first frame.
pub fn play<F: Into<Arc<DisplayFrame>>>(
    display: &mut Display,
    frames: impl Iterator<Item = Result<F>> + Send,
    settings: &PlaySettings,
    told: &mut dyn FnMut(&FrameTime),
    progress: &Progress,
) -> Result<PlayReport> {
    if let Some(rate) = settings.rate.filter(|rate| !RATES.contains(rate)) {
        let (least, most) = (RATES.start(), RATES.end());
        return Err(Error::out_of_range("fps", rate, format!("must be {least} to {most} frames per second")));
    }
    if !(settings.settle.is_finite() && settings.settle >= 0.0) {
        return Err(Error::out_of_range("settle", settings.settle, "must be a time of 0 s or more"));
    }
    std::thread::scope(|scope| {
        let (sender, receiver) = sync_channel(settings.ahead.max(1));
        scope.spawn(move || {
            for frame in frames {
                let failed = frame.is_err();
                // The player has gone, or nothing can follow an error.
                let ready = frame.map(|frame| ReadyFrame { frame: frame.into(), at: Instant::now() });
                if sender.send(ready).is_err() || failed {
                    break;
                }
            }
        });
        let played = first(&receiver, progress).and_then(|first| {
            let panel = PanelLoop::open(display, &first.frame, &settings.show, progress)?;
            Player::new(panel, &first, settings, told).run(&receiver)
        });
        // The thread ends when it sends in vain; what it is making it would finish first.
        drop(receiver);
        if let Some(making) = &settings.making {
            making.stop();
        }
        played
    })
}

/// A frame that has been made.
struct ReadyFrame {
    frame: Arc<DisplayFrame>,
    at: Instant,
}

/// Waits for the first frame.
fn first(frames: &Receiver<Result<ReadyFrame>>, progress: &Progress) -> Result<ReadyFrame> {
    loop {
        match frames.recv_timeout(LONGEST_TURN) {
            Ok(first) => return first,
            Err(RecvTimeoutError::Timeout) => progress.check()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Error::parameter("frames", "there is none to play"));
            }
        }
    }
}

struct Player<'a> {
    panel: PanelLoop<'a>,
    times: FrameTimes<'a>,
    /// When the first frame was on the panel.
    origin: Instant,
    /// Time of a refresh [s].
    refresh: f64,
    /// Frames come at the monitor's own rate.
    at_refresh: bool,
    /// Time between frames [s].
    period: f64,
    /// How long the last frame stays.
    hold: Option<Duration>,
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
        ready: ReadyFrame,
        starved: bool,
    },
    /// The sequence has ended.
    Over,
    End(ShowEnd),
}

impl<'a> Player<'a> {
    fn new(
        panel: PanelLoop<'a>,
        first: &ReadyFrame,
        settings: &PlaySettings,
        told: &'a mut dyn FnMut(&FrameTime),
    ) -> Self {
        let (origin, refresh) = (Instant::now(), panel.panel().refresh_time());
        Self {
            panel,
            times: FrameTimes::begin(since(origin, first.at), settings.settle, told),
            origin,
            refresh,
            at_refresh: settings.rate.is_none(),
            period: settings.rate.map_or(refresh, |rate| 1.0 / rate),
            hold: settings.show.hold,
        }
    }

    fn run(mut self, frames: &Receiver<Result<ReadyFrame>>) -> Result<PlayReport> {
        // Where blanks are told, a frame goes to the blank that is nearest to its time: be there half a refresh before.
        let early = if self.panel.panel().tells_vertical_blanks() { 0.5 * self.refresh } else { 0.0 };
        let mut due = self.period;
        let end = loop {
            match self.wait(Some(due - early))? {
                Waited::Due => {}
                Waited::Returned => due = self.now(),
                Waited::End(end) => break end,
            }
            let (ready, starved) = match self.next(frames)? {
                Next::Frame { ready, starved } => (ready, starved),
                Next::Over => break self.hold()?,
                Next::End(end) => break end,
            };
            let limit = Duration::from_secs_f64(2.0 * self.refresh);
            let vertical_blank = self.panel.panel_mut().wait_for_vertical_blank(limit)?;
            let handed_over = self.now();
            // What is not settled now never will be.
            self.times.tell(handed_over, true);
            let shown = self.panel.panel_mut().present(&ready.frame)?;
            let missed = ((handed_over - due) / self.refresh).round().max(0.0) as u64;
            let time = FrameTime {
                number: shown.number,
                due,
                ready: since(self.origin, ready.at),
                presented: since(self.origin, shown.at),
                settled: None,
                missed,
                starved,
                taken: shown.taken,
                vertical_blank,
            };
            self.times.add(time, handed_over);
            self.times.tell(self.now(), false);
            // Each frame has its full time on the panel: after a late one, the next does not hurry. At the monitor's own
            // rate its blanks set the time.
            due = if missed > 0 || self.at_refresh { handed_over } else { due } + self.period;
        };
        self.times.tell(self.now(), true);
        Ok(PlayReport { window: self.panel.close(end)?, times: self.times.statistics() })
    }

    /// Takes the next frame; waits for it where it has not been made yet.
    fn next(&mut self, frames: &Receiver<Result<ReadyFrame>>) -> Result<Next> {
        let mut starved = false;
        loop {
            match frames.try_recv() {
                Ok(ready) => return Ok(Next::Frame { ready: ready?, starved }),
                Err(TryRecvError::Disconnected) => return Ok(Next::Over),
                Err(TryRecvError::Empty) => {
                    starved = true;
                    if let Waited::End(end) = self.wait(Some(self.now() + 1e-3))? {
                        return Ok(Next::End(end));
                    }
                }
            }
        }
    }

    /// Keeps the last frame as long as asked, and at least its own time.
    fn hold(&mut self) -> Result<ShowEnd> {
        let until = self.hold.map(|hold| self.times.last + hold.as_secs_f64().max(self.period));
        loop {
            match self.wait(until)? {
                Waited::Due => return Ok(ShowEnd::TimeOver),
                Waited::End(end) => return Ok(end),
                Waited::Returned => {}
            }
        }
    }

    fn now(&self) -> f64 {
        self.origin.elapsed().as_secs_f64()
    }

    /// Waits until `due` (none: for ever), dealing with the window's events.
    fn wait(&mut self, due: Option<f64>) -> Result<Waited> {
        loop {
            self.times.tell(self.now(), false);
            let left = due.map_or(LONGEST_TURN, |due| Duration::from_secs_f64((due - self.now()).max(0.0)));
            match self.panel.turn(left.saturating_sub(SLEPT).min(LONGEST_TURN))? {
                Turn::Ended(end) => return Ok(Waited::End(end)),
                Turn::Returned => return Ok(Waited::Returned),
                Turn::Absent { .. } => {
                    std::thread::sleep(LONGEST_TURN);
                    continue;
                }
                Turn::Shown | Turn::OperatorClosed => {}
            }
            let Some(due) = due else { continue };
            let left = Duration::from_secs_f64((due - self.now()).max(0.0));
            if left <= SLEPT {
                std::thread::sleep(left);
                return Ok(Waited::Due);
            }
        }
    }
}

/// A time counted from `origin` [s].
fn since(origin: Instant, at: Instant) -> f64 {
    match at.checked_duration_since(origin) {
        Some(after) => after.as_secs_f64(),
        None => -(origin - at).as_secs_f64(),
    }
}
