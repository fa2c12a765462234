//! Flags of who looks.

use super::parse::{lengths, position};
use crate::light_field::Pupil;
use crate::units;
use clap::Args;

/// Who looks, and from where: what `--encoding view` is made for, and what is judged.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Viewer")]
pub(crate) struct ViewerArgs {
    /// Where the eye is [default: on the axis, at --viewer].
    #[arg(long, value_parser = position, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub(crate) eye: Option<[f64; 3]>,
    /// Diameter of the eye's pupil.
    #[arg(long, default_value = "4mm", value_parser = pupil, value_name = "LENGTH")]
    pub(crate) pupil: Pupil,
    /// Box that the eye may move in [default: none].
    ///
    /// Width and height, about --eye. More than about 2 mm asks for several frames: --subframes.
    #[arg(long, value_parser = lengths, value_name = "LENGTH[,LENGTH]")]
    pub(crate) eye_box: Option<[f64; 2]>,
}

fn pupil(text: &str) -> crate::Result<Pupil> {
    match text {
        "all" => Ok(Pupil::All),
        _ => units::positive_length(text).map(Pupil::Diameter),
    }
}
