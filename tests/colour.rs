//! Colour through the whole way: lamps of known colours come back as those colours, in their places.

use glam::DVec3;
use holodrive::encode::{EncodeSettings, Encoding};
use holodrive::hologram::HologramSettings;
use holodrive::names::Named;
use holodrive::panel::PanelProfile;
use holodrive::panel::simulated::Simulation;
use holodrive::pipeline::{self, SceneSettings};
use holodrive::points::budget::Budget;
use holodrive::points::colour::Lasers;
use holodrive::progress::Progress;
use holodrive::reconstruction::{ColorPicture, ExposureLight, Light, Reconstruction, View};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Colours of the lamps, top left, top right, bottom left, bottom right.
const LAMPS: [[f32; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.05, 0.05, 1.0], [0.5, 0.5, 0.5]];

/// Four square lamps of 0.8 m about (±0.5, ±0.5), 3.0 to 3.6 m before a camera that sees ±1 m at 3 m.
fn lamps(folder: &Path) -> PathBuf {
    let (mut bytes, mut nodes, mut meshes, mut materials) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut accessors, mut views) = (Vec::new(), Vec::new());
    for (i, color) in LAMPS.iter().enumerate() {
        let (x, y, z) = ([-0.5, 0.5][i % 2], [0.5, -0.5][i / 2], -3.0 - 0.2 * i as f32);
        // Farther ones are larger, so that they are seen as large.
        let size = -z / 3.0;
        for (u, v) in [(-0.4, -0.4), (0.4, -0.4), (0.4, 0.4), (-0.4, -0.4), (0.4, 0.4), (-0.4, 0.4)] {
            for value in [(x + u) * size, (y + v) * size, z] {
                bytes.extend_from_slice(&f32::to_le_bytes(value));
            }
        }
        views.push(json!({"buffer": 0, "byteOffset": 72 * i, "byteLength": 72}));
        let (low, high) = ([(x - 0.4) * size, (y - 0.4) * size, z], [(x + 0.4) * size, (y + 0.4) * size, z]);
        accessors
            .push(json!({"bufferView": i, "componentType": 5126, "count": 6, "type": "VEC3", "min": low, "max": high}));
        materials.push(json!({"emissiveFactor": color, "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}}));
        meshes.push(json!({"primitives": [{"attributes": {"POSITION": i}, "material": i}]}));
        nodes.push(json!({"mesh": i}));
    }
    nodes.push(json!({"camera": 0}));
    let file = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2, 3, 4]}],
        "nodes": nodes, "meshes": meshes, "materials": materials, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": bytes.len(), "uri": "lamps.bin"}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 2.0 * (1.0f64 / 3.0).atan(), "znear": 0.1}}]
    });
    std::fs::write(folder.join("lamps.bin"), bytes).expect("write");
    let path = folder.join("lamps.gltf");
    std::fs::write(&path, file.to_string()).expect("write");
    path
}

/// A panel of 640 × 640 pixels of 8 µm, in any light.
fn panel() -> PanelProfile {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("calib/generic.toml")).expect("text");
    let text = text.replace("width = 1920", "width = 640").replace("height = 1080", "height = 640");
    PanelProfile::parse(&text, Path::new("test")).expect("profile")
}

/// Mean colour over the middle of each lamp and over the dark cross between them, white as 1.
fn means(picture: &ColorPicture, white: f32) -> [[f32; 3]; 5] {
    let (side, mut sums) = (picture.width, [[0.0; 3]; 5]);
    let mut counts = [0; 5];
    for (i, rgb) in picture.rgb.iter().enumerate() {
        let (c, r) = ((i % side) as f32 + 0.5, (i / side) as f32 + 0.5);
        let (x, y) = (2.0 * c / side as f32 - 1.0, 2.0 * r / side as f32 - 1.0);
        let which = if (x.abs() - 0.5).abs() < 0.3 && (y.abs() - 0.5).abs() < 0.3 {
            usize::from(x > 0.0) + 2 * usize::from(y > 0.0)
        } else if x.abs() < 0.05 || y.abs() < 0.05 {
            4
        } else {
            continue;
        };
        counts[which] += 1;
        sums[which] = [0, 1, 2].map(|k| sums[which][k] + rgb[k]);
    }
    [0, 1, 2, 3, 4].map(|w| sums[w].map(|v| v / counts[w] as f32 / white))
}

