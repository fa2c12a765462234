//! Engines keep the memory that they state: the heap's peak while a field is computed, against the plan.

use glam::DVec3;
use holodrive::field::{Complex32, Grid};
use holodrive::hologram::layers::{self, Layer};
use holodrive::hologram::{HologramSettings, Method, compute, plan};
use holodrive::points::PointSource;
use holodrive::progress::Progress;
use holodrive::random::Random;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The system's allocator, counting.
struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

fn taken(size: usize) {
    let now = NOW.fetch_add(size, Ordering::Relaxed) + size;
    PEAK.fetch_max(now, Ordering::Relaxed);
}

// SAFETY: every call is handed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        taken(layout.size());
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        taken(layout.size());
        // SAFETY: the caller's promise.
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Tables of twiddle factors, lists of tasks, the report: what engines need that does not grow with the job [bytes].
const SMALL: usize = 8 << 20;

#[test]
fn every_engine_keeps_the_memory_that_it_states() {
    let grid = Grid::new(1537, 901, 8e-6, 7e-6).expect("grid");
    let far = |i: u64, z: f64| {
        let mut random = Random::new(2, i);
        let (x, y) = ((random.uniform() - 0.5) * 0.01, (random.uniform() - 0.5) * 5e-3);
        PointSource { position: DVec3::new(x, y, z * (1.0 + 0.2 * random.uniform())), amplitude: 1.0, phase: 0.0 }
    };
    let cloud: Vec<PointSource> = (0..100_000).map(|i| far(i, -0.2)).collect();
    let few: Vec<PointSource> = (0..200).map(|i| far(i, -0.2)).collect();
    let near: Vec<PointSource> = (0..300).map(|i| far(i, -4e-3)).collect();
    let through: Vec<PointSource> = (0..10_000).map(|i| far(i, if i % 2 == 0 { 0.03 } else { -0.02 })).collect();
    for (name, method, points) in [
        ("far", Method::Planes, &cloud),
        ("through the panel", Method::Planes, &through),
        ("near", Method::Planes, &near),
        ("few", Method::Tiles, &few),
        ("few", Method::Direct, &few),
        ("near", Method::Direct, &near),
        ("few", Method::Oracle, &few[..20].to_vec()),
        ("near", Method::Oracle, &near[..6].to_vec()),
    ] {
        let settings = HologramSettings { method: Some(method), memory: 8 << 30, ..HologramSettings::default() };
        let plan = plan(points, &grid, 632.8e-9, &settings).expect("plan");
        let before = NOW.load(Ordering::Relaxed);
        PEAK.store(before, Ordering::Relaxed);
        let computed = compute(points, &grid, 632.8e-9, &plan, &Progress::new()).expect("field");
        let beside = PEAK.load(Ordering::Relaxed) - before - 8 * computed.field.samples.len();
        let stated = plan.memory as usize;
        println!(
            "{name} {method:?}: {:.1} MB taken, {:.1} MB stated",
            beside as f64 / 1048576.0,
            stated as f64 / 1048576.0
        );
        assert!(beside <= stated + SMALL, "{name} {method:?}: {beside} over {stated}");
        assert!(stated <= 4 * beside + SMALL, "{name} {method:?}: states {stated}, takes {beside}");
    }
    // Layers that hide each other, on a lattice wider than the panel and on a smaller one.
    for (width, height) in [(1903, 1201), (803, 701)] {
        let lattice = Grid::new(width, height, 8e-6, 7e-6).expect("grid");
        let layer = |k: usize| {
            let opaque: Vec<bool> = (0..lattice.len()).map(|i| (i / 40 + 3 * k) % 5 < 2).collect();
            let light = opaque.iter().map(|&lit| Complex32::new(f32::from(u8::from(lit)), 0.0)).collect();
            Layer { z: -0.15 + 0.01 * k as f64, light, opaque }
        };
        let stack: Vec<Layer> = (0..4).map(layer).collect();
        let stated = layers::bytes(&lattice, &grid, 632.8e-9, stack.iter().map(|layer| layer.z)).expect("bytes");
        let before = NOW.load(Ordering::Relaxed);
        PEAK.store(before, Ordering::Relaxed);
        let field = layers::compute(&stack, &lattice, &grid, 632.8e-9, stated, &Progress::new()).expect("field");
        let beside = PEAK.load(Ordering::Relaxed) - before - 8 * field.samples.len();
        println!(
            "layers {width}×{height}: {:.1} MB taken, {:.1} MB stated",
            beside as f64 / 1048576.0,
            stated as f64 / 1048576.0
        );
        assert!(beside <= stated as usize + SMALL, "layers: {beside} over {stated}");
        assert!(stated as usize <= 4 * beside + SMALL, "layers: states {stated}, takes {beside}");
    }
}
