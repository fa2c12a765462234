//! From field to panel and back: `calibrate` finds what is hidden in the simulated panel, sub-frames average speckle, and
//! placement in frequency keeps the picture where it was.

use glam::{DVec2, DVec3};
use holodrive::calibration::zernike;
use holodrive::encode::{EncodeSettings, Encoding, encode};
use holodrive::field::{Complex32, Complex64, Field, npy, stored};
use holodrive::names::Named;
use holodrive::panel::{Curve, Faults, Frame, Origin, PanelProfile, Response, Setup, Simulation, Wavefront, simulate};
use holodrive::pipeline::{self, Settings};
use holodrive::points::{Exposure, Multiplexing, PointCloud, PointSource, SubFrames};
use holodrive::progress::Progress;
use holodrive::random::Random;
use holodrive::reconstruction::metrics::speckle_contrast;
use holodrive::reconstruction::{self, Picture, View};
use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const WAVELENGTH: f64 = 532e-9;

fn holodrive(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_holodrive")).args(arguments).current_dir(folder).output().expect("runs")
}

fn done(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    let out = holodrive(folder, &[arguments, &["--json"]].concat());
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

/// Exit code 2, one line with `word`, and nothing new in the folder.
fn refused(folder: &Path, arguments: &[&str], word: &str) {
    let names = || {
        let mut all: Vec<_> = fs::read_dir(folder).expect("folder").map(|e| e.expect("entry").file_name()).collect();
        all.sort();
        all
    };
    let before = names();
    let out = holodrive(folder, arguments);
    let said = String::from_utf8_lossy(&out.stderr);
    let lines: Vec<&str> = said.lines().filter(|line| !line.starts_with("warning:")).collect();
    assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
    assert!(lines.len() == 1 && lines[0].contains(word), "{arguments:?} should say `{word}`: {said}");
    assert_eq!(names(), before, "{arguments:?} left something");
}

const PROFILE: &str = "name = \"mine\"\nmaker = \"t\"\nkind = \"phase-lcos\"\nwidth = 96\nheight = 64\npitch = \"8um\"\n\
                       bits = 8\nfill_factor = 0.93\nwavelengths = [\"532nm\"]\nunverified = [\"response\"]\n\
                       [[response]]\nkind = \"linear\"\nlevels_for_2pi = 256\n";

/// Normal noise by twelve uniform numbers.
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.uniform()).sum::<f64>() - 6.0
}

/// A curve with a random smooth bend of five per cent of its range at its greatest.
fn hidden(range: f64, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed, 3);
    let waves: Vec<f64> = (1..=3).map(|k| (2.0 * random.uniform() - 1.0) / f64::from(k)).collect();
    let bend = |x: f64| waves.iter().zip(1..).map(|(a, k)| a * (PI * f64::from(k) * x).sin()).sum::<f64>();
    let greatest = (0..256).map(|l| bend(f64::from(l) / 255.0).abs()).fold(0.0, f64::max);
    (0..256).map(|level| f64::from(level) / 255.0).map(|x| range * (x + 0.05 * bend(x) / greatest)).collect()
}

/// Fills the manifest with the powers that a detector in the gratings' first order reads, one per cent of noise on each.
fn measure(folder: &Path, truth: &Curve, stripe: usize, seed: u64) {
    let manifest = folder.join("manifest.csv");
    let text = fs::read_to_string(&manifest).expect("manifest");
    let mut lines = text.lines();
    let mut filled = format!("{}\n", lines.next().expect("head"));
    let mut random = Random::new(seed, 0);
    for line in lines {
        let name = line.split(',').next().expect("name");
        let (frame, _) = Frame::read(&folder.join(name), None, None).expect("frame");
        let response = Some(Response { wavelength: None, curve: truth.clone() });
        let faults = Faults { response, ..Faults::default() };
        let seen = simulate(&frame, &Simulation { faults, ..Simulation::default() }, &Progress::new()).expect("light");
        let width = seen.grid.width;
        let sum: Complex64 = seen
            .samples
            .iter()
            .enumerate()
            .map(|(i, u)| {
                let turn = Complex64::cis(-TAU * (i % width) as f64 / (2 * stripe) as f64);
                Complex64::new(u.re.into(), u.im.into()) * turn
            })
            .sum();
        let power = 3.0 * sum.norm_sqr() / (seen.grid.len() as f64).powi(2);
        filled += &format!("{line}{:.9}\n", power * (1.0 + 0.01 * normal(&mut random)) + 0.001);
    }
    fs::write(&manifest, filled).expect("write");
}

