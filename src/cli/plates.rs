//! The plates whose profiles the program carries, their printers, and which of their figures nobody has checked.

use super::args::PlatesArgs;
use super::panels::give_out;
use super::report::Report;
use crate::Result;
use crate::print::{Asked, Plate, Quantity};
use crate::units::show_pitch;
use serde::Serialize;

/// What a profile says of a plate, all lengths in metres.
#[derive(Serialize)]
struct Listed {
    name: String,
    machine: String,
    width: u64,
    height: u64,
    extent: [f64; 2],
    pitch: [f64; 2],
    bits: u8,
    quantity: Quantity,
    wavelength: f64,
    /// Largest angle that the pitch diffracts, along x and y [rad].
    diffraction_angle: [f64; 2],
    /// Columns and rows of a stitching field or shot.
    field: Option<[u64; 2]>,
    smallest: Option<f64>,
    /// Keys of the profile that come from memory or one secondary source.
    unverified: Vec<String>,
    /// Whether a card was measured.
    calibrated: bool,
}

impl Listed {
    fn new(plate: Plate) -> Self {
        let pitch = [plate.raster.pitch_x, plate.raster.pitch_y];
        let grid = plate.raster.grid();
        let printer = plate.printer.unwrap_or_default();
        Self {
            name: plate.name,
            machine: printer.machine,
            width: plate.raster.width,
            height: plate.raster.height,
            extent: [grid.extent_x(), grid.extent_y()],
            pitch,
            bits: plate.fringe.bits,
            quantity: plate.fringe.quantity,
            wavelength: plate.wavelength,
            diffraction_angle: pitch.map(|pitch| (plate.wavelength / (2.0 * pitch)).min(1.0).asin()),
            field: printer.field,
            smallest: printer.smallest,
            unverified: printer.unverified,
            calibrated: plate.transfer.is_some(),
        }
    }

    /// Its figures, each with a question mark where its key is unverified.
    fn line(&self) -> String {
        let marked = |figure: String, key: &str| {
            if self.unverified.iter().any(|open| open == key) { format!("{figure}?") } else { figure }
        };
        let field = self.field.map(|[w, h]| marked(format!("fields {w}×{h}"), "printer.field")).unwrap_or_default();
        let line = format!(
            "{:<14} {:<15} {:<7} {:<6} ±{:<6} {:<10} {:<18} {:<38}",
            self.name,
            format!("{}×{} mm", millimetres(self.extent[0]), millimetres(self.extent[1])),
            marked(show_pitch(self.pitch), "pitch"),
            format!("{} bit", self.bits),
            format!("{:.1}°", self.diffraction_angle[0].to_degrees()),
            match self.quantity {
                Quantity::Bipolar => "amplitude",
                Quantity::Intensity => "intensity",
                Quantity::Phase => "phase",
            },
            field,
            self.machine
        );
        match self.unverified.as_slice() {
            [] => line.trim_end().to_owned(),
            open => format!("{line} not checked: {}", open.join(", ")),
        }
    }
}

/// A length in millimetres, to a hundredth.
fn millimetres(metres: f64) -> String {
    let text = format!("{:.2}", metres * 1e3);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Lists the built-in plates, or gives the profile of one out.
pub(super) fn plates(args: &PlatesArgs) -> Result<Report> {
    let mut report = Report::new("plates");
    if let Some(name) = &args.name {
        Plate::find(name, &Asked::default())?;
        give_out(Plate::embedded_text(name), args.output.as_deref(), &mut report)?;
        return Ok(report);
    }
    let all = Plate::embedded_names()
        .map(|name| Plate::find(name, &Asked::default()).map(Listed::new))
        .collect::<Result<Vec<_>>>()?;
    report.list("plates", all.iter().map(Listed::line), &all, args.output.as_deref())?;
    report.line("What is not checked (?) differs between machines or is from one secondary source: see your printer's data sheet.");
    report.line("Dose and line widths are those of your own machine: holodrive calibrate plate.");
    Ok(report)
}
