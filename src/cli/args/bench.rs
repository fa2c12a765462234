//! Flags of `bench`.

use super::parse::{one_of, size};
use crate::encode::{Encoding, PlaneStart};
use clap::{Args, Subcommand};
use std::path::PathBuf;

#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// All encodings on a flat picture and on scenes, on three simulated panels: a table in Markdown.
    #[command(
        after_long_help = "Examples:\n  holodrive bench encodings --scene scenes/cornell.gltf --scene scenes/depth-chart.gltf -o table.md\n  holodrive bench encodings --size 96x72 --iterations 20 --only double-phase --only weighted --json"
    )]
    Encodings(EncodingsArgs),
    /// Encodings as an eye sees them through its pupil: scenes × eye boxes × encodings, a table in Markdown.
    ///
    /// The layers that hide each other are always the first scene.
    #[command(
        after_long_help = "Examples:\n  holodrive bench views --scene scenes/cornell.gltf --scene scenes/mirror-ball.gltf -o views.md\n  holodrive bench views --case 'known eye' --only view --only kinoform"
    )]
    Views(BenchViewsArgs),
    /// Iterations per second of the gradient descent beside the time of a pair of Fourier transforms.
    #[command(after_long_help = "Example:\n  holodrive bench iterations --size 1920x1080 --planes 3")]
    Iterations(IterationsArgs),
}

#[derive(Debug, Args)]
pub(crate) struct EncodingsArgs {
    /// Pixels of the panel (of 8 µm).
    #[arg(long, default_value = "256x192", value_parser = size, value_name = "WxH")]
    pub(crate) size: (usize, usize),
    /// Iterations of the methods that iterate.
    #[arg(long, default_value_t = 200, value_name = "N")]
    pub(crate) iterations: usize,
    /// First phases of the methods with depths.
    #[arg(long, value_parser = one_of::<PlaneStart>(), default_value = "random", value_name = "PHASES")]
    pub(crate) start: PlaneStart,
    /// A scene (.gltf, .glb) beside the flat picture; may be given again.
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: Vec<PathBuf>,
    /// Only this encoding; may be given again.
    #[arg(long, value_parser = one_of::<Encoding>(), value_name = "NAME")]
    pub(crate) only: Vec<Encoding>,
    /// Also write the table to this file.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct IterationsArgs {
    /// Pixels of the panel.
    #[arg(long, default_value = "1920x1080", value_parser = size, value_name = "WxH")]
    pub(crate) size: (usize, usize),
    /// Number of depth planes.
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub(crate) planes: usize,
    /// Iterations that are timed.
    #[arg(long, default_value_t = 8, value_name = "N")]
    pub(crate) iterations: usize,
}

#[derive(Debug, Args)]
pub(crate) struct BenchViewsArgs {
    /// Pixels of the panel (of 8 µm, 632.8 nm, 8 bit).
    #[arg(long, default_value = "1920x1080", value_parser = size, value_name = "WxH")]
    pub(crate) size: (usize, usize),
    /// A scene (.gltf, .glb) beside the layers; may be given again.
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: Vec<PathBuf>,
    /// Only eyes whose name begins so (known eye, ±1 mm, 10 × 2 mm …); may be given again.
    #[arg(long, value_name = "NAME")]
    pub(crate) case: Vec<String>,
    /// Only this encoding (double-phase, kinoform, gradient, view); may be given again.
    #[arg(long, value_parser = one_of::<Encoding>(), value_name = "NAME")]
    pub(crate) only: Vec<Encoding>,
    /// Steps of view [default: those of each case].
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=100_000), value_name = "N")]
    pub(crate) iterations: Option<u64>,
    /// Also write the table to this file.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}
