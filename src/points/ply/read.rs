//! PLY in.

use super::Read;
use super::header::{self, Element, Encoding, Scalar};
use crate::error::{Error, Result};
use crate::points::gather::{Gather, Role, Vertex};
use std::fs::File;
use std::io::{BufRead, BufReader, Read as _};
use std::path::Path;

/// Reads a point cloud.
///
/// # Errors
/// [`Error::Input`] when the file is not PLY, promises more points than it has, or has no position. Points that are not finite
/// are left out, colours outside their range clamped, with a warning each.
pub fn read(path: &Path) -> Result<Read> {
    let file = File::open(path).map_err(Error::io(path))?;
    let length = file.metadata().map_err(Error::io(path))?.len();
    let mut input = BufReader::with_capacity(1 << 20, file);
    let header = header::read(&mut input, path)?;
    let mut out = Read::default();
    for comment in &header.comments {
        if let Some(json) = comment.strip_prefix("holodrive ") {
            match serde_json::from_str(json) {
                Ok(metadata) => out.metadata = Some(metadata),
                Err(e) => out.warnings.push(format!("its holodrive comment is not understood and is ignored: {e}")),
            }
        }
    }
    let Some(at) = header.elements.iter().position(|e| e.name == "vertex") else {
        return Err(Error::input(path, "has no `vertex` element, so no points"));
    };
    let mut values = Values { input, encoding: header.encoding, path, item: 0, line: Vec::new() };
    for element in &header.elements[..at] {
        // Elements before the points (OpenHolo's `color 1 / int channel`) are read over; an item without values takes no byte,
        // and none of a line's is empty.
        if element.count > length {
            let what =
                format!("promises {} of `{}`, more than its {length} bytes can hold", element.count, element.name);
            return Err(Error::input(path, what));
        }
        for _ in 0..element.count {
            values.next_item(element, &mut |_, _| {})?;
        }
    }
    let element = &header.elements[at];
    // A count that the file's length cannot hold is refused before memory is taken for it: every value takes a byte
    // at least, in ASCII one digit and one separator.
    let smallest: u64 = match header.encoding {
        Encoding::Ascii => 2 * element.properties.len() as u64,
        _ => element.properties.iter().map(|p| p.list_count.unwrap_or(p.scalar).size() as u64).sum(),
    };
    if element.count.saturating_mul(smallest.max(1)) > length + 1 {
        let what = format!("promises {} points, more than its {length} bytes can hold: truncated?", element.count);
        return Err(Error::input(path, what));
    }
    vertices(element, &mut values, &mut out)?;
    if let Some(faces) = header.elements[at + 1..].iter().find(|e| e.name == "face" && e.count > 0) {
        let count = faces.count;
        out.warnings.push(format!(
            "its {count} faces are left out: points are not lit or hidden; a mesh is .gltf, .obj or .stl"
        ));
    }
    Ok(out)
}

fn role(name: &str, scalar: Scalar) -> Role {
    // Whole numbers of colours run to 255 (or 65535).
    let full = match scalar {
        s if s.is_float() => None,
        Scalar::U16 | Scalar::I16 => Some(65535.0),
        _ => Some(255.0),
    };
    Role::named(name, full)
}

fn vertices(element: &Element, values: &mut Values, out: &mut Read) -> Result<()> {
    let path = values.path;
    let of = |p: &super::header::Property| match p.list_count {
        Some(_) => Role::Other,
        None => role(&p.name, p.scalar),
    };
    let roles: Vec<Role> = element.properties.iter().map(of).collect();
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        if !roles.contains(&Role::Position(axis)) {
            let packed = element.properties.iter().any(|p| p.name == "packed_position");
            let hint = if packed { ": splats as SuperSplat packs them; export them as a plain PLY" } else { "" };
            return Err(Error::input(path, format!("its vertices have no `{name}`{hint}")));
        }
    }
    let mut gather = Gather::new(&roles, element.count as usize);
    for index in 0..element.count {
        let mut point = Vertex::new();
        values.item = index;
        values.next_item(element, &mut |property, value| gather.put(roles[property], value, &mut point))?;
        gather.push(&point);
    }
    let read = gather.finish();
    out.warnings.extend(read.warnings);
    (out.cloud, out.origin) = (read.cloud, read.origin);
    Ok(())
}

/// The values after the head, item by item.
struct Values<'a> {
    input: BufReader<File>,
    encoding: Encoding,
    path: &'a Path,
    /// Number of the item that is being read, for messages.
    item: u64,
    line: Vec<u8>,
}

impl Values<'_> {
    fn next_item(&mut self, element: &Element, take: &mut dyn FnMut(usize, f64)) -> Result<()> {
        match self.encoding {
            Encoding::Ascii => self.next_line(element, take),
            _ => self.next_binary(element, take),
        }
    }

    fn next_binary(&mut self, element: &Element, take: &mut dyn FnMut(usize, f64)) -> Result<()> {
        for (index, property) in element.properties.iter().enumerate() {
            match property.list_count {
                None => take(index, self.scalar(property.scalar, element)?),
                Some(kind) => {
                    let count = self.scalar(kind, element)?;
                    // Lists are read over value by value: a lying count ends at the file's end, without memory.
                    for _ in 0..count.max(0.0) as u64 {
                        self.scalar(property.scalar, element)?;
                    }
                }
            }
        }
        Ok(())
    }

    fn scalar(&mut self, scalar: Scalar, element: &Element) -> Result<f64> {
        let mut bytes = [0; 8];
        self.input.read_exact(&mut bytes[..scalar.size()]).map_err(|_| self.ends(element))?;
        Ok(scalar.decode(&bytes, self.encoding))
    }

    fn next_line(&mut self, element: &Element, take: &mut dyn FnMut(usize, f64)) -> Result<()> {
        loop {
            self.line.clear();
            // 1 MiB is far beyond any line of numbers.
            let mut limited = std::io::Read::take(&mut self.input, 1 << 20);
            let read = limited.read_until(b'\n', &mut self.line).map_err(Error::io(self.path))?;
            if read == 0 {
                return Err(self.ends(element));
            }
            if !self.line.iter().all(u8::is_ascii_whitespace) {
                break;
            }
        }
        let line = String::from_utf8_lossy(&self.line);
        let mut words = line.split_ascii_whitespace();
        let mut next = || -> Result<f64> {
            let word = words.next().ok_or_else(|| {
                let what = format!("{} {}: too few values in its line", element.name, self.item);
                Error::input(self.path, what)
            })?;
            word.parse().map_err(|_| {
                let what = format!("{} {}: `{word}` is not a number", element.name, self.item);
                Error::input(self.path, what)
            })
        };
        for (index, property) in element.properties.iter().enumerate() {
            match property.list_count {
                None => take(index, next()?),
                Some(_) => {
                    for _ in 0..next()?.max(0.0) as u64 {
                        next()?;
                    }
                }
            }
        }
        Ok(())
    }

    fn ends(&self, element: &Element) -> Error {
        let what = format!("promises {} × `{}` but ends at number {}", element.count, element.name, self.item);
        Error::input(self.path, what)
    }
}
