//! What a camera told of a panel: maps, curve and figures with their uncertainties, and the profile that keeps them.

use super::fit::Found;
use super::panel_light::{CURVE, PanelLight};
use super::registered::CameraView;
use super::shapes::{Products, place};
use crate::calibration::profile_name;
use crate::error::Result;
use crate::field::npy;
use crate::files;
use crate::panel::{Curve, PanelProfile, PhaseSign, Wavefront};
use crate::units::show_length;
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

/// Regions of the written curve along x and y: the fitted one changes by less than 0.01 rad within one.
const REGIONS: [usize; 2] = [24, 14];

/// Figures of a calibration by camera. Each uncertainty is one standard deviation, from the curvature of the least squares and
/// what the fit leaves of the photos.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CameraReport {
    /// Dots of the card that were found.
    pub dots: usize,
    /// RMS distance of the dots from the mapping fitted to them alone [camera pixels].
    pub dots_rms: f64,
    /// Uncertainty of the mapping after the fit, RMS over its window [camera pixels].
    pub mapping_uncertainty: f64,
    /// Misses of the fit against the noise that is expected of a camera (1 % of the brightest pixel): about 1 or less.
    pub misfit: f64,
    /// Share of the photos' variance that the fit explains.
    pub explained: f64,
    /// Steps of the last descent.
    pub steps: usize,
    /// The wavefront error without piston and tilt, RMS over the panel [waves].
    pub wavefront_rms: f64,
    /// From its lowest phase to its highest [waves].
    pub wavefront_span: f64,
    /// Its uncertainty, RMS over the panel [waves].
    pub wavefront_uncertainty: f64,
    /// Phase from the lowest level to the highest, mean over the panel [rad].
    pub range: f64,
    /// The smallest and the largest of it over the panel [rad].
    pub range_over_panel: [f64; 2],
    /// Uncertainty of the curve, RMS over levels and panel [rad].
    pub curve_uncertainty: f64,
    /// Least amplitude of the laser's beam on the panel, against the greatest.
    pub beam_least: f64,
    /// Where it is brightest, from the panel's middle, in halves of its width and height: right, up.
    pub beam_middle: [f64; 2],
    /// Relative uncertainty of its amplitude, RMS over the panel.
    pub beam_uncertainty: f64,
    /// Standard deviation of the Gaussian that blends neighbouring pixels' phases [pixels].
    pub crosstalk: f64,
    /// Its uncertainty [pixels].
    pub crosstalk_uncertainty: f64,
    /// Share of the light along the axis that the panel leaves unmodulated, dead space included.
    pub unmodulated: f64,
    /// Its uncertainty.
    pub unmodulated_uncertainty: f64,
}

/// What was found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct CameraFit {
    /// The panel's wavefront error [rad].
    pub wavefront: Wavefront,
    /// Amplitude of the laser's beam on each pixel, 1 at the brightest.
    pub beam: Vec<f32>,
    /// Level → phase by region, counted from the unmodulated light's phase.
    pub curve: Curve,
    /// Where the camera stands.
    pub camera: CameraView,
    /// Amplitude of the unmodulated light against the modulated.
    pub unmodulated: f64,
    /// Figures.
    pub report: CameraReport,
    wavelength: f64,
}

/// Coefficients of 1, l, l² … of P_m(2l − 1) − P_m(−1).
fn monomials(m: usize) -> [f64; CURVE + 1] {
    let choose = |n: usize, k: usize| (0..k).fold(1.0, |v, i| v * (n - i) as f64 / (i + 1) as f64);
    std::array::from_fn(|k| match k {
        0 => 0.0,
        k if k > m => 0.0,
        k => choose(m, k) * choose(m + k, k) * if (m + k).is_multiple_of(2) { 1.0 } else { -1.0 },
    })
}

impl CameraFit {
    pub(super) fn new(found: &Found, profile: &PanelProfile, wavelength: f64) -> Result<Self> {
        let Found { model, fitted, .. } = found;
        let (l, light, values) = (&model.layout, &model.light, &fitted.values);
        let wave = over(light, &light.wave, &values[l.wave.clone()]);
        let wavefront = Wavefront::new("wavefront error by camera", light.width, light.height, Some(wavelength), wave)?;
        let logarithm = over(light, &light.source, &values[l.source.clone()]);
        let top = logarithm.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let beam: Vec<f32> = logarithm.iter().map(|v| (v - top).exp()).collect();
        let share = model.share(values);
        let curve = curve(light, &values[l.curve.clone()], -share.arg(), profile.phase_sign);
        curve.check(profile.levels(), Path::new("the measured curve"))?;
        let report = report(found, &wavefront, &beam);
        Ok(Self {
            wavefront,
            beam,
            curve,
            camera: CameraView { mapping: model.mapping(values), half_window: model.zoom.half() },
            unmodulated: share.norm(),
            report,
            wavelength,
        })
    }

