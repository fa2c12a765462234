//! Flags of scenes: what of a file is taken, how it is lit and traced.

use super::parse::{White, budget, one_of, percent, size, sky, white};
use crate::illumination::{FormFactor, Quality};
use crate::points::budget::Budget;
use crate::points::trace::MirrorDepth;
use crate::scene::environment::{Panorama, Sky};
use crate::units;
use clap::Args;
use std::path::PathBuf;

/// What of a file is taken, and the light that is added to it.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Scene")]
pub(crate) struct FileArgs {
    /// Camera of the scene, by name or number [default: the first].
    #[arg(hide_short_help = true, long, value_name = "NAME")]
    pub(crate) camera: Option<String>,
    /// Animation clip, by name or number.
    #[arg(hide_short_help = true, long, value_name = "NAME")]
    pub(crate) animation: Option<String>,
    /// Time in the animation [s].
    #[arg(hide_short_help = true, long, default_value_t = 0.0, value_name = "SECONDS")]
    pub(crate) time: f64,
    /// Add light from the viewer's upper left and from the camera to the file's own.
    #[arg(hide_short_help = true, long)]
    pub(crate) viewer_light: bool,
    /// Read buffers and pictures of a scene that lie outside of its folder, too.
    #[arg(hide_short_help = true, long)]
    pub(crate) allow_outside: bool,
    /// Panorama that lights the scene from all around, and that mirrors and glass show: .hdr, .exr or a picture.
    ///
    /// Twice as wide as it is high; its middle looks along +x. It stands in place of the light that a file without any gets.
    #[arg(hide_short_help = true, long, value_name = "FILE")]
    pub(crate) environment: Option<PathBuf>,
    /// Turn of the panorama about the vertical, from +x towards +z.
    #[arg(hide_short_help = true, long, default_value = "0deg", value_parser = units::angle, allow_hyphen_values = true, value_name = "ANGLE")]
    pub(crate) environment_turn: f64,
    /// The panorama's radiance, or that of sun and sky, is multiplied by this.
    #[arg(hide_short_help = true, long, default_value_t = 1.0, value_name = "FACTOR")]
    pub(crate) environment_strength: f32,
    /// Light the scene by sun and sky: the sun's elevation, its azimuth from +x towards +z, and haze from 2 (very clear) to 10
    /// [default haze: 3].
    ///
    /// Without a value the sun stands at 35deg,130deg: at the left behind a viewer who looks along -z. For example
    /// --sky=10deg,0deg,6: a low sun at the right on a hazy day. Values are in 1000 lux and 1000 cd/m2. It stands in place of
    /// the light that a file without any gets.
    #[arg(
        hide_short_help = true,
        long,
        value_name = "ELEVATION,AZIMUTH[,HAZE]",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "35deg,130deg",
        value_parser = sky,
        conflicts_with_all = ["environment", "environment_turn"]
    )]
    pub(crate) sky: Option<Sky>,
}

impl FileArgs {
    /// Sun and sky, if they are to light the scene.
    pub(crate) fn sky(&self) -> Option<Sky> {
        self.sky.map(|sky| Sky { strength: self.environment_strength, ..sky })
    }

    /// The panorama, if there is to be one.
    pub(crate) fn panorama(&self) -> Option<Panorama> {
        let (strength, turn) = (self.environment_strength, self.environment_turn);
        self.environment.clone().map(|path| Panorama { path, strength, turn })
    }
}

/// How a scene is lit and traced.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Scene")]
pub(crate) struct SceneArgs {
    /// Rays across and down.
    #[arg(long, default_value = "500x500", value_parser = size, value_name = "WxH")]
    pub(crate) rays: (usize, usize),
    /// About this many points, or what `eye` or `panel` resolves.
    ///
    /// The eye is at --viewer. Whatever part of the picture is dark: only the shape of --rays is kept. At most what the panel resolves.
    #[arg(long, value_parser = budget, value_name = "N|eye|panel")]
    pub(crate) points: Option<Budget>,
    #[command(flatten)]
    pub(crate) file: FileArgs,
    #[command(flatten)]
    pub(crate) quality: QualityArgs,
    /// Form factors: exact (1/π, polygons), or the seed paper's eq. (1) for comparison (half of the light is lost).
    #[arg(hide_short_help = true, long, value_parser = one_of::<FormFactor>(), default_value = "exact", value_name = "NAME")]
    pub(crate) form_factor: FormFactor,
    /// Gather indirect light at each point with so many rays (256 where none are said) instead of reading it off the
    /// patches: slower, for when only the best will do.
    #[arg(
        hide_short_help = true,
        long,
        value_name = "RAYS",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "256",
        value_parser = clap::value_parser!(u32).range(1..=1_000_000)
    )]
    pub(crate) final_gather: Option<u32>,
    /// Most mirrors and glass surfaces on a path of light.
    #[arg(hide_short_help = true, long, default_value_t = 32, value_name = "N")]
    pub(crate) bounces: u32,
    /// Depth of what is seen by way of mirrors and glass: where the eye focuses, or the length of the path as in the
    /// seed paper (the same for flat mirrors).
    #[arg(hide_short_help = true, long, value_parser = one_of::<MirrorDepth>(), default_value = "focus", value_name = "NAME")]
    pub(crate) mirror_depth: MirrorDepth,
    /// Photons that lamps send through curved mirrors and glass (caustics); none are sent where there is none
    /// [default: by --quality; normal: 400000].
    #[arg(hide_short_help = true, long, value_name = "N")]
    pub(crate) photons: Option<u32>,
    /// Clip light brighter than white, by its largest of red, green and blue: auto (a quarter above what 97 % of the lit
    /// pixels do not pass), none, or a radiance [default: none for `points`, auto otherwise].
    #[arg(hide_short_help = true, long, value_parser = white, value_name = "WHITE")]
    pub(crate) white: Option<White>,
    #[command(flatten)]
    pub(crate) random: RandomArgs,
}

/// What is random: phases, and the rays of light and eye.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Scene")]
pub(crate) struct RandomArgs {
    /// Seed of all random numbers.
    #[arg(hide_short_help = true, long, default_value_t = 1, value_name = "N")]
    pub(crate) seed: u64,
}

/// How good a scene's light is.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Scene")]
pub(crate) struct QualityArgs {
    /// How good the light is: rays, patches and photons by one word.
    #[arg(hide_short_help = true, long, value_parser = one_of::<Quality>(), default_value = "normal", value_name = "NAME")]
    pub(crate) quality: Quality,
    /// The same by the error that the picture's light may have: 0.2% to 20%, for example 0.5%.
    ///
    /// Root mean square over the picture's mean; the report says what it is estimated to be.
    #[arg(hide_short_help = true, long, value_parser = percent, conflicts_with = "quality", value_name = "PERCENT")]
    pub(crate) light_error: Option<f64>,
}

impl QualityArgs {
    /// The error that the light may have.
    pub(crate) fn error(&self) -> f64 {
        self.light_error.unwrap_or(self.quality.error())
    }
}
