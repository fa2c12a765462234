//! Fields: complex samples that stay where NumPy keeps them, or that NumPy looks at where the library keeps them.

use crate::arrays::{Kind, array, as_asked, complex_plane, kind, lent};
use crate::errors::{Raise, refused};
use crate::quantities::{Length, Lengths, named};
use crate::run::run;
use holodrive::field::npy::Content;
use holodrive::field::{Complex32, Grid, stored};
use holodrive::panel::Setup;
use holodrive::propagation::{Propagator, Settings};
use holodrive::units::{show_length, show_pitch};
use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use std::mem::ManuallyDrop;
use std::path::PathBuf;

/// A field whose samples are those of a NumPy array.
pub(crate) struct Lent {
    /// Its samples are the array's memory, which is never freed, grown or written through it.
    field: ManuallyDrop<holodrive::field::Field>,
    array: Py<PyArrayDyn<Complex32>>,
}

impl Lent {
    /// Of an array in rows of as many samples as the grid has.
    fn new(grid: Grid, wavelength: f64, array: &Bound<'_, PyArrayDyn<Complex32>>) -> PyResult<Self> {
        let readonly = array.try_readonly()?;
        let samples = readonly.as_slice()?;
        let size = [grid.height, grid.width];
        if samples.len() != grid.len() {
            return refused(array.py(), "field", format!("{} samples for {size:?} (rows, columns)", samples.len()));
        }
        // SAFETY: only `&Field` is ever made of it, through which a vector is read as a slice and neither freed nor grown:
        // `ManuallyDrop` keeps it from that. The array is kept alive beside it, and NumPy does not move its memory.
        let samples = unsafe { Vec::from_raw_parts(samples.as_ptr().cast_mut(), samples.len(), samples.len()) };
        let field = ManuallyDrop::new(holodrive::field::Field { grid, wavelength, samples });
        Ok(Self { field, array: array.clone().unbind() })
    }
}

/// A field and whose memory it is.
pub(crate) enum Samples {
    Own(holodrive::field::Field),
    Lent(Lent),
}

impl std::ops::Deref for Samples {
    type Target = holodrive::field::Field;
    fn deref(&self) -> &Self::Target {
        match self {
            Self::Own(field) => field,
            Self::Lent(lent) => &lent.field,
        }
    }
}

/// A wave on a plane: complex samples at one wavelength, row 0 on top.
///
/// The time factor is exp(-iωt): a longer path is a larger phase. ``numpy.asarray(field)`` is a view of the samples.
///
/// >>> import holodrive, numpy as np
/// >>> holodrive.Field(np.ones((4, 6), np.complex64), "8um", "532nm")
/// <holodrive.Field 6 × 4 px of 8um at 532nm>
///
/// :param samples: complex array of shape (rows, columns); complex64 in rows is taken without a copy, and must then not be
///     written while the field is used.
/// :param pitch: distance of neighbouring samples [m], or (x, y).
/// :param wavelength: vacuum wavelength [m].
/// :param z: where the plane stands in front of the panel [m].
/// :param depth: depths z of the nearest and farthest content [m], where they are known.
#[pyclass(frozen, module = "holodrive")]
pub(crate) struct Field {
    pub(crate) samples: Samples,
    pub(crate) content: Content,
    /// What making it took; none for a field that came as an array.
    report: Option<Py<PyAny>>,
}

impl Field {
    pub(crate) fn made(field: holodrive::field::Field, content: Content, report: Option<Py<PyAny>>) -> Self {
        Self { samples: Samples::Own(field), content, report }
    }
}

