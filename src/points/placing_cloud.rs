//! Where a point cloud of another program stands before the panel: a similarity transform, or a window.

use super::placement::fitted_scale;
use super::{Placement, PointCloud};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::units::show_length;
use glam::{DVec2, DVec3};

/// What was done with a cloud.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedCloud {
    /// The viewer's eye in the hologram frame [m].
    pub eye: DVec3,
    /// Half width and half height of the viewing window on the panel plane [m].
    pub window: DVec2,
    /// Metres at the panel for one unit of the file, across.
    pub scale: f64,
    /// What stood in the file where the middle is now.
    pub middle: DVec3,
    /// Lowest and highest depth z now [m].
    pub depth: [f64; 2],
    is_model: bool,
}

impl std::fmt::Display for PlacedCloud {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [far, near] = self.depth.map(show_length);
        let kind = if self.is_model { "model" } else { "window" };
        // Seven digits are enough to find the place in the file.
        let [x, y, z] = self.middle.to_array().map(|v| format!("{v:.6e}").parse::<f64>().unwrap_or(v));
        write!(
            out,
            "as a {kind}: {:.6e} m for a unit of the file, {x}, {y}, {z} in the middle, z {far} … {near}",
            self.scale
        )
    }
}

impl Placement {
    /// Moves a cloud whose positions stand in units of its own, +x right, +y up, +z to the viewer.
    ///
    /// *Model*: its box's middle comes onto the axis at depth z, by one scale along all axes, or the largest at which it fits
    /// the view. *Window*: it is seen from the front as by parallel rays and fills the panel as seen by the eye; its depths
    /// run linearly from `far` to `near`. Amplitudes and phases are kept.
    ///
    /// # Errors
    /// [`Error::Parameter`] for an eye that is not before all points, an inverted range, and a cloud without extent where
    /// none is given a scale.
    pub fn place_cloud(&self, cloud: &mut PointCloud, panel: &Grid) -> Result<PlacedCloud> {
        let first = cloud.points.first().map_or(DVec3::ZERO, |p| p.position);
        let (low, high) =
            cloud.points.iter().fold((first, first), |(low, high), p| (low.min(p.position), high.max(p.position)));
        // The sum of both may pass what is finite.
        let (middle, half) = (low + 0.5 * (high - low), 0.5 * (high - low));
        if !(middle.is_finite() && half.is_finite()) {
            return Err(Error::parameter("placement", "the points stand too far from each other"));
        }
        let window = 0.5 * DVec2::new(panel.extent_x(), panel.extent_y());
        let before = |eye: f64, frontmost: f64| {
            if eye.is_finite() && eye > 0.0 && eye > frontmost {
                return Ok(DVec3::new(0.0, 0.0, eye));
            }
            let what =
                format!("the eye at {eye} m must stand in front of the panel and of the points at {frontmost} m");
            Err(Error::parameter("eye", what))
        };
        match *self {
            Self::Model { eye, z, scale } => {
                let scale = match scale {
                    Some(scale) if scale.is_finite() && scale > 0.0 => scale,
                    Some(scale) => return Err(Error::out_of_range("scale", scale, "must be greater than zero")),
                    None => fitted_scale(window, half, eye, z)?,
                };
                let eye = before(eye, z + scale * half.z)?;
                for point in &mut cloud.points {
                    point.position = scale * (point.position - middle) + DVec3::new(0.0, 0.0, z);
                }
                let depth = [z - scale * half.z, z + scale * half.z];
                Ok(PlacedCloud { eye, window, scale, middle, depth, is_model: true })
            }
            Self::Window { eye, near, far } => {
                if !(near.is_finite() && far.is_finite() && far <= near) {
                    let what = format!("near {near} m and far {far} m (z): far must be at or behind near");
                    return Err(Error::parameter("near/far", what));
                }
                let eye = before(eye, near)?;
                let scale = 0.95 * (window.x / half.x).min(window.y / half.y);
                if !(scale.is_finite() && scale > 0.0) {
                    let what =
                        "the points have no extent across the view, so they fill no window; place them as a model";
                    return Err(Error::parameter("placement", what));
                }
                for point in &mut cloud.points {
                    let p = point.position - middle;
                    let part = if half.z > 0.0 { 0.5 * (1.0 + p.z / half.z) } else { 1.0 };
                    let z = far + part * (near - far);
                    let spread = scale * (eye.z - z) / eye.z;
                    point.position = DVec3::new(spread * p.x, spread * p.y, z);
                }
                Ok(PlacedCloud { eye, window, scale, middle, depth: [far, near], is_model: false })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::{PointSource, Reach};

    /// A letter L in units of its own: long stroke left, foot to the lower right, nearer at the top.
    fn letter(scale: f64, middle: DVec3) -> PointCloud {
        let stroke = (0..20).map(|i| DVec3::new(-0.3, -0.5 + f64::from(i) / 19.0, 0.1 * f64::from(i) / 19.0));
        let foot = (1..10).map(|i| DVec3::new(-0.3 + 0.06 * f64::from(i), -0.5, 0.0));
        let point = |p: DVec3| PointSource { position: middle + scale * p, amplitude: 1.0, phase: 0.0 };
        PointCloud { points: stroke.chain(foot).map(point).collect(), rgb: None }
    }

    #[test]
    fn clouds_of_any_unit_come_before_the_panel_upright() {
        let panel = Grid::new(1920, 1080, 8e-6, 8e-6).expect("panel");
        for (unit, middle) in
            [(1.0, DVec3::ZERO), (100.0, DVec3::new(0.0, 0.0, 500.0)), (10.0, DVec3::new(5e5, 5.4e6, 301.0))]
        {
            let mut cloud = letter(unit, middle);
            assert_eq!(Reach::of(&cloud, &panel, 532e-9).reaching, 0, "{unit}");
            let model = Placement::Model { eye: 0.6, z: -0.15, scale: None };
            let placed = model.place_cloud(&mut cloud, &panel).expect("placed");
            let depth = cloud.depth_range().expect("points");
            assert!((0.5 * (depth.0 + depth.1) + 0.15).abs() < 1e-9 && depth.1 > depth.0, "{depth:?}");
            assert!((placed.depth[0] - depth.0).abs() < 1e-9);
            assert_eq!(Reach::of(&cloud, &panel, 532e-9).reaching, 29);
            let (top, bottom, foot) = (cloud.points[19].position, cloud.points[0].position, cloud.points[28].position);
            assert!(top.y > 2e-3 && bottom.y < -2e-3 && (top.x - bottom.x).abs() < 1e-9 && top.z > bottom.z);
            assert!(foot.x > bottom.x + 2e-3 && (foot.y - bottom.y).abs() < 1e-9);
            // As large as the view takes: the height decides.
            assert!(top.y > 0.9 * 0.5 * 1080.0 * 8e-6, "{}", top.y);

            let mut cloud = letter(unit, middle);
            let window = Placement::Window { eye: 0.6, near: 0.01, far: -0.02 };
            window.place_cloud(&mut cloud, &panel).expect("placed");
            let (far, near) = cloud.depth_range().expect("points");
            assert!((far + 0.02).abs() < 1e-12 && (near - 0.01).abs() < 1e-12);
            assert!(cloud.points[19].position.y > 0.0 && cloud.points[28].position.x > 0.0);
        }
        let mut cloud = letter(100.0, DVec3::ZERO);
        let exact = Placement::Model { eye: 0.6, z: 0.05, scale: Some(1e-3) };
        assert_eq!(exact.place_cloud(&mut cloud, &panel).expect("placed").scale, 1e-3);
        assert!((cloud.points[19].position.y - 0.05).abs() < 1e-12);
    }

    #[test]
    fn what_cannot_be_placed_is_refused() {
        let panel = Grid::new(1920, 1080, 8e-6, 8e-6).expect("panel");
        let refused = |placement: Placement, cloud: &mut PointCloud| placement.place_cloud(cloud, &panel).unwrap_err();
        let mut one = letter(1.0, DVec3::ZERO);
        one.points.truncate(1);
        for placement in [
            Placement::Model { eye: 0.6, z: -0.15, scale: None },
            Placement::Window { eye: 0.6, near: -0.1, far: -0.15 },
        ] {
            assert!(refused(placement, &mut one).to_string().contains("extent"));
        }
        let mut cloud = letter(1.0, DVec3::ZERO);
        for (placement, word) in [
            (Placement::Model { eye: 0.6, z: -0.15, scale: Some(-1.0) }, "greater than zero"),
            (Placement::Model { eye: 0.6, z: 0.5, scale: Some(3.0) }, "in front of"),
            (Placement::Window { eye: 0.6, near: -0.2, far: -0.15 }, "far must be"),
        ] {
            let said = refused(placement, &mut cloud).to_string();
            assert!(said.contains(word), "{said}");
        }
    }
}