    /// The profile with what was found; `beam` and `correction` are the files of the maps.
    ///
    /// What the profile's dead space does not account for of the unmodulated light becomes its key `unmodulated`; where the
    /// dead space alone would send back more, it is darkened.
    pub fn profile(&self, profile: &PanelProfile, beam: &Path, correction: &Path) -> PanelProfile {
        let mut out = profile.with_measured_curve(self.wavelength, self.curve.clone());
        out = out.with_correction(self.wavelength, correction);
        out.crosstalk = self.report.crosstalk;
        let dead = (1.0 - profile.fill_factor) * profile.dead_space / profile.fill_factor;
        if self.unmodulated >= dead {
            // κ = ((1 − F)d·√(1 − q) + √q) / (F·√(1 − q)).
            let ratio = (self.unmodulated - dead) * profile.fill_factor;
            out.unmodulated = ratio * ratio / (1.0 + ratio * ratio);
        } else {
            out.unmodulated = 0.0;
            out.dead_space *= self.unmodulated / dead;
        }
        out.beam = Some(beam.to_path_buf());
        out.unverified.retain(|key| !["crosstalk", "dead_space", "unmodulated", "beam"].contains(&key.as_str()));
        out
    }

    /// Writes the profile (`mine.toml`) with the maps (`mine-correction.npy`, `mine-beam.npy`) and the camera's place
    /// (`mine-camera.json`) beside it: all or none.
    ///
    /// # Errors
    /// [`crate::Error::Parameter`] for a profile whose name does not end in `.toml`; [`crate::Error::Io`].
    pub fn write(&self, profile: &PanelProfile, output: &Path) -> Result<()> {
        profile_name(output)?;
        let stem = output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let [correction, beam] = ["correction", "beam"].map(|what| PathBuf::from(format!("{stem}-{what}.npy")));
        let made = self.profile(profile, &beam, &correction);
        let remark = format!("{}, calibrated by camera at {}", profile.name, show_length(self.wavelength));
        let text = made.to_toml(&[remark])?;
        let [correction, beam] = [correction, beam].map(|name| output.with_file_name(name));
        let camera = output.with_file_name(format!("{stem}-camera.json"));
        let all = || -> Result<()> {
            self.wavefront.clone().conjugate().write(&correction)?;
            npy::write_intensity(&beam, self.wavefront.width, self.wavefront.height, &self.beam)?;
            self.camera.write(&camera)?;
            files::write_bytes(output, text.as_bytes())
        };
        all().inspect_err(|_| {
            for path in [correction.clone(), npy::metadata_path(&correction), beam.clone(), camera.clone()] {
                // What was written before the refusal goes again.
                let _ = std::fs::remove_file(path);
            }
        })
    }
}

/// Σ c·P on each pixel.
fn over(light: &PanelLight, products: &Products, coefficients: &[f64]) -> Vec<f32> {
    (0..light.width * light.height)
        .into_par_iter()
        .with_min_len(1 << 12)
        .map(|i| {
            let (x, y) = (i % light.width, i / light.width);
            products.sum(coefficients, place(x as f64, light.width), place(y as f64, light.height)) as f32
        })
        .collect()
}

fn curve(light: &PanelLight, numbers: &[f64], offset: f64, sign: PhaseSign) -> Curve {
    let sign = if sign == PhaseSign::Decreasing { -1.0 } else { 1.0 };
    let terms = light.over.len();
    let [columns, rows] = REGIONS;
    let region = |k: usize| {
        let at = [(k % columns, columns), (k / columns, rows)].map(|(i, n)| place(i as f64, n));
        let mut coefficients = vec![0.0; CURVE + 1];
        for m in 0..CURVE {
            let share = light.over.sum(&numbers[m * terms..][..terms], at[0], at[1]);
            coefficients.iter_mut().zip(monomials(m + 1)).for_each(|(c, p)| *c += sign * share * p);
        }
        coefficients[0] += sign * offset;
        Curve::Polynomial { coefficients }
    };
    Curve::Regional { columns, rows, curves: (0..columns * rows).map(region).collect() }
}

