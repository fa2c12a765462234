//! Plates: planned, computed, checked, looked at, exported.

use super::args::{ExportArgs, ExportFormat, FileArgs, PrintArgs, PrintCommand, VerifyArgs, White};
use super::bar::Bar;
use super::report::{Report, count, seconds};
use holodrive::files;
use holodrive::hologram::InstructionSet;
use holodrive::print::export::{Format, Frames, export};
use holodrive::print::{Manifest, Plan, Plate, Shard, Source, Task, job, plan, sample};
use holodrive::units::show_length;
use holodrive::{Error, Result};
use std::path::Path;

pub(super) fn print(args: &PrintArgs, json: bool) -> Result<Report> {
    match &args.command {
        Some(PrintCommand::Verify(args)) => verify(args),
        Some(PrintCommand::Preview(args)) => super::print_preview::look(args),
        Some(PrintCommand::Export(args)) => write(args),
        None => compute(args, json),
    }
}

/// A scene or a cloud, and how it is lit: its flags, bounces and photons.
pub(super) fn task(
    input: &Path,
    (file, bounces, photons): (&FileArgs, u32, u32),
    white: Option<White>,
) -> Result<Task> {
    Ok(Task {
        camera: file.camera.clone(),
        animation: file.animation.clone(),
        time: file.time,
        viewer_light: file.viewer_light,
        bounces,
        photons,
        white: match white {
            None | Some(White::Auto) => None,
            Some(White::None) => Some(f32::MAX),
            Some(White::At(white)) if white > 0.0 && white.is_finite() => Some(white),
            Some(White::At(white)) => {
                return Err(Error::parameter("white", format!("{white} must be greater than zero")));
            }
        },
        ..Task::new(input.to_path_buf())
    })
}

fn compute(args: &PrintArgs, json: bool) -> Result<Report> {
    let missing = |what| Error::parameter("print", what);
    let input =
        args.input.as_ref().ok_or_else(|| missing("a scene or points are needed (see holodrive print --help)"))?;
    let path = args.plate.as_ref().ok_or_else(|| missing("--plate FILE is needed (see holodrive print --help)"))?;
    let folder = match &args.output {
        Some(folder) => folder.as_path(),
        None if args.dry_run => Path::new(""),
        None => return Err(missing("-o DIR is needed (see holodrive print --help)")),
    };
    let kinds = ["gltf", "glb", "ply"];
    if !input.extension().is_some_and(|e| kinds.iter().any(|kind| e.eq_ignore_ascii_case(kind))) {
        return Err(Error::input(input, "is no scene (.gltf, .glb) or point cloud (.ply)"));
    }
    let plate = Plate::read(path)?;
    let shard = match &args.shard {
        Some(text) => Shard::parse(text, |name| std::env::var(name).ok())?,
        None => Shard::default(),
    };
    let light = (&args.light.file, args.light.bounces, args.light.photons);
    let task = task(input, light, args.light.white)?;
    let settings = task.settings(&plate)?;
    let there = if args.dry_run { None } else { job::look(folder, &settings)? };
    let set = match &there {
        None => InstructionSet::detect(),
        Some(manifest) => instruction_set(folder, manifest)?,
    };
    let bar = Bar::new();
    let progress = &bar.progress;
    let mut report = Report::new("print");
    report.add("plate", plate.name.clone(), "");
    let white = there.as_ref().map(|m| m.white).filter(|w| *w > 0.0);
    task.with(&plate, white, set, progress, |maker| {
        let manifest = match there {
            Some(manifest) => manifest,
            None => {
                let sampled = sample(maker, progress)?;
                let planned = plan(maker, &sampled);
                let free = files::free_space(folder);
                let told = report_plan(&planned, &plate, set, free);
                report.warn(planned.warnings.iter());
                if let Some(free) = free.filter(|free| *free < planned.disk) {
                    let what = format!("the disk has {} free: the work will stop when it is full", bytes(free));
                    report.warn(std::iter::once(&what));
                }
                if args.dry_run {
                    report.add_part("plan", "plan", told);
                    return Ok(());
                }
                if !json {
                    // Before the work, not after it.
                    told.print(false)?;
                }
                report.add("plan", told.json(), "");
                let white = if let Source::Scene(views) = maker.source { views.white() } else { 0.0 };
                let mine = Manifest {
                    settings,
                    instruction_set: set.name().to_owned(),
                    amplitude: sampled.amplitude,
                    white,
                    tiles: None,
                };
                let first = job::begin(folder, &mine)?;
                if first.instruction_set != mine.instruction_set || first.amplitude != mine.amplitude {
                    let what = "another machine with other kernels began this plate just now; give the command again";
                    return Err(Error::input(folder, what));
                }
                first
            }
        };
        let done = job::compute(folder, maker, &manifest, shard, progress)?;
        let work = done.work;
        let rates = [work.pixels as f64 / done.seconds.max(1e-9), work.pairs / work.field_seconds.max(1e-9)];
        report.add_serialised("done", &done, "");
        report.add("pixels_per_second", rates[0], "");
        report.add("pairs_per_second", rates[1], "");
        if done.torn > 0 {
            let torn = done.torn;
            report.add(
                "torn",
                torn,
                format!("torn         {torn} tiles were not as they were written, and were redone"),
            );
        }
        report.add(
            "complete",
            done.complete,
            format!(
                "tiles        {:>8}  {} computed, {} kept; {} of {} finished",
                seconds(done.seconds),
                done.computed,
                done.kept,
                done.finished,
                done.tiles
            ),
        );
        if done.computed > 0 {
            let line = format!(
                "rate         {:.2e} pixels/s; field {:.2e} point-pixel pairs/s; rays {}, field {}, fringe {}",
                rates[0],
                rates[1],
                seconds(work.points_seconds),
                seconds(work.field_seconds),
                seconds(work.fringe_seconds)
            );
            report.add("rate", line.clone(), line);
        }
        let line = if done.complete {
            format!("plate        {}", folder.join(job::PLATE).display())
        } else {
            "plate        not complete: other parts are missing".to_owned()
        };
        report.add("output", folder.display().to_string(), line);
        Ok(())
    })?;
    Ok(report)
}

