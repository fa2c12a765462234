//! The simulated panel: drive levels → the field just behind it (or just before it, unfolded, for a reflective one).
//!
//! A pixel's active area, √F of the pitch wide for a fill factor F, carries the level's modulation; the rest carries the
//! dead space's. With one sample a pixel the two mix coherently, F·a + (1 − F)·d, as the light on the axis does. With n
//! samples a pixel along each axis the field of these rectangles is sampled *band-limited* at pitch/n: its spectrum is
//! that of the true geometry for every frequency below n/(2·pitch), so the orders at multiples of 1/pitch stand at their
//! sinc weights; nothing is folded back from above. (Samples of the bare rectangles would fold: at n = 4 and F = 0.93
//! the first order comes out 30 % too weak.)

use super::crosstalk::{blurred, mixed};
use super::drive_curve::Modulation;
use super::frame::{Frame, Illumination};
use super::regional::PixelCurve;
use super::response::Response;
use super::wavefront::Wavefront;
use crate::error::{Error, Result};
use crate::field::grid;
use crate::field::{Complex32, Complex64, Fft2, Field, Grid};
use crate::progress::Progress;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// How the panel is lit and looked at, and which of its faults are real.
#[derive(Clone, Debug)]
pub struct Simulation {
    /// Samples a pixel along each axis, 1 … 16.
    pub subsamples: usize,
    /// The wave that falls on the panel; absent: the one that the frame's encoding names.
    pub illumination: Option<Illumination>,
    /// Faults beyond the profile.
    pub faults: Faults,
}

/// What a real panel does besides what its profile says. The default is none of it.
#[derive(Clone, Debug)]
pub struct Faults {
    /// The panel's true level → modulation, where it is not the profile's.
    pub response: Option<Response>,
    /// The panel's wavefront error: the phase that it adds [rad].
    pub wavefront_error: Option<Wavefront>,
    /// Standard deviation of the Gaussian by which neighbouring pixels' phases (or amplitudes) blend [pixels], beside the
    /// profile's own.
    ///
    /// Fringing fields blur the phase itself, so a wrap from 2π to 0 becomes a steep slope through all phases between.
    pub crosstalk: f64,
    /// Factor on every phase at the instant of looking: 1 + ε for flicker.
    pub phase_scale: f64,
    /// Loss of amplitude that goes with phase: a(φ) = 1 − c·(1 − cos φ)/2.
    pub amplitude_coupling: f64,
    /// Amplitude of the dead space against the active area's; absent: the profile's.
    pub dead_space: Option<f64>,
    /// What is left of the frame before, where the light comes before the panel has settled.
    pub residue: Option<Residue>,
}

/// A frame that has not quite gone.
#[derive(Clone, Debug)]
pub struct Residue {
    /// Its levels.
    pub levels: Vec<u16>,
    /// Share of the way from the new phase (or amplitude) back to the old one, 0 … 1: exp(−t/τ) of a panel that relaxes
    /// with time constant τ, lit at t.
    pub share: f64,
}

impl Default for Simulation {
    fn default() -> Self {
        Self { subsamples: 1, illumination: None, faults: Faults::default() }
    }
}

impl Default for Faults {
    fn default() -> Self {
        Self {
            response: None,
            wavefront_error: None,
            crosstalk: 0.0,
            phase_scale: 1.0,
            amplitude_coupling: 0.0,
            dead_space: None,
            residue: None,
        }
    }
}

