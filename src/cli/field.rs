//! Fields, phases, levels and frames as inputs: read, and held against the panel that they are for.

use super::args::FieldArgs;
use super::report::Report;
use crate::encode::Encoding;
use crate::field::npy::Content;
use crate::field::stored::{self, Samples, Stored};
use crate::field::{Field, Grid};
use crate::panel::{Frame, Modulation, PanelProfile};
use crate::progress::Progress;
use crate::propagation::{is_same_pitch, resample};
use crate::units::{show_length, show_pitch};
use crate::{Error, Result};
use std::path::Path;

/// What a file of numbers holds.
pub(super) enum Held {
    Field { field: Field, content: Content, are_phases: bool },
    Levels(Box<Frame>),
}

/// What a field is read for.
pub(super) struct For<'a> {
    pub(super) flags: &'a FieldArgs,
    /// The panel, where one is meant: its pixels are those of the field.
    pub(super) panel: Option<&'a PanelProfile>,
    /// The wavelength that was typed [m].
    pub(super) wavelength: Option<f64>,
    pub(super) progress: &'a Progress,
}

impl For<'_> {
    /// Reads a field, phases or levels; what does not fit the panel or the laser is refused, or fitted as the flags say.
    pub(super) fn read(&self, path: &Path, report: &mut Report) -> Result<Held> {
        let held = stored::read(path)?;
        report.warn(&held.warnings);
        if let Samples::Levels(levels) = &held.samples {
            return self.levels(path, &held, levels, report).map(|frame| Held::Levels(Box::new(frame)));
        }
        let are_phases = matches!(held.samples, Samples::Phases(_));
        let own = held.metadata.as_ref();
        let pitch = match (own.map(|m| m.pitch), self.flags.pitch) {
            (Some(own), Some(typed)) if !is_near(own[0], typed[0]) || !is_near(own[1], typed[1]) => {
                let what = format!("has a pitch of {} beside it, --pitch says {}", show_pitch(own), show_pitch(typed));
                return Err(Error::input(path, what));
            }
            (own, typed) => own.or(typed),
        };
        let panel_pitch = self.panel.map(|panel| [panel.pitch_x, panel.pitch_y]);
        let (factor, wavelength) = self.scaled(path, own.map(|m| m.wavelength))?;
        let usual = self.panel.map(PanelProfile::default_wavelength);
        let (mut field, metadata) = held.field(path, pitch.or(panel_pitch), wavelength.or(usual))?;
        let mut content = metadata.content;
        if factor != 1.0 {
            field.wavelength *= factor.recip();
            content.z *= factor;
            content.depth = content.depth.map(|depth| depth.map(|z| z * factor));
            self.say_depths(factor, metadata.content.depth, report);
        }
        let mut said = held.origin.clone();
        if are_phases {
            said += "; floats: phases in radians, of amplitude 1";
        }
        if own.is_none() {
            said += &format!("; taken for {} of {}", show_length(field.wavelength), show_pitch(field.grid.pitch()));
        }
        report.value("read", &said);
        report.value("wavelength", field.wavelength);
        if own.is_none() || are_phases {
            report.line(format!("{:<12} {said}", "read"));
        }
        if let Some(panel) = self.panel {
            field = self.fitted(path, field, panel, report)?;
        }
        Ok(Held::Field { field, content, are_phases })
    }

    /// By how much depths become longer in the wavelength that was typed, and the field's own wavelength.
    fn scaled(&self, path: &Path, own: Option<f64>) -> Result<(f64, Option<f64>)> {
        match (own, self.wavelength) {
            (Some(own), Some(typed)) if own > 0.0 && !is_near(own, typed) => {
                // What a lattice sends into a direction λf goes there in another wavelength as from z·λ/λ'.
                let factor = own / typed;
                if !self.flags.rescale_depth {
                    let what = format!(
                        "was made for {}, --wavelength says {}: its depths would become {factor:.4} times as far; make it for \
                         {}, or add --rescale-depth",
                        show_length(own),
                        show_length(typed),
                        show_length(typed)
                    );
                    return Err(Error::input(path, what));
                }
                Ok((factor, Some(own)))
            }
            (own, typed) => Ok((1.0, own.or(typed))),
        }
    }

    fn say_depths(&self, factor: f64, depth: Option<[f64; 2]>, report: &mut Report) {
        let ends = depth.map(|[near, far]| {
            let [near, far] = [near, far].map(|z| format!("{} becomes {}", show_length(z), show_length(z * factor)));
            if near == far { format!(": {near}") } else { format!(": {near}, {far}") }
        });
        let line =
            format!("depths become {factor:.4} times as far in the other wavelength{}", ends.unwrap_or_default());
        report.add("depth_factor", factor, line);
    }

    /// The field on the panel's pixels.
    fn fitted(&self, path: &Path, mut field: Field, panel: &PanelProfile, report: &mut Report) -> Result<Field> {
        let grid = panel.grid()?;
        let own = field.grid;
        let same_size = (own.width, own.height) == (grid.width, grid.height);
        let off = (0..2).any(|axis| (own.center[axis] - grid.center[axis]).abs() > 0.01 * grid.pitch()[axis]);
        if is_same_pitch(&own, &grid) && same_size && !off {
            field.grid = grid;
            return Ok(field);
        }
        if !self.flags.resample {
            return Err(misfit(path, &own, panel, &grid));
        }
        self.progress.start("resample", 0);
        let found = resample(&field, &grid, self.progress)?;
        let notes = found.notes.join("; ");
        if !notes.is_empty() {
            report.add("resampled", &notes, format!("{:<12} {notes}", "resampled"));
        }
        if found.lost > 0.01 {
            let what =
                "of the field's light is lost: beyond the panel's edges, or of waves that its pitch cannot carry";
            report.warn([format!("{}: {:.1} % {what}", path.display(), 100.0 * found.lost)]);
        }
        report.value("resample_lost", found.lost);
        Ok(found.field)
    }

    /// Whole numbers as a frame.
    fn levels(&self, path: &Path, held: &Stored, levels: &[u16], report: &mut Report) -> Result<Frame> {
        let Some(panel) = self.panel else {
            let what = "holds whole numbers, which are drive levels: name their panel by --panel";
            return Err(Error::input(path, what));
        };
        if (held.width, held.height) != (panel.width, panel.height) {
            let what = format!(
                "{}×{} drive levels (whole numbers); panel {} has {}×{} pixels",
                held.width, held.height, panel.name, panel.width, panel.height
            );
            return Err(Error::input(path, what));
        }
        let wavelength = self.wavelength.unwrap_or(panel.default_wavelength());
        let frame = Frame::new(panel, wavelength, levels.to_vec()).map_err(|e| Error::input(path, e.to_string()))?;
        let said = format!("{}; whole numbers: drive levels as they are", held.origin);
        report.add("read", &said, format!("{:<12} {said}", "read"));
        Ok(frame)
    }

    /// A frame that a picture holds; one of another pitch or wavelength is refused, or its depths become others.
    pub(super) fn frame(&self, path: &Path, report: &mut Report) -> Result<Frame> {
        let own = Frame::read(path, None, None).ok();
        if let (Some((own, _)), Some(panel)) = (&own, self.panel) {
            let made = &own.metadata.panel;
            if !is_near(made.pitch_x, panel.pitch_x) || !is_near(made.pitch_y, panel.pitch_y) {
                let [a, b] = [made, panel].map(|p| show_pitch([p.pitch_x, p.pitch_y]));
                let what = format!(
                    "was made for panel {} with a pitch of {a}; panel {} has {b}: its levels mean another field there",
                    made.name, panel.name
                );
                return Err(Error::input(path, what));
            }
        }
        let factor = match &own {
            Some((own, _)) => self.scaled(path, Some(own.metadata.wavelength))?.0,
            None => 1.0,
        };
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        if matches!(ending.as_str(), "jpg" | "jpeg") {
            report.warn([format!("{}: JPEG alters levels; save frames as PNG or BMP", path.display())]);
        }
        let (mut frame, warnings) = Frame::read(path, self.panel, self.wavelength).map_err(|e| hinted(path, e))?;
        report.warn(warnings);
        report.value("wavelength", frame.metadata.wavelength);
        if factor != 1.0 {
            let depth = &mut frame.metadata.origin.depth;
            self.say_depths(factor, *depth, report);
            *depth = depth.map(|depth| depth.map(|z| z * factor));
        }
        Ok(frame)
    }
}

