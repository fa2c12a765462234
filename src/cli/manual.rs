//! Man pages and completions of shells, made of the same grammar as the help.

use super::args::{self, ManualArgs};
use super::report::Report;
use crate::{Error, Result, files};
use clap::Command;
use clap_complete::Shell;
use clap_mangen::Man;
use clap_mangen::roff::{Roff, roman};
use std::path::PathBuf;

/// A file below the folder, and what is in it.
type Written = (PathBuf, Vec<u8>);

/// Where the files of each shell lie below /usr/share.
const SHELLS: [(Shell, &str); 4] = [
    (Shell::Bash, "bash-completion/completions/holodrive"),
    (Shell::Zsh, "zsh/site-functions/_holodrive"),
    (Shell::Fish, "fish/vendor_completions.d/holodrive.fish"),
    (Shell::PowerShell, "powershell/holodrive.ps1"),
];

/// Writes all pages and completions.
pub(super) fn manual(args: &ManualArgs) -> Result<Report> {
    let mut whole = args::command(&[]).disable_help_subcommand(true);
    whole.build();
    let mut all: Vec<Written> = Vec::new();
    pages(&whole, &mut all)?;
    let count = all.len();
    for (shell, path) in SHELLS {
        let mut script = Vec::new();
        clap_complete::generate(shell, &mut whole, "holodrive", &mut script);
        all.push((path.into(), script));
    }
    // A folder that cannot be written to is found out before the first file.
    let paths = all.iter().map(|(path, _)| args.folder.join(path)).collect::<Vec<_>>();
    for folder in paths.iter().filter_map(|path| path.parent()) {
        files::output_folder(folder)?;
    }
    for (path, (_, content)) in paths.iter().zip(&all) {
        files::write_bytes(path, content)?;
    }
    let mut report = Report::new("manual");
    let shells = SHELLS.map(|(shell, _)| shell.to_string()).join(", ");
    report.add("pages", count, format!("{:<12} {count} man pages, completions for {shells}", "manual"));
    report.value("files", paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>());
    report.output("written to", &args.folder);
    Ok(report)
}

/// Pages of a command and of those below it.
fn pages(command: &Command, all: &mut Vec<Written>) -> Result<()> {
    let man = Man::new(command.clone())
        .source(concat!("holodrive ", env!("CARGO_PKG_VERSION")))
        .manual("Holographic display driver");
    let name = man.get_filename();
    let page = page(command, &man).map_err(|why| Error::unsupported(format!("{name}: {why}")))?;
    all.push((PathBuf::from("man/man1").join(name), page));
    command.get_subcommands().filter(|below| !below.is_hide_set()).try_for_each(|below| pages(below, all))
}

fn page(command: &Command, man: &Man) -> std::io::Result<Vec<u8>> {
    let mut page = Vec::new();
    man.render_title(&mut page)?;
    man.render_name_section(&mut page)?;
    man.render_synopsis_section(&mut page)?;
    man.render_description_section(&mut page)?;
    if command.get_arguments().any(|flag| !flag.is_hide_set()) {
        man.render_options_section(&mut page)?;
    }
    if command.get_subcommands().any(|below| !below.is_hide_set()) {
        man.render_subcommands_section(&mut page)?;
    }
    if let Some(text) = command.get_after_long_help().or(command.get_after_help()) {
        after(&text.to_string()).to_writer(&mut page)?;
    }
    Ok(title_first(page))
}

/// Each section brings the definition of the apostrophe that it is written with; one is enough, and the title comes before it.
fn title_first(page: Vec<u8>) -> Vec<u8> {
    const APOSTROPHE: &str = ".ie \\n(.g .ds Aq \\(aq\n.el .ds Aq '\n";
    let page = String::from_utf8_lossy(&page).replace(APOSTROPHE, "");
    let (title, rest) = page.split_once('\n').unwrap_or((&page, ""));
    format!("{title}\n{APOSTROPHE}{rest}").into_bytes()
}

/// What stands beneath the help: what is set in by two spaces keeps its lines, examples are a section of their own.
fn after(text: &str) -> Roff {
    let mut roff = Roff::default();
    let (mut is_headed, mut is_literal) = (false, false);
    for line in text.lines() {
        let literal = line.starts_with("  ");
        if literal != is_literal {
            roff.control(if literal { "nf" } else { "fi" }, []);
            is_literal = literal;
        }
        match line {
            "Example:" | "Examples:" => {
                roff.control("SH", ["EXAMPLES"]);
                is_headed = true;
            }
            "" => drop(roff.control("PP", [])),
            _ => {
                if !is_headed {
                    roff.control("SH", ["NOTES"]);
                    is_headed = true;
                }
                roff.text([roman(line)]);
            }
        }
    }
    if is_literal {
        roff.control("fi", []);
    }
    roff
}
