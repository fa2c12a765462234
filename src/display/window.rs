//! A window that covers one monitor exactly, one window pixel on each monitor pixel, and never any other.

use super::choice::MonitorChoice;
use super::frame::DisplayFrame;
use super::keys::KeyPress;
use super::monitor::Monitor;
use super::native::NativeWindow;
use super::presenter::{Presenter, Surface};
use super::session::{Display, name_of};
use super::taken::Taken;
use super::trigger::TriggerPatch;
use super::vblank::VerticalBlank;
use crate::error::{Error, Result};
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::dpi::{PhysicalPosition, PhysicalSize};
use winit::event_loop::ActiveEventLoop;
use winit::window::{Fullscreen, Window, WindowAttributes, WindowLevel};

/// Assumed of a monitor that does not tell its refresh rate [Hz].
const USUAL_REFRESH: f64 = 60.0;
/// Refresh rates that a monitor may have [Hz].
const REFRESH_RATES: std::ops::RangeInclusive<f64> = 1.0..=1e4;
/// How long it must have stood there before it counts as settled: window managers move a window just after it appears.
const SETTLED: Duration = Duration::from_millis(50);

/// How a panel's window is made and held.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WindowSettings {
    /// Who puts frames into it.
    pub presenter: Presenter,
    /// Whether a monitor on which levels would be altered is refused. If not, [`PanelWindow::warnings`] tells.
    pub exact: bool,
    /// Whether the window takes the keyboard, so that Esc, Q or Ctrl+C in it ends the show.
    pub take_keyboard: bool,
    /// A corner that toggles with every frame, if one should.
    pub trigger: Option<TriggerPatch>,
}

impl Default for WindowSettings {
    fn default() -> Self {
        Self { presenter: Presenter::Auto, exact: true, take_keyboard: true, trigger: None }
    }
}

/// A frame that has been handed to the window system.
#[derive(Clone, Copy, Debug)]
pub struct Presented {
    /// Running number of the frame in its window, from 0. A frame drawn again after it was uncovered keeps its own.
    pub number: u64,
    /// When the window system had taken it.
    pub at: Instant,
    /// False when the window system would not take it (window hidden or monitor off): it is not on the panel.
    pub taken: bool,
}

/// How it stands with a window.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Standing {
    /// The last frame is on its monitor.
    Shown,
    /// The monitor is gone or has changed; the window is closed until it is back as it was.
    Absent {
        /// What happened.
        why: String,
    },
    /// A key pressed in the window, or its being closed, ends the show.
    Ended,
}

/// A window on exactly one monitor.
///
/// On X11 it is kept out of the window manager's hands (override-redirect): nothing resizes it, moves it to another
/// monitor when its own is unplugged, or hides it with a workspace; whatever is raised above it is covered again.
/// Elsewhere it is a borderless fullscreen window.
pub struct PanelWindow {
    open: Option<Open>,
    monitor: Monitor,
    settings: WindowSettings,
    last: Arc<DisplayFrame>,
    frames: u64,
    covered: u64,
    absent: Option<String>,
    warnings: Vec<String>,
    _taken: Taken,
}

/// The parts that exist only while the monitor is there. The surface goes before the window that it draws into.
struct Open {
    surface: Surface,
    native: NativeWindow,
    background: bool,
    blank: Option<VerticalBlank>,
}

impl PanelWindow {
    /// Opens a window on the monitor that is meant, with `first` on it from the first instant where the window system
    /// can do that (X11).
    ///
    /// # Errors
    ///
    /// [`Error::Display`] when there is no such monitor, `first` is not exactly of its size, levels would be altered
    /// on the way (and [`WindowSettings::exact`] is set), the window does not come to stand where it belongs, or nothing can
    /// draw into it.
    pub fn open(
        display: &mut Display,
        choice: &MonitorChoice,
        first: &Arc<DisplayFrame>,
        settings: &WindowSettings,
    ) -> Result<Self> {
        let monitors = display.monitors()?;
        let monitor = choice.find(&monitors)?;
        let taken = Taken::new(&monitor)?;
        let first = marked(first, settings.trigger, 0)?;
        let (open, warnings) = Open::new(display, &monitor, &first, settings)?;
        Ok(Self {
            open: Some(open),
            monitor,
            settings: settings.clone(),
            last: first,
            frames: 1,
            covered: 0,
            absent: None,
            warnings,
            _taken: taken,
        })
    }

    /// The monitor that it is on.
    pub fn monitor(&self) -> &Monitor {
        &self.monitor
    }

    /// Time of one refresh of its monitor [s].
    pub(super) fn refresh_time(&self) -> f64 {
        1.0 / self.monitor.refresh.filter(|rate| REFRESH_RATES.contains(rate)).unwrap_or(USUAL_REFRESH)
    }

