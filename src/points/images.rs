//! Points from a picture and its depth map, as renderers and depth cameras give them.

pub use super::depth_map::DepthScale;
use super::depth_map::{DepthMap, DepthReading};
use super::placement::Placement;
use super::{PointCloud, PointSource, luminance};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::files::{self, pictures};
use crate::random::Random;
use crate::scene::texture::linear_from_srgb;
use glam::DVec3;
use image::{ImageBuffer, Rgb};
use std::path::Path;

/// The viewing window that a picture fills: the panel as seen from the eye.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureWindow {
    /// Distance of the eye in front of the panel [m].
    pub eye: f64,
    /// Half width and half height on the panel [m].
    pub half: [f64; 2],
}

impl PictureWindow {
    /// The largest window of a picture's shape on the panel.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a model placement, or distances that are not in order.
    pub fn new(placement: &Placement, [width, height]: [u32; 2], panel: &Grid) -> Result<Self> {
        let Placement::Window { eye, near, far } = *placement else {
            let what = "a picture with depth has no scene to make a model of; use window";
            return Err(Error::parameter("placement", what));
        };
        if !(eye > 0.0 && eye > near && far <= near) {
            let what = format!("eye {eye} m, near {near} m, far {far} m are not in order");
            return Err(Error::parameter("near/far", what));
        }
        let shape = f64::from(height) / f64::from(width);
        let half_height = 0.5 * panel.extent_y().min(panel.extent_x() * shape);
        Ok(Self { eye, half: [half_height / shape, half_height] })
    }
    /// How much wider than on the panel it is at depth z [m].
    pub fn spread(&self, z: f64) -> f64 {
        (self.eye - z) / self.eye
    }
}

/// A picture of 16 bits a colour, sRGB-coded.
pub type Picture16 = ImageBuffer<Rgb<u16>, Vec<u16>>;

/// A picture and its depth map.
#[derive(Clone, Debug)]
pub struct RgbDepth {
    pub(super) picture: Picture16,
    /// Of the same size.
    pub map: DepthMap,
    /// Depth z of the map's near and far end [m].
    pub(super) ends: [f64; 2],
}

impl RgbDepth {
    /// Reads `rgb` (sRGB-coded, 8 or 16 bit) and its depth map of the same size.
    ///
    /// # Errors
    /// [`Error::Input`] for files that are not pictures or differ in size; [`Error::Parameter`] for a model placement; as
    /// [`DepthMap::read`].
    pub fn read(rgb: &Path, depth: &Path, reading: &DepthReading, placement: &Placement) -> Result<Self> {
        let Placement::Window { near, far, .. } = *placement else {
            let what = "a picture with depth has no scene to make a model of; use window";
            return Err(Error::parameter("placement", what));
        };
        let picture = pictures::open(rgb)?.into_rgb16();
        let map = DepthMap::read(depth, reading)?.on(depth, picture.dimensions().into())?;
        Ok(Self { picture, map, ends: [near, far] })
    }
    /// Columns and rows.
    pub fn size(&self) -> [u32; 2] {
        [self.picture.width(), self.picture.height()]
    }
    /// Depth z of every pixel, row by row [m]; none where nothing was measured.
    pub(super) fn depths(&self) -> impl Iterator<Item = Option<f64>> + '_ {
        self.map.parts.iter().map(|part| self.z(*part))
    }
    /// Depth z of a pixel [m], where it was measured.
    pub(super) fn depth(&self, column: u32, row: u32) -> Option<f64> {
        self.z(self.map.parts[(row * self.map.width + column) as usize])
    }
    fn z(&self, part: f32) -> Option<f64> {
        (!part.is_nan()).then(|| self.ends[0] + f64::from(part) * (self.ends[1] - self.ends[0]))
    }
}

/// Writes depths z [m] as a depth map of 16-bit gray, linear between `near` and `far`; what lies beyond takes their gray,
/// a pixel without depth the farthest.
///
/// # Errors
/// [`Error::Io`] where the file cannot be written.
pub fn write_depths(
    path: &Path,
    [width, height]: [u32; 2],
    depths: &[Option<f64>],
    scale: DepthScale,
    [near, far]: [f64; 2],
) -> Result<()> {
    let gray = |z: &Option<f64>| {
        let part = z.map_or(1.0, |z| ((z - near) / (far - near)).clamp(0.0, 1.0));
        let part = if scale == DepthScale::WhiteNear { 1.0 - part } else { part };
        ((part * 65535.0).round() as u16).to_be_bytes()
    };
    let bytes: Vec<u8> = depths.iter().flat_map(gray).collect();
    let refused = |e: png::EncodingError| match e {
        png::EncodingError::IoError(source) => Error::Io { path: path.into(), source },
        other => Error::input(path, other.to_string()),
    };
    files::write_whole(path, |out| {
        let mut encoder = png::Encoder::new(out, width, height);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Sixteen);
        let end = if scale == DepthScale::WhiteNear { "white" } else { "black" };
        let text = format!("depth map: z from {near} m ({end}) to {far} m, linear, negative behind the panel");
        encoder.add_itxt_chunk("Description".into(), text).map_err(refused)?;
        let mut writer = encoder.write_header().map_err(refused)?;
        writer.write_image_data(&bytes).map_err(refused)?;
        writer.finish().map_err(refused)
    })
}

