//! The irradiance that photons make: each is spread over a disk whose size follows their density.
//!
//! A photon's radius is the size of the smallest cell of a hierarchy of grids that holds enough photons of its surface;
//! its kernel is 3/(πR²)(1 − r²/R²)² on its tangent plane, divided by the part of it that lies on the surface, so the
//! flux is kept at walls and edges. Photons of one radius that lie within a quarter of it are put together, so a look-up
//! costs some hundred terms however many photons there are.

use super::photons::Photon;
use super::sampling::{GOLDEN, tangents};
use crate::scene::bvh::{Ray, SceneBvh, Sides};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// Photons that a cell must hold to be taken for a radius: with π cells in a disk some 3 % noise if they were random,
/// and well below with their even spread.
const ENOUGH: usize = 400;
/// Side of the coarsest cell over the diagonal of what the photons cover.
const COARSEST: f64 = 1.0 / 16.0;
/// Halvings of it.
const LEVELS: usize = 8;
/// Points of a disk that are tried for its part on the surface.
const PROBES: usize = 16;
/// How far off its tangent plane a disk still lights, over its radius.
const THICKNESS: f64 = 0.25;
/// Least cosine between a photon's surface and one that it lights.
const ALIKE: f32 = 0.7;

#[derive(Clone, Copy, Debug)]
struct Spot {
    position: DVec3,
    facing: Vec3,
    flux: Vec3,
}

/// Spots of one radius in cells twice as large.
#[derive(Clone, Debug)]
struct Level {
    radius: f64,
    low: DVec3,
    high: DVec3,
    spots: Vec<Spot>,
    cells: HashMap<[i32; 3], (u32, u32)>,
}

/// Irradiance by photons, to be looked up anywhere.
#[derive(Clone, Debug, Default)]
pub(crate) struct Caustics {
    levels: Vec<Level>,
}

fn cell(position: DVec3, size: f64) -> [i32; 3] {
    (position / size).floor().to_array().map(|c| c as i32)
}

/// Which of six directions a surface looks in, so that the sides of a wall and the walls of a corner stay apart.
fn direction(facing: Vec3) -> u8 {
    let a = facing.abs();
    let axis = if a.x >= a.y && a.x >= a.z {
        0
    } else if a.y >= a.z {
        1
    } else {
        2
    };
    2 * axis + u8::from(facing[axis as usize] < 0.0)
}

impl Caustics {
    /// Puts photons together.
    pub(crate) fn new(bvh: &SceneBvh, photons: &[Photon]) -> Self {
        let Some(first) = photons.first() else { return Self::default() };
        let start = (first.position, first.position);
        let (low, high) = photons.iter().fold(start, |(l, h), p| (l.min(p.position), h.max(p.position)));
        let coarsest = COARSEST * (high - low).length();
        if coarsest <= 0.0 {
            return Self::default();
        }
        let mut level_of = vec![0u8; photons.len()];
        for level in 1..=LEVELS {
            let size = coarsest * 0.5f64.powi(level as i32);
            let mut counts: HashMap<([i32; 3], u8), usize> = HashMap::new();
            let keys: Vec<_> =
                photons.par_iter().map(|p| (cell(p.position - low, size), direction(p.facing))).collect();
            // Only cells whose coarser one was full can be full.
            for (key, _) in keys.iter().zip(&level_of).filter(|(_, l)| **l as usize == level - 1) {
                *counts.entry(*key).or_default() += 1;
            }
            if !counts.values().any(|&c| c >= ENOUGH) {
                break;
            }
            for (own, key) in level_of.iter_mut().zip(&keys).filter(|(l, _)| **l as usize == level - 1) {
                if counts[key] >= ENOUGH {
                    *own = level as u8;
                }
            }
        }
        let levels = (0..=LEVELS)
            .filter_map(|level| {
                let own = photons.iter().zip(&level_of).filter(|(_, l)| **l as usize == level).map(|(p, _)| p);
                Level::new(bvh, coarsest * 0.5f64.powi(level as i32), own)
            })
            .collect();
        Self { levels }
    }

    /// Irradiance over π at a point of a surface with the given unit geometric normal.
    pub(crate) fn light(&self, position: DVec3, facing: DVec3) -> Vec3 {
        self.levels.iter().map(|level| level.light(position, facing)).sum::<Vec3>() * (1.0 / PI) as f32
    }
}

