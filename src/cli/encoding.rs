//! Fields and pictures as frames: the flags of the encodings, resolved.

use super::args::{EncodeArgs, EncodingArgs};
use super::bar::Bar;
use super::load::{Input, Panel, input, panel, panel_correction};
use super::report::{Report, seconds};
use holodrive::encode::pictures::{DepthPicture, encode_planes};
use holodrive::encode::{
    DoublePhase, EncodeReport, EncodeSettings, Encoding, OffAxis, PlaneEncoding, PlaneMethod, PlaneStart, Reference,
    blaze_and_lens,
};
use holodrive::field::{Field, npy};
use holodrive::names::Named;
use holodrive::panel::{Frame, Modulation, Origin};
use holodrive::pipeline;
use holodrive::progress::Progress;
use holodrive::reconstruction::read_gray;
use holodrive::scene::texture::linear_from_srgb;
use holodrive::{Error, Result};
use std::path::Path;
use std::time::Instant;

/// Encoding settings for a kind of panel; `content` is where a field's light stands.
pub(super) fn encode_settings(
    args: &EncodingArgs,
    panel: &Panel,
    content: Option<[f64; 2]>,
    report: &mut Report,
) -> Result<EncodeSettings> {
    let mut encoding = args.encoding.clone().unwrap_or_else(|| match panel.profile.modulation() {
        Modulation::Amplitude => Encoding::OffAxisBipolar(OffAxis::default()),
        Modulation::Phase => Encoding::DoublePhase(DoublePhase::default()),
    });
    let chosen = encoding.name();
    if let Some(angles) = args.reference_angle {
        match &mut encoding {
            Encoding::OffAxisBipolar(fringe) | Encoding::OffAxisIntensity(fringe) => {
                fringe.reference = Some(Reference::Angle(angles));
            }
            Encoding::Binary(binary) => binary.fringe.reference = Some(Reference::Angle(angles)),
            _ => {
                let what = format!("{chosen} has no reference wave to turn; leave --reference-angle out");
                return Err(Error::parameter("reference-angle", what));
            }
        }
    }
    let iterations = args.iterations.map(|n| n as usize);
    let without = |flag: &'static str| Error::parameter(flag, format!("{chosen} has no use for it; leave it out"));
    match &mut encoding {
        Encoding::Planes(planes) => {
            planes.iterations = iterations.unwrap_or(planes.iterations);
            planes.depths = depths(args, content, report)?;
            planes.start = args.start.unwrap_or(planes.start);
        }
        Encoding::Gradient(gradient) => gradient.iterations = iterations.unwrap_or(gradient.iterations),
        _ if iterations.is_some() => return Err(without("iterations")),
        _ => {}
    }
    if !matches!(encoding, Encoding::Planes(_)) {
        if !args.depths.is_empty() {
            return Err(without("depths"));
        }
        if args.start.is_some() {
            return Err(without("start"));
        }
    }
    let mut settings = EncodeSettings::new(encoding);
    settings.illumination = blaze_and_lens(args.blaze.unwrap_or([0.0; 2]), args.lens, panel.wavelength)?;
    settings.stop = args.band_stop.map_or(0.0, |angle| angle.sin().abs() / panel.wavelength);
    // Fringes are for a panel between polarisers, or one that modulates amplitude: no phase to correct.
    let phase = settings.encoding.modulation() == Modulation::Phase && panel.profile.modulation() == Modulation::Phase;
    if phase {
        settings.correction = panel_correction(panel, args.correction.as_deref(), report)?;
    } else if args.correction.is_some() {
        return Err(without("correction"));
    }
    Ok(settings)
}

/// Depths as they were typed, or three over the content's.
fn depths(args: &EncodingArgs, content: Option<[f64; 2]>, report: &mut Report) -> Result<Vec<f64>> {
    if args.depths.len() > 64 {
        return Err(Error::parameter("depths", format!("{} planes; at most 64", args.depths.len())));
    }
    if !args.depths.is_empty() {
        args.depths.iter().for_each(|z| report.check_side("depths", *z, content));
        return Ok(args.depths.clone());
    }
    Ok(match content {
        Some([near, far]) if (near - far).abs() > 1e-6 => vec![near, 0.5 * (near + far), far],
        Some([near, _]) => vec![near],
        None => Vec::new(),
    })
}

/// A field as a frame, with its time.
pub(super) fn encode_field(
    field: &Field,
    args: &EncodingArgs,
    panel: &Panel,
    origin: &Origin,
    progress: &Progress,
    report: &mut Report,
) -> Result<Frame> {
    let begin = Instant::now();
    let profile = panel.profile.clone();
    let at = Panel { profile, grid: panel.grid, wavelength: field.wavelength, lasers: None };
    let settings = encode_settings(args, &at, origin.depth, report)?;
    let mut encoded = pipeline::frame(field, &panel.profile, &settings, progress)?;
    encoded.frame.metadata.origin = origin.clone();
    let (elapsed, did) = (begin.elapsed().as_secs_f64(), &encoded.report);
    report_encoding(did, report);
    report.add(
        "encode_seconds",
        elapsed,
        format!(
            "encode       {:>8}  {}: efficiency {:.2} %, field error {:.3} in its band, {:.1} % of the light outside the band dropped",
            seconds(elapsed),
            did.method,
            100.0 * did.efficiency,
            did.field_error,
            100.0 * did.dropped
        ),
    );
    Ok(encoded.frame)
}

