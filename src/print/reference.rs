//! The wave that lights the finished plate, and the room that it leaves to the object.
//!
//! A fringe made with the reference r and lit with it again gives the object where it was, the zero order along r and
//! the conjugate beyond it ([`crate::encode::off_axis`] has the algebra). With the reference's spatial frequency f_r
//! along the carrier's axis and the object's half band b the three lie apart where b ≤ f_r (bipolar), b ≤ f_r/3
//! (intensity, whose |u|² is 2b wide), and f_r + b stays below the plate's limit 1/(2·pitch).

use super::plate::Plate;
use crate::encode::fringe::{Carrier, deciding};
use crate::error::{Error, Result};
use crate::field::{Complex32, Complex64};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// On which side of the plate its lamp stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Behind: the plate is looked through.
    #[default]
    Behind,
    /// On the viewer's side: the plate reflects. A thin plate's fringe is the same: only the wave's spatial frequency along
    /// the plate counts.
    Front,
}

/// The wave that lights the finished plate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Reference {
    /// Light along the plate's normal; for phase plates.
    #[default]
    None,
    /// A plane wave.
    Plane {
        /// Angles θ_x and θ_y to the normal [rad]; positive: the light runs towards +x and +y. f = sin θ/λ.
        angle: [f64; 2],
        /// Where the lamp stands.
        side: Side,
    },
    /// A small lamp; its wave diverges.
    Point {
        /// Where it stands, z < 0 behind the plate [m].
        position: [f64; 3],
    },
}

/// A band narrower than this share of the plate's limit shows no picture.
const NARROWEST: f64 = 1.0 / 16.0;

impl Reference {
    /// Lowest and highest spatial frequency along x and along y over the plate, in all its wavelengths [cycles/m].
    pub fn frequencies(&self, plate: &Plate) -> [[f64; 2]; 2] {
        let mut all = plate.wavelengths().iter().map(|&wavelength| self.frequencies_at(plate, wavelength));
        let first = all.next().unwrap_or_default();
        all.fold(first, |ranges, more| [0, 1].map(|i| [ranges[i][0].min(more[i][0]), ranges[i][1].max(more[i][1])]))
    }

    /// The same for one lamp [m].
    pub(super) fn frequencies_at(&self, plate: &Plate, wavelength: f64) -> [[f64; 2]; 2] {
        match *self {
            Self::None => [[0.0; 2]; 2],
            Self::Plane { angle, .. } => angle.map(|a| [a.sin() / wavelength; 2]),
            Self::Point { position: [px, py, pz] } => {
                let half = plate.extent().map(|e| 0.5 * e);
                let nearest = |p: f64, half: f64| (p.abs() - half).max(0.0);
                let farthest = |p: f64, half: f64| p.abs() + half;
                // Along an axis the frequency is monotonic; its ends lie where the other axis is nearest or farthest.
                let ends = |p: f64, half: f64, other: [f64; 2]| {
                    let at = |d: f64| other.map(|o| d / (d * d + o * o + pz * pz).sqrt() / wavelength);
                    let all = [at(-half - p), at(half - p)].concat();
                    [
                        all.iter().copied().fold(f64::INFINITY, f64::min),
                        all.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                    ]
                };
                let aside = |p: f64, half: f64| [nearest(p, half), farthest(p, half)];
                [ends(px, half[0], aside(py, half[1])), ends(py, half[1], aside(px, half[0]))]
            }
        }
    }

    /// The wave of a wavelength [m] at columns `columns` of a row, unit amplitude.
    pub fn row(
        &self,
        plate: &Plate,
        wavelength: f64,
        row: i64,
        columns: std::ops::Range<i64>,
        out: &mut Vec<Complex32>,
    ) {
        out.clear();
        let y = plate.y(row);
        let narrow = |turns: f64| {
            let wave = Complex64::cis(TAU * (turns - turns.floor()));
            Complex32::new(wave.re as f32, wave.im as f32)
        };
        match *self {
            Self::None => out.extend(columns.map(|_| Complex32::new(1.0, 0.0))),
            Self::Plane { angle, .. } => {
                let [fx, fy] = angle.map(|a| a.sin() / wavelength);
                out.extend(columns.map(|column| narrow(fx * plate.x(column) + fy * y)));
            }
            Self::Point { position: [px, py, pz] } => {
                let other = (y - py) * (y - py) + pz * pz;
                let turns = |column: i64| {
                    let dx = plate.x(column) - px;
                    (dx * dx + other).sqrt() / wavelength
                };
                out.extend(columns.map(|column| narrow(turns(column))));
            }
        }
    }
}

