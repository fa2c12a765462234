//! A plate's folder: begun, interrupted at any moment, gone on with, shared among processes, finished, checked.
//!
//! A folder holds `manifest.json` ([`Manifest`]), the plate's file, until it is complete as `.plate.tif.partial`, and
//! in `.tiles` one list a process of the tiles that it finished, with their hashes. A tile enters the list after its bytes
//! are on the disk. Whoever goes on reads the tiles of all lists again: one whose bytes have another hash is redone. When all
//! are there, the file gets its name, the manifest their hashes, and the lists go: what is left does not tell by how many
//! processes, in which order and with how many interruptions it came about.

use super::fringe::PlateFringes;
use super::manifest::{self, Manifest, Settings, sha256};
use super::shard::Shard;
use super::tiff::{Layout, packed, read_at, write_at};
use crate::error::{Error, Result};
use crate::files;
use crate::progress::Progress;
use crate::segments::Work;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime};

/// Name of the finished plate.
pub const PLATE: &str = "plate.tif";
/// Its name until it is finished.
const PARTIAL: &str = ".plate.tif.partial";
/// Folder of the lists.
const LISTS: &str = ".tiles";

/// What became of the tiles of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TileReport {
    /// Tiles of the plate.
    pub tiles: u64,
    /// Tiles of this run's part.
    pub part: u64,
    /// Tiles that were there already, whole.
    pub kept: u64,
    /// Tiles that were listed but had other bytes.
    pub torn: u64,
    /// Tiles computed now.
    pub computed: u64,
    /// Tiles of the whole plate that are finished.
    pub finished: u64,
    /// Whether the plate is complete.
    pub complete: bool,
    /// What computing took.
    pub work: Work,
    /// Wall time [s].
    pub seconds: f64,
}

/// What [`verify`] found in a complete plate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verified {
    /// Tiles, all with the hashes of the manifest.
    pub tiles: u64,
    /// Length of the file [bytes].
    pub bytes: u64,
    /// Wall time [s].
    pub seconds: f64,
}

fn find(folder: &Path) -> Option<PathBuf> {
    // Links count too: they are refused by name, not gone round.
    [PLATE, PARTIAL].iter().map(|name| folder.join(name)).find(|path| path.symlink_metadata().is_ok())
}

/// Refuses a name that is taken by a link or by something else than a file: what it points to is not the plate's.
fn refuse_link(path: &Path) -> Result<()> {
    match path.symlink_metadata() {
        Ok(there) if !there.is_file() => {
            let kind = if there.is_symlink() { "a link" } else { "no file" };
            Err(Error::input(path, format!("is {kind}, and a plate is not written through it; remove it")))
        }
        _ => Ok(()),
    }
}

/// Opens a plate's file to read and write it: one that is there, never through a link, or a new one.
fn open_own(path: &Path) -> Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NOFOLLOW | libc::O_NONBLOCK);
    for _ in 0..2 {
        refuse_link(path)?;
        match options.clone().create_new(true).open(path) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            other => return other.map_err(Error::io(path)),
        }
        match options.open(path) {
            // Another process has just given it its last name.
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            other => return other.map_err(Error::io(path)),
        }
    }
    Err(Error::input(path, "comes and goes; is another print at work on the same part?"))
}

/// Refuses a folder that holds another plate, or a plate's file that belongs to none; returns the manifest if there is one.
///
/// # Errors
/// [`Error::Input`].
pub(super) fn look(folder: &Path, settings: &Settings) -> Result<Option<Manifest>> {
    match Manifest::read(folder)? {
        Some(manifest) => manifest.check(folder, settings).map(|()| Some(manifest)),
        None => match find(folder) {
            Some(path) => Err(Error::input(path, "stands there without a manifest; take another folder")),
            None => Ok(None),
        },
    }
}

/// Hashes in the lists of a folder; lines that were cut off count for nothing.
fn listed(folder: &Path, tiles: u64) -> Result<BTreeMap<u64, String>> {
    let lists = folder.join(LISTS);
    if lists.is_symlink() {
        return Err(Error::input(&lists, "is a link, and lists of tiles are not kept behind one; remove it"));
    }
    let mut found = BTreeMap::new();
    let entries = match fs::read_dir(&lists) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(found),
        other => other.map_err(Error::io(&lists))?,
    };
    for entry in entries {
        let path = entry.map_err(Error::io(&lists))?.path();
        // Another process may just have finished the plate and taken the lists away.
        let text = match fs::read(&path) {
            Err(e) if e.kind() == ErrorKind::NotFound => continue,
            other => other.map_err(Error::io(&path))?,
        };
        for line in String::from_utf8_lossy(&text).split_inclusive('\n') {
            let Some((index, hash)) = line.strip_suffix('\n').and_then(|line| line.split_once(' ')) else { continue };
            let whole = hash.len() == 64 && hash.bytes().all(|b| b.is_ascii_hexdigit());
            if let Ok(index) = index.parse::<u64>()
                && index < tiles
                && whole
            {
                found.insert(index, hash.to_owned());
            }
        }
    }
    Ok(found)
}

