//! A frame on a real monitor.

use super::args::{AbsenceArg, PresenterArg, ShowArgs};
use super::report::{Report, count, seconds};
use super::sequence_args::Ahead;
use holodrive::display::{
    self, Display, DisplayFrame, FrameTime, MonitorChoice, OnAbsence, PlaySettings, Presenter, ShowEnd, ShowSettings,
    WindowSettings,
};
use holodrive::panel::Frame;
use holodrive::progress::Progress;
use holodrive::{Error, Result};
use std::collections::VecDeque;
use std::io::Write;
use std::sync::Arc;
use std::time::Duration;

/// Frames whose times a report holds: the last ones.
const MOST_TIMES: usize = 100_000;

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
            settle: 0.0,
            making: None,
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
        ended(played.end)
    }

    /// Plays frames in time as the flags say, at a rate [Hz], with the panel's settle time [s]; `making` is stopped at the
    /// end.
    pub(super) fn sequence<F: Into<Arc<DisplayFrame>>>(
        mut self,
        frames: impl Iterator<Item = Result<F>> + Send,
        args: &ShowArgs,
        (rate, settle, making): (Option<f64>, f64, Option<Arc<Progress>>),
        progress: &Progress,
        report: &mut Report,
    ) -> Result<()> {
        // A sequence ends with its last frame, unless it is told to keep that.
        let settings = PlaySettings {
            monitor: self.choice.clone(),
            window: window(args)?,
            rate,
            hold: Some(hold(args)?.unwrap_or_default()),
            ahead: match args.sequence.ahead {
                Ahead::Frames(count) => count,
                Ahead::All => 1,
            },
            on_absence: on_absence(args),
            settle,
            making,
        };
        let mut events = args
            .sequence
            .events
            .as_ref()
            .map(|path| Ok((path, std::fs::File::create(path).map_err(Error::io(path))?)))
            .transpose()?;
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
        let played = display::play(&mut self.display, frames, &settings, &mut told, progress)?;
        report.warn(played.warnings.iter());
        report.warn(unwritten.iter());
        report.add_serialised("times", &times, "");
        let waited: Vec<f64> = times.iter().map(|time| time.presented - time.ready).collect();
        report.add("settle", settle, "");
        report.add_serialised("ready_to_presented", &median_and_longest(waited.clone()), "");
        let [median, longest] = median_and_longest(waited);
        let line = format!(
            "played on {} by {}: {} frames, {:.2} a second; {} refreshes late, {} frames not made in time, {} replaced before \
             the panel had settled",
            played.monitor.name,
            played.adapter.as_deref().unwrap_or("the processor"),
            count(played.frames as usize),
            if played.mean_interval > 0.0 { 1.0 / played.mean_interval } else { 0.0 },
            played.missed,
            played.starved,
            played.unsettled,
        );
        report.add_serialised("display", &played, line);
        let line = format!(
            "frame ready to presented: median {}, longest {}; handed over to presented: median {}, longest {}",
            seconds(median),
            seconds(longest),
            seconds(played.presenting[0]),
            seconds(played.presenting[1])
        );
        report.add("frames", played.frames, line);
        ended(played.end)
    }

    /// Shows the frames (several where the panel's packing carries them) as it says, until the time is over, Esc, or Ctrl-C.
    pub(super) fn show(
        mut self,
        frames: &[&Frame],
        args: &ShowArgs,
        progress: &Arc<Progress>,
        report: &mut Report,
    ) -> Result<()> {
        let picture = packed(frames)?;
        let settings = ShowSettings {
            monitor: self.choice.clone(),
            window: window(args)?,
            hold: hold(args)?,
            on_absence: on_absence(args),
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
        ended(shown.end)
    }
}

/// Whether the end was one that was asked for.
fn ended(end: ShowEnd) -> Result<()> {
    match end {
        ShowEnd::Absent { why } => Err(Error::Display { what: why }),
        ShowEnd::Held | ShowEnd::Closed | ShowEnd::Stopped => Ok(()),
    }
}

pub(super) fn hold(args: &ShowArgs) -> Result<Option<Duration>> {
    match args.hold {
        Some(hold) if hold.is_finite() && (0.0..1e9).contains(&hold) => Ok(Some(Duration::from_secs_f64(hold))),
        Some(hold) => Err(Error::parameter("hold", format!("{hold} is not a number of seconds"))),
        None => Ok(None),
    }
}

pub(super) fn window(args: &ShowArgs) -> Result<WindowSettings> {
    let presenter = match args.present {
        PresenterArg::Auto => Presenter::Auto,
        PresenterArg::Gpu => Presenter::Gpu,
        PresenterArg::Software => Presenter::Software,
    };
    let trigger = args.trigger_patch.as_deref().map(str::parse).transpose()?;
    Ok(WindowSettings { presenter, exact: !args.allow_altered_levels, trigger, ..WindowSettings::default() })
}

/// Whether the show ends with the monitor.
pub(super) fn ends_when_absent(args: &ShowArgs) -> bool {
    on_absence(args) == OnAbsence::End
}

fn on_absence(args: &ShowArgs) -> OnAbsence {
    match args.on_absence {
        AbsenceArg::End => OnAbsence::End,
        AbsenceArg::Wait => OnAbsence::Wait,
    }
}

fn median_and_longest(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    [values.get(values.len() / 2).copied().unwrap_or(0.0), values.last().copied().unwrap_or(0.0)]
}

/// Frames in the video signal of their panel.
pub(super) fn packed(frames: &[&Frame]) -> Result<DisplayFrame> {
    let Some(first) = frames.first() else { return Err(Error::parameter("frame", "there is none to show")) };
    let signal = first.metadata.panel.signal.pack(frames)?;
    DisplayFrame::from_rgb(signal.width as u32, signal.height as u32, signal.rgb.as_chunks().0.to_vec())
}
