//! Flags as they are typed.

use clap::builder::PossibleValuesParser;
use clap::{Args, Parser, Subcommand, ValueEnum};
use holodrive::encode::Encoding;
use holodrive::units;
use std::path::PathBuf;

pub(crate) use super::print_args::{ExportArgs, ExportFormat, PrintArgs, PrintCommand, VerifyArgs};
pub(crate) use super::scene_args::{
    ColorArgs, DepthArg, FormFactorArg, MirrorDepthArg, PhaseArg, PlacementArg, PlacementArgs, SceneArgs, Wavelengths,
    White,
};
pub(crate) use super::sequence_args::{RawFormatArg, SequenceArgs};
pub(crate) use super::serve_args::{OnClientGoneArg, ServeArgs, ServedLevelsArg};

const EXIT_CODES: &str = "\
Exit codes: 0 done; 2 wrong flags, bad input, or a file or display that refused (one line says what, where and what to do; \
nothing is written under a final name); 130 interrupted.";

/// From a glTF room to light on a panel: holograms for spatial light modulators.
#[derive(Debug, Parser)]
#[command(name = "holodrive", version, after_help = EXIT_CODES, max_term_width = 120)]
pub(crate) struct Cli {
    /// Print the report as JSON on standard output, for machines.
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The steps, one by one, and `show`, which does them all.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Light a scene and trace it into point sources.
    #[command(
        after_help = "Examples:\n  holodrive points scenes/cornell.gltf -o points.ply\n  holodrive points room.glb -o world.ply --frame world --picture traced.npy --rays 800x600\n  holodrive points room.glb --points 100000 -o points.ply"
    )]
    Points(PointsArgs),
    /// Compute the field of a scene, point cloud, or picture with depth on the panel.
    #[command(
        after_help = "Examples:\n  holodrive compute points.ply -o field.npy\n  holodrive compute rgb.png+depth.png --panel holoeye-pluto-2.1 --wavelength 532nm -o field.npy\n  holodrive compute rgb.png+depth.png --layers 16 -o field.npy\n  holodrive compute near.png@100mm+far.png@150mm -o field.npy\n  holodrive compute points.ply --wavelengths 638nm,520nm,450nm -o field.npy"
    )]
    Compute(ComputeArgs),
    /// Carry a field from its plane to another.
    #[command(
        after_help = "Example:\n  holodrive propagate field.npy --pitch 8um --wavelength 532nm --distance 0.5m -o out.npy"
    )]
    Propagate(PropagateArgs),
    /// Encode a field, or a picture at depths, as a frame of drive levels for a panel.
    #[command(
        after_help = "Examples:\n  holodrive encode field.npy --method double-phase -o frame.png\n  holodrive encode field.npy --method double-phase --blaze 0.6deg --lens 300mm -o frame.png\n  holodrive encode picture.png --method weighted --depths 100mm -o frame.png\n  holodrive encode rgb.png+depth.png --method plane-gradient --depths 100mm,120mm,150mm -o frame.png"
    )]
    Encode(EncodeArgs),
    /// Reconstruct what is seen of a frame or a field: on a plane, or through an eye.
    #[command(
        after_help = "Examples:\n  holodrive reconstruct frame.png --distance 120mm -o near.png\n  holodrive reconstruct field.npy --eye 0mm,0mm,600mm --focus 150mm --pupil 4mm -o eye.png\n  holodrive reconstruct field.npy --eye 0mm,0mm,600mm --focus 150mm --views 5x1 --eye-box 20mm -o eye.png"
    )]
    Reconstruct(ReconstructArgs),
    /// The whole way: scene, points, field or frame → pictures on the simulated panel, or light on a real one.
    #[command(
        after_help = "Examples:\n  holodrive show scenes/cornell.gltf\n  holodrive show scenes/cornell.gltf --wavelengths 638nm,520nm,450nm\n  holodrive show frame.png --monitor HDMI-1\n  holodrive show points.ply --panel holoeye-pluto-2.1 --monitor edid:HE-PLUTO\n  holodrive show frames/ --monitor HDMI-1 --fps 30 --loop\n  holodrive show walk.glb --fps 12\n  holodrive show room.glb --monitor HDMI-1 --live\n  ffmpeg -i levels.mkv -f rawvideo -pix_fmt gray - | holodrive show - --raw 1920x1080 --monitor HDMI-1 --fps 24"
    )]
    Show(Box<ShowArgs>),
    /// Find a panel's curve and bend: frames to show, and what the measured numbers say.
    #[command(
        after_help = "Examples:\n  holodrive calibrate curve -o sweep\n  holodrive calibrate curve --powers sweep/manifest.csv -o mine.toml\n  holodrive calibrate flatness --zernike 0,0,0,0.8 --radius 6mm -o flat.npy --into mine.toml\n  holodrive calibrate check --panel mine.toml -o cards"
    )]
    Calibrate {
        /// What to find.
        #[command(subcommand)]
        what: super::calibrate::CalibrateCommand,
    },
    /// Compare what this program offers, on the simulated panel.
    #[command(
        after_help = "Examples:\n  holodrive bench encodings\n  holodrive bench encodings --size 96x72 --iterations 20 --json"
    )]
    Bench {
        /// What to compare.
        #[command(subcommand)]
        what: super::bench::BenchCommand,
    },
    /// Print a hologram: fringes of a plate of any size, tile by tile into a file.
    #[command(
        after_help = "Examples:\n  holodrive print scenes/cornell.gltf --plate calib/plate-chrome-1um.toml --dry-run\n  holodrive print scenes/cornell.gltf --plate calib/plate-small.toml -o plate\n  holodrive print scenes/cornell.gltf --plate calib/plate-chrome-1um.toml -o plate --shard auto"
    )]
    Print(PrintArgs),
    /// Keep a panel, and show on it what other programs send.
    ///
    /// Runs until Ctrl-C, or Esc on the panel. The first line says where clients come in (with --json: one line of JSON with
    /// the ports that it got); the report comes at the end.
    #[command(
        after_help = "Examples:\n  holodrive serve --panel holoeye-pluto-2.1 --monitor edid:HE-PLUTO\n  holodrive serve --panel generic --monitor none --slmsuite 0 --json\n  holodrive serve --panel mine.toml --monitor HDMI-1 --local --on-client-gone idle --idle flat.png\n  holodrive serve --write-python holodrive.py"
    )]
    Serve(ServeArgs),
    /// List the monitors, and which panel profile fits each.
    Monitors(MonitorsArgs),
    /// Look at everything on this desktop that alters levels on their way to a panel.
    #[command(after_help = "Examples:\n  holodrive doctor\n  holodrive doctor --monitor HDMI-1 --card card.png")]
    Doctor(DoctorArgs),
}

