//! What an eye sees of an encoded frame when it focuses elsewhere: against the light field, by the judge.

use crate::encode::ViewEncoding;
use crate::field::Grid;
use crate::light_field::{Layer, LightField, Look, Retina, Viewer};
use crate::panel::{PanelProfile, Setup};
use crate::pipeline::{self, Bench};
use crate::points::{Channel, Multiplexing, SubFrames};
use crate::progress::Progress;
use crate::reconstruction::Colour;
use crate::reconstruction::seen::Judge;
use glam::DVec2;

const NEAR: f64 = -0.1;
const FAR: f64 = -0.15;

fn setup() -> Setup {
    Setup::new(PanelProfile::phase(1920, 1080, 8e-6, 8, 632.8e-9).expect("panel"), None).expect("setup")
}

/// Pictures that should be seen and pictures that are, on one lattice.
struct Looked {
    retina: Grid,
    wanted: Vec<Vec<f32>>,
    seen: Vec<Vec<f32>>,
}

fn look(layers: &[Layer], viewer: &Viewer, count: usize, steps: usize, looks: Vec<Look>) -> Looked {
    let (setup, progress) = (setup(), Progress::new());
    let retina = Retina::of(viewer, &setup.grid, setup.wavelength).expect("retina");
    let half = 0.5 * DVec2::new(setup.grid.extent_x(), setup.grid.extent_y());
    let eyes = retina.eyes(viewer).expect("eyes");
    let light = LightField::of_layers(layers, eyes, retina.window(half).expect("window")).expect("views");
    let sub_frames = (count > 1).then(|| SubFrames::new(count, Multiplexing::Phases, 1).expect("sub-frames"));
    let settings = pipeline::Settings { sub_frames, ..pipeline::Settings::default() };
    let exposures = pipeline::exposures(&setup, &settings, None);
    let view = ViewEncoding { iterations: Some(steps), ..ViewEncoding::default() };
    let found = pipeline::views(&light, viewer, &exposures, &setup, &view, &[], &progress).expect("frames");
    let colour = Colour::of(None, setup.wavelength, Channel::Luminance);
    let number = looks.len();
    let judge = Judge::new(&light, viewer, colour, looks, &progress).expect("judge");
    let mut seen = judge.begin();
    for encoded in found.iter().flatten().flat_map(|viewed| &viewed.frames) {
        let lit = pipeline::light(&encoded.frame, &Bench::default(), &progress).expect("light");
        seen.add(&judge, &lit.field, lit.settings.aperture.as_ref(), 0, &progress).expect("seen");
    }
    Looked {
        retina: *judge.retina(),
        wanted: (0..number).map(|look| judge.wanted(look).luminance().values).collect(),
        seen: (0..number).map(|look| judge.seen(&seen, look).luminance().values).collect(),
    }
}

