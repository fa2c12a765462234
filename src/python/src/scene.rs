//! Scenes in their light, and the points that they become.

use crate::errors::refused;
use crate::panel::Panel;
use crate::points::{Points, Source};
use crate::quantities::{Angle, Length, named};
use crate::run::run;
use holodrive::illumination::IlluminationSettings;
use holodrive::pipeline;
use holodrive::points::budget::Budget;
use holodrive::points::placement::Phase;
use holodrive::points::{LitScene, Placement, SceneSettings, TraceSettings, WhitePoint};
use holodrive::scene::environment::{Panorama, Sky};
use holodrive::scene::gltf::{Choice, Clip, File, LoadOptions};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use std::path::PathBuf;
use std::sync::Arc;

/// A scene and the light on its surfaces: ready to be seen.
///
/// Made by :meth:`Scene.load`.
#[pyclass(frozen, module = "holodrive")]
pub(crate) struct Scene {
    lit: Arc<LitScene>,
    path: PathBuf,
    settings: SceneSettings,
}

/// A camera or clip, by its name or its number.
#[derive(FromPyObject)]
pub(crate) enum Which {
    Number(usize),
    Name(String),
}

impl From<Which> for Choice {
    fn from(which: Which) -> Self {
        match which {
            Which::Number(number) => Self::Index(number),
            Which::Name(name) => Self::Name(name),
        }
    }
}

/// How many points: a number, or what is resolved.
#[derive(FromPyObject)]
pub(crate) enum Count {
    Number(usize),
    By(String),
}

/// White: a radiance, or how it is found.
#[derive(FromPyObject)]
pub(crate) enum White {
    At(f32),
    By(String),
}

/// What scenes are read and lit with.
struct Asked {
    camera: Option<Which>,
    animation: Option<Which>,
    time: f64,
    environment: Option<PathBuf>,
    sky: Option<(Angle, Angle)>,
    viewer_light: bool,
    bounces: u32,
    photons: Option<u32>,
    seed: u64,
}

impl Asked {
    fn settings(self) -> SceneSettings {
        let Self { camera, animation, time, environment, sky, viewer_light, bounces, photons, seed } = self;
        let usual = IlluminationSettings::default();
        SceneSettings {
            load: LoadOptions {
                camera: camera.map(Choice::from),
                clip: animation.map_or(Clip::First, |clip| Clip::Of(clip.into())),
                time,
                viewer_light,
                environment: environment.map(|path| Panorama { path, strength: 1.0, turn: 0.0 }),
                sky: sky.map(|(elevation, azimuth)| Sky::clear(elevation.0, azimuth.0)),
                ..LoadOptions::default()
            },
            illumination: IlluminationSettings { bounces, photons: photons.unwrap_or(usual.photons), seed, ..usual },
            trace: TraceSettings { bounces, seed, ..TraceSettings::default() },
            phase: Phase::Random { seed },
            ..SceneSettings::default()
        }
    }
}

