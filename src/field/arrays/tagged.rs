//! TIFF whose samples are numbers, not colours: phases and fields' parts as cameras' and labs' programs save them.

use super::{Array, Values};
use crate::error::{Error, Result};
use crate::files;
use crate::files::pictures::tiff_directory_fits;
use std::fs::File;
use std::io::{BufReader, Seek as _};
use std::path::Path;
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::encoder::TiffEncoder;
use tiff::encoder::colortype::Gray32Float;
use tiff::tags::Tag;

/// Reads the first picture of a file of one sample a pixel.
///
/// # Errors
/// [`Error::Input`] for what is no such TIFF, or promises more than 2³² values.
pub(super) fn read(path: &Path) -> Result<Array> {
    let refused = |e: tiff::TiffError| Error::input(path, format!("not a TIFF that can be read: {e}"));
    let mut file = BufReader::new(File::open(path).map_err(Error::io(path))?);
    let length = file.get_ref().metadata().map_err(Error::io(path))?.len();
    if !tiff_directory_fits(&mut file, length) {
        return Err(Error::input(path, "not a TIFF that can be read: its directory promises more than the file holds"));
    }
    file.rewind().map_err(Error::io(path))?;
    let mut decoder = Decoder::new(file).map_err(refused)?;
    let (width, height) = decoder.dimensions().map_err(refused)?;
    let ColorType::Gray(bits) = decoder.colortype().map_err(refused)? else {
        return Err(Error::input(path, "has colours; an array has one sample a pixel"));
    };
    // The packings of TIFF make at most some hundred values of a byte; LZW and deflate at most about a thousand.
    let bytes = u64::from(width) * u64::from(height) * u64::from(bits).div_ceil(8);
    if bytes > length.saturating_mul(1100) || bytes > 1 << 33 {
        return Err(Error::input(path, format!("promises {width}×{height} pixels, the file has {length} bytes")));
    }
    let mut limits = Limits::default();
    limits.decoding_buffer_size = bytes as usize + (1 << 16);
    limits.intermediate_buffer_size = bytes as usize + (1 << 16);
    let mut decoder = decoder.with_limits(limits);
    let whole = |values: Vec<i64>| Values::Whole(values);
    let values = match decoder.read_image().map_err(refused)? {
        DecodingResult::U8(v) => whole(v.into_iter().map(Into::into).collect()),
        DecodingResult::U16(v) => whole(v.into_iter().map(Into::into).collect()),
        DecodingResult::U32(v) => whole(v.into_iter().map(Into::into).collect()),
        DecodingResult::U64(v) => whole(v.into_iter().map(|v| i64::try_from(v).unwrap_or(i64::MAX)).collect()),
        DecodingResult::I8(v) => whole(v.into_iter().map(Into::into).collect()),
        DecodingResult::I16(v) => whole(v.into_iter().map(Into::into).collect()),
        DecodingResult::I32(v) => whole(v.into_iter().map(Into::into).collect()),
        DecodingResult::I64(v) => whole(v),
        DecodingResult::F16(v) => Values::Real(v.into_iter().map(|v| v.to_f64()).collect()),
        DecodingResult::F32(v) => Values::Real(v.into_iter().map(Into::into).collect()),
        DecodingResult::F64(v) => Values::Real(v),
    };
    let shape = vec![height as usize, width as usize];
    if values.count() != shape.iter().product::<usize>() {
        return Err(Error::input(path, "has another number of samples than pixels"));
    }
    let origin = format!("TIFF of {} numbers", values.kind());
    Ok(Array { shape, values, origin })
}

/// Whether a file's first picture has one float a pixel.
pub(super) fn is_float(path: &Path) -> bool {
    let open = || {
        let mut file = BufReader::new(File::open(path).ok()?);
        let length = file.get_ref().metadata().ok()?.len();
        let fits = tiff_directory_fits(&mut file, length);
        file.rewind().ok()?;
        let mut decoder = fits.then(|| Decoder::new(file).ok()).flatten()?;
        let gray = matches!(decoder.colortype().ok()?, ColorType::Gray(_));
        let format = decoder.find_tag_unsigned::<u16>(Tag::SampleFormat).ok().flatten();
        Some(gray && format == Some(3))
    };
    open() == Some(true)
}

/// Writes floats as a TIFF of one picture, whole or not at all.
pub(super) fn write(path: &Path, [height, width]: [usize; 2], values: &[f32]) -> Result<()> {
    let refused = |e: tiff::TiffError| match e {
        tiff::TiffError::IoError(source) => Error::Io { path: path.into(), source },
        other => Error::unsupported(format!("{}: {other}", path.display())),
    };
    files::write_whole(path, |out| {
        let mut encoder = TiffEncoder::new(out).map_err(refused)?;
        encoder.write_image::<Gray32Float>(width as u32, height as u32, values).map_err(refused)
    })
}

/// Writes whole numbers as a TIFF of 8 or 16 bits, whole or not at all.
pub(super) fn write_levels(path: &Path, [height, width]: [usize; 2], values: &[i64]) -> Result<()> {
    use tiff::encoder::colortype::{Gray8, Gray16};
    let refused = |e: tiff::TiffError| Error::unsupported(format!("{}: {e}", path.display()));
    let (width, height) = (width as u32, height as u32);
    files::write_whole(path, |out| {
        let mut encoder = TiffEncoder::new(out).map_err(refused)?;
        if values.iter().all(|v| *v < 256) {
            let bytes: Vec<u8> = values.iter().map(|v| *v as u8).collect();
            return encoder.write_image::<Gray8>(width, height, &bytes).map_err(refused);
        }
        let words: Vec<u16> = values.iter().map(|v| *v as u16).collect();
        encoder.write_image::<Gray16>(width, height, &words).map_err(refused)
    })
}
