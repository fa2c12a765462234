//! What patches of the mesh do to light, what they get of it first, and where it goes.

use super::IlluminationSettings;
use super::elements::{Elements, Senders};
use super::emitters::{Emitters, ShadowRays, VisibleEmitters};
use super::images::Images;
use super::lamp_image::Lamps;
use super::photons::Photon;
use super::radiosity::{RayEnd, Surroundings, Transport};
use super::surface::Surface;
use super::{Energy, sampling};
use crate::error::Result;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::bvh::{Hit, Ray, SceneBvh};
use glam::Vec3;
use rayon::prelude::*;
use std::f64::consts::PI;

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
                // A share of the rays of a picture's point at each place: the mean over the patch is what counts.
                let places = mesh.places(sender);
                let share = places.len() as u32;
                let rays = ShadowRays {
                    first: settings.shadow_rays.div_ceil(share),
                    penumbra: 0,
                    clear: clear[sender.element as usize],
                };
                let area = mesh.area(sender.element) / if sender.corner.is_some() { 3.0 } else { 1.0 };
                let mut random = Random::new(settings.seed ^ 0x1ea, number as u64);
                for &barycentric in &places {
                    let position = bvh.scene().triangles[element.triangle as usize].at(barycentric);
                    let hit =
                        Hit { triangle: element.triangle, distance: 0.0, position, barycentric, front: element.front };
                    let surface = Surface::at(bvh.scene(), &hit, (area / places.len() as f64).sqrt());
                    let at = surface.shading_point(bvh.offset());
                    let (areas, points) = emitters.light(optics, at, rays, &mut random);
                    sums[0] += surface.albedo;
                    sums[1] += areas + points + images.strong(lamps, at, rays, &mut random);
                    sums[2] += points;
                    if !emitters.sampled[element.triangle as usize] {
                        sums[3] += surface.emission;
                    }
                }
                sums = sums.map(|sum| sum / share as f32);
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
        let (mesh, bvh) = (around.mesh, &around.optics.bvh);
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
            let losses = chosen.iter().map(|&v| transport.losses(v as usize));
            let (escaped, black) = losses.fold((Vec3::ZERO, Vec3::ZERO), |sum, l| (sum.0 + l.0 / n, sum.1 + l.1 / n));
            add(2, leaving[s] * flux * escaped);
            add(1, leaving[s] * flux * black);
        }
        for (index, emitter) in emitters.polygons.iter().enumerate() {
            let side = 64u32;
            let mut random = Random::new(seed ^ 0xe4e, index as u64);
            let (mut escaped, mut black) = (Vec3::ZERO, Vec3::ZERO);
            for cell in 0..side * side {
                let point = emitter.point(random.uniform(), random.uniform());
                let up = !emitter.two_sided || cell % 2 == 0;
                let normal = if up { emitter.normal } else { -emitter.normal };
                let direction = sampling::hemisphere(normal, 1, &mut random).next().unwrap_or(normal);
                random = Random::new(random.bits(), u64::from(cell));
                let ray = Ray { origin: point.position + normal * bvh.offset(), direction };
                match around.follow(ray, &mut random) {
                    (RayEnd::Escaped { .. }, tint) => {
                        escaped += tint;
                        black += Vec3::ONE - tint;
                    }
                    (RayEnd::Black, _) => black += Vec3::ONE,
                    // What optics took on the way to a surface.
                    (RayEnd::Sender(_), tint) => black += Vec3::ONE - tint,
                }
            }
            let flux = emitter.flux() / (side * side) as f32;
            add(2, flux * escaped);
            add(1, flux * black);
        }
        let colour = |s: [f64; 3]| Vec3::new(s[0] as f32, s[1] as f32, s[2] as f32);
        Energy { emitted: colour(sums[0]), absorbed: colour(sums[1]), escaped: colour(sums[2]) }
    }
}
