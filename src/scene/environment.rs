//! Light from all around, as a panorama has it: radiance by direction, from infinitely far away.
//!
//! A panorama is a map of longitude and latitude, as renderers and panorama cameras write it: its middle looks along +x, to
//! the right of it lies +z, and its upper edge is straight up, +y. What is small and bright in it, such as a sun, is taken
//! out as parallel light of its own, so that it throws sharp shadows; the rest is smooth enough to be sampled.
//!
//! Two are made here: a studio for files without light, and sun and sky.

mod bright;
mod dome;
mod file;
mod sky;
mod studio;
mod suns;

pub(crate) use bright::Bright;

pub(crate) use dome::Dome;
use dome::{Map, turned};
pub use file::Panorama;
pub use sky::{CLEAR, Sky};

use super::{LightKind, PunctualLight};
use crate::error::{Error, Result};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// Columns and rows of the smooth part, at most.
const SMOOTH: [usize; 2] = [512, 256];

/// Brighter than the mean by this factor: not known well enough at some places of a mesh only.
const BRIGHT: f32 = 2.0;

/// Least part of all light that is worth to be looked for from each point.
const LEAST_BRIGHT: f32 = 0.01;

/// Largest radiance that is taken [W/(m² sr)]: what single precision sums without loss of the rest.
const BRIGHTEST: f32 = 1e8;

/// Radiance from all around a scene.
#[derive(Clone, Debug)]
pub struct Environment {
    whole: Map,
    /// All but the suns.
    smooth: Map,
    suns: Vec<PunctualLight>,
    /// A sun that stands in no texel.
    disc: Option<Disc>,
    /// The smooth part up to the limit of brightness, and what it has over that.
    plain: Dome,
    bright: Option<Bright>,
    turn: f64,
}

/// A sun by what is known of it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Disc {
    /// Unit direction to it.
    towards: DVec3,
    /// Angular radius [rad].
    radius: f64,
    /// Of a surface square to it [W/m²].
    irradiance: Vec3,
    /// [W/(m² sr)]
    radiance: Vec3,
}

impl Environment {
    /// From radiance by row and column [W/(m² sr)], turned about +y by `turn` [rad], from +x towards +z.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a map without texels, or with other than finite radiance of at least zero.
    pub fn new(width: usize, height: usize, texels: Vec<Vec3>, turn: f64) -> Result<Self> {
        if width == 0 || height == 0 || texels.len() != width * height {
            return Err(Error::parameter("environment", format!("{} texels for {width}×{height}", texels.len())));
        }
        if !texels.iter().all(|t| t.is_finite() && t.min_element() >= 0.0) || !turn.is_finite() {
            return Err(Error::parameter("environment", "has radiance below zero or without end".to_owned()));
        }
        let texels = texels.into_iter().map(|t| t.min(Vec3::splat(BRIGHTEST))).collect();
        Self::with_disc(Map { width, height, texels }, None, turn)
    }

    /// From a map that is whole, but for the sun that stands beside it; without one, suns are looked for in the map.
    fn with_disc(whole: Map, disc: Option<Disc>, turn: f64) -> Result<Self> {
        let mut smooth = whole.coarser(SMOOTH);
        let found = if disc.is_some() { Vec::new() } else { suns::taken_out(&mut smooth) };
        let limit = BRIGHT * mean(&smooth).element_sum() / 3.0;
        let over = |t: Vec3| if t.max_element() > limit { t * (1.0 - limit / t.max_element()) } else { Vec3::ZERO };
        let bright = smooth.each(over);
        let plain = smooth.each(|t| t - over(t));
        let counts = mean(&bright).element_sum() > LEAST_BRIGHT * mean(&smooth).element_sum();
        let sun = |kind, direction: DVec3, intensity| PunctualLight {
            kind,
            position: Vec3::ZERO,
            direction: (-turned(direction, turn)).as_vec3(),
            intensity,
            range: f32::INFINITY,
            measured: None,
        };
        let found = found.into_iter().map(|(towards, light)| sun(LightKind::Directional, towards, light));
        let known = disc.map(|d| sun(LightKind::Sun { radius: d.radius as f32 }, d.towards, d.irradiance));
        Ok(Self {
            suns: found.chain(known).collect(),
            disc,
            plain: Dome::new(if counts { plain } else { smooth.clone() }, turn),
            bright: counts.then(|| Bright::new(bright, turn)),
            whole,
            smooth,
            turn,
        })
    }

    /// Directions of the middles of a map's texels, row by row.
    pub fn directions(width: usize, height: usize) -> impl Iterator<Item = DVec3> {
        let map = Map { width, height, texels: Vec::new() };
        (0..width * height).map(move |i| map.direction(i % width, i / width))
    }

