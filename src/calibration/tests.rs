//! Hidden curves and wavefront errors are found again on the simulated panel.

use super::*;
use crate::field::{Complex32, Grid};
use crate::panel::{Curve, Faults, PanelProfile, Response, Simulation, Wavefront, correct, simulate};
use crate::progress::Progress;
use crate::random::Random;
use std::f64::consts::{PI, TAU};
use std::path::Path;

const WAVELENGTH: f64 = 532e-9;

fn panel(width: usize, height: usize) -> PanelProfile {
    let text = format!(
        "name = \"t\"\nmaker = \"t\"\nkind = \"phase-lcos\"\nwidth = {width}\nheight = {height}\npitch = \"8um\"\nbits = 8\n\
         fill_factor = 0.93\nwavelengths = [\"532nm\"]\n[[response]]\nkind = \"linear\"\nlevels_for_2pi = 256\n"
    );
    PanelProfile::parse(&text, Path::new("t.toml")).expect("profile")
}

/// Normal noise by twelve uniform numbers.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.uniform()).sum::<f64>() - 6.0
}

fn grating(level: u16, stripe: usize) -> Grating {
    Grating { fixed: 0, level, stripe, region: None }
}

/// A curve of `range` rad with a random smooth deviation of five per cent of it at its greatest.
fn hidden(range: f64, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed, 7);
    let waves: Vec<f64> = (1..=3).map(|k| (2.0 * random.uniform() - 1.0) / f64::from(k)).collect();
    let deviation = |x: f64| waves.iter().zip(1..).map(|(a, k)| a * (PI * f64::from(k) * x).sin()).sum::<f64>();
    let greatest = (0..256).map(|l| deviation(f64::from(l) / 255.0).abs()).fold(0.0, f64::max);
    (0..256).map(|level| f64::from(level) / 255.0).map(|x| range * (x + 0.05 * deviation(x) / greatest)).collect()
}

#[test]
fn a_curved_response_is_found_again_from_noisy_powers() {
    let profile = panel(32, 4);
    for (range, order) in
        [(2.1 * PI, Order::First), (2.1 * PI, Order::Zero), (1.6 * PI, Order::First), (5.2 * PI, Order::First)]
    {
        let truth = hidden(range, (100.0 * range) as u64);
        let response = Some(Response { wavelength: None, curve: Curve::Table { phase: truth.clone() } });
        let mut random = Random::new(3, 0);
        let powers: Vec<(u16, f64)> = (0..256u16)
            .map(|level| {
                let frame = grating_frame(&profile, WAVELENGTH, &grating(level, 4)).expect("frame");
                let settings = Simulation {
                    faults: Faults { response: response.clone(), ..Faults::default() },
                    ..Simulation::default()
                };
                let seen = simulate(&frame, &settings, &Progress::new()).expect("simulate");
                // Stripes of four columns: the first order has four cycles over 32 columns.
                let cycles = if order == Order::First { 4.0 } else { 0.0 };
                let sum: num_complex::Complex64 = seen.samples[..32]
                    .iter()
                    .enumerate()
                    .map(|(x, u)| {
                        let turn = num_complex::Complex64::cis(-TAU * cycles * x as f64 / 32.0);
                        num_complex::Complex64::new(u.re.into(), u.im.into()) * turn / 32.0
                    })
                    .sum();
                let power = sum.norm_sqr() * 7.0;
                (level, power * (1.0 + 0.01 * normal(&mut random)) + 0.2)
            })
            .collect();
        let fit = fit_curve(&powers, 256, order, None, Path::new("powers.csv")).expect("fit");
        let found = Response { wavelength: None, curve: fit.curve.clone() };
        let profile = PanelProfile { responses: vec![found], ..profile.clone() };
        let values = profile.drive_curve(WAVELENGTH).expect("curve").0;
        let squares: f64 = values.values().iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).sum();
        let rms = (squares / 256.0).sqrt();
        println!("{range:.2} rad, {order:?}: {rms:.4} rad RMS, degree {}", fit.degree);
        assert!(rms < 0.05, "{range} {order:?}: {rms} rad");
        assert!(fit.uncertainty.iter().all(|u| *u < 0.1) && (fit.range / range - 1.0).abs() < 0.02);
    }
}

