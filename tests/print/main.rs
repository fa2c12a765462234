//! Plates as a user meets them: the same bytes whoever computed which tile, independent readers, a real scheduler.

mod pictures;
mod sheet;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn holodrive(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_holodrive")).args(arguments).current_dir(folder).output().expect("runs")
}

fn done(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    let out = holodrive(folder, &[arguments, &["--json"]].concat());
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

/// Bad input ends in exit code 2, one line that says `expected`, and nothing new or changed.
fn refused(folder: &Path, arguments: &[&str], expected: &str) {
    let before = contents(folder);
    let out = holodrive(folder, arguments);
    let said = String::from_utf8_lossy(&out.stderr);
    let lines: Vec<&str> = said.lines().filter(|l| !l.starts_with("warning:")).collect();
    assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
    assert!(
        lines.len() == 1 && lines[0].contains(expected),
        "{arguments:?} did not say `{expected}` in a line: {said}"
    );
    assert!(contents(folder) == before, "{arguments:?} left or changed something");
}

/// Every file under a folder with its bytes.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(next).expect("folder") {
            let path = entry.expect("entry").path();
            if path.is_dir() {
                open.push(path);
            } else {
                let bytes = fs::read(&path).expect("file");
                found.push((path.strip_prefix(folder).expect("inside").to_path_buf(), bytes));
            }
        }
    }
    found.sort();
    found
}

/// A plate of 35 tiles whose last ones are cut off, and some points 5 mm behind it.
fn prepare(folder: &Path) {
    let mut text = String::from(
        "ply\nformat ascii 1.0\nelement vertex 16\nproperty double x\nproperty double y\nproperty double z\nend_header\n",
    );
    let mut state = 7u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1u64 << 31) as f64 - 0.5
    };
    for _ in 0..16 {
        text += &format!("{} {} {}\n", 0.6e-3 * random(), 0.4e-3 * random(), -5e-3 + 0.5e-3 * random());
    }
    fs::write(folder.join("points.ply"), text).expect("points");
    fs::write(folder.join("plate.toml"), plate("bits = 1")).expect("plate");
    fs::write(folder.join("gray.toml"), plate("bits = 8\nguard = 20\nmarks = 16")).expect("plate");
}

fn plate(bits: &str) -> String {
    format!(
        "name = \"test\"\nsize = [860, 600]\npitch = \"1um\"\nwavelength = \"633nm\"\n{bits}\ntile = 128\n\
         [reference]\nangle = [\"9.1deg\", \"0deg\"]\n[scene]\nviewer = \"30mm\"\ndistance = \"5mm\"\n\
         object_angle = [\"9.2deg\", \"9.2deg\"]\n"
    )
}

const PRINT: [&str; 5] = ["print", "points.ply", "--plate", "plate.toml", "-o"];

fn print_into<'a>(folder: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&PRINT[..], &[folder], more].concat()
}