/// Share of the light that a kinoform of a plane wave sends into it on a panel whose true curve is `truth`.
fn efficiency(profile: &PanelProfile, truth: Option<Curve>) -> f64 {
    let grid = profile.grid().expect("grid");
    let phase = |i: usize| (TAU * (5 * (i % grid.width)) as f64 / grid.width as f64 + 0.3) as f32;
    let samples = (0..grid.len()).map(|i| Complex32::from_polar(1.0, phase(i))).collect();
    let field = Field::new(grid, WAVELENGTH, samples).expect("field");
    let settings = EncodeSettings::new(Encoding::named("kinoform").expect("name"));
    let frame = encode(&field, profile, &settings, &Progress::new()).expect("encode").frame;
    let response = truth.map(|curve| Response { wavelength: None, curve });
    let faults = Faults { response, ..Faults::default() };
    let seen = simulate(&frame, &Simulation { faults, ..Simulation::default() }, &Progress::new()).expect("light");
    let overlap: Complex64 = seen
        .samples
        .iter()
        .zip(&field.samples)
        .map(|(a, b)| {
            let term = a * b.conj();
            Complex64::new(term.re.into(), term.im.into())
        })
        .sum();
    overlap.norm_sqr() / (grid.len() as f64).powi(2)
}

#[test]
fn a_hidden_curve_is_found_by_sweep_powers_and_fit() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    fs::write(f.join("panel.toml"), PROFILE).expect("profile");
    let ideal = efficiency(&PanelProfile::find(f.join("panel.toml").to_str().expect("path")).expect("profile"), None);
    for seed in [1, 2, 3] {
        let truth = hidden(2.15 * PI, seed);
        let sweep = ["calibrate", "curve", "--panel", "panel.toml", "--levels", "128", "--stripe", "4", "-o", "sweep"];
        assert_eq!(done(f, &sweep)["frames"], 128);
        measure(&f.join("sweep"), &Curve::Table { phase: truth.clone() }, 4, seed);
        let solve =
            ["calibrate", "curve", "--panel", "panel.toml", "--powers", "sweep/manifest.csv", "-o", "mine.toml"];
        let report = done(f, &solve);
        let mine = PanelProfile::read(&f.join("mine.toml")).expect("written profile");
        assert!(mine.unverified.is_empty() && mine.responses.len() == 1);
        let found = mine.drive_curve(WAVELENGTH).expect("curve").0;
        let squares: Vec<f64> = found.values().iter().zip(&truth).map(|(a, b)| (a - b).powi(2)).collect();
        let rms = (squares.iter().sum::<f64>() / 256.0).sqrt();
        let told = report["uncertainty_rms"].as_f64().expect("uncertainty");
        println!("seed {seed}: {rms:.4} rad RMS, uncertainty told {told:.4}");
        assert!(rms < 0.05, "{rms} rad");
        // The uncertainty that is told is the error that is made, within a factor of four.
        assert!(rms < 4.0 * told && told < 4.0 * rms.max(1e-3), "{rms} {told}");
        let truth = Curve::Table { phase: truth };
        let (before, after) = (
            efficiency(&PanelProfile::read(&f.join("panel.toml")).expect("profile"), Some(truth.clone())),
            efficiency(&mine, Some(truth)),
        );
        println!("efficiency: ideal {ideal:.4}, before {before:.4}, after {after:.4}");
        assert!((after / ideal - 1.0).abs() < 0.01, "{after} of {ideal}");
        assert!(before < after, "{before} {after}: there was nothing to calibrate");
    }
}

