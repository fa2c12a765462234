//! Each encoding must give its field back as a complex field; what does not fit is refused with numbers.

use super::*;
use crate::field::{Complex64, Grid, relative_error};
use crate::panel::{PanelKind, Simulation, simulate};
use crate::random::Random;
use std::f64::consts::{PI, TAU};
use std::path::Path;

const WAVELENGTH: f64 = 532e-9;

fn panel(width: usize, height: usize, kind: &str, bits: u8, response: &str) -> PanelProfile {
    let text = format!(
        "name = \"t\"\nmaker = \"t\"\nkind = \"{kind}\"\nwidth = {width}\nheight = {height}\npitch_x = \"8um\"\n\
         pitch_y = \"6um\"\nbits = {bits}\nfill_factor = 1.0\nwavelengths = [\"532nm\"]\n[[response]]\n{response}\n"
    );
    PanelProfile::parse(&text, Path::new("t.toml")).expect("profile")
}

fn phase_panel(width: usize, height: usize) -> PanelProfile {
    panel(width, height, "phase-lcos", 8, "kind = \"linear\"\nlevels_for_2pi = 256")
}

fn amplitude_panel(width: usize, height: usize) -> PanelProfile {
    panel(width, height, "amplitude", 8, "kind = \"amplitude\"")
}

/// A sum of plane waves within `share` of the grid's limits, about a strong one on the axis.
fn smooth(grid: Grid, share: f64, strength: f64) -> Field {
    let mut random = Random::new(11, 0);
    let mut field = Field::zeros(grid, WAVELENGTH);
    let most = [share * grid.limit_x(), share * grid.limit_y()];
    let waves: Vec<[f64; 4]> = (0..12)
        .map(|_| {
            // Frequencies of the grid itself, so that the periodic border is smooth too.
            let f = [0, 1].map(|axis| {
                let extent = [grid.extent_x(), grid.extent_y()][axis];
                ((2.0 * random.uniform() - 1.0) * most[axis] * extent).trunc() / extent
            });
            [f[0], f[1], random.uniform(), random.phase()]
        })
        .collect();
    for (i, u) in field.samples.iter_mut().enumerate() {
        let (x, y) = (grid.x(i % grid.width), grid.y(i / grid.width));
        let sum: Complex64 =
            waves.iter().map(|[fx, fy, a, p]| Complex64::from_polar(*a, TAU * (fx * x + fy * y) + p)).sum();
        let value = Complex64::new(1.0, 0.0) + sum * strength;
        *u = Complex32::new(value.re as f32, value.im as f32);
    }
    field
}

/// The pattern's own field as the record has it lit, within its aperture and divided by its scale.
fn decoded(made: &EncodedPattern) -> Field {
    let samples = made.pattern.values().iter().map(|&v| match made.pattern {
        Pattern::Phase(_) => Complex32::from_polar(1.0, v),
        Pattern::Fringe(_) => Complex32::new(v, 0.0),
    });
    let mut samples: Vec<_> = samples.collect();
    let grid = made.pattern.grid();
    illuminate(&mut samples, grid, WAVELENGTH, made.record.illumination).expect("illumination");
    let field = Field::new(grid, WAVELENGTH, samples).expect("field");
    let mut field = match &made.record.aperture {
        Some(aperture) => band::limit(&field, aperture, &Progress::new()).expect("band").0,
        None => field,
    };
    for u in &mut field.samples {
        *u /= made.record.scale as f32;
    }
    field
}

#[test]
fn double_phase_gives_a_smooth_field_back_within_its_band() {
    // Alternating pixels on an odd number of columns or rows do not close on themselves: the periodic band filter sees
    // the seam as one more edge, up to 6 % of the field on panels this small.
    for (width, height, tolerance) in [(96, 70, 3e-3), (75, 63, 0.1)] {
        let profile = phase_panel(width, height);
        let grid = profile.grid().expect("grid");
        for strength in [0.01, 0.05] {
            let field = smooth(grid, 0.2, strength);
            for interlace in [Interlace::Checkerboard, Interlace::Columns, Interlace::Rows] {
                let settings = DoublePhase { interlace, band: [0.5, 0.5], percentile: Some(1.0) };
                let made =
                    pattern(&field, &Encoding::DoublePhase(settings), &profile, &Progress::new()).expect("pattern");
                let error = relative_error(&decoded(&made).samples, &field.samples);
                assert!(error < tolerance, "{width}×{height} {interlace:?} {strength}: {error}");
                assert!(made.dropped < 1e-6 && made.clipped == 0.0, "{} {}", made.dropped, made.clipped);
                assert!(made.warnings.is_empty());
            }
        }
    }
}

