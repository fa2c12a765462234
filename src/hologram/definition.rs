//! The one definition of a point's field on the panel, and its two exact forms.
//!
//! # Definition
//!
//! A point at (x_j, y_j, z_j) with amplitude a and phase φ gives, on the panel,
//!
//! ```text
//! u(x, y) = a·e^{iφ} · (±i) ∫∫ W_x(f_x)·W_y(f_y) / f_z · e^{±i2π f_z |z_j|} · e^{i2π(f_x Δx + f_y Δy)} df_x df_y
//! f_z = √(1/λ² − f_x² − f_y²),  Δx = x − x_j,  Δy = y − y_j,  + for z_j ≤ 0, − for z_j > 0
//! ```
//!
//! Without W this is Weyl's integral, the spherical wave itself: a·e^{iφ}·e^{±ikr}/r, diverging from a point behind the
//! panel and converging to one in front. W limits the wave to what the panel can diffract: flat up to (1−τ)·B and
//! falling as an error function to B = 1/(2·pitch), τ = `ROLL_OFF`,
//!
//! ```text
//! W(f) = ½ erfc((|f| − b)/s),   b = B(1 − τ/2),   s = τB / (2·2.63)
//! ```
//!
//! so W(B) = 1e-4 and W((1−τ)B) = 1 − 1e-4. The integral is smooth through the panel plane: a point *on* the panel is
//! a finite spot, two to three pixels wide; only the sign ±i jumps there, as a wave's does through its focus (Gouy).
//!
//! # Far form
//!
//! Stationary phase about the local spatial frequency f = Δ/(λr) gives
//!
//! ```text
//! u = a·e^{iφ} · e^{±ikr}/r · [T(f_x)·T(f_y) ± i λ f_x f_y/(2πr) · T′(f_x)·T′(f_y)]
//! T(f) = ½ erfc((|f| − b)/(s·√(1 ∓ iq))),   q = (1 − λ²f²)/(π λ r s²)
//! ```
//!
//! i.e. W as a spatial taper on the exact sphere, its edge blurred by diffraction: 1/q is the Fresnel number of the
//! edge. Where q is dropped (T = W) the field is wrong by 1.2e-2 at 8 µm and 0.2 m; with it, measured against the
//! integral: below 150·(pitch/r)², and λ/r where the small cross term is left out (which makes T·T separable). Both hold for
//! q ≲ 1.7. Inside the flat part the field is the bare sphere to 1e-7. Nearer, the integral itself is summed.

use crate::error::Result;
use crate::field::{Complex64, Grid, grid};
use std::f64::consts::PI;
use std::sync::LazyLock;

/// τ: the part of the band over which W falls.
pub(crate) const ROLL_OFF: f64 = 0.3;

/// Half the fall in units of s: erfc(2.63)/2 = 1.0e-4.
const EDGE: f64 = 2.63;

/// Highest band limit in units of 1/λ: the corner of the box of both axes, 0.6·√2·1.13, must stay a travelling wave.
const WIDEST: f64 = 0.6;

/// The taper W along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Taper {
    /// Band limit B = 1/(2·pitch), at most 0.6/λ [cycles/m].
    pub(crate) limit: f64,
    /// Middle of the edge b [cycles/m].
    pub(crate) middle: f64,
    /// Width of the edge s [cycles/m].
    pub(crate) width: f64,
}

impl Taper {
    fn new(pitch: f64, wavelength: f64) -> Self {
        let limit = (0.5 / pitch).min(WIDEST / wavelength);
        Self { limit, middle: limit * (1.0 - 0.5 * ROLL_OFF), width: ROLL_OFF * limit / (2.0 * EDGE) }
    }
    /// W(f), f in [cycles/m].
    pub(crate) fn at(&self, f: f64) -> f64 {
        0.5 * erfc(Complex64::new((f.abs() - self.middle) / self.width, 0.0)).re
    }
    /// The frequency from which on W is below erfc(`edges`)/2 [cycles/m].
    pub(crate) fn reach(&self, edges: f64) -> f64 {
        self.middle + edges * self.width
    }
}

/// What is common to all points: wavelength and the taper of each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Optics {
    /// Vacuum wavelength λ [m].
    pub(crate) wavelength: f64,
    /// Taper along x and y.
    pub(crate) taper: [Taper; 2],
    /// Pixel pitch along x and y [m].
    pub(crate) pitch: [f64; 2],
}

