//! The bytes of a file, whose places are checked.

use super::Read;

/// What stands for no place.
const NOWHERE: u64 = u64::MAX;

/// Bytes from which numbers are taken, low byte first.
#[derive(Clone, Copy)]
pub(super) struct Bytes<'a> {
    all: &'a [u8],
}

/// A place in bytes that moves on as they are taken.
#[derive(Clone, Copy)]
pub(super) struct Cursor<'a> {
    rest: &'a [u8],
}

impl<'a> Bytes<'a> {
    pub(super) fn new(all: &'a [u8]) -> Self {
        Self { all }
    }

    pub(super) fn len(&self) -> usize {
        self.all.len()
    }

    /// So many bytes at a place.
    pub(super) fn at(&self, place: u64, length: u64) -> Read<&'a [u8]> {
        let end = place.checked_add(length);
        let range = usize::try_from(place).ok().zip(end.and_then(|end| usize::try_from(end).ok()));
        let found = range.and_then(|(begin, end)| self.all.get(begin..end));
        found.ok_or_else(|| format!("{length} bytes at {place} lie beyond its end: truncated?"))
    }

    /// All from a place on.
    pub(super) fn from(&self, place: u64) -> Read<Cursor<'a>> {
        let length = (self.all.len() as u64).saturating_sub(place).max(1);
        self.at(place, length).map(|rest| Cursor { rest })
    }
}

impl<'a> Cursor<'a> {
    pub(super) fn of(rest: &'a [u8]) -> Self {
        Self { rest }
    }

    pub(super) fn rest(&self) -> &'a [u8] {
        self.rest
    }

    pub(super) fn take(&mut self, count: usize) -> Read<&'a [u8]> {
        let (now, rest) = self.rest.split_at_checked(count).ok_or("a part of it is cut off")?;
        self.rest = rest;
        Ok(now)
    }

    pub(super) fn skip(&mut self, count: usize) -> Read<()> {
        self.take(count).map(drop)
    }

    /// A number of up to eight bytes.
    pub(super) fn number(&mut self, count: usize) -> Read<u64> {
        let mut eight = [0; 8];
        eight.get_mut(..count).ok_or("a number of more than eight bytes")?.copy_from_slice(self.take(count)?);
        Ok(u64::from_le_bytes(eight))
    }

    pub(super) fn byte(&mut self) -> Read<u8> {
        self.number(1).map(|n| n as u8)
    }

    pub(super) fn short(&mut self) -> Read<usize> {
        self.number(2).map(|n| n as usize)
    }

    pub(super) fn word(&mut self) -> Read<usize> {
        self.number(4).map(|n| n as usize)
    }

    /// An address or a length.
    pub(super) fn long(&mut self) -> Read<u64> {
        self.number(8)
    }

    /// An address, where there is one.
    pub(super) fn address(&mut self) -> Read<Option<u64>> {
        self.long().map(|place| (place != NOWHERE).then_some(place))
    }

    /// Refuses other bytes than these.
    pub(super) fn expect(&mut self, magic: &[u8]) -> Read<()> {
        let found = self.take(magic.len())?;
        let name = String::from_utf8_lossy(magic);
        (found == magic).then_some(()).ok_or_else(|| format!("{name} is not where it should be: damaged?"))
    }
}

/// Text up to its first zero.
pub(super) fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}
