//! Pictures of light.

use crate::arrays::{as_asked, handed, lent};
use crate::errors::{ends_with, refused};
use crate::run::run;
use glam::DVec2;
use holodrive::points::colour::Lasers;
use holodrive::reconstruction::{Reconstruction, Scale, View};
use holodrive::units::show_length;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::path::PathBuf;

/// What is seen of a field or a frame: linear intensity, or in the light of three lasers linear red, green and blue (Rec.709); row 0 on
/// top. ``numpy.asarray(picture)`` is a view of it.
///
/// Made by :func:`reconstruct`.
#[pyclass(frozen, module = "holodrive")]
pub(crate) struct Picture {
    pub(crate) seen: Reconstruction,
    pub(crate) lasers: Option<Lasers>,
    pub(crate) view: View,
    pub(crate) half: DVec2,
}

#[pymethods]
impl Picture {
    /// Intensity: float32 of shape (rows, columns), in colour (rows, columns, 3); a view that cannot be written.
    #[getter]
    fn values<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (owner, (rows, columns)) = (this.clone().into_any(), this.get().size());
        Ok(match &this.get().seen {
            Reconstruction::Gray(picture) => lent(owner, (rows, columns), &picture.values)?.into_any(),
            Reconstruction::Color(picture) => lent(owner, (rows, columns, 3), picture.rgb.as_flattened())?.into_any(),
        })
    }

    /// The intensity for NumPy.
    #[pyo3(signature = (dtype = None, copy = None))]
    fn __array__<'py>(
        this: &Bound<'py, Self>,
        dtype: Option<Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        as_asked(Self::values(this)?, dtype, copy)
    }

    /// (rows, columns), in colour (rows, columns, 3).
    #[getter]
    fn shape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let (rows, columns) = self.size();
        match self.seen {
            Reconstruction::Gray(_) => PyTuple::new(py, [rows, columns]),
            Reconstruction::Color(_) => PyTuple::new(py, [rows, columns, 3]),
        }
    }

    /// Depth in focus, z [m].
    #[getter]
    fn focus(&self) -> f64 {
        self.view.focus()
    }

    /// Width and height of what is seen, in the plane of focus [m].
    #[getter]
    fn window(&self) -> (f64, f64) {
        (2.0 * self.half).into()
    }

    /// Positions of the columns in the plane of focus [m]: float64 of shape (columns,).
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, numpy::PyArray1<f64>>> {
        let (count, half) = (self.size().1, self.half.x);
        handed(py, count, (0..count).map(|i| half * ((2 * i + 1) as f64 / count as f64 - 1.0)).collect())
    }

    /// Positions of the rows in the plane of focus [m], row 0 on top: float64 of shape (rows,).
    #[getter]
    fn y<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, numpy::PyArray1<f64>>> {
        let (count, half) = (self.size().0, self.half.y);
        handed(py, count, (0..count).map(|i| -half * ((2 * i + 1) as f64 / count as f64 - 1.0)).collect())
    }

    /// Values as a screen gets them: uint8 of the picture's shape, sRGB codes.
    ///
    /// :param white: the intensity that is shown as white; by default what 99.5 % of the pixels do not pass.
    #[pyo3(signature = (white = None))]
    fn coded<'py>(&self, py: Python<'py>, white: Option<f32>) -> PyResult<Bound<'py, PyAny>> {
        let scale = scale(py, white)?;
        let codes = py.detach(|| self.seen.coded(scale).iter().map(|v| (v * 255.0).round() as u8).collect());
        let (rows, columns) = self.size();
        Ok(match self.seen {
            Reconstruction::Gray(_) => handed(py, (rows, columns), codes)?.into_any(),
            Reconstruction::Color(_) => handed(py, (rows, columns, 3), codes)?.into_any(),
        })
    }

    /// Writes the picture: .png (sRGB codes), or linear as .npy, and in gray as .mat, .h5 or .tif.
    ///
    /// :param path: the file.
    /// :param white: as in :meth:`coded`.
    #[pyo3(signature = (path, white = None))]
    fn save(&self, py: Python<'_>, path: PathBuf, white: Option<f32>) -> PyResult<()> {
        ends_with(py, &path, &["png", "npy", "mat", "h5", "hdf5", "tif", "tiff"])?;
        let scale = scale(py, white)?;
        run(py, None, |_| self.seen.write(&path, self.lasers.as_ref(), self.seen.white(scale), &self.view, self.half))
    }

    /// The picture for notebooks.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("holodrive._png")?.call_method1("png", (self.coded(py, None)?,))
    }

    fn __repr__(&self) -> String {
        let [width, height] = (2.0 * self.half).to_array().map(show_length);
        let focus = show_length(self.view.focus());
        let by = match self.view {
            View::Plane { .. } => String::new(),
            View::Eye { position, pupil, .. } => {
                format!(", through a pupil of {} at {}", show_length(pupil), position.map(show_length).join(", "))
            }
        };
        let (rows, columns) = self.size();
        let colour = if self.lasers.is_some() { " in colour" } else { "" };
        format!("<holodrive.Picture {columns} × {rows} px{colour}, {width} × {height} at z = {focus}{by}>")
    }
}

impl Picture {
    /// Rows and columns.
    fn size(&self) -> (usize, usize) {
        let (columns, rows) = self.seen.size();
        (rows, columns)
    }
}

fn scale(py: Python<'_>, white: Option<f32>) -> PyResult<Scale> {
    match white {
        None => Ok(Scale::Percentile(0.995)),
        Some(white) if white > 0.0 && white.is_finite() => Ok(Scale::White(white)),
        Some(white) => refused(py, "white", format!("{white} must be greater than zero")),
    }
}
