//! What is seen of fields and frames, and how like it is to what should be seen.

use crate::errors::{Raise, refused};
use crate::field::Field;
use crate::frame::{Frame, loaded};
use crate::light_field::{LightField, Looking, PupilGiven, half_of};
use crate::picture::Picture;
use crate::quantities::{Angle, Length, Lengths, Place, Three, lasers_of};
use crate::run::run;
use glam::DVec2;
use holodrive::field::Grid;
use holodrive::light_field::Viewer;
use holodrive::panel::simulated::Simulation;
use holodrive::panel::{Faults, Setup, Wavefront};
use holodrive::pipeline::{self, Bench};
use holodrive::points::Channel;
use holodrive::progress::Progress;
use holodrive::reconstruction::{self, Colour, ExposureLight, Light, Reconstruction, Seeing, View, ViewSettings};
use pyo3::prelude::*;
use pyo3::types::PyList;
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
/// :param light: a :class:`Frame` or a :class:`Field`; or a list of them that are seen together: sub-frames, of which a slow eye sees
///     the mean, or one for each of three lasers (red, green, blue; None for a dark one), which make a picture in colour.
/// :param z: the depth in focus [m]; negative behind the panel.
/// :param eye: middle of an eye's pupil (x, y, z) [m]; by default a sensor with the whole panel as aperture.
/// :param pupil: diameter of the pupil [m], by default 4 mm.
/// :param size: (columns, rows) of the picture; by default samples of the panel's pitch.
/// :param window: width and height of what is seen, in the plane of focus [m]; by default the panel's, along the eye's rays.
/// :param wavelengths: of a list: the three lasers [m], or "panel"; needed only where one of the three is dark.
/// :param subpixels: of a frame: samples a pixel each way, which show the dead space.
/// :param crosstalk: of a frame: standard deviation of the blur of neighbouring pixels' phases [pixels].
/// :param wavefront_error: of a frame: file of the panel's wavefront error.
/// :param zero_order_stop: of a frame: angle that a stop about the axis blocks [rad].
/// :param progress: see :func:`hologram`.
/// :return: :class:`Picture`.
#[pyfunction]
#[pyo3(signature = (
    light, z, *, eye = None, pupil = None, size = None, window = None, wavelengths = None, subpixels = 1, crosstalk = 0.0, wavefront_error = None,
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
    wavelengths: Option<Three>,
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
    let look = Look { z: z.0, eye, pupil, window: window.map(half_of), size };
    if let Ok(items) = light.cast::<PyList>() {
        let bench = bench(py, subpixels, crosstalk, wavefront_error, zero_order_stop)?;
        return together(py, items, &look, wavelengths.as_ref(), &bench, progress);
    }
    if wavelengths.is_some() {
        return refused(py, "wavelengths", "are of a list of three, one for each laser");
    }
    if let Ok(field) = light.cast::<Field>() {
        let (samples, content) = (&*field.get().samples, field.get().content);
        run(py, progress, |progress| look.at(samples, content.z, &ViewSettings::default(), content.eye, progress))
    } else if let Ok(frame) = light.cast::<Frame>() {
        let bench = bench(py, subpixels, crosstalk, wavefront_error, zero_order_stop)?;
        let frame = &frame.get().frame;
        run(py, progress, |progress| {
            let light = pipeline::light(frame, &bench, progress)?;
            look.at(&light.field, 0.0, &light.settings, None, progress)
        })
    } else {
        refused(py, "light", "is neither a Frame nor a Field")
    }
}

/// How light is looked at.
struct Look {
    z: f64,
    eye: Option<Place>,
    pupil: Option<Length>,
    /// Half of what is seen, in the plane of focus [m].
    window: Option<DVec2>,
    size: Option<(usize, usize)>,
}

