//! `serve`: keeps the panel and shows on it what other programs send.

use super::args::{ServeArgs, ServedLevelsArg};
use super::bar::Bar;
use super::report::{Report, seconds};
use super::resolve::{self, told_correction};
use crate::panel::{Frame, Modulation, Setup};
use crate::progress::Progress;
use crate::serve::{
    self, Announcement, Driver, KeepReport, KeepSettings, OnClientGone, Output, ServeSettings, ServedPanel, Server,
    SimulatedOutput,
};
use crate::units::show_length;
use crate::{Error, Result, files};
use serde_json::json;
use std::io::Write;
use std::net::SocketAddr;
use std::path::Path;
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
    let service = Service::resolve(args, json, &mut report)?;
    let bar = Bar::new();
    if args.until_stdin_closes {
        stop_at_the_end_of(std::io::stdin(), std::sync::Arc::clone(&bar.progress));
    }
    let kept = if monitor == "none" {
        let server = service.start()?;
        let mut output = SimulatedOutput::new(args.output.as_deref(), &service.idle)?;
        service.keep(&server, &mut output, "the simulated panel", &bar.progress)?
    } else {
        on_monitor(args, monitor, &service, &bar.progress, &mut report)?
    };
    let KeepReport { shown, failed, missed, latency, .. } = &kept;
    let line = format!(
        "{shown} frames shown, {failed} refused, {missed} refreshes missed; from arrival to flip {} on average, {} at most",
        seconds(latency.mean),
        seconds(latency.longest)
    );
    report.add_serialised("served", &kept, line);
    Ok(report)
}

/// Stops when what is read ends; the thread that reads goes with the process.
fn stop_at_the_end_of(mut input: impl std::io::Read + Send + 'static, progress: std::sync::Arc<Progress>) {
    std::thread::spawn(move || {
        let _ = std::io::copy(&mut input, &mut std::io::sink());
        progress.stop();
    });
}

#[cfg(feature = "display")]
fn on_monitor(
    args: &ServeArgs,
    monitor: &str,
    service: &Service,
    progress: &Progress,
    report: &mut Report,
) -> Result<KeepReport> {
    use crate::display::{Display, DisplayFrame, OnAbsence, PanelLoop, ShowEnd, ShowSettings};
    if args.output.is_some() {
        let what = "frames are written on the simulated panel only; give --monitor none, or leave it out";
        return Err(Error::parameter("--output", what));
    }
    let trigger = args.trigger_patch.as_deref();
    let settings = ShowSettings {
        window: super::screen::window_settings(args.present, args.allow_altered_levels, trigger)?,
        on_absence: OnAbsence::Wait,
        ..ShowSettings::new(monitor.parse()?)
    };
    let mut display = Display::connect()?;
    settings.monitor.find(&display.monitors()?)?;
    let _ready = super::panel_command::Ready::make(&args.panel, &service.setup)?;
    // A port that is taken is found out before the panel shows anything.
    let server = service.start()?;
    let idle = std::sync::Arc::new(DisplayFrame::packed(&[&service.idle])?);
    let mut output = PanelLoop::open(&mut display, &idle, &settings, progress)?;
    report.warn(output.panel().warnings());
    let place = output.panel().monitor().name.clone();
    let kept = service.keep(&server, &mut output, &place, progress)?;
    let window = output.close(if kept.closed { ShowEnd::Closed } else { ShowEnd::Stopped })?;
    report.add_serialised("monitor", &window.monitor, "");
    report.add("covered", window.covered, "");
    Ok(kept)
}

#[cfg(not(feature = "display"))]
fn on_monitor(_: &ServeArgs, _: &str, _: &Service, _: &Progress, _: &mut Report) -> Result<KeepReport> {
    let what = "this build has no display: give --monitor none, or build it with the feature `display` (the default)";
    Err(Error::unsupported(what))
}

