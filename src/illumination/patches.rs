//! What patches of the mesh do to light, what they get of it first, and where it goes.

use super::IlluminationSettings;
use super::elements::{Elements, Sender, Senders};
use super::emitters::{Emitters, ShadowRays, VisibleEmitters};
use super::images::Images;
use super::lamp_image::Lamps;
use super::photons::Photon;
use super::pieces::{PIECES, Part};
use super::radiosity::{RayEnd, Surroundings};
use super::surface::Surface;
use super::transport::Transport;
use super::{Energy, sampling, sky};
use crate::error::Result;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::bvh::{Hit, Ray, SceneBvh};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Where a patch's places get less than this part of the light of its brightest one, an edge of a shadow is about: more are looked
/// at.
const EVEN: f32 = 0.7;
/// The same for places of neighbours: an edge may run between the places of two leaves.
const EVEN_ABOUT: f32 = 0.5;
/// Not at patches smaller than this part of the shortest edge that is split: those of a file's fine triangles, many of which
/// together have an even share of light and shadow.
const SMALL: f64 = 0.4;
/// Places along a side of a piece that the edge of a sun's light crosses.
const ALONG_EDGES: u8 = 8;
/// Fewest shadow rays of a place.
const LEAST_SHADOW_RAYS: u32 = 4;

/// Per sender: what it does to light and what it gets.
pub(crate) struct Patches {
    pub(crate) area: Vec<f32>,
    pub(crate) albedo: Vec<Vec3>,
    pub(crate) emission: Vec<Vec3>,
    /// Irradiance over π from lamps, straight or by way of optics.
    pub(crate) direct: Vec<Vec3>,
    /// What of that comes from punctual lights: it counts as emitted where it arrives.
    punctual: Vec<Vec3>,
}

/// What the solver found.
#[derive(Clone, Copy)]
pub(crate) struct Found<'a> {
    /// Radiance that leaves each sender.
    pub(crate) leaving: &'a [Vec3],
    /// Irradiance over π at the vertices, by way of other surfaces.
    pub(crate) irradiance: &'a [Vec3],
    /// The same of the environment.
    pub(crate) sky: &'a [Vec3],
}

/// What is found at a place: albedo, direct light, punctual light, emission, and the bright part of the environment.
type Place = [Vec3; 5];

/// What is found on a leaf, or on a corner's share of it.
enum Seen {
    /// Nothing: it lies inside a body.
    Buried,
    /// The same about everywhere: the mean, and the least and most direct light of its places.
    Even(Place, [f32; 2]),
    /// Light differs from piece to piece.
    Pieces(Box<[Place; PIECES]>),
}

