//! The server: who may connect, how many at once, and where their frames go. Each client has a thread of its own.

use super::clients::{CONNECTIONS, Client, FRAMES, REFUSED, Shared};
use super::conversation::Conversation;
use super::local_port::{self, PortFile};
#[cfg(unix)]
use super::local_socket::LocalSocket;
use super::log::Log;
use super::stream::{Stream, reachable};
use super::{Announcement, FrameRequest, ServeCounts, ServeSettings, ServedPanel};
use crate::error::{Error, Result};
use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The server at work; it ends when dropped.
pub struct Server {
    shared: Arc<Shared>,
    frames: Receiver<FrameRequest>,
    listeners: Vec<(Address, JoinHandle<()>)>,
    slmsuite: Option<SocketAddr>,
    slmpy: Option<SocketAddr>,
    trigger: Option<SocketAddr>,
}

#[derive(Clone, Copy)]
enum Protocol {
    Slmsuite,
    Slmpy,
    Trigger,
    LocalPort,
    #[cfg(unix)]
    Local,
}

/// Where clients connect.
enum Address {
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
    /// none; [`Error::Io`] when the log cannot be written.
    pub fn start(panel: ServedPanel, settings: &ServeSettings) -> Result<Self> {
        if panel.width == 0 || panel.height == 0 || !(1..=16).contains(&panel.bits) {
            let ServedPanel { width, height, bits, .. } = panel;
            return Err(Error::parameter("panel", format!("{width}x{height} px of {bits} bits cannot be served")));
        }
        if settings.slmsuite.is_none() && settings.slmpy.is_none() && settings.local.is_none() {
            let what = "no protocol is to be spoken; give slmsuite's or slmPy's a port, or a local socket";
            return Err(Error::parameter("serve", what));
        }
        let by_port = settings.local.as_deref().filter(|path| local_port::is_port(path));
        if cfg!(not(unix)) && settings.local.is_some() && by_port.is_none() {
            return Err(Error::unsupported("a local socket needs a Unix; give --local a file that ends in .port"));
        }
        let log = settings.log.as_deref().map(Log::open).transpose()?.unwrap_or_default();
        // The socket first: whoever is refused for it must not have opened ports already.
        #[cfg(unix)]
        let socket = settings.local.as_deref().filter(|path| !local_port::is_port(path));
        #[cfg(unix)]
        let (socket, listener) = socket.map(LocalSocket::take).transpose()?.unzip();
        let (port, port_listener) =
            by_port.map(|path| PortFile::take(path, settings.local_address)).transpose()?.unzip();
        let (sender, frames) = sync_channel(1);
        let shared = Arc::new(Shared {
            panel,
            patience: settings.patience,
            settle: settings.settle,
            calibrated: settings.calibrated,
            log,
            queues: Default::default(),
            frames: sender,
            #[cfg(unix)]
            local: socket,
            port,
            connections: settings.connections.max(1),
            stopping: AtomicBool::new(false),
            clients: Mutex::new(Vec::new()),
            counts: Default::default(),
        });
        let mut server = Self { shared, frames, listeners: Vec::new(), slmsuite: None, slmpy: None, trigger: None };
        server.slmsuite = settings.slmsuite.map(|address| server.listen(address, Protocol::Slmsuite)).transpose()?;
        server.slmpy = settings.slmpy.map(|address| server.listen(address, Protocol::Slmpy)).transpose()?;
        server.trigger = settings.trigger.map(|address| server.listen(address, Protocol::Trigger)).transpose()?;
        if let Some(listener) = port_listener {
            server.take_tcp_clients(listener, Protocol::LocalPort)?;
        }
        #[cfg(unix)]
        if let (Some(listener), Some(path)) = (listener, server.local().map(Path::to_path_buf)) {
            let accept = move || listener.accept().map(|(stream, _)| Stream::Local(stream));
            server.take_clients(Address::Local(path), Protocol::Local, accept);
        }
        Ok(server)
    }

    fn listen(&mut self, address: SocketAddr, protocol: Protocol) -> Result<SocketAddr> {
        let no = |error: io::Error| Error::Display {
            what: format!("cannot listen on {address}: {error}; choose another port, or end the program that has it"),
        };
        self.take_tcp_clients(TcpListener::bind(address).map_err(no)?, protocol)
    }

    fn take_tcp_clients(&mut self, listener: TcpListener, protocol: Protocol) -> Result<SocketAddr> {
        let no = |error: io::Error| Error::Display { what: format!("cannot listen: {error}") };
        let address = listener.local_addr().map_err(no)?;
        let accept = move || listener.accept().map(|(stream, _)| Stream::Tcp(stream));
        self.take_clients(Address::Tcp(address), protocol, accept);
        Ok(address)
    }

