//! Calibration files as panel makers write them: read as they are, never rescaled, refused with the line at fault.

use super::drive_curve::non_monotone;
use super::response::Curve;
use super::wavefront::Wavefront;
use crate::error::{Error, Result};
use crate::files::pictures;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Largest calibration file: a 4K wavefront as text takes 40 MB.
const LARGEST: u64 = 256 << 20;

/// A file's bytes, unless it is larger than any calibration.
fn bytes(path: &Path) -> Result<Vec<u8>> {
    let size = std::fs::metadata(path).map_err(Error::io(path))?.len();
    if size > LARGEST {
        return Err(Error::calibration(path, format!("{} MB is no calibration file", size >> 20)));
    }
    std::fs::read(path).map_err(Error::io(path))
}

/// A calibration file as text.
pub(crate) fn text(path: &Path) -> Result<String> {
    String::from_utf8(bytes(path)?).map_err(|_| Error::calibration(path, "is no text"))
}

/// A wavefront correction as an 8-bit gray picture, 0 … 255 for 0 … 2π (256 would be the full turn): Hamamatsu's
/// `CAL_LSH<serial>_<nm>nm.bmp`, Meadowlark's wavefront images.
///
/// `wavelength` [m] overrules the one in a name that ends in `_<nm>nm`.
///
/// # Errors
/// [`Error::Calibration`] when the file is no 8-bit gray picture.
pub fn wavefront_picture(path: &Path, wavelength: Option<f64>) -> Result<Wavefront> {
    let bytes = self::bytes(path)?;
    let unreadable = |e: image::ImageError| Error::calibration(path, format!("not a readable picture: {e}"));
    let format = image::guess_format(&bytes).map_err(unreadable)?;
    // A name that says bitmap over a TIFF is a damaged file, and TIFF's reader is the least strict.
    let named = path.extension().and_then(image::ImageFormat::from_extension);
    if format == image::ImageFormat::Tiff && named != Some(format) {
        return Err(Error::calibration(path, "is a TIFF by its content and not by its name; rename it"));
    }
    let unreadable = |why: String| Error::calibration(path, format!("not a readable picture: {why}"));
    let picture = pictures::decode(&bytes).map_err(unreadable)?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let gray: Vec<u8> = match picture {
        image::DynamicImage::ImageLuma8(gray) => gray.into_raw(),
        // A palette of grays is decoded to colour.
        image::DynamicImage::ImageRgb8(rgb) if rgb.pixels().all(|p| p.0[0] == p.0[1] && p.0[1] == p.0[2]) => {
            rgb.pixels().map(|p| p.0[0]).collect()
        }
        _ => return Err(Error::calibration(path, "a wavefront correction is an 8-bit gray picture")),
    };
    let phase = gray.iter().map(|&v| (f64::from(v) / 256.0 * TAU) as f32).collect();
    let name = path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned());
    Wavefront::new(&name, width, height, wavelength.or_else(|| wavelength_in_name(&name)), phase)
}

/// The wavelength [m] that a name like `CAL_LSH0801234_633nm.bmp` ends in.
fn wavelength_in_name(name: &str) -> Option<f64> {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let number = stem.to_ascii_lowercase();
    let number = number.strip_suffix("nm")?;
    let number = number.rsplit(|c: char| !(c.is_ascii_digit() || c == '.')).next()?;
    number.parse::<f64>().ok().filter(|nm| *nm > 0.0).map(|nm| nm * 1e-9)
}

/// Lines of numbers, with their line numbers; empty lines and lines that begin with `#` or `;` are passed over.
fn rows(path: &Path, text: &str, columns: usize) -> Result<Vec<(usize, Vec<f64>)>> {
    let mut out = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with(['#', ';']) {
            continue;
        }
        let words: Vec<&str> = line.split([' ', '\t', ',']).filter(|word| !word.is_empty()).collect();
        let values: Option<Vec<f64>> =
            words.iter().map(|word| word.parse::<f64>().ok().filter(|v| v.is_finite())).collect();
        match values {
            Some(values) if values.len() == columns => out.push((number + 1, values)),
            _ => {
                let what = format!("line {}: `{line}` is not {columns} numbers", number + 1);
                return Err(Error::calibration(path, what));
            }
        }
    }
    Ok(out)
}

