//! A map of the sky, and directions that are drawn in proportion to its brightness.

use glam::{DVec3, Vec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Radiance by longitude and latitude, row 0 on top.
#[derive(Clone, Debug)]
pub(super) struct Map {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) texels: Vec<Vec3>,
}

impl Map {
    pub(super) fn row(&self, row: usize) -> &[Vec3] {
        &self.texels[row * self.width..][..self.width]
    }

    /// Sines of the latitudes of a row's upper and lower edge.
    fn edges(&self, row: usize) -> [f64; 2] {
        [row, row + 1].map(|edge| (FRAC_PI_2 - PI * edge as f64 / self.height as f64).sin())
    }

    /// Solid angle of a texel of a row [sr].
    pub(super) fn solid_angle(&self, row: usize) -> f64 {
        let [top, bottom] = self.edges(row);
        (top - bottom) * TAU / self.width as f64
    }

    /// Direction of a texel's middle.
    pub(super) fn direction(&self, column: usize, row: usize) -> DVec3 {
        let longitude = ((column as f64 + 0.5) / self.width as f64 - 0.5) * TAU;
        let (sin, cos) = (FRAC_PI_2 - PI * (row as f64 + 0.5) / self.height as f64).sin_cos();
        DVec3::new(cos * longitude.cos(), sin, cos * longitude.sin())
    }

