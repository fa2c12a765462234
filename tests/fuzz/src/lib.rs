//! Every reader of the program under inputs that were made from good ones and then damaged.
//!
//! [`parsers::all`] is the list of readers with the inputs that they start from, [`mutation`] damages an input, [`watch`]
//! measures what a reader takes of memory and time for it. `cargo test -p holodrive-fuzz` runs them all for a minute;
//! `cargo test --release -p holodrive-fuzz -- --inputs 1000000 npy` runs one for longer, and
//! `HOLODRIVE_PARSER=npy cargo fuzz run --fuzz-dir tests/fuzz --sanitizer none --features guided guided` follows coverage.
//!
//! What must hold for any input: no panic, no more memory than [`watch::MOST_MEMORY`], an end within
//! [`watch::MOST_SECONDS`], and what is said of it is no name of a source file.

pub mod archive;
pub mod conversation;
pub mod mutation;
pub mod parsers;
pub mod seeds;
pub mod watch;
