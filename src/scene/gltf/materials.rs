//! Materials: metallic-roughness and the extensions that light needs.

use super::document::{Document, called};
use super::images::Textures;
use super::meshes::UsedMaterials;
use crate::error::Result;
use crate::scene::{AlphaMode, Material, Texture, TextureRef, Warning};
use glam::{Vec2, Vec3};
use gltf::json;
use json::extensions::texture::TextureTransform;
use json::validation::Checked;
use serde::Deserialize;

/// The materials `used` by triangles, in that order, and the textures that they need.
pub(super) fn read(
    document: &Document,
    used: &UsedMaterials,
    warnings: &mut Vec<Warning>,
) -> Result<(Vec<Material>, Vec<Texture>)> {
    let mut reader = Reader { document, textures: Textures::default(), warnings, name: String::new() };
    let mut materials = Vec::with_capacity(used.len());
    for &number in used {
        materials.push(match number.and_then(|n| Some((n, document.root.materials.get(n)?))) {
            Some((number, material)) => reader.material(number, material)?,
            None => Material::default(),
        });
    }
    Ok((materials, reader.textures.decoded))
}

struct Reader<'a> {
    document: &'a Document,
    textures: Textures,
    warnings: &'a mut Vec<Warning>,
    /// The material that is being read, for messages.
    name: String,
}

