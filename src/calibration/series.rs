//! Frames to show one after another, and the manifest that says what each is.

use crate::error::Result;
use crate::files;
use crate::panel::Frame;
use crate::progress::Progress;
use std::fmt::Write as _;
use std::path::Path;

/// A frame with its file's name and its cells in the manifest.
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) cells: String,
    pub(super) frame: Frame,
}

/// Frames made one at a time: a long sweep takes the memory of one.
pub struct FrameSeries<'a> {
    /// Columns of the manifest after `file`.
    columns: &'static str,
    count: usize,
    make: Box<dyn Fn(usize) -> Result<Entry> + Send + Sync + 'a>,
}

impl<'a> FrameSeries<'a> {
    pub(super) fn new(
        columns: &'static str,
        count: usize,
        make: impl Fn(usize) -> Result<Entry> + Send + Sync + 'a,
    ) -> Self {
        Self { columns, count, make: Box::new(make) }
    }

    /// Number of frames.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The frames.
    pub fn frames(&self) -> impl Iterator<Item = Result<Frame>> + Send {
        (0..self.count).map(|index| (self.make)(index).map(|entry| entry.frame))
    }

    /// Writes the frames as PNG files and `manifest.csv` into a folder. A folder that this made goes again on failure.
    ///
    /// # Errors
    /// As the frames'; [`crate::Error::Io`], [`crate::Error::Interrupted`].
    pub fn write(&self, folder: &Path, progress: &Progress) -> Result<()> {
        // The first is made before the folder: what is wrong with the settings is found out without leaving one.
        (self.make)(0)?;
        let new = !folder.exists();
        files::output_folder(folder)?;
        let written = self.write_into(folder, progress);
        if written.is_err() && new {
            // An interrupted sweep is worth nothing.
            let _ = std::fs::remove_dir_all(folder);
        }
        written
    }

    fn write_into(&self, folder: &Path, progress: &Progress) -> Result<()> {
        let mut manifest = format!("file,{}\n", self.columns);
        progress.start("frames", self.count as u64);
        for index in 0..self.count {
            progress.check()?;
            let Entry { name, cells, frame } = (self.make)(index)?;
            frame.write(&folder.join(&name))?;
            let _ = writeln!(manifest, "{name},{cells}");
            progress.advance(1);
        }
        files::write_bytes(&folder.join("manifest.csv"), manifest.as_bytes())
    }
}
