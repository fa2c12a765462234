//! slmsuite's remote protocol (its version 0.5): one request in a connection, JSON in percent-encoding, one line each
//! way.
//!
//! `RemoteSLM` asks `ping` and `pickle` when it is made, then sends `_set_phase_hw` for each frame: final drive levels,
//! to which neither correction nor look-up table are to be applied again. Where asked for, levels are taken as what slmsuite
//! makes of a phase φ on an ideal panel of N levels, round(−φ·N/2π) − 1 modulo N, and brought back to that phase.

use super::{SentFrame, ServedPanel};
use base64::prelude::{BASE64_STANDARD, Engine as _};
use flate2::read::ZlibDecoder;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, percent_decode, percent_encode};
use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::io::Read;
use std::time::{SystemTime, UNIX_EPOCH};

/// The version whose protocol is spoken; the client warns when its own differs.
const VERSION: &str = "0.5.0";
/// Bytes of a request beside its frame.
const HEAD: usize = 64 * 1024;

/// What Python's `quote_plus` encodes, which makes a space `+`.
const QUOTED: &AsciiSet = &NON_ALPHANUMERIC.remove(b'_').remove(b'.').remove(b'-').remove(b'~').remove(b' ');

/// What a client asks for.
#[derive(Debug, PartialEq)]
pub(super) enum Command {
    /// What there is.
    Ping,
    /// What the panel is.
    Describe,
    /// Whether the last frame is on the panel, without another's being shown (`execute=False`).
    Wait,
    /// A frame to be shown.
    Show(SentFrame),
}

/// Only what is needed is kept of a request: a tree of a hostile one could be many times its size.
#[derive(Deserialize)]
struct Request {
    name: Option<String>,
    command: Option<String>,
    #[serde(default, rename = "args")]
    _args: Option<IgnoredAny>,
    #[serde(default)]
    kwargs: Option<Arguments>,
}

#[derive(Deserialize)]
struct Arguments {
    display: Option<Array>,
    execute: Option<bool>,
}

#[derive(Deserialize)]
struct Array {
    #[serde(rename = "__zlib__")]
    zlib: String,
    #[serde(rename = "__shape__")]
    shape: Vec<u64>,
    #[serde(rename = "__dtype__")]
    dtype: String,
}

/// Longest request that can carry a frame of `panel` [bytes].
///
/// Two bytes a level, zlib's worst growth below 1 %, base64 4/3, and each of its characters three when quoted.
pub(super) fn request_limit(panel: &ServedPanel) -> usize {
    HEAD + 2 * panel.pixels() * 101 / 100 * 4
}

/// Reads a request: the line without its end. `calibrated`: levels stand for phases. The error is an answer to the client.
pub(super) fn read(line: &[u8], panel: &ServedPanel, calibrated: bool) -> Result<Command, String> {
    let spaced: Vec<u8> = line.iter().map(|&byte| if byte == b'+' { b' ' } else { byte }).collect();
    let plain: Vec<u8> = percent_decode(&spaced).collect();
    let request: Request =
        serde_json::from_slice(&plain).map_err(|error| format!("The request is not understood: {error}."))?;
    let command = request.command.ok_or("No command provided.")?;
    if command == "ping" {
        return Ok(Command::Ping);
    }
    let name = request.name.unwrap_or_default();
    if name != panel.name {
        return Err(format!("Did not recognize hardware '{name}'. Options: ['{}'].", panel.name));
    }
    match command.as_str() {
        "pickle" => Ok(Command::Describe),
        "_set_phase_hw" => {
            let named = request.kwargs.ok_or("_set_phase_hw carries no display.")?;
            if named.execute == Some(false) {
                return Ok(Command::Wait);
            }
            let packed = named.display.ok_or("_set_phase_hw carries no display.")?;
            let levels = unpack(&packed, panel)?;
            Ok(Command::Show(if calibrated { phases(levels, panel.bits) } else { levels }))
        }
        _ => Err(format!("{name}.{command} not present.")),
    }
}

/// The phases that slmsuite's levels stand for: −2π(g + 1)/N, from 0 on.
fn phases(frame: SentFrame, bits: u8) -> SentFrame {
    let count = 1u32 << bits;
    match frame {
        SentFrame::Levels(levels) => {
            let phase = |g: u16| (f64::from(count - 1 - u32::from(g)) * TAU / f64::from(count)) as f32;
            SentFrame::Values(levels.into_iter().map(phase).collect())
        }
        values @ SentFrame::Values(_) => values,
    }
}

