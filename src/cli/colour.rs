//! Three holograms from one trace: fields, frames and pictures in red, green and blue.

use super::args::{ComputeArgs, ShowArgs};
use super::commands::{content, origin, report_field};
use super::encoding::encode_field;
use super::light::report_gamut;
use super::load::{Panel, Points, hologram_settings};
use super::report::Report;
use super::show::{report_likeness, report_pictures};
use holodrive::field::npy::{self, Content};
use holodrive::hologram::HologramSettings;
use holodrive::panel::simulated::Simulation;
use holodrive::panel::{Frame, Origin};
use holodrive::pipeline::{self, ColorFields, Lit};
use holodrive::points::colour::{Lasers, NAMES};
use holodrive::progress::Progress;
use holodrive::reconstruction::colour::laser_powers;
use holodrive::reconstruction::{self, ColorPicture, ExposureLight, Light, Scale, View};
use holodrive::units::show_length;
use holodrive::{Error, Result};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// `field.npy` → `field-red.npy`.
pub(super) fn named(path: &Path, name: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
    path.with_file_name(format!("{stem}-{name}{extension}"))
}

/// The line that heads a laser's part of a report.
fn heading(i: usize, lasers: &Lasers) -> String {
    format!("{:<12} {}", NAMES[i], show_length(lasers.wavelengths()[i]))
}

fn fields(
    points: &Points,
    lasers: &Lasers,
    panel: &Panel,
    settings: &HologramSettings,
    progress: &Progress,
    report: &mut Report,
) -> Result<ColorFields> {
    let fields = pipeline::color_fields(&points.cloud, lasers, points.path_eye, &panel.grid, settings, progress)?;
    report_gamut(lasers, &fields.gamut, report);
    progress.check()?;
    Ok(fields)
}

/// `compute` with three lasers: a field file for each.
pub(super) fn compute(
    args: &ComputeArgs,
    (panel, lasers): (&Panel, &Lasers),
    points: &Points,
    progress: &Progress,
    report: &mut Report,
) -> Result<()> {
    let settings = hologram_settings(&args.hologram);
    let fields = fields(points, lasers, panel, &settings, progress, report)?;
    for (i, computed) in fields.computed.iter().enumerate() {
        let mut part = Report::new("compute");
        part.add("wavelength", lasers.wavelengths()[i], "");
        match computed {
            Some(computed) => {
                report_field(computed, &mut part);
                let path = named(&args.output, NAMES[i]);
                let content = content(&points.cloud, &points.metadata);
                npy::write_field(&path, &computed.field, &content, &source(&args.input, points, lasers, i))?;
                part.output("field", &path);
            }
            None => part.add("dark", true, "dark         no light for this laser, no field"),
        }
        report.add_part(NAMES[i], heading(i, lasers), part);
    }
    Ok(())
}

/// Where a field comes from, and which of the three it is.
fn source(input: &Path, points: &Points, lasers: &Lasers, i: usize) -> String {
    let all = lasers.wavelengths().map(show_length).join(", ");
    format!("{}; {} of three lasers, {all}", origin(input, &points.cloud), NAMES[i])
}

/// The three frames with their lasers' powers; written as they are.
pub(super) struct Colors {
    /// A frame for each laser; none where it has no light.
    pub(super) frames: [Option<Frame>; 3],
    lasers: Lasers,
}

#[cfg(feature = "display")]
impl Colors {
    /// The three frames in their order; one without light has level 0 everywhere.
    pub(super) fn for_signal(&self) -> Result<Vec<Frame>> {
        let Some(any) = self.frames.iter().flatten().next() else {
            return Err(Error::parameter("wavelengths", "none of the lasers has light"));
        };
        let dark = |i: usize| Frame::new(&any.metadata.panel, self.lasers.wavelengths()[i], vec![0; any.levels.len()]);
        self.frames.iter().enumerate().map(|(i, frame)| frame.clone().map_or_else(|| dark(i), Ok)).collect()
    }
}

