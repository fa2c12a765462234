//! What a profile's and a frame's numbers may be, wherever they come from: a profile, or the metadata in a picture.
//!
//! A number out of its domain is refused before memory is taken for what it counts.

use super::drive_curve::Modulation;
use super::frame::{FrameMetadata, Illumination};
use super::profile::{PanelKind, PanelProfile};
use crate::error::Error;
use crate::field::grid::{PITCHES, light};
use crate::units::WAVELENGTHS;

/// Longest side of a panel [px].
const LONGEST: usize = 1 << 16;

/// Pixels of a panel at most: four times those of the largest that are sold.
const MOST: usize = 1 << 28;

/// Most wavelengths, responses and corrections of one profile.
const ENTRIES: usize = 4096;

/// Longest settle time [s], and highest rate [Hz].
const LONGEST_TIME: f64 = 3600.0;
const HIGHEST_RATE: f64 = 1e9;

impl PanelProfile {
    /// Refuses fields that were set to what no panel has; whatever computes with a profile asks this. Whether levels fit into the video
    /// signal counts where they are packed for one.
    ///
    /// # Errors
    /// [`Error::Parameter`], which names the first.
    pub fn checked(&self) -> Result<(), Error> {
        self.check_light().map_err(|what| Error::parameter("panel", format!("{}: {what}", self.name)))
    }

    /// The first number outside its domain, in words.
    pub(super) fn check(&self) -> Result<(), String> {
        self.check_light()?;
        let signal = [self.signal.width, self.signal.height, self.signal.column_offset, self.signal.row_offset];
        if signal.iter().any(|&side| side > 4 * LONGEST) {
            return Err(format!("the signal's sides must be at most {} each", 4 * LONGEST));
        }
        self.signal.check(self.width, self.height, self.bits)
    }

    /// The same of what light does, without the video signal.
    fn check_light(&self) -> Result<(), String> {
        let (width, height, bits) = (self.width, self.height, self.bits);
        if !(1..=LONGEST).contains(&width) || !(1..=LONGEST).contains(&height) {
            return Err(format!("width × height = {width}×{height} must be 1 … {LONGEST} each"));
        }
        if width * height > MOST {
            return Err(format!("width × height = {width}×{height} must be at most {MOST} pixels in all"));
        }
        if !(1..=16).contains(&bits) {
            return Err(format!("bits = {bits} must be 1 … 16"));
        }
        if self.kind == PanelKind::BinaryDmd && bits != 1 {
            return Err(format!("bits = {bits} on a binary-dmd: its mirrors have two positions, write bits = 1"));
        }
        if self.fill_factor == 0.0 {
            return Err("fill_factor = 0 leaves nothing that modulates; it must be above 0 and at most 1".into());
        }
        let within = |name: &str, value: f64, range: std::ops::RangeInclusive<f64>, unit: &str| {
            if range.contains(&value) {
                return Ok(());
            }
            Err(format!("{name} = {value:e} must be {:e} … {:e} {unit}", range.start(), range.end())
                .trim_end()
                .to_owned())
        };
        within("fill_factor", self.fill_factor, 0.0..=1.0, "")?;
        within("dead_space", self.dead_space, 0.0..=1.0, "")?;
        within("unmodulated", self.unmodulated, 0.0..=1.0, "")?;
        if !(0.0..=8.0).contains(&self.crosstalk) {
            return Err(format!("crosstalk = {} must be 0 … 8 pixels", self.crosstalk));
        }
        within("pitch", self.pitch_x, PITCHES, "m; look at its unit")?;
        within("pitch", self.pitch_y, PITCHES, "m; look at its unit")?;
        within("settle_time", self.settle_time.unwrap_or(0.0), 0.0..=LONGEST_TIME, "s")?;
        within("refresh", self.refresh.unwrap_or(1.0), 1e-9..=HIGHEST_RATE, "Hz")?;
        if self.wavelengths.is_empty() || self.responses.is_empty() {
            return Err("it needs a wavelength and a response at least".into());
        }
        if [self.wavelengths.len(), self.responses.len(), self.corrections.len()].iter().any(|&n| n > ENTRIES) {
            return Err(format!("it has more than {ENTRIES} wavelengths, responses or corrections"));
        }
        let measured = self.responses.iter().map(|r| r.wavelength);
        let measured = measured.chain(self.corrections.iter().map(|c| c.wavelength)).flatten();
        for wavelength in self.wavelengths.iter().copied().chain(measured) {
            within("wavelength", wavelength, WAVELENGTHS, "m; look at its unit")?;
        }
        for response in &self.responses {
            if response.curve.modulation() != self.modulation() {
                return Err(match self.modulation() {
                    Modulation::Phase => "response is an amplitude curve, but the panel modulates phase",
                    Modulation::Amplitude => "response is a phase curve, but the panel modulates amplitude",
                }
                .into());
            }
            response.curve.check(self.levels(), &self.source).map_err(|e| e.to_string())?;
        }
        Ok(())
    }
}

