//! Flags of scenes: how they are lit, traced, coloured and placed.

use super::args::size;
use clap::{Args, ValueEnum};
use holodrive::points::budget::Budget;
use holodrive::units;

/// A hologram for each of three lasers.
#[derive(Clone, Debug, Args)]
pub(crate) struct ColorArgs {
    /// Colour: vacuum wavelengths of three lasers, or `panel` for those of its profile. One trace makes a hologram for
    /// each; files are named -red, -green, -blue.
    #[arg(long, value_parser = wavelengths, value_name = "RED,GREEN,BLUE", conflicts_with = "wavelength")]
    pub(crate) wavelengths: Option<Wavelengths>,
}

/// Which three lasers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wavelengths {
    Panel,
    Of([f64; 3]),
}

fn wavelengths(text: &str) -> Result<Wavelengths, String> {
    if text == "panel" {
        return Ok(Wavelengths::Panel);
    }
    let parts: Vec<f64> =
        text.split(',').map(units::positive_length).collect::<holodrive::Result<_>>().map_err(|e| e.to_string())?;
    <[f64; 3]>::try_from(parts)
        .map(Wavelengths::Of)
        .map_err(|_| format!("`{text}` is not three wavelengths such as 638nm,520nm,450nm"))
}

/// What of a file is taken, and the light that is added to it.
#[derive(Clone, Debug, Args)]
pub(crate) struct FileArgs {
    /// Camera of the scene, by name or number [default: the first].
    #[arg(long, value_name = "NAME")]
    pub(crate) camera: Option<String>,
    /// Animation clip, by name or number.
    #[arg(long, value_name = "NAME")]
    pub(crate) animation: Option<String>,
    /// Time in the animation [s].
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS")]
    pub(crate) time: f64,
    /// Add the light that a file without any gets, from the viewer's upper left and the camera, to the file's own.
    #[arg(long)]
    pub(crate) viewer_light: bool,
}

/// How a scene is lit and traced.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneArgs {
    /// Rays across and down.
    #[arg(long, default_value = "500x500", value_parser = size, value_name = "WxH")]
    pub(crate) rays: (usize, usize),
    /// About this many points, whatever part of the picture is dark: only the shape of --rays is kept. At most what the
    /// panel resolves; `eye` takes what an eye at --viewer resolves, `panel` what the panel does.
    #[arg(long, value_parser = points, value_name = "N|eye|panel")]
    pub(crate) points: Option<Budget>,
    #[command(flatten)]
    pub(crate) file: FileArgs,
    /// Form factors: exact (1/π, polygons), or the seed paper's eq. (1) for comparison (half of the light is lost).
    #[arg(long, value_enum, default_value_t = FormFactorArg::Exact)]
    pub(crate) form_factor: FormFactorArg,
    /// Gather indirect light at each point with so many rays (256 where none are said) instead of reading it off the
    /// patches: slower, for when only the best will do.
    #[arg(
        long,
        value_name = "RAYS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "256",
        value_parser = clap::value_parser!(u32).range(1..=1_000_000)
    )]
    pub(crate) final_gather: Option<u32>,
    /// Most mirrors and glass surfaces on a path of light.
    #[arg(long, default_value_t = 32, value_name = "N")]
    pub(crate) bounces: u32,
    /// Depth of what is seen by way of mirrors and glass: where the eye focuses, or the length of the path as in the
    /// seed paper (the same for flat mirrors).
    #[arg(long, value_enum, default_value_t = MirrorDepthArg::Focus)]
    pub(crate) mirror_depth: MirrorDepthArg,
    /// Photons that lamps send through curved mirrors and glass (caustics); none are sent where there is none.
    #[arg(long, default_value_t = 400_000, value_name = "N")]
    pub(crate) photons: u32,
    /// Seed of all random numbers.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) seed: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormFactorArg {
    Exact,
    Paper,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MirrorDepthArg {
    Path,
    Focus,
}

/// Where the scene stands before the panel.
#[derive(Clone, Debug, Args)]
pub(crate) struct PlacementArgs {
    /// window: the camera's picture seen through the panel; model: the scene as a miniature.
    #[arg(long, value_enum, default_value_t = PlacementArg::Window)]
    pub(crate) placement: PlacementArg,
    /// Distance of the viewer's eye in front of the panel.
    #[arg(long, default_value = "600mm", value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) viewer: f64,
    /// window: how far behind the panel the nearest point stands (negative: in front).
    #[arg(long, default_value = "100mm", value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) near: f64,
    /// window: how far behind the panel the farthest point stands.
    #[arg(long, default_value = "150mm", value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) far: f64,
    /// model: how far behind the panel the scene's middle stands (negative: in front).
    #[arg(long, default_value = "150mm", value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) distance: f64,
    /// model: metres at the panel for one metre of the scene [default: fits the view].
    #[arg(long, value_name = "FACTOR")]
    pub(crate) scale: Option<f64>,
    /// Initial phase of the points.
    #[arg(long, value_enum, default_value_t = PhaseArg::Random)]
    pub(crate) phase: PhaseArg,
    /// Clip light brighter than white, by its largest of red, green and blue: auto (a quarter above what 97 % of the lit
    /// pixels do not pass), none, or a radiance [default: none for `points`, auto otherwise].
    #[arg(long, value_parser = white, value_name = "WHITE")]
    pub(crate) white: Option<White>,
    /// Depth map of a picture: which end of its gray scale is near.
    #[arg(long, value_enum, default_value_t = DepthArg::WhiteNear)]
    pub(crate) depth_scale: DepthArg,
}

/// What is clipped as white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum White {
    Auto,
    None,
    At(f32),
}

pub(super) fn white(text: &str) -> Result<White, String> {
    match text {
        "auto" => Ok(White::Auto),
        "none" => Ok(White::None),
        value => value.parse().map(White::At).map_err(|_| format!("`{value}` is not auto, none or a radiance")),
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PlacementArg {
    Window,
    Model,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PhaseArg {
    Zero,
    Random,
    Path,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DepthArg {
    WhiteNear,
    BlackNear,
}

fn points(text: &str) -> Result<Budget, String> {
    match text {
        "eye" => Ok(Budget::Eye),
        "panel" => Ok(Budget::Panel),
        // More than 65 536 rays a side are not cast.
        number => match number.parse() {
            Ok(count) if (1..=1usize << 32).contains(&count) => Ok(Budget::Points(count)),
            _ => Err(format!("`{text}` is not a number of points from 1 on, nor eye or panel")),
        },
    }
}
