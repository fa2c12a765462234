//! A progress bar on a terminal, none in a pipe; Ctrl-C.

use crate::progress::Progress;
use crate::{Error, files};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

/// The bar that stands on the terminal, if one does.
static DRAWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Prints a line on standard error; a bar there is taken away for it, and drawn again below.
pub(crate) fn aside(line: &str) {
    match DRAWN.lock().ok().and_then(|drawn| drawn.clone()) {
        Some(bar) => bar.suspend(|| eprintln!("{line}")),
        None => eprintln!("{line}"),
    }
}

/// Watches a job's progress and draws it until it is dropped.
pub(crate) struct Bar {
    pub(crate) progress: Arc<Progress>,
    ended: Arc<AtomicBool>,
    drawer: Option<JoinHandle<()>>,
}

impl Bar {
    /// Starts to watch; Ctrl-C asks the job to stop, a second one ends the program at once.
    pub(crate) fn new() -> Self {
        let progress = Arc::new(Progress::new());
        let stopping = Arc::clone(&progress);
        // Without a handler Ctrl-C still ends the program; what is written is written whole or not at all.
        let asked = AtomicBool::new(false);
        let _ = ctrlc::set_handler(move || {
            if asked.swap(true, Ordering::SeqCst) {
                end_at_once();
            }
            stopping.stop();
            let stopping = Arc::clone(&stopping);
            std::thread::spawn(move || wait_for_end(&stopping));
        });
        let ended = Arc::new(AtomicBool::new(false));
        let drawer = std::io::stderr().is_terminal().then(|| {
            let (progress, ended) = (Arc::clone(&progress), Arc::clone(&ended));
            std::thread::spawn(move || draw(&progress, &ended))
        });
        Self { progress, ended, drawer }
    }
}

/// How long a job may take to see that it is to stop, and to end once it has. Not much less: a window and a server take some
/// hundredths of a second to end in good order.
const DEAF: Duration = Duration::from_millis(500);
const ENDING: Duration = Duration::from_secs(5);

/// Ends the program where the job does not see that it is to stop: it waits for a file, or is in a long step.
fn wait_for_end(stopping: &Progress) {
    std::thread::sleep(DEAF);
    if stopping.has_heard() {
        std::thread::sleep(ENDING);
    }
    end_at_once();
}

/// Ends the program without leaving half of a file.
fn end_at_once() -> ! {
    files::remove_begun();
    eprintln!("holodrive: {}", Error::Interrupted);
    std::process::exit(130);
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(drawer) = self.drawer.take() {
            // A drawer that panicked has nothing more to say.
            let _ = drawer.join();
        }
    }
}

fn draw(progress: &Progress, ended: &AtomicBool) {
    let bar = ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::stderr());
    let style = ProgressStyle::with_template("{msg:16} {wide_bar} {percent:>3} % {eta:>4}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let put = |bar: Option<ProgressBar>| DRAWN.lock().map(|mut drawn| *drawn = bar).is_ok();
    put(Some(bar.clone()));
    let mut shown = String::new();
    while !ended.load(Ordering::Relaxed) {
        let (step, done, total) = progress.snapshot();
        if !step.is_empty() {
            if step != shown {
                bar.reset();
                bar.set_message(step.clone());
                shown = step;
            }
            bar.set_length(total.max(1));
            bar.set_position(done.min(total.max(1)));
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    put(None);
    bar.finish_and_clear();
}
