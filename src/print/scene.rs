//! From a scene or a cloud to what the plate's segments see.

use super::fringe::Maker;
use super::manifest::{Settings, inputs};
use super::plate::Plate;
use super::preview::Preview;
use super::reference::Band;
use super::views::{Source, Views};
use crate::error::{Error, Result};
use crate::hologram::InstructionSet;
use crate::illumination::{Illumination, IlluminationSettings};
use crate::points::colour::Lasers;
use crate::points::trace::{self, TraceSettings};
use crate::points::{Channel, PointSource, ply};
use crate::progress::Progress;
use crate::reconstruction::ColorPicture;
use crate::scene::{SceneBvh, gltf};
use glam::DVec3;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A scene or a cloud, and how it is lit.
#[derive(Clone, Debug)]
pub struct Task {
    /// A .gltf, .glb or .ply file.
    pub input: PathBuf,
    /// Camera of the scene, by name or number.
    pub camera: Option<String>,
    /// Animation clip.
    pub animation: Option<String>,
    /// Time in it [s].
    pub time: f64,
    /// Whether light from the viewer is added.
    pub viewer_light: bool,
    /// Most mirrors and glass surfaces on a path.
    pub bounces: u32,
    /// Photons for caustics.
    pub photons: u32,
    /// Radiance that is shown as white [W/(m² sr)]; found from the middle of the view where `None`.
    pub white: Option<f32>,
}

impl Task {
    /// A file with default light.
    pub fn new(input: PathBuf) -> Self {
        let light = IlluminationSettings::default();
        Self {
            input,
            camera: None,
            animation: None,
            time: 0.0,
            viewer_light: false,
            bounces: light.bounces,
            photons: light.photons,
            white: None,
        }
    }

    fn is_cloud(&self) -> bool {
        self.input.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply"))
    }

