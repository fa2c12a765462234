//! Meshes to world-space triangles: topology, morph targets, skins, mirrored transforms.

use super::animation::Pose;
use super::document::{Document, called};
use super::instances;
use super::nodes::Nodes;
use super::primitives::{Primitive, primitive_size, read_primitive};
use crate::error::Result;
use crate::scene::{Triangle, Warning};
use glam::{DMat3, DMat4, DVec3, Vec2, Vec3};
use gltf::json;
use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Most triangles that a scene may have after all instances are unfolded: 1.6 GB in memory.
pub const MAX_TRIANGLES: usize = 10_000_000;

/// Largest distance of a vertex from the origin along an axis [m]: beyond it, volumes in single precision overflow.
pub const MAX_COORDINATE: f64 = 1e9;

/// Materials of the file that triangles use, in the order of their first use; `None` is glTF's default material.
pub(super) type UsedMaterials = Vec<Option<usize>>;

/// Counts of what was left out, told in one warning each.
#[derive(Default)]
struct LeftOut {
    degenerate: usize,
    points_and_lines: usize,
    incomplete: usize,
    repeated: usize,
}

/// All triangles of the shown nodes in world space, and the materials that their `material` counts through.
pub(super) fn triangles(
    document: &Document,
    nodes: &Nodes,
    pose: &Pose,
    warnings: &mut Vec<Warning>,
) -> Result<(Vec<Triangle>, UsedMaterials)> {
    check_size(document, nodes)?;
    let mut decoded: Vec<Option<Vec<Primitive>>> = Vec::new();
    decoded.resize_with(document.root.meshes.len(), || None);
    let (mut triangles, mut used, mut left_out) = (Vec::new(), UsedMaterials::new(), LeftOut::default());
    let (mut instance, mut met) = (0, HashSet::new());
    for &node in &nodes.shown {
        let Some(mesh) = document.root.nodes[node].mesh else { continue };
        let (meshed, number) = (document.get(mesh, "a node's mesh")?, mesh.value());
        if decoded[number].is_none() {
            let mut primitives = Vec::with_capacity(meshed.primitives.len());
            for (i, primitive) in meshed.primitives.iter().enumerate() {
                let what = format!("primitive {i} of {}", called("mesh", number, meshed.name.as_deref()));
                match read_primitive(document, primitive, &what)? {
                    Some(primitive) => {
                        left_out.incomplete += usize::from(primitive.incomplete);
                        primitives.push(primitive);
                    }
                    None => left_out.points_and_lines += 1,
                }
            }
            decoded[number] = Some(primitives);
        }
        let skin = document.root.nodes[node].skin.map(|skin| joint_matrices(document, nodes, skin)).transpose()?;
        let copies = instances::transforms(document, node)?;
        for (primitive, copy) in decoded[number].iter().flatten().flat_map(|p| copies.iter().map(move |copy| (p, copy)))
        {
            let placement = Placement::new(nodes.world_from_node[node] * *copy, skin.as_deref(), primitive);
            let material = used.iter().position(|&m| m == primitive.material).unwrap_or_else(|| {
                used.push(primitive.material);
                used.len() - 1
            });
            let name = || document.node_name(node);
            let (before, flat) = (triangles.len(), left_out.degenerate);
            for &corners in &primitive.triangles {
                let Some(found) = placement.triangle(document, primitive, &pose.weights[node], corners, &name)? else {
                    left_out.degenerate += 1;
                    continue;
                };
                if met.insert(place(&found, material)) {
                    triangles.push(Triangle { material: material as u32, instance, ..found });
                }
            }
            left_out.repeated += primitive.triangles.len() - (left_out.degenerate - flat) - (triangles.len() - before);
            instance += 1;
        }
    }
    warn(&left_out, warnings);
    if triangles.is_empty() {
        return Err(document.error("there is no triangle in the scene; a scene needs at least one surface"));
    }
    Ok((triangles, used))
}

