//! The command line: what was typed becomes settings, what was done becomes lines or JSON.

mod animate;
mod args;
mod bar;
mod bench;
mod calibrate;
mod colour;
mod commands;
#[cfg(feature = "display")]
mod controls;
mod encoding;
mod layers;
mod light;
#[cfg(feature = "display")]
mod live;
mod load;
mod monitors;
mod parallax;
mod print;
mod print_preview;
mod refusal;
mod report;
#[cfg(feature = "display")]
mod screen;
mod sequence;
mod serve;
mod show;
mod subframes;
mod true_views;

use args::{Cli, Command};
use clap::FromArgMatches;
use clap::error::ErrorKind;
use holodrive::Error;
use std::process::ExitCode;

/// Parses, runs and maps the outcome to an exit code: 0 done, 2 bad flags or input, 130 interrupted.
pub(crate) fn main() -> ExitCode {
    let cli = match args::command().try_get_matches().and_then(|typed| Cli::from_arg_matches(&typed)) {
        Ok(cli) => cli,
        Err(refused) if matches!(refused.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            // Help into a closed pipe (`holodrive --help | head -1`) is no failure.
            let _ = refused.print();
            return ExitCode::SUCCESS;
        }
        Err(refused) => {
            eprintln!("{}", refusal::of_flags(&refused));
            return ExitCode::from(2);
        }
    };
    let json = cli.json;
    let outcome = match cli.command {
        Command::Points(args) => commands::points(&args),
        Command::Compute(args) => commands::compute(&args),
        Command::Propagate(args) => commands::propagate(&args),
        Command::Encode(args) => encoding::encode(&args),
        Command::Reconstruct(args) => commands::reconstruct(&args),
        Command::Show(args) => show::show(&args),
        Command::Bench { what } => bench::bench(&what),
        Command::Calibrate { what } => calibrate::calibrate(&what),
        Command::Print(args) => print::print(&args, json),
        Command::Serve(args) => serve::serve(&args, json),
        Command::Monitors(args) => monitors::monitors(&args),
        Command::Doctor(args) => monitors::doctor(&args),
    };
    match outcome.and_then(|report| report.print(json)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}", refusal::of_work(&error));
            ExitCode::from(if matches!(error, Error::Interrupted) { 130 } else { 2 })
        }
    }
}
