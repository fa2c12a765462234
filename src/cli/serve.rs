//! `serve`: keeps the panel and shows on it what other programs send.

use super::args::{ServeArgs, ServedLevelsArg};
use super::bar::Bar;
use super::load::{Panel, panel, panel_correction};
use super::report::{Report, seconds};
use holodrive::panel::{Frame, Modulation};
use holodrive::progress::Progress;
use holodrive::serve::{
    self, Driver, KeepReport, KeepSettings, Output, ServeSettings, ServedPanel, Server, SimulatedOutput,
};
use holodrive::units::show_length;
use holodrive::{Error, Result, files};
use serde_json::json;
use std::io::Write;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The usual ports of slmsuite and slmPy.
const USUAL: (u16, u16) = (5025, 9999);

/// Serves until Ctrl-C, or Esc on the panel.
pub(super) fn serve(args: &ServeArgs, json: bool) -> Result<Report> {
    let mut report = Report::new("serve");
    if let Some(path) = &args.write_python {
        files::write_bytes(path, serve::PYTHON.as_bytes())?;
        report.add("python", path.display().to_string(), format!("wrote {}", path.display()));
        return Ok(report);
    }
    let Some(monitor) = &args.monitor else {
        let what = "which one is the panel's? See `holodrive monitors`; `none` serves the simulated panel";
        return Err(Error::parameter("--monitor", what));
    };
    if monitor == "none" && args.trigger_patch.is_some() {
        return Err(Error::parameter("--trigger-patch", "the simulated panel has no corner that a photodiode sees"));
    }
    let panel = panel(&args.panel, &mut report)?;
    let correction = panel_correction(&panel, args.correction.as_deref(), &mut report)?;
    report.warn(panel.profile.drive_curve(panel.wavelength)?.1);
    let driver = Driver::new(&panel.profile, panel.wavelength, correction)?;
    let idle = idle_frame(&args.idle, &panel, &driver, &mut report)?;
    let served = driver.served(&name(args, &panel)?);
    let settings = settings(args, &served, &mut report)?;
    let bar = Bar::new();
    let job = Job { args, json, driver: &driver, idle: &idle, served, settings, progress: &bar.progress };
    let kept = if monitor == "none" { job.simulated()? } else { job.on_monitor(monitor, &mut report)? };
    let KeepReport { shown, failed, missed, .. } = kept;
    report.add_serialised(
        "served",
        &kept,
        format!(
            "{shown} frames shown, {failed} refused, {missed} refreshes missed; from arrival to flip {} on average, {} at most",
            seconds(kept.latency.mean),
            seconds(kept.latency.longest)
        ),
    );
    Ok(report)
}

/// A level, or a picture of levels.
fn idle_frame(text: &str, panel: &Panel, driver: &Driver, report: &mut Report) -> Result<Frame> {
    if let Ok(level) = text.parse::<u16>() {
        return driver.flat(level).map_err(|_| {
            let highest = panel.profile.levels() - 1;
            Error::parameter("--idle", format!("{level} is above {highest}, the panel's highest level"))
        });
    }
    let (frame, warnings) = Frame::read(Path::new(text), Some(&panel.profile), Some(panel.wavelength))?;
    report.warn(warnings);
    Ok(frame)
}

fn name(args: &ServeArgs, panel: &Panel) -> Result<String> {
    let name = args.name.clone().unwrap_or_else(|| panel.profile.name.clone());
    // It becomes a part of a file's name.
    let fits = |c: char| !c.is_control() && !matches!(c, '/' | '\\' | '\'' | '"');
    if name.is_empty() || name.len() > 64 || name.starts_with('.') || !name.chars().all(fits) {
        return Err(Error::parameter("--name", format!("`{name}` is no name of up to 64 letters, digits and marks")));
    }
    Ok(name)
}

fn settings(args: &ServeArgs, served: &ServedPanel, report: &mut Report) -> Result<ServeSettings> {
    let calibrated = args.levels == ServedLevelsArg::Calibrated;
    if calibrated && served.modulation == Modulation::Amplitude {
        let what = "calibrated levels stand for phases, and this panel modulates amplitude; leave it at final";
        return Err(Error::parameter("--levels", what));
    }
    let none = args.slmsuite.is_none() && args.slmpy.is_none() && args.local.is_none();
    let at = |port: u16| SocketAddr::new(args.listen, port);
    let local = match &args.local {
        Some(Some(path)) => Some(path.clone()),
        Some(None) => usual_socket(&served.name),
        None if none => usual_socket(&served.name),
        None => None,
    };
    if !args.listen.is_loopback() {
        report.warn([format!(
            "listening on {}: neither protocol asks who sends; every machine that reaches this one can write on the panel",
            args.listen
        )]);
    }
    let slmpy = args.slmpy.or(none.then_some(USUAL.1)).map(at);
    if served.bits > 8 && slmpy.is_some() {
        report.warn([format!(
            "slmPy sends 8 bits: of the panel's {} levels, 256 can be reached by it",
            1 << served.bits
        )]);
    }
    Ok(ServeSettings {
        slmsuite: args.slmsuite.or(none.then_some(USUAL.0)).map(at),
        slmpy,
        local,
        calibrated,
        settle: Duration::from_secs_f64(if args.settle { served.settle_time.max(0.0) } else { 0.0 }),
        ..ServeSettings::default()
    })
}

