//! Several arrays in one `.npz`, as `numpy.savez` writes and `numpy.load` reads: a ZIP archive of `.npy` files.
//!
//! Written without compression; read with or without. Archives beyond 4 GB (ZIP64) are refused.

use super::npy_head::{self, Head};
use crate::error::{Error, Result};
use crate::files;
use flate2::Crc;
use flate2::read::DeflateDecoder;
use half::f16;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const LOCAL: u32 = 0x0403_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const END: u32 = 0x0605_4b50;
/// Bytes of the records before their names.
const LOCAL_SIZE: usize = 30;
const CENTRAL_SIZE: usize = 46;
const END_SIZE: usize = 22;
/// Deflate makes at most this many bytes of one.
const MOST_INFLATION: u64 = 1032;
/// Bytes that are converted at once.
const CHUNK: usize = 1 << 16;
/// 1 January 1980, the first day of DOS: archives of the same content are the same bytes.
const DAY: u16 = 0x21;

/// What an archive says of one of its files.
#[derive(Clone, Debug)]
struct Entry {
    name: String,
    offset: u64,
    packed: u64,
    size: u64,
    crc: u32,
    deflated: bool,
}

/// An archive that is being written.
pub(crate) struct NpzWriter<'a> {
    path: &'a Path,
    out: &'a mut BufWriter<File>,
    entries: Vec<Entry>,
}

/// Writes an archive, whole or not at all, of the arrays that `fill` adds.
pub(crate) fn write(path: &Path, fill: impl FnOnce(&mut NpzWriter) -> Result<()>) -> Result<()> {
    files::write_whole(path, |out| {
        let mut writer = NpzWriter { path, out, entries: Vec::new() };
        fill(&mut writer)?;
        writer.finish()
    })
}

impl NpzWriter<'_> {
    /// Adds an array of a NumPy type (`<f2`) and shape, whose bytes `fill` writes in C order.
    pub(crate) fn array(
        &mut self,
        name: &str,
        kind: &str,
        shape: &[usize],
        fill: impl FnOnce(&mut dyn FnMut(&[u8]) -> Result<()>) -> Result<()>,
    ) -> Result<()> {
        let path = self.path;
        let offset = self.out.stream_position().map_err(Error::io(path))?;
        let name = format!("{name}.npy");
        let mut entry = Entry { name, offset, packed: 0, size: 0, crc: 0, deflated: false };
        // Sizes and sum are not known yet: the record is written again when they are.
        self.out.write_all(&entry.local()).map_err(Error::io(path))?;
        let (out, mut crc) = (&mut *self.out, Crc::new());
        let mut put = |bytes: &[u8]| {
            crc.update(bytes);
            out.write_all(bytes).map_err(Error::io(path))
        };
        put(&npy_head::of(kind, shape))?;
        fill(&mut put)?;
        let end = self.out.stream_position().map_err(Error::io(path))?;
        if end >= u64::from(u32::MAX) {
            return Err(Error::unsupported(format!("{}: more than 4 GB; write fewer views", path.display())));
        }
        entry.size = end - offset - entry.local().len() as u64;
        (entry.packed, entry.crc) = (entry.size, crc.sum());
        self.out.seek(SeekFrom::Start(offset)).map_err(Error::io(path))?;
        self.out.write_all(&entry.local()).map_err(Error::io(path))?;
        self.out.seek(SeekFrom::Start(end)).map_err(Error::io(path))?;
        self.entries.push(entry);
        Ok(())
    }

    /// Adds an array of float64.
    pub(crate) fn doubles(&mut self, name: &str, shape: &[usize], values: &[f64]) -> Result<()> {
        self.array(name, "<f8", shape, |put| values.iter().try_for_each(|v| put(&v.to_le_bytes())))
    }

    /// Adds a text, as an array of bytes without dimension.
    pub(crate) fn text(&mut self, name: &str, text: &str) -> Result<()> {
        self.array(name, &format!("|S{}", text.len().max(1)), &[], |put| put(text.as_bytes()))
    }

    fn finish(self) -> Result<()> {
        let io = || Error::io(self.path);
        let begin = self.out.stream_position().map_err(io())?;
        for entry in &self.entries {
            self.out.write_all(&entry.central()).map_err(io())?;
        }
        let end = self.out.stream_position().map_err(io())?;
        let mut record = END.to_le_bytes().to_vec();
        record.extend([0; 4]);
        let count = self.entries.len() as u16;
        record.extend([count, count].map(u16::to_le_bytes).concat());
        record.extend([(end - begin) as u32, begin as u32].map(u32::to_le_bytes).concat());
        record.extend([0; 2]);
        self.out.write_all(&record).map_err(io())
    }
}

