//! What is seen of fields and frames, and how like it is to what should be seen.

use crate::errors::{Raise, refused};
use crate::field::Field;
use crate::frame::{Frame, loaded};
use crate::light_field::{LightField, Looking, PupilGiven, half_of};
use crate::picture::Picture;
use crate::quantities::{Angle, Length, Lengths, Place};
use crate::run::run;
use holodrive::light_field::Viewer;
use holodrive::panel::simulated::Simulation;
use holodrive::panel::{Faults, Setup, Wavefront};
use holodrive::pipeline::{self, Bench};
use holodrive::points::Channel;
use holodrive::progress::Progress;
use holodrive::reconstruction::{self, Colour, Seeing, View, ViewSettings};
use pyo3::prelude::*;
use std::path::PathBuf;

/// The simulated bench.
fn bench(
    py: Python<'_>,
    subpixels: usize,
    crosstalk: f64,
    wavefront_error: Option<PathBuf>,
    zero_order_stop: Angle,
) -> PyResult<Bench> {
    let wavefront_error = wavefront_error.map(|path| Wavefront::read(&path, None)).transpose().raise(py)?;
    let faults = Faults { crosstalk, wavefront_error, ..Faults::default() };
    let simulation = Simulation { subsamples: subpixels, faults, ..Simulation::default() };
    Ok(Bench { simulation, zero_order_stop: zero_order_stop.0 })
}

/// What is seen of a field, or of a frame on the simulated panel: by a sensor on a plane, or by an eye that focuses on it.
///
/// >>> import holodrive, numpy as np
/// >>> panel = holodrive.Panel(width=128, height=128, pitch="8um", wavelength="532nm")
/// >>> field = holodrive.hologram(holodrive.Points([[64e-6, 0, -0.05]]), panel)
/// >>> picture = holodrive.reconstruct(field, "-50mm")
/// >>> row, column = np.unravel_index(np.argmax(picture), picture.shape)
/// >>> bool(abs(picture.x[column] - 64e-6) < 8e-6)
/// True
///
/// :param light: a :class:`Frame` or a :class:`Field`.
/// :param z: the depth in focus [m]; negative behind the panel.
/// :param eye: middle of an eye's pupil (x, y, z) [m]; by default a sensor with the whole panel as aperture.
/// :param pupil: diameter of the pupil [m], by default 4 mm.
/// :param size: (columns, rows) of the picture; by default samples of the panel's pitch.
/// :param window: width and height of what is seen, in the plane of focus [m]; by default the panel's, along the eye's rays.
/// :param subpixels: of a frame: samples a pixel each way, which show the dead space.
/// :param crosstalk: of a frame: standard deviation of the blur of neighbouring pixels' phases [pixels].
/// :param wavefront_error: of a frame: file of the panel's wavefront error.
/// :param zero_order_stop: of a frame: angle that a stop about the axis blocks [rad].
/// :param progress: see :func:`hologram`.
/// :return: :class:`Picture`.
#[pyfunction]
#[pyo3(signature = (
    light, z, *, eye = None, pupil = None, size = None, window = None, subpixels = 1, crosstalk = 0.0, wavefront_error = None,
    zero_order_stop = Angle(0.0), progress = None
))]
#[expect(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn reconstruct(
    py: Python<'_>,
    light: &Bound<'_, PyAny>,
    z: Length,
    eye: Option<Place>,
    pupil: Option<Length>,
    size: Option<(usize, usize)>,
    window: Option<Lengths>,
    subpixels: usize,
    crosstalk: f64,
    wavefront_error: Option<PathBuf>,
    zero_order_stop: Angle,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Picture> {
    if eye.is_none() && pupil.is_some() {
        return refused(py, "pupil", "is an eye's: give eye=(x, y, z)");
    }
    if size.is_some_and(|(columns, rows)| columns == 0 || rows == 0) {
        return refused(py, "size", "has no pixels");
    }
    // The field's own plane may stand before or behind the panel's.
    let view = |plane: f64| match eye {
        None => View::Plane { z: z.0 - plane },
        Some(Place(eye)) => View::Eye {
            position: [eye.x, eye.y, eye.z - plane],
            pupil: pupil.map_or(Viewer::PUPIL, |pupil| pupil.0),
            focus: z.0 - plane,
        },
    };
    let window = window.map(half_of);
    let see = |field: &holodrive::field::Field,
               view: View,
               settings: &ViewSettings,
               eye: Option<[f64; 3]>,
               progress: &Progress| {
        let half = window.unwrap_or_else(|| {
            let half = view.seen_half(&field.grid, eye);
            size.map_or(half, |size| reconstruction::square_half(half, size))
        });
        progress.start("reconstruct", 0);
        let picture = match size {
            Some(size) => reconstruction::picture(field, &view, half, size, settings, progress)?,
            None => {
                let (grid, values) = reconstruction::intensity(field, &view, half, settings, progress)?;
                reconstruction::Picture { width: grid.width, height: grid.height, values }
            }
        };
        progress.check()?;
        Ok((picture, half))
    };
    let (picture, half) = if let Ok(field) = light.cast::<Field>() {
        let (samples, content) = (&*field.get().samples, field.get().content);
        run(py, progress, |progress| see(samples, view(content.z), &ViewSettings::default(), content.eye, progress))?
    } else if let Ok(frame) = light.cast::<Frame>() {
        let bench = bench(py, subpixels, crosstalk, wavefront_error, zero_order_stop)?;
        let frame = &frame.get().frame;
        run(py, progress, |progress| {
            let light = pipeline::light(frame, &bench, progress)?;
            see(&light.field, view(0.0), &light.settings, None, progress)
        })?
    } else {
        return refused(py, "light", "is neither a Frame nor a Field");
    };
    Ok(Picture { picture, view: view(0.0), half })
}

