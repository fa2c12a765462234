//! Photos brought onto places in the Fourier plane, and the file that keeps where a camera stands.

use super::mapping::{MAPPING, Mapping};
use super::photo::CameraPhoto;
use crate::error::{Error, Result};
use crate::files;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What the file says.
#[derive(Serialize, Deserialize)]
struct Stored {
    /// Columns and rows of the sensor.
    size: [usize; 2],
    /// The mapping's numbers, as [`Mapping::values`].
    mapping: [f64; MAPPING],
    /// Half the width of the window of the Fourier plane that was calibrated [cycles/pixel of the panel].
    half_window: f64,
}

/// A camera whose place was calibrated.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraView {
    /// Camera pixels → Fourier plane.
    pub mapping: Mapping,
    /// Half the width of the window of the Fourier plane that was calibrated [cycles/pixel of the panel].
    pub half_window: f64,
}

impl CameraView {
    /// Writes it as JSON.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let Self { mapping, half_window } = self;
        let stored = Stored { size: mapping.size, mapping: mapping.values, half_window: *half_window };
        let text = serde_json::to_string_pretty(&stored).map_err(|why| Error::input(path, why.to_string()))?;
        files::write_bytes(path, (text + "\n").as_bytes())
    }

    /// Reads what [`CameraView::write`] wrote.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that is no such.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|why| Error::input(path, why.to_string()))?;
        let wrong = |why: String| {
            Error::input(path, format!("is not the place of a camera, as `calibrate camera` writes it: {why}"))
        };
        let Stored { size, mapping: values, half_window } =
            serde_json::from_str(&text).map_err(|why| wrong(why.to_string()))?;
        let fits = values.iter().all(|v| v.is_finite()) && half_window > 0.0 && half_window <= 0.5;
        if !fits || size.iter().any(|side| !(32..=1 << 15).contains(side)) {
            return Err(wrong("its numbers are out of their domain".into()));
        }
        Ok(Self { mapping: Mapping { size, values }, half_window })
    }

    /// Left, top, right and bottom [cycles/pixel, rows downwards] of a room that is given as left, bottom, right and top in halves of
    /// the window that was calibrated, right and up from the axis: within −1 … 1.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a room outside of it, or without width or height.
    pub fn room(&self, [left, bottom, right, top]: [f64; 4]) -> Result<[f64; 4]> {
        let all = [left, bottom, right, top];
        if !(left < right && bottom < top && all.iter().all(|v| v.abs() <= 1.0)) {
            let limit = "must be left, bottom, right, top in halves of the calibrated window, -1 to 1";
            return Err(Error::out_of_range("room", format!("{left},{bottom},{right},{top}"), limit));
        }
        Ok([left, -top, right, -bottom].map(|v| v * self.half_window))
    }

    /// Where on the sensor frequencies [cycles/pixel] are seen.
    ///
    /// # Errors
    /// [`Error::Parameter`] where one of them is not on the sensor.
    pub fn places(&self, frequencies: &[[f64; 2]]) -> Result<Vec<[f64; 2]>> {
        let [width, height] = self.mapping.size;
        let on = |[x, y]: &[f64; 2]| *x >= 0.0 && *y >= 0.0 && *x < (width - 1) as f64 && *y < (height - 1) as f64;
        let place = |nu: &[f64; 2]| {
            self.mapping.pixel(*nu).filter(on).ok_or_else(|| {
                let what = format!(
                    "the place of ({:.4}, {:.4}) cycles a pixel is not on the sensor; give the picture less room",
                    nu[0], nu[1]
                );
                Error::parameter("camera", what)
            })
        };
        frequencies.iter().map(place).collect()
    }

    /// Brightness of a photo above its dark level at places on the sensor; NaN beside pixels that may be full. The dark level is
    /// what a fiftieth of its pixels does not pass: most of a photo is beside the picture.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a photo of another size than the calibration's, or one whose light at the places has a
    /// mean, weighted by itself, of less than three of the camera's gray levels.
    pub fn registered(&self, photo: &CameraPhoto, places: &[[f64; 2]]) -> Result<Vec<f32>> {
        let size = self.mapping.size;
        if [photo.width, photo.height] != size {
            let what = format!(
                "has {}×{} pixels, the camera was calibrated with {}×{}",
                photo.width, photo.height, size[0], size[1]
            );
            return Err(Error::parameter("photo", what));
        }
        let mut sorted = photo.values.clone();
        let dark = *sorted.select_nth_unstable_by(photo.values.len() / 50, f32::total_cmp).1;
        let full = photo.full();
        let seen = |place: &[f64; 2]| match photo.at(*place) {
            Some(value) if value < full => value - dark,
            _ => f32::NAN,
        };
        let seen: Vec<f32> = places.iter().map(seen).collect();
        let step = gray_step(sorted);
        // Weighted by itself: most of a picture may be dark.
        let lit = seen.iter().filter(|v| **v > 0.0).map(|v| f64::from(*v));
        let (sum, squares) = lit.fold((0.0, 0.0), |(sum, squares), v| (sum + v, squares + v * v));
        if squares <= LEAST_LEVELS * f64::from(step) * sum {
            let what = format!(
                "is underexposed: the picture's light is {:.1} of the camera's gray levels, {LEAST_LEVELS} are needed; expose for the \
                 picture (the zero order may be overexposed)",
                squares / sum.max(f64::MIN_POSITIVE) / f64::from(step)
            );
            return Err(Error::parameter("photo", what));
        }
        Ok(seen)
    }
}

