//! What an eye sees of the hidden bench's panel when it shows a frame made for that eye.

use crate::bench::HiddenBench;
use glam::DVec2;
use holodrive::encode::ViewEncoding;
use holodrive::field::{Complex32, Complex64, Field};
use holodrive::light_field::{Layer, LightField, Look, Retina, Viewer};
use holodrive::panel::{PanelProfile, Setup};
use holodrive::pipeline::{self, Bench};
use holodrive::points::Channel;
use holodrive::progress::Progress;
use holodrive::reconstruction::Colour;
use holodrive::reconstruction::seen::Judge;

/// PSNR [dB] of amplitudes on a perfect panel by the plain profile, and on the bench by the plain and by the calibrated profile.
/// `tilt` [rad at the borders] is how the bench's axis stands to the calibrated one.
pub(crate) fn seen(
    bench: &HiddenBench,
    plain: &PanelProfile,
    calibrated: &PanelProfile,
    tilt: [f64; 2],
    steps: usize,
) -> [f64; 3] {
    let progress = Progress::new();
    let viewer = Viewer::default();
    let setup = Setup::new(plain.clone(), None).expect("setup");
    let retina = Retina::of(&viewer, &setup.grid, setup.wavelength).expect("retina");
    let half = 0.5 * DVec2::new(setup.grid.extent_x(), setup.grid.extent_y());
    let window = retina.window(half).expect("window");
    // Bars before a bright wall that gets darker to one side.
    let bar = half.x / 4.0;
    let layers = [
        Layer::new(
            -0.1,
            |_| 1.0,
            move |p| if (p.x / bar).rem_euclid(2.0) < 0.6 && p.y.abs() < 0.7 * half.y { 1.0 } else { 0.0 },
        ),
        Layer::new(-0.15, move |p| (0.35 + 0.3 * p.y / half.y) as f32, |_| 1.0),
    ];
    let light = LightField::of_layers(&layers, retina.eyes(&viewer).expect("eyes"), window).expect("views");
    let exposures = pipeline::exposures(&setup, &pipeline::Settings::default(), None);
    let view = ViewEncoding { iterations: Some(steps), ..ViewEncoding::default() };
    let looks = vec![Look { pupil: DVec2::ZERO, focus: -0.1 }, Look { pupil: DVec2::ZERO, focus: -0.15 }];
    let count = looks.len();
    let colour = Colour::of(None, setup.wavelength, Channel::Luminance);
    let judge = Judge::new(&light, &viewer, colour, looks, &progress).expect("judge");
    let judged = |field: &Field| {
        let mut seen = judge.begin();
        seen.add(&judge, field, None, 0, &progress).expect("seen");
        let mut sums = [0.0f64; 4];
        let (mut most, mut pairs) = (0.0f64, Vec::new());
        for look in 0..count {
            let (wanted, seen) = (judge.wanted(look).luminance().values, judge.seen(&seen, look).luminance().values);
            for (w, s) in wanted.iter().zip(&seen) {
                let (w, s) = (f64::from(w.max(0.0)).sqrt(), f64::from(s.max(0.0)).sqrt());
                (sums[0], sums[1], most) = (sums[0] + w * s, sums[1] + s * s, most.max(w));
                pairs.push((w, s));
            }
        }
        let scale = sums[0] / sums[1];
        let error = pairs.iter().map(|(w, s)| (w - scale * s).powi(2)).sum::<f64>() / pairs.len() as f64;
        10.0 * (most * most / error).log10()
    };
    let frame = |profile: &PanelProfile| {
        let setup = Setup::new(profile.clone(), Some(bench.wavelength)).expect("setup");
        let found = pipeline::views(&light, &viewer, &exposures, &setup, &view, &[], &progress).expect("frames");
        found.into_iter().flatten().next().expect("one exposure").frames.remove(0).frame
    };
    let shown = |levels: &[u16]| {
        let mut pixels = bench.pixels(levels);
        for (i, u) in pixels.iter_mut().enumerate() {
            let at = bench.place((i % bench.width) as f64, (i / bench.width) as f64);
            *u *= Complex64::cis(tilt[0] * at[0] + tilt[1] * at[1]);
        }
        let samples = pixels.iter().map(|u| Complex32::new(u.re as f32, u.im as f32)).collect();
        Field::new(setup.grid, bench.wavelength, samples).expect("field")
    };
    let made = frame(plain);
    let perfect = judged(&pipeline::light(&made, &Bench::default(), &progress).expect("light").field);
    [perfect, judged(&shown(&made.levels)), judged(&shown(&frame(calibrated).levels))]
}
