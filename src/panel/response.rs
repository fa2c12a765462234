//! Drive level → modulation as profiles state it: the shapes of curves, checked and worked out level by level.

use super::drive_curve::{DriveCurve, Modulation, non_monotone};
use super::regional::PixelCurve;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Level → modulation as a profile states it, at one wavelength or (where `wavelength` is absent) at any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Response {
    /// Wavelength at which the curve was measured [m]; absent: the panel is set up for whatever wavelength is chosen.
    pub wavelength: Option<f64>,
    /// The curve.
    pub curve: Curve,
}

/// Shapes of a level → modulation curve. L runs over the panel's levels, 0 … 2^bits − 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Curve {
    /// Phase 2π·L / `levels_for_2pi`.
    Linear {
        /// Number of levels that make one turn (may exceed the panel's: then its range stays below 2π).
        levels_for_2pi: f64,
    },
    /// One phase a level [rad], unwrapped, strictly monotone.
    Table {
        /// Phase of each level [rad].
        phase: Vec<f64>,
    },
    /// Phase Σ cᵢ·xⁱ [rad] with x = L / (levels − 1), strictly monotone.
    Polynomial {
        /// Coefficients c₀, c₁ … [rad].
        coefficients: Vec<f64>,
    },
    /// Piston mirror: height h of each level [m]; its phase is 4πh/λ (the path changes twice).
    Piston {
        /// Height of each level [m].
        height: Vec<f64>,
    },
    /// A controller's table: gray g of n, asked for phase 2πg/n, is sent to the head as level `output[g]`.
    LevelTable {
        /// Level for each gray.
        output: Vec<u16>,
    },
    /// Curves of `columns × rows` equal rectangles of the panel, row by row from the upper left ([`super::regional`]).
    Regional {
        /// Rectangles side by side.
        columns: usize,
        /// Rectangles one above the other.
        rows: usize,
        /// One curve each: all tables or all polynomials, which all rise or all fall.
        curves: Vec<Curve>,
    },
    /// Amplitude transmittance of each level, 0 … 1.
    Transmittance {
        /// Amplitude transmittance of each level.
        amplitude: Vec<f64>,
    },
    /// Amplitude transmittance L / (levels − 1).
    LinearAmplitude,
}

impl Curve {
    /// What the curve modulates.
    pub fn modulation(&self) -> Modulation {
        match self {
            Self::Transmittance { .. } | Self::LinearAmplitude => Modulation::Amplitude,
            _ => Modulation::Phase,
        }
    }

    /// Refuses a curve that does not fit a panel of `levels` levels; `path` is the profile that it stands in.
    pub fn check(&self, levels: usize, path: &Path) -> Result<()> {
        let refuse = |what: String| Err(Error::calibration(path, what));
        let (values, name) = match self {
            Self::Linear { levels_for_2pi } => {
                // One level a turn can show no phase but zero.
                return if levels_for_2pi.is_finite() && *levels_for_2pi > 1.0 {
                    Ok(())
                } else {
                    refuse(format!("response.levels_for_2pi = {levels_for_2pi} must be greater than 1"))
                };
            }
            Self::LinearAmplitude => return Ok(()),
            Self::LevelTable { output } => {
                let greatest = output.iter().copied().max().map_or(0, usize::from);
                return if output.len() < 2 {
                    refuse("the level table has no lines".into())
                } else if greatest >= levels {
                    refuse(format!(
                        "the level table goes up to {greatest}, the panel has levels 0 … {}: load such a table into the head's controller",
                        levels - 1
                    ))
                } else {
                    Ok(())
                };
            }
            Self::Regional { columns, rows, curves } => return check_regions(*columns, *rows, curves, levels, path),
            Self::Polynomial { coefficients } => {
                if coefficients.len() < 2 || coefficients.iter().any(|c| !c.is_finite()) {
                    return refuse("response.coefficients needs two or more finite numbers".into());
                }
                (self.phases(levels, f64::NAN), "coefficients")
            }
            Self::Table { phase } => (phase.clone(), "values"),
            Self::Piston { height } => (height.clone(), "heights"),
            Self::Transmittance { amplitude } => (amplitude.clone(), "values"),
        };
        if values.len() != levels {
            let count = values.len();
            return refuse(format!(
                "response.{name} has {count} entries; the panel has {levels} levels: give one each"
            ));
        }
        if let Some(level) = values.iter().position(|v| !v.is_finite()) {
            return refuse(format!("response.{name}: level {level} is not finite"));
        }
        match self {
            Self::Transmittance { .. } => match values.iter().position(|v| !(0.0..=1.0).contains(v)) {
                Some(level) => {
                    refuse(format!("response.{name}: level {level} is {}, an amplitude is 0 … 1", values[level]))
                }
                None => Ok(()),
            },
            // A mirror's codes need not be in the order of its heights.
            Self::Piston { .. } => Ok(()),
            _ => match non_monotone(&values) {
                Some(level) => refuse(format!(
                    "response.{name}: the phase turns back at level {level}; a level → phase curve must rise or fall all the way"
                )),
                None => Ok(()),
            },
        }
    }

