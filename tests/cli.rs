//! The binary as a user meets it: the README's commands, and bad input.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn holodrive(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_holodrive")).args(arguments).current_dir(folder).output().expect("runs")
}

fn scene(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).display().to_string()
}

/// Files in a folder, hidden ones too.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .expect("folder")
        .map(|e| e.expect("entry").file_name().to_string_lossy().to_string())
        .collect();
    names.sort();
    names
}

/// Bad input ends in exit code 2, one line on standard error that says `expected`, and no new file.
fn refused(folder: &Path, arguments: &[&str], expected: &str) {
    let before = names(folder);
    let out = holodrive(folder, arguments);
    let said = String::from_utf8_lossy(&out.stderr);
    let lines: Vec<&str> = said.lines().filter(|l| !l.starts_with("warning:")).collect();
    assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
    assert_eq!(lines.len(), 1, "{arguments:?} said more than one line: {said}");
    assert!(lines[0].contains(expected), "{arguments:?} did not say `{expected}`: {said}");
    assert_eq!(names(folder), before, "{arguments:?} left something");
}

fn write(folder: &Path, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).expect("write");
    path
}

/// A triangle as a glTF with its buffer embedded; `positions` are nine floats.
fn triangle_gltf(positions: [f32; 9], count: usize, emissive: &str) -> String {
    let bytes: Vec<u8> = positions.iter().flat_map(|v| v.to_le_bytes()).collect();
    let alphabet = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let base64: String = bytes
        .chunks(3)
        .flat_map(|c| {
            let word = u32::from(c[0]) << 16 | u32::from(c[1]) << 8 | u32::from(c[2]);
            [18, 12, 6, 0].map(|shift| alphabet[(word >> shift & 63) as usize] as char)
        })
        .collect();
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
        "materials":[{{"emissiveFactor":{emissive},"doubleSided":true}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{count},"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "buffers":[{{"byteLength":36,"uri":"data:application/octet-stream;base64,{base64}"}}]}}"#
    )
}

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

#[test]
fn bad_scenes_end_in_one_line() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    refused(f, &["points", "missing.gltf"], "missing.gltf");
    refused(f, &["show", "missing.gltf"], "missing.gltf");
    refused(f, &["show", "missing.abc"], "not a kind of file");
    // A .glb whose file ends in the middle of its chunks.
    let mut glb = b"glTF\x02\x00\x00\x00\xff\x00\x00\x00\xc0\x00\x00\x00JSON{\"asset\"".to_vec();
    write(f, "cut.glb", &glb);
    refused(f, &["points", "cut.glb"], "cut.glb");
    glb.truncate(7);
    write(f, "cut.glb", &glb);
    refused(f, &["points", "cut.glb"], "cut.glb");
    write(f, "past.gltf", triangle_gltf(TRIANGLE, 300, "[1,1,1]"));
    refused(f, &["points", "past.gltf"], "past.gltf");
    let mut bad = TRIANGLE;
    bad[4] = f32::NAN;
    write(f, "nan.gltf", triangle_gltf(bad, 3, "[1,1,1]"));
    refused(f, &["points", "nan.gltf"], "nan.gltf");
    bad[4] = f32::INFINITY;
    write(f, "inf.gltf", triangle_gltf(bad, 3, "[1,1,1]"));
    refused(f, &["show", "inf.gltf"], "inf.gltf");
    write(f, "flat.gltf", triangle_gltf([0.0; 9], 3, "[1,1,1]"));
    refused(f, &["points", "flat.gltf"], "triangle");
    write(f, "none.gltf", r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[]}]}"#);
    refused(f, &["points", "none.gltf"], "triangle");
    // A light that gives none.
    let dark = triangle_gltf(TRIANGLE, 3, "[0,0,0]").replace(
        r#""nodes":[{"mesh":0}]"#,
        r#""nodes":[{"mesh":0,"extensions":{"KHR_lights_punctual":{"light":0}}}],
        "extensionsUsed":["KHR_lights_punctual"],
        "extensions":{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":0}]}}"#,
    );
    write(f, "dark.gltf", dark);
    refused(f, &["points", "dark.gltf"], "light");
    let foreign = triangle_gltf(TRIANGLE, 3, "[1,1,1]").replace(
        r#""scene":0"#,
        r#""extensionsUsed":["X_unheard_of"],"extensionsRequired":["X_unheard_of"],"scene":0"#,
    );
    write(f, "foreign.gltf", foreign);
    refused(f, &["points", "foreign.gltf"], "X_unheard_of");
}

