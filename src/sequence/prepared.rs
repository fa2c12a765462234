//! Frames that were prepared before: pictures, raw video, arrays of drive levels, one-bit planes.
//!
//! What is read is drive levels of the panel, or the picture of its video signal. Where the panel's packing carries
//! several frames in one of the signal (24 one-bit planes, two sub-frames), as many as it carries are taken together.
//! Nothing is scaled, and nothing is held but the frame at hand.

use crate::error::{Error, Result};
use crate::field::npy_stack::LevelStack;
use crate::names::{Name, Named};
use crate::panel::{Frame, FrameMetadata, PanelProfile, VideoFrame};
use crate::progress::Progress;
use piped::Piped;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Where frames are read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// One frame a picture, in this order.
    Pictures(Vec<PathBuf>),
    /// Frames × rows × columns of whole numbers (`.npy`).
    Array(PathBuf),
    /// Bare pixels, frame after frame: from a file (or a pipe with a name), or from standard input where there is none.
    Raw {
        /// The file.
        path: Option<PathBuf>,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// What a pixel is.
        format: RawFormat,
    },
}

/// Pixels of raw video; rows from the top, without gaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RawFormat {
    /// A byte: the drive level.
    Gray,
    /// Two bytes, the low one first: the drive level.
    Gray16,
    /// A bit: the first pixel of eight in the high bit, each row beginning a new byte; 1 is on.
    Mono,
    /// Three bytes, red, green and blue: the video signal.
    Rgb,
}

impl Named for RawFormat {
    const KIND: &'static str = "raw format";
    const NAMES: &'static [Name<Self>] = &[
        ("gray", || Self::Gray, "a byte: the drive level"),
        ("gray16", || Self::Gray16, "two bytes, the low one first: the drive level"),
        ("mono", || Self::Mono, "a bit, the first of eight in the high one: on or off"),
        ("rgb", || Self::Rgb, "red, green and blue: the video signal as it is"),
    ];
}

impl RawFormat {
    /// Bytes of a frame.
    pub fn bytes(self, width: usize, height: usize) -> usize {
        match self {
            Self::Gray => width * height,
            Self::Gray16 => 2 * width * height,
            Self::Mono => width.div_ceil(8) * height,
            Self::Rgb => 3 * width * height,
        }
    }
}

/// One frame of the video signal.
#[derive(Clone, Debug)]
pub enum Shown {
    /// Drive levels: one frame, or the several that the packing carries.
    Levels(Vec<Frame>),
    /// The signal as it was given.
    Signal(Box<VideoFrame>),
}

impl Shown {
    /// The video signal.
    ///
    /// # Errors
    /// As [`crate::panel::SignalLayout::pack`].
    pub fn signal(self) -> Result<VideoFrame> {
        match self {
            Self::Signal(signal) => Ok(*signal),
            Self::Levels(frames) => {
                let Some(first) = frames.first() else { return Err(Error::parameter("frames", "there is none")) };
                first.metadata.panel.signal.pack(&frames.iter().collect::<Vec<_>>())
            }
        }
    }

    /// The drive levels.
    ///
    /// # Errors
    /// As [`crate::panel::SignalLayout::unpack`] and [`Frame::new`].
    pub fn levels(self) -> Result<Vec<Frame>> {
        match self {
            Self::Levels(frames) => Ok(frames),
            Self::Signal(signal) => {
                let (panel, wavelength) = (&signal.metadata.panel, signal.metadata.wavelength);
                let slots = 0..panel.signal.packing.frames();
                slots
                    .map(|slot| {
                        let levels = panel.signal.unpack(&signal, panel.width, panel.height, slot)?;
                        let mut frame = Frame::new(panel, wavelength, levels)?;
                        frame.metadata = FrameMetadata { panel: panel.clone(), ..signal.metadata.clone() };
                        frame.metadata.applied.packing = None;
                        Ok(frame)
                    })
                    .collect()
            }
        }
    }
}

/// A prepared sequence: an iterator over its frames.
pub struct Prepared {
    reader: Reader,
    profile: PanelProfile,
    /// Whether the profile was asked for, and overrules what pictures say of themselves.
    named: bool,
    wavelength: Option<f64>,
    notes: Arc<Mutex<Vec<String>>>,
    over: bool,
}

enum Reader {
    Pictures(std::vec::IntoIter<PathBuf>),
    Array(PathBuf, LevelStack),
    Raw { name: PathBuf, input: Piped, size: (usize, usize), format: RawFormat, number: usize },
}

/// A frame as it was read, before those that go together are put together.
enum One {
    Levels(Box<Frame>),
    Signal(Box<VideoFrame>),
}

