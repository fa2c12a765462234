//! `calibrate`: frames to show, and what the measured numbers say of the panel.

use super::args::{CalibrateCommand, CheckArgs, CurveArgs, FlatnessArgs};
use super::given_out::{give_out, phase_panel};
use super::report::{Report, seconds};
use super::resolve::told_correction;
use crate::calibration::{
    Flatness, Sweep, card_frames, cards, measure_curve, step_frames, wavefront_from_files, write_correction, zernike,
};
use crate::panel::Setup;
use crate::progress::Progress;
use crate::units::show_length;
use crate::{Error, Result};
use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::time::Instant;

pub(super) fn calibrate(command: &CalibrateCommand) -> Result<Report> {
    match command {
        CalibrateCommand::Curve(args) => match &args.powers {
            Some(powers) => curve(args, powers),
            None => sweep(args),
        },
        CalibrateCommand::Flatness(args) if args.interferograms.is_empty() && args.zernike.is_empty() => steps(args),
        CalibrateCommand::Flatness(args) => flatness(args),
        CalibrateCommand::Camera(args) => super::calibrate_camera::camera(args),
        CalibrateCommand::Check(args) => check(args),
        CalibrateCommand::Plate(args) => super::calibrate_plate::plate(args),
    }
}

fn sweep(args: &CurveArgs) -> Result<Report> {
    let mut report = Report::new("calibrate curve");
    let setup = phase_panel(&args.panel, &mut report)?;
    let Setup { profile, wavelength, .. } = &setup;
    let settings = Sweep { levels: args.levels, stripe: args.stripe, regions: args.regions, order: args.order };
    let series = settings.frames(profile, *wavelength)?;
    let folder = args.output.as_deref().unwrap_or(Path::new("sweep"));
    give_out(&series, folder, &args.shown, (&args.panel, &setup), &mut report)?;
    let angle = settings.order_angle(profile, *wavelength);
    report.add(
        "order_angle",
        angle,
        format!(
            "measure the power in a first order, {:.3} deg beside the axis, write it into the column `power`, then: holodrive \
             calibrate curve --panel {} --wavelength {} --powers {}",
            angle.to_degrees(),
            args.panel.panel,
            show_length(*wavelength),
            folder.join("manifest.csv").display()
        ),
    );
    Ok(report)
}

fn curve(args: &CurveArgs, powers: &Path) -> Result<Report> {
    let mut report = Report::new("calibrate curve");
    let panel = phase_panel(&args.panel, &mut report)?;
    let begin = Instant::now();
    let measured = measure_curve(&panel.profile, panel.wavelength, powers, args.order, args.degree)?;
    let output = args.output.as_deref().unwrap_or(Path::new("calibrated.toml"));
    measured.write(output)?;
    let found = &measured.report;
    if found.range < TAU {
        report.warn([format!(
            "the curve spans {:.2}π at {}, less than a turn: phases beyond it get its nearest end; the encodings gradient, \
             weighted and error-diffusion allow for it",
            found.range / PI,
            show_length(panel.wavelength)
        )]);
    }
    report.section(found);
    report.line(format!(
        "curve        {:>8}  at {}: {:.3}π from the lowest level to the highest, uncertain by {:.4} rad RMS, {:.4} rad at most; \
         polynomial of degree {}{}",
        seconds(begin.elapsed().as_secs_f64()),
        show_length(panel.wavelength),
        found.range / PI,
        found.uncertainty_rms,
        found.uncertainty_most,
        found.degree,
        found.regions.map_or_else(String::new, |[c, r]| format!(", {c} × {r} regions (the worst of them)"))
    ));
    if let Some(levels) = found.levels_for_2pi {
        report.line(format!("2π          at {levels:.1} levels (mean slope)"));
    }
    report.output("profile", output);
    Ok(report)
}

fn steps(args: &FlatnessArgs) -> Result<Report> {
    let mut report = Report::new("calibrate flatness");
    let setup = phase_panel(&args.panel, &mut report)?;
    if args.into.is_some() {
        return Err(Error::parameter("into", "the correction is not known before --interferograms or --zernike"));
    }
    let series = step_frames(&setup.profile, setup.wavelength, args.steps)?;
    let folder = args.output.as_deref().unwrap_or(Path::new("steps"));
    give_out(&series, folder, &args.shown, (&args.panel, &setup), &mut report)?;
    report.line(
        "superpose the panel's light with a flat wave, picture its pixels one to one in each step, then: holodrive calibrate \
         flatness --interferograms …",
    );
    Ok(report)
}

fn flatness(args: &FlatnessArgs) -> Result<Report> {
    let mut report = Report::new("calibrate flatness");
    let Setup { profile, wavelength, grid, .. } = phase_panel(&args.panel, &mut report)?;
    let output = args.output.as_deref().unwrap_or(Path::new("flatness.npy"));
    let error = if args.zernike.is_empty() {
        wavefront_from_files(&profile, wavelength, &args.interferograms)?
    } else {
        let radius = args.radius.ok_or_else(|| Error::parameter("radius", "the coefficients' circle is needed"))?;
        let radians: Vec<f64> = args.zernike.iter().map(|waves| waves * TAU).collect();
        zernike::wavefront(grid, wavelength, &radians, radius, "wavefront error of Zernike coefficients")?
    };
    let found = Flatness::of(&error);
    write_correction(error, output, &profile, wavelength, args.into.as_deref())?;
    report.section(found);
    let beside = if args.zernike.is_empty() {
        " (of phases wrapped to a turn)".into()
    } else {
        format!(", {:.2} from lowest to highest", found.span / TAU)
    };
    let light = show_length(wavelength);
    report.line(format!("wavefront    {:.3} waves of {light} RMS about its mean{beside}", found.rms / TAU));
    report.output("correction", output);
    if let Some(into) = &args.into {
        report.file("profile", "profile", into);
    }
    Ok(report)
}

fn check(args: &CheckArgs) -> Result<Report> {
    let mut report = Report::new("calibrate check");
    let panel = phase_panel(&args.panel, &mut report)?;
    let correction = told_correction(&panel, &mut report)?;
    let made = cards(&panel.profile, panel.wavelength, correction.as_ref(), args.distance, &Progress::new())?;
    give_out(&card_frames(&made), &args.output, &args.shown, (&args.panel, &panel), &mut report)?;
    for card in &made {
        report.add(card.name, card.look_for.clone(), format!("{}: {}", card.name, card.look_for));
    }
    Ok(report)
}
