//! Frames as pictures: gray PNG with the metadata inside, and the pictures of other programs.
//!
//! A level is stored as it is, never scaled: in 1, 2, 4, 8 or 16 bits a pixel, the least that holds the panel's. The
//! metadata is JSON in an `iTXt` chunk with the keyword `holodrive`.

use super::frame::{Frame, FrameMetadata};
use super::packing::VideoFrame;
use super::profile::PanelProfile;
use super::signal::{Packing, SignalLayout};
use crate::error::{Error, Result};
use crate::files::{self, pictures};
use crate::units::show_length;
use std::io::Cursor;
use std::path::Path;

/// Keyword of the text chunk.
const KEYWORD: &str = "holodrive";

impl Frame {
    /// Writes a gray PNG of the levels with the metadata; the file appears whole or not at all.
    ///
    /// # Errors
    /// [`Error::Parameter`] for levels that are not as many as the pixels or do not fit their bits; [`Error::Io`].
    pub fn write(&self, path: &Path) -> Result<()> {
        self.check_levels()?;
        let (depth, bytes) = match self.bits {
            0 | 1 => (png::BitDepth::One, self.packed_rows(1)),
            2 => (png::BitDepth::Two, self.packed_rows(2)),
            3 | 4 => (png::BitDepth::Four, self.packed_rows(4)),
            5..=8 => (png::BitDepth::Eight, self.levels.iter().map(|&l| l as u8).collect()),
            _ => (png::BitDepth::Sixteen, self.levels.iter().flat_map(|l| l.to_be_bytes()).collect()),
        };
        write_png(path, self.width, self.height, png::ColorType::Grayscale, depth, &bytes, Some(&self.metadata))
    }

    /// Levels of `bits` bits, first pixel in the high bits of a byte, each row beginning a new byte.
    fn packed_rows(&self, bits: usize) -> Vec<u8> {
        let per_byte = 8 / bits;
        let pack = |levels: &[u16]| {
            levels.iter().enumerate().fold(0, |byte, (i, &l)| byte | (l as u8) << (8 - bits * (i + 1)))
        };
        self.levels.chunks(self.width).flat_map(|row| row.chunks(per_byte).map(pack)).collect()
    }

    /// Reads a frame from a picture: one that [`Frame::write`] or [`VideoFrame::write`] made, or (when a profile is
    /// given) any 8- or 16-bit gray or RGB PNG or BMP of drive levels.
    ///
    /// A picture whose channels differ, or of the size of the panel's video signal, is unpacked by the profile's
    /// layout. Black and white count as levels 0 and 1 of a one-bit panel. `profile` and `wavelength` [m] overrule what
    /// the file says; warnings are returned beside the frame.
    ///
    /// # Errors
    /// [`Error::Input`] when the file is no such picture, does not fit the panel, or has no metadata while no profile
    /// is given.
    pub fn read(path: &Path, profile: Option<&PanelProfile>, wavelength: Option<f64>) -> Result<(Self, Vec<String>)> {
        let bytes = std::fs::read(path).map_err(Error::io(path))?;
        let (picture, metadata) = decode(path, &bytes, profile)?;
        let mut warnings = Vec::new();
        let mut metadata = match (metadata, profile) {
            (Some(metadata), _) => metadata,
            (None, Some(profile)) => {
                warnings.push(format!("{}: no metadata: the pixels are taken as drive levels", path.display()));
                FrameMetadata::new(profile, wavelength.unwrap_or(profile.default_wavelength()))
            }
            (None, None) => {
                let what = "the picture does not say for which panel it is; name the panel";
                return Err(Error::input(path, what));
            }
        };
        let target = profile.unwrap_or(&metadata.panel).clone();
        let levels = picture.levels(path, &target, metadata.applied.packing.as_deref())?;
        if target.name != metadata.panel.name {
            let made = &metadata.panel.name;
            warnings.push(format!("{}: made for panel {made}, read for {}", path.display(), target.name));
        }
        if let Some(wavelength) = wavelength
            && (wavelength - metadata.wavelength).abs() > 1e-12
        {
            let (made, now) = (show_length(metadata.wavelength), show_length(wavelength));
            warnings.push(format!("{}: made for {made}, read for {now}", path.display()));
            metadata.wavelength = wavelength;
        }
        metadata.applied.packing = None;
        metadata.panel = target;
        let mut frame =
            Frame::new(&metadata.panel, metadata.wavelength, levels).map_err(|e| Error::input(path, e.to_string()))?;
        frame.metadata = metadata;
        Ok((frame, warnings))
    }
}

