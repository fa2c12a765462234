//! The wave that lights the finished plate.

use crate::field::{Complex32, Complex64, Grid};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// On which side of the plate its lamp stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Side {
    /// Behind: the plate is looked through.
    #[default]
    Behind,
    /// On the viewer's side: the plate reflects. A thin plate's fringe is the same: only the wave's spatial frequency along
    /// the plate counts.
    Front,
}

/// The wave that lights the finished plate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Reference {
    /// Light along the plate's normal; for phase plates.
    #[default]
    None,
    /// A plane wave.
    Plane {
        /// Angles θ_x and θ_y to the normal [rad]; positive: the light runs towards +x and +y. f = sin θ/λ.
        angle: [f64; 2],
        /// Where the lamp stands.
        side: Side,
    },
    /// A small lamp; its wave diverges.
    Point {
        /// Where it stands, z < 0 behind the plate [m].
        position: [f64; 3],
    },
}

impl Reference {
    /// Lowest and highest spatial frequency along x and along y over a plate [cycles/m].
    pub(super) fn frequencies(&self, grid: &Grid, wavelength: f64) -> [[f64; 2]; 2] {
        match *self {
            Self::None => [[0.0; 2]; 2],
            Self::Plane { angle, .. } => angle.map(|a| [a.sin() / wavelength; 2]),
            Self::Point { position: [px, py, pz] } => {
                let half = [0.5 * grid.extent_x(), 0.5 * grid.extent_y()];
                let aside = |p: f64, half: f64| [(p.abs() - half).max(0.0), p.abs() + half];
                let range = |p: f64, half: f64, aside| frequency_range([-half - p, half - p], aside, pz, wavelength);
                [range(px, half[0], aside(py, half[1])), range(py, half[1], aside(px, half[0]))]
            }
        }
    }

    /// Spatial frequency along x and y at a place of the plate [cycles/m].
    pub(super) fn frequency_at(&self, [x, y]: [f64; 2], wavelength: f64) -> [f64; 2] {
        match *self {
            Self::None => [0.0; 2],
            Self::Plane { angle, .. } => angle.map(|a| a.sin() / wavelength),
            Self::Point { position: [px, py, pz] } => {
                let (dx, dy) = (x - px, y - py);
                let way = (dx * dx + dy * dy + pz * pz).sqrt() * wavelength;
                [dx / way, dy / way]
            }
        }
    }

    /// The wave of a wavelength [m] at columns `columns` of a row, unit amplitude.
    pub(super) fn row(
        &self,
        grid: &Grid,
        wavelength: f64,
        row: i64,
        columns: std::ops::Range<i64>,
        out: &mut Vec<Complex32>,
    ) {
        out.clear();
        let (y, x) = (grid.y(row as usize), |column: i64| grid.x(column as usize));
        let narrow = |turns: f64| {
            let wave = Complex64::cis(TAU * (turns - turns.floor()));
            Complex32::new(wave.re as f32, wave.im as f32)
        };
        match *self {
            Self::None => out.extend(columns.map(|_| Complex32::new(1.0, 0.0))),
            Self::Plane { angle, .. } => {
                let [fx, fy] = angle.map(|a| a.sin() / wavelength);
                out.extend(columns.map(|column| narrow(fx * x(column) + fy * y)));
            }
            Self::Point { position: [px, py, pz] } => {
                let other = (y - py) * (y - py) + pz * pz;
                let turns = |column: i64| {
                    let dx = x(column) - px;
                    (dx * dx + other).sqrt() / wavelength
                };
                out.extend(columns.map(|column| narrow(turns(column))));
            }
        }
    }
}

/// Lowest and highest spatial frequency along an axis of light that goes so far along it (from, to), aside of it (least,
/// most) and on [m]: along an axis it is monotonic, its ends lie where the way aside is shortest or longest [cycles/m].
pub(super) fn frequency_range(along: [f64; 2], aside: [f64; 2], on: f64, wavelength: f64) -> [f64; 2] {
    let at = |d: f64, o: f64| d / (d * d + o * o + on * on).sqrt() / wavelength;
    let ends = along.map(|d| aside.map(|o| at(d, o)));
    let ends = ends.as_flattened().iter().copied();
    [ends.clone().fold(f64::INFINITY, f64::min), ends.fold(f64::NEG_INFINITY, f64::max)]
}
