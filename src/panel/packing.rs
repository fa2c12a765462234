//! Drive levels ↔ video signal: how a pixel's level travels in the bits of a picture, and where the panel's pixels lie in
//! that picture. The last step of the fixed order; nothing after it may alter a byte.

use super::frame::{Frame, FrameMetadata};
use crate::error::{Error, Result};
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
            Self::Santec60 | Self::Santec120 => 10,
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
            Self::Planes24 => "planes-24",
            Self::Cells2x2 => "cells-2x2",
        }
    }
    /// Signal pixels that `width × height` panel pixels take.
    pub fn signal_size(self, width: usize, height: usize) -> (usize, usize) {
        let cells = self.cells();
        (width * cells, height * cells)
    }
    fn cells(self) -> usize {
        if self == Self::Cells2x2 { 2 } else { 1 }
    }

    /// Adds the level of frame `slot` to a video pixel; `cell` counts the signal pixels of one panel pixel, row by row.
    fn put(self, rgb: &mut [u8], level: u16, slot: usize, cell: usize) {
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
            Self::Planes24 => rgb[[1, 0, 2][slot / 8]] |= (level.min(1) as u8) << (slot % 8),
            Self::Cells2x2 => rgb.fill(if level >> cell & 1 == 1 { 255 } else { 0 }),
        }
    }

    /// The share of a level that a video pixel carries: the inverse of [`Packing::put`], summed over cells.
    fn take(self, rgb: &[u8], slot: usize, cell: usize) -> u16 {
        let [r, g, b] = [u16::from(rgb[0]), u16::from(rgb[1]), u16::from(rgb[2])];
        match self {
            Self::Gray | Self::Green => g,
            Self::Gray1 => g >> 7,
            Self::Red => r,
            Self::Blue => b,
            Self::Santec60 | Self::Santec120 if slot == 0 => (r >> 5) << 7 | (g >> 5) << 4 | b >> 4,
            Self::Santec60 | Self::Santec120 => (r >> 1 & 7) << 7 | (g >> 1 & 7) << 4 | b & 15,
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
    fn at(&self, size: (usize, usize), pixel: (usize, usize), cell: (usize, usize)) -> usize {
        let cells = self.packing.cells();
        let flip = |flip: bool, i: usize, n: usize| if flip { n - 1 - i } else { i };
        let column = self.column_offset + flip(self.flip_x, pixel.0, size.0) * cells + cell.0;
        let row = self.row_offset + flip(self.flip_y, pixel.1, size.1) * cells + cell.1;
        3 * (row * self.width + column)
    }

    /// Lays one or more frames into a video frame.
    ///
    /// Fewer frames than the packing carries are repeated, so that a single frame stands in every sub-frame.
    ///
    /// # Errors
    /// [`Error::Parameter`] when there are no frames or too many, when their sizes differ or do not fit, or when a level
    /// has more bits than the packing carries.
    pub fn pack(&self, frames: &[&Frame]) -> Result<VideoFrame> {
        let refuse = |what: String| Error::parameter("frame", what);
        let Some(first) = frames.first() else {
            return Err(refuse("there is none to pack".into()));
        };
        let slots = self.packing.frames();
        if frames.len() > slots {
            return Err(refuse(format!("{} frames; {} carries {slots}", frames.len(), self.packing.name())));
        }
        let size = (first.width, first.height);
        self.check(size.0, size.1, first.bits).map_err(refuse)?;
        for frame in frames {
            if (frame.width, frame.height) != size || frame.levels.len() != size.0 * size.1 {
                return Err(refuse(format!(
                    "frames of {}×{} and {}×{} in one signal",
                    frame.width, frame.height, size.0, size.1
                )));
            }
            if let Some(i) = frame.levels.iter().position(|&l| l >> self.packing.bits() != 0) {
                let (column, row) = (i % size.0, i / size.0);
                return Err(refuse(format!(
                    "level {} at column {column}, row {row} does not fit the signal",
                    frame.levels[i]
                )));
            }
        }
        let mut rgb = vec![0; 3 * self.width * self.height];
        let cells = self.packing.cells();
        for slot in 0..slots {
            let frame = frames[slot % frames.len()];
            for (row, line) in frame.levels.chunks_exact(size.0).enumerate() {
                for (cell_y, cell_x) in (0..cells).flat_map(|y| (0..cells).map(move |x| (y, x))) {
                    let cell = cell_y * cells + cell_x;
                    for (column, &level) in line.iter().enumerate() {
                        let at = self.at(size, (column, row), (cell_x, cell_y));
                        self.packing.put(&mut rgb[at..at + 3], level, slot, cell);
                    }
                }
            }
        }
        let mut metadata = first.metadata.clone();
        metadata.applied.packing = Some(self.packing.name().into());
        Ok(VideoFrame { width: self.width, height: self.height, rgb, metadata })
    }

    /// Levels of frame `slot` that a video frame carries, `width × height` of them.
    ///
    /// # Errors
    /// [`Error::Parameter`] when the picture is not of the signal's size or has no such slot.
    pub fn unpack(&self, signal: &VideoFrame, width: usize, height: usize, slot: usize) -> Result<Vec<u16>> {
        if (signal.width, signal.height) != (self.width, self.height) || slot >= self.packing.frames() {
            let what = format!(
                "slot {slot} of a {}×{} picture; the panel's signal is {}×{} with {} slots",
                signal.width,
                signal.height,
                self.width,
                self.height,
                self.packing.frames()
            );
            return Err(Error::parameter("signal", what));
        }
        self.check(width, height, 1).map_err(|what| Error::parameter("signal", what))?;
        let cells = self.packing.cells();
        Ok((0..width * height)
            .map(|i| {
                (0..cells * cells)
                    .map(|cell| {
                        let at = self.at((width, height), (i % width, i / width), (cell % cells, cell / cells));
                        self.packing.take(&signal.rgb[at..at + 3], slot, cell)
                    })
                    .fold(0, |level, part| level | part)
            })
            .collect())
    }
}

/// A picture as it goes over the cable: three bytes a pixel, row 0 on top.
#[derive(Clone, Debug, PartialEq)]
pub struct VideoFrame {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green and blue of each pixel.
    pub rgb: Vec<u8>,
    /// What the picture means; `applied.packing` names the packing.
    pub metadata: FrameMetadata,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panel::PanelProfile;
    use proptest::prelude::*;

    const ALL: [Packing; 9] = [
        Packing::Gray,
        Packing::Gray1,
        Packing::Red,
        Packing::Green,
        Packing::Blue,
        Packing::Santec60,
        Packing::Santec120,
        Packing::Planes24,
        Packing::Cells2x2,
    ];

    fn frame(width: usize, bits: u8, levels: Vec<u16>) -> Frame {
        let profile = PanelProfile::generic().expect("generic");
        let height = levels.len() / width;
        Frame { width, height, bits, levels, metadata: FrameMetadata::new(&profile, 633e-9) }
    }

    fn packed(packing: Packing, level: u16) -> Vec<u8> {
        SignalLayout::plain(1, 1, packing).pack(&[&frame(1, packing.bits(), vec![level])]).expect("pack").rgb
    }

    #[test]
    fn golden_bytes_of_each_packing() {
        // v = 0b1_0110_1101_1 = 731: top three bits 101, next three 101, low four 1011.
        assert_eq!(packed(Packing::Santec60, 731), [0b1010_0000, 0b1010_0000, 0b1011_0000]);
        assert_eq!(packed(Packing::Santec60, 1023), [224, 224, 240]);
        assert_eq!(packed(Packing::Santec60, 512), [128, 0, 0]);
        assert_eq!(packed(Packing::Santec120, 731), [0b1010_1010, 0b1010_1010, 0b1011_1011]);
        assert_eq!(packed(Packing::Santec120, 1023), [238, 238, 255]);
        assert_eq!(packed(Packing::Gray, 137), [137; 3]);
        assert_eq!(packed(Packing::Red, 137), [137, 0, 0]);
        assert_eq!(packed(Packing::Green, 137), [0, 137, 0]);
        assert_eq!(packed(Packing::Blue, 137), [0, 0, 137]);
        assert_eq!(packed(Packing::Gray1, 1), [255; 3]);
        assert_eq!(packed(Packing::Planes24, 1), [255; 3]);
        // 6 = 0110: top right and bottom left.
        assert_eq!(packed(Packing::Cells2x2, 6), [0, 0, 0, 255, 255, 255, 255, 255, 255, 0, 0, 0]);
    }

    #[test]
    fn sub_frames_and_planes_stay_apart() {
        let layout = SignalLayout::plain(1, 1, Packing::Santec120);
        let pair = layout.pack(&[&frame(1, 10, vec![731]), &frame(1, 10, vec![300])]).expect("pair");
        // 300 = 010_010_1100.
        assert_eq!(pair.rgb, [0b1010_0100, 0b1010_0100, 0b1011_1100]);
        let planes: Vec<Frame> = (0..24).map(|k| frame(1, 1, vec![u16::from(k == 0 || k == 9 || k == 23)])).collect();
        let layout = SignalLayout::plain(1, 1, Packing::Planes24);
        let video = layout.pack(&planes.iter().collect::<Vec<_>>()).expect("planes");
        assert_eq!(video.rgb, [0b10, 0b1, 0b1000_0000]);
        for (slot, plane) in planes.iter().enumerate() {
            assert_eq!(layout.unpack(&video, 1, 1, slot).expect("unpack"), plane.levels);
        }
    }

    #[test]
    fn offset_and_flips_place_the_panel_in_the_signal() {
        let layout = SignalLayout {
            width: 5,
            height: 3,
            column_offset: 2,
            row_offset: 1,
            flip_x: true,
            flip_y: false,
            ..SignalLayout::plain(2, 2, Packing::Gray)
        };
        let video = layout.pack(&[&frame(2, 8, vec![1, 2, 3, 4])]).expect("pack");
        let gray: Vec<u8> = video.rgb.iter().step_by(3).copied().collect();
        assert_eq!(gray, [0, 0, 0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 4, 3, 0]);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let layout = SignalLayout::plain(2, 1, Packing::Gray);
        assert!(layout.pack(&[]).is_err());
        assert!(layout.pack(&[&frame(2, 8, vec![1, 256])]).expect_err("level").to_string().contains("column 1"));
        assert!(layout.pack(&[&frame(1, 8, vec![1, 2])]).is_err());
        assert!(layout.pack(&[&frame(2, 10, vec![1, 2])]).is_err());
        assert!(layout.pack(&[&frame(2, 8, vec![1, 2]), &frame(2, 8, vec![1, 2])]).is_err());
    }

    proptest! {
        #[test]
        fn every_level_comes_back_from_every_packing(
            which in 0..ALL.len(),
            seed in 0u64..1 << 40,
            offset in (0usize..4, 0usize..4),
            flip in (any::<bool>(), any::<bool>()),
        ) {
            let packing = ALL[which];
            let (width, height) = (5, 3);
            let mut random = crate::random::Random::new(seed, 0);
            let levels: Vec<u16> = (0..width * height).map(|_| (random.bits() & ((1 << packing.bits()) - 1)) as u16).collect();
            let plain = SignalLayout::plain(width, height, packing);
            let layout = SignalLayout {
                width: plain.width + offset.0 + 1,
                height: plain.height + offset.1,
                column_offset: offset.0,
                row_offset: offset.1,
                flip_x: flip.0,
                flip_y: flip.1,
                ..plain
            };
            let video = layout.pack(&[&frame(width, packing.bits(), levels.clone())]).expect("pack");
            for slot in 0..packing.frames() {
                prop_assert_eq!(&layout.unpack(&video, width, height, slot).expect("unpack"), &levels);
            }
        }
    }
}