impl Prepared {
    /// Opens a sequence for a panel; `named` says that the user chose the panel, which then overrules what pictures say of
    /// themselves. What is found while it is read stands in [`Prepared::notes`]. `stop` also ends the wait for raw video that
    /// does not come.
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Input`] for what cannot be read or does not fit the panel.
    pub fn open(
        source: Source,
        profile: &PanelProfile,
        named: bool,
        wavelength: Option<f64>,
        stop: &Arc<Progress>,
    ) -> Result<Self> {
        let signal = (profile.signal.width, profile.signal.height);
        let panel = (profile.width, profile.height);
        let fits = |path: &Path, size: (usize, usize), video: bool| {
            let wanted = if video { signal } else { panel };
            if size == wanted {
                return Ok(());
            }
            let kind = if video { "the signal of panel" } else { "panel" };
            let what =
                format!("frames of {}×{}; {kind} {} has {}×{}", size.0, size.1, profile.name, wanted.0, wanted.1);
            Err(Error::input(path, what))
        };
        let reader = match source {
            Source::Pictures(paths) => Reader::Pictures(paths.into_iter()),
            Source::Array(path) => {
                let what = "its values are no drive levels; uint8, bool or uint16 are needed for frames";
                let stack = LevelStack::open(&path)?.ok_or_else(|| Error::input(&path, what))?;
                fits(&path, (stack.width, stack.height), stack.channels == 3)?;
                Reader::Array(path, stack)
            }
            Source::Raw { path, width, height, format } => {
                let name = path.clone().unwrap_or_else(|| "standard input".into());
                fits(&name, (width, height), format == RawFormat::Rgb)?;
                let input: Box<dyn Read + Send> = match path {
                    Some(path) => Box::new(File::open(&path).map_err(Error::io(&path))?),
                    None => Box::new(std::io::stdin()),
                };
                let input = Piped::new(input, Arc::clone(stop));
                Reader::Raw { name, input, size: (width, height), format, number: 0 }
            }
        };
        Ok(Self { reader, profile: profile.clone(), named, wavelength, notes: Arc::default(), over: false })
    }

    /// What was found while reading, so far: frames that were cut short, pictures without metadata.
    pub fn notes(&self) -> Arc<Mutex<Vec<String>>> {
        Arc::clone(&self.notes)
    }

    fn note(&self, note: String) {
        if let Ok(mut notes) = self.notes.lock()
            && !notes.contains(&note)
        {
            notes.push(note);
        }
    }

    fn wavelength(&self) -> f64 {
        self.wavelength.unwrap_or(self.profile.default_wavelength())
    }

    /// The next frame as it stands in the source.
    fn one(&mut self) -> Result<Option<One>> {
        let wavelength = self.wavelength();
        match &mut self.reader {
            Reader::Pictures(paths) => {
                let Some(path) = paths.next() else { return Ok(None) };
                let named = self.named.then_some(&self.profile);
                let read = match VideoFrame::read_packed(&path, &self.profile, self.named, self.wavelength)? {
                    Some(signal) => return Ok(Some(One::Signal(Box::new(signal)))),
                    None => Frame::read(&path, named, self.wavelength),
                };
                let (frame, warnings) = match read {
                    // A foreign picture has no metadata: it is read for the panel at hand.
                    Err(_) if named.is_none() => Frame::read(&path, Some(&self.profile), self.wavelength)?,
                    other => other?,
                };
                // One line for all pictures, not one for each.
                let of = |warning: String| warning.replace(&path.display().to_string(), "pictures");
                warnings.into_iter().map(of).for_each(|warning| self.note(warning));
                Ok(Some(One::Levels(Box::new(frame))))
            }
            Reader::Array(path, stack) => {
                let video = stack.channels == 3;
                let path = path.clone();
                let Some(values) = stack.next_frame()? else { return Ok(None) };
                let told = |e: Error| Error::input(&path, e.to_string());
                if video {
                    let bytes = values.into_iter().map(|v| v.min(255) as u8).collect();
                    return Ok(Some(One::Signal(Box::new(signal(&self.profile, wavelength, bytes)))));
                }
                frame(&self.profile, wavelength, values).map(Some).map_err(told)
            }
            Reader::Raw { name, input, size, format, number } => {
                let mut bytes = vec![0; format.bytes(size.0, size.1)];
                let read = match fill(input, &mut bytes) {
                    Err(_) if input.stopped() => return Err(Error::Interrupted),
                    read => read.map_err(Error::io(&name))?,
                };
                if read < bytes.len() {
                    if read > 0 || *number == 0 {
                        let note = format!(
                            "{}: frame {number} is cut short, {read} of {} bytes; it was left out",
                            name.display(),
                            bytes.len()
                        );
                        self.note(note);
                    }
                    return Ok(None);
                }
                let (name, format, size, n) = (name.clone(), *format, *size, *number);
                *number += 1;
                let levels = match format {
                    RawFormat::Rgb => return Ok(Some(One::Signal(Box::new(signal(&self.profile, wavelength, bytes))))),
                    RawFormat::Gray => bytes.into_iter().map(u16::from).collect(),
                    RawFormat::Gray16 => bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect(),
                    RawFormat::Mono => {
                        let row = size.0.div_ceil(8);
                        let bit = |i: usize| bytes[i / size.0 * row + i % size.0 / 8] >> (7 - i % size.0 % 8) & 1;
                        (0..size.0 * size.1).map(|i| u16::from(bit(i))).collect()
                    }
                };
                let told = |e: Error| Error::input(&name, format!("frame {n}: {e}"));
                frame(&self.profile, wavelength, levels).map(Some).map_err(told)
            }
        }
    }

    fn shown(&mut self) -> Result<Option<Shown>> {
        let mut together: Vec<Frame> = Vec::new();
        loop {
            let frame = match self.one()? {
                Some(One::Signal(signal)) if together.is_empty() => return Ok(Some(Shown::Signal(signal))),
                Some(One::Signal(_)) => {
                    let what = format!("a packed picture after {} that are not", together.len());
                    return Err(Error::parameter("frames", what));
                }
                Some(One::Levels(frame)) => *frame,
                None if together.is_empty() => return Ok(None),
                None => {
                    let packing = together[0].metadata.panel.signal.packing;
                    self.note(format!(
                        "the last video frame has {} of the {} frames that {} carries; they are repeated in it",
                        together.len(),
                        packing.frames(),
                        packing.name()
                    ));
                    return Ok(Some(Shown::Levels(together)));
                }
            };
            let carried = frame.metadata.panel.signal.packing.frames();
            together.push(frame);
            if together.len() >= carried {
                return Ok(Some(Shown::Levels(together)));
            }
        }
    }
}

impl Iterator for Prepared {
    type Item = Result<Shown>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.over {
            return None;
        }
        let shown = self.shown().transpose();
        self.over = !matches!(shown, Some(Ok(_)));
        shown
    }
}

fn frame(profile: &PanelProfile, wavelength: f64, mut levels: Vec<u16>) -> Result<One> {
    // Other programs write one bit as black and white.
    if profile.bits == 1 && levels.iter().all(|&level| level == 0 || level == 255) {
        levels.iter_mut().for_each(|level| *level = u16::from(*level > 0));
    }
    Frame::new(profile, wavelength, levels).map(|frame| One::Levels(Box::new(frame)))
}

fn signal(profile: &PanelProfile, wavelength: f64, rgb: Vec<u8>) -> VideoFrame {
    let mut metadata = FrameMetadata::new(profile, wavelength);
    metadata.applied.packing = Some(profile.signal.packing.name().into());
    VideoFrame { width: profile.signal.width, height: profile.signal.height, rgb, metadata }
}

/// Reads until the buffer is full or the input ends; how much there was.
fn fill(input: &mut dyn Read, bytes: &mut [u8]) -> std::io::Result<usize> {
    let mut read = 0;
    while read < bytes.len() {
        match input.read(&mut bytes[read..]) {
            Ok(0) => break,
            Ok(more) => read += more,
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(read)
}

/// The pictures (.png, .bmp) in a folder, ordered by name as people count: `f2` before `f10`.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a folder without pictures.
pub fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        let picture = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png") || e.eq_ignore_ascii_case("bmp"));
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if picture && !hidden && path.is_file() {
            found.push(path);
        }
    }
    if found.is_empty() {
        return Err(Error::input(folder, "has no frames: no .png or .bmp is in it"));
    }
    found.sort_by_cached_key(|path| natural(&path.file_name().unwrap_or_default().to_string_lossy()));
    Ok(found)
}

/// A key by which names sort with their numbers by value: (letter, 0, nothing), and for a number its place among letters and,
/// without leading zeros, its length and digits. Names that differ in zeros or capitals alone follow the name itself.
fn natural(name: &str) -> (Vec<(char, usize, String)>, String) {
    let mut parts: Vec<(char, usize, String)> = Vec::new();
    let mut inside = false;
    for c in name.chars() {
        match parts.last_mut() {
            Some((_, length, digits)) if inside && c.is_ascii_digit() => {
                if *digits == "0" {
                    (*length, *digits) = (0, String::new());
                }
                *length += 1;
                digits.push(c);
            }
            _ if c.is_ascii_digit() => parts.push(('0', 1, c.to_string())),
            _ => parts.extend(c.to_lowercase().map(|c| (c, 0, String::new()))),
        }
        inside = c.is_ascii_digit();
    }
    (parts, name.to_owned())
}

mod piped;
#[cfg(test)]
mod tests;