#[test]
fn curves_that_differ_over_the_panel_are_found_by_region() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    fs::write(f.join("panel.toml"), PROFILE).expect("profile");
    // Ranges from 2π to 2.25π over three by two regions, each bent in its own way.
    let curves: Vec<Curve> =
        (0..6).map(|k| Curve::Table { phase: hidden((2.0 + 0.05 * f64::from(k)) * PI, 40 + k as u64) }).collect();
    let truth = Curve::Regional { columns: 3, rows: 2, curves: curves.clone() };
    done(
        f,
        &[
            "calibrate",
            "curve",
            "--panel",
            "panel.toml",
            "--levels",
            "64",
            "--stripe",
            "4",
            "--regions",
            "3x2",
            "-o",
            "sweep",
        ],
    );
    measure(&f.join("sweep"), &truth, 4, 5);
    let solve = ["calibrate", "curve", "--panel", "panel.toml", "--powers", "sweep/manifest.csv", "-o", "mine.toml"];
    let report = done(f, &solve);
    assert_eq!(report["regions"], serde_json::json!([3, 2]));
    let mine = PanelProfile::read(&f.join("mine.toml")).expect("written profile");
    let ideal = efficiency(&PanelProfile::read(&f.join("panel.toml")).expect("profile"), None);
    // One curve for all: the same powers without their regions.
    let text = fs::read_to_string(f.join("sweep/manifest.csv")).expect("manifest");
    let pooled: String = text
        .lines()
        .skip(1)
        .filter_map(|line| {
            let words: Vec<&str> = line.split(',').collect();
            (words[2] == "1" && words[3] == "0").then(|| format!("{},{}\n", words[1], words[5]))
        })
        .collect();
    fs::write(f.join("one.csv"), pooled).expect("write");
    done(f, &["calibrate", "curve", "--panel", "panel.toml", "--powers", "one.csv", "-o", "one.toml"]);
    let one = PanelProfile::read(&f.join("one.toml")).expect("profile");
    let (by_region, by_one) = (efficiency(&mine, Some(truth.clone())), efficiency(&one, Some(truth)));
    println!("ideal {ideal:.4}, by region {by_region:.4}, one curve {by_one:.4}");
    assert!((by_region / ideal - 1.0).abs() < 0.01, "{by_region} of {ideal}");
    assert!(by_one < by_region - 0.005, "{by_one} {by_region}: regions did not matter");
}

#[test]
fn two_waves_of_bend_are_found_from_interferograms_and_from_coefficients() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    fs::write(f.join("panel.toml"), PROFILE.replace("0.93", "1.0")).expect("profile");
    let profile = PanelProfile::read(&f.join("panel.toml")).expect("profile");
    let grid = profile.grid().expect("grid");
    let waves = [0.0, 0.1, -0.05, 0.5, 0.12, 0.0, 0.06, -0.1];
    let radians: Vec<f64> = waves.iter().map(|w| w * TAU).collect();
    let error = zernike::wavefront(grid, WAVELENGTH, &radians, 4.6e-4, "error").expect("wavefront");
    let ends = error.phase.iter().fold((f32::MAX, f32::MIN), |(l, h), &p| (l.min(p), h.max(p)));
    assert!(f64::from(ends.1 - ends.0) > 2.0 * TAU, "{ends:?}");
    done(f, &["calibrate", "flatness", "--panel", "panel.toml", "--steps", "5", "-o", "steps"]);
    let mut random = Random::new(8, 0);
    let faults = || Faults { wavefront_error: Some(error.clone()), ..Faults::default() };
    for k in 0..5 {
        let (frame, _) = Frame::read(&f.join(format!("steps/step-{k:02}.png")), None, None).expect("step");
        let seen = simulate(&frame, &Simulation { faults: faults(), ..Simulation::default() }, &Progress::new())
            .expect("light");
        let reads =
            |u: &Complex32| (u + Complex32::new(0.8, 0.0)).norm_sqr() * (1.0 + 0.01 * normal(&mut random) as f32);
        let values: Vec<f32> = seen.samples.iter().map(reads).collect();
        npy::write_intensity(&f.join(format!("i{k}.npy")), 96, 64, &values).expect("write");
    }
    let interferograms = "i0.npy,i1.npy,i2.npy,i3.npy,i4.npy";
    let base = ["calibrate", "flatness", "--panel", "panel.toml"];
    done(f, &[&base[..], &["--interferograms", interferograms, "-o", "flat.npy", "--into", "flat.toml"]].concat());
    let zernike = "--zernike=0,0.1,-0.05,0.5,0.12,0,0.06,-0.1";
    done(f, &[&base[..], &[zernike, "--radius", "460um", "-o", "flat.png", "--into", "known.toml"]].concat());
    let error = |correction: &Wavefront| {
        let miss = |a: f32, b: f32| (f64::from(a + b) + PI).rem_euclid(TAU) - PI;
        let squares: f64 = correction.phase.iter().zip(&error.phase).map(|(a, b)| miss(*a, *b).powi(2)).sum();
        (squares / grid.len() as f64).sqrt()
    };
    let measured = Wavefront::read(&f.join("flat.npy"), None).expect("read");
    assert_eq!(measured.wavelength, Some(WAVELENGTH));
    println!("interferograms: {:.4} rad RMS = λ/{:.0}", error(&measured), TAU / error(&measured));
    assert!(error(&measured) < TAU / 50.0, "{}", error(&measured));
    // 256 grays a turn: half a step at most.
    assert!(error(&Wavefront::read(&f.join("flat.png"), Some(WAVELENGTH)).expect("read")) < TAU / 256.0);

    // The profile carries its correction, and `encode` applies it once.
    let flat = Field::new(grid, WAVELENGTH, vec![Complex32::new(1.0, 0.0); grid.len()]).expect("field");
    stored::write_field(&f.join("flat-field.npy"), &flat, &npy::Content::default(), "test").expect("write");
    for panel in ["flat.toml", "known.toml"] {
        let report =
            done(f, &["encode", "flat-field.npy", "--panel", panel, "--encoding", "kinoform", "-o", "frame.png"]);
        assert!(report["correction"].is_string(), "{report}");
        let (frame, _) = Frame::read(&f.join("frame.png"), None, None).expect("frame");
        assert!(frame.metadata.applied.correction.is_some());
        let seen = simulate(&frame, &Simulation { faults: faults(), ..Simulation::default() }, &Progress::new())
            .expect("light");
        let sum: Complex32 = seen.samples.iter().sum();
        let share = f64::from(sum.norm_sqr()) / (grid.len() as f64).powi(2);
        println!("{panel}: {share:.4} of the light straight on");
        assert!(share > 0.99, "{panel}: {share}");
    }
    let plain = done(
        f,
        &[
            "encode",
            "flat-field.npy",
            "--panel",
            "flat.toml",
            "--encoding",
            "kinoform",
            "--correction",
            "none",
            "-o",
            "plain.png",
        ],
    );
    assert!(plain["correction"].is_null());
    refused(f, &["encode", "flat-field.npy", "--panel", "generic", "--correction", "flat.npy", "-o", "x.png"], "96×64");
}