/// A pupil that moves 5 mm within an eye box of 10 × 2 mm with three frames sees near and far shift against each other as in the
/// light field, from wherever it starts.
#[test]
fn near_and_far_shift_against_each_other_as_in_the_light_field() {
    // Bars 0.8 mm wide, near above and far below.
    let bars = |p: DVec2, above: bool| (p.y > 0.0) == above && p.x.abs() < 5e-3 && (p.x / 1.6e-3).rem_euclid(1.0) < 0.5;
    let layers = [
        Layer::new(NEAR, |_| 1.0, move |p| if bars(p, true) { 1.0 } else { 0.0 }),
        Layer::new(FAR, move |p| if bars(p, false) { 0.9 } else { 0.1 }, |_| 1.0),
    ];
    let viewer = Viewer { eye_box: DVec2::new(10e-3, 2e-3), ..Viewer::default() };
    // Every half millimetre of the box.
    const MOVED: usize = 10;
    let look_at = |i: usize| Look { pupil: DVec2::new(0.5e-3 * (i as f64 - MOVED as f64), 0.0), focus: -0.12 };
    let looks = (0..=2 * MOVED).map(look_at).collect();
    let found = look(&layers, &viewer, 3, 120, looks);
    let retina = &found.retina;
    // By how far a part of the picture is displaced: seen = s·wanted − d·wanted′ with the smallest squares.
    let displaced = |look: usize, rows: std::ops::Range<usize>| {
        let (wanted, seen) = (&found.wanted[look], &found.seen[look]);
        let (mut ww, mut wd, mut dd, mut ws, mut ds) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for row in rows {
            for column in retina.width / 4..3 * retina.width / 4 {
                let at = |picture: &[f32], column: usize| f64::from(picture[row * retina.width + column]);
                let w = at(wanted, column);
                let slope = (at(wanted, column + 1) - at(wanted, column - 1)) / (2.0 * retina.pitch_x);
                let s = at(seen, column);
                (ww, wd, dd) = (ww + w * w, wd + w * slope, dd + slope * slope);
                (ws, ds) = (ws + w * s, ds + slope * s);
            }
        }
        let determinant = ww * dd - wd * wd;
        let (scale, d) = ((ws * dd - ds * wd) / determinant, (ds * ww - ws * wd) / determinant);
        -d / scale
    };
    let (near, far) = (retina.height * 3 / 10..retina.height * 9 / 20, retina.height * 11 / 20..retina.height * 7 / 10);
    let moved = |from: usize, rows: &std::ops::Range<usize>| {
        displaced(from + MOVED, rows.clone()) - displaced(from, rows.clone())
    };
    // On the plane of the panel a thing at z moves with the pupil by −z/(Z − z) of its way.
    let shift = |z: f64| 5e-3 * -z / (viewer.eye.z - z);
    let parallax = shift(FAR) - shift(NEAR);
    for from in 0..=MOVED {
        let error = (moved(from, &far) - moved(from, &near)) / parallax;
        println!("from {:.1} mm: {:.1} % of {:.0} µm", 0.5 * from as f64 - 5.0, 100.0 * error, 1e6 * parallax);
        assert!(error.abs() < 0.05, "from {from}: {error}");
    }
}

/// An edge out of focus is as wide as it should be, and does not ring.
#[test]
fn an_edge_out_of_focus_is_blurred_as_in_the_light_field() {
    let layers =
        [Layer::new(NEAR, |_| 0.8, |p| if p.x > 0.3e-3 { 1.0 } else { 0.0 }), Layer::new(FAR, |_| 0.2, |_| 1.0)];
    let viewer = Viewer::default();
    let looks = [FAR, NEAR].map(|focus| Look { pupil: DVec2::ZERO, focus }).to_vec();
    let found = look(&layers, &viewer, 1, 150, looks);
    let retina = &found.retina;
    // The mean of the rows in the middle half of the picture, across the edge.
    let profile = |picture: &[f32]| -> Vec<f64> {
        let rows = retina.height / 4..3 * retina.height / 4;
        let mean = |column: usize| {
            rows.clone().map(|row| f64::from(picture[row * retina.width + column])).sum::<f64>() / rows.len() as f64
        };
        let from = retina.column(-1.8e-3) as usize;
        (from..=retina.column(2.2e-3) as usize).map(mean).collect()
    };
    let (wanted, seen) = (profile(&found.wanted[0]), profile(&found.seen[0]));
    let level = |values: &[f64], dark: bool| {
        let ends = if dark { &values[..values.len() / 5] } else { &values[4 * values.len() / 5..] };
        ends.iter().sum::<f64>() / ends.len() as f64
    };
    let width = |values: &[f64]| {
        let (low, high) = (level(values, true), level(values, false));
        let crossing = |share: f64| {
            let limit = low + share * (high - low);
            let at = values.windows(2).position(|pair| pair[0] < limit && pair[1] >= limit).expect("an edge");
            at as f64 + (limit - values[at]) / (values[at + 1] - values[at])
        };
        (crossing(0.85) - crossing(0.15)) * retina.pitch_x
    };
    let (width_wanted, width_seen) = (width(&wanted), width(&seen));
    let edge = level(&wanted, false) - level(&wanted, true);
    // Beside the slope, where the light field is within a tenth of what it is far away; on the slope the width judges.
    let [dark, bright] = [true, false].map(|side| level(&wanted, side));
    let off = |beside: bool| {
        let is_beside = |w: f64| (w - dark).min(bright - w) < 0.1 * edge;
        let pairs = wanted.iter().zip(&seen).filter(|(w, _)| is_beside(**w) == beside);
        pairs.map(|(w, s)| (s - w).abs() / edge).fold(0.0, f64::max)
    };
    let (ringing, slope) = (off(true), off(false));
    println!(
        "blur: {:.0} µm, {:.0} µm wanted; ringing {ringing:.3}, on the slope {slope:.3}",
        1e6 * width_seen,
        1e6 * width_wanted
    );
    assert!((width_seen / width_wanted - 1.0).abs() < 0.1, "{width_seen}, not {width_wanted}");
    assert!(ringing < 0.03 && slope < 0.05, "{ringing} {slope}");
    // In focus the same edge is as sharp as the pupil's diffraction lets it be, λZ/D = 95 µm.
    let sharp = width(&profile(&found.seen[1]));
    assert!(sharp < 1.3 * 95e-6, "{sharp}");
}

