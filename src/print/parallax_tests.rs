//! Slits: depth from left to right, darkness above and below, colours in their places. True views on a panel.

use super::fringe::HALO;
use super::preview::{PreviewSettings, preview};
use super::tests::{folder_of, maker, point, spot, whole};
use super::*;
use crate::field::{Field, Grid};
use crate::hologram::InstructionSet;
use crate::progress::Progress;
use std::collections::BTreeMap;
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
                size: (200, 200),
                part: None,
                wavelength,
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
    let source = Source::ColorCloud(all);
    let made = maker(&plate, &source);
    let settings = Settings::new(&plate, Vec::new(), BTreeMap::new());
    let manifest = Manifest { settings, instruction_set: "x".into(), amplitude: 0.5, white: 0.0, tiles: None };
    let manifest = job::begin(folder.path(), &manifest).expect("manifest");
    job::compute(folder.path(), &made, &manifest, Shard::default(), &Progress::new()).expect("plate");
    for (wavelength, x) in [(638e-9, -120e-6), (520e-9, 0.0), (450e-9, 120e-6)] {
        let settings = PreviewSettings {
            eye: [0.0, 0.0, 30e-3],
            pupil: 0.6e-3,
            focus: -3e-3,
            size: (200, 200),
            part: None,
            wavelength: Some(wavelength),
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
    let expected = whole(&made, 0.5, HALO);
    for tile in [192, 384] {
        let plate = Plate { tile, ..plate.clone() };
        assert!(whole(&maker(&plate, &source), 0.5, HALO) == expected, "tiles of {tile}");
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
            Ok(plate) => Band::of(&plate).expect_err(to).to_string(),
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

/// Likeness of two pictures' shapes, −1 to 1.
fn correlation(a: &[f32], b: &[f32]) -> f64 {
    let mean = |v: &[f32]| v.iter().map(|x| f64::from(*x)).sum::<f64>() / v.len() as f64;
    let (ma, mb) = (mean(a), mean(b));
    let product = |a: &[f32], ma: f64, b: &[f32], mb: f64| -> f64 {
        a.iter().zip(b).map(|(x, y)| (f64::from(*x) - ma) * (f64::from(*y) - mb)).sum()
    };
    product(a, ma, b, mb) / (product(a, ma, a, ma) * product(b, mb, b, mb)).sqrt()
}

#[test]
fn true_views_on_a_panel_show_the_model_that_points_show_and_do_not_change_with_the_segments() {
    use crate::points::Placement;
    use crate::reconstruction::metrics::blocks;
    use crate::reconstruction::{View, ViewSettings, picture};
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell.gltf");
    let grid = Grid::new(600, 400, 8e-6, 8e-6).expect("grid");
    let progress = Progress::new();
    let of = |segment: u64| PanelViews {
        grid,
        wavelength: 633e-9,
        viewer: 0.1,
        place: -0.06,
        scale: None,
        segment,
        error: 5e-3,
        seed: 1,
    };
    let task = Task::new(scene.clone());
    let seen = |segment| of(segment).field(&task, InstructionSet::detect(), &progress).expect("field");
    let (coarse, fine) = (seen(200), seen(50));
    assert!(coarse.work.segments == 6 && fine.work.segments == 96, "{:?} {:?}", coarse.work, fine.work);
    let settings = crate::points::SceneSettings {
        placement: Placement::Model { eye: 0.1, z: -0.06, scale: None },
        trace: crate::points::trace::TraceSettings { width: 300, height: 200, ..Default::default() },
        ..Default::default()
    };
    let mut profile = crate::panel::PanelProfile::generic().expect("generic");
    (profile.width, profile.height) = (grid.width, grid.height);
    (profile.pitch_x, profile.pitch_y) = (grid.pitch_x, grid.pitch_y);
    let setup = crate::panel::Setup::new(profile, Some(633e-9)).expect("setup");
    let lit = crate::pipeline::points(&scene, &settings, &setup, &progress).expect("points");
    let [exposure] = crate::pipeline::exposures(&setup, &crate::pipeline::Settings::default(), None)[..] else {
        panic!("one laser, one exposure")
    };
    let engine = crate::hologram::HologramSettings::default();
    let plain = crate::pipeline::field(&lit.placed.cloud, &exposure, &setup, &engine, &progress).expect("field");
    let plain = plain.expect("light");
    // On the plane of the scene's middle, as large as the panel shows it; speckle is averaged over blocks.
    let half = glam::DVec2::new(3.6e-3, 2.4e-3);
    let look = |field: &Field| {
        let view = View::Plane { z: -0.06 };
        let seen = picture(field, &view, half, (240, 160), &ViewSettings::default(), &progress).expect("picture");
        blocks(&seen, 8)
    };
    let (a, b, c) = (look(&coarse.field), look(&fine.field), look(&plain.field));
    let mirrored: Vec<f32> = c.values.chunks_exact(c.width).flat_map(|row| row.iter().rev().copied()).collect();
    let flipped: Vec<f32> = c.values.chunks_exact(c.width).rev().flatten().copied().collect();
    for (name, seen) in [("coarse", &a), ("fine", &b)] {
        let like = correlation(&seen.values, &c.values);
        let wrong = correlation(&seen.values, &mirrored).max(correlation(&seen.values, &flipped));
        assert!(like > 0.85 && like > wrong + 0.1, "{name}: {like}, mirrored or flipped {wrong}");
    }
    // The same cells, the same points and phases: speckle itself is alike.
    let grains = correlation(
        &coarse.field.samples.iter().map(|u| u.re).collect::<Vec<_>>(),
        &fine.field.samples.iter().map(|u| u.re).collect::<Vec<_>>(),
    );
    assert!(grains > 0.8, "{grains}");
    let cloud = PanelViews { segment: 10, ..of(50) }.field(&task, InstructionSet::detect(), &progress);
    assert!(cloud.unwrap_err().to_string().contains("give 16 to 400"));
}
