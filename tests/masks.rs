//! Plates as mask writers and printers take them, read back by small readers of this test's own and, where they are installed, by
//! klayout, gdstk, ezdxf and Pillow.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const WIDTH: usize = 860;
const HEIGHT: usize = 600;

fn holodrive(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_holodrive")).args(arguments).current_dir(folder).output().expect("runs")
}

fn done(folder: &Path, arguments: &[&str]) {
    let out = holodrive(folder, arguments);
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
}

fn refused(folder: &Path, arguments: &[&str], expected: &str) {
    let out = holodrive(folder, arguments);
    let said = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
    assert!(said.lines().count() == 1 && said.contains(expected), "{arguments:?} did not say `{expected}`: {said}");
}

/// A plate of one bit, 860 × 600 pixels of 0.5 µm in tiles of 128, and two points behind it.
fn prepare(folder: &Path) {
    fs::write(
        folder.join("points.ply"),
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\nproperty double z\nend_header\n\
         1e-5 2e-5 -5e-3\n-4e-5 1e-5 -5.2e-3\n",
    )
    .expect("points");
    let plate = "name = \"mask\"\nsize = \"0.43mm x 0.3mm\"\npitch = \"0.5um\"\nwavelength = \"633nm\"\nbits = 1\ntile = 128\n\
        guard = 20\nmarks = 16\n[reference]\nangle = [\"9.1deg\", \"0deg\"]\n[scene]\nviewer = \"30mm\"\ndistance = \"5mm\"\n\
        object_angle = [\"9.2deg\", \"9.2deg\"]\n[printer]\nmachine = \"test\"\nfield = [300, 200]\n";
    fs::write(folder.join("plate.toml"), plate).expect("plate");
    done(folder, &["print", "points.ply", "--plate", "plate.toml", "-o", "plate"]);
}

/// Levels of the plate's file: tags 324 and 325 of BigTIFF.
fn levels(folder: &Path) -> Vec<u8> {
    let bytes = fs::read(folder.join("plate/plate.tif")).expect("plate");
    let long = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight")) as usize;
    let entry = (0..long(16)).map(|i| 24 + 20 * i).find(|&at| bytes[at..at + 2] == 324u16.to_le_bytes()).expect("tag");
    let (tiles, list) = (long(entry + 4), long(entry + 12));
    let mut out = vec![0u8; WIDTH * HEIGHT];
    for tile in 0..tiles {
        for pixel in 0..128 * 128 {
            let (column, row) = (tile % 7 * 128 + pixel % 128, tile / 7 * 128 + pixel / 128);
            if column < WIDTH && row < HEIGHT {
                out[row * WIDTH + column] = bytes[long(list + 8 * tile) + pixel / 8] >> (7 - pixel % 8) & 1;
            }
        }
    }
    out
}

/// Pixels of shapes: each once.
struct Drawn(Vec<u8>);

impl Drawn {
    fn new() -> Self {
        Self(vec![0; WIDTH * HEIGHT])
    }
    /// Left, lower, right and upper edge in pixels from the lower left corner.
    fn rectangle(&mut self, [left, low, right, high]: [usize; 4]) {
        assert!(left < right && right <= WIDTH && low < high && high <= HEIGHT);
        for row in HEIGHT - high..HEIGHT - low {
            for pixel in &mut self.0[row * WIDTH + left..row * WIDTH + right] {
                assert_eq!(*pixel, 0, "two shapes overlap");
                *pixel = 1;
            }
        }
    }
}

/// The records of OASIS that the program writes, by SEMI P39; returns the unit.
fn oasis(bytes: &[u8], drawn: &mut Drawn) -> f64 {
    let mut at = 0;
    let mut take = |count: usize| {
        at += count;
        &bytes[at - count..at]
    };
    assert_eq!(take(13), b"%SEMI-OASIS\r\n");
    let number = |take: &mut dyn FnMut(usize) -> u8| {
        let (mut value, mut shift) = (0usize, 0);
        loop {
            let byte = take(1);
            value |= usize::from(byte & 127) << shift;
            shift += 7;
            if byte < 128 {
                return value;
            }
        }
    };
    let mut byte = |_: usize| take(1)[0];
    assert_eq!((byte(1), number(&mut byte)), (1, 3));
    assert_eq!([byte(1), byte(1), byte(1)], *b"1.0");
    let unit = match byte(1) {
        0 => number(&mut byte) as f64,
        7 => f64::from_le_bytes([0; 8].map(|_: u8| byte(1))),
        other => panic!("a real of type {other}"),
    };
    assert!((0..13).all(|_| byte(1) == 0), "tables");
    assert_eq!(byte(1), 14);
    let length = number(&mut byte);
    (0..length).for_each(|_| assert!(byte(1).is_ascii_uppercase()));
    let (mut width, mut height, mut y) = (0, 0, 0);
    loop {
        match byte(1) {
            20 => {
                let info = byte(1);
                if info & 3 != 0 {
                    assert_eq!((info & 3, number(&mut byte), number(&mut byte)), (3, 1, 0));
                }
                if info & 0x40 != 0 {
                    width = number(&mut byte);
                }
                if info & 0x20 != 0 {
                    height = number(&mut byte);
                }
                assert!(info & 0x10 != 0 && info & 0x84 == 0);
                let x = number(&mut byte);
                if info & 0x08 != 0 {
                    y = number(&mut byte);
                }
                assert!(x % 2 == 0 && y % 2 == 0, "no negative places");
                drawn.rectangle([x / 2, y / 2, x / 2 + width, y / 2 + height]);
            }
            2 => break,
            other => panic!("a record {other}"),
        }
    }
    assert_eq!(number(&mut byte), 252);
    assert!((0..253).all(|_| byte(1) == 0));
    assert_eq!(at, bytes.len());
    unit
}

