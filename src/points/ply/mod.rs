//! Point clouds as PLY: ours, OpenHolo's and plain ones, ASCII and binary.
//!
//! Ours is `binary_little_endian`: `double x y z` [m, hologram frame], `float amplitude` (or `amplitude_r/g/b`),
//! `double phase` [rad], and a comment `holodrive {…}` of JSON metadata. On reading, a missing amplitude is 1, a
//! missing phase 0; `red green blue` (uchar, or float in 0–1) are amplitudes as OpenHolo means them.

mod header;
mod read;
mod write;

pub use read::read;
pub use write::write;

use super::{Axes, PointCloud};
use crate::names::{Name, Named};
use serde::{Deserialize, Serialize};

/// In which frame the positions of a file stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Frame {
    /// Metres from the panel's middle: ready for a hologram.
    #[default]
    Hologram,
    /// The scene's own metres, where the camera's rays put the points.
    World,
}

impl Named for Frame {
    const KIND: &'static str = "frame";
    const NAMES: &'static [Name<Self>] = &[
        ("hologram", || Self::Hologram, "metres from the panel's middle: ready for a hologram"),
        ("world", || Self::World, "the scene's own metres"),
    ];
}

/// What our own files say of themselves, in one comment line.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Metadata {
    /// In which frame the positions stand.
    pub frame: Frame,
    /// The scene that the points were traced in.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub scene: String,
    /// Eye position in the hologram frame [m], if the points were placed for one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eye: Option<[f64; 3]>,
    /// Half width and half height of the viewing window on the panel plane [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<[f64; 2]>,
    /// Columns and rows of rays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rays: Option<[usize; 2]>,
    /// Initial phase: zero, path, or random with its seed.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub phase: String,
}

/// A file's points with what it says of itself and what had to be repaired.
#[derive(Clone, Debug, Default)]
pub struct Read {
    /// The points.
    pub cloud: PointCloud,
    /// Metadata of our own files.
    pub metadata: Option<Metadata>,
    /// How its values were taken where that is not plain, in words.
    pub origin: String,
    /// Repairs and assumptions, in words.
    pub warnings: Vec<String>,
    /// Its axes, where they are known to be others than right, up and towards the viewer.
    pub axes: Option<Axes>,
}

#[cfg(test)]
mod tests;
