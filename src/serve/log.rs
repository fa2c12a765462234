//! Who asked what of a served panel, when, and what came of it: one line for each request, in a file.
//!
//! ```text
//! 2026-03-01T09:30:12.345Z 127.0.0.1:41234 slmpy frame: shown as frame 7
//! 2026-03-01T09:30:12.360Z 127.0.0.1:41234 slmpy frame: refused: the frame does not unfold to 2073600 bytes
//! ```

use crate::error::{Error, Result};
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// Longest line [characters]: a client's words may be in it.
const LINE: usize = 400;
/// Longest log that one server writes [bytes]; clients could fill the disk.
const WHOLE: u64 = 256 << 20;

/// The file, where one was asked for.
#[derive(Debug, Default)]
pub(super) struct Log(Option<Mutex<(File, u64)>>);

impl Log {
    /// Goes on with the file, or begins it.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = OpenOptions::new().create(true).append(true).open(path).map_err(Error::io(path))?;
        Ok(Self(Some(Mutex::new((file, 0)))))
    }

    /// Writes a line, in one piece. What cannot be written is lost: the panel goes on.
    pub(super) fn line(&self, who: &str, what: &str, came: &str) {
        let Some(log) = &self.0 else { return };
        let mut text = format!("{} {who} {what}: {came}", utc(SystemTime::now()));
        // Whatever a client has put into it is one line.
        text = text.chars().map(|c| if c.is_control() { ' ' } else { c }).take(LINE).collect();
        text.push('\n');
        let (file, written) = &mut *log.lock().unwrap_or_else(PoisonError::into_inner);
        if *written > WHOLE {
            return;
        }
        *written += text.len() as u64;
        if *written > WHOLE {
            text += "the log is full; nothing more is written\n";
        }
        let _ = file.write_all(text.as_bytes());
    }
}

/// A time as ISO 8601 writes it, in UTC, to the millisecond.
fn utc(time: SystemTime) -> String {
    let since = time.duration_since(UNIX_EPOCH).unwrap_or_default();
    let (days, seconds) = (since.as_secs() / 86400, since.as_secs() % 86400);
    // Gregorian date of a day number, in years that begin with March: E. G. Richards, 2013; whole from 1970 on.
    let shifted = days + 719_468;
    let (era, of_era) = (shifted / 146_097, shifted % 146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * march + 2) / 5 + 1;
    let month = if march < 10 { march + 3 } else { march - 9 };
    let year = era * 400 + year + u64::from(month <= 2);
    let (hour, minute, second) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{:03}Z", since.subsec_millis())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn times_are_those_of_the_calendar() {
        // GNU date -u -d @seconds.
        for (seconds, wanted) in [
            (0, "1970-01-01T00:00:00.000Z"),
            (951_782_399, "2000-02-28T23:59:59.000Z"),
            (951_782_400, "2000-02-29T00:00:00.000Z"),
            (1_709_251_199, "2024-02-29T23:59:59.000Z"),
            (1_735_689_600, "2025-01-01T00:00:00.000Z"),
            (4_107_542_400, "2100-03-01T00:00:00.000Z"),
        ] {
            assert_eq!(utc(UNIX_EPOCH + Duration::from_secs(seconds)), wanted);
        }
        assert!(utc(UNIX_EPOCH + Duration::from_millis(1789)).ends_with("01.789Z"));
    }

    #[test]
    fn a_line_is_a_line_and_no_longer() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("clients.log");
        std::fs::write(&path, "before\n").expect("write");
        let log = Log::open(&path).expect("log");
        log.line("127.0.0.1:1", "slmsuite", "refused: a\nb\x1b[2J");
        log.line("127.0.0.1:1", "slmsuite", &"x".repeat(9999));
        let text = std::fs::read_to_string(&path).expect("log");
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!((lines.len(), lines[0]), (3, "before"));
        assert!(lines[1].ends_with(" 127.0.0.1:1 slmsuite: refused: a b [2J") && lines[2].len() == LINE);
        assert!(Log::open(&folder.path().join("no").join("folder")).is_err());
        Log::default().line("nobody", "nothing", "is written");
    }
}
