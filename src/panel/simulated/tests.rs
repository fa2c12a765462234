//! Analytic efficiencies, a term-by-term oracle of the pixels' geometry, and each fault by itself.

use super::*;
use crate::field::relative_error;
use crate::panel::{Curve, Pattern};
use crate::panel::{Packing, PanelKind, PanelProfile, PhasePattern, PhaseSign, SignalLayout, correct, drive};
use std::path::PathBuf;

const WAVELENGTH: f64 = 532e-9;

fn panel(width: usize, height: usize, fill_factor: f64, dead_space: f64, curve: Curve) -> PanelProfile {
    PanelProfile {
        source: PathBuf::from("test"),
        name: "test".into(),
        maker: "test".into(),
        kind: PanelKind::PhaseLcos,
        width,
        height,
        pitch_x: 8e-6,
        pitch_y: 6e-6,
        bits: 8,
        fill_factor,
        dead_space,
        wavelengths: vec![WAVELENGTH],
        responses: vec![Response { wavelength: None, curve }],
        phase_sign: PhaseSign::Increasing,
        signal: SignalLayout::plain(width, height, Packing::Gray),
        settle_time: None,
        refresh: None,
        edid: None,
        corrections: Vec::new(),
        command: None,
        note: None,
        crosstalk: 0.0,
        unmodulated: 0.0,
        beam: None,
        unverified: Vec::new(),
    }
}

fn turn() -> Curve {
    Curve::Linear { levels_for_2pi: 256.0 }
}

fn levels(profile: &PanelProfile, level: impl Fn(usize, usize) -> u16) -> Frame {
    let count = profile.width * profile.height;
    let levels = (0..count).map(|i| level(i % profile.width, i / profile.width)).collect();
    Frame::new(profile, WAVELENGTH, levels).expect("frame")
}

fn simulated(frame: &Frame, subsamples: usize, faults: Faults) -> Field {
    simulate(frame, &Simulation { subsamples, illumination: None, faults }, &Progress::new()).expect("simulate")
}

/// Share of the incident light in the plane wave of `column` cycles per panel width and `row` per height.
fn efficiency(field: &Field, column: i64, row: i64) -> f64 {
    let (width, height) = (field.grid.width, field.grid.height);
    let mut spectrum = field.samples.clone();
    Fft2::new(width, height).forward(&mut spectrum, &Progress::new());
    let at = |k: i64, n: usize| k.rem_euclid(n as i64) as usize;
    // Row index runs against y.
    let u = spectrum[at(-row, height) * width + at(column, width)];
    f64::from(u.norm_sqr()) / (width * height) as f64 / (width * height) as f64
}

#[test]
fn a_blazed_grating_of_n_levels_sends_sinc2_of_1_over_n_into_its_first_order() {
    for n in [2, 3, 4, 8, 16] {
        let profile = panel(16 * n, 5, 1.0, 0.0, turn());
        let frame = levels(&profile, |column, _| (256 * (column % n) / n) as u16);
        let field = simulated(&frame, 4, Faults::default());
        let (seen, truth) = (efficiency(&field, 16, 0), sinc(1.0 / n as f64).powi(2));
        // Levels are multiples of 1/256 turn: for n = 3 the phases miss by up to 0.7/256 turn, a loss of 1e-4.
        assert!((seen / truth - 1.0).abs() < 3e-4, "{n} levels: {seen} instead of {truth}");
        if n == 2 {
            assert!((seen - 0.405).abs() < 0.001 && (efficiency(&field, -16, 0) - seen).abs() < 1e-4);
        }
    }
}

