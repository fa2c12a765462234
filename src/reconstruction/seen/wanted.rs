//! What should be seen: a light field through a pupil, as the mean of its views there, each sheared for the focus.

use super::Look;
use super::eye_plane::{Sight, contrast_transfer, disc_share};
use crate::error::{Error, Result};
use crate::field::{Complex64, Fft2, Grid, fast_length};
use crate::light_field::LightField;
use crate::progress::Progress;
use glam::DVec2;
use rayon::prelude::*;

/// Part of a pupil that may lie outside of the light field's views.
const OUTSIDE: f64 = 0.02;

/// Four neighbours of a place between samples, and their weights in Catmull and Rom's spline; beyond the border the border's
/// value goes on. Nothing outside of the border pixels.
type Taps = ([usize; 4], [f64; 4]);

fn taps(place: f64, count: usize) -> Taps {
    if !(place >= -0.5 && place <= count as f64 - 0.5) {
        return ([0; 4], [0.0; 4]);
    }
    let t = place - place.floor();
    let at = |k: i64| (place.floor() as i64 + k).clamp(0, count as i64 - 1) as usize;
    let weights = [
        0.5 * t * (t * (2.0 - t) - 1.0),
        0.5 * (t * t * (3.0 * t - 5.0) + 2.0),
        0.5 * t * (t * (4.0 - 3.0 * t) + 1.0),
        0.5 * t * t * (t - 1.0),
    ];
    ([at(-1), at(0), at(1), at(2)], weights)
}

/// The views in a look's pupil: index, share of the pupil's area, place from the pupil's middle.
///
/// # Errors
/// [`Error::OutOfRange`] where the views do not cover the pupil.
fn views(field: &LightField, sight: &Sight, look: &Look) -> Result<Vec<(usize, f64, DVec2)>> {
    let (eyes, radius) = (&field.eyes, 0.5 * sight.pupil);
    let cell = DVec2::splat(eyes.spacing);
    let from_middle = |index: usize| eyes.position(index).truncate() - look.pupil;
    let share = |index: usize| disc_share(from_middle(index), cell, radius) * cell.x * cell.y;
    let inside: Vec<_> = (0..eyes.count()).map(|i| (i, share(i), from_middle(i))).filter(|v| v.1 > 0.0).collect();
    // All of the light comes by all views.
    let covered: f64 = inside.iter().map(|v| v.1).sum();
    if radius.is_finite() && covered < (1.0 - OUTSIDE) * std::f64::consts::PI * radius * radius {
        let place = format_args!("{:.2} mm, {:.2} mm", 1e3 * look.pupil.x, 1e3 * look.pupil.y);
        return Err(Error::out_of_range("pupil", place, "lies outside of the light field's views"));
    }
    Ok(inside.into_iter().map(|(i, share, d)| (i, share / covered, d)).collect())
}

/// Radiance of each channel through the pupil of a look on a lattice of the panel's plane, without diffraction.
pub(super) fn through_pupil(field: &LightField, sight: &Sight, look: &Look, lattice: &Grid) -> Result<Vec<Vec<f64>>> {
    let shear = 1.0 - sight.distance * sight.curvature(look);
    let views = views(field, sight, look)?;
    let moved: Vec<_> = views.into_iter().map(|(index, share, d)| (index, share, shear * d)).collect();
    let mut channels = sheared(field, moved.iter().copied(), lattice);
    if sight.pupil.is_infinite() {
        let whole = shear.abs() * field.eyes.spacing * DVec2::new(field.eyes.columns as f64, field.eyes.rows as f64);
        let through = vignetting(field, &moved, whole, lattice);
        channels.iter_mut().for_each(|channel| channel.iter_mut().zip(&through).for_each(|(v, t)| *v *= t));
    }
    Ok(channels)
}

/// Few views stand for all light: a place leaves the window of one after another, in steps. What makes of these steps the share of
/// the light, spread over `whole` on the panel's plane, that comes through the window.
fn vignetting(field: &LightField, moved: &[(usize, f64, DVec2)], whole: DVec2, lattice: &Grid) -> Vec<f64> {
    let window = &field.window;
    let half = 0.5 * DVec2::new(window.extent_x(), window.extent_y());
    let factor = |i: usize| {
        let q = DVec2::new(lattice.x(i % lattice.width), lattice.y(i / lattice.width)) - DVec2::from(window.center);
        let stepped: f64 = moved.iter().filter(|(_, _, d)| (q + *d).abs().cmple(half).all()).map(|v| v.1).sum();
        let cut = (q + 0.5 * whole).min(half) - (q - 0.5 * whole).max(-half);
        let smooth = (cut / whole.max(DVec2::splat(1e-12))).clamp(DVec2::ZERO, DVec2::ONE);
        if stepped > 0.0 { smooth.x * smooth.y / stepped } else { 1.0 }
    };
    (0..lattice.len()).into_par_iter().map(factor).collect()
}

