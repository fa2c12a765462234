//! Tiles against analytic waves, neighbours that agree, seams, previews of points, folders that were cut off.

use super::geometry::{file_raster, fringe_area, plate_from_file, tile_counts, tile_in_file};
use super::preview::{PreviewSettings, preview};
use super::*;
use crate::error::Error;
use crate::field::{Complex32, Complex64, Fft2};
use crate::points::PointSource;
use crate::progress::Progress;
use crate::random::Random;
use crate::reconstruction::Picture;
use crate::segments::{Object, ObjectWave, Piece, Rect};
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

/// A plate of 640 × 384 pixels that are not square; `more` and `reference` are further lines.
pub(super) fn plate(size: &str, more: &str, reference: &str) -> Plate {
    let text = format!(
        "name = \"t\"\nsize = {size}\npitch_x = \"1um\"\npitch_y = \"1.25um\"\nwavelength = \"633nm\"\n{more}\n\
         [reference]\n{reference}\n[scene]\nviewer = \"20mm\"\ndistance = \"2mm\"\n"
    );
    Plate::parse(&text, Path::new("t.toml")).expect("plate")
}

pub(super) fn point(x: f64, y: f64, z: f64) -> PointSource {
    PointSource { position: DVec3::new(x, y, z), amplitude: 1e-3, phase: 0.7 }
}

pub(super) fn cloud(count: u64) -> Vec<PointSource> {
    let at = |i: u64| {
        let mut random = Random::new(5, i);
        let mut side = |half: f64| (2.0 * random.uniform() - 1.0) * half;
        let (x, y, z) = (side(250e-6), side(180e-6), side(0.4e-3) - 2.4e-3);
        PointSource { phase: random.phase(), ..point(x, y, z) }
    };
    (0..count).map(at).collect()
}

pub(super) fn fringes(plate: &Plate, object: Object) -> PlateFringes {
    PlateFringes { plate: plate.clone(), wave: ObjectWave::new(plate.segments().expect("band"), object) }
}

/// All levels of a plate as its file shows them.
pub(super) fn whole(fringes: &PlateFringes, amplitude: f32) -> Vec<u8> {
    let plate = &fringes.plate;
    let [across, down] = tile_counts(plate);
    let width = file_raster(plate).width as usize;
    let mut out = vec![0; (plate.raster.width * plate.raster.height) as usize];
    for index in 0..across * down {
        let levels = fringes.tile(index, amplitude, &Progress::new()).expect("tile").0;
        let rect = tile_in_file(plate, index);
        for (row, line) in (rect.y[0]..rect.y[1]).zip(levels.chunks_exact(plate.file.tile as usize)) {
            let at = row as usize * width + rect.x[0] as usize;
            out[at..at + rect.width()].copy_from_slice(&line[..rect.width()]);
        }
    }
    out
}

#[test]
fn the_field_is_the_spherical_wave_within_the_objects_cone_and_dark_beyond() {
    let plate = plate("[640, 384]", "bits = 8\ntile = 128\nsegment = 96", "angle = [\"9deg\", \"0deg\"]");
    let source = Object::Points(vec![point(200e-6, -150e-6, -2e-3)]);
    let fringes = fringes(&plate, source);
    assert_eq!(fringes.wave.plane.band.divisor, [2, 1], "the carrier takes half of x and nothing of y");
    // An odd rectangle, cut by segments.
    let rect = Rect { x: [1, 640], y: [77, 384] };
    let (field, work) =
        fringes.wave.field(&rect, &fringes.wave.plane.pieces(&rect, &rect), &Progress::new()).expect("field");
    let (mut bright, mut dark, mut brightest) = (0, 0, 0.0f64);
    for (i, u) in field.iter().enumerate() {
        let (column, row) = (rect.x[0] + (i % rect.width()) as i64, rect.y[0] + (i / rect.width()) as i64);
        let grid = &fringes.wave.plane.grid;
        let (dx, dy) = (grid.x(column as usize) - 200e-6, grid.y(row as usize) + 150e-6);
        let r = (dx * dx + dy * dy + 2e-3f64.powi(2)).sqrt();
        let wave = Complex64::from_polar(1e-3 / r, TAU * (r / 633e-9).fract() + 0.7);
        let f = [dx, dy].map(|d| (d / (r * 633e-9)).abs());
        // The taper is flat to 0.7 of the band; its edge is blurred by some Fresnel widths of these 2 mm.
        if f[0] < 0.5 * fringes.wave.plane.band.half[0] && f[1] < 0.5 * fringes.wave.plane.band.half[1] {
            let difference = (Complex64::new(u.re.into(), u.im.into()) - wave).norm() / wave.norm();
            assert!(difference < 3e-2, "column {column}, row {row}: {u} is not {wave}");
            bright += 1;
        } else if f[0] > 1.3 * fringes.wave.plane.band.half[0] {
            brightest = brightest.max(u.norm().into());
            dark += 1;
        }
    }
    assert!(bright > 5000 && dark > 5000, "{bright} {dark}");
    // Its amplitude is 0.5 within the cone.
    assert!(brightest < 0.02, "{brightest} beyond the cone");
    assert!(work.segments == 28 && work.pixels == rect.area() as u64 && work.points <= 28);
}

