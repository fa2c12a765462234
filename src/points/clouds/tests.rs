use super::read;
use crate::points::ply::Read;
use glam::DVec3;
use std::path::PathBuf;

fn file(folder: &tempfile::TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("write");
    path
}

fn of(name: &str, bytes: impl AsRef<[u8]>) -> Read {
    let folder = tempfile::tempdir().expect("folder");
    read(&file(&folder, name, bytes.as_ref())).unwrap_or_else(|e| panic!("{name}: {e}"))
}

fn refused(name: &str, bytes: impl AsRef<[u8]>, word: &str) {
    let folder = tempfile::tempdir().expect("folder");
    let said = read(&file(&folder, name, bytes.as_ref())).expect_err(word).to_string();
    assert!(said.contains(word) && !said.contains('\n'), "{said}");
}

#[test]
fn tables_are_read_by_names_or_by_the_number_of_columns() {
    for (name, text) in [
        ("a.xyz", "1 2 -3\n4 5 -6\n"),
        ("a.csv", "x,y,z\r\n1,2,-3\r\n4,5,-6\r\n"),
        ("a.csv", "\"z\";\"name\";\"y\";\"x\"\n-3;0;2;1\n-6;0;5;4\n"),
        ("a.txt", "# x y z\n1\t2\t-3\n\n4 5 -6"),
        ("a.txt", "// made by hand\n1 2 -3 0 0 1\n4 5 -6 0.6 0 0.8\n"),
        ("a.pts", "2\n1 2 -3\n4 5 -6\n"),
        ("a.obj", "# cube\nmtllib a.mtl\nv 1 2 -3 1.0\nv 4 5 -6\nvn 0 0 1\nf 1 2 1\n"),
    ] {
        let read = of(name, text);
        let points: Vec<DVec3> = read.cloud.points.iter().map(|p| p.position).collect();
        assert_eq!(points, [DVec3::new(1.0, 2.0, -3.0), DVec3::new(4.0, 5.0, -6.0)], "{text}");
        assert!(read.cloud.rgb.is_none() && read.cloud.points[0].amplitude == 1.0, "{text}");
    }
    let colored = of("a.xyz", "0 0 0 255 0 0\n0 0 0 0 51 0\n").cloud.rgb.expect("coloured");
    assert_eq!(colored, [[1.0, 0.0, 0.0], [0.0, 0.2, 0.0]]);
    let read = of("a.obj", "v 0 0 0 1 0 0\nv 0 0 0 0 0.5 0\nf 1 2 1\n");
    assert_eq!(read.cloud.rgb.expect("coloured"), [[1.0, 0.0, 0.0], [0.0, 0.5, 0.0]]);
    assert!(read.origin.contains("2 vertices, taken as points; 1 faces are left out"), "{}", read.origin);
    let weak: Vec<f32> = of("a.xyz", "0 0 0 4\n0 0 0 1\n").cloud.points.iter().map(|p| p.amplitude).collect();
    assert_eq!(weak, [1.0, 0.5]);
    let scanned = of("a.pts", "2\n0 0 0 -7 255 255 255\n0 0 0 9 51 51 51\n");
    assert_eq!(scanned.cloud.points[1].amplitude, 0.2);
    assert!(scanned.origin.contains("columns x, y, z, intensity, red, green, blue"), "{}", scanned.origin);
    let holes = of("a.xyz", "0 0 0\nnan nan nan\n");
    assert!(holes.cloud.points.len() == 1 && holes.warnings[0].starts_with("1 of 2 points"), "{:?}", holes.warnings);
    // More lines than are looked at first.
    let long: String = (0..250).map(|i| format!("{i} 0 -1\n")).collect();
    assert_eq!(of("a.xyz", long).cloud.points.len(), 250);
    refused("a.xyz", "", "no points");
    refused("a.xyz", "hello there\n", "line 1");
    refused("a.xyz", "1 2 3\n1 2 x\n", "line 2: `x` is not a number");
    refused("a.csv", "1,2\n", "less than three");
    refused("a.obj", "v 1 2\n", "line 1");
    refused("a.obj", "f 1 2 3\n", "no vertices");
    refused("a.kml", "<", "no kind of point cloud");
}