/// Says that the disk is full in words that tell what to do.
fn full(error: Error, done: u64, of: u64) -> Error {
    match error {
        Error::Io { path, source } if matches!(source.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded) => {
            let what = format!(
                "no space left on the disk after {done} of {of} tiles; make room and give the same command again: what is finished stays"
            );
            Error::input(path, what)
        }
        other => other,
    }
}

/// Computes what is missing of a part of the plate, and finishes the plate when nothing is missing any more.
///
/// # Errors
/// [`Error::Input`] for a full disk or a manifest of other settings; [`Error::Io`]; [`Error::Interrupted`]; those of
/// [`PlateFringes::tile`].
pub(super) fn compute(
    folder: &Path,
    fringes: &PlateFringes,
    manifest: &Manifest,
    shard: Shard,
    progress: &Progress,
) -> Result<TileReport> {
    let begin = Instant::now();
    let layout = Layout::new(&fringes.plate);
    let range = shard.tiles(layout.tiles);
    let path = find(folder).unwrap_or_else(|| folder.join(PARTIAL));
    let file = open_own(&path)?;
    let prepared = (|| {
        // The same bytes by whoever comes first or later; the length never shrinks a file that others write.
        if file.metadata().map_err(Error::io(&path))?.len() != layout.length() {
            file.set_len(layout.length()).map_err(Error::io(&path))?;
        }
        write_at(&file, &path, 0, &layout.head)
    })();
    prepared.map_err(|e| full(e, 0, layout.tiles))?;
    let mut done = TileReport { tiles: layout.tiles, part: range.end - range.start, ..TileReport::default() };
    let mut known = listed(folder, layout.tiles)?;
    if let Some(hashes) = &manifest.tiles {
        known.extend((0..).zip(hashes.iter().cloned()));
    }
    progress.start("checking tiles", done.part);
    let mut missing = Vec::new();
    for index in range {
        progress.check()?;
        match known.get(&index) {
            Some(hash) if is_whole(&file, &path, &layout, index, hash)? => done.kept += 1,
            Some(_) => {
                done.torn += 1;
                missing.push(index);
            }
            None => missing.push(index),
        }
        progress.advance(1);
    }
    if !missing.is_empty() {
        let lists = folder.join(LISTS);
        let fill = |e| full(e, done.kept, layout.tiles);
        fs::create_dir_all(&lists).map_err(Error::io(&lists)).map_err(fill)?;
        let stamp = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_nanos());
        let list_path = lists.join(format!("{}-{stamp}", std::process::id()));
        let mut list = File::create_new(&list_path).map_err(Error::io(&list_path)).map_err(fill)?;
        progress.start("tiles", missing.len() as u64);
        for index in missing {
            let (levels, work) = fringes.tile(index, manifest.amplitude, progress)?;
            done.work += work;
            let bytes = packed(&levels, fringes.plate.fringe.bits);
            let hash = sha256(&bytes);
            if let Some(expected) = manifest.tiles.as_ref().and_then(|tiles| tiles.get(index as usize))
                && *expected != hash
            {
                let what =
                    format!("tile {index} comes out differently from the manifest; was it made on another machine?");
                return Err(Error::input(&path, what));
            }
            let kept = done.kept + done.computed;
            let written = (|| {
                let mut padded = bytes;
                padded.resize(layout.stride as usize, 0);
                write_at(&file, &path, layout.offset(index), &padded)?;
                file.sync_data().map_err(Error::io(&path))?;
                // One write, so that a list's last line is whole or recognisably cut off.
                list.write_all(format!("{index} {hash}\n").as_bytes()).map_err(Error::io(&list_path))?;
                list.sync_data().map_err(Error::io(&list_path))
            })();
            written.map_err(|e| full(e, kept, layout.tiles))?;
            done.computed += 1;
            progress.advance(1);
        }
    }
    let mut hashes = listed(folder, layout.tiles)?;
    if let Some(tiles) = &manifest.tiles {
        hashes.extend((0..).zip(tiles.iter().cloned()));
    }
    done.finished = hashes.len() as u64;
    if done.finished == layout.tiles {
        finish(folder, &file, &path, &layout, manifest, hashes, progress)
            .map_err(|e| full(e, layout.tiles, layout.tiles))?;
        done.complete = true;
    } else if let Some(there) = Manifest::read(folder)?
        && there.tiles.is_some()
    {
        // Another process finished it in the meantime.
        (done.finished, done.complete) = (layout.tiles, true);
    }
    done.seconds = begin.elapsed().as_secs_f64();
    Ok(done)
}

