//! What eyes see by way of mirrors and glass: radiance against plain path tracing, depth against paraxial optics.

use super::eye::Eye;
use super::trace::{MirrorDepth, TraceSettings, trace};
use crate::illumination::test_oracle::Oracle;
use crate::illumination::test_rooms::{Room, glass};
use crate::illumination::{Illumination, IlluminationSettings};
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::{AlphaMode, Camera, Environment, LightKind, Material, PunctualLight, Scene, SceneBvh};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Means over squares of pixels by this crate and by plain paths, at a few places of a picture.
pub(crate) fn agrees(room: &Room, camera: &Camera, squares: &[[f64; 2]], paths: u32, tolerance: f64) {
    let bvh = SceneBvh::new(room.scene.clone());
    let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).unwrap();
    eprintln!("{:?}", light.report());
    let oracle = Oracle::new(light.bvh().clone());
    let settings = TraceSettings { width: 1000, height: 1000, ..TraceSettings::default() };
    let eye = Eye::new(&light, camera, &settings);
    let half = 0.012;
    for &[u, v] in squares {
        let n = 24;
        let place = |i: u32, random: &mut Random| {
            let x = u + half * (2.0 * (f64::from(i % n) + random.uniform()) / f64::from(n) - 1.0);
            let y = v + half * (2.0 * (f64::from(i / n % n) + random.uniform()) / f64::from(n) - 1.0);
            (1000.0 * x, 1000.0 * y)
        };
        let ours: Vec3 = (0..n * n)
            .map(|i| {
                let mut random = Random::new(1, u64::from(i));
                let (x, y) = place(i, &mut random);
                eye.look(x, y, n * n, &mut random).radiance
            })
            .sum::<Vec3>()
            / (n * n) as f32;
        let (sum, squared) = (0..paths)
            .into_par_iter()
            .map(|i| {
                let mut random = Random::new(2, u64::from(i) ^ u.to_bits() ^ v.to_bits());
                let found = f64::from(
                    {
                        let (x, y) = place(i, &mut random);
                        oracle.radiance(eye.ray(x, y), &mut random)
                    }
                    .element_sum(),
                );
                (found, found * found)
            })
            .reduce(|| (0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
        let mean = sum / f64::from(paths);
        let sigma = ((squared / f64::from(paths) - mean * mean) / f64::from(paths)).sqrt();
        let ratio = f64::from(ours.element_sum()) / mean;
        eprintln!("({u:.2}, {v:.2}): ratio {ratio:.4} ± {:.4}", sigma / mean);
        let most = tolerance + 4.0 * sigma / mean;
        assert!((ratio - 1.0).abs() < most, "at ({u}, {v}): {ours} for a sum of {mean} ± {sigma}");
    }
}

/// A white box with a lamp in the ceiling.
pub(crate) fn white_box(left: Material, right: Material) -> Room {
    let mut room = Room::default();
    let white = room.material(Material::diffuse(Vec3::splat(0.7)));
    let (left, right) = (room.material(left), room.material(right));
    let lamp = room.material(Material::emitter(Vec3::splat(10.0)));
    room.cuboid(DVec3::splat(-0.5), DVec3::splat(0.5), true, [left, right, white, white, white, white]);
    room.quad(DVec3::new(-0.2, 0.499, -0.2), DVec3::X * 0.4, DVec3::Z * 0.4, lamp);
    room
}

const SQUARES: [[f64; 2]; 5] = [[0.5, 0.8], [0.35, 0.75], [0.62, 0.85], [0.5, 0.3], [0.25, 0.5]];

#[test]
fn two_facing_mirrors_agree_with_plain_paths() {
    let mirror = Material::mirror(Vec3::new(0.9, 0.85, 0.8));
    let room = white_box(mirror.clone(), mirror);
    let camera = Camera::looking_at(DVec3::new(0.02, 0.03, 0.49), DVec3::new(0.0, 0.0, -0.5), 1.2);
    agrees(&room, &camera, &SQUARES[..4], 300_000, 5e-3);
}

#[test]
fn a_mirror_ball_a_glass_ball_and_a_block_agree_with_plain_paths() {
    let matte = Material::diffuse(Vec3::splat(0.7));
    let mut room = white_box(matte.clone(), matte);
    let silver = room.material(Material::mirror(Vec3::splat(0.9)));
    let glass = room.material(glass());
    let rough = room.material(Material { roughness: 0.3, ..Material::mirror(Vec3::splat(0.8)) });
    room.sphere(DVec3::new(-0.25, -0.3, -0.2), 0.15, false, 32, silver);
    room.sphere(DVec3::new(0.25, -0.3, -0.1), 0.15, false, 32, glass);
    room.cuboid(DVec3::new(-0.1, -0.5, 0.05), DVec3::new(0.1, -0.4, 0.2), false, [rough; 6]);
    let camera = Camera::looking_at(DVec3::new(0.02, 0.03, 0.49), DVec3::new(0.0, 0.0, -0.5), 1.2);
    // Floor, caustics, the mirror ball, the glass ball, the rough block's top and front, the ceiling.
    let squares = [
        [0.5, 0.72],
        [0.44, 0.93],
        [0.72, 0.97],
        [0.2, 0.85],
        [0.26, 0.72],
        [0.75, 0.85],
        [0.68, 0.78],
        [0.5, 0.86],
        [0.5, 0.95],
        [0.5, 0.3],
    ];
    agrees(&room, &camera, &squares, 400_000, 1e-2);
}

/// Bright above, dimmer below, coloured from side to side.
fn sky() -> Environment {
    let texel = |d: DVec3| Vec3::new(1.0 + 0.8 * d.y as f32, 1.0 + 0.5 * d.x as f32, 1.2 - 0.5 * d.z as f32);
    Environment::new(64, 32, Environment::directions(64, 32).map(texel).collect(), 0.0).unwrap()
}

#[test]
fn in_an_environment_matte_chrome_glass_and_gloss_agree_with_plain_paths() {
    let mut room = Room::default();
    let matte = room.material(Material::diffuse(Vec3::new(0.7, 0.6, 0.5)));
    let silver = room.material(Material::mirror(Vec3::splat(0.9)));
    let glass = room.material(glass());
    let rough = room.material(Material { roughness: 0.3, ..Material::mirror(Vec3::splat(0.8)) });
    room.quad(DVec3::new(-0.5, -0.5, 0.5), DVec3::X, DVec3::NEG_Z, matte);
    room.quad(DVec3::new(-0.5, -0.5, -0.5), DVec3::X, DVec3::Y * 0.6, matte);
    room.sphere(DVec3::new(-0.25, -0.3, -0.2), 0.15, false, 32, silver);
    room.sphere(DVec3::new(0.25, -0.3, -0.1), 0.15, false, 32, glass);
    room.cuboid(DVec3::new(-0.1, -0.5, 0.05), DVec3::new(0.1, -0.4, 0.2), false, [rough; 6]);
    room.scene.environment = Some(Arc::new(sky()));
    let camera = Camera::looking_at(DVec3::new(0.02, 0.03, 0.49), DVec3::new(0.0, 0.0, -0.5), 1.2);
    let squares = [
        [0.5, 0.72],
        [0.44, 0.93],
        [0.72, 0.97],
        [0.2, 0.85],
        [0.26, 0.72],
        [0.75, 0.85],
        [0.68, 0.78],
        [0.5, 0.86],
        [0.5, 0.55],
    ];
    // Light of the environment is linear between the vertices of the mesh: at the foot of a body that is some per cent off.
    agrees(&room, &camera, &squares, 300_000, 2e-2);
}

/// glTF's microfacet reflection of a metal times the cosine of incidence, written anew (appendix B of its specification).
fn microfacets(view: DVec3, light: DVec3, alpha: f64, f0: f64) -> f64 {
    let half = (view + light).normalize();
    let masking = |cos: f64| 2.0 * cos / (cos + (alpha * alpha + (1.0 - alpha * alpha) * cos * cos).sqrt());
    let d = alpha * alpha / (std::f64::consts::PI * ((alpha * alpha - 1.0) * half.z * half.z + 1.0).powi(2));
    let fresnel = f0 + (1.0 - f0) * (1.0 - half.dot(view)).powi(5);
    fresnel * d * masking(view.z) * masking(light.z) / (4.0 * view.z)
}

#[test]
fn rough_metal_shows_all_of_its_lobe_and_the_glint_of_a_light_without_size() {
    let f0 = 0.8;
    let view = DVec3::new(0.6, 0.0, 0.8);
    let towards = DVec3::new(-0.3, 0.4, 0.75f64.sqrt());
    for roughness in [0.3f32, 0.6, 0.9] {
        let alpha = f64::from(roughness * roughness);
        let mut room = Room::default();
        let metal = room.material(Material { roughness, ..Material::mirror(Vec3::splat(f0 as f32)) });
        room.quad(DVec3::new(-9.0, -9.0, 0.0), DVec3::X * 18.0, DVec3::Y * 18.0, metal);
        let seen = |scene: &Scene| {
            let bvh = SceneBvh::new(scene.clone());
            let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).unwrap();
            let settings = TraceSettings { width: 10, height: 10, ..TraceSettings::default() };
            let camera = Camera::looking_at(view * 3.0, DVec3::ZERO, 0.01);
            let eye = Eye::new(&light, &camera, &settings);
            let look = |i: u64| f64::from(eye.look(5.0, 5.0, 1, &mut Random::new(5, i)).radiance.x);
            (0..20_000).into_par_iter().map(look).sum::<f64>() / 20_000.0
        };
        // Under an even sky: the integral over the lobe, by midpoints in cosine and azimuth.
        let n = 1200;
        let mut whole = 0.0;
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let cos = (f64::from(i) + 0.5) / f64::from(n);
            let (s, c) = (std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(n)).sin_cos();
            let sin = (1.0 - cos * cos).sqrt();
            whole += microfacets(view, DVec3::new(sin * c, sin * s, cos), alpha, f0);
        }
        whole *= std::f64::consts::TAU / f64::from(n * n);
        let mut under_sky = room.scene.clone();
        under_sky.environment = Some(Arc::new(Environment::new(8, 4, vec![Vec3::ONE; 32], 0.0).unwrap()));
        let found = seen(&under_sky);
        assert!((found / whole - 1.0).abs() < 6e-3, "roughness {roughness}: {found}, not {whole}");
        // In the light of a sun of 2 W/m² no ray of the lobe meets it.
        room.scene.lights.push(PunctualLight {
            kind: LightKind::Directional,
            position: Vec3::ZERO,
            direction: -towards.as_vec3(),
            intensity: Vec3::splat(2.0),
            range: f32::INFINITY,
            measured: None,
        });
        let (found, glint) = (seen(&room.scene), 2.0 * microfacets(view, towards, alpha, f0));
        assert!((found / glint - 1.0).abs() < 1e-3, "roughness {roughness}: {found}, not {glint}");
        // Lamps, small and large, behind a veil that covers nothing: the integral over their surface.
        room.scene.lights.clear();
        let (u, v) = towards.any_orthonormal_pair();
        let (u, v) = if u.cross(v).dot(towards) < 0.0 { (u, v) } else { (v, u) };
        for size in [0.05, 0.8] {
            let mut room = room.clone();
            let lamp = room.material(Material::emitter(Vec3::splat(3.0)));
            let corner = towards * 1.5 - (u + v) * (0.5 * size);
            room.quad(corner, u * size, v * size, lamp);
            let clear = Material { alpha_mode: AlphaMode::Blend, alpha: 0.0, ..Material::diffuse(Vec3::ONE) };
            let veil = room.material(clear);
            room.quad(towards * 1.4 - (u + v), u * 2.0, v * 2.0, veil);
            let (n, mut whole) = (400, 0.0);
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let [a, b] = [i, j].map(|k| size * (f64::from(k) + 0.5) / f64::from(n));
                let span = corner + u * a + v * b;
                let solid = (size / f64::from(n)).powi(2) * towards.dot(span) / span.length().powi(3);
                whole += 3.0 * microfacets(view, span.normalize(), alpha, f0) * solid;
            }
            let found = seen(&room.scene);
            assert!((found / whole - 1.0).abs() < 1e-2, "roughness {roughness}, lamp of {size}: {found}, not {whole}");
        }
    }
}

