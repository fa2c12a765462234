//! Three pictures, each in the light of its own laser, as one in colour.

use super::metrics::{Likeness, blocks, least_squares, psnr, ssim};
use super::{Picture, Scale};
use crate::points::colour::Lasers;
use crate::points::luminance;
use crate::scene::texture::srgb_from_linear;

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
        Picture { width: self.width, height: self.height, values: largest }.white(Scale::Percentile(part))
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
        let gain = least_squares(self.rgb.iter().flatten(), target.rgb.iter().flatten(), white);
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
