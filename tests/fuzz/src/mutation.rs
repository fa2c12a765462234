//! Damage: to bytes, to numbers in a text, to the tree of a JSON text; and the sums that let damage past a first check.

use serde_json::{Map, Value};

/// Numbers without end from a seed: splitmix64.
pub struct Draw(pub u64);

impl Draw {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// A number below `end`, 0 where that is 0.
    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % (end.max(1) as u64)) as usize
    }
    /// One of several.
    pub fn of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }
    fn one_in(&mut self, of: usize) -> bool {
        self.below(of) == 0
    }
}

/// Numbers at the edges of what types hold.
const EDGES: [u64; 16] = [
    0,
    1,
    2,
    0x7f,
    0x80,
    0xff,
    0x7fff,
    0x8000,
    0xffff,
    0x00ff_ffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    1 << 40,
    i64::MAX as u64,
    u64::MAX,
];

/// The same as a text has them.
const WRITTEN: [&str; 20] = [
    "0",
    "-0",
    "1",
    "-1",
    "255",
    "65536",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551616",
    "1e9",
    "1e38",
    "1e39",
    "1e300",
    "1e999",
    "-1e999",
    "1e-300",
    "0.1",
    "nan",
    "inf",
];

/// How an input is to be damaged.
#[derive(Clone, Copy, PartialEq)]
pub enum Kind {
    /// Bytes only.
    Bytes,
    /// Lines and numbers of a text, too.
    Text,
    /// A JSON text: its tree, too.
    Json,
}

/// Most bytes that an input grows to.
const LONGEST: usize = 1 << 18;

/// An input made from `seed` and another, `other`.
pub fn damaged(seed: &[u8], other: &[u8], kind: Kind, draw: &mut Draw) -> Vec<u8> {
    if kind == Kind::Json
        && !draw.one_in(4)
        && let Ok(mut tree) = serde_json::from_slice::<Value>(seed)
    {
        (0..=draw.below(4)).for_each(|_| tree_damage(&mut tree, draw));
        return serde_json::to_vec(&tree).unwrap_or_default();
    }
    let mut out = seed.to_vec();
    for _ in 0..=draw.below(6) {
        if kind != Kind::Bytes && !draw.one_in(3) {
            text_damage(&mut out, draw);
        } else {
            byte_damage(&mut out, other, draw);
        }
        out.truncate(LONGEST);
    }
    out
}

/// Damages the part of packed `parts` that `draw` chooses, more often the first.
pub fn damaged_parts(parts: &[(String, &[u8])], other: &[u8], draw: &mut Draw) -> Vec<u8> {
    let chosen = if draw.one_in(2) { 0 } else { draw.below(parts.len()) };
    let made: Vec<(String, Vec<u8>)> = parts
        .iter()
        .enumerate()
        .map(|(i, (name, bytes))| {
            let kind = if name.ends_with("json") || name.ends_with("gltf") { Kind::Json } else { Kind::Bytes };
            (name.clone(), if i == chosen { damaged(bytes, other, kind, draw) } else { bytes.to_vec() })
        })
        .collect();
    crate::archive::pack(&made.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect::<Vec<_>>())
}

fn byte_damage(out: &mut Vec<u8>, other: &[u8], draw: &mut Draw) {
    let at = draw.below(out.len());
    match draw.below(9) {
        0 => out.iter_mut().skip(at).take(1).for_each(|b| *b ^= 1 << (at % 8)),
        1 => out.iter_mut().skip(at).take(1).for_each(|b| *b = draw.bits() as u8),
        2 | 3 => {
            let wide = *draw.of(&[1, 2, 4, 8]);
            let mut edge = draw.of(&EDGES).to_le_bytes();
            if draw.one_in(3) {
                edge[..wide].reverse();
            }
            // Where numbers usually stand, more often.
            let at = if draw.one_in(2) { at / wide * wide } else { at };
            out.iter_mut().skip(at).zip(&edge[..wide]).for_each(|(b, e)| *b = *e);
        }
        4 => {
            let end = (at + 1 + draw.below(16)).min(out.len());
            out.drain(at.min(end)..end);
        }
        5 => {
            let piece: Vec<u8> = out.iter().skip(at).take(1 + draw.below(64)).copied().collect();
            let to = draw.below(out.len() + 1);
            out.splice(to..to, piece);
        }
        6 => {
            let piece: Vec<u8> = (0..=draw.below(8)).map(|_| draw.bits() as u8).collect();
            out.splice(at..at, piece);
        }
        7 => out.truncate(at),
        _ => {
            let from = draw.below(other.len());
            let piece: Vec<u8> = other.iter().skip(from).take(1 + draw.below(128)).copied().collect();
            let end = (at + piece.len()).min(out.len());
            out.splice(at.min(end)..end, piece);
        }
    }
}