#[test]
fn bad_clouds_fields_and_frames_end_in_one_line() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let head =
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    for (name, body, expected) in
        [("short.ply", "0 0 -0.2\n", "promises 2"), ("nan.ply", "nan 0 -0.2\n0 inf -0.2\n", "no points")]
    {
        write(f, name, format!("{head}{body}"));
        refused(f, &["compute", name], expected);
        refused(f, &["show", name, "-o", "."], expected);
    }
    let dark = head.replace("end_header", "property float amplitude\nend_header");
    write(f, "dark.ply", format!("{dark}0 0 -0.2 0\n0 0 -0.2 0\n"));
    refused(f, &["compute", "dark.ply"], "dark");
    refused(f, &["compute", "dark.ply", "--views", "64"], "of a scene");
    let room = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell.gltf");
    refused(f, &["compute", room, "--views", "64"], "--placement model");
    refused(f, &["compute", room, "--views", "4", "--placement", "model"], "must be 16 to");
    write(f, "field.npy", b"\x93NUMPY\x01\x00");
    refused(f, &["encode", "field.npy"], "field.npy");
    refused(f, &["propagate", "field.npy", "--distance", "1m", "-o", "out.npy"], "field.npy");
    refused(f, &["reconstruct", "field.npy", "--distance", "1m"], "field.npy");
    write(f, "frame.png", b"\x89PNG\r\n\x1a\nrest");
    refused(f, &["reconstruct", "frame.png", "--distance", "1m"], "frame.png");
    refused(f, &["compute", "a.png+b.png"], "a.png");
}

#[test]
fn bad_profiles_and_flags_end_in_one_line() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 -0.2\n";
    write(f, "p.ply", cloud);
    let good = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("calib/generic.toml")).expect("profile");
    for (name, text, expected) in [
        ("misspelt.toml", good.replace("fill_factor", "fil_factor"), "fil_factor"),
        ("zero.toml", good.replace("\"8um\"", "\"0um\""), "pitch"),
        ("unit.toml", good.replace("\"8um\"", "\"8\""), "unit"),
        ("number.toml", good.replace("\"8um\"", "8"), "unit"),
    ] {
        write(f, name, text);
        refused(f, &["compute", "p.ply", "--panel", name], expected);
        refused(f, &["show", "p.ply", "--panel", name], expected);
    }
    refused(f, &["compute", "p.ply", "--panel", "no-such-panel"], "no-such-panel");
    refused(f, &["compute", "p.ply", "--wavelength", "633"], "unit");
    refused(f, &["compute", "p.ply", "--wavelength=-633nm"], "greater than zero");
    refused(f, &["compute", "p.ply", "--error", "nan"], "error");
    refused(f, &["points", &scene("cornell.gltf"), "--rays", "0x500"], "500x500");
    refused(f, &["points", &scene("cornell.gltf"), "--camera", "nobody"], "nobody");
    refused(f, &["points", &scene("cornell.gltf"), "--near", "-200mm", "--far", "-100mm"], "far");
    for (wavelengths, expected) in [
        ("638nm,520nm", "three wavelengths"),
        ("638,520,450", "unit"),
        ("638nm,520nm,1064nm", "visible"),
        ("638nm,620nm,610nm", "white"),
        ("panel", "panel generic names 1"),
    ] {
        refused(f, &["compute", "p.ply", "--wavelengths", wavelengths], expected);
        refused(f, &["show", "p.ply", "--wavelengths", wavelengths], expected);
    }
    let three = "638nm,520nm,450nm";
    refused(f, &["compute", "p.ply", "--wavelengths", three, "--wavelength", "532nm"], "--wavelength");
    refused(f, &["compute", "p.ply", "--wavelengths", three, "--channel", "red"], "--channel");
    refused(f, &["compute", "p.ply", "--wavelengths", three, "--panel", "hamamatsu-x15213"], "450nm");
    refused(f, &["compute", "p.ply", "--points", "1000"], "points");
    for wrong in ["0", "-5", "many"] {
        refused(f, &["points", &scene("cornell.gltf"), &format!("--points={wrong}")], "number of points");
    }
    refused(f, &["points", &scene("cornell.gltf"), "--final-gather=0"], "--final-gather");
    refused(f, &["reconstruct", "frame.png"], "--distance");
    refused(f, &["frobnicate"], "frobnicate");
    refused(f, &[], "command");
    refused(f, &["compute", "p.ply", "-o", "no/such/folder/field.npy"], "no/such/folder");
    write(f, "file", "not a folder");
    refused(f, &["show", "p.ply", "-o", "file/out"], "file/out");
}

