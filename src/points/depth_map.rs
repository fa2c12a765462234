//! Depth maps: gray pictures between two ends, and what depth cameras and renderers measure.
//!
//! *Gray*: white is near and black is far, or the other way round, linear over the whole scale. *Measured*: numbers are
//! distances from the camera in a unit; 0, what is not finite and what lies outside a range was not measured, and is left
//! out; nearest and farthest of what is left stand at the placement's ends.

use crate::error::{Error, Result};
use crate::field::arrays::{self, Values};
use crate::files::pictures;
use crate::names::{Name, Named};
use crate::units::show_length;
use serde::{Deserialize, Serialize};
use std::io::Read;
use std::path::Path;

/// Part of a scale below which so little depth is left that a user should know.
const LEAST_USED: f64 = 0.1;
/// Most pixels of a map.
const MOST: u64 = 1 << 28;
/// Distance from which on a renderer means that nothing was hit [m]: Blender writes 10¹⁰.
const NOTHING: f64 = 1e9;

/// Which end of the depth map's gray scale is near.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DepthScale {
    /// White is near, black is far (OpenHolo, tensor holography).
    #[default]
    WhiteNear,
    /// Black is near, white is far.
    BlackNear,
}

impl Named for DepthScale {
    const KIND: &'static str = "depth scale";
    const NAMES: &'static [Name<Self>] =
        &[("white-near", || Self::WhiteNear, "white is near"), ("black-near", || Self::BlackNear, "black is near")];
}

/// How a depth map is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DepthReading {
    /// Which end of the scale is near; of numbers whether the greater is nearer. By default white, and the smaller distance.
    pub scale: Option<DepthScale>,
    /// Length of one step of the map's numbers [m]: they are distances.
    pub unit: Option<f64>,
    /// Distances that stand at the near and the far end [m]; what lies outside is left out. By default what was measured.
    pub range: Option<[f64; 2]>,
}

/// Where each pixel stands between the near and the far end.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// 0 at the near end, 1 at the far one, NaN where nothing was measured; row by row.
    pub parts: Vec<f32>,
    /// Pixels without measurement.
    pub unmeasured: usize,
    /// How it was read, in words.
    pub origin: String,
    /// What a user should know.
    pub warnings: Vec<String>,
}

/// Numbers of a map as they stand in the file.
enum Raw {
    /// Gray values of so many bits.
    Gray { bits: u8, values: Vec<u16> },
    /// Floats.
    Numbers(Vec<f64>),
}

