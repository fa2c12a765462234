//! Arrays of many frames of whole numbers (`.npy`), read frame by frame.

use super::npy_head::Head;
use crate::error::{Error, Result};
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::{Path, PathBuf};

/// Frames of drive levels in a `.npy`: frames × rows × columns (or rows × columns for one), or with three channels last.
#[derive(Debug)]
pub struct LevelStack {
    path: PathBuf,
    reader: BufReader<File>,
    /// Frames in the file.
    pub frames: usize,
    /// Rows of a frame.
    pub height: usize,
    /// Columns of a frame.
    pub width: usize,
    /// Values per pixel: 1, or 3 for red, green and blue.
    pub channels: usize,
    wide: Option<bool>,
    next: usize,
}

impl LevelStack {
    /// Opens a file of uint8, bool or uint16; `None` where it holds other values (a field).
    ///
    /// # Errors
    /// [`Error::Input`] for a file that is no `.npy`, is shorter than it promises, or has another shape.
    pub fn open(path: &Path) -> Result<Option<Self>> {
        let file = File::open(path).map_err(Error::io(path))?;
        let length = file.metadata().map_err(Error::io(path))?.len();
        let mut reader = BufReader::with_capacity(1 << 20, file);
        let head = Head::read(&mut reader).map_err(|why| Error::input(path, format!("not a .npy file: {why}")))?;
        // Whether a value has two bytes, and then whether the high one comes first.
        let wide = match head.kind.as_str() {
            "|u1" | "|b1" | "<u1" => None,
            "<u2" => Some(false),
            ">u2" => Some(true),
            _ => return Ok(None),
        };
        // One frame in another order is read as a whole.
        if head.fortran && head.shape.len() == 2 {
            return Ok(None);
        }
        if head.fortran {
            return Err(Error::input(path, "stored in Fortran order; save it with numpy.ascontiguousarray"));
        }
        let refused = || {
            let what = format!(
                "shape {:?}; frames × rows × columns are needed, of three channels where the values are a video signal",
                head.shape
            );
            Error::input(path, what)
        };
        let (frames, height, width, channels) = match head.shape[..] {
            [height, width] => (1, height, width, 1),
            [frames, height, width] => (frames, height, width, 1),
            [frames, height, width, 3] => (frames, height, width, 3),
            _ => return Err(refused()),
        };
        let sides = [frames, height, width, channels, if wide.is_some() { 2 } else { 1 }].map(|side| side as u64);
        // A header can promise any size; what it promises must be in the file before memory is taken for it.
        let promised = sides.iter().try_fold(1u64, |n, &side| n.checked_mul(side)).ok_or_else(refused)?;
        if promised == 0 {
            return Err(refused());
        }
        let begin = reader.stream_position().map_err(Error::io(path))?;
        if promised > length.saturating_sub(begin) {
            let what = format!(
                "truncated: promises {promised} bytes of frames, the file has {}",
                length.saturating_sub(begin)
            );
            return Err(Error::input(path, what));
        }
        Ok(Some(Self { path: path.into(), reader, frames, height, width, channels, wide, next: 0 }))
    }

    /// The values of the next frame in C order; `None` after the last.
    ///
    /// # Errors
    /// [`Error::Input`] when the file ends before.
    pub fn next_frame(&mut self) -> Result<Option<Vec<u16>>> {
        if self.next == self.frames {
            return Ok(None);
        }
        let count = self.width * self.height * self.channels;
        let mut bytes = vec![0; count * if self.wide.is_some() { 2 } else { 1 }];
        let number = self.next;
        self.reader
            .read_exact(&mut bytes)
            .map_err(|_| Error::input(&self.path, format!("truncated in frame {number} of {}", self.frames)))?;
        self.next += 1;
        Ok(Some(match self.wide {
            None => bytes.into_iter().map(u16::from).collect(),
            Some(true) => bytes.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect(),
            Some(false) => bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect(),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
        let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
        while (header.len() + 11) % 64 != 0 {
            header.push(' ');
        }
        header.push('\n');
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.bytes());
        file.extend(data);
        file
    }

    #[test]
    fn frames_come_in_order_and_short_or_foreign_files_are_told() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("a.npy");
        let write = |bytes: Vec<u8>| std::fs::write(&path, bytes).expect("write");
        write(npy("|u1", "(3, 2, 5)", &(0..30).collect::<Vec<u8>>()));
        let mut stack = LevelStack::open(&path).expect("opens").expect("levels");
        assert_eq!((stack.frames, stack.height, stack.width, stack.channels), (3, 2, 5, 1));
        for number in 0..3u16 {
            let frame = stack.next_frame().expect("read").expect("frame");
            assert_eq!(frame, (10 * number..10 * number + 10).collect::<Vec<u16>>());
        }
        assert!(stack.next_frame().expect("end").is_none());
        write(npy(">u2", "(1, 1, 2, 3)", &[0, 1, 1, 0, 0, 2, 2, 0, 0, 3, 3, 0]));
        let mut stack = LevelStack::open(&path).expect("opens").expect("levels");
        assert_eq!(stack.next_frame().expect("read").expect("frame"), [1, 256, 2, 512, 3, 768]);
        write(npy("<c8", "(2, 2)", &[0; 32]));
        assert!(LevelStack::open(&path).expect("a field").is_none());
        for (shape, data) in [("(3, 2, 5)", 29), ("(0, 2, 5)", 0), ("(2,)", 2), ("(4000000000, 4000000000, 4)", 9)] {
            write(npy("|u1", shape, &vec![1; data]));
            let refused = LevelStack::open(&path).expect_err(shape).to_string();
            assert!(refused.contains("a.npy") && !refused.contains('\n'), "{refused}");
        }
    }
}
