//! Long calls: the interpreter's lock is released, Ctrl-C is heard, and progress is told.

use crate::errors::raised;
use holodrive::Result;
use holodrive::progress::Progress;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Time that the library has worked for calls [ns].
static WORKED: AtomicU64 = AtomicU64::new(0);

/// Seconds that the library has worked for calls of this process: what a call takes beyond is the package's own.
#[pyfunction]
pub(crate) fn _worked() -> f64 {
    1e-9 * WORKED.load(Ordering::Relaxed) as f64
}

/// How often signals are looked for and progress is told: an eye takes it for at once.
const LOOK: Duration = Duration::from_millis(25);

/// What is told of progress: `callable(step, done, total)`, made of what the caller gave.
fn watcher(given: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
    let watcher = given.py().import("holodrive._progress")?.getattr("watcher")?;
    Ok(watcher.call1((given,))?.unbind())
}

/// Raises what has come: the signal that Python's handlers make an exception of (on the main thread), or the watcher's own.
fn look(py: Python<'_>, watcher: Option<&Py<PyAny>>, progress: &Progress) -> PyResult<()> {
    py.check_signals()?;
    if let Some(watcher) = watcher {
        let (step, done, total) = progress.snapshot();
        if !step.is_empty() {
            watcher.call1(py, (step, done, total))?;
        }
    }
    Ok(())
}

/// The process in which the library's threads are; 0 before the first call.
static OWNER: AtomicU32 = AtomicU32::new(0);

/// Refuses to wait for threads that a fork has left behind.
fn of_this_process(py: Python<'_>) -> PyResult<()> {
    let own = std::process::id();
    match OWNER.compare_exchange(0, own, Ordering::Relaxed, Ordering::Relaxed) {
        Err(owner) if owner != own => {
            let what = "this process was forked from one in which holodrive had worked, and has none of its threads: start processes \
                        by \"spawn\" (multiprocessing.get_context(\"spawn\"), or DataLoader's multiprocessing_context)";
            Err(raised(py, &holodrive::Error::unsupported(what)))
        }
        _ => Ok(()),
    }
}

/// Does `work` on a thread of its own with the interpreter's lock released. Its progress is told to `given` (a callable, a tqdm
/// bar, `True`); an exception that comes meanwhile, Ctrl-C's or the callable's, stops it and is raised.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    given: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Progress) -> Result<T> + Send,
) -> PyResult<T> {
    of_this_process(py)?;
    let watcher = given.filter(|given| !given.is_none()).map(watcher).transpose()?;
    let watcher = watcher.as_ref();
    let progress = &Progress::new();
    let (done, outcome, raised_meanwhile) = py.detach(|| {
        std::thread::scope(|scope| {
            // The end of the work hangs up.
            let (alive, end) = channel::<()>();
            let worker = scope.spawn(move || {
                let _alive = alive;
                let begin = Instant::now();
                let outcome = work(progress);
                WORKED.fetch_add(begin.elapsed().as_nanos() as u64, Ordering::Relaxed);
                outcome
            });
            let mut raised = None;
            while end.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if raised.is_none() {
                    raised = Python::attach(|py| look(py, watcher, progress)).err();
                    if raised.is_some() {
                        progress.stop();
                    }
                }
            }
            match worker.join() {
                Ok(outcome) => (progress.snapshot(), outcome, raised),
                // A fault of the library's: Python's PanicException.
                Err(panic) => std::panic::resume_unwind(panic),
            }
        })
    });
    if let Some(raised) = raised_meanwhile {
        return Err(raised);
    }
    let value = outcome.map_err(|error| raised(py, &error))?;
    if let Some(watcher) = watcher {
        // The last step is told as done, however short the call was.
        let (step, amount, total) = done;
        watcher.call1(py, (step, amount.max(total), total))?;
        watcher.call1(py, (py.None(), 0, 0))?;
    }
    Ok(value)
}
