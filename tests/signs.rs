//! Signs, through the whole chain: axes, phase, row order, carrier direction. Intensity is blind to sign, so fields are
//! compared as complex numbers wherever one can be had.

use glam::{DVec2, DVec3};
use holodrive::encode::{EncodeOptions, Encoded, Encoding, OffAxis, Reference};
use holodrive::field::{Complex64, Fft2, Field, Grid, npy, stored};
use holodrive::hologram::{self, HologramSettings};
use holodrive::names::Named;
use holodrive::panel::{Frame, Illumination, Origin, PanelProfile, Setup};
use holodrive::pipeline::{self, Bench};
use holodrive::points::trace::MirrorDepth;
use holodrive::points::{Placement, PointSource, SceneSettings, SceneView};
use holodrive::progress::Progress;
use holodrive::propagation;
use holodrive::reconstruction::{self, Picture, View};
use std::f64::consts::TAU;

const WAVELENGTH: f64 = 632.8e-9;

fn field_of(grid: &Grid, position: DVec3, phase: f64) -> Field {
    let points = [PointSource { position, amplitude: 0.5, phase }];
    let plan = hologram::plan(&points, grid, WAVELENGTH, &HologramSettings::default()).expect("plan");
    hologram::compute(&points, grid, WAVELENGTH, &plan, &Progress::new()).expect("field").field
}

fn frame(field: &Field, profile: &PanelProfile, encoding: Encoding) -> Encoded {
    let setup = Setup::new(profile.clone(), Some(WAVELENGTH)).expect("setup");
    let options = EncodeOptions { encoding: Some(encoding), ..EncodeOptions::default() };
    pipeline::frame(field, &setup, &options, Origin::default(), &Progress::new()).expect("frame")
}

fn brightest(picture: &Picture) -> (usize, usize) {
    let at =
        (0..picture.values.len()).max_by(|&a, &b| picture.values[a].total_cmp(&picture.values[b])).expect("pixels");
    (at % picture.width, at / picture.width)
}

#[test]
fn a_point_behind_diverges_and_a_point_in_front_converges_as_written() {
    let grid = Grid::new(201, 151, 8e-6, 8e-6).expect("grid");
    for z in [-0.05, 0.05] {
        let point = DVec3::new(0.2e-3, -0.1e-3, z);
        let field = field_of(&grid, point, 0.7);
        for (column, row) in [(100, 75), (20, 30), (180, 120), (125, 87)] {
            let r = (DVec3::new(grid.x(column), grid.y(row), 0.0) - point).length();
            let sign = if z < 0.0 { 1.0 } else { -1.0 };
            let expected = Complex64::from_polar(0.5 / r, sign * TAU * (r / WAVELENGTH).fract() + 0.7);
            let u = field.samples[row * grid.width + column];
            let error = (Complex64::new(u.re.into(), u.im.into()) - expected).norm() / expected.norm();
            // All four pixels lie where the taper is flat; the engine's default error is 1e-3.
            assert!(error < 5e-3, "z {z}, pixel {column}, {row}: {error}");
        }
    }
}

#[test]
fn light_travels_towards_the_viewer() {
    // Carried 10 mm on, the wave of a point 50 mm behind is that of a point 60 mm behind, phase and all.
    let grid = Grid::new(401, 301, 8e-6, 8e-6).expect("grid");
    let near = field_of(&grid, DVec3::new(0.3e-3, 0.2e-3, -0.05), 0.0);
    let far = field_of(&grid, DVec3::new(0.3e-3, 0.2e-3, -0.06), 0.0);
    let carried = propagation::propagate(&near, 0.01, &Progress::new()).expect("propagate");
    let mut overlap = Complex64::default();
    let (mut a, mut b) = (0.0, 0.0);
    for row in 100..200 {
        for column in 130..270 {
            let (u, v) = (carried.samples[row * 401 + column], far.samples[row * 401 + column]);
            let (u, v) = (Complex64::new(u.re.into(), u.im.into()), Complex64::new(v.re.into(), v.im.into()));
            overlap += u * v.conj();
            a += u.norm_sqr();
            b += v.norm_sqr();
        }
    }
    let overlap = overlap / (a * b).sqrt();
    assert!(overlap.re > 0.99 && overlap.im.abs() < 0.05, "{overlap}");
}

