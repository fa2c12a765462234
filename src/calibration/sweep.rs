//! A sweep of two-level gratings: the frames to show, and the powers that a detector saw of them.

use super::series::{Entry, FrameSeries};
use crate::error::{Error, Result};
use crate::names::{Name, Named};
use crate::panel::vendor::text;
use crate::panel::{Frame, PanelProfile};
use crate::units::{self, show_length};
use serde::Serialize;
use std::path::Path;

/// Which order the detector saw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// The undiffracted light: brightest where the levels agree.
    Zero,
    /// A first order: dark where the levels agree.
    #[default]
    First,
}

impl Named for Order {
    const KIND: &'static str = "order";
    const NAMES: &'static [Name<Self>] = &[
        ("first", || Self::First, "the detector saw a first order of the gratings"),
        ("zero", || Self::Zero, "the detector saw the undiffracted light"),
    ];
}

/// Wavelengths [m] closer than this are one laser's.
const SAME_LIGHT: f64 = 0.05e-9;

/// A part of a panel whose phase is measured by itself: `place` of `parts`, counted in columns and rows from the upper left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Column and row of the region.
    pub place: (usize, usize),
    /// Number of regions side by side and one above the other.
    pub parts: (usize, usize),
}

/// A grating of two levels: stripes over the whole panel or one region of it; the rest then stands at `fixed` and sends
/// nothing into the grating's orders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grating {
    /// Level of the first stripes.
    pub fixed: u16,
    /// Level of the second stripes.
    pub level: u16,
    /// Width of a stripe [columns]: several, against crosstalk.
    pub stripe: usize,
    /// The region that is measured; absent: the whole panel.
    pub region: Option<Region>,
}

/// The frame of a grating.
///
/// # Errors
/// [`Error::Parameter`] for levels that the panel does not have, stripes without width, a region outside the panel.
pub fn grating_frame(profile: &PanelProfile, wavelength: f64, grating: &Grating) -> Result<Frame> {
    let Grating { fixed, level, stripe, region } = *grating;
    if stripe == 0 {
        return Err(Error::parameter("stripe", "0 columns; take at least one, a few against crosstalk"));
    }
    let (width, height) = (profile.width, profile.height);
    let Region { place, parts } = region.unwrap_or(Region { place: (0, 0), parts: (1, 1) });
    if place.0 >= parts.0 || place.1 >= parts.1 || parts.0 > width || parts.1 > height {
        return Err(Error::parameter("regions", format!("region {place:?} of {parts:?} on {width}×{height} pixels")));
    }
    let inside = |at: usize, size: usize, place: usize, parts: usize| at * parts / size == place;
    let row = |bright: bool| -> Vec<u16> {
        let grating = |x: usize| bright && inside(x, width, place.0, parts.0) && !(x / stripe).is_multiple_of(2);
        (0..width).map(|x| if grating(x) { level } else { fixed }).collect()
    };
    let rows = [row(false), row(true)];
    let levels = (0..height).flat_map(|y| &rows[usize::from(inside(y, height, place.1, parts.1))]).copied().collect();
    let mut frame = Frame::new(profile, wavelength, levels)?;
    frame.metadata.origin.notes = vec![format!("calibration grating: levels {fixed} and {level}, stripes of {stripe}")];
    Ok(frame)
}

/// A sweep of gratings: one frame for each level, region by region.
#[derive(Clone, Debug)]
pub struct Sweep {
    /// Number of levels, evenly from the lowest to the highest; absent: 64, or all of fewer.
    pub levels: Option<usize>,
    /// Width of the gratings' stripes [columns].
    pub stripe: usize,
    /// Number of regions side by side and one above the other; absent: the whole panel at once.
    pub regions: Option<(usize, usize)>,
    /// Order that will be measured.
    pub order: Order,
}

impl Default for Sweep {
    fn default() -> Self {
        Self { levels: None, stripe: 8, regions: None, order: Order::First }
    }
}