/// The field just behind a panel that shows a frame, lit with unit amplitude, on `subsamples` times the panel's grid.
///
/// The panel is the frame's own (`frame.metadata.panel`) at the frame's wavelength. Samples at the panel's border see it
/// continued periodically by the band-limited kernel (within a few samples). Memory: 16 bytes a sample.
///
/// # Errors
/// [`Error::Parameter`] for settings out of their domain, [`Error::Undersampled`] when the illumination is steeper than
/// the samples carry, [`Error::Calibration`] when curve or wavefront error do not fit.
pub fn simulate(frame: &Frame, settings: &Simulation, progress: &Progress) -> Result<Field> {
    let profile = &frame.metadata.panel;
    let wavelength = frame.metadata.wavelength;
    profile.checked()?;
    grid::light(wavelength)?;
    let grid = profile.grid()?;
    check(frame, grid, settings)?;
    let faults = &settings.faults;
    let curve = match &faults.response {
        Some(response) => {
            response.curve.check(profile.levels(), &profile.source)?;
            let size = (profile.width, profile.height);
            response.curve.resolve_pixels(profile.levels(), size, wavelength, response.wavelength, profile.phase_sign)
        }
        None => profile.pixel_curve(wavelength)?.0,
    };
    let n = settings.subsamples;
    let dead = Complex32::new(faults.dead_space.unwrap_or(profile.dead_space) as f32, 0.0);
    let crosstalk = faults.crosstalk.hypot(profile.crosstalk);
    let cells = if crosstalk > 0.0 { n } else { 1 };
    progress.start("simulated panel", (cells * cells + 1) as u64);
    // With one sample a pixel its parts, each with the phase that it has there, are mixed as the rest is.
    let values = cell_values(frame, &curve, cells, faults, if n > 1 { crosstalk } else { 0.0 })?;
    let modulate = |value: f32| modulated(value, curve.modulation(), faults);
    let mut samples = if n == 1 {
        let fill = profile.fill_factor as f32;
        let mut mixed: Vec<Complex32> = if crosstalk > 0.0 {
            mixed(&values, frame.width, crosstalk, modulate)
        } else {
            values.par_iter().map(|&v| modulate(v)).collect()
        };
        mixed.par_iter_mut().for_each(|u| *u = *u * fill + dead * (1.0 - fill));
        mixed
    } else {
        let pixel = PixelGeometry { cells, subsamples: n, side: profile.fill_factor.sqrt(), dead };
        band_limited(&values, grid, &pixel, modulate, progress)?
    };
    progress.check()?;
    let (pitch_x, pitch_y) = (grid.pitch_x / n as f64, grid.pitch_y / n as f64);
    let grid = Grid::new(grid.width * n, grid.height * n, pitch_x, pitch_y)?;
    if profile.unmodulated > 0.0 {
        let [kept, lost] = [1.0 - profile.unmodulated, profile.unmodulated].map(|share| share.sqrt() as f32);
        samples.par_iter_mut().for_each(|u| *u = *u * kept + lost);
    }
    if let Some(beam) = profile.beam_amplitude()? {
        samples.par_chunks_mut(grid.width).enumerate().for_each(|(row, samples)| {
            let beam = &beam[row / n * profile.width..][..profile.width];
            samples.iter_mut().enumerate().for_each(|(column, u)| *u *= beam[column / n]);
        });
    }
    let illumination =
        settings.illumination.or(frame.metadata.encoding.as_ref().map(|e| e.illumination)).unwrap_or_default();
    if let Some(error) = &faults.wavefront_error {
        error.check(profile.width, profile.height, wavelength)?;
        light(&mut samples, grid, |column, row| Complex64::cis(phase_between(error, n, column, row)));
    }
    illuminate(&mut samples, grid, wavelength, illumination)?;
    progress.advance(1);
    Field::new(grid, wavelength, samples)
}

/// The fields behind a panel that shows frames one after another and over again, such as a colour for each laser, each
/// with what `share` leaves of the frame before (see [`Residue::share`]).
///
/// # Errors
/// As [`simulate`]; [`Error::Parameter`] when the frames are not of one size.
pub fn simulate_sequence(
    frames: &[&Frame],
    settings: &Simulation,
    share: f64,
    progress: &Progress,
) -> Result<Vec<Field>> {
    let before = |k: usize| frames[(k + frames.len() - 1) % frames.len()];
    let one = |k: usize| {
        let residue = Some(Residue { levels: before(k).levels.clone(), share });
        let faults = Faults { residue, ..settings.faults.clone() };
        simulate(frames[k], &Simulation { faults, ..settings.clone() }, progress)
    };
    (0..frames.len()).map(one).collect()
}

fn check(frame: &Frame, grid: Grid, settings: &Simulation) -> Result<()> {
    let faults = &settings.faults;
    if (frame.width, frame.height) != (grid.width, grid.height) {
        let what = format!("{}×{} levels; its panel has {}×{}", frame.width, frame.height, grid.width, grid.height);
        return Err(Error::parameter("frame", what));
    }
    frame.check_levels()?;
    if !(1..=16).contains(&settings.subsamples) {
        return Err(Error::out_of_range("subsamples", settings.subsamples, "must be 1 … 16"));
    }
    // Beyond a few pixels nothing of a pattern is left, and the kernel would outgrow the panel.
    if !(0.0..=8.0).contains(&faults.crosstalk) {
        return Err(Error::out_of_range("crosstalk", faults.crosstalk, "must be 0 … 8 pixels"));
    }
    if !(0.0..=1.0).contains(&faults.amplitude_coupling) || !(0.0..=1.0).contains(&faults.dead_space.unwrap_or(0.0)) {
        return Err(Error::parameter("amplitude_coupling, dead_space", "must be 0 … 1"));
    }
    if let Some(residue) = &faults.residue
        && (residue.levels.len() != grid.len() || !(0.0..=1.0).contains(&residue.share))
    {
        let what = format!("{} levels and a share of {}", residue.levels.len(), residue.share);
        return Err(Error::parameter("residue", what));
    }
    if !faults.phase_scale.is_finite() {
        return Err(Error::parameter("phase_scale", "must be finite"));
    }
    Ok(())
}

