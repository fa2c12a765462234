//! `bench`: what there is, side by side.

use super::args::{BenchCommand, BenchViewsArgs, EncodingsArgs, IterationsArgs};
use super::bar::Bar;
use super::report::{Report, seconds};
use crate::comparison::{
    ComparedPicture, Effort, VIEW_ENCODINGS, ViewRow, ViewScene, compare, compare_views, encodings, flat_picture,
    markdown, panels, scene_picture, view_cases, views_markdown,
};
use crate::encode::iterative::{GradientDescent, Start, Target, TargetPlane, gradient_descent};
use crate::field::{Complex32, Fft2};
use crate::names::Named;
use crate::panel::{PanelProfile, Setup};
use crate::{Error, Result, files};
use serde_json::json;
use std::time::Instant;

pub(super) fn bench(command: &BenchCommand) -> Result<Report> {
    match command {
        BenchCommand::Encodings(args) => table(args),
        BenchCommand::Views(args) => views(args),
        BenchCommand::Iterations(args) => iterations(args),
    }
}

fn table(args: &EncodingsArgs) -> Result<Report> {
    let mut report = Report::new("bench encodings");
    let (width, height) = args.size;
    if width < 32 || height < 32 || width * height > 1 << 24 {
        return Err(Error::parameter("size", format!("{width}×{height}: sides of 32 or more, 2²⁴ pixels at most")));
    }
    if args.iterations == 0 {
        return Err(Error::parameter("iterations", "0; take one or more"));
    }
    let bar = Bar::new();
    let panels = panels(width, height)?;
    let mut pictures = vec![ComparedPicture { name: "flat".into(), picture: flat_picture(&panels[0].setup.profile) }];
    for scene in &args.scene {
        let name = scene.file_stem().map_or_else(|| scene.display().to_string(), |s| s.to_string_lossy().into_owned());
        // As many planes as the depth chart has letters; three show that depth is there.
        let planes = if name.contains("chart") { 4 } else { 3 };
        let picture = scene_picture(scene, &panels[0].setup, planes, &bar.progress)?;
        pictures.push(ComparedPicture { name, picture });
    }
    let mut rows = Vec::new();
    for picture in &pictures {
        for panel in &panels {
            for encoding in encodings() {
                if !args.only.is_empty() && !args.only.iter().any(|only| only.name() == encoding) {
                    continue;
                }
                bar.progress.check()?;
                let effort = Effort { iterations: args.iterations, start: args.start };
                rows.push(compare(picture, panel, encoding, effort, &bar.progress)?);
            }
        }
    }
    let table = markdown(&rows);
    report.section(json!({ "simulated": true, "size": [width, height], "iterations": args.iterations, "rows": rows }));
    report.line(table.trim_end());
    if let Some(path) = &args.output {
        files::write_bytes(path, table.as_bytes())?;
        report.output("table", path);
    }
    Ok(report)
}

fn views(args: &BenchViewsArgs) -> Result<Report> {
    let mut report = Report::new("bench views");
    let (width, height) = args.size;
    if width < 128 || height < 128 || width * height > 1 << 24 {
        return Err(Error::parameter("size", format!("{width}×{height}: sides of 128 or more, 2²⁴ pixels at most")));
    }
    let wanted = |name: &str| args.case.is_empty() || args.case.iter().any(|case| name.starts_with(case.as_str()));
    let mut cases: Vec<_> = view_cases().into_iter().filter(|case| wanted(case.name)).collect();
    if cases.is_empty() {
        let names: Vec<&str> = view_cases().iter().map(|case| case.name).collect();
        return Err(Error::parameter("case", format!("{:?} is none of {}", args.case, names.join("; "))));
    }
    if let Some(iterations) = args.iterations {
        cases.iter_mut().for_each(|case| case.iterations = iterations as usize);
    }
    let only = |name: &&str| args.only.is_empty() || args.only.iter().any(|only| name.starts_with(only.name()));
    let bar = Bar::new();
    let setup = Setup::new(PanelProfile::phase(width, height, 8e-6, 8, 632.8e-9)?, None)?;
    let mut scenes = vec![("layers".to_owned(), ViewScene::layers(&setup)?)];
    for path in &args.scene {
        let name = path.file_stem().map_or_else(|| path.display().to_string(), |s| s.to_string_lossy().into_owned());
        scenes.push((name, ViewScene::read(path, &setup, &bar.progress)?));
    }
    let mut rows = Vec::new();
    for (name, scene) in &scenes {
        for case in &cases {
            let light = scene.views(&case.viewer, &setup, &bar.progress)?;
            for encoding in VIEW_ENCODINGS.into_iter().filter(only) {
                let found = compare_views(scene, &light, case, encoding, &setup, &bar.progress)?;
                rows.extend(found.map(|(seen, seconds)| ViewRow {
                    scene: name.clone(),
                    case: case.name,
                    encoding,
                    frames: case.frames,
                    seen,
                    seconds,
                }));
            }
        }
    }
    let table = views_markdown(&rows);
    report.section(json!({ "simulated": true, "size": [width, height], "rows": rows }));
    report.line(table.trim_end());
    if let Some(path) = &args.output {
        files::write_bytes(path, table.as_bytes())?;
        report.output("table", path);
    }
    Ok(report)
}

