//! The mesh that indirect light is stored on: every triangle's sides, bisected where light changes fast.
//!
//! Each lit side of a scene triangle is the root of a binary tree; a split halves the longest edge, so that slivers
//! become compact. Irradiance is a value per vertex and linear over a leaf. Vertices are shared by elements of one
//! instance that meet with the same normal, so light is smooth over a surface and free to jump at its edges.

use super::sampling::hemisphere;
use crate::random::Random;
use crate::scene::Scene;
use crate::scene::bvh::{Ray, SceneBvh, Sides};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// No element: a side that stores no light.
pub(crate) const NONE: u32 = u32::MAX;
/// Rays that measure how near the surroundings of a vertex are.
const PROBE_SIDE: usize = 6;
/// By which part of the way to an element's middle its corners are drawn in before they look round: walls that meet
/// the element at its border are then not in the way.
const DRAWN_IN: f64 = 0.02;
/// Height above an element, over its longest edge, at which its points look at each other.
const LIFT: f64 = 0.005;
/// A vertex that sees hardly anything but the backs of one-sided surfaces stands inside a body.
const BURIED: f32 = 0.9;

/// A split: its two children stand side by side.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    /// First child, or 0 for a leaf.
    children: u32,
    /// By how many places the children's corners are rotated so that their longest edge comes first.
    rotations: [u8; 2],
}

/// Where indirect light is known.
#[derive(Clone, Debug)]
pub(crate) struct Vertex {
    pub(crate) position: DVec3,
    /// Unit shading normal.
    pub(crate) normal: DVec3,
    /// Sum of the geometric normals of its elements.
    facing: DVec3,
    /// Sum of its elements' middles, and their number.
    middles: DVec3,
    count: f64,
    /// Harmonic mean distance of what it sees [m].
    pub(crate) nearness: f32,
    /// Whether it stands inside a body, where light means nothing.
    pub(crate) buried: bool,
}

impl Vertex {
    /// Where rays of this vertex start: off the surface, and a little towards the middle of its elements, so that a
    /// vertex on an edge between two walls looks along neither of them.
    pub(crate) fn origin(&self, offset: f64) -> DVec3 {
        let middle = self.middles / self.count.max(1.0);
        self.position.lerp(middle, DRAWN_IN) + self.facing() * offset
    }
    /// Unit geometric normal, averaged over its elements.
    pub(crate) fn facing(&self) -> DVec3 {
        self.facing.normalize_or(self.normal)
    }
}

/// A piece of a triangle's side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element {
    /// Vertices, longest edge first.
    pub(crate) corners: [u32; 3],
    /// Weights of the triangle's second and third corner at the element's corners.
    pub(crate) barycentric: [[f64; 2]; 3],
    /// The scene's triangle.
    pub(crate) triangle: u32,
    /// Which side.
    pub(crate) front: bool,
    /// Whether something cuts through it, so that its vertices do not speak for all of it.
    pub(crate) doubtful: bool,
}

impl Element {
    /// Barycentric middle.
    pub(crate) fn middle(&self) -> [f64; 2] {
        let [a, b, c] = self.barycentric;
        [(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0]
    }
}

/// A part of the mesh that sends light of one strength.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sender {
    pub(crate) element: u32,
    /// Which corner's share of the element, if it is cut through.
    pub(crate) corner: Option<u8>,
}

/// All senders, and the first one of each leaf.
#[derive(Clone, Debug, Default)]
pub(crate) struct Senders {
    of: Vec<u32>,
    pub(crate) all: Vec<Sender>,
}

/// How fine the mesh is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fineness {
    /// Longest edge anywhere [m].
    pub(crate) longest: f64,
    /// Edges are not split below this [m].
    pub(crate) shortest: f64,
    /// Edges longer than this times the nearness of their surroundings are split.
    pub(crate) nearness: f64,
    /// No splitting beyond this many vertices.
    pub(crate) most_vertices: usize,
}

