//! How large a plate is: in pixels or in lengths, and the printer's step that its pixels stand on.

use super::plate::{Binarisation, Raster};
use crate::error::{Error, Result};
use crate::segments::PointPhase;
use crate::units;
use serde::Deserialize;

/// How large a plate is to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlateSize {
    /// Columns and rows [px].
    Pixels([u64; 2]),
    /// Width and height [m]; each becomes the whole number of pixels that is nearest to it.
    Lengths([f64; 2]),
}

impl PlateSize {
    /// Reads `60mm x 40mm` (also `60mm,40mm`) or `120000x80000` pixels.
    ///
    /// # Errors
    /// [`Error::Parameter`] for anything else, and for sides that are not greater than zero.
    pub fn parse(text: &str) -> Result<Self> {
        let wrong = |what: String| Error::parameter("size", what);
        let (x, y) = text
            .split_once(['x', '×', ','])
            .ok_or_else(|| wrong(format!("`{text}` is not a size such as 60mm x 40mm")))?;
        let count = |text: &str| text.trim().parse::<u64>().ok();
        match [count(x), count(y)] {
            [Some(width), Some(height)] => Ok(Self::Pixels([width, height])),
            [None, None] => Ok(Self::Lengths([units::positive_length(x)?, units::positive_length(y)?])),
            _ => Err(wrong(format!("`{text}` has one side in pixels and one with a unit; give both alike"))),
        }
    }

    /// Columns and rows of pixels at a pitch [m]: the nearest whole numbers.
    pub(super) fn pixels(self, pitch: [f64; 2]) -> [u64; 2] {
        match self {
            Self::Pixels(size) => size,
            Self::Lengths(lengths) => [0, 1].map(|axis| (lengths[axis] / pitch[axis]).round() as u64),
        }
    }
}

/// What is asked of a plate beside its file: each takes the place of the file's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Asked {
    /// How large it is.
    pub size: Option<PlateSize>,
    /// Distance of neighbouring columns and rows [m].
    pub pitch: Option<f64>,
    /// How one bit is made.
    pub binarisation: Option<Binarisation>,
    /// Where the points of a scene stand, and in which phases.
    pub phase: Option<PointPhase>,
    /// Pixels of a segment's side.
    pub segment: Option<u64>,
}

/// The key `size`: pixels, two lengths, or both in one text.
#[derive(Clone, Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "size: give pixels, [120000, 80000], or lengths, \"60mm x 40mm\" or [\"60mm\", \"40mm\"]"
)]
pub(super) enum SizeKey {
    Pixels([u64; 2]),
    Lengths([String; 2]),
    Text(String),
}

impl SizeKey {
    pub(super) fn size(&self) -> Result<PlateSize> {
        match self {
            Self::Pixels(size) => Ok(PlateSize::Pixels(*size)),
            Self::Lengths([x, y]) => Ok(PlateSize::Lengths([units::positive_length(x)?, units::positive_length(y)?])),
            Self::Text(text) => PlateSize::parse(text),
        }
    }
}

/// A pitch is a whole multiple of a step when it is one to this share: decimals of a file are no truer.
const WHOLE: f64 = 1e-6;

/// Refuses a pitch that is no whole multiple of the printer's step [m], in words that name its neighbours.
pub(super) fn check_step(raster: &Raster, step: f64) -> Result<(), String> {
    for (name, pitch) in [("pitch_x", raster.pitch_x), ("pitch_y", raster.pitch_y)] {
        let steps = pitch / step;
        if steps.round() < 1.0 || (steps / steps.round() - 1.0).abs() > WHOLE {
            let below = steps.floor().max(1.0);
            let show = units::show_length;
            return Err(format!(
                "{name} = {} is no whole multiple of the printer's step of {}; take {} or {}",
                show(pitch),
                show(step),
                show(below * step),
                show((below + 1.0) * step)
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_in_lengths_and_pixels() {
        for text in ["60mm x 40mm", "6cm×4cm", "60mm,40mm", " 0.06m x 40 mm "] {
            let size = PlateSize::parse(text).expect(text);
            assert_eq!(size.pixels([0.5e-6; 2]), [120_000, 80_000], "{text}");
        }
        assert_eq!(PlateSize::parse("640x384").expect("pixels"), PlateSize::Pixels([640, 384]));
        // 10 mm are 1000 pixels of 2540 dpi, and 333.3 of 30 µm.
        let size = PlateSize::parse("10mm x 10mm").expect("size");
        assert_eq!(size.pixels([0.0254 / 2540.0, 30e-6]), [1000, 333]);
        for text in
            ["", "60mm", "60mm x", "60 x 40mm", "-1mm x 2mm", "0mm x 2mm", "NaNmm x 2mm", "infmm x 1mm", "1.5x2"]
        {
            assert!(PlateSize::parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_pitch_stands_on_the_printers_steps() {
        let raster = |pitch: f64| Raster { width: 1, height: 1, pitch_x: pitch, pitch_y: pitch };
        for pitch in [0.1e-6, 0.5e-6, 1.3e-6] {
            check_step(&raster(pitch), 0.1e-6).expect("whole");
        }
        let refused = check_step(&raster(1.3e-6), 0.5e-6).expect_err("no multiple");
        assert!(refused.contains("1um or 1.5um"), "{refused}");
        assert!(check_step(&raster(0.1e-6), 0.5e-6).is_err());
    }
}
