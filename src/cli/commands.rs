//! The steps, one by one.

use super::args::{
    ChannelArg, ComputeArgs, DepthArg, EncodeArgs, EncodingArg, EncodingArgs, EngineArg, FormFactorArg, FrameArg,
    HologramArgs, KernelArg, MonitorsArgs, PanelArgs, PhaseArg, PlacementArg, PlacementArgs, PointsArgs, PropagateArgs,
    ReconstructArgs, SceneArgs, White,
};
use super::bar::Bar;
use super::report::{Report, count, seconds};
use glam::DVec2;
use holodrive::encode::{DoublePhase, EncodeSettings, Encoding, OffAxis, Reference};
use holodrive::field::{Field, Grid, npy};
use holodrive::hologram::{Computed, HologramSettings, Method};
use holodrive::illumination::{FormFactor, IlluminationSettings};
use holodrive::panel::simulated::Simulation;
use holodrive::panel::{Frame, Modulation, Origin, PanelProfile};
use holodrive::pipeline::{self, Exposure, Lit, SceneSettings};
use holodrive::points::placement::Phase;
use holodrive::points::trace::TraceSettings;
use holodrive::points::{Channel, Placement, PointCloud, images, ply};
use holodrive::progress::Progress;
use holodrive::propagation::{self, Kernel, Propagator};
use holodrive::reconstruction::{self, Picture, Scale, View, ViewSettings, write_rgb_png};
use holodrive::scene::gltf::{Choice, Clip, LoadOptions};
use holodrive::units::{self, show_length};
use holodrive::{Error, Result};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A panel profile with the wavelength that it is used at.
pub(super) struct Panel {
    pub(super) profile: PanelProfile,
    pub(super) grid: Grid,
    pub(super) wavelength: f64,
}

pub(super) fn panel(args: &PanelArgs, report: &mut Report) -> Result<Panel> {
    let profile = PanelProfile::find(&args.panel)?;
    report.warn(profile.warnings());
    let wavelength = args.wavelength.unwrap_or(profile.default_wavelength());
    let grid = profile.grid()?;
    report.add("panel", profile.name.clone(), "");
    report.add("wavelength", wavelength, "");
    Ok(Panel { profile, grid, wavelength })
}

pub(super) fn scene_settings(light: &SceneArgs, placement: &PlacementArgs, default_white: White) -> SceneSettings {
    let form_factor = match light.form_factor {
        FormFactorArg::Exact => FormFactor::Lambert,
        FormFactorArg::Paper => FormFactor::Paper,
    };
    SceneSettings {
        load: LoadOptions {
            camera: light.camera.as_deref().map(Choice::from),
            clip: light.animation.as_deref().map_or(Clip::First, |name| Clip::Of(Choice::from(name))),
            time: light.time,
            ..LoadOptions::default()
        },
        illumination: IlluminationSettings {
            form_factor,
            bounces: light.bounces,
            seed: light.seed,
            ..IlluminationSettings::default()
        },
        trace: TraceSettings {
            width: light.rays.0 as u32,
            height: light.rays.1 as u32,
            bounces: light.bounces,
            seed: light.seed,
            ..TraceSettings::default()
        },
        placement: placed_by(placement),
        phase: match placement.phase {
            PhaseArg::Zero => Phase::Zero,
            PhaseArg::Random => Phase::Random { seed: light.seed },
            PhaseArg::Path => Phase::Path,
        },
        exposure: match placement.white.unwrap_or(default_white) {
            White::Auto => Exposure::Auto,
            White::None => Exposure::Full,
            White::At(value) => Exposure::White(value),
        },
    }
}

/// Flags count distances behind the panel; the library's z is negative there.
fn placed_by(args: &PlacementArgs) -> Placement {
    match args.placement {
        PlacementArg::Window => Placement::Window { eye: args.viewer, near: -args.near, far: -args.far },
        PlacementArg::Model => Placement::Model { eye: args.viewer, z: -args.distance, scale: args.scale },
    }
}

pub(super) fn hologram_settings(args: &HologramArgs) -> HologramSettings {
    HologramSettings {
        error: args.error,
        method: args.engine.map(|engine| match engine {
            EngineArg::Oracle => Method::Oracle,
            EngineArg::Direct => Method::Direct,
        }),
        ..HologramSettings::default()
    }
}

