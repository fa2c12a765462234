//! How much of the field that a pattern stands for comes out of the panel's own levels.

use super::drive::{Driven, Pattern, drive};
use super::drive_curve::Modulation;
use super::frame::{EncodingRecord, Frame};
use super::profile::PanelProfile;
use super::simulated::illuminate;
use super::wavefront::Wavefront;
use crate::error::Result;
use crate::field::{Complex32, Complex64, Field, phasor};
use crate::progress::Progress;
use crate::propagation;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// A field behind a panel against the wanted one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Fidelity {
    /// |⟨u, g⟩|² / (⟨u, u⟩·N) for the field g behind N pixels and the wanted field u.
    pub efficiency: f64,
    /// √(1 − |⟨u, g⟩|²/(⟨u, u⟩⟨g, g⟩)) within the record's aperture.
    pub field_error: f64,
    /// Modulus of ⟨u, g⟩/⟨u, u⟩.
    pub scale: f64,
}

/// Drives a panel with a pattern, and measures what its levels make of the wanted field `target`. The frame's record is
/// the given one with the measured scale.
///
/// The panel is ideal beyond its levels: full fill factor, no wavefront error but the one that the correction undoes.
///
/// # Errors
/// As [`drive`]; [`crate::Error::Interrupted`].
pub fn drive_measured(
    pattern: &Pattern,
    mut record: EncodingRecord,
    target: &Field,
    correction: Option<&Wavefront>,
    profile: &PanelProfile,
    progress: &Progress,
) -> Result<(Driven, Fidelity)> {
    let mut driven = drive(pattern, correction, profile)?;
    progress.check()?;
    let shown = shown(&driven.frame, correction, &record)?;
    let fidelity = compare(target, shown, &record, progress)?;
    record.scale = fidelity.scale;
    driven.frame.metadata.encoding = Some(record);
    Ok((driven, fidelity))
}

/// The field behind the panel in the record's illumination, with the wavefront error that the correction undoes.
fn shown(frame: &Frame, correction: Option<&Wavefront>, record: &EncodingRecord) -> Result<Field> {
    let profile = &frame.metadata.panel;
    let wavelength = frame.metadata.wavelength;
    let (curve, _) = profile.pixel_curve(wavelength)?;
    let modulation = curve.modulation();
    let mut samples: Vec<_> = curve
        .values(&frame.levels, frame.width)?
        .into_par_iter()
        .enumerate()
        .map(|(i, value)| match modulation {
            Modulation::Amplitude => Complex32::new(value, 0.0),
            Modulation::Phase => {
                let phase = f64::from(value) - correction.map_or(0.0, |c| f64::from(c.phase[i]));
                phasor((phase * (1.0 / TAU)) as f32)
            }
        })
        .collect();
    let grid = profile.grid()?;
    illuminate(&mut samples, grid, wavelength, record.illumination)?;
    Field::new(grid, wavelength, samples)
}

fn compare(wanted: &Field, seen: Field, record: &EncodingRecord, progress: &Progress) -> Result<Fidelity> {
    let seen = match &record.aperture {
        Some(aperture) => propagation::limit(&seen, aperture, progress)?.0,
        None => seen,
    };
    let row = wanted.grid.width;
    let overlap = |u: &[Complex32], g: &[Complex32]| -> Complex64 {
        let each = u.iter().zip(g);
        each.map(|(u, g)| Complex64::new(u.re.into(), -f64::from(u.im)) * Complex64::new(g.re.into(), g.im.into()))
            .sum()
    };
    // Row by row, so that the sum is the same for any number of threads.
    let rows = wanted.samples.par_chunks(row).zip(seen.samples.par_chunks(row));
    let product: Complex64 = rows.map(|(u, g)| overlap(u, g)).collect::<Vec<_>>().into_iter().sum();
    let (uu, gg, count) = (wanted.energy(), seen.energy(), seen.samples.len() as f64);
    Ok(Fidelity {
        efficiency: product.norm_sqr() / (uu * count),
        field_error: (1.0 - product.norm_sqr() / (uu * gg)).max(0.0).sqrt(),
        scale: product.norm() / uu,
    })
}
