//! Damages inputs and gives them to every reader, for a minute in all; a test without the usual harness.
//!
//! Arguments: parts of readers' names; `--inputs N` of each, `--seconds S` for each, `--seed N`. `HOLODRIVE_CORPUS` names a
//! folder of more files to start from, each for the readers whose own inputs have its ending.

use holodrive_fuzz::archive::{pack, unpack};
use holodrive_fuzz::mutation::{Draw, damaged_parts, mend_glb, mend_png};
use holodrive_fuzz::parsers::{Parser, all, plain};
use holodrive_fuzz::watch::{Counting, MOST_MEMORY, Watchdog, keep, memory_of};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Time for all readers where none is asked for [s].
const IN_ALL: f64 = 60.0;

/// Largest file of a corpus that is taken [bytes].
const LARGEST: u64 = 1 << 17;

struct Asked {
    names: Vec<String>,
    inputs: Option<u64>,
    seconds: Option<f64>,
    seed: u64,
}

fn asked() -> Result<Asked, String> {
    let mut asked = Asked { names: Vec::new(), inputs: None, seconds: None, seed: 1 };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut number = || {
            let next = words.next().ok_or(format!("{word} needs a number"))?;
            next.parse::<f64>().map_err(|why| format!("{word} {next}: {why}"))
        };
        match word.as_str() {
            "--inputs" => asked.inputs = Some(number()? as u64),
            "--seconds" => asked.seconds = Some(number()?),
            "--seed" => asked.seed = number()? as u64,
            // What `cargo test` hands to every test.
            _ if word.starts_with("--") => {}
            _ => asked.names.push(word),
        }
    }
    Ok(asked)
}

/// What a reader did with its inputs.
#[derive(Default)]
struct Tally {
    inputs: u64,
    read: u64,
    panics: u64,
    unbounded: u64,
    unreadable: u64,
    most_memory: usize,
    longest: Duration,
}

impl Tally {
    fn is_clean(&self) -> bool {
        self.panics + self.unbounded + self.unreadable == 0
    }
}

/// Damages one input of a reader.
fn made(parser: &Parser, draw: &mut Draw) -> Vec<u8> {
    let (seed, other) = (draw.of(&parser.seeds).clone(), draw.of(&parser.seeds).clone());
    let damaged = damaged_parts(&unpack(&seed), &other, draw);
    if draw.below(4) == 0 {
        return damaged;
    }
    let parts: Vec<(String, Vec<u8>)> = unpack(&damaged)
        .into_iter()
        .map(|(name, bytes)| {
            let mut bytes = bytes.to_vec();
            match name.rsplit('.').next() {
                Some("png") => mend_png(&mut bytes),
                Some("glb") => mend_glb(&mut bytes),
                _ => {}
            }
            (name, bytes)
        })
        .collect();
    pack(&parts.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect::<Vec<_>>())
}

fn run(parser: &Parser, asked: &Asked, seconds: f64, dog: &Watchdog) -> Tally {
    let mut tally = Tally::default();
    let mut draw = Draw(asked.seed.wrapping_mul(0x9e37_79b9).wrapping_add(parser.name.len() as u64));
    let start = Instant::now();
    let most = asked.inputs.unwrap_or(u64::MAX);
    while tally.inputs < most && (asked.inputs.is_some() || start.elapsed().as_secs_f64() < seconds) {
        let input = made(parser, &mut draw);
        let begun = Instant::now();
        let work = || memory_of(|| catch_unwind(AssertUnwindSafe(|| parser.run(&input))));
        let (outcome, memory) = dog.watch(parser.name, &input, work);
        tally.longest = tally.longest.max(begun.elapsed());
        tally.most_memory = tally.most_memory.max(memory);
        tally.inputs += 1;
        let fault = match &outcome {
            Ok(Ok(())) => {
                tally.read += 1;
                None
            }
            Ok(Err(why)) if plain(why) => None,
            Ok(Err(why)) => {
                tally.unreadable += 1;
                Some(("message", why.escape_debug().take(300).collect()))
            }
            Err(_) => {
                tally.panics += 1;
                Some(("panic", String::new()))
            }
        };
        let fault = fault.or_else(|| {
            (memory > MOST_MEMORY).then(|| {
                tally.unbounded += 1;
                ("memory", format!("{} MB", memory >> 20))
            })
        });
        // The first few are enough to mend it.
        if let Some((kind, what)) = fault
            && tally.panics + tally.unbounded + tally.unreadable <= 5
        {
            println!("{}: {kind} {what}; the input is {}", parser.name, keep(parser.name, kind, &input).display());
        }
    }
    tally
}

/// Files of a folder, for the readers that take their ending.
fn take_corpus(folder: &Path, parsers: &mut [Parser]) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            take_corpus(&path, parsers);
            continue;
        }
        let name = format!("a.{}", path.extension().unwrap_or_default().to_string_lossy());
        let small = entry.metadata().is_ok_and(|about| about.len() < LARGEST && about.is_file());
        let Some(bytes) = small.then(|| std::fs::read(&path).ok()).flatten() else { continue };
        for parser in parsers.iter_mut() {
            let first = |seed: &Vec<u8>| unpack(seed).first().is_some_and(|(own, _)| *own == name);
            if parser.seeds.iter().any(first) {
                parser.seeds.push(pack(&[(&name, &bytes)]));
            }
        }
    }
}

fn main() -> ExitCode {
    let asked = match asked() {
        Ok(asked) => asked,
        Err(why) => {
            eprintln!("{why}");
            return ExitCode::from(2);
        }
    };
    let mut parsers = match all() {
        Ok(parsers) => parsers,
        Err(why) => {
            eprintln!("{why}");
            return ExitCode::FAILURE;
        }
    };
    if let Some(folder) = std::env::var_os("HOLODRIVE_CORPUS") {
        take_corpus(Path::new(&folder), &mut parsers);
    }
    let chosen =
        |parser: &&Parser| asked.names.is_empty() || asked.names.iter().any(|name| parser.name.contains(name.as_str()));
    let parsers: Vec<&Parser> = parsers.iter().filter(chosen).collect();
    let seconds = asked.seconds.unwrap_or(IN_ALL / parsers.len().max(1) as f64);
    let dog = Watchdog::start();
    // A panic is counted; where it was, is told once for each place.
    let told = std::sync::Mutex::new(std::collections::BTreeSet::new());
    std::panic::set_hook(Box::new(move |info| {
        let place = info.location().map(ToString::to_string).unwrap_or_default();
        if told.lock().is_ok_and(|mut told| told.insert(place.clone())) {
            println!("panic at {place}: {}", info.to_string().lines().last().unwrap_or_default());
        }
    }));
    println!(
        "{:>13} {:>9} {:>7} {:>6} {:>6} {:>7} {:>8} {:>9} {:>7}",
        "reader", "inputs", "read", "panics", "memory", "message", "most MB", "longest s", "s"
    );
    let mut clean = true;
    for parser in parsers {
        let start = Instant::now();
        let tally = run(parser, &asked, seconds, dog);
        clean &= tally.is_clean();
        println!(
            "{:>13} {:>9} {:>6.1}% {:>6} {:>6} {:>7} {:>8.1} {:>9.3} {:>7.1}",
            parser.name,
            tally.inputs,
            100.0 * tally.read as f64 / tally.inputs.max(1) as f64,
            tally.panics,
            tally.unbounded,
            tally.unreadable,
            tally.most_memory as f64 / 1048576.0,
            tally.longest.as_secs_f64(),
            start.elapsed().as_secs_f64()
        );
    }
    if clean { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
