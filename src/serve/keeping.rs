//! Keeping a panel for clients: their frames through correction and level curve onto the output, their answers back.

use super::output::{Output, Readiness};
use super::playing::play;
use super::preloaded::Preloaded;
use super::task::{Done, Task};
use super::{Flip, FrameRequest, SentFrame, ServeCounts, ServedPanel, Server, ShownAt};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::names::{Name, Named};
use crate::panel::{
    Applied, Frame, FrameMetadata, FringePattern, Modulation, NearestTable, PanelProfile, Pattern, PhasePattern,
    Wavefront, drive,
};
use crate::progress::Progress;
use crate::units::show_length;
use serde::Serialize;
use std::time::{Duration, Instant};

/// Wait for a client's frame between two looks at the output. A frame that comes is shown at once.
const TURN: Duration = Duration::from_millis(5);

/// What stays on the panel when the client whose frame it is has gone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnClientGone {
    /// Its last frame.
    #[default]
    Keep,
    /// The idle frame. slmsuite's clients connect anew for each frame: of them it cannot be known, and theirs stays.
    Idle,
}

impl Named for OnClientGone {
    const KIND: &'static str = "on client gone";
    const NAMES: &'static [Name<Self>] =
        &[("keep", || Self::Keep, "its last frame"), ("idle", || Self::Idle, "the idle frame")];
}

/// How the panel is kept.
#[derive(Clone, Copy, Debug)]
pub struct KeepSettings<'a> {
    /// The idle frame, with which the output begins.
    pub idle: &'a Frame,
    /// What stays when a client goes.
    pub on_client_gone: OnClientGone,
    /// Memory for frames that are kept ready [bytes].
    pub memory: u64,
}

impl KeepSettings<'_> {
    /// Memory for frames that are kept ready, where nothing else is said [bytes]: 259 of 1920 × 1080 pixels.
    pub const MEMORY: u64 = 2 << 30;
}

/// Times of the frames that were shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Latency {
    /// From a frame's arrival to its flip, the mean [s].
    pub mean: f64,
    /// The longest [s].
    pub longest: f64,
}

/// What was served.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct KeepReport {
    /// Frames shown for clients.
    pub shown: u64,
    /// Frames that could not be shown: they ask for what the panel cannot do, or the monitor was away.
    pub failed: u64,
    /// How often the idle frame came back because a client had gone.
    pub idled: u64,
    /// Refreshes by which frames came late, in all.
    pub missed: u64,
    /// From arrival to flip, over all frames that were shown.
    pub latency: Latency,
    /// What came in at the server.
    pub counts: ServeCounts,
    /// Whether the user ended it at the panel (a key in its window), and not from outside.
    pub closed: bool,
}

/// Makes frames of what clients send: for one panel in one light.
pub struct Driver {
    profile: PanelProfile,
    wavelength: f64,
    correction: Option<Wavefront>,
    grid: Grid,
    /// Where all pixels have one phase curve.
    table: Option<NearestTable>,
}

impl Driver {
    /// For `profile` at a wavelength [m], with its wavefront correction if there is one.
    ///
    /// # Errors
    /// [`crate::Error::Calibration`] when curve or correction do not hold at this wavelength.
    pub fn new(profile: &PanelProfile, wavelength: f64, correction: Option<Wavefront>) -> Result<Self> {
        let curve = profile.pixel_curve(wavelength)?.0;
        let table = if curve.differs() { None } else { NearestTable::new(&curve.mean) };
        if let Some(correction) = &correction {
            correction.check(profile.width, profile.height, wavelength)?;
        }
        Ok(Self { grid: profile.grid()?, profile: profile.clone(), wavelength, correction, table })
    }

    /// What clients are told of the panel, under `name`.
    ///
    /// # Errors
    /// [`Error::Parameter`] when it cannot be a part of a file's name.
    pub fn served(&self, name: &str) -> Result<ServedPanel> {
        let fits = |c: char| !c.is_control() && !matches!(c, '/' | '\\' | '\'' | '"');
        if name.is_empty() || name.len() > 64 || name.starts_with('.') || !name.chars().all(fits) {
            return Err(Error::parameter("name", format!("`{name}` is no name of up to 64 letters, digits and marks")));
        }
        let profile = &self.profile;
        // The wavelength at which all levels are one turn: a turn takes fewer of them at a shorter one.
        let curve = profile.drive_curve(self.wavelength)?.0;
        let levels_for_2pi = curve.levels_for_2pi();
        let part = levels_for_2pi.map_or(1.0, |levels| levels / profile.levels() as f64);
        Ok(ServedPanel {
            name: name.to_owned(),
            width: profile.width as u32,
            height: profile.height as u32,
            bits: profile.bits,
            modulation: profile.modulation(),
            pixel_pitch: [profile.pitch_x, profile.pitch_y],
            wavelength: self.wavelength,
            design_wavelength: self.wavelength / part,
            settle_time: profile.settle_time.unwrap_or(0.0),
            curve: curve.values().to_vec(),
        })
    }