/// How like what an eye sees of frames is to the light field that it should see, by the judge in double precision.
///
/// The eye looks through pupils and with foci that no encoding has met.
///
/// :param frames: a :class:`Frame`, or a list of those that are shown in turn.
/// :param light: the :class:`LightField` that should be seen.
/// :param eye: as in :func:`light_field`; by default the middle of the views.
/// :param pupil: as in :func:`light_field`.
/// :param eye_box: as in :func:`light_field`.
/// :param looks: so many looks make the figures.
/// :param seed: seed of the looks.
/// :param progress: see :func:`hologram`.
/// :return: a dict: psnr (mean over the looks, of amplitudes, peak is white) and psnr_worst [dB], ssim and ssim_worst, contrast of
///     speckle, brightness_spread, efficiency (share of the light in the pupil), box_efficiency, and others.
#[pyfunction]
#[pyo3(signature = (frames, light, *, eye = None, pupil = None, eye_box = None, looks = 24, seed = 1, progress = None))]
#[expect(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn judge(
    py: Python<'_>,
    frames: &Bound<'_, PyAny>,
    light: &Bound<'_, LightField>,
    eye: Option<Place>,
    pupil: Option<PupilGiven>,
    eye_box: Option<Lengths>,
    looks: usize,
    seed: u64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<PyAny>> {
    let frames: Vec<Bound<'_, Frame>> = match frames.cast::<Frame>() {
        Ok(one) => vec![one.clone()],
        Err(_) => {
            frames.try_iter()?.map(|frame| frame?.cast_into::<Frame>().map_err(PyErr::from)).collect::<PyResult<_>>()?
        }
    };
    if looks == 0 {
        return refused(py, "looks", "0 make no figures; take one at least");
    }
    let Some(first) = frames.first() else {
        return refused(py, "frames", "there are none");
    };
    let metadata = &first.get().frame.metadata;
    let setup = Setup::new(metadata.panel.clone(), Some(metadata.wavelength)).raise(py)?;
    let viewer = Looking { eye, pupil, eye_box }.viewer(Some(light.get()));
    let light = &light.get().light;
    let frames: Vec<_> = frames.iter().map(|frame| Some(&frame.get().frame)).collect();
    let gallery = run(py, progress, |progress| {
        let colour = Colour::of(None, setup.wavelength, Channel::Luminance);
        let seeing = Seeing { held_out: looks, seed, ..Seeing::new(light, &viewer, colour, &[]) };
        pipeline::seen(&frames, &setup, &seeing, &Bench::default(), progress)
    })?;
    loaded(py, &serde_json::json!(gallery.figures.all))
}
