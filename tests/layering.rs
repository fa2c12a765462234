//! The house stands: each room uses only rooms that stand above it in the list of `src/lib.rs`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Rooms in the order of the numbered list in the crate's documentation.
fn rooms() -> Vec<String> {
    let text = fs::read_to_string("src/lib.rs").expect("src/lib.rs");
    let rooms: Vec<String> = text
        .lines()
        .filter_map(|line| line.strip_prefix("//! ")?.split_once(". "))
        .filter(|(number, _)| number.parse::<u32>().is_ok())
        .filter_map(|(_, rest)| Some(rest.trim_start_matches('[').strip_prefix('`')?.split_once('`')?.0.to_string()))
        .collect();
    assert!(rooms.len() > 10, "the list of rooms in src/lib.rs was not found");
    rooms
}

fn sources(folder: &Path, out: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("folder") {
        let path = entry.expect("entry").path();
        if path == Path::new("src/python") {
            // A crate of its own, on top of the library.
        } else if path.is_dir() {
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
        if matches!(room, "lib" | "main" | "build" | "cli") {
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

#[test]
fn the_package_has_every_file_that_the_sources_include() {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let listed = Command::new(cargo).args(["package", "--list", "--offline", "--allow-dirty"]).output().expect("cargo");
    let told = String::from_utf8_lossy(&listed.stderr);
    assert!(listed.status.success() && !told.contains("warning"), "{told}");
    let listed = String::from_utf8(listed.stdout).expect("names").replace('\\', "/");
    let packed: Vec<&str> = listed.lines().collect();
    let mut files = Vec::new();
    sources(Path::new("src"), &mut files);
    let mut seen = 0;
    for file in files {
        let text = fs::read_to_string(&file).expect("source");
        for call in ["include_str!(\"", "include_bytes!(\""] {
            for (at, _) in text.match_indices(call) {
                let named = text[at + call.len()..].split('"').next().expect("a name");
                let mut path: Vec<&str> =
                    file.parent().expect("folder").iter().filter_map(|part| part.to_str()).collect();
                for part in named.split('/') {
                    match part {
                        ".." => drop(path.pop()),
                        part => path.push(part),
                    }
                }
                let path = path.join("/");
                assert!(packed.contains(&path.as_str()), "{}: {path} is not in the package", file.display());
                seen += 1;
            }
        }
    }
    // Panels and scenes.
    assert!(seen >= 20, "only {seen} files were seen: the test reads the sources wrongly");
    let size: u64 = packed.iter().filter_map(|path| fs::metadata(path).ok()).map(|file| file.len()).sum();
    assert!(size < 10_000_000, "the package has {size} bytes");
}

/// The code of a file without its tests.
fn without_tests(text: &str) -> String {
    let mut out = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line.trim() == "#[cfg(test)]" {
            // Test modules stand last or are files of their own.
            let next = lines.next().unwrap_or_default();
            if next.contains("mod ") && next.trim_end().ends_with('{') {
                break;
            }
            continue;
        }
        out += line.split("//").next().unwrap_or("");
        out.push('\n');
    }
    out
}

/// All paths that begin with `crate`, `super` or `self`, groups of imports taken apart.
fn paths(code: &str) -> Vec<Vec<String>> {
    fn names(at: &mut std::str::Chars<'_>, before: &[String], out: &mut Vec<Vec<String>>) {
        let mut path = before.to_vec();
        loop {
            let rest = at.as_str().trim_start();
            *at = rest.chars();
            if rest.starts_with('{') {
                at.next();
                while !at.as_str().trim_start().starts_with('}') && !at.as_str().is_empty() {
                    names(at, &path, out);
                    let rest = at.as_str().trim_start();
                    *at = rest.strip_prefix(',').unwrap_or(rest).chars();
                }
                at.next();
                return;
            }
            let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            if name.is_empty() {
                // A glob, or the end of what can be read.
                at.next();
                break;
            }
            *at = rest[name.len()..].chars();
            path.push(name);
            match at.as_str().strip_prefix("::") {
                Some(rest) => *at = rest.chars(),
                None => break,
            }
        }
        out.push(path);
    }
    let mut out = Vec::new();
    for root in ["crate::", "super::", "self::"] {
        for (start, _) in code.match_indices(root) {
            let before = code[..start].chars().next_back();
            if before.is_none_or(|c| !c.is_alphanumeric() && c != '_' && c != '$' && c != ':') {
                names(&mut code[start..].chars(), &[], &mut out);
            }
        }
    }
    out
}

/// Module path of a source file: `hologram/planes/paint.rs` → hologram, planes, paint.
fn module(inside: &Path) -> Vec<String> {
    let mut path: Vec<String> = inside.iter().map(|part| part.to_string_lossy().replace(".rs", "")).collect();
    if path.last().is_some_and(|last| last == "mod") {
        path.pop();
    }
    path
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let mut files = Vec::new();
    sources(Path::new("src"), &mut files);
    let inside = |file: &PathBuf| file.strip_prefix("src").expect("under src").to_path_buf();
    let modules: Vec<Vec<String>> = files.iter().map(|file| module(&inside(file))).collect();
    let mut uses: Vec<Vec<usize>> = vec![Vec::new(); files.len()];
    let mut seen = 0;
    for (file, own) in modules.iter().enumerate() {
        if own.iter().any(|part| part.contains("test")) {
            continue;
        }
        for path in paths(&without_tests(&fs::read_to_string(&files[file]).expect("source"))) {
            let mut target: Vec<String> = Vec::new();
            for (i, part) in path.iter().enumerate() {
                match part.as_str() {
                    "crate" if i == 0 => {}
                    "self" if i == 0 => target = own.clone(),
                    "super" if i == 0 => target = own[..own.len() - 1].to_vec(),
                    "super" => drop(target.pop()),
                    name => target.push(name.into()),
                }
            }
            // The file that the longest part of the path names.
            let found = (1..=target.len()).rev().find_map(|n| modules.iter().position(|m| *m == target[..n]));
            let Some(other) = found else { continue };
            seen += 1;
            // A room's face and what is in it are one thing.
            let (a, b) = (&modules[file], &modules[other]);
            if !a.starts_with(b) && !b.starts_with(a) {
                uses[file].push(other);
            }
        }
    }
    assert!(seen > 500, "only {seen} imports were seen: the test reads the sources wrongly");
    let reaches = |from: usize| {
        let (mut met, mut front) = (vec![false; files.len()], vec![from]);
        while let Some(at) = front.pop() {
            for &next in &uses[at] {
                if !std::mem::replace(&mut met[next], true) {
                    front.push(next);
                }
            }
        }
        met
    };
    let all: Vec<Vec<bool>> = (0..files.len()).map(reaches).collect();
    let circles: Vec<String> = (0..files.len())
        .flat_map(|a| uses[a].iter().map(move |&b| (a, b)))
        .filter(|&(a, b)| a != b && all[b][a])
        .map(|(a, b)| format!("{} -> {}", files[a].display(), files[b].display()))
        .collect();
    let mut circles = circles;
    circles.sort();
    circles.dedup();
    assert!(circles.is_empty(), "imports that run in a circle:\n{}", circles.join("\n"));
}

#[test]
fn every_entrance_walks_the_pipeline_and_light_is_simulated_in_one_place() {
    let code = |file: &str| without_tests(&fs::read_to_string(file).unwrap_or_else(|_| panic!("{file}")));
    let steps = ["scene", "points", "light_field", "exposures", "views", "field", "frame", "light", "pictures", "seen"];
    let walks = [
        // The steps that each entrance takes; what it does not take, it calls another one of these for.
        ("src/cli/load.rs", vec!["scene", "points"]),
        ("src/cli/eye.rs", vec!["light_field", "views", "seen"]),
        ("src/cli/holograms.rs", vec!["exposures", "field", "frame"]),
        ("src/cli/shown.rs", vec!["pictures"]),
        ("src/cli/reconstruct.rs", vec!["light"]),
        ("src/cli/sequence.rs", vec!["light"]),
        ("src/cli/animate.rs", vec!["light"]),
        ("src/sequence/animated.rs", vec!["exposures", "field", "frame"]),
        ("src/live/worker.rs", vec!["exposures", "field", "frame"]),
        ("src/live/viewer.rs", vec!["light"]),
        ("src/comparison/mod.rs", vec!["frame", "light"]),
        ("src/comparison/pictures.rs", vec!["scene", "points"]),
        (
            "src/comparison/views.rs",
            vec!["scene", "points", "light_field", "exposures", "views", "field", "frame", "seen"],
        ),
        ("src/python/src/scene.rs", vec!["scene", "points"]),
        ("src/python/src/light_field.rs", vec!["light_field"]),
        ("src/python/src/hologram.rs", vec!["field"]),
        ("src/python/src/encode.rs", vec!["exposures", "views", "frame"]),
        ("src/python/src/seen.rs", vec!["light", "seen"]),
    ];
    let pipeline = code("src/pipeline.rs");
    for step in steps {
        assert!(pipeline.contains(&format!("pub fn {step}(")), "pipeline has no step `{step}`");
        assert!(walks.iter().any(|(_, taken)| taken.contains(&step)), "nobody takes `{step}`");
    }
    for (file, taken) in walks {
        for step in taken {
            assert!(code(file).contains(&format!("pipeline::{step}(")), "{file} does not take pipeline::{step}");
        }
    }
    // Commands and rooms above the pipeline do none of its steps by themselves.
    let mut files = Vec::new();
    sources(Path::new("src"), &mut files);
    sources(Path::new("src/python/src"), &mut files);
    let own = ["simulate(", "simulated::simulate(", "hologram::compute(", "encode::encode(", "block_zero_order("];
    for file in files {
        let inside = file.strip_prefix("src").expect("under src").to_path_buf();
        let above = ["cli", "live", "sequence", "comparison", "python"].iter().any(|room| inside.starts_with(room));
        if above && !inside.iter().any(|part| part.to_string_lossy().contains("test")) {
            let text = without_tests(&fs::read_to_string(&file).expect("source"));
            for step in own {
                let called = text.match_indices(step).any(|(at, _)| {
                    // A function of that name of its own is another thing.
                    !text[..at].ends_with("fn ") && text[..at].ends_with("::")
                });
                assert!(!called, "{}: {step}…) is the pipeline's to call", file.display());
            }
        }
    }
}
