//! Images of lamps in flat mirrors, against closed forms.

use super::form_factor::{point_to_element, point_to_polygon};
use super::test_rooms::Room;
use super::{Illumination, IlluminationSettings, Surface};
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::{LightKind, Material, PunctualLight, Ray, Scene, SceneBvh, Sides};
use glam::{DVec3, Vec3};

fn floor_at(scene: &Scene, x: f64, z: f64) -> Vec3 {
    let bvh = SceneBvh::new(scene.clone());
    let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).unwrap();
    let ray = Ray { origin: DVec3::new(x, 0.05, z), direction: DVec3::NEG_Y };
    let hit = light.bvh().nearest(&ray, 0.0, Sides::Front).unwrap();
    light.radiance(&hit, &Surface::at(scene, &hit, 0.0), 1, &mut Random::new(3, 3))
}

/// A black-and-white floor of albedo one, a lamp that looks down at height 1, and whatever else is put in.
fn floor_and_lamp(room: &mut Room) {
    let white = room.material(Material::diffuse(Vec3::ONE));
    let lamp = room.material(Material::emitter(Vec3::new(4.0, 2.0, 1.0)));
    room.quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0, white);
    room.quad(DVec3::new(-0.1, 1.0, -0.1), DVec3::X * 0.2, DVec3::Z * 0.2, lamp);
}

fn close(found: Vec3, expected: Vec3, tolerance: f32) {
    assert!(((found - expected) / expected).abs().max_element() < tolerance, "{found} is not {expected}");
}

#[test]
fn a_mirror_wall_doubles_the_lamp() {
    // A mirror in the plane x = 0.5, higher and wider than any way from the lamp's image to the floor: the image
    // stands at x = 1 and shines as the lamp does, times the mirror's Fresnel reflectance.
    let mut room = Room::default();
    floor_and_lamp(&mut room);
    let silver = room.material(Material::mirror(Vec3::splat(0.9)));
    room.quad(DVec3::new(0.5, 0.001, -3.0), DVec3::Z * 6.0, DVec3::Y * 4.0, silver);
    for (x, z) in [(0.1, 0.05), (-0.4, 0.3), (0.45, -0.2)] {
        let lamp = |shift: f64| {
            let corner = DVec3::new(shift - 0.1, 1.0, -0.1);
            let polygon =
                [corner, corner + DVec3::X * 0.2, corner + DVec3::new(0.2, 0.0, 0.2), corner + DVec3::Z * 0.2];
            point_to_polygon(DVec3::new(x, 0.0, z), DVec3::Y, &polygon)
        };
        // Schlick at the angle of the image's middle.
        let way = DVec3::new(1.0 - x, 1.0, -z).normalize();
        let fresnel = 0.9 + 0.1 * (1.0 - way.x).powi(5);
        let expected = Vec3::new(4.0, 2.0, 1.0) * (lamp(0.0) + fresnel * lamp(1.0)) as f32;
        // The floor sees itself in the mirror, but that is light from floor to floor: none, both lie in one plane.
        close(floor_at(&room.scene, x, z), expected, 1e-3);
    }
}

#[test]
fn a_small_mirror_shows_a_part_of_the_lamp() {
    // The image is clipped by the mirror's outline: against a fine grid over lamp and mirror.
    let mut room = Room::default();
    floor_and_lamp(&mut room);
    let silver = room.material(Material::mirror(Vec3::ONE));
    room.quad(DVec3::new(0.5, 0.45, -0.03), DVec3::Z * 0.1, DVec3::Y * 0.1, silver);
    let (x, z) = (0.02, 0.03);
    let (point, n) = (DVec3::new(x, 0.0, z), 400);
    let (mut through, mut direct) = (0.0, 0.0);
    for i in 0..n * n {
        let (s, t) = ((f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n));
        let area = 0.04 / f64::from(n * n);
        let at = DVec3::new(-0.1 + 0.2 * s, 1.0, -0.1 + 0.2 * t);
        direct += point_to_element(point, DVec3::Y, at, DVec3::NEG_Y, area);
        let image = DVec3::new(1.0 - at.x, at.y, at.z);
        let meets = point.lerp(image, (0.5 - x) / (image.x - x));
        if (0.45..0.55).contains(&meets.y) && (-0.03..0.07).contains(&meets.z) {
            through += point_to_element(point, DVec3::Y, image, DVec3::NEG_Y, area);
        }
    }
    assert!(through > 0.02 * direct, "{through} of {direct}");
    close(floor_at(&room.scene, x, z), Vec3::new(4.0, 2.0, 1.0) * (direct + through) as f32, 2e-3);
}

