//! What was typed, resolved: panel, settings, and the points of whatever input there is.

use super::args::{ColorArgs, HologramArgs, PanelArgs, PlacementArg, PlacementArgs, SceneArgs, Wavelengths, White};
use super::light::{report_cloud, report_light};
use super::report::Report;
use glam::DVec3;
use holodrive::field::Grid;
use holodrive::hologram::HologramSettings;
use holodrive::illumination::IlluminationSettings;
use holodrive::panel::{PanelProfile, Wavefront, wavefront};
use holodrive::pipeline::{self, Lit, SceneSettings};
use holodrive::points::WhitePoint;
use holodrive::points::colour::Lasers;
use holodrive::points::placement::{Phase, SequenceAnchors};
use holodrive::points::trace::TraceSettings;
use holodrive::points::{Channel, Placement, PointCloud, images, ply};
use holodrive::progress::Progress;
use holodrive::reconstruction::Picture;
use holodrive::scene::gltf::{Choice, Clip, LoadOptions};
use holodrive::units::{self, show_length};
use holodrive::{Error, Result};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A panel profile with the light that it is used in.
pub(super) struct Panel {
    pub(super) profile: PanelProfile,
    pub(super) grid: Grid,
    /// Of the hologram; the shortest of three lasers, whose cone is the narrowest.
    pub(super) wavelength: f64,
    pub(super) lasers: Option<Lasers>,
}

pub(super) fn panel(args: &PanelArgs, report: &mut Report) -> Result<Panel> {
    let profile = PanelProfile::find(&args.panel)?;
    report.warn(profile.warnings());
    let wavelength = args.wavelength.unwrap_or(profile.default_wavelength());
    let grid = profile.grid()?;
    report.add("panel", profile.name.clone(), "");
    report.add("wavelength", wavelength, "");
    Ok(Panel { profile, grid, wavelength, lasers: None })
}

/// The wavefront correction of a panel: the file that was named, else the one of its profile that is for the wavelength.
pub(super) fn panel_correction(panel: &Panel, named: Option<&str>, report: &mut Report) -> Result<Option<Wavefront>> {
    let (profile, wavelength) = (&panel.profile, panel.wavelength);
    let distance = |own: Option<f64>| own.map_or(f64::INFINITY, |own| (own - wavelength).abs());
    let found = match named {
        Some("none") => None,
        Some(file) => Some(wavefront::read(Path::new(file), None)?),
        // A file that does not fit the wavelength is passed over here: the profile may have none for this laser.
        None => profile
            .corrections
            .iter()
            .min_by(|a, b| distance(a.wavelength).total_cmp(&distance(b.wavelength)))
            .filter(|c| c.wavelength.is_none_or(|own| (own - wavelength).abs() <= 0.1 * own))
            .map(|c| wavefront::read(&c.file, c.wavelength))
            .transpose()?,
    };
    if let Some(found) = &found {
        report.warn(found.check(profile.width, profile.height, wavelength)?);
        report.add("correction", found.name.clone(), format!("correction   {}", found.name));
    } else if !profile.corrections.is_empty() && named.is_none() {
        report.warn([format!("panel {}: no wavefront correction for {}", profile.name, show_length(wavelength))]);
    }
    Ok(found)
}

/// The panel in the light of one laser, or of three where they were asked for.
pub(super) fn panel_in_color(args: &PanelArgs, color: &ColorArgs, report: &mut Report) -> Result<Panel> {
    let panel = panel(args, report)?;
    let wavelengths = match color.wavelengths {
        None => return Ok(panel),
        Some(Wavelengths::Of(wavelengths)) => wavelengths,
        Some(Wavelengths::Panel) => <[f64; 3]>::try_from(panel.profile.wavelengths.as_slice()).map_err(|_| {
            let count = panel.profile.wavelengths.len();
            let what = format!("panel {} names {count} wavelengths, not three; give them", panel.profile.name);
            Error::parameter("wavelengths", what)
        })?,
    };
    let lasers = Lasers::new(wavelengths)?;
    let [_, _, shortest] = lasers.wavelengths();
    // Whether the panel has a curve for each is found out before the work.
    lasers.wavelengths().iter().try_for_each(|w| panel.profile.drive_curve(*w).map(drop))?;
    report.add("wavelength", Value::Null, "");
    report.add("wavelengths", lasers.wavelengths().to_vec(), "");
    report.add("white_powers", lasers.white().to_vec(), "");
    Ok(Panel { wavelength: shortest, lasers: Some(lasers), ..panel })
}