impl Entry {
    /// What local and central record share: version, flags, method, time, day, sum, sizes, lengths.
    fn shared(&self) -> Vec<u8> {
        let mut out = [20u16, 0, 0, 0, DAY].map(u16::to_le_bytes).concat();
        out.extend([self.crc, self.packed as u32, self.size as u32].map(u32::to_le_bytes).concat());
        out.extend([self.name.len() as u16, 0].map(u16::to_le_bytes).concat());
        out
    }

    fn local(&self) -> Vec<u8> {
        [&LOCAL.to_le_bytes()[..], &self.shared(), self.name.as_bytes()].concat()
    }

    fn central(&self) -> Vec<u8> {
        let begin = [&CENTRAL.to_le_bytes()[..], &20u16.to_le_bytes(), &self.shared()].concat();
        // Comment, disk, attributes: none.
        [&begin[..], &[0; 10], &(self.offset as u32).to_le_bytes(), self.name.as_bytes()].concat()
    }
}

/// An archive that is read.
pub(crate) struct Npz {
    path: PathBuf,
    file: BufReader<File>,
    entries: BTreeMap<String, Entry>,
}

/// One array of an archive, its values not read yet.
pub(crate) struct NpzArray<'a> {
    path: &'a Path,
    name: String,
    /// Sides.
    pub(crate) shape: Vec<usize>,
    /// NumPy's name of the type, as `<f4`.
    pub(crate) kind: String,
    /// Whether the first side is the fastest.
    pub(crate) fortran: bool,
    crc: u32,
    sum: Crc,
    left: u64,
    reader: Box<dyn Read + 'a>,
}

fn u16_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]))
}

fn u32_at(bytes: &[u8], at: usize) -> u64 {
    u16_at(bytes, at) | u16_at(bytes, at + 2) << 16
}

