//! Frames from other programs: a server that speaks slmsuite's and slmPy's protocols, and one of its own for programs on
//! the same machine (Python's side of it is `holodrive.py` beside this file, [`PYTHON`]).
//!
//! [`Server`] only takes frames and answers; whoever runs it owns the panel, takes each frame by [`Server::next`], shows
//! it, and says so by [`FrameRequest::shown`], upon which the client gets its answer. [`keep`] is that for any [`Output`],
//! so that the same server stands before a real panel and a simulated one ([`SimulatedOutput`]).
//!
//! In step with an experiment, frames are kept ready under names ([`Task::Preload`]), shown by name, played at a rate, or one
//! after another as a line of text comes on a port of its own ([`ServeSettings::trigger`]).
//!
//! slmsuite's and slmPy's protocols are neither encrypted nor authenticated: an address other than loopback lets the whole
//! network write on the panel. Whatever a client sends, nothing is held that is longer than a frame of the panel can be;
//! silent clients are cut off inside a request, and the longest silent one when there are too many.
//!
//! ```
//! use holodrive::panel::PanelProfile;
//! use holodrive::serve::{Driver, Flip, ServeSettings, Server};
//! use std::io::{Read, Write};
//! use std::net::TcpStream;
//! use std::time::{Duration, Instant};
//!
//! let panel = PanelProfile::find("generic")?;
//! let driver = Driver::new(&panel, 532e-9, None)?;
//! let free_port = Some(([127, 0, 0, 1], 0).into());
//! let settings = ServeSettings { slmsuite: None, slmpy: free_port, ..ServeSettings::default() };
//! let server = Server::start(driver.served("slm")?, &settings)?;
//! // What a client does: the length of a frame, its levels, and the answer.
//! let mut client = TcpStream::connect(server.slmpy().expect("asked for"))?;
//! let levels = vec![7; panel.width * panel.height];
//! let sender = std::thread::spawn(move || -> std::io::Result<[u8; 4]> {
//!     client.write_all(&(levels.len() as u32).to_le_bytes())?;
//!     client.write_all(&levels)?;
//!     let mut answer = [0; 4];
//!     client.read_exact(&mut answer)?;
//!     Ok(answer)
//! });
//! // What the panel's keeper does.
//! let mut request = server.next(Duration::from_secs(5)).expect("a frame");
//! let frame = driver.frame(request.take_frame())?;
//! assert!(frame.levels.iter().all(|level| *level == 7));
//! request.shown(Flip { at: Instant::now(), number: 1, missed: 0 });
//! assert_eq!(sender.join().expect("no panic")?, *b"done");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod clients;
mod clock;
mod connections;
mod conversation;
mod keeping;
mod local;
mod local_port;
mod local_request;
#[cfg(unix)]
mod local_socket;
mod local_talk;
mod log;
mod output;
mod playing;
mod preloaded;
mod slmpy;
mod slmsuite;
mod stream;
mod task;
mod trigger;

pub use clock::monotonic_seconds;
pub use connections::Server;
pub use keeping::{Driver, KeepReport, KeepSettings, Latency, OnClientGone, keep};
pub use output::{Output, Readiness, ShownAt, SimulatedOutput, not_ready};
pub use task::{Done, MOST_PLAYED, Task};

use crate::panel::Modulation;
use serde::Serialize;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

/// The Python module that speaks the local protocol, as text.
pub const PYTHON: &str = include_str!("holodrive.py");

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
    /// What it modulates.
    pub modulation: Modulation,
    /// Distance between pixels across and down [m].
    pub pixel_pitch: [f64; 2],
    /// The wavelength in use [m].
    pub wavelength: f64,
    /// The wavelength at which the whole range of levels is one turn of phase [m].
    pub design_wavelength: f64,
    /// Time from a frame's being presented until the panel has settled on it [s].
    pub settle_time: f64,
    /// What each level does at the wavelength in use: phase [rad], or transmittance; the mean, where pixels differ.
    pub curve: Vec<f64>,
}

/// Where clients look for the panel of that name by the local protocol: a socket, or where the system has no such sockets a file
/// that tells a port and its key.
pub fn usual_local(name: &str) -> PathBuf {
    #[cfg(unix)]
    return local_socket::runtime_folder().join(format!("{name}.sock"));
    #[cfg(not(unix))]
    local_port::runtime_folder().join(format!("{name}.{}", local_port::ENDING))
}

/// A frame as a client sent it: of the panel's size, row-major, row 0 on top.
#[derive(Clone, Debug, PartialEq)]
pub enum SentFrame {
    /// Final drive levels, each below 2^bits of the panel: to be packed and shown as they are.
    Levels(Vec<u16>),
    /// Phases [rad] or, on an amplitude panel, amplitude transmittances: to go through correction and level curve.
    Values(Vec<f32>),
}

