//! The program itself: its commands for a real monitor, as a user types them.

use crate::desk::Desk;
use crate::frames::Picture;
use crate::server::{ODD_PANEL, OPERATOR, PANEL};
use crate::{Case, Ended};
use holodrive::panel::{Frame, PanelProfile};
use holodrive::random::Random;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

pub(crate) const CASES: &[Case] = &[
    ("the_program_lists_the_monitors_and_names_them_when_one_is_not_there", monitors),
    ("the_program_shows_every_level_of_a_frame_on_the_monitor_asked_for", show),
    ("every_display_command_of_the_readme_runs", readme),
    ("every_line_of_python_in_the_readme_runs_on_a_served_panel", python),
];

pub(crate) fn program(desk: &Desk, folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_holodrive"));
    command.args(arguments).current_dir(folder).env("DISPLAY", desk.display()).env_remove("WAYLAND_DISPLAY");
    command
}

/// A frame of random levels for the generic panel, written as `frame.png`; returns what must be on the screen.
fn frame(folder: &Path) -> Picture {
    let profile = PanelProfile::generic().expect("profile");
    let mut random = Random::new(20, 26);
    let levels: Vec<u16> = (0..profile.width * profile.height).map(|_| (random.bits() & 255) as u16).collect();
    let pixels = levels.iter().map(|&level| [level as u8; 3]).collect();
    let frame = Frame::new(&profile, profile.default_wavelength(), levels).expect("frame");
    frame.write(&folder.join("frame.png")).expect("write");
    Picture { width: profile.width as u32, height: profile.height as u32, pixels }
}

fn monitors(desk: &Desk) -> Ended {
    let folder = tempfile::tempdir().expect("folder");
    let listed = program(desk, folder.path(), &["monitors", "--json"]).output().expect("runs");
    let report: serde_json::Value = serde_json::from_slice(&listed.stdout).expect("JSON");
    let names: Vec<&str> =
        report["monitors"].as_array().expect("list").iter().filter_map(|m| m["name"].as_str()).collect();
    assert!([OPERATOR, PANEL, ODD_PANEL].iter().all(|name| names.contains(name)), "{report}");
    frame(folder.path());
    let refused = program(desk, folder.path(), &["show", "frame.png", "--monitor", "HDMI-7"]).output().expect("runs");
    let said = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.lines().count() == 1 && said.contains("HDMI-7") && said.contains(PANEL), "{said}");
    assert!(!folder.path().join("holodrive-out").exists(), "a folder was left");
    // The operator's monitor has another size than the panel.
    let refused = program(desk, folder.path(), &["show", "frame.png", "--monitor", OPERATOR]).output().expect("runs");
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(refused.status.code() == Some(2) && said.contains("1920"), "{said}");
    Ended::Passed
}

fn show(desk: &Desk) -> Ended {
    let folder = tempfile::tempdir().expect("folder");
    let wanted = frame(folder.path());
    let others = [OPERATOR, ODD_PANEL].map(|name| desk.plug(name));
    let before = others.each_ref().map(|plug| desk.capture_monitor(plug));
    let arguments = ["show", "frame.png", "--monitor", PANEL, "--present", "software"];
    let mut running = program(desk, folder.path(), &arguments).stdout(Stdio::null()).spawn().expect("runs");
    desk.wait_for(&desk.plug(PANEL), &wanted);
    for (plug, before) in others.iter().zip(&before) {
        assert!(desk.capture_monitor(plug) == *before, "another monitor was touched");
    }
    // Ctrl-C, as a terminal sends it.
    let interrupted = Command::new("kill").args(["-INT", &running.id().to_string()]).status().expect("kill");
    assert!(interrupted.success());
    assert!(running.wait().expect("ends").success(), "an ended show is no failure");
    // A frame that is only shown leaves no folder behind.
    assert!(!folder.path().join("holodrive-out").exists());
    Ended::Passed
}

