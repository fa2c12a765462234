//! A hologram plane in rectangles of pixels and in segments, and the light that leaves it.

use crate::error::{Error, Result};
use crate::field::Grid;
use crate::names::{Name, Named};
use crate::points::budget::EYE_ANGLE;
use serde::{Deserialize, Serialize};

/// A rectangle of pixels; its ends lie outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// First and end column.
    pub x: [i64; 2],
    /// First and end row.
    pub y: [i64; 2],
}

impl Rect {
    /// Number of columns.
    pub fn width(&self) -> usize {
        (self.x[1] - self.x[0]).max(0) as usize
    }
    /// Number of rows.
    pub fn height(&self) -> usize {
        (self.y[1] - self.y[0]).max(0) as usize
    }
    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.width() * self.height()
    }
    /// Whether a pixel lies in it.
    pub(crate) fn contains(&self, [column, row]: [i64; 2]) -> bool {
        (self.x[0]..self.x[1]).contains(&column) && (self.y[0]..self.y[1]).contains(&row)
    }
    /// What both cover.
    pub(crate) fn and(&self, other: &Self) -> Self {
        let both = |a: [i64; 2], b: [i64; 2]| [a[0].max(b[0]), a[1].min(b[1]).max(a[0].max(b[0]))];
        Self { x: both(self.x, other.x), y: both(self.y, other.y) }
    }
    /// Grown to the sides and upwards, within bounds.
    pub(crate) fn grown(&self, halo: i64, bounds: &Self) -> Self {
        Self { x: [self.x[0] - halo, self.x[1] + halo], y: [self.y[0] - halo, self.y[1]] }.and(bounds)
    }
}

/// Part of a rectangle that belongs to one segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Column and row of the segment.
    pub segment: [i64; 2],
    /// Its pixels.
    pub rect: Rect,
}

/// How far the object's light spreads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectBand {
    /// The plane's limit 1/(2·pitch) is divided by this along x and y.
    pub divisor: [u32; 2],
    /// Half width of the band [cycles/m].
    pub half: [f64; 2],
    /// Half angle of the object's light [rad].
    pub angle: [f64; 2],
}

impl ObjectBand {
    /// The whole part `divisor` of what a grid carries.
    pub(crate) fn of(grid: &Grid, divisor: [u32; 2], wavelength: f64) -> Self {
        let limit = [grid.limit_x(), grid.limit_y()];
        let half = [0, 1].map(|axis| (limit[axis] / f64::from(divisor[axis])).min(0.6 / wavelength));
        Self { divisor, half, angle: half.map(|f| (f * wavelength).asin()) }
    }
}

/// The slit through which a plane is seen, at the viewer's distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slit {
    /// Its height over the plane's middle [m].
    pub y: f64,
    /// How high it is [m].
    pub height: f64,
    /// Rows of the plane that share what they show [px].
    pub strip: u64,
    /// Wavelengths of the strips, which take turns from the top [m].
    pub wavelengths: Vec<f64>,
    /// Strips do not take turns: each has the fringes of all wavelengths, one over the other.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub superimposed: bool,
    /// Which of superimposed wavelengths is computed; the first where `None`.
    #[serde(skip)]
    pub(crate) only: Option<usize>,
}

impl Slit {
    /// The wavelength of a row [m].
    pub(crate) fn wavelength_of(&self, row: i64) -> f64 {
        self.wavelength_of_strip(row.div_euclid(self.strip.max(1) as i64))
    }

    /// The wavelength of a strip, numbered from the top [m].
    pub(super) fn wavelength_of_strip(&self, strip: i64) -> f64 {
        let turn = match self.superimposed {
            true => self.only.unwrap_or(0),
            false => strip.rem_euclid(self.wavelengths.len().max(1) as i64) as usize,
        };
        self.wavelengths.get(turn).copied().unwrap_or_default()
    }

    /// Largest |sin β| of light from a plane of a height [m] to the slit at a distance [m].
    pub(crate) fn steepest(&self, plane_height: f64, distance: f64) -> f64 {
        let rise = 0.5 * plane_height + self.y.abs() + 0.5 * self.height;
        rise / rise.hypot(distance)
    }

    /// How far the light of a strip's wavelength misses the slit at a distance [m] when the strip is lit with the next one
    /// [m]; infinite for one wavelength. `sine` is that of the reference's angle along y.
    pub(crate) fn separation(&self, distance: f64, sine: f64) -> f64 {
        let mut sorted = self.wavelengths.clone();
        sorted.sort_by(f64::total_cmp);
        let shift = |pair: &[f64]| distance * sine.abs() * (pair[1] - pair[0]) / pair[1];
        sorted.windows(2).map(shift).fold(f64::INFINITY, f64::min)
    }
}

/// Where a scene and its viewer stand, and how fine the viewer sees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Viewing {
    /// Distance of the viewer's eye in front of the plane [m].
    pub viewer: f64,
    /// Angle that the viewer's eye separates [rad].
    pub resolution: f64,
    /// Rays along each side of what the eye separates.
    pub rays: u32,
    /// z of the scene's middle [m]; negative behind the plane.
    pub place: f64,
    /// Metres at the plane for one metre of the scene; fitted into the view where `None`.
    pub scale: Option<f64>,
    /// Where points stand on what is seen, and in which phases.
    #[serde(default, skip_serializing_if = "PointPhase::is_random")]
    pub phase: PointPhase,
}