    /// Who puts frames into it: [`Presenter::Gpu`] or [`Presenter::Software`]; none while its monitor is absent.
    pub fn presenter(&self) -> Option<Presenter> {
        self.open.as_ref().map(|open| open.surface.presenter())
    }

    /// The graphics adapter at work, if one is.
    pub fn adapter(&self) -> Option<String> {
        self.open.as_ref().and_then(|open| open.surface.adapter()).map(str::to_owned)
    }

    /// Frames handed over so far.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// How often another window had come above and was covered again.
    pub fn covered(&self) -> u64 {
        self.covered
    }

    /// Keys pressed in it since the last call, beside those that end the show.
    pub fn keys(&self) -> Vec<KeyPress> {
        self.open.as_ref().map(|open| open.native.keys()).unwrap_or_default()
    }

    /// What alters levels on this monitor, where that was allowed.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Shows `frame` from now on. While the monitor is absent the frame is kept and shown when it is back.
    ///
    /// # Errors
    ///
    /// [`Error::Display`] when the frame is not of the monitor's size, or the window system refuses it.
    pub fn present(&mut self, frame: &Arc<DisplayFrame>) -> Result<Presented> {
        let frame = marked(frame, self.settings.trigger, self.frames)?;
        let taken = match &mut self.open {
            Some(open) => {
                let taken = open.surface.present(&frame)?;
                open.forget_background()?;
                taken
            }
            None => {
                check_size(&frame, &self.monitor)?;
                false
            }
        };
        self.last = frame;
        self.frames += 1;
        Ok(Presented { number: self.frames - 1, at: Instant::now(), taken })
    }

    /// Whether [`PanelWindow::wait_for_vertical_blank`] waits.
    pub(super) fn tells_vertical_blanks(&self) -> bool {
        self.open.as_ref().is_some_and(|open| open.blank.is_some())
    }

    /// Waits for the monitor's next vertical blank, if frames are not made to wait for it by the graphics card and the
    /// X server tells of it. Returns the server's count of them.
    pub(super) fn wait_for_vertical_blank(&mut self, limit: Duration) -> Result<Option<u64>> {
        match self.open.as_mut().and_then(|open| open.blank.as_mut()) {
            Some(blank) => blank.next(limit),
            None => Ok(None),
        }
    }

    /// Deals with what has happened to the window since the last call; call it after each [`Display::turn`].
    ///
    /// Draws the last frame again where it was uncovered, covers what was raised above it, closes the window when its monitor
    /// is gone or changed, and opens it again when it is back.
    pub fn attend(&mut self, display: &mut Display) -> Result<Standing> {
        let Some(open) = &mut self.open else { return self.come_back(display) };
        let events = open.native.events();
        if events.end {
            return Ok(Standing::Ended);
        }
        if events.monitors_changed
            && let Some(why) = self.misplaced(display)?
        {
            self.open = None;
            // The window is gone from the screen only once the server has been told.
            display.turn(Duration::ZERO)?;
            self.absent = Some(why.clone());
            return Ok(Standing::Absent { why });
        }
        let Some(open) = &mut self.open else { return Ok(Standing::Shown) };
        if events.windows_changed
            && let Some((x11, id)) = &open.native.x11
            && x11.keep_above(*id)?
        {
            self.covered += 1;
        }
        if events.redraw {
            open.surface.present(&self.last)?;
        }
        Ok(Standing::Shown)
    }

    /// Why the window does not stand on its monitor any more, if so.
    fn misplaced(&self, display: &mut Display) -> Result<Option<String>> {
        let name = &self.monitor.name;
        let monitors = display.monitors()?;
        let Some(now) = self.monitor.again(&monitors) else {
            return Ok(Some(format!("monitor {name} is gone")));
        };
        if now.rectangle() != self.monitor.rectangle() {
            return Ok(Some(format!("monitor {name} has changed: {now}")));
        }
        if self.settings.exact
            && let Some(fault) = now.faults().into_iter().next()
        {
            return Ok(Some(fault));
        }
        self.open.as_ref().map_or(Ok(None), |open| open.native.deviation(&self.monitor))
    }

    fn come_back(&mut self, display: &mut Display) -> Result<Standing> {
        let why = self.absent.clone().unwrap_or_default();
        let monitors = display.monitors()?;
        let size = (self.monitor.width, self.monitor.height);
        let back = self.monitor.again(&monitors).filter(|monitor| {
            (monitor.width, monitor.height) == size && (!self.settings.exact || monitor.faults().is_empty())
        });
        let Some(monitor) = back else { return Ok(Standing::Absent { why }) };
        match Open::new(display, &monitor, &self.last, &self.settings) {
            Ok((open, warnings)) => {
                (self.open, self.monitor, self.warnings, self.absent) = (Some(open), monitor, warnings, None);
                Ok(Standing::Shown)
            }
            // Desktops set a returning monitor up in several steps; what does not fit yet may fit at the next look.
            Err(Error::Display { what }) => {
                self.absent = Some(what.clone());
                Ok(Standing::Absent { why: what })
            }
            Err(other) => Err(other),
        }
    }
}

