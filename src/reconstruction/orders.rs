//! Where a panel's light goes: into the object, the zero order, the conjugate, or elsewhere.

use crate::field::{Fft2, Field};
use crate::panel::{EncodingRecord, Illumination};
use crate::progress::Progress;
use serde::Serialize;

/// Shares of the light behind a panel; they add up to one. Simulated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Orders {
    /// Within the object's window of spatial frequencies; all that is nowhere else where the encoding has none.
    pub object: f64,
    /// Along the wave that lights the panel: what it leaves undiffracted.
    pub zero: f64,
    /// Within the object's window mirrored at that wave: the other side band of a real fringe.
    pub conjugate: f64,
    /// Everywhere else: higher orders, conjugates of other kinds, noise.
    pub rest: f64,
}

/// Sorts the light behind a panel (lit as the encoding's record says) by its direction.
///
/// The zero order is what lies within three cycles over the panel of the lighting wave, whose own spot is a sinc of one
/// cycle; for light from a point, whose zero order fills a window, it is not told apart.
pub fn orders(behind: &Field, record: &EncodingRecord) -> Orders {
    let grid = behind.grid;
    let mut spectrum = behind.samples.clone();
    Fft2::new(grid.width, grid.height).forward(&mut spectrum, &Progress::new());
    let lit = match record.illumination {
        Illumination::Normal => Some([0.0, 0.0]),
        Illumination::Plane { frequency } => Some(frequency),
        Illumination::Point { .. } => None,
    };
    // Frequencies of the lattice repeat: a mirror image beyond the limit comes in at the other side.
    let wrapped = |f: f64, limit: f64| (f + limit).rem_euclid(2.0 * limit) - limit;
    let limits = [grid.limit_x(), grid.limit_y()];
    let extents = [grid.extent_x(), grid.extent_y()];
    let mut sums = [0.0f64; 4];
    for (k, u) in spectrum.iter().enumerate() {
        let f = [grid.frequency_x(k % grid.width), grid.frequency_y(k / grid.width)];
        let of = |center: [f64; 2]| [0, 1].map(|axis| wrapped(f[axis] - center[axis], limits[axis]));
        let near = lit.is_some_and(|lit| {
            let off = of(lit);
            (off[0] * extents[0]).abs() <= 3.0 && (off[1] * extents[1]).abs() <= 3.0
        });
        let within = |center: [f64; 2]| {
            record.aperture.as_ref().is_some_and(|a| {
                let off = of(center);
                off[0].abs() <= a.half[0] && off[1].abs() <= a.half[1]
            })
        };
        let place = match (&record.aperture, lit) {
            _ if near => 1,
            (None, _) => 0,
            (Some(a), _) if within(a.center) => 0,
            (Some(a), Some(lit)) if within([0, 1].map(|axis| 2.0 * lit[axis] - a.center[axis])) => 2,
            _ => 3,
        };
        sums[place] += f64::from(u.norm_sqr());
    }
    let all = sums.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let [object, zero, conjugate, rest] = sums.map(|sum| sum / all);
    Orders { object, zero, conjugate, rest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encode::{EncodeSettings, Encoding, blaze_and_lens, encode};
    use crate::field::Complex32;
    use crate::names::Named;
    use crate::panel::{PanelProfile, Simulation, simulate};
    use std::path::Path;

    fn panel(kind: &str, fill_factor: f64, response: &str) -> PanelProfile {
        let text = format!(
            "name = \"t\"\nmaker = \"t\"\nkind = \"{kind}\"\nwidth = 128\nheight = 96\npitch = \"8um\"\nbits = 8\n\
             fill_factor = {fill_factor}\nwavelengths = [\"532nm\"]\n[[response]]\n{response}\n"
        );
        PanelProfile::parse(&text, Path::new("t.toml")).expect("profile")
    }

    fn sorted(profile: &PanelProfile, settings: &EncodeSettings) -> Orders {
        let grid = profile.grid().expect("grid");
        let wave = |i: usize| Complex32::from_polar(1.0, std::f32::consts::TAU * 5.0 * (i % 128) as f32 / 128.0);
        let field = Field::new(grid, 532e-9, (0..grid.len()).map(wave).collect()).expect("field");
        let frame = encode(&field, profile, settings, &Progress::new()).expect("encode").frame;
        let behind = simulate(&frame, &Simulation::default(), &Progress::new()).expect("light");
        orders(&behind, frame.metadata.encoding.as_ref().expect("record"))
    }

    #[test]
    fn a_real_fringe_shares_its_light_between_three_orders() {
        let profile = panel("amplitude", 1.0, "kind = \"amplitude\"");
        let settings = EncodeSettings::new(Encoding::named("off-axis-bipolar").expect("name"));
        // ½ + ¼·(wave and conjugate): 1/4 and twice 1/16 of the light that falls on the panel, 3/8 of it in all.
        let found = sorted(&profile, &settings);
        assert!((found.zero - 2.0 / 3.0).abs() < 0.01, "{found:?}");
        assert!((found.object - 1.0 / 6.0).abs() < 0.01 && (found.conjugate - 1.0 / 6.0).abs() < 0.01, "{found:?}");
        assert!((found.object + found.zero + found.conjugate + found.rest - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_blaze_takes_the_object_off_the_light_of_the_dead_space() {
        let profile = panel("phase-lcos", 0.8, "kind = \"linear\"\nlevels_for_2pi = 256");
        let mut settings = EncodeSettings::new(Encoding::named("double-phase").expect("name"));
        let angle = (0.375f64 * 532e-9 / 8e-6).asin();
        settings.illumination = blaze_and_lens([angle, angle], None, 532e-9).expect("blaze");
        let found = sorted(&profile, &settings);
        // F² of the light is the object's, (1 − F)² the dead space's.
        let (object, dead) = (0.64 / 0.68, 0.04 / 0.68);
        assert!((found.object - object).abs() < 0.01 && (found.zero - dead).abs() < 0.01, "{found:?}");
        assert!(found.rest < 0.01, "{found:?}");
    }
}
