//! The frame as it leaves for the monitor: packed 8-bit RGB video pixels.

use crate::error::{Error, Result};
use crate::files;
use crate::panel::{Frame, VideoFrame};
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder as _};
use std::path::Path;

/// One video frame: 8-bit RGB, row-major, row 0 on top, exactly the monitor's size.
///
/// How drive levels (8 or 10 bits, one panel or three by colour) are packed into video pixels is the panel's matter; a
/// frame is shown as it is, bit for bit, without gamma, blending or scaling.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DisplayFrame {
    width: u32,
    height: u32,
    pixels: Vec<[u8; 3]>,
}

impl DisplayFrame {
    /// A frame of packed RGB pixels.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] when a side is zero or `pixels` does not hold `width × height` of them.
    pub fn from_rgb(width: u32, height: u32, pixels: Vec<[u8; 3]>) -> Result<Self> {
        Self::check(width, height, pixels.len())?;
        Ok(Self { width, height, pixels })
    }

    /// A frame whose three channels carry the same level.
    ///
    /// # Errors
    ///
    /// As [`DisplayFrame::from_rgb`].
    pub fn from_gray(width: u32, height: u32, levels: &[u8]) -> Result<Self> {
        Self::check(width, height, levels.len())?;
        Ok(Self { width, height, pixels: levels.iter().map(|&level| [level; 3]).collect() })
    }

    /// The video signal of a panel.
    ///
    /// # Errors
    ///
    /// As [`DisplayFrame::from_rgb`].
    pub fn from_video(video: VideoFrame) -> Result<Self> {
        // The same memory, read as pixels.
        let pixels =
            bytemuck::allocation::try_cast_vec(video.rgb).unwrap_or_else(|(_, rgb)| rgb.as_chunks().0.to_vec());
        Self::from_rgb(video.width as u32, video.height as u32, pixels)
    }

    /// Frames of drive levels, one or as many as the panel's signal carries at once, packed as its profile says.
    ///
    /// # Errors
    ///
    /// Those of [`crate::panel::VideoSignal::pack`].
    pub fn packed(frames: &[&Frame]) -> Result<Self> {
        let Some(first) = frames.first() else { return Err(Error::parameter("frame", "there is none to show")) };
        Self::from_video(first.metadata.panel.signal.pack(frames)?)
    }

    /// Width [px].
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height [px].
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The pixels, row-major, row 0 on top.
    pub fn pixels(&self) -> &[[u8; 3]] {
        &self.pixels
    }

    /// Writes it as a PNG.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] when the file cannot be written.
    pub fn write_png(&self, path: &Path) -> Result<()> {
        let refused = |error: image::ImageError| Error::unsupported(format!("{}: {error}", path.display()));
        files::write_whole(path, |out| {
            let (pixels, kind) = (self.pixels.as_flattened(), ExtendedColorType::Rgb8);
            PngEncoder::new(out).write_image(pixels, self.width, self.height, kind).map_err(refused)
        })
    }

    /// The pixels, to be drawn into.
    pub(super) fn pixels_mut(&mut self) -> &mut [[u8; 3]] {
        &mut self.pixels
    }

    fn check(width: u32, height: u32, given: usize) -> Result<()> {
        if width == 0 || height == 0 {
            return Err(Error::parameter("frame", format!("{width}x{height} px has no pixels")));
        }
        if u64::from(width) * u64::from(height) != given as u64 {
            return Err(Error::parameter("frame", format!("{given} pixels given for a frame of {width}x{height}")));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gray_levels_go_to_all_three_channels() {
        let frame = DisplayFrame::from_gray(3, 2, &[0, 1, 2, 253, 254, 255]).expect("frame");
        assert_eq!(frame.pixels(), &[[0; 3], [1; 3], [2; 3], [253; 3], [254; 3], [255; 3]]);
        assert_eq!((frame.width(), frame.height()), (3, 2));
    }

    #[test]
    fn a_frame_with_too_few_pixels_or_none_is_refused() {
        assert!(DisplayFrame::from_gray(3, 2, &[0; 5]).is_err());
        assert!(DisplayFrame::from_rgb(0, 2, Vec::new()).is_err());
        // Would overflow a 32-bit product.
        assert!(DisplayFrame::from_gray(65_536, 65_536, &[]).is_err());
    }
}
