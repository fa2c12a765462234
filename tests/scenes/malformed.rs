//! Malformed files: each is refused in one line that says what is wrong; none ends the process.

use super::builder::{Builder, F32, U16, assert_refused, bytes_of, load_bytes};
use holodrive::scene::gltf::{Choice, Clip, LoadOptions, MAX_TRIANGLES, load};
use serde_json::json;
use std::path::Path;

/// The triangle file after `change`, which must be refused.
fn refused(words: &str, change: impl FnOnce(&mut Builder)) {
    let mut file = Builder::triangle();
    change(&mut file);
    assert_refused(file.load(), words);
}

#[test]
fn the_file_that_the_others_are_made_from_is_good() {
    assert_eq!(Builder::triangle().load().expect("loads").scene.triangles.len(), 1);
}

#[test]
fn a_missing_file_or_folder() {
    assert_refused(load(Path::new("/no/such/scene.gltf"), &LoadOptions::default()), "/no/such/scene.gltf");
    let folder = tempfile::tempdir().expect("folder");
    assert_refused(load(folder.path(), &LoadOptions::default()), "folder");
}

#[test]
fn every_truncation_of_a_glb() {
    let whole = Builder::triangle().glb();
    for length in 0..whole.len() {
        let error = load_bytes(&whole[..length], &LoadOptions::default()).expect_err("a truncated file");
        let text = error.to_string();
        assert!(matches!(error, holodrive::Error::Input { .. }) && !text.contains('\n'), "{length}: {text}");
        if length > 12 {
            assert!(text.contains("cut short"), "{length}: {text}");
        }
    }
}

#[test]
fn glb_headers_that_lie() {
    let whole = Builder::triangle().glb();
    let changed = |at: usize, value: u32| {
        let mut bytes = whole.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        load_bytes(&bytes, &LoadOptions::default())
    };
    assert_refused(changed(4, 1), "version 1");
    assert_refused(changed(8, u32::MAX), "cut short");
    assert_refused(changed(8, 5), "no JSON chunk");
    assert_refused(changed(12, u32::MAX), "cut short");
    assert_refused(changed(16, 0), "no JSON chunk");
    assert_refused(load_bytes(b"glTF", &LoadOptions::default()), "cut short");
    assert_refused(load_bytes(b"", &LoadOptions::default()), "not a glTF 2.0 file");
    assert_refused(load_bytes(b"\x89PNG\r\n", &LoadOptions::default()), "not a glTF 2.0 file");
    let old = br#"{"asset": {"version": "1.0"}, "scenes": {"a": {}}}"#;
    assert_refused(load_bytes(old, &LoadOptions::default()), "glTF 1.0");
    refused("glTF 2.1", |f| f.json["asset"]["minVersion"] = json!("2.1"));
}

#[test]
fn deeply_nested_json_does_not_overflow_the_stack() {
    let text = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    assert_refused(load_bytes(text.as_bytes(), &LoadOptions::default()), "not a glTF 2.0 file");
}

#[test]
fn buffers_that_are_not_there() {
    refused("gone.bin", |f| f.json["buffers"] = json!([{"byteLength": 48, "uri": "gone.bin"}]));
    refused("relative to the scene", |f| {
        f.json["buffers"] = json!([{"byteLength": 48, "uri": "http://example.org/x"}])
    });
    refused("buffer 0: it promises 1000 bytes", |f| f.json["buffers"] = json!([{"byteLength": 1000}]));
    refused("buffer 1: it has no URI", |f| f.json["buffers"] = json!([{"byteLength": 42}, {"byteLength": 1}]));
    refused("buffer 9, which is not there", |f| f.json["bufferViews"][0]["buffer"] = json!(9));
    refused("base64", |f| f.json["buffers"] = json!([{"byteLength": 3, "uri": "data:;base64,A*BC"}]));
    let text = Builder::triangle().json.to_string();
    assert_refused(load_bytes(text.as_bytes(), &LoadOptions::default()), "buffer 0, which is not there");
}

