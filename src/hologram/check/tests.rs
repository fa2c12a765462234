use super::*;
use crate::field::{Grid, relative_error};
use crate::hologram::definition::Optics;
use crate::hologram::sources::sources;
use crate::hologram::{Cull, oracle_at};
use crate::points::PointSource;
use crate::progress::Progress;
use glam::DVec3;

const WANTED: Wanted = Wanted { core_seconds: 0.0, error: 1e-3, thorough: false };

fn cloud(grid: &Grid, count: u64, z: [f64; 2], spread: f64) -> Vec<PointSource> {
    (0..count)
        .map(|i| {
            let mut random = Random::new(21, i);
            let x = grid.center[0] + spread * (random.uniform() - 0.5) * grid.extent_x();
            let y = grid.center[1] + spread * (random.uniform() - 0.5) * grid.extent_y();
            let side = if random.uniform() < 0.5 { -1.0 } else { 1.0 };
            let depth = side * (z[0] + (z[1] - z[0]) * random.uniform());
            PointSource { position: DVec3::new(x, y, depth), amplitude: random.uniform_f32(), phase: random.phase() }
        })
        .collect()
}

#[test]
fn the_sum_at_pixels_is_the_oracle_s() {
    let wavelength = 532e-9;
    for (pitch, z, spread) in [
        ([8e-6, 6.5e-6], [0.05, 0.4], 4.0),
        ([8e-6, 6.5e-6], [1e-3, 4e-2], 1.5),
        ([8e-6, 8e-6], [0.0, 1e-4], 1.0),
        ([3.74e-6, 5e-6], [1.0, 1e3], 900.0),
        ([1e-6, 1.25e-6], [4e-3, 9e-3], 30.0),
        ([1e-6, 1e-6], [5e-6, 2e-4], 1.0),
        ([0.4e-6, 0.4e-6], [5e-6, 6e-5], 1.0),
    ] {
        let grid = Grid::new(37, 29, pitch[0], pitch[1]).expect("grid").centered_at([1e-4, -2e-4]);
        let optics = Optics::new(&grid, wavelength).expect("optics");
        let points = cloud(&grid, 21, z, spread);
        let (sources, progress) = (sources(&points).expect("sources"), Progress::new());
        for cull in [Cull::Soft, Cull::Hard, Cull::None] {
            let sum = PointSum { optics: &optics, grid: &grid, sources: &sources, cull, progress: &progress };
            let pixels: Vec<usize> = (0..12).map(|i| i * 89 % grid.len()).collect();
            let places: Vec<_> = pixels.iter().map(|i| (i % grid.width, i / grid.width)).collect();
            let exact = oracle_at(&points, &grid, wavelength, cull, &places).expect("oracle");
            let found = Exact::new(&sum, 0.0).at(&sum, &pixels, false).expect("sum");
            let error = relative_error(&found, &exact);
            let quickly = Exact::new(&sum, 0.0).at(&sum, &pixels, true).expect("sum");
            let quick = relative_error(&quickly, &found);
            println!("{pitch:?} {z:?} {cull:?}: {error:.1e}, quickly {quick:.1e}");
            assert!(quick < QUICK, "{pitch:?} {z:?} {cull:?}: {quick:.1e}");
            // The far form stands for the integral within 2e-5 here and 1e-5 there.
            assert!(error < 3e-5, "{pitch:?} {z:?} {cull:?}: {error:.1e}");
        }
    }
}

#[test]
fn one_mean_of_a_hundred_passes_its_limit() {
    // Squares of a complex Gaussian error, and those of one that is in a tenth of the pixels only.
    for (share, n, most) in [(1.0, FEWEST, 0.015), (1.0, 8 * FEWEST, 0.015), (0.1, 8 * FEWEST, 0.05)] {
        let trials = 4000;
        let passed = (0..trials).filter(|trial| {
            let mut random = Random::new(5, *trial);
            let mut square = || if random.uniform() < share { -random.uniform().max(1e-300).ln() / share } else { 0.0 };
            let values: Vec<f64> = (0..n).map(|_| square()).collect();
            upper_limit(&values, values.iter().sum::<f64>() / n as f64) < 1.0
        });
        let part = passed.count() as f64 / trials as f64;
        println!("errors in {share} of the pixels, {n} seen: {part}");
        assert!(part < most, "{share}, {n}: {part}");
    }
}

#[test]
fn an_error_is_measured_wherever_it_is() {
    let grid = Grid::new(200, 150, 8e-6, 8e-6).expect("grid");
    let optics = Optics::new(&grid, 532e-9).expect("optics");
    let points = cloud(&grid, 200, [0.1, 0.2], 0.9);
    let (sources, progress) = (sources(&points).expect("sources"), Progress::new());
    let sum = PointSum { optics: &optics, grid: &grid, sources: &sources, cull: Cull::Soft, progress: &progress };
    let all: Vec<usize> = (0..grid.len()).collect();
    let exact = Exact::new(&sum, 0.0).at(&sum, &all, false).expect("field");
    let right: Vec<Complex32> = exact.iter().map(|u| Complex32::new(u.re as f32, u.im as f32)).collect();
    let found = measure(&sum, &right, WANTED).expect("measured");
    assert!(found.limit < 1e-5 && found.pixels == MOST, "{found:?}");
    // A part in a hundred everywhere.
    let scaled: Vec<Complex32> = right.iter().map(|u| u * 1.01).collect();
    let found = measure(&sum, &scaled, WANTED).expect("measured");
    assert!((found.error / 0.01 - 1.0).abs() < 0.1 && found.limit >= found.error, "{found:?}");
    // A tenth of the panel dark, or lit by what is not there: √0.1 of the field.
    for value in [Complex32::default(), Complex32::new(0.0, 300.0)] {
        let mut wrong = right.clone();
        wrong[..grid.len() / 10].fill(value);
        let exact = relative_error(&wrong, &right);
        let found = measure(&sum, &wrong, WANTED).expect("measured");
        assert!(found.error > 0.6 * exact && found.limit > 0.9 * exact, "{exact} {found:?}");
    }
    // Where it takes no longer than what may be spent, all pixels.
    let found = measure(&sum, &scaled, Wanted { core_seconds: 1e3, ..WANTED }).expect("measured");
    assert!(found.whole && (found.error / 0.01 - 1.0).abs() < 1e-3 && found.limit < 0.01001, "{found:?}");
    let mut nan = right;
    nan[7].im = f32::NAN;
    assert_eq!(measure(&sum, &nan, WANTED).expect("measured").error, f64::INFINITY);
}
