//! Values as they are typed.

use crate::names::Named;
use crate::points::budget::Budget;
use crate::scene::environment::{CLEAR, Sky};
use crate::{Result, units};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// A value of a closed set, by its name; help and errors list the names.
pub(super) fn one_of<T: Named + Clone + Send + Sync>() -> impl TypedValueParser<Value = T> {
    let names = T::NAMES.iter().map(|(name, _, what)| PossibleValue::new(name).help(what));
    PossibleValuesParser::new(names).try_map(|name| T::named(&name))
}

/// Pixels or rays of a picture at most: their light takes 12 bytes each, and often more than once.
const MOST_PIXELS: usize = 1 << 27;

/// Columns × rows.
pub(super) fn size(text: &str) -> Result<(usize, usize), String> {
    let wrong = || format!("`{text}` is not a size such as 500x500");
    let (width, height) = text.split_once(['x', '×']).ok_or_else(wrong)?;
    let side = |t: &str| t.trim().parse::<usize>().ok().filter(|n| (1..=65_536).contains(n));
    match (side(width), side(height)) {
        (Some(width), Some(height)) if width * height <= MOST_PIXELS => Ok((width, height)),
        (Some(_), Some(_)) => Err(format!("`{text}` is more than {MOST_PIXELS} in all")),
        _ => Err(format!("{}; each side 1 to 65536", wrong())),
    }
}

/// One positive length for both directions, or x,y.
pub(super) fn lengths(text: &str) -> Result<[f64; 2]> {
    match text.split_once(',') {
        Some((x, y)) => Ok([units::positive_length(x)?, units::positive_length(y)?]),
        None => units::positive_length(text).map(|length| [length; 2]),
    }
}

/// Two lengths, the lesser first.
pub(super) fn range(text: &str) -> Result<[f64; 2], String> {
    let wrong = || format!("`{text}` is not two lengths such as 0.5m,3m");
    let (near, far) = text.split_once(',').ok_or_else(wrong)?;
    let [near, far] = [units::length(near), units::length(far)].map(|length| length.map_err(|e| e.to_string()));
    let (near, far) = (near?, far?);
    if near >= 0.0 && near < far { Ok([near, far]) } else { Err(format!("{}, the lesser first", wrong())) }
}

/// An angle along x, or x,y.
pub(super) fn angles(text: &str) -> Result<[f64; 2]> {
    match text.split_once(',') {
        Some((x, y)) => Ok([units::angle(x)?, units::angle(y)?]),
        None => Ok([units::angle(text)?, 0.0]),
    }
}

/// A part of a hundred.
pub(super) fn percent(text: &str) -> Result<f64, String> {
    let number = text.strip_suffix('%').and_then(|number| number.trim().parse::<f64>().ok()).filter(|n| n.is_finite());
    number.map(|n| n / 100.0).ok_or_else(|| format!("`{text}` is not a percentage such as 1%"))
}

/// Elevation and azimuth of the sun, and haze.
pub(super) fn sky(text: &str) -> Result<Sky, String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let (elevation, azimuth, haze) = match parts.as_slice() {
        [elevation, azimuth] => (elevation, azimuth, None),
        [elevation, azimuth, haze] => (elevation, azimuth, Some(haze)),
        _ => return Err(format!("`{text}` is not elevation and azimuth such as 35deg,130deg")),
    };
    let angle = |text: &str| units::angle(text).map_err(|e| e.to_string());
    let turbidity =
        haze.map_or(Ok(CLEAR), |haze| haze.parse().map_err(|_| format!("`{haze}` is no number for haze")))?;
    let sky = Sky { turbidity, ..Sky::clear(angle(elevation)?, angle(azimuth)?) };
    sky.check().map(|()| sky).map_err(|e| e.to_string())
}

/// Three values with commas between them, or what an example of them is.
fn three(text: &str, one: impl Fn(&str) -> Result<f64>, example: &str) -> Result<[f64; 3], String> {
    let parts: Vec<f64> = text.split(',').map(one).collect::<Result<_>>().map_err(|e| e.to_string())?;
    <[f64; 3]>::try_from(parts).map_err(|_| format!("`{text}` is not {example}"))
}

/// x,y,z in the hologram frame.
pub(crate) fn position(text: &str) -> Result<[f64; 3], String> {
    three(text, units::length, "x,y,z such as 0mm,0mm,600mm")
}

/// Diameter and distance of a lamp [m].
/// The lamp that a plate is looked at with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LampAsked {
    /// A distant point of one wavelength.
    Laser,
    /// Diameter and distance [m].
    Of([f64; 2]),
}

pub(super) fn lamp(text: &str) -> Result<LampAsked, String> {
    if text == "laser" {
        return Ok(LampAsked::Laser);
    }
    let (diameter, distance) = text.split_once(',').ok_or("give diameter and distance such as 2mm,300mm, or laser")?;
    let diameter = units::length(diameter.trim()).map_err(|e| e.to_string())?;
    let distance = units::positive_length(distance.trim()).map_err(|e| e.to_string())?;
    Ok(LampAsked::Of([diameter, distance]))
}

/// Which three lasers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wavelengths {
    Panel,
    Of([f64; 3]),
}

pub(super) fn wavelengths(text: &str) -> Result<Wavelengths, String> {
    match text {
        "panel" => Ok(Wavelengths::Panel),
        _ => three(text, units::wavelength, "three wavelengths such as 638nm,520nm,450nm").map(Wavelengths::Of),
    }
}

/// What is clipped as white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum White {
    Auto,
    None,
    At(f32),
}

pub(super) fn white(text: &str) -> Result<White, String> {
    match text {
        "auto" => Ok(White::Auto),
        "none" => Ok(White::None),
        value => value.parse().map(White::At).map_err(|_| format!("`{value}` is not auto, none or a radiance")),
    }
}

pub(super) fn budget(text: &str) -> Result<Budget, String> {
    match text {
        "eye" => Ok(Budget::Eye),
        "panel" => Ok(Budget::Panel),
        // More than 65 536 rays a side are not cast.
        number => match number.parse() {
            Ok(count) if (1..=1usize << 32).contains(&count) => Ok(Budget::Points(count)),
            _ => Err(format!("`{text}` is not a number of points from 1 on, nor eye or panel")),
        },
    }
}

/// How many frames are made ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ahead {
    Frames(usize),
    All,
}

pub(super) fn ahead(text: &str) -> Result<Ahead, String> {
    match text {
        "all" => Ok(Ahead::All),
        // Frames of a 4K panel take 25 MB each.
        number => match number.parse() {
            Ok(count) if (1..=1000).contains(&count) => Ok(Ahead::Frames(count)),
            _ => Err(format!("`{text}` is not a number of frames from 1 to 1000, nor all")),
        },
    }
}

/// First column and row of a part of a plate, and its size.
pub(super) fn part(text: &str) -> Result<[u64; 4], String> {
    let wrong = || format!("`{text}` is not COLUMN,ROW,WxH such as 0,4096,4096x4096");
    let mut parts = text.splitn(3, ',');
    let mut number = || parts.next().and_then(|t| t.trim().parse::<u64>().ok());
    let (Some(column), Some(row)) = (number(), number()) else { return Err(wrong()) };
    let (width, height) = parts.next().and_then(|t| t.split_once(['x', '×'])).ok_or_else(wrong)?;
    match (width.trim().parse(), height.trim().parse()) {
        (Ok(width), Ok(height)) => Ok([column, row, width, height]),
        _ => Err(wrong()),
    }
}