impl VideoFrame {
    /// Reads a picture of a video signal that carries several frames, as it is; `None` where the picture is drive levels, or
    /// the panel's packing carries one frame. `profile` overrules what the file says where it was `named`.
    ///
    /// # Errors
    /// As [`Frame::read`].
    pub fn read_packed(
        path: &Path,
        profile: &PanelProfile,
        named: bool,
        wavelength: Option<f64>,
    ) -> Result<Option<Self>> {
        if named && profile.signal.packing.frames() == 1 {
            return Ok(None);
        }
        let bytes = std::fs::read(path).map_err(Error::io(path))?;
        let mut panel = profile.clone();
        if !named && bytes.starts_with(b"\x89PNG") {
            // Metadata stand before the pixels.
            let fail = |e: png::DecodingError| Error::input(path, format!("not a readable PNG: {e}"));
            let reader = png::Decoder::new(Cursor::new(&bytes[..])).read_info().map_err(fail)?;
            if let Some(metadata) = text_chunk(path, reader.info())? {
                panel = metadata.panel;
            }
        }
        let layout = &panel.signal;
        if layout.packing.frames() == 1 {
            return Ok(None);
        }
        let (picture, metadata) = decode(path, &bytes, Some(&panel))?;
        let packed = metadata.as_ref().and_then(|m| m.applied.packing.as_deref());
        let rgb = match picture {
            Picture::Rgb { width, height, rgb }
                if (width, height) == (layout.width, layout.height) && (packed.is_some() || !is_gray(&rgb)) =>
            {
                rgb
            }
            _ => return Ok(None),
        };
        if let Some(name) = packed.filter(|name| *name != layout.packing.name()) {
            let what = format!("packed as {name}, but {} takes {}", panel.name, layout.packing.name());
            return Err(Error::input(path, what));
        }
        let at = wavelength.or(metadata.as_ref().map(|m| m.wavelength)).unwrap_or(panel.default_wavelength());
        let mut metadata = metadata.unwrap_or_else(|| FrameMetadata::new(&panel, at));
        metadata.applied.packing = Some(layout.packing.name().into());
        let (width, height) = (layout.width, layout.height);
        metadata.panel = panel;
        Ok(Some(Self { width, height, rgb, metadata }))
    }

    /// Writes an RGB PNG of the video signal with the metadata; the file appears whole or not at all.
    pub fn write(&self, path: &Path) -> Result<()> {
        write_png(
            path,
            self.width,
            self.height,
            png::ColorType::Rgb,
            png::BitDepth::Eight,
            &self.rgb,
            Some(&self.metadata),
        )
    }
}

/// Writes a PNG, with metadata where there are some; the file appears whole or not at all.
pub(super) fn write_png(
    path: &Path,
    width: usize,
    height: usize,
    color: png::ColorType,
    depth: png::BitDepth,
    bytes: &[u8],
    metadata: Option<&FrameMetadata>,
) -> Result<()> {
    let fail = |e: png::EncodingError| match e {
        png::EncodingError::IoError(source) => Error::Io { path: path.into(), source },
        other => Error::unsupported(format!("{}: {other}", path.display())),
    };
    let json = metadata
        .map(serde_json::to_string)
        .transpose()
        .map_err(|e| Error::unsupported(format!("{}: {e}", path.display())))?;
    files::write_whole(path, |file| {
        let mut encoder = png::Encoder::new(file, width as u32, height as u32);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if let Some(json) = json {
            encoder.add_itxt_chunk(KEYWORD.into(), json).map_err(fail)?;
        }
        let mut writer = encoder.write_header().map_err(fail)?;
        writer.write_image_data(bytes).map_err(fail)?;
        writer.finish().map_err(fail)
    })
}

/// A decoded picture: gray values as stored, or three channels.
enum Picture {
    Gray { width: usize, height: usize, white: u16, values: Vec<u16> },
    Rgb { width: usize, height: usize, rgb: Vec<u8> },
}

