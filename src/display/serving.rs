//! A panel's window for frames that come from other programs.

use super::frame::DisplayFrame;
use super::monitor::{Monitor, MonitorChoice};
use super::session::Display;
use super::window::{PanelWindow, Standing, WindowSettings};
use crate::error::{Error, Result};
use crate::panel::Frame;
use crate::serve::{Output, Readiness, ShownAt};
use std::sync::Arc;
use std::time::Duration;

/// Assumed of a monitor that does not tell its refresh rate [Hz].
const USUAL_REFRESH: f64 = 60.0;
/// Rates that a monitor may have [Hz].
const RATES: std::ops::RangeInclusive<f64> = 1.0..=1e4;

/// A window on a panel's monitor, its frames packed as the panel's profile says.
///
/// With the graphics presenter a frame waits for the vertical blank by itself; with the software presenter on X11 it is
/// handed over just after one, ahead of the scan.
pub struct ServedWindow<'a> {
    display: &'a mut Display,
    panel: PanelWindow,
}

impl<'a> ServedWindow<'a> {
    /// Opens it with `idle` on it from the first instant.
    ///
    /// # Errors
    /// Those of [`PanelWindow::open`], and of packing.
    pub fn open(
        display: &'a mut Display,
        (monitor, settings): (&MonitorChoice, &WindowSettings),
        idle: &Frame,
    ) -> Result<Self> {
        let panel = PanelWindow::open(display, monitor, &Arc::new(packed(idle)?), settings)?;
        Ok(Self { display, panel })
    }

    /// The monitor that it is on.
    pub fn monitor(&self) -> &Monitor {
        self.panel.monitor()
    }

    /// What alters levels on this monitor, where that was allowed.
    pub fn warnings(&self) -> &[String] {
        self.panel.warnings()
    }

    /// How often another window had come above and was covered again.
    pub fn covered(&self) -> u64 {
        self.panel.covered()
    }

    /// Takes the window away.
    ///
    /// # Errors
    /// [`Error::Display`] when the window system is gone.
    pub fn close(self) -> Result<()> {
        let Self { display, panel } = self;
        drop(panel);
        // The window is gone from the screen only once the window system has been told.
        display.turn(Duration::ZERO)
    }
}

impl Output for ServedWindow<'_> {
    fn attend(&mut self) -> Result<Readiness> {
        self.display.turn(Duration::ZERO)?;
        Ok(match self.panel.attend(self.display)? {
            Standing::Shown => Readiness::Ready,
            Standing::Absent { why } => Readiness::Absent { why },
            Standing::Ended => Readiness::Ended,
        })
    }

    fn show(&mut self, frame: &Frame) -> Result<ShownAt> {
        let frame = Arc::new(packed(frame)?);
        let limit = self.refresh().map_or(Duration::ZERO, |refresh| Duration::from_secs_f64(2.0 * refresh));
        self.panel.wait_for_vertical_blank(limit)?;
        let presented = self.panel.present(&frame)?;
        if self.display.x11().is_none() {
            // Elsewhere requests leave for the window system only in a turn of its events.
            self.display.turn(Duration::ZERO)?;
        }
        if !presented.taken {
            return Err(Error::Display { what: "the window system does not take frames now".into() });
        }
        Ok(ShownAt { at: presented.at, number: presented.number })
    }

    fn refresh(&self) -> Option<f64> {
        let rate = self.panel.monitor().refresh.filter(|rate| RATES.contains(rate)).unwrap_or(USUAL_REFRESH);
        Some(1.0 / rate)
    }
}

/// A frame in the video signal of its panel.
fn packed(frame: &Frame) -> Result<DisplayFrame> {
    let signal = frame.metadata.panel.signal.pack(&[frame])?;
    // The same memory, read as pixels.
    let pixels = bytemuck::allocation::try_cast_vec(signal.rgb)
        .unwrap_or_else(|(_, rgb)| rgb.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect());
    DisplayFrame::from_rgb(signal.width as u32, signal.height as u32, pixels)
}
