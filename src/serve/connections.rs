//! The server: who may connect, how many at once, and where their frames go. Each client has a thread of its own.

use super::conversation::Conversation;
use super::stream::Stream;
use super::{FrameRequest, ServeCounts, ServeSettings, ServedPanel};
use crate::error::{Error, Result};
use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The server at work; it ends when dropped.
pub struct Server {
    shared: Arc<Shared>,
    frames: Receiver<FrameRequest>,
    listeners: Vec<(Door, JoinHandle<()>)>,
    slmsuite: Option<SocketAddr>,
    slmpy: Option<SocketAddr>,
}

/// What the clients' threads share.
pub(super) struct Shared {
    pub(super) panel: ServedPanel,
    pub(super) patience: Duration,
    pub(super) settle: Duration,
    pub(super) calibrated: bool,
    /// Bytes of requests that are held now.
    pub(super) held: AtomicUsize,
    pub(super) frames: SyncSender<FrameRequest>,
    #[cfg(unix)]
    local: Option<super::local::Place>,
    connections: usize,
    stopping: AtomicBool,
    clients: Mutex<Vec<Arc<Client>>>,
    counts: [AtomicU64; 3],
}

pub(super) const CONNECTIONS: usize = 0;
pub(super) const FRAMES: usize = 1;
pub(super) const REFUSED: usize = 2;

/// One connection, as the others see it.
pub(super) struct Client {
    /// Running number over all clients, never used again.
    pub(super) number: u64,
    stream: Stream,
    pub(super) heard: Mutex<Instant>,
    /// Its frame is being shown: not to be cut off.
    pub(super) answering: AtomicBool,
}

#[derive(Clone, Copy)]
enum Protocol {
    Slmsuite,
    Slmpy,
    #[cfg(unix)]
    Local,
}

/// Where clients come in.
enum Door {
    Tcp(SocketAddr),
    #[cfg(unix)]
    Local(std::path::PathBuf),
}

impl Server {
    /// Starts to listen.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] when the panel has no pixels or its levels not 1 to 16 bits, or no protocol is to be spoken;
    /// [`Error::Display`] when an address cannot be had; [`Error::Unsupported`] for a local socket where the system has
    /// none.
    pub fn start(panel: ServedPanel, settings: &ServeSettings) -> Result<Self> {
        if panel.width == 0 || panel.height == 0 || !(1..=16).contains(&panel.bits) {
            let ServedPanel { width, height, bits, .. } = panel;
            return Err(Error::parameter("panel", format!("{width}x{height} px of {bits} bits cannot be served")));
        }
        if settings.slmsuite.is_none() && settings.slmpy.is_none() && settings.local.is_none() {
            let what = "no protocol is to be spoken; give --slmsuite or --slmpy a port, or --local";
            return Err(Error::parameter("serve", what));
        }
        if cfg!(not(unix)) && settings.local.is_some() {
            return Err(Error::unsupported("the local socket needs a Unix; give --slmsuite or --slmpy a port instead"));
        }
        // The socket first: whoever is refused for it must not have opened ports already.
        #[cfg(unix)]
        let (place, door) = match &settings.local {
            Some(path) => super::local::Place::take(path).map(|(place, door)| (Some(place), Some(door)))?,
            None => (None, None),
        };
        let (sender, frames) = sync_channel(1);
        let shared = Arc::new(Shared {
            panel,
            patience: settings.patience,
            settle: settings.settle,
            calibrated: settings.calibrated,
            held: AtomicUsize::new(0),
            frames: sender,
            #[cfg(unix)]
            local: place,
            connections: settings.connections.max(1),
            stopping: AtomicBool::new(false),
            clients: Mutex::new(Vec::new()),
            counts: Default::default(),
        });
        let mut server = Self { shared, frames, listeners: Vec::new(), slmsuite: None, slmpy: None };
        server.slmsuite = settings.slmsuite.map(|address| server.listen(address, Protocol::Slmsuite)).transpose()?;
        server.slmpy = settings.slmpy.map(|address| server.listen(address, Protocol::Slmpy)).transpose()?;
        #[cfg(unix)]
        if let (Some(door), Some(path)) = (door, server.local().map(Path::to_path_buf)) {
            let come = move || door.accept().map(|(stream, _)| (Stream::Local(stream), "local".to_owned()));
            server.admit(Door::Local(path), Protocol::Local, come);
        }
        Ok(server)
    }

    fn listen(&mut self, address: SocketAddr, protocol: Protocol) -> Result<SocketAddr> {
        let no = |error: io::Error| Error::Display {
            what: format!("cannot listen on {address}: {error}; choose another port, or end the program that has it"),
        };
        let listener = TcpListener::bind(address).map_err(no)?;
        let address = listener.local_addr().map_err(no)?;
        let come = move || listener.accept().map(|(stream, from)| (Stream::Tcp(stream), from.to_string()));
        self.admit(Door::Tcp(address), protocol, come);
        Ok(address)
    }

    /// Lets clients in as they come, in a thread that ends with the server.
    fn admit(
        &mut self,
        door: Door,
        protocol: Protocol,
        come: impl Fn() -> io::Result<(Stream, String)> + Send + 'static,
    ) {
        let shared = Arc::clone(&self.shared);
        let thread = std::thread::spawn(move || {
            loop {
                let guest = come();
                if shared.stopping.load(Ordering::SeqCst) {
                    break;
                }
                match guest {
                    Ok((stream, from)) => Shared::welcome(&shared, stream, from, protocol),
                    // Out of descriptors, or a client that went at once: neither may end the server, nor make it spin.
                    Err(_) => std::thread::sleep(Duration::from_millis(10)),
                }
            }
        });
        self.listeners.push((door, thread));
    }

