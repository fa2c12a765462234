//! A curve that differs over the panel: its cell gap does, and so does the phase of one and the same level.
//!
//! The panel is cut into equal rectangles, row by row from the upper left. Each curve holds at the middle of its rectangle;
//! between middles phases are interpolated along both axes, beyond the outermost they stay.

use super::drive_curve::{DriveCurve, Modulation};
use crate::error::Result;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Level → phase for each pixel of a panel, at one wavelength.
#[derive(Clone, Debug)]
pub struct PixelCurve {
    /// The curve of all pixels, or the mean of the regions'.
    pub mean: DriveCurve,
    regions: Option<Regions>,
}

/// Unwrapped phases [rad] of each region's levels, piston of the first region's level 0.
#[derive(Clone, Debug)]
struct Regions {
    columns: usize,
    rows: usize,
    phases: Vec<Vec<f64>>,
    width: usize,
    height: usize,
}

/// The curves about one pixel, with their weights.
struct Mix<'a> {
    parts: [(&'a [f64], f64); 4],
}

impl Mix<'_> {
    fn phase(&self, level: usize) -> f64 {
        self.parts.iter().map(|(phases, weight)| phases[level] * weight).sum()
    }
}

impl Regions {
    fn mix(&self, column: usize, row: usize) -> Mix<'_> {
        let place = |at: usize, size: usize, parts: usize| {
            let x = ((at as f64 + 0.5) / size as f64 * parts as f64 - 0.5).clamp(0.0, parts as f64 - 1.0);
            let low = (x as usize).min(parts - 1);
            (low, (low + 1).min(parts - 1), x - low as f64)
        };
        let (left, right, u) = place(column, self.width, self.columns);
        let (upper, lower, v) = place(row, self.height, self.rows);
        let at = |column: usize, row: usize| self.phases[row * self.columns + column].as_slice();
        Mix {
            parts: [
                (at(left, upper), (1.0 - u) * (1.0 - v)),
                (at(right, upper), u * (1.0 - v)),
                (at(left, lower), (1.0 - u) * v),
                (at(right, lower), u * v),
            ],
        }
    }

    /// The level nearest on the circle among those of the first turn, and its miss. Curves rise or fall throughout.
    fn nearest(&self, column: usize, row: usize, wish: f64) -> (u16, f64) {
        let mix = self.mix(column, row);
        let levels = self.phases[0].len();
        let zero = mix.phase(0);
        let sign = if mix.phase(levels - 1) >= zero { 1.0 } else { -1.0 };
        let rise = |level: usize| sign * (mix.phase(level) - zero);
        let wished = (sign * (wish - zero)).rem_euclid(TAU);
        // The last level at or below the wish, within the first turn.
        let (mut low, mut high) = (0, levels);
        while high - low > 1 {
            let middle = (low + high) / 2;
            if rise(middle) <= wished { low = middle } else { high = middle }
        }
        let next = if low + 1 < levels { low + 1 } else { 0 };
        let miss = |level: usize| sign * ((rise(level) - wished + PI).rem_euclid(TAU) - PI);
        let candidates = [low, next, 0];
        let best = candidates.into_iter().min_by(|&a, &b| miss(a).abs().total_cmp(&miss(b).abs())).unwrap_or(low);
        (best as u16, miss(best))
    }
}

impl PixelCurve {
    /// One curve for all pixels.
    pub(super) fn uniform(curve: DriveCurve) -> Self {
        Self { mean: curve, regions: None }
    }

    /// A curve for each of `columns × rows` regions of a panel of `width × height` pixels.
    pub(super) fn regional(
        mean: DriveCurve,
        columns: usize,
        rows: usize,
        phases: Vec<Vec<f64>>,
        width: usize,
        height: usize,
    ) -> Self {
        Self { mean, regions: Some(Regions { columns, rows, phases, width, height }) }
    }

    /// Whether pixels differ.
    pub fn differs(&self) -> bool {
        self.regions.is_some()
    }

    /// Unwrapped phase [rad] or amplitude of a level at a pixel.
    pub fn value(&self, column: usize, row: usize, level: u16) -> f64 {
        let level = usize::from(level).min(self.mean.levels() - 1);
        match &self.regions {
            Some(regions) => regions.mix(column, row).phase(level),
            None => self.mean.values()[level],
        }
    }

    /// The level nearest to a phase [rad] on the circle, or to an amplitude, at a pixel, and its signed miss.
    pub fn nearest(&self, column: usize, row: usize, wish: f64) -> (u16, f64) {
        match &self.regions {
            Some(regions) => regions.nearest(column, row, wish),
            None => self.mean.nearest(wish),
        }
    }