/// Changes a number, or a line.
fn text_damage(out: &mut Vec<u8>, draw: &mut Draw) {
    let from = draw.below(out.len());
    if draw.one_in(3) {
        let ends: Vec<usize> = (0..out.len()).filter(|i| out[*i] == b'\n').collect();
        let start = ends.iter().rev().find(|i| **i < from).map_or(0, |i| i + 1);
        let end = ends.iter().find(|i| **i >= from).map_or(out.len(), |i| i + 1).max(start);
        let line = out[start..end].to_vec();
        let times = *draw.of(&[0, 2, 2, 50]);
        let times = if line.len() * times > LONGEST { 1 } else { times };
        out.splice(start..end, line.repeat(times));
        return;
    }
    let number = |b: &u8| b.is_ascii_digit() || matches!(*b, b'.' | b'-' | b'+' | b'e');
    let Some(start) = (from..out.len()).find(|i| out[*i].is_ascii_digit()) else { return };
    let end = (start..out.len()).find(|i| !number(&out[*i])).unwrap_or(out.len());
    out.splice(start..end, draw.of(&WRITTEN).bytes());
}

/// Changes one place of a tree.
fn tree_damage(tree: &mut Value, draw: &mut Draw) {
    let places = count(tree);
    let mut chosen = draw.below(places);
    let donor = nth(tree, &mut draw.below(places)).cloned().unwrap_or(Value::Null);
    let Some(place) = nth_mut(tree, &mut chosen) else { return };
    match (place, draw.below(6)) {
        (Value::Object(map), 0..=2) if !map.is_empty() => {
            let key = map.keys().nth(draw.below(map.len())).cloned().unwrap_or_default();
            match draw.below(3) {
                0 => drop(map.remove(&key)),
                1 => drop(map.insert(key, donor)),
                _ => drop(map.insert("extensions".into(), donor)),
            }
        }
        (Value::Array(list), 0..=3) if !list.is_empty() => {
            let at = draw.below(list.len());
            match draw.below(4) {
                0 => drop(list.remove(at)),
                1 => list.insert(at, donor),
                2 => list[at] = donor,
                _ => list.swap(0, at),
            }
        }
        (Value::String(text), 0..=3) => match draw.below(4) {
            0 => text.clear(),
            1 => *text = (*draw.of(&WRITTEN)).to_owned(),
            2 => {
                let keep = text.char_indices().nth(draw.below(text.len())).map_or(0, |(i, _)| i);
                text.truncate(keep);
            }
            _ => text.push_str("../\u{7}\n\u{202e}é"),
        },
        (place @ Value::Number(_), 0..=4) => *place = number(place, draw),
        (place, _) => {
            *place = match draw.below(6) {
                0 => Value::Null,
                1 => Value::Bool(draw.one_in(2)),
                2 => Value::Array(vec![donor]),
                3 => Value::Object(Map::new()),
                4 => number(&Value::Null, draw),
                _ => donor,
            }
        }
    }
}

/// A number near the one that was there, or at an edge.
fn number(was: &Value, draw: &mut Draw) -> Value {
    match (was.as_i64(), draw.below(4)) {
        (Some(was), 0) => (was + 1).into(),
        (Some(was), 1) => was.saturating_sub(1).into(),
        (_, 2) => (*draw.of(&EDGES)).into(),
        _ => (*draw.of(&[-1.0, 0.5, 1e-30, 1e10, 1e38, 1e300, -1e300, 0.0])).into(),
    }
}

fn count(tree: &Value) -> usize {
    1 + match tree {
        Value::Object(map) => map.values().map(count).sum::<usize>(),
        Value::Array(list) => list.iter().map(count).sum(),
        _ => 0,
    }
}

fn nth<'a>(tree: &'a Value, left: &mut usize) -> Option<&'a Value> {
    if *left == 0 {
        return Some(tree);
    }
    *left -= 1;
    match tree {
        Value::Object(map) => map.values().find_map(|v| nth(v, left)),
        Value::Array(list) => list.iter().find_map(|v| nth(v, left)),
        _ => None,
    }
}

fn nth_mut<'a>(tree: &'a mut Value, left: &mut usize) -> Option<&'a mut Value> {
    if *left == 0 {
        return Some(tree);
    }
    *left -= 1;
    match tree {
        Value::Object(map) => map.values_mut().find_map(|v| nth_mut(v, left)),
        Value::Array(list) => list.iter_mut().find_map(|v| nth_mut(v, left)),
        _ => None,
    }
}

/// Makes the sums of a PNG's chunks right again.
pub fn mend_png(png: &mut [u8]) {
    let mut at = 8;
    while let Some(head) = png.get(at..at + 8) {
        let long = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let Some(end) = at.checked_add(8 + long).filter(|end| end + 4 <= png.len()) else { return };
        let sum = crc32(&png[at + 4..end]).to_be_bytes();
        png[end..end + 4].copy_from_slice(&sum);
        at = end + 4;
    }
}

/// Makes the lengths of a GLB's head and chunks right again, as far as they fit.
pub fn mend_glb(glb: &mut [u8]) {
    let whole = glb.len() as u32;
    if let Some(length) = glb.get_mut(8..12) {
        length.copy_from_slice(&whole.to_le_bytes());
    }
    let Some(first) = glb.get(12..16) else { return };
    let json = u32::from_le_bytes([first[0], first[1], first[2], first[3]]) as usize;
    let at = json.saturating_add(20);
    let rest = whole.saturating_sub(at as u32 + 8);
    if let Some(length) = glb.get_mut(at..at.saturating_add(4)) {
        length.copy_from_slice(&rest.to_le_bytes());
    }
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |s, _| if s & 1 == 1 { (s >> 1) ^ 0xedb8_8320 } else { s >> 1 })
    })
}
