//! The level → phase curve from a sweep of two-level gratings.
//!
//! Stripes of a fixed level and of level L alternate, equally wide. The zero order of that grating has the power
//! P = B + A·cos²(Δ/2), its first orders P = B + A·sin²(Δ/2), Δ = φ(L) − φ(fixed): B is stray light and what the dead space
//! sends, A the laser's power. The curve is a polynomial of the level; it, A and B are fitted to all powers together
//! (Levenberg & Marquardt), starting from the phases that the maxima and minima of the sweep tell.

use super::profile_name;
use super::sweep::{Order, Power, read_powers};
use crate::error::{Error, Result};
use crate::panel::{Curve, PanelProfile};
use crate::units::show_length;
use serde::Serialize;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// A fitted curve.
#[derive(Clone, Debug)]
pub struct CurveFit {
    /// Polynomial of the phase [rad], zero at level 0.
    pub curve: Curve,
    /// Standard deviation of the phase at each level [rad], from the scatter of the powers about the fit.
    pub uncertainty: Vec<f64>,
    /// Root mean square of measured − fitted power, as share of A.
    pub residual: f64,
    /// Range of the curve [rad].
    pub range: f64,
    /// Degree of the polynomial.
    pub degree: usize,
}

/// What a measured curve is, and how sure.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct CurveReport {
    /// Number of powers.
    pub powers: usize,
    /// Order in which they were measured.
    pub order: Order,
    /// Regions side by side and one above the other, where each has a curve of its own.
    pub regions: Option<[usize; 2]>,
    /// Degree of the polynomial.
    pub degree: usize,
    /// Standard deviation of the phase at each level [rad].
    pub uncertainty: Vec<f64>,
    /// Root mean square of it over the levels [rad].
    pub uncertainty_rms: f64,
    /// Largest of it [rad].
    #[serde(skip)]
    pub uncertainty_most: f64,
    /// Root mean square of measured − fitted power, as share of the modulated power.
    pub residual: f64,
    /// Range of the curve [rad].
    pub range: f64,
    /// Levels that one turn spans, by the mean slope.
    pub levels_for_2pi: Option<f64>,
}

/// A profile with a curve that was measured.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct MeasuredCurve {
    /// The profile.
    pub profile: PanelProfile,
    /// The curve in figures.
    pub report: CurveReport,
    /// What the written profile says of it.
    remarks: Vec<String>,
}

/// The curve that a file of measured powers tells, put into the profile.
///
/// # Errors
/// As [`read_powers`] and [`fit`].
pub fn measure_curve(
    profile: &PanelProfile,
    wavelength: f64,
    powers: &Path,
    order: Order,
    degree: Option<usize>,
) -> Result<MeasuredCurve> {
    let measured = read_powers(powers, profile.levels(), wavelength)?;
    let CurveFit { curve, uncertainty, residual, range, degree } =
        fit(&measured, profile.levels(), order, degree, powers)?;
    let uncertainty_most = uncertainty.iter().fold(0.0, |a: f64, &b| a.max(b));
    let uncertainty_rms = (uncertainty.iter().map(|u| u * u).sum::<f64>() / uncertainty.len() as f64).sqrt();
    let mut remarks = vec![
        format!("{} with its curve at {} measured: {}", profile.name, show_length(wavelength), powers.display()),
        format!(
            "uncertainty {uncertainty_rms:.4} rad RMS over the levels, {uncertainty_most:.4} rad at most; residual {residual:.4}"
        ),
    ];
    let regions = match &curve {
        Curve::Regional { columns, rows, .. } => Some([*columns, *rows]),
        _ => None,
    };
    if let Some([columns, rows]) = regions {
        remarks.push(format!("{columns} × {rows} regions, row by row from the upper left"));
    }
    let profile = profile.with_measured_curve(wavelength, curve);
    let levels_for_2pi = profile.drive_curve(wavelength)?.0.levels_for_2pi();
    let powers = measured.len();
    let report = CurveReport {
        powers,
        order,
        regions,
        degree,
        uncertainty,
        uncertainty_rms,
        uncertainty_most,
        residual,
        range,
        levels_for_2pi,
    };
    Ok(MeasuredCurve { profile, report, remarks })
}

