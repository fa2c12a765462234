//! slmPy's protocol: in one connection, for each frame its length (32 bits, little-endian) and the frame: rows of 8-bit levels,
//! raw, or compressed by zlib or gzip. The answer is `done` or `err`.
//!
//! A frame of three bytes a pixel is slmPy's for a colour screen: it is taken where the three are one level. slmPy can compress by
//! bzip2 too; such frames are answered `err`. A level of 255 is 1 on a panel of one bit.

use super::{SentFrame, ServedPanel};
use flate2::read::{GzDecoder, ZlibDecoder};
use std::io::Read;

/// The answer to a frame that is on the panel.
pub(super) const DONE: &[u8] = b"done";
/// The answer to one that is not.
pub(super) const ERR: &[u8] = b"err";

/// Longest frame of one byte a pixel, as it is sent [bytes]: compression that fails adds below 1 %.
pub(super) fn plain_limit(panel: &ServedPanel) -> usize {
    panel.pixels() * 101 / 100 + 1024
}

/// Longest frame as it is sent [bytes]: one of three colours.
pub(super) fn frame_limit(panel: &ServedPanel) -> usize {
    3 * plain_limit(panel)
}

/// Reads a frame as it was sent, its length without.
pub(super) fn read(sent: &[u8], panel: &ServedPanel) -> Result<SentFrame, String> {
    let expected = panel.pixels();
    let mut unfolded = Vec::new();
    let bytes = if sent.len() == expected || sent.len() == 3 * expected {
        sent
    } else {
        let unfold: Box<dyn Read> = match sent {
            [0x1F, 0x8B, ..] => Box::new(GzDecoder::new(sent)),
            [b'B', b'Z', b'h', ..] => return Err("frames compressed by bzip2 are not taken".into()),
            _ => Box::new(ZlibDecoder::new(sent)),
        };
        let read = unfold.take(3 * expected as u64 + 1).read_to_end(&mut unfolded);
        if read.is_err() || (unfolded.len() != expected && unfolded.len() != 3 * expected) {
            return Err(format!("the frame does not unfold to {expected} bytes, nor to three times as many"));
        }
        &unfolded
    };
    let white = |byte: u8| if panel.bits == 1 && byte == 255 { 1 } else { u16::from(byte) };
    if bytes.len() == expected {
        return panel.take(bytes.iter().copied().map(white).collect());
    }
    // Which of three colours a panel shows is its own; they are one level, or nobody knows what is meant.
    if let Some(i) = bytes.chunks_exact(3).position(|rgb| rgb[0] != rgb[1] || rgb[1] != rgb[2]) {
        let (width, rgb) = (panel.width as usize, &bytes[3 * i..3 * i + 3]);
        return Err(format!("colours {rgb:?} at column {}, row {} are not one level", i % width, i / width));
    }
    panel.take(bytes.iter().copied().step_by(3).map(white).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::{GzEncoder, ZlibEncoder};
    use proptest::prelude::*;
    use std::io::Write;

    fn panel() -> ServedPanel {
        ServedPanel {
            name: "panel".into(),
            width: 40,
            height: 30,
            bits: 8,
            modulation: crate::panel::Modulation::Phase,
            pixel_pitch: [8e-6, 8e-6],
            wavelength: 532e-9,
            design_wavelength: 532e-9,
            settle_time: 0.0,
            curve: vec![0.0, 0.5],
        }
    }

    #[test]
    fn raw_zlib_and_gzip_frames_are_the_same() {
        let raw: Vec<u8> = (0..1200u32).map(|i| (i * i % 251) as u8).collect();
        let mut zlib = ZlibEncoder::new(Vec::new(), Compression::default());
        zlib.write_all(&raw).expect("memory");
        let mut gzip = GzEncoder::new(Vec::new(), Compression::default());
        gzip.write_all(&raw).expect("memory");
        for sent in [raw.clone(), zlib.finish().expect("memory"), gzip.finish().expect("memory")] {
            let Ok(SentFrame::Levels(levels)) = read(&sent, &panel()) else { panic!("not read") };
            assert!(levels.iter().zip(&raw).all(|(level, byte)| *level == u16::from(*byte)));
        }
    }

    #[test]
    fn black_and_white_are_the_levels_of_one_bit() {
        let binary = ServedPanel { bits: 1, ..panel() };
        let sent: Vec<u8> = (0..1200).map(|i| [0, 1, 255][i % 3]).collect();
        let wanted = (0..1200).map(|i| [0, 1, 1][i % 3]).collect();
        assert_eq!(read(&sent, &binary), Ok(SentFrame::Levels(wanted)));
        assert!(read(&[254; 1200], &binary).is_err());
    }

    #[test]
    fn colours_of_one_level_are_that_level() {
        let grey: Vec<u8> = (0..1200).flat_map(|i| [(i % 251) as u8; 3]).collect();
        let mut zlib = ZlibEncoder::new(Vec::new(), Compression::default());
        zlib.write_all(&grey).expect("memory");
        for sent in [grey.clone(), zlib.finish().expect("memory")] {
            assert!(sent.len() <= frame_limit(&panel()));
            assert_eq!(read(&sent, &panel()), Ok(SentFrame::Levels((0..1200).map(|i| i % 251).collect())));
        }
        let mut coloured = grey;
        coloured[3 * 85 + 1] = 200;
        let why = read(&coloured, &panel()).expect_err("no level");
        assert!(why.contains("[85, 200, 85] at column 5, row 2"), "{why}");
    }

    #[test]
    fn bzip2_short_frames_and_bombs_are_refused() {
        let mut bomb = ZlibEncoder::new(Vec::new(), Compression::best());
        bomb.write_all(&vec![0; 10_000_000]).expect("memory");
        for sent in [b"BZh91AY&SY".to_vec(), vec![0; 1199], Vec::new(), bomb.finish().expect("memory")] {
            assert!(read(&sent, &panel()).is_err());
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_judged_without_panic(sent in prop::collection::vec(any::<u8>(), 0..2000)) {
            let _ = read(&sent, &panel());
        }
    }
}
