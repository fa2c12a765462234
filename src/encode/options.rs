//! What is asked of an encoding before the laser is known: resolved for each exposure into its settings.

use super::{EncodeSettings, Encoding, blaze_and_lens};
use crate::error::{Error, Result};
use crate::names::Named;
use crate::panel::{Correction, Modulation, Setup};

/// An encoding and where its light goes, in terms that hold for any wavelength.
#[derive(Clone, Debug, Default)]
pub struct EncodeOptions {
    /// The encoding with its own settings; `None`: the usual one for what the panel modulates ([`Encoding::usual`]).
    /// Planes without depths get three over the content's depth.
    pub encoding: Option<Encoding>,
    /// Angles θ_x, θ_y by which the object goes aside at normal incidence [rad].
    pub blaze: [f64; 2],
    /// Focal length of a digital lens [m].
    pub lens: Option<f64>,
    /// Angle about the axis that the object's light keeps out of [rad].
    pub stop: f64,
}

impl EncodeOptions {
    /// Gives planes without depths three over these, nearest and farthest z [m]: the same for all frames of a sequence.
    pub fn fix_depths(&mut self, depths: [f64; 2]) {
        if let Some(encoding) = &mut self.encoding {
            over(encoding, depths);
        }
    }

    /// The settings at a wavelength [m] for a field whose content stands at these depths z, nearest and farthest [m],
    /// and what a user should know.
    ///
    /// # Errors
    /// As [`blaze_and_lens`] and [`Setup::correction`]; [`Error::Parameter`] for a correction given to a pattern that
    /// modulates amplitude.
    pub fn settings(
        &self,
        setup: &Setup,
        wavelength: f64,
        content: Option<[f64; 2]>,
    ) -> Result<(EncodeSettings, Vec<String>)> {
        let mut encoding = self.encoding.clone().unwrap_or_else(|| Encoding::usual(setup.profile.modulation()));
        if let Some(depths) = content {
            over(&mut encoding, depths);
        }
        let mut settings = EncodeSettings::new(encoding);
        settings.illumination = blaze_and_lens(self.blaze, self.lens, wavelength)?;
        settings.stop = self.stop.sin().abs() / wavelength;
        // Fringes are for a panel between polarisers, or one that modulates amplitude: no phase to correct.
        let modulated = [settings.encoding.modulation(), setup.profile.modulation()];
        let mut warnings = Vec::new();
        if modulated == [Modulation::Phase; 2] {
            (settings.correction, warnings) = setup.correction(wavelength)?;
        } else if matches!(setup.correction, Correction::Given(_)) {
            let what = format!("{} has no phase to correct; leave it out", settings.encoding.name());
            return Err(Error::parameter("correction", what));
        }
        Ok((settings, warnings))
    }
}

/// Gives planes without depths three over these, or one where they are the same.
fn over(encoding: &mut Encoding, [near, far]: [f64; 2]) {
    if let Encoding::Planes(planes) = encoding
        && planes.depths.is_empty()
    {
        let flat = (near - far).abs() <= 1e-6;
        planes.depths = if flat { vec![near] } else { vec![near, 0.5 * (near + far), far] };
    }
}
