//! Files of other programs, and those that were made for another panel or laser: right, or refused with the numbers.

use holodrive::field::arrays::{self, Named, Values};
use holodrive::field::npy::Content;
use holodrive::field::{Complex32, Field, Grid, stored};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn holodrive(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_holodrive")).args(line.split(' ')).current_dir(folder).output().expect("runs")
}

/// The report of a command that is done, and what it said on standard error.
fn done(folder: &Path, line: &str) -> (serde_json::Value, String) {
    let out = holodrive(folder, &format!("{line} --json"));
    let said = String::from_utf8_lossy(&out.stderr).to_string();
    assert!(out.status.success(), "{line}: {said}");
    (serde_json::from_slice(&out.stdout).expect("JSON"), said)
}

fn refused(folder: &Path, line: &str, words: &[&str]) {
    let names = |folder: &Path| fs::read_dir(folder).expect("folder").count();
    let before = names(folder);
    let out = holodrive(folder, line);
    let said = String::from_utf8_lossy(&out.stderr).to_string();
    assert_eq!(out.status.code(), Some(2), "{line}: {said}");
    let lines: Vec<&str> = said.lines().filter(|l| !l.starts_with("warning:")).collect();
    assert!(lines.len() == 1 && words.iter().all(|word| lines[0].contains(word)), "{line}: {words:?} not in {said}");
    assert_eq!(names(folder), before, "{line} left something");
}

/// A folder with a phase panel of 96 × 64 pixels of 8 µm, `small.toml`.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("folder");
    let generic = Path::new(env!("CARGO_MANIFEST_DIR")).join("calib/generic.toml");
    let text = fs::read_to_string(generic).expect("profile");
    let small = text.replace("width = 1920", "width = 96").replace("height = 1080", "height = 64");
    fs::write(folder.path().join("small.toml"), small).expect("write");
    let path = folder.path().to_path_buf();
    (folder, path)
}

/// A wave that is focused at z, smooth and within the field.
fn field(path: &Path, [width, height]: [usize; 2], pitch: f64, wavelength: f64, z: f64) -> Field {
    let grid = Grid::new(width, height, pitch, pitch).expect("grid");
    let sample = |i: usize| {
        let (x, y) = (grid.x(i % width), grid.y(i / width));
        let phase = std::f64::consts::PI * (x * x + y * y) / (wavelength * -z);
        Complex32::from_polar((-(x * x + y * y) / 1.2e-4f64.powi(2)).exp() as f32, phase as f32)
    };
    let field = Field::new(grid, wavelength, (0..grid.len()).map(sample).collect()).expect("field");
    let content = Content { depth: Some([z, z]), ..Content::default() };
    stored::write_field(path, &field, &content, "test").expect("write");
    field
}

