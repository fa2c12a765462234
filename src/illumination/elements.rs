//! The mesh that indirect light is stored on: every triangle's sides, bisected where light changes fast.
//!
//! Each lit side of a scene triangle is the root of a binary tree; a split halves the longest edge, so that slivers
//! become compact. Irradiance is a value per vertex and linear over a leaf. Vertices are shared by elements of one
//! instance that meet with the same normal, so light is smooth over a surface and free to jump at its edges.

use super::pieces::{MANY, PIECES, Part, in_piece, middles, piece};
use super::surface::ShadingPoint;
use crate::scene::Scene;
use crate::scene::bvh::SceneBvh;
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::sync::Arc;

/// No element: a side that stores no light.
pub(crate) const NONE: u32 = u32::MAX;
/// By which part of the way to an element's middle its corners are drawn in before they look round: walls that meet
/// the element at its border are then not in the way.
pub(super) const DRAWN_IN: f64 = 0.02;
/// Height above an element, over its longest edge, at which its points look at each other.
pub(super) const LIFT: f64 = 0.005;
/// A split: its two children stand side by side.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Node {
    /// First child, or 0 for a leaf.
    pub(super) children: u32,
    /// By how many places the children's corners are rotated so that their longest edge comes first.
    pub(super) rotations: [u8; 2],
}

/// Where indirect light is known.
#[derive(Clone, Debug)]
pub(crate) struct Vertex {
    pub(crate) position: DVec3,
    /// Unit shading normal.
    pub(crate) normal: DVec3,
    /// The thing that it is part of.
    pub(super) instance: u32,
    /// Sum of the geometric normals of its elements.
    pub(super) facing: DVec3,
    /// Sum of its elements' middles, and their number.
    pub(super) middles: DVec3,
    pub(super) count: f64,
    /// Harmonic mean distance of what it sees [m].
    pub(crate) nearness: f32,
    /// Whether it stands inside a body, where light means nothing.
    pub(crate) buried: bool,
}

impl Vertex {
    /// Where rays of this vertex start: off the surface, and a little towards the middle of its elements, so that a
    /// vertex on an edge between two walls looks along neither of them; not into a body that is round there.
    pub(crate) fn origin(&self, offset: f64) -> DVec3 {
        let facing = self.facing();
        let towards = (self.middles / self.count.max(1.0) - self.position) * DRAWN_IN;
        self.position + towards + facing * (offset - towards.dot(facing).min(0.0))
    }
    /// Where its light is measured.
    pub(crate) fn shading_point(&self, offset: f64) -> ShadingPoint {
        ShadingPoint { position: self.origin(offset), normal: self.normal }
    }
    /// Unit geometric normal, averaged over its elements.
    pub(crate) fn facing(&self) -> DVec3 {
        self.facing.normalize_or(self.normal)
    }
}

/// Vertices of one thing that stand in one place and face about the same way, as those of flat triangles that meet there do.
pub(crate) struct Sites {
    /// A vertex of each.
    pub(crate) first: Vec<u32>,
    /// The site of each vertex.
    pub(crate) of: Vec<u32>,
}

impl Sites {
    /// Sites of vertices; those inside bodies are apart from others.
    pub(crate) fn new(vertices: &[Vertex]) -> Self {
        let mut known = HashMap::with_capacity(vertices.len() / 2);
        let (mut first, mut of) = (Vec::new(), Vec::with_capacity(vertices.len()));
        for (index, vertex) in vertices.iter().enumerate() {
            let place = (vertex.position + DVec3::ZERO).to_array().map(f64::to_bits);
            let way = vertex.normal.to_array().map(|n| (n * 4.0).round() as i8);
            let site = *known.entry((place, way, vertex.instance, vertex.buried)).or_insert_with(|| {
                first.push(index as u32);
                first.len() as u32 - 1
            });
            of.push(site);
        }
        Self { first, of }
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
    pub(crate) cut: bool,
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
    pub(crate) part: Part,
}

/// All senders, and the first one of each leaf.
#[derive(Clone, Debug, Default)]
pub(crate) struct Senders {
    of: Vec<u32>,
    pub(crate) all: Vec<Sender>,
}

/// All elements of a scene.
#[derive(Clone)]
pub(crate) struct Elements {
    pub(super) scene: Arc<Scene>,
    /// Front and back root of each triangle.
    pub(super) roots: Vec<[u32; 2]>,
    /// Rotation of the roots' corners against the triangle's.
    pub(super) root_rotations: Vec<u8>,
    pub(super) nodes: Vec<Node>,
    pub(crate) elements: Vec<Element>,
    pub(crate) vertices: Vec<Vertex>,
    pub(super) shared: HashMap<([u64; 3], [i16; 3], u32), u32>,
}

impl Elements {
    /// What a leaf sends its light from: itself, or each of its corners where something cuts through it, since what
    /// one side of a wall is lit by must not be seen on the other.
    pub(crate) fn senders(&self) -> Senders {
        let mut senders = Senders { of: vec![NONE; self.elements.len()], all: Vec::new() };
        for e in self.leaves() {
            senders.of[e as usize] = senders.all.len() as u32;
            if self.elements[e as usize].cut {
                senders.all.extend((0..3).map(|k| Sender { element: e, part: Part::Corner(k) }));
            } else {
                senders.all.push(Sender { element: e, part: Part::Whole });
            }
        }
        senders
    }

