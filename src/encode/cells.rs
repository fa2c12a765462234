//! Cell-oriented amplitude holograms: a complex value as non-negative amplitudes on neighbouring columns, whose light has
//! the phases 0, 2π/M … when it is lit (or seen) along the carrier of period M pixels.
//!
//! Lee (*Applied Optics* 9, 639 (1970)): M = 4, the positive and negative parts of real and imaginary part. Burckhardt
//! (*Applied Optics* 9, 1949 (1970)): M = 3, of which at most two are not zero. A cell's columns are sampled each at its
//! own place, so the picture is not shifted by the detour.

use super::{EncodedPattern, amplitude_at, band};
use crate::error::{Error, Result};
use crate::field::{Complex32, Complex64, Field};
use crate::panel::{EncodingRecord, FringePattern, Illumination, Modulation, Pattern};
use crate::progress::Progress;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::f64::consts::TAU;

/// Columns of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cell {
    /// Three columns, 120° apart.
    Burckhardt,
    /// Four columns, 90° apart.
    Lee,
}

impl Cell {
    /// Columns of a cell.
    pub fn columns(self) -> usize {
        match self {
            Self::Burckhardt => 3,
            Self::Lee => 4,
        }
    }
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Burckhardt => "burckhardt",
            Self::Lee => "lee",
        }
    }
    /// Amplitude that the column in direction zero shows for a value, of modulus at most the value's times 2/√3.
    fn amplitude(self, value: Complex32) -> f32 {
        match self {
            Self::Lee => value.re.max(0.0),
            // With directions 0 and ±120°: a₀ = Re v + |Im v|/√3 between its neighbours, nothing beyond them.
            Self::Burckhardt => (value.re + value.im.abs() / 3f32.sqrt()).max(0.0),
        }
    }
}

/// Settings of the cell-oriented holograms.
#[derive(Clone, Debug, PartialEq)]
pub struct CellHologram {
    /// Which cell.
    pub cell: Cell,
    /// The amplitude that uses the full range is the one below which this share of the samples lies.
    pub percentile: f64,
}

pub(super) fn pattern(field: &Field, settings: &CellHologram, progress: &Progress) -> Result<EncodedPattern> {
    let grid = field.grid;
    let columns = settings.cell.columns();
    let aperture = band::of_share(field, [1.0 / columns as f64, 1.0])?;
    let (target, dropped) = band::object(field, &aperture, progress)?;
    let greatest = amplitude_at(&target, settings.percentile)?;
    if greatest == 0.0 {
        return Err(Error::parameter("percentile", "no light within the cells' band"));
    }
    let carrier = 2.0 * grid.limit_x() / columns as f64;
    let directions: Vec<Complex32> = (0..grid.width)
        .map(|column| {
            let turn = Complex64::cis(-TAU * (carrier * grid.x(column)).fract());
            Complex32::new(turn.re as f32, turn.im as f32)
        })
        .collect();
    // Burckhardt's components reach 2/√3 of the modulus between two directions; the range must hold them.
    let range = if settings.cell == Cell::Burckhardt { 2.0 / 3f32.sqrt() } else { 1.0 } * greatest;
    let raw = |i: usize| settings.cell.amplitude(target.samples[i] * directions[i % grid.width]) / range;
    let transmittance = (0..grid.len()).into_par_iter().map(|i| raw(i).min(1.0)).collect();
    let clipped = (0..grid.len()).into_par_iter().filter(|&i| raw(i) > 1.0 + 1e-6).count() as f64 / grid.len() as f64;
    progress.advance(1);
    let parameters = json!({ "carrier": [carrier, 0.0], "percentile": settings.percentile, "amplitude": greatest });
    let scale = 1.0 / (columns as f64 * f64::from(range));
    let name = settings.cell.name();
    let mut record = EncodingRecord::new(name, Modulation::Amplitude, parameters, Some(aperture), scale);
    record.illumination = Illumination::Plane { frequency: [carrier, 0.0] };
    let pattern = Pattern::Fringe(FringePattern::new(grid, field.wavelength, transmittance)?);
    Ok(EncodedPattern { pattern, record, target, clipped, dropped, warnings: band::lost(dropped) })
}