impl DepthMap {
    /// Reads a gray picture of 8 or 16 bits, a TIFF, EXR or `.npy` of numbers, a `.pfm` or a `.dpt` (Sintel's, `PIEH`).
    ///
    /// Floats are distances in metres. So are the numbers of a 16-bit map in its unit, and of one whose black is near that uses
    /// less than a tenth of its scale, as those of depth cameras do.
    ///
    /// # Errors
    /// [`Error::Input`] for what is none of these, and for a map without any measurement; [`Error::Parameter`] for a range
    /// without a unit, or one that is not in order.
    pub fn read(path: &Path, reading: &DepthReading) -> Result<Self> {
        let (width, height, raw) = read_raw(path)?;
        if let Some([near, far]) = reading.range
            && !(near >= 0.0 && far > near)
        {
            let what = format!("{} to {}: the first must be less than the second", show_length(near), show_length(far));
            return Err(Error::parameter("depth range", what));
        }
        let black_near = reading.scale == Some(DepthScale::BlackNear);
        match raw {
            Raw::Gray { bits, values } => {
                let (used, ends) = used(&values, bits);
                if reading.unit.is_none() && reading.range.is_some() {
                    let what =
                        "is in metres, and the map's whole numbers have no unit; give the depth unit, such as 1mm";
                    return Err(Error::parameter("depth range", what));
                }
                let is_camera = bits == 16 && black_near && used < LEAST_USED && ends[0] > 0;
                if reading.unit.is_some() || is_camera {
                    let unit = reading.unit.unwrap_or(1e-3);
                    let numbers = values.into_iter().map(|v| f64::from(v) * unit).collect();
                    let mut map = Self::measured(path, [width, height], numbers, reading)?;
                    if reading.unit.is_none() {
                        map.origin = format!(
                            "values {} to {} use {:.1} % of the scale: taken as measured, 0 as not measured",
                            ends[0],
                            ends[1],
                            100.0 * used
                        );
                    }
                    return Ok(map);
                }
                let mut warnings = Vec::new();
                if used < LEAST_USED && ends[1] > ends[0] {
                    warnings.push(format!(
                        "{}: its values {} to {} use {:.1} % of the scale from near to far; if they are distances, give their \
                         depth unit",
                        path.display(),
                        ends[0],
                        ends[1],
                        100.0 * used
                    ));
                }
                let part = |gray: u16| {
                    let gray = f32::from(gray) / 65535.0;
                    if black_near { gray } else { 1.0 - gray }
                };
                // A step of 8 bits is 257 of 16.
                let step = if bits == 8 { 257 } else { 1 };
                let parts = values.into_iter().map(|v| part(v * step)).collect();
                let origin = format!("gray of {bits} bits, {} is near", if black_near { "black" } else { "white" });
                Ok(Self { width, height, parts, unmeasured: 0, origin, warnings })
            }
            Raw::Numbers(mut numbers) => {
                let unit = reading.unit.unwrap_or(1.0);
                numbers.iter_mut().for_each(|v| *v *= unit);
                Self::measured(path, [width, height], numbers, reading)
            }
        }
    }

    /// The map with as many pixels as its picture, where both have one shape: each takes what stands nearest.
    ///
    /// # Errors
    /// [`Error::Input`] where they have not.
    pub(super) fn on(mut self, path: &Path, [width, height]: [u32; 2]) -> Result<Self> {
        if (self.width, self.height) == (width, height) {
            return Ok(self);
        }
        let [w, h] = [self.width, self.height];
        // Equal shapes agree to a pixel of the smaller.
        let is_alike = |a: u32, b: u32, c: u32, d: u32| {
            (f64::from(a) * f64::from(b) - f64::from(c) * f64::from(d)).abs() <= f64::from(a.max(c).max(b).max(d))
        };
        if !is_alike(w, height, h, width) || w.min(h) < 8 {
            let what =
                format!("{w}×{h} pixels, but its picture has {width}×{height}; they must be equal, or of one shape");
            return Err(Error::input(path, what));
        }
        let at = |i: u32, from: u32, to: u32| ((u64::from(i) * 2 + 1) * u64::from(from) / (2 * u64::from(to))) as usize;
        let columns: Vec<usize> = (0..width).map(|column| at(column, w, width)).collect();
        let rows = (0..height).map(|row| at(row, h, height) * w as usize);
        self.parts =
            rows.flat_map(|row| columns.iter().map(move |column| row + column)).map(|i| self.parts[i]).collect();
        self.unmeasured = self.parts.iter().filter(|part| part.is_nan()).count();
        self.origin += &format!("; {w}×{h} on the picture's {width}×{height}");
        (self.width, self.height) = (width, height);
        Ok(self)
    }

