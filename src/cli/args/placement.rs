//! Flags of where a scene stands before the panel.

use super::parse::one_of;
use clap::{Args, ValueEnum};
use holodrive::points::images::DepthScale;
use holodrive::points::placement::Phase;
use holodrive::units;

/// Where the scene stands before the panel.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Placement")]
pub(crate) struct PlacementArgs {
    /// The camera's picture through the panel as a window, or a model.
    ///
    /// A model is the scene as a miniature.
    #[arg(long, value_enum, default_value_t = PlacementArg::Window)]
    pub(crate) placement: PlacementArg,
    /// Distance of the viewer's eye in front of the panel.
    #[arg(hide_short_help = true, long, default_value = "600mm", value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) viewer: f64,
    /// window: z of the nearest point, behind is negative.
    #[arg(long, default_value = "-100mm", value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) near: f64,
    /// window: z of the farthest point.
    #[arg(long, default_value = "-150mm", value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) far: f64,
    /// model: z of the scene's middle, negative behind the panel.
    #[arg(hide_short_help = true, long, default_value = "-150mm", value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) distance: f64,
    /// model: metres at the panel for one metre of the scene [default: fits the view].
    #[arg(hide_short_help = true, long, value_name = "FACTOR")]
    pub(crate) scale: Option<f64>,
    /// Initial phase of the points.
    #[arg(hide_short_help = true, long, value_parser = one_of::<Phase>(), default_value = "random", value_name = "PHASE")]
    pub(crate) phase: Phase,
}

/// How a picture's depth map is read, or a scene's is written.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Placement")]
pub(crate) struct DepthMapArgs {
    /// Depth map of a picture: which end of its gray scale is near.
    #[arg(hide_short_help = true, long, value_parser = one_of::<DepthScale>(), default_value = "white-near", value_name = "SCALE")]
    pub(crate) depth_scale: DepthScale,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PlacementArg {
    Window,
    Model,
}
