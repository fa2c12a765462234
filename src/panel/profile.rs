//! What is known of a panel: geometry, levels, response, video signal; and which of it nobody has checked.

use super::drive_curve::{DriveCurve, Modulation};
use super::regional::PixelCurve;
use super::response::{Curve, PhaseSign, Response};
use super::signal::{Packing, SignalLayout};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::field::grid::{PITCHES, light};
use crate::units::show_length;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// How a panel modulates light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PanelKind {
    /// Liquid crystal on silicon, phase only.
    PhaseLcos,
    /// Liquid crystal between polarisers: amplitude.
    Amplitude,
    /// Mirrors with two positions: light or none, one bit.
    BinaryDmd,
    /// Mirrors that move along their normal: phase, few unequal levels.
    PistonMirror,
}

impl PanelKind {
    /// What the panel modulates.
    pub fn modulation(self) -> Modulation {
        match self {
            Self::PhaseLcos | Self::PistonMirror => Modulation::Phase,
            Self::Amplitude | Self::BinaryDmd => Modulation::Amplitude,
        }
    }
}

/// A file with the wavefront correction of a panel ([`super::Wavefront::read`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CorrectionFile {
    /// The file.
    pub file: PathBuf,
    /// Wavelength at which it holds [m]; absent: the one that the file says.
    pub wavelength: Option<f64>,
}

/// What makes a panel ready beside its video signal, and what puts it back: lines for the system's shell (a vendor's program that
/// sets gain and gamma over USB, or `stty` and `printf` for a serial line).
///
/// ```toml
/// [command]
/// before = "slmctl --usb --gain 1.8 --wavelength {wavelength}"
/// after = "slmctl --usb --standby"
/// ```
///
/// Nothing here runs them: a profile may come from anyone, so that whoever runs the program has to allow it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PanelCommands {
    /// Run before the first frame is shown; `{wavelength}` stands for the vacuum wavelength in nm.
    pub before: Option<String>,
    /// Run after the last one.
    pub after: Option<String>,
}

/// A panel's profile: read from `calib/*.toml` or from the user's file, all lengths in metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PanelProfile {
    /// Where it was read: a file, or the name of an embedded profile. Errors about the profile name it.
    pub source: PathBuf,
    /// Short name, as `--panel` takes it.
    pub name: String,
    /// Who makes it.
    pub maker: String,
    /// How it modulates.
    pub kind: PanelKind,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Distance of neighbouring columns [m].
    pub pitch_x: f64,
    /// Distance of neighbouring rows [m].
    pub pitch_y: f64,
    /// Bits a pixel: drive levels run over 0 … 2^bits − 1.
    pub bits: u8,
    /// Share of a pixel's area that modulates, 0 … 1.
    pub fill_factor: f64,
    /// Amplitude that the dead space between pixels sends back, against 1 of the active area.
    pub dead_space: f64,
    /// Wavelengths that it is made or calibrated for [m]; the first is the default.
    pub wavelengths: Vec<f64>,
    /// Level → modulation, per wavelength.
    pub responses: Vec<Response>,
    /// Whether phase rises or falls with the level.
    pub phase_sign: PhaseSign,
    /// How levels travel in the video signal.
    pub signal: SignalLayout,
    /// Time from a frame on the wire to settled light [s].
    pub settle_time: Option<f64>,
    /// Frame rate [Hz].
    pub refresh: Option<f64>,
    /// Start of the monitor name or serial in its EDID, by which it is found among monitors.
    pub edid: Option<String>,
    /// Standard deviation of the Gaussian by which neighbouring pixels' phases blend [pixels]; 0 where it is not known.
    #[serde(default)]
    pub crosstalk: f64,
    /// Share of the light that comes back unmodulated beside the dead space's (cover glass, and what the liquid crystal does not
    /// take): fields are √(1 − q) of the pixels' and √q of level phase zero's; 0 where it is not known.
    #[serde(default)]
    pub unmodulated: f64,
    /// File with the amplitude of the laser's beam on each pixel, 1 at the brightest (`.npy`, H×W).
    #[serde(default)]
    pub beam: Option<PathBuf>,
    /// Files of wavefront corrections.
    #[serde(default)]
    pub corrections: Vec<CorrectionFile>,
    /// What the panel's second channel is sent, where it has one.
    #[serde(default)]
    pub command: Option<PanelCommands>,
    /// What has to be so at the device for the profile to hold; told wherever it is used.
    #[serde(default)]
    pub note: Option<String>,
    /// Keys whose values come from memory or one secondary source.
    pub unverified: Vec<String>,
}

