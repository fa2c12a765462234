//! Point sources between Python's arrays and the library's clouds.

use crate::arrays::{array, handed, shown, values};
use crate::errors::{ends_with, refused};
use crate::run::run;
use glam::DVec3;
use holodrive::field::npy::Content;
use holodrive::points::{LitScene, PointCloud, PointSource, ScenePoints, clouds, ply};
use holodrive::units::show_length;
use numpy::{PyArray1, PyArray2, PyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Where points come from.
pub(crate) enum Source {
    /// A scene in its light, which may be looked at from other places, too.
    Scene { lit: Arc<LitScene>, points: Box<ScenePoints> },
    /// An array or a file.
    Cloud { cloud: PointCloud, metadata: ply::Metadata },
}

/// Point sources in the hologram frame: metres, +x right, +y up, +z towards the viewer, the panel at z = 0.
///
/// Behind the panel (z < 0) the wave of a point is a·exp(iφ)·exp(+ikr)/r, in front of it (z > 0) a·exp(iφ)·exp(-ikr)/r.
///
/// >>> import holodrive
/// >>> holodrive.Points([[0, 0, -0.1], [1e-3, 0, -0.12]], amplitudes=[1.0, 0.5])
/// <holodrive.Points 2 points, z -120mm … -100mm>
///
/// :param positions: array of shape (N, 3): x, y, z [m].
/// :param amplitudes: a of each point, shape (N,), or one for all.
/// :param phases: φ of each point [rad], shape (N,), or one for all.
/// :param rgb: amplitudes for red, green and blue, shape (N, 3), of a coloured cloud, instead of `amplitudes`.
#[pyclass(frozen, module = "holodrive")]
pub(crate) struct Points {
    pub(crate) source: Source,
    /// Where they come from, in words.
    pub(crate) origin: String,
}

impl Points {
    pub(crate) fn cloud(&self) -> &PointCloud {
        match &self.source {
            Source::Scene { points, .. } => &points.placed.cloud,
            Source::Cloud { cloud, .. } => cloud,
        }
    }

    /// Where they stand, for those who look at their field.
    pub(crate) fn content(&self) -> Content {
        match &self.source {
            Source::Scene { points, .. } => points.content(),
            Source::Cloud { cloud, metadata } => Content {
                depth: cloud.depth_range().map(|(far, near)| [near, far]),
                eye: metadata.eye,
                window: metadata.window,
                ..Content::default()
            },
        }
    }
}

/// One value for each of `count` points.
fn each(value: Option<&Bound<'_, PyAny>>, usual: f64, count: usize, name: &'static str) -> PyResult<Vec<f64>> {
    let Some(value) = value else { return Ok(vec![usual; count]) };
    let array = array(value)?;
    let given = values::<f64>(&array, name)?;
    match (array.shape(), given.as_slice()) {
        ([] | [1], [one]) => Ok(vec![*one; count]),
        ([own], _) if *own == count => Ok(given),
        (shape, _) => refused(value.py(), name, format!("shape {} for {count} points", shown(shape))),
    }
}

/// Triples of an array of shape (N, 3).
fn triples(value: &Bound<'_, PyAny>, name: &'static str) -> PyResult<Vec<[f64; 3]>> {
    let array = array(value)?;
    let [_, 3] = array.shape() else {
        return refused(value.py(), name, format!("shape {} is not (N, 3)", shown(array.shape())));
    };
    let flat = values::<f64>(&array, name)?;
    Ok(flat.as_chunks::<3>().0.to_vec())
}

#[pymethods]
impl Points {
    #[new]
    #[pyo3(signature = (positions, *, amplitudes = None, phases = None, rgb = None))]
    fn new(
        positions: &Bound<'_, PyAny>,
        amplitudes: Option<&Bound<'_, PyAny>>,
        phases: Option<&Bound<'_, PyAny>>,
        rgb: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let py = positions.py();
        let places = triples(positions, "positions")?;
        if amplitudes.is_some() && rgb.is_some() {
            return refused(py, "rgb", "a coloured cloud has no other amplitudes: give one or the other");
        }
        let amplitudes = each(amplitudes, 1.0, places.len(), "amplitudes")?;
        let phases = each(phases, 0.0, places.len(), "phases")?;
        let rgb = rgb.map(|rgb| triples(rgb, "rgb")).transpose()?;
        if let Some(rgb) = rgb.as_ref().filter(|rgb| rgb.len() != places.len()) {
            return refused(py, "rgb", format!("{} triples for {} points", rgb.len(), places.len()));
        }
        let point = |((place, amplitude), phase): ((&[f64; 3], &f64), &f64)| PointSource {
            position: DVec3::from_array(*place),
            amplitude: *amplitude as f32,
            phase: *phase,
        };
        let points: Vec<_> = places.iter().zip(&amplitudes).zip(&phases).map(point).collect();
        let finite = |p: &PointSource| p.position.is_finite() && p.amplitude.is_finite() && p.phase.is_finite();
        if let Some(index) = points.iter().position(|point| !finite(point)) {
            return refused(py, "points", format!("point {index} is not finite: {:?}", points[index]));
        }
        let rgb: Option<Vec<[f32; 3]>> = rgb.map(|rgb| rgb.iter().map(|triple| triple.map(|a| a as f32)).collect());
        if let Some(index) = rgb.iter().flatten().position(|triple| !triple.iter().all(|a| a.is_finite())) {
            return refused(py, "rgb", format!("that of point {index} is not finite"));
        }
        let mut cloud = PointCloud { points, rgb };
        if cloud.rgb.is_some() {
            cloud.points = cloud.channel(holodrive::points::Channel::Luminance);
        }
        let source = Source::Cloud { cloud, metadata: ply::Metadata::default() };
        Ok(Self { source, origin: "Python".into() })
    }

    /// Reads points of a cloud where they stand before the panel: .ply (holodrive's own, and OpenHolo's), .xyz, .csv, .pcd, .las.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = run(py, None, |_| clouds::read(&path))?;
        let source = Source::Cloud { cloud: read.cloud, metadata: read.metadata.unwrap_or_default() };
        Ok(Self { source, origin: path.display().to_string() })
    }

    /// Writes the points as binary .ply: double x y z, float amplitude (or amplitude_r, _g, _b), double phase.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        ends_with(py, &path, &["ply"])?;
        let (cloud, content) = (self.cloud(), self.content());
        let made = ply::Metadata {
            scene: self.origin.clone(),
            eye: content.eye,
            window: content.window,
            ..ply::Metadata::default()
        };
        let metadata = match &self.source {
            Source::Cloud { metadata, .. } if *metadata != ply::Metadata::default() => metadata,
            _ => &made,
        };
        run(py, None, |_| ply::write(&path, cloud, metadata))
    }

    fn __len__(&self) -> usize {
        self.cloud().points.len()
    }

    /// x, y, z of each point [m]: float64 of shape (N, 3), a copy.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = &self.cloud().points;
        let flat = points.iter().flat_map(|point| point.position.to_array()).collect();
        handed(py, (points.len(), 3), flat)
    }

    /// a of each point: float32 of shape (N,), a copy; that of the luminance in a coloured cloud.
    #[getter]
    fn amplitudes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let points = &self.cloud().points;
        handed(py, points.len(), points.iter().map(|point| point.amplitude).collect())
    }

    /// φ of each point [rad]: float64 of shape (N,), a copy.
    #[getter]
    fn phases<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let points = &self.cloud().points;
        handed(py, points.len(), points.iter().map(|point| point.phase).collect())
    }

    /// Amplitudes for red, green and blue: float32 of shape (N, 3), a copy; None where the cloud has no colours.
    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let Some(rgb) = &self.cloud().rgb else { return Ok(None) };
        handed(py, (rgb.len(), 3), rgb.as_flattened().to_vec()).map(Some)
    }

    /// Depths z of the nearest and the farthest point [m]; None without points.
    #[getter]
    fn depth(&self) -> Option<(f64, f64)> {
        self.cloud().depth_range().map(|(far, near)| (near, far))
    }

    /// The traced picture, linear radiance: float32 of shape (rows, columns, 3); None for points that are no scene's.
    #[getter]
    fn picture<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray3<f32>>>> {
        let Source::Scene { points, .. } = &self.source else { return Ok(None) };
        let view = &points.view;
        handed(py, (view.height, view.width, 3), view.picture.as_flattened().to_vec()).map(Some)
    }

    /// Depths worth focusing on by name ("near", "far", "mirror"), z [m]; empty for points that are no scene's.
    #[getter]
    fn focus(&self) -> std::collections::BTreeMap<String, f64> {
        match &self.source {
            Source::Scene { points, .. } => points.view.focus.iter().cloned().collect(),
            Source::Cloud { .. } => Default::default(),
        }
    }

    fn __repr__(&self) -> String {
        let count = self.cloud().points.len();
        let colours = if self.cloud().rgb.is_some() { " in colour" } else { "" };
        match self.cloud().depth_range() {
            Some((far, near)) => {
                let [far, near] = [far, near].map(show_length);
                format!("<holodrive.Points {count} points{colours}, z {far} … {near}>")
            }
            None => "<holodrive.Points none>".into(),
        }
    }
}
