//! A file that says where the eye is, as whatever tracks it writes it.

use super::args::position;
use crate::{Error, Result};
use glam::DVec3;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Time between two looks at the file.
const PERIOD: Duration = Duration::from_millis(10);
/// Longest content [bytes].
const LONGEST: u64 = 256;

/// Looks at the file again and again.
pub(super) struct Tracker {
    path: PathBuf,
    looked: Option<Instant>,
    /// What it said last, right or wrong.
    content: String,
}

impl Tracker {
    pub(super) fn new(path: &Path) -> Self {
        Self { path: path.into(), looked: None, content: String::new() }
    }

    /// Where the eye is, when the file says something else than before [m].
    ///
    /// # Errors
    /// [`Error::Io`] for a file that cannot be read, the first time; [`Error::Input`] for what is no place, once.
    pub(super) fn look(&mut self) -> Result<Option<DVec3>> {
        let first = self.looked.is_none();
        if self.looked.is_some_and(|looked| looked.elapsed() < PERIOD) {
            return Ok(None);
        }
        self.looked = Some(Instant::now());
        let mut content = String::new();
        let read = File::open(&self.path).and_then(|file| file.take(LONGEST).read_to_string(&mut content));
        match read {
            Err(error) if first => return Err(Error::io(&self.path)(error)),
            // Between two contents a file may be gone, or empty.
            Err(_) => return Ok(None),
            Ok(_) if content.trim().is_empty() || content == self.content => return Ok(None),
            Ok(_) => {}
        }
        self.content = content;
        match position(self.content.trim()) {
            Ok([x, y, z]) => Ok(Some(DVec3::new(x, y, z))),
            Err(why) => Err(Error::input(&self.path, format!("does not say where the eye is: {why}"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_told_once_and_what_is_none_is_named() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("eye");
        assert!(Tracker::new(&path).look().is_err(), "there is no file");
        std::fs::write(&path, "1mm,-2mm,600mm\n").expect("write");
        let mut tracker = Tracker::new(&path);
        let mut look = || {
            std::thread::sleep(2 * PERIOD);
            tracker.look()
        };
        assert_eq!(look().expect("a place"), Some(DVec3::new(1e-3, -2e-3, 0.6)));
        assert_eq!(look().expect("nothing new"), None);
        std::fs::write(&path, "left").expect("write");
        assert!(look().is_err_and(|why| why.to_string().contains("eye")));
        assert_eq!(look().expect("told once"), None);
        std::fs::write(&path, "").expect("write");
        assert_eq!(look().expect("between two places"), None);
        std::fs::write(&path, "0mm,0mm,500mm").expect("write");
        assert_eq!(look().expect("a place"), Some(DVec3::new(0.0, 0.0, 0.5)));
    }
}
