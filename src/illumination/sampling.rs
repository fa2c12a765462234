//! Directions and points for stratified sampling.

use crate::random::Random;
use glam::DVec3;
use std::f64::consts::TAU;

/// Golden section: strides of this leave no gaps in a unit interval.
pub(crate) const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Two unit vectors that make a right-handed frame with `normal` (Duff et al. 2017, without branches at the poles).
pub(crate) fn tangents(normal: DVec3) -> (DVec3, DVec3) {
    let sign = 1.0f64.copysign(normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    (
        DVec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
        DVec3::new(b, sign + normal.y * normal.y * a, -normal.y),
    )
}

/// Cosine-distributed directions round a normal, one in each cell of a `side` × `side` grid on the unit square.
///
/// The square is laid on the disk by Shirley & Chiu's concentric map (1997), whose cells stay compact, and the disk is
/// lifted to the hemisphere (Malley). The whole set is turned by a random angle, so that neighbouring sets differ.
pub(crate) struct Hemisphere {
    x: DVec3,
    y: DVec3,
    normal: DVec3,
    side: usize,
}

impl Hemisphere {
    /// One round `normal`; takes a number of `random`.
    pub(crate) fn new(normal: DVec3, side: usize, random: &mut Random) -> Self {
        let (x, y) = tangents(normal);
        let (sin, cos) = (TAU * random.uniform()).sin_cos();
        Self { x: x * cos + y * sin, y: y * cos - x * sin, normal, side }
    }

    /// The direction of a place in the unit square of a cell; cells are counted row by row.
    pub(crate) fn direction(&self, cell: usize, [u, v]: [f64; 2]) -> DVec3 {
        let u = ((cell % self.side) as f64 + u) / self.side as f64;
        let v = ((cell / self.side) as f64 + v) / self.side as f64;
        let (a, b) = disk(u, v);
        self.x * a + self.y * b + self.normal * (1.0 - a * a - b * b).max(0.0).sqrt()
    }
}

/// The directions of a [`Hemisphere`], one after another.
pub(crate) fn hemisphere(normal: DVec3, side: usize, random: &mut Random) -> impl Iterator<Item = DVec3> {
    let hemisphere = Hemisphere::new(normal, side, random);
    let mut random = random.clone();
    (0..side * side).map(move |cell| hemisphere.direction(cell, [random.uniform(), random.uniform()]))
}

/// The cosine-distributed direction round `normal` of a place in the unit square.
pub(crate) fn lifted(normal: DVec3, u: f64, v: f64) -> DVec3 {
    let ((x, y), (a, b)) = (tangents(normal), disk(u, v));
    x * a + y * b + normal * (1.0 - a * a - b * b).max(0.0).sqrt()
}

/// Strides of the additive recurrence in four dimensions (Roberts 2018): powers of the inverse of the root of x⁵ = x + 1.
const STRIDES: [f64; 4] =
    [0.856_674_883_854_502_9, 0.733_891_856_627_126, 0.628_706_721_037_808_6, 0.538_597_257_223_61];

/// Place `index` of a sequence that fills the unit cube of four dimensions evenly, moved by `shift`.
pub(crate) fn spread(shift: [f64; 4], index: u64) -> [f64; 4] {
    std::array::from_fn(|d| (shift[d] + index as f64 * STRIDES[d]).fract())
}

/// Shirley & Chiu's concentric map of the unit square on the unit disk; keeps areas up to the factor π.
pub(crate) fn disk(u: f64, v: f64) -> (f64, f64) {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    if a == 0.0 && b == 0.0 {
        return (0.0, 0.0);
    }
    let (radius, angle) = if a.abs() > b.abs() {
        (a, std::f64::consts::FRAC_PI_4 * (b / a))
    } else {
        (b, std::f64::consts::FRAC_PI_2 - std::f64::consts::FRAC_PI_4 * (a / b))
    };
    let (sin, cos) = angle.sin_cos();
    (radius * cos, radius * sin)
}

/// Uniform weights of the second and third corner of a triangle from the unit square (keeps strata together).
pub(crate) fn triangle_weights(u: f64, v: f64) -> (f64, f64) {
    let root = u.sqrt();
    (root * (1.0 - v), root * v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hemisphere_has_cosine_moments() {
        let normal = DVec3::new(0.3, -0.5, -0.7).normalize();
        let mut random = Random::new(3, 0);
        let (mut mean, mut square, n) = (0.0, 0.0, 64 * 64);
        for d in hemisphere(normal, 64, &mut random) {
            assert!((d.length() - 1.0).abs() < 1e-12);
            let cos = d.dot(normal);
            mean += cos / f64::from(n);
            square += cos * cos / f64::from(n);
        }
        // ⟨cos⟩ = 2/3 and ⟨cos²⟩ = 1/2 for density cosθ/π; stratification leaves an error of about n^-1.
        assert!((mean - 2.0 / 3.0).abs() < 1e-3 && (square - 0.5).abs() < 1e-3, "{mean} {square}");
        let (x, y) = tangents(normal);
        assert!((x.cross(y) - normal).length() < 1e-12);
    }

    #[test]
    fn triangle_weights_are_uniform() {
        let n = 200;
        let (mut u1, mut v1) = (0.0, 0.0);
        for i in 0..n * n {
            let (u, v) =
                triangle_weights((f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n));
            assert!(u >= 0.0 && v >= 0.0 && u + v <= 1.0 + 1e-12);
            u1 += u / f64::from(n * n);
            v1 += v / f64::from(n * n);
        }
        assert!((u1 - 1.0 / 3.0).abs() < 1e-4 && (v1 - 1.0 / 3.0).abs() < 1e-4);
    }
}