    fn measured(path: &Path, [width, height]: [u32; 2], numbers: Vec<f64>, reading: &DepthReading) -> Result<Self> {
        let is_inside =
            |d: f64| d > 0.0 && d < NOTHING && reading.range.is_none_or(|[near, far]| (near..=far).contains(&d));
        let inside = || numbers.iter().copied().filter(|d| is_inside(*d));
        let [least, most] = [inside().fold(f64::INFINITY, f64::min), inside().fold(0.0, f64::max)];
        if least > most {
            let what = match reading.range {
                Some([near, far]) => {
                    format!(
                        "no pixel has a depth from {} to {}; give its unit and range",
                        show_length(near),
                        show_length(far)
                    )
                }
                None => "no pixel has a depth above zero".to_owned(),
            };
            return Err(Error::input(path, what));
        }
        let [near, far] = reading.range.unwrap_or([least, most]);
        let mut warnings = Vec::new();
        if reading.range.is_some() && most - least < LEAST_USED * (far - near) {
            warnings.push(format!(
                "{}: its depths from {} to {} use {:.1} % of the range from {} to {}",
                path.display(),
                show_length(least),
                show_length(most),
                100.0 * (most - least) / (far - near),
                show_length(near),
                show_length(far)
            ));
        }
        let greater_near = reading.scale == Some(DepthScale::WhiteNear);
        let part = |d: f64| {
            if !is_inside(d) {
                return f32::NAN;
            }
            let part = if far > near { ((d - near) / (far - near)) as f32 } else { 0.0 };
            if greater_near { 1.0 - part } else { part }
        };
        let parts: Vec<f32> = numbers.iter().map(|d| part(*d)).collect();
        let unmeasured = parts.iter().filter(|part| part.is_nan()).count();
        let origin = format!("measured from {} to {}", show_length(least), show_length(most));
        Ok(Self { width, height, parts, unmeasured, origin, warnings })
    }
}

/// Part of the scale between the least value above zero and the greatest, and both.
fn used(values: &[u16], bits: u8) -> (f64, [u16; 2]) {
    let most = values.iter().copied().max().unwrap_or(0);
    let least = values.iter().copied().filter(|v| *v > 0).min().unwrap_or(0);
    let white = if bits == 8 { 255.0 } else { 65535.0 };
    (f64::from(most - least) / white, [least, most])
}

fn read_raw(path: &Path) -> Result<(u32, u32, Raw)> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "pfm" => portable(path),
        "dpt" => sintel(path),
        _ if arrays::is_array_file(path) => {
            let array = arrays::read(path)?;
            let (width, height, values) = array.picture(path)?;
            let raw = match values {
                Values::Real(values) => Raw::Numbers(values),
                Values::Whole(values) => {
                    let most = values.iter().copied().max().unwrap_or(0);
                    if let Some(i) = values.iter().position(|v| !(0..=65535).contains(v)) {
                        let what =
                            format!("value {} at row {}, column {}: 0 to 65535", values[i], i / width, i % width);
                        return Err(Error::input(path, what));
                    }
                    let bits = if most > 255 { 16 } else { 8 };
                    Raw::Gray { bits, values: values.into_iter().map(|v| v as u16).collect() }
                }
                Values::Complex(_) => return Err(Error::input(path, "has complex values; depths are real")),
            };
            Ok((width as u32, height as u32, raw))
        }
        _ => {
            let picture = pictures::open(path)?;
            let (width, height) = (picture.width(), picture.height());
            let wide = picture.color().bits_per_pixel() / u16::from(picture.color().channel_count()) > 8;
            let raw = if wide {
                Raw::Gray { bits: 16, values: picture.into_luma16().into_raw() }
            } else {
                Raw::Gray { bits: 8, values: picture.into_luma8().into_raw().into_iter().map(u16::from).collect() }
            };
            Ok((width, height, raw))
        }
    }
}

/// The floats of a file whose length fits its sides.
fn floats(path: &Path, bytes: &[u8], [width, height]: [u64; 2], big: bool) -> Result<Vec<f64>> {
    let count = width.checked_mul(height).filter(|n| (1..=MOST).contains(n));
    if count.is_none_or(|n| 4 * n > bytes.len() as u64) {
        return Err(Error::input(
            path,
            format!("promises {width}×{height} floats, and has {} bytes: truncated?", bytes.len()),
        ));
    }
    let number = |b: &[u8]| {
        let b = [b[0], b[1], b[2], b[3]];
        f64::from(if big { f32::from_be_bytes(b) } else { f32::from_le_bytes(b) })
    };
    Ok(bytes.chunks_exact(4).take((width * height) as usize).map(number).collect())
}

