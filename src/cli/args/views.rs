//! Flags of `views`.

use super::hologram::ChannelArgs;
use super::panel::{ColorArgs, PanelArgs};
use super::parse::size;
use super::placement::{DepthMapArgs, PlacementArgs};
use super::scene::SceneArgs;
use super::viewer::ViewerArgs;
use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct ViewsArgs {
    /// Scene, point cloud, picture with depth (rgb.png+depth.png), or light field.
    pub(crate) input: PathBuf,
    /// The light field to write: .npz, or a folder of pictures.
    #[arg(short, long, default_value = "views.npz", value_name = "FILE")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
    #[command(flatten)]
    pub(crate) color: ColorArgs,
    #[command(flatten)]
    pub(crate) channel: ChannelArgs,
    #[command(flatten)]
    pub(crate) light: SceneArgs,
    #[command(flatten)]
    pub(crate) placement: PlacementArgs,
    #[command(flatten)]
    pub(crate) map: DepthMapArgs,
    #[command(flatten)]
    pub(crate) viewer: ViewerArgs,
    /// Instead of a light field, a sequence of so many views in a row over --eye-box's width, for printers of stereograms: a folder of
    /// numbered pictures from left to right.
    #[arg(help_heading = "Sequence", long, value_name = "N")]
    pub(crate) sequence: Option<usize>,
    /// Pixels of a sequence's pictures [default: 1280 columns].
    #[arg(help_heading = "Sequence", long, requires = "sequence", value_parser = size, value_name = "WxH")]
    pub(crate) size: Option<(usize, usize)>,
    /// Kind of a sequence's pictures.
    #[arg(help_heading = "Sequence", long = "as", requires = "sequence", value_parser = ["tif", "png"], default_value = "tif", value_name = "KIND")]
    pub(crate) kind: String,
    /// Rays of a pixel of a sequence.
    #[arg(help_heading = "Sequence", long, requires = "sequence", default_value_t = 4, value_name = "N")]
    pub(crate) pixel_rays: u32,
    /// What was typed and is of no use for this input.
    #[arg(skip)]
    pub(crate) idle: Option<String>,
}
