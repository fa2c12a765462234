//! A card as a finished plate: the folder, file and manifest of one, so that it is verified and exported as plates are.

use super::card::Card;
use super::folder::{self, PLATE};
use super::geometry::{plate_from_file, tile_in_file};
use super::manifest::{Manifest, Settings, sha256};
use super::plate::{FileLayout, Plate, Raster};
use super::tiff::{Layout, packed};
use crate::error::{Error, Result};
use crate::files;
use crate::progress::Progress;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

/// A patch is so long where nothing else is asked [m], but never fewer pixels than [`FEWEST`].
const PATCH: f64 = 1e-3;
/// Pixels across a patch at least: eight periods of the coarsest lines.
const FEWEST: u64 = 192;
/// And at most.
const MOST: u64 = 1 << 16;

/// A card that was written.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct WrittenCard {
    /// Columns and rows [px].
    pub size: [u64; 2],
    /// Width and height [m].
    pub extent: [f64; 2],
    /// Pixels across a patch.
    pub patch: u64,
    /// Patches that differ.
    pub patches: usize,
    /// Length of the file [bytes].
    pub bytes: u64,
}

/// Writes the card for a plate's printer into a folder; a patch is `patch` long [m].
///
/// # Errors
/// [`Error::Parameter`] for a patch of too few or too many pixels; [`Error::Input`] for a folder that holds a plate; [`Error::Io`];
/// [`Error::Interrupted`].
pub fn write_card(plate: &Plate, patch: Option<f64>, folder: &Path, progress: &Progress) -> Result<WrittenCard> {
    let Raster { pitch_x, pitch_y, .. } = plate.raster;
    let across = |length: f64| (length / pitch_x.min(pitch_y)).round() as u64;
    let side = match patch {
        Some(length) => across(length),
        None => across(PATCH).max(FEWEST),
    };
    if !(FEWEST / 4..=MOST).contains(&side) {
        let what = format!("{side} pixels across a patch; give a length of {} to {MOST} pixels", FEWEST / 4);
        return Err(Error::parameter("patch", what));
    }
    let card = Card::new(plate.fringe.bits, side);
    let [width, height] = card.size();
    let name = format!("{} card", plate.name);
    let file = FileLayout { guard: 0, marks: 0, tile: 1024.min(width.min(height) / 64 * 64), ..plate.file };
    let raster = Raster { width, height, ..plate.raster };
    let segment = file.tile;
    let plate = Plate { name, raster, file, segment, slit: None, transfer: None, fade: 0, ..plate.clone() };
    plate.check().map_err(|what| Error::parameter("patch", what))?;
    let program = concat!("holodrive ", env!("CARGO_PKG_VERSION")).to_owned();
    let options = BTreeMap::from([("card".to_owned(), serde_json::json!({ "patch": side }))]);
    let settings = Settings { program, plate: plate.clone(), inputs: Vec::new(), options };
    if folder::look(folder, &settings)?.is_some() {
        return Err(Error::input(folder, "holds this card already"));
    }
    files::output_folder(folder)?;
    let layout = Layout::new(&plate);
    let mut hashes = Vec::new();
    let path = folder.join(PLATE);
    progress.start("card", layout.tiles);
    files::write_whole(&path, |out| {
        out.write_all(&layout.head).map_err(Error::io(&path))?;
        for index in 0..layout.tiles {
            progress.check()?;
            let rect = tile_in_file(&plate, index);
            let mut levels = vec![0u8; (plate.file.tile * plate.file.tile) as usize];
            for (row, line) in (rect.y[0]..rect.y[1]).zip(levels.chunks_exact_mut(plate.file.tile as usize)) {
                for (column, level) in (rect.x[0]..rect.x[1]).zip(line) {
                    *level = card.level(plate_from_file(&plate, [column, row]).map(|at| at as u64));
                }
            }
            let mut bytes = packed(&levels, plate.fringe.bits);
            hashes.push(sha256(&bytes));
            bytes.resize(layout.stride as usize, 0);
            out.write_all(&bytes).map_err(Error::io(&path))?;
            progress.advance(1);
        }
        Ok(())
    })?;
    let manifest =
        Manifest { settings, instruction_set: "none".to_owned(), amplitude: 1.0, white: 0.0, tiles: Some(hashes) };
    // Last, so that a folder with a manifest is a whole card.
    manifest.create(folder)?;
    let grid = plate.raster.grid();
    Ok(WrittenCard {
        size: [width, height],
        extent: [grid.extent_x(), grid.extent_y()],
        patch: side,
        patches: card.half.len(),
        bytes: layout.length(),
    })
}
