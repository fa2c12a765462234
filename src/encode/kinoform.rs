//! Phase alone: the field's amplitude on the panel is dropped (Lesem, Hirsch & Jordan, *IBM J. Res. Dev.* 13 (1969)).
//!
//! Good for objects of random phase, whose light is spread evenly over the panel; an object of smooth phase gathers its
//! light in places, and loses its picture with its amplitude.

use super::EncodedPattern;
use crate::error::Result;
use crate::field::Field;
use crate::panel::{EncodingRecord, Modulation, Pattern, PhasePattern};
use rayon::prelude::*;
use serde_json::json;

/// arg u at each pixel.
pub(super) fn pattern(field: &Field) -> Result<EncodedPattern> {
    let phase = field.samples.par_iter().map(|u| u.arg()).collect();
    let pattern = Pattern::Phase(PhasePattern::new(field.grid, field.wavelength, phase)?);
    let record = EncodingRecord::new("kinoform", Modulation::Phase, json!({}), None, 1.0);
    Ok(EncodedPattern { pattern, record, target: field.clone(), clipped: 0.0, dropped: 0.0, warnings: Vec::new() })
}
