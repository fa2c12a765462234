//! Plates: planned, computed, checked, looked at, exported.

use super::args::{ExportArgs, FileArgs, PrintArgs, PrintCommand, QualityArgs, VerifyArgs, White};
use super::bar::Bar;
use super::report::{Report, count, seconds};
use super::{plate_source, plate_views};
use crate::illumination::IlluminationSettings;
use crate::print::export::{Frames, export};
use crate::print::{Asked, Plan, Plate, PlateJob, PrintSettings, Shard, folder};
use crate::segments::SceneOptions;
use crate::units::show_length;
use crate::{Error, Result};

pub(super) fn print(args: &PrintArgs, json: bool) -> Result<Report> {
    match &args.command {
        Some(PrintCommand::Verify(args)) => verify(args),
        Some(PrintCommand::Preview(args)) => plate_views::preview(args),
        Some(PrintCommand::Sheet(args)) => plate_views::sheet(args),
        Some(PrintCommand::Export(args)) => write(args),
        None => compute(resolved(args)?, json),
    }
}

/// How a scene is lit: its flags, and the rest of what is typed of its light.
pub(super) fn scene_options(file: &FileArgs, light: Lighting, white: Option<White>) -> Result<SceneOptions> {
    let Lighting { bounces, photons, quality } = light;
    let white = match white {
        None | Some(White::Auto) => None,
        Some(White::None) => Some(f32::MAX),
        Some(White::At(white)) if white > 0.0 && white.is_finite() => Some(white),
        Some(White::At(white)) => return Err(Error::out_of_range("white", white, "must be greater than zero")),
    };
    let (environment, sky) = (file.panorama(), file.sky());
    let FileArgs { camera, animation, time, viewer_light, allow_outside, .. } = file.clone();
    let light_error = quality.error();
    let usual = IlluminationSettings::default().for_error(light_error)?;
    let photons = photons.unwrap_or(usual.photons);
    Ok(SceneOptions {
        camera,
        animation,
        time,
        viewer_light,
        allow_outside,
        environment,
        sky,
        bounces,
        photons,
        light_error,
        white,
    })
}

/// What is typed of a scene's light beside its files.
pub(super) struct Lighting<'a> {
    pub(super) bounces: u32,
    pub(super) photons: Option<u32>,
    pub(super) quality: &'a QualityArgs,
}

fn resolved(args: &PrintArgs) -> Result<PrintSettings> {
    let missing = |what: &str| Error::parameter("print", format!("{what} (see holodrive print --help)"));
    let input = args.input.clone().ok_or_else(|| missing("a scene or points are needed"))?;
    let path = args
        .plate
        .as_ref()
        .ok_or_else(|| missing("--plate NAME or FILE is needed: `holodrive plates` lists the built-in ones"))?;
    let folder = match &args.output {
        None if !args.dry_run => return Err(missing("-o DIR is needed")),
        folder => folder.clone().unwrap_or_default(),
    };
    let light = &args.light;
    let asked = Asked {
        size: args.size,
        pitch: args.pitch,
        binarisation: args.binarisation,
        phase: args.phase,
        segment: args.segment,
    };
    let plate = Plate::find(path, &asked)?;
    let input = plate_source::source(args, &input, &plate)?;
    Ok(PrintSettings {
        plate,
        input,
        options: scene_options(
            &light.file,
            Lighting { bounces: light.bounces, photons: light.photons, quality: &light.quality },
            light.white,
        )?,
        folder,
        shard: match &args.shard {
            Some(text) => Shard::parse(text, |name| std::env::var(name).ok())?,
            None => Shard::default(),
        },
        dry_run: args.dry_run,
    })
}

