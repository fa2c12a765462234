//! The scenes in `scenes/`: what they promise to be.

use glam::{DVec3, Vec3};
use holodrive::scene::gltf::{LoadOptions, load};
use holodrive::scene::{Scene, Triangle};
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn own(name: &str) -> Arc<Scene> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let loaded = load(&path, &LoadOptions::default()).expect("a scene of our own loads");
    assert_eq!(loaded.warnings, [], "{name}");
    loaded.scene
}

fn close(a: DVec3, b: DVec3) -> bool {
    a.distance(b) < 1e-6
}

/// Distance along a ray to a triangle's front (Möller & Trumbore 1997), for scenes that are small enough to try all.
fn front_hit(triangle: &Triangle, origin: DVec3, direction: DVec3) -> Option<f64> {
    let [a, b, c] = triangle.corners();
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    if determinant <= 0.0 {
        return None;
    }
    let s = origin - a;
    let (u, q) = (s.dot(p) / determinant, s.cross(ab));
    let v = direction.dot(q) / determinant;
    let distance = ac.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(distance)
}

fn nearest(scene: &Scene, origin: DVec3, direction: DVec3) -> Option<(f64, u32)> {
    (0u32..)
        .zip(&scene.triangles)
        .filter_map(|(i, t)| Some((front_hit(t, origin, direction)?, i)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
}

#[test]
fn cornell_is_the_room_of_the_main_job() {
    let scene = own("cornell.gltf");
    // Five walls and a light of two triangles, two blocks of five faces.
    assert_eq!(scene.triangles.len(), 6 * 2 + 2 * 5 * 2);
    let (low, high) = scene.bounds().expect("triangles");
    assert!(close(low, DVec3::new(-0.275, 0.0, -0.55)) && close(high, DVec3::new(0.275, 0.55, 0.0)), "{low} {high}");
    let named = |name: &str| scene.materials.iter().find(|m| m.name == name).expect("a material of this name");
    let light = named("light");
    assert!(light.emissive.distance(Vec3::new(18.0, 16.2, 13.5)) < 1e-5 && light.base_color == Vec3::ZERO);
    let mirror = named("mirror");
    assert_eq!((mirror.metallic, mirror.roughness, mirror.base_color), (1.0, 0.0, Vec3::splat(0.95)));
    let red = named("red");
    assert_eq!((red.metallic, red.specular, red.double_sided), (0.0, 0.0, false));
    assert!(red.base_color.x > 5.0 * red.base_color.y);

    // The emitter shines down and has the area that it was given.
    let lamp: Vec<&Triangle> = (0..)
        .zip(&scene.triangles)
        .filter(|(i, _)| scene.material(*i).emissive != Vec3::ZERO)
        .map(|(_, t)| t)
        .collect();
    assert!(lamp.iter().all(|t| close(t.normal(), DVec3::NEG_Y)));
    assert!((lamp.iter().map(|t| t.area()).sum::<f64>() - 0.13 * 0.105).abs() < 1e-8);

    // Of 500 × 500 rays, (0.9·500)² meet the room through its open front; here one ray in 25. None is lost inside.
    let camera = &scene.cameras[0];
    assert_eq!(scene.cameras.len(), 1);
    let (mut hits, mut on_mirror, mut on_red_left, mut on_green_right) = (0, 0, 0, 0);
    for row in 0..100 {
        for column in 0..100 {
            let (u, v) = ((f64::from(column) + 0.5) / 100.0, (f64::from(row) + 0.5) / 100.0);
            let ray = camera.ray(u, v, 1.0);
            let at_front = ray.origin - ray.direction * (ray.origin.z / ray.direction.z);
            let enters = at_front.x.abs() < 0.275 && (at_front.y - 0.275).abs() < 0.275;
            let hit = nearest(&scene, ray.origin, ray.direction);
            assert_eq!(hit.is_some(), enters, "{u} {v}");
            let Some((distance, triangle)) = hit else { continue };
            hits += 25;
            match scene.material(triangle).name.as_str() {
                "red" => on_red_left += i32::from(u < 0.5),
                "green" => on_green_right += i32::from(u > 0.5),
                "mirror" => {
                    on_mirror += 1;
                    // What is seen in the mirror is in the room, not out of its open front.
                    let normal = scene.triangles[triangle as usize].normal();
                    let mirrored = ray.direction - 2.0 * ray.direction.dot(normal) * normal;
                    let on = ray.origin + ray.direction * distance + 1e-6 * normal;
                    assert!(nearest(&scene, on, mirrored).is_some(), "the mirror shows the open front at {u}, {v}");
                }
                _ => {}
            }
        }
    }
    // A row of rays more or less may fall on the edge of the opening.
    assert!((hits - 202_500i32).abs() <= 2 * 100 * 25, "{hits}");
    assert!(on_mirror > 300 && on_red_left > 500 && on_green_right > 500, "{on_mirror} {on_red_left} {on_green_right}");
}

#[test]
fn the_mirror_ball_is_round_and_its_room_closed() {
    let scene = own("mirror-ball.gltf");
    assert_eq!(scene.triangles.len(), 7 * 2 + 20 * 256 + 6 * 2);
    let centre = DVec3::new(-0.09, 0.13, -0.36);
    let ball = (0u32..).zip(&scene.triangles).filter(|(i, _)| scene.material(*i).name == "mirror").map(|(_, t)| t);
    let mut count = 0;
    for triangle in ball {
        count += 1;
        for (corner, normal) in triangle.corners().iter().zip(&triangle.normals) {
            assert!((corner.distance(centre) - 0.13).abs() < 1e-7);
            assert!(normal.as_dvec3().distance((corner - centre).normalize()) < 1e-6);
        }
        assert!(triangle.normal().dot(triangle.corners()[0] - centre) > 0.0, "an inside-out triangle");
    }
    assert_eq!(count, 5120);
    let glass = scene.materials.iter().find(|m| m.name == "glass").expect("glass");
    assert_eq!((glass.transmission, glass.ior, glass.thickness), (1.0, 1.5, 0.08));
    let wall = scene.materials.iter().find(|m| m.name == "chequered").expect("chequered wall");
    let texture = wall.base_color_texture.expect("its texture");
    assert_eq!((texture.scale, scene.textures.len()), (glam::Vec2::splat(4.0), 1));
    assert!(!scene.textures[0].linear);

    // Rays from within, in all directions, end on a wall; the camera looks in from outside through the front wall's back.
    for i in 0..1000 {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 1000.0;
        let (sin, cos) = (f64::from(i) * 2.399_963).sin_cos();
        let direction = DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z;
        assert!(nearest(&scene, DVec3::new(0.0, 0.5, -0.1), direction).is_some(), "a hole towards {direction}");
    }
    let ray = scene.cameras[0].ray(0.5, 0.5, 1.0);
    let (distance, _) = nearest(&scene, ray.origin, ray.direction).expect("a hit");
    assert!(distance > 0.85 + 0.1, "the front wall is in the way");
}

#[test]
fn the_letters_of_the_depth_chart_stand_in_their_corners() {
    let scene = own("depth-chart.gltf");
    assert_eq!(scene.triangles.len(), 2 * (3 + 5 + 4 + 5));
    assert!(scene.materials.iter().all(|m| m.emissive == Vec3::ONE && m.base_color == Vec3::ZERO));
    let camera = &scene.cameras[0];
    let depth_at = |u: f64, v: f64| {
        let ray = camera.ray(u, v, 1.0);
        nearest(&scene, ray.origin, ray.direction).map(|(distance, _)| -distance * ray.direction.z)
    };
    // Each letter's rows of cells, as a reader sees them, from its description on a grid of 5 × 7.
    let letters = [
        (1.0, 0.25, 0.25, ["#####", "#....", "#....", "####.", "#....", "#....", "#...."]),
        (1.4, 0.75, 0.25, ["#####", "#....", "#....", "#..##", "#...#", "#...#", "#####"]),
        (1.8, 0.25, 0.75, ["..###", "...#.", "...#.", "...#.", "#..#.", "#..#.", "####."]),
        (2.2, 0.75, 0.75, ["#####", "#...#", "#...#", "#####", "#.#..", "#..#.", "#...#"]),
    ];
    for (depth, u, v, rows) in letters {
        for (row, cells) in rows.iter().enumerate() {
            for (column, cell) in cells.chars().enumerate() {
                let at = depth_at(u + 0.052 * (column as f64 - 2.0), v + 0.052 * (row as f64 - 3.0));
                match at {
                    // The R's slanted leg covers cells in part; only its straight strokes and its gaps are looked up.
                    _ if depth == 2.2 && row > 3 && column > 1 => {}
                    Some(found) => {
                        assert!(cell == '#' && (found - depth).abs() < 1e-6, "{depth} {row} {column} {found}")
                    }
                    None => assert_eq!(cell, '.', "{depth} {row} {column}"),
                }
            }
        }
    }
    // The leg of the R leans to the lower right.
    assert!(depth_at(0.75 + 0.052 * 1.8, 0.75 + 0.052 * 3.3).is_some());
    assert!(depth_at(0.75 - 0.052 * 0.9, 0.75 + 0.052 * 3.3).is_none());
    // Letters do not hide each other and leave a margin: nothing on the cross between them nor on the frame.
    for i in 0..100 {
        let t = (f64::from(i) + 0.5) / 100.0;
        for (u, v) in [(0.5, t), (t, 0.5), (0.02, t), (0.98, t), (t, 0.02), (t, 0.98)] {
            assert_eq!(depth_at(u, v), None, "{u} {v}");
        }
    }
}

#[test]
fn every_scene_says_what_it_is_for() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).expect("scenes").map(|e| e.expect("entry").path()) {
        if entry.extension().is_some_and(|e| e == "gltf") {
            let json: serde_json::Value =
                serde_json::from_slice(&std::fs::read(&entry).expect("read")).expect("a scene is JSON");
            let purpose = json["asset"]["extras"]["purpose"].as_str().unwrap_or_default();
            assert!(purpose.len() > 40, "{}", entry.display());
            count += 1;
        }
    }
    assert!(count >= 3);
}

#[test]
fn the_letters_behind_the_glass_block_are_small_and_the_block_is_thick() {
    let scene = own("glass-block.gltf");
    let glass = scene.materials.iter().find(|m| m.name == "glass").expect("glass");
    assert_eq!((glass.transmission, glass.ior), (1.0, 1.5));
    assert!(glass.thickness > 0.0 && glass.attenuation_distance.is_infinite());
    let (low, high) = scene.bounds().expect("triangles");
    assert!(close(low, DVec3::new(-0.5, -0.5, -1.5)) && close(high, DVec3::new(0.5, 0.5, -0.6)), "{low} {high}");
    let letters = scene.triangles.iter().filter(|t| scene.materials[t.material as usize].name == "glow");
    assert!(letters.flat_map(Triangle::corners).all(|p| (p.z + 1.5).abs() < 1e-6));
}
