//! The descent's slopes against differences of its loss; panels with faults; the same bits for any number of threads.

use super::*;
use crate::encode::view::optics::Optics;
use crate::encode::view::pupils::Pupils;
use crate::encode::view::whole::Planes;
use crate::encode::view::{ViewEncoding, ViewTarget};
use crate::error::Error;
use crate::light_field::retina::Targets;
use crate::light_field::{LightField, Pupil, Retina, Viewer, layers};
use crate::panel::{Curve, Illumination, PanelProfile, Response, Setup};
use glam::{DVec2, DVec3};

const WAVELENGTH: f64 = 532e-9;

fn viewer(eye_box: DVec2) -> Viewer {
    Viewer { eye: DVec3::new(1e-3, -0.6e-3, 0.25), pupil: Pupil::Diameter(3e-3), eye_box }
}

fn setup(bits: u8, fill_factor: f64, crosstalk: f64) -> Setup {
    let mut profile = PanelProfile::phase(270, 190, 8e-6, 8, WAVELENGTH).expect("panel");
    (profile.bits, profile.fill_factor, profile.crosstalk) = (bits, fill_factor, crosstalk);
    let levels_for_2pi = f64::from(1u32 << bits);
    profile.responses = vec![Response { wavelength: None, curve: Curve::Linear { levels_for_2pi } }];
    Setup::new(profile, Some(WAVELENGTH)).expect("setup")
}

/// The occluding layers, as small as the panel.
fn views(viewer: &Viewer, setup: &Setup) -> (LightField, Retina) {
    let retina = Retina::of(viewer, &setup.grid, WAVELENGTH).expect("retina");
    let half = 0.5 * DVec2::new(setup.grid.extent_x(), setup.grid.extent_y());
    let eyes = retina.eyes(viewer).expect("eyes");
    let layers = layers::occlusion(setup.grid.extent_x(), [-0.02, -0.05]);
    (LightField::of_layers(&layers, eyes, retina.window(half).expect("window")).expect("views"), retina)
}

/// Slopes of a loss that are looked at.
struct Slopes<'a, S> {
    sight: &'a S,
    model: &'a PanelModel,
    viewer: &'a Viewer,
    looks: Vec<Look>,
    /// Largest relative difference.
    least: f64,
}