pub(super) fn channel(args: &HologramArgs) -> Channel {
    match args.channel {
        ChannelArg::Luminance => Channel::Luminance,
        ChannelArg::Red => Channel::Red,
        ChannelArg::Green => Channel::Green,
        ChannelArg::Blue => Channel::Blue,
    }
}

/// What kind of file an input is, by its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Input {
    Scene(PathBuf),
    Points(PathBuf),
    Images(PathBuf, PathBuf),
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

/// Points with what is known of them.
pub(super) struct Points {
    pub(super) cloud: PointCloud,
    pub(super) metadata: ply::Metadata,
    pub(super) lit: Option<Lit>,
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
            Ok(Points { cloud: lit.placed.cloud.clone(), metadata, lit: Some(lit) })
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
            Ok(Points { cloud: read.cloud, metadata: read.metadata.unwrap_or_default(), lit: None })
        }
        Input::Images(rgb, depth) => {
            let scale = match placement.depth_scale {
                DepthArg::WhiteNear => images::DepthScale::WhiteNear,
                DepthArg::BlackNear => images::DepthScale::BlackNear,
            };
            let seed = match settings.phase {
                Phase::Zero => None,
                Phase::Random { seed } => Some(seed),
                Phase::Path => {
                    return Err(Error::parameter("phase", "path is for scenes; use zero or random with a picture"));
                }
            };
            let cloud = images::read(rgb, depth, scale, &settings.placement, seed, &panel.grid)?;
            report_cloud(&cloud, begin.elapsed().as_secs_f64(), report);
            let metadata = ply::Metadata { scene: rgb.display().to_string(), ..ply::Metadata::default() };
            Ok(Points { cloud, metadata, lit: None })
        }
        Input::Field(path) | Input::Frame(path) => {
            Err(Error::input(path, "is no scene, point cloud or picture with depth (rgb.png+depth.png)"))
        }
    }
}

fn report_cloud(cloud: &PointCloud, elapsed: f64, report: &mut Report) {
    let depth = cloud.depth_range();
    report.add("points", cloud.points.len(), "");
    report.add_serialised("depth", &depth, "");
    let range =
        depth.map(|(far, near)| format!(", z {} … {}", show_length(far), show_length(near))).unwrap_or_default();
    report.add(
        "points_seconds",
        elapsed,
        format!("points       {:>8}  {} points{range}", seconds(elapsed), count(cloud.points.len())),
    );
}

fn report_light(lit: &Lit, elapsed: f64, report: &mut Report) {
    report.warn(lit.warnings.iter());
    let (light, trace) = (&lit.illumination, &lit.trace);
    let load = (elapsed - light.seconds - trace.seconds).max(0.0);
    report.add("scene_seconds", load, format!("scene        {:>8}", seconds(load)));
    let energy = &light.energy;
    for (key, value) in
        [("energy_emitted", energy.emitted), ("energy_absorbed", energy.absorbed), ("energy_escaped", energy.escaped)]
    {
        report.add(key, value.to_array().to_vec(), "");
    }
    report.add("light_residual", light.convergence.residual, "");
    report.add(
        "light_seconds",
        light.seconds,
        format!(
            "light        {:>8}  {} patches, {} iterations to a residual of {:.1e}; energy in = absorbed + escaped within {:.2} %",
            seconds(light.seconds),
            count(light.patches),
            light.convergence.iterations,
            light.convergence.residual,
            100.0 * light.energy.imbalance()
        ),
    );
    report.add("patches", light.patches, "");
    report.add("rays", trace.rays, "");
    report.add(
        "trace_seconds",
        trace.seconds,
        format!("rays         {:>8}  {} rays", seconds(trace.seconds), count(trace.rays as usize)),
    );
    report_cloud(&lit.placed.cloud, 0.0, report);
    report.add_serialised("white", &lit.white, "");
    report.add("clipped_light", lit.clipped_light, "");
    if let Some(white) = lit.white.filter(|_| lit.clipped_light > 0.0) {
        let clipped = 100.0 * lit.clipped_light;
        report.add("", Value::Null, format!("exposure               white is {white:.3} W/(m² sr); {clipped:.0} % of the light is brighter and clipped (--white)"));
    }
    report.add("mirrored_points", trace.by_mirror, "");
    report.add("beyond_cone", lit.placed.beyond_cone, "");
    report.add("beyond_cone_light", lit.placed.beyond_cone_light, "");
    if lit.placed.beyond_cone > 0 {
        report.warn([format!(
            "{} points ({:.1} % of the light) stand where the panel cannot send light to the eye; move the viewer back or use a finer pitch",
            count(lit.placed.beyond_cone),
            100.0 * lit.placed.beyond_cone_light
        )]);
    }
}

