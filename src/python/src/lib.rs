//! holodrive for Python: NumPy arrays in and out, over the library and nothing else.
//!
//! Each function is a few lines that turn Python's values into the library's, call the pipeline, and hand on what it says. No
//! physics is here. Long calls run on a thread of their own with the interpreter's lock released ([`run`]); large arrays are
//! borrowed or handed over, not copied ([`arrays`], [`field`]). What is typed in Python, exceptions and progress bars among
//! it, stands in the package's own files (`holodrive/*.py`).

mod arrays;
mod camera;
mod encode;
mod errors;
mod field;
mod frame;
mod hologram;
mod light_field;
mod metrics;
mod panel;
mod picture;
mod plate;
mod points;
mod quantities;
mod run;
mod scene;
mod seen;

use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs the program with these arguments, its own name first, in this process, and returns its exit code.
#[pyfunction]
fn program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| holodrive::cli::main(&arguments))
}

/// The part of holodrive that is compiled.
#[pymodule]
fn _holodrive(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<panel::Panel>()?;
    module.add_class::<scene::Scene>()?;
    module.add_class::<points::Points>()?;
    module.add_class::<field::Field>()?;
    module.add_class::<frame::Frame>()?;
    module.add_class::<light_field::LightField>()?;
    module.add_class::<picture::Picture>()?;
    module.add_function(wrap_pyfunction!(program, module)?)?;
    module.add_function(wrap_pyfunction!(run::_worked, module)?)?;
    module.add_function(wrap_pyfunction!(panel::panels, module)?)?;
    module.add_function(wrap_pyfunction!(hologram::hologram, module)?)?;
    module.add_function(wrap_pyfunction!(field::propagate, module)?)?;
    module.add_function(wrap_pyfunction!(light_field::light_field, module)?)?;
    module.add_function(wrap_pyfunction!(encode::encode, module)?)?;
    module.add_function(wrap_pyfunction!(camera::calibrate_camera, module)?)?;
    module.add_function(wrap_pyfunction!(camera::encode_in_the_loop, module)?)?;
    module.add_function(wrap_pyfunction!(seen::reconstruct, module)?)?;
    module.add_function(wrap_pyfunction!(seen::judge, module)?)?;
    module.add_function(wrap_pyfunction!(metrics::metrics, module)?)?;
    module.add_function(wrap_pyfunction!(plate::print_plate, module)?)?;
    module.add_function(wrap_pyfunction!(quantities::length, module)?)
}
