//! Printers that are not ideal: a card is printed and scanned by a simulation that shares nothing with the program, and plates
//! printed with the measured transfer diffract as an ideal printer's do.

use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn holodrive(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_holodrive")).args(arguments).current_dir(folder).output().expect("runs")
}

fn done(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    let out = holodrive(folder, &[arguments, &["--json"]].concat());
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

/// Bad input ends in exit code 2, one line that says `expected`, and no new file.
fn refused(folder: &Path, arguments: &[&str], expected: &str) {
    let names = || {
        let mut names: Vec<_> = fs::read_dir(folder).expect("folder").map(|e| e.expect("entry").file_name()).collect();
        names.sort();
        names
    };
    let before = names();
    let out = holodrive(folder, arguments);
    let said = String::from_utf8_lossy(&out.stderr);
    let lines: Vec<&str> = said.lines().filter(|l| !l.starts_with("warning:")).collect();
    assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
    assert!(lines.len() == 1 && lines[0].contains(expected), "{arguments:?} did not say `{expected}`: {said}");
    assert_eq!(names(), before, "{arguments:?} left something");
}

/// Levels of a plate's file as shares of the highest, by this test's own reading of BigTIFF.
struct Levels {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Levels {
    fn read(path: &Path) -> Self {
        let bytes = fs::read(path).expect("plate");
        let long = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight")) as usize;
        let entry = |wanted: u16| {
            (0..long(16)).map(|i| 24 + 20 * i).find(|&at| bytes[at..at + 2] == wanted.to_le_bytes()).expect("tag")
        };
        let value = |tag: u16| u32::from_le_bytes(bytes[entry(tag) + 12..][..4].try_into().expect("four")) as usize;
        let (width, height, side) = (value(256), value(257), value(322));
        let bits = usize::from(bytes[entry(258) + 12]);
        let (count, list) = (long(entry(324) + 4), long(entry(324) + 12));
        let mut values = vec![0.0; width * height];
        for tile in 0..count {
            let at = if count == 1 { list } else { long(list + 8 * tile) };
            for pixel in 0..side * side {
                let column = tile % width.div_ceil(side) * side + pixel % side;
                let row = tile / width.div_ceil(side) * side + pixel / side;
                if column < width && row < height {
                    values[row * width + column] = match bits {
                        1 => f32::from(bytes[at + pixel / 8] >> (7 - pixel % 8) & 1),
                        _ => f32::from(bytes[at + pixel]) / 255.0,
                    };
                }
            }
        }
        Self { width, height, values }
    }
}

/// Samples of a printed pixel along each side.
const FINE: usize = 3;

/// What a printer leaves on the plate: intensity transmittance, `FINE` samples a pixel.
struct Printed {
    width: usize,
    height: usize,
    transmittance: Vec<f32>,
}

/// A spot of Gaussian shape that writes with a dose on a material of its own response.
struct Printer<'a> {
    /// Standard deviation of the spot [px].
    spot: f64,
    /// What the material makes of an exposure, 1 being that of a wide open area.
    response: &'a dyn Fn(f64) -> f64,
}

impl Printer<'_> {
    fn print(&self, levels: &Levels) -> Printed {
        let (width, height) = (levels.width * FINE, levels.height * FINE);
        let mut exposure: Vec<f32> =
            (0..width * height).map(|i| levels.values[i / width / FINE * levels.width + i % width / FINE]).collect();
        blur(&mut exposure, width, height, self.spot * FINE as f64);
        let transmittance = exposure.iter().map(|&e| (self.response)(f64::from(e)) as f32).collect();
        Printed { width, height, transmittance }
    }
}

/// A Gaussian blur along both axes; what is beyond the edge is as the edge.
fn blur(values: &mut [f32], width: usize, height: usize, sigma: f64) {
    if sigma == 0.0 {
        return;
    }
    let reach = (4.0 * sigma).ceil() as i64;
    let weights: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    let weights: Vec<f32> = weights.iter().map(|w| (w / sum) as f32).collect();
    let mut out = vec![0.0f32; values.len()];
    for row in 0..height {
        let line = &values[row * width..][..width];
        for (column, out) in out[row * width..][..width].iter_mut().enumerate() {
            let at = |i: usize| (column as i64 + i as i64 - reach).clamp(0, width as i64 - 1) as usize;
            *out = weights.iter().enumerate().map(|(i, w)| w * line[at(i)]).sum();
        }
    }
    values.fill(0.0);
    for row in 0..height {
        for (i, w) in weights.iter().enumerate() {
            let from = (row as i64 + i as i64 - reach).clamp(0, height as i64 - 1) as usize;
            let (line, above) = (&out[from * width..][..width], &mut values[row * width..][..width]);
            above.iter_mut().zip(line).for_each(|(sum, value)| *sum += w * value);
        }
    }
}

