//! A thread that does what was last asked of it, and gives up what it is doing when something else is asked.

use crate::error::{Error, Result};
use crate::progress::Progress;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

/// What is asked for, and what is running.
struct State<O> {
    order: O,
    end: bool,
    running: Arc<Progress>,
}

/// Where orders lie between the one who asks and the one who works.
pub(super) struct Desk<O> {
    state: Mutex<State<O>>,
    changed: Condvar,
}

impl<O> Desk<O> {
    /// The state, whatever a panic of the other side has left: it is whole at any time.
    fn held(&self) -> MutexGuard<'_, State<O>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until `take` finds something to do in the order; with it the progress that stops it. None: it is over.
    pub(super) fn next<R>(&self, mut take: impl FnMut(&mut O) -> Option<R>) -> Option<(R, Arc<Progress>)> {
        let mut state = self.held();
        loop {
            if state.end {
                return None;
            }
            if let Some(task) = take(&mut state.order) {
                state.running = Arc::default();
                return Some((task, Arc::clone(&state.running)));
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Looks at the order.
    pub(super) fn look<R>(&self, look: impl FnOnce(&O) -> R) -> R {
        look(&self.held().order)
    }
}

/// The thread; it ends when this is dropped.
pub(super) struct Background<O, T> {
    desk: Arc<Desk<O>>,
    told: Receiver<T>,
    thread: Option<JoinHandle<()>>,
}

impl<O: Send + 'static, T: Send + 'static> Background<O, T> {
    /// Starts `work`, which takes orders from the desk and tells what came of them.
    pub(super) fn start(order: O, work: impl FnOnce(&Desk<O>, &Sender<T>) + Send + 'static) -> Self {
        let (tell, told) = channel();
        let state = Mutex::new(State { order, end: false, running: Arc::default() });
        let desk = Arc::new(Desk { state, changed: Condvar::new() });
        let theirs = Arc::clone(&desk);
        let thread = std::thread::spawn(move || work(&theirs, &tell));
        Self { desk, told, thread: Some(thread) }
    }
}

impl<O, T> Background<O, T> {
    /// Changes the order; what is running is stopped.
    pub(super) fn ask<R>(&self, change: impl FnOnce(&mut O) -> R) -> R {
        let mut state = self.desk.held();
        let answer = change(&mut state.order);
        state.running.stop();
        self.desk.changed.notify_all();
        answer
    }

    /// What was told since the last call, one thing at a time; `what` has ended if the thread has.
    ///
    /// # Errors
    /// [`Error::Unsupported`] when the thread has come to an unforeseen end.
    pub(super) fn poll(&self, what: &str) -> Result<Option<T>> {
        match self.told.try_recv() {
            Ok(told) => Ok(Some(told)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(Error::unsupported(format!("{what} has ended unexpectedly"))),
        }
    }
}

impl<O, T> Drop for Background<O, T> {
    fn drop(&mut self) {
        {
            let mut state = self.desk.held();
            state.end = true;
            state.running.stop();
            self.desk.changed.notify_all();
        }
        if let Some(thread) = self.thread.take() {
            // One that has panicked has said so.
            let _ = thread.join();
        }
    }
}
