//! What one probe finds: what the rays of its hemisphere's cells have met.

use super::elements::Vertex;
use super::radiosity::{RayEnd, Surroundings};
use super::sampling::Hemisphere;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::bvh::Ray;
use glam::{DVec3, Vec3};

/// Most parts along each side of a cell that is looked at again.
pub(super) const FINEST: usize = 5;

/// What ends the ray of a cell where that is no sender, or is one by way of mirrors and glass.
const BELOW: u32 = u32::MAX;
const ESCAPED: u32 = u32::MAX - 1;
const ABSORBED: u32 = u32::MAX - 2;
const OPTICS: u32 = u32::MAX - 3;
/// A cell that has been looked at with more rays.
const AGAIN: u32 = u32::MAX - 4;
pub(super) const SENDERS: u32 = AGAIN;

/// The end of a ray by way of mirrors and glass.
#[derive(Clone, Copy)]
pub(super) struct ByOptics {
    /// Its cell, or [`AGAIN`] for a part of one.
    cell: u32,
    /// The sender that it has met, or [`ESCAPED`].
    pub(super) met: u32,
    /// What is left of light that comes this way, times the part of a cell that it stands for.
    tint: Vec3,
    /// What the environment sends this way, likewise.
    beyond: Vec3,
}

/// What one probe has found.
#[derive(Default)]
pub(super) struct Gathered {
    /// What each cell's ray has met plainly: a sender, or one of the constants above.
    pub(super) cells: Vec<u32>,
    /// Senders that the rays of cells cut into 2², 3² … parts have met, each for a part of a cell.
    pub(super) fine: [Vec<u32>; FINEST - 1],
    /// What rays by way of mirrors and glass have met.
    pub(super) optics: Vec<ByOptics>,
    /// Cells that count: those above its horizon.
    pub(super) counted: f32,
    pub(super) escaped: Vec3,
    pub(super) absorbed: Vec3,
    /// What the environment sends by way of mirrors and glass.
    pub(super) beyond: Vec3,
}

impl Gathered {
    /// What a vertex finds by `side`² rays.
    pub(super) fn new(around: &Surroundings, at: u32, side: usize, seed: u64, progress: &Progress) -> Self {
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
    pub(super) fn plain(&self) -> impl Iterator<Item = u32> + '_ {
        self.cells.iter().copied().filter(|&cell| cell < SENDERS)
    }

    /// Mean over its rays of what senders of these radiances send.
    pub(super) fn mean(&self, radiance: &[Vec3]) -> Vec3 {
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
    pub(super) fn jumps(&self, side: usize, brightness: &[f32], jump: f32) -> Vec<(u32, usize)> {
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
    pub(super) fn look_again(
        &mut self,
        around: &Surroundings,
        at: u32,
        side: usize,
        chosen: &[(u32, usize)],
        seed: u64,
    ) {
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
