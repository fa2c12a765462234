//! Light fields: what an eye anywhere in its box should see.

use crate::arrays::{array, handed, lent, shown, values};
use crate::errors::{Raise, refused};
use crate::panel::Panel;
use crate::points::{Points, Source};
use crate::quantities::{Length, Lengths, Place, Three, named};
use crate::run::run;
use crate::scene::Scene;
use glam::{DVec2, DVec3};
use holodrive::field::Grid;
use holodrive::light_field::{EyeGrid, LightSource, Pupil, Viewer};
use holodrive::panel::Setup;
use holodrive::pipeline::{self, Settings};
use holodrive::points::Channel;
use holodrive::progress::Progress;
use holodrive::units::show_length;
use numpy::{PyArray2, PyArray4, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyString;
use std::path::PathBuf;

/// What a pupil takes in: a diameter, or "all".
#[derive(Clone, Copy)]
pub(crate) struct PupilGiven(pub(crate) Pupil);

impl<'py> FromPyObject<'_, 'py> for PupilGiven {
    type Error = PyErr;
    fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match value.cast::<PyString>() {
            Ok(text) if text.to_string_lossy() == "all" => Ok(Self(Pupil::All)),
            _ => value.extract::<Length>().map(|diameter| Self(Pupil::Diameter(diameter.0))),
        }
    }
}

/// Who looks, as it was given.
#[derive(Clone, Copy)]
pub(crate) struct Looking {
    pub(crate) eye: Option<Place>,
    pub(crate) pupil: Option<PupilGiven>,
    pub(crate) eye_box: Option<Lengths>,
}

impl Looking {
    /// The viewer; where nothing is said, 0.6 m before the panel, or in the middle of the views that there are.
    pub(crate) fn viewer(self, views: Option<&LightField>) -> Viewer {
        let mut viewer = Viewer::default();
        if let Some(views) = views {
            viewer.eye = views.light.eyes.center.extend(views.light.eyes.distance);
        }
        viewer.eye = self.eye.map_or(viewer.eye, |eye| eye.0);
        viewer.pupil = self.pupil.map_or(viewer.pupil, |pupil| pupil.0);
        viewer.eye_box = self.eye_box.map_or(viewer.eye_box, Lengths::vector);
        viewer
    }
}

/// Pinhole views of a lit scene over an eye box: what an eye should see, and what every encoding is judged by.
///
/// Made by :func:`light_field`, read by :meth:`LightField.load`, or of any renderer's views:
///
/// >>> import holodrive, numpy as np
/// >>> holodrive.LightField(np.full((9, 9, 40, 60), 0.5), eye=(0, 0, 0.6), spacing="0.5mm", window=("4mm", "3mm"), depth=(-0.1, -0.15))
/// <holodrive.LightField 9 × 9 views of 60 × 40 px, 600mm before the panel, z -150mm … -100mm>
///
/// :param views: linear radiance over white's (1 is shown as white), shape (eye rows, eye columns, rows, columns), for light in
///     colour (eye rows, eye columns, rows, columns, 3); row 0 is the highest eye, and the top of a view.
/// :param eye: middle of the eye points (x, y, z) [m].
/// :param spacing: distance of neighbouring eye points [m], at most 0.5 mm for smooth pictures.
/// :param window: width and height of each view on the panel's plane [m], centred on the panel.
/// :param depth: depths z of the nearest and farthest light [m].
#[pyclass(frozen, module = "holodrive")]
pub(crate) struct LightField {
    pub(crate) light: holodrive::light_field::LightField,
}

