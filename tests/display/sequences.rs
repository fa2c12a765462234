//! Frames in time as a user plays them: folders, raw video on standard input, animated scenes.

use crate::binary::program;
use crate::desk::Desk;
use crate::frames::{NUMBER_BITS, Picture};
use crate::server::PANEL;
use crate::{Case, Ended};
use holodrive::panel::{Frame, PanelProfile};
use std::io::Write;
use std::path::Path;
use std::process::{Child, Stdio};

pub(crate) const CASES: &[Case] = &[
    ("a_folder_of_frames_is_played_in_its_order_and_each_frame_is_told_when_it_has_settled", folder),
    ("raw_video_on_standard_input_is_played_and_a_cut_frame_told", raw),
    ("an_animated_scene_is_computed_ahead_and_played", animated),
    ("a_loop_goes_on_until_it_is_stopped", repeated),
];

/// Frames per second: slow enough that each is captured many times on a busy machine.
const RATE: f64 = 6.0;

/// Pictures `f0.png`, `f1.png` … of the generic panel, each with its number in its first pixels.
pub(crate) fn numbered_frames(folder: &Path, count: u64) {
    std::fs::create_dir_all(folder).expect("folder");
    let profile = PanelProfile::generic().expect("profile");
    for number in 0..count {
        let picture = Picture::numbered(number, profile.width as u32, profile.height as u32);
        let levels = picture.pixels.iter().map(|pixel| pixel[0].into()).collect();
        let frame = Frame::new(&profile, profile.default_wavelength(), levels).expect("frame");
        frame.write(&folder.join(format!("f{number}.png"))).expect("write");
    }
}

/// The numbers that are seen on the panel, each once, until the program has ended or `enough` are there.
fn numbers_seen(desk: &Desk, running: &mut Child, enough: usize) -> Vec<u64> {
    marks_seen(desk, running, enough).into_iter().map(|(number, _)| number).collect()
}

/// The same with the level of the upper right corner beside each number.
fn marks_seen(desk: &Desk, running: &mut Child, enough: usize) -> Vec<(u64, u8)> {
    let plug = desk.plug(PANEL);
    let mut seen: Vec<(u64, u8)> = Vec::new();
    let corner = |desk: &Desk| desk.capture(plug.x + plug.width as i16 - 1, plug.y, 1, 1).pixels[0][0];
    desk.wait_until("the sequence ends", || {
        // The last row comes last where a frame is drawn from the top.
        let number =
            |desk: &Desk| desk.capture(plug.x, plug.y + plug.height as i16 - 1, NUMBER_BITS as u16, 1).number();
        let (before, mark, after) = (number(desk), corner(desk), number(desk));
        if let Some(number) = before.filter(|_| before == after).filter(|&n| seen.last().is_none_or(|(m, _)| *m != n)) {
            seen.push((number, mark));
        }
        seen.len() >= enough || running.try_wait().expect("child").is_some()
    });
    seen
}

fn report(running: Child) -> serde_json::Value {
    let out = running.wait_with_output().expect("ends");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

fn folder(desk: &Desk) -> Ended {
    const COUNT: u64 = 12;
    let folder = tempfile::tempdir().expect("folder");
    numbered_frames(&folder.path().join("frames"), COUNT);
    // A panel that needs 40 ms, between two frames of 167 ms.
    let profile = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("calib/generic.toml"));
    let profile = profile.expect("profile").replacen("[[response]]", "settle_time = \"40ms\"\n\n[[response]]", 1);
    std::fs::write(folder.path().join("slow.toml"), profile).expect("write");
    let rate = RATE.to_string();
    let arguments = [
        "show",
        "frames",
        "--monitor",
        PANEL,
        "--present",
        "software",
        "--fps",
        &rate,
        "--hold",
        "0.3",
        "--json",
        "--panel",
        "slow.toml",
        "--events",
        "events.jsonl",
        "--trigger-patch",
        "top-right,24",
    ];
    let mut running = program(desk, folder.path(), &arguments).stdout(Stdio::piped()).spawn().expect("runs");
    let marks = marks_seen(desk, &mut running, usize::MAX);
    let seen: Vec<u64> = marks.iter().map(|(number, _)| *number).collect();
    // The corner toggles with every frame. The first number may be of the empty desktop.
    for pair in marks[1..COUNT as usize].windows(2) {
        assert!(pair[0].1.abs_diff(pair[1].1) == 255, "the corner does not toggle: {marks:?}");
    }
    let report = report(running);
    // An empty desktop is black, which reads as 0, as the first frame does; f10 comes after f9.
    assert_eq!(seen.iter().copied().take(COUNT as usize).collect::<Vec<_>>(), (0..COUNT).collect::<Vec<_>>());
    let times = report["times"].as_array().expect("times");
    assert_eq!(times.len() as u64, COUNT);
    let number = |time: &serde_json::Value, key: &str| time[key].as_f64().unwrap_or_else(|| panic!("{key}: {time}"));
    for (n, time) in times.iter().enumerate() {
        assert!(time["number"] == n && time["taken"] == true, "{time}");
        assert!((number(time, "settled") - number(time, "presented") - 0.04).abs() < 1e-9, "{time}");
        assert!(number(time, "ready") < number(time, "presented") + 1e-9, "{time}");
        assert!(time["missed"].is_u64(), "{time}");
    }
    let events = std::fs::read_to_string(folder.path().join("events.jsonl")).expect("events");
    let events: Vec<serde_json::Value> = events.lines().map(|l| serde_json::from_str(l).expect("JSON")).collect();
    assert_eq!(&events, times);
    let [median, longest] = [0, 1].map(|i| report["ready_to_presented"][i].as_f64().expect("time"));
    let [handing, worst] = [0, 1].map(|i| report["display"]["presenting"][i].as_f64().expect("time"));
    println!(
        "  1920×1080, software, {RATE} a second: frame ready to presented {:.1} ms (longest {:.1}), handed over to presented \
         {:.1} ms (longest {:.1})",
        1e3 * median,
        1e3 * longest,
        1e3 * handing,
        1e3 * worst
    );
    assert!(handing > 0.0 && handing <= worst && median <= longest);
    Ended::Passed
}