/// Radiance of each channel in the view of the middle, on a lattice; no finer than that of the views.
pub(super) fn pinhole(field: &LightField, retina: &Grid) -> Result<Vec<Vec<f64>>> {
    let (fine, times) = lattice(field, retina)?;
    let channels = sheared(field, std::iter::once((field.middle(), 1.0, DVec2::ZERO)), &fine);
    let mean = |channel: &Vec<f64>| -> Vec<f64> {
        let cell = |row: usize, column: usize| {
            let rows =
                (row * times..(row + 1) * times).flat_map(|r| &channel[r * fine.width + column * times..][..times]);
            rows.sum::<f64>() / (times * times) as f64
        };
        (0..retina.len()).map(|i| cell(i / retina.width, i % retina.width)).collect()
    };
    Ok(channels.iter().map(mean).collect())
}

/// Sum of views (index, weight, by how much they are moved on the panel's plane) on a lattice, of each channel.
fn sheared(field: &LightField, views: impl Iterator<Item = (usize, f64, DVec2)>, lattice: &Grid) -> Vec<Vec<f64>> {
    let window = &field.window;
    let views: Vec<_> = views
        .map(|(index, share, d)| {
            let columns: Vec<Taps> =
                (0..lattice.width).map(|c| taps(window.column(lattice.x(c) + d.x), window.width)).collect();
            let rows: Vec<Taps> =
                (0..lattice.height).map(|r| taps(window.row(lattice.y(r) + d.y), window.height)).collect();
            (index, share, columns, rows)
        })
        .collect();
    let one = |channel: usize| {
        let mut out = vec![0.0; lattice.len()];
        out.par_chunks_mut(lattice.width).enumerate().for_each(|(row, out)| {
            let mut line = vec![0.0; window.width];
            for (index, share, columns, rows) in &views {
                let view = field.view(channel, *index);
                let (from, weights) = rows[row];
                line.fill(0.0);
                for (from, weight) in from.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0) {
                    let codes = &view[from * window.width..(from + 1) * window.width];
                    for (sum, &code) in line.iter_mut().zip(codes) {
                        *sum += weight * f64::from(field.radiance(code));
                    }
                }
                for (sum, (from, weights)) in out.iter_mut().zip(columns) {
                    *sum += share * (0..4).map(|k| weights[k] * line[from[k]]).sum::<f64>();
                }
            }
        });
        out
    };
    (0..field.channels.len()).map(one).collect()
}

/// The lattice on which a light field is looked at: the retina's, or an odd number of times as fine where the views are.
pub(super) fn lattice(field: &LightField, retina: &Grid) -> Result<(Grid, usize)> {
    let finer = (retina.pitch_x / field.window.pitch_x).max(retina.pitch_y / field.window.pitch_y);
    // Views that are up to one and a half times as fine fold nothing that the pupil resolves.
    let times = if finer < 1.5 { 1 } else { (finer.ceil() as usize / 2 * 2 + 1).min(9) };
    let (pitch_x, pitch_y) = (retina.pitch_x / times as f64, retina.pitch_y / times as f64);
    let grid = Grid::new(retina.width * times, retina.height * times, pitch_x, pitch_y)?;
    Ok((grid.centered_at(retina.center), times))
}

/// Blurs radiance by the pupil's diffraction at a wavelength, and keeps every `times`th sample: what the retina samples.
pub(super) fn diffracted(
    values: &[f32],
    lattice: &Grid,
    times: usize,
    sight: &Sight,
    wavelength: f64,
    progress: &Progress,
) -> Vec<f32> {
    let (width, height) = (lattice.width, lattice.height);
    // Half the picture of darkness round it: the Airy pattern's tails do not come in again on the other side.
    let padded = |side: usize| fast_length(side + side / 2, 1, &[1]);
    let space = Grid { width: padded(width), height: padded(height), ..*lattice };
    let mut samples = vec![Complex64::new(0.0, 0.0); space.len()];
    for (line, values) in samples.chunks_mut(space.width).zip(values.chunks(width)) {
        line.iter_mut().zip(values).for_each(|(sample, value)| sample.re = f64::from(*value));
    }
    let cut_off = sight.pupil / (wavelength * sight.distance);
    let rows: Vec<f64> = (0..space.height).map(|k| space.frequency_y(k)).collect();
    let transfer = |column: usize, samples: &mut [Complex64]| {
        let fx = space.frequency_x(column);
        for (sample, fy) in samples.iter_mut().zip(&rows) {
            *sample *= contrast_transfer(fx.hypot(*fy) / cut_off);
        }
    };
    Fft2::new(space.width, space.height).filter(&mut samples, height, height, transfer, progress);
    let first = times / 2;
    (0..height / times)
        .flat_map(|row| {
            (0..width / times).map(move |column| (row * times + first) * space.width + column * times + first)
        })
        .map(|at| samples[at].re.max(0.0) as f32)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spline_goes_through_its_samples_and_keeps_parabolas() {
        let value = |x: f64| 0.3 * x * x - 2.0 * x + 1.0;
        for place in [3.0, 3.25, 4.5, 6.9] {
            let (at, weights) = taps(place, 12);
            let seen: f64 = at.iter().zip(weights).map(|(&at, weight)| weight * value(at as f64)).sum();
            assert!((seen - value(place)).abs() < 1e-12, "{place}: {seen}");
        }
        assert_eq!(taps(-0.6, 12).1, [0.0; 4]);
        assert_eq!(taps(11.6, 12).1, [0.0; 4]);
        assert!((taps(11.4, 12).1.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
