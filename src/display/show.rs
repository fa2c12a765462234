//! Showing one frame on a panel for as long as is asked.

use super::frame::DisplayFrame;
use super::panel_loop::{PanelLoop, ShowSettings, Turn, WindowReport};
use super::session::Display;
use crate::error::Result;
use crate::progress::Progress;
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Longest wait between two looks at the clock and at the stop flag.
const LONGEST_TURN: Duration = Duration::from_millis(20);

/// What was shown, where, how, and for how long.
#[derive(Clone, Debug, Serialize)]
pub struct ShowReport {
    /// Of the window.
    #[serde(flatten)]
    pub window: WindowReport,
    /// From the call until the end [s].
    pub shown: f64,
}

/// Shows `frame` on one monitor, unchanged, until the time is over, a key in the window (Esc, Q, Ctrl+C) or `progress`
/// ends it, or the monitor goes away.
///
/// # Errors
///
/// Those of [`super::PanelWindow::open`]; [`crate::Error::Display`] when the connection to the window system is lost.
pub fn show(
    display: &mut Display,
    frame: DisplayFrame,
    settings: &ShowSettings,
    progress: &Progress,
) -> Result<ShowReport> {
    let start = Instant::now();
    let mut panel = PanelLoop::open(display, &Arc::new(frame), settings, progress)?;
    panel.hold_from(start, settings.hold);
    let end = loop {
        if let Turn::Ended(end) = panel.turn(LONGEST_TURN)? {
            break end;
        }
    };
    let shown = start.elapsed().as_secs_f64();
    Ok(ShowReport { window: panel.close(end)?, shown })
}
