//! What of the light that patches send arrives where.
//!
//! The transport from patches to probes is sampled: each probe casts cosine-distributed rays, one in each cell of its hemisphere,
//! and the part of them that ends on a patch is the (1/π)∫cosθ dω form factor to its visible part. Rows sum to one or less by
//! construction, so a closed furnace comes out exactly, and the work is rays × log n, not patches². Rays that meet a mirror or
//! glass go on, so these take part in interreflection.
//!
//! Once it is known about how bright the patches are, cells about which brightness jumps are looked at with more rays: a spot of
//! sun on the floor lights a room from a few cells. Whether a cell is one of them is told by the cells beside it, not by its own
//! ray, so that means stay what they are.

use super::elements::Vertex;
use super::probes::Probes;
use super::radiosity::{RayEnd, Surroundings};
use super::sampling::Hemisphere;
use crate::error::Result;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::bvh::Ray;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// How many rays gather.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GatheringRays {
    /// From each probe, where there are few.
    pub(crate) each: usize,
    /// From all probes together, at most.
    pub(crate) together: usize,
}

/// Probes from which it is worth to find out whether any light comes their way before they look well.
const MANY: usize = 10_000;
/// Rays by which that is found out, squared.
const FIRST_SIDE: usize = 4;
/// A cell in whose neighbourhood brightness jumps by `j` times what arrives on average is looked at again with j/`JUMP` rays, a
/// square number of them up to `FINEST`²: the noise of a cell is in proportion to its jump, and so should its rays be.
const JUMP: f32 = 1.0;
const FINEST: usize = 5;
/// By how much fewer where these were too many.
const FEWER: f32 = 1.5;

/// The sampled transport from senders to vertices.
pub(crate) struct Transport<'a> {
    around: Surroundings<'a>,
    probes: &'a Probes,
    /// Cells along each side of a probe's hemisphere.
    side: usize,
    seed: u64,
    /// What each probe has found.
    found: Vec<Gathered>,
}

/// What ends the ray of a cell where that is no sender, or is one by way of mirrors and glass.
const BELOW: u32 = u32::MAX;
const ESCAPED: u32 = u32::MAX - 1;
const ABSORBED: u32 = u32::MAX - 2;
const OPTICS: u32 = u32::MAX - 3;
/// A cell that has been looked at with more rays.
const AGAIN: u32 = u32::MAX - 4;
const SENDERS: u32 = AGAIN;

/// The end of a ray by way of mirrors and glass.
#[derive(Clone, Copy)]
struct ByOptics {
    /// Its cell, or [`AGAIN`] for a part of one.
    cell: u32,
    /// The sender that it has met, or [`ESCAPED`].
    met: u32,
    /// What is left of light that comes this way, times the part of a cell that it stands for.
    tint: Vec3,
    /// What the environment sends this way, likewise.
    beyond: Vec3,
}

/// What one probe has found.
#[derive(Default)]
struct Gathered {
    /// What each cell's ray has met plainly: a sender, or one of the constants above.
    cells: Vec<u32>,
    /// Senders that the rays of cells cut into 2², 3² … parts have met, each for a part of a cell.
    fine: [Vec<u32>; FINEST - 1],
    /// What rays by way of mirrors and glass have met.
    optics: Vec<ByOptics>,
    /// Cells that count: those above its horizon.
    counted: f32,
    escaped: Vec3,
    absorbed: Vec3,
    /// What the environment sends by way of mirrors and glass.
    beyond: Vec3,
}