#[test]
fn bad_pictures_and_stacks_end_in_one_line() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    for (name, size) in [("a.png", 8), ("b.png", 9)] {
        image::RgbImage::from_pixel(size, 6, image::Rgb([200, 100, 0])).save(f.join(name)).expect("picture");
    }
    image::RgbImage::new(8, 6).save(f.join("black.png")).expect("picture");
    write(f, "torn.png", b"\x89PNG\r\n\x1a\n0000");
    refused(f, &["compute", "a.png+b.png", "--layers", "4"], "9×6 pixels");
    refused(f, &["compute", "a.png@-100mm+b.png@-120mm"], "9×6 pixels");
    refused(f, &["compute", "a.png@-100mm+b.png"], "has no depth");
    refused(f, &["compute", "a.png@ten"], "ten");
    refused(f, &["compute", "torn.png@-100mm"], "torn.png");
    refused(f, &["compute", "gone.png@-100mm"], "gone.png");
    refused(f, &["compute", "black.png@-100mm"], "black everywhere");
    refused(f, &["compute", "a.png@700mm"], "not in front of the eye");
    refused(f, &["compute", "a.png+a.png", "--layers", "0"], "1 to 4096");
    refused(f, &["compute", "a.png+a.png", "--layers", "16", "--memory", "10MB"], "give more memory or fewer layers");
    refused(f, &["compute", "a.png@-100mm", "--layers", "3"], "leave --layers out");
    refused(f, &["compute", &scene("cornell.gltf"), "--layers", "3"], "picture with depth");
    refused(f, &["show", "a.png@-100mm"], "focal stack");
    refused(
        f,
        &["points", &scene("cornell.gltf"), "--rays", "20x20", "--placement", "model", "--depth-map", "d.png"],
        "--placement window",
    );
}

#[test]
fn bad_sequences_end_in_one_line() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    fs::create_dir(f.join("empty")).expect("folder");
    let motion = scene("motion.gltf");
    refused(f, &["show", "empty"], "no frames");
    refused(f, &["show", "gone.png", "gone-too.png"], "gone.png");
    refused(f, &["show", "-"], "--raw");
    refused(f, &["show", "-", "--raw", "20x10"], "1920×1080");
    refused(f, &["show", "-", "--raw", "1920x1080", "--loop"], "cannot be played again");
    refused(f, &["show", "-", "b.png", "--raw", "1920x1080"], "one input");
    refused(f, &["show", "a.png", "b.npy"], "b.npy");
    refused(f, &["show", &motion, "--fps", "0"], "fps");
    refused(f, &["show", &motion, "--fps", "12", "--from", "3"], "no extent");
    refused(f, &["show", &motion, "--fps", "12", "--animation", "run"], "run");
    refused(f, &["show", &scene("cornell.gltf"), "--fps", "12"], "no animation");
    refused(f, &["show", &motion, "--fps", "12", "--wavelengths", "638nm,520nm,450nm"], "wavelengths");
    refused(f, &["show", &motion, "--fps", "12", "--subframes", "2"], "subframes");
    refused(f, &["show", "p.ply", "--fps", "12"], "frames in time");
    refused(f, &["show", &motion, "--ahead", "0"], "ahead");
    refused(f, &["show", &motion, "--live"], "--monitor");
    refused(f, &["show", &motion, "--live", "--monitor", "HDMI-1", "--fps", "12"], "--time");
    refused(f, &["show", "p.ply", "--live", "--monitor", "HDMI-1"], "p.ply");
    write(f, "short.npy", b"\x93NUMPY\x01\x00\x10\x00{'descr': '|u1'}");
    refused(f, &["show", "short.npy"], "short.npy");
}