#[test]
fn up_is_up_and_left_is_left_from_point_to_picture_for_every_encoding_and_both_sides() {
    let folder = tempfile::tempdir().expect("folder");
    let mut profile = PanelProfile::generic().expect("profile");
    (profile.width, profile.height) = (480, 400);
    (profile.signal.width, profile.signal.height) = (480, 400);
    let grid = profile.grid().expect("grid");
    let encodings = [
        Encoding::named("double-phase"),
        Encoding::named("kinoform"),
        Encoding::named("off-axis-bipolar"),
        Encoding::named("off-axis-intensity"),
    ];
    for encoding in encodings {
        let encoding = encoding.expect("encoding");
        for z in [-0.08, 0.08] {
            // Up and to the left; a second, weaker one to the right of it tells mirror images apart.
            let points = [
                PointSource { position: DVec3::new(-0.6e-3, 0.5e-3, z), amplitude: 1.0, phase: 0.0 },
                PointSource { position: DVec3::new(0.2e-3, 0.5e-3, z), amplitude: 0.7, phase: 1.0 },
            ];
            let plan = hologram::plan(&points, &grid, WAVELENGTH, &HologramSettings::default()).expect("plan");
            let field = hologram::compute(&points, &grid, WAVELENGTH, &plan, &Progress::new()).expect("field").field;
            // Through files, as the steps on the command line hand it on.
            let path = folder.path().join("field.npy");
            stored::write_field(&path, &field, &npy::Content::default(), "test").expect("write");
            let (field, _) = stored::read_field(&path, None, None).expect("read");
            let encoded = frame(&field, &profile, encoding.clone());
            let path = folder.path().join("frame.png");
            encoded.frame.write(&path).expect("write");
            let (frame, _) = Frame::read(&path, None, None).expect("read");
            assert_eq!(frame.levels, encoded.frame.levels);
            let light = pipeline::light(&frame, &Bench::default(), &Progress::new()).expect("light");
            let (half, view) = (DVec2::new(1.6e-3, 1.2e-3), View::Plane { z });
            let seen = reconstruction::picture(&light.field, &view, half, (80, 60), &light.settings, &Progress::new())
                .expect("picture");
            // Cells of 40 µm: column (−0.6 + 1.6)/0.04 = 25, row (1.2 − 0.5)/0.04 = 17.5; the weaker one in column 45.
            let (column, row) = brightest(&seen);
            let name = encoding.name();
            assert!(column.abs_diff(25) <= 1 && (16..=18).contains(&row), "{name}, z {z}: {column}, {row}");
            let at =
                |c: usize| (16..=18).map(|r| (c - 1..=c).map(|c| seen.values[r * 80 + c]).sum::<f32>()).sum::<f32>();
            // Mirrored left to right about the first point it would stand at column 5, about the axis at column 35. A
            // kinoform really has a ghost at column 5, weaker by half: the beat of the two points.
            assert!(at(45) > 1.5 * at(5) && at(45) > 3.0 * at(35), "{name}, z {z}: {} {} {}", at(45), at(5), at(35));
        }
    }
}

/// The values of one cell of a two by two division of a picture: 0 top left, 1 top right, 2 and 3 below.
fn quarter(values: &[f32], width: usize, cell: usize) -> Vec<Vec<f32>> {
    let half = width / 2;
    let (left, top) = (cell % 2 * half, cell / 2 * half);
    (0..half).map(|r| values[(top + r) * width + left..(top + r) * width + left + half].to_vec()).collect()
}

/// Correlation coefficient of two pictures of one size.
fn correlation(a: &[Vec<f32>], b: &[Vec<f32>]) -> f64 {
    let flat = |p: &[Vec<f32>]| -> Vec<f64> { p.iter().flatten().map(|v| f64::from(*v)).collect() };
    let (a, b) = (flat(a), flat(b));
    let mean = |p: &[f64]| p.iter().sum::<f64>() / p.len() as f64;
    let (ma, mb) = (mean(&a), mean(&b));
    let dot = |p: &[f64], mp: f64, q: &[f64], mq: f64| p.iter().zip(q).map(|(x, y)| (x - mp) * (y - mq)).sum::<f64>();
    dot(&a, ma, &b, mb) / (dot(&a, ma, &a, ma) * dot(&b, mb, &b, mb)).sqrt()
}