    /// Unwrapped phase of each level [rad] at a wavelength [m] (which only [`Curve::Piston`] needs); empty for an
    /// amplitude curve.
    fn phases(&self, levels: usize, wavelength: f64) -> Vec<f64> {
        match self {
            Self::Linear { levels_for_2pi } => (0..levels).map(|l| TAU * l as f64 / levels_for_2pi).collect(),
            Self::Table { phase } => phase.clone(),
            Self::Polynomial { coefficients } => (0..levels)
                .map(|l| {
                    let x = l as f64 / (levels.max(2) - 1) as f64;
                    coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c)
                })
                .collect(),
            Self::Piston { height } => height.iter().map(|h| 4.0 * PI * h / wavelength).collect(),
            Self::LevelTable { output } => table_phases(output, levels),
            Self::Regional { curves, .. } => {
                let each: Vec<Vec<f64>> = curves.iter().map(|curve| curve.phases(levels, wavelength)).collect();
                (0..levels).map(|l| each.iter().map(|phases| phases[l]).sum::<f64>() / each.len() as f64).collect()
            }
            Self::Transmittance { .. } | Self::LinearAmplitude => Vec::new(),
        }
    }

    /// As [`Curve::resolve`], for each pixel of a panel of that size.
    pub(crate) fn resolve_pixels(
        &self,
        levels: usize,
        size: (usize, usize),
        wavelength: f64,
        measured_at: Option<f64>,
        sign: PhaseSign,
    ) -> PixelCurve {
        let mean = self.resolve(levels, wavelength, measured_at, sign);
        let Self::Regional { columns, rows, curves } = self else {
            return PixelCurve::uniform(mean);
        };
        let factor = phase_factor(wavelength, measured_at, sign);
        let phases = |curve: &Self| curve.phases(levels, wavelength).into_iter().map(|p| p * factor).collect();
        PixelCurve::regional(mean, *columns, *rows, curves.iter().map(phases).collect(), size.0, size.1)
    }

    /// The curve worked out level by level at a wavelength [m]; `measured_at` is where a phase curve was measured.
    ///
    /// A phase measured at λ₀ is taken as φ·λ₀/λ elsewhere: the optical path is kept, its dispersion neglected.
    pub(crate) fn resolve(
        &self,
        levels: usize,
        wavelength: f64,
        measured_at: Option<f64>,
        sign: PhaseSign,
    ) -> DriveCurve {
        match self {
            Self::Transmittance { amplitude } => DriveCurve::amplitude(amplitude.clone()),
            Self::LinearAmplitude => {
                DriveCurve::amplitude((0..levels).map(|l| l as f64 / (levels.max(2) - 1) as f64).collect())
            }
            Self::LevelTable { output } => {
                let factor = phase_factor(wavelength, measured_at, sign);
                let values = self.phases(levels, wavelength).into_iter().map(|p| p * factor).collect();
                DriveCurve::table(values, output, factor)
            }
            _ => {
                let measured_at = measured_at.filter(|_| !matches!(self, Self::Piston { .. }));
                let factor = phase_factor(wavelength, measured_at, sign);
                DriveCurve::phase(self.phases(levels, wavelength).into_iter().map(|p| p * factor).collect())
            }
        }
    }
}