impl Patches {
    /// Reads materials and samples direct light at a few places of each leaf; at many where they differ, and then the leaf
    /// sends its light from pieces. Also gives the senders.
    pub(crate) fn new(
        lamps: Lamps,
        images: &Images,
        mesh: &Elements,
        clear: &[VisibleEmitters],
        settings: &IlluminationSettings,
        progress: &Progress,
    ) -> Result<(Self, Senders)> {
        let Lamps { optics, emitters } = lamps;
        let bvh = &optics.bvh;
        let diagonal = bvh.scene().bounds().map_or(0.0, |(low, high)| (high - low).length());
        let smallest = SMALL * settings.shortest_element * diagonal;
        let leaves = mesh.senders();
        progress.start("direct light on patches", leaves.all.len() as u64);
        let look = |sender: Sender, barycentric: [f64; 2], share: usize, random: &mut Random| -> Place {
            // A share of the rays of a picture's point at each place: the mean over the patch is what counts.
            let rays = ShadowRays {
                // One ray tells whether it arrives, not how much of the lamp does.
                first: settings.shadow_rays.div_ceil(share as u32).max(LEAST_SHADOW_RAYS),
                penumbra: 0,
                clear: clear[sender.element as usize],
            };
            let element = &mesh.elements[sender.element as usize];
            let area = mesh.area(sender.element) * sender.part.share();
            let position = bvh.scene().triangles[element.triangle as usize].at(barycentric);
            let front = element.front;
            let hit = Hit { triangle: element.triangle, distance: 0.0, position, barycentric, front };
            let surface = Surface::at(bvh.scene(), &hit, (area / share as f64).sqrt());
            let at = surface.shading_point(bvh.offset());
            let (areas, points) = emitters.light(optics, at, rays, random);
            // Counted where it arrives, as that of punctual lights is.
            let sky = bvh
                .scene()
                .environment
                .as_ref()
                .map_or(Vec3::ZERO, |around| sky::bright(around, optics, at, rays, random) * emitters.scale());
            let (mirrored, of_points) = images.strong(lamps, at, rays, random);
            let points = points + of_points;
            let direct = areas + points + sky + mirrored;
            let own = emitters.polygon(element.triangle).is_none();
            [surface.albedo, direct, points, if own { surface.emission } else { Vec3::ZERO }, sky]
        };
        let few = |(number, &sender): (usize, &Sender)| {
            progress.advance(1);
            let element = &mesh.elements[sender.element as usize];
            let buried = |k: u8| mesh.vertices[element.corners[k as usize] as usize].buried;
            if matches!(sender.part, Part::Corner(k) if buried(k)) || progress.stopped() {
                return Seen::Buried;
            }
            let mut random = Random::new(settings.seed ^ 0x1ea, number as u64);
            let places = mesh.places(sender);
            let seen: Vec<Place> = places.iter().map(|&at| look(sender, at, places.len(), &mut random)).collect();
            // Soft light of an environment is none that has edges within a patch.
            let strengths = seen.iter().map(|place| (place[1] - place[4]).element_sum());
            let range = strengths.fold([f32::INFINITY, 0.0f32], |[low, high], s| [low.min(s), high.max(s)]);
            Seen::Even(mean(seen), range)
        };
        let mut seen: Vec<Seen> = leaves.all.par_iter().enumerate().map(few).collect();
        progress.check()?;
        // What the places of a leaf and of those about it find at each of its vertices.
        let mut about = vec![[f32::INFINITY, 0.0f32]; mesh.vertices.len()];
        for (leaf, seen) in leaves.all.iter().zip(&seen) {
            if let Seen::Even(_, [low, high]) = seen {
                for v in mesh.elements[leaf.element as usize].corners {
                    let [l, h] = &mut about[v as usize];
                    (*l, *h) = (l.min(*low), h.max(*high));
                }
            }
        }
        progress.start("shadows on patches", leaves.all.len() as u64);
        seen.par_iter_mut().zip(&leaves.all).enumerate().for_each(|(number, (seen, &leaf))| {
            progress.advance(1);
            let Seen::Even(_, [low, high]) = *seen else { return };
            let large = mesh.longest_edge(leaf.element as usize) > smallest;
            let vertices = mesh.elements[leaf.element as usize].corners.map(|v| about[v as usize]);
            let [least, most] = vertices.iter().fold([low, high], |[l, h], v| [l.min(v[0]), h.max(v[1])]);
            let even = low >= EVEN * high && least >= EVEN_ABOUT * most;
            if even || !large || leaf.part != Part::Whole || progress.stopped() {
                return;
            }
            let places = mesh.many_places(leaf.element);
            let mut random = Random::new(settings.seed ^ 0x1eb, number as u64);
            let mut pieces: [Vec<Place>; PIECES] = Default::default();
            for &(place, piece) in &places {
                pieces[usize::from(piece)].push(look(leaf, place, places.len(), &mut random));
            }
            // The edge of a sun's light is sharp: a few places of a piece do not tell how much of it is lit.
            for (piece, seen) in pieces.iter_mut().enumerate() {
                let lit = seen.iter().map(|place| place[2].element_sum());
                let [low, high] = lit.fold([f32::INFINITY, 0.0f32], |[l, h], s| [l.min(s), h.max(s)]);
                if low < EVEN_ABOUT * high {
                    let places = mesh.places_in(leaf.element, piece as u8, ALONG_EDGES);
                    *seen = places.iter().map(|&place| look(leaf, place, places.len(), &mut random)).collect();
                }
            }
            *seen = Seen::Pieces(Box::new(pieces.map(mean)));
        });
        progress.check()?;
        let senders = mesh.parted(&leaves, |number| matches!(seen[number], Seen::Pieces(_)));
        let mut found: Vec<Place> = Vec::with_capacity(senders.all.len());
        let mut area = Vec::with_capacity(senders.all.len());
        for (leaf, seen) in leaves.all.iter().zip(&seen) {
            let whole = mesh.area(leaf.element) as f32;
            match seen {
                Seen::Buried => {
                    found.push(Place::default());
                    area.push(0.0);
                }
                Seen::Even(place, _) => {
                    found.push(*place);
                    area.push(whole * leaf.part.share() as f32);
                }
                Seen::Pieces(pieces) => {
                    found.extend(pieces.iter());
                    area.extend([whole / PIECES as f32; PIECES]);
                }
            }
        }
        let column = |k: usize| found.iter().map(|f| f[k]).collect();
        let punctual = found.iter().map(|f| f[2] + f[4]).collect();
        let patches = Self { albedo: column(0), direct: column(1), punctual, emission: column(3), area };
        Ok((patches, senders))
    }

    /// Adds what is known at vertices: irradiance over π of surfaces' and of punctual lights' weak images.
    pub(crate) fn add(&mut self, mesh: &Elements, senders: &Senders, weak: &[(Vec3, Vec3)]) {
        let [areas, points]: [Vec<Vec3>; 2] = [weak.iter().map(|w| w.0).collect(), weak.iter().map(|w| w.1).collect()];
        for (s, &sender) in senders.all.iter().enumerate() {
            let of_points = mesh.mean_over(sender, &points);
            self.direct[s] += mesh.mean_over(sender, &areas) + of_points;
            self.punctual[s] += of_points;
        }
    }