#[pymethods]
impl Field {
    #[new]
    #[pyo3(signature = (samples, pitch, wavelength, *, z = Length(0.0), depth = None))]
    fn new(
        samples: &Bound<'_, PyAny>,
        pitch: Lengths,
        wavelength: Length,
        z: Length,
        depth: Option<(Length, Length)>,
    ) -> PyResult<Self> {
        let py = samples.py();
        let ([rows, columns], samples) = complex_plane(&array(samples)?, "samples")?;
        let grid = Grid::new(columns, rows, pitch.0[0], pitch.0[1]).raise(py)?;
        if !(wavelength.0 > 0.0 && wavelength.0.is_finite()) {
            return refused(py, "wavelength", format!("{} m must be greater than zero", wavelength.0));
        }
        let content = Content { z: z.0, depth: depth.map(|(near, far)| [near.0, far.0]), ..Content::default() };
        Ok(Self { samples: Samples::Lent(Lent::new(grid, wavelength.0, &samples)?), content, report: None })
    }

    /// Reads a field from a file: .npy, .npz, .mat, .h5, .tif; ``file:name`` chooses an array.
    ///
    /// :param path: the file.
    /// :param pitch: distance of samples [m], or (x, y), where the file says none or another one holds.
    /// :param wavelength: vacuum wavelength [m], likewise.
    #[staticmethod]
    #[pyo3(signature = (path, *, pitch = None, wavelength = None))]
    fn load(py: Python<'_>, path: PathBuf, pitch: Option<Lengths>, wavelength: Option<Length>) -> PyResult<Self> {
        let (field, metadata) = run(py, None, |_| {
            stored::read_field(&path, pitch.map(|pitch| pitch.0), wavelength.map(|wavelength| wavelength.0))
        })?;
        Ok(Self::made(field, metadata.content, None))
    }

    /// Writes the field as .npy (with its metadata beside it), .mat or .h5, as the name says.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let (field, content) = (&*self.samples, &self.content);
        run(py, None, |_| stored::write_field(&path, field, content, "Python"))
    }

    /// The samples, complex64 of shape (rows, columns): a view, not a copy, which cannot be written where the library keeps them.
    #[getter]
    fn samples<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        match &this.get().samples {
            Samples::Own(field) => {
                let (grid, samples) = (&field.grid, &field.samples);
                Ok(lent(this.clone().into_any(), (grid.height, grid.width), samples)?.into_any())
            }
            Samples::Lent(Lent { array, .. }) => Ok(array.bind(this.py()).clone().into_any()),
        }
    }

    /// The samples for NumPy.
    #[pyo3(signature = (dtype = None, copy = None))]
    fn __array__<'py>(
        this: &Bound<'py, Self>,
        dtype: Option<Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        as_asked(Self::samples(this)?, dtype, copy)
    }

    /// (rows, columns).
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.samples.grid.height, self.samples.grid.width)
    }

    /// Distance of neighbouring samples along x and y [m].
    #[getter]
    fn pitch(&self) -> (f64, f64) {
        self.samples.grid.pitch().into()
    }

    /// Vacuum wavelength [m].
    #[getter]
    fn wavelength(&self) -> f64 {
        self.samples.wavelength
    }

    /// Where the plane stands in front of the panel, z [m].
    #[getter]
    fn z(&self) -> f64 {
        self.content.z
    }

    /// Depths z of the nearest and the farthest content [m]; None where they are not known.
    #[getter]
    fn depth(&self) -> Option<(f64, f64)> {
        self.content.depth.map(Into::into)
    }

    /// Sum of \|u\|² over the samples.
    #[getter]
    fn energy(&self, py: Python<'_>) -> f64 {
        let field = &*self.samples;
        py.detach(|| field.energy())
    }

    /// What making it took: engine, reason, seconds, bound and measured error, coverage; None for a field that came as an array.
    #[getter]
    fn report(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.report.as_ref().map(|report| report.clone_ref(py))
    }

    fn __repr__(&self) -> String {
        let grid = &self.samples.grid;
        let (pitch, light) = (show_pitch(grid.pitch()), show_length(self.samples.wavelength));
        let place =
            if self.content.z == 0.0 { String::new() } else { format!(", z = {}", show_length(self.content.z)) };
        format!("<holodrive.Field {} × {} px of {pitch} at {light}{place}>", grid.width, grid.height)
    }
}

