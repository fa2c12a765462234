//! Frames that are kept ready under names, and the list that triggers go through.

use super::output::{Output, ShownAt};
use crate::panel::Frame;
use std::collections::HashMap;

/// Bytes that a kept frame takes for each pixel, as levels or packed for a monitor.
const BYTES: u64 = 4;

/// The names of the frames that an [`Output`] keeps by number.
#[derive(Debug)]
pub(super) struct Preloaded {
    numbers: HashMap<String, u64>,
    next: u64,
    armed: Vec<String>,
    at: usize,
    /// Most frames that are kept.
    most: usize,
}

impl Preloaded {
    /// None yet; as many frames of so many pixels as fit into `memory` [bytes].
    pub(super) fn new(pixels: usize, memory: u64) -> Self {
        let most = usize::try_from(memory / (BYTES * pixels.max(1) as u64)).unwrap_or(usize::MAX);
        Self { numbers: HashMap::new(), next: 0, armed: Vec::new(), at: 0, most }
    }

    /// How many are kept.
    pub(super) fn len(&self) -> usize {
        self.numbers.len()
    }

    /// Makes a frame ready under a name.
    pub(super) fn keep(&mut self, name: String, frame: &Frame, output: &mut dyn Output) -> Result<(), String> {
        let number = match self.numbers.get(&name) {
            Some(number) => *number,
            None if self.numbers.len() >= self.most => {
                return Err(format!(
                    "{} frames are kept, and no more fit into the memory for them: forget some, or serve with --preload SIZE.",
                    self.numbers.len()
                ));
            }
            None => self.next,
        };
        output.preload(number, frame).map_err(|error| error.to_string())?;
        self.next = self.next.max(number + 1);
        self.numbers.insert(name, number);
        Ok(())
    }

    /// The output's numbers of these names.
    pub(super) fn numbers(&self, names: &[String]) -> Result<Vec<u64>, String> {
        names.iter().map(|name| self.number(name)).collect()
    }

    fn number(&self, name: &str) -> Result<u64, String> {
        self.numbers.get(name).copied().ok_or_else(|| format!("No frame is kept under the name {name:?}; preload it."))
    }

    /// Shows the frame of a name.
    pub(super) fn recall(&self, name: &str, output: &mut dyn Output) -> Result<ShownAt, String> {
        output.recall(self.number(name)?).map_err(|error| error.to_string())
    }

    /// Sets the list that triggers go through.
    pub(super) fn arm(&mut self, names: Vec<String>) -> Result<(), String> {
        self.numbers(&names)?;
        (self.armed, self.at) = (names, 0);
        Ok(())
    }

    /// Shows the next frame of that list.
    pub(super) fn next(&mut self, output: &mut dyn Output) -> Result<ShownAt, String> {
        let name = self.armed.get(self.at).ok_or("No list of frames is armed.")?;
        let shown = self.recall(name, output)?;
        self.at = (self.at + 1) % self.armed.len();
        Ok(shown)
    }

    /// Keeps these no longer; all, where none is named. A list that names one of them is armed no longer.
    pub(super) fn forget(&mut self, names: &[String], output: &mut dyn Output) -> Result<(), String> {
        self.numbers(names)?;
        let mut gone = |name: &String| names.is_empty() || names.contains(name);
        if self.armed.iter().any(&mut gone) {
            (self.armed, self.at) = (Vec::new(), 0);
        }
        self.numbers.retain(|name, number| {
            let gone = gone(name);
            if gone {
                output.forget(*number);
            }
            !gone
        });
        Ok(())
    }
}
