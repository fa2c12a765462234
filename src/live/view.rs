//! The operator's view: what is seen, the frame itself, its levels, and what it took.

use crate::panel::Frame;
use crate::reconstruction::canvas::{Canvas, LETTER_HEIGHT};
use crate::reconstruction::{Picture, Scale};

/// Size of the whole view (columns, rows) [px].
pub const SIZE: (usize, usize) = (900, 580);
/// Where the reconstruction stands in it: left, top, largest width and height [px].
pub const PICTURE: [usize; 4] = [10, 30, 520, 520];

/// Right column: left edge and width [px].
const COLUMN: (usize, usize) = (545, 340);
const GROUND: [u8; 3] = [24, 24, 28];
const FRAMING: [u8; 3] = [70, 70, 80];
const INK: [u8; 3] = [225, 225, 225];
const FAINT: [u8; 3] = [150, 150, 160];
const BARS: [u8; 3] = [120, 170, 240];

/// How often each level occurs, in 256 classes of equal width.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Histogram(pub [u32; 256]);

impl Histogram {
    /// Of a frame's levels.
    pub fn of(frame: &Frame) -> Self {
        let mut counts = [0; 256];
        for &level in &frame.levels {
            counts[((usize::from(level) * 256) >> frame.bits.max(1)) & 255] += 1;
        }
        Self(counts)
    }
}

/// What stands in the view.
#[derive(Clone, Debug, Default)]
pub struct Board<'a> {
    /// The reconstruction.
    pub seen: Option<&'a Picture>,
    /// The frame on the panel.
    pub frame: Option<&'a Frame>,
    /// Lines beside it: name and value.
    pub lines: Vec<(String, String)>,
    /// What the keys do.
    pub keys: &'a [&'a str],
    /// A warning, in one line.
    pub warning: Option<&'a str>,
}

/// Draws the view. The reconstruction stands at [`PICTURE`]'s left and top, a pixel for a pixel, 99.5 % of it below white.
pub fn draw(board: &Board) -> Canvas {
    let mut canvas = Canvas::new(SIZE.0, SIZE.1, GROUND);
    let [left, top, width, height] = PICTURE;
    canvas.write((left, 10), 1, FAINT, "simulated reconstruction");
    canvas.fill([left - 1, top - 1, width + 2, height + 2], FRAMING);
    canvas.fill([left, top, width, height], [0; 3]);
    if let Some(seen) = board.seen {
        let gray: Vec<u8> =
            seen.coded(Scale::Percentile(0.995)).iter().map(|level| (level * 255.0).round() as u8).collect();
        canvas.put_gray((left, top), seen.width, &gray);
    } else {
        canvas.write((left + 20, top + height / 2), 2, FAINT, "computing ...");
    }
    let (left, width) = COLUMN;
    let mut top = 10;
    if let Some(frame) = board.frame {
        let title = format!("frame, {} × {}, {} levels", frame.width, frame.height, 1u32 << frame.bits);
        canvas.write((left, top), 1, FAINT, &title);
        top += LETTER_HEIGHT + 9;
        let height = (width * frame.height / frame.width.max(1)).clamp(1, 200);
        let across = (height * frame.width / frame.height.max(1)).clamp(1, width);
        canvas.put_gray((left, top), across, &small(frame, across, height));
        top += height + 10;
        canvas.write((left, top), 1, FAINT, "how often each level occurs");
        top += LETTER_HEIGHT;
        histogram(&mut canvas, (left, top), &Histogram::of(frame));
        top += HISTOGRAM + 12;
    }
    for (name, value) in &board.lines {
        canvas.write((left, top), 1, FAINT, name);
        canvas.write((left + 84, top), 1, INK, value);
        top += LETTER_HEIGHT;
    }
    top += 4;
    for line in board.keys {
        canvas.write((left, top), 1, FAINT, line);
        top += LETTER_HEIGHT;
    }
    if let Some(warning) = board.warning {
        canvas.fill([0, SIZE.1 - 18, SIZE.0, 18], [120, 40, 20]);
        canvas.write((10, SIZE.1 - 13), 1, [255; 3], warning);
    }
    canvas
}

/// Rows of the histogram [px].
const HISTOGRAM: usize = 64;

fn histogram(canvas: &mut Canvas, (left, top): (usize, usize), Histogram(counts): &Histogram) {
    canvas.fill([left, top, 256, HISTOGRAM], [0; 3]);
    // The commonest level fills the height, but for a lone peak, which is cut: levels that are clipped to are many.
    let mut sorted = *counts;
    sorted.sort_unstable();
    let full = sorted[250].max(sorted[255] / 8).max(1);
    for (level, &count) in counts.iter().enumerate() {
        let height = (u64::from(count) * HISTOGRAM as u64).div_ceil(u64::from(full)).min(HISTOGRAM as u64) as usize;
        canvas.fill([left + level, top + HISTOGRAM - height, 1, height], BARS);
    }
}

/// Levels of the frame at the middles of cells, as 8 bits.
fn small(frame: &Frame, width: usize, height: usize) -> Vec<u8> {
    let most = f64::from((1u32 << frame.bits.min(16)) - 1).max(1.0);
    (0..width * height)
        .map(|i| {
            let column = (2 * (i % width) + 1) * frame.width / (2 * width);
            let row = (2 * (i / width) + 1) * frame.height / (2 * height);
            let level = frame.levels.get(row * frame.width + column).copied().unwrap_or(0);
            (255.0 * f64::from(level) / most).round() as u8
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panel::PanelProfile;

    #[test]
    fn the_picture_the_frame_and_its_levels_stand_where_they_are_said_to() {
        let profile = PanelProfile::generic().expect("generic");
        let count = profile.width * profile.height;
        // Left half 0, right half 255.
        let levels = (0..count).map(|i| if i % profile.width < profile.width / 2 { 0 } else { 255 }).collect();
        let frame = Frame::new(&profile, 633e-9, levels).expect("frame");
        let Histogram(counts) = Histogram::of(&frame);
        assert_eq!(
            (counts[0], counts[255], counts.iter().sum::<u32>()),
            (count as u32 / 2, count as u32 / 2, count as u32)
        );
        let values = (0..50 * 40).map(|i| if i % 50 < 10 { 1.0 } else { 0.0 }).collect();
        let seen = Picture { width: 50, height: 40, values };
        let lines = vec![("focus".to_owned(), "-120 mm".to_owned())];
        let canvas = draw(&Board { seen: Some(&seen), frame: Some(&frame), lines, ..Board::default() });
        let at = |x: usize, y: usize| canvas.pixels[y * canvas.width + x];
        assert_eq!((canvas.width, canvas.height), SIZE);
        let [left, top, ..] = PICTURE;
        assert_eq!((at(left + 9, top + 20), at(left + 10, top + 20)), ([255; 3], [0; 3]));
        assert_eq!((at(COLUMN.0 + 10, 60), at(COLUMN.0 + 330, 60)), ([0; 3], [255; 3]));
        // Two bars at the ends of the histogram.
        let row = (0..SIZE.1).find(|&y| at(COLUMN.0, y) == BARS).expect("the first bar");
        assert!(at(COLUMN.0 + 255, row) == BARS && (1..255).all(|x| at(COLUMN.0 + x, row + HISTOGRAM - 1) != BARS));
        assert!(draw(&Board { warning: Some("a"), ..Board::default() }) != draw(&Board::default()));
    }
}
