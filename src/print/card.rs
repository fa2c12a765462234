//! The card that is printed to find out what a printer makes of levels and lines: patches between five marks.
//!
//! Levels of 8 bits: steps from 0 to 255. One bit: lines of several periods and widths along x and along y, and error
//! diffusion of several tones, beside patches that are wholly open and wholly closed. Every patch is there twice, turned by
//! half a turn about the card's middle, so that an even slope of light over the scan cancels.
//!
//! A mark is a square in a ring in a ring, 3, 5 and 7 modules wide, as in printed codes: what lies in one another about one
//! place is found whatever the scan's scale, and whichever of the two is the dark one. The fifth mark tells the card's turn.

use crate::encode::error_diffusion::binarise;

/// Patches side by side.
const COLUMNS: u64 = 11;
/// Patches' widths from the card's edge to the first patch.
const MARGIN: u64 = 2;
/// Steps of the 8-bit card.
const STEPS: u32 = 32;
/// Tones of the one-bit card, as parts of this.
const TONES: u32 = 16;
/// Periods of the lines [px].
pub(super) const PERIODS: [u32; 6] = [4, 6, 8, 12, 16, 24];
/// Side of the block that error diffusion repeats [px].
const BLOCK: usize = 256;
/// Rows and columns before it, in which the errors settle [px].
const SETTLED: usize = 64;
/// Modules across a mark.
const MODULES: u64 = 7;

/// What a patch shows.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Patch {
    /// A level, 0 to 255; of one bit 0 or 1.
    Level(u8),
    /// Lines of the highest level, `width` of each `period` [px]; they follow one another along the axis, 0 for x.
    Lines { axis: usize, period: u32, width: u32 },
    /// Error diffusion of a tone, as a share of the highest level: a block that is repeated.
    Tone { wanted: f64, block: Vec<u8> },
}

/// A card of square patches.
#[derive(Clone, Debug)]
pub(super) struct Card {
    /// Side of a patch [px].
    pub(super) side: u64,
    bits: u8,
    /// The first half of the patches; the second is the same from the other end.
    pub(super) half: Vec<Patch>,
}

impl Card {
    /// The card for levels of 1 or 8 bits.
    pub(super) fn new(bits: u8, side: u64) -> Self {
        let half = if bits == 1 { lines_and_tones() } else { (0..=STEPS).map(step).collect() };
        Self { side, bits, half }
    }

    fn rows(&self) -> u64 {
        (2 * self.half.len() as u64).div_ceil(COLUMNS)
    }

    /// Columns and rows [px].
    pub(super) fn size(&self) -> [u64; 2] {
        [COLUMNS, self.rows()].map(|patches| (patches + 2 * MARGIN) * self.side)
    }

    /// Where the middles of the marks are [px from the card's upper left corner]: upper left, upper right, lower left, lower right,
    /// and the one that stands between the upper two.
    pub(super) fn marks(&self) -> [[f64; 2]; 5] {
        let side = self.side as f64;
        let [width, height] = self.size().map(|length| length as f64);
        let (right, below) = (width - side, height - side);
        [
            [side, side],
            [right, side],
            [side, below],
            [right, below],
            [side + ((width / side / 3.0).floor()) * side, side],
        ]
    }

    /// Upper left corner of one of all patches [px].
    pub(super) fn corner(&self, patch: usize) -> [f64; 2] {
        let patch = patch as u64;
        [patch % COLUMNS, patch / COLUMNS].map(|at| ((at + MARGIN) * self.side) as f64)
    }

    /// What one of all patches shows.
    pub(super) fn patch(&self, index: usize) -> Option<&Patch> {
        let last = 2 * self.half.len() - 1;
        if index > last { None } else { self.half.get(index.min(last - index)) }
    }

    /// Places of all patches that show one of the first half.
    pub(super) fn places(&self, half: usize) -> [usize; 2] {
        [half, 2 * self.half.len() - 1 - half]
    }

