//! What one ray of an eye sees: one end per way that light takes through mirrors and glass.
//!
//! At a mirror or a pane of glass a ray goes on, at glass in two ways; each way ends where something scatters or emits.
//! A rough surface sends several rays into its lobe, which together are one end. Ways that have become weak are followed
//! by chance, their weight raised in turn, so that the sum stays right.

use super::settings::{MirrorDepth, TraceSettings};
use super::wavefront::{Wavefront, normal_change};
use crate::illumination::paths::{Ways, inside};
use crate::illumination::{DiffuseLight, Illumination, LobeRay, Surface};
use crate::random::Random;
use crate::scene::bvh::{Ray, SceneBvh, Sides};
use crate::scene::{Camera, Projection};
use glam::{DVec3, Vec3};

/// Ways that bring less than this part of a white surface's light are followed by chance.
const FAINT: f32 = 0.01;
/// Ways followed at once; further ones are chosen from by chance.
const MOST_WAYS: usize = 48;
/// An image nearer than this part of the way to the first mirror or glass is put at that distance,
const NEAREST: f64 = 0.25;
/// and one farther than this many times the whole way, or behind the eye, at that: a few rays that pass a focus of
/// curved glass must not stretch the depth of the whole picture.
const FARTHEST: f64 = 4.0;
/// How far away the environment is, over the size of the scene.
const BEYOND: f64 = 1e4;

/// Light by one way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathEnd {
    pub(crate) radiance: Vec3,
    /// Where it seems to be, along the eye's ray [m].
    pub(crate) depth: f64,
    /// Mirrors and glass surfaces passed.
    pub(crate) bounces: u8,
    /// Which ends belong together: lobe rays of one rough surface share a number.
    group: u16,
}

/// All that one ray sees.
#[derive(Clone, Debug)]
pub(crate) struct RaySample {
    /// Sum of all ends.
    pub(crate) radiance: Vec3,
    /// The strongest end's depth [m]; zero for a miss.
    pub(crate) depth: f64,
    /// The strongest end's mirrors.
    pub(crate) bounces: u8,
    /// First surface: triangle, and its unit normal; tells edges.
    pub(crate) first: u32,
    pub(crate) normal: DVec3,
    /// Ends, strongest first.
    pub(crate) ends: Vec<PathEnd>,
}

impl RaySample {
    /// A ray that meets nothing.
    pub(crate) fn nothing() -> Self {
        Self { radiance: Vec3::ZERO, depth: 0.0, bounces: 0, first: u32::MAX, normal: DVec3::ZERO, ends: Vec::new() }
    }

    fn clear(&mut self) {
        let mut ends = std::mem::take(&mut self.ends);
        ends.clear();
        *self = Self { ends, ..Self::nothing() };
    }

    /// Puts the ends that belong together into one each, and takes depth and mirrors of the strongest.
    pub(crate) fn gather(&mut self) {
        self.ends = gathered(std::mem::take(&mut self.ends));
        if let Some(strongest) = self.ends.first() {
            self.depth = strongest.depth;
            self.bounces = strongest.bounces;
        }
    }
}

impl Default for RaySample {
    fn default() -> Self {
        Self::nothing()
    }
}

/// A camera's eye before a lit scene.
pub(crate) struct Eye<'a> {
    camera: &'a Camera,
    settings: &'a TraceSettings,
    aspect: f64,
    looks: Looks<'a, Illumination>,
}

/// How the rays of an eye are followed, whoever sends them.
pub(crate) struct Looks<'a, L> {
    /// What shines on the surfaces.
    pub(crate) light: &'a L,
    /// The surfaces.
    pub(crate) bvh: &'a SceneBvh,
    /// How wide a pixel is.
    pub(crate) footprint: Footprint,
    /// Most mirrors or glass surfaces on one ray.
    pub(crate) bounces: u32,
    /// Where points stand that are seen by way of optics.
    pub(crate) mirror_depth: MirrorDepth,
    /// Rays into the lobe of a rough surface that reflects everything: few where many looks are averaged.
    pub(crate) lobe_rays: f32,
}

