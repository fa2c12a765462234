//! What an eye sees of a finished plate: the reference wave shines on the fringes of the file.
//!
//! Nothing of the object's field is used, only levels, pitch and reference: what is wrong with the file shows.
//!
//! Of the light that leaves the plate only what goes towards the pupil is needed. From all places of the part that is
//! looked at to all places of the pupil its spatial frequencies fill a band about a carrier f_c, a small share of what the
//! pitch carries. So t·r·exp(−i2πf_c·x) is limited to that band and thinned out while the file is read, tile by tile; memory
//! is that of the thinned field. That is carried to the pupil's plane by the exact angular spectrum about f_c, cut by the
//! pupil, and carried back to the plane in focus.

use super::lamp::{Lamp, LampLight};
use super::plate::Plate;
use super::reader::Reader;
use super::reference::frequency_range;
use super::thinning::{Carried, Thinning, USABLE, thin};
use crate::error::{Error, Result};
use crate::field::{Complex32, Complex64, Fft2, Grid};
use crate::progress::Progress;
use crate::propagation::band;
use crate::reconstruction::Picture;
use crate::segments::Rect;
use glam::DVec2;
use std::f64::consts::TAU;
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
    /// Pixels of the picture across and down; 400 along the longer side where `None`.
    pub size: Option<(usize, usize)>,
    /// First column and row of the part that is looked at, and its size; the whole plate where `None`.
    pub part: Option<[u64; 4]>,
    /// Wavelength of the lamp [m]; the plate's own where `None`. Another one shows what white light would do.
    pub wavelength: Option<f64>,
    /// How wide and how coloured the lamp is; a distant point of one wavelength where `None`.
    pub lamp: Option<Lamp>,
    /// Places and wavelengths of such a lamp that are looked at.
    pub places: usize,
    /// Memory that it may take [bytes].
    pub memory: u64,
}

/// What is seen.
#[derive(Clone, Debug)]
pub struct Preview {
    /// The picture on the plane in focus: power in each cell for a reference of 1 W/m², row 0 on top.
    pub picture: Picture,
    /// Depth of that plane, z [m].
    pub focus: f64,
    /// Its middle (x, y) on that plane [m].
    pub center: [f64; 2],
    /// Its half width and half height [m].
    pub half: DVec2,
    /// Every how many columns and rows of the plate one sample was kept, where most were.
    pub thinned: [usize; 2],
    /// Samples across and down of the largest transform to the pupil.
    pub transform: [usize; 2],
    /// Share of the light that goes towards the pupil which passes it.
    pub passed: f64,
    /// The lamp's own light goes through the plate into the pupil.
    pub dazzled: bool,
}

/// Lowest and highest spatial frequency along an axis of light from one rectangle to another at a distance.
fn towards(from: [[f64; 2]; 2], to: [[f64; 2]; 2], distance: f64, wavelength: f64, axis: usize) -> [f64; 2] {
    let way = |axis: usize| [to[axis][0] - from[axis][1], to[axis][1] - from[axis][0]];
    let [low, high] = way(1 - axis);
    let nearest = if low <= 0.0 && high >= 0.0 { 0.0 } else { low.abs().min(high.abs()) };
    frequency_range(way(axis), [nearest, low.abs().max(high.abs())], distance, wavelength)
}

/// Reconstructs what an eye sees of a part of a finished plate.
///
/// What one transform cannot hold in the memory is looked at piece by piece: each piece of the picture with the light of
/// its own place on the plate and of as much around it as the pupil blurs into it.
///
/// # Errors
/// Those of a plate that is missing, incomplete or damaged; [`Error::Parameter`] for an eye that is not in front of plate
/// and focus, and a part that is not on the plate; [`Error::Memory`] past the budget, with what would help;
/// [`Error::Interrupted`].
pub fn preview(folder: &Path, settings: &PreviewSettings, progress: &Progress) -> Result<Preview> {
    let Some(lamp) = &settings.lamp else { return lit(folder, settings, &[[0.0; 2]], progress) };
    let wavelength = settings.wavelength.map_or_else(|| Ok(Reader::open(folder)?.plate().wavelength), Ok)?;
    let mut sum: Option<Preview> = None;
    for LampLight { wavelength, share, tilts } in lamp.light(wavelength, settings.places)? {
        let settings = PreviewSettings { wavelength: Some(wavelength), ..settings.clone() };
        let mut seen = lit(folder, &settings, &tilts, progress)?;
        seen.picture.values.iter_mut().for_each(|v| *v *= share as f32);
        seen.passed *= share;
        sum = Some(match sum {
            None => seen,
            Some(mut sum) => {
                sum.picture.values.iter_mut().zip(&seen.picture.values).for_each(|(sum, v)| *sum += v);
                sum.passed += seen.passed;
                sum.dazzled |= seen.dazzled;
                sum.thinned = [0, 1].map(|axis| sum.thinned[axis].min(seen.thinned[axis]));
                sum.transform = [0, 1].map(|axis| sum.transform[axis].max(seen.transform[axis]));
                sum
            }
        });
    }
    sum.ok_or_else(|| Error::parameter("lamp", "has no light"))
}

