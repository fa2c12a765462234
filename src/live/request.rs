//! What is asked of a live hologram, and how finely it is answered.

use crate::encode::EncodeOptions;
use glam::DVec3;
use serde::Serialize;

/// How the scene should stand before the panel, and in which light and encoding.
#[derive(Clone, Debug)]
pub struct Request {
    /// The scene turned about its middle: to the right about the camera's up, and up about its right [rad].
    pub turn: [f64; 2],
    /// The hologram shifted along x, y and z [m].
    pub shift: DVec3,
    /// Wavelength [m].
    pub wavelength: f64,
    /// Where the eye is, for frames that are made for it [m].
    pub eye: DVec3,
    /// How the field is encoded.
    pub encode: EncodeOptions,
}

/// How fine a hologram is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detail {
    /// Few rays, rough light, a field to 3 %: something to see at once.
    Coarse,
    /// Half the rays.
    Middle,
    /// As asked.
    Full,
}

impl Detail {
    /// The levels in their order.
    pub const ALL: [Self; 3] = [Self::Coarse, Self::Middle, Self::Full];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Coarse => "coarse",
            Self::Middle => "middle",
            Self::Full => "full",
        }
    }
}
