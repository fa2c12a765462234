//! Time, rate and error of the hologram engines; every figure against the f64 oracle at the full number of points.
//!
//! `cargo bench --bench hologram -- [case…]`, cases: `main` (161,056 points → 1920 × 1080, 8 µm, 632.8 nm,
//! z −0.20 … −0.25 m, every engine against 20,000 exact pixels, random and smooth phase; the default), `random` or `smooth` (one of
//! them), `quick` (both against 500), `tiles` (that engine alone, on every wide instruction set), `million`,
//! `uhd` (3840 × 2160, 3.74 µm, z −0.10 … −0.15 m), `growth` (against points and pixels, beside the cost model),
//! `planner` (its choice against the best engine), `sets` (instruction sets), `gpu`.

use glam::DVec3;
use holodrive::field::{Complex32, Complex64, Grid, relative_error};
use holodrive::hologram::{Cull, HologramSettings, InstructionSet, Method, compute, gpu_adapter, oracle_at, plan};
use holodrive::names::Named;
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

/// What a run took.
struct Taken {
    median: f64,
    predicted: f64,
}

fn run(
    label: &str,
    points: &[PointSource],
    grid: &Grid,
    settings: &HologramSettings,
    references: &[&Reference],
    repeats: usize,
) -> Option<Taken> {
    let plan = match plan(points, grid, WAVELENGTH, settings) {
        Ok(plan) => plan,
        Err(why) => {
            println!("{label:<26} not run: {why}");
            return None;
        }
    };
    let mut times = Vec::new();
    let mut last = None;
    // Short runs are often disturbed: their median needs more of them.
    let repeats = if plan.seconds < 0.3 { 2 * repeats + 1 } else { repeats };
    for _ in 0..repeats {
        let cpu = cpu_seconds();
        let computed = compute(points, grid, WAVELENGTH, &plan, &Progress::new()).expect("field");
        times.push((computed.report.seconds, cpu_seconds() - cpu));
        last = Some(computed);
    }
    let computed = last?;
    times.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (wall, cpu) = times[times.len() / 2];
    let report = computed.report;
    let errors: Vec<String> =
        references.iter().map(|r| format!("{:.2e}", r.error(&computed.field.samples, grid))).collect();
    println!(
        "{label:<26} {:<8} {:<12} wall {wall:8.3} s (best {:.3}) cpu {cpu:8.2} s  {:8.2e} pairs/s  error {} (bound {:.2e})  {} MB  predicted {:.3} s | {}",
        report.method.name(),
        report.instruction_set.name(),
        times[0].0,
        report.coverage.pairs / wall,
        if errors.is_empty() { "-".into() } else { errors.join(", ") },
        report.error_bound,
        report.memory >> 20,
        report.predicted_seconds,
        report.reason,
    );
    Some(Taken { median: wall, predicted: report.predicted_seconds })
}

fn settings(method: Option<Method>, error: f64) -> HologramSettings {
    HologramSettings { error, method, memory: 8 << 30, ..HologramSettings::default() }
}

fn hd() -> Grid {
    Grid::new(1920, 1080, 8e-6, 8e-6).expect("grid")
}

fn uhd() -> Grid {
    Grid::new(3840, 2160, 3.74e-6, 3.74e-6).expect("grid")
}

fn main_case(pixels: usize, phases: &[bool]) {
    let grid = hd();
    for &smooth in phases {
        let label = if smooth { "main, smooth phase" } else { "main, random phase" };
        let points = cloud(161_056, &grid, [-0.25, -0.20], smooth);
        let reference = Reference::new(&points, &grid, pixels);
        let all = [&reference];
        for error in [5e-3, 1.5e-3, 1.2e-3, 1e-3, 5e-4] {
            run(label, &points, &grid, &settings(Some(Method::Planes), error), &all, 5);
        }
        for error in [5e-3, 2e-3] {
            run(label, &points, &grid, &settings(Some(Method::Tiles), error), &all, 1);
        }
        run(label, &points, &grid, &settings(Some(Method::Direct), 1e-3), &all, 1);
    }
}

/// The tile engine with 16-bit and with f32 products, where the machine has both.
fn tiles() {
    let grid = hd();
    for smooth in [false, true] {
        let label = if smooth { "tiles, smooth phase" } else { "tiles, random phase" };
        let points = cloud(161_056, &grid, [-0.25, -0.20], smooth);
        let reference = Reference::new(&points, &grid, 1_000);
        let sets = InstructionSet::available();
        for set in sets.into_iter().filter(|set| *set != InstructionSet::Portable && *set != InstructionSet::Avx2) {
            for error in [5e-3, 2e-3, 1e-3] {
                let settings = HologramSettings { instruction_set: Some(set), ..settings(Some(Method::Tiles), error) };
                run(label, &points, &grid, &settings, &[&reference], 1);
            }
        }
    }
}

fn large_cases(million: bool, high: bool) {
    if million {
        let points = cloud(1_000_000, &hd(), [-0.25, -0.20], false);
        let reference = Reference::new(&points, &hd(), 200);
        for error in [8e-3, 6e-3, 1e-3] {
            run("million", &points, &hd(), &settings(Some(Method::Planes), error), &[&reference], 3);
        }
    }
    if high {
        let points = cloud(161_056, &uhd(), [-0.15, -0.10], false);
        let reference = Reference::new(&points, &uhd(), 500);
        for error in [1.3e-2, 1.1e-2, 1.5e-3, 1e-3] {
            run("uhd", &points, &uhd(), &settings(Some(Method::Planes), error), &[&reference], 3);
        }
    }
}

