//! Archives there and back, of other programs, and damaged.

use super::*;
use flate2::Compression;
use flate2::write::DeflateEncoder;

fn sample(path: &Path) {
    write(path, |npz| {
        npz.array("a", "<f2", &[2, 3], |put| {
            (0..6u16).try_for_each(|i| put(&f16::from_f32(f32::from(i)).to_le_bytes()))
        })?;
        npz.doubles("b", &[], &[0.25])?;
        npz.text("meta", "{}")
    })
    .expect("written");
}

#[test]
fn arrays_come_back_as_they_were_written() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("a.npz");
    sample(&path);
    let mut npz = Npz::open(&path).expect("opened");
    assert_eq!(npz.names().collect::<Vec<_>>(), ["a", "b", "meta"]);
    let (shape, values) = npz.doubles("a", 6).expect("read").expect("there");
    assert_eq!((shape, values), (vec![2, 3], vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]));
    assert_eq!(npz.doubles("b", 1).expect("read"), Some((vec![], vec![0.25])));
    assert!(npz.doubles("a", 5).is_err() && npz.doubles("c", 5).expect("read").is_none());
    assert!(npz.doubles("meta", 9).unwrap_err().to_string().contains("S2"));
    // The values of each array begin at a multiple of 64 bytes of its header, as NumPy has it.
    assert_eq!(npy_head::of("<f2", &[2, 3]).len() % 64, 0);
}

#[test]
fn deflated_arrays_of_either_byte_order_are_read() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("a.npz");
    let mut array = npy_head::of(">f4", &[3]);
    [1.5f32, -2.0, 3e9].iter().for_each(|v| array.extend(v.to_be_bytes()));
    let mut packed = DeflateEncoder::new(Vec::new(), Compression::default());
    packed.write_all(&array).expect("packed");
    let packed = packed.finish().expect("packed");
    let mut crc = Crc::new();
    crc.update(&array);
    let entry = Entry {
        name: "x.npy".into(),
        offset: 0,
        packed: packed.len() as u64,
        size: array.len() as u64,
        crc: crc.sum(),
        deflated: true,
    };
    let method = |mut record: Vec<u8>, at: usize| {
        record[at] = 8;
        record
    };
    let mut file = method(entry.local(), 8);
    file.extend(packed);
    let (begin, central) = (file.len() as u32, method(entry.central(), 10));
    file.extend(&central);
    file.extend([&END.to_le_bytes()[..], &[0; 4], &[1, 0, 1, 0]].concat());
    file.extend([&(central.len() as u32).to_le_bytes()[..], &begin.to_le_bytes(), &[0; 2]].concat());
    std::fs::write(&path, &file).expect("file");
    let mut npz = Npz::open(&path).expect("opened");
    assert_eq!(npz.doubles("x", 3).expect("read").expect("there").1, [1.5, -2.0, 3e9]);
}

#[test]
fn damage_anywhere_is_one_clear_refusal() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("a.npz");
    sample(&path);
    let whole = std::fs::read(&path).expect("bytes");
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("file");
        let mut npz = Npz::open(&path)?;
        let found = npz.doubles("a", 100)?;
        Ok::<_, Error>(found)
    };
    let expected = read(&whole).expect("whole");
    for length in (0..whole.len()).step_by(7) {
        let refused = read(&whole[..length]).expect_err("cut off").to_string();
        assert!(refused.contains("a.npz") && !refused.contains('\n'), "{refused}");
    }
    // A flipped bit is refused, or lies where nothing is read.
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x55;
        if let Ok(found) = read(&bytes) {
            assert!(found.is_none() || found == expected, "a flipped byte {at} changed the values");
        }
    }
}
