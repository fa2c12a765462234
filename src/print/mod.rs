//! Printed holograms: fringes for a plate of any size, computed tile by tile into a file.
//!
//! A [`Plate`] (TOML) says what is printed. Its [`PlateFringes`] make a tile: the wave of the object on it
//! ([`crate::segments`]), interference with the reference wave, levels. A [`PlateJob`] says what the plate takes ([`Plan`])
//! and computes it; [`folder`] writes tiles into the plate's file, resumes, shares, checks. A [`PlateView`] is what an eye
//! sees of the finished file in the light of its lamps ([`preview`]). [`export`] writes it in other formats.
//!
//! The plate lies in the plane z = 0 of the hologram frame, centred, as the viewer sees it. Memory is that of a tile,
//! whatever the plate.

mod band;
pub mod export;
pub mod folder;
mod fringe;
mod gds;
mod geometry;
mod job;
mod manifest;
#[cfg(test)]
mod parallax_tests;
mod plan;
mod plate;
mod plate_check;
mod plate_file;
pub mod preview;
mod reader;
mod reference;
mod shard;
#[cfg(test)]
mod tests;
mod thinning;
mod tiff;
mod view;
mod zarr;

pub use fringe::PlateFringes;
pub use job::{PlateJob, PrintReport, PrintSettings};
pub use manifest::{Input, Manifest, Settings};
pub use plan::{Plan, plan};
pub use plate::{Binarisation, FileLayout, FringeSettings, Plate, Polarity, Quantity, Raster};
pub use reader::{Exported, Reader};
pub use reference::{Reference, Side};
pub use shard::Shard;
pub use view::{PlateView, ViewReport};
