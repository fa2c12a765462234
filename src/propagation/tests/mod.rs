//! Trust, from the ground up: analytic fields → the term-by-term oracle → the fast path → single precision.

mod oracle;

use super::*;
use crate::field::{Complex64, relative_error};
use crate::random::Random;
use std::f64::consts::TAU;

fn noise(grid: Grid, wavelength: f64) -> Field<f64> {
    let mut field = Field::<f64>::zeros(grid, wavelength);
    let mut random = Random::new(11, 0);
    for u in &mut field.samples {
        *u = Complex64::from_polar(random.uniform(), random.phase());
    }
    field
}

/// Complex amplitude of a Gaussian beam with its waist `w0` at z = 0 (Siegman, *Lasers*, §16.3; exp(−iωt)).
fn gaussian(grid: Grid, wavelength: f64, w0: f64, z: f64, center: [f64; 2]) -> Field<f64> {
    let k = TAU / wavelength;
    let rayleigh = 0.5 * k * w0 * w0;
    let mut field = Field::<f64>::zeros(grid, wavelength);
    for row in 0..grid.height {
        for column in 0..grid.width {
            let (x, y) = (grid.x(column) - center[0], grid.y(row) - center[1]);
            // 1/(1 + iz/z_R)·exp(ikz − ρ²/(w0²(1 + iz/z_R))): the same as the usual w(z), R(z), Gouy form.
            let q = Complex64::new(1.0, z / rayleigh);
            let u = (Complex64::new(-(x * x + y * y) / (w0 * w0), 0.0) / q).exp() / q;
            field.samples[row * grid.width + column] = u * Complex64::cis(k * z);
        }
    }
    field
}

#[test]
fn oracle_carries_a_gaussian_beam() {
    let grid = Grid::new(60, 48, 10e-6, 12e-6).expect("grid");
    let (wavelength, w0, z) = (633e-9, 80e-6, 0.02);
    let start = gaussian(grid, wavelength, w0, 0.0, [40e-6, -30e-6]);
    let out = oracle::propagate(&start, z, grid).expect("oracle");
    let expected = gaussian(grid, wavelength, w0, z, [40e-6, -30e-6]);
    // The beam's formula is paraxial: its phase errs by k·z·θ⁴/8 with θ = λ/(πw0) = 2.5e-3, which is 1e-6 rad;
    // the window cuts the waist at 3.2 w0, where the amplitude is 3e-5.
    let error = relative_error(&out.samples, &expected.samples);
    assert!(error < 2e-4, "{error}");
}

#[test]
fn fast_path_is_the_oracle_on_odd_and_non_square_windows() {
    for (size, out_size, pitch, distance) in [
        ((37, 20), (37, 20), (8e-6, 8e-6), 0.004),
        ((24, 31), (40, 15), (3e-6, 4.5e-6), 0.0007),
        ((30, 17), (21, 44), (8e-6, 6e-6), -0.003),
        ((16, 16), (16, 16), (0.4e-6, 0.5e-6), 0.00001),
    ] {
        let grid = Grid::new(size.0, size.1, pitch.0, pitch.1).expect("grid").centered_at([1e-4, -2e-4]);
        let output = Grid::new(out_size.0, out_size.1, pitch.0, pitch.1).expect("grid").centered_at([1e-4, -2e-4]);
        let field = noise(grid, 532e-9);
        let expected = oracle::propagate(&field, distance, output).expect("oracle");
        let fast = propagate_to(&field, distance, output, &Progress::new()).expect("fast");
        let error = relative_error(&fast.samples, &expected.samples);
        assert!(error < 1e-10, "{size:?} → {out_size:?} over {distance} m: {error}");
        let single = propagate_to(&field.to_f32(), distance, output, &Progress::new()).expect("single");
        assert!(relative_error(&single.samples, &expected.samples) < 1e-6);
    }
}

