//! Ray casting: the only file that names `obvhs`.
//!
//! Traversal runs in f32 on the scene's own f32 corners; a hit is then refined in f64 by the intersection of the ray
//! with the plane of the triangle that was found, so that depths keep their digits at any distance.
//!
//! *Sides.* Eyes pass the back of a one-sided surface ([`Sides::Front`], what glTF calls culling), so that a camera may
//! stand outside a room of one-sided walls. Light does not ([`Sides::Both`]): a sheet that is not drawn from behind
//! still stands in the way and is black there, or the lamp of the next room would shine through every such wall.
//!
//! *Holes.* Where a masked material's alpha is below its cutoff there is no surface for any ray.

use super::{AlphaMode, Scene};
use crate::random::Random;
use glam::{DVec3, Vec2, Vec3A};
use obvhs::rt_triangle::RtTriangle;
use obvhs::{BvhBuildParams, aabb::Aabb, cwbvh::CwBvh, cwbvh::builder::build_cwbvh, ray};
use std::sync::Arc;

/// A ray in world space, double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Start [m].
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

impl Ray {
    /// The point at a distance along the ray [m].
    pub fn at(&self, distance: f64) -> DVec3 {
        self.origin + self.direction * distance
    }
}

/// Which sides of one-sided surfaces stop a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// Front sides only: what an eye sees.
    Front,
    /// Both sides: what stands in the way of light.
    Both,
}

/// Where a ray meets a triangle, in double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index into [`Scene::triangles`].
    pub triangle: u32,
    /// Distance along the ray [m].
    pub distance: f64,
    /// Where [m].
    pub position: DVec3,
    /// Weights of the second and third corner; the first has one minus their sum.
    pub barycentric: [f64; 2],
    /// Whether the counter-clockwise side was met.
    pub front: bool,
}

/// A hit as traversal leaves it, in single precision: enough to look light up, not to place a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Index into [`Scene::triangles`].
    pub triangle: u32,
    /// Distance along the ray [m].
    pub distance: f32,
    /// Weights of the second and third corner.
    pub barycentric: [f32; 2],
    /// Whether the counter-clockwise side was met.
    pub front: bool,
}

const ONE_SIDED: u32 = 1;
const MASKED: u32 = 2;

/// A triangle as traversal wants it, in the order of the tree's leaves.
#[derive(Clone, Copy)]
struct Leaf {
    triangle: RtTriangle,
    index: u32,
    flags: u32,
}

/// The scene's triangles in a bounding volume hierarchy (obvhs, eight-wide compressed).
pub struct SceneBvh {
    scene: Arc<Scene>,
    tree: CwBvh,
    leaves: Vec<Leaf>,
    /// Units of traversal per metre: a power of two that makes the scene about a thousand units large, since obvhs
    /// passes boxes that end nearer than 1e-4 units.
    scale: f64,
    /// Length by which rays start off the surface that they leave [m].
    offset: f64,
    /// Diagonal of the box round the scene [m].
    size: f64,
}

impl SceneBvh {
    /// Builds the tree. Triangles without area and with corners that are not finite are left out: no ray meets them.
    pub fn new(scene: impl Into<Arc<Scene>>) -> Self {
        let scene = scene.into();
        let mut indices = Vec::with_capacity(scene.triangles.len());
        let mut triangles = Vec::with_capacity(scene.triangles.len());
        let mut reach = 0.0f64;
        for (index, triangle) in scene.triangles.iter().enumerate() {
            if triangle.area() > 0.0 && triangle.positions.iter().all(|p| p.is_finite()) {
                indices.push(index as u32);
                reach = triangle.corners().iter().fold(reach, |r, p| r.max(p.abs().max_element()));
            }
        }
        let reach = reach.max(1e-20);
        let scale = (1000.0 / reach).log2().round().exp2();
        for &index in &indices {
            let [v0, v1, v2] = scene.triangles[index as usize].corners().map(|p| (p * scale).as_vec3a());
            triangles.push(obvhs::triangle::Triangle { v0, v1, v2 });
        }
        let mut tree = if triangles.is_empty() {
            CwBvh::default()
        } else {
            let boxes: Vec<Aabb> =
                triangles.iter().enumerate().map(|(i, t)| uneven(t.aabb(), i as u64, reach * scale)).collect();
            build_cwbvh(&boxes, BvhBuildParams::medium_build(), &mut std::time::Duration::default())
        };
        let leaves = tree
            .primitive_indices
            .iter()
            .map(|&i| {
                let index = indices[i as usize];
                let material = scene.material(index);
                // Light that went into a glass body must find the way out.
                let two_sided = material.double_sided || material.transmission > 0.0;
                let one_sided = if two_sided { 0 } else { ONE_SIDED };
                let masked = if matches!(material.alpha_mode, AlphaMode::Mask(_)) { MASKED } else { 0 };
                Leaf { triangle: RtTriangle::from(&triangles[i as usize]), index, flags: one_sided | masked }
            })
            .collect();
        tree.exact_node_aabbs = None;
        // A corner at distance `reach` from the world's origin is rounded by up to 6e-8 of it, and traversal adds a
        // few roundings of the same size: 4e-6 is beyond them and far below anything that is modelled.
        let size = scene.bounds().map_or(0.0, |(low, high)| (high - low).length());
        Self { scene, tree, leaves, scale, offset: 4e-6 * reach, size }
    }

