//! Engines against the oracle, as complex fields.

use super::*;
use crate::field::relative_error;
use crate::random::Random;
use glam::DVec3;

/// A cloud over `extent` about `center` with z in `z`; random phases, or those of one smooth surface.
fn cloud(n: usize, center: [f64; 2], extent: [f64; 2], z: [f64; 2], smooth: bool) -> Vec<PointSource> {
    (0..n as u64)
        .map(|i| {
            let mut random = Random::new(11, i);
            let x = center[0] + (random.uniform() - 0.5) * extent[0];
            let y = center[1] + (random.uniform() - 0.5) * extent[1];
            let depth = z[0] + (z[1] - z[0]) * random.uniform();
            let amplitude = 0.25 + 0.75 * random.uniform_f32();
            let phase = if smooth { 1e7 * (x * x - y * y) } else { random.phase() };
            PointSource { position: DVec3::new(x, y, depth), amplitude, phase }
        })
        .collect()
}

fn settings(method: Method, error: f64, set: InstructionSet) -> HologramSettings {
    HologramSettings { error, method: Some(method), instruction_set: Some(set), ..HologramSettings::default() }
}

fn field(points: &[PointSource], grid: &Grid, settings: &HologramSettings) -> Computed {
    let plan = plan(points, grid, WAVELENGTH, settings).expect("plan");
    compute(points, grid, WAVELENGTH, &plan, &Progress::new()).expect("field")
}

const WAVELENGTH: f64 = 632.8e-9;

/// Odd, non-square, pitch x ≠ y, and off the axis.
fn panel() -> Grid {
    Grid::new(205, 131, 8e-6, 6.5e-6).expect("grid").centered_at([0.4e-3, -0.3e-3])
}

/// Name, points: near, far, off axis, through the panel.
fn clouds(smooth: bool) -> Vec<(&'static str, Vec<PointSource>)> {
    let wide = [1.6e-3, 0.9e-3];
    vec![
        ("near", cloud(9, [0.4e-3, -0.3e-3], wide, [-4e-3, -16e-3], smooth)),
        ("far", cloud(60, [0.0, 0.0], [15e-3, 8e-3], [-0.2, -0.25], smooth)),
        ("off axis", cloud(60, [6e-3, -5e-3], [3e-3, 3e-3], [0.1, 0.3], smooth)),
        ("through the panel", cloud(9, [0.4e-3, -0.3e-3], wide, [-1e-3, 1e-3], smooth)),
    ]
}

#[test]
fn direct_equals_the_oracle_on_every_instruction_set() {
    let grid = panel();
    for smooth in [false, true] {
        for (name, points) in clouds(smooth) {
            let exact = oracle(&points, &grid, WAVELENGTH, Cull::Soft).expect("oracle");
            for set in InstructionSet::available() {
                let got = field(&points, &grid, &settings(Method::Direct, 1e-3, set));
                let error = relative_error(&got.field.samples, &exact.samples);
                println!("{name} smooth={smooth} {}: {error:.2e}, bound {:.2e}", set.name(), got.report.error_bound);
                assert!(error < 1e-4, "{name} smooth={smooth} {}: {error:.2e}", set.name());
            }
        }
    }
}

#[test]
fn tiles_keep_the_error_that_they_state() {
    let grid = panel();
    for (name, points) in clouds(false) {
        let exact = oracle(&points, &grid, WAVELENGTH, Cull::Soft).expect("oracle");
        for (error, set) in [(1e-2, 0), (1e-3, 0), (1e-4, 0), (1e-3, 1)] {
            let sets = InstructionSet::available();
            let got = field(&points, &grid, &settings(Method::Tiles, error, sets[set.min(sets.len() - 1)]));
            let found = relative_error(&got.field.samples, &exact.samples);
            println!("{name} {error:.0e}: {found:.2e}, bound {:.2e}", got.report.error_bound);
            assert!(found < error && found < got.report.error_bound, "{name} {error:.0e}: {found:.2e}");
        }
    }
}