#[test]
fn cards_are_written_with_what_to_look_for() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    fs::write(f.join("panel.toml"), PROFILE.replace("width = 96", "width = 270").replace("64", "180"))
        .expect("profile");
    let report = done(f, &["calibrate", "check", "--panel", "panel.toml", "--distance", "60mm", "-o", "cards"]);
    for name in ["half-turn", "lenses", "letters"] {
        assert!(report[name].is_string(), "{report}");
        Frame::read(&f.join(format!("cards/{name}.png")), None, None).expect("a frame with its metadata");
    }
    assert!(fs::read_to_string(f.join("cards/manifest.csv")).expect("manifest").contains("darkest"));
}

#[test]
fn bad_calibrations_end_in_one_line() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    fs::write(f.join("panel.toml"), PROFILE).expect("profile");
    let write = |name: &str, text: &str| fs::write(f.join(name), text).expect("write");
    let curve = |powers: &str, word: &str| {
        refused(f, &["calibrate", "curve", "--panel", "panel.toml", "--powers", powers, "-o", "new.toml"], word);
    };
    curve("none.csv", "none.csv");
    let sweep = |power: &dyn Fn(f64) -> f64| -> String {
        (0..128).map(|k| format!("{},{}\n", 2 * k, power(f64::from(k) / 127.0))).collect()
    };
    write("flat.csv", &sweep(&|_| 1.0));
    curve("flat.csv", "no modulation");
    write("beyond.csv", "0,1\n300,1\n");
    curve("beyond.csv", "line 2: level 300");
    write("gap.csv", "level,power\n0,1\n1,\n");
    curve("gap.csv", "line 3: the power is missing");
    write("few.csv", "0,0\n100,1\n200,0\n");
    curve("few.csv", "3 powers");
    let good = sweep(&|x| (3.3 * x).sin().powi(2));
    write("good.csv", &good);
    refused(f, &["calibrate", "curve", "--panel", "panel.toml", "--powers", "good.csv", "-o", "new.txt"], ".toml");
    refused(f, &["calibrate", "curve", "--panel", "ti-dlp4710", "-o", "s"], "modulates amplitude");
    refused(f, &["calibrate", "curve", "--panel", "panel.toml", "--levels", "5", "-o", "s"], "levels");
    refused(f, &["calibrate", "curve", "--panel", "panel.toml", "--stripe", "0", "-o", "s"], "stripe");
    refused(f, &["calibrate", "curve", "--panel", "panel.toml", "--hold=-1", "-o", "s"], "hold");
    refused(
        f,
        &["calibrate", "curve", "--panel", "panel.toml", "--regions", "3x2", "--order", "zero", "-o", "s"],
        "first",
    );
    let flatness = ["calibrate", "flatness", "--panel", "panel.toml", "-o", "new.npy"];
    npy::write_intensity(&f.join("small.npy"), 5, 4, &[1.0; 20]).expect("write");
    refused(f, &[&flatness[..], &["--interferograms", "small.npy,small.npy,small.npy"]].concat(), "5×4");
    npy::write_intensity(&f.join("one.npy"), 96, 64, &[1.0; 96 * 64]).expect("write");
    refused(f, &[&flatness[..], &["--interferograms", "one.npy,one.npy"]].concat(), "three");
    refused(f, &[&flatness[..], &["--interferograms", "one.npy,one.npy,one.npy"]].concat(), "differ");
    refused(f, &[&flatness[..], &["--zernike", "0,1"]].concat(), "--radius");
    refused(f, &[&flatness[..], &["--zernike", "0,1", "--radius", "1mm", "--into", "x.txt"]].concat(), ".toml");
    refused(f, &["calibrate", "flatness", "--steps", "2", "-o", "s"], "three");
    refused(f, &["calibrate", "check", "--panel", "panel.toml", "--distance", "90m", "-o", "s"], "distance");
    refused(f, &["calibrate"], "calibrate");

    // Profiles whose curve or correction cannot be right.
    let turned = PROFILE.replace(
        "kind = \"linear\"\nlevels_for_2pi = 256",
        "kind = \"polynomial\"\nunit = \"rad\"\ncoefficients = [0, 9, -6]",
    );
    write("turned.toml", &turned);
    refused(f, &["calibrate", "check", "--panel", "turned.toml", "-o", "s"], "turns back at level");
    write(
        "lut.toml",
        &PROFILE.replace("kind = \"linear\"\nlevels_for_2pi = 256", "kind = \"meadowlark-lut\"\nfile = \"slm.lut\""),
    );
    write("slm.lut", &(0..100).map(|g| format!("{g} {g}\n")).collect::<String>());
    refused(f, &["calibrate", "check", "--panel", "lut.toml", "-o", "s"], "100 lines");
    let measured = PROFILE.replace("kind = \"linear\"", "kind = \"linear\"\nwavelength = \"532nm\"");
    write("green.toml", &measured);
    refused(f, &["calibrate", "check", "--panel", "green.toml", "--wavelength", "1064nm", "-o", "s"], "1.064um");
    write("corrected.toml", &format!("{PROFILE}[[correction]]\nfile = \"small.npy\"\nwavelength = \"532nm\"\n"));
    refused(f, &["calibrate", "check", "--panel", "corrected.toml", "-o", "s"], "5×4");
}

