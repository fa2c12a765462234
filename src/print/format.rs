//! Formats that a finished plate is exported to.

use crate::names::{Name, Named};

/// A format to export to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Zarr version 3, a shard for each tile; one bit is packed.
    Zarr,
    /// PNG frames.
    Png,
    /// BMP frames.
    Bmp,
    /// GDSII: a rectangle for each run of open pixels.
    Gds,
    /// OASIS: the same, a fifth to a tenth of the bytes.
    Oasis,
    /// DXF: the same as closed polylines.
    Dxf,
}

impl Named for Format {
    const KIND: &'static str = "format";
    const NAMES: &'static [Name<Self>] = &[
        ("zarr", || Self::Zarr, "Zarr version 3: a shard a tile, one bit packed"),
        ("png", || Self::Png, "PNG frames"),
        ("bmp", || Self::Bmp, "BMP frames"),
        ("gds", || Self::Gds, "GDSII rectangles, a file for all or for each frame"),
        ("oasis", || Self::Oasis, "OASIS rectangles, the same in far fewer bytes"),
        ("dxf", || Self::Dxf, "DXF (release 12) closed polylines in micrometres"),
    ];
}

impl Format {
    /// Whether it holds shapes, not pixels.
    pub(super) fn is_mask(self) -> bool {
        matches!(self, Self::Gds | Self::Oasis | Self::Dxf)
    }
}