#[test]
fn an_off_axis_window_sees_what_a_large_one_sees_there() {
    let grid = Grid::new(64, 50, 8e-6, 8e-6).expect("grid");
    let beam = gaussian(grid, 633e-9, 70e-6, 0.0, [20e-6, 30e-6]);
    let large = Grid::new(401, 301, 8e-6, 8e-6).expect("grid");
    let far = propagate_to(&beam, 0.02, large, &Progress::new()).expect("large");
    // A window of whole pixels of the large one, off its middle: same positions, so the fields must be equal.
    let (first_column, first_row) = (185, 125);
    let window =
        Grid::new(61, 43, 8e-6, 8e-6).expect("grid").centered_at([large.x(first_column + 30), large.y(first_row + 21)]);
    let seen = propagate_to(&beam, 0.02, window, &Progress::new()).expect("window");
    let expected: Vec<Complex64> =
        (0..window.len()).map(|i| far.samples[(first_row + i / 61) * 401 + first_column + i % 61]).collect();
    // Each band limit drops what misses its own window: here the wide-angle waves of the input's cut edge, where
    // the beam's amplitude is still 3e-3.
    let error = relative_error(&seen.samples, &expected);
    assert!(error < 3e-4, "{error}");
}

#[test]
fn there_and_back_gives_the_field_again_and_energy_is_kept() {
    let grid = Grid::new(150, 90, 8e-6, 8e-6).expect("grid");
    let beam = gaussian(grid, 633e-9, 100e-6, 0.0, [50e-6, 20e-6]);
    let there = propagate(&beam, 0.02, &Progress::new()).expect("there");
    let back = propagate(&there, -0.02, &Progress::new()).expect("back");
    assert!(relative_error(&back.samples, &beam.samples) < 2e-3);
    let energy = |f: &Field<f64>| f.samples.iter().map(|u| u.norm_sqr()).sum::<f64>();
    assert!((energy(&there) / energy(&beam) - 1.0).abs() < 1e-4);
    let nowhere = propagate(&beam, 0.0, &Progress::new()).expect("no distance");
    assert!(relative_error(&nowhere.samples, &beam.samples) < 1e-12);
}

#[test]
fn a_diverging_wave_stays_one_and_its_phase_grows_with_distance() {
    // exp(+ikr)/r from a point 50 mm behind, carried 10 mm on, is exp(+ikr)/r of a point 60 mm behind. This pins
    // the sign of the wave and of the transform in one comparison of complex fields.
    let grid = Grid::new(300, 260, 8e-6, 8e-6).expect("grid");
    let wavelength = 633e-9;
    let spherical = |z: f64| {
        let mut field = Field::<f64>::zeros(grid, wavelength);
        for row in 0..grid.height {
            for column in 0..grid.width {
                let (x, y) = (grid.x(column) - 1e-4, grid.y(row) - 2e-4);
                let r = (x * x + y * y + z * z).sqrt();
                field.samples[row * grid.width + column] = Complex64::from_polar(1.0 / r, TAU / wavelength * r);
            }
        }
        field
    };
    let carried = propagate(&spherical(0.050), 0.010, &Progress::new()).expect("carried");
    let expected = spherical(0.060);
    // The window cuts the wave, so edges ring; the inner half is compared. Ringing there is a few per cent; a wrong
    // sign would be an error above 1.
    let inner = |f: &Field<f64>| -> Vec<Complex64> {
        (65..195).flat_map(|r| f.samples[r * 300 + 75..r * 300 + 225].to_vec()).collect()
    };
    let error = relative_error(&inner(&carried), &inner(&expected));
    assert!(error < 0.06, "{error}");
}