/// Hamamatsu's `.lut`: lines of phase and gray level, for a panel of `levels` levels.
///
/// The file does not name the phase's unit: it is told by its greatest value (about 2 for π, 2π for radians, 1 for turns),
/// and refused when that is none of them. Levels between the lines are interpolated, those beyond the last continue its
/// slope.
///
/// # Errors
/// [`Error::Calibration`] for damaged or too few lines, a curve that turns back, an unknown unit.
pub fn hamamatsu_lut(path: &Path, levels: usize) -> Result<Curve> {
    let text = self::text(path)?;
    let rows = rows(path, &text, 2)?;
    if rows.len() < 16 {
        let what = format!("{} lines of phase and level; such a table has 128: the file is cut short", rows.len());
        return Err(Error::calibration(path, what));
    }
    for (i, name) in [(0, "phase"), (1, "level")] {
        let column: Vec<f64> = rows.iter().map(|(_, values)| values[i]).collect();
        if let Some(at) = non_monotone(&column).or((column[0] > column[1]).then_some(1)) {
            return Err(Error::calibration(path, format!("line {}: the {name} does not rise", rows[at].0)));
        }
    }
    let greatest = rows[rows.len() - 1].1[0];
    let unit = match greatest {
        g if (0.8..1.3).contains(&g) => TAU,
        g if (1.6..2.7).contains(&g) => PI,
        g if (5.0..8.5).contains(&g) => 1.0,
        _ => {
            let what = format!("the phase ends at {greatest}: neither turns (1), π (2) nor radians (6.28)");
            return Err(Error::calibration(path, what));
        }
    };
    let phase = (0..levels)
        .map(|level| {
            let level = level as f64;
            let after = rows.partition_point(|(_, v)| v[1] < level).clamp(1, rows.len() - 1);
            let [low, high] = [&rows[after - 1].1, &rows[after].1];
            unit * (low[0] + (level - low[1]) / (high[1] - low[1]) * (high[0] - low[0]))
        })
        .collect();
    Ok(Curve::Table { phase })
}

/// A controller's table: what a head is sent for each gray level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelTable {
    /// Output for each input level.
    pub output: Vec<u16>,
}

/// Meadowlark's `.lut`: lines of input and output, 256 of them (16,384 on old boards), whatever the output's greatest
/// value; nothing is rescaled.
///
/// # Errors
/// [`Error::Calibration`] for damaged lines, inputs that do not count 0, 1, 2 …, outputs that are no 16-bit integers, a
/// number of lines that is no power of two from 256 on.
pub fn meadowlark_lut(path: &Path) -> Result<LevelTable> {
    let text = self::text(path)?;
    let rows = rows(path, &text, 2)?;
    let mut output = Vec::with_capacity(rows.len());
    for (index, (line, values)) in rows.iter().enumerate() {
        if values[0] != index as f64 {
            let what = format!("line {line}: input {} where {index} is due", values[0]);
            return Err(Error::calibration(path, what));
        }
        if values[1].fract() != 0.0 || !(0.0..=65535.0).contains(&values[1]) {
            let what = format!("line {line}: output {} is no integer of 0 … 65535", values[1]);
            return Err(Error::calibration(path, what));
        }
        output.push(values[1] as u16);
    }
    if output.len() < 256 || !output.len().is_power_of_two() {
        let what = format!("{} lines; a table has 256 (old boards 16384): the file is cut short", output.len());
        return Err(Error::calibration(path, what));
    }
    Ok(LevelTable { output })
}

/// Santec's CSV: `Y/X,0,1,…`, then `y,v0,v1,…` with integers 0 … 1023 for 0 … 2π. Returns width, height and values.
///
/// # Errors
/// [`Error::Calibration`] with the line for a head, a row or a value that is not right.
pub fn santec_csv(path: &Path) -> Result<(usize, usize, Vec<u16>)> {
    let text = self::text(path)?;
    let refuse = |line: usize, what: String| Err(Error::calibration(path, format!("line {line}: {what}")));
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let head = lines.next().map_or("", |(_, line)| line.trim().trim_start_matches('\u{feff}'));
    let mut columns = head.split(',');
    if columns.next() != Some("Y/X") {
        return refuse(1, "the file does not begin with `Y/X,0,1,…`".into());
    }
    let mut width = 0;
    for column in columns {
        if column.trim().parse::<usize>() != Ok(width) {
            return refuse(1, format!("column `{column}` where {width} is due"));
        }
        width += 1;
    }
    if width == 0 {
        return refuse(1, "no columns".into());
    }
    let (mut values, mut height) = (Vec::new(), 0);
    for (number, line) in lines {
        let mut words = line.trim().split(',');
        if words.next().map(str::trim).and_then(|word| word.parse::<usize>().ok()) != Some(height) {
            return refuse(number + 1, format!("the row does not begin with {height}"));
        }
        let before = values.len();
        for word in words {
            match word.trim().parse::<u16>() {
                Ok(value) if value < 1024 => values.push(value),
                _ => return refuse(number + 1, format!("`{}` is no integer of 0 … 1023", word.trim())),
            }
        }
        if values.len() - before != width {
            return refuse(number + 1, format!("{} values; the head names {width} columns", values.len() - before));
        }
        height += 1;
    }
    if height == 0 {
        return refuse(2, "no rows".into());
    }
    Ok((width, height, values))
}