/// A field argument: a `Field`, or an array on a panel's pixels.
pub(crate) enum Given<'py> {
    Field(Bound<'py, Field>),
    /// Of an array; `are_phases` where it held real numbers, which are phases in radians.
    Array {
        samples: Samples,
        are_phases: bool,
    },
}

impl<'py> Given<'py> {
    /// An array takes pitch and wavelength of the panel; complex ones are fields, real ones phases of waves of amplitude one.
    pub(crate) fn on_panel(value: &Bound<'py, PyAny>, setup: &Setup) -> PyResult<Self> {
        if let Ok(field) = value.cast::<Field>() {
            return Ok(Self::Field(field.clone()));
        }
        let py = value.py();
        let array = array(value)?;
        let kind = kind(&array, "field")?;
        let size = crate::arrays::plane(&array, "field")?;
        let grid = setup.grid;
        if size != [grid.height, grid.width] {
            let (own, panel) = (crate::arrays::shown(&size), crate::arrays::shown(&[grid.height, grid.width]));
            let what = format!("an array of shape {own}; panel {} has {panel} (rows, columns)", setup.profile.name);
            return refused(py, "field", what);
        }
        match kind {
            Kind::Complex => {
                let (_, samples) = complex_plane(&array, "field")?;
                let samples = Samples::Lent(Lent::new(grid, setup.wavelength, &samples)?);
                Ok(Self::Array { samples, are_phases: false })
            }
            Kind::Real => {
                let (_, phases) = crate::arrays::real_plane(value, "field")?;
                let waves = || holodrive::field::Field::of_phases(grid, setup.wavelength, &phases);
                let field = py.detach(waves).raise(py)?;
                Ok(Self::Array { samples: Samples::Own(field), are_phases: true })
            }
            Kind::Whole => {
                refused(py, "field", "whole numbers are drive levels: Frame(levels, panel) takes them as they are")
            }
        }
    }

    /// The field, where it stands and what it shows, and whether it was given as phases.
    pub(crate) fn get(&self) -> (&holodrive::field::Field, Content, bool) {
        match self {
            Self::Field(field) => (&field.get().samples, field.get().content, false),
            Self::Array { samples, are_phases } => (samples, Content::default(), *are_phases),
        }
    }
}

/// Carries a field to another plane: each plane wave is multiplied by exp(i2πf_z·d), f_z = √(1/λ² − f²), without the light that
/// leaves one edge coming back at the other.
///
/// >>> import holodrive, numpy as np
/// >>> wave = holodrive.Field(np.ones((64, 64), np.complex64), "8um", "532nm")
/// >>> far = holodrive.propagate(wave, "10mm")
/// >>> far.shape, far.z
/// ((64, 64), 0.01)
///
/// :param field: a :class:`Field`.
/// :param distance: how far [m]; d > 0 goes with the light, d < 0 back.
/// :param kernel: "angular-spectrum" (exact) or "fresnel" (paraxial).
/// :param progress: see :func:`hologram`.
/// :return: the :class:`Field` on the same pixels, at z + distance.
#[pyfunction]
#[pyo3(signature = (field, distance, *, kernel = "angular-spectrum", progress = None))]
pub(crate) fn propagate(
    py: Python<'_>,
    field: &Bound<'_, Field>,
    distance: Length,
    kernel: &str,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Field> {
    let settings = Settings { kernel: named(py, kernel)?, ..Settings::default() };
    let (samples, content) = (&*field.get().samples, field.get().content);
    let carried = run(py, progress, |progress| {
        progress.start("propagate", 0);
        Propagator::new(samples.grid, samples.grid, settings)?.propagate(samples, distance.0, progress)
    })?;
    Ok(Field::made(carried, Content { z: content.z + distance.0, ..content }, None))
}
