//! Points → fields and frames, exposure by exposure: each is written and told as it is made.

use super::light::report_gamut;
use super::load::Points;
use super::report::{Report, step};
use crate::encode::EncodeReport;
use crate::field::Field;
use crate::field::npy::Content;
use crate::field::stored;
use crate::hologram::Computed;
use crate::names::Named;
use crate::panel::{Frame, Origin, Setup};
use crate::pipeline::{self, Settings};
use crate::points::colour::NAMES;
use crate::points::{Exposure, Multiplexing, Reach, Share, SubFrames};
use crate::progress::Progress;
use crate::reconstruction::colour::laser_powers;
use crate::units::show_length;
use crate::{Error, Result};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What holograms are made with.
pub(super) struct Maker<'a> {
    pub(super) input: &'a Path,
    pub(super) setup: &'a Setup,
    pub(super) settings: &'a Settings,
    pub(super) progress: &'a Progress,
}

/// `field.npy` → `field-red.npy`, where there are several exposures.
pub(super) fn named(path: &Path, suffix: &str) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
    path.with_file_name(format!("{stem}{suffix}{extension}"))
}

/// Adds what one exposure took: as a part of its own where there are several.
pub(super) fn add_exposure(exposure: &Exposure, part: Report, report: &mut Report) {
    match exposure.share {
        Share::Whole(_) => report.merge(part),
        Share::Laser { index, .. } => {
            let heading = format!("{:<12} {}", NAMES[index], show_length(exposure.wavelength));
            report.add_part(NAMES[index], heading, part);
        }
        Share::SubFrame { index, .. } => report.add_part(&format!("subframe_{index}"), exposure.label(), part),
    }
}