#[test]
fn talbot_images_of_a_grating() {
    // A periodic amplitude repeats itself after z_T = 2·period²/λ (paraxial), and is shifted by half a period
    // after half of that.
    let (wavelength, pitch, period) = (633e-9, 8e-6, 16.0 * 8e-6);
    let grid = Grid::new(2048, 1, pitch, pitch).expect("grid");
    let mut field = Field::<f64>::zeros(grid, wavelength);
    for column in 0..grid.width {
        field.samples[column] = Complex64::new(1.0 + (TAU * grid.x(column) / period).cos(), 0.0);
    }
    let talbot = 2.0 * period * period / wavelength;
    // One row stands for a field that is constant in y only if y does not spread: propagate a tall window's row.
    let tall = Grid::new(2048, 9, pitch, 1.0).expect("grid");
    let samples = (0..9).flat_map(|_| field.samples.clone()).collect();
    let field = Field { grid: tall, wavelength, samples };
    let out = propagate(&field, 0.5 * talbot, &Progress::new()).expect("half Talbot");
    let middle = &out.samples[4 * 2048 + 900..4 * 2048 + 1148];
    let expected: Vec<f64> = (900..1148).map(|c| (1.0 - (TAU * tall.x(c) / period).cos()).powi(2)).collect();
    let scale: f64 = middle.iter().map(|u| u.norm_sqr()).sum::<f64>() / expected.iter().sum::<f64>();
    for (u, e) in middle.iter().zip(&expected) {
        // The grating ends at the window, which rings by about 1/√(2·Fresnel number of the half width) ≈ 0.05.
        assert!((u.norm_sqr() / scale - e).abs() < 0.25, "{} {e}", u.norm_sqr() / scale);
    }
}

#[test]
fn a_slit_gives_fresnels_integrals() {
    // Slit of half width a in front of a plane wave: u(x) = √(1/(i λ d))·∫exp(iπ(x−x')²/(λd))dx'·exp(ikd). The
    // integral is done here by fine trapezoids, independent of any transform.
    let (wavelength, pitch, distance) = (633e-9, 8e-6, 0.15);
    let (width, half) = (1024usize, 60usize);
    let grid = Grid::new(width, 3, pitch, 1.0).expect("grid");
    let mut field = Field::<f64>::zeros(grid, wavelength);
    for row in 0..3 {
        for column in width / 2 - half..width / 2 + half {
            field.samples[row * width + column] = Complex64::new(1.0, 0.0);
        }
    }
    let out = propagate(&field, distance, &Progress::new()).expect("out");
    let edge = half as f64 * pitch;
    let steps = 40_000;
    let (mut difference, mut norm) = (0.0, 0.0);
    for column in (width / 2 - 120..width / 2 + 120).step_by(7) {
        let x = grid.x(column);
        let sum: Complex64 = (0..steps)
            .map(|i| {
                let at = -edge + (i as f64 + 0.5) * 2.0 * edge / steps as f64;
                Complex64::cis(std::f64::consts::PI * (x - at).powi(2) / (wavelength * distance))
            })
            .sum::<Complex64>()
            * (2.0 * edge / steps as f64);
        let factor = (Complex64::new(0.0, -1.0) / (wavelength * distance)).sqrt();
        let expected = factor * sum * Complex64::cis(TAU / wavelength * distance);
        difference += (out.samples[width + column] - expected).norm_sqr();
        norm += expected.norm_sqr();
    }
    // A sharp edge has frequencies beyond the pitch's limit; what they carry is ≈ pitch/edge of the energy.
    let error = (difference / norm).sqrt();
    assert!(error < 0.03, "{error}");
}

#[test]
fn fresnel_and_exact_agree_where_fresnel_is_valid_and_nowhere_else() {
    let grid = Grid::new(128, 100, 8e-6, 8e-6).expect("grid");
    let beam = gaussian(grid, 633e-9, 60e-6, 0.0, [0.0, 0.0]);
    let settings = Settings { kernel: Kernel::Fresnel, ..Settings::default() };
    let run = |field: &Field<f64>, kernel, d| {
        Propagator::new(field.grid, field.grid, Settings { kernel, ..settings })
            .and_then(|p| p.propagate(field, d, &Progress::new()))
            .expect("run")
    };
    let smooth =
        relative_error(&run(&beam, Kernel::Fresnel, 0.02).samples, &run(&beam, Kernel::AngularSpectrum, 0.02).samples);
    assert!(smooth < 1e-4, "{smooth}");
    let fine = noise(Grid::new(128, 100, 1e-6, 1e-6).expect("grid"), 633e-9);
    let rough =
        relative_error(&run(&fine, Kernel::Fresnel, 3e-4).samples, &run(&fine, Kernel::AngularSpectrum, 3e-4).samples);
    assert!(rough > 0.5, "{rough}");
}

