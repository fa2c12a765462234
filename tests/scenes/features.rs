//! Geometry, nodes, cameras and lights: what the format can say, against what the specification means by it.

use super::builder::{Builder, U8, U16, U32, bytes_of, warns};
use glam::{DVec3, Vec2, Vec3};
use holodrive::scene::gltf::{Choice, LoadOptions, load};
use holodrive::scene::{LightKind, Projection, Scene};
use serde_json::json;
use std::sync::Arc;

fn scene(file: &Builder) -> Arc<Scene> {
    file.load().expect("loads").scene
}

/// The triangle file with normals towards +z.
fn with_normals() -> Builder {
    let mut file = Builder::triangle();
    let normals = file.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "VEC3");
    file.primitive()["attributes"]["NORMAL"] = json!(normals);
    file
}

#[test]
fn flat_normals_where_the_file_has_none() {
    let mut file = Builder::triangle();
    assert_eq!(scene(&file).triangles[0].normals, [Vec3::Z; 3]);
    // A normal that is zero or NaN is replaced alone.
    let normals = file.floats(&[0.0, 0.6, 0.8, 0.0, 0.0, 0.0, f32::NAN, 0.0, 0.0], "VEC3");
    file.primitive()["attributes"]["NORMAL"] = json!(normals);
    assert_eq!(scene(&file).triangles[0].normals, [Vec3::new(0.0, 0.6, 0.8), Vec3::Z, Vec3::Z]);
}

#[test]
fn transforms_of_a_node_tree_and_instances() {
    let mut file = with_normals();
    // Turned by 90° about +y (x to −z), then moved by the parent; and once more as an instance, twice as large.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    file.json["nodes"] = json!([
        {"translation": [1, 2, 3], "children": [1]},
        {"rotation": [0, half, 0, half], "mesh": 0},
        {"matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 10, 0, 0, 1], "mesh": 0},
    ]);
    file.json["scenes"][0]["nodes"] = json!([0, 2]);
    let scene = scene(&file);
    assert_eq!(scene.triangles.len(), 2);
    let [turned, large] = [&scene.triangles[0], &scene.triangles[1]];
    let expected = [Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 2.0, 2.0), Vec3::new(1.0, 3.0, 3.0)];
    for (found, expected) in turned.positions.iter().zip(expected) {
        assert!(found.distance(expected) < 1e-6, "{found} {expected}");
    }
    assert!(turned.normals[0].distance(Vec3::X) < 1e-6);
    assert_eq!(large.positions, [Vec3::new(10.0, 0.0, 0.0), Vec3::new(12.0, 0.0, 0.0), Vec3::new(10.0, 2.0, 0.0)]);
    assert_eq!(large.normals, [Vec3::Z; 3]);
    assert_ne!(turned.instance, large.instance);
    assert_eq!(turned.material, large.material);
}

#[test]
fn a_mirrored_instance_keeps_its_front() {
    let mut file = with_normals();
    file.json["nodes"][0]["scale"] = json!([-1, 1, 1]);
    let triangle = &scene(&file).triangles[0];
    // x becomes −x; seen from +z the corners would turn clockwise, so that two of them change places.
    assert_eq!(triangle.positions, [Vec3::ZERO, Vec3::Y, Vec3::NEG_X]);
    assert_eq!(triangle.normal(), DVec3::Z);
    assert_eq!(triangle.normals, [Vec3::Z; 3]);
    // All three axes mirrored: the front, too, looks the other way.
    file.json["nodes"][0]["scale"] = json!([-1, -1, -1]);
    let triangle = &scene(&file).triangles[0];
    assert_eq!((triangle.normal(), triangle.normals[0]), (DVec3::NEG_Z, Vec3::NEG_Z));
}

