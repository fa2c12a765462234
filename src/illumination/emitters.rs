//! Light that arrives straight from emitting surfaces and punctual lights.
//!
//! Area light is the exact polygonal form factor where the whole emitter is seen; where shadow rays disagree it is
//! multiplied by the visible part, Σ w v / Σ w over stratified points of the emitter, w = cosθ cosθ′/r². So there is no
//! noise outside of penumbrae, and none of a patch's shape inside.

use super::elements::NONE;
use super::emitter::{Emitter, EmitterPoint, Piece};
use super::form_factor::{FormFactor, point_to_element, point_to_polygon};
use super::paths::Optics;
use super::punctual::{PER_SUN, arriving};
use super::sampling::triangle_weights;
use super::shaft::Shaft;
use super::surface::{ShadingPoint, Surface};
use crate::random::Random;
use crate::scene::bvh::{Hit, SceneBvh};
use crate::scene::{PunctualLight, Scene};
use glam::{DVec3, Vec3};
use std::collections::HashMap;
use std::f64::consts::PI;

/// An emitter with more than this part of the surface of the scene's box is no lamp but a glowing wall: its shadows are
/// as soft as those of other walls, and it lights through radiosity like them.
const GLOWING_WALL: f64 = 0.1;
/// So does one that does not emit this many times what it reflects of an even light in the room.
const LEAST_CONTRAST: f64 = 3.0;
/// More emitting polygons than this are not sampled one by one: the weakest ones then light through radiosity.
const MOST_EMITTERS: usize = 128;

/// Tries to find a point of an emitter that lies above the horizon.
pub(crate) const MOST_REDRAWS: u32 = 32;
/// All that shines by itself.
#[derive(Clone, Debug, Default)]
pub(crate) struct Emitters {
    pub(crate) polygons: Vec<Emitter>,
    /// The polygon through which each triangle's emission is sampled, or [`NONE`]: that of all others goes with radiosity.
    polygon_of: Vec<u32>,
    /// Flux of each polygon and those before it, over that of all.
    reached: Vec<f64>,
    /// Flux of all polygons and colours [W].
    pub(crate) power: f64,
    pub(super) punctual: Vec<PunctualLight>,
    form_factor: FormFactor,
}

/// How many shadow rays a point sends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadowRays {
    /// First set, shared among the emitters by their unobstructed light.
    pub(crate) first: u32,
    /// Second set for an emitter that the first one saw in part.
    pub(crate) penumbra: u32,
    /// Emitters, one bit each, that are known to be seen whole.
    pub(crate) clear: VisibleEmitters,
}

/// Emitters that a piece of a surface sees whole, one bit each for the first ones.
pub(crate) type VisibleEmitters = u16;

impl Emitters {
    pub(crate) fn new(scene: &Scene, form_factor: FormFactor) -> Self {
        let mut found: Vec<(u32, Emitter)> = Vec::new();
        for (index, triangle) in scene.triangles.iter().enumerate() {
            let material = scene.material(index as u32);
            if material.emissive.max_element() <= 0.0 || material.unlit || triangle.area() <= 0.0 {
                continue;
            }
            let textured = material.emissive_texture.is_some();
            let mean_radiance = if textured { mean_emission(scene, index as u32) } else { material.emissive };
            if mean_radiance.max_element() > 0.0 {
                let emitter = Emitter {
                    corners: triangle.corners().to_vec(),
                    normal: triangle.normal(),
                    area: triangle.area(),
                    mean_radiance,
                    two_sided: material.double_sided,
                    textured: textured.then_some(index as u32),
                };
                found.push((index as u32, emitter));
            }
        }
        let mut merged = parallelograms(scene, found);
        let size = scene.bounds().map_or(DVec3::ZERO, |(low, high)| high - low);
        let surface = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        let level = mean_radiance(scene, &merged);
        merged.retain(|(triangles, emitter)| {
            let reflected = f64::from(scene.material(triangles[0]).base_color.element_sum() / 3.0) * level;
            let bright = f64::from(emitter.mean_radiance.element_sum()) >= LEAST_CONTRAST * reflected;
            emitter.area <= GLOWING_WALL * surface && bright
        });
        // Strongest first; equal ones in the order of the file, so that the choice is always the same.
        merged.sort_by(|a, b| b.1.flux().element_sum().total_cmp(&a.1.flux().element_sum()).then(a.0[0].cmp(&b.0[0])));
        merged.truncate(MOST_EMITTERS);
        let mut polygon_of = vec![NONE; scene.triangles.len()];
        for (polygon, (triangles, _)) in merged.iter().enumerate() {
            triangles.iter().for_each(|&triangle| polygon_of[triangle as usize] = polygon as u32);
        }
        let polygons: Vec<Emitter> = merged.into_iter().map(|(_, emitter)| emitter).collect();
        let mut reached: Vec<f64> = Vec::with_capacity(polygons.len());
        for emitter in &polygons {
            reached.push(reached.last().copied().unwrap_or(0.0) + emitter.power());
        }
        let power = reached.last().copied().unwrap_or(0.0);
        reached.iter_mut().for_each(|part| *part /= power);
        Self { polygons, polygon_of, reached, power, punctual: scene.lights.clone(), form_factor }
    }

