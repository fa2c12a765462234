//! Light that reaches a surface by way of flat mirrors.
//!
//! Behind a flat mirror stands an image of the lamp; behind two that face each other stands a row of them. A path
//! point → mirrors → lamp is unfolded into a straight line through the mirrors' outlines, so that what a point sees of
//! an image is the image's polygon clipped by the pyramids of these outlines: its form factor is exact, and rays decide
//! only what stands in the way. Curved mirrors, glass and rough metal are left to photons (`photons`).

use super::emitters::{Emitters, MOST_REDRAWS, ShadowRays, punctual_light};
use super::flat_mirrors::{FlatMirror, polygon_area};
use super::form_factor::{clip, point_to_element, point_to_polygon};
use super::paths::{Optics, reflected};
use super::sampling::GOLDEN;
use super::surface::Surface;
use crate::random::Random;
use crate::scene::PunctualLight;
use crate::scene::bvh::{Ray, SceneBvh};
use glam::{DVec3, Vec3};

/// Images whose mirrors together reflect less than this are left out.
const LEAST_REFLECTANCE: f32 = 1e-3;
/// Images that are tried at most.
const MOST_CANDIDATES: usize = 1024;
/// An image that adds less than this to the light anywhere is left out: below the noise of a penumbra.
const LEAST_SHARE: f64 = 3e-4;
/// One that adds less than this everywhere is computed at the vertices of the mesh, not at each point.
const STRONG_SHARE: f64 = 0.03;

/// What a ray meets when it follows light through mirrors.
#[derive(Clone, Copy)]
pub(crate) struct Around<'a> {
    pub(crate) bvh: &'a SceneBvh,
    pub(crate) optics: &'a Optics,
    pub(crate) emitters: &'a Emitters,
}

/// A mirror's outline, unfolded.
#[derive(Clone, Debug)]
struct Window {
    outline: Vec<DVec3>,
    middle: DVec3,
    /// Which surface stands there.
    surface: u32,
}

/// What shines.
#[derive(Clone, Debug)]
enum Source {
    /// A sampled polygon.
    Polygon(usize),
    /// A punctual light at the place of its image.
    Point(PunctualLight),
}

/// A lamp as a row of flat mirrors shows it.
#[derive(Clone, Debug)]
struct Image {
    source: Source,
    /// The unfolded polygon [m]; empty for a punctual light.
    polygon: Vec<DVec3>,
    /// Its unit normal.
    normal: DVec3,
    /// What the light passes, nearest to the lit point first.
    windows: Vec<Window>,
    /// The lit side of the first mirror: its plane's point and normal.
    front: Option<(DVec3, DVec3)>,
    /// Product of the mirrors' reflectances at normal incidence.
    reflectance: f32,
}

/// All images of all lamps.
#[derive(Clone, Debug, Default)]
pub(crate) struct Images {
    strong: Vec<Image>,
    weak: Vec<Image>,
}

impl Images {
    /// How many mirrors may have images of their own, so that not too many are tried.
    pub(crate) fn most_mirrors(lamps: usize) -> usize {
        (MOST_CANDIDATES / lamps.max(1)).min(32)
    }

    /// Finds the images and sorts them by what they add at the places given as points and normals.
    pub(crate) fn new(around: Around, places: &[(DVec3, DVec3)]) -> Self {
        let scene = around.bvh.scene();
        let lamps = lamps(around.emitters, scene);
        let mirrors = &around.optics.mirrors;
        if mirrors.sides.is_empty() {
            return Self::default();
        }
        let mut all = lamps;
        let (direct, mut at) = (all.len(), 0);
        while at < all.len() && all.len() < MOST_CANDIDATES {
            if all[at].windows.len() < around.optics.bounces as usize {
                let next: Vec<Image> = mirrors.sides.iter().filter_map(|m| all[at].seen_in(m, around)).collect();
                all.extend(next);
            }
            at += 1;
        }
        let (mut greatest, mut shares) = (vec![0.0f64; all.len()], vec![0.0f64; all.len()]);
        for &(point, normal) in places {
            for (share, image) in shares.iter_mut().zip(&all) {
                *share = image.unhindered(around, point, normal);
            }
            let total: f64 = shares.iter().sum();
            if total > 0.0 {
                greatest.iter_mut().zip(&shares).for_each(|(g, s)| *g = g.max(s / total));
            }
        }
        let mut images = Self::default();
        for (image, share) in all.into_iter().zip(greatest).skip(direct) {
            if share >= STRONG_SHARE {
                images.strong.push(image);
            } else if share >= LEAST_SHARE {
                images.weak.push(image);
            }
        }
        images
    }

