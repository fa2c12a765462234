//! Printed holograms: fringes for a plate of any size, computed tile by tile into a file.
//!
//! A [`Plate`] (TOML) says what is printed. Its [`PlateFringes`] make a tile: the wave of the object on it
//! ([`crate::segments`]), interference with the reference wave, levels. A [`PlateJob`] says what the plate takes ([`Plan`])
//! and computes it; [`folder`] writes tiles into the plate's file, resumes, shares, checks. A [`PlateView`] is what an eye
//! sees of the finished file in the light of its lamps ([`preview`]); [`write_sheet`] makes a job sheet of it. [`export`] writes it in other formats. A card
//! ([`write_card`]) and its scan tell what a printer makes of levels and lines ([`calibrate`]), and a [`Transfer`] undoes it.
//!
//! The plate lies in the plane z = 0 of the hologram frame, centred, as the viewer sees it. Memory is that of a tile,
//! whatever the plate.

mod band;
pub mod calibrate;
mod card;
mod card_file;
mod command;
mod diagram;
mod dxf;
pub mod export;
mod flat_target;
pub mod folder;
mod format;
mod fringe;
mod fringe_settings;
mod gds;
mod geometry;
mod job;
mod labelled;
mod lamp;
mod manifest;
mod mask;
mod mask_bytes;
mod oasis;
#[cfg(test)]
mod parallax_tests;
mod plan;
mod plate;
mod plate_check;
mod plate_file;
mod plate_size;
mod plates;
pub mod preview;
mod printer;
mod reader;
mod reference;
mod registration;
#[cfg(test)]
mod search_tests;
mod shard;
mod sheet;
mod source;
#[cfg(test)]
mod tests;
mod thinning;
mod tiff;
mod transfer;
mod view;
mod view_files;
mod zarr;

pub use calibrate::PlateCalibration;
pub use card_file::{WrittenCard, write_card};
pub use fringe::PlateFringes;
pub use job::{PlateJob, PrintReport, PrintSettings};
pub use labelled::{write_pair, write_walk};
pub use lamp::Lamp;
pub use manifest::{Input, Manifest, Settings};
pub use plan::{Plan, plan};
pub use plate::{Binarisation, FileLayout, FringeSettings, Plate, Polarity, Quantity, Raster};
pub use plate_size::{Asked, PlateSize};
pub use printer::Printer;
pub use reader::{Exported, Reader};
pub use reference::{Reference, Side};
pub use shard::Shard;
pub use sheet::write_sheet;
pub use source::{PictureDepths, PictureFiles, Source};
pub use transfer::Transfer;
pub use view::{PlateView, ViewReport};
pub use view_files::{ViewFiles, ViewReading};
