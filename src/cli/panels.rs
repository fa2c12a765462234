//! The panels whose profiles the program carries, and which of their figures nobody has checked.

use super::args::PanelsArgs;
use super::report::Report;
use crate::panel::{Modulation, PanelKind, PanelProfile};
use crate::units::{show_length, show_pitch};
use crate::{Error, Result, files};
use serde::Serialize;
use std::path::Path;

/// What a profile says of a panel, all lengths in metres.
#[derive(Serialize)]
struct Listed {
    name: String,
    maker: String,
    kind: PanelKind,
    modulation: Modulation,
    width: usize,
    height: usize,
    pitch: [f64; 2],
    bits: u8,
    wavelengths: Vec<f64>,
    fill_factor: f64,
    refresh: Option<f64>,
    /// Keys of the profile, those of the figures here among them, that come from memory or one secondary source.
    unverified: Vec<String>,
}

impl Listed {
    fn new(panel: PanelProfile) -> Self {
        Self {
            modulation: panel.modulation(),
            pitch: [panel.pitch_x, panel.pitch_y],
            name: panel.name,
            maker: panel.maker,
            kind: panel.kind,
            width: panel.width,
            height: panel.height,
            bits: panel.bits,
            wavelengths: panel.wavelengths,
            fill_factor: panel.fill_factor,
            refresh: panel.refresh,
            unverified: panel.unverified,
        }
    }

    /// Its figures, each with a question mark where one of these keys is unverified.
    fn line(&self) -> String {
        let marked = |figure: String, keys: &[&str]| {
            let open = self.unverified.iter().any(|key| keys.contains(&key.as_str()));
            if open { format!("{figure}?") } else { figure }
        };
        let modulation = match self.kind {
            PanelKind::PhaseLcos => "phase",
            PanelKind::PistonMirror => "phase, mirrors",
            PanelKind::Amplitude => "amplitude",
            PanelKind::BinaryDmd => "amplitude, mirrors",
        };
        let wavelengths = self.wavelengths.iter().map(|&w| show_length(w)).collect::<Vec<_>>().join(", ");
        let line = format!(
            "{:<20} {:<12} {:<8} {:<7} {modulation:<18} {:<24}",
            self.name,
            marked(format!("{}×{}", self.width, self.height), &["width", "height"]),
            marked(show_pitch(self.pitch), &["pitch", "pitch_x", "pitch_y"]),
            marked(format!("{} bit", self.bits), &["bits"]),
            marked(wavelengths, &["wavelengths"]),
        );
        match self.unverified.as_slice() {
            [] => format!("{line} checked"),
            open => format!("{line} not checked: {}", open.join(", ")),
        }
    }
}

/// Shows a built-in profile's TOML, or writes it to a file.
pub(super) fn give_out(text: Option<&'static str>, output: Option<&Path>, report: &mut Report) -> Result<()> {
    let Some(text) = text else {
        return Err(Error::parameter("NAME", "is a file already; give the name of a built-in profile"));
    };
    match output {
        Some(path) => {
            files::write_bytes(path, text.as_bytes())?;
            report.output("profile", path);
        }
        None => report.add("profile", text, text.trim_end()),
    }
    Ok(())
}

/// Lists the built-in profiles, or gives one of them out.
pub(super) fn panels(args: &PanelsArgs) -> Result<Report> {
    let mut report = Report::new("panels");
    if let Some(name) = &args.name {
        // The usual words for a name that is none.
        PanelProfile::find(name)?;
        give_out(PanelProfile::embedded_text(name), args.output.as_deref(), &mut report)?;
        return Ok(report);
    }
    let all = PanelProfile::embedded_names()
        .map(|name| PanelProfile::find(name).map(Listed::new))
        .collect::<Result<Vec<_>>>()?;
    report.list("panels", all.iter().map(Listed::line), &all, args.output.as_deref())?;
    if all.iter().any(|panel| !panel.unverified.is_empty()) {
        report.line("What is not checked (?) is from memory or one secondary source: see your device's data sheet.");
    }
    Ok(report)
}
