//! Geometry as it really comes: what is wrong with it must not be worse than it is.

use super::eye_tests::{agrees, white_box};
use super::trace::{TraceSettings, Traced, trace};
use crate::illumination::test_rooms::{Room, glass};
use crate::illumination::{Illumination, IlluminationSettings};
use crate::progress::Progress;
use crate::scene::{Camera, Material, Scene, SceneBvh};
use glam::{DVec3, Vec3};

fn traced(scene: &Scene, camera: &Camera) -> Traced {
    let bvh = SceneBvh::new(scene.clone());
    let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).unwrap();
    let settings = TraceSettings { width: 31, height: 31, ..TraceSettings::default() };
    let traced = trace(&light, camera, &settings, &Progress::new()).unwrap();
    assert!(traced.picture.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
    assert!(traced.points.iter().all(|p| p.position.is_finite() && p.distance > 0.0));
    traced
}

fn matte() -> Material {
    Material::diffuse(Vec3::splat(0.7))
}

#[test]
fn boxes_that_run_into_each_other_are_lit_as_they_look() {
    let mut room = white_box(matte(), matte());
    let m = room.material(matte());
    room.cuboid(DVec3::new(-0.3, -0.5, -0.3), DVec3::new(0.05, -0.2, 0.0), false, [m; 6]);
    room.cuboid(DVec3::new(-0.05, -0.5, -0.15), DVec3::new(0.3, -0.1, 0.15), false, [m; 6]);
    // Half in the floor.
    room.cuboid(DVec3::new(-0.35, -0.6, 0.1), DVec3::new(-0.2, -0.45, 0.25), false, [m; 6]);
    let camera = Camera::looking_at(DVec3::new(-0.2, 0.2, 0.49), DVec3::new(0.0, -0.35, 0.0), 1.0);
    // Tops and fronts beside the edges where they meet, and the floor round them.
    agrees(&room, &camera, &[[0.5, 0.45], [0.42, 0.52], [0.62, 0.42], [0.3, 0.8], [0.5, 0.8]], 200_000, 0.02);
}

#[test]
fn triangles_without_area_or_with_nan_change_nothing() {
    let camera = Camera::looking_at(DVec3::new(0.02, 0.03, 0.49), DVec3::new(0.0, 0.0, -0.5), 1.2);
    let clean = white_box(matte(), matte());
    let mut dirty = white_box(matte(), matte());
    let m = dirty.material(matte());
    let lamp = dirty.material(Material::emitter(Vec3::splat(100.0)));
    // Multiples of powers of two: these corners stand on one line to the last bit.
    let p = DVec3::splat(0.125);
    dirty.face([p, p, p], m);
    dirty.face([p, p * 2.0, p * 3.0], lamp);
    dirty.face([p, DVec3::splat(f64::NAN), p * 3.0], m);
    let (a, b) = (traced(&clean.scene, &camera), traced(&dirty.scene, &camera));
    assert_eq!(a.picture, traced(&clean.scene, &camera).picture, "the same scene gives the same bits");
    for (x, y) in a.picture.iter().flatten().zip(b.picture.iter().flatten()) {
        assert!((x - y).abs() <= 1e-5 * x.abs(), "{x} {y}");
    }
}

#[test]
fn a_wall_with_its_front_to_the_outside_is_not_seen_and_is_black_to_light() {
    // The right wall is turned inside out: eyes look through it, light ends on it.
    let mut room = white_box(matte(), matte());
    let camera = Camera::looking_at(DVec3::new(-0.3, 0.0, 0.3), DVec3::new(0.5, 0.0, 0.0), 0.5);
    let whole = traced(&room.scene, &camera);
    for triangle in &mut room.scene.triangles {
        if triangle.positions.iter().all(|p| p.x == 0.5) {
            triangle.positions.swap(1, 2);
            triangle.normals = triangle.normals.map(|n| -n);
        }
    }
    let turned = traced(&room.scene, &camera);
    assert!(whole.report.missed == 0 && turned.report.missed == 31 * 31);
    let there = Camera::looking_at(DVec3::new(0.3, 0.01, 0.3), DVec3::new(-0.5, 0.0, 0.0), 0.5);
    let (reference, dimmed) = (traced(&white_box(matte(), matte()).scene, &there), traced(&room.scene, &there));
    let mean = |t: &Traced| t.picture.iter().map(|p| p[0]).sum::<f32>() / t.picture.len() as f32;
    let ratio = mean(&dimmed) / mean(&reference);
    assert!(ratio > 0.4 && ratio < 0.9, "a black wall takes a part of the light: {ratio}");
}

#[test]
fn an_eye_inside_glass_sees_out() {
    // From within glass a lamp at d beyond the flat face at t stands at t + n·d, dimmed by the face's reflectance.
    let mut room = Room::default();
    let (g, lamp) = (room.material(glass()), room.material(Material::emitter(Vec3::ONE)));
    room.cuboid(DVec3::splat(-0.5), DVec3::splat(0.5), false, [g; 6]);
    room.quad(DVec3::new(-4.0, -4.0, -1.5), DVec3::X * 8.0, DVec3::Y * 8.0, lamp);
    let camera = Camera::looking_at(DVec3::new(0.01, 0.02, 0.0), DVec3::new(0.01, 0.02, -1.0), 0.1);
    let seen = traced(&room.scene, &camera);
    let middle: Vec<_> = seen.points.iter().filter(|p| p.pixel == 15 * 31 + 15).collect();
    assert!((middle[0].radiance[0] - 0.96).abs() < 1e-3, "{middle:?}");
    assert!((middle[0].distance - (0.5 + 1.5 * 1.0)).abs() < 1e-3, "{middle:?}");
    // What the back face reflects comes from the same lamp by a longer way, or not at all: never more than all.
    assert!(seen.picture.iter().all(|p| p[0] <= 1.0 + 1e-5));
}
