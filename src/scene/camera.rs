//! Cameras: glTF perspective and orthographic, as rays.

use super::bvh::Ray;
use glam::{DMat3, DMat4, DVec3};

/// How a camera projects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// A pinhole.
    Perspective {
        /// Full vertical angle of view [rad].
        yfov: f64,
        /// Width over height; `None` leaves it to the picture.
        aspect: Option<f64>,
    },
    /// Parallel rays.
    Orthographic {
        /// Half width of the picture [m].
        xmag: f64,
        /// Half height of the picture [m].
        ymag: f64,
    },
}

/// A camera that looks along its own −z with +y up.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file.
    pub name: String,
    /// Camera space to world space; rigid, without scale.
    pub world_from_camera: DMat4,
    /// How it projects.
    pub projection: Projection,
    /// How far before the pinhole its rays begin, to pass through it [m]: lines of sight of a viewer who looks through a
    /// place of a plate. 0 for a camera.
    pub before: f64,
}

impl Camera {
    /// Position of the pinhole (or of the picture plane's middle) in the world [m].
    pub fn eye(&self) -> DVec3 {
        self.world_from_camera.w_axis.truncate()
    }
    /// Half width and half height of the picture on the plane at distance 1 m (perspective) or anywhere
    /// (orthographic) [m]. A picture whose shape is not the camera's keeps the height of the view, and is never squeezed.
    pub fn half_size(&self, picture_aspect: f64) -> (f64, f64) {
        let half_height = match self.projection {
            Projection::Perspective { yfov, .. } => (0.5 * yfov).tan(),
            Projection::Orthographic { ymag, .. } => ymag,
        };
        (half_height * picture_aspect, half_height)
    }
    /// Width over height of the picture that the camera asks for; `None` leaves it to the picture.
    pub fn aspect(&self) -> Option<f64> {
        match self.projection {
            Projection::Perspective { aspect, .. } => aspect,
            Projection::Orthographic { xmag, ymag } => Some(xmag / ymag),
        }
    }
    /// Ray through the picture at (u, v) ∈ [0, 1]², u to the right, v downwards (row 0 on top). Unit direction.
    pub fn ray(&self, u: f64, v: f64, picture_aspect: f64) -> Ray {
        let (half_width, half_height) = self.half_size(picture_aspect);
        let (x, y) = ((2.0 * u - 1.0) * half_width, (1.0 - 2.0 * v) * half_height);
        let (origin, direction) = match self.projection {
            Projection::Perspective { .. } => (DVec3::ZERO, DVec3::new(x, y, -1.0)),
            Projection::Orthographic { .. } => (DVec3::new(x, y, 0.0), DVec3::NEG_Z),
        };
        let direction = self.world_from_camera.transform_vector3(direction).normalize();
        Ray { origin: self.world_from_camera.transform_point3(origin) - self.before * direction, direction }
    }
    /// A perspective camera at `eye` that looks at `target` with +y up.
    pub fn looking_at(eye: DVec3, target: DVec3, yfov: f64) -> Self {
        let back = (eye - target).normalize_or(DVec3::Z);
        let up = if back.y.abs() > 0.999 { DVec3::Z } else { DVec3::Y };
        let right = up.cross(back).normalize();
        let axes = DMat3::from_cols(right, back.cross(right), back);
        Self {
            name: String::new(),
            world_from_camera: DMat4::from_mat3_translation(axes, eye),
            projection: Projection::Perspective { yfov, aspect: None },
            before: 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_of_the_picture_are_where_they_should_be() {
        let camera = Camera::looking_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, std::f64::consts::FRAC_PI_2);
        let top_left = camera.ray(0.0, 0.0, 2.0);
        let expected = DVec3::new(-2.0, 1.0, -1.0).normalize();
        assert!((top_left.direction - expected).length() < 1e-12);
        assert!((camera.ray(0.5, 0.5, 2.0).direction - DVec3::NEG_Z).length() < 1e-12);
        let mut parallel = camera.clone();
        parallel.projection = Projection::Orthographic { xmag: 3.0, ymag: 2.0 };
        assert_eq!(parallel.aspect(), Some(1.5));
        let top_left = parallel.ray(0.0, 0.0, 1.5);
        assert!((top_left.origin - DVec3::new(-3.0, 2.0, 5.0)).length() < 1e-12);
        assert!((top_left.direction - DVec3::NEG_Z).length() < 1e-12);
    }
}
