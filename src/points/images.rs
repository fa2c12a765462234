//! Points from a picture and its depth map, as renderers and depth cameras give them.

use super::placement::Placement;
use super::{PointCloud, PointSource, luminance};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::random::Random;
use crate::scene::texture::linear_from_srgb;
use glam::DVec3;
use std::path::Path;

/// Which end of the depth map's gray scale is near.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthScale {
    /// White is near, black is far (OpenHolo, tensor holography).
    #[default]
    WhiteNear,
    /// Black is near, white is far.
    BlackNear,
}

/// Reads `rgb` (sRGB-coded, 8 or 16 bit) and `depth` (gray, 8 or 16 bit, same size) into points.
///
/// The picture fills the viewing window of a [`Placement::Window`]; depth runs linearly in gray between its `near` and
/// `far`. Black pixels make no point. Phases are random under `seed`, or all zero without one.
///
/// # Errors
/// [`Error::Input`] for files that are not pictures or differ in size; [`Error::Parameter`] for a model placement.
pub fn read(
    rgb: &Path,
    depth: &Path,
    scale: DepthScale,
    placement: &Placement,
    seed: Option<u64>,
    panel: &Grid,
) -> Result<PointCloud> {
    let Placement::Window { eye, near, far } = *placement else {
        return Err(Error::parameter("placement", "a picture with depth has no scene to make a model of; use window"));
    };
    if !(eye > 0.0 && eye > near && far <= near) {
        return Err(Error::parameter("near/far", format!("eye {eye} m, near {near} m, far {far} m are not in order")));
    }
    let open = |path: &Path| -> Result<image::DynamicImage> {
        if !path.is_file() {
            let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
            return Err(Error::Io { path: path.into(), source: missing });
        }
        image::open(path).map_err(|e| Error::input(path, format!("not a picture that can be read: {e}")))
    };
    let picture = open(rgb)?.into_rgb16();
    let depths = open(depth)?.into_luma16();
    if picture.dimensions() != depths.dimensions() {
        let ((w, h), (dw, dh)) = (picture.dimensions(), depths.dimensions());
        let what = format!("{dw}×{dh} pixels, but {} has {w}×{h}; they must be equal", rgb.display());
        return Err(Error::input(depth, what));
    }
    let (width, height) = (picture.width() as f64, picture.height() as f64);
    let half_height = 0.5 * panel.extent_y().min(panel.extent_x() * height / width);
    let half_width = half_height * width / height;
    let mut cloud = PointCloud { points: Vec::new(), rgb: Some(Vec::new()) };
    let amplitudes = cloud.rgb.get_or_insert_default();
    for (pixel, (color, gray)) in picture.pixels().zip(depths.pixels()).enumerate() {
        let radiance = color.0.map(|c| linear_from_srgb(f32::from(c) / 65535.0));
        if radiance == [0.0; 3] {
            continue;
        }
        let (column, row) = (pixel as u32 % picture.width(), pixel as u32 / picture.width());
        let gray = f64::from(gray.0[0]) / 65535.0;
        let part = if scale == DepthScale::WhiteNear { 1.0 - gray } else { gray };
        let z = near + part * (far - near);
        let spread = (eye - z) / eye;
        let x = ((f64::from(column) + 0.5) / width * 2.0 - 1.0) * half_width * spread;
        let y = (1.0 - (f64::from(row) + 0.5) / height * 2.0) * half_height * spread;
        let position = DVec3::new(x, y, z);
        let distance = (DVec3::new(0.0, 0.0, eye) - position).length();
        let amplitude = |l: f32| (f64::from(l).sqrt() * distance) as f32;
        let phase = seed.map_or(0.0, |seed| Random::new(seed, pixel as u64).phase());
        cloud.points.push(PointSource { position, amplitude: amplitude(luminance(radiance)), phase });
        amplitudes.push(radiance.map(amplitude));
    }
    if cloud.points.is_empty() {
        return Err(Error::input(rgb, "is black everywhere, so it makes no points"));
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
        let cloud = read(&rgb, &depth, DepthScale::WhiteNear, &placement, None, &panel).expect("cloud");
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
        let refused = read(&rgb, &depth, DepthScale::WhiteNear, &placement, None, &panel).unwrap_err().to_string();
        assert!(refused.contains("5×2"), "{refused}");
    }
}
