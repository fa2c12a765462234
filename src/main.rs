//! The binary `holodrive`.

fn main() {}
