//! Flags of `calibrate`.

use super::panel::PanelArgs;
use super::parse::{one_of, size};
use crate::calibration::Order;
use crate::print::calibrate::Scanner;
use crate::units;
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// What is calibrated.
#[derive(Debug, Subcommand)]
pub(crate) enum CalibrateCommand {
    /// The level → phase curve: without --powers the gratings to show, with it the curve that the powers tell.
    #[command(
        after_long_help = "Examples:\n  holodrive calibrate curve --panel holoeye-pluto-2.1 --wavelength 532nm -o sweep\n  holodrive calibrate curve --panel holoeye-pluto-2.1 --wavelength 532nm --monitor HDMI-1 --hold 0.5 -o sweep\n  holodrive calibrate curve --panel holoeye-pluto-2.1 --wavelength 532nm --powers sweep/manifest.csv -o mine.toml\n\nThe sweep's folder holds the gratings and manifest.csv, a line for each, whose column `power` is for the power in the first order (or the zero order, --order zero). Powers may also come from any CSV with the columns level,power or level,column,row,power."
    )]
    Curve(CurveArgs),
    /// The wavefront error: without --interferograms or --zernike the phase steps to show, with one of them the correction.
    #[command(
        after_long_help = "Examples:\n  holodrive calibrate flatness --panel mine.toml --steps 4 -o steps\n  holodrive calibrate flatness --panel mine.toml --interferograms i0.png,i1.png,i2.png,i3.png -o flat.npy --into mine.toml\n  holodrive calibrate flatness --panel mine.toml --zernike 0,0,0,0.8,-0.1 --radius 6mm -o flat.png"
    )]
    Flatness(FlatnessArgs),
    /// All of it by a camera: without --photos or --camera-command the frames to show, with one of them the profile.
    #[command(
        after_long_help = "Examples:\n  holodrive calibrate camera --panel holoeye-pluto-2.1 --wavelength 532nm -o patterns\n  holodrive calibrate camera --panel holoeye-pluto-2.1 --wavelength 532nm --photos photos --lens 200mm --camera-pitch 3.45um -o mine.toml\n  holodrive calibrate camera --panel holoeye-pluto-2.1 --wavelength 532nm --camera-command './grab {frame} {photo}.png' --lens 200mm --camera-pitch 3.45um -o mine.toml\n\nThe camera stands in the focal plane of a lens behind the panel and sees the zero order with the square about it that the dots fill. Each photo is named as its frame (dots, random-0 … random-9), .npy, .png, .tif or .bmp, linear in the light (no gamma, no automatic gain within a photo); exposures may differ. The command shows {frame} and writes its photo to {photo} with an ending.\n\nFound are the camera's mapping, the wavefront error, the level curve over the panel, the beam's amplitude, crosstalk and unmodulated light, each with its uncertainty. mine.toml holds them, with mine-correction.npy and mine-beam.npy beside it."
    )]
    Camera(CameraArgs),
    /// Test cards whose errors an eye sees.
    #[command(
        after_long_help = "Examples:\n  holodrive calibrate check --panel mine.toml -o cards\n  holodrive calibrate check --panel mine.toml --monitor HDMI-1 --hold 10 -o cards"
    )]
    Check(CheckArgs),
    /// What a printer makes of a plate's levels and lines: without a scan the card to print, with it the profile that undoes it.
    #[command(
        after_long_help = "Examples:\n  holodrive calibrate plate --plate film-5080dpi -o card\n  holodrive calibrate plate scan.tif --plate film-5080dpi -o mine.toml\n  holodrive print cornell --plate mine.toml -o plate\n\nThe card's folder is that of a plate: `print export` writes it as the printer takes it. Scan all of it in transmission, 16 bit, at 20 pixels a patch or more, with the scanner's gamma, sharpening and colour management off; scale, turn and side do not matter."
    )]
    Plate(CalibratePlateArgs),
}

/// Where frames are shown beside being written.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Display")]
pub(crate) struct ShownArgs {
    /// Also show the frames one after another on this monitor (see `holodrive monitors`).
    #[arg(long, value_name = "NAME")]
    pub(crate) monitor: Option<String>,
    /// How long each frame is shown, in seconds; not less than the panel takes to settle.
    #[arg(long, default_value_t = 0.5, value_name = "SECONDS")]
    pub(crate) hold: f64,
}

