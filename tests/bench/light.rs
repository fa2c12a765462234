//! Light: rates of rays beside those of the BVH library alone, and how radiosity's time grows with the scene.
//!
//! `cargo bench --bench light`. Ratios within one run are what counts; times depend on the machine and on what else runs.

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DVec3, Vec2, Vec3};
use holodrive::illumination::{Illumination, IlluminationSettings};
use holodrive::progress::Progress;
use holodrive::random::Random;
use holodrive::scene::{Material, Ray, Scene, SceneBvh, Sides, Triangle};
use obvhs::{BvhBuildParams, cwbvh::CwBvh, cwbvh::builder::build_cwbvh_from_tris, ray, rt_triangle::RtTriangle};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A closed room of 1 m whose six faces are grids of `side`² squares, its floor wavy, with a lamp under the ceiling: as
/// many triangles as wanted, of about one size, that meet edge to edge.
fn room(side: u32) -> Scene {
    let mut scene = Scene {
        materials: vec![Material::diffuse(Vec3::splat(0.6)), Material::emitter(Vec3::splat(10.0))],
        ..Scene::default()
    };
    let mut add = |corners: [DVec3; 3], material: u32| {
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero().as_vec3();
        scene.triangles.push(Triangle {
            positions: corners.map(|p| p.as_vec3()),
            normals: [normal; 3],
            texcoords: [[Vec2::ZERO; 2]; 3],
            colors: [Vec3::ONE; 3],
            material,
            instance: 0,
        });
    };
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let low = DVec3::new(-0.5, 0.0, -0.5);
    // Faces look along u × v, inwards. The waves end at the walls.
    for (number, (corner, u, v)) in
        [(low, z, x), (low + y, x, z), (low, y, z), (low + x, z, y), (low, x, y), (low + z, y, x)]
            .into_iter()
            .enumerate()
    {
        let at = |i: u32, j: u32| {
            let (s, t) = (f64::from(i) / f64::from(side), f64::from(j) / f64::from(side));
            let wave = 0.05 * ((9.0 * t).sin() * (7.0 * s).cos() + (23.0 * t + 5.0 * s).sin() * 0.3);
            let height = if number == 0 { 16.0 * s * (1.0 - s) * t * (1.0 - t) * wave } else { 0.0 };
            corner + u * s + v * t + y * height
        };
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            add([at(i, j), at(i + 1, j), at(i + 1, j + 1)], 0);
            add([at(i, j), at(i + 1, j + 1), at(i, j + 1)], 0);
        }
    }
    let lamp = DVec3::new(-0.1, 0.995, -0.1);
    add([lamp, lamp + x * 0.2, lamp + (x + z) * 0.2], 1);
    add([lamp, lamp + (x + z) * 0.2, lamp + z * 0.2], 1);
    scene
}

