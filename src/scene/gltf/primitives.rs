//! One mesh primitive in its own space: attributes, morph targets and triangles, every index checked.

use super::document::Document;
use crate::error::Result;
use glam::{DVec3, Vec3};
use gltf::json;
use json::mesh::{Mode, Semantic};
use json::validation::Checked;

/// Joint numbers and weights of each vertex, four of each.
pub(super) type Influence = (Vec<[u32; 4]>, Vec<[f32; 4]>);

/// A primitive's decoded data; every vertex number in it is in range.
pub(super) struct Primitive {
    positions: Vec<[f32; 3]>,
    normals: Option<Vec<[f32; 3]>>,
    /// TEXCOORD_0 and TEXCOORD_1.
    pub(super) texcoords: [Option<Vec<[f32; 2]>>; 2],
    /// COLOR_0 without alpha, linear.
    pub(super) colors: Option<Vec<Vec3>>,
    /// JOINTS_n with WEIGHTS_n.
    pub(super) influences: Vec<Influence>,
    targets: Vec<Target>,
    /// Vertex numbers, counter-clockwise from the front.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Material of the file.
    pub(super) material: Option<usize>,
    /// Whether one or two corners were left over.
    pub(super) incomplete: bool,
}

struct Target {
    positions: Option<Vec<[f32; 3]>>,
    normals: Option<Vec<[f32; 3]>>,
}

fn displaced(
    base: [f32; 3],
    targets: &[Target],
    weights: &[f32],
    vertex: usize,
    of: impl Fn(&Target) -> Option<&Vec<[f32; 3]>>,
) -> DVec3 {
    let mut sum = Vec3::from(base).as_dvec3();
    for (target, &weight) in targets.iter().zip(weights) {
        if let Some(displacements) = of(target).filter(|_| weight != 0.0) {
            sum += f64::from(weight) * Vec3::from(displacements[vertex]).as_dvec3();
        }
    }
    sum
}

impl Primitive {
    /// Position of a vertex after morphing [m, in mesh space].
    pub(super) fn position(&self, vertex: usize, weights: &[f32]) -> DVec3 {
        displaced(self.positions[vertex], &self.targets, weights, vertex, |t| t.positions.as_ref())
    }
    /// Normal of a vertex after morphing, of any length.
    pub(super) fn normal(&self, vertex: usize, weights: &[f32]) -> Option<DVec3> {
        let normals = self.normals.as_ref()?;
        Some(displaced(normals[vertex], &self.targets, weights, vertex, |t| t.normals.as_ref()))
    }
}

fn attribute(primitive: &json::mesh::Primitive, semantic: Semantic) -> Option<json::Index<json::Accessor>> {
    primitive.attributes.get(&Checked::Valid(semantic)).copied()
}

/// How large a primitive is.
pub(super) struct Size {
    pub(super) triangles: usize,
    /// Vertices, counted again for each morph target.
    pub(super) vertices: usize,
}

/// Size of a primitive, without reading its data.
pub(super) fn primitive_size(document: &Document, primitive: &json::mesh::Primitive) -> Result<Size> {
    let count = |index: Option<json::Index<json::Accessor>>| match index {
        Some(index) => document.layout(index, "a primitive's vertices").map(|layout| layout.count),
        None => Ok(0),
    };
    let vertices = count(attribute(primitive, Semantic::Positions))?;
    let corners = if primitive.indices.is_some() { count(primitive.indices)? } else { vertices };
    let triangles = match primitive.mode {
        Checked::Valid(Mode::Triangles) => corners / 3,
        Checked::Valid(Mode::TriangleStrip | Mode::TriangleFan) => corners.saturating_sub(2),
        _ => 0,
    };
    let copies = 1 + primitive.targets.as_ref().map_or(0, Vec::len);
    Ok(Size { triangles, vertices: vertices.saturating_mul(copies) })
}