#[test]
fn a_sawtooth_of_another_range_falls_off_as_sinc2() {
    for range in [0.5, 0.8, 1.0, 1.3] {
        let period = 128;
        let profile = panel(4 * period, 3, 1.0, 0.0, Curve::Linear { levels_for_2pi: 256.0 / range });
        // Phase of the middle of each of 128 steps; 256 levels hold them exactly.
        let frame = levels(&profile, |column, _| (2 * (column % period) + 1) as u16);
        let seen = efficiency(&simulated(&frame, 2, Faults::default()), 4, 0);
        // Steps of 1/128 period cost sinc²(1/128) = 1 − 2e-4.
        let truth = sinc(1.0 - range).powi(2) * sinc(1.0 / 128.0).powi(2);
        assert!((seen / truth - 1.0).abs() < 2e-3, "range {range} turns: {seen} instead of {truth}");
    }
}

#[test]
fn orders_of_the_pixel_lattice_stand_at_their_sinc_weights() {
    for fill in [0.5, 0.87, 0.93] {
        let profile = panel(6, 7, fill, 0.0, turn());
        let frame = levels(&profile, |_, _| 77);
        for n in [3, 4, 5] {
            let field = simulated(&frame, n, Faults::default());
            let side = fill.sqrt();
            for (m, k) in [(0, 0), (1, 0), (0, -1), (1, 1)] {
                let seen = efficiency(&field, 6 * m, 7 * k);
                let truth = (fill * sinc(m as f64 * side) * sinc(k as f64 * side)).powi(2);
                assert!((seen / truth - 1.0).abs() < 1e-3, "F = {fill}, n = {n}, order ({m}, {k}): {seen}, {truth}");
            }
        }
    }
}

#[test]
fn dead_space_adds_its_own_wave_to_the_zero_order() {
    let profile = panel(8, 6, 0.9, 0.8, turn());
    let frame = levels(&profile, |_, _| 128);
    // Active area at π, dead space at 0: −0.9 + 0.1·0.8.
    for n in [1, 2, 4] {
        let seen = efficiency(&simulated(&frame, n, Faults::default()), 0, 0);
        assert!((seen - 0.82f64.powi(2)).abs() < 1e-5, "n = {n}: {seen}");
    }
    let bright = Faults { dead_space: Some(0.0), ..Faults::default() };
    assert!((efficiency(&simulated(&frame, 3, bright), 0, 0) - 0.81).abs() < 1e-5);
}

/// The band-limited field by its definition: the Fourier integral of every rectangle, frequency by frequency.
fn oracle(frame: &Frame, n: usize) -> Vec<Complex64> {
    let profile = &frame.metadata.panel;
    let (curve, _) = profile.drive_curve(WAVELENGTH).expect("curve");
    let (width, height) = (frame.width, frame.height);
    let grid = profile.grid().expect("grid");
    let fine = Grid::new(width * n, height * n, grid.pitch_x / n as f64, grid.pitch_y / n as f64).expect("fine grid");
    let side = profile.fill_factor.sqrt();
    let (a, b) = (side * grid.pitch_x, side * grid.pitch_y);
    let area = grid.extent_x() * grid.extent_y();
    let mut out = vec![Complex64::new(profile.dead_space, 0.0); fine.len()];
    for k in 0..fine.len() {
        let (fx, fy) = (fine.frequency_x(k % fine.width), fine.frequency_y(k / fine.width));
        let mut integral = Complex64::new(0.0, 0.0);
        for (i, &level) in frame.levels.iter().enumerate() {
            let (x, y) = (grid.x(i % width), grid.y(i / width));
            let value = curve.phasor(level) - profile.dead_space;
            integral += value * a * b * sinc(fx * a) * sinc(fy * b) * Complex64::cis(-TAU * (fx * x + fy * y));
        }
        for (i, u) in out.iter_mut().enumerate() {
            let (x, y) = (fine.x(i % fine.width), fine.y(i / fine.width));
            *u += integral / area * Complex64::cis(TAU * (fx * x + fy * y));
        }
    }
    out
}

