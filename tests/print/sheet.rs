//! Finished plates for people: pictures with words, both eyes, a walk past, a job sheet; read back by this test's own code.

use super::{done, holodrive, refused};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Bytes of base64 text.
fn decoded(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => u32::from(c - b'A'),
        b'a'..=b'z' => u32::from(c - b'a') + 26,
        b'0'..=b'9' => u32::from(c - b'0') + 52,
        b'+' => 62,
        b'/' => 63,
        _ => panic!("{c} is no base64"),
    };
    let digits: Vec<u32> = text.bytes().take_while(|c| *c != b'=').map(value).collect();
    let bytes = |four: &[u32]| {
        let word = four.iter().fold(0, |word, digit| word << 6 | digit) << (6 * (4 - four.len()));
        let [_, a, b, c] = word.to_be_bytes();
        [a, b, c].into_iter().take(four.len() * 6 / 8).collect::<Vec<u8>>()
    };
    digits.chunks(4).flat_map(bytes).collect()
}

/// Names of a PNG's chunks with their contents.
fn chunks(bytes: &[u8]) -> Vec<(String, &[u8])> {
    assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
    let (mut at, mut found) = (8, Vec::new());
    while at < bytes.len() {
        let length = u32::from_be_bytes(bytes[at..at + 4].try_into().expect("four")) as usize;
        found.push((String::from_utf8_lossy(&bytes[at + 4..at + 8]).into_owned(), &bytes[at + 8..at + 8 + length]));
        at += 12 + length;
    }
    found
}

/// Elements that are opened and not closed, or closed and not open.
fn unbalanced(page: &str) -> Vec<String> {
    let (mut open, mut faults) = (Vec::<String>::new(), Vec::new());
    for tag in page.split('<').skip(1).filter_map(|rest| rest.split_once('>')).map(|(tag, _)| tag) {
        let name: String = tag.trim_start_matches('/').chars().take_while(|c| c.is_alphanumeric()).collect();
        if tag.starts_with('/') {
            if open.pop().as_deref() != Some(&name) {
                faults.push(name);
            }
        } else if !tag.ends_with('/') && !tag.starts_with('!') && !matches!(&name[..], "meta" | "img") {
            open.push(name);
        }
    }
    faults.extend(open);
    faults
}

const PLATE: &str = "name = \"t <&> 1\"\nsize = [640, 512]\npitch = \"1um\"\nwavelength = \"633nm\"\nbits = 8\ntile = 128\nguard = 16\n\
    marks = 8\nmirror = true\n[reference]\nangle = [\"9.1deg\", \"0deg\"]\n[lamp]\ndiameter = \"2mm\"\ndistance = \"300mm\"\n\
    bandwidth = \"10nm\"\n[printer]\nmachine = \"machine of this test\"\nunverified = [\"pitch\"]\n[scene]\nviewer = \"40mm\"\n\
    distance = \"6mm\"\nresolution = \"0.08deg\"\n";

fn prepare(folder: &Path) -> String {
    fs::write(folder.join("t.toml"), PLATE).expect("plate");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/depth-chart.gltf").display().to_string();
    done(folder, &["print", &scene, "--plate", "t.toml", "--photons", "0", "-o", "plate"]);
    scene
}

