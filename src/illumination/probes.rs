//! Where indirect light is sampled: at some vertices of the mesh, from which the others take theirs.
//!
//! A file's triangles may be far smaller than anything that light does between surfaces. Vertices that lie closer together than
//! the mesh would be split, and face alike, then share rays: light of a vertex is a mean over the probes about it,
//!
//! ```text
//! x(v) = Σ w(v, p)·x(p) / Σ w(v, p),    w = (1 − |v − p|/R)²·(n_v·n_p − c)/(1 − c)
//! ```
//!
//! over probes within R that face alike and can see it. Where all vertices are further apart each is its own probe.

use super::elements::{Elements, Sites, Vertex};
use crate::error::Result;
use crate::progress::Progress;
use crate::scene::bvh::SceneBvh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Cosine between normals from which two vertices do not share rays, and from which a probe counts for nothing.
const ALIKE: f32 = 0.94;
const UNLIKE: f32 = 0.8;
/// Distance R over that within which vertices share a probe.
const REACH: f64 = 1.7;
/// Most probes that a vertex looks to, and how many that it does not see it looks for before it gives up.
const MOST: usize = 4;
const TRIED: usize = 3;

/// Vertices that sample light, and what the others take of them.
pub(crate) struct Probes {
    /// The vertices that sample.
    pub(crate) at: Vec<u32>,
    sites: Sites,
    /// For each site its probes, as places in `at`, with their shares; none inside a body.
    shares: Vec<Vec<(u32, f32)>>,
}

/// A probe in its cell: what says how near and how alike it is stands together in memory.
#[derive(Clone, Copy)]
struct Stored {
    position: Vec3,
    normal: Vec3,
    probe: u32,
}

/// Cells of space with the probes in them.
struct Cells {
    side: f64,
    origin: DVec3,
    probes: HashMap<[i32; 3], Vec<Stored>>,
}

impl Cells {
    fn new(side: f64, origin: DVec3) -> Self {
        Self { side: side.max(f64::MIN_POSITIVE), origin, probes: HashMap::new() }
    }

    fn of(&self, place: DVec3) -> [i32; 3] {
        ((place - self.origin) / self.side).floor().to_array().map(|v| v as i32)
    }

    fn add(&mut self, vertex: &Vertex, probe: u32) {
        let (position, normal) = ((vertex.position - self.origin).as_vec3(), vertex.normal.as_vec3());
        self.probes.entry(self.of(vertex.position)).or_default().push(Stored { position, normal, probe });
    }

    /// Probes nearer than a cell's side with a normal at least so much like a vertex' own: their distance and that likeness.
    fn near(&self, vertex: &Vertex, alike: f32) -> impl Iterator<Item = (f32, f32, u32)> + '_ {
        let [x, y, z] = self.of(vertex.position);
        let offsets = (0..27).map(move |i| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]);
        let (position, normal) = ((vertex.position - self.origin).as_vec3(), vertex.normal.as_vec3());
        let most = (self.side * self.side) as f32;
        let met = move |stored: &Stored| {
            let (square, likeness) = (stored.position.distance_squared(position), stored.normal.dot(normal));
            (square < most && likeness > alike).then(|| (square.sqrt(), likeness, stored.probe))
        };
        offsets.filter_map(|cell| self.probes.get(&cell)).flatten().filter_map(met)
    }
}

impl Probes {
    /// Probes for a mesh, none closer than `apart` [m] to another that faces alike.
    ///
    /// # Errors
    /// [`crate::error::Error::Interrupted`] when asked to stop.
    pub(crate) fn new(bvh: &SceneBvh, mesh: &Elements, apart: f64, progress: &Progress) -> Result<Self> {
        let (vertices, offset, sites) = (&mesh.vertices, bvh.offset(), Sites::new(&mesh.vertices));
        let origin = vertices.first().map_or(DVec3::ZERO, |vertex| vertex.position);
        let (mut at, mut cells) = (Vec::new(), Cells::new(apart, origin));
        let shown = sites.first.iter().map(|&v| (v, &vertices[v as usize])).filter(|(_, vertex)| !vertex.buried);
        for (index, vertex) in shown.clone() {
            progress.check()?;
            let mut near: Vec<(f32, f32, u32)> = cells.near(vertex, ALIKE).collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
            let seen = |probe: u32| sees(bvh, vertex, &vertices[at[probe as usize] as usize], offset);
            if !near.iter().take(TRIED).any(|near| seen(near.2)) {
                cells.add(vertex, at.len() as u32);
                at.push(index);
            }
        }
        if at.len() == shown.count() {
            let mut next = 0..;
            let mut own = |&v: &u32| match vertices[v as usize].buried {
                true => vec![],
                false => next.next().map(|probe| (probe, 1.0)).into_iter().collect(),
            };
            let shares = sites.first.iter().map(&mut own).collect();
            return Ok(Self { shares, sites, at });
        }
        let reach = REACH * apart;
        let mut wide = Cells::new(reach, origin);
        at.iter().enumerate().for_each(|(probe, &v)| wide.add(&vertices[v as usize], probe as u32));
        let shares = sites.first.par_iter().map(|&v| {
            let vertex = &vertices[v as usize];
            if vertex.buried || progress.stopped() {
                return Vec::new();
            }
            let weight = |(distance, likeness, probe): (f32, f32, u32)| {
                let near = 1.0 - distance / reach as f32;
                (probe, near * near * (likeness - UNLIKE) / (1.0 - UNLIKE))
            };
            let mut near: Vec<(u32, f32)> = wide.near(vertex, UNLIKE).map(weight).collect();
            near.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            let seen = |(probe, _): &(u32, f32)| sees(bvh, vertex, &vertices[at[*probe as usize] as usize], offset);
            let near: Vec<(u32, f32)> = near.into_iter().take(TRIED + MOST).filter(seen).take(MOST).collect();
            let sum: f32 = near.iter().map(|(_, w)| w).sum();
            near.into_iter().map(|(probe, w)| (probe, w / sum)).collect()
        });
        let shares = shares.collect();
        progress.check()?;
        Ok(Self { shares, sites, at })
    }

