//! Whether a file's own emission lights what its camera sees, or only shines: an LED, a display, a glowing seam.
//!
//! A coarse picture by path tracing: rays of the first camera, the direct light of points drawn on the emitting triangles,
//! and a few diffuse bounces. A pixel is lit where its radiance is at least [`DARK`] or a [`FAINT`]th of the brightest one's.
//! Also whether light from all around would light it, or walls keep it out.

use crate::random::Random;
use crate::scene::bvh::{Hit, Ray, SceneBvh, Sides};
use crate::scene::{Scene, TextureRef};
use glam::{DVec3, Vec2, Vec3};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// Radiance below which a pixel may be dark [W/(m² sr)]: a hundredth of what the default light gives a matt surface.
const DARK: f64 = 6e-3;

/// A pixel this many times fainter than the brightest is dark, if its radiance is.
const FAINT: f64 = 300.0;

/// Rays across and down, paths from each, and surfaces on a path.
const SIDE: u64 = 20;
const PATHS: u32 = 4;
const BOUNCES: u32 = 4;

/// Light is drawn on the emitting triangles by their flux.
struct Emitters {
    triangles: Vec<u32>,
    /// Sum of the fluxes up to each.
    up_to: Vec<f64>,
}

/// The share of the surfaces that the first camera sees that the file's own emission lights; `None` where nothing emits or
/// too little is seen to tell.
pub(super) fn lit_share(scene: &mut Scene) -> Option<f64> {
    let emitters = Emitters::new(scene)?;
    let seen = seen(scene, |bvh, ray, hit, random| {
        let material = bvh.scene().material(hit.triangle);
        // What mirrors or lets light through shows what stands elsewhere.
        let clear = material.transmission > 0.0 || (material.metallic > 0.5 && material.roughness < 0.3);
        (!clear).then(|| if material.unlit { f64::INFINITY } else { emitters.radiance(bvh, ray, hit, random) })
    });
    if seen.len() < FEWEST {
        return None;
    }
    let brightest = seen.iter().copied().filter(|light| light.is_finite()).fold(0.0, f64::max);
    let lit = seen.iter().filter(|light| **light >= DARK || **light > brightest / FAINT).count();
    Some(lit as f64 / seen.len() as f64)
}

/// Rays with which a place looks out of the scene, and the part of what the camera sees from where some of them must leave it.
const LOOKS: u32 = 12;
const OPEN: f64 = 0.6;

/// Whether light from all around reaches most of the surfaces that the first camera sees.
pub(super) fn is_open(scene: &mut Scene) -> bool {
    let seen = seen(scene, |bvh, ray, hit, random| {
        let plain = bvh.scene().triangles[hit.triangle as usize].normal();
        let normal = if plain.dot(ray.direction) > 0.0 { -plain } else { plain };
        let origin = hit.position + normal * bvh.offset();
        let leaves = |random: &mut Random| {
            let direction = scattered(normal, random);
            bvh.nearest(&Ray { origin, direction }, 0.0, Sides::Both).is_none()
        };
        Some((0..LOOKS).any(|_| leaves(random)))
    });
    let open = seen.iter().filter(|open| **open).count();
    seen.len() < FEWEST || open as f64 >= OPEN * seen.len() as f64
}

/// Fewer places that are seen do not tell.
const FEWEST: usize = 8;

/// What `of` finds at the surfaces that rays of the first camera meet.
fn seen<T>(scene: &mut Scene, of: impl Fn(&SceneBvh, &Ray, Hit, &mut Random) -> Option<T>) -> Vec<T> {
    let Some(camera) = scene.cameras.first().cloned() else { return Vec::new() };
    let shared = Arc::new(std::mem::take(scene));
    let bvh = SceneBvh::new(Arc::clone(&shared));
    let aspect = camera.aspect().unwrap_or(1.0);
    let look = |i: u64| {
        let place = |k: u64| (k as f64 + 0.5) / SIDE as f64;
        let ray = camera.ray(place(i % SIDE), place(i / SIDE), aspect);
        let hit = bvh.nearest(&ray, 0.0, Sides::Front)?;
        of(&bvh, &ray, hit, &mut Random::new(0x11ed, i))
    };
    let found = (0..SIDE * SIDE).filter_map(look).collect();
    drop(bvh);
    *scene = Arc::try_unwrap(shared).unwrap_or_else(|shared| (*shared).clone());
    found
}