/// Closed polylines of four corners of a DXF.
fn dxf(text: &str, drawn: &mut Drawn) {
    let lines: Vec<&str> = text.lines().collect();
    let pairs: Vec<(&str, &str)> = lines.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
    let mut corners: Vec<[f64; 2]> = Vec::new();
    let mut open = false;
    for (i, pair) in pairs.iter().enumerate() {
        match *pair {
            ("0", "POLYLINE") => {
                assert_eq!(pairs[i + 3], ("70", "1"), "closed");
                (open, corners) = (true, Vec::new());
            }
            ("10", x) if open => corners.push([x.parse().expect("x"), 0.0]),
            ("20", y) if open => corners.last_mut().expect("corner")[1] = y.parse().expect("y"),
            ("0", "SEQEND") => {
                let [a, b, c, d] = corners[..] else { panic!("{} corners", corners.len()) };
                assert!(a[1] == b[1] && b[0] == c[0] && c[1] == d[1] && d[0] == a[0]);
                let pixel = |micrometres: f64| {
                    assert_eq!(micrometres * 2.0, (micrometres * 2.0).round());
                    (micrometres * 2.0) as usize
                };
                drawn.rectangle([pixel(a[0]), pixel(a[1]), pixel(c[0]), pixel(c[1])]);
                open = false;
            }
            _ => {}
        }
    }
    assert_eq!(pairs.last(), Some(&("0", "EOF")));
}

#[test]
fn masks_and_bands_hold_the_levels_of_the_plate() {
    let folder = tempfile::tempdir().expect("folder");
    let f = folder.path();
    prepare(f);
    let wanted = levels(f);
    let export = |format: &str, more: &[&str], to: &str| {
        done(f, &[&["print", "export", "plate", "--as", format, "-o", to], more].concat());
    };
    export("oasis", &[], "plate.oas");
    export("dxf", &[], "plate.dxf");
    export("gds", &[], "plate.gds");
    export("oasis", &["--frame", "300x200"], "oas-fields");
    export("dxf", &["--band", "128"], "dxf-bands");
    export("gds", &["--frame", "256x512"], "gds-fields");
    export("bmp", &["--band", "256"], "bmp-bands");
    export("png", &[], "png-fields");
    let files = |name: &str| {
        let mut all: Vec<_> = fs::read_dir(f.join(name)).expect(name).map(|e| e.expect("entry").path()).collect();
        all.sort();
        all.retain(|path| path.extension().is_some_and(|e| e != "json"));
        all
    };
    let mut whole = Drawn::new();
    assert_eq!(oasis(&fs::read(f.join("plate.oas")).expect("file"), &mut whole), 2.0);
    assert!(whole.0 == wanted, "oasis");
    let mut parts = Drawn::new();
    assert_eq!(files("oas-fields").len(), 9);
    files("oas-fields").iter().for_each(|path| {
        oasis(&fs::read(path).expect("file"), &mut parts);
    });
    assert!(parts.0 == wanted, "oasis by fields");
    let mut whole = Drawn::new();
    dxf(&fs::read_to_string(f.join("plate.dxf")).expect("file"), &mut whole);
    assert!(whole.0 == wanted, "dxf");
    let mut parts = Drawn::new();
    assert_eq!(files("dxf-bands").len(), 5);
    files("dxf-bands").iter().for_each(|path| dxf(&fs::read_to_string(path).expect("file"), &mut parts));
    assert!(parts.0 == wanted, "dxf by bands");
    // Bands of a bitmap: 1 bit, rows from the bottom up, padded to four bytes.
    let mut bands = Vec::new();
    for path in files("bmp-bands") {
        let bytes = fs::read(path).expect("band");
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four")) as usize;
        let (first, width, height) = (word(10), word(18), word(22));
        assert_eq!((&bytes[..2], bytes.len(), width, bytes[28]), (&b"BM"[..], word(2), WIDTH, 1));
        assert_eq!(word(38), 2_000_000, "pixels a metre");
        let stride = width.div_ceil(32) * 4;
        for row in (0..height).rev() {
            let line = &bytes[first + row * stride..];
            bands.extend((0..width).map(|column| line[column / 8] >> (7 - column % 8) & 1));
        }
    }
    assert!(bands == wanted, "bitmap");
    let sizes = ["plate.gds", "plate.oas", "plate.dxf"].map(|name| fs::metadata(f.join(name)).expect("file").len());
    println!("{} rectangle bytes as gds, {} as oasis, {} as dxf", sizes[0], sizes[1], sizes[2]);
    assert!(sizes[1] * 5 < sizes[0]);
    // The printer's field is the default frame.
    let png = image::open(&files("png-fields")[0]).expect("frame");
    assert_eq!((png.width(), png.height(), files("png-fields").len()), (300, 200, 9));
    refused(
        f,
        &["print", "export", "plate", "--as", "gds", "--frame", "64x64", "--overlap", "4", "-o", "x"],
        "overlap",
    );
    refused(f, &["print", "export", "plate", "--as", "bmp", "--band", "0", "-o", "x"], "sides of 1");
    assert!(!f.join("x").exists());
    others(f, &wanted);
}

