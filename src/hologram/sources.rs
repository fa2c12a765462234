//! Points as the engines take them: checked, without dark ones, with what the panel can and cannot show of them.

use super::Cull;
use super::definition::Optics;
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::points::PointSource;
use crate::progress::Progress;
use rayon::prelude::*;

/// A sum over points, as all engines of it take it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PointSum<'a> {
    pub(crate) optics: &'a Optics,
    pub(crate) grid: &'a Grid,
    pub(crate) sources: &'a [PointWave],
    pub(crate) cull: Cull,
    pub(crate) progress: &'a Progress,
}

/// A point that shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PointWave {
    /// Position along x [m].
    pub(crate) x: f64,
    /// Position along y [m].
    pub(crate) y: f64,
    /// Distance from the panel, |z| [m].
    pub(crate) distance: f64,
    /// +1 for a diverging wave (z ≤ 0), −1 for one that converges in front of the panel.
    pub(crate) sign: f64,
    /// Amplitude a.
    pub(crate) amplitude: f64,
    /// Initial phase [turns], reduced to [0, 1).
    pub(crate) turns: f64,
}

impl PointWave {
    /// Smallest and largest Δ from the source to a pixel, along x and y [m].
    pub(crate) fn span(&self, grid: &Grid) -> [[f64; 2]; 2] {
        [[grid.x(0) - self.x, grid.x(grid.width - 1) - self.x], [grid.y(grid.height - 1) - self.y, grid.y(0) - self.y]]
    }

    /// Sines of the smallest and largest angle to a pixel along each axis, no further than ±`limit`.
    pub(crate) fn sines(&self, grid: &Grid, limit: [f64; 2]) -> [[f64; 2]; 2] {
        let spans = self.span(grid);
        [0, 1].map(|axis| {
            spans[axis].map(|d| {
                let r = (d * d + self.distance * self.distance).sqrt();
                if r > 0.0 { (d / r).clamp(-limit[axis], limit[axis]) } else { 0.0 }
            })
        })
    }
}

/// Root mean square of sin θ_x·sin θ_y over the pixels that the sources light: what errors of separable forms go with.
pub(crate) fn tilt(sources: &[PointWave], grid: &Grid, limit: [f64; 2]) -> f64 {
    let square = |[low, high]: [f64; 2]| (low * low + low * high + high * high) / 3.0;
    let one = |s: &PointWave| s.sines(grid, limit).map(square).iter().product::<f64>();
    let parts: Vec<f64> = sources.par_chunks(PART).map(|part| part.iter().map(one).sum()).collect();
    (parts.iter().sum::<f64>() / sources.len().max(1) as f64).sqrt()
}

/// The largest wave on its axis, amplitude/distance, against the root mean square of all over the pixels that they
/// light: what errors that go with the largest of a group do to the whole. Infinite where nothing is lit.
pub(crate) fn contrast(sources: &[PointWave], grid: &Grid, limit: [f64; 2]) -> f64 {
    let one = |s: &PointWave| {
        // Pixels in units that do not matter, times the light on each.
        let lit: f64 = s.sines(grid, limit).map(|[low, high]| high - low).iter().product();
        let strongest = s.amplitude.abs() / s.distance;
        [lit * s.amplitude * s.amplitude, lit * s.distance * s.distance, strongest]
    };
    let add = |a: [f64; 3], b: [f64; 3]| [a[0] + b[0], a[1] + b[1], a[2].max(b[2])];
    let parts: Vec<[f64; 3]> = sources.par_chunks(PART).map(|part| part.iter().map(one).fold([0.0; 3], add)).collect();
    let [light, pixels, strongest] = parts.into_iter().fold([0.0; 3], add);
    if light > 0.0 { strongest / (light / pixels).sqrt() } else { f64::INFINITY }
}

/// Sources that one task sums over: fixed, so that sums do not depend on the number of threads.
const PART: usize = 4096;