#[test]
fn normals_stay_square_to_a_stretched_surface() {
    let mut file = Builder::empty();
    let material = file.push("materials", json!({"emissiveFactor": [1, 1, 1]}));
    let mesh = file.mesh(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], &[0, 1, 2], material);
    let slanted = [1.0f32 / 3.0f32.sqrt(); 9];
    let normals = file.floats(&slanted, "VEC3");
    file.primitive()["attributes"]["NORMAL"] = json!(normals);
    file.node(json!({"mesh": mesh, "scale": [4, 1, 0.5]}));
    let triangle = &scene(&file).triangles[0];
    assert!(triangle.normals[0].as_dvec3().distance(triangle.normal()) < 1e-6);
    // Flattened to nothing along one axis, the surface still has a normal.
    file.json["nodes"][0]["scale"] = json!([4, 1, 0]);
    let triangle = &scene(&file).triangles[0];
    assert_eq!((triangle.normals[0], triangle.normal()), (Vec3::Z, DVec3::Z));
}

#[test]
fn strips_fans_and_triangles_without_indices() {
    let mut file = Builder::empty();
    let material = file.push("materials", json!({"emissiveFactor": [1, 1, 1]}));
    let mesh = file.mesh(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0], &[0, 1, 2, 3], material);
    file.node(json!({"mesh": mesh}));
    file.primitive()["mode"] = json!(5);
    let strip = scene(&file);
    assert!(strip.triangles.len() == 2 && strip.triangles.iter().all(|t| t.normal() == DVec3::Z));
    file.primitive().as_object_mut().expect("primitive").remove("indices");
    assert_eq!(scene(&file).triangles.len(), 2);
    // A list of four corners is one triangle and a leftover.
    file.primitive()["mode"] = json!(4);
    let loaded = file.load().expect("loads");
    assert!(loaded.scene.triangles.len() == 1 && warns(&loaded, "incomplete triangle"));
    // The fan 0 1 3 2 is the same square.
    let bytes = [0u8, 1, 3, 2];
    let indices = file.accessor(&bytes, U8, "SCALAR", 4);
    file.primitive()["indices"] = json!(indices);
    file.primitive()["mode"] = json!(6);
    let fan = scene(&file);
    assert!(fan.triangles.len() == 2 && fan.triangles.iter().all(|t| t.normal() == DVec3::Z));
    assert!((fan.triangles.iter().map(holodrive::scene::Triangle::area).sum::<f64>() - 1.0).abs() < 1e-12);
}

#[test]
fn points_lines_and_triangles_without_area_are_left_out_with_a_warning() {
    let mut file = Builder::triangle();
    let mut lines = file.primitive().clone();
    lines["mode"] = json!(1);
    file.json["meshes"][0]["primitives"].as_array_mut().expect("primitives").push(lines);
    let bytes: Vec<u8> = [0u32, 1, 2, 1, 1, 2].iter().flat_map(|i| i.to_le_bytes()).collect();
    let indices = file.accessor(&bytes, U32, "SCALAR", 6);
    file.primitive()["indices"] = json!(indices);
    let loaded = file.load().expect("loads");
    assert_eq!(loaded.scene.triangles.len(), 1);
    assert!(warns(&loaded, "1 triangles without area") && warns(&loaded, "1 primitives are points or lines"));
}