/// Refuses a picture by its header, before memory is taken for its pixels: of neither the size of the panel nor of its
/// signal, or of no known panel.
fn check_size(path: &Path, size: [u32; 2], profile: Option<&PanelProfile>) -> Result<()> {
    let Some(profile) = profile else {
        return Err(Error::input(path, "the picture does not say for which panel it is; name the panel"));
    };
    let size = size.map(|side| side as usize);
    let signal = [profile.signal.width, profile.signal.height];
    if size == [profile.width, profile.height] || size == signal {
        return Ok(());
    }
    let ([width, height], panel) = (size, [profile.width, profile.height]);
    let what = format!("the picture is {width}×{height}; panel {} has {}×{}", profile.name, panel[0], panel[1]);
    Err(Error::input(path, what))
}

/// The picture and what it says of itself; `profile` is the panel that it is read for, where that is known.
fn decode(path: &Path, bytes: &[u8], profile: Option<&PanelProfile>) -> Result<(Picture, Option<FrameMetadata>)> {
    let mut metadata = None;
    if bytes.starts_with(b"\x89PNG") {
        let fail = |e: png::DecodingError| Error::input(path, format!("not a readable PNG: {e}"));
        let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().map_err(fail)?;
        let before = text_chunk(path, reader.info())?;
        let header = [reader.info().width, reader.info().height];
        check_size(path, header, profile.or(before.as_ref().map(|metadata| &metadata.panel)))?;
        let size = reader.output_buffer_size().ok_or_else(|| Error::input(path, "the picture is too large"))?;
        let mut data = vec![0; size];
        let info = reader.next_frame(&mut data).map_err(fail)?;
        reader.finish().map_err(fail)?;
        metadata = text_chunk(path, reader.info())?;
        if info.color_type == png::ColorType::Grayscale {
            let (width, height) = (info.width as usize, info.height as usize);
            let values = match info.bit_depth {
                png::BitDepth::Sixteen => data.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect(),
                png::BitDepth::Eight => data[..width * height].iter().map(|&b| u16::from(b)).collect(),
                depth => unpacked_rows(&data, width, height, depth as usize),
            };
            let white = ((1u32 << info.bit_depth as u32) - 1) as u16;
            return Ok((Picture::Gray { width, height, white, values }, metadata));
        }
    }
    let unreadable = |why: String| Error::input(path, format!("not a readable picture: {why}"));
    let (width, height) = pictures::dimensions(bytes).map_err(unreadable)?;
    check_size(path, [width, height], profile.or(metadata.as_ref().map(|m: &FrameMetadata| &m.panel)))?;
    let image = pictures::decode(bytes).map_err(unreadable)?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let picture = match image {
        image::DynamicImage::ImageLuma8(gray) => {
            let values = gray.into_raw().into_iter().map(u16::from).collect();
            Picture::Gray { width, height, white: 255, values }
        }
        image::DynamicImage::ImageLuma16(gray) => {
            Picture::Gray { width, height, white: u16::MAX, values: gray.into_raw() }
        }
        other if other.color().bits_per_pixel() / u16::from(other.color().channel_count()) == 8 => {
            Picture::Rgb { width, height, rgb: other.into_rgb8().into_raw() }
        }
        _ => return Err(Error::input(path, "a colour picture of drive levels needs 8 bits a channel")),
    };
    Ok((picture, metadata))
}

fn unpacked_rows(data: &[u8], width: usize, height: usize, bits: usize) -> Vec<u16> {
    let row_bytes = (width * bits).div_ceil(8);
    let mask = (1u16 << bits) - 1;
    (0..width * height)
        .map(|i| {
            let bit = i % width * bits;
            u16::from(data[i / width * row_bytes + bit / 8]) >> (8 - bits - bit % 8) & mask
        })
        .collect()
}

