use super::*;
use crate::field::npy_zip;
use crate::field::{Complex32, npy_head};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use std::io::Write as _;

/// 3 rows × 2 columns.
fn values() -> Vec<Complex32> {
    (0..6).map(|i| Complex32::new(i as f32, 0.25 - i as f32)).collect()
}

fn bytes_of(values: &[Complex32]) -> Vec<u8> {
    values.iter().flat_map(|u| [u.re, u.im]).flat_map(f32::to_le_bytes).collect()
}

/// The same numbers column by column.
fn by_columns() -> Vec<Complex32> {
    let values = values();
    (0..6).map(|i| values[i % 3 * 2 + i / 3]).collect()
}

fn npy(kind: &str, shape: &[usize], fortran: bool, data: &[u8]) -> Vec<u8> {
    let head = String::from_utf8_lossy(&npy_head::of(kind, shape)[10..]).into_owned();
    // Of the same length: the order's name takes a blank.
    let head = if fortran { head.replace("'fortran_order': False", "'fortran_order': True ") } else { head };
    let mut out = npy_head::of(kind, shape)[..10].to_vec();
    out.extend(head.into_bytes());
    out.extend(data);
    out
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("folder"))
    }
    fn file(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, bytes).expect("write");
        path
    }
    fn picture(&self, name: &str, bytes: &[u8]) -> Result<(usize, usize, Values)> {
        let path = self.file(name, bytes);
        read(&path)?.picture(&path)
    }
}

#[test]
fn every_way_in_which_numpy_stores_a_field_is_the_same_field() {
    let folder = Folder::new();
    let (rows, columns) = (bytes_of(&values()), bytes_of(&by_columns()));
    let halves = |part: fn(&Complex32) -> f32| values().iter().flat_map(|u| part(u).to_le_bytes()).collect::<Vec<u8>>();
    let apart = [halves(|u| u.re), halves(|u| u.im)].concat();
    let doubles: Vec<u8> =
        values().iter().flat_map(|u| [u.re, u.im]).flat_map(|v| f64::from(v).to_be_bytes()).collect();
    for (kind, shape, fortran, data) in [
        ("<c8", &[3, 2][..], false, &rows),
        ("<c8", &[3, 2], true, &columns),
        (">c16", &[3, 2], false, &doubles),
        ("<c8", &[1, 3, 2], false, &rows),
        ("<c8", &[1, 1, 3, 2, 1], false, &rows),
        ("<c8", &[1, 3, 2], true, &columns),
        ("<f4", &[2, 3, 2], false, &apart),
        ("<f4", &[3, 2, 2], false, &rows),
    ] {
        let found = folder.picture("a.npy", &npy(kind, shape, fortran, data)).expect(kind);
        assert_eq!(found, (2, 3, Values::Complex(values())), "{kind} {shape:?} {fortran}");
    }
    for (kind, shape, word) in [
        ("<c8", &[4, 3, 2][..], "holds 4 or more pictures"),
        ("<c8", &[6], "height × width"),
        ("<c8", &[0, 2], "no values"),
        ("|O8", &[3, 2], "values of type"),
        ("<c8", &[1 << 40, 1 << 40], "truncated"),
    ] {
        let data = vec![0; 24 * 8];
        let said = folder.picture("a.npy", &npy(kind, shape, false, &data)).expect_err(word).to_string();
        assert!(said.contains(word) && !said.contains('\n'), "{said}");
    }
    let whole = npy("<c8", &[3, 2], false, &rows);
    for cut in 0..whole.len() {
        assert!(folder.picture("a.npy", &whole[..cut]).is_err(), "{cut}");
    }
}

