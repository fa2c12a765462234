//! Images and samplers to decoded textures; only those that a material in use needs.

use super::document::Document;
use super::ktx2;
use super::resources::{MAX_FILE_BYTES, read_uri};
use crate::error::Result;
use crate::files::pictures;
use crate::scene::Warning;
use crate::scene::texture::{Level, Texture, Wrap};
use gltf::json;
use json::texture::{MagFilter, MinFilter, WrappingMode};
use json::validation::Checked;
use std::collections::HashMap;
use std::io::Cursor;

/// Largest side of a texture in texels; a larger image is halved until it fits, with a warning.
pub const MAX_TEXTURE_SIDE: usize = 4096;

/// Texels of all textures together: 1.4 GB with their pyramids. Once they are spent, further textures are halved until
/// they fit, though not below a side of 256, with a warning for each.
pub const MAX_TEXELS: usize = 64 << 20;

/// Side below which a texture is not halved to save memory [texels].
const SPARED_SIDE: usize = 256;

/// Largest side of an image that is decoded at all, and most memory that its decoder may take [bytes]: 8192 × 8192.
const MAX_IMAGE_SIDE: u32 = 32_768;
const MAX_DECODER_BYTES: u64 = 256 << 20;

/// What a small file's picture may take less than elsewhere.
const SMALL_PICTURES: u64 = 1 << 24;

/// Textures decoded so far. The same image under two samplers, or as colour and as data, is two textures.
#[derive(Default)]
pub(super) struct Textures {
    pub(super) decoded: Vec<Texture>,
    /// By image, sampler and whether it is colour; `None` where it was found not to be readable.
    numbers: HashMap<(usize, Option<usize>, bool), Option<u32>>,
    /// Images that have had their warning.
    warned: Vec<usize>,
}

impl Textures {
    /// Number in the scene of a texture of the file; `None`, with a warning the first time, if it cannot be read.
    pub(super) fn number(
        &mut self,
        document: &Document,
        texture: json::Index<json::Texture>,
        srgb: bool,
        warnings: &mut Vec<Warning>,
    ) -> Result<Option<u32>> {
        let described = document.get(texture, "a material's texture")?;
        let key = (described.source.value(), described.sampler.map(|s| s.value()), srgb);
        if let Some(&known) = self.numbers.get(&key) {
            return Ok(known);
        }
        let sampler = described.sampler.map(|sampler| document.get(sampler, "a texture's sampler")).transpose()?;
        let number = self.decode(document, described, sampler, srgb, warnings)?.map(|texture| {
            self.decoded.push(texture);
            self.decoded.len() as u32 - 1
        });
        self.numbers.insert(key, number);
        Ok(number)
    }

    fn decode(
        &mut self,
        document: &Document,
        texture: &json::Texture,
        sampler: Option<&json::texture::Sampler>,
        srgb: bool,
        warnings: &mut Vec<Warning>,
    ) -> Result<Option<Texture>> {
        let Some(image) = document.root.images.get(texture.source.value()) else {
            let name = texture.name.as_deref().unwrap_or("without a name");
            warnings.push(Warning(format!("texture {name}: it has no image and is left out")));
            return Ok(None);
        };
        let number = texture.source.value();
        let name = image_name(image, number);
        let first_time = !self.warned.contains(&number);
        let mut warn = |why: String| {
            if first_time {
                self.warned.push(number);
                warnings.push(Warning(format!("image {name}: {why}")));
            }
        };
        let picture = match image_bytes(document, image)?.and_then(|bytes| decode_picture(&bytes)) {
            Ok(picture) => picture,
            Err(why) => {
                warn(format!("{why}; the texture is left out and its factor used alone"));
                return Ok(None);
            }
        };
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let wrap = sampler.map_or([Wrap::Repeat; 2], |s| [wrap(s.wrap_s), wrap(s.wrap_t)]);
        let nearest = sampler.is_some_and(is_nearest);
        let mut texture = Texture::from_rgba8(name.clone(), width, height, picture.as_raw(), srgb, wrap, !nearest);
        let spent: usize = self.decoded.iter().map(|t| t.levels[0].texels.len()).sum();
        let fits = |level: &Level| {
            let side = level.width.max(level.height);
            side <= SPARED_SIDE || (side <= MAX_TEXTURE_SIDE && spent + level.texels.len() <= MAX_TEXELS)
        };
        let too_fine = texture.levels.iter().take_while(|level| !fits(level)).count();
        if too_fine > 0 {
            texture.levels.drain(..too_fine);
            let kept = &texture.levels[0];
            warn(format!("its {width} × {height} texels are reduced to {} × {}", kept.width, kept.height));
        }
        Ok(Some(texture))
    }
}