#[test]
fn accessors_past_their_buffer() {
    refused("past the end", |f| f.json["accessors"][0]["count"] = json!(4));
    refused("past the end", |f| f.json["accessors"][0]["byteOffset"] = json!(1));
    refused("past the end", |f| f.json["accessors"][0]["byteOffset"] = json!(u64::MAX));
    refused("past the end", |f| f.json["accessors"][0]["byteOffset"] = json!(u64::MAX - 40));
    refused("past the end", |f| f.json["bufferViews"][0]["byteStride"] = json!(16));
    refused("past the end", |f| f.json["bufferViews"][0]["byteStride"] = json!(usize::MAX));
    refused("past the end", |f| f.json["bufferViews"][0]["byteLength"] = json!(35));
    refused("past the end of buffer 0", |f| f.json["bufferViews"][1]["byteLength"] = json!(100));
    refused("past the end of buffer 0", |f| f.json["bufferViews"][1]["byteOffset"] = json!(u64::MAX));
    refused("stride of 4", |f| f.json["bufferViews"][0]["byteStride"] = json!(4));
    refused("largest array", |f| f.json["accessors"][0]["count"] = json!(u64::MAX));
    refused("unknown component type", |f| f.json["accessors"][0]["componentType"] = json!(5124));
    refused("3 are needed", |f| f.json["accessors"][0]["type"] = json!("VEC2"));
    refused("unsigned integer", |f| f.json["accessors"][1]["componentType"] = json!(F32));
    refused("not there", |f| f.primitive()["attributes"]["POSITION"] = json!(77));
    refused("not there", |f| f.primitive()["indices"] = json!(77));
    refused("not there", |f| f.primitive()["material"] = json!(77));
    refused("not there", |f| f.json["accessors"][0]["bufferView"] = json!(77));
    refused("no POSITION", |f| f.primitive()["attributes"] = json!({}));
}

#[test]
fn counts_without_data_take_no_memory() {
    // A sparse accessor's zeros need no bytes, so that the count alone would decide how much is allocated.
    refused("more than 10000000 triangles", |f| {
        f.json["accessors"][0] = json!({"componentType": F32, "type": "VEC3", "count": 80_000_000, "sparse": {
            "count": 1, "indices": {"bufferView": 1, "componentType": U16}, "values": {"bufferView": 0}}});
    });
    // Many instances of a small mesh.
    refused("more than 10000000 triangles", |f| {
        let corners = vec![0u8; 30_000];
        let view = f.view(&corners);
        f.json["accessors"][1] = json!({"bufferView": view, "componentType": 5121, "type": "SCALAR", "count": 30_000});
        for _ in 0..=MAX_TRIANGLES / 10_000 {
            f.node(json!({"mesh": 0}));
        }
    });
}

#[test]
fn positions_that_are_no_places() {
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        refused("not finite", |f| f.data[16..20].copy_from_slice(&wrong.to_le_bytes()));
    }
    refused("coordinates must be finite", |f| f.data[16..20].copy_from_slice(&1e30f32.to_le_bytes()));
    refused("coordinates must be finite", |f| f.json["nodes"][0]["scale"] = json!([1e20, 1e20, 1e20]));
    refused("not finite", |f| f.json["nodes"][0]["scale"] = json!([1e39, 1, 1]));
    refused("not finite", |f| f.json["nodes"][0]["translation"] = json!([0, -1e39, 1]));
}

#[test]
fn indices_out_of_range() {
    refused("index 3, and only 3 vertices", |f| f.data[38..40].copy_from_slice(&3u16.to_le_bytes()));
    refused("index 65535", |f| f.data[40..42].copy_from_slice(&u16::MAX.to_le_bytes()));
    refused("for 3 vertices", |f| {
        let uv = f.floats(&[0.0; 4], "VEC2");
        f.primitive()["attributes"]["TEXCOORD_0"] = json!(uv);
    });
}

#[test]
fn nothing_to_see() {
    refused("no triangle", |f| f.json["scenes"][0]["nodes"] = json!([]));
    refused("no triangle", |f| f.json["meshes"][0]["primitives"] = json!([]));
    refused("no triangle", |f| f.primitive()["mode"] = json!(1));
    refused("no triangle", |f| f.json["accessors"][1]["count"] = json!(0));
    // All corners in one place: dropped as degenerate, and nothing is left.
    refused("no triangle", |f| f.data[..36].fill(0));
    assert_refused(Builder::empty().load(), "no triangle");
}

#[test]
fn nodes_that_form_no_tree() {
    refused("ring", |f| f.json["nodes"][0]["children"] = json!([0]));
    refused("ring", |f| {
        f.json["nodes"] = json!([{"mesh": 0, "children": [1]}, {"children": [2]}, {"children": [0]}]);
    });
    refused("two parents", |f| {
        f.json["nodes"] = json!([{"children": [2]}, {"children": [2]}, {"mesh": 0}]);
    });
    refused("twice", |f| f.json["scenes"][0]["nodes"] = json!([0, 0]));
    refused("not there", |f| f.json["nodes"][0]["children"] = json!([5]));
    refused("not there", |f| f.json["scenes"][0]["nodes"] = json!([5]));
    refused("not there", |f| f.json["scene"] = json!(5));
    refused("not there", |f| f.json["nodes"][0]["mesh"] = json!(5));
    refused("not there", |f| f.json["nodes"][0]["camera"] = json!(5));
    refused("not there", |f| f.json["nodes"][0]["skin"] = json!(5));
    refused("not there", |f| f.json["nodes"][0]["extensions"] = json!({"KHR_lights_punctual": {"light": 0}}));
}