/// Where the points of a scene stand on what is seen, and in which phases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PointPhase {
    /// Anywhere in cubic cells, in independent phases: light goes into the whole cone as from a matte surface, with speckle.
    #[default]
    Random,
    /// On a lattice of directions from the viewer's eye, all waves in step there: no speckle. In other places before the plate
    /// the light comes in spots, λ over the angle of the lattice apart: less than a pupil, where the eye separates as
    /// much as a pupil diffracts.
    Path,
}

impl Named for PointPhase {
    const KIND: &'static str = "phase";
    const NAMES: &'static [Name<Self>] = &[
        ("random", || Self::Random, "as from a matte surface"),
        ("path", || Self::Path, "all waves reach the eye in step"),
    ];
}

impl PointPhase {
    fn is_random(&self) -> bool {
        *self == Self::Random
    }
}

impl Default for Viewing {
    /// A scene 150 mm behind the plane, seen from 600 mm by a healthy eye.
    fn default() -> Self {
        Self { viewer: 0.6, resolution: EYE_ANGLE, rays: 2, place: -0.15, scale: None, phase: PointPhase::Random }
    }
}

/// A hologram plane divided into segments.
#[derive(Clone, Debug, PartialEq)]
pub struct Segments {
    /// Pixels of the whole plane, centred; a plate's are more than are ever held at once.
    pub grid: Grid,
    /// Columns and rows of a segment [px].
    pub size: [u64; 2],
    /// Vacuum wavelength [m].
    pub wavelength: f64,
    /// The light that leaves the plane for the object.
    pub band: ObjectBand,
    /// The slit through which the plane is seen, where it has parallax from left to right only.
    pub slit: Option<Slit>,
    /// Where scene and viewer stand.
    pub view: Viewing,
    /// Largest relative error of the field.
    pub error: f64,
    /// Seed of phases and rays.
    pub seed: u64,
}

impl Segments {
    /// A panel in square segments of so many pixels, whose whole band is the object's; there is no reference wave.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for segments that do not fit the panel.
    pub fn of_panel(grid: Grid, wavelength: f64, segment: u64) -> Result<Self> {
        let largest = grid.width.min(grid.height) as u64;
        if !(16..=largest).contains(&segment) {
            return Err(Error::out_of_range(
                "segment",
                format!("{segment} pixels"),
                format!("must be 16 to {largest}"),
            ));
        }
        let band = ObjectBand::of(&grid, [1; 2], wavelength);
        let size = [segment; 2];
        Ok(Self { grid, size, wavelength, band, slit: None, view: Viewing::default(), error: 5e-3, seed: 1 })
    }

    /// Cuts `grown` into the segments that `core` lies in: what is outside of the core goes with the segment beside it.
    pub(crate) fn pieces(&self, core: &Rect, grown: &Rect) -> Vec<Piece> {
        let [wide, tall] = self.size.map(|side| side as i64);
        let cuts = |core: [i64; 2], grown: [i64; 2], side: i64| -> Vec<(i64, [i64; 2])> {
            let (first, last) = (core[0].div_euclid(side), (core[1] - 1).div_euclid(side));
            (first..=last)
                .map(|segment| {
                    let from = if segment == first { grown[0] } else { segment * side };
                    let to = if segment == last { grown[1] } else { (segment + 1) * side };
                    (segment, [from, to])
                })
                .collect()
        };
        let columns = cuts(core.x, grown.x, wide);
        cuts(core.y, grown.y, tall)
            .into_iter()
            .flat_map(|(row, y)| {
                columns.iter().map(move |&(column, x)| Piece { segment: [column, row], rect: Rect { x, y } })
            })
            .collect()
    }

    /// Middle of a segment [m].
    pub(crate) fn center(&self, segment: [i64; 2]) -> [f64; 2] {
        let ([wide, tall], Grid { width, height, pitch_x, pitch_y, .. }) = (self.size, self.grid);
        let at = |index: i64, side: u64, size: usize, pitch: f64| {
            ((index as f64 + 0.5) * side as f64 - 0.5 * size as f64) * pitch
        };
        [at(segment[0], wide, width, pitch_x), -at(segment[1], tall, height, pitch_y)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_cover_a_grown_rectangle_once() {
        let grid = Grid::new(200, 150, 1e-6, 2e-6).expect("grid");
        let segments = Segments::of_panel(grid, 633e-9, 50).expect("segments");
        let bounds = Rect { x: [0, 200], y: [0, 150] };
        for core in [Rect { x: [64, 128], y: [64, 128] }, Rect { x: [0, 64], y: [128, 150] }] {
            let grown = core.grown(10, &bounds);
            let cut = segments.pieces(&core, &grown);
            assert_eq!(cut.iter().map(|p| p.rect.area()).sum::<usize>(), grown.area());
            for piece in &cut {
                let inside = piece.rect.and(&core);
                assert!(inside.area() > 0, "a segment that only the halo touches");
                assert!(
                    inside.x[0].div_euclid(50) == piece.segment[0] && inside.y[0].div_euclid(50) == piece.segment[1]
                );
            }
        }
        // Segment 1 of four along x: its middle at pixel border 75 of 200; of three down at 75 of 150.
        let [x, y] = segments.center([1, 1]);
        assert!((x + 25e-6).abs() < 1e-15 && y.abs() < 1e-15);
        assert!(segments.center([0, 0])[1] > 0.0, "row 0 on top");
    }
}