#[test]
fn strided_normalised_and_sparse_data() {
    let mut file = Builder::triangle();
    // Positions and texture coordinates interleaved: 12 + 4 bytes, the coordinates as normalised u16.
    let mut bytes = Vec::new();
    for (p, uv) in [([0.0f32, 0.0, 0.0], [0u16, 65535]), ([3.0, 0.0, 0.0], [65535, 0]), ([0.0, 3.0, 0.0], [13107, 0])] {
        bytes.extend(bytes_of(&p));
        bytes.extend(uv.iter().flat_map(|c| c.to_le_bytes()));
    }
    let view = file.view(&bytes);
    file.json["bufferViews"][view]["byteStride"] = json!(16);
    let positions =
        file.push("accessors", json!({"bufferView": view, "componentType": 5126, "type": "VEC3", "count": 3}));
    let uv = file.push(
        "accessors",
        json!({"bufferView": view, "byteOffset": 12, "componentType": U16, "type": "VEC2", "count": 3, "normalized": true}),
    );
    let colors = file.accessor(&[255, 0, 51, 255, 0, 255, 0, 0, 0, 0, 255, 9], U8, "VEC4", 3);
    file.json["accessors"][colors]["normalized"] = json!(true);
    file.primitive()["attributes"] = json!({"POSITION": positions, "TEXCOORD_1": uv, "COLOR_0": colors});
    let plain = scene(&file);
    let triangle = &plain.triangles[0];
    assert_eq!(triangle.positions, [Vec3::ZERO, Vec3::X * 3.0, Vec3::Y * 3.0]);
    assert_eq!(triangle.texcoords.map(|t| t[1]), [Vec2::new(0.0, 1.0), Vec2::X, Vec2::new(0.2, 0.0)]);
    assert_eq!(triangle.texcoords.map(|t| t[0]), [Vec2::ZERO; 3]);
    assert_eq!(triangle.colors, [Vec3::new(1.0, 0.0, 0.2), Vec3::Y, Vec3::Z]);

    // A sparse part replaces the second position; with no view below it, the others are zeros.
    let at = file.view(&[1]);
    let values = file.view(&bytes_of(&[7.0, 8.0, 9.0]));
    file.json["accessors"][positions]["sparse"] =
        json!({"count": 1, "indices": {"bufferView": at, "componentType": U8}, "values": {"bufferView": values}});
    let replaced = scene(&file);
    assert_eq!(replaced.triangles[0].positions, [Vec3::ZERO, Vec3::new(7.0, 8.0, 9.0), Vec3::Y * 3.0]);
    file.json["accessors"][positions].as_object_mut().expect("accessor").remove("bufferView");
    assert!(file.load().is_err_and(|why| why.to_string().contains("no triangle")));
}

#[test]
fn external_files_data_uris_and_names_with_spaces() {
    let folder = tempfile::tempdir().expect("folder");
    std::fs::create_dir(folder.path().join("parts")).expect("folder");
    let mut file = Builder::triangle();
    std::fs::write(folder.path().join("parts/room ü.bin"), &file.data).expect("write");
    file.json["buffers"] = json!([{"byteLength": file.data.len(), "uri": "parts/room%20%C3%BC.bin"}]);
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, file.json.to_string()).expect("write");
    let external = load(&path, &LoadOptions::default()).expect("external buffer");
    assert_eq!(external.scene.triangles[0].positions[1], Vec3::X);
    std::fs::remove_file(folder.path().join("parts/room ü.bin")).expect("remove");
    let error = load(&path, &LoadOptions::default()).expect_err("the buffer is gone").to_string();
    assert!(error.contains("scene.gltf") && error.contains("room ü.bin") && error.contains("No such file"), "{error}");
}