#[test]
fn threads_shards_and_their_order_make_the_same_bytes() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    let report = done(f, &print_into("whole", &[]));
    assert!(report["complete"] == true && report["done"]["computed"] == 35, "{report}");
    let expected = contents(&f.join("whole"));
    assert_eq!(expected.len(), 2, "manifest and plate");
    let one = Command::new(env!("CARGO_BIN_EXE_holodrive"))
        .args(print_into("one", &[]))
        .env("RAYON_NUM_THREADS", "1")
        .current_dir(f)
        .output()
        .expect("runs");
    assert!(one.status.success());
    assert!(contents(&f.join("one")) == expected, "one thread");
    for (i, shard) in ["2/4", "0/4", "3/4", "1/4"].into_iter().enumerate() {
        let report = done(f, &print_into("parts", &["--shard", shard]));
        assert_eq!(report["complete"], i == 3, "{report}");
        if i == 1 {
            refused(f, &["print", "verify", "parts"], "of 35 tiles are finished");
        }
    }
    assert!(contents(&f.join("parts")) == expected, "four parts");
    // All at once, as a scheduler starts them.
    let start = |id: &str| {
        Command::new(env!("CARGO_BIN_EXE_holodrive"))
            .args(print_into("array", &["--shard", "auto"]))
            .env("SLURM_ARRAY_TASK_ID", id)
            .env("SLURM_ARRAY_TASK_MIN", "1")
            .env("SLURM_ARRAY_TASK_COUNT", "3")
            .current_dir(f)
            .stdout(Stdio::null())
            .spawn()
            .expect("starts")
    };
    let tasks: Vec<_> = ["1", "2", "3"].into_iter().map(start).collect();
    tasks.into_iter().for_each(|mut task| assert!(task.wait().expect("ends").success()));
    assert!(contents(&f.join("array")) == expected, "three at once");
    let report = done(f, &["print", "verify", "array"]);
    assert_eq!(report["tiles"], 35);
    // What is complete is left as it is.
    let again = done(f, &print_into("array", &[]));
    assert!(again["done"]["kept"] == 35 && again["done"]["computed"] == 0);
    // A folder of other settings, a changed input, a damaged file.
    fs::write(f.join("other.toml"), plate("bits = 1\nbias = 0.4")).expect("plate");
    refused(f, &["print", "points.ply", "--plate", "other.toml", "-o", "array"], "plate.bias is 0.5 there, 0.4 here");
    let cloud = fs::read_to_string(f.join("points.ply")).expect("points");
    fs::write(f.join("points.ply"), cloud.replace("0.000", "0.001")).expect("points");
    refused(f, &print_into("array", &[]), "inputs");
    let mut bytes = fs::read(f.join("array/plate.tif")).expect("plate");
    // The last tile's 2048 bytes begin 4096 before the end.
    let last = bytes.len() - 4000;
    bytes[last] ^= 4;
    fs::write(f.join("array/plate.tif"), bytes).expect("plate");
    refused(f, &["print", "verify", "array"], "1 of 35 tiles");
}

#[test]
fn searched_plates_are_the_same_in_parts_and_after_a_kill() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    let way = ["--binarisation", "direct-search"];
    let whole = done(f, &print_into("whole", &way));
    assert!(whole["complete"] == true, "{whole}");
    let expected = contents(&f.join("whole"));
    done(f, &print_into("parts", &[&way[..], &["--shard", "1/2"]].concat()));
    done(f, &print_into("parts", &[&way[..], &["--shard", "0/2"]].concat()));
    assert!(contents(&f.join("parts")) == expected, "two parts");
    let mut run = Command::new(env!("CARGO_BIN_EXE_holodrive"))
        .args(print_into("killed", &way))
        .env("RAYON_NUM_THREADS", "1")
        .current_dir(f)
        .stdout(Stdio::null())
        .spawn()
        .expect("starts");
    let begin = Instant::now();
    // Not before its first tile.
    while !f.join("killed/.tiles").exists() && begin.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
    run.kill().expect("kills");
    run.wait().expect("ends");
    done(f, &print_into("killed", &way));
    assert!(contents(&f.join("killed")) == expected, "killed");
    refused(
        f,
        &["print", "points.ply", "--plate", "gray.toml", "--binarisation", "direct-search", "-o", "x"],
        "bits = 1",
    );
    refused(f, &print_into("whole", &[]), "binarisation");
    // A lamp as wide as in life: the picture is another one than a laser's, and its report says so.
    let look = ["print", "preview", "whole", "--eye", "0mm,0mm,30mm", "--focus", "-5mm", "--size", "40x30"];
    let laser = done(f, &[&look[..], &["-o", "laser.png"]].concat());
    let lamp = done(
        f,
        &[&look[..], &["--lamp", "3mm,300mm", "--bandwidth", "10nm", "--places", "9", "-o", "lamp.png"]].concat(),
    );
    assert!(lamp["lamp"]["diameter"] == 3e-3 && laser.get("lamp").is_none(), "{lamp}");
    assert!(fs::read(f.join("laser.png")).expect("laser") != fs::read(f.join("lamp.png")).expect("lamp"));
    refused(f, &[&look[..], &["--lamp", "3mm"]].concat(), "2mm,300mm");
    refused(f, &[&look[..], &["--lamp", "3m,300mm"]].concat(), "farther than wide");
}