    /// Unwrapped phase [rad] or amplitude of a frame's levels, row by row. Levels beyond the panel's are taken as its last.
    pub fn values(&self, levels: &[u16], width: usize) -> Result<Vec<f32>> {
        let table: Vec<f32> = self.mean.values().iter().map(|&v| v as f32).collect();
        let mut out = vec![0.0; levels.len()];
        out.par_chunks_mut(width).zip(levels.par_chunks(width)).enumerate().for_each(|(row, (out, levels))| {
            for (column, (value, &level)) in out.iter_mut().zip(levels).enumerate() {
                *value = match &self.regions {
                    Some(_) => self.value(column, row, level) as f32,
                    None => table[usize::from(level).min(table.len() - 1)],
                };
            }
        });
        Ok(out)
    }

    /// What the levels modulate.
    pub fn modulation(&self) -> Modulation {
        self.mean.modulation()
    }
}

#[cfg(test)]
mod tests {
    use crate::panel::{Curve, PanelProfile, Pattern, PhasePattern, Response, Simulation, drive, simulate};
    use crate::progress::Progress;
    use std::f64::consts::{PI, TAU};
    use std::path::Path;

    fn profile(sign: &str) -> PanelProfile {
        let text = format!(
            "name = \"t\"\nmaker = \"t\"\nkind = \"phase-lcos\"\nwidth = 31\nheight = 18\npitch = \"8um\"\nbits = 8\n\
             fill_factor = 1.0\nwavelengths = [\"532nm\"]\nphase_sign = \"{sign}\"\n[[response]]\nkind = \"linear\"\n\
             levels_for_2pi = 256\n"
        );
        PanelProfile::parse(&text, Path::new("t.toml")).expect("profile")
    }

    #[test]
    fn each_pixel_gets_the_level_of_its_own_place() {
        for sign in ["increasing", "decreasing"] {
            let mut profile = profile(sign);
            // 2.2π at the upper left to 1.9π at the lower right; the corners' curves are bent, too.
            let curves: Vec<Curve> = [2.2, 2.1, 2.0, 2.15, 2.05, 1.9]
                .map(|range| Curve::Polynomial { coefficients: vec![0.1, range * PI - 0.4, 0.4] })
                .to_vec();
            profile.responses =
                vec![Response { wavelength: None, curve: Curve::Regional { columns: 3, rows: 2, curves } }];
            profile.responses[0].curve.check(256, Path::new("t")).expect("right");
            let grid = profile.grid().expect("grid");
            let phase: Vec<f32> = (0..grid.len()).map(|i| (0.37 * i as f64).rem_euclid(TAU) as f32).collect();
            let pattern = PhasePattern::new(grid, 532e-9, phase.clone()).expect("pattern");
            let driven = drive(&Pattern::Phase(pattern), None, &profile).expect("drive");
            let light = simulate(&driven.frame, &Simulation::default(), &Progress::new()).expect("simulate");
            let (curve, _) = profile.pixel_curve(532e-9).expect("curve");
            let mut worst = 0.0f64;
            for (i, (u, &wish)) in light.samples.iter().zip(&phase).enumerate() {
                let (column, row) = (i % 31, i / 31);
                let seen = f64::from(u.arg());
                let miss = |seen: f64| ((seen - f64::from(wish) + PI).rem_euclid(TAU) - PI).abs();
                // Of all levels none of the first turn comes nearer.
                let best = (0..256).map(|l| miss(curve.value(column, row, l))).fold(f64::INFINITY, f64::min);
                assert!(miss(seen) < best + 1e-3 || miss(seen) < 0.02, "{sign} {column} {row}: {} {best}", miss(seen));
                worst = worst.max(miss(seen));
            }
            // Half a step is π/256; at the lower right the range ends 0.1π short of a turn.
            assert!(worst < 0.06 * PI, "{sign}: {worst}");
            assert!(driven.rms_error < 0.05, "{sign}: {}", driven.rms_error);
        }
    }

    #[test]
    fn regions_that_do_not_fit_are_refused() {
        let line = |range: f64| Curve::Polynomial { coefficients: vec![0.0, range] };
        let check = |columns, rows, curves| Curve::Regional { columns, rows, curves }.check(256, Path::new("t.toml"));
        assert!(check(2, 1, vec![line(6.0), line(6.5)]).is_ok());
        for (columns, rows, curves, word) in [
            (2, 2, vec![line(6.0)], "4 regions"),
            (0, 0, vec![], "regions"),
            (2, 1, vec![line(6.0), line(-6.0)], "region 1"),
            (1, 1, vec![Curve::LinearAmplitude], "region 0"),
            (1, 1, vec![Curve::Polynomial { coefficients: vec![0.0, 6.0, -6.0] }], "turns back"),
        ] {
            let error = check(columns, rows, curves).expect_err(word).to_string();
            assert!(error.contains(word), "{error}");
        }
    }
}
