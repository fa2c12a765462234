use super::*;
use crate::points::{PointCloud, PointSource};
use glam::DVec3;
use proptest::prelude::*;
use std::path::PathBuf;

fn file(folder: &tempfile::TempDir, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join("p.ply");
    std::fs::write(&path, bytes).expect("write");
    path
}

fn cloud(colored: bool) -> PointCloud {
    let points = (0..7)
        .map(|i| PointSource {
            position: DVec3::new(1e-3 * f64::from(i), -2e-3 / 3.0, -0.2 + 1e-9 * f64::from(i)),
            amplitude: 0.1 * i as f32,
            phase: 0.7 * f64::from(i),
        })
        .collect();
    let mut cloud = PointCloud { points, rgb: None };
    if colored {
        let rgb: Vec<_> = (0..7).map(|i| [0.1 * i as f32, 0.5, 0.25]).collect();
        for (p, c) in cloud.points.iter_mut().zip(&rgb) {
            p.amplitude = crate::points::luminance(c.map(|a| a * a)).sqrt();
        }
        cloud.rgb = Some(rgb);
    }
    cloud
}

#[test]
fn ours_comes_back_to_the_bit() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("p.ply");
    let metadata = Metadata { scene: "a b.gltf".into(), eye: Some([0.0, 0.0, 0.6]), ..Metadata::default() };
    for colored in [false, true] {
        write(&path, &cloud(colored), &metadata).expect("write");
        let back = read(&path).expect("read");
        assert_eq!(back.cloud, cloud(colored));
        assert_eq!(back.metadata.as_ref(), Some(&metadata));
        assert!(back.warnings.is_empty());
    }
}

#[test]
fn openholo_flavour_with_a_color_element_and_values_outside_a_uchar() {
    let text = "ply\nformat ascii 1.0\ncomment made by OpenHolo\nelement color 1\nproperty int channel\n\
        element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
        property uchar green\nproperty uchar blue\nproperty double phase\nend_header\n3\n\
        0.001 0.002 -0.2 255 0 0 0.5\n0 0 -0.21 0 300 0 0\n\n0 0 0.3 51 51 51 1e-1\n";
    let folder = tempfile::tempdir().expect("folder");
    let back = read(&file(&folder, text.as_bytes())).expect("read");
    let rgb = back.cloud.rgb.expect("coloured");
    assert_eq!(rgb, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.2, 0.2]]);
    assert_eq!(back.cloud.points[0].phase, 0.5);
    assert!((back.cloud.points[2].position.z - 0.3).abs() < 1e-12);
    assert_eq!(back.warnings.len(), 1, "{:?}", back.warnings);
}

#[test]
fn plain_clouds_have_amplitude_one_and_big_endian_is_read() {
    let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\n\
        property float z\nproperty list uchar int neighbours\nend_header\n"
        .to_vec();
    for i in 0..2 {
        for v in [1.0f32, -2.0, 0.5 * i as f32] {
            bytes.extend(v.to_be_bytes());
        }
        bytes.extend([1, 0, 0, 0, 9]);
    }
    let folder = tempfile::tempdir().expect("folder");
    let back = read(&file(&folder, &bytes)).expect("read").cloud;
    assert_eq!(back.points[1], PointSource { position: DVec3::new(1.0, -2.0, 0.5), amplitude: 1.0, phase: 0.0 });
    assert_eq!(back.rgb, None);
}