impl MeasuredCurve {
    /// Writes the profile, having proved that it is read back.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a name that does not end in `.toml`; [`Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        profile_name(path)?;
        // Files that the profile names are found beside it, wherever it was read from.
        let mut profile = self.profile.clone();
        for correction in &mut profile.corrections {
            correction.file = std::path::absolute(&correction.file).map_err(Error::io(&correction.file))?;
        }
        PanelProfile::parse(&profile.to_toml(&self.remarks)?, path)?;
        profile.write(path, &self.remarks)
    }
}

/// Fits one curve, or where the powers are of regions one for each.
///
/// # Errors
/// As [`fit_curve`]; [`Error::Calibration`] when a region has no powers.
pub fn fit(powers: &[Power], levels: usize, order: Order, degree: Option<usize>, source: &Path) -> Result<CurveFit> {
    let of = |region: Option<(usize, usize)>| -> Vec<(u16, f64)> {
        powers.iter().filter(|p| p.region == region).map(|p| (p.level, p.power)).collect()
    };
    if powers.iter().all(|p| p.region.is_none()) {
        return fit_curve(&of(None), levels, order, degree, source);
    }
    let greatest =
        |of: fn(&(usize, usize)) -> usize| powers.iter().filter_map(|p| p.region.as_ref().map(of)).max().unwrap_or(0);
    let (columns, rows) = (greatest(|r| r.0) + 1, greatest(|r| r.1) + 1);
    if columns > 256 || rows > 256 {
        return Err(Error::calibration(source, format!("{columns}×{rows} regions are too many: 256 each")));
    }
    let mut all = CurveFit {
        curve: Curve::LinearAmplitude,
        uncertainty: vec![0.0; levels],
        residual: 0.0,
        range: f64::INFINITY,
        degree: 0,
    };
    let mut curves = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let one = of(Some((column, row)));
            if one.is_empty() {
                return Err(Error::calibration(source, format!("region {column},{row} has no powers")));
            }
            let found = fit_curve(&one, levels, order, degree, source).map_err(|e| match e {
                Error::Calibration { path, what } => Error::calibration(path, format!("region {column},{row}: {what}")),
                other => other,
            })?;
            // The worst of all regions is what a user should know.
            all.uncertainty.iter_mut().zip(&found.uncertainty).for_each(|(worst, own)| *worst = worst.max(*own));
            all.residual = all.residual.max(found.residual);
            all.range = all.range.min(found.range);
            all.degree = all.degree.max(found.degree);
            curves.push(found.curve);
        }
    }
    all.curve = Curve::Regional { columns, rows, curves };
    all.curve.check(levels, source)?;
    Ok(all)
}