#[test]
fn cameras_lose_scale_and_keep_their_order() {
    let mut file = Builder::triangle();
    let lens = json!({"yfov": 0.5, "znear": 0.1, "aspectRatio": 1.5});
    let wide = file.push("cameras", json!({"type": "perspective", "perspective": lens, "name": "wide"}));
    let flat = json!({"xmag": 2, "ymag": 1, "znear": 0, "zfar": 1});
    let plan = file.push("cameras", json!({"type": "orthographic", "orthographic": flat}));
    file.node(json!({"camera": wide, "translation": [0, 0, 5], "scale": [2, 3, 4], "name": "front"}));
    file.node(json!({"camera": plan, "name": "above"}));
    let loaded = file.load().expect("loads");
    assert_eq!(loaded.warnings, []);
    let camera = &loaded.scene.cameras[0];
    assert_eq!((camera.name.as_str(), camera.eye()), ("wide", DVec3::new(0.0, 0.0, 5.0)));
    assert_eq!(camera.projection, Projection::Perspective { yfov: 0.5, aspect: Some(1.5) });
    assert!(camera.ray(0.5, 0.5, 1.0).direction.distance(DVec3::NEG_Z) < 1e-12);
    assert_eq!(camera.world_from_camera.determinant(), 1.0);
    assert_eq!(loaded.scene.cameras[1].projection, Projection::Orthographic { xmag: 2.0, ymag: 1.0 });

    for choice in ["above".into(), Choice::Index(1)] {
        let options = LoadOptions { camera: Some(choice), ..LoadOptions::default() };
        let names: Vec<String> =
            file.load_with(&options).expect("loads").scene.cameras.iter().map(|c| c.name.clone()).collect();
        assert_eq!(names, ["above", "wide"]);
    }
    let by_node = LoadOptions { camera: Some("front".into()), ..LoadOptions::default() };
    assert_eq!(file.load_with(&by_node).expect("loads").scene.cameras[0].name, "wide");

    file.json["nodes"][1]["scale"] = json!([-1, 1, 1]);
    let mirrored = file.load().expect("loads");
    assert!(warns(&mirrored, "mirroring"));
    assert_eq!(mirrored.scene.cameras[0].world_from_camera.determinant(), 1.0);
}

#[test]
fn without_a_camera_one_frames_the_scene() {
    for (scale, place) in [(1.0, 0.0), (0.001, 3.0), (500.0, -1e4)] {
        let mut file = Builder::triangle();
        file.json["nodes"][0]["scale"] = json!([scale, scale, scale]);
        file.json["nodes"][0]["translation"] = json!([place, place, 0]);
        let loaded = file.load().expect("loads");
        assert!(warns(&loaded, "no camera"));
        let camera = &loaded.scene.cameras[0];
        let mut widest = 0.0f64;
        for corner in loaded.scene.triangles[0].corners() {
            let p = camera.world_from_camera.inverse().transform_point3(corner);
            let (half, _) = camera.half_size(1.0);
            assert!(p.z < 0.0);
            widest = widest.max((p.x / -p.z / half).abs()).max((p.y / -p.z / half).abs());
        }
        // 1e-3: at a distance of 1e4 units from the origin, f32 positions are rounded by that part of a unit.
        assert!((widest - 0.95).abs() < 2e-3, "{widest}");
    }
}

#[test]
fn punctual_lights() {
    let mut file = Builder::triangle();
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "directional", "color": [1, 0.5, 0], "intensity": 4},
        {"type": "point", "range": 9},
        {"type": "spot", "spot": {"innerConeAngle": 0.2}, "intensity": 2},
    ]}});
    for (light, node) in
        [json!({"rotation": [-1, 0, 0, 1]}), json!({"translation": [1, 2, 3]}), json!({})].into_iter().enumerate()
    {
        let mut node = node;
        node["extensions"] = json!({"KHR_lights_punctual": {"light": light}});
        node["scale"] = json!([3, 3, 3]);
        file.node(node);
    }
    let lights = &scene(&file).lights;
    // Turned by −90° about +x, the node's −z points down.
    assert_eq!((lights[0].kind, lights[0].intensity), (LightKind::Directional, Vec3::new(4.0, 2.0, 0.0)));
    assert!(lights[0].direction.distance(Vec3::NEG_Y) < 1e-6);
    assert_eq!(
        (lights[1].kind, lights[1].position, lights[1].range),
        (LightKind::Point, Vec3::new(1.0, 2.0, 3.0), 9.0)
    );
    assert_eq!(lights[2].kind, LightKind::Spot { inner: 0.2, outer: std::f32::consts::FRAC_PI_4 });
    assert_eq!((lights[2].direction, lights[2].range), (Vec3::NEG_Z, f32::INFINITY));
}