    /// The scene that the tree was built from.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// Number of triangles that rays can meet.
    pub fn triangle_count(&self) -> usize {
        self.leaves.len()
    }

    /// How far a ray's start is to be lifted off a surface so that it does not meet it again [m].
    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// Diagonal of the box round the scene [m].
    pub fn size(&self) -> f64 {
        self.size
    }

    /// First surface along a ray beyond `min` and before `max` [m], in single precision.
    pub fn meet(&self, ray: &Ray, min: f64, max: f64, sides: Sides) -> Option<Meeting> {
        if self.leaves.is_empty() {
            return None;
        }
        let mut hit = ray::RayHit::none();
        let cast = self.traversal(ray.origin, ray.direction, min, max);
        let found = self.tree.ray_traverse(cast, &mut hit, |r, id| self.distance(r, id, sides));
        found.then(|| {
            let leaf = &self.leaves[hit.primitive_id as usize];
            let barycentric = leaf.triangle.compute_barycentric(&cast).to_array();
            let front = leaf.triangle.ng.dot(cast.direction) > 0.0;
            Meeting { triangle: leaf.index, distance: hit.t / self.scale as f32, barycentric, front }
        })
    }

    /// First surface that an eye sees along a ray beyond `min` [m]; NaN directions meet nothing.
    pub fn nearest(&self, ray: &Ray, min: f64, sides: Sides) -> Option<Hit> {
        self.meet(ray, min, f64::INFINITY, sides).map(|meeting| self.refined(ray, &meeting))
    }

    /// The same for a ray that starts on a surface with unit geometric `normal`: traversal starts off the surface by
    /// [`SceneBvh::offset`], on the side to which the ray goes, but the distance is measured from the ray's own origin.
    pub(crate) fn nearest_leaving(&self, ray: &Ray, normal: DVec3, sides: Sides) -> Option<Hit> {
        let side = self.offset.copysign(normal.dot(ray.direction));
        let lifted = Ray { origin: ray.origin + normal * side, direction: ray.direction };
        self.meet(&lifted, 0.0, f64::INFINITY, sides).map(|meeting| self.refined(ray, &meeting))
    }

    /// The hit in double precision.
    pub fn refined(&self, ray: &Ray, meeting: &Meeting) -> Hit {
        let triangle = &self.scene.triangles[meeting.triangle as usize];
        let [a, b, c] = triangle.corners();
        let cross = triangle.cross();
        let slope = cross.dot(ray.direction);
        // A ray in the triangle's own plane has no better distance than the one that traversal found.
        let exact = cross.dot(a - ray.origin) / slope;
        let trusted = exact.is_finite() && (exact - f64::from(meeting.distance)).abs() <= 64.0 * self.offset;
        let distance = if trusted { exact } else { f64::from(meeting.distance) };
        let position = ray.at(distance);
        let squared = cross.length_squared();
        let v = ((c - b).cross(position - b)).dot(cross) / squared;
        let w = ((a - c).cross(position - c)).dot(cross) / squared;
        let (u, v) = (w.clamp(0.0, 1.0), (1.0 - v - w).clamp(0.0, 1.0));
        Hit { triangle: meeting.triangle, distance, position, barycentric: [u, v], front: slope < 0.0 }
    }

    /// Whether anything that stops light stands on the open segment between two points. Both ends should be lifted off
    /// their surfaces by [`SceneBvh::offset`].
    pub fn occluded(&self, from: DVec3, to: DVec3) -> bool {
        let span = to - from;
        let length = span.length();
        if self.leaves.is_empty() || length.is_nan() || length <= 0.0 {
            return false;
        }
        let cast = self.traversal(from, span / length, 0.0, length);
        !self.tree.ray_traverse_miss(cast, |r, id| self.distance(r, id, Sides::Both))
    }

