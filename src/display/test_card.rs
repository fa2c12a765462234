//! A card on which an eye or a capture card sees whether levels and pixels arrive unchanged.

use super::frame::DisplayFrame;
use crate::error::Result;

/// A test card: a capture card, or an eye with a magnifier, sees on it whether pixels are shown one for one.
///
/// From the edge inwards: a white line of one pixel, a black one; four corner fields of 1-pixel checkerboard (gray or
/// striped when scaled or filtered); across the middle all 256 levels as a ramp, each `width/256` columns wide, above a
/// row of the levels 0–15 and 240–255 in sixteenths (of limited-range RGB the outer ones look alike); and `number` as 16
/// black and white fields, most significant first, to tell one card from another.
pub fn test_card(width: u32, height: u32, number: u16) -> Result<DisplayFrame> {
    let field = (width.min(height) / 5).max(1);
    let level = |x: u32, y: u32| -> u8 {
        let (right, bottom) = (width - 1 - x, height - 1 - y);
        let edge = x.min(y).min(right).min(bottom);
        // Tenths of the height; a width below 2³² and a count below 256 fit a 64-bit product.
        let (band, across) = (u64::from(y) * 10 / u64::from(height), u64::from(x));
        let place = |count: u64| (across * count / u64::from(width)) as u32;
        match (edge, band) {
            (0, _) => 255,
            (1, _) => 0,
            _ if x.min(right) < field && y.min(bottom) < field => ((x + y) % 2 * 255) as u8,
            (_, 4) => place(256) as u8,
            (_, 5) => match place(32) as u8 {
                dark @ 0..16 => dark,
                bright => 224 + bright,
            },
            (_, 7) => (number >> (15 - place(16)) & 1) as u8 * 255,
            _ => 128,
        }
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [level(x, y); 3])).collect();
    DisplayFrame::from_rgb(width, height, pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_test_card_carries_its_border_levels_and_number() {
        let (width, height) = (1920, 1080);
        let card = test_card(width, height, 0b1000_0000_0000_0101).expect("card");
        let at = |x: u32, y: u32| card.pixels()[(y * width + x) as usize][0];
        assert!((0..width).all(|x| at(x, 0) == 255 && at(x, height - 1) == 255));
        assert!((1..height - 1).all(|y| at(0, y) == 255 && at(1, y) == 0));
        assert_eq!([at(10, 10), at(11, 10), at(10, 11), at(11, 11)], [0, 255, 255, 0]);
        let ramp: Vec<u8> = (2..width - 2).map(|x| at(x, height * 9 / 20)).collect();
        assert!(ramp.is_sorted() && (0..=255).all(|level| ramp.contains(&level)));
        let bits: u16 =
            (0..16).fold(0, |number, bit| number << 1 | u16::from(at(60 + bit * 120, height * 3 / 4) == 255));
        assert_eq!(bits, 0b1000_0000_0000_0101);
        for (width, height) in [(1, 1), (3, 2), (1367, 769)] {
            assert!(test_card(width, height, 1).is_ok());
        }
        assert!(test_card(0, 5, 1).is_err());
    }
}
