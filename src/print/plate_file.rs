//! Plates in TOML: a file of `calib/`, its keys, their units and their domains.

use super::lamp::LampFile;
use super::plate::{Binarisation, FileLayout, FringeSettings, Plate, Polarity, Quantity, Raster};
use super::plate_size::{Asked, PlateSize, SizeKey, check_step};
use super::printer::PrinterFile;
use super::reference::{Reference, Side};
use super::transfer::TransferFile;
use crate::config::ConfigFile;
use crate::error::{Error, Result};
use crate::points::colour::Lasers;
use crate::segments::{PointPhase, Slit, Viewing};
use crate::units;
use serde::Deserialize;
use std::path::Path;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlateFile {
    name: String,
    size: Option<SizeKey>,
    extent: Option<[String; 2]>,
    pitch: Option<String>,
    pitch_x: Option<String>,
    pitch_y: Option<String>,
    step: Option<String>,
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
    #[serde(default)]
    fade: u64,
    tile: Option<u64>,
    segment: Option<u64>,
    error: Option<f64>,
    #[serde(default = "one")]
    seed: u64,
    reference: Option<ReferenceFile>,
    slit: Option<SlitFile>,
    lamp: Option<LampFile>,
    printer: Option<PrinterFile>,
    transfer: Option<TransferFile>,
    scene: SceneFile,
}

/// Sides of the eye box where none is given, as shares of the viewer's distance.
const EYE_BOX: [f64; 2] = [0.2, 0.1];