    /// Takes clients as they connect, in a thread that ends with the server.
    fn take_clients(
        &mut self,
        address: Address,
        protocol: Protocol,
        accept: impl Fn() -> io::Result<Stream> + Send + 'static,
    ) {
        let shared = Arc::clone(&self.shared);
        let thread = std::thread::spawn(move || {
            loop {
                let accepted = accept();
                if shared.stopping.load(Ordering::SeqCst) {
                    break;
                }
                match accepted {
                    Ok(stream) => start_client(&shared, stream, protocol),
                    // Out of descriptors, or a client that went at once: neither may end the server, nor make it spin.
                    Err(_) => std::thread::sleep(Duration::from_millis(10)),
                }
            }
        });
        self.listeners.push((address, thread));
    }

    /// Where slmsuite's protocol is spoken.
    pub fn slmsuite(&self) -> Option<SocketAddr> {
        self.slmsuite
    }

    /// Where slmPy's protocol is spoken.
    pub fn slmpy(&self) -> Option<SocketAddr> {
        self.slmpy
    }

    /// Where triggers are heard.
    pub fn trigger(&self) -> Option<SocketAddr> {
        self.trigger
    }

    /// The socket of the local protocol, or the file that tells its port.
    pub fn local(&self) -> Option<&Path> {
        let port = self.shared.port.as_ref().map(PortFile::path);
        #[cfg(unix)]
        let port = port.or(self.shared.local.as_ref().map(LocalSocket::socket));
        port
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
        self.shared.clients().iter().any(|other| other.number == client)
    }

    /// What clients have to know to find it.
    pub fn announcement(&self) -> Announcement {
        let ServedPanel { name, width, height, bits, wavelength, .. } = self.shared.panel.clone();
        let (slmsuite, slmpy, trigger) = (self.slmsuite, self.slmpy, self.trigger);
        let local = self.local().map(Path::to_path_buf);
        Announcement { name, width, height, bits, wavelength, slmsuite, slmpy, local, trigger }
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
        for client in self.shared.clients().iter() {
            client.stream.shutdown();
        }
        for (address, thread) in self.listeners.drain(..) {
            // A connection wakes the listener, which then sees that it is to stop. Without it the thread stays, waiting,
            // and does no harm.
            let woken = match &address {
                Address::Tcp(address) => {
                    TcpStream::connect_timeout(&reachable(*address), Duration::from_secs(1)).is_ok()
                }
                #[cfg(unix)]
                Address::Local(path) => std::os::unix::net::UnixStream::connect(path).is_ok(),
            };
            if woken {
                let _ = thread.join();
            }
        }
        if let Some(port) = &self.shared.port {
            port.remove();
        }
        #[cfg(unix)]
        if let Some(socket) = &self.shared.local {
            socket.remove();
        }
    }
}

/// Takes a client in, in a thread of its own; if there are too many, cuts off the longest silent one of its kind.
fn start_client(shared: &Arc<Shared>, stream: Stream, protocol: Protocol) {
    let number = shared.count(CONNECTIONS);
    let Ok(handle) = stream.try_clone() else { return };
    let client = Arc::new(Client {
        number,
        is_local: !matches!(stream, Stream::Tcp(_)),
        stream: handle,
        heard: Mutex::new(Instant::now()),
        answering: AtomicBool::new(false),
        proven: AtomicBool::new(false),
        request: Mutex::new(None),
    });
    {
        let mut clients = shared.clients();
        // Each kind has room of its own: whoever may open a port cannot push out who may open the socket.
        let alike = |other: &Client| other.is_local == client.is_local;
        if clients.iter().filter(|other| alike(other)).count() >= shared.connections {
            shared.count(REFUSED);
            let silent = clients.iter().enumerate();
            let silent = silent.filter(|(_, other)| alike(other) && !other.answering.load(Ordering::SeqCst));
            // Those first that have never shown anything.
            let order = |other: &Client| (other.proven.load(Ordering::SeqCst), other.heard());
            let Some((silent, _)) = silent.min_by_key(|(_, other)| order(other)) else { return };
            clients.remove(silent).stream.shutdown();
        }
        clients.push(Arc::clone(&client));
    }
    let (worker, own) = (Arc::clone(shared), Arc::clone(&client));
    let spawned = std::thread::Builder::new().name("client".into()).spawn(move || {
        stream.prepare(worker.patience);
        let mut conversation = Conversation::new(&worker, &own, stream);
        // However it ends, it concerns this client only.
        let ended = match protocol {
            Protocol::Slmsuite => conversation.slmsuite(),
            Protocol::Slmpy => conversation.slmpy(),
            Protocol::Trigger => conversation.trigger(),
            Protocol::LocalPort => conversation.local_port(),
            #[cfg(unix)]
            Protocol::Local => conversation.local(),
        };
        if let Err(why) = ended {
            let gone = why.kind() == io::ErrorKind::UnexpectedEof;
            conversation.told("connection", &if gone { "gone".to_owned() } else { format!("ended: {why}") });
        }
        drop(conversation);
        worker.forget(&own);
    });
    if spawned.is_err() {
        shared.forget(&client);
    }
}
