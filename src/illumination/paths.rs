//! How a ray goes on at mirrors, glossy metals and glass.

use super::flat_mirrors::FlatMirrors;
use super::reflection::{
    MIRROR_ALPHA, dielectric_reflectance, ggx_half, ggx_weight, has_wide_lobe, reflected, refracted,
};
use super::surface::Surface;
use crate::random::Random;
use crate::scene::bvh::{Hit, Meeting, Ray, SceneBvh, Sides};
use crate::scene::{AlphaMode, Material, Scene};
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// In which way a ray has left a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    /// Reflected.
    Mirrored,
    /// Into or out of a body.
    Refracted,
    /// Through a thin wall or past a part that is not covered, its direction unchanged.
    Straight,
}

/// How a ray goes on.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Continuation {
    /// It ends on the surface's diffuse part, weighted to make up for the other ways it could have gone.
    Diffuse(Vec3),
    /// It goes on along another ray, tinted.
    Onward(Ray, Vec3, Way),
    /// It ends.
    Absorbed,
}

/// A scene for rays, and which of its surfaces are more than diffuse.
pub(crate) struct Optics {
    pub(crate) bvh: Arc<SceneBvh>,
    /// Per triangle: whether its material reflects, transmits or is passed in part.
    pub(crate) optical: Vec<bool>,
    /// Per triangle: whether light passes it straight on, in part.
    passes: Vec<bool>,
    /// Whether any triangle is passed.
    any_passes: bool,
    /// Flat mirrors, in which lamps have images.
    pub(crate) mirrors: FlatMirrors,
    /// Most surfaces on one path.
    pub(crate) bounces: u32,
}

impl Optics {
    /// For paths over at most `bounces` surfaces, with at most `most_mirrors` flat mirrors set apart.
    pub(crate) fn new(bvh: Arc<SceneBvh>, bounces: u32, most_mirrors: usize) -> Self {
        let scene = bvh.scene();
        let optical: Vec<bool> = scene.materials.iter().map(is_optical).collect();
        let passes: Vec<bool> = scene.materials.iter().map(is_passed).collect();
        let each = |of: &[bool]| -> Vec<bool> { scene.triangles.iter().map(|t| of[t.material as usize]).collect() };
        let (optical, passes) = (each(&optical), each(&passes));
        let mirrors = FlatMirrors::new(scene, most_mirrors);
        Self { any_passes: passes.contains(&true), optical, passes, mirrors, bounces: bounces + 1, bvh }
    }

    pub(crate) fn scene(&self) -> &Scene {
        self.bvh.scene()
    }

    /// What thin walls and half-covered surfaces leave of light between two points that are lifted off their surfaces;
    /// zero where something solid stands between.
    pub(crate) fn transmittance(&self, from: DVec3, to: DVec3) -> Vec3 {
        if !self.any_passes {
            return if self.bvh.occluded(from, to) { Vec3::ZERO } else { Vec3::ONE };
        }
        let length = (to - from).length();
        let ray = Ray { origin: from, direction: (to - from) / length };
        match self.solid(ray, length) {
            (None, tint) => tint,
            (Some(_), _) => Vec3::ZERO,
        }
    }

    /// As [`Optics::transmittance`] for light that comes from an eye: one-sided surfaces whose backs the eye sees do not
    /// stand in its way.
    pub(crate) fn seen_from(&self, eye: DVec3, point: DVec3) -> Vec3 {
        let length = (point - eye).length();
        let ray = Ray { origin: eye, direction: (point - eye) / length };
        if !self.any_passes {
            return if self.bvh.meet(&ray, 0.0, length, Sides::Front).is_some() { Vec3::ZERO } else { Vec3::ONE };
        }
        match self.solid_for(ray, length, Sides::Front) {
            (None, tint) => tint,
            (Some(_), _) => Vec3::ZERO,
        }
    }

    /// The first surface along a ray before `length` [m] that is not passed straight on, with the ray that starts behind
    /// the last passed one, and what the passed ones have left of the light.
    pub(crate) fn solid(&self, ray: Ray, length: f64) -> (Option<(Meeting, Ray)>, Vec3) {
        self.solid_for(ray, length, Sides::Both)
    }

    fn solid_for(&self, ray: Ray, length: f64, sides: Sides) -> (Option<(Meeting, Ray)>, Vec3) {
        let bvh = &self.bvh;
        let (mut ray, mut left, mut tint) = (ray, length, Vec3::ONE);
        for _ in 0..=self.bounces {
            let Some(meeting) = bvh.meet(&ray, 0.0, left, sides) else { return (None, tint) };
            if !self.passes[meeting.triangle as usize] {
                return (Some((meeting, ray)), tint);
            }
            let hit = bvh.refined(&ray, &meeting);
            let surface = Surface::at(bvh.scene(), &hit, 0.0);
            tint *= surface.straight(ray.direction);
            // Beyond the sheet, by as much as traversal may be off.
            let slope = surface.facing.dot(ray.direction).abs().max(1e-3);
            let step = hit.distance + bvh.offset() / slope;
            left -= step;
            if tint.max_element() <= 0.0 || left <= 0.0 {
                break;
            }
            ray.origin = ray.at(step);
        }
        (None, if left <= 0.0 { tint } else { Vec3::ZERO })
    }

