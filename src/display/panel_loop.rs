//! The event loop of a panel's window: what happens to it, to its monitor and to the operator's window, and what ends it.

use super::choice::MonitorChoice;
use super::frame::DisplayFrame;
use super::keys::KeyPress;
use super::monitor::Monitor;
use super::operator::{OperatorStanding, OperatorWindow};
use super::presenter::Presenter;
use super::session::Display;
use super::window::{PanelWindow, Standing, WindowSettings};
use crate::error::{Error, Result};
use crate::names::{Name, Named};
use crate::progress::Progress;
use serde::Serialize;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// What to do when the panel's monitor goes away.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnAbsence {
    /// End, and report it.
    #[default]
    End,
    /// Wait until it is back, then go on.
    Wait,
}

impl Named for OnAbsence {
    const KIND: &'static str = "on absence";
    const NAMES: &'static [Name<Self>] =
        &[("end", || Self::End, "end, and report it"), ("wait", || Self::Wait, "wait until it is back, then go on")];
}

/// How frames are shown on a monitor.
#[derive(Clone, Debug)]
pub struct ShowSettings {
    /// The monitor to show them on.
    pub monitor: MonitorChoice,
    /// How the window is made.
    pub window: WindowSettings,
    /// How long the last frame stays; none: until a key, the window's closing or the stop flag ends it.
    pub hold: Option<Duration>,
    /// What to do when the monitor goes away.
    pub on_absence: OnAbsence,
}

impl ShowSettings {
    /// On that monitor, with exact levels, until it is ended or the monitor goes away.
    pub fn new(monitor: MonitorChoice) -> Self {
        Self { monitor, window: WindowSettings::default(), hold: None, on_absence: OnAbsence::End }
    }
}

/// Why a show ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ShowEnd {
    /// The time asked for was over.
    #[serde(rename = "held")]
    TimeOver,
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

impl ShowEnd {
    /// Whether it ended as was asked for.
    ///
    /// # Errors
    ///
    /// [`Error::Display`] when the monitor went away.
    pub fn as_asked(self) -> Result<()> {
        match self {
            Self::Absent { why } => Err(Error::Display { what: why }),
            Self::TimeOver | Self::Closed | Self::Stopped => Ok(()),
        }
    }
}

/// What was shown, where and how.
#[derive(Clone, Debug, Serialize)]
pub struct WindowReport {
    /// The monitor.
    pub monitor: Monitor,
    /// Who put the frames into the window.
    pub presenter: Presenter,
    /// The graphics adapter, if one was at work.
    pub adapter: Option<String>,
    /// Frames handed to the window system.
    pub frames: u64,
    /// From the call until the window system had taken the first frame [s].
    pub first_presented: f64,
    /// How often another window had come above and was covered again.
    pub covered: u64,
    /// Why it ended.
    pub end: ShowEnd,
    /// What alters levels on this monitor, where that was allowed.
    pub warnings: Vec<String>,
}

/// What one turn of the loop has found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Turn {
    /// The last frame is on its monitor.
    Shown,
    /// The monitor is away, and is waited for.
    Absent {
        /// What happened.
        why: String,
    },
    /// The monitor is back, with the last frame on it.
    Returned,
    /// The operator's window came onto the panel's monitor again and again, and was closed.
    OperatorClosed,
    /// It is over.
    Ended(ShowEnd),
}

/// A panel's window with its event loop, and with the operator's window where there is one.
pub struct PanelLoop<'a> {
    pub(super) display: &'a mut Display,
    pub(super) panel: PanelWindow,
    operator: Option<OperatorWindow>,
    progress: &'a Progress,
    on_absence: OnAbsence,
    ends: Option<Instant>,
    absent: bool,
    presenter: Presenter,
    adapter: Option<String>,
    first_presented: f64,
    /// Frames that are kept packed, by number.
    pub(super) ready: HashMap<u64, Arc<DisplayFrame>>,
}

