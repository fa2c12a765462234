//! Printed holograms: fringes for a plate of any size, computed tile by tile into a file.
//!
//! A [`Plate`] (TOML) says what is printed. A [`Source`] says what its segments see: a lit scene, seen truly from each of
//! them, or points. A [`Maker`] makes a tile: the field of what its segments see, interference with the reference wave,
//! levels. [`PanelViews`] makes a panel's field in the same way. [`job`] writes tiles into the plate's file, resumes, shares, checks. [`plan`] says before what it takes.
//! [`preview`] lets the reference shine on the finished file. [`export`] writes it in other formats.
//!
//! The plate lies in the plane z = 0 of the hologram frame, centred, as the viewer sees it. Memory is that of a tile,
//! whatever the plate.

pub mod export;
mod fan;
mod fringe;
mod gds;
mod geometry;
pub mod job;
mod manifest;
mod panel_views;
#[cfg(test)]
mod parallax_tests;
mod plan;
mod plate;
pub mod preview;
mod reference;
mod scene;
mod shard;
mod slit;
#[cfg(test)]
mod tests;
mod thinning;
mod tiff;
mod views;
mod zarr;

pub use fringe::{Maker, Work};
pub use geometry::{Piece, Rect, fringe_area, pieces, tile_counts};
pub use manifest::{Input, Manifest, Settings, inputs};
pub use panel_views::{PanelViews, SeenField};
pub use plan::{Plan, Sample, plan, sample};
pub use plate::{Binarisation, Plate, Polarity, Quantity};
pub use reference::{Band, Reference, Side};
pub use scene::Task;
pub use shard::Shard;
pub use slit::Slit;
pub use views::{Source, Views};
