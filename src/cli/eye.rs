//! What an eye sees: light fields, frames that are made for them, and the pictures that an eye gets.

use super::args::{ViewsArgs, White};
use super::bar::Bar;
use super::holograms::{Maker, add_exposure, report_encoding};
use super::load::{Input, Points, input};
use super::report::{Report, count, seconds, step};
use super::resolve;
use crate::encode::view::Viewed;
use crate::encode::{EncodeReport, Encoding, ViewEncoding};
use crate::light_field::{LightField, LightSource, Retina, ViewSequence, Viewer};
use crate::panel::{Frame, Origin, Setup};
use crate::pipeline::{self, Bench, Settings};
use crate::points::{Channel, Exposure, LitScene, ScenePoints, Share};
use crate::progress::Progress;
use crate::reconstruction::{Colour, Seeing};
use crate::units::show_length;
use crate::{Error, Result};
use glam::DVec3;
use image::ImageFormat;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What can be looked at: points, or views as they stand in a file.
pub(super) enum Content<'a> {
    Points(&'a Points),
    Views(LightField),
}

/// The views that a viewer takes in, with what they took.
pub(super) fn light_field(
    content: &Content,
    setup: &Setup,
    settings: &Settings,
    progress: &Progress,
    report: &mut Report,
) -> Result<LightField> {
    let begin = Instant::now();
    let source = match content {
        Content::Points(Points { scene: Some((lit, points)), .. }) => LightSource::Scene { lit, points },
        Content::Points(points) => {
            let eye = points.metadata.eye.map_or(settings.viewer.eye, DVec3::from_array);
            LightSource::Cloud { cloud: &points.cloud, eye }
        }
        Content::Views(light) => LightSource::Views(light),
    };
    let (light, did) = pipeline::light_field(&source, setup, settings, progress)?;
    let elapsed = begin.elapsed().as_secs_f64();
    let views = light.eyes.count();
    let mut what = format!(
        "{} views of {} × {} pixels, {} MB",
        count(views),
        light.window.width,
        light.window.height,
        light.memory() >> 20
    );
    if let Some(did) = &did {
        report.value("views_report", did);
        what += &format!("; {did}");
    }
    report.section(serde_json::json!({ "views": views, "views_seconds": elapsed }));
    report.line(step("views", elapsed, what));
    Ok(light)
}

/// `views`: a light field in a file.
pub(super) fn views(args: &ViewsArgs) -> Result<Report> {
    let mut report = Report::new("views");
    report.warn(&args.idle);
    let setup = resolve::setup_in_color(&args.panel, &args.color, &mut report)?;
    let source = input(&args.input)?;
    let bar = Bar::new();
    let file = match &source {
        Input::Views(path) => Some(LightField::read(path)?),
        _ => None,
    };
    let settings = Settings {
        scene: resolve::scene(&args.light, &args.placement, White::Auto)?,
        channel: args.channel.channel,
        viewer: resolve::viewer(&args.viewer, Some(&args.placement), file.as_ref()),
        ..Settings::default()
    };
    if args.sequence.is_none() {
        resolve::check_viewer(&settings.viewer, &setup)?;
    }
    let points;
    let content = match file {
        Some(file) => Content::Views(file),
        None => {
            let reading = resolve::reading(&args.map, &args.placement);
            points = Points::load(&source, &settings.scene, &reading, &setup, &bar.progress, &mut report)?;
            Content::Points(&points)
        }
    };
    if let Some(count) = args.sequence {
        let Content::Points(Points { scene: Some((lit, points)), .. }) = content else {
            return Err(Error::parameter("sequence", "is made of a scene: views in files and points stay as they are"));
        };
        sequence(args, count, lit, points, (&setup, &settings), &bar.progress, &mut report)?;
        return Ok(report);
    }
    let light = light_field(&content, &setup, &settings, &bar.progress, &mut report)?;
    bar.progress.check()?;
    light.write(&args.output)?;
    report.output("light field", &args.output);
    Ok(report)
}

