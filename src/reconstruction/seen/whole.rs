//! All the light of a panel, as an eyepiece, a camera or the bench behind a relay takes it in.
//!
//! In focus is the plane z: there the field is the panel's, carried by the exact angular spectrum, and each cell of the picture
//! holds the mean intensity of the part of the plane that is seen in it.

use super::Look;
use super::eye_plane::Sight;
use crate::error::{Error, Result};
use crate::field::{Complex64, Fft2, Field, Grid, fast_length};
use crate::progress::Progress;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Most samples of a plane: 2 GB, and as much again while it is transformed.
const MOST: usize = 1 << 27;

/// For each cell of an axis the samples that it holds, by their place from the panel's first, with their share of its mean.
type Shares = Vec<Vec<(i64, f64)>>;

fn shares(from: impl Fn(usize) -> [f64; 2], cells: usize) -> Shares {
    let one = |cell: usize| {
        let [a, b] = from(cell);
        // Sample k stands for k − ½ … k + ½.
        let (low, high) = (a.min(b) + 0.5, a.max(b) + 0.5);
        let samples = low.floor() as i64..high.ceil() as i64;
        let share = |k: i64| (high.min(k as f64 + 1.0) - low.max(k as f64)) / (high - low);
        samples.map(|k| (k, share(k))).collect()
    };
    (0..cells).map(one).collect()
}

/// Intensity on the retina at a look: mean |u|² of each cell.
///
/// # Errors
/// [`Error::OutOfRange`] for a focus so far that the plane cannot be sampled; [`Error::Interrupted`].
pub(super) fn on_retina(field: &Field, sight: &Sight, look: &Look, progress: &Progress) -> Result<Vec<f64>> {
    let (panel, retina) = (field.grid, &sight.retina);
    // What the eye sees through q stands at p + (q − p)·s/Z.
    let spread = (sight.distance - look.focus) / sight.distance;
    let (p, half) = (look.pupil, [0.5 * retina.pitch_x, 0.5 * retina.pitch_y]);
    let x = |q: f64| panel.column(p.x + (q - p.x) * spread);
    let y = |q: f64| panel.row(p.y + (q - p.y) * spread);
    let columns = shares(|c| [retina.x(c) - half[0], retina.x(c) + half[0]].map(x), retina.width);
    let rows = shares(|r| [retina.y(r) - half[1], retina.y(r) + half[1]].map(y), retina.height);

    // Room for what is seen and for the cone that a pixel sends: what leaves the plane on one side does not come in at the other
    // where it is seen.
    let room = |shares: &Shares, side: usize, pitch: f64| {
        let places = || shares.iter().flatten().map(|(k, _)| *k);
        let (first, last) = (places().fold(0, i64::min), places().fold(side as i64 - 1, i64::max));
        let sine = (0.5 * field.wavelength / pitch).min(0.7);
        let reach = (1.1 * look.focus.abs() * sine / (1.0 - sine * sine).sqrt() / pitch).min(MOST as f64).ceil() as i64;
        (side as i64 - first).max(last + 1) as usize + reach as usize
    };
    let (width, height) = (room(&columns, panel.width, panel.pitch_x), room(&rows, panel.height, panel.pitch_y));
    if width.saturating_mul(height) > MOST {
        let what = format_args!("{} m", look.focus);
        return Err(Error::out_of_range("focus", what, "is too far from the panel for all of its light"));
    }
    let space = Grid::new(fast_length(width, 1, &[1]), fast_length(height, 1, &[1]), panel.pitch_x, panel.pitch_y)?;
    let mut samples = vec![Complex64::new(0.0, 0.0); space.len()];
    for (line, own) in samples.chunks_mut(space.width).zip(field.samples.chunks(panel.width)) {
        line.iter_mut().zip(own).for_each(|(to, u)| *to = Complex64::new(u.re.into(), u.im.into()));
    }
    let wave = 1.0 / field.wavelength;
    let squares: Vec<f64> = (0..space.height).map(|k| space.frequency_y(k).powi(2)).collect();
    let transfer = |column: usize, samples: &mut [Complex64]| {
        let along = space.frequency_x(column).powi(2);
        for (u, square) in samples.iter_mut().zip(&squares) {
            let left = wave * wave - along - square;
            *u *= if left > 0.0 {
                Complex64::cis(TAU * (look.focus * (left.sqrt() - wave)).fract())
            } else {
                Complex64::new(0.0, 0.0)
            };
        }
    };
    let plan = Fft2::new(space.width, space.height);
    plan.filter(&mut samples, panel.height, space.height, transfer, progress);
    progress.check()?;
    let index = |k: i64, side: usize| k.rem_euclid(side as i64) as usize;
    let mut out = vec![0.0; retina.len()];
    out.par_chunks_mut(retina.width).zip(&rows).for_each(|(out, rows)| {
        for (out, columns) in out.iter_mut().zip(&columns) {
            let line = |k: i64| -> f64 {
                let line = &samples[index(k, space.height) * space.width..][..space.width];
                columns.iter().map(|(k, share)| share * line[index(*k, space.width)].norm_sqr()).sum()
            };
            *out = rows.iter().map(|(k, share)| share * line(*k)).sum();
        }
    });
    Ok(out)
}