    /// Where slmsuite's protocol is spoken.
    pub fn slmsuite(&self) -> Option<SocketAddr> {
        self.slmsuite
    }

    /// Where slmPy's protocol is spoken.
    pub fn slmpy(&self) -> Option<SocketAddr> {
        self.slmpy
    }

    /// The socket of the local protocol.
    #[cfg(unix)]
    pub fn local(&self) -> Option<&Path> {
        self.shared.local.as_ref().map(super::local::Place::socket)
    }

    /// The socket of the local protocol: there is none on this system.
    #[cfg(not(unix))]
    pub fn local(&self) -> Option<&Path> {
        None
    }

    /// The next frame to show; waits for it up to `timeout`. A frame whose client was told that it waited too long is
    /// left out.
    pub fn next(&self, timeout: Duration) -> Option<FrameRequest> {
        let start = Instant::now();
        loop {
            match self.frames.recv_timeout(timeout.saturating_sub(start.elapsed())) {
                Ok(request) if request.abandoned.load(Ordering::SeqCst) => {}
                Ok(request) => return Some(request),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return None,
            }
        }
    }

    /// Whether the client of that number ([`FrameRequest::client`]) is still connected.
    pub fn is_connected(&self, client: u64) -> bool {
        let clients = self.shared.clients.lock().unwrap_or_else(PoisonError::into_inner);
        clients.iter().any(|other| other.number == client)
    }

    /// What has come in so far.
    pub fn counts(&self) -> ServeCounts {
        let [connections, frames, refused] =
            [CONNECTIONS, FRAMES, REFUSED].map(|i| self.shared.counts[i].load(Ordering::Relaxed));
        ServeCounts { connections, frames, refused }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.stopping.store(true, Ordering::SeqCst);
        for client in self.shared.clients.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            client.stream.shutdown();
        }
        for (door, thread) in self.listeners.drain(..) {
            // A connection wakes the listener, which then sees that it is to stop. Without it the thread stays, waiting,
            // and does no harm.
            let knocked = match &door {
                Door::Tcp(address) => TcpStream::connect_timeout(&reachable(*address), Duration::from_secs(1)).is_ok(),
                #[cfg(unix)]
                Door::Local(path) => std::os::unix::net::UnixStream::connect(path).is_ok(),
            };
            if knocked {
                let _ = thread.join();
            }
        }
        #[cfg(unix)]
        if let Some(place) = &self.shared.local {
            place.leave();
        }
    }
}

/// The address by which this machine reaches a listener on `address`.
fn reachable(mut address: SocketAddr) -> SocketAddr {
    if address.ip().is_unspecified() {
        address.set_ip(match address {
            SocketAddr::V4(_) => std::net::Ipv4Addr::LOCALHOST.into(),
            SocketAddr::V6(_) => std::net::Ipv6Addr::LOCALHOST.into(),
        });
    }
    address
}

impl Shared {
    pub(super) fn count(&self, what: usize) -> u64 {
        self.counts[what].fetch_add(1, Ordering::Relaxed)
    }

    /// Where the local protocol's buffers lie.
    #[cfg(unix)]
    pub(super) fn local_folder(&self) -> &Path {
        self.local.as_ref().map_or(Path::new("."), super::local::Place::folder)
    }

    /// Takes a client in, in a thread of its own; if there are too many, cuts off the longest silent one.
    fn welcome(shared: &Arc<Self>, stream: Stream, from: String, protocol: Protocol) {
        let number = shared.count(CONNECTIONS);
        let Ok(own) = stream.try_clone() else { return };
        let (heard, answering) = (Mutex::new(Instant::now()), AtomicBool::new(false));
        let client = Arc::new(Client { number, stream: own, heard, answering });
        {
            let mut clients = shared.clients.lock().unwrap_or_else(PoisonError::into_inner);
            if clients.len() >= shared.connections {
                let silent = clients.iter().filter(|client| !client.answering.load(Ordering::SeqCst));
                match silent.min_by_key(|client| client.heard()) {
                    Some(silent) => {
                        silent.stream.shutdown();
                        let silent = Arc::clone(silent);
                        clients.retain(|client| !Arc::ptr_eq(client, &silent));
                        shared.count(REFUSED);
                    }
                    None => {
                        shared.count(REFUSED);
                        return;
                    }
                }
            }
            clients.push(Arc::clone(&client));
        }
        let worker = Arc::clone(shared);
        let guest = Arc::clone(&client);
        let spawned = std::thread::Builder::new().name("client".into()).spawn(move || {
            stream.prepare(worker.patience);
            let mut conversation = Conversation::new(&worker, &guest, stream, from);
            // However it ends, it concerns this client only.
            let _ = match protocol {
                Protocol::Slmsuite => conversation.slmsuite(),
                Protocol::Slmpy => conversation.slmpy(),
                #[cfg(unix)]
                Protocol::Local => conversation.local(),
            };
            drop(conversation);
            worker.forget(&guest);
        });
        if spawned.is_err() {
            shared.forget(&client);
        }
    }

    fn forget(&self, client: &Arc<Client>) {
        let mut clients = self.clients.lock().unwrap_or_else(PoisonError::into_inner);
        clients.retain(|other| !Arc::ptr_eq(other, client));
    }
}

impl Client {
    fn heard(&self) -> Instant {
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
