//! The iterations of [`super::iterative`] as encodings of a field on the panel.

use super::iterative::{
    GerchbergSaxton, GradientDescent, Padding, Solution, Start, Target, TargetPlane, gerchberg_saxton, gradient_descent,
};
use super::{DoublePhase, EncodedPattern, Interlace, band, double_phase};
use crate::error::Result;
use crate::field::Field;
use crate::panel::{EncodingRecord, Illumination, Modulation, PanelProfile, Pattern};
use crate::progress::Progress;
use crate::propagation::{Aperture, propagate};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Settings of the gradient descent on the complex field within a band.
#[derive(Clone, Debug, PartialEq)]
pub struct BandGradient {
    /// Half widths of the object's band along x and y, as shares of the panel's 1/(2·pitch), 0 … 1.
    pub band: [f64; 2],
    /// Number of steps.
    pub iterations: usize,
    /// Largest step of a pixel's phase [rad].
    pub step: f64,
    /// Normalisation of the double-phase pattern from which it starts (see [`DoublePhase::percentile`]).
    pub percentile: Option<f64>,
}

impl Default for BandGradient {
    fn default() -> Self {
        Self { band: [0.5, 0.5], iterations: 60, step: 0.1, percentile: None }
    }
}

/// Settings of the projections between planes.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaneProjections {
    /// Depths at which the field's amplitudes should stand [m]: those of the scene. At least one.
    pub depths: Vec<f64>,
    /// The projections' own settings.
    pub settings: GerchbergSaxton,
    /// Whether the field's phase is the start, rather than `settings.start`.
    pub warm: bool,
}

impl Default for PlaneProjections {
    fn default() -> Self {
        Self {
            depths: Vec::new(),
            settings: GerchbergSaxton { iterations: 30, ..GerchbergSaxton::default() },
            warm: true,
        }
    }
}

pub(super) fn gradient(
    field: &Field,
    settings: &BandGradient,
    profile: &PanelProfile,
    progress: &Progress,
) -> Result<EncodedPattern> {
    let start =
        DoublePhase { interlace: Interlace::Checkerboard, band: settings.band, percentile: settings.percentile };
    let made = double_phase::pattern(field, &start, progress)?;
    let aperture = band::of_share(field, settings.band)?;
    let target = Target::Complex { samples: made.target.samples.clone(), half: aperture.half };
    let descent = GradientDescent {
        iterations: settings.iterations,
        step: settings.step,
        start: Start::Phase(made.pattern.values().to_vec()),
        padding: Padding::Periodic,
    };
    let found = gradient_descent(&target, profile, field.wavelength, &descent, progress)?;
    let parameters = BTreeMap::from([
        ("band".to_owned(), json!(settings.band)),
        ("iterations".to_owned(), json!(settings.iterations)),
        ("step".to_owned(), json!(settings.step)),
    ]);
    Ok(encoded("gradient", made.target, found, Some(aperture), parameters, made.dropped, band::lost(made.dropped)))
}

pub(super) fn projections(
    field: &Field,
    settings: &PlaneProjections,
    profile: &PanelProfile,
    progress: &Progress,
) -> Result<EncodedPattern> {
    if settings.depths.is_empty() {
        let what = "gerchberg-saxton needs the depths at which the picture should stand";
        return Err(crate::error::Error::parameter("depths", what));
    }
    let mut planes = Vec::new();
    for &z in &settings.depths {
        let light = propagate(field, z, progress)?;
        planes.push(TargetPlane { z, amplitude: light.samples.iter().map(|u| u.norm()).collect(), weight: None });
    }
    let mut own = settings.settings.clone();
    if settings.warm {
        own.start = Start::Phase(field.samples.iter().map(|u| u.im.atan2(u.re)).collect());
    }
    let found = gerchberg_saxton(&Target::Amplitude(planes), profile, field.wavelength, &own, progress)?;
    let parameters = BTreeMap::from([
        ("depths".to_owned(), json!(settings.depths)),
        ("iterations".to_owned(), json!(own.iterations)),
        ("weighting".to_owned(), json!(own.weighting)),
    ]);
    Ok(encoded("gerchberg-saxton", field.clone(), found, None, parameters, 0.0, Vec::new()))
}

fn encoded(
    method: &str,
    target: Field,
    found: Solution,
    aperture: Option<Aperture>,
    mut parameters: BTreeMap<String, Value>,
    dropped: f64,
    warnings: Vec<String>,
) -> EncodedPattern {
    let first_and_last = [found.history.first(), found.history.last()];
    parameters.insert("error".to_owned(), json!(first_and_last));
    let record = EncodingRecord {
        method: method.into(),
        modulation: Modulation::Phase,
        parameters,
        illumination: Illumination::Normal,
        aperture,
        scale: if found.scale > 0.0 { 1.0 / found.scale } else { 1.0 },
    };
    EncodedPattern { pattern: Pattern::Phase(found.pattern), record, target, clipped: 0.0, dropped, warnings }
}