#[derive(Debug, Args)]
pub(crate) struct CurveArgs {
    /// Measured powers (.csv): find the curve.
    #[arg(long, value_name = "FILE")]
    pub(crate) powers: Option<PathBuf>,
    /// Folder for the gratings [default: sweep], or the profile to write [default: calibrated.toml].
    #[arg(short, long, value_name = "PATH")]
    pub(crate) output: Option<PathBuf>,
    /// Order of the gratings that was measured.
    #[arg(long, value_parser = one_of::<Order>(), default_value = "first", value_name = "ORDER")]
    pub(crate) order: Order,
    /// Number of levels in the sweep, evenly from the lowest to the highest [default: 64, or all of fewer].
    #[arg(long, value_name = "N", conflicts_with = "powers")]
    pub(crate) levels: Option<usize>,
    /// Width of the gratings' stripes, in columns: several, against crosstalk.
    #[arg(long, default_value_t = 8, value_name = "COLUMNS")]
    pub(crate) stripe: usize,
    /// Sweep this many regions of the panel one after another, side by side × one above the other.
    #[arg(long, value_parser = size, value_name = "CxR", conflicts_with = "powers")]
    pub(crate) regions: Option<(usize, usize)>,
    /// Degree of the polynomial [default: the one that explains the powers best].
    #[arg(long, value_name = "N")]
    pub(crate) degree: Option<usize>,
    #[command(flatten)]
    pub(crate) shown: ShownArgs,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
}

#[derive(Debug, Args)]
pub(crate) struct FlatnessArgs {
    /// Pictures of the panel's pixels in interference with a flat wave, one for each step, in their order: .png, .npy.
    #[arg(long, value_name = "FILE,…", value_delimiter = ',', conflicts_with = "zernike")]
    pub(crate) interferograms: Vec<PathBuf>,
    /// Zernike coefficients of the panel's wavefront error in waves, from piston on, in Noll's order and normalisation.
    #[arg(long, value_name = "WAVES,…", value_delimiter = ',', allow_hyphen_values = true, requires = "radius")]
    pub(crate) zernike: Vec<f64>,
    /// Radius of the circle that the coefficients are for.
    #[arg(long, value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) radius: Option<f64>,
    /// Number of phase steps to show.
    #[arg(long, default_value_t = 4, value_name = "N")]
    pub(crate) steps: usize,
    /// Folder for the steps [default: steps], or the correction to write, .npy or .png [default: flatness.npy].
    #[arg(short, long, value_name = "PATH")]
    pub(crate) output: Option<PathBuf>,
    /// Also write the panel's profile with this correction to this file.
    #[arg(long, value_name = "FILE")]
    pub(crate) into: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) shown: ShownArgs,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
}

#[derive(Debug, Args)]
pub(crate) struct CameraArgs {
    /// Folder with the photos, each named as its frame: find what they tell.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["camera_command", "monitor"])]
    pub(crate) photos: Option<PathBuf>,
    /// Command that shows a frame and takes its photo, run for each: {frame} is the frame's PNG, {photo} the photo's path
    /// without an ending.
    #[arg(long, value_name = "COMMAND", conflicts_with = "monitor")]
    pub(crate) camera_command: Option<String>,
    /// Focal length of the lens between panel and camera.
    #[arg(long, value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) lens: Option<f64>,
    /// Distance of neighbouring pixels of the camera.
    #[arg(long, value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) camera_pitch: Option<f64>,
    /// Folder for the frames [default: patterns], or the profile to write [default: calibrated.toml].
    #[arg(short, long, value_name = "PATH")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) shown: ShownArgs,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
}

#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// Folder for the cards.
    #[arg(short, long, default_value = "cards", value_name = "DIR")]
    pub(crate) output: PathBuf,
    /// Where the spots and letters are seen, in front of the panel.
    #[arg(long, default_value = "200mm", value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) distance: f64,
    #[command(flatten)]
    pub(crate) shown: ShownArgs,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
}

#[derive(Debug, Args)]
pub(crate) struct CalibratePlateArgs {
    /// The scan of the printed card (.tif, .png; 8 or 16 bit).
    pub(crate) scan: Option<PathBuf>,
    /// The plate whose printer it is: a built-in one by name (see `holodrive plates`), or a TOML file.
    #[arg(long, value_name = "NAME|FILE")]
    pub(crate) plate: String,
    /// Folder for the card [default: card], or the profile to write [default: calibrated-plate.toml].
    #[arg(short, long, value_name = "PATH")]
    pub(crate) output: Option<PathBuf>,
    /// Side of a patch of the card [default: 1mm, or 192 pixels where these are more].
    #[arg(long, value_parser = units::positive_length, value_name = "LENGTH", conflicts_with = "scan")]
    pub(crate) patch: Option<f64>,
    /// How the scanner's numbers follow the light.
    #[arg(long, value_parser = one_of::<Scanner>(), default_value = "linear", value_name = "CODING")]
    pub(crate) scanner: Scanner,
}
