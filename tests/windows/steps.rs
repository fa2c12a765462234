//! What needs no monitor: from a scene to a frame, plates, refusals, a server, Ctrl-C.

use crate::Case;
use crate::wine::Wine;
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Instant;

pub(crate) const CASES: &[Case] = &[
    ("version_and_help_are_those_of_the_other_system", help),
    ("the_first_command_runs_in_a_folder_with_any_name", first_command),
    ("points_field_frame_and_picture_are_the_same_as_elsewhere", same),
    ("plates_are_the_same_byte_for_byte", plate),
    ("wrong_flags_and_files_end_in_one_line_and_code_2", refusals),
    ("frames_are_taken_over_tcp_and_by_the_local_port", served),
    ("ctrl_c_ends_with_130_and_leaves_nothing_half_written", interrupted),
];

fn here(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_holodrive"));
    command.args(arguments).current_dir(folder);
    command
}

fn done(mut command: Command) -> Output {
    let out = command.output().expect("runs");
    assert!(out.status.success(), "{command:?}: {}", String::from_utf8_lossy(&out.stderr));
    out
}

fn json(out: &Output) -> Value {
    serde_json::from_slice(&out.stdout).expect("JSON")
}

/// Two folders, for the program on Windows and here, whose names are not what is common there.
fn folders(root: &Path) -> [PathBuf; 2] {
    ["Messung Üß 測試 é", "here"].map(|name| {
        let folder = root.join(name);
        fs::create_dir(&folder).expect("folder");
        folder
    })
}

/// How many bytes of two 8-bit pictures differ, and by how much at most.
fn differing(a: &Path, b: &Path) -> (usize, u8) {
    let [a, b] = [a, b].map(|path| image::open(path).expect("picture").into_rgb8());
    assert_eq!(a.dimensions(), b.dimensions());
    let differences = a.iter().zip(b.iter()).map(|(a, b)| a.abs_diff(*b)).filter(|&d| d > 0);
    differences.fold((0, 0), |(count, most), d| (count + 1, most.max(d)))
}

fn help(wine: &Wine) {
    let root = tempfile::tempdir().expect("folder");
    let text =
        |out: &Output| String::from_utf8_lossy(&out.stdout).replace('\r', "").replace("holodrive.exe", "holodrive");
    for arguments in [&["--version"][..], &["--help"], &["show", "-h"], &["panels"], &["plates"]] {
        let there = text(&done(wine.holodrive(root.path(), arguments)));
        assert_eq!(there, text(&done(here(root.path(), arguments))), "{arguments:?}");
    }
    let begin = Instant::now();
    done(wine.holodrive(root.path(), &["--version"]));
    println!("holodrive.exe --version: {:.2} s under wine", begin.elapsed().as_secs_f64());
}

fn first_command(wine: &Wine) {
    let root = tempfile::tempdir().expect("folder");
    let [there, other] = folders(root.path());
    // Longer than the 260 characters of old.
    let deep: PathBuf = ["lång-lång-lång-lång-lång-lång-lång-lång-lång-lång"; 5].iter().collect();
    let deep = deep.to_str().expect("text").replace('/', "\\");
    let report = json(&done(wine.holodrive(&there, &["show", "cornell", "-o", &deep, "--json"])));
    let own = json(&done(here(&other, &["show", "cornell", "--json"])));
    let psnr = |report: &Value| report["seen"]["all"]["psnr"].as_f64().expect("PSNR");
    // Steps of a descent, each with another libm's last bits in it.
    assert!((psnr(&report) - psnr(&own)).abs() < 0.2, "{} dB, elsewhere {} dB", psnr(&report), psnr(&own));
    let folder = there.join(deep.replace('\\', "/"));
    assert!(folder.as_os_str().len() > 260);
    assert_eq!(image::open(folder.join("frame.png")).expect("frame").into_luma8().dimensions(), (1920, 1080));
    // What should be seen is traced, not found by steps.
    let (count, most) = differing(&folder.join("traced.png"), &other.join("holodrive-out/traced.png"));
    assert!(count < 100 && most <= 1, "{count} values of traced.png differ, by {most} at most");
}

fn same(wine: &Wine) {
    let root = tempfile::tempdir().expect("folder");
    let [there, other] = folders(root.path());
    for arguments in [
        &["points", "cornell", "--rays", "100x100", "-o", "points.ply", "--picture", "traced.npy"][..],
        &["compute", "points.ply", "-o", "field.npy"],
        &["encode", "field.npy", "--encoding", "double-phase", "-o", "frame.png"],
        &["reconstruct", "frame.png", "--distance", "-120mm", "--size", "300x200", "-o", "picture.png"],
        &["propagate", "field.npy", "--distance", "50mm", "-o", "carried.mat"],
        &["calibrate", "check", "-o", "cards"],
    ] {
        done(wine.holodrive(&there, arguments));
        done(here(&other, arguments));
    }
    for name in ["points.ply", "traced.npy", "field.npy"] {
        let [a, b] = [&there, &other].map(|folder| fs::read(folder.join(name)).expect("file"));
        assert!(a == b, "{name} differs");
    }
    let (count, most) = differing(&there.join("frame.png"), &other.join("frame.png"));
    // Three colours of each pixel. A phase half way between two levels falls to either side with another libm's last bit.
    println!("frame.png: {} of 2 073 600 levels differ, by {most} at most", count / 3);
    assert!(count <= 3 * 20 && most <= 1, "{count} values of frame.png differ, by {most} at most");
    let (count, most) = differing(&there.join("picture.png"), &other.join("picture.png"));
    assert!(count <= 3 * 60 && most <= 1, "{count} values of picture.png differ, by {most} at most");
    assert!(there.join("cards/letters.png").is_file());
    assert_eq!(
        fs::read(there.join("carried.mat")).expect("file").len(),
        fs::read(other.join("carried.mat")).expect("file").len()
    );
}

