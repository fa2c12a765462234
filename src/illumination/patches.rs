//! What patches of the mesh do to light, what they get of it first, and where it goes.

use super::IlluminationSettings;
use super::elements::{Elements, Senders};
use super::emitter::Emitter;
use super::emitters::{Emitters, ShadowRays, VisibleEmitters};
use super::images::Images;
use super::lamp_image::Lamps;
use super::photons::Photon;
use super::radiosity::{RayEnd, Surroundings};
use super::surface::Surface;
use super::transport::Transport;
use super::{Energy, sampling, sky};
use crate::error::Result;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::bvh::{Hit, Ray, SceneBvh};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Where a patch's places get less than this part of the light of its brightest one, an edge of a shadow is about: more are looked
/// at.
const EVEN: f32 = 0.7;
/// Not at patches smaller than this part of the shortest edge that is split: those of a file's fine triangles, many of which
/// together have an even share of light and shadow.
const SMALL: f64 = 0.4;
/// Fewest shadow rays of a place.
const LEAST_SHADOW_RAYS: u32 = 4;

/// Per sender: what it does to light and what it gets.
pub(crate) struct Patches {
    pub(crate) area: Vec<f32>,
    pub(crate) albedo: Vec<Vec3>,
    pub(crate) emission: Vec<Vec3>,
    /// Irradiance over π from lamps, straight or by way of optics.
    pub(crate) direct: Vec<Vec3>,
    punctual: Vec<Vec3>,
}

/// What the solver found.
#[derive(Clone, Copy)]
pub(crate) struct Found<'a> {
    /// Radiance that leaves each sender.
    pub(crate) leaving: &'a [Vec3],
    /// Irradiance over π at the vertices, by way of other surfaces.
    pub(crate) irradiance: &'a [Vec3],
    /// The same of the environment.
    pub(crate) sky: &'a [Vec3],
}

impl Patches {
    /// Reads materials and samples direct light at a few places of each sender.
    pub(crate) fn new(
        lamps: Lamps,
        images: &Images,
        mesh: &Elements,
        senders: &Senders,
        clear: &[VisibleEmitters],
        settings: &IlluminationSettings,
        progress: &Progress,
    ) -> Result<Self> {
        let Lamps { optics, emitters } = lamps;
        let bvh = &optics.bvh;
        let diagonal = bvh.scene().bounds().map_or(0.0, |(low, high)| (high - low).length());
        let smallest = SMALL * settings.shortest_element * diagonal;
        progress.start("direct light on patches", senders.all.len() as u64);
        let found: Vec<[Vec3; 5]> = senders
            .all
            .par_iter()
            .enumerate()
            .map(|(number, &sender)| {
                progress.advance(1);
                let element = &mesh.elements[sender.element as usize];
                let buried = sender.corner.is_some_and(|k| mesh.vertices[element.corners[k as usize] as usize].buried);
                let mut sums = [Vec3::ZERO; 5];
                if buried || progress.stopped() {
                    return sums;
                }
                let area = mesh.area(sender.element) / if sender.corner.is_some() { 3.0 } else { 1.0 };
                let mut random = Random::new(settings.seed ^ 0x1ea, number as u64);
                let mut look = |places: &[[f64; 2]]| {
                    // A share of the rays of a picture's point at each place: the mean over the patch is what counts.
                    let share = places.len() as u32;
                    let rays = ShadowRays {
                        // One ray tells whether it arrives, not how much of the lamp does.
                        first: settings.shadow_rays.div_ceil(share).max(LEAST_SHADOW_RAYS),
                        penumbra: 0,
                        clear: clear[sender.element as usize],
                    };
                    let width = (area / places.len() as f64).sqrt();
                    let (mut low, mut high) = (f32::INFINITY, 0.0f32);
                    let mut sums = [Vec3::ZERO; 5];
                    for &barycentric in places {
                        let position = bvh.scene().triangles[element.triangle as usize].at(barycentric);
                        let front = element.front;
                        let hit = Hit { triangle: element.triangle, distance: 0.0, position, barycentric, front };
                        let surface = Surface::at(bvh.scene(), &hit, width);
                        let at = surface.shading_point(bvh.offset());
                        let (areas, points) = emitters.light(optics, at, rays, &mut random);
                        // Counted where it arrives, as that of punctual lights is.
                        let sky = bvh.scene().environment.as_ref().map_or(Vec3::ZERO, |around| {
                            sky::bright(around, optics, at, rays, &mut random) * emitters.scale()
                        });
                        let direct = areas + points + sky + images.strong(lamps, at, rays, &mut random);
                        (low, high) = (low.min(direct.element_sum()), high.max(direct.element_sum()));
                        sums[0] += surface.albedo;
                        sums[1] += direct;
                        sums[2] += points + sky;
                        if !emitters.sampled[element.triangle as usize] {
                            sums[3] += surface.emission;
                        }
                    }
                    (sums.map(|sum| sum / share as f32), low < EVEN * high)
                };
                let (found, uneven) = look(&mesh.places(sender));
                let large = mesh.longest_edge(sender.element as usize) > smallest;
                sums = match uneven && large && sender.corner.is_none() {
                    true => look(&mesh.many_places(sender.element)).0,
                    false => found,
                };
                sums[4] = Vec3::splat(area as f32);
                sums
            })
            .collect();
        progress.check()?;
        let column = |k: usize| found.iter().map(|f| f[k]).collect();
        let area = found.iter().map(|f| f[4].x).collect();
        Ok(Self { albedo: column(0), direct: column(1), punctual: column(2), emission: column(3), area })
    }

