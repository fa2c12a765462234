//! Light that arrives by way of other surfaces.
//!
//! Unknown is the irradiance x at the vertices of [`Elements`]; a leaf sends out B = ρ(E + x̄)/π + its own weak
//! emission. The transport from leaf to vertex is sampled once: each vertex casts cosine-distributed rays, and the part
//! of them that ends on a leaf is the (1/π)∫cosθ dω form factor to its visible part. Rows sum to one or less by
//! construction, so a closed furnace comes out exactly, and the work is rays × log n, not patches². Rays that meet a
//! mirror or glass go on, so these take part in interreflection.
//!
//! The linear system x = Kρ(E + x)/π is solved to a stated residual by minimal residuals over conjugate directions
//! (GCR, Eisenstat, Elman & Schultz 1983), each colour for itself.

use super::elements::{Elements, Senders, Vertex};
use super::paths::{Continuation, Optics, Way};
use super::probes::Probes;
use super::sampling::hemisphere;
use crate::error::Result;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::bvh::{Ray, Sides};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

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

/// How many rays gather.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GatheringRays {
    /// From each probe, where there are few.
    pub(crate) each: usize,
    /// From all probes together, at most.
    pub(crate) together: usize,
}

/// The sampled transport from senders to vertices.
pub(crate) struct Transport<'a> {
    probes: &'a Probes,
    /// What each probe has found.
    found: Vec<Gathered>,
    /// Means over each vertex' rays of what the environment sends by way of mirrors and glass.
    beyond: Vec<Vec3>,
    /// Parts of each vertex' light that escape, and that end on black or in optics.
    losses: Vec<(Vec3, Vec3)>,
}

/// What one probe has found.
#[derive(Default)]
struct Gathered {
    /// The senders that it sees plainly, one for each ray that ends on one.
    plain: Vec<u32>,
    tinted: Vec<(u32, Vec3)>,
    /// Rays that count: those above its horizon.
    counted: f32,
    escaped: Vec3,
    absorbed: Vec3,
    beyond: Vec3,
}

/// Probes from which it is worth to find out whether any light comes their way before they look well.
const MANY: usize = 10_000;
/// Rays by which that is found out, squared.
const FIRST_SIDE: usize = 4;

impl<'a> Transport<'a> {
    /// Casts rays from each probe; few from those that no light reaches, as inside closed bodies. `shines` tells which senders
    /// send light before any comes from other surfaces.
    pub(crate) fn cast(
        around: &Surroundings,
        probes: &'a Probes,
        rays: GatheringRays,
        shines: impl Fn(u32) -> bool + Sync,
        seed: u64,
        progress: &Progress,
    ) -> Result<Self> {
        let count = probes.at.len();
        progress.start("gathering indirect light", count as u64);
        let mut found: Vec<Gathered> = Vec::new();
        let lit = if count > MANY {
            let look = |&at: &u32| Gathered::new(around, at, FIRST_SIDE, seed ^ 0xf125, progress);
            found = probes.at.par_iter().map(look).collect();
            progress.check()?;
            lit(around, probes, &found, shines)
        } else {
            vec![true; count]
        };
        let most = rays.together as f64 / lit.iter().filter(|lit| **lit).count().max(1) as f64;
        let side = (rays.each as f64).min(most).sqrt().floor().max(4.0) as usize;
        let look = |(place, &lit): (usize, &bool)| {
            progress.advance(1);
            lit.then(|| Gathered::new(around, probes.at[place], side, seed, progress))
        };
        let closer: Vec<Option<Gathered>> = lit.par_iter().enumerate().map(look).collect();
        progress.check()?;
        found.resize_with(count, Gathered::default);
        for (found, closer) in found.iter_mut().zip(closer) {
            if let Some(closer) = closer {
                *found = closer;
            } else {
                // What it sees sends nothing.
                (found.plain, found.tinted) = (Vec::new(), Vec::new());
            }
        }
        let spread = |of: fn(&Gathered) -> Vec3| {
            probes.spread(&found.iter().map(|f| of(f) / f.counted.max(1.0)).collect::<Vec<_>>())
        };
        let (escaped, absorbed, beyond) = (spread(|f| f.escaped), spread(|f| f.absorbed), spread(|f| f.beyond));
        // What a body buries sends its light into it.
        let all = |(vertex, loss): (&Vertex, (Vec3, Vec3))| if vertex.buried { (Vec3::ZERO, Vec3::ONE) } else { loss };
        let losses = around.mesh.vertices.iter().zip(escaped.into_iter().zip(absorbed)).map(all).collect();
        Ok(Self { probes, found, beyond, losses })
    }