impl Sweep {
    /// The frames to show.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for fewer than 16 levels or more than the panel has, or too many frames; [`Error::Parameter`]
    /// for regions in the zero order; otherwise as [`grating_frame`].
    pub fn frames<'a>(&self, profile: &'a PanelProfile, wavelength: f64) -> Result<FrameSeries<'a>> {
        let all = profile.levels();
        let count = self.levels.unwrap_or(all.min(64));
        if !(16..=all).contains(&count) {
            return Err(Error::out_of_range("levels", count, format!("must be 16 … {all}, the panel's levels")));
        }
        let regions = self.regions.map_or(1, |(columns, rows)| columns * rows);
        if self.regions.is_some() && regions * count > 100_000 {
            let value = format!("{regions} regions with {count} levels each");
            return Err(Error::out_of_range("regions", value, "are more than 100000 frames"));
        }
        if self.regions.is_some() && self.order == Order::Zero {
            return Err(Error::parameter("order", "regions are told apart in the first order only"));
        }
        let (parts, stripe) = (self.regions, self.stripe);
        // In each line, so that powers of one laser are not taken for another's.
        let light = show_length(wavelength);
        let make = move |index: usize| {
            let (region, index) = (index / count, index % count);
            let level = (index as f64 * (all - 1) as f64 / (count - 1) as f64).round() as u16;
            let region = parts.map(|parts| Region { place: (region % parts.0, region / parts.0), parts });
            let frame = grating_frame(profile, wavelength, &Grating { fixed: 0, level, stripe, region })?;
            Ok(match region.map(|region| region.place) {
                None => Entry { name: format!("level-{level:05}.png"), cells: format!("{level},{light},"), frame },
                Some((column, row)) => Entry {
                    name: format!("region-{column}-{row}-level-{level:05}.png"),
                    cells: format!("{level},{column},{row},{light},"),
                    frame,
                },
            })
        };
        let columns = if parts.is_some() { "level,column,row,wavelength,power" } else { "level,wavelength,power" };
        Ok(FrameSeries::new(columns, regions * count, make))
    }

    /// Angle of the gratings' first order to the axis [rad].
    pub fn order_angle(&self, profile: &PanelProfile, wavelength: f64) -> f64 {
        (wavelength / (2.0 * self.stripe as f64 * profile.pitch_x)).min(1.0).asin()
    }
}

/// A measured power of the sweep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Power {
    /// Level of the grating's second stripes.
    pub level: u16,
    /// Column and row of the region that was measured, if not all of the panel.
    pub region: Option<(usize, usize)>,
    /// Power in any unit.
    pub power: f64,
}

/// Reads measured powers: comma-separated lines `level,power` or, by region, `level,column,row,power`.
///
/// A head line names the columns, in any order, and may name others, which are passed over; so are lines that begin with
/// `#`.
///
/// # Errors
/// [`Error::Calibration`] with the line that is not right, whose level the panel does not have, or whose column `wavelength` says that it
/// was measured in other light than `wavelength` [m].
pub fn read_powers(path: &Path, levels: usize, wavelength: f64) -> Result<Vec<Power>> {
    let text = text(path)?;
    let mut columns: Vec<String> = Vec::new();
    let mut powers: Vec<Power> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim().trim_start_matches('\u{feff}');
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let refuse = |what: String| Err(Error::calibration(path, format!("line {}: {what}", number + 1)));
        let words: Vec<&str> = line.split([',', ';', '\t']).map(str::trim).collect();
        if columns.is_empty() {
            let names: Vec<String> = words.iter().map(|word| word.to_lowercase()).collect();
            if names.iter().any(|name| name == "level") && names.iter().any(|name| name == "power") {
                columns = names;
                continue;
            }
            columns = match words.len() {
                4 => vec!["level".into(), "column".into(), "row".into(), "power".into()],
                _ => vec!["level".into(), "power".into()],
            };
        }
        if words.len() != columns.len() {
            return refuse(format!(
                "`{line}` has {} entries, {} are due: {}",
                words.len(),
                columns.len(),
                columns.join(",")
            ));
        }
        let word = |name: &str| columns.iter().position(|column| column == name).map(|at| words[at]);
        let whole =
            |name: &str| word(name).filter(|w| !w.is_empty()).map(str::parse::<usize>).transpose().map_err(drop);
        if let Some(light) = word("wavelength").filter(|word| !word.is_empty()) {
            match units::wavelength(light) {
                Ok(own) if (own - wavelength).abs() > SAME_LIGHT => {
                    let asked = show_length(wavelength);
                    return refuse(format!("measured at {light}, not at {asked}: give --wavelength {light}"));
                }
                Ok(_) => {}
                Err(_) => return refuse(format!("`{light}` is no wavelength, such as 532nm")),
            }
        }
        let power = word("power").unwrap_or_default();
        let (Ok(Some(level)), Ok(column), Ok(row)) = (whole("level"), whole("column"), whole("row")) else {
            return refuse(format!("`{line}` does not hold whole numbers for level, column and row"));
        };
        let Some(power) = power.parse::<f64>().ok().filter(|p| p.is_finite()) else {
            let what = if power.is_empty() { "the power is missing".into() } else { format!("`{power}` is no power") };
            return refuse(what);
        };
        if level >= levels {
            return refuse(format!("level {level}; the panel has 0 … {}", levels - 1));
        }
        let region = match (column, row) {
            (Some(column), Some(row)) => Some((column, row)),
            (None, None) => None,
            _ => return refuse("a region has a column and a row".into()),
        };
        if powers.first().is_some_and(|first| first.region.is_some() != region.is_some()) {
            return refuse("some powers are of regions, some of the whole panel".into());
        }
        powers.push(Power { level: level as u16, region, power });
    }
    if powers.is_empty() {
        return Err(Error::calibration(path, "holds no powers"));
    }
    Ok(powers)
}