#[test]
fn sweeps_that_tell_nothing_are_refused() {
    let path = Path::new("powers.csv");
    let flat: Vec<(u16, f64)> = (0..256).map(|l| (l, 1.0)).collect();
    assert!(
        fit_curve(&flat, 256, Order::First, Some(5), path).expect_err("flat").to_string().contains("no modulation")
    );
    assert!(
        fit_curve(&flat[..20], 256, Order::First, Some(5), path).expect_err("few").to_string().contains("20 powers")
    );
    let folder = tempfile::tempdir().expect("folder");
    let file = folder.path().join("p.csv");
    std::fs::write(&file, "level,power\n0,0.1\n# remark\n1;0.2\n255\t3e-3\n").expect("write");
    let whole = |level: u16, power: f64| Power { level, region: None, power };
    assert_eq!(read_powers(&file, 256, 532e-9).expect("read"), [whole(0, 0.1), whole(1, 0.2), whole(255, 3e-3)]);
    std::fs::write(&file, "power,file,row,column,level\n0.5,a.png,1,2,7\n").expect("write");
    assert_eq!(read_powers(&file, 256, 532e-9).expect("read"), [Power { level: 7, region: Some((2, 1)), power: 0.5 }]);
    std::fs::write(&file, "level,wavelength,power\n7,532nm,0.5\n").expect("write");
    assert_eq!(read_powers(&file, 256, 532e-9).expect("read"), [whole(7, 0.5)]);
    let other = read_powers(&file, 256, 632.8e-9).expect_err("another laser").to_string();
    assert!(other.contains("line 2: measured at 532nm, not at 632.8nm"), "{other}");
    for (text, word) in [
        ("level,wavelength,power\n3,green,1\n", "`green` is no wavelength"),
        ("0,1\n256,1\n", "line 2: level 256"),
        ("0,1\nx,1\n", "line 2"),
        ("0,1,2\n", "line 1"),
        ("0,nan\n", "line 1"),
        ("level,power\n3,\n", "line 2: the power is missing"),
        ("level,column,row,power\n3,0,0,1\n3,,,1\n", "line 3"),
        ("level,column,row,power\n3,0,,1\n", "column and a row"),
        ("# nothing\n", "no powers"),
    ] {
        std::fs::write(&file, text).expect("write");
        let error = read_powers(&file, 256, 532e-9).expect_err(word).to_string();
        assert!(error.contains(word), "{error}");
    }
    assert!(grating_frame(&panel(8, 4), WAVELENGTH, &grating(300, 2)).is_err());
    let outside = Some(Region { place: (2, 0), parts: (2, 1) });
    assert!(grating_frame(&panel(8, 4), WAVELENGTH, &Grating { region: outside, ..grating(3, 2) }).is_err());
}

