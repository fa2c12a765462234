//! Laws of reflection and refraction: Snell, Fresnel, and the GGX microfacet model.

use super::sampling::tangents;
use crate::random::Random;
use glam::DVec3;

/// GGX α below which a lobe is narrower than a pixel of any picture: a mirror.
pub(crate) const MIRROR_ALPHA: f32 = 2e-3;
/// Perceptual roughness from which the weak specular lobe of a dielectric is so wide that it is taken for diffuse.
const WIDE_LOBE: f32 = 0.5;
/// Metalness below which a surface is taken for a dielectric there.
const LEAST_METAL: f32 = 0.1;

/// Whether light transport takes a specular lobe for diffuse: a wide one of a dielectric. That of a metal is all its light,
/// and is followed however wide.
pub(crate) fn has_wide_lobe(roughness: f32, metallic: f32) -> bool {
    roughness >= WIDE_LOBE && metallic < LEAST_METAL
}

/// Direction of a mirrored ray.
pub(crate) fn reflected(direction: DVec3, normal: DVec3) -> DVec3 {
    direction - normal * (2.0 * direction.dot(normal))
}

/// Direction of a refracted ray (Snell); `normal` looks against the ray, `ratio` is n₁/n₂. `None` at total reflection.
pub(crate) fn refracted(direction: DVec3, normal: DVec3, ratio: f64) -> Option<DVec3> {
    let cosine = -direction.dot(normal);
    let squared = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
    (squared >= 0.0).then(|| (direction * ratio + normal * (ratio * cosine - squared.sqrt())).normalize())
}

/// Fresnel's reflectance of a dielectric for unpolarised light; `ratio` is n₁/n₂, `cosine` that of incidence. One at
/// total reflection.
pub(crate) fn dielectric_reflectance(cosine: f64, ratio: f64) -> f64 {
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

/// Smith's masking G₁ of GGX for a cosine with the normal (Walter et al. 2007).
pub(crate) fn ggx_masking(cosine: f64, alpha: f64) -> f64 {
    let squared = (cosine * cosine).max(1e-12);
    2.0 / (1.0 + (1.0 + alpha * alpha * (1.0 - squared) / squared).sqrt())
}

/// Weight of a direction that was drawn through [`ggx_half`]: G₂ over G₁ of the viewer. glTF's G₂ (appendix B.3.2) is the
/// product of both sides' G₁, so that what is left is G₁ of the direction drawn; zero below the surface.
pub(crate) fn ggx_weight(light: f64, alpha: f64) -> f64 {
    if light > 0.0 { ggx_masking(light, alpha) } else { 0.0 }
}

/// How densely directions lie about `light` that are mirrored at half vectors drawn by [`ggx_half`]: D·G₁/(4 cosθᵥ) [1/sr], for
/// directions to the viewer and to the light. Zero for one below the surface.
pub(crate) fn ggx_density(view: DVec3, light: DVec3, normal: DVec3, alpha: f64) -> f64 {
    let v = view.dot(normal);
    if v <= 0.0 || light.dot(normal) <= 0.0 {
        return 0.0;
    }
    let half = (view + light).normalize();
    // 1 − cos² by the cross product: the cosine of a narrow lobe is too near to one.
    let (sine, cosine) = (half.cross(normal).length_squared(), half.dot(normal).powi(2));
    let spread = sine + alpha * alpha * cosine;
    let d = alpha * alpha / (std::f64::consts::PI * spread * spread);
    d * ggx_masking(v, alpha) / (4.0 * v)
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
                    let g = 1.0 / ((1.0 + lambda(view.z)) * (1.0 + lambda(cos)));
                    let lobe = d * g / (4.0 * view.z);
                    integral += lobe * std::f64::consts::TAU / f64::from(n * n);
                    if (i + j) % 97 == 0 {
                        let own = ggx_density(view, light, DVec3::Z, alpha) * ggx_weight(cos, alpha);
                        assert!((own - lobe).abs() <= 1e-6 * lobe, "α = {alpha}: {own}, not {lobe}");
                    }
                }
            }
            let mut random = Random::new(1, 0);
            let draws = 40_000;
            let drawn: f64 = (0..draws)
                .map(|_| {
                    let out = reflected(-view, ggx_half(view, DVec3::Z, alpha, &mut random));
                    ggx_weight(out.z, alpha)
                })
                .sum::<f64>()
                / f64::from(draws);
            // Weights lie in [0, 1]: standard deviation of the mean below 0.5/200.
            assert!((drawn - integral).abs() < 1e-2, "α = {alpha}: {drawn}, not {integral}");
            assert!(drawn <= 1.0);
        }
    }
}
