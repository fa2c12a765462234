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
use crate::field::Field;
use crate::panel::{EncodingRecord, Illumination, Modulation, Pattern, PhasePattern};
use crate::progress::Progress;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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
    pub percentile: f64,
}

impl Default for DoublePhase {
    /// A checkerboard, half the band along both axes, and one sample in twenty clipped: for diffuse light, whose few
    /// bright samples would darken all others, that gives the smallest error.
    fn default() -> Self {
        Self { interlace: Interlace::Checkerboard, band: [0.5, 0.5], percentile: 0.95 }
    }
}

pub(super) fn pattern(field: &Field, settings: &DoublePhase, progress: &Progress) -> Result<EncodedPattern> {
    let aperture = band::of_share(field, settings.band)?;
    let (target, dropped) = band::limit(field, &aperture);
    progress.advance(1);
    progress.check()?;
    let greatest = amplitude_at(&target, settings.percentile)?;
    if greatest == 0.0 {
        let what = "no light within the encoding's band; widen it, or move the object nearer to the panel's axis";
        return Err(Error::parameter("band", what));
    }
    let width = field.grid.width;
    let phase: Vec<f32> = target
        .samples
        .par_iter()
        .enumerate()
        .map(|(i, u)| {
            let (column, row) = (i % width, i / width);
            let plus = match settings.interlace {
                Interlace::Checkerboard => (column + row) % 2 == 0,
                Interlace::Columns => column % 2 == 0,
                Interlace::Rows => row % 2 == 0,
            };
            let half = (u.norm() / greatest).min(1.0).acos();
            u.im.atan2(u.re) + if plus { half } else { -half }
        })
        .collect();
    // The greatest amplitude itself may round to either side.
    let clipped =
        target.samples.iter().filter(|u| u.norm() > greatest * (1.0 + 1e-6)).count() as f64 / phase.len() as f64;
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
    let parameters = BTreeMap::from([
        ("interlace".to_owned(), serde_json::json!(settings.interlace)),
        ("band".to_owned(), serde_json::json!(settings.band)),
        ("percentile".to_owned(), serde_json::json!(settings.percentile)),
        ("amplitude".to_owned(), serde_json::json!(greatest)),
    ]);
    let record = EncodingRecord {
        method: "double-phase".into(),
        modulation: Modulation::Phase,
        parameters,
        illumination: Illumination::Normal,
        aperture: Some(aperture),
        scale: 1.0 / f64::from(greatest),
    };
    let pattern = Pattern::Phase(PhasePattern::new(field.grid, field.wavelength, phase)?);
    Ok(EncodedPattern { pattern, record, target, clipped, dropped, warnings })
}