    /// Level of a pixel: 0 or 1, or 0 to 255.
    pub(super) fn level(&self, [column, row]: [u64; 2]) -> u8 {
        let highest = if self.bits == 1 { 1 } else { 255 };
        let [x, y] = [column, row].map(|at| (at / self.side).wrapping_sub(MARGIN));
        if x < COLUMNS && y < self.rows() {
            let at = [column, row].map(|at| at % self.side);
            return self.patch((y * COLUMNS + x) as usize).map_or(0, |patch| patch.level(at));
        }
        let module = (self.side / MODULES).max(1) as f64;
        for mark in self.marks() {
            let [dx, dy] = [column as f64 + 0.5 - mark[0], row as f64 + 0.5 - mark[1]];
            let ring = dx.abs().max(dy.abs()) / module;
            if ring < 3.5 {
                return if (1.5..2.5).contains(&ring) { 0 } else { highest };
            }
        }
        0
    }
}

fn step(i: u32) -> Patch {
    Patch::Level((f64::from(i) * 255.0 / f64::from(STEPS)).round() as u8)
}

fn lines_and_tones() -> Vec<Patch> {
    let mut out = vec![Patch::Level(0), Patch::Level(1)];
    for axis in 0..2 {
        for period in PERIODS {
            // Half of the period, and a quarter more or less where that is a whole pixel; else one pixel more or less.
            let quarter = (period / 4).max(1);
            out.extend([period / 2 - quarter, period / 2, period / 2 + quarter].map(|width| Patch::Lines {
                axis,
                period,
                width,
            }));
        }
    }
    out.extend((1..TONES).map(|i| {
        let wanted = f64::from(i) / f64::from(TONES);
        Patch::Tone { wanted, block: block(wanted) }
    }));
    out.extend([Patch::Level(1), Patch::Level(0)]);
    out
}

/// Error diffusion of an even tone after it has settled.
fn block(wanted: f64) -> Vec<u8> {
    let width = SETTLED + BLOCK;
    let mut values = vec![wanted as f32; width * width];
    binarise(&mut values, width);
    let rows = values.chunks_exact(width).skip(SETTLED);
    rows.flat_map(|row| row[SETTLED..].iter().map(|&v| u8::from(v > 0.5))).collect()
}

impl Patch {
    /// Level of one of its pixels.
    fn level(&self, at: [u64; 2]) -> u8 {
        match self {
            Self::Level(level) => *level,
            Self::Lines { axis, period, width } => u8::from(at[*axis] % u64::from(*period) < u64::from(*width)),
            Self::Tone { block, .. } => block[at[1] as usize % BLOCK * BLOCK + at[0] as usize % BLOCK],
        }
    }

    /// Share of its area that is drawn at the highest level.
    pub(super) fn share(&self) -> f64 {
        match self {
            Self::Level(level) => f64::from(*level),
            Self::Lines { period, width, .. } => f64::from(*width) / f64::from(*period),
            Self::Tone { block, .. } => block.iter().map(|&b| f64::from(b)).sum::<f64>() / block.len() as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_are_there_twice_and_have_their_shares() {
        for bits in [1, 8] {
            let card = Card::new(bits, 96);
            let count = 2 * card.half.len();
            assert!(card.patch(count).is_none() && card.rows() * COLUMNS >= count as u64);
            for half in 0..card.half.len() {
                let [a, b] = card.places(half);
                assert_eq!(card.patch(a), card.patch(b));
                let [ca, cb] = [card.corner(a), card.corner(b)];
                let [width, height] = card.size().map(|length| length as f64);
                assert!((ca[0] + cb[0] + 96.0 - width).abs() < 1e-9 && (ca[1] + cb[1] + 96.0 - height).abs() < 1e-9);
                // Counted in the pixels themselves.
                let [x, y] = ca.map(|at| at as u64);
                let all = (0..96 * 96).map(|i| f64::from(card.level([x + i % 96, y + i / 96]))).sum::<f64>();
                let share = all / (96.0 * 96.0);
                let most = if matches!(card.half[half], Patch::Tone { .. }) { 0.01 } else { 1e-12 };
                assert!((share - card.half[half].share()).abs() < most, "{:?}", card.half[half]);
            }
        }
    }
}
