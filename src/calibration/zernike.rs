//! A wavefront from Zernike coefficients, in Noll's order and normalisation (*J. Opt. Soc. Am.* 66, 207 (1976)).

use crate::error::{Error, Result};
use crate::field::Grid;
use crate::panel::Wavefront;
use rayon::prelude::*;

/// Radial degree n and azimuthal frequency m (negative: sine) of Noll's index j = 1, 2 ….
pub fn noll(j: usize) -> (u32, i32) {
    let mut n = 0;
    let mut before = 0;
    while before + n < j {
        before += n;
        n += 1;
    }
    let (degree, place) = (n - 1, j - before - 1);
    // Within a degree |m| rises by two every second term (every term but the first when the degree is even).
    let m = if degree % 2 == 0 { 2 * place.div_ceil(2) } else { 2 * (place / 2) + 1 };
    let sign = if j.is_multiple_of(2) { 1 } else { -1 };
    (degree as u32, sign * m as i32)
}

/// Z_j at (ρ, θ), ρ ≤ 1: √(n+1)·R(ρ), times √2·cos mθ for even j or √2·sin mθ for odd where m ≠ 0; of unit variance on
/// the disc.
pub fn value(j: usize, radius: f64, angle: f64) -> f64 {
    let (n, m) = noll(j);
    let order = m.unsigned_abs();
    let factorial = |k: u32| (1..=k).map(f64::from).product::<f64>();
    let radial: f64 = (0..=(n - order) / 2)
        .map(|s| {
            let sign = if s % 2 == 0 { 1.0 } else { -1.0 };
            let below = factorial(s) * factorial((n + order) / 2 - s) * factorial((n - order) / 2 - s);
            sign * factorial(n - s) / below * radius.powi((n - 2 * s) as i32)
        })
        .sum();
    let azimuth = match m {
        0 => 1.0,
        m if m > 0 => 2f64.sqrt() * (f64::from(order) * angle).cos(),
        _ => 2f64.sqrt() * (f64::from(order) * angle).sin(),
    };
    f64::from(n + 1).sqrt() * radial * azimuth
}

/// The wavefront Σ c_j·Z_j on a panel's pixels; `coefficients` [rad] from j = 1 (piston) on, over a circle of `radius` [m]
/// about the panel's middle. The polynomials go on beyond the circle.
///
/// # Errors
/// [`Error::Parameter`] for a radius that is not positive, no or too many coefficients, or one that is not finite.
pub fn wavefront(grid: Grid, wavelength: f64, coefficients: &[f64], radius: f64, name: &str) -> Result<Wavefront> {
    if !(radius > 0.0 && radius.is_finite()) {
        return Err(Error::out_of_range("radius", format!("{radius} m"), "must be greater than zero"));
    }
    // Beyond the 20th degree the terms of the radial sum cancel to fewer digits than a phase needs.
    if coefficients.is_empty() || coefficients.len() > 231 || coefficients.iter().any(|c| !c.is_finite()) {
        return Err(Error::parameter("zernike", "give 1 … 231 finite coefficients"));
    }
    let used: Vec<(usize, f64)> =
        coefficients.iter().enumerate().filter(|(_, c)| **c != 0.0).map(|(i, c)| (i + 1, *c)).collect();
    let phase = (0..grid.len())
        .into_par_iter()
        .map(|i| {
            let (x, y) = (grid.x(i % grid.width) - grid.center[0], grid.y(i / grid.width) - grid.center[1]);
            let (rho, theta) = (x.hypot(y) / radius, y.atan2(x));
            used.iter().map(|(j, c)| c * value(*j, rho, theta)).sum::<f64>() as f32
        })
        .collect();
    Wavefront::new(name, grid.width, grid.height, Some(wavelength), phase)
}
