//! Clients and their connections: each read in its own thread, within limits of size and time.

use super::slmsuite::{Wish, answer, description, hardware};
use super::{FrameRequest, SentLevels, ServeCounts, ServeSettings, ServedPanel, slmpy, slmsuite};
use crate::error::{Error, Result};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Bytes read at once.
const CHUNK: usize = 64 * 1024;
/// How many whole requests' worth of bytes may be held at once, over all clients.
const HELD_REQUESTS: usize = 4;
/// A request may take this many times the patience in all, however steadily it drips.
const WHOLE_REQUEST: u32 = 6;

/// The server at work; it ends when dropped.
pub struct Server {
    shared: Arc<Shared>,
    frames: Receiver<FrameRequest>,
    listeners: Vec<(SocketAddr, JoinHandle<()>)>,
    slmsuite: Option<SocketAddr>,
    slmpy: Option<SocketAddr>,
}

struct Shared {
    panel: ServedPanel,
    connections: usize,
    patience: Duration,
    stopping: AtomicBool,
    held: AtomicUsize,
    clients: Mutex<Vec<Arc<Client>>>,
    frames: SyncSender<FrameRequest>,
    counts: [AtomicU64; 3],
}

const CONNECTIONS: usize = 0;
const FRAMES: usize = 1;
const REFUSED: usize = 2;

/// One connection, as the others see it.
struct Client {
    stream: TcpStream,
    heard: Mutex<Instant>,
    /// Its frame is being shown: not to be cut off.
    answering: AtomicBool,
}

#[derive(Clone, Copy)]
enum Protocol {
    Slmsuite,
    Slmpy,
}

impl Server {
    /// Starts to listen.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] when the panel has no pixels or its levels not 1 to 16 bits, or no protocol is to be spoken;
    /// [`Error::Display`] when an address cannot be had.
    pub fn start(panel: ServedPanel, settings: &ServeSettings) -> Result<Self> {
        if panel.width == 0 || panel.height == 0 || !(1..=16).contains(&panel.bits) {
            let ServedPanel { width, height, bits, .. } = panel;
            return Err(Error::parameter("panel", format!("{width}x{height} px of {bits} bits cannot be served")));
        }
        if settings.slmsuite.is_none() && settings.slmpy.is_none() {
            return Err(Error::parameter("serve", "no protocol is to be spoken; give --slmsuite or --slmpy a port"));
        }
        let (sender, frames) = sync_channel(1);
        let shared = Arc::new(Shared {
            panel,
            connections: settings.connections.max(1),
            patience: settings.patience,
            stopping: AtomicBool::new(false),
            held: AtomicUsize::new(0),
            clients: Mutex::new(Vec::new()),
            frames: sender,
            counts: Default::default(),
        });
        let mut server = Self { shared, frames, listeners: Vec::new(), slmsuite: None, slmpy: None };
        server.slmsuite = settings.slmsuite.map(|address| server.listen(address, Protocol::Slmsuite)).transpose()?;
        server.slmpy = settings.slmpy.map(|address| server.listen(address, Protocol::Slmpy)).transpose()?;
        Ok(server)
    }

    fn listen(&mut self, address: SocketAddr, protocol: Protocol) -> Result<SocketAddr> {
        let no = |error: io::Error| Error::Display {
            what: format!("cannot listen on {address}: {error}; choose another port, or end the program that has it"),
        };
        let listener = TcpListener::bind(address).map_err(no)?;
        let address = listener.local_addr().map_err(no)?;
        let shared = Arc::clone(&self.shared);
        let thread = std::thread::spawn(move || {
            for stream in listener.incoming() {
                if shared.stopping.load(Ordering::SeqCst) {
                    break;
                }
                match stream {
                    Ok(stream) => Shared::welcome(&shared, stream, protocol),
                    // Out of descriptors, or a client that went at once: neither may end the server, nor make it spin.
                    Err(_) => std::thread::sleep(Duration::from_millis(10)),
                }
            }
        });
        self.listeners.push((address, thread));
        Ok(address)
    }

    /// Where slmsuite's protocol is spoken.
    pub fn slmsuite(&self) -> Option<SocketAddr> {
        self.slmsuite
    }

