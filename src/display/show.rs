//! Showing one frame on a panel for as long as is asked.

use super::frame::DisplayFrame;
use super::monitor::{Monitor, MonitorChoice};
use super::presenter::Presenter;
use super::session::Display;
use super::window::{PanelWindow, Standing, WindowSettings};
use crate::error::Result;
use crate::progress::Progress;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Longest wait between two looks at the clock and at the stop flag.
const TURN: Duration = Duration::from_millis(20);

/// What to do when the panel's monitor goes away.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnAbsence {
    /// End, and report it.
    #[default]
    End,
    /// Wait until it is back, then go on.
    Wait,
}

/// How a frame is shown.
#[derive(Clone, Debug)]
pub struct ShowSettings {
    /// The monitor to show it on.
    pub monitor: MonitorChoice,
    /// How the window is made.
    pub window: WindowSettings,
    /// For how long; none: until a key, the window's closing or the stop flag ends it.
    pub hold: Option<Duration>,
    /// What to do when the monitor goes away.
    pub on_absence: OnAbsence,
}

/// Why a show ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ShowEnd {
    /// The time asked for was over.
    Held,
    /// Esc, Q or Ctrl+C was pressed in the window, or the window was closed.
    Closed,
    /// The stop flag was set.
    Stopped,
    /// The monitor was unplugged, switched off or changed.
    Absent {
        /// What happened.
        why: String,
    },
}

/// What was shown, where and how.
#[derive(Clone, Debug, Serialize)]
pub struct ShowReport {
    /// The monitor.
    pub monitor: Monitor,
    /// Who put the frame into the window.
    pub presenter: Presenter,
    /// The graphics adapter, if one was at work.
    pub adapter: Option<String>,
    /// Frames handed to the window system.
    pub frames: u64,
    /// From the call until the window system had taken the first frame [s].
    pub first_presented: f64,
    /// From the call until the end [s].
    pub shown: f64,
    /// How often another window had come above and was covered again.
    pub covered: u64,
    /// Why it ended.
    pub end: ShowEnd,
    /// What alters levels on this monitor, where that was allowed.
    pub warnings: Vec<String>,
}

/// Shows `frame` on one monitor, unchanged, until the time is over, a key in the window (Esc, Q, Ctrl+C) or `progress`
/// ends it, or the monitor goes away.
///
/// # Errors
///
/// Those of [`PanelWindow::open`]; [`crate::Error::Display`] when the connection to the window system is lost.
pub fn show(
    display: &mut Display,
    frame: DisplayFrame,
    settings: &ShowSettings,
    progress: &Progress,
) -> Result<ShowReport> {
    let start = Instant::now();
    let frame = Arc::new(frame);
    let mut panel = PanelWindow::open(display, &settings.monitor, &frame, &settings.window)?;
    let first_presented = start.elapsed();
    let (presenter, adapter) = (panel.presenter().unwrap_or_default(), panel.adapter());
    let end = loop {
        let left = settings.hold.map_or(TURN, |hold| hold.saturating_sub(start.elapsed()));
        if left.is_zero() {
            break ShowEnd::Held;
        }
        if progress.stopped() {
            break ShowEnd::Stopped;
        }
        display.turn(left.min(TURN))?;
        match panel.attend(display)? {
            Standing::Ended => break ShowEnd::Closed,
            Standing::Absent { why } if settings.on_absence == OnAbsence::End => break ShowEnd::Absent { why },
            Standing::Shown | Standing::Absent { .. } => {}
        }
    };
    let report = ShowReport {
        monitor: panel.monitor().clone(),
        presenter,
        adapter,
        frames: panel.frames(),
        first_presented: first_presented.as_secs_f64(),
        shown: start.elapsed().as_secs_f64(),
        covered: panel.covered(),
        end,
        warnings: panel.warnings().to_vec(),
    };
    drop(panel);
    // The window is gone from the screen only once the window system has been told.
    display.turn(Duration::ZERO)?;
    Ok(report)
}