#[test]
fn speckle_of_sub_frames_falls_with_the_root_of_their_number() {
    let text = PROFILE.replace("width = 96", "width = 160").replace("64", "120").replace("0.93", "1.0");
    let profile = PanelProfile::parse(&text, Path::new("t.toml")).expect("profile");
    let z = -0.03;
    // A square of points closer than the panel resolves at that depth (λz/D = 12 µm), all as bright.
    let points = (0..50 * 50)
        .map(|i| {
            let at = |k: usize| (k as f64 - 24.5) * 8e-6;
            PointSource { position: DVec3::new(at(i % 50), at(i / 50), z), amplitude: 1.0, phase: 0.0 }
        })
        .collect();
    let cloud = PointCloud { points, rgb: None };
    let progress = Progress::new();
    let setup = Setup::new(profile, Some(WAVELENGTH)).expect("setup");
    let seen = |count: usize, multiplexing: Multiplexing| -> f64 {
        let sub_frames = Some(SubFrames { count, multiplexing, seed: 7 });
        let settings = Settings { sub_frames, ..Settings::default() };
        let look = |exposure: Exposure| {
            let computed = pipeline::field(&cloud, &exposure, &setup, &settings.hologram, &progress).expect("field");
            let field = computed.expect("light").field;
            let encoded = pipeline::frame(&field, &setup, &settings.encode, Origin::default(), &progress);
            let light = pipeline::light(&encoded.expect("frame").frame, &settings.bench, &progress).expect("light");
            let (view, half) = (View::Plane { z }, DVec2::splat(0.15e-3));
            let (window, values) =
                reconstruction::intensity(&light.field, &view, half, &light.settings, &progress).expect("picture");
            Picture { width: window.width, height: window.height, values }
        };
        let pictures: Vec<Picture> = pipeline::exposures(&setup, &settings, None).into_iter().map(look).collect();
        speckle_contrast(&Picture::mean(&pictures).expect("pictures").values)
    };
    let one = seen(1, Multiplexing::Phases);
    assert!((0.75..1.15).contains(&one), "one frame of random phases has full speckle: {one}");
    for count in [4, 16] {
        let contrast = seen(count, Multiplexing::Phases);
        println!("{count} sub-frames: contrast {contrast:.3}, one {one:.3}");
        // Some six hundred speckles in the window: the contrast scatters by a few per cent.
        assert!((contrast * (count as f64).sqrt() / one - 1.0).abs() < 0.2, "{count}: {contrast} of {one}");
    }
    let sparse = seen(16, Multiplexing::Sparse);
    println!("16 sparse sub-frames: contrast {sparse:.3}");
    assert!(sparse < 0.6 * one, "{sparse} {one}");
}