/// Gray levels above the dark level that a picture's light must have.
const LEAST_LEVELS: f64 = 3.0;

/// A camera's gray level, in a photo's unit: the least difference of two pixels, but for rounding.
fn gray_step(mut values: Vec<f32>) -> f32 {
    values.sort_unstable_by(f32::total_cmp);
    let rounding = 1e-6 * values.last().map_or(0.0, |v| v.abs());
    let steps = values.windows(2).map(|pair| pair[1] - pair[0]);
    steps.filter(|step| *step > rounding).fold(f32::INFINITY, f32::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_photo_is_read_where_the_mapping_says_and_a_camera_from_its_file() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("camera.json");
        let mapping = Mapping::square([64, 48], 1e-3);
        let view = CameraView { mapping, half_window: 0.0625 };
        view.write(&path).expect("written");
        assert_eq!(CameraView::read(&path).expect("read"), view);
        // Brightness that rises along both axes.
        let values = (0..64 * 48).map(|i| (i % 64) as f32 + 100.0 * (i / 64) as f32).collect();
        let photo = CameraPhoto::new(64, 48, values).expect("photo");
        let places = view.places(&[[0.0, 0.0], [3e-3, -5e-3]]).expect("on the sensor");
        let seen = view.registered(&photo, &places).expect("seen");
        // A fiftieth are the first 61 pixels of the upper row.
        let wanted = [31.5 + 2350.0 - 61.0, 34.5 + 1850.0 - 61.0];
        assert!(seen.iter().zip(wanted).all(|(s, w)| (s - w).abs() < 1e-2), "{seen:?}");
        assert!(view.places(&[[0.04, 0.0]]).is_err());
        assert_eq!(view.room([-0.5, 0.25, 1.0, 0.5]).expect("room"), [-0.03125, -0.03125, 0.0625, -0.015625]);
        assert!(view.room([0.5, 0.25, 0.5, 0.5]).is_err() && view.room([-0.5, 0.25, 1.1, 0.5]).is_err());
        // Two gray levels of a camera, whatever the unit.
        let dim = (0..64 * 48).map(|i| 0.01 * ((i % 64 / 16 + i / 64 / 16) / 2) as f32).collect();
        let told = view.registered(&CameraPhoto::new(64, 48, dim).expect("photo"), &places).expect_err("dim");
        assert!(told.to_string().contains("underexposed"), "{told}");
        let other = CameraPhoto::new(48, 64, photo.values.clone()).expect("photo");
        assert!(view.registered(&other, &places).is_err());
        for text in ["", "{}", r#"{"size": [64, 48], "mapping": [0], "half_window": 0.1}"#] {
            std::fs::write(&path, text).expect("write");
            assert!(CameraView::read(&path).is_err(), "{text}");
        }
    }
}
