//! Light of three lasers that an eye sees as the scene's colours.
//!
//! A scene's radiance is linear Rec.709 (sRGB primaries, white D65). A laser of wavelength λ and unit radiant power looks
//! like the tristimulus values (x̄(λ), ȳ(λ), z̄(λ)) of the CIE 1931 observer ([`observer`]). With these as the columns of
//! L, and M the matrix XYZ ← Rec.709, the powers
//!
//! ```text
//! p = L⁻¹·M·rgb
//! ```
//!
//! have the luminance *and* the chromaticity of `rgb`. *Drives* are powers over those of white, d_i = p_i / p_i(1, 1, 1):
//! a white of radiance 1 has drives (1, 1, 1) whatever the lasers, and a hologram's point has amplitude √d_i × distance.
//!
//! A colour outside the triangle of the lasers needs a negative power. It is moved towards the gray of its own luminance,
//! just as far as the triangle's edge: brightness is kept and saturation given up ([`Lasers::drive`]).

pub mod observer;

use super::{PointCloud, PointSource, luminance};
use crate::error::{Error, Result};
use crate::units::show_length;
use glam::{DMat3, DVec3};
use serde::Serialize;

/// Names of the three channels, by falling wavelength.
pub const NAMES: [&str; 3] = ["red", "green", "blue"];

/// Chromaticities x, y of the Rec.709 primaries and of the white D65 (ITU-R BT.709-6, table 1).
const REC_709: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];
const D65: [f64; 2] = [0.3127, 0.3290];

/// A negative drive above this share of the largest is rounding, not a colour out of gamut.
const ROUNDING: f64 = 1e-6;

/// Three lasers and how they make colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lasers {
    wavelengths: [f64; 3],
    white: [f64; 3],
    drive_from_rgb: DMat3,
    rgb_from_drive: DMat3,
}

/// Drives of the three lasers for one colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Power of each laser over its power in white; none is negative.
    pub values: [f32; 3],
    /// Part of the colour's saturation that was kept: 1 inside the gamut, less where it was moved towards gray.
    pub kept: f32,
}

/// What the lasers' gamut did to a cloud.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Gamut {
    /// Points whose colour the lasers cannot make.
    pub outside_points: usize,
    /// Their share of the points, 0 to 1.
    pub outside_share: f64,
    /// Their share of the cloud's luminous light (Σ amplitude², Rec.709 luminance), 0 to 1.
    pub outside_light: f64,
    /// The least part of a point's saturation that was kept; 1 where nothing was moved.
    pub least_kept: f64,
}

impl Lasers {
    /// Lasers of three vacuum wavelengths [m], in any order.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a wavelength outside 380 … 780 nm, and for lasers whose triangle does not hold white:
    /// two of nearly one colour, or none at an end of the spectrum.
    pub fn new(mut wavelengths: [f64; 3]) -> Result<Self> {
        wavelengths.sort_by(|a, b| b.total_cmp(a));
        let mut columns = [DVec3::ZERO; 3];
        for (column, wavelength) in columns.iter_mut().zip(wavelengths) {
            *column = observer::tristimulus(wavelength).map(DVec3::from_array).ok_or_else(|| {
                let what = format!("{} is not visible: 380nm to 780nm", show_length(wavelength));
                Error::parameter("wavelengths", what)
            })?;
        }
        let xyz_from_power = DMat3::from_cols(columns[0], columns[1], columns[2]);
        let xyz_from_rgb = xyz_from_rec709();
        let white = xyz_from_power.inverse() * (xyz_from_rgb * DVec3::ONE);
        // The 1e-3 keeps away from lasers between which one can hardly tell: their powers would be huge differences.
        let enough = 1e-3 * white.abs().max_element();
        if !(white.is_finite() && white.min_element() > enough) {
            let names = wavelengths.map(show_length).join(", ");
            let what = format!("{names} cannot make white; take one laser each of red, green and blue");
            return Err(Error::parameter("wavelengths", what));
        }
        let drive_from_power = DMat3::from_diagonal(white.recip());
        let drive_from_rgb = drive_from_power * xyz_from_power.inverse() * xyz_from_rgb;
        let rgb_from_drive = drive_from_rgb.inverse();
        Ok(Self { wavelengths, white: white.to_array(), drive_from_rgb, rgb_from_drive })
    }

    /// Vacuum wavelengths, red, green, blue [m].
    pub fn wavelengths(&self) -> [f64; 3] {
        self.wavelengths
    }

    /// Radiant powers in white, per unit of its luminance Y (683 lm/W): relative powers of the three lasers.
    pub fn white(&self) -> [f64; 3] {
        self.white
    }

