//! Test frames: patterns that show any change of level, shift, scaling or filtering.

use holodrive::display::DisplayFrame;
use holodrive::random::Random;

/// Pixels that carry a frame's number.
pub(crate) const NUMBER_BITS: u32 = 16;

/// Pixels as they are on a screen.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Picture {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) pixels: Vec<[u8; 3]>,
}

/// What the pixels of a test frame are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) enum Pattern {
    /// All 256 levels in each row, shifted from row to row.
    Ramp,
    /// Independent gray levels.
    Random(u64),
    /// Independent levels in each colour, as packed 10-bit panels have.
    Colours(u64),
    /// 0 and 255 alternating pixel by pixel: any scaling or filter makes gray of it.
    Checker,
}

impl Picture {
    pub(crate) fn new(pattern: Pattern, width: u32, height: u32) -> Self {
        let mut random = match pattern {
            Pattern::Random(seed) | Pattern::Colours(seed) => Random::new(seed, 0),
            Pattern::Ramp | Pattern::Checker => Random::new(0, 0),
        };
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            for x in 0..width {
                pixels.push(match pattern {
                    Pattern::Ramp => [((x + y) & 255) as u8; 3],
                    Pattern::Checker => [if (x + y) & 1 == 1 { 255 } else { 0 }; 3],
                    Pattern::Random(_) => [level(&mut random); 3],
                    Pattern::Colours(_) => [level(&mut random), level(&mut random), level(&mut random)],
                });
            }
        }
        Self { width, height, pixels }
    }

    /// A frame that carries its number in its first 16 pixels, black and white, in every row.
    pub(crate) fn numbered(number: u64, width: u32, height: u32) -> Self {
        let row: Vec<[u8; 3]> =
            (0..width)
                .map(|x| {
                    if x < NUMBER_BITS { [if number >> x & 1 == 1 { 255 } else { 0 }; 3] } else { [(x & 255) as u8; 3] }
                })
                .collect();
        Self { width, height, pixels: row.repeat(height as usize) }
    }

    /// The number that a captured row carries; none where it is not black and white.
    pub(crate) fn number(&self) -> Option<u64> {
        let bit = |pixel: &[u8; 3]| match pixel {
            [0, 0, 0] => Some(0),
            [255, 255, 255] => Some(1),
            _ => None,
        };
        let bits = self.pixels.iter().take(NUMBER_BITS as usize);
        bits.enumerate().try_fold(0, |number, (x, pixel)| Some(number | bit(pixel)? << x))
    }

    pub(crate) fn frame(&self) -> DisplayFrame {
        DisplayFrame::from_rgb(self.width, self.height, self.pixels.clone()).expect("frame")
    }

    /// Where and how much two pictures differ, in words.
    pub(crate) fn difference(&self, wanted: &Self) -> String {
        if (self.width, self.height) != (wanted.width, wanted.height) {
            return format!("size {}x{}, wanted {}x{}", self.width, self.height, wanted.width, wanted.height);
        }
        let differing =
            || self.pixels.iter().zip(&wanted.pixels).enumerate().filter(|(_, (seen, wanted))| seen != wanted);
        let first = differing().next().map(|(i, (seen, wanted))| {
            format!("first at {},{}: {seen:?}, wanted {wanted:?}", i as u32 % self.width, i as u32 / self.width)
        });
        format!("{} of {} pixels differ; {}", differing().count(), self.pixels.len(), first.unwrap_or_default())
    }
}

fn level(random: &mut Random) -> u8 {
    (random.bits() >> 56) as u8
}