    /// Adds the light of photons to what senders get directly.
    pub(crate) fn receive(&mut self, bvh: &SceneBvh, mesh: &Elements, senders: &Senders, photons: &[Photon]) {
        for photon in photons {
            let Some((element, weights)) = mesh.locate(photon.triangle, photon.front, photon.barycentric) else {
                continue;
            };
            if let Some(sender) = mesh.sender(bvh, senders, element, weights) {
                let sender = sender as usize;
                if self.area[sender] > 0.0 {
                    let light = photon.flux / (self.area[sender] * PI as f32);
                    self.direct[sender] += light;
                    self.punctual[sender] += if photon.is_of_point { light } else { Vec3::ZERO };
                }
            }
        }
    }

    /// Where the light went.
    pub(crate) fn energy(
        &self,
        around: &Surroundings,
        emitters: &Emitters,
        transport: &Transport,
        found: Found,
        seed: u64,
    ) -> Energy {
        let Found { leaving, irradiance, sky } = found;
        let mesh = around.mesh;
        let losses = transport.losses();
        let mut sums = [[0.0f64; 3]; 3];
        let mut add = |which: usize, flux: Vec3| {
            for (sum, part) in sums[which].iter_mut().zip(flux.to_array()) {
                *sum += f64::from(part);
            }
        };
        add(0, emitters.flux());
        for (s, &sender) in around.senders.all.iter().enumerate() {
            let flux = (f64::from(self.area[s]) * PI) as f32;
            let arriving = self.direct[s] + mesh.mean_over(sender, irradiance);
            add(0, (self.emission[s] + self.punctual[s] + mesh.mean_over(sender, sky)) * flux);
            add(1, (Vec3::ONE - self.albedo[s]) * arriving * flux);
            let corners = mesh.elements[sender.element as usize].corners;
            let losses = corners.iter().map(|&v| losses[v as usize]).zip(sender.part.weights());
            let (escaped, black) =
                losses.fold((Vec3::ZERO, Vec3::ZERO), |sum, (l, w)| (sum.0 + l.0 * w, sum.1 + l.1 * w));
            add(2, leaving[s] * flux * escaped);
            add(1, leaving[s] * flux * black);
        }
        let (escaped, black) = lost_from_emitters(around, emitters, seed);
        add(2, escaped);
        add(1, black);
        let colour = |s: [f64; 3]| Vec3::new(s[0] as f32, s[1] as f32, s[2] as f32);
        Energy { emitted: colour(sums[0]), absorbed: colour(sums[1]), escaped: colour(sums[2]) }
    }
}

fn mean(places: Vec<Place>) -> Place {
    let n = places.len().max(1) as f32;
    std::array::from_fn(|k| places.iter().map(|place| place[k]).sum::<Vec3>() / n)
}

/// Rays that find out what becomes of the light of emitters. Their places and directions fill space evenly: the parts found are
/// off by some 1e-4.
const RAYS_OF_EMITTERS: u32 = 1 << 16;

/// Flux of emitters that leaves the scene without a diffuse surface on its way, and what ends on black or in optics before it
/// comes to one [W].
fn lost_from_emitters(around: &Surroundings, emitters: &Emitters, seed: u64) -> (Vec3, Vec3) {
    let total = emitters.power;
    if total <= 0.0 {
        return (Vec3::ZERO, Vec3::ZERO);
    }
    let mut random = Random::new(seed ^ 0xe4e, 0);
    let shift: [f64; 4] = std::array::from_fn(|_| random.uniform());
    let scene = around.optics.scene();
    let one = |shot: u32| {
        let u = (f64::from(shot) + 0.5) / f64::from(RAYS_OF_EMITTERS);
        let emitter = &emitters.polygons[emitters.drawn(u)];
        let [s, t, a, b] = sampling::spread(shift, u64::from(shot));
        let point = emitter.point(s, t);
        let normal = if emitter.two_sided && shot % 2 == 1 { -emitter.normal } else { emitter.normal };
        let direction = sampling::lifted(normal, a, b);
        let ray = Ray { origin: point.position + normal * around.optics.bvh.offset(), direction };
        let mut random = Random::new(seed ^ 0xe4f, u64::from(shot));
        let (end, tint) = around.follow(ray, &mut random);
        // Polygons are drawn by their mean radiance.
        let share = total / (emitter.power() * f64::from(RAYS_OF_EMITTERS));
        let local = emitter.radiance(scene, point) * (emitter.area_of_sides() * PI * share) as f32;
        match end {
            RayEnd::Escaped { .. } => (local * tint, local * (Vec3::ONE - tint)),
            RayEnd::Black => (Vec3::ZERO, local),
            // What optics took on the way to a surface.
            RayEnd::Sender(_) => (Vec3::ZERO, local * (Vec3::ONE - tint)),
        }
    };
    let found: Vec<(Vec3, Vec3)> = (0..RAYS_OF_EMITTERS).into_par_iter().map(one).collect();
    let sum = |part: fn(&(Vec3, Vec3)) -> Vec3| found.iter().map(|f| part(f).as_dvec3()).sum::<DVec3>().as_vec3();
    (sum(|f| f.0), sum(|f| f.1))
}
