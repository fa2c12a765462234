//! One tile: the field of what its segments see, the fringe that it makes with the reference, and its levels.
//!
//! A tile depends on the plate, the source, the gain and its index, and on nothing else: not on threads, order, neighbours
//! or what was computed before.
//!
//! The wave has no seams ([`crate::segments`]), and error diffusion begins in a halo to the left, to the
//! right and above the tile, whose pixels are the same fringe, so that it has settled at the edge. A direct search keeps the
//! error of its tile alone, nothing around it, out of the band: those of several tiles then add up and need not fit together. A strip of some eight
//! pixels along its edge keeps about a fifth more noise than the rest.

use super::geometry::{border, fringe_area, plate_from_file, tile_in_file, tile_on_plate};
use super::plate::{Binarisation, FringeSettings, Plate, Polarity};
use super::transfer::edge_phase;
use crate::encode::band_search::BandKernel;
use crate::encode::error_diffusion::binarise;
use crate::encode::fringe::Fringe;
use crate::error::Result;
use crate::field::{Complex32, Complex64};
use crate::progress::Progress;
use crate::segments::{ObjectWave, Piece, Rect, Work};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::time::Instant;

/// Pixels beside and above a tile in which error diffusion settles: its errors are forgotten after some ten pixels.
const HALO: i64 = 24;

/// Sweeps of a direct search over each block.
const SWEEPS: u32 = 4;

/// The fringes of a plate.
pub struct PlateFringes {
    /// The plate.
    pub plate: Plate,
    /// The object's wave on it.
    pub wave: ObjectWave,
}

impl PlateFringes {
    /// The object's field u on a rectangle. Of wavelengths that are superimposed it is Σ u_c·conj(r_c)·r, with r_c their
    /// references and r the plate's own: with r it makes the sum of their fringes.
    ///
    /// # Errors
    /// As [`ObjectWave::field`].
    pub(super) fn field(&self, rect: &Rect, pieces: &[Piece], progress: &Progress) -> Result<(Vec<Complex32>, Work)> {
        let (plate, grid) = (&self.plate, &self.wave.plane.grid);
        let Some(slit) = plate.slit.as_ref().filter(|slit| slit.superimposed) else {
            return self.wave.field(rect, pieces, progress);
        };
        let (mut sum, mut work) = (vec![Complex32::default(); rect.area()], Work::default());
        for (index, &wavelength) in slit.wavelengths.iter().enumerate() {
            let (field, took) = self.wave.field_of(index, rect, pieces, progress)?;
            work += took;
            sum.par_chunks_mut(rect.width()).zip(field.par_chunks(rect.width())).enumerate().for_each_init(
                || (Vec::new(), Vec::new()),
                |(own, reference), (i, (sum, field))| {
                    let (row, columns) = (rect.y[0] + i as i64, rect.x[0]..rect.x[1]);
                    plate.reference.row(grid, wavelength, row, columns.clone(), own);
                    plate.reference.row(grid, plate.wavelength, row, columns, reference);
                    for (((sum, u), own), r) in sum.iter_mut().zip(field).zip(own.iter()).zip(reference.iter()) {
                        *sum += u * own.conj() * r;
                    }
                },
            );
        }
        work.pixels = rect.area() as u64;
        Ok((sum, work))
    }

    /// The fringe's transmittance on a rectangle, 0 to 1, for a field whose full swing is `amplitude`.
    pub(super) fn fringe(&self, field: &[Complex32], rect: &Rect, amplitude: f32) -> Vec<f32> {
        let (plate, grid) = (&self.plate, &self.wave.plane.grid);
        let FringeSettings { quantity, bits, binarisation, bias, contrast, reference_ratio, polarity, .. } =
            plate.fringe;
        let fringe = Fringe::new(quantity, amplitude, reference_ratio).with_swing(bias as f32, contrast as f32);
        let pulses = bits == 1 && binarisation == Binarisation::PulseWidth;
        // A search makes of wishes beyond its two levels what it can.
        let searched = bits == 1 && binarisation == Binarisation::DirectSearch;
        let (lines, tone) = match &plate.transfer {
            None => (None, None),
            Some(transfer) => (transfer.lines(&plate.fringe), transfer.tone(&plate.fringe)),
        };
        let (area, fade) = (fringe_area(plate), plate.fade as f64);
        // 0 at the edge, 1 where nothing fades.
        let faded = |at: i64, [from, end]: [i64; 2]| {
            let inside = (at - from).min(end - 1 - at) as f64 + 0.5;
            if inside < fade { (0.5 - 0.5 * (PI * inside / fade).cos()) as f32 } else { 1.0 }
        };
        // Lines of the highest level are what is open, or what is closed.
        let inwards = if polarity == Polarity::Negative { -1.0 } else { 1.0 };
        let mut out = vec![0.0; rect.area()];
        out.par_chunks_mut(rect.width()).zip(field.par_chunks(rect.width())).enumerate().for_each_init(
            Vec::new,
            |reference, (i, (out, field))| {
                let row = rect.y[0] + i as i64;
                let wavelength = plate.wavelength_of(row);
                plate.reference.row(grid, wavelength, row, rect.x[0]..rect.x[1], reference);
                let shown = faded(row, area.y);
                for (((t, &u), &r), column) in out.iter_mut().zip(field).zip(reference.iter()).zip(rect.x[0]..) {
                    let value = match lines {
                        Some(bias) => {
                            let place = [grid.x(column as usize), grid.y(row as usize)];
                            let edge = edge_phase(bias, plate.reference.frequency_at(place, wavelength));
                            fringe.open_arc(u, pulses).open((u * r.conj()).arg(), (inwards * edge) as f32)
                        }
                        None if pulses => fringe.pulse(u, r),
                        None if searched => fringe.value(u, r),
                        None => fringe.value(u, r).clamp(0.0, 1.0),
                    };
                    let value = value * shown * faded(column, area.x);
                    let value = if polarity == Polarity::Negative { 1.0 - value } else { value };
                    *t = tone.as_ref().map_or(value, |tone| tone.level(value));
                }
            },
        );
        out
    }

