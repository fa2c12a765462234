//! Light from all around, as a panorama has it: radiance by direction, from infinitely far away.
//!
//! A panorama is a map of longitude and latitude, as renderers and panorama cameras write it: its middle looks along +x, to
//! the right of it lies +z, and its upper edge is straight up, +y. What is small and bright in it, such as a sun, is taken
//! out as parallel light of its own, so that it throws sharp shadows; the rest is smooth enough to be sampled.

mod file;
mod suns;

pub use file::Panorama;

use super::{LightKind, PunctualLight};
use crate::error::{Error, Result};
use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Columns and rows of the smooth part, at most.
const SMOOTH: [usize; 2] = [512, 256];

/// Largest radiance that is taken [W/(m² sr)]: what single precision sums without loss of the rest.
const BRIGHTEST: f32 = 1e8;

/// Radiance from all around a scene.
#[derive(Clone, Debug)]
pub struct Environment {
    whole: Map,
    smooth: Map,
    suns: Vec<PunctualLight>,
    /// Sums over the texels of the smooth part, each of its brightness times its solid angle, up to and with it.
    up_to: Vec<f64>,
    turn: f64,
}

/// Radiance by longitude and latitude, row 0 on top.
#[derive(Clone, Debug)]
struct Map {
    width: usize,
    height: usize,
    texels: Vec<Vec3>,
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
        let whole = Map { width, height, texels };
        let mut smooth = whole.coarser(SMOOTH);
        let found = suns::taken_out(&mut smooth);
        let mut environment = Self { whole, smooth, suns: Vec::new(), up_to: Vec::new(), turn };
        environment.suns = found
            .into_iter()
            .map(|(direction, irradiance)| PunctualLight {
                kind: LightKind::Directional,
                position: Vec3::ZERO,
                direction: (-environment.turned(direction, 1.0)).as_vec3(),
                intensity: irradiance,
                range: f32::INFINITY,
            })
            .collect();
        let mut sum = 0.0;
        let map = &environment.smooth;
        environment.up_to = (0..map.texels.len())
            .map(|i| {
                // A little of each, so that none is left out where all is dark.
                sum += f64::from(map.texels[i].element_sum() + 1e-12) * map.solid_angle(i / map.width);
                sum
            })
            .collect();
        Ok(environment)
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
        let map = &self.whole;
        let sum = |row: usize| map.row(row).iter().map(|t| t.as_dvec3()).sum::<DVec3>() * map.solid_angle(row);
        ((0..map.height).map(sum).sum::<DVec3>() / (4.0 * PI)).as_vec3()
    }

    /// Radiance from a unit direction, with all that is in the panorama.
    pub fn radiance(&self, direction: DVec3) -> Vec3 {
        self.whole.at(self.turned(direction, -1.0))
    }

    /// Radiance from a unit direction without the [`Environment::suns`].
    pub fn smooth(&self, direction: DVec3) -> Vec3 {
        self.smooth.at(self.turned(direction, -1.0))
    }

    /// How densely [`Environment::drawn`] draws a unit direction [1/sr].
    pub fn density(&self, direction: DVec3) -> f64 {
        let map = &self.smooth;
        let d = self.turned(direction, -1.0);
        let place = |part: f64, count: usize| ((part * count as f64).max(0.0) as usize).min(count - 1);
        let column = place(d.z.atan2(d.x) / TAU + 0.5, map.width);
        let row = place(0.5 - d.y.clamp(-1.0, 1.0).asin() / PI, map.height);
        self.density_at(row * map.width + column)
    }

    fn density_at(&self, index: usize) -> f64 {
        let part = self.up_to[index] - if index > 0 { self.up_to[index - 1] } else { 0.0 };
        let total = self.up_to.last().copied().unwrap_or(1.0);
        part / (total * self.smooth.solid_angle(index / self.smooth.width))
    }

    /// A direction drawn in proportion to the brightness of the smooth part by three numbers of 0 to 1, and its density
    /// [1/sr].
    pub fn drawn(&self, [which, u, v]: [f64; 3]) -> (DVec3, f64) {
        let map = &self.smooth;
        let total = self.up_to.last().copied().unwrap_or(0.0);
        let index = self.up_to.partition_point(|sum| *sum <= which * total).min(self.up_to.len() - 1);
        let (column, row) = (index % map.width, index / map.width);
        let longitude = ((column as f64 + u) / map.width as f64 - 0.5) * TAU;
        // Even in solid angle: in the sine of latitude.
        let [top, bottom] = map.edges(row);
        let height = bottom + (top - bottom) * v;
        let across = (1.0 - height * height).max(0.0).sqrt();
        let local = DVec3::new(across * longitude.cos(), height, across * longitude.sin());
        (self.turned(local, 1.0), self.density_at(index))
    }

    /// Turned about +y as the panorama is (`sense` 1), or back (−1).
    fn turned(&self, v: DVec3, sense: f64) -> DVec3 {
        let (sin, cos) = (sense * self.turn).sin_cos();
        DVec3::new(v.x * cos - v.z * sin, v.y, v.x * sin + v.z * cos)
    }
}

