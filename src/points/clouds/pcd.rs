//! PCD, the Point Cloud Library's files, of version 0.7: text, binary, and binary packed by LZF.

use super::{Gather, Role, Vertex};
use crate::error::{Error, Result};
use crate::field::arrays::{Class, Element, lzf};
use crate::points::Axes;
use crate::points::ply::Read;
use std::path::Path;

/// Most bytes of the head.
const MOST_HEAD: usize = 1 << 16;

/// One field of a point.
struct Column {
    role: Role,
    element: Element,
    /// Three bytes of colour in one number.
    is_packed_color: bool,
}

pub(super) fn read(path: &Path) -> Result<Read> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    let refused = |what: String| Error::input(path, what);
    let Head { columns, points: count, kind, begin, organised } =
        head(&bytes).map_err(|why| refused(format!("not a .pcd: {why}")))?;
    let data = &bytes[begin..];
    let wide: usize = columns.iter().map(|c| c.element.bytes).sum();
    let roles: Vec<Role> = columns.iter().flat_map(roles_of).collect();
    let most = match kind.as_str() {
        // A digit and a blank for each value, but for the last blank.
        "ascii" => (data.len() + 1) / (2 * columns.len()).max(1),
        "binary" => data.len() / wide.max(1),
        // What LZF makes of a byte, at most.
        _ => data.len().saturating_mul(300) / wide.max(1),
    };
    if count > most {
        return Err(refused(format!(
            "promises {count} points, more than its {} bytes can hold: truncated?",
            data.len()
        )));
    }
    let mut gather = Gather::new(&roles, count);
    match kind.as_str() {
        "ascii" => {
            let text = String::from_utf8_lossy(data);
            let lines = text.lines().filter(|line| !line.trim().is_empty()).take(count);
            let mut read = 0;
            for line in lines {
                let mut point = Vertex::new();
                let mut words = line.split_ascii_whitespace();
                for column in &columns {
                    let word = words.next().ok_or_else(|| refused(format!("point {read}: too few values")))?;
                    let number =
                        || word.parse().map_err(|_| refused(format!("point {read}: `{word:.40}` is not a number")));
                    let value: f64 = number()?;
                    // A colour is written as the float, or as the whole number that its bytes make.
                    let bits =
                        if column.element.class == Class::Float { (value as f32).to_bits() } else { value as u32 };
                    put(&gather, column, value, bits, &mut point);
                }
                gather.push(&point);
                read += 1;
            }
            if read < count {
                return Err(refused(format!("promises {count} points but ends after {read}: truncated?")));
            }
        }
        _ => {
            let unpacked = if kind == "binary" { None } else { Some(unpack(data, wide * count).map_err(refused)?) };
            for number in 0..count {
                let mut point = Vertex::new();
                let mut at = if unpacked.is_some() { 0 } else { number * wide };
                for column in &columns {
                    let own = column.element.bytes;
                    // Packed values stand field by field.
                    let value = match &unpacked {
                        Some(all) => {
                            let begin = at + number * own;
                            at += own * count;
                            &all[begin..begin + own]
                        }
                        None => {
                            at += own;
                            &data[at - own..at]
                        }
                    };
                    let bits = if own == 4 { u32::from_le_bytes([value[0], value[1], value[2], value[3]]) } else { 0 };
                    put(&gather, column, column.element.real(value), bits, &mut point);
                }
                gather.push(&point);
            }
        }
    }
    let mut read = gather.finish();
    // A picture of points before a camera: rows run down, and what is seen is away from it.
    if organised && !read.cloud.points.is_empty() && read.cloud.points.iter().all(|p| p.position.z > 0.0) {
        read.axes = Some(Axes::CAMERA);
    }
    Ok(read)
}

/// What a column gives: a colour's three parts, or itself.
fn roles_of(column: &Column) -> Vec<Role> {
    match column.is_packed_color {
        true => (0..3).map(|c| Role::Color(c, Some(255.0))).collect(),
        false => vec![column.role],
    }
}

fn put(gather: &Gather, column: &Column, value: f64, bits: u32, point: &mut Vertex) {
    if !column.is_packed_color {
        return gather.put(column.role, value, point);
    }
    for (c, shift) in [16, 8, 0].into_iter().enumerate() {
        gather.put(Role::Color(c, Some(255.0)), f64::from(bits >> shift & 255), point);
    }
}

