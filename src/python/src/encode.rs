//! Fields, phases and light fields to frames.

use crate::errors::{Raise, refused};
use crate::field::{Field, Given};
use crate::frame::Frame;
use crate::light_field::{Content, Looking, PupilGiven, views};
use crate::panel::Panel;
use crate::quantities::{Angle, Length, Lengths, Place, Three, named};
use crate::run::run;
use holodrive::encode::view::Viewed;
use holodrive::encode::{EncodeOptions, Encoding, PlaneStart, Reference, ViewEncoding};
use holodrive::light_field::LightSource;
use holodrive::names::Named;
use holodrive::panel::{Origin, Setup};
use holodrive::pipeline::{self, Settings};
use holodrive::points::{Channel, Multiplexing, SubFrames};
use holodrive::units::show_length;
use pyo3::prelude::*;
use pyo3::types::PyList;

/// Settings of an encoding as they were given.
struct Asked<'a> {
    encoding: Option<&'a str>,
    iterations: Option<usize>,
    depths: Option<Vec<f64>>,
    start: Option<&'a str>,
    reference_angle: Option<(Angle, Angle)>,
    seed: u64,
}

impl Asked<'_> {
    /// The encoding with its settings; one that it has no use for is refused by name.
    fn encoding(&self, py: Python<'_>, usual: Encoding) -> PyResult<Encoding> {
        let mut encoding = self.encoding.map_or(Ok(usual), |name| named(py, name))?;
        let chosen = encoding.name();
        let idle = |name: &'static str| refused(py, name, format!("{chosen} has no use for it; leave it out"));
        let reference = self.reference_angle.map(|(x, y)| Reference::Angle([x.0, y.0]));
        match &mut encoding {
            Encoding::OffAxisBipolar(fringe) | Encoding::OffAxisIntensity(fringe) => {
                fringe.reference = reference.or(fringe.reference);
            }
            Encoding::Binary(binary) => binary.fringe.reference = reference.or(binary.fringe.reference),
            _ if reference.is_some() => return idle("reference_angle"),
            _ => {}
        }
        match &mut encoding {
            Encoding::Planes(planes) => {
                planes.iterations = self.iterations.unwrap_or(planes.iterations);
                planes.depths = self.depths.clone().unwrap_or_default();
                if let Some(start) = self.start {
                    planes.start = match named(py, start)? {
                        PlaneStart::Random { .. } => PlaneStart::Random { seed: self.seed },
                        PlaneStart::Smooth { .. } => PlaneStart::Smooth { seed: self.seed },
                        other => other,
                    };
                }
                return Ok(encoding);
            }
            _ if self.depths.is_some() => return idle("depths"),
            _ if self.start.is_some() => return idle("start"),
            Encoding::View(view) => *view = ViewEncoding { iterations: self.iterations, seed: self.seed },
            Encoding::Gradient(gradient) => gradient.iterations = self.iterations.unwrap_or(gradient.iterations),
            _ if self.iterations.is_some() => return idle("iterations"),
            _ => {}
        }
        Ok(encoding)
    }
}

/// Frames for an eye: found together, shown in turn.
fn for_an_eye<'py>(
    py: Python<'py>,
    content: &Content<'py>,
    setup: &Setup,
    looking: Looking,
    view: ViewEncoding,
    sub_frames: Option<SubFrames>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Option<Frame>>> {
    let viewer = looking.viewer(content.views());
    let source = content.source(&viewer);
    let settings = Settings { viewer, sub_frames, ..Settings::default() };
    let found = run(py, progress, |progress| {
        let light = views(&source, setup, viewer, Channel::Luminance, progress)?;
        let exposures = pipeline::exposures(setup, &settings, None);
        let found = pipeline::views(&light, &viewer, &exposures, setup, &view, &[], progress)?;
        let frames = found.into_iter().flat_map(Viewed::frames_or_none);
        let told = |source: &LightSource| match source {
            LightSource::Views(_) => "a light field",
            LightSource::Scene { .. } => "a scene",
            _ => "points",
        };
        let origin = Origin { source: Some(told(&source).into()), depth: Some(light.depth), ..Origin::default() };
        let mut frames: Vec<_> = frames.collect();
        frames.iter_mut().flatten().for_each(|encoded| encoded.frame.metadata.origin = origin.clone());
        Ok(frames)
    })?;
    if found.iter().all(Option::is_none) {
        return refused(py, "light field", "is dark: there is nothing to encode");
    }
    found.into_iter().map(|encoded| encoded.map(|encoded| Frame::encoded(py, encoded)).transpose()).collect()
}

