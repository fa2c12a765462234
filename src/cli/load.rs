//! What kind of file an input is, and the points of those that have some.

use super::light::{report_cloud, report_light, report_map};
use super::report::Report;
use crate::field::arrays;
use crate::field::npy::Content;
use crate::light_field::LightField;
use crate::panel::Setup;
use crate::pipeline;
use crate::points::depth_map::DepthReading;
use crate::points::images::RgbDepth;
use crate::points::placement::Phase;
use crate::points::{Axes, LitScene, Placement, PointCloud, Reach, ScenePoints, SceneSettings, clouds, images, ply};
use crate::progress::Progress;
use crate::scene::gltf;
use crate::units;
use crate::{Error, Result};
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What kind of file an input is, by its name.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Input {
    Scene(PathBuf),
    Points(PathBuf),
    Images(PathBuf, PathBuf),
    /// Pictures and their depths z [m].
    Stack(Vec<(PathBuf, f64)>),
    Field(PathBuf),
    /// A light field.
    Views(PathBuf),
    Frame(PathBuf),
}

/// Pictures by their endings.
const PICTURES: [&str; 6] = ["png", "jpg", "jpeg", "bmp", "tif", "tiff"];
/// Depth maps that are no pictures.
const DEPTHS: [&str; 5] = ["npy", "pfm", "dpt", "npz", "exr"];

fn ending(path: &str) -> String {
    Path::new(path).extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

pub(super) fn input(path: &Path) -> Result<Input> {
    let text = path.to_string_lossy();
    if !path.exists()
        && let Some((rgb, depth)) = text.split_once('+')
        && PICTURES.contains(&ending(rgb).as_str())
        && (PICTURES.contains(&ending(depth).as_str()) || DEPTHS.contains(&ending(depth).as_str()))
    {
        return Ok(Input::Images(rgb.into(), depth.into()));
    }
    if !path.exists() && text.contains('@') {
        return stack(&text);
    }
    if LightField::is_folder(path) {
        return Ok(Input::Views(path.into()));
    }
    // What stands behind a colon is the name of an array in the file.
    let (file, name) = arrays::split(path);
    let found = match ending(&file.to_string_lossy()).as_str() {
        _ if gltf::is_scene(path) => Input::Scene(path.into()),
        _ if clouds::is_cloud(path) => Input::Points(path.into()),
        "npy" | "mat" | "h5" | "hdf5" | "hdf" => Input::Field(path.into()),
        "npz" if name.is_some() || !arrays::npz_holds(&file, "views") => Input::Field(path.into()),
        "npz" => Input::Views(path.into()),
        "tif" | "tiff" if arrays::is_float_tiff(path) => Input::Field(path.into()),
        ending if PICTURES.contains(&ending) => Input::Frame(path.into()),
        _ => {
            let what = "not a kind of file that is read here: .gltf, .glb, .obj, .stl; .ply, .xyz, .csv, .pcd, .las; .npy, .npz, .mat, .h5; \
                        .png, .bmp, .tif, .jpg; or rgb.png+depth.png";
            return Err(Error::input(path, gltf::not_embedded(path).unwrap_or_else(|| what.into())));
        }
    };
    if gltf::embedded(path).is_some() {
        return Ok(found);
    }
    // Found out before an output folder is made.
    std::fs::File::open(&file).map_err(Error::io(&file))?;
    Ok(found)
}

/// `near.png@-100mm+far.png@-150mm`.
fn stack(text: &str) -> Result<Input> {
    let one = |part: &str| {
        let (path, depth) = part.rsplit_once('@').ok_or_else(|| {
            let what = format!("`{part}` has no depth; write near.png@-100mm+far.png@-150mm");
            Error::parameter("focal stack", what)
        })?;
        let z = units::length(depth).map_err(|why| Error::parameter("focal stack", format!("{path}: {why}")))?;
        Ok((PathBuf::from(path), z))
    };
    text.split('+').map(one).collect::<Result<_>>().map(Input::Stack)
}

/// How inputs that are no scenes are read.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reading {
    pub(super) depth: DepthReading,
    /// Where a cloud is placed; none: where its file says.
    pub(super) placement: Option<Placement>,
    /// A cloud's axes that were typed.
    pub(super) axes: Option<Axes>,
    /// Whether a cloud's phases are those that were typed.
    pub(super) is_phase_typed: bool,
    /// Distance of the viewer's eye [m].
    pub(super) viewer: f64,
}

/// Points with what is known of them.
pub(super) struct Points {
    pub(super) cloud: PointCloud,
    pub(super) metadata: ply::Metadata,
    /// The scene in its light, and as points.
    pub(super) scene: Option<(LitScene, ScenePoints)>,
    /// Eye to which the phases are those of paths, if they are.
    pub(super) path_eye: Option<DVec3>,
}

impl Points {
    /// Where they stand, for the reconstructions to come.
    pub(super) fn content(&self) -> Content {
        Content {
            z: 0.0,
            depth: self.cloud.depth_range().map(|(far, near)| [near, far]),
            eye: self.metadata.eye,
            window: self.metadata.window,
        }
    }