#[test]
fn a_field_for_other_pixels_or_light_is_refused_with_both_numbers_or_fitted() {
    let (_folder, f) = folder();
    let whole = "--panel small.toml --wavelength 532nm";
    field(&f.join("ok.npy"), [96, 64], 8e-6, 532e-9, -0.03);
    field(&f.join("fine.npy"), [206, 138], 3.74e-6, 532e-9, -0.03);
    field(&f.join("large.npy"), [128, 80], 8e-6, 532e-9, -0.03);
    field(&f.join("red.npy"), [96, 64], 8e-6, 632.8e-9, -0.03);
    let commands = ["encode IN -o frame.png", "show IN -o out", "reconstruct IN --distance -30mm -o seen.png"];
    for command in commands {
        let line = |input: &str, flags: &str| format!("{} {whole}{flags}", command.replace("IN", input));
        refused(&f, &line("fine.npy", ""), &["pitch of 3.74um", "panel", "8um", "--resample"]);
        refused(&f, &line("large.npy", ""), &["128×80", "96×64", "--resample"]);
        refused(&f, &line("red.npy", ""), &["632.8nm", "532nm", "1.1895", "--rescale-depth"]);
        refused(&f, &line("ok.npy", " --pitch 6.4um"), &["8um", "6.4um"]);
    }
    for command in commands {
        let line = |input: &str, flags: &str| format!("{} {whole}{flags}", command.replace("IN", input));
        let (report, said) = done(&f, &line("ok.npy", ""));
        assert!(report.get("resampled").is_none() && said.is_empty(), "{said}");
        let (report, said) = done(&f, &line("fine.npy", " --resample"));
        assert!(
            report["resampled"].as_str().is_some_and(|notes| notes.contains("3.74um to 8um by Fourier")),
            "{report}"
        );
        assert!(said.is_empty(), "{said}");
        let (report, _) = done(&f, &line("large.npy", " --resample"));
        assert!(
            report["resampled"].as_str().is_some_and(|notes| notes.contains("cut off: 16 and 16 columns")),
            "{report}"
        );
        let (report, _) = done(&f, &line("red.npy", " --rescale-depth"));
        assert!((report["depth_factor"].as_f64().expect("factor") - 632.8 / 532.0).abs() < 1e-9);
    }
    // What was interpolated is the wave itself: as good on the panel as one that was made for it.
    for (input, flags) in [("ok.npy", ""), ("fine.npy", " --resample")] {
        done(&f, &format!("reconstruct {input} --distance -30mm {whole}{flags} -o {input}.seen.npy"));
    }
    let read = |name: &str| holodrive::field::npy::read_real(&f.join(name)).expect("picture").values;
    let (a, b) = (read("ok.npy.seen.npy"), read("fine.npy.seen.npy"));
    let largest = a.iter().fold(0f32, |m, v| m.max(*v));
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 0.02 * largest));
    // In the other light the focus stands 1.19 times as far.
    done(&f, &format!("encode red.npy {whole} --rescale-depth -o frame.png"));
    let (report, _) = done(&f, "show frame.png --panel small.toml -o framed");
    assert_eq!(report["wavelength"], 532e-9);
    refused(&f, "reconstruct frame.png --wavelength 450nm --distance -30mm -o x.png", &["532nm", "450nm"]);
    done(&f, "reconstruct frame.png --wavelength 450nm --distance -30mm --rescale-depth -o x.png");
}

#[test]
fn floats_are_phases_whole_numbers_levels_and_complex_numbers_fields() {
    let (_folder, f) = folder();
    let write = |name: &str, values: &Values| {
        arrays::write(&f.join(name), &[Named { name: "a", shape: [64, 96], values }]).expect("write");
    };
    let levels: Vec<i64> = (0..96 * 64).map(|i| (i * 37) % 256).collect();
    let phases = levels.iter().map(|level| *level as f64 * std::f64::consts::TAU / 256.0).collect();
    write("phase.npy", &Values::Real(phases));
    write("levels.npy", &Values::Whole(levels.clone()));
    write("float.npy", &Values::Real(levels.iter().map(|level| *level as f64).collect()));
    let frame = |name: &str| -> Vec<i64> {
        image::open(f.join(name)).expect("frame").into_luma8().into_raw().into_iter().map(Into::into).collect()
    };
    for name in ["phase", "levels"] {
        let (report, said) = done(&f, &format!("encode {name}.npy --panel small.toml -o {name}.png"));
        assert_eq!(frame(&format!("{name}.png")), levels, "{name}: every level survives");
        assert!(said.is_empty(), "{said}");
        let word = if name == "phase" { "phases in radians" } else { "drive levels" };
        assert!(report["read"].as_str().is_some_and(|read| read.contains(word)), "{report}");
    }
    let (report, _) = done(&f, "encode phase.npy --panel small.toml -o phase.png");
    assert_eq!(report["encoding"], "kinoform");
    let (report, _) = done(&f, "show phase.npy --panel small.toml --focus -20mm -o out");
    assert_eq!((&report["encoding"], &frame("out/frame.png")), (&"kinoform".into(), &levels));
    let (_, said) = done(&f, "encode float.npy --panel small.toml -o float.png");
    assert!(said.contains("whole numbers from 0 to 255") && said.contains("uint8"), "{said}");
    refused(&f, "encode levels.npy --panel small.toml --encoding kinoform -o x.png", &["--encoding", "drive levels"]);
    refused(&f, "encode levels.npy -o x.png", &["96×64 drive levels", "1920×1080"]);
    // Levels out again, in each kind of file.
    for name in ["out.npy", "out.mat", "out.tif"] {
        done(&f, &format!("encode phase.npy --panel small.toml -o {name}"));
        assert_eq!(arrays::read(&f.join(name)).expect(name).values, Values::Whole(levels.clone()), "{name}");
    }
}

