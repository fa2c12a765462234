//! The library's errors as Python's exceptions, one class for each kind (`holodrive/_errors.py`), in the library's words.

use holodrive::Error;
use pyo3::prelude::*;
use std::path::Path;

/// The exception of an error: its class, and what it holds for programs.
fn exception<'py>(py: Python<'py>, error: &Error) -> PyResult<Bound<'py, PyAny>> {
    let class = match error {
        Error::Input { .. } => "InputError",
        Error::Calibration { .. } => "CalibrationError",
        Error::Parameter { .. } => "ParameterError",
        Error::OutOfRange { .. } => "OutOfRangeError",
        Error::Undersampled { .. } => "UndersampledError",
        Error::Unsupported { .. } => "UnsupportedError",
        Error::Memory { .. } => "MemoryBudgetError",
        Error::Display { .. } => "DisplayError",
        Error::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => "MissingFileError",
        Error::Io { .. } => "FileError",
        Error::Interrupted => "Interrupted",
        _ => "Error",
    };
    let raised = py.import("holodrive._errors")?.getattr(class)?.call1((error.to_string(),))?;
    match error {
        Error::Input { path, .. } | Error::Calibration { path, .. } => raised.setattr("path", path)?,
        Error::Parameter { name, .. } => raised.setattr("parameter", name)?,
        Error::OutOfRange { name, value, limit } => {
            raised.setattr("parameter", name)?;
            raised.setattr("value", value)?;
            raised.setattr("limit", limit)?;
        }
        Error::Undersampled { frequency, limit, .. } => {
            raised.setattr("frequency", frequency)?;
            raised.setattr("limit", limit)?;
        }
        Error::Io { path, source } => {
            raised.setattr("path", path)?;
            raised.setattr("filename", path)?;
            raised.setattr("errno", source.raw_os_error())?;
        }
        _ => {}
    }
    Ok(raised)
}

/// What Python raises for an error of the library.
pub(crate) fn raised(py: Python<'_>, error: &Error) -> PyErr {
    exception(py, error).map_or_else(|fault| fault, PyErr::from_value)
}

/// A result of the library as one of Python.
pub(crate) trait Raise<T> {
    /// The value, or the exception of the error.
    fn raise(self, py: Python<'_>) -> PyResult<T>;
}

impl<T> Raise<T> for holodrive::Result<T> {
    fn raise(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|error| raised(py, &error))
    }
}

/// Refuses a file whose ending is none of these: it would not be what its name says.
pub(crate) fn ends_with(py: Python<'_>, path: &Path, kinds: &[&str]) -> PyResult<()> {
    let own = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    if kinds.contains(&own.as_str()) {
        return Ok(());
    }
    let all = kinds.iter().map(|kind| format!(".{kind}")).collect::<Vec<_>>().join(", ");
    Err(raised(py, &Error::input(path, format!("is written as {all}"))))
}

/// Refuses an argument.
pub(crate) fn refused<T>(py: Python<'_>, name: &'static str, what: impl Into<String>) -> PyResult<T> {
    Err(raised(py, &Error::parameter(name, what)))
}
