//! Binary plates as shapes for mask writers: rectangles of open pixels, in GDSII, OASIS or DXF.
//!
//! Runs of open pixels that are the same in the rows below become one rectangle. Coordinates count from the lower left corner of
//! the plate's file, whichever part of it a file holds, so that files of parts lie beside one another.

use super::format::Format;
use super::mask_bytes::Bytes;
use super::plate::Raster;
use super::reader::Reader;
use super::{dxf, gds, oasis};
use crate::error::{Error, Result};
use crate::files;
use crate::progress::Progress;
use std::path::Path;

/// Most pixels of a file: readers hold all rectangles in memory, one for about four pixels.
fn most(format: Format) -> u64 {
    // Of DXF each takes some two hundred letters.
    if format == Format::Dxf { 1 << 24 } else { 1 << 26 }
}

/// Rows that are read at once.
const ROWS: u64 = 128;

/// Refuses a plate that is no mask, or whose pixels are not square.
///
/// # Errors
/// [`Error::Parameter`].
pub(super) fn check(reader: &Reader, format: Format, name: &str) -> Result<()> {
    let plate = reader.plate();
    if plate.fringe.bits != 1 {
        let what = format!("{name} holds open and closed pixels; this plate has 8 bits: print it with bits = 1");
        return Err(Error::parameter("as", what));
    }
    if format != Format::Dxf && plate.raster.pitch_x != plate.raster.pitch_y {
        let what = format!(
            "{name} counts in one database unit, the pitch is {} × {} m: not square",
            plate.raster.pitch_x, plate.raster.pitch_y
        );
        return Err(Error::parameter("as", what));
    }
    Ok(())
}

/// Refuses more pixels than a reader of the format bears.
///
/// # Errors
/// [`Error::Parameter`].
pub(super) fn check_size(format: Format, name: &str, [width, height]: [u64; 2]) -> Result<()> {
    let most = most(format);
    if width * height > most {
        let what = format!(
            "{name} of {width}×{height} pixels: more than {most} are too many rectangles for its readers; give --frame, a file \
             for each"
        );
        return Err(Error::parameter("as", what));
    }
    Ok(())
}

/// Writes the open pixels of a part of a plate; returns the bytes.
///
/// # Errors
/// [`Error::Io`], [`Error::Interrupted`].
pub(super) fn write(
    reader: &mut Reader,
    format: Format,
    from: [u64; 2],
    size: [u64; 2],
    path: &Path,
    progress: &Progress,
) -> Result<u64> {
    let raster = reader.raster();
    let mut length = 0;
    files::write_whole(path, |file| {
        let mut out = Bytes::new(file, path);
        match format {
            Format::Oasis => {
                oasis::begin(&mut out, raster.pitch_x)?;
                let mut last = oasis::Last::default();
                rectangles(reader, from, size, progress, |x, y| oasis::rectangle(&mut out, &mut last, x, y))?;
                oasis::end(&mut out)?;
            }
            Format::Dxf => {
                dxf::begin(&mut out)?;
                let Raster { pitch_x, pitch_y, .. } = raster;
                rectangles(reader, from, size, progress, |x, y| dxf::rectangle(&mut out, [pitch_x, pitch_y], x, y))?;
                dxf::end(&mut out)?;
            }
            _ => {
                gds::begin(&mut out, raster.pitch_x)?;
                rectangles(reader, from, size, progress, |x, y| gds::rectangle(&mut out, x, y))?;
                gds::end(&mut out)?;
            }
        }
        length = out.length();
        Ok(())
    })?;
    Ok(length)
}

/// Calls `emit` with first and end column and, from the plate's lower edge, first and end row of each rectangle.
fn rectangles(
    reader: &mut Reader,
    [left, top]: [u64; 2],
    [width, height]: [u64; 2],
    progress: &Progress,
    mut emit: impl FnMut([u64; 2], [u64; 2]) -> Result<()>,
) -> Result<()> {
    let below = reader.raster().height;
    // Open runs of the row above with the row in which they began.
    let mut open: Vec<([u64; 2], u64)> = Vec::new();
    let mut lines: Vec<u8> = Vec::new();
    for row in top..=top + height {
        progress.check()?;
        let runs = if row < top + height {
            let at = (row - top) % ROWS;
            if at == 0 {
                lines = reader.rectangle([left, row], [width, ROWS.min(top + height - row)])?;
            }
            runs(&lines[(at * width) as usize..][..width as usize], left)
        } else {
            Vec::new()
        };
        let mut next = Vec::with_capacity(runs.len());
        let mut above = open.into_iter().peekable();
        for run in runs {
            // Both lists run from left to right.
            while let Some((ended, from)) = above.next_if(|(other, _)| other[0] < run[0]) {
                emit(ended, [below - row, below - from])?;
            }
            match above.next_if(|(other, _)| *other == run) {
                Some(same) => next.push(same),
                None => next.push((run, row)),
            }
        }
        for (ended, from) in above {
            emit(ended, [below - row, below - from])?;
        }
        open = next;
    }
    Ok(())
}

/// First and end column of each run of open pixels.
fn runs(levels: &[u8], left: u64) -> Vec<[u64; 2]> {
    let mut out = Vec::new();
    let mut at = left;
    for same in levels.chunk_by(|a, b| a == b) {
        let end = at + same.len() as u64;
        if same[0] > 0 {
            out.push([at, end]);
        }
        at = end;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_found() {
        assert_eq!(runs(&[1, 1, 0, 1, 0, 0, 1], 0), [[0, 2], [3, 4], [6, 7]]);
        assert_eq!(runs(&[0, 1], 5), [[6, 7]]);
        assert!(runs(&[0, 0], 0).is_empty());
    }
}
