//! Frames on a real monitor.

use super::args::{Ahead, PanelArgs, ShowArgs};
use super::panel_command::Ready;
use super::report::{Report, count, seconds};
use crate::display::{
    self, Display, DisplayFrame, FrameTime, PlayReport, PlaySettings, Presenter, ShowSettings, WindowSettings,
};
use crate::panel::{Frame, Setup};
use crate::progress::Progress;
use crate::{Error, Result};
use std::collections::VecDeque;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Frames whose times a report holds: the last ones.
const MOST_TIMES: usize = 100_000;

/// A monitor that is there, and how frames are shown on it.
pub(super) struct Screen {
    display: Display,
    settings: ShowSettings,
    ahead: usize,
    /// Where each frame's times are written.
    events: Option<PathBuf>,
    /// The panel's second channel; put back when the frames have been shown.
    _ready: Ready,
}

impl Screen {
    /// The monitor that the flags name, if they name one.
    pub(super) fn asked(args: &ShowArgs, setup: &Setup) -> Result<Option<Self>> {
        let Some(settings) = show_settings(args)? else { return Ok(None) };
        let ahead = match args.sequence.ahead {
            Ahead::Frames(count) => count,
            // They are made before the first is shown.
            Ahead::All => 1,
        };
        Ok(Some(Self { ahead, events: args.sequence.events.clone(), ..Self::find(settings, &args.panel, setup)? }))
    }

    /// The monitor of that name, for frames with exact levels.
    pub(super) fn named(name: &str, panel: &PanelArgs, setup: &Setup) -> Result<Self> {
        Self::find(ShowSettings::new(name.parse()?), panel, setup)
    }

    fn find(settings: ShowSettings, panel: &PanelArgs, setup: &Setup) -> Result<Self> {
        let mut display = Display::connect()?;
        settings.monitor.find(&display.monitors()?)?;
        Ok(Self { display, settings, ahead: 2, events: None, _ready: Ready::make(panel, setup)? })
    }

    /// How frames in time are played here: at the monitor's own rate, on a panel that settles at once. They end with the last
    /// frame, unless that is to stay.
    pub(super) fn play_settings(&self) -> PlaySettings {
        let show = ShowSettings { hold: Some(self.settings.hold.unwrap_or_default()), ..self.settings.clone() };
        PlaySettings { show, rate: None, ahead: self.ahead, settle: 0.0, making: None }
    }

    /// Shows frames one after another, each for `hold`, and reports when each was there.
    pub(super) fn play(
        mut self,
        frames: impl Iterator<Item = Result<Frame>> + Send,
        hold: Duration,
        progress: &Progress,
        report: &mut Report,
    ) -> Result<()> {
        let mut settings = PlaySettings { rate: Some(1.0 / hold.as_secs_f64()), ..self.play_settings() };
        settings.show.hold = Some(hold);
        let packed = frames.map(|frame| DisplayFrame::packed(&[&frame?]));
        let mut times = Vec::new();
        let played = display::play(&mut self.display, packed, &settings, &mut |time| times.push(*time), progress)?;
        let PlayReport { window, times: counts } = &played;
        report.warn(window.warnings.iter());
        report.add_serialised("times", &times, "");
        let line =
            format!("shown on {}: {} frames, {} refreshes late", window.monitor.name, window.frames, counts.missed);
        report.add_serialised("display", &played, line);
        played.window.end.as_asked()
    }

    /// Plays frames in time.
    pub(super) fn sequence<F: Into<Arc<DisplayFrame>>>(
        mut self,
        frames: impl Iterator<Item = Result<F>> + Send,
        settings: &PlaySettings,
        progress: &Progress,
        report: &mut Report,
    ) -> Result<()> {
        let events = self.events.as_ref();
        let mut events =
            events.map(|path| Ok((path, std::fs::File::create(path).map_err(Error::io(path))?))).transpose()?;
        let (mut times, mut unwritten) = (VecDeque::new(), None);
        let mut told = |time: &FrameTime| {
            // A loop may run for days.
            if times.len() == MOST_TIMES {
                times.pop_front();
            }
            times.push_back(*time);
            if let Some((path, file)) = &mut events {
                let line = serde_json::to_string(time).unwrap_or_default() + "\n";
                if let Err(source) = file.write_all(line.as_bytes()) {
                    unwritten.get_or_insert(Error::Io { path: path.to_path_buf(), source });
                }
            }
        };
        let played = display::play(&mut self.display, frames, settings, &mut told, progress)?;
        let PlayReport { window, times: counts } = &played;
        report.warn(window.warnings.iter());
        report.warn(unwritten.iter());
        report.add_serialised("times", &times, "");
        report.add("settle", settings.settle, "");
        report.add_serialised("ready_to_presented", &counts.waiting, "");
        let line = format!(
            "played on {} by {}: {} frames, {:.2} a second; {} refreshes late, {} frames not made in time, {} replaced before \
             the panel had settled",
            window.monitor.name,
            window.adapter.as_deref().unwrap_or("the processor"),
            count(window.frames as usize),
            if counts.mean_interval > 0.0 { 1.0 / counts.mean_interval } else { 0.0 },
            counts.missed,
            counts.starved,
            counts.unsettled,
        );
        report.add_serialised("display", &played, line);
        let ([median, longest], [presenting, slowest]) = (counts.waiting, counts.presenting);
        let line = format!(
            "frame ready to presented: median {}, longest {}; handed over to presented: median {}, longest {}",
            seconds(median),
            seconds(longest),
            seconds(presenting),
            seconds(slowest)
        );
        report.add("frames", window.frames, line);
        played.window.end.as_asked()
    }

    /// Shows the frames (several where the panel's packing carries them) until the time is over, Esc, or Ctrl-C.
    pub(super) fn show(mut self, frames: &[&Frame], progress: &Progress, report: &mut Report) -> Result<()> {
        let picture = DisplayFrame::packed(frames)?;
        let shown = display::show(&mut self.display, picture, &self.settings, progress)?;
        let window = &shown.window;
        report.warn(window.warnings.iter());
        let line = format!(
            "shown on {} by {} for {}; first frame after {}",
            window.monitor.name,
            window.adapter.as_deref().unwrap_or("the processor"),
            seconds(shown.shown),
            seconds(window.first_presented)
        );
        report.add_serialised("display", &shown, line);
        shown.window.end.as_asked()
    }
}

/// Where and how frames are shown, if the flags name a monitor.
pub(super) fn show_settings(args: &ShowArgs) -> Result<Option<ShowSettings>> {
    let Some(name) = &args.monitor else { return Ok(None) };
    let hold = match args.hold {
        Some(hold) if hold.is_finite() && (0.0..1e9).contains(&hold) => Some(Duration::from_secs_f64(hold)),
        Some(hold) => return Err(Error::out_of_range("hold", hold, "must be 0 to 1e9 seconds")),
        None => None,
    };
    let window = window_settings(args.present, args.allow_altered_levels, args.trigger_patch.as_deref())?;
    Ok(Some(ShowSettings { window, hold, on_absence: args.on_absence, ..ShowSettings::new(name.parse()?) }))
}

/// How a panel's window is made.
pub(super) fn window_settings(presenter: Presenter, altered: bool, trigger: Option<&str>) -> Result<WindowSettings> {
    let trigger = trigger.map(str::parse).transpose()?;
    Ok(WindowSettings { presenter, exact: !altered, trigger, ..WindowSettings::default() })
}