impl<'a> PanelLoop<'a> {
    /// Opens the window with `first` on it from the first instant; [`ShowSettings::hold`] begins with
    /// [`PanelLoop::hold_from`]. Besides keys, `progress` ends the loop.
    ///
    /// # Errors
    ///
    /// Those of [`PanelWindow::open`].
    pub fn open(
        display: &'a mut Display,
        first: &Arc<DisplayFrame>,
        settings: &ShowSettings,
        progress: &'a Progress,
    ) -> Result<Self> {
        let begin = Instant::now();
        let panel = PanelWindow::open(display, &settings.monitor, first, &settings.window)?;
        Ok(Self {
            display,
            operator: None,
            progress,
            on_absence: settings.on_absence,
            ends: None,
            absent: false,
            presenter: panel.presenter().unwrap_or_default(),
            adapter: panel.adapter(),
            first_presented: begin.elapsed().as_secs_f64(),
            ready: HashMap::new(),
            panel,
        })
    }

    /// Ends the loop by [`ShowEnd::TimeOver`] so long after `start`, if a time is given.
    pub fn hold_from(&mut self, start: Instant, hold: Option<Duration>) {
        self.ends = hold.and_then(|hold| start.checked_add(hold));
    }

    /// Opens the operator's window on `home`, with a first picture.
    ///
    /// # Errors
    ///
    /// [`Error::Display`] when no window can be made or drawn into, or it does not come to stand in its size.
    pub fn open_operator(&mut self, home: &Monitor, first: &Arc<DisplayFrame>) -> Result<()> {
        let panel = self.panel.monitor().clone();
        self.operator = Some(OperatorWindow::open(self.display, home, &panel, first)?);
        Ok(())
    }

    /// One turn: waits up to `longest` for events, and deals with them.
    ///
    /// # Errors
    ///
    /// [`Error::Display`] when the connection to the window system is lost.
    pub fn turn(&mut self, longest: Duration) -> Result<Turn> {
        let left = self.ends.map_or(longest, |ends| ends.saturating_duration_since(Instant::now()));
        if self.ends.is_some() && left.is_zero() {
            return Ok(Turn::Ended(ShowEnd::TimeOver));
        }
        if self.progress.stopped() {
            return Ok(Turn::Ended(ShowEnd::Stopped));
        }
        self.display.turn(left.min(longest))?;
        let turn = match self.panel.attend(self.display)? {
            Standing::Ended => return Ok(Turn::Ended(ShowEnd::Closed)),
            Standing::Absent { why } if self.on_absence == OnAbsence::End => {
                return Ok(Turn::Ended(ShowEnd::Absent { why }));
            }
            Standing::Absent { why } => {
                self.absent = true;
                Turn::Absent { why }
            }
            Standing::Shown if std::mem::take(&mut self.absent) => Turn::Returned,
            Standing::Shown => Turn::Shown,
        };
        match self.operator.as_mut().map(OperatorWindow::attend).transpose()? {
            Some(OperatorStanding::Ended) => Ok(Turn::Ended(ShowEnd::Closed)),
            Some(OperatorStanding::Strayed) => {
                self.operator = None;
                Ok(Turn::OperatorClosed)
            }
            Some(OperatorStanding::Shown) | None => Ok(turn),
        }
    }

    /// The panel's window.
    pub fn panel(&self) -> &PanelWindow {
        &self.panel
    }

    /// The panel's window, to put frames into.
    pub fn panel_mut(&mut self) -> &mut PanelWindow {
        &mut self.panel
    }

    /// The operator's window, while there is one.
    pub fn operator(&mut self) -> Option<&mut OperatorWindow> {
        self.operator.as_mut()
    }

    /// Keys pressed in either window since the last call, beside those that end the show.
    pub fn keys(&self) -> Vec<KeyPress> {
        let mut keys = self.panel.keys();
        keys.extend(self.operator.iter().flat_map(OperatorWindow::keys));
        keys
    }

    /// Takes the windows away, and reports.
    ///
    /// # Errors
    ///
    /// [`Error::Display`] when the connection to the window system is lost.
    pub fn close(self, end: ShowEnd) -> Result<WindowReport> {
        let Self { display, panel, operator, presenter, adapter, first_presented, .. } = self;
        let report = WindowReport {
            monitor: panel.monitor().clone(),
            presenter,
            adapter,
            frames: panel.frames(),
            first_presented,
            covered: panel.covered(),
            end,
            warnings: panel.warnings().to_vec(),
        };
        drop((panel, operator));
        // The windows are gone from the screen only once the window system has been told.
        display.turn(Duration::ZERO)?;
        Ok(report)
    }
}
