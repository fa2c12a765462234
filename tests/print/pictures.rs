//! Pictures as plates: each stands at its depth, hides what is behind it, and is the right way round.

use super::{done, holodrive, refused};
use std::fs;
use std::path::Path;
use std::time::Instant;

/// Pixels of the pictures, and of the plate, which shows seven pixels of fringe each.
const SIZE: [u32; 2] = [140, 100];

/// Writes a picture of RGBA pixels.
fn draw(path: &Path, pixel: impl Fn(u32, u32) -> [u8; 4]) {
    image::RgbaImage::from_fn(SIZE[0], SIZE[1], |x, y| image::Rgba(pixel(x, y))).save(path).expect("picture");
}

fn is_in([x, y]: [u32; 2], [[left, right], [top, bottom]]: [[u32; 2]; 2]) -> bool {
    (left..=right).contains(&x) && (top..=bottom).contains(&y)
}

/// What an eye sees that focuses there.
fn seen(folder: &Path, plate: &str, focus: &str) -> image::GrayImage {
    let name = format!("{plate}{focus}.png");
    done(folder, &["print", "preview", plate, "--focus", focus, "--bare", "-o", &name]);
    image::open(folder.join(name)).expect("picture").into_luma8()
}

/// Gray at a place of the pictures.
fn at(picture: &image::GrayImage, [x, y]: [u32; 2]) -> f32 {
    let place = |k: u32, of: u32, size: u32| ((f64::from(k) + 0.5) / f64::from(of) * f64::from(size)) as u32;
    f32::from(picture.get_pixel(place(x, SIZE[0], picture.width()), place(y, SIZE[1], picture.height())).0[0])
}

/// The steepest step from pixel to pixel along a row.
fn sharpness(picture: &image::GrayImage, row: u32, columns: std::ops::Range<u32>) -> f32 {
    let y = row * picture.height() / SIZE[1];
    let [from, to] = [columns.start, columns.end].map(|x| x * picture.width() / SIZE[0]);
    let gray = |x: u32| f32::from(picture.get_pixel(x, y).0[0]);
    (from..to - 1).map(|x| (gray(x + 1) - gray(x)).abs()).fold(0.0, f32::max)
}

/// The same along a column.
fn sharpness_down(picture: &image::GrayImage, column: u32, rows: std::ops::Range<u32>) -> f32 {
    let x = column * picture.width() / SIZE[0];
    let [from, to] = [rows.start, rows.end].map(|y| y * picture.height() / SIZE[1]);
    let gray = |y: u32| f32::from(picture.get_pixel(x, y).0[0]);
    (from..to - 1).map(|y| (gray(y + 1) - gray(y)).abs()).fold(0.0, f32::max)
}

#[test]
fn pictures_behind_each_other_stand_at_their_depths() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    // An L, clear elsewhere, before a square: neither looks the same turned over.
    let [stem, foot, square] = [[[20, 40], [10, 90]], [[20, 80], [70, 90]], [[60, 120], [20, 80]]];
    draw(&f.join("ell.png"), |x, y| if is_in([x, y], stem) || is_in([x, y], foot) { [255; 4] } else { [0; 4] });
    draw(&f.join("square.png"), |x, y| if is_in([x, y], square) { [160, 160, 160, 255] } else { [0, 0, 0, 255] });
    let begin = Instant::now();
    let pictures = "ell.png@-4mm+square.png@-8mm";
    let report = done(f, &["print", pictures, "--plate", "small", "--size", "700x500", "-o", "two"]);
    eprintln!("two pictures: {:.1} s, {}", begin.elapsed().as_secs_f64(), report["done"]["work"]);
    // Points so near a plate were checked a thousand times as slowly as they were summed.
    assert!(report["done"]["work"]["field_seconds"].as_f64().is_some_and(|s| s < 5.0), "{report}");
    let [near, far] = ["-4mm", "-8mm"].map(|focus| seen(f, "two", focus));
    for picture in [&near, &far] {
        for (place, low, high) in [
            ([30, 40], 200.0, 256.0),
            ([60, 82], 180.0, 256.0),
            ([105, 50], 90.0, 210.0),
            ([132, 50], 0.0, 40.0),
            ([50, 30], 0.0, 70.0),
            ([110, 92], 0.0, 60.0),
        ] {
            let gray = at(picture, place);
            assert!((low..high).contains(&gray), "{gray} at {place:?}");
        }
    }
    let stem = [&near, &far].map(|picture| sharpness(picture, 35, 10..30));
    let square = [&near, &far].map(|picture| sharpness(picture, 35, 110..130));
    assert!(stem[0] > 1.5 * stem[1] && square[1] > 1.5 * square[0], "{stem:?} {square:?}");
}

#[test]
fn a_picture_with_a_depth_map_stands_as_deep_as_it_says() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    // Two squares; the right one lacks its upper left corner and is behind.
    let [left, right, corner] = [[[10, 60], [20, 80]], [[80, 130], [20, 80]], [[80, 100], [20, 40]]];
    let is_lit = |at: [u32; 2]| is_in(at, left) || (is_in(at, right) && !is_in(at, corner));
    draw(&f.join("rgb.png"), |x, y| if is_lit([x, y]) { [255; 4] } else { [0, 0, 0, 255] });
    draw(&f.join("depth.png"), |x, _| if x < 70 { [255; 4] } else { [0, 0, 0, 255] });
    let depths = ["--near", "-4mm", "--far", "-12mm"];
    done(
        f,
        &[&["print", "rgb.png+depth.png", "--plate", "small", "--size", "700x500", "-o", "deep"][..], &depths].concat(),
    );
    let [near, far] = ["-4mm", "-12mm"].map(|focus| seen(f, "deep", focus));
    // The lower edges, where nothing else ends.
    let [left, right] = [30, 110].map(|column| [&near, &far].map(|seen| sharpness_down(seen, column, 70..95)));
    assert!(left[0] > 1.5 * left[1] && right[1] > 1.3 * right[0], "{left:?} {right:?}");
    assert!(at(&far, [120, 30]) > 150.0 && at(&far, [86, 26]) < 60.0, "{} {}", at(&far, [120, 30]), at(&far, [86, 26]));
    // A broken or missing depth map, and depths the wrong way round.
    fs::write(f.join("broken.png"), b"\x89PNG\r\n\x1a\n").expect("written");
    for (input, more, word) in [
        ("rgb.png+broken.png", &depths[..], "broken.png"),
        ("rgb.png+none.png", &depths[..], "none.png"),
        ("rgb.png+depth.png", &["--near", "-12mm", "--far", "-4mm"][..], "near"),
    ] {
        refused(f, &[&["print", input, "--plate", "small", "-o", "no"][..], more].concat(), word);
    }
    assert!(holodrive(f, &["print", "verify", "deep"]).status.success());
}
