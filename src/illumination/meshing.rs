//! Making the mesh: sides of triangles are bisected as finely as the nearness of their surroundings asks for.

use super::elements::{DRAWN_IN, Element, Elements, LIFT, NONE, Node, Sites, Vertex, rotated};
use super::sampling::hemisphere;
use crate::error::Result;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::bvh::{Ray, SceneBvh, Sides};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::HashMap;

/// Rays, squared, that measure how near the surroundings of a vertex are, and those that only tell whether it stands in a body.
const PROBE_SIDE: usize = 6;
const BODY_SIDE: usize = 4;
/// A vertex that sees hardly anything but the backs of one-sided surfaces stands inside a body.
const BURIED: f32 = 0.9;

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

impl Elements {
    /// Meshes every side for which `lit(triangle, front)` holds and refines it round by round.
    ///
    /// # Errors
    /// [`crate::error::Error::Interrupted`] when asked to stop.
    pub(crate) fn new(
        bvh: &SceneBvh,
        fineness: Fineness,
        seed: u64,
        lit: impl Fn(u32, bool) -> bool,
        progress: &Progress,
    ) -> Result<Self> {
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
            progress.check()?;
            for front in [true, false] {
                let triangle = &scene.triangles[index as usize];
                let real = triangle.area() > 0.0 && triangle.positions.iter().all(|p| p.is_finite());
                if real && lit(index, front) {
                    mesh.add_root(index, front);
                }
            }
        }
        mesh.split_where(fineness, |mesh, e| mesh.longest_edge(e) > fineness.longest);
        let mut probed = 0;
        loop {
            mesh.probe(bvh, probed, fineness.shortest, seed, progress)?;
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
        mesh.mark_cut(bvh, progress)?;
        mesh.shared = HashMap::new();
        Ok(mesh)
    }

    fn add_root(&mut self, index: u32, front: bool) {
        let triangle = self.scene.triangles[index as usize].clone();
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
        let root = self.push(Element { corners, barycentric, triangle: index, front, cut: false });
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
                instance,
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

    fn split_where(&mut self, fineness: Fineness, chosen: impl Fn(&Self, usize) -> bool + Copy) {
        while self.split_where_once(fineness, chosen) {}
    }

    /// Splits the leaves for which `chosen` holds; whether there were any.
    fn split_where_once(&mut self, fineness: Fineness, chosen: impl Fn(&Self, usize) -> bool) -> bool {
        let leaves: Vec<u32> = self.leaves().filter(|&e| chosen(self, e as usize)).collect();
        let mut any = false;
        for e in leaves {
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

    /// Measures how near the surroundings of the vertices from `from` on are, where their elements may be split, and whether they
    /// stand in bodies, where there are some.
    fn probe(&mut self, bvh: &SceneBvh, from: usize, shortest: f64, seed: u64, progress: &Progress) -> Result<()> {
        let mut longest = vec![0.0f64; self.vertices.len()];
        for e in self.leaves() {
            let edge = self.longest_edge(e as usize);
            for v in self.elements[e as usize].corners {
                longest[v as usize] = longest[v as usize].max(edge);
            }
        }
        let has_bodies = self.scene.materials.iter().any(|material| !material.double_sided);
        let vertices = &self.vertices[from..];
        let sites = Sites::new(vertices);
        let mut edges = vec![0.0f64; sites.first.len()];
        for (&site, &edge) in sites.of.iter().zip(&longest[from..]) {
            edges[site as usize] = edges[site as usize].max(edge);
        }
        let look = |(&first, &edge): (&u32, &f64)| {
            let side = match (edge > shortest, has_bodies) {
                (true, _) => PROBE_SIDE,
                (false, true) => BODY_SIDE,
                (false, false) => return (f32::INFINITY, false),
            };
            if progress.stopped() {
                return (f32::INFINITY, false);
            }
            let vertex = &vertices[first as usize];
            let mut random = Random::new(seed, from as u64 + u64::from(first));
            let (facing, origin) = (vertex.facing(), vertex.origin(bvh.offset()));
            let (mut inverse, mut rays, mut backs) = (0.0, 0.0f32, 0.0);
            for direction in hemisphere(vertex.normal, side, &mut random) {
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
            (if inverse > 0.0 { rays / inverse } else { f32::INFINITY }, rays > 0.0 && backs > BURIED * rays)
        };
        let found: Vec<(f32, bool)> = sites.first.par_iter().zip(&edges).map(look).collect();
        for (vertex, &site) in self.vertices[from..].iter_mut().zip(&sites.of) {
            (vertex.nearness, vertex.buried) = found[site as usize];
        }
        progress.check()
    }

    /// Finds the leaves that something cuts through or borders on, or that reach into a body.
    fn mark_cut(&mut self, bvh: &SceneBvh, progress: &Progress) -> Result<()> {
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
        // A sheet that stands right on a vertex is met between the elements round it, not inside any of them. Across a
        // crease elements need not see each other.
        let torn: Vec<bool> = around
            .par_iter()
            .map(|leaves| {
                let Some((&first, rest)) = leaves.split_first() else { return false };
                let flat = |&&e: &&u32| side(e).dot(side(first)) > 0.9999;
                rest.iter().filter(flat).any(|&e| bvh.occluded(lifted_middle(first), lifted_middle(e)))
            })
            .collect();
        let cut: Vec<bool> = leaves
            .par_iter()
            .map(|&e| {
                let element = &self.elements[e as usize];
                if progress.stopped()
                    || element.corners.iter().any(|&v| self.vertices[v as usize].buried || torn[v as usize])
                {
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
        for (&e, cut) in leaves.iter().zip(cut) {
            self.elements[e as usize].cut = cut;
        }
        progress.check()
    }
}
