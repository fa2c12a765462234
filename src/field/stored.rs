//! Fields, phases and drive levels as files: ours with their metadata beside them, and those of other programs.
//!
//! What the numbers are says what they mean: complex numbers are a field, floats are phases [rad] of amplitude 1, whole
//! numbers are drive levels of a panel.

use super::arrays::{self, Array, Named, Values};
use super::npy::{self, Content, FieldMetadata};
use crate::error::{Error, Result};
use crate::field::{Complex32, Complex64, Field, Grid, grid};
use std::path::Path;

/// What a file holds, on its rows and columns.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Complex amplitudes.
    Complex(Vec<Complex32>),
    /// Phases of amplitude 1 [rad].
    Phases(Vec<f64>),
    /// Drive levels.
    Levels(Vec<u16>),
}

/// A file's samples with what is known of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Samples, row by row, row 0 on top.
    pub samples: Samples,
    /// What stands beside the file, if anything does.
    pub metadata: Option<FieldMetadata>,
    /// What was read of the file, in words.
    pub origin: String,
    /// What a user should know.
    pub warnings: Vec<String>,
}

/// Reads a field, phases or levels from any kind of file that [`arrays::read`] reads.
///
/// # Errors
/// As [`arrays::read`] and [`Array::picture`]; [`Error::Input`] for values that are not finite, and whole numbers below 0 or
/// above 65535.
pub fn read(path: &Path) -> Result<Stored> {
    let array = arrays::read(path)?;
    let metadata = npy::read_metadata(&arrays::split(path).0)?;
    of_array(path, array, metadata)
}

fn of_array(path: &Path, array: Array, metadata: Option<FieldMetadata>) -> Result<Stored> {
    let parts = array.parts().map_or(String::new(), |parts| format!(", {parts}"));
    let origin = format!("{}{parts}", array.origin);
    let (width, height, values) = array.picture(path)?;
    let refused =
        |i: usize, what: &str| Error::input(path, format!("value at row {}, column {} {what}", i / width, i % width));
    let mut warnings = Vec::new();
    let samples = match values {
        Values::Complex(values) => {
            if let Some(i) = values.iter().position(|u| !(u.re.is_finite() && u.im.is_finite())) {
                return Err(refused(i, "is not finite"));
            }
            Samples::Complex(values)
        }
        Values::Real(values) => {
            if let Some(i) = values.iter().position(|p| !p.is_finite()) {
                return Err(refused(i, "is not finite"));
            }
            warnings.extend(like_levels(path, &values));
            Samples::Phases(values)
        }
        Values::Whole(values) => {
            if let Some(i) = values.iter().position(|v| !(0..=65535).contains(v)) {
                let what =
                    format!("is {}: whole numbers are drive levels, 0 to 65535; save phases as floats", values[i]);
                return Err(refused(i, &what));
            }
            Samples::Levels(values.into_iter().map(|v| v as u16).collect())
        }
    };
    Ok(Stored { width, height, samples, metadata, origin, warnings })
}

/// What is said of floats that are whole numbers as drive levels are: a conversion too many.
fn like_levels(path: &Path, values: &[f64]) -> Option<String> {
    let largest = values.iter().fold(0.0, |a: f64, &v| a.max(v));
    let whole = values.iter().all(|v| v.fract() == 0.0 && (0.0..=255.0).contains(v));
    (whole && largest > 1.0).then(|| {
        format!(
            "{}: its floats are all whole numbers from 0 to {largest}, and are taken as phases in radians; if they are drive \
             levels, save them as uint8",
            path.display()
        )
    })
}

impl Stored {
    /// The field of complex samples or phases; `pitch` and `wavelength` [m], where given, stand before what the file says.
    ///
    /// # Errors
    /// [`Error::Input`] for drive levels, and where pitch or wavelength are not known or not positive.
    pub fn field(
        &self,
        path: &Path,
        pitch: Option<[f64; 2]>,
        wavelength: Option<f64>,
    ) -> Result<(Field, FieldMetadata)> {
        let beside = self.metadata.as_ref();
        let missing = |what: &str| {
            let beside = npy::metadata_path(&arrays::split(path).0);
            Error::input(path, format!("its {what} is not known: no {} beside it; give the {what}", beside.display()))
        };
        let wavelength = wavelength.or(beside.map(|m| m.wavelength)).ok_or_else(|| missing("wavelength"))?;
        let pitch = pitch.or(beside.map(|m| m.pitch)).ok_or_else(|| missing("pitch"))?;
        grid::light(wavelength).map_err(|e| Error::input(path, e.to_string()))?;
        let center = beside.map_or([0.0; 2], |m| m.center);
        let grid = Grid::new(self.width, self.height, pitch[0], pitch[1])?.centered_at(center);
        let samples = match &self.samples {
            Samples::Complex(samples) => samples.clone(),
            Samples::Phases(phases) => phases.iter().map(|p| turn(*p)).collect(),
            Samples::Levels(_) => {
                let what = "holds whole numbers, which are drive levels; a field is complex, phases are floats [rad]";
                return Err(Error::input(path, what));
            }
        };
        let content = beside.map_or_else(Content::default, |m| m.content);
        let origin = beside.map_or_else(String::new, |m| m.origin.clone());
        let metadata = FieldMetadata { wavelength, pitch, center, content, origin };
        Ok((Field::new(grid, wavelength, samples)?, metadata))
    }
}

