//! What lamps show in rough surfaces: glints.
//!
//! Lights without a size are met by no ray into a lobe: the lobe is evaluated towards them. Lamps are looked for in two ways, by
//! rays into the lobe, few of which meet a small lamp, and by points of lamps, few of which lie in a narrow lobe. Each way counts
//! by how densely it looks there (the balance heuristic, Veach & Guibas 1995), so that the sum is right and neither way's rare
//! finds are bright.

use super::emitters::Emitters;
use super::paths::Optics;
use super::punctual::{PER_SUN, arriving};
use super::sampling::spread;
use super::surface::Surface;
use crate::random::Random;
use crate::scene::bvh::Hit;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// GGX α below which only rays into the lobe look for lamps.
const NARROW: f32 = 0.01;

/// A ray into the lobe of a rough surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LobeRay {
    /// Where it starts: thin walls that it passes change nothing [m].
    from: DVec3,
    /// How densely the rays of its look lie about its direction, all together [1/sr].
    density: f64,
    /// Points of lamps that were looked at from there.
    points: u32,
}

impl LobeRay {
    /// One of `rays` into the lobe that `view` looks at, in a direction that was drawn.
    pub(crate) fn new(surface: &Surface, view: DVec3, drawn: DVec3, rays: u32) -> Self {
        let density = f64::from(rays) * surface.density(view, drawn);
        Self { from: surface.position, density, points: points(surface, rays) }
    }
}

/// Points of lamps that a surface looks at which sends so many rays into its lobe.
fn points(surface: &Surface, rays: u32) -> u32 {
    if surface.alpha < NARROW { 0 } else { rays }
}

impl Emitters {
    /// Radiance that a rough surface's lobe sends back against `direction` [W/(m² sr)]: from lights without a size, and the part
    /// of lamps' light that is not left to the `rays` into the lobe.
    pub(crate) fn glints(
        &self,
        optics: &Optics,
        surface: &Surface,
        direction: DVec3,
        rays: u32,
        random: &mut Random,
    ) -> Vec3 {
        let at = surface.shading_point(optics.bvh.offset());
        let lobe = |towards: DVec3| surface.lobe(-direction, towards) * PI as f32;
        let sets = [rays.div_ceil(PER_SUN), 0];
        let mut sum: Vec3 = self.punctual.iter().map(|l| arriving(optics, l, at, sets, lobe, random)).sum();
        let points = if self.polygons.is_empty() { 0 } else { points(surface, rays) };
        let shift: [f64; 4] = std::array::from_fn(|_| random.uniform());
        for number in 0..points {
            let [which, u, v, _] = spread(shift, u64::from(number));
            let emitter = &self.polygons[self.drawn(which)];
            let point = emitter.point(u, v);
            let span = point.position - at.position;
            let towards = span.normalize();
            let shines = emitter.two_sided || emitter.normal.dot(span) < 0.0;
            let strength = surface.lobe(-direction, towards) * surface.normal.dot(towards).max(0.0) as f32;
            if !shines || strength.max_element() <= 0.0 {
                continue;
            }
            let lift = emitter.normal * optics.bvh.offset().copysign(-emitter.normal.dot(span));
            let seen = optics.transmittance(at.position, point.position + lift);
            if seen.max_element() > 0.0 {
                let both = f64::from(points) * self.density(emitter, span)
                    + f64::from(rays) * surface.density(-direction, towards);
                sum += emitter.radiance(optics.scene(), point) * seen * strength / both as f32;
            }
        }
        sum
    }

    /// The part of a lamp's light that a ray into a lobe counts where it meets one; all of it where no points of it are drawn.
    pub(crate) fn part_of_lobe(&self, hit: &Hit, lobe: &LobeRay) -> f32 {
        let drawn = lobe.points > 0 && lobe.density > 0.0;
        let Some(emitter) = self.polygon(hit.triangle).filter(|_| drawn) else { return 1.0 };
        let by_points = f64::from(lobe.points) * self.density(emitter, hit.position - lobe.from);
        (lobe.density / (lobe.density + by_points)) as f32
    }
}
