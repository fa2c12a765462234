//! How a pixel's level travels in the bits of a video signal, and where the panel's pixels lie in it.

use serde::{Deserialize, Serialize};

/// How a level is laid into the three bytes of a video pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Packing {
    /// The level in all three channels (up to 8 bits).
    Gray,
    /// One bit: 0 or 255 in all three channels.
    Gray1,
    /// The level in the red channel, the others dark (up to 8 bits).
    Red,
    /// The level in the green channel.
    Green,
    /// The level in the blue channel.
    Blue,
    /// Santec at 60 Hz, ten bits v: R = (v≫7 & 7)≪5, G = (v≫4 & 7)≪5, B = (v & 15)≪4.
    #[serde(rename = "santec-60")]
    Santec60,
    /// Santec at 120 Hz: the first sub-frame as at 60 Hz, the second in R\[3:1\], G\[3:1\], B\[3:0\].
    #[serde(rename = "santec-120")]
    Santec120,
    /// Meadowlark over HDMI, ten bits v: R = v≫2, and the two lowest bits in those of blue. The maker's own text was not at hand;
    /// this is what openwfs sends to such a panel (IvoVellekoop/openwfs, pull request 73).
    #[serde(rename = "meadowlark-10")]
    Meadowlark10,
    /// 24 one-bit frames a video frame, in the order green 0 … 7, red 0 … 7, blue 0 … 7 of a DLP controller's pattern
    /// mode.
    #[serde(rename = "planes-24")]
    Planes24,
    /// Four bits as 2 × 2 one-bit signal pixels: bit 0 top left, 1 top right, 2 bottom left, 3 bottom right.
    #[serde(rename = "cells-2x2")]
    Cells2x2,
}

impl Packing {
    /// Most bits a level may have.
    pub fn bits(self) -> u8 {
        match self {
            Self::Gray | Self::Red | Self::Green | Self::Blue => 8,
            Self::Gray1 | Self::Planes24 => 1,
            Self::Santec60 | Self::Santec120 | Self::Meadowlark10 => 10,
            Self::Cells2x2 => 4,
        }
    }
    /// Frames that one video frame carries.
    pub fn frames(self) -> usize {
        match self {
            Self::Santec120 => 2,
            Self::Planes24 => 24,
            _ => 1,
        }
    }
    /// The name that profiles and metadata use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gray => "gray",
            Self::Gray1 => "gray1",
            Self::Red => "red",
            Self::Green => "green",
            Self::Blue => "blue",
            Self::Santec60 => "santec-60",
            Self::Santec120 => "santec-120",
            Self::Meadowlark10 => "meadowlark-10",
            Self::Planes24 => "planes-24",
            Self::Cells2x2 => "cells-2x2",
        }
    }
    /// Signal pixels that `width × height` panel pixels take.
    pub fn signal_size(self, width: usize, height: usize) -> (usize, usize) {
        let cells = self.cells();
        (width * cells, height * cells)
    }
    pub(super) fn cells(self) -> usize {
        if self == Self::Cells2x2 { 2 } else { 1 }
    }

    /// Adds the level of frame `slot` to a video pixel; `cell` counts the signal pixels of one panel pixel, row by row.
    pub(super) fn put(self, rgb: &mut [u8], level: u16, slot: usize, cell: usize) {
        let byte = level as u8;
        match self {
            Self::Gray => rgb.fill(byte),
            Self::Gray1 => rgb.fill(if level > 0 { 255 } else { 0 }),
            Self::Red => rgb[0] = byte,
            Self::Green => rgb[1] = byte,
            Self::Blue => rgb[2] = byte,
            Self::Santec60 | Self::Santec120 => {
                let [r, g, b] = [(level >> 7 & 7) as u8, (level >> 4 & 7) as u8, (level & 15) as u8];
                let shift = if slot == 0 { [5, 5, 4] } else { [1, 1, 0] };
                rgb[0] |= r << shift[0];
                rgb[1] |= g << shift[1];
                rgb[2] |= b << shift[2];
            }
            Self::Meadowlark10 => {
                rgb[0] = (level >> 2) as u8;
                rgb[2] = (level & 3) as u8;
            }
            Self::Planes24 => rgb[[1, 0, 2][slot / 8]] |= (level.min(1) as u8) << (slot % 8),
            Self::Cells2x2 => rgb.fill(if level >> cell & 1 == 1 { 255 } else { 0 }),
        }
    }

    /// The share of a level that a video pixel carries: the inverse of [`Packing::put`], summed over cells.
    pub(super) fn take(self, rgb: &[u8], slot: usize, cell: usize) -> u16 {
        let [r, g, b] = [u16::from(rgb[0]), u16::from(rgb[1]), u16::from(rgb[2])];
        match self {
            Self::Gray | Self::Green => g,
            Self::Gray1 => g >> 7,
            Self::Red => r,
            Self::Blue => b,
            Self::Santec60 | Self::Santec120 if slot == 0 => (r >> 5) << 7 | (g >> 5) << 4 | b >> 4,
            Self::Santec60 | Self::Santec120 => (r >> 1 & 7) << 7 | (g >> 1 & 7) << 4 | b & 15,
            Self::Meadowlark10 => r << 2 | b & 3,
            Self::Planes24 => [g, r, b][slot / 8] >> (slot % 8) & 1,
            Self::Cells2x2 => (g >> 7) << cell,
        }
    }
}

