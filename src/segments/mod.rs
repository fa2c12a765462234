//! Per-segment views: a hologram plane divided into segments (hogels), each computed from the object as seen from there.
//!
//! [`Segments`] says how the plane is divided and what light leaves it. An [`Object`] is what it shows: a lit scene, of
//! which every segment casts its own rays ([`PlacedScene`]), views of one that others made ([`PlacedViews`]), or points, the same from
//! everywhere. The [`ObjectWave`] is
//! what reaches the plane from it: for a panel as a whole, for a plate rectangle by rectangle.
//!
//! From the few degrees that a panel sends light into, a viewer sees mirrors, gloss and edges move a little as the head
//! does; a large plate seen from near sees round corners. A plane with a [`Slit`] has parallax from left to right only.
//!
//! ```
//! use holodrive::field::Grid;
//! use holodrive::points::PointSource;
//! use holodrive::progress::Progress;
//! use holodrive::segments::{Object, ObjectWave, Segments};
//!
//! let grid = Grid::new(128, 96, 8e-6, 8e-6)?;
//! let segments = Segments::of_panel(grid, 633e-9, 32)?;
//! let point = PointSource { position: glam::DVec3::new(0.0, 0.0, -0.06), amplitude: 0.03, phase: 0.0 };
//! let wave = ObjectWave::new(segments, Object::Points(vec![point])).whole(&Progress::new())?;
//! // A spherical wave, a/r; twelve segments see it.
//! assert!((wave.field.samples[48 * 128 + 64].norm() - 0.5).abs() < 5e-3);
//! assert_eq!(wave.work.segments, 12);
//! # Ok::<(), holodrive::Error>(())
//! ```

mod fan;
mod object;
mod plane;
mod scene;
mod slit;
#[cfg(test)]
mod tests;
mod views;
mod wave;

pub(crate) use object::is_cloud;
pub use object::{Object, SceneOptions};
pub use plane::{ObjectBand, Piece, PointPhase, Rect, Segments, Slit, Viewing};
pub use scene::PlacedScene;
pub use views::PlacedViews;
pub(crate) use views::lattice;
pub use wave::{ObjectWave, SegmentedField, Work};
