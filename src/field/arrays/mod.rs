//! Arrays in the files of other programs: NumPy's `.npy` and `.npz`, MATLAB's `.mat`, HDF5, TIFF of floats, channels of EXR.
//!
//! What is read is one array of numbers, in C order (row by row, the last axis fastest), whatever the file's own order. A
//! file that holds several says which by a name behind a colon: `lab.mat:U`, `run.h5:/scan/field`.

mod element;
mod hdf5;
pub(crate) mod lzf;
mod matlab;
mod numpy;
#[cfg(feature = "exr")]
mod openexr;
mod shape;
#[cfg(feature = "tiff")]
mod tagged;
mod write;

pub use element::Values;
pub(crate) use element::{Class, Element};
pub use write::{Named, write};

use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// An array in C order.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Sides, the slowest first.
    pub shape: Vec<usize>,
    /// Values, as many as the product of the sides.
    pub values: Values,
    /// What was read, in words: which variable, in which order.
    pub origin: String,
}

/// A kind of file that holds arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Npy,
    Npz,
    Mat,
    Hdf5,
    Tiff,
    Exr,
}

impl Kind {
    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_string_lossy().to_lowercase();
        Some(match extension.as_str() {
            "npy" => Self::Npy,
            "npz" => Self::Npz,
            "mat" => Self::Mat,
            "h5" | "hdf5" | "hdf" => Self::Hdf5,
            "tif" | "tiff" => Self::Tiff,
            "exr" => Self::Exr,
            _ => return None,
        })
    }
}

/// A file and the name of one of its arrays: `lab.mat:U` → `lab.mat`, `U`. A file of that whole name goes first.
pub fn split(path: &Path) -> (PathBuf, Option<String>) {
    let whole = || (path.to_path_buf(), None);
    let Some(text) = path.to_str().filter(|_| !path.exists()) else { return whole() };
    let mut colons = text.match_indices(':').map(|(at, _)| (&text[..at], &text[at + 1..]));
    let found = colons.rfind(|(file, name)| !name.is_empty() && Kind::of(Path::new(file)).is_some());
    found.map_or_else(whole, |(file, name)| (file.into(), Some(name.into())))
}

/// Whether the name is one of a file of arrays.
pub fn is_array_file(path: &Path) -> bool {
    Kind::of(&split(path).0).is_some()
}

/// Whether a `.npz` has an array of that name; one that cannot be read has any.
pub fn npz_holds(path: &Path, name: &str) -> bool {
    super::npy_zip::Npz::open(path).map_or(true, |npz| npz.names().any(|own| own == name))
}

/// Whether a TIFF holds floats, one a pixel: numbers, not levels of gray.
pub fn is_float_tiff(path: &Path) -> bool {
    #[cfg(feature = "tiff")]
    return tagged::is_float(path);
    #[cfg(not(feature = "tiff"))]
    {
        let _ = path;
        false
    }
}

/// Reads the array of a file, or the one of several whose name stands behind a colon.
///
/// # Errors
/// [`Error::Input`] for a file that is none of these kinds, is damaged, holds no array of numbers or several, which it then
/// lists; [`Error::Unsupported`] for a kind that this build does not read.
pub fn read(path: &Path) -> Result<Array> {
    let (file, name) = split(path);
    let name = name.as_deref();
    let only = |array: Result<Array>| match name {
        None => array,
        Some(name) => Err(Error::input(&file, format!("holds one array without a name; leave `:{name}` out"))),
    };
    match Kind::of(&file) {
        Some(Kind::Npy) => only(numpy::read_npy(&file)),
        Some(Kind::Npz) => numpy::read_npz(&file, name),
        Some(Kind::Mat) if is_hdf5(&file)? => hdf5::read(&file, name),
        Some(Kind::Mat) => matlab::read(&file, name),
        Some(Kind::Hdf5) => hdf5::read(&file, name),
        Some(Kind::Tiff) => only(read_tiff(&file)),
        Some(Kind::Exr) => read_exr(&file, name),
        None => Err(Error::input(path, "no kind of array that is read: .npy, .npz, .mat, .h5, .tif, .exr")),
    }
}

/// Whether a `.mat` is one of version 7.3, which is HDF5.
fn is_hdf5(path: &Path) -> Result<bool> {
    use std::io::Read;
    let mut begin = Vec::new();
    std::fs::File::open(path).map_err(Error::io(path))?.take(520).read_to_end(&mut begin).map_err(Error::io(path))?;
    let magic = b"\x89HDF\r\n\x1a\n";
    Ok(begin.starts_with(magic) || begin.get(512..520) == Some(magic))
}

#[cfg(feature = "tiff")]
use tagged::read as read_tiff;

#[cfg(not(feature = "tiff"))]
fn read_tiff(path: &Path) -> Result<Array> {
    Err(Error::unsupported(format!("{}: this build reads no TIFF; build it with the feature `tiff`", path.display())))
}

#[cfg(feature = "exr")]
use openexr::read as read_exr;

#[cfg(not(feature = "exr"))]
fn read_exr(path: &Path, _name: Option<&str>) -> Result<Array> {
    Err(Error::unsupported(format!("{}: this build reads no EXR; build it with the feature `exr`", path.display())))
}

/// Of the arrays in a file, by name with what they are, the one that was asked for, or the only one.
fn choose<'a, T>(path: &Path, name: Option<&str>, there: &'a [(String, String, T)]) -> Result<&'a (String, String, T)> {
    const MOST_NAMED: usize = 12;
    let list = || {
        let mut named: Vec<String> =
            there.iter().take(MOST_NAMED).map(|(name, what, _)| format!("{name} ({what})")).collect();
        named.extend((there.len() > MOST_NAMED).then(|| format!("{} more", there.len() - MOST_NAMED)));
        named.join(", ")
    };
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    let called = |own: &str, wanted: &str| own.trim_start_matches('/') == wanted.trim_start_matches('/');
    match (name, there) {
        (_, []) => Err(Error::input(path, "holds no array of numbers with two sides or more")),
        (Some(wanted), _) => there
            .iter()
            .find(|(own, ..)| called(own, wanted))
            .ok_or_else(|| Error::input(path, format!("has no `{wanted}`; there is {}", list()))),
        (None, [one]) => Ok(one),
        (None, [(first, ..), ..]) => {
            Err(Error::input(path, format!("holds several arrays: {}; name one, such as {file}:{first}", list())))
        }
    }
}

/// Sides as they are written: 1080×1920.
fn sides(shape: &[usize]) -> String {
    shape.iter().map(ToString::to_string).collect::<Vec<_>>().join("×")
}

#[cfg(test)]
mod tests;