#[test]
fn pictures_at_depths_blazes_lenses_and_views() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    fs::write(f.join("panel.toml"), PROFILE.replace("width = 96", "width = 128").replace("64", "96")).expect("profile");
    let gray = |of: fn(u32, u32) -> u8| image::GrayImage::from_fn(64, 48, |x, y| image::Luma([of(x, y)]));
    gray(|x, y| 60 + (2 * x + y) as u8).save(f.join("rgb.png")).expect("save");
    gray(|x, _| [255, 128, 0][(3 * x / 64) as usize]).save(f.join("depth.png")).expect("save");
    for method in ["weighted", "plane-gradient", "gerchberg-saxton", "double-constraint"] {
        let report = done(
            f,
            &[
                "encode",
                "rgb.png+depth.png",
                "--panel",
                "panel.toml",
                "--encoding",
                method,
                "--depths",
                "-5mm,-6mm,-7mm",
                "--iterations",
                "60",
                "-o",
                "planes.png",
            ],
        );
        let numbers = |key: &str| -> Vec<f64> {
            report[key].as_array().expect(key).iter().map(|v| v.as_f64().expect("number")).collect()
        };
        println!("{method}: {:.1?} dB", numbers("psnr"));
        // Sixty iterations on a small panel; a second constraint costs what the others gain by choosing phases.
        let least = if method == "double-constraint" { 12.0 } else { 25.0 };
        assert!(numbers("psnr").len() == 3 && numbers("psnr").iter().all(|p| *p > least), "{method}: {report}");
        assert_eq!(numbers("depths"), [-0.005, -0.006, -0.007]);
        assert!(numbers("history").windows(2).all(|pair| pair[1] <= pair[0]), "{method}: an iteration made it worse");
        let (frame, _) = Frame::read(&f.join("planes.png"), None, None).expect("frame");
        assert_eq!(frame.metadata.origin.depth, Some([-0.005, -0.007]));
    }
    done(f, &["reconstruct", "planes.png", "--distance", "-6mm", "-o", "seen.png"]);

    // A field, sent aside and through a lens of the pattern's own.
    let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0.0001 0 -0.01\n";
    fs::write(f.join("p.ply"), cloud).expect("write");
    done(f, &["compute", "p.ply", "--panel", "panel.toml", "-o", "field.npy"]);
    let orders = |flags: &[&str]| {
        done(f, &[&["encode", "field.npy", "--panel", "panel.toml", "-o", "frame.png"][..], flags].concat());
        done(f, &["reconstruct", "frame.png", "--distance", "-10mm", "--size", "40x30", "-o", "seen.png"])["orders"]
            .clone()
    };
    let straight = orders(&[]);
    let aside = orders(&["--blaze", "1deg,1deg"]);
    println!("straight {straight}, aside {aside}");
    // Straight, the dead space's light lies in the object's window; aside, only beyond it.
    assert!(aside["zero"].as_f64().expect("share") > 1e-3);
    orders(&["--blaze", "1deg,1deg", "--lens", "300mm"]);
    orders(&["--band-stop", "0.1deg"]);
    orders(&["--encoding", "gradient", "--iterations", "20", "--blaze", "1deg,1deg"]);
    orders(&["--encoding", "error-diffusion", "--lens", "300mm"]);
    // Where the object stands is where it was meant to, whatever the placement: the brightest cell of the picture.
    let brightest = |flags: &[&str]| {
        orders(flags);
        done(
            f,
            &[
                "reconstruct",
                "frame.png",
                "--distance",
                "-10mm",
                "--half",
                "0.3mm",
                "--size",
                "30x30",
                "-o",
                "seen.npy",
            ],
        );
        let seen = npy::read_real(&f.join("seen.npy")).expect("picture").values;
        (0..seen.len()).max_by(|&a, &b| seen[a].total_cmp(&seen[b])).expect("cells")
    };
    let plain = brightest(&[]);
    assert_eq!(plain, 14 * 30 + 20, "0.1 mm to the right of the middle, cells of 20 µm");
    for flags in [&["--blaze", "1deg,-1deg"][..], &["--lens", "200mm"], &["--lens", "200mm", "--blaze", "0.9deg"]] {
        let found = brightest(flags);
        assert!(found.abs_diff(plain) <= 1 || found.abs_diff(plain).abs_diff(30) <= 1, "{flags:?}: {found} {plain}");
    }

    let views = [
        "reconstruct",
        "field.npy",
        "--eye",
        "0mm,0mm,100mm",
        "--focus=-10mm",
        "--pupil",
        "1mm",
        "--size",
        "40x30",
        "--views",
        "3x2",
        "--eye-box",
        "2mm,1mm",
        "-o",
        "eye.png",
    ];
    assert_eq!(done(f, &views)["views"].as_array().expect("views").len(), 6);
    assert!(f.join("eye-0-0.png").is_file() && f.join("eye-2-1.png").is_file());
    let shown = done(
        f,
        &["show", "p.ply", "--panel", "panel.toml", "--encoding", "double-phase", "--subframes", "3", "-o", "out"],
    );
    assert_eq!(shown["subframes"], 3);
    assert!(f.join("out/frame-002.png").is_file() && f.join("out/reconstruction-near.png").is_file());

    for (arguments, word) in [
        (
            &[
                "encode",
                "rgb.png",
                "--panel",
                "panel.toml",
                "--encoding",
                "double-phase",
                "--depths",
                "5mm",
                "-o",
                "x.png",
            ][..],
            "field",
        ),
        (&["encode", "rgb.png", "--panel", "panel.toml", "-o", "x.png"], "--depths"),
        (&["encode", "rgb.png", "--panel", "panel.toml", "--depths", "-5mm,-6mm", "-o", "x.png"], "one"),
        (&["encode", "rgb.png", "--panel", "panel.toml", "--depths", "5", "-o", "x.png"], "unit"),
        (&["encode", "rgb.png", "--panel", "panel.toml", "--depths", "-5mm", "--window", "2", "-o", "x.png"], "window"),
        (&["encode", "field.npy", "--panel", "panel.toml", "--depths", "-5mm", "-o", "x.png"], "depths"),
        (&["encode", "field.npy", "--panel", "panel.toml", "--iterations", "5", "-o", "x.png"], "iterations"),
        (&["encode", "field.npy", "--panel", "panel.toml", "--blaze", "95deg", "-o", "x.png"], "blaze"),
        (&["encode", "field.npy", "--panel", "panel.toml", "--blaze", "5deg", "-o", "x.png"], "limit"),
        (&["encode", "field.npy", "--panel", "panel.toml", "--lens", "0mm", "-o", "x.png"], "lens"),
        (&["encode", "field.npy", "--panel", "panel.toml", "--lens", "1mm", "-o", "x.png"], "limit"),
        (&["encode", "field.npy", "--panel", "panel.toml", "--correction", "none.npy", "-o", "x.png"], "none.npy"),
        (
            &["encode", "field.npy", "--panel", "panel.toml", "--encoding", "lee", "--blaze", "1deg", "-o", "x.png"],
            "reference",
        ),
        (
            &["reconstruct", "field.npy", "--distance", "-5mm", "--views", "3x2", "--eye-box", "2mm", "-o", "x.png"],
            "--eye",
        ),
        (&["show", "field.npy", "--panel", "panel.toml", "--subframes", "3", "-o", "."], "sub-frames"),
        (&["show", "p.ply", "--panel", "panel.toml", "--subframes", "0", "-o", "."], "subframes"),
        (&["bench", "encodings", "--size", "8x8"], "size"),
        (&["bench", "encodings", "--scene", "none.gltf"], "none.gltf"),
    ] {
        refused(f, arguments, word);
    }
}

