//! A progress bar on a terminal, none in a pipe; Ctrl-C.

use holodrive::progress::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

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
        let _ = ctrlc::set_handler(move || {
            if stopping.stopped() {
                std::process::exit(130);
            }
            stopping.stop();
        });
        let ended = Arc::new(AtomicBool::new(false));
        let drawer = std::io::stderr().is_terminal().then(|| {
            let (progress, ended) = (Arc::clone(&progress), Arc::clone(&ended));
            std::thread::spawn(move || draw(&progress, &ended))
        });
        Self { progress, ended, drawer }
    }
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
    bar.finish_and_clear();
}
