//! Whatever points are given, every engine keeps its error or refuses, and never says NaN.

use super::definition::Optics;
use super::*;
use crate::field::Complex64;
use glam::DVec3;
use proptest::prelude::*;

/// A small panel, its pitches, middle, and the wavelength.
fn panels() -> impl Strategy<Value = (Grid, f64)> {
    let pitch = prop::sample::select(vec![[8e-6, 6.5e-6], [3.74e-6, 3.74e-6], [1e-6, 1.25e-6]]);
    (1usize..70, 1usize..50, pitch, -1.0..1.0f64, -1.0..1.0f64, 450e-9..650e-9f64).prop_map(
        |(width, height, [px, py], x, y, wavelength)| {
            let grid = Grid::new(width, height, px, py).expect("grid");
            (grid.centered_at([x * grid.extent_x(), y * grid.extent_y()]), wavelength)
        },
    )
}

/// On the plane, within a wavelength, at 0.1 mm, near and far, before and behind.
fn depths() -> impl Strategy<Value = f64> {
    let distance = prop_oneof![Just(0.0), 1e-9..1e-6f64, Just(1e-4), 1e-5..1e-3f64, 0.05..0.5f64, Just(10.0),];
    (distance, any::<bool>()).prop_map(|(z, front)| if front { z } else { -z })
}

/// Position in units of the panel's half extent and of the depth's cone: inside, on the border, far outside.
fn points() -> impl Strategy<Value = Vec<(f64, f64, f64, f32, f64)>> {
    let aside = || prop_oneof![4 => -1.0..1.0f64, 2 => -3.0..3.0f64, 1 => -50.0..50.0f64];
    let amplitude = prop_oneof![1 => Just(0.0f32), 6 => 1e-3..1.0f32];
    prop::collection::vec((aside(), aside(), depths(), amplitude, -10.0..10.0f64), 1..5)
}

/// Norm on the whole plane, in pixels, of all points if they were in phase: a·λ·√(2b_x·2b_y/(pitch_x·pitch_y)) each.
fn whole(optics: &Optics, points: &[PointSource]) -> f64 {
    let [x, y] = optics.taper.map(|taper| 2.0 * taper.middle);
    let one = optics.wavelength * (x * y / (optics.pitch[0] * optics.pitch[1])).sqrt();
    points.iter().map(|p| f64::from(p.amplitude.abs()) * one).sum()
}

fn norm(samples: impl Iterator<Item = Complex64>) -> f64 {
    samples.map(|u| u.norm_sqr()).sum::<f64>().sqrt()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(4), ..ProptestConfig::default() })]

    #[test]
    fn every_engine_keeps_its_error_for_any_points((grid, wavelength) in panels(), specks in points()) {
        let points: Vec<PointSource> = specks
            .iter()
            .map(|&(x, y, z, amplitude, phase)| {
                let x = grid.center[0] + 0.5 * x * grid.extent_x();
                let y = grid.center[1] + 0.5 * y * grid.extent_y();
                PointSource { position: DVec3::new(x, y, z), amplitude, phase }
            })
            .collect();
        let optics = Optics::new(&grid, wavelength).expect("optics");
        let exact = oracle(&points, &grid, wavelength, Cull::Soft).expect("oracle");
        let lit = norm(exact.samples.iter().copied());
        prop_assert!(lit.is_finite());
        for (method, error) in [(Method::Direct, 1e-4), (Method::Tiles, 1e-3), (Method::Planes, 1e-3)] {
            let settings = HologramSettings { method: Some(method), error: 1e-3, memory: 64 << 20, ..Default::default() };
            let plan = match plan(&points, &grid, wavelength, &settings) {
                Ok(plan) => plan,
                Err(refusal) => {
                    // Cones of metres at a micrometre's pitch need more samples than the budget holds.
                    prop_assert_eq!(method, Method::Planes, "{}", refusal);
                    let clear = matches!(refusal, crate::Error::Memory { .. }) || refusal.to_string().contains("take direct");
                    prop_assert!(clear, "{}", refusal);
                    continue;
                }
            };
            let got = compute(&points, &grid, wavelength, &plan, &Progress::new()).expect("field");
            prop_assert!(got.field.samples.iter().all(|u| u.re.is_finite() && u.im.is_finite()));
            let difference = norm(got.field.samples.iter().zip(&exact.samples).map(|(a, b)| {
                Complex64::new(f64::from(a.re) - b.re, f64::from(a.im) - b.im)
            }));
            // A panel that sees the tails of the points' light only: the error is then one of all their light.
            let allowed = error * (lit + 0.25 * whole(&optics, &points));
            prop_assert!(difference <= allowed, "{method:?}: {difference:.3e} over {allowed:.3e}, lit {lit:.3e}");
        }
    }
}