pub(super) fn points(args: &PointsArgs) -> Result<Report> {
    let mut report = Report::new("points");
    let panel = panel(&args.panel, &mut report)?;
    let Input::Scene(path) = input(&args.scene)? else {
        return Err(Error::input(&args.scene, "is no scene: .gltf or .glb"));
    };
    let bar = Bar::new();
    let points = load_points(
        &Input::Scene(path),
        (&args.light, &args.placement, White::None),
        &panel,
        &bar.progress,
        &mut report,
    )?;
    let (mut cloud, mut metadata) = (points.cloud, points.metadata);
    let Some(lit) = points.lit else { return Err(Error::input(&args.scene, "is no scene")) };
    if args.frame == FrameArg::World {
        metadata = ply::Metadata { frame: ply::Frame::World, eye: None, window: None, ..metadata };
        for (point, world) in cloud.points.iter_mut().zip(&lit.world) {
            point.position = world.position;
        }
    }
    bar.progress.check()?;
    if let Some(picture) = &args.picture {
        write_traced(picture, &lit)?;
        report.add("picture", picture.display().to_string(), format!("picture      {}", picture.display()));
    }
    ply::write(&args.output, &cloud, &metadata)?;
    report.add("output", args.output.display().to_string(), format!("points       {}", args.output.display()));
    Ok(report)
}

/// The traced picture: linear as .npy, shown as .png.
pub(super) fn write_traced(path: &Path, lit: &Lit) -> Result<()> {
    let view = &lit.view;
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        let texts = [("Description", "traced picture, sRGB-coded linear radiance".to_string())];
        write_rgb_png(path, view.width, view.height, &view.picture, white_of(lit), &texts)
    } else {
        npy::write_picture(path, view.width, view.height, &view.picture)
    }
}

/// Luminance that pictures of a scene show as white.
pub(super) fn white_of(lit: &Lit) -> f32 {
    lit.white.unwrap_or_else(|| pipeline::white_level(&lit.view.picture))
}

pub(super) fn luminance_picture(lit: &Lit) -> Picture {
    let values = lit.view.picture.iter().map(|rgb| Channel::Luminance.of(*rgb)).collect();
    Picture { width: lit.view.width, height: lit.view.height, values }
}

pub(super) fn report_field(computed: &Computed, report: &mut Report) {
    let did = &computed.report;
    report.add("method", did.method.name(), "");
    report.add("method_reason", did.reason.clone(), "");
    report.add("error_bound", did.error_bound, "");
    report.add(
        "field_seconds",
        did.seconds,
        format!(
            "field        {:>8}  {} ({}): {}; error below {:.1e}",
            seconds(did.seconds),
            did.method.name(),
            did.instruction_set.name(),
            did.reason,
            did.error_bound
        ),
    );
    report.add("predicted_seconds", did.predicted_seconds, "");
    report.add("instruction_set", did.instruction_set.name(), "");
    report.add("memory", did.memory, "");
    report.add("pairs", did.coverage.pairs, "");
}

pub(super) fn compute(args: &ComputeArgs) -> Result<Report> {
    let mut report = Report::new("compute");
    let panel = panel(&args.panel, &mut report)?;
    let bar = Bar::new();
    let source = input(&args.input)?;
    let points = load_points(&source, (&args.light, &args.placement, White::Auto), &panel, &bar.progress, &mut report)?;
    let settings = hologram_settings(&args.hologram);
    let channel = channel(&args.hologram);
    let computed = pipeline::field(&points.cloud, channel, &panel.grid, panel.wavelength, &settings, &bar.progress)?;
    report_field(&computed, &mut report);
    bar.progress.check()?;
    let content = content(&points.cloud, &points.metadata);
    npy::write_field(&args.output, &computed.field, &content, &origin(&args.input, &points.cloud))?;
    report.add("output", args.output.display().to_string(), format!("field        {}", args.output.display()));
    Ok(report)
}

