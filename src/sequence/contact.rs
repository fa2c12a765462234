//! A contact sheet: small pictures of a sequence beside each other, each with its number and time.

use crate::error::{Error, Result};
use crate::reconstruction::canvas::{Canvas, LETTER_HEIGHT, LETTER_WIDTH};
use crate::reconstruction::{Picture, Scale};
use std::path::Path;

/// Room between cells [px].
const GAP: usize = 6;
/// Most cells beside each other.
const COLUMNS: usize = 6;
const GROUND: [u8; 3] = [28, 28, 32];
const INK: [u8; 3] = [230, 230, 230];

/// Small pictures of a sequence of unknown length. Once there are too many, every second one is left out.
#[derive(Clone, Debug)]
pub struct ContactSheet {
    most: usize,
    stride: usize,
    cells: Vec<Cell>,
}

#[derive(Clone, Debug)]
struct Cell {
    number: usize,
    label: String,
    pictures: Vec<Picture>,
}

impl ContactSheet {
    /// A sheet of at most `most` cells (at least two).
    pub fn new(most: usize) -> Self {
        Self { most: most.max(2), stride: 1, cells: Vec::new() }
    }

    /// Whether frame `number` would stand on it: asked before its picture is made.
    pub fn wants(&self, number: usize) -> bool {
        number.is_multiple_of(self.stride)
    }

    /// Adds a frame's pictures, one below the other in its cell; all frames have as many, of the same sizes.
    ///
    /// # Errors
    /// [`Error::Parameter`] when they have not.
    pub fn add(&mut self, number: usize, label: String, pictures: Vec<Picture>) -> Result<()> {
        if !self.wants(number) {
            return Ok(());
        }
        let sizes = |pictures: &[Picture]| pictures.iter().map(|p| (p.width, p.height)).collect::<Vec<_>>();
        if self.cells.first().is_some_and(|first| sizes(&first.pictures) != sizes(&pictures)) {
            return Err(Error::parameter("contact sheet", format!("frame {number} has pictures of other sizes")));
        }
        self.cells.push(Cell { number, label, pictures });
        if self.cells.len() > self.most {
            self.stride *= 2;
            self.cells.retain(|cell| cell.number.is_multiple_of(self.stride));
        }
        Ok(())
    }

    /// Numbers of the frames on it.
    pub fn numbers(&self) -> Vec<usize> {
        self.cells.iter().map(|cell| cell.number).collect()
    }

    /// The sheet. Pictures at the same place of their cells have one white: the median of what 99.5 % of the pixels of each
    /// do not pass, so that a frame that is darker than the others looks darker.
    pub fn draw(&self) -> Canvas {
        let Some(first) = self.cells.first() else { return Canvas::new(1, 1, GROUND) };
        let width = first.pictures.iter().map(|p| p.width).max().unwrap_or(1);
        let label_height = LETTER_HEIGHT;
        let height = label_height + first.pictures.iter().map(|p| p.height + 2).sum::<usize>();
        let columns = COLUMNS.min(self.cells.len());
        let rows = self.cells.len().div_ceil(columns);
        let mut canvas = Canvas::new(GAP + columns * (width + GAP), GAP + rows * (height + GAP), GROUND);
        let whites: Vec<f32> = (0..first.pictures.len())
            .map(|place| {
                let mut whites: Vec<f32> =
                    self.cells.iter().map(|cell| cell.pictures[place].white(Scale::Percentile(0.995))).collect();
                whites.sort_by(f32::total_cmp);
                whites[whites.len() / 2]
            })
            .collect();
        for (index, cell) in self.cells.iter().enumerate() {
            let left = GAP + index % columns * (width + GAP);
            let mut top = GAP + index / columns * (height + GAP);
            let fits: String = cell.label.chars().take(width / LETTER_WIDTH).collect();
            canvas.write((left, top), 1, INK, &fits);
            top += label_height;
            for (picture, white) in cell.pictures.iter().zip(&whites) {
                let coded = picture.coded(Scale::White(*white));
                let gray: Vec<u8> = coded.iter().map(|v| (v * 255.0).round() as u8).collect();
                canvas.put_gray((left, top), picture.width, &gray);
                top += picture.height + 2;
            }
        }
        canvas
    }

    /// Writes the sheet as a PNG.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        let numbers = self.numbers().iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
        let texts = [("Description", format!("simulated: contact sheet of the frames {numbers}"))];
        self.draw().write_png(path, &texts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(value: f32) -> Picture {
        Picture { width: 40, height: 20, values: vec![value; 800] }
    }

    #[test]
    fn a_long_sequence_is_thinned_evenly() {
        let mut sheet = ContactSheet::new(8);
        for number in 0..100 {
            if sheet.wants(number) {
                sheet.add(number, format!("#{number}"), vec![picture(1.0)]).expect("cell");
            }
        }
        assert_eq!(sheet.numbers(), [0, 16, 32, 48, 64, 80, 96]);
        let wrong = Picture { width: 2, height: 2, values: vec![0.0; 4] };
        assert!(sheet.add(112, String::new(), vec![wrong]).is_err());
    }

    #[test]
    fn cells_stand_in_reading_order_with_one_white() {
        let mut sheet = ContactSheet::new(16);
        for number in 0..7 {
            let value = if number == 6 { 0.25 } else { 1.0 };
            sheet.add(number, format!("#{number}"), vec![picture(value), picture(1.0)]).expect("cell");
        }
        let canvas = sheet.draw();
        let (cell, below) = (40 + GAP, LETTER_HEIGHT + 22 + 22 + GAP);
        let at = |x: usize, y: usize| canvas.pixels[y * canvas.width + x][0];
        let top = GAP + LETTER_HEIGHT;
        assert_eq!((canvas.width, canvas.height), (GAP + 6 * cell, GAP + 2 * below));
        assert_eq!(at(GAP + 5 * cell + 1, top + 1), 255);
        // A quarter of the light, sRGB-coded; its second picture has its own white.
        assert_eq!((at(GAP + 1, top + below + 1), at(GAP + 1, top + below + 23)), (137, 255));
        assert_eq!(at(GAP + cell + 1, top + below + 1), GROUND[0]);
    }
}