impl PanelProfile {
    /// A phase panel without dead space whose levels span one turn at any wavelength, 1 to 8 bits in a gray signal.
    /// `pitch` and `wavelength` (the default one) in metres; the fields say what else may be set.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a size, pitch, number of bits or wavelength outside its domain.
    pub fn phase(width: usize, height: usize, pitch: f64, bits: u8, wavelength: f64) -> Result<Self> {
        let levels_for_2pi = f64::from(1u32 << bits.min(16));
        Self::ideal(PanelKind::PhaseLcos, Curve::Linear { levels_for_2pi }, width, height, pitch, bits, wavelength)
    }

    /// An amplitude panel without dead space whose transmittance rises in proportion to the level; otherwise as
    /// [`PanelProfile::phase`]. One bit is a mirror panel.
    ///
    /// # Errors
    /// As [`PanelProfile::phase`].
    pub fn amplitude(width: usize, height: usize, pitch: f64, bits: u8, wavelength: f64) -> Result<Self> {
        let kind = if bits == 1 { PanelKind::BinaryDmd } else { PanelKind::Amplitude };
        Self::ideal(kind, Curve::LinearAmplitude, width, height, pitch, bits, wavelength)
    }

    fn ideal(
        kind: PanelKind,
        curve: Curve,
        width: usize,
        height: usize,
        pitch: f64,
        bits: u8,
        wavelength: f64,
    ) -> Result<Self> {
        for (name, size) in [("panel width", width), ("panel height", height)] {
            if !(1..=1 << 16).contains(&size) {
                return Err(Error::out_of_range(name, size, "must be 1 … 65536 pixels"));
            }
        }
        if !(1..=8).contains(&bits) {
            return Err(Error::out_of_range("panel bits", bits, "must be 1 … 8"));
        }
        if !PITCHES.contains(&pitch) {
            let limit = "must be 50nm to 1mm; look at its unit";
            return Err(Error::out_of_range("panel pitch", format!("{pitch:e} m"), limit));
        }
        light(wavelength)?;
        let name = format!("{kind:?} {width}×{height}");
        let profile = Self {
            source: PathBuf::from(&name),
            name,
            maker: "ideal".into(),
            kind,
            width,
            height,
            pitch_x: pitch,
            pitch_y: pitch,
            bits,
            fill_factor: 1.0,
            dead_space: 1.0,
            wavelengths: vec![wavelength],
            responses: vec![Response { wavelength: None, curve }],
            phase_sign: PhaseSign::Increasing,
            signal: SignalLayout::plain(width, height, if bits == 1 { Packing::Gray1 } else { Packing::Gray }),
            settle_time: None,
            refresh: None,
            edid: None,
            crosstalk: 0.0,
            unmodulated: 0.0,
            beam: None,
            corrections: Vec::new(),
            command: None,
            note: None,
            unverified: Vec::new(),
        };
        profile.check().map_err(|what| Error::parameter("panel", what))?;
        Ok(profile)
    }

    /// What a user should know before trusting the profile: one line a fact that nobody has checked.
    pub fn warnings(&self) -> Vec<String> {
        let unchecked = self.unverified.join(", ");
        let unchecked = (!unchecked.is_empty())
            .then(|| format!("not verified: {unchecked}; check against your device's data sheet"));
        self.note.iter().chain(&unchecked).map(|what| format!("panel {}: {what}", self.name)).collect()
    }

    /// Number of drive levels.
    pub fn levels(&self) -> usize {
        1 << self.bits
    }

    /// The panel's pixels as a grid in the hologram frame.
    pub fn grid(&self) -> Result<Grid> {
        Grid::new(self.width, self.height, self.pitch_x, self.pitch_y)
    }

    /// The wavelength used when none is asked for [m].
    pub fn default_wavelength(&self) -> f64 {
        self.wavelengths[0]
    }

    /// What the panel modulates.
    pub fn modulation(&self) -> Modulation {
        self.kind.modulation()
    }

