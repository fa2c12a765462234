//! Holograms with parallax from left to right only, seen through a slit: rainbow holograms.
//!
//! The plane is cut into strips, each as high as the viewer's eye separates. All lines from a strip's middle row (height
//! y_s) to the slit (a line of height Y at the viewer's distance D) lie in one plane, inclined by β with tan β = (Y − y_s)/D.
//! A strip shows only what of the scene lies in its plane, and sends all its light to the slit. From there each strip is
//! seen where it is, from left to right at true depth; above and below the slit it is dark. White light draws the slit out
//! into a rainbow, and still each eye height sees one sharp picture, since a strip is no deeper than it is high.
//!
//! # The wave of a point
//!
//! A point stands in the plane at ζ = z/cos β along it, at x_p. Along the row its wave is a circle's, and down the rows it
//! goes to the slit. With ρ(x) = √((x − x_p)² + ζ²), sin α = (x − x_p)/ρ, and t the height over the strip's middle row:
//!
//! ```text
//! u(x, t) = a·w(sin α)/√ρ · exp(iφ + ik·(±ρ(x) + cos α(x)·G(t))),   G(t) = ∫₀ᵗ sin β(t') dt'
//! ```
//!
//! with + for z < 0, since ∂/∂t gives k_y = k·cos α·sin β: together with k_x = k·sin α this is the ray that meets the slit,
//! also for light that leaves aside. w is 1 up to 0.9 of the widest sin α that reference and pitch allow, and falls like a
//! cosine to 0 there. To light a slit of height s evenly, rows aim at Y + s·t/h: top to top, bottom to bottom; the strip's
//! own diffraction, λD/h, comes on top of it.
//!
//! # Few sums
//!
//! Only cos α(x)·G(t) joins x and t. About its middle values it turns by little within some rows, so
//! exp(ik(cos α − c)(G − G_b)) is a short power series, and every pixel is a sum of some moments of its column
//! instead of one over all points. The series ends where its next term is below 1e-6.

use super::plane::{ObjectBand, Rect, Segments, Slit};
use crate::field::{Complex32, Complex64};
use crate::points::colour::Lasers;
use crate::points::luminance;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// A point in a strip's plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LinePoint {
    /// Place along the row [m].
    pub x: f64,
    /// Place along the strip's plane [m]; negative behind the hologram.
    pub zeta: f64,
    /// a [√m], so that |u|² is the irradiance of a point as the eye's cells have them.
    pub amplitude: f32,
    /// φ [rad].
    pub phase: f64,
}

/// One strip of a plane.
#[derive(Clone, Debug)]
pub(super) struct Strip {
    /// Number of the strip from the top.
    pub index: i64,
    /// Height of its middle row [m].
    pub y: f64,
    /// Its own height h [m].
    pub height: f64,
    /// Wavelength [m].
    pub wavelength: f64,
    /// Slit's height over the middle row, Y − y_s [m].
    pub rise: f64,
    /// Distance of the slit [m].
    pub distance: f64,
    /// Slit's own height over the strip's.
    spread: f64,
    /// The three lasers and which one this strip is for.
    laser: Option<(Lasers, usize)>,
}

/// Powers of the series at most; row blocks are cut so that fewer do.
const POWERS: usize = 12;
/// Largest half turn of the series' exponent in a block of rows [rad].
const TURN: f64 = 1.0;
/// First power that is left out is below this.
const LEFT_OUT: f64 = 1e-6;

impl Strip {
    pub(super) fn new(plane: &Segments, slit: &Slit, index: i64) -> Self {
        let [_, y] = plane.center([0, index]);
        let height = slit.strip as f64 * plane.grid.pitch_y;
        let wavelength = slit.wavelength_of_strip(index);
        let laser = match slit.wavelengths[..] {
            [a, b, c] => Lasers::new([a, b, c]).ok().and_then(|lasers| {
                let place = lasers.wavelengths().iter().position(|&w| w == wavelength)?;
                Some((lasers, place))
            }),
            _ => None,
        };
        Self {
            index,
            y,
            height,
            wavelength,
            rise: slit.y - y,
            distance: plane.view.viewer,
            spread: slit.height / height,
            laser,
        }
    }

    /// Distance of the slit's middle along the strip's plane [m].
    pub(super) fn length(&self) -> f64 {
        self.rise.hypot(self.distance)
    }

    /// sin β and cos β of the strip's plane.
    pub(super) fn inclination(&self) -> [f64; 2] {
        let length = self.length();
        [self.rise / length, self.distance / length]
    }

    /// What of a radiance this strip's light is for.
    pub(super) fn channel(&self, rgb: [f32; 3]) -> f32 {
        match &self.laser {
            Some((lasers, place)) => lasers.drive(rgb).values[*place],
            None => luminance(rgb),
        }
    }

    /// Number of the strip's laser, red first; none where one wavelength is for all.
    pub(super) fn laser(&self) -> Option<usize> {
        self.laser.as_ref().map(|(_, place)| *place)
    }

