//! The connection to the window system, and the turning of its events.

use super::kernel;
use super::keys::{KeyPress, ends};
use super::monitor::Monitor;
#[cfg(all(unix, not(any(target_vendor = "apple", target_os = "android"))))]
use super::monitor::{Gamma, ScanOut};
use super::x11::X11;
use crate::error::{Error, Result};
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::{Rc, Weak};
use std::time::Duration;
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{ElementState, KeyEvent, WindowEvent};
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::keyboard::ModifiersState;
use winit::monitor::MonitorHandle;
use winit::platform::pump_events::{EventLoopExtPumpEvents, PumpStatus};
use winit::raw_window_handle::{HasDisplayHandle, RawDisplayHandle};
use winit::window::WindowId;

/// Longest wait of a turn whose only purpose is to be inside the event loop.
const TURN: Duration = Duration::from_millis(10);
/// Keys that are kept for a window that does not ask for them.
const MOST_KEYS: usize = 64;

/// The window system: monitors, and windows on them.
///
/// There can be one in a process, made on the main thread (on Linux, on any one thread). Where the window system is an
/// X server and that server ends, Xlib ends this process with exit code 1.
pub struct Display {
    event_loop: EventLoop<()>,
    windows: HashMap<WindowId, Weak<RefCell<Inbox>>>,
    x11: Option<Rc<X11>>,
    #[cfg(all(unix, not(any(target_vendor = "apple", target_os = "android"))))]
    wayland: Option<super::wayland::Wayland>,
}

/// What has happened to a window.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WindowEvents {
    /// Esc, Q or Ctrl+C was pressed in it, or it was asked to close.
    pub(super) end: bool,
    /// It has to be drawn again.
    pub(super) redraw: bool,
    /// Monitors may have changed since the window last made sure of its own.
    pub(super) monitors_changed: bool,
    /// Its place or size, or that of other windows, may have changed.
    pub(super) windows_changed: bool,
}

/// What has happened to one window and was not yet dealt with.
#[derive(Debug, Default)]
pub(super) struct Inbox {
    events: WindowEvents,
    /// Other keys that were pressed in it.
    pub(super) keys: Vec<KeyPress>,
    /// The size that it must keep (columns, rows) [px].
    size: (u32, u32),
    modifiers: ModifiersState,
}

impl Inbox {
    /// An empty one, for a window of that size [px].
    pub(super) fn of_size(width: u32, height: u32) -> Self {
        Self { size: (width, height), ..Self::default() }
    }

    /// The events since the last call; an end stays one.
    pub(super) fn take_events(&mut self) -> WindowEvents {
        let end = self.events.end;
        std::mem::replace(&mut self.events, WindowEvents { end, ..WindowEvents::default() })
    }
}

impl Display {
    /// Connects to the window system: X11 or Wayland as the environment says, or that of the operating system.
    ///
    /// # Errors
    ///
    /// [`Error::Display`] when there is none, or when this process has had a connection already.
    pub fn connect() -> Result<Self> {
        let mut builder = EventLoop::builder();
        #[cfg(all(unix, not(any(target_vendor = "apple", target_os = "android"))))]
        {
            // One setting for both window systems; from another thread than the main one it would panic without.
            winit::platform::x11::EventLoopBuilderExtX11::with_any_thread(&mut builder, true);
        }
        let event_loop = builder.build().map_err(|error| Error::Display {
            what: format!(
                "no display server can be reached: {}; run inside a desktop session, or set DISPLAY or WAYLAND_DISPLAY",
                plain(&error.to_string())
            ),
        })?;
        let owned = event_loop.owned_display_handle();
        let system = owned.display_handle().ok().map(|handle| handle.as_raw());
        let on_x11 = matches!(system, Some(RawDisplayHandle::Xlib(_)));
        let x11 = if on_x11 { Some(Rc::new(X11::connect()?)) } else { None };
        #[cfg(all(unix, not(any(target_vendor = "apple", target_os = "android"))))]
        let wayland = match system {
            Some(RawDisplayHandle::Wayland(_)) => Some(super::wayland::Wayland::connect()?),
            _ => None,
        };
        Ok(Self {
            event_loop,
            windows: HashMap::new(),
            x11,
            #[cfg(all(unix, not(any(target_vendor = "apple", target_os = "android"))))]
            wayland,
        })
    }