    /// The level → modulation curve at a wavelength [m], with warnings.
    ///
    /// A curve without a wavelength holds at any. Of measured ones the nearest is taken: as it is within 1 nm, by
    /// keeping its optical path (and with a warning) within 25 %.
    ///
    /// # Errors
    /// [`Error::Calibration`] when every curve was measured further away than that.
    pub fn drive_curve(&self, wavelength: f64) -> Result<(DriveCurve, Vec<String>)> {
        let (nearest, measured_at, warnings) = self.response_for(wavelength)?;
        Ok((nearest.curve.resolve(self.levels(), wavelength, measured_at, self.phase_sign), warnings))
    }

    /// The same for each pixel: regions of a panel may have curves of their own.
    pub fn pixel_curve(&self, wavelength: f64) -> Result<(PixelCurve, Vec<String>)> {
        let (nearest, measured_at, warnings) = self.response_for(wavelength)?;
        let (levels, size) = (self.levels(), (self.width, self.height));
        Ok((nearest.curve.resolve_pixels(levels, size, wavelength, measured_at, self.phase_sign), warnings))
    }

    /// The response nearest to a wavelength, where it was measured if elsewhere, and warnings.
    fn response_for(&self, wavelength: f64) -> Result<(&Response, Option<f64>, Vec<String>)> {
        /// Lasers drift and labels round by less than this [m].
        const SAME: f64 = 1e-9;
        /// Dispersion of a nematic liquid crystal bends a curve by several per cent over this relative distance.
        const FAR: f64 = 0.25;
        let distance = |r: &Response| r.wavelength.map_or(0.0, |w| (w - wavelength).abs());
        let nearest = self
            .responses
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .ok_or_else(|| Error::calibration(&self.source, "no response; add a [[response]]"))?;
        let mut warnings = Vec::new();
        let measured_at = nearest.wavelength.filter(|_| distance(nearest) > SAME);
        let physical = matches!(nearest.curve, Curve::Piston { .. });
        if let (Some(measured), false) = (measured_at, physical) {
            let (wished, has) = (show_length(wavelength), show_length(measured));
            if distance(nearest) > FAR * measured {
                let what = format!(
                    "no response for {wished}; the nearest is for {has}: add a [[response]] measured at {wished}"
                );
                return Err(Error::calibration(&self.source, what));
            }
            warnings.push(format!(
                "panel {}: the response for {has} is used at {wished}, dispersion neglected; calibrate at {wished}",
                self.name
            ));
        }
        Ok((nearest, measured_at, warnings))
    }

    /// An ideal amplitude modulator with the same pixels, levels and signal: this liquid crystal between polarisers.
    ///
    /// For amplitude fringes on a panel that modulates phase; returns `None` where the panel is one already.
    pub fn as_amplitude(&self) -> Option<Self> {
        if self.modulation() == Modulation::Amplitude {
            return None;
        }
        let responses = vec![Response { wavelength: None, curve: Curve::LinearAmplitude }];
        let name = format!("{} as amplitude modulator", self.name);
        Some(Self { name, kind: PanelKind::Amplitude, responses, ..self.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_are_made_without_a_file_and_bad_numbers_are_refused() {
        for profile in [PanelProfile::phase(64, 48, 8e-6, 8, 532e-9), PanelProfile::amplitude(64, 48, 8e-6, 1, 532e-9)]
        {
            let profile = profile.expect("profile");
            // What a file may say: it is written and read back the same.
            let text = profile.to_toml(&[]).expect("toml");
            assert_eq!(PanelProfile::parse(&text, &profile.source).expect("read"), profile);
        }
        let (curve, _) =
            PanelProfile::phase(4, 4, 8e-6, 8, 532e-9).expect("profile").drive_curve(600e-9).expect("curve");
        assert_eq!(curve.nearest(std::f64::consts::PI).0, 128);
        for (width, pitch, bits, wavelength, word) in [
            (0, 8e-6, 8, 532e-9, "width"),
            (4, 0.0, 8, 532e-9, "pitch"),
            (4, f64::NAN, 8, 532e-9, "pitch"),
            (4, 8e-6, 0, 532e-9, "bits"),
            (4, 8e-6, 200, 532e-9, "bits"),
            (4, 8e-6, 8, -1.0, "wavelength"),
        ] {
            let error = PanelProfile::phase(width, 4, pitch, bits, wavelength).expect_err(word);
            assert!(matches!(error, Error::OutOfRange { .. }) && error.to_string().contains(word), "{error}");
        }
    }
}
