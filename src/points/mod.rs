//! Point sources: what the scene's light becomes before it is a wave.
//!
//! ```
//! use holodrive::field::Grid;
//! use holodrive::illumination::{Illumination, IlluminationSettings};
//! use holodrive::points::placement::Phase;
//! use holodrive::points::{Placement, TraceSettings, place, trace};
//! use holodrive::progress::Progress;
//! use holodrive::scene::{SceneBvh, gltf};
//!
//! let (room, progress) = (gltf::load("scenes/cornell.gltf".as_ref(), &Default::default())?.scene, Progress::new());
//! let settings = IlluminationSettings::default().coarse();
//! let light = Illumination::new(SceneBvh::new(room.clone()), settings, &progress)?;
//! let panel = Grid::new(1920, 1080, 8e-6, 8e-6)?;
//! let placing = Placement::default().prepare(&room, &room.cameras[0], 1.0, &panel)?;
//! let rays = TraceSettings { width: 24, height: 24, ..TraceSettings::default() };
//! let traced = trace(&light, &placing.camera, &rays, &progress)?;
//! let placed = place(&traced.world_points(), &placing, Phase::Random { seed: 1 }, &panel, 532e-9);
//! // The room stands from 150 mm to 100 mm behind the panel.
//! let (far, near) = placed.cloud.depth_range().ok_or_else(|| holodrive::Error::unsupported("no light"))?;
//! assert!((far + 0.15).abs() < 1e-9 && (near + 0.1).abs() < 1e-9);
//! # Ok::<(), holodrive::Error>(())
//! ```

mod axes;
pub mod budget;
pub mod clouds;
pub mod colour;
pub mod depth_map;
pub mod exposure;
pub(crate) mod eye;
#[cfg(test)]
mod eye_tests;
mod from_scene;
mod gather;
pub mod images;
pub mod lattice;
mod light_error;
#[cfg(test)]
mod odd_tests;
mod placed;
pub mod placement;
#[cfg(test)]
mod placement_tests;
mod placing_cloud;
pub mod ply;
mod reach;
mod settings;
pub mod slices;
mod subframes;
pub mod trace;
mod view;
mod wavefront;
pub(crate) mod white;

pub use axes::Axes;
pub use exposure::{Exposure, Share};
pub use from_scene::{LitScene, ScenePoints, SceneSettings};
pub use light_error::light_error;
pub use placed::{Placed, place};
pub use placement::Placement;
pub use placing_cloud::PlacedCloud;
pub use reach::Reach;
pub use subframes::{Multiplexing, SubFrames};
pub use trace::{TraceSettings, Traced, TracedPoint, trace};
pub use view::SceneView;
pub use white::{WhiteLevel, WhitePoint};

use crate::names::{Name, Named};
use glam::DVec3;

/// One point of light in the hologram frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointSource {
    /// Where it stands [m]; z < 0 behind the panel (its wave diverges through it), z > 0 in front (it converges there).
    pub position: DVec3,
    /// Amplitude a of its wave a·exp(±ikr)/r: √radiance × distance from the eye.
    pub amplitude: f32,
    /// Initial phase φ [rad].
    pub phase: f64,
}

/// A set of point sources, all of one colour or with an amplitude for red, green and blue each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// The points; `amplitude` is that of the luminance in a coloured cloud.
    pub points: Vec<PointSource>,
    /// Amplitudes for red, green and blue (linear Rec.709 radiance under the root), one triple a point, if coloured.
    pub rgb: Option<Vec<[f32; 3]>>,
}

/// Which light of a coloured cloud makes a hologram of one wavelength.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Channel {
    /// Rec.709 luminance: the whole scene in one colour.
    #[default]
    Luminance,
    /// Linear red.
    Red,
    /// Linear green.
    Green,
    /// Linear blue.
    Blue,
}

impl Named for Channel {
    const KIND: &'static str = "channel";
    const NAMES: &'static [Name<Self>] = &[
        ("luminance", || Self::Luminance, "the whole scene in one colour"),
        ("red", || Self::Red, "linear red"),
        ("green", || Self::Green, "linear green"),
        ("blue", || Self::Blue, "linear blue"),
    ];
}

/// Rec.709 luminance of linear RGB.
pub fn luminance(rgb: [f32; 3]) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

impl Channel {
    /// This channel of a linear RGB radiance.
    pub fn of(self, rgb: [f32; 3]) -> f32 {
        match self {
            Self::Luminance => luminance(rgb),
            Self::Red => rgb[0],
            Self::Green => rgb[1],
            Self::Blue => rgb[2],
        }
    }
}

impl PointCloud {
    /// The points with the amplitudes of one channel; a colourless cloud has the same amplitude in each.
    pub fn channel(&self, channel: Channel) -> Vec<PointSource> {
        let of_rgb = |rgb: [f32; 3]| match channel {
            Channel::Luminance => luminance(rgb.map(|a| a * a)).sqrt(),
            other => other.of(rgb),
        };
        let mut points = self.points.clone();
        if let Some(rgb) = &self.rgb {
            for (point, rgb) in points.iter_mut().zip(rgb) {
                point.amplitude = of_rgb(*rgb);
            }
        }
        points
    }
    /// Refuses colours that are not as many as the points.
    ///
    /// # Errors
    /// [`Error::Parameter`](crate::Error::Parameter).
    pub fn check(&self) -> crate::Result<()> {
        match &self.rgb {
            Some(rgb) if rgb.len() != self.points.len() => {
                let what = format!("{} colours for {} points", rgb.len(), self.points.len());
                Err(crate::Error::parameter("rgb", what))
            }
            _ => Ok(()),
        }
    }

    /// Lowest and highest z, the farthest and the nearest light [m]; `None` for an empty cloud.
    pub fn depth_range(&self) -> Option<(f64, f64)> {
        self.points.iter().map(|p| p.position.z).fold(None, |range, z| match range {
            None => Some((z, z)),
            Some((low, high)) => Some((z.min(low), z.max(high))),
        })
    }
}
