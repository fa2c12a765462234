//! Who is connected, and what the clients' threads share.

#[cfg(unix)]
use super::local::LocalSocket;
use super::stream::Stream;
use super::{FrameRequest, ServedPanel};
#[cfg(unix)]
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

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
    pub(super) local: Option<LocalSocket>,
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
}

impl Shared {
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
    pub(super) fn heard(&self) -> Instant {
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
