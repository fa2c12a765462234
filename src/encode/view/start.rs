//! Where the descent starts: the picture itself, on waves that converge on the eye.

use super::ViewTarget;
use crate::encode::model::PanelModel;
use crate::light_field::retina::Targets;
use crate::light_field::{Look, Pupil};
use crate::panel::Setup;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Phases of a frame for an eye at `from` as they are to start from for an eye at `to` [m]: the wave converges there,
/// φ − π/λZ·|x − e|² with the other e and Z.
pub fn carried_over(wishes: &[f32], setup: &Setup, wavelength: f64, from: DVec3, to: DVec3) -> Vec<f32> {
    let grid = setup.grid;
    let lens = |eye: DVec3, x: DVec2| -PI / (wavelength * eye.z) * (x - eye.truncate()).length_squared();
    let phase = |i: usize| {
        let x = DVec2::new(grid.x(i % grid.width), grid.y(i / grid.width));
        (f64::from(wishes[i]) + lens(to, x) - lens(from, x)).rem_euclid(TAU) as f32
    };
    (0..grid.len().min(wishes.len())).into_par_iter().map(phase).collect()
}

/// Phases of a wave that converges on the middle of a frame's cell of the eye box, as bright on each pixel as the picture is there
/// to an eye in that place [rad]: two phases φ ± arccos(a) for one amplitude a, as in double phase, whose unwanted light goes far
/// beside the eye. From a wave of one brightness dark places would take most steps to become dark.
pub(super) fn converging(
    target: &ViewTarget,
    targets: &Targets,
    model: &PanelModel,
    index: usize,
    count: usize,
) -> Vec<f32> {
    let viewer = target.viewer;
    // Pupils may move within the box; of all of the light each frame fills a cell.
    let extent = match viewer.pupil {
        Pupil::All => target.retina.taken,
        Pupil::Diameter(pupil) => viewer.eye_box + if count > 1 { DVec2::splat(0.5 * pupil) } else { DVec2::ZERO },
    };
    let columns = (1..=count)
        .filter(|columns| count.is_multiple_of(*columns))
        .min_by(|a, b| {
            let uneven = |columns: usize| {
                let rows = count / columns;
                ((extent.x / columns as f64) / (extent.y / rows as f64).max(1e-9)).ln().abs()
            };
            uneven(*a).total_cmp(&uneven(*b))
        })
        .unwrap_or(1);
    let rows = count / columns;
    let place = |i: usize, count: usize| (i as f64 + 0.5) / count as f64 - 0.5;
    let cell = DVec2::new(place(index % columns, columns) * extent.x, -place(index / columns, rows) * extent.y);
    let at = viewer.eye.truncate() + cell;
    let [near, far] = target.light.depth.map(|z| 1.0 / (viewer.eye.z - z));
    let half = 0.5 * viewer.eye_box;
    let pupil = viewer.eye.truncate() + cell.clamp(-half, half);
    let seen = match viewer.pupil {
        // A wave from one place has the picture of a pinhole there.
        Pupil::All => targets.pinhole(at),
        Pupil::Diameter(_) => targets.amplitude(&Look { pupil, focus: viewer.eye.z - 2.0 / (near + far) }),
    };
    let brightest = seen.iter().fold(f32::MIN_POSITIVE, |most, &a| most.max(a));
    let (grid, lattice) = (model.grid, &target.retina.lattice);
    // The picture at a place of the panel's plane, linear between samples.
    let amplitude = |x: f64, y: f64| {
        let inside = |place: f64, count: usize| place.clamp(0.0, count as f64 - 1.0);
        let (column, row) = (inside(lattice.column(x), lattice.width), inside(lattice.row(y), lattice.height));
        let (left, top) = (column as usize, row as usize);
        let (right, bottom) = ((left + 1).min(lattice.width - 1), (top + 1).min(lattice.height - 1));
        let line = |row: usize| {
            let share = (column - left as f64) as f32;
            seen[row * lattice.width + left] * (1.0 - share) + seen[row * lattice.width + right] * share
        };
        let share = (row - top as f64) as f32;
        line(top) * (1.0 - share) + line(bottom) * share
    };
    let phase = |i: usize| {
        let (column, row) = (i % grid.width, i / grid.width);
        let (x, y) = (grid.x(column), grid.y(row));
        let lens = -PI / (target.wavelength * viewer.eye.z) * ((x - at.x).powi(2) + (y - at.y).powi(2));
        let aside = f64::from((amplitude(x, y) / brightest).clamp(0.0, 1.0)).acos();
        (lens + if (column + row).is_multiple_of(2) { aside } else { -aside }).rem_euclid(TAU) as f32
    };
    (0..grid.len()).into_par_iter().map(phase).collect()
}
