//! Derivatives against finite differences; pictures on one and on three planes on a panel of real levels.

use super::gradient::gradient_field;
use super::*;
use crate::encode::model::slope;
use crate::panel::PanelProfile;
use crate::progress::{Progress, least_time_to_stop};
use std::path::Path;
use std::time::Instant;

const WAVELENGTH: f64 = 532e-9;

fn panel(width: usize, height: usize, levels_for_2pi: f64) -> PanelProfile {
    let text = format!(
        "name = \"t\"\nmaker = \"t\"\nkind = \"phase-lcos\"\nwidth = {width}\nheight = {height}\npitch = \"8um\"\nbits = 8\n\
         fill_factor = 1.0\nwavelengths = [\"532nm\"]\n[[response]]\nkind = \"linear\"\nlevels_for_2pi = {levels_for_2pi}\n"
    );
    PanelProfile::parse(&text, Path::new("t.toml")).expect("profile")
}

/// A picture of soft and hard edges within `columns` and the middle rows, which alone count.
fn picture(grid: Grid, z: f64, columns: std::ops::Range<usize>, seed: f32) -> TargetPlane {
    let rows = grid.height / 8..grid.height - grid.height / 8;
    let inside = |i: usize| columns.contains(&(i % grid.width)) && rows.contains(&(i / grid.width));
    let value = |i: usize| {
        let (x, y) = ((i % grid.width) as f32, (i / grid.width) as f32);
        let wave = 0.5 + 0.3 * (0.11 * x + seed).sin() * (0.13 * y - 0.7 * seed).cos();
        if (x as usize / 12 + y as usize / 12).is_multiple_of(3) { 1.0 } else { wave }
    };
    let amplitude = (0..grid.len()).map(|i| if inside(i) { value(i) } else { 0.0 }).collect();
    let weight = (0..grid.len()).map(|i| if inside(i) { 1.0 } else { 0.0 }).collect();
    TargetPlane { z, amplitude, weight: Some(weight), phase: None }
}

#[test]
fn analytic_slopes_equal_finite_differences() {
    let profile = panel(24, 18, 256.0);
    let grid = profile.grid().expect("grid");
    let mut random = Random::new(4, 0);
    let wanted = (0..grid.len()).map(|_| random.uniform_f32()).collect();
    let weight = Some((0..grid.len()).map(|_| random.uniform_f32()).collect());
    let planes = vec![
        TargetPlane { z: 0.002, amplitude: wanted, weight, phase: None },
        TargetPlane { z: -0.001, ..picture(grid, 0.0, 3..20, 1.0) },
    ];
    let field = (0..grid.len()).map(|_| Complex32::new(random.uniform_f32(), random.uniform_f32())).collect();
    let half = [0.6 * grid.limit_x(), 0.8 * grid.limit_y()];
    for target in [Target::Amplitude(planes), Target::Complex { samples: field, half }] {
        let progress = Progress::new();
        let problem = Problem::new(&target, grid, WAVELENGTH, Padding::Dark, &progress).expect("problem");
        let phase = Start::Random { seed: 9 }.phases(grid, WAVELENGTH).expect("phases");
        let light = |phase: &[f32]| phase.iter().map(|&p| Complex32::from_polar(1.0, p)).collect::<Vec<_>>();
        let panel = light(&phase);
        let pulled = gradient_field(&problem, &problem.judge(&panel).expect("light")).expect("gradient");
        // Along the slopes themselves, each weighted at random, so that the difference stands well above the rounding of
        // single precision; five-point differences have an error of order h⁴.
        let slopes: Vec<f32> = pulled.iter().zip(&panel).map(|(g, u)| slope(*g, *u)).collect();
        let steepest = slopes.iter().fold(0.0, |a: f32, s| a.max(s.abs()));
        let direction: Vec<f32> = slopes.iter().map(|s| s / steepest * 2.0 * random.uniform_f32()).collect();
        let moved = |h: f32| {
            let phase: Vec<f32> = phase.iter().zip(&direction).map(|(p, d)| p + h * d).collect();
            problem.judge(&light(&phase)).expect("light").error
        };
        let h = 2e-2f32;
        let measured = (8.0 * (moved(h) - moved(-h)) - (moved(2.0 * h) - moved(-2.0 * h))) / (12.0 * f64::from(h));
        let analytic: f64 = slopes.iter().zip(&direction).map(|(s, d)| f64::from(*s) * f64::from(*d)).sum();
        assert!((measured / analytic - 1.0).abs() < 1e-4, "{measured} {analytic}");
    }
}