#[test]
fn a_job_sheet_is_one_page_with_all_that_a_print_shop_asks() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    let report = done(f, &["print", "sheet", "plate", "--places", "6", "-o", "sheet.html"]);
    refused(f, &["print", "sheet", "plate", "-o", "sheet.pdf"], "ends in .html");
    // Without flags the plate's viewer looks at its scene in the light of its lamp.
    assert_eq!(report["eye"], serde_json::json!([0.0, 0.0, 0.04]));
    assert_eq!((report["focus"].as_f64(), report["lamp"]["diameter"].as_f64()), (Some(-6e-3), Some(2e-3)));
    let page = fs::read_to_string(f.join("sheet.html")).expect("page");
    assert!(page.starts_with("<!DOCTYPE html>") && unbalanced(&page).is_empty(), "{:?}", unbalanced(&page));
    for expected in [
        "<h1>Plate t &lt;&amp;&gt; 1</h1>",
        "0.640 mm × 0.512 mm",
        "640 × 512",
        "1um (25400 × 25400 dpi)",
        "8 bit; 255 is clear",
        "left–right reversed",
        "machine of this test",
        "not measured",
        "633nm",
        "lamp of 2mm at 300mm, 10nm wide in wavelength",
        "from behind, 9.10° towards the viewer's right, 0.00° upwards",
        "40mm before the plate",
        "6mm behind the plate",
        "lamp +9.1°",
        "The lamp shines 9.10° from the left, as the viewer sees it",
        "figures of the printer: pitch",
        "holodrive print verify plate",
        "holodrive print depth-chart.gltf --plate 't &lt;&amp;&gt; 1.toml' --photons 0 -o plate",
    ] {
        assert!(page.contains(expected), "the page does not say `{expected}`");
    }
    // Whole in itself.
    for outside in ["http:", "https:", "<script", "<link", "url(", "@import"] {
        let found = page.matches(outside).count();
        // The arrow's head, which stands in the page.
        assert_eq!(found, if outside == "url(" { page.matches("url(#a)").count() } else { 0 }, "{outside}");
    }
    let picture = page.split_once("base64,").and_then(|(_, rest)| rest.split_once('"')).expect("picture").0;
    let picture = decoded(picture);
    let seen = image::load_from_memory(&picture).expect("PNG").into_rgb8();
    let bright = |rows: std::ops::Range<u32>| {
        let count = rows.len() as u32 * seen.width();
        rows.flat_map(|y| (0..seen.width()).map(move |x| (x, y)))
            .map(|(x, y)| u32::from(seen.get_pixel(x, y).0[1]))
            .sum::<u32>()
            / count
    };
    // Words, then a picture 400 × 320 with something in it.
    assert!(seen.width() == 420 && seen.height() > 340, "{} × {}", seen.width(), seen.height());
    assert!(bright(seen.height() - 330..seen.height() - 10) > 10);
    assert!(
        chunks(&picture)
            .iter()
            .any(|(name, text)| name == "iTXt" && String::from_utf8_lossy(text).contains("simulated"))
    );
    // Hashes by another program.
    for name in ["plate.tif", "manifest.json"] {
        let Ok(out) = Command::new("sha256sum").arg(f.join("plate").join(name)).output() else {
            println!("hashes were not compared: sha256sum is not installed");
            continue;
        };
        let hash = String::from_utf8_lossy(&out.stdout).split_whitespace().next().expect("hash").to_owned();
        assert!(hash.len() == 64 && page.contains(&format!("<code>{hash}</code>")), "{name}: {hash}");
    }
    // The same page again.
    done(f, &["print", "sheet", "plate", "--places", "6", "-o", "again.html"]);
    assert_eq!(page, fs::read_to_string(f.join("again.html")).expect("page"));
    refused(f, &["print", "sheet", "nothing", "-o", "x.html"], "no plate");
    refused(f, &["print", "sheet", "plate", "--lamp", "1", "-o", "x.html"], "diameter and distance");
    refused(f, &["print", "sheet", "plate", "--lamp", "2m,1m", "-o", "x.html"], "farther than wide");
    refused(f, &["print", "sheet", "plate", "--eye", "0mm,0mm,-1mm", "-o", "x.html"], "in front of the plate");
    refused(f, &["print", "sheet", "plate", "--white", "2", "-o", "x.html"], "white");
}