pub(super) fn origin(input: &Path, cloud: &PointCloud) -> String {
    format!("{} points of {}", cloud.points.len(), input.display())
}

/// Where the content of a hologram stands, for the reconstructions to come.
pub(super) fn content(cloud: &PointCloud, metadata: &ply::Metadata) -> npy::Content {
    npy::Content {
        z: 0.0,
        depth: cloud.depth_range().map(|(far, near)| [near, far]),
        eye: metadata.eye,
        window: metadata.window,
    }
}

pub(super) fn propagate(args: &PropagateArgs) -> Result<Report> {
    let mut report = Report::new("propagate");
    let profile = args.panel.as_deref().map(PanelProfile::find).transpose()?;
    let pitch = args.pitch.or(profile.as_ref().map(|p| [p.pitch_x, p.pitch_y]));
    let wavelength = args.wavelength.or(profile.as_ref().map(PanelProfile::default_wavelength));
    let (field, metadata) = npy::read_field(&args.input, pitch, wavelength)?;
    let bar = Bar::new();
    let begin = Instant::now();
    bar.progress.start("propagate", 0);
    let kernel = match args.kernel {
        KernelArg::AngularSpectrum => Kernel::AngularSpectrum,
        KernelArg::Fresnel => Kernel::Fresnel,
    };
    let settings = propagation::Settings { kernel, ..propagation::Settings::default() };
    let planned = Propagator::new(field.grid, field.grid, settings)?;
    let out = planned.propagate(&field, args.distance, &bar.progress)?;
    let content = npy::Content { z: metadata.content.z + args.distance, ..metadata.content };
    npy::write_field(&args.output, &out, &content, &metadata.origin)?;
    let elapsed = begin.elapsed().as_secs_f64();
    report.add("distance", args.distance, "");
    report.add("wavelength", field.wavelength, "");
    report.add("memory", planned.memory(), "");
    report.add("energy_kept", out.energy() / field.energy(), "");
    report.add("seconds", elapsed, format!("propagated over {} in {}", show_length(args.distance), seconds(elapsed)));
    report.add("output", args.output.display().to_string(), format!("field        {}", args.output.display()));
    Ok(report)
}

/// Encoding settings for a kind of panel.
pub(super) fn encode_settings(args: &EncodingArgs, panel: &Panel) -> Result<EncodeSettings> {
    let chosen = args.encoding.unwrap_or(match panel.profile.modulation() {
        Modulation::Amplitude => EncodingArg::OffAxisBipolar,
        Modulation::Phase => EncodingArg::DoublePhase,
    });
    let off_axis = OffAxis { reference: args.reference_angle.map(Reference::Angle), ..OffAxis::default() };
    let encoding = match chosen {
        EncodingArg::DoublePhase => Encoding::DoublePhase(DoublePhase::default()),
        EncodingArg::Kinoform => Encoding::Kinoform,
        EncodingArg::OffAxisBipolar => Encoding::OffAxisBipolar(off_axis),
        EncodingArg::OffAxisIntensity => Encoding::OffAxisIntensity(off_axis),
    };
    let off = matches!(encoding, Encoding::OffAxisBipolar(_) | Encoding::OffAxisIntensity(_));
    if args.reference_angle.is_some() && !off {
        let what = format!("{} has no reference wave; leave --reference-angle out", encoding.name());
        return Err(Error::parameter("reference-angle", what));
    }
    Ok(EncodeSettings::new(encoding))
}

