//! Panoramas as files: Radiance's `.hdr`, OpenEXR, and pictures of 8 or 16 bits.

use super::Environment;
use crate::error::{Error, Result};
use crate::files::pictures;
use crate::scene::texture::linear_from_srgb;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Most texels of a file: 16,384 × 8,192.
const MOST: u64 = 1 << 27;

/// Columns and rows that are kept.
const KEPT: [usize; 2] = [4096, 2048];

/// A panorama's file, and how it is taken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Panorama {
    /// `.hdr`, `.exr`, or a picture in sRGB codes; twice as wide as it is high.
    pub path: PathBuf,
    /// Its radiance is multiplied by this.
    pub strength: f32,
    /// Turn about +y, from +x towards +z [rad].
    pub turn: f64,
}

impl Environment {
    /// Reads a panorama.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that is no such picture, or too large.
    pub fn read(panorama: &Panorama) -> Result<Self> {
        let Panorama { ref path, strength, turn } = *panorama;
        let ([width, height], mut texels) = match extension(path).as_str() {
            "exr" => exr(path)?,
            _ => picture(path)?,
        };
        if width != 2 * height {
            let what = format!("{width}×{height} pixels: a panorama of all directions is twice as wide as it is high");
            return Err(Error::input(path, what));
        }
        if !(strength.is_finite() && strength >= 0.0) {
            return Err(Error::parameter("environment strength", format!("{strength}: is not a factor")));
        }
        texels.iter_mut().for_each(|t| *t = (*t * strength).max(Vec3::ZERO));
        let map = super::Map { width, height, texels }.coarser(KEPT);
        Self::new(map.width, map.height, map.texels, turn).map_err(|why| Error::input(path, why.to_string()))
    }
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

type Texels = ([usize; 2], Vec<Vec3>);

/// `.hdr`, or a picture in sRGB codes.
fn picture(path: &Path) -> Result<Texels> {
    let refused = |why: String| Error::input(path, format!("is no panorama that can be read: {why}"));
    let bytes = pictures::read(path)?;
    let (width, height) = pictures::dimensions(&bytes).map_err(refused)?;
    check(path, width as usize, height as usize)?;
    let linear = image::guess_format(&bytes).is_ok_and(|format| format == image::ImageFormat::Hdr);
    let texels = pictures::decode(&bytes).map_err(refused)?.into_rgb32f();
    let size = [texels.width() as usize, texels.height() as usize];
    let code = |c: f32| if linear { c } else { linear_from_srgb(c) };
    Ok((size, texels.pixels().map(|p| Vec3::from_array(p.0.map(code))).collect()))
}

fn check(path: &Path, width: usize, height: usize) -> Result<()> {
    let texels = (width as u64).saturating_mul(height as u64);
    if texels > MOST {
        return Err(Error::input(path, format!("{width}×{height} pixels; at most {} million are read", MOST >> 20)));
    }
    Ok(())
}

#[cfg(feature = "exr")]
fn exr(path: &Path) -> Result<Texels> {
    use exr::prelude::{ReadChannels as _, ReadLayers as _};
    use std::fs::File;
    use std::io::BufReader;
    let refused = |why: exr::error::Error| Error::input(path, format!("not an EXR that can be read: {why}"));
    let open = || File::open(path).map_err(Error::io(path)).map(BufReader::new);
    let head = exr::meta::MetaData::read_from_buffered(open()?, false).map_err(refused)?;
    head.headers.iter().try_for_each(|h| check(path, h.layer_size.x(), h.layer_size.y()))?;
    let length = std::fs::metadata(path).map_err(Error::io(path))?.len();
    pictures::exr_fits(&head, length).map_err(|why| Error::input(path, why))?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            |size, _| (size.width(), vec![Vec3::ZERO; size.area()]),
            |(width, texels), at, (r, g, b, _): (f32, f32, f32, f32)| {
                texels[at.y() * *width + at.x()] = Vec3::new(r, g, b);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(open()?)
        .map_err(refused)?;
    let size = image.layer_data.size;
    Ok(([size.width(), size.height()], image.layer_data.channel_data.pixels.1))
}

#[cfg(not(feature = "exr"))]
fn exr(path: &Path) -> Result<Texels> {
    Err(Error::unsupported(format!("{}: this build reads no EXR; build it with the feature `exr`", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use std::fs::File;

    /// Left half red, right half green, twice as bright below.
    fn light(x: usize, y: usize) -> [f32; 3] {
        let below = if y < 4 { 1.0 } else { 2.0 };
        if x < 8 { [below, 0.0, 0.0] } else { [0.0, below, 0.0] }
    }

    #[test]
    fn each_kind_of_file_gives_the_same_light() {
        let folder = tempfile::tempdir().expect("folder");
        let hdr = folder.path().join("a.hdr");
        let values: Vec<image::Rgb<f32>> = (0..128).map(|i| image::Rgb(light(i % 16, i / 16))).collect();
        let file = File::create(&hdr).expect("file");
        image::codecs::hdr::HdrEncoder::new(file).encode(&values, 16, 8).expect("hdr");
        let png = folder.path().join("a.png");
        image::RgbImage::from_fn(16, 8, |x, y| image::Rgb(light(x as usize, y as usize).map(|c| (127.5 * c) as u8)))
            .save(&png)
            .expect("png");
        let mut all = vec![(hdr, 1.0)];
        all.push((png, 1.0 / linear_from_srgb(127.0 / 255.0)));
        #[cfg(feature = "exr")]
        {
            let path = folder.path().join("a.exr");
            exr::prelude::write_rgb_file(&path, 16, 8, |x, y| {
                let [r, g, b] = light(x, y);
                (r, g, b)
            })
            .expect("exr");
            all.push((path, 1.0));
        }
        for (path, strength) in all {
            let around = Environment::read(&Panorama { path: path.clone(), strength, turn: 0.0 })
                .unwrap_or_else(|e| panic!("{e}"));
            // The left quarter looks along −z, the right one along +z.
            let up = around.radiance(DVec3::new(0.0, 0.7, -1.0).normalize());
            let down = around.radiance(DVec3::new(0.0, -0.7, 1.0).normalize());
            assert!((up - Vec3::X).length() < 0.02, "{path:?}: {up}");
            let wanted =
                if path.extension().is_some_and(|e| e == "png") { 1.0 / linear_from_srgb(127.0 / 255.0) } else { 2.0 };
            assert!((down - Vec3::Y * wanted).length() < 0.02 * wanted, "{path:?}: {down}");
        }
        let square = folder.path().join("square.png");
        image::RgbImage::new(8, 8).save(&square).expect("png");
        let plain = |path: PathBuf| Environment::read(&Panorama { path, strength: 1.0, turn: 0.0 });
        assert!(plain(square).unwrap_err().to_string().contains("twice as wide"));
        std::fs::write(folder.path().join("b.hdr"), b"#?RADIANCE\n\n-Y 100000 +X 200000\n").expect("write");
        let said = plain(folder.path().join("b.hdr")).unwrap_err().to_string();
        assert!(said.contains("100000") && !said.contains('\n'), "{said}");
    }
}
