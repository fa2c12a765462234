//! Views on another lattice of pixels: cubic where pixels become finer, means over areas where they become coarser.

use super::{LightField, codes::put};
use crate::error::Result;
use crate::field::Grid;
use glam::Vec3;
use rayon::prelude::*;

/// Which old samples make a new one, with what weight.
type Taps = Vec<Vec<(usize, f32)>>;

/// Catmull & Rom's cubic, at a distance in samples.
fn cubic(x: f64) -> f64 {
    let x = x.abs();
    if x < 1.0 {
        1.0 + x * x * (1.5 * x - 2.5)
    } else if x < 2.0 {
        2.0 - x * (4.0 - x * (2.5 - 0.5 * x))
    } else {
        0.0
    }
}

/// Taps of `count` new samples `step` old ones apart, the first at the old coordinate `first`; there are `old` old ones, and
/// nothing beyond them.
fn taps(count: usize, first: f64, step: f64, old: usize) -> Taps {
    let wide = step.max(1.0);
    (0..count)
        .map(|i| {
            let at = first + i as f64 * step;
            // The part of the new pixel that lies on old ones.
            let (low, high) = ((at - 0.5 * step).max(-0.5), (at + 0.5 * step).min(old as f64 - 0.5));
            let part = ((high - low) / step).max(0.0);
            if part <= 0.0 {
                return Vec::new();
            }
            // Old pixels are cells of one value: a coarser pixel is their mean over its area.
            let area = |j: f64| ((at + 0.5 * step).min(j + 0.5) - (at - 0.5 * step).max(j - 0.5)).max(0.0);
            let weight = |j: f64| if step > 1.0 { area(j) } else { cubic(j - at) };
            let reach = (at - 2.0 * wide).floor() as i64..=(at + 2.0 * wide).ceil() as i64;
            let mut taps: Vec<(usize, f64)> = Vec::new();
            for j in reach {
                let weight = weight(j as f64);
                let inside = j.clamp(0, old as i64 - 1);
                if weight == 0.0 || (step > 1.0 && inside != j) {
                    continue;
                }
                match taps.last_mut().filter(|last| last.0 == inside as usize) {
                    Some(last) => last.1 += weight,
                    None => taps.push((inside as usize, weight)),
                }
            }
            let sum: f64 = taps.iter().map(|tap| tap.1).sum();
            taps.into_iter().map(|(j, weight)| (j, (weight / sum * part) as f32)).collect()
        })
        .collect()
}

