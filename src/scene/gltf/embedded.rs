//! The scenes that come with the library: a bare name stands for one where nothing of that name lies in the folder.

use crate::names;
use std::path::{Component, Path};

/// A scene of `scenes/`, and the file beside it that it names.
struct Embedded {
    name: &'static str,
    gltf: &'static [u8],
    beside: Option<(&'static str, &'static [u8])>,
}

/// Every scene of `scenes/`. All are 104 kB; packed they would be 40 kB, which no program of this size is smaller by.
const SCENES: [Embedded; 5] = [
    Embedded { name: "cornell", gltf: include_bytes!("../../../scenes/cornell.gltf"), beside: None },
    Embedded { name: "depth-chart", gltf: include_bytes!("../../../scenes/depth-chart.gltf"), beside: None },
    Embedded { name: "glass-block", gltf: include_bytes!("../../../scenes/glass-block.gltf"), beside: None },
    Embedded {
        name: "mirror-ball",
        gltf: include_bytes!("../../../scenes/mirror-ball.gltf"),
        beside: Some(("mirror-ball.bin", include_bytes!("../../../scenes/mirror-ball.bin"))),
    },
    Embedded { name: "motion", gltf: include_bytes!("../../../scenes/motion.gltf"), beside: None },
];

/// Names of the embedded scenes.
///
/// ```
/// use holodrive::scene::gltf::{embedded, embedded_names};
///
/// assert!(embedded_names().any(|name| name == "cornell"));
/// // A path with a folder in it is a file, and so is what has an ending.
/// assert!(embedded("cornell".as_ref()).is_some() && embedded("./cornell".as_ref()).is_none());
/// ```
pub fn embedded_names() -> impl Iterator<Item = &'static str> {
    SCENES.iter().map(|scene| scene.name)
}

/// The glTF of the embedded scene that a path names; none for a path with a folder in it, and where something of that name
/// lies in the working folder, which is what is meant then.
pub fn embedded(path: &Path) -> Option<&'static [u8]> {
    find(path).map(|scene| scene.gltf)
}

/// What an embedded scene's URI stands for: its own file beside it, never one in the working folder.
pub(super) fn beside(path: &Path, uri: &str) -> Option<&'static [u8]> {
    let (_, bytes) = find(path)?.beside.filter(|(name, _)| *name == uri)?;
    Some(bytes)
}

/// What to say of a word that names neither a file nor an embedded scene; none for what may well be meant as a file.
pub fn not_embedded(path: &Path) -> Option<String> {
    let word = bare(path).filter(|_| path.extension().is_none() && embedded(path).is_none())?;
    let names: Vec<_> = embedded_names().collect();
    let meant = names::meant(word, &names);
    Some(format!("no such file; {meant}built-in scenes are {}", names.join(", ")))
}

fn find(path: &Path) -> Option<&'static Embedded> {
    let word = bare(path)?;
    SCENES.iter().find(|scene| scene.name == word)
}

/// A path that is one word and at which nothing lies, not even a link to nowhere.
fn bare(path: &Path) -> Option<&str> {
    // `components` passes over a closing `/`, which says that a folder is meant.
    let word = path.to_str().filter(|word| !word.ends_with(['/', '\\']))?;
    let mut parts = path.components();
    let single = matches!((parts.next(), parts.next()), (Some(Component::Normal(part)), None) if part == word);
    (single && path.symlink_metadata().is_err()).then_some(word)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::gltf::{File, LoadOptions, load};

    #[test]
    fn embedded_scenes_are_those_of_the_folder() {
        let there = std::fs::read_dir("scenes").expect("scenes");
        let mut there: Vec<String> = there
            .map(|entry| entry.expect("entry").file_name().to_string_lossy().to_string())
            .filter_map(|name| name.strip_suffix(".gltf").map(str::to_owned))
            .collect();
        there.sort();
        assert_eq!(embedded_names().collect::<Vec<_>>(), there);
        for name in embedded_names() {
            let options = LoadOptions::default();
            let file = load(Path::new(&format!("scenes/{name}.gltf")), &options).expect(name);
            let own = load(Path::new(name), &options).expect(name);
            assert_eq!(own.scene.triangles.len(), file.scene.triangles.len(), "{name}");
            assert_eq!(own.warnings, file.warnings, "{name}");
            // Nothing on the disk that a change could be seen of.
            assert!(File::open(Path::new(name)).expect(name).files().is_empty());
        }
    }

    #[test]
    fn only_a_single_word_where_nothing_lies_is_an_embedded_scene() {
        for path in ["./cornell", "a/cornell", "/cornell", "cornell/", "../cornell", "cornell.gltf", "scenes", "", "."]
        {
            assert!(embedded(Path::new(path)).is_none(), "{path}");
        }
        let said = not_embedded(Path::new("cornel")).expect("a word");
        assert!(said.starts_with("no such file; did you mean `cornell`? built-in scenes are cornell, "), "{said}");
        for path in ["cornell", "./cornel", "cornel.gltf", "scenes"] {
            assert!(not_embedded(Path::new(path)).is_none(), "{path}");
        }
    }
}