/// Contrast of a direct search where none is given: that of the threshold from which it begins. In 8 bits the same fringe
/// would be clipped; in one bit more light reaches the eye, and the noise outside of its box grows instead.
const SEARCHED: f64 = 3.0;

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
    #[serde(default)]
    phase: PointPhase,
    eye_box: Option<[String; 2]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SlitFile {
    height: String,
    y: Option<String>,
    strip: Option<u64>,
    wavelengths: Option<Vec<String>>,
    #[serde(default)]
    superimposed: bool,
}

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
        Self::parse_as(text, source, &Asked::default())
    }

    /// The same with another size or pitch than the text's.
    ///
    /// # Errors
    /// [`Error::Calibration`].
    pub fn parse_as(text: &str, source: &Path, asked: &Asked) -> Result<Self> {
        let at = ConfigFile { source };
        let file: PlateFile = at.parse(text)?;
        let step = file.step.as_ref().map(|text| at.read("step", text, units::pitch)).transpose()?;
        let [pitch_x, pitch_y] = match (asked.pitch, step) {
            (Some(pitch), _) => [pitch; 2],
            // Without another pitch the pixels are the printer's steps.
            (None, Some(step)) if [&file.pitch, &file.pitch_x, &file.pitch_y].iter().all(|key| key.is_none()) => {
                [step; 2]
            }
            _ => at.pitches(&file.pitch, [&file.pitch_x, &file.pitch_y])?,
        };
        let size = match (&file.size, &file.extent) {
            (Some(size), None) => at.read("size", "", |_| size.size())?,
            (None, Some([x, y])) => {
                let side = |text: &String| at.read("extent", text, units::positive_length);
                PlateSize::Lengths([side(x)?, side(y)?])
            }
            _ => return at.refuse("give either size = [columns, rows] or size = \"65mm x 65mm\""),
        };
        let [width, height] = asked.size.unwrap_or(size).pixels([pitch_x, pitch_y]);
        let raster = Raster { width, height, pitch_x, pitch_y };
        step.map_or(Ok(()), |step| check_step(&raster, step)).or_else(|what| at.refuse(what))?;
        if file.bits == 8 && file.binarisation.or(asked.binarisation).is_some() {
            return at.refuse("binarisation is for bits = 1; leave it out");
        }
        let binarisation = asked.binarisation.or(file.binarisation).unwrap_or_default();
        if file.bits == 1 && file.quantity != Quantity::Bipolar && binarisation == Binarisation::PulseWidth {
            return at.refuse("pulse-width makes its fringe from u·r* itself; take quantity = \"bipolar\"");
        }
        let tile = file.tile.unwrap_or(2048);
        let mut segment = asked.segment.or(file.segment).unwrap_or(1024.min(tile));
        let mut layout =
            FileLayout { mirror: file.mirror, rotation: file.rotation, guard: file.guard, marks: file.marks, tile };
        if asked.size.is_some() || file.tile.is_none() {
            // A plate that is made smaller than its file says, or whose file says no tiles, gets some that fit.
            layout.tile = tile.min(width.min(height) / 64 * 64).max(64);
            segment = asked.segment.unwrap_or(segment.min(layout.tile));
        }
        let tile = layout.tile;
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
        let wavelength = at.read("wavelength", &file.wavelength, units::wavelength)?;
        let viewer = at.read("scene.viewer", &scene.viewer, units::positive_length)?;
        let resolution = scene.resolution.as_deref().unwrap_or("0.016666666666666666deg");
        let resolution = at.angle("scene.resolution", resolution)?;
        if resolution <= 0.0 {
            return at.refuse("scene.resolution must be greater than zero");
        }
        let slit = match &file.slit {
            None => None,
            Some(slit) => {
                let as_fine_as_the_eye =
                    (viewer * resolution.tan() / pitch_y).clamp(16.0, (tile as f64).max(16.0)) as u64;
                let strip = slit.strip.unwrap_or(1 << as_fine_as_the_eye.ilog2());
                if !(8..=tile).contains(&strip) {
                    return at.refuse(format!("slit.strip = {strip} must be 8 to the tile's {tile}"));
                }
                let wavelengths = match &slit.wavelengths {
                    None => vec![wavelength],
                    Some(texts) => texts
                        .iter()
                        .map(|text| at.read("slit.wavelengths", text, units::wavelength))
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
                Some(Slit { y, height, strip, wavelengths, superimposed: slit.superimposed, only: None })
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
        let searched = file.bits == 1 && binarisation == Binarisation::DirectSearch;
        let eye_box = match &scene.eye_box {
            Some(sides) => {
                let side = |text: &String| at.read("scene.eye_box", text, units::positive_length);
                Some([side(&sides[0])?, side(&sides[1])?])
            }
            // Both eyes, and room to move the head by as much.
            None => searched.then(|| EYE_BOX.map(|share| share * viewer)),
        };
        let plate = Self {
            name: file.name,
            raster,
            wavelength,
            reference,
            fringe: FringeSettings {
                quantity: file.quantity,
                bits: file.bits,
                binarisation,
                bias: at.within("bias", file.bias.unwrap_or(0.5), 0.0..=1.0)?,
                contrast: at.within(
                    "contrast",
                    file.contrast.unwrap_or(if searched { SEARCHED } else { 1.0 }),
                    1e-3..=1e3,
                )?,
                percentile: at.within("percentile", file.percentile.unwrap_or(0.999), 0.5..=1.0)?,
                reference_ratio: at.within("reference_ratio", file.reference_ratio.unwrap_or(1.0), 1e-3..=1e3)?,
                polarity: file.polarity,
            },
            file: layout,
            segment,
            slit,
            view: Viewing {
                viewer,
                resolution,
                rays: match scene.rays.unwrap_or(2) {
                    rays @ 1..=16 => rays,
                    rays => return at.refuse(format!("scene.rays = {rays} must be 1 to 16")),
                },
                place: -at.read("scene.distance", &scene.distance, units::length)?,
                scale: scene.scale,
                phase: asked.phase.unwrap_or(scene.phase),
            },
            object_angle,
            eye_box,
            fade: file.fade,
            error: at.within("error", file.error.unwrap_or(if file.bits == 1 { 1e-2 } else { 5e-3 }), 1e-4..=0.1)?,
            seed: file.seed,
            lamp: file.lamp.as_ref().map(|lamp| lamp.read(at)).transpose()?,
            printer: file.printer.as_ref().map(|printer| printer.read(at)).transpose()?,
            transfer: file.transfer.as_ref().map(|transfer| transfer.read(at)).transpose()?,
        };
        plate.check().map(|()| plate).or_else(|what| at.refuse(what))
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
        assert_eq!((plate.raster.width, plate.raster.height, plate.file.tile, plate.segment), (640, 384, 128, 128));
        let grid = plate.raster.grid();
        assert_eq!((plate.raster.pitch_x, plate.view.place, plate.view.viewer), (1e-6, -5e-3, 60e-3));
        assert!((plate.view.resolution - crate::points::budget::EYE_ANGLE).abs() < 1e-12);
        assert!((grid.x(0) + 319.5e-6).abs() < 1e-15 && (grid.y(0) - 191.5e-6).abs() < 1e-15);
        let sized = SMALL.replace("size = [640, 384]", "extent = [\"0.64mm\", \"0.384mm\"]");
        assert_eq!(Plate::parse(&sized, Path::new("t.toml")).expect("plate"), plate);
        for (from, to) in [
            ("size = [640, 384]", "size = \"0.64mm x 0.384mm\""),
            ("size = [640, 384]", "size = [\"640um\", \"384um\"]"),
            ("pitch = \"1um\"", "step = \"1um\""),
            ("pitch = \"1um\"", "pitch = \"25400dpi\"\nstep = \"0.5um\""),
        ] {
            let same = Plate::parse(&SMALL.replace(from, to), Path::new("t.toml")).expect(to);
            assert_eq!((same.raster.width, same.raster.height), (640, 384), "{to}");
            assert!((same.raster.pitch_x - 1e-6).abs() < 1e-20, "{to}");
        }
        let asked = Asked { size: Some(PlateSize::Lengths([0.2e-3, 0.1e-3])), pitch: Some(0.5e-6), ..Asked::default() };
        let asked = Plate::parse_as(SMALL, Path::new("t.toml"), &asked).expect("plate");
        assert_eq!((asked.raster.width, asked.raster.height, asked.file.tile, asked.segment), (400, 200, 128, 128));
        let oblong = SMALL.replace("pitch = \"1um\"", "pitch_x = \"1um\"\npitch_y = \"0.5um\"");
        let grid = Plate::parse(&oblong, Path::new("t.toml")).expect("plate").raster.grid();
        assert!((grid.extent_x() - 640e-6).abs() < 1e-15 && (grid.extent_y() - 192e-6).abs() < 1e-15);
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
            ("size = [640, 384]", "size = [-1, 384]", "size: give pixels"),
            ("size = [640, 384]", "size = \"0.64mm\"", "size: `0.64mm`"),
            ("size = [640, 384]", "size = \"0.64 x 0.384\"", "no unit"),
            ("size = [640, 384]", "size = \"0mm x 1mm\"", "greater than zero"),
            ("size = [640, 384]", "size = \"NaNmm x 1mm\"", "size:"),
            ("size = [640, 384]", "size = \"100m x 1mm\"", "each side"),
            ("size = [640, 384]", "size = \"0.1um x 1mm\"", "0×1000 pixels"),
            ("size = [640, 384]", "size = [640, 384]\nextent = [\"1mm\", \"1mm\"]", "either size"),
            ("pitch = \"1um\"", "pitch = \"0dpi\"", "pitch"),
            ("pitch = \"1um\"", "pitch = \"1um\"\nstep = \"0.4um\"", "800nm or 1.2um"),
            ("bits = 1", "bit = 1", "bit"),
        ] {
            let text = SMALL.replace(from, to);
            assert_ne!(text, SMALL);
            let refused = Plate::parse(&text, Path::new("t.toml")).expect_err(to).to_string();
            assert!(refused.contains("t.toml") && refused.contains(expected) && !refused.contains('\n'), "{refused}");
        }
    }
}
