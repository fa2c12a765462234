//! Arrays between NumPy and the library: borrowed or handed over where that can be, converted where it must.

use crate::errors::refused;
use holodrive::field::Complex32;
use numpy::ndarray::{Array, ArrayView, Dimension, IntoDimension};
use numpy::{
    Element, PyArray, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyUntypedArray, PyUntypedArrayMethods, dtype,
};
use pyo3::prelude::*;

/// What an array holds.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Complex,
    Real,
    Whole,
}

/// The NumPy array of anything that is one: the array itself, or what DLPack, `__array__` or a list says.
pub(crate) fn array<'py>(value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    if let Ok(array) = value.cast::<PyUntypedArray>() {
        return Ok(array.clone());
    }
    let made = value.py().import("holodrive._arrays")?.call_method1("as_array", (value,))?;
    Ok(made.cast_into()?)
}

/// What an array holds; refused where it holds no numbers.
pub(crate) fn kind(array: &Bound<'_, PyUntypedArray>, name: &'static str) -> PyResult<Kind> {
    match array.dtype().kind() {
        b'c' => Ok(Kind::Complex),
        b'f' => Ok(Kind::Real),
        b'i' | b'u' => Ok(Kind::Whole),
        _ => refused(array.py(), name, format!("an array of {} holds no numbers", array.dtype())),
    }
}

/// The array in rows of elements of this type: the same array where it is so, else a converted one.
pub(crate) fn rows<'py, T: Element>(array: &Bound<'py, PyUntypedArray>) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let py = array.py();
    let made = py.import("numpy")?.call_method1("require", (array, dtype::<T>(py), ("C", "A")))?;
    Ok(made.cast_into()?)
}

/// Rows and columns of an array that is a plane.
pub(crate) fn plane(array: &Bound<'_, PyUntypedArray>, name: &'static str) -> PyResult<[usize; 2]> {
    match *array.shape() {
        [rows, columns] if rows > 0 && columns > 0 => Ok([rows, columns]),
        _ => {
            let shape = shown(array.shape());
            refused(array.py(), name, format!("an array of shape {shape} is no plane of (rows, columns)"))
        }
    }
}

/// A shape as Python writes it.
pub(crate) fn shown(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        all => format!("({})", all.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// The values of an array of real or whole numbers.
pub(crate) fn values<T: Element + Copy>(array: &Bound<'_, PyUntypedArray>, name: &'static str) -> PyResult<Vec<T>> {
    if kind(array, name)? == Kind::Complex {
        return refused(array.py(), name, "complex numbers where real ones are needed");
    }
    Ok(rows::<T>(array)?.to_vec()?)
}

/// Real numbers of a plane, with its rows and columns.
pub(crate) fn real_plane(value: &Bound<'_, PyAny>, name: &'static str) -> PyResult<([usize; 2], Vec<f32>)> {
    let array = array(value)?;
    let size = plane(&array, name)?;
    let values = values::<f32>(&array, name)?;
    if let Some(at) = values.iter().position(|v| !v.is_finite()) {
        let (row, column) = (at / size[1], at % size[1]);
        return refused(value.py(), name, format!("the value at row {row}, column {column} is not finite"));
    }
    Ok((size, values))
}

/// An array that takes these values over.
pub(crate) fn handed<'py, T: Element, D: IntoDimension>(
    py: Python<'py>,
    shape: D,
    values: Vec<T>,
) -> PyResult<Bound<'py, PyArray<T, D::Dim>>> {
    let shape = shape.into_dimension();
    match Array::from_shape_vec(shape, values) {
        Ok(array) => Ok(PyArray::from_owned_array(py, array)),
        Err(fault) => refused(py, "shape", fault.to_string()),
    }
}

/// An array that looks at values which `owner` keeps; it cannot be written.
pub(crate) fn lent<'py, T: Element, D: IntoDimension>(
    owner: Bound<'py, PyAny>,
    shape: D,
    values: &[T],
) -> PyResult<Bound<'py, PyArray<T, D::Dim>>>
where
    D::Dim: Dimension,
{
    let py = owner.py();
    match ArrayView::from_shape(shape.into_dimension(), values) {
        // SAFETY: `values` are those of `owner`, a frozen class whose values are never replaced; NumPy keeps it alive as the
        // array's base.
        Ok(view) => {
            let array = unsafe { PyArray::borrow_from_array(&view, owner) };
            array.call_method1("setflags", (false,))?;
            Ok(array)
        }
        Err(fault) => refused(py, "shape", fault.to_string()),
    }
}

/// Complex samples of a plane as complex64, and its rows and columns: the same array where it is one.
pub(crate) fn complex_plane<'py>(
    array: &Bound<'py, PyUntypedArray>,
    name: &'static str,
) -> PyResult<([usize; 2], Bound<'py, PyArrayDyn<Complex32>>)> {
    let size = plane(array, name)?;
    if kind(array, name)? != Kind::Complex {
        let what =
            format!("an array of {}; a field is complex (complex64, without a copy, or complex128)", array.dtype());
        return refused(array.py(), name, what);
    }
    Ok((size, rows(array)?))
}

/// What `__array__(dtype, copy)` hands out of an array that stands already.
pub(crate) fn as_asked<'py>(
    array: Bound<'py, PyAny>,
    dtype: Option<Bound<'py, PyAny>>,
    copy: Option<bool>,
) -> PyResult<Bound<'py, PyAny>> {
    let py = array.py();
    let own = array.getattr("dtype")?;
    let other = match dtype.filter(|dtype| !dtype.is_none()) {
        Some(dtype) => Some(py.import("numpy")?.call_method1("dtype", (dtype,))?),
        None => None,
    };
    match other {
        Some(dtype) if !own.eq(&dtype)? => {
            if copy == Some(false) {
                return Err(pyo3::exceptions::PyValueError::new_err(format!("{own} becomes {dtype} by a copy only")));
            }
            array.call_method1("astype", (dtype,))
        }
        _ if copy == Some(true) => array.call_method0("copy"),
        _ => Ok(array),
    }
}
