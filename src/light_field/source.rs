//! Where light fields come from: one call for every kind of content.

use super::{LightField, LightFieldReport, LightFieldSettings, Pupil, Retina, Viewer};
use crate::error::{Error, Result};
use crate::points::{LitScene, PointCloud, ScenePoints};
use crate::progress::Progress;
use crate::units::show_length;
use glam::{DVec2, DVec3};

/// What is to be seen.
#[derive(Clone, Copy)]
pub enum LightSource<'a> {
    /// A scene in its light, placed before the panel.
    Scene {
        /// The scene.
        lit: &'a LitScene,
        /// Its points, which say where it stands and what is white.
        points: &'a ScenePoints,
    },
    /// A point cloud.
    Cloud {
        /// The points.
        cloud: &'a PointCloud,
        /// The eye that their amplitudes are meant for [m].
        eye: DVec3,
    },
    /// Views from a file or another program.
    Views(&'a LightField),
}

impl LightSource<'_> {
    /// The views that a viewer's pupils take in, on the lattice of a retina.
    ///
    /// # Errors
    /// As [`Retina::eyes`], [`LightField::of_scene`] and [`LightField::of_cloud`]; [`Error::Parameter`] for views that do not
    /// reach as far as the viewer's pupils.
    pub fn views(
        &self,
        viewer: &Viewer,
        retina: &Retina,
        settings: &LightFieldSettings,
        progress: &Progress,
    ) -> Result<(LightField, Option<LightFieldReport>)> {
        let eyes = retina.eyes(viewer)?;
        let whole = 0.5 * DVec2::new(retina.panel.extent_x(), retina.panel.extent_y());
        match *self {
            Self::Scene { lit, points } => {
                let placing = &points.view.placing;
                let settings =
                    LightFieldSettings { white: Some(points.white.white), clips: points.white.clips, ..*settings };
                let window = retina.window(placing.window)?;
                LightField::of_scene(lit, placing, &settings, eyes, window, progress).map(|(l, r)| (l, Some(r)))
            }
            Self::Cloud { cloud, eye } => {
                let window = retina.window(whole)?;
                LightField::of_cloud(cloud, eye, settings, eyes, window, progress).map(|(l, r)| (l, Some(r)))
            }
            Self::Views(light) => {
                check_reach(light, viewer)?;
                let half = DVec2::new(light.window.extent_x(), light.window.extent_y()) * 0.5;
                let window = retina.window(half.min(whole))?;
                let fits = retina.fits(&light.window);
                Ok((if fits { light.clone() } else { light.resampled(window)? }, None))
            }
        }
    }
}

/// Refuses pupils beyond the views, and eyes in another plane.
fn check_reach(light: &LightField, viewer: &Viewer) -> Result<()> {
    let eyes = &light.eyes;
    if (eyes.distance - viewer.eye.z).abs() > 1e-3 * eyes.distance {
        let limit = format!("is not where the views stand, {} m before the panel", eyes.distance);
        return Err(Error::out_of_range("eye", format_args!("z = {} m", viewer.eye.z), limit));
    }
    let Pupil::Diameter(pupil) = viewer.pupil else { return Ok(()) };
    let spread = 0.5 * eyes.spacing * DVec2::new(eyes.columns as f64, eyes.rows as f64);
    let needed = (viewer.eye.truncate() - eyes.center).abs() + 0.5 * (viewer.eye_box + DVec2::splat(pupil));
    if needed.cmpgt(spread + DVec2::splat(0.5 * eyes.spacing)).any() {
        let [width, height] = (2.0 * spread).to_array().map(show_length);
        let limit = format!("reaches beyond the views with its pupils: they spread over {width} × {height}");
        let [x, y] = (2.0 * needed).to_array().map(show_length);
        return Err(Error::out_of_range("eye box", format_args!("{x} × {y}"), limit));
    }
    Ok(())
}