fn iterations(args: &IterationsArgs) -> Result<Report> {
    let mut report = Report::new("bench iterations");
    let (width, height) = args.size;
    if !(1..=16).contains(&args.planes) || !(2..=10_000).contains(&args.iterations) {
        return Err(Error::parameter("planes, iterations", "1 … 16 planes, 2 … 10000 iterations"));
    }
    if width < 16 || height < 16 || width * height > 1 << 26 {
        return Err(Error::parameter("size", format!("{width}×{height}: sides of 16 or more, 2²⁶ pixels at most")));
    }
    let bar = Bar::new();
    let mut profile = PanelProfile::generic()?;
    (profile.width, profile.height, profile.signal.width, profile.signal.height) = (width, height, width, height);
    let grid = profile.grid()?;
    // The transforms that an iteration uses: twice the panel's sides.
    let transform = Fft2::<f32>::new(2 * width, 2 * height);
    let mut samples: Vec<Complex32> = (0..4 * grid.len()).map(|i| Complex32::new((i % 7) as f32, 0.0)).collect();
    let pair = (0..3)
        .map(|_| {
            let begin = Instant::now();
            transform.forward(&mut samples, &bar.progress);
            transform.inverse(&mut samples, &bar.progress);
            begin.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min);
    drop(samples);
    let plane = |k: usize| {
        let value = |i: usize| 0.5 + 0.4 * (0.05 * ((i % width) + 3 * k) as f32).sin();
        TargetPlane {
            z: -0.1 - 0.02 * k as f64,
            amplitude: (0..grid.len()).map(value).collect(),
            weight: None,
            phase: None,
        }
    };
    let target = Target::Amplitude((0..args.planes).map(plane).collect());
    let run = |count: usize| -> Result<f64> {
        let settings =
            GradientDescent { iterations: count, start: Start::Random { seed: 1 }, ..GradientDescent::default() };
        let begin = Instant::now();
        gradient_descent(&target, &profile, profile.default_wavelength(), &settings, &bar.progress)?;
        Ok(begin.elapsed().as_secs_f64())
    };
    // Planning, the first and the last look are the same in both. The best of some runs, as of the transforms: on a busy
    // machine one run says little, and their difference nothing.
    let (mut one, mut many) = (f64::INFINITY, f64::INFINITY);
    for attempt in 0..8 {
        (one, many) = (one.min(run(1)?), many.min(run(1 + args.iterations)?));
        if attempt >= 1 && many > one {
            break;
        }
    }
    if many <= one {
        return Err(Error::parameter("iterations", "take no longer than one: the machine is too busy, or give more"));
    }
    let iteration = (many - one) / args.iterations as f64;
    let share = iteration / pair / args.planes as f64;
    report.section(json!({
        "size": [width, height],
        "planes": args.planes,
        "pair_seconds": pair,
        "iteration_seconds": iteration,
        "iterations_per_second": 1.0 / iteration,
        "pairs_per_plane": share,
    }));
    report.line(format!(
        "{width} × {height}, {} planes: {:.2} iterations a second, {} each; a pair of transforms of twice the sides takes {}: \
         {share:.2} pairs a plane",
        args.planes,
        1.0 / iteration,
        seconds(iteration),
        seconds(pair)
    ));
    Ok(report)
}