#[test]
fn wide_angles_are_exact() {
    let grid = Grid::new(161, 95, 1e-6, 1.25e-6).expect("grid").centered_at([1e-3, 0.4e-3]);
    let points = cloud(40, [0.2e-3, 0.0], [3e-3, 3e-3], [-5e-3, -10e-3], false);
    let exact = oracle(&points, &grid, WAVELENGTH, Cull::Soft).expect("oracle");
    for set in InstructionSet::available() {
        let got = field(&points, &grid, &settings(Method::Direct, 1e-3, set));
        let error = relative_error(&got.field.samples, &exact.samples);
        // Without the cross term of the far form: λ/|z| = 1.3e-4 at the nearest.
        println!("wide {}: {error:.2e}, bound {:.2e}", set.name(), got.report.error_bound);
        assert!(error < 1.5e-4, "{}: {error:.2e}", set.name());
    }
}

#[test]
fn hard_cut_and_bare_sphere_are_those_of_the_oracle() {
    let grid = panel();
    for cull in [Cull::Hard, Cull::None] {
        for z in [[-0.05, -0.2], [2e-3, 6e-3]] {
            let points = cloud(30, [0.4e-3, -0.3e-3], [3e-3, 3e-3], z, false);
            let exact = oracle(&points, &grid, WAVELENGTH, cull).expect("oracle");
            for set in InstructionSet::available() {
                let got = field(&points, &grid, &HologramSettings { cull, ..settings(Method::Direct, 1e-3, set) });
                let error = relative_error(&got.field.samples, &exact.samples);
                println!("{cull:?} {z:?} {}: {error:.2e}", set.name());
                assert!(error < 1e-4, "{cull:?} {z:?} {}: {error:.2e}", set.name());
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let grid = panel();
    let points: Vec<_> = clouds(false).into_iter().flat_map(|(_, points)| points).collect();
    let run = |threads: usize, method: Method| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        pool.install(|| field(&points, &grid, &settings(method, 1e-3, InstructionSet::detect())).field)
    };
    for method in [Method::Direct, Method::Tiles] {
        assert_eq!(run(1, method), run(3, method), "{method:?}");
    }
}

#[test]
fn a_job_stops_when_asked_and_bad_input_is_refused() {
    let grid = Grid::new(1920, 1080, 8e-6, 8e-6).expect("grid");
    let points = cloud(20_000, [0.0; 2], [0.01; 2], [-0.2, -0.25], false);
    let plan_of = |settings: &HologramSettings| plan(&points, &grid, WAVELENGTH, settings);
    let whole = plan_of(&settings(Method::Direct, 1e-3, InstructionSet::detect())).expect("plan");
    let progress = Progress::new();
    let late = std::thread::scope(|scope| {
        let job = scope.spawn(|| {
            let result = compute(&points, &grid, WAVELENGTH, &whole, &progress);
            (result.map(|_| ()), Instant::now())
        });
        std::thread::sleep(std::time::Duration::from_millis(150));
        let asked = Instant::now();
        progress.stop();
        let (result, ended) = job.join().expect("thread");
        assert!(matches!(result, Err(Error::Interrupted)));
        ended.duration_since(asked).as_secs_f64()
    });
    // 50 ms is the promise; ten times that is left for a machine that is busy with other tests.
    assert!(late < 0.5, "stopped after {late} s");
    for error in [0.0, 1.0, f64::NAN, -1e-3] {
        assert!(plan_of(&HologramSettings { error, ..HologramSettings::default() }).is_err());
    }
    let tight = HologramSettings { memory: 1000, ..HologramSettings::default() };
    assert!(matches!(plan_of(&tight), Err(Error::Memory { .. })));
    assert!(plan(&points, &grid, -1.0, &HologramSettings::default()).is_err());
}