/// All elements of a scene.
#[derive(Clone)]
pub(crate) struct Elements {
    scene: Arc<Scene>,
    /// Front and back root of each triangle.
    roots: Vec<[u32; 2]>,
    /// Rotation of the roots' corners against the triangle's.
    root_rotations: Vec<u8>,
    nodes: Vec<Node>,
    pub(crate) elements: Vec<Element>,
    pub(crate) vertices: Vec<Vertex>,
    shared: HashMap<([u64; 3], [i16; 3], u32), u32>,
}

impl Elements {
    /// Meshes every side for which `lit(triangle, front)` holds and refines it round by round.
    pub(crate) fn new(bvh: &SceneBvh, fineness: Fineness, seed: u64, lit: impl Fn(u32, bool) -> bool) -> Self {
        let scene = bvh.scene();
        let mut mesh = Self {
            scene: scene.clone(),
            roots: vec![[NONE; 2]; scene.triangles.len()],
            root_rotations: vec![0; scene.triangles.len()],
            nodes: Vec::new(),
            elements: Vec::new(),
            vertices: Vec::new(),
            shared: HashMap::new(),
        };
        for index in 0..scene.triangles.len() as u32 {
            for front in [true, false] {
                let triangle = &scene.triangles[index as usize];
                let real = triangle.area() > 0.0 && triangle.positions.iter().all(|p| p.is_finite());
                if real && lit(index, front) {
                    mesh.plant(index, front);
                }
            }
        }
        mesh.split_where(fineness, |mesh, e| mesh.longest_edge(e) > fineness.longest);
        let mut probed = 0;
        loop {
            mesh.probe(bvh, probed, seed);
            probed = mesh.vertices.len();
            let split = mesh.split_where_once(fineness, |mesh, e| {
                let near = mesh.elements[e].corners.iter().map(|&v| mesh.vertices[v as usize].nearness);
                let near = f64::from(near.fold(f32::INFINITY, f32::min));
                let edge = mesh.longest_edge(e);
                edge > fineness.shortest && edge > fineness.nearness * near
            });
            if !split {
                break;
            }
        }
        mesh.doubt(bvh);
        mesh.shared = HashMap::new();
        mesh
    }

    /// What a leaf sends its light from: itself, or each of its corners where something cuts through it, since what
    /// one side of a wall is lit by must not be seen on the other.
    pub(crate) fn senders(&self) -> Senders {
        let mut senders = Senders { of: vec![NONE; self.elements.len()], all: Vec::new() };
        for e in self.leaves() {
            senders.of[e as usize] = senders.all.len() as u32;
            if self.elements[e as usize].doubtful {
                senders.all.extend((0..3).map(|k| Sender { element: e, corner: Some(k) }));
            } else {
                senders.all.push(Sender { element: e, corner: None });
            }
        }
        senders
    }

    /// The sender of a leaf for a point on it; for a leaf that is cut through, the one of the nearest corner that the
    /// point sees, if any.
    pub(crate) fn sender(&self, bvh: &SceneBvh, senders: &Senders, e: u32, weights: [f32; 3]) -> Option<u32> {
        let first = senders.of[e as usize];
        let element = &self.elements[e as usize];
        if !element.doubtful {
            return Some(first);
        }
        let corners = self.corners(e as usize);
        let point = corners[0] * f64::from(weights[0])
            + corners[1] * f64::from(weights[1])
            + corners[2] * f64::from(weights[2]);
        let lift = self.facing(element.triangle, element.front) * (LIFT * self.longest_edge(e as usize));
        let mut order = [0u8, 1, 2];
        order.sort_by(|&a, &b| weights[b as usize].total_cmp(&weights[a as usize]));
        let seen = |&&k: &&u8| {
            let vertex = &self.vertices[element.corners[k as usize] as usize];
            !vertex.buried && !bvh.occluded(point + lift, self.place(Sender { element: e, corner: Some(k) }) + lift)
        };
        // A body that stands in the element hides corners by its own edges, too: what is outside of it is then one side.
        let buried = |k: u8| self.vertices[element.corners[k as usize] as usize].buried;
        let in_a_body = order.iter().any(|&k| buried(k));
        let outside = || order.iter().find(|&&k| in_a_body && !buried(k));
        order.iter().find(seen).or_else(outside).map(|&k| first + u32::from(k))
    }

