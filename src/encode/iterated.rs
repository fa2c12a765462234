//! The iterations of [`super::iterative`] as encodings of a field on the panel, or of pictures at depths.

use super::iterative::{
    Constraint, GerchbergSaxton, GradientDescent, Padding, Solution, Start, Target, TargetPlane, gerchberg_saxton,
    gradient_descent,
};
use super::{DoublePhase, EncodedPattern, Interlace, band, double_phase};
use crate::error::{Error, Result};
use crate::field::{Complex32, Field};
use crate::names::{Name, Named};
use crate::panel::{EncodingRecord, Illumination, Modulation, PanelProfile, Pattern};
use crate::progress::Progress;
use crate::propagation::{Aperture, propagate};
use serde_json::{Value, json};

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

/// How amplitudes on planes are reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaneMethod {
    /// Gerchberg & Saxton's projections as they are.
    GerchbergSaxton,
    /// With weights that even out what is too dark.
    Weighted,
    /// With amplitude and phase constrained: no speckle.
    DoubleConstraint,
    /// Gradient descent on the amplitudes.
    Gradient,
}

impl PlaneMethod {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::GerchbergSaxton => "gerchberg-saxton",
            Self::Weighted => "weighted",
            Self::DoubleConstraint => "double-constraint",
            Self::Gradient => "plane-gradient",
        }
    }
}

/// The phases from which amplitudes on planes are sought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaneStart {
    /// The field's own: a warm start. For pictures the phase of the field that has their amplitudes, and one phase on each
    /// plane.
    Field,
    /// The same everywhere.
    Constant,
    /// Random: speckle, and light from every part of the panel to every part of the picture.
    Random {
        /// The seed.
        seed: u64,
    },
    /// A lens that widens the panel's rectangle to 1.4 times its size at the middle depth: no speckle.
    Quadratic,
    /// Random, changing smoothly over 16 pixels.
    Smooth {
        /// The seed.
        seed: u64,
    },
}

impl Named for PlaneStart {
    const KIND: &'static str = "start";
    const NAMES: &'static [Name<Self>] = &[
        ("field", || Self::Field, "the field's own"),
        ("constant", || Self::Constant, "the same everywhere"),
        ("random", || Self::Random { seed: 1 }, "random: speckle"),
        ("quadratic", || Self::Quadratic, "a lens: no speckle"),
        ("smooth", || Self::Smooth { seed: 1 }, "random, changing smoothly"),
    ];
}

/// Settings of the encodings by amplitudes on planes.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaneEncoding {
    /// How.
    pub method: PlaneMethod,
    /// Depths z at which a field's amplitudes should stand [m]: those of the scene. At least one.
    pub depths: Vec<f64>,
    /// Number of iterations.
    pub iterations: usize,
    /// Share of the panel's light that pictures are asked to take; the rest is noise beside them (projections only).
    pub efficiency: f64,
    /// The first phases.
    pub start: PlaneStart,
    /// How the panel's borders are treated.
    pub padding: Padding,
}

impl PlaneEncoding {
    /// A method with 100 iterations that starts from the field's phase.
    pub fn new(method: PlaneMethod) -> Self {
        let start = PlaneStart::Field;
        Self { method, depths: Vec::new(), iterations: 100, efficiency: 0.5, start, padding: Padding::Dark }
    }
}

pub(super) fn gradient(
    field: &Field,
    settings: &BandGradient,
    profile: &PanelProfile,
    illumination: Illumination,
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
        illumination,
    };
    let found = gradient_descent(&target, profile, field.wavelength, &descent, progress)?;
    let parameters = json!({ "band": settings.band, "iterations": settings.iterations, "step": settings.step });
    let record = record("gradient", &found, Some(aperture), illumination, parameters);
    let (dropped, warnings) = (made.dropped, band::lost(made.dropped));
    let pattern = Pattern::Phase(found.pattern);
    Ok(EncodedPattern { pattern, record, target: made.target, clipped: 0.0, dropped, warnings })
}

/// Amplitudes of a field at the depths of the settings.
pub(super) fn of_field(
    field: &Field,
    settings: &PlaneEncoding,
    profile: &PanelProfile,
    illumination: Illumination,
    progress: &Progress,
) -> Result<EncodedPattern> {
    if settings.depths.is_empty() {
        let what = format!("{} needs the depths at which the picture should stand", settings.method.name());
        return Err(Error::parameter("depths", what));
    }
    if settings.depths.len() > 64 {
        return Err(Error::parameter("depths", format!("{} planes; at most 64", settings.depths.len())));
    }
    let mut planes = Vec::new();
    for &z in &settings.depths {
        let light = propagate(field, z, progress)?;
        let phase = |u: &Complex32| u.arg();
        planes.push(TargetPlane {
            z,
            amplitude: light.samples.iter().map(|u| u.norm()).collect(),
            weight: None,
            // The field's own phase is the one that light at all depths has together.
            phase: (settings.method == PlaneMethod::DoubleConstraint)
                .then(|| light.samples.iter().map(phase).collect()),
        });
    }
    let start = match settings.start {
        PlaneStart::Field => Start::Phase(field.samples.iter().map(|u| u.arg()).collect()),
        other => start(other, &settings.depths, profile, field.wavelength),
    };
    let found = run(&Target::Amplitude(planes), settings, start, profile, field.wavelength, illumination, progress)?;
    let record = record(settings.method.name(), &found, None, illumination, parameters(settings));
    let pattern = Pattern::Phase(found.pattern);
    Ok(EncodedPattern { pattern, record, target: field.clone(), clipped: 0.0, dropped: 0.0, warnings: Vec::new() })
}