    /// A frame whose levels are all the same.
    pub fn flat(&self, level: u16) -> Result<Frame> {
        Frame::new(&self.profile, self.wavelength, vec![level; self.grid.len()])
    }

    /// Levels as they are; phases and amplitudes through correction and level curve.
    ///
    /// # Errors
    /// As [`Frame::new`] and [`drive`].
    pub fn frame(&self, sent: SentFrame) -> Result<Frame> {
        match (sent, self.profile.modulation()) {
            (SentFrame::Levels(levels), _) => {
                let mut frame = Frame::new(&self.profile, self.wavelength, levels)?;
                // Whatever the client did, it is done.
                frame.metadata.applied = Applied { curve: Some("by the client".into()), ..Applied::default() };
                Ok(frame)
            }
            (SentFrame::Values(phase), Modulation::Phase) => {
                if let Some(table) = &self.table {
                    return self.by_table(table, &phase);
                }
                let pattern = Pattern::Phase(PhasePattern::new(self.grid, self.wavelength, phase)?);
                Ok(drive(&pattern, self.correction.as_ref(), &self.profile)?.frame)
            }
            (SentFrame::Values(transmittance), Modulation::Amplitude) => {
                let pattern = Pattern::Fringe(FringePattern::new(self.grid, self.wavelength, transmittance)?);
                Ok(drive(&pattern, None, &self.profile)?.frame)
            }
        }
    }

    /// What [`drive`] makes of a phase, without its figures: fast enough for a panel's rate.
    fn by_table(&self, table: &NearestTable, phase: &[f32]) -> Result<Frame> {
        let Grid { width, height, .. } = self.grid;
        if phase.len() != self.grid.len() {
            let what = format!("{} values for the {width}×{height} pixels of {}", phase.len(), self.profile.name);
            return Err(Error::parameter("pattern", what));
        }
        let error = self.correction.as_ref().map(|correction| correction.phase.as_slice());
        let levels = table.levels(phase, error).map_err(|i| {
            let what = format!("the value at column {}, row {} is not finite", i % width, i / width);
            Error::parameter("pattern", what)
        })?;
        let mut metadata = FrameMetadata::new(&self.profile, self.wavelength);
        metadata.applied = Applied {
            correction: self.correction.as_ref().map(|correction| correction.name.clone()),
            curve: Some(format!("{} at {}", self.profile.name, show_length(self.wavelength))),
            packing: None,
        };
        Ok(Frame { width, height, bits: self.profile.bits, levels, metadata })
    }
}

/// Keeps a panel and shows on it what the clients of `server` send, until the user ends it at the panel, or `progress`
/// does.
///
/// `output` shows [`KeepSettings::idle`] already. A client's last frame stays until another comes, or as `settings` say. While the monitor
/// is away clients are told so, and nothing is shown.
///
/// # Errors
///
/// Those of [`Output::attend`].
pub fn keep(
    server: &Server,
    output: &mut dyn Output,
    driver: &Driver,
    settings: KeepSettings<'_>,
    progress: &Progress,
) -> Result<KeepReport> {
    let mut keeper = Keeper {
        driver,
        ready: Preloaded::new(driver.grid.len(), settings.memory),
        waited: Duration::ZERO,
        report: KeepReport::default(),
    };
    // The client whose frame is on the panel.
    let mut owner = None;
    while !progress.stopped() {
        let readiness = output.attend()?;
        if readiness == Readiness::Ended {
            keeper.report.closed = true;
            break;
        }
        if settings.on_client_gone == OnClientGone::Idle && owner.is_some_and(|client| !server.is_connected(client)) {
            owner = None;
            keeper.report.idled += 1;
            // Where it is refused the monitor is away; the output keeps it for its return.
            let _ = output.show(settings.idle);
        }
        let Some(mut request) = server.next(TURN) else { continue };
        let done = match readiness {
            Readiness::Absent { why } => Err(why),
            Readiness::Ready | Readiness::Ended => keeper.serve(&mut request, output, progress),
        };
        match done {
            Ok(done) => {
                if done.last().is_some() {
                    owner = request.client();
                }
                request.done(done);
            }
            Err(why) => {
                keeper.report.failed += 1;
                request.refused(&why);
            }
        }
    }
    let mut report = keeper.report;
    report.latency.mean = keeper.waited.as_secs_f64() / report.shown.max(1) as f64;
    report.counts = server.counts();
    Ok(report)
}