#[test]
fn a_mirror_ball_shows_what_is_far_away_at_half_its_radius() {
    let mut room = Room::default();
    let silver = room.material(Material::mirror(Vec3::ONE));
    room.sphere(DVec3::new(0.0, 0.0, -1.1), 0.3, false, 64, silver);
    room.scene.environment = Some(Arc::new(sky()));
    let camera = Camera::looking_at(DVec3::ZERO, DVec3::NEG_Z, 0.3);
    let depth = depth_in_the_middle(&room.scene, &camera, MirrorDepth::Focus, 0);
    assert!((depth - 0.95).abs() < 5e-3, "{depth}");
}

/// Depth of the strongest point nearest to the picture's middle.
fn depth_in_the_middle(scene: &Scene, camera: &Camera, mirror_depth: MirrorDepth, offset: u32) -> f64 {
    let bvh = SceneBvh::new(scene.clone());
    let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).unwrap();
    let settings = TraceSettings { width: 101, height: 101, mirror_depth, ..TraceSettings::default() };
    let traced = trace(&light, camera, &settings, &Progress::new()).unwrap();
    let middle = 50 * 101 + 50 + offset;
    let seen: Vec<_> = traced.points.iter().filter(|p| p.pixel == middle).collect();
    seen.iter().max_by(|a, b| a.radiance[0].total_cmp(&b.radiance[0])).expect("a point in the middle").distance
}

