//! Flat mirrors: the polygons in which lamps have sharp mirror images.

use super::elements::NONE;
use super::form_factor::clip;
use super::reflection::MIRROR_ALPHA;
use super::sampling::tangents;
use crate::scene::{AlphaMode, Material, Scene};
use glam::DVec3;

/// Mirrors whose reflectance at normal incidence is below this are left to photons.
const LEAST_REFLECTANCE: f32 = 0.02;
/// How far from one plane the corners of one mirror may lie, over the size of the scene.
const FLATNESS: f64 = 1e-6;

/// One side of a flat, convex mirror.
#[derive(Clone, Debug)]
pub(crate) struct FlatMirror {
    /// Corners in order [m].
    pub(crate) outline: Vec<DVec3>,
    /// Unit normal on the side that reflects.
    pub(crate) normal: DVec3,
    /// Which surface it is a side of: both sides of one have one number.
    pub(crate) surface: u32,
    /// Largest reflectance of the three colours at normal incidence, without textures.
    pub(crate) reflectance: f32,
}

impl FlatMirror {
    /// Height of a point above the mirror [m].
    pub(crate) fn height(&self, point: DVec3) -> f64 {
        (point - self.outline[0]).dot(self.normal)
    }

    /// Mirror image of a point.
    pub(crate) fn image(&self, point: DVec3) -> DVec3 {
        point - self.normal * (2.0 * self.height(point))
    }

    /// The part of a polygon in front of the mirror.
    pub(crate) fn in_front(&self, polygon: &[DVec3]) -> Vec<DVec3> {
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        clip(polygon, |p| self.height(p), &mut kept);
        kept
    }
}

/// All flat mirrors of a scene that count.
#[derive(Clone, Debug, Default)]
pub(crate) struct FlatMirrors {
    pub(crate) sides: Vec<FlatMirror>,
    /// Number of the mirror that each triangle belongs to, or [`NONE`].
    pub(crate) of: Vec<u32>,
}

impl FlatMirrors {
    /// Finds them: triangles of one material in one plane whose convex hull they fill are one mirror, all others are
    /// one each. The `most` with the largest area times reflectance are kept.
    pub(crate) fn new(scene: &Scene, most: usize) -> Self {
        let size = scene.bounds().map_or(0.0, |(low, high)| (high - low).length());
        let mut groups: Vec<Vec<u32>> = Vec::new();
        for (index, triangle) in scene.triangles.iter().enumerate() {
            let normal = triangle.normal();
            let even = triangle.normals.iter().all(|n| n.as_dvec3().dot(normal) > 1.0 - 1e-7);
            if triangle.area() <= 0.0 || !even || !reflects_sharply(scene.material(index as u32)) {
                continue;
            }
            let fits = |group: &&mut Vec<u32>| {
                let first = &scene.triangles[group[0] as usize];
                first.material == triangle.material
                    && first.normal().dot(normal) > 1.0 - 1e-9
                    && triangle.corners().iter().all(|p| (*p - first.corners()[0]).dot(normal).abs() <= FLATNESS * size)
            };
            // A scene of many small facets is no scene of flat mirrors, and the search would be quadratic.
            if groups.len() > 16 * most.max(1) {
                return Self { sides: Vec::new(), of: vec![NONE; scene.triangles.len()] };
            }
            match groups.iter_mut().find(fits) {
                Some(group) => group.push(index as u32),
                None => groups.push(vec![index as u32]),
            }
        }
        let mut found: Vec<(Vec<u32>, Vec<DVec3>)> = Vec::new();
        for group in groups {
            let area: f64 = group.iter().map(|&t| scene.triangles[t as usize].area()).sum();
            let normal = scene.triangles[group[0] as usize].normal();
            let hull = hull(group.iter().flat_map(|&t| scene.triangles[t as usize].corners()).collect(), normal);
            if polygon_area(&hull) <= area * (1.0 + 1e-5) {
                found.push((group, hull));
            } else {
                found.extend(group.into_iter().map(|t| (vec![t], scene.triangles[t as usize].corners().to_vec())));
            }
        }
        let weight = |(triangles, outline): &(Vec<u32>, Vec<DVec3>)| {
            f64::from(reflectance(scene.material(triangles[0]))) * polygon_area(outline)
        };
        found.sort_by(|a, b| weight(b).total_cmp(&weight(a)).then(a.0[0].cmp(&b.0[0])));
        found.truncate(most);
        let (mut sides, mut of) = (Vec::new(), vec![NONE; scene.triangles.len()]);
        for (surface, (triangles, outline)) in found.into_iter().enumerate() {
            let material = scene.material(triangles[0]);
            let surface = surface as u32;
            let (normal, reflectance) = (scene.triangles[triangles[0] as usize].normal(), reflectance(material));
            triangles.iter().for_each(|&t| of[t as usize] = surface);
            if material.double_sided {
                sides.push(FlatMirror { outline: outline.clone(), normal: -normal, surface, reflectance });
            }
            sides.push(FlatMirror { outline, normal, surface, reflectance });
        }
        Self { sides, of }
    }
}