fn turn(phase: f64) -> Complex32 {
    let u = Complex64::cis(phase);
    Complex32::new(u.re as f32, u.im as f32)
}

/// Reads a field with its metadata; `pitch` and `wavelength` [m], where given, stand before what the file says.
///
/// # Errors
/// As [`read`] and [`Stored::field`].
pub fn read_field(path: &Path, pitch: Option<[f64; 2]>, wavelength: Option<f64>) -> Result<(Field, FieldMetadata)> {
    read(path)?.field(path, pitch, wavelength)
}

/// Writes the field in the kind of file that the name says (`.npy` of complex64, `.mat` and `.h5` with the variables `U`,
/// `wavelength` and `pitch`), and its metadata beside it.
///
/// # Errors
/// As [`arrays::write`].
pub fn write_field(path: &Path, field: &Field, content: &Content, origin: &str) -> Result<()> {
    let Grid { width, height, pitch_x, pitch_y, center } = field.grid;
    let lengths = [Values::Real(vec![field.wavelength]), Values::Real(vec![pitch_x, pitch_y])];
    let samples = Values::Complex(field.samples.clone());
    let named = |name, shape, values| Named { name, shape, values };
    let all = [
        named("U", [height, width], &samples),
        named("wavelength", [1, 1], &lengths[0]),
        named("pitch", [1, 2], &lengths[1]),
    ];
    arrays::write(path, &all)?;
    let metadata = FieldMetadata {
        wavelength: field.wavelength,
        pitch: [pitch_x, pitch_y],
        center,
        content: *content,
        origin: if origin.ends_with(npy::CONVENTION) {
            origin.into()
        } else {
            format!("{origin}; {}", npy::CONVENTION)
        },
    };
    npy::write_metadata(path, &metadata)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_comes_back_as_it_was_in_each_kind_of_file() {
        let folder = tempfile::tempdir().expect("folder");
        let grid = Grid::new(5, 3, 8e-6, 9e-6).expect("grid").centered_at([1e-3, -2e-3]);
        let samples = (0..15).map(|i| Complex32::new(i as f32, -0.5 * i as f32)).collect();
        let field = Field::new(grid, 532e-9, samples).expect("field");
        let content = Content { z: 0.25, depth: Some([-0.1, -0.2]), ..Content::default() };
        for name in ["u.npy", "u.mat"] {
            let path = folder.path().join(name);
            write_field(&path, &field, &content, "test").expect("write");
            let (back, metadata) = read_field(&path, None, None).expect("read");
            assert_eq!(back, field, "{name}");
            assert_eq!(metadata.content, content);
            std::fs::remove_file(npy::metadata_path(&path)).expect("remove");
            let refused = read_field(&path, Some([8e-6, 9e-6]), None).unwrap_err().to_string();
            assert!(refused.contains("give the wavelength"), "{refused}");
        }
        for name in ["u.tif", "u.xyz"] {
            let path = folder.path().join(name);
            assert!(write_field(&path, &field, &content, "test").is_err() && !path.exists(), "{name}");
        }
    }

    #[test]
    fn what_the_numbers_are_says_what_they_mean() {
        let path = Path::new("a.npy");
        let of = |values: Values| of_array(path, Array { shape: vec![1, 1, 2], values, origin: String::new() }, None);
        let phases = of(Values::Real(vec![0.5, 7.0])).expect("phases");
        assert_eq!((phases.width, phases.height), (2, 1));
        assert_eq!(phases.samples, Samples::Phases(vec![0.5, 7.0]));
        assert!(phases.warnings.is_empty());
        let (field, _) = phases.field(path, Some([8e-6; 2]), Some(532e-9)).expect("field");
        assert!((f64::from(field.samples[1].arg()) - (7.0 - std::f64::consts::TAU)).abs() < 1e-6);
        let warned = of(Values::Real(vec![0.0, 255.0])).expect("phases").warnings;
        assert!(warned[0].contains("0 to 255") && warned[0].contains("uint8"), "{warned:?}");
        // Zeros and ones may well be phases.
        assert!(of(Values::Real(vec![0.0, 1.0])).expect("phases").warnings.is_empty());
        let levels = of(Values::Whole(vec![3, 65535])).expect("levels");
        assert_eq!(levels.samples, Samples::Levels(vec![3, 65535]));
        assert!(levels.field(path, Some([8e-6; 2]), Some(532e-9)).unwrap_err().to_string().contains("drive levels"));
        assert!(of(Values::Whole(vec![3, -1])).unwrap_err().to_string().contains("row 0, column 1 is -1"));
        assert!(of(Values::Real(vec![3.0, f64::NAN])).unwrap_err().to_string().contains("not finite"));
    }
}
