//! What is known of a panel: geometry, levels, response, video signal; and which of it nobody has checked.

use super::drive_curve::{DriveCurve, Modulation};
use super::embedded::PROFILES;
use super::packing::SignalLayout;
use super::profile_file;
use super::regional::PixelCurve;
use super::response::{Curve, PhaseSign, Response};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::names;
use crate::units::show_length;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

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

/// A file with the wavefront correction of a panel ([`super::wavefront::read`]).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CorrectionFile {
    /// The file.
    pub file: PathBuf,
    /// Wavelength at which it holds [m]; absent: the one that the file says.
    pub wavelength: Option<f64>,
}

/// A panel's profile: read from `calib/*.toml` or from the user's file, all lengths in metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Files of wavefront corrections.
    #[serde(default)]
    pub corrections: Vec<CorrectionFile>,
    /// Keys whose values come from memory or one secondary source.
    pub unverified: Vec<String>,
}

impl PanelProfile {
    /// The embedded default.
    pub fn generic() -> Result<Self> {
        Self::find("generic")
    }

    /// An embedded profile by name, or else the TOML file at that path.
    ///
    /// # Errors
    /// [`Error::Calibration`] when there is neither, or when the file is not a right profile.
    pub fn find(name: &str) -> Result<Self> {
        if let Some((_, text)) = PROFILES.iter().find(|(known, _)| *known == name) {
            return Self::parse(text, Path::new(name));
        }
        let path = Path::new(name);
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) || path.exists() {
            return Self::read(path);
        }
        let names: Vec<_> = Self::embedded_names().collect();
        let meant = names::meant(name, &names);
        Err(Error::calibration(
            name,
            format!("no such panel; {meant}give a .toml file or one of: {}", names.join(", ")),
        ))
    }

    /// Names of the embedded profiles.
    pub fn embedded_names() -> impl Iterator<Item = &'static str> {
        PROFILES.iter().map(|(name, _)| *name)
    }

    /// Reads a profile from a TOML file.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::io(path))?;
        Self::parse(&text, path)
    }

    /// Reads a profile from TOML text; `source` stands in errors.
    pub fn parse(text: &str, source: &Path) -> Result<Self> {
        profile_file::parse(text, source)
    }

    /// What a user should know before trusting the profile: one line a fact that nobody has checked.
    pub fn warnings(&self) -> Vec<String> {
        let unchecked = self.unverified.join(", ");
        if unchecked.is_empty() {
            return Vec::new();
        }
        vec![format!("panel {}: not verified: {unchecked}; check against your device's data sheet", self.name)]
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
