//! Products in integers and in bfloat16: against f32 on one tile, and against the oracle as fields.

use super::batch::BATCH;
use super::kernel::ROWS;
use super::shape::{BFLOAT_NOISE, COLUMNS, INTEGER_NOISE, OVERSHOOT};
use super::*;
use crate::field::{Complex64, Grid, relative_error};
use crate::hologram::lanes::Portable;
use crate::hologram::lanes::matrix::{Plain, SIDE};
use crate::hologram::{HologramSettings, Method, compute, oracle, plan};
use crate::points::PointSource;
use crate::progress::Progress;
use crate::random::Random;
use glam::DVec3;

const WAVELENGTH: f64 = 632.8e-9;

/// Whether the machine has the kernel; says so where it has not.
fn present() -> bool {
    let present = InstructionSet::available().contains(&InstructionSet::Avx512Vnni);
    if !present {
        println!("not run: this machine has no AVX-512 VNNI");
    }
    present
}

/// A batch's sum over a tile by a kernel, bfloat16 with the plain unit, and by f32.
fn both(kernel: Kernel, width: usize, height: usize, points: &[Relative]) -> [Vec<Complex64>; 2] {
    let grid = Grid::new(width, height, 8e-6, 6.5e-6).expect("grid");
    let optics = Optics::new(&grid, WAVELENGTH).expect("optics");
    let table = EdgeTable::new(0.1, 0.5, &Progress::new());
    let limit = Limit::Soft(&table);
    let axes = [Axis::new(&optics, 0, limit), Axis::new(&optics, 1, limit)];
    let tile = Tile { width, height, axes: &axes, wavenumber: 1.0 / WAVELENGTH, limit };
    [kernel, Kernel::Float].map(|kernel| {
        let mut panels = Panels::default();
        panels.clear(width, height, kernel);
        for points in points.chunks(kernel::batch(kernel)) {
            // SAFETY: detected by the caller; cleared above.
            unsafe {
                match kernel {
                    Kernel::Integer => integer::add_batch(&tile, points, &mut panels),
                    Kernel::Bfloat => bfloat::add_batch::<Plain>(&tile, points, &mut panels),
                    Kernel::Float | Kernel::Paths => add_batch::<Portable>(&tile, points, &mut panels),
                }
            }
        }
        let parts = panels.re.values()[..width * height].iter().zip(&panels.im.values()[..width * height]);
        parts.map(|(re, im)| Complex64::new(f64::from(*re), f64::from(*im))).collect()
    })
}

fn distance(a: &[Complex64], b: &[Complex64]) -> f64 {
    let norm = |u: &mut dyn Iterator<Item = Complex64>| u.map(|u| u.norm_sqr()).sum::<f64>().sqrt();
    norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied())
}

#[test]
fn a_full_batch_in_phase_does_not_overflow() {
    if !present() {
        return;
    }
    for (eighth, amplitude) in (0..8).flat_map(|eighth| [(eighth, 1.0), (eighth, -3.0)]) {
        // So far away that the tile sees one phase: each sum is within a thousandth of the largest that there is. At
        // odd eighths both parts of the factors have their largest sum.
        let wave = Relative { distance: 1e4, amplitude, turns: eighth as f64 / 8.0, sign: 1.0, ..Relative::default() };
        let turns = wave.turns - (wave.distance / WAVELENGTH).fract();
        let points = [Relative { turns, ..wave }; BATCH];
        let [integer, float] = both(Kernel::Integer, 32, 8, &points);
        let center = Complex64::from_polar(
            amplitude * BATCH as f64 / wave.distance,
            eighth as f64 * std::f64::consts::FRAC_PI_4,
        );
        assert!((integer[16 * 4] / center - 1.0).norm() < 1e-3, "{eighth}: {} of {center}", integer[64]);
        let error = distance(&integer, &float);
        assert!(error < 3.0 * INTEGER_NOISE, "{eighth} {amplitude}: {error:.2e}");
    }
    // On the taper's edge, where its overshoot sets the scale.
    let edge = Relative { dx: 5.2e-3, dy: 6.3e-3, distance: 0.2, amplitude: 1.0, turns: 0.3, sign: -1.0 };
    let [integer, float] = both(Kernel::Integer, 96, 40, &[edge; BATCH]);
    let error = distance(&integer, &float);
    assert!(error < 4.0 * INTEGER_NOISE, "{error:.2e}");
}