#[test]
fn a_run_killed_twenty_times_ends_in_the_same_bytes() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    let begin = Instant::now();
    done(f, &print_into("whole", &[]));
    let all = begin.elapsed();
    let start = || {
        Command::new(env!("CARGO_BIN_EXE_holodrive"))
            .args(print_into("killed", &[]))
            .current_dir(f)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("starts")
    };
    let mut state = 99u64;
    let (mut kills, mut early) = (0, 0);
    while kills < 20 {
        let mut run = start();
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // The samples before the manifest are begun anew after each kill: the first runs are cut within them.
        if kills >= 4 {
            let until = Instant::now() + Duration::from_secs(60);
            while !f.join("killed/manifest.json").exists() && Instant::now() < until {
                std::thread::sleep(Duration::from_millis(2));
            }
        }
        std::thread::sleep(all.mul_f64((state >> 40) as f64 / (1u64 << 24) as f64 / 30.0));
        if run.try_wait().expect("state").is_some() {
            early += 1;
            assert!(early < 3, "the plate is complete after {kills} kills");
            continue;
        }
        run.kill().expect("killed");
        run.wait().expect("ended");
        kills += 1;
    }
    let last = done(f, &print_into("killed", &[]));
    println!("{kills} kills; then {} tiles kept, {} torn", last["done"]["kept"], last["done"]["torn"]);
    assert_eq!(last["complete"], true);
    assert!(contents(&f.join("killed")) == contents(&f.join("whole")));
    done(f, &["print", "verify", "killed"]);
}

/// A mounted memory file system; unmounted when dropped.
struct Disk(PathBuf);

impl Disk {
    fn new(path: PathBuf, size: &str) -> Option<Self> {
        fs::create_dir(&path).expect("folder");
        let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", size, "tmpfs"]).arg(&path).output();
        mounted.is_ok_and(|out| out.status.success()).then_some(Self(path))
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(&self.0).output();
    }
}

#[test]
fn a_full_disk_stops_with_words_and_what_is_done_stays() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    let Some(disk) = Disk::new(f.join("disk"), "size=200k") else {
        println!("did not run: no memory file system can be mounted here");
        return;
    };
    let arguments = ["print", "points.ply", "--plate", "gray.toml", "-o"];
    let out = holodrive(f, &[&arguments[..], &["disk/plate"]].concat());
    let said = String::from_utf8_lossy(&out.stderr).to_string();
    let lines: Vec<&str> = said.lines().filter(|l| !l.starts_with("warning:")).collect();
    assert_eq!(out.status.code(), Some(2), "{said}");
    assert!(lines.len() == 1 && lines[0].contains("no space left") && lines[0].contains("of 35 tiles"), "{said}");
    assert!(!disk.0.join("plate/plate.tif").exists(), "nothing under the final name");
    let more = Command::new("mount").args(["-o", "remount,size=4m"]).arg(&disk.0).output().expect("mount");
    assert!(more.status.success());
    let report = done(f, &[&arguments[..], &["disk/plate"]].concat());
    assert!(report["done"]["kept"].as_u64() > Some(0) && report["complete"] == true, "{report}");
    done(f, &[&arguments[..], &["whole"]].concat());
    assert!(contents(&disk.0.join("plate")) == contents(&f.join("whole")));
}