impl<S: Sight> Slopes<'_, S> {
    /// Steps of the loss along its slopes are as large as these say.
    fn check(&self, count: usize, what: &str) {
        let progress = Progress::new();
        let problem = Problem { sight: self.sight, model: self.model, progress: &progress };
        // Waves that converge on the eye, a little bent: where it is dark that should be bright the loss has a kink.
        let (grid, viewer) = (self.model.grid, self.viewer);
        let wave = |i: usize, n: usize| {
            let (x, y) = (grid.x(i % 270) - viewer.eye.x, grid.y(i / 270) - viewer.eye.y);
            let lens = -std::f64::consts::PI / (WAVELENGTH * viewer.eye.z) * (x * x + y * y);
            (lens + 0.3 * (9e3 * x + n as f64).sin()) as f32
        };
        let start: Vec<Vec<f32>> = (0..count).map(|n| (0..grid.len()).map(|i| wave(i, n)).collect()).collect();
        let empty = || [vec![0.0; grid.len()], vec![0.0; grid.len()]];
        let frames = |step: f32, way: &[Vec<f32>]| -> Vec<Frame> {
            let wish = |(w, d): (&Vec<f32>, &Vec<f32>)| w.iter().zip(d).map(|(w, d)| w + step * d).collect();
            start.iter().zip(way).map(wish).map(|wish| Frame { wish, moments: empty() }).collect()
        };
        let looks = Looks::new(self.sight, self.looks.clone());
        let prepared = looks.prepared(&[0, 1, 2]);
        let weight = |look: &&S::Ready| match self.sight.weights(look) {
            [] => self.sight.wanted(look).len() as f64,
            weights => weights.iter().map(|w| f64::from(*w)).sum(),
        };
        let samples: f64 = prepared.iter().map(weight).sum();
        let loss = |frames: &[Frame]| problem.look(frames, &prepared).expect("look").loss;
        // One step from empty moments leaves a tenth of the slopes in the first of them.
        let mut moved = frames(0.0, &start);
        let unit = loss(&moved).sqrt() / (0.1 * samples);
        let settings = Descent { iterations: 1, rate: 0.1, looks: 3, seed: 1, smooth: false };
        problem.step(&mut moved, &prepared, &settings, 0).expect("step");
        let slope = |frame: &Frame| frame.moments[0].iter().map(|m| f64::from(*m) * unit).collect();
        let slopes: Vec<Vec<f64>> = moved.iter().map(slope).collect();
        let rms = (slopes.iter().flatten().map(|s| s * s).sum::<f64>() / (count * grid.len()) as f64).sqrt();
        // Along the slopes of all pixels, of a side of the panel, of the last frame, and of a checkerboard's fields.
        for part in 0..4 {
            let inside = |n: usize, i: usize| match part {
                0 => true,
                1 => i % 270 < 135,
                2 => n + 1 == count && i / 270 < 95,
                _ => (i % 270 / 20 + i / 270 / 20).is_multiple_of(2),
            };
            let along =
                |n: usize, i: usize| if inside(n, i) { (slopes[n][i] / rms).clamp(-3.0, 3.0) as f32 } else { 0.0 };
            let way: Vec<Vec<f32>> = (0..count).map(|n| (0..grid.len()).map(|i| along(n, i)).collect()).collect();
            let step = 0.006;
            let difference = loss(&frames(step, &way)) - loss(&frames(-step, &way));
            let found = difference / (2.0 * f64::from(step));
            let dot = |(s, d): (&Vec<f64>, &Vec<f32>)| s.iter().zip(d).map(|(s, d)| s * f64::from(*d)).sum::<f64>();
            let expected: f64 = slopes.iter().zip(&way).map(dot).sum();
            let off = found / expected - 1.0;
            assert!(off.abs() < self.least, "{what}, {count} frames, part {part}: {off:e}");
        }
    }
}

/// A look at each of three depths, from places about the eye.
fn three_looks(viewer: &Viewer) -> Vec<Look> {
    let places = [(0.0, 0.0, -0.03), (0.3e-3, -0.2e-3, -0.05), (-0.3e-3, 0.2e-3, -0.02)];
    let look = |(x, y, focus): (f64, f64, f64)| Look { pupil: viewer.eye.truncate() + DVec2::new(x, y), focus };
    places.map(look).to_vec()
}

#[test]
fn slopes_are_those_of_the_loss() {
    // Where neighbours blend, a pixel that passes the end of its turn takes them along: a jump that no slope tells.
    for (count, fill_factor, crosstalk, least) in [(1, 1.0, 0.0, 1e-3), (2, 0.9, 0.0, 1e-3), (1, 0.93, 0.7, 0.1)] {
        let (viewer, setup) = (viewer(DVec2::new(4e-3, 1e-3)), setup(16, fill_factor, crosstalk));
        let (light, retina) = views(&viewer, &setup);
        let model = PanelModel::new(&setup.profile, WAVELENGTH, Illumination::Normal).expect("model");
        let optics = Optics::new(&setup.grid, &retina, WAVELENGTH);
        let progress = Progress::new();
        let targets = Targets::new(&retina, &light, WAVELENGTH, &progress).expect("targets");
        let sight = Pupils { optics: &optics, targets: &targets };
        let looks = three_looks(&viewer);
        let slopes = Slopes { sight: &sight, model: &model, viewer: &viewer, looks, least };
        slopes.check(count, &format!("fill {fill_factor}, crosstalk {crosstalk}"));
    }
}