impl Emitters {
    fn new(scene: &Scene) -> Option<Self> {
        let (mut triangles, mut up_to, mut sum) = (Vec::new(), Vec::new(), 0.0);
        for (index, triangle) in scene.triangles.iter().enumerate() {
            let material = scene.material(index as u32);
            if material.unlit || material.emissive.max_element() <= 0.0 {
                continue;
            }
            let middle = [[1.0 / 3.0; 2], [0.8, 0.1], [0.1, 0.8], [0.1, 0.1]];
            let mean = middle.iter().map(|at| brightness(emission(scene, index as u32, *at))).sum::<f64>() / 4.0;
            // A little for each, so that none whose middle is dark is left out.
            let flux = triangle.area() * (mean + 1e-3 * brightness(material.emissive));
            if flux > 0.0 && flux.is_finite() {
                sum += flux;
                triangles.push(index as u32);
                up_to.push(sum);
            }
        }
        (!triangles.is_empty()).then_some(Self { triangles, up_to })
    }

    /// Radiance that leaves a surface towards where a ray comes from.
    fn radiance(&self, bvh: &SceneBvh, ray: &Ray, first: Hit, random: &mut Random) -> f64 {
        let scene = bvh.scene();
        let own = brightness(emission(scene, first.triangle, first.barycentric));
        let mut sum = 0.0;
        for _ in 0..PATHS {
            let (mut hit, mut direction, mut weight) = (first, ray.direction, 1.0);
            for _ in 0..BOUNCES {
                let plain = scene.triangles[hit.triangle as usize].normal();
                let normal = if plain.dot(direction) > 0.0 { -plain } else { plain };
                let from = hit.position + normal * bvh.offset();
                // White, where the eye looks: a black surface in good light is no sign of too little of it.
                sum += weight * self.direct(bvh, from, normal, random) / PI;
                direction = scattered(normal, random);
                let Some(next) = bvh.nearest(&Ray { origin: from, direction }, 0.0, Sides::Both) else { break };
                weight *= f64::from(scene.material(next.triangle).base_color.element_sum() / 3.0).clamp(0.0, 0.9);
                hit = next;
            }
        }
        own + sum / f64::from(PATHS)
    }

    /// Irradiance from one point drawn on the emitters [W/m²].
    fn direct(&self, bvh: &SceneBvh, from: DVec3, normal: DVec3, random: &mut Random) -> f64 {
        let scene = bvh.scene();
        let total = self.up_to[self.up_to.len() - 1];
        let drawn = random.uniform() * total;
        let at = self.up_to.partition_point(|sum| *sum < drawn).min(self.up_to.len() - 1);
        let probability = (self.up_to[at] - if at > 0 { self.up_to[at - 1] } else { 0.0 }) / total;
        let index = self.triangles[at];
        let triangle = &scene.triangles[index as usize];
        let (u, v) = (random.uniform().sqrt(), random.uniform());
        let weights = [u * (1.0 - v), u * v];
        let span = triangle.at(weights) - from;
        let square = span.length_squared();
        let towards = span / square.sqrt();
        let facing = -triangle.normal().dot(towards);
        let facing = if scene.material(index).double_sided { facing.abs() } else { facing };
        let cosine = normal.dot(towards);
        if !(facing > 0.0 && cosine > 0.0 && square > 0.0) {
            return 0.0;
        }
        let back = span - towards * (2.0 * bvh.offset() / facing.max(1e-3));
        if bvh.occluded(from, from + back) {
            return 0.0;
        }
        let light = brightness(emission(scene, index, weights)) * facing * cosine * triangle.area();
        // Nearer than the emitter's own size one point does not stand for it.
        light / (probability.max(1e-12) * square.max(triangle.area() / TAU))
    }
}

/// Emission of a triangle's material at a place on it.
fn emission(scene: &Scene, index: u32, [v, w]: [f64; 2]) -> Vec3 {
    let (triangle, material) = (&scene.triangles[index as usize], scene.material(index));
    let picture = |reference: &TextureRef| {
        let [a, b, c] = triangle.texcoords.map(|sets| sets[reference.texcoord as usize & 1]);
        let uv: Vec2 = a + (b - a) * v as f32 + (c - a) * w as f32;
        let texture = scene.textures.get(reference.texture as usize)?;
        Some(texture.sample(reference.transform(uv), 0.0).truncate())
    };
    material.emissive * material.emissive_texture.as_ref().and_then(picture).unwrap_or(Vec3::ONE)
}

fn brightness(light: Vec3) -> f64 {
    f64::from(light.max_element())
}

/// A direction about a normal, by the cosine.
fn scattered(normal: DVec3, random: &mut Random) -> DVec3 {
    let (z, angle) = (2.0 * random.uniform() - 1.0, TAU * random.uniform());
    let side = (1.0 - z * z).max(0.0).sqrt();
    (normal + DVec3::new(side * angle.cos(), side * angle.sin(), z)).normalize_or(normal)
}
