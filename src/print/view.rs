//! How a finished plate looks to an eye, in the light of its lamps, and how it should by ray tracing.

use super::flat_target::target;
use super::lamp::Lamp;
use super::manifest::{Manifest, NOT_THE_INPUT, Settings};
use super::plate::Plate;
use super::preview::{Preview, PreviewSettings, preview};
use super::source::{PictureFiles, Source};
use super::view_files::ViewFiles;
use crate::error::{Error, Result};
use crate::points::colour::Lasers;
use crate::progress::Progress;
use crate::reconstruction::metrics::{Likeness, blocks, likeness};
use crate::reconstruction::{ColorPicture, Picture, Scale, write_rgb_png};
use crate::segments::{Object, PlacedScene, PlacedViews};
use glam::DVec3;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// What was looked at, and what is seen.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ViewReport {
    /// Middle of the pupil in the hologram frame [m].
    pub eye: [f64; 3],
    /// Depth in focus, z [m].
    pub focus: f64,
    /// Wavelengths of the lamps [m].
    pub wavelengths: Vec<f64>,
    /// The lamp, where it was not a distant point of one wavelength.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lamp: Option<Lamp>,
    /// Middle (x, y) of the picture on the plane in focus [m].
    pub center: [f64; 2],
    /// Its half width and half height [m].
    pub half: [f64; 2],
    /// Share of the light that goes towards the pupil which passes it.
    pub passed: f64,
    /// Mean power of the picture's cells.
    pub brightness: f64,
    /// The lamp's own light goes through the plate into the pupil.
    pub dazzled: bool,
    /// Every how many columns and rows of the plate one sample was kept, where most were.
    pub thinned: [usize; 2],
    /// Wall time [s].
    pub seconds: f64,
    /// How alike the traced picture is, where one was made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub likeness: Option<Likeness>,
    /// The same of means over 4 × 4 cells, which hold less speckle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub likeness_of_blocks: Option<Likeness>,
}

/// What an eye sees of a plate: in the light of one lamp, or of a colour plate's three.
#[derive(Clone, Debug)]
pub struct PlateView {
    /// What was looked at, and what is seen.
    pub report: ViewReport,
    settings: Settings,
    pupil: f64,
    gray: Preview,
    color: Option<ColorPicture>,
}

impl PlateView {
    /// Looks at the finished plate of a folder, in the light of its lamps or of the one that the settings name.
    ///
    /// # Errors
    /// As [`preview`].
    pub fn new(folder: &Path, settings: &PreviewSettings, progress: &Progress) -> Result<Self> {
        let begin = Instant::now();
        let plate = Manifest::of(folder)?.settings;
        let wavelengths = settings.wavelength.map_or_else(|| plate.plate.wavelengths().to_vec(), |one| vec![one]);
        let lit = |wavelength| {
            preview(folder, &PreviewSettings { wavelength: Some(wavelength), ..settings.clone() }, progress)
        };
        let (gray, color) = match wavelengths[..] {
            [a, b, c] => {
                let lasers = Lasers::new([a, b, c])?;
                let [red, green, blue] = lasers.wavelengths();
                let [red, green, blue] = [lit(red)?, lit(green)?, lit(blue)?];
                let channels = [red.picture.clone(), green.picture, blue.picture];
                (red, Some(ColorPicture::combine(&lasers, &channels)))
            }
            _ => (lit(wavelengths[0])?, None),
        };
        let report = ViewReport {
            eye: settings.eye,
            focus: settings.focus,
            wavelengths,
            lamp: settings.lamp,
            center: gray.center,
            half: gray.half.to_array(),
            passed: gray.passed,
            brightness: 0.0,
            dazzled: gray.dazzled,
            thinned: gray.thinned,
            seconds: begin.elapsed().as_secs_f64(),
            likeness: None,
            likeness_of_blocks: None,
        };
        let mut view = Self { report, settings: plate, pupil: settings.pupil, gray, color };
        let luminance = view.luminance();
        let sum: f64 = luminance.values.iter().map(|v| f64::from(*v)).sum();
        view.report.brightness = sum / luminance.values.len().max(1) as f64;
        Ok(view)
    }

