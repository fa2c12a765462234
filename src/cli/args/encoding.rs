//! Flags of encodings.

use super::parse::{angles, one_of};
use crate::encode::{Encoding, PlaneStart};
use crate::units;
use clap::Args;

/// How a field or picture becomes what the panel can show.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Encoding")]
pub(crate) struct EncodingArgs {
    /// Encoding [default: view; of a field double-phase].
    ///
    /// On an amplitude panel it is off-axis-bipolar.
    #[arg(long, alias = "method", value_parser = one_of::<Encoding>(), value_name = "NAME")]
    pub(crate) encoding: Option<Encoding>,
    /// Off-axis: angle of the reference wave, x or x,y.
    #[arg(hide_short_help = true, long, value_parser = angles, value_name = "ANGLE[,ANGLE]", allow_hyphen_values = true)]
    pub(crate) reference_angle: Option<[f64; 2]>,
    /// Wavefront correction (.npy of radians, .bmp or .png of a vendor, Santec's .csv), or `none` [default: the profile's].
    #[arg(hide_short_help = true, long, value_name = "FILE")]
    pub(crate) correction: Option<String>,
    /// z of the picture's planes [default: three over the content's depth].
    ///
    /// Negative behind the panel. For plane-gradient, gerchberg-saxton, weighted and double-constraint.
    #[arg(hide_short_help = true, long, value_parser = units::length, value_name = "LENGTH,…", value_delimiter = ',', allow_hyphen_values = true)]
    pub(crate) depths: Vec<f64>,
    /// Iterations of view, of gradient and of the methods with depths.
    #[arg(hide_short_help = true, long, value_parser = clap::value_parser!(u64).range(1..=100_000), value_name = "N")]
    pub(crate) iterations: Option<u64>,
    /// First phases of the methods with depths.
    #[arg(hide_short_help = true, long, value_parser = one_of::<PlaneStart>(), value_name = "PHASES")]
    pub(crate) start: Option<PlaneStart>,
    /// Carrier: at normal incidence the object goes aside by this angle, off the zero order; x or x,y.
    #[arg(hide_short_help = true, long, value_parser = angles, value_name = "ANGLE[,ANGLE]", allow_hyphen_values = true)]
    pub(crate) blaze: Option<[f64; 2]>,
    /// Digital lens: the pattern focuses the light by this focal length.
    #[arg(hide_short_help = true, long, value_parser = units::length, value_name = "LENGTH", allow_hyphen_values = true)]
    pub(crate) lens: Option<f64>,
    /// Keep the object's light out of this angle about the axis, where a stop for the zero order stands.
    #[arg(hide_short_help = true, long, value_parser = units::angle, value_name = "ANGLE")]
    pub(crate) band_stop: Option<f64>,
}