/// Checks points and leaves out those of amplitude zero; refuses what is not finite, naming the point.
pub(crate) fn sources(points: &[PointSource]) -> Result<Vec<PointWave>> {
    let one = |(i, p): (usize, &PointSource)| {
        if !(p.position.is_finite() && p.amplitude.is_finite() && p.phase.is_finite()) {
            let what = format!(
                "point {i}: position {} m, amplitude {}, phase {} rad must be finite numbers",
                p.position, p.amplitude, p.phase
            );
            return Err(Error::parameter("points", what));
        }
        let turns = p.phase / std::f64::consts::TAU;
        let source = PointWave {
            x: p.position.x,
            y: p.position.y,
            distance: p.position.z.abs(),
            sign: if p.position.z > 0.0 { -1.0 } else { 1.0 },
            amplitude: f64::from(p.amplitude),
            turns: turns - turns.floor(),
        };
        Ok((p.amplitude != 0.0).then_some(source))
    };
    // Parts keep their order, so the first bad point is the one that is named.
    let parts: Vec<Result<Vec<PointWave>>> = points
        .par_chunks(PART)
        .enumerate()
        .map(|(part, points)| {
            points.iter().enumerate().filter_map(|(i, p)| one((part * PART + i, p)).transpose()).collect()
        })
        .collect();
    let mut sources = Vec::with_capacity(points.len());
    for part in parts {
        sources.append(&mut part?);
    }
    Ok(sources)
}

/// What of the points' light the panel can send out.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Coverage {
    /// Points in all.
    pub points: usize,
    /// Points of amplitude zero, left out.
    pub dark: usize,
    /// Points whose cone meets no pixel: the panel cannot diffract their light to its place.
    pub unreached: usize,
    /// Part of the light in the points' cones that passes beside the panel, 0 to 1.
    pub light_outside: f64,
    /// Point–pixel pairs inside the cones (of all pixels without culling).
    pub pairs: f64,
}

impl Coverage {
    /// Counts; the light of a cone is taken as even over the frequencies |f| ≤ b, which is its power to (s/b)² ≈ 0.5 %.
    pub(crate) fn of(points: usize, sum: &PointSum) -> Self {
        let PointSum { optics, grid, sources, cull, .. } = *sum;
        let edges = grid.edges();
        let slopes = [0, 1].map(|axis| optics.cone(axis, 1.0));
        let one = |source: &PointWave| {
            let power = source.amplitude * source.amplitude;
            let (mut part, mut pixels) = (1.0, 1.0);
            for (axis, position) in [source.x, source.y].into_iter().enumerate() {
                let [low, high] = edges[axis].map(|edge| edge - position);
                // Half a pixel more, so that a point on the panel reaches the pixel that it stands on.
                let cone = (slopes[axis] * source.distance).max(0.5 * optics.pitch[axis]);
                let span = (high.min(cone) - low.max(-cone)).max(0.0);
                pixels *=
                    if cull == Cull::None { (high - low) / optics.pitch[axis] } else { span / optics.pitch[axis] };
                let middle = optics.taper[axis].middle;
                let frequency = |d: f64| {
                    let r = (d * d + source.distance * source.distance).sqrt();
                    if r > 0.0 { (d / (r * optics.wavelength)).clamp(-middle, middle) } else { 0.0 }
                };
                part *= (frequency(high) - frequency(low)) / (2.0 * middle);
            }
            [power, power * part, pixels, f64::from(u8::from(pixels == 0.0))]
        };
        let add = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|i| a[i] + b[i]);
        let parts: Vec<[f64; 4]> =
            sources.par_chunks(PART).map(|part| part.iter().map(one).fold([0.0; 4], add)).collect();
        let [all, inside, pairs, unreached] = parts.into_iter().fold([0.0; 4], add);
        let unreached = unreached as usize;
        let mut coverage = Self { points, dark: points - sources.len(), unreached, pairs, light_outside: 0.0 };
        coverage.light_outside = if all > 0.0 { (1.0 - inside / all).clamp(0.0, 1.0) } else { 0.0 };
        coverage
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn point(x: f64, z: f64, amplitude: f32) -> PointSource {
        PointSource { position: DVec3::new(x, 0.0, z), amplitude, phase: 7.0 }
    }