    /// The same with the chosen ones, whole leaves all, in pieces; `parted` has one flag for each of `senders`.
    pub(crate) fn parted(&self, senders: &Senders, parted: impl Fn(usize) -> bool) -> Senders {
        let mut finer = Senders { of: vec![NONE; self.elements.len()], all: Vec::with_capacity(senders.all.len()) };
        for (number, sender) in senders.all.iter().enumerate() {
            let first = &mut finer.of[sender.element as usize];
            *first = (*first).min(finer.all.len() as u32);
            if parted(number) {
                finer.all.extend((0..PIECES as u8).map(|k| Sender { part: Part::Piece(k), ..*sender }));
            } else {
                finer.all.push(*sender);
            }
        }
        finer
    }

    /// The sender of a leaf for a point on it; for a leaf that is cut through, the one of the nearest corner that the
    /// point sees, if any.
    pub(crate) fn sender(&self, bvh: &SceneBvh, senders: &Senders, e: u32, weights: [f32; 3]) -> Option<u32> {
        let first = senders.of[e as usize];
        let element = &self.elements[e as usize];
        match senders.all[first as usize].part {
            Part::Whole => return Some(first),
            Part::Piece(_) => return Some(first + u32::from(piece(f64::from(weights[1]), f64::from(weights[2])))),
            Part::Corner(_) => {}
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
            !vertex.buried && !bvh.occluded(point + lift, self.near_corner(e, k) + lift)
        };
        // A body that stands in the element hides corners by its own edges, too: what is outside of it is then one side.
        let buried = |k: u8| self.vertices[element.corners[k as usize] as usize].buried;
        let in_a_body = order.iter().any(|&k| buried(k));
        let outside = || order.iter().find(|&&k| in_a_body && !buried(k));
        order.iter().find(seen).or_else(outside).map(|&k| first + u32::from(k))
    }

    /// Where the light of a corner's share is measured and seen: near it, inside the element [m].
    fn near_corner(&self, element: u32, k: u8) -> DVec3 {
        let [a, b, c] = self.corners(element as usize);
        [a, b, c][k as usize].lerp((a + b + c) / 3.0, DRAWN_IN)
    }

    /// Points that stand for equal parts of a leaf, or of a corner's share of it: weights of its triangle's second and third
    /// corner.
    pub(crate) fn places(&self, sender: Sender) -> Vec<[f64; 2]> {
        let element = &self.elements[sender.element as usize];
        let middle = element.middle();
        let towards = |b: [f64; 2], part: f64| [b[0] + (middle[0] - b[0]) * part, b[1] + (middle[1] - b[1]) * part];
        match sender.part {
            Part::Corner(k) => vec![towards(element.barycentric[k as usize], DRAWN_IN)],
            Part::Whole | Part::Piece(_) => {
                element.barycentric.iter().map(|&b| towards(b, 0.5)).chain([middle]).collect()
            }
        }
    }

    /// Middles of [`MANY`]² equal parts of an element, as [`Elements::places`], each with the piece that it lies in.
    pub(crate) fn many_places(&self, element: u32) -> Vec<([f64; 2], u8)> {
        let [a, b, c] = self.elements[element as usize].barycentric;
        let at = |u: f64, v: f64| std::array::from_fn(|k| a[k] + (b[k] - a[k]) * u + (c[k] - a[k]) * v);
        middles(MANY).map(|(u, v)| (at(u, v), piece(u, v))).collect()
    }

    /// Middles of `n`² equal parts of a piece of an element, as [`Elements::places`].
    pub(crate) fn places_in(&self, element: u32, piece: u8, n: u8) -> Vec<[f64; 2]> {
        let [a, b, c] = self.elements[element as usize].barycentric;
        let at = |(u, v): (f64, f64)| {
            let (u, v) = in_piece(piece, u, v);
            std::array::from_fn(|k| a[k] + (b[k] - a[k]) * u + (c[k] - a[k]) * v)
        };
        middles(n).map(at).collect()
    }

    /// At most `most` vertices spread over the mesh.
    pub(crate) fn some_places(&self, most: usize, offset: f64) -> Vec<ShadingPoint> {
        let step = self.vertices.len().div_ceil(most).max(1);
        let chosen = self.vertices.iter().step_by(step).filter(|v| !v.buried);
        chosen.map(|v| v.shading_point(offset)).collect()
    }

    /// Mean over a sender of what is known at vertices; vertices inside bodies do not count.
    pub(crate) fn mean_over(&self, sender: Sender, x: &[Vec3]) -> Vec3 {
        let corners = self.elements[sender.element as usize].corners;
        let weights = sender.part.weights();
        corners.iter().zip(weights).map(|(&v, w)| x[v as usize] * w).sum()
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

    pub(super) fn longest_edge(&self, element: usize) -> f64 {
        let [a, b, _] = self.corners(element);
        (b - a).length()
    }

    /// Unit geometric normal of an element's side.
    pub(crate) fn facing(&self, triangle: u32, front: bool) -> DVec3 {
        self.scene.triangles[triangle as usize].normal() * if front { 1.0 } else { -1.0 }
    }
}

pub(super) fn rotated<T: Copy>(corners: [T; 3], by: u8) -> [T; 3] {
    std::array::from_fn(|k| corners[(k + by as usize) % 3])
}
