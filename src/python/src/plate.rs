//! Printed holograms.

use crate::errors::Raise;
use crate::frame::loaded;
use crate::run::run;
use holodrive::print::{Asked, Plate, PlateJob, PrintSettings, Shard, Source};
use holodrive::segments::SceneOptions;
use pyo3::prelude::*;
use std::path::PathBuf;

/// Computes the fringes of a plate of any size, tile by tile into one BigTIFF in `folder`; goes on where it was stopped.
///
/// :param source: a scene (.gltf, .glb, .obj, .stl) or points (.ply).
/// :param plate: a built-in plate's name (``holodrive plates``) or a .toml file: size, pitch, reference wave, lamps.
/// :param folder: where the plate is written.
/// :param dry_run: computes nothing and says what it would take.
/// :param shard: part of the tiles, such as "0/8" for the first of eight.
/// :param progress: see :func:`hologram`.
/// :return: a dict: of a dry run the plan (size, extent, tiles, segments, points, seconds, warnings …), else what was done.
#[pyfunction]
#[pyo3(signature = (source, plate, folder, *, dry_run = false, shard = None, progress = None))]
pub(crate) fn print_plate(
    py: Python<'_>,
    source: PathBuf,
    plate: PathBuf,
    folder: PathBuf,
    dry_run: bool,
    shard: Option<&str>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<PyAny>> {
    let shard = match shard {
        Some(text) => Shard::parse(text, |name| std::env::var(name).ok()).raise(py)?,
        None => Shard::default(),
    };
    let told = run(py, progress, |progress| {
        let plate = Plate::find(&plate.to_string_lossy(), &Asked::default())?;
        let settings = PrintSettings {
            plate,
            input: Source::File(source),
            options: SceneOptions::default(),
            folder,
            shard,
            dry_run,
        };
        let mut job = PlateJob::new(settings, progress)?;
        let plan = job.plan(progress)?;
        if dry_run {
            return Ok(serde_json::json!(plan));
        }
        job.run(progress).map(|printed| serde_json::json!(printed))
    })?;
    loaded(py, &told)
}