/// Where and how the server listens.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServeSettings {
    /// Address for slmsuite's protocol, if it is to be spoken. Port 0: a free one.
    pub slmsuite: Option<SocketAddr>,
    /// Address for slmPy's protocol, if it is to be spoken. Port 0: a free one.
    pub slmpy: Option<SocketAddr>,
    /// Socket for the local protocol, if it is to be spoken; a path that ends in `.port` is a file for where its port is.
    pub local: Option<PathBuf>,
    /// Address of such a port.
    pub local_address: IpAddr,
    /// Address for triggers, if they are to be heard: a line of text shows the next frame of the armed list, or the one of
    /// that name. Port 0: a free one.
    pub trigger: Option<SocketAddr>,
    /// Whether slmsuite's levels stand for phases that the panel's correction and curve are still to be applied to.
    pub calibrated: bool,
    /// Time after a frame's flip at which it is answered: none, or the panel's settle time.
    pub settle: Duration,
    /// File to which a line is added for each request: when, who, what, and what came of it.
    pub log: Option<PathBuf>,
    /// Most clients connected at once; the longest silent one makes room for one more.
    pub connections: usize,
    /// Longest silence inside a request, and longest time for the panel to show a frame.
    pub patience: Duration,
}

impl Default for ServeSettings {
    /// slmsuite's and slmPy's protocols on their usual ports, on loopback; final levels, answered at the flip.
    fn default() -> Self {
        let loopback = |port| Some(SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port));
        Self {
            slmsuite: loopback(5025),
            slmpy: loopback(9999),
            local: None,
            local_address: IpAddr::V4(Ipv4Addr::LOCALHOST),
            trigger: None,
            calibrated: false,
            settle: Duration::ZERO,
            log: None,
            connections: 32,
            patience: Duration::from_secs(5),
        }
    }
}

/// What clients have to know to find a server: the panel and where each protocol is spoken.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Announcement {
    /// The name by which clients ask for the panel.
    pub name: String,
    /// Columns [px].
    pub width: u32,
    /// Rows [px].
    pub height: u32,
    /// Bits of a drive level.
    pub bits: u8,
    /// The wavelength in use [m].
    pub wavelength: f64,
    /// Address of slmsuite's protocol.
    pub slmsuite: Option<SocketAddr>,
    /// Address of slmPy's protocol.
    pub slmpy: Option<SocketAddr>,
    /// Socket of the local protocol, or the file that tells its port.
    pub local: Option<PathBuf>,
    /// Address of triggers.
    pub trigger: Option<SocketAddr>,
}

/// What has come in so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ServeCounts {
    /// Connections taken.
    pub connections: u64,
    /// Frames handed on to be shown.
    pub frames: u64,
    /// Requests that were refused: malformed, too long, too slow, of another shape.
    pub refused: u64,
}

/// When and how a frame came on the panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flip {
    /// When it was handed over for the panel's next refresh.
    pub at: Instant,
    /// Running number of the frame on its panel; the idle frame is 0.
    pub number: u64,
    /// Refreshes that went by between its arrival and its flip, beside the one that every frame waits for.
    pub missed: u64,
}

/// What a client wants of the panel, usually a frame shown; it waits for the answer.
#[derive(Debug)]
pub struct FrameRequest {
    task: Task,
    frame: SentFrame,
    arrived: Instant,
    client: Option<u64>,
    answer: SyncSender<Result<Done, String>>,
    /// Set once the client was told that it has waited too long.
    abandoned: Arc<AtomicBool>,
}

impl FrameRequest {
    /// What is to be done.
    pub fn task(&self) -> &Task {
        &self.task
    }

    /// The frame, of tasks that bring one; else an empty one.
    pub fn frame(&self) -> &SentFrame {
        &self.frame
    }

    /// The frame, out of the request: an empty one stays in it.
    pub fn take_frame(&mut self) -> SentFrame {
        std::mem::take(&mut self.frame)
    }

    /// When all of it had come.
    pub fn arrived(&self) -> Instant {
        self.arrived
    }

    /// The number of its client, where a client stays connected after its frame (slmPy's and the local protocol).
    pub fn client(&self) -> Option<u64> {
        self.client
    }

    /// Whether its client has gone, or was told that it has waited too long.
    pub fn is_abandoned(&self) -> bool {
        self.abandoned.load(Ordering::SeqCst)
    }

    /// Tells the client that the frame is on the panel.
    pub fn shown(self, flip: Flip) {
        self.done(Done::Shown(flip));
    }

    /// Tells the client what came of its task.
    pub fn done(self, done: Done) {
        // A client that has gone needs no answer.
        let _ = self.answer.send(Ok(done));
    }

    /// Tells the client why it is not.
    pub fn refused(self, why: &str) {
        let _ = self.answer.send(Err(why.to_owned()));
    }
}

impl Default for SentFrame {
    fn default() -> Self {
        Self::Levels(Vec::new())
    }
}

impl ServedPanel {
    fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Levels of the panel's size and range.
    fn take(&self, levels: Vec<u16>) -> Result<SentFrame, String> {
        let limit = 1u32 << self.bits;
        match levels.iter().find(|&&level| u32::from(level) >= limit) {
            Some(level) => Err(format!("Level {level} is above {}, the panel's highest.", limit - 1)),
            None => Ok(SentFrame::Levels(levels)),
        }
    }
}