/// Unwrapped phase [rad] or amplitude of each cell: `cells × cells` cells a pixel, blended by the crosstalk.
fn cell_values(frame: &Frame, curve: &PixelCurve, cells: usize, faults: &Faults, crosstalk: f64) -> Result<Vec<f32>> {
    let count = curve.mean.levels();
    if let Some(i) = frame.levels.iter().position(|&l| usize::from(l) >= count) {
        let what = format!("level {} at pixel {i}; the panel has {count}", frame.levels[i]);
        return Err(Error::parameter("frame", what));
    }
    let mut pixels = curve.values(&frame.levels, frame.width)?;
    if let Some(residue) = &faults.residue {
        let before = curve.values(&residue.levels, frame.width)?;
        let share = residue.share as f32;
        pixels.par_iter_mut().zip(&before).for_each(|(now, before)| *now += share * (before - *now));
    }
    let (width, height) = (frame.width * cells, frame.height * cells);
    let mut values = vec![0.0; width * height];
    values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
        let pixels = &pixels[row / cells * frame.width..][..frame.width];
        for (column, value) in values.iter_mut().enumerate() {
            *value = pixels[column / cells];
        }
    });
    Ok(if crosstalk > 0.0 { blurred(&values, width, crosstalk * cells as f64) } else { values })
}

/// What a cell of that phase [rad] or amplitude does to unit light.
fn modulated(value: f32, modulation: Modulation, faults: &Faults) -> Complex32 {
    match modulation {
        Modulation::Amplitude => Complex32::new(value, 0.0),
        Modulation::Phase => {
            let phase = f64::from(value) * faults.phase_scale;
            let amplitude = 1.0 - faults.amplitude_coupling * 0.5 * (1.0 - phase.cos());
            let (sin, cos) = phase.sin_cos();
            Complex32::new((amplitude * cos) as f32, (amplitude * sin) as f32)
        }
    }
}

/// How a pixel is cut up.
struct PixelGeometry {
    /// Values along each side of the active area.
    cells: usize,
    /// Samples along each side of the pixel.
    subsamples: usize,
    /// Side of the active area [pitches].
    side: f64,
    /// Modulation of the dead space.
    dead: Complex32,
}

/// Rectangles of `cells × cells` values a pixel over the active area, sampled band-limited.
fn band_limited(
    values: &[f32],
    grid: Grid,
    pixel: &PixelGeometry,
    modulate: impl Fn(f32) -> Complex32 + Sync,
    progress: &Progress,
) -> Result<Vec<Complex32>> {
    let PixelGeometry { cells, subsamples: n, side, dead } = *pixel;
    let (width, height) = (grid.width, grid.height);
    let plan = Fft2::<f32>::new(width, height);
    let fine = Fft2::<f32>::new(width * n, height * n);
    let mut spectrum = vec![Complex32::new(0.0, 0.0); width * n * height * n];
    // Dead space covers the panel; each active cell adds its difference from it.
    for cell in 0..cells * cells {
        progress.check()?;
        let (cell_x, cell_y) = (cell % cells, cell / cells);
        let mut pixels: Vec<Complex32> = (0..width * height)
            .into_par_iter()
            .map(|i| {
                let (column, row) = (i % width * cells + cell_x, i / width * cells + cell_y);
                modulate(values[row * width * cells + column]) - dead
            })
            .collect();
        plan.forward(&mut pixels, progress);
        progress.check()?;
        let weight_x = rectangle_spectrum(width, n, side, cells, cell_x);
        let weight_y = rectangle_spectrum(height, n, side, cells, cell_y);
        spectrum.par_chunks_mut(width * n).enumerate().for_each(|(ky, row)| {
            let source = &pixels[ky % height * width..][..width];
            for (kx, out) in row.iter_mut().enumerate() {
                *out += source[kx % width] * (weight_x[kx] * weight_y[ky]);
            }
        });
        progress.advance(1);
    }
    fine.inverse(&mut spectrum, progress);
    progress.check()?;
    spectrum.par_iter_mut().for_each(|u| *u += dead);
    Ok(spectrum)
}

/// Spectrum along one axis of cell `cell` of `cells` in the active side (in pitches), for the `size·n` frequencies of
/// the fine grid, whose first sample lies (1 − 1/n)/2 pitches before the first pixel's middle.
fn rectangle_spectrum(size: usize, n: usize, side: f64, cells: usize, cell: usize) -> Vec<Complex32> {
    let width = side / cells as f64;
    let center = (cell as f64 - 0.5 * (cells as f64 - 1.0)) * width + 0.5 * (1.0 - 1.0 / n as f64);
    // Frequencies in cycles per pitch; both axes count along the row or column index.
    let lattice = Grid { width: size * n, height: 1, pitch_x: 1.0 / n as f64, pitch_y: 1.0, center: [0.0; 2] };
    (0..size * n)
        .map(|k| {
            let f = lattice.frequency_x(k);
            let weight = n as f64 * width * sinc(f * width);
            let turn = Complex64::cis(-TAU * f * center) * weight;
            Complex32::new(turn.re as f32, turn.im as f32)
        })
        .collect()
}

