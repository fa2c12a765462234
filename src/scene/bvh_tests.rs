//! Rays against every triangle by itself.

use super::bvh::{Ray, SceneBvh, Sides};
use super::{AlphaMode, Material, Scene, Triangle};
use crate::random::Random;
use glam::{DVec3, Vec2, Vec3};

fn triangle(positions: [DVec3; 3], material: u32) -> Triangle {
    let normal = (positions[1] - positions[0]).cross(positions[2] - positions[0]).normalize_or_zero().as_vec3();
    Triangle {
        positions: positions.map(|p| p.as_vec3()),
        normals: [normal; 3],
        texcoords: [[Vec2::ZERO, Vec2::ZERO], [Vec2::X, Vec2::X], [Vec2::Y, Vec2::Y]],
        colors: [Vec3::ONE; 3],
        material,
        instance: 0,
    }
}

fn soup(count: u64, seed: u64) -> Scene {
    let mut random = Random::new(seed, 0);
    let mut point = |scale: f64| DVec3::from_array(std::array::from_fn(|_| (random.uniform() - 0.5) * scale));
    let triangles = (0..count)
        .map(|i| {
            let p = point(2.0);
            triangle([p, p + point(0.4), p + point(0.4)], (i % 2) as u32)
        })
        .collect();
    let double_sided = Material { double_sided: true, ..Material::diffuse(Vec3::ONE) };
    Scene { triangles, materials: vec![Material::diffuse(Vec3::ONE), double_sided], ..Scene::default() }
}

/// Every triangle by itself, in double precision.
fn oracle(scene: &Scene, ray: &Ray, sides: Sides) -> Option<(u32, f64)> {
    let mut nearest: Option<(u32, f64)> = None;
    for (index, triangle) in scene.triangles.iter().enumerate() {
        let ([a, b, c], n) = (triangle.corners(), triangle.cross());
        let distance = n.dot(a - ray.origin) / n.dot(ray.direction);
        let p = ray.at(distance);
        let inside = [(a, b), (b, c), (c, a)].iter().all(|(p0, p1)| (*p1 - *p0).cross(p - *p0).dot(n) >= 0.0);
        let back = n.dot(ray.direction) >= 0.0 && !scene.material(index as u32).double_sided;
        let seen = distance > 0.0 && inside && !(back && sides == Sides::Front);
        if seen && nearest.is_none_or(|(_, d)| distance < d) {
            nearest = Some((index as u32, distance));
        }
    }
    nearest
}

#[test]
fn hits_agree_with_every_triangle_by_itself() {
    let scene = soup(700, 5);
    let bvh = SceneBvh::new(scene.clone());
    let mut random = Random::new(6, 0);
    let mut hits = 0;
    for _ in 0..4000 {
        let mut draw = || DVec3::from_array(std::array::from_fn(|_| random.uniform() - 0.5));
        let ray = Ray { origin: draw() * 3.0, direction: draw().normalize() };
        for sides in [Sides::Front, Sides::Both] {
            let found = bvh.nearest(&ray, 0.0, sides);
            let expected = oracle(&scene, &ray, sides);
            assert_eq!(found.map(|h| h.triangle), expected.map(|e| e.0), "{ray:?}");
            if let (Some(hit), Some((_, distance))) = (found, expected) {
                hits += 1;
                assert!((hit.distance - distance).abs() < 1e-9 * (1.0 + distance));
                let there = scene.triangles[hit.triangle as usize].at(hit.barycentric);
                assert!((there - hit.position).length() < 1e-9, "barycentric weights lead elsewhere");
                // What is met stands in the way of a segment that reaches beyond it, and not of a shorter one.
                if sides == Sides::Both {
                    assert!(bvh.occluded(ray.origin, ray.at(distance * 1.01)));
                    assert!(!bvh.occluded(ray.origin, ray.at(distance * 0.99)));
                }
            }
        }
    }
    assert!(hits > 1000, "{hits} hits are too few to say anything");
}

#[test]
fn rays_along_axes_meet_walls_along_axes() {
    // Rays with two zero components on flat boxes, through the shared diagonal of a square: the hard case for
    // both the box test and the triangle test.
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for side in [0.0, 1.0] {
            let (u, v) = (DVec3::AXES[(axis + 1) % 3], DVec3::AXES[(axis + 2) % 3]);
            let a = DVec3::AXES[axis] * side;
            triangles.push(triangle([a, a + u, a + u + v], 1));
            triangles.push(triangle([a, a + u + v, a + v], 1));
        }
    }
    let scene = Scene { triangles, ..soup(0, 0) };
    let bvh = SceneBvh::new(scene.clone());
    for axis in 0..3 {
        for cell in 0..144 {
            let mut origin = DVec3::ZERO;
            origin[axis] = 0.5;
            origin[(axis + 1) % 3] = (f64::from(cell % 12) + 0.5) / 12.0;
            origin[(axis + 2) % 3] = (f64::from(cell / 12) + 0.5) / 12.0;
            for direction in [DVec3::AXES[axis], -DVec3::AXES[axis]] {
                let hit = bvh.nearest(&Ray { origin, direction }, 0.0, Sides::Both);
                assert!(hit.is_some_and(|h| (h.distance - 0.5).abs() < 1e-9), "{origin} {direction} {hit:?}");
            }
        }
    }
}