fn image_name(image: &json::Image, number: usize) -> String {
    let file = image.uri.as_deref().filter(|uri| !uri.starts_with("data:"));
    match file.or(image.name.as_deref()) {
        Some(name) => format!("'{name}'"),
        None => number.to_string(),
    }
}

/// The encoded bytes. A wrong index is an error of the file; bytes that are not there are a reason for a warning.
pub(super) fn image_bytes(document: &Document, image: &json::Image) -> Result<std::result::Result<Vec<u8>, String>> {
    Ok(match (image.buffer_view, &image.uri) {
        (Some(view), _) => Ok(document.view(view, "an image")?.to_vec()),
        (None, Some(uri)) => read_uri(document.source(), uri, MAX_FILE_BYTES),
        (None, None) => Err("it has neither a URI nor a buffer view".to_owned()),
    })
}

/// Decodes PNG, JPEG, WebP or plain KTX2 by content, whatever the file's name or declared type says.
pub(super) fn decode_picture(bytes: &[u8]) -> std::result::Result<image::RgbaImage, String> {
    // A texture takes seven times its picture's memory.
    let most = pictures::limits(bytes.len() as u64).max_alloc.unwrap_or(u64::MAX).saturating_sub(SMALL_PICTURES);
    let most = most.min(MAX_DECODER_BYTES);
    if bytes.starts_with(ktx2::IDENTIFIER) {
        return ktx2::decode(bytes, MAX_IMAGE_SIDE, most);
    }
    let format = match image::guess_format(bytes) {
        Ok(format @ (image::ImageFormat::Png | image::ImageFormat::Jpeg | image::ImageFormat::WebP)) => format,
        _ => return Err("only PNG, JPEG and WebP images are read, and it is none of them; convert it".to_owned()),
    };
    let mut reader = image::ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_IMAGE_SIDE);
    limits.max_image_height = Some(MAX_IMAGE_SIDE);
    limits.max_alloc = Some(most);
    reader.limits(limits);
    let picture = reader.decode().map_err(|why| format!("it cannot be decoded ({why})"))?;
    Ok(picture.into_rgba8())
}

fn wrap(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::ClampToEdge,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::MirroredRepeat,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}

/// Whether the magnified texture is blocky. Without a magnification filter the choice is free; the minification filter
/// then tells what the author had in mind.
fn is_nearest(sampler: &json::texture::Sampler) -> bool {
    match (sampler.mag_filter, sampler.min_filter) {
        (Some(Checked::Valid(mag)), _) => mag == MagFilter::Nearest,
        (_, Some(Checked::Valid(min))) => matches!(min, MinFilter::Nearest | MinFilter::NearestMipmapNearest),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_told_by_content() {
        let mut png = Vec::new();
        let pixels = image::RgbaImage::from_pixel(3, 2, image::Rgba([1, 2, 3, 4]));
        pixels.write_to(&mut Cursor::new(&mut png), image::ImageFormat::Png).expect("encode");
        assert_eq!(decode_picture(&png).expect("decode"), pixels);
        assert!(decode_picture(&png[..png.len() / 2]).is_err_and(|why| why.contains("decoded")));
        assert!(decode_picture(b"\xabKTX 20\xbb\r\n\x1a\n").is_err_and(|why| why.contains("KTX2")));
        assert!(decode_picture(b"").is_err());
        let mut bmp = Vec::new();
        pixels.write_to(&mut Cursor::new(&mut bmp), image::ImageFormat::Bmp).expect("encode");
        assert!(decode_picture(&bmp).is_err_and(|why| why.contains("PNG, JPEG and WebP")));
    }
}
