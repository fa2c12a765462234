//! Fields and pictures as frames.

use super::args::{EncodeArgs, EncodingArgs};
use super::bar::Bar;
use super::eye;
use super::field::{self, For, Held};
use super::holograms::{Maker, named, report_encoding};
use super::in_the_loop;
use super::light::report_map;
use super::load::{Input, input};
use super::output;
use super::report::{Report, step};
use super::resolve;
use crate::encode::pictures::{DepthPicture, encode_planes};
use crate::encode::{Encoding, PlaneEncoding, PlaneMethod, PlaneStart, ViewEncoding};
use crate::light_field::LightField;
use crate::names::Named;
use crate::panel::{Frame, Origin, Setup};
use crate::pipeline::{self, Settings};
use crate::points::Exposure;
use crate::points::depth_map::DepthMap;
use crate::progress::Progress;
use crate::reconstruction::read_gray;
use crate::scene::texture::linear_from_srgb;
use crate::{Error, Result};
use std::path::{Path, PathBuf};
use std::time::Instant;

pub(super) fn encode(args: &EncodeArgs) -> Result<Report> {
    let mut report = Report::new("encode");
    report.warn(&args.idle);
    let setup = resolve::setup(&args.panel, &mut report)?;
    let setup = Setup { correction: resolve::correction(args.encoding.correction.as_deref())?, ..setup };
    let bar = Bar::new();
    let source = input(&args.input)?;
    output::check(&args.output, &output::FRAMES)?;
    if let Some(camera) = &args.camera.in_the_loop {
        in_the_loop::encode(args, camera, &setup, &mut report)?;
        return Ok(report);
    }
    if let Input::Views(path) = &source {
        encode_views(args, path, &setup, &bar.progress, &mut report)?;
        return Ok(report);
    }
    if args.subframes != 1 {
        let what = "several frames together are found for a light field (.npz, folder), or by show";
        return Err(Error::parameter("subframes", what));
    }
    let frame = match source {
        Input::Field(path) => encode_field(args, &path, &setup, &bar.progress, &mut report)?,
        source => encode_picture(args, &source, &setup, &bar.progress, &mut report)?,
    };
    bar.progress.check()?;
    output::write_frame(&frame, &args.output)?;
    report.output("frame", &args.output);
    Ok(report)
}

/// Frames that show a light field.
fn encode_views(args: &EncodeArgs, path: &Path, setup: &Setup, progress: &Progress, report: &mut Report) -> Result<()> {
    let file = LightField::read(path)?;
    let encode = resolve::encode(&args.encoding, Encoding::View(ViewEncoding::default()))?;
    let Some(Encoding::View(view)) = encode.encoding.clone() else {
        let name = encode.encoding.as_ref().map_or("this encoding", |encoding| encoding.name());
        let what = format!("{name} encodes a field, not a light field: take view");
        return Err(Error::parameter("encoding", what));
    };
    let viewer = resolve::viewer(&args.viewer, None, Some(&file));
    resolve::check_viewer(&viewer, setup)?;
    let settings =
        Settings { encode, viewer, sub_frames: resolve::sub_frames(args.subframes, false, 1)?, ..Settings::default() };
    let light = eye::light_field(&eye::Content::Views(file), setup, &settings, progress, report)?;
    let exposures = pipeline::exposures(setup, &settings, None);
    let maker = Maker { input: &args.input, setup, settings: &settings, progress };
    let path = |exposure: &Exposure| named(&args.output, &exposure.suffix());
    maker.views(&view, &light, &exposures, path, report)?;
    report.value("output", args.output.display().to_string());
    exposures.iter().for_each(|exposure| report.line(format!("{:<12} {}", "frame", path(exposure).display())));
    Ok(())
}

fn encode_field(
    args: &EncodeArgs,
    path: &Path,
    setup: &Setup,
    progress: &Progress,
    report: &mut Report,
) -> Result<Frame> {
    let wanted = For { flags: &args.field, panel: Some(&setup.profile), wavelength: args.panel.wavelength, progress };
    match wanted.read(path, report)? {
        Held::Levels(_) if args.encoding.encoding.is_some() => {
            let what = "is for a field; whole numbers are drive levels already: leave it out, or save complex numbers or phases";
            Err(Error::parameter("encoding", what))
        }
        Held::Levels(frame) => Ok(*frame),
        Held::Field { field, content, are_phases } => {
            let usual = field::usual(setup.profile.modulation(), are_phases);
            let settings = Settings { encode: resolve::encode(&args.encoding, usual)?, ..Settings::default() };
            let maker = Maker { input: &args.input, setup, settings: &settings, progress };
            maker.frame(&field, &content, None, report)
        }
    }
}

