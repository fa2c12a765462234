//! Light against independent renderings of the same files.
//!
//! The reference pictures are not part of the repository: `HOLODRIVE_ASSETS` names a folder beside which a folder
//! `references` holds them. Without it these tests say so and return.

use holodrive::illumination::{Illumination, IlluminationSettings};
use holodrive::points::trace::{TraceSettings, Traced, trace};
use holodrive::progress::Progress;
use holodrive::scene::gltf::{LoadOptions, load};
use holodrive::scene::{Scene, SceneBvh};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

fn references() -> Option<PathBuf> {
    let folder = std::env::var_os("HOLODRIVE_ASSETS").map(|assets| PathBuf::from(assets).join("../references"));
    if folder.as_ref().is_none_or(|f| !f.is_dir()) {
        eprintln!("not run: HOLODRIVE_ASSETS does not name a folder with ../references beside it");
        return None;
    }
    folder
}

fn scene(name: &str) -> Option<Arc<Scene>> {
    Some(load(&references()?.join(name), &LoadOptions::default()).expect("reference data is whole").scene)
}

fn render(scene: &Arc<Scene>, settings: IlluminationSettings) -> Traced {
    let bvh = SceneBvh::new(scene.clone());
    let progress = Progress::new();
    let light = Illumination::new(bvh, settings, &progress).expect("reference data is whole");
    eprintln!("{:?}\nimbalance {:+.2e}", light.report(), light.report().energy.imbalance());
    let traced =
        trace(&light, &scene.cameras[0], &TraceSettings::default(), &progress).expect("reference data is whole");
    eprintln!("{:?}", traced.report);
    traced
}

/// The payload of a .npy file, and its shape and type as the header words them.
fn npy(bytes: &[u8]) -> (String, &[u8]) {
    assert_eq!(&bytes[..6], b"\x93NUMPY");
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    (String::from_utf8_lossy(&bytes[10..10 + length]).into_owned(), &bytes[10 + length..])
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    let (header, data) = npy(bytes);
    assert!(header.contains("<f4"), "{header}");
    data.chunks_exact(4).map(|c| f32::from_le_bytes([c[0], c[1], c[2], c[3]])).collect()
}

/// Masks of one byte per pixel from an .npz (a zip archive of .npy files).
fn masks(bytes: &[u8]) -> HashMap<String, Vec<bool>> {
    let short = |at: usize| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
    let long = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
    // The central directory stands at the end; its end record is 22 bytes when there is no comment.
    let end = bytes.len() - 22;
    let (count, mut at) = (short(end + 10), long(end + 16));
    let mut found = HashMap::new();
    for _ in 0..count {
        let (size, name, extra, comment, local) =
            (long(at + 20), short(at + 28), short(at + 30), short(at + 32), long(at + 42));
        let title = String::from_utf8_lossy(&bytes[at + 46..at + 46 + name]).into_owned();
        let start = local + 30 + short(local + 26) + short(local + 28);
        let plain = inflate(&bytes[start..start + size]);
        let (header, data) = npy(&plain);
        if header.contains("|b1") || header.contains("|u1") {
            found.insert(title.trim_end_matches(".npy").to_owned(), data.iter().map(|&b| b != 0).collect());
        }
        at += 46 + name + extra + comment;
    }
    found
}

/// Deflate (RFC 1951), as short as it can be read.
fn inflate(bytes: &[u8]) -> Vec<u8> {
    const LENGTH: [u16; 29] = [
        3, 4, 5, 6, 7, 8, 9, 10, 11, 13, 15, 17, 19, 23, 27, 31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227,
        258,
    ];
    const DISTANCE: [u16; 30] = [
        1, 2, 3, 4, 5, 7, 9, 13, 17, 25, 33, 49, 65, 97, 129, 193, 257, 385, 513, 769, 1025, 1537, 2049, 3073, 4097,
        6145, 8193, 12289, 16385, 24577,
    ];
    struct Bits<'a>(&'a [u8], usize);
    impl Bits<'_> {
        fn take(&mut self, n: usize) -> usize {
            (0..n).fold(0, |value, k| {
                let bit = usize::from(self.0[self.1 / 8]) >> (self.1 % 8) & 1;
                self.1 += 1;
                value | bit << k
            })
        }
        fn symbol(&mut self, lengths: &[u8]) -> usize {
            // Canonical Huffman codes, one length after another.
            let (mut code, mut first) = (0i32, 0i32);
            for length in 1..16u8 {
                code = code << 1 | self.take(1) as i32;
                first <<= 1;
                let count = lengths.iter().filter(|&&l| l == length).count() as i32;
                if code - first < count {
                    let of_length = lengths.iter().enumerate().filter(|(_, l)| **l == length);
                    return of_length.map(|(s, _)| s).nth((code - first) as usize).expect("reference data is whole");
                }
                first += count;
            }
            panic!("no such code");
        }
    }
    let (mut bits, mut out) = (Bits(bytes, 0), Vec::new());
    loop {
        let last = bits.take(1) == 1;
        let kind = bits.take(2);
        if kind == 0 {
            bits.1 = bits.1.div_ceil(8) * 8;
            let length = bits.take(16);
            bits.take(16);
            out.extend((0..length).map(|_| bits.take(8) as u8));
        } else {
            let (mut literals, mut distances) = (vec![8u8; 288], vec![5u8; 30]);
            if kind == 1 {
                literals[144..256].fill(9);
                literals[256..280].fill(7);
            } else {
                let (n, m, k) = (bits.take(5) + 257, bits.take(5) + 1, bits.take(4) + 4);
                let mut code_lengths = [0u8; 19];
                for &place in &[16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15][..k] {
                    code_lengths[place] = bits.take(3) as u8;
                }
                let mut lengths = Vec::new();
                while lengths.len() < n + m {
                    let (value, repeat) = match bits.symbol(&code_lengths) {
                        16 => (*lengths.last().expect("reference data is whole"), 3 + bits.take(2)),
                        17 => (0, 3 + bits.take(3)),
                        18 => (0, 11 + bits.take(7)),
                        length => (length as u8, 1),
                    };
                    lengths.extend(std::iter::repeat_n(value, repeat));
                }
                distances = lengths.split_off(n);
                literals = lengths;
            }
            loop {
                match bits.symbol(&literals) {
                    256 => break,
                    byte @ 0..256 => out.push(byte as u8),
                    code => {
                        let k = code - 257;
                        let extra = if (8..28).contains(&k) { (k - 4) / 4 } else { 0 };
                        let length = usize::from(LENGTH[k]) + bits.take(extra);
                        let d = bits.symbol(&distances);
                        let distance = usize::from(DISTANCE[d]) + bits.take(if d > 3 { (d - 2) / 2 } else { 0 });
                        (0..length).for_each(|_| out.push(out[out.len() - distance]));
                    }
                }
            }
        }
        if last {
            return out;
        }
    }
}