#[test]
fn plates_that_would_be_wrong_are_refused_in_a_line() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    let good = plate("bits = 1");
    for (name, from, to, expected) in [
        ("aliased", "9.1deg\", \"0deg", "17.9deg\", \"0deg", "passes the grid's limit"),
        ("on-axis", "9.1deg\", \"0deg", "0deg\", \"0deg", "zero order"),
        ("tile", "tile = 128", "tile = 1024", "smaller than a tile"),
        ("pitch", "pitch = \"1um\"", "pitch = \"1um\"\npitch_y = \"2um\"", "pitch_y stands beside pitch"),
        ("unit", "\"633nm\"", "\"633\"", "unit"),
        ("unknown", "bits = 1", "bits = 1\ncolour = 3", "colour"),
    ] {
        let text = good.replace(from, to);
        assert_ne!(text, good, "{name}");
        let file = format!("{name}.toml");
        fs::write(f.join(&file), text).expect("plate");
        refused(f, &["print", "points.ply", "--plate", &file, "-o", "out"], expected);
        refused(f, &["print", "points.ply", "--plate", &file, "--dry-run"], expected);
    }
    let aside = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0.5 0 -0.005\n";
    fs::write(f.join("aside.ply"), aside).expect("points");
    refused(f, &["print", "aside.ply", "--plate", "plate.toml", "-o", "out"], "none is seen");
    fs::write(f.join("dark.gltf"), r#"{"asset":{"version":"2.0"}}"#).expect("scene");
    refused(f, &["print", "dark.gltf", "--plate", "plate.toml", "-o", "out"], "dark.gltf");
    refused(f, &["print", "missing.ply", "--plate", "plate.toml", "-o", "out"], "missing.ply");
    refused(f, &["print", "points.ply", "--plate", "missing.toml", "-o", "out"], "missing.toml");
    refused(f, &["print", "points.ply", "-o", "out"], "--plate");
    refused(f, &["print", "points.ply", "--plate", "plate.toml"], "-o DIR");
    refused(f, &["print", "--plate", "plate.toml"], "scene or points");
    refused(f, &print_into("out", &["--shard", "4/4"]), "4/4");
    refused(f, &print_into("out", &["--shard", "auto"]), "SLURM_ARRAY_TASK_ID");
    refused(f, &["print", "verify", "."], "no manifest.json");
    refused(
        f,
        &["print", "preview", ".", "--eye", "0mm,0mm,9mm", "--focus", "-5mm", "-o", "p.png"],
        "no manifest.json",
    );
    fs::create_dir(f.join("strange")).expect("folder");
    fs::write(f.join("strange/plate.tif"), "mine").expect("file");
    refused(f, &print_into("strange", &[]), "without a manifest");
    // A plan writes nothing and knows the numbers.
    let before = contents(f);
    let plan = &done(f, &["print", "points.ply", "--plate", "plate.toml", "--dry-run"])["plan"];
    assert!(contents(f) == before);
    assert_eq!(plan["size"], serde_json::json!([860, 600]));
    assert!(plan["pairs"].as_f64() > Some(1e6) && plan["seconds"].as_f64() > Some(0.0), "{plan}");
    assert!((plan["object_angle"][0].as_f64().expect("angle").to_degrees() - 9.1).abs() < 0.1, "{plan}");
}