    pub(super) fn luminance(&self) -> Picture {
        self.color.as_ref().map_or_else(|| self.gray.picture.clone(), ColorPicture::luminance)
    }

    /// What is seen, in linear light; gray in the light of one lamp.
    pub fn picture(&self) -> ColorPicture {
        self.color.clone().unwrap_or_else(|| gray(&self.gray.picture))
    }

    /// Columns and rows of the picture.
    pub fn size(&self) -> (usize, usize) {
        (self.gray.picture.width, self.gray.picture.height)
    }

    /// The plate.
    pub fn plate(&self) -> &Plate {
        &self.settings.plate
    }

    /// Diameter of the pupil [m].
    pub fn pupil(&self) -> f64 {
        self.pupil
    }

    /// Names of the files that the plate was made of, or of the folder of its views.
    pub(super) fn inputs(&self) -> Vec<String> {
        match self.settings.views() {
            // Their folder stands for all of them.
            Some(reading) => vec![reading.name],
            None => self.settings.inputs.iter().map(|input| input.name.clone()).collect(),
        }
    }

    /// Texts of a picture's file.
    pub(super) fn texts(&self, what: &str) -> [(&'static str, String); 2] {
        let ViewReport { eye, focus, wavelengths, center, half, .. } = &self.report;
        let mut described = serde_json::json!({
            "simulated": true,
            "eye": eye,
            "focus": focus,
            "pupil": self.pupil,
            "wavelengths": wavelengths,
            "center": center,
            "half": half,
        });
        if let Some(lamp) = &self.report.lamp {
            described["lamp"] = serde_json::json!(lamp);
        }
        [("Description", what.to_owned()), ("holodrive", described.to_string())]
    }

    /// Writes the picture (8 bit, sRGB-coded), of which a share of the pixels is not shown brighter than white.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_png(&self, path: &Path, share: f64) -> Result<()> {
        let texts = self.texts("simulated view of a plate's fringes");
        match &self.color {
            None => self.gray.picture.write_png(path, Scale::Percentile(share), &texts),
            Some(color) => write_rgb_png(path, color.width, color.height, &color.rgb, color.percentile(share), &texts),
        }
    }

    /// Writes the picture below words that say what it is.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_labelled(&self, path: &Path, share: f64) -> Result<()> {
        let texts = self.texts("simulated view of a plate's fringes");
        self.labelled(self.white(share)).write_png(path, &texts)
    }

    /// What the same eye should see, and its white.
    fn target(&self, of: &Source, progress: &Progress) -> Result<(ColorPicture, f32)> {
        let plate = &self.settings.plate;
        match (of, self.settings.pictures()) {
            (Source::Pictures(PictureFiles { files, .. }), Some(depths)) => {
                let pictures = PictureFiles { files: files.clone(), depths };
                self.settings.check_pictures(&pictures)?;
                let viewer = DVec3::new(0.0, 0.0, plate.view.viewer);
                let eye = DVec3::from_array(self.report.eye);
                Ok((target(&pictures.points(plate)?, viewer, eye, &self.gray), 1.0))
            }
            (Source::File(scene), None) => {
                let options = self.settings.options_for(scene)?;
                let Object::Scene(scene) = Object::read(scene, &options, &plate.segments()?, progress)? else {
                    return Err(Error::parameter("traced", "points cannot be traced; give the scene"));
                };
                Ok((traced(&scene, self.report.eye, &self.gray, plate.seed, progress)?, scene.white()))
            }
            (Source::Views(ViewFiles { path, .. }), None) if self.settings.views().is_some() => {
                let views = ViewFiles { path: path.clone(), reading: self.settings.views().unwrap_or_default() };
                self.settings.check_views(&views)?;
                let placed = views.placed(plate, &plate.segments()?)?;
                Ok((printed(&placed, self.report.eye, &self.gray), 1.0))
            }
            (of, _) => Err(Error::input(of.path(), NOT_THE_INPUT)),
        }
    }

    /// Traces what the same eye should see of the plate's own scene, writes it, below words where it is not to be bare, and says in
    /// the report how alike both are: cell by cell, and over 4 × 4 cells, which hold less speckle.
    ///
    /// # Errors
    /// [`Error::Input`] when the scene is not the one that the plate was made of; [`Error::Parameter`] for points, which hide
    /// nothing, and for an eye so far aside that too many rays would be cast; those of the scene and its light;
    /// [`Error::Io`].
    pub fn compare(&mut self, of: &Source, path: &Path, bare: bool, progress: &Progress) -> Result<[Likeness; 2]> {
        let (traced, white) = self.target(of, progress)?;
        let texts = self.texts("traced view from the same eye");
        let (seen, target) = (self.luminance(), traced.luminance());
        let alike = [likeness(&seen, &target, white), likeness(&blocks(&seen, 4), &blocks(&target, 4), white)];
        (self.report.likeness, self.report.likeness_of_blocks) = (Some(alike[0]), Some(alike[1]));
        match &self.color {
            _ if !bare => {
                let shown = if self.color.is_some() { traced } else { gray(&target) };
                self.traced_with_words(&shown, white).write_png(path, &texts)?;
            }
            None => target.write_png(path, Scale::White(white), &texts)?,
            Some(_) => write_rgb_png(path, traced.width, traced.height, &traced.rgb, white, &texts)?,
        }
        Ok(alike)
    }
}

