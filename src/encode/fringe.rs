//! The algebra of fringes: what an object u makes with a reference r of unit modulus, and how the orders stay apart.
//!
//! A fringe lit with its reference gives three orders: the object, the zero order along the reference, and the conjugate at
//! twice its angle ([`super::off_axis`] has the products). With the reference's spatial frequency f_r along the carrier's
//! axis and the object's half band b they lie apart where b ≤ f_r/s and f_r + b stays below the grid's limit 1/(2·pitch);
//! the separation s is 1 for the interference term alone and 3 with the object's own |u|², which is 2b wide.

use crate::error::{Error, Result};
use crate::field::{Complex32, Grid};
use serde::{Deserialize, Serialize};
use std::f32::consts::PI;

/// What a pixel of a fringe stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// The interference term alone, ½ + ½·Re(u·r*)/A: no light scattered by the object with itself.
    #[default]
    Bipolar,
    /// |u + ρ·r|², as a photographic plate records it.
    Intensity,
    /// The phase of u·r*, for plates whose relief or index follows the level.
    Phase,
}

impl Quantity {
    /// Object bands that the carrier must be away from the zero order; none where there is neither conjugate nor
    /// self-interference to keep off.
    pub(crate) fn separation(self) -> Option<f64> {
        match self {
            Self::Bipolar => Some(1.0),
            Self::Intensity => Some(3.0),
            Self::Phase => None,
        }
    }
}

/// A normalised fringe.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fringe {
    quantity: Quantity,
    /// Amplitude A of the object that swings the fringe fully.
    amplitude: f32,
    /// Amplitude ρ of the reference beside the object.
    rho: f32,
    /// (A + ρ)².
    brightest: f32,
    /// Value of a fringe without object light.
    bias: f32,
    /// Factor on the swing about the bias.
    contrast: f32,
}

impl Fringe {
    /// A fringe that an object of `amplitude` A swings from 0 to 1; `ratio` is ρ/A.
    pub(crate) fn new(quantity: Quantity, amplitude: f32, ratio: f64) -> Self {
        let wide = f64::from(amplitude);
        let brightest = (wide + wide * ratio).powi(2) as f32;
        Self { quantity, amplitude, rho: amplitude * ratio as f32, brightest, bias: 0.5, contrast: 1.0 }
    }

    /// The same about another bias, with another contrast.
    pub(crate) fn with_swing(self, bias: f32, contrast: f32) -> Self {
        Self { bias, contrast, ..self }
    }

    /// The fringe's value; beyond 0 … 1 where the object is brighter than A.
    pub(crate) fn value(&self, u: Complex32, r: Complex32) -> f32 {
        match self.quantity {
            Quantity::Bipolar => self.bias + 0.5 * self.contrast * (u * r.conj()).re / self.amplitude,
            Quantity::Intensity => self.bias - 0.5 + self.contrast * (u + r * self.rho).norm_sqr() / self.brightest,
            Quantity::Phase => (u * r.conj()).arg() / (2.0 * PI) + 0.5,
        }
    }

    /// Pulse width by amplitude: 1 where the phase of u·r* is within ±arcsin(|u|/A), else 0 (Lee 1979).
    pub(crate) fn pulse(&self, u: Complex32, r: Complex32) -> f32 {
        let width = (u.norm() / self.amplitude).min(1.0).asin();
        if (u * r.conj()).arg().abs() < width { 1.0 } else { 0.0 }
    }
}

/// Which phases of u·r* are open in one bit: those within `half` of `middle` [rad].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OpenArc {
    pub(crate) middle: f32,
    pub(crate) half: f32,
}

impl OpenArc {
    /// 1 where a phase is open, 0 where it is not, with each edge drawn in by a phase [rad]; what has no edges is as it was.
    pub(crate) fn open(&self, phase: f32, drawn_in: f32) -> f32 {
        let aside = (phase - self.middle + PI).rem_euclid(2.0 * PI) - PI;
        let half = if self.half > 0.0 && self.half < PI { self.half - drawn_in } else { self.half };
        if aside.abs() < half { 1.0 } else { 0.0 }
    }
}

impl Fringe {
    /// What is open of a fringe that is cut at its middle ([`Fringe::value`] above ½), or of the pulses of [`Fringe::pulse`].
    pub(crate) fn open_arc(&self, u: Complex32, pulses: bool) -> OpenArc {
        let modulus = u.norm();
        let cosine = |swing: f32, rest: f32| if swing > 0.0 { (rest / swing).clamp(-1.0, 1.0).acos() } else { 0.0 };
        match self.quantity {
            _ if pulses => OpenArc { middle: 0.0, half: (modulus / self.amplitude).min(1.0).asin() },
            Quantity::Bipolar => {
                let half = cosine(0.5 * self.contrast * modulus / self.amplitude, 0.5 - self.bias);
                OpenArc { middle: 0.0, half }
            }
            Quantity::Intensity => {
                let rest = (1.0 - self.bias) * self.brightest / self.contrast - modulus * modulus - self.rho * self.rho;
                OpenArc { middle: 0.0, half: cosine(2.0 * self.rho * modulus, rest) }
            }
            Quantity::Phase => OpenArc { middle: 0.5 * PI, half: 0.5 * PI },
        }
    }
}