#[test]
fn arrays_of_an_archive_are_named_and_listed() {
    let folder = Folder::new();
    let path = folder.0.path().join("a.npz");
    let write = |names: &[&str]| {
        npy_zip::write(&path, |npz| {
            npz.doubles("wavelength", &[], &[532e-9])?;
            names.iter().try_for_each(|name| npz.array(name, "<c8", &[3, 2], |put| put(&bytes_of(&values()))))
        })
        .expect("write");
    };
    write(&["field"]);
    assert_eq!(read(&path).expect("the only one").values, Values::Complex(values()));
    write(&["u", "v"]);
    let said = read(&path).expect_err("two").to_string();
    assert!(said.contains("u (3×2 <c8), v (3×2 <c8); name one, such as a.npz:u"), "{said}");
    let named = |name: &str| read(&folder.0.path().join(format!("a.npz:{name}")));
    assert_eq!(named("v").expect("v").values, Values::Complex(values()));
    assert!(named("w").unwrap_err().to_string().contains("has no `w`; there is"));
    assert!(npz_holds(&path, "u") && !npz_holds(&path, "views"));
}

fn element(kind: u32, bytes: &[u8]) -> Vec<u8> {
    let mut out = [kind, bytes.len() as u32].map(u32::to_le_bytes).concat();
    out.extend(bytes);
    out.resize(out.len().next_multiple_of(8), 0);
    out
}

/// A matrix as MATLAB stores it; doubles that are whole numbers as bytes, a short name in a short element.
fn matrix(name: &str, class: u32, sides: [u32; 2], parts: &[(u32, Vec<u8>)]) -> Vec<u8> {
    let complex = if parts.len() == 2 { 0x0800 } else { 0 };
    let mut inside = element(6, &[class | complex, 0].map(u32::to_le_bytes).concat());
    inside.extend(element(5, &sides.map(u32::to_le_bytes).concat()));
    if name.len() <= 4 {
        inside.extend((1 | (name.len() as u32) << 16).to_le_bytes());
        inside.extend(format!("{name:\0<4}").into_bytes());
    } else {
        inside.extend(element(1, name.as_bytes()));
    }
    parts.iter().for_each(|(kind, bytes)| inside.extend(element(*kind, bytes)));
    element(14, &inside)
}

fn mat(elements: &[Vec<u8>]) -> Vec<u8> {
    let mut out = vec![b' '; 124];
    out.extend([0, 1]);
    out.extend(b"IM");
    elements.iter().for_each(|bytes| out.extend(bytes));
    out
}

#[test]
fn matlab_files_packed_or_not_give_their_variables() {
    let folder = Folder::new();
    let real = by_columns().iter().flat_map(|u| f64::from(u.re).to_le_bytes()).collect();
    let imaginary = by_columns().iter().flat_map(|u| f64::from(u.im).to_le_bytes()).collect();
    let field = matrix("U", 6, [3, 2], &[(9, real), (9, imaginary)]);
    let lambda = matrix("lambda", 6, [1, 1], &[(9, 532e-9f64.to_le_bytes().to_vec())]);
    let small = matrix("whole_doubles", 6, [3, 2], &[(2, vec![0, 2, 4, 1, 3, 5])]);
    let packed = |bytes: &[u8]| {
        let mut zip = ZlibEncoder::new(Vec::new(), Compression::default());
        zip.write_all(bytes).expect("pack");
        let bytes = zip.finish().expect("pack");
        [[15, bytes.len() as u32].map(u32::to_le_bytes).concat(), bytes].concat()
    };
    for all in [vec![lambda.clone(), field.clone()], vec![packed(&lambda), packed(&field)]] {
        // Numbers without a second side are no picture.
        assert_eq!(folder.picture("a.mat", &mat(&all)).expect("U"), (2, 3, Values::Complex(values())));
    }
    let path = folder.file("a.mat", &mat(&[field.clone(), packed(&small)]));
    let said = read(&path).expect_err("two").to_string();
    assert!(said.contains("U (3×2 complex), whole_doubles (3×2 double); name one, such as a.mat:U"), "{said}");
    let found = read(&folder.0.path().join("a.mat:whole_doubles")).expect("doubles");
    assert_eq!(found.values, Values::Real((0..6).map(f64::from).collect()));
    let whole = mat(&[packed(&field)]);
    for cut in 0..whole.len() {
        assert!(folder.picture("a.mat", &whole[..cut]).is_err(), "{cut}");
    }
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x41;
        // Another field or an error; what matters is that it returns.
        let _ = folder.picture("a.mat", &bytes);
    }
}

