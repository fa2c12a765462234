//! Live holograms and the operator's view, on the program itself.

use crate::binary::program;
use crate::desk::{Desk, PATIENCE};
use crate::frames::Picture;
use crate::server::{ODD_PANEL, OPERATOR, PANEL};
use crate::{Case, Ended};
use glam::DVec3;
use holodrive::live::{Look, PICTURE, reconstruct};
use holodrive::panel::Frame;
use holodrive::pipeline::Bench;
use holodrive::points::Placement;
use holodrive::points::placement::Placing;
use holodrive::progress::Progress;
use holodrive::reconstruction::Scale;
use holodrive::scene::{Camera, Scene};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Instant;

pub(crate) const CASES: &[Case] = &[
    ("a_live_hologram_follows_keys_and_file_and_survives_a_broken_one", follows),
    ("the_operators_view_shows_what_the_reconstruction_says_and_never_on_the_panel", operator),
];

/// The program at work on a copy of a scene.
struct Live {
    folder: tempfile::TempDir,
    running: Child,
    read: usize,
}

impl Live {
    fn start(desk: &Desk, more: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("folder");
        std::fs::write(folder.path().join("scene.gltf"), scene()).expect("write");
        let mut arguments = vec![
            "show",
            "scene.gltf",
            "--live",
            "--monitor",
            PANEL,
            "--present",
            "software",
            "--rays",
            "60x60",
            "--events",
            "events.jsonl",
            "--json",
        ];
        arguments.extend(more);
        let running = program(desk, folder.path(), &arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("runs");
        Self { folder, running, read: 0 }
    }

    /// The next event that fits; those before it are passed over.
    fn event(&mut self, what: &str, fits: impl Fn(&Value) -> bool) -> Value {
        let begin = Instant::now();
        loop {
            let text = std::fs::read_to_string(self.folder.path().join("events.jsonl")).unwrap_or_default();
            // A line that is being written has no end yet.
            let whole = text.rfind('\n').map_or("", |end| &text[..end]);
            let events: Vec<&str> = whole.lines().skip(self.read).collect();
            for line in events {
                self.read += 1;
                let event: Value = serde_json::from_str(line).expect("JSON");
                if fits(&event) {
                    return event;
                }
            }
            let ended = self.running.try_wait().expect("child");
            assert!(ended.is_none() && begin.elapsed() < PATIENCE, "waited in vain: {what}; {ended:?}: {text}");
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    }

    /// Waits for the finest hologram of a wish; it is on the panel, every level.
    fn full(&mut self, desk: &Desk, version: u64) -> Value {
        let event = self.event("a full hologram", |event| {
            event["event"] == "shown" && event["detail"] == "full" && event["version"] == version
        });
        desk.wait_for(&desk.plug(PANEL), &self.frame().1);
        event
    }

    fn frame(&self) -> (Frame, Picture) {
        let path = self.folder.path().join("holodrive-out/frame.png");
        let (frame, _) = Frame::read(&path, None, None).expect("frame");
        let pixels = frame.levels.iter().map(|&level| [level as u8; 3]).collect();
        let picture = Picture { width: frame.width as u32, height: frame.height as u32, pixels };
        (frame, picture)
    }

    fn stop(self) -> (Value, String) {
        let asked = Command::new("kill").args(["-INT", &self.running.id().to_string()]).status();
        assert!(asked.expect("kill").success());
        let out = self.running.wait_with_output().expect("ends");
        let said = String::from_utf8_lossy(&out.stderr).into_owned();
        assert!(out.status.success(), "{said}");
        (serde_json::from_slice(&out.stdout).expect("JSON"), said)
    }
}

fn scene() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/motion.gltf");
    std::fs::read_to_string(path).expect("scene")
}

/// Presses a key in the window that has the keyboard. False where that cannot be done here.
fn press(desk: &Desk, key: &str) -> bool {
    let pressed = Command::new("xdotool").args(["key", key]).env("DISPLAY", desk.display()).status();
    pressed.is_ok_and(|status| status.success())
}

fn follows(desk: &Desk) -> Ended {
    let mut live = Live::start(desk, &["--operator", "none"]);
    let coarse = live.event("a coarse hologram", |event| event["event"] == "shown");
    assert!(coarse["detail"] == "coarse" && coarse["version"] == 1, "{coarse}");
    let full = live.full(desk, 1);
    assert!(coarse["points"].as_u64() < full["points"].as_u64());
    let first = live.frame().1;
    // Turned by keys in the panel's window, then put back.
    if !press(desk, "Right") {
        return Ended::NotRun("xdotool is not installed".into());
    }
    let turned = live.full(desk, 2);
    assert!((turned["turn"][0].as_f64().expect("angle") - 5f64.to_radians()).abs() < 1e-9, "{turned}");
    assert!(live.frame().1 != first);
    assert!(press(desk, "r"));
    live.full(desk, 3);
    assert!(live.frame().1 == first, "the same wish makes another hologram");
    // Another laser and another encoding.
    assert!(press(desk, "w") && press(desk, "e"));
    let other =
        live.event("another encoding", |event| event["event"] == "shown" && event["encoding"] == "error-diffusion");
    assert_eq!(other["wavelength"], 638e-9);
    assert!(press(desk, "r"));
    live.event("as at first", |event| {
        event["event"] == "shown" && event["detail"] == "full" && event["encoding"] == "double-phase"
    });
    // The file breaks, twice; the last good hologram stays.
    let path = live.folder.path().join("scene.gltf");
    std::fs::write(&path, &scene()[..3000]).expect("write");
    let failed = live.event("the broken file", |event| event["event"] == "failed");
    assert!(
        failed["what"].as_str().is_some_and(|what| what.contains("scene.gltf") && !what.contains('\n')),
        "{failed}"
    );
    let kept = live.event("the last good scene", |event| event["event"] == "shown" && event["detail"] == "full");
    desk.wait_for(&desk.plug(PANEL), &first);
    // It is mended, and the letter stands elsewhere.
    std::fs::write(&path, scene().replace("[-0.55, 0.5, -2.0]", "[0.3, 0.5, -2.0]")).expect("write");
    live.event("the mended file", |event| event["event"] == "loaded");
    live.full(desk, kept["version"].as_u64().expect("number") + 1);
    let (report, said) = live.stop();
    assert_eq!(
        said.lines().filter(|line| line.starts_with("warning:") && line.contains("scene.gltf")).count(),
        1,
        "{said}"
    );
    let time = |key: &str| report[key].as_f64().unwrap_or(f64::NAN);
    println!(
        "  live at 1920×1080, 60×60 rays: coarse on the panel after {:.0} ms, full after {:.0} ms (medians); stopped within {:.0} ms",
        1e3 * time("to_coarse"),
        1e3 * time("to_full"),
        1e3 * time("longest_cancel")
    );
    assert!(report["failed"] == 1 && report["shown"][0].as_u64() >= Some(5), "{report}");
    Ended::Passed
}

/// Where a window scene stands before the generic panel, seen from the default place.
fn placing(frame: &Frame) -> Placing {
    let camera = Camera::looking_at(DVec3::Z, DVec3::ZERO, 1.0);
    let grid = frame.metadata.panel.grid().expect("grid");
    Placement::default().prepare(&Scene::default(), &camera, 1.0, &grid).expect("placing")
}

fn operator(desk: &Desk) -> Ended {
    let odd = desk.plug(ODD_PANEL);
    let before = desk.capture_monitor(&odd);
    let mut live = Live::start(desk, &["--operator", OPERATOR]);
    live.full(desk, 1);
    let (frame, on_panel) = live.frame();
    let seen_full = |event: &Value| event["event"] == "seen" && event["detail"] == "full";
    let first = live.event("the operator's picture", seen_full);
    let compare = |desk: &Desk, event: &Value| -> Vec<u8> {
        let look = Look {
            focus: event["focus"].as_f64().expect("focus"),
            eye: event["eye"].as_array().map(|eye| [0, 1].map(|i: usize| eye[i].as_f64().expect("place"))),
            pupil: 4e-3,
        };
        let bench = Bench { zero_order_stop: 0.05f64.to_radians(), ..Bench::default() };
        let size = [0, 1].map(|i: usize| event["size"][i].as_u64().expect("size") as usize);
        let picture =
            reconstruct(&frame, &placing(&frame), &look, (size[0], size[1]), &bench, &Progress::new()).expect("seen");
        let coded = picture.coded(Scale::Percentile(0.995));
        let wanted: Vec<u8> = coded.iter().map(|level| (level * 255.0).round() as u8).collect();
        // The window's corner stands 40 pixels from the monitor's, where no window manager moves it.
        let [left, top, ..] = PICTURE.map(|place| place as i16);
        let plug = desk.plug(OPERATOR);
        let mut worst = 255;
        desk.wait_until("the operator's picture is what the reconstruction says", || {
            let seen = desk.capture(plug.x + 40 + left, plug.y + 40 + top, size[0] as u16, size[1] as u16);
            worst =
                seen.pixels.iter().zip(&wanted).map(|(seen, wanted)| seen[0].abs_diff(*wanted)).max().unwrap_or(255);
            worst <= 1
        });
        assert!(wanted.iter().any(|level| *level > 200) && wanted.iter().any(|level| *level < 30));
        wanted
    };
    let near = compare(desk, &first);
    screenshot(desk, "operator-near.png");
    // The focus goes 30 mm away, in steps: the letter blurs.
    for _ in 0..15 {
        if !press(desk, "period") {
            return Ended::NotRun("xdotool is not installed".into());
        }
    }
    let away = first["focus"].as_f64().expect("focus") - 0.03;
    let at = |focus: f64| {
        move |event: &Value| event["event"] == "seen" && (event["focus"].as_f64().unwrap_or(0.0) - focus).abs() < 1e-9
    };
    let event = live.event("another focus", at(away));
    let far = compare(desk, &event);
    screenshot(desk, "operator-far.png");
    assert!(near != far);
    // Through an eye 3 mm to the right.
    assert!(["l", "l", "l"].iter().all(|key| press(desk, key)));
    let event = live.event("an eye to the right", |event| {
        event["event"] == "seen" && event["eye"][0].as_f64().is_some_and(|x| (x - 3e-3).abs() < 1e-9)
    });
    let beside = compare(desk, &event);
    screenshot(desk, "operator-eye.png");
    assert!(beside != far);
    put_back(desk, &on_panel);
    // Nothing of it is anywhere else.
    assert!(desk.capture_monitor(&desk.plug(PANEL)) == on_panel, "the panel shows something else than its frame");
    assert!(desk.capture_monitor(&odd) == before, "another monitor was touched");
    live.stop();
    let folder = tempfile::tempdir().expect("folder");
    std::fs::write(folder.path().join("scene.gltf"), scene()).expect("write");
    let arguments = ["show", "scene.gltf", "--live", "--monitor", PANEL, "--operator", PANEL];
    let refused = program(desk, folder.path(), &arguments).output().expect("runs");
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(2) && said.contains("cannot stand on the panel's monitor"), "{said}");
    assert!(!folder.path().join("holodrive-out").exists(), "a folder was left");
    Ended::Passed
}