/// The set that the plate was begun with.
fn instruction_set(folder: &Path, manifest: &Manifest) -> Result<InstructionSet> {
    let name = &manifest.instruction_set;
    InstructionSet::available().into_iter().find(|set| set.name() == name).ok_or_else(|| {
        Error::input(
            folder,
            format!("was begun with {name} kernels, which this machine does not have; go on elsewhere"),
        )
    })
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

fn report_plan(plan: &Plan, plate: &Plate, set: InstructionSet, free: Option<u64>) -> Report {
    let mut report = Report::new("plan");
    let degrees = |angles: [f64; 2]| format!("{:.2} x {:.2} deg", angles[0].to_degrees(), angles[1].to_degrees());
    let [width, height] = plan.size;
    report.add_serialised(
        "size",
        &plan.size,
        format!(
            "plate        {} × {} px of {} × {}, {} bit, {:.2} × {:.2} mm",
            width,
            height,
            show_length(plate.pitch_x),
            show_length(plate.pitch_y),
            plate.bits,
            plan.extent[0] * 1e3,
            plan.extent[1] * 1e3
        ),
    );
    report.add_serialised("extent", &plan.extent, "");
    report.add_serialised(
        "diffraction_angle",
        &plan.diffraction_angle,
        format!(
            "angles       the pitch diffracts ±{} at {}; object light ±{}",
            degrees(plan.diffraction_angle),
            show_length(plate.wavelength),
            degrees(plan.object_angle)
        ),
    );
    report.add_serialised("object_angle", &plan.object_angle, "");
    report.add_serialised("reference_frequencies", &plan.reference, "");
    report.add_serialised(
        "tiles",
        &plan.tiles,
        format!(
            "tiles        {} × {} of {} px; {} views of segments of {} px",
            plan.tiles[0],
            plan.tiles[1],
            plate.tile,
            count(plan.segments as usize),
            plate.segment
        ),
    );
    report.add("segments", plan.segments, "");
    if let Some(slit) = &plate.slit {
        report.add_serialised(
            "slit",
            slit,
            format!(
                "slit         {} high at {}, parallax from left to right; strips of {} rows for {}",
                show_length(slit.height),
                show_length(plate.viewer),
                slit.strip,
                slit.wavelengths.iter().map(|w| show_length(*w)).collect::<Vec<_>>().join(", ")
            ),
        );
    }
    report.add_serialised(
        "points",
        &plan.points,
        format!(
            "points       {} a segment ({} at most); about {} rays",
            count(plan.points[0] as usize),
            count(plan.points[1] as usize),
            count(plan.rays as usize)
        ),
    );
    report.add("rays", plan.rays, "");
    report.add("pairs", plan.pairs, format!("pairs        {:.2e} points times pixels", plan.pairs));
    report.add("amplitude", plan.amplitude, "");
    let of = free.map(|free| format!(" of {} free", bytes(free))).unwrap_or_default();
    report.add(
        "memory",
        plan.memory,
        format!("memory       about {}; disk {}{of}", bytes(plan.memory), bytes(plan.disk)),
    );
    report.add("disk", plan.disk, "");
    report.add_serialised("disk_free", &free, "");
    report.add_serialised("files", &plan.files, "");
    report.add_serialised("resolution", &plan.resolution, "");
    report.add("instruction_set", set.name(), "");
    report.add(
        "seconds",
        plan.seconds,
        format!(
            "time         about {} on this machine, {} on 100 like it",
            duration(plan.seconds),
            duration(plan.seconds_on_100)
        ),
    );
    report.add("seconds_on_100", plan.seconds_on_100, "");
    report
}

fn verify(args: &VerifyArgs) -> Result<Report> {
    let mut report = Report::new("print verify");
    let bar = Bar::new();
    let found = job::verify(&args.folder, &bar.progress)?;
    report.add_serialised("verified", &found, "");
    report.add(
        "tiles",
        found.tiles,
        format!(
            "verified     {} tiles, {}, all as they were computed, in {}",
            found.tiles,
            bytes(found.bytes),
            seconds(found.seconds)
        ),
    );
    Ok(report)
}

fn write(args: &ExportArgs) -> Result<Report> {
    let mut report = Report::new("print export");
    let frames = || {
        let (width, height) =
            args.frame.ok_or_else(|| Error::parameter("frame", "give the size of an exposure, --frame 1920x1080"))?;
        Ok::<_, Error>(Frames {
            size: [width as u64, height as u64],
            overlap: args.overlap,
            serpentine: args.serpentine,
            window: args.window,
        })
    };
    let format = match args.format {
        ExportFormat::Zarr => Format::Zarr,
        ExportFormat::Png => Format::Png(frames()?),
        ExportFormat::Bmp => Format::Bmp(frames()?),
        ExportFormat::Gds => Format::Gds,
    };
    let bar = Bar::new();
    let written = export(&args.folder, &format, &args.output, &bar.progress)?;
    report.add("files", written.files, format!("files        {}, {}", written.files, bytes(written.bytes)));
    report.add("bytes", written.bytes, "");
    report.add("output", args.output.display().to_string(), format!("written      {}", args.output.display()));
    Ok(report)
}