fn report(found: &Found, wavefront: &Wavefront, beam: &[f32]) -> CameraReport {
    let Found { model, fitted, explained, dots, dots_rms, scale } = found;
    let (l, light) = (&model.layout, &model.light);
    let n = fitted.free.len();
    let covariance = |i: usize, j: usize| fitted.covariance.get(i * n + j).copied().unwrap_or(f64::NAN);
    let deviation = |i: usize| covariance(i, i).max(0.0).sqrt();
    // Mean square of a product over the panel.
    let square = |[a, b]: [usize; 2]| 1.0 / ((2 * a + 1) * (2 * b + 1)) as f64;
    let spread = |start: usize, products: &Products| -> f64 {
        let variance =
            products.terms.iter().enumerate().map(|(t, term)| covariance(start + t, start + t) * square(*term));
        variance.sum::<f64>().max(0.0).sqrt()
    };
    let (count, terms) = (light.shapes.len() as f64, light.over.len());
    let mut curve_variance = 0.0;
    for a in 0..CURVE {
        for b in 0..CURVE {
            let mean = light.shapes.iter().map(|s| f64::from(s[a] * s[b])).sum::<f64>() / count;
            for (t, term) in light.over.terms.iter().enumerate() {
                let at = |m: usize| l.curve.start + m * terms + t;
                curve_variance += mean * covariance(at(a), at(b)) * square(*term);
            }
        }
    }
    let numbers = &fitted.values[l.curve.clone()];
    let range = |x: f64, y: f64| {
        let last = &light.shapes[light.shapes.len() - 1];
        let share = |m: usize| light.over.sum(&numbers[m * terms..][..terms], x, y) * f64::from(last[m]);
        (0..CURVE).map(share).sum::<f64>()
    };
    let ranges: Vec<f64> = (0..81).map(|k| range(f64::from(k % 9) / 4.0 - 1.0, f64::from(k / 9) / 4.0 - 1.0)).collect();
    let mapping = model.mapping(&fitted.values);
    let moved: f64 = model
        .pixels
        .iter()
        .step_by(97)
        .map(|pixel| {
            let (_, slopes) = mapping.with_slopes([f64::from(pixel[0]), f64::from(pixel[1])]);
            let of = |s: &[f64]| -> f64 {
                let pairs = (0..s.len()).flat_map(|i| (0..s.len()).map(move |j| (i, j)));
                pairs.map(|(i, j)| s[i] * s[j] * covariance(l.mapping.start + i, l.mapping.start + j)).sum()
            };
            of(&slopes[0]) + of(&slopes[1])
        })
        .sum::<f64>()
        / model.pixels.iter().step_by(97).count() as f64;
    let brightest = beam.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |(i, _)| i);
    let share = model.share(&fitted.values);
    let (power, amplitude) = (share.norm_sqr(), share.norm());
    let [re, im] = [deviation(l.unmodulated.start), deviation(l.unmodulated.start + 1)];
    let phases = wavefront.phase.iter().map(|p| f64::from(*p));
    let total = wavefront.phase.len() as f64;
    let mean = phases.clone().sum::<f64>() / total;
    let ends = phases.clone().fold([f64::INFINITY, f64::NEG_INFINITY], |e, p| [e[0].min(p), e[1].max(p)]);
    CameraReport {
        dots: *dots,
        dots_rms: *dots_rms,
        mapping_uncertainty: moved.max(0.0).sqrt() / scale,
        misfit: fitted.misfit,
        explained: *explained,
        steps: fitted.steps,
        wavefront_rms: (phases.map(|p| (p - mean).powi(2)).sum::<f64>() / total).sqrt() / TAU,
        wavefront_span: (ends[1] - ends[0]) / TAU,
        wavefront_uncertainty: spread(l.wave.start, &light.wave) / TAU,
        range: ranges.iter().sum::<f64>() / ranges.len() as f64,
        range_over_panel: ranges.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |e, r| [e[0].min(*r), e[1].max(*r)]),
        curve_uncertainty: curve_variance.max(0.0).sqrt(),
        beam_least: beam.iter().copied().fold(f32::INFINITY, f32::min).into(),
        beam_middle: [
            place((brightest % light.width) as f64, light.width),
            -place((brightest / light.width) as f64, light.height),
        ],
        beam_uncertainty: spread(l.source.start, &light.source),
        crosstalk: fitted.values[l.crosstalk],
        crosstalk_uncertainty: deviation(l.crosstalk),
        unmodulated: power / (1.0 + power),
        unmodulated_uncertainty: 2.0 * amplitude / (1.0 + power).powi(2) * re.hypot(im) / 2f64.sqrt(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::camera::shapes::level_shapes;

    #[test]
    fn monomials_are_the_level_shapes() {
        let shapes = level_shapes(CURVE, 101);
        for (level, shape) in shapes.iter().enumerate() {
            for (m, value) in shape.iter().enumerate() {
                let x = level as f64 / 100.0;
                let sum = monomials(m + 1).iter().rev().fold(0.0, |s, c| s * x + c);
                assert!((sum - value).abs() < 1e-12, "{m} {x}: {sum} {value}");
            }
        }
    }
}
