//! The scene: world-space triangles with materials, textures, lights and a camera, as glTF means them.
//!
//! Everything is flattened: node transforms are applied, instances are repeated, so that a ray meets plain triangles.
//! World space is glTF's: metres, right-handed, +y up; a camera looks along its own −z.

pub mod bvh;
#[cfg(test)]
mod bvh_tests;
pub mod camera;
pub mod environment;
pub mod gltf;
pub mod material;
pub mod photometry;
pub mod texture;

pub use bvh::{Hit, Ray, SceneBvh, Sides};
pub use camera::{Camera, Projection};
pub use environment::Environment;
pub use material::{AlphaMode, Material, TextureRef};
pub use photometry::{Measured, Photometry};
pub use texture::Texture;

use glam::{DVec3, Vec2, Vec3};
use std::sync::Arc;

/// One triangle in world space, with what shading needs at its corners.
#[derive(Clone, Debug)]
pub struct Triangle {
    /// Corners [m], counter-clockwise seen from the front.
    pub positions: [Vec3; 3],
    /// Unit shading normals at the corners (the geometric normal where the file has none).
    pub normals: [Vec3; 3],
    /// Two sets of texture coordinates at the corners (TEXCOORD_0 and TEXCOORD_1), zero where absent.
    pub texcoords: [[Vec2; 2]; 3],
    /// Vertex colour at the corners, linear RGB, one where absent.
    pub colors: [Vec3; 3],
    /// Index into [`Scene::materials`].
    pub material: u32,
    /// Which primitive instance of the node tree it belongs to: triangles of one instance may share smooth light.
    pub instance: u32,
}

impl Triangle {
    /// Corners in double precision [m]: exactly the stored ones.
    pub fn corners(&self) -> [DVec3; 3] {
        self.positions.map(|p| p.as_dvec3())
    }
    /// The point with the given weights of the second and third corner [m].
    pub fn at(&self, barycentric: [f64; 2]) -> DVec3 {
        let [a, b, c] = self.corners();
        a + (b - a) * barycentric[0] + (c - a) * barycentric[1]
    }
    /// Twice the area times the unit normal [m²]; zero for a degenerate triangle.
    pub fn cross(&self) -> DVec3 {
        let [a, b, c] = self.corners();
        (b - a).cross(c - a)
    }
    /// Area [m²].
    pub fn area(&self) -> f64 {
        0.5 * self.cross().length()
    }
    /// Unit geometric normal on the counter-clockwise side; zero for a degenerate triangle.
    pub fn normal(&self) -> DVec3 {
        self.cross().normalize_or_zero()
    }
}

/// A punctual light of KHR_lights_punctual, in world space.
#[derive(Clone, Debug)]
pub struct PunctualLight {
    /// Which light and with what shape.
    pub kind: LightKind,
    /// Position [m] (unused by a directional light).
    pub position: Vec3,
    /// Unit direction in which it shines (the node's −z; unused by a point light).
    pub direction: Vec3,
    /// Linear RGB times intensity: radiant intensity [W/sr] of point and spot, irradiance [W/m²] of directional.
    pub intensity: Vec3,
    /// Distance at which it ends [m]; infinite where the file sets none.
    pub range: f32,
    /// What a lamp's maker measured of a point light: its intensity is this times `intensity`.
    pub measured: Option<Measured>,
}

/// Shape of a punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel light from infinity.
    Directional,
    /// The same from a disc, whose shadows are as soft as it is wide.
    Sun {
        /// Angular radius [rad].
        radius: f32,
    },
    /// Equal in all directions.
    Point,
    /// A point at an eye: as [`LightKind::Point`], and through the backs of one-sided surfaces, as the eye sees.
    Eye,
    /// A cone: full inside `inner`, none outside `outer` (half angles, [rad]).
    Spot {
        /// Half angle of full intensity [rad].
        inner: f32,
        /// Half angle where the light ends [rad].
        outer: f32,
    },
}

/// A lit, flattened scene.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// All triangles in world space.
    pub triangles: Vec<Triangle>,
    /// Materials that triangles point to.
    pub materials: Vec<Material>,
    /// Decoded images that materials point to.
    pub textures: Vec<Texture>,
    /// Punctual lights.
    pub lights: Vec<PunctualLight>,
    /// What is seen by rays that leave the scene by way of mirrors and glass, and lights it from all around; its suns stand
    /// among the lights.
    pub environment: Option<Arc<Environment>>,
    /// Cameras in the order of the node tree; the first one is used unless another is named.
    pub cameras: Vec<Camera>,
}

impl Scene {
    /// Material of a triangle.
    pub fn material(&self, triangle: u32) -> &Material {
        &self.materials[self.triangles[triangle as usize].material as usize]
    }
    /// Smallest box round all corners that are finite (min, max) [m]; `None` without any.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let corners = self.triangles.iter().flat_map(Triangle::corners);
        corners.filter(|p| p.is_finite()).fold(None, |bounds, p| match bounds {
            None => Some((p, p)),
            Some((low, high)) => Some((low.min(p), high.max(p))),
        })
    }
}

/// Something the loader or a later step had to assume; returned, never printed by the library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning(pub String);

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}
