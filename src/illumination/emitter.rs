//! One emitting polygon, and points and pieces of it.

use super::form_factor::point_to_polygon;
use super::sampling::triangle_weights;
use super::surface::{ShadingPoint, Surface};
use crate::scene::{Hit, Scene};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// Halvings of a near emitter's sides: pieces of 1/32 of its size.
const MOST_CUTS: u32 = 5;
/// Weights of corner 1 and the last one at the corners that span an emitter.
const UNIT_TRIANGLE: [[f64; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];

/// Part of an emitter: a triangle or parallelogram in its weights, spanned by three corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    corners: [[f64; 2]; 3],
    /// Form factor from the point that is lit.
    pub(super) factor: f64,
}

/// A point of an emitter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EmitterPoint {
    /// Where [m].
    pub(crate) position: DVec3,
    /// Weights of corner 1 and the last one.
    pub(crate) weights: [f64; 2],
}

/// A convex emitting polygon: a triangle, or two that make a parallelogram.
#[derive(Clone, Debug)]
pub(crate) struct Emitter {
    /// Corners in order [m].
    pub(crate) corners: Vec<DVec3>,
    /// Unit normal.
    pub(crate) normal: DVec3,
    /// Area of one side [m²].
    pub(crate) area: f64,
    /// Radiance, averaged over the polygon.
    pub(crate) mean_radiance: Vec3,
    pub(crate) two_sided: bool,
    /// The triangle to look the emission up in, where it is not the same everywhere.
    pub(super) textured: Option<u32>,
}

impl Emitter {
    /// Flux [W], all sides.
    pub(crate) fn flux(&self) -> Vec3 {
        self.mean_radiance * (self.area_of_sides() * PI) as f32
    }

    /// Flux of all sides and colours [W].
    pub(crate) fn power(&self) -> f64 {
        f64::from(self.flux().element_sum())
    }

    /// Area of all sides that shine [m²].
    pub(crate) fn area_of_sides(&self) -> f64 {
        if self.two_sided { 2.0 * self.area } else { self.area }
    }

    /// A point of the polygon from the unit square, uniform in area.
    pub(crate) fn point(&self, u: f64, v: f64) -> EmitterPoint {
        self.within(&Piece { corners: UNIT_TRIANGLE, factor: 1.0 }, u, v)
    }

    fn is_parallelogram(&self) -> bool {
        self.corners.len() == 4
    }

    /// The point with weights of corner 1 and the last one.
    fn at(&self, [s, t]: [f64; 2]) -> DVec3 {
        let (origin, last) = (self.corners[0], self.corners[self.corners.len() - 1]);
        origin + (self.corners[1] - origin) * s + (last - origin) * t
    }

    /// A point of a piece from the unit square, uniform in area.
    pub(super) fn within(&self, piece: &Piece, u: f64, v: f64) -> EmitterPoint {
        let (s, t) = if self.is_parallelogram() { (u, v) } else { triangle_weights(u, v) };
        let [o, a, b] = piece.corners;
        let weights = std::array::from_fn(|k| o[k] + (a[k] - o[k]) * s + (b[k] - o[k]) * t);
        EmitterPoint { position: self.at(weights), weights }
    }

    /// Cuts the polygon until no piece is larger than it is far, so that all of a piece counts about equally.
    pub(super) fn pieces(&self, from: ShadingPoint, factor: f64) -> Vec<Piece> {
        let ShadingPoint { position: point, normal } = from;
        let mut pieces = vec![Piece { corners: UNIT_TRIANGLE, factor }];
        let reach = |piece: &Piece| {
            let [o, a, b] = piece.corners.map(|w| self.at(w));
            let middle = if self.is_parallelogram() { (a + b) * 0.5 } else { (o + a + b) / 3.0 };
            ((a - o).length_squared().max((b - o).length_squared()), (middle - point).length_squared())
        };
        for _ in 0..MOST_CUTS {
            if pieces.iter().all(|piece| reach(piece).0 <= reach(piece).1) {
                break;
            }
            let mut finer = Vec::with_capacity(4 * pieces.len());
            for piece in pieces {
                let (size, distance) = reach(&piece);
                if size <= distance {
                    finer.push(piece);
                    continue;
                }
                for corners in self.quarters(piece.corners) {
                    let mut outline = corners.map(|w| self.at(w)).to_vec();
                    if self.is_parallelogram() {
                        outline.insert(2, outline[1] + outline[2] - outline[0]);
                    }
                    let factor = point_to_polygon(point, normal, &outline);
                    if factor > 0.0 {
                        finer.push(Piece { corners, factor });
                    }
                }
            }
            pieces = finer;
        }
        pieces
    }

    fn quarters(&self, [o, a, b]: [[f64; 2]; 3]) -> [[[f64; 2]; 3]; 4] {
        let half = |p: [f64; 2], q: [f64; 2]| [(p[0] + q[0]) * 0.5, (p[1] + q[1]) * 0.5];
        let (oa, ob, ab) = (half(o, a), half(o, b), half(a, b));
        if self.is_parallelogram() {
            let shift = |p: [f64; 2], by: [f64; 2]| [p[0] + by[0] - o[0], p[1] + by[1] - o[1]];
            [[o, oa, ob], [oa, a, shift(oa, ob)], [ob, shift(oa, ob), b], [ab, shift(a, ob), shift(b, oa)]]
        } else {
            [[o, oa, ob], [oa, a, ab], [ob, ab, b], [ab, ob, oa]]
        }
    }

    /// Radiance at a point of the polygon.
    pub(crate) fn radiance_at(&self, scene: &Scene, position: DVec3) -> Vec3 {
        if self.textured.is_none() {
            return self.mean_radiance;
        }
        let (origin, last) = (self.corners[0], self.corners[self.corners.len() - 1]);
        let (u, v, p) = (self.corners[1] - origin, last - origin, position - origin);
        let cross = u.cross(v);
        let weights =
            [p.cross(v).dot(cross), u.cross(p).dot(cross)].map(|w| (w / cross.length_squared()).clamp(0.0, 1.0));
        self.radiance(scene, EmitterPoint { position, weights })
    }

    /// Radiance at a point with known weights.
    pub(crate) fn radiance(&self, scene: &Scene, at: EmitterPoint) -> Vec3 {
        let Some(triangle) = self.textured else { return self.mean_radiance };
        let EmitterPoint { position, weights } = at;
        let hit = Hit { triangle, distance: 0.0, position, barycentric: weights, front: true };
        Surface::at(scene, &hit, 0.0).emission
    }
}