#[test]
fn frames_in_time_on_the_simulated_panel_make_a_contact_sheet() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let generic =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("calib/generic.toml")).expect("profile");
    let small = generic.replace("width = 1920", "width = 96").replace("height = 1080", "height = 64");
    write(f, "small.toml", small);
    // Three frames of raw video and a part of a fourth.
    write(f, "frames.raw", (0..3 * 96 * 64 + 100).map(|i: usize| (i % 251) as u8).collect::<Vec<u8>>());
    let arguments = ["show", "frames.raw", "--raw", "96x64", "--panel", "small.toml", "-o", "out", "--json"];
    let out = holodrive(f, &arguments);
    let said = String::from_utf8_lossy(&out.stderr).to_string();
    assert!(out.status.success() && said.contains("frame 3 is cut short, 100 of 6144 bytes"), "{said}");
    let report: serde_json::Value = serde_json::from_slice(&out.stdout).expect("JSON");
    assert_eq!(report["frames"], 3);
    assert_eq!(report["contact_sheet"], serde_json::json!([0, 1, 2]));
    assert_eq!(names(&f.join("out/frames")), ["frame-00000.png", "frame-00001.png", "frame-00002.png"]);
    let sheet = image::open(f.join("out/contact.png")).expect("picture");
    assert_eq!(sheet.width(), 3 * (240 + 6) + 6);
    // What was written is a sequence again, with its own metadata: the panel need not be named.
    let out = holodrive(f, &["show", "out/frames", "-o", "again", "--json"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    for name in names(&f.join("out/frames")) {
        let read = |folder: &str| image::open(f.join(folder).join("frames").join(&name)).expect("picture").into_luma8();
        assert!(read("out") == read("again"), "{name}");
    }
    assert_eq!(image::open(f.join("again/contact.png")).expect("picture"), sheet);
}

#[test]
fn a_reference_that_aliases_is_refused_with_numbers() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 -0.002\n";
    write(f, "p.ply", cloud);
    let generic =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("calib/generic.toml")).expect("profile");
    // Wavelength beyond twice the pitch: every direction is on the grid, but not the sum of object and reference.
    let fine = generic
        .replace("\"8um\"", "\"0.3um\"")
        .replace("width = 1920", "width = 64")
        .replace("height = 1080", "height = 48");
    write(f, "fine.toml", fine);
    let small = generic.replace("width = 1920", "width = 64").replace("height = 1080", "height = 48");
    write(f, "small.toml", small);
    for panel in ["fine.toml", "small.toml"] {
        let made = holodrive(f, &["compute", "p.ply", "--panel", panel, "-o", "field.npy"]);
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let encode =
            ["encode", "field.npy", "--panel", panel, "--encoding", "off-axis-bipolar", "--reference-angle", "85deg"];
        refused(f, &encode, "limit");
    }
}

#[test]
fn a_depth_on_the_other_side_than_the_content_is_told_with_both_numbers() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let generic =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("calib/generic.toml")).expect("profile");
    write(f, "small.toml", generic.replace("width = 1920", "width = 96").replace("height = 1080", "height = 64"));
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 -0.03\n";
    write(f, "p.ply", cloud);
    let said = |arguments: &[&str]| {
        let out = holodrive(f, arguments);
        let said = String::from_utf8_lossy(&out.stderr).to_string();
        assert!(out.status.success(), "{arguments:?}: {said}");
        said
    };
    let same = said(&["compute", "p.ply", "--panel", "small.toml", "-o", "field.npy"]);
    // The old name of --engine, for one release.
    assert_eq!(same, said(&["compute", "p.ply", "--panel", "small.toml", "--method", "direct", "-o", "other.npy"]));
    said(&["encode", "field.npy", "--panel", "small.toml", "--method", "double-phase", "-o", "frame.png"]);
    // A flag that this input has no use for is named.
    let idle = said(&["compute", "p.ply", "--panel", "small.toml", "--rays", "9x9", "--time", "1", "-o", "other.npy"]);
    assert!(idle.contains("--rays, --time: of no use for a point cloud; ignored"), "{idle}");
    refused(f, &["show", "frame.png", "--hold", "3"], "--monitor");
    for input in ["field.npy", "frame.png"] {
        assert_eq!(said(&["reconstruct", input, "--distance", "-30mm"]), "");
        for flags in [&["--distance", "30mm"][..], &["--eye", "0mm,0mm,600mm", "--focus", "30mm"]] {
            let warned = said(&[&["reconstruct", input][..], flags].concat());
            let all = ["30mm is in front of", "behind it, from -30mm", "negative behind the panel"];
            assert!(all.iter().all(|part| warned.contains(part)), "{warned}");
        }
    }
}

