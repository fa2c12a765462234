//! How far a calibration is from the bench.

use crate::bench::HiddenBench;
use holodrive::calibration::CameraFit;
use holodrive::panel::PanelProfile;
use std::f64::consts::TAU;

/// Errors, RMS.
#[derive(Debug)]
pub(crate) struct Errors {
    /// [waves], without piston and tilt.
    pub(crate) wavefront: f64,
    /// What the fitted wavefront has of tilt against the bench's [rad at the borders]: a camera cannot tell it from its place.
    pub(crate) tilt: [f64; 2],
    /// Phase of a level against level 0 [rad], over panel and levels.
    pub(crate) curve: f64,
    /// Of the beam's amplitude, against its greatest.
    pub(crate) beam: f64,
    /// [camera pixels], over the window.
    pub(crate) mapping: f64,
    /// [pixels]
    pub(crate) crosstalk: f64,
    /// Of the unmodulated share of the light.
    pub(crate) unmodulated: f64,
    /// Of the unmodulated light's phase against level 0 in the panel's middle [rad].
    pub(crate) unmodulated_phase: f64,
}

pub(crate) fn errors(bench: &HiddenBench, profile: &PanelProfile, fit: &CameraFit) -> Errors {
    let (width, height) = (bench.width, bench.height);
    let pixels: Vec<(usize, usize)> =
        (0..48 * 48).map(|k| ((2 * (k % 48) + 1) * width / 96, (2 * (k / 48) + 1) * height / 96)).collect();
    let places: Vec<[f64; 2]> = pixels.iter().map(|p| bench.place(p.0 as f64, p.1 as f64)).collect();
    let count = pixels.len() as f64;
    let off: Vec<f64> = pixels
        .iter()
        .zip(&places)
        .map(|((c, r), at)| f64::from(fit.wavefront.phase[r * width + c]) - bench.wavefront(*at))
        .collect();
    let mean = off.iter().sum::<f64>() / count;
    let tilt = [0, 1].map(|a| {
        let (x, square) = (places.iter().map(|p| p[a]), places.iter().map(|p| p[a] * p[a]).sum::<f64>());
        off.iter().zip(x).map(|(d, x)| (d - mean) * x).sum::<f64>() / square
    });
    let rest = off.iter().zip(&places).map(|(d, p)| (d - mean - tilt[0] * p[0] - tilt[1] * p[1]).powi(2));
    let wavefront = (rest.sum::<f64>() / count).sqrt() / TAU;
    let beams: Vec<[f64; 2]> =
        pixels.iter().zip(&places).map(|((c, r), at)| [f64::from(fit.beam[r * width + c]), bench.beam(*at)]).collect();
    let factor = beams.iter().map(|[a, b]| a * b).sum::<f64>() / beams.iter().map(|[a, _]| a * a).sum::<f64>();
    let top = beams.iter().map(|b| b[1]).fold(0.0, f64::max);
    let beam = (beams.iter().map(|[a, b]| (factor * a - b).powi(2)).sum::<f64>() / count).sqrt() / top;
    let found = profile.with_measured_curve(bench.wavelength, fit.curve.clone());
    let curve = found.pixel_curve(bench.wavelength).expect("curve").0;
    let (mut squares, mut number) = (0.0, 0.0);
    for ((c, r), at) in pixels.iter().zip(&places).step_by(5) {
        for level in (0..256u16).step_by(5) {
            let seen = curve.value(*c, *r, level) - curve.value(*c, *r, 0);
            squares += (seen - (bench.curve(level, *at) - bench.curve(0, *at))).powi(2);
            number += 1.0;
        }
    }
    let scale = bench.pitch * bench.camera_pitch / (bench.wavelength * bench.lens);
    let half = 0.25 / ((width as f64 / 480.0).round().max(2.0));
    let mut misses = Vec::new();
    for k in 0..900 {
        let at = [(k % 30) as f64 / 29.0 * bench.camera[0] as f64, (k / 30) as f64 / 29.0 * bench.camera[1] as f64];
        let truth = bench.frequency(at[0], at[1]);
        if truth.iter().all(|f| f.abs() < half) {
            let seen = fit.camera.mapping.frequency(at);
            // A tilt that the wavefront has not is a shift of the mapping.
            let shift = [tilt[0] / TAU * 2.0 / width as f64, tilt[1] / TAU * 2.0 / height as f64];
            misses.push((seen[0] - shift[0] - truth[0]).hypot(seen[1] - shift[1] - truth[1]) / scale);
        }
    }
    let middle = curve.value(width / 2, height / 2, 0);
    Errors {
        wavefront,
        tilt,
        curve: (squares / number).sqrt(),
        beam,
        mapping: (misses.iter().map(|m| m * m).sum::<f64>() / misses.len() as f64).sqrt(),
        crosstalk: fit.report.crosstalk - crate::bench::CROSSTALK,
        unmodulated: fit.report.unmodulated - crate::bench::UNMODULATED,
        unmodulated_phase: middle + crate::bench::UNMODULATED_PHASE,
    }
}
