//! Asks the linker for a smaller program, where it can make one.

use std::env::var_os;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// Functions whose machine code is the same are kept once. Rust promises no addresses of their own to functions.
const FOLDED: &str = "-Wl,--icf=all";
/// Addresses that the loader fills in are told in a bit each, not in 24 bytes: loaders of glibc from 2.36 on understand it.
const PACKED: &str = "-Wl,-z,pack-relative-relocs";

fn main() {
    println!("cargo::rerun-if-changed=src/build.rs");
    if var_os("PROFILE").is_none_or(|profile| profile != "release") {
        return;
    }
    if linked(FOLDED).is_some() {
        println!("cargo::rustc-link-arg-bins={FOLDED}");
    }
    // A program is built for its own machine's loader or a later one; what is built for another machine is not tried here.
    let runs = |program: PathBuf| Command::new(program).status().is_ok_and(|status| status.success());
    if var_os("HOST") == var_os("TARGET") && linked(PACKED).is_some_and(runs) {
        println!("cargo::rustc-link-arg-bins={PACKED}");
    }
}

/// An empty program that was linked with this argument: which linker there is, and what it can, is known only then.
fn linked(argument: &str) -> Option<PathBuf> {
    let folder = PathBuf::from(var_os("OUT_DIR")?);
    let (source, program) = (folder.join("empty.rs"), folder.join("empty"));
    std::fs::write(&source, "fn main() {}\n").ok()?;
    let mut compiler = Command::new(var_os("RUSTC")?);
    compiler.arg(&source).arg("-o").arg(&program).arg("--target").arg(var_os("TARGET")?);
    if let Some(linker) = var_os("RUSTC_LINKER") {
        compiler.arg("-C").arg(format!("linker={}", PathBuf::from(linker).display()));
    }
    let flags = var_os("CARGO_ENCODED_RUSTFLAGS").and_then(|flags| flags.into_string().ok()).unwrap_or_default();
    compiler.args(flags.split('\u{1f}').filter(|flag| !flag.is_empty()));
    let silent = compiler.arg("-C").arg(format!("link-arg={argument}")).stdout(Stdio::null()).stderr(Stdio::null());
    silent.status().is_ok_and(|status| status.success()).then_some(program)
}
