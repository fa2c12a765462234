//! Light of lamps without a size, and of suns.

use super::paths::Optics;
use super::sampling::{disk, tangents};
use super::surface::ShadingPoint;
use crate::random::Random;
use crate::scene::{LightKind, PunctualLight};
use glam::{DVec3, Vec3};
use std::f64::consts::FRAC_1_PI;

/// One shadow ray in so many of those for all lamps goes to a sun: its penumbra is narrow.
pub(super) const PER_SUN: u32 = 4;

/// Irradiance over π that a punctual light would give if nothing stood in the way, and where its light comes from [m]: a
/// point beyond the scene of that `size` [m] for a directional one. `None` where it gives none.
pub(crate) fn punctual_light(size: f64, light: &PunctualLight, at: ShadingPoint) -> Option<(Vec3, DVec3)> {
    let ShadingPoint { position: point, normal } = at;
    let (towards, distance, strength) = match light.kind {
        LightKind::Directional | LightKind::Sun { .. } => (-light.direction.as_dvec3(), f64::INFINITY, 1.0),
        LightKind::Point | LightKind::Eye | LightKind::Spot { .. } => {
            let span = light.position.as_dvec3() - point;
            let distance = span.length();
            let range = f64::from(light.range);
            // KHR_lights_punctual's window, which ends the light at its range.
            let window = if range.is_finite() { (1.0 - (distance / range).powi(4)).clamp(0.0, 1.0) } else { 1.0 };
            (span / distance, distance, window / (distance * distance))
        }
    };
    let strength = match light.kind {
        LightKind::Spot { inner, outer } => {
            let (inner, outer) = (f64::from(inner).cos(), f64::from(outer).cos());
            let cosine = -towards.dot(light.direction.as_dvec3());
            let edge = ((cosine - outer) / (inner - outer).max(1e-3)).clamp(0.0, 1.0);
            strength * edge * edge
        }
        _ => match &light.measured {
            Some(measured) => strength * measured.towards(-towards),
            None => strength,
        },
    };
    let cosine = normal.dot(towards);
    if !(cosine > 0.0 && strength > 0.0 && strength.is_finite()) {
        return None;
    }
    let end = if distance.is_finite() { light.position.as_dvec3() } else { point + towards * (2.0 * size) };
    Some((light.intensity * (strength * cosine * FRAC_1_PI) as f32, end))
}

/// Irradiance over π that arrives from a punctual light, times a factor of the unit direction to it; shadows are looked for
/// where that is not zero. To places of a sun's disc a first set of so many rays goes, and a second one where these disagree.
pub(super) fn arriving(
    optics: &Optics,
    light: &PunctualLight,
    at: ShadingPoint,
    [first, second]: [u32; 2],
    factor: impl Fn(DVec3) -> Vec3,
    random: &mut Random,
) -> Vec3 {
    let Some((strength, end)) = punctual_light(optics.bvh.size(), light, at) else { return Vec3::ZERO };
    if let LightKind::Sun { radius } = light.kind {
        let (mut sum, mut rays, mut hidden) = (Vec3::ZERO, 0, 0);
        let mut cast = |side: u32| {
            for cell in 0..side * side {
                let [u, v] = [cell % side, cell / side].map(|k| (f64::from(k) + random.uniform()) / f64::from(side));
                let end = on_disc(at.position, end, radius, [u, v]);
                let shown = factor((end - at.position).normalize());
                let seen = if shown.max_element() > 0.0 { optics.transmittance(at.position, end) } else { Vec3::ZERO };
                sum += shown * seen;
                hidden += u32::from(seen.max_element() <= 0.0);
            }
            rays += side * side;
            (rays, hidden)
        };
        let side = |rays: u32| f64::from(rays.max(1)).sqrt().ceil() as u32;
        let (all, dark) = cast(side(first));
        if second > 0 && dark > 0 && dark < all {
            cast(side(second));
        }
        return strength * sum / rays as f32;
    }
    let strength = strength * factor((end - at.position).normalize());
    if strength.max_element() <= 0.0 {
        return Vec3::ZERO;
    }
    let seen = if light.kind == LightKind::Eye {
        optics.seen_from(end, at.position)
    } else {
        optics.transmittance(at.position, end)
    };
    strength * seen
}

/// The place of the unit square on a disc of this angular radius round `end` [rad], as seen from a point.
pub(super) fn on_disc(from: DVec3, end: DVec3, radius: f32, [u, v]: [f64; 2]) -> DVec3 {
    let span = end - from;
    let length = span.length();
    let ((x, y), (a, b)) = (tangents(span / length), disk(u, v));
    end + (x * a + y * b) * (f64::from(radius) * length)
}
