//! The binary `holodrive`: all of it is the library's command line, which the Python package starts, too.

fn main() -> std::process::ExitCode {
    let arguments: Vec<_> = std::env::args_os().collect();
    holodrive::cli::main(&arguments).into()
}
