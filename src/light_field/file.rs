//! Light fields as `.npz` files, which any program with NumPy reads and writes.
//!
//! | key | what it is |
//! |---|---|
//! | `views` | rows × columns × height × width, or × 3 for linear red, green and blue; row 0 of views and of pixels on top, column 0 at the smallest x. Floats are linear radiance over white; whole numbers are sRGB-coded, their largest value white |
//! | `eyes` | rows × columns × 2, the x and y of each view's eye [m], equally spaced; or instead `center` (2) and `spacing` (1) |
//! | `distance` | of the eyes before the panel [m] |
//! | `window` | half width and half height of the views on the panel's plane [m], edges of the outermost pixels; its middle is `window_center`, 0 if absent |
//! | `depth` | nearest and farthest z of what is seen [m], negative behind the panel; −0.1 and −0.15 if absent |
//! | `depths` | height × width, z of each pixel of the middle view [m]; may be absent |
//! | `meta` | JSON for people, not read |

use super::codes::put;
use super::{EyeGrid, LightField};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::field::npy_zip::{self, Npz, NpzArray};
use crate::scene::texture::linear_from_srgb;
use glam::{DVec2, Vec3};
use half::f16;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Depths that are taken for a file that names none: those of the default placement.
const DEPTH: [f64; 2] = [-0.1, -0.15];
/// By how much of their distance eyes may be off a lattice.
const UNEVEN: f64 = 0.01;

/// Where the views and pixels of a light field stand, as files say it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Description {
    /// What this is.
    pub(super) format: String,
    /// Middle of the eyes [m].
    pub(super) center: [f64; 2],
    /// Distance of neighbouring eyes [m].
    pub(super) spacing: f64,
    /// Distance of the eyes before the panel [m].
    pub(super) distance: f64,
    /// Rows and columns of views.
    pub(super) views: [usize; 2],
    /// Half width and half height of the window on the panel's plane [m].
    pub(super) window: [f64; 2],
    /// Middle of the window [m].
    #[serde(default)]
    pub(super) window_center: [f64; 2],
    /// Nearest and farthest z of what is seen [m].
    #[serde(default = "default_depth")]
    pub(super) depth: [f64; 2],
    /// Radiance over white's that is shown by the largest code.
    #[serde(default = "one")]
    pub(super) peak: f32,
}

fn default_depth() -> [f64; 2] {
    DEPTH
}

fn one() -> f32 {
    1.0
}

impl Description {
    pub(super) fn of(field: &LightField) -> Self {
        let (eyes, window) = (&field.eyes, &field.window);
        Self {
            format: "holodrive light field 1: row 0 on top, +x right, +y up, +z to the viewer, metres".into(),
            center: eyes.center.to_array(),
            spacing: eyes.spacing,
            distance: eyes.distance,
            views: [eyes.rows, eyes.columns],
            window: [0.5 * window.extent_x(), 0.5 * window.extent_y()],
            window_center: window.center,
            depth: field.depth,
            peak: field.peak,
        }
    }

    /// A black light field of this description, with views of `size` (width, height) pixels.
    pub(super) fn field(&self, [width, height]: [usize; 2], channels: usize) -> Result<LightField> {
        let [rows, columns] = self.views;
        let center = DVec2::from(self.center);
        let eyes = EyeGrid { distance: self.distance, center, spacing: self.spacing, columns, rows };
        let pitch = [2.0 * self.window[0] / width as f64, 2.0 * self.window[1] / height as f64];
        if !self.window_center.iter().all(|c| c.is_finite()) {
            return Err(Error::parameter("window", "its middle is not finite"));
        }
        let window = Grid::new(width, height, pitch[0], pitch[1])?.centered_at(self.window_center);
        let [near, far] = self.depth;
        if !(near.is_finite() && far.is_finite() && far <= near && near < self.distance) {
            let what = format_args!("{near} m and {far} m");
            return Err(Error::out_of_range("depth", what, "must be the nearest and the farthest z, before the eyes"));
        }
        let mut field = LightField::black(eyes, window, channels)?;
        field.depth = self.depth;
        Ok(field)
    }

