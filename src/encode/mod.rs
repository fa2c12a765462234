//! Field → pattern for a panel: phase only or amplitude fringes, in the panel's own levels and range.
//!
//! Every encoding makes a [`Pattern`], and an [`EncodingRecord`] that says how a reconstruction gets the field back: the
//! wave that lights the panel, and the window of spatial frequencies to keep. [`encode`] puts the pattern through the
//! panel's fixed order ([`crate::panel::drive`]) and measures what came of it on the panel's own levels.
//!
//! | encoding | modulates | band of the object | largest efficiency |
//! |---|---|---|---|
//! | [`Encoding::DoublePhase`] | phase | half the panel's by default | mean of \|u\|² over its greatest value |
//! | [`Encoding::Kinoform`] | phase | all | mean of \|u\| squared over mean of \|u\|² |
//! | [`Encoding::OffAxisBipolar`] | amplitude | half the panel's along the carrier | 1/16 |
//! | [`Encoding::OffAxisIntensity`] | amplitude | a quarter of the panel's along the carrier | 1/16 |
//! | [`Encoding::SingleSideBand`] | amplitude | the upper half of the panel's | 1/16 |
//! | [`Encoding::ErrorDiffusion`] | phase | half the panel's by default | as double phase |
//! | [`Encoding::Gradient`] | phase | half the panel's by default | what the best fit takes |
//! | [`Encoding::Planes`] | phase | all | nearly all; as asked where light may be free |
//! | [`Encoding::View`] | phase | all | nearly all, into the eye box |
//! | [`Encoding::Cells`] | amplitude | a third or a quarter along x | 1/12 (Burckhardt), 1/16 (Lee) |
//! | [`Encoding::Binary`] | amplitude, 1 bit | half the panel's along the carrier | 1/π² by threshold |
//!
//! ```
//! use holodrive::encode::{DoublePhase, EncodeSettings, Encoding, encode};
//! use holodrive::field::{Complex32, Field};
//! use holodrive::panel::PanelProfile;
//! use holodrive::progress::Progress;
//!
//! let panel = PanelProfile::phase(64, 48, 8e-6, 8, 532e-9)?;
//! let mut field = Field::zeros(panel.grid()?, 532e-9);
//! field.samples.fill(Complex32::new(1.0, 0.0));
//! let settings = EncodeSettings::new(Encoding::DoublePhase(DoublePhase::default()));
//! let encoded = encode(&field, &panel, &settings, &Progress::new())?;
//! assert!(encoded.report.efficiency > 0.99 && encoded.report.field_error < 1e-2);
//! # Ok::<(), holodrive::Error>(())
//! ```
//!
//! The iterative ones also take pictures at depths for targets: [`pictures`], [`iterative`]; a picture in the focal plane of a lens is
//! found with a camera in the loop: [`far`].
//!
//! *Placement.* A phase pattern may be made for light that falls on the panel obliquely or from a point
//! ([`EncodeSettings::illumination`]): at normal incidence it then carries a blaze or a lens of its own, and what dead space
//! and curve errors leave unmodulated goes another way than the object. [`EncodeSettings::stop`] keeps the object's own
//! light out of a disc about the axis, where a stop for the zero order stands.

pub mod band;
pub(crate) mod band_search;
pub mod binary;
pub mod cells;
pub mod double_phase;
mod encoding;
pub mod error_diffusion;
pub mod far;
pub mod fringe;
mod iterated;
pub mod iterative;
pub mod kinoform;
mod model;
pub mod off_axis;
mod options;
pub mod pictures;
pub mod view;

pub use binary::{Binarisation, BinaryFringe};
pub use cells::{Cell, CellHologram};
pub use double_phase::{DoublePhase, Interlace};
pub use encoding::Encoding;
pub use error_diffusion::ErrorDiffusion;
pub use fringe::Quantity;
pub use iterated::{BandGradient, PlaneEncoding, PlaneMethod, PlaneStart};
pub use off_axis::{OffAxis, Reference};
pub use options::EncodeOptions;
pub use view::ViewEncoding;

use crate::error::{Error, Result};
use crate::field::grid::light;
use crate::field::{Complex32, Field};
use crate::names::Named;
use crate::panel::simulated::illuminate;
use crate::panel::{EncodingRecord, Frame, Illumination, Modulation, PanelProfile, Pattern, Wavefront, drive_measured};
use crate::progress::Progress;
use crate::propagation::Aperture;
use rayon::prelude::*;

