//! Flags of fields and frames that were made for other pixels or another laser.

use super::parse::lengths;
use clap::Args;

/// How the pitch, size and wavelength of a field or frame meet the panel's.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Field")]
pub(crate) struct FieldArgs {
    /// Pixel pitch of a field that does not say it; one length, or x,y [default: the panel's].
    #[arg(hide_short_help = true, long, value_parser = lengths, value_name = "LENGTH[,LENGTH]")]
    pub(crate) pitch: Option<[f64; 2]>,
    /// Bring a field of another pitch or size onto the panel's pixels: interpolated, centred, with a border or cut.
    #[arg(hide_short_help = true, long)]
    pub(crate) resample: bool,
    /// Show a field or frame in another wavelength than its own: its depths become longer or shorter.
    #[arg(hide_short_help = true, long)]
    pub(crate) rescale_depth: bool,
}