impl Look {
    /// From a field whose own plane stands at `plane`, before or behind the panel's [m].
    fn view(&self, plane: f64) -> View {
        match self.eye {
            None => View::Plane { z: self.z - plane },
            Some(Place(eye)) => View::Eye {
                position: [eye.x, eye.y, eye.z - plane],
                pupil: self.pupil.map_or(Viewer::PUPIL, |pupil| pupil.0),
                focus: self.z - plane,
            },
        }
    }

    /// Half of what is seen of a field made for an eye [m].
    fn half(&self, grid: &Grid, plane: f64, eye: Option<[f64; 3]>) -> DVec2 {
        self.window.unwrap_or_else(|| {
            let half = self.view(plane).seen_half(grid, eye);
            self.size.map_or(half, |size| reconstruction::square_half(half, size))
        })
    }

    /// What is seen of one field.
    fn at(
        &self,
        field: &holodrive::field::Field,
        plane: f64,
        settings: &ViewSettings,
        eye: Option<[f64; 3]>,
        progress: &Progress,
    ) -> holodrive::error::Result<Picture> {
        let (view, half) = (self.view(plane), self.half(&field.grid, plane, eye));
        progress.start("reconstruct", 0);
        let picture = match self.size {
            Some(size) => reconstruction::picture(field, &view, half, size, settings, progress)?,
            None => {
                let (grid, values) = reconstruction::intensity(field, &view, half, settings, progress)?;
                reconstruction::Picture { width: grid.width, height: grid.height, values }
            }
        };
        progress.check()?;
        Ok(Picture { seen: Reconstruction::Gray(picture), lasers: None, view: self.view(0.0), half })
    }
}

