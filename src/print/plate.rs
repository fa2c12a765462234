//! The description of a plate: a TOML file of `calib/`, its keys, their units and their domains.

use super::reference::{Reference, Side};
use super::slit::Slit;
use crate::config::ConfigFile;
pub use crate::encode::Quantity;
use crate::error::{Error, Result};
use crate::field::grid;
use crate::points::colour::Lasers;
use crate::units;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// How a fringe becomes one bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Binarisation {
    /// Open where the fringe is above its middle.
    Threshold,
    /// Open where the phase of u·r* is within ±arcsin(|u|/A): the first order's amplitude follows |u| (Lee 1979).
    PulseWidth,
    /// Floyd–Steinberg error diffusion, begun in a halo outside of each tile.
    #[default]
    Diffusion,
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

/// A plate and all that decides its pixels, in SI units. [`Plate::read`] reads it from TOML.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plate {
    /// Name.
    pub name: String,
    /// Columns of the plate as the viewer sees it [px].
    pub width: u64,
    /// Rows of it [px].
    pub height: u64,
    /// Distance of neighbouring columns [m].
    pub pitch_x: f64,
    /// Distance of neighbouring rows [m].
    pub pitch_y: f64,
    /// Vacuum wavelength λ of the reconstruction [m].
    pub wavelength: f64,
    /// The wave that lights the finished plate.
    pub reference: Reference,
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
    /// Side of a segment: what sees the scene from one place [px].
    pub segment: u64,
    /// The slit through which the plate is seen, where it has parallax from left to right only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slit: Option<Slit>,
    /// Distance of the viewer's eye in front of the plate [m].
    pub viewer: f64,
    /// Angle that the viewer's eye separates [rad].
    pub resolution: f64,
    /// Rays along each side of what the eye separates.
    pub rays: u32,
    /// z of the scene's middle [m]; negative behind the plate.
    pub place: f64,
    /// Metres at the plate for one metre of the scene; fitted into the view where `None`.
    pub scale: Option<f64>,
    /// Largest angles of object light to the normal, along x and y [rad], where they are to be smaller than the widest that
    /// reference and pitch allow.
    pub object_angle: Option<[f64; 2]>,
    /// Largest relative error of the computed field.
    pub error: f64,
    /// Seed of phases, jitter and light.
    pub seed: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlateFile {
    name: String,
    size: Option<[u64; 2]>,
    extent: Option<[String; 2]>,
    pitch: Option<String>,
    pitch_x: Option<String>,
    pitch_y: Option<String>,
    wavelength: String,
    #[serde(default)]
    quantity: Quantity,
    bits: u8,
    binarisation: Option<Binarisation>,
    bias: Option<f64>,
    contrast: Option<f64>,
    percentile: Option<f64>,
    reference_ratio: Option<f64>,
    #[serde(default)]
    polarity: Polarity,
    #[serde(default)]
    mirror: bool,
    #[serde(default)]
    rotation: u16,
    #[serde(default)]
    guard: u64,
    #[serde(default)]
    marks: u64,
    tile: Option<u64>,
    segment: Option<u64>,
    error: Option<f64>,
    #[serde(default = "one")]
    seed: u64,
    reference: Option<ReferenceFile>,
    slit: Option<SlitFile>,
    scene: SceneFile,
}