impl Npz {
    /// Opens an archive and reads what stands in it.
    ///
    /// # Errors
    /// [`Error::Input`] for what is no archive, or one that is damaged.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let damaged = |what: &str| Error::input(path, format!("not a .npz archive, or a damaged one: {what}"));
        let file = File::open(path).map_err(Error::io(path))?;
        let length = file.metadata().map_err(Error::io(path))?.len();
        let mut file = BufReader::with_capacity(1 << 18, file);
        // The end's record is the last thing but for a comment of up to 65535 bytes.
        let tail = length.min((END_SIZE + 0xffff) as u64);
        let tail = bytes(&mut file, length - tail, tail as usize).map_err(Error::io(path))?;
        let found =
            (0..(tail.len() + 1).saturating_sub(END_SIZE)).rev().find(|&at| u32_at(&tail, at) == u64::from(END));
        let end = &tail[found.ok_or_else(|| damaged("it has no end"))?..];
        let (count, size, begin) = (u16_at(end, 10), u32_at(end, 12), u32_at(end, 16));
        if count == 0xffff || size == u64::from(u32::MAX) || begin == u64::from(u32::MAX) {
            return Err(Error::input(path, "an archive beyond 4 GB (ZIP64), which is not read; save fewer views"));
        }
        if begin + size > length {
            return Err(damaged("its directory lies beyond its end"));
        }
        let directory = bytes(&mut file, begin, size as usize).map_err(Error::io(path))?;
        let (mut entries, mut rest) = (BTreeMap::new(), &directory[..]);
        for _ in 0..count {
            if rest.len() < CENTRAL_SIZE || u32_at(rest, 0) != u64::from(CENTRAL) {
                return Err(damaged("its directory is cut off"));
            }
            let lengths = [28, 30, 32].map(|at| u16_at(rest, at) as usize);
            let next = CENTRAL_SIZE + lengths.iter().sum::<usize>();
            let name = rest.get(CENTRAL_SIZE..CENTRAL_SIZE + lengths[0]).filter(|_| rest.len() >= next);
            let name = String::from_utf8_lossy(name.ok_or_else(|| damaged("its directory is cut off"))?).into_owned();
            let (flags, method) = (u16_at(rest, 8), u16_at(rest, 10));
            if flags & 1 != 0 || !matches!(method, 0 | 8) {
                return Err(damaged(&format!("{name} is encrypted, or packed in a way that NumPy does not use")));
            }
            let entry = Entry {
                name: name.clone(),
                offset: u32_at(rest, 42),
                packed: u32_at(rest, 20),
                size: u32_at(rest, 24),
                crc: u32_at(rest, 16) as u32,
                deflated: method == 8,
            };
            let least = if entry.deflated { entry.size / MOST_INFLATION } else { entry.size };
            if entry.offset + LOCAL_SIZE as u64 + entry.packed > length || entry.packed < least {
                return Err(damaged(&format!("{name} is shorter than it promises")));
            }
            entries.insert(name.trim_end_matches(".npy").to_string(), entry);
            rest = &rest[next..];
        }
        Ok(Self { path: path.into(), file, entries })
    }

    /// Names of the arrays.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.keys().map(String::as_str)
    }

    /// An array, if it is there.
    ///
    /// # Errors
    /// [`Error::Input`] for one that is no `.npy`, or of another size than it promises.
    pub(crate) fn array(&mut self, name: &str) -> Result<Option<NpzArray<'_>>> {
        let Some(entry) = self.entries.get(name).cloned() else { return Ok(None) };
        let path = &self.path;
        let refused = |what: &str| Error::input(path, format!("{name}: {what}"));
        let local = bytes(&mut self.file, entry.offset, LOCAL_SIZE).map_err(Error::io(path))?;
        if u32_at(&local, 0) != u64::from(LOCAL) {
            return Err(refused("is not where the archive's directory says"));
        }
        let begin = entry.offset + LOCAL_SIZE as u64 + u16_at(&local, 26) + u16_at(&local, 28);
        self.file.seek(SeekFrom::Start(begin)).map_err(Error::io(path))?;
        let packed = (&mut self.file).take(entry.packed);
        let mut reader: Box<dyn Read> =
            if entry.deflated { Box::new(DeflateDecoder::new(packed)) } else { Box::new(packed) };
        let head = Head::read(&mut reader).map_err(|why| refused(&format!("is no array: {why}")))?;
        let left = entry.size.saturating_sub(head.bytes.len() as u64);
        if head.promised != Some(left) {
            return Err(refused(&format!("{left} bytes of values do not make {:?} of type {}", head.shape, head.kind)));
        }
        let mut sum = Crc::new();
        sum.update(&head.bytes);
        let Head { shape, kind, fortran, .. } = head;
        Ok(Some(NpzArray { path, name: name.into(), shape, kind, fortran, crc: entry.crc, sum, left, reader }))
    }

    /// All values of a small array as float64, if it is there.
    ///
    /// # Errors
    /// As [`Npz::array`]; [`Error::Input`] for more than `most` values.
    pub(crate) fn doubles(&mut self, name: &str, most: usize) -> Result<Option<(Vec<usize>, Vec<f64>)>> {
        let Some(mut array) = self.array(name)? else { return Ok(None) };
        let count = array.count();
        if count > most {
            return Err(array.refused(&format!("{count} values are too many")));
        }
        let mut values = Vec::with_capacity(count);
        array.read(count, |v| values.push(v))?;
        Ok(Some((array.shape, values)))
    }
}