/// The encoding where none is typed: phases are shown as they are.
pub(super) fn usual(modulation: Modulation, are_phases: bool) -> Encoding {
    match modulation {
        Modulation::Phase if are_phases => Encoding::Kinoform,
        _ => Encoding::usual(modulation),
    }
}

/// The refusal of a picture, with what is probably meant by one of 16 bits.
fn hinted(path: &Path, error: Error) -> Error {
    let open = || image_is_wide(path);
    match error {
        Error::Input { what, .. } if what.contains("level") && open() => {
            let hint = "of 16 bits, more than the panel's levels: if it is phases, save them in radians as a float .npy or .tif";
            Error::input(path, format!("{what}; the picture is {hint}"))
        }
        other => other,
    }
}

/// Whether a PNG has 16 bits a sample: the ninth byte of its head.
fn image_is_wide(path: &Path) -> bool {
    use std::io::Read;
    let mut head = [0; 25];
    let read = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut head));
    read.is_ok() && head.starts_with(b"\x89PNG") && head[24] == 16
}

fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-6 * b.abs()
}

/// What does not fit, with both numbers.
fn misfit(path: &Path, own: &Grid, panel: &PanelProfile, grid: &Grid) -> Error {
    let mut faults = Vec::new();
    if !is_same_pitch(own, grid) {
        faults.push(format!(
            "a pitch of {}, panel {} {}",
            show_pitch(own.pitch()),
            panel.name,
            show_pitch(grid.pitch())
        ));
    }
    if (own.width, own.height) != (grid.width, grid.height) {
        faults
            .push(format!("{}×{} samples, panel {} {}×{}", own.width, own.height, panel.name, grid.width, grid.height));
    }
    if faults.is_empty() {
        let [x, y] = own.center.map(show_length);
        faults.push(format!("its middle at {x}, {y}, the panel at 0m, 0m"));
    }
    let what =
        format!("has {}; --resample brings it onto the panel's pixels, --panel names another panel", faults.join("; "));
    Error::input(path, what)
}
