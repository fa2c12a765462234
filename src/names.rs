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
    /// [`Error::Parameter`] that lists the names, the nearest one first.
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
pub fn unknown(text: &str, names: &[&str]) -> String {
    let near = nearest(text, names).map(|name| format!("did you mean `{name}`? ")).unwrap_or_default();
    format!("there is no `{text}`; {near}one of {}", names.join(", "))
}

/// The one of `names` that `text` most probably was meant to be.
fn nearest<'a>(text: &str, names: &[&'a str]) -> Option<&'a str> {
    let likeness = |name: &str| {
        let begins = !text.is_empty() && name.starts_with(text);
        strsim::jaro(text, name) + f64::from(u8::from(begins))
    };
    let all = names.iter().map(|name| (likeness(name), *name));
    let (best, name) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best > 0.7).then_some(name)
}
