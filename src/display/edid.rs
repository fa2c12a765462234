//! EDID: what a monitor says about itself over its cable.
//!
//! Only what tells one panel from another and what spoils levels is read: maker, product, name, serial, native mode,
//! bits per colour, and whether the sink calls itself HDMI (graphics cards then like to send limited-range RGB).
//!
//! Layout: VESA Enhanced EDID Standard 1.4 (base block, 128 bytes); CTA-861 (extension block, tag 2).

use crate::error::{Error, Result};
use serde::Serialize;

const BLOCK: usize = 128;
const HEADER: [u8; 8] = [0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0];
/// Offsets of the four 18-byte descriptors of the base block.
const DESCRIPTORS: [usize; 4] = [54, 72, 90, 108];
const TAG_SERIAL: u8 = 0xFF;
const TAG_NAME: u8 = 0xFC;
const EXTENSION_CTA: u8 = 0x02;
/// Type of a vendor-specific data block in a CTA extension.
const CTA_VENDOR_SPECIFIC: u8 = 3;
/// The IEEE identifier by which a sink declares itself HDMI, as its three bytes stand in the block.
const HDMI_VENDOR: [u8; 3] = [0x03, 0x0C, 0x00];

/// The identity of a monitor and the parts of its EDID that matter to a light modulator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Edid {
    /// Three letters of the maker's PNP identifier, e.g. `HOE`.
    pub manufacturer: String,
    /// The maker's product code.
    pub product: u16,
    /// Numeric serial number; 0 when the maker left it out.
    pub number: u32,
    /// Monitor name, e.g. `HE PLUTO-2.1`.
    pub name: Option<String>,
    /// Serial number in text.
    pub serial: Option<String>,
    /// Year of manufacture or model year.
    pub year: u16,
    /// The native (preferred) mode.
    pub native: Option<NativeMode>,
    /// Bits per colour that the sink takes, where it says so (EDID 1.4, digital input).
    pub bits_per_colour: Option<u8>,
    /// Whether the sink declares itself HDMI: the graphics card may then send limited-range RGB (16–235).
    pub hdmi: bool,
    /// Whether the base block's bytes add up. Emulators and edited EDIDs often do not; their names are still useful.
    pub checksum_valid: bool,
}

/// The first detailed timing of an EDID: the mode in which one video pixel is one pixel of the panel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NativeMode {
    /// Active columns [px].
    pub width: u32,
    /// Active rows [px].
    pub height: u32,
    /// Frames per second [Hz].
    pub refresh: f64,
}

impl Edid {
    /// Reads an EDID: the base block and, as far as they are there, its extensions.
    ///
    /// ```
    /// use holodrive::display::Edid;
    ///
    /// let mut bytes = [0; 128];
    /// bytes[..8].copy_from_slice(&[0, 255, 255, 255, 255, 255, 255, 0]);
    /// // The maker: three letters of five bits each.
    /// bytes[8..10].copy_from_slice(&(8 << 10 | 15 << 5 | 5u16).to_be_bytes());
    /// // A text descriptor, the monitor's name.
    /// bytes[72..90].copy_from_slice(b"\0\0\0\xFC\0HE PLUTO-2.1\n");
    /// let edid = Edid::parse(&bytes)?;
    /// assert_eq!((edid.manufacturer.as_str(), edid.name.as_deref()), ("HOE", Some("HE PLUTO-2.1")));
    /// # Ok::<(), holodrive::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`Error::Display`] when `bytes` is shorter than a base block or does not begin with the EDID header.
    pub fn parse(bytes: &[u8]) -> Result<Self> {
        let Some(base) = bytes.get(..BLOCK) else {
            return Err(fault(format!("{} bytes, a base block has {BLOCK}", bytes.len())));
        };
        if base[..8] != HEADER {
            return Err(fault("it does not begin with 00 FF FF FF FF FF FF 00".to_owned()));
        }
        let word = |at: usize| u16::from_le_bytes([base[at], base[at + 1]]);
        let digital = base[20] & 0x80 != 0;
        let descriptors = || DESCRIPTORS.iter().map(|&at| &base[at..at + 18]);
        let text = |tag: u8| descriptors().find(|d| d[..3] == [0, 0, 0] && d[3] == tag).and_then(descriptor_text);
        Ok(Self {
            manufacturer: manufacturer(u16::from_be_bytes([base[8], base[9]])),
            product: word(10),
            number: u32::from_le_bytes([base[12], base[13], base[14], base[15]]),
            name: text(TAG_NAME),
            serial: text(TAG_SERIAL),
            year: 1990 + u16::from(base[17]),
            native: descriptors().next().and_then(native_mode),
            bits_per_colour: (digital && base[18] == 1 && base[19] >= 4).then(|| bits_per_colour(base[20])).flatten(),
            hdmi: bytes[BLOCK..].chunks_exact(BLOCK).take(usize::from(base[126])).any(declares_hdmi),
            checksum_valid: base.iter().fold(0u8, |sum, &byte| sum.wrapping_add(byte)) == 0,
        })
    }
}

