//! Three reconstructions, each in the light of its own laser, as one picture in colour.
//!
//! The intensities of red, green and blue are drives of the lasers ([`Lasers`]), up to one factor that is the same for all
//! three only if all collect a point's light alike. Through an *eye* they do: a point's wave has intensity a²/r² in the
//! pupil, whatever its wavelength. A sensor on a *plane* takes the whole cone that the panel sends, which is wider in red:
//! there each picture is divided by its solid angle first ([`super::flat_field`]).
//!
//! Fields are those that were encoded ([`crate::panel::EncodingRecord::scale`] divided out); on a real panel the lasers'
//! powers do that ([`laser_powers`]).

use super::metrics::{Likeness, blocks, psnr, ssim};
use super::{Cone, Picture, View, ViewSettings, all_in_focus, picture};
use crate::error::Result;
use crate::field::Field;
use crate::points::colour::Lasers;
use crate::points::luminance;
use crate::progress::Progress;
use crate::scene::texture::srgb_from_linear;
use glam::DVec2;
use std::cell::Cell;

/// A picture in linear Rec.709, row 0 on top; components are negative where a laser's light is outside Rec.709.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorPicture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear red, green and blue; any scale.
    pub rgb: Vec<[f32; 3]>,
}

/// Light of three lasers behind a panel.
#[derive(Clone, Debug)]
pub struct ColorLight {
    /// The lasers.
    pub lasers: Lasers,
    /// Field of each, red, green, blue, and how it is looked at; none for a laser without light.
    pub fields: [Option<(Field, ViewSettings)>; 3],
}

impl ColorLight {
    /// A picture of one view on the rectangle ±`half` [m] of its focal plane; on a plane of radiance, its flat field
    /// divided out ([`Cone::flatten`]).
    ///
    /// # Errors
    /// As [`super::picture`].
    pub fn picture(&self, view: &View, half: DVec2, size: (usize, usize), progress: &Progress) -> Result<ColorPicture> {
        self.each(size, |field, settings| {
            let mut seen = picture(field, view, half, size, settings, progress)?;
            if let View::Plane { z } = *view {
                Cone::new(field, settings).flatten(&mut seen, |_| half, |_| z);
            }
            Ok(seen)
        })
    }

    /// A picture in which every pixel is in focus, of radiance, and the number of planes.
    ///
    /// # Errors
    /// As [`super::all_in_focus`].
    pub fn all_in_focus(
        &self,
        depths: &[Option<f64>],
        size: (usize, usize),
        half_at: impl Fn(f64) -> DVec2,
        step: f64,
        progress: &Progress,
    ) -> Result<(ColorPicture, usize)> {
        let farthest = depths.iter().flatten().fold(f64::INFINITY, |a, &z| a.min(z));
        let planes = Cell::new(0);
        let seen = self.each(size, |field, settings| {
            let (mut seen, count) = all_in_focus(field, depths, size, &half_at, step, settings, progress)?;
            planes.set(count);
            Cone::new(field, settings).flatten(&mut seen, &half_at, |i| depths[i].unwrap_or(farthest));
            Ok(seen)
        })?;
        Ok((seen, planes.get()))
    }

    /// Combines what is seen of each laser; one without light is dark.
    fn each(
        &self,
        (width, height): (usize, usize),
        see: impl Fn(&Field, &ViewSettings) -> Result<Picture>,
    ) -> Result<ColorPicture> {
        let see = |i: usize| match &self.fields[i] {
            Some((field, settings)) => see(field, settings),
            None => Ok(Picture { width, height, values: vec![0.0; width * height] }),
        };
        Ok(ColorPicture::combine(&self.lasers, &[see(0)?, see(1)?, see(2)?]))
    }
}

/// Powers of the three lasers for a panel that shows frames of these scales one after another, the largest 1.
///
/// The light behind a frame is scale² times what was encoded, and white needs the lasers' white powers:
/// p_i = p_i(white) / scale_i².
pub fn laser_powers(lasers: &Lasers, scales: [f64; 3]) -> [f64; 3] {
    let white = lasers.white();
    let powers = [0, 1, 2].map(|i| white[i] / scales[i].powi(2));
    let greatest = powers.into_iter().fold(0.0, f64::max);
    powers.map(|p| if greatest > 0.0 { p / greatest } else { 0.0 })
}

impl ColorPicture {
    /// Combines pictures of one view in red, green and blue.
    ///
    /// # Panics
    /// When their sizes differ.
    pub fn combine(lasers: &Lasers, channels: &[Picture; 3]) -> Self {
        let [red, ..] = channels;
        assert!(channels.iter().all(|c| (c.width, c.height) == (red.width, red.height)), "pictures of one size");
        let drive = |i: usize| [0, 1, 2].map(|c| channels[c].values[i]);
        let rgb = (0..red.values.len()).map(|i| lasers.rgb(drive(i))).collect();
        Self { width: red.width, height: red.height, rgb }
    }