/// Which panel.
#[derive(Clone, Debug, Args)]
pub(crate) struct PanelArgs {
    /// Panel profile: a name from calib/ or a TOML file.
    #[arg(long, default_value = "generic", value_name = "PROFILE")]
    pub(crate) panel: String,
    /// Vacuum wavelength, with its unit [default: the panel's first].
    #[arg(long, value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) wavelength: Option<f64>,
}

/// Which light of a coloured cloud makes the hologram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ChannelArg {
    Luminance,
    Red,
    Green,
    Blue,
}

/// How the field is computed.
#[derive(Clone, Debug, Args)]
pub(crate) struct HologramArgs {
    /// Largest relative L2 error of the field.
    #[arg(long, default_value_t = 1e-3, value_name = "ERROR")]
    pub(crate) error: f64,
    /// Memory that the computation of the field may take beside points and field; less means fewer or smaller tables,
    /// and a refusal where no engine fits.
    #[arg(long, default_value = "1GB", value_parser = units::memory, value_name = "SIZE")]
    pub(crate) memory: u64,
    /// Which light of a coloured cloud.
    #[arg(long, value_enum, default_value_t = ChannelArg::Luminance, conflicts_with = "wavelengths")]
    pub(crate) channel: ChannelArg,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum EngineArg {
    /// Double precision, term by term: slow, for tests.
    Oracle,
    /// Vectorised sum to 1e-4.
    Direct,
    /// Vectorised sum over tiles as large as the error allows.
    Tiles,
    /// Spectral wavefront recording planes.
    Planes,
    /// Vectorised sum on a graphics processor.
    Gpu,
    /// Recording planes on a graphics processor.
    GpuPlanes,
    /// The difference method, for comparison.
    Recurrence,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FrameArg {
    /// Metres from the panel's middle: ready for a hologram.
    Hologram,
    /// The scene's own metres.
    World,
}

#[derive(Debug, Args)]
pub(crate) struct PointsArgs {
    /// A .gltf or .glb file.
    pub(crate) scene: PathBuf,
    /// The point cloud to write.
    #[arg(short, long, default_value = "points.ply", value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Also write the traced picture: .npy (H×W×3 float32 linear radiance) or .png.
    #[arg(long, value_name = "FILE")]
    pub(crate) picture: Option<PathBuf>,
    /// Also write a depth map of the traced picture: .png, 16-bit gray, between --near and --far.
    #[arg(long, value_name = "FILE")]
    pub(crate) depth_map: Option<PathBuf>,
    /// Frame of the positions.
    #[arg(long, value_enum, default_value_t = FrameArg::Hologram)]
    pub(crate) frame: FrameArg,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
    #[command(flatten)]
    pub(crate) color: ColorArgs,
    #[command(flatten)]
    pub(crate) light: SceneArgs,
    #[command(flatten)]
    pub(crate) placement: PlacementArgs,
}

#[derive(Debug, Args)]
pub(crate) struct ComputeArgs {
    /// A scene (.gltf, .glb), a point cloud (.ply), a picture with its depth map (rgb.png+depth.png), or a focal stack
    /// of pictures, each with its distance behind the panel (near.png@100mm+far.png@150mm).
    pub(crate) input: PathBuf,
    /// The field to write (H×W complex64, metadata beside it).
    #[arg(short, long, default_value = "field.npy", value_name = "FILE")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
    #[command(flatten)]
    pub(crate) color: ColorArgs,
    #[command(flatten)]
    pub(crate) light: SceneArgs,
    #[command(flatten)]
    pub(crate) placement: PlacementArgs,
    /// Engine that computes the field [default: the planner chooses].
    #[arg(long = "method", value_enum, value_name = "NAME", conflicts_with = "layers")]
    pub(crate) engine: Option<EngineArg>,
    /// A picture with depth in this many planes, by fast transforms and without gaps, instead of points.
    #[arg(long, value_name = "N")]
    pub(crate) layers: Option<usize>,
    /// Layers do not hide what is behind them.
    #[arg(long, requires = "layers")]
    pub(crate) see_through: bool,
    /// A scene seen truly from each segment of so many pixels of the panel, as plates are: with --placement model.
    #[arg(long, value_name = "PIXELS", conflicts_with_all = ["layers", "engine"])]
    pub(crate) views: Option<u64>,
    #[command(flatten)]
    pub(crate) hologram: HologramArgs,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum KernelArg {
    AngularSpectrum,
    Fresnel,
}

#[derive(Debug, Args)]
pub(crate) struct PropagateArgs {
    /// The field (.npy).
    pub(crate) input: PathBuf,
    /// The field to write.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// How far, with the light (negative: back).
    #[arg(long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) distance: f64,
    /// Pixel pitch; one length, or x,y [default: what stands beside the field].
    #[arg(long, value_parser = pitch, value_name = "LENGTH[,LENGTH]")]
    pub(crate) pitch: Option<[f64; 2]>,
    /// Vacuum wavelength [default: what stands beside the field].
    #[arg(long, value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) wavelength: Option<f64>,
    /// Wave equation.
    #[arg(long, value_enum, default_value_t = KernelArg::AngularSpectrum)]
    pub(crate) kernel: KernelArg,
    /// Take pitch and wavelength from this panel profile.
    #[arg(long, value_name = "PROFILE")]
    pub(crate) panel: Option<String>,
}

#[derive(Clone, Debug, Args)]
pub(crate) struct EncodingArgs {
    /// Encoding [default: double-phase on a phase panel, off-axis-bipolar on an amplitude panel].
    #[arg(long = "method", value_parser = PossibleValuesParser::new(Encoding::NAMES), value_name = "NAME")]
    pub(crate) encoding: Option<String>,
    /// Off-axis: angle of the reference wave, x or x,y.
    #[arg(long, value_parser = angles, value_name = "ANGLE[,ANGLE]", allow_hyphen_values = true)]
    pub(crate) reference_angle: Option<[f64; 2]>,
    /// Wavefront correction (.npy of radians, .bmp or .png of a vendor, Santec's .csv), or `none` [default: the profile's].
    #[arg(long, value_name = "FILE")]
    pub(crate) correction: Option<String>,
    /// Depths at which plane-gradient, gerchberg-saxton, weighted and double-constraint put the picture, from the panel,
    /// signed as reconstruct's --distance [default: three over the content's depth].
    #[arg(long, value_name = "LENGTH,…", value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) depths: Vec<String>,
    /// Iterations of gradient and of the methods with depths.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=100_000), value_name = "N")]
    pub(crate) iterations: Option<u64>,
    /// First phases of the methods with depths.
    #[arg(long, value_enum, value_name = "PHASES")]
    pub(crate) start: Option<StartArg>,
    /// Carrier: in straight light the object goes aside by this angle, off the zero order; x or x,y.
    #[arg(long, value_parser = angles, value_name = "ANGLE[,ANGLE]", allow_hyphen_values = true)]
    pub(crate) blaze: Option<[f64; 2]>,
    /// Digital lens: the pattern focuses the light by this focal length.
    #[arg(long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) lens: Option<f64>,
    /// Keep the object's light out of this angle about the axis, where a stop for the zero order stands.
    #[arg(long, value_parser = units::angle, value_name = "ANGLE")]
    pub(crate) band_stop: Option<f64>,
}

/// First phases of an iteration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum StartArg {
    /// The field's own.
    Field,
    /// The same everywhere.
    Constant,
    /// Random: speckle.
    Random,
    /// A lens: no speckle.
    Quadratic,
    /// Random, changing smoothly.
    Smooth,
}

#[derive(Debug, Args)]
pub(crate) struct EncodeArgs {
    /// The field (.npy), or a picture (.png, .bmp; with its depth map: rgb.png+depth.png).
    pub(crate) input: PathBuf,
    /// The frame to write.
    #[arg(short, long, default_value = "frame.png", value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Part of the panel's sides that a picture takes; the light beside it is free.
    #[arg(long, default_value_t = 0.75, value_name = "SHARE")]
    pub(crate) window: f64,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
    #[command(flatten)]
    pub(crate) encoding: EncodingArgs,
}

#[derive(Debug, Args)]
pub(crate) struct ReconstructArgs {
    /// A frame (.png, .bmp) or a field (.npy).
    pub(crate) input: PathBuf,
    /// The picture to write: .png (8 bit, sRGB-coded) or .npy (H×W float32, linear intensity).
    #[arg(short, long, default_value = "picture.png", value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Panel profile [default: what the file says, else generic].
    #[arg(long, value_name = "PROFILE")]
    pub(crate) panel: Option<String>,
    /// Vacuum wavelength [default: what the file says, else the panel's].
    #[arg(long, value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) wavelength: Option<f64>,
    /// Plane in focus, from the panel: +250mm in front, -250mm behind; without a sign the side where the file says that
    /// its content stands, else in front.
    #[arg(
        long,
        value_name = "LENGTH",
        allow_hyphen_values = true,
        required_unless_present = "eye",
        conflicts_with = "eye"
    )]
    pub(crate) distance: Option<String>,
    /// Look through an eye or camera at x,y,z (hologram frame, z in front of the panel).
    #[arg(long, value_parser = position, value_name = "X,Y,Z", allow_hyphen_values = true, requires = "focus")]
    pub(crate) eye: Option<[f64; 3]>,
    /// Depth that the eye focuses on, from the panel, signed as --distance.
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) focus: Option<String>,
    /// Diameter of the eye's pupil.
    #[arg(long, default_value = "4mm", value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) pupil: f64,
    /// Pixels of the picture [default: one for each sample of the field].
    #[arg(long, value_parser = size, value_name = "WxH")]
    pub(crate) size: Option<(usize, usize)>,
    /// Half width and half height of the view on the plane in focus [default: the panel's, widened as the eye sees it].
    #[arg(long, value_parser = pitch, value_name = "LENGTH[,LENGTH]")]
    pub(crate) half: Option<[f64; 2]>,
    /// Part of the pixels that is not shown brighter than white.
    #[arg(long, default_value_t = 0.995, value_name = "PART")]
    pub(crate) white: f64,
    /// Block the zero order within this angle of the axis, where the encoding's Fourier stop stands; 0deg lets it pass.
    #[arg(long, default_value = "0.05deg", value_parser = units::angle, value_name = "ANGLE")]
    pub(crate) zero_order_stop: f64,
    /// Samples per pixel and side of the simulated panel: 1, or more to see replica orders.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) subpixels: usize,
    /// Fault of the simulated panel: phases of neighbouring pixels blend by a Gaussian of so many pixels.
    #[arg(long, default_value_t = 0.0, value_name = "PIXELS")]
    pub(crate) crosstalk: f64,
    /// Fault of the simulated panel: its bend, as a file like those of encode's --correction.
    #[arg(long, value_name = "FILE")]
    pub(crate) bend: Option<PathBuf>,
    /// With --eye: a picture from each of so many places, beside each other × one above the other; names get -column-row.
    #[arg(long, value_parser = size, value_name = "CxR", requires = "eye", requires = "eye_box")]
    pub(crate) views: Option<(usize, usize)>,
    /// Width and height over which --views moves the eye.
    #[arg(long, value_parser = pitch, value_name = "LENGTH[,LENGTH]", requires = "views")]
    pub(crate) eye_box: Option<[f64; 2]>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PresenterArg {
    Auto,
    Gpu,
    Software,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AbsenceArg {
    End,
    Wait,
}

#[derive(Debug, Args)]
pub(crate) struct ShowArgs {
    /// A scene, a point cloud, a picture with depth (rgb.png+depth.png), a field, a frame; or frames in time: a folder of
    /// pictures, an array (frames × rows × columns, .npy), raw video (- for standard input).
    pub(crate) input: PathBuf,
    /// Further pictures of frames, played in this order.
    pub(crate) more: Vec<PathBuf>,
    /// Folder for pictures and data.
    #[arg(short, long, default_value = "holodrive-out", value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Show the frame fullscreen on this monitor (see `holodrive monitors`) instead of the simulated panel.
    #[arg(long, value_name = "NAME")]
    pub(crate) monitor: Option<String>,
    /// How long to show it (of frames in time: the last one), in seconds [default: until Esc; frames in time end with their
    /// last].
    #[arg(long, value_name = "SECONDS")]
    pub(crate) hold: Option<f64>,
    /// Block the zero order within this angle of the axis, where the encoding's Fourier stop stands; 0deg lets it pass.
    #[arg(long, default_value = "0.05deg", value_parser = units::angle, value_name = "ANGLE")]
    pub(crate) zero_order_stop: f64,
    /// Show the frame even where a gamma table (night light) alters its levels; the report says what does.
    #[arg(long)]
    pub(crate) allow_altered_levels: bool,
    /// A square of SIZE video pixels in a corner (top-left, top-right, bottom-left, bottom-right) that toggles between black
    /// and white with every frame, for a photodiode.
    #[arg(long, value_name = "CORNER,SIZE", requires = "monitor")]
    pub(crate) trigger_patch: Option<String>,
    /// Encode so many sub-frames with phases of their own; shown faster than an eye sees, their speckle averages out.
    #[arg(long, default_value_t = 1, value_name = "N", conflicts_with = "wavelengths")]
    pub(crate) subframes: usize,
    /// Sub-frames share out the points instead of showing all.
    #[arg(long, requires = "subframes")]
    pub(crate) sparse: bool,
    /// What brings the levels to the screen.
    #[arg(long, value_enum, default_value_t = PresenterArg::Auto)]
    pub(crate) present: PresenterArg,
    /// What is done when the monitor is unplugged or switched off.
    #[arg(long, value_enum, default_value_t = AbsenceArg::End)]
    pub(crate) on_absence: AbsenceArg,
    /// Follow the scene: compute again when its file changes, or when keys move it (they stand in the operator's view); coarse
    /// at once, finer while nothing moves.
    #[arg(long, requires = "monitor")]
    pub(crate) live: bool,
    /// With --live: where the operator's view is shown, never on the panel's monitor: a monitor, auto or none.
    #[arg(long, default_value = "auto", value_name = "MONITOR|auto|none")]
    pub(crate) operator: String,
    #[command(flatten)]
    pub(crate) sequence: SequenceArgs,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
    #[command(flatten)]
    pub(crate) color: ColorArgs,
    #[command(flatten)]
    pub(crate) light: SceneArgs,
    #[command(flatten)]
    pub(crate) placement: PlacementArgs,
    /// Engine that computes the field [default: the planner chooses].
    #[arg(long, value_enum, value_name = "NAME")]
    pub(crate) engine: Option<EngineArg>,
    #[command(flatten)]
    pub(crate) hologram: HologramArgs,
    #[command(flatten)]
    pub(crate) encoding: EncodingArgs,
}

#[derive(Debug, Args)]
pub(crate) struct MonitorsArgs {
    /// Also write the list to this file, as JSON.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Say whether this panel profile fits.
    #[arg(long, value_name = "PROFILE")]
    pub(crate) panel: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct DoctorArgs {
    /// Only this monitor (see `holodrive monitors`).
    #[arg(long, value_name = "NAME")]
    pub(crate) monitor: Option<String>,
    /// Also write a numbered test card of the first monitor's size: with it an eye or a capture card sees whether pixels
    /// arrive one to one.
    #[arg(long, value_name = "FILE")]
    pub(crate) card: Option<PathBuf>,
    /// Also write the findings to this file, as JSON.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

pub(super) fn size(text: &str) -> Result<(usize, usize), String> {
    let wrong = || format!("`{text}` is not a size such as 500x500");
    let (width, height) = text.split_once(['x', '×']).ok_or_else(wrong)?;
    let side = |t: &str| t.trim().parse::<usize>().ok().filter(|n| (1..=65_536).contains(n));
    match (side(width), side(height)) {
        (Some(width), Some(height)) => Ok((width, height)),
        _ => Err(format!("{}; each side 1 to 65536", wrong())),
    }
}

fn pitch(text: &str) -> Result<[f64; 2], String> {
    pair(text, |t| units::positive_length(t).map_err(|e| e.to_string()))
}

fn angles(text: &str) -> Result<[f64; 2], String> {
    let angle = |t: &str| units::angle(t).map_err(|e| e.to_string());
    match text.split_once(',') {
        Some((x, y)) => Ok([angle(x)?, angle(y)?]),
        None => Ok([angle(text)?, 0.0]),
    }
}

fn pair(text: &str, one: impl Fn(&str) -> Result<f64, String>) -> Result<[f64; 2], String> {
    match text.split_once(',') {
        Some((x, y)) => Ok([one(x)?, one(y)?]),
        None => one(text).map(|v| [v, v]),
    }
}

pub(super) fn position(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<f64> =
        text.split(',').map(units::length).collect::<holodrive::Result<_>>().map_err(|e| e.to_string())?;
    <[f64; 3]>::try_from(parts).map_err(|_| format!("`{text}` is not x,y,z such as 0mm,0mm,600mm"))
}
