//! Arrays out, in the kind of file that the name says.

use super::hdf5;
use super::matlab::{COMPLEX, HEAD, INT8, INT32, MATRIX, UINT32};
use super::{Kind, Values};
use crate::error::{Error, Result};
use crate::field::npy_head;
use crate::files;
use std::io::Write;
use std::path::Path;

/// An array of rows and columns with its name, for files that have names.
#[derive(Clone, Debug)]
pub struct Named<'a> {
    /// Its name.
    pub name: &'a str,
    /// Rows and columns.
    pub shape: [usize; 2],
    /// Values row by row: complex and float in single precision, whole numbers in one or two bytes.
    pub values: &'a Values,
}

/// Writes arrays as the file's name says: `.mat` (version 5) and `.h5` take all, `.npy` and `.tif` the first.
///
/// # Errors
/// [`Error::Input`] for a name of no such kind, and for what that kind cannot hold; [`Error::Io`].
pub fn write(path: &Path, arrays: &[Named]) -> Result<()> {
    let [first, ..] = arrays else { return Err(Error::input(path, "there is no array to write")) };
    match Kind::of(path) {
        Some(Kind::Npy) => files::write_whole(path, |out| {
            let element = Stored::of(first.values);
            let mut put = |bytes: &[u8]| out.write_all(bytes).map_err(Error::io(path));
            put(&npy_head::of(element.numpy(), &first.shape))?;
            (0..first.values.count()).try_for_each(|i| element.bytes(first.values, i, &mut put))
        }),
        Some(Kind::Mat) => files::write_whole(path, |out| {
            let mut put = |bytes: &[u8]| out.write_all(bytes).map_err(Error::io(path));
            put(&matlab_head())?;
            arrays.iter().try_for_each(|array| matrix(path, array, &mut put))
        }),
        Some(Kind::Hdf5) => files::write_whole(path, |out| {
            let mut put = |bytes: &[u8]| out.write_all(bytes).map_err(Error::io(path));
            let stored = |array: &Named| (Stored::of(array.values), array.values.count());
            let heads: Vec<_> = arrays.iter().map(|array| (array.name, array.shape, stored(array).0.hdf5())).collect();
            put(&hdf5::head(&heads))?;
            arrays.iter().try_for_each(|array| {
                let (element, count) = stored(array);
                (0..count).try_for_each(|i| element.bytes(array.values, i, &mut put))
            })
        }),
        Some(Kind::Tiff) => tiff(path, first),
        _ => Err(Error::input(path, "no kind of array that is written: .npy, .mat, .h5, .tif")),
    }
}

#[cfg(feature = "tiff")]
fn tiff(path: &Path, array: &Named) -> Result<()> {
    let values: Vec<f32> = match array.values {
        Values::Complex(_) => {
            let what = "a TIFF holds no complex values; write .npy or .mat";
            return Err(Error::input(path, what));
        }
        Values::Real(values) => values.iter().map(|v| *v as f32).collect(),
        Values::Whole(values) => return super::tagged::write_levels(path, array.shape, values),
    };
    super::tagged::write(path, array.shape, &values)
}

#[cfg(not(feature = "tiff"))]
fn tiff(path: &Path, _: &Named) -> Result<()> {
    Err(Error::unsupported(format!("{}: this build writes no TIFF; build it with the feature `tiff`", path.display())))
}

/// How values are stored.
#[derive(Clone, Copy, PartialEq)]
enum Stored {
    Complex,
    Single,
    Byte,
    Word,
}

impl Stored {
    fn of(values: &Values) -> Self {
        match values {
            Values::Complex(_) => Self::Complex,
            Values::Real(_) => Self::Single,
            Values::Whole(values) if values.iter().all(|v| *v < 256) => Self::Byte,
            Values::Whole(_) => Self::Word,
        }
    }

    fn numpy(self) -> &'static str {
        match self {
            Self::Complex => "<c8",
            Self::Single => "<f4",
            Self::Byte => "|u1",
            Self::Word => "<u2",
        }
    }

    fn hdf5(self) -> hdf5::Stored {
        match self {
            Self::Complex => hdf5::Stored::Complex,
            Self::Single => hdf5::Stored::Single,
            Self::Byte => hdf5::Stored::Whole(1),
            Self::Word => hdf5::Stored::Whole(2),
        }
    }

    /// MATLAB's class of the matrix, type of its values, and bytes of one.
    fn matlab(self) -> (u32, u32, usize) {
        match self {
            Self::Complex | Self::Single => (7, 7, 4),
            Self::Byte => (9, 2, 1),
            Self::Word => (11, 4, 2),
        }
    }

    fn bytes(self, values: &Values, i: usize, put: &mut dyn FnMut(&[u8]) -> Result<()>) -> Result<()> {
        match values {
            Values::Complex(v) => {
                put(&v[i].re.to_le_bytes())?;
                put(&v[i].im.to_le_bytes())
            }
            Values::Real(v) => put(&(v[i] as f32).to_le_bytes()),
            Values::Whole(v) if self == Self::Byte => put(&[v[i] as u8]),
            Values::Whole(v) => put(&(v[i] as u16).to_le_bytes()),
        }
    }
}

fn matlab_head() -> Vec<u8> {
    let mut head = format!("{:<116}", "MATLAB 5.0 MAT-file, written by holodrive").into_bytes();
    head.extend([0; 8]);
    head.extend([0, 1]);
    head.extend(b"IM");
    debug_assert_eq!(head.len(), HEAD);
    head
}

/// An element that is not short: type, length, bytes, and zeros up to a multiple of eight.
fn element(kind: u32, bytes: &[u8]) -> Vec<u8> {
    let mut out = [kind, bytes.len() as u32].map(u32::to_le_bytes).concat();
    out.extend(bytes);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

/// A matrix, column by column.
fn matrix(path: &Path, array: &Named, put: &mut dyn FnMut(&[u8]) -> Result<()>) -> Result<()> {
    let [height, width] = array.shape;
    let element_of = Stored::of(array.values);
    let (class, kind, wide) = element_of.matlab();
    let flags = if element_of == Stored::Complex { class | COMPLEX } else { class };
    let length = width * height * wide;
    let parts = if element_of == Stored::Complex { 2 } else { 1 };
    let mut head = element(UINT32, &[flags, 0].map(u32::to_le_bytes).concat());
    head.extend(element(INT32, &[height as u32, width as u32].map(u32::to_le_bytes).concat()));
    head.extend(element(INT8, array.name.as_bytes()));
    let whole = head.len() + parts * (8 + length.next_multiple_of(8));
    let whole = u32::try_from(whole)
        .map_err(|_| Error::input(path, "more than 4 GB, which a .mat of version 5 cannot hold"))?;
    put(&[MATRIX, whole].map(u32::to_le_bytes).concat())?;
    put(&head)?;
    for part in 0..parts {
        put(&[kind, length as u32].map(u32::to_le_bytes).concat())?;
        for i in (0..width).flat_map(|column| (0..height).map(move |row| row * width + column)) {
            match array.values {
                Values::Complex(v) => put(&if part == 0 { v[i].re } else { v[i].im }.to_le_bytes())?,
                other => element_of.bytes(other, i, put)?,
            }
        }
        put(&[0; 8][..length.next_multiple_of(8) - length])?;
    }
    Ok(())
}