#[test]
fn off_axis_fringes_lit_with_their_reference_give_the_object_back() {
    let (width, height) = (120, 81);
    let profile = amplitude_panel(width, height);
    let grid = profile.grid().expect("grid");
    let bins = |x: f64, y: f64| Some([x / grid.extent_x(), y / grid.extent_y()]);
    for carrier in [None, bins(-30.0, 0.0), bins(4.0, 20.0), bins(-18.0, -22.0)] {
        let settings = OffAxis { reference: carrier.map(Reference::Carrier), percentile: 1.0, ..OffAxis::default() };
        let field = smooth(grid, 0.3, 0.2);
        let made = pattern(&field, &Encoding::OffAxisBipolar(settings), &profile, &Progress::new()).expect("bipolar");
        let error = relative_error(&decoded(&made).samples, &made.target.samples);
        assert!(error < 1e-5, "{carrier:?}: {error}");
        assert!(made.dropped < 1e-6 && made.clipped == 0.0, "{carrier:?}: {} {}", made.dropped, made.clipped);
    }
    // The whole intensity needs three times the room: a quarter of the limit for the object.
    let field = smooth(grid, 0.2, 0.2);
    let settings = OffAxis { percentile: 1.0, reference_ratio: 1.5, ..OffAxis::default() };
    let made = pattern(&field, &Encoding::OffAxisIntensity(settings), &profile, &Progress::new()).expect("intensity");
    let error = relative_error(&decoded(&made).samples, &field.samples);
    assert!(error < 1e-5, "intensity: {error}");
}

#[test]
fn the_first_order_runs_where_object_and_carrier_send_it() {
    let (width, height) = (64, 48);
    let profile = amplitude_panel(width, height);
    let grid = profile.grid().expect("grid");
    let (fx, fy) = (3.0 / grid.extent_x(), -5.0 / grid.extent_y());
    let mut field = Field::zeros(grid, WAVELENGTH);
    illuminate_one(&mut field, [fx, fy]);
    for (encoding, carrier) in
        [(Encoding::OffAxisBipolar(OffAxis::default()), 16), (Encoding::OffAxisIntensity(OffAxis::default()), 24)]
    {
        let made = encode(&field, &profile, &EncodeSettings::new(encoding), &Progress::new()).expect("encode");
        let lit = |illumination| {
            let settings = Simulation { illumination, ..Simulation::default() };
            let seen = simulate(&made.frame, &settings, &Progress::new()).expect("simulate");
            strongest(&seen, 3)
        };
        // Lit along the normal: zero order on the axis, the object turned back by the carrier, and its mirror image.
        let normal = lit(Some(crate::panel::Illumination::Normal));
        assert_eq!(normal[0], (0, 0));
        assert!(normal.contains(&(3 - carrier, -5)) && normal.contains(&(carrier - 3, 5)), "{normal:?}");
        // Lit with the reference: the object where it was, the zero order along the carrier.
        let reference = lit(None);
        assert_eq!(reference[0], (carrier, 0));
        assert!(reference.contains(&(3, -5)), "{reference:?}");
        // One plane wave uses the full contrast: 1/16 of the light goes into it.
        assert!((made.report.efficiency * 16.0 - 1.0).abs() < 0.01, "{}", made.report.efficiency);
        assert!(made.report.field_error < 0.01, "{}", made.report.field_error);
    }
}

fn illuminate_one(field: &mut Field, frequency: [f64; 2]) {
    field.samples.fill(Complex32::new(1.0, 0.0));
    let wave = crate::panel::Illumination::Plane { frequency };
    illuminate(&mut field.samples, field.grid, WAVELENGTH, wave).expect("wave");
}