/// How a card lies on the scanner.
struct Scanner {
    /// Pixels of the scan for one of the plate.
    scale: f64,
    rotation_deg: f64,
    mirrored: bool,
}

impl Scanner {
    /// A scan of 16 bits: blur, an uneven lamp, noise, a bright surround.
    fn scan(&self, printed: &Printed) -> image::ImageBuffer<image::Luma<u16>, Vec<u16>> {
        let (sine, cosine) = self.rotation_deg.to_radians().sin_cos();
        let step = FINE as f64 / self.scale;
        let (w, h) = (printed.width as f64 / step, printed.height as f64 / step);
        let (width, height) = ((1.1 * w + 0.1 * h) as usize, (1.1 * h + 0.1 * w) as usize);
        let inside = step.ceil() as usize;
        let mut light = vec![0.0f32; width * height];
        for (i, light) in light.iter_mut().enumerate() {
            let mut sum = 0.0;
            for sample in 0..inside * inside {
                let offset = |k: usize| (k as f64 + 0.5) / inside as f64;
                let x = (i % width) as f64 + offset(sample % inside) - 0.5 * width as f64;
                let y = (i / width) as f64 + offset(sample / inside) - 0.5 * height as f64;
                let (u, v) = (cosine * x + sine * y, cosine * y - sine * x);
                let u = if self.mirrored { -u } else { u };
                let (u, v) = (u * step + 0.5 * printed.width as f64, v * step + 0.5 * printed.height as f64);
                let on = u >= 0.0 && v >= 0.0 && u < printed.width as f64 && v < printed.height as f64;
                sum += if on { printed.transmittance[v as usize * printed.width + u as usize] } else { 1.0 };
            }
            *light = sum / (inside * inside) as f32;
        }
        blur(&mut light, width, height, 0.8);
        let mut state = 12_345u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / (1u64 << 31) as f64
        };
        image::ImageBuffer::from_fn(width as u32, height as u32, |x, y| {
            // Three per cent less light from one end to the other, and noise of half a per cent (the sum of twelve).
            let lamp = 1.0 - 0.03 * f64::from(x) / width as f64;
            let noise: f64 = (0..12).map(|_| random()).sum::<f64>() - 6.0;
            let light = 0.9 * lamp * f64::from(light[y as usize * width + x as usize]) + 0.005 * noise;
            image::Luma([(light.clamp(0.0, 1.0) * 65_535.0).round() as u16])
        })
    }
}

/// Share of the incident light in an order m of what was printed for a point far behind the plate: |⟨t·exp(−imφ)⟩|², with t
/// the amplitude transmittance and φ the phase of the point's wave beside the reference's.
fn efficiency(printed: &Printed, plate: &Grating, order: f64) -> f64 {
    let (mut re, mut im) = (0.0, 0.0);
    for (i, t) in printed.transmittance.iter().enumerate() {
        let place = |at: usize, count: usize| ((at as f64 + 0.5) - 0.5 * count as f64) * plate.pitch / FINE as f64;
        let (x, y) = (place(i % printed.width, printed.width), -place(i / printed.width, printed.height));
        let way = (x * x + y * y + plate.distance * plate.distance).sqrt() - plate.distance;
        let turns = way / plate.wavelength - plate.sine * x / plate.wavelength;
        let (sine, cosine) = (-TAU * order * turns.fract()).sin_cos();
        let amplitude = f64::from(*t).sqrt();
        (re, im) = (re + amplitude * cosine, im + amplitude * sine);
    }
    let count = printed.transmittance.len() as f64;
    (re / count).powi(2) + (im / count).powi(2)
}

/// A plate whose fringes are a grating: one point two metres behind it.
struct Grating {
    pitch: f64,
    wavelength: f64,
    distance: f64,
    /// Sine of the reference's angle along x.
    sine: f64,
}

const GRATING: Grating = Grating { pitch: 5e-6, wavelength: 632.8e-9, distance: 2.0, sine: 0.015_82 };

