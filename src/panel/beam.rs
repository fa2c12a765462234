//! The laser's beam on a panel: brighter in its middle than at the borders.

use super::profile::PanelProfile;
use crate::error::{Error, Result};
use crate::field::npy;

impl PanelProfile {
    /// Amplitude of the laser's beam on each pixel, 1 at the brightest; `None` where the profile has none and it counts as even.
    ///
    /// # Errors
    /// [`Error::Io`], and [`Error::Calibration`] for a file of another size, or with a number outside 0 … 1.
    pub fn beam_amplitude(&self) -> Result<Option<Vec<f32>>> {
        let Some(path) = &self.beam else { return Ok(None) };
        let array = npy::read_real(path)?;
        if (array.width, array.height, array.channels) != (self.width, self.height, 1) {
            let (width, height) = (array.width, array.height);
            let what =
                format!("the beam has {width}×{height} amplitudes, the panel {}×{} pixels", self.width, self.height);
            return Err(Error::calibration(path, what));
        }
        if let Some(i) = array.values.iter().position(|v| !(0.0..=1.0).contains(v)) {
            let (column, row) = (i % self.width, i / self.width);
            let what = format!("the amplitude at column {column}, row {row} is {}; it must be 0 … 1", array.values[i]);
            return Err(Error::calibration(path, what));
        }
        Ok(Some(array.values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Complex64;
    use crate::panel::{Frame, Simulation, simulate};
    use crate::progress::Progress;

    #[test]
    fn the_simulated_panel_stands_in_its_beam_and_keeps_some_light_unmodulated() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("beam.npy");
        let beam: Vec<f32> = (0..12).map(|i| 1.0 - 0.05 * i as f32).collect();
        npy::write_intensity(&path, 4, 3, &beam).expect("write");
        let mut profile = PanelProfile::phase(4, 3, 8e-6, 8, 532e-9).expect("profile");
        (profile.unmodulated, profile.beam) = (0.2, Some(path.clone()));
        let levels: Vec<u16> = (0..12).map(|i| 21 * i).collect();
        let frame = Frame::new(&profile, 532e-9, levels.clone()).expect("frame");
        let light = simulate(&frame, &Simulation::default(), &Progress::new()).expect("light");
        for ((u, level), beam) in light.samples.iter().zip(&levels).zip(&beam) {
            let phase = std::f64::consts::TAU * f64::from(*level) / 256.0;
            let wanted = (Complex64::cis(phase) * 0.8f64.sqrt() + 0.2f64.sqrt()) * f64::from(*beam);
            let off = (f64::from(u.re) - wanted.re).hypot(f64::from(u.im) - wanted.im);
            assert!(off < 1e-5, "{level}: {u} {wanted}");
        }
        let refused = |values: &[f32], width: usize, word: &str| {
            npy::write_intensity(&path, width, 3, values).expect("write");
            let told = profile.beam_amplitude().expect_err(word).to_string();
            assert!(told.contains("beam.npy") && told.contains(word), "{told}");
        };
        refused(&beam[..9], 3, "3×3");
        refused(&[1.5; 12], 4, "0 … 1");
    }
}