/// What is kept beside the panel.
struct Keeper<'a> {
    driver: &'a Driver,
    ready: Preloaded,
    waited: Duration,
    report: KeepReport,
}

impl Keeper<'_> {
    /// Does what a client asks; the error is an answer to it.
    fn serve(
        &mut self,
        request: &mut FrameRequest,
        output: &mut dyn Output,
        progress: &Progress,
    ) -> Result<Done, String> {
        let told = |error: Error| error.to_string();
        let (arrived, task) = (request.arrived(), request.task().clone());
        let shown = match task {
            Task::Show => {
                let frame = self.driver.frame(request.take_frame()).map_err(told)?;
                output.show(&frame).map_err(told)?
            }
            Task::Recall(name) => self.ready.recall(&name, output)?,
            Task::Next => self.ready.next(output)?,
            Task::Play { names, rate } => {
                let numbers = self.ready.numbers(&names)?;
                let flips = play(&numbers, rate, request, output, progress)?;
                self.report.shown += flips.len() as u64;
                self.report.missed += flips.iter().map(|flip| flip.missed).sum::<u64>();
                return Ok(Done::Played(flips));
            }
            Task::Preload(name) => {
                let frame = self.driver.frame(request.take_frame()).map_err(told)?;
                self.ready.keep(name, &frame, output)?;
                return Ok(Done::Kept(self.ready.len()));
            }
            Task::Arm(names) => {
                self.ready.arm(names)?;
                return Ok(Done::Kept(self.ready.len()));
            }
            Task::Forget(names) => {
                self.ready.forget(&names, output)?;
                return Ok(Done::Kept(self.ready.len()));
            }
        };
        Ok(Done::Shown(self.flip(shown, arrived, output)))
    }

    /// Counts a frame that arrived then.
    fn flip(&mut self, shown: ShownAt, arrived: Instant, output: &dyn Output) -> Flip {
        let late = shown.at.saturating_duration_since(arrived);
        // Every frame waits for the next refresh; those that pass meanwhile are missed.
        let missed = output.refresh().map_or(0, |refresh| (late.as_secs_f64() / refresh) as u64);
        self.waited += late;
        self.report.shown += 1;
        self.report.missed += missed;
        self.report.latency.longest = self.report.latency.longest.max(late.as_secs_f64());
        Flip { at: shown.at, number: shown.number, missed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn phases_become_the_levels_that_drive_finds() {
        let text = "name = \"t\"\nmaker = \"t\"\nkind = \"phase-lcos\"\nwidth = 61\nheight = 37\npitch = \"8um\"\nbits = 8\n\
                    fill_factor = 1.0\nwavelengths = [\"532nm\"]\n[[response]]\nkind = \"polynomial\"\nunit = \"rad\"\n\
                    coefficients = [0.1, 5.0, 0.9]\n";
        let profile = PanelProfile::parse(text, Path::new("t.toml")).expect("profile");
        let phase: Vec<f32> = (0..61 * 37).map(|i| 0.37 * i as f32 - 300.0).collect();
        let error = (0..61 * 37).map(|i| (i % 61) as f32 * 0.21).collect();
        let error = Wavefront::new("flatness", 61, 37, Some(532e-9), error).expect("wavefront");
        for correction in [None, Some(error)] {
            let driver = Driver::new(&profile, 532e-9, correction.clone()).expect("driver");
            let frame = driver.frame(SentFrame::Values(phase.clone())).expect("frame");
            let pattern = PhasePattern::new(profile.grid().expect("grid"), 532e-9, phase.clone()).expect("pattern");
            let driven = drive(&Pattern::Phase(pattern), correction.as_ref(), &profile).expect("driven").frame;
            assert_eq!(frame.levels, driven.levels);
            assert_eq!(frame.metadata.applied, driven.metadata.applied);
            // 5.9 of 6.28 rad over the levels: all of them are less than a turn.
            let served = driver.served("t").expect("name");
            let part = served.wavelength / served.design_wavelength;
            assert!(driver.served("../t").is_err() && driver.served("").is_err());
            assert!(part > 1.0 && part < 1.2, "{part}");
            let wrong = driver.frame(SentFrame::Values(vec![f32::NAN; 61 * 37])).expect_err("not finite").to_string();
            assert!(wrong.contains("column 0, row 0"), "{wrong}");
            assert!(driver.frame(SentFrame::Values(vec![0.0; 5])).is_err());
            assert!(driver.frame(SentFrame::Levels(vec![256; 61 * 37])).is_err());
        }
    }
}
