//! Lengths and angles as Python gives them: numbers in SI units, or text with a unit.

use crate::errors::{Raise, refused};
use glam::{DVec2, DVec3};
use holodrive::names::Named;
use holodrive::panel::Setup;
use holodrive::points::colour::Lasers;
use holodrive::units;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyString;

fn quantity(value: &Borrowed<'_, '_, PyAny>, read: fn(&str) -> holodrive::Result<f64>) -> PyResult<f64> {
    match value.cast::<PyString>() {
        Ok(text) => read(&text.to_string_lossy()).raise(value.py()),
        Err(_) => value.extract(),
    }
}

/// A length [m]: a number of metres, or text with a unit such as "8um".
#[derive(Clone, Copy)]
pub(crate) struct Length(pub(crate) f64);

impl<'py> FromPyObject<'_, 'py> for Length {
    type Error = PyErr;
    fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        quantity(&value, units::length).map(Self)
    }
}

/// An angle [rad]: a number of radians, or text with a unit such as "1.1deg".
#[derive(Clone, Copy)]
pub(crate) struct Angle(pub(crate) f64);

impl<'py> FromPyObject<'_, 'py> for Angle {
    type Error = PyErr;
    fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        quantity(&value, units::angle).map(Self)
    }
}

/// An amount of memory [bytes]: a number, or text with a unit such as "2GB".
#[derive(Clone, Copy)]
pub(crate) struct Memory(pub(crate) u64);

impl<'py> FromPyObject<'_, 'py> for Memory {
    type Error = PyErr;
    fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match value.cast::<PyString>() {
            Ok(text) => units::memory(&text.to_string_lossy()).raise(value.py()).map(Self),
            Err(_) => value.extract().map(Self),
        }
    }
}

/// So many lengths of any sequence: tuple, list, array [m]; none of what is no sequence.
fn several<const N: usize>(value: &Borrowed<'_, '_, PyAny>) -> PyResult<Option<[f64; N]>> {
    if value.cast::<PyString>().is_ok() || value.len().is_err() {
        return Ok(None);
    }
    let lengths = value.try_iter()?.map(|one| Ok(one?.extract::<Length>()?.0)).collect::<PyResult<Vec<_>>>()?;
    let count = lengths.len();
    <[f64; N]>::try_from(lengths)
        .map(Some)
        .map_err(|_| PyTypeError::new_err(format!("{count} lengths where {N} are due")))
}

/// One length for x and y, or one for each [m].
#[derive(Clone, Copy)]
pub(crate) struct Lengths(pub(crate) [f64; 2]);

impl<'py> FromPyObject<'_, 'py> for Lengths {
    type Error = PyErr;
    fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Some(both) = several(&value)? {
            return Ok(Self(both));
        }
        value.extract::<Length>().map(|Length(both)| Self([both; 2]))
    }
}

impl Lengths {
    pub(crate) fn vector(self) -> DVec2 {
        DVec2::from_array(self.0)
    }
}

/// A place in the hologram frame, (x, y, z) [m].
#[derive(Clone, Copy)]
pub(crate) struct Place(pub(crate) DVec3);

impl<'py> FromPyObject<'_, 'py> for Place {
    type Error = PyErr;
    fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match several(&value)? {
            Some(place) => Ok(Self(DVec3::from_array(place))),
            None => Err(PyTypeError::new_err("a place is three lengths: (x, y, z)")),
        }
    }
}

/// Wavelengths of three lasers [m], or "panel": those that its profile names.
pub(crate) enum Three {
    Given([f64; 3]),
    Of(String),
}

impl<'py> FromPyObject<'_, 'py> for Three {
    type Error = PyErr;
    fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match several(&value)? {
            Some(three) => Ok(Self::Given(three)),
            None => value.extract().map(Self::Of),
        }
    }
}

impl Three {
    /// The panel in the light of these.
    pub(crate) fn light(&self, py: Python<'_>, setup: &Setup) -> PyResult<Setup> {
        let given = match self {
            Self::Given(three) => Some(*three),
            Self::Of(panel) if panel == "panel" => None,
            Self::Of(other) => {
                return refused(py, "wavelengths", format!("`{other}` is no three lengths, nor \"panel\""));
            }
        };
        setup.clone().in_color(given).raise(py)
    }
}

/// The lasers of what is seen together, by the wavelength of each item [m], None where one is dark: three lasers, given or those of three
/// items in the order red, green, blue; none where all are of one wavelength, shown in turn.
pub(crate) fn lasers_of(
    py: Python<'_>,
    items: &[Option<f64>],
    given: Option<&Three>,
    panel: Option<&Setup>,
) -> PyResult<Option<Lasers>> {
    let same = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b;
    let lit: Vec<f64> = items.iter().flatten().copied().collect();
    let lasers = match (given, panel) {
        (Some(Three::Given(three)), _) => Lasers::new(*three).raise(py)?,
        (Some(three), Some(panel)) => match three.light(py, panel)?.lasers {
            Some(lasers) => lasers,
            None => return refused(py, "wavelengths", "are of no lasers"),
        },
        (Some(_), None) => return refused(py, "wavelengths", "a field names no panel: give three lengths"),
        (None, _) if lit.iter().all(|wavelength| same(*wavelength, lit[0])) => {
            if lit.len() < items.len() {
                return refused(py, "wavelengths", "name the three lasers, of which one has no light here");
            }
            return Ok(None);
        }
        (None, _) => match *lit {
            [red, green, blue] if items.len() == 3 => Lasers::new([red, green, blue]).raise(py)?,
            _ if items.len() == 3 => {
                return refused(py, "wavelengths", "name the three lasers, of which one has no light here");
            }
            _ => {
                let what = format!("{} of several wavelengths: give one for each of three lasers", items.len());
                return refused(py, "frames", what);
            }
        },
    };
    let told = lasers.wavelengths();
    let fits = items.len() == 3 && items.iter().zip(told).all(|(item, laser)| item.is_none_or(|w| same(w, laser)));
    if !fits {
        let told = told.map(holodrive::units::show_length).join(", ");
        return refused(py, "frames", format!("are not those of {told}: three in this order, None for a dark one"));
    }
    Ok(Some(lasers))
}

/// The value of that name of a closed set.
pub(crate) fn named<T: Named>(py: Python<'_>, name: &str) -> PyResult<T> {
    T::named(name).raise(py)
}

/// Metres of a length with its unit.
///
/// >>> import holodrive
/// >>> holodrive.length("632.8nm"), holodrive.length(0.25)
/// (6.328e-07, 0.25)
///
/// :param value: text such as "8um", "632.8nm", "0.25m", or a number of metres.
/// :raises ParameterError: the text has no unit, or one that is no length's.
#[pyfunction]
pub(crate) fn length(value: Length) -> f64 {
    value.0
}