impl<'a> Transport<'a> {
    /// Casts rays from each probe; few from those that no light reaches, as inside closed bodies. `shines` tells which senders
    /// send light before any comes from other surfaces.
    ///
    /// # Errors
    /// [`crate::error::Error::Interrupted`] when asked to stop.
    pub(crate) fn cast(
        around: Surroundings<'a>,
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
            let look = |&at: &u32| Gathered::new(&around, at, FIRST_SIDE, seed ^ 0xf125, progress);
            found = probes.at.par_iter().map(look).collect();
            progress.check()?;
            lit(&around, probes, &found, shines)
        } else {
            vec![true; count]
        };
        let most = rays.together as f64 / lit.iter().filter(|lit| **lit).count().max(1) as f64;
        let side = (rays.each as f64).min(most).sqrt().floor().max(4.0) as usize;
        let look = |(place, &lit): (usize, &bool)| {
            progress.advance(1);
            lit.then(|| Gathered::new(&around, probes.at[place], side, seed, progress))
        };
        let closer: Vec<Option<Gathered>> = lit.par_iter().enumerate().map(look).collect();
        progress.check()?;
        found.resize_with(count, Gathered::default);
        for (found, closer) in found.iter_mut().zip(closer) {
            if let Some(closer) = closer {
                *found = closer;
            } else {
                // What it sees sends nothing.
                (found.cells, found.optics) = (Vec::new(), Vec::new());
            }
        }
        Ok(Self { around, probes, side, seed, found })
    }

    /// Looks again at cells about which the senders' `radiance` jumps, where all such rays are at most `most`; whether there are
    /// any.
    ///
    /// # Errors
    /// [`crate::error::Error::Interrupted`] when asked to stop.
    pub(crate) fn refine(&mut self, radiance: &[Vec3], most: usize, progress: &Progress) -> Result<bool> {
        let brightness: Vec<f32> = radiance.par_iter().map(|radiance| radiance.element_sum()).collect();
        let side = self.side;
        let mut jump = JUMP;
        let chosen = loop {
            let look = |found: &Gathered| found.jumps(side, &brightness, jump);
            let chosen: Vec<Vec<(u32, usize)>> = self.found.par_iter().map(look).collect();
            let rays: usize = chosen.iter().flatten().map(|(_, parts)| parts * parts).sum();
            if rays <= most {
                break chosen;
            }
            progress.check()?;
            jump *= FEWER;
        };
        if chosen.iter().all(Vec::is_empty) {
            return Ok(false);
        }
        progress.start("gathering light of bright spots", self.found.len() as u64);
        let (around, probes, seed) = (self.around, self.probes, self.seed);
        self.found.par_iter_mut().zip(&chosen).enumerate().for_each(|(place, (found, chosen))| {
            progress.advance(1);
            if !chosen.is_empty() && !progress.stopped() {
                found.look_again(&around, probes.at[place], side, chosen, seed);
            }
        });
        progress.check()?;
        Ok(true)
    }

    /// Mean of the senders' radiance over each vertex' rays: its irradiance over π.
    pub(crate) fn gather(&self, radiance: &[Vec3], scale: f32) -> Vec<Vec3> {
        let one = |found: &Gathered| found.mean(radiance) * scale;
        self.probes.spread(&self.found.par_iter().map(one).collect::<Vec<_>>())
    }

    /// Rays that count.
    pub(crate) fn rays(&self) -> u64 {
        let rays = |found: &Gathered| found.counted as usize + found.fine.iter().map(Vec::len).sum::<usize>();
        self.found.iter().map(rays).sum::<usize>() as u64
    }

    /// Means over each vertex' rays of what the environment sends by way of mirrors and glass: irradiance over π.
    pub(crate) fn beyond(&self) -> Vec<Vec3> {
        self.spread(|found| found.beyond)
    }

    /// Parts of each vertex' light that escape, and that end on black or in optics.
    pub(crate) fn losses(&self) -> Vec<(Vec3, Vec3)> {
        let (escaped, absorbed) = (self.spread(|found| found.escaped), self.spread(|found| found.absorbed));
        // What a body buries sends its light into it.
        let all = |(vertex, loss): (&Vertex, (Vec3, Vec3))| if vertex.buried { (Vec3::ZERO, Vec3::ONE) } else { loss };
        self.around.mesh.vertices.iter().zip(escaped.into_iter().zip(absorbed)).map(all).collect()
    }

    fn spread(&self, of: fn(&Gathered) -> Vec3) -> Vec<Vec3> {
        self.probes.spread(&self.found.iter().map(|f| of(f) / f.counted.max(1.0)).collect::<Vec<_>>())
    }
}