/// Width of a pixel along its ray: `start` + `growth` · distance [m].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    pub(crate) start: f64,
    pub(crate) growth: f64,
}

impl Footprint {
    fn at(self, distance: f64) -> f64 {
        self.start + self.growth * distance
    }
}

/// What a look has found, and the ways that are still open: kept from look to look to spare their memory.
#[derive(Default)]
pub(crate) struct Found {
    pub(crate) seen: RaySample,
    open: Vec<Branch>,
}

/// A ray on its way.
struct Branch {
    ray: Ray,
    weight: Vec3,
    path: f64,
    /// Way to the first surface [m].
    first: f64,
    bounces: u32,
    /// Geometric normal of the surface that it leaves.
    leaving: Option<DVec3>,
    /// Followed where it tells the depth.
    wave: Option<Wavefront>,
    group: Option<u16>,
    /// Over how many looks like this the mean is taken.
    share: u32,
    /// Whether it was reflected or refracted.
    bent: bool,
    /// The last surface that did so was rough: suns have been seen there as glints, lamps in part.
    lobe: Option<LobeRay>,
}

impl<'a> Eye<'a> {
    /// An eye that sees a lit scene through a camera.
    pub(crate) fn new(light: &'a Illumination, camera: &'a Camera, settings: &'a TraceSettings) -> Self {
        let aspect = f64::from(settings.width) / f64::from(settings.height);
        let (_, half_height) = camera.half_size(aspect);
        let pixel = 2.0 * half_height / f64::from(settings.height);
        let footprint = match camera.projection {
            Projection::Perspective { .. } => Footprint { start: 0.0, growth: pixel },
            Projection::Orthographic { .. } => Footprint { start: pixel, growth: 0.0 },
        };
        let (bounces, mirror_depth) = (settings.bounces, settings.mirror_depth);
        let looks =
            Looks { light, bvh: light.bvh(), footprint, bounces, mirror_depth, lobe_rays: settings.lobe_rays as f32 };
        Self { camera, settings, aspect, looks }
    }

    /// The ray through a place of the picture, in pixels.
    pub(crate) fn ray(&self, column: f64, row: f64) -> Ray {
        let (u, v) = (column / f64::from(self.settings.width), row / f64::from(self.settings.height));
        self.camera.ray(u, v, self.aspect)
    }

    /// The same looks at other light on the same surfaces.
    pub(crate) fn looks_at<'b, L>(&'b self, light: &'b L) -> Looks<'b, L> {
        let Looks { bvh, footprint, bounces, mirror_depth, lobe_rays, .. } = self.looks;
        Looks { light, bvh, footprint, bounces, mirror_depth, lobe_rays }
    }

    /// Follows the ray through a place of the picture.
    ///
    /// `share` is the number of looks whose mean is taken.
    pub(crate) fn look(&self, column: f64, row: f64, share: u32, random: &mut Random) -> RaySample {
        let mut found = Found::default();
        self.looks.follow(self.ray(column, row), share, &mut found, random);
        found.seen.gather();
        found.seen
    }
}

