//! `calibrate`: frames to show, and what the measured numbers say of the panel.

use super::args::{CalibrateCommand, CheckArgs, CurveArgs, FlatnessArgs, PanelArgs, ShownArgs};
use super::bar::Bar;
use super::load::{Panel, panel, panel_correction};
use super::report::{Report, seconds};
use holodrive::field::npy;
use holodrive::panel::calibration::curve::Order;
use holodrive::panel::calibration::{
    Region, bend_from_steps, cards, fit, read_powers, step_frames, sweep_frame, zernike,
};
use holodrive::panel::{Curve, Frame, PanelProfile, Wavefront};
use holodrive::progress::Progress;
use holodrive::units::show_length;
use holodrive::{Error, Result, files};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

pub(super) fn calibrate(command: &CalibrateCommand) -> Result<Report> {
    match command {
        CalibrateCommand::Curve(args) => match &args.powers {
            Some(powers) => solve(args, powers),
            None => sweep(args),
        },
        CalibrateCommand::Flatness(args) if args.interferograms.is_empty() && args.zernike.is_empty() => steps(args),
        CalibrateCommand::Flatness(args) => flatness(args),
        CalibrateCommand::Check(args) => check(args),
    }
}

/// A frame that goes into a folder: its file's name and the rest of its line in the manifest.
struct Listed {
    name: String,
    line: String,
    frame: Frame,
}

