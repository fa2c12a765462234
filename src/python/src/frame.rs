//! Frames of drive levels.

use crate::arrays::{Kind, array, as_asked, handed, kind, lent, plane, rows, shown};
use crate::errors::{Raise, ends_with, refused};
use crate::panel::Panel;
use crate::run::run;
use holodrive::encode::{EncodeReport, Encoded};
use holodrive::panel::Setup;
use holodrive::units::show_length;
use numpy::{PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Drive levels for every pixel of a panel, row 0 on top: what is sent to it, with what has to be known to make light of it.
///
/// >>> import holodrive, numpy as np
/// >>> panel = holodrive.Panel(width=6, height=4, pitch="8um", wavelength="532nm")
/// >>> holodrive.Frame(np.full((4, 6), 128), panel)
/// <holodrive.Frame 6 × 4 px, levels 128 … 128 of 256 for PhaseLcos 6×4 at 532nm>
///
/// :param levels: whole numbers of shape (rows, columns), final levels of the panel.
/// :param panel: the :class:`Panel`.
#[pyclass(frozen, module = "holodrive")]
pub(crate) struct Frame {
    pub(crate) frame: holodrive::panel::Frame,
    report: Option<Py<PyAny>>,
}

impl Frame {
    /// Without a report.
    pub(crate) fn of(frame: holodrive::panel::Frame) -> Self {
        Self { frame, report: None }
    }

    /// Of an encoding.
    pub(crate) fn encoded(py: Python<'_>, encoded: Encoded) -> PyResult<Self> {
        let EncodeReport {
            method,
            efficiency,
            field_error,
            clipped,
            dropped,
            quantisation_error,
            unreachable,
            warnings,
        } = encoded.report;
        let told = PyDict::new(py);
        told.set_item("encoding", method)?;
        told.set_item("efficiency", efficiency)?;
        told.set_item("field_error", field_error)?;
        told.set_item("clipped", clipped)?;
        told.set_item("dropped", dropped)?;
        told.set_item("quantisation_error", quantisation_error)?;
        told.set_item("unreachable", unreachable)?;
        told.set_item("warnings", warnings)?;
        Ok(Self { frame: encoded.frame, report: Some(told.into_any().unbind()) })
    }
}

#[pymethods]
impl Frame {
    #[new]
    fn new(levels: &Bound<'_, PyAny>, panel: &Bound<'_, Panel>) -> PyResult<Self> {
        let py = levels.py();
        let levels = array(levels)?;
        let size = plane(&levels, "levels")?;
        let Setup { profile, grid, wavelength, .. } = &panel.get().setup;
        if size != [grid.height, grid.width] {
            let (own, wanted) = (shown(&size), shown(&[grid.height, grid.width]));
            let what = format!("an array of shape {own}; panel {} has {wanted} (rows, columns)", profile.name);
            return refused(py, "levels", what);
        }
        if kind(&levels, "levels")? != Kind::Whole {
            let of = levels.dtype();
            let what = format!("an array of {of}; levels are whole numbers (encode takes phases and fields)");
            return refused(py, "levels", what);
        }
        let wide = rows::<i64>(&levels)?.to_vec()?;
        let highest = profile.levels() as i64 - 1;
        if let Some(at) = wide.iter().position(|level| !(0..=highest).contains(level)) {
            let (row, column) = (at / size[1], at % size[1]);
            let what = format!("{} at row {row}, column {column}; {} has levels 0 … {highest}", wide[at], profile.name);
            return refused(py, "levels", what);
        }
        let levels = wide.into_iter().map(|level| level as u16).collect();
        Ok(Self { frame: holodrive::panel::Frame::new(profile, *wavelength, levels).raise(py)?, report: None })
    }

    /// Reads a frame from a picture: one that :meth:`save` or the program wrote, or any PNG or BMP of levels where a panel is given.
    ///
    /// :param path: the picture.
    /// :param panel: the :class:`Panel` that it is for, where the file does not say or another one holds.
    #[staticmethod]
    #[pyo3(signature = (path, panel = None))]
    fn load(py: Python<'_>, path: PathBuf, panel: Option<&Bound<'_, Panel>>) -> PyResult<Self> {
        let setup = panel.map(|panel| &panel.get().setup);
        let (frame, _) = run(py, None, |_| {
            let (profile, wavelength) = (setup.map(|s| &s.profile), setup.map(|s| s.wavelength));
            holodrive::panel::Frame::read(&path, profile, wavelength)
        })?;
        Ok(Self { frame, report: None })
    }

    /// Writes the frame as a gray PNG that holds its metadata: `holodrive show` puts it on the panel, `reconstruct` looks at it.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        ends_with(py, &path, &["png"])?;
        let frame = &self.frame;
        run(py, None, |_| frame.write(&path))
    }

    /// The levels: uint8 of shape (rows, columns), a copy, up to 8 bits; else uint16, a view that cannot be written.
    #[getter]
    fn levels<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let frame = &this.get().frame;
        let shape = (frame.height, frame.width);
        if frame.bits > 8 {
            return Ok(lent(this.clone().into_any(), shape, &frame.levels)?.into_any());
        }
        Ok(handed(this.py(), shape, frame.levels.iter().map(|&level| level as u8).collect())?.into_any())
    }

    /// The levels for NumPy.
    #[pyo3(signature = (dtype = None, copy = None))]
    fn __array__<'py>(
        this: &Bound<'py, Self>,
        dtype: Option<Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        as_asked(Self::levels(this)?, dtype, copy)
    }

    /// (rows, columns).
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.frame.height, self.frame.width)
    }

    /// Bits a level.
    #[getter]
    fn bits(&self) -> u8 {
        self.frame.bits
    }

    /// Vacuum wavelength [m].
    #[getter]
    fn wavelength(&self) -> f64 {
        self.frame.metadata.wavelength
    }

    /// Depths z of the nearest and the farthest content [m]; None where they are not known.
    #[getter]
    fn depth(&self) -> Option<(f64, f64)> {
        self.frame.metadata.origin.depth.map(Into::into)
    }

    /// All that a later step needs to know, as a dict: panel, wavelength, encoding with its settings, steps applied, origin.
    #[getter]
    fn metadata(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        loaded(py, &serde_json::json!(self.frame.metadata))
    }

    /// What came of the encoding on the panel's own levels: efficiency, field_error, clipped, dropped, quantisation_error [rad],
    /// unreachable, warnings; None for a frame that was read or made of levels.
    #[getter]
    fn report(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.report.as_ref().map(|report| report.clone_ref(py))
    }

    /// The levels as a picture for notebooks, as the panel gets them.
    fn _repr_png_<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let frame = &this.get().frame;
        let shift = u32::from(frame.bits);
        let bright = |&level: &u16| ((u32::from(level) * 255) / ((1u32 << shift) - 1).max(1)) as u8;
        let codes = handed(this.py(), (frame.height, frame.width), frame.levels.iter().map(bright).collect())?;
        this.py().import("holodrive._png")?.call_method1("png", (codes,))
    }

    fn __repr__(&self) -> String {
        let frame = &self.frame;
        let (low, high) = frame.levels.iter().fold((u16::MAX, 0), |(low, high), &l| (low.min(l), high.max(l)));
        format!(
            "<holodrive.Frame {} × {} px, levels {low} … {high} of {} for {} at {}>",
            frame.width,
            frame.height,
            1u32 << frame.bits,
            frame.metadata.panel.name,
            show_length(frame.metadata.wavelength)
        )
    }
}

/// What a value of JSON is in Python.
pub(crate) fn loaded(py: Python<'_>, value: &serde_json::Value) -> PyResult<Py<PyAny>> {
    Ok(py.import("json")?.call_method1("loads", (value.to_string(),))?.unbind())
}
