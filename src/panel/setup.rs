//! A panel in the light that it is used in: resolved once from what was asked, and handed round as one thing.

use super::profile::PanelProfile;
use super::wavefront::Wavefront;
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::field::grid::light;
use crate::points::colour::Lasers;
use crate::units::show_length;

/// Which wavefront correction the patterns carry.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Correction {
    /// The profile's own for the laser, where it has one.
    #[default]
    Profile,
    /// None, whatever the profile has.
    None,
    /// This one.
    Given(Wavefront),
}

/// This panel, in this light: what every step from points to pictures needs to know of the bench.
///
/// ```
/// use holodrive::panel::{PanelProfile, Setup};
///
/// let setup = Setup::new(PanelProfile::generic()?, Some(532e-9))?;
/// assert_eq!(setup.wavelength, 532e-9);
/// assert_eq!((setup.grid.width, setup.grid.height), (1920, 1080));
/// # Ok::<(), holodrive::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Setup {
    /// The panel.
    pub profile: PanelProfile,
    /// Its pixels in the hologram frame.
    pub grid: Grid,
    /// Vacuum wavelength of the hologram [m]; of three lasers the shortest, whose cone is the narrowest.
    pub wavelength: f64,
    /// Three lasers, where the hologram is in colour.
    pub lasers: Option<Lasers>,
    /// Which wavefront correction its patterns carry.
    pub correction: Correction,
}

impl Setup {
    /// A panel in the light of one laser of this vacuum wavelength [m], by default the profile's first.
    ///
    /// # Errors
    /// As [`PanelProfile::grid`].
    pub fn new(profile: PanelProfile, wavelength: Option<f64>) -> Result<Self> {
        profile.checked()?;
        let (grid, wavelength) = (profile.grid()?, wavelength.unwrap_or(profile.default_wavelength()));
        light(wavelength)?;
        Ok(Self { profile, grid, wavelength, lasers: None, correction: Correction::Profile })
    }

    /// The same panel in the light of three lasers of these wavelengths [m], by default the three of its profile.
    ///
    /// # Errors
    /// As [`Lasers::new`]; [`Error::Parameter`] for a profile that does not name three wavelengths, and
    /// [`Error::Calibration`] where it has no curve for one of them.
    pub fn in_color(mut self, wavelengths: Option<[f64; 3]>) -> Result<Self> {
        let profile = &self.profile;
        let wavelengths = match wavelengths {
            Some(given) => given,
            None => <[f64; 3]>::try_from(profile.wavelengths.as_slice()).map_err(|_| {
                let count = profile.wavelengths.len();
                let what = format!("panel {} names {count} wavelengths, not three; give them", profile.name);
                Error::parameter("wavelengths", what)
            })?,
        };
        let lasers = Lasers::new(wavelengths)?;
        lasers.wavelengths().iter().try_for_each(|w| profile.drive_curve(*w).map(drop))?;
        let [_, _, shortest] = lasers.wavelengths();
        (self.wavelength, self.lasers) = (shortest, Some(lasers));
        Ok(self)
    }

    /// The wavefront correction at a wavelength [m], and what a user should know about it.
    ///
    /// A correction of the profile that was measured more than 10 % away is passed over: the profile may have none for
    /// this laser.
    ///
    /// # Errors
    /// As [`Wavefront::read`] and [`Wavefront::check`].
    pub fn correction(&self, wavelength: f64) -> Result<(Option<Wavefront>, Vec<String>)> {
        let profile = &self.profile;
        let distance = |own: Option<f64>| own.map_or(f64::INFINITY, |own| (own - wavelength).abs());
        let found = match &self.correction {
            Correction::None => return Ok((None, Vec::new())),
            Correction::Given(wavefront) => Some(wavefront.clone()),
            Correction::Profile => profile
                .corrections
                .iter()
                .min_by(|a, b| distance(a.wavelength).total_cmp(&distance(b.wavelength)))
                .filter(|c| c.wavelength.is_none_or(|own| (own - wavelength).abs() <= 0.1 * own))
                .map(|c| Wavefront::read(&c.file, c.wavelength))
                .transpose()?,
        };
        let warnings = match &found {
            Some(found) => found.check(profile.width, profile.height, wavelength)?,
            None if profile.corrections.is_empty() => Vec::new(),
            None => vec![format!("panel {}: no wavefront correction for {}", profile.name, show_length(wavelength))],
        };
        Ok((found, warnings))
    }
}