#[test]
fn arrays_of_a_file_are_chosen_by_name_and_fields_come_back_from_mat() {
    let (_folder, f) = folder();
    let made = field(&f.join("u.npy"), [96, 64], 8e-6, 532e-9, -0.03);
    done(&f, "propagate u.npy --distance 5mm -o there.mat");
    done(&f, "propagate u.npy --distance 5mm -o there.npy");
    let read = |name: &str| stored::read_field(&f.join(name), None, None).expect("field");
    assert_eq!(read("there.mat"), read("there.npy"));
    let one = Values::Complex(made.samples.clone());
    let named = |name| Named { name, shape: [64, 96], values: &one };
    arrays::write(&f.join("two.mat"), &[named("U"), named("V")]).expect("write");
    let flags = "--pitch 8um --wavelength 532nm --distance 1mm -o o.npy";
    refused(&f, &format!("propagate two.mat {flags}"), &["U (64×96 complex), V (64×96 complex)", "two.mat:U"]);
    refused(&f, &format!("propagate two.mat:W {flags}"), &["no `W`", "V (64×96"]);
    let (report, _) = done(&f, &format!("propagate two.mat:V {flags}"));
    assert!(report["read"].as_str().is_some_and(|read| read.contains("`V`")), "{report}");
}

#[test]
fn clouds_of_other_units_are_placed_or_refused_with_numbers() {
    let (_folder, f) = folder();
    let rows: String = (0..20).map(|i| format!("-30 {} 480\n", i * 5 - 50)).collect();
    fs::write(f.join("mm.xyz"), rows).expect("write");
    let panel = "--panel small.toml";
    refused(
        &f,
        &format!("compute mm.xyz {panel} -o f.npy"),
        &["none of its 20 points", "480m", "8um", "--placement model"],
    );
    refused(&f, &format!("show mm.xyz {panel} -o out"), &["none of its 20 points"]);
    let (report, said) = done(&f, &format!("compute mm.xyz {panel} --placement model --distance -20mm -o f.npy"));
    assert!(
        report["placed"].as_str().is_some_and(|placed| placed.contains("z -20mm … -20mm")) && said.is_empty(),
        "{report}"
    );
    let (field, metadata) = stored::read_field(&f.join("f.npy"), None, None).expect("field");
    assert!(field.energy() > 0.0 && metadata.content.depth == Some([-0.02, -0.02]), "{metadata:?}");
    // At 20 mm the points are in focus on one column, from the top to the bottom.
    done(&f, "reconstruct f.npy --distance -20mm -o seen.npy");
    let (_, said) = done(&f, &format!("compute mm.xyz {panel} --scale 2e-5 --distance 15mm -o f.npy"));
    assert!(said.contains("of its 20 points send no light") || said.is_empty(), "{said}");
    assert_eq!(stored::read_field(&f.join("f.npy"), None, None).expect("field").1.content.depth, Some([0.015, 0.015]));
}

