//! Pixels, tiles and segments: where each stands on the plate, and how the file shows it.
//!
//! *Plate* pixels are as the viewer sees them, row 0 on top. *File* pixels come from them by `mirror` and `rotation`.
//! Tiles are cut from the file, segments from the plate.

use super::plate::{Plate, Polarity};

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
    /// What both cover.
    pub fn and(&self, other: &Self) -> Self {
        let both = |a: [i64; 2], b: [i64; 2]| [a[0].max(b[0]), a[1].min(b[1]).max(a[0].max(b[0]))];
        Self { x: both(self.x, other.x), y: both(self.y, other.y) }
    }
    /// Grown to the sides and upwards, within bounds.
    pub fn grown(&self, halo: i64, bounds: &Self) -> Self {
        Self { x: [self.x[0] - halo, self.x[1] + halo], y: [self.y[0] - halo, self.y[1]] }.and(bounds)
    }
}

/// Columns and rows of the file.
pub(super) fn file_size(plate: &Plate) -> [u64; 2] {
    if plate.rotation.is_multiple_of(180) { [plate.width, plate.height] } else { [plate.height, plate.width] }
}

/// The plate's pixel that the file shows at a column and row.
pub(super) fn plate_from_file(plate: &Plate, [column, row]: [i64; 2]) -> [i64; 2] {
    let (width, height) = (plate.width as i64, plate.height as i64);
    // The turn is undone first: it came last.
    let [x, y] = match plate.rotation {
        90 => [row, height - 1 - column],
        180 => [width - 1 - column, height - 1 - row],
        270 => [width - 1 - row, column],
        _ => [column, row],
    };
    [if plate.mirror { width - 1 - x } else { x }, y]
}

/// Tiles across and down the file.
pub fn tile_counts(plate: &Plate) -> [u64; 2] {
    file_size(plate).map(|side| side.div_ceil(plate.tile))
}

/// The part of the file that a tile shows; cut off at the right and bottom edges.
pub(super) fn tile_in_file(plate: &Plate, index: u64) -> Rect {
    let [across, _] = tile_counts(plate);
    let [width, height] = file_size(plate);
    let side = |at: u64, end: u64| [(at * plate.tile) as i64, ((at + 1) * plate.tile).min(end) as i64];
    Rect { x: side(index % across, width), y: side(index / across, height) }
}

/// The same on the plate.
pub(super) fn tile_on_plate(plate: &Plate, index: u64) -> Rect {
    let file = tile_in_file(plate, index);
    let a = plate_from_file(plate, [file.x[0], file.y[0]]);
    let b = plate_from_file(plate, [file.x[1] - 1, file.y[1] - 1]);
    let span = |a: i64, b: i64| [a.min(b), a.max(b) + 1];
    Rect { x: span(a[0], b[0]), y: span(a[1], b[1]) }
}

/// The part of the plate that carries fringes: all but the guard border.
pub fn fringe_area(plate: &Plate) -> Rect {
    let guard = plate.guard as i64;
    Rect { x: [guard, plate.width as i64 - guard], y: [guard, plate.height as i64 - guard] }
}

/// Part of a rectangle that belongs to one segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Column and row of the segment.
    pub segment: [i64; 2],
    /// Its pixels.
    pub rect: Rect,
}

/// Cuts `grown` into the segments that `core` lies in: what is outside of the core goes with the segment beside it.
pub fn pieces(plate: &Plate, core: &Rect, grown: &Rect) -> Vec<Piece> {
    let [wide, tall] = plate.segment_size().map(|side| side as i64);
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
pub(super) fn segment_center(plate: &Plate, segment: [i64; 2]) -> [f64; 2] {
    let [wide, tall] = plate.segment_size();
    let at =
        |index: i64, side: u64, size: u64, pitch: f64| ((index as f64 + 0.5) * side as f64 - 0.5 * size as f64) * pitch;
    [at(segment[0], wide, plate.width, plate.pitch_x), -at(segment[1], tall, plate.height, plate.pitch_y)]
}

/// Level of a pixel of the guard border, as a share of the highest: dark, with bright crosses in its corners.
pub(super) fn border(plate: &Plate, [column, row]: [i64; 2]) -> f32 {
    /// Crosses are this many times as long as their lines are wide.
    const SLIM: i64 = 16;
    let (length, middle) = (plate.marks as i64, plate.guard as i64 / 2);
    let from_edge = |at: i64, size: u64| at.min(size as i64 - 1 - at) - middle;
    let (x, y) = (from_edge(column, plate.width), from_edge(row, plate.height));
    let half = (length / (2 * SLIM)).max(1);
    let on = |a: i64, b: i64| (-half..half).contains(&a) && 2 * b.abs() < length;
    let lit = length > 0 && (on(x, y) || on(y, x));
    if lit == (plate.polarity == Polarity::Positive) { 1.0 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn plate(more: &str) -> Plate {
        let text = format!(
            "name = \"t\"\nsize = [200, 150]\npitch_x = \"1um\"\npitch_y = \"2um\"\nwavelength = \"633nm\"\nbits = 8\n\
             tile = 64\nsegment = 50\n{more}\n[reference]\nangle = [\"9deg\", \"0deg\"]\n\
             [scene]\nviewer = \"60mm\"\ndistance = \"5mm\"\n"
        );
        Plate::parse(&text, Path::new("t.toml")).expect("plate")
    }

    #[test]
    fn tiles_cover_the_plate_once_however_it_is_turned() {
        for mirror in [false, true] {
            for rotation in [0, 90, 180, 270] {
                let plate = plate(&format!("mirror = {mirror}\nrotation = {rotation}"));
                let [across, down] = tile_counts(&plate);
                let mut covered = vec![0u8; 200 * 150];
                for index in 0..across * down {
                    let (file, rect) = (tile_in_file(&plate, index), tile_on_plate(&plate, index));
                    assert_eq!(file.area(), rect.area());
                    for row in file.y[0]..file.y[1] {
                        for column in file.x[0]..file.x[1] {
                            let [x, y] = plate_from_file(&plate, [column, row]);
                            assert!(rect.x[0] <= x && x < rect.x[1] && rect.y[0] <= y && y < rect.y[1]);
                            covered[(y * 200 + x) as usize] += 1;
                        }
                    }
                }
                assert!(covered.iter().all(|&n| n == 1), "{mirror} {rotation}");
            }
        }
        // Turned clockwise by a quarter, the plate's upper left corner stands at the upper right of the file.
        let turned = plate("rotation = 90");
        assert_eq!(file_size(&turned), [150, 200]);
        assert_eq!(plate_from_file(&turned, [149, 0]), [0, 0]);
        assert_eq!(plate_from_file(&plate("mirror = true"), [0, 7]), [199, 7]);
    }

    #[test]
    fn pieces_cover_a_grown_rectangle_once() {
        let plate = plate("");
        let bounds = fringe_area(&plate);
        for core in [Rect { x: [64, 128], y: [64, 128] }, Rect { x: [0, 64], y: [128, 150] }] {
            let grown = core.grown(10, &bounds);
            let cut = pieces(&plate, &core, &grown);
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
        let [x, y] = segment_center(&plate, [1, 1]);
        assert!((x + 25e-6).abs() < 1e-15 && y.abs() < 1e-15);
        assert!(segment_center(&plate, [0, 0])[1] > 0.0, "row 0 on top");
    }
}
