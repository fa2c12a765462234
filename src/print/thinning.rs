//! The fringes of a finished plate in the light of the reference, limited to a band and thinned out.

use super::geometry::{plate_from_file, tile_in_file, tile_on_plate};
use super::plate::{Plate, Polarity, Quantity};
use super::reader::Reader;
use crate::error::Result;
use crate::field::{Complex32, Complex64};
use crate::progress::Progress;
use crate::segments::Rect;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Half length of the thinning filter in kept samples.
const TAPS: usize = 8;
/// Share of the kept band that the filter passes evenly and free of aliases.
pub(super) const USABLE: f64 = 0.66;

/// Light about a spatial frequency, which is taken out of it.
pub(super) struct Carried {
    /// Wavelength [m].
    pub(super) wavelength: f64,
    /// The frequency [cycles/m].
    pub(super) carrier: [f64; 2],
}

/// Thinning along one axis: samples `factor` apart, limited to their band.
pub(super) struct Thinning {
    factor: usize,
    /// Filter at offsets −taps … +taps pixels.
    filter: Vec<f32>,
    taps: i64,
}

impl Thinning {
    /// A sinc with a cut at half the kept rate under a Blackman window: its edge is 5.5/(2·8·factor) cycles a pixel wide, so
    /// that two thirds of the kept band are flat and free of aliases to 1e-3.
    pub(super) fn new(factor: usize) -> Self {
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

/// Reads the part's tiles, lets the reference shine on them, and keeps the band about the carrier.
pub(super) fn thin(
    reader: &mut Reader,
    plate: &Plate,
    part: &Rect,
    [across, down]: [Thinning; 2],
    kept: [usize; 2],
    lamp: &Carried,
    progress: &Progress,
) -> Result<Vec<Complex32>> {
    let Carried { wavelength, carrier } = *lamp;
    let mut out = vec![Complex32::default(); kept[0] * kept[1]];
    let highest = if plate.fringe.bits == 1 { 1.0 } else { 255.0f32 };
    let phasors: Vec<Complex32> = (0..=highest as usize)
        .map(|level| {
            let level = level as f32 / highest;
            let t = if plate.fringe.polarity == Polarity::Negative { 1.0 - level } else { level };
            match plate.fringe.quantity {
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
    let grid = plate.raster.grid();
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
                let [x, y] = plate_from_file(plate, [column, row]);
                if rect.contains([x, y]) {
                    let at = (row - file.y[0]) as usize * plate.file.tile as usize + (column - file.x[0]) as usize;
                    own[(y - rect.y[0]) as usize * rect.width() + (x - rect.x[0]) as usize] = levels[at];
                }
            }
        }
        let inner = |range: [i64; 2], from: i64| [range[0] - from, range[1] - from];
        let columns = across.touched(inner(rect.x, part.x[0]), kept[0]);
        let rows = down.touched(inner(rect.y, part.y[0]), kept[1]);
        let along: Vec<Complex32> = (rect.x[0]..rect.x[1]).map(|c| turned(-carrier[0] * grid.x(c as usize))).collect();
        let width = columns.len();
        let mut lines = vec![Complex32::default(); rect.height() * width];
        lines.par_chunks_mut(width.max(1)).zip(own.par_chunks(rect.width())).enumerate().for_each_init(
            || (Vec::new(), Vec::new()),
            |(reference, lit), (i, (line, levels))| {
                let row = rect.y[0] + i as i64;
                plate.reference.row(&grid, wavelength, row, rect.x[0]..rect.x[1], reference);
                let turn = turned(-carrier[1] * grid.y(row as usize));
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