#[test]
fn depth_cameras_millimetres_are_measured_depths() {
    let (_folder, f) = folder();
    image::RgbImage::from_pixel(16, 12, image::Rgb([255; 3])).save(f.join("rgb.png")).expect("picture");
    // A strip without measurement, a box at 600 mm, a wall at 1500 mm.
    let depth = |x: u32| [0u16, 600, 1500][(x / 6).min(2) as usize];
    let map = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(16, 12, |x, _| image::Luma([depth(x)]));
    map.save(f.join("d.png")).expect("map");
    for flags in ["--depth-scale black-near", "--depth-unit 1mm"] {
        let (report, _) = done(&f, &format!("compute rgb.png+d.png --panel small.toml {flags} -o f.npy"));
        assert_eq!((&report["points"], &report["unmeasured"]), (&120.into(), &72.into()), "{flags}");
        let ends: Vec<f64> = report["depth"].as_array().expect("depth").iter().filter_map(|z| z.as_f64()).collect();
        assert!((ends[0] + 0.15).abs() < 1e-9 && (ends[1] + 0.1).abs() < 1e-9, "{ends:?}");
    }
    let flags = "--depth-unit 1mm --depth-range 0.6m,2.4m";
    let (report, _) = done(&f, &format!("compute rgb.png+d.png --panel small.toml {flags} --layers 4 -o f.npy"));
    assert_eq!(report["unmeasured"], 72);
    let (_, said) = done(&f, "compute rgb.png+d.png --panel small.toml -o f.npy");
    assert!(said.contains("use 1.4 % of the scale"), "{said}");
}

#[test]
fn names_of_outputs_say_the_kind_and_a_dash_is_standard_output() {
    let (_folder, f) = folder();
    field(&f.join("u.npy"), [96, 64], 8e-6, 532e-9, -0.03);
    refused(&f, "encode u.npy --panel small.toml -o frame.jpg", &["JPEG", ".png"]);
    refused(&f, "reconstruct u.npy --distance -30mm -o x.jpg", &["JPEG", ".png, .npy"]);
    refused(&f, "propagate u.npy --distance 1mm -o x.dat", &[".npy, .mat"]);
    let out = holodrive(&f, "encode u.npy --panel small.toml -o -");
    assert!(out.status.success() && out.stdout.starts_with(b"\x89PNG"), "{}", String::from_utf8_lossy(&out.stderr));
    assert!(String::from_utf8_lossy(&out.stderr).contains("encode"), "the report stands beside it");
    assert!(image::load_from_memory(&out.stdout).is_ok_and(|picture| picture.width() == 96));
    // Half of 96 pixels of 8 µm is 384 µm: 96 columns, not 97.
    for name in ["seen.npy", "seen.mat", "seen.tif"] {
        done(&f, &format!("reconstruct u.npy --distance -30mm --half 384um,256um -o {name}"));
        assert_eq!(arrays::read(&f.join(name)).expect(name).shape, [64, 96], "{name}");
    }
    refused(&f, "encode u.npy --panel small.toml --blaze 20deg -o x.png", &["at most 1.91deg"]);
    let missing = holodrive(&f, "compute missing.png+d.png -o f.npy");
    let said = String::from_utf8_lossy(&missing.stderr).to_string();
    assert!(said.contains("missing.png: No such file") && !said.contains("os error"), "{said}");
}

#[test]
fn a_field_without_depths_is_looked_at_where_it_is_sharp_or_where_a_flag_says() {
    let (_folder, f) = folder();
    field(&f.join("u.npy"), [96, 64], 8e-6, 632.8e-9, -0.02);
    fs::remove_file(f.join("u.npy.json")).expect("metadata");
    let (report, _) = done(&f, "show u.npy --panel small.toml -o swept");
    let found = report["sharpest"].as_f64().expect("depth");
    // A phase pattern has a twin: either side is one of its pictures.
    assert!((found.abs() - 0.02).abs() < 0.004, "{found}");
    for flag in ["--focus", "--distance"] {
        let (report, said) = done(&f, &format!("show u.npy --panel small.toml {flag} -20mm -o told"));
        assert_eq!(report["focus"], -0.02);
        assert!(report.get("sharpest").is_none() && !said.contains("ignored"), "{said}");
    }
    assert!(f.join("told/reconstruction-near.png").is_file());
}

/// A glTF of one mesh whose positions stand in the file itself.
fn gltf(path: &Path, positions: &[f32], mode: u32, material: serde_json::Value) {
    let bytes: Vec<u8> = positions.iter().flat_map(|v| v.to_le_bytes()).collect();
    let data = base64::Engine::encode(&base64::prelude::BASE64_STANDARD, &bytes);
    let told = serde_json::json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": mode, "material": 0}]}], "materials": [material],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": positions.len() / 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": bytes.len()}],
        "buffers": [{"byteLength": bytes.len(), "uri": format!("data:application/octet-stream;base64,{data}")}]
    });
    fs::write(path, told.to_string()).expect("write");
}

