//! Fields and pictures as NumPy `.npy` files, with their metadata in a JSON file beside them.
//!
//! A `.npy` header has no room for pitch or wavelength, so `field.npy` is accompanied by `field.npy.json`
//! ([`FieldMetadata`]); a field without it is read when the caller says pitch and wavelength.

use crate::error::{Error, Result};
use crate::field::{Complex32, Complex64, Field, Grid, grid};
use crate::files;
use npyz::{NpyFile, Order, WriterBuilder};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::BufReader;
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

/// The convention that every field file states.
pub const CONVENTION: &str =
    "time factor exp(-iwt), diverging wave exp(+ikr)/r, row 0 on top, +x right, +y up, +z to the viewer";

/// Name of the metadata beside a `.npy`: `field.npy` → `field.npy.json`.
pub fn metadata_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".json");
    name.into()
}

/// Writes the field as H×W complex64, and its metadata beside it.
pub fn write_field(path: &Path, field: &Field, content: &Content, origin: &str) -> Result<()> {
    write(path, &[field.grid.height as u64, field.grid.width as u64], field.samples.iter().copied())?;
    let metadata = FieldMetadata {
        wavelength: field.wavelength,
        pitch: [field.grid.pitch_x, field.grid.pitch_y],
        center: field.grid.center,
        content: *content,
        origin: if origin.ends_with(CONVENTION) { origin.into() } else { format!("{origin}; {CONVENTION}") },
    };
    let text = serde_json::to_string_pretty(&metadata).map_err(|e| Error::input(path, e.to_string()))?;
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

/// An array of two or three dimensions read from a `.npy`.
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

/// Complex samples of an H×W array: complex64 or complex128 as they are, a real array as a phase [rad] of amplitude 1.
fn read_complex(path: &Path) -> Result<Array<Complex32>> {
    let npy = open(path)?;
    let (width, height, channels) = shape(path, npy.shape(), npy.order())?;
    if channels != 1 {
        return Err(Error::input(path, "a field must have two dimensions, height × width"));
    }
    let kind = npy.dtype().descr();
    let refused = |e: std::io::Error| Error::input(path, format!("truncated or damaged: {e}"));
    let values: Vec<Complex32> = match kind.trim_matches('\'') {
        "<c8" | ">c8" => npy.into_vec().map_err(refused)?,
        "<c16" | ">c16" => {
            let wide: Vec<Complex64> = npy.into_vec().map_err(refused)?;
            wide.iter().map(|u| Complex32::new(u.re as f32, u.im as f32)).collect()
        }
        "<f8" | ">f8" => npy.into_vec::<f64>().map_err(refused)?.iter().map(|p| turn(*p)).collect(),
        "<f4" | ">f4" => npy.into_vec::<f32>().map_err(refused)?.iter().map(|p| turn((*p).into())).collect(),
        other => {
            let what = format!("values of type {other}; a field is complex64, complex128, or a float phase [rad]");
            return Err(Error::input(path, what));
        }
    };
    if let Some(bad) = values.iter().position(|u| !(u.re.is_finite() && u.im.is_finite())) {
        let what = format!("value at row {}, column {} is not finite", bad / width, bad % width);
        return Err(Error::input(path, what));
    }
    Ok(Array { width, height, channels, values })
}

fn turn(phase: f64) -> Complex32 {
    let u = Complex64::cis(phase);
    Complex32::new(u.re as f32, u.im as f32)
}

/// Real values of an H×W or H×W×C array of float32, float64, uint8 or uint16.
pub fn read_real(path: &Path) -> Result<Array<f32>> {
    let npy = open(path)?;
    let (width, height, channels) = shape(path, npy.shape(), npy.order())?;
    let kind = npy.dtype().descr();
    let refused = |e: std::io::Error| Error::input(path, format!("truncated or damaged: {e}"));
    let values: Vec<f32> = match kind.trim_matches('\'') {
        "<f4" | ">f4" => npy.into_vec().map_err(refused)?,
        "<f8" | ">f8" => npy.into_vec::<f64>().map_err(refused)?.iter().map(|v| *v as f32).collect(),
        "|u1" => npy.into_vec::<u8>().map_err(refused)?.iter().map(|v| f32::from(*v)).collect(),
        "<u2" | ">u2" => npy.into_vec::<u16>().map_err(refused)?.iter().map(|v| f32::from(*v)).collect(),
        other => return Err(Error::input(path, format!("values of type {other}; float32, float64, uint8 or uint16"))),
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

/// Reads a field with its metadata; `pitch` and `wavelength`, where given, stand before what the file says.
pub fn read_field(path: &Path, pitch: Option<[f64; 2]>, wavelength: Option<f64>) -> Result<(Field, FieldMetadata)> {
    let array = read_complex(path)?;
    let beside = read_metadata(path)?;
    let missing = |what: &str| {
        let beside = metadata_path(path);
        Error::input(path, format!("its {what} is not known: no {} beside it; give the {what}", beside.display()))
    };
    let wavelength = wavelength.or(beside.as_ref().map(|m| m.wavelength)).ok_or_else(|| missing("wavelength"))?;
    let pitch = pitch.or(beside.as_ref().map(|m| m.pitch)).ok_or_else(|| missing("pitch"))?;
    grid::positive("wavelength", wavelength).map_err(|e| Error::input(path, e.to_string()))?;
    let center = beside.as_ref().map_or([0.0; 2], |m| m.center);
    let grid = Grid::new(array.width, array.height, pitch[0], pitch[1])?.centered_at(center);
    let content = beside.as_ref().map_or_else(Content::default, |m| m.content);
    let origin = beside.map_or_else(String::new, |m| m.origin);
    let metadata = FieldMetadata { wavelength, pitch, center, content, origin };
    Ok((Field::new(grid, wavelength, array.values)?, metadata))
}

fn open(path: &Path) -> Result<NpyFile<BufReader<File>>> {
    let file = File::open(path).map_err(Error::io(path))?;
    let length = file.metadata().map_err(Error::io(path))?.len();
    let npy = NpyFile::new(BufReader::new(file)).map_err(|e| Error::input(path, format!("not a .npy file: {e}")))?;
    // A header can promise any size; what it promises must be in the file before memory is taken for it.
    let promised = npy.shape().iter().try_fold(1u64, |n, &side| n.checked_mul(side));
    if promised.is_none_or(|n| n > length) {
        let what = format!("truncated: promises {:?} values, the file has {length} bytes", npy.shape());
        return Err(Error::input(path, what));
    }
    Ok(npy)
}

fn shape(path: &Path, shape: &[u64], order: Order) -> Result<(usize, usize, usize)> {
    if order != Order::C {
        return Err(Error::input(path, "stored in Fortran order; save it with numpy.ascontiguousarray"));
    }
    match *shape {
        [height, width] if height > 0 && width > 0 => Ok((width as usize, height as usize, 1)),
        [height, width, channels] if height > 0 && width > 0 && channels > 0 => {
            Ok((width as usize, height as usize, channels as usize))
        }
        _ => Err(Error::input(path, format!("shape {shape:?}; height × width is needed"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_comes_back_as_it_was() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("u.npy");
        let grid = Grid::new(5, 3, 8e-6, 9e-6).expect("grid").centered_at([1e-3, -2e-3]);
        let samples = (0..15).map(|i| Complex32::new(i as f32, -0.5 * i as f32)).collect();
        let field = Field::new(grid, 532e-9, samples).expect("field");
        let content = Content { z: 0.25, depth: Some([-0.1, -0.2]), ..Content::default() };
        write_field(&path, &field, &content, "test").expect("write");
        let (back, metadata) = read_field(&path, None, None).expect("read");
        assert_eq!(back, field);
        assert_eq!(metadata.content, content);
        std::fs::remove_file(metadata_path(&path)).expect("remove");
        let refused = read_field(&path, Some([8e-6, 9e-6]), None).unwrap_err().to_string();
        assert!(refused.contains("give the wavelength"), "{refused}");
    }

    #[test]
    fn truncated_and_foreign_files_are_refused() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("u.npy");
        write_picture(&path, 4, 4, &[[0.5; 3]; 16]).expect("write");
        assert_eq!(read_real(&path).expect("picture").channels, 3);
        assert!(read_complex(&path).is_err());
        let bytes = std::fs::read(&path).expect("bytes");
        for cut in [0, 5, 20, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..cut]).expect("cut");
            assert!(read_real(&path).is_err(), "{cut} bytes were accepted");
        }
    }
}
