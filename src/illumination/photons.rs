//! Light that reaches surfaces by way of curved mirrors, glass and rough metal: photons.
//!
//! Each lamp aims at the optical triangles themselves, in proportion to what they would receive if nothing stood
//! between; a photon that really arrives follows the material's ways on, one of them at each surface, until something
//! scatters it diffusely. Lamp point, target point and their order are one low-discrepancy sequence (Roberts 2018), so
//! the noise of a sum over n photons falls nearly as 1/n.
//!
//! Left out, since they are counted elsewhere: what lamps send straight or through thin walls (`emitters`), and paths
//! of nothing but flat mirrors (`images`).

use super::elements::NONE;
use super::emitter::Emitter;
use super::lamp_image::Lamps;
use super::paths::{Continuation, Optics, Way};
use super::punctual::{on_disc, punctual_light};
use super::sampling::{spread, triangle_weights};
use super::surface::ShadingPoint;
use crate::error::Result;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::bvh::{Meeting, Ray, Sides};
use crate::scene::{LightKind, PunctualLight};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Part of a target's chance that does not depend on how it is lit, so that no lit one is missed.
const EVEN_PART: f64 = 0.02;
/// A flat mirror is aimed at this much less: most of its paths are images.
const FLAT_PART: f64 = 0.1;

/// Light that has arrived on a diffuse surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Photon {
    /// Where [m].
    pub(crate) position: DVec3,
    /// Unit geometric normal on the lit side.
    pub(crate) facing: Vec3,
    /// Where in the mesh.
    pub(crate) triangle: u32,
    pub(crate) front: bool,
    pub(crate) barycentric: [f32; 2],
    /// Flux [W].
    pub(crate) flux: Vec3,
    /// Whether a punctual light has sent it.
    pub(crate) is_of_point: bool,
}

/// A lamp that aims.
enum Lamp<'a> {
    Polygon(&'a Emitter),
    Point(&'a PunctualLight),
}

/// What may be aimed at.
struct Target {
    triangle: u32,
    area: f64,
    middle: DVec3,
    normal: DVec3,
    part: f64,
}

/// Shoots about `count` photons from all lamps together; those that arrive, in a fixed order.
///
/// # Errors
/// [`crate::error::Error::Interrupted`] when asked to stop.
pub(crate) fn shoot(lit: Lamps, count: u32, seed: u64, progress: &Progress) -> Result<Vec<Photon>> {
    let scene = lit.optics.scene();
    let targets: Vec<Target> = (0..scene.triangles.len() as u32)
        .filter(|&t| lit.optics.optical[t as usize] && scene.triangles[t as usize].area() > 0.0)
        .map(|triangle| {
            let shape = &scene.triangles[triangle as usize];
            let flat = lit.optics.mirrors.of[triangle as usize] != NONE;
            let part = if flat { FLAT_PART } else { 1.0 };
            Target { triangle, area: shape.area(), middle: shape.at([1.0 / 3.0; 2]), normal: shape.normal(), part }
        })
        .collect();
    // Where all optics are flat mirrors, images tell all.
    if count == 0 || targets.iter().all(|t| t.part < 1.0) {
        return Ok(Vec::new());
    }
    let polygons = lit.emitters.polygons.iter().map(Lamp::Polygon);
    let lamps: Vec<Lamp> = polygons.chain(scene.lights.iter().map(Lamp::Point)).collect();
    let chances: Vec<Vec<f64>> = lamps.par_iter().map(|lamp| lamp.chances(lit, &targets)).collect();
    let strengths: Vec<f64> = chances.iter().map(|c| c.iter().sum()).collect();
    let total: f64 = strengths.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return Ok(Vec::new());
    }
    progress.start("photons through mirrors and glass", u64::from(count));
    let mut photons = Vec::new();
    for (number, ((lamp, chances), strength)) in lamps.iter().zip(&chances).zip(&strengths).enumerate() {
        let shots = (f64::from(count) * strength / total).round() as u64;
        let mut below = 0.0;
        let reached: Vec<f64> = chances
            .iter()
            .map(|c| {
                below += c / strength;
                below
            })
            .collect();
        let mut random = Random::new(seed, number as u64);
        let shift: [f64; 4] = std::array::from_fn(|_| random.uniform());
        let arrived: Vec<Option<Photon>> = (0..shots)
            .into_par_iter()
            .map(|shot| {
                if shot % 1024 == 0 {
                    progress.advance(1024);
                }
                if progress.stopped() {
                    return None;
                }
                let u = (shot as f64 + 0.5) / shots as f64;
                let k = reached.partition_point(|&r| r <= u).min(targets.len() - 1);
                let chance = chances[k] / strength;
                let place = spread(shift, shot);
                let mut random = Random::new(seed ^ 0x9407 ^ ((number as u64) << 32), shot);
                let aimed = lamp.aim(lit, &targets[k], place)?;
                let arrived = follow(lit.optics, aimed, 1.0 / (chance * shots as f64), &mut random)?;
                Some(Photon { is_of_point: matches!(lamp, Lamp::Point(_)), ..arrived })
            })
            .collect();
        progress.check()?;
        photons.extend(arrived.into_iter().flatten());
    }
    Ok(photons)
}

/// A ray that arrives at a target, and the flux density that it stands for, times the target's area [W].
struct Aimed {
    ray: Ray,
    meeting: Meeting,
    flux: Vec3,
}

