//! The lamp that a finished plate is looked at with: as wide and as coloured as in life.
//!
//! Each place of a lamp lights the plate from a direction of its own, in each of its wavelengths; their pictures lie beside
//! each other by the lamp's angle times the depth from the plate, and add up as intensities. That blurs what is far from
//! the plate and averages speckle out: with none of it a plate of matte surfaces is seen in full speckle.

use crate::config::ConfigFile;
use crate::error::{Error, Result};
use crate::units::{self, show_length};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use std::fmt;

/// A round lamp with a spectrum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lamp {
    /// Diameter [m]; 0 for a point.
    pub diameter: f64,
    /// Distance from the plate [m].
    pub distance: f64,
    /// Full width at half maximum of its spectrum, a Gaussian, about each of the plate's wavelengths [m]; 0 for a laser.
    pub bandwidth: f64,
}

impl fmt::Display for Lamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { diameter, distance, bandwidth } = *self;
        match diameter > 0.0 {
            true => write!(f, "lamp of {} at {}", show_length(diameter), show_length(distance))?,
            false => f.write_str("point")?,
        }
        if bandwidth > 0.0 { write!(f, ", {} wide in wavelength", show_length(bandwidth)) } else { Ok(()) }
    }
}

/// A plate's lamp in TOML.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LampFile {
    diameter: String,
    distance: String,
    bandwidth: Option<String>,
}

impl LampFile {
    pub(super) fn read(&self, at: ConfigFile) -> Result<Lamp> {
        Ok(Lamp {
            diameter: at.read("lamp.diameter", &self.diameter, units::length)?,
            distance: at.read("lamp.distance", &self.distance, units::positive_length)?,
            bandwidth: self
                .bandwidth
                .as_ref()
                .map_or(Ok(0.0), |text| at.read("lamp.bandwidth", text, units::length))?,
        })
    }
}

/// Light of one wavelength of a lamp.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LampLight {
    /// Wavelength [m].
    pub(super) wavelength: f64,
    /// Share of the lamp's light.
    pub(super) share: f64,
    /// By how much the light of each place differs from the reference's spatial frequency along x and y [cycles/m].
    pub(super) tilts: Vec<[f64; 2]>,
}

/// Most places of a lamp.
const MOST_PLACES: usize = 4096;

impl Lamp {
    /// What is wrong with it for light of `wavelength` [m], by the name of what is wrong.
    pub(super) fn check(&self, wavelength: f64) -> Result<(), (&'static str, String)> {
        let &Self { diameter, distance, bandwidth } = self;
        if !(diameter >= 0.0 && distance > 0.0 && distance.is_finite() && diameter <= distance) {
            return Err(("lamp", format!("{diameter} m wide at {distance} m must be farther than wide")));
        }
        if !(0.0..0.25 * wavelength).contains(&bandwidth) {
            let what = format!("{bandwidth} m must be less than a quarter of the wavelength {wavelength} m");
            return Err(("bandwidth", what));
        }
        Ok(())
    }

    /// Light of so many wavelengths about `wavelength` [m], from `places` places in all.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a lamp wider than far, a spectrum wider than its wavelength allows, and no or too many places.
    pub(super) fn light(&self, wavelength: f64, places: usize) -> Result<Vec<LampLight>> {
        self.check(wavelength).map_err(|(name, what)| Error::parameter(name, what))?;
        let &Self { diameter, distance, bandwidth } = self;
        if !(1..=MOST_PLACES).contains(&places) {
            return Err(Error::parameter("lamp", format!("{places} places must be 1 to {MOST_PLACES}")));
        }
        let count = if bandwidth > 0.0 { ((places as f64).sqrt().round() as usize).clamp(1, 9) } else { 1 };
        // 2.4 σ on each side hold 98 % of a Gaussian.
        let sigma = bandwidth / (8.0 * 2f64.ln()).sqrt();
        let offset = |i: usize| 2.4 * sigma * ((2 * i + 1) as f64 / count as f64 - 1.0);
        let weight = |i: usize| if sigma > 0.0 { (-0.5 * (offset(i) / sigma).powi(2)).exp() } else { 1.0 };
        let whole: f64 = (0..count).map(weight).sum();
        let each = places.div_ceil(count);
        let radius = 0.5 * diameter / distance;
        let light = |i: usize| {
            let wavelength = wavelength + offset(i);
            // Places on a spiral by the golden angle cover a disc evenly; each wavelength has others.
            let tilt = |n: usize| {
                let of = ((n * count + i) as f64 + 0.5) / (each * count) as f64;
                let angle = (n * count + i) as f64 * PI * (3.0 - 5f64.sqrt()) % TAU;
                let sine = if diameter > 0.0 { radius * of.sqrt() / wavelength } else { 0.0 };
                [sine * angle.cos(), sine * angle.sin()]
            };
            let places = if diameter > 0.0 { each } else { 1 };
            LampLight { wavelength, share: weight(i) / whole, tilts: (0..places).map(tilt).collect() }
        };
        Ok((0..count).map(light).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lamp_is_as_wide_and_as_coloured_as_asked() {
        let lamp = Lamp { diameter: 3e-3, distance: 0.3, bandwidth: 20e-9 };
        let light = lamp.light(633e-9, 64).expect("light");
        assert_eq!((light.len(), light.iter().map(|l| l.tilts.len()).sum::<usize>()), (8, 64));
        assert!((light.iter().map(|l| l.share).sum::<f64>() - 1.0).abs() < 1e-12);
        let mean = |f: &dyn Fn(f64) -> f64| light.iter().map(|l| l.share * f(l.wavelength)).sum::<f64>();
        assert!((mean(&|w| w) - 633e-9).abs() < 1e-15);
        // Cut at 2.4 σ on each side a Gaussian keeps 0.95 of its σ of 8.5 nm.
        let deviation = mean(&|w| (w - 633e-9).powi(2)).sqrt();
        assert!((deviation / 20e-9 * (8.0 * 2f64.ln()).sqrt() - 0.95).abs() < 0.05, "{deviation}");
        // A disc of radius ρ has a mean square of ρ²/4 along each axis.
        for axis in 0..2 {
            let tilts = light.iter().flat_map(|l| l.tilts.iter().map(|t| t[axis] * l.wavelength));
            let square = tilts.clone().map(|t| t * t).sum::<f64>() / 64.0;
            assert!((square.sqrt() / 5e-3 - 0.5).abs() < 0.03, "{square}");
            assert!(tilts.sum::<f64>().abs() / 64.0 < 0.2e-3);
        }
        let laser = Lamp { diameter: 0.0, bandwidth: 0.0, ..lamp }.light(633e-9, 64).expect("laser");
        assert_eq!(laser, [LampLight { wavelength: 633e-9, share: 1.0, tilts: vec![[0.0; 2]] }]);
        for wrong in
            [Lamp { diameter: 1.0, ..lamp }, Lamp { diameter: f64::NAN, ..lamp }, Lamp { bandwidth: 0.2e-6, ..lamp }]
        {
            assert!(wrong.light(633e-9, 64).is_err(), "{wrong:?}");
        }
        assert!(lamp.light(633e-9, 0).is_err());
    }
}