impl<L: DiffuseLight> Looks<'_, L> {
    /// Follows a ray by all its ways; what it sees is in `found`, its ends as they come ([`RaySample::gather`]).
    ///
    /// `share` is the number of looks whose mean is taken.
    pub(crate) fn follow(&self, ray: Ray, share: u32, found: &mut Found, random: &mut Random) {
        let Found { seen, open } = found;
        seen.clear();
        let mut groups = 0u16;
        open.push(Branch {
            ray,
            weight: Vec3::ONE,
            path: 0.0,
            first: 0.0,
            bounces: 0,
            leaving: None,
            wave: (self.mirror_depth == MirrorDepth::Focus).then(|| Wavefront::new(ray.direction)),
            group: None,
            share,
            bent: false,
            lobe: None,
        });
        while let Some(branch) = open.pop() {
            self.step(branch, seen, open, &mut groups, random);
        }
    }

    /// Takes a branch to its next surface.
    fn step(
        &self,
        mut branch: Branch,
        seen: &mut RaySample,
        open: &mut Vec<Branch>,
        groups: &mut u16,
        random: &mut Random,
    ) {
        let bvh = self.bvh;
        let ray = branch.ray;
        let hit = match branch.leaving {
            None => bvh.nearest(&ray, 0.0, Sides::Front),
            Some(normal) => bvh.nearest_leaving(&ray, normal, Sides::Front),
        };
        let Some(hit) = hit else {
            self.leave(branch, seen, groups);
            return;
        };
        branch.path += hit.distance;
        if branch.bounces == 0 {
            branch.first = branch.path;
        }
        let footprint = self.footprint.at(branch.path);
        let surface = Surface::at(bvh.scene(), &hit, footprint);
        if branch.bounces == 0 && branch.leaving.is_none() {
            seen.first = hit.triangle;
            seen.normal = surface.normal;
        }
        if let Some(wave) = &mut branch.wave {
            wave.advance(ray.direction, hit.distance, surface.normal);
        }
        branch.weight *= inside(bvh.scene().material(hit.triangle), &hit, hit.distance);
        let own = |weight: Vec3, ray: Ray| Branch { ray, weight, leaving: Some(surface.facing), ..branch };
        if surface.coverage < 1.0 {
            let past = Ray { origin: surface.position, direction: ray.direction };
            let weight = branch.weight * (1.0 - surface.coverage);
            push(open, own(weight, past), random);
            branch.weight *= surface.coverage;
        }
        let glossy = surface.is_glossy();
        let lobe = if glossy { self.rays_into_lobe(&branch, &surface) } else { 1 };
        let glints = if glossy { self.light.glints(&surface, ray.direction, lobe, random) } else { Vec3::ZERO };
        if surface.is_diffuse() || (surface.emission + glints).max_element() > 0.0 {
            let shown = self.light.shown(&hit, &surface, footprint, branch.share, random);
            let left = branch.lobe.map_or(1.0, |lobe| self.light.part_of_lobe(&hit, &lobe));
            let radiance = branch.weight * (shown - surface.emission * (1.0 - left) + glints);
            let group = branch.group.unwrap_or_else(|| next(groups));
            let depth = self.depth(&branch);
            seen.radiance += radiance;
            seen.ends.push(PathEnd { radiance, depth, bounces: branch.bounces.min(255) as u8, group });
        }
        let bends = surface.is_specular() || surface.transmission.max_element() > 0.0;
        if surface.unlit || !bends || branch.bounces >= self.bounces {
            return;
        }
        let groups: [Option<u16>; 2] = match (branch.group, surface.is_sharp()) {
            (None, false) => [Some(next(groups)), Some(next(groups))],
            (group, _) => [group; 2],
        };
        let change = normal_change(bvh.scene(), &hit);
        for _ in 0..lobe {
            let ways = Ways::new(&surface, ray.direction, random);
            let onward = |part: Vec3, direction: DVec3, group: Option<u16>| Branch {
                bounces: branch.bounces + 1,
                share: branch.share * lobe,
                group,
                bent: true,
                lobe: glossy.then(|| LobeRay::new(&surface, -ray.direction, direction, lobe)),
                ..own(branch.weight / lobe as f32 * part, Ray { origin: surface.position, direction })
            };
            let mut mirrored = onward(ways.reflectance, ways.mirrored, groups[0]);
            if let Some(wave) = &mut mirrored.wave {
                wave.reflect(ray.direction, ways.half, &change);
            }
            push(open, mirrored, random);
            let mut through = onward(ways.transmittance, ways.through, groups[1]);
            // What comes through a rough surface is looked for by rays alone.
            (through.bent, through.lobe) = if surface.volume { (true, None) } else { (branch.bent, branch.lobe) };
            if let Some(wave) = through.wave.as_mut().filter(|_| surface.volume) {
                wave.refract(ray.direction, ways.half, ways.ratio, &change);
            }
            push(open, through, random);
        }
    }

    /// How many rays a glossy surface sends into its lobe.
    fn rays_into_lobe(&self, branch: &Branch, surface: &Surface) -> u32 {
        if branch.group.is_some() {
            return 1;
        }
        // What the drawn ways bring must not decide how many are drawn: their mean would not be the lobe's.
        let cosine = branch.ray.direction.dot(surface.normal).abs();
        let strength = (surface.reflectance(cosine) + surface.transmission).max_element().min(1.0);
        (self.lobe_rays * strength * branch.weight.max_element().min(1.0)).ceil().clamp(1.0, self.lobe_rays) as u32
    }

    /// Shows what lies beyond the scene to a branch that leaves it by way of mirrors or glass. Straight ahead it is dark: a
    /// hologram has no place for what is infinitely far away.
    fn leave(&self, mut branch: Branch, seen: &mut RaySample, groups: &mut u16) {
        let Some(around) = self.bvh.scene().environment.as_ref().filter(|_| branch.bent) else { return };
        let direction = branch.ray.direction;
        let radiance = branch.weight * self.light.beyond(around, direction, branch.lobe.is_some());
        let group = branch.group.unwrap_or_else(|| next(groups));
        // Its image in a curved mirror or in glass is near; that in a flat one is put as far away as the scene is large.
        let size = self.bvh.size();
        branch.path += size;
        if let Some(wave) = &mut branch.wave {
            wave.advance(direction, BEYOND * size, -direction);
        }
        let depth = self.depth(&branch).min(branch.path);
        seen.radiance += radiance;
        seen.ends.push(PathEnd { radiance, depth, bounces: branch.bounces.min(255) as u8, group });
    }

    /// Where along the eye's ray light of a finished branch seems to come from [m].
    fn depth(&self, branch: &Branch) -> f64 {
        let Some(wave) = branch.wave.as_ref().filter(|_| branch.bounces > 0) else { return branch.path };
        let vergence = wave.vergence(branch.ray.direction);
        let (nearest, farthest) = (NEAREST * branch.first, FARTHEST * branch.path);
        if vergence.is_nan() { branch.path } else { 1.0 / vergence.clamp(1.0 / farthest, 1.0 / nearest) }
    }
}

