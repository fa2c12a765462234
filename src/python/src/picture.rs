//! Pictures of light.

use crate::arrays::{as_asked, handed, lent};
use crate::errors::{ends_with, refused};
use crate::run::run;
use glam::DVec2;
use holodrive::reconstruction::{Reconstruction, Scale, View};
use holodrive::units::show_length;
use numpy::PyArray2;
use pyo3::prelude::*;
use std::path::PathBuf;

/// What is seen of a field or a frame: linear intensity, row 0 on top. ``numpy.asarray(picture)`` is a view of it.
///
/// Made by :func:`reconstruct`.
#[pyclass(frozen, module = "holodrive")]
pub(crate) struct Picture {
    pub(crate) picture: holodrive::reconstruction::Picture,
    pub(crate) view: View,
    pub(crate) half: DVec2,
}

#[pymethods]
impl Picture {
    /// Intensity: float32 of shape (rows, columns), a view that cannot be written.
    #[getter]
    fn values<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let picture = &this.get().picture;
        lent(this.clone().into_any(), (picture.height, picture.width), &picture.values)
    }

    /// The intensity for NumPy.
    #[pyo3(signature = (dtype = None, copy = None))]
    fn __array__<'py>(
        this: &Bound<'py, Self>,
        dtype: Option<Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        as_asked(Self::values(this)?.into_any(), dtype, copy)
    }

    /// (rows, columns).
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.picture.height, self.picture.width)
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
        let (count, half) = (self.picture.width, self.half.x);
        handed(py, count, (0..count).map(|i| half * ((2 * i + 1) as f64 / count as f64 - 1.0)).collect())
    }

    /// Positions of the rows in the plane of focus [m], row 0 on top: float64 of shape (rows,).
    #[getter]
    fn y<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, numpy::PyArray1<f64>>> {
        let (count, half) = (self.picture.height, self.half.y);
        handed(py, count, (0..count).map(|i| -half * ((2 * i + 1) as f64 / count as f64 - 1.0)).collect())
    }

    /// Values as a screen gets them: uint8 of shape (rows, columns), sRGB codes.
    ///
    /// :param white: the intensity that is shown as white; by default what 99.5 % of the pixels do not pass.
    #[pyo3(signature = (white = None))]
    fn coded<'py>(&self, py: Python<'py>, white: Option<f32>) -> PyResult<Bound<'py, PyArray2<u8>>> {
        let picture = &self.picture;
        let scale = scale(py, white)?;
        let codes = py.detach(|| picture.coded(scale).iter().map(|v| (v * 255.0).round() as u8).collect());
        handed(py, (picture.height, picture.width), codes)
    }

    /// Writes the picture: .png (sRGB codes), or linear as .npy, .mat, .h5 or .tif.
    ///
    /// :param path: the file.
    /// :param white: as in :meth:`coded`.
    #[pyo3(signature = (path, white = None))]
    fn save(&self, py: Python<'_>, path: PathBuf, white: Option<f32>) -> PyResult<()> {
        ends_with(py, &path, &["png", "npy", "mat", "h5", "hdf5", "tif", "tiff"])?;
        let Self { picture, view, half } = self;
        let scale = scale(py, white)?;
        run(py, None, |_| {
            let white = picture.white(scale);
            Reconstruction::Gray(picture.clone()).write(&path, None, white, view, *half)
        })
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
        let (rows, columns) = self.shape();
        format!("<holodrive.Picture {columns} × {rows} px, {width} × {height} at z = {focus}{by}>")
    }
}

fn scale(py: Python<'_>, white: Option<f32>) -> PyResult<Scale> {
    match white {
        None => Ok(Scale::Percentile(0.995)),
        Some(white) if white > 0.0 && white.is_finite() => Ok(Scale::White(white)),
        Some(white) => refused(py, "white", format!("{white} must be greater than zero")),
    }
}