/// Largest reflectance at normal incidence that the factors alone give.
fn reflectance(material: &Material) -> f32 {
    let ratio = (material.ior - 1.0) / (material.ior + 1.0);
    let dielectric = ratio * ratio * material.specular;
    dielectric + (material.base_color.max_element() - dielectric) * material.metallic
}

fn reflects_sharply(material: &Material) -> bool {
    material.roughness * material.roughness <= MIRROR_ALPHA
        && material.transmission <= 0.0
        && material.normal_texture.is_none()
        && material.metallic_roughness_texture.is_none()
        && matches!(material.alpha_mode, AlphaMode::Opaque)
        && !material.unlit
        && reflectance(material) >= LEAST_REFLECTANCE
}

/// Area of a planar polygon [m²].
pub(crate) fn polygon_area(polygon: &[DVec3]) -> f64 {
    let Some(&first) = polygon.first() else { return 0.0 };
    let pairs = polygon.windows(2).map(|pair| (pair[0] - first).cross(pair[1] - first));
    0.5 * pairs.sum::<DVec3>().length()
}

/// Convex hull of points in a plane, counter-clockwise round `normal`, without corners on straight edges (Andrew 1979).
fn hull(points: Vec<DVec3>, normal: DVec3) -> Vec<DVec3> {
    let (x, y) = tangents(normal);
    let mut flat: Vec<(f64, f64, DVec3)> = points.into_iter().map(|p| (p.dot(x), p.dot(y), p)).collect();
    flat.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let size = flat.last().map_or(0.0, |last| last.0 - flat[0].0).max(1e-300);
    let turns_left = |a: &(f64, f64, DVec3), b: &(f64, f64, DVec3), c: &(f64, f64, DVec3)| {
        (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0) > 1e-9 * size * size
    };
    let chain = |points: &mut dyn Iterator<Item = (f64, f64, DVec3)>| {
        let mut chain: Vec<(f64, f64, DVec3)> = Vec::new();
        for p in points {
            while chain.len() >= 2 && !turns_left(&chain[chain.len() - 2], &chain[chain.len() - 1], &p) {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut outline = chain(&mut flat.iter().copied());
    outline.extend(chain(&mut flat.iter().rev().copied()));
    outline.into_iter().map(|(_, _, p)| p).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::illumination::test_rooms::Room;
    use glam::Vec3;

    #[test]
    fn triangles_of_one_plane_are_one_mirror_where_they_fill_their_hull() {
        let mut room = Room::default();
        let silver = room.material(Material { double_sided: true, ..Material::mirror(Vec3::splat(0.9)) });
        let matte = room.material(Material::diffuse(Vec3::ONE));
        // A wall of 3 × 2 tiles, an L of three tiles, a bent pair, and something matte.
        for (i, j) in (0..3).flat_map(|i| [(i, 0), (i, 1)]) {
            room.quad(DVec3::new(f64::from(i), f64::from(j), 0.0), DVec3::X, DVec3::Y, silver);
        }
        for (i, j) in [(0, 0), (1, 0), (0, 1)] {
            room.quad(DVec3::new(f64::from(i), f64::from(j), 2.0), DVec3::X, DVec3::Y, silver);
        }
        room.quad(DVec3::new(0.0, 0.0, 3.0), DVec3::X, DVec3::new(0.0, 1.0, 0.5), silver);
        room.quad(DVec3::new(0.0, 0.0, 5.0), DVec3::X, DVec3::Y, matte);
        let mirrors = FlatMirrors::new(&room.scene, 100);
        // The wall, six triangles of the L, the tilted one; each with two sides.
        assert_eq!(mirrors.sides.len(), 2 * (1 + 6 + 1));
        assert_eq!(mirrors.sides[0].outline.len(), 4);
        assert!((polygon_area(&mirrors.sides[0].outline) - 6.0).abs() < 1e-12);
        assert_eq!(mirrors.of.iter().filter(|&&m| m == mirrors.sides[0].surface).count(), 12);
        assert_eq!(&mirrors.of[mirrors.of.len() - 2..], [NONE; 2]);
        assert!(FlatMirrors::new(&room.scene, 0).sides.is_empty());
        let p = DVec3::new(0.3, 0.2, 1.5);
        assert!((mirrors.sides[0].image(p) - DVec3::new(0.3, 0.2, -1.5)).length() < 1e-12);
    }
}