    /// Mean of the senders' radiance over each vertex' rays: its irradiance over π.
    pub(crate) fn gather(&self, radiance: &[Vec3], scale: f32) -> Vec<Vec3> {
        let one = |found: &Gathered| {
            let plain: Vec3 = found.plain.iter().map(|&e| radiance[e as usize]).sum();
            let tinted: Vec3 = found.tinted.iter().map(|&(e, weight)| radiance[e as usize] * weight).sum();
            (plain + tinted) * (scale / found.counted.max(1.0))
        };
        self.probes.spread(&self.found.par_iter().map(one).collect::<Vec<_>>())
    }

    /// Rays that count.
    pub(crate) fn rays(&self) -> u64 {
        self.found.iter().map(|found| found.counted as u64).sum()
    }

    /// Irradiance over π at the vertices that comes from the environment by way of mirrors and glass.
    pub(crate) fn beyond(&self) -> &[Vec3] {
        &self.beyond
    }

    /// Parts of a vertex' light that escape, and that end on black or in optics.
    pub(crate) fn losses(&self, vertex: usize) -> (Vec3, Vec3) {
        self.losses[vertex]
    }
}

impl Gathered {
    /// What a vertex finds by `side`² rays.
    fn new(around: &Surroundings, at: u32, side: usize, seed: u64, progress: &Progress) -> Self {
        let (bvh, vertex) = (&around.optics.bvh, &around.mesh.vertices[at as usize]);
        let mut found = Self::default();
        if progress.stopped() {
            return found;
        }
        let mut random = Random::new(seed, u64::from(at));
        let (facing, origin) = (vertex.facing(), vertex.origin(bvh.offset()));
        let directions: Vec<DVec3> = hemisphere(vertex.normal, side, &mut random).collect();
        let mut random = Random::new(seed ^ 0x5bd1, u64::from(at));
        for direction in directions {
            if direction.dot(facing) <= 0.0 {
                continue;
            }
            found.counted += 1.0;
            let (reached, tint) = around.follow(Ray { origin, direction }, &mut random);
            let left = if reached == RayEnd::Black { Vec3::ZERO } else { tint };
            found.absorbed += Vec3::ONE - left;
            match reached {
                RayEnd::Escaped { direction, bent } => {
                    found.escaped += tint;
                    if bent && let Some(around) = &around.optics.scene().environment {
                        found.beyond += tint * around.smooth(direction);
                    }
                }
                RayEnd::Black => {}
                RayEnd::Sender(sender) if tint == Vec3::ONE => found.plain.push(sender),
                RayEnd::Sender(sender) => found.tinted.push((sender, tint)),
            }
        }
        found.plain.shrink_to_fit();
        found
    }
}

/// Which probes light reaches, by the few rays that all of them have cast: those that see something that shines, or that is lit by
/// what such a probe is lit by.
fn lit(around: &Surroundings, probes: &Probes, found: &[Gathered], shines: impl Fn(u32) -> bool + Sync) -> Vec<bool> {
    let sees = |found: &Gathered, of: &(dyn Fn(u32) -> bool + Sync)| {
        found.plain.iter().copied().chain(found.tinted.iter().map(|(sender, _)| *sender)).any(of)
    };
    let first = |found: &Gathered| found.beyond != Vec3::ZERO || sees(found, &shines);
    let mut lit: Vec<bool> = found.par_iter().map(first).collect();
    loop {
        let is_lit = |sender: u32| {
            let element = around.senders.all[sender as usize].element;
            let corners = around.mesh.elements[element as usize].corners;
            corners.iter().any(|&v| probes.of(v).any(|probe| lit[probe as usize]))
        };
        let next: Vec<bool> = lit.par_iter().zip(found).map(|(lit, found)| *lit || sees(found, &is_lit)).collect();
        if next == lit {
            return lit;
        }
        lit = next;
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