    /// What is small and bright in it, as parallel light.
    pub fn suns(&self) -> &[PunctualLight] {
        &self.suns
    }

    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.whole.width, self.whole.height]
    }

    /// Mean radiance over all directions [W/(m² sr)].
    pub fn mean(&self) -> Vec3 {
        mean(&self.whole)
    }

    /// Radiance from a unit direction, with all that is in the panorama.
    pub fn radiance(&self, direction: DVec3) -> Vec3 {
        let local = turned(direction, -self.turn);
        // By the chord: the cosine of so small an angle is too near to one.
        let disc = self.disc.filter(|disc| (local - disc.towards).length() <= disc.radius);
        self.whole.at(local) + disc.map_or(Vec3::ZERO, |disc| disc.radiance)
    }

    /// Radiance from a unit direction without the [`Environment::suns`].
    pub fn smooth(&self, direction: DVec3) -> Vec3 {
        self.smooth.at(turned(direction, -self.turn))
    }

    /// What is left of it without suns and what is [`Environment::bright`]: soft enough to be known at some places only.
    pub(crate) fn plain(&self) -> &Dome {
        &self.plain
    }

    /// What is brighter than most of it and too wide for a sun, such as windows and soft boxes, if there is any: its shadows are
    /// soft, and narrower than what is between two places of a mesh.
    pub(crate) fn bright(&self) -> Option<&Bright> {
        self.bright.as_ref()
    }
}

/// Mean over all directions.
fn mean(map: &Map) -> Vec3 {
    let sum = |row: usize| map.row(row).iter().map(|t| t.as_dvec3()).sum::<DVec3>() * map.solid_angle(row);
    ((0..map.height).map(sum).sum::<DVec3>() / (4.0 * PI)).as_vec3()
}

impl PartialEq for Environment {
    /// Of the same light from everywhere.
    fn eq(&self, other: &Self) -> bool {
        self.turn == other.turn
            && self.disc == other.disc
            && self.size() == other.size()
            && self.whole.texels == other.whole.texels
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use std::f64::consts::FRAC_PI_2;

    /// 64 × 32 texels, brighter upwards and towards +z.
    fn slope(turn: f64) -> Environment {
        let map = Map { width: 64, height: 32, texels: Vec::new() };
        let texel = |i: usize| {
            let d = map.direction(i % 64, i / 64);
            Vec3::new(2.0 + d.y as f32, 2.0 + d.z as f32, 1.0)
        };
        Environment::new(64, 32, (0..64 * 32).map(texel).collect(), turn).expect("environment")
    }

    #[test]
    fn radiance_stands_where_the_panorama_has_it() {
        let around = slope(0.0);
        let mut random = Random::new(3, 0);
        for _ in 0..200 {
            let d = DVec3::new(random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5).normalize();
            let found = around.radiance(d);
            assert!((found - Vec3::new(2.0 + d.y as f32, 2.0 + d.z as f32, 1.0)).length() < 0.06, "{d} {found}");
        }
        // A quarter turn from +x towards +z takes what was at +z to −x.
        let turned = slope(FRAC_PI_2);
        assert!(turned.radiance(DVec3::NEG_X).y > 2.9 && turned.radiance(DVec3::Z).y < 2.1);
        assert!((around.mean() - Vec3::new(2.0, 2.0, 1.0)).length() < 1e-3, "{}", around.mean());
        assert!(around.suns().is_empty() && around.bright().is_none());
    }

    #[test]
    fn a_sun_is_taken_out_with_all_its_light_and_a_wide_lamp_is_not() {
        let (width, height) = (512, 256);
        let map = Map { width, height, texels: Vec::new() };
        let (sun, lamp) = (DVec3::new(0.3, 0.8, -0.5).normalize(), DVec3::new(-1.0, 0.2, 0.0).normalize());
        let texel = |i: usize| {
            let d = map.direction(i % width, i / width);
            let up = |light: f32| Vec3::splat(light);
            if d.dot(sun) > 0.012f64.cos() {
                up(5000.0)
            } else if d.dot(lamp) > 0.3f64.cos() {
                up(30.0)
            } else {
                up(0.5)
            }
        };
        let texels: Vec<Vec3> = (0..width * height).map(texel).collect();
        let irradiance: f64 =
            (0..width * height).filter(|i| texels[*i].x > 1000.0).map(|i| map.solid_angle(i / width)).sum();
        let around = Environment::new(width, height, texels, 0.0).expect("environment");
        let [found] = around.suns() else { panic!("{:?}", around.suns()) };
        assert!(found.direction.as_dvec3().dot(-sun) > 0.005f64.cos());
        assert!((f64::from(found.intensity.x) / (5000.0 * irradiance) - 1.0).abs() < 0.01, "{}", found.intensity);
        assert!(
            around.smooth(sun).x < 30.0
                && around.bright().is_some()
                && around.smooth(lamp).x > 29.0
                && around.radiance(sun).x > 4900.0
        );
    }
}