    /// The value to show as white, so that this picture has as much light in all as its target, whose white is `white`
    /// (brighter light taken as white); blind to speckle, which least squares take for an error.
    pub fn white_like(&self, target: &Self, white: f32) -> f32 {
        let sum = |rgb: &[[f32; 3]]| rgb.iter().map(|c| f64::from(luminance(*c))).sum::<f64>();
        let clipped: Vec<[f32; 3]> = target.rgb.iter().map(|c| c.map(|v| v.min(white))).collect();
        let (seen, wanted) = (sum(&self.rgb), sum(&clipped));
        if seen > 0.0 && wanted > 0.0 { (f64::from(white) * seen / wanted) as f32 } else { white }
    }

    /// Rec.709 luminance.
    pub fn luminance(&self) -> Picture {
        Picture { width: self.width, height: self.height, values: self.rgb.iter().map(|c| luminance(*c)).collect() }
    }

    /// The value that a part (0 to 1) of the pixels' largest components does not pass.
    pub fn percentile(&self, part: f64) -> f32 {
        let largest = self.rgb.iter().map(|c| c.iter().fold(0.0f32, |a, &b| a.max(b))).collect();
        Picture { width: self.width, height: self.height, values: largest }.white(super::Scale::Percentile(part))
    }

    /// One component, 0 red to 2 blue.
    fn component(&self, c: usize) -> Picture {
        Picture { width: self.width, height: self.height, values: self.rgb.iter().map(|rgb| rgb[c]).collect() }
    }

    /// Compares it with its target, both linear, after one least-squares gain for all three colours; white is `white`.
    ///
    /// PSNR is over all three components; SSIM is that of the luminance.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn likeness(&self, target: &Self, white: f32) -> Likeness {
        assert!((self.width, self.height) == (target.width, target.height), "pictures of one size are compared");
        let pairs = || self.rgb.iter().flatten().zip(target.rgb.iter().flatten());
        let norm: f64 = pairs().map(|(a, _)| f64::from(*a).powi(2)).sum();
        // Values beyond white are shown as white; they must not decide the gain.
        let product: f64 = pairs().map(|(a, b)| f64::from(*a) * f64::from(b.min(white))).sum();
        let gain = if norm > 0.0 { product / norm } else { 0.0 };
        let scaled = Self { rgb: self.rgb.iter().map(|c| c.map(|v| (f64::from(v) * gain) as f32)).collect(), ..*self };
        let coded = |values: &[f32]| -> Vec<f32> {
            values.iter().map(|v| srgb_from_linear((v / white).clamp(0.0, 1.0))).collect()
        };
        let all = |picture: &Self, side: Option<usize>| -> Vec<f32> {
            let each = [0, 1, 2].map(|c| picture.component(c));
            let each = each.map(|p| side.map_or_else(|| p.clone(), |side| blocks(&p, side)));
            each.iter().flat_map(|p| coded(&p.values)).collect()
        };
        let light = |picture: &Self| coded(&picture.luminance().values);
        Likeness {
            psnr: psnr(&all(&scaled, None), &all(target, None)),
            ssim: ssim(&light(&scaled), &light(target), self.width, self.height),
            psnr_blocks: psnr(&all(&scaled, Some(5)), &all(target, Some(5))),
            gain,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lasers() -> Lasers {
        Lasers::new([638e-9, 532e-9, 450e-9]).expect("lasers")
    }

    #[test]
    fn drives_become_the_colours_that_they_came_from() {
        let lasers = lasers();
        let target =
            ColorPicture { width: 2, height: 2, rgb: vec![[1.0; 3], [0.8, 0.1, 0.1], [0.1, 0.7, 0.1], [0.0; 3]] };
        let channels = [0, 1, 2].map(|c| {
            let values = target.rgb.iter().map(|rgb| lasers.drive(*rgb).values[c]).collect();
            Picture { width: 2, height: 2, values }
        });
        let seen = ColorPicture::combine(&lasers, &channels);
        let pairs = || seen.rgb.iter().flatten().zip(target.rgb.iter().flatten());
        assert!(pairs().all(|(a, b)| (a - b).abs() < 1e-5), "{seen:?}");
        assert!((seen.white_like(&target, 1.0) - 1.0).abs() < 1e-5);
    }

    #[test]
    fn likeness_finds_one_gain_and_sees_wrong_colours() {
        let rgb: Vec<[f32; 3]> = (0..600).map(|i| [i as f32 / 600.0, 0.5, 1.0 - i as f32 / 600.0]).collect();
        let target = ColorPicture { width: 30, height: 20, rgb };
        let dim = ColorPicture { rgb: target.rgb.iter().map(|c| c.map(|v| 0.02 * v)).collect(), ..target };
        let found = dim.likeness(&target, 1.0);
        assert!((found.gain - 50.0).abs() < 1e-3 && found.psnr > 100.0 && found.ssim > 0.999, "{found:?}");
        let swapped = ColorPicture { rgb: target.rgb.iter().map(|c| [c[2], c[1], c[0]]).collect(), ..target };
        assert!(swapped.likeness(&target, 1.0).psnr_blocks < 15.0);
    }

    #[test]
    fn powers_make_up_for_the_frames_scales() {
        let lasers = lasers();
        let white = lasers.white();
        let powers = laser_powers(&lasers, [1.0, 1.0, 2.0]);
        assert!((powers[2] / powers[0] - white[2] / white[0] / 4.0).abs() < 1e-12);
        assert!((powers.into_iter().fold(0.0, f64::max) - 1.0).abs() < 1e-12);
    }
}
