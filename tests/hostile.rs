//! Files and flags made to break the program: one line, exit code 2, within seconds, and nothing left behind.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

/// Runs the program under a limit on its memory; it must end soon.
fn holodrive(folder: &Path, arguments: &[&str]) -> Output {
    let start = Instant::now();
    let mut command = if cfg!(target_os = "linux") {
        let mut command = Command::new("sh");
        // Threads reserve address space that they do not use.
        command.args(["-c", "ulimit -v 4000000; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_holodrive")]);
        command
    } else {
        Command::new(env!("CARGO_BIN_EXE_holodrive"))
    };
    let out = command.args(arguments).current_dir(folder).output().expect("runs");
    assert!(start.elapsed() < Duration::from_secs(10), "{arguments:?} took {:?}", start.elapsed());
    out
}

fn refused(folder: &Path, arguments: &[&str], words: &str) {
    let out = holodrive(folder, arguments);
    let said = String::from_utf8_lossy(&out.stderr).into_owned();
    let lines: Vec<&str> = said.lines().filter(|line| !line.starts_with("warning:")).collect();
    assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
    assert!(lines.len() == 1 && lines[0].contains(words), "{arguments:?} did not say `{words}`: {said}");
    assert!(!said.chars().any(|c| c.is_control() && c != '\n') && said.len() < 4000, "{said:?}");
}

/// A PNG that claims a size and has no pixels.
fn claimed_png(width: u32, height: u32) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().expect("header");
    writer.write_chunk(png::chunk::IDAT, &[0x78, 0x9c, 3, 0, 0, 0, 0, 1]).expect("chunk");
    // Finishing would miss the rows.
    std::mem::forget(writer);
    out
}

const PANEL: &str = "name = \"t\"\nmaker = \"t\"\nkind = \"phase-lcos\"\nwidth = 40\nheight = 24\npitch = \"8um\"\nbits = 8\n\
    fill_factor = 0.9\nwavelengths = [\"532nm\"]\n[[response]]\nkind = \"linear\"\nlevels_for_2pi = 256\n";

const POINT: &str = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
    end_header\n0 0 -0.1\n";

#[test]
fn sizes_and_numbers_out_of_all_bounds_are_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().expect("folder");
    let at = folder.path();
    let write = |name: &str, bytes: &[u8]| fs::write(at.join(name), bytes).expect("write");
    write("huge.png", &claimed_png(60_000, 60_000));
    write("point.ply", POINT.as_bytes());
    refused(at, &["show", "huge.png", "-o", "s"], "60000×60000");
    refused(at, &["reconstruct", "huge.png", "--distance=-1mm", "-o", "r.png"], "name the panel");
    for (from, to, words) in [
        ("width = 40", "width = 65536", "width"),
        ("width = 40\nheight = 24", "width = 65536\nheight = 65536", "pixels in all"),
        ("pitch = \"8um\"", "pitch = \"1e-300m\"", "pitch"),
        ("bits = 8", "bits = 8\nsettle_time = \"1e30s\"", "settle_time"),
        ("532nm", "1e300m", "wavelengths"),
    ] {
        write("panel.toml", PANEL.replace(from, to).as_bytes());
        if words != "width" {
            refused(at, &["compute", "point.ply", "--panel", "panel.toml", "-o", "f.npy"], words);
        }
    }
    write("panel.toml", PANEL.as_bytes());
    for wavelength in ["1e-300m", "1e300m", "0m"] {
        let flags = ["compute", "point.ply", "--panel", "panel.toml", "--wavelength", wavelength, "-o", "f.npy"];
        refused(at, &flags, "wavelength");
    }
    refused(at, &["reconstruct", "huge.png", "--distance=-1mm", "--size", "65536x65536", "-o", "r.png"], "in all");
    let empty = "ply\nformat binary_little_endian 1.0\nelement junk 18446744073709551615\nelement vertex 1\n\
        property float x\nproperty float y\nproperty float z\nend_header\n";
    write("empty.ply", empty.as_bytes());
    refused(at, &["compute", "empty.ply", "-o", "f.npy"], "promises");
    let names: Vec<_> = fs::read_dir(at).expect("list").map(|e| e.expect("entry").file_name()).collect();
    assert_eq!(names.len(), 4, "{names:?}");
}

#[test]
fn what_a_file_says_does_not_steer_the_terminal() {
    let folder = tempfile::tempdir().expect("folder");
    let at = folder.path();
    let write = |name: &str, bytes: &[u8]| fs::write(at.join(name), bytes).expect("write");
    write("esc.ply", b"ply\nformat ascii 1.0\n\x1b]0;x\x07\x1b[2J\r\nend_header\n");
    refused(at, &["compute", "esc.ply", "-o", "f.npy"], "not understood");
    let long = format!("ply\nformat ascii 1.0\n{}\nend_header\n", "x".repeat(900_000));
    write("long.ply", long.as_bytes());
    refused(at, &["compute", "long.ply", "-o", "f.npy"], "not understood");
}

#[cfg(unix)]
#[test]
fn a_scene_does_not_read_what_lies_outside_of_its_folder() {
    let folder = tempfile::tempdir().expect("folder");
    let at = folder.path();
    fs::create_dir(at.join("model")).expect("folder");
    fs::write(at.join("secret.bin"), [0; 36]).expect("write");
    let scene = |uri: &str| {
        let text = format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"{uri}"}}]}}"#
        );
        fs::write(at.join("model/scene.gltf"), text).expect("write");
    };
    let points = ["points", "model/scene.gltf", "--rays", "4x4", "-o", "o.ply"];
    for (uri, words) in [
        ("%2Fetc%2Fpasswd", "relative"),
        ("/dev/zero", "relative"),
        ("../secret.bin", "outside"),
        ("%2e%2e/secret.bin", "outside"),
    ] {
        scene(uri);
        refused(at, &points, words);
    }
    scene("../secret.bin");
    // Three corners in one place: it was read.
    refused(at, &[&points[..], &["--allow-outside"]].concat(), "no triangle");
    let made = Command::new("mkfifo").arg(at.join("model/pipe.bin")).status();
    if made.is_ok_and(|made| made.success()) {
        scene("pipe.bin");
        refused(at, &points, "regular");
    }
}
