//! Flags of `monitors` and `doctor`.

use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct MonitorsArgs {
    /// Also write the list to this file, as JSON.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Say whether this panel profile fits.
    #[arg(long, value_name = "PROFILE")]
    pub(crate) panel: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct DoctorArgs {
    /// Only this monitor (see `holodrive monitors`).
    #[arg(long, value_name = "NAME")]
    pub(crate) monitor: Option<String>,
    /// Also write a numbered test card of the first monitor's size: with it an eye or a capture card sees whether pixels
    /// arrive one to one.
    #[arg(long, value_name = "FILE")]
    pub(crate) card: Option<PathBuf>,
    /// Also write the findings to this file, as JSON.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}