/// Writes frames and their manifest into a folder and shows them, one after another; never more than one in memory.
fn give_out(
    folder: &Path,
    head: &str,
    count: usize,
    make: impl Fn(usize) -> Result<Listed> + Send + Sync,
    shown: &ShownArgs,
    profile: &PanelProfile,
    report: &mut Report,
) -> Result<()> {
    let hold = duration(shown, profile)?;
    #[cfg(not(feature = "display"))]
    if shown.monitor.is_some() {
        return Err(Error::unsupported("this build has no display; build it with the feature `display` (the default)"));
    }
    #[cfg(feature = "display")]
    let screen = shown.monitor.as_deref().map(super::screen::Screen::named).transpose()?;
    // The first is made before the folder: what is wrong with the settings is found out without leaving one.
    make(0)?;
    let new = !folder.exists();
    files::output_folder(folder)?;
    let bar = Bar::new();
    let written = (|| {
        let mut manifest = format!("{head}\n");
        bar.progress.start("frames", count as u64);
        for index in 0..count {
            bar.progress.check()?;
            let listed = make(index)?;
            listed.frame.write(&folder.join(&listed.name))?;
            let _ = writeln!(manifest, "{},{}", listed.name, listed.line);
            bar.progress.advance(1);
        }
        files::write_bytes(&folder.join("manifest.csv"), manifest.as_bytes())
    })();
    if written.is_err() && new {
        // An interrupted sweep is worth nothing; the folder was made by it.
        let _ = std::fs::remove_dir_all(folder);
    }
    written?;
    let line = format!("{count} frames and manifest.csv in {}", folder.display());
    report.add("frames", count, "");
    report.add("output", folder.display().to_string(), line);
    #[cfg(feature = "display")]
    if let Some(screen) = screen {
        bar.progress.start("", 0);
        screen.play((0..count).map(|index| make(index).map(|listed| listed.frame)), hold, &bar.progress, report)?;
    }
    #[cfg(not(feature = "display"))]
    let _ = hold;
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

fn phase_panel(args: &PanelArgs, report: &mut Report) -> Result<Panel> {
    let found = panel(args, report)?;
    if found.profile.modulation() != holodrive::panel::Modulation::Phase {
        let what = format!("{} modulates amplitude; curve and flatness are of phase panels", found.profile.name);
        return Err(Error::parameter("panel", what));
    }
    Ok(found)
}

fn sweep(args: &CurveArgs) -> Result<Report> {
    let mut report = Report::new("calibrate curve");
    let panel = phase_panel(&args.panel, &mut report)?;
    let profile = &panel.profile;
    let all = profile.levels();
    let count = args.levels.unwrap_or(all.min(64));
    if !(16..=all).contains(&count) {
        return Err(Error::parameter("levels", format!("{count} must be 16 … {all}, the panel's levels")));
    }
    let level = |index: usize| (index as f64 * (all - 1) as f64 / (count - 1) as f64).round() as u16;
    let parts = args.regions;
    if parts.is_some_and(|(columns, rows)| columns * rows * count > 100_000) {
        return Err(Error::parameter("regions", format!("{parts:?} with {count} levels each are too many frames")));
    }
    if parts.is_some() && args.order == Order::Zero {
        let what = "regions are told apart in the first order only; leave --order zero out";
        return Err(Error::parameter("order", what));
    }
    let regions = parts.map_or(1, |(columns, rows)| columns * rows);
    let make = |index: usize| {
        let (region, index) = (index / count, index % count);
        let region = parts.map(|parts| Region { place: (region % parts.0, region / parts.0), parts });
        let frame = sweep_frame(profile, panel.wavelength, (0, level(index)), args.stripe, region)?;
        Ok(match region {
            None => {
                Listed { name: format!("level-{:05}.png", level(index)), line: format!("{},", level(index)), frame }
            }
            Some(Region { place: (column, row), .. }) => Listed {
                name: format!("region-{column}-{row}-level-{:05}.png", level(index)),
                line: format!("{},{column},{row},", level(index)),
                frame,
            },
        })
    };
    let head = if parts.is_some() { "file,level,column,row,power" } else { "file,level,power" };
    let folder = args.output.clone().unwrap_or_else(|| "sweep".into());
    give_out(&folder, head, regions * count, make, &args.shown, profile, &mut report)?;
    let grating = panel.wavelength / (2.0 * args.stripe as f64 * profile.pitch_x);
    report.add(
        "order_angle",
        grating.min(1.0).asin(),
        format!(
            "measure the power in a first order, {:.3} deg beside the axis, write it into the column `power`, then: holodrive \
             calibrate curve --panel {} --wavelength {} --powers {}",
            grating.min(1.0).asin().to_degrees(),
            args.panel.panel,
            show_length(panel.wavelength),
            folder.join("manifest.csv").display()
        ),
    );
    Ok(report)
}

fn solve(args: &CurveArgs, powers: &Path) -> Result<Report> {
    let mut report = Report::new("calibrate curve");
    let panel = phase_panel(&args.panel, &mut report)?;
    let begin = Instant::now();
    let (profile, wavelength) = (&panel.profile, panel.wavelength);
    let measured = read_powers(powers, profile.levels())?;
    let order = args.order;
    let found = fit(&measured, profile.levels(), order, args.degree, powers)?;
    let worst = found.uncertainty.iter().fold(0.0, |a: f64, &b| a.max(b));
    let mean = (found.uncertainty.iter().map(|u| u * u).sum::<f64>() / found.uncertainty.len() as f64).sqrt();
    if found.range < 2.0 * std::f64::consts::PI {
        report.warn([format!(
            "the curve spans {:.2}π at {}, less than a turn: phases beyond it get its nearest end; the methods gradient, \
             weighted and error-diffusion allow for it",
            found.range / std::f64::consts::PI,
            show_length(wavelength)
        )]);
    }
    let made = profile.with_measured_curve(wavelength, found.curve.clone());
    let mut remarks = vec![
        format!("{} with its curve at {} measured: {}", profile.name, show_length(wavelength), powers.display()),
        format!(
            "uncertainty {mean:.4} rad RMS over the levels, {worst:.4} rad at most; residual {:.4}",
            found.residual
        ),
    ];
    let regions = match &found.curve {
        Curve::Regional { columns, rows, .. } => Some([*columns, *rows]),
        _ => None,
    };
    if let Some([columns, rows]) = regions {
        remarks.push(format!("{columns} × {rows} regions, row by row from the upper left"));
    }
    let output = args.output.clone().unwrap_or_else(|| "calibrated.toml".into());
    write_profile(&made, &output, &remarks)?;
    report.add("powers", measured.len(), "");
    report.add("order", if order == Order::First { "first" } else { "zero" }, "");
    report.add_serialised("regions", &regions, "");
    report.add("degree", found.degree, "");
    report.add("uncertainty", found.uncertainty.clone(), "");
    report.add("uncertainty_rms", mean, "");
    report.add("residual", found.residual, "");
    report.add(
        "range",
        found.range,
        format!(
            "curve        {:>8}  {:.3}π from the lowest level to the highest, uncertain by {mean:.4} rad RMS, {worst:.4} rad at \
             most; polynomial of degree {}{}",
            seconds(begin.elapsed().as_secs_f64()),
            found.range / std::f64::consts::PI,
            found.degree,
            regions.map_or_else(String::new, |[c, r]| format!(", {c} × {r} regions (the worst of them)"))
        ),
    );
    let levels = made.drive_curve(wavelength)?.0.levels_for_2pi();
    report.add_serialised(
        "levels_for_2pi",
        &levels,
        levels.map_or_else(String::new, |l| format!("2π          at {l:.1} levels (mean slope)")),
    );
    report.add("output", output.display().to_string(), format!("profile      {}", output.display()));
    Ok(report)
}

/// Writes a profile, having proved that it is read back.
fn write_profile(profile: &PanelProfile, path: &Path, remarks: &[String]) -> Result<()> {
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return Err(Error::parameter("output", format!("{}: a profile's name ends in .toml", path.display())));
    }
    // Files that the profile names are found beside it, wherever it was read from.
    let mut profile = profile.clone();
    for correction in &mut profile.corrections {
        correction.file = std::path::absolute(&correction.file).map_err(Error::io(&correction.file))?;
    }
    PanelProfile::parse(&profile.to_toml(remarks), path)?;
    profile.write(path, remarks)
}

