//! Copies of a node's mesh (EXT_mesh_gpu_instancing): where each stands.

use super::document::Document;
use crate::error::Result;
use glam::{DMat4, DQuat, DVec3, Vec3};
use gltf::json;

/// Accessors of the copies' parts, as the extension names them.
struct Parts {
    translation: Option<json::Index<json::Accessor>>,
    rotation: Option<json::Index<json::Accessor>>,
    scale: Option<json::Index<json::Accessor>>,
}

/// The extension of a node, if it has one.
fn parts(document: &Document, node: usize) -> Result<Option<Parts>> {
    let node = &document.root.nodes[node];
    let Some(own) = node.extensions.as_ref().and_then(|e| e.others.get("EXT_mesh_gpu_instancing")) else {
        return Ok(None);
    };
    let Some(attributes) = own.get("attributes").and_then(serde_json::Value::as_object) else { return Ok(None) };
    let index = |name: &str| match attributes.get(name) {
        None => Ok(None),
        Some(value) => match value.as_u64().and_then(|index| u32::try_from(index).ok()) {
            Some(index) => Ok(Some(json::Index::new(index))),
            None => Err(document.error(format!("EXT_mesh_gpu_instancing: {name} is no accessor"))),
        },
    };
    Ok(Some(Parts { translation: index("TRANSLATION")?, rotation: index("ROTATION")?, scale: index("SCALE")? }))
}

/// Number of copies of a node's mesh, without reading where they stand: one where the node says nothing.
pub(super) fn count(document: &Document, node: usize) -> Result<usize> {
    let Some(parts) = parts(document, node)? else { return Ok(1) };
    let first = [parts.translation, parts.rotation, parts.scale].into_iter().flatten().next();
    first.map_or(Ok(1), |index| Ok(document.layout(index, WHAT)?.count))
}

const WHAT: &str = "the copies of a mesh";

/// Node from copy, for each copy.
pub(super) fn transforms(document: &Document, node: usize) -> Result<Vec<DMat4>> {
    let count = count(document, node)?;
    let Some(parts) = parts(document, node)? else { return Ok(vec![DMat4::IDENTITY]) };
    let translations = parts.translation.map(|index| document.vectors::<3>(index, WHAT)).transpose()?;
    let rotations = parts.rotation.map(|index| document.vectors::<4>(index, WHAT)).transpose()?;
    let scales = parts.scale.map(|index| document.vectors::<3>(index, WHAT)).transpose()?;
    let lengths =
        [translations.as_ref().map(Vec::len), rotations.as_ref().map(Vec::len), scales.as_ref().map(Vec::len)];
    if lengths.into_iter().flatten().any(|length| length != count) {
        let name = document.node_name(node);
        return Err(document.error(format!("{name}: the attributes of its copies have different numbers of elements")));
    }
    let of = |i: usize| {
        let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |all| {
            let q = DQuat::from_array(all[i].map(f64::from));
            if q.length() > 0.0 { q.normalize() } else { DQuat::IDENTITY }
        });
        let vector =
            |all: &Option<Vec<[f32; 3]>>, none: DVec3| all.as_ref().map_or(none, |all| Vec3::from(all[i]).as_dvec3());
        let (scale, translation) = (vector(&scales, DVec3::ONE), vector(&translations, DVec3::ZERO));
        DMat4::from_scale_rotation_translation(scale, rotation, translation)
    };
    Ok((0..count).map(of).collect())
}
