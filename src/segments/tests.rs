//! Segments that see truly, neighbours that agree, views on a panel against points.

use super::*;
use crate::field::{Field, Grid};
use crate::hologram::{self, HologramSettings};
use crate::illumination::test_rooms::Room;
use crate::illumination::{Illumination, IlluminationSettings};
use crate::points::placement::Phase;
use crate::points::trace::{TraceSettings, trace};
use crate::points::{self, Channel, Placement, PointSource};
use crate::progress::Progress;
use crate::reconstruction::metrics::blocks;
use crate::reconstruction::{View, ViewSettings, picture};
use crate::scene::{Camera, Material, SceneBvh, gltf};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;
use std::path::Path;

/// A scene: a lamp that fills the view of the plate, 2 mm behind it, and before its middle a black strip.
fn strip() -> Room {
    let mut room = Room::default();
    let lamp = room.material(Material::emitter(Vec3::ONE));
    let black = room.material(Material { double_sided: true, ..Material::diffuse(Vec3::ZERO) });
    room.quad(DVec3::new(-1.0, -1.0, -0.5), DVec3::X * 2.0, DVec3::Y * 2.0, lamp);
    room.quad(DVec3::new(-0.1, -1.0, 0.5), DVec3::X * 0.2, DVec3::Y * 2.0, black);
    room
}

#[test]
fn segments_see_truly_and_neighbours_send_the_same_points() {
    let room = strip();
    let bvh = SceneBvh::new(room.scene);
    let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).expect("light");
    let camera = Camera::looking_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 0.7);
    let grid = Grid::new(640, 384, 1e-6, 1.25e-6).expect("grid");
    // A millimetre a metre: the lamp is 2 mm wide at z = −2.5 mm, the strip stands at z = −1.5 mm.
    let view = Viewing { viewer: 20e-3, place: -2e-3, scale: Some(1e-3), ..Viewing::default() };
    // Half of the band along x, as beside a carrier.
    let band = ObjectBand::of(&grid, [2, 1], 633e-9);
    let plane = Segments { view, band, ..Segments::of_panel(grid, 633e-9, 64).expect("segments") };
    let scene = PlacedScene::new(light, &camera, &plane, None, 8, &Progress::new()).expect("scene");
    assert!((scene.depths[0] + 2.5e-3).abs() < 1e-9 && (scene.depths[1] + 1.5e-3).abs() < 1e-9);
    let see = |segment: [i64; 2]| scene.points(&plane, segment, &Progress::new()).expect("points");
    let (left, right, far) = (see([3, 2]), see([4, 2]), see([6, 2]));
    // What one segment sends, the next sends from the same places in the same phases.
    let key = |p: &PointSource| p.position.to_array().map(f64::to_bits);
    let shared = |a: &[PointSource], b: &[PointSource]| {
        let known: BTreeMap<_, u64> = b.iter().map(|p| (key(p), p.phase.to_bits())).collect();
        a.iter().filter(|p| known.get(&key(p)) == Some(&p.phase.to_bits())).count() as f64 / a.len() as f64
    };
    assert!(shared(&left, &right) > 0.75, "{} of {} are shared", shared(&left, &right), left.len());
    // The strip hides the lamp between x′ and x″: seen from (x, 0) through ±0.1 mm at 1.5 mm, on 2.5 mm.
    for (segment, points) in [([3, 2], &left), ([6, 2], &far)] {
        let [x, _] = plane.center(segment);
        let shadow = |edge: f64| x + (edge - x) / 1.5 * 2.5;
        let (low, high) = (shadow(-0.1e-3), shadow(0.1e-3));
        // A segment's rays differ by its own width, a cell by its own.
        let rim = 64e-6 + 6e-6;
        let hidden =
            points.iter().filter(|p| p.position.z < -2.4e-3 && p.position.x > low + rim && p.position.x < high - rim);
        assert_eq!(hidden.count(), 0, "{segment:?}: light from behind the strip, {low} to {high}");
        let beside = |from: f64| points.iter().filter(|p| p.position.x > from && p.position.x < from + 50e-6).count();
        assert!(beside(low - 50e-6 - rim) > 100 && beside(high + rim) > 100, "{segment:?}");
    }
    // Irradiance of what is seen, Σ a²/r², is that of a lamp of radiance 1: its solid angle less the strip's.
    let sum: f64 = far
        .iter()
        .map(|p| {
            let [x, y] = plane.center([6, 2]);
            f64::from(p.amplitude).powi(2) / (p.position - DVec3::new(x, y, 0.0)).length_squared()
        })
        .sum();
    let [x, _] = plane.center([6, 2]);
    let solid = |z: f64, x: [f64; 2], y: [f64; 2]| {
        let corner = |x: f64, y: f64| (x * y / (z * (x * x + y * y + z * z).sqrt())).atan();
        corner(x[1], y[1]) - corner(x[0], y[1]) - corner(x[1], y[0]) + corner(x[0], y[0])
    };
    // The pyramid: apex δ/tan θ beyond, ±θ; lamp to ±1 mm.
    let tangent = band.angle.map(f64::tan);
    let half = [0.5 * 64e-6, 0.5 * 80e-6];
    let beyond = (half[0] / tangent[0]).min(half[1] / tangent[1]);
    let (wide, tall) = (tangent[0].max(half[0] / beyond), tangent[1].max(half[1] / beyond));
    let reach = |z: f64, t: f64| (z + beyond) * t;
    let seen = [(x - reach(2.5e-3, wide)).max(-1e-3) - x, (x + reach(2.5e-3, wide)).min(1e-3) - x];
    let expected = solid(2.5e-3 + beyond, seen, [-reach(2.5e-3, tall), reach(2.5e-3, tall)]);
    let near = [-0.1e-3 - x, 0.1e-3 - x].map(|v| v.clamp(-reach(1.5e-3, wide), reach(1.5e-3, wide)));
    let hidden = solid(1.5e-3 + beyond, near, [-reach(1.5e-3, tall), reach(1.5e-3, tall)]);
    let ratio = sum / (expected - hidden) / ((2.5e-3 + beyond) / 2.5e-3f64).powi(2);
    assert!((ratio - 1.0).abs() < 0.05, "{sum} is {ratio} of {expected} less {hidden}");
}