#[test]
fn a_closed_box_lets_no_ray_out() {
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for side in [0.0, 2.0] {
            let (u, v) = (DVec3::AXES[(axis + 1) % 3] * 2.0, DVec3::AXES[(axis + 2) % 3] * 2.0);
            let a = DVec3::AXES[axis] * side;
            triangles.push(triangle([a, a + u, a + u + v], 1));
            triangles.push(triangle([a, a + u + v, a + v], 1));
        }
    }
    let scene = Scene { triangles, ..soup(0, 0) };
    let bvh = SceneBvh::new(scene.clone());
    let mut random = Random::new(2, 0);
    // From the middle, and from points ever nearer to a floor and two walls that meet it.
    for near in [1.0, 1e-2, 1e-3, 1e-4, 2e-5] {
        let lost = (0..20_000)
            .filter(|_| {
                let origin = DVec3::new(
                    near * random.uniform() + bvh.offset(),
                    bvh.offset(),
                    near * random.uniform() + bvh.offset(),
                );
                let mut d = DVec3::from_array(std::array::from_fn(|_| random.uniform() - 0.5)).normalize();
                d.y = d.y.abs();
                bvh.nearest(&Ray { origin, direction: d }, 0.0, Sides::Both).is_none()
            })
            .count();
        assert_eq!(lost, 0, "of 20,000 rays from within {near} of a corner");
    }
}

#[test]
fn eyes_pass_backs_and_light_does_not() {
    let at = |z: f64| triangle([DVec3::new(-1.0, -1.0, z), DVec3::new(1.0, -1.0, z), DVec3::new(0.0, 1.0, z)], 0);
    let scene = Scene { triangles: vec![at(0.0)], materials: vec![Material::diffuse(Vec3::ONE)], ..Scene::default() };
    let bvh = SceneBvh::new(scene.clone());
    let from_behind = Ray { origin: DVec3::new(0.0, 0.0, -1.0), direction: DVec3::Z };
    assert!(bvh.nearest(&from_behind, 0.0, Sides::Front).is_none());
    assert!(bvh.nearest(&from_behind, 0.0, Sides::Both).is_some_and(|h| !h.front && h.distance == 1.0));
    assert!(bvh.occluded(DVec3::NEG_Z, DVec3::Z));
}

#[test]
fn masked_material_has_holes() {
    let mut scene = Scene { triangles: vec![], materials: vec![Material::diffuse(Vec3::ONE)], ..Scene::default() };
    scene.triangles.push(triangle([DVec3::ZERO, DVec3::X, DVec3::Y], 0));
    // Opaque where u < ½, a hole beyond.
    let rgba = [255, 255, 255, 255, 255, 255, 255, 0];
    let wrap = [crate::scene::texture::Wrap::ClampToEdge; 2];
    scene.textures.push(crate::scene::Texture::from_rgba8("holes".into(), 2, 1, &rgba, true, wrap, false));
    scene.materials[0].alpha_mode = AlphaMode::Mask(0.5);
    scene.materials[0].base_color_texture =
        Some(crate::scene::TextureRef { texture: 0, texcoord: 0, scale: Vec2::ONE, rotation: 0.0, offset: Vec2::ZERO });
    let bvh = SceneBvh::new(scene.clone());
    let down = |x: f64| Ray { origin: DVec3::new(x, 0.1, 1.0), direction: DVec3::NEG_Z };
    assert!(bvh.nearest(&down(0.3), 0.0, Sides::Front).is_some());
    assert!(bvh.nearest(&down(0.7), 0.0, Sides::Front).is_none());
    assert!(!bvh.occluded(DVec3::new(0.7, 0.1, 1.0), DVec3::new(0.7, 0.1, -1.0)));
}

#[test]
fn slivers_and_broken_corners_meet_nothing() {
    let broken = triangle([DVec3::ZERO, DVec3::X, DVec3::splat(f64::NAN)], 0);
    let sliver = triangle([DVec3::ZERO, DVec3::X, DVec3::X * 2.0], 0);
    let scene =
        Scene { triangles: vec![broken, sliver], materials: vec![Material::diffuse(Vec3::ONE)], ..Scene::default() };
    let bvh = SceneBvh::new(scene.clone());
    assert_eq!(bvh.triangle_count(), 0);
    let ray = Ray { origin: DVec3::new(0.5, 0.0, 1.0), direction: DVec3::NEG_Z };
    assert!(bvh.nearest(&ray, 0.0, Sides::Both).is_none() && !bvh.occluded(DVec3::Z, DVec3::NEG_Z));
}

#[test]
fn rays_leave_their_own_surface_at_any_scale() {
    for scale in [1e-3, 1.0, 1e4] {
        let corners = [DVec3::new(-1.0, -1.0, 0.3), DVec3::new(2.0, -1.0, 0.1), DVec3::new(0.0, 2.0, 0.2)];
        let scene = Scene {
            triangles: vec![triangle(corners.map(|p| (p + DVec3::new(3.0, 5.0, 1.0)) * scale), 1)],
            ..soup(0, 0)
        };
        let bvh = SceneBvh::new(scene.clone());
        let t = &scene.triangles[0];
        let mut random = Random::new(1, 1);
        for _ in 0..1000 {
            let (v, w) = (0.5 * random.uniform(), 0.5 * random.uniform());
            let direction = DVec3::from_array(std::array::from_fn(|_| random.uniform() - 0.5)).normalize();
            let ray = Ray { origin: t.at([v, w]), direction };
            assert!(bvh.nearest_leaving(&ray, t.normal(), Sides::Both).is_none(), "at scale {scale}");
        }
    }
}