#[test]
fn each_letter_of_the_depth_chart_is_upright_and_sharp_at_its_own_depth_only() {
    // The whole way: glTF, points, hologram, an 8-bit double-phase frame, the simulated panel, reconstruction.
    let scene = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/depth-chart.gltf");
    let profile = PanelProfile::generic().expect("profile");
    let setup = Setup::new(profile, Some(WAVELENGTH)).expect("setup");
    let bench = Bench { zero_order_stop: 0.05f64.to_radians(), ..Bench::default() };
    let mut settings = pipeline::Settings { bench: bench.clone(), ..pipeline::Settings::default() };
    (settings.scene.trace.width, settings.scene.trace.height) = (300, 300);
    let out = pipeline::run(&scene, &setup, &settings, &Progress::new()).expect("run");
    let view = &out.points.view;
    let frame = &out.holograms[0].as_ref().expect("light").encoded.frame;
    let light = pipeline::light(frame, &bench, &Progress::new()).expect("light");
    let target: Vec<f32> = view.picture.iter().map(|rgb| rgb[1]).collect();
    let depths: Vec<f64> = (0..4)
        .map(|cell| {
            let lit = (0..target.len()).filter(|i| target[*i] > 0.5 && i % 300 / 150 + i / 300 / 150 * 2 == cell);
            let mut z: Vec<f64> = lit.filter_map(|i| view.depths[i]).collect();
            z.sort_by(f64::total_cmp);
            z[z.len() / 2]
        })
        .collect();
    assert!(depths.windows(2).all(|d| d[0] - d[1] > 0.008), "four depths, apart: {depths:?}");
    let seen: Vec<Picture> = depths
        .iter()
        .map(|&z| {
            let half = view.placing.view_at(z);
            reconstruction::picture(
                &light.field,
                &View::Plane { z },
                half,
                (300, 300),
                &light.settings,
                &Progress::new(),
            )
            .expect("picture")
        })
        .collect();
    for cell in 0..4 {
        let wanted = quarter(&target, 300, cell);
        let own = quarter(&seen[cell].values, 300, cell);
        let likeness = correlation(&own, &wanted);
        // What is missing to 1 is speckle, and the light of the other letters.
        assert!(likeness > 0.85, "letter {cell}: {likeness}");
        for (other, picture) in seen.iter().enumerate().filter(|(other, _)| *other != cell) {
            let blurred = correlation(&quarter(&picture.values, 300, cell), &wanted);
            println!("letter {cell} at the depth of letter {other}: {blurred:.3}, at its own {likeness:.3}");
            assert!(blurred < 0.9 * likeness, "letter {cell} at the depth of {other}: {blurred}, own {likeness}");
        }
        let mirrored: Vec<Vec<f32>> = own.iter().map(|row| row.iter().rev().copied().collect()).collect();
        let flipped: Vec<Vec<f32>> = own.iter().rev().cloned().collect();
        let turned: Vec<Vec<f32>> = mirrored.iter().rev().cloned().collect();
        for (name, wrong) in [("mirrored", mirrored), ("flipped", flipped), ("turned", turned)] {
            let alike = correlation(&wrong, &wanted);
            // The letters themselves are as much as 0.82 like their images turned over (the G, mirrored).
            assert!(alike < 0.9 * likeness, "letter {cell} {name}: {alike}, upright {likeness}");
        }
        println!("letter {cell} at z = {:.1} mm: correlation {likeness:.3}", depths[cell] * 1e3);
    }
}

/// Means of a picture over blocks of pixels in a square, as one row of blocks per row: speckle averages out.
fn blocks(values: &[f32], width: usize, [left, top]: [usize; 2], size: usize, block: usize) -> Vec<Vec<f32>> {
    let mean = |r: usize, c: usize| {
        let pixels =
            (0..block * block).map(|k| values[(top + r * block + k / block) * width + left + c * block + k % block]);
        pixels.sum::<f32>() / (block * block) as f32
    };
    (0..size / block).map(|r| (0..size / block).map(|c| mean(r, c)).collect()).collect()
}

/// Likeness of what a field shows in a square of the picture, at a depth, to what was traced.
fn likeness(field: &Field, view: &SceneView, z: f64, corner: [usize; 2], size: usize) -> f64 {
    let (width, half) = (view.width, view.placing.view_at(z));
    let seen = reconstruction::picture(
        field,
        &View::Plane { z },
        half,
        (width, view.height),
        &Default::default(),
        &Progress::new(),
    );
    let target: Vec<f32> = view.picture.iter().map(|rgb| rgb[1]).collect();
    let wanted = blocks(&target, width, corner, size, 4);
    correlation(&blocks(&seen.expect("picture").values, width, corner, size, 4), &wanted)
}

