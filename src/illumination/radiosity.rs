//! Light that arrives by way of other surfaces.
//!
//! Unknown is the irradiance x at the vertices of [`Elements`]; a leaf sends out B = ρ(E + x̄)/π + its own weak
//! emission. The transport from leaf to vertex is sampled (`transport`).
//!
//! The linear system x = Kρ(E + x)/π is solved to a stated residual by minimal residuals over conjugate directions
//! (GCR, Eisenstat, Elman & Schultz 1983), each colour for itself.

use super::elements::{Elements, Senders};
use super::paths::{Continuation, Optics, Way};
use crate::error::Result;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::bvh::{Ray, Sides};
use glam::{DVec3, Vec3};

/// Where a gathering ray has ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum RayEnd {
    /// On a sender of the mesh.
    Sender(u32),
    /// On something that reflects nothing diffusely.
    Black,
    /// Nowhere, in this direction; by way of mirrors and glass, or straight.
    Escaped {
        /// Unit direction in which it has left.
        direction: DVec3,
        /// Whether it was reflected or refracted.
        bent: bool,
    },
}

/// The surfaces that gathering rays meet.
#[derive(Clone, Copy)]
pub(crate) struct Surroundings<'a> {
    pub(crate) mesh: &'a Elements,
    pub(crate) senders: &'a Senders,
    pub(crate) optics: &'a Optics,
}

impl Surroundings<'_> {
    /// Follows a ray to what sends the light that it brings, with what optics on the way leave of it; emission of sampled
    /// emitters is not part of that.
    pub(crate) fn follow(&self, ray: Ray, random: &mut Random) -> (RayEnd, Vec3) {
        let (mut ray, mut bent) = (ray, false);
        let mut weight = Vec3::ONE;
        for _ in 0..self.optics.bounces {
            let Some(meeting) = self.optics.bvh.meet(&ray, 0.0, f64::INFINITY, Sides::Both) else {
                return (RayEnd::Escaped { direction: ray.direction, bent }, weight);
            };
            if self.optics.optical[meeting.triangle as usize] {
                match self.optics.next(&ray, &meeting, random) {
                    Continuation::Onward(next, tint, way) => {
                        ray = next;
                        bent |= way != Way::Straight;
                        weight *= tint;
                        continue;
                    }
                    Continuation::Absorbed => return (RayEnd::Black, weight),
                    Continuation::Diffuse(share) => weight *= share,
                }
            }
            let sender = self
                .mesh
                .locate(meeting.triangle, meeting.front, meeting.barycentric)
                .and_then(|(element, weights)| self.mesh.sender(&self.optics.bvh, self.senders, element, weights));
            return (sender.map_or(RayEnd::Black, RayEnd::Sender), weight);
        }
        (RayEnd::Black, weight)
    }
}

/// What the solver did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Convergence {
    /// Applications of the transport.
    pub iterations: usize,
    /// Largest remaining ‖b − Ax‖ / ‖b‖ of the three colours.
    pub residual: f64,
}

/// Solves x = T(s + R x) for the irradiance at vertices: `source` is what leaves send without interreflection, `bounce`
/// makes what they send of the irradiance at vertices, `transport` gathers.
pub(crate) fn solve(
    source: &[Vec3],
    bounce: impl Fn(&[Vec3]) -> Vec<Vec3>,
    transport: impl Fn(&[Vec3]) -> Vec<Vec3>,
    tolerance: f64,
    most_iterations: usize,
    progress: &Progress,
) -> Result<(Vec<Vec3>, Convergence)> {
    progress.start("solving interreflection", most_iterations as u64);
    let right = transport(source);
    let norm = squares(&right, &right);
    let mut residual = right.clone();
    let mut x = vec![Vec3::ZERO; right.len()];
    let mut directions: Vec<(Vec<Vec3>, Vec<Vec3>, [f64; 3])> = Vec::new();
    let mut convergence = Convergence { iterations: 1, residual: 0.0 };
    loop {
        let rest = squares(&residual, &residual);
        convergence.residual =
            (0..3).map(|c| if norm[c] > 0.0 { (rest[c] / norm[c]).sqrt() } else { 0.0 }).fold(0.0, f64::max);
        if convergence.residual <= tolerance || convergence.iterations >= most_iterations {
            return Ok((x, convergence));
        }
        progress.check()?;
        progress.advance(1);
        let mut p = residual.clone();
        let scattered = transport(&bounce(&p));
        let mut ap: Vec<Vec3> = p.iter().zip(&scattered).map(|(&p, &s)| p - s).collect();
        convergence.iterations += 1;
        for (q, aq, aq_squared) in &directions {
            let along = ratio(squares(&ap, aq), *aq_squared);
            for i in 0..p.len() {
                p[i] -= q[i] * along;
                ap[i] -= aq[i] * along;
            }
        }
        let ap_squared = squares(&ap, &ap);
        let step = ratio(squares(&residual, &ap), ap_squared);
        for i in 0..p.len() {
            x[i] += p[i] * step;
            residual[i] -= ap[i] * step;
        }
        // Eight directions are enough to catch the few slow modes of a room; older ones go.
        if directions.len() == 8 {
            directions.remove(0);
        }
        directions.push((p, ap, ap_squared));
    }
}

fn squares(a: &[Vec3], b: &[Vec3]) -> [f64; 3] {
    a.iter().zip(b).fold([0.0; 3], |sum, (a, b)| {
        let product = *a * *b;
        [sum[0] + f64::from(product.x), sum[1] + f64::from(product.y), sum[2] + f64::from(product.z)]
    })
}

fn ratio(a: [f64; 3], b: [f64; 3]) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|c| if b[c] > 0.0 { (a[c] / b[c]) as f32 } else { 0.0 }))
}