impl Maker<'_> {
    /// The exposures of these points, and what the lasers' gamut does to their colours.
    pub(super) fn exposures(&self, points: &Points, report: &mut Report) -> Result<Vec<Exposure>> {
        let too_many = |f: &SubFrames| f.multiplexing == Multiplexing::Sparse && points.cloud.points.len() < f.count;
        if let Some(frames) = self.settings.sub_frames.filter(too_many) {
            let what = format!("for {} points: one a frame at least", points.cloud.points.len());
            return Err(Error::out_of_range("subframes", frames.count, what));
        }
        let exposures = pipeline::exposures(self.setup, self.settings, points.path_eye);
        if let (Some(lasers), Some(gamut)) = (&self.setup.lasers, Exposure::gamut(&exposures, &points.cloud)) {
            report_gamut(lasers, &gamut, report);
        }
        Ok(exposures)
    }

    /// `compute`: a field file for each exposure that has light.
    pub(super) fn fields(&self, points: &Points, output: &Path, report: &mut Report) -> Result<()> {
        for exposure in self.exposures(points, report)? {
            let mut part = Report::new("compute");
            if let Some(computed) = self.field(points, &exposure, &mut part)? {
                let path = named(output, &exposure.suffix());
                self.write_field(points, &exposure, &computed, &path)?;
                part.output("field", &path);
            } else {
                part.add("dark", true, "dark         no light for this laser, no field");
            }
            add_exposure(&exposure, part, report);
        }
        Ok(())
    }

    /// `show`: field and frame of each exposure, in files beside each other; none for a laser without light.
    pub(super) fn frames(&self, points: &Points, output: &Path, report: &mut Report) -> Result<Vec<Option<Frame>>> {
        let exposures = self.exposures(points, report)?;
        let mut frames = Vec::new();
        for exposure in &exposures {
            let mut part = Report::new("show");
            let computed = self.field(points, exposure, &mut part)?;
            if let Some(computed) = &computed
                && !matches!(exposure.share, Share::SubFrame { .. })
            {
                let path = output.join(format!("field{}.npy", exposure.suffix()));
                self.write_field(points, exposure, computed, &path)?;
            }
            let notes = Some(exposure.label()).filter(|label| !label.is_empty());
            let frame = match computed {
                Some(computed) => Some(self.frame(&computed.field, &points.content(), notes, &mut part)?),
                None => {
                    part.add("dark", true, "dark         no light for this laser: leave it off");
                    None
                }
            };
            add_exposure(exposure, part, report);
            frames.push(frame);
        }
        self.note_powers(&mut frames, report);
        for (exposure, frame) in exposures.iter().zip(&frames) {
            if let Some(frame) = frame {
                frame.write(&output.join(format!("frame{}.png", exposure.suffix())))?;
            }
        }
        Ok(frames)
    }

    fn field(&self, points: &Points, exposure: &Exposure, report: &mut Report) -> Result<Option<Computed>> {
        let settings = &self.settings.hologram;
        let computed = pipeline::field(&points.cloud, exposure, self.setup, settings, self.progress)?;
        self.progress.check()?;
        if !matches!(exposure.share, Share::Whole(_)) {
            report.value("wavelength", exposure.wavelength);
        }
        if let Some(computed) = &computed {
            if computed.field.energy() == 0.0 {
                let reach = Reach::of(&points.cloud, &self.setup.grid, exposure.wavelength);
                let what = format!("its field on the panel is dark everywhere: {reach}");
                return Err(Error::input(self.input, what));
            }
            report_field(computed, report);
        }
        Ok(computed)
    }

    fn write_field(&self, points: &Points, exposure: &Exposure, computed: &Computed, path: &Path) -> Result<()> {
        let mut origin = format!("{} points of {}", points.cloud.points.len(), self.input.display());
        if let Some(lasers) = &self.setup.lasers {
            origin += &format!("; {}, {}", exposure.label(), lasers.wavelengths().map(show_length).join(", "));
        }
        stored::write_field(path, &computed.field, &points.content(), &origin)
    }

    /// A field as a frame, with its time.
    pub(super) fn frame(
        &self,
        field: &Field,
        content: &Content,
        notes: Option<String>,
        report: &mut Report,
    ) -> Result<Frame> {
        // A field of another program may stand on the panel all the same, where it was carried there from a plane that nobody named.
        report
            .warn(content.on_panel().err().map(|elsewhere| format!("{elsewhere}; it is encoded as if it stood on it")));
        let begin = Instant::now();
        if let Some(crate::encode::Encoding::Planes(planes)) = &self.settings.encode.encoding {
            planes.depths.iter().for_each(|z| report.check_side("depths", *z, content.depth));
        }
        let source = Some(self.input.display().to_string());
        let notes = notes.into_iter().collect();
        let origin = Origin { source, depth: content.depth, notes, ..Origin::default() };
        let encoded = pipeline::frame(field, self.setup, &self.settings.encode, origin, self.progress)?;
        let did = &encoded.report;
        if let Some(name) = &encoded.frame.metadata.applied.correction {
            report.add("correction", name, format!("correction   {name}"));
        }
        report_encoding(did, report);
        let elapsed = begin.elapsed().as_secs_f64();
        let what = format!(
            "{}: efficiency {:.2} %, field error {:.3} in its band, {:.1} % of the light outside the band dropped",
            did.method,
            100.0 * did.efficiency,
            did.field_error,
            100.0 * did.dropped
        );
        report.add("encode_seconds", elapsed, step("encode", elapsed, what));
        Ok(encoded.frame)
    }

    /// The powers of three lasers that make the colours right stand in their frames.
    pub(super) fn note_powers(&self, frames: &mut [Option<Frame>], report: &mut Report) {
        let Some(lasers) = &self.setup.lasers else { return };
        // Without light a laser's power is nil: 1/∞².
        let scale = |frame: &Option<Frame>| match frame {
            Some(frame) => frame.metadata.encoding.as_ref().map_or(1.0, |e| e.scale),
            None => f64::INFINITY,
        };
        let [red, green, blue] = frames else { return };
        let powers = laser_powers(lasers, [scale(red), scale(green), scale(blue)]);
        let line = powers.map(|p| format!("{p:.3}")).join(" : ");
        let line = format!("lasers                 powers on the panel of {line} make the colours right");
        report.add("laser_powers", powers, line);
        for (frame, power) in frames.iter_mut().zip(powers) {
            if let Some(frame) = frame {
                frame.metadata.origin.notes.push(format!("relative laser power {power:.4}"));
            }
        }
    }
}

fn report_field(computed: &Computed, report: &mut Report) {
    let did = &computed.report;
    report.section(serde_json::json!({
        "method": did.method.name(),
        "method_reason": did.reason,
        "error_bound": did.error_bound,
        "error_measured": did.measured.error,
        "error_limit": did.measured.limit,
        "error_pixels": did.measured.pixels,
        "error_seconds": did.measured.seconds,
        "field_seconds": did.seconds,
        "predicted_seconds": did.predicted_seconds,
        "instruction_set": did.instruction_set.name(),
        "memory": did.memory,
        "pairs": did.coverage.pairs,
    }));
    let (method, set) = (did.method.name(), did.instruction_set.name());
    let measured = &did.measured;
    let what = format!(
        "{method} ({set}): {}; error below {:.1e} of the field, measured {:.1e} at {} pixels",
        did.reason, did.error_bound, measured.error, measured.pixels
    );
    report.warn(did.warnings.iter());
    report.line(step("field", did.seconds, what));
}

pub(super) fn report_encoding(did: &EncodeReport, report: &mut Report) {
    report.warn(did.warnings.iter());
    report.section(serde_json::json!({
        "encoding": did.method,
        "efficiency": did.efficiency,
        "encoding_field_error": did.field_error,
        "clipped": did.clipped,
        "dropped": did.dropped,
        "quantisation_error": did.quantisation_error,
        "unreachable": did.unreachable,
    }));
}