    /// Whether `chosen` holds for any triangle in boxes (lowest and highest corner) for which `entered` holds [m].
    pub(crate) fn any_triangle(&self, entered: impl Fn(DVec3, DVec3) -> bool, chosen: impl Fn(u32) -> bool) -> bool {
        if self.leaves.is_empty() {
            return false;
        }
        let mut open = vec![0u32];
        while let Some(index) = open.pop() {
            let node = &self.tree.nodes[index as usize];
            for child in (0..8).filter(|&child| !node.is_child_empty(child)) {
                let bounds = node.child_aabb(child);
                if !entered(bounds.min.as_dvec3() / self.scale, bounds.max.as_dvec3() / self.scale) {
                    continue;
                }
                if node.is_leaf(child) {
                    let (first, count) = node.child_primitives(child);
                    if (first..first + count).any(|leaf| chosen(self.leaves[leaf as usize].index)) {
                        return true;
                    }
                } else {
                    open.push(node.child_node_index(child));
                }
            }
        }
        false
    }

    fn traversal(&self, origin: DVec3, direction: DVec3, min: f64, max: f64) -> ray::Ray {
        // Adding zero turns −0 into 0: obvhs takes −0 for a negative slope in one place and for none in another, and
        // loses the boxes that it then enters from behind.
        let direction = direction.as_vec3a() + Vec3A::ZERO;
        ray::Ray::new((origin * self.scale).as_vec3a(), direction, (min * self.scale) as f32, (max * self.scale) as f32)
    }

    #[inline(always)]
    fn distance(&self, ray: &ray::Ray, id: usize, sides: Sides) -> f32 {
        let leaf = &self.leaves[id];
        let distance = intersect(&leaf.triangle, ray);
        if distance == f32::INFINITY || leaf.flags == 0 {
            return distance;
        }
        let back = leaf.triangle.ng.dot(ray.direction) <= 0.0;
        let culled = back && sides == Sides::Front && leaf.flags & ONE_SIDED != 0;
        if culled || (leaf.flags & MASKED != 0 && self.is_hole(leaf, ray)) {
            return f32::INFINITY;
        }
        distance
    }

    #[cold]
    fn is_hole(&self, leaf: &Leaf, ray: &ray::Ray) -> bool {
        let weights: Vec2 = leaf.triangle.compute_barycentric(ray);
        let material = self.scene.material(leaf.index);
        let AlphaMode::Mask(cutoff) = material.alpha_mode else { return false };
        let alpha = material.base_color_texture.map_or(1.0, |reference| {
            let triangle = &self.scene.triangles[leaf.index as usize];
            let [a, b, c] = triangle.texcoords.map(|sets| sets[reference.texcoord as usize & 1]);
            let uv = a + (b - a) * weights.x + (c - a) * weights.y;
            self.scene.textures[reference.texture as usize].sample(reference.transform(uv), 0.0).w
        });
        alpha * material.alpha < cutoff
    }
}

/// Largest growth of a triangle's box over the size of the scene.
const UNEVENNESS: f64 = 1e-5;

/// A box grown by a little on each side, differently for each triangle: where many boxes are exactly alike, as in a wall
/// that is a regular grid, the builder pairs them badly and rays become ten times slower.
fn uneven(bounds: Aabb, index: u64, size: f64) -> Aabb {
    let mut random = Random::new(0xb0c5, index);
    let mut growth = || Vec3A::from_array(std::array::from_fn(|_| (random.uniform() * UNEVENNESS * size) as f32));
    Aabb::new(bounds.min - growth(), bounds.max + growth())
}

/// By how much of its own size a triangle is widened, so that no ray slips through between two that share an edge: the
/// roundings of their tests differ.
const OVERLAP: f32 = 1e-5;

/// Distance at which a ray meets a triangle; infinite if it does not (Möller & Trumbore 1997).
#[inline(always)]
fn intersect(triangle: &RtTriangle, ray: &ray::Ray) -> f32 {
    let c = triangle.v0 - ray.origin;
    let r = ray.direction.cross(c);
    let inverse = 1.0 / triangle.ng.dot(ray.direction);
    let (u, v) = (r.dot(triangle.e2) * inverse, r.dot(triangle.e1) * inverse);
    let distance = triangle.ng.dot(c) * inverse;
    // All comparisons fail for NaN, which a ray in the triangle's own plane gives.
    let inside = u >= -OVERLAP && v >= -OVERLAP && u + v <= 1.0 + OVERLAP;
    if inside && distance >= ray.tmin && distance <= ray.tmax { distance } else { f32::INFINITY }
}
