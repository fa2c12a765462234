//! Point clouds of any kind of file: PLY, tables of text, PCD, the vertices of OBJ, LAS of laser scanners, glTF
//! without surfaces.

mod gltf;
#[cfg(feature = "las")]
mod las;
mod obj;
mod pcd;
mod table;

use super::gather::{Gather, Role, Vertex};
use super::ply;
use crate::error::{Error, Result};
use crate::scene::gltf::has_only_points;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Longest line that is read [bytes].
const MOST_LINE: u64 = 1 << 16;

/// Endings of the clouds that are read; an `obj` with faces is a scene.
const ENDINGS: &[&str] = &[
    "ply",
    "xyz",
    "txt",
    "csv",
    "pts",
    "asc",
    "pcd",
    "obj",
    #[cfg(feature = "las")]
    "las",
    #[cfg(feature = "las")]
    "laz",
];

/// Whether a file is a cloud: by its ending, a glTF by what it holds.
pub fn is_cloud(path: &Path) -> bool {
    has_only_points(path)
        || path.extension().is_some_and(|e| ENDINGS.iter().any(|ending| e.eq_ignore_ascii_case(ending)))
}

/// Reads a cloud, by the file's ending.
///
/// # Errors
/// [`Error::Input`] for what is no cloud, or is damaged.
pub fn read(path: &Path) -> Result<ply::Read> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "ply" => ply::read(path),
        "xyz" | "txt" | "csv" | "pts" | "asc" => table::read(path),
        "pcd" => pcd::read(path),
        "obj" => obj::read(path),
        "gltf" | "glb" => gltf::read(path),
        #[cfg(feature = "las")]
        "las" | "laz" => las::read(path),
        _ => Err(Error::input(path, "no kind of point cloud that is read: .ply, .xyz, .csv, .pcd, .obj, .las")),
    }
}

/// Lines of a text, with their numbers from 1 on.
struct Lines<'a> {
    path: &'a Path,
    input: BufReader<File>,
    line: Vec<u8>,
    number: usize,
}

impl<'a> Lines<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        let file = File::open(path).map_err(Error::io(path))?;
        Ok(Self { path, input: BufReader::with_capacity(1 << 20, file), line: Vec::new(), number: 0 })
    }

    /// The next line; none after the last.
    fn next(&mut self) -> Result<Option<String>> {
        self.line.clear();
        let mut limited = std::io::Read::take(&mut self.input, MOST_LINE);
        limited.read_until(b'\n', &mut self.line).map_err(Error::io(self.path))?;
        if self.line.is_empty() {
            return Ok(None);
        }
        self.number += 1;
        if self.line.len() as u64 == MOST_LINE {
            return Err(self.refused("is too long for a line of text"));
        }
        Ok(Some(String::from_utf8_lossy(&self.line).trim().to_owned()))
    }

    fn refused(&self, what: &str) -> Error {
        Error::input(self.path, format!("line {}: {what}", self.number))
    }
}

#[cfg(test)]
mod tests;