fn next(groups: &mut u16) -> u16 {
    *groups = groups.wrapping_add(1);
    *groups
}

/// Opens a way if it is strong enough, by chance if it is faint.
fn push(open: &mut Vec<Branch>, mut branch: Branch, random: &mut Random) {
    let strength = branch.weight.max_element();
    let faint = if open.len() >= MOST_WAYS { 1.0 } else { FAINT };
    if strength < faint {
        if random.uniform_f32() * faint >= strength {
            return;
        }
        branch.weight *= faint / strength;
    }
    open.push(branch);
}

/// Puts ends of one group together, at the mean of their vergence weighted by light; strongest first.
fn gathered(ends: Vec<PathEnd>) -> Vec<PathEnd> {
    let mut sums: Vec<(PathEnd, f64, f64)> = Vec::with_capacity(ends.len());
    for end in ends {
        let light = f64::from(end.radiance.element_sum());
        match sums.iter_mut().find(|(sum, _, _)| sum.group == end.group) {
            Some((sum, total, vergence)) => {
                sum.radiance += end.radiance;
                sum.bounces = sum.bounces.max(end.bounces);
                *total += light;
                *vergence += light / end.depth;
            }
            None => sums.push((end, light, light / end.depth)),
        }
    }
    sums.sort_by(|a, b| b.1.total_cmp(&a.1));
    sums.retain(|(_, light, _)| *light > 0.0);
    sums.into_iter().map(|(end, light, vergence)| PathEnd { depth: light / vergence, ..end }).collect()
}