/// What [`encode`] does beside the encoding.
#[derive(Clone, Debug)]
pub struct EncodeSettings {
    /// The encoding and its own settings.
    pub encoding: Encoding,
    /// The panel's wavefront correction.
    pub correction: Option<Wavefront>,
    /// The wave that falls on the panel (phase encodings; fringes have their reference wave): see [`blaze_and_lens`].
    pub illumination: Illumination,
    /// Radius of the disc of spatial frequencies about the axis that the object's light keeps out of [cycles/m]; 0: none.
    pub stop: f64,
}

impl EncodeSettings {
    /// An encoding without correction.
    pub fn new(encoding: Encoding) -> Self {
        Self { encoding, correction: None, illumination: Illumination::Normal, stop: 0.0 }
    }
}

/// The wave for which a pattern must be made, so that at normal incidence it sends its object aside by the angles θ_x and θ_y
/// [rad] (a blaze) and focuses it by a lens of that focal length [m] (negative: spreads it).
///
/// # Errors
/// [`Error::Parameter`] for angles of a right angle or more, or a focal length that is zero or not finite.
pub fn blaze_and_lens(angles: [f64; 2], focal_length: Option<f64>, wavelength: f64) -> Result<Illumination> {
    let sines = angles.map(f64::sin);
    let within = |a: &f64| a.abs() < std::f64::consts::FRAC_PI_2;
    if !angles.iter().all(within) || sines[0].hypot(sines[1]) >= 1.0 {
        return Err(Error::parameter("blaze", format!("{angles:?} rad: no light runs in that direction")));
    }
    match focal_length {
        None if angles == [0.0, 0.0] => Ok(Illumination::Normal),
        None => Ok(Illumination::Plane { frequency: sines.map(|sine| -sine / wavelength) }),
        Some(length) if length.is_finite() && length != 0.0 => {
            // From a point behind the panel (or towards one before it) in the direction that the blaze turns away.
            let axial = (1.0 - sines[0].powi(2) - sines[1].powi(2)).sqrt();
            Ok(Illumination::Point { position: [length * sines[0], length * sines[1], -length * axial] })
        }
        Some(length) => Err(Error::parameter("lens", format!("{length} m must be finite and not zero"))),
    }
}

/// A pattern before it meets a panel, with the field that it stands for.
#[derive(Clone, Debug)]
pub struct EncodedPattern {
    /// What a panel should show.
    pub pattern: Pattern,
    /// How to get the field back.
    pub record: EncodingRecord,
    /// The field that the pattern stands for: the given one, limited to the encoding's band.
    pub target: Field,
    /// Share of samples whose amplitude was clipped.
    pub clipped: f64,
    /// Share of the field's energy outside the encoding's band, dropped.
    pub dropped: f64,
    /// What a user should know.
    pub warnings: Vec<String>,
}

/// What came of an encoding, measured on the panel's own levels (ideal otherwise: full fill factor, no wavefront error).
#[derive(Clone, Debug, PartialEq)]
pub struct EncodeReport {
    /// The encoding's name.
    pub method: &'static str,
    /// Share of the light on the panel that goes into the wanted field: |⟨u, g⟩|² / (⟨u, u⟩·N) for the field g behind
    /// N pixels and the wanted field u.
    pub efficiency: f64,
    /// Relative error of the field within the encoding's band after the best complex factor: √(1 − |⟨u, g⟩|²/(⟨u, u⟩
    /// ⟨g, g⟩)). It covers the border too, where the sharp band rings. NaN for frames that are made for an eye: they have no wanted
    /// field, see [`view::ViewReport::psnr`].
    pub field_error: f64,
    /// Share of samples whose amplitude passed the normalisation and was clipped.
    pub clipped: f64,
    /// Share of the given field's energy outside the encoding's band, which was dropped.
    pub dropped: f64,
    /// Root mean square of shown − wished phase [rad] (amplitude on an amplitude panel): quantisation and range.
    pub quantisation_error: f64,
    /// Share of pixels whose wish lies outside the panel's range.
    pub unreachable: f64,
    /// What a user should know.
    pub warnings: Vec<String>,
}

/// A frame with its metadata complete (its origin aside, which the caller knows), and the report.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// Levels for the panel.
    pub frame: Frame,
    /// How good they are.
    pub report: EncodeReport,
}

