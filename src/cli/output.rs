//! What the name of an output says: the kind of file that is written, known before the work is done.

use crate::field::arrays::{self, Named, Values};
use crate::panel::Frame;
use crate::{Error, Result};
use std::path::Path;

/// Kinds of file that a frame is written as.
pub(super) const FRAMES: [&str; 6] = ["png", "npy", "mat", "h5", "tif", "tiff"];
/// Kinds of file that a field is written as.
pub(super) const FIELDS: [&str; 3] = ["npy", "mat", "h5"];
/// Kinds of file that a picture is written as.
pub(super) const PICTURES: [&str; 6] = ["png", "npy", "mat", "h5", "tif", "tiff"];

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Refuses an output of another kind than these, before the work.
pub(super) fn check(path: &Path, kinds: &[&str]) -> Result<()> {
    let kind = extension(path);
    if kinds.contains(&kind.as_str()) {
        return Ok(());
    }
    let all = kinds.iter().map(|kind| format!(".{kind}")).collect::<Vec<_>>().join(", ");
    let what = match kind.as_str() {
        "" => format!("has no ending that says how it is written: {all}"),
        "jpg" | "jpeg" => format!("JPEG does not keep its values; it is written as {all}"),
        _ => format!("is no kind of file that this is written as: {all}"),
    };
    Err(Error::input(path, what))
}

/// Writes a frame as a picture with its metadata, or its levels as an array.
pub(super) fn write_frame(frame: &Frame, path: &Path) -> Result<()> {
    if extension(path) == "png" {
        return frame.write(path);
    }
    let values = Values::Whole(frame.levels.iter().map(|&level| level.into()).collect());
    arrays::write(path, &[Named { name: "levels", shape: [frame.height, frame.width], values: &values }])
}