#[test]
fn any_cut_into_tiles_and_any_turn_of_the_file_shows_the_same_fringes() {
    let source = || Object::Points(cloud(12));
    let reference = "angle = [\"9deg\", \"0deg\"]";
    let first = plate("[320, 192]", "bits = 8\ntile = 64", reference);
    let levels = whole(&fringes(&first, source()), 4.0);
    assert!(levels.iter().any(|&l| l > 150) && levels.iter().any(|&l| l < 100), "no fringes");
    for (more, mirror, turned) in [
        ("tile = 128\nsegment = 100", false, 0),
        ("tile = 64\nmirror = true", true, 0),
        ("tile = 64\nrotation = 90", false, 90),
        ("tile = 64\nmirror = true\nrotation = 270\npolarity = \"negative\"", true, 270),
    ] {
        let other = plate("[320, 192]", &format!("bits = 8\n{more}"), reference);
        assert_eq!((other.file.mirror, other.file.rotation), (mirror, turned));
        let file = whole(&fringes(&other, source()), 4.0);
        let width = file_raster(&other).width as usize;
        let mut worst = 0;
        for (i, &level) in file.iter().enumerate() {
            let [x, y] = plate_from_file(&other, [(i % width) as i64, (i / width) as i64]);
            let level = if other.fringe.polarity == Polarity::Negative { 255 - level } else { level };
            worst = worst.max(level.abs_diff(levels[y as usize * 320 + x as usize]));
        }
        // Other tiles are other tables of the same wave, to the plate's error of half a per cent of some fringes.
        assert!(worst <= 3, "{more}: {worst} levels");
    }
}