/// Points of a primitive called `what` in errors, with their linear colours; `None` for one of another kind.
pub(super) fn read_points(
    document: &Document,
    primitive: &json::mesh::Primitive,
    what: &str,
) -> Result<Option<Vec<(Vec3, Vec3)>>> {
    if !matches!(primitive.mode, Checked::Valid(Mode::Points)) {
        return Ok(None);
    }
    let Some(positions) = attribute(primitive, Semantic::Positions) else {
        return Err(document.error(format!("{what} has no POSITION; it has no points")));
    };
    let positions: Vec<[f32; 3]> = document.vectors(positions, &format!("POSITION of {what}"))?;
    let count = positions.len();
    let colors = Attributes { document, primitive, what, count }.colors()?;
    let base = match primitive.material {
        Some(material) => {
            let [r, g, b, _] = document.get(material, what)?.pbr_metallic_roughness.base_color_factor.0;
            Vec3::new(r, g, b)
        }
        None => Vec3::ONE,
    };
    let point = |i: usize| (Vec3::from(positions[i]), base * colors.as_ref().map_or(Vec3::ONE, |colors| colors[i]));
    let Some(index) = primitive.indices else { return Ok(Some((0..count).map(point).collect())) };
    let indices = document.indices(index, &format!("indices of {what}"))?;
    match indices.iter().find(|&&i| i as usize >= count) {
        Some(wrong) => Err(document.error(format!("{what} has index {wrong}, and only {count} vertices"))),
        None => Ok(Some(indices.iter().map(|&i| point(i as usize)).collect())),
    }
}

/// Decodes a primitive called `what` in errors; `None` for points and lines.
pub(super) fn read_primitive(
    document: &Document,
    primitive: &json::mesh::Primitive,
    what: &str,
) -> Result<Option<Primitive>> {
    let Checked::Valid(mode) = primitive.mode else {
        return Err(document.error(format!("{what} has an unknown mode")));
    };
    if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
        return Ok(None);
    }
    let Some(positions) = attribute(primitive, Semantic::Positions) else {
        return Err(document.error(format!("{what} has no POSITION; the mesh has no geometry")));
    };
    let positions: Vec<[f32; 3]> = document.vectors(positions, &format!("POSITION of {what}"))?;
    let count = positions.len();
    let reader = Attributes { document, primitive, what, count };

    // A normal that is not finite or zero is replaced by the triangle's own, so that it is no reason to refuse.
    let normals = attribute(primitive, Semantic::Normals)
        .map(|index| reader.checked(document.vectors_maybe_nan(index, &format!("NORMAL of {what}"))?, "NORMAL"))
        .transpose()?;
    let texcoords = [reader.read(Semantic::TexCoords(0))?, reader.read(Semantic::TexCoords(1))?];
    let colors = reader.colors()?;
    let influences = reader.influences()?;
    let targets = reader.targets()?;

    let corners = match primitive.indices {
        Some(index) => {
            let corners = document.indices(index, &format!("indices of {what}"))?;
            if let Some(wrong) = corners.iter().find(|&&c| c as usize >= count) {
                return Err(document.error(format!("{what} has index {wrong}, and only {count} vertices")));
            }
            corners
        }
        None => (0..count as u32).collect(),
    };
    let (triangles, incomplete) = assemble(&corners, mode);
    let material =
        primitive.material.map(|material| document.get(material, what).map(|_| material.value())).transpose()?;
    let primitive =
        Primitive { positions, normals, texcoords, colors, influences, targets, triangles, material, incomplete };
    Ok(Some(primitive))
}

/// Triangles of a list, strip or fan (glTF 2.0, section 3.7.2.1), and whether corners were left over.
fn assemble(corners: &[u32], mode: Mode) -> (Vec<[u32; 3]>, bool) {
    match mode {
        Mode::TriangleStrip => {
            let turned = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
            (corners.windows(3).enumerate().map(turned).collect(), matches!(corners.len(), 1 | 2))
        }
        Mode::TriangleFan => {
            let rim = corners.get(1..).unwrap_or(&[]);
            let triangles = rim.windows(2).map(|w| [w[0], w[1], corners[0]]).collect();
            (triangles, matches!(corners.len(), 1 | 2))
        }
        _ => {
            let triples = corners.chunks_exact(3);
            let incomplete = !triples.remainder().is_empty();
            (triples.map(|c| [c[0], c[1], c[2]]).collect(), incomplete)
        }
    }
}

