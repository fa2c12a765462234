//! A corner that toggles with every frame: a photodiode on it, or a video grabber, tells when frames really change.

use super::frame::DisplayFrame;
use crate::error::{Error, Result};
use std::str::FromStr;

/// Where the patch is, seen as the video signal is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Corner {
    TopLeft,
    TopRight,
    BottomLeft,
    BottomRight,
}

/// A square of video pixels in a corner: black in even frames, white in odd ones.
///
/// It covers what the frame has there. Black and white are 0 and 255 of all three channels, whatever the panel's packing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TriggerPatch {
    corner: Corner,
    side: u32,
}

impl FromStr for TriggerPatch {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || {
            let what = format!("\"{text}\" is not a corner and a side in pixels, such as bottom-right,64");
            Error::parameter("trigger-patch", what)
        };
        let (corner, side) = text.split_once(',').ok_or_else(wrong)?;
        let corner = match corner.trim() {
            "top-left" => Corner::TopLeft,
            "top-right" => Corner::TopRight,
            "bottom-left" => Corner::BottomLeft,
            "bottom-right" => Corner::BottomRight,
            _ => return Err(wrong()),
        };
        let side = side.trim().parse().ok().filter(|side| (1..=65_536).contains(side)).ok_or_else(wrong)?;
        Ok(Self { corner, side })
    }
}

impl TriggerPatch {
    /// Draws it into frame `number` of its panel.
    ///
    /// # Errors
    /// [`Error::Parameter`] when it is larger than the frame.
    pub(super) fn draw(self, frame: &mut DisplayFrame, number: u64) -> Result<()> {
        let (width, height) = (frame.width(), frame.height());
        if self.side > width || self.side > height {
            let what = format!("a patch of {} px does not fit in a frame of {width}x{height}", self.side);
            return Err(Error::parameter("trigger-patch", what));
        }
        let (right, bottom) = match self.corner {
            Corner::TopLeft => (false, false),
            Corner::TopRight => (true, false),
            Corner::BottomLeft => (false, true),
            Corner::BottomRight => (true, true),
        };
        let left = if right { width - self.side } else { 0 } as usize;
        let top = if bottom { height - self.side } else { 0 } as usize;
        let colour = [if number % 2 == 1 { 255 } else { 0 }; 3];
        let side = self.side as usize;
        for row in frame.pixels_mut().chunks_exact_mut(width as usize).skip(top).take(side) {
            row[left..left + side].fill(colour);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_patch_is_in_its_corner_and_nowhere_else() {
        let seen = |text: &str, number| {
            let mut frame = DisplayFrame::from_gray(5, 3, &[7; 15]).expect("frame");
            text.parse::<TriggerPatch>().expect(text).draw(&mut frame, number).expect("drawn");
            let levels: Vec<u8> = frame.pixels().iter().map(|pixel| pixel[0]).collect();
            levels.chunks(5).map(<[u8]>::to_vec).collect::<Vec<_>>()
        };
        let (b, w) = (0, 255);
        assert_eq!(seen("top-left,2", 0), [[b, b, 7, 7, 7], [b, b, 7, 7, 7], [7; 5]]);
        assert_eq!(seen("top-right,1", 1), [[7, 7, 7, 7, w], [7; 5], [7; 5]]);
        assert_eq!(seen("bottom-left, 1", 3), [[7; 5], [7; 5], [w, 7, 7, 7, 7]]);
        assert_eq!(seen("bottom-right,3", 2), [[7, 7, b, b, b]; 3]);
    }

    #[test]
    fn malformed_or_oversized_patches_are_refused() {
        for text in ["", "top-left", "top,8", "top-left,0", "top-left,-1", "top-left,99999999", "left-top,3"] {
            assert!(text.parse::<TriggerPatch>().is_err(), "{text}");
        }
        let mut frame = DisplayFrame::from_gray(5, 3, &[7; 15]).expect("frame");
        assert!("top-left,4".parse::<TriggerPatch>().expect("patch").draw(&mut frame, 0).is_err());
    }
}