#[test]
fn references_that_do_not_fit_are_refused_with_numbers() {
    let band = |more: &str, reference: &str| {
        plate("[640, 384]", &format!("tile = 128\n{more}"), reference).segments().map(|plane| plane.band)
    };
    // Half of the limit of 18.45 deg for the carrier, half for the object.
    let half = band("bits = 8", "angle = [\"9.1deg\", \"0deg\"]").expect("band");
    assert_eq!(half.divisor, [2, 1]);
    // |u|² is twice as wide as the object: a quarter.
    let quarter = band("bits = 8\nquantity = \"intensity\"", "angle = [\"13.7deg\", \"0deg\"]").expect("band");
    assert_eq!(quarter.divisor, [4, 1]);
    assert_eq!(band("bits = 8\nquantity = \"phase\"", "angle = [\"0deg\", \"0deg\"]").expect("band").divisor, [1, 1]);
    let aliased = band("bits = 8", "angle = [\"18deg\", \"0deg\"]").unwrap_err();
    assert!(matches!(aliased, Error::Undersampled { .. }), "{aliased}");
    assert!(aliased.to_string().contains("below 17"), "{aliased}");
    let on_axis = band("bits = 8", "angle = [\"0.5deg\", \"0.5deg\"]").unwrap_err().to_string();
    assert!(on_axis.contains("zero order"), "{on_axis}");
    // A lamp 2 mm behind the plate and 0.2 mm aside shines straight down at the plate's other half.
    let near = band("bits = 8", "point = [\"0.2mm\", \"0mm\", \"-2mm\"]").unwrap_err().to_string();
    assert!(near.contains("zero order"), "{near}");
    let far = band("bits = 8", "point = [\"-160mm\", \"0mm\", \"-1m\"]").expect("band");
    assert_eq!(far.divisor, [2, 1]);
    // The wave of a far lamp is a plane wave.
    let lamp = plate("[640, 384]", "bits = 8\ntile = 128", "point = [\"-158m\", \"0mm\", \"-1000m\"]");
    let angle = 0.158f64.atan();
    let [[low, high], _] = lamp.reference_frequencies();
    assert!((low - angle.sin() / 633e-9).abs() < 2.0 && (high - low).abs() < 2.0, "{low} {high}");
    let mut row = Vec::new();
    lamp.reference.row(&lamp.raster.grid(), lamp.wavelength, 10, 100..130, &mut row);
    let step = |i: usize| (row[i + 1] * row[i].conj()).arg();
    let expected = Complex64::cis(TAU * angle.sin() * 1e-6 / 633e-9).arg() as f32;
    assert!((step(0) - expected).abs() < 2e-3 && (step(28) - expected).abs() < 2e-3, "{} {expected}", step(0));
}

/// Low-frequency energy of the rounding error on the lattice of tiles, over that of its neighbours in the spectrum.
fn lattice(error: &[f32], side: usize, tile: usize) -> f64 {
    let mut spectrum: Vec<Complex32> = error.iter().map(|&e| Complex32::new(e, 0.0)).collect();
    Fft2::new(side, side).forward(&mut spectrum, &Progress::new());
    let step = side / tile;
    // Frequencies of up to eight cycles a tile along one axis: rounding noise is weak there, seams are not.
    let (mut on, mut off) = ((0.0f64, 0), (0.0f64, 0));
    for k in 1..8 * step {
        for across in 0..step {
            for power in [spectrum[across * side + k], spectrum[k * side + across]].map(|u| f64::from(u.norm_sqr())) {
                let sum = if k % step == 0 && across == 0 { &mut on } else { &mut off };
                *sum = (sum.0 + power, sum.1 + 1);
            }
        }
    }
    on.0 / f64::from(on.1) / (off.0 / f64::from(off.1))
}

#[test]
fn tiles_leave_no_lattice_in_the_spectrum() {
    let side = 512;
    let lines = "bits = 1\ntile = 64";
    let plate = plate("[512, 512]", lines, "angle = [\"9deg\", \"0deg\"]");
    let source = Object::Points(cloud(16));
    let fringes = fringes(&plate, source);
    let area = fringe_area(&plate);
    let (field, _) =
        fringes.wave.field(&area, &[Piece { segment: [0, 0], rect: area }], &Progress::new()).expect("field");
    let wishes = fringes.fringe(&field, &area, 6.0);
    let bits = whole(&fringes, 6.0);
    // A fault that the test must see: the first column of each tile is darker by a tenth.
    let seams = |fault: f32| {
        let first = |i: usize| if i.is_multiple_of(64) { fault * wishes[i] } else { 0.0 };
        let error: Vec<f32> = (0..side * side).map(|i| f32::from(bits[i]) - wishes[i] - first(i)).collect();
        lattice(&error, side, 64)
    };
    let (found, faulty) = (seams(0.0), seams(0.1));
    println!("lattice over noise: {found:.2}; {faulty:.2} with a fault of 10 %");
    // Fourteen values of exponentially distributed noise have a mean of 1 ± 0.27.
    assert!(found < 2.0, "{found}");
    assert!(faulty > 5.0, "the test does not see seams: {faulty}");
}

pub(super) fn settings(plate: &Plate) -> Settings {
    Settings { program: "t".into(), plate: plate.clone(), inputs: Vec::new(), options: BTreeMap::new() }
}

