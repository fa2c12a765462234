//! Geometry that a file holds compressed, unfolded into plain buffers, views and accessors before anything else reads it.
//!
//! EXT_meshopt_compression (and its KHR name) packs buffer views, KHR_draco_mesh_compression the corners and triangles of
//! a primitive. What they unfold to is bounded before it is made: [`MAX_UNPACKED_BYTES`] in all.

#[cfg(feature = "draco")]
mod draco;
#[cfg(feature = "meshopt")]
mod meshopt;

#[cfg(all(test, feature = "draco", feature = "meshopt"))]
mod tests;

use crate::error::Result;
use gltf::json;
use std::path::Path;

/// Most bytes that all compressed geometry of a file may unfold to.
#[cfg(any(feature = "draco", feature = "meshopt"))]
const MAX_UNPACKED_BYTES: usize = 1 << 30;

/// Names of the extension that packs buffer views.
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Whether a buffer is only there for readers that cannot unpack its views: it then needs no bytes.
pub(super) fn is_fallback(buffer: &json::Buffer) -> bool {
    let others = buffer.extensions.as_ref().map(|extensions| &extensions.others);
    let says = |name: &&str| others?.get(*name)?.get("fallback")?.as_bool();
    cfg!(feature = "meshopt") && MESHOPT.iter().any(|name| says(name) == Some(true))
}

/// Unpacks all compressed geometry; `buffers` are those of `root`, in its order, and more are added.
pub(super) fn unpack(path: &Path, root: &mut json::Root, buffers: &mut Vec<Vec<u8>>) -> Result<()> {
    #[cfg(feature = "meshopt")]
    meshopt::unpack(path, root, buffers)?;
    #[cfg(feature = "draco")]
    draco::unpack(path, root, buffers)?;
    let _ = (path, root, buffers);
    Ok(())
}

/// The bytes from `offset` on, `length` of them, of a buffer; the error says what is not there.
#[cfg(any(feature = "draco", feature = "meshopt"))]
fn bytes(buffers: &[Vec<u8>], buffer: usize, offset: u64, length: u64) -> std::result::Result<&[u8], String> {
    let range = usize::try_from(offset).ok().zip(offset.checked_add(length).and_then(|end| usize::try_from(end).ok()));
    let there = buffers.get(buffer).zip(range).and_then(|(buffer, (begin, end))| buffer.get(begin..end));
    there.ok_or_else(|| format!("bytes {offset} and {length} on lie past the end of buffer {buffer}"))
}