    /// Where a corner's light is measured and seen: near it, inside the element [m].
    fn place(&self, sender: Sender) -> DVec3 {
        let [a, b, c] = self.corners(sender.element as usize);
        let middle = (a + b + c) / 3.0;
        sender.corner.map_or(middle, |k| [a, b, c][k as usize].lerp(middle, DRAWN_IN))
    }

    /// Points that stand for equal parts of a sender: weights of its triangle's second and third corner.
    pub(crate) fn places(&self, sender: Sender) -> Vec<[f64; 2]> {
        let element = &self.elements[sender.element as usize];
        let middle = element.middle();
        let towards = |b: [f64; 2], part: f64| [b[0] + (middle[0] - b[0]) * part, b[1] + (middle[1] - b[1]) * part];
        match sender.corner {
            Some(k) => vec![towards(element.barycentric[k as usize], DRAWN_IN)],
            None => element.barycentric.iter().map(|&b| towards(b, 0.5)).chain([middle]).collect(),
        }
    }

    /// At most `most` vertices spread over the mesh: where rays of theirs start, and their normals.
    pub(crate) fn some_places(&self, most: usize, offset: f64) -> Vec<(DVec3, DVec3)> {
        let step = self.vertices.len().div_ceil(most).max(1);
        let chosen = self.vertices.iter().step_by(step).filter(|v| !v.buried);
        chosen.map(|v| (v.origin(offset), v.normal)).collect()
    }

    /// Mean over a sender of what is known at vertices; vertices inside bodies do not count.
    pub(crate) fn mean_over(&self, sender: Sender, x: &[Vec3]) -> Vec3 {
        let corners = self.elements[sender.element as usize].corners;
        if let Some(k) = sender.corner {
            return x[corners[k as usize] as usize];
        }
        corners.iter().map(|&v| x[v as usize]).sum::<Vec3>() / 3.0
    }

    /// The leaf at a point of a triangle's side, and the weights of its corners.
    pub(crate) fn locate(&self, triangle: u32, front: bool, barycentric: [f32; 2]) -> Option<(u32, [f32; 3])> {
        let root = self.roots[triangle as usize][usize::from(!front)];
        if root == NONE {
            return None;
        }
        let [v, w] = barycentric;
        let mut weights = rotated([1.0 - v - w, v, w], self.root_rotations[triangle as usize]);
        let mut at = root;
        loop {
            let node = self.nodes[at as usize];
            if node.children == 0 {
                return Some((at, weights));
            }
            // Which half a point lies in is as good as random: a branch here would be mispredicted every other time.
            let [a, b, c] = weights;
            let second = usize::from(b > a);
            let (apart, twice) = ((a - b).abs(), 2.0 * a.min(b));
            let pair = [c, apart, c];
            let (x, y) = (pair[second], pair[second + 1]);
            let turned = [x, y, twice, x, y];
            let by = usize::from(node.rotations[second]) % 3;
            weights = [turned[by], turned[by + 1], turned[by + 2]];
            at = node.children + second as u32;
        }
    }

    /// Whether an element is not split.
    pub(crate) fn is_leaf(&self, element: u32) -> bool {
        self.nodes[element as usize].children == 0
    }

    /// Elements that are not split.
    pub(crate) fn leaves(&self) -> impl Iterator<Item = u32> {
        (0..self.nodes.len() as u32).filter(|&e| self.is_leaf(e))
    }

