//! A window of the window system: how it is made, watched and waited for, the panel's and the operator's alike.

use super::keys::KeyPress;
use super::monitor::Monitor;
use super::rectangle::Rectangle;
use super::session::{Display, Inbox, WindowEvents, name_of};
use super::x11::X11;
use crate::error::{Error, Result};
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::event_loop::ActiveEventLoop;
use winit::raw_window_handle::{HasWindowHandle, RawWindowHandle};
use winit::window::{Window, WindowAttributes};

/// How long the window system may take to put the window where it belongs.
const SETTLE_LIMIT: Duration = Duration::from_secs(5);
/// Wait between two looks while it settles.
const LOOK: Duration = Duration::from_millis(5);

/// A window with what has happened to it.
pub(super) struct NativeWindow {
    pub(super) window: Arc<Window>,
    /// The X server that it is on, and its number there.
    pub(super) x11: Option<(Rc<X11>, u32)>,
    inbox: Rc<RefCell<Inbox>>,
}

impl NativeWindow {
    /// Makes one of `width × height` pixels; it is not visible yet.
    pub(super) fn create(
        display: &mut Display,
        width: u32,
        height: u32,
        attributes: impl FnOnce(&ActiveEventLoop) -> Result<WindowAttributes>,
    ) -> Result<Self> {
        let window = display.with_event_loop(|event_loop| {
            let window = event_loop.create_window(attributes(event_loop)?.with_visible(false));
            window.map(Arc::new).map_err(|error| Error::Display { what: format!("no window can be made: {error}") })
        })??;
        let inbox = Rc::new(RefCell::new(Inbox::of_size(width, height)));
        display.watch(window.id(), &inbox);
        let x11 = display.x11().zip(x11_id(&window));
        Ok(Self { window, x11, inbox })
    }

    /// Makes it visible and waits until nothing has been `wrong` with its place for as long as `steady`.
    pub(super) fn settle(
        &self,
        display: &mut Display,
        steady: Duration,
        wrong: impl Fn(&Self) -> Result<Option<String>>,
    ) -> Result<()> {
        self.window.set_visible(true);
        let start = Instant::now();
        let mut right_since = None;
        loop {
            display.turn(LOOK)?;
            let wrong = wrong(self)?;
            let now = Instant::now();
            match wrong {
                None => {
                    if now - *right_since.get_or_insert(now) >= steady {
                        return Ok(());
                    }
                }
                Some(wrong) if now - start > SETTLE_LIMIT => return Err(Error::Display { what: wrong }),
                Some(_) => right_since = None,
            }
        }
    }

    /// Where it stands instead of exactly on `monitor`, if so.
    pub(super) fn deviation(&self, monitor: &Monitor) -> Result<Option<String>> {
        let (name, window) = (&monitor.name, &self.window);
        if self.x11.is_some() {
            let wanted = monitor.rectangle();
            return Ok(match self.placement()? {
                Some(place) if place == wanted => None,
                Some(place) => Some(format!("the window should cover {name} ({wanted}) but stands {place}")),
                None => Some(format!("the window for {name} is not shown")),
            });
        }
        let size = window.inner_size();
        if (size.width, size.height) != (monitor.width, monitor.height) {
            return Ok(Some(format!(
                "the window should cover {name} with {}x{} px but the window system gave it {}x{}",
                monitor.width, monitor.height, size.width, size.height
            )));
        }
        // On Windows a window has the monitor's own pixels, which its size has just shown.
        if !cfg!(windows) && window.scale_factor() != 1.0 {
            let scale = window.scale_factor();
            return Ok(Some(format!("the window system scales {name} by {scale}; set its scale to 1")));
        }
        // Wayland tells the monitor only once something has been drawn.
        let elsewhere = window.current_monitor().and_then(|handle| name_of(&handle)).filter(|on| on != name);
        Ok(elsewhere.map(|on| format!("the window should be on {name} but the window system put it on {on}")))
    }

    /// Where it is on the desktop, if it is shown and the window system is an X server.
    pub(super) fn placement(&self) -> Result<Option<Rectangle>> {
        self.x11.as_ref().map_or(Ok(None), |(x11, id)| x11.placement(*id))
    }

    /// What has happened since the last call.
    pub(super) fn events(&self) -> WindowEvents {
        self.inbox.borrow_mut().take_events()
    }

    /// Keys pressed in it since the last call, beside those that end the show.
    pub(super) fn keys(&self) -> Vec<KeyPress> {
        std::mem::take(&mut self.inbox.borrow_mut().keys)
    }
}

fn x11_id(window: &Window) -> Option<u32> {
    match window.window_handle().ok()?.as_raw() {
        // Its type has the width of C's long; Windows, where that is another one, has no X.
        #[cfg(not(windows))]
        RawWindowHandle::Xlib(handle) => u32::try_from(handle.window).ok(),
        RawWindowHandle::Xcb(handle) => Some(handle.window.get()),
        _ => None,
    }
}