/// The mean over places of a lamp of one wavelength, whose light differs from the reference by `tilts` [cycles/m].
fn lit(folder: &Path, settings: &PreviewSettings, tilts: &[[f64; 2]], progress: &Progress) -> Result<Preview> {
    let mut reader = Reader::open(folder)?;
    let plate = reader.plate().clone();
    let [_, _, ez] = settings.eye;
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
    let (part, grid) = (part_of(&plate, settings.part)?, plate.raster.grid());
    let (width, height) = settings.size.unwrap_or_else(|| {
        let sides = DVec2::new(part.width() as f64 * grid.pitch_x, part.height() as f64 * grid.pitch_y);
        let [width, height] =
            (400.0 * sides / sides.max_element()).to_array().map(|side| (side.round() as usize).max(1));
        (width, height)
    });
    let eye = Eye { plate: &plate, settings, wavelength, tilts };
    let mut pieces = 1;
    let cuts = loop {
        let cut = |range: [i64; 2], cells: usize| -> Vec<(std::ops::Range<usize>, [i64; 2])> {
            let at = |cell: usize| range[0] + ((range[1] - range[0]) * cell as i64) / cells.max(1) as i64;
            let of = |i: usize| i * cells / pieces..(i + 1) * cells / pieces;
            (0..pieces).map(of).filter(|c| !c.is_empty()).map(|c| (c.clone(), [at(c.start), at(c.end)])).collect()
        };
        let (columns, rows) = (cut(part.x, width), cut(part.y, height));
        let looks: Vec<_> = rows
            .iter()
            .flat_map(|(rows, y)| columns.iter().map(move |(columns, x)| (columns, rows, Rect { x: *x, y: *y })))
            .map(|(columns, rows, shown)| (columns.clone(), rows.clone(), eye.look(&shown, &part)))
            .collect();
        let needed = looks.iter().map(|(_, _, look)| look.memory()).max().unwrap_or(0);
        if needed <= settings.memory {
            break looks;
        }
        // Pieces that are no larger than what is blurred into them do not get smaller.
        if pieces >= 64 || pieces >= width.min(height).max(1) {
            return Err(Error::Memory {
                what: "preview",
                needed: needed.div_ceil(1 << 20),
                budget: settings.memory >> 20,
                hint: "look at a part of the plate, or from farther away".into(),
            });
        }
        pieces *= 2;
    };
    let whole = eye.look(&part, &part);
    let mut picture = Picture { width, height, values: vec![0.0; width * height] };
    let (mut passed, mut arriving) = (0.0, 0.0);
    let (mut thinned, mut transform) = ([usize::MAX; 2], [0; 2]);
    for (columns, rows, look) in cuts {
        let (seen, energies) = eye.see(&mut reader, &look, (columns.len(), rows.len()), progress)?;
        for (line, row) in seen.values.chunks_exact(columns.len()).zip(rows) {
            picture.values[row * width..][columns.clone()].copy_from_slice(line);
        }
        (arriving, passed) = (arriving + energies[0], passed + energies[1]);
        thinned = [0, 1].map(|axis| thinned[axis].min(look.factor[axis]));
        transform = [0, 1].map(|axis| transform[axis].max(look.transform[axis]));
    }
    let passed = if arriving > 0.0 { passed / arriving } else { 0.0 };
    let dazzled = eye.dazzled(&part);
    Ok(Preview {
        picture,
        focus: settings.focus,
        center: whole.center,
        half: whole.half,
        thinned,
        transform,
        passed,
        dazzled,
    })
}

/// Whoever looks, and at what.
struct Eye<'a> {
    plate: &'a Plate,
    settings: &'a PreviewSettings,
    wavelength: f64,
    tilts: &'a [[f64; 2]],
}

/// How one piece is looked at.
struct Look {
    /// What of the plate lights it.
    lit: Rect,
    /// Middle of the band that is kept [cycles/m].
    carrier: [f64; 2],
    /// Every how many pixels a sample is kept, how many are, and how far apart they are [m].
    factor: [usize; 2],
    kept: [usize; 2],
    pitch: [f64; 2],
    /// Samples of pupil, picture and transform.
    pupil: [usize; 2],
    window: [usize; 2],
    transform: [usize; 2],
    /// Middle and half size of the picture on the plane in focus [m].
    center: [f64; 2],
    half: DVec2,
}