fn pcd(fields: &str, sizes: &str, types: &str, count: usize, data: &str) -> Vec<u8> {
    format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\nSIZE {sizes}\nTYPE {types}\nWIDTH {count}\nHEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA {data}\n"
    )
    .into_bytes()
}

#[test]
fn pcd_of_each_kind_gives_the_same_points() {
    let rows: [([f32; 3], u32); 3] =
        [([1.0, 2.0, -3.0], 0xff_00_00), ([4.0, 5.0, -6.0], 0x00_33_00), ([f32::NAN; 3], 0)];
    let head = |data: &str| pcd("x y z rgb", "4 4 4 4", "F F F F", 3, data);
    let mut ascii = head("ascii");
    let mut binary = head("binary");
    for (p, rgb) in rows {
        ascii.extend(format!("{} {} {} {:e}\n", p[0], p[1], p[2], f32::from_bits(rgb)).into_bytes());
        p.into_iter().chain([f32::from_bits(rgb)]).for_each(|v| binary.extend(v.to_le_bytes()));
    }
    // Field by field, each as a run of its own; the last twelve bytes as a run of four and a copy.
    let mut packed = Vec::new();
    for axis in 0..3 {
        packed.push(11);
        rows.iter().for_each(|(p, _)| packed.extend(p[axis].to_le_bytes()));
    }
    packed.push(11);
    rows.iter().for_each(|(_, rgb)| packed.extend(rgb.to_le_bytes()));
    let mut compressed = head("binary_compressed");
    compressed.extend([packed.len() as u32, 48].map(u32::to_le_bytes).concat());
    compressed.extend(&packed);
    for bytes in [&ascii, &binary, &compressed] {
        let read = of("a.pcd", bytes);
        assert_eq!(read.cloud.points.len(), 2);
        assert_eq!(read.cloud.points[1].position, DVec3::new(4.0, 5.0, -6.0));
        assert_eq!(read.cloud.rgb.expect("coloured"), [[1.0, 0.0, 0.0], [0.0, 0.2, 0.0]]);
        assert!(read.warnings[0].starts_with("1 of 3"), "{:?}", read.warnings);
        refused("a.pcd", &bytes[..bytes.len() - 14], if bytes == &compressed { "cut off" } else { "" });
    }
    // A copy: four zeros, then eight more by going back four.
    let mut copied = pcd("x y z", "4 4 4", "F F F", 1, "binary_compressed");
    copied.extend([8u32, 12].map(u32::to_le_bytes).concat());
    copied.extend([3, 0, 0, 0, 0, 6 << 5, 3, 0]);
    refused("a.pcd", &copied, "damaged");
    let at = copied.len() - 8 - 8;
    copied[at] = 7;
    assert_eq!(of("a.pcd", &copied[..copied.len() - 1]).cloud.points[0].position, DVec3::ZERO);
    refused("a.pcd", pcd("x y", "4 4", "F F", 1, "ascii"), "no x, y and z");
    refused("a.pcd", pcd("x y z", "4 4 4", "F F F", usize::MAX, "binary"), "truncated");
    // A byte too few.
    refused("a.pcd", &binary[..binary.len() - 1], "truncated");
    refused("a.pcd", b"hello", "not a .pcd");
}

