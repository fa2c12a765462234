//! A mask's file, which counts its bytes.

use crate::error::{Error, Result};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// A file that counts its bytes.
pub(super) struct Bytes<'a> {
    file: &'a mut BufWriter<File>,
    path: &'a Path,
    length: u64,
}

impl<'a> Bytes<'a> {
    pub(super) fn new(file: &'a mut BufWriter<File>, path: &'a Path) -> Self {
        Self { file, path, length: 0 }
    }
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.length += bytes.len() as u64;
        self.file.write_all(bytes).map_err(Error::io(self.path))
    }
    /// Bytes written.
    pub(super) fn length(&self) -> u64 {
        self.length
    }
}