#[test]
fn malformed_files_are_refused_in_words() {
    let head =
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    let cases: Vec<(String, &str)> = vec![
        (format!("{head}0 0 1\n"), "ends at number 1"),
        (format!("{head}0 0\n0 0 1\n"), "too few values"),
        (format!("{head}0 0 a\n0 0 1\n"), "not a number"),
        (head.replace("vertex 2", "vertex 99999999999999"), "more than its"),
        (head.replace("property float z\n", ""), "no `z`"),
        (head.replace("float", "quaternion"), "unknown number type"),
        (head.replace("end_header\n", ""), "does not end"),
        ("solid cube\n".into(), "not a PLY"),
        ("ply\nend_header\n".into(), "no format"),
        ("ply\nformat ascii 1.0\nend_header\n".into(), "no `vertex`"),
    ];
    let folder = tempfile::tempdir().expect("folder");
    for (text, expected) in cases {
        let error = read(&file(&folder, text.as_bytes())).expect_err(expected).to_string();
        assert!(error.contains(expected), "{error} does not say `{expected}`");
        assert!(!error.contains('\n'), "one line: {error}");
    }
}

#[test]
fn what_was_not_measured_is_left_out_and_scanners_intensities_and_colours_are_read() {
    let folder = tempfile::tempdir().expect("folder");
    let of = |properties: &str, rows: &str| {
        let properties: String = properties.split(' ').map(|name| format!("property float {name}\n")).collect();
        let count = rows.lines().count();
        let text = format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}end_header\n{rows}");
        read(&file(&folder, text.as_bytes())).expect("read")
    };
    let back = of("x y z", "0 0 -1\nnan nan nan\n0 0 -2\n0 inf 0\n");
    assert_eq!(back.cloud.points.len(), 2);
    assert!(back.warnings.len() == 1 && back.warnings[0].starts_with("2 of 4 points"), "{:?}", back.warnings);
    for name in ["intensity", "scalar_Intensity", "Intensity", "reflectance"] {
        let back = of(&format!("x y z {name}"), "0 0 -1 800\n0 0 -1 200\n0 0 -1 -1\n");
        assert_eq!(back.cloud.points.iter().map(|p| p.amplitude).collect::<Vec<_>>(), [1.0, 0.5, 0.0], "{name}");
        assert!(back.warnings.is_empty() && back.origin.contains("up to 800"), "{name}");
    }
    let back = of("x y z red green blue", "0 0 -1 255 255 255\n0 0 -1 51 51 51\n");
    assert_eq!(back.cloud.points.iter().map(|p| p.amplitude).collect::<Vec<_>>(), [1.0, 0.2]);
    assert!(back.origin.contains("parts of 255"), "{}", back.origin);
    let back = of("x y z red green blue", "0 0 -1 1.25 1 1\n0 0 -1 0.5 0.5 0.5\n");
    assert!(back.cloud.points[1].amplitude == 0.5 && back.warnings.len() == 1, "{:?}", back.warnings);
    // A splat: mid gray at half opacity, and a red one that is opaque.
    let back = of("x y z f_dc_0 f_dc_1 f_dc_2 opacity", "0 0 -1 0 0 0 0\n0 0 -1 1.7724539 -1.7724539 -1.7724539 20\n");
    let rgb = back.cloud.rgb.expect("coloured");
    let gray = (crate::scene::texture::linear_from_srgb(0.5) * 0.5).sqrt();
    assert!((rgb[0][1] - gray).abs() < 1e-6 && (rgb[1][0] - 1.0).abs() < 1e-4 && rgb[1][1] == 0.0, "{rgb:?}");
    assert!(back.origin.contains("Gaussian splats"), "{}", back.origin);
}

proptest! {
    #[test]
    fn garbage_never_panics(cut in 0usize..600, flips in prop::collection::vec((0usize..600, any::<u8>()), 0..8)) {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("p.ply");
        write(&path, &cloud(true), &Metadata::default()).expect("write");
        let mut bytes = std::fs::read(&path).expect("bytes");
        for (at, value) in flips {
            let at = at % bytes.len();
            bytes[at] = value;
        }
        bytes.truncate(cut.max(1));
        // Either points or an error in words; what matters is that it returns.
        if let Err(error) = read(&file(&folder, &bytes)) {
            prop_assert!(!error.to_string().is_empty());
        }
    }
}