    #[test]
    fn bad_points_are_refused_by_number_and_dark_ones_left_out() {
        let found = sources(&[point(0.0, 0.1, 0.0), point(0.0, -0.1, 2.0)]).expect("sources");
        assert_eq!(found.len(), 1);
        assert!((found[0].turns - (7.0 / std::f64::consts::TAU - 1.0)).abs() < 1e-15 && found[0].sign == 1.0);
        for bad in [point(f64::NAN, 0.1, 1.0), point(0.0, f64::INFINITY, 1.0), point(0.0, 0.1, f32::NAN)] {
            let message = sources(&[point(0.0, 0.1, 1.0), bad]).unwrap_err().to_string();
            assert!(message.contains("point 1"), "{message}");
        }
    }

    #[test]
    fn light_that_misses_the_panel_is_counted() {
        let grid = Grid::new(100, 100, 8e-6, 8e-6).expect("grid");
        let optics = Optics::new(&grid, 633e-9).expect("optics");
        let of = |points: &[PointSource]| {
            let (sources, progress) = (sources(points).expect("sources"), Progress::new());
            let sum =
                PointSum { optics: &optics, grid: &grid, sources: &sources, cull: Cull::Soft, progress: &progress };
            Coverage::of(points.len(), &sum)
        };
        // At 1 mm the cone (±40 µm) lies inside the panel (±400 µm); 2 mm aside it misses it; on the edge half is lost.
        assert!(of(&[point(0.0, 1e-3, 1.0)]).light_outside < 1e-12);
        let missed = of(&[point(2e-3, 1e-3, 1.0), point(0.0, 1e-3, 1.0), point(0.0, 1e-3, 0.0)]);
        assert_eq!((missed.unreached, missed.dark, missed.points), (1, 1, 3));
        assert!((missed.light_outside - 0.5).abs() < 1e-12);
        assert!((of(&[point(4e-4, 1e-3, 1.0)]).light_outside - 0.5).abs() < 1e-9);
        // On the panel itself: one pixel, all light inside.
        let on = of(&[point(1e-5, 0.0, 1.0)]);
        assert!(on.light_outside < 1e-12 && (on.pairs - 1.0).abs() < 1e-9);
    }

    #[test]
    fn contrast_is_that_of_the_strongest_wave_over_what_is_lit() {
        let grid = Grid::new(100, 100, 8e-6, 8e-6).expect("grid");
        let optics = Optics::new(&grid, 633e-9).expect("optics");
        let limit = [0, 1].map(|axis| optics.wavelength * optics.taper[axis].limit);
        let of = |points: &[PointSource]| contrast(&sources(points).expect("sources"), &grid, limit);
        let even = of(&[point(0.0, 0.2, 2.0), point(1e-5, -0.2, -2.0)]);
        assert!((even - 1.0).abs() < 1e-6, "{even}");
        // One of two twice as bright: 2/√2.5.
        let uneven = of(&[point(0.0, 0.2, 1.0), point(0.0, 0.2, 2.0)]);
        assert!((uneven - 2.0 / 2.5f64.sqrt()).abs() < 1e-6, "{uneven}");
        // A bright one beside the cone counts with its whole wave, but lights nothing; nor does anything alone there.
        let beside = of(&[point(0.0, 0.2, 1.0), point(0.1, 0.2, 50.0)]);
        assert!(beside > 49.0, "{beside}");
        assert_eq!(of(&[point(0.1, 0.2, 1.0)]), f64::INFINITY);
    }
}