/// The picture that an eye at `eye` [m] should see of printed views where a preview stands.
fn printed(views: &PlacedViews, eye: [f64; 3], seen: &Preview) -> ColorPicture {
    let (width, height) = (seen.picture.width, seen.picture.height);
    let at = |i: usize, count: usize, half: f64| half * ((2 * i + 1) as f64 / count as f64 - 1.0);
    let cell = |i: usize| {
        let x = seen.center[0] + at(i % width, width, seen.half.x);
        let y = seen.center[1] - at(i / width, height, seen.half.y);
        [views.seen(DVec3::from_array(eye), DVec3::new(x, y, seen.focus)); 3]
    };
    ColorPicture { width, height, rgb: (0..width * height).map(cell).collect() }
}

fn gray(picture: &Picture) -> ColorPicture {
    let Picture { width, height, values } = picture;
    ColorPicture { width: *width, height: *height, rgb: values.iter().map(|v| [*v; 3]).collect() }
}

/// The picture that an eye at `eye` [m] should see of a scene where a preview stands.
///
fn traced(scene: &PlacedScene, eye: [f64; 3], seen: &Preview, seed: u64, progress: &Progress) -> Result<ColorPicture> {
    let (width, height) = (seen.picture.width, seen.picture.height);
    let distance = eye[2] - seen.focus;
    let cell = [2.0 * seen.half.x / width as f64, 2.0 * seen.half.y / height as f64];
    // Straight ahead and wide enough, two rays a cell and side; then the part that the preview shows.
    let offset = [seen.center[0] - eye[0], seen.center[1] - eye[1]];
    let rays = [0, 1].map(|axis| {
        let half = offset[axis].abs() + seen.half[axis];
        (2.0 * (2.0 * half / cell[axis])).ceil().max(2.0)
    });
    if rays[0] * rays[1] > 64e6 {
        let what = "stands so far aside that its view cannot be traced; take a picture of fewer pixels";
        return Err(Error::parameter("eye", what));
    }
    let step = cell.map(|c| 0.5 * c);
    // Rays have one scale for both axes: the picture's shape makes up for cells that are not square.
    let tall = 0.5 * rays[1] * step[1] / distance;
    let wide = 0.5 * rays[0] * step[0] / distance;
    let columns = (rays[1] * wide / tall).round().max(1.0);
    let picture = scene.picture(eye, tall, [columns as u32, rays[1] as u32], seed, progress)?;
    let (mut sums, mut counts) = (vec![[0.0f64; 3]; width * height], vec![0u32; width * height]);
    let step_x = 2.0 * tall * distance / rays[1];
    for (index, rgb) in picture.iter().enumerate() {
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
    Ok(ColorPicture { width, height, rgb })
}
