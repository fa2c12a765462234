//! A small binary plate as GDSII: rectangles of open pixels on layer 1, in the plate's own pixels as database unit.
//!
//! GDSII Stream Format, release 6.0: records of a 16-bit length, a type, a kind of data, all big-endian; reals with base 16.
//! Runs of open pixels that are the same in the rows below become one rectangle.

use super::plate::Raster;
use super::reader::{Exported, Reader};
use crate::error::{Error, Result};
use crate::files;
use crate::progress::Progress;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Most pixels: readers hold all rectangles in memory, one for about four pixels.
const MOST: u64 = 1 << 26;

pub(super) fn write(reader: &mut Reader, output: &Path, progress: &Progress) -> Result<Exported> {
    let plate = reader.plate().clone();
    let Raster { width, height, .. } = reader.raster();
    if plate.fringe.bits != 1 {
        return Err(Error::parameter(
            "as",
            "gds holds open and closed pixels; this plate has 8 bits: print it with bits = 1",
        ));
    }
    if width * height > MOST {
        let what = format!(
            "gds of {width}×{height} pixels: more than {MOST} are too many rectangles for its readers; take zarr"
        );
        return Err(Error::parameter("as", what));
    }
    if plate.raster.pitch_x != plate.raster.pitch_y {
        let what = format!(
            "gds counts in one database unit, the pitch is {} × {} m: not square",
            plate.raster.pitch_x, plate.raster.pitch_y
        );
        return Err(Error::parameter("as", what));
    }
    let mut length = 0;
    files::write_whole(output, |file| {
        let mut out = Records { file, path: output, length: 0 };
        out.words(0x0002, &[600])?;
        // Dates of last change: a fixed one, so that the same plate is the same file.
        let date = [1970, 1, 1, 0, 0, 0, 1970, 1, 1, 0, 0, 0];
        out.words(0x0102, &date)?;
        out.text(0x0206, "PLATE")?;
        // The database unit in micrometres and in metres.
        let units: Vec<u8> =
            [plate.raster.pitch_x / 1e-6, plate.raster.pitch_x].iter().flat_map(|v| real(*v)).collect();
        out.record(0x0305, &units)?;
        out.words(0x0502, &date)?;
        out.text(0x0606, "FRINGES")?;
        progress.start("rectangles", height);
        // Open runs of the row above with the row in which they began.
        let mut open: Vec<([u64; 2], u64)> = Vec::new();
        for row in 0..=height {
            progress.check()?;
            let runs = if row < height { runs(&reader.rectangle([0, row], [width, 1])?) } else { Vec::new() };
            let mut next = Vec::with_capacity(runs.len());
            let mut above = open.into_iter().peekable();
            for run in runs {
                // Both lists run from left to right.
                while let Some((ended, from)) = above.next_if(|(other, _)| other[0] < run[0]) {
                    out.rectangle(ended, [height - row, height - from])?;
                }
                match above.next_if(|(other, _)| *other == run) {
                    Some(same) => next.push(same),
                    None => next.push((run, row)),
                }
            }
            for (ended, from) in above {
                out.rectangle(ended, [height - row, height - from])?;
            }
            open = next;
            progress.advance(1);
        }
        out.record(0x0700, &[])?;
        out.record(0x0400, &[])?;
        length = out.length;
        Ok(())
    })?;
    Ok(Exported { files: 1, bytes: length })
}

/// First and end column of each run of open pixels.
fn runs(levels: &[u8]) -> Vec<[u64; 2]> {
    let mut out = Vec::new();
    let mut at = 0;
    for same in levels.chunk_by(|a, b| a == b) {
        let end = at + same.len() as u64;
        if same[0] > 0 {
            out.push([at, end]);
        }
        at = end;
    }
    out
}

struct Records<'a> {
    file: &'a mut BufWriter<std::fs::File>,
    path: &'a Path,
    length: u64,
}

impl Records<'_> {
    fn record(&mut self, kind: u16, data: &[u8]) -> Result<()> {
        let length = 4 + data.len() as u16;
        let mut bytes = length.to_be_bytes().to_vec();
        bytes.extend(kind.to_be_bytes());
        bytes.extend(data);
        self.length += bytes.len() as u64;
        self.file.write_all(&bytes).map_err(Error::io(self.path))
    }
    fn words(&mut self, kind: u16, words: &[u16]) -> Result<()> {
        let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_be_bytes()).collect();
        self.record(kind, &bytes)
    }
    fn text(&mut self, kind: u16, text: &str) -> Result<()> {
        let mut bytes = text.as_bytes().to_vec();
        // Even lengths only.
        bytes.resize(bytes.len().next_multiple_of(2), 0);
        self.record(kind, &bytes)
    }
    fn rectangle(&mut self, x: [u64; 2], y: [u64; 2]) -> Result<()> {
        let corners = [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]], [x[0], y[0]]];
        let bytes: Vec<u8> = corners.iter().flatten().flat_map(|v| (*v as i32).to_be_bytes()).collect();
        self.record(0x0800, &[])?;
        self.words(0x0d02, &[1])?;
        self.words(0x0e02, &[0])?;
        self.record(0x1003, &bytes)?;
        self.record(0x1100, &[])
    }
}

/// An eight-byte real: sign, exponent of 16 in excess 64, 56 bits of fraction.
fn real(value: f64) -> [u8; 8] {
    if value == 0.0 {
        return [0; 8];
    }
    let mut fraction = value.abs();
    let mut exponent = 64u64;
    while fraction >= 1.0 {
        fraction /= 16.0;
        exponent += 1;
    }
    while fraction < 1.0 / 16.0 {
        fraction *= 16.0;
        exponent -= 1;
    }
    let bits = (fraction * (1u64 << 56) as f64) as u64;
    (u64::from(value < 0.0) << 63 | exponent << 56 | bits).to_be_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reals_have_base_sixteen() {
        // 1 is 1/16·16¹, 0.001 a well-known pair of libraries in nanometres.
        assert_eq!(real(1.0), [0x41, 0x10, 0, 0, 0, 0, 0, 0]);
        assert_eq!(real(-2.0), [0xc1, 0x20, 0, 0, 0, 0, 0, 0]);
        assert_eq!(real(1e-3), [0x3e, 0x41, 0x89, 0x37, 0x4b, 0xc6, 0xa7, 0xf0]);
    }

    #[test]
    fn runs_are_found() {
        assert_eq!(runs(&[1, 1, 0, 1, 0, 0, 1]), [[0, 2], [3, 4], [6, 7]]);
        assert!(runs(&[0, 0]).is_empty());
    }
}
