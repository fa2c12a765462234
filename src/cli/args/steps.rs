//! Flags of the steps that are given one by one.

use super::encoding::EncodingArgs;
use super::field::FieldArgs;
use super::hologram::{ChannelArgs, HologramArgs};
use super::panel::{ColorArgs, PanelArgs};
use super::parse::{lengths, one_of, position, size};
use super::placement::{DepthMapArgs, PlacementArgs};
use super::scene::SceneArgs;
use super::viewer::ViewerArgs;
use crate::points::ply::Frame;
use crate::propagation::Kernel;
use crate::units;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct PointsArgs {
    /// A scene: .gltf, .glb, .obj, .stl.
    pub(crate) scene: PathBuf,
    /// The point cloud to write.
    #[arg(short, long, default_value = "points.ply", value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Also write the traced picture: .npy (H×W×3 float32 linear radiance) or .png.
    #[arg(help_heading = "Output", long, value_name = "FILE")]
    pub(crate) picture: Option<PathBuf>,
    /// Also write a depth map of the traced picture: .png, 16-bit gray, between --near and --far.
    #[arg(help_heading = "Output", long, value_name = "FILE")]
    pub(crate) depth_map: Option<PathBuf>,
    /// Frame of the positions.
    #[arg(help_heading = "Output", long, value_parser = one_of::<Frame>(), default_value = "hologram", value_name = "FRAME")]
    pub(crate) frame: Frame,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
    #[command(flatten)]
    pub(crate) color: ColorArgs,
    #[command(flatten)]
    pub(crate) light: SceneArgs,
    #[command(flatten)]
    pub(crate) placement: PlacementArgs,
    #[command(flatten)]
    pub(crate) map: DepthMapArgs,
    /// What was typed and is of no use for this input.
    #[arg(skip)]
    pub(crate) idle: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct ComputeArgs {
    /// Scene, point cloud, picture with depth (rgb.png+depth.png) or focal stack.
    ///
    /// Scenes: .gltf, .glb, .obj, .stl. Clouds: .ply (also of splats), .xyz, .csv, .pts, .pcd, .obj, .las. Depths: .png, .tif, .npy, .pfm, .dpt,
    /// .exr and further arrays; `file:name` chooses a variable or channel.
    ///
    /// A focal stack is pictures, each with its depth: near.png@-100mm+far.png@-150mm.
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
    #[command(flatten)]
    pub(crate) map: DepthMapArgs,
    #[command(flatten)]
    pub(crate) hologram: HologramArgs,
    #[command(flatten)]
    pub(crate) channel: ChannelArgs,
    /// A picture with depth in this many planes instead of points.
    ///
    /// By fast transforms and without gaps.
    #[arg(help_heading = "Hologram", long, value_name = "N", conflicts_with = "engine")]
    pub(crate) layers: Option<usize>,
    /// Layers do not hide what is behind them.
    #[arg(help_heading = "Hologram", hide_short_help = true, long, requires = "layers")]
    pub(crate) see_through: bool,
    /// A scene seen truly from each segment of so many pixels of the panel, as plates are: with --placement model.
    #[arg(help_heading = "Hologram", hide_short_help = true, long, value_name = "PIXELS", conflicts_with_all = ["layers", "engine"])]
    pub(crate) views: Option<u64>,
    /// What was typed and is of no use for this input.
    #[arg(skip)]
    pub(crate) idle: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct PropagateArgs {
    /// The field (.npy).
    pub(crate) input: PathBuf,
    /// The field to write.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// How far, with the light, which goes to +z (negative: back).
    #[arg(long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) distance: f64,
    /// Pixel pitch; one length, or x,y [default: what stands beside the field].
    #[arg(help_heading = "Panel", long, value_parser = lengths, value_name = "LENGTH[,LENGTH]")]
    pub(crate) pitch: Option<[f64; 2]>,
    /// Vacuum wavelength [default: what stands beside the field].
    #[arg(help_heading = "Panel", long, value_parser = units::wavelength, value_name = "LENGTH")]
    pub(crate) wavelength: Option<f64>,
    /// Wave equation.
    #[arg(long, value_parser = one_of::<Kernel>(), default_value = "angular-spectrum", value_name = "NAME")]
    pub(crate) kernel: Kernel,
    /// Take pitch and wavelength from this panel profile.
    #[arg(help_heading = "Panel", long, value_name = "PROFILE")]
    pub(crate) panel: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct EncodeArgs {
    /// Field, phases or levels (.npy, .npz, .mat, .h5, .tif; file.mat:name names one of several), picture, or light field.
    ///
    /// Complex numbers are a field, floats are phases in radians, whole numbers are drive levels.
    pub(crate) input: PathBuf,
    /// The frame to write.
    #[arg(short, long, default_value = "frame.png", value_name = "FILE")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) picture: PictureArgs,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
    #[command(flatten)]
    pub(crate) field: FieldArgs,
    #[command(flatten)]
    pub(crate) map: DepthMapArgs,
    #[command(flatten)]
    pub(crate) encoding: EncodingArgs,
    #[command(flatten)]
    pub(crate) viewer: ViewerArgs,
    /// Several frames of a light field, shown faster than an eye sees; files get -000, -001 …
    #[arg(help_heading = "Viewer", long, default_value_t = 1, value_name = "N")]
    pub(crate) subframes: usize,
    #[command(flatten)]
    pub(crate) camera: LoopArgs,
    /// What was typed and is of no use for this input.
    #[arg(skip)]
    pub(crate) idle: Option<String>,
}

/// A camera that looks at the frame while it is found.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Camera in the loop")]
pub(crate) struct LoopArgs {
    /// Place the picture in the focal plane of a lens, and correct the frame by photos of it: where the camera stands, as
    /// `calibrate camera` wrote it (mine-camera.json; its profile is --panel).
    #[arg(hide_short_help = true, long, value_name = "FILE", requires = "camera_command")]
    pub(crate) in_the_loop: Option<PathBuf>,
    /// Command that shows a frame and takes its photo: {frame} is the frame's PNG, {photo} the photo's path without an ending. Expose
    /// for the picture; the zero order may be overexposed.
    #[arg(hide_short_help = true, long, value_name = "COMMAND", requires = "in_the_loop")]
    pub(crate) camera_command: Option<String>,
    /// Photos that are taken, and a second one of the first frame, which tells the camera's noise.
    #[arg(hide_short_help = true, long, default_value_t = 30, value_name = "N", requires = "in_the_loop")]
    pub(crate) camera_photos: usize,
    /// Room for the picture, in halves of the window of the focal plane that was calibrated, right and up from the axis.
    #[arg(hide_short_help = true, long, default_value = "-0.9,0.15,0.9,0.9", value_parser = four, allow_hyphen_values = true, value_name = "LEFT,BOTTOM,RIGHT,TOP", requires = "in_the_loop")]
    pub(crate) room: [f64; 4],
}

/// Four numbers.
fn four(text: &str) -> Result<[f64; 4], String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    let commas = text.matches(',').count();
    let four = numbers.try_into().ok().filter(|_| commas == 3);
    four.ok_or_else(|| format!("\"{text}\" is not four numbers, such as -0.9,0.15,0.9,0.9"))
}

/// How a picture is laid onto the panel.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Encoding")]
pub(crate) struct PictureArgs {
    /// Part of the panel's sides that a picture takes; the light beside it is free.
    #[arg(help_heading = "Encoding", long, default_value_t = 0.75, value_name = "SHARE")]
    pub(crate) window: f64,
}

/// The simulated panel that a frame is on, and the stop behind it.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Simulated panel")]
pub(crate) struct SimulationArgs {
    /// Block the zero order within this angle of the axis, where the encoding's Fourier stop stands; 0deg lets it pass.
    #[arg(hide_short_help = true, long, default_value = "0.05deg", value_parser = units::angle, value_name = "ANGLE")]
    pub(crate) zero_order_stop: f64,
    /// Samples per pixel and side of the simulated panel: 1, or more to see replica orders.
    #[arg(hide_short_help = true, long, default_value_t = 1, value_name = "N")]
    pub(crate) subpixels: usize,
    /// Fault of the simulated panel: phases of neighbouring pixels blend by a Gaussian of so many pixels.
    #[arg(hide_short_help = true, long, default_value_t = 0.0, value_name = "PIXELS")]
    pub(crate) crosstalk: f64,
    /// Fault of the simulated panel: its wavefront error, as a file like those of encode's --correction.
    #[arg(hide_short_help = true, long, alias = "bend", value_name = "FILE")]
    pub(crate) wavefront_error: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct ReconstructArgs {
    /// A frame (.png, .bmp) or a field (.npy).
    pub(crate) input: PathBuf,
    /// The picture to write: .png (8 bit, sRGB-coded) or .npy (H×W float32, linear intensity).
    #[arg(short, long, default_value = "picture.png", value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Panel profile [default: what the file says; a picture that says nothing needs it].
    #[arg(help_heading = "Panel", long, value_name = "PROFILE")]
    pub(crate) panel: Option<String>,
    /// Vacuum wavelength [default: what the file says, else the panel's].
    #[arg(help_heading = "Panel", long, value_parser = units::wavelength, value_name = "LENGTH")]
    pub(crate) wavelength: Option<f64>,
    /// Plane in focus: negative behind the panel, positive in front.
    #[arg(
        help_heading = "View",
        long,
        value_parser = units::length,
        value_name = "LENGTH",
        allow_hyphen_values = true,
        required_unless_present = "eye",
        conflicts_with = "eye"
    )]
    pub(crate) distance: Option<f64>,
    /// Look through an eye or camera at x,y,z (hologram frame, z in front of the panel).
    #[arg(help_heading = "View", long, value_parser = position, value_name = "X,Y,Z", allow_hyphen_values = true, requires = "focus")]
    pub(crate) eye: Option<[f64; 3]>,
    /// Depth that the eye focuses on: negative behind the panel, positive in front.
    #[arg(help_heading = "View", long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) focus: Option<f64>,
    /// Diameter of the eye's pupil.
    #[arg(help_heading = "View", long, requires = "eye", default_value = "4mm", value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) pupil: f64,
    /// Pixels of the picture, which are square: what is too wide or too high for them is cut off, or see --half [default: one for
    /// each sample of the field].
    #[arg(help_heading = "Picture", long, value_parser = size, value_name = "WxH")]
    pub(crate) size: Option<(usize, usize)>,
    /// Half width and half height of the view on the plane in focus [default: the panel's, widened as the eye sees it].
    #[arg(hide_short_help = true, help_heading = "Picture", long, value_parser = lengths, value_name = "LENGTH[,LENGTH]")]
    pub(crate) half: Option<[f64; 2]>,
    /// Part of the pixels that is not shown brighter than white.
    #[arg(help_heading = "Picture", long, default_value_t = 0.995, value_name = "PART")]
    pub(crate) white: f64,
    /// With --eye: a picture from each of so many places, beside each other × one above the other; names get -column-row.
    #[arg(help_heading = "View", long, value_parser = size, value_name = "CxR", requires = "eye", requires = "eye_box")]
    pub(crate) views: Option<(usize, usize)>,
    /// Width and height over which --views moves the eye.
    #[arg(help_heading = "View", long, value_parser = lengths, value_name = "LENGTH[,LENGTH]", requires = "views")]
    pub(crate) eye_box: Option<[f64; 2]>,
    #[command(flatten)]
    pub(crate) field: FieldArgs,
    #[command(flatten)]
    pub(crate) simulation: SimulationArgs,
    /// What was typed and is of no use for this input.
    #[arg(skip)]
    pub(crate) idle: Option<String>,
}
