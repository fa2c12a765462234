//! Light that reaches a surface by way of flat mirrors.
//!
//! Behind a flat mirror stands an image of the lamp; behind two that face each other stands a row of them. A path
//! point → mirrors → lamp is unfolded into a straight line through the mirrors' outlines, so that what a point sees of
//! an image is the image's polygon clipped by the pyramids of these outlines: its form factor is exact, and rays decide
//! only what stands in the way. Curved mirrors, glass and rough metal are left to photons (`photons`).

use super::emitters::ShadowRays;
use super::lamp_image::{Image, Lamps, plain_lamps};
use super::surface::ShadingPoint;
use crate::random::Random;
use glam::Vec3;

/// Images that are tried at most.
const MOST_CANDIDATES: usize = 1024;
/// An image that adds less than this to the light anywhere is left out: below the noise of a penumbra.
const LEAST_SHARE: f64 = 3e-4;
/// One that adds less than this everywhere is computed at the vertices of the mesh, not at each point.
const STRONG_SHARE: f64 = 0.03;

/// All images of all lamps.
#[derive(Clone, Debug, Default)]
pub(crate) struct Images {
    strong: Vec<Image>,
    weak: Vec<Image>,
}

impl Images {
    /// How many mirrors may have images of their own, so that not too many are tried.
    pub(crate) fn most_mirrors(lamps: usize) -> usize {
        (MOST_CANDIDATES / lamps.max(1)).min(32)
    }

    /// Finds the images and sorts them by what they add at some places.
    pub(crate) fn new(lamps: Lamps, places: &[ShadingPoint]) -> Self {
        let mirrors = &lamps.optics.mirrors;
        if mirrors.sides.is_empty() {
            return Self::default();
        }
        let mut all = plain_lamps(lamps);
        let (direct, mut at) = (all.len(), 0);
        while at < all.len() && all.len() < MOST_CANDIDATES {
            if all[at].windows.len() < lamps.optics.bounces as usize {
                let next: Vec<Image> = mirrors.sides.iter().filter_map(|m| all[at].seen_in(m, lamps)).collect();
                all.extend(next);
            }
            at += 1;
        }
        let (mut greatest, mut shares) = (vec![0.0f64; all.len()], vec![0.0f64; all.len()]);
        for &place in places {
            for (share, image) in shares.iter_mut().zip(&all) {
                *share = image.unhindered(lamps, place);
            }
            let total: f64 = shares.iter().sum();
            if total > 0.0 {
                greatest.iter_mut().zip(&shares).for_each(|(g, s)| *g = g.max(s / total));
            }
        }
        let mut images = Self::default();
        for (image, share) in all.into_iter().zip(greatest).skip(direct) {
            if share >= STRONG_SHARE {
                images.strong.push(image);
            } else if share >= LEAST_SHARE {
                images.weak.push(image);
            }
        }
        images
    }

    /// Number of images.
    pub(crate) fn len(&self) -> usize {
        self.strong.len() + self.weak.len()
    }

    /// Irradiance over π from images that make shadows of their own, at a point: of emitting surfaces, and of punctual lights.
    pub(crate) fn strong(&self, lamps: Lamps, at: ShadingPoint, rays: ShadowRays, random: &mut Random) -> (Vec3, Vec3) {
        light_of(&self.strong, lamps, at, rays, random)
    }

    /// The same from all others.
    pub(crate) fn weak(&self, lamps: Lamps, at: ShadingPoint, random: &mut Random) -> (Vec3, Vec3) {
        light_of(&self.weak, lamps, at, ShadowRays { first: 4, penumbra: 0, clear: 0 }, random)
    }
}

fn light_of(images: &[Image], lamps: Lamps, at: ShadingPoint, rays: ShadowRays, random: &mut Random) -> (Vec3, Vec3) {
    images.iter().fold((Vec3::ZERO, Vec3::ZERO), |(areas, points), image| {
        let light = image.light(lamps, at, rays, random);
        if image.is_of_point() { (areas, points + light) } else { (areas + light, points) }
    })
}
