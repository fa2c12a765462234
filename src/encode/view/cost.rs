//! What frames for an eye box cost, and what to expect of them, before they are made.

use super::ViewEncoding;
use crate::field::Complex32;
use crate::field::fft::Fft1;
use crate::light_field::{Pupil, Retina, Viewer};
use crate::panel::Setup;
use rayon::prelude::*;
use serde::Serialize;
use std::time::Instant;

/// Width of the cell of an eye box that one frame fills well, over that of all the light that the panel sends there, λZ/pitch:
/// measured with 1, 3, 9 and 24 frames on scenes 100 to 150 mm behind a panel (`holodrive bench views`).
const CELL: f64 = 0.078;

/// What frames for a viewer cost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ViewCost {
    /// Frames that the eye box asks for: fewer show speckle, or are wrong at its edges.
    pub frames: usize,
    /// Steps of the descent.
    pub iterations: usize,
    /// Time that the descent for the frames that were asked takes on this machine [s]: by count of its transforms, at the rate
    /// that they have now.
    pub seconds: f64,
    /// What to expect of as many frames as the box asks for.
    pub expected: Expected,
}

/// Likeness that was measured of three occluding layers behind a panel of 1920 × 1080 pixels of 8 µm, by 632.8 nm at 0.6 m.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Expected {
    /// PSNR of amplitudes, mean over the looks; where all light is taken in, of what is in focus [dB].
    pub psnr: f64,
    /// SSIM, likewise.
    pub ssim: f64,
}

/// The number of frames that a viewer's eye box asks for: fewer show speckle, or are wrong at its edges.
pub fn frames_for(viewer: &Viewer, setup: &Setup) -> usize {
    let cell = |pitch: f64| CELL * setup.wavelength * viewer.eye.z / pitch;
    let count = |side: f64, pitch: f64| (side / cell(pitch)).ceil().max(1.0) as usize;
    count(viewer.eye_box.x, setup.grid.pitch_x) * count(viewer.eye_box.y, setup.grid.pitch_y)
}

/// Measured by `holodrive bench views` on its layers with the usual steps, for ±1 mm, 10 × 2 mm and 10 × 10 mm, and with 80 steps
/// for 22 × 14 mm; up to so many cells of the eye box, PSNR and SSIM.
const MEASURED: [(usize, f64, f64); 4] = [(1, 35.2, 0.95), (3, 29.6, 0.90), (9, 28.9, 0.93), (usize::MAX, 28.4, 0.83)];
/// The same of an eye whose place is known, and of all of the light.
const KNOWN: (f64, f64) = (39.5, 0.96);
/// What is in focus of Cornell's room, the worst that was measured, after 300 steps.
const WHOLE: (f64, f64) = (31.7, 0.74);

/// Time of a step, checks included, over that of its large transforms at the rate of transforms in the cache, as measured: through
/// pupils, whose pictures are made and pulled at beside them, and on planes.
const BESIDE: [f64; 2] = [7.0, 3.1];

impl ViewEncoding {
    /// What `count` frames for a viewer cost, and what to expect.
    pub fn cost(&self, viewer: &Viewer, setup: &Setup, retina: &Retina, count: usize) -> ViewCost {
        let (frames, iterations) = (frames_for(viewer, setup), self.steps(viewer));
        let (psnr, ssim) = if viewer.pupil == Pupil::All {
            WHOLE
        } else if super::is_known(viewer) {
            KNOWN
        } else {
            let (_, psnr, ssim) = MEASURED.into_iter().find(|(most, ..)| frames <= *most).unwrap_or(MEASURED[3]);
            (psnr, ssim)
        };
        let step = self.work(viewer, setup, retina);
        let beside = BESIDE[usize::from(viewer.pupil == Pupil::All)];
        let seconds = beside * step * (iterations * count) as f64 / rate();
        ViewCost { frames, iterations, seconds, expected: Expected { psnr, ssim } }
    }

    /// Work of a step of one frame, n·log₂ n summed over its one-dimensional transforms of n samples.
    fn work(&self, viewer: &Viewer, setup: &Setup, retina: &Retina) -> f64 {
        let line = |n: f64| n * n.log2().max(1.0);
        let height = setup.grid.height as f64;
        let [x, y] = retina.padded.map(|n| n as f64);
        if viewer.pupil == Pupil::All {
            // Two pairs on a lattice that is half as wide again for a scene as deep as it is far.
            let (x, y) = (1.5 * x, 1.7 * y);
            return 4.0 * (y * line(x) + x * line(y));
        }
        let sent = setup.wavelength * viewer.eye.z / setup.grid.pitch_x;
        let columns = x * ((viewer.eye_box.x + retina.pupil) / sent).min(1.0);
        2.0 * (height * line(x) + columns * line(y))
    }
}

/// Work of transforms that all threads do in a second.
fn rate() -> f64 {
    const LENGTH: usize = 2048;
    const LINES: usize = 512;
    let plan = Fft1::<f32>::new(LENGTH);
    let mut lines = vec![Complex32::new(1.0, 0.0); LENGTH * LINES];
    let begin = Instant::now();
    lines.par_chunks_mut(16 * LENGTH).for_each_init(|| plan.scratch(), |scratch, lines| plan.forward(lines, scratch));
    (LINES * LENGTH) as f64 * (LENGTH as f64).log2() / begin.elapsed().as_secs_f64().max(1e-9)
}
