//! Where an eye focuses on what it sees by way of mirrors and glass: the wavefront followed along a ray.
//!
//! Light that leaves one point Q of a surface arrives at the eye as a wave; the centre of its curvature is where Q seems
//! to be. To first order a ray that starts beside the central one by x with an angle θ against it ends beside Q by
//! A x + B θ; all light from Q has A x + B θ = 0, so the wave at the eye has the curvature matrix B⁻¹A, and the eye
//! focuses at 2/trace(B⁻¹A), between its two focal lines. Without optics A = 1, B = path, and that is the path; so it is
//! with flat mirrors. A and B are carried as ray differentials (Igehy 1999).

use crate::scene::{Hit, Scene};
use glam::{DMat2, DVec2, DVec3};

/// First-order neighbourhood of a ray: how position and direction change with two displacements and two angles at the
/// eye.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wavefront {
    positions: [DVec3; 4],
    directions: [DVec3; 4],
}

fn across(direction: DVec3) -> (DVec3, DVec3) {
    direction.any_orthonormal_pair()
}

impl Wavefront {
    /// At the eye, for a ray along a unit direction.
    pub(crate) fn new(direction: DVec3) -> Self {
        let (x, y) = across(direction);
        Self { positions: [x, y, DVec3::ZERO, DVec3::ZERO], directions: [DVec3::ZERO, DVec3::ZERO, x, y] }
    }

    /// Goes a distance along the ray to a surface with the given unit normal [m].
    pub(crate) fn advance(&mut self, direction: DVec3, distance: f64, normal: DVec3) {
        let slope = direction.dot(normal);
        for (p, d) in self.positions.iter_mut().zip(&self.directions) {
            *p += *d * distance;
            *p -= direction * (p.dot(normal) / slope);
        }
    }

    /// Is reflected, where the normal changes with the position as [`normal_change`] says.
    pub(crate) fn reflect(&mut self, direction: DVec3, normal: DVec3, change: impl Fn(DVec3) -> DVec3) {
        let cosine = direction.dot(normal);
        for (p, d) in self.positions.iter().zip(&mut self.directions) {
            let turn = change(*p);
            *d -= (turn * cosine + normal * (d.dot(normal) + direction.dot(turn))) * 2.0;
        }
    }

    /// Is refracted; `normal` looks against the ray, `ratio` is n₁/n₂.
    pub(crate) fn refract(&mut self, direction: DVec3, normal: DVec3, ratio: f64, change: impl Fn(DVec3) -> DVec3) {
        let cosine = -direction.dot(normal);
        let through = (1.0 - ratio * ratio * (1.0 - cosine * cosine)).max(1e-12).sqrt();
        let along = ratio * cosine - through;
        for (p, d) in self.positions.iter().zip(&mut self.directions) {
            let turn = change(*p);
            let tilt = -(d.dot(normal) + direction.dot(turn));
            *d = *d * ratio + turn * along + normal * (tilt * (ratio - ratio * ratio * cosine / through));
        }
    }

    /// Vergence of the wave at the eye, 1/distance of its centre [1/m]: what comes from the place that has been reached.
    /// Negative if the centre lies behind the eye; not finite where the eye's own image is there.
    pub(crate) fn vergence(&self, direction: DVec3) -> f64 {
        let (x, y) = across(direction);
        let flat = |p: DVec3| DVec2::new(p.dot(x), p.dot(y));
        let [a, b, c, d] = self.positions.map(flat);
        let (displaced, turned) = (DMat2::from_cols(a, b), DMat2::from_cols(c, d));
        let m = turned.inverse() * displaced;
        0.5 * (m.x_axis.x + m.y_axis.y)
    }
}

