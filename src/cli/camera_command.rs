//! A command of the user's that shows a frame and takes its photo.

use crate::calibration::PHOTO_ENDINGS;
use crate::{Error, Result};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The command, in which {frame} stands for a frame's file and {photo} for the photo's without its ending.
pub(super) struct CameraCommand<'a> {
    command: &'a str,
}

impl<'a> CameraCommand<'a> {
    pub(super) fn new(command: &'a str) -> Result<Self> {
        if command.contains("{photo}") {
            return Ok(Self { command });
        }
        let what = "name {photo}, the path that the photo is to have without its ending, and {frame} where the frame is needed";
        Err(Error::parameter("camera-command", what))
    }

    /// Runs it for a frame.
    pub(super) fn take(&self, frame: &Path, photo: &Path) -> Result<()> {
        let name = photo.file_name().unwrap_or_default().to_string_lossy();
        for old in PHOTO_ENDINGS {
            // A photo of an earlier run must not pass for this one's.
            let _ = std::fs::remove_file(photo.with_file_name(format!("{name}.{old}")));
        }
        let line = self.command.replace("{frame}", &quoted(frame)).replace("{photo}", &quoted(photo));
        let status = shell(&line).stdout(Stdio::null()).status();
        let status = status.map_err(Error::io("camera-command"))?;
        if !status.success() {
            return Err(Error::parameter("camera-command", format!("`{line}` ended with {status}")));
        }
        Ok(())
    }
}

/// A line of the user's, for the system's shell.
pub(super) fn shell(line: &str) -> Command {
    let (name, option) = if cfg!(windows) { ("cmd", "/C") } else { ("sh", "-c") };
    let mut command = Command::new(name);
    command.args([option, line]);
    command
}

/// A path as one word of a shell's line.
fn quoted(path: &Path) -> String {
    let path: PathBuf = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let text = path.display().to_string();
    if cfg!(windows) { format!("\"{text}\"") } else { format!("'{}'", text.replace('\'', "'\\''")) }
}