#[test]
fn a_mirror_ball_shows_things_where_its_focus_says() {
    // A ball of radius R at distance s sees a glowing wall behind the eye at distance u from its vertex: the image
    // stands at 1/v = 1/u + 2/R behind the vertex. The path says s + u.
    let mut room = Room::default();
    let (radius, s, u) = (0.3, 0.8, 2.0);
    let silver = room.material(Material::mirror(Vec3::ONE));
    let glow = room.material(Material::emitter(Vec3::ONE));
    room.sphere(DVec3::new(0.0, 0.0, -s - radius), radius, false, 64, silver);
    room.quad(DVec3::new(-9.0, -9.0, u - s), DVec3::Y * 18.0, DVec3::X * 18.0, glow);
    let camera = Camera::looking_at(DVec3::ZERO, DVec3::NEG_Z, 0.3);
    let v = 1.0 / (1.0 / u + 2.0 / radius);
    for offset in [0, 1, 101] {
        let depth = depth_in_the_middle(&room.scene, &camera, MirrorDepth::Focus, offset);
        assert!((depth / (s + v) - 1.0).abs() < 0.01, "{depth}, not {}", s + v);
        let behind = (depth - s) / v;
        assert!((behind - 1.0).abs() < 0.02, "image {behind} of {v} behind the vertex");
    }
    let path = depth_in_the_middle(&room.scene, &camera, MirrorDepth::Path, 0);
    assert!((path / (s + u) - 1.0).abs() < 1e-3, "{path}");
}