    /// What decides a plate of this.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn settings(&self, plate: &Plate) -> Result<Settings> {
        let mut options = BTreeMap::new();
        if !self.is_cloud() {
            let pairs = [
                ("camera", json!(self.camera)),
                ("animation", json!(self.animation)),
                ("time", json!(self.time)),
                ("viewer_light", json!(self.viewer_light)),
                ("bounces", json!(self.bounces)),
                ("photons", json!(self.photons)),
                ("white", json!(self.white)),
            ];
            options.extend(pairs.map(|(key, value)| (key.to_owned(), value)));
        }
        Ok(Settings::new(plate, inputs(&self.input)?, options))
    }

    /// The same file under the settings of a plate that was made of it.
    ///
    /// # Errors
    /// [`Error::Input`] when the file is not the one that the plate was made of.
    pub fn of(input: PathBuf, settings: &Settings) -> Result<Self> {
        let text = |key: &str| settings.options.get(key).and_then(Value::as_str).map(str::to_owned);
        let number = |key: &str| settings.options.get(key).and_then(Value::as_u64).and_then(|v| u32::try_from(v).ok());
        let default = Self::new(input);
        let task = Self {
            camera: text("camera"),
            animation: text("animation"),
            time: settings.options.get("time").and_then(Value::as_f64).unwrap_or(0.0),
            viewer_light: settings.options.get("viewer_light") == Some(&Value::Bool(true)),
            bounces: number("bounces").unwrap_or(default.bounces),
            photons: number("photons").unwrap_or(default.photons),
            white: settings.options.get("white").and_then(Value::as_f64).map(|w| w as f32),
            ..default
        };
        if inputs(&task.input)? != settings.inputs {
            return Err(Error::input(&task.input, "is not the file that the plate was made of, or has changed since"));
        }
        Ok(task)
    }

    /// Lights the scene, or reads the points, and lets `work` make tiles of it.
    ///
    /// `white` overrules the scene's own: the manifest's, so that all parts of a plate have the same.
    ///
    /// # Errors
    /// Those of the scene, its light and its placement; [`Error::Undersampled`] and [`Error::Parameter`] for a reference
    /// that does not fit; what `work` returns.
    pub fn with<R>(
        &self,
        plate: &Plate,
        white: Option<f32>,
        instruction_set: InstructionSet,
        progress: &Progress,
        work: impl FnOnce(&Maker) -> Result<R>,
    ) -> Result<R> {
        // Before the light, which may take long.
        let band = Band::of(plate)?;
        if self.is_cloud() {
            let read = ply::read(&self.input)?;
            if read.metadata.as_ref().is_some_and(|m| m.frame == ply::Frame::World) {
                let what = "its points stand in the scene's own metres; write them with --frame hologram";
                return Err(Error::input(&self.input, what));
            }
            let source = match plate.wavelengths() {
                &[a, b, c] => {
                    let lasers = Lasers::new([a, b, c])?;
                    Source::ColorCloud([0, 1, 2].map(|index| lasers.points(&read.cloud, index)))
                }
                _ => Source::Cloud(read.cloud.channel(Channel::Luminance)),
            };
            let shine = |points: &[PointSource]| points.iter().any(|p| p.amplitude > 0.0);
            let shines = match &source {
                Source::Cloud(points) => shine(points),
                Source::ColorCloud(points) => points.iter().any(|p| shine(p)),
                Source::Scene(_) => true,
            };
            if !shines {
                return Err(Error::input(&self.input, "has no points that shine"));
            }
            return work(&Maker { plate, band, source: &source, instruction_set });
        }
        self.lit(plate, white, progress, |views| {
            let source = Source::Scene(Box::new(views));
            work(&Maker { plate, band, source: &source, instruction_set })
        })
    }

    fn lit<R>(
        &self,
        plate: &Plate,
        white: Option<f32>,
        progress: &Progress,
        work: impl FnOnce(Views) -> Result<R>,
    ) -> Result<R> {
        progress.start("scene", 0);
        let options = gltf::LoadOptions {
            camera: self.camera.as_deref().map(gltf::Choice::from),
            clip: self.animation.as_deref().map_or(gltf::Clip::First, |name| gltf::Clip::Of(gltf::Choice::from(name))),
            time: self.time,
            viewer_light: self.viewer_light,
            ..gltf::LoadOptions::default()
        };
        let loaded = gltf::load(&self.input, &options)?;
        let camera = loaded.scene.cameras.first().ok_or_else(|| Error::input(&self.input, "has no camera"))?;
        let bvh = SceneBvh::new(loaded.scene.clone());
        let settings = IlluminationSettings {
            bounces: self.bounces,
            photons: self.photons,
            seed: plate.seed,
            ..IlluminationSettings::default()
        };
        let light = Illumination::new(bvh, settings, progress)?;
        if light.is_dark() {
            return Err(Error::input(&self.input, "its lights give no light; raise their intensity or emission"));
        }
        let white = white.or(self.white);
        work(Views::new(&light, &loaded.scene, camera, plate, white, self.bounces, progress)?)
    }

    /// The picture that an eye at `eye` [m] should see where a preview stands, by ray tracing, with its white.
    ///
    /// # Errors
    /// As [`Task::with`]; [`Error::Parameter`] for a cloud, which hides nothing.
    pub fn traced(
        &self,
        plate: &Plate,
        eye: [f64; 3],
        focus: f64,
        seen: &Preview,
        progress: &Progress,
    ) -> Result<(ColorPicture, f32)> {
        if self.is_cloud() {
            return Err(Error::parameter("traced", "points cannot be traced; give the scene"));
        }
        self.lit(plate, None, progress, |views| {
            let (width, height) = (seen.picture.width, seen.picture.height);
            let distance = eye[2] - focus;
            let cell = [2.0 * seen.half.x / width as f64, 2.0 * seen.half.y / height as f64];
            // Straight ahead and wide enough, two rays a cell and side; then the part that the preview shows.
            let offset = [seen.center[0] - eye[0], seen.center[1] - eye[1]];
            let rays = [0, 1].map(|axis| {
                let half = offset[axis].abs() + seen.half[axis];
                (2.0 * (2.0 * half / cell[axis])).ceil().max(2.0)
            });
            if rays[0] * rays[1] > 64e6 {
                return Err(Error::parameter(
                    "eye",
                    "stands so far aside that its view cannot be traced; take a smaller --size",
                ));
            }
            let step = cell.map(|c| 0.5 * c);
            // Rays have one scale for both axes: the picture's shape makes up for cells that are not square.
            let tall = 0.5 * rays[1] * step[1] / distance;
            let wide = 0.5 * rays[0] * step[0] / distance;
            let columns = (rays[1] * wide / tall).round().max(1.0);
            let camera = views.camera(DVec3::from_array(eye), tall);
            let settings = TraceSettings {
                width: columns as u32,
                height: rays[1] as u32,
                bounces: self.bounces,
                seed: plate.seed,
                edge_rays: 1,
                ..TraceSettings::default()
            };
            let traced = trace::trace(views.light(), &camera, &settings, progress)?;
            let (mut sums, mut counts) = (vec![[0.0f64; 3]; width * height], vec![0u32; width * height]);
            let step_x = 2.0 * tall * distance / rays[1];
            for (index, rgb) in traced.picture.iter().enumerate() {
                let (column, row) = (index % columns as usize, index / columns as usize);
                let x = (column as f64 + 0.5 - 0.5 * columns) * step_x - offset[0] + seen.half.x;
                let y = (row as f64 + 0.5 - 0.5 * rays[1]) * step[1] + offset[1] + seen.half.y;
                let (column, row) = ((x / cell[0]).floor(), (y / cell[1]).floor());
                if (0.0..width as f64).contains(&column) && (0.0..height as f64).contains(&row) {
                    let at = row as usize * width + column as usize;
                    sums[at].iter_mut().zip(rgb).for_each(|(sum, v)| *sum += f64::from(*v));
                    counts[at] += 1;
                }
            }
            let mean = |(sum, n): (&[f64; 3], &u32)| sum.map(|sum| (sum / f64::from((*n).max(1))) as f32);
            let rgb = sums.iter().zip(&counts).map(mean).collect();
            Ok((ColorPicture { width, height, rgb }, views.white()))
        })
    }
}