/// Where the panel's pixels lie in the video signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SignalLayout {
    /// How levels are laid into video pixels.
    pub packing: Packing,
    /// Columns of the video signal.
    pub width: usize,
    /// Rows of the video signal.
    pub height: usize,
    /// Signal column of the panel's first column.
    pub column_offset: usize,
    /// Signal row of the panel's first row.
    pub row_offset: usize,
    /// Whether the signal's columns run towards −x.
    pub flip_x: bool,
    /// Whether the signal's rows run towards +y.
    pub flip_y: bool,
}

impl SignalLayout {
    /// A signal of the panel's own size.
    pub fn plain(width: usize, height: usize, packing: Packing) -> Self {
        let (width, height) = packing.signal_size(width, height);
        Self { packing, width, height, column_offset: 0, row_offset: 0, flip_x: false, flip_y: false }
    }

    /// Says what is wrong when `width × height` pixels of `bits` bits do not fit.
    pub(super) fn check(&self, width: usize, height: usize, bits: u8) -> Result<(), String> {
        let (w, h) = self.packing.signal_size(width, height);
        if bits > self.packing.bits() {
            let (name, most) = (self.packing.name(), self.packing.bits());
            return Err(format!("signal.packing = \"{name}\" carries {most} bits, the panel has {bits}"));
        }
        if self.width < w + self.column_offset || self.height < h + self.row_offset {
            return Err(format!(
                "signal {}×{} is too small for {w}×{h} pixels at offset ({}, {})",
                self.width, self.height, self.column_offset, self.row_offset
            ));
        }
        Ok(())
    }

    /// Byte position in the signal of cell (`cell_x`, `cell_y`) of panel pixel (`column`, `row`).
    pub(super) fn at(&self, size: (usize, usize), pixel: (usize, usize), cell: (usize, usize)) -> usize {
        let cells = self.packing.cells();
        let flip = |flip: bool, i: usize, n: usize| if flip { n - 1 - i } else { i };
        let column = self.column_offset + flip(self.flip_x, pixel.0, size.0) * cells + cell.0;
        let row = self.row_offset + flip(self.flip_y, pixel.1, size.1) * cells + cell.1;
        3 * (row * self.width + column)
    }

    /// Lays a row of levels into row `cell_y` of its cells, in a row of the signal.
    pub(super) fn pack_row(&self, levels: &[u16], slot: usize, cell_y: usize, rgb: &mut [u8]) {
        let cells = self.packing.cells();
        let rgb = &mut rgb[3 * self.column_offset..3 * (self.column_offset + levels.len() * cells)];
        let pixels = rgb.chunks_exact_mut(3 * cells);
        let put = |pixel: &mut [u8], level: u16| {
            for (cell_x, rgb) in pixel.chunks_exact_mut(3).enumerate() {
                self.packing.put(rgb, level, slot, cell_y * cells + cell_x);
            }
        };
        match (self.packing, self.flip_x) {
            // The most common one, without the detours of the others.
            (Packing::Gray, false) => pixels.zip(levels).for_each(|(pixel, &level)| pixel.fill(level as u8)),
            (_, false) => pixels.zip(levels).for_each(|(pixel, &level)| put(pixel, level)),
            (_, true) => pixels.zip(levels.iter().rev()).for_each(|(pixel, &level)| put(pixel, level)),
        }
    }
}