#[test]
fn view_sequences_are_made_of_scenes_and_printed() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    let sequence = ["views", "cornell", "--sequence", "3", "--size", "40x30", "-o", "seq"];
    refused(f, &sequence, "--eye-box 300mm");
    refused(f, &["views", "points.ply", "--sequence", "3", "--eye-box", "20mm", "-o", "seq"], "made of a scene");
    let report = done(f, &[&sequence[..], &["--eye-box", "20mm"]].concat());
    assert_eq!(report["sequence"]["spacing"].as_f64(), Some(0.01), "{report}");
    let told: serde_json::Value =
        serde_json::from_slice(&fs::read(f.join("seq/sequence.json")).expect("json")).expect("json");
    assert_eq!((&told["views"], &told["files"][1]), (&serde_json::json!(3), &serde_json::json!("0003.tif")));
    let pictures = [1, 2, 3].map(|k| image::open(f.join(format!("seq/000{k}.tif"))).expect("picture").to_luma8());
    assert!(pictures.iter().all(|picture| picture.dimensions() == (40, 30)));
    // The room stands behind the window and is seen through it: to who stands left the far wall is farther left in it than to who stands
    // right. Each picture fits its neighbour best moved by some pixels that way, the middle one's rows at most half as far.
    let fit = |a: &image::GrayImage, b: &image::GrayImage, by: i64| -> f64 {
        let inside = |x: i64| (0..40).contains(&x);
        let pairs = (0..30u32).flat_map(|y| (0..40i64).map(move |x| (x, y))).filter(|(x, _)| inside(x + by));
        let differences = pairs.map(|(x, y)| {
            f64::from(a.get_pixel(x as u32, y).0[0].abs_diff(b.get_pixel((x + by) as u32, y).0[0])).powi(2)
        });
        let (sum, count) = differences.fold((0.0, 0), |(sum, count), d| (sum + d, count + 1));
        sum / f64::from(count)
    };
    let best = |a, b| (-12..=12).min_by(|p, q| fit(a, b, *p).total_cmp(&fit(a, b, *q))).expect("some");
    let moved = best(&pictures[0], &pictures[2]);
    assert!(moved > 0, "from the leftmost to the rightmost place the room moves by {moved} pixels to the right");

    let print = ["print", "seq", "--plate", "gray.toml", "-o", "stereogram"];
    refused(f, &print, "--view-spacing");
    refused(f, &[&print[..], &["--view-spacing", "1mm", "--view-rows", "2"]].concat(), "do not divide the 3 pictures");
    refused(f, &["print", "points.ply", "--plate", "gray.toml", "--view-rows", "2", "-o", "x"], "view-rows");
    let spaced = [&print[..], &["--view-spacing", "1mm", "--view-height", "1mm"]].concat();
    assert!(done(f, &spaced)["complete"] == true);
    done(f, &["print", "verify", "stereogram"]);
    assert_eq!(done(f, &spaced)["done"]["computed"], 0, "it is whole");
    refused(f, &[&print[..], &["--view-spacing", "2mm", "--view-height", "1mm"]].concat(), "spacing is 0.001 there");
    done(f, &["print", "sheet", "stereogram", "-o", "sheet.html"]);
    let sheet = fs::read_to_string(f.join("sheet.html")).expect("sheet");
    assert!(sheet.contains("print seq --view-spacing 1mm --view-height 1mm --plate"), "the command that makes it");
}

/// Python with a module, if it is there.
fn python(module: &str) -> Option<&'static str> {
    let found = Command::new("python3").args(["-c", &format!("import numpy, {module}")]).output();
    if found.is_ok_and(|out| out.status.success()) {
        return Some("python3");
    }
    println!("{module} did not run: python3 with numpy and {module} is not installed");
    None
}

fn checked(folder: &Path, module: &str, script: &str) {
    let Some(python) = python(module) else { return };
    let out = Command::new(python).args(["-c", script]).current_dir(folder).output().expect("runs");
    assert!(out.status.success(), "{module}: {}", String::from_utf8_lossy(&out.stderr));
    println!("{module}: {}", String::from_utf8_lossy(&out.stdout).trim());
}