    pub(super) fn json(&self) -> String {
        // A description is plain data, which always has a text.
        serde_json::to_string_pretty(self).unwrap_or_default()
    }
}

/// Says in which file something is wrong.
pub(super) fn within<T>(path: &Path, result: Result<T>) -> Result<T> {
    result.map_err(|error| match error {
        Error::Parameter { .. } | Error::OutOfRange { .. } => Error::input(path, error.to_string()),
        other => other,
    })
}

impl LightField {
    /// Reads a light field from a `.npz` ([`LightField::read_npz`]) or a folder ([`LightField::read_folder`]).
    ///
    /// # Errors
    /// As those two.
    pub fn read(path: &Path) -> Result<Self> {
        if path.is_dir() { Self::read_folder(path) } else { Self::read_npz(path) }
    }

    /// Writes a light field as a `.npz`, or as a folder for any other name.
    ///
    /// # Errors
    /// As [`LightField::write_npz`] and [`LightField::write_folder`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let npz = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npz"));
        if npz { self.write_npz(path) } else { self.write_folder(path) }
    }

    /// Writes a `.npz` with views in float16.
    ///
    /// # Errors
    /// [`Error::Unsupported`] beyond 4 GB; [`Error::Io`] for what the disk refuses.
    pub fn write_npz(&self, path: &Path) -> Result<()> {
        let (eyes, window, pixels) = (&self.eyes, &self.window, self.pixels());
        npy_zip::write(path, |npz| {
            let mut shape = vec![eyes.rows, eyes.columns, window.height, window.width];
            shape.extend((self.channels.len() > 1).then_some(self.channels.len()));
            npz.array("views", "<f2", &shape, |put| {
                let mut bytes = Vec::with_capacity(2 * pixels * self.channels.len());
                (0..eyes.count()).try_for_each(|index| {
                    bytes.clear();
                    for i in 0..pixels {
                        for channel in 0..self.channels.len() {
                            let light = self.radiance(self.view(channel, index)[i]);
                            // Beyond half precision's range stands its largest number.
                            bytes.extend(f16::from_f32(light.min(f16::MAX.to_f32())).to_le_bytes());
                        }
                    }
                    put(&bytes)
                })
            })?;
            let places: Vec<f64> = (0..eyes.count()).flat_map(|i| eyes.position(i).truncate().to_array()).collect();
            npz.doubles("eyes", &[eyes.rows, eyes.columns, 2], &places)?;
            npz.doubles("center", &[2], &eyes.center.to_array())?;
            npz.doubles("spacing", &[], &[eyes.spacing])?;
            npz.doubles("distance", &[], &[eyes.distance])?;
            npz.doubles("window", &[2], &[0.5 * window.extent_x(), 0.5 * window.extent_y()])?;
            npz.doubles("window_center", &[2], &window.center)?;
            npz.doubles("depth", &[2], &self.depth)?;
            if let Some(depths) = &self.middle_depths {
                npz.array("depths", "<f4", &[window.height, window.width], |put| {
                    depths.iter().try_for_each(|z| put(&z.to_le_bytes()))
                })?;
            }
            npz.text("meta", &Description::of(self).json())
        })
    }

    /// Reads a `.npz` of any program that writes the keys in the table of [`file`](super::file).
    ///
    /// # Errors
    /// [`Error::Input`] for what is damaged, incomplete or impossible; [`Error::Memory`] for more than any machine holds.
    pub fn read_npz(path: &Path) -> Result<Self> {
        let mut npz = Npz::open(path)?;
        let missing = |npz: &Npz, key: &str| {
            let there: Vec<&str> = npz.names().take(12).collect();
            Error::input(path, format!("has no array {key:?}, only {}", there.join(", ")))
        };
        let shape = npz.array("views")?.map(|views| views.shape);
        let shape = shape.ok_or_else(|| missing(&npz, "views"))?;
        let (rows, columns, height, width, channels) = match shape[..] {
            [rows, columns, height, width] => (rows, columns, height, width, 1),
            [rows, columns, height, width, channels @ (1 | 3)] => (rows, columns, height, width, channels),
            _ => {
                let what = format!("views: shape {shape:?}; rows × columns × height × width, or × 3, is needed");
                return Err(Error::input(path, what));
            }
        };
        if shape.contains(&0) {
            return Err(Error::input(path, format!("views: shape {shape:?} has no values")));
        }
        let mut value = |key: &str, count: usize| -> Result<Option<Vec<f64>>> {
            let Some((shape, values)) = npz.doubles(key, count)? else { return Ok(None) };
            if values.len() != count {
                return Err(Error::input(path, format!("{key}: shape {shape:?}; {count} values are needed")));
            }
            Ok(Some(values))
        };
        let pair = |values: Vec<f64>| [values[0], values[1]];
        let (center, spacing) = (value("center", 2)?.map(pair), value("spacing", 1)?.map(|v| v[0]));
        let distance = value("distance", 1)?.map(|v| v[0]);
        let window = value("window", 2)?.map(pair);
        let window_center = value("window_center", 2)?.map_or([0.0; 2], pair);
        let depth = value("depth", 2)?.map_or(DEPTH, pair);
        let (center, spacing) = match (center, spacing) {
            (Some(center), Some(spacing)) => (center, spacing),
            _ => {
                let eyes = npz.doubles("eyes", 3 * EyeGrid::MOST)?;
                let (_, eyes) = eyes.ok_or_else(|| missing(&npz, "eyes"))?;
                lattice(&eyes, rows, columns).map_err(|what| Error::input(path, format!("eyes: {what}")))?
            }
        };
        let description = Description {
            format: String::new(),
            center,
            spacing,
            distance: distance.ok_or_else(|| missing(&npz, "distance"))?,
            views: [rows, columns],
            window: window.ok_or_else(|| missing(&npz, "window"))?,
            window_center,
            depth,
            peak: 1.0,
        };
        let mut field = within(path, description.field([width, height], channels))?;
        if let Some(mut views) = npz.array("views")? {
            field.fill(&mut views)?;
        }
        if let Some((shape, depths)) = npz.doubles("depths", width * height)? {
            if shape != [height, width] {
                return Err(Error::input(path, format!("depths: shape {shape:?} is not that of a view")));
            }
            field.middle_depths = Some(depths.iter().map(|z| *z as f32).collect());
        }
        Ok(field)
    }

    /// Reads all views.
    fn fill(&mut self, views: &mut NpzArray) -> Result<()> {
        let (pixels, channels) = (self.pixels(), self.channels.len());
        let coded = views.largest();
        let mut peaks = Vec::new();
        for mut codes in self.pieces(pixels) {
            let mut light = vec![Vec3::ZERO; pixels];
            let mut number = 0;
            views.read(pixels * channels, |value| {
                let linear = coded.map_or(value as f32, |largest| linear_from_srgb((value / largest) as f32));
                // A number that single precision does not hold burns out.
                light[number / channels][number % channels] = linear.clamp(0.0, f32::MAX);
                number += 1;
            })?;
            peaks.push(put(&light, None, &mut codes));
        }
        self.level(&peaks, pixels);
        Ok(())
    }
}

