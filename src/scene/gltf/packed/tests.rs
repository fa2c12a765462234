//! A pyramid without its base, packed by the encoders of both formats.

use crate::scene::gltf::{LoadOptions, load};
use crate::scene::{Scene, Triangle};
use glam::Vec3;
use serde_json::{Value, json};
use std::sync::Arc;

const CORNERS: [[f32; 3]; 5] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.25], [0.0, 1.0, 0.0], [0.5, 0.5, 1.0]];
const TRIANGLES: [[usize; 3]; 4] = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];

/// EdgeBreaker, positions of 14 bits and texture coordinates of 12; texture coordinates are x and y.
const DRACO: &str = "445241434f02020101000000050401040000026f01ff0111ff02444002ff000000000001000903000002010309020001020101\
    01000f07cd0c2b353303f2df82ffffff1f00fcfffebf0080f8ff0080000000f8ff022000000000ff3f00000000000000000000000000000000803f0e\
    010101000d07cd0c23353303f2df82ffffffffefffe8ff000000fe0f00000000ff0f000000000000000000000000803f0c";
const VERTICES: &str = "a000000133000000ffff0133c000007e7d7e0000010cc00000ffff010c0000007e0000010fc00000ffffff010fc000007c7b7e0000000000000000000000000000000000000000000000000000000000000000";
const INDICES: &str = "e1fe1000040f08007687566778a9866589689801690000";

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len() / 2).map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).expect("hex")).collect()
}

fn file(accessors: Value, views: Value, buffers: Value, primitive: Value, name: &str) -> Value {
    json!({
        "asset": {"version": "2.0"}, "extensionsUsed": [name], "extensionsRequired": [name],
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": accessors, "bufferViews": views, "buffers": buffers
    })
}

fn draco(data: &[u8]) -> (Value, Vec<u8>) {
    let told = json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0, "TEXCOORD_0": 1}}});
    let scene = file(
        json!([
            {"componentType": 5123, "count": 12, "type": "SCALAR"},
            {"componentType": 5126, "count": 5, "type": "VEC3"},
            {"componentType": 5126, "count": 5, "type": "VEC2"}
        ]),
        json!([{"buffer": 0, "byteLength": data.len()}]),
        json!([{"byteLength": data.len(), "uri": "data.bin"}]),
        json!({"attributes": {"POSITION": 1, "TEXCOORD_0": 2}, "indices": 0, "extensions": told}),
        "KHR_draco_mesh_compression",
    );
    (scene, data.to_vec())
}

fn meshopt(vertices: &[u8], indices: &[u8], count: usize) -> (Value, Vec<u8>) {
    let name = "EXT_meshopt_compression";
    let at = vertices.len();
    let scene = file(
        json!([
            {"bufferView": 0, "componentType": 5126, "count": 5, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}
        ]),
        json!([
            {"buffer": 1, "byteLength": 12 * count, "byteStride": 12, "extensions": {name: {
                "buffer": 0, "byteOffset": 0, "byteLength": at, "byteStride": 12, "count": count, "mode": "ATTRIBUTES"}}},
            {"buffer": 1, "byteOffset": 12 * count, "byteLength": 24, "extensions": {name: {
                "buffer": 0, "byteOffset": at, "byteLength": indices.len(), "byteStride": 2, "count": 12,
                "mode": "TRIANGLES", "filter": "NONE"}}}
        ]),
        json!([
            {"byteLength": at + indices.len(), "uri": "data.bin"},
            {"byteLength": 12 * count + 24, "extensions": {name: {"fallback": true}}}
        ]),
        json!({"attributes": {"POSITION": 0}, "indices": 1}),
        name,
    );
    (scene, [vertices, indices].concat())
}

fn read((scene, data): &(Value, Vec<u8>)) -> Result<Arc<Scene>, String> {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, scene.to_string()).expect("scene");
    std::fs::write(folder.path().join("data.bin"), data).expect("data");
    load(&path, &LoadOptions::default()).map(|loaded| loaded.scene).map_err(|why| why.to_string())
}

/// Every triangle of the pyramid is there once, in its order of corners, to `error`.
fn check(scene: &Scene, error: f32) {
    assert_eq!(scene.triangles.len(), TRIANGLES.len());
    for wanted in TRIANGLES.map(|triangle| triangle.map(|corner| Vec3::from(CORNERS[corner]))) {
        let is_same = |triangle: &&Triangle| {
            (0..3).any(|turn| (0..3).all(|i| triangle.positions[(i + turn) % 3].distance(wanted[i]) <= error))
        };
        assert_eq!(scene.triangles.iter().filter(is_same).count(), 1, "{wanted:?}");
    }
}

#[cfg(feature = "draco")]
#[test]
fn draco_gives_the_triangles_and_attributes_that_were_packed() {
    let scene = read(&draco(&bytes(DRACO))).expect("scene");
    check(&scene, 1e-4);
    for triangle in &scene.triangles {
        for (position, texcoords) in triangle.positions.iter().zip(&triangle.texcoords) {
            assert!(position.truncate().distance(texcoords[0]) < 5e-4, "{position} {}", texcoords[0]);
        }
    }
}

/// The same vertices in the stream's second version.
#[cfg(feature = "meshopt")]
const NEWER: &str =
    "a1da5ada000800ff007f007e7e001000ff0004007f000800ff00007d7c7f000000000000000000000000000000000000000000010101";

#[cfg(feature = "meshopt")]
#[test]
fn the_second_version_of_meshopt_is_read_where_its_successor_is_named() {
    let (mut scene, data) = meshopt(&bytes(NEWER), &bytes(INDICES), 5);
    assert!(read(&(scene.clone(), data.clone())).expect_err("first").contains("version"));
    let told = scene.to_string().replace("EXT_meshopt_compression", "KHR_meshopt_compression");
    scene = serde_json::from_str(&told).expect("json");
    check(&read(&(scene, data)).expect("scene"), 0.0);
}

#[cfg(feature = "meshopt")]
#[test]
fn meshopt_gives_views_of_which_only_a_fallback_is_named() {
    check(&read(&meshopt(&bytes(VERTICES), &bytes(INDICES), 5)).expect("scene"), 0.0);
}

#[test]
fn damaged_geometry_is_refused_in_one_line() {
    let (whole, vertices, indices) = (bytes(DRACO), bytes(VERTICES), bytes(INDICES));
    let refused = |given: (Value, Vec<u8>)| {
        let said = read(&given).expect_err("refused");
        assert!(!said.contains('\n') && said.len() < 400, "{said}");
    };
    for cut in 0..whole.len() {
        refused(draco(&whole[..cut]));
    }
    for cut in 0..vertices.len() {
        refused(meshopt(&vertices[..cut], &indices, 5));
    }
    refused(meshopt(&vertices, &indices[..9], 5));
    refused(meshopt(&vertices, &indices, 300));
    refused(meshopt(&vertices, &indices, 1 << 40));
    // Any byte turned over: read or refused, never a panic.
    for at in 0..whole.len() {
        for turn in [0x01, 0x80, 0xff] {
            let mut damaged = whole.clone();
            damaged[at] ^= turn;
            read(&draco(&damaged)).err();
        }
    }
}