/// Likeness of two pictures' shapes, −1 to 1.
fn correlation(a: &[f32], b: &[f32]) -> f64 {
    let mean = |v: &[f32]| v.iter().map(|x| f64::from(*x)).sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let product = |a: &[f32], ma: f64, b: &[f32], mb: f64| -> f64 {
        a.iter().zip(b).map(|(x, y)| (f64::from(*x) - ma) * (f64::from(*y) - mb)).sum()
    };
    product(a, ma, b, mb) / (product(a, ma, a, ma) * product(b, mb, b, mb)).sqrt()
}

#[test]
fn views_on_a_panel_show_the_model_that_points_show_and_do_not_change_with_the_segments() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.gltf");
    let grid = Grid::new(600, 400, 8e-6, 8e-6).expect("grid");
    let progress = Progress::new();
    let view = Viewing { viewer: 0.1, place: -0.06, ..Viewing::default() };
    let plane = |segment| Ok(Segments { view, ..Segments::of_panel(grid, 633e-9, segment)? });
    let seen = |segment| {
        let plane: Segments = plane(segment)?;
        let object = Object::read(&scene, &SceneOptions::default(), &plane, &progress)?;
        ObjectWave::new(plane, object).whole(&progress)
    };
    let (coarse, fine) = (seen(200).expect("field"), seen(50).expect("field"));
    assert!(coarse.work.segments == 6 && fine.work.segments == 96, "{:?} {:?}", coarse.work, fine.work);
    // The same model as points, seen by one eye.
    let loaded = gltf::load(&scene, &gltf::LoadOptions::default()).expect("scene");
    let light = Illumination::new(SceneBvh::new(loaded.scene.clone()), IlluminationSettings::default(), &progress);
    let light = light.expect("light");
    let model = Placement::Model { eye: 0.1, z: -0.06, scale: None };
    let placing = model.prepare(&loaded.scene, &loaded.scene.cameras[0], 1.5, &grid).expect("placing");
    let rays = TraceSettings { width: 300, height: 200, ..TraceSettings::default() };
    let traced = trace(&light, &placing.camera, &rays, &progress).expect("points");
    let placed = points::place(&traced.world_points(), &placing, Phase::Random { seed: 1 }, &grid, 633e-9);
    let cloud = placed.cloud.channel(Channel::Luminance);
    let plan = hologram::plan(&cloud, &grid, 633e-9, &HologramSettings::default()).expect("plan");
    let plain = hologram::compute(&cloud, &grid, 633e-9, &plan, &progress).expect("field");
    // On the plane of the scene's middle, as large as the panel shows it; speckle is averaged over blocks.
    let half = glam::DVec2::new(3.6e-3, 2.4e-3);
    let look = |field: &Field| {
        let view = View::Plane { z: -0.06 };
        let seen = picture(field, &view, half, (240, 160), &ViewSettings::default(), &progress).expect("picture");
        blocks(&seen, 8)
    };
    let (a, b, c) = (look(&coarse.field), look(&fine.field), look(&plain.field));
    let mirrored: Vec<f32> = c.values.chunks_exact(c.width).flat_map(|row| row.iter().rev().copied()).collect();
    let flipped: Vec<f32> = c.values.chunks_exact(c.width).rev().flatten().copied().collect();
    for (name, seen) in [("coarse", &a), ("fine", &b)] {
        let like = correlation(&seen.values, &c.values);
        let wrong = correlation(&seen.values, &mirrored).max(correlation(&seen.values, &flipped));
        assert!(like > 0.85 && like > wrong + 0.1, "{name}: {like}, mirrored or flipped {wrong}");
    }
    // The same cells, the same points and phases: speckle itself is alike.
    let grains = correlation(
        &coarse.field.samples.iter().map(|u| u.re).collect::<Vec<_>>(),
        &fine.field.samples.iter().map(|u| u.re).collect::<Vec<_>>(),
    );
    assert!(grains > 0.8, "{grains}");
    assert!(plane(10).unwrap_err().to_string().contains("must be 16 to 400"));
}
