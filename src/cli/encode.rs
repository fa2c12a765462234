//! Fields and pictures as frames.

use super::args::{EncodeArgs, EncodingArgs};
use super::bar::Bar;
use super::holograms::{Maker, report_encoding};
use super::load::{Input, input};
use super::report::{Report, step};
use super::resolve;
use holodrive::encode::pictures::{DepthPicture, encode_planes};
use holodrive::encode::{Encoding, PlaneEncoding, PlaneMethod, PlaneStart};
use holodrive::field::npy;
use holodrive::names::Named;
use holodrive::panel::{Frame, Origin, Setup};
use holodrive::pipeline::Settings;
use holodrive::progress::Progress;
use holodrive::reconstruction::read_gray;
use holodrive::scene::texture::linear_from_srgb;
use holodrive::{Error, Result};
use std::path::Path;
use std::time::Instant;

pub(super) fn encode(args: &EncodeArgs) -> Result<Report> {
    let mut report = Report::new("encode");
    report.warn(&args.idle);
    let setup = resolve::setup(&args.panel, &mut report)?;
    let setup = Setup { correction: resolve::correction(args.encoding.correction.as_deref())?, ..setup };
    let bar = Bar::new();
    let frame = if args.input.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        encode_field(args, &setup, &bar.progress, &mut report)?
    } else {
        encode_picture(args, &setup, &bar.progress, &mut report)?
    };
    bar.progress.check()?;
    frame.write(&args.output)?;
    report.output("frame", &args.output);
    Ok(report)
}

fn encode_field(args: &EncodeArgs, setup: &Setup, progress: &Progress, report: &mut Report) -> Result<Frame> {
    let pitch = [setup.grid.pitch_x, setup.grid.pitch_y];
    let beside = npy::read_metadata(&args.input)?;
    let wavelength = args.panel.wavelength.or(beside.as_ref().map(|m| m.wavelength)).unwrap_or(setup.wavelength);
    let (field, metadata) = npy::read_field(&args.input, Some(pitch), Some(wavelength))?;
    let settings = Settings { encode: resolve::encode(&args.encoding, setup)?, ..Settings::default() };
    let maker = Maker { input: &args.input, setup, settings: &settings, progress };
    maker.frame(&field, &metadata.content, None, report)
}

/// A picture at one depth, or sorted by its depth map into several.
fn encode_picture(args: &EncodeArgs, setup: &Setup, progress: &Progress, report: &mut Report) -> Result<Frame> {
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
    let (settings, warnings) = resolve::encode(&flags, setup)?.settings(setup, setup.wavelength, None)?;
    report.warn(warnings);
    let Encoding::Planes(given) = &settings.encoding else {
        return Err(Error::parameter("encoding", "is for fields"));
    };
    let (rgb, map) = match input(&args.input)? {
        Input::Images(rgb, map) => (rgb, Some(map)),
        Input::Frame(path) => (path, None),
        _ => return Err(Error::input(&args.input, "is neither a field (.npy) nor a picture")),
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
    let planes = read_picture(&rgb, map.as_deref(), &own.depths)?.planes(&setup.grid, args.picture.window)?;
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

/// A picture as linear light; with a depth map (white near), its pixels are sorted into the nearest of the depths.
fn read_picture(rgb: &Path, map: Option<&Path>, depths: &[f64]) -> Result<DepthPicture> {
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
    let (w, h, nearness) = read_gray(map)?;
    if (w, h) != (width, height) {
        return Err(Error::input(map, format!("is {w}×{h}, the picture {width}×{height}")));
    }
    let near = depths.iter().fold(f64::NEG_INFINITY, |a, &z| a.max(z));
    let far = depths.iter().fold(f64::INFINITY, |a, &z| a.min(z));
    let z: Vec<f64> = nearness.iter().map(|&v| far + (near - far) * f64::from(v)).collect();
    Ok(DepthPicture::sorted(width, height, light, &z, depths))
}