#[cfg(unix)]
fn usual_socket(name: &str) -> Option<PathBuf> {
    Some(serve::local::runtime_folder().join(format!("{name}.sock")))
}

#[cfg(not(unix))]
fn usual_socket(_: &str) -> Option<PathBuf> {
    None
}

/// All that serving needs but the output.
struct Job<'a> {
    args: &'a ServeArgs,
    json: bool,
    driver: &'a Driver,
    idle: &'a Frame,
    served: ServedPanel,
    settings: ServeSettings,
    progress: &'a Progress,
}

impl Job<'_> {
    fn simulated(&self) -> Result<KeepReport> {
        let server = Server::start(self.served.clone(), &self.settings)?;
        let mut output = SimulatedOutput::new(self.args.output.as_deref(), self.idle)?;
        self.keep(&server, &mut output, "the simulated panel")
    }

    #[cfg(feature = "display")]
    fn on_monitor(&self, monitor: &str, report: &mut Report) -> Result<KeepReport> {
        use super::screen::window_settings;
        use holodrive::display::{Display, DisplayFrame, OnAbsence, PanelLoop, ShowEnd, ShowSettings};
        if self.args.output.is_some() {
            let what = "frames are written on the simulated panel only; give --monitor none, or leave it out";
            return Err(Error::parameter("--output", what));
        }
        let settings = ShowSettings {
            window: window_settings(
                self.args.present,
                self.args.allow_altered_levels,
                self.args.trigger_patch.as_deref(),
            )?,
            on_absence: OnAbsence::Wait,
            ..ShowSettings::new(monitor.parse()?)
        };
        let mut display = Display::connect()?;
        settings.monitor.find(&display.monitors()?)?;
        // A port that is taken is found out before the panel shows anything.
        let server = Server::start(self.served.clone(), &self.settings)?;
        let idle = std::sync::Arc::new(DisplayFrame::packed(&[self.idle])?);
        let mut output = PanelLoop::open(&mut display, &idle, &settings, self.progress)?;
        report.warn(output.panel().warnings().iter());
        let place = output.panel().monitor().name.clone();
        let kept = self.keep(&server, &mut output, &place)?;
        let window = output.close(ShowEnd::Stopped)?;
        report.add_serialised("monitor", &window.monitor, "");
        report.add("covered", window.covered, "");
        Ok(kept)
    }

    #[cfg(not(feature = "display"))]
    fn on_monitor(&self, _: &str, _: &mut Report) -> Result<KeepReport> {
        let what =
            "this build has no display: give --monitor none, or build it with the feature `display` (the default)";
        Err(Error::unsupported(what))
    }

    fn keep(&self, server: &Server, output: &mut dyn Output, place: &str) -> Result<KeepReport> {
        self.tell(server, place)?;
        let on_client_gone = self.args.on_client_gone;
        serve::keep(server, output, (self.driver, self.idle), KeepSettings { on_client_gone }, self.progress)
    }

    /// Says where clients come in: at once, since the report comes only at the end.
    fn tell(&self, server: &Server, place: &str) -> Result<()> {
        let ServedPanel { name, width, height, bits, wavelength, .. } = &self.served;
        let (slmsuite, slmpy, local) = (server.slmsuite(), server.slmpy(), server.local());
        let text = if self.json {
            json!({ "serving": {
                "name": name,
                "on": place,
                "width": width,
                "height": height,
                "bits": bits,
                "wavelength": wavelength,
                "slmsuite": slmsuite,
                "slmpy": slmpy,
                "local": local,
            }})
            .to_string()
        } else {
            let mut text = format!(
                "serving {name}, {width}x{height} px of {bits} bits at {}, on {place}",
                show_length(*wavelength)
            );
            if let Some(at) = slmsuite {
                text += &format!("\n  slmsuite  {at}  RemoteSLM(\"{name}\", host=\"{}\", port={})", at.ip(), at.port());
            }
            if let Some(at) = slmpy {
                text += &format!("\n  slmPy     {at}");
            }
            if let Some(at) = local {
                text += &format!("\n  local     {}  holodrive.SLM(\"{name}\")", at.display());
            }
            text
        };
        let mut out = std::io::stdout();
        match writeln!(out, "{text}").and_then(|()| out.flush()) {
            // A reader that has gone needs no line; the panel is served all the same.
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
            other => other.map_err(|source| Error::Io { path: "standard output".into(), source }),
        }
    }
}
