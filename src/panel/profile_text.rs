//! Panel profiles written as TOML: what [`super::profile_file`] reads back as the same profile.

use super::profile::PanelProfile;
use super::profile_keys::{CorrectionEntry, CurveKind, ProfileFile, ResponseFile, SignalFile};
use super::response::{Curve, Response};
use crate::config::Quantity;
use crate::error::{Error, Result};
use crate::files;
use std::path::Path;

impl PanelProfile {
    /// The profile as TOML, after lines of remarks.
    ///
    /// Numbers keep the digits that make them the same again.
    ///
    /// # Errors
    /// [`Error::Calibration`] for what TOML has no words for.
    pub fn to_toml(&self, remarks: &[String]) -> Result<String> {
        let square = self.pitch_x == self.pitch_y;
        let side = |pitch: f64| (!square).then(|| length(pitch));
        let signal = &self.signal;
        let file = ProfileFile {
            name: self.name.clone(),
            maker: self.maker.clone(),
            kind: self.kind,
            width: self.width,
            height: self.height,
            pitch: square.then(|| length(self.pitch_x)),
            pitch_x: side(self.pitch_x),
            pitch_y: side(self.pitch_y),
            bits: self.bits,
            fill_factor: self.fill_factor,
            dead_space: self.dead_space,
            crosstalk: self.crosstalk,
            unmodulated: self.unmodulated,
            beam: self.beam.clone(),
            wavelengths: self.wavelengths.iter().map(|w| length(*w)).collect(),
            phase_sign: self.phase_sign,
            settle_time: self.settle_time.map(|time| Quantity(format!("{time:?}s"))),
            refresh: self.refresh.map(|rate| Quantity(format!("{rate:?}Hz"))),
            edid: self.edid.clone(),
            note: self.note.clone(),
            unverified: self.unverified.clone(),
            command: self.command.clone(),
            signal: Some(SignalFile {
                packing: signal.packing,
                width: Some(signal.width),
                height: Some(signal.height),
                column_offset: signal.column_offset,
                row_offset: signal.row_offset,
                flip_x: signal.flip_x,
                flip_y: signal.flip_y,
            }),
            correction: self
                .corrections
                .iter()
                .map(|c| CorrectionEntry { file: c.file.clone(), wavelength: c.wavelength.map(length) })
                .collect(),
            response: self.responses.iter().map(response).collect(),
        };
        let text = toml::to_string(&file).map_err(|e| Error::calibration(&self.source, e.to_string()))?;
        Ok(remarks.iter().map(|remark| format!("# {}\n", remark.replace('\n', " "))).collect::<String>() + &text)
    }

    /// Writes the profile to a file, which appears whole or not at all.
    pub fn write(&self, path: &Path, remarks: &[String]) -> Result<()> {
        files::write_bytes(path, self.to_toml(remarks)?.as_bytes())
    }
}

fn response(response: &Response) -> ResponseFile {
    let of = |kind: CurveKind| ResponseFile { kind, ..ResponseFile::default() };
    let radians = |kind: CurveKind| ResponseFile { unit: Some("rad".into()), ..of(kind) };
    let mut file = match &response.curve {
        Curve::Linear { levels_for_2pi } => {
            ResponseFile { levels_for_2pi: Some(*levels_for_2pi), ..of(CurveKind::Linear) }
        }
        Curve::Table { phase } => ResponseFile { values: Some(phase.clone()), ..radians(CurveKind::Table) },
        Curve::Polynomial { coefficients } => {
            ResponseFile { coefficients: Some(coefficients.clone()), ..radians(CurveKind::Polynomial) }
        }
        Curve::Piston { height } => {
            let heights = height.iter().map(|h| length(*h)).collect();
            ResponseFile { heights: Some(heights), ..of(CurveKind::Piston) }
        }
        Curve::LevelTable { output } => ResponseFile { levels: Some(output.clone()), ..of(CurveKind::LevelTable) },
        Curve::Regional { columns, rows, curves } => {
            // A profile's regions are all tables or all polynomials: it was checked when it was made.
            let (mut tables, mut polynomials) = (Vec::new(), Vec::new());
            for curve in curves {
                match curve {
                    Curve::Table { phase } => tables.push(phase.clone()),
                    Curve::Polynomial { coefficients } => polynomials.push(coefficients.clone()),
                    _ => {}
                }
            }
            ResponseFile {
                regions: Some([*columns, *rows]),
                tables: (!tables.is_empty()).then_some(tables),
                polynomials: (!polynomials.is_empty()).then_some(polynomials),
                ..radians(CurveKind::Regional)
            }
        }
        Curve::Transmittance { amplitude } => {
            ResponseFile { values: Some(amplitude.clone()), ..of(CurveKind::Amplitude) }
        }
        Curve::LinearAmplitude => of(CurveKind::Amplitude),
    };
    file.wavelength = response.wavelength.map(length);
    file
}

/// The shortest of the usual ways to write a length that gives the same number again.
fn length(metres: f64) -> Quantity {
    let close = |text: &str| crate::units::length(text).is_ok_and(|read| (read - metres).abs() <= 1e-12 * metres.abs());
    let short = crate::units::show_length(metres);
    Quantity(if close(&short) { short } else { format!("{metres:e}m") })
}
