//! The program under test: this same binary, started again as a process of its own for each job, since a process can
//! have one connection to the window system.

use crate::desk::PATIENCE;
use crate::frames::{Pattern, Picture};
use holodrive::display::{
    Display, OnAbsence, PanelWindow, PlaySettings, Presenter, ShowSettings, Standing, WindowSettings, examine, play,
    show,
};
use holodrive::names::Named;
use holodrive::progress::Progress;
use serde::{Deserialize, Serialize};
use std::io::{Read, Write};
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{self, TryRecvError};
use std::time::{Duration, Instant};

/// The environment variable that carries the job.
const JOB: &str = "HOLODRIVE_DISPLAY_TEST_JOB";

/// What the child is to do.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) enum Job {
    /// List the monitors.
    Monitors,
    /// Look at everything that spoils levels on that monitor.
    Examine(String),
    /// Show one frame.
    Show(ShowJob),
    /// Open the window with the job's frame, then present each of these when the test says "next".
    Frames(ShowJob, Vec<Pattern>),
    /// Play that many numbered frames at that rate.
    Play(ShowJob, u64, Option<f64>),
    /// Show two frames on two monitors at once.
    Two(ShowJob, ShowJob),
}

/// One frame on one monitor.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ShowJob {
    pub(crate) monitor: String,
    pub(crate) pattern: Pattern,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) presenter: String,
    pub(crate) hold: Option<f64>,
    pub(crate) exact: bool,
    pub(crate) wait: bool,
}

impl ShowJob {
    pub(crate) fn new(monitor: &str, picture: (Pattern, u32, u32), presenter: &str) -> Self {
        let (pattern, width, height) = picture;
        let (monitor, presenter) = (monitor.to_owned(), presenter.to_owned());
        Self { monitor, pattern, width, height, presenter, hold: None, exact: true, wait: false }
    }

    pub(crate) fn picture(&self) -> Picture {
        Picture::new(self.pattern, self.width, self.height)
    }

    fn settings(&self) -> holodrive::Result<ShowSettings> {
        Ok(ShowSettings {
            window: self.window()?,
            hold: self.hold.map(Duration::from_secs_f64),
            on_absence: if self.wait { OnAbsence::Wait } else { OnAbsence::End },
            ..ShowSettings::new(self.monitor.parse()?)
        })
    }

    fn window(&self) -> holodrive::Result<WindowSettings> {
        Ok(WindowSettings {
            presenter: Presenter::named(&self.presenter)?,
            exact: self.exact,
            ..WindowSettings::default()
        })
    }
}

/// A report in JSON, or the message of the error.
pub(crate) type Outcome = Result<serde_json::Value, String>;

/// Does the job, if this process was started for one.
pub(crate) fn run_if_asked() -> Option<ExitCode> {
    let job = serde_json::from_str(&std::env::var(JOB).ok()?).expect("job");
    let (text, code) = match run(job) {
        Ok(report) => (report.to_string(), ExitCode::SUCCESS),
        Err(error) => (error.to_string(), ExitCode::from(2)),
    };
    println!("{text}");
    Some(code)
}