pub(super) fn scene_settings(light: &SceneArgs, placement: &PlacementArgs, default_white: White) -> SceneSettings {
    SceneSettings {
        load: LoadOptions {
            camera: light.file.camera.as_deref().map(Choice::from),
            clip: light.file.animation.as_deref().map_or(Clip::First, |name| Clip::Of(Choice::from(name))),
            time: light.file.time,
            viewer_light: light.file.viewer_light,
            ..LoadOptions::default()
        },
        illumination: IlluminationSettings {
            form_factor: light.form_factor,
            bounces: light.bounces,
            final_gather: light.final_gather,
            photons: light.photons,
            seed: light.seed,
            ..IlluminationSettings::default()
        },
        trace: TraceSettings {
            width: light.rays.0 as u32,
            height: light.rays.1 as u32,
            bounces: light.bounces,
            mirror_depth: light.mirror_depth,
            seed: light.seed,
            ..TraceSettings::default()
        },
        points: light.points,
        placement: placed_by(placement),
        phase: match placement.phase {
            Phase::Random { .. } => Phase::Random { seed: light.seed },
            other => other,
        },
        white: match placement.white.unwrap_or(default_white) {
            White::Auto => WhitePoint::Auto,
            White::None => WhitePoint::Unlimited,
            White::At(value) => WhitePoint::At(value),
        },
        anchors: SequenceAnchors::default(),
    }
}

pub(super) fn placed_by(args: &PlacementArgs) -> Placement {
    match args.placement {
        PlacementArg::Window => Placement::Window { eye: args.viewer, near: args.near, far: args.far },
        PlacementArg::Model => Placement::Model { eye: args.viewer, z: args.distance, scale: args.scale },
    }
}

pub(super) fn hologram_settings(args: &HologramArgs) -> HologramSettings {
    HologramSettings { error: args.error, method: args.engine, memory: args.memory, ..HologramSettings::default() }
}

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
    pub(super) lit: Option<Lit>,
    /// Eye to which the phases are those of paths, if they are.
    pub(super) path_eye: Option<DVec3>,
}

/// Points of a scene, a cloud or a picture with depth.
pub(super) fn load_points(
    input: &Input,
    (light, placement, default_white): (&SceneArgs, &PlacementArgs, White),
    panel: &Panel,
    progress: &Progress,
    report: &mut Report,
) -> Result<Points> {
    let settings = scene_settings(light, placement, default_white);
    let begin = Instant::now();
    if settings.points.is_some() && !matches!(input, Input::Scene(_)) {
        return Err(Error::parameter("points", "a number of points is for scenes; this input has the points it has"));
    }
    match input {
        Input::Scene(path) => {
            let lit = pipeline::light(path, &settings, &panel.grid, panel.wavelength, progress)?;
            report_light(&lit, begin.elapsed().as_secs_f64(), report);
            let placing = &lit.view.placing;
            let metadata = ply::Metadata {
                frame: ply::Frame::Hologram,
                scene: path.display().to_string(),
                eye: Some(placing.eye.to_array()),
                window: Some(placing.window.to_array()),
                rays: Some([lit.view.width, lit.view.height]),
                phase: format!("{:?}", settings.phase),
            };
            let path_eye = Some(placing.eye).filter(|_| settings.phase == Phase::Path);
            Ok(Points { cloud: lit.placed.cloud.clone(), metadata, lit: Some(lit), path_eye })
        }
        Input::Points(path) => {
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
            report_cloud(&read.cloud, begin.elapsed().as_secs_f64(), report);
            let metadata = read.metadata.unwrap_or_default();
            let path_eye =
                metadata.eye.filter(|_| metadata.phase == format!("{:?}", Phase::Path)).map(DVec3::from_array);
            Ok(Points { cloud: read.cloud, metadata, lit: None, path_eye })
        }
        Input::Images(rgb, depth) => {
            let seed = match settings.phase {
                Phase::Zero => None,
                Phase::Random { seed } => Some(seed),
                Phase::Path => {
                    return Err(Error::parameter("phase", "path is for scenes; use zero or random with a picture"));
                }
            };
            let cloud = images::read(rgb, depth, placement.depth_scale, &settings.placement, seed, &panel.grid)?;
            report_cloud(&cloud, begin.elapsed().as_secs_f64(), report);
            let metadata = ply::Metadata { scene: rgb.display().to_string(), ..ply::Metadata::default() };
            Ok(Points { cloud, metadata, lit: None, path_eye: None })
        }
        Input::Stack(_) => {
            let what = "a focal stack has no points; `compute` takes it, and `encode` and `reconstruct` its field";
            Err(Error::parameter("input", what))
        }
        Input::Field(path) | Input::Frame(path) => {
            Err(Error::input(path, "is no scene, point cloud or picture with depth (rgb.png+depth.png)"))
        }
    }
}

pub(super) fn luminance_picture(lit: &Lit) -> Picture {
    let values = lit.view.picture.iter().map(|rgb| Channel::Luminance.of(*rgb)).collect();
    Picture { width: lit.view.width, height: lit.view.height, values }
}