fn whole(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(Error::io(path))?;
    file.take(4 * MOST + 4096).read_to_end(&mut bytes).map_err(Error::io(path))?;
    Ok(bytes)
}

/// Portable float map: `Pf`, sides, a scale whose sign says the byte order, rows from the bottom.
fn portable(path: &Path) -> Result<(u32, u32, Raw)> {
    let bytes = whole(path)?;
    let refused = || Error::input(path, "not a gray .pfm: it begins with `Pf`, its sides and a scale");
    let (mut words, mut at) = (Vec::new(), 0);
    while words.len() < 4 {
        let begin = at + bytes[at.min(bytes.len())..].iter().take_while(|b| b.is_ascii_whitespace()).count();
        let length = bytes[begin.min(bytes.len())..].iter().take(32).take_while(|b| !b.is_ascii_whitespace()).count();
        if length == 0 {
            return Err(refused());
        }
        words.push(std::str::from_utf8(&bytes[begin..begin + length]).map_err(|_| refused())?);
        at = begin + length;
    }
    let [kind, width, height, scale] = words[..] else { return Err(refused()) };
    let (Ok(width), Ok(height), Ok(scale)) = (width.parse::<u32>(), height.parse::<u32>(), scale.parse::<f64>()) else {
        return Err(refused());
    };
    if kind != "Pf" {
        return Err(refused());
    }
    // One separator stands behind the scale.
    let values = floats(path, bytes.get(at + 1..).unwrap_or_default(), [width.into(), height.into()], scale > 0.0)?;
    let rows = values.chunks_exact(width as usize).rev().flatten().copied().collect();
    Ok((width, height, Raw::Numbers(rows)))
}