    /// What probes have found, at all vertices; zero inside bodies.
    pub(crate) fn spread(&self, found: &[Vec3]) -> Vec<Vec3> {
        let one = |shares: &Vec<(u32, f32)>| shares.iter().map(|&(probe, w)| found[probe as usize] * w).sum();
        let at_sites: Vec<Vec3> = self.shares.par_iter().map(one).collect();
        self.sites.of.par_iter().map(|&site| at_sites[site as usize]).collect()
    }

    /// The probes that a vertex looks to.
    pub(crate) fn of(&self, vertex: u32) -> impl Iterator<Item = u32> + '_ {
        self.shares[self.sites.of[vertex as usize] as usize].iter().map(|(probe, _)| *probe)
    }
}

/// Whether nothing stands between two vertices, or they are one.
fn sees(bvh: &SceneBvh, a: &Vertex, b: &Vertex, offset: f64) -> bool {
    a.position == b.position || !bvh.occluded(a.origin(offset), b.origin(offset))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::illumination::meshing::Fineness;
    use crate::illumination::test_rooms::Room;
    use crate::scene::Material;

    /// A sheet of `side`² squares over 1 m, a little wavy and flat-shaded, both sides of it lit.
    fn sheet(side: u32) -> (SceneBvh, Elements) {
        let mut room = Room::default();
        let material = room.material(Material { double_sided: true, ..Material::diffuse(Vec3::splat(0.5)) });
        let at = |i: u32, j: u32| {
            let (x, z) = (f64::from(i) / f64::from(side), f64::from(j) / f64::from(side));
            DVec3::new(x, 0.02 * (9.0 * x).sin() * (7.0 * z).cos(), -z)
        };
        for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
            for corners in [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]] {
                room.face(corners, material);
            }
        }
        room.scene.triangles.iter_mut().for_each(|triangle| triangle.instance = 0);
        let bvh = SceneBvh::new(room.scene);
        let fineness = Fineness { longest: 1.0, shortest: 0.1, nearness: 0.8, most_vertices: 60_000 };
        let mesh = Elements::new(&bvh, fineness, 1, |_, _| true, &Progress::new()).expect("a mesh");
        (bvh, mesh)
    }

    #[test]
    fn fine_meshes_share_probes_and_keep_what_is_smooth() {
        let (bvh, mesh) = sheet(60);
        let probes = Probes::new(&bvh, &mesh, 0.05, &Progress::new()).expect("probes");
        // Some 400 places of 0.05 m on each side, for 21,600 corners.
        assert!(mesh.vertices.len() > 10_000 && (400..2000).contains(&probes.at.len()), "{}", probes.at.len());
        let value = |p: DVec3, n: DVec3| Vec3::new(1.0, (2.0 + p.x - 0.5 * p.z) as f32, (n.y as f32).signum());
        let of = |v: &Vertex| value(v.position, v.normal);
        let found: Vec<Vec3> = probes.at.iter().map(|&v| of(&mesh.vertices[v as usize])).collect();
        let mut square = 0.0;
        for (vertex, spread) in mesh.vertices.iter().zip(probes.spread(&found)) {
            let expected = of(vertex);
            // What is the same everywhere stays so; nothing comes through the sheet.
            assert!((spread.x - 1.0).abs() < 1e-5 && (spread.z - expected.z).abs() < 1e-5, "{spread} at {vertex:?}");
            square += f64::from(spread.y - expected.y).powi(2);
        }
        let off = (square / mesh.vertices.len() as f64).sqrt();
        assert!(off < 0.02, "{off}");
    }

    #[test]
    fn vertices_that_stand_apart_are_their_own_probes() {
        let (bvh, mesh) = sheet(6);
        let probes = Probes::new(&bvh, &mesh, 0.02, &Progress::new()).expect("probes");
        let found: Vec<Vec3> = probes.at.iter().map(|&v| mesh.vertices[v as usize].position.as_vec3()).collect();
        for (vertex, spread) in mesh.vertices.iter().zip(probes.spread(&found)) {
            assert!((spread - vertex.position.as_vec3()).length() < 1e-6, "{spread} at {vertex:?}");
        }
    }
}
