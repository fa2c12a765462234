//! Closed sets whose values have names, as the command line, profiles and metadata write them.
//!
//! ```
//! use holodrive::hologram::Method;
//! use holodrive::names::Named;
//!
//! assert_eq!(Method::named("planes")?, Method::Planes);
//! assert_eq!(Method::GpuPlanes.name(), "gpu-planes");
//! let refused = Method::named("plane").unwrap_err().to_string();
//! assert!(refused.contains("did you mean `planes`?"), "{refused}");
//! # Ok::<(), holodrive::Error>(())
//! ```

use crate::error::{Error, Result};
use std::mem::discriminant;

/// A value's name, the value with its usual settings, and what it is in a few words.
pub type Name<T> = (&'static str, fn() -> T, &'static str);

/// A closed set of named values.
pub trait Named: Sized + 'static {
    /// What a value is: `engine`.
    const KIND: &'static str;
    /// All of them, in the order in which they are listed.
    const NAMES: &'static [Name<Self>];

    /// The name of this value, whatever its settings are.
    fn name(&self) -> &'static str {
        let own = |(_, value, _): &&Name<Self>| discriminant(&value()) == discriminant(self);
        Self::NAMES.iter().find(own).map_or("", |(name, ..)| name)
    }

    /// The value of that name.
    ///
    /// # Errors
    /// [`Error::Parameter`] that names the nearest one and lists all.
    fn named(text: &str) -> Result<Self> {
        match Self::NAMES.iter().find(|(name, ..)| *name == text) {
            Some((_, value, _)) => Ok(value()),
            None => {
                let names: Vec<_> = Self::NAMES.iter().map(|(name, ..)| *name).collect();
                Err(Error::parameter(Self::KIND, unknown(text, &names)))
            }
        }
    }
}

/// What is said of a name that is none of `names`: the nearest one, and all of them.
fn unknown(text: &str, names: &[&str]) -> String {
    format!("there is no `{text}`; {}one of {}", meant(text, names), names.join(", "))
}

/// "did you mean `…`? " with the one of `names` that `text` most probably was meant to be; empty where none is near.
pub(crate) fn meant(text: &str, names: &[&str]) -> String {
    // What stands on a box is in capitals.
    let text = &text.to_lowercase();
    let likeness = |name: &str| {
        let parts = name.split('-').map(|part| 0.95 * strsim::jaro(text, part)).fold(0.0, f64::max);
        // Whole within a longer name, it is meant unless another is closer.
        let within = if text.len() > 3 && name.contains(text.as_str()) { 0.8 } else { 0.0 };
        strsim::jaro(text, name).max(parts).max(within)
    };
    let all = names.iter().map(|name| (likeness(name), *name));
    match all.max_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((likeness, name)) if likeness > 0.75 => format!("did you mean `{name}`? "),
        _ => String::new(),
    }
}
