//! Flags of `manual`.

use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct ManualArgs {
    /// The folder to write below; it is made where it is not there.
    #[arg(value_name = "DIR")]
    pub(crate) folder: PathBuf,
}
