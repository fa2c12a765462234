//! How a ray goes on at mirrors, glossy metals and glass.

use super::flat_mirrors::FlatMirrors;
use super::sampling::tangents;
use super::surface::{MIRROR_ALPHA, Surface, WIDE_LOBE};
use crate::random::Random;
use crate::scene::bvh::{Meeting, Ray, SceneBvh, Sides};
use crate::scene::{AlphaMode, Material, Scene};
use glam::{DVec3, Vec3};

/// Direction of a mirrored ray.
pub fn reflected(direction: DVec3, normal: DVec3) -> DVec3 {
    direction - normal * (2.0 * direction.dot(normal))
}

/// Direction of a refracted ray (Snell); `normal` looks against the ray, `ratio` is n₁/n₂. `None` at total reflection.
pub fn refracted(direction: DVec3, normal: DVec3, ratio: f64) -> Option<DVec3> {
    let cosine = -direction.dot(normal);
    let squared = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
    (squared >= 0.0).then(|| (direction * ratio + normal * (ratio * cosine - squared.sqrt())).normalize())
}

/// Fresnel's reflectance of a dielectric for unpolarised light; `ratio` is n₁/n₂, `cosine` that of incidence. One at
/// total reflection.
pub fn dielectric_reflectance(cosine: f64, ratio: f64) -> f64 {
    let squared = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
    if squared <= 0.0 {
        return 1.0;
    }
    let through = squared.sqrt();
    let s = (ratio * cosine - through) / (ratio * cosine + through);
    let p = (cosine - ratio * through) / (cosine + ratio * through);
    0.5 * (s * s + p * p)
}

/// A half vector of the GGX distribution as seen from `view` (Heitz 2018), in world space.
pub(crate) fn ggx_half(view: DVec3, normal: DVec3, alpha: f64, random: &mut Random) -> DVec3 {
    let (x, y) = tangents(normal);
    let local = DVec3::new(view.dot(x) * alpha, view.dot(y) * alpha, view.dot(normal)).normalize();
    let (t1, t2) = tangents(local);
    let radius = random.uniform().sqrt();
    let (sin, cos) = random.phase().sin_cos();
    let a = radius * cos;
    let blend = 0.5 * (1.0 + local.z);
    // Measured from the frame's own axes, so that the projected half disk lies on the side of the normal.
    let (t1, t2) = if local.z < 1.0 - 1e-9 {
        let t1 = DVec3::Z.cross(local).normalize();
        (t1, local.cross(t1))
    } else {
        (t1, t2)
    };
    let b = (1.0 - blend) * (1.0 - a * a).max(0.0).sqrt() + blend * radius * sin;
    let h = t1 * a + t2 * b + local * (1.0 - a * a - b * b).max(0.0).sqrt();
    (x * (h.x * alpha) + y * (h.y * alpha) + normal * h.z.max(0.0)).normalize_or(normal)
}

/// Weight of a direction that was drawn through [`ggx_half`]: Smith's height-correlated G₂ over G₁ (Heitz 2014), for
/// the cosines of the directions to the viewer and to the light with the normal.
pub(crate) fn ggx_weight(view: f64, light: f64, alpha: f64) -> f64 {
    let lambda = |cosine: f64| {
        let squared = (cosine * cosine).max(1e-12);
        0.5 * ((1.0 + alpha * alpha * (1.0 - squared) / squared).sqrt() - 1.0)
    };
    let (v, l) = (lambda(view), lambda(light));
    (1.0 + v) / (1.0 + v + l)
}

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

/// Which surfaces are more than diffuse.
#[derive(Clone, Debug)]
pub(crate) struct Optics {
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
    pub(crate) fn new(scene: &Scene, bounces: u32, most_mirrors: usize) -> Self {
        let optical: Vec<bool> = scene.materials.iter().map(is_optical).collect();
        let passes: Vec<bool> = scene.materials.iter().map(is_passed).collect();
        let each = |of: &[bool]| -> Vec<bool> { scene.triangles.iter().map(|t| of[t.material as usize]).collect() };
        let (optical, passes) = (each(&optical), each(&passes));
        let mirrors = FlatMirrors::new(scene, most_mirrors);
        Self { any_passes: passes.contains(&true), optical, passes, mirrors, bounces: bounces + 1 }
    }

    /// What thin walls and half-covered surfaces leave of light between two points that are lifted off their surfaces;
    /// zero where something solid stands between.
    pub(crate) fn transmittance(&self, bvh: &SceneBvh, from: DVec3, to: DVec3) -> Vec3 {
        if !self.any_passes {
            return if bvh.occluded(from, to) { Vec3::ZERO } else { Vec3::ONE };
        }
        let length = (to - from).length();
        let ray = Ray { origin: from, direction: (to - from) / length };
        match self.solid(bvh, ray, length) {
            (None, tint) => tint,
            (Some(_), _) => Vec3::ZERO,
        }
    }

