//! A printer's transfer from the scan of its card.
//!
//! *8 bits.* The mean light T of each step's two patches; the amplitude transmittance is √T.
//!
//! *One bit.* The share of area that came out at the highest level is c = (T − T₀)/(T₁ − T₀), with T₀ and T₁ of patches that
//! are wholly at the lowest and the highest level; a scanner need not resolve the lines. Lines of the width w and period P
//! that grow by b have c = w/P + b/P: b is fitted along x and along y. Error diffusion gives the tone.
//!
//! What a lamp's falling off or dust do shows in the difference of two patches that are alike: that is the uncertainty.

use super::card::{Card, PERIODS, Patch};
use super::plate::{Binarisation, Plate};
use super::plate_size::Asked;
use super::plates::text_of;
use super::registration::{Registration, Scan, register};
use super::transfer::Transfer;
use crate::error::{Error, Result};
use crate::files::{self, pictures};
use serde::Serialize;
use std::f64::consts::PI;
use std::path::Path;

/// How a scanner's numbers follow the light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scanner {
    /// In proportion to it, as scanners write where no gamma and no colour management is applied.
    #[default]
    Linear,
    /// Coded for screens by the curve of sRGB.
    Srgb,
}

impl crate::names::Named for Scanner {
    const KIND: &'static str = "scanner";
    const NAMES: &'static [crate::names::Name<Self>] = &[
        ("linear", || Self::Linear, "numbers in proportion to the light"),
        ("srgb", || Self::Srgb, "numbers coded for screens (sRGB)"),
    ];
}

/// A step, or a tone of error diffusion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Step {
    /// Level that was drawn, as a share of the highest.
    pub level: f64,
    /// Amplitude transmittance that came out, the largest being 1.
    pub amplitude: f64,
}

/// Lines of one period and width.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lines {
    /// Axis along which they follow one another: 0 x, 1 y.
    pub axis: usize,
    /// Period [px].
    pub period: u32,
    /// Share that was drawn at the highest level, and that came out.
    pub drawn: f64,
    /// Share of area that came out at it.
    pub printed: f64,
}

/// What a scan says of a printer.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PlateCalibration {
    /// What undoes it.
    pub transfer: Transfer,
    /// Standard uncertainty of the amplitudes, the largest being 1.
    pub amplitude_uncertainty: f64,
    /// Standard uncertainty of the lines' growth along x and y [m].
    pub line_uncertainty: Option<[f64; 2]>,
    /// Share of area at the highest level of lines that were drawn half of the carrier's period wide, less ½: minus it is the
    /// dot gain of the lowest level.
    pub gain: Option<f64>,
    /// Steps or tones.
    pub steps: Vec<Step>,
    /// Lines.
    pub lines: Vec<Lines>,
    /// Pixels of the scan across a patch.
    pub patch: f64,
    /// Angle by which the card is turned in the scan [rad].
    pub rotation: f64,
    /// Whether the scan shows it from behind.
    pub mirrored: bool,
    /// How far marks are from where they should be, RMS [scan px].
    pub residual: f64,
    /// What a user should know.
    #[serde(skip)]
    pub warnings: Vec<String>,
}

/// Of a patch only its middle is measured: this share of its side, weighed less and less towards its edges (Hann's window), so
/// that it does not matter where lines are cut.
const MIDDLE: f64 = 0.8;
/// Pixels across what is measured of a patch at least.
const FEWEST: f64 = 12.0;
/// Swing of a card that nothing can be read from, as a share of the brightest.
const FAINTEST: f64 = 0.02;

fn read_scan(path: &Path, scanner: Scanner) -> Result<Scan> {
    let picture = pictures::open(path)?.into_luma16();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let light = |coded: u16| {
        let value = f32::from(coded) / 65_535.0;
        match scanner {
            Scanner::Linear => value,
            Scanner::Srgb if value <= 0.040_45 => value / 12.92,
            Scanner::Srgb => ((value + 0.055) / 1.055).powf(2.4),
        }
    };
    Ok(Scan { width, height, light: picture.into_raw().into_iter().map(light).collect() })
}

