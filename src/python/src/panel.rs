//! Panels: profiles by name or file, or by a few numbers, in the light of a laser.

use crate::arrays::{array, handed, values};
use crate::errors::{Raise, refused};
use crate::quantities::{Length, Lengths};
use holodrive::panel::{Correction, Curve, Modulation, PanelProfile, Response, Setup, Wavefront};
use holodrive::units::{show_length, show_pitch};
use numpy::PyArray1;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// A panel in the light of one laser: geometry, levels, curve, wavefront correction.
///
/// By the name of a profile that holodrive knows (see :func:`panels`) or by a profile's .toml file::
///
///     Panel("holoeye-pluto-2.1", wavelength="532nm")
///     Panel("mine.toml")
///
/// or without a file, by numbers:
///
/// >>> import holodrive
/// >>> holodrive.Panel(width=1920, height=1080, pitch="8um", wavelength="632.8nm")
/// <holodrive.Panel PhaseLcos 1920×1080, 1920 × 1080 px of 8um, 256 levels of phase at 632.8nm>
///
/// :param profile: name or .toml file; without it, width, height, pitch and wavelength are needed.
/// :param wavelength: vacuum wavelength of the laser [m]; by default the profile's first.
/// :param width: columns.
/// :param height: rows.
/// :param pitch: distance of neighbouring pixels [m], or (x, y).
/// :param bits: bits a level, 1 to 8.
/// :param modulation: "phase" (levels span one turn) or "amplitude" (transmittance rises with the level).
/// :param fill_factor: share of a pixel's area that modulates, 0 to 1.
/// :param curve: phase [rad] (of an amplitude panel: transmittance) of each level, if it is not linear.
/// :param correction: wavefront correction that patterns get: a file (.npy of radians, a vendor's .bmp, .png or .csv), "none", or
///     by default the profile's own.
#[pyclass(frozen, module = "holodrive")]
pub(crate) struct Panel {
    pub(crate) setup: Setup,
}

/// What makes a panel without a file.
struct Numbers<'a, 'py> {
    size: [Option<usize>; 2],
    pitch: Option<Lengths>,
    bits: u8,
    modulation: &'a str,
    fill_factor: f64,
    curve: Option<&'a Bound<'py, PyAny>>,
}

impl Numbers<'_, '_> {
    fn profile(&self, py: Python<'_>, wavelength: Option<Length>) -> PyResult<PanelProfile> {
        let ([Some(width), Some(height)], Some(Lengths([x, y])), Some(Length(wavelength))) =
            (self.size, self.pitch, wavelength)
        else {
            return refused(py, "panel", "give a profile, or width, height, pitch and wavelength");
        };
        let make = match self.modulation {
            "phase" => PanelProfile::phase,
            "amplitude" => PanelProfile::amplitude,
            other => return refused(py, "modulation", format!("there is no `{other}`; one of phase, amplitude")),
        };
        let mut profile = make(width, height, x, self.bits, wavelength).raise(py)?;
        if !(self.fill_factor > 0.0 && self.fill_factor <= 1.0) {
            return refused(py, "fill_factor", format!("{} must lie above 0 and be at most 1", self.fill_factor));
        }
        (profile.pitch_y, profile.fill_factor) = (y, self.fill_factor);
        if let Some(curve) = self.curve {
            let table = values::<f64>(&array(curve)?, "curve")?;
            let curve = match profile.modulation() {
                Modulation::Phase => Curve::Table { phase: table },
                Modulation::Amplitude => Curve::Transmittance { amplitude: table },
            };
            curve.check(profile.levels(), Path::new("curve")).raise(py)?;
            profile.responses = vec![Response { wavelength: None, curve }];
        }
        Ok(profile)
    }
}

