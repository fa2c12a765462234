//! What a hologram shows: points, the same from everywhere, or a lit scene.

use super::plane::Segments;
use super::scene::PlacedScene;
use super::slit::{LinePoint, Strip};
use super::views::PlacedViews;
use crate::error::{Error, Result};
use crate::illumination::{Illumination, IlluminationSettings, Quality};
use crate::points::colour::Lasers;
use crate::points::{Channel, PointCloud, PointSource, clouds, ply};
use crate::progress::Progress;
use crate::scene::environment::{Panorama, Sky};
use crate::scene::{SceneBvh, gltf};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// What the segments of a plane see.
pub enum Object {
    /// Points that stand in the hologram frame, the same for all segments.
    Points(Vec<PointSource>),
    /// The same for three lasers, red, green, blue.
    ColorPoints([Vec<PointSource>; 3]),
    /// A lit scene.
    Scene(Box<PlacedScene>),
    /// Views from places before the plane.
    Views(Box<PlacedViews>),
}

/// What of a scene's file is taken, and how it is lit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SceneOptions {
    /// Camera of the scene, by name or number.
    pub camera: Option<String>,
    /// Animation clip.
    pub animation: Option<String>,
    /// Time in it [s].
    pub time: f64,
    /// Whether light from the viewer is added.
    pub viewer_light: bool,
    /// Whether the file's URIs may point outside of its folder.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub allow_outside: bool,
    /// What lights the scene from all around.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub environment: Option<Panorama>,
    /// Sun and sky instead of that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sky: Option<Sky>,
    /// Most mirrors and glass surfaces on a path.
    pub bounces: u32,
    /// Photons for caustics.
    pub photons: u32,
    /// The error that the light may have, root mean square over its mean.
    #[serde(skip_serializing_if = "is_usual")]
    pub light_error: f64,
    /// Radiance that is shown as white [W/(m² sr)]; found from the middle of the view where `None`.
    pub white: Option<f32>,
}

impl Default for SceneOptions {
    fn default() -> Self {
        let IlluminationSettings { bounces, photons, .. } = IlluminationSettings::default();
        Self {
            camera: None,
            animation: None,
            time: 0.0,
            viewer_light: false,
            allow_outside: false,
            environment: None,
            sky: None,
            bounces,
            photons,
            light_error: Quality::Normal.error(),
            white: None,
        }
    }
}

#[expect(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_usual(error: &f64) -> bool {
    *error == Quality::Normal.error()
}

/// Whether a file is a point cloud, and no scene.
pub(crate) fn is_cloud(path: &Path) -> bool {
    clouds::is_cloud(path) && !gltf::is_scene(path)
}

impl Object {
    /// Reads points (a cloud), or lights a scene and places it.
    ///
    /// # Errors
    /// Those of the file, its light and its placement; [`Error::Input`] for one without light.
    pub fn read(path: &Path, options: &SceneOptions, plane: &Segments, progress: &Progress) -> Result<Self> {
        if is_cloud(path) {
            return Self::cloud(path, plane);
        }
        progress.start("scene", 0);
        let load = gltf::LoadOptions {
            camera: options.camera.as_deref().map(gltf::Choice::from),
            clip: options
                .animation
                .as_deref()
                .map_or(gltf::Clip::First, |name| gltf::Clip::Of(gltf::Choice::from(name))),
            time: options.time,
            viewer_light: options.viewer_light,
            allow_outside: options.allow_outside,
            environment: options.environment.clone(),
            sky: options.sky,
            ..gltf::LoadOptions::default()
        };
        let loaded = gltf::load(path, &load)?;
        let camera = loaded.scene.cameras.first().ok_or_else(|| Error::input(path, "has no camera"))?;
        let bvh = SceneBvh::new(loaded.scene.clone());
        let SceneOptions { bounces, photons, white, .. } = *options;
        let usual = IlluminationSettings::default().for_error(options.light_error)?;
        let settings = IlluminationSettings { bounces, photons, seed: plane.seed, ..usual };
        let light = Illumination::new(bvh, settings, progress)?;
        // What is unlit shines by itself, and nothing lights it.
        let unlit = light.bvh().scene().materials.iter().any(|material| material.unlit);
        if light.is_dark() && !unlit {
            return Err(Error::input(path, "its lights give no light; raise their intensity or emission"));
        }
        let placed = PlacedScene::new(light, camera, plane, white, bounces, progress)?;
        Ok(Self::Scene(Box::new(placed)))
    }

    fn cloud(path: &Path, plane: &Segments) -> Result<Self> {
        let read = clouds::read(path)?;
        if read.metadata.as_ref().is_some_and(|m| m.frame == ply::Frame::World) {
            let what = "its points stand in the scene's own metres; write them in the hologram frame";
            return Err(Error::input(path, what));
        }
        Self::of_cloud(&read.cloud, plane)?.ok_or_else(|| Error::input(path, "has no points that shine"))
    }