    /// Where slmPy's protocol is spoken.
    pub fn slmpy(&self) -> Option<SocketAddr> {
        self.slmpy
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
            let _ = client.stream.shutdown(Shutdown::Both);
        }
        for (address, thread) in self.listeners.drain(..) {
            // A connection wakes the listener, which then sees that it is to stop. Without it the thread stays, waiting,
            // and does no harm.
            if TcpStream::connect_timeout(&reachable(address), Duration::from_secs(1)).is_ok() {
                let _ = thread.join();
            }
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
    fn count(&self, what: usize) {
        self.counts[what].fetch_add(1, Ordering::Relaxed);
    }

    /// Takes a client in, in a thread of its own; if there are too many, cuts off the longest silent one.
    fn welcome(shared: &Arc<Self>, stream: TcpStream, protocol: Protocol) {
        shared.count(CONNECTIONS);
        let (Ok(own), Ok(from)) = (stream.try_clone(), stream.peer_addr()) else { return };
        let client =
            Arc::new(Client { stream: own, heard: Mutex::new(Instant::now()), answering: AtomicBool::new(false) });
        {
            let mut clients = shared.clients.lock().unwrap_or_else(PoisonError::into_inner);
            if clients.len() >= shared.connections {
                let silent = clients.iter().filter(|client| !client.answering.load(Ordering::SeqCst));
                match silent.min_by_key(|client| client.heard()) {
                    Some(silent) => {
                        let _ = silent.stream.shutdown(Shutdown::Both);
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
            let _ = stream.set_nodelay(true);
            let _ = stream.set_write_timeout(Some(worker.patience));
            let mut conversation = Conversation { shared: &worker, client: &guest, stream, from, held: 0 };
            // However it ends, it concerns this client only.
            let _ = match protocol {
                Protocol::Slmsuite => conversation.slmsuite(),
                Protocol::Slmpy => conversation.slmpy(),
            };
            conversation.release();
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

/// One client's talk with the server.
struct Conversation<'a> {
    shared: &'a Shared,
    client: &'a Client,
    stream: TcpStream,
    from: SocketAddr,
    /// Bytes of it that are held, of the server's budget.
    held: usize,
}

impl Conversation<'_> {
    /// One line in, one line out.
    fn slmsuite(&mut self) -> io::Result<()> {
        let panel = &self.shared.panel;
        let line = match self.line(slmsuite::request_limit(panel)) {
            Ok(line) => line,
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Err(error),
            Err(error) => {
                self.shared.count(REFUSED);
                return self.reply(answer(Err(error.to_string())).as_bytes());
            }
        };
        let wish = slmsuite::read(&line, panel);
        drop(line);
        self.release();
        let met = match wish {
            Ok(Wish::Ping) => Ok(hardware(panel)),
            Ok(Wish::Describe) => Ok(description(panel)),
            Ok(Wish::Show(levels)) => self.show(levels).map(|()| serde_json::Value::Null),
            Err(why) => {
                self.shared.count(REFUSED);
                Err(why)
            }
        };
        self.reply(answer(met).as_bytes())
    }

    /// Frame after frame, until the client goes or sends what has no end that can be found.
    fn slmpy(&mut self) -> io::Result<()> {
        let limit = slmpy::frame_limit(&self.shared.panel);
        loop {
            let mut head = [0; 4];
            // Between frames a client may be silent for as long as it likes.
            self.stream.set_read_timeout(None)?;
            self.stream.read_exact(&mut head[..1])?;
            self.whole(&mut head[1..], Instant::now())?;
            let length = i32::from_le_bytes(head);
            let Some(length) = usize::try_from(length).ok().filter(|length| (1..=limit).contains(length)) else {
                self.shared.count(REFUSED);
                return self.reply(slmpy::ERR);
            };
            if !self.hold(length, limit) {
                self.shared.count(REFUSED);
                return self.reply(slmpy::ERR);
            }
            let mut sent = Vec::new();
            let start = Instant::now();
            while sent.len() < length {
                let had = sent.len();
                // Memory grows with what has come, not with what was promised.
                sent.resize((had + CHUNK).min(length), 0);
                if let Err(error) = self.whole(&mut sent[had..], start) {
                    self.shared.count(REFUSED);
                    let _ = self.reply(slmpy::ERR);
                    return Err(error);
                }
            }
            let read = slmpy::read(&sent, &self.shared.panel);
            drop(sent);
            self.release();
            let shown = match read {
                Ok(levels) => self.show(levels).is_ok(),
                Err(_) => {
                    self.shared.count(REFUSED);
                    false
                }
            };
            self.reply(if shown { slmpy::DONE } else { slmpy::ERR })?;
        }
    }

    /// Hands a frame on and waits until it is on the panel.
    fn show(&self, levels: SentLevels) -> Result<(), String> {
        self.client.answering.store(true, Ordering::SeqCst);
        let (answer, shown) = sync_channel(1);
        self.shared.count(FRAMES);
        let abandoned = Arc::new(AtomicBool::new(false));
        let request = FrameRequest { levels, from: self.from, answer, abandoned: Arc::clone(&abandoned) };
        let sent = self.shared.frames.send(request).map_err(|_| "The panel is no longer served.".to_owned());
        let outcome = sent.and_then(|()| {
            let answer = shown.recv_timeout(self.shared.patience);
            answer.unwrap_or_else(|_| {
                abandoned.store(true, Ordering::SeqCst);
                Err("The panel did not show the frame in time.".into())
            })
        });
        self.client.answering.store(false, Ordering::SeqCst);
        outcome
    }

    fn reply(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)?;
        self.stream.flush()
    }

    /// Reads up to the first line feed, which is left out.
    fn line(&mut self, limit: usize) -> io::Result<Vec<u8>> {
        let start = Instant::now();
        let (mut line, mut chunk) = (Vec::new(), vec![0; CHUNK]);
        loop {
            let read = self.some(&mut chunk, start)?;
            let (part, ended) = match chunk[..read].iter().position(|&byte| byte == b'\n') {
                Some(end) => (&chunk[..end], true),
                None => (&chunk[..read], false),
            };
            if line.len() + part.len() > limit {
                return Err(io::Error::new(
                    ErrorKind::InvalidData,
                    "The request is longer than a frame of this panel.",
                ));
            }
            if !self.hold(part.len(), limit) {
                return Err(io::Error::new(ErrorKind::OutOfMemory, "The server is busy with other requests."));
            }
            line.extend_from_slice(part);
            if ended {
                return Ok(line);
            }
        }
    }

    /// Fills `buffer` whole.
    fn whole(&mut self, buffer: &mut [u8], start: Instant) -> io::Result<()> {
        let mut filled = 0;
        while filled < buffer.len() {
            filled += self.some(&mut buffer[filled..], start)?;
        }
        Ok(())
    }

    /// Reads what has come, at least a byte; fails when the client is silent too long or the request of `start` is too old.
    fn some(&mut self, buffer: &mut [u8], start: Instant) -> io::Result<usize> {
        let patience = self.shared.patience;
        let left = (patience * WHOLE_REQUEST).saturating_sub(start.elapsed());
        let late = || io::Error::new(ErrorKind::TimedOut, "The request did not come in time.");
        if left.is_zero() {
            return Err(late());
        }
        self.stream.set_read_timeout(Some(patience.min(left)))?;
        match self.stream.read(buffer) {
            Ok(0) => Err(io::Error::new(ErrorKind::UnexpectedEof, "The client has gone.")),
            Ok(read) => {
                *self.client.heard.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
                Ok(read)
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => Err(late()),
            Err(error) if error.kind() == ErrorKind::Interrupted => self.some(buffer, start),
            Err(error) => Err(error),
        }
    }

    /// Takes `bytes` of the server's budget; false when it is spent. The first request always fits.
    fn hold(&mut self, bytes: usize, limit: usize) -> bool {
        let before = self.shared.held.fetch_add(bytes, Ordering::SeqCst);
        self.held += bytes;
        before + bytes <= HELD_REQUESTS * limit
    }

    fn release(&mut self) {
        self.shared.held.fetch_sub(std::mem::take(&mut self.held), Ordering::SeqCst);
    }
}
