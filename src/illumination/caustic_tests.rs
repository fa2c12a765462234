//! Light by way of mirrors and glass against closed forms.

use super::test_rooms::{Room, glass};
use super::*;
use crate::random::Random;
use crate::scene::Scene;
use crate::scene::bvh::Ray;
use crate::scene::{Material, Sides};
use glam::DVec3;
use std::f64::consts::PI;

fn lit(scene: &Scene, settings: IlluminationSettings) -> Illumination {
    Illumination::new(SceneBvh::new(scene.clone()), settings, &Progress::new()).unwrap()
}

/// Radiance of a floor of albedo one at a point, as a ray from above it finds it.
fn floor_at(light: &Illumination, x: f64, height: f64, z: f64) -> Vec3 {
    let ray = Ray { origin: DVec3::new(x, height, z), direction: DVec3::NEG_Y };
    let hit = light.bvh().nearest(&ray, 0.0, Sides::Front).unwrap();
    let surface = Surface::at(light.bvh().scene(), &hit, 0.0);
    light.radiance(
        &hit,
        &surface,
        1,
        &mut Random::new(7, hit.position.x.to_bits() ^ hit.position.z.to_bits().rotate_left(17)),
    )
}

#[test]
fn a_concave_mirror_gathers_light_in_its_focus() {
    // A spherical cap of radius R = 1 looks up; the lamp, small, stands at its centre of curvature plus a little: a lamp
    // at distance u from the mirror has its image at 1/v = 2/R − 1/u. Here u = 1.25, so v = 5/6 above the mirror, where
    // a small white target looks down at the mirror.
    let mut room = Room::default();
    let (radius, u) = (1.0, 1.25);
    let v = 1.0 / (2.0 / radius - 1.0 / u);
    let silver = room.material(Material::mirror(Vec3::splat(0.9)));
    let lamp = room.material(Material::emitter(Vec3::splat(1000.0)));
    let white = room.material(Material::diffuse(Vec3::ONE));
    let half = 0.15;
    room.cap(DVec3::Y * radius, radius, half, 40, silver);
    // The lamp stands beside the axis, so that the target is not in its way; its image lies on the other side.
    let (off, side) = (0.06, 0.004);
    room.quad(DVec3::new(off - side / 2.0, u, -side / 2.0), DVec3::X * side, DVec3::Z * side, lamp);
    let image = [-off * v / u, v];
    room.quad(DVec3::new(image[0] - 0.035, v, -0.035), DVec3::X * 0.07, DVec3::Z * 0.07, white);
    let light = lit(&room.scene, IlluminationSettings::default());
    // What the lamp sends to the cap, less what the target hides, times the reflectance: by the photons themselves and
    // by a grid over lamp directions.
    let n = 600;
    let mut sent = 0.0;
    for i in 0..n * n {
        let x = (f64::from(i % n) + 0.5) / f64::from(n) * 2.0 * half - half;
        let z = (f64::from(i / n) + 0.5) / f64::from(n) * 2.0 * half - half;
        if x * x + z * z > half * half {
            continue;
        }
        let at = DVec3::new(x, radius - (radius * radius - x * x - z * z).sqrt(), z);
        let normal = (DVec3::Y * radius - at).normalize();
        let from = DVec3::new(off, u, 0.0);
        let way = at - from;
        let crossing = from + way * ((u - v) / (u - at.y));
        if (crossing.x - image[0]).abs() <= 0.035 && crossing.z.abs() <= 0.035 {
            continue;
        }
        let area = (2.0 * half / f64::from(n)).powi(2) / normal.y;
        let r2 = way.length_squared();
        let (leaving, arriving) = (-way.y / r2.sqrt(), -way.dot(normal) / r2.sqrt());
        let cosine: f64 = arriving;
        let fresnel = 0.9 + 0.1 * (1.0 - cosine).powi(5);
        sent += 3000.0 * side * side * leaving * arriving * area / r2 * fresnel;
    }
    let n = 280;
    let cell = 0.07 / f64::from(n);
    let (mut sum, mut middle) = (0.0, [0.0; 2]);
    for i in 0..n * n {
        let x = image[0] - 0.035 + (f64::from(i % n) + 0.5) * cell;
        let z = -0.035 + (f64::from(i / n) + 0.5) * cell;
        let flux = f64::from(light.caustics.light(DVec3::new(x, v, z), DVec3::NEG_Y).element_sum()) * PI * cell * cell;
        sum += flux;
        middle[0] += flux * x;
        middle[1] += flux * z;
    }
    let middle = middle.map(|m| m / sum);
    eprintln!("sent {sent:.4e}, found {sum:.4e}; middle {middle:?}, image {image:?}");
    assert!((sum / sent - 1.0).abs() < 0.03, "{sum} of {sent}");
    assert!((middle[0] - image[0]).abs() < 1e-3 && middle[1].abs() < 1e-3, "{middle:?}");
    // The image of the lamp is v/u of its size: nearly all light lies within that and the spherical aberration.
    let near: f64 = power_down(&light, [image[0], 0.0], v, 0.006, 120);
    assert!(near > 0.9 * sum, "{near} of {sum}");
}

