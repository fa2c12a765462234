//! What an eye sees of a finished plate: the reference wave shines on the fringes of the file.
//!
//! Nothing of the object's field is used, only levels, pitch and reference: what is wrong with the file shows.
//!
//! Of the light that leaves the plate only what goes towards the pupil is needed. From all places of the part that is
//! looked at to all places of the pupil its spatial frequencies fill a band about a carrier f_c, a small share of what the
//! pitch carries. So t·r·exp(−i2πf_c·x) is limited to that band and thinned out while the file is read, tile by tile; memory
//! is that of the thinned field. That is carried to the pupil's plane by the exact angular spectrum about f_c, cut by the
//! pupil, and carried back to the plane in focus.

use super::export::Reader;
use super::geometry::{Rect, tile_in_file, tile_on_plate};
use super::plate::{Plate, Polarity, Quantity};
use crate::error::{Error, Result};
use crate::field::{Complex32, Complex64, Fft2, Grid};
use crate::progress::Progress;
use crate::propagation::band;
use crate::reconstruction::Picture;
use glam::DVec2;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// From where the plate is looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct PreviewSettings {
    /// Middle of the pupil in the hologram frame [m]; z > 0.
    pub eye: [f64; 3],
    /// Diameter of the pupil [m].
    pub pupil: f64,
    /// Depth that it focuses on, z [m].
    pub focus: f64,
    /// Pixels of the picture across and down.
    pub size: (usize, usize),
    /// First column and row of the part that is looked at, and its size; the whole plate where `None`.
    pub part: Option<[u64; 4]>,
    /// Wavelength of the lamp [m]; the plate's own where `None`. Another one shows what white light would do.
    pub wavelength: Option<f64>,
    /// Memory that it may take [bytes].
    pub memory: u64,
}

/// What is seen.
#[derive(Clone, Debug)]
pub struct Preview {
    /// The picture on the plane in focus: linear intensity, row 0 on top.
    pub picture: Picture,
    /// Its middle (x, y) on that plane [m].
    pub center: [f64; 2],
    /// Its half width and half height [m].
    pub half: DVec2,
    /// Every how many columns and rows of the plate one sample was kept.
    pub thinned: [usize; 2],
    /// Samples across and down of the transform to the pupil.
    pub transform: [usize; 2],
    /// Share of the light that goes towards the pupil which passes it.
    pub passed: f64,
}

/// Half length of the thinning filter in kept samples.
const TAPS: usize = 8;
/// Share of the kept band that the filter passes evenly and free of aliases.
const USABLE: f64 = 0.66;

/// Thinning along one axis: samples `factor` apart, limited to their band.
struct Thinning {
    factor: usize,
    /// Filter at offsets −taps … +taps pixels.
    filter: Vec<f32>,
    taps: i64,
}

impl Thinning {
    /// A sinc with a cut at half the kept rate under a Blackman window: its edge is 5.5/(2·8·factor) cycles a pixel wide, so
    /// that two thirds of the kept band are flat and free of aliases to 1e-3.
    fn new(factor: usize) -> Self {
        if factor == 1 {
            return Self { factor, filter: vec![1.0], taps: 0 };
        }
        let taps = (TAPS * factor) as i64;
        let value = |i: i64| {
            let x = i as f64 / factor as f64;
            let sinc = if i == 0 { 1.0 } else { (PI * x).sin() / (PI * x) };
            let phase = PI * (1.0 + i as f64 / (taps as f64 + 1.0));
            sinc * (0.42 - 0.5 * phase.cos() + 0.08 * (2.0 * phase).cos())
        };
        let values: Vec<f64> = (-taps..=taps).map(value).collect();
        let sum: f64 = values.iter().sum();
        Self { factor, filter: values.into_iter().map(|v| (v / sum) as f32).collect(), taps }
    }
    /// Kept samples whose filter touches the pixels of a range, counted from the part's first pixel.
    fn touched(&self, range: [i64; 2], count: usize) -> std::ops::Range<usize> {
        let factor = self.factor as i64;
        let first = (range[0] - self.taps).div_euclid(factor).max(0);
        let end = (range[1] - 1 + self.taps).div_euclid(factor) + 1;
        let end = end.clamp(0, count as i64);
        first.min(end) as usize..end as usize
    }
}

