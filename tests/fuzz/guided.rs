//! The same readers under libFuzzer, which follows what code an input reaches. `HOLODRIVE_PARSER` names the reader.
#![no_main]

use holodrive_fuzz::parsers::{Parser, all, plain};
use libfuzzer_sys::fuzz_target;

thread_local! {
    static PARSER: Option<Parser> = {
        let name = std::env::var("HOLODRIVE_PARSER").unwrap_or_else(|_| "gltf".into());
        all().ok().into_iter().flatten().find(|parser| parser.name == name)
    };
}

fuzz_target!(|input: &[u8]| {
    PARSER.with(|parser| {
        let Some(parser) = parser else { std::process::exit(2) };
        if let Err(why) = parser.run(input) {
            assert!(plain(&why), "{}", why.escape_debug());
        }
    });
});