    /// Adds the light of photons to what senders get directly.
    pub(crate) fn receive(&mut self, bvh: &SceneBvh, mesh: &Elements, senders: &Senders, photons: &[Photon]) {
        for photon in photons {
            let Some((element, weights)) = mesh.locate(photon.triangle, photon.front, photon.barycentric) else {
                continue;
            };
            if let Some(sender) = mesh.sender(bvh, senders, element, weights) {
                let sender = sender as usize;
                if self.area[sender] > 0.0 {
                    self.direct[sender] += photon.flux / (self.area[sender] * PI as f32);
                }
            }
        }
    }

    /// Where the light went.
    pub(crate) fn energy(
        &self,
        around: &Surroundings,
        emitters: &Emitters,
        transport: &Transport,
        found: Found,
        seed: u64,
    ) -> Energy {
        let Found { leaving, irradiance, sky } = found;
        let mesh = around.mesh;
        let losses = transport.losses();
        let mut sums = [[0.0f64; 3]; 3];
        let mut add = |which: usize, flux: Vec3| {
            for (sum, part) in sums[which].iter_mut().zip(flux.to_array()) {
                *sum += f64::from(part);
            }
        };
        add(0, emitters.flux());
        for (s, &sender) in around.senders.all.iter().enumerate() {
            let flux = (f64::from(self.area[s]) * PI) as f32;
            let arriving = self.direct[s] + mesh.mean_over(sender, irradiance);
            add(0, (self.emission[s] + self.punctual[s] + mesh.mean_over(sender, sky)) * flux);
            add(1, (Vec3::ONE - self.albedo[s]) * arriving * flux);
            let corners = mesh.elements[sender.element as usize].corners;
            let chosen = sender.corner.map_or(&corners[..], |k| &corners[k as usize..=k as usize]);
            let n = chosen.len() as f32;
            let losses = chosen.iter().map(|&v| losses[v as usize]);
            let (escaped, black) = losses.fold((Vec3::ZERO, Vec3::ZERO), |sum, l| (sum.0 + l.0 / n, sum.1 + l.1 / n));
            add(2, leaving[s] * flux * escaped);
            add(1, leaving[s] * flux * black);
        }
        let (escaped, black) = lost_from_emitters(around, emitters, seed);
        add(2, escaped);
        add(1, black);
        let colour = |s: [f64; 3]| Vec3::new(s[0] as f32, s[1] as f32, s[2] as f32);
        Energy { emitted: colour(sums[0]), absorbed: colour(sums[1]), escaped: colour(sums[2]) }
    }
}

/// Rays that find out what becomes of the light of emitters. Their places and directions fill space evenly: the parts found are
/// off by some 1e-4.
const RAYS_OF_EMITTERS: u32 = 1 << 16;

/// Flux of emitters that leaves the scene without a diffuse surface on its way, and what ends on black or in optics before it
/// comes to one [W].
fn lost_from_emitters(around: &Surroundings, emitters: &Emitters, seed: u64) -> (Vec3, Vec3) {
    let power = |emitter: &Emitter| f64::from(emitter.flux().element_sum());
    let total: f64 = emitters.polygons.iter().map(power).sum();
    if total <= 0.0 {
        return (Vec3::ZERO, Vec3::ZERO);
    }
    let mut below = 0.0;
    let reached: Vec<f64> = emitters
        .polygons
        .iter()
        .map(|emitter| {
            below += power(emitter) / total;
            below
        })
        .collect();
    let mut random = Random::new(seed ^ 0xe4e, 0);
    let shift: [f64; 4] = std::array::from_fn(|_| random.uniform());
    let scene = around.optics.scene();
    let one = |shot: u32| {
        let u = (f64::from(shot) + 0.5) / f64::from(RAYS_OF_EMITTERS);
        let emitter = &emitters.polygons[reached.partition_point(|&r| r <= u).min(reached.len() - 1)];
        let [s, t, a, b] = sampling::spread(shift, u64::from(shot));
        let point = emitter.point(s, t);
        let normal = if emitter.two_sided && shot % 2 == 1 { -emitter.normal } else { emitter.normal };
        let direction = sampling::lifted(normal, a, b);
        let ray = Ray { origin: point.position + normal * around.optics.bvh.offset(), direction };
        let mut random = Random::new(seed ^ 0xe4f, u64::from(shot));
        let (end, tint) = around.follow(ray, &mut random);
        // Polygons are drawn by their mean radiance.
        let share = total / (power(emitter) * f64::from(RAYS_OF_EMITTERS));
        let local = emitter.radiance(scene, point) * (emitter.area_of_sides() * PI * share) as f32;
        match end {
            RayEnd::Escaped { .. } => (local * tint, local * (Vec3::ONE - tint)),
            RayEnd::Black => (Vec3::ZERO, local),
            // What optics took on the way to a surface.
            RayEnd::Sender(_) => (Vec3::ZERO, local * (Vec3::ONE - tint)),
        }
    };
    let found: Vec<(Vec3, Vec3)> = (0..RAYS_OF_EMITTERS).into_par_iter().map(one).collect();
    let sum = |part: fn(&(Vec3, Vec3)) -> Vec3| found.iter().map(|f| part(f).as_dvec3()).sum::<DVec3>().as_vec3();
    (sum(|f| f.0), sum(|f| f.1))
}