impl Look {
    /// Most memory that is held at once [bytes].
    fn memory(&self) -> u64 {
        let kept = (self.kept[0] * self.kept[1]) as u64;
        16 * (self.transform[0] as u64).saturating_mul(self.transform[1] as u64) + 8 * kept
    }
}

/// Edges of a rectangle of the plate along x and y [m].
fn edges(plate: &Plate, rect: &Rect) -> [[f64; 2]; 2] {
    let grid = plate.raster.grid();
    let (x, y) = (|column: i64| grid.x(column as usize), |row: i64| grid.y(row as usize));
    let (dx, dy) = (0.5 * grid.pitch_x, 0.5 * grid.pitch_y);
    [[x(rect.x[0]) - dx, x(rect.x[1] - 1) + dx], [y(rect.y[1] - 1) - dy, y(rect.y[0]) + dy]]
}

impl Eye<'_> {
    /// Edges of the pupil along x and y [m].
    fn opening(&self) -> [[f64; 2]; 2] {
        let PreviewSettings { pupil, eye: [ex, ey, _], .. } = self.settings;
        [ex, ey].map(|e| [e - 0.5 * pupil, e + 0.5 * pupil])
    }

    /// Largest tilt along an axis [cycles/m].
    fn widest(&self, axis: usize) -> f64 {
        self.tilts.iter().map(|tilt| tilt[axis].abs()).fold(0.0, f64::max)
    }

    /// Whether some of the lamp's light goes through a part of the plate straight into the pupil.
    fn dazzled(&self, part: &Rect) -> bool {
        let lamp = self.plate.reference.frequencies(&self.plate.raster.grid(), self.wavelength);
        (0..2).all(|axis| {
            let ends = [edges(self.plate, part), self.opening()];
            let [low, high] = towards(ends[0], ends[1], self.settings.eye[2], self.wavelength, axis);
            let wide = self.widest(axis);
            lamp[axis][0] - wide <= high && lamp[axis][1] + wide >= low
        })
    }

    /// What is needed to see `shown` of a part.
    fn look(&self, shown: &Rect, part: &Rect) -> Look {
        let (plate, PreviewSettings { pupil, focus, eye: [ex, ey, ez], .. }) = (self.plate, self.settings);
        // Out of focus the plate's light is blurred over the pupil's image on it; and the pupil diffracts: nine tenths of
        // a spot's light lie within two of its rings, the rest falls with the cube of the distance.
        let pitches = [plate.raster.pitch_x, plate.raster.pitch_y];
        let tilted = self.widest(0).max(self.widest(1)) * self.wavelength * focus.abs();
        let blur = 0.5 * pupil * focus.abs() / (ez - focus) + 12.0 * self.wavelength * ez / pupil + tilted;
        let [across, down] = pitches.map(|pitch| (1.1 * blur / pitch).ceil() as i64);
        let lit = Rect {
            x: [(shown.x[0] - across).max(part.x[0]), (shown.x[1] + across).min(part.x[1])],
            y: [(shown.y[0] - down).max(part.y[0]), (shown.y[1] + down).min(part.y[1])],
        };
        let opening = self.opening();
        let (mut carrier, mut factor) = ([0.0; 2], [1; 2]);
        for axis in 0..2 {
            let [low, high] = towards(edges(plate, &lit), opening, *ez, self.wavelength, axis);
            carrier[axis] = 0.5 * (low + high);
            // What a tilt brings to the pupil would go beside it without.
            let band = high - low + 2.0 * self.widest(axis);
            factor[axis] = ((USABLE / (pitches[axis] * band)).floor() as usize).clamp(1, 64);
        }
        let kept = [lit.width().div_ceil(factor[0]), lit.height().div_ceil(factor[1])];
        let pitch = [0, 1].map(|axis| pitches[axis] * factor[axis] as f64);
        let pupil = pitch.map(|pitch| (pupil / pitch).ceil() as usize + 2);
        let far = (ez - focus) / ez;
        let [x, y] = edges(plate, shown);
        let half = DVec2::new(0.5 * (x[1] - x[0]) * far, 0.5 * (y[1] - y[0]) * far);
        let window = [0, 1].map(|axis| (2.0 * half[axis] / pitch[axis]).ceil() as usize + 2);
        let transform = [0, 1].map(|axis| kept[axis].max(window[axis]) + pupil[axis]);
        let middle = [0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1])];
        let center = [ex + (middle[0] - ex) * far, ey + (middle[1] - ey) * far];
        Look { lit, carrier, factor, kept, pitch, pupil, window, transform, center, half }
    }

    /// The picture, and the light that arrives at the pupil's plane and that passes it.
    fn see(
        &self,
        reader: &mut Reader,
        look: &Look,
        size: (usize, usize),
        progress: &Progress,
    ) -> Result<(Picture, [f64; 2])> {
        let (plate, PreviewSettings { pupil, focus, eye: [ex, ey, ez], .. }) = (self.plate, self.settings);
        let [pitch_x, pitch_y] = look.pitch;
        let mut grid = Grid::new(look.kept[0], look.kept[1], pitch_x, pitch_y)?;
        // Sample m stands on pixel m·factor of what is lit.
        let whole = plate.raster.grid();
        grid.center = [
            whole.x(look.lit.x[0] as usize) + 0.5 * (look.kept[0] as f64 - 1.0) * pitch_x,
            whole.y(look.lit.y[0] as usize) - 0.5 * (look.kept[1] as f64 - 1.0) * pitch_y,
        ];
        let thinning = look.factor.map(Thinning::new);
        let wave = Carried { wavelength: self.wavelength, carrier: look.carrier };
        let thinned = thin(reader, plate, &look.lit, thinning, look.kept, &wave, progress)?;
        let pupil_grid = Grid::new(look.pupil[0], look.pupil[1], pitch_x, pitch_y)?.centered_at([*ex, *ey]);
        let window = Grid::new(look.window[0], look.window[1], pitch_x, pitch_y)?.centered_at(look.center);
        // Power, so that pieces and colours of other samplings compare.
        let area = pitch_x * pitch_y;
        let energy = |field: &[Complex32]| area * field.iter().map(|u| f64::from(u.norm_sqr())).sum::<f64>();
        let share = 1.0 / self.tilts.len() as f64;
        let mut values = vec![0.0f32; window.len()];
        let (mut arriving, mut passed) = (0.0, 0.0);
        for &[tilt_x, tilt_y] in self.tilts {
            // The samples stay what they are about a carrier that is tilted with them.
            let wave = Carried { carrier: [wave.carrier[0] + tilt_x, wave.carrier[1] + tilt_y], ..wave };
            progress.start("to the pupil", 0);
            let mut at_pupil = wave.propagate(&thinned, &grid, &pupil_grid, *ez, progress)?;
            arriving += share * energy(&at_pupil);
            for (index, u) in at_pupil.iter_mut().enumerate() {
                let (x, y) = (pupil_grid.x(index % pupil_grid.width) - ex, pupil_grid.y(index / pupil_grid.width) - ey);
                if x.hypot(y) > 0.5 * pupil {
                    *u = Complex32::default();
                }
            }
            passed += share * energy(&at_pupil);
            progress.start("to the focus", 0);
            let seen = wave.propagate(&at_pupil, &pupil_grid, &window, focus - ez, progress)?;
            values.iter_mut().zip(&seen).for_each(|(v, u)| *v += (share * area) as f32 * u.norm_sqr());
        }
        Ok((Picture::from_samples(&window, &values, look.half, size.0, size.1), [arriving, passed]))
    }
}