fn one() -> u64 {
    1
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ReferenceFile {
    angle: Option<[String; 2]>,
    point: Option<[String; 3]>,
    #[serde(default)]
    side: Side,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    viewer: String,
    distance: String,
    scale: Option<f64>,
    resolution: Option<String>,
    rays: Option<u32>,
    object_angle: Option<[String; 2]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SlitFile {
    height: String,
    y: Option<String>,
    strip: Option<u64>,
    wavelengths: Option<Vec<String>>,
}

/// Longest side of a plate [px]: 2.6 million would be 0.9 m at 0.35 µm.
const LONGEST: u64 = 1 << 22;

impl Plate {
    /// Reads a plate from a TOML file.
    ///
    /// # Errors
    /// [`Error::Io`] for a file that cannot be read, [`Error::Calibration`] for one that says something wrong.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::io(path))?;
        Self::parse(&text, path)
    }

    /// Reads a plate from TOML text; `source` stands in errors.
    ///
    /// # Errors
    /// [`Error::Calibration`].
    pub fn parse(text: &str, source: &Path) -> Result<Self> {
        let at = ConfigFile { source };
        let file: PlateFile = at.parse(text)?;
        let [pitch_x, pitch_y] = at.pitches(&file.pitch, [&file.pitch_x, &file.pitch_y])?;
        let [width, height] = match (file.size, &file.extent) {
            (Some(size), None) => size,
            (None, Some([x, y])) => {
                let count = |text: &str, pitch: f64| -> Result<u64> {
                    Ok((at.read("extent", text, units::positive_length)? / pitch).round() as u64)
                };
                [count(x, pitch_x)?, count(y, pitch_y)?]
            }
            _ => return at.refuse("give either size = [columns, rows] or extent = [\"65mm\", \"65mm\"]"),
        };
        if !(1..=LONGEST).contains(&width) || !(1..=LONGEST).contains(&height) {
            return at.refuse(format!("{width}×{height} pixels: each side must be 1 to {LONGEST}"));
        }
        if !matches!(file.bits, 1 | 8) {
            return at.refuse(format!("bits = {} must be 1 or 8", file.bits));
        }
        if file.bits == 8 && file.binarisation.is_some() {
            return at.refuse("binarisation is for bits = 1; leave it out");
        }
        let binarisation = file.binarisation.unwrap_or_default();
        if file.bits == 1 && file.quantity != Quantity::Bipolar && binarisation == Binarisation::PulseWidth {
            return at.refuse("pulse-width makes its fringe from u·r* itself; take quantity = \"bipolar\"");
        }
        if !matches!(file.rotation, 0 | 90 | 180 | 270) {
            return at.refuse(format!("rotation = {} must be 0, 90, 180 or 270", file.rotation));
        }
        let tile = file.tile.unwrap_or(2048);
        if !tile.is_multiple_of(64) || !(64..=8192).contains(&tile) {
            return at.refuse(format!("tile = {tile} must be a multiple of 64 from 64 to 8192"));
        }
        if tile > width || tile > height {
            let what = format!("the plate of {width}×{height} pixels is smaller than a tile of {tile}; lower tile");
            return at.refuse(what);
        }
        let segment = file.segment.unwrap_or(1024.min(tile));
        if !(16..=tile).contains(&segment) {
            return at.refuse(format!("segment = {segment} must be 16 to the tile's {tile}"));
        }
        if file.guard * 2 >= width.min(height) {
            return at.refuse(format!("guard = {} on each side leaves no fringes of {width}×{height}", file.guard));
        }
        if file.marks > file.guard {
            return at.refuse(format!("marks = {} do not fit into guard = {}; raise guard", file.marks, file.guard));
        }
        let reference = match &file.reference {
            None => Reference::None,
            Some(ReferenceFile { angle: Some([x, y]), point: None, side }) => Reference::Plane {
                angle: [at.angle("reference.angle", x)?, at.angle("reference.angle", y)?],
                side: *side,
            },
            Some(ReferenceFile { angle: None, point: Some([x, y, z]), side: Side::Behind }) => {
                let position = [x, y, z].map(|text| at.read("reference.point", text, units::length));
                let [x, y, z] = position;
                let position = [x?, y?, z?];
                if position[2] == 0.0 {
                    return at.refuse("reference.point lies in the plate's plane; give it a distance");
                }
                Reference::Point { position }
            }
            Some(ReferenceFile { point: Some(_), side: Side::Front, .. }) => {
                return at.refuse("reference.point says by its z on which side it stands; leave side out");
            }
            Some(_) => {
                return at
                    .refuse("reference: give either angle = [\"0deg\", \"12deg\"] or point = [\"x\", \"y\", \"z\"]");
            }
        };
        let scene = &file.scene;
        let wavelength = at.read("wavelength", &file.wavelength, units::positive_length)?;
        let viewer = at.read("scene.viewer", &scene.viewer, units::positive_length)?;
        let resolution = scene.resolution.as_deref().unwrap_or("0.016666666666666666deg");
        let resolution = at.angle("scene.resolution", resolution)?;
        if resolution <= 0.0 {
            return at.refuse("scene.resolution must be greater than zero");
        }
        let slit = match &file.slit {
            None => None,
            Some(slit) => {
                let as_fine_as_the_eye = (viewer * resolution.tan() / pitch_y).clamp(16.0, tile as f64) as u64;
                let strip = slit.strip.unwrap_or(1 << as_fine_as_the_eye.ilog2());
                if !(8..=tile).contains(&strip) {
                    return at.refuse(format!("slit.strip = {strip} must be 8 to the tile's {tile}"));
                }
                let wavelengths = match &slit.wavelengths {
                    None => vec![wavelength],
                    Some(texts) => texts
                        .iter()
                        .map(|text| at.read("slit.wavelengths", text, units::positive_length))
                        .collect::<Result<Vec<_>>>()?,
                };
                if !matches!(wavelengths.len(), 1 | 3) || wavelengths[0] != wavelength {
                    return at.refuse("slit.wavelengths are three, the plate's own wavelength first");
                }
                if let [a, b, c] = wavelengths[..] {
                    Lasers::new([a, b, c]).map_err(|e| Error::calibration(source, format!("slit: {e}")))?;
                }
                let y = slit.y.as_deref().map_or(Ok(0.0), |text| at.read("slit.y", text, units::length))?;
                let height = at.read("slit.height", &slit.height, units::positive_length)?;
                Some(Slit { y, height, strip, wavelengths })
            }
        };
        let object_angle = match &scene.object_angle {
            None => None,
            Some([x, y]) => {
                let angles = [at.angle("scene.object_angle", x)?, at.angle("scene.object_angle", y)?];
                if angles.iter().any(|a| *a <= 0.0) {
                    return at.refuse("scene.object_angle must be greater than zero");
                }
                Some(angles)
            }
        };
        if scene.scale.is_some_and(|scale| !(scale.is_finite() && scale > 0.0)) {
            return at.refuse("scene.scale must be greater than zero");
        }
        Ok(Self {
            name: file.name,
            width,
            height,
            pitch_x,
            pitch_y,
            wavelength,
            reference,
            quantity: file.quantity,
            bits: file.bits,
            binarisation,
            bias: at.within("bias", file.bias.unwrap_or(0.5), 0.0..=1.0)?,
            contrast: at.within("contrast", file.contrast.unwrap_or(1.0), 1e-3..=1e3)?,
            percentile: at.within("percentile", file.percentile.unwrap_or(0.999), 0.5..=1.0)?,
            reference_ratio: at.within("reference_ratio", file.reference_ratio.unwrap_or(1.0), 1e-3..=1e3)?,
            polarity: file.polarity,
            mirror: file.mirror,
            rotation: file.rotation,
            guard: file.guard,
            marks: file.marks,
            tile,
            segment,
            slit,
            viewer,
            resolution,
            rays: match scene.rays.unwrap_or(2) {
                rays @ 1..=16 => rays,
                rays => return at.refuse(format!("scene.rays = {rays} must be 1 to 16")),
            },
            place: -at.read("scene.distance", &scene.distance, units::length)?,
            scale: scene.scale,
            object_angle,
            error: at.within("error", file.error.unwrap_or(if file.bits == 1 { 1e-2 } else { 5e-3 }), 1e-4..=0.1)?,
            seed: file.seed,
        })
    }

    /// Full width and height [m].
    pub fn extent(&self) -> [f64; 2] {
        [self.width as f64 * self.pitch_x, self.height as f64 * self.pitch_y]
    }
    /// Columns and rows of a segment [px]: square ones, or strips.
    pub fn segment_size(&self) -> [u64; 2] {
        [self.segment, self.slit.as_ref().map_or(self.segment, |slit| slit.strip)]
    }
    /// The wavelengths that light the finished plate [m].
    pub fn wavelengths(&self) -> &[f64] {
        self.slit.as_ref().map_or(std::slice::from_ref(&self.wavelength), |slit| &slit.wavelengths)
    }
    /// The wavelength that a row is made for [m].
    pub fn wavelength_of(&self, row: i64) -> f64 {
        self.slit.as_ref().map_or(self.wavelength, |slit| slit.wavelength_of(row))
    }
    /// Position of a column, which may lie outside of the plate [m].
    pub fn x(&self, column: i64) -> f64 {
        grid::offset(column as f64, self.width as f64, self.pitch_x)
    }
    /// Position of a row, which may lie outside of the plate [m]; falls as the row rises.
    pub fn y(&self, row: i64) -> f64 {
        grid::offset((self.height as i64 - 1 - row) as f64, self.height as f64, self.pitch_y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "name = \"t\"\nsize = [640, 384]\npitch = \"1um\"\nwavelength = \"633nm\"\nbits = 1\ntile = 128\n\
        [reference]\nangle = [\"9deg\", \"0deg\"]\n[scene]\nviewer = \"60mm\"\ndistance = \"5mm\"\n";

    #[test]
    fn plates_are_read_in_metres_with_the_scene_behind() {
        let plate = Plate::parse(SMALL, Path::new("t.toml")).expect("plate");
        assert_eq!((plate.width, plate.height, plate.tile, plate.segment), (640, 384, 128, 128));
        assert_eq!((plate.pitch_x, plate.place, plate.viewer), (1e-6, -5e-3, 60e-3));
        assert!((plate.resolution - crate::points::budget::EYE_ANGLE).abs() < 1e-12);
        assert!((plate.x(0) + 319.5e-6).abs() < 1e-15 && (plate.y(0) - 191.5e-6).abs() < 1e-15);
        let sized = SMALL.replace("size = [640, 384]", "extent = [\"0.64mm\", \"0.384mm\"]");
        assert_eq!(Plate::parse(&sized, Path::new("t.toml")).expect("plate"), plate);
        let oblong = SMALL.replace("pitch = \"1um\"", "pitch_x = \"1um\"\npitch_y = \"0.5um\"");
        let [width, height] = Plate::parse(&oblong, Path::new("t.toml")).expect("plate").extent();
        assert!((width - 640e-6).abs() < 1e-15 && (height - 192e-6).abs() < 1e-15);
    }

    #[test]
    fn slips_are_refused_by_their_key() {
        for (from, to, expected) in [
            ("pitch = \"1um\"", "pitch = \"1\"", "pitch"),
            ("pitch = \"1um\"", "pitch = \"1um\"\npitch_x = \"1um\"", "pitch_x stands beside"),
            ("bits = 1", "bits = 4", "bits = 4"),
            ("bits = 1", "bits = 8\nbinarisation = \"threshold\"", "binarisation"),
            ("tile = 128", "tile = 100", "multiple of 64"),
            ("tile = 128", "tile = 512", "smaller than a tile"),
            ("tile = 128", "tile = 128\nsegment = 256", "segment = 256"),
            ("tile = 128", "tile = 128\nguard = 192", "guard"),
            ("tile = 128", "tile = 128\nguard = 10\nmarks = 11", "marks"),
            ("tile = 128", "tile = 128\nrotation = 45", "rotation"),
            ("tile = 128", "tile = 128\nbias = 1.5", "bias"),
            ("angle = [\"9deg\", \"0deg\"]", "angle = [\"95deg\", \"0deg\"]", "90deg"),
            ("angle = [\"9deg\", \"0deg\"]", "point = [\"0mm\", \"1m\", \"0m\"]", "plate's plane"),
            ("angle = [\"9deg\", \"0deg\"]", "", "either angle"),
            ("size = [640, 384]", "size = [640, 0]", "each side"),
            ("size = [640, 384]", "size = [9000000, 384]", "each side"),
            ("size = [640, 384]\n", "", "either size"),
            ("bits = 1", "bit = 1", "bit"),
        ] {
            let text = SMALL.replace(from, to);
            assert_ne!(text, SMALL);
            let refused = Plate::parse(&text, Path::new("t.toml")).expect_err(to).to_string();
            assert!(refused.contains("t.toml") && refused.contains(expected) && !refused.contains('\n'), "{refused}");
        }
    }
}
