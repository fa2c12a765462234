//! A phase over the panel's pixels: the wavefront error of a panel, or the correction that undoes it.

use super::vendor;
use crate::error::{Error, Result};
use crate::field::npy;
use crate::files;
use crate::units::show_length;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A phase for each pixel of a panel, at the wavelength at which it was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wavefront {
    /// Where it comes from, as metadata and reports name it.
    pub name: String,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Wavelength at which the phases hold [m]; absent where the file does not say.
    pub wavelength: Option<f64>,
    /// Phase of each pixel [rad], row-major, row 0 on top. It may have been wrapped to one turn.
    pub phase: Vec<f32>,
}

impl Wavefront {
    /// A wavefront from its phases [rad]; refused when their number is not `width × height` or one is not finite.
    pub fn new(name: &str, width: usize, height: usize, wavelength: Option<f64>, phase: Vec<f32>) -> Result<Self> {
        if phase.len() != width * height {
            return Err(Error::calibration(name, format!("{} phases for {width}×{height} pixels", phase.len())));
        }
        if let Some(i) = phase.iter().position(|p| !p.is_finite()) {
            let what = format!("the phase at column {}, row {} is not finite", i % width, i / width);
            return Err(Error::calibration(name, what));
        }
        Ok(Self { name: name.into(), width, height, wavelength, phase })
    }

    /// The opposite phase: the correction of a measured wavefront error.
    pub fn conjugate(mut self) -> Self {
        for phase in &mut self.phase {
            *phase = -*phase;
        }
        self
    }

    /// Checks that it fits `width × height` pixels at a wavelength [m], and returns what to warn of.
    ///
    /// Phases wrapped to one turn cannot be carried to another wavelength: they are used as they are within 10 % (with
    /// a warning beyond 1 nm) and refused further away.
    pub fn check(&self, width: usize, height: usize, wavelength: f64) -> Result<Vec<String>> {
        if (self.width, self.height) != (width, height) {
            let what = format!(
                "the wavefront is {}×{} pixels, the panel {width}×{height}; take the file of this panel",
                self.width, self.height
            );
            return Err(Error::calibration(&self.name, what));
        }
        let Some(own) = self.wavelength else {
            return Ok(vec![format!("{}: the wavefront's wavelength is not known", self.name)]);
        };
        let distance = (own - wavelength).abs();
        let (has, wished) = (show_length(own), show_length(wavelength));
        if distance > 0.1 * own {
            let what =
                format!("the wavefront was measured at {has}, the light has {wished}; take the file for {wished}");
            return Err(Error::calibration(&self.name, what));
        }
        if distance > 1e-9 {
            return Ok(vec![format!("{}: the wavefront for {has} is used at {wished}", self.name)]);
        }
        Ok(Vec::new())
    }
}

/// What stands beside a wavefront's `.npy`.
#[derive(Serialize, Deserialize)]
struct Beside {
    /// [m].
    wavelength: Option<f64>,
    unit: String,
    convention: String,
}

/// Reads a wavefront from a file: `.npy` of phases [rad] (H×W, with its wavelength in a JSON file beside it), Santec's
/// `.csv`, or a vendor's 8-bit gray picture ([`vendor::wavefront_picture`]).
///
/// `wavelength` [m] overrules what the file says.
///
/// # Errors
/// [`Error::Calibration`] for a file that is none of these; otherwise as the file's own reader.
pub fn read(path: &Path, wavelength: Option<f64>) -> Result<Wavefront> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "csv" => vendor::santec_wavefront(path, wavelength),
        "npy" => {
            let array = npy::read_real(path)?;
            if array.channels != 1 {
                return Err(Error::calibration(path, "a wavefront has two dimensions, height × width"));
            }
            let beside = npy::metadata_path(path);
            let own = if beside.exists() {
                let text = vendor::text(&beside)?;
                let read: Beside =
                    serde_json::from_str(&text).map_err(|e| Error::calibration(&beside, e.to_string()))?;
                read.wavelength.filter(|w| w.is_finite() && *w > 0.0)
            } else {
                None
            };
            Wavefront::new(&path.display().to_string(), array.width, array.height, wavelength.or(own), array.values)
        }
        "png" | "bmp" | "tif" | "tiff" => vendor::wavefront_picture(path, wavelength),
        _ => Err(Error::calibration(path, "no kind of wavefront that is read here: .npy, .csv, .bmp, .png")),
    }
}

impl Wavefront {
    /// Writes the wavefront: `.npy` of radians with its wavelength beside it, or a `.png` of 256 grays a turn, as vendors'
    /// pictures are.
    ///
    /// # Errors
    /// [`Error::Calibration`] for another kind of file; [`Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        match extension.as_str() {
            "npy" => {
                npy::write_intensity(path, self.width, self.height, &self.phase)?;
                let convention = format!("phase to add to a pattern; row 0 on top; {}", npy::CONVENTION);
                let beside = Beside { wavelength: self.wavelength, unit: "rad".into(), convention };
                let text =
                    serde_json::to_string_pretty(&beside).map_err(|e| Error::calibration(path, e.to_string()))?;
                files::write_bytes(&npy::metadata_path(path), text.as_bytes())
            }
            "png" => {
                let gray = |phase: &f32| {
                    let turns = f64::from(*phase) / std::f64::consts::TAU;
                    ((turns - turns.floor()) * 256.0).round() as u32 as u8
                };
                let bytes: Vec<u8> = self.phase.iter().map(gray).collect();
                let refused = |e: png::EncodingError| match e {
                    png::EncodingError::IoError(source) => Error::Io { path: path.into(), source },
                    other => Error::calibration(path, other.to_string()),
                };
                files::write_whole(path, |out| {
                    let mut encoder = png::Encoder::new(out, self.width as u32, self.height as u32);
                    encoder.set_color(png::ColorType::Grayscale);
                    let mut writer = encoder.write_header().map_err(refused)?;
                    writer.write_image_data(&bytes).map_err(refused)?;
                    writer.finish().map_err(refused)
                })
            }
            _ => Err(Error::calibration(path, "a wavefront is written as .npy or .png")),
        }
    }
}