/// Shows a scene as a miniature with its points where the eye focuses, and looks at a square of it at the depth of that
/// and at the depth of the path: both likenesses.
fn sharp_and_blurred(scene: &std::path::Path, corner: [usize; 2], size: usize) -> (f64, f64) {
    let profile = PanelProfile::generic().expect("profile");
    let setup = Setup::new(profile, Some(WAVELENGTH)).expect("setup");
    let grid = setup.grid;
    let lit = |mirror_depth| {
        let placement = Placement::Model { z: -0.15, eye: 0.6, scale: None };
        let mut settings = SceneSettings { placement, ..Default::default() };
        (settings.trace.width, settings.trace.height) = (450, 450);
        settings.trace.mirror_depth = mirror_depth;
        let lit = pipeline::scene(scene, &settings, &Progress::new()).expect("scene");
        pipeline::points(&lit, &settings, &setup, &Progress::new()).expect("points")
    };
    let (focus, path) = (lit(MirrorDepth::Focus), lit(MirrorDepth::Path));
    let points = &focus.placed.cloud.points;
    let plan = hologram::plan(points, &grid, WAVELENGTH, &HologramSettings::default()).expect("plan");
    let field = hologram::compute(points, &grid, WAVELENGTH, &plan, &Progress::new()).expect("field").field;
    let depth = |view: &SceneView| {
        let pixels = (0..size * size).map(|k| (corner[1] + k / size) * 450 + corner[0] + k % size);
        let mut z: Vec<f64> = pixels.filter_map(|p| view.depths[p]).collect();
        z.sort_by(f64::total_cmp);
        z[z.len() / 2]
    };
    let (near, far) = (depth(&focus.view), depth(&path.view));
    let (own, other) =
        (likeness(&field, &focus.view, near, corner, size), likeness(&field, &focus.view, far, corner, size));
    println!("likeness {own:.3} at the focus, {:.2} mm; {other:.3} at the path, {:.2} mm", near * 1e3, far * 1e3);
    (own, other)
}

#[test]
fn a_mirror_ball_shows_a_sharp_picture_where_the_eye_focuses_and_a_blurred_one_at_path_length() {
    let scene = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/mirror-ball.gltf");
    let (own, other) = sharp_and_blurred(&scene, [130, 270], 64);
    // What is missing to 1 is blur, and at the focus only what speckle is left in blocks of 4 × 4.
    assert!(own > 0.95 && 1.0 - own < 0.3 * (1.0 - other), "{own} {other}");
}

#[test]
fn a_glass_block_lifts_what_lies_behind_it() {
    let scene = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/glass-block.gltf");
    let (own, other) = sharp_and_blurred(&scene, [145, 145], 160);
    assert!(own > 0.95 && 1.0 - own < 0.3 * (1.0 - other), "{own} {other}");
}

#[test]
fn a_reference_at_a_positive_angle_runs_to_the_right_and_up() {
    let mut profile = PanelProfile::generic().expect("profile");
    (profile.width, profile.height) = (256, 200);
    (profile.signal.width, profile.signal.height) = (256, 200);
    let grid = profile.grid().expect("grid");
    let field = field_of(&grid, DVec3::new(0.0, 0.0, -0.1), 0.0);
    for angles in [[0.02, 0.0], [0.0, 0.02], [-0.02, 0.0]] {
        let reference = Reference::Angle(angles);
        let encoding = Encoding::OffAxisBipolar(OffAxis { reference: Some(reference), ..OffAxis::default() });
        let encoded = frame(&field, &profile, encoding);
        let record = encoded.frame.metadata.encoding.clone().expect("record");
        let carrier = reference.frequency(WAVELENGTH);
        assert_eq!(record.illumination, Illumination::Plane { frequency: carrier });
        let behind = pipeline::light(&encoded.frame, &Bench::default(), &Progress::new()).expect("light").field;
        // The zero order, the brightest peak of the spectrum, stands at +carrier: f_x > 0 is light that runs to +x.
        let mut spectrum = behind.samples.clone();
        Fft2::new(grid.width, grid.height).forward(&mut spectrum, &Progress::new());
        let peak = (0..spectrum.len()).max_by(|&a, &b| spectrum[a].norm_sqr().total_cmp(&spectrum[b].norm_sqr()));
        let peak = peak.expect("samples");
        let found = DVec2::new(grid.frequency_x(peak % grid.width), grid.frequency_y(peak / grid.width));
        let off = found - DVec2::from_array(carrier);
        assert!(off.x.abs() <= 1.0 / grid.extent_x() && off.y.abs() <= 1.0 / grid.extent_y(), "{found} {carrier:?}");
    }
}
