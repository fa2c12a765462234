//! Poses: node, skin and morph animation.

use super::builder::{Builder, U8, assert_refused, bytes_of};
use glam::Vec3;
use holodrive::scene::gltf::{Clip, LoadOptions};
use serde_json::{Value, json};

fn corners_at(file: &Builder, time: f64) -> [Vec3; 3] {
    let options = LoadOptions { time, ..LoadOptions::default() };
    file.load_with(&options).expect("loads").scene.triangles[0].positions
}

fn close(found: Vec3, expected: Vec3) {
    assert!(found.distance(expected) < 1e-5, "{found} instead of {expected}");
}

/// Adds an animation of node 0 with keys at 1 s and 3 s.
fn animate(file: &mut Builder, path: &str, kind: &str, values: &[f32], interpolation: &str) {
    let times = file.floats(&[1.0, 3.0], "SCALAR");
    let values = file.floats(values, kind);
    file.push(
        "animations",
        json!({"name": path, "channels": [{"sampler": 0, "target": {"node": 0, "path": path}}],
               "samplers": [{"input": times, "output": values, "interpolation": interpolation}]}),
    );
}

#[test]
fn linear_step_and_held_ends() {
    let mut file = Builder::triangle();
    animate(&mut file, "translation", "VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 8.0], "LINEAR");
    for (time, x) in [(-1.0, 0.0), (0.0, 0.0), (1.0, 0.0), (2.5, 3.0), (3.0, 4.0), (99.0, 4.0)] {
        close(corners_at(&file, time)[0], Vec3::new(x, 0.0, 2.0 * x));
    }
    file.json["animations"][0]["samplers"][0]["interpolation"] = json!("STEP");
    for (time, x) in [(0.0, 0.0), (2.999, 0.0), (3.0, 4.0), (4.0, 4.0)] {
        close(corners_at(&file, time)[0], Vec3::new(x, 0.0, 2.0 * x));
    }
}

#[test]
fn rotation_takes_the_great_arc_at_constant_speed() {
    let mut file = Builder::triangle();
    let (sin, cos) = std::f32::consts::FRAC_PI_3.sin_cos();
    // From 0 to 120° about +z; the second key with its sign turned, which means the same rotation.
    animate(&mut file, "rotation", "VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -sin, -cos], "LINEAR");
    for part in [0.0f32, 0.25, 0.5, 0.9, 1.0] {
        let (sin, cos) = (part * 120.0).to_radians().sin_cos();
        close(corners_at(&file, 1.0 + 2.0 * f64::from(part))[1], Vec3::new(cos, sin, 0.0));
    }
}

#[test]
fn cubic_splines_follow_a_cubic() {
    // x(t) = t³ − t on [1, 3] with its own derivatives as tangents: Hermite interpolation gives back every cubic.
    let (x, dx) = (|t: f32| t * t * t - t, |t: f32| 3.0 * t * t - 1.0);
    let vector = |v: f32| [v, 0.0, 0.0];
    let values: Vec<f32> =
        [1.0, 3.0].iter().flat_map(|&t| [vector(dx(t)), vector(x(t)), vector(dx(t))].concat()).collect();
    let mut file = Builder::triangle();
    animate(&mut file, "translation", "VEC3", &values, "CUBICSPLINE");
    for t in [1.0f32, 1.3, 2.0, 2.9, 3.0] {
        let found = corners_at(&file, f64::from(t))[0].x;
        assert!((found - x(t)).abs() < 1e-4, "{t}: {found} instead of {}", x(t));
    }
}

#[test]
fn clips_are_chosen_by_name_or_number_or_left_out() {
    let mut file = Builder::triangle();
    animate(&mut file, "translation", "VEC3", &[5.0, 0.0, 0.0, 5.0, 0.0, 0.0], "LINEAR");
    animate(&mut file, "scale", "VEC3", &[2.0, 2.0, 2.0, 2.0, 2.0, 2.0], "LINEAR");
    let second_corner = |clip: Clip| {
        let options = LoadOptions { clip, ..LoadOptions::default() };
        file.load_with(&options).expect("loads").scene.triangles[0].positions[1].x
    };
    assert_eq!(second_corner(Clip::First), 6.0);
    assert_eq!(second_corner(Clip::Rest), 1.0);
    assert_eq!(second_corner(Clip::Of("scale".into())), 2.0);
    assert_eq!(second_corner(Clip::Of("1".into())), 2.0);
}

#[test]
fn morph_targets_by_mesh_node_and_animation() {
    let mut file = Builder::triangle();
    let up = file.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "VEC3");
    let aside = file.floats(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0], "VEC3");
    file.primitive()["targets"] = json!([{"POSITION": up}, {"POSITION": aside, "NORMAL": up}]);
    assert_eq!(corners_at(&file, 0.0)[1], Vec3::X);
    file.json["meshes"][0]["weights"] = json!([0.5, 0]);
    close(corners_at(&file, 0.0)[1], Vec3::new(1.0, 0.0, 0.5));
    file.json["nodes"][0]["weights"] = json!([0.0, 1.5]);
    close(corners_at(&file, 0.0)[1], Vec3::new(4.0, 0.0, 0.0));
    animate(&mut file, "weights", "SCALAR", &[0.0, 0.0, 1.0, 0.5], "LINEAR");
    close(corners_at(&file, 1.0)[1], Vec3::X);
    close(corners_at(&file, 2.0)[1], Vec3::new(1.5, 0.0, 0.5));
    close(corners_at(&file, 3.0)[1], Vec3::new(2.0, 0.0, 1.0));
}

