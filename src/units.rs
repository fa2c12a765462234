//! Lengths, angles, times and rates as people write them (`8um`, `632.8nm`, `2deg`, `10ms`, `60Hz`) to SI f64 and back.
//!
//! A bare number but 0 is refused: at the border every quantity says its unit.
//!
//! ```
//! use holodrive::units;
//!
//! assert_eq!(units::length("632.8nm")?, 632.8e-9);
//! assert_eq!(units::show_length(8e-6), "8um");
//! assert!(units::length("8").is_err(), "eight of what?");
//! # Ok::<(), holodrive::Error>(())
//! ```

use crate::error::{Error, Result};

/// Length units by their factor to metres. `µ` is accepted in both of its code points.
const LENGTHS: [(&str, f64); 9] = [
    ("pm", 1e-12),
    ("nm", 1e-9),
    ("um", 1e-6),
    ("µm", 1e-6),
    ("μm", 1e-6),
    ("mm", 1e-3),
    ("cm", 1e-2),
    ("m", 1.0),
    ("in", 0.0254),
];

/// Angle units by their factor to radians.
const ANGLES: [(&str, f64); 4] =
    [("deg", std::f64::consts::PI / 180.0), ("°", std::f64::consts::PI / 180.0), ("mrad", 1e-3), ("rad", 1.0)];

/// Time units by their factor to seconds.
const TIMES: [(&str, f64); 4] = [("us", 1e-6), ("µs", 1e-6), ("ms", 1e-3), ("s", 1.0)];

/// Frequency units by their factor to hertz.
const FREQUENCIES: [(&str, f64); 3] = [("Hz", 1.0), ("kHz", 1e3), ("MHz", 1e6)];

/// Units of memory by their factor to bytes; as the error of a job that does not fit counts them.
const MEMORIES: [(&str, f64); 3] = [("kB", 1024.0), ("MB", 1048576.0), ("GB", 1073741824.0)];