impl Gathered {
    /// What a vertex finds by `side`² rays.
    fn new(around: &Surroundings, at: u32, side: usize, seed: u64, progress: &Progress) -> Self {
        let mut found = Self::default();
        if progress.stopped() {
            return found;
        }
        let vertex = &around.mesh.vertices[at as usize];
        let mut random = Random::new(seed, u64::from(at));
        let hemisphere = Hemisphere::new(vertex.normal, side, &mut random);
        let mut onward = Random::new(seed ^ 0x5bd1, u64::from(at));
        found.cells = (0..side * side)
            .map(|cell| {
                let direction = hemisphere.direction(cell, [random.uniform(), random.uniform()]);
                found.follow(around, vertex, direction, [cell as u32, 1], &mut onward)
            })
            .collect();
        found
    }

    /// Follows a ray for a cell, or for one of so many parts of one: adds what escapes, is absorbed, or comes by way of optics, and
    /// tells what it has met plainly.
    fn follow(
        &mut self,
        around: &Surroundings,
        vertex: &Vertex,
        direction: DVec3,
        [cell, parts]: [u32; 2],
        random: &mut Random,
    ) -> u32 {
        if direction.dot(vertex.facing()) <= 0.0 {
            return BELOW;
        }
        let part = 1.0 / parts as f32;
        self.counted += part;
        let origin = vertex.origin(around.optics.bvh.offset());
        let (reached, tint) = around.follow(Ray { origin, direction }, random);
        let (met, mut beyond) = match reached {
            RayEnd::Black => {
                self.absorbed += part;
                return ABSORBED;
            }
            RayEnd::Sender(sender) => (sender, Vec3::ZERO),
            RayEnd::Escaped { bent: false, .. } => (ESCAPED, Vec3::ZERO),
            RayEnd::Escaped { direction, bent: true } => {
                let environment = around.optics.scene().environment.as_ref();
                (ESCAPED, environment.map_or(Vec3::ZERO, |environment| environment.smooth(direction)))
            }
        };
        if met == ESCAPED {
            self.escaped += tint * part;
        }
        self.absorbed += (Vec3::ONE - tint) * part;
        let bent = matches!(reached, RayEnd::Escaped { bent: true, .. });
        if tint == Vec3::ONE && !bent {
            return met;
        }
        beyond *= tint * part;
        self.beyond += beyond;
        self.optics.push(ByOptics { cell: if parts > 1 { AGAIN } else { cell }, met, tint: tint * part, beyond });
        OPTICS
    }

    /// Takes back what the rays of these cells have found by way of optics.
    fn forget(&mut self, chosen: &[(u32, usize)]) {
        let Self { optics, escaped, absorbed, beyond, .. } = self;
        optics.retain(|end| {
            let again = chosen.binary_search_by_key(&end.cell, |(cell, _)| *cell).is_ok();
            if again {
                *absorbed -= Vec3::ONE - end.tint;
                *beyond -= end.beyond;
                if end.met == ESCAPED {
                    *escaped -= end.tint;
                }
            }
            !again
        });
    }

