//! The room that the reference wave leaves to the object.
//!
//! A fringe made with the reference r and lit with it again gives the object where it was, the zero order along r and
//! the conjugate beyond it ([`crate::encode::off_axis`] has the algebra). With the reference's spatial frequency f_r
//! along the carrier's axis and the object's half band b the three lie apart where b ≤ f_r (bipolar), b ≤ f_r/3
//! (intensity, whose |u|² is 2b wide), and f_r + b stays below the plate's limit 1/(2·pitch).

use super::plate::Plate;
use super::reference::Reference;
use crate::encode::fringe::{Carrier, deciding};
use crate::error::{Error, Result};
use crate::segments::{ObjectBand, Segments};

/// A band narrower than this share of the plate's limit shows no picture.
const NARROWEST: f64 = 1.0 / 16.0;

impl Plate {
    /// Lowest and highest spatial frequency of the reference along x and along y over the plate, in all its wavelengths
    /// [cycles/m].
    pub(super) fn reference_frequencies(&self) -> [[f64; 2]; 2] {
        let grid = self.raster.grid();
        let mut all = self.wavelengths().iter().map(|&wavelength| self.reference.frequencies(&grid, wavelength));
        let first = all.next().unwrap_or_default();
        all.fold(first, |ranges, more| [0, 1].map(|i| [ranges[i][0].min(more[i][0]), ranges[i][1].max(more[i][1])]))
    }

    /// The plane that its segments share.
    ///
    /// # Errors
    /// [`Error::Undersampled`] with the numbers where reference and object alias, [`Error::OutOfRange`] where the zero order
    /// would lie on the object, [`Error::Parameter`] where its light does not reach the slit.
    pub fn segments(&self) -> Result<Segments> {
        Ok(Segments {
            grid: self.raster.grid(),
            size: [self.segment, self.slit.as_ref().map_or(self.segment, |slit| slit.strip)],
            wavelength: self.wavelength,
            band: band_of(self)?,
            slit: self.slit.clone(),
            view: self.view,
            error: self.error,
            seed: self.seed,
        })
    }
}

/// The widest band of the object for a plate, in whole parts of its limit.
fn band_of(plate: &Plate) -> Result<ObjectBand> {
    let grid = plate.raster.grid();
    let (limit, pitch) = ([grid.limit_x(), grid.limit_y()], [grid.pitch_x, grid.pitch_y]);
    let ranges = plate.reference_frequencies();
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
    if let Some(separation) = plate.fringe.quantity.separation() {
        let axis = deciding(&carriers);
        room[axis] = room[axis].min(carriers[axis].beside_zero_order(separation, NARROWEST)?);
    }
    let mut divisor = [1; 2];
    let to_slit = plate.slit.as_ref().map(|slit| slit.steepest(grid.extent_y(), plate.view.viewer));
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
    Ok(ObjectBand::of(&grid, divisor, plate.wavelength))
}
