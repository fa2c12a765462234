//! PLY in.

use super::Metadata;
use super::header::{self, Element, Encoding, Scalar};
use crate::error::{Error, Result};
use crate::points::{PointCloud, PointSource, luminance};
use glam::DVec3;
use std::fs::File;
use std::io::{BufRead, BufReader, Read as _};
use std::path::Path;

/// A file's points with what it says of itself and what had to be repaired.
#[derive(Clone, Debug, Default)]
pub struct Read {
    /// The points.
    pub cloud: PointCloud,
    /// Metadata of our own files.
    pub metadata: Option<Metadata>,
    /// Repairs and assumptions, in words.
    pub warnings: Vec<String>,
}

/// Reads a point cloud.
///
/// # Errors
/// [`Error::Input`] when the file is not PLY, promises more points than it has, has no position, or a position,
/// amplitude or phase is not finite. Colours outside their range are clamped, with a warning.
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
        // Elements before the points (OpenHolo's `color 1 / int channel`) are read over.
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
    Ok(out)
}

/// Which property a value is.
#[derive(Clone, Copy, PartialEq)]
enum Role {
    Position(usize),
    Amplitude,
    AmplitudeRgb(usize),
    Color(usize, f64),
    Phase,
    Other,
}

fn role(name: &str, scalar: Scalar) -> Role {
    // Integer colours run to 255 (or 65535), float ones to 1.
    let full = match scalar {
        s if s.is_float() => 1.0,
        Scalar::U16 | Scalar::I16 => 65535.0,
        _ => 255.0,
    };
    match name {
        "x" => Role::Position(0),
        "y" => Role::Position(1),
        "z" => Role::Position(2),
        "amplitude" => Role::Amplitude,
        "amplitude_r" => Role::AmplitudeRgb(0),
        "amplitude_g" => Role::AmplitudeRgb(1),
        "amplitude_b" => Role::AmplitudeRgb(2),
        "red" | "r" | "diffuse_red" => Role::Color(0, full),
        "green" | "g" | "diffuse_green" => Role::Color(1, full),
        "blue" | "b" | "diffuse_blue" => Role::Color(2, full),
        "phase" => Role::Phase,
        _ => Role::Other,
    }
}

fn vertices(element: &Element, values: &mut Values, out: &mut Read) -> Result<()> {
    let path = values.path;
    let roles: Vec<Role> = element
        .properties
        .iter()
        .map(|p| if p.list_count.is_some() { Role::Other } else { role(&p.name, p.scalar) })
        .collect();
    let has = |role: Role| roles.contains(&role);
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        if !has(Role::Position(axis)) {
            return Err(Error::input(path, format!("its vertices have no `{name}`")));
        }
    }
    let exact_rgb = (0..3).all(|c| has(Role::AmplitudeRgb(c)));
    let colors = roles.iter().any(|r| matches!(r, Role::Color(..)));
    let colored = exact_rgb || colors && !has(Role::Amplitude);
    let count = element.count as usize;
    let mut points = Vec::with_capacity(count);
    let mut rgb = Vec::with_capacity(if colored { count } else { 0 });
    let mut clamped = 0u64;
    for index in 0..count {
        let (mut position, mut amplitude, mut phase) = (DVec3::ZERO, 1.0, 0.0);
        let (mut exact, mut color) = ([0f64; 3], [1f64; 3]);
        values.item = index as u64;
        values.next_item(element, &mut |property, value| match roles[property] {
            Role::Position(axis) => position[axis] = value,
            Role::Amplitude => amplitude = value,
            Role::AmplitudeRgb(c) => exact[c] = value,
            Role::Color(c, full) => color[c] = value / full,
            Role::Phase => phase = value,
            Role::Other => {}
        })?;
        if !position.is_finite() {
            let what = format!("point {index}: its position is not finite; remove or repair it");
            return Err(Error::input(path, what));
        }
        let shown = if exact_rgb { exact } else { color };
        let finite = amplitude.is_finite() && phase.is_finite() && shown.iter().all(|c| c.is_finite());
        if !finite {
            return Err(Error::input(path, format!("point {index}: its amplitude, colour or phase is not finite")));
        }
        let mut triple = shown.map(|c| c as f32);
        if !exact_rgb && colored {
            let inside = triple.map(|c| c.clamp(0.0, 1.0));
            clamped += u64::from(inside != triple);
            triple = inside;
        }
        let amplitude = if colored { luminance(triple.map(|a| a * a)).sqrt() } else { amplitude as f32 };
        points.push(PointSource { position, amplitude, phase });
        if colored {
            rgb.push(triple);
        }
    }
    if clamped > 0 {
        out.warnings.push(format!("{clamped} points had a colour outside its range; it was clamped"));
    }
    // A cloud whose three amplitudes are the same everywhere is colourless.
    let gray = rgb.iter().all(|c| c[0] == c[1] && c[1] == c[2]);
    if colored && gray && !exact_rgb {
        for (point, c) in points.iter_mut().zip(&rgb) {
            point.amplitude = c[0];
        }
    }
    out.cloud = PointCloud { points, rgb: (colored && (exact_rgb || !gray)).then_some(rgb) };
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