impl Optics {
    /// The definition's constants for a grid; refuses a wavelength that no laser has.
    pub(crate) fn new(grid: &Grid, wavelength: f64) -> Result<Self> {
        grid::light(wavelength)?;
        let pitch = grid.pitch();
        Ok(Self { wavelength, taper: pitch.map(|p| Taper::new(p, wavelength)), pitch })
    }
    /// 1/q of the far form at the coarser axis: the Fresnel number of the taper's edge, π λ r s².
    pub(crate) fn edge_fresnel_number(&self, distance: f64) -> f64 {
        let width = self.taper[0].width.min(self.taper[1].width);
        PI * self.wavelength * distance * width * width
    }
    /// Half width of the cone along an axis, on the panel: |Δ| = |z|·tan(asin(λB)) [m].
    pub(crate) fn cone(&self, axis: usize, distance: f64) -> f64 {
        let sine = self.wavelength * self.taper[axis].limit;
        distance * sine / (1.0 - sine * sine).sqrt()
    }
    /// How far aside a point's light goes along an axis on the panel, of a band whose axes end at `ends` [cycles/m]: the other
    /// axis tilts the cone outwards in the corners [m].
    pub(crate) fn spread(&self, axis: usize, distance: f64, ends: [f64; 2]) -> f64 {
        let [sine, other] = [axis, 1 - axis].map(|axis| (self.wavelength * ends[axis]).powi(2));
        distance * (sine / (1.0 - sine - other).max(0.02)).sqrt()
    }
    /// Part of the band ±1/(2·pitch) that the taper fills: 1, less where the wavelength ends it. A kernel is as many times
    /// wider in pixels.
    pub(crate) fn filled(&self, axis: usize) -> f64 {
        2.0 * self.pitch[axis] * self.taper[axis].limit
    }
    /// Error of the far form with its cross term at this distance (relative L2 over the point's cone).
    pub(crate) fn far_error(&self, distance: f64) -> f64 {
        let pitch = self.pitch[0].max(self.pitch[1]);
        150.0 * (pitch / distance).powi(2)
    }
    /// Error of the far form without its cross term.
    pub(crate) fn separable_far_error(&self, distance: f64) -> f64 {
        self.wavelength / distance + self.far_error(distance)
    }
    /// T and dT/d|f| of the far form for a diverging wave, at frequency |f| and distance r.
    pub(crate) fn edge(&self, axis: usize, f: f64, r: f64) -> (Complex64, Complex64) {
        let taper = self.taper[axis];
        let sine = self.wavelength * f;
        let q = (1.0 - sine * sine) / (PI * self.wavelength * r * taper.width * taper.width);
        let v = (f - taper.middle) / taper.width;
        // |exp(−v²/(1 − iq))| = exp(−v²/(1 + q²)): below e^{−40} = 4e-18 the edge is not there.
        if v * v > 40.0 * (1.0 + q * q) {
            return (Complex64::from(if v < 0.0 { 1.0 } else { 0.0 }), Complex64::default());
        }
        // √(1 − iq), by its parts.
        let re = (0.5 * ((1.0 + q * q).sqrt() + 1.0)).sqrt();
        let inverse = Complex64::new(re, -0.5 * q / re).inv();
        let v = v * inverse;
        let gauss = (-v * v).exp();
        (0.5 * erfc_with(v, gauss), -gauss * inverse / (taper.width * PI.sqrt()))
    }
    /// The far form for a diverging wave of unit amplitude and phase zero, Δ and distance from the panel in metres.
    pub(crate) fn far(&self, dx: f64, dy: f64, distance: f64) -> Complex64 {
        let r = (dx * dx + dy * dy + distance * distance).sqrt();
        let (fx, fy) = (dx.abs() / (self.wavelength * r), dy.abs() / (self.wavelength * r));
        // Beyond seven widths of the widest edge that this form is used for, T is below 1e-12.
        if fx > self.taper[0].reach(12.0) || fy > self.taper[1].reach(12.0) {
            return Complex64::default();
        }
        let ((tx, ex), (ty, ey)) = (self.edge(0, fx, r), self.edge(1, fy, r));
        let cross = Complex64::new(0.0, self.wavelength * fx * fy / (2.0 * PI * r));
        // The path is reduced to turns before the sine: k·r itself has lost 1e-10 rad at 1 m.
        let turns = (r / self.wavelength).fract();
        Complex64::cis(turns * 2.0 * PI) / r * (tx * ty + cross * ex * ey)
    }
}

/// Complementary error function of a complex argument with |arg z| ≤ π/4 or |arg −z| ≤ π/4; absolute error 1e-12.
///
/// erfc(z) = e^{−z²}·w(iz) for Re z ≥ 0 with the rational series of Weideman, "Computation of the complex error
/// function", SIAM J. Numer. Anal. 31 (1994), eq. 38: w(iz) = 2/(L + z)²·Σ aₙZⁿ + 1/(√π(L + z)), Z = (L − z)/(L + z).
pub(crate) fn erfc(z: Complex64) -> Complex64 {
    erfc_with(z, (-z * z).exp())
}