/// Mean light of the middle of each of the first half's patches: of both of its places.
fn means(scan: &Scan, card: &Card, laid: &Registration) -> Vec<[f64; 2]> {
    let mean = |place: usize| {
        let inner = card.corner(place).map(|at| at + 0.5 * (1.0 - MIDDLE) * card.side as f64);
        let length = MIDDLE * card.side as f64;
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
            .map(|[x, y]| laid.scan_from_card([inner[0] + x * length, inner[1] + y * length]));
        let bounds = [0, 1].map(|i| {
            let end = [scan.width, scan.height][i] as f64;
            let low = corners.iter().map(|c| c[i]).fold(f64::INFINITY, f64::min).clamp(0.0, end);
            let high = corners.iter().map(|c| c[i]).fold(0.0, f64::max).clamp(0.0, end);
            low as usize..high.ceil() as usize
        });
        let (mut sum, mut count) = (0.0, 0.0);
        for row in bounds[1].clone() {
            for column in bounds[0].clone() {
                let at = laid.card_from_scan([column as f64 + 0.5, row as f64 + 0.5]);
                let share = [0, 1].map(|i| (at[i] - inner[i]) / length);
                if share.iter().all(|share| (0.0..1.0).contains(share)) {
                    let weight: f64 = share.iter().map(|share| (PI * share).sin().powi(2)).product();
                    sum += weight * f64::from(scan.light[row * scan.width + column]);
                    count += weight;
                }
            }
        }
        if count > 0.0 { sum / count } else { 0.0 }
    };
    (0..card.half.len()).map(|half| card.places(half).map(mean)).collect()
}

/// The nearest sequence that climbs throughout, in the sense of least squares (pool adjacent violators).
fn climbing(values: &[f64]) -> Vec<f64> {
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for &value in values {
        pools.push((value, 1));
        while let [.., (a, m), (b, n)] = pools[..]
            && a > b
        {
            pools.truncate(pools.len() - 2);
            pools.push(((a * m as f64 + b * n as f64) / (m + n) as f64, m + n));
        }
    }
    pools.into_iter().flat_map(|(value, count)| std::iter::repeat_n(value, count)).collect()
}

/// Steps as a curve that rises or falls throughout.
fn curve(steps: &[Step]) -> (Vec<f64>, Vec<f64>) {
    let amplitude: Vec<f64> = steps.iter().map(|step| step.amplitude).collect();
    let falls = amplitude.last() < amplitude.first();
    let turned = |values: Vec<f64>| values.into_iter().map(|a| if falls { -a } else { a }).collect::<Vec<_>>();
    let amplitude = turned(climbing(&turned(amplitude)));
    // Six digits are more than is known, and read back as they are.
    let short = |value: f64| (value * 1e6).round() / 1e6;
    (steps.iter().map(|step| step.level).collect(), amplitude.into_iter().map(|a| short(a.max(0.0))).collect())
}

/// RMS of half of the differences of patches that are alike, as their mean's uncertainty.
fn uncertainty(pairs: &[[f64; 2]]) -> f64 {
    let squares = pairs.iter().map(|[a, b]| (0.5 * (a - b)).powi(2)).sum::<f64>();
    (squares / pairs.len().max(1) as f64).sqrt()
}

/// What the scan of a plate's card says of its printer.
///
/// # Errors
/// [`Error::Io`] and [`Error::Input`] for a scan that cannot be read, shows no card, is too coarse, or nothing was printed in.
pub fn measure(plate: &Plate, scan: &Path, scanner: Scanner) -> Result<PlateCalibration> {
    let light = read_scan(scan, scanner)?;
    // Any side does: a scan tells its own scale.
    let card = Card::new(plate.fringe.bits, 192);
    let laid = register(&light, &card, scan)?;
    let patch = laid.scale() * card.side as f64;
    if MIDDLE * patch < FEWEST {
        let what = format!("has {patch:.0} pixels across a patch, and {:.0} are needed; scan finer", FEWEST / MIDDLE);
        return Err(Error::input(scan, what));
    }
    let pairs = means(&light, &card, &laid);
    let brightest = pairs.iter().flatten().copied().fold(0.0, f64::max);
    let darkest = pairs.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    if brightest - darkest < FAINTEST * brightest.max(1e-6) {
        return Err(Error::input(scan, "its patches are all alike: nothing was printed, or the scan is flat"));
    }
    let light_uncertainty = uncertainty(&pairs) / brightest;
    let light: Vec<f64> = pairs.iter().map(|[a, b]| 0.5 * (a + b) / brightest).collect();
    let mut warnings = Vec::new();
    if brightest > 0.998 {
        warnings.push("the scan's brightest patches are clipped; scan darker".to_owned());
    }
    if light_uncertainty > 0.02 {
        let percent = 100.0 * light_uncertainty;
        warnings
            .push(format!("patches that should be alike differ by {percent:.1} %: uneven light, dust or scratches"));
    }
    let mut out = PlateCalibration {
        transfer: Transfer::default(),
        amplitude_uncertainty: 0.0,
        line_uncertainty: None,
        gain: None,
        steps: Vec::new(),
        lines: Vec::new(),
        patch,
        rotation: laid.rotation(),
        mirrored: laid.mirrored(),
        residual: laid.residual,
        warnings,
    };
    let amplitude = |light: f64| light.max(0.0).sqrt();
    if plate.fringe.bits == 1 {
        one_bit(plate, &card, &light, scan, &mut out)?;
    } else {
        for (patch, &light) in card.half.iter().zip(&light) {
            out.steps.push(Step { level: patch.share() / 255.0, amplitude: amplitude(light) });
        }
    }
    // √T: half of T's relative uncertainty; in the middle of the swing T is a quarter, √T a half.
    out.amplitude_uncertainty = light_uncertainty;
    (out.transfer.levels, out.transfer.amplitude) = curve(&out.steps);
    out.transfer.check(&plate.fringe).map_err(|what| Error::input(scan, what))?;
    Ok(out)
}

