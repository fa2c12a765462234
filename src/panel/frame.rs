//! A frame of drive levels, and what has to be known to make light of it.

use super::drive_curve::Modulation;
use super::profile::PanelProfile;
use crate::error::{Error, Result};
use crate::field::grid::light;
use crate::field::npy::CONVENTION;
use crate::propagation::Aperture;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Drive levels for every pixel of a panel, in the hologram frame: row 0 on top, column 0 at the smallest x.
///
/// These are the levels after correction and curve and before packing: what a pixel's driver gets.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Bits a level: levels are below 2^bits.
    pub bits: u8,
    /// Levels, row-major.
    pub levels: Vec<u16>,
    /// What they mean.
    pub metadata: FrameMetadata,
}

impl Frame {
    /// A frame from its levels; refused when their number or one of them does not fit the profile, or when no
    /// laser has the wavelength [m].
    pub fn new(profile: &PanelProfile, wavelength: f64, levels: Vec<u16>) -> Result<Self> {
        let (width, height) = (profile.width, profile.height);
        if levels.len() != width * height {
            let what = format!("{} levels for the {width}×{height} pixels of {}", levels.len(), profile.name);
            return Err(Error::parameter("frame", what));
        }
        if let Some(i) = levels.iter().position(|&l| usize::from(l) >= profile.levels()) {
            let what = format!(
                "level {} at column {}, row {}; {} has levels 0 … {}",
                levels[i],
                i % width,
                i / width,
                profile.name,
                profile.levels() - 1
            );
            return Err(Error::parameter("frame", what));
        }
        light(wavelength)?;
        Ok(Self { width, height, bits: profile.bits, levels, metadata: FrameMetadata::new(profile, wavelength) })
    }

    /// Refuses levels that are not as many as the pixels, or that do not fit their bits.
    pub(super) fn check_levels(&self) -> Result<()> {
        let Self { width, height, bits, levels, .. } = self;
        if levels.len() != width * height {
            return Err(Error::parameter("frame", format!("{} levels for {width}×{height} pixels", levels.len())));
        }
        match levels.iter().position(|&level| u32::from(level) >> bits != 0) {
            None => Ok(()),
            Some(i) => {
                let (level, column, row) = (levels[i], i % width, i / width);
                let what = format!("level {level} at column {column}, row {row} does not fit into {bits} bits");
                Err(Error::parameter("frame", what))
            }
        }
    }
}

/// Everything that a later step needs to know about a frame; kept as JSON in the file's `holodrive` text chunk.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameMetadata {
    /// Version of the program that wrote it.
    pub holodrive: String,
    /// The sign conventions that hold, in words.
    pub convention: String,
    /// Wavelength [m].
    pub wavelength: f64,
    /// Drive levels that one turn of phase spans at this wavelength; absent on an amplitude panel.
    pub levels_for_2pi: Option<f64>,
    /// The panel that it was made for, complete.
    pub panel: PanelProfile,
    /// How the field was encoded; absent for a frame of unknown making.
    pub encoding: Option<EncodingRecord>,
    /// Which steps of the fixed order the levels have been through.
    pub applied: Applied,
    /// Where the light comes from.
    pub origin: Origin,
}

impl FrameMetadata {
    /// Metadata of a frame of unknown making for a panel at a wavelength [m].
    pub fn new(panel: &PanelProfile, wavelength: f64) -> Self {
        let levels_for_2pi = panel.drive_curve(wavelength).ok().and_then(|(curve, _)| curve.levels_for_2pi());
        Self {
            holodrive: env!("CARGO_PKG_VERSION").into(),
            convention: CONVENTION.into(),
            wavelength,
            levels_for_2pi,
            panel: panel.clone(),
            encoding: None,
            applied: Applied::default(),
            origin: Origin::default(),
        }
    }
}

/// Steps of the order pattern + correction → wrap → curve → pack that have been done, so that none is done twice.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Applied {
    /// Name of the wavefront correction that was added.
    pub correction: Option<String>,
    /// Name of the level curve that phases or amplitudes went through.
    pub curve: Option<String>,
    /// Name of the packing, in a picture of the video signal.
    pub packing: Option<String>,
}

/// Where a frame's light comes from, for whoever finds the file later.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Origin {
    /// The scene, cloud or field file.
    pub source: Option<String>,
    /// Number of point sources.
    pub points: Option<usize>,
    /// How the scene was placed before the panel.
    pub placement: Option<String>,
    /// Depths z of the content in the hologram frame, nearest and farthest [m].
    pub depth: Option<[f64; 2]>,
    /// Anything else, in words.
    pub notes: Vec<String>,
}

/// How a field became this pattern, and how to get the field back out of the panel's light.
///
/// A reconstruction lights the panel with [`EncodingRecord::illumination`], keeps the spatial frequencies inside
/// [`EncodingRecord::aperture`] and divides by [`EncodingRecord::scale`]: what remains is the field that was encoded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EncodingRecord {
    /// Name of the encoding.
    pub method: String,
    /// What the pattern modulates.
    pub modulation: Modulation,
    /// The encoding's settings as resolved.
    pub parameters: BTreeMap<String, serde_json::Value>,
    /// The wave that falls on the panel.
    pub illumination: Illumination,
    /// Where in the spectrum behind the panel the object's light is; absent: everywhere.
    pub aperture: Option<Aperture>,
    /// Field behind the panel within the aperture = scale × field that was encoded, for an ideal panel.
    pub scale: f64,
}

impl EncodingRecord {
    /// A record for light at normal incidence; `parameters` is an object.
    pub(crate) fn new(
        method: &str,
        modulation: Modulation,
        parameters: serde_json::Value,
        aperture: Option<Aperture>,
        scale: f64,
    ) -> Self {
        let parameters = match parameters {
            serde_json::Value::Object(settings) => settings.into_iter().collect(),
            _ => BTreeMap::new(),
        };
        Self { method: method.into(), modulation, parameters, illumination: Illumination::Normal, aperture, scale }
    }
}

/// The wave that reads a panel, of unit amplitude on it. Light travels towards +z.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Illumination {
    /// A plane wave along the panel's normal.
    #[default]
    Normal,
    /// A plane wave exp(i2π(f_x·x + f_y·y)).
    Plane {
        /// Spatial frequency (f_x, f_y) = (sin θ_x, sin θ_y)/λ [cycles/m].
        frequency: [f64; 2],
    },
    /// A spherical wave from (z < 0) or towards (z > 0) a point in the hologram frame.
    Point {
        /// The point (x, y, z) [m].
        position: [f64; 3],
    },
}
