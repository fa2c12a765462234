//! What a plate's numbers may be, wherever they come from: a plate's file, or a manifest that somebody else may have written.

use super::plate::{Binarisation, Plate, Quantity, Raster};
use crate::field::grid::LENGTHS;

/// Longest side of a plate [px]: 2.6 million would be 0.9 m at 0.35 µm.
const LONGEST: u64 = 1 << 22;

/// Tiles of a plate at most: their places take 16 bytes each in the file's head.
const MOST_TILES: u64 = 1 << 22;

impl Plate {
    /// The first number outside its domain, in words.
    pub(super) fn check(&self) -> Result<(), String> {
        let Raster { width, height, pitch_x, pitch_y } = self.raster;
        if !(1..=LONGEST).contains(&width) || !(1..=LONGEST).contains(&height) {
            return Err(format!("{width}×{height} pixels: each side must be 1 to {LONGEST}"));
        }
        let bits = self.fringe.bits;
        if !matches!(bits, 1 | 8) {
            return Err(format!("bits = {bits} must be 1 or 8"));
        }
        let file = &self.file;
        if !matches!(file.rotation, 0 | 90 | 180 | 270) {
            return Err(format!("rotation = {} must be 0, 90, 180 or 270", file.rotation));
        }
        let tile = file.tile;
        if !tile.is_multiple_of(64) || !(64..=8192).contains(&tile) {
            return Err(format!("tile = {tile} must be a multiple of 64 from 64 to 8192"));
        }
        if tile > width || tile > height {
            return Err(format!("the plate of {width}×{height} pixels is smaller than a tile of {tile}; lower tile"));
        }
        let tiles = width.div_ceil(tile) * height.div_ceil(tile);
        if tiles > MOST_TILES {
            return Err(format!("tile = {tile} makes {tiles} tiles, and at most {MOST_TILES} are made; raise tile"));
        }
        if !(16..=tile).contains(&self.segment) {
            return Err(format!("segment = {} must be 16 to the tile's {tile}", self.segment));
        }
        if let Some(slit) = &self.slit {
            let lights = !slit.wavelengths.is_empty() && slit.wavelengths.iter().all(|light| LENGTHS.contains(light));
            let lies = (8..=tile).contains(&slit.strip) && slit.y.is_finite() && LENGTHS.contains(&slit.height);
            if !(lies && lights) {
                return Err(format!(
                    "slit: its strip must be 8 to the tile's {tile}, and its lengths those of a bench"
                ));
            }
            if slit.superimposed {
                if slit.wavelengths.len() != 3 {
                    return Err("slit.superimposed is for three wavelengths; give slit.wavelengths".into());
                }
                // What else a fringe or a pulse can be is made of one object's phase.
                if self.fringe.quantity != Quantity::Bipolar
                    || bits == 1 && self.fringe.binarisation == Binarisation::PulseWidth
                {
                    return Err(
                        "slit.superimposed adds fringes: take quantity = \"bipolar\", and not pulse-width".into()
                    );
                }
            }
        }
        if let Some(Err((name, what))) = self.lamp.as_ref().map(|lamp| lamp.check(self.wavelength)) {
            return Err(format!("lamp: {name}: {what}"));
        }
        let searched = bits == 1 && self.fringe.binarisation == Binarisation::DirectSearch;
        match self.eye_box {
            Some(sides) if !sides.iter().all(|side| LENGTHS.contains(side)) => {
                return Err("scene.eye_box: its sides must be lengths of a bench".into());
            }
            Some(_) if !searched => {
                return Err("scene.eye_box is for binarisation = \"direct-search\"; leave it out".into());
            }
            None if searched => return Err("scene.eye_box is missing: a direct search needs it".into()),
            _ => {}
        }
        if searched && self.fringe.quantity != Quantity::Bipolar {
            return Err("direct-search makes the interference term alone; take quantity = \"bipolar\"".into());
        }
        if file.guard.saturating_mul(2) >= width.min(height) {
            return Err(format!("guard = {} on each side leaves no fringes of {width}×{height}", file.guard));
        }
        if file.marks > file.guard {
            return Err(format!("marks = {} do not fit into guard = {}; raise guard", file.marks, file.guard));
        }
        if self.fade > 0 && bits == 1 && self.fringe.binarisation != Binarisation::Diffusion {
            return Err("fade is for 8 bits, or for binarisation = \"diffusion\"; leave it out".into());
        }
        if self.fade.saturating_add(file.guard).saturating_mul(2) > width.min(height) {
            return Err(format!(
                "fade = {} on each side is more than half of the fringes of {width}×{height}",
                self.fade
            ));
        }
        let lengths = [
            ("pitch", pitch_x),
            ("pitch", pitch_y),
            ("wavelength", self.wavelength),
            ("scene.viewer", self.view.viewer),
        ];
        if let Some((name, length)) = lengths.into_iter().find(|(_, length)| !LENGTHS.contains(length)) {
            return Err(format!("{name} = {length:e} m must be {:e} … {:e} m", LENGTHS.start(), LENGTHS.end()));
        }
        let shares = [self.fringe.bias, self.fringe.contrast, self.fringe.percentile, self.fringe.reference_ratio];
        let numbers = shares.into_iter().chain([self.error, self.view.resolution, self.view.place]);
        if numbers.chain(self.view.scale).any(|number| !number.is_finite()) {
            return Err("one of its numbers is not finite".into());
        }
        if !(1..=16).contains(&self.view.rays) {
            return Err(format!("scene.rays = {} must be 1 to 16", self.view.rays));
        }
        if let Some(printer) = &self.printer {
            printer.check()?;
        }
        match &self.transfer {
            Some(transfer) => transfer.check(&self.fringe),
            None => Ok(()),
        }
    }
}
