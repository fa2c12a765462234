//! A plate and all that decides its pixels.

pub use super::fringe_settings::{Binarisation, FringeSettings, Polarity};
use super::lamp::Lamp;
use super::printer::Printer;
use super::reference::Reference;
use super::transfer::Transfer;
pub use crate::encode::Quantity;
use crate::field::Grid;
use crate::segments::{Slit, Viewing};
use serde::{Deserialize, Serialize};

/// The pixels of a plate, as the viewer sees it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Raster {
    /// Columns [px].
    pub width: u64,
    /// Rows [px].
    pub height: u64,
    /// Distance of neighbouring columns [m].
    pub pitch_x: f64,
    /// Distance of neighbouring rows [m].
    pub pitch_y: f64,
}

/// How the file shows the plate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FileLayout {
    /// The file shows the plate left–right reversed: for masks whose written side turns away from the viewer.
    pub mirror: bool,
    /// The file shows the plate turned clockwise by this [deg]: 0, 90, 180 or 270; after `mirror`.
    pub rotation: u16,
    /// Border without fringes on each side, inside width and height [px].
    pub guard: u64,
    /// Length of the crosses in the corners of the guard border [px]; 0 draws none.
    pub marks: u64,
    /// Side of a tile: what is computed, stored and resumed as one [px].
    pub tile: u64,
}

/// A plate and all that decides its pixels, in SI units. [`Plate::read`] reads it from TOML.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plate {
    /// Name.
    pub name: String,
    /// Its pixels.
    #[serde(flatten)]
    pub raster: Raster,
    /// Vacuum wavelength λ of the reconstruction [m].
    pub wavelength: f64,
    /// The wave that lights the finished plate.
    pub reference: Reference,
    /// What a pixel is.
    #[serde(flatten)]
    pub fringe: FringeSettings,
    /// How the file shows them.
    #[serde(flatten)]
    pub file: FileLayout,
    /// Side of a segment: what sees the scene from one place [px].
    pub segment: u64,
    /// The slit through which the plate is seen, where it has parallax from left to right only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slit: Option<Slit>,
    /// Where scene and viewer stand.
    #[serde(flatten)]
    pub view: Viewing,
    /// Largest angles of object light to the normal, along x and y [rad], where they are to be smaller than the widest that
    /// reference and pitch allow.
    pub object_angle: Option<[f64; 2]>,
    /// Width and height of the place before the plate's middle, at the viewer's distance, that a direct search keeps free of
    /// noise [m]; none for other fringes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eye_box: Option<[f64; 2]>,
    /// Columns and rows along the edge of the fringes over which they fade away [px]: a hard edge sends light of the lamp aside, and
    /// some of it to where the object is.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub fade: u64,
    /// Largest relative error of the computed field.
    pub error: f64,
    /// Seed of phases, jitter and light.
    pub seed: u64,
    /// The lamp that the finished plate is to be looked at with, where the profile tells: as wide and as coloured as that is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lamp: Option<Lamp>,
    /// The machine that prints it, where the profile tells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub printer: Option<Printer>,
    /// What that machine makes of levels and lines, where it was measured; it is undone in the file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transfer: Option<Transfer>,
}

fn is_zero(value: &u64) -> bool {
    *value == 0
}

impl Raster {
    /// The lattice of the pixels; not one to hold samples on, a plate may be larger than any memory.
    pub fn grid(&self) -> Grid {
        let Self { width, height, pitch_x, pitch_y } = *self;
        Grid { width: width as usize, height: height as usize, pitch_x, pitch_y, center: [0.0; 2] }
    }
}

impl Plate {
    /// The wavelengths that light the finished plate [m].
    pub fn wavelengths(&self) -> &[f64] {
        self.slit.as_ref().map_or(std::slice::from_ref(&self.wavelength), |slit| &slit.wavelengths)
    }
    /// The wavelength that a row is made for [m].
    pub(super) fn wavelength_of(&self, row: i64) -> f64 {
        self.slit.as_ref().map_or(self.wavelength, |slit| slit.wavelength_of(row))
    }
}
