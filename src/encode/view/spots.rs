//! Where in an eye box the waves of a frame converge before the descent: far enough apart that no pupil takes in two of a frame.
//!
//! A wave that converges on a spot shows the picture from there, without speckle, to each pupil that takes the spot in. Two
//! waves of one frame in one pupil would interfere; waves of frames that follow each other add up. So each frame has a lattice
//! of spots a pupil's diameter apart or more, the lattices of the frames are shifted against each other, and pupils see some
//! spots of several frames wherever they stand. Of such lattices that one serves of whose spots all pupils see about as many.

use crate::light_field::{Pupil, Retina, Viewer};
use glam::DVec2;
use rayon::prelude::*;

/// Places of waves, from the middle of the eye box [m]: those of each frame.
pub(super) struct Spots(pub(super) Vec<Vec<DVec2>>);

/// An eye box whose diagonal is shorter than this part of the pupil's diameter has no place that does not see its middle.
const SHARED: f64 = 0.8;
/// Distances of spots in a frame that are tried, over the pupil's diameter.
const APART: [f64; 6] = [1.0, 1.05, 1.1, 1.15, 1.2, 1.3];
/// Stretches of the lattice along x and y, and the part of the period by which each row is shifted against the last: squares,
/// equal triangles, and what lies between; then one row and one column.
const SHAPES: [([f64; 2], f64); 6] = [
    ([1.0, 1.0], 0.0),
    ([1.0, 0.866_025_403_784_438_6], 0.5),
    ([1.0, 1.1], 0.0),
    ([1.1, 1.0], 0.0),
    ([1.0, ALONE], 0.0),
    ([ALONE, 1.0], 0.0),
];
/// A stretch that leaves one row.
const ALONE: f64 = 1e3;
/// Widest box across a single row of spots, over the pupil's diameter.
const ROW: f64 = 0.5;
/// Places along each side of the box at which pupils are tried, and the part of their diameter over which their rims are soft.
const PLACES: usize = 15;
const RIM: f64 = 0.04;

impl Spots {
    /// Spots for `count` frames.
    pub(super) fn new(viewer: &Viewer, retina: &Retina, count: usize) -> Self {
        match viewer.pupil {
            Pupil::All => Self::cells(retina.taken, count),
            Pupil::Diameter(pupil) if Self::are_scattered(viewer) => Self::lattice(viewer.eye_box, pupil, count),
            Pupil::Diameter(pupil) => {
                Self::cells(viewer.eye_box + if count > 1 { DVec2::splat(0.5 * pupil) } else { DVec2::ZERO }, count)
            }
        }
    }

    /// Whether pupils come to stand between the spots; else each frame has one, which all pupils see.
    pub(super) fn are_scattered(viewer: &Viewer) -> bool {
        matches!(viewer.pupil, Pupil::Diameter(pupil) if viewer.eye_box.length() >= SHARED * pupil)
    }

    /// One spot a frame, in the middles of cells as even as they can be.
    fn cells(extent: DVec2, count: usize) -> Self {
        let uneven = |columns: usize| {
            ((extent.x / columns as f64) / (extent.y * columns as f64 / count as f64).max(1e-9)).ln().abs()
        };
        let columns = divisors(count).min_by(|a, b| uneven(*a).total_cmp(&uneven(*b))).unwrap_or(1);
        let rows = count / columns;
        let place = |i: usize, count: usize| (i as f64 + 0.5) / count as f64 - 0.5;
        let cell = |i: usize| DVec2::new(place(i % columns, columns), -place(i / columns, rows)) * extent;
        Self((0..count).map(|i| vec![cell(i)]).collect())
    }

    fn lattice(eye_box: DVec2, pupil: f64, count: usize) -> Self {
        let mut lattices = Vec::new();
        for columns in divisors(count) {
            for (stretch, slant) in SHAPES {
                let row = [0, 1].map(|axis| stretch[axis] == ALONE);
                let shifts = [columns, count / columns];
                if (0..2).any(|axis| row[axis] && (shifts[axis] > 1 || eye_box[axis] > ROW * pupil)) {
                    continue;
                }
                for apart in APART {
                    let period = DVec2::from(stretch) * apart * pupil;
                    let origin = |half: f64| [0, 1].map(|axis| if row[axis] { 0.0 } else { half });
                    lattices.extend([0.0, 0.5].map(|half| Lattice { period, slant, shifts, origin: origin(half) }));
                }
            }
        }
        let tried = lattices.par_iter().filter_map(|lattice| {
            let frames = lattice.frames(eye_box, pupil);
            frames.iter().all(|spots| !spots.is_empty()).then(|| (spread(&frames, eye_box, pupil), frames))
        });
        let best = tried.collect::<Vec<_>>().into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or_else(|| Self::cells(eye_box, count), |(_, frames)| Self(frames))
    }
}

fn divisors(count: usize) -> impl Iterator<Item = usize> {
    (1..=count).filter(move |divisor| count.is_multiple_of(*divisor))
}