fn fault(what: String) -> Error {
    Error::Display { what: format!("EDID cannot be read: {what}") }
}

/// Three letters, five bits each, A = 1 (EDID 1.4, section 3.4.1). A value that is no letter becomes `?`.
fn manufacturer(packed: u16) -> String {
    [10, 5, 0]
        .map(|shift| match ((packed >> shift) & 31) as u8 {
            letter @ 1..=26 => char::from(b'A' + letter - 1),
            _ => '?',
        })
        .iter()
        .collect()
}

/// Section 3.6.1: value 2..6 of bits 6..4 stand for 8, 10, 12, 14, 16; 1 for 6; 0 is undefined, 7 reserved.
fn bits_per_colour(input: u8) -> Option<u8> {
    match (input >> 4) & 7 {
        code @ 1..=6 => Some(4 + 2 * code),
        _ => None,
    }
}

/// Text of a display descriptor: up to 13 bytes, ended by a line feed, padded with spaces (section 3.10.3).
fn descriptor_text(descriptor: &[u8]) -> Option<String> {
    let bytes = descriptor[5..18].split(|&byte| byte == b'\n' || byte == 0).next().unwrap_or_default();
    let text: String =
        bytes.iter().map(|&byte| if (0x20..0x7F).contains(&byte) { char::from(byte) } else { '?' }).collect();
    let text = text.trim();
    (!text.is_empty()).then(|| text.to_owned())
}

/// A detailed timing (section 3.10.2): active and blanking pixels, 12 bits each, and the pixel clock in 10 kHz.
fn native_mode(timing: &[u8]) -> Option<NativeMode> {
    let clock = u16::from_le_bytes([timing[0], timing[1]]);
    let twelve = |low: usize, high: u8| u32::from(timing[low]) | u32::from(high) << 8;
    let (width, horizontal_blank) = (twelve(2, timing[4] >> 4), twelve(3, timing[4] & 15));
    let (rows, vertical_blank) = (twelve(5, timing[7] >> 4), twelve(6, timing[7] & 15));
    if clock == 0 || width == 0 || rows == 0 {
        return None;
    }
    let interlaced = timing[17] & 0x80 != 0;
    let refresh = f64::from(clock) * 1e4 / (f64::from(width + horizontal_blank) * f64::from(rows + vertical_blank));
    // An interlaced timing gives the rows of one field.
    Some(NativeMode { width, height: if interlaced { 2 * rows } else { rows }, refresh })
}

