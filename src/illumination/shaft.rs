//! Shafts: whether anything at all stands between a piece of a surface and a lamp.
//!
//! The shaft of two convex polygons is their convex hull. If no other triangle reaches into it, every point of the one
//! sees every point of the other and no shadow ray need be cast: most of a lit room. The test is one-sided: it may find a
//! shaft not clear that is (Haines & Wallace 1991), never the other way round.

use crate::scene::bvh::SceneBvh;
use glam::DVec3;

/// A convex region, as the half spaces that bound it: inside where normal·p ≤ limit.
pub(crate) struct Shaft {
    planes: Vec<(DVec3, f64)>,
}

impl Shaft {
    /// Between a flat piece of a surface that looks along `facing` and a lamp that looks along `shining`; `None` if one
    /// of them reaches behind the other. What lies no more than `tolerance` inside does not count [m].
    pub(crate) fn new(piece: &[DVec3], facing: DVec3, lamp: &[DVec3], shining: DVec3, tolerance: f64) -> Option<Self> {
        let (here, there) = (*piece.first()?, *lamp.first()?);
        let in_front = lamp.iter().all(|p| (*p - here).dot(facing) > tolerance)
            && piece.iter().all(|p| (*p - there).dot(shining) > tolerance);
        if !in_front {
            return None;
        }
        // What touches the two planes from behind stands in nobody's way.
        let mut planes = vec![(-facing, -facing.dot(here) - tolerance), (-shining, -shining.dot(there) - tolerance)];
        let mut beside = |edges: &[DVec3], others: &[DVec3]| {
            for (i, &a) in edges.iter().enumerate() {
                let b = edges[(i + 1) % edges.len()];
                for &c in others {
                    let normal = (b - a).cross(c - a).normalize_or_zero();
                    if normal == DVec3::ZERO {
                        continue;
                    }
                    let all = edges.iter().chain(others).map(|p| normal.dot(*p - a));
                    let (low, high) = all.fold((0.0f64, 0.0f64), |(l, h), x| (l.min(x), h.max(x)));
                    if high <= tolerance {
                        planes.push((normal, normal.dot(a) - tolerance));
                    } else if low >= -tolerance {
                        planes.push((-normal, -normal.dot(a) - tolerance));
                    }
                }
            }
        };
        beside(piece, lamp);
        beside(lamp, piece);
        Some(Self { planes })
    }

    /// Whether no triangle reaches into it.
    pub(crate) fn is_clear(&self, bvh: &SceneBvh) -> bool {
        let misses_box = |low: DVec3, high: DVec3| {
            self.planes.iter().any(|(normal, limit)| {
                let nearest = DVec3::select(normal.cmplt(DVec3::ZERO), high, low);
                normal.dot(nearest) >= *limit
            })
        };
        let reaches_in = |triangle: u32| {
            let corners = bvh.scene().triangles[triangle as usize].corners();
            !self.planes.iter().any(|(normal, limit)| corners.iter().all(|p| normal.dot(*p) >= *limit))
        };
        !bvh.any_triangle(|low, high| !misses_box(low, high), reaches_in)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::illumination::test_rooms::Room;
    use crate::random::Random;
    use crate::scene::Material;
    use glam::Vec3;

    #[test]
    fn clear_shafts_let_every_ray_pass() {
        let mut random = Random::new(11, 0);
        let (mut clear, mut blocked) = (0, 0);
        for _ in 0..300 {
            let mut draw = |scale: f64| DVec3::from_array(std::array::from_fn(|_| (random.uniform() - 0.5) * scale));
            let mut room = Room::default();
            let m = room.material(Material::diffuse(Vec3::ONE));
            let piece = [DVec3::ZERO, DVec3::X + draw(0.3), DVec3::Y + draw(0.3)];
            let lamp: Vec<DVec3> = [DVec3::Z * 2.0 + draw(0.5), draw(1.0), draw(1.0)].to_vec();
            let lamp = [lamp[0], lamp[0] + lamp[1], lamp[0] + lamp[2]];
            let obstacle = DVec3::Z + draw(2.0);
            room.face([obstacle, obstacle + draw(1.5), obstacle + draw(1.5)], m);
            let facing = (piece[1] - piece[0]).cross(piece[2] - piece[0]).normalize();
            let shining = (lamp[1] - lamp[0]).cross(lamp[2] - lamp[0]).normalize();
            let shining = if shining.dot(piece[0] - lamp[0]) > 0.0 { shining } else { -shining };
            let bvh = SceneBvh::new(room.scene.clone());
            let Some(shaft) = Shaft::new(&piece, facing, &lamp, shining, 1e-9) else { continue };
            let mut hidden = 0;
            for _ in 0..2000 {
                let mut on = |t: [DVec3; 3]| {
                    let (u, v) = super::super::sampling::triangle_weights(random.uniform(), random.uniform());
                    t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v
                };
                hidden += u32::from(bvh.occluded(on(piece), on(lamp)));
            }
            if shaft.is_clear(&bvh) {
                clear += 1;
                assert_eq!(hidden, 0, "rays are stopped in a clear shaft");
            } else {
                blocked += u32::from(hidden > 0);
            }
        }
        // The test must find both, or it says nothing.
        assert!(clear > 20 && blocked > 20, "{clear} clear, {blocked} blocked");
    }
}
