//! A monitor with a panel's window is one program's at a time: of two windows over each other one is not on the panel, and whoever
//! drives it would not know.

use super::monitor::Monitor;
use crate::error::{Error, Result};
use std::fs::{File, OpenOptions, TryLockError};

/// Monitors that this process has taken; given back when it is dropped, or the process ends in whatever way.
pub(super) struct Taken {
    _locks: Vec<File>,
}

impl Taken {
    /// Takes a monitor, or all that make one panel.
    ///
    /// # Errors
    /// [`Error::Display`] where a window of another holodrive, or another window of this one, is on one of them.
    pub(super) fn new(monitor: &Monitor) -> Result<Self> {
        let mut locks = Vec::new();
        for name in monitor.name.split('+') {
            // Where no file can be made nothing is known of others, and that is no reason not to show.
            let Ok(file) = open(name) else { continue };
            match file.try_lock() {
                Ok(()) => locks.push(file),
                Err(TryLockError::WouldBlock) => {
                    let what = format!(
                        "monitor {name}: another holodrive shows its frames there (show, serve, calibrate); end it first"
                    );
                    return Err(Error::Display { what });
                }
                Err(TryLockError::Error(_)) => {}
            }
        }
        Ok(Self { _locks: locks })
    }
}

/// The file that stands for a monitor of this desktop.
fn open(monitor: &str) -> std::io::Result<File> {
    let desktop = ["WAYLAND_DISPLAY", "DISPLAY"].into_iter().find_map(|name| std::env::var(name).ok());
    let plain = |text: &str| text.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect::<String>();
    let name = format!("holodrive-monitor-{}-{}.lock", plain(&desktop.unwrap_or_default()), plain(monitor));
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        // In a folder that all may write into, a name of ours may be a link of someone else's.
        options.custom_flags(libc::O_NOFOLLOW).mode(0o600);
    }
    // Not in the session's own folder: two sessions of one desktop have two.
    options.open(std::env::temp_dir().join(name))
}