#[test]
fn lamps_come_back_in_their_colours_at_their_places() {
    let folder = tempfile::tempdir().expect("folder");
    let (scene, profile, progress) = (lamps(folder.path()), panel(), Progress::new());
    let grid = profile.grid().expect("grid");
    let lasers = Lasers::new([638e-9, 520e-9, 450e-9]).expect("lasers");
    let mut settings = SceneSettings::default();
    (settings.trace.width, settings.trace.height) = (200, 200);
    let lit = pipeline::light(&scene, &settings, &grid, 450e-9, &progress).expect("light");
    let cloud = &lit.placed.cloud;
    let fields =
        pipeline::color_fields(cloud, &lasers, None, &grid, &HologramSettings::default(), &progress).expect("fields");
    assert_eq!(fields.gamut.outside_points, 0);
    let encode = EncodeSettings::new(Encoding::named("double-phase").expect("encoding"));
    let mut behind = Light { lasers: Some(lasers), exposures: Vec::new() };
    for (laser, (computed, wavelength)) in fields.computed.into_iter().zip(lasers.wavelengths()).enumerate() {
        let computed = computed.expect("every laser has light");
        assert_eq!(computed.field.wavelength, wavelength);
        let frame = pipeline::frame(&computed.field, &profile, &encode, &progress).expect("frame").frame;
        let (field, mut settings) =
            pipeline::simulated_light(&frame, &Simulation::default(), &progress).expect("light");
        settings.block_zero_order(0.05f64.to_radians(), wavelength);
        behind.exposures.push(ExposureLight { field, settings, laser });
    }
    let placing = &lit.view.placing;
    let target = ColorPicture { width: 200, height: 200, rgb: lit.view.picture.clone() };
    let check = |name: &str, seen: &Reconstruction, error: f32| {
        let Reconstruction::Color(seen) = seen else { panic!("{name} in gray") };
        let found = means(seen, seen.white_like(&target, 1.0));
        for (lamp, wanted) in found.iter().zip(LAMPS) {
            // Its colour, and its brightness beside the others'.
            let brightest = |c: [f32; 3]| c.into_iter().fold(0.0, f32::max);
            let hue = |c: [f32; 3]| c.map(|v| v / brightest(c));
            let off = hue(*lamp).iter().zip(hue(wanted)).fold(0.0f32, |m, (a, b)| m.max((a - b).abs()));
            assert!(off < error, "{name}: {wanted:?} is seen as {lamp:?}; all: {found:?}");
            let ratio = brightest(*lamp) / brightest(wanted);
            assert!((ratio - 1.0).abs() < 0.3, "{name}: {wanted:?} is seen as {lamp:?}; all: {found:?}");
        }
        assert!(found[4].iter().all(|v| v.abs() < error), "{name}: dark is seen as {:?}", found[4]);
    };
    let step = 1e-3;
    let (sharp, planes) = behind
        .all_in_focus(&lit.view.depths, (200, 200), |z| placing.view_at(z), step, &progress)
        .expect("all in focus");
    assert!(planes >= 40);
    check("all in focus", &sharp, 0.1);
    let likeness = sharp.likeness(&target, 1.0);
    assert!(likeness.psnr_blocks > 15.0, "{likeness:?}");
    // An eye takes the same part of each laser's light: no flat field, and the same colours.
    let focus = 0.5 * (lit.view.focus[0].1 + lit.view.focus[1].1);
    let eye = View::Eye { position: placing.eye.to_array(), pupil: 6e-3, focus };
    let seen = behind.picture(&eye, placing.view_at(focus), Some((200, 200)), &progress).expect("eye");
    check("eye", &seen, 0.25);
}

#[test]
fn a_scene_of_one_colour_leaves_the_other_lasers_dark() {
    let cloud = holodrive::points::PointCloud {
        points: vec![holodrive::points::PointSource {
            position: DVec3::new(0.0, 0.0, -0.1),
            amplitude: 1.0,
            phase: 0.0,
        }],
        rgb: Some(vec![[0.0, 0.0, 1.0]]),
    };
    let grid = panel().grid().expect("grid");
    let lasers = Lasers::new([638e-9, 520e-9, 450e-9]).expect("lasers");
    let fields = pipeline::color_fields(&cloud, &lasers, None, &grid, &HologramSettings::default(), &Progress::new())
        .expect("fields");
    // Rec.709's blue lies beyond the green–blue side of the triangle: moved onto it, it needs no red.
    assert!(fields.computed[0].is_none() && fields.computed[1].is_some() && fields.computed[2].is_some());
    assert_eq!(fields.gamut.outside_points, 1);
}

