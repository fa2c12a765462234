//! The panel as a second screen: these levels, on that monitor, now.
//!
//! [`Display`] is the connection to the window system. [`Display::monitors`] lists what there is; [`MonitorChoice`]
//! names one by connector, EDID, serial number or place. [`PanelWindow`] covers one monitor exactly and keeps it so;
//! [`OperatorWindow`] is an ordinary window beside it, never on the panel's monitor. [`PanelLoop`] is the event loop of both:
//! [`show`] runs it for one frame, [`play`] for a sequence of them, and [`crate::serve::keep`] for what other programs send.
//! [`examine`] looks at everything that is known to spoil levels, and [`test_card`] shows it to an eye.
//!
//! # What is promised
//!
//! A frame is shown as it is: 8 bits of red, green and blue, one frame pixel on each monitor pixel, without gamma,
//! blending, dithering or scaling on the way to the frame buffer. Before it shows anything it is made sure, as far as
//! the window system tells, that the monitor has exactly the frame's size, is neither scaled, rotated nor mirrored, and that
//! the graphics card's gamma table is the identity; else it is refused in words that say what to change. What happens
//! behind the frame buffer (limited-range RGB, dithering in the card's output stage, overscan in the monitor) cannot
//! be seen from here.
//!
//! On X11 all of this is checked. On Windows it is, too, and that HDR is off; a desktop that is scaled there does no harm, since the
//! window asks for the monitor's own pixels. On Wayland size, scale and rotation are checked; gamma tables and what else alters
//! colours cannot be asked for. On other systems, what winit tells is checked.
//!
//! ```
//! use holodrive::display::{DisplayFrame, MonitorChoice};
//! use holodrive::panel::{Frame, PanelProfile};
//!
//! let panel = PanelProfile::find("generic")?;
//! let levels = (0..panel.width * panel.height).map(|i| (i % 256) as u16).collect();
//! let frame = DisplayFrame::packed(&[&Frame::new(&panel, 532e-9, levels)?])?;
//! // An 8-bit level goes to all three colours of its pixel.
//! assert_eq!((frame.width(), frame.height(), frame.pixels()[75]), (1920, 1080, [75; 3]));
//! let choice: MonitorChoice = "serial:6010-0042".parse()?;
//! assert_eq!(choice, MonitorChoice::Serial("6010-0042".into()));
//! # Ok::<(), holodrive::Error>(())
//! ```

mod choice;
mod doctor;
mod edid;
mod frame;
mod frame_times;
mod kernel;
mod keys;
mod monitor;
mod native;
mod operator;
mod panel_loop;
mod play;
mod presenter;
mod rectangle;
mod region;
mod serving;
mod session;
mod show;
mod taken;
mod test_card;
mod trigger;
mod vblank;
#[cfg(all(unix, not(any(target_vendor = "apple", target_os = "android"))))]
mod wayland;
#[cfg(windows)]
mod win32;
mod window;
mod x11;

pub use choice::MonitorChoice;
pub use doctor::{Finding, Severity, examine};
pub use edid::{Edid, NativeMode};
pub use frame::DisplayFrame;
pub use frame_times::{FrameStatistics, FrameTime};
pub use keys::{Key, KeyPress};
pub use monitor::{Gamma, Monitor, ScanOut};
pub use operator::{OperatorChoice, OperatorWindow};
pub use panel_loop::{OnAbsence, PanelLoop, ShowEnd, ShowSettings, Turn, WindowReport};
pub use play::{PlayReport, PlaySettings, play};
pub use presenter::Presenter;
pub use session::Display;
pub use show::{ShowReport, show};
pub use test_card::test_card;
pub use trigger::TriggerPatch;
pub use window::{PanelWindow, Presented, Standing, WindowSettings};
