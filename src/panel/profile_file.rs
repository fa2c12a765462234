//! Panel profiles read from TOML: units and domains of the file's keys.

use super::drive_curve::Modulation;
use super::embedded::PROFILES;
use super::profile::{CorrectionFile, PanelKind, PanelProfile};
use super::profile_keys::{CorrectionEntry, CurveKind, ProfileFile, ResponseFile, SignalFile};
use super::response::{Curve, Response};
use super::signal::{Packing, SignalLayout};
use super::vendor;
use crate::config::ConfigFile;
use crate::error::{Error, Result};
use crate::names;
use crate::units;
use std::f64::consts::{PI, TAU};
use std::path::Path;

impl PanelProfile {
    /// The embedded default.
    pub fn generic() -> Result<Self> {
        Self::find("generic")
    }

    /// An embedded profile by name, or else the TOML file at that path.
    ///
    /// # Errors
    /// [`Error::Calibration`] when there is neither, or when the file is not a right profile.
    pub fn find(name: &str) -> Result<Self> {
        if let Some((_, text)) = PROFILES.iter().find(|(known, _)| *known == name) {
            return Self::parse(text, Path::new(name));
        }
        let path = Path::new(name);
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) || path.exists() {
            return Self::read(path);
        }
        let names: Vec<_> = Self::embedded_names().collect();
        let meant = names::meant(name, &names);
        Err(Error::calibration(
            name,
            format!("no such panel; {meant}give a .toml file or one of: {}", names.join(", ")),
        ))
    }

    /// The TOML of an embedded profile, as it stands in `calib/`: what one's own begins with.
    pub fn embedded_text(name: &str) -> Option<&'static str> {
        PROFILES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
    }

    /// Names of the embedded profiles.
    pub fn embedded_names() -> impl Iterator<Item = &'static str> {
        PROFILES.iter().map(|(name, _)| *name)
    }

    /// Reads a profile from a TOML file.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::io(path))?;
        Self::parse(&text, path)
    }

    /// Reads a profile from TOML text; `source` stands in errors.
    pub fn parse(text: &str, source: &Path) -> Result<Self> {
        parse(text, source)
    }
}

fn parse(text: &str, source: &Path) -> Result<PanelProfile> {
    let at = ConfigFile { source };
    let file: ProfileFile = at.parse(text)?;
    // Before tables of so many levels are read.
    if !(1..=16).contains(&file.bits) {
        return at.refuse(format!("bits = {} must be 1 … 16", file.bits));
    }
    // Before the signal is found too narrow for them.
    if file.kind == PanelKind::BinaryDmd && file.bits != 1 {
        return at
            .refuse(format!("bits = {} on a binary-dmd: its mirrors have two positions, write bits = 1", file.bits));
    }
    let [pitch_x, pitch_y] = at.pitches(&file.pitch, [&file.pitch_x, &file.pitch_y])?;
    let wavelengths = file
        .wavelengths
        .iter()
        .map(|text| at.read("wavelengths", text, units::wavelength))
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
        "crosstalk",
        "unmodulated",
        "beam",
        "wavelengths",
        "phase_sign",
        "settle_time",
        "refresh",
        "edid",
        "note",
        "command",
        "signal",
        "correction",
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
    let correction = |entry: &CorrectionEntry| {
        let read = |text| at.read("correction.wavelength", text, units::wavelength);
        let wavelength = entry.wavelength.as_ref().map(read).transpose()?;
        Ok(CorrectionFile { file: at.beside(&entry.file), wavelength })
    };
    let corrections = file.correction.iter().map(correction).collect::<Result<Vec<_>>>()?;
    if !corrections.is_empty() && modulation == Modulation::Amplitude {
        return at.refuse("a [[correction]] needs a panel that modulates phase");
    }
    let profile = PanelProfile {
        source: source.to_path_buf(),
        name: file.name,
        maker: file.maker,
        kind: file.kind,
        width: file.width,
        height: file.height,
        pitch_x,
        pitch_y,
        bits: file.bits,
        fill_factor: at.within("fill_factor", file.fill_factor, 0.0..=1.0)?,
        dead_space: at.within("dead_space", file.dead_space, 0.0..=1.0)?,
        wavelengths,
        responses,
        phase_sign: file.phase_sign,
        signal,
        settle_time: file.settle_time.map(|t| at.read("settle_time", t, units::duration)).transpose()?,
        refresh: file.refresh.map(|t| at.read("refresh", t, units::frequency)).transpose()?,
        edid: file.edid,
        corrections,
        command: file.command,
        note: file.note,
        crosstalk: file.crosstalk,
        unmodulated: at.within("unmodulated", file.unmodulated, 0.0..=1.0)?,
        beam: file.beam.map(|path| at.beside(&path)),
        unverified: file.unverified,
    };
    profile.check().map(|()| profile).or_else(|what| at.refuse(what))
}