    /// The same after binarisation, where the plate has one bit.
    pub(super) fn levels(&self, field: &[Complex32], rect: &Rect, amplitude: f32) -> Vec<f32> {
        let mut levels = self.fringe(field, rect, amplitude);
        match self.plate.fringe.binarisation {
            _ if self.plate.fringe.bits != 1 => {}
            Binarisation::Diffusion => binarise(&mut levels, rect.width()),
            Binarisation::DirectSearch => levels = self.searched(&levels, rect),
            _ => levels.iter_mut().for_each(|t| *t = if *t > 0.5 { 1.0 } else { 0.0 }),
        }
        levels
    }

    /// What a search makes of wishes on a rectangle: open or closed, without noise in the eye box.
    ///
    /// Lit with the reference r, the light that goes to the middle of the box is that along the wave w which converges there; s
    /// = r·conj(w) takes it to the frequency 0, and the box is a band about it, of half width side/(2λD) at the distance D.
    fn searched(&self, wishes: &[f32], rect: &Rect) -> Vec<f32> {
        let (plate, grid) = (&self.plate, &self.wave.plane.grid);
        let Some(eye_box) = plate.eye_box else { return wishes.to_vec() };
        let distance = plate.view.viewer;
        let shortest = plate.wavelengths().iter().copied().fold(f64::INFINITY, f64::min);
        let pitch = [grid.pitch_x, grid.pitch_y];
        let half = [0, 1].map(|axis| {
            let side: f64 = 0.5 * eye_box[axis];
            side / side.hypot(distance) / shortest * pitch[axis]
        });
        let mut unit = vec![Complex32::default(); wishes.len()];
        unit.par_chunks_mut(rect.width()).enumerate().for_each_init(Vec::new, |reference, (i, line)| {
            let row = rect.y[0] + i as i64;
            let wavelength = plate.wavelength_of(row);
            plate.reference.row(grid, wavelength, row, rect.x[0]..rect.x[1], reference);
            let y = grid.y(row as usize) - plate.slit.as_ref().map_or(0.0, |slit| slit.y);
            for ((s, r), column) in line.iter_mut().zip(reference.iter()).zip(rect.x[0]..) {
                let turns = grid.x(column as usize).hypot(y).hypot(distance) / wavelength;
                let wave = Complex64::cis(TAU * (turns - turns.floor()));
                *s = r * Complex32::new(wave.re as f32, wave.im as f32);
            }
        });
        BandKernel::new(half).search(wishes, &unit, rect.width(), [rect.x[0], rect.y[0]], SWEEPS)
    }

    /// The levels of a tile as the file shows them, `tile × tile` of them, 0 beyond the plate's edge; `amplitude` swings
    /// the fringe fully.
    ///
    /// # Errors
    /// As [`ObjectWave::field`].
    pub(super) fn tile(&self, index: u64, amplitude: f32, progress: &Progress) -> Result<(Vec<u8>, Work)> {
        let plate = &self.plate;
        let area = fringe_area(plate);
        let core = tile_on_plate(plate, index).and(&area);
        let highest = if plate.fringe.bits == 1 { 1.0 } else { 255.0 };
        let (mut wishes, mut work, mut grown) = (Vec::new(), Work::default(), core);
        if core.area() > 0 {
            if plate.fringe.bits == 1 && plate.fringe.binarisation == Binarisation::Diffusion {
                grown = core.grown(HALO, &area);
            }
            let pieces = self.wave.plane.pieces(&core, &grown);
            let (field, took) = self.field(&grown, &pieces, progress)?;
            work = took;
            let begin = Instant::now();
            wishes = self.levels(&field, &grown, amplitude);
            drop(field);
            work.fringe_seconds += begin.elapsed().as_secs_f64();
        }
        progress.check()?;
        let file = tile_in_file(plate, index);
        let side = plate.file.tile as usize;
        let mut levels = vec![0u8; side * side];
        for row in file.y[0]..file.y[1] {
            let line = &mut levels[(row - file.y[0]) as usize * side..][..file.width()];
            for (column, level) in (file.x[0]..file.x[1]).zip(line) {
                let [x, y] = plate_from_file(plate, [column, row]);
                let value = if core.contains([x, y]) {
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
