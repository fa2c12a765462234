//! TOML files whose quantities have units: panel profiles and plates. Errors name the file and the key.

use crate::error::{Error, Result};
use crate::units;
use serde::{Deserialize, Deserializer, Serialize, de};
use std::f64::consts::FRAC_PI_2;
use std::fmt;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// A quantity with its unit, still as text: a bare number is refused with words that say why.
#[derive(Clone, Debug, Serialize)]
#[serde(transparent)]
pub(crate) struct Quantity(pub(crate) String);

impl AsRef<str> for Quantity {
    fn as_ref(&self) -> &str {
        &self.0
    }
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Text;
        impl de::Visitor<'_> for Text {
            type Value = Quantity;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a quantity with its unit, in quotes, such as \"8um\"")
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<Quantity, E> {
                Ok(Quantity(text.to_owned()))
            }
        }
        deserializer.deserialize_any(Text)
    }
}

/// What the reader of TOML says, in one line and in words of TOML rather than of Rust.
fn plain(message: &str) -> String {
    let mut said = message.replace('\n', " ");
    for whole in ["usize", "u64", "u32", "u16", "u8", "i64"] {
        said = said.replace(&format!("expected {whole}"), "expected a whole number");
    }
    said = said.replace("expected f64", "expected a number, without quotes");
    if said.contains("map, expected a sequence") {
        said += "; a table of which there may be several has two brackets, such as [[response]]";
    }
    said
}

/// A configuration file: what is wrong in it is told with its name and the key.
#[derive(Clone, Copy)]
pub(crate) struct ConfigFile<'a> {
    pub(crate) source: &'a Path,
}

impl ConfigFile<'_> {
    /// Its keys from TOML text.
    pub(crate) fn parse<T: de::DeserializeOwned>(&self, text: &str) -> Result<T> {
        toml::from_str(text).map_err(|e| {
            let line = e.span().map_or(1, |span| text[..span.start.min(text.len())].matches('\n').count() + 1);
            let said = plain(e.message());
            // What is missing from all of the file is on no line.
            let is_missing = line == 1 && said.starts_with("missing field");
            Error::calibration(self.source, if is_missing { said } else { format!("line {line}: {said}") })
        })
    }

    pub(crate) fn refuse<T>(&self, what: impl Into<String>) -> Result<T> {
        Err(Error::calibration(self.source, what))
    }

    /// The value of a key by a reader of [`units`].
    pub(crate) fn read<T>(&self, key: &str, text: impl AsRef<str>, parse: impl Fn(&str) -> Result<T>) -> Result<T> {
        parse(text.as_ref()).map_err(|e| {
            let what = match e {
                Error::Parameter { what, .. } => what,
                other => other.to_string(),
            };
            Error::calibration(self.source, format!("{key}: {what}"))
        })
    }

    /// A number within a range.
    pub(crate) fn within(&self, key: &str, value: f64, range: RangeInclusive<f64>) -> Result<f64> {
        if range.contains(&value) {
            return Ok(value);
        }
        self.refuse(format!("{key} = {value} must lie between {} and {}", range.start(), range.end()))
    }

    /// An angle below a right one [rad].
    pub(crate) fn angle(&self, key: &str, text: impl AsRef<str>) -> Result<f64> {
        let text = text.as_ref();
        let value = self.read(key, text, units::angle)?;
        if value.abs() < FRAC_PI_2 { Ok(value) } else { self.refuse(format!("{key}: `{text}` must be below 90deg")) }
    }

    /// Distances of neighbouring columns and rows [m], from `pitch` or from `pitch_x` and `pitch_y`.
    pub(crate) fn pitches<T: AsRef<str>>(&self, both: &Option<T>, each: [&Option<T>; 2]) -> Result<[f64; 2]> {
        let pitch = |key: &str, own: &Option<T>| match (own, both) {
            (Some(text), None) => self.read(key, text, units::pitch),
            (None, Some(text)) => self.read("pitch", text, units::pitch),
            (Some(_), Some(_)) => self.refuse(format!("{key} stands beside pitch; give pitch, or pitch_x and pitch_y")),
            (None, None) => self.refuse(format!("{key} is missing; give pitch = \"8um\", or pitch_x and pitch_y")),
        };
        Ok([pitch("pitch_x", each[0])?, pitch("pitch_y", each[1])?])
    }

    /// A file that is named in this one, and found beside it.
    pub(crate) fn beside(&self, file: &Path) -> PathBuf {
        self.source.parent().map_or_else(|| file.to_path_buf(), |folder| folder.join(file))
    }
}