fn signal(
    at: &ConfigFile<'_>,
    file: Option<SignalFile>,
    width: usize,
    height: usize,
    bits: u8,
) -> Result<SignalLayout> {
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

fn response(at: &ConfigFile<'_>, file: &ResponseFile, modulation: Modulation, levels: usize) -> Result<Response> {
    fn need<T: Clone>(at: &ConfigFile<'_>, value: &Option<T>, key: &str) -> Result<T> {
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
        CurveKind::LevelTable => Curve::LevelTable { output: need(at, &file.levels, "levels")? },
        CurveKind::Regional => {
            let [columns, rows] = need(at, &file.regions, "regions")?;
            let unit = radians()?;
            let curves = match (&file.polynomials, &file.tables) {
                (Some(each), None) => {
                    let curve = |c: &Vec<f64>| Curve::Polynomial { coefficients: scaled(c.clone(), unit) };
                    each.iter().map(curve).collect()
                }
                (None, Some(each)) => {
                    each.iter().map(|phase| Curve::Table { phase: scaled(phase.clone(), unit) }).collect()
                }
                _ => return at.refuse("a regional response needs response.polynomials or response.tables"),
            };
            Curve::Regional { columns, rows, curves }
        }
        CurveKind::HamamatsuLut => vendor::hamamatsu_lut(&at.beside(&need(at, &file.file, "file")?), levels)?,
        CurveKind::MeadowlarkLut => {
            Curve::LevelTable { output: vendor::meadowlark_lut(&at.beside(&need(at, &file.file, "file")?))?.output }
        }
        CurveKind::Amplitude => match &file.values {
            Some(values) => Curve::Transmittance { amplitude: values.clone() },
            None => Curve::LinearAmplitude,
        },
    };
    // Keys of another kind of curve would be silently without effect.
    let used: &[&str] = match file.kind {
        CurveKind::Linear => &["levels_for_2pi"],
        CurveKind::Table => &["unit", "values"],
        CurveKind::Polynomial => &["unit", "coefficients"],
        CurveKind::Piston => &["heights"],
        CurveKind::Amplitude => &["values"],
        CurveKind::LevelTable => &["levels"],
        CurveKind::Regional => &["unit", "regions", "polynomials", "tables"],
        CurveKind::HamamatsuLut | CurveKind::MeadowlarkLut => &["file"],
    };
    let given = [
        ("levels_for_2pi", file.levels_for_2pi.is_some()),
        ("unit", file.unit.is_some()),
        ("values", file.values.is_some()),
        ("coefficients", file.coefficients.is_some()),
        ("heights", file.heights.is_some()),
        ("levels", file.levels.is_some()),
        ("regions", file.regions.is_some()),
        ("polynomials", file.polynomials.is_some()),
        ("tables", file.tables.is_some()),
        ("file", file.file.is_some()),
    ];
    if let Some((key, _)) = given.iter().find(|(key, given)| *given && !used.contains(key)) {
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
        Some(text) => Some(at.read("response.wavelength", text, units::wavelength)?),
        None => None,
    };
    Ok(Response { wavelength, curve })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panel::{PanelCommands, PhaseSign};

    #[test]
    fn every_embedded_profile_is_right_and_named_as_its_file() {
        for (name, text) in PROFILES {
            let profile = PanelProfile::parse(text, Path::new(name)).expect(name);
            assert_eq!(profile.name, *name);
            let (curve, _) = profile.drive_curve(profile.default_wavelength()).expect(name);
            assert_eq!(curve.levels(), profile.levels());
            assert_eq!(profile.warnings().is_empty(), profile.unverified.is_empty());
            assert_eq!(PanelProfile::find(name).expect(name), profile);
        }
        let files = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/calib")).expect("calib");
        // Plates lie beside the panels.
        let is_plate = |file: &std::fs::DirEntry| file.file_name().to_string_lossy().starts_with("plate-");
        let files = files.filter(|file| !is_plate(file.as_ref().expect("entry"))).count();
        assert_eq!(files, PROFILES.len(), "a file of calib/ is not embedded");
        let generic = PanelProfile::generic().expect("generic");
        assert_eq!((generic.width, generic.height, generic.bits), (1920, 1080, 8));
        assert_eq!((generic.pitch_x, generic.pitch_y, generic.default_wavelength()), (8e-6, 8e-6, 632.8e-9));
        assert_eq!(generic.drive_curve(450e-9).expect("curve").0.nearest(PI).0, 128);
    }

    #[test]
    fn a_written_profile_is_read_back_the_same() {
        for (name, text) in PROFILES {
            let profile = PanelProfile::parse(text, Path::new(name)).expect(name);
            let again =
                PanelProfile::parse(&profile.to_toml(&["remark".into()]).expect(name), Path::new(name)).expect(name);
            assert_eq!(again, profile, "{name}");
        }
        let mut profile = PanelProfile::generic().expect("generic");
        profile.name = "with \"quotes\" and \\".into();
        profile.source = "x.toml".into();
        profile.pitch_y = 6.4e-6;
        profile.phase_sign = PhaseSign::Decreasing;
        profile.settle_time = Some(0.0123456789);
        profile.crosstalk = 0.35;
        profile.unmodulated = 0.07;
        profile.beam = Some("beam.npy".into());
        profile.note = Some("with the \"VIS\" table loaded".into());
        profile.command = Some(PanelCommands { before: Some("slmctl on --port 'COM 3'".into()), after: None });
        profile.corrections = vec![CorrectionFile { file: "flat.npy".into(), wavelength: Some(532.123456789e-9) }];
        let polynomial = |range: f64| Curve::Polynomial { coefficients: vec![0.0, range, 0.1] };
        let curves = vec![polynomial(6.0), polynomial(6.1), polynomial(6.2)];
        profile.responses = vec![
            Response { wavelength: Some(532e-9), curve: Curve::Regional { columns: 3, rows: 1, curves } },
            Response { wavelength: Some(640e-9), curve: polynomial(5.5) },
            Response { wavelength: None, curve: Curve::LevelTable { output: (0..128).map(|g| 2 * g).collect() } },
        ];
        let again = PanelProfile::parse(&profile.to_toml(&[]).expect("toml"), Path::new("x.toml")).expect("read");
        assert_eq!(again, profile);
    }

    #[test]
    fn vendor_tables_named_in_a_profile_are_applied() {
        let folder = tempfile::tempdir().expect("folder");
        let table: String = (0..256).map(|g| format!("{g} {}\n", 20 + g * 4 / 5)).collect();
        std::fs::write(folder.path().join("slm.lut"), &table).expect("write");
        let linear = "kind = \"linear\"\nlevels_for_2pi = 256";
        let text = PROFILES[0].1.replace(linear, "kind = \"meadowlark-lut\"\nfile = \"slm.lut\"");
        let path = folder.path().join("mine.toml");
        std::fs::write(&path, &text).expect("write");
        let profile = PanelProfile::read(&path).expect("profile");
        let (curve, _) = profile.drive_curve(633e-9).expect("curve");
        // Gray 128 is half a turn and goes out as 20 + 102.
        assert_eq!(curve.nearest(PI).0, 122);
        let lut: String = (0..128).map(|i| format!("{}\t{}\n", f64::from(i) / 64.0, f64::from(i) * 1.7)).collect();
        std::fs::write(folder.path().join("slm.lut"), &lut).expect("write");
        std::fs::write(&path, text.replace("meadowlark", "hamamatsu")).expect("write");
        let (curve, _) = PanelProfile::read(&path).expect("profile").drive_curve(633e-9).expect("curve");
        // π at line 64: level 108.8.
        assert_eq!(curve.nearest(PI).0, 109);
        std::fs::write(folder.path().join("slm.lut"), "0 0\n1 x\n").expect("write");
        let error = PanelProfile::read(&path).expect_err("damaged").to_string();
        assert!(error.contains("slm.lut") && error.contains("line 2"), "{error}");
    }

    #[test]
    fn bad_profiles_are_refused_in_one_line_that_names_file_and_key() {
        let good = PROFILES[0].1;
        let dmd = PROFILES.iter().find(|(name, _)| *name == "ti-dlp4710").expect("dmd").1;
        let cases = [
            (good.replace("pitch = \"8um\"", ""), "pitch_x is missing"),
            (good.replace("pitch =", "pich ="), "pich"),
            (good.replace("\"8um\"", "\"0um\""), "greater than zero"),
            (good.replace("\"8um\"", "\"-8um\""), "greater than zero"),
            (good.replace("\"8um\"", "8e-6"), "with its unit"),
            (good.replace("\"8um\"", "\"8\""), "no unit"),
            (good.replace("\"8um\"", "\"8parsec\""), "unknown unit"),
            (good.replace("\"8um\"", "\"8um\"\npitch_x = \"8um\""), "stands beside pitch"),
            (good.replace("width = 1920", "width = 0"), "width"),
            (good.replace("width = 1920", ""), "width"),
            (good.replace("name = \"generic\"", ""), "name"),
            (good.replace("bits = 8", "bits = 0"), "bits = 0"),
            (good.replace("bits = 8", "bits = 12"), "carries 8 bits"),
            (good.replace("0.93", "1.5"), "fill_factor"),
            (good.replace("0.93", "0"), "fill_factor"),
            (good.replace("0.93", "nan"), "fill_factor"),
            (good.replace("[\"632.8nm\"]", "[]"), "wavelengths is empty"),
            (good.replace("phase-lcos", "lcos"), "lcos"),
            (good.replace("refresh = \"60Hz\"", "refresh = \"60\""), "no unit"),
            (good.replace("refresh = \"60Hz\"", "unverified = [\"colour\"]"), "colour"),
            (good.replace("levels_for_2pi = 256", ""), "levels_for_2pi is missing"),
            (good.replace("levels_for_2pi = 256", "levels_for_2pi = 0"), "greater than 1"),
            (good.replace("levels_for_2pi = 256", "levels_for_2pi = 256\nheights = []"), "does not belong"),
            (good.replace("levels_for_2pi = 256", "levels_for_2pi = 256\ngamma = 2"), "gamma"),
            (good.replace("kind = \"linear\"\nlevels_for_2pi = 256", "kind = \"amplitude\""), "modulates phase"),
            (
                good.replace("\"linear\"\nlevels_for_2pi = 256", "\"table\"\nunit = \"pi\"\nvalues = [0.0, 1.0]"),
                "256 levels",
            ),
            (good.replace("\"linear\"\nlevels_for_2pi = 256", "\"table\"\nunit = \"grad\"\nvalues = [0.0]"), "grad"),
            (
                good.replace(
                    "\"linear\"\nlevels_for_2pi = 256",
                    "\"polynomial\"\nunit = \"rad\"\ncoefficients = [0.0, 1.0, -1.0]",
                ),
                "turns back",
            ),
            (good.replace("[[response]]", "[[answer]]"), "answer"),
            (good.replace("[[response]]", "[signal]\npacking = \"santec\"\n[[response]]"), "santec"),
            (good.replace("[[response]]", "[signal]\npacking = \"gray\"\nwidth = 1900\n[[response]]"), "too small"),
            (dmd.replace("bits = 1", "bits = 8"), "two positions"),
            ("]".to_owned(), "line 1"),
            (String::new(), "name"),
        ];
        for (text, word) in cases {
            let error = PanelProfile::parse(&text, Path::new("mine.toml")).expect_err(word);
            let line = error.to_string();
            assert!(matches!(error, Error::Calibration { .. }), "{line}");
            assert!(line.starts_with("mine.toml: ") && line.contains(word) && !line.contains('\n'), "{word}: {line}");
        }
        assert!(PanelProfile::find("no-such-panel").expect_err("name").to_string().contains("generic"));
        assert!(matches!(PanelProfile::find("missing.toml"), Err(Error::Io { .. })));
    }

    #[test]
    fn curves_far_from_the_light_are_refused_and_near_ones_warned_of() {
        let text = PROFILES[0].1.replace("levels_for_2pi = 256", "wavelength = \"632.8nm\"\nlevels_for_2pi = 200");
        let profile = PanelProfile::parse(&text, Path::new("mine.toml")).expect("profile");
        assert!(profile.drive_curve(633e-9).expect("same").1.is_empty());
        let (curve, warnings) = profile.drive_curve(532e-9).expect("near");
        assert_eq!(warnings.len(), 1);
        // The path is kept: fewer levels make a turn of a shorter wave.
        let levels = curve.levels_for_2pi().expect("phase");
        assert!((levels / (200.0 * 532.0 / 632.8) - 1.0).abs() < 1e-9, "{levels}");
        assert!(profile.drive_curve(405e-9).expect_err("far").to_string().contains("405nm"));
    }
}