impl Map {
    fn row(&self, row: usize) -> &[Vec3] {
        &self.texels[row * self.width..][..self.width]
    }

    /// Sines of the latitudes of a row's upper and lower edge.
    fn edges(&self, row: usize) -> [f64; 2] {
        [row, row + 1].map(|edge| (FRAC_PI_2 - PI * edge as f64 / self.height as f64).sin())
    }

    /// Solid angle of a texel of a row [sr].
    fn solid_angle(&self, row: usize) -> f64 {
        let [top, bottom] = self.edges(row);
        (top - bottom) * TAU / self.width as f64
    }

    /// Direction of a texel's middle.
    fn direction(&self, column: usize, row: usize) -> DVec3 {
        let longitude = ((column as f64 + 0.5) / self.width as f64 - 0.5) * TAU;
        let (sin, cos) = (FRAC_PI_2 - PI * (row as f64 + 0.5) / self.height as f64).sin_cos();
        DVec3::new(cos * longitude.cos(), sin, cos * longitude.sin())
    }

    /// Linear between texels.
    fn at(&self, direction: DVec3) -> Vec3 {
        let across = (direction.z.atan2(direction.x) / TAU + 0.5) * self.width as f64 - 0.5;
        let down = (0.5 - direction.y.clamp(-1.0, 1.0).asin() / PI) * self.height as f64 - 0.5;
        let down = down.clamp(0.0, (self.height - 1) as f64);
        let (left, top) = (across.floor(), down.floor());
        let [s, t] = [across - left, down - top].map(|part| part as f32);
        let column = |offset: usize| (left as i64 + offset as i64).rem_euclid(self.width as i64) as usize;
        let along = |row: usize| self.row(row)[column(0)] * (1.0 - s) + self.row(row)[column(1)] * s;
        let upper = top as usize;
        along(upper) * (1.0 - t) + along((upper + 1).min(self.height - 1)) * t
    }

    /// Means over blocks of texels by solid angle, so that at most `most` columns and rows are left.
    fn coarser(&self, [columns, rows]: [usize; 2]) -> Self {
        let (width, height) = (self.width.min(columns), self.height.min(rows));
        let texel = |index: usize| {
            let (column, row) = (index % width, index / width);
            let range = |i: usize, n: usize, of: usize| i * of / n..((i + 1) * of / n).max(i * of / n + 1);
            let (mut sum, mut all) = (DVec3::ZERO, 0.0);
            for y in range(row, height, self.height) {
                let weight = self.solid_angle(y);
                for x in range(column, width, self.width) {
                    sum += self.row(y)[x].as_dvec3() * weight;
                    all += weight;
                }
            }
            (sum / all).as_vec3()
        };
        Self { width, height, texels: (0..width * height).map(texel).collect() }
    }
}

impl PartialEq for Environment {
    /// Of the same light from everywhere.
    fn eq(&self, other: &Self) -> bool {
        self.turn == other.turn && self.size() == other.size() && self.whole.texels == other.whole.texels
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

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
        assert!(around.suns().is_empty());
    }

    #[test]
    fn directions_are_drawn_as_densely_as_is_said() {
        let around = slope(0.4);
        let mut random = Random::new(5, 0);
        // ∫ f L / p over drawn directions is ∫ f L: here of f = max(y, 0), irradiance of a surface that looks up.
        let n = 40_000;
        let (mut sums, mut near) = ([Vec3::ZERO, Vec3::ZERO], 0);
        for _ in 0..n {
            let (d, density) = around.drawn([random.uniform(), random.uniform(), random.uniform()]);
            assert!((d.length() - 1.0).abs() < 1e-9 && density > 0.0);
            // But for the rounding of a direction on an edge of two texels.
            near += usize::from((around.density(d) / density - 1.0).abs() < 1e-6);
            let light = around.smooth(d) * (d.y.max(0.0) / density) as f32;
            sums[0] += light / n as f32;
            sums[1] += Vec3::splat((1.0 / density) as f32 / n as f32);
        }
        assert!(near >= n - 4, "{near} of {n}");
        // Of 2 + y: 2π + 2π/3.
        assert!((f64::from(sums[0].x) / (2.0 * PI + TAU / 3.0) - 1.0).abs() < 0.02, "{}", sums[0]);
        assert!((f64::from(sums[0].z) / PI - 1.0).abs() < 0.02, "{}", sums[0]);
        assert!((f64::from(sums[1].x) / (4.0 * PI) - 1.0).abs() < 0.02, "{}", sums[1]);
    }

    #[test]
    fn a_sun_is_taken_out_with_all_its_light_and_a_wide_lamp_is_not() {
        let (width, height) = (512, 256);
        let map = Map { width, height, texels: Vec::new() };
        let (sun, lamp) = (DVec3::new(0.3, 0.8, -0.5).normalize(), DVec3::new(-1.0, 0.2, 0.0).normalize());
        let texel = |i: usize| {
            let d = map.direction(i % width, i / width);
            let up = |light: f32| Vec3::splat(light);
            if d.dot(sun) > 0.02f64.cos() {
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
        assert!(around.smooth(sun).x < 30.0 && around.smooth(lamp).x > 29.0 && around.radiance(sun).x > 4900.0);
    }
}
