//! Wavefront OBJ with its MTL, by the crate `tobj`.

use super::{Arrays, Converted};
use crate::scene::Warning;
use crate::scene::gltf::resources::{Source, read_uri};
use crate::scene::texture::linear_from_srgb;
use percent_encoding::{AsciiSet, CONTROLS, utf8_percent_encode};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Largest MTL that is read [bytes].
const MAX_MATERIAL_BYTES: u64 = 16 << 20;

/// What a file's name may not hold as it is in a URI.
const RESERVED: &AsciiSet = &CONTROLS.add(b'%').add(b'?').add(b'#').add(b' ').add(b':');

/// Whether an OBJ has a face; without any it is a cloud of vertices.
pub(super) fn has_faces(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    let mut input = BufReader::with_capacity(1 << 20, file);
    let mut line = Vec::new();
    loop {
        line.clear();
        match (&mut input).take(1 << 16).read_until(b'\n', &mut line) {
            Ok(1..) if line.trim_ascii_start().starts_with(b"f ") => return true,
            Ok(1..) => {}
            _ => return false,
        }
    }
}

/// Colours of materials with three numbers each, as the reader wants them: one number stands for all three, and a colour
/// that is no three numbers (a spectrum, say) is left out.
fn mended(materials: &str) -> String {
    let mut out = String::with_capacity(materials.len());
    for line in materials.lines() {
        let mut words = line.split_ascii_whitespace();
        let key = words.next().unwrap_or_default();
        if !["Ka", "Kd", "Ks", "Ke"].contains(&key) {
            out.push_str(line);
        } else {
            let numbers: Vec<&str> = words.take_while(|word| word.parse::<f32>().is_ok()).take(3).collect();
            match numbers[..] {
                [all] => out.push_str(&[key, all, all, all].join(" ")),
                [r, g, b] => out.push_str(&[key, r, g, b].join(" ")),
                _ => {}
            }
        }
        out.push('\n');
    }
    out
}

/// Reads faces with their materials.
pub(super) fn convert(source: Source, bytes: &[u8], warnings: &mut Vec<Warning>) -> Result<Converted, String> {
    // Old exporters write names in alphabets of their own, and break long lines by a backslash.
    let text = String::from_utf8_lossy(bytes).replace("\\\r\n", " ").replace("\\\n", " ");
    // A material without a name is none.
    let nameless = |line: &str| line.trim() == "usemtl";
    let text = match text.lines().any(nameless) {
        true => {
            text.lines().map(|line| if nameless(line) { "\n" } else { line }.trim_end().to_owned() + "\n").collect()
        }
        false => text,
    };
    let mut reader = Counted { left: text.as_bytes(), line: 0 };
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ignore_points: true, ignore_lines: true };
    let (said, beside) = (RefCell::new(Vec::new()), RefCell::new(Vec::new()));
    let read = tobj::load_obj_buf(&mut reader, &options, |name| {
        let found = read_uri(source, &uri(&name.to_string_lossy()), MAX_MATERIAL_BYTES);
        found.map_or_else(
            |why| {
                said.borrow_mut().push(Warning(format!("its materials are not read ({why}); its faces are grey")));
                Err(tobj::LoadError::OpenFileFailed)
            },
            |bytes| {
                beside.borrow_mut().push(uri(&name.to_string_lossy()));
                tobj::load_mtl_buf(&mut mended(&String::from_utf8_lossy(&bytes)).as_bytes())
            },
        )
    });
    let (models, materials) = read.map_err(|why| format!("line {}: {why}", reader.line))?;
    warnings.append(&mut said.into_inner());
    let materials = materials.unwrap_or_else(|why| {
        if why != tobj::LoadError::OpenFileFailed {
            warnings.push(Warning(format!("its materials are damaged ({why}); its faces are grey")));
        }
        Vec::new()
    });
    warnings.push(Warning("OBJ says no unit: its numbers are taken as metres".to_owned()));

    let mut images = Vec::new();
    let mut told: Vec<Value> = materials.iter().map(|material| material_of(material, &mut images)).collect();
    let grey = told.len();
    let plain = json!({"baseColorFactor": [0.7, 0.7, 0.7, 1.0], "metallicFactor": 0.0});
    // Neither format says which side of a face is its front.
    told.push(json!({"pbrMetallicRoughness": plain, "doubleSided": true}));
    let mut arrays = Arrays::default();
    let mut primitives = Vec::new();
    for mesh in models.iter().map(|model| &model.mesh).filter(|mesh| !mesh.indices.is_empty()) {
        let mut attributes = json!({"POSITION": arrays.vectors(threes(&mesh.positions))});
        let vertices = mesh.positions.len() / 3;
        if mesh.normals.len() == 3 * vertices {
            attributes["NORMAL"] = arrays.vectors(threes(&mesh.normals)).into();
        }
        if mesh.texcoords.len() == 2 * vertices {
            // OBJ has v = 0 at the picture's bottom, glTF at its top.
            let flipped: Vec<[f32; 2]> = mesh.texcoords.chunks_exact(2).map(|uv| [uv[0], 1.0 - uv[1]]).collect();
            attributes["TEXCOORD_0"] = arrays.vectors(&flipped).into();
        }
        if mesh.vertex_color.len() == 3 * vertices {
            let linear: Vec<[f32; 3]> = threes(&mesh.vertex_color).iter().map(|c| c.map(linear_from_srgb)).collect();
            attributes["COLOR_0"] = arrays.vectors(&linear).into();
        }
        let material = mesh.material_id.filter(|id| *id < grey).unwrap_or(grey);
        primitives
            .push(json!({"attributes": attributes, "indices": arrays.indices(&mesh.indices), "material": material}));
    }
    if primitives.is_empty() {
        return Err("it has no face; lines `f` name the corners of one".to_owned());
    }
    let textures: Vec<Value> = (0..images.len()).map(|source| json!({"source": source})).collect();
    let images: Vec<Value> = images.into_iter().map(|uri| json!({"uri": uri})).collect();
    let more = json!({"materials": told, "textures": textures, "images": images});
    Ok(Converted { beside: beside.into_inner(), ..arrays.file(primitives, json!({"mesh": 0}), more) })
}

