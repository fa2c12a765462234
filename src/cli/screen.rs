//! A frame on a real monitor.

use super::args::{PresenterArg, ShowArgs};
use super::report::{Report, seconds};
use holodrive::display::{
    self, Display, DisplayFrame, MonitorChoice, OnAbsence, PlaySettings, Presenter, ShowEnd, ShowSettings,
    WindowSettings,
};
use holodrive::panel::Frame;
use holodrive::progress::Progress;
use holodrive::{Error, Result};
use std::sync::Arc;
use std::time::Duration;

/// The monitor that the user named, found.
pub(super) struct Screen {
    display: Display,
    choice: MonitorChoice,
}

impl Screen {
    /// Finds it among those that are there.
    pub(super) fn find(name: &str) -> Result<Self> {
        let choice: MonitorChoice = name.parse()?;
        let mut display = Display::connect()?;
        choice.find(&display.monitors()?)?;
        Ok(Self { display, choice })
    }

    /// Shows frames one after another, each for `hold`, and reports when each was there.
    pub(super) fn play(
        mut self,
        frames: impl Iterator<Item = Result<Frame>> + Send,
        hold: Duration,
        progress: &Arc<Progress>,
        report: &mut Report,
    ) -> Result<()> {
        let packed = frames.map(|frame| {
            let frame = frame?;
            packed(&[&frame])
        });
        let settings = PlaySettings {
            monitor: self.choice.clone(),
            window: WindowSettings::default(),
            rate: Some(1.0 / hold.as_secs_f64()),
            hold: Some(hold),
            ahead: 2,
            on_absence: OnAbsence::End,
        };
        let mut times = Vec::new();
        let played = display::play(&mut self.display, packed, &settings, &mut |time| times.push(*time), progress)?;
        report.warn(played.warnings.iter());
        report.add_serialised("times", &times, "");
        report.add_serialised(
            "display",
            &played,
            format!("shown on {}: {} frames, {} refreshes late", played.monitor.name, played.frames, played.missed),
        );
        match played.end {
            ShowEnd::Absent { why } => Err(Error::Display { what: why }),
            ShowEnd::Held | ShowEnd::Closed | ShowEnd::Stopped => Ok(()),
        }
    }

    /// Shows the frames (several where the panel's packing carries them) as it says, until the time is over, Esc, or Ctrl-C.
    pub(super) fn show(
        mut self,
        frames: &[&Frame],
        args: &ShowArgs,
        progress: &Arc<Progress>,
        report: &mut Report,
    ) -> Result<()> {
        let hold = match args.hold {
            Some(hold) if hold.is_finite() && (0.0..1e9).contains(&hold) => Some(Duration::from_secs_f64(hold)),
            Some(hold) => return Err(Error::parameter("hold", format!("{hold} is not a number of seconds"))),
            None => None,
        };
        let picture = packed(frames)?;
        let presenter = match args.present {
            PresenterArg::Auto => Presenter::Auto,
            PresenterArg::Gpu => Presenter::Gpu,
            PresenterArg::Software => Presenter::Software,
        };
        let settings = ShowSettings {
            monitor: self.choice.clone(),
            window: WindowSettings { presenter, exact: !args.allow_altered_levels, ..WindowSettings::default() },
            hold,
            on_absence: OnAbsence::End,
        };
        let shown = display::show(&mut self.display, picture, &settings, progress)?;
        report.warn(shown.warnings.iter());
        report.add_serialised(
            "display",
            &shown,
            format!(
                "shown on {} by {} for {}; first frame after {}",
                shown.monitor.name,
                shown.adapter.as_deref().unwrap_or("the processor"),
                seconds(shown.shown),
                seconds(shown.first_presented)
            ),
        );
        match shown.end {
            ShowEnd::Absent { why } => Err(Error::Display { what: why }),
            ShowEnd::Held | ShowEnd::Closed | ShowEnd::Stopped => Ok(()),
        }
    }
}

/// Frames in the video signal of their panel.
fn packed(frames: &[&Frame]) -> Result<DisplayFrame> {
    let Some(first) = frames.first() else { return Err(Error::parameter("frame", "there is none to show")) };
    let signal = first.metadata.panel.signal.pack(frames)?;
    let pixels = signal.rgb.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    DisplayFrame::from_rgb(signal.width as u32, signal.height as u32, pixels)
}
