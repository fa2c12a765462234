//! The plates whose profiles the program carries.

use super::plate::Plate;
use super::plate_size::Asked;
use crate::error::{Error, Result};
use crate::names;
use std::path::Path;

/// Every plate of `calib/`, by name.
const PLATES: &[(&str, &str)] = &[
    ("chrome-0.5um", include_str!("../../calib/plate-chrome-0.5um.toml")),
    ("chrome-1um", include_str!("../../calib/plate-chrome-1um.toml")),
    ("dmd-1um", include_str!("../../calib/plate-dmd-1um.toml")),
    ("film-2540dpi", include_str!("../../calib/plate-film-2540dpi.toml")),
    ("film-5080dpi", include_str!("../../calib/plate-film-5080dpi.toml")),
    ("fringe-0.44um", include_str!("../../calib/plate-fringe-0.44um.toml")),
    ("laser-0.8um", include_str!("../../calib/plate-laser-0.8um.toml")),
    ("rainbow", include_str!("../../calib/plate-rainbow.toml")),
    ("small", include_str!("../../calib/plate-small.toml")),
];

/// The text of a profile, and what stands for it in errors: a built-in one by name, or else the TOML file at that path.
///
/// # Errors
/// [`Error::Calibration`] when there is neither; [`Error::Io`] for a file that cannot be read.
pub(super) fn text_of(name: &str) -> Result<String> {
    if let Some((_, text)) = PLATES.iter().find(|(known, _)| *known == name) {
        return Ok((*text).to_owned());
    }
    let path = Path::new(name);
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) || path.exists() {
        return std::fs::read_to_string(path).map_err(Error::io(path));
    }
    let names: Vec<_> = Plate::embedded_names().collect();
    let meant = names::meant(name, &names);
    let what = format!("no such plate; {meant}give a .toml file or one of: {}", names.join(", "));
    Err(Error::calibration(name, what))
}

impl Plate {
    /// The TOML of an embedded profile, as it stands in `calib/`: what one's own begins with.
    pub fn embedded_text(name: &str) -> Option<&'static str> {
        PLATES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
    }

    /// A built-in plate by name, or else the TOML file at that path, with what is asked in place of its own.
    ///
    /// # Errors
    /// [`Error::Calibration`] when there is neither, or when it says something wrong; [`Error::Io`].
    pub fn find(name: &str, asked: &Asked) -> Result<Self> {
        Self::parse_as(&text_of(name)?, Path::new(name), asked)
    }

    /// Names of the built-in plates.
    pub fn embedded_names() -> impl Iterator<Item = &'static str> {
        PLATES.iter().map(|(name, _)| *name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_plates_are_those_of_the_folder() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/calib");
        let mut there: Vec<String> = std::fs::read_dir(folder)
            .expect("calib")
            .filter_map(|entry| {
                let name = entry.expect("entry").file_name().into_string().expect("name");
                Some(name.strip_prefix("plate-")?.strip_suffix(".toml")?.to_owned())
            })
            .collect();
        there.sort();
        assert_eq!(there, Plate::embedded_names().collect::<Vec<_>>());
        for name in Plate::embedded_names() {
            let plate = Plate::find(name, &Asked::default()).expect(name);
            assert_eq!(plate.name, name);
            plate.segments().expect(name);
        }
        let refused = Plate::find("film-5080", &Asked::default()).expect_err("none").to_string();
        assert!(refused.contains("did you mean `film-5080dpi`?"), "{refused}");
    }
}