/// Whether a CTA-861 extension holds the HDMI vendor block in its data block collection (bytes 4 up to the timings).
fn declares_hdmi(block: &[u8]) -> bool {
    if block[0] != EXTENSION_CTA || block[1] < 3 {
        return false;
    }
    let end = usize::from(block[2]).min(BLOCK - 1);
    let mut at = 4;
    while at < end {
        let (kind, length) = (block[at] >> 5, usize::from(block[at] & 31));
        let Some(data) = block.get(at + 1..(at + 1 + length).min(end)) else { return false };
        if kind == CTA_VENDOR_SPECIFIC && data.starts_with(&HDMI_VENDOR) {
            return true;
        }
        at += 1 + length;
    }
    false
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    fn with_checksum(mut block: Vec<u8>) -> Vec<u8> {
        block[127] = block[..127].iter().fold(0u8, |sum, &byte| sum.wrapping_sub(byte));
        block
    }

    fn descriptor(block: &mut [u8], slot: usize, tag: u8, text: &[u8]) {
        let at = DESCRIPTORS[slot];
        block[at..at + 5].copy_from_slice(&[0, 0, 0, tag, 0]);
        block[at + 5..at + 18].fill(b' ');
        block[at + 5..at + 5 + text.len()].copy_from_slice(text);
        if text.len() < 13 {
            block[at + 5 + text.len()] = b'\n';
        }
    }

    /// A 1920×1080 panel, laid out byte by byte as the standard's own example does.
    pub(in super::super) fn pluto() -> Vec<u8> {
        let mut block = vec![0; BLOCK];
        block[..8].copy_from_slice(&HEADER);
        // H=8, O=15, E=5: 01000 01111 00101.
        block[8..10].copy_from_slice(&0b0_01000_01111_00101_u16.to_be_bytes());
        block[10..12].copy_from_slice(&0x2101_u16.to_le_bytes());
        block[12..16].copy_from_slice(&1_234_567_u32.to_le_bytes());
        block[16..20].copy_from_slice(&[12, 31, 1, 4]);
        // Digital, 8 bits per colour, HDMI-a.
        block[20] = 0b1010_0010;
        // CTA mode 16: 148.5 MHz, 1920 + 280, 1080 + 45, progressive.
        block[54..72].copy_from_slice(&[
            0x02, 0x3A, 0x80, 0x18, 0x71, 0x38, 0x2D, 0x40, 0x58, 0x2C, 0x45, 0, 0x0F, 0x08, 0, 0, 0, 0x1E,
        ]);
        descriptor(&mut block, 1, TAG_NAME, b"HE PLUTO-2.1");
        descriptor(&mut block, 2, TAG_SERIAL, b"6010-0042 AAA");
        descriptor(&mut block, 3, 0x10, b"");
        with_checksum(block)
    }

    #[test]
    fn a_full_base_block_is_read() {
        let edid = Edid::parse(&pluto()).expect("EDID");
        assert_eq!(edid.manufacturer, "HOE");
        assert_eq!((edid.product, edid.number, edid.year), (0x2101, 1_234_567, 2021));
        assert_eq!(edid.name.as_deref(), Some("HE PLUTO-2.1"));
        // Thirteen characters fill the descriptor and have no line feed.
        assert_eq!(edid.serial.as_deref(), Some("6010-0042 AAA"));
        let native = edid.native.expect("native mode");
        assert_eq!((native.width, native.height), (1920, 1080));
        assert!((native.refresh - 60.0).abs() < 1e-12, "{}", native.refresh);
        assert_eq!(edid.bits_per_colour, Some(8));
        assert!(edid.checksum_valid && !edid.hdmi);
    }

    #[test]
    fn twelve_bit_sizes_and_interlace_are_read() {
        let mut block = pluto();
        // 4094 + 100 columns, 1200 + 50 rows of a field: high nibbles are used; interlaced.
        block[56..62].copy_from_slice(&[0xFE, 0x64, 0xF0, 0xB0, 0x32, 0x40]);
        block[71] = 0x80;
        let native = Edid::parse(&with_checksum(block)).expect("EDID").native.expect("native mode");
        assert_eq!((native.width, native.height), (4094, 2400));
        assert!((native.refresh - 148.5e6 / (4194.0 * 1250.0)).abs() < 1e-9);
    }

    #[test]
    fn a_first_descriptor_without_a_timing_gives_no_native_mode() {
        let mut block = pluto();
        descriptor(&mut block, 0, 0xFD, b"");
        assert_eq!(Edid::parse(&with_checksum(block)).expect("EDID").native, None);
    }

    #[test]
    fn the_hdmi_vendor_block_is_found_behind_other_data_blocks() {
        let mut bytes = pluto();
        bytes[126] = 1;
        let mut bytes = with_checksum(bytes);
        let mut extension = vec![0; BLOCK];
        // Video data block of two codes, then the vendor block; timings begin at byte 13.
        extension[..4].copy_from_slice(&[EXTENSION_CTA, 3, 13, 0]);
        extension[4..7].copy_from_slice(&[0x42, 16, 31]);
        extension[7..13].copy_from_slice(&[0x65, 0x03, 0x0C, 0x00, 0x10, 0x00]);
        bytes.extend(with_checksum(extension));
        assert!(Edid::parse(&bytes).expect("EDID").hdmi);
        // The same blocks behind the end of the collection are timings, not data.
        bytes[BLOCK + 2] = 7;
        assert!(!Edid::parse(&bytes).expect("EDID").hdmi);
    }

    #[test]
    fn a_wrong_checksum_is_told_and_the_name_still_read() {
        let mut block = pluto();
        block[127] ^= 1;
        let edid = Edid::parse(&block).expect("EDID");
        assert!(!edid.checksum_valid);
        assert_eq!(edid.name.as_deref(), Some("HE PLUTO-2.1"));
    }

    #[test]
    fn short_blocks_and_wrong_headers_are_refused() {
        assert!(Edid::parse(&pluto()[..127]).is_err());
        let mut block = pluto();
        block[0] = 1;
        assert!(Edid::parse(&block).is_err());
    }

    proptest! {
        #[test]
        fn any_bytes_behind_the_header_are_read_without_panic(body in prop::collection::vec(any::<u8>(), 120..400)) {
            let mut bytes = HEADER.to_vec();
            bytes.extend(body);
            let edid = Edid::parse(&bytes).expect("the header is right");
            prop_assert_eq!(edid.manufacturer.chars().count(), 3);
        }
    }
}
