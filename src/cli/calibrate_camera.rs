//! `calibrate camera`: frames for a camera, and the profile that its photos tell.

use super::args::CameraArgs;
use super::bar::Bar;
use super::camera_command::CameraCommand;
use super::given_out::{give_out, phase_panel};
use super::report::{Report, seconds};
use crate::calibration::{
    CameraBench, CameraPhoto, CameraReport, RANDOM, calibrate_camera, camera_frames, camera_photo_file, photo_name,
};
use crate::files;
use crate::panel::Setup;
use crate::progress::Progress;
use crate::{Error, Result};
use std::f64::consts::PI;
use std::path::Path;
use std::time::Instant;

pub(super) fn camera(args: &CameraArgs) -> Result<Report> {
    let mut report = Report::new("calibrate camera");
    let setup = phase_panel(&args.panel, &mut report)?;
    let Setup { profile, wavelength, .. } = &setup;
    let series = camera_frames(profile, *wavelength)?;
    if args.photos.is_none() && args.camera_command.is_none() {
        if args.lens.is_some() || args.camera_pitch.is_some() {
            let what = "lens and camera pitch are for --photos or --camera-command";
            return Err(Error::parameter("lens, camera-pitch", what));
        }
        let folder = args.output.as_deref().unwrap_or(Path::new("patterns"));
        give_out(&series, folder, &args.shown, (&args.panel, &setup), &mut report)?;
        report.line(
            "take a photo of each in the focal plane of a lens behind the panel, name it as its frame, then: holodrive calibrate \
             camera --photos … --lens … --camera-pitch …",
        );
        return Ok(report);
    }
    let needed = |value: Option<f64>, name: &'static str| {
        value.ok_or_else(|| Error::parameter(name, "is needed to know where light goes on the camera"))
    };
    let bench =
        CameraBench { lens: needed(args.lens, "lens")?, camera_pitch: needed(args.camera_pitch, "camera-pitch")? };
    let output = args.output.as_deref().unwrap_or(Path::new("calibrated.toml"));
    if !output.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return Err(Error::parameter("output", format!("{}: a profile's name ends in .toml", output.display())));
    }
    let bar = Bar::new();
    let folder = match (&args.photos, &args.camera_command) {
        (Some(folder), _) => folder.clone(),
        (None, command) => {
            let stem = output.file_stem().unwrap_or_default().to_string_lossy();
            let folder = output.with_file_name(format!("{stem}-photos"));
            let command = command.as_deref().unwrap_or_default();
            files::output_folder(&folder)?;
            let frames = folder.join("frames");
            series.write(&frames, &bar.progress)?;
            take(command, &folder, &frames, &bar.progress)?;
            report.file("photos", "photos", &folder);
            folder
        }
    };
    let photos =
        (0..=RANDOM).map(|k| CameraPhoto::read(&camera_photo_file(&folder, k)?)).collect::<Result<Vec<_>>>()?;
    let begin = Instant::now();
    let fit = calibrate_camera(profile, *wavelength, &bench, &photos, &bar.progress)?;
    fit.write(profile, output)?;
    tell(&fit.report, begin.elapsed().as_secs_f64(), &mut report);
    report.output("profile", output);
    Ok(report)
}

/// Runs the command for each frame.
fn take(command: &str, folder: &Path, frames: &Path, progress: &Progress) -> Result<()> {
    let camera = CameraCommand::new(command)?;
    progress.start("photos", RANDOM as u64 + 1);
    for k in 0..=RANDOM {
        progress.check()?;
        let name = photo_name(k);
        camera.take(&frames.join(format!("{name}.png")), &folder.join(&name))?;
        progress.advance(1);
    }
    Ok(())
}

fn tell(found: &CameraReport, time: f64, report: &mut Report) {
    report.section(found);
    let r = found;
    report.line(format!(
        "camera       {:>8}  {} dots of the card, {:.2} pixels RMS; mapping uncertain by {:.3} pixels; what the fit leaves of the \
         photos is {:.2} of a camera's noise of 1 %",
        seconds(time),
        r.dots,
        r.dots_rms,
        r.mapping_uncertainty,
        r.misfit.sqrt()
    ));
    if r.misfit > 4.0 {
        report.warn(["the photos hold more than the model says: gamma, other light, or a moving bench".to_string()]);
    }
    report.line(format!(
        "wavefront    {:.3} waves RMS, {:.2} from lowest to highest, ± {:.4}",
        r.wavefront_rms, r.wavefront_span, r.wavefront_uncertainty
    ));
    report.line(format!(
        "curve        {:.3}π from the lowest level to the highest ({:.3}π to {:.3}π over the panel), ± {:.4} rad",
        r.range / PI,
        r.range_over_panel[0] / PI,
        r.range_over_panel[1] / PI,
        r.curve_uncertainty
    ));
    report.line(format!(
        "beam         brightest at {:+.2}, {:+.2} of the half panel; least amplitude {:.2} of that, ± {:.2} %",
        r.beam_middle[0],
        r.beam_middle[1],
        r.beam_least,
        100.0 * r.beam_uncertainty
    ));
    report.line(format!("crosstalk    {:.3} pixels ± {:.4}", r.crosstalk, r.crosstalk_uncertainty));
    report.line(format!(
        "unmodulated  {:.2} % of the light ± {:.2} %",
        100.0 * r.unmodulated,
        100.0 * r.unmodulated_uncertainty
    ));
}