/// Phases for wanted amplitudes on planes (the settings' depths are not looked at).
pub(super) fn of_planes(
    planes: Vec<TargetPlane>,
    wavelength: f64,
    settings: &PlaneEncoding,
    profile: &PanelProfile,
    illumination: Illumination,
    progress: &Progress,
) -> Result<(Solution, EncodingRecord)> {
    let depths: Vec<f64> = planes.iter().map(|plane| plane.z).collect();
    let start = match settings.start {
        PlaneStart::Field => {
            let grid = profile.grid()?;
            let mut sum = vec![Complex32::new(0.0, 0.0); grid.len()];
            for plane in &planes {
                let light =
                    |(i, &a): (usize, &f32)| Complex32::from_polar(a, plane.phase.as_ref().map_or(0.0, |p| p[i]));
                let field = Field::new(grid, wavelength, plane.amplitude.iter().enumerate().map(light).collect())?;
                let back = propagate(&field, -plane.z, progress)?;
                sum.iter_mut().zip(&back.samples).for_each(|(sum, u)| *sum += u);
            }
            Start::Phase(sum.iter().map(|u| u.arg()).collect())
        }
        other => start(other, &depths, profile, wavelength),
    };
    let found = run(&Target::Amplitude(planes), settings, start, profile, wavelength, illumination, progress)?;
    let settings = PlaneEncoding { depths, ..settings.clone() };
    let record = record(settings.method.name(), &found, None, illumination, parameters(&settings));
    Ok((found, record))
}

fn start(start: PlaneStart, depths: &[f64], profile: &PanelProfile, wavelength: f64) -> Start {
    match start {
        PlaneStart::Field | PlaneStart::Constant => Start::Constant,
        PlaneStart::Random { seed } => Start::Random { seed },
        PlaneStart::Smooth { seed } => Start::Smooth { seed, length: 16.0 },
        PlaneStart::Quadratic => Start::Quadratic { focal_length: focal_length(depths, profile, wavelength) },
    }
}

/// Focal length of a lens that widens the panel's rectangle to 1.4 times its size at the middle depth (the wave's width at
/// depth z is 1 + z/f times that on the panel): smooth light all over the picture and beside it, where what is too much
/// can go. On the panel itself any weak lens does.
fn focal_length(depths: &[f64], profile: &PanelProfile, wavelength: f64) -> f64 {
    let middle = depths.iter().sum::<f64>() / depths.len().max(1) as f64;
    // Steeper than half a turn a pixel is no lens.
    let least = profile.width.max(profile.height) as f64 * profile.pitch_x.max(profile.pitch_y).powi(2) / wavelength;
    (2.5 * middle).abs().max(least) * if middle < 0.0 { -1.0 } else { 1.0 }
}

fn run(
    target: &Target,
    settings: &PlaneEncoding,
    start: Start,
    profile: &PanelProfile,
    wavelength: f64,
    illumination: Illumination,
    progress: &Progress,
) -> Result<Solution> {
    let (iterations, padding) = (settings.iterations, settings.padding);
    if settings.method == PlaneMethod::Gradient {
        let descent = GradientDescent { iterations, start, padding, illumination, ..GradientDescent::default() };
        return gradient_descent(target, profile, wavelength, &descent, progress);
    }
    let projections = GerchbergSaxton {
        iterations,
        weighting: match settings.method {
            PlaneMethod::Weighted | PlaneMethod::DoubleConstraint => 0.1,
            _ => 0.0,
        },
        constraint: match settings.method {
            PlaneMethod::DoubleConstraint => Constraint::AmplitudeAndPhase,
            _ => Constraint::Amplitude,
        },
        efficiency: settings.efficiency,
        start,
        padding,
        illumination,
    };
    gerchberg_saxton(target, profile, wavelength, &projections, progress)
}

fn parameters(settings: &PlaneEncoding) -> Value {
    json!({
        "depths": settings.depths,
        "iterations": settings.iterations,
        "efficiency": settings.efficiency,
        "start": format!("{:?}", settings.start),
    })
}

fn record(
    method: &str,
    found: &Solution,
    aperture: Option<Aperture>,
    illumination: Illumination,
    mut parameters: Value,
) -> EncodingRecord {
    parameters["error"] = json!([found.history.first(), found.history.last()]);
    parameters["rejected"] = json!(found.rejected);
    let scale = if found.scale > 0.0 { 1.0 / found.scale } else { 1.0 };
    let record = EncodingRecord::new(method, Modulation::Phase, parameters, aperture, scale);
    EncodingRecord { illumination, ..record }
}
