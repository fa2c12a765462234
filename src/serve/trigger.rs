//! Triggers: lines of text over TCP, each of which shows a frame that is kept ready.
//!
//! An empty line, or `next`, shows the next frame of the list that a client of the local protocol has armed; any other line is
//! the name of the frame to show. The answer is a line when the frame is on the panel, of its running number, the time at
//! which it was handed over on the system's monotonic clock [s] and the refreshes missed,
//!
//! ```text
//! 7 5121.034512 0
//! ```
//!
//! or `error: …`. Lines that come before the answer wait for their turn; none is lost.

use super::Flip;
use super::clock::monotonic_seconds;
use super::task::Task;

/// Longest line [bytes].
pub(super) const LINE_LIMIT: usize = 256;

/// What a line asks for, without its end.
pub(super) fn read(line: &[u8]) -> Result<Task, String> {
    let text = std::str::from_utf8(line).map_err(|_| "A trigger is a line of text.".to_owned())?;
    match text.trim() {
        "" | "next" => Ok(Task::Next),
        name => Ok(Task::Recall(name.to_owned())),
    }
}

/// The answer to a frame that is on the panel, or why it is not.
pub(super) fn answer(outcome: Result<&Flip, &str>) -> String {
    match outcome {
        Ok(flip) => {
            let time = monotonic_seconds(flip.at).map_or_else(|| "-".to_owned(), |time| format!("{time:.6}"));
            format!("{} {time} {}\n", flip.number, flip.missed)
        }
        Err(why) => format!("error: {why}\n"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_name_frames_or_ask_for_the_next() {
        for line in ["", "\r", "next", " next\r"] {
            assert_eq!(read(line.as_bytes()), Ok(Task::Next), "{line:?}");
        }
        assert_eq!(read(b"spot 7\r"), Ok(Task::Recall("spot 7".into())));
        assert!(read(&[0xFF]).is_err());
        assert_eq!(answer(Err("no")), "error: no\n");
        let said = answer(Ok(&Flip { at: std::time::Instant::now(), number: 7, missed: 1 }));
        assert!(said.starts_with("7 ") && said.ends_with(" 1\n"), "{said}");
    }
}
