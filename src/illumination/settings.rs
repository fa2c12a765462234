//! How light is computed.

use super::FormFactor;
use crate::error::{Error, Result};
use crate::names::{Name, Named};

/// How light is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IlluminationSettings {
    /// How flux is divided; the seed paper's eq. (1) on request.
    pub form_factor: FormFactor,
    /// The solver stops when no colour's residual is larger than this part of the right-hand side.
    pub residual: f64,
    /// Rays per vertex that gather indirect light; fewer are cast when the scene has very many vertices, more where brightness
    /// jumps.
    pub indirect_rays: u32,
    /// Shadow rays per point for all emitters together.
    pub shadow_rays: u32,
    /// Further shadow rays where an emitter is seen in part.
    pub penumbra_rays: u32,
    /// Longest edge of an element over the diagonal of the scene.
    pub longest_element: f64,
    /// Edges are not split below this part of the scene's diagonal.
    pub shortest_element: f64,
    /// An edge may be this many times as long as its surroundings are near.
    pub nearness: f64,
    /// Elements are not split beyond this many vertices.
    pub most_vertices: usize,
    /// Rays with which each point gathers indirect light for itself instead of reading the mesh.
    pub final_gather: Option<u32>,
    /// Most mirrors or glass surfaces that light follows one after another.
    pub bounces: u32,
    /// Gathering rays of all vertices together, at most; half as many more look again where brightness jumps.
    pub gathering_rays: usize,
    /// Photons that lamps send through curved mirrors, glass and rough metal; none are sent where there is none of it.
    pub photons: u32,
    /// Seed of all sampling.
    pub seed: u64,
}

impl IlluminationSettings {
    /// The same with rougher light, without caustics, for a first look.
    pub fn coarse(self) -> Self {
        Self {
            residual: 1e-2,
            indirect_rays: 32,
            photons: 0,
            final_gather: None,
            longest_element: 0.2,
            shortest_element: 0.1,
            ..self
        }
    }
}

impl IlluminationSettings {
    /// The same with rays, patches and photons for this error of the picture, root mean square over its mean: that of normal
    /// quality is a hundredth. Noise falls with the root of the rays, and what is linear over patches errs by their squared size.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an error below 0.2 % or above 20 %.
    pub fn for_error(self, error: f64) -> Result<Self> {
        if !(LEAST_ERROR..=MOST_ERROR).contains(&error) {
            return Err(Error::out_of_range("light error", error, "must be 0.2% to 20%"));
        }
        let finer = Quality::Normal.error() / error;
        let times = |count: f64, power: f64| count * finer.powf(power);
        let usual = Self::default();
        let rays = |count: u32, power: f64, least: f64| times(f64::from(count), power).round().max(least) as u32;
        Ok(Self {
            residual: usual.residual * finer.recip(),
            indirect_rays: rays(usual.indirect_rays, 2.0, 36.0),
            gathering_rays: times(usual.gathering_rays as f64, 2.0) as usize,
            shadow_rays: rays(usual.shadow_rays, 1.0, 4.0),
            penumbra_rays: rays(usual.penumbra_rays, 1.0, 4.0),
            longest_element: times(usual.longest_element, -0.5).min(0.25),
            shortest_element: times(usual.shortest_element, -0.5).min(0.1),
            most_vertices: times(usual.most_vertices as f64, 1.0) as usize,
            photons: rays(usual.photons, 2.0, 2e4).min(MOST_PHOTONS),
            ..self
        })
    }
}

/// Errors that can be asked for.
const LEAST_ERROR: f64 = 2e-3;
const MOST_ERROR: f64 = 0.2;
/// Their table takes some 100 bytes each.
const MOST_PHOTONS: u32 = 20_000_000;

/// How good the light of a picture is to be: one word for rays, patches and photons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// For a first look.
    Draft,
    /// About a hundredth off, where a panel's own speckle hides it.
    #[default]
    Normal,
    /// For plates and comparisons.
    Best,
}

impl Quality {
    /// Root mean square error of the picture over its mean that it stands for.
    pub fn error(self) -> f64 {
        match self {
            Self::Draft => 0.03,
            Self::Normal => 0.01,
            Self::Best => 0.004,
        }
    }
}

impl Named for Quality {
    const KIND: &'static str = "quality";
    const NAMES: &'static [Name<Self>] = &[
        ("draft", || Self::Draft, "for a first look: about 3 % off"),
        ("normal", || Self::Normal, "about 1 % off"),
        ("best", || Self::Best, "about 0.4 % off, and several times as long"),
    ];
}

impl Default for IlluminationSettings {
    fn default() -> Self {
        Self {
            form_factor: FormFactor::Lambert,
            residual: 1e-4,
            indirect_rays: 324,
            shadow_rays: 16,
            penumbra_rays: 64,
            longest_element: 1.0 / 16.0,
            shortest_element: 1.0 / 80.0,
            nearness: 0.8,
            most_vertices: 60_000,
            // Probes beyond some tens of thousands lie so close that the noise of each counts less.
            gathering_rays: 4_000_000,
            final_gather: None,
            bounces: 32,
            photons: 400_000,
            seed: 1,
        }
    }
}

impl IlluminationSettings {
    pub(super) fn check(&self) -> Result<()> {
        let within = |name: &'static str, value: f64, low: f64, high: f64| {
            if value >= low && value <= high {
                Ok(())
            } else {
                Err(Error::out_of_range(name, value, format!("must be {low} to {high}")))
            }
        };
        within("residual", self.residual, 1e-7, 1.0)?;
        within("longest element", self.longest_element, 1e-4, 1.0)?;
        within("shortest element", self.shortest_element, 1e-5, self.longest_element)?;
        within("nearness", self.nearness, 0.01, 100.0)?;
        within("shadow rays", f64::from(self.shadow_rays), 1.0, 1e6)?;
        within("penumbra rays", f64::from(self.penumbra_rays), 0.0, 1e6)?;
        within("indirect rays", f64::from(self.indirect_rays), 16.0, 1e6)?;
        within("photons", f64::from(self.photons), 0.0, f64::from(MOST_PHOTONS))?;
        within("bounces", f64::from(self.bounces), 0.0, 1000.0)?;
        if let Some(rays) = self.final_gather {
            within("final gather", f64::from(rays), 1.0, 1e6)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smaller_error_takes_more_rays_and_a_hundredth_what_is_usual() {
        let usual = IlluminationSettings::default();
        assert_eq!(usual.for_error(Quality::Normal.error()).expect("usual"), usual);
        let [draft, best] = [Quality::Draft, Quality::Best].map(|q| usual.for_error(q.error()).expect("settings"));
        assert!(draft.indirect_rays < usual.indirect_rays && usual.indirect_rays < best.indirect_rays);
        assert!(draft.photons < usual.photons && usual.photons < best.photons && best.photons <= MOST_PHOTONS);
        assert!(best.shortest_element < usual.shortest_element && usual.shortest_element < draft.shortest_element);
        for error in [LEAST_ERROR, MOST_ERROR] {
            usual.for_error(error).expect("an error that can be asked for").check().expect("settings");
        }
        assert!(usual.for_error(1e-3).is_err() && usual.for_error(f64::NAN).is_err() && usual.for_error(0.3).is_err());
    }
}