#[test]
fn impossible_requests_are_refused() {
    let grid = Grid::new(8, 8, 8e-6, 8e-6).expect("grid");
    let other = Grid::new(8, 8, 9e-6, 8e-6).expect("grid");
    let field = Field::<f32>::zeros(grid, 5e-7);
    assert!(propagate_to(&field, 0.1, other, &Progress::new()).is_err());
    assert!(propagate(&field, f64::NAN, &Progress::new()).is_err());
    let settings = Settings { memory: 1000, ..Settings::default() };
    assert!(matches!(Propagator::<f32>::new(grid, grid, settings), Err(Error::Memory { .. })));
    let stopped = Progress::new();
    stopped.stop();
    assert!(matches!(propagate(&field, 0.1, &stopped), Err(Error::Interrupted)));
}

#[test]
fn single_precision_holds_1e_6_at_full_size_and_every_distance() {
    // A field with light at all frequencies, so that the band limits and every phase of the transfer count. The f64
    // path is the one that agrees with the oracle above.
    let grid = Grid::new(1920, 1080, 8e-6, 8e-6).expect("grid");
    let field = noise(grid, 532e-9).to_f32();
    for distance in [0.05, 0.5, 2.0] {
        let single = propagate(&field, distance, &Progress::new()).expect("f32");
        let double = propagate(&field.to_f64(), distance, &Progress::new()).expect("f64");
        let error = relative_error(&single.samples, &double.samples);
        println!("1920×1080 over {distance} m: relative L2 error {error:.2e}");
        assert!(error < 1e-6, "{distance} m: {error}");
    }
}

#[test]
fn scaled_and_shifted_windows_are_the_oracle() {
    for (size, out_size, pitch, out_pitch, middle, distance) in [
        ((37, 20), (23, 31), (8e-6, 8e-6), (11e-6, 5e-6), (1e-4, -8e-5), 0.004),
        ((24, 31), (40, 15), (3e-6, 4.5e-6), (1e-6, 9e-6), (-1e-4, 0.5e-4), 0.002),
        ((30, 17), (21, 44), (8e-6, 6e-6), (20e-6, 2e-6), (5e-5, -7e-5), -0.003),
        ((16, 16), (9, 7), (0.4e-6, 0.5e-6), (0.3e-6, 0.9e-6), (2e-6, -3e-6), 0.00001),
        ((19, 23), (1, 1), (8e-6, 6e-6), (8e-6, 6e-6), (3e-5, 0.0), 0.05),
    ] {
        let grid = Grid::new(size.0, size.1, pitch.0, pitch.1).expect("grid").centered_at([1e-4, -2e-4]);
        let output = Grid::new(out_size.0, out_size.1, out_pitch.0, out_pitch.1)
            .expect("grid")
            .centered_at([1e-4 + middle.0, -2e-4 + middle.1]);
        let field = noise(grid, 532e-9);
        let planned = ScaledPropagator::new(grid, output, 532e-9, distance, Settings::default()).expect("plan");
        // The highest frequency of an even number has no sign, and is left out.
        let nyquist = [0.499_999 / pitch.0, 0.499_999 / pitch.1];
        let weight = |axis: usize, f: f64| if f.abs() > nyquist[axis] { 0.0 } else { planned.weight(axis, f) };
        let expected = oracle::onto(&field, distance, output, planned.counts(), weight);
        let fast = planned.propagate(&field, &Progress::new()).expect("fast");
        let error = relative_error(&fast.samples, &expected.samples);
        // Frequencies of weight below 1e-12 are left out.
        assert!(error < 1e-9, "{size:?} → {out_size:?} over {distance} m: {error}");
        let single = propagate_scaled(&field.to_f32(), distance, output, &Progress::new()).expect("single");
        let error = relative_error(&single.samples, &expected.samples);
        // Three transforms more than an inverse one, and of the noise only what meets the window.
        assert!(error < 6e-6, "{size:?} → {out_size:?} over {distance} m in f32: {error}");
    }
}

