//! Points to the field on the panel.

use crate::errors::refused;
use crate::field::Field;
use crate::panel::Panel;
use crate::points::Points;
use crate::quantities::{Memory, Three, named};
use crate::run::run;
use holodrive::hologram::{Computed, HologramReport, HologramSettings};
use holodrive::names::Named;
use holodrive::pipeline;
use holodrive::points::Exposure;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// The field of points on a panel, by the engine that keeps the error in the least time.
///
/// >>> import holodrive
/// >>> panel = holodrive.Panel(width=64, height=48, pitch="8um", wavelength="532nm")
/// >>> field = holodrive.hologram(holodrive.Points([[0, 0, -0.1]]), panel)
/// >>> field, field.report["engine"] in ("direct", "tiles", "planes")
/// (<holodrive.Field 64 × 48 px of 8um at 532nm>, True)
///
/// :param points: :class:`Points`.
/// :param panel: the :class:`Panel`, whose pixels and wavelength are taken.
/// :param error: wanted relative L2 error of the field.
/// :param engine: "direct", "tiles", "planes", "gpu", "gpu-planes", "oracle" or "recurrence"; by default the fastest that serves.
/// :param channel: "luminance", "red", "green" or "blue" of a coloured cloud.
/// :param wavelengths: of three lasers [m], for light in colour, in any order, or "panel": those that the profile names.
/// :param memory: what may be taken beside points and field [bytes], or text such as "2GB".
/// :param progress: ``callable(step, done, total)``, a tqdm bar, or True for a bar of tqdm's. An exception that it raises stops the
///     work and is raised here, as Ctrl-C is.
/// :return: :class:`Field`, complex64 on the panel's pixels; with `wavelengths` a list of three, for red, green and blue, None
///     for a laser that has no light.
/// :raises ParameterError: a setting is out of its domain, or the points are all dark.
#[pyfunction]
#[pyo3(signature = (
    points, panel, *, error = 1e-3, engine = None, channel = "luminance", wavelengths = None, memory = None, progress = None
))]
#[expect(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn hologram(
    py: Python<'_>,
    points: &Bound<'_, Points>,
    panel: &Bound<'_, Panel>,
    error: f64,
    engine: Option<&str>,
    channel: &str,
    wavelengths: Option<Three>,
    memory: Option<Memory>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<PyAny>> {
    let usual = HologramSettings::default();
    let settings = HologramSettings {
        error,
        method: engine.map(|engine| named(py, engine)).transpose()?,
        memory: memory.map_or(usual.memory, |memory| memory.0),
        ..usual
    };
    let (points, setup) = (points.get(), &panel.get().setup);
    let setup = &wavelengths.map_or_else(|| Ok(setup.clone()), |three| three.light(py, setup))?;
    let (cloud, content) = (points.cloud(), points.content());
    let exposures = match &setup.lasers {
        None => Exposure::whole(named(py, channel)?, setup.wavelength),
        Some(_) if channel != "luminance" => return refused(py, "channel", "is for one laser; three show all colours"),
        Some(lasers) => Exposure::of_lasers(lasers, None),
    };
    let computed = run(py, progress, |progress| {
        let field = |one| pipeline::field(cloud, one, setup, &settings, progress);
        exposures.iter().map(field).collect::<holodrive::Result<Vec<_>>>()
    })?;
    let made = |computed: Computed| {
        let report = report(py, &computed.report)?;
        Ok::<_, PyErr>(Field::made(computed.field, content, Some(report)))
    };
    let mut fields = computed.into_iter().map(|one| one.map(made).transpose()).collect::<PyResult<Vec<_>>>()?;
    if setup.lasers.is_some() {
        return Ok(PyList::new(py, fields)?.into_any().unbind());
    }
    match fields.pop().flatten() {
        Some(field) => Ok(Bound::new(py, field)?.into_any().unbind()),
        None => refused(py, "points", "have no light for this laser"),
    }
}

fn report(py: Python<'_>, report: &HologramReport) -> PyResult<Py<PyAny>> {
    let told = PyDict::new(py);
    told.set_item("engine", report.method.name())?;
    told.set_item("reason", &report.reason)?;
    told.set_item("seconds", report.seconds)?;
    told.set_item("predicted_seconds", report.predicted_seconds)?;
    told.set_item("error_bound", report.error_bound)?;
    told.set_item("measured_error", report.measured.error)?;
    told.set_item("memory", report.memory)?;
    told.set_item("points", report.coverage.points)?;
    told.set_item("unreached", report.coverage.unreached)?;
    told.set_item("light_outside", report.coverage.light_outside)?;
    told.set_item("pairs", report.coverage.pairs)?;
    told.set_item("warnings", &report.warnings)?;
    Ok(told.into_any().unbind())
}
