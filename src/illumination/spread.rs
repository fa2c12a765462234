//! How far off the light is that the mesh keeps: a part of it is sampled a second time.
//!
//! What two independent samples of the same probe differ by has twice the variance of each. Looks at some places of a picture
//! note which vertices they read; those alone are sampled again; the same looks then see the difference in place of the light, so
//! that mirrors, gloss and albedo weigh it as they weigh light.

use super::gathered::Gathered;
use super::probes::Probes;
use super::shading::DiffuseLight;
use super::{Illumination, LobeRay, Surface, sky};
use crate::error::Result;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::Environment;
use crate::scene::bvh::Hit;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// How probes have sampled, and what they have found.
pub(super) struct Sampled {
    pub(super) probes: Probes,
    pub(super) side: usize,
    /// Jump of brightness from which cells were looked at again.
    pub(super) jump: f32,
    /// Irradiance over π by way of other surfaces, at each probe.
    pub(super) found: Vec<Vec3>,
    /// Irradiance over π straight from the plain part of the environment, at each vertex, and the rays for it.
    pub(super) sky: Vec<Vec3>,
    pub(super) sky_side: usize,
}

/// Notes which vertices looks read.
pub(crate) struct Noted<'a> {
    light: &'a Illumination,
    vertices: Vec<AtomicBool>,
}

/// Shows what two samples of the light differ by.
pub(crate) struct Spread<'a> {
    light: &'a Illumination,
    /// At each vertex that was noted.
    differences: Vec<Vec3>,
}

impl<'a> Noted<'a> {
    /// Nothing yet.
    pub(crate) fn new(light: &'a Illumination) -> Self {
        Self { light, vertices: light.mesh.vertices.iter().map(|_| AtomicBool::new(false)).collect() }
    }

    /// Samples the vertices that were noted a second time.
    ///
    /// # Errors
    /// [`crate::error::Error::Interrupted`] when asked to stop.
    pub(crate) fn spread(&self, progress: &Progress) -> Result<Spread<'a>> {
        let light = self.light;
        let noted = |v: usize| self.vertices[v].load(Ordering::Relaxed);
        let Sampled { probes, side, jump, found, .. } = &light.sampled;
        let mut asked = vec![false; probes.at.len()];
        let count = light.mesh.vertices.len();
        (0..count).filter(|v| noted(*v)).flat_map(|v| probes.of(v as u32)).for_each(|p| asked[p as usize] = true);
        let brightness: Vec<f32> = light.leaving.iter().map(|radiance| radiance.element_sum()).collect();
        let (around, seed) = (light.surroundings(), light.settings.seed ^ 0x2ec0);
        let scale = light.settings.form_factor.scale() as f32;
        progress.start("estimating the error of light", 0);
        let again = |(probe, asked): (usize, &bool)| {
            if !asked || progress.stopped() {
                return Vec3::ZERO;
            }
            let at = probes.at[probe];
            let mut second = Gathered::new(&around, at, *side, seed, progress);
            let chosen = second.jumps(*side, &brightness, *jump);
            if !chosen.is_empty() {
                second.look_again(&around, at, *side, &chosen, seed);
            }
            second.mean(&light.leaving) * scale - found[probe]
        };
        let differences: Vec<Vec3> = asked.par_iter().enumerate().map(again).collect();
        progress.check()?;
        let mut differences = probes.spread(&differences);
        if let Some(around) = light.bvh().scene().environment.as_ref() {
            let Sampled { sky: first, sky_side, .. } = &light.sampled;
            differences.par_iter_mut().enumerate().filter(|(v, _)| noted(*v)).for_each(|(v, difference)| {
                let (vertex, mut random) = (&light.mesh.vertices[v], Random::new(seed, v as u64));
                let at = vertex.shading_point(light.bvh().offset());
                if !vertex.buried {
                    *difference += (sky::plain(around, &light.optics, at, *sky_side, &mut random) - first[v]) * scale;
                }
            });
        }
        Ok(Spread { light, differences })
    }
}

impl Illumination {
    /// The vertices whose light a look at a hit reads, and how much each counts; none where it gathers for itself.
    fn read_from(&self, hit: &Hit) -> Option<([u32; 3], [f32; 3])> {
        let (element, weights) = self.mesh.locate(hit.triangle, hit.front, hit.barycentric.map(|b| b as f32))?;
        let element = &self.mesh.elements[element as usize];
        (!element.cut && self.settings.final_gather.is_none()).then_some((element.corners, weights))
    }
}

impl DiffuseLight for Noted<'_> {
    fn shown(&self, hit: &Hit, _: &Surface, _: f64, _: u32, _: &mut Random) -> Vec3 {
        if let Some((corners, _)) = self.light.read_from(hit) {
            corners.iter().for_each(|&v| self.vertices[v as usize].store(true, Ordering::Relaxed));
        }
        Vec3::ZERO
    }

    fn glints(&self, _: &Surface, _: DVec3, _: u32, _: &mut Random) -> Vec3 {
        Vec3::ZERO
    }

    fn part_of_lobe(&self, _: &Hit, _: &LobeRay) -> f32 {
        1.0
    }

    fn beyond(&self, _: &Environment, _: DVec3, _: bool) -> Vec3 {
        Vec3::ZERO
    }
}

impl DiffuseLight for Spread<'_> {
    fn shown(&self, hit: &Hit, surface: &Surface, _: f64, _: u32, _: &mut Random) -> Vec3 {
        let read = self.light.read_from(hit).filter(|_| surface.is_diffuse());
        read.map_or(Vec3::ZERO, |(corners, weights)| {
            let sum: Vec3 = corners.iter().zip(weights).map(|(&v, w)| self.differences[v as usize] * w).sum();
            surface.albedo * sum
        })
    }

    fn glints(&self, _: &Surface, _: DVec3, _: u32, _: &mut Random) -> Vec3 {
        Vec3::ZERO
    }

    fn part_of_lobe(&self, _: &Hit, _: &LobeRay) -> f32 {
        1.0
    }

    fn beyond(&self, _: &Environment, _: DVec3, _: bool) -> Vec3 {
        Vec3::ZERO
    }
}
