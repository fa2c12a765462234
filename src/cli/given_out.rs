//! Frames of a calibration, written and shown.

use super::args::{PanelArgs, ShownArgs};
use super::bar::Bar;
use super::report::Report;
use super::resolve;
use crate::calibration::FrameSeries;
use crate::panel::{Modulation, PanelProfile, Setup};
use crate::{Error, Result};
use std::path::Path;
use std::time::Duration;

/// Writes frames into a folder and shows them, one after another.
pub(super) fn give_out(
    series: &FrameSeries,
    folder: &Path,
    shown: &ShownArgs,
    (args, setup): (&PanelArgs, &Setup),
    report: &mut Report,
) -> Result<()> {
    let hold = duration(shown, &setup.profile)?;
    #[cfg(not(feature = "display"))]
    if shown.monitor.is_some() {
        return Err(Error::unsupported("this build has no display; build it with the feature `display` (the default)"));
    }
    #[cfg(feature = "display")]
    let screen = shown.monitor.as_deref().map(|name| super::screen::Screen::named(name, args, setup)).transpose()?;
    let bar = Bar::new();
    series.write(folder, &bar.progress)?;
    report.value("frames", series.count());
    let line = format!("{} frames and manifest.csv in {}", series.count(), folder.display());
    report.add("output", folder.display().to_string(), line);
    #[cfg(feature = "display")]
    if let Some(screen) = screen {
        bar.progress.start("", 0);
        screen.play(series.frames(), hold, &bar.progress, report)?;
    }
    #[cfg(not(feature = "display"))]
    let _ = (hold, args);
    Ok(())
}

fn duration(shown: &ShownArgs, profile: &PanelProfile) -> Result<Duration> {
    if !(shown.hold.is_finite() && (1e-3..1e6).contains(&shown.hold)) {
        return Err(Error::parameter("hold", format!("{} is not a number of seconds from 0.001 on", shown.hold)));
    }
    match profile.settle_time {
        Some(settle) if settle > shown.hold => {
            let what = format!("{} s is less than the {settle} s that {} takes to settle", shown.hold, profile.name);
            Err(Error::parameter("hold", what))
        }
        _ => Ok(Duration::from_secs_f64(shown.hold)),
    }
}

pub(super) fn phase_panel(args: &PanelArgs, report: &mut Report) -> Result<Setup> {
    let found = resolve::setup(args, report)?;
    if found.profile.modulation() != Modulation::Phase {
        let what = format!("{} modulates amplitude; what is calibrated here is of phase panels", found.profile.name);
        return Err(Error::parameter("panel", what));
    }
    Ok(found)
}