#[test]
fn mirrors_that_face_each_other_repeat_the_lamp() {
    // Walls at x = ±0.5 of reflectance 0.8, as high and wide as any way needs: images at x = ±1, ±2, … of strength
    // 0.8^k (Schlick's rise at grazing angles is in the sum, image by image).
    let mut room = Room::default();
    let white = room.material(Material::diffuse(Vec3::ONE));
    let lamp = room.material(Material::emitter(Vec3::ONE));
    let silver = room.material(Material::mirror(Vec3::splat(0.8)));
    room.quad(DVec3::new(-0.5, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X, white);
    room.quad(DVec3::new(-0.1, 1.0, -0.1), DVec3::X * 0.2, DVec3::Z * 0.2, lamp);
    room.quad(DVec3::new(0.5, 0.0, -20.0), DVec3::Z * 40.0, DVec3::Y * 1.5, silver);
    room.quad(DVec3::new(-0.5, 0.0, -20.0), DVec3::Y * 1.5, DVec3::Z * 40.0, silver);
    let (x, z) = (0.13, 0.21);
    let point = DVec3::new(x, 0.0, z);
    let mut expected = 0.0;
    for k in -60i32..=60 {
        let n = 20;
        for i in 0..n * n {
            let (s, t) = ((f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n));
            let at = DVec3::new(f64::from(k) - 0.1 + 0.2 * s, 1.0, -0.1 + 0.2 * t);
            let cosine = ((at - point).normalize()).x.abs();
            let part = 0.8 + 0.2 * (1.0 - cosine).powi(5);
            expected +=
                point_to_element(point, DVec3::Y, at, DVec3::NEG_Y, 0.04 / f64::from(n * n)) * part.powi(k.abs());
        }
    }
    close(floor_at(&room.scene, x, z), Vec3::splat(expected as f32), 5e-3);
}

#[test]
fn a_point_light_stands_behind_the_mirror_too() {
    let mut room = Room::default();
    let white = room.material(Material::diffuse(Vec3::ONE));
    let silver = room.material(Material::mirror(Vec3::ONE));
    room.quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0, white);
    room.quad(DVec3::new(0.5, 0.3, -1.0), DVec3::Z * 2.0, DVec3::Y * 0.4, silver);
    room.scene.lights = vec![PunctualLight {
        kind: LightKind::Point,
        position: Vec3::new(0.0, 1.0, 0.0),
        direction: Vec3::NEG_Y,
        intensity: Vec3::splat(2.0),
        range: f32::INFINITY,
        measured: None,
    }];
    let from = |x: f64, lamp: DVec3| {
        let way = lamp - DVec3::new(x, 0.0, 0.1);
        2.0 * way.normalize().y / way.length_squared() / std::f64::consts::PI
    };
    // From x = 0.1 the image at x = 1 is seen at height 0.44 of the mirror's plane, from 0.45 at 0.09: below it.
    let both = from(0.1, DVec3::Y) + from(0.1, DVec3::new(1.0, 1.0, 0.0));
    close(floor_at(&room.scene, 0.1, 0.1), Vec3::splat(both as f32), 1e-4);
    close(floor_at(&room.scene, 0.45, 0.1), Vec3::splat(from(0.45, DVec3::Y) as f32), 1e-4);
}
