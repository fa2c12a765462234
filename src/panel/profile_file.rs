//! Panel profiles as TOML: the file's keys, their units and their domains.

use super::packing::{Packing, SignalLayout};
use super::profile::{PanelKind, PanelProfile};
use super::response::{Curve, Modulation, PhaseSign, Response};
use crate::error::{Error, Result};
use crate::units;
use serde::{Deserialize, Deserializer, de};
use std::f64::consts::{PI, TAU};
use std::fmt;
use std::path::Path;

/// Every profile of `calib/`, by name.
pub(super) const EMBEDDED: &[(&str, &str)] = &[
    ("generic", include_str!("../../calib/generic.toml")),
    ("generic-amplitude", include_str!("../../calib/generic-amplitude.toml")),
    ("hamamatsu-x10468", include_str!("../../calib/hamamatsu-x10468.toml")),
    ("hamamatsu-x15213", include_str!("../../calib/hamamatsu-x15213.toml")),
    ("holoeye-gaea-2", include_str!("../../calib/holoeye-gaea-2.toml")),
    ("holoeye-leto-3", include_str!("../../calib/holoeye-leto-3.toml")),
    ("holoeye-luna", include_str!("../../calib/holoeye-luna.toml")),
    ("holoeye-pluto-2.1", include_str!("../../calib/holoeye-pluto-2.1.toml")),
    ("jasper-jd7714", include_str!("../../calib/jasper-jd7714.toml")),
    ("meadowlark-p1920", include_str!("../../calib/meadowlark-p1920.toml")),
    ("santec-slm-200", include_str!("../../calib/santec-slm-200.toml")),
    ("santec-slm-300-120hz", include_str!("../../calib/santec-slm-300-120hz.toml")),
    ("thorlabs-exulus-hd", include_str!("../../calib/thorlabs-exulus-hd.toml")),
    ("ti-dlp4710", include_str!("../../calib/ti-dlp4710.toml")),
    ("ti-plm-67", include_str!("../../calib/ti-plm-67.toml")),
];

/// A quantity with its unit, still as text: a bare number is refused with words that say why.
#[derive(Clone, Debug)]
struct Quantity(String);

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Text;
        impl de::Visitor<'_> for Text {
            type Value = Quantity;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a quantity with its unit, in quotes, such as \"8um\"")
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<Quantity, E> {
                Ok(Quantity(text.to_owned()))
            }
        }
        deserializer.deserialize_any(Text)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProfileFile {
    name: String,
    maker: String,
    kind: PanelKind,
    width: usize,
    height: usize,
    pitch: Option<Quantity>,
    pitch_x: Option<Quantity>,
    pitch_y: Option<Quantity>,
    bits: u8,
    fill_factor: f64,
    #[serde(default = "one")]
    dead_space: f64,
    wavelengths: Vec<Quantity>,
    #[serde(default)]
    phase_sign: PhaseSign,
    settle_time: Option<Quantity>,
    refresh: Option<Quantity>,
    edid: Option<String>,
    #[serde(default)]
    unverified: Vec<String>,
    signal: Option<SignalFile>,
    response: Vec<ResponseFile>,
}