/// The same file as a wavefront, at the wavelength [m] that was set in the controller.
pub fn santec_wavefront(path: &Path, wavelength: Option<f64>) -> Result<Wavefront> {
    let (width, height, values) = santec_csv(path)?;
    let phase = values.iter().map(|&v| (f64::from(v) / 1024.0 * TAU) as f32).collect();
    Wavefront::new(&path.display().to_string(), width, height, wavelength, phase)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fmt::Write as _;

    fn file(name: &str, text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("write");
        (folder, path)
    }

    fn refused<T: std::fmt::Debug>(result: Result<T>, word: &str) {
        let error = result.expect_err(word);
        let text = error.to_string();
        assert!(matches!(error, Error::Calibration { .. }) && text.contains(word) && !text.contains('\n'), "{text}");
    }

    #[test]
    fn hamamatsu_pictures_and_tables_are_read_as_they_are() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("CAL_LSH0801234_633nm.bmp");
        image::GrayImage::from_fn(6, 4, |x, y| image::Luma([(40 * x + y) as u8])).save(&path).expect("save");
        let wavefront = wavefront_picture(&path, None).expect("wavefront");
        assert_eq!((wavefront.width, wavefront.height), (6, 4));
        assert!((wavefront.wavelength.expect("nm") - 633e-9).abs() < 1e-15);
        assert!((f64::from(wavefront.phase[6 + 2]) - 81.0 / 256.0 * TAU).abs() < 1e-6);
        image::RgbImage::from_fn(6, 4, |x, _| image::Rgb([x as u8, 0, 0])).save(&path).expect("save");
        refused(wavefront_picture(&path, None), "gray");

        for (unit, full) in [("turn", 1.0), ("pi", 2.0), ("rad", TAU)] {
            let mut text = String::new();
            for i in 0..128 {
                // A curve bent by a square root; 210 levels make a turn.
                let level = 210.0 * i as f64 / 127.0;
                let _ = writeln!(text, "{:.6}\t{level:.4}", full * (level / 210.0).powf(1.2));
            }
            let (_folder, path) = file("x.lut", &text);
            let Curve::Table { phase } = hamamatsu_lut(&path, 256).expect(unit) else { panic!("a table") };
            for level in [0, 50, 105, 210] {
                let truth = TAU * (f64::from(level) / 210.0).powf(1.2);
                assert!((phase[level as usize] - truth).abs() < 2e-3, "{unit} {level}: {}", phase[level as usize]);
            }
            assert!(non_monotone(&phase).is_none());
        }
        let good: String = (0..128).map(|i| format!("{}\t{}\n", f64::from(i) / 64.0, 2 * i)).collect();
        let check = |text: &str, word: &str| {
            let (_folder, path) = file("x.lut", text);
            refused(hamamatsu_lut(&path, 256), word);
        };
        check(&good.replace("\t64\n", "\t60\n"), "line 33");
        check(&good.replace("0.5\t64\n", "half\t64\n"), "line 33");
        check(&good.lines().take(8).map(|line| format!("{line}\n")).collect::<String>(), "cut short");
        check(&good.replace('.', ""), "phase");
    }

    #[test]
    fn meadowlark_tables_keep_their_numbers_and_damage_is_named_by_its_line() {
        for (separator, greatest) in [(" ", 2047), ("\t", 4096), ("  ", 65535)] {
            let text: String = (0..256).map(|i| format!("{i}{separator}{} \r\n", greatest * i / 255)).collect();
            let (_folder, path) = file("slm.lut", &text);
            let table = meadowlark_lut(&path).expect("table");
            assert_eq!((table.output.len(), table.output[255]), (256, greatest as u16));
            let check = |from: &str, to: &str, word: &str| {
                let (_folder, path) = file("slm.lut", &text.replacen(from, to, 1));
                refused(meadowlark_lut(&path), word);
            };
            check(&format!("17{separator}"), &format!("18{separator}"), "line 18");
            check(&format!("255{separator}{greatest}"), &format!("255{separator}70000"), "line 256");
            check(&format!("255{separator}{greatest}"), "", "cut short");
            check(&format!("100{separator}"), "x ", "line 101");
        }
    }

    #[test]
    fn santec_files_are_read_and_damage_is_named_by_its_line() {
        let good = "Y/X,0,1,2\r\n0,0,512,1023\r\n1,1,2,3\r\n";
        let (_folder, path) = file("a.csv", good);
        assert_eq!(santec_csv(&path).expect("csv"), (3, 2, vec![0, 512, 1023, 1, 2, 3]));
        let wavefront = santec_wavefront(&path, Some(633e-9)).expect("wavefront");
        assert!((wavefront.phase[1] - PI as f32).abs() < 1e-6);
        for (from, to, word) in [
            ("Y/X", "X/Y", "line 1"),
            ("0,1,2\r", "0,2,1\r", "line 1"),
            ("1023", "1024", "line 2"),
            ("1,1,2,3", "2,1,2,3", "line 3"),
            ("1,1,2,3", "1,1,2", "line 3: 2 values"),
            ("1,1,2,3", "1,1,2,-3", "line 3"),
            ("\r\n0,0,512,1023\r\n1,1,2,3\r\n", "", "no rows"),
        ] {
            let (_folder, path) = file("a.csv", &good.replacen(from, to, 1));
            refused(santec_csv(&path), word);
        }
    }
}