/// The `count` strongest plane waves, in cycles per width and height.
fn strongest(field: &Field, count: usize) -> Vec<(i64, i64)> {
    let grid = field.grid;
    let mut spectrum = field.samples.clone();
    crate::field::Fft2::new(grid.width, grid.height).forward(&mut spectrum, &Progress::new());
    let mut order: Vec<usize> = (0..spectrum.len()).collect();
    order.sort_by(|&a, &b| spectrum[b].norm_sqr().total_cmp(&spectrum[a].norm_sqr()));
    let cycles = |f: f64, extent: f64| (f * extent).round() as i64;
    order[..count]
        .iter()
        .map(|k| {
            let (fx, fy) = (grid.frequency_x(k % grid.width), grid.frequency_y(k / grid.width));
            (cycles(fx, grid.extent_x()), cycles(fy, grid.extent_y()))
        })
        .collect()
}

#[test]
fn a_kinoform_of_a_plane_wave_sends_all_light_into_it_and_n_levels_their_share() {
    let (width, height) = (64, 32);
    let grid = phase_panel(width, height).grid().expect("grid");
    let mut field = Field::zeros(grid, WAVELENGTH);
    illuminate_one(&mut field, [1.0 / grid.extent_x(), 0.0]);
    for bits in [1u8, 2, 3, 8] {
        let levels = 1 << bits;
        let profile =
            panel(width, height, "phase-lcos", bits, &format!("kind = \"linear\"\nlevels_for_2pi = {levels}"));
        let profile = if bits == 1 { one_bit(profile) } else { profile };
        let made = encode(&field, &profile, &EncodeSettings::new(Encoding::Kinoform), &Progress::new()).expect("made");
        let truth = crate::panel::simulated::sinc(1.0 / f64::from(levels)).powi(2);
        // 64 samples of the staircase: each of the few levels spans a whole number of them but for rounding at its ends.
        assert!((made.report.efficiency / truth - 1.0).abs() < 0.01, "{levels}: {}", made.report.efficiency);
        let error = (1.0 - made.report.efficiency).max(0.0).sqrt();
        assert!((made.report.field_error - error).abs() < 1e-3);
    }
}

/// Two levels, 0 and π (a linear curve of two levels a turn is what the text says already).
fn one_bit(profile: PanelProfile) -> PanelProfile {
    PanelProfile { kind: PanelKind::PhaseLcos, ..profile }
}

#[test]
fn a_panel_short_of_a_turn_gets_the_nearest_phase_and_the_report_says_so() {
    let grid = phase_panel(256, 16).grid().expect("grid");
    let mut field = Field::zeros(grid, WAVELENGTH);
    illuminate_one(&mut field, [1.0 / grid.extent_x(), 0.0]);
    let short = panel(256, 16, "phase-lcos", 8, "kind = \"linear\"\nlevels_for_2pi = 320");
    let made = encode(&field, &short, &EncodeSettings::new(Encoding::Kinoform), &Progress::new()).expect("made");
    // 255/320 of a turn is there; of the gap of 65 steps all but the two half steps at its ends are out of reach.
    assert!((made.report.unreachable - 64.0 / 320.0).abs() < 0.01, "{}", made.report.unreachable);
    assert!(made.report.warnings.iter().any(|w| w.contains("range")));
    // The wave's part along the axis of the wanted one: (range + 2·sin(gap/2))/2π, squared.
    let gap = TAU * 65.0 / 320.0;
    let truth = ((TAU - gap + 2.0 * (gap / 2.0).sin()) / TAU).powi(2);
    assert!((made.report.efficiency - truth).abs() < 2e-3, "{} instead of {truth}", made.report.efficiency);
    let (_, miss) = short.drive_curve(WAVELENGTH).expect("curve").0.nearest(1.9 * PI);
    assert!(miss > 0.0, "the nearest phase to 1.9π is 2π, not 1.6π");
}