/// A triangle on two joints: its third corner hangs on the second, its second half on each.
fn skinned() -> Builder {
    let mut file = Builder::triangle();
    let joints = file.accessor(&[0, 0, 0, 0, 0, 1, 0, 0, 1, 99, 0, 0], U8, "VEC4", 3);
    let weights = file.floats(&[1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0], "VEC4");
    file.primitive()["attributes"]["JOINTS_0"] = json!(joints);
    file.primitive()["attributes"]["WEIGHTS_0"] = json!(weights);
    let root = file.node(json!({"children": [2]}));
    let tip = file.push("nodes", json!({"translation": [0, 1, 0]}));
    let mut inverse = [0.0f32; 32];
    for m in [0, 16] {
        for d in [0, 5, 10, 15] {
            inverse[m + d] = 1.0;
        }
    }
    inverse[16 + 13] = -1.0;
    let inverse = file.floats(&inverse, "MAT4");
    file.push("skins", json!({"joints": [root, tip], "inverseBindMatrices": inverse}));
    file.json["nodes"][0]["skin"] = json!(0);
    // A skinned mesh ignores its node's own transform.
    file.json["nodes"][0]["translation"] = json!([100, 0, 0]);
    file
}

#[test]
fn skins_at_bind_pose_and_bent() {
    let mut file = skinned();
    for (found, expected) in corners_at(&file, 0.0).into_iter().zip([Vec3::ZERO, Vec3::X, Vec3::Y]) {
        close(found, expected);
    }
    // The tip moves by (0, 0, 2): its corner follows, the shared corner half way.
    file.json["nodes"][2]["translation"] = json!([0, 1, 2]);
    let bent = corners_at(&file, 0.0);
    close(bent[0], Vec3::ZERO);
    close(bent[1], Vec3::new(1.0, 0.0, 1.0));
    close(bent[2], Vec3::new(0.0, 1.0, 2.0));
    // A joint that mirrors turns the winding, and the front stays in front.
    file.json["nodes"][1]["scale"] = json!([-1, 1, 1]);
    let triangle = file.load().expect("loads").scene.triangles[0].clone();
    assert!(triangle.normal().dot(triangle.normals[0].as_dvec3()) > 0.999);
}

#[test]
fn wrong_skins_and_animations_are_refused() {
    let refused = |words: &str, mut file: Builder, at: &str, value: Value| {
        *file.json.pointer_mut(at).expect("a place in the file") = value;
        assert_refused(file.load(), words);
    };
    refused("joint 1 of a skin of 1", skinned(), "/skins/0/joints", json!([1]));
    refused("not there", skinned(), "/skins/0/joints/1", json!(9));
    refused("a skin of 0 joints", skinned(), "/skins/0/joints", json!([]));
    let mut more = skinned();
    more.json["skins"][0]["joints"] = json!([1, 2, 2]);
    assert_refused(more.load(), "fewer inverse bind matrices");

    let mut moving = Builder::triangle();
    animate(&mut moving, "translation", "VEC3", &[0.0; 6], "LINEAR");
    refused("not there", moving.clone(), "/animations/0/channels/0/target/node", json!(9));
    refused("sampler 9", moving.clone(), "/animations/0/channels/0/sampler", json!(9));
    refused("unknown interpolation", moving.clone(), "/animations/0/samplers/0/interpolation", json!("BEZIER"));
    refused(
        "2 values where its key times need 6",
        moving.clone(),
        "/animations/0/samplers/0/interpolation",
        json!("CUBICSPLINE"),
    );
    refused("4 are needed", moving.clone(), "/animations/0/channels/0/target/path", json!("rotation"));
    let times = moving.json["animations"][0]["samplers"][0]["input"].as_u64().expect("accessor") as usize;
    refused("do not increase", moving.clone(), &format!("/accessors/{times}/count"), json!(0));
    let view = moving.json["accessors"][times]["bufferView"].as_u64().expect("view") as usize;
    let at = moving.json["bufferViews"][view]["byteOffset"].as_u64().expect("offset") as usize;
    moving.data[at..at + 8].copy_from_slice(&bytes_of(&[3.0, 1.0]));
    assert_refused(moving.load(), "do not increase");
}
