//! Colour through the whole way: lamps of known colours come back as those colours, in their places.

use glam::DVec3;
use holodrive::hologram::HologramSettings;
use holodrive::panel::{Origin, PanelProfile, Setup};
use holodrive::pipeline::{self, Bench, Settings};
use holodrive::points::budget::Budget;
use holodrive::points::{Channel, Exposure, PointCloud, PointSource, SceneSettings, Share};
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
    let setup = in_three_lasers(profile);
    let mut settings = Settings::default();
    (settings.scene.trace.width, settings.scene.trace.height) = (200, 200);
    let lit = pipeline::scene(&scene, &settings.scene, &progress).expect("scene");
    let lit = pipeline::points(&lit, &settings.scene, &setup, &progress).expect("points");
    let cloud = &lit.placed.cloud;
    let exposures = pipeline::exposures(&setup, &settings, None);
    assert_eq!(Exposure::gamut(&exposures, cloud).expect("lasers").outside_points, 0);
    let bench = Bench { zero_order_stop: 0.05f64.to_radians(), ..Bench::default() };
    let mut behind = Light { lasers: setup.lasers, exposures: Vec::new() };
    for (laser, exposure) in exposures.iter().enumerate() {
        let computed = pipeline::field(cloud, exposure, &setup, &settings.hologram, &progress).expect("field");
        let field = computed.expect("every laser has light").field;
        assert_eq!(field.wavelength, exposure.wavelength);
        let encoded = pipeline::frame(&field, &setup, &settings.encode, Origin::default(), &progress);
        let light = pipeline::light(&encoded.expect("frame").frame, &bench, &progress).expect("light");
        behind.exposures.push(ExposureLight { laser, ..light });
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

fn in_three_lasers(profile: PanelProfile) -> Setup {
    Setup::new(profile, None).and_then(|setup| setup.in_color(Some([638e-9, 520e-9, 450e-9]))).expect("setup")
}

#[test]
fn a_scene_of_one_colour_leaves_the_other_lasers_dark() {
    let cloud = PointCloud {
        points: vec![PointSource { position: DVec3::new(0.0, 0.0, -0.1), amplitude: 1.0, phase: 0.0 }],
        rgb: Some(vec![[0.0, 0.0, 1.0]]),
    };
    let (setup, settings) = (in_three_lasers(panel()), Settings::default());
    let exposures = pipeline::exposures(&setup, &settings, None);
    let has_light = |exposure: &Exposure| {
        let computed = pipeline::field(&cloud, exposure, &setup, &settings.hologram, &Progress::new());
        computed.expect("field").is_some()
    };
    // Rec.709's blue lies beyond the green–blue side of the triangle: moved onto it, it needs no red.
    assert_eq!(exposures.iter().map(has_light).collect::<Vec<_>>(), [false, true, true]);
    assert_eq!(Exposure::gamut(&exposures, &cloud).expect("lasers").outside_points, 1);
}

#[test]
fn waves_reach_the_eye_in_step_in_each_laser() {
    let eye = DVec3::new(0.0, 0.0, 0.6);
    let at = |x, z| PointSource { position: DVec3::new(x, 1e-4, z), amplitude: 1.0, phase: 0.0 };
    let cloud = PointCloud { points: vec![at(1e-4, -0.1), at(-2e-4, -0.12)], rgb: None };
    let setup = in_three_lasers(panel());
    let (settings, progress) = (HologramSettings::default(), Progress::new());
    for exposure in pipeline::exposures(&setup, &Settings::default(), Some(eye)) {
        let wavelength = exposure.wavelength;
        let mut own = cloud.clone();
        for point in &mut own.points {
            // −k·distance, whole turns left out.
            point.phase = -std::f64::consts::TAU * (((eye - point.position).length() / wavelength) % 1.0);
        }
        let field = |cloud: &PointCloud, exposure: &Exposure| {
            let computed = pipeline::field(cloud, exposure, &setup, &settings, &progress).expect("field");
            computed.expect("light").field
        };
        let expected = field(&own, &Exposure { wavelength, share: Share::Whole(Channel::Luminance) });
        let found = field(&cloud, &exposure);
        let off: f64 = found.samples.iter().zip(&expected.samples).map(|(a, b)| f64::from((a - b).norm_sqr())).sum();
        assert!(off < 1e-8 * expected.energy(), "{wavelength}: {off}");
    }
}

#[test]
fn a_budget_gives_as_many_points_and_keeps_the_edges() {
    let folder = tempfile::tempdir().expect("folder");
    let (scene, progress) = (lamps(folder.path()), Progress::new());
    let setup = Setup::new(PanelProfile::generic().expect("profile"), None).expect("setup");
    let light = |points: Budget, size: (u32, u32)| {
        let mut settings = SceneSettings { points: Some(points), ..SceneSettings::default() };
        (settings.trace.width, settings.trace.height) = size;
        let lit = pipeline::scene(&scene, &settings, &progress).expect("scene");
        pipeline::points(&lit, &settings, &setup, &progress).expect("points")
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