pub(super) fn folder_of(plate: &Plate, points: Vec<PointSource>, folder: &Path, amplitude: f32) -> Manifest {
    let fringes = fringes(plate, Object::Points(points));
    let settings = settings(plate);
    let manifest = Manifest { settings, instruction_set: "x".into(), amplitude, white: 0.0, tiles: None };
    let manifest = folder::begin(folder, &manifest).expect("manifest");
    let done = folder::compute(folder, &fringes, &manifest, Shard::default(), &Progress::new()).expect("plate");
    assert!(done.complete);
    manifest
}

/// Brightness-weighted middle of a picture's brightest spot, as x and y on the plane in focus [m].
pub(super) fn spot(picture: &Picture, center: [f64; 2], half: [f64; 2]) -> [f64; 2] {
    let brightest = picture.values.iter().copied().fold(0.0, f32::max);
    let (mut sum, mut x, mut y) = (0.0, 0.0, 0.0);
    for (i, &value) in picture.values.iter().enumerate().filter(|(_, v)| **v > 0.5 * brightest) {
        let (column, row) = ((i % picture.width) as f64 + 0.5, (i / picture.width) as f64 + 0.5);
        sum += f64::from(value);
        x += f64::from(value) * (center[0] + (column / picture.width as f64 * 2.0 - 1.0) * half[0]);
        y += f64::from(value) * (center[1] + (1.0 - row / picture.height as f64 * 2.0) * half[1]);
    }
    [x / sum, y / sum]
}

#[test]
fn previews_show_points_where_they_are_from_every_eye_and_file() {
    let folder = tempfile::tempdir().expect("folder");
    let (x, y, z) = (140e-6, 90e-6, -7e-3);
    for (name, more, reference) in [
        ("plain", "bits = 8", "angle = [\"9deg\", \"0deg\"]"),
        ("bits", "bits = 1\nmirror = true\nrotation = 90", "angle = [\"0deg\", \"-7deg\"]"),
        ("width", "bits = 1\nbinarisation = \"pulse-width\"\npolarity = \"negative\"", "angle = [\"-9deg\", \"0deg\"]"),
        ("film", "bits = 8\nquantity = \"intensity\"\nrotation = 180", "angle = [\"13.7deg\", \"0deg\"]"),
        ("relief", "bits = 8\nquantity = \"phase\"\npolarity = \"negative\"", "angle = [\"9deg\", \"0deg\"]"),
        ("lamp", "bits = 8\nguard = 16\nmarks = 16", "point = [\"-40mm\", \"0mm\", \"-250mm\"]"),
    ] {
        let plate = plate("[768, 512]", &format!("tile = 256\n{more}"), reference);
        let path = folder.path().join(name);
        folder_of(&plate, vec![point(x, y, z)], &path, 0.16);
        for eye in [[0.0, 0.0, 20e-3], [0.3e-3, -0.25e-3, 20e-3], [-0.25e-3, 0.3e-3, 14e-3]] {
            // In focus, and focused on the plate itself: there parallax shifts it.
            for focus in [z, 0.0] {
                let settings = PreviewSettings {
                    eye,
                    pupil: 0.9e-3,
                    focus,
                    size: Some((192, 144)),
                    part: None,
                    wavelength: None,
                    lamp: None,
                    places: 1,
                    memory: 1 << 30,
                };
                let seen = preview(&path, &settings, &Progress::new()).expect("preview");
                let far = (eye[2] - focus) / (eye[2] - z);
                let expected = [eye[0] + (x - eye[0]) * far, eye[1] + (y - eye[1]) * far];
                let found = spot(&seen.picture, seen.center, seen.half.to_array());
                // λ·distance/pupil is 19 µm; out of focus the disc is 230 µm wide and its middle known to some per cents.
                let near = if focus == z { 6e-6 } else { 20e-6 };
                let off = (found[0] - expected[0]).hypot(found[1] - expected[1]);
                assert!(off < near, "{name} from {eye:?} at {focus}: {found:?}, not {expected:?}");
            }
        }
        let wrong = PreviewSettings {
            eye: [0.0, 0.0, 20e-3],
            pupil: 0.9e-3,
            focus: 0.0,
            size: Some((8, 8)),
            part: Some([0, 0, 769, 4]),
            wavelength: None,
            lamp: None,
            places: 1,
            memory: 1 << 30,
        };
        assert!(preview(&path, &wrong, &Progress::new()).unwrap_err().to_string().contains("not on the plate"));
        // In pieces, because the memory does not hold one transform: the same picture.
        let once = PreviewSettings { part: None, size: Some((120, 90)), ..wrong.clone() };
        let whole = preview(&path, &once, &Progress::new()).expect("preview");
        let area = |seen: &preview::Preview| (seen.transform[0] * seen.transform[1]) as u64;
        // The pupil takes most of these transforms; a piece saves a fifth.
        let memory = 16 * area(&whole) * 9 / 10;
        let pieces = preview(&path, &PreviewSettings { memory, ..once.clone() }, &Progress::new()).expect("preview");
        assert!(16 * area(&pieces) < memory, "{:?} of {:?}", pieces.transform, whole.transform);
        let off: f64 =
            whole.picture.values.iter().zip(&pieces.picture.values).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        let all: f64 = whole.picture.values.iter().map(|a| f64::from(*a).powi(2)).sum();
        assert!((off / all).sqrt() < 0.03, "{name}: {}", (off / all).sqrt());
        let small = PreviewSettings { part: None, memory: 1 << 10, ..wrong };
        assert!(matches!(preview(&path, &small, &Progress::new()), Err(Error::Memory { .. })));
    }
}