    /// Chooses one way on, with a probability in proportion to its strength.
    pub(crate) fn next(&self, ray: &Ray, meeting: &Meeting, random: &mut Random) -> Continuation {
        let (bvh, scene) = (&self.bvh, self.scene());
        let hit = bvh.refined(ray, meeting);
        let material = scene.material(meeting.triangle);
        if !hit.front && !material.double_sided && material.transmission <= 0.0 {
            return Continuation::Absorbed;
        }
        let surface = Surface::at(scene, &hit, 0.0);
        if surface.coverage < 1.0 && random.uniform_f32() >= surface.coverage {
            let origin = surface.position - surface.facing * bvh.offset();
            return Continuation::Onward(Ray { origin, direction: ray.direction }, Vec3::ONE, Way::Straight);
        }
        let absorbed = inside(material, &hit, hit.distance);
        let ways = Ways::new(&surface, ray.direction, random);
        let strength = |v: Vec3| f64::from(v.max_element());
        let (r, t, d) = (strength(ways.reflectance), strength(ways.transmittance), strength(surface.albedo));
        let total = r + t + d;
        let pick = random.uniform() * total;
        if total <= 0.0 {
            return Continuation::Absorbed;
        }
        if pick < d {
            return Continuation::Diffuse(absorbed * (total / d) as f32);
        }
        let onward = if surface.volume { Way::Refracted } else { Way::Straight };
        let (direction, weight, p, way) = if pick < d + r {
            (ways.mirrored, ways.reflectance, r, Way::Mirrored)
        } else {
            (ways.through, ways.transmittance, t, onward)
        };
        let side = if direction.dot(surface.facing) > 0.0 { 1.0 } else { -1.0 };
        let origin = surface.position + surface.facing * (side * bvh.offset());
        Continuation::Onward(Ray { origin, direction }, weight * absorbed * (total / p) as f32, way)
    }
}

/// What absorption in the body that a ray comes from leaves of its light.
pub(crate) fn inside(material: &Material, hit: &Hit, distance: f64) -> Vec3 {
    let absorbing =
        material.thickness > 0.0 && material.transmission > 0.0 && material.attenuation_distance.is_finite();
    if hit.front || !absorbing {
        return Vec3::ONE;
    }
    let depth = (distance / f64::from(material.attenuation_distance)) as f32;
    material.attenuation_color.max(Vec3::splat(1e-6)).powf(depth)
}

/// The specular ways on from a surface, with how much of the light takes each.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ways {
    /// Unit normal that reflects and refracts, on the side of the ray.
    pub(crate) half: DVec3,
    pub(crate) mirrored: DVec3,
    pub(crate) reflectance: Vec3,
    pub(crate) through: DVec3,
    pub(crate) transmittance: Vec3,
    /// n₁/n₂ of the refraction; one for a thin wall.
    pub(crate) ratio: f64,
}

impl Ways {
    /// For a ray that arrives along `direction`; a rough surface's micro-normal is drawn at random.
    pub(crate) fn new(surface: &Surface, direction: DVec3, random: &mut Random) -> Self {
        let alpha = f64::from(surface.alpha);
        let rough = surface.alpha > MIRROR_ALPHA;
        let half = if rough { ggx_half(-direction, surface.normal, alpha, random) } else { surface.normal };
        let half = if half.dot(direction) < 0.0 { half } else { surface.facing };
        let cosine = -half.dot(direction);
        let mut mirrored = reflected(direction, half);
        // What a rough surface would send below its horizon stays in its grooves.
        let masking = |out: DVec3| if rough { ggx_weight(out.dot(surface.normal), alpha) as f32 } else { 1.0 };
        let reflectance = surface.reflectance(cosine) * masking(mirrored);
        if mirrored.dot(surface.facing) <= 0.0 {
            // Bent normals may mirror a ray into the surface; flat mirroring is the nearest that can be seen.
            mirrored = reflected(direction, surface.facing);
        }
        let mut ways = Self { half, mirrored, reflectance, through: direction, transmittance: Vec3::ZERO, ratio: 1.0 };
        if surface.transmission.max_element() > 0.0 {
            if surface.volume {
                ways.ratio = surface.ratio();
                if let Some(through) = refracted(direction, half, ways.ratio) {
                    ways.through = through;
                    let part = dielectric_reflectance(cosine, ways.ratio) as f32;
                    // The tint of base colour is met once on the way in; inside, absorption colours.
                    let tint = if surface.front { surface.transmission } else { Vec3::ONE };
                    let below = if rough { ggx_weight(-through.dot(surface.normal), alpha) as f32 } else { 1.0 };
                    ways.transmittance = tint * ((1.0 - part) * below);
                }
            } else {
                ways.transmittance = surface.transmission * (1.0 - surface.thin_wall_reflectance(cosine));
            }
        }
        ways
    }
}

/// Whether a material does more than scatter diffusely.
fn is_optical(material: &Material) -> bool {
    let wide = has_wide_lobe(material.roughness, material.metallic) && material.metallic_roughness_texture.is_none();
    let shines = material.metallic > 0.0 || (material.specular > 0.0 && material.ior != 1.0);
    !material.unlit
        && (material.transmission > 0.0 || (shines && !wide) || matches!(material.alpha_mode, AlphaMode::Blend))
}

/// Whether light passes a material straight on, in part: a thin wall, or one that covers in part.
fn is_passed(material: &Material) -> bool {
    let thin = material.transmission > 0.0 && material.thickness <= 0.0;
    !material.unlit && (thin || matches!(material.alpha_mode, AlphaMode::Blend))
}