/// Points up to 9 mm aside of a tile, of both signs: some on the taper's edge.
fn around(seed: u64, count: usize) -> Vec<Relative> {
    (0..count as u64)
        .map(|i| {
            let mut random = Random::new(seed, i);
            let mut aside = |half: f64| half * (2.0 * random.uniform() - 1.0);
            let (dx, dy, turns) = (aside(9e-3), aside(9e-3), aside(1.0));
            let sign = if i % 3 == 0 { -1.0 } else { 1.0 };
            Relative { dx, dy, distance: 0.2, amplitude: 1.0, turns, sign }
        })
        .collect()
}

#[test]
fn rounding_is_what_is_stated_for_every_count_of_points_and_size_of_tile() {
    if !present() {
        return;
    }
    let (mut squares, mut tries) = (0.0, 0.0);
    for (number, count) in [1, 2, 3, 31, 63, 64, 64, 64].into_iter().enumerate() {
        for (width, height) in [(COLUMNS, ROWS), (96, 36), (128, 128), (192, 188)] {
            let points = around(number as u64, count);
            let [integer, float] = both(Kernel::Integer, width, height, &points);
            let error = distance(&integer, &float);
            // One point has its own few roundings; those of many are independent.
            let allowed = if count < 30 { 3.0 } else { OVERSHOOT * 2f64.sqrt() } * INTEGER_NOISE;
            assert!(error < allowed, "{count} on {width}×{height}: {error:.2e} over {allowed:.2e}");
            if count > 60 {
                (squares, tries) = (squares + error * error, tries + 1.0);
            }
        }
    }
    let mean = (squares / tries).sqrt();
    println!("rounding {mean:.2e}, stated {:.2e} a factor", INTEGER_NOISE);
    assert!(mean > 0.5 * INTEGER_NOISE, "{mean:.2e}: states far too much");
}

#[test]
fn bfloat16_rounds_as_stated_for_every_count_of_points_and_size_of_tile() {
    if !present() {
        return;
    }
    let (mut squares, mut tries) = (0.0, 0.0);
    for (number, count) in [1, 2, 15, 16, 17, 64, 65, 127, 128, 129].into_iter().enumerate() {
        for (width, height) in [(COLUMNS, SIDE), (96, 48), (128, 112), (192, 192)] {
            let mut points = around(number as u64, count);
            // However bright others are, each is rounded to its own size: what is dim beside them may be lost in the sum.
            points.iter_mut().step_by(7).for_each(|p| p.amplitude = 1e-3);
            let [bfloat, float] = both(Kernel::Bfloat, width, height, &points);
            let error = distance(&bfloat, &float);
            let allowed = if count < 30 { 1.6 } else { 1.0 } * BFLOAT_NOISE;
            assert!(error < allowed, "{count} on {width}×{height}: {error:.2e} over {allowed:.2e}");
            if count > 60 {
                (squares, tries) = (squares + error * error, tries + 1.0);
            }
        }
    }
    let mean = (squares / tries).sqrt();
    println!("rounding {mean:.2e}, stated {BFLOAT_NOISE:.2e}");
    assert!(mean > 0.5 * BFLOAT_NOISE, "{mean:.2e}: states far too much");
}

fn settings() -> HologramSettings {
    let set = InstructionSet::Avx512Vnni;
    HologramSettings {
        error: 2e-3,
        method: Some(Method::Tiles),
        instruction_set: Some(set),
        ..HologramSettings::default()
    }
}

/// Around `center`, z in `z`: amplitudes over a factor `range`, evenly in their logarithm, phases of a smooth surface or
/// at random.
fn cloud(n: u64, center: [f64; 2], z: [f64; 2], range: f64, smooth: bool) -> Vec<PointSource> {
    (0..n)
        .map(|i| {
            let mut random = Random::new(17, i);
            let x = center[0] + (random.uniform() - 0.5) * 5e-3;
            let y = center[1] + (random.uniform() - 0.5) * 4e-3;
            let z = z[0] + (z[1] - z[0]) * random.uniform();
            let sign = if i % 5 == 0 { -1.0 } else { 1.0 };
            let amplitude = (sign * range.powf(-random.uniform())) as f32;
            let phase = if smooth { 1e7 * (x * x - y * y) } else { random.phase() };
            PointSource { position: DVec3::new(x, y, z), amplitude, phase }
        })
        .collect()
}