    /// Number of images.
    pub(crate) fn len(&self) -> usize {
        self.strong.len() + self.weak.len()
    }

    /// Irradiance over π from images that make shadows of their own, at a point that is lifted off its surface.
    pub(crate) fn strong(
        &self,
        around: Around,
        point: DVec3,
        normal: DVec3,
        rays: ShadowRays,
        random: &mut Random,
    ) -> Vec3 {
        self.strong.iter().map(|image| image.light(around, point, normal, rays, random)).sum()
    }

    /// The same from all others.
    pub(crate) fn weak(&self, around: Around, point: DVec3, normal: DVec3, random: &mut Random) -> Vec3 {
        let rays = ShadowRays { first: 4, penumbra: 0, clear: 0 };
        self.weak.iter().map(|image| image.light(around, point, normal, rays, random)).sum()
    }
}

/// The lamps themselves, as images by way of no mirror.
fn lamps(emitters: &Emitters, scene: &crate::scene::Scene) -> Vec<Image> {
    let plain = |source, polygon: Vec<DVec3>, normal| Image {
        source,
        polygon,
        normal,
        windows: Vec::new(),
        front: None,
        reflectance: 1.0,
    };
    let polygons = emitters.polygons.iter().enumerate();
    let polygons = polygons.map(|(k, e)| plain(Source::Polygon(k), e.corners().to_vec(), e.normal()));
    polygons.chain(scene.lights.iter().map(|l| plain(Source::Point(l.clone()), Vec::new(), DVec3::ZERO))).collect()
}

impl Image {
    /// This image as a further mirror shows it; `None` where no light takes that way.
    fn seen_in(&self, mirror: &FlatMirror, around: Around) -> Option<Self> {
        let reflectance = self.reflectance * mirror.reflectance;
        if reflectance < LEAST_REFLECTANCE || self.windows.first().is_some_and(|w| w.surface == mirror.surface) {
            return None;
        }
        let mut windows = self.windows.clone();
        let mut polygon = self.polygon.clone();
        let mut outline = mirror.outline.clone();
        let size = around.bvh.offset();
        match (windows.first_mut(), self.front) {
            (Some(first), Some((at, normal))) => {
                first.outline = mirror.in_front(&first.outline);
                let mut kept = Vec::new();
                clip(&outline, |p| (p - at).dot(normal), &mut kept);
                outline = kept;
                if polygon_area(&first.outline) <= size * size {
                    return None;
                }
            }
            _ => match &self.source {
                Source::Polygon(k) => {
                    polygon = mirror.in_front(&polygon);
                    if !around.emitters.polygons[*k].is_two_sided() {
                        let mut kept = Vec::new();
                        clip(&outline, |p| (p - self.polygon[0]).dot(self.normal), &mut kept);
                        outline = kept;
                    }
                    if polygon_area(&polygon) <= size * size {
                        return None;
                    }
                }
                Source::Point(light) => {
                    if !light.shines_on(mirror) {
                        return None;
                    }
                }
            },
        }
        if polygon_area(&outline) <= size * size {
            return None;
        }
        let source = match &self.source {
            Source::Polygon(k) => Source::Polygon(*k),
            Source::Point(light) => {
                let mut light = light.clone();
                light.position = mirror.image(light.position.as_dvec3()).as_vec3();
                light.direction = reflected(light.direction.as_dvec3(), mirror.normal).as_vec3();
                Source::Point(light)
            }
        };
        let mut unfolded = vec![Window::new(outline, mirror.surface)];
        unfolded.extend(
            windows
                .into_iter()
                .map(|w| Window::new(w.outline.into_iter().map(|p| mirror.image(p)).collect(), w.surface)),
        );
        Some(Self {
            source,
            polygon: polygon.into_iter().map(|p| mirror.image(p)).collect(),
            normal: reflected(self.normal, mirror.normal),
            windows: unfolded,
            front: Some((mirror.outline[0], mirror.normal)),
            reflectance,
        })
    }

