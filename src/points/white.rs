//! What a hologram does with light that a picture shows as white and brighter.
//!
//! A lamp is a hundred times brighter than the wall that it lights. Kept so, it takes most of the panel's light and its
//! whole dynamic range; a photographer lets it burn out.
//!
//! *Brightness* is the largest of linear red, green and blue: what a screen clips first, so that a saturated red is not
//! shown brighter than a screen can, and a picture and its hologram burn out in the same places.

use super::placement::WorldPoint;
use super::{Channel, luminance};
use crate::error::{Error, Result};
use serde::Serialize;

/// What is done with light that is brighter than a picture's white.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum WhitePoint {
    /// Radiance is kept as it is.
    #[default]
    Unlimited,
    /// Brightness is clipped at `white_level` of the picture, colour kept.
    Auto,
    /// Brightness is clipped at this value [W/(m² sr)].
    At(f32),
}

/// Where white lies, and what of the light is brighter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct WhiteLevel {
    /// What pictures show as white [W/(m² sr)].
    pub white: f32,
    /// Whether light beyond it was clipped in the points, too.
    pub clips: bool,
    /// Brightness of the brightest point before anything was clipped [W/(m² sr)].
    pub brightest: f32,
    /// Points brighter than white.
    pub brighter_points: usize,
    /// Their share of the points, 0 to 1.
    pub brighter_share: f64,
    /// Share of the points' luminance that lies above white, 0 to 1: what clipping takes away.
    pub light_above: f64,
}

impl WhiteLevel {
    /// Share of the light that was clipped, 0 to 1.
    pub fn clipped_light(&self) -> f64 {
        if self.clips { self.light_above } else { 0.0 }
    }
    /// Points that were clipped.
    pub fn clipped_points(&self) -> usize {
        if self.clips { self.brighter_points } else { 0 }
    }
}

impl WhitePoint {
    /// Clips points that were traced with `picture` (linear RGB radiance); says what is above white even where nothing is
    /// clipped.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a white that is not greater than zero.
    pub fn apply(self, points: &mut [WorldPoint], picture: &[[f32; 3]]) -> Result<WhiteLevel> {
        let white = match self {
            Self::Unlimited | Self::Auto => white_level(picture),
            Self::At(white) if white.is_finite() && white > 0.0 => white,
            Self::At(white) => return Err(Error::out_of_range("white", white, "must be greater than zero")),
        };
        let mut level = WhiteLevel { white, clips: self != Self::Unlimited, ..WhiteLevel::default() };
        let (mut all, mut above) = (0.0, 0.0);
        for point in points.iter_mut() {
            let (brightness, light) = (brightness(point.radiance), f64::from(luminance(point.radiance)));
            all += light;
            level.brightest = level.brightest.max(brightness);
            if brightness > white {
                let kept = white / brightness;
                above += light * f64::from(1.0 - kept);
                level.brighter_points += 1;
                if level.clips {
                    point.radiance = point.radiance.map(|c| c * kept);
                }
            }
        }
        level.brighter_share = level.brighter_points as f64 / points.len().max(1) as f64;
        level.light_above = if all > 0.0 { above / all } else { 0.0 };
        Ok(level)
    }
}

/// Largest of linear red, green and blue.
fn brightness(rgb: [f32; 3]) -> f32 {
    [Channel::Red, Channel::Green, Channel::Blue].map(|c| c.of(rgb)).into_iter().fold(0.0, f32::max)
}

/// Brightness that pictures of a scene show as white [W/(m² sr)]: a quarter above what 97 % of its lit pixels do not
/// pass; 1 for a picture without light.
pub(crate) fn white_level(picture: &[[f32; 3]]) -> f32 {
    let mut lit: Vec<f32> = picture.iter().map(|rgb| brightness(*rgb)).filter(|l| *l > 0.0).collect();
    lit.sort_by(f32::total_cmp);
    lit.get(lit.len() * 97 / 100).map_or(1.0, |level| 1.25 * level)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn points(radiances: &[[f32; 3]]) -> Vec<WorldPoint> {
        radiances.iter().map(|&radiance| WorldPoint { position: DVec3::ZERO, radiance }).collect()
    }

    #[test]
    fn a_lamp_burns_out_and_is_counted() {
        // A wall of 99 pixels of luminance 0.5 and a warm lamp of 20, 10, 5.
        let mut picture = vec![[0.5; 3]; 99];
        picture.push([20.0, 10.0, 5.0]);
        let mut seen = points(&picture);
        let level = WhitePoint::Auto.apply(&mut seen, &picture).expect("white");
        assert!((level.white - 0.625).abs() < 1e-6 && level.brightest == 20.0);
        assert_eq!((level.clipped_points(), level.brighter_share), (1, 0.01));
        // Its hue stays: 20 : 10 : 5, brightness at white.
        let lamp = seen[99].radiance;
        assert!((lamp[0] - 0.625).abs() < 1e-6 && lamp[0] / lamp[1] == 2.0 && lamp[1] / lamp[2] == 2.0);
        let before = f64::from(luminance([20.0, 10.0, 5.0]));
        let lost = before - f64::from(luminance(lamp));
        assert!((level.clipped_light() - lost / (99.0 * 0.5 + before)).abs() < 1e-6, "{level:?}");
        let mut seen = points(&picture);
        let full = WhitePoint::Unlimited.apply(&mut seen, &picture).expect("white");
        assert!(seen == points(&picture) && full.clipped_points() == 0 && full.clipped_light() == 0.0);
        assert!(full.brighter_points == 1 && full.light_above == level.light_above && full.white == level.white);
    }

    #[test]
    fn saturated_colours_count_by_what_a_screen_clips() {
        // A red wall: its luminance is a fifth of its red, and it must not be shown five times too bright.
        let picture = vec![[0.8, 0.0, 0.0]; 50];
        assert!((white_level(&picture) - 1.0).abs() < 1e-6);
        assert_eq!(white_level(&[[0.0; 3]]), 1.0);
        let mut seen = points(&picture);
        let level = WhitePoint::At(0.4).apply(&mut seen, &picture).expect("white");
        assert!(level.clipped_points() == 50 && (level.clipped_light() - 0.5).abs() < 1e-6);
        for wrong in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(WhitePoint::At(wrong).apply(&mut seen, &picture).is_err(), "{wrong}");
        }
    }
}
