//! The light of a panel's exposures, looked at alike: one frame, sub-frames faster than the eye, frames in three lasers.
//!
//! Intensities of one laser's exposures are averaged, as a slow eye does. Those of red, green and blue are drives of the
//! lasers ([`Lasers`]), up to one factor that is the same for all three only if all collect a point's light alike. Through
//! an *eye* they do: a point's wave has intensity a²/r² in the pupil, whatever its wavelength. A sensor on a *plane* takes
//! the whole cone that the panel sends, which is wider in red: there each picture is divided by its solid angle first
//! ([`super::flat_field`]).
//!
//! Fields are those that were encoded ([`crate::panel::EncodingRecord::scale`] divided out); on a real panel the lasers'
//! powers do that ([`super::colour::laser_powers`]).

use super::metrics::{self, Likeness};
use super::{ColorPicture, Cone, Picture, Scale, View, ViewSettings, all_in_focus, focus_step, intensity, picture};
use crate::error::{Error, Result};
use crate::field::arrays::{self, Named, Values};
use crate::field::{Field, npy};
use crate::points::colour::Lasers;
use crate::progress::Progress;
use crate::scene::texture::srgb_from_linear;
use glam::DVec2;
use std::path::Path;

/// Light of one exposure behind the panel, and how it is looked at.
#[derive(Clone, Debug)]
pub struct ExposureLight {
    /// The field.
    pub field: Field,
    /// The stop it goes through, and the memory that looking takes.
    pub settings: ViewSettings,
    /// Which of three lasers it is of, 0 red to 2 blue; 0 without lasers.
    pub laser: usize,
}

/// Light of all exposures that are seen as one picture.
#[derive(Clone, Debug)]
pub struct Light {
    /// Lasers of a picture in colour; without them all exposures are of one wavelength and the picture is gray.
    pub lasers: Option<Lasers>,
    /// The exposures; those of one laser are averaged, and a laser that has none is dark.
    pub exposures: Vec<ExposureLight>,
}

/// What is seen of it, in linear light.
#[derive(Clone, Debug, PartialEq)]
pub enum Reconstruction {
    /// In one wavelength.
    Gray(Picture),
    /// In three.
    Color(ColorPicture),
}

impl Light {
    /// A picture of one view on the rectangle ±`half` [m] of its focal plane, in `size` cells (columns, rows) or as many
    /// as the panel has pixels there; in colour of radiance, the flat field divided out on a plane (`Cone::flatten`).
    ///
    /// # Errors
    /// As [`super::picture`]; [`Error::Parameter`] where no exposure has light.
    pub fn picture(
        &self,
        view: &View,
        half: DVec2,
        size: Option<(usize, usize)>,
        progress: &Progress,
    ) -> Result<Reconstruction> {
        self.each(|ExposureLight { field, settings, .. }| {
            if size.is_none() && self.lasers.is_none() {
                let (grid, values) = intensity(field, view, half, settings, progress)?;
                return Ok(Picture { width: grid.width, height: grid.height, values });
            }
            let cells = |half: f64, pitch: f64| super::cells(half, pitch) as usize;
            let size = size.unwrap_or_else(|| (cells(half.x, field.grid.pitch_x), cells(half.y, field.grid.pitch_y)));
            let mut seen = picture(field, view, half, size, settings, progress)?;
            if let (View::Plane { z }, true) = (*view, self.lasers.is_some()) {
                Cone::new(field, settings).flatten(&mut seen, |_| half, |_| z);
            }
            Ok(seen)
        })
    }

    /// A picture in which every pixel is in focus, and the number of planes; in colour of radiance.
    ///
    /// # Errors
    /// As [`super::all_in_focus`]; [`Error::Parameter`] where no exposure has light.
    pub fn all_in_focus(
        &self,
        depths: &[Option<f64>],
        size: (usize, usize),
        half_at: impl Fn(f64) -> DVec2,
        step: f64,
        progress: &Progress,
    ) -> Result<(Reconstruction, usize)> {
        let farthest = depths.iter().flatten().fold(f64::INFINITY, |a, &z| a.min(z));
        let planes = std::cell::Cell::new(0);
        let seen = self.each(|ExposureLight { field, settings, .. }| {
            let (mut seen, count) = all_in_focus(field, depths, size, &half_at, step, settings, progress)?;
            planes.set(count);
            if self.lasers.is_some() {
                Cone::new(field, settings).flatten(&mut seen, &half_at, |i| depths[i].unwrap_or(farthest));
            }
            Ok(seen)
        })?;
        Ok((seen, planes.get()))
    }

    /// The least of the exposures' distances of planes ([`focus_step`]): the widest cone needs the closest [m].
    pub fn focus_step(&self, half: DVec2, size: (usize, usize)) -> f64 {
        let steps = self.exposures.iter().map(|light| focus_step(&light.field, &light.settings, half, size));
        steps.fold(f64::INFINITY, f64::min)
    }

