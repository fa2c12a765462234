//! A field onto other pixels: of another pitch by Fourier interpolation, of another size by a border or a cut.

use super::{Aperture, ScaledPropagator, Settings};
use crate::error::Result;
use crate::field::{Complex32, Field, Grid};
use crate::progress::Progress;
use crate::units::{show_length, show_pitch};

/// A field on other pixels, and what was done to bring it there.
#[derive(Clone, Debug)]
pub struct Resampled {
    /// The field.
    pub field: Field,
    /// What was done, with its numbers, one line each.
    pub notes: Vec<String>,
    /// Part of the light that is lost: by frequencies that the pitch cannot carry, and beyond the edges.
    pub lost: f64,
}

/// Whether two pitches are one: they agree in six digits.
pub fn is_same_pitch(a: &Grid, b: &Grid) -> bool {
    let same = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b.abs();
    same(a.pitch_x, b.pitch_x) && same(a.pitch_y, b.pitch_y)
}

/// Brings a field onto the pixels of a grid; its middle stays where it is.
///
/// Another pitch is reached by the trigonometric polynomial through the samples, u(x) = Σ_k U_k exp(i2πf_k x), less the
/// frequencies beyond 1/(2·pitch) of the new lattice. At the same pitch samples are copied, to the nearest pixel; places beyond
/// the field are dark.
///
/// # Errors
/// As [`ScaledPropagator::new`].
pub fn resample(field: &Field, grid: &Grid, progress: &Progress) -> Result<Resampled> {
    let mut notes = Vec::new();
    let same = is_same_pitch(&field.grid, grid);
    let out = if same {
        copied(field, grid)
    } else {
        let settings = Settings { band_limit: false, ..Settings::default() };
        let aperture = Aperture::centered(
            grid.limit_x().min(field.grid.limit_x()) * (1.0 + 1e-9),
            grid.limit_y().min(field.grid.limit_y()) * (1.0 + 1e-9),
        );
        let planned = ScaledPropagator::new(field.grid, *grid, field.wavelength, 0.0, settings)?;
        let out = planned.propagate_through(field, Some(&aperture), progress)?;
        let [from, to] = [field.grid.pitch(), grid.pitch()].map(show_pitch);
        notes.push(format!("pitch {from} to {to} by Fourier interpolation"));
        out
    };
    for (name, [old, new], pitch) in [
        ("columns", [field.grid.extent_x(), grid.extent_x()], grid.pitch_x),
        ("rows", [field.grid.extent_y(), grid.extent_y()], grid.pitch_y),
    ] {
        let pixels = ((new - old).abs() / pitch).round() as usize;
        if pixels > 0 {
            let what = if new > old { "dark border of" } else { "cut off:" };
            let [a, b] = [pixels / 2, pixels.div_ceil(2)];
            notes.push(format!("{what} {a} and {b} {name}, {} on {}", show_length(old), show_length(new)));
        }
    }
    let light = |field: &Field| field.energy() * field.grid.pitch_x * field.grid.pitch_y;
    let before = light(field);
    let lost = if before > 0.0 { (1.0 - light(&out) / before).max(0.0) } else { 0.0 };
    Ok(Resampled { field: out, notes, lost })
}

/// Samples of the same pitch, each at the nearest pixel.
fn copied(field: &Field, grid: &Grid) -> Field {
    let (from, mut out) = (&field.grid, Field::zeros(*grid, field.wavelength));
    // A half pixel goes to the left and up, as for a side that is odd on one of even length.
    let nearest = |at: f64| (at + 0.5 - 1e-6).floor() as i64;
    let (left, top) = (nearest(grid.column(from.x(0))), nearest(grid.row(from.y(0))));
    for (row, line) in field.samples.chunks_exact(from.width).enumerate() {
        let Some(to) = usize::try_from(top + row as i64).ok().filter(|to| *to < grid.height) else { continue };
        let first = usize::try_from(-left).unwrap_or(0).min(from.width);
        let begin = usize::try_from(left).unwrap_or(0).min(grid.width);
        let count = (from.width - first).min(grid.width - begin);
        let target: &mut [Complex32] = &mut out.samples[to * grid.width + begin..][..count];
        target.copy_from_slice(&line[first..first + count]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A beam aside of the middle, tilted: smooth, and far from the edges.
    fn beam(grid: Grid) -> Field {
        let sample = |i: usize| {
            let (x, y) = (grid.x(i % grid.width) - 40e-6, grid.y(i / grid.width) + 30e-6);
            Complex32::from_polar((-(x * x + y * y) / 60e-6f64.powi(2)).exp() as f32, (3e4 * x - 2e4 * y) as f32)
        };
        Field::new(grid, 532e-9, (0..grid.len()).map(sample).collect()).expect("field")
    }

    #[test]
    fn another_pitch_and_size_show_the_same_wave_at_the_same_places() {
        let field = beam(Grid::new(101, 90, 3.74e-6, 3.74e-6).expect("grid"));
        for (width, height, pitch) in [(64, 50, 8e-6), (96, 80, 5.5e-6), (300, 260, 2e-6)] {
            let grid = Grid::new(width, height, pitch, pitch).expect("grid");
            let found = resample(&field, &grid, &Progress::new()).expect("resampled");
            let error = crate::field::relative_error(&found.field.samples, &beam(grid).samples);
            assert!(error < 2e-3, "{pitch}: {error}");
            assert!(found.lost < 1e-2, "{}", found.lost);
            assert!(found.notes[0].contains("3.74um to"), "{:?}", found.notes);
        }
    }

    #[test]
    fn frequencies_that_a_coarse_pitch_cannot_carry_are_lost_and_counted() {
        let grid = Grid::new(128, 128, 4e-6, 4e-6).expect("grid");
        // 0.4 cycles a pixel: beyond the limit of twice the pitch.
        let wave = |i: usize| Complex32::cis((std::f64::consts::TAU * 0.4 * (i % 128) as f64) as f32);
        let field = Field::new(grid, 532e-9, (0..grid.len()).map(wave).collect()).expect("field");
        let coarse = Grid::new(64, 64, 8e-6, 8e-6).expect("grid");
        assert!(resample(&field, &coarse, &Progress::new()).expect("resampled").lost > 0.9);
    }

    #[test]
    fn at_one_pitch_samples_are_copied_about_the_middle() {
        let small = Grid::new(4, 3, 8e-6, 8e-6).expect("grid");
        let samples: Vec<_> = (0..12).map(|i| Complex32::new(1.0 + i as f32, 0.0)).collect();
        let field = Field::new(small, 532e-9, samples.clone()).expect("field");
        let large = Grid::new(8, 7, 8e-6, 8e-6).expect("grid");
        let wide = resample(&field, &large, &Progress::new()).expect("resampled");
        assert_eq!(wide.field.samples[2 * 8 + 2..][..4], samples[..4]);
        assert_eq!(wide.field.samples[4 * 8 + 2..][..4], samples[8..]);
        assert_eq!(wide.field.energy(), field.energy());
        assert!(wide.notes[0].contains("dark border of 2 and 2 columns"), "{:?}", wide.notes);
        let back = resample(&wide.field, &small, &Progress::new()).expect("resampled");
        assert_eq!(back.field, field);
        assert!(back.notes[0].contains("cut off: 2 and 2 columns"), "{:?}", back.notes);
        // An odd side on an even one: half a pixel aside, nothing lost.
        let odd = resample(&field, &Grid::new(5, 4, 8e-6, 8e-6).expect("grid"), &Progress::new()).expect("resampled");
        assert_eq!(odd.field.energy(), field.energy());
    }
}