/// Reads attributes of one primitive and checks that each has a value for every vertex.
struct Attributes<'a> {
    document: &'a Document,
    primitive: &'a json::mesh::Primitive,
    what: &'a str,
    count: usize,
}

impl Attributes<'_> {
    fn checked<T>(&self, values: Vec<T>, name: &str) -> Result<Vec<T>> {
        if values.len() == self.count {
            return Ok(values);
        }
        let (what, found, needed) = (self.what, values.len(), self.count);
        Err(self.document.error(format!("{name} of {what} has {found} values for {needed} vertices")))
    }

    fn read<const N: usize>(&self, semantic: Semantic) -> Result<Option<Vec<[f32; N]>>> {
        let name = semantic.to_string();
        let Some(index) = attribute(self.primitive, semantic) else { return Ok(None) };
        let values = self.document.vectors(index, &format!("{name} of {}", self.what))?;
        self.checked(values, &name).map(Some)
    }

    fn colors(&self) -> Result<Option<Vec<Vec3>>> {
        let Some(index) = attribute(self.primitive, Semantic::Colors(0)) else { return Ok(None) };
        if self.document.layout(index, "COLOR_0")?.components == 4 {
            let colors = self.read::<4>(Semantic::Colors(0))?;
            return Ok(colors.map(|colors| colors.iter().map(|&[r, g, b, _]| Vec3::new(r, g, b)).collect()));
        }
        let colors = self.read::<3>(Semantic::Colors(0))?;
        Ok(colors.map(|colors| colors.into_iter().map(Vec3::from).collect()))
    }

    fn influences(&self) -> Result<Vec<Influence>> {
        let mut influences = Vec::new();
        for set in 0.. {
            let (joints, weights) = (Semantic::Joints(set), Semantic::Weights(set));
            let (Some(joints), Some(weights)) = (self.read::<4>(joints)?, self.read::<4>(weights)?) else { break };
            if weights.iter().flatten().any(|&w| w < 0.0) {
                return Err(self.document.error(format!("WEIGHTS_{set} of {} has a negative weight", self.what)));
            }
            influences.push((joints.into_iter().map(|j| j.map(|x| x as u32)).collect(), weights));
        }
        Ok(influences)
    }

    fn targets(&self) -> Result<Vec<Target>> {
        let mut targets = Vec::new();
        for (i, target) in self.primitive.targets.iter().flatten().enumerate() {
            let read = |index: Option<json::Index<json::Accessor>>, name: &str| -> Result<_> {
                let name = format!("{name} of morph target {i}");
                let Some(index) = index else { return Ok(None) };
                let values = self.document.vectors::<3>(index, &format!("{name} of {}", self.what))?;
                self.checked(values, &name).map(Some)
            };
            targets.push(Target {
                positions: read(target.positions, "POSITION")?,
                normals: read(target.normals, "NORMAL")?,
            });
        }
        Ok(targets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_strips_and_fans() {
        // The specification's own formulae: strip {v_i, v_(i+1+i%2), v_(i+2-i%2)}, fan {v_(i+1), v_(i+2), v_0}.
        let corners = [10, 11, 12, 13, 14];
        assert_eq!(assemble(&corners, Mode::TriangleStrip).0, [[10, 11, 12], [11, 13, 12], [12, 13, 14]]);
        assert_eq!(assemble(&corners, Mode::TriangleFan).0, [[11, 12, 10], [12, 13, 10], [13, 14, 10]]);
        assert_eq!(assemble(&corners, Mode::Triangles), (vec![[10, 11, 12]], true));
        for mode in [Mode::Triangles, Mode::TriangleStrip, Mode::TriangleFan] {
            assert_eq!(assemble(&[], mode), (vec![], false));
            assert_eq!(assemble(&[1, 2], mode), (vec![], true));
        }
    }
}
