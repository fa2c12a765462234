//! How rays are cast.

use crate::illumination::Quality;
use crate::names::{Name, Named};

/// At which distance a point stands that is seen by way of mirrors or glass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MirrorDepth {
    /// The length of the whole way, as in the seed paper: right for flat mirrors.
    Path,
    /// Where the eye focuses: also right for curved mirrors, lenses and glass plates.
    #[default]
    Focus,
}

impl Named for MirrorDepth {
    const KIND: &'static str = "mirror depth";
    const NAMES: &'static [Name<Self>] = &[
        ("path", || Self::Path, "the length of the path, as in the seed paper"),
        ("focus", || Self::Focus, "where the eye focuses"),
    ];
}

/// How a scene is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceSettings {
    /// Rays across the picture.
    pub width: u32,
    /// Rays down the picture.
    pub height: u32,
    /// Most mirrors or glass surfaces on one ray.
    pub bounces: u32,
    /// Sub-rays along each side of a pixel that covers an edge; 1 takes pixel centres only.
    pub edge_rays: u32,
    /// Rays into the lobe of a rough surface that reflects everything; fewer where it reflects less.
    pub lobe_rays: u32,
    /// Where points stand that are seen by way of optics.
    pub mirror_depth: MirrorDepth,
    /// Whether each pixel's ray goes through a random place of it instead of its middle: points that are few then stand in
    /// no lattice, whose orders an eye would see, and still one in each cell.
    pub jitter: bool,
    /// Seed of all sampling.
    pub seed: u64,
}

impl Default for TraceSettings {
    fn default() -> Self {
        Self {
            width: 500,
            height: 500,
            bounces: 32,
            edge_rays: 3,
            lobe_rays: 16,
            mirror_depth: MirrorDepth::Focus,
            jitter: false,
            seed: 1,
        }
    }
}

impl TraceSettings {
    /// The same with rays for this error of the picture's light, as [`crate::illumination::IlluminationSettings::for_error`].
    pub fn for_error(self, error: f64) -> Self {
        let finer = Quality::Normal.error() / error;
        let usual = Self::default();
        let lobe_rays = (f64::from(usual.lobe_rays) * finer * finer).round().clamp(4.0, 256.0) as u32;
        let edge_rays = (f64::from(usual.edge_rays) * finer.sqrt()).round().clamp(2.0, 8.0) as u32;
        Self { lobe_rays, edge_rays, ..self }
    }
}