    /// The monitors of the desktop, as they are now.
    pub fn monitors(&mut self) -> Result<Vec<Monitor>> {
        if let Some(x11) = &self.x11 {
            return x11.monitors();
        }
        let mut monitors: Vec<Monitor> = self.with_event_loop(|event_loop| {
            let primary = event_loop.primary_monitor();
            let handles = event_loop.available_monitors().enumerate();
            handles.map(|(index, handle)| monitor_of(index, &handle, primary.as_ref() == Some(&handle))).collect()
        })?;
        self.add_scan_out(&mut monitors)?;
        Ok(monitors)
    }

    /// Adds what the compositor tells of its monitors' scan-out.
    #[cfg(all(unix, not(any(target_vendor = "apple", target_os = "android"))))]
    fn add_scan_out(&mut self, monitors: &mut [Monitor]) -> Result<()> {
        let Some(wayland) = &mut self.wayland else { return Ok(()) };
        let changed = wayland.changes()?;
        for monitor in monitors {
            monitor.scan_out = wayland.scan_out(&monitor.name).map(|(rotated, preferred)| ScanOut {
                rotated,
                transformed: false,
                gamma: Gamma::Unknown,
                high_dynamic_range: None,
                // A fullscreen window is on one monitor, wherever the others lie.
                shared_with: Vec::new(),
                preferred,
            });
        }
        if changed {
            self.tell(true, false);
        }
        Ok(())
    }

    /// Adds what Windows tells of its monitors: EDID and scan-out.
    #[cfg(windows)]
    fn add_scan_out(&mut self, monitors: &mut [Monitor]) -> Result<()> {
        super::win32::complete(monitors);
        Ok(())
    }

    #[cfg(not(any(windows, all(unix, not(any(target_vendor = "apple", target_os = "android"))))))]
    fn add_scan_out(&mut self, _: &mut [Monitor]) -> Result<()> {
        Ok(())
    }

    /// Lets all windows know what has changed.
    fn tell(&mut self, monitors: bool, windows: bool) {
        self.windows.retain(|_, window| window.strong_count() > 0);
        for inbox in self.windows.values().filter_map(Weak::upgrade) {
            let events = &mut inbox.borrow_mut().events;
            events.monitors_changed |= monitors;
            events.windows_changed |= windows;
        }
    }

    /// Deals with what the window system has sent; waits up to `timeout` for something to come.
    pub fn turn(&mut self, timeout: Duration) -> Result<()> {
        self.pump(timeout, &mut Handler { windows: &self.windows.clone(), action: None::<fn(&ActiveEventLoop)> })?;
        #[cfg(all(unix, not(any(target_vendor = "apple", target_os = "android"))))]
        if let Some(wayland) = &mut self.wayland {
            let changed = wayland.changes()?;
            self.tell(changed, false);
        }
        if let Some(x11) = &self.x11 {
            let changes = x11.changes()?;
            self.tell(changes.monitors, changes.windows);
        }
        Ok(())
    }

    /// The own connection to the X server, where the window system is one.
    pub(super) fn x11(&self) -> Option<Rc<X11>> {
        self.x11.clone()
    }

    /// From now on, events of window `id` go into `inbox`.
    pub(super) fn watch(&mut self, id: WindowId, inbox: &Rc<RefCell<Inbox>>) {
        self.windows.insert(id, Rc::downgrade(inbox));
    }

    /// Does `action` where winit lets windows be made: inside its event loop.
    pub(super) fn with_event_loop<T>(&mut self, action: impl FnOnce(&ActiveEventLoop) -> T) -> Result<T> {
        let mut outcome = None;
        let windows = self.windows.clone();
        let mut handler = Handler {
            windows: &windows,
            action: Some(|event_loop: &ActiveEventLoop| outcome = Some(action(event_loop))),
        };
        // The loop calls `about_to_wait` once in each turn.
        self.pump(Duration::ZERO, &mut handler)?;
        if handler.action.is_some() {
            self.pump(TURN, &mut handler)?;
        }
        drop(handler);
        outcome.ok_or_else(|| Error::Display { what: "the window system's event loop does not turn".into() })
    }

