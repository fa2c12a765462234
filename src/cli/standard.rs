//! `-o -`: what a command writes goes to standard output, its report to standard error.

use super::args::Command;
use super::report::Report;
use crate::{Error, Result};
use std::io::Write;
use std::path::{Path, PathBuf};

/// A file of ours, whose bytes go to standard output in the end.
pub(super) struct Standard {
    folder: PathBuf,
    file: PathBuf,
}

impl Drop for Standard {
    fn drop(&mut self) {
        // A folder that stays behind among the temporary ones does no harm.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// Puts a file in the place of `-`, where a command that writes one file has it as output.
pub(super) fn asked(command: &mut Command) -> Option<Standard> {
    let (output, name) = match command {
        Command::Points(args) => (&mut args.output, "points.ply"),
        Command::Compute(args) => (&mut args.output, "field.npy"),
        Command::Propagate(args) => (&mut args.output, "field.npy"),
        Command::Encode(args) => (&mut args.output, "frame.png"),
        Command::Reconstruct(args) => (&mut args.output, "picture.png"),
        Command::Views(args) => (&mut args.output, "views.npz"),
        _ => return None,
    };
    if output.as_path() != Path::new("-") {
        return None;
    }
    let folder = std::env::temp_dir().join(format!("holodrive-{}", std::process::id()));
    // One of that name is not ours: then the command says that it cannot write there.
    let _ = std::fs::create_dir(&folder);
    *output = folder.join(name);
    Some(Standard { file: output.clone(), folder })
}

/// Prints the report, or the file and the report beside it.
pub(super) fn end(standard: Option<Standard>, report: Report, json: bool) -> Result<()> {
    let Some(standard) = standard else { return report.print(json) };
    let bytes = std::fs::read(&standard.file).map_err(|_| {
        let what = "- is standard output, which takes one file; this command made several";
        Error::parameter("output", what)
    })?;
    report.print_aside(json);
    match std::io::stdout().write_all(&bytes) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|source| Error::Io { path: "standard output".into(), source }),
    }
}