fn unpack(packed: &Array, panel: &ServedPanel) -> Result<SentFrame, String> {
    if packed.shape != [u64::from(panel.height), u64::from(panel.width)] {
        let (width, height) = (panel.width, panel.height);
        return Err(format!("The display is of shape {:?}, the panel of [{height}, {width}].", packed.shape));
    }
    let bytes_of_level = match packed.dtype.as_str() {
        "uint8" => 1,
        "uint16" => 2,
        other => return Err(format!("The display is of type {other}; uint8 and uint16 are taken.")),
    };
    let zlib = BASE64_STANDARD.decode(&packed.zlib).map_err(|_| "The display is not in base64.")?;
    let expected = panel.pixels() * bytes_of_level;
    let mut bytes = Vec::with_capacity(expected);
    // One byte more than expected shows that there is too much, whatever a small text would unfold to.
    let read = ZlibDecoder::new(zlib.as_slice()).take(expected as u64 + 1).read_to_end(&mut bytes);
    if read.is_err() || bytes.len() != expected {
        return Err(format!("The display does not unfold to {expected} bytes."));
    }
    let levels = match bytes_of_level {
        1 => bytes.into_iter().map(u16::from).collect(),
        _ => bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect(),
    };
    panel.take(levels)
}

/// The answer to a command that was carried out, or the reason why not, as the line to send.
pub(super) fn answer(outcome: Result<Value, String>) -> String {
    let reply = match outcome {
        Ok(value) => json!([true, value]),
        Err(why) => json!([false, why]),
    };
    quote_plus(&reply.to_string()) + "\n"
}

fn quote_plus(plain: &str) -> String {
    percent_encode(plain.as_bytes(), QUOTED).to_string().replace(' ', "+")
}

/// The answer to `ping`.
pub(super) fn hardware(panel: &ServedPanel) -> Value {
    json!({ panel.name.as_str(): "slm" })
}