/// Lowest and highest spatial frequency along an axis of light from one rectangle to another at a distance.
fn towards(from: [[f64; 2]; 2], to: [[f64; 2]; 2], distance: f64, wavelength: f64, axis: usize) -> [f64; 2] {
    let other = 1 - axis;
    let aside = [to[other][0] - from[other][1], to[other][1] - from[other][0]];
    let nearest = if aside[0] <= 0.0 && aside[1] >= 0.0 { 0.0 } else { aside[0].abs().min(aside[1].abs()) };
    let farthest = aside[0].abs().max(aside[1].abs());
    let at = |d: f64, o: f64| d / (d * d + o * o + distance * distance).sqrt() / wavelength;
    let ends = [to[axis][0] - from[axis][1], to[axis][1] - from[axis][0]];
    let all = [at(ends[0], nearest), at(ends[0], farthest), at(ends[1], nearest), at(ends[1], farthest)];
    [all.iter().copied().fold(f64::INFINITY, f64::min), all.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
}

/// Reconstructs what an eye sees of a part of a finished plate.
///
/// # Errors
/// Those of a plate that is missing, incomplete or damaged; [`Error::Parameter`] for an eye that is not in front of plate and focus, and a part that is not
/// on the plate; [`Error::Memory`] past the budget, with what would help; [`Error::Interrupted`].
pub fn preview(folder: &Path, settings: &PreviewSettings, progress: &Progress) -> Result<Preview> {
    let mut reader = Reader::open(folder)?;
    let plate = reader.plate().clone();
    let [ex, ey, ez] = settings.eye;
    if !(settings.eye.iter().all(|c| c.is_finite()) && ez > 0.0) {
        return Err(Error::parameter("eye", format!("z = {ez} m: the eye must stand in front of the plate")));
    }
    if !(settings.focus.is_finite() && settings.focus < ez) {
        return Err(Error::parameter("focus", format!("{} m must lie before the eye at {ez} m", settings.focus)));
    }
    if !(settings.pupil.is_finite() && settings.pupil > 0.0) {
        return Err(Error::parameter("pupil", format!("{} m must be greater than zero", settings.pupil)));
    }
    let wavelength = settings.wavelength.unwrap_or(plate.wavelength);
    if !(1e-8..1e-4).contains(&wavelength) {
        return Err(Error::parameter("wavelength", format!("{wavelength} m must lie between 10 nm and 100 um")));
    }
    let part = part_of(&plate, settings.part)?;
    let edges = [
        [plate.x(part.x[0]) - 0.5 * plate.pitch_x, plate.x(part.x[1] - 1) + 0.5 * plate.pitch_x],
        [plate.y(part.y[1] - 1) - 0.5 * plate.pitch_y, plate.y(part.y[0]) + 0.5 * plate.pitch_y],
    ];
    let pupil = [ex, ey].map(|e| [e - 0.5 * settings.pupil, e + 0.5 * settings.pupil]);
    let pitch = [plate.pitch_x, plate.pitch_y];
    let (mut carrier, mut factor) = ([0.0; 2], [1; 2]);
    for axis in 0..2 {
        let [low, high] = towards(edges, pupil, ez, wavelength, axis);
        carrier[axis] = 0.5 * (low + high);
        factor[axis] = ((USABLE / (pitch[axis] * (high - low))).floor() as usize).clamp(1, 64);
    }
    let kept = [part.width().div_ceil(factor[0]), part.height().div_ceil(factor[1])];
    let pitch = [pitch[0] * factor[0] as f64, pitch[1] * factor[1] as f64];
    let pupil_size = [0, 1].map(|axis| (settings.pupil / pitch[axis]).ceil() as usize + 2);
    let far = (ez - settings.focus) / ez;
    let half = DVec2::new(0.5 * (edges[0][1] - edges[0][0]) * far, 0.5 * (edges[1][1] - edges[1][0]) * far);
    let window_size = [0, 1].map(|axis| (2.0 * half[axis] / pitch[axis]).ceil() as usize + 2);
    let transform = [0, 1].map(|axis| kept[axis].max(window_size[axis]) + pupil_size[axis]);
    let needed = 16 * (transform[0] as u64).saturating_mul(transform[1] as u64) + 8 * (kept[0] * kept[1]) as u64;
    if needed > settings.memory {
        return Err(Error::Memory {
            what: "preview",
            needed: needed.div_ceil(1 << 20),
            budget: settings.memory >> 20,
            hint: "look at a part of the plate (--part), or from farther away".into(),
        });
    }
    let mut grid = Grid::new(kept[0], kept[1], pitch[0], pitch[1])?;
    // Sample m stands on pixel m·factor of the part.
    grid.center = [
        plate.x(part.x[0]) + 0.5 * (kept[0] as f64 - 1.0) * pitch[0],
        plate.y(part.y[0]) - 0.5 * (kept[1] as f64 - 1.0) * pitch[1],
    ];
    let thinned = thin(
        &mut reader,
        &plate,
        &part,
        [Thinning::new(factor[0]), Thinning::new(factor[1])],
        kept,
        (wavelength, carrier),
        progress,
    )?;
    let wave = Wave { wavelength, carrier };
    let pupil_grid = Grid::new(pupil_size[0], pupil_size[1], pitch[0], pitch[1])?.centered_at([ex, ey]);
    progress.start("to the pupil", 0);
    let mut at_pupil = wave.carried(thinned, &grid, &pupil_grid, ez, progress)?;
    let energy = |field: &[Complex32]| field.iter().map(|u| f64::from(u.norm_sqr())).sum::<f64>();
    let arriving = energy(&at_pupil);
    for (index, u) in at_pupil.iter_mut().enumerate() {
        let (x, y) = (pupil_grid.x(index % pupil_grid.width) - ex, pupil_grid.y(index / pupil_grid.width) - ey);
        if x.hypot(y) > 0.5 * settings.pupil {
            *u = Complex32::default();
        }
    }
    let passed = if arriving > 0.0 { energy(&at_pupil) / arriving } else { 0.0 };
    let middle = [0.5 * (edges[0][0] + edges[0][1]), 0.5 * (edges[1][0] + edges[1][1])];
    let center = [ex + (middle[0] - ex) * far, ey + (middle[1] - ey) * far];
    let window = Grid::new(window_size[0], window_size[1], pitch[0], pitch[1])?.centered_at(center);
    progress.start("to the focus", 0);
    let seen = wave.carried(at_pupil, &pupil_grid, &window, settings.focus - ez, progress)?;
    let values: Vec<f32> = seen.iter().map(Complex32::norm_sqr).collect();
    let picture = Picture::from_samples(&window, &values, half, settings.size.0, settings.size.1);
    Ok(Preview { picture, center, half, thinned: factor, transform, passed })
}

fn part_of(plate: &Plate, part: Option<[u64; 4]>) -> Result<Rect> {
    let [column, row, width, height] = part.unwrap_or([0, 0, plate.width, plate.height]);
    let fits = |from: u64, size: u64, whole: u64| size > 0 && from.checked_add(size).is_some_and(|end| end <= whole);
    if !fits(column, width, plate.width) || !fits(row, height, plate.height) {
        let what = format!("{column},{row},{width}x{height} is not on the plate of {}×{}", plate.width, plate.height);
        return Err(Error::parameter("part", what));
    }
    let span = |from: u64, size: u64| [from as i64, (from + size) as i64];
    Ok(Rect { x: span(column, width), y: span(row, height) })
}

/// Reads the part's tiles, lets the reference shine on them, and keeps the band about the carrier.
fn thin(
    reader: &mut Reader,
    plate: &Plate,
    part: &Rect,
    [across, down]: [Thinning; 2],
    kept: [usize; 2],
    (wavelength, carrier): (f64, [f64; 2]),
    progress: &Progress,
) -> Result<Vec<Complex32>> {
    let mut out = vec![Complex32::default(); kept[0] * kept[1]];
    let highest = if plate.bits == 1 { 1.0 } else { 255.0f32 };
    let phasors: Vec<Complex32> = (0..=highest as usize)
        .map(|level| {
            let level = level as f32 / highest;
            let t = if plate.polarity == Polarity::Negative { 1.0 - level } else { level };
            match plate.quantity {
                Quantity::Phase => {
                    let wave = Complex64::cis(TAU * (f64::from(t) - 0.5));
                    Complex32::new(wave.re as f32, wave.im as f32)
                }
                Quantity::Bipolar | Quantity::Intensity => Complex32::new(t, 0.0),
            }
        })
        .collect();
    let tiles: Vec<u64> =
        (0..reader.tiles()).filter(|&index| tile_on_plate(plate, index).and(part).area() > 0).collect();
    progress.start("light on the fringes", tiles.len() as u64);
    let turned = |turns: f64| {
        let wave = Complex64::cis(TAU * (turns - turns.floor()));
        Complex32::new(wave.re as f32, wave.im as f32)
    };
    for index in tiles {
        progress.check()?;
        let levels = reader.tile(index)?;
        let file = tile_in_file(plate, index);
        let rect = tile_on_plate(plate, index).and(part);
        // The tile in the plate's own rows and columns.
        let mut own = vec![0u8; rect.area()];
        for row in file.y[0]..file.y[1] {
            for column in file.x[0]..file.x[1] {
                let [x, y] = super::geometry::plate_from_file(plate, [column, row]);
                if (rect.x[0]..rect.x[1]).contains(&x) && (rect.y[0]..rect.y[1]).contains(&y) {
                    let at = (row - file.y[0]) as usize * plate.tile as usize + (column - file.x[0]) as usize;
                    own[(y - rect.y[0]) as usize * rect.width() + (x - rect.x[0]) as usize] = levels[at];
                }
            }
        }
        let inner = |range: [i64; 2], from: i64| [range[0] - from, range[1] - from];
        let columns = across.touched(inner(rect.x, part.x[0]), kept[0]);
        let rows = down.touched(inner(rect.y, part.y[0]), kept[1]);
        let along: Vec<Complex32> = (rect.x[0]..rect.x[1]).map(|c| turned(-carrier[0] * plate.x(c))).collect();
        let width = columns.len();
        let mut lines = vec![Complex32::default(); rect.height() * width];
        lines.par_chunks_mut(width.max(1)).zip(own.par_chunks(rect.width())).enumerate().for_each_init(
            || (Vec::new(), Vec::new()),
            |(reference, lit), (i, (line, levels))| {
                let row = rect.y[0] + i as i64;
                plate.reference.row(plate, wavelength, row, rect.x[0]..rect.x[1], reference);
                let turn = turned(-carrier[1] * plate.y(row));
                lit.clear();
                lit.extend(
                    levels
                        .iter()
                        .zip(reference.iter())
                        .zip(&along)
                        .map(|((&l, &r), &a)| phasors[usize::from(l)] * r * a * turn),
                );
                for (u, column) in line.iter_mut().zip(columns.clone()) {
                    *u = filtered(&across, (column * across.factor) as i64 - (rect.x[0] - part.x[0]), lit);
                }
            },
        );
        let first = rows.start;
        out.par_chunks_mut(kept[0]).skip(first).take(rows.len()).enumerate().for_each(|(i, line)| {
            let middle = ((first + i) * down.factor) as i64 - (rect.y[0] - part.y[0]);
            for (row, values) in lines.chunks_exact(width.max(1)).enumerate() {
                let offset = row as i64 - middle + down.taps;
                let Some(&weight) = usize::try_from(offset).ok().and_then(|o| down.filter.get(o)) else { continue };
                for (u, &value) in line[columns.clone()].iter_mut().zip(values) {
                    *u += value * weight;
                }
            }
        });
        progress.advance(1);
    }
    Ok(out)
}

/// The filter's sum about a pixel that may stand outside of the line.
fn filtered(thinning: &Thinning, middle: i64, line: &[Complex32]) -> Complex32 {
    let from = (middle - thinning.taps).max(0);
    let to = (middle + thinning.taps + 1).min(line.len() as i64);
    if from >= to {
        return Complex32::default();
    }
    let weights = &thinning.filter[(from - middle + thinning.taps) as usize..];
    line[from as usize..to as usize].iter().zip(weights).map(|(u, &w)| u * w).sum()
}

/// A wave about a carrier.
struct Wave {
    wavelength: f64,
    carrier: [f64; 2],
}

impl Wave {
    /// Carries samples, the carrier taken out of them, over a distance onto a window of the same pitch.
    ///
    /// The band-limited angular spectrum of [`crate::propagation`], with each frequency's true one f + f_c.
    fn carried(
        &self,
        samples: Vec<Complex32>,
        input: &Grid,
        output: &Grid,
        distance: f64,
        progress: &Progress,
    ) -> Result<Vec<Complex32>> {
        progress.check()?;
        let padded = Grid::new(input.width + output.width, input.height + output.height, input.pitch_x, input.pitch_y)?;
        let mut field = vec![Complex32::default(); padded.len()];
        for (line, row) in field.chunks_exact_mut(padded.width).zip(samples.chunks_exact(input.width)) {
            line[..row.len()].copy_from_slice(row);
        }
        drop(samples);
        let shift = [output.x(0) - input.x(0), output.y(0) - input.y(0)];
        let bands = [
            band(self.wavelength, distance, output.center[0] - input.center[0], padded.extent_x()),
            band(self.wavelength, distance, output.center[1] - input.center[1], padded.extent_y()),
        ];
        let [cx, cy] = self.carrier;
        let rows: Vec<f64> = (0..padded.height).map(|k| padded.frequency_y(k)).collect();
        let highest = 1.0 / (self.wavelength * self.wavelength);
        Fft2::new(padded.width, padded.height).filter(&mut field, input.height, output.height, |kx, column| {
            let fx = padded.frequency_x(kx);
            let true_x = fx + cx;
            if progress.stopped() || !(bands[0][0]..=bands[0][1]).contains(&true_x) {
                column.fill(Complex32::default());
                return;
            }
            for (u, &fy) in column.iter_mut().zip(&rows) {
                let true_y = fy + cy;
                let square = highest - true_x * true_x - true_y * true_y;
                if square <= 0.0 || !(bands[1][0]..=bands[1][1]).contains(&true_y) {
                    *u = Complex32::default();
                    continue;
                }
                let turns = distance * square.sqrt() + fx * shift[0] + fy * shift[1];
                let factor = Complex64::cis(TAU * (turns - turns.round()));
                *u *= Complex32::new(factor.re as f32, factor.im as f32);
            }
        });
        progress.check()?;
        let mut out = Vec::with_capacity(output.len());
        for row in field.chunks_exact(padded.width).take(output.height) {
            out.extend_from_slice(&row[..output.width]);
        }
        Ok(out)
    }
}