#[test]
fn what_is_written_is_read() {
    let folder = Folder::new();
    let complex = Values::Complex(values());
    let real = Values::Real(vec![0.5, 1.5, -2.0, 3.0, 4.0, 5.0]);
    let whole = [Values::Whole(vec![0, 1, 2, 3, 4, 255]), Values::Whole(vec![0, 1, 2, 3, 4, 65535])];
    for (name, values) in [
        ("a.npy", &complex),
        ("a.mat", &complex),
        ("a.h5", &complex),
        ("a.npy", &real),
        ("a.mat", &real),
        ("a.h5", &real),
        ("a.tif", &real),
        ("a.npy", &whole[0]),
        ("a.mat", &whole[0]),
        ("a.h5", &whole[0]),
        ("a.tif", &whole[0]),
        ("a.npy", &whole[1]),
        ("a.mat", &whole[1]),
        ("a.h5", &whole[1]),
        ("a.tif", &whole[1]),
    ] {
        let path = folder.0.path().join(name);
        let written = write(&path, &[Named { name: "U", shape: [3, 2], values }]);
        if cfg!(not(feature = "tiff")) && name == "a.tif" {
            assert!(written.is_err());
            continue;
        }
        written.expect(name);
        assert_eq!(read(&path).expect(name).picture(&path).expect(name), (2, 3, values.clone()), "{name}");
    }
    let path = folder.0.path().join("b.tif");
    assert!(write(&path, &[Named { name: "U", shape: [3, 2], values: &complex }]).is_err() && !path.exists());
}

#[test]
fn names_behind_colons_belong_to_files_of_arrays() {
    let split = |text: &str| split(Path::new(text));
    assert_eq!(split("/no/lab.mat:U"), ("/no/lab.mat".into(), Some("U".into())));
    assert_eq!(split("/no/run.h5:/scan/field"), ("/no/run.h5".into(), Some("/scan/field".into())));
    assert_eq!(split("C:/no/a.npz:u"), ("C:/no/a.npz".into(), Some("u".into())));
    for whole in ["/no/a.mat", "C:/no/a.npy", "a.mat:", "near.png@-1mm"] {
        assert_eq!(split(whole), (whole.into(), None));
    }
}

/// An object of HDF5 with these messages.
fn object(messages: &[(u8, Vec<u8>)]) -> Vec<u8> {
    let mut inside = Vec::new();
    for (kind, bytes) in messages {
        inside.push(*kind);
        inside.extend((bytes.len() as u16).to_le_bytes());
        inside.push(0);
        inside.extend(bytes);
    }
    let mut out = b"OHDR\x02\x01".to_vec();
    out.extend((inside.len() as u16).to_le_bytes());
    out.extend(inside);
    out.extend([0; 4]);
    out
}