#[test]
fn without_light_a_stated_one_stands_in() {
    let mut file = Builder::triangle();
    file.json["materials"] = json!([{"pbrMetallicRoughness": {"metallicFactor": 0}}]);
    let loaded = file.load().expect("loads");
    assert!(warns(&loaded, "no light") && warns(&loaded, "studio"));
    // Its key stands where the viewer's upper left is, and is brighter than what is at the lower right.
    let around = loaded.scene.environment.as_ref().expect("a studio");
    let axis = |a: DVec3| loaded.scene.cameras[0].world_from_camera.transform_vector3(a).normalize();
    let at = |a: DVec3| around.radiance(axis(a)).x;
    assert!(at(DVec3::new(-0.5, 0.8, 0.6)) > 10.0 * at(DVec3::new(0.5, -0.8, 0.6)), "{}", around.mean());
    assert!(loaded.scene.lights.is_empty());

    // Inside of walls it would be dark: there the light comes from the camera.
    let mut room = Builder::empty();
    room.push("materials", json!({"pbrMetallicRoughness": {"metallicFactor": 0}, "doubleSided": true}));
    let corner = |i: u32| [i & 1, i >> 1 & 1, i >> 2].map(|bit| 2.0 * bit as f32 - 1.0);
    let corners: Vec<f32> = (0..8).flat_map(corner).collect();
    let walls = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    let indices: Vec<u16> = walls.iter().flat_map(|[a, b, c, d]| [*a, *b, *c, *a, *c, *d]).collect();
    let mesh = room.mesh(&corners, &indices, 0);
    room.node(json!({"mesh": mesh}));
    room.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.01}}));
    room.node(json!({"camera": 0}));
    let inside = room.load().expect("loads");
    assert!(warns(&inside, "walls") && inside.scene.environment.is_none(), "{:?}", inside.warnings);
    let [key, fill] = inside.scene.lights.as_slice() else { panic!("two lights stand in") };
    assert_eq!((key.kind, fill.kind), (LightKind::Directional, LightKind::Eye));
    // The key light falls on what the camera sees; the fill light's irradiance at the middle is what is stated, for half the
    // diagonal, since the camera stands there.
    let view = inside.scene.cameras[0].ray(0.5, 0.5, 1.0).direction.as_vec3();
    assert!(key.direction.dot(view) > 0.3 && key.direction.y < 0.0);
    assert!((fill.intensity.x / 3.0 - 0.8).abs() < 1e-4);

    // On request light from the viewer is added to a file's own, without a word.
    let own = Builder::triangle().load().expect("an emitter").scene;
    let options = LoadOptions { viewer_light: true, ..LoadOptions::default() };
    let both = Builder::triangle().load_with(&options).expect("an emitter");
    assert!(own.lights.is_empty() && both.scene.lights.len() == 2 && !warns(&both, "no light"));

    // What is unlit shows without light.
    file.json["materials"] = json!([{"extensions": {"KHR_materials_unlit": {}}}]);
    let unlit = file.load().expect("loads");
    assert!(unlit.scene.lights.is_empty() && unlit.scene.environment.is_none() && !warns(&unlit, "no light"));
}

#[test]
fn scenes_of_a_file() {
    let mut file = Builder::triangle();
    file.node(json!({"mesh": 0, "translation": [5, 0, 0]}));
    file.json["scenes"] = json!([{"nodes": [0]}, {"nodes": [1], "name": "aside"}]);
    let at = |file: &Builder, scene: Option<Choice>| {
        let options = LoadOptions { scene, ..LoadOptions::default() };
        file.load_with(&options).expect("loads").scene.triangles[0].positions[0].x
    };
    assert_eq!(at(&file, None), 0.0);
    assert_eq!(at(&file, Some("aside".into())), 5.0);
    file.json["scene"] = json!(1);
    assert_eq!(at(&file, None), 5.0);
    assert_eq!(at(&file, Some("0".into())), 0.0);
    // Without scenes everything is shown.
    let object = file.json.as_object_mut().expect("object");
    object.remove("scene");
    object.remove("scenes");
    assert_eq!(scene(&file).triangles.len(), 2);
}