#[test]
fn a_gaussian_beam_on_image_planes_of_other_pitches() {
    let grid = Grid::new(211, 190, 8e-6, 9e-6).expect("grid");
    let (wavelength, w0, z) = (633e-9, 120e-6, 0.3);
    let beam = gaussian(grid, wavelength, w0, 0.0, [30e-6, -50e-6]);
    // 0.3 m on the beam is 0.52 mm wide: a coarse window that sees all of it, and a fine one at its shoulder.
    let wide = Grid::new(181, 155, 25e-6, 30e-6).expect("grid").centered_at([1e-4, 0.0]);
    let fine = Grid::new(75, 41, 2.5e-6, 3e-6).expect("grid").centered_at([0.45e-3, -0.3e-3]);
    for output in [wide, fine] {
        let out = propagate_scaled(&beam, z, output, &Progress::new()).expect("out");
        let expected = gaussian(output, wavelength, w0, z, [30e-6, -50e-6]);
        let error = relative_error(&out.samples, &expected.samples);
        println!("beam onto {} µm: {error:.2e}", output.pitch_x * 1e6);
        // Paraxial formula: k·z·θ⁴/8 = 3e-6 rad at θ = λ/(πw0).
        assert!(error < 2e-5, "{error}");
    }
    // Energy: samples stand for pitch_x·pitch_y of area each.
    let out = propagate_scaled(&beam, z, wide, &Progress::new()).expect("out");
    let energy = |f: &Field<f64>| f.samples.iter().map(|u| u.norm_sqr()).sum::<f64>() * f.grid.pitch_x * f.grid.pitch_y;
    assert!((energy(&out) / energy(&beam) - 1.0).abs() < 1e-6, "{}", energy(&out) / energy(&beam));
}

#[test]
fn there_and_back_in_band_is_exact() {
    // The beam stays inside both windows and the band: nothing is lost but by rounding.
    let grid = Grid::new(201, 180, 8e-6, 7e-6).expect("grid");
    let beam = gaussian(grid, 633e-9, 90e-6, 0.0, [20e-6, 30e-6]);
    for distance in [0.005, 0.02] {
        let there = propagate(&beam, distance, &Progress::new()).expect("there");
        let back = propagate(&there, -distance, &Progress::new()).expect("back");
        let error = relative_error(&back.samples, &beam.samples);
        println!("there and back over {distance} m: {error:.2e}");
        assert!(error < 1e-9, "{error}");
        let single = propagate(&beam.to_f32(), distance, &Progress::new()).expect("there");
        let single = propagate(&single, -distance, &Progress::new()).expect("back");
        assert!(relative_error(&single.samples, &beam.samples) < 2e-6);
        let energy = |f: &Field<f64>| f.samples.iter().map(|u| u.norm_sqr()).sum::<f64>();
        assert!((energy(&there) / energy(&beam) - 1.0).abs() < 1e-10);
        // Onto another pitch and back.
        let middle = Grid::new(160, 170, 11e-6, 9e-6).expect("grid").centered_at([10e-6, -5e-6]);
        let there = propagate_scaled(&beam, distance, middle, &Progress::new()).expect("there");
        let back = propagate_scaled(&there, -distance, grid, &Progress::new()).expect("back");
        let error = relative_error(&back.samples, &beam.samples);
        println!("there and back over {distance} m on 11 µm: {error:.2e}");
        assert!(error < 1e-6, "{error}");
    }
}

