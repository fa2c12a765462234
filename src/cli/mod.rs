//! The command line: what was typed becomes settings, what was done becomes lines or JSON.

mod animate;
mod args;
mod bar;
mod bench;
mod calibrate;
mod calibrate_camera;
mod calibrate_plate;
mod camera_command;
#[cfg(feature = "display")]
mod controls;
mod encode;
mod eye;
mod field;
mod given_out;
mod holograms;
mod in_the_loop;
mod layers;
mod light;
#[cfg(feature = "display")]
mod live;
mod load;
mod manual;
mod monitors;
mod output;
#[cfg(feature = "display")]
mod panel_command;
mod panels;
mod pictures;
mod plate_source;
mod plate_views;
mod plates;
mod print;
mod reconstruct;
mod refusal;
mod report;
mod resolve;
#[cfg(feature = "display")]
mod screen;
mod segment_views;
mod sequence;
mod serve;
mod show;
mod shown;
mod standard;
mod steps;
#[cfg(feature = "display")]
mod tracker;
mod usage;

use crate::Error;
use args::{Cli, Command};
use clap::FromArgMatches;
use clap::error::ErrorKind;
use std::ffi::OsString;

/// Refuses what needs a display in a build that has none.
#[cfg(not(feature = "display"))]
fn without_display(asked: bool) -> crate::Result<()> {
    match asked {
        true => Err(Error::unsupported("this build has no display; build it with the feature `display` (the default)")),
        false => Ok(()),
    }
}

/// Parses the arguments, the program's own name first, runs, and maps the outcome to an exit code: 0 done, 2 bad flags or input,
/// 130 interrupted.
pub fn main(arguments: &[OsString]) -> u8 {
    let parsed = args::command(arguments).try_get_matches_from(arguments).and_then(|typed| {
        let mut cli = Cli::from_arg_matches(&typed)?;
        usage::tell(&mut cli.command, &typed);
        Ok(cli)
    });
    let mut cli = match parsed {
        Ok(cli) => cli,
        Err(refused) if matches!(refused.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            // Help into a closed pipe (`holodrive --help | head -1`) is no failure.
            let _ = refused.print();
            return 0;
        }
        Err(refused) => {
            eprintln!("{}", refusal::one_line(&refusal::of_flags(&refused, arguments)));
            return 2;
        }
    };
    let json = cli.json;
    let standard = standard::asked(&mut cli.command);
    // What is done of a plate stays.
    let kept = match &cli.command {
        Command::Print(args) => args.output.clone(),
        _ => None,
    };
    let outcome = match cli.command {
        Command::Points(args) => steps::points(&args),
        Command::Views(args) => eye::views(&args),
        Command::Compute(args) => steps::compute(&args),
        Command::Propagate(args) => steps::propagate(&args),
        Command::Encode(args) => encode::encode(&args),
        Command::Reconstruct(args) => reconstruct::reconstruct(&args),
        Command::Show(args) => show::show(&args),
        Command::Bench { what } => bench::bench(&what),
        Command::Calibrate { what } => calibrate::calibrate(&what),
        Command::Print(args) => print::print(&args, json),
        Command::Serve(args) => serve::serve(&args, json),
        Command::Panels(args) => panels::panels(&args),
        Command::Plates(args) => plates::plates(&args),
        Command::Manual(args) => manual::manual(&args),
        Command::Monitors(args) => monitors::monitors(&args),
        Command::Doctor(args) => monitors::doctor(&args),
    };
    match outcome.and_then(|report| standard::end(standard, report, json)) {
        Ok(()) => 0,
        Err(error) => {
            match (&error, kept) {
                (Error::Interrupted, Some(folder)) if !folder.exists() => {
                    eprintln!("holodrive: interrupted before the first tile; nothing was written");
                }
                (Error::Interrupted, Some(folder)) => {
                    let folder = folder.display();
                    eprintln!(
                        "holodrive: interrupted; the tiles that are done are kept in {folder}: the same command goes on from there"
                    );
                }
                _ => eprintln!("{}", refusal::one_line(&refusal::of_work(&error, arguments))),
            }
            if matches!(error, Error::Interrupted) { 130 } else { 2 }
        }
    }
}
