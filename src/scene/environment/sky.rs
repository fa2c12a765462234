//! Sun and sky: a clear or hazy day by its sun's place.
//!
//! The sky is Preetham's (Preetham, Shirley & Smits, *A practical analytic model for daylight*, SIGGRAPH 1999): Perez' five
//! parameters by turbidity for luminance and chromaticity. The sun is parallel light from a disc of its own half a degree,
//! weakened by the air's molecules and haze on its way (the same paper's appendix; ozone, gases and vapour, some hundredths
//! of visible light, are left out). Below the horizon lies matt ground that reflects a fifth of what falls on it.
//!
//! Radiance is in units of 1000 cd/m², irradiance in 1000 lux: at noon a white sheet shows about 30.

use super::dome::Map;
use super::{Disc, Environment};
use crate::error::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI};

/// Columns and rows.
const SIZE: [usize; 2] = [512, 256];

/// Angular radius of the sun [rad].
const SUN: f64 = 4.65e-3;

/// Illuminance of the sun outside of the air [1000 lux], and its colour as linear Rec.709 of luminance one (5778 K).
const SUN_OUTSIDE: f64 = 128.0;
const SUN_COLOUR: [f64; 3] = [1.113, 0.976, 0.912];

/// Dominant wavelengths of Rec.709's primaries [µm].
const PRIMARIES: [f64; 3] = [0.611, 0.549, 0.464];

/// What the ground reflects.
const GROUND: f64 = 0.2;

/// Haze that is meant where none is said: a clear day.
pub const CLEAR: f64 = 3.0;

/// A day's light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sky {
    /// Height of the sun over the horizon [rad], 0 to π/2.
    pub elevation: f64,
    /// Where it stands about +y, from +x towards +z [rad].
    pub azimuth: f64,
    /// Haze: 2 very clear, 3 clear, 6 hazy, 10 the most.
    pub turbidity: f64,
    /// All light is multiplied by this.
    pub strength: f32,
}

impl Sky {
    /// A clear day.
    pub fn clear(elevation: f64, azimuth: f64) -> Self {
        Self { elevation, azimuth, turbidity: CLEAR, strength: 1.0 }
    }

    /// Unit direction to the sun.
    pub fn towards_sun(&self) -> DVec3 {
        let (sin, cos) = self.elevation.sin_cos();
        DVec3::new(cos * self.azimuth.cos(), sin, cos * self.azimuth.sin())
    }

    /// Whether it can be computed.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an elevation, azimuth, haze or strength outside its domain.
    pub fn check(&self) -> Result<()> {
        let within = |name: &'static str, value: f64, low: f64, high: f64, what: &str| {
            if value >= low && value <= high { Ok(()) } else { Err(Error::out_of_range(name, value, what)) }
        };
        within("sun's elevation", self.elevation.to_degrees(), 0.0, 90.0, "degrees; must be 0 to 90")?;
        within("turbidity", self.turbidity, 2.0, 10.0, "must be 2 (very clear) to 10 (hazy)")?;
        within("strength of the sky", f64::from(self.strength), 0.0, 1e6, "is not a factor")?;
        if self.azimuth.is_finite() { Ok(()) } else { Err(Error::out_of_range("azimuth", self.azimuth, "is no angle")) }
    }
}

impl Environment {
    /// Sun and sky.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for an elevation, haze or strength outside its domain.
    pub fn sky(sky: &Sky) -> Result<Self> {
        sky.check()?;
        let towards = sky.towards_sun();
        let strength = f64::from(sky.strength);
        let perez = Perez::new(sky.turbidity, FRAC_PI_2 - sky.elevation);
        let map = Map { width: SIZE[0], height: SIZE[1], texels: Vec::new() };
        let direction = |i: usize| map.direction(i % SIZE[0], i / SIZE[0]);
        let mut texels: Vec<DVec3> = (0..SIZE[0] * SIZE[1])
            .map(|i| if direction(i).y > 0.0 { perez.radiance(direction(i), towards) * strength } else { DVec3::ZERO })
            .collect();
        let sun = sunlight(sky.turbidity, sky.elevation) * strength;
        let falls = |i: usize| texels[i] * (direction(i).y.max(0.0) * map.solid_angle(i / SIZE[0]));
        let on_ground = sun * towards.y + (0..texels.len()).map(falls).sum::<DVec3>();
        let below = on_ground * (GROUND / PI);
        let ground = texels.iter_mut().enumerate().filter(|(i, _)| direction(*i).y <= 0.0);
        ground.for_each(|(_, texel)| *texel = below);
        let radiance = (sun / (PI * SUN * SUN)).as_vec3();
        let disc = Disc { towards, radius: SUN, irradiance: sun.as_vec3(), radiance };
        let texels = texels.into_iter().map(|t| t.as_vec3()).collect();
        Self::with_disc(Map { texels, ..map }, Some(disc).filter(|_| sun.max_element() > 0.0), 0.0)
    }
}