/// Phases of a frame that showed something else are no better a start than none, and are not taken: on a panel small enough for a test.
#[test]
fn going_on_from_another_picture_is_no_worse_than_beginning_anew() {
    let progress = Progress::new();
    let setup = Setup::new(PanelProfile::phase(640, 400, 8e-6, 8, 632.8e-9).expect("panel"), None).expect("setup");
    let viewer = Viewer::default();
    let retina = Retina::of(&viewer, &setup.grid, setup.wavelength).expect("retina");
    let half = 0.5 * DVec2::new(setup.grid.extent_x(), setup.grid.extent_y());
    let (eyes, window) = (retina.eyes(&viewer).expect("eyes"), retina.window(half).expect("window"));
    // Bars across that turn.
    let light = |turn: f64| {
        let bars = move |p: DVec2| {
            if (p.rotate(DVec2::from_angle(turn)).x / 0.9e-3).rem_euclid(1.0) < 0.5 { 1.0 } else { 0.05 }
        };
        let layers = [Layer::new(NEAR, bars, |_| 1.0)];
        LightField::of_layers(&layers, eyes, window).expect("views")
    };
    let exposures = pipeline::exposures(&setup, &pipeline::Settings::default(), None);
    let found = |turn: f64, iterations: Option<usize>, start: &[Vec<f32>]| {
        let view = ViewEncoding { iterations, ..ViewEncoding::default() };
        let found =
            pipeline::views(&light(turn), &viewer, &exposures, &setup, &view, start, &progress).expect("frames");
        found.into_iter().flatten().next().expect("one laser")
    };
    let before = found(0.0, Some(12), &[]);
    let last = |viewed: &crate::encode::view::Viewed| *viewed.report.psnr.last().expect("checked");
    for (turn, steps) in [(0.8, Some(6)), (0.01, Some(6)), (0.8, None)] {
        let (warm, cold) = (found(turn, steps, &before.wishes), found(turn, steps, &[]));
        println!("turned by {turn}: {:.1?} dB, anew {:.1?} dB", warm.report.psnr, cold.report.psnr);
        assert!(last(&warm) > last(&cold) - 0.3, "turned by {turn}: {} dB, anew {} dB", last(&warm), last(&cold));
        if turn > 0.1 {
            assert_eq!(warm.report.iterations, cold.report.iterations);
        } else {
            assert!(warm.report.psnr[0] > cold.report.psnr[0] + 3.0, "a small move is gone on with");
        }
    }
}