/// Sintel's depth: the float 202021.25, sides, floats.
fn sintel(path: &Path) -> Result<(u32, u32, Raw)> {
    let bytes = whole(path)?;
    let side = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let (true, Some(width), Some(height)) = (bytes.starts_with(b"PIEH"), side(4), side(8)) else {
        return Err(Error::input(path, "not a .dpt: it does not begin with `PIEH` and its sides"));
    };
    let values = floats(path, &bytes[12..], [width.into(), height.into()], false)?;
    Ok((width, height, Raw::Numbers(values)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 6 × 2 pixels: no measurement, 600, 600, 900, 1500, 1500.
    const ROW: [u16; 6] = [0, 600, 600, 900, 1500, 1500];

    fn parts(map: &DepthMap) -> Vec<Option<f32>> {
        map.parts[..6].iter().map(|p| (!p.is_nan()).then_some((p * 1000.0).round() / 1000.0)).collect()
    }

    #[test]
    fn a_camera_s_millimetres_in_each_kind_of_file() {
        let folder = tempfile::tempdir().expect("folder");
        let at = |name: &str| folder.path().join(name);
        let gray = image::ImageBuffer::<image::Luma<u16>, _>::from_fn(6, 2, |x, _| image::Luma([ROW[x as usize]]));
        gray.save(at("d.png")).expect("png");
        let metres: Vec<f32> = (0..12).map(|i| f32::from(ROW[i % 6]) * 1e-3).collect();
        let bytes = || metres.iter().flat_map(|v| v.to_le_bytes());
        let dpt: Vec<u8> = b"PIEH\x06\0\0\0\x02\0\0\0".iter().copied().chain(bytes()).collect();
        std::fs::write(at("d.dpt"), dpt).expect("dpt");
        let pfm: Vec<u8> = b"Pf\n6 2\n-1.0\n".iter().copied().chain(bytes()).collect();
        std::fs::write(at("d.pfm"), pfm).expect("pfm");
        crate::field::npy::write_intensity(&at("d.npy"), 6, 2, &metres).expect("npy");
        let expected = [None, Some(0.0), Some(0.0), Some(0.333), Some(1.0), Some(1.0)];
        let black = DepthReading { scale: Some(DepthScale::BlackNear), ..DepthReading::default() };
        let in_mm = DepthReading { unit: Some(1e-3), ..DepthReading::default() };
        for (name, reading) in [
            ("d.png", black),
            ("d.png", in_mm),
            ("d.npy", DepthReading::default()),
            ("d.pfm", black),
            ("d.dpt", DepthReading::default()),
        ] {
            let map = DepthMap::read(&at(name), &reading).expect(name);
            assert_eq!(parts(&map), expected, "{name}");
            assert_eq!((map.unmeasured, map.width, map.height), (2, 6, 2));
        }
        let reading = DepthReading { range: Some([0.5, 1.0]), ..in_mm };
        let map = DepthMap::read(&at("d.png"), &reading).expect("range");
        assert_eq!(parts(&map), [None, Some(0.2), Some(0.2), Some(0.8), None, None]);
        let nearer = DepthReading { scale: Some(DepthScale::WhiteNear), ..DepthReading::default() };
        assert_eq!(parts(&DepthMap::read(&at("d.npy"), &nearer).expect("disparity"))[1], Some(1.0));
        let far = DepthReading { range: Some([0.5, 100.0]), ..in_mm };
        let warned = DepthMap::read(&at("d.png"), &far).expect("range").warnings;
        assert!(warned[0].contains("600mm to 1.5m use 0.9 % of the range"), "{warned:?}");
        for (reading, word) in [
            (DepthReading { range: Some([2.0, 3.0]), ..in_mm }, "no pixel"),
            (DepthReading { range: Some([3.0, 2.0]), ..in_mm }, "less than"),
            (DepthReading { range: Some([0.5, 2.0]), ..black }, "depth unit"),
        ] {
            let refused = DepthMap::read(&at("d.png"), &reading).unwrap_err().to_string();
            assert!(refused.contains(word) && !refused.contains('\n'), "{refused}");
        }
        for cut in 0..20 {
            let bytes = std::fs::read(at("d.pfm")).expect("pfm");
            std::fs::write(at("cut.pfm"), &bytes[..cut]).expect("cut");
            assert!(DepthMap::read(&at("cut.pfm"), &black).is_err());
        }
    }

    #[test]
    fn a_map_of_fewer_pixels_is_laid_over_a_picture_of_its_shape() {
        let parts = (0..80).map(|i| i as f32).collect();
        let map = DepthMap { width: 10, height: 8, parts, unmeasured: 0, origin: String::new(), warnings: Vec::new() };
        let wide = map.clone().on(Path::new("d"), [20, 16]).expect("one shape");
        assert_eq!(wide.parts.len(), 320);
        assert_eq!(
            [wide.parts[0], wide.parts[1], wide.parts[2], wide.parts[21], wide.parts[319]],
            [0.0, 0.0, 1.0, 0.0, 79.0]
        );
        assert!(map.on(Path::new("d"), [20, 20]).unwrap_err().to_string().contains("10×8"));
    }

    #[test]
    fn gray_maps_run_over_the_whole_scale_and_little_use_is_told() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("d.png");
        image::GrayImage::from_fn(3, 1, |x, _| image::Luma([[0, 51, 255][x as usize]])).save(&path).expect("png");
        for (scale, expected) in [(None, [1.0, 0.8, 0.0]), (Some(DepthScale::BlackNear), [0.0, 0.2, 1.0])] {
            let map = DepthMap::read(&path, &DepthReading { scale, ..DepthReading::default() }).expect("map");
            assert!(map.parts.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{:?}", map.parts);
            assert!(map.warnings.is_empty() && map.unmeasured == 0);
        }
        image::GrayImage::from_fn(3, 1, |x, _| image::Luma([100 + x as u8])).save(&path).expect("png");
        let warned = DepthMap::read(&path, &DepthReading::default()).expect("map").warnings;
        assert!(warned[0].contains("100 to 102 use 0.8 %"), "{warned:?}");
    }
}