/// Mean ratio and relative RMSE of 5 × 5 block means: blocks that lie in `region` with at least half of their pixels,
/// pixels on edges left out; all colours together, weighted as they are.
fn score(picture: &[[f32; 3]], reference: &[f32], leave_out: &[bool], region: &dyn Fn(usize) -> bool) -> (f64, f64) {
    let (size, block) = (500, 5);
    let (mut ours, mut theirs, mut squares, mut theirs_squared) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for by in 0..size / block {
        for bx in 0..size / block {
            let (mut a, mut b, mut n) = ([0.0f64; 3], [0.0f64; 3], 0);
            for k in 0..block * block {
                let p = (by * block + k / block) * size + bx * block + k % block;
                if leave_out[p] || !region(p) {
                    continue;
                }
                n += 1;
                for c in 0..3 {
                    a[c] += f64::from(picture[p][c]);
                    b[c] += f64::from(reference[3 * p + c]);
                }
            }
            if 2 * n < block * block {
                continue;
            }
            for c in 0..3 {
                let (x, y) = (a[c] / f64::from(n as u32), b[c] / f64::from(n as u32));
                ours += x;
                theirs += y;
                squares += (x - y).powi(2);
                theirs_squared += y * y;
            }
        }
    }
    (ours / theirs, (squares / theirs_squared).sqrt())
}

#[test]
fn cornell_room_agrees_with_a_path_tracer() {
    let Some(scene) = scene("cornell_diffuse.gltf") else { return };
    let folder = references().expect("reference data is whole");
    let reference = floats(&std::fs::read(folder.join("cornell_diffuse_full.npy")).expect("reference data is whole"));
    let depth = floats(&std::fs::read(folder.join("cornell_diffuse_depth.npy")).expect("reference data is whole"));
    let masks = masks(&std::fs::read(folder.join("cornell_diffuse_masks.npz")).expect("reference data is whole"));
    let traced = render(&scene, IlluminationSettings::default());

    let (edge, lamp) = (&masks["edge"], &masks["light"]);
    let leave_out: Vec<bool> = edge.iter().zip(lamp).map(|(e, l)| *e || *l).collect();
    let mut figures = Vec::new();
    for (name, most) in [("all", 0.01), ("penumbra", 0.02), ("umbra", 0.03), ("lit", 0.01), ("blocks", 0.02)] {
        let mask = masks.get(name);
        let region = |p: usize| !masks["miss"][p] && mask.is_none_or(|m| m[p]);
        let (ratio, rmse) = score(&traced.picture, &reference, &leave_out, &region);
        eprintln!("{name:9} mean ratio {ratio:.4}, relative RMSE {:.2} % (most {:.0} %)", 100.0 * rmse, 100.0 * most);
        figures.push((name, ratio, rmse, most));
    }
    for (name, ratio, rmse, most) in figures {
        // A region as small as the umbra rests on few vertices of the mesh, whose noise it shares.
        let off = if name == "all" { 5e-3 } else { 1e-2 };
        assert!((ratio - 1.0).abs() <= off, "{name}: mean ratio {ratio}");
        assert!(rmse <= most, "{name}: relative RMSE {rmse}");
    }
    // Depth of matte points: nearly all within a thousandth of the reference's.
    let off =
        traced.points.iter().filter(|p| (p.distance / f64::from(depth[p.pixel as usize]) - 1.0).abs() > 1e-3).count();
    eprintln!("{} points, {off} not within 0.1 % of the reference surface", traced.points.len());
    assert!(off * 1000 <= traced.points.len());
}

#[test]
fn a_furnace_with_blocks_is_even() {
    let Some(scene) = scene("furnace_cornell.gltf") else { return };
    let traced = render(&scene, IlluminationSettings::default());
    let mut mean = [0.0f64; 3];
    for pixel in &traced.picture {
        for c in 0..3 {
            mean[c] += f64::from(pixel[c]) / traced.picture.len() as f64;
        }
    }
    eprintln!("mean {mean:?}");
    for (value, expected) in mean.into_iter().zip([1.0, 2.0 / 3.0, 0.5]) {
        assert!((value / expected - 1.0).abs() < 5e-3);
    }
    let worst = traced.picture.iter().flat_map(|p| [p[0] - 1.0, 1.5 * p[1] - 1.0, 2.0 * p[2] - 1.0]);
    let worst = worst.fold(0.0f32, |w, d| w.max(d.abs()));
    eprintln!("worst pixel {:.2} %", 100.0 * worst);
    assert!(worst < 0.02);
}