#[test]
fn points_at_a_tenth_of_a_millimetre_and_on_the_plane_are_right_in_every_engine() {
    for pitch in [[8e-6, 6.5e-6], [3.74e-6, 4.5e-6], [1e-6, 1.25e-6]] {
        let grid = Grid::new(91, 67, pitch[0], pitch[1]).expect("grid").centered_at([1e-4, -2e-4]);
        for z in [0.0, 1e-10, 1e-7, 1e-5, 1e-4, 5e-4, 1e-3] {
            let points: Vec<PointSource> = (0..12u64)
                .map(|i| {
                    let mut random = crate::random::Random::new(9, i);
                    let x = grid.center[0] + (random.uniform() - 0.5) * 0.8 * grid.extent_x();
                    let y = grid.center[1] + (random.uniform() - 0.5) * 0.8 * grid.extent_y();
                    let z = if i % 2 == 0 { z } else { -z };
                    PointSource { position: DVec3::new(x, y, z), amplitude: 1.0, phase: random.phase() }
                })
                .collect();
            let exact = oracle(&points, &grid, 532e-9, Cull::Soft).expect("oracle");
            for (method, wanted) in [(Method::Direct, 1e-5), (Method::Tiles, 1e-5), (Method::Planes, 1e-3)] {
                let settings = HologramSettings { method: Some(method), error: 1e-3, ..Default::default() };
                let plan = plan(&points, &grid, 532e-9, &settings).expect("plan");
                let got = compute(&points, &grid, 532e-9, &plan, &Progress::new()).expect("field");
                let error = crate::field::relative_error(&got.field.samples, &exact.samples);
                println!("{pitch:?} z {z:.0e} {method:?}: {error:.2e}, bound {:.2e}", got.report.error_bound);
                assert!(error < wanted, "{pitch:?} z {z:.0e} {method:?}: {error:.2e}");
            }
        }
    }
}

#[test]
fn a_million_duplicates_are_one_point_a_million_times_as_bright() {
    let grid = Grid::new(64, 40, 8e-6, 8e-6).expect("grid");
    for z in [-0.2, 1e-4] {
        let one = PointSource { position: DVec3::new(1e-5, 2e-5, z), amplitude: 1e-6, phase: 1.0 };
        let many = vec![one; 1_000_000];
        let bright = PointSource { amplitude: 1.0, ..one };
        let exact = oracle(&[bright], &grid, 532e-9, Cull::Soft).expect("oracle");
        // Near points are computed one by one by the exact engines: 30 µs each.
        let methods = if z < 0.0 { vec![Method::Direct, Method::Tiles, Method::Planes] } else { vec![Method::Planes] };
        for method in methods {
            let settings = HologramSettings { method: Some(method), error: 1e-3, ..Default::default() };
            let plan = plan(&many, &grid, 532e-9, &settings).expect("plan");
            let got = compute(&many, &grid, 532e-9, &plan, &Progress::new()).expect("field");
            let error = crate::field::relative_error(&got.field.samples, &exact.samples);
            println!("duplicates at {z} m {method:?}: {error:.2e}");
            assert!(error < 1e-3, "{z} m {method:?}: {error:.2e}");
        }
    }
}

#[test]
fn no_light_is_a_dark_field_and_nonsense_is_refused() {
    let grid = Grid::new(33, 21, 8e-6, 8e-6).expect("grid");
    let dark = PointSource { position: DVec3::new(0.0, 0.0, -0.1), amplitude: 0.0, phase: 0.0 };
    for method in [Method::Oracle, Method::Direct, Method::Tiles, Method::Planes] {
        let settings = HologramSettings { method: Some(method), ..Default::default() };
        for points in [vec![], vec![dark], vec![dark; 7]] {
            let plan = plan(&points, &grid, 532e-9, &settings).expect("plan");
            let got = compute(&points, &grid, 532e-9, &plan, &Progress::new()).expect("field");
            assert!(got.field.samples.iter().all(|u| u.norm_sqr() == 0.0), "{method:?}");
        }
        for bad in [f64::NAN, f64::INFINITY] {
            let nonsense = [dark, PointSource { position: DVec3::new(0.0, bad, -0.1), amplitude: 1.0, phase: 0.0 }];
            let refused = plan(&nonsense, &grid, 532e-9, &settings).unwrap_err().to_string();
            assert!(refused.contains("point 1"), "{refused}");
        }
    }
}