/// A lattice for all frames.
struct Lattice {
    /// Distance of a frame's spots along x and y [m].
    period: DVec2,
    /// Part of the period by which each row is shifted against the last.
    slant: f64,
    /// Shifts of the frames in columns and rows, their product the number of frames.
    shifts: [usize; 2],
    /// Where the first frame begins, over the distance of the shifts.
    origin: [f64; 2],
}

impl Lattice {
    /// The spots of each frame that some pupil sees.
    fn frames(&self, eye_box: DVec2, pupil: f64) -> Vec<Vec<DVec2>> {
        let half = 0.5 * eye_box;
        let reach = half + DVec2::splat(0.5 * pupil);
        let rows = (reach.y / self.period.y).ceil() as i64 + 1;
        let columns = ((reach.x + self.slant * rows as f64 * self.period.x) / self.period.x).ceil() as i64 + 1;
        let frame = |index: usize| {
            let at = [index % self.shifts[0], index / self.shifts[0]];
            let shift = [0, 1].map(|axis| (at[axis] as f64 + self.origin[axis]) / self.shifts[axis] as f64);
            let spot = |row: i64, column: i64| {
                let place = DVec2::new(shift[0] + column as f64 + self.slant * row as f64, shift[1] + row as f64);
                place * self.period * DVec2::new(1.0, -1.0)
            };
            let all = (-rows..=rows).flat_map(|row| (-columns..=columns).map(move |column| spot(row, column)));
            all.filter(|spot| (spot.abs() - half).max(DVec2::ZERO).length() < 0.5 * pupil).collect()
        };
        (0..self.shifts[0] * self.shifts[1]).map(frame).collect()
    }
}

/// How unevenly many spots pupils in the box see of all frames: σ/μ.
fn spread(frames: &[Vec<DVec2>], eye_box: DVec2, pupil: f64) -> f64 {
    let seen = |place: usize| -> f64 {
        let at = DVec2::new((place % PLACES) as f64, (place / PLACES) as f64) / (PLACES - 1) as f64 - 0.5;
        let at = at * eye_box;
        let open = |spot: &DVec2| ((0.5 * pupil - (*spot - at).length()) / (RIM * pupil) + 0.5).clamp(0.0, 1.0);
        frames.iter().flatten().map(open).sum()
    };
    let counts: Vec<f64> = (0..PLACES * PLACES).map(seen).collect();
    let mean = counts.iter().sum::<f64>() / counts.len() as f64;
    let square = counts.iter().map(|count| (count - mean).powi(2)).sum::<f64>() / counts.len() as f64;
    if mean > 0.0 { square.sqrt() / mean } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Grid;

    const PUPIL: f64 = 4e-3;

    fn spots(width: f64, height: f64, count: usize, scattered: bool) -> Vec<Vec<DVec2>> {
        let viewer = Viewer { eye_box: DVec2::new(width, height), pupil: Pupil::Diameter(PUPIL), ..Viewer::default() };
        assert_eq!(Spots::are_scattered(&viewer), scattered);
        let grid = Grid::new(1920, 1080, 8e-6, 8e-6).expect("grid");
        let retina = Retina::of(&viewer, &grid, 632.8e-9).expect("retina");
        Spots::new(&viewer, &retina, count).0
    }

    /// No pupil takes in two spots of a frame, and all take in about as many of all frames: one in nine more or less in a flat box
    /// with three frames, where two or three are seen, one in thirteen and fewer in boxes that are wide and high.
    #[test]
    fn pupils_see_evenly_many_spots_and_never_two_of_a_frame() {
        for (width, height, count, most) in
            [(10e-3, 2e-3, 3, 0.11), (10e-3, 10e-3, 9, 0.08), (22e-3, 14e-3, 24, 0.02), (2e-3, 10e-3, 3, 0.11)]
        {
            let frames = spots(width, height, count, true);
            assert_eq!(frames.len(), count);
            for frame in &frames {
                assert!(!frame.is_empty());
                for (i, a) in frame.iter().enumerate() {
                    for b in &frame[..i] {
                        assert!((*a - *b).length() > (1.0 - 1e-9) * PUPIL, "{a} and {b}");
                    }
                }
            }
            let spread = spread(&frames, DVec2::new(width, height), PUPIL);
            assert!(spread < most, "{width} × {height}: {spread}");
        }
    }

    /// All pupils see the one spot of a frame where the box lets them.
    #[test]
    fn a_known_eye_has_one_spot_of_each_frame_in_its_pupil() {
        assert_eq!(spots(0.0, 0.0, 1, false), [[DVec2::ZERO]]);
        assert_eq!(spots(2e-3, 2e-3, 1, false), [[DVec2::ZERO]]);
        let four = spots(0.0, 0.0, 4, false);
        for (i, frame) in four.iter().enumerate() {
            assert!(frame.len() == 1 && frame[0].length() < 0.5 * PUPIL);
            assert!(four[..i].iter().all(|other| other[0] != frame[0]));
        }
    }
}