fn prepare(folder: &Path) {
    let point = "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\nproperty double z\n\
        end_header\n0 0 -2\n";
    fs::write(folder.join("point.ply"), point).expect("point");
    let angle = GRATING.sine.asin().to_degrees();
    for (name, bits) in [
        ("threshold", "bits = 1\nbinarisation = \"threshold\""),
        ("pulse-width", "bits = 1\nbinarisation = \"pulse-width\""),
        ("diffusion", "bits = 1\nbinarisation = \"diffusion\""),
        ("gray", "bits = 8"),
    ] {
        let text = format!(
            "name = \"{name}\"\nsize = \"3.2mm x 2.56mm\"\npitch = \"5080dpi\"\nwavelength = \"632.8nm\"\n{bits}\ntile = 256\n\
             percentile = 1.0\n[reference]\nangle = [\"{angle}deg\", \"0deg\"]\n[scene]\nviewer = \"2m\"\ndistance = \"2m\"\n\
             object_angle = [\"0.8deg\", \"0.8deg\"]\n"
        );
        fs::write(folder.join(format!("{name}.toml")), text).expect("plate");
    }
}

/// Prints a plate of a profile by the program, then on a printer: the first and the second order's share of the light.
fn diffracted(folder: &Path, profile: &str, printer: &Printer) -> [f64; 2] {
    let output = format!("plate-{profile}-{}", fs::read_dir(folder).expect("folder").count());
    done(folder, &["print", "point.ply", "--plate", &format!("{profile}.toml"), "-o", &output]);
    let levels = Levels::read(&folder.join(&output).join("plate.tif"));
    assert_eq!((levels.width, levels.height), (640, 512));
    let printed = printer.print(&levels);
    [1.0, 2.0].map(|order| efficiency(&printed, &GRATING, order))
}

/// Film between its base and its fog.
fn film(opened: f64) -> f64 {
    0.003 + 0.9 * opened
}

/// Open where the exposure passes 0.726 of an open area's: lines are 1.2 pixels narrower with a spot of one pixel, 15 % of
/// a period of eight; the material is contrasty, not a switch.
fn underexposed(exposure: f64) -> f64 {
    film(1.0 / (1.0 + (0.726 / exposure.max(1e-6)).powi(40)))
}

/// A printer without spot and with a linear material.
const IDEAL: Printer<'static> = Printer { spot: 0.0, response: &film };

#[test]
fn lines_that_come_out_too_narrow_are_drawn_wider() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    let printer = Printer { spot: 1.0, response: &underexposed };
    // What it makes of lines of four pixels in eight.
    let lines: Vec<f32> = (0..800 * 16).map(|i| if i % 800 % 8 < 4 { 1.0 } else { 0.0 }).collect();
    let made = printer.print(&Levels { width: 800, height: 16, values: lines });
    let mean = made.transmittance.iter().map(|t| f64::from(*t)).sum::<f64>() / made.transmittance.len() as f64;
    let made = 8.0 * ((mean - film(0.0)) / (film(1.0) - film(0.0)) - 0.5);
    assert!((made + 1.2).abs() < 0.1, "{made}");
    let card = done(f, &["calibrate", "plate", "--plate", "threshold.toml", "--patch", "0.72mm", "-o", "card"]);
    assert_eq!(card["patch"], 144, "{card}");
    done(f, &["print", "verify", "card"]);
    refused(f, &["calibrate", "plate", "--plate", "threshold.toml", "--patch", "0.72mm", "-o", "card"], "already");
    let printed = printer.print(&Levels::read(&f.join("card/plate.tif")));
    let scanner = Scanner { scale: 0.31, rotation_deg: 0.7, mirrored: false };
    scanner.scan(&printed).save(f.join("scan.tif")).expect("scan");
    // The same card from behind, upside down, finer, of 8 bits.
    let turned = Scanner { scale: 0.47, rotation_deg: 178.0, mirrored: true };
    let turned = turned.scan(&printed);
    image::ImageBuffer::from_fn(turned.width(), turned.height(), |x, y| {
        image::Luma([(turned.get_pixel(x, y).0[0] >> 8) as u8])
    })
    .save(f.join("turned.png"))
    .expect("scan");
    for (scan, mirrored) in [("scan.tif", false), ("turned.png", true)] {
        let found = done(f, &["calibrate", "plate", scan, "--plate", "threshold.toml", "-o", "found.toml"]);
        let bias = [0, 1].map(|axis| found["transfer"]["line_bias"][axis].as_f64().expect("bias") / 5e-6);
        let sure = [0, 1].map(|axis| found["line_uncertainty"][axis].as_f64().expect("uncertainty") / 5e-6);
        println!(
            "{scan}: lines grow by {bias:.3?} ± {sure:.3?} px ({made:.3} made), dot gain {}, turned by {}",
            found["gain"], found["rotation"]
        );
        assert_eq!(found["mirrored"], mirrored);
        assert!(bias.iter().all(|b| (b - made).abs() < 0.05), "{found}");
        assert!(sure.iter().all(|s| *s < 0.03), "{found}");
        assert!((found["gain"].as_f64().expect("gain") - made / 8.0).abs() < 0.01, "{found}");
    }
    for name in ["threshold", "pulse-width"] {
        let profile = format!("{name}.toml");
        let better = format!("{name}-measured.toml");
        done(f, &["calibrate", "plate", "scan.tif", "--plate", &profile, "-o", &better]);
        let [ideal, _] = diffracted(f, name, &IDEAL);
        let [without, _] = diffracted(f, name, &printer);
        let [with, _] = diffracted(f, &format!("{name}-measured"), &printer);
        println!(
            "{name}: first order {ideal:.4} of an ideal printer, {without:.4} ({:+.1} %) of this one, {with:.4} ({:+.1} %) with its \
             transfer",
            100.0 * (without / ideal - 1.0),
            100.0 * (with / ideal - 1.0)
        );
        // A grating of equal lines and gaps: (√T₁ − √T₀)²/π².
        let analytic = (film(1.0).sqrt() - film(0.0).sqrt()).powi(2) / (PI * PI);
        assert!((ideal / analytic - 1.0).abs() < 0.05, "{ideal} is not {analytic}");
        assert!((with / ideal - 1.0).abs() < 0.03, "{name}: {with} of {ideal}");
        assert!(without / ideal < 0.9, "{name}: {without} of {ideal} without the transfer");
    }
    // Single dots are gone: no tone of error diffusion tells what this printer does.
    refused(f, &["calibrate", "plate", "scan.tif", "--plate", "diffusion.toml", "-o", "d.toml"], "binarisation");
    // The transfer is part of what a folder was begun with.
    refused(f, &["print", "point.ply", "--plate", "threshold-measured.toml", "-o", "card"], "other settings");
    done(f, &["print", "point.ply", "--plate", "threshold.toml", "-o", "begun"]);
    refused(f, &["print", "point.ply", "--plate", "threshold-measured.toml", "-o", "begun"], "plate.transfer");
}

