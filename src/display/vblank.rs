//! The moment between two scans of a monitor, as the X server tells it (Present extension).
//!
//! A frame handed over just after the vertical blank is drawn ahead of the scan and comes whole; the blanks' own count
//! shows whether one was missed.

use crate::error::{Error, Result};
use std::fmt;
use std::time::{Duration, Instant};
use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::present::{ConnectionExt as _, EventMask};
use x11rb::rust_connection::RustConnection;

/// Wait between two looks for the server's message.
const LOOK: Duration = Duration::from_micros(200);

/// Vertical blanks of the monitor on which one window is.
pub(super) struct VerticalBlank {
    connection: RustConnection,
    window: u32,
    serial: u32,
}

impl VerticalBlank {
    /// Listens for the blanks of the monitor that shows `window`, on a connection of its own.
    pub(super) fn of_window(window: u32) -> Result<Self> {
        let (connection, _) = x11rb::connect(None).map_err(unavailable)?;
        connection.present_query_version(1, 0).map_err(unavailable)?.reply().map_err(unavailable)?;
        let id = connection.generate_id().map_err(unavailable)?;
        connection
            .present_select_input(id, window, EventMask::COMPLETE_NOTIFY)
            .map_err(unavailable)?
            .check()
            .map_err(unavailable)?;
        Ok(Self { connection, window, serial: 0 })
    }

    /// Waits for the next blank and returns the server's running count of them; none when it has not come within
    /// `limit` (monitor off or blanked).
    pub(super) fn next(&mut self, limit: Duration) -> Result<Option<u64>> {
        self.serial = self.serial.wrapping_add(1);
        // The next count that is a multiple of one.
        let asked = self.connection.present_notify_msc(self.window, self.serial, 0, 1, 0).map_err(unavailable)?;
        asked.ignore_error();
        self.connection.flush().map_err(unavailable)?;
        let start = Instant::now();
        loop {
            while let Some(event) = self.connection.poll_for_event().map_err(unavailable)? {
                if let Event::PresentCompleteNotify(told) = event
                    && told.serial == self.serial
                {
                    return Ok(Some(told.msc));
                }
            }
            if start.elapsed() >= limit {
                return Ok(None);
            }
            std::thread::sleep(LOOK);
        }
    }
}

fn unavailable(error: impl fmt::Display) -> Error {
    Error::Display { what: format!("the X server does not tell vertical blanks: {error}") }
}