#[test]
fn fields_keep_the_error_that_they_state() {
    if !present() {
        return;
    }
    // Odd, not square, pitch x ≠ y, off the axis.
    let middle = [0.4e-3, -0.3e-3];
    let grid = Grid::new(165, 101, 8e-6, 6.5e-6).expect("grid").centered_at(middle);
    let all = &[Cull::Soft, Cull::Hard, Cull::None][..];
    let soft = &all[..1];
    let mut one = cloud(203, middle, [-0.2, -0.2], 1.0, false);
    one.iter_mut()
        .for_each(|p| *p = PointSource { position: DVec3::new(1e-3, 2e-3, -0.2), amplitude: 2.0, phase: 1.0 });
    let mut bright = cloud(203, middle, [-0.25, -0.2], 2.0, false);
    bright[77].amplitude = 1e3;
    let both_sides: Vec<PointSource> =
        [cloud(102, middle, [-0.2, -0.25], 4.0, false), cloud(101, middle, [0.15, 0.3], 4.0, false)].concat();
    let cases = [
        ("random phase", cloud(203, middle, [-0.2, -0.25], 4.0, false), all, true),
        ("smooth phase", cloud(203, middle, [-0.2, -0.25], 4.0, true), soft, true),
        ("amplitudes 1:1000", cloud(203, middle, [-0.2, -0.25], 1e3, false), all, true),
        ("amplitudes 1:1000, smooth", cloud(203, middle, [-0.2, -0.25], 1e3, true), soft, true),
        ("one brighter than all", bright, soft, false),
        ("duplicates", one, soft, true),
        ("off axis", cloud(203, [7e-3, -6e-3], [-0.2, -0.25], 4.0, false), soft, true),
        ("far off axis", cloud(203, [-9e-3, 9.5e-3], [-0.2, -0.25], 4.0, false), all, true),
        ("both sides", both_sides, soft, true),
        ("near", cloud(203, middle, [-0.03, -0.04], 4.0, false), soft, true),
    ];
    let mut bad = Vec::new();
    for (name, points, culls, integers) in &cases {
        for &cull in *culls {
            let exact = oracle(points, &grid, WAVELENGTH, cull).expect("oracle");
            for error in [5e-3, 2e-3, 1.3e-3] {
                let settings = HologramSettings { cull, error, ..settings() };
                let plan = plan(points, &grid, WAVELENGTH, &settings).expect("plan");
                let got = compute(points, &grid, WAVELENGTH, &plan, &Progress::new()).expect("field");
                let (found, bound) = (relative_error(&got.field.samples, &exact.samples), got.report.error_bound);
                let what = format!("{name} {cull:?} {error:.1e}: {found:.2e}, bound {bound:.2e}, {}", plan.reason);
                println!("{what}");
                let kept = found < bound && bound <= error;
                if !kept || error == 5e-3 && plan.reason.contains("integers") != *integers {
                    bad.push(what);
                }
            }
        }
    }
    assert!(bad.is_empty(), "{bad:#?}");
}

#[test]
fn integers_give_the_same_bits_for_any_number_of_threads() {
    if !present() {
        return;
    }
    let grid = Grid::new(301, 187, 8e-6, 8e-6).expect("grid");
    let points = cloud(500, [0.0; 2], [-0.2, -0.25], 4.0, false);
    let settings = settings();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        let plan = plan(&points, &grid, WAVELENGTH, &settings).expect("plan");
        assert!(plan.reason.contains("integers"), "{}", plan.reason);
        pool.install(|| compute(&points, &grid, WAVELENGTH, &plan, &Progress::new()).expect("field").field)
    };
    let one = run(1);
    assert_eq!(one, run(3));
    assert_eq!(one, run(2));
}