    /// Senders that are met plainly, one for each cell.
    fn plain(&self) -> impl Iterator<Item = u32> + '_ {
        self.cells.iter().copied().filter(|&cell| cell < SENDERS)
    }

    /// Mean over its rays of what senders of these radiances send.
    fn mean(&self, radiance: &[Vec3]) -> Vec3 {
        let plain: Vec3 = self.plain().map(|sender| radiance[sender as usize]).sum();
        let of_parts = |(fine, parts): (&Vec<u32>, usize)| {
            fine.iter().map(|&sender| radiance[sender as usize]).sum::<Vec3>() / (parts * parts) as f32
        };
        let fine: Vec3 = self.fine.iter().zip(2..).map(of_parts).sum();
        let of_optics = |end: &ByOptics| radiance.get(end.met as usize).map_or(Vec3::ZERO, |light| *light * end.tint);
        let tinted: Vec3 = self.optics.iter().map(of_optics).sum();
        (plain + fine + tinted) / self.counted.max(1.0)
    }

    /// Cells whose neighbours differ in brightness, and into how many parts a side of each is to be cut.
    fn jumps(&self, side: usize, brightness: &[f32], jump: f32) -> Vec<(u32, usize)> {
        if self.cells.len() != side * side {
            return Vec::new();
        }
        let of = |met: u32| brightness.get(met as usize).copied().unwrap_or(0.0);
        let mut lights: Vec<f32> = self.cells.iter().map(|&met| of(met)).collect();
        for end in self.optics.iter().filter(|end| end.cell < SENDERS) {
            lights[end.cell as usize] = of(end.met) * end.tint.element_sum() / 3.0;
        }
        let unit = jump * lights.iter().sum::<f32>() / self.counted.max(1.0);
        let parts = |cell: u32| {
            let (x, y) = (cell as usize % side, cell as usize / side);
            let (mut low, mut high) = (f32::INFINITY, 0.0f32);
            for row in y.saturating_sub(1)..=(y + 1).min(side - 1) {
                for column in x.saturating_sub(1)..=(x + 1).min(side - 1) {
                    let beside = row * side + column;
                    if (column, row) != (x, y) && self.cells[beside] != BELOW {
                        (low, high) = (low.min(lights[beside]), high.max(lights[beside]));
                    }
                }
            }
            let parts = ((high - low) / unit).sqrt().round();
            (parts >= 2.0).then_some((cell, (parts as usize).min(FINEST)))
        };
        (0..self.cells.len() as u32).filter_map(parts).collect()
    }

    /// Looks at these cells with more rays, in place of the one that it has cast there.
    fn look_again(&mut self, around: &Surroundings, at: u32, side: usize, chosen: &[(u32, usize)], seed: u64) {
        let vertex = &around.mesh.vertices[at as usize];
        // The same turn as that of the first rays.
        let hemisphere = Hemisphere::new(vertex.normal, side, &mut Random::new(seed, u64::from(at)));
        let mut random = Random::new(seed ^ 0xa6a1, u64::from(at));
        let mut onward = Random::new(seed ^ 0xa6a2, u64::from(at));
        self.forget(chosen);
        for &(cell, parts) in chosen {
            let ended = std::mem::replace(&mut self.cells[cell as usize], AGAIN);
            self.counted -= if ended == BELOW { 0.0 } else { 1.0 };
            match ended {
                ESCAPED => self.escaped -= Vec3::ONE,
                ABSORBED => self.absorbed -= Vec3::ONE,
                _ => {}
            }
            let all = (parts * parts) as u32;
            for i in 0..parts * parts {
                let place = [i % parts, i / parts].map(|k| (k as f64 + random.uniform()) / parts as f64);
                let direction = hemisphere.direction(cell as usize, place);
                let met = self.follow(around, vertex, direction, [cell, all], &mut onward);
                if met < SENDERS {
                    self.fine[parts - 2].push(met);
                }
            }
        }
    }
}

/// Which probes light reaches, by the few rays that all of them have cast: those that see something that shines, or that is lit by
/// what such a probe is lit by.
fn lit(around: &Surroundings, probes: &Probes, found: &[Gathered], shines: impl Fn(u32) -> bool + Sync) -> Vec<bool> {
    let sees = |found: &Gathered, of: &(dyn Fn(u32) -> bool + Sync)| {
        found.plain().chain(found.optics.iter().map(|end| end.met).filter(|met| *met < SENDERS)).any(of)
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