/// Encodes a field on the panel's pixels for that panel.
///
/// An amplitude encoding for a panel that modulates phase is made for the same panel as an amplitude modulator
/// ([`PanelProfile::as_amplitude`]), with a warning: a liquid crystal between polarisers.
///
/// # Errors
/// [`Error::Parameter`] when the field is not on the panel's grid, is dark or not finite, when a setting is out of its
/// domain or the encoding needs phase and the panel has none; [`Error::Undersampled`] when reference wave and object
/// pass the grid's limit; [`Error::Calibration`] when curve or correction do not fit.
pub fn encode(
    field: &Field,
    profile: &PanelProfile,
    settings: &EncodeSettings,
    progress: &Progress,
) -> Result<Encoded> {
    let mut warnings = Vec::new();
    let encoding = &settings.encoding;
    let amplitude = match (encoding.modulation(), profile.modulation()) {
        (Modulation::Phase, Modulation::Amplitude) => {
            let what = format!(
                "{} needs a panel that modulates phase; {} modulates amplitude: take off-axis-bipolar",
                encoding.name(),
                profile.name
            );
            return Err(Error::parameter("method", what));
        }
        (Modulation::Amplitude, Modulation::Phase) => profile.as_amplitude(),
        _ => None,
    };
    if amplitude.is_some() {
        warnings.push(format!(
            "panel {} modulates phase: the fringes are for its pixels as amplitude modulator, between polarisers",
            profile.name
        ));
    }
    let profile = amplitude.as_ref().unwrap_or(profile);
    let grid = profile.grid()?;
    profile.checked()?;
    field.check_samples()?;
    light(field.wavelength)?;
    crate::panel::drive::fit(field.grid, profile)?;
    let made = pattern_for(field, settings, profile, progress)?;
    progress.start("drive levels", grid.height as u64);
    let (driven, fidelity) =
        drive_measured(&made.pattern, made.record, &made.target, settings.correction.as_ref(), profile, progress)?;
    warnings.extend(made.warnings);
    warnings.extend(driven.warnings);
    let report = EncodeReport {
        method: encoding.name(),
        efficiency: fidelity.efficiency,
        field_error: fidelity.field_error,
        clipped: made.clipped,
        dropped: made.dropped,
        quantisation_error: driven.rms_error,
        unreachable: driven.unreachable,
        warnings,
    };
    Ok(Encoded { frame: driven.frame, report })
}

/// The pattern of an encoding before it meets the panel's levels, at normal incidence, with the field that it stands for.
///
/// # Errors
/// As [`encode`].
pub fn pattern(
    field: &Field,
    encoding: &Encoding,
    profile: &PanelProfile,
    progress: &Progress,
) -> Result<EncodedPattern> {
    pattern_for(field, &EncodeSettings::new(encoding.clone()), profile, progress)
}

/// The same for the light and the stop of the settings.
///
/// Only error diffusion and the iterations look at the profile's levels here, because their later pixels or steps make
/// up for what the earlier could not show.
fn pattern_for(
    field: &Field,
    settings: &EncodeSettings,
    profile: &PanelProfile,
    progress: &Progress,
) -> Result<EncodedPattern> {
    let illumination = settings.illumination;
    if illumination != Illumination::Normal && settings.encoding.modulation() == Modulation::Amplitude {
        let what = format!("{} has a reference wave instead; set its angle", settings.encoding.name());
        return Err(Error::parameter("blaze, lens", what));
    }
    let stopped = match settings.stop {
        stop if stop > 0.0 => {
            let all = Aperture::centered(f64::INFINITY, f64::INFINITY);
            Some(band::limit(field, &Aperture { stop, ..all }, progress)?)
        }
        _ => None,
    };
    let (kept, lost) = stopped.as_ref().map_or((field, 0.0), |(field, lost)| (field, *lost));
    let mut made = unstopped_pattern(kept, &settings.encoding, profile, illumination, progress)?;
    if settings.stop > 0.0 {
        let whole = Aperture::centered(field.grid.limit_x() * 1.01, field.grid.limit_y() * 1.01);
        made.record.aperture.get_or_insert(whole).stop = settings.stop;
        made.dropped = 1.0 - (1.0 - made.dropped) * (1.0 - lost);
        if lost > 0.1 {
            made.warnings.push(format!("{:.0} % of the light lies within the stop and is lost", 100.0 * lost));
        }
    }
    if illumination != Illumination::Normal {
        made.record.illumination = illumination;
        if let (Illumination::Plane { frequency }, Some(aperture)) = (illumination, &made.record.aperture) {
            let limits = [field.grid.limit_x(), field.grid.limit_y()];
            if (0..2).any(|axis| frequency[axis].abs() + aperture.half[axis] > limits[axis] * (1.0 + 1e-6)) {
                made.warnings.push(
                    "blaze and object together pass half a cycle a pixel: part of the object comes out in another order"
                        .into(),
                );
            }
            if (0..2).all(|axis| frequency[axis].abs() <= aperture.half[axis]) {
                made.warnings
                    .push("the blaze is less than the object's band: the zero order lies in the picture".into());
            }
        }
    }
    Ok(made)
}

