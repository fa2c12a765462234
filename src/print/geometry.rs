//! Pixels and tiles: where each stands on the plate, and how the file shows it.
//!
//! *Plate* pixels are as the viewer sees them, row 0 on top. *File* pixels come from them by `mirror` and `rotation`.
//! Tiles are cut from the file, segments from the plate.

use super::plate::{Plate, Polarity, Raster};
use crate::segments::Rect;

/// The pixels of the file.
pub(super) fn file_raster(plate: &Plate) -> Raster {
    let Raster { width, height, pitch_x, pitch_y } = plate.raster;
    if plate.file.rotation.is_multiple_of(180) {
        plate.raster
    } else {
        Raster { width: height, height: width, pitch_x: pitch_y, pitch_y: pitch_x }
    }
}

/// The plate's pixel that the file shows at a column and row.
pub(super) fn plate_from_file(plate: &Plate, [column, row]: [i64; 2]) -> [i64; 2] {
    let (width, height) = (plate.raster.width as i64, plate.raster.height as i64);
    // The turn is undone first: it came last.
    let [x, y] = match plate.file.rotation {
        90 => [row, height - 1 - column],
        180 => [width - 1 - column, height - 1 - row],
        270 => [width - 1 - row, column],
        _ => [column, row],
    };
    [if plate.file.mirror { width - 1 - x } else { x }, y]
}

/// Tiles across and down the file.
pub(super) fn tile_counts(plate: &Plate) -> [u64; 2] {
    let Raster { width, height, .. } = file_raster(plate);
    [width, height].map(|side| side.div_ceil(plate.file.tile))
}

/// The part of the file that a tile shows; cut off at the right and bottom edges.
pub(super) fn tile_in_file(plate: &Plate, index: u64) -> Rect {
    let [across, _] = tile_counts(plate);
    let Raster { width, height, .. } = file_raster(plate);
    let side = |at: u64, end: u64| [(at * plate.file.tile) as i64, ((at + 1) * plate.file.tile).min(end) as i64];
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
pub(super) fn fringe_area(plate: &Plate) -> Rect {
    let guard = plate.file.guard as i64;
    Rect { x: [guard, plate.raster.width as i64 - guard], y: [guard, plate.raster.height as i64 - guard] }
}

/// Level of a pixel of the guard border, as a share of the highest: dark, with bright crosses in its corners.
pub(super) fn border(plate: &Plate, [column, row]: [i64; 2]) -> f32 {
    /// Crosses are this many times as long as their lines are wide.
    const SLIM: i64 = 16;
    let (length, middle) = (plate.file.marks as i64, plate.file.guard as i64 / 2);
    let from_edge = |at: i64, size: u64| at.min(size as i64 - 1 - at) - middle;
    let (x, y) = (from_edge(column, plate.raster.width), from_edge(row, plate.raster.height));
    let half = (length / (2 * SLIM)).max(1);
    let on = |a: i64, b: i64| (-half..half).contains(&a) && 2 * b.abs() < length;
    let lit = length > 0 && (on(x, y) || on(y, x));
    if lit == (plate.fringe.polarity == Polarity::Positive) { 1.0 } else { 0.0 }
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
        let Raster { width, height, .. } = file_raster(&turned);
        assert_eq!([width, height], [150, 200]);
        assert_eq!(plate_from_file(&turned, [149, 0]), [0, 0]);
        assert_eq!(plate_from_file(&plate("mirror = true"), [0, 7]), [199, 7]);
    }
}