/// Best of three runs [s].
fn best(mut run: impl FnMut()) -> f64 {
    (0..3)
        .map(|_| {
            let begin = Instant::now();
            run();
            begin.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

/// The library's tree of triangles that are moved by up to a hundredth of a millimetre, so that no two boxes are alike:
/// on regular grids it is ten times slower otherwise.
fn library_tree(scene: &Scene) -> (CwBvh, Vec<RtTriangle>) {
    let mut random = Random::new(3, 3);
    let triangles: Vec<obvhs::triangle::Triangle> = scene
        .triangles
        .iter()
        .map(|t| {
            let shift = DVec3::new(random.uniform(), random.uniform(), random.uniform()) * 1e-5;
            let [v0, v1, v2] = t.positions.map(|p| (p.to_vec3a() + shift.as_vec3a()) * 1024.0);
            obvhs::triangle::Triangle { v0, v1, v2 }
        })
        .collect();
    let tree = build_cwbvh_from_tris(&triangles, BvhBuildParams::medium_build(), &mut Duration::default());
    let leaves = tree.primitive_indices.iter().map(|&i| RtTriangle::from(&triangles[i as usize])).collect();
    (tree, leaves)
}

/// Primary and shadow rays: the library's tree with its own triangle test, and ours, side by side.
fn rays(_: &mut Criterion) {
    let scene = room(153);
    let bvh = SceneBvh::new(scene.clone());
    let (tree, leaves) = library_tree(&scene);
    let side = 1000u32;
    let eye = DVec3::new(0.02, 0.55, 0.45);
    let primary: Vec<Ray> = (0..side * side)
        .map(|i| {
            let (x, y) = (f64::from(i % side) / f64::from(side) - 0.5, f64::from(i / side) / f64::from(side) - 0.5);
            Ray { origin: eye, direction: DVec3::new(x, -0.6 - y * 0.8, -0.9).normalize() }
        })
        .collect();
    let mut random = Random::new(1, 1);
    let shadow: Vec<(DVec3, DVec3)> = primary
        .iter()
        .filter_map(|ray| bvh.nearest(ray, 0.0, Sides::Front))
        .map(|hit| {
            let lamp = DVec3::new(0.2 * random.uniform() - 0.1, 0.994, 0.2 * random.uniform() - 0.1);
            (hit.position + DVec3::Y * 1e-4, lamp)
        })
        .collect();
    let cast = |origin: DVec3, direction: DVec3, length: f64| {
        let (origin, direction) = ((origin * 1024.0).as_vec3a(), direction.as_vec3a());
        ray::Ray::new(origin, direction, 0.0, (length * 1024.0) as f32)
    };
    let millions = |seconds: f64, count: usize| count as f64 / seconds * 1e-6;
    println!("{} triangles, {} threads", scene.triangles.len(), rayon::current_num_threads());
    let library = best(|| {
        let hits = primary.par_iter().filter(|r| {
            let mut hit = ray::RayHit::none();
            tree.ray_traverse(cast(r.origin, r.direction, 1e9), &mut hit, |r, id| leaves[id].intersect(r))
        });
        assert!(hits.count() > primary.len() / 2);
    });
    let ours = best(|| {
        let hits = primary.par_iter().filter(|r| bvh.meet(r, 0.0, f64::INFINITY, Sides::Front).is_some());
        assert!(hits.count() > primary.len() / 2);
    });
    let (a, b) = (millions(library, primary.len()), millions(ours, primary.len()));
    println!("primary rays: library {a:.2} M/s, ours {b:.2} M/s, ratio {:.2}", b / a);
    let library = best(|| {
        let clear = shadow.par_iter().filter(|(from, to)| {
            let span = *to - *from;
            let ray = cast(*from, span.normalize(), span.length());
            tree.ray_traverse_miss(ray, |r, id| leaves[id].intersect(r))
        });
        assert!(clear.count() > 0);
    });
    let ours = best(|| assert!(shadow.par_iter().filter(|(from, to)| !bvh.occluded(*from, *to)).count() > 0));
    let (a, b) = (millions(library, shadow.len()), millions(ours, shadow.len()));
    println!("shadow rays:  library {a:.2} M/s, ours {b:.2} M/s, ratio {:.2}", b / a);
}

/// Radiosity of scenes whose triangles double, from a thousand to a hundred thousand.
fn growth(_: &mut Criterion) {
    let (mut before, mut worst) = (None, 0.0f64);
    for side in [9u32, 13, 18, 26, 36, 52, 73, 91] {
        let scene = room(side);
        let bvh = Arc::new(SceneBvh::new(scene.clone()));
        // Patches are the triangles themselves: nothing is refined, so that both double.
        let settings = IlluminationSettings {
            longest_element: 1.0,
            shortest_element: 1.0,
            most_vertices: 400_000,
            ..IlluminationSettings::default()
        };
        let (mut patches, mut imbalance) = (0, 0.0);
        let seconds = best(|| {
            let light = Illumination::new(bvh.clone(), settings, &Progress::new()).expect("light");
            patches = light.report().patches;
            imbalance = light.report().energy.imbalance();
        });
        let triangles = scene.triangles.len();
        let growth = before.map(|(t, s): (usize, f64)| {
            // Times for an exact doubling, from the power law between two neighbours.
            ((seconds / s).ln() / (triangles as f64 / t as f64).ln()).exp2()
        });
        worst = worst.max(growth.unwrap_or(0.0));
        let growth = growth.map_or(String::new(), |g| format!(", × {g:.2} for twice the triangles"));
        let percent = 100.0 * imbalance;
        println!("{triangles:>7} triangles, {patches:>7} patches: {seconds:.2} s, energy {percent:+.2} %{growth}");
        before = Some((triangles, seconds));
    }
    println!("worst growth for twice the triangles: {worst:.2}");
}

criterion_group!(benches, rays, growth);
criterion_main!(benches);
