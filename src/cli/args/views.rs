//! Flags of `views`.

use super::hologram::ChannelArgs;
use super::panel::{ColorArgs, PanelArgs};
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
    /// What was typed and is of no use for this input.
    #[arg(skip)]
    pub(crate) idle: Option<String>,
}