#[test]
fn a_glass_plate_lifts_what_lies_behind_it() {
    let mut room = Room::default();
    let glass = room.material(glass());
    let glow = room.material(Material::emitter(Vec3::ONE));
    let thickness = 0.3;
    room.cuboid(DVec3::new(-1.0, -1.0, -0.8), DVec3::new(1.0, 1.0, -0.8 + thickness), false, [glass; 6]);
    room.quad(DVec3::new(-1.0, -1.0, -1.0), DVec3::X * 2.0, DVec3::Y * 2.0, glow);
    let camera = Camera::looking_at(DVec3::ZERO, DVec3::NEG_Z, 0.2);
    let expected = 1.0 - thickness * (1.0 - 1.0 / 1.5);
    for offset in [0, 2, 303] {
        let depth = depth_in_the_middle(&room.scene, &camera, MirrorDepth::Focus, offset);
        assert!((depth / expected - 1.0).abs() < 2e-3, "{depth}, not {expected}");
    }
    assert!((depth_in_the_middle(&room.scene, &camera, MirrorDepth::Path, 0) - 1.0).abs() < 1e-6);
}

#[test]
fn glass_gives_two_points_on_one_ray() {
    // A thin pane at 45°: one lamp behind it, another one beside, seen as a reflection.
    let mut room = Room::default();
    let pane = room.material(Material {
        transmission: 1.0,
        roughness: 0.0,
        double_sided: true,
        ..Material::diffuse(Vec3::ONE)
    });
    let green = room.material(Material::emitter(Vec3::Y));
    let red = room.material(Material::emitter(Vec3::X));
    room.quad(DVec3::new(-0.5, -0.5, -0.5), DVec3::new(1.0, 0.0, -1.0), DVec3::Y, pane);
    room.quad(DVec3::new(-1.0, -1.0, -3.0), DVec3::X * 2.0, DVec3::Y * 2.0, green);
    room.quad(DVec3::new(2.0, -1.0, -3.0), DVec3::Z * 4.0, DVec3::Y * 2.0, red);
    let bvh = SceneBvh::new(room.scene.clone());
    let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).unwrap();
    let camera = Camera::looking_at(DVec3::new(0.0, 0.0, 0.0), DVec3::NEG_Z, 0.1);
    let settings = TraceSettings { width: 9, height: 9, ..TraceSettings::default() };
    let traced = trace(&light, &camera, &settings, &Progress::new()).unwrap();
    let middle: Vec<_> = traced.points.iter().filter(|p| p.pixel == 40).collect();
    let one = crate::illumination::reflection::dielectric_reflectance(0.5f64.sqrt(), 1.0 / 1.5) as f32;
    let both = 2.0 * one / (1.0 + one);
    assert_eq!(middle.len(), 2, "{middle:?}");
    assert!((middle[0].radiance[1] - (1.0 - both)).abs() < 1e-5 && (middle[0].distance - 3.0).abs() < 1e-9);
    assert!((middle[1].radiance[0] - both).abs() < 1e-5, "{middle:?}");
    // 1 m to the pane's middle, 2 m to the red wall at its right.
    assert!((middle[1].distance - 3.0).abs() < 1e-9 && middle[1].bounces == 1);
}
