//! Finished plates looked at: pictures with words, both eyes, an eye that walks past, a job sheet.

use super::args::{LampAsked, LookArgs, PreviewArgs, SheetArgs};
use super::bar::Bar;
use super::output;
use super::plate_source;
use super::report::{Report, seconds};
use crate::print::preview::PreviewSettings;
use crate::print::{Lamp, Manifest, Plate, PlateView, write_pair, write_sheet, write_walk};
use crate::progress::Progress;
use crate::units::show_length;
use crate::{Error, Result};
use std::path::{Path, PathBuf};

/// Places of a walk, from one end to the other.
const STEPS: usize = 13;

/// Wavelengths in words.
pub(super) fn lengths(wavelengths: &[f64]) -> String {
    wavelengths.iter().map(|w| show_length(*w)).collect::<Vec<_>>().join(", ")
}

/// `name.png` → `name-WHAT.png`.
fn beside(path: &Path, what: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}-{what}.png"))
}

/// The lamp that was typed; of what was not typed the plate's own.
fn lamp(args: &LookArgs, own: Option<Lamp>) -> Option<Lamp> {
    let point = Lamp { diameter: 0.0, distance: 1.0, bandwidth: 0.0 };
    let lamp = match args.lamp {
        Some(LampAsked::Laser) => point,
        Some(LampAsked::Of([diameter, distance])) => {
            Lamp { diameter, distance, bandwidth: own.map_or(0.0, |own| own.bandwidth) }
        }
        None => own.unwrap_or(point),
    };
    let lamp = Lamp { bandwidth: args.bandwidth.unwrap_or(lamp.bandwidth), ..lamp };
    (lamp.diameter > 0.0 || lamp.bandwidth > 0.0).then_some(lamp)
}

fn settings(args: &LookArgs, plate: &Plate) -> PreviewSettings {
    let height = plate.slit.as_ref().map_or(0.0, |slit| slit.y);
    PreviewSettings {
        eye: args.eye.unwrap_or([0.0, height, plate.view.viewer]),
        pupil: args.pupil,
        focus: args.focus.unwrap_or(plate.view.place),
        size: args.size,
        part: args.part,
        wavelength: args.wavelength,
        lamp: lamp(args, plate.lamp),
        places: args.places,
        memory: args.memory,
    }
}

/// Looks once, and says so.
fn look(args: &LookArgs, report: &mut Report, progress: &Progress) -> Result<(PlateView, PreviewSettings)> {
    let plate = Manifest::of(&args.folder)?.settings.plate;
    let settings = settings(args, &plate);
    report.check_side("focus", settings.focus, Some([plate.view.place; 2]));
    if !(0.0..=1.0).contains(&args.white) {
        return Err(Error::out_of_range("white", args.white, "must be a part from 0 to 1"));
    }
    let view = PlateView::new(&args.folder, &settings, progress)?;
    let seen = &view.report;
    if seen.dazzled {
        report.warn(["the lamp's own light goes through the plate into this pupil; move the eye out of it"]);
    }
    report.line(format!(
        "simulated view in focus at z = {}, {:.2} × {:.2} mm, in the light of {}{}, one column of {} and one row of {} \
         of light kept, in {}",
        show_length(seen.focus),
        seen.half[0] * 2e3,
        seen.half[1] * 2e3,
        lengths(&seen.wavelengths),
        seen.lamp.as_ref().map(|lamp| format!(", {lamp}")).unwrap_or_default(),
        seen.thinned[0],
        seen.thinned[1],
        seconds(seen.seconds)
    ));
    Ok((view, settings))
}

/// The same plate by an eye elsewhere along x.
fn aside(args: &LookArgs, settings: &PreviewSettings, by: f64, progress: &Progress) -> Result<PlateView> {
    let [x, y, z] = settings.eye;
    PlateView::new(&args.folder, &PreviewSettings { eye: [x + by, y, z], ..settings.clone() }, progress)
}

/// Says which of several eyes the plate sends no light of its object to.
fn warn_of_dark(views: &[&PlateView], report: &mut Report) -> Result<()> {
    let mut places = Vec::new();
    for view in views {
        let (plate, [x, y, z]) = (view.plate(), view.report.eye);
        let (grid, angle) = (plate.raster.grid(), plate.segments()?.band.angle);
        let reach = |extent: f64, angle: f64| 0.5 * extent + z * angle.tan();
        if y.abs() > reach(grid.extent_y(), angle[1]) {
            places.push(format!("{} (y = {})", show_length(x), show_length(y)));
        } else if x.abs() > reach(grid.extent_x(), angle[0]) {
            places.push(show_length(x));
        }
    }
    if !places.is_empty() {
        let what =
            format!("the plate sends no light to eyes at x = {}; look from nearer its middle", places.join(", "));
        report.warn([what]);
    }
    Ok(())
}

pub(super) fn preview(args: &PreviewArgs) -> Result<Report> {
    let mut report = Report::new("print preview");
    let bar = Bar::new();
    let (share, progress) = (args.look.white, &bar.progress);
    output::check(&args.output, &["png"])?;
    let (mut view, settings) = look(&args.look, &mut report, progress)?;
    warn_of_dark(&[&view], &mut report)?;
    if let Some(of) = &args.traced {
        let path = beside(&args.output, "traced");
        let [alike, smooth] = view.compare(&plate_source::same(of)?, &path, args.bare, progress)?;
        let line =
            format!("traced       {}: SSIM {:.3}, over 4 × 4 cells {:.3}", path.display(), alike.ssim, smooth.ssim);
        report.add("traced", path.display().to_string(), line);
    }
    if args.bare {
        view.write_png(&args.output, share)?;
    } else {
        view.write_labelled(&args.output, share)?;
    }
    if let Some(apart) = args.pair {
        let [left, right] = [-0.5, 0.5].map(|side| aside(&args.look, &settings, side * apart, progress));
        let (left, right) = (left?, right?);
        warn_of_dark(&[&left, &right], &mut report)?;
        let path = beside(&args.output, "pair");
        write_pair(&left, &right, share, &path)?;
        report.file("pair", "pair", &path);
    }
    if let Some(way) = args.walk {
        let at = |step: usize| (step as f64 / (STEPS - 1) as f64 - 0.5) * way;
        let views =
            (0..STEPS).map(|step| aside(&args.look, &settings, at(step), progress)).collect::<Result<Vec<_>>>()?;
        warn_of_dark(&views.iter().collect::<Vec<_>>(), &mut report)?;
        let path = beside(&args.output, "walk");
        write_walk(&views, share, &path)?;
        report.file("walk", "walk", &path);
    }
    report.section(&view.report);
    report.output("picture", &args.output);
    Ok(report)
}

pub(super) fn sheet(args: &SheetArgs) -> Result<Report> {
    let is_page = |ending: &std::ffi::OsStr| ["html", "htm"].iter().any(|known| ending.eq_ignore_ascii_case(known));
    if !args.output.extension().is_some_and(is_page) {
        let what = format!("{}: a job sheet is a page whose name ends in .html", args.output.display());
        return Err(Error::parameter("output", what));
    }
    let mut report = Report::new("print sheet");
    let bar = Bar::new();
    let (view, _) = look(&args.look, &mut report, &bar.progress)?;
    write_sheet(&args.look.folder, &view, view.white(args.look.white), &args.output, &bar.progress)?;
    report.section(&view.report);
    report.output("sheet", &args.output);
    Ok(report)
}