impl Level {
    fn new<'p>(bvh: &SceneBvh, radius: f64, photons: impl Iterator<Item = &'p Photon>) -> Option<Self> {
        let mut sums: HashMap<([i32; 3], u8), usize> = HashMap::new();
        let mut spots: Vec<(Spot, f64)> = Vec::new();
        for photon in photons {
            let key = (cell(photon.position, radius / 4.0), direction(photon.facing));
            let weight = f64::from(photon.flux.element_sum());
            let next = spots.len();
            let own = *sums.entry(key).or_insert(next);
            if own == next {
                spots.push((Spot { position: DVec3::ZERO, facing: Vec3::ZERO, flux: Vec3::ZERO }, 0.0));
            }
            let (spot, total) = &mut spots[own];
            spot.position += photon.position * weight;
            spot.facing += photon.facing * weight as f32;
            spot.flux += photon.flux;
            *total += weight;
        }
        if spots.is_empty() {
            return None;
        }
        let mut spots: Vec<Spot> = spots
            .into_par_iter()
            .filter(|(_, total)| *total > 0.0)
            .map(|(spot, total)| {
                let facing = spot.facing.normalize_or_zero();
                let spot = Spot { position: spot.position / total, facing, ..spot };
                Spot { flux: spot.flux / spot.part_on_surface(bvh, radius) as f32, ..spot }
            })
            .collect();
        let size = 2.0 * radius;
        let reach = DVec3::splat(radius);
        let low = spots.iter().fold(DVec3::INFINITY, |l, s| l.min(s.position)) - reach;
        let high = spots.iter().fold(DVec3::NEG_INFINITY, |h, s| h.max(s.position)) + reach;
        spots.sort_by_cached_key(|s| (cell(s.position, size), s.position.to_array().map(f64::to_bits)));
        let mut cells: HashMap<[i32; 3], (u32, u32)> = HashMap::new();
        for (i, spot) in spots.iter().enumerate() {
            let range = cells.entry(cell(spot.position, size)).or_insert((i as u32, i as u32));
            range.1 = i as u32 + 1;
        }
        Some(Self { radius, low, high, spots, cells })
    }

    fn light(&self, position: DVec3, facing: DVec3) -> Vec3 {
        if position.cmplt(self.low).any() || position.cmpgt(self.high).any() {
            return Vec3::ZERO;
        }
        let reach = DVec3::splat(self.radius);
        let (from, to) = (cell(position - reach, 2.0 * self.radius), cell(position + reach, 2.0 * self.radius));
        let (squared, near, narrow) = (self.radius * self.radius, THICKNESS * self.radius, facing.as_vec3());
        let mut sum = Vec3::ZERO;
        for x in from[0]..=to[0] {
            for y in from[1]..=to[1] {
                for z in from[2]..=to[2] {
                    let Some(&(begin, end)) = self.cells.get(&[x, y, z]) else { continue };
                    for spot in &self.spots[begin as usize..end as usize] {
                        let span = spot.position - position;
                        let height = span.dot(facing);
                        let t = (span.length_squared() - height * height) / squared;
                        if t < 1.0 && height.abs() <= near && narrow.dot(spot.facing) >= ALIKE {
                            sum += spot.flux * ((1.0 - t) * (1.0 - t)) as f32;
                        }
                    }
                }
            }
        }
        sum * (3.0 / (PI * squared)) as f32
    }
}

impl Spot {
    /// Part of the kernel that lies on the surface: a wall, an edge or another body may cut it.
    fn part_on_surface(&self, bvh: &SceneBvh, radius: f64) -> f64 {
        let facing = self.facing.as_dvec3();
        let (x, y) = tangents(facing);
        let lift = facing * (THICKNESS * radius).max(2.0 * bvh.offset());
        let above = self.position + lift;
        let found = (0..PROBES)
            .filter(|&i| {
                // Equal shares of the kernel: 1 − (1 − t)³ is its flux within r² = tR².
                let share = (i as f64 + 0.5) / PROBES as f64;
                let r = radius * (1.0 - (1.0 - share).cbrt()).sqrt();
                let (sin, cos) = (TAU * (i as f64 * GOLDEN).fract()).sin_cos();
                let start = above + x * (r * cos) + y * (r * sin);
                if bvh.occluded(above, start) {
                    return false;
                }
                let down = Ray { origin: start, direction: -facing };
                bvh.meet(&down, 0.0, 2.0 * lift.length(), Sides::Both).is_some_and(|m| {
                    let normal = bvh.scene().triangles[m.triangle as usize].normal();
                    let side = if m.front { normal } else { -normal };
                    side.dot(facing) >= f64::from(ALIKE)
                })
            })
            .count();
        found.max(1) as f64 / PROBES as f64
    }
}
