//! The operator's window: an ordinary one, on any monitor but the panel's.

use super::choice::MonitorChoice;
use super::frame::DisplayFrame;
use super::keys::KeyPress;
use super::monitor::Monitor;
use super::native::NativeWindow;
use super::presenter::{Presenter, Surface};
use super::session::Display;
use crate::error::{Error, Result};
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;
use winit::dpi::{PhysicalPosition, PhysicalSize};
use winit::window::Window;

/// How often a window that comes onto the panel's monitor is put back before it is closed.
const PATIENCE: u32 = 5;
/// Room between the monitor's corner and the window's [px].
const MARGIN: i32 = 40;

/// Where the operator's window stands.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum OperatorChoice {
    /// On the main monitor, or another one that is not the panel's; nowhere if there is none.
    #[default]
    Auto,
    /// There is none.
    None,
    /// On this monitor.
    On(MonitorChoice),
}

impl FromStr for OperatorChoice {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.trim() {
            "auto" => Ok(Self::Auto),
            "none" => Ok(Self::None),
            name => name.parse().map(Self::On),
        }
    }
}

impl OperatorChoice {
    /// The monitor that is meant, which is never the panel's; `None` where there is to be no window.
    ///
    /// # Errors
    /// [`Error::Display`] when it was named and is the panel's, or shows a part of the same desktop, or is not there.
    pub fn find(&self, monitors: &[Monitor], panel: &Monitor) -> Result<Option<Monitor>> {
        let apart = |monitor: &Monitor| !monitor.rectangle().meets(&panel.rectangle());
        match self {
            Self::None => Ok(None),
            Self::Auto => {
                let mut others: Vec<&Monitor> = monitors.iter().filter(|m| apart(m)).collect();
                others.sort_by_key(|monitor| !monitor.primary);
                Ok(others.first().map(|monitor| (*monitor).clone()))
            }
            Self::On(choice) => match Some(choice.find(monitors)?).filter(apart) {
                Some(monitor) => Ok(Some(monitor)),
                None => Err(Error::Display {
                    what: format!(
                        "the operator's view cannot stand on the panel's monitor {}; choose another, or none",
                        panel.name
                    ),
                }),
            },
        }
    }
}

/// An ordinary window with a picture of a fixed size. The surface goes before the window that it draws into.
pub struct OperatorWindow {
    surface: Surface,
    native: NativeWindow,
    home: Monitor,
    panel: Monitor,
    last: Arc<DisplayFrame>,
    strayed: u32,
}

/// How it stands with the operator's window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OperatorStanding {
    /// It is there.
    Shown,
    /// A key ended the show, or the window was closed.
    Ended,
    /// It came onto the panel's monitor again and again; it is to be dropped.
    Strayed,
}

impl OperatorWindow {
    /// Opens it on `home` with a first picture.
    ///
    /// # Errors
    /// [`Error::Display`] when no window can be made or drawn into, or it comes to stand on the panel's monitor.
    pub(super) fn open(
        display: &mut Display,
        home: &Monitor,
        panel: &Monitor,
        first: &Arc<DisplayFrame>,
    ) -> Result<Self> {
        let (width, height) = (first.width(), first.height());
        let (size, place) = (PhysicalSize::new(width, height), corner(home, first));
        let native = NativeWindow::create(display, width, height, |_| {
            let attributes = Window::default_attributes().with_title("holodrive: operator's view");
            Ok(attributes.with_position(place).with_inner_size(size).with_resizable(false))
        })?;
        native.settle(display, Duration::ZERO, |native| {
            let shown = native.x11.is_none() || native.placement()?.is_some();
            let what = "the window system does not show the operator's view in its size; do without it";
            Ok((!shown || native.window.inner_size() != size).then(|| what.into()))
        })?;
        // A window manager may have put it elsewhere.
        native.window.set_outer_position(place);
        let mut surface = Surface::new(Presenter::Software, &native.window, width, height)?;
        surface.present(first)?;
        if let Some((x11, id)) = &native.x11 {
            x11.focus(*id)?;
        }
        let (home, panel, last) = (home.clone(), panel.clone(), Arc::clone(first));
        Ok(Self { surface, native, home, panel, last, strayed: 0 })
    }

    /// Shows a picture of the window's size from now on.
    ///
    /// # Errors
    /// [`Error::Display`] when it has another size, or the window system refuses it.
    pub fn present(&mut self, picture: &Arc<DisplayFrame>) -> Result<()> {
        self.surface.present(picture)?;
        self.last = Arc::clone(picture);
        Ok(())
    }

    /// Deals with what has happened to it; call it after each [`Display::turn`]. Where it has come onto the panel's monitor
    /// it is put back.
    ///
    /// # Errors
    /// [`Error::Display`] when the connection to the window system is lost.
    pub(super) fn attend(&mut self) -> Result<OperatorStanding> {
        let events = self.native.events();
        if events.end {
            return Ok(OperatorStanding::Ended);
        }
        if (events.windows_changed || events.monitors_changed) && self.on_panel()? {
            self.strayed += 1;
            if self.strayed > PATIENCE {
                self.native.window.set_visible(false);
                return Ok(OperatorStanding::Strayed);
            }
            self.native.window.set_outer_position(corner(&self.home, &self.last));
        }
        if events.redraw {
            self.surface.present(&self.last)?;
        }
        Ok(OperatorStanding::Shown)
    }

    /// Keys pressed in it since the last call.
    pub(super) fn keys(&self) -> Vec<KeyPress> {
        self.native.keys()
    }

    fn on_panel(&self) -> Result<bool> {
        let panel = self.panel.rectangle();
        if self.native.x11.is_some() {
            return Ok(self.native.placement()?.is_some_and(|place| place.meets(&panel)));
        }
        // Where the window system does not tell the place, it tells the monitor.
        Ok(self.native.window.current_monitor().and_then(|m| m.name()).is_some_and(|name| name == self.panel.name))
    }
}

/// Where the window's corner goes, so that all of it is on the monitor where that is large enough.
fn corner(home: &Monitor, picture: &DisplayFrame) -> PhysicalPosition<i32> {
    let room = |side: u32, size: u32| (i64::from(side) - i64::from(size)).clamp(0, i64::from(MARGIN)) as i32;
    PhysicalPosition::new(home.x + room(home.width, picture.width()), home.y + room(home.height, picture.height()))
}
