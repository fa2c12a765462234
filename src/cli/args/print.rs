//! Flags of plates.

use super::parse::{LampAsked, White, lamp, one_of, part, position, size, white};
use super::placement::DepthMapArgs;
use super::scene::{FileArgs, QualityArgs};
use crate::print::export::Format;
use crate::print::{Binarisation, PlateSize};
use crate::segments::PointPhase;
use crate::units;
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// Fringes of a plate into a folder, and what is done with such a folder.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct PrintArgs {
    #[command(subcommand)]
    pub(crate) command: Option<PrintCommand>,
    /// A scene (.gltf, .glb, .obj, .stl), seen truly from each segment of the plate; a point cloud (.ply, .xyz, .csv, .pcd, .las); pictures; or
    /// views.
    ///
    /// A picture (logo.png) stands at the plate's distance, or where it says (logo.png@-6mm), several behind each other
    /// (a.png@-4mm+b.png@-8mm), one with a depth map between --near and --far (rgb.png+depth.png). It fills the plate as the viewer
    /// sees it; what is clear or black in it lets what is behind through.
    ///
    /// Views from several places are a light field (`holodrive views`), or a folder of pictures of any program, named in their order from
    /// left to right, --view-spacing apart.
    pub(crate) input: Option<PathBuf>,
    /// The plate: a built-in one by name (see `holodrive plates`), or a TOML file.
    #[arg(long, value_name = "NAME|FILE")]
    pub(crate) plate: Option<String>,
    /// Width and height of the plate in place of its own, each the nearest number of whole pixels, or pixels.
    #[arg(long, value_parser = PlateSize::parse, value_name = "60mm,40mm|WxH")]
    pub(crate) size: Option<PlateSize>,
    /// Distance of its pixels in place of its own, or dots per inch.
    #[arg(long, value_parser = units::pitch, value_name = "0.5um|5080dpi")]
    pub(crate) pitch: Option<f64>,
    /// How one bit is made in place of the plate's own way.
    #[arg(long, value_parser = one_of::<Binarisation>(), value_name = "WAY")]
    pub(crate) binarisation: Option<Binarisation>,
    /// Where the points of a scene stand, and in which phases, in place of the plate's own.
    #[arg(long, value_parser = one_of::<PointPhase>(), value_name = "PHASE")]
    pub(crate) phase: Option<PointPhase>,
    /// Side of a segment in place of the plate's own: of views it is a pixel of their pictures [px].
    #[arg(hide_short_help = true, long, value_name = "N")]
    pub(crate) segment: Option<u64>,
    /// Picture with a depth map: z of its nearest point, behind is negative [default: three quarters of the plate's distance].
    #[arg(long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) near: Option<f64>,
    /// Picture with a depth map: z of its farthest point [default: five quarters of the plate's distance].
    #[arg(long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) far: Option<f64>,
    /// Folder of views: how far apart the places of neighbouring ones are.
    #[arg(long, value_parser = units::length, value_name = "LENGTH")]
    pub(crate) view_spacing: Option<f64>,
    /// Folder of views: rows in which they stand, the highest first [default: 1, parallax from left to right].
    #[arg(hide_short_help = true, long, value_name = "N")]
    pub(crate) view_rows: Option<usize>,
    /// Views in one row: the height from which they are seen [default: a tenth of their distance].
    #[arg(hide_short_help = true, long, value_parser = units::length, value_name = "LENGTH")]
    pub(crate) view_height: Option<f64>,
    #[command(flatten)]
    pub(crate) map: DepthMapArgs,
    /// Folder for the plate. One that was begun with the same settings is gone on with; one of others is refused.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Only say what it will take, and write nothing.
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// Compute part i of n only, i from 0 on; `auto` (or `auto/n`) takes it from Slurm's or Kubernetes' variables.
    #[arg(long, value_name = "I/N|auto")]
    pub(crate) shard: Option<String>,
    #[command(flatten)]
    pub(crate) light: PlateLightArgs,
}

/// How a plate's scene is lit; the camera's direction is that of the viewer.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Scene")]
pub(crate) struct PlateLightArgs {
    #[command(flatten)]
    pub(crate) file: FileArgs,
    /// Most mirrors and glass surfaces on a path of light.
    #[arg(hide_short_help = true, long, default_value_t = 32, value_name = "N")]
    pub(crate) bounces: u32,
    #[command(flatten)]
    pub(crate) quality: QualityArgs,
    /// Photons that lamps send through curved mirrors and glass [default: by --quality; normal: 400000].
    #[arg(hide_short_help = true, long, value_name = "N")]
    pub(crate) photons: Option<u32>,
    /// Clip light brighter than white: auto, none, or a radiance [default: auto].
    #[arg(hide_short_help = true, long, value_parser = white, value_name = "WHITE")]
    pub(crate) white: Option<White>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum PrintCommand {
    /// Check every byte of a finished plate against its manifest.
    #[command(after_long_help = "Example:\n  holodrive print verify plate")]
    Verify(VerifyArgs),
    /// Show what an eye sees of a finished plate, from the fringes in its file.
    #[command(
        after_long_help = "Examples:\n  holodrive print preview plate --eye 0mm,0mm,60mm --focus -6mm -o seen.png\n  holodrive print preview plate --eye 5mm,0mm,60mm --focus -6mm --traced scenes/cornell.gltf -o right.png\n  holodrive print preview plate --eye 0mm,0mm,60mm --focus -6mm --lamp 2mm,300mm --bandwidth 20nm -o in-life.png\n  holodrive print preview plate --pair 63mm --walk 100mm -o seen.png"
    )]
    Preview(PreviewArgs),
    /// Write a job sheet: one HTML page for whoever prints the plate and whoever lights it.
    ///
    /// Size, pitch, printer, lamp, angles and eye in a drawing, what is seen, what to check, SHA-256 of the files, and the command.
    #[command(
        after_long_help = "Examples:\n  holodrive print sheet plate -o sheet.html\n  holodrive print sheet plate --lamp 5mm,1m --bandwidth 20nm -o sheet.html"
    )]
    Sheet(SheetArgs),
    /// Write a finished plate in another format.
    #[command(
        after_long_help = "Examples:\n  holodrive print export plate --as zarr -o plate.zarr\n  holodrive print export plate --as png --frame 1920x1080 --serpentine -o frames\n  holodrive print export plate --as bmp --band 2048 -o bands\n  holodrive print export plate --as gds -o plate.gds\n  holodrive print export plate --as oasis --frame 4096x4096 -o fields"
    )]
    Export(ExportArgs),
}