fn steps(args: &FlatnessArgs) -> Result<Report> {
    let mut report = Report::new("calibrate flatness");
    let panel = phase_panel(&args.panel, &mut report)?;
    let (profile, count) = (&panel.profile, args.steps);
    if count > 64 {
        return Err(Error::parameter("steps", format!("{count} must be 3 … 64")));
    }
    if args.into.is_some() {
        return Err(Error::parameter("into", "the correction is not known before --interferograms or --zernike"));
    }
    let frames = step_frames(profile, panel.wavelength, count)?;
    let make = |index: usize| {
        let degrees = 360.0 * index as f64 / count as f64;
        let (name, line) = (format!("step-{index:02}.png"), format!("{degrees}"));
        Ok(Listed { name, line, frame: frames[index].clone() })
    };
    let folder = args.output.clone().unwrap_or_else(|| "steps".into());
    give_out(&folder, "file,degrees", count, make, &args.shown, profile, &mut report)?;
    let line = "superpose the panel's light with a flat wave, picture its pixels one to one in each step, then: holodrive \
                calibrate flatness --interferograms …";
    report.add("", serde_json::Value::Null, line);
    Ok(report)
}

fn flatness(args: &FlatnessArgs) -> Result<Report> {
    let mut report = Report::new("calibrate flatness");
    let panel = phase_panel(&args.panel, &mut report)?;
    let (profile, wavelength) = (&panel.profile, panel.wavelength);
    let (width, height) = (profile.width, profile.height);
    let output = args.output.clone().unwrap_or_else(|| "flatness.npy".into());
    let bend = if args.zernike.is_empty() {
        let pictures =
            args.interferograms.iter().map(|path| picture(path, width, height)).collect::<Result<Vec<_>>>()?;
        bend_from_steps(&pictures, width, height, wavelength, "measured bend")?
    } else {
        let radius = args.radius.ok_or_else(|| Error::parameter("radius", "the coefficients' circle is needed"))?;
        let radians: Vec<f64> = args.zernike.iter().map(|waves| waves * std::f64::consts::TAU).collect();
        zernike::wavefront(panel.grid, wavelength, &radians, radius, "bend of Zernike coefficients")?
    };
    let (rms, span) = flatness_of(&bend);
    let correction = bend.conjugate();
    correction.write(&output)?;
    let written = (|| {
        let Some(into) = &args.into else { return Ok(()) };
        let beside = if into.parent() == output.parent() { output.file_name().map(PathBuf::from) } else { None };
        let made = profile.with_correction(wavelength, beside.as_deref().unwrap_or(&output));
        let remarks = [format!("{} with the correction of its bend at {}", profile.name, show_length(wavelength))];
        if !into.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
            return Err(Error::parameter("into", format!("{}: a profile's name ends in .toml", into.display())));
        }
        made.write(into, &remarks)
    })();
    if written.is_err() {
        for path in [output.clone(), npy::metadata_path(&output)] {
            // What was written before the refusal goes again.
            let _ = std::fs::remove_file(path);
        }
    }
    written?;
    report.add("span", span, "");
    report.add(
        "rms",
        rms,
        format!(
            "bend         {:.3} waves RMS about its mean{}",
            rms / std::f64::consts::TAU,
            if args.zernike.is_empty() {
                " (of phases wrapped to a turn)".into()
            } else {
                format!(", {:.2} from lowest to highest", span / std::f64::consts::TAU)
            }
        ),
    );
    report.add("output", output.display().to_string(), format!("correction   {}", output.display()));
    if let Some(into) = &args.into {
        report.add("profile", into.display().to_string(), format!("profile      {}", into.display()));
    }
    Ok(report)
}