/// A spot of less than a pixel, overexposed: dots are a third of a pixel larger.
fn overexposed(exposure: f64) -> f64 {
    film(1.0 / (1.0 + (0.34 / exposure.max(1e-6)).powi(40)))
}

#[test]
fn dots_of_error_diffusion_that_grow_are_set_more_rarely() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    let printer = Printer { spot: 0.4, response: &overexposed };
    done(f, &["calibrate", "plate", "--plate", "diffusion.toml", "--patch", "0.72mm", "-o", "card"]);
    let printed = printer.print(&Levels::read(&f.join("card/plate.tif")));
    let scanner = Scanner { scale: 0.31, rotation_deg: 0.7, mirrored: false };
    scanner.scan(&printed).save(f.join("scan.tif")).expect("scan");
    done(f, &["calibrate", "plate", "scan.tif", "--plate", "diffusion.toml", "-o", "diffusion-measured.toml"]);
    let ideal = diffracted(f, "diffusion", &IDEAL);
    let without = diffracted(f, "diffusion", &printer);
    let with = diffracted(f, "diffusion-measured", &printer);
    println!("diffusion: orders {ideal:.4?} of an ideal printer, {without:.4?} without, {with:.4?} with the transfer");
    // A tone says what even areas come out as; a fringe has edges, too. So it is near, and not within three per cent.
    let off = |orders: [f64; 2]| (orders[0] / ideal[0] - 1.0).abs();
    assert!(off(with) < 0.08 && off(without) > 2.0 * off(with) && without[1] > 5.0 * with[1]);
}

/// A negative material: an S-shaped curve that falls from 0.8 to 0.02.
fn negative(exposure: f64) -> f64 {
    0.02 + 0.78 / (1.0 + (exposure.max(0.0) / 0.35).powi(3))
}

fn positive(exposure: f64) -> f64 {
    0.01 + 0.85 * exposure.max(0.0).powf(2.6)
}

