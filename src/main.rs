//! The binary `holodrive`: all of it is the library's command line, which the Python package starts, too.

fn main() -> std::process::ExitCode {
    keep_memory();
    outlive_limits();
    let arguments: Vec<_> = std::env::args_os().collect();
    holodrive::cli::main(&arguments).into()
}

/// Keeps large arrays' memory for the next ones: glibc gives each back to the system when it is freed, and the pages of the next
/// one cost more than what is done with them. Iterations on planes have a tenth of the page faults by this and take a quarter less
/// of the processors' time; the most memory that a command takes stays what it was, within a tenth.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn keep_memory() {
    const TRIMMED_ABOVE: libc::c_int = libc::c_int::MAX;
    const GROWS_BY: libc::c_int = 64 << 20;
    // SAFETY: sets numbers of the allocator, before there is a second thread. One that it refuses stays what it was.
    unsafe {
        libc::mallopt(libc::M_MMAP_MAX, 0);
        libc::mallopt(libc::M_TRIM_THRESHOLD, TRIMMED_ABOVE);
        libc::mallopt(libc::M_TOP_PAD, GROWS_BY);
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn keep_memory() {}

/// A file that grows beyond what this process may write is a failed write, with its line and its clearing up, not the end.
#[cfg(unix)]
fn outlive_limits() {
    // SAFETY: no handler is installed, the signal is ignored; before there is a second thread.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}

#[cfg(not(unix))]
fn outlive_limits() {}
