//! Diffuse light that is looked at from many places: kept on lattices over the triangles, computed where it is first read.
//!
//! What a diffuse surface shows does not depend on who looks, so that the views of a light field share it. Each side of a
//! triangle has lattices of 2ᵏ cells along two of its edges; a look reads the one whose cells are about as wide as its pixel,
//! and interpolates between three vertices. Albedo and emission are not kept: textures stay as sharp as they are.
//!
//! A vertex's value depends on the vertex alone, so that it is the same whoever computes it, and twice if two do at once.

use super::shading::DiffuseLight;
use super::{Illumination, LobeRay, Surface};
use crate::random::Random;
use crate::scene::bvh::{Hit, Ray, SceneBvh, Sides};
use glam::{DVec3, Vec3};
use std::array::from_fn;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// Cells along the longer edge of the finest lattice, as a power of two: a page table of 4 MB.
const FINEST: u32 = 13;
/// Vertices along each side of a page.
const PAGE: u32 = 16;
/// By which part of a cell vertices are drawn into their triangle: walls that stand on its edges are then not in the way.
const DRAWN_IN: f64 = 0.04;
/// They are drawn in by at least this many times the length by which rays start off a surface.
const LEAST_DRAWN_IN: f64 = 8.0;
/// The first component of a value that is not known yet: no radiance has these bits.
const UNKNOWN: u32 = u32::MAX;
/// The sign of the first component tells that the vertex stands inside a body.
const BURIED: u32 = 1 << 31;

/// The irradiance of a lit scene's surfaces, remembered.
pub(crate) struct IrradianceCache<'a> {
    light: &'a Illumination,
    seed: u64,
    /// Front and back of each triangle.
    sides: Vec<OnceLock<Box<Side>>>,
}

/// Lattices of one side of a triangle, from one cell to the finest.
struct Side {
    /// Length of the longer edge from the first corner, and its halvings against the shorter one.
    longer: f32,
    across: bool,
    flatter: u32,
    levels: [OnceLock<Lattice>; FINEST as usize + 1],
}

/// One lattice: pages of vertices, row by row.
struct Lattice {
    level: u32,
    cells: [u32; 2],
    pages: [u32; 2],
    vertices: Box<[OnceLock<Page>]>,
}

type Page = Box<[[AtomicU32; 3]]>;

impl<'a> IrradianceCache<'a> {
    /// An empty one.
    pub(crate) fn new(light: &'a Illumination, seed: u64) -> Self {
        let triangles = light.bvh().scene().triangles.len();
        Self { light, seed, sides: (0..2 * triangles).map(|_| OnceLock::new()).collect() }
    }

    /// Vertices that have been computed.
    pub(crate) fn vertices(&self) -> usize {
        let lattices = self.sides.iter().filter_map(OnceLock::get).flat_map(|side| &side.levels);
        let pages = lattices.filter_map(OnceLock::get).flat_map(|lattice| &lattice.vertices);
        let vertices = pages.filter_map(OnceLock::get).flat_map(|page| page.iter());
        vertices.filter(|v| v[0].load(Ordering::Relaxed) != UNKNOWN).count()
    }

    fn bvh(&self) -> &SceneBvh {
        self.light.bvh()
    }

    /// Irradiance over π at a hit that is looked at with a pixel of this width [m].
    fn received(&self, hit: &Hit, footprint: f64) -> Vec3 {
        let index = 2 * hit.triangle as usize + usize::from(!hit.front);
        let side = self.sides[index].get_or_init(|| Box::new(Side::new(self.bvh(), hit.triangle)));
        let lattice = side.lattice(footprint as f32);
        let [x, y] = from_fn(|k| hit.barycentric[k] as f32 * lattice.cells[k] as f32);
        let [i, j] = [(x as u32).min(lattice.cells[0] - 1), (y as u32).min(lattice.cells[1] - 1)];
        let [x, y] = [x - i as f32, y - j as f32];
        let (corner, weights) = if x + y <= 1.0 {
            ([i, j], [1.0 - x - y, x, y])
        } else {
            ([i + 1, j + 1], [x + y - 1.0, 1.0 - y, 1.0 - x])
        };
        let (mut sum, mut all) = ((Vec3::ZERO, 0.0), Vec3::ZERO);
        for ([i, j], weight) in [corner, [i + 1, j], [i, j + 1]].into_iter().zip(weights) {
            let (value, buried) = self.vertex(hit, lattice, [i, j]);
            all += value * weight;
            if !buried {
                sum = (sum.0 + value * weight, sum.1 + weight);
            }
        }
        // Inside a body it is dark: that must not be seen outside, at its foot.
        if sum.1 > 1e-3 { sum.0 / sum.1 } else { all }
    }

