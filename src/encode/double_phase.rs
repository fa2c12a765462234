//! Double phase: one complex value as the mean of two phases on neighbouring pixels (Hsueh & Sawchuk, *Applied Optics*
//! 17, 3874 (1978)).
//!
//! With |u| ≤ 1, u = ½(exp iθ₊ + exp iθ₋) for θ± = arg u ± arccos|u|. A pixel shows one of the two, its neighbour the
//! other, so the panel's field is u + s·i√(1 − |u|²)·exp(i arg u) with s = ±1 alternating from pixel to pixel. The second
//! term is the conjugate orders: it lies about the corner (checkerboard) or the edge (columns, rows) of the panel's band,
//! as wide as the object's own spectrum. So the object is limited to half of the band, and a stop in the Fourier plane,
//! the record's aperture, keeps the rest out. What √(1 − |u|²) has beyond the object's band still leaks in.

use super::{EncodedPattern, amplitude_at, band};
use crate::error::{Error, Result};
use crate::field::{Complex32, Complex64, Field, Grid, angle, phasor};
use crate::panel::{EncodingRecord, Modulation, Pattern, PhasePattern};
use crate::progress::Progress;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::f32::consts::TAU;

/// Which pixels show θ₊.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interlace {
    /// Those with an even sum of column and row: conjugate orders in the corners of the band.
    #[default]
    Checkerboard,
    /// Even columns: conjugate orders at the left and right edges.
    Columns,
    /// Even rows: conjugate orders at the upper and lower edges.
    Rows,
}

/// Settings of the double-phase encoding.
#[derive(Clone, Debug, PartialEq)]
pub struct DoublePhase {
    /// Which pixels show θ₊.
    pub interlace: Interlace,
    /// Half widths of the object's band along x and y, as shares of the panel's 1/(2·pitch), 0 … 1.
    ///
    /// Conjugate orders stay out where at least one share in the interlacing's directions is at most a half.
    pub band: [f64; 2],
    /// The amplitude that becomes 1 is the one below which this share of the samples lies; larger ones are clipped.
    /// Absent: the one of [`PERCENTILES`] that leaves the least error in the band, found on the panel's middle.
    pub percentile: Option<f64>,
}

impl Default for DoublePhase {
    /// A checkerboard, half the band along both axes, and as much clipped as is best for the field.
    fn default() -> Self {
        Self { interlace: Interlace::Checkerboard, band: [0.5, 0.5], percentile: None }
    }
}

/// What is tried where no percentile is given. A field of random phases (speckle) errs least near 0.9: larger
/// amplitudes leave √(1 − |u|²) near 1 nearly everywhere, and what of it falls into the band is noise. A smooth field
/// errs least without clipping.
pub const PERCENTILES: [f64; 6] = [0.8, 0.9, 0.95, 0.99, 0.999, 1.0];

/// Side of the part of the panel on which percentiles are compared [pixels]; even, so that the interlacing goes on.
const TRIAL: usize = 512;

pub(super) fn pattern(field: &Field, settings: &DoublePhase, progress: &Progress) -> Result<EncodedPattern> {
    let aperture = band::of_share(field, settings.band)?;
    let (target, dropped) = band::object(field, &aperture, progress)?;
    let percentile = match settings.percentile {
        Some(percentile) => percentile,
        None => best_percentile(&target, settings, progress)?,
    };
    progress.check()?;
    let greatest = amplitude_at(&target, percentile)?;
    if greatest == 0.0 {
        let what = "no light within the encoding's band; widen it, or move the object nearer to the panel's axis";
        return Err(Error::parameter("band", what));
    }
    let phase = phases(&target, f64::from(greatest), settings.interlace);
    // The greatest amplitude itself may round to either side.
    let clipped =
        target.samples.par_iter().filter(|u| u.norm() > greatest * (1.0 + 1e-6)).count() as f64 / phase.len() as f64;
    progress.advance(1);
    let mut warnings = band::lost(dropped);
    let [along_x, along_y] = settings.band.map(|share| share <= 0.5);
    let apart = match settings.interlace {
        Interlace::Checkerboard => along_x || along_y,
        Interlace::Columns => along_x,
        Interlace::Rows => along_y,
    };
    if !apart {
        warnings.push("the band is wider than half the panel's: conjugate orders overlap the object".into());
    }
    let parameters = json!({
        "interlace": settings.interlace, "band": settings.band, "percentile": percentile, "amplitude": greatest,
    });
    let scale = 1.0 / f64::from(greatest);
    let record = EncodingRecord::new("double-phase", Modulation::Phase, parameters, Some(aperture), scale);
    let pattern = Pattern::Phase(PhasePattern::new(field.grid, field.wavelength, phase)?);
    Ok(EncodedPattern { pattern, record, target, clipped, dropped, warnings })
}

