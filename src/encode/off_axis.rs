//! Amplitude fringes of the object u with an oblique plane reference r = exp(i2πf_r·x).
//!
//! *Single side band* (Bryngdahl & Lohmann, *J. Opt. Soc. Am.* 58, 620 (1968)): the bipolar fringe with the reference on
//! the axis, of an object that has light in the upper half of the band only; the conjugate lies in the lower half.
//!
//! *Bipolar*: t = ½(1 + Re(u·r*)/A), after Lucente: the interference term alone. *Intensity*: t = |u + ρ·r|²/I, as a
//! plate would record it, with the object's own |u|². Lit with r the panel gives back the object where it was,
//!
//! ```text
//! bipolar:    t·r = r/2 + u/(4A) + u*·r²/(4A)
//! intensity:  t·r = (ρ² + |u|²)·r/I + u·ρ/I + u*·ρ·r²/I      (|r| = 1)
//! ```
//!
//! with the zero order along the reference and the conjugate at twice its angle. The three lie apart when the object's
//! half width b, the carrier f_r and the panel's limit 1/(2·pitch) satisfy b < f_r (bipolar) or b < f_r/3 (intensity,
//! whose |u|² is 2b wide), and f_r + b < the limit (or the conjugate's replica reaches the object). One axis decides:
//! the one with the larger share of the limit as carrier. Along the other the object keeps the panel's whole band.

use super::fringe::{self, Fringe, Quantity};
use super::{EncodedPattern, amplitude_at, band};
use crate::error::{Error, Result};
use crate::field::{Complex32, Field};
use crate::panel::simulated::illuminate;
use crate::panel::{EncodingRecord, FringePattern, Illumination, Modulation, Pattern};
use crate::progress::Progress;
use crate::propagation::Aperture;
use rayon::prelude::*;
use serde_json::json;

/// Direction of the reference wave.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    /// Angles θ_x and θ_y to the panel's normal [rad]; positive: the light runs towards +x and +y. f = sin θ/λ.
    Angle([f64; 2]),
    /// Spatial frequency (f_x, f_y) on the panel [cycles/m].
    Carrier([f64; 2]),
}

impl Reference {
    /// Its spatial frequency on the panel [cycles/m].
    pub fn frequency(self, wavelength: f64) -> [f64; 2] {
        match self {
            Self::Angle(angles) => angles.map(|angle| angle.sin() / wavelength),
            Self::Carrier(frequency) => frequency,
        }
    }
}

/// Settings of the off-axis fringes.
#[derive(Clone, Debug, PartialEq)]
pub struct OffAxis {
    /// The reference wave; absent: along +x, at half (bipolar) or three quarters (intensity) of the panel's limit.
    pub reference: Option<Reference>,
    /// Half width of the object's band along the carrier [cycles/m]; absent: the widest that keeps the orders apart.
    pub bandwidth: Option<f64>,
    /// Half width of the object's band across the carrier, as share of the panel's limit, 0 … 1.
    pub across: f64,
    /// The amplitude that uses the full contrast is the one below which this share of the samples lies.
    pub percentile: f64,
    /// Amplitude of the reference over that of the object, ρ/A (intensity only).
    pub reference_ratio: f64,
}

impl Default for OffAxis {
    fn default() -> Self {
        Self { reference: None, bandwidth: None, across: 1.0, percentile: 0.999, reference_ratio: 1.0 }
    }
}

/// The kinds of off-axis fringe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OffAxisKind {
    Bipolar,
    Intensity,
    SingleSideBand,
}

impl OffAxisKind {
    fn name(self) -> &'static str {
        match self {
            Self::Bipolar => "off-axis-bipolar",
            Self::Intensity => "off-axis-intensity",
            Self::SingleSideBand => "single-side-band",
        }
    }

    fn quantity(self) -> Quantity {
        if self == Self::Intensity { Quantity::Intensity } else { Quantity::Bipolar }
    }
}

/// Carrier and band that keep the orders apart on a grid.
struct CarrierBand {
    carrier: [f64; 2],
    band: Aperture,
    warnings: Vec<String>,
}

/// A narrower band than this share of the limit holds no picture: the carrier leaves no room.
const LEAST_BAND: f64 = 0.125;

/// Share of the room between the orders that the object gets: a finite panel's zero order is a little wide itself.
const GUARD: f64 = 0.95;