    /// Drives of a linear Rec.709 colour, d = diag(1/p(white))·L⁻¹·M·rgb.
    ///
    /// Where one would be negative the colour is mixed with the gray of its luminance Y, d = Y + t·(d − Y), with the
    /// largest t that leaves none negative. A colour without luminance gives (0, 0, 0).
    pub fn drive(&self, rgb: [f32; 3]) -> Drive {
        let gray = f64::from(luminance(rgb)).max(0.0);
        let drive = self.drive_from_rgb * DVec3::from_array(rgb.map(f64::from));
        let lowest = drive.min_element();
        if lowest >= -ROUNDING * drive.max_element().abs() {
            return Drive { values: drive.max(DVec3::ZERO).as_vec3().to_array(), kept: 1.0 };
        }
        let kept = gray / (gray - lowest);
        let moved = DVec3::splat(gray).lerp(drive, kept).max(DVec3::ZERO);
        Drive { values: moved.as_vec3().to_array(), kept: kept as f32 }
    }

    /// The linear Rec.709 colour of drives; laser colours outside Rec.709 have negative components.
    pub fn rgb(&self, drive: [f32; 3]) -> [f32; 3] {
        (self.rgb_from_drive * DVec3::from_array(drive.map(f64::from))).as_vec3().to_array()
    }

    /// The points of a cloud as laser `index` (0 red to 2 blue) shows them, in the cloud's order; a colourless cloud is
    /// white.
    ///
    /// With amplitudes √radiance·distance for red, green and blue, the laser's is √drive·distance.
    pub fn points(&self, cloud: &PointCloud, index: usize) -> Vec<PointSource> {
        let mut points = cloud.points.clone();
        for (point, amplitudes) in points.iter_mut().zip(cloud.rgb.iter().flatten()) {
            point.amplitude = self.drive(amplitudes.map(|a| a * a)).values[index].sqrt();
        }
        points
    }

    /// What the lasers' gamut does to a cloud.
    pub fn gamut(&self, cloud: &PointCloud) -> Gamut {
        let mut gamut = Gamut { least_kept: 1.0, ..Gamut::default() };
        let Some(rgb) = &cloud.rgb else { return gamut };
        let (mut all, mut outside) = (0.0, 0.0);
        for amplitudes in rgb {
            let color = amplitudes.map(|a| a * a);
            let light = f64::from(luminance(color));
            all += light;
            let kept = self.drive(color).kept;
            if kept < 1.0 {
                gamut.outside_points += 1;
                outside += light;
                gamut.least_kept = gamut.least_kept.min(f64::from(kept));
            }
        }
        gamut.outside_share = gamut.outside_points as f64 / rgb.len().max(1) as f64;
        gamut.outside_light = if all > 0.0 { outside / all } else { 0.0 };
        gamut
    }
}