#[test]
fn slopes_of_planes_are_those_of_the_loss() {
    for count in [1, 2] {
        let (viewer, setup) = (Viewer { pupil: Pupil::All, ..viewer(DVec2::ZERO) }, setup(16, 0.95, 0.0));
        let (light, retina) = views(&viewer, &setup);
        let model = PanelModel::new(&setup.profile, WAVELENGTH, Illumination::Normal).expect("model");
        let progress = Progress::new();
        let targets = Targets::new(&retina, &light, WAVELENGTH, &progress).expect("targets");
        let target =
            ViewTarget { light: &light, viewer: &viewer, retina: &retina, setup: &setup, wavelength: WAVELENGTH };
        let planes = Planes::new(&targets, &target).expect("planes");
        let looks = three_looks(&viewer);
        Slopes { sight: &planes, model: &model, viewer: &viewer, looks, least: 2e-3 }.check(count, "planes");
    }
}

#[test]
fn frames_improve_and_do_not_depend_on_threads() {
    let whole = Viewer { pupil: Pupil::All, ..viewer(DVec2::ZERO) };
    let cases = [(viewer(DVec2::ZERO), 1, 2.0), (viewer(DVec2::new(5e-3, 1e-3)), 2, 1.0), (whole, 2, 1.0)];
    for (viewer, count, gain) in cases {
        let setup = setup(8, 1.0, 0.0);
        let (light, retina) = views(&viewer, &setup);
        let target =
            ViewTarget { light: &light, viewer: &viewer, retina: &retina, setup: &setup, wavelength: WAVELENGTH };
        let encode = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
            let settings = ViewEncoding { iterations: Some(24), seed: 3 };
            pool.install(|| settings.encode(&target, count, None, &Progress::new())).expect("frames")
        };
        let (one, three) = (encode(1), encode(3));
        let levels = |viewed: &crate::encode::view::Viewed| -> Vec<Vec<u16>> {
            viewed.frames.iter().map(|encoded| encoded.frame.levels.clone()).collect()
        };
        assert!(levels(&one) == levels(&three) && one.frames.len() == count);
        let history = &one.report.psnr;
        assert!(history.windows(2).all(|pair| pair[1] >= pair[0]), "best so far: {history:?}");
        assert!(history[history.len() - 1] > history[0] + gain, "{history:?}");
        assert!(one.report.efficiency > 0.3, "{:?}", one.report);
        // From what was shown before it goes on.
        let again = ViewEncoding { iterations: Some(4), seed: 4 };
        let warm = again.encode(&target, count, Some(one.wishes.clone()), &Progress::new()).expect("frames");
        assert!(warm.report.psnr[0] > history[0] + 0.5 * gain, "{:?}", warm.report);
    }
}

#[test]
fn what_cannot_be_is_refused_and_a_stop_is_heard() {
    let (viewer, setup) = (viewer(DVec2::ZERO), setup(8, 1.0, 0.0));
    let (light, retina) = views(&viewer, &setup);
    let target = ViewTarget { light: &light, viewer: &viewer, retina: &retina, setup: &setup, wavelength: WAVELENGTH };
    let settings = ViewEncoding { iterations: Some(100_000), seed: 1 };
    let progress = Progress::new();
    assert!(settings.encode(&target, 0, None, &progress).is_err());
    assert!(settings.encode(&target, 1, Some(vec![vec![0.0; 5]]), &progress).is_err());
    let dark = LightField { channels: vec![vec![0; light.channels[0].len()]], ..light.clone() };
    assert!(settings.encode(&ViewTarget { light: &dark, ..target }, 1, None, &progress).is_err());
    let elsewhere = Viewer { eye: DVec3::new(0.0, 0.0, 0.3), ..viewer };
    assert!(
        settings
            .encode(
                &ViewTarget { viewer: &elsewhere, retina: &Retina { distance: 0.3, ..retina }, ..target },
                1,
                None,
                &progress
            )
            .is_err()
    );
    let stopped = std::thread::scope(|scope| {
        let work = scope.spawn(|| settings.encode(&target, 1, None, &progress));
        std::thread::sleep(std::time::Duration::from_millis(300));
        progress.stop();
        work.join().expect("no panic")
    });
    assert!(matches!(stopped, Err(Error::Interrupted)));
}
