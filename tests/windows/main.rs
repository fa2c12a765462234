//! The program for Windows: built here, run under wine, and held against the program for this system.
//!
//! It runs where `HOLODRIVE_WINDOWS=1` asks for it, since it builds everything once more, and says that it did not elsewhere, or
//! where Rust's target, the linker or wine are missing; asked for with `CI=true`, that is a failure. Windows on a monitor are
//! looked at on an X server of the test's own.

#[path = "../display/desk.rs"]
#[allow(dead_code)]
mod desk;
#[path = "../display/frames.rs"]
#[allow(dead_code)]
mod frames;
mod monitor;
#[path = "../display/server.rs"]
#[allow(dead_code)]
mod server;
mod steps;
mod wine;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::time::Instant;
use wine::Wine;

/// A name, and what is done.
pub(crate) type Case = (&'static str, fn(&Wine));

fn main() -> ExitCode {
    let cases: Vec<Case> = [steps::CASES, monitor::CASES].concat();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.iter().any(|argument| argument == "--list") {
        cases.iter().for_each(|(name, _)| println!("{name}: test"));
        return ExitCode::SUCCESS;
    }
    let filter = arguments.iter().find(|argument| !argument.starts_with('-'));
    let chosen: Vec<Case> =
        cases.into_iter().filter(|(name, _)| filter.is_none_or(|filter| name.contains(filter.as_str()))).collect();
    println!("\nrunning {} tests", chosen.len());
    let asked = std::env::var_os("HOLODRIVE_WINDOWS").is_some_and(|value| value == "1");
    let wine = match asked {
        true => Wine::start(),
        false => Err("HOLODRIVE_WINDOWS=1 asks for it".into()),
    };
    let wine = match wine {
        Ok(wine) => wine,
        Err(why) => {
            let required = asked && std::env::var_os("CI").is_some_and(|ci| ci == "true");
            println!("THE PROGRAM FOR WINDOWS WAS NOT TESTED: {why}\n");
            let (failed, ignored) = if required { (chosen.len(), 0) } else { (0, chosen.len()) };
            println!("test result: 0 passed; {failed} failed; {ignored} ignored\n");
            return if required { ExitCode::FAILURE } else { ExitCode::SUCCESS };
        }
    };
    let (start, mut failed) = (Instant::now(), 0);
    for (name, case) in &chosen {
        let begin = Instant::now();
        let passed = catch_unwind(AssertUnwindSafe(|| case(&wine))).is_ok();
        failed += usize::from(!passed);
        println!("test {name} ... {} ({:.1} s)", if passed { "ok" } else { "FAILED" }, begin.elapsed().as_secs_f64());
    }
    let verdict = if failed == 0 { "ok" } else { "FAILED" };
    let passed = chosen.len() - failed;
    println!(
        "\ntest result: {verdict}. {passed} passed; {failed} failed; 0 ignored; finished in {:.2}s\n",
        start.elapsed().as_secs_f64()
    );
    if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
