//! Light fields as folders of pictures: `view-ROW-COLUMN.png` for each eye, and `light-field.json`.
//!
//! Pictures are sRGB-coded, gray or in colour, of 8 or 16 bits; the largest code is the `peak` of the JSON, 1 (white) if it has
//! none. The JSON says where eyes and pixels stand, with the names and units of the `.npz` ([`file`](super::file)):
//!
//! ```json
//! {
//!   "format": "any text",
//!   "views": [9, 9], "center": [0, 0], "spacing": 0.0005, "distance": 0.6,
//!   "window": [0.00432, 0.00432], "window_center": [0, 0], "depth": [-0.1, -0.15], "peak": 1
//! }
//! ```
//!
//! It is written last: a folder without it is not whole, and not read.

use super::codes::put;
use super::file::{Description, within};
use super::{EyeGrid, LightField};
use crate::error::{Error, Result};
use crate::field::{Grid, npy};
use crate::files;
use crate::points::Channel;
use crate::scene::texture::{linear_from_srgb, srgb_from_linear};
use glam::{DVec2, Vec3};
use std::path::{Path, PathBuf};

const JSON: &str = "light-field.json";
/// Depths of the middle view.
const DEPTHS: &str = "depths.npy";
/// Longest JSON that is read [bytes].
const MOST_JSON: u64 = 1 << 20;

fn picture(folder: &Path, row: usize, column: usize) -> PathBuf {
    folder.join(format!("view-{row:02}-{column:02}.png"))
}

impl LightField {
    /// Writes a folder of 16-bit pictures.
    ///
    /// # Errors
    /// [`Error::Io`] for what the disk refuses.
    pub fn write_folder(&self, folder: &Path) -> Result<()> {
        files::output_folder(folder)?;
        let json = folder.join(JSON);
        // What stood there before is not whole any more.
        for old in [&json, &folder.join(DEPTHS)] {
            if old.exists() {
                std::fs::remove_file(old).map_err(Error::io(old))?;
            }
        }
        for index in 0..self.eyes.count() {
            let path = picture(folder, index / self.eyes.columns, index % self.eyes.columns);
            self.write_view(&path, index)?;
        }
        if let Some(depths) = &self.middle_depths {
            npy::write_intensity(&folder.join(DEPTHS), self.window.width, self.window.height, depths)?;
        }
        files::write_bytes(&json, Description::of(self).json().as_bytes())
    }

    /// Writes one view as a picture of 16 bits, sRGB-coded, its largest code at the light field's peak.
    ///
    /// # Errors
    /// [`Error::Io`] for what the disk refuses.
    pub fn write_view(&self, path: &Path, index: usize) -> Result<()> {
        let code = |channel: &Vec<u16>, i: usize| {
            let amplitude = f32::from(channel[index * self.pixels() + i]) / Self::FULL;
            ((srgb_from_linear(amplitude * amplitude) * Self::FULL).round() as u16).to_be_bytes()
        };
        let bytes: Vec<u8> =
            (0..self.pixels()).flat_map(|i| self.channels.iter().flat_map(move |c| code(c, i))).collect();
        let refused = |e: png::EncodingError| match e {
            png::EncodingError::IoError(source) => Error::Io { path: path.into(), source },
            other => Error::input(path, other.to_string()),
        };
        files::write_whole(path, |out| {
            let mut encoder = png::Encoder::new(out, self.window.width as u32, self.window.height as u32);
            let gray = self.channels.len() == 1;
            encoder.set_color(if gray { png::ColorType::Grayscale } else { png::ColorType::Rgb });
            encoder.set_depth(png::BitDepth::Sixteen);
            let mut writer = encoder.write_header().map_err(refused)?;
            writer.write_image_data(&bytes).map_err(refused)?;
            writer.finish().map_err(refused)
        })
    }

    /// One gray view: the luminance of a picture (sRGB-coded, what is clear in it black) whose pixels are a window's.
    ///
    /// # Errors
    /// As [`LightField::black`].
    pub(crate) fn of_picture(picture: image::DynamicImage, window: Grid) -> Result<Self> {
        let eyes = EyeGrid { distance: 1.0, center: DVec2::ZERO, spacing: 1.0, columns: 1, rows: 1 };
        let mut field = Self::black(eyes, window, 1)?;
        let decode: Vec<f32> = (0..=u16::MAX).map(|code| linear_from_srgb(f32::from(code) / Self::FULL)).collect();
        let rgba = picture.into_rgba16();
        for (code, pixel) in field.channels[0].iter_mut().zip(rgba.pixels()) {
            let [red, green, blue, alpha] = pixel.0;
            let light = Channel::Luminance.of([red, green, blue].map(|code| decode[usize::from(code)]));
            *code = Self::code(light * f32::from(alpha) / Self::FULL, 1.0);
        }
        Ok(field)
    }

    /// Whether a folder says that it holds a light field.
    pub fn is_folder(path: &Path) -> bool {
        path.join(JSON).is_file()
    }

