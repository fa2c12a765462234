//! STL, as text or binary, by the crate `stl_io`: bare triangles of a printer or a drawing, in a plain grey.

use super::{Arrays, Converted};
use crate::scene::Warning;
use serde_json::json;
use std::borrow::Cow;
use std::io::Cursor;

/// Reads triangles; the file's own normals are left out, since the order of corners says the same and is more often right.
pub(super) fn convert(bytes: &[u8], warnings: &mut Vec<Warning>) -> Result<Converted, String> {
    // Text is told by `solid` and a blank; some programs write a tab.
    let mut bytes = Cow::Borrowed(bytes);
    if bytes.strip_prefix(b"solid").is_some_and(|rest| matches!(rest.first(), Some(b'\t' | b'\r' | b'\n'))) {
        bytes.to_mut()[5] = b' ';
    }
    let mesh = stl_io::read_stl(&mut Cursor::new(&bytes[..]))
        .map_err(|why| format!("not an STL file, or a damaged one: {why}"))?;
    let positions: Vec<[f32; 3]> = mesh.vertices.iter().map(|vertex| vertex.0).collect();
    // A count of vertices that 32 bits do not hold is beyond the largest file that is read.
    let corners: Vec<u32> = mesh.faces.iter().flat_map(|face| face.vertices.map(|corner| corner as u32)).collect();
    warnings
        .push(Warning("STL says no unit and no direction: its numbers are taken as metres, its z as up".to_owned()));
    let mut arrays = Arrays::default();
    let primitive = json!({
        "attributes": {"POSITION": arrays.vectors(&positions)}, "indices": arrays.indices(&corners), "material": 0
    });
    // A quarter turn about x, from z up to y up.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let node = json!({"mesh": 0, "rotation": [-half, 0.0, 0.0, half]});
    let grey = json!({"pbrMetallicRoughness": {"baseColorFactor": [0.7, 0.7, 0.7, 1.0], "metallicFactor": 0.0}, "doubleSided": true});
    Ok(arrays.file(vec![primitive], node, json!({"materials": [grey]})))
}
