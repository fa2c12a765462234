//! At which depth a field of unknown content is sharp: a sweep of planes.
//!
//! The figure of a plane is the contrast σ/μ of its intensity on cells that speckle is averaged over: light that gathers in
//! points, lines and areas has most of it. The first sweep takes the light near the axis only (a quarter of the directions that
//! the pitch carries), whose depth of focus is long and whose speckle is the same on all planes, from all of the panel, over
//! both sides of it; finer ones with more of the light follow about the best plane.

use super::{Picture, View, ViewSettings, intensity};
use crate::error::{Error, Result};
use crate::field::{Field, Grid};
use crate::progress::Progress;
use crate::propagation::resample;
use glam::DVec2;

/// Planes of the first sweep on each side of the panel.
const PLANES: usize = 32;
/// Planes of each finer sweep, and how many there are.
const FINER: usize = 6;
const ROUNDS: usize = 3;

/// Where a field is sharp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sharpest {
    /// Depth z [m].
    pub z: f64,
    /// Contrast there in the first sweep.
    pub contrast: f64,
    /// The median of the contrasts of the first sweep: that of planes out of focus.
    pub usual: f64,
}

/// Finds the plane on which the light of a field has the greatest contrast, from `range` = nearest to farthest distance from
/// the panel [m] on both sides of it.
///
/// # Errors
/// [`Error::Parameter`] for a range that is none; as [`intensity`].
pub fn sharpest(field: &Field, range: [f64; 2], settings: &ViewSettings, progress: &Progress) -> Result<Sharpest> {
    if !(range[0] > 0.0 && range[0] < range[1] && range[1].is_finite()) {
        let what =
            format!("[{}, {}] m must be the nearest and the farthest distance, both above zero", range[0], range[1]);
        return Err(Error::parameter("range", what));
    }
    // Of a small panel there is no light to spare.
    let part: usize = match field.grid.width.min(field.grid.height) {
        512.. => 4,
        256.. => 2,
        _ => 1,
    };
    let coarse = near_axis(field, part, progress)?;
    progress.start("focus", (2 * PLANES + ROUNDS * FINER) as u64);
    let step = (range[1] / range[0]).powf(1.0 / (PLANES - 1) as f64);
    let distances = (0..PLANES).map(|k| range[0] * step.powi(k as i32));
    let planes: Vec<f64> = distances.flat_map(|d| [-d, d]).collect();
    let (mut best, mut all) = ((0.0, f64::NEG_INFINITY), Vec::new());
    for &z in &planes {
        let found = contrast(&coarse, z, settings, progress)?;
        all.push(found);
        if found > best.1 {
            best = (z, found);
        }
    }
    all.sort_by(f64::total_cmp);
    let (usual, contrast_of_best) = (all[all.len() / 2], best.1);
    // About the best plane, with more of the light each time.
    let mut half = best.0.abs() * (step - 1.0);
    for round in 0..ROUNDS {
        let part = near_axis(field, (part >> round).max(1), progress)?;
        let from = best.0 - half;
        best.1 = f64::NEG_INFINITY;
        for k in 0..=FINER {
            let z = from + 2.0 * half * k as f64 / FINER as f64;
            let found = contrast(&part, z, settings, progress)?;
            if found > best.1 {
                best = (z, found);
            }
        }
        half *= 2.0 / FINER as f64;
    }
    Ok(Sharpest { z: best.0, contrast: contrast_of_best, usual })
}

/// The light that a pitch so many times as wide carries.
fn near_axis(field: &Field, part: usize, progress: &Progress) -> Result<Field> {
    let Grid { width, height, pitch_x, pitch_y, center } = field.grid;
    let pitch = [pitch_x, pitch_y].map(|pitch| pitch * part as f64);
    let grid = Grid::new((width / part).max(1), (height / part).max(1), pitch[0], pitch[1])?.centered_at(center);
    Ok(resample(field, &grid, progress)?.field)
}

/// σ/μ of the intensity on a plane, on cells of four samples a side.
fn contrast(field: &Field, z: f64, settings: &ViewSettings, progress: &Progress) -> Result<f64> {
    progress.check()?;
    let half = 0.5 * DVec2::new(field.grid.extent_x(), field.grid.extent_y());
    let (grid, values) = intensity(field, &View::Plane { z }, half, settings, progress)?;
    let cells = |side: usize| (side / 4).max(1);
    let cell = Picture::from_samples(&grid, &values, half, cells(grid.width), cells(grid.height));
    let count = cell.values.len() as f64;
    let mean = cell.values.iter().map(|v| f64::from(*v)).sum::<f64>() / count;
    let variance = cell.values.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / count;
    progress.advance(1);
    Ok(if mean > 0.0 { variance.sqrt() / mean } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hologram::{HologramSettings, compute, plan};
    use crate::points::PointSource;
    use crate::random::Random;
    use glam::DVec3;

    #[test]
    fn the_plane_of_points_is_found_on_either_side_of_the_panel() {
        let panel = Grid::new(320, 260, 8e-6, 8e-6).expect("panel");
        for z in [-0.08, 0.05, -0.013] {
            let point = |i: u64| PointSource {
                position: DVec3::new(1e-4 * (i % 9) as f64 - 4e-4, 1e-4 * (i / 9) as f64 - 3e-4, z),
                amplitude: 1.0,
                phase: Random::new(3, i).phase(),
            };
            let points: Vec<_> = (0..54).map(point).collect();
            let plan = plan(&points, &panel, 532e-9, &HologramSettings::default()).expect("plan");
            let field = compute(&points, &panel, 532e-9, &plan, &Progress::new()).expect("field").field;
            let found = sharpest(&field, [5e-3, 0.5], &ViewSettings::default(), &Progress::new()).expect("sweep");
            assert!((found.z / z - 1.0).abs() < 0.03, "{z}: {found:?}");
            assert!(found.contrast > 1.5 * found.usual, "{found:?}");
        }
    }
}