impl Reader<'_> {
    fn material(&mut self, number: usize, json: &json::Material) -> Result<Material> {
        self.name = called("material", number, json.name.as_deref());
        let pbr = &json.pbr_metallic_roughness;
        let [r, g, b, alpha] = pbr.base_color_factor.0;
        let mut material = Material {
            name: json.name.clone().unwrap_or_else(|| format!("material {number}")),
            base_color: self.fractions([r, g, b], "baseColorFactor"),
            alpha: self.fraction(alpha, "baseColorFactor's alpha"),
            base_color_texture: self.texture(pbr.base_color_texture.as_ref(), true)?,
            metallic: self.fraction(pbr.metallic_factor.0, "metallicFactor"),
            roughness: self.fraction(pbr.roughness_factor.0, "roughnessFactor"),
            metallic_roughness_texture: self.texture(pbr.metallic_roughness_texture.as_ref(), false)?,
            emissive: json.emissive_factor.0.into(),
            emissive_texture: self.texture(json.emissive_texture.as_ref(), true)?,
            normal_texture: self.normal_texture(json.normal_texture.as_ref())?,
            double_sided: json.double_sided,
            alpha_mode: match json.alpha_mode {
                Checked::Valid(json::material::AlphaMode::Opaque) => AlphaMode::Opaque,
                Checked::Valid(json::material::AlphaMode::Mask) => {
                    AlphaMode::Mask(json.alpha_cutoff.unwrap_or_default().0)
                }
                Checked::Valid(json::material::AlphaMode::Blend) => AlphaMode::Blend,
                Checked::Invalid => return Err(self.document.error(format!("{} has an unknown alphaMode", self.name))),
            },
            ..Material::default()
        };
        if let Some(extensions) = &json.extensions {
            self.extensions(extensions, &mut material)?;
        }
        if !material.emissive.is_finite() || material.emissive.min_element() < 0.0 {
            let emissive = material.emissive;
            return Err(self.document.error(format!("{} emits {emissive}, which is no radiance", self.name)));
        }
        Ok(material)
    }

    fn extensions(&mut self, json: &json::extensions::material::Material, material: &mut Material) -> Result<()> {
        material.unlit = json.unlit.is_some();
        if let Some(strength) = &json.emissive_strength {
            material.emissive *= strength.emissive_strength.0;
        }
        if let Some(ior) = &json.ior {
            material.ior = self.within(ior.ior.0, 1.0, f32::MAX, 1.5, "ior");
        }
        if let Some(transmission) = &json.transmission {
            material.transmission = self.fraction(transmission.transmission_factor.0, "transmissionFactor");
            material.transmission_texture = self.texture(transmission.transmission_texture.as_ref(), false)?;
        }
        if let Some(volume) = &json.volume {
            material.thickness = self.within(volume.thickness_factor.0, 0.0, f32::MAX, 0.0, "thicknessFactor");
            material.attenuation_color = self.fractions(volume.attenuation_color.0, "attenuationColor");
            // Without the property the distance is infinite, which is inside the domain.
            let distance = volume.attenuation_distance.0;
            material.attenuation_distance =
                self.within(distance, f32::MIN_POSITIVE, f32::INFINITY, f32::INFINITY, "attenuationDistance");
        }
        if let Some(specular) = &json.specular {
            material.specular = self.fraction(specular.specular_factor.0, "specularFactor");
            let plain = specular.specular_color_factor.0 == [1.0; 3]
                && specular.specular_texture.is_none()
                && specular.specular_color_texture.is_none();
            if !plain {
                self.warn("only the factor of KHR_materials_specular is read, not its colour and textures");
            }
        }
        Ok(())
    }

    fn warn(&mut self, what: &str) {
        self.warnings.push(Warning(format!("{}: {what}", self.name)));
    }

    /// `value` if it lies in its domain, `instead` with a warning if it does not.
    fn within(&mut self, value: f32, low: f32, high: f32, instead: f32, property: &str) -> f32 {
        if value >= low && value <= high {
            return value;
        }
        self.warn(&format!("{property} {value} is outside its domain, {instead} is used"));
        instead
    }

    fn fraction(&mut self, value: f32, property: &str) -> f32 {
        let nearest = if value > 1.0 { 1.0 } else { 0.0 };
        self.within(value, 0.0, 1.0, nearest, property)
    }

    fn fractions(&mut self, values: [f32; 3], property: &str) -> Vec3 {
        values.map(|value| self.fraction(value, property)).into()
    }

    fn texture(&mut self, info: Option<&json::texture::Info>, srgb: bool) -> Result<Option<TextureRef>> {
        let Some(info) = info else { return Ok(None) };
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        self.texture_ref(info.index, info.tex_coord, transform, srgb)
    }

    fn normal_texture(&mut self, info: Option<&json::material::NormalTexture>) -> Result<Option<(TextureRef, f32)>> {
        let Some(info) = info else { return Ok(None) };
        // The schema has no place for this extension on normal textures, though the extension allows it there.
        let written = info.extensions.as_ref().and_then(|e| e.others.get("KHR_texture_transform"));
        let transform = written.map(TextureTransform::deserialize).transpose();
        let transform =
            transform.map_err(|why| self.document.error(format!("KHR_texture_transform of {}: {why}", self.name)))?;
        let reference = self.texture_ref(info.index, info.tex_coord, transform.as_ref(), false)?;
        Ok(reference.map(|reference| (reference, info.scale)))
    }

    fn texture_ref(
        &mut self,
        texture: json::Index<json::Texture>,
        texcoord: u32,
        transform: Option<&TextureTransform>,
        srgb: bool,
    ) -> Result<Option<TextureRef>> {
        let texcoord = transform.and_then(|t| t.tex_coord).unwrap_or(texcoord);
        if texcoord > 1 {
            self.warn(&format!("a texture uses TEXCOORD_{texcoord}; only sets 0 and 1 are read, it is left out"));
            return Ok(None);
        }
        let Some(number) = self.textures.number(self.document, texture, srgb, self.warnings)? else { return Ok(None) };
        let (scale, rotation, offset) = match transform {
            Some(t) => (Vec2::from(t.scale.0), t.rotation.0, Vec2::from(t.offset.0)),
            None => (Vec2::ONE, 0.0, Vec2::ZERO),
        };
        if !(scale.is_finite() && rotation.is_finite() && offset.is_finite()) {
            return Err(self.document.error(format!("{} has a texture transform that is not finite", self.name)));
        }
        Ok(Some(TextureRef { texture: number, texcoord, scale, rotation, offset }))
    }
}
