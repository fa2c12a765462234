//! Form factors: which part of a diffuse surface's flux reaches another, in closed form where there is one.
//!
//! A Lambertian emitter sends (1/π)∫cosθ dω into a cone. The seed paper's eq. (1), Φ_in = Φ_out·S/(2π)·cosθ, divides by
//! 2π: over the whole hemisphere it sends out one half. [`FormFactor::Paper`] keeps it for comparison.

use crate::names::{Name, Named};
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, TAU};

/// How flux is divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FormFactor {
    /// (1/π)∫cosθ dω: what leaves a surface arrives somewhere or escapes.
    #[default]
    Lambert,
    /// (1/2π)∫cosθ dω, eq. (1) of the seed paper: half of the flux is lost at every transfer.
    Paper,
}

impl Named for FormFactor {
    const KIND: &'static str = "form factor";
    const NAMES: &'static [Name<Self>] = &[
        ("exact", || Self::Lambert, "1/π, polygons"),
        ("paper", || Self::Paper, "eq. (1) of the seed paper: half of the light is lost"),
    ];
}

impl FormFactor {
    /// The factor by which a transfer differs from Lambert's.
    pub(crate) fn scale(self) -> f64 {
        match self {
            Self::Lambert => 1.0,
            Self::Paper => 0.5,
        }
    }
}

/// Form factor from a surface element at `point` with unit `normal` to a planar polygon: (1/π)∫cosθ dω over the part of
/// it above the element's horizon. Neither the polygon's facing nor obstacles are looked at.
///
/// Lambert's formula (1760): F = (1/2π) |Σ_i γ_i n·(r_i × r_{i+1})/|r_i × r_{i+1}||, γ_i the angle under which edge i
/// is seen. Exact for every planar polygon that does not contain the point; zero for fewer than three corners.
pub(crate) fn point_to_polygon(point: DVec3, normal: DVec3, polygon: &[DVec3]) -> f64 {
    let heights = |p: &DVec3| (*p - point).dot(normal);
    if polygon.iter().all(|p| heights(p) >= 0.0) {
        return edge_sum(normal, polygon.iter().map(|p| *p - point));
    }
    let mut above = Vec::with_capacity(polygon.len() + 1);
    clip(polygon, |p| heights(&p), &mut above);
    edge_sum(normal, above.iter().map(|p| *p - point))
}

/// The part of a convex polygon where a linear function is not negative (Sutherland & Hodgman 1974); empty if that is no
/// polygon any more.
pub(crate) fn clip(polygon: &[DVec3], height: impl Fn(DVec3) -> f64, kept: &mut Vec<DVec3>) {
    kept.clear();
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (hp, hq) = (height(p), height(q));
        if hp >= 0.0 {
            kept.push(p);
        }
        if (hp < 0.0) != (hq < 0.0) {
            kept.push(p.lerp(q, hp / (hp - hq)));
        }
    }
    if kept.len() < 3 {
        kept.clear();
    }
}

fn edge_sum(normal: DVec3, spokes: impl Iterator<Item = DVec3> + Clone) -> f64 {
    let Some(first) = spokes.clone().next() else { return 0.0 };
    let next = spokes.clone().skip(1).chain(std::iter::once(first));
    let sum: f64 = spokes
        .zip(next)
        .map(|(a, b)| {
            let cross = a.cross(b);
            let sine = cross.length();
            // An edge that runs through the point, or has no length, is seen under no angle.
            if sine > 0.0 { sine.atan2(a.dot(b)) * normal.dot(cross) / sine } else { 0.0 }
        })
        .sum();
    (sum / TAU).abs()
}

