//! Drive levels ↔ video signal, the last step of the fixed order; nothing after it may alter a byte.

use super::frame::{Frame, FrameMetadata};
use super::signal::SignalLayout;
use crate::error::{Error, Result};
use rayon::prelude::*;

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

impl SignalLayout {
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
        // Signal rows in parallel: a frame must be packed between two refreshes.
        let rows = rgb.par_chunks_mut(3 * self.width).skip(self.row_offset).take(size.1 * cells).enumerate();
        rows.for_each(|(signal_row, rgb)| {
            let row = signal_row / cells;
            let row = if self.flip_y { size.1 - 1 - row } else { row };
            for slot in 0..slots {
                let levels = &frames[slot % frames.len()].levels[row * size.0..(row + 1) * size.0];
                self.pack_row(levels, slot, signal_row % cells, rgb);
            }
        });
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panel::Packing;
    use crate::panel::PanelProfile;
    use proptest::prelude::*;

    const ALL: [Packing; 10] = [
        Packing::Gray,
        Packing::Gray1,
        Packing::Red,
        Packing::Green,
        Packing::Blue,
        Packing::Santec60,
        Packing::Santec120,
        Packing::Meadowlark10,
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
        assert_eq!(packed(Packing::Meadowlark10, 731), [0b1011_0110, 0, 0b11]);
        assert_eq!(packed(Packing::Meadowlark10, 1023), [255, 0, 3]);
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
