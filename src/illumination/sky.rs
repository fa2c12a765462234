//! Light of a scene's environment on its surfaces.
//!
//! What comes straight from the plain part of the environment is sampled at the vertices of the mesh by its brightness, with
//! a shadow ray for each sample; what is brighter is sampled at each point that is asked for, and its suns are lamps like others.
//! What comes by way of mirrors and glass is found by the rays that gather light from other surfaces.

use super::elements::Elements;
use super::emitters::ShadowRays;
use super::paths::Optics;
use super::sampling::hemisphere;
use super::surface::ShadingPoint;
use crate::error::Result;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::Environment;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::FRAC_1_PI;

/// Shadow rays of a vertex, at most and at least, and of all vertices together.
const MOST: usize = 512;
const LEAST: usize = 72;
const TOGETHER: usize = 4_000_000;

/// Irradiance over π that comes straight from the environment's plain part, by `2 side²` rays: half of them are drawn by its
/// brightness, half by the cosine law, each weighted by how densely both draw its direction (Veach's balance heuristic).
pub(super) fn plain(around: &Environment, optics: &Optics, at: ShadingPoint, side: usize, random: &mut Random) -> Vec3 {
    let dome = around.plain();
    let brought = |direction: DVec3, by_brightness: f64| {
        let by_cosine = direction.dot(at.normal) * FRAC_1_PI;
        if by_cosine <= 0.0 {
            return Vec3::ZERO;
        }
        dome.radiance(direction) * left(optics, at, direction) * (by_cosine / (by_brightness + by_cosine)) as f32
    };
    let mut sum = Vec3::ZERO;
    for cell in 0..side * side {
        let drawn = dome.drawn(stratum(cell, side, random));
        sum += brought(drawn.direction, drawn.density);
    }
    for direction in hemisphere(at.normal, side, random) {
        sum += brought(direction, dome.density(direction));
    }
    // `hemisphere` works on a copy of the stream; step past what it has used.
    *random = Random::new(random.bits(), 1);
    sum / (side * side) as f32
}

/// Sets of rays that are tried where all of a set go below the horizon.
const MOST_SETS: usize = 8;

/// Irradiance over π that comes straight from the environment's bright part: what would arrive if nothing stood in the way,
/// times the part of it that does, Σ w v / Σ w over rays drawn by brightness; more rays where the first ones disagree.
pub(super) fn bright(
    around: &Environment,
    optics: &Optics,
    at: ShadingPoint,
    rays: ShadowRays,
    random: &mut Random,
) -> Vec3 {
    let Some(lamps) = around.bright() else { return Vec3::ZERO };
    let unhindered = lamps.unhindered(at.normal);
    if unhindered.max_element() <= 0.0 {
        return Vec3::ZERO;
    }
    let (mut sent, mut arrived) = (DVec3::ZERO, DVec3::ZERO);
    let mut cast = |side: usize| {
        for cell in 0..side * side {
            let drawn = lamps.drawn(stratum(cell, side, random));
            let cosine = drawn.direction.dot(at.normal);
            if cosine > 0.0 {
                let light = drawn.texel.as_dvec3() * (cosine / drawn.density);
                sent += light;
                arrived += light * left(optics, at, drawn.direction).as_dvec3();
            }
        }
        [sent, arrived].map(|light| light.element_sum())
    };
    let side = |rays: u32| f64::from(rays).sqrt().ceil() as usize;
    let mut found = cast(side(rays.first));
    for _ in 0..MOST_SETS {
        if found[0] > 0.0 {
            break;
        }
        found = cast(side(rays.first));
    }
    let [all, some] = found;
    if rays.penumbra > 0 && some > 0.0 && some < all * (1.0 - 1e-6) {
        cast(side(rays.penumbra));
    }
    let part = DVec3::from_array(std::array::from_fn(|c| if sent[c] > 0.0 { arrived[c] / sent[c] } else { 0.0 }));
    unhindered * part.as_vec3()
}

/// A place in a cell of a lattice of `side` × `side` on the unit square.
fn stratum(cell: usize, side: usize, random: &mut Random) -> [f64; 2] {
    [cell % side, cell / side].map(|k| (k as f64 + random.uniform()) / side as f64)
}

/// What is left of light that comes from so far away.
fn left(optics: &Optics, at: ShadingPoint, direction: DVec3) -> Vec3 {
    optics.transmittance(at.position, at.position + direction * (2.0 * optics.bvh.size()))
}

