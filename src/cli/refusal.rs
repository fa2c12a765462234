//! What is said of flags and input that are refused: one line, with the flag that is meant and where its help is.

use super::args;
use clap::Command;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use holodrive::Error;

/// The command that was typed, as far as its names go, and what it is called.
fn typed() -> (Command, String) {
    let (mut command, mut path) = (args::command(), "holodrive".to_owned());
    for word in std::env::args().skip(1).filter(|word| !word.starts_with('-')) {
        let Some(next) = command.find_subcommand(&word).cloned() else { break };
        path = format!("{path} {}", next.get_name());
        command = next;
    }
    (command, path)
}

/// clap's own words without its layout: the first paragraph, what was probably meant, and where the help is.
pub(super) fn of_flags(refused: &clap::Error) -> String {
    let (command, path) = typed();
    let all = || command.get_subcommands().map(Command::get_name).collect::<Vec<_>>().join(", ");
    let words = match refused.kind() {
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand | ErrorKind::MissingSubcommand => {
            format!("a command is needed: {}", all())
        }
        _ => {
            let text = refused.to_string();
            let first: Vec<&str> = text.lines().take_while(|l| !l.trim().is_empty()).map(str::trim).collect();
            let first = first.join(" ");
            first.strip_prefix("error: ").unwrap_or(&first).to_owned()
        }
    };
    let kinds = [ContextKind::SuggestedArg, ContextKind::SuggestedValue, ContextKind::SuggestedSubcommand];
    let meant = kinds.iter().find_map(|kind| match refused.get(*kind)? {
        ContextValue::String(name) => Some(name.clone()),
        ContextValue::Strings(names) => names.first().cloned(),
        _ => None,
    });
    let meant = meant.map(|name| format!("; did you mean `{name}`?")).unwrap_or_default();
    format!("holodrive: {words}{meant} (see {path} --help)")
}

/// An error of the library; a setting that the command has a flag for is called by the flag's name.
pub(super) fn of_work(error: &Error) -> String {
    let said = error.to_string();
    let (Error::Parameter { name, .. } | Error::OutOfRange { name, .. }) = error else {
        return format!("holodrive: {said}");
    };
    let long = name.replace(' ', "-");
    let (command, _) = typed();
    let known = command.get_arguments().any(|flag| flag.get_long() == Some(long.as_str()));
    match said.strip_prefix(name) {
        Some(rest) if known => format!("holodrive: --{long}{rest}"),
        _ => format!("holodrive: {said}"),
    }
}