fn one_bit(plate: &Plate, card: &Card, light: &[f64], scan: &Path, out: &mut PlateCalibration) -> Result<()> {
    let solid = |level: u8| {
        let all: Vec<f64> =
            card.half.iter().zip(light).filter(|(patch, _)| **patch == Patch::Level(level)).map(|(_, l)| *l).collect();
        all.iter().sum::<f64>() / all.len().max(1) as f64
    };
    let [low, high] = [solid(0), solid(1)];
    if (high - low).abs() < FAINTEST {
        return Err(Error::input(scan, "its solid patches are alike: nothing was printed, or the wrong card"));
    }
    let share = |light: f64| (light - low) / (high - low);
    let amplitude = |share: f64| low.max(0.0).sqrt() + share * (high.max(0.0).sqrt() - low.max(0.0).sqrt());
    out.steps.push(Step { level: 0.0, amplitude: amplitude(0.0) });
    for (patch, &light) in card.half.iter().zip(light) {
        match patch {
            Patch::Tone { .. } => out.steps.push(Step { level: patch.share(), amplitude: amplitude(share(light)) }),
            Patch::Lines { axis, period, .. } => {
                let (axis, period) = (*axis, *period);
                out.lines.push(Lines { axis, period, drawn: patch.share(), printed: share(light) });
            }
            Patch::Level(_) => {}
        }
    }
    out.steps.push(Step { level: 1.0, amplitude: amplitude(1.0) });
    let is_half = |patch: &Patch| matches!(patch, Patch::Tone { wanted, .. } if *wanted == 0.5);
    let half = card.half.iter().zip(light).find(|(patch, _)| is_half(patch)).map(|(_, light)| share(*light));
    if let Some(half) = half
        && plate.fringe.binarisation == Binarisation::Diffusion
        && !DOTS.contains(&half)
    {
        let what = format!(
            "error diffusion of half of the pixels came out as {:.0} % of the area: single dots do not print; set binarisation = \
             \"pulse-width\" or \"threshold\" in the plate and give the command again",
            100.0 * half.clamp(0.0, 1.0)
        );
        return Err(Error::input(scan, what));
    }
    let pitch = [plate.raster.pitch_x, plate.raster.pitch_y];
    let carrier = carrier_period(plate);
    let fits = [0, 1].map(|axis| growth(&out.lines, axis, carrier));
    if let [Some(x), Some(y)] = fits {
        out.transfer.line_bias = Some([x[0] * pitch[0], y[0] * pitch[1]]);
        out.line_uncertainty = Some([x[1] * pitch[0], y[1] * pitch[1]]);
        out.gain = carrier.map(|period| 0.5 * (x[0] + y[0]) / period);
    } else {
        out.warnings
            .push("too few of its lines came out to tell how much they grow; raise or lower the dose".to_owned());
        if plate.fringe.binarisation != Binarisation::Diffusion {
            return Err(Error::input(scan, "too few of its lines came out: they run together, or are gone"));
        }
    }
    for period in PERIODS {
        let mut half = out.lines.iter().filter(|lines| lines.period == period && (lines.drawn - 0.5).abs() < 0.01);
        if half.any(|lines| !USABLE.contains(&lines.printed)) {
            let width = 0.5 * f64::from(period);
            out.warnings.push(format!("lines {width} px wide do not come out, or run together"));
        }
    }
    Ok(())
}

/// Shares of area, of error diffusion of one half, between which its dots are dots.
const DOTS: std::ops::Range<f64> = 0.02..0.98;

/// Shares of area between which lines are lines: beyond, they are gone or have run together.
const USABLE: std::ops::Range<f64> = 0.05..0.95;