fn parse(text: &str, units: &[(&'static str, f64)], kind: &'static str, example: &str) -> Result<f64> {
    let text = text.trim();
    let split = text
        .char_indices()
        .find(|&(at, c)| {
            let exponent = (c == 'e' || c == 'E')
                && text[at + 1..].starts_with(|d: char| d.is_ascii_digit() || d == '-' || d == '+');
            !(c.is_ascii_digit() || matches!(c, '.' | '+' | '-') || exponent)
        })
        .map_or(text.len(), |(at, _)| at);
    let (number, unit) = (text[..split].trim(), text[split..].trim());
    let value: f64 = number
        .parse()
        .map_err(|_| Error::parameter(kind, format!("`{text}` is not a number with a unit, such as {example}")))?;
    // Nothing is nothing in any unit.
    if unit.is_empty() && value == 0.0 {
        return Ok(0.0);
    }
    if unit.is_empty() {
        return Err(Error::parameter(kind, format!("`{text}` has no unit; write it as {example}")));
    }
    let names = || units.iter().map(|u| u.0).filter(|u| u.is_ascii()).collect::<Vec<_>>().join(", ");
    let factor = units
        .iter()
        .find(|(name, _)| *name == unit)
        .ok_or_else(|| Error::parameter(kind, format!("`{text}`: unknown unit `{unit}`; use one of {}", names())))?
        .1;
    let value = value * factor;
    if !value.is_finite() {
        return Err(Error::parameter(kind, format!("`{text}` is not finite")));
    }
    if value.abs() > LARGEST || (value != 0.0 && value.abs() < SMALLEST) {
        let what = format!("must lie between {SMALLEST:e} and {LARGEST:e} {}", unit_of(units));
        return Err(Error::out_of_range(kind, quoted(text), what));
    }
    Ok(value)
}

/// The unit that is 1.
fn unit_of(units: &[(&'static str, f64)]) -> &'static str {
    units.iter().find(|(_, factor)| *factor == 1.0).map_or("bytes", |(name, _)| name)
}

/// No quantity of a bench passes these, in its own unit: beyond them squares and cubes of numbers are none any more.
const LARGEST: f64 = 1e12;
const SMALLEST: f64 = 1e-18;

/// The value, if it is greater than zero.
fn positive(value: f64, text: &str, kind: &'static str) -> Result<f64> {
    if value > 0.0 { Ok(value) } else { Err(Error::out_of_range(kind, quoted(text), "must be greater than zero")) }
}

fn quoted(text: &str) -> String {
    format!("`{}`", text.trim())
}

/// Reads a length with its unit: `8um` → 8e-6 [m]. Negative lengths are allowed; the caller knows its domain.
pub fn length(text: &str) -> Result<f64> {
    parse(text, &LENGTHS, "length", "8um, 632.8nm, 0.25m")
}

/// Reads a length that must be positive.
pub fn positive_length(text: &str) -> Result<f64> {
    positive(length(text)?, text, "length")
}

/// Reads a vacuum wavelength of light that panels modulate: 100 nm to 30 µm, so that 532mm is seen to be a slip.
pub fn wavelength(text: &str) -> Result<f64> {
    let value = positive_length(text)?;
    if WAVELENGTHS.contains(&value) {
        return Ok(value);
    }
    Err(Error::out_of_range("wavelength", quoted(text), "must be 100nm to 30um; look at its unit"))
}

/// Wavelengths of light that panels modulate [m].
pub(crate) const WAVELENGTHS: std::ops::RangeInclusive<f64> = 100e-9..=30e-6;

/// Reads a distance of neighbouring pixels: a length, or dots per inch: `5080dpi` → 5e-6 [m].
pub fn pitch(text: &str) -> Result<f64> {
    let text = text.trim();
    match text.strip_suffix("dpi").or_else(|| text.strip_suffix("DPI")) {
        Some(number) => {
            let text = &format!("{number}dpi");
            let dots = positive(parse(text, &[("dpi", 1.0)], "pitch", "5080dpi")?, text, "pitch")?;
            Ok(0.0254 / dots)
        }
        None => positive(parse(text, &LENGTHS, "pitch", "0.5um, 5080dpi")?, text, "pitch"),
    }
}

/// Reads an amount of memory with its unit: `2GB` → 2³¹ [bytes].
pub fn memory(text: &str) -> Result<u64> {
    positive(parse(text, &MEMORIES, "memory", "500MB, 2GB")?.floor(), text, "memory").map(|bytes| bytes as u64)
}

/// Reads an angle with its unit: `2deg` → 0.0349 [rad].
pub fn angle(text: &str) -> Result<f64> {
    parse(text, &ANGLES, "angle", "2deg, 35mrad")
}

/// Reads a time with its unit that is not negative: `10ms` → 0.01 [s].
pub fn duration(text: &str) -> Result<f64> {
    let value = parse(text, &TIMES, "time", "10ms, 0.5s")?;
    match value {
        ..0.0 => Err(Error::out_of_range("time", quoted(text), "must not be negative")),
        // A day: a clock counts no more than so many.
        86_400.0.. => Err(Error::out_of_range("time", quoted(text), "must be less than a day")),
        _ => Ok(value),
    }
}

/// Reads a positive rate with its unit: `60Hz` → 60 [Hz].
pub fn frequency(text: &str) -> Result<f64> {
    positive(parse(text, &FREQUENCIES, "frequency", "60Hz, 1.44kHz")?, text, "frequency")
}

/// Prints a length [m] with the unit that keeps it between 1 and 1000, to at most six significant digits.
pub fn show_length(metres: f64) -> String {
    let magnitude = metres.abs();
    let (unit, factor) = match magnitude {
        0.0 => ("m", 1.0),
        m if m < 1e-6 => ("nm", 1e-9),
        m if m < 1e-3 => ("um", 1e-6),
        m if m < 1.0 => ("mm", 1e-3),
        _ => ("m", 1.0),
    };
    let digits = (5 - (magnitude / factor).max(1.0).log10().floor() as i32).clamp(0, 5) as usize;
    let number = format!("{:.*}", digits, metres / factor);
    let number = if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { &number };
    format!("{number}{unit}")
}

/// Prints a pitch along x and y [m], as one length where they are the same.
pub fn show_pitch([x, y]: [f64; 2]) -> String {
    let [x, y] = [x, y].map(show_length);
    if x == y { x } else { format!("{x}×{y}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_and_angles_parse_to_si() {
        for (text, metres) in [
            ("8um", 8e-6),
            ("632.8nm", 632.8e-9),
            ("0.25 m", 0.25),
            ("1e-3m", 1e-3),
            ("-2.5cm", -0.025),
            ("1in", 0.0254),
            ("3.74µm", 3.74e-6),
            ("2E2mm", 0.2),
        ] {
            let value = length(text).expect(text);
            assert!((value - metres).abs() <= 1e-15 * metres.abs().max(1e-9), "{text}: {value} is not {metres}");
        }
        assert!((pitch("5080dpi").expect("dpi") - 5e-6).abs() < 1e-20 && pitch("0.5um").expect("um") == 0.5e-6);
        assert!(["0dpi", "-5dpi", "dpi", "NaNdpi", "5", "0um"].iter().all(|text| pitch(text).is_err()));
        assert!((angle("180deg").expect("deg") - std::f64::consts::PI).abs() < 1e-15);
        assert!((duration("10ms").expect("ms") - 0.01).abs() < 1e-18);
        assert!((frequency("1.44kHz").expect("kHz") - 1440.0).abs() < 1e-9);
        assert!(duration("-1s").is_err() && duration("5Hz").is_err() && frequency("0Hz").is_err());
        assert!((angle("5mrad").expect("mrad") - 0.005).abs() < 1e-18);
    }

    #[test]
    fn bare_numbers_and_nonsense_are_refused() {
        for text in ["8", "um", "", "8 parsec", "NaNm", "infm", "1e400m", "--3mm"] {
            assert!(length(text).is_err(), "{text} was accepted");
        }
        assert!(length("8").unwrap_err().to_string().contains("no unit"));
        assert!(positive_length("0m").is_err());
        assert!(angle("2m").is_err());
        assert_eq!(length("0").expect("nothing"), 0.0);
        assert_eq!(pitch("5080DPI").expect("dpi"), pitch("5080dpi").expect("dpi"));
        for slip in ["532mm", "532um", "1nm", "-532nm", "0nm"] {
            assert!(wavelength(slip).is_err(), "{slip} was accepted");
        }
        assert!(wavelength("532mm").unwrap_err().to_string().contains("`532mm`"));
        assert!((wavelength("10.6um").expect("a CO2 laser's") - 10.6e-6).abs() < 1e-18);
    }

    #[test]
    fn shown_lengths_read_back() {
        for metres in [632.8e-9, 8e-6, 0.25, 1.0, 12.5, 0.000_999_9, 3.74e-6] {
            let back = length(&show_length(metres)).expect("shown length");
            assert!((back / metres - 1.0).abs() < 1e-5, "{metres} → {} → {back}", show_length(metres));
        }
        assert_eq!(show_length(8e-6), "8um");
        assert_eq!(show_length(0.25), "250mm");
    }
}
