//! Damaged files of all kinds: whatever the bytes, the answer is a scene or an error, never a panic.

use super::builder::{Builder, U8, U16, load_bytes};
use holodrive::scene::gltf::LoadOptions;
use proptest::prelude::*;
use serde_json::json;
use std::io::Cursor;
use std::sync::LazyLock;

/// A valid file of a few kilobytes that uses about everything the loader reads.
static RICH: LazyLock<Builder> = LazyLock::new(|| {
    let mut file = Builder::triangle();
    let view = |file: &mut Builder, bytes: &[u8]| file.view(bytes);
    let uv = file.accessor(&[0, 0, 255, 255, 0, 0, 0, 255, 0, 0, 0, 0], U8, "VEC2", 3);
    let stretched = file.json["accessors"][uv]["bufferView"].as_u64().expect("view") as usize;
    file.json["bufferViews"][stretched]["byteStride"] = json!(4);
    file.json["accessors"][uv]["normalized"] = json!(true);
    let normals = file.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "VEC3");
    let joints = file.accessor(&[0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0], U8, "VEC4", 3);
    let weights = file.floats(&[1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], "VEC4");
    let target = file.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "VEC3");
    let at = view(&mut file, &1u16.to_le_bytes());
    let values = view(&mut file, &[0; 12]);
    file.json["accessors"][target]["sparse"] =
        json!({"count": 1, "indices": {"bufferView": at, "componentType": U16}, "values": {"bufferView": values}});
    let attributes = &mut file.primitive()["attributes"];
    attributes["NORMAL"] = json!(normals);
    attributes["TEXCOORD_0"] = json!(uv);
    attributes["JOINTS_0"] = json!(joints);
    attributes["WEIGHTS_0"] = json!(weights);
    attributes["COLOR_0"] = json!(normals);
    file.primitive()["targets"] = json!([{"POSITION": target, "NORMAL": target}]);

    let mut png = Vec::new();
    image::RgbImage::new(2, 2).write_to(&mut Cursor::new(&mut png), image::ImageFormat::Png).expect("encode");
    let png = view(&mut file, &png);
    file.push("images", json!({"bufferView": png, "mimeType": "image/png"}));
    file.push("samplers", json!({"magFilter": 9729, "wrapS": 33071}));
    file.push("textures", json!({"source": 0, "sampler": 0}));
    file.json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorTexture": {"index": 0,
        "extensions": {"KHR_texture_transform": {"scale": [2, 2], "rotation": 1}}}});
    file.json["materials"][0]["extensions"] = json!({"KHR_materials_volume": {"thicknessFactor": 1}});

    file.push("cameras", json!({"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}));
    file.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {}}]}});
    file.json["nodes"][0]["skin"] = json!(0);
    file.node(json!({"children": [2, 3], "camera": 0}));
    file.push("nodes", json!({"translation": [0, 1, 0], "extensions": {"KHR_lights_punctual": {"light": 0}}}));
    file.push("nodes", json!({"mesh": 0, "scale": [-1, 1, 1], "weights": [0.5]}));
    file.push("skins", json!({"joints": [1, 2]}));
    let times = file.floats(&[0.0, 1.0], "SCALAR");
    let turns = file.floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0], "VEC4");
    file.push(
        "animations",
        json!({"channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}},
                            {"sampler": 1, "target": {"node": 3, "path": "weights"}}],
               "samplers": [{"input": times, "output": turns}, {"input": times, "output": times}]}),
    );
    file
});

#[test]
fn the_undamaged_file_loads() {
    let loaded = RICH.load().expect("loads");
    assert_eq!((loaded.warnings.len(), loaded.scene.triangles.len()), (0, 2), "{:?}", loaded.warnings);
    assert_eq!((loaded.scene.textures.len(), loaded.scene.lights.len(), loaded.scene.cameras.len()), (1, 1, 1));
}

/// Loads at a time between keys. The value is of no matter here: it is enough that the call returns.
fn survives(bytes: &[u8]) {
    let options = LoadOptions { time: 0.5, ..LoadOptions::default() };
    if let Err(error) = load_bytes(bytes, &options) {
        let text = error.to_string();
        assert!(!text.contains('\n'), "not one line: {text}");
    }
}

/// Replaces the `which`-th number of a JSON text.
fn with_number(text: &str, which: usize, value: &str) -> String {
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+' | 'e' | 'E');
    let mut numbers = Vec::new();
    let (mut start, mut in_string) = (None, false);
    for (at, c) in text.char_indices() {
        in_string ^= c == '"';
        match (start, !in_string && is_part(c)) {
            // Letters of true and false are no numbers.
            (None, true) if c.is_ascii_digit() || c == '-' => start = Some(at),
            (Some(from), false) => {
                numbers.push(from..at);
                start = None;
            }
            _ => {}
        }
    }
    let range = numbers[which % numbers.len()].clone();
    format!("{}{value}{}", &text[..range.start], &text[range.end..])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn flipped_bytes(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let mut bytes = RICH.glb();
        for (at, value) in flips {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        survives(&bytes);
    }

    #[test]
    fn truncated_and_extended(cut in any::<prop::sample::Index>(), tail in prop::collection::vec(any::<u8>(), 0..40)) {
        let mut bytes = RICH.glb();
        bytes.truncate(cut.index(bytes.len()));
        bytes.extend(tail);
        survives(&bytes);
    }

    /// The JSON stays well formed, so that the damage reaches deep into the loader.
    #[test]
    fn changed_numbers(
        changes in prop::collection::vec((any::<usize>(), prop::sample::select(vec![
            "-1", "0", "1", "2", "3", "5", "7", "100", "255", "5120", "5121", "5122", "5123", "5125", "5126", "65536",
            "0.5", "-0.5", "1e-40", "1e39", "-1e39", "1e300", "4294967295", "4294967296", "18446744073709551615", "null",
        ])), 1..4)
    ) {
        let mut file = RICH.clone();
        file.json["buffers"] = json!([{"byteLength": file.data.len()}]);
        let mut text = file.json.to_string();
        for (which, value) in changes {
            text = with_number(&text, which, value);
        }
        if let Ok(json) = serde_json::from_str(&text) {
            file.json = json;
            survives(&file.glb());
        }
    }

    #[test]
    fn changed_data(words in prop::collection::vec((any::<prop::sample::Index>(), any::<u32>()), 1..8)) {
        let mut file = RICH.clone();
        for (at, value) in words {
            let at = at.index(file.data.len() - 3);
            file.data[at..at + 4].copy_from_slice(&value.to_le_bytes());
        }
        survives(&file.glb());
    }
}
