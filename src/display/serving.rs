//! A panel that other programs write on.

use super::frame::DisplayFrame;
use super::monitor::MonitorChoice;
use super::session::Display;
use super::show::ShowEnd;
use super::window::{PanelWindow, Standing, WindowSettings};
use crate::error::Result;
use crate::progress::Progress;
use crate::serve::{SentLevels, ServeCounts, Server};
use serde::Serialize;
use std::sync::Arc;
use std::time::Duration;

/// Wait for a client's frame between two looks at the window. A frame that comes is shown at once.
const TURN: Duration = Duration::from_millis(5);

/// What was served.
#[derive(Clone, Debug, Serialize)]
pub struct ServingReport {
    /// Frames shown for clients.
    pub shown: u64,
    /// Frames that could not be shown: packing failed, or the monitor was away.
    pub failed: u64,
    /// What came in at the server.
    pub counts: ServeCounts,
    /// Why it ended; never by the monitor's absence, which is waited out.
    pub end: ShowEnd,
}

/// Keeps a panel and shows on it what the clients of `server` send, until a key in the window, or `progress`, ends it.
///
/// It begins with `idle`; afterwards the last frame stays, also when its client is gone. `pack` makes video pixels of
/// drive levels, as the panel's profile says. While the monitor is away clients are told so, and nothing is shown.
///
/// # Errors
///
/// Those of [`PanelWindow::open`]; [`crate::Error::Display`] when the connection to the window system is lost.
pub fn serve(
    display: &mut Display,
    server: &Server,
    idle: DisplayFrame,
    (monitor, window): (&MonitorChoice, &WindowSettings),
    pack: &mut dyn FnMut(&SentLevels) -> Result<DisplayFrame>,
    progress: &Progress,
) -> Result<ServingReport> {
    let mut panel = PanelWindow::open(display, monitor, &Arc::new(idle), window)?;
    let (mut shown, mut failed) = (0, 0);
    let end = loop {
        if progress.stopped() {
            break ShowEnd::Stopped;
        }
        display.turn(Duration::ZERO)?;
        let standing = panel.attend(display)?;
        if standing == Standing::Ended {
            break ShowEnd::Closed;
        }
        let Some(request) = server.next(TURN) else { continue };
        let presented = match (standing, pack(request.levels())) {
            (Standing::Absent { why }, _) => Err(why),
            (_, Err(error)) => Err(error.to_string()),
            (_, Ok(frame)) => match panel.present(&Arc::new(frame)) {
                Ok(presented) if presented.taken => Ok(()),
                Ok(_) => Err("the window system does not take frames now".to_owned()),
                Err(error) => Err(error.to_string()),
            },
        };
        match presented {
            Ok(()) => {
                shown += 1;
                request.shown();
            }
            Err(why) => {
                failed += 1;
                request.refused(&why);
            }
        }
    };
    drop(panel);
    display.turn(Duration::ZERO)?;
    Ok(ServingReport { shown, failed, counts: server.counts(), end })
}