/// What is seen of several exposures as one picture.
fn together(
    py: Python<'_>,
    items: &Bound<'_, PyList>,
    look: &Look,
    wavelengths: Option<&Three>,
    bench: &Bench,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Picture> {
    // A copy for the run, whose fields outlive Python's lock: of frames and fields references.
    let (mut frames, mut fields) = (Vec::new(), Vec::new());
    for (index, item) in items.iter().enumerate() {
        if let Ok(frame) = item.cast::<Frame>() {
            frames.push((index, frame.clone()));
        } else if let Ok(field) = item.cast::<Field>() {
            fields.push((index, field.clone()));
        } else if !item.is_none() {
            return refused(py, "light", "a list holds Frames or Fields, and None for a laser without light");
        }
    }
    let mut waves = vec![None; items.len()];
    frames.iter().for_each(|(index, frame)| waves[*index] = Some(frame.get().frame.metadata.wavelength));
    fields.iter().for_each(|(index, field)| waves[*index] = Some(field.get().samples.wavelength));
    let contents: Vec<_> = fields.iter().map(|(_, field)| field.get().content).collect();
    let plane = contents.first().map_or(0.0, |content| content.z);
    if !frames.is_empty() && !fields.is_empty() || contents.iter().any(|content| content.z != plane) {
        return refused(py, "light", "a list holds frames, or fields on one plane");
    }
    if waves.iter().all(Option::is_none) {
        return refused(py, "light", "the list has no light");
    }
    let panel = match frames.first() {
        Some((_, frame)) => {
            let metadata = &frame.get().frame.metadata;
            Some(Setup::new(metadata.panel.clone(), Some(metadata.wavelength)).raise(py)?)
        }
        None => None,
    };
    let lasers = lasers_of(py, &waves, wavelengths, panel.as_ref())?;
    let laser = |index: usize| if lasers.is_some() { index } else { 0 };
    let frames: Vec<_> = frames.iter().map(|(index, frame)| (laser(*index), &frame.get().frame)).collect();
    let fields: Vec<_> = fields.iter().map(|(index, field)| (laser(*index), &*field.get().samples)).collect();
    run(py, progress, |progress| {
        let of_frames = frames.iter().map(|(laser, frame)| {
            pipeline::light(frame, bench, progress).map(|light| ExposureLight { laser: *laser, ..light })
        });
        let of_fields = fields.iter().map(|(laser, field)| {
            Ok(ExposureLight { field: (*field).clone(), settings: ViewSettings::default(), laser: *laser })
        });
        let exposures = of_frames.chain(of_fields).collect::<holodrive::error::Result<Vec<_>>>()?;
        let half = look.half(&exposures[0].field.grid, plane, contents.first().and_then(|content| content.eye));
        progress.start("reconstruct", 0);
        let seen = Light { lasers, exposures }.picture(&look.view(plane), half, look.size, progress)?;
        progress.check()?;
        Ok(Picture { seen, lasers, view: look.view(0.0), half })
    })
}

/// How like what an eye sees of frames is to the light field that it should see, by the judge in double precision.
///
/// The eye looks through pupils and with foci that no encoding has met.
///
/// :param frames: a :class:`Frame`; a list of those that are shown in turn; or one for each of three lasers (red, green, blue; None for
///     a dark one), which are judged in colour.
/// :param light: the :class:`LightField` that should be seen.
/// :param eye: as in :func:`light_field`; by default the middle of the views.
/// :param pupil: as in :func:`light_field`.
/// :param eye_box: as in :func:`light_field`.
/// :param wavelengths: the three lasers [m], or "panel"; needed only where one of the three is dark.
/// :param looks: so many looks make the figures.
/// :param seed: seed of the looks.
/// :param progress: see :func:`hologram`.
/// :return: a dict: psnr (mean over the looks, of amplitudes, peak is white) and psnr_worst [dB], ssim and ssim_worst, contrast of
///     speckle, brightness_spread, efficiency (share of the light in the pupil), box_efficiency, and others.
#[pyfunction]
#[pyo3(signature = (frames, light, *, eye = None, pupil = None, eye_box = None, wavelengths = None, looks = 24, seed = 1, progress = None))]
#[expect(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn judge(
    py: Python<'_>,
    frames: &Bound<'_, PyAny>,
    light: &Bound<'_, LightField>,
    eye: Option<Place>,
    pupil: Option<PupilGiven>,
    eye_box: Option<Lengths>,
    wavelengths: Option<Three>,
    looks: usize,
    seed: u64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Py<PyAny>> {
    let frames: Vec<Option<Bound<'_, Frame>>> = match frames.cast::<Frame>() {
        Ok(one) => vec![Some(one.clone())],
        Err(_) => frames
            .try_iter()?
            .map(|frame| match frame? {
                none if none.is_none() => Ok(None),
                frame => frame.cast_into::<Frame>().map(Some).map_err(PyErr::from),
            })
            .collect::<PyResult<_>>()?,
    };
    if looks == 0 {
        return refused(py, "looks", "0 make no figures; take one at least");
    }
    let Some(first) = frames.iter().flatten().next() else {
        return refused(py, "frames", "there are none");
    };
    let metadata = &first.get().frame.metadata;
    let mut setup = Setup::new(metadata.panel.clone(), Some(metadata.wavelength)).raise(py)?;
    let waves: Vec<_> = frames.iter().map(|f| f.as_ref().map(|f| f.get().frame.metadata.wavelength)).collect();
    setup.lasers = lasers_of(py, &waves, wavelengths.as_ref(), Some(&setup))?;
    let viewer = Looking { eye, pupil, eye_box }.viewer(Some(light.get()));
    let light = &light.get().light;
    let frames: Vec<_> = frames.iter().map(|frame| frame.as_ref().map(|frame| &frame.get().frame)).collect();
    let gallery = run(py, progress, |progress| {
        let colour = Colour::of(setup.lasers, setup.wavelength, Channel::Luminance);
        let seeing = Seeing { held_out: looks, seed, ..Seeing::new(light, &viewer, colour, &[]) };
        pipeline::seen(&frames, &setup, &seeing, &Bench::default(), progress)
    })?;
    loaded(py, &serde_json::json!(gallery.figures.all))
}
