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
use super::gathered::{Gathered, SENDERS};
use super::probes::Probes;
use super::radiosity::Surroundings;
use crate::error::Result;
use crate::progress::Progress;
use glam::Vec3;
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
/// square number of them up to [`FINEST`]²: the noise of a cell is in proportion to its jump, and so should its rays be.
const JUMP: f32 = 1.0;
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
    /// Jump of brightness from which cells were looked at again.
    jump: f32,
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
        Ok(Self { around, probes, side, seed, found, jump: f32::INFINITY })
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
        self.jump = jump;
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

    /// What the probes find of senders of these radiances, and how they have looked for it: side of their cells, jump.
    pub(crate) fn into_found(self, radiance: &[Vec3], scale: f32) -> (Vec<Vec3>, usize, f32) {
        let found = self.found.par_iter().map(|found| found.mean(radiance) * scale).collect();
        (found, self.side, self.jump)
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
