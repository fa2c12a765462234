//! A panel's window for frames that come from other programs.

use super::frame::DisplayFrame;
use super::panel_loop::{PanelLoop, ShowEnd, Turn};
use crate::error::{Error, Result};
use crate::panel::Frame;
use crate::serve::{Output, Readiness, ShownAt, not_ready};
use std::sync::Arc;
use std::time::Duration;

/// With the graphics presenter a frame waits for the vertical blank by itself; with the software presenter on X11 it is
/// handed over just after one, ahead of the scan.
impl Output for PanelLoop<'_> {
    fn attend(&mut self) -> Result<Readiness> {
        Ok(match self.turn(Duration::ZERO)? {
            Turn::Absent { why } | Turn::Ended(ShowEnd::Absent { why }) => Readiness::Absent { why },
            Turn::Ended(ShowEnd::Closed) => Readiness::Ended,
            // Whoever keeps the panel sees that it is stopped.
            Turn::Ended(_) | Turn::Shown | Turn::Returned | Turn::OperatorClosed => Readiness::Ready,
        })
    }

    fn show(&mut self, frame: &Frame) -> Result<ShownAt> {
        let frame = Arc::new(DisplayFrame::packed(&[frame])?);
        self.present(&frame)
    }

    fn preload(&mut self, number: u64, frame: &Frame) -> Result<()> {
        self.ready.insert(number, Arc::new(DisplayFrame::packed(&[frame])?));
        Ok(())
    }

    fn recall(&mut self, number: u64) -> Result<ShownAt> {
        let frame = self.ready.get(&number).cloned().ok_or_else(|| not_ready(number))?;
        self.present(&frame)
    }

    fn forget(&mut self, number: u64) {
        self.ready.remove(&number);
    }

    fn refresh(&self) -> Option<f64> {
        Some(self.panel.refresh_time())
    }
}

impl PanelLoop<'_> {
    /// Puts a frame into the window for the next refresh.
    fn present(&mut self, frame: &Arc<DisplayFrame>) -> Result<ShownAt> {
        self.panel.wait_for_vertical_blank(Duration::from_secs_f64(2.0 * self.panel.refresh_time()))?;
        let presented = self.panel.present(frame)?;
        if self.display.x11().is_none() {
            // Elsewhere requests leave for the window system only in a turn of its events.
            self.display.turn(Duration::ZERO)?;
        }
        if !presented.taken {
            return Err(Error::Display { what: "the window system does not take frames now".into() });
        }
        Ok(ShownAt { at: presented.at, number: presented.number })
    }
}
