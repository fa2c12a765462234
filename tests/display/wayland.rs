//! The same on a real Wayland compositor without a screen (sway): as far as it obeys, every level; where it does not, a
//! refusal.

use crate::desk::{Desk, PATIENCE};
use crate::frames::{Pattern, Picture};
use crate::serving::{Served, SlmPy};
use crate::{Case, Ended};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

pub(crate) const CASES: &[Case] = &[
    ("on_wayland_every_level_is_there_and_nothing_elsewhere", |_: &Desk| on_sway(exact)),
    ("on_wayland_what_alters_pixels_is_refused", |_: &Desk| on_sway(refused)),
];

const OPERATOR: &str = "HEADLESS-1";
const PANEL: &str = "HEADLESS-2";
const CONFIGURATION: &str = "\
output HEADLESS-1 resolution 1280x720 position 0 0
output HEADLESS-2 resolution 1920x1080 position 1280 0
output * bg #204060 solid_color
default_border none
";
/// sway does not run as root: any other user will do.
const USER: u32 = 4242;

struct Sway {
    process: Child,
    folder: tempfile::TempDir,
}

impl Drop for Sway {
    fn drop(&mut self) {
        // Asked to end, it takes its helpers with it.
        let _ = self.command("swaymsg").arg("exit").output();
        let start = Instant::now();
        while matches!(self.process.try_wait(), Ok(None)) && start.elapsed() < Duration::from_secs(5) {
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn on_sway(case: impl FnOnce(&Sway) -> Ended) -> Ended {
    for needed in ["sway", "grim", "setpriv"] {
        if Command::new(needed).arg("--help").stdout(Stdio::null()).stderr(Stdio::null()).status().is_err() {
            return Ended::Optional(format!("{needed} is not installed"));
        }
    }
    let folder = tempfile::tempdir().expect("folder");
    std::fs::write(folder.path().join("sway.conf"), CONFIGURATION).expect("configuration");
    std::os::unix::fs::chown(folder.path(), Some(USER), Some(USER)).expect("root");
    let user = USER.to_string();
    let process = Command::new("setpriv")
        .args(["--reuid", &user, "--regid", &user, "--clear-groups", "sway", "-c"])
        .arg(folder.path().join("sway.conf"))
        .env_clear()
        .env("PATH", std::env::var_os("PATH").unwrap_or_default())
        .env("HOME", folder.path())
        .env("XDG_RUNTIME_DIR", folder.path())
        .env("SWAYSOCK", folder.path().join("sway.sock"))
        .envs([("WLR_BACKENDS", "headless"), ("WLR_HEADLESS_OUTPUTS", "2"), ("WLR_RENDERER", "pixman")])
        .env("WLR_LIBINPUT_NO_DEVICES", "1")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("sway");
    let sway = Sway { process, folder };
    wait_until("sway starts", || {
        let told = sway.command("swaymsg").args(["-t", "get_outputs", "-r"]).output().expect("swaymsg");
        let told = String::from_utf8_lossy(&told.stdout).into_owned();
        told.contains(OPERATOR) && told.contains(PANEL) && sway.capture(PANEL).is_some()
    });
    case(&sway)
}

fn wait_until(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < PATIENCE, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

impl Sway {
    /// A program on this compositor, and on no X server.
    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.env_remove("DISPLAY").env("XDG_RUNTIME_DIR", self.folder.path()).env("WAYLAND_DISPLAY", "wayland-1");
        command.env("SWAYSOCK", self.folder.path().join("sway.sock"));
        command
    }

    fn holodrive(&self, folder: &Path) -> Command {
        let mut command = self.command(env!("CARGO_BIN_EXE_holodrive"));
        command.current_dir(folder);
        command
    }

    fn set(&self, what: &str) {
        let told = self.command("swaymsg").arg(format!("output {PANEL} {what}")).output().expect("swaymsg");
        assert!(told.status.success(), "{what}: {}", String::from_utf8_lossy(&told.stdout));
    }

    /// What is on a monitor.
    fn capture(&self, output: &str) -> Option<Picture> {
        let seen = self.command("grim").args(["-o", output, "-t", "ppm", "-"]).output().expect("grim");
        // "P6", width and height, highest level: one line each.
        let mut parts = seen.stdout.splitn(4, |&byte| byte == b'\n');
        let (kind, size, highest, bytes) = (parts.next()?, parts.next()?, parts.next()?, parts.next()?);
        assert_eq!((kind, highest), (&b"P6"[..], &b"255"[..]));
        let size = String::from_utf8_lossy(size).into_owned();
        let (width, height) = size.split_once(' ')?;
        let pixels = bytes.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        Some(Picture { width: width.parse().ok()?, height: height.parse().ok()?, pixels })
    }

    fn wait_for(&self, wanted: &Picture) {
        let start = Instant::now();
        loop {
            let seen = self.capture(PANEL).expect("capture");
            if seen == *wanted {
                return;
            }
            assert!(start.elapsed() < PATIENCE, "the monitor does not show the frame: {}", seen.difference(wanted));
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// Writes `frame.png` of the generic panel's size; returns what must be seen of it.
fn frame(folder: &Path, pattern: Pattern) -> Picture {
    let picture = Picture::new(pattern, 1920, 1080);
    let levels: Vec<u8> = picture.pixels.iter().map(|pixel| pixel[0]).collect();
    image::GrayImage::from_raw(1920, 1080, levels).expect("picture").save(folder.join("frame.png")).expect("frame");
    picture
}

fn exact(sway: &Sway) -> Ended {
    let before = sway.capture(OPERATOR).expect("capture");
    let folder = tempfile::tempdir().expect("folder");
    // By whatever brings it there: the processor, and a graphics driver if there is one.
    for (presenter, pattern) in [("software", Pattern::Checker), ("auto", Pattern::Random(1))] {
        let wanted = frame(folder.path(), pattern);
        let mut command = sway.holodrive(folder.path());
        command.args(["show", "frame.png", "--panel", "generic", "--monitor", PANEL, "--present", presenter]);
        let mut running = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("runs");
        sway.wait_for(&wanted);
        assert!(sway.capture(OPERATOR).expect("capture") == before, "another monitor was touched");
        let asked = Command::new("kill").args(["-INT", &running.id().to_string()]).status().expect("kill");
        assert!(asked.success() && running.wait().expect("ends").success());
    }
    let served = Served::begin(sway.holodrive(folder.path()), folder, PANEL, &["--idle", "77"]);
    let mut client = SlmPy::connect(&served);
    for seed in 0..10 {
        let picture = Picture::new(Pattern::Random(seed), 1920, 1080);
        assert_eq!(client.send(&picture), "done");
        sway.wait_for(&picture);
    }
    assert!(sway.capture(OPERATOR).expect("capture") == before, "another monitor was touched");
    let report = served.stop();
    assert_eq!(report["served"]["shown"], 10, "{report}");
    Ended::Passed
}

fn refused(sway: &Sway) -> Ended {
    let folder = tempfile::tempdir().expect("folder");
    frame(folder.path(), Pattern::Ramp);
    let show = |monitor: &str| -> Output {
        let mut command = sway.holodrive(folder.path());
        command.args(["show", "frame.png", "--panel", "generic", "--monitor", monitor, "--hold", "0.1"]);
        command.args(["--present", "software"]).output().expect("runs")
    };
    let right = "scale 1 transform normal resolution 1920x1080";
    for (setting, words) in [
        ("scale 2", "set its scale to 1"),
        ("scale 1.5", "set its scale to 1"),
        ("transform 90", "rotated or mirrored"),
        ("transform 180", "rotated or mirrored"),
        ("transform flipped", "rotated or mirrored"),
        ("resolution 1600x900", "1600x900"),
    ] {
        sway.set(setting);
        let out = show(PANEL);
        let said = String::from_utf8_lossy(&out.stderr);
        let lines: Vec<&str> = said.lines().filter(|line| !line.starts_with("warning:")).collect();
        assert_eq!(out.status.code(), Some(2), "{setting}: {said}");
        assert!(lines.len() == 1 && lines[0].contains(words), "{setting}: {said}");
        sway.set(right);
    }
    let out = show("region:1280,0,1920,1080");
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.code() == Some(2) && said.contains("on X11 only"), "{said}");
    assert!(show(PANEL).status.success());
    // Turned while frames are shown: clients are told, and served again when it is right again.
    let served = Served::begin(sway.holodrive(folder.path()), folder, PANEL, &[]);
    let mut client = SlmPy::connect(&served);
    let pictures = [1, 2].map(|seed| Picture::new(Pattern::Random(seed), 1920, 1080));
    assert_eq!(client.send(&pictures[0]), "done");
    sway.wait_for(&pictures[0]);
    sway.set("transform 180");
    wait_until("the turned monitor is left", || client.send(&pictures[0]) == "err");
    sway.set(right);
    sway.wait_for(&pictures[0]);
    wait_until("the panel is served again", || client.send(&pictures[1]) == "done");
    sway.wait_for(&pictures[1]);
    served.stop();
    Ended::Passed
}