fn run(job: Job) -> holodrive::Result<serde_json::Value> {
    let mut display = Display::connect()?;
    match job {
        Job::Monitors => Ok(json(&display.monitors()?)),
        Job::Examine(monitor) => Ok(json(&examine(&mut display, Some(&monitor.parse()?))?)),
        Job::Show(job) => Ok(json(&show(&mut display, job.picture().frame(), &job.settings()?, &stopped_by_input())?)),
        Job::Play(job, count, rate) => {
            let settings = PlaySettings { show: job.settings()?, rate, ahead: 4, settle: 0.02, making: None };
            let frames = (0..count).map(|number| Ok(Picture::numbered(number, job.width, job.height).frame()));
            let mut times = Vec::new();
            let report = play(&mut display, frames, &settings, &mut |t| times.push(*t), &stopped_by_input())?;
            Ok(serde_json::json!({ "report": report, "times": times }))
        }
        Job::Two(one, other) => {
            let progress = stopped_by_input();
            let mut open = |job: &ShowJob| {
                let frame = Arc::new(job.picture().frame());
                PanelWindow::open(&mut display, &job.monitor.parse()?, &frame, &job.window()?)
            };
            let mut panels = [open(&one)?, open(&other)?];
            while !progress.stopped() {
                display.turn(Duration::from_millis(5))?;
                for panel in &mut panels {
                    panel.attend(&mut display)?;
                }
            }
            Ok(json(&panels.map(|panel| panel.monitor().name.clone())))
        }
        Job::Frames(job, patterns) => {
            let first = Arc::new(job.picture().frame());
            let frames: Vec<_> = patterns
                .iter()
                .map(|&pattern| Arc::new(Picture::new(pattern, job.width, job.height).frame()))
                .collect();
            let mut panel = PanelWindow::open(&mut display, &job.monitor.parse()?, &first, &job.window()?)?;
            let (sender, commands) = mpsc::channel();
            std::thread::spawn(move || std::io::stdin().lines().map_while(Result::ok).try_for_each(|l| sender.send(l)));
            let mut presented = Vec::new();
            loop {
                display.turn(Duration::from_millis(2))?;
                if panel.attend(&mut display)? == Standing::Ended {
                    break;
                }
                match commands.try_recv() {
                    Ok(_) => {
                        let Some(frame) = frames.get(presented.len()) else { break };
                        let shown = panel.present(frame)?;
                        presented.push(serde_json::json!({ "number": shown.number, "taken": shown.taken }));
                    }
                    Err(TryRecvError::Empty) => {}
                    Err(TryRecvError::Disconnected) => break,
                }
            }
            Ok(serde_json::json!({ "presented": presented, "presenter": panel.presenter(), "frames": panel.frames() }))
        }
    }
}

fn json(report: &impl Serialize) -> serde_json::Value {
    serde_json::to_value(report).expect("report")
}

/// The end of standard input is the wish to stop: it comes when the test asks, and also when the test dies.
fn stopped_by_input() -> Arc<Progress> {
    let progress = Arc::new(Progress::new());
    let stop = Arc::clone(&progress);
    std::thread::spawn(move || {
        let _ = std::io::stdin().read_to_end(&mut Vec::new());
        stop.stop();
    });
    progress
}

/// A child at work.
pub(crate) struct Running {
    process: Child,
    _runtime: tempfile::TempDir,
}

impl Running {
    /// Starts a child for `job` on that X server (none: no display server at all).
    pub(crate) fn start(display: Option<&str>, job: &Job, environment: &[(&str, &str)]) -> Self {
        let mut command = Command::new(std::env::current_exe().expect("own path"));
        command.env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET").env_remove("DISPLAY");
        if let Some(display) = display {
            command.env("DISPLAY", display);
        }
        // Vulkan's window system code complains without one.
        let runtime = tempfile::tempdir().expect("folder");
        command.env("XDG_RUNTIME_DIR", runtime.path());
        command.env(JOB, serde_json::to_string(job).expect("job")).envs(environment.iter().copied());
        let process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("child process");
        Self { process, _runtime: runtime }
    }

    /// Tells it to present the next frame.
    pub(crate) fn next(&mut self) {
        writeln!(self.process.stdin.as_ref().expect("input"), "next").expect("the child listens");
    }

    /// Whether it has ended with an error.
    pub(crate) fn refused(&mut self) -> bool {
        self.process.try_wait().expect("child process").is_some_and(|status| !status.success())
    }

    /// Asks it to stop, and returns what it reports.
    pub(crate) fn stop(mut self) -> Outcome {
        drop(self.process.stdin.take());
        self.end()
    }

    /// Waits until it ends by itself.
    pub(crate) fn end(mut self) -> Outcome {
        let start = Instant::now();
        let status = loop {
            if let Some(status) = self.process.try_wait().expect("child process") {
                break status;
            }
            assert!(start.elapsed() < PATIENCE, "the child does not end");
            std::thread::sleep(Duration::from_millis(5));
        };
        let mut text = String::new();
        self.process.stdout.take().expect("output").read_to_string(&mut text).expect("output");
        match status.code() {
            Some(0) => Ok(serde_json::from_str(&text).expect("report")),
            Some(2) => Err(text.trim().to_owned()),
            _ => panic!("the child ended with {status}: {text}"),
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
