//! Where scenes stand before the panel.

use super::placed::place;
use super::placement::{Phase, Placement, WorldPoint};
use crate::field::Grid;
use crate::scene::{Camera, Projection, Scene, Triangle};
use glam::{DVec2, DVec3, Vec2, Vec3};

fn panel() -> Grid {
    Grid::new(1920, 1080, 8e-6, 8e-6).expect("panel")
}

fn camera() -> Camera {
    let mut camera = Camera::looking_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, -4.0), 0.7);
    camera.projection = Projection::Perspective { yfov: 0.7, aspect: Some(1.0) };
    camera
}

fn scene() -> Scene {
    let triangle = |a: Vec3, b: Vec3, c: Vec3| Triangle {
        positions: [a, b, c],
        normals: [Vec3::Z; 3],
        texcoords: [[Vec2::ZERO; 2]; 3],
        colors: [Vec3::ONE; 3],
        material: 0,
        instance: 0,
    };
    let mut scene = Scene::default();
    scene.triangles.push(triangle(Vec3::ZERO, Vec3::new(2.0, 4.0, -6.0), Vec3::new(0.0, 4.0, 0.0)));
    scene
}

#[test]
fn window_keeps_the_picture_and_maps_depth_into_its_range() {
    let placement = Placement::Window { eye: 0.6, near: -0.1, far: -0.15 };
    let placing = placement.prepare(&scene(), &camera(), 1.0, &panel()).expect("placing");
    assert!((placing.window.y - 0.5 * 1080.0 * 8e-6).abs() < 1e-12);
    assert!((placing.window.x - placing.window.y).abs() < 1e-12);
    let mut points = Vec::new();
    for (u, v, w) in [(0.1, 0.2, 2.0), (0.9, 0.4, 5.0), (0.5, 0.5, 3.0), (0.3, 0.8, 4.0)] {
        let ray = placing.camera.ray(u, v, 1.0);
        let along = w / -placing.camera.world_from_camera.inverse().transform_vector3(ray.direction).z;
        points.push(WorldPoint { position: ray.origin + along * ray.direction, radiance: [1.0; 3] });
    }
    let placed = place(&points, &placing, Phase::Zero, &panel(), 632.8e-9);
    for (point, (u, v)) in placed.cloud.points.iter().zip([(0.1, 0.2), (0.9, 0.4), (0.5, 0.5), (0.3, 0.8)]) {
        // Seen from the eye the point stands at the picture's (u, v): x to the right, v downwards.
        let p = point.position;
        let on_panel = DVec2::new(p.x, p.y) * 0.6 / (0.6 - p.z);
        let expected = DVec2::new(2.0 * u - 1.0, 1.0 - 2.0 * v) * placing.window;
        assert!((on_panel - expected).length() < 1e-12, "{on_panel} {expected}");
        // Equal radiance is equal brightness: amplitude over distance is the same.
        let distance = (placing.eye - p).length();
        assert!((f64::from(point.amplitude) / distance - 1.0).abs() < 1e-6);
    }
    let z: Vec<f64> = placed.cloud.points.iter().map(|p| p.position.z).collect();
    assert!((z[0] + 0.1).abs() < 1e-12 && (z[1] + 0.15).abs() < 1e-12);
    assert!(z[0] > z[2] && z[2] > z[3] && z[3] > z[1]);
    assert_eq!(placed.beyond_cone, 0);
}

#[test]
fn window_keeps_straight_lines_straight() {
    let placing = Placement::default().prepare(&scene(), &camera(), 1.0, &panel()).expect("placing");
    let (a, b) = (DVec3::new(0.2, 1.5, 1.0), DVec3::new(1.7, 2.6, -6.0));
    let points: Vec<_> =
        (0..=8).map(|i| WorldPoint { position: a.lerp(b, f64::from(i) / 8.0), radiance: [1.0; 3] }).collect();
    let out = place(&points, &placing, Phase::Zero, &panel(), 632.8e-9).cloud.points;
    let direction = (out[8].position - out[0].position).normalize();
    for p in &out {
        let off = (p.position - out[0].position).cross(direction).length();
        assert!(off < 1e-15 + 1e-10 * out[0].position.length(), "{off}");
    }
}

#[test]
fn model_is_a_similarity_that_fits_the_view() {
    let placement = Placement::Model { eye: 0.5, z: -0.2, scale: None };
    let placing = placement.prepare(&scene(), &camera(), 1.0, &panel()).expect("placing");
    let corners: Vec<_> =
        scene().triangles[0].corners().map(|position| WorldPoint { position, radiance: [0.5, 0.25, 0.0] }).to_vec();
    let out = place(&corners, &placing, Phase::Random { seed: 1 }, &panel(), 632.8e-9).cloud.points;
    let ratio = |i: usize, j: usize| {
        (out[i].position - out[j].position).length() / (corners[i].position - corners[j].position).length()
    };
    assert!((ratio(0, 1) / ratio(1, 2) - 1.0).abs() < 1e-9 && (ratio(0, 1) / ratio(0, 2) - 1.0).abs() < 1e-9);
    for p in &out {
        let view = placing.view_at(p.position.z);
        assert!(p.position.x.abs() <= view.x && p.position.y.abs() <= view.y, "{:?} outside {view}", p.position);
    }
    // The traced camera stands where the eye does: its ray to a corner passes through the same panel point.
    let toward = (corners[1].position - placing.camera.eye()).normalize();
    let local = placing.camera.world_from_camera.inverse().transform_vector3(toward);
    let hologram = (out[1].position - placing.eye).normalize();
    assert!((local - hologram).length() < 1e-12);
}