/// Time against points and against pixels, beside what the cost model says.
fn growth() {
    for (method, counts) in [
        (Method::Planes, &[1_000, 10_000, 100_000, 1_000_000][..]),
        (Method::Tiles, &[100, 1_000, 10_000][..]),
        (Method::Direct, &[100, 1_000, 10_000][..]),
    ] {
        for &n in counts {
            let points = cloud(n, &hd(), [-0.25, -0.20], false);
            if let Some(taken) = run(&format!("{n} points"), &points, &hd(), &settings(Some(method), 2e-3), &[], 3) {
                println!("    model {:.2} of measured", taken.predicted / taken.median);
            }
        }
        for (width, height) in [(960, 540), (1920, 1080), (3840, 2160), (7680, 4320)] {
            let grid = Grid::new(width, height, 8e-6, 8e-6).expect("grid");
            let n = if method == Method::Planes { 100_000 } else { 500 };
            let points = cloud(n, &grid, [-0.25, -0.20], false);
            let label = format!("{:.1} Mpx, {n} points", grid.len() as f64 * 1e-6);
            if let Some(taken) = run(&label, &points, &grid, &settings(Some(method), 2e-3), &[], 5) {
                println!("    model {:.2} of measured", taken.predicted / taken.median);
            }
        }
    }
}

/// The planner's choice against every engine that its model takes for quick enough to try.
fn planner() {
    let mut worst = 1.0f64;
    for (name, grid, z) in [
        ("qhd 8 um", Grid::new(960, 540, 8e-6, 8e-6).expect("grid"), [-0.25, -0.20]),
        ("hd 8 um", hd(), [-0.25, -0.20]),
        ("hd 8 um, near", hd(), [-0.06, 0.05]),
        ("uhd 3.74 um", uhd(), [-0.15, -0.10]),
    ] {
        for n in [30, 300, 3_000, 30_000, 200_000] {
            for error in [1e-2, 1e-3, 2e-4] {
                let points = cloud(n, &grid, z, false);
                let label = format!("{name}, {n}, {error:.0e}");
                let mut times = Vec::new();
                for method in [Method::Direct, Method::Tiles, Method::Planes] {
                    let chosen = settings(Some(method), error);
                    let quick =
                        plan(&points, &grid, WAVELENGTH, &chosen).is_ok_and(|p| p.seconds < 4.0 && p.error <= error);
                    if !quick {
                        continue;
                    }
                    let taken = run(&label, &points, &grid, &chosen, &[], 3);
                    times.extend(taken.map(|t| (t.median, method)));
                }
                let Ok(choice) = plan(&points, &grid, WAVELENGTH, &settings(None, error)) else { continue };
                let best = times.iter().map(|t| t.0).fold(f64::INFINITY, f64::min);
                if let Some((time, _)) = times.iter().find(|t| t.1 == choice.method) {
                    println!("    chosen {}: {:.2} of the best", choice.method.name(), time / best);
                    worst = worst.max(time / best);
                }
            }
        }
    }
    println!("planner: at worst {worst:.2} of the best engine");
}

fn sets() {
    let points = cloud(5_000, &hd(), [-0.25, -0.20], false);
    let reference = Reference::new(&points, &hd(), 2_000);
    for set in InstructionSet::available() {
        for (method, error) in [(Method::Direct, 1e-3), (Method::Tiles, 2e-3), (Method::Planes, 2e-3)] {
            let settings = HologramSettings { instruction_set: Some(set), ..settings(Some(method), error) };
            run("5,000 points", &points, &hd(), &settings, &[&reference], 3);
        }
    }
}

/// On the adapter that is there; a software one gets few points.
fn gpu() {
    let name = match gpu_adapter() {
        Ok(name) => name,
        Err(why) => return println!("gpu not run: {why}"),
    };
    let n = if name.contains("llvmpipe") { 1_000 } else { 161_056 };
    let points = cloud(n, &hd(), [-0.25, -0.20], false);
    let reference = Reference::new(&points, &hd(), 500);
    for error in [2e-3, 2e-4] {
        run(&format!("{name}, {n} points"), &points, &hd(), &settings(Some(Method::Gpu), error), &[&reference], 3);
    }
    for error in [5e-3, 1e-3, 5e-4] {
        let settings = settings(Some(Method::GpuPlanes), error);
        run(&format!("{name}, {n} points"), &points, &hd(), &settings, &[&reference], 5);
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
    for (name, pixels, phases) in [
        ("main", 20_000, &[false, true][..]),
        ("random", 20_000, &[false]),
        ("smooth", 20_000, &[true]),
        ("quick", 500, &[false, true]),
    ] {
        if has(name) {
            main_case(pixels, phases);
        }
    }
    large_cases(has("million"), has("uhd"));
    let others: [(&str, fn()); 5] =
        [("tiles", tiles), ("growth", growth), ("planner", planner), ("sets", sets), ("gpu", gpu)];
    others.iter().filter(|(name, _)| has(name)).for_each(|(_, case)| case());
}
