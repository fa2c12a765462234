//! The local protocol: programs of the same user on the same machine, without copying frames through a network.
//!
//! A client connects to a Unix socket. The server answers with one line of JSON: what the panel is, and the path of a file
//! as long as the largest frame, made for this connection alone. The client maps that file into its memory and says
//! `{"mapped": true}`, upon which the file's name is removed; it lives until both sides have closed it. From then on
//! the client writes an array into the mapping and sends a line such as
//!
//! ```text
//! {"show": "phase", "dtype": "float32"}
//! ```
//!
//! with `phase` [rad] in `float32` or `float64`, `amplitude` (0 … 1) likewise, or `levels` in `uint8` or `uint16`: row-major,
//! row 0 on top, the machine's byte order. The answer is a line when the frame is on the panel,
//!
//! ```text
//! {"number": 7, "time": 5121.034512, "missed": 0}
//! ```
//!
//! with the time at which it was handed over on the system's monotonic clock [s], or `{"error": "…"}`. Frames are kept ready by
//! adding `"preload": "NAME"`, and then `{"recall": "NAME"}`, `{"play": ["NAME", …], "rate": 60.0}` and `{"arm": ["NAME", …]}` need
//! no array; `{"forget": ["NAME", …]}` gives up some, or all. Phases and amplitudes go
//! through the panel's correction and level curve here; levels are final.
//!
//! # By a port
//!
//! Where there are no such sockets (Windows), or at another machine, the same is spoken over TCP. The server writes where, and a
//! key, into a file that its user alone may read (`NAME.port`); the client's first line is `{"key": "…"}`, and without it
//! nothing is told (from another machine key and frames cross the network as they are, not encrypted). There is no common memory then: the greeting has no `buffer`, a request with an array is answered with
//! `{"send": BYTES}`, upon which the client sends the array's bytes, little-endian.
//!
//! # Why it is made so
//!
//! A file-system socket is the user's own by its permissions; a port of loopback is everybody's on the machine, so that one needs a
//! key. The array
//! crosses in shared memory, so that neither side copies it through a socket in pieces. The server *reads* the file and
//! never maps it: a client that cuts the file short would end a process that has it mapped (SIGBUS), but only
//! shortens a read. The server makes the file, because a path that a client names could be any file that the server may read,
//! or a pipe that never answers. The values are copied once before they are looked at, so that a client which goes on
//! writing spoils its own frame only.

use super::clock::monotonic_seconds;
use super::local_request::{ArrayType, Dtype, Quantity};
use super::task::Done;
use super::{SentFrame, ServedPanel};
use crate::panel::Modulation;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::path::Path;
use std::time::Instant;

/// Version of the protocol.
const VERSION: u32 = 1;
/// Bytes of a pixel in the widest type that is taken.
pub(super) const WIDEST: usize = 8;

/// Where the bytes of a client's array come from.
pub(super) trait Source {
    /// Fills `bytes`; the error is an answer to the client.
    fn read(&mut self, bytes: &mut [u8]) -> Result<(), String>;
}

/// Whether a panel can show such an array at all.
pub(super) fn check(array: ArrayType, panel: &ServedPanel) -> Result<(), String> {
    let wrong = |wants: &str, has: &str| Err(format!("The panel modulates {has}; it cannot show {wants}."));
    match (array.quantity, panel.modulation) {
        (Quantity::Phase, Modulation::Amplitude) => wrong("phase", "amplitude"),
        (Quantity::Amplitude, Modulation::Phase) => wrong("amplitude", "phase"),
        _ => Ok(()),
    }
}

/// Copies a frame out of an array that the panel can show ([`check`]).
pub(super) fn take(array: ArrayType, panel: &ServedPanel, source: &mut impl Source) -> Result<SentFrame, String> {
    let pixels = panel.pixels();
    Ok(match array.dtype {
        Dtype::Uint8 => panel.take(read::<u8>(source, pixels)?.into_iter().map(u16::from).collect())?,
        Dtype::Uint16 => panel.take(read(source, pixels)?)?,
        Dtype::Float32 => SentFrame::Values(read(source, pixels)?),
        Dtype::Float64 => {
            // A phase of many turns is brought to one before it loses its last digits.
            let turn = |v: f64| (v - TAU * (v / TAU).floor()) as f32;
            let values_read: Vec<f64> = read(source, pixels)?;
            SentFrame::Values(match array.quantity {
                Quantity::Phase => values_read.into_par_iter().map(turn).collect(),
                _ => values_read.into_iter().map(|v| v as f32).collect(),
            })
        }
    })
}

fn read<T: bytemuck::Pod>(source: &mut impl Source, count: usize) -> Result<Vec<T>, String> {
    let mut values = crate::field::zeroed(count);
    source.read(bytemuck::cast_slice_mut(&mut values))?;
    Ok(values)
}

fn line(value: &Value) -> String {
    value.to_string() + "\n"
}

/// The first line to a client. `buffer`: the file that its arrays are to stand in, and its length; none: they are sent.
pub(super) fn greeting(panel: &ServedPanel, buffer: Option<(&Path, usize)>) -> String {
    let mut about = json!({
        "holodrive": env!("CARGO_PKG_VERSION"),
        "protocol": VERSION,
        "name": panel.name,
        "width": panel.width,
        "height": panel.height,
        "bits": panel.bits,
        "modulation": match panel.modulation {
            Modulation::Phase => "phase",
            Modulation::Amplitude => "amplitude",
        },
        "pixel_pitch": panel.pixel_pitch,
        "wavelength": panel.wavelength,
        "settle_time": panel.settle_time,
        // Seven decimals: a curve of 16 bits stays within the megabyte that clients read as a line.
        "curve": panel.curve.iter().map(|value| (value * 1e7).round() / 1e7).collect::<Vec<_>>(),
    });
    if let Some((path, bytes)) = buffer {
        about["buffer"] = path.to_string_lossy().into();
        about["bytes"] = bytes.into();
    }
    line(&about)
}

/// The answer to a request whose array is to be sent now.
pub(super) fn send(bytes: usize) -> String {
    line(&json!({ "send": bytes }))
}

/// The answer to a request that has nothing to tell.
pub(super) fn done() -> String {
    line(&json!({}))
}

/// The answer to a task that was done. `arrived`: when its request came in.
pub(super) fn answer(done: &Done, arrived: Instant) -> String {
    line(&match done {
        Done::Shown(flip) => json!({
            "number": flip.number,
            "time": monotonic_seconds(flip.at),
            "missed": flip.missed,
            "latency": flip.at.saturating_duration_since(arrived).as_secs_f64(),
        }),
        Done::Played(flips) => json!({
            "first": flips.first().map(|flip| flip.number),
            // Microseconds: the line stays within what clients read as one.
            "times": flips
                .iter()
                .map(|flip| monotonic_seconds(flip.at).map(|time| (time * 1e6).round() / 1e6))
                .collect::<Vec<_>>(),
            "missed": flips.iter().map(|flip| flip.missed).collect::<Vec<_>>(),
        }),
        Done::Kept(frames) => json!({ "kept": frames }),
    })
}

/// The answer to a request that was refused.
pub(super) fn refusal(why: &str) -> String {
    line(&json!({ "error": why }))
}