fn text_chunk(path: &Path, info: &png::Info<'_>) -> Result<Option<FrameMetadata>> {
    let international = info.utf8_text.iter().find(|chunk| chunk.keyword == KEYWORD);
    let text = match international {
        Some(chunk) => chunk.get_text().map_err(|e| Error::input(path, format!("its metadata cannot be read: {e}")))?,
        None => match info.uncompressed_latin1_text.iter().find(|chunk| chunk.keyword == KEYWORD) {
            Some(chunk) => chunk.text.clone(),
            None => return Ok(None),
        },
    };
    let said: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    if said.get("simulated").is_some() && said.get("panel").is_none() {
        return Err(Error::input(path, "is a picture of what is seen, not a frame of levels; give the frame"));
    }
    let metadata: FrameMetadata = serde_json::from_str(&text)
        .map_err(|e| Error::input(path, format!("its metadata is damaged ({e}); write the frame again")))?;
    metadata
        .check()
        .map_err(|what| Error::input(path, format!("its metadata is wrong ({what}); write the frame again")))?;
    Ok(Some(metadata))
}

impl Picture {
    /// The drive levels in the picture, for a panel; `packing` is what the metadata says of a video signal.
    fn levels(self, path: &Path, profile: &PanelProfile, packing: Option<&str>) -> Result<Vec<u16>> {
        let (panel, layout) = ((profile.width, profile.height), &profile.signal);
        if let Some(name) = packing
            && name != layout.packing.name()
        {
            let what = format!("packed as {name}, but {} takes {}", profile.name, layout.packing.name());
            return Err(Error::input(path, what));
        }
        let white_is_one = |mut values: Vec<u16>, white: u16| {
            // Other programs write one bit as black and white.
            if profile.bits == 1 && values.iter().all(|&v| v == 0 || v == white) {
                values.iter_mut().for_each(|v| *v = u16::from(*v > 0));
            }
            values
        };
        match self {
            Self::Gray { width, height, white, values } if (width, height) == panel => Ok(white_is_one(values, white)),
            Self::Rgb { width, height, rgb } if (width, height) == panel && packing.is_none() && is_gray(&rgb) => {
                Ok(white_is_one(rgb.iter().step_by(3).map(|&v| u16::from(v)).collect(), 255))
            }
            Self::Rgb { width, height, rgb } if (width, height) == (layout.width, layout.height) => {
                unpack(path, profile, layout, rgb)
            }
            Self::Gray { width, height, white: 255, values } if (width, height) == (layout.width, layout.height) => {
                unpack(path, profile, layout, values.iter().flat_map(|&v| [v as u8; 3]).collect())
            }
            Self::Gray { width, height, .. } | Self::Rgb { width, height, .. } => {
                let what =
                    format!("the picture is {width}×{height}; panel {} has {}×{}", profile.name, panel.0, panel.1);
                Err(Error::input(path, what))
            }
        }
    }
}

fn is_gray(rgb: &[u8]) -> bool {
    rgb.chunks_exact(3).all(|p| p[0] == p[1] && p[1] == p[2])
}