/// Irradiance of a surface square to the sun, linear Rec.709 [1000 lux].
fn sunlight(turbidity: f64, elevation: f64) -> DVec3 {
    let zenith = 90.0 - elevation.to_degrees();
    // Relative optical mass (Kasten & Young's form, as in the paper).
    let mass = 1.0 / (elevation.sin() + 0.15 * (93.885 - zenith).powf(-1.253));
    let haze = 0.04608 * turbidity - 0.04586;
    let left = |k: usize| {
        let depth = 0.008735 * PRIMARIES[k].powf(-4.08) + haze * PRIMARIES[k].powf(-1.3);
        SUN_OUTSIDE * SUN_COLOUR[k] * (-depth * mass).exp()
    };
    DVec3::new(left(0), left(1), left(2))
}

/// Perez' distribution of luminance Y [1000 cd/m²] and chromaticities x and y.
struct Perez {
    zenith: [f64; 3],
    coefficients: [[f64; 5]; 3],
    /// The distribution straight up, by which it is divided.
    up: [f64; 3],
}

impl Perez {
    /// For a sun at this angle from straight up [rad].
    fn new(t: f64, sun: f64) -> Self {
        let chi = (4.0 / 9.0 - t / 120.0) * (PI - 2.0 * sun);
        let luminance = (4.0453 * t - 4.9710) * chi.tan() - 0.2155 * t + 2.4192;
        let cubic = |[a, b, c, d]: [f64; 4]| ((a * sun + b) * sun + c) * sun + d;
        let by_haze = |squared, linear, plain| t * t * cubic(squared) + t * cubic(linear) + cubic(plain);
        let x = by_haze(
            [0.00166, -0.00375, 0.00209, 0.0],
            [-0.02903, 0.06377, -0.03202, 0.00394],
            [0.11693, -0.21196, 0.06052, 0.25886],
        );
        let y = by_haze(
            [0.00275, -0.00610, 0.00317, 0.0],
            [-0.04214, 0.08970, -0.04153, 0.00516],
            [0.15346, -0.26756, 0.06670, 0.26688],
        );
        let coefficients = [
            [
                0.1787 * t - 1.4630,
                -0.3554 * t + 0.4275,
                -0.0227 * t + 5.3251,
                0.1206 * t - 2.5771,
                -0.0670 * t + 0.3703,
            ],
            [
                -0.0193 * t - 0.2592,
                -0.0665 * t + 0.0008,
                -0.0004 * t + 0.2125,
                -0.0641 * t - 0.8989,
                -0.0033 * t + 0.0452,
            ],
            [
                -0.0167 * t - 0.2608,
                -0.0950 * t + 0.0092,
                -0.0079 * t + 0.2102,
                -0.0441 * t - 1.6537,
                -0.0109 * t + 0.0529,
            ],
        ];
        let up = coefficients.map(|c| distribution(c, 1.0, sun.cos()));
        Self { zenith: [luminance.max(0.0), x, y], coefficients, up }
    }