fn carrier_band(field: &Field, settings: &OffAxis, kind: OffAxisKind) -> Result<CarrierBand> {
    let grid = field.grid;
    let limits = [grid.limit_x(), grid.limit_y()];
    if kind == OffAxisKind::SingleSideBand {
        if settings.reference.is_some() || settings.bandwidth.is_some() {
            let what = "a single side band has its reference on the axis and half the panel's band; leave it out";
            return Err(Error::parameter("reference", what));
        }
        let center = [0.0, 0.5 * limits[1]];
        let half = [limits[0] * settings.across * (1.0 + 1e-9), GUARD * 0.5 * limits[1]];
        return Ok(CarrierBand { carrier: [0.0; 2], band: Aperture { center, half, stop: 0.0 }, warnings: vec![] });
    }
    let separation = kind.quantity().separation().unwrap_or(1.0);
    let carrier = match settings.reference {
        Some(reference) => reference.frequency(field.wavelength),
        None => [limits[0] * separation / (1.0 + separation), 0.0],
    };
    if !carrier.iter().all(|f| f.is_finite()) || carrier[0].hypot(carrier[1]) * field.wavelength >= 1.0 {
        let what = format!("{carrier:?} cycles/m is no propagating wave at {} m", field.wavelength);
        return Err(Error::parameter("reference", what));
    }
    let (carriers, axis) = fringe::carriers(carrier, &grid, field.wavelength);
    for carrier in &carriers {
        carrier.below_limit(0.0)?;
    }
    let (along, limit) = (carriers[axis], limits[axis]);
    let mut warnings = Vec::new();
    let half = match settings.bandwidth {
        Some(bandwidth) => {
            if !(bandwidth > 0.0 && bandwidth.is_finite()) {
                let value = format!("{bandwidth} cycles/m");
                return Err(Error::out_of_range("bandwidth", value, "must be greater than zero"));
            }
            let frequency = along.highest + bandwidth;
            if frequency > limit * (1.0 + 1e-9) {
                let most = limit - along.highest;
                let hint = format!("lower the carrier, or limit the object to {most:.4e} cycles/m");
                return Err(along.undersampled(frequency, hint));
            }
            if bandwidth * separation > along.lowest * (1.0 + 1e-9) {
                warnings.push(format!(
                    "carrier {:.4e} cycles/m below {separation} × bandwidth {bandwidth:.4e}: the zero order overlaps the object",
                    along.lowest
                ));
            }
            bandwidth
        }
        None => GUARD * along.below_limit(LEAST_BAND)?.min(along.beside_zero_order(separation, LEAST_BAND)?),
    };
    let mut share = [settings.across; 2];
    share[axis] = half / limit;
    Ok(CarrierBand { carrier, band: band::of_share(field, share)?, warnings })
}

pub(super) fn pattern(
    field: &Field,
    settings: &OffAxis,
    kind: OffAxisKind,
    progress: &Progress,
) -> Result<EncodedPattern> {
    let ratio = settings.reference_ratio;
    if !(ratio > 0.0 && ratio.is_finite()) {
        return Err(Error::out_of_range("reference_ratio", ratio, "must be greater than zero"));
    }
    let CarrierBand { carrier, band: aperture, mut warnings } = carrier_band(field, settings, kind)?;
    let (target, dropped) = band::object(field, &aperture, progress)?;
    let amplitude = amplitude_at(&target, settings.percentile)?;
    if amplitude == 0.0 {
        let what = "no light within the fringes' band; take another carrier, or move the object nearer to the axis";
        return Err(Error::parameter("bandwidth", what));
    }
    if dropped > 0.1 {
        warnings.push(format!("{:.0} % of the light lies outside the fringes' band and is lost", 100.0 * dropped));
    }
    let illumination = Illumination::Plane { frequency: carrier };
    let mut reference = vec![Complex32::new(1.0, 0.0); target.samples.len()];
    illuminate(&mut reference, field.grid, field.wavelength, illumination)?;
    let fringe = Fringe::new(kind.quantity(), amplitude, ratio);
    let scale = match kind {
        OffAxisKind::Bipolar | OffAxisKind::SingleSideBand => 0.25 / f64::from(amplitude),
        OffAxisKind::Intensity => {
            let rho = f64::from(amplitude) * ratio;
            rho / (f64::from(amplitude) + rho).powi(2)
        }
    };
    let samples = target.samples.par_iter().zip(&reference);
    let transmittance = samples.clone().map(|(&u, &r)| fringe.value(u, r).clamp(0.0, 1.0)).collect();
    // A value on the border up to rounding is not clipped.
    let outside = samples.filter(|&(&u, &r)| !(-1e-6..=1.0 + 1e-6).contains(&fringe.value(u, r)));
    let clipped = outside.count() as f64 / reference.len() as f64;
    progress.advance(1);
    let mut parameters = json!({ "carrier": carrier, "percentile": settings.percentile, "amplitude": amplitude });
    if kind == OffAxisKind::Intensity {
        parameters["reference_ratio"] = json!(ratio);
    }
    let mut record = EncodingRecord::new(kind.name(), Modulation::Amplitude, parameters, Some(aperture), scale);
    record.illumination = illumination;
    let pattern = Pattern::Fringe(FringePattern::new(field.grid, field.wavelength, transmittance)?);
    Ok(EncodedPattern { pattern, record, target, clipped, dropped, warnings })
}
