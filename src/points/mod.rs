//! Point sources: what the scene's light becomes before it is a wave.

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