/// `show` with three lasers: fields and frames.
pub(super) fn frames(
    args: &ShowArgs,
    (panel, lasers): (&Panel, &Lasers),
    points: &Points,
    progress: &Progress,
    report: &mut Report,
) -> Result<Colors> {
    let settings = hologram_settings(&args.hologram);
    let fields = fields(points, lasers, panel, &settings, progress, report)?;
    let content = content(&points.cloud, &points.metadata);
    let mut frames = [None, None, None];
    for (i, computed) in fields.computed.iter().enumerate() {
        let mut part = Report::new("show");
        part.add("wavelength", lasers.wavelengths()[i], "");
        if let Some(computed) = computed {
            report_field(computed, &mut part);
            let text = source(&args.input, points, lasers, i);
            npy::write_field(&args.output.join(format!("field-{}.npy", NAMES[i])), &computed.field, &content, &text)?;
            let origin = Origin {
                source: Some(args.input.display().to_string()),
                depth: content.depth,
                notes: vec![format!("{} of three lasers", NAMES[i])],
                ..Origin::default()
            };
            frames[i] = Some(encode_field(&computed.field, &args.encoding, panel, &origin, progress, &mut part)?);
        } else {
            part.add("dark", true, "dark         no light for this laser: leave it off");
        }
        report.add_part(NAMES[i], heading(i, lasers), part);
    }
    // Without light a laser's power is nil: 1/∞².
    let scale = |frame: &Option<Frame>| frame.as_ref().map_or(f64::INFINITY, scale_of);
    let powers = laser_powers(lasers, [scale(&frames[0]), scale(&frames[1]), scale(&frames[2])]);
    let line = powers.map(|p| format!("{p:.3}")).join(" : ");
    report.add(
        "laser_powers",
        powers.to_vec(),
        format!("lasers                 powers on the panel of {line} make the colours right"),
    );
    for ((frame, name), power) in frames.iter_mut().zip(NAMES).zip(powers) {
        if let Some(frame) = frame {
            frame.metadata.origin.notes.push(format!("relative laser power {power:.4}"));
            frame.write(&args.output.join(format!("frame-{name}.png")))?;
        }
    }
    Ok(Colors { frames, lasers: *lasers })
}

fn scale_of(frame: &Frame) -> f64 {
    frame.metadata.encoding.as_ref().map_or(1.0, |e| e.scale)
}

/// Refuses a panel whose signal cannot carry three frames, before the work.
pub(super) fn carried(panel: &Panel) -> Result<()> {
    let packing = panel.profile.signal.packing;
    if packing.frames() >= 3 {
        return Ok(());
    }
    let what = format!(
        "panel {} shows {} frame at a time ({}); make the frames without --monitor and show each in its own light: \
         frame-red.png, frame-green.png, frame-blue.png",
        panel.profile.name,
        packing.frames(),
        packing.name()
    );
    Err(Error::parameter("wavelengths", what))
}

/// Reconstructions of the simulated panel's light in colour, and how like the traced picture they are.
pub(super) fn look(
    colors: &Colors,
    lit: Option<&Lit>,
    content: &Content,
    args: &ShowArgs,
    progress: &Progress,
    report: &mut Report,
) -> Result<()> {
    let (begin, out) = (Instant::now(), &args.output);
    let mut behind = Light { exposures: Vec::new(), lasers: Some(colors.lasers) };
    for (laser, frame) in colors.frames.iter().enumerate() {
        if let Some(frame) = frame {
            let (field, mut settings) = pipeline::simulated_light(frame, &Simulation::default(), progress)?;
            settings.block_zero_order(args.zero_order_stop, field.wavelength);
            behind.exposures.push(ExposureLight { field, settings, laser });
        }
    }
    let Some(first) = behind.exposures.first() else {
        return Err(Error::input(&args.input, "has no light for any of the lasers"));
    };
    let Some(lit) = lit else {
        for (name, z) in reconstruction::planes_of(content.depth) {
            let view = View::Plane { z };
            let half = view.seen_half(&first.field.grid, content.eye);
            let seen = behind.picture(&view, half, None, progress)?;
            let white = seen.white(Scale::Percentile(0.995));
            behind.write(&out.join(format!("reconstruction-{name}.png")), &seen, white, &view, half)?;
        }
        report_pictures(begin, report);
        return Ok(());
    };
    let size = (lit.view.width, lit.view.height);
    let placing = &lit.view.placing;
    let half_at = |z: f64| placing.view_at(z);
    let (white, near) = (lit.white.white, content.depth.map_or(0.0, |d| d[0]));
    let target = ColorPicture { width: size.0, height: size.1, rgb: lit.view.picture.clone() };
    let step = behind.focus_step(half_at(near), size);
    let (sharp, planes) = behind.all_in_focus(&lit.view.depths, size, half_at, step, progress)?;
    let likeness = sharp.likeness(&target, white);
    // One white for all pictures on planes: what is bright in one is as bright in the others.
    let shown = sharp.white_like(&target, white);
    let path = |name: &str| out.join(format!("reconstruction-{name}.png"));
    behind.write(&path("sharp"), &sharp, shown, &View::Plane { z: near }, half_at(near))?;
    for (name, z) in &lit.view.focus {
        progress.start(&format!("focus {name}"), 0);
        let view = View::Plane { z: *z };
        let seen = behind.picture(&view, half_at(*z), Some(size), progress)?;
        behind.write(&path(name), &seen, shown, &view, half_at(*z))?;
        report.add(&format!("focus_{name}"), *z, format!("focus on {name}: {} behind the panel", show_length(-z)));
    }
    if let Some((_, focus)) = lit.view.focus.first() {
        let view = View::Eye { position: placing.eye.to_array(), pupil: 4e-3, focus: *focus };
        let seen = behind.picture(&view, half_at(*focus), Some(size), progress)?;
        behind.write(&path("eye"), &seen, seen.white_like(&target, white), &view, half_at(*focus))?;
    }
    report_likeness(&likeness, "reconstruction in colour", planes, report);
    report_pictures(begin, report);
    Ok(())
}
