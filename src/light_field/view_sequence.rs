//! Views of a scene from places in a row, each a numbered picture: what printers of stereograms take.
//!
//! The camera goes along a straight line from left to right, looks straight at the panel's plane, and each picture is what passes the same
//! window of that plane (a sheared frustum, no turned camera): pictures need no rectification. They are sRGB-coded, 8 bits, named by their
//! number from 1 on, with as many digits as the last one has, four at least; `sequence.json`, written last, says where they were seen from.

use super::{EyeGrid, LightField, LightFieldSettings, Viewer};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::files;
use crate::points::{LitScene, ScenePoints};
use crate::progress::Progress;
use crate::scene::texture::srgb_from_linear;
use glam::DVec2;
use serde::Serialize;
use std::io::Cursor;
use std::path::Path;
use std::time::Instant;

/// What is made of a scene at a time: views of one batch share the light that they meet [samples].
const BATCH: usize = 1 << 26;
/// Most views of a sequence.
const MOST: usize = 100_000;
/// Most pixels of a picture.
const LARGEST: usize = 1 << 26;

/// How a sequence is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewSequence {
    /// Views, from left to right.
    pub count: usize,
    /// From the first view's place to the last one's [m].
    pub width: f64,
    /// Pixels of a picture.
    pub size: (usize, usize),
    /// Rays of a pixel.
    pub rays: u32,
    /// Kind of the pictures.
    pub format: image::ImageFormat,
}

/// What was made; it stands in `sequence.json`, too.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ViewSequenceReport {
    /// Views, from left to right.
    pub views: usize,
    /// Distance of neighbouring places [m].
    pub spacing: f64,
    /// Distance of the places from the panel's plane [m].
    pub distance: f64,
    /// Middle of the row (x, y) [m].
    pub center: [f64; 2],
    /// Width and height of the window on the panel's plane that each picture shows [m].
    pub window: [f64; 2],
    /// Pixels of a picture.
    pub size: [usize; 2],
    /// Rays cast.
    pub rays: u64,
    /// Name of the first picture and of the last.
    pub files: [String; 2],
    /// Wall time [s].
    pub seconds: f64,
}

impl ViewSequence {
    /// Writes the pictures into a folder; the viewer's eye is the row's middle.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a sequence of fewer than two or too many views, without width, or of too large pictures;
    /// as [`LightField::of_scene`]; [`Error::Io`]; [`Error::Interrupted`].
    pub fn write(
        &self,
        lit: &LitScene,
        points: &ScenePoints,
        viewer: &Viewer,
        settings: &LightFieldSettings,
        folder: &Path,
        progress: &Progress,
    ) -> Result<ViewSequenceReport> {
        let Self { count, width, size: (columns, rows), rays, format } = *self;
        viewer.check()?;
        if !(2..=MOST).contains(&count) {
            return Err(Error::out_of_range("sequence", count, format!("must be 2 to {MOST} views")));
        }
        crate::field::grid::positive("eye box", width)?;
        if columns == 0 || rows == 0 || columns.saturating_mul(rows) > LARGEST {
            let limit = format!("must have pixels, {LARGEST} at most");
            return Err(Error::out_of_range("size", format_args!("{columns}×{rows}"), limit));
        }
        let begin = Instant::now();
        let placing = &points.view.placing;
        // Square pixels: what a picture of another shape shows more stands beside the window.
        let pixel = (2.0 * placing.window / DVec2::new(columns as f64, rows as f64)).max_element();
        let window = pixel * DVec2::new(columns as f64, rows as f64);
        let grid = Grid::new(columns, rows, pixel, pixel)?;
        let spacing = width / (count - 1) as f64;
        let settings = LightFieldSettings {
            white: Some(points.white.white),
            clips: points.white.clips,
            rays,
            viewer: None,
            ..*settings
        };
        files::output_folder(folder)?;
        let told = folder.join("sequence.json");
        // What stood there before is not whole any more.
        if told.exists() {
            std::fs::remove_file(&told).map_err(Error::io(&told))?;
        }
        let digits = count.to_string().len().max(4);
        let ending = format.extensions_str().first().copied().unwrap_or("png");
        let name = |index: usize| format!("{:0digits$}.{}", index + 1, if ending == "tiff" { "tif" } else { ending });
        let channels = if settings.channel.is_some() { 1 } else { 3 };
        let batch = (BATCH / (columns * rows * channels)).clamp(1, count);
        let mut cast = 0;
        for first in (0..count).step_by(batch) {
            let own = batch.min(count - first);
            let middle = (first as f64 + 0.5 * (own as f64 - 1.0) - 0.5 * (count as f64 - 1.0)) * spacing;
            let eyes = EyeGrid {
                distance: viewer.eye.z,
                center: viewer.eye.truncate() + DVec2::new(middle, 0.0),
                spacing,
                columns: own,
                rows: 1,
            };
            let (light, report) = LightField::of_scene(lit, placing, &settings, eyes, grid, progress)?;
            cast += report.rays;
            for index in 0..own {
                progress.check()?;
                files::write_bytes(&folder.join(name(first + index)), &self.picture(&light, index)?)?;
            }
        }
        let report = ViewSequenceReport {
            views: count,
            spacing,
            distance: viewer.eye.z,
            center: viewer.eye.truncate().to_array(),
            window: window.to_array(),
            size: [columns, rows],
            rays: cast,
            files: [name(0), name(count - 1)],
            seconds: begin.elapsed().as_secs_f64(),
        };
        files::write_bytes(&told, serde_json::to_string_pretty(&report).unwrap_or_default().as_bytes())?;
        Ok(report)
    }

    /// A view as a picture's bytes; 1 is white.
    fn picture(&self, light: &LightField, index: usize) -> Result<Vec<u8>> {
        let (columns, rows) = (self.size.0 as u32, self.size.1 as u32);
        let code = |channel: usize, i: usize| {
            let radiance = light.radiance(light.view(channel, index)[i]).min(1.0);
            (srgb_from_linear(radiance) * 255.0).round() as u8
        };
        let channels = light.channels.len();
        let codes: Vec<u8> =
            (0..light.pixels()).flat_map(|i| (0..channels).map(move |channel| code(channel, i))).collect();
        let picture = match channels {
            1 => image::GrayImage::from_raw(columns, rows, codes).map(image::DynamicImage::from),
            _ => image::RgbImage::from_raw(columns, rows, codes).map(image::DynamicImage::from),
        };
        let mut bytes = Vec::new();
        let picture = picture.ok_or_else(|| Error::parameter("size", "is not that of the views"))?;
        picture
            .write_to(&mut Cursor::new(&mut bytes), self.format)
            .map_err(|why| Error::parameter("sequence", why.to_string()))?;
        Ok(bytes)
    }
}
