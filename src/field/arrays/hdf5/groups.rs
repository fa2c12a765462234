//! Groups: which objects there are, and what they are called.

use super::Read;
use super::bytes::{Bytes, Cursor, text};
use super::objects::messages;
use std::collections::BTreeSet;

const LINK_INFO: u16 = 0x02;
const LINK: u16 = 0x06;
const SYMBOLS: u16 = 0x11;
/// Most objects of a file that are looked at.
const MOST: usize = 10_000;
/// Deepest tree of names.
const DEEPEST: usize = 64;

/// Names and places of all objects below a group; what is linked twice comes once.
pub(super) fn walk(bytes: &Bytes, root: u64) -> Read<Vec<(String, u64)>> {
    let mut found: Vec<(String, u64)> = Vec::new();
    let mut seen = BTreeSet::from([root]);
    let mut groups = vec![(String::new(), root)];
    while let Some((group, address)) = groups.pop() {
        // MATLAB keeps what belongs to its cells in a group of its own, h5py nothing.
        let own = members(bytes, address)?;
        for (name, address) in own {
            if seen.len() >= MOST {
                return Ok(found);
            }
            if seen.insert(address) && !name.starts_with('#') {
                let full = if group.is_empty() { name } else { format!("{group}/{name}") };
                groups.push((full.clone(), address));
                found.push((full, address));
            }
        }
    }
    found.sort();
    Ok(found)
}

/// What a group holds; nothing for what is no group.
fn members(bytes: &Bytes, address: u64) -> Read<Vec<(String, u64)>> {
    let mut out = Vec::new();
    // What is linked to and cannot be read is passed over.
    let Ok(messages) = messages(bytes, address) else { return Ok(out) };
    for message in messages {
        let mut at = Cursor::of(message.bytes);
        match message.kind {
            LINK => out.extend(link(at)?),
            LINK_INFO => {
                at.skip(1)?;
                let flags = at.byte()?;
                at.skip(if flags & 1 != 0 { 8 } else { 0 })?;
                if at.address()?.is_some() {
                    return Err(
                        "a group keeps its names in a heap, which is not read; write it with libver='earliest'".into(),
                    );
                }
            }
            SYMBOLS => {
                let (tree, heap) = (at.long()?, at.long()?);
                let mut head = bytes.from(heap)?;
                head.expect(b"HEAP")?;
                head.skip(4)?;
                let length = head.long()?;
                head.skip(8)?;
                let names = bytes.at(head.long()?, length)?;
                symbols(bytes, tree, names, &mut BTreeSet::new(), &mut out)?;
            }
            _ => {}
        }
    }
    Ok(out)
}

/// A link of a newer group, where it is a hard one.
fn link(mut at: Cursor) -> Read<Option<(String, u64)>> {
    at.skip(1)?;
    let flags = at.byte()?;
    let kind = if flags & 8 != 0 { at.byte()? } else { 0 };
    at.skip(if flags & 4 != 0 { 8 } else { 0 } + if flags & 16 != 0 { 1 } else { 0 })?;
    let length = at.number(1 << (flags & 3))? as usize;
    let name = text(at.take(length)?);
    if kind == 0 { Ok(Some((name, at.long()?))) } else { Ok(None) }
}

/// The entries of an older group's tree.
fn symbols(
    bytes: &Bytes,
    node: u64,
    names: &[u8],
    above: &mut BTreeSet<u64>,
    out: &mut Vec<(String, u64)>,
) -> Read<()> {
    let mut at = bytes.from(node)?;
    if at.rest().starts_with(b"SNOD") {
        at.skip(6)?;
        for _ in 0..at.short()? {
            let (name, address) = (at.long()?, at.long()?);
            at.skip(24)?;
            let name = usize::try_from(name).ok().and_then(|begin| names.get(begin..)).ok_or("a name is cut off")?;
            // A soft link names another place, and has none.
            if address != u64::MAX {
                out.push((text(name), address));
            }
        }
        return Ok(());
    }
    if !above.insert(node) || above.len() > MOST.min(DEEPEST * DEEPEST) {
        return Err("a group's names run in a circle".into());
    }
    at.expect(b"TREE")?;
    at.skip(2)?;
    let count = at.short()?;
    at.skip(16)?;
    for _ in 0..count {
        at.skip(8)?;
        let child = at.long()?;
        symbols(bytes, child, names, above, out)?;
    }
    Ok(())
}