    fn pump<F: FnOnce(&ActiveEventLoop)>(&mut self, timeout: Duration, handler: &mut Handler<'_, F>) -> Result<()> {
        match self.event_loop.pump_app_events(Some(timeout), handler) {
            PumpStatus::Continue => Ok(()),
            PumpStatus::Exit(code) => {
                Err(Error::Display { what: format!("the window system ended the connection (code {code})") })
            }
        }
    }
}

/// A monitor as winit describes it, with its EDID from the kernel; neither knows its scan-out.
fn monitor_of(index: usize, handle: &MonitorHandle, primary: bool) -> Monitor {
    let (size, position) = (handle.size(), handle.position());
    let name = name_of(handle).unwrap_or_else(|| format!("monitor-{index}"));
    Monitor {
        index,
        edid: kernel::edid(&name, (size.width, size.height)),
        name,
        width: size.width,
        height: size.height,
        x: position.x,
        y: position.y,
        refresh: handle.refresh_rate_millihertz().map(|rate| f64::from(rate) / 1e3),
        // A window on Windows has the monitor's own pixels, whatever the desktop's scale.
        scale: if cfg!(windows) { 1.0 } else { handle.scale_factor() },
        primary,
        scan_out: None,
        parts: Vec::new(),
    }
}

/// What a monitor is called: `DISPLAY1` where Windows says `\\.\DISPLAY1`.
pub(super) fn name_of(handle: &MonitorHandle) -> Option<String> {
    let name = handle.name()?;
    Some(name.strip_prefix(r"\\.\").map(str::to_owned).unwrap_or(name))
}

struct Handler<'a, F> {
    windows: &'a HashMap<WindowId, Weak<RefCell<Inbox>>>,
    action: Option<F>,
}

impl<F: FnOnce(&ActiveEventLoop)> ApplicationHandler for Handler<'_, F> {
    fn resumed(&mut self, _: &ActiveEventLoop) {}

    fn window_event(&mut self, _: &ActiveEventLoop, id: WindowId, event: WindowEvent) {
        let Some(inbox) = self.windows.get(&id).and_then(Weak::upgrade) else { return };
        let mut inbox = inbox.borrow_mut();
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => inbox.events.end = true,
            WindowEvent::RedrawRequested => inbox.events.redraw = true,
            WindowEvent::ModifiersChanged(modifiers) => inbox.modifiers = modifiers.state(),
            WindowEvent::KeyboardInput {
                event: KeyEvent { logical_key, state: ElementState::Pressed, .. }, ..
            } => {
                if ends(&logical_key, inbox.modifiers) {
                    inbox.events.end = true;
                } else if let Some(press) = KeyPress::of(&logical_key, inbox.modifiers)
                    && inbox.keys.len() < MOST_KEYS
                {
                    inbox.keys.push(press);
                }
            }
            WindowEvent::ScaleFactorChanged { mut inner_size_writer, .. } => {
                // Unless told otherwise, winit resizes the window to keep its size in scaled pixels.
                let (width, height) = inbox.size;
                if inner_size_writer.request_inner_size(PhysicalSize::new(width, height)).is_err() {
                    inbox.events.windows_changed = true;
                }
                inbox.events.monitors_changed = true;
            }
            WindowEvent::Occluded(_) | WindowEvent::Moved(_) | WindowEvent::Resized(_) => {
                inbox.events.monitors_changed = true;
                inbox.events.windows_changed = true;
            }
            _ => {}
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        if let Some(action) = self.action.take() {
            action(event_loop);
        }
    }
}

/// An error of the window system's library without the place in its source that it begins with.
fn plain(said: &str) -> &str {
    let found = said.match_indices(".rs:").last().and_then(|(at, mark)| said[at + mark.len()..].split_once(": "));
    let words = found.filter(|(line, _)| line.parse::<u32>().is_ok()).map_or(said, |(_, words)| words);
    words.trim_end_matches('.')
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn places_in_sources_are_left_off() {
        let said =
            "os error at /root/.cargo/winit-0.30/src/linux/mod.rs:765: neither DISPLAY nor WAYLAND_DISPLAY is set.";
        assert_eq!(plain(said), "neither DISPLAY nor WAYLAND_DISPLAY is set");
        assert_eq!(plain("no display: gone"), "no display: gone");
    }
}