    /// What of the image's polygon a point sees through the mirrors.
    fn seen_from(&self, point: DVec3) -> Vec<DVec3> {
        let mut polygon = self.polygon.clone();
        let mut kept = Vec::with_capacity(polygon.len() + 4);
        for window in &self.windows {
            for (i, &a) in window.outline.iter().enumerate() {
                let b = window.outline[(i + 1) % window.outline.len()];
                let edge = (a - point).cross(b - point);
                let edge = if edge.dot(window.middle - point) < 0.0 { -edge } else { edge };
                if polygon.iter().all(|p| (*p - point).dot(edge) >= 0.0) {
                    continue;
                }
                clip(&polygon, |p| (p - point).dot(edge), &mut kept);
                std::mem::swap(&mut polygon, &mut kept);
                if polygon.is_empty() {
                    return polygon;
                }
            }
        }
        polygon
    }

    /// Whether the point stands where light of the image can come from the first mirror.
    fn lights(&self, point: DVec3, two_sided: bool) -> bool {
        self.front.is_none_or(|(at, normal)| (point - at).dot(normal) > 0.0)
            && (two_sided || self.polygon.is_empty() || (point - self.polygon[0]).dot(self.normal) > 0.0)
    }

    /// Whether the straight line from the point to the place of a punctual light's image runs through all windows.
    fn passes(&self, point: DVec3, towards: DVec3) -> bool {
        self.windows.iter().all(|window| {
            window.outline.iter().enumerate().all(|(i, &a)| {
                let b = window.outline[(i + 1) % window.outline.len()];
                let edge = (a - point).cross(b - point);
                edge.dot(window.middle - point) * edge.dot(towards) >= 0.0
            })
        })
    }

    /// Irradiance over π in the sum of the colours, as if nothing stood in the way.
    fn unhindered(&self, around: Around, point: DVec3, normal: DVec3) -> f64 {
        let light = match &self.source {
            Source::Polygon(k) => {
                let emitter = &around.emitters.polygons[*k];
                if !self.lights(point, emitter.is_two_sided()) {
                    return 0.0;
                }
                emitter.mean_radiance() * point_to_polygon(point, normal, &self.seen_from(point)) as f32
            }
            Source::Point(light) => match punctual_light(around.bvh, light, point, normal) {
                Some((strength, end)) if self.lights(point, true) && self.passes(point, end - point) => strength,
                _ => return 0.0,
            },
        };
        f64::from(light.element_sum() * self.reflectance)
    }