/// A carrier along one axis of a grid: the moduli of its lowest and highest spatial frequency [cycles/m].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carrier {
    pub(crate) lowest: f64,
    pub(crate) highest: f64,
    /// Distance of neighbouring samples along the axis [m].
    pub(crate) pitch: f64,
    /// Shortest wavelength of the light [m].
    pub(crate) wavelength: f64,
}

impl Carrier {
    /// The grid's limit along the axis [cycles/m].
    pub(crate) fn limit(&self) -> f64 {
        0.5 / self.pitch
    }

    /// The carrier's share of the limit.
    pub(crate) fn share(&self) -> f64 {
        self.lowest / self.limit()
    }

    /// Half band that fits between carrier and limit [cycles/m]; `least` is the share of the limit below which a band holds
    /// no picture: a plate's many pixels show one in a sixteenth, a panel needs an eighth.
    ///
    /// # Errors
    /// [`Error::Undersampled`].
    pub(crate) fn below_limit(&self, least: f64) -> Result<f64> {
        let (room, least) = (self.limit() - self.highest, least * self.limit());
        if room >= least {
            return Ok(room);
        }
        let most = ((self.limit() - least) * self.wavelength).min(1.0).asin().to_degrees();
        Err(self.undersampled(
            self.highest + least,
            format!("take a reference angle below {most:.3} deg, or a finer pitch"),
        ))
    }

    /// Half band that fits between carrier and zero order [cycles/m]; `least` as above.
    ///
    /// # Errors
    /// [`Error::OutOfRange`].
    pub(crate) fn beside_zero_order(&self, separation: f64, least: f64) -> Result<f64> {
        let (room, least) = (self.lowest / separation, least * self.limit());
        if room >= least {
            return Ok(room);
        }
        let needed = separation * least;
        let angle = (needed * self.wavelength).min(1.0).asin().to_degrees();
        let limit = format!(
            "puts the zero order on the object; take at least {needed:.4e} cycles/m ({angle:.2} deg) along one axis"
        );
        Err(Error::out_of_range("reference", format!("a carrier of {:.4e} cycles/m", self.lowest), limit))
    }

    /// Reference and object together pass the limit.
    pub(crate) fn undersampled(&self, frequency: f64, hint: String) -> Error {
        let (limit, pitch) = (self.limit(), self.pitch);
        Error::Undersampled { what: "reference wave and object", frequency, limit, pitch, hint }
    }
}

/// The carriers along x and y of a plane reference on a grid, and the axis that decides: the one of the larger share.
pub(crate) fn carriers(frequency: [f64; 2], grid: &Grid, wavelength: f64) -> ([Carrier; 2], usize) {
    let pitch = [grid.pitch_x, grid.pitch_y];
    let along = [0, 1].map(|axis| {
        let f: f64 = frequency[axis].abs();
        Carrier { lowest: f, highest: f, pitch: pitch[axis], wavelength }
    });
    (along, deciding(&along))
}

/// The axis whose carrier has the larger share of the limit.
pub(crate) fn deciding(carriers: &[Carrier; 2]) -> usize {
    usize::from(carriers[1].share() > carriers[0].share())
}

/// The value that `rank` others do not exceed; 0 of none.
pub(crate) fn order_statistic(values: &mut [f32], rank: usize) -> f32 {
    match values.len().checked_sub(1) {
        Some(last) => *values.select_nth_unstable_by(rank.min(last), f32::total_cmp).1,
        None => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_open_arc_is_where_the_value_is_above_its_middle() {
        for quantity in [Quantity::Bipolar, Quantity::Intensity, Quantity::Phase] {
            for (bias, contrast) in [(0.5, 1.0), (0.4, 1.5)] {
                let fringe = Fringe::new(quantity, 2.0, 1.3).with_swing(bias, contrast);
                for i in 0..400 {
                    let u = Complex32::from_polar(0.007 * i as f32, 0.37 * i as f32);
                    let r = Complex32::from_polar(1.0, -0.11 * i as f32);
                    let (value, phase) = (fringe.value(u, r), (u * r.conj()).arg());
                    if (value - 0.5).abs() > 1e-4 && u.norm() > 0.0 {
                        let open = fringe.open_arc(u, false).open(phase, 0.0);
                        assert_eq!(open, f32::from(value > 0.5), "{quantity:?} {bias} {u} {value}");
                    }
                    assert_eq!(fringe.open_arc(u, true).open(phase, 0.0), fringe.pulse(u, r));
                }
            }
        }
        let arc = OpenArc { middle: 0.0, half: 1.0 };
        assert_eq!([0.9, -0.9, 0.7].map(|phase| arc.open(phase, 0.2)), [0.0, 0.0, 1.0]);
        assert_eq!([1.1, -1.1, 1.3].map(|phase| arc.open(phase, -0.2)), [1.0, 1.0, 0.0]);
    }
}