    /// Height of the plane at which the line from the slit through a place meets it, over the middle row [m].
    pub(super) fn meets(&self, y: f64, z: f64) -> f64 {
        let slit = self.y + self.rise;
        slit + (y - slit) * self.distance / (self.distance - z) - self.y
    }

    /// G(t) [m]: rows aim at the slit's height `rise` + spread·t, seen from t. Written as (q² − q₀²)/…, without cancellation.
    fn path(&self, t: f64) -> f64 {
        let q = self.rise + (self.spread - 1.0) * t;
        t * (q + self.rise) / (q.hypot(self.distance) + self.rise.hypot(self.distance))
    }

    /// The widest |sin α|.
    pub(super) fn widest(&self, band: &ObjectBand) -> f64 {
        (band.half[0] * self.wavelength).min(0.95)
    }

    /// Puts the field of points on the pixels of `rect` into `out`, which covers `whole`; the number of sums.
    pub(super) fn field(
        &self,
        plane: &Segments,
        points: &[LinePoint],
        rect: &Rect,
        whole: &Rect,
        out: &mut [Complex32],
    ) -> f64 {
        if points.is_empty() || rect.area() == 0 {
            return 0.0;
        }
        let grid = &plane.grid;
        let widest = self.widest(&plane.band);
        // |ζ| is at least so large that a point's wave is some pixels wide.
        let (wavenumber, nearest) = (TAU / self.wavelength, 4.0 * grid.pitch_x / widest);
        // cos α lies between that of the widest angle and 1.
        let least = (1.0 - widest * widest).sqrt();
        let (middle, reach) = (0.5 * (1.0 + least), 0.5 * (1.0 - least));
        let t = |row: i64| grid.y(row as usize) - self.y;
        let mut pairs = 0.0;
        let mut from = rect.y[0];
        while from < rect.y[1] {
            // As many rows as the series carries.
            let turn = |to: i64| 0.5 * wavenumber * reach * (self.path(t(to - 1)) - self.path(t(from))).abs();
            let mut to = rect.y[1];
            while to > from + 1 && turn(to) > TURN {
                to = from + (to - from + 1) / 2;
            }
            let center = 0.5 * (self.path(t(from)) + self.path(t(to - 1)));
            let exponent = turn(to);
            let (mut powers, mut term) = (1, 1.0);
            while powers < POWERS {
                term *= exponent / powers as f64;
                if term < LEFT_OUT {
                    break;
                }
                powers += 1;
            }
            let columns = rect.width();
            let mut moments = vec![Complex32::default(); columns * powers];
            pairs += moments
                .par_chunks_mut(powers)
                .enumerate()
                .map(|(i, moments)| {
                    let x = grid.x(rect.x[0] as usize + i);
                    let mut count = 0.0;
                    for point in points {
                        let (dx, zeta) = (x - point.x, point.zeta.abs().max(nearest));
                        let rho = (dx * dx + zeta * zeta).sqrt();
                        let (sine, cosine) = (dx.abs() / rho, zeta / rho);
                        if sine >= widest {
                            continue;
                        }
                        count += 1.0;
                        let edge = 10.0 * (sine / widest - 0.9);
                        let window = if edge > 0.0 { 0.5 + 0.5 * (PI * edge).cos() } else { 1.0 };
                        let weight = (window / rho.sqrt()) as f32 * point.amplitude;
                        let along = if point.zeta < 0.0 { rho } else { -rho };
                        let turns = (along + cosine * center) / self.wavelength + point.phase / TAU;
                        // Reduced to a turn in f64: what is left loses 1e-7 in f32.
                        let (sin, cos) = (std::f32::consts::TAU * (turns - turns.floor()) as f32).sin_cos();
                        let mut value = Complex32::new(weight * cos, weight * sin);
                        let c = ((cosine - middle) / reach.max(f64::MIN_POSITIVE)) as f32;
                        for moment in moments.iter_mut() {
                            *moment += value;
                            value *= c;
                        }
                    }
                    count
                })
                .sum::<f64>();
            // Power r first, so that a row's sum runs along memory.
            let rows_of = |r: usize| moments.iter().skip(r).step_by(powers).copied().collect::<Vec<_>>();
            let moments: Vec<Vec<Complex32>> = (0..powers).map(rows_of).collect();
            let stride = whole.width();
            let left = (rect.x[0] - whole.x[0]) as usize;
            let first = (from - whole.y[0]) as usize;
            out.par_chunks_mut(stride).skip(first).take((to - from) as usize).enumerate().for_each(|(i, line)| {
                let kappa = wavenumber * (self.path(t(from + i as i64)) - center);
                let turn = kappa * middle;
                let mut factor = Complex64::cis(turn);
                let line = &mut line[left..left + columns];
                line.fill(Complex32::default());
                for (r, moments) in moments.iter().enumerate() {
                    let by = Complex32::new(factor.re as f32, factor.im as f32);
                    line.iter_mut().zip(moments).for_each(|(u, m)| *u += by * m);
                    factor *= Complex64::new(0.0, kappa * reach) / (r + 1) as f64;
                }
            });
            from = to;
        }
        pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Grid;
    use crate::random::Random;
    use crate::segments::Viewing;

    fn plane(y: f64, height: f64, strip: u64) -> (Segments, Slit) {
        let grid = Grid::new(320, 704, 0.8e-6, 0.8e-6).expect("grid");
        let slit = Slit { y, height, strip, wavelengths: vec![638e-9], superimposed: false, only: None };
        let view = Viewing { viewer: 15e-3, place: -2e-3, ..Viewing::default() };
        let size = [64, strip];
        let plane = Segments::of_panel(grid, 638e-9, 64).expect("segments");
        (Segments { size, slit: Some(slit.clone()), view, ..plane }, slit)
    }

    #[test]
    fn the_series_is_the_sum_of_the_points_waves() {
        // Steep towards the slit, wide along the row, behind and before the plate: the series is needed.
        for ((plane, slit), strips) in [(plane(0.4e-3, 0.3e-3, 61), [0, 5, 10]), (plane(0.0, 0.01e-3, 64), [0, 3, 9])] {
            for index in strips {
                let strip = Strip::new(&plane, &slit, index);
                let random = &mut Random::new(3, index as u64);
                let points: Vec<LinePoint> = (0..9)
                    .map(|i| LinePoint {
                        x: (random.uniform() - 0.5) * 300e-6,
                        zeta: [-1.0, 1.0][i % 2] * (0.1e-3 + 2e-3 * random.uniform()),
                        amplitude: 1.0 + random.uniform() as f32,
                        phase: random.phase(),
                    })
                    .collect();
                let row = index * slit.strip as i64;
                let whole = Rect { x: [20, 311], y: [row - 3, row + slit.strip as i64 + 5] };
                let rect = Rect { x: [23, 300], y: [row, row + slit.strip as i64 + 2] };
                let mut out = vec![Complex32::new(7.0, 7.0); whole.area()];
                let pairs = strip.field(&plane, &points, &rect, &whole, &mut out);
                assert!(pairs > 0.0);
                let (mut error, mut norm) = (0.0, 0.0);
                for row in rect.y[0]..rect.y[1] {
                    // G by Simpson's rule, of the angle that the definition names.
                    let end = plane.grid.y(row as usize) - strip.y;
                    let sine = |t: f64| {
                        let rise = slit.y + slit.height * t / strip.height - (strip.y + t);
                        rise / rise.hypot(plane.view.viewer)
                    };
                    let steps = 40;
                    let path: f64 = (0..=steps)
                        .map(|i| {
                            let weight = if i == 0 || i == steps { 1.0 } else { [2.0, 4.0][i % 2] };
                            weight * sine(end * i as f64 / steps as f64) * end / (3.0 * steps as f64)
                        })
                        .sum();
                    for column in rect.x[0]..rect.x[1] {
                        let mut sum = Complex64::default();
                        for p in &points {
                            let dx = plane.grid.x(column as usize) - p.x;
                            let rho = (dx * dx + p.zeta * p.zeta).sqrt();
                            let part = (dx.abs() / rho) / (plane.band.half[0] * strip.wavelength);
                            let window = match part {
                                p if p <= 0.9 => 1.0,
                                p if p < 1.0 => 0.5 + 0.5 * (PI * (p - 0.9) / 0.1).cos(),
                                _ => 0.0,
                            };
                            let path = -p.zeta.signum() * rho + p.zeta.abs() / rho * path;
                            sum += Complex64::cis(TAU * path / strip.wavelength + p.phase)
                                * window
                                * f64::from(p.amplitude)
                                / rho.sqrt();
                        }
                        let at = (row - whole.y[0]) as usize * whole.width() + (column - whole.x[0]) as usize;
                        error += (Complex64::new(f64::from(out[at].re), f64::from(out[at].im)) - sum).norm_sqr();
                        norm += sum.norm_sqr();
                    }
                }
                let error = (error / norm).sqrt();
                assert!(error < 2e-5, "strip {index}: {error}");
                assert!(out[0] == Complex32::new(7.0, 7.0), "only its own pixels");
            }
        }
    }

    #[test]
    fn lines_from_the_slit_meet_the_plane_where_they_should() {
        let (plane, slit) = plane(0.4e-3, 0.3e-3, 64);
        let (strip, viewer) = (Strip::new(&plane, &slit, 2), plane.view.viewer);
        let [sine, cosine] = strip.inclination();
        for z in [-2e-3, 0.0, 1.5e-3] {
            // In the strip's plane it meets the middle row; a point above does so above.
            let y = strip.y + z * sine / cosine;
            assert!(strip.meets(y, z).abs() < 1e-15);
            assert!(strip.meets(y + 1e-5, z) > 0.9e-5 * viewer / (viewer - z));
        }
        assert!((slit.wavelength_of(0) - 638e-9).abs() < 1e-15);
    }
}
