//! Frames for an eye that moves: what it sees of the scene is rendered once for the box about it, and each frame goes on from the
//! one before, whose wave is made to converge where the eye is now.

use super::request::{Detail, Request};
use crate::encode::view::{Viewed, carried_over};
use crate::encode::{Encoded, ViewEncoding};
use crate::error::{Error, Result};
use crate::light_field::{LightField, LightSource, Pupil, Viewer};
use crate::panel::{Frame, Origin, Setup};
use crate::pipeline::{self, Settings};
use crate::points::{LitScene, ScenePoints};
use crate::progress::Progress;
use glam::{DVec2, DVec3};
use std::path::Path;
use std::sync::Arc;

/// Box about an eye for which views are made at once, where none was asked for [m].
const BOX: DVec2 = DVec2::new(6e-3, 4e-3);
/// Steps of the first coarse frame, and of one that goes on from another; those that refine either.
const FIRST: [usize; 2] = [8, 28];
const NEXT: [usize; 2] = [3, 12];

/// Views of the scene as it stands, and what was shown last.
#[derive(Default)]
pub(super) struct Tracked {
    views: Option<Views>,
    shown: Option<Shown>,
}

struct Views {
    request: Request,
    detail: Detail,
    viewer: Viewer,
    light: LightField,
    points: Arc<ScenePoints>,
}

/// The phases that the last frame asks for.
struct Shown {
    wishes: Vec<f32>,
    eye: DVec3,
    wavelength: f64,
}

impl Views {
    /// Whether they show a request's scene to its eye, as finely as they should.
    fn serve(&self, request: &Request, detail: Detail) -> bool {
        let own = &self.request;
        let aside = (request.eye - self.viewer.eye).truncate().abs();
        (own.turn, own.shift, own.wavelength) == (request.turn, request.shift, request.wavelength)
            && request.eye.z == self.viewer.eye.z
            && aside.cmple(0.5 * self.viewer.eye_box + DVec2::splat(1e-9)).all()
            && self.detail >= detail
    }
}

/// What the frames are of: the scene in its light at a level, and its points by few rays.
pub(super) struct Subject<'a> {
    pub(super) lit: &'a LitScene,
    pub(super) points: ScenePoints,
}

impl Tracked {
    /// Whether the views at hand serve a request: then its light need not be computed.
    pub(super) fn serves(&self, request: &Request, detail: Detail) -> bool {
        self.views.as_ref().is_some_and(|views| views.serve(request, detail))
    }

    /// Keeps the views of a scene: at the coarse level those that the eye sees where it is, at the full one those of its box.
    ///
    /// # Errors
    /// As [`pipeline::light_field`].
    pub(super) fn look_at(
        &mut self,
        subject: Subject,
        request: &Request,
        detail: Detail,
        setup: &Setup,
        settings: &Settings,
        progress: &Progress,
    ) -> Result<()> {
        let eye_box = match detail {
            Detail::Coarse => DVec2::ZERO,
            _ if settings.viewer.eye_box == DVec2::ZERO => BOX,
            _ => settings.viewer.eye_box,
        };
        let viewer = Viewer { eye: request.eye, eye_box, ..settings.viewer };
        let settings = Settings { viewer, ..settings.clone() };
        let source = LightSource::Scene { lit: subject.lit, points: &subject.points };
        let light = pipeline::light_field(&source, setup, &settings, progress)?.0;
        let points = Arc::new(subject.points);
        self.views = Some(Views { request: request.clone(), detail, viewer, light, points });
        Ok(())
    }

    /// The frame for the eye where it is now.
    ///
    /// # Errors
    /// As [`pipeline::views`].
    pub(super) fn frame(
        &mut self,
        request: &Request,
        detail: Detail,
        setup: &Setup,
        settings: &Settings,
        path: &Path,
        progress: &Progress,
    ) -> Result<(Frame, Arc<ScenePoints>)> {
        let Some(views) = &self.views else { return Err(Error::parameter("views", "there are none yet")) };
        let viewer = Viewer { eye: request.eye, eye_box: DVec2::ZERO, ..views.viewer };
        if viewer.pupil == Pupil::All {
            return Err(Error::parameter("pupil", "a tracked eye has one with a diameter"));
        }
        let before = self.shown.as_ref().filter(|shown| shown.wavelength == request.wavelength);
        let start = before.map(|shown| carried_over(&shown.wishes, setup, shown.wavelength, shown.eye, request.eye));
        let steps = if start.is_some() { NEXT } else { FIRST };
        let view =
            ViewEncoding { iterations: Some(steps[usize::from(detail != Detail::Coarse)]), ..Default::default() };
        let exposures = pipeline::exposures(setup, settings, None);
        let start: Vec<_> = start.into_iter().collect();
        let found = pipeline::views(&views.light, &viewer, &exposures, setup, &view, &start, progress)?;
        let Some(Viewed { frames, wishes, .. }) = found.into_iter().flatten().next() else {
            return Err(Error::input(path, "has no light for this laser"));
        };
        let (Some(Encoded { mut frame, .. }), Some(wishes)) = (frames.into_iter().next(), wishes.into_iter().next())
        else {
            return Err(Error::parameter("exposures", "there is none"));
        };
        self.shown = Some(Shown { wishes, eye: request.eye, wavelength: request.wavelength });
        frame.metadata.origin =
            Origin { source: Some(path.display().to_string()), depth: Some(views.light.depth), ..Origin::default() };
        Ok((frame, views.points.clone()))
    }
}
