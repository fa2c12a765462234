//! What a surface does to light at one point: glTF's material with its textures read.

use super::reflection::{MIRROR_ALPHA, dielectric_reflectance, ggx_density, ggx_masking, has_wide_lobe};
use crate::scene::{AlphaMode, Hit, Scene, TextureRef, Triangle};
use glam::{DVec3, Vec3, Vec4, Vec4Swizzles};

/// A surface at a point, ready for shading. Colours are linear Rec.709.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// Where [m].
    pub(crate) position: DVec3,
    /// Unit geometric normal on the side that was met.
    pub(crate) facing: DVec3,
    /// Unit shading normal on the same side.
    pub(crate) normal: DVec3,
    /// Lambertian albedo.
    pub(crate) albedo: Vec3,
    /// Specular reflectance at normal incidence.
    pub(crate) specular: Vec3,
    /// GGX α = perceptual roughness².
    pub(crate) alpha: f32,
    /// Radiance emitted on the side that was met [W/(m² sr)].
    pub(crate) emission: Vec3,
    /// Part of the light that is not reflected and goes through instead of being scattered, times the tint.
    pub(crate) transmission: Vec3,
    /// Index of refraction of what is behind the front side.
    pub(crate) ior: f64,
    /// Whether the surface bounds a volume (refracts) or is a thin wall (does not).
    pub(crate) volume: bool,
    /// Whether base colour is radiance and no light counts.
    pub(crate) unlit: bool,
    /// Coverage: below one, part of the light goes straight on (alpha blending).
    pub(crate) coverage: f32,
    /// Whether the front was met.
    pub(crate) front: bool,
}

/// A point that is lit, lifted off its surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadingPoint {
    /// Where [m].
    pub(crate) position: DVec3,
    /// Unit shading normal.
    pub(crate) normal: DVec3,
}

impl Surface {
    /// Reads the material at a hit; textures are averaged over `footprint`, the width of what is looked at [m].
    pub(crate) fn at(scene: &Scene, hit: &Hit, footprint: f64) -> Self {
        let triangle = &scene.triangles[hit.triangle as usize];
        let material = scene.material(hit.triangle);
        let [v, w] = hit.barycentric.map(|b| b as f32);
        let u = 1.0 - v - w;
        let texel = |reference: &TextureRef| -> Vec4 {
            let [a, b, c] = triangle.texcoords.map(|sets| sets[reference.texcoord as usize & 1]);
            let uv = reference.transform(a * u + b * v + c * w);
            let width = if footprint > 0.0 {
                // Texture coordinates per metre, taken as equal in all directions of the triangle's plane.
                let (e1, e2) = ((b - a) * reference.scale, (c - a) * reference.scale);
                let spread = f64::from(e1.perp_dot(e2).abs()) / triangle.cross().length();
                (spread.sqrt() * footprint) as f32
            } else {
                0.0
            };
            scene.textures[reference.texture as usize].sample(uv, width)
        };
        let side = if hit.front { 1.0 } else { -1.0 };
        let facing = triangle.normal() * side;
        let [na, nb, nc] = triangle.normals;
        let smooth = (na * u + nb * v + nc * w).as_dvec3() * side;
        let mut normal = smooth.normalize_or(facing);
        if let Some((reference, scale)) = &material.normal_texture {
            normal = bumped(triangle, reference, texel(reference), *scale, normal, side);
        }
        // A shading normal that looks away from the side that was met is of no use there.
        if normal.dot(facing) <= 0.0 {
            normal = facing;
        }
        let painted = material.base_color_texture.as_ref().map_or(Vec4::ONE, texel);
        let [ca, cb, cc] = triangle.colors;
        let base = material.base_color * painted.xyz() * (ca * u + cb * v + cc * w);
        let data = material.metallic_roughness_texture.as_ref().map_or(Vec4::ONE, texel);
        let metallic = (material.metallic * data.z).clamp(0.0, 1.0);
        let roughness = (material.roughness * data.y).clamp(0.0, 1.0);
        let emissive = material.emissive_texture.as_ref().map_or(Vec3::ONE, |r| texel(r).xyz());
        let through = material.transmission * material.transmission_texture.as_ref().map_or(1.0, |r| texel(r).x);
        let through = through.clamp(0.0, 1.0) * (1.0 - metallic);
        let ratio = (material.ior - 1.0) / (material.ior + 1.0);
        let dielectric = (ratio * ratio * material.specular).clamp(0.0, 1.0);
        let mut specular = Vec3::splat(dielectric).lerp(base, metallic);
        let mut albedo = base * ((1.0 - metallic) * (1.0 - through));
        if has_wide_lobe(roughness, metallic) && through == 0.0 {
            // It is given to the diffuse part; the dielectric's white sheen is then part of its base colour.
            albedo += base * metallic;
            specular = Vec3::ZERO;
        } else {
            albedo *= 1.0 - mean_fresnel(dielectric);
        }
        let coverage = match material.alpha_mode {
            AlphaMode::Blend => (material.alpha * painted.w).clamp(0.0, 1.0),
            AlphaMode::Opaque | AlphaMode::Mask(_) => 1.0,
        };
        let emits = hit.front || material.double_sided;
        Self {
            position: hit.position,
            facing,
            normal,
            albedo,
            specular,
            alpha: (roughness * roughness).max(1e-6),
            emission: if emits { material.emissive * emissive } else { Vec3::ZERO },
            transmission: base * through,
            ior: f64::from(material.ior),
            volume: material.thickness > 0.0,
            unlit: material.unlit,
            coverage,
            front: hit.front,
        }
        .shown_unlit(base)
    }