#[test]
fn tones_become_amplitudes_that_are_linear_in_the_fringe() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    done(f, &["calibrate", "plate", "--plate", "gray.toml", "--patch", "0.5mm", "-o", "card"]);
    for (name, response) in [("positive", positive as fn(f64) -> f64), ("negative", negative)] {
        let printer = Printer { spot: 0.15, response: &response };
        let printed = printer.print(&Levels::read(&f.join("card/plate.tif")));
        let scan = format!("{name}.png");
        let scanner = Scanner { scale: 0.41, rotation_deg: -0.7, mirrored: false };
        scanner.scan(&printed).save(f.join(&scan)).expect("scan");
        let found = done(f, &["calibrate", "plate", &scan, "--plate", "gray.toml", "-o", "gray-measured.toml"]);
        // The curve, against the material's own.
        let steps = found["steps"].as_array().expect("steps");
        let brightest = steps.iter().map(|s| s["amplitude"].as_f64().expect("number")).fold(0.0, f64::max);
        let most = response(0.0).max(response(1.0)).sqrt();
        let mut worst: f64 = 0.0;
        for step in steps {
            let wanted = response(step["level"].as_f64().expect("level")).sqrt() / most;
            worst = worst.max((step["amplitude"].as_f64().expect("amplitude") / brightest - wanted).abs());
        }
        // An ideal printer between the same two amplitudes; of sines without pixels it would diffract (a₁ − a₀)²/16.
        let (low, high) = (response(0.0).sqrt(), response(1.0).sqrt());
        let linear = |exposure: f64| (low + (high - low) * exposure).powi(2);
        let [ideal, _] = diffracted(f, "gray", &Printer { spot: 0.0, response: &linear });
        let pixel = ((PI / 8.0).sin() / (PI / 8.0)).powi(2);
        let analytic = (high - low).powi(2) / 16.0 * pixel;
        assert!((ideal / analytic - 1.0).abs() < 0.01, "{ideal} is not {analytic}");
        let without = diffracted(f, "gray", &printer);
        let with = diffracted(f, "gray-measured", &printer);
        println!(
            "{name}: curve within {worst:.4}; first order {ideal:.4} ideal, {:.4} ({:+.1} %) without, {:.4} ({:+.1} %) with the transfer; \
             second {:.5} without, {:.5} with it",
            without[0],
            100.0 * (without[0] / ideal - 1.0),
            with[0],
            100.0 * (with[0] / ideal - 1.0),
            without[1],
            with[1]
        );
        assert!(worst < 0.01, "{name}: the curve is off by {worst}");
        assert!((with[0] / ideal - 1.0).abs() < 0.03, "{name}: {with:?} of {ideal}");
        // What is not linear makes second orders of every fringe: a ghost.
        assert!((without[0] / ideal - 1.0).abs() > 0.03 && without[1] > 10.0 * with[1], "{name}: {without:?} {with:?}");
        fs::remove_file(f.join("gray-measured.toml")).expect("profile");
    }
}

#[test]
fn what_is_no_scan_of_the_card_is_refused_in_a_line() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    let flat = image::ImageBuffer::from_fn(300, 200, |_, _| image::Luma([30_000u16]));
    flat.save(f.join("flat.png")).expect("scan");
    fs::write(f.join("cut.tif"), b"II\x2a\x00\x08\x00").expect("file");
    let calibrate = |scan: &str, expected: &str| {
        refused(f, &["calibrate", "plate", scan, "--plate", "gray.toml", "-o", "out.toml"], expected);
    };
    calibrate("flat.png", "five marks");
    calibrate("cut.tif", "not a picture");
    calibrate("missing.tif", "missing.tif");
    refused(f, &["calibrate", "plate", "flat.png", "--plate", "none", "-o", "out.toml"], "no such plate");
    refused(f, &["calibrate", "plate", "--plate", "gray.toml", "--patch", "20um", "-o", "card"], "patch");
    refused(f, &["calibrate", "plate", "--plate", "gray.toml", "--patch", "1", "-o", "card"], "no unit");
    // A transfer that cannot be.
    let good = fs::read_to_string(f.join("gray.toml")).expect("plate");
    for (transfer, expected) in [
        ("levels = [0.0, 1.0]\namplitude = [0.1]", "one for each"),
        ("levels = [0.1, 1.0]\namplitude = [0.1, 0.9]", "rise from 0 to 1"),
        ("levels = [0.0, 0.5, 1.0]\namplitude = [0.1, 0.9, 0.5]", "rise or fall throughout"),
        ("levels = [0.0, 1.0]\namplitude = [0.5, 0.5]", "same at all levels"),
        ("levels = [0.0, 1.0]\namplitude = [nan, 0.5]", "rise or fall throughout"),
        ("line_bias = \"1um\"", "bits = 1"),
        ("line_bias = \"1\"", "line_bias"),
        ("gamma = 2.2", "gamma"),
    ] {
        fs::write(f.join("wrong.toml"), format!("{good}\n[transfer]\n{transfer}\n")).expect("plate");
        refused(f, &["print", "point.ply", "--plate", "wrong.toml", "--dry-run"], expected);
    }
}
