//! One tile: the field of what its segments see, the fringe that it makes with the reference, and its levels.
//!
//! A tile depends on the plate, the source, the gain and its index, and on nothing else: not on threads, order, neighbours
//! or what was computed before.
//!
//! # Band
//!
//! The object's band is the plate's, divided by whole numbers k_x and k_y ([`Band`]). The definition of a point's field
//! ([`crate::hologram::definition`]) limits it to what a grid's pitch carries; so the field is computed on k_x·k_y grids of
//! k times the pitch that interleave. Each pixel has the exact value of the limited field, and a point's wave is summed
//! where it reaches and nowhere else.
//!
//! # No seams
//!
//! Neighbouring segments send waves from the same points in the same phases ([`super::views`]). Error diffusion begins in a
//! halo to the left, to the right and above the tile, whose pixels are the same fringe, so that it has settled at the edge.

use super::geometry::{Piece, Rect, border, fringe_area, pieces, plate_from_file, tile_in_file, tile_on_plate};
use super::plate::{Binarisation, Plate, Polarity};
use super::reference::Band;
use super::slit::Strip;
use super::views::Source;
use crate::encode::error_diffusion::binarise;
use crate::encode::fringe::Fringe;
use crate::error::Result;
use crate::field::{Complex32, Grid};
use crate::hologram::{self, Cull, HologramSettings, InstructionSet, Method};
use crate::progress::Progress;
use rayon::prelude::*;
use std::ops::AddAssign;
use std::time::Instant;

/// Pixels beside and above a tile in which error diffusion settles: its errors are forgotten after some ten pixels.
pub(super) const HALO: i64 = 24;

/// Memory that one field may take beside its points [bytes].
const FIELD_MEMORY: u64 = 512 << 20;

/// What computing took.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Work {
    /// Pixels computed, halos too.
    pub pixels: u64,
    /// Segments looked from.
    pub segments: u64,
    /// Points, counted anew for each segment.
    pub points: u64,
    /// Point–pixel pairs.
    pub pairs: f64,
    /// Time for rays and points [s].
    pub points_seconds: f64,
    /// Time for the field [s].
    pub field_seconds: f64,
    /// Time for the fringe [s].
    pub fringe_seconds: f64,
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Self) {
        self.pixels += other.pixels;
        self.segments += other.segments;
        self.points += other.points;
        self.pairs += other.pairs;
        self.points_seconds += other.points_seconds;
        self.field_seconds += other.field_seconds;
        self.fringe_seconds += other.fringe_seconds;
    }
}

impl Work {
    /// All time [s].
    pub fn seconds(&self) -> f64 {
        self.points_seconds + self.field_seconds + self.fringe_seconds
    }
}

/// Makes tiles.
pub struct Maker<'a> {
    /// The plate.
    pub plate: &'a Plate,
    /// The object's band.
    pub band: Band,
    /// What the segments see.
    pub source: &'a Source<'a>,
    /// The kernels' instruction set: with another one pixels at the edge of a level may come out differently.
    pub instruction_set: InstructionSet,
}

