//! The program alone, without the folders that it was built from: built-in panels and scenes, man pages, completions.

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn holodrive(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_holodrive")).args(arguments).current_dir(folder).output().expect("runs")
}

fn done(folder: &Path, arguments: &[&str]) -> Value {
    let out = holodrive(folder, &[arguments, &["--json"]].concat());
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

/// Exit code 2 and one line that says `expected`.
fn refused(folder: &Path, arguments: &[&str], expected: &str) {
    let out = holodrive(folder, arguments);
    let said = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
    assert!(said.lines().count() == 1 && said.contains(expected), "{arguments:?} did not say `{expected}`: {said}");
}

fn scene(name: &str) -> String {
    format!("{}/scenes/{name}.gltf", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn built_in_panels_are_listed_with_what_nobody_has_checked() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let report = done(f, &["panels", "-o", "panels.json"]);
    let panels = report["panels"].as_array().expect("list");
    let profiles = fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/calib")).expect("calib");
    let profiles = profiles.filter(|entry| {
        let name = entry.as_ref().expect("entry").file_name();
        // Plates are no panels.
        !name.to_string_lossy().starts_with("plate-")
    });
    assert_eq!(panels.len(), profiles.count());
    let panel = |name: &str| panels.iter().find(|panel| panel["name"] == name).expect("panel");
    assert_eq!(panel("generic")["unverified"], serde_json::json!([]));
    let mirrors = panel("ti-plm-67");
    assert_eq!((mirrors["width"].as_u64(), mirrors["bits"].as_u64()), (Some(1358), Some(4)));
    assert_eq!(mirrors["modulation"], "phase");
    assert!(mirrors["pitch"][0].as_f64().is_some_and(|pitch| (pitch - 10.8e-6).abs() < 1e-12));
    let written: Value = serde_json::from_slice(&fs::read(f.join("panels.json")).expect("file")).expect("JSON");
    assert_eq!(written, report["panels"]);
    // A figure that is not checked has a mark, one that is has none.
    let out = String::from_utf8(holodrive(f, &["panels"]).stdout).expect("text");
    let line = |name: &str| out.lines().find(|line| line.starts_with(&format!("{name} "))).expect("line");
    assert!(line("generic").ends_with(" checked") && !line("generic").contains('?'), "{out}");
    let line = line("meadowlark-p1920");
    assert!(line.contains(" 9.2um? ") && line.contains(" 8 bit ") && line.contains("not checked: pitch, "), "{out}");
    refused(f, &["panels", "-o", "no/such/panels.json"], "no/such/panels.json");
    // One of them, to begin one's own with.
    done(f, &["panels", "generic", "-o", "mine.toml"]);
    assert_eq!(
        fs::read(f.join("mine.toml")).expect("mine"),
        fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/calib/generic.toml")).expect("ours")
    );
    let told = done(f, &["plates", "small"]);
    assert_eq!(told["profile"].as_str(), Some(include_str!("../calib/plate-small.toml")));
    refused(f, &["panels", "generik"], "generic");
    refused(f, &["plates", "mine.toml"], "mine.toml");
}

#[test]
fn built_in_scenes_are_the_files_and_a_file_of_that_name_wins() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    // One whose buffer is in the file, and one whose buffer is beside it; a buffer of another scene in the folder is not taken.
    fs::write(f.join("mirror-ball.bin"), "another").expect("write");
    for name in ["cornell", "mirror-ball"] {
        let small = ["--rays", "40x40", "--photons", "1000"];
        done(f, &[&["points", name, "-o", "own.ply", "--picture", "own.npy"], &small[..]].concat());
        done(f, &[&["points", &scene(name), "-o", "file.ply", "--picture", "file.npy"], &small[..]].concat());
        let read = |file: &str| fs::read(f.join(file)).expect("file");
        assert!(read("own.npy") == read("file.npy"), "{name}: another picture");
        // The name of the scene stands in the header.
        let points = |file: &str| {
            let bytes = read(file);
            let end = bytes.windows(11).position(|at| at == b"end_header\n").expect("header");
            bytes[end..].to_vec()
        };
        assert!(points("own.ply") == points("file.ply"), "{name}: other points");
    }
    done(f, &["show", "cornell", "--encoding", "double-phase", "--rays", "30x30", "-o", "out"]);
    assert!(f.join("out/frame.png").is_file());
    let plate = concat!(env!("CARGO_MANIFEST_DIR"), "/calib/plate-small.toml");
    done(f, &["print", "cornell", "--plate", plate, "--dry-run"]);
    let names = "did you mean `cornell`? built-in scenes are cornell, depth-chart, glass-block, mirror-ball, motion";
    for command in ["points", "views", "compute", "show", "encode"] {
        refused(f, &[command, "cornel"], &format!("cornel: no such file; {names}"));
    }
    refused(f, &["print", "cornel", "--plate", plate, "--dry-run"], names);
    for command in ["points", "views", "compute", "show", "print"] {
        let help = String::from_utf8(holodrive(f, &[command, "--help"]).stdout).expect("text");
        assert!(help.contains("Built-in scenes") && help.contains("mirror-ball"), "{command}: {help}");
    }
    // With a folder in it a name is a file, and a file that is there is meant.
    refused(f, &["points", "./cornell"], "not a kind of file");
    refused(f, &["points", "rooms/cornell.gltf"], "rooms/cornell.gltf: No such file");
    fs::write(f.join("cornell"), "mine").expect("write");
    refused(f, &["points", "cornell"], "not a kind of file");
}

/// `.github/FIRST_LIGHT.md`, but for what needs a monitor; the letters are where the page says.
#[test]
fn the_page_for_first_light_holds() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/.github/FIRST_LIGHT.md");
    let page = fs::read_to_string(page).expect("page");
    let blocks = page.split("```sh\n").skip(1).filter_map(|block| block.split_once("```"));
    let commands: Vec<&str> = blocks.flat_map(|(block, _)| block.lines()).collect();
    assert_eq!(commands.len(), 3, "{commands:?}");
    for command in commands {
        let arguments: Vec<&str> = command.split(' ').skip(1).collect();
        done(f, &arguments);
    }
    let seen = image::open(f.join("expected.png")).expect("picture").into_luma8();
    assert_eq!(seen.dimensions(), (400, 300));
    // Light of a quarter: an F is heavier above, an L below.
    let light = |right: bool, below: bool| -> f64 {
        let inside = seen.enumerate_pixels().filter(|(x, y, _)| (*x >= 200) == right && (*y >= 150) == below);
        inside.map(|(_, _, level)| f64::from(level.0[0]).powi(2)).sum()
    };
    assert!(light(false, false) > 1.1 * light(false, true), "an F stands on the left");
    assert!(light(true, true) > 1.1 * light(true, false), "an L stands on the right");
}

