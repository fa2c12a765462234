//! What shows the frames that are served: a real panel's window, or the simulated panel.

use crate::error::{Error, Result};
use crate::files;
use crate::panel::Frame;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Whether frames can be shown now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Readiness {
    /// They can.
    Ready,
    /// The monitor is away; clients are told so until it is back.
    Absent {
        /// What happened.
        why: String,
    },
    /// The user has ended it.
    Ended,
}

/// A frame that was handed over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShownAt {
    /// When.
    pub at: Instant,
    /// Running number of the frame on this output; the idle frame is 0.
    pub number: u64,
}

/// What shows frames. It begins with the idle frame.
pub trait Output {
    /// Deals with what has happened since the last call; called at least every few milliseconds.
    ///
    /// # Errors
    /// When nothing can be shown any more.
    fn attend(&mut self) -> Result<Readiness>;

    /// Shows a frame from now on; returns when it was handed over.
    ///
    /// # Errors
    /// When this frame cannot be shown; the one before stays.
    fn show(&mut self, frame: &Frame) -> Result<ShownAt>;

    /// Makes a frame ready under a number, in place of one that has it: [`Output::recall`] then shows it without delay.
    ///
    /// # Errors
    /// When this frame could not be shown.
    fn preload(&mut self, number: u64, frame: &Frame) -> Result<()>;

    /// Shows the frame that was made ready under a number; returns when it was handed over.
    ///
    /// # Errors
    /// As [`Output::show`]; [`crate::Error::Parameter`] for a number that no frame has.
    fn recall(&mut self, number: u64) -> Result<ShownAt>;

    /// Keeps the frame of a number no longer.
    fn forget(&mut self, number: u64);

    /// Time from one refresh to the next [s], where there are any.
    fn refresh(&self) -> Option<f64>;
}

/// What [`Output::recall`] says of a number that no frame has.
pub fn not_ready(number: u64) -> Error {
    Error::parameter("frame", format!("none was made ready under the number {number}"))
}

/// The simulated panel: takes frames at once, and keeps them as files from which `reconstruct` shows what would be seen.
pub struct SimulatedOutput {
    folder: Option<PathBuf>,
    number: u64,
    ready: HashMap<u64, Frame>,
}

impl SimulatedOutput {
    /// One that writes each frame into `folder`, `frame-000000.png` being the idle one; without a folder, nothing is kept.
    ///
    /// # Errors
    /// [`crate::Error::Io`] when the folder cannot be written.
    pub fn new(folder: Option<&Path>, idle: &Frame) -> Result<Self> {
        if let Some(folder) = folder {
            files::output_folder(folder)?;
        }
        let output = Self { folder: folder.map(Path::to_path_buf), number: 0, ready: HashMap::new() };
        output.keep(idle)?;
        Ok(output)
    }

    fn keep(&self, frame: &Frame) -> Result<()> {
        match &self.folder {
            Some(folder) => frame.write(&folder.join(format!("frame-{:06}.png", self.number))),
            None => Ok(()),
        }
    }
}

impl Output for SimulatedOutput {
    fn attend(&mut self) -> Result<Readiness> {
        Ok(Readiness::Ready)
    }

    fn show(&mut self, frame: &Frame) -> Result<ShownAt> {
        self.number += 1;
        self.keep(frame)?;
        Ok(ShownAt { at: Instant::now(), number: self.number })
    }

    fn preload(&mut self, number: u64, frame: &Frame) -> Result<()> {
        self.ready.insert(number, frame.clone());
        Ok(())
    }

    fn recall(&mut self, number: u64) -> Result<ShownAt> {
        let frame = self.ready.remove(&number).ok_or_else(|| not_ready(number))?;
        let shown = self.show(&frame);
        self.ready.insert(number, frame);
        shown
    }

    fn forget(&mut self, number: u64) {
        self.ready.remove(&number);
    }

    fn refresh(&self) -> Option<f64> {
        None
    }
}