#[pymethods]
impl LightField {
    #[new]
    #[pyo3(signature = (views, *, eye, spacing, window, depth))]
    fn new(
        views: &Bound<'_, PyAny>,
        eye: Place,
        spacing: Length,
        window: Lengths,
        depth: (Length, Length),
    ) -> PyResult<Self> {
        let py = views.py();
        let views = array(views)?;
        let (size, channels) = match *views.shape() {
            [rows, columns, height, width] => ([rows, columns, height, width], 1),
            [rows, columns, height, width, 3] => ([rows, columns, height, width], 3),
            ref other => {
                let what = format!("shape {} is not (eye rows, eye columns, rows, columns[, 3])", shown(other));
                return refused(py, "views", what);
            }
        };
        let [rows, columns, height, width] = size;
        let values = values::<f32>(&views, "views")?;
        if !values.iter().all(|v| v.is_finite() && *v >= 0.0) {
            return refused(py, "views", "radiance must be finite and not negative");
        }
        let [across, down] = window.0;
        let light = py.detach(|| {
            let window = Grid::new(width, height, across / width.max(1) as f64, down / height.max(1) as f64)?;
            let (distance, center) = (eye.0.z, eye.0.truncate());
            let eyes = EyeGrid { distance, center, spacing: spacing.0, columns, rows };
            let mut light = holodrive::light_field::LightField::black(eyes, window, channels)?;
            light.peak = values.iter().copied().fold(1.0, f32::max);
            light.depth = [depth.0.0, depth.1.0];
            let peak = light.peak;
            for (channel, codes) in light.channels.iter_mut().enumerate() {
                for (code, pixel) in codes.iter_mut().zip(values.chunks_exact(channels)) {
                    *code = holodrive::light_field::LightField::code(pixel[channel], peak);
                }
            }
            Ok(light)
        });
        Ok(Self { light: light.raise(py)? })
    }

    /// Reads views of a file (.npz) or a folder of pictures, as the program's `views` writes them.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        run(py, None, |_| holodrive::light_field::LightField::read(&path)).map(|light| Self { light })
    }

    /// Writes the views as .npz, or as a folder of pictures.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let light = &self.light;
        run(py, None, |_| light.write(&path))
    }

    /// (eye rows, eye columns, rows, columns).
    #[getter]
    fn shape(&self) -> (usize, usize, usize, usize) {
        let (eyes, window) = (&self.light.eyes, &self.light.window);
        (eyes.rows, eyes.columns, window.height, window.width)
    }

    /// Channels: 1, or 3 for linear red, green and blue.
    #[getter]
    fn channels(&self) -> usize {
        self.light.channels.len()
    }

    /// Middle of the eye points (x, y, z) [m].
    #[getter]
    fn eye(&self) -> (f64, f64, f64) {
        self.light.eyes.center.extend(self.light.eyes.distance).into()
    }

    /// Distance of neighbouring eye points [m].
    #[getter]
    fn spacing(&self) -> f64 {
        self.light.eyes.spacing
    }

    /// Width and height of a view on the panel's plane [m].
    #[getter]
    fn window(&self) -> (f64, f64) {
        (self.light.window.extent_x(), self.light.window.extent_y())
    }

    /// Depths z of the nearest and farthest light [m].
    #[getter]
    fn depth(&self) -> (f64, f64) {
        self.light.depth.into()
    }

    /// Radiance over white's of the largest code.
    #[getter]
    fn peak(&self) -> f32 {
        self.light.peak
    }

    /// One channel of all views as it is kept: uint16 of shape (eye rows, eye columns, rows, columns), a view that cannot be
    /// written. Radiance over white's is ``peak * (codes / 65535) ** 2``.
    #[pyo3(signature = (channel = 0))]
    fn codes<'py>(this: &Bound<'py, Self>, channel: usize) -> PyResult<Bound<'py, PyArray4<u16>>> {
        let own = this.get();
        let Some(codes) = own.light.channels.get(channel) else {
            return refused(this.py(), "channel", format!("{channel}: there are {}", own.channels()));
        };
        lent(this.clone().into_any(), own.shape(), codes)
    }

    /// One view: linear radiance over white's, float32 of shape (rows, columns).
    ///
    /// :param row: of its eye point, 0 the highest; by default the middle.
    /// :param column: of its eye point; by default the middle.
    /// :param channel: 0, or 0 to 2 in colour.
    #[pyo3(signature = (row = None, column = None, *, channel = 0))]
    fn view<'py>(
        &self,
        py: Python<'py>,
        row: Option<usize>,
        column: Option<usize>,
        channel: usize,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let light = &self.light;
        let (row, column) = (row.unwrap_or(light.eyes.rows / 2), column.unwrap_or(light.eyes.columns / 2));
        if row >= light.eyes.rows || column >= light.eyes.columns || channel >= light.channels.len() {
            let (rows, columns, ..) = self.shape();
            let what =
                format!("row {row}, column {column}, channel {channel} of {rows} × {columns} × {}", self.channels());
            return refused(py, "view", what);
        }
        let codes = light.view(channel, row * light.eyes.columns + column);
        let radiance = codes.iter().map(|&code| light.radiance(code)).collect();
        handed(py, (light.window.height, light.window.width), radiance)
    }

    fn __repr__(&self) -> String {
        let (rows, columns, height, width) = self.shape();
        let [near, far] = self.light.depth.map(show_length);
        let colour = if self.channels() == 3 { " in colour" } else { "" };
        format!(
            "<holodrive.LightField {columns} × {rows} views of {width} × {height} px{colour}, {} before the panel, z {far} … {near}>",
            show_length(self.light.eyes.distance)
        )
    }
}

