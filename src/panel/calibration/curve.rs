//! The level → phase curve from a sweep of two-level gratings.
//!
//! Stripes of a fixed level and of level L alternate, equally wide. The zero order of that grating has the power
//! P = B + A·cos²(Δ/2), its first orders P = B + A·sin²(Δ/2), Δ = φ(L) − φ(fixed): B is stray light and what the dead space
//! sends, A the laser's power. The curve is a polynomial of the level; it, A and B are fitted to all powers together
//! (Levenberg & Marquardt), starting from the phases that the maxima and minima of the sweep tell.

use crate::error::{Error, Result};
use crate::names::{Name, Named};
use crate::panel::vendor::text;
use crate::panel::{Curve, Frame, PanelProfile};
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Which order the detector saw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The undiffracted light: brightest where the levels agree.
    Zero,
    /// A first order: dark where the levels agree.
    First,
}

impl Named for Order {
    const KIND: &'static str = "order";
    const NAMES: &'static [Name<Self>] = &[
        ("first", || Self::First, "the detector saw a first order of the gratings"),
        ("zero", || Self::Zero, "the detector saw the undiffracted light"),
    ];
}

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

/// A part of a panel whose phase is measured by itself: `place` of `parts`, counted in columns and rows from the upper left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Column and row of the region.
    pub place: (usize, usize),
    /// Number of regions side by side and one above the other.
    pub parts: (usize, usize),
}

/// The grating to show: stripes of `stripe` columns at level `fixed` and at `level`, over the whole panel or one region of
/// it; the rest then stands at `fixed` and sends nothing into the grating's orders.
///
/// # Errors
/// [`Error::Parameter`] for levels that the panel does not have, stripes without width, a region outside the panel.
pub fn sweep_frame(
    profile: &PanelProfile,
    wavelength: f64,
    (fixed, level): (u16, u16),
    stripe: usize,
    region: Option<Region>,
) -> Result<Frame> {
    if stripe == 0 {
        return Err(Error::parameter("stripe", "0 columns; take at least one, a few against crosstalk"));
    }
    let (width, height) = (profile.width, profile.height);
    let Region { place, parts } = region.unwrap_or(Region { place: (0, 0), parts: (1, 1) });
    if place.0 >= parts.0 || place.1 >= parts.1 || parts.0 > width || parts.1 > height {
        return Err(Error::parameter("regions", format!("region {place:?} of {parts:?} on {width}×{height} pixels")));
    }
    let inside = |at: usize, size: usize, place: usize, parts: usize| at * parts / size == place;
    let row = |bright: bool| -> Vec<u16> {
        let grating = |x: usize| bright && inside(x, width, place.0, parts.0) && !(x / stripe).is_multiple_of(2);
        (0..width).map(|x| if grating(x) { level } else { fixed }).collect()
    };
    let rows = [row(false), row(true)];
    let levels = (0..height).flat_map(|y| &rows[usize::from(inside(y, height, place.1, parts.1))]).copied().collect();
    let mut frame = Frame::new(profile, wavelength, levels)?;
    frame.metadata.origin.notes = vec![format!("calibration grating: levels {fixed} and {level}, stripes of {stripe}")];
    Ok(frame)
}

/// A measured power of the sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Power {
    /// Level of the grating's second stripes.
    pub level: u16,
    /// Column and row of the region that was measured, if not all of the panel.
    pub region: Option<(usize, usize)>,
    /// Power in any unit.
    pub power: f64,
}

/// Reads measured powers: comma-separated lines `level,power` or, by region, `level,column,row,power`.
///
/// A head line names the columns, in any order, and may name others, which are passed over; so are lines that begin with
/// `#`.
///
/// # Errors
/// [`Error::Calibration`] with the line that is not right, or whose level the panel does not have.
pub fn read_powers(path: &Path, levels: usize) -> Result<Vec<Power>> {
    let text = text(path)?;
    let mut columns: Vec<String> = Vec::new();
    let mut powers: Vec<Power> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim().trim_start_matches('\u{feff}');
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let refuse = |what: String| Err(Error::calibration(path, format!("line {}: {what}", number + 1)));
        let words: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
        if columns.is_empty() {
            let names: Vec<String> = words.iter().map(|word| word.to_lowercase()).collect();
            if names.iter().any(|name| name == "level") && names.iter().any(|name| name == "power") {
                columns = names;
                continue;
            }
            columns = match words.len() {
                4 => vec!["level".into(), "column".into(), "row".into(), "power".into()],
                _ => vec!["level".into(), "power".into()],
            };
        }
        if words.len() != columns.len() {
            return refuse(format!(
                "`{line}` has {} entries, {} are due: {}",
                words.len(),
                columns.len(),
                columns.join(",")
            ));
        }
        let word = |name: &str| columns.iter().position(|column| column == name).map(|at| words[at]);
        let whole =
            |name: &str| word(name).filter(|w| !w.is_empty()).map(str::parse::<usize>).transpose().map_err(drop);
        let power = word("power").unwrap_or_default();
        let (Ok(Some(level)), Ok(column), Ok(row)) = (whole("level"), whole("column"), whole("row")) else {
            return refuse(format!("`{line}` does not hold whole numbers for level, column and row"));
        };
        let Some(power) = power.parse::<f64>().ok().filter(|p| p.is_finite()) else {
            let what = if power.is_empty() { "the power is missing".into() } else { format!("`{power}` is no power") };
            return refuse(what);
        };
        if level >= levels {
            return refuse(format!("level {level}; the panel has 0 … {}", levels - 1));
        }
        let region = match (column, row) {
            (Some(column), Some(row)) => Some((column, row)),
            (None, None) => None,
            _ => return refuse("a region has a column and a row".into()),
        };
        if powers.first().is_some_and(|first| first.region.is_some() != region.is_some()) {
            return refuse("some powers are of regions, some of the whole panel".into());
        }
        powers.push(Power { level: level as u16, region, power });
    }
    if powers.is_empty() {
        return Err(Error::calibration(path, "holds no powers"));
    }
    Ok(powers)
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
        return Err(Error::parameter("degree", format!("{degree} must be 1 … 9")));
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
