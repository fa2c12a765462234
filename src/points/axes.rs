//! Which way a cloud's axes run: this crate has x to the right, y up and z towards the viewer, others have not.

use super::PointCloud;
use glam::DVec3;
use std::str::FromStr;

/// Which of a file's axes run to the right, up and towards the viewer, each as it is or reversed.
///
/// ```
/// use holodrive::points::Axes;
///
/// // z up, as surveyors have it: what is up is towards +z, and the viewer stands at −y.
/// let axes: Axes = "x,z,-y".parse()?;
/// assert_eq!(axes.turned([1.0, 2.0, 3.0].into()).to_array(), [1.0, 3.0, -2.0]);
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axes([(usize, bool); 3]);

impl Axes {
    /// Of cameras: x right, y down, z away.
    pub const CAMERA: Self = Self([(0, false), (1, true), (2, true)]);

    /// A position in this crate's axes.
    pub fn turned(&self, p: DVec3) -> DVec3 {
        DVec3::from_array(self.0.map(|(axis, reversed)| if reversed { -p[axis] } else { p[axis] }))
    }

    /// Turns all points of a cloud.
    pub fn turn(&self, cloud: &mut PointCloud) {
        cloud.points.iter_mut().for_each(|point| point.position = self.turned(point.position));
    }

    /// Whether left and right are exchanged by it.
    pub fn mirrors(&self) -> bool {
        let [a, b, c] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| self.turned(axis));
        a.cross(b).dot(c) < 0.0
    }
}

impl FromStr for Axes {
    type Err = String;

    /// `x,-y,-z`: the file's axes to the right, up, and towards the viewer.
    fn from_str(text: &str) -> Result<Self, String> {
        let one = |word: &str| {
            let (reversed, name) = match word.trim().strip_prefix('-') {
                Some(name) => (true, name),
                None => (false, word.trim().trim_start_matches('+')),
            };
            ["x", "y", "z"].iter().position(|axis| name.eq_ignore_ascii_case(axis)).map(|axis| (axis, reversed))
        };
        let found: Option<Vec<_>> = text.split(',').map(one).collect();
        match found.as_deref() {
            Some(&[a, b, c]) if a.0 != b.0 && b.0 != c.0 && c.0 != a.0 => Ok(Self([a, b, c])),
            _ => {
                Err(format!("`{text}` are no three axes; write those to the right, up and towards the viewer: x,-y,-z"))
            }
        }
    }
}

impl std::fmt::Display for Axes {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names =
            self.0.map(|(axis, reversed)| format!("{}{}", if reversed { "-" } else { "" }, ["x", "y", "z"][axis]));
        write!(out, "{} right, {} up, {} towards the viewer", names[0], names[1], names[2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_read_and_turn() {
        let camera: Axes = "x,-y, -Z".parse().expect("axes");
        assert_eq!(camera, Axes::CAMERA);
        assert_eq!(camera.turned(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(1.0, -2.0, -3.0));
        assert!(!camera.mirrors() && "x,y,-z".parse::<Axes>().is_ok_and(|axes| axes.mirrors()));
        assert_eq!(camera.to_string(), "x right, -y up, -z towards the viewer");
        for wrong in ["", "x,y", "x,x,z", "x,y,w", "x,y,z,x"] {
            assert!(wrong.parse::<Axes>().is_err(), "{wrong}");
        }
    }
}