/// Whether a tile has its hash, and zeros behind it.
fn is_whole(file: &File, path: &Path, layout: &Layout, index: u64, hash: &str) -> Result<bool> {
    let bytes = read_at(file, path, layout.offset(index), layout.stride)?;
    let (tile, behind) = bytes.split_at(layout.tile_bytes as usize);
    Ok(behind.iter().all(|&byte| byte == 0) && sha256(tile) == hash)
}

/// Checks all tiles once more, gives the file its name and the manifest the hashes.
fn finish(
    folder: &Path,
    file: &File,
    path: &Path,
    layout: &Layout,
    manifest: &Manifest,
    hashes: BTreeMap<u64, String>,
    progress: &Progress,
) -> Result<()> {
    progress.start("checking tiles", layout.tiles);
    for (index, hash) in &hashes {
        progress.check()?;
        if !is_whole(file, path, layout, *index, hash)? {
            let what = format!("tile {index} changed after it was written; give the command again to redo it");
            return Err(Error::input(path, what));
        }
        progress.advance(1);
    }
    file.sync_all().map_err(Error::io(path))?;
    let last = folder.join(PLATE);
    if path != last {
        match fs::rename(path, &last) {
            // Another process was quicker.
            Err(e) if e.kind() == ErrorKind::NotFound && last.is_file() => {}
            other => other.map_err(Error::io(&last))?,
        }
    }
    let complete = Manifest { tiles: Some(hashes.into_values().collect()), ..manifest.clone() };
    if manifest.tiles != complete.tiles {
        complete.replace(folder)?;
    }
    let lists = folder.join(LISTS);
    match fs::remove_dir_all(&lists) {
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(()),
        other => other.map_err(Error::io(&lists)),
    }
}

/// Opens the file of a complete plate.
///
/// # Errors
/// [`Error::Input`] where there is none, where it is not complete, or where its length or its head are not as they should be.
pub(super) fn open(folder: &Path) -> Result<(Manifest, Layout, File, PathBuf)> {
    let manifest = Manifest::of(folder)?;
    let layout = Layout::new(&manifest.settings.plate);
    let Some(hashes) = &manifest.tiles else {
        let there = listed(folder, layout.tiles)?.len();
        let what =
            format!("{there} of {} tiles are finished; give the print command again to compute the rest", layout.tiles);
        return Err(Error::input(folder, what));
    };
    if hashes.len() as u64 != layout.tiles {
        let what = format!("names {} tiles, the plate has {}", hashes.len(), layout.tiles);
        return Err(Error::input(folder.join(manifest::NAME), what));
    }
    let path = folder.join(PLATE);
    refuse_link(&path)?;
    let file = File::open(&path).map_err(Error::io(&path))?;
    let length = file.metadata().map_err(Error::io(&path))?.len();
    if length != layout.length() {
        let what = format!("is {length} bytes long and should be {}; give the print command again", layout.length());
        return Err(Error::input(&path, what));
    }
    if read_at(&file, &path, 0, layout.head.len() as u64)? != layout.head {
        return Err(Error::input(&path, "its head is damaged; give the print command again"));
    }
    Ok((manifest, layout, file, path))
}

/// Checks a complete plate against its manifest.
///
/// # Errors
/// [`Error::Input`] for a plate that is missing, incomplete or damaged; it names the tiles whose bytes are not those that were computed.
pub fn verify(folder: &Path, progress: &Progress) -> Result<Verified> {
    let begin = Instant::now();
    let (manifest, layout, file, path) = open(folder)?;
    progress.start("checking tiles", layout.tiles);
    let mut torn = Vec::new();
    for (index, hash) in (0..).zip(manifest.tiles.iter().flatten()) {
        progress.check()?;
        if !is_whole(&file, &path, &layout, index, hash)? {
            torn.push(index);
        }
        progress.advance(1);
    }
    if let Some(first) = torn.first() {
        let what = format!(
            "{} of {} tiles are not as they were computed, tile {first} first; give the print command again to redo them",
            torn.len(),
            layout.tiles
        );
        return Err(Error::input(&path, what));
    }
    Ok(Verified { tiles: layout.tiles, bytes: layout.length(), seconds: begin.elapsed().as_secs_f64() })
}

/// Makes the folder, and writes the manifest where there is none yet.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] where another process wrote other settings in the meantime.
pub(super) fn begin(folder: &Path, manifest: &Manifest) -> Result<Manifest> {
    files::output_folder(folder)?;
    let there = manifest.create(folder).map_err(|e| full(e, 0, 0))?;
    there.check(folder, &manifest.settings)?;
    Ok(there)
}