#[test]
fn slopes_hold_with_crosstalk_dead_space_and_oblique_light() {
    let mut profile = panel(26, 19, 256.0);
    (profile.crosstalk, profile.fill_factor, profile.bits) = (0.4, 0.9, 8);
    let grid = profile.grid().expect("grid");
    let target = Target::Amplitude(vec![picture(grid, 0.002, 4..20, 0.3)]);
    let progress = Progress::new();
    let problem = Problem::new(&target, grid, WAVELENGTH, Padding::Dark, &progress).expect("problem");
    let illumination = crate::panel::Illumination::Plane { frequency: [2e4, -1e4] };
    // Sixteen bits: a difference of phases must be seen through the levels.
    profile.bits = 16;
    profile.responses[0].curve = crate::panel::Curve::Linear { levels_for_2pi: 65536.0 };
    let model = crate::encode::model::PanelModel::new(&profile, WAVELENGTH, illumination).expect("model");
    // Smooth phases away from the ends of the turn: a wrap would blur into a slope that no wish has.
    let start: Vec<f32> =
        (0..grid.len()).map(|i| 3.0 + (0.4 * (i % 26) as f32).sin() + (0.3 * (i / 26) as f32).cos()).collect();
    let light = model.light(&start);
    let judged = problem.judge(&light.total).expect("light");
    let slopes = model.slopes(&start, &gradient_field(&problem, &judged).expect("gradient"), &light.modulated);
    let steepest = slopes.iter().fold(0.0, |a: f32, s| a.max(s.abs()));
    let moved = |h: f32| {
        let wish: Vec<f32> = start.iter().zip(&slopes).map(|(start, slope)| start + h * slope / steepest).collect();
        problem.judge(&model.light(&wish).total).expect("light").error
    };
    let analytic: f64 = slopes.iter().map(|slope| f64::from(*slope).powi(2) / f64::from(steepest)).sum();
    let h = 0.1f32;
    let measured = (8.0 * (moved(h) - moved(-h)) - (moved(2.0 * h) - moved(-2.0 * h))) / (12.0 * f64::from(h));
    // The model's table has 2¹⁴ phases a turn: steps of 4e-4 on differences of 0.1.
    assert!((measured / analytic - 1.0).abs() < 5e-3, "{measured} {analytic}");
}

#[test]
fn one_plane_passes_35_and_three_planes_30_decibel_on_eight_bits() {
    let profile = panel(192, 144, 256.0);
    let grid = profile.grid().expect("grid");
    let flat = Target::Amplitude(vec![picture(grid, 0.02, 24..168, 0.0)]);
    let deep = Target::Amplitude(vec![
        picture(grid, 0.015, 24..68, 0.0),
        picture(grid, 0.02, 74..118, 1.0),
        picture(grid, 0.025, 124..168, 2.0),
    ]);
    let falls = |found: &Solution| found.history.windows(2).all(|pair| pair[1] <= pair[0]);
    let passes = |name: &str, found: Solution, least: f64| {
        println!("{name}: {:.1?} dB, efficiency {:.3}, {} rejected", found.psnr, found.efficiency, found.rejected);
        assert!(falls(&found), "{name}: {:?}", found.history);
        assert!(found.psnr.iter().all(|&p| p > least), "{name}: {:?}", found.psnr);
        assert!(found.efficiency > 0.05, "{name}: {}", found.efficiency);
    };
    let descent = GradientDescent { iterations: 300, ..GradientDescent::default() };
    let weighted = GerchbergSaxton { iterations: 300, ..GerchbergSaxton::default() };
    let smooth = Start::Quadratic { focal_length: 0.05 };
    let double = GerchbergSaxton {
        constraint: Constraint::AmplitudeAndPhase,
        efficiency: 0.5,
        start: smooth.clone(),
        ..weighted.clone()
    };
    for (target, least) in [(&flat, 35.0), (&deep, 30.0)] {
        let found = gradient_descent(target, &profile, WAVELENGTH, &descent, &Progress::new()).expect("descent");
        passes("gradient", found, least);
        let found = gerchberg_saxton(target, &profile, WAVELENGTH, &weighted, &Progress::new()).expect("weighted");
        passes("weighted", found, least);
        let found = gerchberg_saxton(target, &profile, WAVELENGTH, &double, &Progress::new()).expect("double");
        passes("double constraint", found, 15.0);
        let plain = GerchbergSaxton { weighting: 0.0, ..weighted.clone() };
        let found = gerchberg_saxton(target, &profile, WAVELENGTH, &plain, &Progress::new()).expect("plain");
        passes("plain", found, 15.0);
    }
}

#[test]
fn iterations_that_are_asked_to_stop_end_within_one() {
    let profile = panel(800, 600, 256.0);
    let grid = profile.grid().expect("grid");
    let target = Target::Amplitude([0.1, 0.12].map(|z| picture(grid, z, 100..700, 0.3)).to_vec());
    let descent = GradientDescent { iterations: 3, ..GradientDescent::default() };
    let projections = GerchbergSaxton { iterations: 3, ..GerchbergSaxton::default() };
    let run = |kind: usize, progress: &Progress| match kind {
        0 => gradient_descent(&target, &profile, WAVELENGTH, &descent, progress),
        _ => gerchberg_saxton(&target, &profile, WAVELENGTH, &projections, progress),
    };
    for kind in 0..2 {
        let begin = Instant::now();
        run(kind, &Progress::new()).expect("solution");
        let whole = begin.elapsed();
        // Asked when an iteration begins, whose transforms are most of what follows.
        let least = least_time_to_stop(|progress| run(kind, progress));
        println!("kind {kind}: {whole:?}, {least:?} after the stop");
        assert!(least < whole / 6, "{least:?} of {whole:?}");
    }
}