/// So many samples, squared, at each of so many vertices.
pub(super) fn side(vertices: usize) -> usize {
    let rays = (TOGETHER / vertices.max(1)).clamp(LEAST, MOST);
    (0.5 * rays as f64).sqrt() as usize
}

/// The same at all vertices of the mesh.
pub(super) fn at_vertices(optics: &Optics, mesh: &Elements, seed: u64, progress: &Progress) -> Result<Vec<Vec3>> {
    let Some(around) = &optics.scene().environment else { return Ok(vec![Vec3::ZERO; mesh.vertices.len()]) };
    let side = side(mesh.vertices.len());
    progress.start("light of the environment", mesh.vertices.len() as u64);
    let offset = optics.bvh.offset();
    let found = mesh.vertices.par_iter().enumerate().map(|(index, vertex)| {
        progress.advance(1);
        if vertex.buried || progress.stopped() {
            return Vec3::ZERO;
        }
        plain(around, optics, vertex.shading_point(offset), side, &mut Random::new(seed, index as u64))
    });
    let found = found.collect();
    progress.check()?;
    Ok(found)
}

#[cfg(test)]
mod tests {
    use crate::illumination::test_rooms::Room;
    use crate::illumination::{Illumination, IlluminationSettings, Surface};
    use crate::progress::Progress;
    use crate::random::Random;
    use crate::scene::{Environment, LightKind, Material, PunctualLight, Ray, SceneBvh, Sides};
    use glam::{DVec3, Vec3};
    use std::sync::Arc;

