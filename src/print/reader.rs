//! Levels of a finished plate, rectangle by rectangle, from its file.

use super::folder::open;
use super::geometry::file_raster;
use super::manifest::{Manifest, sha256};
use super::plate::{Plate, Raster};
use super::tiff::{Layout, read_at, unpacked};
use crate::error::{Error, Result};
use serde::Serialize;
use std::collections::VecDeque;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Levels that a reader keeps of tiles it has read [bytes].
const KEPT: usize = 192 << 20;

/// Reads a complete plate.
#[derive(Debug)]
pub struct Reader {
    manifest: Manifest,
    layout: Layout,
    file: File,
    path: PathBuf,
    kept: VecDeque<(u64, Arc<Vec<u8>>)>,
}

impl Reader {
    /// Opens the plate of a folder.
    ///
    /// # Errors
    /// Those of a plate that is missing, incomplete or damaged.
    pub fn open(folder: &Path) -> Result<Self> {
        let (manifest, layout, file, path) = open(folder)?;
        Ok(Self { manifest, layout, file, path, kept: VecDeque::new() })
    }
    /// The plate.
    pub fn plate(&self) -> &Plate {
        &self.manifest.settings.plate
    }
    /// What it was made of.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }
    /// Number of tiles.
    pub fn tiles(&self) -> u64 {
        self.layout.tiles
    }
    /// The pixels of the file.
    pub fn raster(&self) -> Raster {
        file_raster(self.plate())
    }
    /// The levels of a tile as the file shows it.
    ///
    /// # Errors
    /// [`Error::Input`] for one whose bytes are not those that were computed; [`Error::Io`].
    pub fn tile(&mut self, index: u64) -> Result<Arc<Vec<u8>>> {
        if let Some((_, levels)) = self.kept.iter().find(|(kept, _)| *kept == index) {
            return Ok(Arc::clone(levels));
        }
        let bytes = read_at(&self.file, &self.path, self.layout.offset(index), self.layout.tile_bytes)?;
        if self.manifest.tiles.as_ref().is_some_and(|tiles| tiles.get(index as usize) != Some(&sha256(&bytes))) {
            let what = format!("tile {index} is not as it was computed; give the print command again to redo it");
            return Err(Error::input(&self.path, what));
        }
        let levels = Arc::new(unpacked(&bytes, self.plate().fringe.bits));
        while (self.kept.len() + 1) * levels.len() > KEPT && !self.kept.is_empty() {
            self.kept.pop_front();
        }
        self.kept.push_back((index, Arc::clone(&levels)));
        Ok(levels)
    }
    /// Levels of a rectangle of the file; what lies beyond its edge is 0.
    ///
    /// # Errors
    /// As [`Reader::tile`].
    pub fn rectangle(&mut self, [column, row]: [u64; 2], [width, height]: [u64; 2]) -> Result<Vec<u8>> {
        let tile = self.plate().file.tile;
        let Raster { width: file_width, height: file_height, .. } = self.raster();
        let across = file_width.div_ceil(tile);
        let mut out = vec![0u8; (width * height) as usize];
        for tile_row in row / tile..(row + height).min(file_height).div_ceil(tile) {
            for tile_column in column / tile..(column + width).min(file_width).div_ceil(tile) {
                let levels = self.tile(tile_row * across + tile_column)?;
                let rows = row.max(tile_row * tile)..(row + height).min((tile_row + 1) * tile);
                let columns = column.max(tile_column * tile)..(column + width).min((tile_column + 1) * tile);
                for r in rows {
                    let from = ((r - tile_row * tile) * tile + columns.start - tile_column * tile) as usize;
                    let to = ((r - row) * width + columns.start - column) as usize;
                    let count = (columns.end - columns.start) as usize;
                    out[to..to + count].copy_from_slice(&levels[from..from + count]);
                }
            }
        }
        Ok(out)
    }
}

/// What was written.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Exported {
    /// Files.
    pub files: u64,
    /// Their bytes.
    pub bytes: u64,
}