#[test]
fn every_placement_shows_the_rays_picture_unsqueezed() {
    // The corner of the picture is the corner of the window, whatever the shapes of picture and panel.
    for placement in [Placement::default(), Placement::Model { eye: 0.5, z: -0.2, scale: None }] {
        for aspect in [1.0, 2.5, 16.0 / 9.0] {
            let placing = placement.prepare(&scene(), &camera(), aspect, &panel()).expect("placing");
            assert!((placing.window.x / placing.window.y - aspect).abs() < 1e-12, "{placement:?}");
            let at = |u, v| {
                let ray = placing.camera.ray(u, v, placing.aspect);
                WorldPoint { position: ray.at(3.0), radiance: [1.0; 3] }
            };
            let corner = place(&[at(0.0, 0.0), at(0.5, 0.5)], &placing, Phase::Zero, &panel(), 632.8e-9);
            let p = corner.cloud.points[0].position;
            let seen = DVec2::new(p.x, p.y) * placing.eye.z / (placing.eye.z - p.z);
            assert!((seen - placing.window * DVec2::new(-1.0, 1.0)).length() < 1e-9, "{placement:?}: {seen}");
        }
    }
}

#[test]
fn light_beyond_the_cone_is_counted() {
    // At 8 µm and 632.8 nm the panel bends light by 2.27°; an eye at 0.1 m sees the panel's edge at 4.4°.
    let placement = Placement::Window { eye: 0.1, near: -0.1, far: -0.15 };
    let placing = placement.prepare(&scene(), &camera(), 1.0, &panel()).expect("placing");
    let at = |u, v| {
        let ray = placing.camera.ray(u, v, 1.0);
        WorldPoint { position: ray.origin + 3.0 * ray.direction, radiance: [1.0; 3] }
    };
    let placed = place(&[at(0.5, 0.5), at(0.99, 0.5), at(0.5, 0.01)], &placing, Phase::Path, &panel(), 632.8e-9);
    assert_eq!(placed.beyond_cone, 2);
    assert!((placed.beyond_cone_light - 2.0 / 3.0).abs() < 1e-6);
}

#[test]
fn impossible_placements_are_refused() {
    for placement in [
        Placement::Window { eye: -0.6, near: -0.1, far: -0.2 },
        Placement::Window { eye: 0.6, near: -0.2, far: -0.1 },
        Placement::Window { eye: 0.6, near: 0.7, far: -0.1 },
        Placement::Model { eye: 0.6, z: -0.1, scale: Some(0.0) },
    ] {
        assert!(placement.prepare(&scene(), &camera(), 1.0, &panel()).is_err(), "{placement:?}");
    }
}

#[test]
fn lines_of_sight_of_other_eyes_go_through_the_placed_points() {
    let model = Placement::Model { eye: 0.6, z: -0.12, scale: None };
    let window = Placement::Window { eye: 0.6, near: 0.02, far: -0.15 };
    let orthographic = Camera { projection: Projection::Orthographic { xmag: 2.0, ymag: 2.0 }, ..camera() };
    // An orthographic camera's lines of sight are bent, x = x₀ + s·E·e/(E − z) for an eye e aside and s room metres in one of
    // the hologram: with s = 463, e = 11 mm the chord is off by up to 3.06 m²·(1/0.58 + 1/0.75 − 2/0.665)/2 m⁻¹ = 0.08 m.
    for (placement, camera, error) in [(model, camera(), 1e-9), (window, camera(), 1e-9), (window, orthographic, 0.09)]
    {
        let placing = placement.prepare(&scene(), &camera, 1.0, &panel()).expect("placing");
        let points: Vec<WorldPoint> = [(0.1, 0.2, 2.0), (0.9, 0.4, 5.0), (0.5, 0.5, 3.0), (0.3, 0.8, 4.0)]
            .map(|(u, v, along)| WorldPoint { position: camera.ray(u, v, 1.0).at(along), radiance: [1.0; 3] })
            .to_vec();
        let placing = placing.fixed_by(&points);
        let placed = place(&points, &placing, Phase::Zero, &panel(), 632.8e-9);
        for (point, at) in points.iter().zip(&placed.cloud.points) {
            assert!((placing.depth_of(point.position) - at.position.z).abs() < 1e-12);
            for eye in [
                placing.eye,
                DVec3::new(0.011, -0.007, 0.6),
                DVec3::new(-0.004, 0.006, 0.45),
                DVec3::new(0.003, 0.0, 0.9),
            ] {
                let on_panel = eye + (at.position - eye) * (eye.z / (eye.z - at.position.z));
                let ray = placing.ray(eye, on_panel.truncate());
                let same = placing.rays(eye).through(on_panel.truncate());
                assert!((same.origin - ray.origin).length() < 1e-12 && same.direction.dot(ray.direction) > 1.0 - 1e-14);
                let to = point.position - ray.origin;
                let off = (to - ray.direction * to.dot(ray.direction)).length();
                assert!(off < error && to.dot(ray.direction) > 0.0, "{placement:?} {eye}: {off}");
            }
        }
    }
    // All of a flat scene stands on one plane: an eye aside sees the same picture, shifted by its parallax.
    let flat = Placement::Window { eye: 0.6, near: -0.1, far: -0.1 };
    let placing = flat.prepare(&scene(), &camera(), 1.0, &panel()).expect("placing");
    let ray = placing.ray(DVec3::new(0.01, 0.0, 0.6), DVec2::ZERO);
    let expected = placing.ray(placing.eye, DVec2::new(-0.01 * 0.1 / 0.6 / (0.7 / 0.6), 0.0));
    assert!((ray.direction - expected.direction).length() < 1e-12, "{ray:?} {expected:?}");
}
