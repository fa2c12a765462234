//! Flags of frames in time.

use super::parse::{Ahead, ahead, one_of, size};
use crate::sequence::RawFormat;
use crate::units;
use clap::Args;
use std::path::PathBuf;

/// How frames in time are read and played.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Frames in time")]
pub(crate) struct SequenceArgs {
    /// Frames per second [default: one at each refresh of the monitor; of an animated scene 12].
    ///
    /// A scene is animated where this, --from, --to or --loop is given.
    #[arg(hide_short_help = true, long, value_name = "RATE")]
    pub(crate) fps: Option<f64>,
    /// Begin again after the last frame, until Esc.
    #[arg(hide_short_help = true, long = "loop")]
    pub(crate) repeat: bool,
    /// Animated scene: first time in the clip, in seconds [default: its first key].
    #[arg(hide_short_help = true, long, value_name = "SECONDS", allow_hyphen_values = true)]
    pub(crate) from: Option<f64>,
    /// Animated scene: the time before which it ends, in seconds [default: its last key].
    #[arg(hide_short_help = true, long, value_name = "SECONDS", allow_hyphen_values = true)]
    pub(crate) to: Option<f64>,
    /// Frames that are made ahead of the one on the panel; `all` makes every one before the first is shown.
    #[arg(requires = "monitor", hide_short_help = true, long, default_value = "4", value_parser = ahead, value_name = "N|all")]
    pub(crate) ahead: Ahead,
    /// The input is raw video: bare frames of this size, one after another.
    #[arg(hide_short_help = true, long, value_parser = size, value_name = "WxH")]
    pub(crate) raw: Option<(usize, usize)>,
    /// Pixels of raw video.
    #[arg(hide_short_help = true, long, value_parser = one_of::<RawFormat>(), default_value = "gray", value_name = "FORMAT", requires = "raw")]
    pub(crate) raw_format: RawFormat,
    /// Plane that the contact sheet of the simulated panel is focused on, negative behind the panel [default: the nearest
    /// object of a scene, the middle of the content's depth of prepared frames].
    #[arg(hide_short_help = true, long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) focus: Option<f64>,
    /// Write a line of JSON for each frame to this file (a pipe will do) as soon as the panel has settled on it.
    #[arg(requires = "monitor", hide_short_help = true, long, value_name = "FILE")]
    pub(crate) events: Option<PathBuf>,
}