#[test]
fn waves_reach_the_eye_in_step_in_each_laser() {
    use holodrive::points::{Channel, PointCloud, PointSource};
    let eye = DVec3::new(0.0, 0.0, 0.6);
    let at = |x, z| PointSource { position: DVec3::new(x, 1e-4, z), amplitude: 1.0, phase: 0.0 };
    let cloud = PointCloud { points: vec![at(1e-4, -0.1), at(-2e-4, -0.12)], rgb: None };
    let grid = panel().grid().expect("grid");
    let lasers = Lasers::new([638e-9, 520e-9, 450e-9]).expect("lasers");
    let (settings, progress) = (HologramSettings::default(), Progress::new());
    let fields = pipeline::color_fields(&cloud, &lasers, Some(eye), &grid, &settings, &progress).expect("fields");
    for (computed, wavelength) in fields.computed.iter().zip(lasers.wavelengths()) {
        let mut own = cloud.clone();
        for point in &mut own.points {
            // −k·distance, whole turns left out.
            point.phase = -std::f64::consts::TAU * (((eye - point.position).length() / wavelength) % 1.0);
        }
        let expected =
            pipeline::field(&own, Channel::Luminance, &grid, wavelength, &settings, &progress).expect("field").field;
        let found = &computed.as_ref().expect("light").field;
        let off: f64 = found.samples.iter().zip(&expected.samples).map(|(a, b)| f64::from((a - b).norm_sqr())).sum();
        assert!(off < 1e-8 * expected.energy(), "{wavelength}: {off}");
    }
}

#[test]
fn a_budget_gives_as_many_points_and_keeps_the_edges() {
    let folder = tempfile::tempdir().expect("folder");
    let (scene, progress) = (lamps(folder.path()), Progress::new());
    let grid = PanelProfile::generic().expect("profile").grid().expect("grid");
    let light = |points: Budget, size: (u32, u32)| {
        let mut settings = SceneSettings { points: Some(points), ..SceneSettings::default() };
        (settings.trace.width, settings.trace.height) = size;
        pipeline::light(&scene, &settings, &grid, 632.8e-9, &progress).expect("light")
    };
    // The lamps cover 0.64 of the picture.
    // On a coarse grid a column more or less of a lamp is several per cent.
    for (count, allowed) in [(300, 0.15), (5000, 0.03), (60_000, 0.03)] {
        let lit = light(Budget::Points(count as usize), (500, 500));
        let points = lit.world.len() as f64;
        assert!((points / f64::from(count) - 1.0).abs() < allowed, "{count}: {points}");
        let rays = lit.rays.expect("a budget");
        assert_eq!(rays.size.map(|s| s as usize), [lit.view.width, lit.view.height]);
        // Strata: the outermost points stand within one cell of the lamps' edges, on every side.
        let edge = |f: &dyn Fn(&holodrive::points::placement::WorldPoint) -> f64| {
            lit.world.iter().map(|p| 3.0 / -p.position.z * f(p)).fold(f64::NEG_INFINITY, f64::max)
        };
        let cell = 2.0 / f64::from(rays.size[0].min(rays.size[1]));
        for side in
            [edge(&|p| p.position.x), edge(&|p| -p.position.x), edge(&|p| p.position.y), edge(&|p| -p.position.y)]
        {
            // Corners are rounded to single precision.
            assert!(side <= 0.9 + 1e-5 && side > 0.9 - cell, "{count}: {side}");
        }
    }
    let eye = light(Budget::Eye, (500, 500));
    let rays = eye.rays.expect("a budget");
    // 8.64 mm from 600 mm are 49.5 minutes of arc.
    assert_eq!(rays.size, [49, 49]);
    let wide = light(Budget::Points(10_000), (400, 300));
    let [across, down] = wide.rays.expect("a budget").size;
    assert!((f64::from(across) / f64::from(down) - 4.0 / 3.0).abs() < 0.03, "{across} × {down}");
}