    /// Combines what is seen of each exposure.
    fn each(&self, see: impl Fn(&ExposureLight) -> Result<Picture>) -> Result<Reconstruction> {
        let mean = |laser: usize| -> Result<Option<Picture>> {
            let own = self.exposures.iter().filter(|light| light.laser == laser);
            Ok(Picture::mean(&own.map(&see).collect::<Result<Vec<_>>>()?))
        };
        let dark = || Error::parameter("exposures", "have no light");
        let Some(lasers) = &self.lasers else { return Ok(Reconstruction::Gray(mean(0)?.ok_or_else(dark)?)) };
        let channels = [mean(0)?, mean(1)?, mean(2)?];
        let lit = channels.iter().flatten().next().ok_or_else(dark)?;
        let black = Picture { values: vec![0.0; lit.values.len()], ..*lit };
        let channels = channels.map(|channel| channel.unwrap_or_else(|| black.clone()));
        Ok(Reconstruction::Color(ColorPicture::combine(lasers, &channels)))
    }
}

impl Reconstruction {
    /// Writes a picture of a view as .png, sRGB-coded with `white` as white, or linear as .npy, and in gray as .mat, .h5 or .tif; `lasers` are those of a picture in colour.
    pub fn write(&self, path: &Path, lasers: Option<&Lasers>, white: f32, view: &View, half: DVec2) -> Result<()> {
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        if matches!(ending.as_str(), "mat" | "h5" | "tif" | "tiff") {
            let Self::Gray(seen) = self else {
                return Err(Error::input(path, "a picture in colour is written as .png or .npy"));
            };
            let values = Values::Real(seen.values.iter().map(|v| f64::from(*v)).collect());
            return arrays::write(
                path,
                &[Named { name: "intensity", shape: [seen.height, seen.width], values: &values }],
            );
        }
        let is_npy = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy"));
        let mut described = serde_json::json!({
            "simulated": true,
            "focus": view.focus(),
            "half": half.to_array(),
            "white": white,
        });
        if let Some(lasers) = lasers {
            described["wavelengths"] = serde_json::json!(lasers.wavelengths());
        }
        described["convention"] = npy::CONVENTION.into();
        let texts = |what: &str| [("Description", what.to_owned()), ("holodrive", described.to_string())];
        match self {
            Self::Gray(seen) if is_npy => npy::write_intensity(path, seen.width, seen.height, &seen.values),
            Self::Color(seen) if is_npy => npy::write_picture(path, seen.width, seen.height, &seen.rgb),
            Self::Gray(seen) => {
                seen.write_png(path, Scale::White(white), &texts("simulated reconstruction, sRGB-coded intensity"))
            }
            Self::Color(seen) => {
                let texts = texts("simulated reconstruction in the light of three lasers, sRGB");
                super::write_rgb_png(path, seen.width, seen.height, &seen.rgb, white, &texts)
            }
        }
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Gray(seen) => (seen.width, seen.height),
            Self::Color(seen) => (seen.width, seen.height),
        }
    }

    /// In gray: the intensity, or the luminance of the colours.
    pub fn luminance(self) -> Picture {
        match self {
            Self::Gray(seen) => seen,
            Self::Color(seen) => seen.luminance(),
        }
    }

    /// The linear value that is shown as white.
    pub fn white(&self, scale: Scale) -> f32 {
        match (self, scale) {
            (_, Scale::White(white)) => white,
            (Self::Gray(seen), scale) => seen.white(scale),
            (Self::Color(seen), Scale::Percentile(part)) => seen.percentile(part),
        }
    }

    /// Values divided by the white one, clipped to [0, 1] and sRGB-coded: what a screen is given, in colour red, green and blue of each
    /// pixel.
    pub fn coded(&self, scale: Scale) -> Vec<f32> {
        match self {
            Self::Gray(seen) => seen.coded(scale),
            Self::Color(seen) => {
                let white = self.white(scale);
                let gain = if white > 0.0 { 1.0 / white } else { 0.0 };
                seen.rgb.as_flattened().iter().map(|v| srgb_from_linear((v * gain).clamp(0.0, 1.0))).collect()
            }
        }
    }

    /// The value to show as white so that it is as bright as its target, whose white is `white`: in gray by least squares,
    /// in colour by the light in all ([`ColorPicture::white_like`]).
    pub fn white_like(&self, target: &ColorPicture, white: f32) -> f32 {
        match self {
            Self::Gray(seen) => match metrics::gain(seen, &target.luminance(), white) {
                gain if gain > 0.0 => (f64::from(white) / gain) as f32,
                _ => self.white(Scale::Percentile(0.995)),
            },
            Self::Color(seen) => seen.white_like(target, white),
        }
    }

    /// Compares it with its target, both linear, after one least-squares gain; white is `white`.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn likeness(&self, target: &ColorPicture, white: f32) -> Likeness {
        match self {
            Self::Gray(seen) => metrics::likeness(seen, &target.luminance(), white),
            Self::Color(seen) => seen.likeness(target, white),
        }
    }
}
