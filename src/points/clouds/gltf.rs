//! glTF of points alone.

use super::{Gather, Role, Vertex};
use crate::error::{Error, Result};
use crate::points::ply::{Frame, Metadata, Read};
use crate::scene::gltf::read_vertices;
use std::path::Path;

/// Reads the points where they stand in the file's world; their colours are their light.
pub(super) fn read(path: &Path) -> Result<Read> {
    let found = read_vertices(path)?;
    if found.positions.is_empty() {
        return Err(Error::input(path, "has no points"));
    }
    let roles: Vec<Role> = (0..3).map(Role::Position).chain((0..3).map(Role::AmplitudeRgb)).collect();
    let mut gather = Gather::new(&roles, found.positions.len());
    for (position, color) in found.positions.iter().zip(&found.colors) {
        let mut vertex = Vertex::new();
        for k in 0..3 {
            gather.put(Role::Position(k), position[k], &mut vertex);
            gather.put(Role::AmplitudeRgb(k), f64::from(color[k].max(0.0)).sqrt(), &mut vertex);
        }
        gather.push(&vertex);
    }
    let mut read = gather.finish();
    read.metadata = Some(Metadata { frame: Frame::World, ..Metadata::default() });
    read.origin = format!("{} points of a glTF file without surfaces", found.positions.len());
    read.warnings.extend(found.warnings.into_iter().map(|warning| warning.0));
    Ok(read)
}