/// How far the object's light may spread, and why.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Band {
    /// The plate's limit 1/(2·pitch) is divided by this along x and y: the object's band.
    pub divisor: [u32; 2],
    /// Half width of the band [cycles/m].
    pub half: [f64; 2],
    /// Half angle of the object's light [rad].
    pub angle: [f64; 2],
}

impl Band {
    /// The widest band for a plate, in whole parts of its limit.
    ///
    /// # Errors
    /// [`Error::Undersampled`] with the numbers where reference and object alias, [`Error::OutOfRange`] where the zero order
    /// would lie on the object.
    pub fn of(plate: &Plate) -> Result<Self> {
        let limit = [0.5 / plate.pitch_x, 0.5 / plate.pitch_y];
        let pitch = [plate.pitch_x, plate.pitch_y];
        let ranges = plate.reference.frequencies(plate);
        let highest = ranges.map(|[low, high]| low.abs().max(high.abs()));
        let shortest = plate.wavelengths().iter().copied().fold(f64::INFINITY, f64::min);
        if highest[0].hypot(highest[1]) * shortest >= 1.0 && plate.reference != Reference::None {
            let what = format!("{highest:?} cycles/m is no wave of {shortest} m that travels");
            return Err(Error::parameter("reference", what));
        }
        let carriers = [0, 1].map(|axis| {
            let [low, high] = ranges[axis];
            let lowest = if low <= 0.0 && high >= 0.0 { 0.0 } else { low.abs().min(high.abs()) };
            Carrier { lowest, highest: highest[axis], pitch: pitch[axis], wavelength: shortest }
        });
        // What the reference leaves beside it below the limit.
        let mut room = [carriers[0].below_limit(NARROWEST)?, carriers[1].below_limit(NARROWEST)?];
        if let Some(separation) = plate.quantity.separation() {
            let axis = deciding(&carriers);
            room[axis] = room[axis].min(carriers[axis].beside_zero_order(separation, NARROWEST)?);
        }
        let mut divisor = [1; 2];
        let to_slit = plate.slit.as_ref().map(|slit| slit.steepest(plate));
        for axis in 0..2 {
            let mut asked = plate.object_angle.map_or(f64::INFINITY, |angle| angle[axis].sin() / shortest);
            if let (1, Some(sine)) = (axis, to_slit) {
                let needed = sine / shortest;
                if needed > room[1] || needed > asked {
                    let what = format!(
                        "light from the plate's edge to the slit takes {:.2} deg, reference and pitch leave it {:.2} deg; \
                         steepen the reference, move the slit away, or make the plate lower",
                        sine.asin().to_degrees(),
                        (room[1].min(asked) * shortest).min(1.0).asin().to_degrees()
                    );
                    return Err(Error::parameter("slit", what));
                }
                asked = needed;
            }
            // The band's outermost twentieth holds 4e-4 of the light: so much of it may lie on the zero order.
            divisor[axis] = (0.95 * limit[axis] / room[axis].min(asked)).ceil().max(1.0) as u32;
            if divisor[axis] > 64 {
                let what =
                    format!("object_angle leaves 1/{} of what the pitch carries; take a coarser pitch", divisor[axis]);
                return Err(Error::parameter("object_angle", what));
            }
        }
        let half = [0, 1].map(|axis| (limit[axis] / f64::from(divisor[axis])).min(0.6 / plate.wavelength));
        Ok(Self { divisor, half, angle: half.map(|f| (f * plate.wavelength).asin()) })
    }
}
