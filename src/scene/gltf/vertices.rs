//! Files of points alone, as scanners' programs export them: they have no surface that light could fall on, so that they
//! are a cloud and no scene.

use super::LoadOptions;
use super::animation::Pose;
use super::document::{Document, called, json_part};
use super::instances;
use super::nodes::Nodes;
use super::primitives::read_points;
use super::resources::{MAX_FILE_BYTES, read_file};
use crate::error::Result;
use crate::scene::Warning;
use glam::{DVec3, Vec3};
use serde::Deserialize;
use std::path::Path;

/// Points of a file, in its world.
#[derive(Clone, Debug, Default)]
pub struct Vertices {
    /// Positions [m].
    pub positions: Vec<DVec3>,
    /// Linear colours.
    pub colors: Vec<Vec3>,
    /// What was left out or assumed.
    pub warnings: Vec<Warning>,
}

/// Most points that are read after all instances are unfolded.
const MOST: usize = 100_000_000;

/// As much of a file as tells its kind.
#[derive(Deserialize)]
struct Outline {
    #[serde(default)]
    meshes: Vec<Mesh>,
}

#[derive(Deserialize)]
struct Mesh {
    primitives: Vec<Drawn>,
}

#[derive(Deserialize)]
struct Drawn {
    #[serde(default = "triangles")]
    mode: u32,
}

/// What glTF means where a primitive has no mode.
fn triangles() -> u32 {
    4
}

/// Whether a glTF file has points and nothing with a surface; a file that cannot be read is not said to be one.
pub fn has_only_points(path: &Path) -> bool {
    let is_gltf = path.extension().is_some_and(|e| ["gltf", "glb"].iter().any(|own| e.eq_ignore_ascii_case(own)));
    if !is_gltf {
        return false;
    }
    let Ok(bytes) = read_file(path, MAX_FILE_BYTES) else { return false };
    let Ok(outline) = serde_json::from_slice::<Outline>(json_part(&bytes)) else { return false };
    let mut modes = outline.meshes.iter().flat_map(|mesh| &mesh.primitives).map(|drawn| drawn.mode).peekable();
    // Lines have no surface either, but nobody means them as points.
    modes.peek().is_some() && modes.clone().any(|mode| mode == 0) && modes.all(|mode| mode < 4)
}

/// Reads the points of a file, each with its own colour times that of its material.
///
/// # Errors
/// As [`super::load`].
pub fn read_vertices(path: &Path) -> Result<Vertices> {
    let mut found = Vertices::default();
    let document = Document::open(path, false, &mut found.warnings)?;
    let options = LoadOptions::default();
    let pose = Pose::new(&document, &options.clip, options.time)?;
    let nodes = Nodes::new(&document, &pose, None)?;
    let mut others = 0;
    for &node in &nodes.shown {
        let Some(mesh) = document.root.nodes[node].mesh else { continue };
        let meshed = document.get(mesh, "a node's mesh")?;
        let copies = instances::transforms(&document, node)?;
        for (i, primitive) in meshed.primitives.iter().enumerate() {
            let what = format!("primitive {i} of {}", called("mesh", mesh.value(), meshed.name.as_deref()));
            let Some(points) = read_points(&document, primitive, &what)? else {
                others += 1;
                continue;
            };
            if found.positions.len().saturating_add(points.len().saturating_mul(copies.len())) > MOST {
                return Err(document.error(format!("it has more than {MOST} points, the most that are read")));
            }
            for copy in &copies {
                let world = nodes.world_from_node[node] * *copy;
                found.positions.extend(points.iter().map(|(p, _)| world.transform_point3(p.as_dvec3())));
                found.colors.extend(points.iter().map(|(_, color)| *color));
            }
        }
    }
    if others > 0 {
        found.warnings.push(Warning(format!("{others} primitives are lines, and are left out")));
    }
    Ok(found)
}
