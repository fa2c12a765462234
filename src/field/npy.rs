//! Fields and pictures as NumPy `.npy` files, with their metadata in a JSON file beside them.
//!
//! A `.npy` header has no room for pitch or wavelength, so `field.npy` is accompanied by `field.npy.json`
//! ([`FieldMetadata`]). Fields themselves are read and written by [`stored`](super::stored).

use crate::error::{Error, Result};
use crate::field::arrays::{self, Values};
use crate::files;
use crate::units::show_length;
use npyz::{Order, WriterBuilder};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What a field's samples mean; stands beside the `.npy`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FieldMetadata {
    /// Vacuum wavelength [m].
    pub wavelength: f64,
    /// Pixel pitch along x and y [m].
    pub pitch: [f64; 2],
    /// Middle of the grid in the hologram frame [m].
    #[serde(default)]
    pub center: [f64; 2],
    /// Where the field's plane and its content stand.
    #[serde(default)]
    pub content: Content,
    /// Where the field comes from, and the sign convention, in words.
    #[serde(default)]
    pub origin: String,
}

/// Where a field's plane stands, and the content that it shows: what a reconstruction needs to know.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Content {
    /// Distance of the field's plane in front of the panel, z [m].
    #[serde(default)]
    pub z: f64,
    /// Depths z of the nearest and the farthest content in the hologram frame [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<[f64; 2]>,
    /// Eye that the content was placed for [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eye: Option<[f64; 3]>,
    /// Half width and half height of the viewing window on the panel plane [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<[f64; 2]>,
}

impl Content {
    /// Refuses a field that does not stand on the panel, where it has to be encoded.
    ///
    /// # Errors
    /// [`Error::Parameter`] with the distance that brings it there.
    pub fn on_panel(&self) -> Result<()> {
        // What is left of a way there and back.
        if self.z.abs() < 1e-9 {
            return Ok(());
        }
        let [own, back] = [self.z, -self.z].map(show_length);
        let what = format!("stands at z = {own}, not on the panel: propagate it by {back} first");
        Err(Error::parameter("field", what))
    }
}

/// The convention that every field file states.
pub const CONVENTION: &str =
    "time factor exp(-iwt), diverging wave exp(+ikr)/r, row 0 on top, +x right, +y up, +z to the viewer";

/// Name of the metadata beside a `.npy`: `field.npy` → `field.npy.json`.
pub fn metadata_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".json");
    name.into()
}

/// Writes what a field's samples mean beside its file.
///
/// # Errors
/// [`Error::Io`].
pub fn write_metadata(path: &Path, metadata: &FieldMetadata) -> Result<()> {
    let text = serde_json::to_string_pretty(metadata).map_err(|e| Error::input(path, e.to_string()))?;
    files::write_bytes(&metadata_path(path), text.as_bytes())
}

/// Writes an H×W×3 float32 picture of linear radiance, row 0 on top.
pub fn write_picture(path: &Path, width: usize, height: usize, rgb: &[[f32; 3]]) -> Result<()> {
    write(path, &[height as u64, width as u64, 3], rgb.iter().flatten().copied())
}

/// Writes an H×W float32 picture of linear intensity, row 0 on top.
pub fn write_intensity(path: &Path, width: usize, height: usize, values: &[f32]) -> Result<()> {
    write(path, &[height as u64, width as u64], values.iter().copied())
}

fn write<T: npyz::AutoSerialize>(path: &Path, shape: &[u64], values: impl Iterator<Item = T>) -> Result<()> {
    files::write_whole(path, |out| {
        let mut writer = npyz::WriteOptions::<T>::new()
            .default_dtype()
            .shape(shape)
            .order(Order::C)
            .writer(out)
            .begin_nd()
            .map_err(Error::io(path))?;
        writer.extend(values).map_err(Error::io(path))?;
        writer.finish().map_err(Error::io(path))
    })
}

/// Real values read from a file.
#[derive(Clone, Debug)]
pub struct Array<T> {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Values per pixel (1 for a plain H×W array).
    pub channels: usize,
    /// Values in C order.
    pub values: Vec<T>,
}

/// Real values of an H×W or H×W×C array of floats or whole numbers, of any kind of file that [`arrays::read`] reads.
///
/// # Errors
/// As [`arrays::read`]; [`Error::Input`] for complex values, and other numbers of sides.
pub fn read_real(path: &Path) -> Result<Array<f32>> {
    let array = arrays::read(path)?;
    let (width, height, channels) = match *array.shape {
        [height, width] if height > 0 && width > 0 => (width, height, 1),
        [height, width, channels] if height > 0 && width > 0 && channels > 0 => (width, height, channels),
        _ => return Err(Error::input(path, format!("shape {:?}; height × width is needed", array.shape))),
    };
    let values = match array.values {
        Values::Real(values) => values.iter().map(|v| *v as f32).collect(),
        Values::Whole(values) => values.iter().map(|v| *v as f32).collect(),
        Values::Complex(_) => return Err(Error::input(path, "has complex values; real ones are needed")),
    };
    Ok(Array { width, height, channels, values })
}

/// Reads the metadata beside a field, if it is there.
pub fn read_metadata(path: &Path) -> Result<Option<FieldMetadata>> {
    let beside = metadata_path(path);
    if !beside.exists() {
        return Ok(None);
    }
    let text = std::fs::read_to_string(&beside).map_err(Error::io(&beside))?;
    serde_json::from_str(&text).map(Some).map_err(|e| Error::input(&beside, e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truncated_and_foreign_files_are_refused() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("u.npy");
        write_picture(&path, 4, 4, &[[0.5; 3]; 16]).expect("write");
        assert_eq!(read_real(&path).expect("picture").channels, 3);
        let bytes = std::fs::read(&path).expect("bytes");
        for cut in [0, 5, 20, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..cut]).expect("cut");
            assert!(read_real(&path).is_err(), "{cut} bytes were accepted");
        }
    }
}