/// Standard deviation and span [rad].
fn flatness_of(bend: &Wavefront) -> (f64, f64) {
    let count = bend.phase.len().max(1) as f64;
    let mean = bend.phase.iter().map(|p| f64::from(*p)).sum::<f64>() / count;
    let square = bend.phase.iter().map(|p| (f64::from(*p) - mean).powi(2)).sum::<f64>() / count;
    let ends = bend.phase.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &p| (l.min(p), h.max(p)));
    (square.sqrt(), f64::from(ends.1 - ends.0))
}

/// An interferogram on the panel's pixels.
fn picture(path: &Path, width: usize, height: usize) -> Result<Vec<f32>> {
    let (w, h, values) = if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        let array = npy::read_real(path)?;
        if array.channels != 1 {
            return Err(Error::input(path, "an interferogram has two dimensions, height × width"));
        }
        (array.width, array.height, array.values)
    } else {
        holodrive::reconstruction::read_gray(path)?
    };
    if (w, h) != (width, height) {
        let what = format!("is {w}×{h}, the panel {width}×{height}: map the camera's picture onto the panel's pixels");
        return Err(Error::input(path, what));
    }
    if let Some(at) = values.iter().position(|v| !v.is_finite()) {
        return Err(Error::input(path, format!("value at row {}, column {} is not finite", at / w, at % w)));
    }
    Ok(values)
}

fn check(args: &CheckArgs) -> Result<Report> {
    let mut report = Report::new("calibrate check");
    let panel = phase_panel(&args.panel, &mut report)?;
    let correction = panel_correction(&panel, None, &mut report)?;
    let progress = Arc::new(Progress::new());
    let made = cards(&panel.profile, panel.wavelength, correction.as_ref(), args.distance, &progress)?;
    let make = |index: usize| {
        let card = &made[index];
        let line = format!("\"{}\"", card.look_for.replace('"', "'"));
        Ok(Listed { name: format!("{}.png", card.name), line, frame: card.frame.clone() })
    };
    give_out(&args.output, "file,look for", made.len(), make, &args.shown, &panel.profile, &mut report)?;
    for card in &made {
        report.add(card.name, card.look_for.clone(), format!("{}: {}", card.name, card.look_for));
    }
    Ok(report)
}