#[test]
fn frames_for_an_eye_are_made_of_points_and_of_light_fields() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    fs::write(f.join("panel.toml"), PROFILE).expect("write");
    // A lattice of points, dense as the eye sees it, in front of which a few stand alone.
    let mut cloud = String::new();
    for i in 0..60 * 44 {
        let (x, y) = (1.8e-5 * (f64::from(i % 60) - 29.5), 1.8e-5 * (f64::from(i / 60) - 21.5));
        cloud += &format!("{x:.7} {y:.7} {:.3}\n", if i % 60 > 40 { -0.008 } else { -0.012 });
    }
    let header = "ply\nformat ascii 1.0\nelement vertex 2640\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    fs::write(f.join("p.ply"), header.to_owned() + &cloud).expect("write");
    let common = ["--panel", "panel.toml", "--iterations", "12"];
    let eye = ["--eye", "0mm,0mm,80mm", "--pupil", "1mm"];
    let shown = done(f, &[&["show", "p.ply", "-o", "out"][..], &common, &eye].concat());
    assert_eq!(shown["encoding"], "view");
    let psnr = |report: &serde_json::Value| report["seen"]["all"]["psnr"].as_f64().expect("PSNR");
    assert!(
        psnr(&shown) > 15.0 && shown["seen"]["judge"].as_str().is_some_and(|judge| judge.contains("f64")),
        "{shown}"
    );
    for name in ["frame.png", "overview.png", "seen-near.png", "wanted-far.png", "traced.png", "report.json"] {
        assert!(f.join("out").join(name).is_file(), "{name} is missing");
    }
    // Other encodings are judged alike, and lose to it.
    let other = done(
        f,
        &[&["show", "p.ply", "-o", "kino", "--encoding", "kinoform", "--panel", "panel.toml"][..], &eye].concat(),
    );
    assert!(psnr(&other) < psnr(&shown), "{other}");
    // The same by way of a file, as NumPy reads it, and of a folder of pictures; several frames for a box.
    for views in ["v.npz", "views"] {
        done(
            f,
            &[&["views", "p.ply", "-o", views, "--panel", "panel.toml", "--eye-box", "1mm,0.5mm"][..], &eye].concat(),
        );
        let made = done(
            f,
            &[
                &["encode", views, "-o", "box.png", "--eye-box", "1mm,0.5mm", "--pupil", "1mm", "--subframes", "2"][..],
                &common,
            ]
            .concat(),
        );
        assert_eq!(made["view"]["frames"], 2);
        assert!(f.join("box-000.png").is_file() && f.join("box-001.png").is_file());
        let shown = done(f, &[&["show", views, "-o", "again", "--pupil", "1mm"][..], &common].concat());
        assert!(psnr(&shown) > 15.0, "{shown}");
    }
    fs::write(f.join("bad.npz"), b"PK\x03\x04 no light field").expect("write");
    done(f, &["compute", "p.ply", "--panel", "panel.toml", "-o", "field.npy"]);
    for (arguments, word) in [
        (&["show", "field.npy", "--encoding", "view", "-o", "x"][..], "light field"),
        (&["encode", "field.npy", "--encoding", "view", "-o", "x.png"], "views"),
        (&["encode", "v.npz", "--encoding", "kinoform", "-o", "x.png"], "take view"),
        (&["encode", "v.npz", "--blaze", "1deg", "--pupil", "1mm", "-o", "x.png"], "blaze"),
        (&["encode", "v.npz", "--eye-box", "9mm", "--pupil", "1mm", "-o", "x.png"], "--eye-box"),
        (&["encode", "bad.npz", "-o", "x.png"], "bad.npz"),
        (&["show", "p.ply", "--eye", "0mm,0mm,-80mm", "--encoding", "view", "-o", "x"], "eye"),
        (&["show", "p.ply", "--pupil", "all", "--eye-box", "1mm", "--encoding", "view", "-o", "x"], "eye"),
        (&["show", "p.ply", "--pupil", "0mm", "-o", "x"], "pupil"),
        (&["show", "p.ply", "--eye", "50mm,0mm,80mm", "--pupil", "1mm", "--encoding", "view", "-o", "x"], "--eye"),
        (&["encode", "field.npy", "--subframes", "3", "-o", "x.png"], "subframes"),
        (&["bench", "views", "--case", "nobody"], "known eye"),
    ] {
        refused(f, &[arguments, if arguments[0] == "bench" { &[] } else { &["--panel", "panel.toml"] }].concat(), word);
        assert!(!f.join("x.png").exists(), "{arguments:?}");
    }
}

#[test]
fn the_table_and_the_rate_are_made_by_one_command_each() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let only = ["--only", "double-phase", "--only", "weighted"];
    let report =
        done(f, &[&["bench", "encodings", "--size", "96x72", "--iterations", "3", "-o", "t.md"][..], &only].concat());
    let rows = report["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 6, "two encodings on three panels");
    for row in rows {
        for key in ["psnr", "ssim", "efficiency", "speckle", "seconds"] {
            assert!(row[key].as_f64().is_some_and(f64::is_finite), "{key} of {row}");
        }
    }
    assert_eq!(fs::read_to_string(f.join("t.md")).expect("table").lines().filter(|l| l.starts_with("| ")).count(), 3);
    let rate = done(f, &["bench", "iterations", "--size", "64x48", "--planes", "2", "--iterations", "3"]);
    assert!(rate["iterations_per_second"].as_f64().is_some_and(|rate| rate > 0.0), "{rate}");
    assert!(rate["pairs_per_plane"].as_f64().is_some_and(f64::is_finite));
}
