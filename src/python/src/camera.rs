//! A camera on the bench, by call-backs: the panel's calibration, and frames that are corrected by photos of them.

use crate::arrays::{handed, real_plane};
use crate::errors::{Raise, refused};
use crate::frame::{Frame, loaded};
use crate::panel::Panel;
use crate::quantities::Length;
use crate::run::run;
use holodrive::calibration::{self, CameraBench, CameraPhoto, CameraView, RANDOM};
use holodrive::encode::far::{FarPicture, FarPlane, FarSettings, Photograph, far_frame};
use holodrive::panel::{Origin, Setup};
use holodrive::{Error, Result};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Mutex;

/// The bench's own functions: what shows levels, and what takes a photo.
struct Bench {
    show: Py<PyAny>,
    photograph: Py<PyAny>,
}

impl Bench {
    /// Shows a frame and takes its photo.
    fn photo(&self, py: Python<'_>, frame: &holodrive::panel::Frame) -> PyResult<CameraPhoto> {
        let shape = (frame.height, frame.width);
        if frame.bits > 8 {
            self.show.call1(py, (handed(py, shape, frame.levels.clone())?,))?;
        } else {
            let levels = frame.levels.iter().map(|&level| level as u8).collect();
            self.show.call1(py, (handed(py, shape, levels)?,))?;
        }
        let ([height, width], values) = real_plane(self.photograph.call0(py)?.bind(py), "photo")?;
        CameraPhoto::new(width, height, values).raise(py)
    }
}

/// Finds all that a panel's profile may hold from photos of a dot card and ten random patterns behind a lens: wavefront error, level
/// curve over the panel, the laser's beam, crosstalk, unmodulated light, and where the camera stands, each with its uncertainty.
///
/// ::
///
///     found = holodrive.calibrate_camera(slm.show, camera.grab, panel, lens="200mm", camera_pitch="3.45um", output="lab.toml")
///     lab = holodrive.Panel("lab.toml")
///
/// The camera must see the zero order and the square about it of half a cycle in (columns / 480) pixels. Photos are linear in the light.
///
/// :param show: called with the levels of a frame, uint8 (above 8 bits uint16) of the panel's shape; returns when it is on the panel.
/// :param photograph: called without arguments after it; returns the photo, an array of real or whole numbers, (rows, columns).
/// :param panel: the :class:`Panel` as far as it is known.
/// :param lens: focal length of the lens between panel and camera [m].
/// :param camera_pitch: distance of neighbouring pixels of the camera [m].
/// :param output: the profile to write, a .toml; the maps (-correction.npy, -beam.npy) and the camera's place (-camera.json, for
///     :func:`encode_in_the_loop`) are written beside it.
/// :param progress: see :func:`hologram`.
/// :return: a dict: wavefront_rms and wavefront_uncertainty [waves], range and curve_uncertainty [rad], crosstalk and
///     crosstalk_uncertainty [pixels], unmodulated and unmodulated_uncertainty (shares of the light), beam_uncertainty,
///     mapping_uncertainty [camera pixels], misfit, and others.
/// :raises ParameterError: photos do not answer to the patterns.
#[pyfunction]
#[pyo3(signature = (show, photograph, panel, *, lens, camera_pitch, output = None, progress = None))]
#[expect(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn calibrate_camera(
    py: Python<'_>,
    show: Py<PyAny>,
    photograph: Py<PyAny>,
    panel: &Bound<'_, Panel>,
    lens: Length,
    camera_pitch: Length,
    output: Option<PathBuf>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<PyAny>> {
    let Setup { profile, wavelength, .. } = &panel.get().setup;
    if output.as_ref().is_some_and(|path| path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("toml"))) {
        return refused(py, "output", "a profile's name ends in .toml");
    }
    let bench = Bench { show, photograph };
    let mut photos = Vec::with_capacity(RANDOM + 1);
    for frame in calibration::camera_frames(profile, *wavelength).raise(py)?.frames() {
        py.check_signals()?;
        photos.push(bench.photo(py, &frame.raise(py)?)?);
    }
    let optics = CameraBench { lens: lens.0, camera_pitch: camera_pitch.0 };
    let found = run(py, progress, |progress| {
        let fit = calibration::calibrate_camera(profile, *wavelength, &optics, &photos, progress)?;
        if let Some(path) = &output {
            fit.write(profile, path)?;
        }
        Ok(fit)
    })?;
    loaded(py, &serde_json::json!(found.report))
}