fn plate(wine: &Wine) {
    let root = tempfile::tempdir().expect("folder");
    let [there, other] = folders(root.path());
    let print = ["print", "cornell", "--plate", "small", "--size", "0.8mm,0.6mm", "-o", "plate"];
    done(wine.holodrive(&there, &print));
    done(wine.holodrive(&there, &["print", "verify", "plate"]));
    done(here(&other, &print));
    let [a, b] = [&there, &other].map(|folder| fs::read(folder.join("plate/plate.tif")).expect("plate"));
    assert!(a == b, "{} of {} bytes differ", a.iter().zip(&b).filter(|(a, b)| a != b).count(), b.len());
    // The same command again finds all of it done.
    let again = json(&done(wine.holodrive(&there, &[&print[..], &["--json"]].concat())));
    assert!(again.to_string().contains("\"computed\":0"), "{again}");
}

fn refusals(wine: &Wine) {
    let root = tempfile::tempdir().expect("folder");
    let [there, _] = folders(root.path());
    for (arguments, expected) in [
        (&["show", "--raus", "10x10"][..], "--rays"),
        (&["show", "nicht dä.gltf"], "nicht dä.gltf"),
        (&["show", "cornel"], "cornell"),
        (&["compute", "cornell", "--wavelength", "532"], "532"),
        (&["print", "cornell", "--plate", "no-such-plate", "-o", "plate"], "no-such-plate"),
    ] {
        let out = wine.holodrive(&there, arguments).output().expect("runs");
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.lines().count() == 1 && said.contains(expected), "{arguments:?} did not say `{expected}`: {said}");
    }
    assert_eq!(fs::read_dir(&there).expect("list").count(), 0, "something was left");
}

fn served(wine: &Wine) {
    let root = tempfile::tempdir().expect("folder");
    let [there, _] = folders(root.path());
    let generic = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/calib/generic.toml")).expect("profile");
    let small = generic.replace("width = 1920", "width = 24").replace("height = 1080", "height = 16");
    fs::write(there.join("small.toml"), small).expect("write");
    let flags = ["serve", "--monitor", "none", "--slmpy", "0", "--local", "panel.port", "--json"];
    let flags = [&flags[..], &["--panel", "small.toml", "-o", "frames"]].concat();
    let mut program = wine.holodrive(&there, &flags).stdout(Stdio::piped()).spawn().expect("runs");
    let mut line = String::new();
    BufReader::new(program.stdout.take().expect("output")).read_line(&mut line).expect("first line");
    let told: Value = serde_json::from_str(&line).expect("JSON in one line");
    let address = told["serving"]["slmpy"].as_str().expect("address");
    let mut client = std::net::TcpStream::connect(address).expect("connect");
    for number in 1..=2u8 {
        let levels: Vec<u8> = (0..24 * 16).map(|i| (i % 251) as u8 ^ number).collect();
        client.write_all(&(levels.len() as i32).to_le_bytes()).expect("length");
        client.write_all(&levels).expect("frame");
        let mut answer = [0; 4];
        client.read_exact(&mut answer).expect("answer");
        assert_eq!(&answer, b"done");
        let kept = image::open(there.join(format!("frames/frame-00000{number}.png"))).expect("frame").into_luma8();
        assert_eq!(kept.into_raw(), levels);
    }
    // The local protocol: a port and its key in a file of the user's.
    let told: Value = serde_json::from_slice(&fs::read(there.join("panel.port")).expect("port")).expect("JSON");
    let stream = std::net::TcpStream::connect(told["address"].as_str().expect("address")).expect("connect");
    let mut client = BufReader::new(stream);
    let mut ask = |said: &[u8]| {
        client.get_mut().write_all(said).expect("said");
        let mut line = String::new();
        client.read_line(&mut line).expect("answer");
        serde_json::from_str::<Value>(&line).expect("JSON")
    };
    let key = serde_json::json!({ "key": told["key"] }).to_string() + "\n";
    assert_eq!(ask(key.as_bytes())["width"], 24);
    assert_eq!(ask(b"{\"show\": \"levels\", \"dtype\": \"uint8\"}\n")["send"], 24 * 16);
    let levels: Vec<u8> = (0..24 * 16).map(|i| (i % 249) as u8).collect();
    assert_eq!(ask(&levels)["number"], 3);
    let kept = image::open(there.join("frames/frame-000003.png")).expect("frame").into_luma8();
    assert_eq!(kept.into_raw(), levels);
    wine.end_all();
    program.wait().expect("ends");
}

fn interrupted(wine: &Wine) {
    let root = tempfile::tempdir().expect("folder");
    let [there, _] = folders(root.path());
    // Long before their ends, and after they have begun even on a busy machine: earlier, wine ends a program with code 0.
    for arguments in [
        &["show", "cornell", "--iterations", "5000", "-o", "out"][..],
        &["print", "cornell", "--plate", "chrome-0.5um", "--size", "20mm,20mm", "-o", "plate"],
    ] {
        let out = wine.interrupted(&there, 8000, arguments);
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(130), "{arguments:?}: {said}");
    }
    let mut left = fs::read_dir(there.join("out")).into_iter().flatten().chain(fs::read_dir(&there).expect("list"));
    assert!(!left.any(|entry| entry.expect("entry").file_name().to_string_lossy().ends_with(".partial")));
    assert!(!there.join("out/frame.png").exists(), "a frame that was not finished has its last name");
    assert!(!there.join("plate/plate.tif").exists(), "half a plate has its last name");
}
