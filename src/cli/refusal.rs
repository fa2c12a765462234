//! What is said of flags and input that are refused: one line, with the flag that is meant and where its help is.

use super::args;
use crate::Error;
use clap::Command;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use std::ffi::OsString;

/// The command that was typed, as far as its names go, and what it is called.
fn typed(arguments: &[OsString]) -> (Command, String) {
    let (mut command, mut path) = (args::command(arguments), "holodrive".to_owned());
    for word in arguments.iter().skip(1).filter(|word| !word.as_encoded_bytes().starts_with(b"-")) {
        let Some(next) = command.find_subcommand(word).cloned() else { break };
        path = format!("{path} {}", next.get_name());
        command = next;
    }
    (command, path)
}

/// clap's own words without its layout: the first paragraph, what was probably meant, and where the help is.
pub(super) fn of_flags(refused: &clap::Error, arguments: &[OsString]) -> String {
    let (command, path) = typed(arguments);
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

/// The system's words without its number: what it means stands before it.
fn without_number(said: &str) -> String {
    let Some((before, rest)) = said.split_once(" (os error ") else { return said.to_owned() };
    match rest.split_once(')') {
        Some((number, after)) if number.parse::<i32>().is_ok() && !before.is_empty() => format!("{before}{after}"),
        _ => said.to_owned(),
    }
}

/// Longest line that is said [characters]: the beginning and the end of a longer one.
const LONGEST: usize = 1200;

/// One line without control characters, whatever of a file or a flag is quoted in it, and of a bounded length.
pub(super) fn one_line(text: &str) -> String {
    let mut line = String::with_capacity(text.len().min(4 * LONGEST));
    let mut letters = text.chars().peekable();
    let mut count = 0;
    while let Some(letter) = letters.next() {
        match letter {
            '\n' | '\r' | '\t' | ' ' => {
                while letters.next_if(|next| next.is_whitespace()).is_some() {}
                line.push(' ');
            }
            // Other than spaces and letters: what steers a terminal, or turns the direction of writing.
            '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{2028}' | '\u{2029}' => line.push('\u{fffd}'),
            letter if letter.is_control() => line.push_str(&letter.escape_default().to_string()),
            letter => line.push(letter),
        }
        count += 1;
        if count == 4 * LONGEST {
            break;
        }
    }
    let length = line.chars().count();
    if length > LONGEST || letters.peek().is_some() {
        let head: String = line.chars().take(LONGEST * 3 / 4).collect();
        let tail: String = text.chars().rev().take(LONGEST / 8).collect::<Vec<_>>().into_iter().rev().collect();
        return format!("{head} … {}", tail.chars().map(|c| if c.is_control() { ' ' } else { c }).collect::<String>());
    }
    line.trim_end().to_owned()
}

/// An error of the library; a setting that the command has a flag for is called by the flag's name.
pub(super) fn of_work(error: &Error, arguments: &[OsString]) -> String {
    let said = without_number(&error.to_string());
    let (Error::Parameter { name, .. } | Error::OutOfRange { name, .. }) = error else {
        return format!("holodrive: {said}");
    };
    let long = name.replace(' ', "-");
    let (command, _) = typed(arguments);
    let known = command.get_arguments().any(|flag| flag.get_long() == Some(long.as_str()));
    match said.strip_prefix(name) {
        Some(rest) if known => format!("holodrive: --{long}{rest}"),
        _ => format!("holodrive: {said}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_quoted_stays_on_one_line_of_bounded_length() {
        let said = one_line("a.ply: header\x1b[31m line\r\n  3\u{7}: \u{202e}x");
        assert_eq!(said, "a.ply: header\\u{1b}[31m line 3\\u{7}: \u{fffd}x");
        let long = one_line(&format!("first {} last", "x\n".repeat(900_000)));
        assert!(long.chars().count() < 1300 && long.starts_with("first") && long.ends_with("last"), "{}", long.len());
        assert_eq!(one_line("9.4e-4 for µm × 2"), "9.4e-4 for µm × 2");
    }
}