    /// The polygon through which a triangle's emission is sampled.
    pub(crate) fn polygon(&self, triangle: u32) -> Option<&Emitter> {
        self.polygons.get(self.polygon_of[triangle as usize] as usize)
    }

    /// A polygon by its share of all flux, for a number from 0 to 1; there must be one.
    pub(crate) fn drawn(&self, u: f64) -> usize {
        self.reached.partition_point(|&part| part <= u).min(self.polygons.len() - 1)
    }

    /// How densely points of a polygon lie in the direction of `span` when polygons are drawn by flux and points by area [1/sr].
    pub(super) fn density(&self, emitter: &Emitter, span: DVec3) -> f64 {
        let part = emitter.power() / self.power;
        part * span.length_squared() * span.length() / (emitter.area * emitter.normal.dot(span).abs())
    }

    /// Which emitters every point of a flat piece of a surface sees whole.
    pub(crate) fn clear(&self, bvh: &SceneBvh, piece: &[DVec3], facing: DVec3) -> VisibleEmitters {
        let tolerance = 2.0 * bvh.offset();
        let clear = |emitter: &Emitter| {
            let above = (piece[0] - emitter.corners[0]).dot(emitter.normal) > 0.0;
            let shining = if above || !emitter.two_sided { emitter.normal } else { -emitter.normal };
            emitter.textured.is_none()
                && Shaft::new(piece, facing, &emitter.corners, shining, tolerance).is_some_and(|s| s.is_clear(bvh))
        };
        let first = self.polygons.iter().take(VisibleEmitters::BITS as usize).enumerate();
        first.filter(|(_, emitter)| clear(emitter)).fold(0, |bits, (index, _)| bits | 1 << index)
    }

    /// Irradiance over π [W/(m² sr)] at a point: from emitting surfaces, and from punctual lights.
    pub(crate) fn light(
        &self,
        optics: &Optics,
        at: ShadingPoint,
        rays: ShadowRays,
        random: &mut Random,
    ) -> (Vec3, Vec3) {
        let ShadingPoint { position: point, normal } = at;
        let mut sum = Vec3::ZERO;
        let mut total = 0.0;
        let mut seen: [(usize, f64); MOST_EMITTERS] = [(0, 0.0); MOST_EMITTERS];
        let mut count = 0;
        for (index, emitter) in self.polygons.iter().enumerate() {
            let height = (point - emitter.corners[0]).dot(emitter.normal);
            if height > 0.0 || (emitter.two_sided && height < 0.0) {
                let factor = point_to_polygon(point, normal, &emitter.corners);
                if factor > 0.0 {
                    seen[count] = (index, factor);
                    count += 1;
                    total += factor * f64::from(emitter.mean_radiance.element_sum());
                }
            }
        }
        for &(index, factor) in &seen[..count] {
            let emitter = &self.polygons[index];
            if index < VisibleEmitters::BITS as usize && rays.clear >> index & 1 == 1 {
                sum += emitter.mean_radiance * factor as f32;
                continue;
            }
            let share = factor * f64::from(emitter.mean_radiance.element_sum()) / total;
            let side = (f64::from(rays.first) * share).sqrt().ceil().max(1.0) as u32;
            let mut tally = Tally::default();
            let pieces = emitter.pieces(at, factor);
            tally.cast(optics, emitter, &pieces, at, side, random);
            if tally.is_mixed() && rays.penumbra > 0 {
                let side = (f64::from(rays.penumbra) * share).sqrt().ceil() as u32;
                tally.cast(optics, emitter, &pieces, at, side, random);
            }
            sum += tally.mean() * factor as f32;
        }
        let sets = [rays.first, rays.penumbra].map(|rays| rays / PER_SUN);
        let punctual = self.punctual.iter().map(|light| arriving(optics, light, at, sets, |_| Vec3::ONE, random)).sum();
        (sum * self.scale(), punctual)
    }