/// A frame that shows a picture in the focal plane of a lens, found by the panel's profile and then corrected by photos of it: what the
/// profile does not know of the bench is corrected, too.
///
/// ::
///
///     frame = holodrive.encode_in_the_loop(picture, lab, "lab-camera.json", slm.show, camera.grab)
///     frame.metadata["encoding"]["parameters"]["photo_psnr"]
///
/// Each step takes the derivative from the model and what was seen from the photo, brought onto the picture by the camera's place
/// (Peng et al., "Neural holography with camera-in-the-loop training", ACM Trans. Graph. 39, 185 (2020)).
///
/// :param picture: linear light, real numbers of shape (rows, columns), row 0 on top.
/// :param panel: the calibrated :class:`Panel`.
/// :param camera: the file that :func:`calibrate_camera` wrote beside the profile (lab-camera.json).
/// :param show: as in :func:`calibrate_camera`.
/// :param photograph: as in :func:`calibrate_camera`. Expose for the picture, always alike; the zero order may be overexposed.
/// :param room: (left, bottom, right, top) for the picture, in halves of the window that was calibrated, right and up from the axis.
/// :param iterations: steps by the model before the first photo.
/// :param photos: photos that are taken; the first frame's is taken twice, which tells the camera's noise.
/// :param step: longest step of a pixel's phase by a photo [rad].
/// :param progress: see :func:`hologram`.
/// :return: the :class:`Frame` of the best photo. Its metadata hold the peak signal-to-noise ratios of all photos [dB]: the first is
///     that of the frame which the model alone found.
/// :raises ParameterError: a photo does not show its frame, is underexposed, or shows the camera's noise rather than the picture's
///     errors.
#[pyfunction]
#[pyo3(signature = (
    picture, panel, camera, show, photograph, *, room = (-0.9, 0.15, 0.9, 0.9), iterations = 150, photos = 30, step = 0.05, progress = None
))]
#[expect(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn encode_in_the_loop(
    py: Python<'_>,
    picture: &Bound<'_, PyAny>,
    panel: &Bound<'_, Panel>,
    camera: PathBuf,
    show: Py<PyAny>,
    photograph: Py<PyAny>,
    room: (f64, f64, f64, f64),
    iterations: usize,
    photos: usize,
    step: f64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Frame> {
    let setup = &panel.get().setup;
    let ([height, width], light) = real_plane(picture, "picture")?;
    let settings = FarSettings { iterations, photos, photo_step: step, ..FarSettings::default() };
    let bench = Bench { show, photograph };
    // An exception of a call-back, to be raised when the work has ended on it.
    let failed: Mutex<Option<PyErr>> = Mutex::new(None);
    let fail = |fault: PyErr| -> Error {
        *failed.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(fault);
        Error::Interrupted
    };
    let found = run(py, progress, |progress| -> Result<_> {
        let view = CameraView::read(&camera)?;
        let plane = FarPlane::new(&FarPicture { width, height, light, room: view.room(room.into())? }, &setup.profile)?;
        let places = view.places(&plane.frequencies())?;
        let mut take = |frame: &holodrive::panel::Frame| {
            let photo = Python::attach(|py| bench.photo(py, frame)).map_err(fail)?;
            view.registered(&photo, &places)
        };
        let take: &mut Photograph<'_> = &mut take;
        far_frame(&plane, setup, &settings, Some(take), progress).map(|(frame, _)| frame)
    });
    if let Some(fault) = failed.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
        return Err(fault);
    }
    let mut frame = found?;
    frame.metadata.origin = Origin { source: Some("Python".into()), ..Origin::default() };
    Ok(Frame::of(frame))
}
