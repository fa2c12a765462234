//! The keys of a profile's TOML file, as they are read and written.

use super::profile::{PanelCommands, PanelKind};
use super::response::PhaseSign;
use super::signal::Packing;
use crate::config::Quantity;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProfileFile {
    pub(super) name: String,
    pub(super) maker: String,
    pub(super) kind: PanelKind,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pitch: Option<Quantity>,
    pub(super) pitch_x: Option<Quantity>,
    pub(super) pitch_y: Option<Quantity>,
    pub(super) bits: u8,
    pub(super) fill_factor: f64,
    #[serde(default = "one")]
    pub(super) dead_space: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) crosstalk: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    pub(super) unmodulated: f64,
    pub(super) beam: Option<PathBuf>,
    pub(super) wavelengths: Vec<Quantity>,
    #[serde(default, skip_serializing_if = "is_increasing")]
    pub(super) phase_sign: PhaseSign,
    pub(super) settle_time: Option<Quantity>,
    pub(super) refresh: Option<Quantity>,
    pub(super) edid: Option<String>,
    pub(super) note: Option<String>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) unverified: Vec<String>,
    pub(super) command: Option<PanelCommands>,
    pub(super) signal: Option<SignalFile>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) correction: Vec<CorrectionEntry>,
    pub(super) response: Vec<ResponseFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CorrectionEntry {
    pub(super) file: PathBuf,
    pub(super) wavelength: Option<Quantity>,
}

/// Dead space is taken to reflect as well as the active area, the worst case, where a profile does not say.
fn one() -> f64 {
    1.0
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn is_increasing(sign: &PhaseSign) -> bool {
    *sign == PhaseSign::Increasing
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SignalFile {
    pub(super) packing: Packing,
    pub(super) width: Option<usize>,
    pub(super) height: Option<usize>,
    #[serde(default)]
    pub(super) column_offset: usize,
    #[serde(default)]
    pub(super) row_offset: usize,
    #[serde(default)]
    pub(super) flip_x: bool,
    #[serde(default)]
    pub(super) flip_y: bool,
}

#[derive(Clone, Copy, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum CurveKind {
    #[default]
    Linear,
    Table,
    Polynomial,
    Piston,
    Amplitude,
    LevelTable,
    Regional,
    /// A vendor's file of phases and levels.
    HamamatsuLut,
    /// A vendor's controller table, loaded here instead of there.
    MeadowlarkLut,
}

#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ResponseFile {
    pub(super) kind: CurveKind,
    pub(super) wavelength: Option<Quantity>,
    pub(super) levels_for_2pi: Option<f64>,
    pub(super) unit: Option<String>,
    pub(super) values: Option<Vec<f64>>,
    pub(super) coefficients: Option<Vec<f64>>,
    pub(super) heights: Option<Vec<Quantity>>,
    pub(super) levels: Option<Vec<u16>>,
    pub(super) regions: Option<[usize; 2]>,
    pub(super) polynomials: Option<Vec<Vec<f64>>>,
    pub(super) tables: Option<Vec<Vec<f64>>>,
    pub(super) file: Option<PathBuf>,
}
