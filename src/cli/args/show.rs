//! Flags of `show`.

use super::encoding::EncodingArgs;
use super::field::FieldArgs;
use super::hologram::{ChannelArgs, HologramArgs};
use super::panel::{ColorArgs, PanelArgs};
#[cfg(feature = "display")]
use super::parse::one_of;
use super::placement::{DepthMapArgs, PlacementArgs};
use super::scene::SceneArgs;
use super::sequence::SequenceArgs;
use super::viewer::ViewerArgs;
#[cfg(feature = "display")]
use crate::display::{OnAbsence, Presenter};
use crate::units;
use clap::Args;
use std::path::PathBuf;

/// Where pictures and data go if nothing is said.
pub(crate) const DEFAULT_OUTPUT: &str = "holodrive-out";

#[derive(Debug, Args)]
pub(crate) struct ShowArgs {
    /// Scene, point cloud, picture with depth, light field, field, frame, or frames in time.
    ///
    /// A picture with depth is rgb.png+depth.png. Frames in time are a folder of pictures, an array (frames × rows × columns, .npy), raw video (- for standard input),
    /// or an animated scene.
    pub(crate) input: PathBuf,
    /// Further pictures of frames, played in this order.
    pub(crate) more: Vec<PathBuf>,
    /// Folder for pictures and data.
    #[arg(short, long, default_value = DEFAULT_OUTPUT, value_name = "DIR")]
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
    /// Encode so many sub-frames with phases of their own; shown faster than an eye sees, their speckle averages out.
    #[arg(
        hide_short_help = true,
        help_heading = "Hologram",
        long,
        default_value_t = 1,
        value_name = "N",
        conflicts_with = "wavelengths"
    )]
    pub(crate) subframes: usize,
    /// Sub-frames share out the points instead of showing all.
    #[arg(hide_short_help = true, help_heading = "Hologram", long, requires = "subframes")]
    pub(crate) sparse: bool,
    #[command(flatten)]
    pub(crate) field: FieldArgs,
    #[command(flatten)]
    pub(crate) encoding: EncodingArgs,
    #[command(flatten)]
    pub(crate) viewer: ViewerArgs,
    /// Also moving pictures: the focus through the depths, and the eye round its box (animated PNG).
    #[arg(help_heading = "Viewer", hide_short_help = true, long)]
    pub(crate) sweeps: bool,
    /// Show it fullscreen on this monitor (see `holodrive monitors`).
    ///
    /// Instead of pictures of the simulated panel.
    #[arg(help_heading = "Display", long, value_name = "NAME")]
    pub(crate) monitor: Option<String>,
    /// How long to show it, in seconds [default: until Esc].
    ///
    /// Of frames in time it is how long the last one stays; without it they end with their last.
    #[arg(requires = "monitor", help_heading = "Display", long, value_name = "SECONDS")]
    pub(crate) hold: Option<f64>,
    /// Block the zero order within this angle of the axis, where the encoding's Fourier stop stands; 0deg lets it pass.
    #[arg(hide_short_help = true, help_heading = "Display", long, default_value = "0.05deg", value_parser = units::angle, value_name = "ANGLE")]
    pub(crate) zero_order_stop: f64,
    /// Show the frame even where a gamma table (night light) alters its levels; the report says what does.
    #[arg(requires = "monitor", hide_short_help = true, help_heading = "Display", long)]
    pub(crate) allow_altered_levels: bool,
    /// A square of SIZE video pixels in a corner (top-left, top-right, bottom-left, bottom-right) that toggles between black
    /// and white with every frame, for a photodiode.
    #[arg(hide_short_help = true, help_heading = "Display", long, value_name = "CORNER,SIZE", requires = "monitor")]
    pub(crate) trigger_patch: Option<String>,
    /// What brings the levels to the screen.
    #[cfg(feature = "display")]
    #[arg(requires = "monitor", hide_short_help = true, help_heading = "Display", long, value_parser = one_of::<Presenter>(), default_value = "auto", value_name = "NAME")]
    pub(crate) present: Presenter,
    /// What is done when the monitor is unplugged or switched off.
    #[cfg(feature = "display")]
    #[arg(requires = "monitor", hide_short_help = true, help_heading = "Display", long, value_parser = one_of::<OnAbsence>(), default_value = "end", value_name = "WHAT")]
    pub(crate) on_absence: OnAbsence,
    /// Follow the scene: compute again when its file changes, or when keys move it.
    ///
    /// The keys stand in the operator's view. A coarse hologram comes at once, finer ones while nothing moves.
    #[arg(help_heading = "Display", long, requires = "monitor")]
    pub(crate) live: bool,
    /// With --live and --encoding view: a file that says where the eye is, X,Y,Z such as 1mm,0mm,600mm.
    ///
    /// Whatever tracks the eye writes it anew; the hologram follows. The keys i j k l move the eye from there.
    #[arg(requires = "live", hide_short_help = true, help_heading = "Display", long, value_name = "FILE")]
    pub(crate) eye_from: Option<PathBuf>,
    /// With --live: where the operator's view is shown, never on the panel's monitor: a monitor, auto or none.
    #[arg(
        requires = "live",
        hide_short_help = true,
        help_heading = "Display",
        long,
        default_value = "auto",
        value_name = "MONITOR|auto|none"
    )]
    pub(crate) operator: String,
    #[command(flatten)]
    pub(crate) sequence: SequenceArgs,
    /// What was typed and is of no use for this input.
    #[arg(skip)]
    pub(crate) idle: Option<String>,
}