/// The answer to `pickle`: what a client must know of the panel, in slmsuite's names and micrometres.
///
/// slmsuite's `phase_scaling` is the part of its levels that one turn takes: the wavelength over the one at which all of
/// them are a turn. Where levels stand for phases, all of them are one.
pub(super) fn description(panel: &ServedPanel, calibrated: bool) -> Value {
    let [pitch_x, pitch_y] = panel.pixel_pitch;
    let design = if calibrated { panel.wavelength } else { panel.design_wavelength };
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64());
    json!({
        "__version__": VERSION,
        "__time__": format!("{now:.3} s after 1970-01-01 UTC"),
        "__timestamp__": now,
        "__meta__": {
            "__class__": "SLM",
            "name": panel.name,
            "shape": [panel.height, panel.width],
            "bitdepth": panel.bits,
            "bitresolution": 1u32 << panel.bits,
            "pitch_um": [pitch_x * 1e6, pitch_y * 1e6],
            "pitch": [pitch_x / panel.wavelength, pitch_y / panel.wavelength],
            "settle_time_s": panel.settle_time,
            "wav_um": panel.wavelength * 1e6,
            "wav_design_um": design * 1e6,
            "phase_scaling": panel.wavelength / design,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use proptest::prelude::*;
    use std::io::Write;

    fn panel() -> ServedPanel {
        ServedPanel {
            name: "panel".into(),
            width: 5,
            height: 3,
            bits: 10,
            modulation: crate::panel::Modulation::Phase,
            pixel_pitch: [8e-6, 8e-6],
            wavelength: 532e-9,
            design_wavelength: 633e-9,
            settle_time: 0.05,
            curve: vec![0.0, 0.5],
        }
    }

    fn packed(bytes: &[u8]) -> String {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(bytes).expect("memory");
        BASE64_STANDARD.encode(encoder.finish().expect("memory"))
    }

    fn request(shape: &str, dtype: &str, zlib: &str) -> String {
        let json = format!(
            r#"{{"name": "panel", "command": "_set_phase_hw", "args": [], "kwargs": {{"display": {{"__zlib__": "{zlib}", "__shape__": {shape}, "__dtype__": "{dtype}"}}, "block": true}}}}"#
        );
        quote_plus(&json)
    }

    #[test]
    fn text_is_quoted_as_python_does_it() {
        // Python: urllib.parse.quote_plus('{"a": [1, "é/~"]}').
        let (plain, quoted) = ("{\"a\": [1, \"é/~\"]}", "%7B%22a%22%3A+%5B1%2C+%22%C3%A9%2F~%22%5D%7D");
        assert_eq!(quote_plus(plain), quoted);
    }

    #[test]
    fn frames_of_both_widths_are_read() {
        let bytes: Vec<u8> = (0..15).map(|i| i * 17).collect();
        let Ok(Command::Show(SentFrame::Levels(sent))) =
            read(request("[3, 5]", "uint8", &packed(&bytes)).as_bytes(), &panel(), false)
        else {
            panic!("not read");
        };
        assert!(sent.iter().zip(&bytes).all(|(level, byte)| *level == u16::from(*byte)));
        let words: Vec<u16> = (0..15).map(|i| i * 73).collect();
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let Ok(Command::Show(SentFrame::Levels(sent))) =
            read(request("[3, 5]", "uint16", &packed(&bytes)).as_bytes(), &panel(), false)
        else {
            panic!("not read");
        };
        assert_eq!(sent, words);
    }

    #[test]
    fn levels_are_brought_back_to_slmsuites_phases() {
        // What `SLM._phase2gray` does with a phase, where one turn takes all levels.
        let gray = |phase: f64| ((-phase * 1024.0 / TAU).round_ties_even() as i64 - 1).rem_euclid(1024) as u16;
        let wanted: Vec<f64> = (0..15).map(|i| f64::from(i) * 0.4187).collect();
        let words: Vec<u8> = wanted.iter().flat_map(|phase| gray(*phase).to_le_bytes()).collect();
        let line = request("[3, 5]", "uint16", &packed(&words));
        let Ok(Command::Show(SentFrame::Values(sent))) = read(line.as_bytes(), &panel(), true) else {
            panic!("not read");
        };
        for (sent, wanted) in sent.iter().zip(wanted) {
            // Half a level of rounding, and f32.
            assert!((f64::from(*sent) - wanted).abs() < 0.5 * TAU / 1024.0 + 1e-6, "{sent} {wanted}");
        }
    }

    #[test]
    fn a_frame_that_is_not_to_be_executed_is_not_shown() {
        let line = request("[3, 5]", "uint8", &packed(&[7; 15])).replace("block", "execute").replace("true", "false");
        assert_eq!(read(line.as_bytes(), &panel(), false), Ok(Command::Wait));
    }

    #[test]
    fn what_is_wrong_is_answered_and_not_shown() {
        let right = packed(&[0; 15]);
        let above: Vec<u8> = [1024u16; 15].iter().flat_map(|word| word.to_le_bytes()).collect();
        for (line, word) in [
            (request("[5, 3]", "uint8", &right), "shape"),
            (request("[3, 5, 1]", "uint8", &right), "shape"),
            (request("[3, 5]", "float32", &right), "type"),
            (request("[3, 5]", "uint16", &right), "unfold"),
            (request("[3, 5]", "uint8", &packed(&[0; 14])), "unfold"),
            // A bomb: 10 MB of zeros in a few kilobytes.
            (request("[3, 5]", "uint8", &packed(&vec![0; 10_000_000])), "unfold"),
            (request("[3, 5]", "uint8", &right[..8]), "unfold"),
            (request("[3, 5]", "uint8", "!!!!"), "base64"),
            (request("[3, 5]", "uint16", &packed(&above)), "1023"),
            ("%7B".into(), "understood"),
            ("%zz".into(), "understood"),
            (quote_plus(r#"{"name": "panel"}"#), "command"),
            (quote_plus(r#"{"name": "other", "command": "pickle"}"#), "recognize"),
            (quote_plus(r#"{"name": "panel", "command": "__init__"}"#), "not present"),
            (quote_plus(r#"{"name": "panel", "command": "_set_phase_hw", "kwargs": {}}"#), "no display"),
        ] {
            let why = read(line.as_bytes(), &panel(), false).expect_err(word);
            assert!(why.contains(word), "{word}: {why}");
        }
    }

    #[test]
    fn the_panel_is_described_in_slmsuites_names() {
        let ask = |command: &str| {
            let json = format!(
                r#"{{"name": "panel", "command": "{command}", "args": [], "kwargs": {{"attributes": false}}}}"#
            );
            read(quote_plus(&json).as_bytes(), &panel(), false)
        };
        assert_eq!(ask("ping"), Ok(Command::Ping));
        assert_eq!(ask("pickle"), Ok(Command::Describe));
        assert_eq!(answer(Ok(hardware(&panel()))), "%5Btrue%2C%7B%22panel%22%3A%22slm%22%7D%5D\n");
        let meta = &description(&panel(), false)["__meta__"];
        assert_eq!(meta["shape"], json!([3, 5]));
        assert_eq!(meta["bitdepth"], 10);
        assert_eq!(meta["bitresolution"], 1024);
        assert!((meta["wav_um"].as_f64().expect("wavelength") - 0.532).abs() < 1e-12);
        assert!((meta["pitch_um"][0].as_f64().expect("pitch") - 8.0).abs() < 1e-12);
        // A turn at 532 nm takes fewer levels than at 633 nm.
        assert!((meta["phase_scaling"].as_f64().expect("scaling") - 532.0 / 633.0).abs() < 1e-12);
        let meta = &description(&panel(), true)["__meta__"];
        assert_eq!(meta["phase_scaling"], 1.0);
    }

    proptest! {
        #[test]
        fn any_bytes_are_answered_without_panic(line in prop::collection::vec(any::<u8>(), 0..400)) {
            let _ = read(&line, &panel(), false);
        }
    }
}
