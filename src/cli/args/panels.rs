//! Flags of `panels` and `plates`.

use clap::Args;
use std::path::PathBuf;

#[derive(Debug, Args)]
pub(crate) struct PanelsArgs {
    /// One of them: shows its TOML, which your own profile can begin with.
    #[arg(value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Also write the list to this file, as JSON; with NAME its TOML.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct PlatesArgs {
    /// One of them: shows its TOML, which your own profile can begin with.
    #[arg(value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Also write the list to this file, as JSON; with NAME its TOML.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}