/// A material: what scatters, what glows, what lets through, and how sharply it shines.
fn material_of(material: &tobj::Material, images: &mut Vec<String>) -> Value {
    let [r, g, b] = material.diffuse.unwrap_or([0.7; 3]);
    let alpha = material.dissolve.unwrap_or(1.0);
    // Blinn's exponent as a width of microfacets: α = √(2/(n + 2)), and roughness its root.
    let roughness = material.shininess.map_or(1.0, |n| (2.0 / (f64::from(n).max(0.0) + 2.0)).powf(0.25));
    let mut told = json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": [r, g, b, alpha], "metallicFactor": 0.0, "roughnessFactor": roughness
        },
        "doubleSided": true
    });
    if let Some(picture) = &material.diffuse_texture {
        // Options, `-s 1 1 1`, stand before the name.
        let name = if picture.starts_with('-') { picture.split_whitespace().next_back() } else { None };
        images.push(uri(name.unwrap_or(picture)));
        told["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": images.len() - 1});
    }
    if alpha < 1.0 {
        told["alphaMode"] = "BLEND".into();
    }
    if let Some(glow) = material.emissive.filter(|glow| glow.iter().any(|c| *c > 0.0)) {
        let strength = glow.iter().copied().fold(1.0f32, f32::max);
        told["emissiveFactor"] = json!(glow.map(|c| c / strength));
        told["extensions"] = json!({"KHR_materials_emissive_strength": {"emissiveStrength": strength}});
    }
    told
}

/// A file's name as a URI relative to the scene.
fn uri(name: &str) -> String {
    utf8_percent_encode(&name.trim().replace('\\', "/"), RESERVED).to_string()
}

/// Numbers three by three; a rest that makes no three is left out.
fn threes(numbers: &[f32]) -> &[[f32; 3]] {
    numbers.as_chunks().0
}

/// A text that counts the lines that were read of it.
struct Counted<'a> {
    left: &'a [u8],
    line: usize,
}

impl Read for Counted<'_> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let count = self.left.read(into)?;
        self.line += into[..count].iter().filter(|byte| **byte == b'\n').count();
        Ok(count)
    }
}

impl BufRead for Counted<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        Ok(self.left)
    }

    fn consume(&mut self, count: usize) {
        self.line += self.left[..count].iter().filter(|byte| **byte == b'\n').count();
        self.left = &self.left[count..];
    }
}