/// A field as a frame, with its time.
pub(super) fn encode_field(
    field: &Field,
    args: &EncodingArgs,
    panel: &Panel,
    origin: &Origin,
    progress: &Progress,
    report: &mut Report,
) -> Result<Frame> {
    let begin = Instant::now();
    let settings = encode_settings(args, panel)?;
    let mut encoded = pipeline::frame(field, &panel.profile, &settings, progress)?;
    encoded.frame.metadata.origin = origin.clone();
    let (elapsed, did) = (begin.elapsed().as_secs_f64(), &encoded.report);
    report.warn(did.warnings.iter());
    report.add("encoding", did.method, "");
    report.add("efficiency", did.efficiency, "");
    report.add("encoding_field_error", did.field_error, "");
    report.add("clipped", did.clipped, "");
    report.add("dropped", did.dropped, "");
    report.add("quantisation_error", did.quantisation_error, "");
    report.add("unreachable", did.unreachable, "");
    report.add(
        "encode_seconds",
        elapsed,
        format!(
            "encode       {:>8}  {}: efficiency {:.2} %, field error {:.3} in its band, {:.1} % of the light outside the band dropped",
            seconds(elapsed),
            did.method,
            100.0 * did.efficiency,
            did.field_error,
            100.0 * did.dropped
        ),
    );
    Ok(encoded.frame)
}

pub(super) fn encode(args: &EncodeArgs) -> Result<Report> {
    let mut report = Report::new("encode");
    let panel = panel(&args.panel, &mut report)?;
    let pitch = [panel.grid.pitch_x, panel.grid.pitch_y];
    let beside = npy::read_metadata(&args.input)?;
    let wavelength = args.panel.wavelength.or(beside.as_ref().map(|m| m.wavelength)).unwrap_or(panel.wavelength);
    let (field, metadata) = npy::read_field(&args.input, Some(pitch), Some(wavelength))?;
    let bar = Bar::new();
    let origin =
        Origin { source: Some(args.input.display().to_string()), depth: metadata.content.depth, ..Origin::default() };
    let frame = encode_field(&field, &args.encoding, &panel, &origin, &bar.progress, &mut report)?;
    bar.progress.check()?;
    frame.write(&args.output)?;
    report.add("output", args.output.display().to_string(), format!("frame        {}", args.output.display()));
    Ok(report)
}

/// A depth as it was typed: signed is z, unsigned lies on the side of the content.
fn depth(text: &str, content: Option<[f64; 2]>) -> Result<f64> {
    let value = units::length(text)?;
    let signed = text.trim_start().starts_with(['+', '-']);
    let behind = content.is_some_and(|[near, far]| near + far < 0.0);
    Ok(if !signed && behind { -value } else { value })
}

pub(super) fn reconstruct(args: &ReconstructArgs) -> Result<Report> {
    let mut report = Report::new("reconstruct");
    let bar = Bar::new();
    let (field, mut settings, content) = match input(&args.input)? {
        Input::Field(path) => {
            let profile = args.panel.as_deref().map(PanelProfile::find).transpose()?;
            let pitch = profile.as_ref().map(|p| [p.pitch_x, p.pitch_y]);
            let beside = npy::read_metadata(&path)?;
            let wavelength = args
                .wavelength
                .or(beside.as_ref().map(|m| m.wavelength))
                .or(profile.as_ref().map(PanelProfile::default_wavelength));
            let (field, metadata) = npy::read_field(&path, pitch, wavelength)?;
            (field, ViewSettings::default(), metadata.content)
        }
        Input::Frame(path) => {
            let profile = args.panel.as_deref().map(PanelProfile::find).transpose()?;
            let (frame, warnings) = Frame::read(&path, profile.as_ref(), args.wavelength)?;
            report.warn(warnings);
            let simulation = Simulation { subsamples: args.subpixels, ..Simulation::default() };
            let (field, mut settings) = pipeline::simulated_light(&frame, &simulation, &bar.progress)?;
            settings.block_zero_order(args.zero_order_stop, field.wavelength);
            let content = npy::Content { depth: frame.metadata.origin.depth, ..npy::Content::default() };
            (field, settings, content)
        }
        _ => return Err(Error::input(&args.input, "is neither a frame (.png, .bmp) nor a field (.npy)")),
    };
    settings.propagation = propagation::Settings::default();
    let view = match (args.eye, &args.focus, &args.distance) {
        (Some(position), Some(focus), _) => {
            View::Eye { position, pupil: args.pupil, focus: depth(focus, content.depth)? }
        }
        (_, _, Some(distance)) => View::Plane { z: depth(distance, content.depth)? - content.z },
        _ => return Err(Error::parameter("distance", "give --distance, or --eye with --focus")),
    };
    let half = args.half.map_or_else(|| seen_half(&field, &view, content.eye), |[x, y]| DVec2::new(x, y));
    let begin = Instant::now();
    bar.progress.start("reconstruct", 0);
    let picture = match args.size {
        Some(size) => reconstruction::picture(&field, &view, half, size, &settings, &bar.progress)?,
        None => {
            let (grid, values) = reconstruction::intensity(&field, &view, half, &settings, &bar.progress)?;
            Picture { width: grid.width, height: grid.height, values }
        }
    };
    bar.progress.check()?;
    write_view(&args.output, &picture, Scale::Percentile(args.white), &view, half)?;
    let elapsed = begin.elapsed().as_secs_f64();
    report.add("focus", view.focus(), "");
    report.add("half", half.to_array().to_vec(), "");
    report.add("size", vec![picture.width, picture.height], "");
    report.add("simulated", true, "");
    let side = if view.focus() < 0.0 { "behind" } else { "in front of" };
    report.add(
        "seconds",
        elapsed,
        format!(
            "simulated picture in focus {} {side} the panel, {} × {} mm, in {}",
            show_length(view.focus().abs()),
            (half.x * 2e5).round() / 1e2,
            (half.y * 2e5).round() / 1e2,
            seconds(elapsed)
        ),
    );
    report.add("output", args.output.display().to_string(), format!("picture      {}", args.output.display()));
    Ok(report)
}

