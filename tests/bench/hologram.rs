//! Time, rate and error of the hologram engines; every figure against the f64 oracle at the full number of points.
//!
//! `cargo bench --bench hologram --no-default-features -- [case…]`, cases: `main` (161,056 points → 1920 × 1080, 8 µm,
//! 632.8 nm, z −0.20 … −0.25 m; the default), `million`, `uhd` (3840 × 2160, 3.74 µm, z −0.10 … −0.15 m), `growth`.

use glam::DVec3;
use holodrive::field::{Complex32, Complex64, Grid, relative_error};
use holodrive::hologram::{Cull, HologramSettings, InstructionSet, Method, compute, oracle_at, plan};
use holodrive::points::PointSource;
use holodrive::progress::Progress;
use holodrive::random::Random;

const WAVELENGTH: f64 = 632.8e-9;

/// Processor time of this process so far [s], where the system tells it.
fn cpu_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let ticks = text.rsplit(')').next().map(|rest| rest.split_whitespace().skip(11).take(2).collect::<Vec<_>>());
    ticks.unwrap_or_default().iter().filter_map(|t| t.parse::<f64>().ok()).sum::<f64>() / 100.0
}

/// Uniform in 90 % of the panel's extent; random phases, or a smooth one.
fn cloud(n: usize, grid: &Grid, z: [f64; 2], smooth: bool) -> Vec<PointSource> {
    (0..n as u64)
        .map(|i| {
            let mut random = Random::new(3, i);
            let x = (random.uniform() - 0.5) * 0.9 * grid.extent_x();
            let y = (random.uniform() - 0.5) * 0.9 * grid.extent_y();
            let depth = z[0] + (z[1] - z[0]) * random.uniform();
            let amplitude = 0.25 + 0.75 * random.uniform_f32();
            let phase = if smooth { 2e5 * (x * x + 0.5 * y * y) } else { random.phase() };
            PointSource { position: DVec3::new(x, y, depth), amplitude, phase }
        })
        .collect()
}

/// Pixels spread at random, and the exact field there.
struct Reference {
    pixels: Vec<(usize, usize)>,
    field: Vec<Complex64>,
}

impl Reference {
    fn new(points: &[PointSource], grid: &Grid, count: usize) -> Self {
        let mut random = Random::new(5, 0);
        let pixels: Vec<_> = (0..count)
            .map(|_| {
                let column = (random.uniform() * grid.width as f64) as usize;
                (column, (random.uniform() * grid.height as f64) as usize)
            })
            .collect();
        let field = oracle_at(points, grid, WAVELENGTH, Cull::Soft, &pixels).expect("oracle");
        Self { pixels, field }
    }
    fn error(&self, samples: &[Complex32], grid: &Grid) -> f64 {
        let here: Vec<Complex32> = self.pixels.iter().map(|&(c, r)| samples[r * grid.width + c]).collect();
        relative_error(&here, &self.field)
    }
}

fn run(
    label: &str,
    points: &[PointSource],
    grid: &Grid,
    settings: &HologramSettings,
    reference: Option<&Reference>,
    repeats: usize,
) {
    let plan = plan(points, grid, WAVELENGTH, settings).expect("plan");
    let mut times = Vec::new();
    let mut last = None;
    for _ in 0..repeats {
        let cpu = cpu_seconds();
        let computed = compute(points, grid, WAVELENGTH, &plan, &Progress::new()).expect("field");
        times.push((computed.report.seconds, cpu_seconds() - cpu));
        last = Some(computed);
    }
    let Some(computed) = last else { return };
    times.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (wall, cpu) = times[times.len() / 2];
    let report = computed.report;
    let error = reference.map_or(f64::NAN, |r| r.error(&computed.field.samples, grid));
    println!(
        "{label:<26} {:<8} {:<8} wall {wall:8.3} s (best {:.3}) cpu {cpu:8.2} s  {:8.2e} pairs/s  error {error:.2e} (bound {:.2e})  {} MB  predicted {:.3} s | {}",
        report.method.name(),
        report.instruction_set.name(),
        times[0].0,
        report.coverage.pairs / wall,
        report.error_bound,
        report.memory >> 20,
        report.predicted_seconds,
        report.reason,
    );
}

fn settings(method: Option<Method>, error: f64) -> HologramSettings {
    HologramSettings { error, method, memory: 8 << 30, ..HologramSettings::default() }
}

fn main_case() {
    let grid = Grid::new(1920, 1080, 8e-6, 8e-6).expect("grid");
    for smooth in [false, true] {
        let label = if smooth { "main, smooth phase" } else { "main, random phase" };
        let points = cloud(161_056, &grid, [-0.25, -0.20], smooth);
        let reference = Reference::new(&points, &grid, 20_000);
        run(label, &points, &grid, &settings(Some(Method::Direct), 1e-3), Some(&reference), 1);
        run(label, &points, &grid, &settings(Some(Method::Tiles), 2e-3), Some(&reference), 1);
    }
}

fn main() {
    let cases: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let has = |name: &str| cases.iter().any(|c| c == name) || (cases.is_empty() && name == "main");
    println!(
        "{} threads, {}",
        std::thread::available_parallelism().map_or(0, |n| n.get()),
        InstructionSet::detect().name()
    );
    if has("main") {
        main_case();
    }
    if has("sets") {
        let grid = Grid::new(1920, 1080, 8e-6, 8e-6).expect("grid");
        let points = cloud(5_000, &grid, [-0.25, -0.20], false);
        let reference = Reference::new(&points, &grid, 2_000);
        for set in InstructionSet::available() {
            for (method, error) in [(Method::Direct, 1e-3), (Method::Tiles, 2e-3)] {
                let settings = HologramSettings { instruction_set: Some(set), ..settings(Some(method), error) };
                run("5,000 points", &points, &grid, &settings, Some(&reference), 3);
            }
        }
    }
}
