//! The slow obvious way to light: paths from the eye that find lamps by chance.
//!
//! No lamp is aimed at, nothing is stored: each path follows the materials until it ends, and all emission that it meets
//! counts. Its mean is the radiance that [`super::Illumination`] approximates; its noise falls with the root of the number
//! of paths. For tests and comparisons.

use super::paths::{Continuation, Optics, Way};
use super::sampling::hemisphere;
use super::surface::Surface;
use crate::random::Random;
use crate::scene::bvh::{Ray, SceneBvh, Sides};
use glam::Vec3;
use std::sync::Arc;

/// Surfaces after which a path may be ended by chance, its weight raised in turn.
const SURE: u32 = 4;
/// Surfaces after which a path ends.
const MOST: u32 = 1000;

/// A plain path tracer.
pub(crate) struct Oracle {
    optics: Optics,
}

impl Oracle {
    /// For a scene without punctual lights: no path meets those by chance.
    pub(crate) fn new(bvh: Arc<SceneBvh>) -> Self {
        Self { optics: Optics::new(bvh, MOST, 0) }
    }

    /// Radiance that one path finds along an eye's ray [W/(m² sr)]: its mean over many is the truth.
    pub(crate) fn radiance(&self, ray: Ray, random: &mut Random) -> Vec3 {
        let (mut ray, mut weight, mut sum, mut sides) = (ray, Vec3::ONE, Vec3::ZERO, Sides::Front);
        let mut bent = false;
        for surface_number in 0..MOST {
            let Some(meeting) = self.optics.bvh.meet(&ray, 0.0, f64::INFINITY, sides) else {
                // Straight ahead it is dark.
                if let Some(around) = self.optics.scene().environment.as_ref().filter(|_| bent) {
                    sum += weight * around.radiance(ray.direction);
                }
                break;
            };
            sides = Sides::Both;
            let hit = self.optics.bvh.refined(&ray, &meeting);
            let surface = Surface::at(self.optics.scene(), &hit, 0.0);
            let material = self.optics.scene().material(hit.triangle);
            if !hit.front && !material.double_sided && material.transmission <= 0.0 {
                break;
            }
            sum += weight * surface.emission * surface.coverage;
            let way = match self.optics.optical[hit.triangle as usize] {
                true => self.optics.next(&ray, &meeting, random),
                false => Continuation::Diffuse(Vec3::ONE),
            };
            match way {
                Continuation::Absorbed => break,
                Continuation::Onward(next, tint, way) => {
                    bent |= way != Way::Straight;
                    ray = next;
                    weight *= tint;
                }
                Continuation::Diffuse(part) => {
                    bent = true;
                    weight *= part * surface.albedo;
                    let direction = hemisphere(surface.normal, 1, random).next().unwrap_or(surface.normal);
                    *random = Random::new(random.bits(), u64::from(surface_number));
                    if direction.dot(surface.facing) <= 0.0 {
                        break;
                    }
                    ray = Ray { origin: surface.position + surface.facing * self.optics.bvh.offset(), direction };
                }
            }
            let strength = weight.max_element().min(1.0);
            if surface_number >= SURE {
                if random.uniform_f32() >= strength {
                    break;
                }
                weight /= strength;
            }
        }
        sum
    }
}