fn unpack(path: &Path, profile: &PanelProfile, layout: &SignalLayout, rgb: Vec<u8>) -> Result<Vec<u16>> {
    if matches!(layout.packing, Packing::Gray | Packing::Gray1 | Packing::Cells2x2) && !is_gray(&rgb) {
        let what = format!("a colour picture, but the signal of {} is gray", profile.name);
        return Err(Error::input(path, what));
    }
    let metadata = FrameMetadata::new(profile, profile.default_wavelength());
    let signal = VideoFrame { width: layout.width, height: layout.height, rgb, metadata };
    layout.unpack(&signal, profile.width, profile.height, 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// A small panel of `bits` bits.
    fn profile(bits: u8, packing: &str) -> PanelProfile {
        let kind = if bits == 1 { "binary-dmd" } else { "phase-lcos" };
        let response = match bits {
            1 => "kind = \"amplitude\"".to_owned(),
            _ => format!("kind = \"linear\"\nlevels_for_2pi = {}", 1u32 << bits),
        };
        let text = format!(
            "name = \"t\"\nmaker = \"t\"\nkind = \"{}\"\nwidth = 7\nheight = 5\npitch = \"8um\"\nbits = {bits}\n\
             fill_factor = 0.9\nwavelengths = [\"532nm\"]\n[signal]\npacking = \"{packing}\"\n[[response]]\n{response}\n",
            kind
        );
        PanelProfile::parse(&text, Path::new("t.toml")).expect("profile")
    }

    fn noise(profile: &PanelProfile) -> Frame {
        let mut random = Random::new(5, profile.bits.into());
        let count = profile.width * profile.height;
        let levels = (0..count).map(|_| (random.bits() % profile.levels() as u64) as u16).collect();
        let mut frame = Frame::new(profile, 532e-9, levels).expect("frame");
        frame.metadata.applied.curve = Some("t at 532nm".into());
        frame.metadata.origin.notes = vec!["Größe ✓".into()];
        frame
    }

    #[test]
    fn frames_and_signals_come_back_with_their_metadata() {
        let folder = tempfile::tempdir().expect("folder");
        let ten = [(10, "santec-60"), (10, "meadowlark-10")];
        for (bits, packing) in
            [(1, "gray1"), (2, "gray"), (4, "cells-2x2"), (8, "gray"), (8, "red")].into_iter().chain(ten)
        {
            let profile = profile(bits, packing);
            let frame = noise(&profile);
            let path = folder.path().join("frame.png");
            frame.write(&path).expect("write");
            let (back, warnings) = Frame::read(&path, None, None).expect("read");
            assert_eq!(back, frame, "{bits} bits");
            assert!(warnings.is_empty());
            let video = profile.signal.pack(&[&frame]).expect("pack");
            video.write(&path).expect("write");
            assert_eq!(Frame::read(&path, None, None).expect("read").0, frame, "{packing}");
        }
    }

    #[test]
    fn pictures_of_other_programs_need_a_profile() {
        let folder = tempfile::tempdir().expect("folder");
        let eight = profile(8, "gray");
        let levels: Vec<u8> = (0..35).map(|i| 7 * i as u8).collect();
        let gray = image::GrayImage::from_raw(7, 5, levels.clone()).expect("gray");
        let rgb = image::DynamicImage::ImageLuma8(gray.clone()).to_rgb8();
        for name in ["gray.png", "gray.bmp", "rgb.png", "rgb.bmp"] {
            let path = folder.path().join(name);
            if name.starts_with("gray") {
                gray.save(&path).expect("save")
            } else {
                rgb.save(&path).expect("save")
            }
            assert!(Frame::read(&path, None, None).expect_err(name).to_string().contains("name the panel"));
            let (frame, warnings) = Frame::read(&path, Some(&eight), Some(600e-9)).expect(name);
            assert!(frame.levels.iter().zip(&levels).all(|(&a, &b)| a == u16::from(b)), "{name}");
            assert!(frame.metadata.applied.curve.is_none() && warnings.len() == 1);
            assert_eq!(frame.metadata.wavelength, 600e-9);
        }
        // Black and white for a one-bit panel; a level beyond the panel's; a colour; a size; a truncated file.
        let path = folder.path().join("x.png");
        image::GrayImage::from_fn(7, 5, |x, _| image::Luma([if x > 3 { 255 } else { 0 }])).save(&path).expect("save");
        let (frame, _) = Frame::read(&path, Some(&profile(1, "gray1")), None).expect("one bit");
        assert!(frame.levels.iter().enumerate().all(|(i, &l)| l == u16::from(i % 7 > 3)));
        let refused = |text: &str, profile: &PanelProfile| {
            let error = Frame::read(&path, Some(profile), None).expect_err(text).to_string();
            assert!(error.contains(text), "{error}");
        };
        refused("level 255", &profile(4, "cells-2x2"));
        image::RgbImage::from_fn(7, 5, |x, _| image::Rgb([x as u8, 0, 9])).save(&path).expect("save");
        refused("colour", &eight);
        image::GrayImage::new(8, 5).save(&path).expect("save");
        refused("8×5", &eight);
        image::GrayImage::new(7, 5).save(&path).expect("save");
        let whole = std::fs::read(&path).expect("bytes");
        std::fs::write(&path, &whole[..whole.len() - 20]).expect("truncate");
        refused("readable", &eight);
    }

    #[test]
    fn another_panel_or_wavelength_is_warned_of() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("frame.png");
        let made = profile(8, "gray");
        noise(&made).write(&path).expect("write");
        let other = PanelProfile { name: "other".into(), ..made };
        let (frame, warnings) = Frame::read(&path, Some(&other), Some(633e-9)).expect("read");
        assert_eq!(warnings.len(), 2);
        assert_eq!(frame.metadata.panel.name, "other");
    }
}