/// θ± = arg u ± arccos(|u|/greatest) on the pixels that show them [rad].
fn phases(target: &Field, greatest: f64, interlace: Interlace) -> Vec<f32> {
    let width = target.grid.width;
    let greatest = greatest as f32;
    let of = |(i, u): (usize, &Complex32)| {
        let (column, row) = (i % width, i / width);
        let plus = match interlace {
            Interlace::Checkerboard => (column + row) % 2 == 0,
            Interlace::Columns => column % 2 == 0,
            Interlace::Rows => row % 2 == 0,
        };
        let half = arc_cosine((u.norm_sqr().sqrt() / greatest).min(1.0));
        angle(*u) + if plus { half } else { -half }
    };
    target.samples.par_iter().enumerate().map(of).collect()
}

/// arccos x, 0 to 1, to 4e-7: √(1 − x) times a polynomial (the form of Abramowitz & Stegun 4.4.46), without branches.
#[inline(always)]
fn arc_cosine(x: f32) -> f32 {
    const C: [f32; 8] = [
        1.570_796_4,
        -0.214_599_89,
        0.088_999_264,
        -0.050_312_784,
        0.031_335_47,
        -0.017_808_985,
        0.007_245_449_3,
        -0.001_441_480_2,
    ];
    let series = C.iter().rev().fold(0.0, |sum, c| sum * x + c);
    (1.0 - x).sqrt() * series
}

/// The percentile with the least relative error in the band, after the best complex factor, on the panel's middle.
fn best_percentile(target: &Field, settings: &DoublePhase, progress: &Progress) -> Result<f64> {
    let grid = target.grid;
    let (width, height) = (grid.width.min(TRIAL), grid.height.min(TRIAL));
    let (left, top) = ((grid.width - width) / 2, (grid.height - height) / 2);
    let middle = Grid::new(width, height, grid.pitch_x, grid.pitch_y)?;
    let samples =
        (0..middle.len()).map(|i| target.samples[(top + i / width) * grid.width + left + i % width]).collect();
    let cut = Field::new(middle, target.wavelength, samples)?;
    let aperture = band::of_share(&cut, settings.band)?;
    let (wanted, _) = band::limit(&cut, &aperture, progress)?;
    let mut best = (f64::INFINITY, PERCENTILES[0]);
    for percentile in PERCENTILES {
        let greatest = f64::from(amplitude_at(&wanted, percentile)?);
        if greatest == 0.0 {
            continue;
        }
        let shown = phases(&wanted, greatest, settings.interlace).into_par_iter().map(|p| phasor(p * (1.0 / TAU)));
        let (seen, _) = band::limit(&Field::new(middle, target.wavelength, shown.collect())?, &aperture, progress)?;
        let overlap: Complex64 = wanted.samples.iter().zip(&seen.samples).map(|(a, b)| wide(a).conj() * wide(b)).sum();
        let error = 1.0 - overlap.norm_sqr() / (wanted.energy() * seen.energy()).max(f64::MIN_POSITIVE);
        if error < best.0 {
            best = (error, percentile);
        }
    }
    Ok(best.1)
}

fn wide(u: &Complex32) -> Complex64 {
    Complex64::new(u.re.into(), u.im.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arc_cosine_is_right_to_its_ends() {
        for i in 0..=100_000 {
            let x = i as f32 / 1e5;
            let error = f64::from(arc_cosine(x)) - f64::from(x).acos();
            assert!(error.abs() < 4e-7, "{x}: {error}");
        }
    }
}
