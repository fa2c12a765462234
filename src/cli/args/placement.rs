//! Flags of where a scene stands before the panel.

use super::parse::{one_of, range};
use crate::points::Axes;
use crate::points::depth_map::{DepthReading, DepthScale};
use crate::points::placement::Phase;
use crate::units;
use clap::{Args, ValueEnum};

/// Where the scene stands before the panel.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Placement")]
pub(crate) struct PlacementArgs {
    /// The camera's picture through the panel as a window, or a model [default: window].
    ///
    /// A model is the scene as a miniature. A point cloud stands where its file says, in metres before the panel, if none of
    /// these flags is given.
    #[arg(long, value_enum)]
    pub(crate) placement: Option<PlacementArg>,
    /// Distance of the viewer's eye in front of the panel.
    #[arg(hide_short_help = true, long, default_value = "600mm", value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) viewer: f64,
    /// window: z of the nearest point, behind is negative [default: -100mm].
    #[arg(long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) near: Option<f64>,
    /// window: z of the farthest point [default: -150mm].
    #[arg(long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) far: Option<f64>,
    /// model: z of the scene's middle, negative behind the panel [default: -150mm].
    ///
    /// Of a field or frame of another program: the plane that its picture is focused on.
    #[arg(hide_short_help = true, long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) distance: Option<f64>,
    /// model: metres at the panel for one metre (of a cloud: one unit) of the scene [default: fits the view].
    #[arg(hide_short_help = true, long, value_name = "FACTOR")]
    pub(crate) scale: Option<f64>,
    /// A cloud's axes to the right, up and towards the viewer [default: x,y,z; of a depth camera's .pcd x,-y,-z].
    #[arg(hide_short_help = true, long, value_name = "AXES", allow_hyphen_values = true)]
    pub(crate) axes: Option<Axes>,
    /// Initial phase of the points [default: random; of a point cloud what its file says].
    #[arg(hide_short_help = true, long, value_parser = one_of::<Phase>(), value_name = "PHASE")]
    pub(crate) phase: Option<Phase>,
}

impl PlacementArgs {
    pub(crate) fn near(&self) -> f64 {
        self.near.unwrap_or(-0.1)
    }
    pub(crate) fn far(&self) -> f64 {
        self.far.unwrap_or(-0.15)
    }
    pub(crate) fn distance(&self) -> f64 {
        self.distance.unwrap_or(-0.15)
    }
    /// The phase that was typed, random under a seed where none was.
    pub(crate) fn phase(&self, seed: u64) -> Phase {
        match self.phase {
            None | Some(Phase::Random { .. }) => Phase::Random { seed },
            Some(other) => other,
        }
    }
    /// Whether anything of it was typed that places points.
    pub(crate) fn is_asked(&self) -> bool {
        let lengths = [self.near, self.far, self.distance, self.scale];
        self.placement.is_some() || lengths.iter().any(Option::is_some)
    }
    /// The placement that was typed; that of a model where only its flags were.
    pub(crate) fn kind(&self) -> PlacementArg {
        let of_model = self.scale.or(self.distance).is_some() && self.near.or(self.far).is_none();
        self.placement.unwrap_or(if of_model { PlacementArg::Model } else { PlacementArg::Window })
    }
}

/// How a picture's depth map is read, or a scene's is written.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Placement")]
pub(crate) struct DepthMapArgs {
    /// Depth map of a picture: which end of its gray scale is near [default: white-near; of floats the smaller].
    #[arg(hide_short_help = true, long, value_parser = one_of::<DepthScale>(), value_name = "SCALE")]
    pub(crate) depth_scale: Option<DepthScale>,
    /// Depth map of a depth camera: length of one step of its numbers, such as 1mm.
    ///
    /// Its numbers are distances then, and 0 is no measurement.
    #[arg(hide_short_help = true, long, value_parser = units::positive_length, value_name = "LENGTH")]
    pub(crate) depth_unit: Option<f64>,
    /// Distances that stand at --near and --far; what lies outside is left out [default: what was measured].
    #[arg(hide_short_help = true, long, value_parser = range, value_name = "NEAREST,FARTHEST")]
    pub(crate) depth_range: Option<[f64; 2]>,
}

impl DepthMapArgs {
    pub(crate) fn reading(&self) -> DepthReading {
        DepthReading { scale: self.depth_scale, unit: self.depth_unit, range: self.depth_range }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PlacementArg {
    Window,
    Model,
}