/// Points of a picture and its depth map.
///
/// The picture fills the viewing window of a [`Placement::Window`]; depth runs linearly between its `near` and `far`. Black
/// pixels, and those without measurement, make no point. Phases are random under `seed`, or all zero without one.
///
/// # Errors
/// Those of [`PictureWindow::new`]; [`Error::Parameter`] for a picture that is black wherever a depth was measured.
pub fn points(read: &RgbDepth, placement: &Placement, seed: Option<u64>, panel: &Grid) -> Result<PointCloud> {
    let window = PictureWindow::new(placement, read.size(), panel)?;
    let [width, height] = read.size().map(f64::from);
    let mut cloud = PointCloud { points: Vec::new(), rgb: Some(Vec::new()) };
    let amplitudes = cloud.rgb.get_or_insert_default();
    for (pixel, (color, z)) in read.picture.pixels().zip(read.depths()).enumerate() {
        let radiance = color.0.map(|c| linear_from_srgb(f32::from(c) / 65535.0));
        if radiance == [0.0; 3] {
            continue;
        }
        let Some(z) = z else { continue };
        let (column, row) = (pixel as u32 % read.size()[0], pixel as u32 / read.size()[0]);
        let spread = window.spread(z);
        let x = ((f64::from(column) + 0.5) / width * 2.0 - 1.0) * window.half[0] * spread;
        let y = (1.0 - (f64::from(row) + 0.5) / height * 2.0) * window.half[1] * spread;
        let position = DVec3::new(x, y, z);
        let distance = (DVec3::new(0.0, 0.0, window.eye) - position).length();
        let amplitude = |l: f32| (f64::from(l).sqrt() * distance) as f32;
        let phase = seed.map_or(0.0, |seed| Random::new(seed, pixel as u64).phase());
        cloud.points.push(PointSource { position, amplitude: amplitude(luminance(radiance)), phase });
        amplitudes.push(radiance.map(amplitude));
    }
    if cloud.points.is_empty() {
        return Err(Error::parameter("picture", "is black wherever a depth is known, so it makes no points"));
    }
    Ok(cloud)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_white_near_corner_lands_there_and_black_makes_no_point() {
        let folder = tempfile::tempdir().expect("folder");
        let (rgb, depth) = (folder.path().join("rgb.png"), folder.path().join("depth.png"));
        let mut picture = image::RgbImage::new(4, 2);
        picture.put_pixel(0, 0, image::Rgb([255, 255, 255]));
        picture.put_pixel(3, 1, image::Rgb([255, 0, 0]));
        picture.save(&rgb).expect("rgb");
        let mut gray = image::GrayImage::new(4, 2);
        gray.put_pixel(0, 0, image::Luma([255]));
        gray.save(&depth).expect("depth");
        let panel = Grid::new(1920, 1080, 8e-6, 8e-6).expect("panel");
        let placement = Placement::Window { eye: 0.5, near: 0.01, far: -0.2 };
        let read = |reading: DepthReading| RgbDepth::read(&rgb, &depth, &reading, &placement);
        let both = read(DepthReading::default()).expect("picture");
        let cloud = points(&both, &placement, None, &panel).expect("cloud");
        assert_eq!(cloud.points.len(), 2);
        let (a, b) = (cloud.points[0].position, cloud.points[1].position);
        assert!((a.z - 0.01).abs() < 1e-12 && a.x < 0.0 && a.y > 0.0, "{a}");
        assert!((b.z + 0.2).abs() < 1e-12 && b.x > 0.0 && b.y < 0.0, "{b}");
        // 4×2 on a 16:9 panel: the width decides, so a's column centre is at −3/4 of the half width.
        assert!((a.x / (0.5 - 0.01) * 0.5 + 0.75 * 0.5 * 1920.0 * 8e-6).abs() < 1e-9, "{}", a.x);
        let rgb_amplitudes = cloud.rgb.expect("coloured");
        assert!(rgb_amplitudes[1][0] > 0.0 && rgb_amplitudes[1][1] == 0.0);
        gray = image::GrayImage::new(5, 2);
        gray.save(&depth).expect("depth");
        let refused = read(DepthReading::default()).unwrap_err().to_string();
        assert!(refused.contains("5×2"), "{refused}");
    }
}
