//! The binary `holodrive`: flags as typed → resolved settings → one library call; bars and prose only here.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
