//! A panel's second channel: the commands of its profile that make it ready before frames go to its monitor, and put it back.

use super::args::PanelArgs;
use super::camera_command::shell;
use crate::panel::{PanelProfile, Setup};
use crate::{Error, Result};
use std::path::{Path, PathBuf};
use std::process::Stdio;

/// A panel that is ready for frames; dropped, it is put back as its profile says.
#[must_use]
pub(super) struct Ready {
    after: Option<String>,
    /// Where the commands run: beside the profile.
    folder: PathBuf,
}

impl Ready {
    /// Makes the panel ready, where its profile says how and the flags allow it.
    ///
    /// # Errors
    /// [`Error::Calibration`] where the profile has commands and nobody has allowed them, or where the first one fails.
    pub(super) fn make(args: &PanelArgs, setup: &Setup) -> Result<Self> {
        let profile = &setup.profile;
        let commands = profile.command.clone().unwrap_or_default();
        let of = |line: Option<String>| line.map(|line| filled(&line, setup.wavelength));
        let (before, after) = (of(commands.before), of(commands.after));
        if let (Some(line), false) = (before.as_ref().or(after.as_ref()), args.allow_command) {
            let what = format!(
                "it wants to run `{line}` for the panel's second channel; if that is right, give --allow-command"
            );
            return Err(Error::calibration(&profile.source, what));
        }
        let ready = Self { after, folder: folder(profile) };
        match before.map(|line| ready.run(&line)) {
            Some(Err(error)) => {
                // Half of a panel's settings may have reached it.
                drop(ready);
                Err(Error::calibration(&profile.source, error))
            }
            _ => Ok(ready),
        }
    }

    /// Runs a line; what it prints goes to standard error, since standard output may be a machine's.
    fn run(&self, line: &str) -> std::result::Result<(), String> {
        let mut command = shell(line);
        command.current_dir(&self.folder).stdin(Stdio::null()).stdout(Stdio::from(std::io::stderr()));
        match command.status() {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => Err(format!("its command `{line}` ended with {status}")),
            Err(error) => Err(format!("its command `{line}` could not be run: {error}")),
        }
    }
}

impl Drop for Ready {
    fn drop(&mut self) {
        if let Some(line) = self.after.take()
            && let Err(what) = self.run(&line)
        {
            eprintln!("warning: the panel was not put back: {what}");
        }
    }
}

/// A line with the laser's wavelength in nm, in as few digits as say it to a femtometre.
fn filled(line: &str, wavelength: f64) -> String {
    let digits = format!("{:.6}", wavelength * 1e9);
    line.replace("{wavelength}", digits.trim_end_matches('0').trim_end_matches('.'))
}

fn folder(profile: &PanelProfile) -> PathBuf {
    let beside = profile.source.parent().filter(|folder| !folder.as_os_str().is_empty());
    beside.unwrap_or(Path::new(".")).to_path_buf()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setup(before: &str, after: &str, folder: &Path) -> Setup {
        let mut setup = Setup::new(PanelProfile::generic().expect("generic"), Some(632.8e-9)).expect("setup");
        let line = |text: &str| (!text.is_empty()).then(|| text.to_string());
        setup.profile.command = Some(crate::panel::PanelCommands { before: line(before), after: line(after) });
        setup.profile.source = folder.join("mine.toml");
        setup
    }

    fn allowed(allow_command: bool) -> PanelArgs {
        PanelArgs { panel: "generic".into(), wavelength: None, allow_command }
    }

    #[test]
    fn commands_run_beside_the_profile_once_before_and_once_after_and_only_where_they_are_allowed() {
        let folder = tempfile::tempdir().expect("folder");
        let said = || std::fs::read_to_string(folder.path().join("said.txt")).unwrap_or_default();
        let commands = setup("echo on {wavelength}>>said.txt", "echo off>>said.txt", folder.path());
        let refused = Ready::make(&allowed(false), &commands).err().expect("refused").to_string();
        assert!(refused.contains("mine.toml") && refused.contains("--allow-command") && said().is_empty(), "{refused}");
        let ready = Ready::make(&allowed(true), &commands).expect("ready");
        assert_eq!(said().split_whitespace().collect::<Vec<_>>(), ["on", "632.8"]);
        drop(ready);
        assert_eq!(said().split_whitespace().collect::<Vec<_>>(), ["on", "632.8", "off"]);
    }

    #[test]
    fn a_command_that_fails_is_an_error_that_names_it_and_the_panel_is_put_back() {
        let folder = tempfile::tempdir().expect("folder");
        let commands = setup("exit 3", "echo off>said.txt", folder.path());
        let error = Ready::make(&allowed(true), &commands).err().expect("an error").to_string();
        assert!(error.contains("`exit 3`") && error.contains('3'), "{error}");
        assert!(folder.path().join("said.txt").exists());
        // A panel without a second channel needs nothing allowed.
        let plain = Setup::new(PanelProfile::generic().expect("generic"), None).expect("setup");
        drop(Ready::make(&allowed(false), &plain).expect("ready"));
    }
}