    /// The factor by which a transfer differs from Lambert's.
    pub(crate) fn scale(&self) -> f32 {
        self.form_factor.scale() as f32
    }

    /// Flux of the sampled polygons [W]; punctual lights are counted where they arrive.
    pub(crate) fn flux(&self) -> Vec3 {
        self.polygons.iter().map(Emitter::flux).sum()
    }

    pub(crate) fn is_dark(&self) -> bool {
        self.polygons.is_empty() && self.punctual.iter().all(|light| light.intensity.max_element() <= 0.0)
    }
}

/// What shadow rays to one emitter have found.
#[derive(Default)]
struct Tally {
    weight: f64,
    clear: f64,
    light: Vec3,
}

impl Tally {
    fn cast(
        &mut self,
        optics: &Optics,
        emitter: &Emitter,
        pieces: &[Piece],
        from: ShadingPoint,
        side: u32,
        random: &mut Random,
    ) {
        let ShadingPoint { position: point, normal } = from;
        let count = side * side;
        // Far emitters are one piece with a grid of strata; near ones are many, and take rays by what they contribute.
        let total: f64 = pieces.iter().map(|piece| piece.factor).sum();
        let shift = random.uniform();
        let (mut piece, mut below) = (0, 0.0);
        for cell in 0..count {
            let (u, v);
            if let [_] = pieces {
                u = (f64::from(cell % side) + random.uniform()) / f64::from(side);
                v = (f64::from(cell / side) + random.uniform()) / f64::from(side);
            } else {
                let target = total * (f64::from(cell) + shift) / f64::from(count);
                while piece + 1 < pieces.len() && below + pieces[piece].factor < target {
                    below += pieces[piece].factor;
                    piece += 1;
                }
                (u, v) = (random.uniform(), random.uniform());
            }
            let above = (point - emitter.corners[0]).dot(emitter.normal) >= 0.0;
            let lit_side = if above { emitter.normal } else { -emitter.normal };
            let mut at = emitter.within(&pieces[piece], u, v);
            let mut weight = point_to_element(point, normal, at.position, lit_side, 1.0);
            // What lies below the horizon is drawn anew: few rays must not all be spent on what gives no light.
            for _ in 0..MOST_REDRAWS {
                if weight > 0.0 {
                    break;
                }
                at = emitter.within(&pieces[piece], random.uniform(), random.uniform());
                weight = point_to_element(point, normal, at.position, lit_side, 1.0);
            }
            if weight > 0.0 {
                self.shoot(optics, emitter, point, at, if pieces.len() > 1 { 1.0 } else { weight });
            }
        }
    }

    fn shoot(&mut self, optics: &Optics, emitter: &Emitter, point: DVec3, to: EmitterPoint, weight: f64) {
        let at = to.position;
        let lift = emitter.normal * optics.bvh.offset().copysign((point - at).dot(emitter.normal));
        self.weight += weight;
        let left = optics.transmittance(point, at + lift);
        if left.max_element() > 0.0 {
            self.clear += weight;
            self.light += left * emitter.radiance(optics.scene(), to) * weight as f32;
        }
    }