/// A file with one array of complex numbers of these sides, named `U`: whole, or in chunks of 2 × 2 that are packed.
fn hdf5(sides: [u64; 2], data: &[u8], in_chunks: bool) -> Vec<u8> {
    let long = |values: &[u64]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let float = [0x11, 0x20, 0x1f, 0, 4, 0, 0, 0, 0, 0, 32, 0, 23, 8, 0, 23, 127, 0, 0, 0];
    let kind = [&[0x36, 2, 0, 0, 8, 0, 0, 0, b'r', 0, 0][..], &float, b"i\0\x04", &float].concat();
    let space = [vec![2, 2, 0, 1], long(&sides)].concat();
    let link = |address: u64| [vec![1, 0, 1, b'U'], long(&[address])].concat();
    let root = 48;
    let at = root + object(&[(6, link(0))]).len() as u64;
    let mut chunks: Vec<(u64, u64, Vec<u8>)> = Vec::new();
    for (row, column) in [(0, 0), (0, 2), (2, 0), (2, 2)] {
        if !in_chunks || row >= sides[0] || column >= sides[1] {
            continue;
        }
        let mut plain = [0; 32];
        for (r, c) in
            [(0, 0), (0, 1), (1, 0), (1, 1)].into_iter().filter(|(r, c)| row + r < sides[0] && column + c < sides[1])
        {
            let from = ((row + r) * sides[1] + column + c) as usize * 8;
            plain[(r * 2 + c) as usize * 8..][..8].copy_from_slice(&data[from..from + 8]);
        }
        let shuffled: Vec<u8> = (0..32).map(|i| plain[i % 4 * 8 + i / 4]).collect();
        let mut zip = ZlibEncoder::new(Vec::new(), Compression::default());
        zip.write_all(&shuffled).expect("pack");
        chunks.push((row, column, zip.finish().expect("pack")));
    }
    let shuffle_and_deflate = vec![2, 2, 2, 0, 0, 0, 1, 0, 8, 0, 0, 0, 1, 0, 0, 0, 1, 0, 6, 0, 0, 0];
    let layout = |begin: u64| match in_chunks {
        false => [vec![3, 1], long(&[begin, data.len() as u64])].concat(),
        true => [vec![3, 2, 3], long(&[begin]), [2u32, 2, 8].map(u32::to_le_bytes).concat()].concat(),
    };
    let dataset = |begin: u64| {
        let mut all = vec![(1, space.clone()), (3, kind.clone()), (8, layout(begin))];
        all.extend(in_chunks.then(|| (11, shuffle_and_deflate.clone())));
        object(&all)
    };
    let begin = at + dataset(0).len() as u64;
    let mut stored = data.to_vec();
    if in_chunks {
        stored = [&b"TREE\x01\x00"[..], &(chunks.len() as u16).to_le_bytes(), &[255; 16]].concat();
        let mut place = begin + 24 + 40 * chunks.len() as u64;
        for (row, column, bytes) in &chunks {
            stored.extend([bytes.len() as u32, 0].map(u32::to_le_bytes).concat());
            stored.extend(long(&[*row, *column, 0, place]));
            place += bytes.len() as u64;
        }
        chunks.iter().for_each(|(.., bytes)| stored.extend(bytes));
    }
    let head = [&b"\x89HDF\r\n\x1a\n\x02\x08\x08\x00"[..], &long(&[0, u64::MAX, 0, root]), &[0; 4]].concat();
    [head, object(&[(6, link(at))]), dataset(begin), stored].concat()
}

#[test]
fn hdf5_and_matlab_of_version_7_3_whole_or_in_packed_chunks() {
    let folder = Folder::new();
    let field = Values::Complex(values());
    let matlab = |bytes: Vec<u8>| [format!("{:<512}", "MATLAB 7.3 MAT-file").into_bytes(), bytes].concat();
    for in_chunks in [false, true] {
        let plain = hdf5([3, 2], &bytes_of(&values()), in_chunks);
        let found = folder.picture("a.h5", &plain).expect("h5");
        assert_eq!(found, (2, 3, field.clone()), "chunks: {in_chunks}");
        let transposed = matlab(hdf5([2, 3], &bytes_of(&by_columns()), in_chunks));
        let path = folder.file("a.mat", &transposed);
        let found = read(&path).expect("mat");
        assert!(found.origin.contains("`U`, 3×2 complex, MATLAB's order"), "{}", found.origin);
        assert_eq!(found.picture(&path).expect("picture"), (2, 3, field.clone()), "chunks: {in_chunks}");
        for at in 0..plain.len() {
            // A file that is cut off or altered is another or an error; what matters is that it returns.
            let _ = folder.picture("a.h5", &plain[..at]);
            for flip in [0x01, 0x80] {
                let mut bytes = plain.clone();
                bytes[at] ^= flip;
                let _ = folder.picture("a.h5", &bytes);
            }
            // A length or a place that is huge.
            let mut bytes = plain.clone();
            let end = (at + 8).min(bytes.len());
            bytes[at..end].fill(0xff);
            let _ = folder.picture("a.h5", &bytes);
        }
    }
    let said = folder.picture("a.h5", b"hello").expect_err("no file").to_string();
    assert!(said.contains("not an HDF5 file") && !said.contains('\n'), "{said}");
    let several = [0; 1 << 10];
    assert!(folder.picture("a.h5", &several).is_err());
}

