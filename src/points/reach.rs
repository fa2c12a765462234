//! Which points of a cloud a panel can show at all.

use super::PointCloud;
use crate::field::Grid;
use crate::units::{show_length, show_pitch};

/// How many points have some of the panel in the cone that it takes light from.
///
/// A pixel pitch p diffracts to sin θ = λ/2p: a point at depth z lights the panel within |z|·tan θ of its foot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Points that light some of the panel.
    pub reaching: usize,
    /// All points.
    pub all: usize,
    /// Lowest and highest x, y and z of all [m].
    bounds: [[f64; 2]; 3],
    panel: [f64; 2],
    pitch: [f64; 2],
    tangent: f64,
}

impl Reach {
    /// Counts the points of a cloud, for a vacuum wavelength [m].
    pub fn of(cloud: &PointCloud, panel: &Grid, wavelength: f64) -> Self {
        let tangents = [panel.limit_x(), panel.limit_y()].map(|limit| {
            let sine = wavelength * limit;
            // Pixels of half a wavelength take light from all sides.
            if sine < 1.0 { sine / (1.0 - sine * sine).sqrt() } else { f64::INFINITY }
        });
        let edges = panel.edges();
        let reaches = |p: &super::PointSource| {
            let inside = |at: f64, [low, high]: [f64; 2], tangent: f64| {
                let cone = if p.position.z == 0.0 { 0.0 } else { p.position.z.abs() * tangent };
                at + cone >= low && at - cone <= high
            };
            inside(p.position.x, edges[0], tangents[0]) && inside(p.position.y, edges[1], tangents[1])
        };
        let ends = |axis: usize| {
            cloud.points.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], p| {
                [low.min(p.position[axis]), high.max(p.position[axis])]
            })
        };
        Self {
            reaching: cloud.points.iter().filter(|p| reaches(p)).count(),
            all: cloud.points.len(),
            bounds: [0, 1, 2].map(ends),
            panel: [panel.extent_x(), panel.extent_y()],
            pitch: panel.pitch(),
            tangent: tangents[0].max(tangents[1]),
        }
    }
}

impl std::fmt::Display for Reach {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let lost = self.all - self.reaching;
        let whose = if self.reaching == 0 { "none of its".into() } else { format!("{lost} of its") };
        let does = if self.reaching == 0 { "sends" } else { "send no" };
        let [x, y, z] = self.bounds.map(|[low, high]| format!("{} to {}", show_length(low), show_length(high)));
        let [width, height] = self.panel.map(show_length);
        write!(
            out,
            "{whose} {} points {does} light to the panel: they stand at x {x}, y {y}, z {z}; pixels of {} on {width} × {height} \
             take light from {} aside at 1m of distance",
            self.all,
            show_pitch(self.pitch),
            show_length(self.tangent)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::PointSource;
    use glam::DVec3;

    #[test]
    fn points_within_the_cone_are_counted_and_the_rest_is_told_with_numbers() {
        let panel = Grid::new(1000, 500, 8e-6, 8e-6).expect("panel");
        // tan θ = 0.0333 at 532 nm: at 150 mm a point may stand 5 mm beyond the edge at 4 mm.
        let cloud = |at: &[[f64; 3]]| PointCloud {
            points: at.iter().map(|p| PointSource { position: DVec3::from(*p), amplitude: 1.0, phase: 0.0 }).collect(),
            rgb: None,
        };
        let of = |at: &[[f64; 3]]| Reach::of(&cloud(at), &panel, 532e-9);
        let found =
            of(&[[8.9e-3, 0.0, -0.15], [9.1e-3, 0.0, -0.15], [0.0, 0.0, 0.3], [0.0, 0.0, 0.0], [5e-3, 0.0, 0.0]]);
        assert_eq!((found.reaching, found.all), (3, 5));
        assert!(found.to_string().starts_with("2 of its 5 points send no light"), "{found}");
        let none = of(&[[5e5, 5e6, 300.0]]);
        assert_eq!(none.reaching, 0);
        assert!(none.to_string().starts_with("none of its 1 points sends light"), "{none}");
        assert!(none.to_string().contains("8um on 8mm × 4mm"), "{none}");
    }
}
