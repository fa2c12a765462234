//! `calibrate plate`: the card to print, and what its scan says of the printer.

use super::args::CalibratePlateArgs;
use super::bar::Bar;
use super::report::Report;
use crate::print::calibrate::{measure, write_profile};
use crate::print::{Asked, Plate, PlateCalibration, write_card};
use crate::units::show_length;
use crate::{Error, Result};
use std::path::Path;

pub(super) fn plate(args: &CalibratePlateArgs) -> Result<Report> {
    let mut report = Report::new("calibrate plate");
    let plate = Plate::find(&args.plate, &Asked::default())?;
    match &args.scan {
        None => card(args, &plate, &mut report)?,
        Some(scan) => profile(args, &plate, scan, &mut report)?,
    }
    Ok(report)
}

fn card(args: &CalibratePlateArgs, plate: &Plate, report: &mut Report) -> Result<()> {
    let folder = args.output.as_deref().unwrap_or(Path::new("card"));
    let bar = Bar::new();
    let card = write_card(plate, args.patch, folder, &bar.progress)?;
    report.section(&card);
    report.line(format!(
        "card         {} × {} px, {:.2} × {:.2} mm; {} patches of {} px, each twice",
        card.size[0],
        card.size[1],
        card.extent[0] * 1e3,
        card.extent[1] * 1e3,
        card.patches,
        card.patch
    ));
    report.output("written", folder);
    report.line(format!(
        "print it as you print plates (holodrive print export {} …), scan it in transmission, then: holodrive calibrate plate \
         SCAN.tif --plate {}",
        folder.display(),
        args.plate
    ));
    Ok(())
}

fn profile(args: &CalibratePlateArgs, plate: &Plate, scan: &Path, report: &mut Report) -> Result<()> {
    let found = measure(plate, scan, args.scanner)?;
    let output = args.output.as_deref().unwrap_or(Path::new("calibrated-plate.toml"));
    if output.exists() && same(output, scan) {
        return Err(Error::parameter("output", "the profile would take the scan's place; give another name"));
    }
    write_profile(&args.plate, &found, scan, output)?;
    report.warn(&found.warnings);
    report.section(&found);
    report.line(format!(
        "scan         {:.1} pixels a patch, turned by {:.2} deg{}; marks lie within {:.2} pixels",
        found.patch,
        found.rotation.to_degrees(),
        if found.mirrored { ", seen from behind" } else { "" },
        found.residual
    ));
    report.line(tone(&found));
    if let (Some([x, y]), Some([ux, uy])) = (found.transfer.line_bias, found.line_uncertainty) {
        report.line(format!(
            "lines        of the highest level grow by {} ± {} along x, {} ± {} along y",
            show_length(x),
            show_length(ux),
            show_length(y),
            show_length(uy)
        ));
    }
    if let Some(gain) = found.gain {
        report.line(format!(
            "dot gain     {:+.1} % of the {} level, in lines of the carrier's period",
            100.0 * gain.abs(),
            if gain > 0.0 { "highest" } else { "lowest" }
        ));
    }
    report.output("profile", output);
    Ok(())
}

/// Where the tone's middle is, and how well it is known.
fn tone(found: &PlateCalibration) -> String {
    let (levels, amplitude) = (&found.transfer.levels, &found.transfer.amplitude);
    let ends = [amplitude.first(), amplitude.last()].map(|end| end.copied().unwrap_or(0.0));
    let middle = 0.5 * (ends[0] + ends[1]);
    let rises = ends[1] > ends[0];
    let at = amplitude.iter().position(|&a| (a >= middle) == rises).unwrap_or(0);
    format!(
        "tone         amplitudes {:.3} to {:.3}, half way at a level of about {:.2}; uncertain by {:.4}",
        ends[0],
        ends[1],
        levels.get(at).copied().unwrap_or(0.0),
        found.amplitude_uncertainty
    )
}

fn same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}
