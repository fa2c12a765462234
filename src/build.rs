//! Asks the linker for a smaller program, where it can make one.

use std::env::var_os;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// Functions whose machine code is the same are kept once. Rust promises no addresses of their own to functions.
const FOLDED: &str = "-Wl,--icf=all";

fn main() {
    println!("cargo::rerun-if-changed=src/build.rs");
    if var_os("PROFILE").is_some_and(|profile| profile == "release") && links_with(FOLDED).unwrap_or(false) {
        println!("cargo::rustc-link-arg-bins={FOLDED}");
    }
}

/// Whether an empty program is linked with this argument: which linker there is, and what it can, is known only then.
fn links_with(argument: &str) -> Option<bool> {
    let folder = PathBuf::from(var_os("OUT_DIR")?);
    let source = folder.join("empty.rs");
    std::fs::write(&source, "fn main() {}\n").ok()?;
    let mut compiler = Command::new(var_os("RUSTC")?);
    compiler.arg(&source).arg("-o").arg(folder.join("empty")).arg("--target").arg(var_os("TARGET")?);
    if let Some(linker) = var_os("RUSTC_LINKER") {
        compiler.arg("-C").arg(format!("linker={}", PathBuf::from(linker).display()));
    }
    let flags = var_os("CARGO_ENCODED_RUSTFLAGS").and_then(|flags| flags.into_string().ok()).unwrap_or_default();
    compiler.args(flags.split('\u{1f}').filter(|flag| !flag.is_empty()));
    let silent = compiler.arg("-C").arg(format!("link-arg={argument}")).stdout(Stdio::null()).stderr(Stdio::null());
    silent.status().ok().map(|status| status.success())
}