/// What stands before the points.
struct Head {
    columns: Vec<Column>,
    points: usize,
    /// ascii, binary or binary_compressed.
    kind: String,
    /// Where the data begin.
    begin: usize,
    /// Whether the points stand in rows, as a camera's do.
    organised: bool,
}

fn head(bytes: &[u8]) -> Result<Head, String> {
    let (mut names, mut sizes, mut types, mut counts) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut points, mut at, mut organised) = (None, 0, false);
    loop {
        let rest = &bytes[at..bytes.len().min(MOST_HEAD)];
        let end = rest.iter().position(|b| *b == b'\n').ok_or("its head does not end with DATA")?;
        let line = String::from_utf8_lossy(&rest[..end]).trim().to_owned();
        at += end + 1;
        let words: Vec<String> = line.split_ascii_whitespace().map(str::to_owned).collect();
        let Some((key, values)) = words.split_first() else { continue };
        let number = |word: &String| word.parse::<usize>().map_err(|_| format!("`{word:.40}` is not a number"));
        match key.as_str() {
            "FIELDS" | "COLUMNS" => names = values.to_vec(),
            "SIZE" => sizes = values.iter().map(number).collect::<Result<_, _>>()?,
            "TYPE" => types = values.to_vec(),
            "COUNT" => counts = values.iter().map(number).collect::<Result<_, _>>()?,
            "HEIGHT" => organised = values.first().is_some_and(|rows| number(rows).is_ok_and(|rows| rows > 1)),
            "POINTS" => points = Some(number(values.first().ok_or("POINTS has no number")?)?),
            "DATA" => {
                let kind = values.first().cloned().unwrap_or_default().to_lowercase();
                if !["ascii", "binary", "binary_compressed"].contains(&kind.as_str()) {
                    return Err(format!("its data are `{kind:.40}`; ascii, binary and binary_compressed are read"));
                }
                counts.resize(names.len(), 1);
                let columns = columns(&names, &sizes, &types, &counts)?;
                let points = points.ok_or("it does not say how many points")?;
                return Ok(Head { columns, points, kind, begin: at, organised });
            }
            _ if key.starts_with('#') || ["VERSION", "WIDTH", "VIEWPOINT"].contains(&key.as_str()) => {}
            _ => return Err(format!("`{key:.40}` is not understood")),
        }
    }
}

fn columns(names: &[String], sizes: &[usize], types: &[String], counts: &[usize]) -> Result<Vec<Column>, String> {
    if names.len() != sizes.len() || names.len() != types.len() {
        return Err("its fields, sizes and types do not fit".into());
    }
    let mut out = Vec::new();
    for (((name, &bytes), kind), &count) in names.iter().zip(sizes).zip(types).zip(counts) {
        let class = match (kind.as_str(), bytes) {
            ("F", 4 | 8) => Class::Float,
            ("I", 1 | 2 | 4 | 8) => Class::Signed,
            ("U", 1 | 2 | 4 | 8) => Class::Unsigned,
            _ => return Err(format!("a field of type {kind:.8} and {bytes} bytes")),
        };
        let is_packed_color = ["rgb", "rgba"].contains(&name.as_str()) && bytes == 4 && count == 1;
        let full = if class == Class::Float { None } else { Some(if bytes == 2 { 65535.0 } else { 255.0 }) };
        let role = if count == 1 { Role::named(name, full) } else { Role::Other };
        if count > 4096 || out.len() > 4096 {
            return Err("too many fields".into());
        }
        let element = Element { class, bytes, big: false };
        out.extend((0..count).map(|_| Column { role, element, is_packed_color }));
    }
    match (0..3).all(|axis| out.iter().any(|column| column.role == Role::Position(axis))) {
        true => Ok(out),
        false => Err("its points have no x, y and z".into()),
    }
}

/// A length before and one behind packing, and what is packed.
fn unpack(data: &[u8], expected: usize) -> Result<Vec<u8>, String> {
    let word = |at: usize| data.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    let (Some(packed), Some(whole)) = (word(0), word(4)) else { return Err("its data are cut off".into()) };
    let input = data.get(8..).and_then(|rest| rest.get(..packed)).ok_or("its data are cut off")?;
    if whole != expected {
        return Err(format!("its data unpack to {whole} bytes, and {expected} are promised"));
    }
    lzf::unpack(input, whole).ok_or_else(|| "its packed data are damaged".into())
}
