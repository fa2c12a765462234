//! Surface materials: glTF metallic-roughness with the extensions that light needs.

use glam::{Vec2, Vec3};

/// A texture of [`crate::scene::Scene::textures`] and how its coordinates are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into the scene's textures.
    pub texture: u32,
    /// Which set of texture coordinates (0 or 1).
    pub texcoord: u32,
    /// KHR_texture_transform: scale, applied first.
    pub scale: Vec2,
    /// KHR_texture_transform: rotation [rad], counter-clockwise, applied second.
    pub rotation: f32,
    /// KHR_texture_transform: offset, applied last.
    pub offset: Vec2,
}

impl TextureRef {
    /// Texture coordinates after KHR_texture_transform.
    pub fn transform(&self, uv: Vec2) -> Vec2 {
        let (sin, cos) = self.rotation.sin_cos();
        let uv = uv * self.scale;
        self.offset + Vec2::new(cos * uv.x + sin * uv.y, -sin * uv.x + cos * uv.y)
    }
}

/// How alpha is read.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Holes where alpha is below the cutoff.
    Mask(f32),
    /// Partly see-through.
    Blend,
}

/// What a surface does to light. Colours are linear Rec.709.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, for messages.
    pub name: String,
    /// Base colour factor, linear RGB.
    pub base_color: Vec3,
    /// Alpha factor.
    pub alpha: f32,
    /// Base colour (RGB sRGB-coded, A alpha) texture.
    pub base_color_texture: Option<TextureRef>,
    /// Metallic factor, 0 dielectric to 1 metal.
    pub metallic: f32,
    /// Perceptual roughness factor; GGX α = roughness².
    pub roughness: f32,
    /// Roughness in G, metallic in B, linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Emitted radiance [W/(m² sr)], linear RGB, KHR_materials_emissive_strength applied.
    pub emissive: Vec3,
    /// Emission texture, sRGB-coded, multiplied with `emissive`.
    pub emissive_texture: Option<TextureRef>,
    /// Tangent-space normal texture and its scale.
    pub normal_texture: Option<(TextureRef, f32)>,
    /// How alpha is read.
    pub alpha_mode: AlphaMode,
    /// Whether the back side is a surface too; rays pass the back of a one-sided one.
    pub double_sided: bool,
    /// KHR_materials_unlit: base colour is shown as radiance, no light falls on it.
    pub unlit: bool,
    /// KHR_materials_transmission: part of the non-reflected light that goes through instead of being scattered.
    pub transmission: f32,
    /// Transmission in R, linear.
    pub transmission_texture: Option<TextureRef>,
    /// Index of refraction (KHR_materials_ior), 1.5 unless set.
    pub ior: f32,
    /// KHR_materials_specular: strength of the dielectric's specular reflection, 1 unless set.
    pub specular: f32,
    /// KHR_materials_volume: thickness [m]; 0 is an infinitely thin wall, otherwise the mesh bounds a volume.
    pub thickness: f32,
    /// KHR_materials_volume: distance in which white light takes `attenuation_color` [m]; infinite without absorption.
    pub attenuation_distance: f32,
    /// KHR_materials_volume: colour of white light after `attenuation_distance`.
    pub attenuation_color: Vec3,
}

impl Default for Material {
    /// glTF's default material: white, rough, metallic as the specification says, no emission.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec3::ONE,
            alpha: 1.0,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            normal_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
            transmission: 0.0,
            transmission_texture: None,
            ior: 1.5,
            specular: 1.0,
            thickness: 0.0,
            attenuation_distance: f32::INFINITY,
            attenuation_color: Vec3::ONE,
        }
    }
}

impl Material {
    /// A Lambertian surface of the given albedo.
    pub fn diffuse(albedo: Vec3) -> Self {
        Self { base_color: albedo, metallic: 0.0, specular: 0.0, ..Self::default() }
    }
    /// A perfect mirror with the given reflectance.
    pub fn mirror(reflectance: Vec3) -> Self {
        Self { base_color: reflectance, metallic: 1.0, roughness: 0.0, ..Self::default() }
    }
    /// A black surface that emits the given radiance [W/(m² sr)].
    pub fn emitter(radiance: Vec3) -> Self {
        Self { base_color: Vec3::ZERO, metallic: 0.0, specular: 0.0, emissive: radiance, ..Self::default() }
    }
}