    /// Area of an element [m²].
    pub(crate) fn area(&self, element: u32) -> f64 {
        let [a, b, c] = self.corners(element as usize);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Corners of an element [m].
    pub(crate) fn corners(&self, element: usize) -> [DVec3; 3] {
        self.elements[element].corners.map(|v| self.vertices[v as usize].position)
    }

    fn longest_edge(&self, element: usize) -> f64 {
        let [a, b, _] = self.corners(element);
        (b - a).length()
    }

    /// Unit geometric normal of an element's side.
    pub(crate) fn facing(&self, triangle: u32, front: bool) -> DVec3 {
        self.scene.triangles[triangle as usize].normal() * if front { 1.0 } else { -1.0 }
    }

    fn plant(&mut self, index: u32, front: bool) {
        let scene = self.scene.clone();
        let triangle = &scene.triangles[index as usize];
        let side = if front { 1.0 } else { -1.0 };
        let facing = self.facing(index, front);
        let corners: [u32; 3] = std::array::from_fn(|k| {
            let normal = (triangle.normals[k].as_dvec3() * side).normalize_or(facing);
            let normal = if normal.dot(facing) > 0.0 { normal } else { facing };
            self.vertex(triangle.corners()[k], normal, triangle.instance)
        });
        let rotation = self.longest_first(corners);
        let barycentric = rotated([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], rotation);
        let corners = rotated(corners, rotation);
        let root = self.push(Element { corners, barycentric, triangle: index, front, doubtful: false });
        self.count(root, 1.0);
        self.roots[index as usize][usize::from(!front)] = root;
        self.root_rotations[index as usize] = rotation;
    }

    fn vertex(&mut self, position: DVec3, normal: DVec3, instance: u32) -> u32 {
        // Corners that meet have the same bits, and so have midpoints of shared edges.
        let key = (
            (position + DVec3::ZERO).to_array().map(f64::to_bits),
            normal.to_array().map(|n| (n * 1000.0).round() as i16),
            instance,
        );
        let next = self.vertices.len() as u32;
        let vertices = &mut self.vertices;
        *self.shared.entry(key).or_insert_with(|| {
            vertices.push(Vertex {
                position,
                normal,
                facing: DVec3::ZERO,
                middles: DVec3::ZERO,
                count: 0.0,
                nearness: f32::INFINITY,
                buried: false,
            });
            next
        })
    }

    fn longest_first(&self, corners: [u32; 3]) -> u8 {
        let p = corners.map(|v| self.vertices[v as usize].position);
        let squares = [(p[1] - p[0]), (p[2] - p[1]), (p[0] - p[2])].map(|d| d.length_squared());
        // Of equal edges the first, so that a mesh is always the same.
        if squares[0] >= squares[1] && squares[0] >= squares[2] {
            0
        } else if squares[1] >= squares[2] {
            1
        } else {
            2
        }
    }

    fn push(&mut self, element: Element) -> u32 {
        self.elements.push(element);
        self.nodes.push(Node::default());
        self.nodes.len() as u32 - 1
    }

    /// Tells an element's vertices where it lies (`sign` 1), or that it no longer counts (−1).
    fn count(&mut self, element: u32, sign: f64) {
        let Element { corners, triangle, front, .. } = self.elements[element as usize];
        let [a, b, c] = self.corners(element as usize);
        let (middle, facing) = ((a + b + c) / 3.0, self.facing(triangle, front));
        for v in corners {
            let vertex = &mut self.vertices[v as usize];
            vertex.facing += facing * sign;
            vertex.middles += middle * sign;
            vertex.count += sign;
        }
    }

    fn split_where(&mut self, fineness: Fineness, wish: impl Fn(&Self, usize) -> bool + Copy) {
        while self.split_where_once(fineness, wish) {}
    }

    /// Splits the leaves that wish it; whether there were any.
    fn split_where_once(&mut self, fineness: Fineness, wish: impl Fn(&Self, usize) -> bool) -> bool {
        let chosen: Vec<u32> = self.leaves().filter(|&e| wish(self, e as usize)).collect();
        let mut any = false;
        for e in chosen {
            if self.vertices.len() < fineness.most_vertices {
                self.split(e);
                any = true;
            }
        }
        any
    }

    fn split(&mut self, e: u32) {
        let element = self.elements[e as usize];
        let [a, b, c] = element.corners;
        let [ba, bb, bc] = element.barycentric;
        let (va, vb) = (&self.vertices[a as usize], &self.vertices[b as usize]);
        let position = (va.position + vb.position) * 0.5;
        let normal = (va.normal + vb.normal).normalize_or(va.normal);
        let m = self.vertex(position, normal, self.scene.triangles[element.triangle as usize].instance);
        let bm = [(ba[0] + bb[0]) * 0.5, (ba[1] + bb[1]) * 0.5];
        self.count(e, -1.0);
        let children = [([c, a, m], [bc, ba, bm]), ([b, c, m], [bb, bc, bm])];
        let mut rotations = [0; 2];
        let first = self.nodes.len() as u32;
        for (rotation, (corners, barycentric)) in rotations.iter_mut().zip(children) {
            *rotation = self.longest_first(corners);
            let (corners, barycentric) = (rotated(corners, *rotation), rotated(barycentric, *rotation));
            let child = self.push(Element { corners, barycentric, ..element });
            self.count(child, 1.0);
        }
        self.nodes[e as usize] = Node { children: first, rotations };
    }

    /// Measures how near the surroundings of the vertices from `from` on are.
    fn probe(&mut self, bvh: &SceneBvh, from: usize, seed: u64) {
        self.vertices[from..].par_iter_mut().enumerate().for_each(|(k, vertex)| {
            let mut random = Random::new(seed, (from + k) as u64);
            let (facing, origin) = (vertex.facing(), vertex.origin(bvh.offset()));
            let (mut inverse, mut rays, mut backs) = (0.0, 0.0f32, 0.0);
            for direction in hemisphere(vertex.normal, PROBE_SIDE, &mut random) {
                if direction.dot(facing) <= 0.0 {
                    continue;
                }
                rays += 1.0;
                if let Some(hit) = bvh.meet(&Ray { origin, direction }, 0.0, f64::INFINITY, Sides::Both) {
                    inverse += 1.0 / hit.distance.max(f32::MIN_POSITIVE);
                    let one_sided = !bvh.scene().material(hit.triangle).double_sided;
                    backs += if !hit.front && one_sided { 1.0 } else { 0.0 };
                }
            }
            vertex.nearness = if inverse > 0.0 { rays / inverse } else { f32::INFINITY };
            vertex.buried = rays > 0.0 && backs > BURIED * rays;
        });
    }

    /// Finds the leaves that something cuts through or borders on, or that reach into a body.
    fn doubt(&mut self, bvh: &SceneBvh) {
        let leaves: Vec<u32> = self.leaves().collect();
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); self.vertices.len()];
        for &e in &leaves {
            for v in self.elements[e as usize].corners {
                around[v as usize].push(e);
            }
        }
        let side = |e: u32| {
            let element = &self.elements[e as usize];
            self.facing(element.triangle, element.front)
        };
        let lifted_middle = |e: u32| {
            let [a, b, c] = self.corners(e as usize);
            (a + b + c) / 3.0 + side(e) * (LIFT * self.longest_edge(e as usize))
        };
        // A sheet that stands right on a vertex is met between the elements round it, not inside any of them. Over a
        // bend elements need not see each other.
        let torn: Vec<bool> = around
            .par_iter()
            .map(|leaves| {
                let Some((&first, rest)) = leaves.split_first() else { return false };
                let flat = |&&e: &&u32| side(e).dot(side(first)) > 0.9999;
                rest.iter().filter(flat).any(|&e| bvh.occluded(lifted_middle(first), lifted_middle(e)))
            })
            .collect();
        let doubtful: Vec<bool> = leaves
            .par_iter()
            .map(|&e| {
                let element = &self.elements[e as usize];
                if element.corners.iter().any(|&v| self.vertices[v as usize].buried || torn[v as usize]) {
                    return true;
                }
                let corners = self.corners(e as usize);
                let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
                let lift = side(e) * (LIFT * self.longest_edge(e as usize));
                // Drawn in a little, so that walls that meet the element at its border do not count.
                let [a, b, c] = corners.map(|p| p.lerp(middle, DRAWN_IN) + lift);
                [(a, b), (b, c), (c, a)].into_iter().any(|(p, q)| bvh.occluded(p, q))
            })
            .collect();
        for (&e, doubtful) in leaves.iter().zip(doubtful) {
            self.elements[e as usize].doubtful = doubtful;
        }
    }
}

fn rotated<T: Copy>(corners: [T; 3], by: u8) -> [T; 3] {
    std::array::from_fn(|k| corners[(k + by as usize) % 3])
}
