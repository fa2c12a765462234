//! Buffer views of EXT_meshopt_compression, and of its successor KHR_meshopt_compression with a second version of vertex
//! streams and a filter for colours, decoded by the crate `meshoptimizer-rs`.

use super::{MAX_UNPACKED_BYTES, MESHOPT, bytes};
use crate::error::{Error, Result};
use gltf::json;
use meshoptimizer_rs::Workspace;
use meshoptimizer_rs::codec::{
    BufferView, Filter, Mode, decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat,
    decode_vertex_buffer, decode_vertex_version,
};
use std::path::Path;

/// What the extension says of a buffer view.
#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
struct Packed {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: usize,
    count: usize,
    mode: String,
    #[serde(default)]
    filter: Option<String>,
}

/// Decodes every packed view into a buffer of its own, and points the view there.
pub(super) fn unpack(path: &Path, root: &mut json::Root, buffers: &mut Vec<Vec<u8>>) -> Result<()> {
    let mut workspace = Workspace::default();
    let mut unpacked = 0usize;
    for (i, view) in root.buffer_views.iter_mut().enumerate() {
        let others = view.extensions.as_ref().map(|extensions| &extensions.others);
        let Some((name, said)) = MESHOPT.iter().find_map(|name| Some((name, others?.get(*name)?))) else { continue };
        let fail = |why: String| Error::input(path, format!("buffer view {i} ({name}): {why}"));
        let packed: Packed = serde_json::from_value(said.clone()).map_err(|why| fail(why.to_string()))?;
        let bytes_of_view = packed.count.saturating_mul(packed.byte_stride);
        unpacked = unpacked.saturating_add(bytes_of_view);
        if unpacked > MAX_UNPACKED_BYTES {
            return Err(fail(format!("it unfolds to more than {MAX_UNPACKED_BYTES} bytes, the most that is unpacked")));
        }
        let stored = bytes(buffers, packed.buffer, packed.byte_offset, packed.byte_length).map_err(fail)?;
        let newer = *name == MESHOPT[1] && packed.mode == "ATTRIBUTES" && packed.is_newer(stored);
        let plain = if newer {
            packed.attributes(stored, &mut workspace)
        } else {
            let layout = packed.layout().map_err(fail)?;
            layout.decode(stored, &mut workspace).map_err(|why| why.to_string())
        };
        let plain = plain.map_err(|why| fail(format!("it cannot be unpacked ({why})")))?;
        view.buffer = json::Index::new(buffers.len() as u32);
        view.byte_offset = None;
        view.byte_length = (plain.len() as u64).into();
        buffers.push(plain);
    }
    Ok(())
}

impl Packed {
    /// Whether only the successor's rules allow its stream or its filter.
    fn is_newer(&self, stored: &[u8]) -> bool {
        self.filter.as_deref() == Some("COLOR") || decode_vertex_version(stored) == Ok(1)
    }

    /// Attributes by the rules of the successor.
    fn attributes(&self, stored: &[u8], workspace: &mut Workspace) -> std::result::Result<Vec<u8>, String> {
        let (count, stride) = (self.count, self.byte_stride);
        let mut plain = decode_vertex_buffer(count, stride, stored, workspace).map_err(|why| why.to_string())?;
        let filtered = match self.filter.as_deref().unwrap_or("NONE") {
            "NONE" => Ok(()),
            "OCTAHEDRAL" => decode_filter_oct(&mut plain, count, stride, workspace),
            "QUATERNION" => decode_filter_quat(&mut plain, count, stride, workspace),
            "EXPONENTIAL" => decode_filter_exp(&mut plain, count, stride, workspace),
            "COLOR" => decode_filter_color(&mut plain, count, stride, workspace),
            other => return Err(format!("its filter '{other}' is unknown")),
        };
        filtered.map(|()| plain).map_err(|why| why.to_string())
    }

    fn layout(&self) -> std::result::Result<BufferView, String> {
        let mode = Mode::parse(&self.mode).map_err(|_| format!("its mode '{}' is unknown", self.mode))?;
        let filter = self.filter.as_deref().unwrap_or("NONE");
        let filter = Filter::parse(filter).map_err(|_| format!("its filter '{filter}' is unknown"))?;
        let (count, stride) = (self.count, self.byte_stride);
        BufferView::new(mode, filter, count, stride)
            .map_err(|why| format!("{count} elements of {stride} bytes are not what it can hold ({why})"))
    }
}
