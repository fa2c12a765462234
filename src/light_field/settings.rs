//! How light fields are made of scenes and clouds, and what it took.

use super::{EyeGrid, Pupil, Viewer};
use crate::error::{Error, Result};
use crate::points::Channel;
use glam::DVec2;
use serde::Serialize;

/// How the views of a light field are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightFieldSettings {
    /// Radiance that is shown as white [W/(m² sr)]; `None`: a quarter above what 97 % of the lit pixels of the middle view
    /// (of a cloud: of its points) do not pass.
    pub white: Option<f32>,
    /// Whether light brighter than white burns out, its hue kept; else it is kept as it is.
    pub clips: bool,
    /// One channel of the light; `None` for linear red, green and blue.
    pub channel: Option<Channel>,
    /// Rays for each pixel of each view.
    pub rays: u32,
    /// Most mirrors or glass surfaces on one ray.
    pub bounces: u32,
    /// Seed of all sampling.
    pub seed: u64,
    /// Views of which no pupil of this viewer takes anything stay black; `None` makes all.
    pub viewer: Option<Viewer>,
}

impl Default for LightFieldSettings {
    /// Luminance, one ray: pictures through a pupil are the mean of many views.
    fn default() -> Self {
        Self {
            white: None,
            clips: true,
            channel: Some(Channel::Luminance),
            rays: 1,
            bounces: 32,
            seed: 1,
            viewer: None,
        }
    }
}

impl LightFieldSettings {
    pub(super) fn check(&self) -> Result<()> {
        if let Some(white) = self.white.filter(|white| !(white.is_finite() && *white > 0.0)) {
            return Err(Error::out_of_range("white", white, "must be greater than zero"));
        }
        if self.rays == 0 || self.rays > 1 << 16 {
            return Err(Error::out_of_range("rays of a pixel", self.rays, "must be 1 to 65536"));
        }
        Ok(())
    }

    /// Whether view `index` is made.
    pub(super) fn makes(&self, eyes: &EyeGrid, index: usize) -> bool {
        self.viewer.is_none_or(|viewer| eyes.serves(index, &viewer))
    }
}

/// What making a light field took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LightFieldReport {
    /// Views that were made.
    pub views: usize,
    /// Rays from eye points, or splats of points.
    pub rays: u64,
    /// Rays or splats in a second.
    pub rays_per_second: f64,
    /// Places at which diffuse light was computed.
    pub cached: usize,
    /// Radiance that is shown as white [W/(m² sr)].
    pub white: f32,
    /// Time [s].
    pub seconds: f64,
}

impl std::fmt::Display for LightFieldReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.1} million rays a second", 1e-6 * self.rays_per_second)
    }
}

impl EyeGrid {
    /// Whether a pupil of a viewer takes in light of the cell about a view.
    pub fn serves(&self, index: usize, viewer: &Viewer) -> bool {
        let Pupil::Diameter(pupil) = viewer.pupil else { return true };
        let aside = (self.position(index) - viewer.eye).truncate().abs();
        // The nearest that a pupil's middle comes to the cell.
        let least = (aside - 0.5 * viewer.eye_box - DVec2::splat(0.5 * self.spacing)).max(DVec2::ZERO);
        least.length() < 0.5 * pupil
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn the_corners_of_a_round_pupils_lattice_serve_nobody() {
        let viewer = Viewer { eye: DVec3::new(0.01, -0.02, 0.6), ..Viewer::at(DVec3::Z) };
        let eyes = EyeGrid::covering(&viewer, EyeGrid::SPACING).expect("eyes");
        let serves: Vec<bool> = (0..81).map(|index| eyes.serves(index, &viewer)).collect();
        // Of 9 × 9 cells 0.5 mm wide three at each corner lie outside a disc of 4 mm.
        assert_eq!(serves.iter().filter(|s| !**s).count(), 12);
        assert!(!serves[0] && !serves[1] && !serves[9] && serves[2] && serves[10] && serves[4] && serves[40]);
        // In a box the pupil's middle reaches everywhere but the corners' corners.
        let wide = Viewer { eye_box: DVec2::new(0.01, 0.004), ..viewer };
        let eyes = EyeGrid::covering(&wide, EyeGrid::SPACING).expect("eyes");
        assert_eq!((0..eyes.count()).filter(|&index| !eyes.serves(index, &wide)).count(), 12);
        assert!(eyes.serves(0, &Viewer { pupil: Pupil::All, ..viewer }));
    }
}