#[test]
fn fine_samples_equal_the_fourier_integral_of_the_pixels() {
    for (width, height, n) in [(5, 3, 3), (4, 7, 2), (3, 3, 5)] {
        let profile = panel(width, height, 0.8, 0.3, turn());
        let frame = levels(&profile, |column, row| (91 * column + 57 * row + 13 * column * row) as u16 % 256);
        let expected = oracle(&frame, n);
        let plain = simulated(&frame, n, Faults::default());
        assert!(relative_error(&plain.samples, &expected) < 1e-6, "{width}×{height}, n = {n}");
        // A vanishing crosstalk goes through n × n cells a pixel, and must add up to the same rectangles.
        let cells = simulated(&frame, n, Faults { crosstalk: 1e-6, ..Faults::default() });
        assert!(relative_error(&cells.samples, &expected) < 2e-6, "{width}×{height}, n = {n}, cells");
    }
}

#[test]
fn crosstalk_blurs_the_phase_by_an_error_function() {
    let profile = panel(64, 3, 1.0, 0.0, turn());
    let frame = levels(&profile, |column, _| if column < 32 { 0 } else { 200 });
    let faults = Faults { crosstalk: 1.5, ..Faults::default() };
    let curve = profile.pixel_curve(WAVELENGTH).expect("curve").0;
    for cells in [1, 4] {
        let values = cell_values(&frame, &curve, cells, &faults, 1.5).expect("cells");
        for (i, value) in values[64 * cells..][..64 * cells].iter().enumerate() {
            let x = (i as f64 + 0.5) / cells as f64 - 32.0;
            let truth = TAU * 200.0 / 256.0 * 0.5 * (1.0 + libm::erf(x / 1.5 / std::f64::consts::SQRT_2));
            // Single precision, and the kernel's cut tails.
            assert!((f64::from(*value) - truth).abs() < 1e-5, "cells {cells}, {i}: {value} instead of {truth}");
        }
    }
    // A constant stays what it is.
    let flat = levels(&profile, |_, _| 100);
    let seen = simulated(&flat, 1, faults);
    assert!(seen.samples.iter().all(|u| (u - Complex32::from_polar(1.0, TAU as f32 * 100.0 / 256.0)).norm() < 1e-5));
}

#[test]
fn a_correction_undoes_the_bend_and_is_not_applied_twice() {
    let profile = panel(40, 30, 1.0, 0.0, turn());
    let grid = profile.grid().expect("grid");
    let error: Vec<f32> = (0..grid.len())
        .map(|i| (2.0 * TAU * ((grid.x(i % 40) / 2e-4).powi(2) + grid.y(i / 40) / 3e-4)) as f32)
        .collect();
    let error = Wavefront::new("error", 40, 30, Some(WAVELENGTH), error).expect("wavefront");
    let pattern = PhasePattern::new(grid, WAVELENGTH, vec![1.0; grid.len()]).expect("pattern");
    let plain = drive(&Pattern::Phase(pattern.clone()), None, &profile).expect("drive").frame;
    let correction = error.clone().conjugate();
    let direct = drive(&Pattern::Phase(pattern), Some(&correction), &profile).expect("drive").frame;
    let later = correct(&plain, &correction).expect("correct").frame;
    for frame in [&direct, &later] {
        let seen = simulated(frame, 1, Faults { wavefront_error: Some(error.clone()), ..Faults::default() });
        // Each quantisation misses by at most half a level.
        let worst = seen.samples.iter().map(|u| (u - Complex32::from_polar(1.0, 1.0)).norm()).fold(0.0, f32::max);
        assert!(worst < 1.01 * TAU as f32 / 256.0, "{worst}");
        assert_eq!(frame.metadata.applied.correction.as_deref(), Some("error"));
    }
    assert!(correct(&later, &correction).expect_err("twice").to_string().contains("already"));
    let small = Wavefront::new("small", 4, 3, Some(WAVELENGTH), vec![0.0; 12]).expect("small");
    assert!(correct(&plain, &small).expect_err("size").to_string().contains("4×3"));
    let red = Wavefront { wavelength: Some(633e-9), ..correction };
    assert!(correct(&plain, &red).expect_err("wavelength").to_string().contains("633nm"));
}