/// How a triangle's interpolated unit normal changes with a displacement of the hit along the surface.
pub(crate) fn normal_change(scene: &Scene, hit: &Hit) -> impl Fn(DVec3) -> DVec3 + use<> {
    let triangle = &scene.triangles[hit.triangle as usize];
    let [a, b, c] = triangle.corners();
    let [na, nb, nc] = triangle.normals.map(|n| n.as_dvec3());
    let (e1, e2, cross) = (b - a, c - a, triangle.cross());
    let squared = cross.length_squared();
    let [v, w] = hit.barycentric;
    let (d1, d2) = (nb - na, nc - na);
    let whole = na + d1 * v + d2 * w;
    let (length, unit) = (whole.length(), whole.normalize_or_zero());
    let side = if hit.front { 1.0 } else { -1.0 };
    move |p: DVec3| {
        if !(squared > 0.0 && length > 0.0) {
            return DVec3::ZERO;
        }
        let v = p.cross(e2).dot(cross) / squared;
        let w = e1.cross(p).dot(cross) / squared;
        let change = (d1 * v + d2 * w) / length;
        (change - unit * change.dot(unit)) * side
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::illumination::reflection::refracted;

    #[test]
    fn free_space_and_flat_mirrors_keep_the_path() {
        let mut direction = DVec3::new(0.3, -0.2, -0.9).normalize();
        let mut wave = Wavefront::new(direction);
        let flat = |_: DVec3| DVec3::ZERO;
        for (distance, normal) in [(0.7, DVec3::new(0.1, 0.2, 1.0)), (0.4, DVec3::new(-1.0, 0.3, -0.5))] {
            let normal = normal.normalize();
            wave.advance(direction, distance, normal);
            wave.reflect(direction, normal, flat);
            direction -= normal * (2.0 * direction.dot(normal));
        }
        wave.advance(direction, 0.25, direction);
        assert!((wave.vergence(direction) * 1.35 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn spherical_mirror_and_lens_of_the_textbooks() {
        // A convex mirror of radius R seen along its axis at distance s; a thing at distance u before it stands at
        // 1/v = 1/u + 2/R behind it. A sphere's normal changes by p/R.
        let (radius, s, u) = (0.3, 1.0, 0.5);
        let mut wave = Wavefront::new(DVec3::NEG_Z);
        wave.advance(DVec3::NEG_Z, s, DVec3::Z);
        wave.reflect(DVec3::NEG_Z, DVec3::Z, |p| p / radius);
        wave.advance(DVec3::Z, u, DVec3::Z);
        let v = 1.0 / (1.0 / u + 2.0 / radius);
        assert!((1.0 / wave.vergence(DVec3::Z) - (s + v)).abs() < 1e-12);
        // A glass plate of thickness t lifts what lies behind it by t(1 − 1/n).
        let (n, t) = (1.5, 0.2);
        let mut wave = Wavefront::new(DVec3::NEG_Z);
        wave.advance(DVec3::NEG_Z, s, DVec3::Z);
        wave.refract(DVec3::NEG_Z, DVec3::Z, 1.0 / n, |_| DVec3::ZERO);
        wave.advance(DVec3::NEG_Z, t, DVec3::Z);
        wave.refract(DVec3::NEG_Z, DVec3::Z, n, |_| DVec3::ZERO);
        wave.advance(DVec3::NEG_Z, u, DVec3::Z);
        assert!((1.0 / wave.vergence(DVec3::NEG_Z) - (s + t / n + u)).abs() < 1e-12);
        // Refraction at a sphere: n₂/v = (n₂ − n₁)/R + n₁/… seen from air at s, a thing at depth z in glass behind a
        // convex face: the image distance from the vertex follows n/z − 1/z′ = (n − 1)/R with both behind it.
        let z = 0.1;
        let mut wave = Wavefront::new(DVec3::NEG_Z);
        wave.advance(DVec3::NEG_Z, s, DVec3::Z);
        wave.refract(DVec3::NEG_Z, DVec3::Z, 1.0 / n, |p| p / radius);
        wave.advance(DVec3::NEG_Z, z, DVec3::Z);
        let image = 1.0 / (n / z - (n - 1.0) / radius);
        assert!((1.0 / wave.vergence(DVec3::NEG_Z) - (s + image)).abs() < 1e-12);
    }

    #[test]
    fn differentials_are_those_of_traced_rays() {
        // Against finite differences through a ball of glass, oblique: reflected once inside.
        let (radius, ratio) = (1.0, 1.0 / 1.5);
        let trace = |origin: DVec3, direction: DVec3| {
            let hit = |o: DVec3, d: DVec3, far: bool| {
                let b = o.dot(d);
                let root = (b * b - o.length_squared() + radius * radius).sqrt();
                o + d * (-b + if far { root } else { -root })
            };
            let p = hit(origin, direction, false);
            let d = refracted(direction, p, ratio).unwrap();
            let q = hit(p, d, true);
            let e = d - q * (2.0 * d.dot(q));
            (p, q, d, e, hit(q, e, true))
        };
        let (origin, direction) = (DVec3::new(0.2, 0.35, 3.0), DVec3::new(0.05, 0.02, -1.0).normalize());
        let (p, q, d, e, r) = trace(origin, direction);
        let mut wave = Wavefront::new(direction);
        wave.advance(direction, (p - origin).length(), p);
        wave.refract(direction, p, ratio, |x| x - p * p.dot(x));
        wave.advance(d, (q - p).length(), -q);
        wave.reflect(d, -q, |x| -(x - q * q.dot(x)));
        wave.advance(e, (r - q).length(), -r);
        let (x, y) = across(direction);
        let step = 1e-6;
        let moved = [(x, DVec3::ZERO), (y, DVec3::ZERO), (DVec3::ZERO, x), (DVec3::ZERO, y)];
        for (k, (o, t)) in moved.into_iter().enumerate() {
            let end = |sign: f64| trace(origin + o * (sign * step), (direction + t * (sign * step)).normalize()).4;
            let difference = (end(1.0) - end(-1.0)) / (2.0 * step);
            let found = wave.positions[k];
            assert!((difference - found).length() < 1e-6 * (1.0 + found.length()), "{k}: {difference} {found}");
        }
    }
}