impl Lamp<'_> {
    /// How much flux each target gets, about, if nothing stands between.
    fn chances(&self, lit: Lamps, targets: &[Target]) -> Vec<f64> {
        let mut chances: Vec<f64> = targets
            .iter()
            .map(|t| {
                let light = match self {
                    Self::Polygon(e) => {
                        let span = t.middle - e.corners.iter().sum::<DVec3>() / e.corners.len() as f64;
                        // Near a lamp the midpoints say little: not nearer than the triangle is large.
                        let squared = span.length_squared().max(t.area);
                        let leaving = e.normal.dot(span) / squared.sqrt();
                        let leaving = if e.two_sided { leaving.abs() } else { leaving.max(0.0) };
                        let arriving = t.normal.dot(span).abs() / squared.sqrt();
                        f64::from(e.mean_radiance.element_sum()) * e.area * leaving * arriving / squared
                    }
                    Self::Point(light) => {
                        let towards = |normal| {
                            punctual_light(lit.optics.bvh.size(), light, ShadingPoint { position: t.middle, normal })
                        };
                        let found = towards(t.normal).or_else(|| towards(-t.normal));
                        found.map_or(0.0, |(strength, _)| f64::from(strength.element_sum()))
                    }
                };
                light * t.area * t.part
            })
            .collect();
        let (lit, area): (f64, f64) =
            chances.iter().zip(targets).fold((0.0, 0.0), |s, (c, t)| (s.0 + c, s.1 + t.area * t.part));
        chances.iter_mut().zip(targets).for_each(|(c, t)| *c += EVEN_PART * lit * t.area * t.part / area);
        chances
    }

    /// Aims at a place of a target; `None` where nothing arrives.
    fn aim(&self, lit: Lamps, target: &Target, place: [f64; 4]) -> Option<Aimed> {
        let (bvh, scene) = (&lit.optics.bvh, lit.optics.scene());
        let (v, w) = triangle_weights(place[0], place[1]);
        let at = scene.triangles[target.triangle as usize].at([v, w]);
        let (from, flux) = match self {
            Self::Polygon(e) => {
                let from = e.point(place[2], place[3]);
                let span = at - from.position;
                let leaving = e.normal.dot(span);
                if leaving <= 0.0 && !e.two_sided {
                    return None;
                }
                let squared = span.length_squared();
                let solid = leaving.abs() * target.normal.dot(span).abs() / (squared * squared);
                let lift = e.normal * bvh.offset().copysign(leaving);
                (
                    from.position + lift,
                    e.radiance(scene, from) * (solid * e.area * target.area) as f32 * lit.emitters.scale(),
                )
            }
            Self::Point(light) => {
                let towards = |normal| punctual_light(bvh.size(), light, ShadingPoint { position: at, normal });
                let (strength, end) = towards(target.normal).or_else(|| towards(-target.normal))?;
                let end = match light.kind {
                    LightKind::Sun { radius } => on_disc(at, end, radius, [place[2], place[3]]),
                    _ => end,
                };
                (end, strength * (std::f64::consts::PI * target.area) as f32)
            }
        };
        let span = at - from;
        let distance = span.length();
        let front = target.normal.dot(span) < 0.0;
        let near = if front { target.normal } else { -target.normal };
        let left = lit.optics.transmittance(from, at + near * bvh.offset());
        let flux = flux * left;
        if !(flux.max_element() > 0.0 && flux.is_finite()) {
            return None;
        }
        let barycentric = [v as f32, w as f32];
        let meeting = Meeting { triangle: target.triangle, distance: distance as f32, barycentric, front };
        Some(Aimed { ray: Ray { origin: from, direction: span / distance }, meeting, flux })
    }
}

/// Follows light from its first optical surface to the first diffuse one.
fn follow(optics: &Optics, aimed: Aimed, share: f64, random: &mut Random) -> Option<Photon> {
    let bvh = &optics.bvh;
    let Aimed { mut ray, mut meeting, flux } = aimed;
    let mut flux = flux * share as f32;
    let mut plain = true;
    for bounce in 0..optics.bounces {
        let mut arrives = !optics.optical[meeting.triangle as usize];
        if !arrives {
            match optics.next(&ray, &meeting, random) {
                Continuation::Absorbed => return None,
                // What the first surface scatters itself is direct light.
                Continuation::Diffuse(_) if bounce == 0 => return None,
                Continuation::Diffuse(part) => {
                    flux *= part;
                    arrives = true;
                }
                // A thin wall that is passed is no first surface: the next one is aimed at through it.
                Continuation::Onward(_, _, Way::Straight) if bounce == 0 => return None,
                Continuation::Onward(next, tint, way) => {
                    plain &= way == Way::Straight
                        || (way == Way::Mirrored && optics.mirrors.of[meeting.triangle as usize] != NONE);
                    flux *= tint;
                    ray = next;
                }
            }
        }
        if arrives {
            if plain {
                return None;
            }
            let hit = bvh.refined(&ray, &meeting);
            let triangle = &bvh.scene().triangles[hit.triangle as usize];
            let facing = triangle.normal() * if hit.front { 1.0 } else { -1.0 };
            return Some(Photon {
                position: hit.position,
                facing: facing.as_vec3(),
                triangle: hit.triangle,
                front: hit.front,
                barycentric: meeting.barycentric,
                flux,
                is_of_point: false,
            });
        }
        meeting = bvh.meet(&ray, 0.0, f64::INFINITY, Sides::Both)?;
    }
    None
}