#[test]
fn a_gltf_of_points_alone_is_a_cloud() {
    let (_folder, f) = folder();
    // An L in metres: its long stroke left, its foot to the right.
    let corner = [-1.0f32, -1.5, 0.0, -1.0, 0.0, 0.5, -1.0, 1.5, 0.0, 0.0, -1.5, 0.0, 1.0, -1.5, 0.0];
    let red = serde_json::json!({"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}});
    gltf(&f.join("l.gltf"), &corner, 0, red);
    let (report, said) = done(&f, "points l.gltf --panel small.toml --picture l.npy -o l.ply");
    assert!(said.contains("--picture l.npy: is not written") && !f.join("l.npy").exists(), "{said}");
    assert!(report["read"].as_str().is_some_and(|read| read.starts_with("5 points of a glTF")), "{report}");
    let cloud = holodrive::points::ply::read(&f.join("l.ply")).expect("cloud").cloud;
    let [low, foot] = [0, 4].map(|i| cloud.points[i].position);
    assert!(low.x < 0.0 && low.y < 0.0 && foot.x > 0.0 && (foot.y - low.y).abs() < 1e-9, "{low} {foot}");
    assert!(cloud.rgb.is_some_and(|rgb| rgb.iter().all(|c| c[0] > 0.9 && c[1] == 0.0)));
    assert_eq!(done(&f, "compute l.gltf --panel small.toml -o l-field.npy").0["points"], 5);
    refused(&f, "points l.gltf --panel small.toml --frame world -o w.ply", &["frame", "scenes"]);
}

#[test]
fn a_panorama_lights_a_scene_and_is_seen_in_its_mirror() {
    let (_folder, f) = folder();
    // Red from above, blue from below; a floor and, upright behind it, a mirror that leans up.
    let half = |up: [u8; 3], down: [u8; 3]| {
        image::RgbImage::from_fn(64, 32, |_, y| image::Rgb(if y < 16 { up } else { down })).save(f.join("around.png"))
    };
    half([255, 0, 0], [0, 0, 255]).expect("png");
    let floor = [-1.0f32, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, -1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, -1.0, 0.0, -1.0];
    let matt =
        serde_json::json!({"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1}, "doubleSided": true});
    let chrome =
        serde_json::json!({"pbrMetallicRoughness": {"metallicFactor": 1, "roughnessFactor": 0}, "doubleSided": true});
    gltf(&f.join("floor.gltf"), &floor, 4, matt);
    gltf(&f.join("chrome.gltf"), &floor, 4, chrome);
    for (scene, wanted) in [("floor", 1.0f32), ("chrome", 1.0)] {
        let line = format!(
            "points {scene}.gltf --environment around.png --environment-strength 0.5 --rays 40x40 --panel small.toml --picture p.npy \
             -o p.ply"
        );
        let (_, said) = done(&f, &line);
        assert!(!said.contains("no light"), "{said}");
        let picture = holodrive::field::npy::read_real(&f.join("p.npy")).expect("picture");
        let lit: Vec<&[f32]> = picture.values.chunks(3).filter(|p| p.iter().sum::<f32>() > 0.3).collect();
        assert!(lit.len() > 100, "{scene}: {} of 1600 pixels are lit", lit.len());
        // The camera that was added looks from above: a white floor and a mirror both show the sky.
        // Pixels on its edges are darker.
        let mut red: Vec<f32> = lit.iter().map(|pixel| pixel[0]).collect();
        red.sort_by(f32::total_cmp);
        let middle = red[red.len() / 2];
        assert!((middle - 0.5 * wanted).abs() < 0.06, "{scene}: {middle}");
        assert!(lit.iter().all(|pixel| pixel[2] < 0.06), "{scene}: {lit:?}");
    }
    refused(&f, "points floor.gltf --environment small.toml --panel small.toml -o q.ply", &["small.toml", "panorama"]);
}