impl Maker<'_> {
    /// The object's field on a rectangle of the plate, from the segments of its pieces.
    ///
    /// # Errors
    /// As [`hologram::plan`] and [`hologram::compute`]; [`crate::Error::Interrupted`].
    pub fn field(&self, rect: &Rect, pieces: &[Piece], progress: &Progress) -> Result<(Vec<Complex32>, Work)> {
        let mut field = vec![Complex32::default(); rect.area()];
        let mut work = Work { pixels: rect.area() as u64, ..Work::default() };
        let settings = HologramSettings {
            error: self.plate.error,
            method: Some(Method::Tiles),
            cull: Cull::Soft,
            memory: FIELD_MEMORY,
            instruction_set: Some(self.instruction_set),
        };
        let quiet = progress.part();
        for piece in pieces {
            let begin = Instant::now();
            if let Some(slit) = &self.plate.slit {
                let strip = Strip::new(self.plate, slit, piece.segment[1]);
                let points = self.source.line(self.plate, &self.band, piece.segment, &strip, &quiet)?;
                work.points_seconds += begin.elapsed().as_secs_f64();
                work.segments += 1;
                work.points += points.len() as u64;
                let begin = Instant::now();
                work.pairs += strip.field(self.plate, &self.band, &points, &piece.rect, rect, &mut field);
                work.field_seconds += begin.elapsed().as_secs_f64();
                quiet.check()?;
                continue;
            }
            let points = self.source.points(self.plate, &self.band, piece.segment, &quiet)?;
            work.points_seconds += begin.elapsed().as_secs_f64();
            work.segments += 1;
            work.points += points.len() as u64;
            if points.is_empty() {
                continue;
            }
            let begin = Instant::now();
            let [across, down] = self.band.divisor.map(i64::from);
            for (right, below) in (0..down).flat_map(|below| (0..across).map(move |right| (right, below))) {
                let first = [piece.rect.x[0] + right, piece.rect.y[0] + below];
                let Some(grid) = self.interleaved(&piece.rect, first)? else { continue };
                let plan = hologram::plan(&points, &grid, self.plate.wavelength, &settings)?;
                let computed = hologram::compute(&points, &grid, self.plate.wavelength, &plan, &quiet)?;
                work.pairs += computed.report.coverage.pairs;
                for (i, samples) in computed.field.samples.chunks_exact(grid.width).enumerate() {
                    let row = (first[1] + i as i64 * down - rect.y[0]) as usize;
                    let start = row * rect.width() + (first[0] - rect.x[0]) as usize;
                    for (u, value) in field[start..].iter_mut().step_by(across as usize).zip(samples) {
                        *u = *value;
                    }
                }
            }
            work.field_seconds += begin.elapsed().as_secs_f64();
        }
        Ok((field, work))
    }

    /// Every k-th column and row of a rectangle from a first one on.
    fn interleaved(&self, rect: &Rect, first: [i64; 2]) -> Result<Option<Grid>> {
        let step = self.band.divisor.map(i64::from);
        let count = |end: i64, first: i64, step: i64| ((end - first + step - 1).max(0) / step) as usize;
        let (width, height) = (count(rect.x[1], first[0], step[0]), count(rect.y[1], first[1], step[1]));
        if width == 0 || height == 0 {
            return Ok(None);
        }
        let [pitch_x, pitch_y] = [self.plate.pitch_x * step[0] as f64, self.plate.pitch_y * step[1] as f64];
        let center = [
            self.plate.x(first[0]) + 0.5 * (width as f64 - 1.0) * pitch_x,
            self.plate.y(first[1]) - 0.5 * (height as f64 - 1.0) * pitch_y,
        ];
        Ok(Some(Grid::new(width, height, pitch_x, pitch_y)?.centered_at(center)))
    }

    /// The fringe's transmittance on a rectangle, 0 to 1, for a field whose full swing is `amplitude`.
    pub(super) fn fringe(&self, field: &[Complex32], rect: &Rect, amplitude: f32) -> Vec<f32> {
        let plate = self.plate;
        let fringe = Fringe::new(plate.quantity, amplitude, plate.reference_ratio)
            .with_swing(plate.bias as f32, plate.contrast as f32);
        let pulses = plate.bits == 1 && plate.binarisation == Binarisation::PulseWidth;
        let mut out = vec![0.0; rect.area()];
        out.par_chunks_mut(rect.width()).zip(field.par_chunks(rect.width())).enumerate().for_each_init(
            Vec::new,
            |reference, (i, (out, field))| {
                let row = rect.y[0] + i as i64;
                plate.reference.row(plate, plate.wavelength_of(row), row, rect.x[0]..rect.x[1], reference);
                for ((t, &u), &r) in out.iter_mut().zip(field).zip(reference.iter()) {
                    let value = if pulses { fringe.pulse(u, r) } else { fringe.value(u, r).clamp(0.0, 1.0) };
                    *t = if plate.polarity == Polarity::Negative { 1.0 - value } else { value };
                }
            },
        );
        out
    }

    /// The same after binarisation, where the plate has one bit.
    pub(super) fn levels(&self, field: &[Complex32], rect: &Rect, amplitude: f32) -> Vec<f32> {
        let mut levels = self.fringe(field, rect, amplitude);
        match self.plate.binarisation {
            _ if self.plate.bits != 1 => {}
            Binarisation::Diffusion => binarise(&mut levels, rect.width()),
            _ => levels.iter_mut().for_each(|t| *t = if *t > 0.5 { 1.0 } else { 0.0 }),
        }
        levels
    }

    /// The levels of a tile as the file shows them, `tile × tile` of them, 0 beyond the plate's edge; `amplitude` swings
    /// the fringe fully.
    ///
    /// # Errors
    /// As [`Maker::field`].
    pub fn tile(&self, index: u64, amplitude: f32, progress: &Progress) -> Result<(Vec<u8>, Work)> {
        self.tile_with(index, amplitude, HALO, progress)
    }

    /// The same with error diffusion begun so many pixels outside.
    pub(super) fn tile_with(
        &self,
        index: u64,
        amplitude: f32,
        halo: i64,
        progress: &Progress,
    ) -> Result<(Vec<u8>, Work)> {
        let plate = self.plate;
        let area = fringe_area(plate);
        let core = tile_on_plate(plate, index).and(&area);
        let highest = if plate.bits == 1 { 1.0 } else { 255.0 };
        let (mut wishes, mut work, mut grown) = (Vec::new(), Work::default(), core);
        if core.area() > 0 {
            if plate.bits == 1 && plate.binarisation == Binarisation::Diffusion {
                grown = core.grown(halo, &area);
            }
            let (field, took) = self.field(&grown, &pieces(plate, &core, &grown), progress)?;
            work = took;
            let begin = Instant::now();
            wishes = self.levels(&field, &grown, amplitude);
            drop(field);
            work.fringe_seconds += begin.elapsed().as_secs_f64();
        }
        progress.check()?;
        let file = tile_in_file(plate, index);
        let side = plate.tile as usize;
        let mut levels = vec![0u8; side * side];
        for row in file.y[0]..file.y[1] {
            let line = &mut levels[(row - file.y[0]) as usize * side..][..file.width()];
            for (column, level) in (file.x[0]..file.x[1]).zip(line) {
                let [x, y] = plate_from_file(plate, [column, row]);
                let inside = (core.x[0]..core.x[1]).contains(&x) && (core.y[0]..core.y[1]).contains(&y);
                let value = if inside {
                    wishes[(y - grown.y[0]) as usize * grown.width() + (x - grown.x[0]) as usize]
                } else {
                    border(plate, [x, y])
                };
                *level = (value * highest).round() as u8;
            }
        }
        Ok((levels, work))
    }
}