    /// Linear between texels.
    pub(super) fn at(&self, direction: DVec3) -> Vec3 {
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

    /// The same of what `of` makes of each texel.
    pub(super) fn each(&self, of: impl Fn(Vec3) -> Vec3) -> Self {
        Self { width: self.width, height: self.height, texels: self.texels.iter().map(|t| of(*t)).collect() }
    }

    /// Means over blocks of texels by solid angle, so that at most `most` columns and rows are left.
    pub(super) fn coarser(&self, [columns, rows]: [usize; 2]) -> Self {
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

/// A map that directions are drawn from.
#[derive(Clone, Debug)]
pub(crate) struct Dome {
    map: Map,
    /// Sums over the texels, each of its brightness times its solid angle, up to and with it.
    up_to: Vec<f64>,
    /// The same up to the end of each row.
    rows: Vec<f64>,
    turn: f64,
}

/// A direction that was drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawn {
    /// Unit direction to where the light comes from.
    pub(crate) direction: DVec3,
    /// How densely such directions are drawn [1/sr].
    pub(crate) density: f64,
    /// Radiance of the texel there, for which no neighbours count [W/(m² sr)].
    pub(crate) texel: Vec3,
}

impl Dome {
    /// A map that is turned about +y by `turn` [rad], from +x towards +z.
    pub(super) fn new(map: Map, turn: f64) -> Self {
        let mut sum = 0.0;
        let brightness = |i: usize| {
            // A little of each, so that none is left out where all is dark.
            sum += f64::from(map.texels[i].element_sum() + 1e-12) * map.solid_angle(i / map.width);
            sum
        };
        let up_to: Vec<f64> = (0..map.texels.len()).map(brightness).collect();
        let rows = up_to.chunks(map.width).filter_map(|row| row.last().copied()).collect();
        Self { map, up_to, rows, turn }
    }

    /// Radiance from a unit direction, linear between texels.
    pub(crate) fn radiance(&self, direction: DVec3) -> Vec3 {
        self.map.at(turned(direction, -self.turn))
    }

    /// How densely [`Dome::drawn`] draws a unit direction [1/sr].
    pub(crate) fn density(&self, direction: DVec3) -> f64 {
        let map = &self.map;
        let d = turned(direction, -self.turn);
        let place = |part: f64, count: usize| ((part * count as f64).max(0.0) as usize).min(count - 1);
        let column = place(d.z.atan2(d.x) / TAU + 0.5, map.width);
        let row = place(0.5 - d.y.clamp(-1.0, 1.0).asin() / PI, map.height);
        self.density_at(row * map.width + column)
    }

    fn before(&self, index: usize) -> f64 {
        if index > 0 { self.up_to[index - 1] } else { 0.0 }
    }

    fn density_at(&self, index: usize) -> f64 {
        let total = self.before(self.up_to.len());
        (self.up_to[index] - self.before(index)) / (total * self.map.solid_angle(index / self.map.width))
    }

    /// A direction drawn in proportion to brightness by a place in the unit square; places that are near give directions that are
    /// near, but for jumps over what is dark: the row by the second number, the column in it by the first.
    pub(crate) fn drawn(&self, [u, v]: [f64; 2]) -> Drawn {
        let (map, width) = (&self.map, self.map.width);
        let total = self.before(self.up_to.len());
        let row = self.rows.partition_point(|sum| *sum <= v * total).min(map.height - 1);
        let (low, high) = (self.before(row * width), self.rows[row]);
        let down = ((v * total - low) / (high - low)).clamp(0.0, 1.0);
        let wanted = low + u * (high - low);
        let sums = &self.up_to[row * width..(row + 1) * width];
        let column = sums.partition_point(|sum| *sum <= wanted).min(width - 1);
        let index = row * width + column;
        let (low, high) = (self.before(index), self.up_to[index]);
        let along = ((wanted - low) / (high - low)).clamp(0.0, 1.0);
        let longitude = ((column as f64 + along) / width as f64 - 0.5) * TAU;
        // Even in solid angle: in the sine of latitude.
        let [top, bottom] = map.edges(row);
        let height = top + (bottom - top) * down;
        let across = (1.0 - height * height).max(0.0).sqrt();
        let local = DVec3::new(across * longitude.cos(), height, across * longitude.sin());
        Drawn { direction: turned(local, self.turn), density: self.density_at(index), texel: map.texels[index] }
    }
}

/// A vector turned about +y by `angle` [rad], from +x towards +z.
pub(super) fn turned(v: DVec3, angle: f64) -> DVec3 {
    let (sin, cos) = angle.sin_cos();
    DVec3::new(v.x * cos - v.z * sin, v.y, v.x * sin + v.z * cos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn directions_are_drawn_as_densely_as_is_said() {
        // 64 × 32 texels, brighter upwards and towards +z; a corner of it dark.
        let empty = Map { width: 64, height: 32, texels: Vec::new() };
        let texel = |i: usize| {
            let d = empty.direction(i % 64, i / 64);
            let light = Vec3::new(2.0 + d.y as f32, 2.0 + d.z as f32, 1.0);
            if d.x < -0.5 && d.y < 0.0 { Vec3::ZERO } else { light }
        };
        let map = Map { texels: (0..64 * 32).map(texel).collect(), ..empty.clone() };
        let exact = (0..64 * 32).map(|i| {
            let d = map.direction(i % 64, i / 64);
            map.texels[i].as_dvec3() * map.solid_angle(i / 64) * d.y.max(0.0)
        });
        let exact = exact.sum::<DVec3>();
        let dome = Dome::new(map, 0.4);
        let mut random = Random::new(5, 0);
        // ∫ f L / p over drawn directions is ∫ f L: here of f = max(y, 0), irradiance of a surface that looks up.
        let side = 100;
        let (mut light, mut all, mut near) = (DVec3::ZERO, 0.0, 0);
        let n = f64::from(side * side);
        for cell in 0..side * side {
            let strata = [cell % side, cell / side].map(|k| (f64::from(k) + random.uniform()) / f64::from(side));
            let Drawn { direction, density, texel } = dome.drawn(strata);
            assert!((direction.length() - 1.0).abs() < 1e-9 && density > 0.0 && texel != Vec3::ZERO);
            // But for the rounding of a direction on an edge of two texels.
            near += usize::from((dome.density(direction) / density - 1.0).abs() < 1e-6);
            light += texel.as_dvec3() * (direction.y.max(0.0) / density / n);
            all += 1.0 / density / n;
        }
        assert!(near >= 9_990, "{near}");
        assert!(((light - exact) / exact).abs().max_element() < 3e-3, "{light} {exact}");
        // What is not dark: all but where x < −½ and y < 0, a quarter of the sphere's band of heights.
        assert!((all / (3.5 * PI) - 1.0).abs() < 0.02, "{all}");
    }
}