    /// The value of a vertex, and whether it stands inside a body.
    fn vertex(&self, hit: &Hit, lattice: &Lattice, [i, j]: [u32; 2]) -> (Vec3, bool) {
        let vertex = lattice.slot([i, j]);
        let [x, y, z] = from_fn(|k| vertex[k].load(Ordering::Relaxed));
        let decoded = |x: u32, y: u32, z: u32| {
            (Vec3::new(f32::from_bits(x & !BURIED), f32::from_bits(y), f32::from_bits(z)), x & BURIED != 0)
        };
        if x != UNKNOWN && y != UNKNOWN && z != UNKNOWN {
            return decoded(x, y, z);
        }
        let (value, buried) = self.computed(hit, lattice, [i, j]);
        // Light without a number is none.
        let bits = value.to_array().map(|c| if c > 0.0 { c.to_bits() } else { 0 });
        let [x, y, z] = [bits[0] | if buried { BURIED } else { 0 }, bits[1], bits[2]];
        for (slot, bits) in vertex.iter().zip([x, y, z]) {
            slot.store(bits, Ordering::Relaxed);
        }
        decoded(x, y, z)
    }

    fn computed(&self, hit: &Hit, lattice: &Lattice, [i, j]: [u32; 2]) -> (Vec3, bool) {
        let bvh = self.bvh();
        let triangle = &bvh.scene().triangles[hit.triangle as usize];
        let [m, n] = lattice.cells;
        let [mut s, mut t] = [f64::from(i) / f64::from(m), f64::from(j) / f64::from(n)];
        // Beyond the third edge: back along the longer side of the cells.
        if s + t > 1.0 {
            if m >= n { t = 1.0 - s } else { s = 1.0 - t }
        }
        let [a, b, c] = triangle.corners();
        let size = (b - a).length().min((c - a).length());
        let drawn_in = (DRAWN_IN / f64::from(m.max(n))).max(LEAST_DRAWN_IN * bvh.offset() / size).min(0.5);
        let barycentric = [s, t].map(|w| w + (1.0 / 3.0 - w) * drawn_in);
        let position = triangle.at(barycentric);
        let hit = Hit { position, barycentric, distance: 0.0, ..*hit };
        let cell = (triangle.cross().length() / (f64::from(m) * f64::from(n))).sqrt();
        let surface = Surface::at(bvh.scene(), &hit, cell);
        let which = u64::from(hit.triangle) << 1 | u64::from(!hit.front);
        let place = u64::from(lattice.level) << 48 | u64::from(i) << 24 | u64::from(j);
        let mut random = Random::new(self.seed ^ which.rotate_left(20), place);
        let value = self.light.received(&hit, &surface, 1, &mut random);
        let up = Ray { origin: surface.shading_point(bvh.offset()).position, direction: surface.facing };
        let buried = bvh.meet(&up, 0.0, f64::INFINITY, Sides::Both).is_some_and(|over| !over.front);
        (value, buried)
    }
}

impl DiffuseLight for IrradianceCache<'_> {
    fn shown(&self, hit: &Hit, surface: &Surface, footprint: f64, _: u32, _: &mut Random) -> Vec3 {
        if !surface.is_diffuse() {
            return surface.emission;
        }
        surface.emission + surface.albedo * self.received(hit, footprint)
    }

    fn glints(&self, surface: &Surface, direction: DVec3, rays: u32, random: &mut Random) -> Vec3 {
        self.light.glints(surface, direction, rays, random)
    }

    fn part_of_lobe(&self, hit: &Hit, lobe: &LobeRay) -> f32 {
        self.light.part_of_lobe(hit, lobe)
    }
}

impl Side {
    fn new(bvh: &SceneBvh, triangle: u32) -> Self {
        let [a, b, c] = bvh.scene().triangles[triangle as usize].corners();
        let edges = [(b - a).length(), (c - a).length()];
        let (longer, shorter) = (edges[0].max(edges[1]), edges[0].min(edges[1]));
        let flatter = (longer / shorter).log2().round().clamp(0.0, f64::from(FINEST)) as u32;
        let across = edges[0] >= edges[1];
        Self { longer: longer as f32, across, flatter, levels: from_fn(|_| OnceLock::new()) }
    }

    /// The lattice whose cells are about this wide [m].
    fn lattice(&self, width: f32) -> &Lattice {
        // Not a number where the width is zero or not finite: the finest then.
        let level = (self.longer / width).log2().round();
        let level = if level.is_nan() { FINEST } else { level.clamp(0.0, FINEST as f32) as u32 };
        self.levels[level as usize].get_or_init(|| {
            let (longer, shorter) = (1 << level, 1 << level.saturating_sub(self.flatter));
            let cells = if self.across { [longer, shorter] } else { [shorter, longer] };
            let pages = cells.map(|n: u32| (n + 1).div_ceil(PAGE));
            let vertices = (0..pages[0] * pages[1]).map(|_| OnceLock::new()).collect();
            Lattice { level, cells, pages, vertices }
        })
    }
}

