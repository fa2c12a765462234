//! Primitives of KHR_draco_mesh_compression, decoded by the crate `draco-core`.

use super::{MAX_UNPACKED_BYTES, bytes};
use crate::error::{Error, Result};
use crate::scene::gltf::meshes::MAX_TRIANGLES;
use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute};
use gltf::json;
use json::accessor::{Accessor, ComponentType, GenericComponentType, Type};
use json::mesh::{Mode, Primitive};
use json::validation::Checked;
use std::collections::BTreeMap;
use std::path::Path;

const NAME: &str = "KHR_draco_mesh_compression";

/// What the extension says of a primitive: where its bytes are, and under which number each attribute is in them.
#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
struct Packed {
    buffer_view: u32,
    attributes: BTreeMap<String, u32>,
}

/// Decodes every packed primitive: each gets accessors of its own, whose values lie in new buffers.
pub(super) fn unpack(path: &Path, root: &mut json::Root, buffers: &mut Vec<Vec<u8>>) -> Result<()> {
    let mut meshes = std::mem::take(&mut root.meshes);
    let mut plain = Plain { root, buffers, left: MAX_UNPACKED_BYTES };
    for (i, mesh) in meshes.iter_mut().enumerate() {
        for (k, primitive) in mesh.primitives.iter_mut().enumerate() {
            let said = primitive.extensions.as_ref().and_then(|extensions| extensions.others.get(NAME)).cloned();
            if let Some(said) = said {
                plain
                    .unpack(primitive, said)
                    .map_err(|why| Error::input(path, format!("primitive {k} of mesh {i} ({NAME}): {why}")))?;
            }
        }
    }
    root.meshes = meshes;
    Ok(())
}

/// The file as it is unfolded.
struct Plain<'a> {
    root: &'a mut json::Root,
    buffers: &'a mut Vec<Vec<u8>>,
    /// Bytes that may still be unfolded.
    left: usize,
}

impl Plain<'_> {
    fn unpack(&mut self, primitive: &mut Primitive, said: serde_json::Value) -> std::result::Result<(), String> {
        let packed: Packed = serde_json::from_value(said).map_err(|why| why.to_string())?;
        let mesh = self.decode(&packed)?;
        let count = mesh.num_points();
        let corners = mesh.faces().iter().flatten().flat_map(|corner| corner.0.to_le_bytes()).collect();
        let mut indices = None;
        for (semantic, index) in &mut primitive.attributes {
            let Checked::Valid(semantic) = semantic else { continue };
            let name = semantic.to_string();
            let Some(&number) = packed.attributes.get(&name) else { continue };
            let attribute = mesh
                .attribute_by_unique_id(number)
                .ok_or_else(|| format!("it holds no attribute {number} for {name}"))?;
            let mut accessor = self.root.get(*index).ok_or_else(|| format!("{name} points to no accessor"))?.clone();
            let values = values(attribute, &accessor, count).map_err(|why| format!("{name} {why}"))?;
            if indices.is_none() {
                let kind = (Checked::Valid(Type::Scalar), Checked::Valid(GenericComponentType(ComponentType::U32)));
                indices =
                    Some(Accessor { type_: kind.0, component_type: kind.1, normalized: false, ..accessor.clone() });
            }
            accessor.count = (count as u64).into();
            *index = self.add(accessor, values)?;
        }
        if let Some(mut accessor) = indices {
            accessor.count = (3 * mesh.num_faces() as u64).into();
            primitive.indices = Some(self.add(accessor, corners)?);
            // What was a strip comes as single triangles, too.
            primitive.mode = Checked::Valid(Mode::Triangles);
        }
        Ok(())
    }

    fn decode(&self, packed: &Packed) -> std::result::Result<Mesh, String> {
        let view = self.root.buffer_views.get(packed.buffer_view as usize);
        let view = view.ok_or_else(|| format!("buffer view {} is not there", packed.buffer_view))?;
        let offset = view.byte_offset.map_or(0, |offset| offset.0);
        let stored = bytes(self.buffers, view.buffer.value(), offset, view.byte_length.0)?;
        let limits = DecodeLimits::default()
            .with_max_faces(MAX_TRIANGLES as u64)
            .with_max_points(3 * MAX_TRIANGLES as u64)
            .with_max_decoded_bytes(self.left as u64);
        let mut mesh = Mesh::new();
        MeshDecoder::new()
            .decode(&mut DecoderBuffer::new(stored).with_limits(limits), &mut mesh)
            .map_err(|why| format!("it cannot be unpacked ({why})"))?;
        Ok(mesh)
    }

    /// Adds an accessor whose values are `bytes`.
    fn add(&mut self, accessor: Accessor, bytes: Vec<u8>) -> std::result::Result<json::Index<Accessor>, String> {
        self.left = self.left.checked_sub(bytes.len()).ok_or_else(|| {
            format!("the file unfolds to more than {MAX_UNPACKED_BYTES} bytes, the most that is unpacked")
        })?;
        let view = json::buffer::View {
            buffer: json::Index::new(self.buffers.len() as u32),
            byte_length: (bytes.len() as u64).into(),
            byte_offset: None,
            byte_stride: None,
            name: None,
            target: None,
            extensions: None,
            extras: Default::default(),
        };
        self.buffers.push(bytes);
        let view = self.root.push(view);
        Ok(self.root.push(Accessor { buffer_view: Some(view), byte_offset: None, sparse: None, ..accessor }))
    }
}

/// An attribute's value for each of `count` points, in the accessor's own type.
fn values(attribute: &PointAttribute, accessor: &Accessor, count: usize) -> std::result::Result<Vec<u8>, String> {
    let (Checked::Valid(component), Checked::Valid(kind)) = (accessor.component_type, accessor.type_) else {
        return Err("has an unknown component type or type".to_owned());
    };
    let (stored, wanted) = (usize::from(attribute.num_components()), kind.multiplicity());
    if stored != wanted {
        return Err(format!("has {wanted} numbers in an element, and {stored} are packed"));
    }
    // Integers of up to 24 bits, all that joints, colours and quantised positions have, are exact in these.
    let numbers = attribute.read_f32s(count, wanted);
    let number = |x: f32| -> [u8; 4] {
        match component.0 {
            ComponentType::F32 => x.to_le_bytes(),
            ComponentType::U32 => (x as u32).to_le_bytes(),
            ComponentType::I8 => i32::from(x as i8).to_le_bytes(),
            ComponentType::U8 => u32::from(x as u8).to_le_bytes(),
            ComponentType::I16 => i32::from(x as i16).to_le_bytes(),
            ComponentType::U16 => u32::from(x as u16).to_le_bytes(),
        }
    };
    // Little-endian: the first bytes of the widened number are the narrow one.
    let size = component.0.size();
    Ok(numbers.into_iter().flat_map(|x| number(x).into_iter().take(size)).collect())
}
