//! Who is connected, and what the clients' threads share.

use super::local_port::PortFile;
#[cfg(unix)]
use super::local_socket::LocalSocket;
use super::log::Log;
use super::stream::Stream;
use super::{FrameRequest, ServedPanel};
use std::collections::VecDeque;
#[cfg(unix)]
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// What the clients' threads share.
pub(super) struct Shared {
    pub(super) panel: ServedPanel,
    pub(super) patience: Duration,
    pub(super) settle: Duration,
    pub(super) calibrated: bool,
    pub(super) log: Log,
    /// Room for long requests: of clients over the network, and of local ones.
    pub(super) queues: [Queue; 2],
    pub(super) frames: SyncSender<FrameRequest>,
    #[cfg(unix)]
    pub(super) local: Option<LocalSocket>,
    pub(super) port: Option<PortFile>,
    pub(super) connections: usize,
    pub(super) stopping: AtomicBool,
    pub(super) clients: Mutex<Vec<Arc<Client>>>,
    pub(super) counts: [AtomicU64; 3],
}

pub(super) const CONNECTIONS: usize = 0;
pub(super) const FRAMES: usize = 1;
pub(super) const REFUSED: usize = 2;

/// One connection, as the others see it.
pub(super) struct Client {
    /// Running number over all clients, never used again.
    pub(super) number: u64,
    pub(super) stream: Stream,
    pub(super) heard: Mutex<Instant>,
    /// Its frame is being shown: not to be cut off.
    pub(super) answering: AtomicBool,
    /// Whether it came through the local socket, whose permissions say who it is.
    pub(super) is_local: bool,
    /// Whether a frame of its has been shown.
    pub(super) proven: AtomicBool,
    /// A request of its that is coming in.
    pub(super) request: Mutex<Option<Request>>,
}

/// A request that is not whole yet.
#[derive(Clone, Copy)]
pub(super) struct Request {
    /// When its first bytes came.
    pub(super) since: Instant,
    /// Bytes that it holds beyond its client's own room.
    pub(super) beyond: usize,
    /// Whether it is the server that keeps it waiting.
    pub(super) waits: bool,
}

/// Bytes that are held in all, and who waits for more, first come first.
#[derive(Default)]
pub(super) struct Queue(Mutex<(usize, VecDeque<u64>)>);

impl Queue {
    /// Takes bytes for a client, if there is room and nobody waits before it; else it waits in its place.
    pub(super) fn take(&self, client: u64, bytes: usize, budget: usize) -> bool {
        let (held, waiting) = &mut *self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_next = waiting.front().is_none_or(|first| *first == client);
        if is_next && *held + bytes <= budget {
            *held += bytes;
            waiting.retain(|other| *other != client);
            return true;
        }
        if !waiting.contains(&client) {
            waiting.push_back(client);
        }
        false
    }

    /// Gives up a place.
    pub(super) fn leave(&self, client: u64) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).1.retain(|other| *other != client);
    }

    /// Gives back what a client has held, and its place.
    pub(super) fn give_back(&self, client: u64, bytes: usize) {
        let (held, waiting) = &mut *self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *held -= bytes;
        waiting.retain(|other| *other != client);
    }
}

/// A request younger than this is not cut off to make room.
const YOUNG: Duration = Duration::from_millis(100);

impl Shared {
    /// Cuts off the client that has held a part of a request the longest, to make room for another's; not `own`.
    pub(super) fn cut_off_idle(&self, own: &Client) {
        let mut clients = self.clients();
        let others = clients.iter().enumerate();
        let others = others.filter(|(_, client)| client.number != own.number && client.is_local == own.is_local);
        let idle = others.filter_map(|(at, client)| Some((client.idle_since()?, at)));
        if let Some((_, at)) = idle.min() {
            self.count(REFUSED);
            clients.remove(at).stream.shutdown();
        }
    }

    pub(super) fn count(&self, what: usize) -> u64 {
        self.counts[what].fetch_add(1, Ordering::Relaxed)
    }

    /// Where the local protocol's buffers lie.
    #[cfg(unix)]
    pub(super) fn local_folder(&self) -> &Path {
        self.local.as_ref().map_or(Path::new("."), LocalSocket::folder)
    }

    pub(super) fn forget(&self, client: &Arc<Client>) {
        self.clients().retain(|other| !Arc::ptr_eq(other, client));
    }

    pub(super) fn clients(&self) -> MutexGuard<'_, Vec<Arc<Client>>> {
        self.clients.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Client {
    /// Since when it has held room of others for a request that it does not end.
    fn idle_since(&self) -> Option<Instant> {
        let Request { since, beyond, waits } = (*self.request.lock().unwrap_or_else(PoisonError::into_inner))?;
        let is_idle = since.elapsed() >= YOUNG && beyond > 0 && !waits && !self.answering.load(Ordering::SeqCst);
        is_idle.then_some(since)
    }
    pub(super) fn heard(&self) -> Instant {
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