fn report_encoding(did: &EncodeReport, report: &mut Report) {
    report.warn(did.warnings.iter());
    report.add("encoding", did.method, "");
    report.add("efficiency", did.efficiency, "");
    report.add("encoding_field_error", did.field_error, "");
    report.add("clipped", did.clipped, "");
    report.add("dropped", did.dropped, "");
    report.add("quantisation_error", did.quantisation_error, "");
    report.add("unreachable", did.unreachable, "");
}

pub(super) fn encode(args: &EncodeArgs) -> Result<Report> {
    let mut report = Report::new("encode");
    let panel = panel(&args.panel, &mut report)?;
    let picture = args.input.extension().is_none_or(|e| !e.eq_ignore_ascii_case("npy"));
    let bar = Bar::new();
    let frame = if picture {
        encode_picture(args, &panel, &bar.progress, &mut report)?
    } else {
        let pitch = [panel.grid.pitch_x, panel.grid.pitch_y];
        let beside = npy::read_metadata(&args.input)?;
        let wavelength = args.panel.wavelength.or(beside.as_ref().map(|m| m.wavelength)).unwrap_or(panel.wavelength);
        let (field, metadata) = npy::read_field(&args.input, Some(pitch), Some(wavelength))?;
        let source = Some(args.input.display().to_string());
        let origin = Origin { source, depth: metadata.content.depth, ..Origin::default() };
        encode_field(&field, &args.encoding, &panel, &origin, &bar.progress, &mut report)?
    };
    bar.progress.check()?;
    frame.write(&args.output)?;
    report.output("frame", &args.output);
    Ok(report)
}

/// A picture at one depth, or sorted by its depth map into several.
fn encode_picture(args: &EncodeArgs, panel: &Panel, progress: &Progress, report: &mut Report) -> Result<Frame> {
    let begin = Instant::now();
    let usual = || Encoding::Planes(PlaneEncoding::new(PlaneMethod::Gradient));
    let chosen = args.encoding.encoding.clone().unwrap_or_else(usual);
    let Encoding::Planes(PlaneEncoding { method, .. }) = chosen else {
        let what = format!(
            "{} encodes a field, not a picture: take plane-gradient, weighted, gerchberg-saxton or double-constraint, \
             or compute the field first",
            chosen.name()
        );
        return Err(Error::parameter("encoding", what));
    };
    let (rgb, map) = match input(&args.input)? {
        Input::Images(rgb, map) => (rgb, Some(map)),
        Input::Frame(path) => (path, None),
        _ => return Err(Error::input(&args.input, "is neither a field (.npy) nor a picture")),
    };
    let depths = depths(&args.encoding, None, report)?;
    if depths.is_empty() {
        return Err(Error::parameter("depths", "give the depth at which the picture stands, such as --depths -100mm"));
    }
    let flags = EncodingArgs { encoding: Some(chosen), ..args.encoding.clone() };
    let settings = encode_settings(&flags, panel, None, report)?;
    let Encoding::Planes(given) = &settings.encoding else {
        return Err(Error::parameter("encoding", "is for fields"));
    };
    let first = match args.encoding.start {
        Some(typed) => typed,
        // Random phases bring light from all of the panel to all of the picture; a double constraint asks for smooth ones.
        None if method == PlaneMethod::DoubleConstraint => PlaneStart::Field,
        None => PlaneStart::Random { seed: 1 },
    };
    let own = PlaneEncoding { start: first, depths: depths.clone(), ..given.clone() };
    let picture = read_picture(&rgb, map.as_deref(), &depths)?;
    let planes = picture.planes(&panel.grid, args.window)?;
    let kept: Vec<f64> = planes.iter().map(|plane| plane.z).collect();
    let (mut made, found) = encode_planes(
        planes,
        panel.wavelength,
        &panel.profile,
        &own,
        (settings.correction.as_ref(), settings.illumination),
        progress,
    )?;
    let ends = kept.iter().fold([f64::NEG_INFINITY, f64::INFINITY], |[near, far], &z| [near.max(z), far.min(z)]);
    let source = Some(args.input.display().to_string());
    made.frame.metadata.origin = Origin { source, depth: Some(ends), ..Origin::default() };
    let elapsed = begin.elapsed().as_secs_f64();
    report_encoding(&made.report, report);
    report.add("depths", kept, "");
    report.add("psnr", found.psnr.clone(), "");
    report.add("history", found.history.clone(), "");
    report.add("rejected", found.rejected, "");
    report.add(
        "encode_seconds",
        elapsed,
        format!(
            "encode       {:>8}  {}: {} dB at its depths on this panel (simulated), {:.1} % of the light in the picture",
            seconds(elapsed),
            made.report.method,
            found.psnr.iter().map(|p| format!("{p:.1}")).collect::<Vec<_>>().join(", "),
            100.0 * made.report.efficiency
        ),
    );
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