/// A picture at one depth, or sorted by its depth map into several.
fn encode_picture(
    args: &EncodeArgs,
    source: &Input,
    setup: &Setup,
    progress: &Progress,
    report: &mut Report,
) -> Result<Frame> {
    let begin = Instant::now();
    let usual = || Encoding::Planes(PlaneEncoding::new(PlaneMethod::Gradient));
    let chosen = args.encoding.encoding.clone().unwrap_or_else(usual);
    if !matches!(chosen, Encoding::Planes(_)) {
        let what = format!(
            "{} encodes a field, not a picture: take plane-gradient, weighted, gerchberg-saxton or double-constraint, or \
             compute the field first",
            chosen.name()
        );
        return Err(Error::parameter("encoding", what));
    }
    let flags = EncodingArgs { encoding: Some(chosen), ..args.encoding.clone() };
    let (settings, warnings) = resolve::encode(&flags, usual())?.settings(setup, setup.wavelength, None)?;
    report.warn(warnings);
    let Encoding::Planes(given) = &settings.encoding else {
        return Err(Error::parameter("encoding", "is for fields"));
    };
    let (rgb, map) = match source {
        Input::Images(rgb, map) => (rgb, Some(map)),
        Input::Frame(path) => (path, None),
        _ => return Err(Error::input(&args.input, "is neither a field (.npy, .mat, .h5) nor a picture")),
    };
    if given.depths.is_empty() {
        return Err(Error::parameter("depths", "give the depth at which the picture stands, such as --depths -100mm"));
    }
    let start = match args.encoding.start {
        Some(typed) => typed,
        // Random phases bring light from all of the panel to all of the picture; a double constraint asks for smooth ones.
        None if given.method == PlaneMethod::DoubleConstraint => PlaneStart::Field,
        None => PlaneStart::Random { seed: 1 },
    };
    let own = PlaneEncoding { start, ..given.clone() };
    let planes = read_picture(args, rgb, map.map(PathBuf::as_path), &own.depths, report)?
        .planes(&setup.grid, args.picture.window)?;
    let kept: Vec<f64> = planes.iter().map(|plane| plane.z).collect();
    let (correction, light) = (settings.correction.as_ref(), settings.illumination);
    let (mut made, found) = encode_planes(planes, setup.wavelength, &setup.profile, &own, correction, light, progress)?;
    let ends = kept.iter().fold([f64::NEG_INFINITY, f64::INFINITY], |[near, far], &z| [near.max(z), far.min(z)]);
    let source = Some(args.input.display().to_string());
    made.frame.metadata.origin = Origin { source, depth: Some(ends), ..Origin::default() };
    report_encoding(&made.report, report);
    report.value("depths", kept);
    report.value("psnr", &found.psnr);
    report.value("history", &found.history);
    report.value("rejected", found.rejected);
    let elapsed = begin.elapsed().as_secs_f64();
    let what = format!(
        "{}: {} dB at its depths on this panel (simulated), {:.1} % of the light in the picture",
        made.report.method,
        found.psnr.iter().map(|p| format!("{p:.1}")).collect::<Vec<_>>().join(", "),
        100.0 * made.report.efficiency
    );
    report.add("encode_seconds", elapsed, step("encode", elapsed, what));
    Ok(made.frame)
}

/// A picture as linear light; with a depth map its pixels are sorted into the nearest of the depths.
fn read_picture(
    args: &EncodeArgs,
    rgb: &Path,
    map: Option<&Path>,
    depths: &[f64],
    report: &mut Report,
) -> Result<DepthPicture> {
    let (width, height, coded) = read_gray(rgb)?;
    let light: Vec<f32> = coded.into_iter().map(linear_from_srgb).collect();
    let Some(map) = map else {
        let [z] = depths else {
            let what =
                format!("{} depths for a picture without a depth map; give one, or rgb.png+depth.png", depths.len());
            return Err(Error::parameter("depths", what));
        };
        return Ok(DepthPicture::flat(width, height, light, *z));
    };
    let read = DepthMap::read(map, &args.map.reading())?;
    report_map(&read, report);
    if (read.width as usize, read.height as usize) != (width, height) {
        return Err(Error::input(map, format!("is {}×{}, the picture {width}×{height}", read.width, read.height)));
    }
    let near = depths.iter().fold(f64::NEG_INFINITY, |a, &z| a.max(z));
    let far = depths.iter().fold(f64::INFINITY, |a, &z| a.min(z));
    // What was not measured is dark, and stands behind.
    let mut light = light;
    light.iter_mut().zip(&read.parts).filter(|(_, part)| part.is_nan()).for_each(|(light, _)| *light = 0.0);
    let place = |part: &f32| if part.is_nan() { far } else { near + (far - near) * f64::from(*part) };
    let z: Vec<f64> = read.parts.iter().map(place).collect();
    Ok(DepthPicture::sorted(width, height, light, &z, depths))
}