/// By how many pixels lines grow along an axis, with its standard uncertainty: of periods within a factor of two of the
/// carrier's where there are six, else of all. Lines that grow quite unlike most (the finest, which half run together) are
/// left out: those farther from the median than four times the median of such distances.
fn growth(lines: &[Lines], axis: usize, carrier: Option<f64>) -> Option<[f64; 2]> {
    let usable: Vec<&Lines> =
        lines.iter().filter(|lines| lines.axis == axis && USABLE.contains(&lines.printed)).collect();
    let near = |lines: &&&Lines| carrier.is_some_and(|period| (f64::from(lines.period) / period).ln().abs() < 0.7);
    let close: Vec<&Lines> = usable.iter().filter(near).copied().collect();
    let taken = if close.len() >= 6 { close } else { usable };
    if taken.len() < 3 {
        return None;
    }
    let grown = |lines: &Lines| (lines.printed - lines.drawn) * f64::from(lines.period);
    let usual = median(taken.iter().map(|lines| grown(lines)));
    let spread = median(taken.iter().map(|lines| (grown(lines) - usual).abs())).max(LIKE);
    let alike: Vec<&Lines> = taken.into_iter().filter(|lines| (grown(lines) - usual).abs() <= 4.0 * spread).collect();
    let weight: f64 = alike.iter().map(|lines| f64::from(lines.period).powi(-2)).sum();
    let growth =
        alike.iter().map(|lines| (lines.printed - lines.drawn) / f64::from(lines.period)).sum::<f64>() / weight;
    let left = |lines: &&Lines| (lines.printed - lines.drawn - growth / f64::from(lines.period)).powi(2);
    let variance = alike.iter().map(left).sum::<f64>() / (alike.len().max(2) - 1) as f64;
    Some([growth, (variance / weight).sqrt()])
}

/// Growths that differ by so many pixels are alike.
const LIKE: f64 = 0.01;

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Period of the reference's fringes in the middle of the plate [px].
fn carrier_period(plate: &Plate) -> Option<f64> {
    let [fx, fy] = plate.reference.frequency_at([0.0; 2], plate.wavelength);
    let per_pixel = (fx * plate.raster.pitch_x).hypot(fy * plate.raster.pitch_y);
    (per_pixel > 0.0).then(|| 1.0 / per_pixel)
}

/// How the line above a measured transfer begins.
const MEASURED: &str = "# Measured on ";

/// Writes a plate's profile with a measured transfer in place of its own; all else stays as it was written.
///
/// # Errors
/// [`Error::Parameter`] for a name that does not end in .toml; [`Error::Io`]; [`Error::Calibration`].
pub fn write_profile(profile: &str, found: &PlateCalibration, scan: &Path, output: &Path) -> Result<()> {
    if !output.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return Err(Error::parameter("profile", format!("{}: a profile's name ends in .toml", output.display())));
    }
    let text = text_of(profile)?;
    let mut inside = false;
    let mut kept: Vec<&str> = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with('[') && !line.trim_start().starts_with("[[") {
            inside = line.trim().starts_with("[transfer]");
            if inside && kept.last().is_some_and(|last| last.starts_with(MEASURED)) {
                kept.pop();
            }
        }
        if !inside {
            kept.push(line);
        }
    }
    let list = |values: &[f64]| values.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(", ");
    let Transfer { levels, amplitude, line_bias } = &found.transfer;
    let name = scan.file_name().unwrap_or_default().to_string_lossy().replace(['\n', '\r'], " ");
    let mut out = kept.join("\n").trim_end().to_owned();
    out += &format!("\n\n{MEASURED}{name}; amplitudes are uncertain by {:.4}", found.amplitude_uncertainty);
    if let Some([x, y]) = found.line_uncertainty {
        out += &format!(", lines by {:.1} and {:.1} nm", x * 1e9, y * 1e9);
    }
    out += &format!(".\n[transfer]\nlevels = [{}]\namplitude = [{}]\n", list(levels), list(amplitude));
    if let Some([x, y]) = line_bias {
        out += &format!("line_bias = [\"{:.2}nm\", \"{:.2}nm\"]\n", x * 1e9, y * 1e9);
    }
    // What is written is read back before it gets its name.
    Plate::parse_as(&out, output, &Asked::default())?;
    files::write_bytes(output, out.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sequence_is_made_to_climb() {
        assert_eq!(climbing(&[1.0, 3.0, 2.0, 4.0]), [1.0, 2.5, 2.5, 4.0]);
        assert_eq!(climbing(&[3.0, 2.0, 1.0]), [2.0; 3]);
        assert!(climbing(&[]).is_empty());
    }

    #[test]
    fn growth_is_found_in_shares_of_area() {
        let lines: Vec<Lines> = PERIODS
            .iter()
            .flat_map(|&period| [0.25, 0.5, 0.75].map(|drawn| (period, drawn)))
            .map(|(period, drawn)| Lines { axis: 0, period, drawn, printed: drawn - 0.6 / f64::from(period) })
            .collect();
        let [found, spread] = growth(&lines, 0, Some(8.0)).expect("growth");
        assert!((found + 0.6).abs() < 1e-12 && spread < 1e-12);
        assert!(growth(&lines, 1, None).is_none());
        // The finest run together.
        let mut merged = lines;
        merged[2].printed = 0.9;
        let [found, _] = growth(&merged, 0, Some(8.0)).expect("growth");
        assert!((found + 0.6).abs() < 1e-12, "{found}");
    }
}