/// M: XYZ ← linear Rec.709, from the primaries' chromaticities and white, Y = 1 for white.
fn xyz_from_rec709() -> DMat3 {
    let xyz = |[x, y]: [f64; 2]| DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
    let primaries = DMat3::from_cols(xyz(REC_709[0]), xyz(REC_709[1]), xyz(REC_709[2]));
    primaries * DMat3::from_diagonal(primaries.inverse() * xyz(D65))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NM: f64 = 1e-9;

    fn lasers() -> Lasers {
        Lasers::new([638.0 * NM, 532.0 * NM, 450.0 * NM]).expect("lasers")
    }

    fn close(a: [f32; 3], b: [f32; 3], error: f32) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= error)
    }

    /// What the eye sees of drives: powers on the observer's functions.
    fn seen(lasers: &Lasers, drive: [f32; 3]) -> DVec3 {
        (0..3)
            .map(|i| {
                let power = f64::from(drive[i]) * lasers.white[i];
                power * DVec3::from_array(observer::tristimulus(lasers.wavelengths[i]).expect("visible"))
            })
            .sum()
    }

    #[test]
    fn the_matrix_of_srgb_comes_out() {
        // IEC 61966-2-1, to its four digits.
        let standard = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        let found = xyz_from_rec709().transpose().to_cols_array_2d();
        for (row, expected) in found.iter().zip(standard) {
            assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 6e-5), "{row:?} is not {expected:?}");
        }
    }

    #[test]
    fn colours_keep_luminance_and_chromaticity() {
        let lasers = lasers();
        let white = lasers.drive([1.0; 3]);
        assert!(close(white.values, [1.0; 3], 1e-6) && white.kept == 1.0, "{white:?}");
        for rgb in [[1.0, 1.0, 1.0], [0.8, 0.1, 0.05], [0.2, 0.6, 0.1], [0.3, 0.3, 0.9], [10.0, 5.0, 2.0]] {
            let drive = lasers.drive(rgb);
            assert_eq!(drive.kept, 1.0, "{rgb:?}");
            let wanted = xyz_from_rec709() * DVec3::from_array(rgb.map(f64::from));
            let error = (seen(&lasers, drive.values) - wanted).length() / wanted.length();
            assert!(error < 1e-6, "{rgb:?}: {error}");
            assert!(close(lasers.rgb(drive.values), rgb, 2e-6 * rgb[0].max(1.0)), "{:?}", lasers.rgb(drive.values));
        }
    }

    #[test]
    fn each_laser_makes_its_own_colour() {
        let lasers = lasers();
        for i in 0..3 {
            let mut alone = [0.0; 3];
            alone[i] = 1.0;
            // Its light as Rec.709 (with negative parts: it is more saturated than the primaries) asks for it alone.
            let back = lasers.drive_from_rgb * DVec3::from_array(lasers.rgb(alone).map(f64::from));
            assert!((back - DVec3::from_array(alone.map(f64::from))).length() < 1e-6, "{back}");
        }
    }

    #[test]
    fn colours_out_of_gamut_keep_their_luminance() {
        // The Rec.709 blue lies a little beyond the line from 520 to 450 nm, and farther beyond that from 532 to 473 nm:
        // shares of its saturation from the same formulas in another program.
        for (wavelengths, kept, error) in [([638.0, 520.0, 450.0], 0.9351, 5e-4), ([638.0, 532.0, 473.0], 0.5727, 5e-4)]
        {
            let lasers = Lasers::new(wavelengths.map(|w| w * NM)).expect("lasers");
            let blue = [0.0, 0.0, 1.0];
            let drive = lasers.drive(blue);
            assert!(drive.values.iter().all(|v| *v >= 0.0));
            assert!((drive.kept - kept).abs() < error, "{drive:?}");
            assert!((seen(&lasers, drive.values).y - 0.0722).abs() < 1e-4, "{drive:?}");
            // On the edge of the triangle: one laser is dark.
            assert!(drive.values.iter().any(|v| *v < 1e-6), "{drive:?}");
        }
        let black = lasers().drive([0.0; 3]);
        assert!(black.values == [0.0; 3] && black.kept == 1.0);
    }

    #[test]
    fn clouds_are_divided_among_the_lasers() {
        let at = |z| PointSource { position: DVec3::new(0.0, 0.0, z), amplitude: 1.0, phase: 0.5 };
        let rgb = vec![[2.0, 2.0, 2.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
        let cloud = PointCloud { points: vec![at(-0.1), at(-0.2), at(-0.3)], rgb: Some(rgb) };
        let lasers = Lasers::new([520.0 * NM, 450.0 * NM, 638.0 * NM]).expect("lasers");
        assert!((lasers.wavelengths()[0] - 638e-9).abs() < 1e-15, "sorted by falling wavelength");
        let each = [0, 1, 2].map(|index| lasers.points(&cloud, index));
        let gamut = lasers.gamut(&cloud);
        assert!(each.iter().all(|points| (points[0].amplitude - 2.0).abs() < 1e-5), "white is white in each");
        assert!(each[0][2].amplitude > 5.0 * each[2][2].amplitude, "red is the red laser's");
        assert!(each[2][1].amplitude > 3.0 * each[1][1].amplitude, "blue is the blue laser's");
        assert!(each.iter().all(|points| points.iter().zip(&cloud.points).all(|(a, b)| a.position == b.position)));
        assert_eq!(gamut.outside_points, 1);
        assert!((gamut.outside_light - 0.0722 / (4.0 + 0.0722 + 0.2126)).abs() < 1e-6, "{gamut:?}");
        let plain = PointCloud { rgb: None, ..cloud };
        let each = [0, 1, 2].map(|index| lasers.points(&plain, index));
        assert!(each.iter().all(|points| *points == plain.points) && lasers.gamut(&plain).outside_points == 0);
    }

    #[test]
    fn lasers_that_make_no_white_are_refused() {
        for (wavelengths, expected) in [
            ([638.0, 532.0, 1064.0], "1.064um"),
            ([638.0, 532.0, 532.0], "white"),
            ([638.0, 620.0, 450.0], "white"),
            ([550.0, 532.0, 510.0], "white"),
            ([638.0, f64::NAN, 450.0], "visible"),
        ] {
            let said = Lasers::new(wavelengths.map(|w| w * NM)).expect_err("refused").to_string();
            assert!(said.contains(expected), "{wavelengths:?}: {said}");
        }
    }
}
