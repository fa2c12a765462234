//! Reading the light: what a lit scene's surfaces show at a point.

use super::elements::NONE;
use super::emitters::ShadowRays;
use super::radiosity::RayEnd;
use super::{Illumination, LobeRay, Surface, sampling, sky};
use crate::random::Random;
use crate::scene::Environment;
use crate::scene::bvh::{Hit, Ray};
use glam::{DVec3, Vec3};

/// Rays with which a point gathers where its element is cut through.
const CUT_RAYS: u32 = 256;

/// Where a hit lies in the mesh.
#[derive(Clone, Copy)]
struct MeshPoint {
    /// The leaf, or [`NONE`].
    element: u32,
    weights: [f32; 3],
}

/// What surfaces show to a look of the light that they scatter, wherever it is kept.
pub(crate) trait DiffuseLight {
    /// Radiance that a surface's diffuse part and its emission send out at a hit [W/(m² sr)]; a pixel is `footprint` wide
    /// there [m], and a mean is taken over `share` looks like this.
    fn shown(&self, hit: &Hit, surface: &Surface, footprint: f64, share: u32, random: &mut Random) -> Vec3;

    /// Radiance that a glossy surface sends back against `direction` from lights without a size, and what of lamps' light is not
    /// left to `rays` into its lobe [W/(m² sr)].
    fn glints(&self, surface: &Surface, direction: DVec3, rays: u32, random: &mut Random) -> Vec3;

    /// The part of what shines at a hit that is left to a ray into a lobe.
    fn part_of_lobe(&self, hit: &Hit, lobe: &LobeRay) -> f32;

    /// Radiance from beyond the scene; a ray into a lobe has seen suns as glints before.
    fn beyond(&self, around: &Environment, direction: DVec3, by_lobe: bool) -> Vec3 {
        if by_lobe { around.smooth(direction) } else { around.radiance(direction) }
    }
}

impl DiffuseLight for Illumination {
    fn shown(&self, hit: &Hit, surface: &Surface, _: f64, share: u32, random: &mut Random) -> Vec3 {
        self.radiance(hit, surface, share, random)
    }

    fn glints(&self, surface: &Surface, direction: DVec3, rays: u32, random: &mut Random) -> Vec3 {
        self.emitters.glints(&self.optics, surface, direction, rays, random)
    }

    fn part_of_lobe(&self, hit: &Hit, lobe: &LobeRay) -> f32 {
        self.emitters.part_of_lobe(hit, lobe)
    }
}

impl Illumination {
    /// Radiance that a surface's diffuse part and its emission send out at a hit [W/(m² sr)].
    ///
    /// `share` is the number of looks whose mean is taken: each then samples lamps and surroundings with that part of the
    /// rays of a single one.
    pub(crate) fn radiance(&self, hit: &Hit, surface: &Surface, share: u32, random: &mut Random) -> Vec3 {
        if !surface.is_diffuse() {
            return surface.emission;
        }
        surface.emission + surface.albedo * self.received(hit, surface, share, random)
    }

    /// Irradiance over π at a hit [W/(m² sr)]: what a white surface would show.
    pub(super) fn received(&self, hit: &Hit, surface: &Surface, share: u32, random: &mut Random) -> Vec3 {
        let found = self.mesh.locate(hit.triangle, hit.front, hit.barycentric.map(|b| b as f32));
        let (element, weights) = found.unwrap_or((NONE, [0.0; 3]));
        let place = MeshPoint { element, weights };
        let direct = self.direct(place, surface, share.max(1), random);
        direct + self.indirect(place, surface, share.max(1), random)
    }

    /// Irradiance over π that comes from lamps, straight or by way of mirrors and glass.
    fn direct(&self, place: MeshPoint, surface: &Surface, share: u32, random: &mut Random) -> Vec3 {
        let at = surface.shading_point(self.bvh().offset());
        let clear = self.clear.get(place.element as usize).copied().unwrap_or(0);
        let (first, penumbra) = (self.settings.shadow_rays, self.settings.penumbra_rays);
        // A second set of rays where the first one disagrees is for single looks; means take one set.
        let rays = match share {
            1 => ShadowRays { first, penumbra, clear },
            _ => ShadowRays { first: (first + penumbra).div_ceil(share), penumbra: 0, clear },
        };
        let (areas, points) = self.emitters.light(&self.optics, at, rays, random);
        let sky =
            self.bvh().scene().environment.as_ref().map_or(Vec3::ZERO, |around| {
                sky::bright(around, &self.optics, at, rays, random) * self.emitters.scale()
            });
        let rays = ShadowRays { first: rays.first.div_ceil(2), penumbra: rays.penumbra / 2, ..rays };
        let (mirrored, of_points) = self.images.strong(self.lamps(), at, rays, random);
        areas + points + mirrored + of_points + sky + self.caustics.light(surface.position, surface.facing)
    }

    /// Irradiance over π that comes by way of other surfaces.
    fn indirect(&self, place: MeshPoint, surface: &Surface, share: u32, random: &mut Random) -> Vec3 {
        let rays = match self.settings.final_gather {
            Some(rays) => rays,
            None if place.element == NONE => return Vec3::ZERO,
            None => {
                let element = &self.mesh.elements[place.element as usize];
                if !element.cut {
                    let corners = element.corners.iter().zip(place.weights);
                    return corners.map(|(&v, w)| self.irradiance[v as usize] * w).sum();
                }
                CUT_RAYS
            }
        };
        let (images, of_points) = self.images.weak(self.lamps(), surface.shading_point(self.bvh().offset()), random);
        let sky = match &self.bvh().scene().environment {
            Some(around) => {
                let side = f64::from(rays.div_ceil(share)).sqrt().ceil() as usize;
                let at = surface.shading_point(self.bvh().offset());
                sky::plain(around, &self.optics, at, side, random) * self.settings.form_factor.scale() as f32
            }
            None => Vec3::ZERO,
        };
        images + of_points + sky + self.gather(surface, f64::from(rays.div_ceil(share)).sqrt().ceil() as usize, random)
    }

    /// Indirect irradiance over π, gathered with `side`² rays from the mesh's radiosity.
    fn gather(&self, surface: &Surface, side: usize, random: &mut Random) -> Vec3 {
        let origin = surface.shading_point(self.bvh().offset()).position;
        let directions: Vec<DVec3> = sampling::hemisphere(surface.normal, side, random).collect();
        // `hemisphere` works on a copy of the stream; step past what it has used.
        *random = Random::new(random.bits(), 1);
        let around = self.surroundings();
        let (mut sum, mut rays) = (Vec3::ZERO, 0.0f32);
        for direction in directions {
            if direction.dot(surface.facing) > 0.0 {
                rays += 1.0;
                match around.follow(Ray { origin, direction }, random) {
                    (RayEnd::Sender(sender), weight) => sum += self.leaving[sender as usize] * weight,
                    (RayEnd::Escaped { direction, bent: true }, weight) => {
                        let beyond = &self.bvh().scene().environment;
                        sum += beyond.as_ref().map_or(Vec3::ZERO, |sky| sky.smooth(direction)) * weight;
                    }
                    _ => {}
                }
            }
        }
        sum * (self.settings.form_factor.scale() as f32 / rays.max(1.0))
    }
}