/// Moves the operator's window onto the panel's monitor: it does not stay there, and the panel's frame does.
fn put_back(desk: &Desk, on_panel: &Picture) {
    let plug = desk.plug(PANEL);
    let ask = |arguments: &[&str]| {
        let out = Command::new("xdotool").args(arguments).env("DISPLAY", desk.display()).output().expect("xdotool");
        String::from_utf8_lossy(&out.stdout).into_owned()
    };
    let found = ask(&["search", "--name", "operator's view"]);
    let window = found.lines().next().expect("the operator's window").to_owned();
    let left = || -> Option<i64> {
        let told = ask(&["getwindowgeometry", "--shell", &window]);
        told.lines().find_map(|line| line.strip_prefix("X=")).and_then(|x| x.parse().ok())
    };
    let home = left().expect("place");
    ask(&["windowmove", &window, &(plug.x + 100).to_string(), "100"]);
    desk.wait_until("the operator's window is put back", || left().is_some_and(|x| x < home + 100));
    desk.wait_for(&plug, on_panel);
}

/// The operator's window beside the panel, however windows are managed.
pub(crate) fn beside(desk: &Desk) -> Ended {
    if Command::new("xdotool").arg("version").output().is_err() {
        return Ended::NotRun("xdotool is not installed".into());
    }
    let before = desk.capture_monitor(&desk.plug(OPERATOR));
    let mut live = Live::start(desk, &["--operator", "auto"]);
    live.full(desk, 1);
    desk.wait_until("the operator's view is there", || desk.capture_monitor(&desk.plug(OPERATOR)) != before);
    put_back(desk, &live.frame().1);
    live.stop();
    Ended::Passed
}

/// Keeps what is on the operator's monitor, for an eye.
fn screenshot(desk: &Desk, name: &str) {
    let seen = desk.capture_monitor(&desk.plug(OPERATOR));
    let bytes = seen.pixels.concat();
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    image::save_buffer(path, &bytes, seen.width, seen.height, image::ExtendedColorType::Rgb8).expect("screenshot");
}