/// Factor on phases measured at another wavelength or counted the other way.
fn phase_factor(wavelength: f64, measured_at: Option<f64>, sign: PhaseSign) -> f64 {
    let sign = match sign {
        PhaseSign::Increasing => 1.0,
        PhaseSign::Decreasing => -1.0,
    };
    sign * measured_at.map_or(1.0, |measured| measured / wavelength)
}

fn check_regions(columns: usize, rows: usize, curves: &[Curve], levels: usize, path: &Path) -> Result<()> {
    let refuse = |what: String| Err(Error::calibration(path, what));
    // A region of fewer pixels than a curve has parameters is no region.
    if columns == 0 || rows == 0 || columns > 256 || rows > 256 {
        return refuse(format!("response.regions = {columns}×{rows} must be 1 … 256 each"));
    }
    if curves.len() != columns * rows {
        return refuse(format!("{} curves for {} regions; give one each", curves.len(), columns * rows));
    }
    let mut rises = None;
    for (k, curve) in curves.iter().enumerate() {
        if !matches!(curve, Curve::Table { .. } | Curve::Polynomial { .. })
            || std::mem::discriminant(curve) != std::mem::discriminant(&curves[0])
        {
            return refuse(format!("region {k}: regions have level → phase tables, or polynomials, all of one kind"));
        }
        curve.check(levels, path)?;
        let phases = curve.phases(levels, f64::NAN);
        let rising = phases.last() > phases.first();
        if *rises.get_or_insert(rising) != rising {
            return refuse(format!("region {k}: its phase runs against the other regions'"));
        }
    }
    Ok(())
}

/// Phases of all levels of a panel from a controller's table: between its outputs in proportion, beyond them as at the end.
fn table_phases(output: &[u16], levels: usize) -> Vec<f64> {
    let mut known: Vec<(u16, f64)> =
        output.iter().enumerate().map(|(gray, &level)| (level, TAU * gray as f64 / output.len() as f64)).collect();
    known.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    // Two grays of one level are shown as the lower one.
    known.dedup_by_key(|pair| pair.0);
    (0..levels)
        .map(|level| {
            let after = known.partition_point(|pair| usize::from(pair.0) < level);
            match (after.checked_sub(1).and_then(|i| known.get(i)), known.get(after)) {
                (Some(&(a, low)), Some(&(b, high))) => {
                    low + (high - low) * (level as f64 - f64::from(a)) / (f64::from(b) - f64::from(a))
                }
                (Some(&(_, phase)), None) | (None, Some(&(_, phase))) => phase,
                (None, None) => 0.0,
            }
        })
        .collect()
}