#[test]
fn torn_tiles_are_found_and_redone_and_other_plates_refused() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path();
    let plate = plate("[320, 192]", "bits = 1\ntile = 64", "angle = [\"9deg\", \"0deg\"]");
    let source = Object::Points(cloud(5));
    let fringes = fringes(&plate, source);
    let settings = settings(&plate);
    let manifest =
        Manifest { settings: settings.clone(), instruction_set: "x".into(), amplitude: 4.0, white: 0.0, tiles: None };
    let manifest = folder::begin(path, &manifest).expect("manifest");
    let compute = |shard| folder::compute(path, &fringes, &manifest, shard, &Progress::new()).expect("tiles");
    let part = compute(Shard { index: 1, count: 3 });
    assert!((part.computed, part.kept, part.finished, part.complete) == (5, 0, 5, false), "{part:?}");
    let unfinished = folder::verify(path, &Progress::new()).unwrap_err().to_string();
    assert!(unfinished.contains("5 of 15"), "{unfinished}");
    // A power cut: half of a tile, and half of a list's last line.
    let partial = path.join(".plate.tif.partial");
    let layout = tiff::Layout::new(&plate);
    let file = fs::OpenOptions::new().write(true).open(&partial).expect("file");
    tiff::write_at(&file, &partial, layout.offset(6) + 100, &[0x55; 200]).expect("torn");
    let list = fs::read_dir(path.join(".tiles")).expect("lists").next().expect("one").expect("list").path();
    let text = fs::read_to_string(&list).expect("list");
    fs::write(&list, &text[..text.len() - 30]).expect("cut");
    let again = compute(Shard { index: 1, count: 3 });
    assert!((again.computed, again.kept, again.torn) == (2, 3, 1), "{again:?}");
    compute(Shard { index: 2, count: 3 });
    let last = compute(Shard { index: 0, count: 3 });
    assert!(last.complete && last.finished == 15);
    let verified = folder::verify(path, &Progress::new()).expect("verified");
    assert_eq!(verified.tiles, 15);
    let bytes = fs::read(path.join("plate.tif")).expect("plate");
    let mut names: Vec<_> = fs::read_dir(path).expect("list").map(|e| e.expect("entry").file_name()).collect();
    names.sort();
    assert_eq!(names, ["manifest.json", "plate.tif"], "only what is wanted is left");
    // One bit of the finished plate.
    let file = fs::OpenOptions::new().write(true).open(path.join("plate.tif")).expect("file");
    let at = layout.offset(9) + 77;
    tiff::write_at(&file, path, at, &[!bytes[at as usize]]).expect("bit");
    assert!(folder::verify(path, &Progress::new()).unwrap_err().to_string().contains("tile 9"));
    let complete = Manifest::of(path).expect("manifest");
    let repaired = folder::compute(path, &fringes, &complete, Shard::default(), &Progress::new()).expect("repaired");
    assert_eq!((repaired.torn, repaired.computed, repaired.complete), (1, 1, true));
    assert_eq!(fs::read(path.join("plate.tif")).expect("plate"), bytes);
    // A bit of what lies between tiles, and between the head and the first.
    for at in [layout.offset(3) - 1, layout.offset(0) - 1, layout.offset(14) + layout.tile_bytes] {
        let file = fs::OpenOptions::new().write(true).open(path.join("plate.tif")).expect("file");
        tiff::write_at(&file, path, at, &[1]).expect("bit");
        let torn = folder::verify(path, &Progress::new()).expect_err("a flipped bit").to_string();
        assert!(torn.contains("again"), "{torn}");
        folder::compute(path, &fringes, &complete, Shard::default(), &Progress::new()).expect("repaired");
        assert_eq!(fs::read(path.join("plate.tif")).expect("plate"), bytes);
    }
    // Another plate in the same folder.
    let other = Settings {
        plate: Plate { fringe: FringeSettings { bias: 0.4, ..plate.fringe }, ..plate.clone() },
        ..settings.clone()
    };
    let refused = folder::look(path, &other).unwrap_err().to_string();
    assert!(refused.contains("plate.bias is 0.5 there, 0.4 here"), "{refused}");
    assert!(folder::look(path, &settings).expect("the same").is_some());
}