/// [`erfc`] where e^{−z²} is known.
fn erfc_with(z: Complex64, gauss: Complex64) -> Complex64 {
    if z.re < 0.0 {
        return 2.0 - erfc_with(-z, gauss);
    }
    let Weideman { scale, terms } = series();
    let outer = (z + scale).inv();
    let ratio = (scale - z) * outer;
    let mut sum = Complex64::default();
    for term in terms.iter().rev() {
        sum = sum * ratio + term;
    }
    gauss * outer * (2.0 * outer * sum + 1.0 / PI.sqrt())
}

/// The scale L and the terms of the rational series of w.
fn series() -> &'static Weideman<40> {
    static SERIES: LazyLock<Weideman<40>> = LazyLock::new(Weideman::new);
    &SERIES
}

/// The rational series of w: its scale L and its terms aₙ.
pub(super) struct Weideman<const TERMS: usize> {
    pub(super) scale: f64,
    pub(super) terms: [f64; TERMS],
}

impl<const TERMS: usize> Weideman<TERMS> {
    /// aₙ are the cosine coefficients of (L² + t²)·e^{−t²} over θ, t = L·tan(θ/2), by the trapezoidal rule.
    pub(super) fn new() -> Self {
        let scale = (TERMS as f64 / 2f64.sqrt()).sqrt();
        let samples = 4 * TERMS;
        let sampled = |k: usize| {
            let theta = PI * (2 * k) as f64 / samples as f64;
            let t = scale * (0.5 * theta).tan();
            (theta, (scale * scale + t * t) * (-t * t).exp())
        };
        // The function is even, and zero at θ = π.
        let terms = std::array::from_fn(|n| {
            let sum: f64 =
                (1..samples / 2).map(sampled).map(|(theta, value)| 2.0 * value * ((n + 1) as f64 * theta).cos()).sum();
            (sum + scale * scale) / samples as f64
        });
        Self { scale, terms }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_function_equals_tables_and_its_own_integral() {
        // Abramowitz & Stegun table 7.1.
        for (x, erf) in [(0.5, 0.5204998778), (1.0, 0.8427007929), (2.0, 0.9953222650)] {
            assert!((erfc(Complex64::from(x)).re - (1.0 - erf)).abs() < 1e-10);
        }
        // d erfc/dz = −2/√π·exp(−z²), by Simpson's rule along a ray at the largest angle that occurs, over the seam
        // of the two methods: the rule's own error is (h⁴/180)·f⁗ ≈ 1e-11.
        let ray = Complex64::cis(PI / 4.0);
        let slope = |t: f64| -2.0 / PI.sqrt() * (-(ray * t) * (ray * t)).exp() * ray;
        for (from, to) in [(0.0, 2.9), (2.5, 3.5), (3.01, 5.0)] {
            let n = 2000;
            let h = (to - from) / n as f64;
            let mut sum = slope(from) + slope(to);
            for i in 1..n {
                sum += slope(from + i as f64 * h) * if i % 2 == 1 { 4.0 } else { 2.0 };
            }
            let difference = erfc(ray * to) - erfc(ray * from) - sum * (h / 3.0);
            assert!(difference.norm() < 1e-9, "{from}..{to}: {difference}");
        }
    }

    #[test]
    fn taper_is_flat_then_falls_to_the_band_limit() {
        let grid = Grid::new(4, 4, 8e-6, 4e-6).expect("grid");
        let optics = Optics::new(&grid, 633e-9).expect("optics");
        assert_eq!(optics.taper[0].limit, 62_500.0);
        assert_eq!(optics.taper[1].limit, 125_000.0);
        let w = optics.taper[0];
        assert!((w.at(0.0) - 1.0).abs() < 1e-12);
        assert!((w.at(w.middle) - 0.5).abs() < 1e-12);
        assert!(w.at(w.limit) < 1.1e-4 && 1.0 - w.at(-0.7 * w.limit) < 1.1e-4);
        // On the axis, inside the flat part, the far form is the bare sphere.
        let u = optics.far(0.0, 0.0, 0.25);
        assert!((u * 0.25 - Complex64::cis((0.25 / 633e-9_f64).fract() * 2.0 * PI)).norm() < 1e-6);
        assert!(Optics::new(&grid, 0.0).is_err() && Optics::new(&grid, f64::NAN).is_err());
    }
}