    /// Points as a plane's lamps show them; none where no point shines.
    ///
    /// # Errors
    /// As [`Lasers::new`].
    pub(crate) fn of_cloud(cloud: &PointCloud, plane: &Segments) -> Result<Option<Self>> {
        let lamps = plane.slit.as_ref().map_or(&[][..], |slit| &slit.wavelengths);
        let object = match lamps {
            &[a, b, c] => {
                let lasers = Lasers::new([a, b, c])?;
                Self::ColorPoints([0, 1, 2].map(|index| lasers.points(cloud, index)))
            }
            _ => Self::Points(cloud.channel(Channel::Luminance)),
        };
        let shines = object.clouds().iter().flatten().any(|p| p.amplitude > 0.0);
        Ok(shines.then_some(object))
    }

    /// The points of each laser, or of one; none of a scene.
    pub(crate) fn clouds(&self) -> &[Vec<PointSource>] {
        match self {
            Self::Scene(_) | Self::Views(_) => &[],
            Self::Points(points) => std::slice::from_ref(points),
            Self::ColorPoints(points) => points,
        }
    }

    /// Lowest and highest z of what shines [m]; of a scene, of all that is in it.
    pub fn depths(&self) -> [f64; 2] {
        match self {
            Self::Scene(scene) => return scene.depths,
            Self::Views(views) => return views.depths(),
            Self::Points(_) | Self::ColorPoints(_) => {}
        }
        let depths = self.clouds().iter().flatten().map(|p| p.position.z);
        depths.fold([f64::INFINITY, f64::NEG_INFINITY], |d, z| [d[0].min(z), d[1].max(z)])
    }

    /// Points whose light a segment needs.
    pub(super) fn points(&self, plane: &Segments, segment: [i64; 2], progress: &Progress) -> Result<Vec<PointSource>> {
        let points = match self {
            Self::Scene(scene) => return scene.points(plane, segment, progress),
            Self::Views(views) => return Ok(views.points(plane, segment)),
            Self::Points(points) | Self::ColorPoints([points, ..]) => points,
        };
        let (band, pitch) = (&plane.band, [plane.grid.pitch_x, plane.grid.pitch_y]);
        let center = plane.center(segment);
        let half = pitch.map(|pitch| (0.5 * plane.size[0] as f64 + 64.0) * pitch);
        // The taper's tail reaches a little beyond the band; the engines know how far exactly.
        let tangent = band.half.map(|f| (f * plane.wavelength * 1.1).min(0.95).asin().tan());
        let edge = 8.0 * pitch[0].max(pitch[1]) * f64::from(band.divisor[0].max(band.divisor[1]));
        let near = |p: &&PointSource| {
            let offset = [p.position.x - center[0], p.position.y - center[1]];
            (0..2).all(|axis| offset[axis].abs() <= half[axis] + edge + p.position.z.abs() * tangent[axis])
        };
        Ok(points.iter().filter(near).copied().collect())
    }

    /// Points that a segment of a strip shows.
    pub(super) fn line_points(
        &self,
        plane: &Segments,
        segment: [i64; 2],
        strip: &Strip,
        progress: &Progress,
    ) -> Result<Vec<LinePoint>> {
        let points = match self {
            Self::Scene(scene) => return scene.line_points(plane, segment, strip, progress),
            Self::Views(_) => return Err(Error::parameter("plate", "has a slit; views are for a plate without one")),
            Self::Points(points) => points,
            Self::ColorPoints(points) => &points[strip.laser().unwrap_or(0)],
        };
        let pitch = plane.grid.pitch_x;
        let [x, _] = plane.center(segment);
        let widest = strip.widest(&plane.band);
        let tangent = widest / (1.0 - widest * widest).sqrt();
        let [_, cosine] = strip.inclination();
        let reach = (0.5 * plane.size[0] as f64 + 64.0) * pitch;
        let shown = |p: &&PointSource| {
            p.position.z < strip.distance
                && (-0.5 * strip.height..0.5 * strip.height).contains(&strip.meets(p.position.y, p.position.z))
                && (p.position.x - x).abs() <= reach + p.position.z.abs() / cosine * tangent
        };
        // On the axis a point's wave has amplitude a/r; that of a line point has a'/√r.
        let line = |p: &PointSource| {
            let zeta = p.position.z / cosine;
            let zeta = if zeta == 0.0 { -f64::MIN_POSITIVE } else { zeta };
            let amplitude = p.amplitude / zeta.abs().max(pitch).sqrt() as f32;
            LinePoint { x: p.position.x, zeta, amplitude, phase: p.phase }
        };
        Ok(points.iter().filter(shown).map(line).collect())
    }
}