#[pymethods]
impl Panel {
    #[new]
    #[pyo3(signature = (
        profile = None, *, wavelength = None, width = None, height = None, pitch = None, bits = 8, modulation = "phase",
        fill_factor = 1.0, curve = None, correction = None
    ))]
    #[expect(clippy::too_many_arguments)] // Python's keywords
    fn new(
        py: Python<'_>,
        profile: Option<PathBuf>,
        wavelength: Option<Length>,
        width: Option<usize>,
        height: Option<usize>,
        pitch: Option<Lengths>,
        bits: u8,
        modulation: &str,
        fill_factor: f64,
        curve: Option<&Bound<'_, PyAny>>,
        correction: Option<PathBuf>,
    ) -> PyResult<Self> {
        let numbers = Numbers { size: [width, height], pitch, bits, modulation, fill_factor, curve };
        let profile = match profile {
            Some(_) if width.or(height).is_some() || pitch.is_some() || curve.is_some() => {
                return refused(
                    py,
                    "panel",
                    "a profile says its width, height, pitch and curve: give one or the other",
                );
            }
            Some(profile) => PanelProfile::find(&profile.to_string_lossy()).raise(py)?,
            None => numbers.profile(py, wavelength)?,
        };
        let setup = Setup::new(profile, wavelength.map(|wavelength| wavelength.0)).raise(py)?;
        let correction = match correction {
            None => Correction::Profile,
            Some(none) if none.as_os_str() == "none" => Correction::None,
            Some(file) => Correction::Given(Wavefront::read(&file, None).raise(py)?),
        };
        Ok(Self { setup: Setup { correction, ..setup } })
    }

    /// The same panel in the light of another laser.
    ///
    /// :param wavelength: its vacuum wavelength [m].
    fn at(&self, py: Python<'_>, wavelength: Length) -> PyResult<Self> {
        let setup = Setup::new(self.setup.profile.clone(), Some(wavelength.0)).raise(py)?;
        Ok(Self { setup: Setup { correction: self.setup.correction.clone(), ..setup } })
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.setup.profile.name
    }

    /// (rows, columns).
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.setup.grid.height, self.setup.grid.width)
    }

    /// Distance of neighbouring pixels along x and y [m].
    #[getter]
    fn pitch(&self) -> (f64, f64) {
        self.setup.grid.pitch().into()
    }

    /// Vacuum wavelength of the laser [m].
    #[getter]
    fn wavelength(&self) -> f64 {
        self.setup.wavelength
    }

    /// Bits a level.
    #[getter]
    fn bits(&self) -> u8 {
        self.setup.profile.bits
    }

    /// Number of drive levels, 2 ** bits.
    #[getter]
    fn levels(&self) -> usize {
        self.setup.profile.levels()
    }

    /// "phase" or "amplitude".
    #[getter]
    fn modulation(&self) -> &'static str {
        modulation_name(&self.setup)
    }

    /// Share of a pixel's area that modulates.
    #[getter]
    fn fill_factor(&self) -> f64 {
        self.setup.profile.fill_factor
    }

    /// Amplitude of the light from the dead space between pixels, against that of the active area.
    #[getter]
    fn dead_space(&self) -> f64 {
        self.setup.profile.dead_space
    }

    /// Standard deviation of the Gaussian by which the phases of neighbouring pixels blend [pixels].
    #[getter]
    fn crosstalk(&self) -> f64 {
        self.setup.profile.crosstalk
    }

    /// Time from a frame's being presented until the panel has settled on it [s]; None where the profile does not say.
    #[getter]
    fn settle_time(&self) -> Option<f64> {
        self.setup.profile.settle_time
    }

    /// What a user should know before trusting the profile, one line a fact that nobody has checked.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.setup.profile.warnings()
    }

    /// What each level does in this light: phase [rad], or transmittance; float64 of shape (levels,).
    #[getter]
    fn curve<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (curve, _) = self.setup.profile.drive_curve(self.setup.wavelength).raise(py)?;
        handed(py, curve.levels(), curve.values().to_vec())
    }

    /// Positions of the columns [m], float64 of shape (columns,).
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let grid = &self.setup.grid;
        handed(py, grid.width, (0..grid.width).map(|column| grid.x(column)).collect())
    }

    /// Positions of the rows [m], float64 of shape (rows,); row 0 is on top, at the largest y.
    #[getter]
    fn y<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let grid = &self.setup.grid;
        handed(py, grid.height, (0..grid.height).map(|row| grid.y(row)).collect())
    }

    fn __repr__(&self) -> String {
        let Setup { profile, grid, wavelength, .. } = &self.setup;
        format!(
            "<holodrive.Panel {}, {} × {} px of {}, {} levels of {} at {}>",
            profile.name,
            grid.width,
            grid.height,
            show_pitch(grid.pitch()),
            profile.levels(),
            modulation_name(&self.setup),
            show_length(*wavelength)
        )
    }
}

fn modulation_name(setup: &Setup) -> &'static str {
    match setup.profile.modulation() {
        Modulation::Phase => "phase",
        Modulation::Amplitude => "amplitude",
    }
}

/// Names of the profiles that holodrive knows.
///
/// >>> import holodrive
/// >>> "generic" in holodrive.panels()
/// True
#[pyfunction]
pub(crate) fn panels() -> Vec<&'static str> {
    PanelProfile::embedded_names().collect()
}
