//! The guide: what to do with the program, page by page. `README.md` is its beginning.
//!
//! The same pages can be read where they lie, `src/guide/*.md`; the tests run the commands in them.

/// A frame for an eye, for an eye box, from any renderer's views; what an eye gets of any field.
#[doc = include_str!("eye.md")]
pub mod eye {}

/// Scenes, points, pictures with depth, fields; colour; mirrors and glass.
#[doc = include_str!("scenes.md")]
pub mod scenes {}

/// Panels, calibration, monitors, other programs, frames in time.
#[doc = include_str!("lab.md")]
pub mod lab {}

/// The package for NumPy, and slmsuite.
#[doc = include_str!("python.md")]
pub mod python {}

/// The library: an SLM in a test, points of one's own, features.
#[doc = include_str!("rust.md")]
pub mod rust {}

/// Plates for printers of every kind.
#[doc = include_str!("plates.md")]
pub mod plates {}

/// How the field of points is computed, to which error, how fast.
#[doc = include_str!("engines.md")]
pub mod engines {}
