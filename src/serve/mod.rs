//! Frames from other programs: a server that speaks slmsuite's and slmPy's protocols.
//!
//! The server only takes frames and answers; whoever runs it owns the panel, takes each frame by [`Server::next`], shows
//! it, and says so by [`FrameRequest::shown`], upon which the client gets its answer. So the same server stands before
//! a real panel and a simulated one.
//!
//! Neither protocol is encrypted or authenticated: an address other than loopback lets the whole network write on the
//! panel. Whatever a client sends, nothing is held that is longer than a frame of the panel can be; silent clients are cut
//! off inside a request, and the longest silent one when there are too many.

mod connections;
mod encoding;
mod slmpy;
mod slmsuite;

pub use connections::Server;

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::SyncSender;
use std::time::Duration;

/// What clients are told of the panel that is served.
#[derive(Clone, Debug, PartialEq)]
pub struct ServedPanel {
    /// The name by which clients ask for it.
    pub name: String,
    /// Columns [px].
    pub width: u32,
    /// Rows [px].
    pub height: u32,
    /// Bits of a drive level, 1 to 16.
    pub bits: u8,
    /// Distance between pixels across and down [m].
    pub pixel_pitch: [f64; 2],
    /// The wavelength in use [m].
    pub wavelength: f64,
    /// The wavelength at which the whole range of levels is one turn of phase [m].
    pub design_wavelength: f64,
    /// Time from a frame's being presented until the panel has settled on it [s].
    pub settle_time: f64,
}

/// Drive levels as a client sent them: final ones, to be packed and shown as they are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SentLevels {
    /// Columns [px].
    pub width: u32,
    /// Rows [px].
    pub height: u32,
    /// The levels, row-major, row 0 on top; each below 2^bits of the panel.
    pub levels: Vec<u16>,
}

/// Where and how the server listens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServeSettings {
    /// Address for slmsuite's protocol, if it is to be spoken. Port 0: a free one.
    pub slmsuite: Option<SocketAddr>,
    /// Address for slmPy's protocol, if it is to be spoken. Port 0: a free one.
    pub slmpy: Option<SocketAddr>,
    /// Most clients connected at once; the longest silent one makes room for one more.
    pub connections: usize,
    /// Longest silence inside a request, and longest time for the panel to show a frame.
    pub patience: Duration,
}

impl Default for ServeSettings {
    /// Both protocols on their usual ports, on loopback.
    fn default() -> Self {
        let loopback = |port| Some(SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port));
        Self { slmsuite: loopback(5025), slmpy: loopback(9999), connections: 32, patience: Duration::from_secs(5) }
    }
}

/// What has come in so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct ServeCounts {
    /// Connections taken.
    pub connections: u64,
    /// Frames handed on to be shown.
    pub frames: u64,
    /// Requests that were refused: malformed, too long, too slow, of another shape.
    pub refused: u64,
}

/// A frame that a client wants shown; it waits for the answer.
#[derive(Debug)]
pub struct FrameRequest {
    levels: SentLevels,
    from: SocketAddr,
    answer: SyncSender<Result<(), String>>,
    /// Set once the client was told that it has waited too long.
    abandoned: Arc<AtomicBool>,
}

impl FrameRequest {
    /// The levels.
    pub fn levels(&self) -> &SentLevels {
        &self.levels
    }

    /// Who sent it.
    pub fn from(&self) -> SocketAddr {
        self.from
    }

    /// Tells the client that the frame is on the panel.
    pub fn shown(self) {
        // A client that has gone needs no answer.
        let _ = self.answer.send(Ok(()));
    }

    /// Tells the client why it is not.
    pub fn refused(self, why: &str) {
        let _ = self.answer.send(Err(why.to_owned()));
    }
}

impl ServedPanel {
    fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Levels of the panel's size and range.
    fn take(&self, levels: Vec<u16>) -> Result<SentLevels, String> {
        let limit = 1u32 << self.bits;
        match levels.iter().find(|&&level| u32::from(level) >= limit) {
            Some(level) => Err(format!("Level {level} is above {}, the panel's highest.", limit - 1)),
            None => Ok(SentLevels { width: self.width, height: self.height, levels }),
        }
    }
}
