//! Panel profiles written as TOML: what [`super::profile_file`] reads back as the same profile.

use super::packing::SignalLayout;
use super::profile::{PanelKind, PanelProfile};
use super::response::{Curve, PhaseSign, Response};
use crate::error::Result;
use crate::files;
use std::fmt::Write as _;
use std::path::Path;

impl PanelProfile {
    /// The profile as TOML, after lines of remarks.
    ///
    /// Numbers keep the digits that make them the same again.
    pub fn to_toml(&self, remarks: &[String]) -> String {
        let mut out = String::new();
        for remark in remarks {
            let _ = writeln!(out, "# {}", remark.replace('\n', " "));
        }
        let kind = match self.kind {
            PanelKind::PhaseLcos => "phase-lcos",
            PanelKind::Amplitude => "amplitude",
            PanelKind::BinaryDmd => "binary-dmd",
            PanelKind::PistonMirror => "piston-mirror",
        };
        let _ = writeln!(out, "name = {}\nmaker = {}\nkind = \"{kind}\"", text(&self.name), text(&self.maker));
        let _ = writeln!(out, "width = {}\nheight = {}", self.width, self.height);
        if self.pitch_x == self.pitch_y {
            let _ = writeln!(out, "pitch = \"{}\"", length(self.pitch_x));
        } else {
            let _ = writeln!(out, "pitch_x = \"{}\"\npitch_y = \"{}\"", length(self.pitch_x), length(self.pitch_y));
        }
        let _ = writeln!(out, "bits = {}", self.bits);
        let _ = writeln!(out, "fill_factor = {:?}\ndead_space = {:?}", self.fill_factor, self.dead_space);
        if self.crosstalk > 0.0 {
            let _ = writeln!(out, "crosstalk = {:?}", self.crosstalk);
        }
        let _ = writeln!(out, "wavelengths = [{}]", joined(&self.wavelengths, |w| format!("\"{}\"", length(*w))));
        if self.phase_sign == PhaseSign::Decreasing {
            out += "phase_sign = \"decreasing\"\n";
        }
        if let Some(time) = self.settle_time {
            let _ = writeln!(out, "settle_time = \"{time:?}s\"");
        }
        if let Some(rate) = self.refresh {
            let _ = writeln!(out, "refresh = \"{rate:?}Hz\"");
        }
        if let Some(edid) = &self.edid {
            let _ = writeln!(out, "edid = {}", text(edid));
        }
        if !self.unverified.is_empty() {
            let _ = writeln!(out, "unverified = [{}]", joined(&self.unverified, |key| text(key)));
        }
        signal(&mut out, &self.signal);
        for correction in &self.corrections {
            let _ = writeln!(out, "\n[[correction]]\nfile = {}", text(&correction.file.to_string_lossy()));
            if let Some(wavelength) = correction.wavelength {
                let _ = writeln!(out, "wavelength = \"{}\"", length(wavelength));
            }
        }
        for one in &self.responses {
            response(&mut out, one);
        }
        out
    }

    /// Writes the profile to a file, which appears whole or not at all.
    pub fn write(&self, path: &Path, remarks: &[String]) -> Result<()> {
        files::write_bytes(path, self.to_toml(remarks).as_bytes())
    }
}

fn signal(out: &mut String, layout: &SignalLayout) {
    let _ = writeln!(out, "\n[signal]\npacking = \"{}\"", layout.packing.name());
    let _ = writeln!(out, "width = {}\nheight = {}", layout.width, layout.height);
    let _ = writeln!(out, "column_offset = {}\nrow_offset = {}", layout.column_offset, layout.row_offset);
    let _ = writeln!(out, "flip_x = {}\nflip_y = {}", layout.flip_x, layout.flip_y);
}

fn response(out: &mut String, response: &Response) {
    out.push_str("\n[[response]]\n");
    let kind = match &response.curve {
        Curve::Linear { .. } => "linear",
        Curve::Table { .. } => "table",
        Curve::Polynomial { .. } => "polynomial",
        Curve::Piston { .. } => "piston",
        Curve::LevelTable { .. } => "level-table",
        Curve::Regional { .. } => "regional",
        Curve::Transmittance { .. } | Curve::LinearAmplitude => "amplitude",
    };
    let _ = writeln!(out, "kind = \"{kind}\"");
    if let Some(wavelength) = response.wavelength {
        let _ = writeln!(out, "wavelength = \"{}\"", length(wavelength));
    }
    let numbers = |values: &[f64]| joined(values, |v| format!("{v:?}"));
    let _ = match &response.curve {
        Curve::Linear { levels_for_2pi } => writeln!(out, "levels_for_2pi = {levels_for_2pi:?}"),
        Curve::Table { phase } => writeln!(out, "unit = \"rad\"\nvalues = [{}]", numbers(phase)),
        Curve::Polynomial { coefficients } => {
            writeln!(out, "unit = \"rad\"\ncoefficients = [{}]", numbers(coefficients))
        }
        Curve::Piston { height } => {
            writeln!(out, "heights = [{}]", joined(height, |h| format!("\"{}\"", length(*h))))
        }
        Curve::LevelTable { output } => writeln!(out, "levels = [{}]", joined(output, ToString::to_string)),
        Curve::Regional { columns, rows, curves } => {
            let (mut key, mut each) = ("polynomials", String::new());
            for curve in curves {
                let values = match curve {
                    Curve::Table { phase } => {
                        key = "tables";
                        phase
                    }
                    Curve::Polynomial { coefficients } => coefficients,
                    // A profile's regions have one of these two kinds of curve: it was checked when it was made.
                    _ => continue,
                };
                let _ = write!(each, "\n    [{}],", numbers(values));
            }
            writeln!(out, "unit = \"rad\"\nregions = [{columns}, {rows}]\n{key} = [{each}\n]")
        }
        Curve::Transmittance { amplitude } => writeln!(out, "values = [{}]", numbers(amplitude)),
        Curve::LinearAmplitude => Ok(()),
    };
}

fn joined<T>(values: &[T], one: impl Fn(&T) -> String) -> String {
    values.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// A TOML string.
fn text(value: &str) -> String {
    toml::Value::String(value.into()).to_string()
}

/// The shortest of the usual ways to write a length that gives the same number again.
fn length(metres: f64) -> String {
    let close = |text: &str| crate::units::length(text).is_ok_and(|read| (read - metres).abs() <= 1e-12 * metres.abs());
    let short = crate::units::show_length(metres);
    if close(&short) { short } else { format!("{metres:e}m") }
}
