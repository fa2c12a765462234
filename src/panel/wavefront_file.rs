//! Wavefronts as files: `.npy` of radians, vendors' tables and pictures.

use super::frame_file::write_png;
use super::vendor;
use super::wavefront::Wavefront;
use crate::error::{Error, Result};
use crate::field::npy;
use crate::files;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What stands beside a wavefront's `.npy`.
#[derive(Serialize, Deserialize)]
struct Beside {
    /// [m].
    wavelength: Option<f64>,
    unit: String,
    convention: String,
}

impl Wavefront {
    /// Reads a wavefront from a file: `.npy` of phases [rad] (H×W, with its wavelength in a JSON file beside it), Santec's
    /// `.csv`, or a vendor's 8-bit gray picture ([`vendor::wavefront_picture`]).
    ///
    /// `wavelength` [m] overrules what the file says.
    ///
    /// # Errors
    /// [`Error::Calibration`] for a file that is none of these; otherwise as the file's own reader.
    pub fn read(path: &Path, wavelength: Option<f64>) -> Result<Self> {
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
                let (color, depth) = (png::ColorType::Grayscale, png::BitDepth::Eight);
                write_png(path, self.width, self.height, color, depth, &bytes, None)
            }
            _ => Err(Error::calibration(path, "a wavefront is written as .npy or .png")),
        }
    }
}