#[cfg(unix)]
#[test]
fn a_plate_is_never_written_through_a_link() {
    let folder = tempfile::tempdir().expect("folder");
    let plate = plate("[128, 128]", "bits = 8\ntile = 64", "angle = [\"9deg\", \"0deg\"]");
    let fringes = fringes(&plate, Object::Points(cloud(3)));
    let victim = folder.path().join("victim");
    fs::write(&victim, "precious").expect("victim");
    for name in [".plate.tif.partial", "plate.tif", ".tiles"] {
        let path = folder.path().join(name.trim_start_matches('.'));
        let manifest = Manifest {
            settings: settings(&plate),
            instruction_set: "x".into(),
            amplitude: 4.0,
            white: 0.0,
            tiles: None,
        };
        let manifest = folder::begin(&path, &manifest).expect("manifest");
        std::os::unix::fs::symlink(&victim, path.join(name)).expect("link");
        let refused = folder::compute(&path, &fringes, &manifest, Shard::default(), &Progress::new());
        assert!(refused.expect_err(name).to_string().contains("link"), "{name}");
        assert_eq!(fs::read(&victim).expect("victim"), b"precious");
    }
}

#[test]
fn a_manifest_of_absurd_numbers_is_refused_before_anything_is_made_of_it() {
    let folder = tempfile::tempdir().expect("folder");
    let right = plate("[128, 128]", "bits = 8\ntile = 64", "angle = [\"9deg\", \"0deg\"]");
    let manifest = folder_of(&right, cloud(3), folder.path(), 4.0);
    let path = folder.path().join("manifest.json");
    let text = serde_json::to_string(&manifest).expect("text");
    for (from, to) in [
        ("\"tile\":64", "\"tile\":0"),
        ("\"width\":128", "\"width\":4000000000000"),
        ("\"width\":128", "\"width\":0"),
        ("\"bits\":8", "\"bits\":7"),
        ("\"segment\":64", "\"segment\":0"),
        ("\"rotation\":0", "\"rotation\":45"),
        ("\"guard\":0", "\"guard\":18446744073709551615"),
        ("\"amplitude\":4.0", "\"amplitude\":-1.0"),
    ] {
        let spoilt = text.replace(from, to);
        assert_ne!(spoilt, text, "{from}");
        fs::write(&path, spoilt).expect("manifest");
        let refused = folder::verify(folder.path(), &Progress::new()).expect_err(to).to_string();
        assert!(refused.contains("damaged") && !refused.contains('\n'), "{refused}");
    }
}
