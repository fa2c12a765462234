//! A soft studio: what lights a scene that has no light of its own.

use super::Environment;
use super::dome::Map;
use crate::error::Result;
use crate::scene::Camera;
use glam::{DVec3, Vec3};

/// Columns and rows.
const SIZE: [usize; 2] = [512, 256];

/// Radiance of the dome straight down and straight up [W/(m² sr)].
const DOME: [f64; 2] = [0.12, 0.5];

/// Width of a soft box' edge, over its distance.
const EDGE: f64 = 0.08;

/// A rectangle that shines, with soft edges.
struct SoftBox {
    /// To its middle, in the axes of a level camera that looks along −z.
    towards: DVec3,
    /// Half its width and height, over its distance.
    half: [f64; 2],
    /// [W/(m² sr)]
    radiance: f64,
}

/// A large one at the viewer's upper left, a tall one on the right, and one behind the scene that draws its upper edge.
const BOXES: [SoftBox; 3] = [
    SoftBox { towards: DVec3::new(-0.5, 0.8, 0.6), half: [0.5, 0.38], radiance: 4.5 },
    SoftBox { towards: DVec3::new(0.95, 0.25, 0.35), half: [0.14, 0.6], radiance: 2.6 },
    SoftBox { towards: DVec3::new(0.35, 0.75, -0.8), half: [0.5, 0.12], radiance: 3.2 },
];

impl Environment {
    /// A dome that is brighter above than below, with three soft boxes, which stands upright in the world and faces as the
    /// camera does: a white surface that looks to the viewer's upper left has a radiance of about 1 W/(m² sr).
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] for a camera whose axes are not finite.
    pub fn studio(camera: &Camera) -> Result<Self> {
        let axis = |a: DVec3| camera.world_from_camera.transform_vector3(a);
        let [forward, up] = [axis(DVec3::NEG_Z), axis(DVec3::Y)];
        let level = |v: DVec3| DVec3::new(v.x, 0.0, v.z);
        // One that looks straight up or down faces where the edge of its picture that is farther away is.
        let faced = if level(forward).length() > 1e-3 { level(forward) } else { level(up) * -forward.y.signum() };
        let map = Map { width: SIZE[0], height: SIZE[1], texels: Vec::new() };
        let directions = (0..SIZE[0] * SIZE[1]).map(|i| map.direction(i % SIZE[0], i / SIZE[0]));
        let texels = directions.map(|d| Vec3::splat(radiance(d) as f32)).collect();
        Self::new(SIZE[0], SIZE[1], texels, faced.x.atan2(-faced.z))
    }
}

fn radiance(direction: DVec3) -> f64 {
    let [low, high] = DOME;
    let boxes = BOXES.iter().map(|lamp| lamp.radiance * lamp.part(direction)).sum::<f64>();
    low + (high - low) * smooth(0.5 * (direction.y + 1.0)) + boxes
}

impl SoftBox {
    /// What part of it is seen in a direction: one inside, zero outside.
    fn part(&self, direction: DVec3) -> f64 {
        let towards = self.towards.normalize();
        let depth = direction.dot(towards);
        if depth <= 0.0 {
            return 0.0;
        }
        let across = DVec3::Y.cross(towards).normalize();
        let up = towards.cross(across);
        let within = |axis: DVec3, half: f64| {
            let beyond = (direction.dot(axis) / depth).abs() - half;
            smooth(0.5 - beyond / EDGE)
        };
        within(across, self.half[0]) * within(up, self.half[1])
    }
}

/// From 0 to 1 without a kink.
fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_key_stands_at_the_upper_left_of_any_camera() {
        let eyes = [DVec3::Z, DVec3::X, DVec3::new(-1.0, 0.4, -0.3), DVec3::new(0.0, 1.0, 1e-9)];
        for eye in eyes.map(|eye| eye * 3.0) {
            let camera = Camera::looking_at(eye, DVec3::ZERO, 0.8);
            let around = Environment::studio(&camera).expect("studio");
            let axis = |a: DVec3| camera.world_from_camera.transform_vector3(a);
            // Level axes: to the right, and back to the viewer.
            let right = axis(DVec3::X).with_y(0.0).normalize();
            let back = right.cross(DVec3::Y);
            let key = (right * -0.5 + DVec3::Y * 0.8 + back * 0.6).normalize();
            let aside = (right * 0.5 + DVec3::Y * 0.8 + back * 0.6).normalize();
            assert!(around.radiance(key).x > 4.5 && around.radiance(aside).x < 1.0, "{eye}: {}", around.radiance(key));
            assert!(around.suns().is_empty() && around.bright().is_some());
        }
    }

    #[test]
    fn a_white_surface_is_about_as_bright_as_white() {
        let camera = Camera::looking_at(DVec3::Z, DVec3::ZERO, 0.8);
        let around = Environment::studio(&camera).expect("studio");
        let (columns, rows) = (256, 128);
        let map = Map { width: columns, height: rows, texels: Vec::new() };
        let shown = |normal: DVec3| {
            let part = |i: usize| {
                let d = map.direction(i % columns, i / columns);
                f64::from(around.radiance(d).x) * d.dot(normal).max(0.0) * map.solid_angle(i / columns)
            };
            (0..columns * rows).map(part).sum::<f64>() / std::f64::consts::PI
        };
        let key = shown(DVec3::new(-0.5, 0.8, 0.6).normalize());
        assert!((0.9..1.6).contains(&key), "{key}");
        // Nothing is black, and what faces the viewer is between.
        let (below, facing) = (shown(DVec3::NEG_Y), shown(DVec3::Z));
        assert!(below > 0.12 && below < 0.5 * key && facing > 0.4 && facing < key, "{below} {facing} {key}");
    }
}