/// What tells a triangle's place and material from others': 128 bits of its corners' own, whichever comes first. Copies in one
/// place show nothing more, and every ray would have to look at each.
fn place(triangle: &Triangle, material: usize) -> u128 {
    let corners = triangle.positions.map(|p| p.to_array().map(|x| (x + 0.0).to_bits()));
    let first = (0..3).min_by_key(|&k| corners[k]).unwrap_or(0);
    let turned: [[u32; 3]; 3] = std::array::from_fn(|k| corners[(first + k) % 3]);
    let hash = |seed: u64| {
        let mut hasher = DefaultHasher::new();
        (seed, turned, material).hash(&mut hasher);
        hasher.finish()
    };
    u128::from(hash(0)) << 64 | u128::from(hash(1))
}

fn warn(left_out: &LeftOut, warnings: &mut Vec<Warning>) {
    let mut tell = |count: usize, what: &str| {
        if count > 0 {
            warnings.push(Warning(format!("{count} {what}")));
        }
    };
    tell(left_out.degenerate, "triangles without area are left out");
    tell(left_out.repeated, "triangles stand exactly on others of the same material and are left out");
    tell(left_out.points_and_lines, "primitives are points or lines, which have no surface, and are left out");
    tell(left_out.incomplete, "primitives end in an incomplete triangle, which is left out");
}

/// Counts before anything is unfolded or decoded, so that a small file of many instances cannot take all memory.
fn check_size(document: &Document, nodes: &Nodes) -> Result<()> {
    let (mut triangles, mut vertices) = (0usize, 0usize);
    let mut counted = vec![false; document.root.meshes.len()];
    for &node in &nodes.shown {
        let Some(mesh) = document.root.nodes[node].mesh else { continue };
        let copies = instances::count(document, node)?;
        for primitive in &document.get(mesh, "a node's mesh")?.primitives {
            let size = primitive_size(document, primitive)?;
            triangles = triangles.saturating_add(size.triangles.saturating_mul(copies));
            vertices = vertices.saturating_add(if counted[mesh.value()] { 0 } else { size.vertices });
        }
        counted[mesh.value()] = true;
        // No more vertices can be in use than triangles have corners.
        if triangles > MAX_TRIANGLES || vertices > 3 * MAX_TRIANGLES {
            return Err(document.error(format!(
                "the scene has more than {MAX_TRIANGLES} triangles with all instances, or more than three times as many \
                 vertices; reduce its meshes"
            )));
        }
    }
    Ok(())
}

/// World from mesh at bind pose, for each joint of a skin.
fn joint_matrices(document: &Document, nodes: &Nodes, skin: json::Index<json::Skin>) -> Result<Vec<DMat4>> {
    let what = format!("skin {skin}");
    let skin = document.get(skin, "a node's skin")?;
    let read = |index| document.vectors::<16>(index, &format!("inverse bind matrices of {what}"));
    let inverse_bind = skin.inverse_bind_matrices.map(read).transpose()?;
    let mut matrices = Vec::with_capacity(skin.joints.len());
    for (i, &joint) in skin.joints.iter().enumerate() {
        document.get(joint, &what)?;
        let joint_from_mesh = match &inverse_bind {
            None => DMat4::IDENTITY,
            Some(all) => all
                .get(i)
                .map(|m| DMat4::from_cols_array(&m.map(f64::from)))
                .ok_or_else(|| document.error(format!("{what} has fewer inverse bind matrices than joints")))?,
        };
        matrices.push(nodes.world_from_node[joint.value()] * joint_from_mesh);
    }
    Ok(matrices)
}

/// How vertices of one primitive of one node come into the world.
enum Placement<'a> {
    Rigid(Linear),
    Skinned(&'a [DMat4]),
}

/// A transform with what normals need.
#[derive(Clone, Copy)]
struct Linear {
    world_from_mesh: DMat4,
    /// Cofactor matrix times the determinant's sign: the inverse transpose up to a positive factor, and defined for
    /// singular transforms too.
    normal_from_mesh: DMat3,
    mirrored: bool,
}

impl Linear {
    fn new(world_from_mesh: DMat4) -> Self {
        let m = DMat3::from_mat4(world_from_mesh);
        let mirrored = m.determinant() < 0.0;
        let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
        let cofactor = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
        Self { world_from_mesh, normal_from_mesh: if mirrored { -cofactor } else { cofactor }, mirrored }
    }
}

