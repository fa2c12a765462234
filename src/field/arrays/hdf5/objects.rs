//! The superblock, and the messages that an object is described by.

use super::Read;
use super::bytes::{Bytes, Cursor};

/// Most blocks of one object's messages.
const MOST_BLOCKS: usize = 256;
const CONTINUED: u16 = 0x10;

/// One message of an object: its kind and its bytes.
pub(super) struct Message<'a> {
    pub(super) kind: u16,
    pub(super) bytes: &'a [u8],
}

/// Where the root group's messages stand.
pub(super) fn root(bytes: &Bytes) -> Read<u64> {
    let mut at = bytes.from(0)?;
    at.expect(super::MAGIC)?;
    let version = at.byte()?;
    let sizes = match version {
        0 | 1 => {
            at.skip(4)?;
            [at.byte()?, at.byte()?]
        }
        2 | 3 => [at.byte()?, at.byte()?],
        _ => return Err(format!("its version {version} is not known")),
    };
    if sizes != [8, 8] {
        return Err(format!("its addresses have {} bytes; 8 are read", sizes[0]));
    }
    match version {
        // Reserved, two shapes of trees, flags; another shape; four places; the root's name.
        0 | 1 => at.skip(1 + 4 + 4 + if version == 1 { 4 } else { 0 } + 32 + 8)?,
        // Flags, three places.
        _ => at.skip(1 + 24)?,
    }
    at.long()
}

/// All messages of an object.
pub(super) fn messages<'a>(bytes: &Bytes<'a>, address: u64) -> Read<Vec<Message<'a>>> {
    let mut out = Vec::new();
    let mut blocks = Vec::new();
    let mut at = bytes.from(address)?;
    let newer = at.rest().starts_with(b"OHDR");
    let mut tracked = false;
    if newer {
        at.skip(5)?;
        let flags = at.byte()?;
        tracked = flags & 4 != 0;
        at.skip(if flags & 0x20 != 0 { 16 } else { 0 } + if flags & 0x10 != 0 { 4 } else { 0 })?;
        let length = at.number(1 << (flags & 3))? as usize;
        blocks.push(at.take(length)?);
    } else {
        if at.byte()? != 1 {
            return Err("an object's head is not understood".into());
        }
        at.skip(7)?;
        let length = at.word()?;
        at.skip(4)?;
        blocks.push(at.take(length)?);
    }
    let mut read = 0;
    while let Some(&block) = blocks.get(read) {
        read += 1;
        let mut at = Cursor::of(block);
        while at.rest().len() >= if newer { 4 } else { 8 } {
            let message = if newer { next(&mut at, tracked)? } else { next_old(&mut at)? };
            if message.kind == CONTINUED {
                let mut place = Cursor::of(message.bytes);
                let more = bytes.at(place.long()?, place.long()?)?;
                // A newer block has a name before and a sum behind its messages.
                let inside = if newer { more.get(4..more.len().saturating_sub(4)) } else { Some(more) };
                blocks.push(inside.ok_or("an object's description is cut off")?);
            }
            out.push(message);
        }
        if read > MOST_BLOCKS {
            return Err("an object's description does not end".into());
        }
    }
    Ok(out)
}

fn next<'a>(at: &mut Cursor<'a>, tracked: bool) -> Read<Message<'a>> {
    let kind = u16::from(at.byte()?);
    let length = at.short()?;
    at.skip(1 + if tracked { 2 } else { 0 })?;
    Ok(Message { kind, bytes: at.take(length)? })
}

fn next_old<'a>(at: &mut Cursor<'a>) -> Read<Message<'a>> {
    let kind = at.short()? as u16;
    let length = at.short()?;
    at.skip(4)?;
    Ok(Message { kind, bytes: at.take(length)? })
}
