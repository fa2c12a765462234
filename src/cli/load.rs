//! What kind of file an input is, and the points of those that have some.

use super::light::{report_cloud, report_light};
use super::report::Report;
use glam::DVec3;
use holodrive::field::npy::Content;
use holodrive::panel::Setup;
use holodrive::pipeline;
use holodrive::points::images::DepthScale;
use holodrive::points::placement::Phase;
use holodrive::points::{PointCloud, ScenePoints, SceneSettings, images, ply};
use holodrive::progress::Progress;
use holodrive::units;
use holodrive::{Error, Result};
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
    Frame(PathBuf),
}

pub(super) fn input(path: &Path) -> Result<Input> {
    let text = path.to_string_lossy();
    let pictures = [".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff"];
    if !path.exists()
        && let Some((rgb, depth)) = text.split_once('+')
        && [rgb, depth].iter().all(|p| pictures.iter().any(|e| p.to_lowercase().ends_with(e)))
    {
        return Ok(Input::Images(rgb.into(), depth.into()));
    }
    if !path.exists() && text.contains('@') {
        return stack(&text);
    }
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let found = match extension.as_str() {
        "gltf" | "glb" => Input::Scene(path.into()),
        "ply" => Input::Points(path.into()),
        "npy" => Input::Field(path.into()),
        "png" | "bmp" => Input::Frame(path.into()),
        _ => {
            let what =
                "not a kind of file that is read here: .gltf, .glb, .ply, .npy, .png, .bmp, or rgb.png+depth.png";
            return Err(Error::input(path, what));
        }
    };
    // Found out before an output folder is made.
    std::fs::File::open(path).map_err(Error::io(path))?;
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

/// Points with what is known of them.
pub(super) struct Points {
    pub(super) cloud: PointCloud,
    pub(super) metadata: ply::Metadata,
    pub(super) scene: Option<ScenePoints>,
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
        depth_scale: DepthScale,
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
                let scene = pipeline::points(path, settings, setup, progress)?;
                report_light(&scene, begin.elapsed().as_secs_f64(), report);
                return Ok(Self::of_scene(path, scene, settings.phase));
            }
            Input::Points(path) => Self::read(path, report)?,
            Input::Images(rgb, depth) => {
                let seed = match settings.phase {
                    Phase::Zero => None,
                    Phase::Random { seed } => Some(seed),
                    Phase::Path => {
                        let what = "path is for scenes; use zero or random with a picture";
                        return Err(Error::parameter("phase", what));
                    }
                };
                let cloud = images::read(rgb, depth, depth_scale, &settings.placement, seed, &setup.grid)?;
                let metadata = ply::Metadata { scene: rgb.display().to_string(), ..ply::Metadata::default() };
                Self { cloud, metadata, scene: None, path_eye: None }
            }
            Input::Stack(_) => {
                let what = "a focal stack has no points; `compute` takes it, and `encode` and `reconstruct` its field";
                return Err(Error::parameter("input", what));
            }
            Input::Field(path) | Input::Frame(path) => {
                let what = "is no scene, point cloud or picture with depth (rgb.png+depth.png)";
                return Err(Error::input(path, what));
            }
        };
        report_cloud(&points.cloud, begin.elapsed().as_secs_f64(), report);
        Ok(points)
    }

    fn of_scene(path: &Path, scene: ScenePoints, phase: Phase) -> Self {
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
        Self { cloud: scene.placed.cloud.clone(), metadata, scene: Some(scene), path_eye }
    }

    fn read(path: &Path, report: &mut Report) -> Result<Self> {
        let read = ply::read(path)?;
        report.warn(read.warnings.iter().map(|w| format!("{}: {w}", path.display())));
        if read.metadata.as_ref().is_some_and(|m| m.frame == ply::Frame::World) {
            let what = "its points stand in the scene's own metres; write them with --frame hologram";
            return Err(Error::input(path, what));
        }
        if read.cloud.points.is_empty() {
            return Err(Error::input(path, "has no points"));
        }
        if read.cloud.points.iter().all(|p| p.amplitude == 0.0) {
            return Err(Error::input(path, "all its points are dark: no amplitude is above zero"));
        }
        let metadata = read.metadata.unwrap_or_default();
        let path_eye = metadata.eye.filter(|_| metadata.phase == format!("{:?}", Phase::Path)).map(DVec3::from_array);
        Ok(Self { cloud: read.cloud, metadata, scene: None, path_eye })
    }
}