/// The frame that makes a panel send a field, or show an eye a light field.
///
/// >>> import holodrive, numpy as np
/// >>> panel = holodrive.Panel(width=64, height=48, pitch="8um", wavelength="532nm")
/// >>> blaze = np.broadcast_to(2 * np.pi * np.arange(64) / 16, (48, 64))
/// >>> holodrive.encode(blaze, panel).levels[0, :5]
/// array([ 0, 16, 32, 48, 64], dtype=uint8)
///
/// :param source: a :class:`Field` or complex array of the panel's shape (complex64 in rows is read where it stands, without a
///     copy); a real array: phases [rad], shown as they are; or, for an eye, a :class:`LightField`, :class:`Points` or
///     :class:`Scene`. A list of three fields, for three lasers, as :func:`hologram` makes it.
/// :param panel: the :class:`Panel`.
/// :param encoding: "double-phase", "kinoform", "gradient", "error-diffusion", "plane-gradient", "gerchberg-saxton", "weighted",
///     "double-constraint", "off-axis-bipolar", "off-axis-intensity", "single-side-band", "burckhardt", "lee", "binary-threshold",
///     "binary-diffusion", "binary-search" for fields, "view" for an eye; by default the usual one.
/// :param iterations: steps of those that iterate.
/// :param depths: planes z [m] of those that look at planes; by default three over the content's depth.
/// :param start: "field", "constant", "random", "quadratic" or "smooth" phases, of these.
/// :param reference_angle: (x, y) of the reference wave of fringes [rad].
/// :param blaze: (x, y) by which the object goes aside [rad].
/// :param lens: focal length of a digital lens [m].
/// :param stop: angle about the axis that the object's light keeps out of [rad].
/// :param eye: for "view": middle of the eye box (x, y, z) [m]; by default the light field's, or (0, 0, 0.6).
/// :param pupil: for "view": its diameter [m], by default 4 mm, or "all".
/// :param eye_box: for "view": width and height of the box that the pupil's middle moves in [m].
/// :param subframes: for "view": so many frames that are shown in turn; then a list is returned.
/// :param wavelengths: for "view": of three lasers [m], for frames in colour, or "panel", as in :func:`hologram`.
/// :param seed: seed of what is random.
/// :param progress: see :func:`hologram`.
/// :return: :class:`Frame`, with `subframes` a list of them; for three lasers a list of three, for red, green and blue, None for
///     a laser that has no light.
#[pyfunction]
#[pyo3(signature = (
    source, panel, *, encoding = None, iterations = None, depths = None, start = None, reference_angle = None, blaze = None,
    lens = None, stop = None, eye = None, pupil = None, eye_box = None, subframes = None, wavelengths = None, seed = 1, progress = None
))]
#[expect(clippy::too_many_arguments)] // Python's keywords
pub(crate) fn encode<'py>(
    py: Python<'py>,
    source: &Bound<'py, PyAny>,
    panel: &Bound<'py, Panel>,
    encoding: Option<&str>,
    iterations: Option<usize>,
    depths: Option<Vec<Length>>,
    start: Option<&str>,
    reference_angle: Option<(Angle, Angle)>,
    blaze: Option<(Angle, Angle)>,
    lens: Option<Length>,
    stop: Option<Angle>,
    eye: Option<Place>,
    pupil: Option<PupilGiven>,
    eye_box: Option<Lengths>,
    subframes: Option<usize>,
    wavelengths: Option<Three>,
    seed: u64,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let setup = &panel.get().setup;
    let depths = depths.map(|depths| depths.into_iter().map(|z| z.0).collect());
    let asked = Asked { encoding, iterations, depths, start, reference_angle, seed };
    let aside = [("blaze", blaze.is_some()), ("lens", lens.is_some()), ("stop", stop.is_some())];
    let for_eyes = [
        ("eye", eye.is_some()),
        ("pupil", pupil.is_some()),
        ("eye_box", eye_box.is_some()),
        ("subframes", subframes.is_some()),
        ("wavelengths", wavelengths.is_some()),
    ];
    let first = |given: &[(&'static str, bool)]| given.iter().find(|(_, given)| *given).map(|(name, _)| *name);
    if let Some(content) = Content::of(source, panel.get(), progress)? {
        let Encoding::View(view) = asked.encoding(py, Encoding::View(ViewEncoding::default()))? else {
            let what = format!("{} encodes a field: hologram(points, panel) makes it", encoding.unwrap_or_default());
            return refused(py, "encoding", what);
        };
        if let Some(name) = first(&aside) {
            return refused(py, name, "view has no use for it; leave it out");
        }
        let sub_frames = match subframes {
            None => None,
            Some(count) => Some(SubFrames::new(count, Multiplexing::Phases, seed).raise(py)?),
        };
        let setup = &wavelengths.map_or_else(|| Ok(setup.clone()), |three| three.light(py, setup))?;
        if setup.lasers.is_some() && subframes.is_some() {
            return refused(py, "subframes", "are of one laser: leave out wavelengths");
        }
        let looking = Looking { eye, pupil, eye_box };
        let mut frames = for_an_eye(py, &content, setup, looking, view, sub_frames, progress)?;
        if subframes.is_none() && setup.lasers.is_none() {
            return Ok(frames.pop().flatten().map(|frame| Bound::new(py, frame)).transpose()?.into_pyobject(py)?);
        }
        return Ok(PyList::new(py, frames)?.into_any());
    }
    let encode_field = |source: &Bound<'py, PyAny>, setup: &Setup| -> PyResult<Frame> {
        let given = Given::on_panel(source, setup)?;
        let (field, content, are_phases) = given.get();
        content.on_panel().raise(py)?;
        let usual = if are_phases { Encoding::Kinoform } else { Encoding::usual(setup.profile.modulation()) };
        let chosen = asked.encoding(py, usual)?;
        if let Encoding::View(_) = chosen {
            return refused(
                py,
                "encoding",
                "view shows an eye a scene: give a LightField, Points or Scene, not a field",
            );
        }
        if let Some(name) = first(&for_eyes) {
            return refused(py, name, format!("{} has no use for it; leave it out", chosen.name()));
        }
        if (field.wavelength - setup.wavelength).abs() > 1e-6 * setup.wavelength {
            let [own, panel] = [field.wavelength, setup.wavelength].map(show_length);
            return refused(
                py,
                "field",
                format!("is one of {own}, the panel's laser has {panel}: take panel.at(\"{own}\")"),
            );
        }
        let options = EncodeOptions {
            encoding: Some(chosen),
            blaze: blaze.map_or([0.0; 2], |(x, y)| [x.0, y.0]),
            lens: lens.map(|lens| lens.0),
            stop: stop.map_or(0.0, |stop| stop.0),
        };
        let origin = Origin { source: Some("Python".into()), depth: content.depth, ..Origin::default() };
        let encoded = run(py, progress, |progress| pipeline::frame(field, setup, &options, origin, progress))?;
        Frame::encoded(py, encoded)
    };
    let Ok(fields) = source.cast::<PyList>() else {
        return Ok(Bound::new(py, encode_field(source, setup)?)?.into_any());
    };
    if !fields.iter().any(|field| field.cast::<Field>().is_ok()) {
        // Rows of numbers.
        return Ok(Bound::new(py, encode_field(source, setup)?)?.into_any());
    }
    let one = |given: Bound<'py, PyAny>| match given.cast::<Field>() {
        Ok(field) => {
            let wavelength = field.get().samples.wavelength;
            encode_field(&given, &Setup { wavelength, ..setup.clone() }).map(Some)
        }
        Err(_) if given.is_none() => Ok(None),
        Err(_) => refused(py, "field", "a list of fields holds Fields, and None for a laser without light"),
    };
    let frames = fields.iter().map(one).collect::<PyResult<Vec<_>>>()?;
    Ok(PyList::new(py, frames)?.into_any())
}
