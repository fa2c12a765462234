//! The house stands: each room uses only rooms that stand above it in the list of `src/lib.rs`.

use std::fs;
use std::path::{Path, PathBuf};

/// Rooms in the order of the numbered list in the crate's documentation.
fn rooms() -> Vec<String> {
    let text = fs::read_to_string("src/lib.rs").expect("src/lib.rs");
    let rooms: Vec<String> = text
        .lines()
        .filter_map(|line| line.strip_prefix("//! ")?.split_once(". [`"))
        .filter(|(number, _)| number.parse::<u32>().is_ok())
        .filter_map(|(_, rest)| Some(rest.split_once('`')?.0.to_string()))
        .collect();
    assert!(rooms.len() > 10, "the list of rooms in src/lib.rs was not found");
    rooms
}

fn sources(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("folder") {
        let path = entry.expect("entry").path();
        if path.is_dir() {
            sources(&path, out);
        } else if path.extension().is_some_and(|e| e == "rs") {
            out.push(path);
        }
    }
}

/// Names after `crate::` in the code (comments and documentation left out).
fn used(text: &str) -> Vec<(usize, String)> {
    let mut out = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let code = line.split("//").next().unwrap_or("");
        for (at, _) in code.match_indices("crate::") {
            // `$crate::` and `some_crate::` are other things.
            let before = code[..at].chars().next_back();
            if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == '$') {
                continue;
            }
            let rest = &code[at + 7..];
            let names: Vec<&str> = match rest.strip_prefix('{') {
                Some(group) => group.split(',').map(str::trim).collect(),
                None => vec![rest],
            };
            for name in names {
                let name: String = name.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                if name.starts_with(|c: char| c.is_lowercase()) {
                    out.push((number + 1, name));
                }
            }
        }
    }
    out
}

#[test]
fn each_room_uses_only_rooms_above_it() {
    let rooms = rooms();
    let place = |name: &str| rooms.iter().position(|r| r == name);
    let mut files = Vec::new();
    sources(Path::new("src"), &mut files);
    let (mut faults, mut checked) = (Vec::new(), 0);
    for file in files {
        let inside = file.strip_prefix("src").expect("under src");
        let first = inside.components().next().expect("a name").as_os_str().to_string_lossy().to_string();
        let room = first.trim_end_matches(".rs");
        if matches!(room, "lib" | "main" | "cli") {
            continue;
        }
        let Some(own) = place(room) else {
            faults.push(format!("{}: the room `{room}` is not in the list of src/lib.rs", file.display()));
            continue;
        };
        let text = fs::read_to_string(&file).expect("source");
        for (line, name) in used(&text) {
            checked += 1;
            match place(&name) {
                Some(other) if other <= own => {}
                Some(_) => {
                    faults.push(format!("{}:{line}: `{room}` uses `{name}`, which stands below it", file.display()))
                }
                None => faults.push(format!("{}:{line}: `{name}` is not in the list of src/lib.rs", file.display())),
            }
        }
    }
    assert!(checked > 50, "only {checked} uses were seen: the test reads the sources wrongly");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn one_file_names_each_outside_crate_that_the_house_confines() {
    let mut files = Vec::new();
    sources(Path::new("src"), &mut files);
    for (name, home) in
        [("obvhs", "scene/bvh"), ("gltf", "scene/gltf"), ("rustfft", "field/fft"), ("npyz", "field/npy")]
    {
        for file in &files {
            let inside = file.strip_prefix("src").expect("under src").to_string_lossy().replace('\\', "/");
            if inside.starts_with(home) {
                continue;
            }
            let text = fs::read_to_string(file).expect("source");
            for (number, line) in text.lines().enumerate() {
                let code = line.split("//").next().unwrap_or("");
                assert!(
                    !code.contains(&format!("use {name}::"))
                        && !code.contains(&format!("{name}::Fft"))
                        && !code.contains(&format!(" {name}::Gltf")),
                    "{inside}:{}: only {home} names {name}",
                    number + 1
                );
            }
        }
    }
}
