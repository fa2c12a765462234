//! A light field's middle view as points of light.

use super::LightField;
use crate::points::placement::Phase;
use crate::points::{PointCloud, PointSource};
use glam::DVec3;

impl LightField {
    /// What the middle view sees, as points where they stand: each pixel with light and a depth is one, with amplitude √radiance ×
    /// distance from the eye, and phases as a placement gives them for a wavelength [m]. Of colours it is the luminance, and the
    /// points keep the colours. Without depths ([`LightField::middle_depths`]) there are none.
    pub fn middle_cloud(&self, phase: Phase, wavelength: f64) -> PointCloud {
        let middle = self.middle();
        let eye = self.eyes.position(middle);
        let mut cloud = PointCloud { points: Vec::new(), rgb: (self.channels.len() == 3).then(Vec::new) };
        for (pixel, &z) in self.middle_depths.iter().flatten().enumerate() {
            let radiances: Vec<f32> =
                (0..self.channels.len()).map(|c| self.radiance(self.view(c, middle)[pixel])).collect();
            let light = match radiances[..] {
                [r, g, b] => crate::points::Channel::Luminance.of([r, g, b]),
                _ => radiances[0],
            };
            if !z.is_finite() || light <= 0.0 {
                continue;
            }
            let (x, y) = (self.window.x(pixel % self.window.width), self.window.y(pixel / self.window.width));
            let position = eye + (DVec3::new(x, y, 0.0) - eye) * ((eye.z - f64::from(z)) / eye.z);
            let distance = (eye - position).length();
            let amplitude = |radiance: f32| (f64::from(radiance).sqrt() * distance) as f32;
            let phase = phase.of(cloud.points.len(), distance, wavelength);
            if let (Some(rgb), &[r, g, b]) = (&mut cloud.rgb, radiances.as_slice()) {
                rgb.push([r, g, b].map(amplitude));
            }
            cloud.points.push(PointSource { position, amplitude: amplitude(light), phase });
        }
        cloud
    }
}