/// Fits the curve of a panel with `levels` levels to the powers of a sweep against level 0.
///
/// `degree` is that of the polynomial; absent, the one of 2 … 8 that explains the powers best for its number of
/// coefficients (Schwarz's criterion n·ln(Σr²/n) + k·ln n, *Ann. Statist.* 6, 461 (1978)).
///
/// Powers do not tell in which direction the phase runs: the curve always rises, the panel's sign is the profile's.
///
/// # Errors
/// [`Error::Calibration`] (for `source`) when there are too few powers, the sweep shows no modulation, or the fitted
/// curve turns back: then the sweep is too noisy or the degree too high.
pub fn fit_curve(
    powers: &[(u16, f64)],
    levels: usize,
    order: Order,
    degree: Option<usize>,
    source: &Path,
) -> Result<CurveFit> {
    let Some(degree) = degree else {
        let count = powers.len() as f64;
        let score =
            |fit: &CurveFit| count * fit.residual.max(1e-12).powi(2).ln() + (fit.degree + 2) as f64 * count.ln();
        let fits: Vec<Result<CurveFit>> =
            (2..=8).map(|degree| fit_degree(powers, levels, order, degree, source)).collect();
        let mut best: Option<CurveFit> = None;
        let mut refused = None;
        for fit in fits {
            match fit {
                Ok(fit) if best.as_ref().is_none_or(|best| score(&fit) < score(best)) => best = Some(fit),
                Ok(_) => {}
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        let none = || refused.unwrap_or_else(|| Error::calibration(source, "no curve fits the powers"));
        return best.ok_or_else(none);
    };
    fit_degree(powers, levels, order, degree, source)
}

fn fit_degree(powers: &[(u16, f64)], levels: usize, order: Order, degree: usize, source: &Path) -> Result<CurveFit> {
    let refuse = |what: String| Err(Error::calibration(source, what));
    if !(1..=9).contains(&degree) {
        return Err(Error::out_of_range("degree", degree, "must be 1 … 9"));
    }
    if powers.len() < 4 * (degree + 2) {
        let what = format!("{} powers; a fit of degree {degree} needs {} or more", powers.len(), 4 * (degree + 2));
        return refuse(what);
    }
    let mut powers = powers.to_vec();
    powers.sort_by_key(|p| p.0);
    let full = (levels.max(2) - 1) as f64;
    let x: Vec<f64> = powers.iter().map(|p| f64::from(p.0) / full).collect();
    // As a first order: dark where the levels agree.
    let turned = if order == Order::Zero { -1.0 } else { 1.0 };
    let y: Vec<f64> = powers.iter().map(|p| p.1 * turned).collect();
    let start = starting_phases(&x, &y).ok_or_else(|| {
        Error::calibration(source, "the powers show no modulation; check detector, order and grating")
    })?;
    let mut parameters = polynomial(&x, &start, degree);
    let (low, high) = bounds(&smoothed(&y));
    parameters.extend([high - low, low]);
    let covariance = refine(&x, &y, &mut parameters, degree)
        .ok_or_else(|| Error::calibration(source, "the fit does not converge; take more levels or a lower degree"))?;
    let (amplitude, offset) = (parameters[degree], parameters[degree + 1]);
    let model = |x: f64| offset + amplitude * (0.5 * phase_at(&parameters[..degree], x)).sin().powi(2);
    let squares: f64 = x.iter().zip(&y).map(|(&x, &y)| (y - model(x)).powi(2)).sum();
    let variance = squares / (x.len() - degree - 2) as f64;
    let uncertainty = (0..levels)
        .map(|level| {
            let x = level as f64 / full;
            let slopes: Vec<f64> = (1..=degree).map(|i| x.powi(i as i32)).collect();
            let sum: f64 = (0..degree)
                .flat_map(|i| (0..degree).map(move |j| (i, j)))
                .map(|(i, j)| slopes[i] * covariance[i][j] * slopes[j])
                .sum();
            (variance * sum).max(0.0).sqrt()
        })
        .collect();
    let coefficients = std::iter::once(0.0).chain(parameters[..degree].iter().copied()).collect();
    let curve = Curve::Polynomial { coefficients };
    curve.check(levels, source)?;
    let range = phase_at(&parameters[..degree], 1.0).abs();
    Ok(CurveFit { curve, uncertainty, residual: (squares / x.len() as f64).sqrt() / amplitude.abs(), range, degree })
}

/// Σ cᵢ·xⁱ from i = 1.
fn phase_at(coefficients: &[f64], x: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| (sum + c) * x)
}

fn bounds(y: &[f64]) -> (f64, f64) {
    y.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
}

/// Means over a fifteenth of the sweep: noise must not make extrema.
fn smoothed(y: &[f64]) -> Vec<f64> {
    let reach = (y.len() / 30).max(1);
    (0..y.len())
        .map(|i| {
            let window = &y[i.saturating_sub(reach)..(i + reach + 1).min(y.len())];
            window.iter().sum::<f64>() / window.len() as f64
        })
        .collect()
}

/// Phases that the sweep's branches between its extrema tell: half a turn each.
fn starting_phases(x: &[f64], y: &[f64]) -> Option<Vec<f64>> {
    let smooth = smoothed(y);
    let (low, high) = bounds(&smooth);
    let span = high - low;
    let scatter = y.iter().zip(&smooth).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / y.len() as f64;
    if span <= 4.0 * scatter.sqrt() || span <= 0.0 {
        return None;
    }
    // Extrema alternate; one counts once the sweep has moved away from it by a third of the span.
    let mut turns = Vec::new();
    let (mut rising, mut extreme) = (true, 0);
    for (i, &v) in smooth.iter().enumerate() {
        let further = if rising { v > smooth[extreme] } else { v < smooth[extreme] };
        if further {
            extreme = i;
        } else if (v - smooth[extreme]).abs() > span / 3.0 {
            turns.push(extreme);
            rising = !rising;
            extreme = i;
        }
    }
    let phases = (0..x.len())
        .map(|i| {
            let branch = turns.iter().filter(|&&turn| i > turn).count();
            let half = 2.0 * ((smooth[i] - low) / span).clamp(0.0, 1.0).sqrt().asin();
            branch.div_ceil(2) as f64 * TAU + if branch % 2 == 0 { half } else { -half }
        })
        .collect();
    Some(phases)
}

/// Least squares of Σ cᵢ·xⁱ, i = 1 … degree.
fn polynomial(x: &[f64], y: &[f64], degree: usize) -> Vec<f64> {
    let mut normal = vec![vec![0.0; degree]; degree];
    let mut right = vec![0.0; degree];
    for (&x, &y) in x.iter().zip(y) {
        let powers: Vec<f64> = (1..=degree).map(|i| x.powi(i as i32)).collect();
        add_equation(&mut normal, &mut right, &powers, y);
    }
    solve(&mut normal, &mut right).unwrap_or_else(|| {
        let mut line = vec![0.0; degree];
        line[0] = PI;
        line
    })
}

/// Levenberg–Marquardt on coefficients, amplitude and offset; returns the inverse of the normal matrix.
fn refine(x: &[f64], y: &[f64], parameters: &mut [f64], degree: usize) -> Option<Vec<Vec<f64>>> {
    let count = parameters.len();
    let error = |p: &[f64]| -> f64 {
        let model = |x: f64| p[degree + 1] + p[degree] * (0.5 * phase_at(&p[..degree], x)).sin().powi(2);
        x.iter().zip(y).map(|(&x, &y)| (y - model(x)).powi(2)).sum()
    };
    let normal_matrix = |p: &[f64]| {
        let mut normal = vec![vec![0.0; count]; count];
        let mut right = vec![0.0; count];
        for (&x, &y) in x.iter().zip(y) {
            let phase = phase_at(&p[..degree], x);
            let mut slopes: Vec<f64> = (1..=degree).map(|i| 0.5 * p[degree] * phase.sin() * x.powi(i as i32)).collect();
            slopes.extend([(0.5 * phase).sin().powi(2), 1.0]);
            let miss = y - p[degree + 1] - p[degree] * slopes[degree];
            add_equation(&mut normal, &mut right, &slopes, miss);
        }
        (normal, right)
    };
    let mut damping = 1e-3;
    let mut least = error(parameters);
    for _ in 0..200 {
        let (mut normal, mut step) = normal_matrix(parameters);
        for (i, row) in normal.iter_mut().enumerate() {
            row[i] *= 1.0 + damping;
        }
        let solved = solve(&mut normal, &mut step)?;
        let moved: Vec<f64> = parameters.iter().zip(&solved).map(|(p, s)| p + s).collect();
        let next = error(&moved);
        if next < least {
            let settled = least - next < 1e-12 * least;
            parameters.copy_from_slice(&moved);
            least = next;
            damping *= 0.2;
            if settled {
                break;
            }
        } else {
            damping *= 5.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    let normal = normal_matrix(parameters).0;
    let columns: Option<Vec<Vec<f64>>> = (0..count)
        .map(|k| {
            let mut unit = vec![0.0; count];
            unit[k] = 1.0;
            solve(&mut normal.clone(), &mut unit)
        })
        .collect();
    columns
}

/// Adds one equation Σ factorᵢ·unknownᵢ = value to the normal equations.
fn add_equation(normal: &mut [Vec<f64>], right: &mut [f64], factors: &[f64], value: f64) {
    for ((row, right), a) in normal.iter_mut().zip(right).zip(factors) {
        *right += a * value;
        for (cell, b) in row.iter_mut().zip(factors) {
            *cell += a * b;
        }
    }
}

/// Gaussian elimination with pivots; `None` for a singular matrix.
fn solve(matrix: &mut [Vec<f64>], right: &mut [f64]) -> Option<Vec<f64>> {
    let n = right.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| matrix[a][k].abs().total_cmp(&matrix[b][k].abs()))?;
        // Columns of a least-squares matrix differ by powers of ten, never by this much.
        if matrix[pivot][k].abs() < 1e-300 {
            return None;
        }
        matrix.swap(k, pivot);
        right.swap(k, pivot);
        let head = matrix[k].clone();
        for i in k + 1..n {
            let factor = matrix[i][k] / head[k];
            for (a, b) in matrix[i].iter_mut().zip(&head).skip(k) {
                *a -= factor * b;
            }
            right[i] -= factor * right[k];
        }
    }
    for k in (0..n).rev() {
        let sum: f64 = (k + 1..n).map(|j| matrix[k][j] * right[j]).sum();
        right[k] = (right[k] - sum) / matrix[k][k];
    }
    Some(right.to_vec())
}
