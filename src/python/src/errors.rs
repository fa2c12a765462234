//! The library's errors as Python's exceptions, one class for each kind (`holodrive/_errors.py`), in the library's words.

use holodrive::Error;
use pyo3::prelude::*;

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

/// Refuses an argument.
pub(crate) fn refused<T>(py: Python<'_>, name: &'static str, what: impl Into<String>) -> PyResult<T> {
    Err(raised(py, &Error::parameter(name, what)))
}