    /// The first surface along a ray before `length` [m] that is not passed straight on, with the ray that starts behind
    /// the last passed one, and what the passed ones have left of the light.
    pub(crate) fn solid(&self, bvh: &SceneBvh, ray: Ray, length: f64) -> (Option<(Meeting, Ray)>, Vec3) {
        let (mut ray, mut left, mut tint) = (ray, length, Vec3::ONE);
        for _ in 0..=self.bounces {
            let Some(meeting) = bvh.meet(&ray, 0.0, left, Sides::Both) else { return (None, tint) };
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
    pub(crate) fn next(&self, bvh: &SceneBvh, ray: &Ray, meeting: &Meeting, random: &mut Random) -> Continuation {
        let scene = bvh.scene();
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
pub(crate) fn inside(material: &Material, hit: &crate::scene::Hit, distance: f64) -> Vec3 {
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
        let view = direction.dot(surface.normal).abs();
        let masking =
            |out: DVec3| if rough { ggx_weight(view, out.dot(surface.normal).abs(), alpha) as f32 } else { 1.0 };
        let mut reflectance = surface.fresnel(cosine) * masking(mirrored);
        if mirrored.dot(surface.facing) <= 0.0 {
            // Bent normals may mirror a ray into the surface; flat mirroring is the nearest that can be seen.
            mirrored = reflected(direction, surface.facing);
        }
        let mut ways = Self { half, mirrored, reflectance, through: direction, transmittance: Vec3::ZERO, ratio: 1.0 };
        if surface.transmission.max_element() > 0.0 {
            if surface.volume {
                ways.ratio = if surface.front { 1.0 / surface.ior } else { surface.ior };
                let part = dielectric_reflectance(cosine, ways.ratio) as f32;
                reflectance = Vec3::splat(part) * masking(mirrored);
                if let Some(through) = refracted(direction, half, ways.ratio) {
                    ways.through = through;
                    // The tint of base colour is met once on the way in; inside, absorption colours.
                    let tint = if surface.front { surface.transmission } else { Vec3::ONE };
                    ways.transmittance = tint * (1.0 - part);
                }
            } else {
                let both = surface.thin_wall_reflectance(cosine);
                reflectance = Vec3::splat(both) * masking(mirrored);
                ways.transmittance = surface.transmission * (1.0 - both);
            }
            ways.reflectance = reflectance;
        }
        ways
    }
}

/// Whether a material does more than scatter diffusely.
fn is_optical(material: &Material) -> bool {
    let wide = material.roughness >= WIDE_LOBE && material.metallic_roughness_texture.is_none();
    let shines = material.metallic > 0.0 || (material.specular > 0.0 && material.ior != 1.0);
    !material.unlit
        && (material.transmission > 0.0 || (shines && !wide) || matches!(material.alpha_mode, AlphaMode::Blend))
}

/// Whether light passes a material straight on, in part: a thin wall, or one that covers in part.
fn is_passed(material: &Material) -> bool {
    let thin = material.transmission > 0.0 && material.thickness <= 0.0;
    !material.unlit && (thin || matches!(material.alpha_mode, AlphaMode::Blend))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fresnel_and_snell_at_known_angles() {
        // Normal incidence on n = 1.5: ((n−1)/(n+1))² = 4 %; Brewster's angle atan(n) leaves half of the s part.
        assert!((dielectric_reflectance(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-12);
        let brewster = 1.5f64.atan();
        let s = ((1.0 - 1.5f64 * 1.5) / (1.0 + 1.5 * 1.5)).powi(2);
        assert!((dielectric_reflectance(brewster.cos(), 1.0 / 1.5) - 0.5 * s).abs() < 1e-12);
        assert_eq!(dielectric_reflectance(0.5, 1.5), 1.0);
        let incident = DVec3::new(0.6, 0.0, -0.8);
        let through = refracted(incident, DVec3::Z, 1.0 / 1.5).unwrap();
        assert!((through.x - 0.4).abs() < 1e-12 && through.z < 0.0);
        assert!(refracted(incident, DVec3::Z, 2.0).is_none());
        assert!((reflected(incident, DVec3::Z) - DVec3::new(0.6, 0.0, 0.8)).length() < 1e-12);
    }

    #[test]
    fn rough_reflection_is_drawn_as_the_microfacet_model_says() {
        // White GGX: the mean weight must be the integral of D·G₂/(4 cosθᵥ) over the hemisphere, here by quadrature.
        let view = DVec3::new(0.5, 0.0, 0.75f64.sqrt());
        for alpha in [0.05f64, 0.2, 0.4] {
            let (mut integral, n) = (0.0, 1500);
            for i in 0..n {
                for j in 0..n {
                    let cos = (f64::from(i) + 0.5) / f64::from(n);
                    let (s, c) = (std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(n)).sin_cos();
                    let sin = (1.0 - cos * cos).sqrt();
                    let light = DVec3::new(sin * c, sin * s, cos);
                    let z2 = (view + light).normalize().z.powi(2);
                    let d = alpha * alpha / (std::f64::consts::PI * (z2 * (alpha * alpha - 1.0) + 1.0).powi(2));
                    let lambda = |z: f64| 0.5 * ((1.0 + alpha * alpha * (1.0 - z * z) / (z * z)).sqrt() - 1.0);
                    let g = 1.0 / (1.0 + lambda(view.z) + lambda(cos));
                    integral += d * g / (4.0 * view.z) * std::f64::consts::TAU / f64::from(n * n);
                }
            }
            let mut random = Random::new(1, 0);
            let draws = 40_000;
            let drawn: f64 = (0..draws)
                .map(|_| {
                    let out = reflected(-view, ggx_half(view, DVec3::Z, alpha, &mut random));
                    if out.z > 0.0 { ggx_weight(view.z, out.z, alpha) } else { 0.0 }
                })
                .sum::<f64>()
                / f64::from(draws);
            // Weights lie in [0, 1]: standard deviation of the mean below 0.5/200.
            assert!((drawn - integral).abs() < 1e-2, "α = {alpha}: {drawn}, not {integral}");
            assert!(drawn <= 1.0);
        }
    }
}