/// What is seen through the panel: its own half size, widened behind it as an eye sees it.
pub(super) fn seen_half(field: &Field, view: &View, eye: Option<[f64; 3]>) -> DVec2 {
    let half = 0.5 * DVec2::new(field.grid.extent_x(), field.grid.extent_y());
    let distance = match *view {
        View::Eye { position, .. } => Some(position[2]),
        View::Plane { .. } => eye.map(|eye| eye[2]),
    };
    match distance {
        Some(eye) if eye > 0.0 && view.focus() < eye => half * ((eye - view.focus()) / eye),
        _ => half,
    }
}

/// Writes a reconstruction as .png (shown) or .npy (linear).
pub(super) fn write_view(path: &Path, picture: &Picture, scale: Scale, view: &View, half: DVec2) -> Result<()> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        return npy::write_intensity(path, picture.width, picture.height, &picture.values);
    }
    let described = serde_json::json!({
        "simulated": true,
        "focus": view.focus(),
        "half": half.to_array(),
        "white": picture.white(scale),
        "convention": npy::CONVENTION,
    });
    let texts = [
        ("Description", "simulated reconstruction, sRGB-coded intensity".to_string()),
        ("holodrive", described.to_string()),
    ];
    picture.write_png(path, scale, &texts)
}

#[cfg(feature = "display")]
pub(super) fn monitors(args: &MonitorsArgs) -> Result<Report> {
    use holodrive::display::Display;
    let mut report = Report::new("monitors");
    let profile = args.panel.as_deref().map(PanelProfile::find).transpose()?;
    let monitors = Display::connect()?.monitors()?;
    for monitor in &monitors {
        let fits = fitting_profiles(monitor.width as usize, monitor.height as usize, profile.as_ref());
        report.add("", Value::Null, format!("{monitor}{fits}"));
    }
    report.add_serialised("monitors", &monitors, "");
    if let Some(path) = &args.output {
        let text = serde_json::to_string_pretty(&monitors).map_err(|e| Error::unsupported(e.to_string()))?;
        holodrive::files::write_bytes(path, text.as_bytes())?;
    }
    Ok(report)
}

#[cfg(feature = "display")]
fn fitting_profiles(width: usize, height: usize, asked: Option<&PanelProfile>) -> String {
    let fits = |profile: &PanelProfile| (profile.signal.width, profile.signal.height) == (width, height);
    match asked {
        Some(profile) if fits(profile) => format!("  fits {}", profile.name),
        Some(profile) => format!("  does not fit {}", profile.name),
        None => {
            let names: Vec<_> = PanelProfile::embedded_names()
                .filter(|name| PanelProfile::find(name).is_ok_and(|p| fits(&p)))
                .collect();
            if names.is_empty() { String::new() } else { format!("  size of: {}", names.join(", ")) }
        }
    }
}

#[cfg(not(feature = "display"))]
pub(super) fn monitors(_: &MonitorsArgs) -> Result<Report> {
    Err(Error::unsupported("this build has no display; build it with the feature `display` (the default)"))
}
