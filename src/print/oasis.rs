//! OASIS (SEMI P39): a cell of rectangles on layer 1, in the plate's own pixels as grid.
//!
//! Whole numbers take seven bits a byte, the lowest first; signed ones keep their sign in the lowest bit. What is as in the
//! rectangle before is left out.

use super::mask_bytes::Bytes;
use crate::error::Result;

/// The rectangle before: width, height and lower edge.
#[derive(Default)]
pub(super) struct Last {
    width: Option<u64>,
    height: Option<u64>,
    y: Option<u64>,
}

fn number(out: &mut Vec<u8>, mut value: u64) {
    while value > 127 {
        out.push((value & 127) as u8 | 128);
        value >>= 7;
    }
    out.push(value as u8);
}

fn text(out: &mut Vec<u8>, text: &str) {
    number(out, text.len() as u64);
    out.extend(text.bytes());
}

/// START and CELL; the unit is the number of pixels in a micrometre.
pub(super) fn begin(out: &mut Bytes, pitch: f64) -> Result<()> {
    let mut bytes = b"%SEMI-OASIS\r\n\x01".to_vec();
    text(&mut bytes, "1.0");
    let unit = 1e-6 / pitch;
    if (unit - unit.round()).abs() < 1e-9 * unit && unit >= 1.0 {
        // A whole number.
        bytes.push(0);
        number(&mut bytes, unit.round() as u64);
    } else {
        // A double of IEEE 754.
        bytes.push(7);
        bytes.extend(unit.to_le_bytes());
    }
    // The tables' places stand here, and there are none.
    bytes.extend([0; 13]);
    bytes.push(14);
    text(&mut bytes, "FRINGES");
    out.write(&bytes)
}

/// RECTANGLE.
pub(super) fn rectangle(out: &mut Bytes, last: &mut Last, x: [u64; 2], y: [u64; 2]) -> Result<()> {
    let (width, height) = (x[1] - x[0], y[1] - y[0]);
    let first = last.width.is_none();
    let news = [last.width != Some(width), last.height != Some(height), last.y != Some(y[0])];
    let mut bytes = vec![20, 0x10 | (u8::from(first) * 3)];
    if first {
        // Layer and datatype.
        bytes.extend([1, 0]);
    }
    for (news, flag, value) in
        [(news[0], 0x40, width), (news[1], 0x20, height), (true, 0, x[0] << 1), (news[2], 0x08, y[0] << 1)]
    {
        if news {
            bytes[1] |= flag;
            number(&mut bytes, value);
        }
    }
    *last = Last { width: Some(width), height: Some(height), y: Some(y[0]) };
    out.write(&bytes)
}

/// END, filled up to the 256 bytes that it has.
pub(super) fn end(out: &mut Bytes) -> Result<()> {
    let mut bytes = vec![2];
    number(&mut bytes, 252);
    // Room, and no checksum.
    bytes.resize(256, 0);
    out.write(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_take_seven_bits_a_byte() {
        let bytes = |value| {
            let mut out = Vec::new();
            number(&mut out, value);
            out
        };
        // Examples of SEMI P39.
        assert_eq!(bytes(0), [0]);
        assert_eq!(bytes(127), [0x7f]);
        assert_eq!(bytes(128), [0x80, 0x01]);
        assert_eq!(bytes(16_383), [0xff, 0x7f]);
        assert_eq!(bytes(16_384), [0x80, 0x80, 0x01]);
    }
}
