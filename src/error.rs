//! The one error type of the library: variants are sorted by who can act on them.

use std::path::{Path, PathBuf};

/// What went wrong, where, and what to do about it. One line when printed.
///
/// The binary maps every variant to exit code 2 except [`Error::Interrupted`] (130).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that the user gave says something that cannot be right: scene, points, picture, field.
    #[error("{}: {what}", path.display())]
    Input {
        /// The file at fault.
        path: PathBuf,
        /// What is wrong in it and what to do, in one line.
        what: String,
    },
    /// A panel profile or calibration file is wrong or does not fit.
    #[error("{}: {what}", path.display())]
    Calibration {
        /// The profile at fault (or its embedded name).
        path: PathBuf,
        /// What is wrong in it and what to do, in one line.
        what: String,
    },
    /// A setting (flag or field of a settings struct) is out of its domain.
    #[error("{name}: {what}")]
    Parameter {
        /// The setting's name as the user writes it.
        name: &'static str,
        /// The value that was given, the limit that it broke, and what to do.
        what: String,
    },
    /// A number or size lies outside the domain of its setting.
    #[error("{name}: {value} {limit}")]
    OutOfRange {
        /// The setting's name.
        name: &'static str,
        /// The value that was given, as it is written.
        value: String,
        /// The domain that it lies outside of, as the predicate of a sentence: `must be 1 to 256`.
        limit: String,
    },
    /// The grid is too coarse for the wave that was asked for.
    #[error(
        "{what}: spatial frequency {frequency:.6e} cycles/m passes the grid's limit {limit:.6e} (half a cycle per {pitch:.4e} m pixel); {hint}"
    )]
    Undersampled {
        /// Which wave (reference, carrier, point).
        what: &'static str,
        /// The highest spatial frequency that the wave has [cycles/m].
        frequency: f64,
        /// The highest spatial frequency that the grid carries [cycles/m].
        limit: f64,
        /// The grid's pixel pitch [m].
        pitch: f64,
        /// What would bring it below the limit.
        hint: String,
    },
    /// Correct input that this build or this machine cannot handle.
    #[error("{what}")]
    Unsupported {
        /// What is missing and what to do, in one line.
        what: String,
    },
    /// The job would take more memory than it may.
    #[error("{what} needs {needed} MB of memory, the budget is {budget} MB; {hint}")]
    Memory {
        /// The step that asked.
        what: &'static str,
        /// Memory that the step needs [MB].
        needed: u64,
        /// Memory that it may take [MB].
        budget: u64,
        /// What would make it smaller.
        hint: String,
    },
    /// A monitor, window or presenter did not do what was asked.
    #[error("{what}")]
    Display {
        /// What happened and what to do, in one line.
        what: String,
    },
    /// The operating system refused a file operation.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's own words.
        source: std::io::Error,
    },
    /// The user asked to stop.
    #[error("interrupted; nothing was left half-written")]
    Interrupted,
}

/// The library's result.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// A file of the user's that says something wrong.
    pub fn input(path: impl AsRef<Path>, what: impl Into<String>) -> Self {
        Self::Input { path: path.as_ref().to_path_buf(), what: what.into() }
    }
    /// A profile or calibration file that says something wrong.
    pub fn calibration(path: impl AsRef<Path>, what: impl Into<String>) -> Self {
        Self::Calibration { path: path.as_ref().to_path_buf(), what: what.into() }
    }
    /// A setting outside its domain.
    pub fn parameter(name: &'static str, what: impl Into<String>) -> Self {
        Self::Parameter { name, what: what.into() }
    }
    /// A value outside the domain of its setting; `limit` is the predicate of the sentence that the value begins: `must be 1
    /// to 256`.
    pub fn out_of_range(name: &'static str, value: impl std::fmt::Display, limit: impl Into<String>) -> Self {
        Self::OutOfRange { name, value: value.to_string(), limit: limit.into() }
    }
    /// Correct input that cannot be handled here.
    pub fn unsupported(what: impl Into<String>) -> Self {
        Self::Unsupported { what: what.into() }
    }
    /// Wraps a system error with the path that it concerns; use as `map_err(Error::io(path))`.
    pub fn io(path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.as_ref().to_path_buf();
        move |source| Self::Io { path, source }
    }
}