    fn shown_unlit(mut self, base: Vec3) -> Self {
        if self.unlit {
            self.emission = base;
            self.albedo = Vec3::ZERO;
            self.specular = Vec3::ZERO;
            self.transmission = Vec3::ZERO;
        }
        self
    }

    /// The point from which rays leave: lifted by `offset` off the side that was met [m].
    pub(crate) fn shading_point(&self, offset: f64) -> ShadingPoint {
        ShadingPoint { position: self.position + self.facing * offset, normal: self.normal }
    }

    /// Whether a specular lobe counts at all.
    pub(crate) fn is_specular(&self) -> bool {
        self.specular.max_element() > 0.0
    }

    /// Whether its specular ways are those of a smooth surface.
    pub(crate) fn is_sharp(&self) -> bool {
        self.alpha <= MIRROR_ALPHA
    }

    /// Whether it has a specular lobe with a width.
    pub(crate) fn is_glossy(&self) -> bool {
        !self.unlit && !self.is_sharp() && (self.is_specular() || self.transmission.max_element() > 0.0)
    }

    /// Part of the light that its specular reflection takes, at a cosine of incidence on the micro-normal.
    pub(crate) fn reflectance(&self, cosine: f64) -> Vec3 {
        if self.transmission.max_element() <= 0.0 {
            self.fresnel(cosine)
        } else if self.volume {
            Vec3::splat(dielectric_reflectance(cosine, self.ratio()) as f32)
        } else {
            Vec3::splat(self.thin_wall_reflectance(cosine))
        }
    }

    /// n₁/n₂ for light that goes into what is behind the side that was met.
    pub(crate) fn ratio(&self) -> f64 {
        if self.front { 1.0 / self.ior } else { self.ior }
    }

    /// How densely rays into a glossy surface's lobe lie about a direction [1/sr].
    pub(crate) fn density(&self, view: DVec3, drawn: DVec3) -> f64 {
        ggx_density(view, drawn, self.normal, f64::from(self.alpha))
    }

    /// The specular reflection F·D·G/(4 cosθ cosθ′) of a glossy surface [1/sr], for unit directions to the viewer and to the
    /// light.
    pub(crate) fn lobe(&self, view: DVec3, light: DVec3) -> Vec3 {
        let density = self.density(view, light);
        if density <= 0.0 {
            return Vec3::ZERO;
        }
        let cosine = light.dot(self.normal);
        let lobe = density * ggx_masking(cosine, f64::from(self.alpha)) / cosine;
        self.reflectance((view + light).normalize().dot(view)) * lobe as f32
    }

    /// Whether anything of the surface scatters light diffusely.
    pub(crate) fn is_diffuse(&self) -> bool {
        self.albedo.max_element() > 0.0
    }

    /// What goes straight on from light that arrives along `direction`: past what is not covered, and through a thin
    /// wall, whose two faces reflect to and fro.
    pub(crate) fn straight(&self, direction: DVec3) -> Vec3 {
        let past = 1.0 - self.coverage;
        if self.volume || self.transmission.max_element() <= 0.0 {
            return Vec3::splat(past);
        }
        let both = self.thin_wall_reflectance(-self.normal.dot(direction));
        Vec3::splat(past) + self.transmission * (self.coverage * (1.0 - both))
    }

    /// Reflectance of both faces of a thin wall with all the light that goes to and fro between them, 2R/(1 + R).
    pub(crate) fn thin_wall_reflectance(&self, cosine: f64) -> f32 {
        let one = dielectric_reflectance(cosine.clamp(0.0, 1.0), 1.0 / self.ior) as f32;
        2.0 * one / (1.0 + one)
    }

    /// Schlick's Fresnel reflectance for a cosine of incidence, 1994.
    pub(crate) fn fresnel(&self, cosine: f64) -> Vec3 {
        let grazing = (1.0 - cosine.clamp(0.0, 1.0)).powi(5) as f32;
        if self.is_specular() { self.specular + (Vec3::ONE - self.specular) * grazing } else { Vec3::ZERO }
    }
}

/// Cosine-weighted mean over the hemisphere of Schlick's reflectance: F0 + (1 − F0)/21; zero where F0 is.
fn mean_fresnel(f0: f32) -> f32 {
    if f0 > 0.0 { f0 + (1.0 - f0) / 21.0 } else { 0.0 }
}

/// The normal of a tangent-space texture; tangents follow the texture coordinates, as glTF says when none are given.
fn bumped(triangle: &Triangle, reference: &TextureRef, texel: Vec4, scale: f32, normal: DVec3, side: f64) -> DVec3 {
    let [a, b, c] = triangle.texcoords.map(|sets| reference.transform(sets[reference.texcoord as usize & 1]));
    let [pa, pb, pc] = triangle.corners();
    let (d1, d2) = ((b - a).as_dvec2(), (c - a).as_dvec2());
    let along_u = (pb - pa) * d2.y - (pc - pa) * d1.y;
    // The sign of the texture's area tells whether it is mirrored on the surface.
    let along_u = along_u * d1.perp_dot(d2).signum();
    let along_v = ((pc - pa) * d1.x - (pb - pa) * d2.x) * d1.perp_dot(d2).signum();
    let tangent = (along_u - normal * along_u.dot(normal)).normalize_or_zero();
    let across = normal.cross(tangent);
    // glTF's v runs downwards in the picture, its tangent space's y upwards.
    let bitangent = if across.dot(along_v) > 0.0 { -across } else { across };
    if tangent == DVec3::ZERO {
        return normal;
    }
    let t = texel.as_dvec4() * 2.0 - 1.0;
    let scale = f64::from(scale) * side;
    (tangent * (t.x * scale) + bitangent * (t.y * scale) + normal * t.z).normalize_or(normal)
}