    /// Points of a scene, a cloud or a picture with depth.
    pub(super) fn load(
        input: &Input,
        settings: &SceneSettings,
        reading: &Reading,
        setup: &Setup,
        progress: &Progress,
        report: &mut Report,
    ) -> Result<Self> {
        if settings.points.is_some() && !matches!(input, Input::Scene(_)) {
            let what = "a number of points is for scenes; this input has the points it has";
            return Err(Error::parameter("points", what));
        }
        let begin = Instant::now();
        let points = match input {
            Input::Scene(path) => {
                let lit = pipeline::scene(path, settings, progress)?;
                let scene = pipeline::points(&lit, settings, setup, progress)?;
                report_light(&scene, begin.elapsed().as_secs_f64(), report);
                return Ok(Self::of_scene(path, lit, scene, settings.phase));
            }
            Input::Points(path) => Self::read(path, reading, settings, setup, report)?,
            Input::Images(rgb, depth) => {
                let seed = match settings.phase {
                    Phase::Zero => None,
                    Phase::Random { seed } => Some(seed),
                    Phase::Path => {
                        let what = "path is for scenes; use zero or random with a picture";
                        return Err(Error::parameter("phase", what));
                    }
                };
                let picture = RgbDepth::read(rgb, depth, &reading.depth, &settings.placement)?;
                report_map(&picture.map, report);
                let cloud = images::points(&picture, &settings.placement, seed, &setup.grid)?;
                let metadata = ply::Metadata { scene: rgb.display().to_string(), ..ply::Metadata::default() };
                Self { cloud, metadata, scene: None, path_eye: None }
            }
            Input::Stack(_) => {
                let what = "a focal stack has no points; `compute` takes it, and `encode` and `reconstruct` its field";
                return Err(Error::parameter("input", what));
            }
            Input::Field(path) | Input::Frame(path) | Input::Views(path) => {
                let what = "is no scene, point cloud or picture with depth (rgb.png+depth.png)";
                return Err(Error::input(path, what));
            }
        };
        report_cloud(&points.cloud, begin.elapsed().as_secs_f64(), report);
        Ok(points)
    }

    fn of_scene(path: &Path, lit: LitScene, scene: ScenePoints, phase: Phase) -> Self {
        let placing = &scene.view.placing;
        let metadata = ply::Metadata {
            frame: ply::Frame::Hologram,
            scene: path.display().to_string(),
            eye: Some(placing.eye.to_array()),
            window: Some(placing.window.to_array()),
            rays: Some([scene.view.width, scene.view.height]),
            phase: format!("{phase:?}"),
        };
        let path_eye = scene.path_eye(phase);
        Self { cloud: scene.placed.cloud.clone(), metadata, scene: Some((lit, scene)), path_eye }
    }

    /// A cloud where its file says, or where it is placed.
    fn read(
        path: &Path,
        reading: &Reading,
        settings: &SceneSettings,
        setup: &Setup,
        report: &mut Report,
    ) -> Result<Self> {
        let phase = settings.phase;
        // A scene's own metres are placed as a scene is.
        let placement = reading.placement.as_ref().or(gltf::has_only_points(path).then_some(&settings.placement));
        let read = clouds::read(path)?;
        report.warn(read.warnings.iter().map(|w| format!("{}: {w}", path.display())));
        if !read.origin.is_empty() {
            report.add("read", &read.origin, format!("{:<12} {}", "read", read.origin));
        }
        let (mut cloud, mut metadata) = (read.cloud, read.metadata.unwrap_or_default());
        // Points that stand where their file says are turned only if that was asked for.
        if let Some(axes) = reading.axes.or(read.axes.filter(|_| placement.is_some())) {
            axes.turn(&mut cloud);
            let mirrored = if axes.mirrors() { " (mirrored)" } else { "" };
            let said = format!("{axes}{mirrored}");
            report.add("axes", &said, format!("{:<12} {said}", "axes"));
        }
        if metadata.frame == ply::Frame::World && placement.is_none() {
            let what = "its points stand in the scene's own metres; write them with --frame hologram, or place them by \
                        --placement model";
            return Err(Error::input(path, what));
        }
        if cloud.points.is_empty() {
            return Err(Error::input(path, "has no points"));
        }
        if cloud.points.iter().all(|p| p.amplitude == 0.0) {
            return Err(Error::input(path, "all its points are dark: no amplitude is above zero"));
        }
        let mut path_eye =
            metadata.eye.filter(|_| metadata.phase == format!("{:?}", Phase::Path)).map(DVec3::from_array);
        if let Some(placement) = placement {
            let placed =
                placement.place_cloud(&mut cloud, &setup.grid).map_err(|e| Error::input(path, e.to_string()))?;
            let said = placed.to_string();
            report.add("placed", &said, format!("{:<12} {said}", "placed"));
            metadata = ply::Metadata {
                frame: ply::Frame::Hologram,
                eye: Some(placed.eye.to_array()),
                window: Some(placed.window.to_array()),
                ..metadata
            };
            path_eye = None;
        }
        if reading.is_phase_typed {
            let eye = DVec3::new(0.0, 0.0, reading.viewer);
            for (index, point) in cloud.points.iter_mut().enumerate() {
                point.phase = phase.of(index, (eye - point.position).length(), setup.wavelength);
            }
            path_eye = (phase == Phase::Path).then_some(eye);
            metadata.phase = format!("{phase:?}");
        }
        let reach = Reach::of(&cloud, &setup.grid, setup.wavelength);
        if reach.reaching == 0 {
            let what = format!("{reach}; place them by --placement model --distance -150mm, or --scale (see --help)");
            return Err(Error::input(path, what));
        }
        if reach.reaching < cloud.points.len() {
            report.warn([format!("{}: {reach}", path.display())]);
        }
        Ok(Self { cloud, metadata, scene: None, path_eye })
    }
}