#[cfg(feature = "las")]
#[test]
fn laser_scans_have_their_colours_and_leave_out_what_was_withheld() {
    let scan = |most: u16| {
        let mut builder = las::Builder::from((1, 4));
        builder.point_format = las::point::Format::new(2).expect("format");
        let header = builder.into_header().expect("header");
        let mut writer = las::Writer::new(std::io::Cursor::new(Vec::new()), header).expect("writer");
        for (x, is_withheld) in [(1.25, false), (9.0, true), (-2.5, false)] {
            let color = Some(las::Color { red: most, green: 0, blue: most / 5 });
            let point = las::Point { x, y: 3.0, z: -4.5, intensity: 7, is_withheld, color, ..Default::default() };
            writer.write_point(point).expect("point");
        }
        writer.into_inner().expect("file").into_inner()
    };
    for most in [u16::MAX, 255] {
        let read = of("a.las", scan(most));
        let positions: Vec<_> = read.cloud.points.iter().map(|p| p.position).collect();
        assert_eq!(positions, [DVec3::new(1.25, 3.0, -4.5), DVec3::new(-2.5, 3.0, -4.5)]);
        for colour in read.cloud.rgb.expect("coloured") {
            assert!((colour[0] - 1.0).abs() < 1e-6 && colour[1] == 0.0 && (colour[2] - 0.2).abs() < 1e-6, "{colour:?}");
        }
        assert!(read.origin.contains("1 that the scanner withheld"), "{}", read.origin);
    }
    let whole = scan(255);
    refused("a.las", &whole[..whole.len() - 30], "damaged");
    (0..whole.len() - 30).step_by(7).for_each(|cut| refused("a.las", &whole[..cut], ""));
    let mut packed = whole.clone();
    packed[104] |= 0x80;
    refused("a.laz", &packed, "unpack");
    // An extended record of 2^63 bytes.
    let mut promising = whole.clone();
    let at = whole.len() as u64;
    promising[235..243].copy_from_slice(&at.to_le_bytes());
    promising[243] = 1;
    promising.extend([[0u8; 20].as_slice(), &(1u64 << 63).to_le_bytes(), &[0; 32]].concat());
    refused("a.las", &promising, "beyond its end");
}

#[test]
fn names_in_quotes_may_have_blanks_and_columns_may_be_empty() {
    let read = of(
        "a.csv",
        "\"x\",\"y\",\"z\",\"M3C2 distance\",\"red\",\"green\",\"blue\"\n1,2,3,,255,0,51\n4, 5 ,6,0.1,0,255,0,\n",
    );
    assert_eq!(read.cloud.points.len(), 2);
    assert_eq!(read.cloud.points[1].position, DVec3::new(4.0, 5.0, 6.0));
    assert_eq!(read.cloud.rgb.expect("coloured")[0], [1.0, 0.0, 0.2]);
}

#[test]
fn what_is_all_dark_is_taken_as_white_and_scanners_count_below_zero() {
    let white = of("a.xyz", "1 2 3 0 0 0\n4 5 6 0 0 0\n");
    assert!(
        white.cloud.points.iter().all(|p| p.amplitude == 1.0) && white.warnings[0].contains("black"),
        "{:?}",
        white.warnings
    );
    let none = of("a.pts", "2\n1 2 3 0\n4 5 6 0\n");
    assert!(
        none.cloud.points.iter().all(|p| p.amplitude == 1.0) && none.warnings[0].contains("white"),
        "{:?}",
        none.warnings
    );
    let leica = of("a.pts", "3\n1 2 3 -2048\n4 5 6 2048\n7 8 9 0\n");
    let light: Vec<f32> = leica.cloud.points.iter().map(|p| p.amplitude * p.amplitude).collect();
    assert!(light.iter().zip([0.0, 1.0, 0.5]).all(|(a, b)| (a - b).abs() < 1e-6), "{light:?}");
}

#[test]
fn points_in_rows_before_a_camera_have_its_axes() {
    let rows = |height: usize, z: f32| {
        let head = String::from_utf8(pcd("x y z", "4 4 4", "F F F", 2, "ascii")).expect("text");
        let head = head.lines().filter(|line| !line.starts_with("HEIGHT")).collect::<Vec<_>>().join("\n");
        let head = head.replace("DATA", &format!("HEIGHT {height}\nDATA"));
        of("a.pcd", format!("{head}\n0 1 {z}\n1 2 3\n")).axes
    };
    assert_eq!(rows(2, 1.0), Some(crate::points::Axes::CAMERA));
    assert_eq!((rows(1, 1.0), rows(2, -1.0)), (None, None));
}