fn compute(settings: PrintSettings, json: bool) -> Result<Report> {
    let bar = Bar::new();
    let mut report = Report::new("print");
    let (plate, folder, dry_run) = (settings.plate.clone(), settings.folder.clone(), settings.dry_run);
    report.value("plate", &plate.name);
    let mut job = PlateJob::new(settings, &bar.progress)?;
    if let Some(plan) = job.plan(&bar.progress)? {
        report.warn(&plan.warnings);
        let told = report_plan(&plan, &plate);
        if dry_run {
            report.add_part("plan", "plan", told);
            return Ok(report);
        }
        if !json {
            // Before the work, not after it.
            told.print(false)?;
        }
        report.value("plan", told.json());
    }
    let printed = job.run(&bar.progress)?;
    report.section(&printed);
    let (done, work) = (&printed.done, &printed.done.work);
    if done.torn > 0 {
        let torn = done.torn;
        report.add("torn", torn, format!("torn         {torn} tiles were not as they were written, and were redone"));
    }
    report.line(format!(
        "tiles        {:>8}  {} computed, {} kept; {} of {} finished",
        seconds(done.seconds),
        done.computed,
        done.kept,
        done.finished,
        done.tiles
    ));
    report.warn(work.warning());
    if done.computed > 0 {
        let line = format!(
            "rate         {:.2e} pixels/s; field {:.2e} point-pixel pairs/s; rays {}, field {}, fringe {}",
            printed.pixels_per_second,
            printed.pairs_per_second,
            seconds(work.points_seconds),
            seconds(work.field_seconds),
            seconds(work.fringe_seconds)
        );
        report.add("rate", line.clone(), line);
    }
    let line = if done.complete {
        format!("plate        {}", folder.join(folder::PLATE).display())
    } else {
        "plate        not complete: other parts are missing".to_owned()
    };
    report.add("output", folder.display().to_string(), line);
    Ok(report)
}

fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.1} days", s / 86_400.0),
    }
}

fn bytes(bytes: u64) -> String {
    match bytes as f64 {
        b if b < 1e6 => format!("{:.0} kB", b / 1e3),
        b if b < 1e9 => format!("{:.0} MB", b / 1e6),
        b => format!("{:.2} GB", b / 1e9),
    }
}

fn report_plan(plan: &Plan, plate: &Plate) -> Report {
    let mut report = Report::new("plan");
    report.section(plan);
    let degrees = |angles: [f64; 2]| format!("{:.2} x {:.2} deg", angles[0].to_degrees(), angles[1].to_degrees());
    report.line(format!(
        "plate        {} × {} px of {} × {}, {} bit, {:.4} × {:.4} mm",
        plan.size[0],
        plan.size[1],
        show_length(plate.raster.pitch_x),
        show_length(plate.raster.pitch_y),
        plate.fringe.bits,
        plan.extent[0] * 1e3,
        plan.extent[1] * 1e3
    ));
    report.line(format!(
        "angles       the pitch diffracts ±{} at {}; object light ±{}",
        degrees(plan.diffraction_angle),
        show_length(plate.wavelength),
        degrees(plan.object_angle)
    ));
    report.line(format!(
        "tiles        {} × {} of {} px; {} views of segments of {} px",
        plan.tiles[0],
        plan.tiles[1],
        plate.file.tile,
        count(plan.segments as usize),
        plate.segment
    ));
    if let Some(slit) = &plan.slit {
        report.line(format!(
            "slit         {} high at {}, parallax from left to right; strips of {} rows for {}",
            show_length(slit.height),
            show_length(plate.view.viewer),
            slit.strip,
            plate_views::lengths(&slit.wavelengths)
        ));
    }
    report.line(format!(
        "points       {} a segment ({} at most); about {} rays",
        count(plan.points[0] as usize),
        count(plan.points[1] as usize),
        count(plan.rays as usize)
    ));
    report.line(format!("pairs        {:.2e} points times pixels", plan.pairs));
    let of = plan.disk_free.map(|free| format!(" of {} free", bytes(free))).unwrap_or_default();
    report.line(format!("memory       about {}; disk {}{of}", bytes(plan.memory), bytes(plan.disk)));
    report.line(format!(
        "time         about {} on this machine, {} on 100 like it",
        duration(plan.seconds),
        duration(plan.seconds_on_100)
    ));
    report
}

fn verify(args: &VerifyArgs) -> Result<Report> {
    let mut report = Report::new("print verify");
    let bar = Bar::new();
    let found = folder::verify(&args.folder, &bar.progress)?;
    report.value("verified", &found);
    let line = format!(
        "verified     {} tiles, {}, all as they were computed, in {}",
        found.tiles,
        bytes(found.bytes),
        seconds(found.seconds)
    );
    report.add("tiles", found.tiles, line);
    Ok(report)
}

fn write(args: &ExportArgs) -> Result<Report> {
    let mut report = Report::new("print export");
    let frames = Frames {
        size: args.frame.map(|(width, height)| [width as u64, height as u64]),
        band: args.band,
        overlap: args.overlap,
        serpentine: args.serpentine,
        window: args.window,
    };
    let bar = Bar::new();
    let written = export(&args.folder, args.format, &frames, &args.output, &bar.progress)?;
    report.section(&written);
    report.line(format!("files        {}, {}", written.files, bytes(written.bytes)));
    report.output("written", &args.output);
    Ok(report)
}