fn raw(desk: &Desk) -> Ended {
    const COUNT: u64 = 5;
    let folder = tempfile::tempdir().expect("folder");
    let arguments = [
        "show",
        "-",
        "--raw",
        "1920x1080",
        "--monitor",
        PANEL,
        "--present",
        "software",
        "--fps",
        "6",
        "--hold",
        "0.3",
        "--json",
    ];
    let mut running = program(desk, folder.path(), &arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("runs");
    let mut input = running.stdin.take().expect("input");
    let sender = std::thread::spawn(move || {
        for number in 0..=COUNT {
            let picture = Picture::numbered(number, 1920, 1080);
            let bytes: Vec<u8> = picture.pixels.iter().map(|pixel| pixel[0]).collect();
            // Of one frame more only a part comes.
            let part = if number == COUNT { 1000 } else { bytes.len() };
            input.write_all(&bytes[..part]).expect("the program reads");
        }
    });
    let seen = numbers_seen(desk, &mut running, usize::MAX);
    sender.join().expect("sent");
    let report = report(running);
    assert_eq!(seen.iter().copied().take(COUNT as usize).collect::<Vec<_>>(), (0..COUNT).collect::<Vec<_>>());
    assert_eq!(report["times"].as_array().expect("times").len() as u64, COUNT);
    let warnings = report["warnings"].to_string();
    assert!(warnings.contains("frame 5 is cut short, 1000 of 2073600 bytes"), "{warnings}");
    Ended::Passed
}

fn animated(desk: &Desk) -> Ended {
    let folder = tempfile::tempdir().expect("folder");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/motion.gltf").display().to_string();
    let arguments = [
        "show",
        &scene,
        "--monitor",
        PANEL,
        "--present",
        "software",
        "--fps",
        "4",
        "--to",
        "0.75",
        "--rays",
        "40x40",
        "--ahead",
        "all",
        "--hold",
        "3",
        "--json",
    ];
    let running =
        program(desk, folder.path(), &arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("runs");
    let plug = desk.plug(PANEL);
    // The last frame stays for the time of its hold: it is on the screen as it is in its file.
    let last = folder.path().join("holodrive-out/frames/frame-00002.png");
    let mut shown = false;
    desk.wait_until("the last frame is on the panel", || {
        if let Ok((frame, _)) = Frame::read(&last, None, None) {
            let pixels: Vec<[u8; 3]> = frame.levels.iter().map(|&level| [level as u8; 3]).collect();
            shown = desk.capture_monitor(&plug).pixels == pixels;
        }
        shown
    });
    let out = running.wait_with_output().expect("ends");
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(out.status.success(), "{said}");
    assert!(said.contains("3 frames ahead take 18 MB"), "the memory was not stated: {said}");
    let report: serde_json::Value = serde_json::from_slice(&out.stdout).expect("JSON");
    assert_eq!(report["frames_made"].as_array().expect("frames").len(), 3);
    assert_eq!(report["display"]["starved"], 0);
    assert_eq!(report["display"]["frames"], 3);
    Ended::Passed
}

fn repeated(desk: &Desk) -> Ended {
    let folder = tempfile::tempdir().expect("folder");
    numbered_frames(folder.path(), 2);
    let arguments =
        ["show", "f0.png", "f1.png", "--monitor", PANEL, "--present", "software", "--fps", "5", "--loop", "--json"];
    let mut running = program(desk, folder.path(), &arguments).stdout(Stdio::piped()).spawn().expect("runs");
    let seen = numbers_seen(desk, &mut running, 7);
    assert!(seen.windows(2).all(|pair| pair[0] + pair[1] == 1), "{seen:?}");
    let interrupted = std::process::Command::new("kill").args(["-INT", &running.id().to_string()]).status();
    assert!(interrupted.expect("kill").success());
    let report = report(running);
    assert!(report["display"]["end"] == "stopped" && report["times"].as_array().expect("times").len() >= 6, "{report}");
    Ended::Passed
}