#[test]
fn a_circular_aperture_on_its_axis_gives_the_exact_closed_form() {
    // Behind a disc of radius a in a plane wave, on the axis, Rayleigh–Sommerfeld's first integral is done exactly:
    // u = e^{ikz} − z/√(z² + a²)·e^{ik√(z² + a²)}; Fresnel numbers N = a²/(λz) give |u|² ≈ 4 sin²(πN/2).
    let (wavelength, radius, pitch) = (633e-9, 0.4e-3, 4e-6);
    let grid = Grid::new(221, 221, pitch, pitch).expect("grid");
    let mut field = Field::<f64>::zeros(grid, wavelength);
    for row in 0..grid.height {
        for column in 0..grid.width {
            // Part of the pixel inside the disc.
            let parts = 32;
            let at = |i: usize| ((i as f64 + 0.5) / parts as f64 - 0.5) * pitch;
            let inside = (0..parts * parts)
                .filter(|i| (grid.x(column) + at(i % parts)).hypot(grid.y(row) + at(i / parts)) < radius)
                .count();
            field.samples[row * grid.width + column] = Complex64::new(inside as f64 / (parts * parts) as f64, 0.0);
        }
    }
    let k = TAU / wavelength;
    for number in [1.0, 1.5, 2.0, 2.5, 3.0] {
        let z = radius * radius / (wavelength * number);
        let point = Grid::new(1, 1, pitch, pitch).expect("grid");
        let out = propagate_scaled(&field, z, point, &Progress::new()).expect("out");
        let r = z.hypot(radius);
        let expected = Complex64::cis(k * z) - Complex64::cis(k * r) * (z / r);
        println!("N = {number}: {:.4} for {:.4}", out.samples[0].norm(), expected.norm());
        // The edge's wave comes under sin = a/z and is lowered by the pixels' sinc: (πaθ/λ·pitch/a)²/6 ≤ 1e-3; the
        // window of the aperture's plane ends the spectrum at 1/(2·pitch).
        assert!((out.samples[0] - expected).norm() < 6e-3, "N = {number}: {} {expected}", out.samples[0]);
    }
}

#[test]
fn talbot_images_under_an_envelope_are_the_sum_of_three_beams() {
    // (1 + cos(2πx/p)) under a Gaussian: three beams, of which the side ones run aside by λz/p and turn by πλz/p².
    // At half the Talbot length that turn is π: the image is the grating's negative.
    let (wavelength, period, w0) = (633e-9, 128e-6, 1.2e-3);
    let tall = Grid::new(1200, 61, 8e-6, 0.2e-3).expect("grid");
    let z = period * period / wavelength;
    let beam = |z: f64| {
        let mut field = Field::<f64>::zeros(tall, wavelength);
        for (order, weight) in [(-1.0, 0.5), (0.0, 1.0), (1.0, 0.5)] {
            let (f, aside) = (order / period, order * wavelength * z / period);
            let one = gaussian(tall, wavelength, w0, z, [aside, 0.0]);
            for (i, (u, g)) in field.samples.iter_mut().zip(&one.samples).enumerate() {
                let x = tall.x(i % tall.width);
                *u += g * Complex64::cis(TAU * f * x - std::f64::consts::PI * wavelength * z * f * f) * weight;
            }
        }
        field
    };
    let out = propagate(&beam(0.0), z, &Progress::new()).expect("half Talbot");
    let error = relative_error(&out.samples, &beam(z).samples);
    println!("half Talbot length: {error:.2e}");
    assert!(error < 2e-4, "{error}");
    // On the axis the grating is bright, half a Talbot length on it is dark.
    let middle = 30 * 1200 + 600;
    assert!(beam(0.0).samples[middle].norm() > 1.9 && out.samples[middle].norm() < 0.05);
}