    /// Radiance of the floor of a room at places along x, seen from just above.
    fn floor(mut room: Room, around: Environment, places: &[f64]) -> Vec<Vec3> {
        room.scene.lights.extend(around.suns().iter().cloned());
        room.scene.environment = Some(Arc::new(around));
        let bvh = SceneBvh::new(room.scene);
        let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).expect("light");
        let seen = |x: &f64| {
            let ray = Ray { origin: DVec3::new(*x, 0.1, 0.03), direction: DVec3::NEG_Y };
            let hit = light.bvh().nearest(&ray, 0.0, Sides::Front).expect("floor");
            let surface = Surface::at(light.bvh().scene(), &hit, 0.0);
            light.radiance(&hit, &surface, 1, &mut Random::new(7, 0))
        };
        places.iter().map(seen).collect()
    }

    fn even(radiance: f32) -> Environment {
        Environment::new(8, 4, vec![Vec3::new(radiance, 0.5 * radiance, 0.0); 32], 0.0).expect("environment")
    }

    fn plate(material: Material) -> Room {
        let mut room = Room::default();
        let material = room.material(material);
        room.quad(DVec3::new(-1.0, 0.0, 1.0), DVec3::X * 2.0, DVec3::NEG_Z * 2.0, material);
        room
    }

    #[test]
    fn in_an_even_environment_a_surface_is_as_bright_as_its_share_of_it() {
        // The furnace: radiance ρL of an open plate.
        let places: Vec<f64> = (-9..10).map(|i| 0.1 * f64::from(i)).collect();
        for seen in floor(plate(Material::diffuse(Vec3::splat(0.8))), even(2.0), &places) {
            assert!((seen / 0.8 - Vec3::new(2.0, 1.0, 0.0)).length() < 0.02, "{seen}");
        }
    }

    #[test]
    fn a_wall_hides_its_half() {
        // A black wall on the left edge, as good as endless: it hides what is left of it, half of all by the cosine law.
        let mut room = plate(Material::diffuse(Vec3::ONE));
        let black = room.material(Material { double_sided: true, ..Material::diffuse(Vec3::ZERO) });
        room.quad(DVec3::new(-1.0, 0.0, -500.0), DVec3::Z * 1000.0, DVec3::Y * 500.0, black);
        for seen in floor(room, even(1.0), &[-0.8, -0.3, 0.0, 0.7]) {
            assert!((seen.x - 0.5).abs() < 0.02, "{seen}");
        }
    }

    #[test]
    fn a_sun_throws_a_sharp_shadow() {
        let (width, height) = (256, 128);
        let mut texels = vec![Vec3::splat(0.1); width * height];
        // Up but for 5°: the fourth row from the top at longitude 0, which is +x.
        texels[3 * width + width / 2] = Vec3::splat(1e5);
        let around = Environment::new(width, height, texels, 0.0).expect("environment");
        let [sun] = around.suns() else { panic!("{:?}", around.suns()) };
        let (towards, strength) = (-sun.direction.as_dvec3(), sun.intensity.x);
        let mut room = plate(Material::diffuse(Vec3::ONE));
        let black = room.material(Material { double_sided: true, ..Material::diffuse(Vec3::ZERO) });
        room.quad(DVec3::new(0.0, 0.5, -1.0), DVec3::X, DVec3::Z * 2.0, black);
        let edge = -0.5 * towards.x / towards.y;
        let seen = floor(room, around, &[-0.8, -0.2, edge - 1e-3, edge + 1e-3, 0.2, 0.8]);
        let lit = strength * towards.y as f32 / std::f32::consts::PI;
        // Beside the sun there is the sky, a tenth of it; under the sheet only what comes in from aside.
        assert!(seen[..3].iter().all(|s| (s.x / lit - 1.0).abs() < 0.1), "{lit} {seen:?}");
        assert!(seen[3..].iter().all(|s| s.x / lit < 0.1), "{lit} {seen:?}");
    }

    #[test]
    fn the_shadow_of_an_edge_is_as_soft_as_the_sun_is_wide() {
        // A sheet at height h whose edge lies across the way of a sun at the zenith: light rises over 2·h·radius beneath it.
        let (height, radius) = (0.5, 0.05);
        let mut room = plate(Material::diffuse(Vec3::ONE));
        let black = room.material(Material { double_sided: true, ..Material::diffuse(Vec3::ZERO) });
        room.quad(DVec3::new(0.0, height, -1.0), DVec3::X, DVec3::Z * 2.0, black);
        room.scene.lights.push(PunctualLight {
            kind: LightKind::Sun { radius: radius as f32 },
            position: Vec3::ZERO,
            direction: Vec3::NEG_Y,
            intensity: Vec3::splat(std::f32::consts::PI),
            range: f32::INFINITY,
            measured: None,
        });
        let bvh = SceneBvh::new(room.scene);
        let settings =
            IlluminationSettings { shadow_rays: 1024, penumbra_rays: 16_384, ..IlluminationSettings::default() };
        let light = Illumination::new(bvh, settings, &Progress::new()).expect("light");
        for part in [-1.2, -0.6, -0.2, 0.0, 0.4, 0.8, 1.2f64] {
            // The disc's share on the left of a line at `part` of its radius.
            let x = part.clamp(-1.0, 1.0);
            let exact = 0.5 - (x * (1.0 - x * x).sqrt() + x.asin()) / std::f64::consts::PI;
            let place = DVec3::new(part * height * radius, 0.1, 0.03);
            let ray = Ray { origin: place, direction: DVec3::NEG_Y };
            let hit = light.bvh().nearest(&ray, 0.0, Sides::Front).expect("floor");
            let surface = Surface::at(light.bvh().scene(), &hit, 0.0);
            let seen = f64::from(light.radiance(&hit, &surface, 1, &mut Random::new(7, 0)).x);
            assert!((seen - exact).abs() < 0.02, "{part}: {seen}, not {exact}");
        }
        assert!(light.report().energy.imbalance().abs() < 3e-3, "{:?}", light.report().energy);
    }

    #[test]
    fn sun_and_rough_metal_keep_the_balance_of_energy() {
        let mut room = plate(Material::diffuse(Vec3::splat(0.7)));
        let metal = Material { metallic: 1.0, roughness: 0.4, ..Material::diffuse(Vec3::new(1.0, 0.85, 0.5)) };
        let metal = room.material(metal);
        room.sphere(DVec3::new(0.0, 0.3, 0.0), 0.3, false, 24, metal);
        room.scene.lights.push(PunctualLight {
            kind: LightKind::Sun { radius: 5e-3 },
            position: Vec3::ZERO,
            direction: Vec3::new(0.5, -0.9, -0.3).normalize(),
            intensity: Vec3::splat(20.0),
            range: f32::INFINITY,
            measured: None,
        });
        let bvh = SceneBvh::new(room.scene);
        let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).expect("light");
        assert!(light.report().photons > 1000, "{:?}", light.report());
        assert!(light.report().energy.imbalance().abs() < 3e-3, "{:?}", light.report().energy);
    }
}
