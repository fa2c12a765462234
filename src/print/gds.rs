//! GDSII: a structure of rectangles on layer 1, in the plate's own pixels as database unit.
//!
//! GDSII Stream Format, release 6.0: records of a 16-bit length, a type, a kind of data, all big-endian; reals with base 16.

use super::mask_bytes::Bytes;
use crate::error::Result;

/// Header, library and structure; the database unit is a pixel.
pub(super) fn begin(out: &mut Bytes, pitch: f64) -> Result<()> {
    words(out, 0x0002, &[600])?;
    // Dates of last change: a fixed one, so that the same plate is the same file.
    let date = [1970, 1, 1, 0, 0, 0, 1970, 1, 1, 0, 0, 0];
    words(out, 0x0102, &date)?;
    text(out, 0x0206, "PLATE")?;
    // The database unit in micrometres and in metres.
    let units: Vec<u8> = [pitch / 1e-6, pitch].iter().flat_map(|v| real(*v)).collect();
    record(out, 0x0305, &units)?;
    words(out, 0x0502, &date)?;
    text(out, 0x0606, "FRINGES")
}

/// A boundary of four corners on layer 1.
pub(super) fn rectangle(out: &mut Bytes, x: [u64; 2], y: [u64; 2]) -> Result<()> {
    let corners = [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]], [x[0], y[0]]];
    let bytes: Vec<u8> = corners.iter().flatten().flat_map(|v| (*v as i32).to_be_bytes()).collect();
    record(out, 0x0800, &[])?;
    words(out, 0x0d02, &[1])?;
    words(out, 0x0e02, &[0])?;
    record(out, 0x1003, &bytes)?;
    record(out, 0x1100, &[])
}

/// The end of structure and library.
pub(super) fn end(out: &mut Bytes) -> Result<()> {
    record(out, 0x0700, &[])?;
    record(out, 0x0400, &[])
}

fn record(out: &mut Bytes, kind: u16, data: &[u8]) -> Result<()> {
    let length = 4 + data.len() as u16;
    let mut bytes = length.to_be_bytes().to_vec();
    bytes.extend(kind.to_be_bytes());
    bytes.extend(data);
    out.write(&bytes)
}

fn words(out: &mut Bytes, kind: u16, words: &[u16]) -> Result<()> {
    let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_be_bytes()).collect();
    record(out, kind, &bytes)
}

fn text(out: &mut Bytes, kind: u16, text: &str) -> Result<()> {
    let mut bytes = text.as_bytes().to_vec();
    // Even lengths only.
    bytes.resize(bytes.len().next_multiple_of(2), 0);
    record(out, kind, &bytes)
}

/// An eight-byte real: sign, exponent of 16 in excess 64, 56 bits of fraction.
fn real(value: f64) -> [u8; 8] {
    if value == 0.0 {
        return [0; 8];
    }
    let mut fraction = value.abs();
    let mut exponent = 64u64;
    while fraction >= 1.0 {
        fraction /= 16.0;
        exponent += 1;
    }
    while fraction < 1.0 / 16.0 {
        fraction *= 16.0;
        exponent -= 1;
    }
    let bits = (fraction * (1u64 << 56) as f64) as u64;
    (u64::from(value < 0.0) << 63 | exponent << 56 | bits).to_be_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reals_have_base_sixteen() {
        // 1 is 1/16·16¹, 0.001 a well-known pair of libraries in nanometres.
        assert_eq!(real(1.0), [0x41, 0x10, 0, 0, 0, 0, 0, 0]);
        assert_eq!(real(-2.0), [0xc1, 0x20, 0, 0, 0, 0, 0, 0]);
        assert_eq!(real(1e-3), [0x3e, 0x41, 0x89, 0x37, 0x4b, 0xc6, 0xa7, 0xf0]);
    }
}