fn readme(desk: &Desk) -> Ended {
    let folder = tempfile::tempdir().expect("folder");
    frame(folder.path());
    crate::sequences::numbered_frames(&folder.path().join("frames"), 3);
    std::fs::create_dir(folder.path().join("scenes")).expect("folder");
    let scene = Path::new("scenes/motion.gltf");
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join(scene);
    std::fs::copy(from, folder.path().join(scene)).expect("copy");
    let text = pages();
    let mut inside = false;
    let mut run = 0;
    for line in text.lines() {
        if let Some(kind) = line.trim().strip_prefix("```") {
            inside = kind == "sh display";
        } else if inside && !line.trim().is_empty() {
            // The README's monitor is called as most are; here it is the dummy driver's.
            let line = line.replace("HDMI-1", PANEL);
            // What would come through a pipe comes from here: two frames of raw video.
            let (piped, line) = match line.split_once(" | ") {
                Some((_, line)) => (true, line.to_owned()),
                None => (false, line),
            };
            let words: Vec<&str> = line.split(" #").next().unwrap_or("").split_whitespace().collect();
            assert_eq!(words[0], "holodrive", "{line}");
            let mut command = program(desk, folder.path(), &words[1..]);
            command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
            let mut running = command.spawn().expect("runs");
            if let (true, Some(input)) = (piped, &mut running.stdin) {
                input.write_all(&vec![100; 2 * 1920 * 1080]).expect("the program reads");
            }
            let out = running.wait_with_output().expect("ends");
            assert!(out.status.success(), "{line}: {}", String::from_utf8_lossy(&out.stderr));
            run += 1;
        }
    }
    assert!(run >= 3, "only {run} commands were found");
    Ended::Passed
}

/// What is read of monitors: the README, and the guide to the lab.
fn pages() -> String {
    let page = |name| std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).expect(name);
    ["README.md", "src/guide/lab.md"].map(page).concat()
}

/// Blocks of a kind in these pages, in their order.
fn blocks(kind: &str) -> Vec<String> {
    let text = pages();
    let mut blocks = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        if let Some(named) = line.strip_prefix("```") {
            inside = named == kind;
            if inside {
                blocks.push(String::new());
            }
        } else if let (true, Some(block)) = (inside, blocks.last_mut()) {
            *block += line;
            block.push('\n');
        }
    }
    blocks
}

fn python(desk: &Desk) -> Ended {
    let folder = tempfile::tempdir().expect("folder");
    // The usual port may be another server's on this machine.
    let free = || {
        let door = std::net::TcpListener::bind("127.0.0.1:0").expect("port");
        door.local_addr().expect("port").port().to_string()
    };
    let (slmsuite, slmpy) = (free(), free());
    let here = |text: &str| text.replace("HDMI-1", PANEL).replace("5025", &slmsuite).replace("9999", &slmpy);
    let mut served = None;
    let commands = blocks("sh serve").concat();
    for line in commands.lines() {
        let line = here(line);
        let words: Vec<&str> = line.split_whitespace().collect();
        let mut command = program(desk, folder.path(), &words[1..]);
        command.env("XDG_RUNTIME_DIR", folder.path());
        if words.contains(&"--write-python") {
            assert!(command.output().expect("runs").status.success(), "{line}");
        } else {
            let mut process = command.stdout(Stdio::piped()).spawn().expect("runs");
            let mut said = String::new();
            let output = process.stdout.as_mut().expect("output");
            std::io::BufRead::read_line(&mut std::io::BufReader::new(output), &mut said).expect("line");
            assert!(said.contains("1920x1080"), "{line}: {said}");
            served = Some(process);
        }
    }
    let mut served = served.expect("the guide serves a panel");
    let python = std::env::var("HOLODRIVE_PYTHON").unwrap_or_else(|_| "python3".into());
    let mut ended = Ended::Passed;
    let blocks = blocks("python");
    assert_eq!(blocks.len(), 2);
    for block in &blocks {
        let mut command = Command::new(&python);
        // The module is the one that the program wrote.
        command.args(["-c", &here(block)]).current_dir(folder.path()).env("XDG_RUNTIME_DIR", folder.path());
        let out = command.env("PYTHONDONTWRITEBYTECODE", "1").output();
        match out {
            Ok(out) if out.status.success() => {}
            Ok(out) => {
                let said = String::from_utf8_lossy(&out.stderr).into_owned();
                let missing = said.lines().last().is_some_and(|line| line.starts_with("ModuleNotFoundError"));
                assert!(missing && std::env::var_os("HOLODRIVE_PYTHON").is_none(), "{block}: {said}");
                ended = Ended::Optional(format!("{python} has no NumPy or slmsuite"));
            }
            Err(_) => ended = Ended::Optional(format!("{python} is not there")),
        }
    }
    if matches!(ended, Ended::Passed) {
        // slmsuite's zero phase is its highest level.
        let plug = desk.plug(PANEL);
        assert!(desk.capture_monitor(&plug).pixels.iter().all(|pixel| *pixel == [255; 3]));
    }
    let asked = Command::new("kill").args(["-INT", &served.id().to_string()]).status().expect("kill");
    assert!(asked.success() && served.wait().expect("ends").success());
    ended
}