#[test]
fn independent_readers_see_the_same_levels() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    done(f, &print_into("bits", &[]));
    done(f, &["print", "points.ply", "--plate", "gray.toml", "-o", "gray"]);
    for plate in ["bits", "gray"] {
        done(f, &["print", "export", plate, "--as", "zarr", "-o", &format!("{plate}.zarr")]);
        let png =
            ["print", "export", plate, "--as", "png", "--frame", "320x200", "--overlap", "8", "--serpentine", "-o"];
        done(f, &[&png[..], &[&format!("{plate}-png")]].concat());
        done(f, &["print", "export", plate, "--as", "bmp", "--frame", "333x250", "-o", &format!("{plate}-bmp")]);
    }
    let window = ["print", "export", "gray", "--as", "bmp", "--frame", "320x200", "--overlap", "40", "--window", "-o"];
    done(f, &[&window[..], &["window"]].concat());
    done(f, &["print", "export", "bits", "--as", "gds", "-o", "bits.gds"]);
    refused(f, &["print", "export", "gray", "--as", "gds", "-o", "gray.gds"], "8 bits");
    // Whole, and in bands of which the last is as high as what is left.
    done(f, &["print", "export", "bits", "--as", "png", "-o", "bits-whole"]);
    done(f, &["print", "export", "gray", "--as", "bmp", "--band", "250", "-o", "gray-bands"]);
    refused(
        f,
        &["print", "export", "bits", "--as", "bmp", "--frame", "64x64", "--overlap", "40", "-o", "x"],
        "half of a frame",
    );
    // Bytes that are not those that were computed go no further.
    done(f, &["print", "export", "gray", "--as", "zarr", "-o", "whole.zarr"]);
    fs::create_dir(f.join("torn")).expect("folder");
    for name in ["plate.tif", "manifest.json"] {
        fs::copy(f.join("gray").join(name), f.join("torn").join(name)).expect("copy");
    }
    let mut bytes = fs::read(f.join("torn/plate.tif")).expect("plate");
    let middle = bytes.len() / 2;
    bytes[middle..middle + 64].iter_mut().for_each(|byte| *byte ^= 0x55);
    fs::write(f.join("torn/plate.tif"), bytes).expect("torn");
    for format in ["png", "bmp"] {
        refused(
            f,
            &["print", "export", "torn", "--as", format, "-o", &format!("torn-{format}")],
            "not as it was computed",
        );
    }
    refused(f, &["print", "sheet", "torn", "-o", "torn.html"], "as it was computed");
    refused(f, &["print", "preview", "gray", "-o", "seen.jpg"], ".png");
    // The levels, by this test's own reading of the layout: tags 324 and 325.
    let numbers = |name: &str, bits: usize| {
        let bytes = fs::read(f.join(name).join("plate.tif")).expect("plate");
        let long = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight")) as usize;
        let count = long(16);
        let tag = |wanted: u16| {
            let entry =
                (0..count).map(|i| 24 + 20 * i).find(|&at| bytes[at..at + 2] == wanted.to_le_bytes()).expect("tag");
            (long(entry + 4), long(entry + 12))
        };
        let (tiles, list) = tag(324);
        assert_eq!(tiles, 35);
        let mut levels = vec![0u8; 860 * 600];
        for tile in 0..tiles {
            let at = long(list + 8 * tile);
            for pixel in 0..128 * 128 {
                let (column, row) = (tile % 7 * 128 + pixel % 128, tile / 7 * 128 + pixel / 128);
                if column < 860 && row < 600 {
                    levels[row * 860 + column] =
                        if bits == 1 { bytes[at + pixel / 8] >> (7 - pixel % 8) & 1 } else { bytes[at + pixel] };
                }
            }
        }
        fs::write(f.join(format!("{name}.raw")), &levels).expect("levels");
        levels
    };
    let (bits, gray) = (numbers("bits", 1), numbers("gray", 8));
    assert!(bits.contains(&1) && bits.contains(&0) && gray.iter().any(|&l| l > 200));
    // A cross in the middle of the guard border's corner, dark around it.
    assert!(gray[10 * 860 + 10] == 255 && gray[10 * 860 + 5] == 255 && gray[0] == 0 && gray[5 * 860 + 5] == 0);
    if Command::new("tiffinfo").arg("-h").output().is_ok() {
        let info = Command::new("tiffinfo").arg("gray/plate.tif").current_dir(f).output().expect("runs");
        let text = String::from_utf8_lossy(&info.stdout);
        assert!(
            text.contains("Image Width: 860 Image Length: 600") && text.contains("10000, 10000 pixels/cm"),
            "{text}"
        );
        assert!(info.stderr.is_empty(), "{}", String::from_utf8_lossy(&info.stderr));
        // libtiff's own copy, in strips and packed, has the same pixels.
        for plate in ["bits", "gray"] {
            let copy = ["-s", "-c", "lzw", &format!("{plate}/plate.tif"), &format!("{plate}.tif")].map(str::to_owned);
            assert!(Command::new("tiffcp").args(copy).current_dir(f).output().expect("runs").status.success());
            let both = [format!("{plate}/plate.tif"), format!("{plate}.tif")];
            let compared = Command::new("tiffcmp").args(both).current_dir(f).output().expect("runs");
            let said = String::from_utf8_lossy(&compared.stdout).to_string();
            assert!(!said.contains("Scanline") && !said.contains("Data differ"), "{said}");
        }
    } else {
        println!("libtiff did not run: tiffinfo is not installed");
    }
    let levels = "import numpy as np\nraw = {n: np.fromfile(n + '.raw', np.uint8).reshape(600, 860) for n in ('bits', 'gray')}\n";
    checked(
        f,
        "tifffile",
        &format!(
            "{levels}import tifffile\nfor n in raw:\n    with tifffile.TiffFile(n + '/plate.tif') as t:\n        assert t.is_bigtiff\n        \
             page = t.pages[0]\n        assert page.tags['XResolution'].value == (10000, 1)\n        \
             assert (page.asarray().astype(np.uint8) == raw[n]).all(), n\nprint('levels equal')"
        ),
    );
    checked(
        f,
        "PIL",
        &format!(
            "{levels}import json\nfrom PIL import Image\nImage.MAX_IMAGE_PIXELS = None\nfor n in raw:\n    \
             a = np.array(Image.open(n + '/plate.tif')).astype(np.uint8)\n    assert (a == raw[n]).all(), n\n    \
             for kind in ('png', 'bmp'):\n        folder = n + '-' + kind\n        \
             got = np.zeros_like(raw[n]); seen = np.zeros(raw[n].shape, bool)\n        \
             listed = json.load(open(folder + '/frames.json'))\n        w, h = listed['frame']\n        \
             for e in listed['exposures']:\n            im = Image.open(folder + '/' + e['file'])\n            \
             assert im.size == (w, h)\n            \
             a = np.array(im)\n            a = (a > 0).astype(np.uint8) if n == 'bits' else a\n            \
             c, r = e['column'], e['row']\n            x, y = min(860, c + w) - c, min(600, r + h) - r\n            \
             got[r:r + y, c:c + x] = a[:y, :x]; seen[r:r + y, c:c + x] = True\n        \
             assert seen.all() and (got == raw[n]).all(), folder\n        \
             assert abs(im.info['dpi'][0] - 25400) < 1, im.info\n\
             whole = np.array(Image.open('bits-whole/frame-00000-00000.png')).astype(np.uint8)\n\
             assert whole.shape == (600, 860) and ((whole > 0) == raw['bits']).all()\n\
             bands = [np.array(Image.open(f'gray-bands/frame-0000{{k}}-00000.bmp')) for k in range(3)]\n\
             assert [b.shape[0] for b in bands] == [250, 250, 100] and (np.concatenate(bands) == raw['gray']).all()\n\
             order = [e['column'] for e in json.load(open('gray-png/frames.json'))['exposures']]\n\
             assert order[:6] == sorted(order[:3]) + sorted(order[:3])[::-1], order\n\
             total = np.zeros((600 + 200, 860 + 320))\nlisted = json.load(open('window/frames.json'))\n\
             for e in listed['exposures']:\n    a = np.array(Image.open('window/' + e['file'])).astype(float)\n    \
             total[e['row']:e['row'] + 200, e['column']:e['column'] + 320] += a\n\
             assert abs(total[:600, :860] - raw['gray']).max() <= 2, 'windows add up'\nprint('levels equal')"
        ),
    );
    checked(
        f,
        "zarr",
        &format!(
            "{levels}import zarr\nfor n in raw:\n    a = zarr.open_array(n + '.zarr', mode='r')\n    \
             assert a.shape == (600, 860) and a.dtype == (bool if n == 'bits' else np.uint8)\n    \
             assert (a[:].astype(np.uint8) == raw[n]).all(), n\nprint('levels equal')"
        ),
    );
    checked(
        f,
        "gdstk",
        &format!(
            "{levels}import gdstk\nlib = gdstk.read_gds('bits.gds')\nassert abs(lib.precision - 1e-6) < 1e-12\n\
             got = np.zeros((600, 860), np.uint8)\nfor p in lib.cells[0].polygons:\n    \
             (x0, y0), (x1, y1) = np.round(np.array(p.bounding_box()) * lib.unit / 1e-6).astype(int)\n    \
             assert (got[600 - y1:600 - y0, x0:x1] == 0).all()\n    got[600 - y1:600 - y0, x0:x1] = 1\n\
             assert (got == raw['bits']).all()\nprint(len(lib.cells[0].polygons), 'rectangles, levels equal')"
        ),
    );
}

