//! Small scenes for tests.

use crate::scene::{Material, Scene, Triangle};
use glam::{DVec3, Vec2, Vec3};

/// Clear glass of index 1.5 that fills the body it bounds.
pub(crate) fn glass() -> Material {
    Material { transmission: 1.0, thickness: 1.0, roughness: 0.0, ior: 1.5, ..Material::diffuse(Vec3::ONE) }
}

/// A scene that is put together by hand.
#[derive(Clone, Default)]
pub(crate) struct Room {
    pub(crate) scene: Scene,
    instances: u32,
}

impl Room {
    pub(crate) fn material(&mut self, material: Material) -> u32 {
        self.scene.materials.push(material);
        self.scene.materials.len() as u32 - 1
    }

    fn triangle(&mut self, corners: [DVec3; 3], normals: [DVec3; 3], uv: [Vec2; 3], material: u32) {
        self.scene.triangles.push(Triangle {
            positions: corners.map(|p| p.as_vec3()),
            normals: normals.map(|n| n.as_vec3()),
            texcoords: uv.map(|t| [t, t]),
            colors: [Vec3::ONE; 3],
            material,
            instance: self.instances,
        });
    }

    /// A single flat triangle, counter-clockwise from its front.
    pub(crate) fn face(&mut self, corners: [DVec3; 3], material: u32) {
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        self.triangle(corners, [normal; 3], [Vec2::ZERO, Vec2::X, Vec2::Y], material);
        self.instances += 1;
    }

    /// A parallelogram; its front looks along u × v.
    pub(crate) fn quad(&mut self, corner: DVec3, u: DVec3, v: DVec3, material: u32) {
        let normal = [u.cross(v).normalize(); 3];
        let (a, b, c, d) = (corner, corner + u, corner + u + v, corner + v);
        self.triangle([a, b, c], normal, [Vec2::ZERO, Vec2::X, Vec2::ONE], material);
        self.triangle([a, c, d], normal, [Vec2::ZERO, Vec2::ONE, Vec2::Y], material);
        self.instances += 1;
    }

    /// A box with its faces looking inwards or outwards; materials in the order −x +x −y +y −z +z.
    pub(crate) fn cuboid(&mut self, low: DVec3, high: DVec3, inwards: bool, materials: [u32; 6]) {
        let size = high - low;
        for axis in 0..3 {
            let (u, v) = (DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]);
            let (u, v) = (u * u.dot(size), v * v.dot(size));
            for (side, corner) in [(0, low), (1, low + DVec3::AXES[axis] * size[axis])] {
                // u × v looks along +axis: inwards on the low side.
                let keep = (side == 0) == inwards;
                let (u, v) = if keep { (u, v) } else { (v, u) };
                self.quad(corner, u, v, materials[2 * axis + side]);
            }
        }
    }

    /// A sphere of latitude–longitude triangles with exact normals.
    pub(crate) fn sphere(&mut self, middle: DVec3, radius: f64, inwards: bool, rings: u32, material: u32) {
        let point = |i: u32, j: u32| {
            let theta = std::f64::consts::PI * f64::from(i) / f64::from(rings);
            let phi = std::f64::consts::PI * f64::from(j % (2 * rings)) / f64::from(rings);
            DVec3::new(theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin())
        };
        let side = if inwards { -1.0 } else { 1.0 };
        for i in 0..rings {
            for j in 0..2 * rings {
                let (a, b, c, d) = (point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
                for (skip, [p, q, r]) in [(i + 1 == rings, [a, b, c]), (i == 0, [a, c, d])] {
                    if skip {
                        continue;
                    }
                    let [p, q, r] = if inwards { [p, r, q] } else { [p, q, r] };
                    let corners = [p, q, r].map(|n| middle + n * radius);
                    self.triangle(corners, [p, q, r].map(|n| n * side), [Vec2::ZERO; 3], material);
                }
            }
        }
        self.instances += 1;
    }

    /// The part of a sphere's inside round its lowest point, up to a half width, with exact normals towards the middle.
    pub(crate) fn cap(&mut self, middle: DVec3, radius: f64, half: f64, rings: u32, material: u32) {
        let point = |i: u32, j: u32| {
            let theta = (half / radius).asin() * f64::from(i) / f64::from(rings);
            let phi = std::f64::consts::PI * f64::from(j % (2 * rings)) / f64::from(rings);
            DVec3::new(theta.sin() * phi.cos(), -theta.cos(), theta.sin() * phi.sin())
        };
        for (i, j) in (0..rings).flat_map(|i| (0..2 * rings).map(move |j| (i, j))) {
            let (a, b, c, d) = (point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
            for (skip, [p, q, r]) in [(false, [a, c, b]), (i == 0, [a, d, c])] {
                if !skip {
                    let corners = [p, q, r].map(|n| middle + n * radius);
                    self.triangle(corners, [p, q, r].map(|n| -n), [Vec2::ZERO; 3], material);
                }
            }
        }
        self.instances += 1;
    }
}