#[test]
fn reports_are_json_and_help_has_examples() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let arguments =
        ["points", &scene("depth-chart.gltf"), "--rays", "40x30", "--json", "-o", "p.ply", "--picture", "t.npy"];
    let out = holodrive(f, &arguments);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let report: serde_json::Value = serde_json::from_slice(&out.stdout).expect("JSON");
    assert!(report["points"].as_u64().expect("points") > 20);
    assert_eq!(report["command"], "points");
    assert!(f.join("p.ply").is_file() && f.join("t.npy").is_file());
}

#[test]
fn help_is_short_or_has_examples_and_what_was_meant_is_told() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    for command in [
        "points",
        "views",
        "compute",
        "propagate",
        "encode",
        "reconstruct",
        "show",
        "print",
        "print preview",
        "print sheet",
        "print export",
        "print verify",
        "calibrate",
        "calibrate curve",
        "calibrate flatness",
        "calibrate camera",
        "calibrate check",
        "calibrate plate",
        "bench",
        "bench encodings",
        "bench views",
        "bench iterations",
        "serve",
        "panels",
        "plates",
        "manual",
        "monitors",
        "doctor",
    ] {
        let said = |help: &str| {
            let out = holodrive(f, &command.split(' ').chain([help]).collect::<Vec<_>>());
            assert!(out.status.success(), "{command}");
            String::from_utf8_lossy(&out.stdout).to_string()
        };
        let (short, long) = (said("-h"), said("--help"));
        assert!(short.lines().count() <= 40, "{command} -h has {} lines:\n{short}", short.lines().count());
        assert!(long.contains("Example") && long.contains(&format!("  holodrive {command} ")), "{long}");
        let deep = ["--near", "--depths", "--focus"].iter().any(|flag| long.contains(flag));
        assert_eq!(deep || long.contains("--distance"), long.contains("--- -z --->"), "{long}");
    }
    refused(f, &["shwo"], "did you mean `show`? (see holodrive --help)");
    refused(f, &["calibrate", "nonsense"], "(see holodrive calibrate --help)");
    refused(
        f,
        &["calibrate"],
        "a command is needed: curve, flatness, camera, check, plate (see holodrive calibrate --help)",
    );
    refused(f, &["bench"], "encodings, views, iterations (see holodrive bench --help)");
    refused(f, &["show", "a.ply", "--wavelenght", "532nm"], "did you mean `--wavelength`? (see holodrive show --help)");
    refused(f, &["compute", "a.ply", "--engine", "plane"], "did you mean `planes`?");
    refused(f, &["encode", "a.npy", "--encoding", "doublephase"], "did you mean `double-phase`?");
    refused(f, &["encode", "a.npy", "--panel", "plutoo"], "did you mean `holoeye-pluto-2.1`?");
}