/// Dead space is taken to reflect as well as the active area, the worst case, where a profile does not say.
fn one() -> f64 {
    1.0
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SignalFile {
    packing: Packing,
    width: Option<usize>,
    height: Option<usize>,
    #[serde(default)]
    column_offset: usize,
    #[serde(default)]
    row_offset: usize,
    #[serde(default)]
    flip_x: bool,
    #[serde(default)]
    flip_y: bool,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum CurveKind {
    Linear,
    Table,
    Polynomial,
    Piston,
    Amplitude,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ResponseFile {
    kind: CurveKind,
    wavelength: Option<Quantity>,
    levels_for_2pi: Option<f64>,
    unit: Option<String>,
    values: Option<Vec<f64>>,
    coefficients: Option<Vec<f64>>,
    heights: Option<Vec<Quantity>>,
}

/// Turns a reader's error into one about the key and the file.
struct At<'a> {
    source: &'a Path,
}

impl At<'_> {
    fn refuse<T>(&self, what: impl Into<String>) -> Result<T> {
        Err(Error::calibration(self.source, what))
    }
    fn read<T>(&self, key: &str, text: &Quantity, parse: impl Fn(&str) -> Result<T>) -> Result<T> {
        parse(&text.0).map_err(|e| {
            let what = match e {
                Error::Parameter { what, .. } => what,
                other => other.to_string(),
            };
            Error::calibration(self.source, format!("{key}: {what}"))
        })
    }
    fn share(&self, key: &str, value: f64, low_is_out: bool) -> Result<f64> {
        let good = value <= 1.0 && if low_is_out { value > 0.0 } else { value >= 0.0 };
        if good { Ok(value) } else { self.refuse(format!("{key} = {value} is not a share between 0 and 1")) }
    }
}

pub(super) fn parse(text: &str, source: &Path) -> Result<PanelProfile> {
    let at = At { source };
    let file: ProfileFile = toml::from_str(text).map_err(|e| {
        let line = e.span().map_or(1, |span| text[..span.start.min(text.len())].matches('\n').count() + 1);
        // Serde's lists of expected keys are long; one line is what the user reads.
        Error::calibration(source, format!("line {line}: {}", e.message().replace('\n', " ")))
    })?;
    if file.width == 0 || file.height == 0 || file.width > 1 << 16 || file.height > 1 << 16 {
        return at.refuse(format!("width × height = {}×{} must be 1 … 65536 each", file.width, file.height));
    }
    if !(1..=16).contains(&file.bits) {
        return at.refuse(format!("bits = {} must be 1 … 16", file.bits));
    }
    if file.kind == PanelKind::BinaryDmd && file.bits != 1 {
        return at
            .refuse(format!("bits = {} on a binary-dmd: its mirrors have two positions, write bits = 1", file.bits));
    }
    let pitch = |key: &str, own: &Option<Quantity>| match (own, &file.pitch) {
        (Some(text), None) => at.read(key, text, units::positive_length),
        (None, Some(text)) => at.read("pitch", text, units::positive_length),
        (Some(_), Some(_)) => at.refuse(format!("{key} stands beside pitch; give pitch, or pitch_x and pitch_y")),
        (None, None) => at.refuse(format!("{key} is missing; give pitch = \"8um\", or pitch_x and pitch_y")),
    };
    let (pitch_x, pitch_y) = (pitch("pitch_x", &file.pitch_x)?, pitch("pitch_y", &file.pitch_y)?);
    let wavelengths = file
        .wavelengths
        .iter()
        .map(|text| at.read("wavelengths", text, units::positive_length))
        .collect::<Result<Vec<_>>>()?;
    if wavelengths.is_empty() {
        return at.refuse("wavelengths is empty; give at least one, such as [\"632.8nm\"]");
    }
    let keys = [
        "name",
        "width",
        "height",
        "pitch",
        "pitch_x",
        "pitch_y",
        "bits",
        "fill_factor",
        "dead_space",
        "wavelengths",
        "phase_sign",
        "settle_time",
        "refresh",
        "edid",
        "signal",
        "response",
    ];
    if let Some(stray) = file.unverified.iter().find(|key| !keys.contains(&key.as_str())) {
        return at.refuse(format!("unverified names `{stray}`, which is no key of a profile"));
    }
    let modulation = file.kind.modulation();
    let levels = 1usize << file.bits;
    if file.response.is_empty() {
        return at.refuse("no [[response]]; give at least one");
    }
    let responses = file.response.iter().map(|r| response(&at, r, modulation, levels)).collect::<Result<Vec<_>>>()?;
    let signal = signal(&at, file.signal, file.width, file.height, file.bits)?;
    Ok(PanelProfile {
        source: source.to_path_buf(),
        name: file.name,
        maker: file.maker,
        kind: file.kind,
        width: file.width,
        height: file.height,
        pitch_x,
        pitch_y,
        bits: file.bits,
        fill_factor: at.share("fill_factor", file.fill_factor, true)?,
        dead_space: at.share("dead_space", file.dead_space, false)?,
        wavelengths,
        responses,
        phase_sign: file.phase_sign,
        signal,
        settle_time: file.settle_time.map(|t| at.read("settle_time", &t, units::duration)).transpose()?,
        refresh: file.refresh.map(|t| at.read("refresh", &t, units::frequency)).transpose()?,
        edid: file.edid,
        unverified: file.unverified,
    })
}

fn signal(at: &At<'_>, file: Option<SignalFile>, width: usize, height: usize, bits: u8) -> Result<SignalLayout> {
    let Some(file) = file else {
        let layout = SignalLayout::plain(width, height, if bits == 1 { Packing::Gray1 } else { Packing::Gray });
        return layout.check(width, height, bits).map(|()| layout).or_else(|what| at.refuse(what));
    };
    let (signal_width, signal_height) = file.packing.signal_size(width, height);
    let layout = SignalLayout {
        packing: file.packing,
        width: file.width.unwrap_or(signal_width + file.column_offset),
        height: file.height.unwrap_or(signal_height + file.row_offset),
        column_offset: file.column_offset,
        row_offset: file.row_offset,
        flip_x: file.flip_x,
        flip_y: file.flip_y,
    };
    layout.check(width, height, bits).map(|()| layout).or_else(|what| at.refuse(what))
}

fn response(at: &At<'_>, file: &ResponseFile, modulation: Modulation, levels: usize) -> Result<Response> {
    fn need<T: Clone>(at: &At<'_>, value: &Option<T>, key: &str) -> Result<T> {
        value.clone().ok_or_else(|| Error::calibration(at.source, format!("response.{key} is missing")))
    }
    let radians = || -> Result<f64> {
        match need(at, &file.unit, "unit")?.as_str() {
            "rad" => Ok(1.0),
            "pi" => Ok(PI),
            "turn" => Ok(TAU),
            "deg" => Ok(PI / 180.0),
            other => at.refuse(format!("response.unit = `{other}`; use rad, pi, turn or deg")),
        }
    };
    let scaled = |values: Vec<f64>, unit: f64| values.into_iter().map(|v| v * unit).collect::<Vec<_>>();
    let curve = match file.kind {
        CurveKind::Linear => Curve::Linear { levels_for_2pi: need(at, &file.levels_for_2pi, "levels_for_2pi")? },
        CurveKind::Table => Curve::Table { phase: scaled(need(at, &file.values, "values")?, radians()?) },
        CurveKind::Polynomial => {
            Curve::Polynomial { coefficients: scaled(need(at, &file.coefficients, "coefficients")?, radians()?) }
        }
        CurveKind::Piston => Curve::Piston {
            height: need(at, &file.heights, "heights")?
                .iter()
                .map(|text| at.read("response.heights", text, units::length))
                .collect::<Result<_>>()?,
        },
        CurveKind::Amplitude => match &file.values {
            Some(values) => Curve::Transmittance { amplitude: values.clone() },
            None => Curve::LinearAmplitude,
        },
    };
    // Keys of another kind of curve would be silently without effect.
    let used = match file.kind {
        CurveKind::Linear => [true, false, false, false, false],
        CurveKind::Table => [false, true, true, false, false],
        CurveKind::Polynomial => [false, true, false, true, false],
        CurveKind::Piston => [false, false, false, false, true],
        CurveKind::Amplitude => [false, false, true, false, false],
    };
    let given = [
        ("levels_for_2pi", file.levels_for_2pi.is_some()),
        ("unit", file.unit.is_some()),
        ("values", file.values.is_some()),
        ("coefficients", file.coefficients.is_some()),
        ("heights", file.heights.is_some()),
    ];
    if let Some(((key, _), _)) = given.iter().zip(used).find(|((_, given), used)| *given && !used) {
        return at.refuse(format!("response.{key} does not belong to this kind of curve; remove it"));
    }
    if curve.modulation() != modulation {
        return at.refuse(match modulation {
            Modulation::Phase => "response is an amplitude curve, but the panel modulates phase",
            Modulation::Amplitude => "response is a phase curve, but the panel modulates amplitude",
        });
    }
    curve.check(levels, at.source)?;
    let wavelength = match &file.wavelength {
        Some(text) => Some(at.read("response.wavelength", text, units::positive_length)?),
        None => None,
    };
    Ok(Response { wavelength, curve })
}
