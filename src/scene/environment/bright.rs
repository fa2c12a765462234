//! What is brighter than most of a map, and what of it would arrive where nothing stands in its way.

use super::dome::{Dome, Drawn, Map, turned};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::FRAC_1_PI;

/// Columns and rows of the normals for which it is known: what the cosine law leaves of a map has no finer detail.
const NORMALS: [usize; 2] = [64, 32];

/// Columns and rows of what is summed for them.
const SUMMED: [usize; 2] = [128, 64];

/// Lamps of an environment: directions to draw, and the light of all of them together.
#[derive(Clone, Debug)]
pub(crate) struct Bright {
    dome: Dome,
    /// Irradiance over π by normal.
    unhindered: Map,
    turn: f64,
}

impl Bright {
    /// A map that is turned about +y by `turn` [rad], from +x towards +z.
    pub(super) fn new(map: Map, turn: f64) -> Self {
        let unhindered = unhindered(&map.coarser(SUMMED));
        Self { dome: Dome::new(map, turn), unhindered, turn }
    }

    /// As [`Dome::drawn`].
    pub(crate) fn drawn(&self, place: [f64; 2]) -> Drawn {
        self.dome.drawn(place)
    }

    /// Irradiance over π of a surface with this unit normal where nothing stands in the way [W/(m² sr)].
    pub(crate) fn unhindered(&self, normal: DVec3) -> Vec3 {
        self.unhindered.at(turned(normal, -self.turn))
    }
}

fn unhindered(map: &Map) -> Map {
    let [width, height] = NORMALS;
    let normals = Map { width, height, texels: Vec::new() };
    let lamps: Vec<(DVec3, Vec3)> = (0..map.texels.len())
        .filter(|&i| map.texels[i].max_element() > 0.0)
        .map(|i| {
            let (column, row) = (i % map.width, i / map.width);
            (map.direction(column, row), map.texels[i] * (map.solid_angle(row) * FRAC_1_PI) as f32)
        })
        .collect();
    let sum = |i: usize| {
        let normal = normals.direction(i % width, i / width);
        lamps.iter().map(|(towards, light)| *light * towards.dot(normal).max(0.0) as f32).sum()
    };
    Map { texels: (0..width * height).into_par_iter().map(sum).collect(), ..normals }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn a_round_lamp_lights_by_the_cosine_law() {
        let (width, height) = (512, 256);
        let map = Map { width, height, texels: Vec::new() };
        let (towards, half) = (DVec3::new(0.4, 0.5, -0.7).normalize(), 0.25f64);
        let texel =
            |i: usize| Vec3::splat(f32::from(map.direction(i % width, i / width).dot(towards) > half.cos()) * 3.0);
        let map = Map { texels: (0..width * height).map(texel).collect(), ..map };
        let bright = Bright::new(map, 0.7);
        let world = turned(towards, 0.7);
        let side = world.any_orthonormal_vector();
        for angle in [0.0f64, 0.4, 1.0, 1.25] {
            let normal = world * angle.cos() + side * angle.sin();
            // Wholly above the horizon: L sin²(half) cos θ.
            let exact = 3.0 * half.sin().powi(2) * angle.cos();
            let found = f64::from(bright.unhindered(normal).x);
            assert!((found - exact).abs() < 0.004, "{angle}: {found} {exact}");
        }
        assert!(bright.unhindered(-world).x < 1e-6);
        // Directions are drawn in it alone.
        let drawn = bright.drawn([0.3, 0.6]);
        assert!(drawn.direction.dot(world) > half.cos() - 0.02 && drawn.density > 0.9 / (PI * half * half));
    }
}
