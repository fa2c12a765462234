//! `encode --in-the-loop`: a picture in the focal plane of a lens, with a camera in the loop.

use super::args::EncodeArgs;
use super::bar::Bar;
use super::camera_command::CameraCommand;
use super::output;
use super::report::{Report, step};
use crate::calibration::{CameraPhoto, CameraView, photo_file};
use crate::encode::far::{FarPicture, FarPlane, FarReport, FarSettings, Photograph, far_frame};
use crate::files;
use crate::names::Named;
use crate::panel::{Frame, Origin, Setup};
use crate::reconstruction::read_gray;
use crate::scene::texture::linear_from_srgb;
use crate::{Error, Result};
use std::path::Path;
use std::time::Instant;

pub(super) fn encode(args: &EncodeArgs, camera: &Path, setup: &Setup, report: &mut Report) -> Result<()> {
    let flags = &args.camera;
    if let Some(encoding) = &args.encoding.encoding {
        let what = format!("--in-the-loop finds phases in its own way; leave out --encoding {}", encoding.name());
        return Err(Error::parameter("encoding", what));
    }
    let needed = "is needed: it shows a frame and takes its photo";
    let command = flags.camera_command.as_deref().ok_or_else(|| Error::parameter("camera-command", needed))?;
    let command = CameraCommand::new(command)?;
    let view = CameraView::read(camera)?;
    let (width, height, coded) = read_gray(&args.input)?;
    let light = coded.into_iter().map(linear_from_srgb).collect();
    let room = view.room(flags.room)?;
    let plane = FarPlane::new(&FarPicture { width, height, light, room }, &setup.profile)?;
    let places = view.places(&plane.frequencies())?;
    let usual = FarSettings::default();
    let settings = FarSettings {
        iterations: args.encoding.iterations.map_or(usual.iterations, |count| count as usize),
        photos: flags.camera_photos,
        ..usual
    };
    let stem = args.output.file_stem().unwrap_or_default().to_string_lossy();
    let folder = args.output.with_file_name(format!("{stem}-photos"));
    files::output_folder(&folder)?;
    let mut count = 0;
    let mut photograph = |frame: &Frame| {
        let name = format!("photo-{count:03}");
        count += 1;
        let shown = folder.join("frame.png");
        frame.write(&shown)?;
        command.take(&shown, &folder.join(&name))?;
        view.registered(&CameraPhoto::read(&photo_file(&folder, &name)?)?, &places)
    };
    let (bar, begin) = (Bar::new(), Instant::now());
    let with_camera: &mut Photograph<'_> = &mut photograph;
    let (mut frame, found) = far_frame(&plane, setup, &settings, Some(with_camera), &bar.progress)?;
    frame.metadata.origin = Origin { source: Some(args.input.display().to_string()), ..Origin::default() };
    output::write_frame(&frame, &args.output)?;
    tell(&found, begin.elapsed().as_secs_f64(), report);
    report.file("photos", "photos", &folder);
    report.output("frame", &args.output);
    Ok(())
}

fn tell(found: &FarReport, elapsed: f64, report: &mut Report) {
    report.section(found);
    let [columns, rows] = found.samples;
    let first = found.photo_psnr.first().copied().unwrap_or(f64::NAN);
    let best = found.photo_psnr.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let what = format!(
        "{columns}×{rows} samples: {:.1} dB by the model, {first:.1} dB in the first photo, {best:.1} dB in the best",
        found.model_psnr
    );
    report.add("encode_seconds", elapsed, step("encode", elapsed, what));
}
