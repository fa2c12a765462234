//! How object and reference become levels.

use crate::encode::Quantity;
use crate::names::{Name, Named};
use serde::{Deserialize, Serialize};

/// How a fringe becomes one bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Binarisation {
    /// Open where the fringe is above its middle.
    Threshold,
    /// Open where the phase of u·r* is within ±arcsin(|u|/A): the first order's amplitude follows |u| (Lee 1979).
    PulseWidth,
    /// Begun as `threshold`; then pixels are turned over while that lowers the rounding noise which an eye box receives
    /// ([`crate::encode`]'s search within a band): what lies elsewhere takes it.
    DirectSearch,
    /// Floyd–Steinberg error diffusion, begun in a halo outside of each tile.
    #[default]
    Diffusion,
}

impl Named for Binarisation {
    const KIND: &'static str = "binarisation";
    const NAMES: &'static [Name<Self>] = &[
        ("threshold", || Self::Threshold, "open where the fringe is above its middle"),
        ("pulse-width", || Self::PulseWidth, "pulses as wide as the light is strong"),
        ("direct-search", || Self::DirectSearch, "pixels turned over until an eye box is free of noise"),
        ("diffusion", || Self::Diffusion, "error diffusion"),
    ];
}

/// Which level is clear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Polarity {
    /// The highest level is the brightest fringe.
    #[default]
    Positive,
    /// The highest level is the darkest fringe.
    Negative,
}

/// How object and reference become a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FringeSettings {
    /// What a pixel stands for.
    pub quantity: Quantity,
    /// Bits a pixel, 1 or 8.
    pub bits: u8,
    /// How one bit is made.
    pub binarisation: Binarisation,
    /// Level of a fringe without object light, 0 to 1.
    pub bias: f64,
    /// Factor on the fringe's swing about the bias.
    pub contrast: f64,
    /// The amplitude that swings fully is the one below which this share of the sampled pixels lies.
    pub percentile: f64,
    /// Amplitude of the reference over that of the object (intensity only).
    pub reference_ratio: f64,
    /// Which level is clear.
    pub polarity: Polarity,
}
