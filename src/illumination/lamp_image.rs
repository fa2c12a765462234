//! One lamp as a row of flat mirrors shows it.

use super::emitters::{Emitters, MOST_REDRAWS, ShadowRays};
use super::flat_mirrors::{FlatMirror, polygon_area};
use super::form_factor::{clip, point_to_element, point_to_polygon};
use super::paths::Optics;
use super::punctual::punctual_light;
use super::reflection::reflected;
use super::sampling::GOLDEN;
use super::surface::{ShadingPoint, Surface};
use crate::random::Random;
use crate::scene::bvh::Ray;
use crate::scene::{LightKind, PunctualLight};
use glam::{DVec3, Vec3};

/// Images whose mirrors together reflect less than this are left out.
const LEAST_REFLECTANCE: f32 = 1e-3;
/// Lamps, and the optics that their light goes through.
#[derive(Clone, Copy)]
pub(crate) struct Lamps<'a> {
    pub(crate) optics: &'a Optics,
    pub(crate) emitters: &'a Emitters,
}

/// A mirror's outline, unfolded.
#[derive(Clone, Debug)]
pub(super) struct Window {
    outline: Vec<DVec3>,
    middle: DVec3,
    /// Which surface stands there.
    surface: u32,
}

/// What shines.
#[derive(Clone, Debug)]
enum LampSource {
    /// A sampled polygon.
    Polygon(usize),
    /// A punctual light at the place of its image.
    Point(PunctualLight),
}

/// A lamp as a row of flat mirrors shows it.
#[derive(Clone, Debug)]
pub(super) struct Image {
    source: LampSource,
    /// The unfolded polygon [m]; empty for a punctual light.
    polygon: Vec<DVec3>,
    /// Its unit normal.
    normal: DVec3,
    /// What the light passes, nearest to the lit point first.
    pub(super) windows: Vec<Window>,
    /// The lit side of the first mirror: its plane's point and normal.
    front: Option<(DVec3, DVec3)>,
    /// Product of the mirrors' reflectances at normal incidence.
    reflectance: f32,
}

impl Image {
    /// This image as a further mirror shows it; `None` where no light takes that way.
    pub(super) fn seen_in(&self, mirror: &FlatMirror, lamps: Lamps) -> Option<Self> {
        let reflectance = self.reflectance * mirror.reflectance;
        if reflectance < LEAST_REFLECTANCE || self.windows.first().is_some_and(|w| w.surface == mirror.surface) {
            return None;
        }
        let mut windows = self.windows.clone();
        let mut polygon = self.polygon.clone();
        let mut outline = mirror.outline.clone();
        let size = lamps.optics.bvh.offset();
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
                LampSource::Polygon(k) => {
                    polygon = mirror.in_front(&polygon);
                    if !lamps.emitters.polygons[*k].two_sided {
                        let mut kept = Vec::new();
                        clip(&outline, |p| (p - self.polygon[0]).dot(self.normal), &mut kept);
                        outline = kept;
                    }
                    if polygon_area(&polygon) <= size * size {
                        return None;
                    }
                }
                LampSource::Point(light) => {
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
            LampSource::Polygon(k) => LampSource::Polygon(*k),
            LampSource::Point(light) => {
                let mut light = light.clone();
                light.position = mirror.image(light.position.as_dvec3()).as_vec3();
                let axes = light.measured.iter_mut().flat_map(|measured| &mut measured.axes);
                for axis in axes.chain([&mut light.direction]) {
                    *axis = reflected(axis.as_dvec3(), mirror.normal).as_vec3();
                }
                LampSource::Point(light)
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
    pub(super) fn unhindered(&self, lamps: Lamps, at: ShadingPoint) -> f64 {
        let ShadingPoint { position: point, normal } = at;
        let light = match &self.source {
            LampSource::Polygon(k) => {
                let emitter = &lamps.emitters.polygons[*k];
                if !self.lights(point, emitter.two_sided) {
                    return 0.0;
                }
                emitter.mean_radiance * point_to_polygon(point, normal, &self.seen_from(point)) as f32
            }
            LampSource::Point(light) => match punctual_light(lamps.optics.bvh.size(), light, at) {
                Some((strength, end)) if self.lights(point, true) && self.passes(point, end - point) => strength,
                _ => return 0.0,
            },
        };
        f64::from(light.element_sum() * self.reflectance)
    }

    /// Whether it is one of a punctual light.
    pub(super) fn is_of_point(&self) -> bool {
        matches!(self.source, LampSource::Point(_))
    }

    /// Irradiance over π.
    pub(super) fn light(&self, lamps: Lamps, at: ShadingPoint, rays: ShadowRays, random: &mut Random) -> Vec3 {
        let ShadingPoint { position: point, normal } = at;
        match &self.source {
            LampSource::Point(light) => {
                let Some((strength, end)) = punctual_light(lamps.optics.bvh.size(), light, at) else {
                    return Vec3::ZERO;
                };
                if !self.lights(point, true) || !self.passes(point, end - point) {
                    return Vec3::ZERO;
                }
                strength * self.follow(lamps, point, end, None).0
            }
            LampSource::Polygon(k) => {
                let emitter = &lamps.emitters.polygons[*k];
                if !self.lights(point, emitter.two_sided) {
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
                            let (tint, end) = self.follow(lamps, point, at, Some(*k));
                            if tint.max_element() > 0.0 {
                                clear += weight;
                                sum += tint * emitter.radiance_at(lamps.optics.scene(), end) * weight as f32;
                            }
                        }
                    }
                    clear > 0.0 && clear < total
                };
                if cast(rays.first) && rays.penumbra > 0 {
                    cast(rays.penumbra);
                }
                let scale = lamps.emitters.scale();
                if total > 0.0 { sum * (factor / total) as f32 * scale } else { Vec3::ZERO }
            }
        }
    }

    /// Follows the folded way to what stands unfolded at `at`: what is left of the light, and where it ends [m].
    fn follow(&self, lamps: Lamps, point: DVec3, at: DVec3, lamp: Option<usize>) -> (Vec3, DVec3) {
        let (bvh, scene) = (&lamps.optics.bvh, lamps.optics.scene());
        let mut left = (at - point).length();
        let mut ray = Ray { origin: point, direction: (at - point) / left };
        let mut tint = Vec3::ONE;
        let dark = (Vec3::ZERO, point);
        for window in &self.windows {
            let (found, part) = lamps.optics.solid(ray, left);
            let Some((meeting, from)) = found else { return dark };
            if lamps.optics.mirrors.of[meeting.triangle as usize] != window.surface {
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
            let normal = lamps.emitters.polygons[k].normal;
            normal * reach.copysign(-normal.dot(ray.direction))
        });
        (tint * lamps.optics.transmittance(ray.origin, end + lift), end)
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
            LightKind::Directional | LightKind::Sun { .. } => self.direction.as_dvec3().dot(mirror.normal) < 0.0,
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

/// The lamps themselves, as images by way of no mirror.
pub(super) fn plain_lamps(lamps: Lamps) -> Vec<Image> {
    let plain = |source, polygon: Vec<DVec3>, normal| Image {
        source,
        polygon,
        normal,
        windows: Vec::new(),
        front: None,
        reflectance: 1.0,
    };
    let polygons = lamps.emitters.polygons.iter().enumerate();
    let polygons = polygons.map(|(k, e)| plain(LampSource::Polygon(k), e.corners.clone(), e.normal));
    polygons
        .chain(lamps.optics.scene().lights.iter().map(|l| plain(LampSource::Point(l.clone()), Vec::new(), DVec3::ZERO)))
        .collect()
}