#[test]
fn runs_and_copies_of_lzf_unpack_to_what_is_promised() {
    // Two bytes as a run, and six more by going back two.
    let packed = [1, b'a', b'b', 4 << 5, 1];
    assert_eq!(lzf::unpack(&packed, 8).as_deref(), Some(&b"abababab"[..]));
    assert_eq!(lzf::unpack(&packed, 7), None);
    assert_eq!(lzf::unpack(&packed, 9), None);
    assert_eq!(lzf::unpack(&[1 << 5, 0], 3), None, "a copy of nothing");
    assert_eq!(lzf::unpack(&[3, b'a'], 4), None, "a run that is cut off");
}

#[cfg(feature = "exr")]
#[test]
fn renderers_depths_are_found_among_the_channels_of_an_exr() {
    use exr::prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, WritableImage as _,
        f16,
    };
    let folder = Folder::new();
    let path = folder.0.path().join("a.exr");
    // 2 rows of 3.
    let depths: Vec<f32> = (0..6).map(|i| 1.5 + i as f32).collect();
    let write = |names: &[&str], encoding: Encoding| {
        let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = names
            .iter()
            .map(|name| {
                let samples = match *name {
                    "R" => FlatSamples::F16(vec![f16::from_f32(0.25); 6]),
                    "id" => FlatSamples::U32((0..6).collect()),
                    _ => FlatSamples::F32(depths.clone()),
                };
                AnyChannel::new(*name, samples)
            })
            .collect();
        let layer = Layer::new((3, 2), LayerAttributes::named("view"), encoding, AnyChannels::sort(channels));
        Image::from_layer(layer).write().to_file(&path).expect("write");
    };
    let real = Values::Real(depths.iter().copied().map(f64::from).collect());
    for encoding in [Encoding::UNCOMPRESSED, Encoding::FAST_LOSSLESS, Encoding::SMALL_LOSSLESS] {
        write(&["R", "Z", "id"], encoding);
        let found = read(&path).expect("depths");
        assert_eq!((found.shape.as_slice(), &found.values), (&[2, 3][..], &real));
        assert!(found.origin.contains("view.Z"), "{}", found.origin);
        let named = |name: &str| read(&folder.0.path().join(format!("a.exr:{name}")));
        assert_eq!(named("view.id").expect("id").values, Values::Whole((0..6).collect()));
        assert_eq!(named("view.R").expect("R").values, Values::Real(vec![0.25; 6]));
        assert!(named("view.G").expect_err("G").to_string().contains("there is"));
    }
    write(&["R", "id"], Encoding::UNCOMPRESSED);
    assert!(read(&path).expect_err("two").to_string().contains("name one"));
    write(&["Z"], Encoding::FAST_LOSSLESS);
    let mut tiled = std::fs::read(&path).expect("bytes");
    let at = tiled.windows(9).position(|w| w == b"tiledesc\0").expect("tiles") + 13;
    tiled[at..at + 8].copy_from_slice(&[0, 1, 0, 1, 0, 1, 0, 0]);
    assert!(read(&folder.file("a.exr", &tiled)).expect_err("tiles").to_string().contains("tiles of"));
    write(&["R", "id"], Encoding::UNCOMPRESSED);
    let whole = std::fs::read(&path).expect("bytes");
    for cut in (0..whole.len() - 1).step_by(3) {
        assert!(read(&folder.file("a.exr", &whole[..cut])).is_err(), "{cut}");
    }
}
