//! NumPy's arrays: `.npy`, and those of a `.npz`.

use super::{Array, Element, Values, choose, sides};
use crate::error::{Error, Result};
use crate::field::npy_head::Head;
use crate::field::npy_zip::Npz;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// Reads the array of a `.npy`.
pub(super) fn read_npy(path: &Path) -> Result<Array> {
    let file = File::open(path).map_err(Error::io(path))?;
    let length = file.metadata().map_err(Error::io(path))?.len();
    let mut reader = BufReader::with_capacity(1 << 20, file);
    let head = Head::read(&mut reader).map_err(|why| Error::input(path, format!("not a .npy file: {why}")))?;
    let element = Element::of_numpy(&head.kind).ok_or_else(|| {
        let what = format!("values of type {}; complex, float and integer arrays are read", head.kind);
        Error::input(path, what)
    })?;
    // A head can promise any size; what it promises must be in the file before memory is taken for it.
    let left = length.saturating_sub(head.bytes.len() as u64);
    let promised = head.promised.filter(|&bytes| bytes <= left).ok_or_else(|| {
        let what = format!("truncated: promises {} values, the file has {length} bytes", sides(&head.shape));
        Error::input(path, what)
    })?;
    let mut bytes = vec![0; promised as usize];
    reader.read_exact(&mut bytes).map_err(|e| Error::input(path, format!("truncated or damaged: {e}")))?;
    let values = element.values(&bytes);
    let origin = format!("{} {}", sides(&head.shape), head.kind);
    Ok(in_c_order(head.shape, values, origin, head.fortran))
}

/// Reads one array of a `.npz`.
pub(super) fn read_npz(path: &Path, name: Option<&str>) -> Result<Array> {
    let mut npz = Npz::open(path)?;
    let names: Vec<String> = npz.names().map(str::to_owned).collect();
    let mut there = Vec::new();
    for own in names {
        // What has no head of an array is something else in the archive.
        let Ok(Some(array)) = npz.array(&own) else { continue };
        let Some(element) = Element::of_numpy(&array.kind) else { continue };
        // Alone is chosen what has the sides of a picture; by its name anything.
        if name.is_some() || array.shape.iter().filter(|&&side| side > 1).count() >= 2 {
            let what = format!("{} {}", sides(&array.shape), array.kind);
            there.push((own, what, element));
        }
    }
    let (own, what, element) = choose(path, name, &there)?;
    let mut array = npz.array(own)?.ok_or_else(|| Error::input(path, format!("{own} is gone")))?;
    let bytes = array.bytes()?;
    let origin = format!("`{own}`, {what}");
    Ok(in_c_order(array.shape.clone(), element.values(&bytes), origin, array.fortran))
}

fn in_c_order(shape: Vec<usize>, values: Values, origin: String, fortran: bool) -> Array {
    match fortran {
        true => Array::from_fortran(shape, values, format!("{origin}, Fortran order")),
        false => Array { shape, values, origin },
    }
}