/// `views --sequence`: numbered pictures from places in a row.
fn sequence(
    args: &ViewsArgs,
    count: usize,
    lit: &LitScene,
    points: &ScenePoints,
    (setup, settings): (&Setup, &Settings),
    progress: &Progress,
    report: &mut Report,
) -> Result<()> {
    let window = points.view.placing.window;
    let size = args.size.unwrap_or((1280, (1280.0 * window.y / window.x).round() as usize));
    let wanted = ViewSequence {
        count,
        width: settings.viewer.eye_box.x,
        size,
        rays: args.pixel_rays,
        format: if args.kind == "png" { ImageFormat::Png } else { ImageFormat::Tiff },
    };
    if wanted.width == 0.0 {
        return Err(Error::parameter("eye-box", "says how far the sequence goes from left to right: --eye-box 300mm"));
    }
    let begin = Instant::now();
    let how = settings.light_field(setup.lasers.is_some());
    let did = wanted.write(lit, points, &settings.viewer, &how, &args.output, progress)?;
    let what = format!(
        "{} views of {} × {} pixels, {} apart, {} before a window of {} × {}; {} to {}",
        super::report::count(did.views),
        size.0,
        size.1,
        show_length(did.spacing),
        show_length(did.distance),
        show_length(did.window[0]),
        show_length(did.window[1]),
        did.files[0],
        did.files[1]
    );
    report.line(step("sequence", begin.elapsed().as_secs_f64(), what));
    report.value("sequence", &did);
    report.output("sequence", &args.output);
    Ok(())
}

impl Maker<'_> {
    /// Frames for the viewer, in the order of the exposures; none for a laser without light. Each is written.
    pub(super) fn views(
        &self,
        encoding: &ViewEncoding,
        light: &LightField,
        exposures: &[Exposure],
        path: impl Fn(&Exposure) -> PathBuf,
        report: &mut Report,
    ) -> Result<Vec<Option<Frame>>> {
        let viewer = &self.settings.viewer;
        let retina = Retina::of(viewer, &self.setup.grid, self.setup.wavelength)?;
        let cost = encoding.cost(viewer, self.setup, &retina, exposures.len());
        let (asked, flag) = match self.setup.lasers {
            Some(_) => (1, " of each laser".to_owned()),
            None => (exposures.len(), format!(" (--subframes {})", cost.frames)),
        };
        report.value("view_cost", cost);
        report.begins(&format!(
            "view: {} frame{} of {} steps, about {}; {}",
            exposures.len(),
            if exposures.len() == 1 { "" } else { "s" },
            cost.iterations,
            seconds(cost.seconds),
            if asked >= cost.frames {
                format!("expect about {:.0} dB / SSIM {:.2}", cost.expected.psnr, cost.expected.ssim)
            } else {
                format!(
                    "with {} frames expect about {:.0} dB / SSIM {:.2}, with {asked} less",
                    cost.frames, cost.expected.psnr, cost.expected.ssim
                )
            }
        ));
        if cost.frames > asked {
            report.warn([format!(
                "an eye box of {} × {} asks for {} frames{flag}; with {asked} it is speckled, most at its edges",
                show_length(viewer.eye_box.x),
                show_length(viewer.eye_box.y),
                cost.frames
            )]);
        }
        let found = pipeline::views(light, viewer, exposures, self.setup, encoding, &[], self.progress)?;
        let mut frames = Vec::new();
        for (viewed, exposure) in found.into_iter().zip(exposures) {
            let mut part = Report::new("view");
            match &viewed {
                Some(viewed) => {
                    report.warn(viewed.frames.iter().flat_map(|encoded| &encoded.report.warnings));
                    report_viewed(viewed, &mut part);
                }
                None => part.add("dark", true, "dark         no light for this laser: leave it off"),
            }
            match exposure.share {
                Share::SubFrame { .. } => report.merge(part),
                _ => add_exposure(exposure, part, report),
            }
            frames.extend(Viewed::frames_or_none(viewed).into_iter().map(|encoded| encoded.map(|e| e.frame)));
        }
        for (frame, exposure) in frames.iter_mut().zip(exposures) {
            if let Some(frame) = frame {
                let source = Some(self.input.display().to_string());
                let notes = Some(exposure.label()).filter(|label| !label.is_empty()).into_iter().collect();
                frame.metadata.origin = Origin { source, depth: Some(light.depth), notes, ..Origin::default() };
            }
        }
        self.note_powers(&mut frames, report);
        for (frame, exposure) in frames.iter().zip(exposures) {
            if let Some(frame) = frame {
                frame.write(&path(exposure))?;
            }
        }
        Ok(frames)
    }

    /// Frames for the viewer in a folder, where the encoding is made for one.
    pub(super) fn eye_frames(
        &self,
        light: &LightField,
        points: Option<&Points>,
        out: &Path,
        report: &mut Report,
    ) -> Result<Vec<Option<Frame>>> {
        let Some(Encoding::View(view)) = &self.settings.encode.encoding else { return Ok(Vec::new()) };
        let exposures = match points {
            Some(points) => self.exposures(points, report)?,
            None => pipeline::exposures(self.setup, self.settings, None),
        };
        self.views(view, light, &exposures, |exposure| out.join(format!("frame{}.png", exposure.suffix())), report)
    }
}

