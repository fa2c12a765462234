//! Flags of the panel and of the light on it.

use super::parse::{Wavelengths, wavelengths};
use crate::units;
use clap::Args;

/// Which panel.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Panel")]
pub(crate) struct PanelArgs {
    /// Profile: a name from calib/ or a TOML file.
    #[arg(long, default_value = "generic", value_name = "PROFILE")]
    pub(crate) panel: String,
    /// Vacuum wavelength, with its unit [default: the panel's first].
    #[arg(long, value_parser = units::wavelength, value_name = "LENGTH")]
    pub(crate) wavelength: Option<f64>,
    /// Let the profile run its [command]s before and after frames are on a monitor.
    #[arg(hide_short_help = true, long)]
    #[cfg_attr(not(feature = "display"), allow(dead_code))] // Without monitors there is nothing to run them for.
    pub(crate) allow_command: bool,
}

/// A hologram for each of three lasers.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Panel")]
pub(crate) struct ColorArgs {
    /// Colour: wavelengths of three lasers, or `panel`.
    ///
    /// `panel` takes those of its profile. One trace makes a hologram for each; files are named -red, -green, -blue.
    #[arg(long, value_parser = wavelengths, value_name = "RED,GREEN,BLUE", conflicts_with = "wavelength")]
    pub(crate) wavelengths: Option<Wavelengths>,
}