impl Lattice {
    fn slot(&self, [i, j]: [u32; 2]) -> &[AtomicU32; 3] {
        let side = self.cells.map(|n| (n + 1).min(PAGE));
        let page = self.vertices[(j / PAGE * self.pages[0] + i / PAGE) as usize]
            .get_or_init(|| (0..side[0] * side[1]).map(|_| from_fn(|_| AtomicU32::new(UNKNOWN))).collect());
        &page[(j % PAGE * side[0] + i % PAGE) as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::illumination::IlluminationSettings;
    use crate::illumination::test_rooms::Room;
    use crate::progress::Progress;
    use crate::scene::{LightKind, Material, PunctualLight};
    use glam::{DVec3, Vec3};

    /// A white floor with a black box on it, and a lamp of 1 W/sr without size at (0, 2, 0).
    fn lit(pieces: u32) -> Illumination {
        let mut room = Room::default();
        let (white, black) =
            (room.material(Material::diffuse(Vec3::ONE)), room.material(Material::diffuse(Vec3::ZERO)));
        let step = 2.0 / f64::from(pieces);
        for (i, j) in (0..pieces).flat_map(|i| (0..pieces).map(move |j| (f64::from(i), f64::from(j)))) {
            room.quad(DVec3::new(i * step - 1.0, 0.0, j * step - 1.0), DVec3::Z * step, DVec3::X * step, white);
        }
        room.cuboid(DVec3::new(0.4, -0.1, -0.3), DVec3::new(0.6, 0.3, 0.2), false, [black; 6]);
        room.scene.lights.push(PunctualLight {
            kind: LightKind::Point,
            position: Vec3::new(0.0, 2.0, 0.0),
            direction: Vec3::NEG_Y,
            intensity: Vec3::new(1.0, 0.5, 0.25),
            range: f32::INFINITY,
            measured: None,
        });
        let settings = IlluminationSettings::default().coarse();
        Illumination::new(SceneBvh::new(room.scene), settings, &Progress::new()).expect("lit")
    }

    #[test]
    fn light_is_that_of_the_lamp_for_large_and_tiny_triangles_up_to_the_foot_of_a_box() {
        // Cos θ/(π r²) = h/(π r³).
        let exact = |x: f64, z: f64| 2.0 / (std::f64::consts::PI * (x * x + z * z + 4.0).powf(1.5));
        for (pieces, footprint) in [(1, 0.02), (1, 0.3), (3, 0.05), (64, 0.1)] {
            let light = lit(pieces);
            let cache = IrradianceCache::new(&light, 7);
            let seen = |x: f64, z: f64| {
                let ray = Ray { origin: DVec3::new(x, 1.0, z), direction: DVec3::NEG_Y };
                let hit = light.bvh().nearest(&ray, 0.0, Sides::Front).expect("the floor");
                cache.received(&hit, footprint)
            };
            // Cells are up to √2 as wide as what is looked at. Straight lines over a cell are off by its width squared over eight
            // times the curvature, what stands beyond the third edge of flat cells counts once more; beside the box light is that
            // of the cell's other side. A hundredth is for vertices that are drawn into their triangles.
            let cell = (1.42 * footprint).min(2.0 / f64::from(pieces));
            let tolerance = |x: f64| 0.01 + cell * cell * 0.5 + if x > 0.4 - 1.5 * cell { 0.3 * cell } else { 0.0 };
            for i in 0..400 {
                let (x, z) = (-0.99 + 1.38 * f64::from(i % 20) / 19.0, -0.97 + 1.9 * f64::from(i / 20) / 19.0);
                let (found, expected) = (seen(x, z), exact(x, z));
                let off = f64::from(found.x) / expected - 1.0;
                assert!(off.abs() < tolerance(x), "{pieces} × {footprint} at {x}, {z}: {off}");
                assert!((found.y / found.x - 0.5).abs() < 1e-5 && (found.z / found.x - 0.25).abs() < 1e-5);
            }
            // Behind the box it is dark, up to where the ray over its edge arrives, at 0.6·2/1.7.
            assert!(cell > 0.05 || seen(0.655, -0.05).max_element() < 1e-4);
        }
    }

    #[test]
    fn a_value_is_computed_once_for_all_that_look_near_it() {
        let light = lit(2);
        let cache = IrradianceCache::new(&light, 7);
        let look = |x: f64| {
            let ray = Ray { origin: DVec3::new(x, 1.0, -0.43), direction: DVec3::NEG_Y };
            let hit = light.bvh().nearest(&ray, 0.0, Sides::Front).expect("the floor");
            cache.received(&hit, 0.1)
        };
        let first: Vec<Vec3> = (0..200).map(|i| look(-0.95 + 0.002 * f64::from(i))).collect();
        let count = cache.vertices();
        // 0.4 m in cells of 1/8 m, on both sides of the line.
        assert!((3..=20).contains(&count), "{count}");
        let again: Vec<Vec3> = (0..200).map(|i| look(-0.95 + 0.002 * f64::from(i))).collect();
        assert!(first == again && cache.vertices() == count);
    }
}