    /// Irradiance over π.
    fn light(&self, around: Around, point: DVec3, normal: DVec3, rays: ShadowRays, random: &mut Random) -> Vec3 {
        match &self.source {
            Source::Point(light) => {
                let Some((strength, end)) = punctual_light(around.bvh, light, point, normal) else { return Vec3::ZERO };
                if !self.lights(point, true) || !self.passes(point, end - point) {
                    return Vec3::ZERO;
                }
                strength * self.follow(around, point, end, None).0
            }
            Source::Polygon(k) => {
                let emitter = &around.emitters.polygons[*k];
                if !self.lights(point, emitter.is_two_sided()) {
                    return Vec3::ZERO;
                }
                let seen = self.seen_from(point);
                let factor = point_to_polygon(point, normal, &seen);
                if factor <= 0.0 {
                    return Vec3::ZERO;
                }
                let (mut total, mut clear, mut sum) = (0.0, 0.0, Vec3::ZERO);
                let mut cast = |count: u32| {
                    let (shift, turn) = (random.uniform(), random.uniform());
                    for i in 0..count {
                        let u = (f64::from(i) + shift) / f64::from(count);
                        let mut at = spread(&seen, u, (turn + f64::from(i) * GOLDEN).fract());
                        let away = if (point - at).dot(self.normal) >= 0.0 { self.normal } else { -self.normal };
                        let mut weight = point_to_element(point, normal, at, away, 1.0);
                        for _ in 0..MOST_REDRAWS {
                            if weight > 0.0 {
                                break;
                            }
                            at = spread(&seen, random.uniform(), random.uniform());
                            weight = point_to_element(point, normal, at, away, 1.0);
                        }
                        total += weight;
                        if weight > 0.0 {
                            let (tint, end) = self.follow(around, point, at, Some(*k));
                            if tint.max_element() > 0.0 {
                                clear += weight;
                                sum += tint * emitter.radiance_at(around.bvh.scene(), end) * weight as f32;
                            }
                        }
                    }
                    clear > 0.0 && clear < total
                };
                if cast(rays.first) && rays.penumbra > 0 {
                    cast(rays.penumbra);
                }
                let scale = around.emitters.scale();
                if total > 0.0 { sum * (factor / total) as f32 * scale } else { Vec3::ZERO }
            }
        }
    }

    /// Follows the folded way to what stands unfolded at `at`: what is left of the light, and where it ends [m].
    fn follow(&self, around: Around, point: DVec3, at: DVec3, lamp: Option<usize>) -> (Vec3, DVec3) {
        let (bvh, scene) = (around.bvh, around.bvh.scene());
        let mut left = (at - point).length();
        let mut ray = Ray { origin: point, direction: (at - point) / left };
        let mut tint = Vec3::ONE;
        let dark = (Vec3::ZERO, point);
        for window in &self.windows {
            let (found, part) = around.optics.solid(bvh, ray, left);
            let Some((meeting, from)) = found else { return dark };
            if around.optics.mirrors.of[meeting.triangle as usize] != window.surface {
                return dark;
            }
            let hit = bvh.refined(&from, &meeting);
            let surface = Surface::at(scene, &hit, 0.0);
            tint *= part * surface.fresnel(-surface.facing.dot(ray.direction));
            left -= (hit.position - ray.origin).length();
            ray.direction = reflected(ray.direction, surface.facing);
            ray.origin = hit.position + surface.facing * bvh.offset();
        }
        let end = ray.at(left);
        // Each start off a mirror has moved the end by as much.
        let reach = bvh.offset() * (2 + self.windows.len()) as f64;
        let lift = lamp.map_or(DVec3::ZERO, |k| {
            let normal = around.emitters.polygons[k].normal();
            normal * reach.copysign(-normal.dot(ray.direction))
        });
        (tint * around.optics.transmittance(bvh, ray.origin, end + lift), end)
    }
}

impl Window {
    fn new(outline: Vec<DVec3>, surface: u32) -> Self {
        let middle = outline.iter().sum::<DVec3>() / outline.len().max(1) as f64;
        Self { outline, middle, surface }
    }
}

impl PunctualLight {
    /// Whether it stands on the side of a mirror that reflects, or shines on it from infinity.
    fn shines_on(&self, mirror: &FlatMirror) -> bool {
        match self.kind {
            crate::scene::LightKind::Directional => self.direction.as_dvec3().dot(mirror.normal) < 0.0,
            _ => mirror.height(self.position.as_dvec3()) > 0.0,
        }
    }
}