impl FrameMetadata {
    /// The first number outside its domain, in words.
    pub(super) fn check(&self) -> Result<(), String> {
        self.panel.check()?;
        light(self.wavelength).map_err(|error| error.to_string())?;
        if self.levels_for_2pi.is_some_and(|levels| !(levels > 0.0 && levels.is_finite())) {
            return Err("levels_for_2pi must be greater than zero".into());
        }
        let Some(encoding) = &self.encoding else { return Ok(()) };
        let numbers: &[f64] = match &encoding.illumination {
            Illumination::Normal => &[],
            Illumination::Plane { frequency } => frequency,
            Illumination::Point { position } => position,
        };
        if !(encoding.scale > 0.0 && encoding.scale.is_finite()) || numbers.iter().any(|n| !n.is_finite()) {
            return Err("its encoding has a scale or an illumination that is no number".into());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absurd_numbers_of_profiles_and_metadata_are_refused() {
        let right = || PanelProfile::phase(40, 24, 8e-6, 8, 532e-9).expect("profile");
        assert_eq!(FrameMetadata::new(&right(), 532e-9).check(), Ok(()));
        type Spoil = fn(&mut PanelProfile);
        let wrong: [(&str, Spoil); 12] = [
            ("crosstalk", |p| p.crosstalk = 1e9),
            ("bits", |p| p.bits = 40),
            ("bits", |p| p.bits = 200),
            ("wavelength", |p| p.wavelengths[0] = 0.0),
            ("wavelength", |p| p.wavelengths[0] = f64::NAN),
            ("pitch", |p| p.pitch_x = 1e-300),
            ("pixels in all", |p| (p.width, p.height) = (65536, 65536)),
            ("width", |p| p.width = 0),
            ("settle_time", |p| p.settle_time = Some(1e30)),
            ("refresh", |p| p.refresh = Some(f64::INFINITY)),
            ("signal", |p| p.signal.width = 1 << 60),
            ("response", |p| p.responses.clear()),
        ];
        for (word, spoil) in wrong {
            let mut profile = right();
            spoil(&mut profile);
            let what = FrameMetadata::new(&right(), 532e-9);
            let what = FrameMetadata { panel: profile, ..what }.check().expect_err(word);
            assert!(what.contains(word), "{word}: {what}");
        }
        for wavelength in [0.0, -532e-9, f64::INFINITY, 1e300] {
            let metadata = FrameMetadata { wavelength, ..FrameMetadata::new(&right(), 532e-9) };
            assert!(metadata.check().expect_err("wavelength").contains("wavelength"));
        }
    }

    #[test]
    fn fields_that_were_set_afterwards_are_refused_where_a_panel_is_used() {
        use crate::field::{Complex32, Field};
        use crate::panel::simulated::{Simulation, simulate};
        use crate::panel::{Frame, Pattern, PhasePattern, Setup, drive};
        use crate::progress::Progress;
        let right = || PanelProfile::phase(40, 24, 8e-6, 8, 532e-9).expect("profile");
        let frame = Frame::new(&right(), 532e-9, vec![7; 40 * 24]).expect("frame");
        let light = |frame: &Frame| simulate(frame, &Simulation::default(), &Progress::new());
        let pattern = || {
            let grid = right().grid().expect("grid");
            Pattern::Phase(PhasePattern::new(grid, 532e-9, vec![0.0; 40 * 24]).expect("pattern"))
        };
        type Spoil = fn(&mut PanelProfile);
        let wrong: [(&str, Spoil); 5] = [
            ("fill_factor", |p| p.fill_factor = f64::NAN),
            ("fill_factor", |p| p.fill_factor = 93.0),
            ("a wavelength and a response", |p| p.wavelengths.clear()),
            ("bits", |p| p.bits = 40),
            ("dead_space", |p| p.dead_space = -1.0),
        ];
        for (word, spoil) in wrong {
            let mut profile = right();
            spoil(&mut profile);
            let mut shown = frame.clone();
            shown.metadata.panel = profile.clone();
            let said = [
                Setup::new(profile.clone(), None).map(drop),
                drive(&pattern(), None, &profile).map(drop),
                light(&shown).map(drop),
            ];
            for said in said {
                let said = said.expect_err(word).to_string();
                assert!(said.contains(word) && !said.contains('\n'), "{word}: {said}");
            }
        }
        // Levels that do not fit, wavelengths in nanometres, samples and colours of another number.
        let path = std::env::temp_dir().join("holodrive-never-written.png");
        let mut high = frame.clone();
        high.levels[3] = 999;
        assert!(high.write(&path).expect_err("999").to_string().contains("level 999 at column 3") && !path.exists());
        high.levels.truncate(5);
        assert!(high.write(&path).expect_err("5").to_string().contains("5 levels for 40×24"));
        assert!(
            Frame::new(&right(), 532.0, vec![7; 40 * 24]).expect_err("nm").to_string().contains("look at its unit")
        );
        let short =
            Field { samples: vec![Complex32::default(); 9], ..Field::zeros(right().grid().expect("grid"), 532e-9) };
        let setup = Setup::new(right(), None).expect("setup");
        let refused = crate::propagation::propagate(&short, 0.1, &Progress::new()).expect_err("9 samples").to_string();
        assert!(refused.contains("9 samples for a grid of 40×24"), "{refused}");
        assert!(crate::field::grid::light(setup.wavelength * 1e9).is_err());
    }
}