#[derive(Debug, Args)]
pub(crate) struct VerifyArgs {
    /// The plate's folder.
    pub(crate) folder: PathBuf,
}

/// From where and in which light a finished plate is looked at.
#[derive(Debug, Args)]
pub(crate) struct LookArgs {
    /// The plate's folder.
    pub(crate) folder: PathBuf,
    /// Where the eye is: x,y,z (hologram frame, z in front of the plate) [default: the plate's viewer].
    #[arg(long, value_parser = position, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub(crate) eye: Option<[f64; 3]>,
    /// Depth that it focuses on: negative behind the plate, positive in front [default: the scene's middle].
    #[arg(long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) focus: Option<f64>,
    /// Diameter of the eye's pupil.
    #[arg(long, default_value = "4mm", value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) pupil: f64,
    /// Wavelength of the lamp [default: the plate's; all three of a plate in colour].
    #[arg(long, value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) wavelength: Option<f64>,
    /// Diameter and distance of the lamp: its places' pictures add up, which blurs and averages speckle out [default: the plate's; else laser].
    ///
    /// `laser` is a point far away of one wavelength.
    #[arg(long, value_parser = lamp, value_name = "DIAMETER,DISTANCE|laser")]
    pub(crate) lamp: Option<LampAsked>,
    /// Full width at half maximum of the lamp's spectrum about each of the plate's wavelengths [default: that of the plate's lamp; else 0nm].
    #[arg(long, value_parser = units::length, value_name = "LENGTH")]
    pub(crate) bandwidth: Option<f64>,
    /// Places and wavelengths of the lamp that are looked at.
    #[arg(hide_short_help = true, long, default_value_t = 24, value_name = "N")]
    pub(crate) places: usize,
    /// Pixels of the picture [default: 400 along the longer side].
    #[arg(long, value_parser = size, value_name = "WxH")]
    pub(crate) size: Option<(usize, usize)>,
    /// Look at a part of the plate only: first column and row, and its size.
    #[arg(long, value_parser = part, value_name = "COLUMN,ROW,WxH")]
    pub(crate) part: Option<[u64; 4]>,
    /// Part of the pixels that is not shown brighter than white.
    #[arg(long, default_value_t = 0.995, value_name = "PART")]
    pub(crate) white: f64,
    /// Memory that it may take.
    #[arg(long, default_value = "2GB", value_parser = units::memory, value_name = "SIZE")]
    pub(crate) memory: u64,
}

#[derive(Debug, Args)]
pub(crate) struct PreviewArgs {
    #[command(flatten)]
    pub(crate) look: LookArgs,
    /// The picture to write (8 bit, sRGB-coded), below words that say what, from where and in which light.
    #[arg(short, long, default_value = "preview.png", value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Write the picture alone, without words.
    #[arg(long)]
    pub(crate) bare: bool,
    /// Also look with two eyes so far apart, side by side in one picture, written beside as …-pair.png.
    #[arg(long, value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) pair: Option<f64>,
    /// Also walk past the plate, so far from left to right and back: an animated PNG, written beside as …-walk.png.
    #[arg(long, value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) walk: Option<f64>,
    /// Also trace what the eye should see of this scene or of these pictures, the plate's own; write it beside as …-traced.png and compare.
    #[arg(long, value_name = "SCENE")]
    pub(crate) traced: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct SheetArgs {
    #[command(flatten)]
    pub(crate) look: LookArgs,
    /// The page to write.
    #[arg(short, long, default_value = "sheet.html", value_name = "FILE")]
    pub(crate) output: PathBuf,
}

#[derive(Debug, Args)]
pub(crate) struct ExportArgs {
    /// The plate's folder.
    pub(crate) folder: PathBuf,
    /// Format.
    #[arg(long = "as", value_parser = one_of::<Format>(), value_name = "FORMAT")]
    pub(crate) format: Format,
    /// The folder to write; for gds, oasis and dxf without --frame or --band the file.
    #[arg(short, long, value_name = "PATH")]
    pub(crate) output: PathBuf,
    /// Columns and rows of an exposure [default for png, bmp: the printer's field]; gds, oasis, dxf: of what goes into one file.
    #[arg(long, value_parser = size, value_name = "WxH")]
    pub(crate) frame: Option<(usize, usize)>,
    /// Cut into bands of so many rows, as wide as the plate, in place of frames.
    #[arg(long, value_name = "ROWS", conflicts_with = "frame")]
    pub(crate) band: Option<u64>,
    /// png, bmp: pixels that neighbouring exposures share.
    #[arg(long, default_value_t = 0, value_name = "PIXELS")]
    pub(crate) overlap: u64,
    /// png, bmp: every second row of exposures from right to left.
    #[arg(long)]
    pub(crate) serpentine: bool,
    /// png, bmp of 8 bits: levels fall linearly over the overlap, so that two exposures add up to one.
    #[arg(long)]
    pub(crate) window: bool,
}