    /// Reads a folder of pictures.
    ///
    /// # Errors
    /// [`Error::Io`] for a file that is missing; [`Error::Input`] for one that is no picture, of another size than the first,
    /// or for a JSON that says something impossible.
    pub fn read_folder(folder: &Path) -> Result<Self> {
        let json = folder.join(JSON);
        let length = std::fs::metadata(&json).map_err(Error::io(&json))?.len();
        if length > MOST_JSON {
            return Err(Error::input(&json, format!("{length} bytes are no description of a light field")));
        }
        let text = std::fs::read_to_string(&json).map_err(Error::io(&json))?;
        let description: Description = serde_json::from_str(&text).map_err(|e| Error::input(&json, e.to_string()))?;
        if !(description.peak.is_finite() && description.peak > 0.0) {
            return Err(Error::input(&json, format!("peak {}: must be greater than zero", description.peak)));
        }
        let first = open(&picture(folder, 0, 0))?;
        let size = [first.width() as usize, first.height() as usize];
        let channels = if first.color().has_color() { 3 } else { 1 };
        let mut field = within(&json, description.field(size, channels))?;
        let (columns, mut peaks) = (field.eyes.columns, Vec::new());
        let decode: Vec<f32> = (0..=u16::MAX).map(|code| linear_from_srgb(f32::from(code) / Self::FULL)).collect();
        for (index, mut codes) in field.pieces(size[0] * size[1]).into_iter().enumerate() {
            let path = picture(folder, index / columns, index % columns);
            let seen = open(&path)?;
            if [seen.width() as usize, seen.height() as usize] != size {
                let what =
                    format!("{} × {} pixels, the first has {} × {}", seen.width(), seen.height(), size[0], size[1]);
                return Err(Error::input(&path, what));
            }
            let rgb = seen.into_rgb16();
            let light =
                |p: &image::Rgb<u16>| Vec3::from_array(p.0.map(|code| decode[usize::from(code)])) * description.peak;
            let light: Vec<Vec3> = rgb.pixels().map(light).collect();
            peaks.push(put(&light, None, &mut codes));
        }
        field.level(&peaks, size[0] * size[1]);
        let depths = folder.join(DEPTHS);
        if depths.exists() {
            let read = npy::read_real(&depths)?;
            if [read.width, read.height] != size || read.channels != 1 || read.values.iter().any(|z| !z.is_finite()) {
                return Err(Error::input(&depths, "are not the finite depths of a view's pixels"));
            }
            field.middle_depths = Some(read.values);
        }
        Ok(field)
    }
}

fn open(path: &Path) -> Result<image::DynamicImage> {
    files::pictures::open(path)
}

#[cfg(test)]
mod tests {
    use super::super::file::tests::{alike, sample};
    use super::*;

    #[test]
    fn folders_there_and_back() {
        let folder = tempfile::tempdir().expect("folder");
        for channels in [1, 3] {
            let (path, field) = (folder.path().join(format!("field-{channels}")), sample(channels));
            field.write(&path).expect("written");
            field.write(&path).expect("over the old one");
            alike(&field, &LightField::read(&path).expect("read"), 5e-4);
        }
    }

    #[test]
    fn what_is_missing_or_wrong_is_named() {
        let folder = tempfile::tempdir().expect("folder");
        let (path, field) = (folder.path(), sample(1));
        let refused = |word: &str| {
            let refused = LightField::read_folder(path).expect_err(word).to_string();
            assert!(refused.contains(word) && !refused.contains('\n'), "{word}: {refused}");
        };
        refused(JSON);
        field.write_folder(path).expect("written");
        let view = picture(path, 2, 1);
        std::fs::write(&view, b"no picture").expect("file");
        refused("view-02-01.png");
        image::GrayImage::new(6, 5).save(&view).expect("picture");
        refused("6 × 5");
        std::fs::remove_file(&view).expect("removed");
        refused("view-02-01.png");
        field.write_folder(path).expect("written");
        let json = path.join(JSON);
        let text = std::fs::read_to_string(&json).expect("text");
        let wrong =
            [("0.55", "-0.55", "distance"), ("\"peak\": ", "\"peak\": -", "peak"), ("0.0005", "\"a\"", "spacing")];
        for (from, to, word) in wrong {
            std::fs::write(&json, text.replace(from, to)).expect("file");
            let refused = LightField::read_folder(path).expect_err(word).to_string();
            assert!(refused.contains(JSON) && !refused.contains('\n'), "{word}: {refused}");
        }
        // 8 bits, as others write them.
        std::fs::write(&json, &text).expect("file");
        image::GrayImage::from_pixel(7, 5, image::Luma([188])).save(&view).expect("picture");
        let read = LightField::read_folder(path).expect("read");
        // IEC 61966-2-1: code 188/255 is 0.5029 linear.
        assert!((read.radiance(read.view(0, 5)[9]) / field.peak - 0.5029).abs() < 1e-3);
    }
}
