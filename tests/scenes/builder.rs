//! Small glTF files made in the test, from JSON and bytes.

use holodrive::scene::gltf::{LoadOptions, Loaded, load};
use serde_json::{Value, json};

/// Component types of the glTF specification.
pub(crate) const U8: u32 = 5121;
pub(crate) const U16: u32 = 5123;
pub(crate) const U32: u32 = 5125;
pub(crate) const F32: u32 = 5126;

/// A file that grows; `json` may be edited freely before it is written.
#[derive(Clone)]
pub(crate) struct Builder {
    pub(crate) json: Value,
    pub(crate) data: Vec<u8>,
}

impl Builder {
    /// A file without nodes.
    pub(crate) fn empty() -> Self {
        let json = json!({
            "asset": {"version": "2.0"},
            "scene": 0, "scenes": [{"nodes": []}],
            "nodes": [], "meshes": [], "materials": [], "accessors": [], "bufferViews": []
        });
        Self { json, data: Vec::new() }
    }

    /// One node with one emitting triangle (0,0,0), (1,0,0), (0,1,0): accessor 0 its positions, 1 its indices (u16).
    pub(crate) fn triangle() -> Self {
        let mut file = Self::empty();
        let material = file.push("materials", json!({"emissiveFactor": [1, 1, 1]}));
        let mesh = file.mesh(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], &[0, 1, 2], material);
        file.node(json!({"mesh": mesh}));
        file
    }

    /// Appends to a top-level array and gives the new element's number.
    pub(crate) fn push(&mut self, array: &str, thing: Value) -> usize {
        if self.json.get(array).is_none() {
            self.json[array] = json!([]);
        }
        let array = self.json[array].as_array_mut().expect("an array");
        array.push(thing);
        array.len() - 1
    }

    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let offset = self.data.len();
        self.data.extend_from_slice(bytes);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    pub(crate) fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "type": kind, "count": count}))
    }

    pub(crate) fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let size = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        self.accessor(&bytes_of(values), F32, kind, values.len() / size)
    }

    /// A mesh of one primitive.
    pub(crate) fn mesh(&mut self, positions: &[f32], indices: &[u16], material: usize) -> usize {
        let positions = self.floats(positions, "VEC3");
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let indices = self.accessor(&bytes, U16, "SCALAR", indices.len());
        self.push(
            "meshes",
            json!({"primitives": [
                {"attributes": {"POSITION": positions}, "indices": indices, "material": material}
            ]}),
        )
    }

    /// A node at the top of the scene.
    pub(crate) fn node(&mut self, node: Value) -> usize {
        let number = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().expect("nodes").push(number.into());
        number
    }

    /// The primitive of the first mesh.
    pub(crate) fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut document = self.json.clone();
        if document.get("buffers").is_none() {
            document["buffers"] = json!([{"byteLength": self.data.len()}]);
        }
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut data = self.data.clone();
        data.resize(data.len().next_multiple_of(4), 0);
        let word = |n: usize| (n as u32).to_le_bytes();
        let mut glb = b"glTF\x02\0\0\0".to_vec();
        glb.extend(word(12 + 8 + text.len() + 8 + data.len()));
        glb.extend(word(text.len()));
        glb.extend(b"JSON");
        glb.extend(text);
        glb.extend(word(data.len()));
        glb.extend(b"BIN\0");
        glb.extend(data);
        glb
    }

    pub(crate) fn load(&self) -> holodrive::Result<Loaded> {
        self.load_with(&LoadOptions::default())
    }

    pub(crate) fn load_with(&self, options: &LoadOptions) -> holodrive::Result<Loaded> {
        load_bytes(&self.glb(), options)
    }
}

pub(crate) fn bytes_of(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Loads a file with this content from a folder of its own.
pub(crate) fn load_bytes(bytes: &[u8], options: &LoadOptions) -> holodrive::Result<Loaded> {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("scene.glb");
    std::fs::write(&path, bytes).expect("write");
    load(&path, options)
}

/// The error's text; it must be one line, about the file or a setting, and hold `words`.
pub(crate) fn assert_refused(loaded: holodrive::Result<Loaded>, words: &str) {
    let error = loaded.err().unwrap_or_else(|| panic!("it was loaded, and should have been refused: {words}"));
    let text = error.to_string();
    use holodrive::Error::{Input, OutOfRange, Parameter};
    assert!(matches!(error, Input { .. } | Parameter { .. } | OutOfRange { .. }), "{text}");
    assert!(text.contains(words), "'{text}' does not contain '{words}'");
    assert!(!text.contains('\n') && text.len() < 600, "not one line: {text}");
}

/// Whether some warning holds `words`.
pub(crate) fn warns(loaded: &Loaded, words: &str) -> bool {
    loaded.warnings.iter().any(|w| w.0.contains(words))
}