/// What is served and how, as the flags say.
struct Service {
    driver: Driver,
    #[cfg_attr(not(feature = "display"), allow(dead_code))]
    setup: Setup,
    panel: ServedPanel,
    settings: ServeSettings,
    idle: Frame,
    on_client_gone: OnClientGone,
    /// Memory for preloaded frames [bytes].
    preload: u64,
    /// Whether clients are told where they come in as JSON.
    json: bool,
}

impl Service {
    fn resolve(args: &ServeArgs, json: bool, report: &mut Report) -> Result<Self> {
        let panel = resolve::setup(&args.panel, report)?;
        let panel = Setup { correction: resolve::correction(args.correction.as_deref())?, ..panel };
        let correction = told_correction(&panel, report)?;
        report.warn(panel.profile.drive_curve(panel.wavelength)?.1);
        let driver = Driver::new(&panel.profile, panel.wavelength, correction)?;
        let idle = idle_frame(&args.idle, &panel, &driver, report)?;
        let served = driver.served(args.name.as_deref().unwrap_or(&panel.profile.name))?;
        let settings = settings(args, &served, report)?;
        Ok(Self {
            driver,
            setup: panel,
            panel: served,
            settings,
            idle,
            on_client_gone: args.on_client_gone,
            preload: args.preload,
            json,
        })
    }

    fn start(&self) -> Result<Server> {
        Server::start(self.panel.clone(), &self.settings)
    }

    /// Serves until the end. Where clients come in is said at once, since the report comes only then.
    fn keep(&self, server: &Server, output: &mut dyn Output, place: &str, progress: &Progress) -> Result<KeepReport> {
        let text = if self.json {
            let mut serving = json!(server.announcement());
            serving["on"] = place.into();
            json!({ "serving": serving }).to_string()
        } else {
            announced(&server.announcement(), place)
        };
        let mut out = std::io::stdout();
        match writeln!(out, "{text}").and_then(|()| out.flush()) {
            // A reader that has gone needs no line; the panel is served all the same.
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => {}
            other => other.map_err(|source| Error::Io { path: "standard output".into(), source })?,
        }
        let settings = KeepSettings { idle: &self.idle, on_client_gone: self.on_client_gone, memory: self.preload };
        serve::keep(server, output, &self.driver, settings, progress)
    }
}

fn announced(announcement: &Announcement, place: &str) -> String {
    let Announcement { name, width, height, bits, wavelength, .. } = announcement;
    let light = show_length(*wavelength);
    let mut text = format!("serving {name}, {width}x{height} px of {bits} bits at {light}, on {place}");
    if let Some(at) = announcement.slmsuite {
        text += &format!("\n  slmsuite  {at}  RemoteSLM(\"{name}\", host=\"{}\", port={})", at.ip(), at.port());
    }
    if let Some(at) = announcement.slmpy {
        text += &format!("\n  slmPy     {at}");
    }
    if let Some(at) = &announcement.local {
        text += &format!("\n  local     {}  holodrive.SLM(\"{name}\")", at.display());
    }
    if let Some(at) = announcement.trigger {
        text += &format!("\n  trigger   {at}  a line of text for each frame");
    }
    text
}

/// A level, or a picture of levels.
fn idle_frame(text: &str, panel: &Setup, driver: &Driver, report: &mut Report) -> Result<Frame> {
    if let Ok(level) = text.parse::<u16>() {
        return driver.flat(level).map_err(|_| {
            let highest = panel.profile.levels() - 1;
            Error::out_of_range("--idle", level, format!("must be 0 to {highest}, the panel's highest level"))
        });
    }
    let (frame, warnings) = Frame::read(Path::new(text), Some(&panel.profile), Some(panel.wavelength))?;
    report.warn(warnings);
    Ok(frame)
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
        Some(None) => Some(serve::usual_local(&served.name)),
        None if none => Some(serve::usual_local(&served.name)),
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
        local_address: args.listen,
        trigger: args.trigger.map(at),
        calibrated,
        log: args.log.clone(),
        settle: Duration::from_secs_f64(if args.settle { served.settle_time.max(0.0) } else { 0.0 }),
        ..ServeSettings::default()
    })
}