#[test]
fn flicker_coupling_and_a_true_curve_act_as_said() {
    let profile = panel(4, 4, 1.0, 0.0, turn());
    let frame = levels(&profile, |_, _| 64);
    let first = |faults: Faults| simulated(&frame, 1, faults).samples[0];
    let near = |a: Complex32, b: Complex32| (a - b).norm() < 1e-5;
    let quarter = TAU as f32 / 4.0;
    assert!(near(first(Faults { phase_scale: 1.1, ..Faults::default() }), Complex32::from_polar(1.0, 1.1 * quarter)));
    assert!(near(first(Faults { amplitude_coupling: 0.4, ..Faults::default() }), Complex32::from_polar(0.8, quarter)));
    let truth = Response { wavelength: None, curve: Curve::Linear { levels_for_2pi: 128.0 } };
    assert!(near(first(Faults { response: Some(truth), ..Faults::default() }), Complex32::new(-1.0, 0.0)));
}

#[test]
fn illumination_has_its_direction_and_its_limit() {
    let profile = panel(32, 24, 1.0, 0.0, turn());
    let frame = levels(&profile, |_, _| 0);
    let lit = |illumination, subsamples| {
        let settings = Simulation { subsamples, illumination: Some(illumination), faults: Faults::default() };
        simulate(&frame, &settings, &Progress::new())
    };
    let (fx, fy) = (5.0 / (32.0 * 8e-6), 3.0 / (24.0 * 6e-6));
    let field = lit(Illumination::Plane { frequency: [fx, fy] }, 1).expect("plane");
    assert!((efficiency(&field, 5, 3) - 1.0).abs() < 1e-5);
    // A source far away in the direction from which that wave comes.
    let fz = (1.0 / WAVELENGTH.powi(2) - fx * fx - fy * fy).sqrt();
    for far in [-1e3, 1e3] {
        let position = [far * fx / fz, far * fy / fz, far];
        let point = lit(Illumination::Point { position }, 1).expect("point");
        assert!(relative_error(&point.samples, &field.samples) < 1e-3, "{far}");
    }
    let steep = Illumination::Plane { frequency: [0.75 / 8e-6, 0.0] };
    assert!(matches!(lit(steep, 1), Err(Error::Undersampled { .. })));
    assert!(lit(steep, 2).is_ok());
    assert!(matches!(lit(Illumination::Point { position: [0.0, 0.0, -1e-4] }, 1), Err(Error::Undersampled { .. })));
    assert!(matches!(lit(Illumination::Point { position: [0.0; 3] }, 1), Err(Error::Parameter { .. })));
    assert!(matches!(lit(Illumination::Plane { frequency: [2e6, 0.0] }, 16), Err(Error::Parameter { .. })));
}

#[test]
fn colours_in_sequence_leave_what_has_not_settled() {
    let profile = panel(6, 5, 1.0, 0.0, turn());
    let frames: Vec<Frame> = [(640e-9, 64), (532e-9, 128), (450e-9, 0)]
        .map(|(wavelength, level)| {
            let frame = levels(&profile, |_, _| level);
            Frame::new(&profile, wavelength, frame.levels).expect("frame")
        })
        .to_vec();
    let frames: Vec<&Frame> = frames.iter().collect();
    let see =
        |share: f64| simulate_sequence(&frames, &Simulation::default(), share, &Progress::new()).expect("sequence");
    let phase = |field: &Field| f64::from(field.samples[7].im.atan2(field.samples[7].re)).rem_euclid(TAU) / TAU * 256.0;
    for (share, expected) in [(0.0, [64.0, 128.0, 0.0]), (0.25, [48.0, 112.0, 32.0])] {
        let seen = see(share);
        for ((field, frame), expected) in seen.iter().zip(&frames).zip(expected) {
            assert_eq!(field.wavelength, frame.metadata.wavelength);
            let miss = (phase(field) - expected + 128.0).rem_euclid(256.0) - 128.0;
            assert!(miss.abs() < 1e-3, "{share}: {} instead of {expected}", phase(field));
        }
    }
    assert!(simulate_sequence(&frames, &Simulation::default(), 1.5, &Progress::new()).is_err());
}