    /// Linear Rec.709 radiance in a direction above the horizon [1000 cd/m²].
    fn radiance(&self, direction: DVec3, sun: DVec3) -> DVec3 {
        // The distribution has no end at the horizon itself.
        let height = direction.y.max(0.01);
        let cosine = direction.dot(sun).clamp(-1.0, 1.0);
        let [luminance, x, y] =
            std::array::from_fn(|k| self.zenith[k] * distribution(self.coefficients[k], height, cosine) / self.up[k]);
        let (big_x, big_z) = (x / y * luminance, (1.0 - x - y) / y * luminance);
        let rgb = DVec3::new(
            3.2406 * big_x - 1.5372 * luminance - 0.4986 * big_z,
            -0.9689 * big_x + 1.8758 * luminance + 0.0415 * big_z,
            0.0557 * big_x - 0.2040 * luminance + 1.0570 * big_z,
        );
        rgb.max(DVec3::ZERO)
    }
}

/// Perez' F, for the cosines of the angles from straight up and from the sun.
fn distribution([a, b, c, d, e]: [f64; 5], height: f64, cosine: f64) -> f64 {
    (1.0 + a * (b / height).exp()) * (1.0 + c * (d * cosine.acos()).exp() + e * cosine * cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luminance(rgb: DVec3) -> f64 {
        rgb.dot(DVec3::new(0.2126, 0.7152, 0.0722))
    }

    #[test]
    fn a_clear_day_is_as_bright_as_days_are() {
        // Handbook values for clear days (e.g. CIE S 011): direct sun square to it at 60° some 90 to 110 klx, at 10° 20 to 50;
        // horizontal sky light 10 to 25 klx, of which this model is known to make a little too much near the sun.
        for (elevation, direct) in [(60.0f64, 85.0..112.0), (10.0, 15.0..50.0)] {
            let sun = luminance(sunlight(2.5, elevation.to_radians()));
            assert!(direct.contains(&sun), "{elevation}: {sun}");
        }
        let sky = Sky::clear(45f64.to_radians(), 0.3);
        let around = Environment::sky(&sky).expect("sky");
        let (columns, rows) = (256, 128);
        let map = Map { width: columns, height: rows, texels: Vec::new() };
        let part = |i: usize| {
            let d = map.direction(i % columns, i / columns);
            around.smooth(d).as_dvec3() * (d.y.max(0.0) * map.solid_angle(i / columns))
        };
        let horizontal: DVec3 = (0..columns * rows).map(part).sum();
        assert!((10.0..32.0).contains(&luminance(horizontal)), "{horizontal}");
        // Blue away from the sun; a low sun is red.
        let away = around.smooth(DVec3::new(-0.3, 0.9, -0.2).normalize());
        assert!(away.z > 1.3 * away.x, "{away}");
        let low = sunlight(3.0, 5f64.to_radians());
        assert!(low.x > 2.0 * low.z, "{low}");
        // The ground sends back a fifth of sun and sky.
        let ground = around.smooth(DVec3::new(0.1, -0.9, 0.0).normalize()).as_dvec3();
        let all = horizontal + sunlight(3.0, sky.elevation) * sky.elevation.sin();
        assert!((luminance(ground) * PI / (GROUND * luminance(all)) - 1.0).abs() < 0.02, "{ground} {all}");
    }

    #[test]
    fn the_sun_is_a_lamp_and_is_seen_in_mirrors() {
        let sky = Sky::clear(0.6, 2.0);
        let around = Environment::sky(&sky).expect("sky");
        let [sun] = around.suns() else { panic!("{:?}", around.suns()) };
        let towards = sky.towards_sun();
        assert!(sun.direction.as_dvec3().dot(-towards) > 0.999_999);
        // Brighter than all beside it by as much as its disc is small, and that ends at its edge.
        let beside = towards.any_orthonormal_vector();
        let at = |radii: f64| around.radiance((towards + beside * (radii * SUN)).normalize()).x;
        let disc = f64::from(at(0.95)) * PI * SUN * SUN;
        assert!((disc / f64::from(sun.intensity.x) - 1.0).abs() < 0.01, "{disc} {}", sun.intensity);
        assert!(at(1.05) < 1e-3 * at(0.0) && (at(0.95) / at(0.0) - 1.0).abs() < 1e-3, "{} {}", at(1.05), at(0.0));
        for wrong in [Sky { elevation: -0.1, ..sky }, Sky { turbidity: 1.0, ..sky }, Sky { strength: f32::NAN, ..sky }]
        {
            assert!(Environment::sky(&wrong).is_err(), "{wrong:?}");
        }
    }
}
