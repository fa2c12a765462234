//! What monitors there are, and what alters levels on them.

use super::args::{DoctorArgs, MonitorsArgs};
use super::report::Report;
use holodrive::Result;

#[cfg(feature = "display")]
pub(super) use real::{doctor, monitors};

#[cfg(feature = "display")]
mod real {
    use super::{DoctorArgs, MonitorsArgs, Report, Result};
    use holodrive::display::{self, Display, MonitorChoice};
    use holodrive::panel::PanelProfile;
    use holodrive::{Error, files};
    use serde::Serialize;
    use serde_json::Value;
    use std::path::Path;

    /// Lists the monitors.
    pub(crate) fn monitors(args: &MonitorsArgs) -> Result<Report> {
        let mut report = Report::new("monitors");
        let profile = args.panel.as_deref().map(PanelProfile::find).transpose()?;
        let monitors = Display::connect()?.monitors()?;
        for monitor in &monitors {
            let fits = fitting_profiles(monitor.width as usize, monitor.height as usize, profile.as_ref());
            report.add("", Value::Null, format!("{monitor}{fits}"));
        }
        report.add_serialised("monitors", &monitors, "");
        write_list(args.output.as_deref(), &monitors)?;
        Ok(report)
    }

    fn fitting_profiles(width: usize, height: usize, asked: Option<&PanelProfile>) -> String {
        let fits = |profile: &PanelProfile| (profile.signal.width, profile.signal.height) == (width, height);
        match asked {
            Some(profile) if fits(profile) => format!("  fits {}", profile.name),
            Some(profile) => format!("  does not fit {}", profile.name),
            None => {
                let names: Vec<_> = PanelProfile::embedded_names()
                    .filter(|name| PanelProfile::find(name).is_ok_and(|p| fits(&p)))
                    .collect();
                if names.is_empty() { String::new() } else { format!("  size of: {}", names.join(", ")) }
            }
        }
    }

    /// Looks at what alters levels; draws a test card.
    pub(crate) fn doctor(args: &DoctorArgs) -> Result<Report> {
        let mut report = Report::new("doctor");
        let choice: Option<MonitorChoice> = args.monitor.as_deref().map(str::parse).transpose()?;
        let mut display = Display::connect()?;
        let monitors = display.monitors()?;
        let findings = display::examine(&mut display, choice.as_ref())?;
        for finding in &findings {
            let place = finding.monitor.as_deref().unwrap_or("desktop");
            let line = format!("{place:10} {:14} {:?}: {}", finding.subject, finding.severity, finding.what);
            report.add("", Value::Null, line);
        }
        report.add_serialised("findings", &findings, "");
        write_list(args.output.as_deref(), &findings)?;
        if let Some(path) = &args.card {
            let monitor = match &choice {
                Some(choice) => choice.find(&monitors)?,
                None => {
                    monitors.first().cloned().ok_or_else(|| Error::Display { what: "there is no monitor".into() })?
                }
            };
            write_card(path, monitor.width, monitor.height)?;
            let line = format!("test card for {}: {}", monitor.name, path.display());
            report.add("card", path.display().to_string(), line);
        }
        Ok(report)
    }

    fn write_card(path: &Path, width: u32, height: u32) -> Result<()> {
        let card = display::test_card(width, height, 1)?;
        let refused = |e: png::EncodingError| Error::unsupported(format!("{}: {e}", path.display()));
        files::write_whole(path, |out| {
            let mut encoder = png::Encoder::new(out, width, height);
            encoder.set_color(png::ColorType::Rgb);
            let mut writer = encoder.write_header().map_err(refused)?;
            writer.write_image_data(card.pixels().as_flattened()).map_err(refused)?;
            writer.finish().map_err(refused)
        })
    }

    fn write_list(path: Option<&Path>, list: &impl Serialize) -> Result<()> {
        let Some(path) = path else { return Ok(()) };
        let text = serde_json::to_string_pretty(list).map_err(|e| Error::unsupported(e.to_string()))?;
        files::write_bytes(path, text.as_bytes())
    }
}

#[cfg(not(feature = "display"))]
pub(super) fn monitors(_: &MonitorsArgs) -> Result<Report> {
    Err(no_display())
}

#[cfg(not(feature = "display"))]
pub(super) fn doctor(_: &DoctorArgs) -> Result<Report> {
    Err(no_display())
}

#[cfg(not(feature = "display"))]
fn no_display() -> holodrive::Error {
    holodrive::Error::unsupported("this build has no display; build it with the feature `display` (the default)")
}