/// What can be looked at.
pub(crate) enum Content<'py> {
    Points(Bound<'py, Points>),
    Views(Bound<'py, LightField>),
}

impl<'py> Content<'py> {
    /// A scene becomes points as usual; none for anything else than a scene, points or views.
    pub(crate) fn of(
        value: &Bound<'py, PyAny>,
        panel: &Panel,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Option<Self>> {
        let py = value.py();
        if let Ok(scene) = value.cast::<Scene>() {
            let points = scene.get().usual(py, panel, progress)?;
            return Ok(Some(Self::Points(Bound::new(py, points)?)));
        }
        if let Ok(points) = value.cast::<Points>() {
            return Ok(Some(Self::Points(points.clone())));
        }
        Ok(value.cast::<LightField>().ok().map(|light| Self::Views(light.clone())))
    }

    pub(crate) fn views(&self) -> Option<&LightField> {
        match self {
            Self::Views(light) => Some(light.get()),
            Self::Points(_) => None,
        }
    }

    /// The library's view of it, which does not need the interpreter.
    pub(crate) fn source(&self, viewer: &Viewer) -> LightSource<'_> {
        match self {
            Self::Views(light) => LightSource::Views(&light.get().light),
            Self::Points(points) => match &points.get().source {
                Source::Scene { lit, points } => LightSource::Scene { lit, points },
                Source::Cloud { cloud, metadata } => {
                    let eye = metadata.eye.map_or(viewer.eye, DVec3::from_array);
                    LightSource::Cloud { cloud, eye }
                }
            },
        }
    }
}

/// The views that a viewer takes in, on the lattice that the panel's pictures have.
pub(crate) fn views(
    source: &LightSource,
    setup: &Setup,
    viewer: Viewer,
    channel: Channel,
    progress: &Progress,
) -> holodrive::Result<holodrive::light_field::LightField> {
    let settings = Settings { viewer, channel, ..Settings::default() };
    Ok(pipeline::light_field(source, setup, &settings, progress)?.0)
}

/// What an eye anywhere in its box should see of a scene (or of points) through a panel.
///
/// :param source: a :class:`Scene`, :class:`Points`, or a :class:`LightField` that is brought onto this panel's lattice.
/// :param panel: the :class:`Panel`.
/// :param eye: middle of the eye box (x, y, z) [m]; by default (0, 0, 0.6).
/// :param pupil: diameter of the pupil [m], by default 4 mm, or "all" for all of the panel's light.
/// :param eye_box: width and height of the box that the pupil's middle moves in [m].
/// :param channel: "luminance", "red", "green" or "blue".
/// :param wavelengths: of three lasers [m], or "panel", for views in colour, as in :func:`hologram`.
/// :param progress: see :func:`hologram`.
/// :return: :class:`LightField`.
#[pyfunction]
#[pyo3(signature = (
    source, panel, *, eye = None, pupil = None, eye_box = None, channel = "luminance", wavelengths = None, progress = None
))]
#[expect(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn light_field(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    panel: &Bound<'_, Panel>,
    eye: Option<Place>,
    pupil: Option<PupilGiven>,
    eye_box: Option<Lengths>,
    channel: &str,
    wavelengths: Option<Three>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<LightField> {
    if wavelengths.is_some() && channel != "luminance" {
        return refused(py, "channel", "is of one laser: leave out wavelengths");
    }
    let Some(content) = Content::of(source, panel.get(), progress)? else {
        return refused(py, "source", "is no Scene, Points or LightField");
    };
    let viewer = Looking { eye, pupil, eye_box }.viewer(content.views());
    let setup = &panel.get().setup;
    let setup = &wavelengths.map_or_else(|| Ok(setup.clone()), |three| three.light(py, setup))?;
    let (source, channel) = (content.source(&viewer), named(py, channel)?);
    run(py, progress, |progress| views(&source, setup, viewer, channel, progress)).map(|light| LightField { light })
}

/// Half of a width and a height.
pub(crate) fn half_of(window: Lengths) -> DVec2 {
    0.5 * window.vector()
}
