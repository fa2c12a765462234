//! How long work tells that it moves on, and is told to stop.
//!
//! A step takes `&Progress`, calls [`Progress::start`] with its amount of work, [`Progress::advance`] as it goes and
//! [`Progress::check`] at least every 50 ms; whoever started it watches the counters from another thread or sets
//! [`Progress::stop`]. The library never prints.
//!
//! ```
//! let progress = holodrive::progress::Progress::new();
//! progress.start("rays", 10);
//! progress.advance(4);
//! assert_eq!(progress.snapshot(), ("rays".into(), 4, 10));
//! progress.stop();
//! assert!(progress.check().is_err());
//! ```

use crate::error::{Error, Result};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Counters of one running job, shared between the worker and its watcher.
#[derive(Debug, Default)]
pub struct Progress {
    step: Mutex<String>,
    done: AtomicU64,
    total: AtomicU64,
    stop: Arc<AtomicBool>,
    /// Whether the job has seen that it is to stop.
    heard: Arc<AtomicBool>,
}

impl Progress {
    /// A job that has not begun.
    pub fn new() -> Self {
        Self::default()
    }
    /// A part of this job with counters of its own that nobody watches; it is stopped with the whole.
    pub fn part(&self) -> Self {
        Self { stop: Arc::clone(&self.stop), heard: Arc::clone(&self.heard), ..Self::default() }
    }
    /// Names the step that begins and the amount of work in it (any unit; 0 when unknown).
    pub fn start(&self, step: &str, total: u64) {
        if let Ok(mut name) = self.step.lock() {
            step.clone_into(&mut name);
        }
        self.done.store(0, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
    }
    /// Adds finished work.
    pub fn advance(&self, work: u64) {
        self.done.fetch_add(work, Ordering::Relaxed);
    }
    /// Asks the job to end at its next check.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }
    /// Whether the job was asked to end: for loops that cannot return an error.
    pub fn stopped(&self) -> bool {
        let stopped = self.stop.load(Ordering::Relaxed);
        if stopped {
            self.heard.store(true, Ordering::Relaxed);
        }
        stopped
    }
    /// Whether the job has seen that it was asked to end.
    pub fn has_heard(&self) -> bool {
        self.heard.load(Ordering::Relaxed)
    }
    /// Fails with [`Error::Interrupted`] once the job was asked to end.
    pub fn check(&self) -> Result<()> {
        if self.stopped() { Err(Error::Interrupted) } else { Ok(()) }
    }
    /// The step's name, work done and work in all.
    pub fn snapshot(&self) -> (String, u64, u64) {
        let step = self.step.lock().map(|name| name.clone()).unwrap_or_default();
        (step, self.done.load(Ordering::Relaxed), self.total.load(Ordering::Relaxed))
    }
}

/// The least time of five from a stop, once the job has done something, to its end: the machine may be busy for a while.
#[cfg(test)]
pub(crate) fn least_time_to_stop<T>(run: impl Fn(&Progress) -> Result<T> + Sync) -> std::time::Duration {
    let after = (0..5).map(|_| {
        let progress = Progress::new();
        std::thread::scope(|scope| {
            let worker = scope.spawn(|| run(&progress).map(|_| ()));
            while progress.snapshot().1 == 0 && !worker.is_finished() {
                std::thread::sleep(std::time::Duration::from_micros(200));
            }
            let asked = std::time::Instant::now();
            progress.stop();
            assert!(matches!(worker.join().expect("no panic"), Err(Error::Interrupted)));
            asked.elapsed()
        })
    });
    after.min().unwrap_or_default()
}