impl<'a> Placement<'a> {
    /// A skinned primitive ignores its node's own transform, as glTF says.
    fn new(world_from_node: DMat4, joints: Option<&'a [DMat4]>, primitive: &Primitive) -> Self {
        match joints {
            Some(joints) if !primitive.influences.is_empty() => Self::Skinned(joints),
            _ => Self::Rigid(Linear::new(world_from_node)),
        }
    }

    fn of_vertex(
        &self,
        document: &Document,
        primitive: &Primitive,
        vertex: usize,
        name: &impl Fn() -> String,
    ) -> Result<Linear> {
        let joints = match self {
            Self::Rigid(linear) => return Ok(*linear),
            Self::Skinned(joints) => joints,
        };
        let (mut sum, mut total) = (DMat4::ZERO, 0.0);
        for (numbers, weights) in &primitive.influences {
            for (&joint, &weight) in numbers[vertex].iter().zip(&weights[vertex]) {
                // Exporters leave arbitrary joint numbers where the weight is zero.
                if weight == 0.0 {
                    continue;
                }
                let matrix = joints.get(joint as usize).ok_or_else(|| {
                    let count = joints.len();
                    document.error(format!("{}: a vertex hangs on joint {joint} of a skin of {count} joints", name()))
                })?;
                sum += *matrix * f64::from(weight);
                total += f64::from(weight);
            }
        }
        // Weights are stored rounded; without normalisation a vertex would drift towards the origin.
        if total > 0.0 {
            return Ok(Linear::new(sum * (1.0 / total)));
        }
        let first = joints.first().ok_or_else(|| document.error(format!("{}: its skin has no joints", name())))?;
        Ok(Linear::new(*first))
    }

    /// A triangle in the world; `None` if it has no area.
    fn triangle(
        &self,
        document: &Document,
        primitive: &Primitive,
        weights: &[f32],
        mut corners: [u32; 3],
        name: &impl Fn() -> String,
    ) -> Result<Option<Triangle>> {
        let mut transforms = [Linear::new(DMat4::IDENTITY); 3];
        for (transform, &corner) in transforms.iter_mut().zip(&corners) {
            *transform = self.of_vertex(document, primitive, corner as usize, name)?;
        }
        // A mirroring transform turns counter-clockwise into clockwise; the front must stay the front.
        if transforms[0].mirrored {
            corners.swap(1, 2);
            transforms.swap(1, 2);
        }
        let mut triangle = Triangle {
            positions: [Vec3::ZERO; 3],
            normals: [Vec3::ZERO; 3],
            texcoords: [[Vec2::ZERO; 2]; 3],
            colors: [Vec3::ONE; 3],
            material: 0,
            instance: 0,
        };
        for (i, (&corner, transform)) in corners.iter().zip(&transforms).enumerate() {
            let vertex = corner as usize;
            let position = transform.world_from_mesh.transform_point3(primitive.position(vertex, weights));
            if !position.is_finite() || position.abs().max_element() > MAX_COORDINATE {
                return Err(document.error(format!(
                    "{} puts a vertex at {position}; coordinates must be finite and within {MAX_COORDINATE:e} m",
                    name()
                )));
            }
            triangle.positions[i] = position.as_vec3();
            let normal = primitive.normal(vertex, weights).map_or(DVec3::ZERO, |n| transform.normal_from_mesh * n);
            triangle.normals[i] = normal.normalize_or_zero().as_vec3();
            for (set, texcoords) in primitive.texcoords.iter().enumerate() {
                triangle.texcoords[i][set] = texcoords.as_ref().map_or(Vec2::ZERO, |t| t[vertex].into());
            }
            triangle.colors[i] = primitive.colors.as_ref().map_or(Vec3::ONE, |c| c[vertex]);
        }
        let normal = triangle.normal();
        if normal == DVec3::ZERO {
            return Ok(None);
        }
        for shading in triangle.normals.iter_mut().filter(|n| **n == Vec3::ZERO) {
            *shading = normal.as_vec3();
        }
        Ok(Some(triangle))
    }
}