#[test]
fn reports_state_exposure_budget_and_gamut() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let told = |arguments: &[&str]| -> serde_json::Value {
        let out = holodrive(f, arguments);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        serde_json::from_slice(&out.stdout).expect("JSON")
    };
    let chart = scene("depth-chart.gltf");
    let report = told(&["points", &chart, "--points", "3000", "--wavelengths", "450nm,638nm,520nm", "--json"]);
    let count = report["points"].as_u64().expect("points");
    assert!(count.abs_diff(3000) < 150, "{count}");
    assert_eq!(report["budget"]["limit"], "budget");
    assert!(report["budget"]["resolution"]["eye"][0].as_f64().is_some_and(|cells| (cells - 49.5).abs() < 0.1));
    assert!(report["exposure"]["white"].as_f64().is_some_and(|white| white > 0.0));
    assert_eq!(report["exposure"]["clips"], false);
    assert_eq!(report["clipped_points"], 0);
    assert_eq!(report["gamut"]["outside_points"], 0);
    let near = |value: &serde_json::Value, wavelength: f64| {
        value.as_f64().is_some_and(|found| (found / wavelength - 1.0).abs() < 1e-9)
    };
    assert!(near(&report["wavelengths"][0], 638e-9), "by falling wavelength");
    // Half of the chart's own white is clipped away.
    let white = format!("{}", 0.5 * report["exposure"]["brightest"].as_f64().expect("brightest"));
    let report = told(&["points", &chart, "--points", "1000", "--white", &white, "--json", "--final-gather=16"]);
    assert!(report["clipped_light"].as_f64().is_some_and(|part| part > 0.1 && part < 0.6), "{report}");
    assert!(report["clipped_points"].as_u64().is_some_and(|points| points > 0));
    // Three lasers, three fields at their own wavelengths.
    let fields = ["compute", "points.ply", "--wavelengths", "638nm,520nm,450nm", "-o", "f.npy", "--json"];
    let report = told(&fields);
    for (name, wavelength) in [("red", 638e-9), ("green", 520e-9), ("blue", 450e-9)] {
        assert!(near(&report[name]["wavelength"], wavelength));
        let text = fs::read_to_string(f.join(format!("f-{name}.npy.json"))).expect("metadata");
        let metadata: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        assert!(near(&metadata["wavelength"], wavelength));
        assert!(metadata["origin"].as_str().is_some_and(|o| o.contains(&format!("{name} of three lasers"))), "{text}");
    }
    assert!(!f.join("f.npy").exists());
}

#[test]
fn serve_takes_frames_without_a_panel_and_refuses_in_one_line() {
    use std::io::{BufRead, BufReader, Read, Write};
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let none = ["serve", "--monitor", "none", "--slmpy", "0"];
    for (flags, expected) in [
        (&[][..], "--monitor"),
        (&["--monitor", "none", "--idle", "256"], "255"),
        (&["--monitor", "none", "--idle", "nowhere.png"], "nowhere.png"),
        (&["--monitor", "none", "--name", "a/b"], "name"),
        (&["--monitor", "none", "--levels", "calibrated", "--panel", "generic-amplitude"], "--levels"),
        (&["--monitor", "none", "--panel", "no-such-panel"], "no-such-panel"),
        (&["--monitor", "none", "--trigger-patch", "top-left,8"], "--trigger-patch"),
        (&["--monitor", "none", "--listen", "nowhere"], "--listen"),
        (&["--monitor", "none", "--slmpy", "0", "--correction", "no.npy"], "no.npy"),
        (&["--monitor", "none", "--slmsuite", "65536"], "--slmsuite"),
    ] {
        refused(f, &[&["serve"], flags].concat(), expected);
    }
    let small = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("calib/generic.toml")).expect("profile");
    write(f, "small.toml", small.replace("width = 1920", "width = 24").replace("height = 1080", "height = 16"));
    let mut program = Command::new(env!("CARGO_BIN_EXE_holodrive"))
        .args([&none[..], &["--json", "--panel", "small.toml", "--idle", "9", "-o", "frames"]].concat())
        .current_dir(f)
        .stdout(std::process::Stdio::piped())
        .spawn()
        .expect("runs");
    let mut said = BufReader::new(program.stdout.take().expect("output"));
    let mut line = String::new();
    said.read_line(&mut line).expect("first line");
    let told: serde_json::Value = serde_json::from_str(&line).expect("JSON in one line");
    assert_eq!(told["serving"]["slmsuite"], serde_json::Value::Null, "only what was asked for");
    let mut client =
        std::net::TcpStream::connect(told["serving"]["slmpy"].as_str().expect("address")).expect("connect");
    for number in 1..=2u8 {
        let levels: Vec<u8> = (0..24 * 16).map(|i| (i % 251) as u8 ^ number).collect();
        client.write_all(&(levels.len() as i32).to_le_bytes()).expect("length");
        client.write_all(&levels).expect("frame");
        let mut answer = [0; 4];
        client.read_exact(&mut answer).expect("answer");
        assert_eq!(&answer, b"done");
        let kept = image::open(f.join(format!("frames/frame-00000{number}.png"))).expect("frame").into_luma8();
        assert_eq!(kept.into_raw(), levels);
    }
    let idle = image::open(f.join("frames/frame-000000.png")).expect("idle frame").into_luma8();
    assert!(idle.into_raw().iter().all(|&level| level == 9));
    // The file says enough for what would be seen of it.
    let seen = holodrive(f, &["reconstruct", "frames/frame-000002.png", "--distance", "-20mm", "-o", "seen.png"]);
    assert!(seen.status.success(), "{}", String::from_utf8_lossy(&seen.stderr));
    #[cfg(unix)]
    {
        let asked = Command::new("kill").args(["-TERM", &program.id().to_string()]).status().expect("kill");
        assert!(asked.success());
        let mut report = String::new();
        said.read_to_string(&mut report).expect("report");
        assert!(program.wait().expect("ends").success());
        let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
        assert_eq!((&report["served"]["shown"], &report["served"]["failed"]), (&2.into(), &0.into()), "{report}");
    }
    #[cfg(not(unix))]
    program.kill().expect("kill");
}

