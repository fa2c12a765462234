//! Points of the world, placed: where they stand before the panel, how bright, with which phase.

use super::placement::{Phase, Placing, WorldPoint};
use super::{Channel, PointCloud, PointSource};
use crate::field::Grid;
use glam::DVec2;

/// Points in the hologram frame with what the panel can do with them.
#[derive(Clone, Debug, Default)]
pub struct Placed {
    /// The points, coloured, in the order of the world points.
    pub cloud: PointCloud,
    /// Points whose light the panel cannot send to the eye: sin of the angle beyond λ/2p.
    pub beyond_cone: usize,
    /// Their part of the light (0 to 1).
    pub beyond_cone_light: f64,
}

/// Carries traced points into the hologram frame: position, amplitude √radiance × distance from the eye, phase.
///
/// The grid and wavelength say which directions the panel reaches; points beyond are kept and counted.
pub fn place(points: &[WorldPoint], placing: &Placing, phase: Phase, panel: &Grid, wavelength: f64) -> Placed {
    let positions = placing.positions(points);
    let mut placed = Placed::default();
    let (mut all_light, mut lost_light) = (0.0, 0.0);
    let mut rgb = Vec::with_capacity(points.len());
    let sine_limit = wavelength * DVec2::new(panel.limit_x(), panel.limit_y());
    for (index, (point, position)) in points.iter().zip(positions).enumerate() {
        let to_eye = placing.eye - position;
        let distance = to_eye.length();
        let light = f64::from(Channel::Luminance.of(point.radiance));
        all_light += light;
        if to_eye.x.abs() > sine_limit.x * distance || to_eye.y.abs() > sine_limit.y * distance {
            placed.beyond_cone += 1;
            lost_light += light;
        }
        let amplitude = |radiance: f32| (f64::from(radiance.max(0.0)).sqrt() * distance) as f32;
        rgb.push(point.radiance.map(amplitude));
        placed.cloud.points.push(PointSource {
            position,
            amplitude: amplitude(Channel::Luminance.of(point.radiance)),
            phase: phase.of(index, distance, wavelength),
        });
    }
    placed.cloud.rgb = Some(rgb);
    placed.beyond_cone_light = if all_light > 0.0 { lost_light / all_light } else { 0.0 };
    placed
}