impl Open {
    fn new(
        display: &mut Display,
        monitor: &Monitor,
        first: &Arc<DisplayFrame>,
        settings: &WindowSettings,
    ) -> Result<(Self, Vec<String>)> {
        check_size(first, monitor)?;
        let faults = monitor.faults();
        if settings.exact && !faults.is_empty() {
            return Err(Error::Display { what: faults.join("; ") });
        }
        let on_x11 = display.x11().is_some();
        if !on_x11 && !monitor.parts.is_empty() {
            let what =
                "a region of the desktop, or several monitors at once, can be covered on X11 only; name one monitor";
            return Err(Error::Display { what: what.into() });
        }
        let Monitor { width, height, .. } = *monitor;
        let native =
            NativeWindow::create(display, width, height, |event_loop| attributes(event_loop, monitor, on_x11))?;
        native.window.set_cursor_visible(false);
        if let Some((x11, id)) = &native.x11 {
            x11.set_background(*id, first)?;
        }
        native.settle(display, SETTLED, |native| native.deviation(monitor))?;
        let mut surface = Surface::new(settings.presenter, &native.window, width, height)?;
        surface.present(first)?;
        let background = native.x11.is_some();
        // A server without the Present extension only leaves frames unsynchronised.
        let blank = match &native.x11 {
            Some((_, id)) if surface.presenter() == Presenter::Software => VerticalBlank::of_window(*id).ok(),
            _ => None,
        };
        let open = Self { surface, native, background, blank };
        #[cfg(windows)]
        super::win32::keep_awake(true);
        if let Some((x11, id)) = &open.native.x11 {
            x11.keep_awake(true)?;
            x11.keep_above(*id)?;
            if settings.take_keyboard {
                x11.focus(*id)?;
            }
        }
        Ok((open, faults))
    }

    fn forget_background(&mut self) -> Result<()> {
        if self.background
            && let Some((x11, id)) = &self.native.x11
        {
            x11.clear_background(*id)?;
            self.background = false;
        }
        Ok(())
    }
}

impl Drop for Open {
    fn drop(&mut self) {
        #[cfg(windows)]
        super::win32::keep_awake(false);
        if let Some((x11, _)) = &self.native.x11 {
            // A connection that is lost has taken the request with it.
            let _ = x11.keep_awake(false);
        }
    }
}

fn attributes(event_loop: &ActiveEventLoop, monitor: &Monitor, on_x11: bool) -> Result<WindowAttributes> {
    let attributes = Window::default_attributes()
        .with_title(format!("holodrive: {}", monitor.name))
        .with_position(PhysicalPosition::new(monitor.x, monitor.y))
        .with_inner_size(PhysicalSize::new(monitor.width, monitor.height))
        .with_decorations(false);
    if on_x11 {
        return Ok(unmanaged(attributes));
    }
    let handle = event_loop.available_monitors().find(|handle| name_of(handle).as_ref() == Some(&monitor.name));
    let Some(handle) = handle else {
        return Err(Error::Display { what: format!("monitor {} is gone", monitor.name) });
    };
    let fullscreen = Some(Fullscreen::Borderless(Some(handle)));
    Ok(attributes.with_fullscreen(fullscreen).with_window_level(WindowLevel::AlwaysOnTop))
}

#[cfg(all(unix, not(any(target_vendor = "apple", target_os = "android"))))]
fn unmanaged(attributes: WindowAttributes) -> WindowAttributes {
    winit::platform::x11::WindowAttributesExtX11::with_override_redirect(attributes, true)
}

#[cfg(not(all(unix, not(any(target_vendor = "apple", target_os = "android")))))]
fn unmanaged(attributes: WindowAttributes) -> WindowAttributes {
    attributes
}

fn check_size(frame: &DisplayFrame, monitor: &Monitor) -> Result<()> {
    if (frame.width(), frame.height()) == (monitor.width, monitor.height) {
        return Ok(());
    }
    let Monitor { name, width, height, .. } = monitor;
    Err(Error::Display {
        what: format!(
            "the frame is {}x{} px but monitor {name} shows {width}x{height}: frames are not scaled; set the monitor to the \
             panel's own mode, or choose the profile that fits",
            frame.width(),
            frame.height(),
        ),
    })
}

/// The frame with the corner that tells its number, where one is asked for.
fn marked(frame: &Arc<DisplayFrame>, trigger: Option<TriggerPatch>, number: u64) -> Result<Arc<DisplayFrame>> {
    let Some(trigger) = trigger else { return Ok(Arc::clone(frame)) };
    let mut marked = DisplayFrame::clone(frame);
    trigger.draw(&mut marked, number)?;
    Ok(Arc::new(marked))
}