#[test]
fn two_waves_of_error_are_found_from_stepped_interferograms_and_corrected() {
    let (width, height) = (48, 40);
    let profile = PanelProfile { fill_factor: 1.0, ..panel(width, height) };
    let grid = profile.grid().expect("grid");
    // Tilt, defocus, astigmatism and coma: two waves from lowest to highest.
    let error = zernike::wavefront(grid, WAVELENGTH, &[0.0, 0.6, -0.3, 3.3, 0.8, 0.0, 0.4, -0.6], 2.5e-4, "error")
        .expect("wavefront");
    let span = error.phase.iter().fold((f32::MAX, f32::MIN), |(l, h), &p| (l.min(p), h.max(p)));
    assert!(span.1 - span.0 > 2.0 * TAU as f32, "{span:?}");
    let settings = Simulation {
        faults: Faults { wavefront_error: Some(error.clone()), ..Faults::default() },
        ..Simulation::default()
    };
    let mut random = Random::new(8, 0);
    let pictures: Vec<Vec<f32>> = step_frames(&profile, WAVELENGTH, 5)
        .expect("frames")
        .frames()
        .map(|frame| {
            let seen = simulate(&frame.expect("frame"), &settings, &Progress::new()).expect("simulate");
            let light =
                |u: &Complex32| (u + Complex32::new(0.8, 0.0)).norm_sqr() * (1.0 + 0.01 * normal(&mut random) as f32);
            seen.samples.iter().map(light).collect()
        })
        .collect();
    let found = wavefront_from_steps(&pictures, width, height, WAVELENGTH, "measured").expect("wavefront");
    let miss = |a: f32, b: f32| (f64::from(a - b) + PI).rem_euclid(TAU) - PI;
    let squares: f64 = found.phase.iter().zip(&error.phase).map(|(a, b)| miss(*a, *b).powi(2)).sum();
    let rms = (squares / grid.len() as f64).sqrt();
    assert!(rms < TAU / 50.0, "{rms} rad");
    // After correction a flat panel sends within 1 % of its light straight on.
    let flat = step_frames(&profile, WAVELENGTH, 3).expect("frames").frames().next().expect("first").expect("frame");
    let corrected = correct(&flat, &found.conjugate()).expect("correct").frame;
    let seen = simulate(&corrected, &settings, &Progress::new()).expect("simulate");
    let sum: Complex32 = seen.samples.iter().sum();
    let efficiency = f64::from(sum.norm_sqr()) / (grid.len() as f64).powi(2);
    assert!(efficiency > 0.99, "{efficiency}");
    assert!(wavefront_from_steps(&pictures[..2], width, height, WAVELENGTH, "x").is_err());
    assert!(wavefront_from_steps(&pictures, height, height, WAVELENGTH, "x").is_err());
    let same = vec![vec![1.0; grid.len()]; 4];
    assert!(wavefront_from_steps(&same, width, height, WAVELENGTH, "x").is_err());
}

#[test]
fn zernike_polynomials_have_nolls_order_and_unit_variance() {
    let table = [
        (0, 0),
        (1, 1),
        (1, -1),
        (2, 0),
        (2, -2),
        (2, 2),
        (3, -1),
        (3, 1),
        (3, -3),
        (3, 3),
        (4, 0),
        (4, 2),
        (4, -2),
        (4, 4),
        (4, -4),
    ];
    for (i, expected) in table.iter().enumerate() {
        assert_eq!(zernike::noll(i + 1), *expected, "j = {}", i + 1);
    }
    // Sums over a fine lattice of the disc; the rim is the error.
    let grid = Grid::new(400, 400, 1.0, 1.0).expect("grid");
    let points: Vec<(f64, f64)> = (0..grid.len())
        .map(|i| (grid.x(i % 400) / 200.0, grid.y(i / 400) / 200.0))
        .map(|(x, y)| (x.hypot(y), y.atan2(x)))
        .filter(|p| p.0 <= 1.0)
        .collect();
    for j in 1..=15 {
        for k in j..=15 {
            let sum: f64 = points.iter().map(|(r, t)| zernike::value(j, *r, *t) * zernike::value(k, *r, *t)).sum();
            let expected = if j == k { 1.0 } else { 0.0 };
            assert!((sum / points.len() as f64 - expected).abs() < 0.01, "{j} {k}");
        }
    }
    assert!(zernike::wavefront(grid, 5e-7, &[1.0], 0.0, "x").is_err());
    assert!(zernike::wavefront(grid, 5e-7, &[], 1.0, "x").is_err());
    let one: Wavefront = zernike::wavefront(grid, 5e-7, &[0.0, 1.0], 200.0, "tilt").expect("tilt");
    // Z₂ = 2ρ·cos θ: rises with x.
    assert!((f64::from(one.phase[399]) - 2.0 * grid.x(399) / 200.0).abs() < 1e-5);
}