#[test]
fn a_deep_tree_is_fine() {
    let mut file = Builder::triangle();
    let depth = 200_000;
    let nodes: Vec<_> = (0..depth).map(|i| json!({"translation": [0.001, 0, 0], "children": [i + 1]})).collect();
    file.json["nodes"] = json!(nodes);
    file.push("nodes", json!({"mesh": 0}));
    let scene = file.load().expect("a deep tree loads").scene;
    assert!((scene.triangles[0].positions[0].x - 200.0).abs() < 1e-3);
}

#[test]
fn extensions_that_are_not_understood() {
    refused("EXT_mesh_of_the_future", |f| f.json["extensionsRequired"] = json!(["EXT_mesh_of_the_future"]));
    let mut file = Builder::triangle();
    file.json["extensionsUsed"] = json!(["KHR_materials_sheen", "KHR_materials_ior"]);
    file.json["extensionsRequired"] = json!(["KHR_materials_ior", "KHR_materials_volume", "KHR_materials_specular"]);
    let warnings = file.load().expect("optional ones are left out").warnings;
    assert!(warnings.iter().any(|w| w.0.contains("KHR_materials_sheen")));
    assert!(!warnings.iter().any(|w| w.0.contains("KHR_materials_ior")));
}

#[test]
fn sparse_parts_out_of_range() {
    let sparse = |f: &mut Builder, at: u16, count: usize| {
        let indices = f.view(&at.to_le_bytes());
        let values = f.view(&bytes_of(&[0.0, 2.0, 0.0]));
        f.json["accessors"][0]["sparse"] = json!({"count": count,
            "indices": {"bufferView": indices, "componentType": U16}, "values": {"bufferView": values}});
    };
    refused("replaces element 3 of an array of 3", |f| sparse(f, 3, 1));
    refused("past the end", |f| sparse(f, 0, 2));
    refused("past the end", |f| sparse(f, 0, usize::MAX));
}

#[test]
fn cameras_lights_and_materials_outside_their_domain() {
    let camera = |f: &mut Builder, camera: serde_json::Value| {
        f.push("cameras", camera);
        f.node(json!({"camera": 0}));
    };
    for (yfov, words) in [(0.0, "yfov 0"), (-1.0, "yfov -1"), (3.2, "below π"), (1e39, "yfov inf")] {
        refused(words, |f| camera(f, json!({"type": "perspective", "perspective": {"yfov": yfov, "znear": 1}})));
    }
    let flat = json!({"yfov": 1, "znear": 1, "aspectRatio": 0});
    refused("aspectRatio 0", |f| camera(f, json!({"type": "perspective", "perspective": flat})));
    refused("neither perspective nor", |f| camera(f, json!({"type": "perspective"})));
    refused("neither perspective nor", |f| camera(f, json!({"type": "fisheye"})));
    refused("no direction", |f| {
        camera(f, json!({"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}));
        f.json["nodes"][1]["scale"] = json!([0, 0, 0]);
    });
    let light = |f: &mut Builder, light: serde_json::Value| {
        f.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [light]}});
        f.node(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    };
    refused("intensity", |f| light(f, json!({"type": "point", "intensity": -1})));
    refused("range", |f| light(f, json!({"type": "point", "range": 0})));
    refused("unknown type", |f| light(f, json!({"type": "laser"})));
    refused("cone angles", |f| light(f, json!({"type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 0.5}})));
    refused("no radiance", |f| f.json["materials"][0]["emissiveFactor"] = json!([1, -1, 1]));
    refused("unknown alphaMode", |f| f.json["materials"][0]["alphaMode"] = json!("SIEVE"));
}

#[test]
fn light_turned_down_to_zero() {
    refused("no intensity", |f| {
        f.json["materials"][0]["extensions"] = json!({"KHR_materials_emissive_strength": {"emissiveStrength": 0}});
    });
    refused("no intensity", |f| {
        f.json["materials"] = json!([{}]);
        f.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 0}]}});
        f.node(json!({"extensions": {"KHR_lights_punctual": {"light": 0}}}));
    });
}

#[test]
fn choices_that_the_file_does_not_have() {
    let file = Builder::triangle();
    let with = |options: LoadOptions| file.load_with(&options);
    assert_refused(with(LoadOptions { camera: Some("side".into()), ..Default::default() }), "no camera 'side'");
    assert_refused(with(LoadOptions { camera: Some(Choice::Index(0)), ..Default::default() }), "no camera number 0");
    assert_refused(with(LoadOptions { scene: Some(Choice::Index(1)), ..Default::default() }), "it has 0");
    assert_refused(with(LoadOptions { clip: Clip::Of("run".into()), ..Default::default() }), "no animation 'run'");
    assert_refused(with(LoadOptions { time: f64::NAN, ..Default::default() }), "not a time");
}