/// sin(πx)/(πx).
pub(crate) fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

/// A wavefront's phase between the pixels' middles, bilinear, at a sample of the fine grid.
fn phase_between(wavefront: &Wavefront, n: usize, column: usize, row: usize) -> f64 {
    let split = |at: usize, size: usize| {
        let x = ((at as f64 + 0.5) / n as f64 - 0.5).clamp(0.0, size as f64 - 1.0);
        let low = (x.floor() as usize).min(size.saturating_sub(2));
        (low, (low + 1).min(size - 1), x - low as f64)
    };
    let (left, right, u) = split(column, wavefront.width);
    let (top, bottom, v) = split(row, wavefront.height);
    let at = |column: usize, row: usize| f64::from(wavefront.phase[row * wavefront.width + column]);
    let upper = at(left, top) * (1.0 - u) + at(right, top) * u;
    let lower = at(left, bottom) * (1.0 - u) + at(right, bottom) * u;
    upper * (1.0 - v) + lower * v
}

/// Multiplies every sample by `wave(column, row)`.
fn light(samples: &mut [Complex32], grid: Grid, wave: impl Fn(usize, usize) -> Complex64 + Sync) {
    samples.par_chunks_mut(grid.width).enumerate().for_each(|(row, samples)| {
        for (column, u) in samples.iter_mut().enumerate() {
            let factor = wave(column, row);
            *u *= Complex32::new(factor.re as f32, factor.im as f32);
        }
    });
}

/// Multiplies samples on a plane z = 0 by an illumination of unit amplitude.
///
/// # Errors
/// [`Error::Undersampled`] when its local frequency passes the grid's limit, [`Error::Parameter`] when its source lies
/// in the panel's plane or its frequency passes 1/λ.
pub fn illuminate(samples: &mut [Complex32], grid: Grid, wavelength: f64, illumination: Illumination) -> Result<()> {
    let limits = |frequency: [f64; 2]| -> Result<()> {
        let axes = [(frequency[0], grid.limit_x(), grid.pitch_x), (frequency[1], grid.limit_y(), grid.pitch_y)];
        for (f, limit, pitch) in axes {
            if f.abs() > limit * (1.0 + 1e-9) {
                let largest = (wavelength * limit).min(1.0).asin().to_degrees();
                let hint = format!("at most {largest:.2}deg along that axis here, or more subsamples a pixel");
                return Err(Error::Undersampled { what: "illumination", frequency: f.abs(), limit, pitch, hint });
            }
        }
        Ok(())
    };
    match illumination {
        Illumination::Normal => {}
        Illumination::Plane { frequency: [fx, fy] } => {
            if fx.hypot(fy) * wavelength >= 1.0 || !fx.is_finite() || !fy.is_finite() {
                let what = format!("({fx}, {fy}) cycles/m is no propagating wave of {wavelength} m");
                return Err(Error::parameter("illumination", what));
            }
            limits([fx, fy])?;
            light(samples, grid, |column, row| Complex64::cis(TAU * (fx * grid.x(column) + fy * grid.y(row)).fract()));
        }
        Illumination::Point { position: [px, py, pz] } => {
            if pz == 0.0 || ![px, py, pz].iter().all(|p| p.is_finite()) {
                return Err(Error::parameter("illumination", "its point must lie before or behind the panel's plane"));
            }
            let corner = |px: f64, center: f64, extent: f64| (px - center).abs() + 0.5 * extent;
            let (dx, dy) = (corner(px, grid.center[0], grid.extent_x()), corner(py, grid.center[1], grid.extent_y()));
            // Steepest at the far border of the same axis, with the other axis at its nearest: a safe bound.
            limits([dx / dx.hypot(pz) / wavelength, dy / dy.hypot(pz) / wavelength])?;
            let sign = if pz < 0.0 { 1.0 } else { -1.0 };
            let middle = (grid.center[0] - px).hypot(grid.center[1] - py).hypot(pz);
            light(samples, grid, |column, row| {
                let r = (grid.x(column) - px).hypot(grid.y(row) - py).hypot(pz);
                // The middle's phase is zero, so that a distant point and a plane wave agree.
                Complex64::cis(sign * TAU * ((r - middle) / wavelength).fract()) * (middle / r)
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
