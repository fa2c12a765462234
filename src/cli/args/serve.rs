//! The flags of `serve`.

use super::panel::PanelArgs;
use super::parse::one_of;
#[cfg(feature = "display")]
use crate::display::Presenter;
use crate::serve::OnClientGone;
use crate::units;
use clap::{Args, ValueEnum};
use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;

/// What slmsuite's levels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ServedLevelsArg {
    /// Shown as they are.
    Final,
    /// Phases, to which the panel's correction and curve are applied.
    Calibrated,
}

#[derive(Debug, Args)]
pub(crate) struct ServeArgs {
    /// The panel's monitor (see `holodrive monitors`), several as one (DP-1+DP-2), a part of the desktop (region:x,y,w,h),
    /// or `none` for the simulated panel.
    #[arg(help_heading = "Display", long, value_name = "NAME")]
    pub(crate) monitor: Option<String>,
    /// Speak slmsuite's protocol (RemoteSLM) on this port; 0: a free one [default: all protocols, this on 5025].
    #[arg(help_heading = "Protocols", long, value_name = "PORT")]
    pub(crate) slmsuite: Option<u16>,
    /// Speak slmPy's protocol on this port; 0: a free one [default: all protocols, this on 9999].
    #[arg(help_heading = "Protocols", long, value_name = "PORT")]
    pub(crate) slmpy: Option<u16>,
    /// Speak the local protocol of holodrive.py on this socket, or on a free port, which this file of yours (NAME.port) tells
    /// with a key [default: NAME.sock in the user's runtime folder; on Windows NAME.port].
    #[arg(help_heading = "Protocols", long, value_name = "SOCKET|FILE.port", num_args = 0..=1)]
    pub(crate) local: Option<Option<PathBuf>>,
    /// Hear triggers on this port, 0: a free one. A line of text shows the next frame of the list that a local client has
    /// armed (SLM.arm), or the preloaded frame of that name; the answer is its number, time and missed refreshes.
    #[arg(help_heading = "Protocols", long, value_name = "PORT")]
    pub(crate) trigger: Option<u16>,
    /// Memory for the frames that clients preload.
    #[arg(hide_short_help = true, help_heading = "Protocols", long, value_parser = units::memory, default_value = "2GB", value_name = "SIZE")]
    pub(crate) preload: u64,
    /// End, as by Ctrl-C, when standard input does: for a program that keeps this one in the background.
    #[arg(hide_short_help = true, help_heading = "Protocols", long)]
    pub(crate) until_stdin_closes: bool,
    /// Address to listen on. Other machines may then write on the panel: neither protocol asks who sends.
    #[arg(help_heading = "Protocols", long, default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST), value_name = "ADDRESS")]
    pub(crate) listen: IpAddr,
    /// The name by which clients ask for the panel [default: its profile's].
    #[arg(help_heading = "Panel", long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// What is on the panel before the first frame: a level, or a picture of levels.
    #[arg(help_heading = "Panel", long, default_value = "0", value_name = "LEVEL|FILE")]
    pub(crate) idle: String,
    /// What stays on the panel when the client that showed the last frame goes. slmsuite's connect anew for each frame;
    /// theirs always stays.
    #[arg(hide_short_help = true, help_heading = "Panel", long, value_parser = one_of::<OnClientGone>(), default_value = "keep", value_name = "WHAT")]
    pub(crate) on_client_gone: OnClientGone,
    /// What slmsuite's levels are: final, or calibrated here as phases.
    #[arg(hide_short_help = true, help_heading = "Panel", long, value_enum, default_value_t = ServedLevelsArg::Final, value_name = "WHAT")]
    pub(crate) levels: ServedLevelsArg,
    /// Wavefront correction for phases (.npy of radians, .bmp or .png of a vendor, Santec's .csv), or `none` [default: the
    /// profile's].
    #[arg(hide_short_help = true, help_heading = "Panel", long, value_name = "FILE")]
    pub(crate) correction: Option<String>,
    /// Answer a frame only when the panel has settled on it, by its profile's settle time after the flip.
    #[arg(hide_short_help = true, help_heading = "Panel", long)]
    pub(crate) settle: bool,
    /// With --monitor none: write each frame into this folder.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// A square of SIZE video pixels in a corner (top-left, top-right, bottom-left, bottom-right) that toggles between black
    /// and white with every frame, for a photodiode.
    #[arg(hide_short_help = true, help_heading = "Display", long, value_name = "CORNER,SIZE")]
    pub(crate) trigger_patch: Option<String>,
    /// Show frames even where a gamma table (night light) alters their levels; a warning says what does.
    #[arg(hide_short_help = true, help_heading = "Display", long)]
    pub(crate) allow_altered_levels: bool,
    /// What brings the levels to the screen.
    #[cfg(feature = "display")]
    #[arg(hide_short_help = true, help_heading = "Display", long, value_parser = one_of::<Presenter>(), default_value = "auto", value_name = "NAME")]
    pub(crate) present: Presenter,
    /// Add a line to this file for each request: when, who, what, and what came of it.
    #[arg(help_heading = "Protocols", long, value_name = "FILE")]
    pub(crate) log: Option<PathBuf>,
    /// Write the Python module for the local protocol to this file, and serve nothing.
    #[arg(help_heading = "Protocols", long, value_name = "FILE")]
    pub(crate) write_python: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) panel: PanelArgs,
}
