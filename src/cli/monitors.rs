//! What monitors there are, and what alters levels on them.

use super::args::{DoctorArgs, MonitorsArgs};
use super::report::Report;
use crate::Result;

#[cfg(feature = "display")]
pub(super) use real::{doctor, monitors};

#[cfg(feature = "display")]
mod real {
    use super::{DoctorArgs, MonitorsArgs, Report, Result};
    use crate::Error;
    use crate::display::{self, Display, Monitor, MonitorChoice};
    use crate::panel::PanelProfile;

    /// Lists the monitors.
    pub(crate) fn monitors(args: &MonitorsArgs) -> Result<Report> {
        let mut report = Report::new("monitors");
        let profile = args.panel.as_deref().map(PanelProfile::find).transpose()?;
        let monitors = Display::connect()?.monitors()?;
        let lines = monitors.iter().map(|monitor| format!("{monitor}{}", fitting_profiles(monitor, profile.as_ref())));
        report.list("monitors", lines, &monitors, args.output.as_deref())?;
        Ok(report)
    }

    fn fitting_profiles(monitor: &Monitor, asked: Option<&PanelProfile>) -> String {
        let size = (monitor.width as usize, monitor.height as usize);
        let fits = |profile: &PanelProfile| (profile.signal.width, profile.signal.height) == size;
        if let Some(profile) = asked {
            return format!("  {} {}", if fits(profile) { "fits" } else { "does not fit" }, profile.name);
        }
        let fitting = |name: &&str| PanelProfile::find(name).is_ok_and(|profile| fits(&profile));
        let names: Vec<_> = PanelProfile::embedded_names().filter(fitting).collect();
        if names.is_empty() { String::new() } else { format!("  size of: {}", names.join(", ")) }
    }

    /// Looks at what alters levels; draws a test card.
    pub(crate) fn doctor(args: &DoctorArgs) -> Result<Report> {
        let mut report = Report::new("doctor");
        let choice: Option<MonitorChoice> = args.monitor.as_deref().map(str::parse).transpose()?;
        let mut display = Display::connect()?;
        let findings = display::examine(&mut display, choice.as_ref())?;
        let lines = findings.iter().map(|finding| {
            let place = finding.monitor.as_deref().unwrap_or("desktop");
            format!("{place:10} {:14} {:?}: {}", finding.subject, finding.severity, finding.what)
        });
        report.list("findings", lines, &findings, args.output.as_deref())?;
        if let Some(path) = &args.card {
            let monitors = display.monitors()?;
            let first =
                || monitors.first().cloned().ok_or_else(|| Error::Display { what: "there is no monitor".into() });
            let monitor = choice.map_or_else(first, |choice| choice.find(&monitors))?;
            display::test_card(monitor.width, monitor.height, 1)?.write_png(path)?;
            let line = format!("test card for {}: {}", monitor.name, path.display());
            report.add("card", path.display().to_string(), line);
        }
        Ok(report)
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
fn no_display() -> crate::Error {
    crate::Error::unsupported("this build has no display; build it with the feature `display` (the default)")
}
