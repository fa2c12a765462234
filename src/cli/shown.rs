//! What `show` has made, and the pictures of it.

use super::args::ShowArgs;
use super::eye;
use super::load::{Input, Points};
use super::pictures::report_gallery;
use super::report::Report;
use super::resolve;
use crate::Result;
use crate::encode::{Encoding, ViewEncoding};
use crate::field::npy::Content;
use crate::light_field::{LightField, Retina, Viewer};
use crate::panel::{Frame, Modulation, Setup};
use crate::pipeline::{self, Settings};
use crate::progress::Progress;
use crate::reconstruction::{Target, sharpest};
use crate::units::show_length;
use std::time::Instant;

/// Frames of one picture, and what is known of it.
pub(super) struct Shown {
    /// Those of three lasers, where there are three: none for one without light.
    pub(super) frames: Vec<Option<Frame>>,
    pub(super) content: Content,
    pub(super) points: Option<Points>,
    pub(super) views: Views,
}

/// What an eye should see.
pub(super) enum Views {
    /// Nobody knows, or asks.
    Unknown,
    /// What the frames were made of.
    Found(LightField, Viewer),
    /// What the frames, made without it, are judged by: found once they are there.
    Wanted(Viewer),
}

impl Shown {
    pub(super) fn new(frames: Vec<Option<Frame>>, content: Content) -> Self {
        Self { frames, content, points: None, views: Views::Unknown }
    }

    /// The pictures: as the viewer sees it, where it is known what should be seen, and with all of the panel's light.
    pub(super) fn look(
        &self,
        args: &ShowArgs,
        setup: &Setup,
        settings: &Settings,
        progress: &Progress,
        report: &mut Report,
    ) -> Result<()> {
        let frames: Vec<_> = self.frames.iter().map(Option::as_ref).collect();
        let scene = self.points.as_ref().and_then(|points| points.scene.as_ref()).map(|(_, scene)| scene);
        let is_view = matches!(settings.encode.encoding, Some(Encoding::View(_)));
        if !is_view {
            let looked = Instant::now();
            let scene = scene.filter(|_| settings.sub_frames.is_none());
            let content = self.content_or_swept(settings, progress, report)?;
            let gallery = pipeline::pictures(&frames, setup, &Target::new(content, scene), &settings.bench, progress)?;
            gallery.write(&args.output)?;
            report_gallery(&gallery, scene, frames.len(), looked, report);
        }
        let found;
        let (light, viewer) = match (&self.views, &self.points) {
            (Views::Found(light, viewer), _) => (light, viewer),
            (Views::Wanted(viewer), Some(points)) => {
                found = eye::light_field(&eye::Content::Points(points), setup, settings, progress, report)?;
                (&found, viewer)
            }
            _ => return Ok(()),
        };
        let (bench, channel, sweeps) = (&settings.bench, settings.channel, args.sweeps);
        let look = eye::Look { light, scene, viewer, channel, bench, sweeps };
        eye::look(&frames, setup, &look, &args.output, progress, report)
    }
}

/// Nearest and farthest distance at which a picture of unknown depth is looked for [m].
const SWEPT: [f64; 2] = [5e-3, 1.0];
/// Contrast of a plane in focus over that of planes out of it, from which on it is believed.
const SHARP: f64 = 1.2;

impl Shown {
    /// Where the content stands; of another program's frame where a sweep finds it sharp.
    fn content_or_swept(&self, settings: &Settings, progress: &Progress, report: &mut Report) -> Result<Content> {
        let [Some(frame)] = &self.frames[..] else { return Ok(self.content) };
        if self.content.depth.is_some() || self.points.is_some() {
            return Ok(self.content);
        }
        let light = pipeline::light(frame, &settings.bench, progress)?;
        let found = sharpest(&light.field, SWEPT, &light.settings, progress)?;
        let [near, far] = SWEPT.map(show_length);
        let is_inside = found.z.abs() < 0.95 * SWEPT[1];
        report.value("sharpest", found.z);
        if !is_inside || found.contrast < SHARP * found.usual {
            report.warn([format!(
                "no plane from {near} to {far} on either side of the panel is sharp (a hologram for a lens?); \
                 --focus says where to look, --lens puts a lens on a field"
            )]);
        }
        report.line(format!(
            "focus                  {} is the sharpest plane of a sweep from {near} to {far} on both sides; --focus says another",
            show_length(found.z)
        ));
        Ok(Content { depth: Some([found.z; 2]), ..self.content })
    }
}

/// The encoding where none is typed: made for the eye, where the input has views for it and the panel's light fills its pupil.
pub(super) fn usual(args: &ShowArgs, source: &Input, setup: &Setup) -> Encoding {
    let modulation = setup.profile.modulation();
    let viewer = resolve::viewer(&args.viewer, Some(&args.placement), None);
    let seen = match source {
        Input::Scene(_) | Input::Points(_) | Input::Images(..) => {
            Retina::of(&viewer, &setup.grid, setup.wavelength).is_ok()
        }
        Input::Views(_) => true,
        Input::Field(_) | Input::Frame(_) | Input::Stack(_) => false,
    };
    match modulation {
        Modulation::Phase if seen => Encoding::View(ViewEncoding::default()),
        _ => Encoding::usual(modulation),
    }
}
