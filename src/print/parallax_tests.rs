//! Slits: depth from left to right, darkness above and below, colours in their places.

use super::preview::{PreviewSettings, preview};
use super::tests::{folder_of, fringes, point, settings, spot, whole};
use super::*;
use crate::progress::Progress;
use crate::segments::Object;
use std::path::Path;

/// A plate of 1.0 × 1.2 mm whose slit stands 30 mm before it, and its lamp above.
fn slit_plate(more: &str) -> Plate {
    let text = format!(
        "name = \"t\"\nsize = [1024, 1152]\npitch = \"1um\"\nwavelength = \"638nm\"\nbits = 8\ntile = 128\n\
         [reference]\nangle = [\"0deg\", \"-10deg\"]\n[slit]\nheight = \"0.3mm\"\nstrip = 48\n{more}\n\
         [scene]\nviewer = \"30mm\"\ndistance = \"3mm\"\n"
    );
    Plate::parse(&text, Path::new("t.toml")).expect("plate")
}

/// Light of a view within 30 µm of x and 60 µm of y on the plane in focus, per area.
fn brightness(seen: &preview::Preview, x: f64, y: f64) -> f64 {
    let picture = &seen.picture;
    let near = |i: usize| {
        let column = ((i % picture.width) as f64 + 0.5) / picture.width as f64 * 2.0 - 1.0;
        let row = 1.0 - ((i / picture.width) as f64 + 0.5) / picture.height as f64 * 2.0;
        let at = [seen.center[0] + column * seen.half.x, seen.center[1] + row * seen.half.y];
        (at[0] - x).abs() < 30e-6 && (at[1] - y).abs() < 60e-6
    };
    let values: Vec<f64> =
        (0..picture.values.len()).filter(|&i| near(i)).map(|i| f64::from(picture.values[i])).collect();
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn through_a_slit_points_stand_at_their_depth_from_left_to_right_and_each_colour_has_its_height() {
    let folder = tempfile::tempdir().expect("folder");
    let plate = slit_plate("");
    // Behind and before the plate.
    for (x, y, z) in [(110e-6, 60e-6, -3e-3), (-60e-6, -150e-6, 1.5e-3)] {
        let path = folder.path().join(format!("{z}"));
        folder_of(&plate, vec![point(x, y, z)], &path, 0.5);
        let look = |eye: [f64; 3], wavelength| {
            let settings = PreviewSettings {
                eye,
                pupil: 0.6e-3,
                focus: z,
                size: Some((200, 200)),
                part: None,
                wavelength,
                lamp: None,
                places: 1,
                memory: 1 << 30,
            };
            preview(&path, &settings, &Progress::new()).expect("preview")
        };
        let here = look([0.0, 0.0, 30e-3], None);
        // The lamp shines on a place 30 mm · tan 10° lower.
        assert!(!here.dazzled && look([0.0, -5.3e-3, 30e-3], None).dazzled);
        // The strip stands on the plate: on the plane in focus it moves with the eye's height.
        let bright = |seen: &preview::Preview, eye: f64| brightness(seen, x, y + eye * z / 30e-3);
        for eye in [0.0, 1.5e-3, -2e-3] {
            let seen = look([eye, 0.0, 30e-3], None);
            let [found, height] = spot(&seen.picture, seen.center, seen.half.to_array());
            // In focus at its own depth, from wherever along the slit; its height is known to a strip.
            assert!((found - x).abs() < 8e-6, "from {eye}: x {found}, not {x}");
            assert!((height - y).abs() < 40e-6, "from {eye}: y {height}, not {y}");
        }
        // Strip's diffraction λD/h is 0.4 mm, the slit 0.3 mm: nothing 2 mm above or below.
        for aside in [-2e-3, 2e-3] {
            let dark = look([0.0, aside, 30e-3], None);
            assert!(bright(&dark, aside) < 0.02 * bright(&here, 0.0), "{}", bright(&dark, aside) / bright(&here, 0.0));
        }
        // In green the reference, and with it the carrier, needs another angle: sin b = sin r + λ'·f.
        let green = 520e-9;
        let carrier = (0.0 - (-10f64).to_radians().sin()) / 638e-9;
        let sine = (-10f64).to_radians().sin() + green * carrier;
        let lifted = 30e-3 * sine / (1.0 - sine * sine).sqrt();
        assert!(lifted < -0.9e-3, "{lifted}");
        let there = look([0.0, lifted, 30e-3], Some(green));
        let gone = look([0.0, 0.0, 30e-3], Some(green));
        assert!(bright(&there, lifted) > 0.5 * bright(&here, 0.0), "{}", bright(&there, lifted) / bright(&here, 0.0));
        assert!(bright(&gone, 0.0) < 0.1 * bright(&there, lifted), "{}", bright(&gone, 0.0) / bright(&there, lifted));
    }
}

#[test]
fn strips_of_three_colours_keep_to_their_lasers_and_any_cut_gives_the_same_fringes() {
    let folder = tempfile::tempdir().expect("folder");
    let colors = "wavelengths = [\"638nm\", \"520nm\", \"450nm\"]";
    let plate = slit_plate(colors);
    // A red point in a red strip, a green and a blue one in theirs: strips 9, 10 and 11 of 24 from the top.
    let height = |strip: f64| (12.0 - strip - 0.5) * 48e-6;
    let all = [
        vec![point(-120e-6, height(9.0) * 1.1, -3e-3)],
        vec![point(0.0, height(10.0) * 1.1, -3e-3)],
        vec![point(120e-6, height(11.0) * 1.1, -3e-3)],
    ];
    let made = fringes(&plate, Object::ColorPoints(all.clone()));
    let manifest =
        Manifest { settings: settings(&plate), instruction_set: "x".into(), amplitude: 0.5, white: 0.0, tiles: None };
    let manifest = folder::begin(folder.path(), &manifest).expect("manifest");
    folder::compute(folder.path(), &made, &manifest, Shard::default(), &Progress::new()).expect("plate");
    for (wavelength, x) in [(638e-9, -120e-6), (520e-9, 0.0), (450e-9, 120e-6)] {
        let settings = PreviewSettings {
            eye: [0.0, 0.0, 30e-3],
            pupil: 0.6e-3,
            focus: -3e-3,
            size: Some((200, 200)),
            part: None,
            wavelength: Some(wavelength),
            lamp: None,
            places: 1,
            memory: 1 << 30,
        };
        let seen = preview(folder.path(), &settings, &Progress::new()).expect("preview");
        let [found, _] = spot(&seen.picture, seen.center, seen.half.to_array());
        assert!((found - x).abs() < 8e-6, "{wavelength}: x {found}, not {x}");
        let away = |i: &usize| {
            let at = ((i % 200) as f64 + 0.5) / 100.0 - 1.0;
            (seen.center[0] + at * seen.half.x - x).abs() > 60e-6
        };
        let sum = |it: &mut dyn Iterator<Item = usize>| it.map(|i| f64::from(seen.picture.values[i])).sum::<f64>();
        let elsewhere = sum(&mut (0..200 * 200).filter(away)) / sum(&mut (0..200 * 200));
        assert!(elsewhere < 0.1, "{wavelength}: {elsewhere} of the light is other points'");
    }
    let expected = whole(&made, 0.5);
    for tile in [192, 384] {
        let plate = Plate { file: FileLayout { tile, ..plate.file }, ..plate.clone() };
        assert!(whole(&fringes(&plate, Object::ColorPoints(all.clone())), 0.5) == expected, "tiles of {tile}");
    }
}

#[test]
fn slits_that_do_not_fit_are_refused() {
    let refuse = |from: &str, to: &str| {
        let text = "name = \"t\"\nsize = [1024, 1152]\npitch = \"1um\"\nwavelength = \"638nm\"\nbits = 8\ntile = 128\n\
                    [reference]\nangle = [\"0deg\", \"-10deg\"]\n[slit]\nheight = \"0.3mm\"\nstrip = 48\n\
                    [scene]\nviewer = \"30mm\"\ndistance = \"3mm\"\n";
        let text = text.replace(from, to);
        match Plate::parse(&text, Path::new("t.toml")) {
            Ok(plate) => plate.segments().expect_err(to).to_string(),
            Err(error) => error.to_string(),
        }
    };
    for (from, to, expected) in [
        ("strip = 48", "strip = 4", "slit.strip = 4"),
        ("strip = 48", "wavelengths = [\"638nm\", \"520nm\"]", "three"),
        ("strip = 48", "wavelengths = [\"520nm\", \"638nm\", \"450nm\"]", "own wavelength first"),
        ("strip = 48", "wavelengths = [\"638nm\", \"637.9nm\", \"637.8nm\"]", "cannot make white"),
        ("height = \"0.3mm\"", "height = \"0mm\"", "slit.height"),
        ("height = \"0.3mm\"", "height = \"0.3mm\"\ny = \"9mm\"", "to the slit takes"),
        ("-10deg", "-1.2deg", "to the slit takes"),
    ] {
        let said = refuse(from, to);
        assert!(said.contains(expected) && !said.contains('\n'), "{to}: {said}");
    }
}