#[test]
fn a_reference_that_aliases_is_refused_with_its_numbers() {
    let profile = amplitude_panel(64, 48);
    let field = smooth(profile.grid().expect("grid"), 0.2, 0.1);
    let with = |settings: OffAxis| {
        let settings = EncodeSettings::new(Encoding::OffAxisBipolar(settings));
        encode(&field, &profile, &settings, &Progress::new())
    };
    let angle = |degrees: f64| Some(Reference::Angle([degrees * PI / 180.0, 0.0]));
    // asin(λ/2p) = 1.906°.
    for (degrees, what) in [(5.0, "beyond the limit"), (1.9, "no room for the object")] {
        match with(OffAxis { reference: angle(degrees), ..OffAxis::default() }) {
            Err(Error::Undersampled { frequency, limit, pitch, hint, .. }) => {
                assert!(frequency > limit && (limit - 0.5 / 8e-6).abs() < 1e-6 && pitch == 8e-6, "{what}");
                assert!(hint.contains("deg"), "{hint}");
            }
            other => panic!("{what}: {other:?}"),
        }
    }
    let wide = OffAxis { reference: angle(1.0), bandwidth: Some(4e4), ..OffAxis::default() };
    assert!(matches!(with(wide), Err(Error::Undersampled { .. })));
    assert!(matches!(with(OffAxis { reference: angle(0.01), ..OffAxis::default() }), Err(Error::OutOfRange { .. })));
    assert!(matches!(with(OffAxis { reference: angle(90.0), ..OffAxis::default() }), Err(Error::Parameter { .. })));
    let overlapping = OffAxis { reference: angle(0.5), bandwidth: Some(3e4), ..OffAxis::default() };
    assert!(with(overlapping).expect("overlap").report.warnings.iter().any(|w| w.contains("overlaps")));
}

#[test]
fn pixels_finer_than_half_a_wave_refuse_a_grazing_reference() {
    // Pitch of half a wavelength: every wave is sampled, but reference and object together pass the limit.
    let text = "name = \"fine\"\nmaker = \"t\"\nkind = \"amplitude\"\nwidth = 64\nheight = 64\npitch = \"0.266um\"\n\
                bits = 8\nfill_factor = 1.0\nwavelengths = [\"532nm\"]\n[[response]]\nkind = \"amplitude\"\n";
    let profile = PanelProfile::parse(text, Path::new("fine.toml")).expect("profile");
    let field = smooth(profile.grid().expect("grid"), 0.2, 0.1);
    let reference = Some(Reference::Angle([80.0 * PI / 180.0, 0.0]));
    let settings = EncodeSettings::new(Encoding::OffAxisBipolar(OffAxis { reference, ..OffAxis::default() }));
    assert!(matches!(encode(&field, &profile, &settings, &Progress::new()), Err(Error::Undersampled { .. })));
}

#[test]
fn the_wrong_panel_grid_or_field_is_refused() {
    let profile = phase_panel(32, 24);
    let grid = profile.grid().expect("grid");
    let good = smooth(grid, 0.2, 0.1);
    let kinoform = EncodeSettings::new(Encoding::Kinoform);
    let refused = |field: &Field, profile: &PanelProfile, word: &str| {
        let error = encode(field, profile, &kinoform, &Progress::new()).expect_err(word).to_string();
        assert!(error.contains(word), "{error}");
    };
    refused(&good, &amplitude_panel(32, 24), "modulates amplitude");
    refused(&good, &phase_panel(24, 32), "24×32");
    refused(&Field::zeros(grid, WAVELENGTH), &profile, "dark");
    let mut broken = good.clone();
    broken.samples[40].re = f32::NAN;
    refused(&broken, &profile, "column 8, row 1");
    let fringes = EncodeSettings::new(Encoding::OffAxisBipolar(OffAxis::default()));
    let made = encode(&good, &profile, &fringes, &Progress::new()).expect("as amplitude");
    assert!(made.report.warnings[0].contains("polarisers"));
    assert_eq!(made.frame.metadata.panel.kind, PanelKind::Amplitude);
    let stopped = Progress::new();
    stopped.stop();
    let double = EncodeSettings::new(Encoding::named("double-phase").expect("name"));
    assert!(matches!(encode(&good, &profile, &double, &stopped), Err(Error::Interrupted)));
    assert!(Encoding::named("triple-phase").expect_err("name").to_string().contains("kinoform"));
}

/// Light of random phase and amplitude within `share` of the grid's limits: the field of a diffuse scene.
fn speckle(grid: Grid, share: f64) -> Field {
    let mut random = Random::new(21, 0);
    let mut value = || Complex32::new(random.uniform_f32() - 0.5, random.uniform_f32() - 0.5);
    let samples = (0..grid.len()).map(|_| value()).collect();
    let field = Field::new(grid, WAVELENGTH, samples).expect("field");
    let aperture = crate::propagation::Aperture::centered(share * grid.limit_x(), share * grid.limit_y());
    band::limit(&field, &aperture, &Progress::new()).expect("band").0
}