fn report_viewed(viewed: &Viewed, report: &mut Report) {
    let did = &viewed.report;
    if let Some(first) = viewed.frames.first() {
        report_encoding(&EncodeReport { warnings: Vec::new(), ..first.report.clone() }, report);
    }
    report.value("view", did);
    let (start, end) = (did.psnr.first().copied(), did.psnr.last().copied());
    let what = format!(
        "view: {} for {} frame{}, {} each; {:.1} → {:.1} dB through the pupil, {:.0} % of the light goes there",
        did.iterations,
        did.frames,
        if did.frames == 1 { "" } else { "s" },
        seconds(did.step_seconds),
        start.unwrap_or_default(),
        end.unwrap_or_default(),
        100.0 * did.efficiency
    );
    report.add("encode_seconds", did.seconds, step("encode", did.seconds, what));
}

/// How frames are looked at, beside the bench.
pub(super) struct Look<'a> {
    pub(super) light: &'a LightField,
    pub(super) scene: Option<&'a ScenePoints>,
    pub(super) viewer: &'a Viewer,
    pub(super) channel: Channel,
    pub(super) bench: &'a Bench,
    pub(super) sweeps: bool,
}

/// Looks at frames as the viewer does; writes the pictures, and says how good they are.
pub(super) fn look(
    frames: &[Option<&Frame>],
    setup: &Setup,
    look: &Look,
    folder: &Path,
    progress: &Progress,
    report: &mut Report,
) -> Result<()> {
    let begin = Instant::now();
    let colour = Colour::of(setup.lasers, setup.wavelength, look.channel);
    let seeing = match look.scene {
        Some(points) => Seeing::of_scene(look.light, look.viewer, colour, points),
        None => Seeing::new(look.light, look.viewer, colour, &[]),
    };
    let seeing = Seeing { sweeps: look.sweeps, ..seeing };
    let gallery = pipeline::seen(frames, setup, &seeing, look.bench, progress)?;
    gallery.write(folder)?;
    for shot in &gallery.focus {
        let z = shot.look.focus;
        report.add(&format!("focus_{}", shot.name), z, "");
    }
    let all = &gallery.figures.all;
    report.value("seen", &gallery.figures);
    report.line(format!(
        "as seen                through the pupil, {} looks: PSNR {:.1} dB (worst {:.1}), SSIM {:.3}, contrast of speckle {:.2}, {:.0} % of the light; judge: {}",
        gallery.figures.looks,
        all.psnr,
        all.psnr_worst,
        all.ssim,
        all.contrast,
        100.0 * all.box_efficiency,
        gallery.figures.judge
    ));
    let elapsed = begin.elapsed().as_secs_f64();
    let where_to = folder.join("overview.png");
    let line = step("pictures", elapsed, format!("all of them on one sheet: {}", where_to.display()));
    report.add("seen_seconds", elapsed, line);
    Ok(())
}