impl LightField {
    /// The same views through the pixels of another window; what lies beyond the old one is dark.
    ///
    /// # Errors
    /// As [`LightField::black`].
    pub fn resampled(&self, window: Grid) -> Result<Self> {
        let old = self.window;
        let mut out = Self::black(self.eyes, window, self.channels.len())?;
        let across = taps(window.width, old.column(window.x(0)), window.pitch_x / old.pitch_x, old.width);
        let down = taps(window.height, old.row(window.y(0)), window.pitch_y / old.pitch_y, old.height);
        let view = |(index, mut codes): (usize, Vec<&mut [u16]>)| {
            let codes_of = |c: usize| self.view(c.min(self.channels.len() - 1), index);
            let from = [0, 1, 2].map(codes_of);
            let light = |i: usize| Vec3::from_array(from.map(|codes| self.radiance(codes[i])));
            let lines: Vec<Vec<Vec3>> = (0..old.height)
                .map(|row| {
                    let at = |taps: &Vec<(usize, f32)>| taps.iter().map(|(j, w)| light(row * old.width + j) * *w).sum();
                    across.iter().map(at).collect()
                })
                .collect();
            let at = |taps: &Vec<(usize, f32)>, c: usize| -> Vec3 { taps.iter().map(|(j, w)| lines[*j][c] * *w).sum() };
            // The cubic passes below black and above the brightest beside steep edges.
            let clean = |light: Vec3| light.clamp(Vec3::ZERO, Vec3::splat(self.peak));
            let new: Vec<Vec3> =
                down.iter().flat_map(|taps| (0..window.width).map(move |c| clean(at(taps, c)))).collect();
            put(&new, None, &mut codes)
        };
        let peaks: Vec<f32> = out.pieces(window.len()).into_par_iter().enumerate().map(view).collect();
        out.level(&peaks, window.len());
        out.depth = self.depth;
        out.middle_depths = self.middle_depths.as_ref().map(|depths| {
            let nearest = |at: f64, count: usize| at.round().clamp(0.0, (count - 1) as f64) as usize;
            let depth = |i: usize| {
                let (x, y) = (window.x(i % window.width), window.y(i / window.width));
                depths[nearest(old.row(y), old.height) * old.width + nearest(old.column(x), old.width)]
            };
            (0..window.len()).map(depth).collect()
        });
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light_field::EyeGrid;
    use glam::DVec2;

    /// Two views of one channel with smooth tones, and a light field of them.
    fn smooth(window: Grid) -> LightField {
        let eyes = EyeGrid { distance: 0.6, center: DVec2::ZERO, spacing: 1e-3, columns: 1, rows: 2 };
        let mut field = LightField::black(eyes, window, 1).expect("field");
        let tone = |i: usize, view: usize| tone(window.x(i % window.width), window.y(i / window.width), view);
        let codes = (0..2 * window.len()).map(|i| LightField::code(tone(i % window.len(), i / window.len()), 1.0));
        field.channels[0] = codes.collect();
        field.middle_depths = Some((0..window.len()).map(|i| i as f32).collect());
        field
    }

    fn tone(x: f64, y: f64, view: usize) -> f32 {
        (0.5 + 0.3 * (500.0 * x + view as f64).sin() + 0.15 * (700.0 * y).cos()) as f32
    }

    #[test]
    fn tones_stay_on_finer_coarser_and_shifted_lattices() {
        let old = Grid::new(90, 61, 0.2e-3, 0.25e-3).expect("window");
        let field = smooth(old);
        for (width, height, pitch, center) in
            [(130, 91, 0.12e-3, [0.5e-3, -0.2e-3]), (41, 30, 0.42e-3, [0.0; 2]), (90, 61, 0.2e-3, [0.1e-3, 0.0])]
        {
            let new = Grid::new(width, height, pitch, pitch).expect("window").centered_at(center);
            let found = field.resampled(new).expect("resampled");
            assert_eq!((found.peak, found.eyes, found.window), (1.0, field.eyes, new));
            for (view, i) in [0, 1].into_iter().flat_map(|view| (0..new.len()).map(move |i| (view, i))) {
                let (x, y) = (new.x(i % width), new.y(i / width));
                if x.abs() < 8e-3 && y.abs() < 6.6e-3 {
                    let light = found.radiance(found.view(0, view)[i]);
                    assert!((light - tone(x, y, view)).abs() < 4e-3, "{width} at {x}, {y}: {light}");
                }
            }
        }
        let same = field.resampled(old).expect("resampled");
        assert!(same.channels[0].iter().zip(&field.channels[0]).all(|(a, b)| a.abs_diff(*b) <= 1));
        assert_eq!(same.middle_depths, field.middle_depths);
    }

    #[test]
    fn light_is_kept_when_pixels_become_coarser_and_beyond_it_is_dark() {
        let field = smooth(Grid::new(90, 60, 1e-4, 1e-4).expect("window"));
        // 7/3 pixels in one, and a window wider than the old one.
        let new = Grid::new(60, 40, 7e-4 / 3.0, 7e-4 / 3.0).expect("window");
        let found = field.resampled(new).expect("resampled");
        let sum = |f: &LightField| f.view(0, 1).iter().map(|code| f64::from(f.radiance(*code))).sum::<f64>();
        let ratio = sum(&found) * (49.0 / 9.0) / sum(&field);
        assert!((ratio - 1.0).abs() < 1e-4, "{ratio}");
        assert!(found.view(0, 0)[..60 * 6].iter().all(|code| *code == 0));
    }
}