/// The same by other programs' readers.
fn others(f: &Path, wanted: &[u8]) {
    fs::write(f.join("levels.raw"), wanted).expect("levels");
    let begin = "import numpy as np, glob\nraw = np.fromfile('levels.raw', np.uint8).reshape(600, 860)\n\
        def draw(got, box):\n    x0, y0, x1, y1 = [int(round(v / 0.5)) for v in box]\n    \
        assert (got[600 - y1:600 - y0, x0:x1] == 0).all()\n    got[600 - y1:600 - y0, x0:x1] = 1\n";
    for (module, script) in [
        (
            "gdstk",
            "import gdstk\nfor names, read in ((['plate.gds'], gdstk.read_gds), (['plate.oas'], gdstk.read_oas), \
             (glob.glob('gds-fields/*.gds'), gdstk.read_gds), (glob.glob('oas-fields/*.oas'), gdstk.read_oas)):\n    \
             got = np.zeros_like(raw); n = 0\n    for name in names:\n        lib = read(name)\n        \
             for cell in lib.cells:\n            for p in cell.polygons:\n                \
             (x0, y0), (x1, y1) = np.array(p.bounding_box()) * lib.unit / 1e-6\n                \
             draw(got, (x0, y0, x1, y1)); n += 1\n    assert (got == raw).all(), names\n    \
             print(len(names), 'files', n, 'rectangles equal')",
        ),
        (
            "klayout.db",
            "import klayout.db as db\nfor names in (['plate.gds'], ['plate.oas'], ['plate.dxf'], glob.glob('oas-fields/*.oas'), \
             glob.glob('dxf-bands/*.dxf')):\n    got = np.zeros_like(raw)\n    for name in names:\n        \
             ly = db.Layout(); ly.read(name)\n        \
             for li in ly.layer_indexes():\n            for cell in ly.each_cell():\n                \
             for s in cell.shapes(li).each():\n                    b = s.dbbox(); assert s.is_box() or s.is_polygon() or s.is_path()\n                    \
             draw(got, (b.left, b.bottom, b.right, b.top))\n    assert (got == raw).all(), names\nprint('levels equal')",
        ),
        (
            "ezdxf",
            "import ezdxf\nfor names in (sorted(glob.glob('dxf-bands/*.dxf'))[:1],):\n    got = np.zeros_like(raw)\n    \
             for name in names:\n        doc = ezdxf.readfile(name)\n        \
             for e in doc.modelspace().query('POLYLINE'):\n            assert e.is_closed\n            \
             v = np.array([(p.x, p.y) for p in e.points()])\n            draw(got, (*v.min(0), *v.max(0)))\n    \
             assert (got[:128] == raw[:128]).all(), names\nprint('levels of a band equal')",
        ),
        (
            "PIL.Image",
            "from PIL import Image\nbands = [np.array(Image.open(n)) for n in sorted(glob.glob('bmp-bands/*.bmp'))]\n\
             assert all(b.dtype == bool for b in bands)\n\
             assert (np.concatenate(bands)[:600] == (raw > 0)).all()\nprint(len(bands), 'bands equal')",
        ),
    ] {
        let python = std::env::var("HOLODRIVE_TEST_PYTHON").unwrap_or_else(|_| "python3".to_owned());
        let there = Command::new(&python).args(["-c", &format!("import numpy, {module}")]).output();
        if !there.is_ok_and(|out| out.status.success()) {
            println!("{module} did not run: {python} with numpy and {module} is not installed");
            continue;
        }
        let out =
            Command::new(&python).args(["-c", &format!("{begin}{script}")]).current_dir(f).output().expect("runs");
        assert!(out.status.success(), "{module}: {}", String::from_utf8_lossy(&out.stderr));
        println!("{module}: {}", String::from_utf8_lossy(&out.stdout).trim().replace('\n', "; "));
    }
}