/// Middle and spacing of eyes on a lattice, from the x and y (and z) of each, row by row.
fn lattice(eyes: &[f64], rows: usize, columns: usize) -> std::result::Result<([f64; 2], f64), String> {
    let count = rows * columns;
    let sides = eyes.len() / count.max(1);
    if sides * count != eyes.len() || !(2..=3).contains(&sides) {
        return Err(format!("{} values; x and y for each of {rows} × {columns} views are needed", eyes.len()));
    }
    let at = |row: usize, column: usize| DVec2::from_slice(&eyes[(row * columns + column) * sides..]);
    let (first, last) = (at(0, 0), at(rows - 1, columns - 1));
    let span = last - first;
    let steps = DVec2::new(columns as f64 - 1.0, 1.0 - rows as f64);
    let spacing = match (columns, rows) {
        (1, 1) => EyeGrid::SPACING,
        (1, _) => span.y / steps.y,
        _ => span.x / steps.x,
    };
    if !(spacing.is_finite() && spacing > 0.0) {
        return Err("x must grow with the column and y fall with the row".into());
    }
    for row in 0..rows {
        for column in 0..columns {
            let expected = first + DVec2::new(column as f64, -(row as f64)) * spacing;
            let off = (at(row, column) - expected).abs().max_element();
            if off.is_nan() || off > UNEVEN * spacing {
                return Err(format!(
                    "row {row}, column {column} is not on a lattice of {spacing} m with x to the right and row 0 on top"
                ));
            }
        }
    }
    Ok(((0.5 * (first + last)).to_array(), spacing))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Three by two views of three channels with a peak above white.
    pub(in super::super) fn sample(channels: usize) -> LightField {
        let eyes = EyeGrid { distance: 0.55, center: DVec2::new(1e-3, -2e-3), spacing: 0.5e-3, columns: 2, rows: 3 };
        let window = Grid::new(7, 5, 1e-4, 1.5e-4).expect("window").centered_at([2e-4, 0.0]);
        let mut field = LightField::black(eyes, window, channels).expect("field");
        let mut peaks = Vec::new();
        for (view, mut codes) in field.pieces(35).into_iter().enumerate() {
            let light = |i: usize| Vec3::new(0.02 * i as f32, 0.1 * view as f32, 1.0 / (1 + i) as f32) * 2.5;
            peaks.push(put(&(0..35).map(light).collect::<Vec<_>>(), None, &mut codes));
        }
        field.level(&peaks, 35);
        field.depth = [-0.05, -0.2];
        field.middle_depths = Some((0..35).map(|i| -0.05 - 0.001 * i as f32).collect());
        field
    }

    /// That two light fields show the same but for `steps` of relative radiance.
    pub(in super::super) fn alike(a: &LightField, b: &LightField, relative: f32) {
        assert_eq!((a.eyes.rows, a.eyes.columns, a.window.width), (b.eyes.rows, b.eyes.columns, b.window.width));
        assert!((a.eyes.center - b.eyes.center).length() < 1e-12 && (a.eyes.spacing - b.eyes.spacing).abs() < 1e-12);
        assert!((a.window.pitch_y - b.window.pitch_y).abs() < 1e-12 && a.window.center == b.window.center);
        assert_eq!((a.depth, &a.middle_depths, a.channels.len()), (b.depth, &b.middle_depths, b.channels.len()));
        assert!((a.peak / b.peak - 1.0).abs() < 1e-3);
        for (x, y) in a.channels.iter().flatten().zip(b.channels.iter().flatten()) {
            let (x, y) = (a.radiance(*x), b.radiance(*y));
            assert!((x - y).abs() <= relative * x + 1e-4 * (x * a.peak).sqrt() + 1e-8, "{x} {y}");
        }
    }

    #[test]
    fn npz_there_and_back() {
        let folder = tempfile::tempdir().expect("folder");
        for channels in [1, 3] {
            let (path, field) = (folder.path().join("a.npz"), sample(channels));
            field.write(&path).expect("written");
            alike(&field, &LightField::read(&path).expect("read"), 5e-4);
        }
    }

    /// Writes the least that another program must, with one thing changed.
    fn foreign(path: &Path, views: (&str, &[usize], Vec<u8>), eyes: &[f64], window: &[f64]) -> Result<LightField> {
        npy_zip::write(path, |npz| {
            npz.array("views", views.0, views.1, |put| put(&views.2))?;
            npz.doubles("eyes", &[eyes.len() / 2, 2], eyes)?;
            npz.doubles("distance", &[1], &[0.6])?;
            npz.doubles("window", &[2], window)
        })
        .expect("written");
        LightField::read_npz(path)
    }

    #[test]
    fn files_of_other_programs() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("b.npz");
        let eyes = [-1e-3, 1e-3, 1e-3, 1e-3, -1e-3, -1e-3, 1e-3, -1e-3];
        let bytes: Vec<u8> = (0..24).map(|i| i * 10).collect();
        let read = foreign(&path, ("|u1", &[2, 2, 2, 3], bytes), &eyes, &[3e-3, 2e-3]).expect("read");
        assert_eq!((read.eyes.columns, read.eyes.rows, read.eyes.spacing, read.peak), (2, 2, 2e-3, 1.0));
        assert_eq!((read.window.width, read.window.height, read.window.pitch_x), (3, 2, 2e-3));
        assert_eq!((read.depth, read.middle_depths.is_none()), (DEPTH, true));
        // Whole numbers are sRGB-coded: 200/255 is 0.5776 linear (IEC 61966-2-1).
        assert!((read.radiance(read.view(0, 3)[2]) - 0.5776).abs() < 1e-3);
        let floats = |values: [f32; 4]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let one = foreign(&path, ("<f4", &[1, 1, 2, 2], floats([0.5, 4.0, 0.0, -1.0])), &[0.0, 0.0], &[1e-3; 2]);
        let one = one.expect("read");
        assert!(one.peak == 4.0 && one.view(0, 0)[1] == 65535 && one.view(0, 0)[3] == 0);
        type Case<'a> = (&'a str, (&'a str, &'a [usize], Vec<u8>), &'a [f64], &'a [f64]);
        let cases: [Case; 8] = [
            ("not finite", ("<f4", &[1, 1, 2, 2], floats([0.5, f32::NAN, 0.0, 1.0])), &[0.0, 0.0], &[1e-3; 2]),
            ("bytes of values", ("<f4", &[1, 1, 2, 3], floats([0.5; 4])), &[0.0, 0.0], &[1e-3; 2]),
            ("shape", ("<f4", &[1, 2, 2], floats([0.5; 4])), &[0.0, 0.0], &[1e-3; 2]),
            ("no values", ("<f4", &[1, 0, 2, 2], vec![]), &[0.0, 0.0], &[1e-3; 2]),
            ("type", ("<c8", &[1, 1, 1, 2], floats([0.5; 4])), &[0.0, 0.0], &[1e-3; 2]),
            ("x must grow", ("<f4", &[1, 2, 1, 2], floats([0.5; 4])), &[1e-3, 0.0, 0.0, 0.0], &[1e-3; 2]),
            (
                "lattice",
                ("<f4", &[2, 2, 1, 1], floats([0.5; 4])),
                &[0.0, 0.0, 1e-3, 0.0, 0.0, 1e-3, 1e-3, 1e-3],
                &[1e-3; 2],
            ),
            ("greater than zero", ("<f4", &[1, 1, 2, 2], floats([0.5; 4])), &[0.0, 0.0], &[0.0, 1e-3]),
        ];
        for (word, views, eyes, window) in cases {
            let refused = foreign(&path, views, eyes, window).expect_err(word).to_string();
            assert!(
                refused.contains(word) && refused.contains("b.npz") && !refused.contains('\n'),
                "{word}: {refused}"
            );
        }
        npy_zip::write(&path, |npz| npz.doubles("other", &[1], &[0.0])).expect("written");
        let refused = LightField::read_npz(&path).expect_err("nothing in it").to_string();
        assert!(refused.contains("views") && refused.contains("other"), "{refused}");
    }
}