/// The point of a convex polygon at a place of the unit square, uniform in area.
fn spread(polygon: &[DVec3], u: f64, v: f64) -> DVec3 {
    let first = polygon[0];
    let area = |pair: &[DVec3]| 0.5 * (pair[0] - first).cross(pair[1] - first).length();
    let total: f64 = polygon[1..].windows(2).map(area).sum();
    let mut below = u * total;
    let mut pairs = polygon[1..].windows(2).peekable();
    while let Some(pair) = pairs.next() {
        let size = area(pair);
        if below <= size || pairs.peek().is_none() {
            let along = if size > 0.0 { (below / size).clamp(0.0, 1.0) } else { 0.5 };
            let root = v.sqrt();
            return first + (pair[0].lerp(pair[1], along) - first) * root;
        }
        below -= size;
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::illumination::rooms::Room;
    use crate::illumination::{Illumination, IlluminationSettings, Surface};
    use crate::progress::Progress;
    use crate::scene::{LightKind, Material, Scene, Sides};

    fn floor_at(scene: &Scene, x: f64, z: f64) -> Vec3 {
        let bvh = SceneBvh::new(scene.clone());
        let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).unwrap();
        let ray = Ray { origin: DVec3::new(x, 0.05, z), direction: DVec3::NEG_Y };
        let hit = light.bvh().nearest(&ray, 0.0, Sides::Front).unwrap();
        light.radiance(&hit, &Surface::at(scene, &hit, 0.0), 1, &mut Random::new(3, 3))
    }

    /// A black-and-white floor of albedo one, a lamp that looks down at height 1, and whatever else is put in.
    fn floor_and_lamp(room: &mut Room) {
        let white = room.material(Material::diffuse(Vec3::ONE));
        let lamp = room.material(Material::emitter(Vec3::new(4.0, 2.0, 1.0)));
        room.quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0, white);
        room.quad(DVec3::new(-0.1, 1.0, -0.1), DVec3::X * 0.2, DVec3::Z * 0.2, lamp);
    }

    fn close(found: Vec3, expected: Vec3, tolerance: f32) {
        assert!(((found - expected) / expected).abs().max_element() < tolerance, "{found} is not {expected}");
    }

    #[test]
    fn a_mirror_wall_doubles_the_lamp() {
        // A mirror in the plane x = 0.5, higher and wider than any way from the lamp's image to the floor: the image
        // stands at x = 1 and shines as the lamp does, times the mirror's Fresnel reflectance.
        let mut room = Room::default();
        floor_and_lamp(&mut room);
        let silver = room.material(Material::mirror(Vec3::splat(0.9)));
        room.quad(DVec3::new(0.5, 0.001, -3.0), DVec3::Z * 6.0, DVec3::Y * 4.0, silver);
        for (x, z) in [(0.1, 0.05), (-0.4, 0.3), (0.45, -0.2)] {
            let lamp = |shift: f64| {
                let corner = DVec3::new(shift - 0.1, 1.0, -0.1);
                let polygon =
                    [corner, corner + DVec3::X * 0.2, corner + DVec3::new(0.2, 0.0, 0.2), corner + DVec3::Z * 0.2];
                point_to_polygon(DVec3::new(x, 0.0, z), DVec3::Y, &polygon)
            };
            // Schlick at the angle of the image's middle.
            let way = DVec3::new(1.0 - x, 1.0, -z).normalize();
            let fresnel = 0.9 + 0.1 * (1.0 - way.x).powi(5);
            let expected = Vec3::new(4.0, 2.0, 1.0) * (lamp(0.0) + fresnel * lamp(1.0)) as f32;
            // The floor sees itself in the mirror, but that is light from floor to floor: none, both lie in one plane.
            close(floor_at(&room.scene, x, z), expected, 1e-3);
        }
    }

    #[test]
    fn a_small_mirror_shows_a_part_of_the_lamp() {
        // The image is clipped by the mirror's outline: against a fine grid over lamp and mirror.
        let mut room = Room::default();
        floor_and_lamp(&mut room);
        let silver = room.material(Material::mirror(Vec3::ONE));
        room.quad(DVec3::new(0.5, 0.45, -0.03), DVec3::Z * 0.1, DVec3::Y * 0.1, silver);
        let (x, z) = (0.02, 0.03);
        let (point, n) = (DVec3::new(x, 0.0, z), 400);
        let (mut through, mut direct) = (0.0, 0.0);
        for i in 0..n * n {
            let (s, t) = ((f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n));
            let area = 0.04 / f64::from(n * n);
            let at = DVec3::new(-0.1 + 0.2 * s, 1.0, -0.1 + 0.2 * t);
            direct += point_to_element(point, DVec3::Y, at, DVec3::NEG_Y, area);
            let image = DVec3::new(1.0 - at.x, at.y, at.z);
            let meets = point.lerp(image, (0.5 - x) / (image.x - x));
            if (0.45..0.55).contains(&meets.y) && (-0.03..0.07).contains(&meets.z) {
                through += point_to_element(point, DVec3::Y, image, DVec3::NEG_Y, area);
            }
        }
        assert!(through > 0.02 * direct, "{through} of {direct}");
        close(floor_at(&room.scene, x, z), Vec3::new(4.0, 2.0, 1.0) * (direct + through) as f32, 2e-3);
    }

    #[test]
    fn mirrors_that_face_each_other_repeat_the_lamp() {
        // Walls at x = ±0.5 of reflectance 0.8, as high and wide as any way needs: images at x = ±1, ±2, … of strength
        // 0.8^k (Schlick's rise at grazing angles is in the sum, image by image).
        let mut room = Room::default();
        let white = room.material(Material::diffuse(Vec3::ONE));
        let lamp = room.material(Material::emitter(Vec3::ONE));
        let silver = room.material(Material::mirror(Vec3::splat(0.8)));
        room.quad(DVec3::new(-0.5, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X, white);
        room.quad(DVec3::new(-0.1, 1.0, -0.1), DVec3::X * 0.2, DVec3::Z * 0.2, lamp);
        room.quad(DVec3::new(0.5, 0.0, -20.0), DVec3::Z * 40.0, DVec3::Y * 1.5, silver);
        room.quad(DVec3::new(-0.5, 0.0, -20.0), DVec3::Y * 1.5, DVec3::Z * 40.0, silver);
        let (x, z) = (0.13, 0.21);
        let point = DVec3::new(x, 0.0, z);
        let mut expected = 0.0;
        for k in -60i32..=60 {
            let n = 20;
            for i in 0..n * n {
                let (s, t) = ((f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n));
                let at = DVec3::new(f64::from(k) - 0.1 + 0.2 * s, 1.0, -0.1 + 0.2 * t);
                let cosine = ((at - point).normalize()).x.abs();
                let part = 0.8 + 0.2 * (1.0 - cosine).powi(5);
                expected +=
                    point_to_element(point, DVec3::Y, at, DVec3::NEG_Y, 0.04 / f64::from(n * n)) * part.powi(k.abs());
            }
        }
        close(floor_at(&room.scene, x, z), Vec3::splat(expected as f32), 5e-3);
    }

    #[test]
    fn a_point_light_stands_behind_the_mirror_too() {
        let mut room = Room::default();
        let white = room.material(Material::diffuse(Vec3::ONE));
        let silver = room.material(Material::mirror(Vec3::ONE));
        room.quad(DVec3::new(-1.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::X * 2.0, white);
        room.quad(DVec3::new(0.5, 0.3, -1.0), DVec3::Z * 2.0, DVec3::Y * 0.4, silver);
        room.scene.lights = vec![PunctualLight {
            kind: LightKind::Point,
            position: Vec3::new(0.0, 1.0, 0.0),
            direction: Vec3::NEG_Y,
            intensity: Vec3::splat(2.0),
            range: f32::INFINITY,
        }];
        let from = |x: f64, lamp: DVec3| {
            let way = lamp - DVec3::new(x, 0.0, 0.1);
            2.0 * way.normalize().y / way.length_squared() / std::f64::consts::PI
        };
        // From x = 0.1 the image at x = 1 is seen at height 0.44 of the mirror's plane, from 0.45 at 0.09: below it.
        let both = from(0.1, DVec3::Y) + from(0.1, DVec3::new(1.0, 1.0, 0.0));
        close(floor_at(&room.scene, 0.1, 0.1), Vec3::splat(both as f32), 1e-4);
        close(floor_at(&room.scene, 0.45, 0.1), Vec3::splat(from(0.45, DVec3::Y) as f32), 1e-4);
    }
}