/// Form factor from a surface element to a small area: cosθ₁cosθ₂·area/(π r²) [1], zero where either looks away.
pub(crate) fn point_to_element(point: DVec3, normal: DVec3, at: DVec3, facing: DVec3, area: f64) -> f64 {
    let span = at - point;
    let squared = span.length_squared();
    let (here, there) = (normal.dot(span), -facing.dot(span));
    if here > 0.0 && there > 0.0 { here * there * area * FRAC_1_PI / (squared * squared) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Form factor between two polygons that see each other freely: the mean of [`point_to_polygon`] over `from`, by
    /// Gauss–Legendre quadrature (4 × 4 nodes) on `cells`² cells of each triangle of its fan.
    ///
    /// An oracle for tests, not for scenes: obstacles are ignored; the error falls with cells⁻³ or faster where the
    /// polygons touch, and with cells⁻⁸ where they do not.
    fn polygon_to_polygon(from: &[DVec3], to: &[DVec3], cells: usize) -> f64 {
        const NODES: [(f64, f64); 4] = [
            (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
            (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
            (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
            (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
        ];
        let (mut weighted, mut total) = (0.0, 0.0);
        for i in 1..from.len().saturating_sub(1) {
            let (a, b, c) = (from[0], from[i], from[i + 1]);
            let cross = (b - a).cross(c - a);
            let (area, normal) = (0.5 * cross.length(), cross.normalize_or_zero());
            let mut mean = 0.0;
            for row in 0..cells * cells {
                let corner = ((row / cells) as f64, (row % cells) as f64);
                for (x, wx) in NODES {
                    for (y, wy) in NODES {
                        // (s, t) ↦ a + s(b−a) + st(c−b) covers the triangle with Jacobian 2·area·s.
                        let (s, t) = ((corner.0 + x) / cells as f64, (corner.1 + y) / cells as f64);
                        let point = a + (b - a) * s + (c - b) * (s * t);
                        mean += wx * wy * 2.0 * s * point_to_polygon(point, normal, to);
                    }
                }
            }
            weighted += area * mean / (cells * cells) as f64;
            total += area;
        }
        if total > 0.0 { weighted / total } else { 0.0 }
    }

    /// An axis-aligned rectangle: `corner`, then two edge vectors.
    fn rectangle(corner: [f64; 3], u: [f64; 3], v: [f64; 3]) -> [DVec3; 4] {
        let (p, u, v) = (DVec3::from(corner), DVec3::from(u), DVec3::from(v));
        [p, p + u, p + u + v, p + v]
    }

    fn disk(radius: f64, offset: f64, height: f64) -> Vec<DVec3> {
        // A regular polygon of the disk's area, so that the error is of fourth order in the angle.
        let n = 4000;
        let step = TAU / f64::from(n);
        let radius = radius * (step / step.sin()).sqrt();
        (0..n)
            .map(|i| (step * f64::from(i)).sin_cos())
            .map(|(s, c)| DVec3::new(offset + radius * c, radius * s, height))
            .collect()
    }

    #[test]
    fn parallel_and_perpendicular_rectangles_of_howells_catalogue() {
        // J. R. Howell, A Catalog of Radiation Heat Transfer Configuration Factors: C-11, C-13, C-14, C-15.
        let parallel = |a: f64, b: f64, c: f64| {
            let low = rectangle([0.0; 3], [a, 0.0, 0.0], [0.0, b, 0.0]);
            let high = rectangle([0.0, 0.0, c], [0.0, b, 0.0], [a, 0.0, 0.0]);
            (polygon_to_polygon(&low, &high, 8), polygon_to_polygon(&high, &low, 8))
        };
        for (sides, expected) in [
            ([1.0, 1.0, 1.0], 0.199_824_895_698_387_46),
            ([2.0, 1.0, 1.0], 0.285_875_384_850_714_7),
            ([1.0, 1.0, 0.2], 0.690_244_694_073_796_3),
            ([0.5528, 0.5592, 0.5488], 0.203_258_827_669_380_47),
        ] {
            let (there, back) = parallel(sides[0], sides[1], sides[2]);
            assert!((there / expected - 1.0).abs() < 1e-6 && (back / expected - 1.0).abs() < 1e-6, "{sides:?} {there}");
        }
        // C-14: width w (against the shared edge of length l), height h.
        for (w, h, l, expected) in [
            (1.0, 1.0, 1.0, 0.200_043_776_075_403_16),
            (1.0, 2.0, 1.0, 0.232_852_602_795_361_9),
            (0.5, 1.0, 3.0, 0.349_253_956_685_669_56),
        ] {
            let floor = rectangle([0.0; 3], [w, 0.0, 0.0], [0.0, l, 0.0]);
            let wall = rectangle([0.0; 3], [0.0, l, 0.0], [0.0, 0.0, h]);
            let there = polygon_to_polygon(&floor, &wall, 24);
            assert!((there / expected - 1.0).abs() < 1e-4, "w={w} h={h} l={l}: {there}, not {expected}");
            // Reciprocity: A_i F_ij = A_j F_ji.
            let back = polygon_to_polygon(&wall, &floor, 24);
            assert!((w * there / (h * back) - 1.0).abs() < 2e-4);
        }
        let low = rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let high = rectangle([2.0, 0.5, 0.7], [1.0, 0.0, 0.0], [0.0, 1.5, 0.0]);
        assert!((polygon_to_polygon(&low, &high, 8) / 0.011_500_510_726_119_906 - 1.0).abs() < 1e-6);
        let floor = rectangle([1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
        let wall = rectangle([0.0, 2.0, 0.5], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        assert!((polygon_to_polygon(&floor, &wall, 8) / 0.009_326_897_745_561_558 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_closed_cube_sees_itself_only() {
        let face = |corner, u, v| rectangle(corner, u, v);
        let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let floor = face([0.0; 3], x, y);
        let others = [face(z, x, y), face([0.0; 3], x, z), face(y, x, z), face([0.0; 3], y, z), face(x, y, z)];
        let sum: f64 = others.iter().map(|other| polygon_to_polygon(&floor, other, 16)).sum();
        assert!((sum - 1.0).abs() < 1e-4, "{sum}");
    }

    #[test]
    fn point_to_disk_and_to_rectangle() {
        // Coaxial and offset disks in a plane parallel to the element's, and a rectangle with a corner above it.
        for (height, radius, offset, expected) in
            [(1.0, 1.0, 0.0, 0.5), (1.0, 0.5, 0.8, 0.094_122_089_778_804_26), (2.0, 1.0, 3.0, 0.025_658_350_974_743_06)]
        {
            let f = point_to_polygon(DVec3::ZERO, DVec3::Z, &disk(radius, offset, height));
            assert!((f / expected - 1.0).abs() < 1e-6, "{f} {expected}");
        }
        let f = point_to_polygon(DVec3::ZERO, DVec3::Z, &rectangle([0.0, 0.0, 1.5], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]));
        assert!((f / 0.122_359_661_642_333_06 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_horizon_cuts() {
        // A wall that reaches from −1 to 1 counts like its upper half alone.
        let whole = rectangle([1.0, -1.0, -1.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]);
        let upper = rectangle([1.0, -1.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]);
        let (a, b) = (point_to_polygon(DVec3::ZERO, DVec3::Z, &whole), point_to_polygon(DVec3::ZERO, DVec3::Z, &upper));
        assert!((a - b).abs() < 1e-14 && a > 0.05);
        assert_eq!(point_to_polygon(DVec3::ZERO, DVec3::NEG_X, &whole), 0.0);
    }

    #[test]
    fn the_papers_equation_loses_half() {
        // An infinite ceiling takes all that a Lambertian floor emits; eq. (1) of the seed paper gives it one half.
        let far = 1e6;
        let ceiling = rectangle([-far, -far, 1.0], [2.0 * far, 0.0, 0.0], [0.0, 2.0 * far, 0.0]);
        let all = point_to_polygon(DVec3::ZERO, DVec3::Z, &ceiling);
        assert!((all * FormFactor::Lambert.scale() - 1.0).abs() < 1e-6);
        assert!((all * FormFactor::Paper.scale() - 0.5).abs() < 1e-6);
    }

    #[test]
    fn small_elements_agree_with_polygons() {
        let side = 1e-3;
        let small = rectangle([0.3, 0.2, 1.0], [side, 0.0, 0.0], [0.0, side, 0.0]);
        let at = DVec3::new(0.3 + side / 2.0, 0.2 + side / 2.0, 1.0);
        let f = point_to_element(DVec3::ZERO, DVec3::Z, at, DVec3::NEG_Z, side * side);
        assert!((f / point_to_polygon(DVec3::ZERO, DVec3::Z, &small) - 1.0).abs() < 1e-5);
    }
}