#[test]
fn phase_encodings_of_diffuse_light_keep_its_field_within_the_band() {
    let short = panel(96, 80, "phase-lcos", 8, "kind = \"linear\"\nlevels_for_2pi = 320");
    let full = phase_panel(96, 80);
    let field = speckle(full.grid().expect("grid"), 0.4);
    let error = |profile: &PanelProfile, encoding: Encoding| {
        let made = encode(&field, profile, &EncodeSettings::new(encoding), &Progress::new()).expect("encode");
        assert!(made.report.efficiency > 0.0 && made.report.efficiency < 1.0);
        made.report.field_error
    };
    let named = |name: &str| Encoding::named(name).expect("name");
    // Two phases or one phase a pixel leave a quarter to a third of diffuse light wrong; phases that are fitted to the
    // field within the band leave about a hundredth, on a panel of 1.6π too when given more steps.
    let double = error(&full, named("double-phase"));
    let diffused = error(&full, named("error-diffusion"));
    let kinoform = error(&full, named("kinoform"));
    assert!(diffused < double && double < 0.35 && kinoform > double, "{double} {diffused} {kinoform}");
    assert!(error(&full, named("gradient")) < 0.02);
    assert!(error(&short, named("double-phase")) > double);
    let patient = |iterations| Encoding::Gradient(BandGradient { iterations, ..BandGradient::default() });
    let (few, many) = (error(&short, patient(60)), error(&short, patient(200)));
    assert!(many < few && few < 0.05 && many < 0.02, "{few} {many}");
}

#[test]
fn amplitude_encodings_of_diffuse_light_rank_as_their_freedom_does() {
    let grey = amplitude_panel(96, 80);
    let dmd = panel(96, 80, "binary-dmd", 1, "kind = \"amplitude\"");
    let field = speckle(grey.grid().expect("grid"), 0.4);
    let error = |profile: &PanelProfile, name: &str| {
        let settings = EncodeSettings::new(Encoding::named(name).expect("name"));
        encode(&field, profile, &settings, &Progress::new()).expect("encode").report.field_error
    };
    for name in ["off-axis-bipolar", "off-axis-intensity", "single-side-band"] {
        // Exact but for eight bits and one clipped sample in a thousand.
        assert!(error(&grey, name) < 0.02, "{name}");
    }
    // Positive parts have harmonics of their own within the band.
    for name in ["burckhardt", "lee"] {
        assert!(error(&grey, name) < 0.4, "{name}");
    }
    let [threshold, diffusion, search] =
        ["binary-threshold", "binary-diffusion", "binary-search"].map(|name| error(&dmd, name));
    assert!(search < 0.8 * threshold && diffusion < 0.9, "{threshold} {diffusion} {search}");
}

#[test]
fn a_lee_grating_sends_a_tenth_of_the_light_into_its_first_order() {
    let dmd = panel(64, 48, "binary-dmd", 1, "kind = \"amplitude\"");
    let mut field = Field::zeros(dmd.grid().expect("grid"), WAVELENGTH);
    field.samples.fill(Complex32::new(1.0, 0.0));
    let encoding = Encoding::named("binary-threshold").expect("name");
    let made = encode(&field, &dmd, &EncodeSettings::new(encoding), &Progress::new()).expect("encode");
    let illumination = Some(crate::panel::Illumination::Normal);
    let settings = Simulation { subsamples: 3, illumination, ..Simulation::default() };
    let seen = simulate(&made.frame, &settings, &Progress::new()).expect("simulate");
    let mut spectrum = seen.samples.clone();
    crate::field::Fft2::new(seen.grid.width, seen.grid.height).forward(&mut spectrum, &Progress::new());
    // A carrier of four pixels: 16 cycles over the panel, the object turned back by it.
    let order = spectrum[seen.grid.width - 16];
    let efficiency = f64::from(order.norm_sqr()) / (seen.grid.len() as f64).powi(2);
    assert!((efficiency * PI * PI - 1.0).abs() < 1e-3, "{efficiency}");
}
