//! Meshes of other kinds of files, told as glTF so that one reader gives them cameras, light, materials and checks.

mod obj;
mod stl;

use super::resources::Source;
use crate::scene::Warning;
use serde_json::{Value, json};
use std::path::Path;

/// A file in glTF's words: its JSON, and its only buffer.
pub(super) struct Converted {
    pub(super) file: Value,
    pub(super) buffer: Vec<u8>,
    /// URIs of further files that it was read from, images apart.
    pub(super) beside: Vec<String>,
}

/// Reads meshes by the file's ending; `None` for one that is glTF itself. The error is one line without the file's path.
pub(super) fn convert(source: Source, bytes: &[u8], warnings: &mut Vec<Warning>) -> Result<Option<Converted>, String> {
    match ending(source.scene).as_str() {
        "obj" => obj::convert(source, bytes, warnings).map(Some),
        "stl" => stl::convert(bytes, warnings).map(Some),
        _ => Ok(None),
    }
}

/// Whether a file is a scene: STL, or glTF and OBJ with surfaces (without, they are clouds); and an embedded scene's name is one.
pub fn is_scene(path: &Path) -> bool {
    match ending(path).as_str() {
        "gltf" | "glb" => !super::has_only_points(path),
        "stl" => true,
        "obj" => obj::has_faces(path),
        _ => super::embedded(path).is_some(),
    }
}

fn ending(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Arrays as accessors of one buffer.
#[derive(Default)]
struct Arrays {
    buffer: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Arrays {
    /// Adds elements of `N` numbers; its accessor.
    fn vectors<const N: usize>(&mut self, elements: &[[f32; N]]) -> usize {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        self.add(bytemuck::cast_slice(elements), elements.len(), 5126, kind)
    }

    fn indices(&mut self, corners: &[u32]) -> usize {
        self.add(bytemuck::cast_slice(corners), corners.len(), 5125, "SCALAR")
    }

    fn add(&mut self, bytes: &[u8], count: usize, component: u32, kind: &str) -> usize {
        self.views.push(json!({"buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len()}));
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1, "componentType": component, "count": count, "type": kind
        }));
        self.buffer.extend_from_slice(bytes);
        self.accessors.len() - 1
    }

    /// The whole file: one mesh of these primitives on one node.
    fn file(self, primitives: Vec<Value>, node: Value, more: Value) -> Converted {
        let mut file = json!({
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [node],
            "meshes": [{"primitives": primitives}],
            "buffers": [{"byteLength": self.buffer.len()}],
            "bufferViews": self.views,
            "accessors": self.accessors
        });
        if let (Some(file), Value::Object(more)) = (file.as_object_mut(), more) {
            file.extend(more);
        }
        Converted { file, buffer: self.buffer, beside: Vec::new() }
    }
}

#[cfg(test)]
mod tests;