/// The pattern for an incident wave: encodings that do not look at levels are made for normal incidence and turned.
fn unstopped_pattern(
    field: &Field,
    encoding: &Encoding,
    profile: &PanelProfile,
    illumination: Illumination,
    progress: &Progress,
) -> Result<EncodedPattern> {
    use off_axis::OffAxisKind;
    if let Some(i) = field.samples.iter().position(|u| !u.is_finite()) {
        let (column, row) = (i % field.grid.width, i / field.grid.width);
        return Err(Error::parameter("field", format!("the sample at column {column}, row {row} is not finite")));
    }
    if field.samples.iter().all(|u| u.norm_sqr() == 0.0) {
        return Err(Error::parameter("field", "it is dark everywhere; there is nothing to encode"));
    }
    let mut incident = vec![Complex32::new(1.0, 0.0); field.samples.len()];
    illuminate(&mut incident, field.grid, field.wavelength, illumination)?;
    progress.start(encoding.name(), 2);
    let mut made = match encoding {
        Encoding::DoublePhase(settings) => double_phase::pattern(field, settings, progress),
        Encoding::Kinoform => kinoform::pattern(field),
        Encoding::OffAxisBipolar(settings) => off_axis::pattern(field, settings, OffAxisKind::Bipolar, progress),
        Encoding::OffAxisIntensity(settings) => off_axis::pattern(field, settings, OffAxisKind::Intensity, progress),
        Encoding::SingleSideBand(settings) => off_axis::pattern(field, settings, OffAxisKind::SingleSideBand, progress),
        Encoding::ErrorDiffusion(settings) => {
            let curve = profile.drive_curve(field.wavelength)?.0;
            return error_diffusion::pattern(field, settings, &curve, &incident, progress);
        }
        Encoding::Gradient(settings) => {
            return iterated::gradient(field, settings, profile, illumination, progress);
        }
        Encoding::Planes(settings) => {
            return iterated::of_field(field, settings, profile, illumination, progress);
        }
        Encoding::View(_) => {
            let what =
                "view is made from the views of a scene, not from a field on the panel: take kinoform or gradient";
            return Err(Error::parameter("encoding", what));
        }
        Encoding::Cells(settings) => cells::pattern(field, settings, progress),
        Encoding::Binary(settings) => binary::pattern(field, settings, progress),
    }?;
    if let (Pattern::Phase(pattern), false) = (&mut made.pattern, illumination == Illumination::Normal) {
        let turn = |(phase, wave): (&mut f32, &Complex32)| *phase -= wave.arg();
        pattern.phase.par_iter_mut().zip(&incident).for_each(turn);
    }
    Ok(made)
}

/// The amplitude below which a share `percentile` of the samples lies (1: the greatest).
///
/// # Errors
/// [`Error::OutOfRange`] outside (0, 1].
fn amplitude_at(field: &Field, percentile: f64) -> Result<f32> {
    if !(percentile > 0.0 && percentile <= 1.0) {
        return Err(Error::out_of_range("percentile", percentile, "must be above 0 and at most 1"));
    }
    let mut intensity = field.intensity();
    let rank = ((intensity.len() as f64 * percentile).ceil() as usize).max(1) - 1;
    let value = fringe::order_statistic(&mut intensity, rank).sqrt();
    // More than the given share may be dark: then the greatest amplitude is the only scale there is.
    if value > 0.0 { Ok(value) } else { Ok(intensity.iter().fold(0.0, |a: f32, &b| a.max(b)).sqrt()) }
}

#[cfg(test)]
mod tests;