#[test]
fn man_pages_and_completions_are_written_for_every_command() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let report = done(f, &["manual", "share"]);
    let man = f.join("share/man/man1");
    let commands = ["", "-show", "-points", "-views", "-print", "-print-preview", "-calibrate-curve", "-bench-views"];
    for command in commands.iter().chain(&["-panels", "-manual", "-serve", "-doctor"]) {
        let page = fs::read_to_string(man.join(format!("holodrive{command}.1"))).expect(command);
        assert!(page.starts_with(&format!(".TH holodrive{command} 1 ")), "{command}: {page}");
        assert_eq!(page.matches(".ds Aq '").count(), 1, "{command}");
        assert!(command.is_empty() || page.contains(".SH EXAMPLES\n.nf\n"), "{command} has no examples:\n{page}");
        assert_eq!(page.matches("\n.nf").count(), page.matches("\n.fi").count(), "{command}");
    }
    let count = fs::read_dir(&man).expect("pages").count();
    assert_eq!(report["pages"], count);
    // Each command that the help names, and those below it.
    assert!(count > 20, "{count} pages");
    for path in report["files"].as_array().expect("files") {
        assert!(f.join(path.as_str().expect("path")).metadata().is_ok_and(|file| file.len() > 300), "{path}");
    }
    let bash = f.join("share/bash-completion/completions/holodrive");
    let page = man.join("holodrive-show.1");
    let checks = [("bash", vec!["-n"], &bash), ("mandoc", vec!["-T", "lint", "-W", "error"], &page)];
    for (program, flags, file) in checks {
        match Command::new(program).args(flags).arg(file).output() {
            Ok(checked) => assert!(checked.status.success(), "{program}: {}", String::from_utf8_lossy(&checked.stdout)),
            Err(why) => eprintln!("not run: {program} on {}: {why}", file.display()),
        }
    }
    fs::write(f.join("file"), "not a folder").expect("write");
    refused(f, &["manual", "file"], "file");
    refused(f, &["manual"], "DIR");
}
