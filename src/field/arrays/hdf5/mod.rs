//! HDF5, and MATLAB's `.mat` of version 7.3, which is HDF5: arrays of numbers and of complex pairs.
//!
//! Read are files as h5py and MATLAB write them (superblocks 0 to 3; groups by symbol tables or links; contiguous, compact
//! and chunked arrays, packed by deflate, shuffled or not). The format is The HDF Group's *HDF5 File Format Specification*
//! 3.0. Every place and length in a file is checked before it is believed; what is not understood is said.

mod bytes;
mod chunks;
mod data;
mod groups;
mod objects;
mod write;

pub(super) use write::{Stored, head};

use super::{Array, choose, sides};
use crate::error::{Error, Result};
use bytes::Bytes;
use data::Dataset;
use std::path::Path;

const MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Why a part of a file cannot be read, in words.
type Read<T> = std::result::Result<T, String>;

/// Reads one array.
pub(super) fn read(path: &Path, name: Option<&str>) -> Result<Array> {
    let file = std::fs::read(path).map_err(Error::io(path))?;
    let refused = |why: String| Error::input(path, format!("not an HDF5 file that can be read: {why}"));
    // A program may keep a block of its own before the file's begin: MATLAB one of 512 bytes.
    let begins = std::iter::once(0).chain((9..32).map(|power| 1usize << power));
    let begin = begins.take_while(|&at| at < file.len()).find(|&at| file[at..].starts_with(MAGIC));
    let begin = begin.ok_or_else(|| refused("it does not begin as one".into()))?;
    let is_matlab = file.starts_with(b"MATLAB");
    let bytes = Bytes::new(&file[begin..]);
    let root = objects::root(&bytes).map_err(refused)?;
    let (mut there, mut unread) = (Vec::new(), None);
    for (own, address) in groups::walk(&bytes, root).map_err(refused)? {
        let dataset = match Dataset::read(&bytes, address) {
            Ok(Some(dataset)) => dataset,
            Ok(None) => continue,
            Err(why) => {
                unread.get_or_insert(format!("`{own}`: {why}"));
                continue;
            }
        };
        let plane = dataset.shape.iter().filter(|&&side| side > 1).count() >= 2;
        if name.is_some() || plane {
            // MATLAB's sides run the other way round.
            let mut shape = dataset.shape.clone();
            if is_matlab {
                shape.reverse();
            }
            let what = format!("{} {}", sides(&shape), dataset.kind.name());
            there.push((own, what, (dataset, shape)));
        }
    }
    if let (true, Some(why)) = (there.is_empty(), unread) {
        return Err(refused(why));
    }
    let (own, what, (dataset, shape)) = choose(path, name, &there)?;
    let values = dataset.values(&bytes).map_err(|why| Error::input(path, format!("`{own}`: {why}")))?;
    let origin = format!("`{own}`, {what}");
    Ok(match is_matlab {
        true => Array::from_fortran(shape.clone(), values, format!("{origin}, MATLAB's order")),
        false => Array { shape: shape.clone(), values, origin },
    })
}