impl NpzArray<'_> {
    /// An error that names the array.
    pub(crate) fn refused(&self, what: &str) -> Error {
        Error::input(self.path, format!("{}: {what}", self.name))
    }

    /// Number of values.
    pub(crate) fn count(&self) -> usize {
        self.shape.iter().product()
    }

    /// The largest value of a type of whole numbers; `None` for floats.
    pub(crate) fn largest(&self) -> Option<f64> {
        match self.kind.as_str() {
            "|u1" | "<u1" | ">u1" => Some(255.0),
            "<u2" | ">u2" => Some(65535.0),
            _ => None,
        }
    }

    /// All its bytes, as they are.
    ///
    /// # Errors
    /// [`Error::Input`] for values that are cut off or damaged.
    pub(crate) fn bytes(&mut self) -> Result<Vec<u8>> {
        // Grows with what is there: a length that lies takes no memory.
        let mut bytes = Vec::new();
        let read = (&mut self.reader).take(self.left).read_to_end(&mut bytes);
        if read.is_err() || bytes.len() as u64 != self.left {
            return Err(self.refused("is cut off or damaged"));
        }
        self.sum.update(&bytes);
        self.left = 0;
        if self.sum.sum() != self.crc {
            return Err(self.refused("is damaged: its check sum is another"));
        }
        Ok(bytes)
    }

    /// Reads the next `count` values. After the last one the archive's check sum is compared.
    ///
    /// # Errors
    /// [`Error::Input`] for values that are cut off, damaged, not finite, or of another type than floats and whole numbers of
    /// one and two bytes.
    pub(crate) fn read(&mut self, count: usize, mut on: impl FnMut(f64)) -> Result<()> {
        if self.fortran && self.shape.len() > 1 {
            return Err(self.refused("stored in Fortran order; save it with numpy.ascontiguousarray"));
        }
        let big = self.kind.starts_with('>');
        let (wide, value): (usize, fn([u8; 8]) -> f64) = match self.kind.trim_start_matches(['<', '>', '|']) {
            "u1" => (1, |b| f64::from(b[0])),
            "u2" => (2, |b| f64::from(u16::from_le_bytes([b[0], b[1]]))),
            "f2" => (2, |b| f16::from_le_bytes([b[0], b[1]]).to_f64()),
            "f4" => (4, |b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
            "f8" => (8, f64::from_le_bytes),
            "i4" => (4, |b| f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
            "i8" => (8, |b| i64::from_le_bytes(b) as f64),
            other => {
                return Err(
                    self.refused(&format!("values of type {other}; float16, float32, uint8 or uint16 are read"))
                );
            }
        };
        let mut left = (count * wide) as u64;
        if left > self.left {
            return Err(self.refused("has fewer values"));
        }
        let mut chunk = vec![0; CHUNK];
        while left > 0 {
            let now = left.min(CHUNK as u64) as usize;
            let piece = &mut chunk[..now];
            if let Err(error) = self.reader.read_exact(piece) {
                return Err(self.refused(&format!("is cut off or damaged: {error}")));
            }
            self.sum.update(piece);
            for bytes in piece.chunks_exact_mut(wide) {
                if big {
                    bytes.reverse();
                }
                let mut eight = [0; 8];
                eight[..wide].copy_from_slice(bytes);
                let found = value(eight);
                if !found.is_finite() {
                    return Err(self.refused("has values that are not finite"));
                }
                on(found);
            }
            left -= now as u64;
            self.left -= now as u64;
        }
        if self.left == 0 && self.sum.sum() != self.crc {
            return Err(self.refused("is damaged: its check sum is another"));
        }
        Ok(())
    }
}

/// Bytes at a place of a file.
fn bytes(file: &mut BufReader<File>, at: u64, count: usize) -> std::io::Result<Vec<u8>> {
    file.seek(SeekFrom::Start(at))?;
    let mut out = vec![0; count];
    file.read_exact(&mut out)?;
    Ok(out)
}

#[cfg(test)]
mod tests;