impl Scene {
    /// The scene's points before a panel with these settings.
    pub(crate) fn placed(
        &self,
        py: Python<'_>,
        settings: SceneSettings,
        panel: &Panel,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Points> {
        let (lit, setup) = (&self.lit, &panel.setup);
        let points = run(py, progress, |progress| pipeline::points(lit, &settings, setup, progress))?;
        Ok(Points {
            source: Source::Scene { lit: Arc::clone(&self.lit), points: Box::new(points) },
            origin: self.path.display().to_string(),
        })
    }

    /// Its points as they are made where nothing is said.
    pub(crate) fn usual(&self, py: Python<'_>, panel: &Panel, progress: Option<&Bound<'_, PyAny>>) -> PyResult<Points> {
        self.placed(py, SceneSettings { white: WhitePoint::Auto, ..self.settings.clone() }, panel, progress)
    }
}

#[pymethods]
impl Scene {
    /// Reads a scene (.gltf, .glb, .obj, .stl) and lights it by radiosity, mirror images of lamps, and photons.
    ///
    /// :param path: the file.
    /// :param camera: name or number of the camera; by default the first.
    /// :param animation: name or number of the clip that poses it; by default the first.
    /// :param time: time in the clip [s].
    /// :param environment: panorama (.hdr, .exr, picture) that lights it from all around.
    /// :param sky: the sun's (elevation, azimuth from +x towards +z) [rad, or text such as "35deg"]: sun and sky instead of that.
    /// :param viewer_light: adds light from the viewer to the file's own.
    /// :param bounces: most mirrors or glass surfaces on one path.
    /// :param photons: photons by way of curved mirrors and glass; by default as the program does.
    /// :param seed: seed of all sampling.
    /// :param progress: see :func:`hologram`.
    #[staticmethod]
    #[pyo3(signature = (
        path, *, camera = None, animation = None, time = 0.0, environment = None, sky = None, viewer_light = false, bounces = 32,
        photons = None, seed = 1, progress = None
    ))]
    #[expect(clippy::too_many_arguments)] // Python's keywords
    fn load(
        py: Python<'_>,
        path: PathBuf,
        camera: Option<Which>,
        animation: Option<Which>,
        time: f64,
        environment: Option<PathBuf>,
        sky: Option<(Angle, Angle)>,
        viewer_light: bool,
        bounces: u32,
        photons: Option<u32>,
        seed: u64,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let asked = Asked { camera, animation, time, environment, sky, viewer_light, bounces, photons, seed };
        let settings = asked.settings();
        let lit = run(py, progress, |progress| pipeline::scene(&path, &settings, progress))?;
        Ok(Self { lit: Arc::new(lit), path, settings })
    }

    /// Reads a scene from the bytes of a .glb or .gltf that holds all it needs, and lights it.
    ///
    /// >>> import holodrive
    /// >>> holodrive.Scene.from_bytes(b"glTF")
    /// Traceback (most recent call last):
    ///     ...
    /// holodrive._errors.InputError: bytes: ...
    ///
    /// :param data: the file's bytes: buffers and pictures in the binary chunk of a .glb, or in data URIs.
    /// :param name: stands in errors and in what is made of it.
    /// :param camera: as in :meth:`load`, like all that follow.
    /// :param animation: name or number of the clip that poses it.
    /// :param time: time in the clip [s].
    /// :param environment: panorama (.hdr, .exr, picture) that lights it from all around.
    /// :param sky: the sun's (elevation, azimuth from +x towards +z) [rad, or text such as "35deg"]: sun and sky instead of that.
    /// :param viewer_light: adds light from the viewer to the file's own.
    /// :param bounces: most mirrors or glass surfaces on one path.
    /// :param photons: photons by way of curved mirrors and glass.
    /// :param seed: seed of all sampling.
    /// :param progress: see :func:`hologram`.
    #[staticmethod]
    #[pyo3(signature = (
        data, *, name = "bytes", camera = None, animation = None, time = 0.0, environment = None, sky = None, viewer_light = false,
        bounces = 32, photons = None, seed = 1, progress = None
    ))]
    #[expect(clippy::too_many_arguments)] // Python's keywords
    fn from_bytes(
        py: Python<'_>,
        data: PyBackedBytes,
        name: &str,
        camera: Option<Which>,
        animation: Option<Which>,
        time: f64,
        environment: Option<PathBuf>,
        sky: Option<(Angle, Angle)>,
        viewer_light: bool,
        bounces: u32,
        photons: Option<u32>,
        seed: u64,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let asked = Asked { camera, animation, time, environment, sky, viewer_light, bounces, photons, seed };
        let (settings, path) = (asked.settings(), PathBuf::from(name));
        let lit = run(py, progress, |progress| {
            progress.start("scene", 0);
            let loaded = File::of_bytes(&path, &data)?.pose(&settings.load)?;
            LitScene::new(&path, loaded, settings.illumination, progress)
        })?;
        Ok(Self { lit: Arc::new(lit), path, settings })
    }

    /// The scene's light as point sources before a panel.
    ///
    /// :param panel: the :class:`Panel`.
    /// :param rays: (columns, rows) of rays through the picture.
    /// :param points: about so many points instead, or "eye" or "panel": what these resolve.
    /// :param placement: "window" (the camera's picture seen through the panel) or "model" (a miniature).
    /// :param viewer: distance of the viewer's eye before the panel [m].
    /// :param near: where the nearest point stands, z [m]; negative is behind the panel.
    /// :param far: where the farthest point stands, z [m]; of a model, `near` is its middle and `far` has no use.
    /// :param scale: hologram metres for one metre of a model; by default it fits the panel's view.
    /// :param phase: "random", "zero" or "path".
    /// :param white: "auto" clips light that is brighter than a picture's white, "none" keeps all, a number is white's radiance.
    /// :param seed: seed of the rays and phases; by default the scene's.
    /// :param progress: see :func:`hologram`.
    /// :return: :class:`Points`.
    #[pyo3(signature = (
        panel, *, rays = (500, 500), points = None, placement = "window", viewer = Length(0.6), near = None, far = None,
        scale = None, phase = "random", white = None, seed = None, progress = None
    ))]
    #[expect(clippy::too_many_arguments)] // Python's keywords
    fn points(
        &self,
        py: Python<'_>,
        panel: &Bound<'_, Panel>,
        rays: (u32, u32),
        points: Option<Count>,
        placement: &str,
        viewer: Length,
        near: Option<Length>,
        far: Option<Length>,
        scale: Option<f64>,
        phase: &str,
        white: Option<White>,
        seed: Option<u64>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Points> {
        let eye = viewer.0;
        let placement = match placement {
            "window" if scale.is_some() => return refused(py, "scale", "is for placement=\"model\""),
            "model" if far.is_some() => return refused(py, "far", "is for placement=\"window\""),
            "window" => Placement::Window { eye, near: near.map_or(-0.1, |z| z.0), far: far.map_or(-0.15, |z| z.0) },
            "model" => Placement::Model { eye, z: near.map_or(-0.125, |z| z.0), scale },
            other => return refused(py, "placement", format!("there is no `{other}`; one of window, model")),
        };
        let seed = seed.unwrap_or(self.settings.trace.seed);
        let settings = SceneSettings {
            trace: TraceSettings { width: rays.0, height: rays.1, seed, ..self.settings.trace },
            points: match points {
                None => None,
                Some(Count::Number(count)) => Some(Budget::Points(count)),
                Some(Count::By(by)) if by == "eye" => Some(Budget::Eye),
                Some(Count::By(by)) if by == "panel" => Some(Budget::Panel),
                Some(Count::By(other)) => {
                    return refused(py, "points", format!("`{other}` is no number, nor \"eye\" or \"panel\""));
                }
            },
            placement,
            phase: match named(py, phase)? {
                Phase::Random { .. } => Phase::Random { seed },
                other => other,
            },
            white: match white {
                None => WhitePoint::Auto,
                Some(White::At(white)) => WhitePoint::At(white),
                Some(White::By(by)) if by == "auto" => WhitePoint::Auto,
                Some(White::By(by)) if by == "none" => WhitePoint::Unlimited,
                Some(White::By(other)) => {
                    return refused(py, "white", format!("`{other}` is no radiance, nor \"auto\" or \"none\""));
                }
            },
            ..self.settings.clone()
        };
        if rays.0 == 0 || rays.1 == 0 {
            return refused(py, "rays", format!("{} × {}: at least one ray each way", rays.0, rays.1));
        }
        self.placed(py, settings, panel.get(), progress)
    }

    /// Number of triangles.
    #[getter]
    fn triangles(&self) -> usize {
        self.lit.scene().triangles.len()
    }

    /// Corners of the box round all of it in its own metres, (low, high), each (x, y, z) [m]; None without any.
    #[getter]
    fn bounds(&self) -> Option<([f64; 3], [f64; 3])> {
        self.lit.scene().bounds().map(|(low, high)| (low.to_array(), high.to_array()))
    }

    fn __repr__(&self) -> String {
        let scene = self.lit.scene();
        format!(
            "<holodrive.Scene {}: {} triangles, {} materials, {} lamps>",
            self.path.display(),
            scene.triangles.len(),
            scene.materials.len(),
            scene.lights.len()
        )
    }
}
