//! The display room on a real X server: what a frame's pixels are on the screen, on which monitor, and nowhere else.
//!
//! Needs Xorg with its dummy driver, run by root; for the graphics presenter, a Vulkan driver (a software one will do).
//! What this machine cannot run is told as ignored, or fails where `HOLODRIVE_REQUIRE_DISPLAY` is set.
//!
//! The tests share one server and change its monitors, so they run one after another; each starts this binary again as
//! the program under test. Hence no libtest harness; the output is in its form.

mod binary;
mod child;
mod desk;
#[cfg(unix)]
mod experiment;
mod frames;
mod live;
mod monitors;
mod ownership;
mod pixels;
#[cfg(unix)]
mod python;
mod sequences;
mod server;
#[cfg(unix)]
mod serving;
mod timing;
#[cfg(unix)]
mod wayland;
mod window_manager;

use desk::Desk;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::time::Instant;

/// How a test ended that did not panic.
pub(crate) enum Ended {
    Passed,
    /// This machine lacks something that a display test needs; what.
    NotRun(String),
    /// Something is not there that no one needs to have; what.
    Optional(String),
}

/// A test and its name.
pub(crate) type Case = (&'static str, fn(&Desk) -> Ended);

fn main() -> ExitCode {
    if let Some(code) = child::run_if_asked() {
        return code;
    }
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let cases: Vec<Case> = [
        monitors::CASES,
        pixels::CASES,
        ownership::CASES,
        timing::CASES,
        sequences::CASES,
        live::CASES,
        #[cfg(unix)]
        serving::CASES,
        #[cfg(unix)]
        python::CASES,
        #[cfg(unix)]
        experiment::CASES,
        window_manager::CASES,
        #[cfg(unix)]
        wayland::CASES,
        binary::CASES,
    ]
    .concat();
    if arguments.iter().any(|argument| argument == "--list") {
        cases.iter().for_each(|(name, _)| println!("{name}: test"));
        return ExitCode::SUCCESS;
    }
    let filter = arguments.iter().find(|argument| !argument.starts_with('-'));
    let chosen: Vec<Case> =
        cases.iter().copied().filter(|(name, _)| filter.is_none_or(|filter| name.contains(filter.as_str()))).collect();
    let (start, total) = (Instant::now(), chosen.len());
    println!("\nrunning {total} tests");
    let (mut passed, mut failed, mut ignored) = (0, 0, 0);
    let required = std::env::var_os("HOLODRIVE_REQUIRE_DISPLAY").is_some();
    let mut not_run = |name: &str, why: &str, required: bool| {
        if required {
            println!("test {name} ... FAILED\n  could not run: {why}");
            failed += 1;
        } else {
            println!("test {name} ... ignored, {why}");
            ignored += 1;
        }
    };
    match if chosen.is_empty() { Err("nothing to do".into()) } else { server::Server::start() } {
        Ok(server) => {
            let desk = Desk::new(server.display());
            let mut failures = 0;
            for (name, case) in &chosen {
                match catch_unwind(AssertUnwindSafe(|| case(&desk))) {
                    Ok(Ended::Passed) => {
                        println!("test {name} ... ok");
                        passed += 1;
                    }
                    Ok(Ended::NotRun(why)) => not_run(name, &why, required),
                    Ok(Ended::Optional(why)) => not_run(name, &why, false),
                    Err(_) => {
                        println!("test {name} ... FAILED");
                        failures += 1;
                    }
                }
            }
            failed += failures;
        }
        Err(why) => chosen.iter().for_each(|(name, _)| not_run(name, &why, required)),
    }
    println!(
        "\ntest result: {}. {passed} passed; {failed} failed; {ignored} ignored; 0 measured; {} filtered out; finished in {:.2}s\n",
        if failed == 0 { "ok" } else { "FAILED" },
        cases.len() - total,
        start.elapsed().as_secs_f64()
    );
    if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
