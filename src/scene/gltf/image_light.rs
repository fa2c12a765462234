//! The environment of a file itself (EXT_lights_image_based): a cube of pictures, and a turn.
//!
//! Its finest pictures are the radiance; coarser ones, which are blurred for rough surfaces, and its coefficients of diffuse
//! light follow from that and are not read. Faces stand in the order +x, −x, +y, −y, +z, −z, each as one sees it from inside.
//! A PNG with alpha holds colours divided by it (RGBD), other pictures colours as they are; both are sRGB-coded.

use super::document::Document;
use super::images::{decode_picture, image_bytes};
use crate::error::Result;
use crate::scene::Environment;
use crate::scene::texture::linear_from_srgb;
use glam::{DQuat, DVec3, Vec3};
use gltf::json;
use serde::Deserialize;

/// The extension's name.
const NAME: &str = "EXT_lights_image_based";

/// Columns of the panorama that is made of the cube, for one column of a face, and most of them.
const COLUMNS: usize = 4;
const MOST: usize = 4096;

#[derive(Deserialize)]
struct Lights {
    lights: Vec<Light>,
}

#[derive(Deserialize)]
struct Chosen {
    light: usize,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Light {
    #[serde(default)]
    rotation: Option<[f64; 4]>,
    #[serde(default)]
    intensity: Option<f32>,
    specular_images: Vec<[usize; 6]>,
}

/// One face: its side and its linear colours, row 0 on top.
struct Face {
    side: usize,
    texels: Vec<Vec3>,
}

/// The environment that a scene of the file names, if it names one.
pub(super) fn read(document: &Document, scene: &json::Scene) -> Result<Option<Environment>> {
    let Some(chosen) = scene.extensions.as_ref().and_then(|e| e.others.get(NAME)) else { return Ok(None) };
    let fail = |why: &str| document.error(format!("{NAME}: {why}"));
    let chosen: Chosen = serde_json::from_value(chosen.clone()).map_err(|why| fail(&why.to_string()))?;
    let told = document.root.extensions.as_ref().and_then(|e| e.others.get(NAME));
    let told = told.ok_or_else(|| fail("a scene names a light, and the file has none"))?;
    let told: Lights = serde_json::from_value(told.clone()).map_err(|why| fail(&why.to_string()))?;
    let light = told.lights.get(chosen.light).ok_or_else(|| fail("a scene names a light that is not there"))?;
    let numbers = light.specular_images.first().ok_or_else(|| fail("a light has no pictures"))?;
    let strength = light.intensity.unwrap_or(1.0);
    let turn = DQuat::from_array(light.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    if !(strength.is_finite() && strength >= 0.0 && turn.is_finite() && turn.length() > 1e-6) {
        return Err(fail("a light has no intensity of at least zero, or no rotation"));
    }
    let faces = numbers.iter().map(|&number| face(document, number)).collect::<Result<Vec<_>>>()?;
    let width = faces.iter().map(|face| COLUMNS * face.side).max().unwrap_or(0).min(MOST);
    let back = turn.normalize().inverse();
    let texels = Environment::directions(width, width / 2).map(|direction| at(&faces, back * direction) * strength);
    Environment::new(width, width / 2, texels.collect(), 0.0).map(Some).map_err(|why| fail(&why.to_string()))
}

fn face(document: &Document, number: usize) -> Result<Face> {
    let fail = |why: String| document.error(format!("{NAME}: picture {number}: {why}"));
    let image = document.root.images.get(number).ok_or_else(|| fail("is not there".to_owned()))?;
    let bytes = image_bytes(document, image)?.map_err(fail)?;
    let packed = image::guess_format(&bytes).is_ok_and(|format| format == image::ImageFormat::Png);
    let picture = decode_picture(&bytes).map_err(fail)?;
    if picture.width() != picture.height() || picture.width() < 2 {
        return Err(fail(format!("{}×{} pixels; a face is a square", picture.width(), picture.height())));
    }
    let colour = |pixel: &image::Rgba<u8>| {
        let [r, g, b, a] = pixel.0.map(|code| f32::from(code) / 255.0);
        let linear = Vec3::new(r, g, b).map(linear_from_srgb);
        // Without alpha it is 1 everywhere.
        if packed { linear / a.max(1.0 / 255.0) } else { linear }
    };
    Ok(Face { side: picture.width() as usize, texels: picture.pixels().map(colour).collect() })
}

/// Linear between the texels of the face that a direction meets.
fn at(faces: &[Face], d: DVec3) -> Vec3 {
    let size = d.abs();
    // To the right and down in a face, as one sees it from inside with +y up; above and below +z is up and down.
    let (number, depth, right, down) = if size.x >= size.y && size.x >= size.z {
        if d.x > 0.0 { (0, size.x, d.z, -d.y) } else { (1, size.x, -d.z, -d.y) }
    } else if size.y >= size.z {
        if d.y > 0.0 { (2, size.y, -d.x, d.z) } else { (3, size.y, -d.x, -d.z) }
    } else if d.z > 0.0 {
        (4, size.z, -d.x, -d.y)
    } else {
        (5, size.z, d.x, -d.y)
    };
    let face = &faces[number];
    let last = (face.side - 1) as f64;
    let place = |along: f64| ((0.5 * (along / depth + 1.0)) * face.side as f64 - 0.5).clamp(0.0, last);
    let [x, y] = [place(right), place(down)];
    let [left, top] = [x, y].map(|v| (v.floor() as usize).min(face.side - 2));
    let [s, t] = [(x - left as f64) as f32, (y - top as f64) as f32];
    let row = |y: usize| {
        let texels = &face.texels[y * face.side + left..][..2];
        texels[0] * (1.0 - s) + texels[1] * s
    };
    row(top) * (1.0 - t) + row(top + 1) * t
}