/// Whether a higher drive level delays the light more, or less.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PhaseSign {
    /// Phase rises with the level: phase 0 → level 0, π → the middle.
    #[default]
    Increasing,
    /// Phase falls with the level: the profile's curve is negated.
    Decreasing,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Complex64;

    fn brute(curve: &DriveCurve, wish: f64) -> f64 {
        let miss = |v: f64| match curve.modulation() {
            Modulation::Phase => (v - wish + PI).rem_euclid(TAU) - PI,
            Modulation::Amplitude => v - wish,
        };
        curve.usable().iter().map(|v| miss(v.0).abs()).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn nearest_level_is_nearest_on_the_circle() {
        let curves = [
            Curve::Linear { levels_for_2pi: 256.0 }.resolve(256, 5e-7, None, PhaseSign::Increasing),
            Curve::Linear { levels_for_2pi: 100.0 }.resolve(256, 5e-7, None, PhaseSign::Decreasing),
            Curve::Linear { levels_for_2pi: 320.0 }.resolve(256, 5e-7, None, PhaseSign::Increasing),
            Curve::Polynomial { coefficients: vec![0.3, 2.0, 2.5] }.resolve(16, 5e-7, None, PhaseSign::Increasing),
            Curve::Piston { height: vec![0.0, 30e-9, 10e-9, 200e-9] }.resolve(4, 5e-7, None, PhaseSign::Increasing),
            Curve::Transmittance { amplitude: vec![0.0, 0.1, 0.7, 1.0] }.resolve(4, 5e-7, None, PhaseSign::Increasing),
        ];
        for curve in &curves {
            for i in -300..600 {
                let wish = 0.0173 * f64::from(i);
                let (level, miss) = curve.nearest(wish);
                assert!((miss.abs() - brute(curve, wish)).abs() < 1e-12, "{wish}");
                let made = curve.phasor(level);
                let told = match curve.modulation() {
                    Modulation::Phase => Complex64::cis(wish + miss),
                    Modulation::Amplitude => Complex64::new(wish + miss, 0.0),
                };
                assert!((made - told).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn a_range_above_one_turn_uses_the_first_turn_and_one_below_leaves_a_gap() {
        let wide = Curve::Linear { levels_for_2pi: 64.0 }.resolve(256, 5e-7, None, PhaseSign::Increasing);
        assert!((0..1000).all(|i| wide.nearest(0.01 * f64::from(i)).0 < 64));
        // 1.6π of range: the gap is 0.4π wide, its middle 0.2π from the nearest level.
        let narrow = Curve::Linear { levels_for_2pi: 320.0 }.resolve(257, 5e-7, None, PhaseSign::Increasing);
        let (_, miss) = narrow.nearest(1.8 * PI);
        assert!((miss.abs() - 0.2 * PI).abs() < 1e-9 && narrow.unreachable(miss));
        let (_, miss) = narrow.nearest(1.003 * PI);
        assert!(!narrow.unreachable(miss));
        assert!((narrow.range() - 1.6 * PI).abs() < 1e-12);
    }

    #[test]
    fn a_controllers_table_sends_each_gray_to_its_own_level() {
        // Ten bits out, a bent curve, two grays on one level.
        let output: Vec<u16> = (0..256)
            .map(|g| if g == 1 { 40 } else { (40.0 + 900.0 * (f64::from(g) / 256.0).powf(1.3)) as u16 })
            .collect();
        let curve = Curve::LevelTable { output: output.clone() };
        curve.check(1024, Path::new("x.lut")).expect("fits");
        let told = curve.check(256, Path::new("x.lut")).expect_err("too high").to_string();
        assert!(told.contains("controller"), "{told}");
        let curve = curve.resolve(1024, 5e-7, None, PhaseSign::Increasing);
        for gray in [0usize, 2, 77, 128, 255] {
            let (level, miss) = curve.nearest(TAU * gray as f64 / 256.0);
            assert_eq!(level, output[gray]);
            assert!(
                miss.abs() < 1e-9 && (curve.phasor(level) - Complex64::cis(TAU * gray as f64 / 256.0)).norm() < 1e-9
            );
        }
        let falling = Curve::LevelTable { output: output.clone() }.resolve(1024, 5e-7, None, PhaseSign::Decreasing);
        assert_eq!(falling.nearest(-TAU * 77.0 / 256.0).0, output[77]);
    }

    #[test]
    fn a_measured_curve_keeps_its_optical_path_at_another_wavelength() {
        let curve = Curve::Table { phase: vec![0.0, 1.0, 2.0] };
        let elsewhere = curve.resolve(3, 500e-9, Some(600e-9), PhaseSign::Increasing);
        assert!((elsewhere.values()[2] - 2.4).abs() < 1e-12);
    }

    #[test]
    fn bad_curves_are_refused_with_the_level_that_breaks_them() {
        let path = Path::new("x.toml");
        let text = |curve: Curve| curve.check(4, path).expect_err("refused").to_string();
        assert!(text(Curve::Table { phase: vec![0.0, 1.0, 0.5, 2.0] }).contains("level 2"));
        assert!(text(Curve::Table { phase: vec![0.0, 1.0] }).contains("2 entries"));
        assert!(text(Curve::Polynomial { coefficients: vec![0.0, 1.0, -1.0] }).contains("turns back"));
        assert!(text(Curve::Linear { levels_for_2pi: 0.0 }).contains("greater than 1"));
        assert!(text(Curve::Transmittance { amplitude: vec![0.0, 0.5, 1.5, 1.0] }).contains("level 2"));
        assert!(Curve::Piston { height: vec![0.0, 2e-7, 1e-7, 3e-7] }.check(4, path).is_ok());
    }
}
