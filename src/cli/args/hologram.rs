//! Flags of how a field is computed.

use super::parse::one_of;
use crate::hologram::Method;
use crate::points::Channel;
use crate::units;
use clap::Args;

/// How the field is computed.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Hologram")]
pub(crate) struct HologramArgs {
    /// Engine that computes the field [default: the planner chooses].
    #[arg(long, value_parser = one_of::<Method>(), value_name = "NAME")]
    pub(crate) engine: Option<Method>,
    /// Largest relative L2 error of the field.
    #[arg(long, default_value_t = 1e-3, value_name = "ERROR")]
    pub(crate) error: f64,
    /// Memory that the computation of the field may take beside points and field.
    ///
    /// Less means fewer or smaller tables, and a refusal where no engine fits.
    #[arg(hide_short_help = true, long, default_value = "1GB", value_parser = units::memory, value_name = "SIZE")]
    pub(crate) memory: u64,
}

/// Which light one laser shows.
#[derive(Clone, Copy, Debug, Args)]
#[command(next_help_heading = "Hologram")]
pub(crate) struct ChannelArgs {
    /// Which light of a coloured cloud or light field.
    #[arg(hide_short_help = true, long, value_parser = one_of::<Channel>(), default_value = "luminance", value_name = "NAME", conflicts_with = "wavelengths")]
    pub(crate) channel: Channel,
}