/// Commands in a page's `sh` blocks, in their order.
fn commands_of(page: &str) -> Vec<String> {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(page)).expect(page);
    let mut commands = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        if let Some(kind) = line.trim().strip_prefix("```") {
            inside = kind == "sh";
        } else if inside && !line.trim().is_empty() && !line.trim().starts_with('#') {
            commands.push(line.split(" #").next().unwrap_or("").trim().to_string());
        }
    }
    commands
}

/// Runs a page's commands in a folder that has what a checkout has; `made` are files that they leave.
fn every_command_runs(page: &str, least: usize, made: &[&str]) {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["scenes", "calib"] {
        fs::create_dir(f.join(name)).expect("folder");
        for entry in fs::read_dir(root.join(name)).expect("folder") {
            let path = entry.expect("entry").path();
            fs::copy(&path, f.join(name).join(path.file_name().expect("name"))).expect("copy");
        }
    }
    let commands = commands_of(page);
    assert!(commands.len() >= least, "{commands:?}");
    for command in commands {
        let words: Vec<&str> = command.split_whitespace().collect();
        let arguments = match words.as_slice() {
            ["holodrive", rest @ ..] | ["cargo", "run", "--release", "--", rest @ ..] => rest,
            // The test suite is not run inside itself.
            ["tests/run"] | ["cargo", "install", ..] => continue,
            _ => panic!("{page} has a command that this test does not know: {command}"),
        };
        let out = holodrive(f, arguments);
        assert!(out.status.success(), "{page}: {command}: {}", String::from_utf8_lossy(&out.stderr));
    }
    for name in made {
        assert!(f.join(name).is_file(), "{page}: {name} is missing: {:?}", names(f));
    }
}

#[test]
fn every_command_of_the_readme_runs() {
    let made = [
        "holodrive-out/traced.png",
        "holodrive-out/points.ply",
        "holodrive-out/frame.png",
        "holodrive-out/report.json",
        "holodrive-out/overview.png",
        "holodrive-out/seen-near.png",
        "holodrive-out/seen-far.png",
        "seen/sweep-focus.png",
        "preview.png",
    ];
    every_command_runs("README.md", 16, &made);
}

#[test]
fn every_command_of_the_guide_for_an_eye_runs() {
    let made = ["box/frame-002.png", "box/sweep-focus.png", "box/sweep-eye.png", "seed/field.npy", "cornell.npz"];
    every_command_runs("src/guide/eye.md", 10, &made);
}

#[test]
fn every_command_of_the_guide_to_scenes_runs() {
    let colour = ["frame-red", "frame-green", "frame-blue", "overview", "seen-near", "wanted-near"];
    let colour = colour.map(|name| format!("colour/{name}.png"));
    every_command_runs("src/guide/scenes.md", 14, &colour.each_ref().map(String::as_str));
}

#[test]
fn every_command_of_the_guide_to_the_lab_runs() {
    let made = ["motion/contact.png", "motion/frames/frame-00003.png", "again/contact.png", "chart/far.png"];
    every_command_runs("src/guide/lab.md", 10, &made);
}

#[test]
fn every_command_of_the_guide_to_plates_runs() {
    every_command_runs("src/guide/plates.md", 9, &["seen.png", "seen-traced.png", "sheet.html", "rainbow.png"]);
}