/// Photons' flux on a square that looks down.
fn power_down(light: &Illumination, middle: [f64; 2], height: f64, half: f64, n: u32) -> f64 {
    let cell = 2.0 * half / f64::from(n);
    let at = |i: u32| {
        let x = middle[0] - half + (f64::from(i % n) + 0.5) * cell;
        let z = middle[1] - half + (f64::from(i / n) + 0.5) * cell;
        f64::from(light.caustics.light(DVec3::new(x, height, z), DVec3::NEG_Y).element_sum()) * PI * cell * cell
    };
    (0..n * n).map(at).sum()
}

#[test]
fn a_glass_ball_focuses_light_on_the_floor() {
    // A ball of index n and radius R has its back focal point at nR/(2(n − 1)) from its centre. Light from far above:
    // a small lamp. The floor stands in the focus, so the centre is bright; what enters the ball within a small aperture
    // arrives with two Fresnel transmissions.
    let mut room = Room::default();
    let glass = room.material(glass());
    let white = room.material(Material::diffuse(Vec3::ONE));
    let lamp = room.material(Material::emitter(Vec3::splat(1e4)));
    let (radius, u, n) = (0.05, 3.0, 1.5);
    let f = n * radius / (2.0 * (n - 1.0));
    let v = 1.0 / (1.0 / f - 1.0 / u);
    room.sphere(DVec3::Y * v, radius, false, 96, glass);
    let side = 0.02;
    room.quad(DVec3::new(-side / 2.0, v + u, -side / 2.0), DVec3::X * side, DVec3::Z * side, lamp);
    room.quad(DVec3::new(-0.3, 0.0, -0.3), DVec3::Z * 0.6, DVec3::X * 0.6, white);
    let light = lit(&room.scene, IlluminationSettings::default());
    // All rings of rays through the ball, exactly: flux against the radius at which they meet the floor.
    let irradiance = 3e4 * side * side / (u * u);
    let rings = 20_000;
    let (mut all, mut core) = (0.0, 0.0);
    for i in 0..rings {
        let h = radius * (f64::from(i) + 0.5) / f64::from(rings);
        // From a lamp at distance u: the ray that would pass the centre's plane at height h.
        let slope = h / u;
        let direction = DVec3::new(slope, -1.0, 0.0).normalize();
        let origin = DVec3::new(0.0, v + u, 0.0);
        let centre = DVec3::Y * v;
        let b = (origin - centre).dot(direction);
        let disc = b * b - (origin - centre).length_squared() + radius * radius;
        if disc <= 0.0 {
            continue;
        }
        let p = origin + direction * (-b - disc.sqrt());
        let normal = (p - centre) / radius;
        let cosine = -direction.dot(normal);
        let inside = reflection::refracted(direction, normal, 1.0 / n).unwrap();
        let q = p + inside * (-2.0 * inside.dot(p - centre));
        let out_normal = (q - centre) / radius;
        let out = reflection::refracted(inside, -out_normal, n).unwrap();
        let through = (1.0 - reflection::dielectric_reflectance(cosine, 1.0 / n)).powi(2);
        let end = q - out * (q.y / out.y);
        let ring = irradiance * 2.0 * PI * h * radius / f64::from(rings) * (1.0 + slope * slope).powi(-2);
        all += ring * through;
        if end.x.abs() < 0.01 && out.y < 0.0 {
            core += ring * through;
        }
    }
    let mut found = 0.0;
    let (cells, half) = (300, 0.01);
    let cell = 2.0 * half / f64::from(cells);
    for i in 0..cells * cells {
        let x = -half + (f64::from(i % cells) + 0.5) * cell;
        let z = -half + (f64::from(i / cells) + 0.5) * cell;
        if x * x + z * z < half * half {
            let e = light.caustics.light(DVec3::new(x, 0.0, z), DVec3::Y).element_sum();
            found += f64::from(e) * PI * cell * cell;
        }
    }
    eprintln!("of {all:.4e} through the ball {core:.4e} should meet the middle, {found:.4e} do");
    assert!((found / core - 1.0).abs() < 0.03, "{found} of {core}");
    assert!(light.report().energy.imbalance().abs() < 0.01, "{:?}", light.report().energy);
}

#[test]
fn a_thin_pane_dims_and_a_half_covered_one_too() {
    let mut room = Room::default();
    let white = room.material(Material::diffuse(Vec3::ONE));
    let lamp = room.material(Material::emitter(Vec3::splat(5.0)));
    let pane = room.material(Material {
        transmission: 1.0,
        roughness: 0.0,
        double_sided: true,
        ..Material::diffuse(Vec3::new(0.9, 0.5, 0.1))
    });
    room.quad(DVec3::new(-0.01, 0.0, -0.01), DVec3::Z * 0.02, DVec3::X * 0.02, white);
    room.quad(DVec3::new(-0.01, 1.0, -0.01), DVec3::X * 0.02, DVec3::Z * 0.02, lamp);
    let free = floor_at(&lit(&room.scene, IlluminationSettings::default()), 0.0, 0.1, 0.0);
    room.quad(DVec3::new(-0.1, 0.5, -0.1), DVec3::X * 0.2, DVec3::Z * 0.2, pane);
    let both = 2.0 * 0.04 / 1.04;
    let dimmed = floor_at(&lit(&room.scene, IlluminationSettings::default()), 0.0, 0.1, 0.0) / free;
    assert!((dimmed - Vec3::new(0.9, 0.5, 0.1) * (1.0 - both)).abs().max_element() < 1e-3, "{dimmed}");
}