    fn is_mixed(&self) -> bool {
        self.clear > 0.0 && self.clear < self.weight
    }

    /// Mean radiance towards the point, weighted by what each part of the emitter contributes, hidden parts dark.
    fn mean(&self) -> Vec3 {
        if self.weight <= 0.0 { Vec3::ZERO } else { self.light / self.weight as f32 }
    }
}

/// What all surfaces would show, in the sum of the colours, if the emitters' light were spread evenly over a closed room
/// of their area and mean albedo: Φ/(πA(1 − ρ)).
fn mean_radiance(scene: &Scene, emitters: &[(Vec<u32>, Emitter)]) -> f64 {
    let (mut area, mut absorbing) = (0.0, 0.0);
    for (index, triangle) in scene.triangles.iter().enumerate() {
        let material = scene.material(index as u32);
        let size = triangle.area() * if material.double_sided { 2.0 } else { 1.0 };
        if size.is_finite() {
            area += size;
            absorbing += size * f64::from(1.0 - material.base_color.element_sum() / 3.0).clamp(0.0, 1.0);
        }
    }
    let flux: f64 = emitters.iter().map(|(_, emitter)| f64::from(emitter.flux().element_sum())).sum();
    if area > 0.0 { flux / (PI * absorbing.max(0.02 * area)) } else { 0.0 }
}

/// Mean emission of a textured triangle from a grid of points.
fn mean_emission(scene: &Scene, triangle: u32) -> Vec3 {
    let side = 8u32;
    let sum: Vec3 = (0..side * side)
        .map(|cell| {
            let u = (f64::from(cell % side) + 0.5) / f64::from(side);
            let v = (f64::from(cell / side) + 0.5) / f64::from(side);
            let (s, t) = triangle_weights(u, v);
            let hit = Hit { triangle, distance: 0.0, position: DVec3::ZERO, barycentric: [s, t], front: true };
            Surface::at(scene, &hit, 0.0).emission
        })
        .sum();
    sum / (side * side) as f32
}

/// Puts pairs of triangles that make a parallelogram of one colour together: half the form factors, better strata.
fn parallelograms(scene: &Scene, found: Vec<(u32, Emitter)>) -> Vec<(Vec<u32>, Emitter)> {
    let key = |p: DVec3| p.to_array().map(f64::to_bits);
    let mut diagonals: HashMap<[[u64; 3]; 2], usize> = HashMap::new();
    let mut out: Vec<Option<(Vec<u32>, Emitter)>> = Vec::new();
    for (index, emitter) in found {
        let mut partner = None;
        for k in 0..3 {
            let (p, q) = (emitter.corners[(k + 1) % 3], emitter.corners[(k + 2) % 3]);
            // The neighbour runs through the shared edge the other way round.
            if let Some(&other) = diagonals.get(&[key(q), key(p)]) {
                let apex = emitter.corners[k];
                if let Some((triangles, first)) = &out[other]
                    && triangles.len() == 1
                    && emitter.textured.is_none()
                    && first.textured.is_none()
                    && scene.triangles[triangles[0] as usize].material == scene.triangles[index as usize].material
                {
                    let opposite = first.corners.iter().find(|c| **c != p && **c != q).copied().unwrap_or(apex);
                    let size = (p - q).length();
                    if ((p + q) - (apex + opposite)).length() < 1e-5 * size && opposite != apex {
                        partner = Some((other, vec![apex, p, opposite, q]));
                    }
                }
            }
        }
        if let Some((other, corners)) = partner
            && let Some((triangles, first)) = &mut out[other]
        {
            triangles.push(index);
            first.corners = corners;
            first.area += emitter.area;
            continue;
        }
        if emitter.textured.is_none() {
            for k in 0..3 {
                diagonals.insert([key(emitter.corners[(k + 1) % 3]), key(emitter.corners[(k + 2) % 3])], out.len());
            }
        }
        out.push(Some((vec![index], emitter)));
    }
    out.into_iter().flatten().collect()
}