fn part_of(plate: &Plate, part: Option<[u64; 4]>) -> Result<Rect> {
    let [column, row, width, height] = part.unwrap_or([0, 0, plate.raster.width, plate.raster.height]);
    let fits = |from: u64, size: u64, whole: u64| size > 0 && from.checked_add(size).is_some_and(|end| end <= whole);
    if !fits(column, width, plate.raster.width) || !fits(row, height, plate.raster.height) {
        let what = format!(
            "{column},{row},{width}x{height} is not on the plate of {}×{}",
            plate.raster.width, plate.raster.height
        );
        return Err(Error::parameter("part", what));
    }
    let span = |from: u64, size: u64| [from as i64, (from + size) as i64];
    Ok(Rect { x: span(column, width), y: span(row, height) })
}

impl Carried {
    /// Takes samples over a distance onto a window of the same pitch.
    ///
    /// The band-limited angular spectrum of [`crate::propagation`], with each frequency's true one f + f_c.
    fn propagate(
        &self,
        samples: &[Complex32],
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
        let shift = [output.x(0) - input.x(0), output.y(0) - input.y(0)];
        let bands = [
            band(self.wavelength, distance, output.center[0] - input.center[0], padded.extent_x()),
            band(self.wavelength, distance, output.center[1] - input.center[1], padded.extent_y()),
        ];
        let [cx, cy] = self.carrier;
        let rows: Vec<f64> = (0..padded.height).map(|k| padded.frequency_y(k)).collect();
        let highest = 1.0 / (self.wavelength * self.wavelength);
        let transfer = |kx: usize, column: &mut [Complex32]| {
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
        };
        let transform = Fft2::new(padded.width, padded.height);
        transform.filter(&mut field, input.height, output.height, transfer, progress);
        progress.check()?;
        let mut out = Vec::with_capacity(output.len());
        for row in field.chunks_exact(padded.width).take(output.height) {
            out.extend_from_slice(&row[..output.width]);
        }
        Ok(out)
    }
}