#[test]
fn pictures_have_words_above_and_two_eyes_and_a_walk_see_different_things() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    let scene = prepare(f);
    let flags = ["--lamp", "laser", "--size", "150x120", "-o", "seen.png"];
    let all = ["print", "preview", "plate", "--pair", "3mm", "--walk", "4mm", "--traced", &scene];
    let report = done(f, &[&all[..], &flags].concat());
    for (key, name) in [("pair", "seen-pair.png"), ("walk", "seen-walk.png"), ("traced", "seen-traced.png")] {
        assert_eq!(report[key], name, "{report}");
    }
    assert!(report.get("lamp").is_none(), "a laser is no lamp: {report}");
    done(
        f,
        &[&["print", "preview", "plate", "--bare"][..], &["--lamp", "laser", "--size", "150x120", "-o", "bare.png"]]
            .concat(),
    );
    let read = |name: &str| image::open(f.join(name)).expect(name).into_rgb8();
    let (seen, bare, traced, pair) =
        (read("seen.png"), read("bare.png"), read("seen-traced.png"), read("seen-pair.png"));
    assert_eq!((bare.width(), bare.height()), (150, 120));
    // Twice as large below its words: the same picture.
    assert_eq!((seen.width(), traced.width()), (320, 320));
    let top = seen.height() - 10 - 240;
    assert!(bare.enumerate_pixels().all(|(x, y, pixel)| *seen.get_pixel(10 + 2 * x, top + 2 * y) == *pixel));
    let ink = |picture: &image::RgbImage, rows: u32| {
        (0..rows).any(|y| (0..picture.width()).any(|x| picture.get_pixel(x, y).0[0] > 200))
    };
    assert!(top > 40 && ink(&seen, top) && ink(&traced, traced.height() - 250));
    // Left eye left: what stands behind the plate goes the other way on it, and the views differ.
    assert_eq!(pair.width(), 2 * 300 + 30);
    let from = pair.height() - 250;
    let half = |left: u32| -> Vec<f64> {
        (0..240 * 300).map(|i| f64::from(pair.get_pixel(left + i % 300, from + i / 300).0[1])).collect()
    };
    let (left, right) = (half(10), half(320));
    let differ = left.iter().zip(&right).map(|(a, b)| (a - b).abs()).sum::<f64>() / left.len() as f64;
    assert!(differ > 5.0 && left.iter().sum::<f64>() > 1e5, "{differ}");
    let walk = fs::read(f.join("seen-walk.png")).expect("walk");
    let parts = chunks(&walk);
    let count = |wanted: &str| parts.iter().filter(|(name, _)| name == wanted).count();
    assert_eq!((count("acTL"), count("fcTL"), count("IEND")), (1, 24, 1));
    let frames: Vec<&[u8]> =
        parts.iter().filter(|(name, _)| name == "IDAT" || name == "fdAT").map(|(_, bytes)| *bytes).collect();
    assert!(frames.len() >= 24);
    // An eye beside all of the light is told so.
    let out = holodrive(f, &[&["print", "preview", "plate", "--pair", "63mm"][..], &flags].concat());
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success() && said.contains("no light to eyes at x = -31.5mm, 31.5mm"), "{said}");
    refused(f, &["print", "preview", "plate", "--pair", "0mm", "-o", "x.png"], "0mm");
    let other = scene.replace("depth-chart", "cornell");
    refused(f, &["print", "preview", "plate", "--traced", &other, "-o", "x.png"], "is not the file");
}

#[test]
fn the_room_is_known_again_on_the_small_plate_and_on_the_rainbow() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    for name in ["small", "rainbow"] {
        done(f, &["print", "cornell", "--plate", name, "-o", name]);
        // The plate's own viewer and lamp.
        let picture = format!("{name}.png");
        let report = done(f, &["print", "preview", name, "--traced", "cornell", "--bare", "-o", &picture]);
        assert_eq!(report["lamp"]["diameter"].as_f64(), Some(3e-3), "{report}");
        // By this test's own eyes: gray values of both pictures go up and down together.
        let gray = |name: &str| -> Vec<f64> {
            image::open(f.join(name)).expect(name).into_luma8().pixels().map(|p| f64::from(p.0[0])).collect()
        };
        let (seen, traced) = (gray(&picture), gray(&format!("{name}-traced.png")));
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let (a, b) = (mean(&seen), mean(&traced));
        let product =
            |x: &[f64], p: f64, y: &[f64], q: f64| x.iter().zip(y).map(|(x, y)| (x - p) * (y - q)).sum::<f64>();
        let alike =
            product(&seen, a, &traced, b) / (product(&seen, a, &seen, a) * product(&traced, b, &traced, b)).sqrt();
        let ssim = report["likeness"]["ssim"].as_f64().expect("SSIM");
        println!("{name}: SSIM {ssim:.3}, correlation {alike:.3}");
        // 0.6 is what is asked of a picture that a person recognises; speckle of a laser has 0.08 and 0.24.
        assert!(ssim >= 0.6 && alike > 0.9, "{name}: SSIM {ssim}, correlation {alike}");
    }
}