/// Gray values of a PNG, averaged over 5 × 5 pixels: speckle is not what is compared.
fn picture(path: &Path) -> (usize, usize, Vec<f32>) {
    let gray = image::open(path).expect("picture").into_luma8();
    let (width, height) = (gray.width() as usize / 5, gray.height() as usize / 5);
    let mean = |i: usize| {
        let (column, row) = (i % width * 5, i / width * 5);
        let all = (0..25).map(|k| f32::from(gray.get_pixel((column + k % 5) as u32, (row + k / 5) as u32).0[0]));
        all.sum::<f32>() / 25.0 / 255.0
    };
    (width, height, (0..width * height).map(mean).collect())
}

#[test]
fn five_eyes_see_in_the_fringes_what_rays_show_each_of_them() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scene = root.join("scenes/cornell.gltf").display().to_string();
    let text = fs::read_to_string(root.join("calib/plate-small.toml")).expect("plate");
    // The zero order goes upwards, out of these eyes' way; file and plate are turned against each other.
    let text = text.replace("angle = [\"9.1deg\", \"0deg\"]", "angle = [\"0deg\", \"9.1deg\"]");
    let text = text.replace("tile = 256", "tile = 256\nmirror = true\nrotation = 90");
    fs::write(f.join("plate.toml"), text).expect("plate");
    done(f, &["print", &scene, "--plate", "plate.toml", "-o", "plate"]);
    let eyes = ["0mm,0mm", "-2.5mm,0mm", "2.5mm,0mm", "0mm,-2.5mm", "1.5mm,1.2mm"];
    let (mut seen, mut traced) = (Vec::new(), Vec::new());
    for (i, eye) in eyes.into_iter().enumerate() {
        let (at, name) = (format!("{eye},40mm"), format!("eye{i}.png"));
        let preview =
            ["print", "preview", "plate", "--eye", &at, "--focus", "-6mm", "--traced", &scene, "--bare", "-o", &name];
        let report = done(f, &preview);
        assert_eq!(report["focus"], -6e-3);
        seen.push(picture(&f.join(&name)));
        traced.push(picture(&f.join(format!("eye{i}-traced.png"))));
    }
    for (i, (width, height, values)) in seen.iter().enumerate() {
        let likeness: Vec<f64> = traced
            .iter()
            .map(|(_, _, other)| holodrive::reconstruction::metrics::ssim(values, other, *width, *height))
            .collect();
        println!("{}: SSIM {likeness:.2?}", eyes[i]);
        let best = (0..eyes.len()).max_by(|&a, &b| likeness[a].total_cmp(&likeness[b])).expect("eyes");
        assert_eq!(best, i, "eye {} sees what eye {best} should: {likeness:?}", eyes[i]);
    }
}

#[test]
fn a_scene_is_the_same_plate_by_one_thread_and_by_two_in_parts() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let scene = root.join("scenes/cornell.gltf").display().to_string();
    let text = fs::read_to_string(root.join("calib/plate-small.toml")).expect("plate");
    fs::write(f.join("plate.toml"), text.replace("[1024, 768]", "[600, 512]").replace("bits = 8", "bits = 1"))
        .expect("plate");
    let run = |to: &str, threads: &str, shard: &str| {
        let arguments = ["print", &scene, "--plate", "plate.toml", "-o", to, "--shard", shard];
        let command = Command::new(env!("CARGO_BIN_EXE_holodrive"))
            .args(arguments)
            .env("RAYON_NUM_THREADS", threads)
            .current_dir(f)
            .output();
        assert!(command.expect("runs").status.success());
    };
    run("one", "1", "0/1");
    run("two", "2", "1/2");
    run("two", "2", "0/2");
    assert!(contents(&f.join("one")) == contents(&f.join("two")));
}
