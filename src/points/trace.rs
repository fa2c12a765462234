//! From an eye's rays to points of light, and to the picture that the eye sees.
//!
//! Each pixel's ray gives a point where it meets a surface that scatters or emits light. A ray that meets a mirror or
//! glass goes on (`eye`), at glass in two ways: there may be several points on one ray. A point always stands on the
//! *primary* ray. By default it stands where the eye focuses on it, at the centre of the wave that arrives
//! (`wavefront`); on request at the length of the whole way eye → mirrors → surface (Nakamura, Yamaguchi & Yoshikawa).
//! Behind flat mirrors both are the same.

pub use super::settings::{MirrorDepth, TraceSettings};
use crate::error::{Error, Result};
use crate::illumination::Illumination;
use crate::points::eye::{Eye, RaySample};
use crate::points::placement::WorldPoint;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::Camera;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::time::Instant;

/// Ends of a ray that bring less than this part of its light make no point of their own.
const LEAST_SHARE: f32 = 0.01;

/// A point of light in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracedPoint {
    /// Where its ray began [m].
    pub eye: DVec3,
    /// Where it seems to be from there [m].
    pub position: DVec3,
    /// Radiance towards the eye, linear RGB [W/(m² sr)].
    pub radiance: [f32; 3],
    /// From the eye to `position` [m].
    pub distance: f64,
    /// Pixel, row × width + column, row 0 on top.
    pub pixel: u32,
    /// How many mirrors or glass surfaces lie between.
    pub bounces: u8,
    /// Instance of the first surface that the ray meets.
    pub instance: u32,
}

/// What tracing gave.
#[derive(Clone, Debug, Default)]
pub struct Traced {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Mean radiance over each pixel, row 0 on top, linear RGB [W/(m² sr)].
    pub picture: Vec<[f32; 3]>,
    /// Points in the order of their pixels, the strongest of a pixel first; a pixel whose ray meets nothing, or only
    /// darkness, has none, one that is seen by several ways through glass has several.
    pub points: Vec<TracedPoint>,
    /// Counts and time.
    pub report: TraceReport,
}

impl Traced {
    /// The points as a placement takes them.
    pub fn world_points(&self) -> Vec<WorldPoint> {
        self.points.iter().map(|p| WorldPoint { position: p.position, radiance: p.radiance }).collect()
    }
}

/// What tracing took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TraceReport {
    /// Rays whose light was computed: one per pixel and the sub-rays of edges.
    pub rays: u64,
    /// Pixels whose ray left the scene.
    pub missed: u64,
    /// Points by way of mirrors or glass.
    pub by_mirror: u64,
    /// Pixels that were sampled again since they cover an edge.
    pub edges: u64,
    /// Time [s].
    pub seconds: f64,
}

/// Traces one ray per pixel.
///
/// # Errors
/// [`Error::Parameter`] for an empty picture, [`Error::Interrupted`] when asked to stop.
pub fn trace(light: &Illumination, camera: &Camera, settings: &TraceSettings, progress: &Progress) -> Result<Traced> {
    let (width, height) = (settings.width, settings.height);
    let pixels = u64::from(width) * u64::from(height);
    if pixels == 0 || pixels > u64::from(u32::MAX) || settings.edge_rays == 0 {
        return Err(Error::parameter("rays", format!("{width}x{height} with {} sub-rays", settings.edge_rays)));
    }
    let begin = Instant::now();
    let eye = Eye::new(light, camera, settings);
    progress.start("tracing rays", pixels);
    let seen: Vec<RaySample> = (0..pixels as u32)
        .into_par_iter()
        .map(|pixel| {
            if pixel % width == 0 {
                progress.advance(u64::from(width));
            }
            let mut random = Random::new(settings.seed, u64::from(pixel));
            let [column, row] = place(pixel, settings);
            if progress.stopped() { RaySample::nothing() } else { eye.look(column, row, 1, &mut random) }
        })
        .collect();
    progress.check()?;
    let edge: Vec<bool> = (0..pixels as usize).into_par_iter().map(|p| is_edge(&seen, p, width as usize)).collect();
    progress.start("smoothing edges", pixels);
    let picture: Vec<[f32; 3]> = (0..pixels as u32)
        .into_par_iter()
        .map(|pixel| {
            if !edge[pixel as usize] || settings.edge_rays == 1 || progress.stopped() {
                return seen[pixel as usize].radiance.to_array();
            }
            let mut random = Random::new(settings.seed ^ 0xed6e, u64::from(pixel));
            let side = settings.edge_rays;
            let sum: Vec3 = (0..side * side)
                .map(|cell| {
                    let x = (f64::from(cell % side) + random.uniform()) / f64::from(side);
                    let y = (f64::from(cell / side) + random.uniform()) / f64::from(side);
                    eye.look(f64::from(pixel % width) + x, f64::from(pixel / width) + y, side * side, &mut random)
                        .radiance
                })
                .sum();
            (sum / (side * side) as f32).to_array()
        })
        .collect();
    progress.check()?;
    let mut points = Vec::with_capacity(seen.len());
    for (pixel, seen) in seen.iter().enumerate().filter(|(_, seen)| !seen.ends.is_empty()) {
        let [column, row] = place(pixel as u32, settings);
        let ray = eye.ray(column, row);
        let least = LEAST_SHARE * seen.radiance.element_sum();
        points.extend(seen.ends.iter().filter(|end| end.radiance.element_sum() >= least).map(|end| TracedPoint {
            eye: ray.origin,
            position: ray.at(end.depth),
            radiance: end.radiance.to_array(),
            distance: end.depth,
            pixel: pixel as u32,
            bounces: end.bounces,
            instance: light.bvh().scene().triangles[seen.first as usize].instance,
        }));
    }
    let edges = edge.iter().filter(|&&e| e).count() as u64;
    let again = if settings.edge_rays > 1 { edges * u64::from(settings.edge_rays * settings.edge_rays) } else { 0 };
    let report = TraceReport {
        rays: pixels + again,
        missed: seen.iter().filter(|s| s.first == u32::MAX).count() as u64,
        by_mirror: points.iter().filter(|p| p.bounces > 0).count() as u64,
        edges,
        seconds: begin.elapsed().as_secs_f64(),
    };
    Ok(Traced { width, height, picture, points, report })
}

/// Where a pixel's ray goes through the picture, in pixels.
fn place(pixel: u32, settings: &TraceSettings) -> [f64; 2] {
    let [x, y] = if settings.jitter {
        let mut random = Random::new(settings.seed ^ 0x317e, u64::from(pixel));
        [random.uniform(), random.uniform()]
    } else {
        [0.5; 2]
    };
    [f64::from(pixel % settings.width) + x, f64::from(pixel / settings.width) + y]
}

/// Whether a pixel and a neighbour show different things: other surfaces, or a crease between them.
fn is_edge(seen: &[RaySample], pixel: usize, width: usize) -> bool {
    neighbours(pixel, width, seen.len()).any(|other| differ(&seen[pixel], &seen[other]))
}

/// Whether two neighbouring pixels show different things.
pub(super) fn differ(here: &RaySample, other: &RaySample) -> bool {
    let depth = (other.depth - here.depth).abs() > 0.02 * here.depth.min(other.depth);
    let crease = other.first != here.first && other.normal.dot(here.normal) < 0.99;
    let [a, b] = [here, other].map(|seen| seen.radiance.max_element());
    (other.depth > 0.0) != (here.depth > 0.0)
        || other.bounces != here.bounces
        || depth
        || crease
        || (a - b).abs() > 0.5 * a.max(b)
}

/// Pixels to the left, to the right, above and below one of a picture of `count` pixels.
pub(super) fn neighbours(pixel: usize, width: usize, count: usize) -> impl Iterator<Item = usize> {
    let column = pixel % width;
    let left = (column > 0).then(|| pixel - 1);
    let right = Some(pixel + 1).filter(|&p| column + 1 < width && p < count);
    let (above, below) = (pixel.checked_sub(width), Some(pixel + width).filter(|&p| p < count));
    [left, right, above, below].into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::illumination::IlluminationSettings;
    use crate::illumination::test_rooms::Room;
    use crate::scene::{Material, Scene, SceneBvh};

    fn traced(scene: &Scene, camera: &Camera, settings: &TraceSettings) -> Traced {
        let bvh = SceneBvh::new(scene.clone());
        let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).unwrap();
        trace(&light, camera, settings, &Progress::new()).unwrap()
    }

    fn mirror_room(mirror: Material) -> Scene {
        let mut room = Room::default();
        let glow = room.material(Material::emitter(Vec3::new(1.0, 0.5, 0.25)));
        let mirror = room.material(mirror);
        // A tilted glowing square behind the eye, a mirror in front of it in the plane z = −1.
        room.quad(DVec3::new(-3.0, -3.0, 2.0), DVec3::new(0.0, 6.0, 0.4), DVec3::new(6.0, 0.0, 0.7), glow);
        room.quad(DVec3::new(-1.0, -1.0, -1.0), DVec3::X * 2.0, DVec3::Y * 2.0, mirror);
        room.scene
    }

    #[test]
    fn points_in_a_flat_mirror_stand_on_the_mirrored_surface() {
        let scene = mirror_room(Material::mirror(Vec3::new(0.9, 0.8, 0.7)));
        let camera = Camera::looking_at(DVec3::new(0.1, 0.2, 0.5), DVec3::new(0.0, 0.1, -1.0), 1.0);
        let traced = traced(&scene, &camera, &TraceSettings { width: 40, height: 30, ..TraceSettings::default() });
        let mirrored: Vec<_> = traced.points.iter().filter(|p| p.bounces == 1).collect();
        assert!(mirrored.len() > 800 && traced.report.by_mirror == mirrored.len() as u64);
        let glowing = &scene.triangles[0];
        let (corner, normal) = (glowing.corners()[0], glowing.normal());
        for point in mirrored {
            let p = DVec3::new(point.position.x, point.position.y, -2.0 - point.position.z);
            assert!((p - corner).dot(normal).abs() < 1e-6 * 6.0, "{p} is off the mirrored square");
            let ray = camera.ray(
                (f64::from(point.pixel % 40) + 0.5) / 40.0,
                (f64::from(point.pixel / 40) + 0.5) / 30.0,
                40.0 / 30.0,
            );
            assert!(((point.position - ray.origin).normalize() - ray.direction).length() < 1e-12);
            assert!((point.distance - (point.position - point.eye).length()).abs() < 1e-12);
            let tint = [0.9, 0.4, 0.175];
            assert!(point.radiance.iter().zip(tint).all(|(r, t)| r / t > 0.999 && r / t < 1.2), "Schlick only adds");
        }
    }

    #[test]
    fn two_mirrors_face_to_face_repeat() {
        let mut room = Room::default();
        let mirror = room.material(Material::mirror(Vec3::ONE));
        let glow = room.material(Material { double_sided: true, ..Material::emitter(Vec3::ONE) });
        room.quad(DVec3::new(-5.0, -5.0, -1.0), DVec3::X * 10.0, DVec3::Y * 10.0, mirror);
        room.quad(DVec3::new(-5.0, -5.0, 1.0), DVec3::Y * 10.0, DVec3::X * 10.0, mirror);
        // A narrow two-sided strip between them at z = 0.25, off to the right.
        room.quad(DVec3::new(0.4, -0.2, 0.25), DVec3::X * 0.1, DVec3::Y * 0.4, glow);
        let camera = Camera::looking_at(DVec3::ZERO, DVec3::new(0.05, 0.0, -1.0), 0.9);
        let settings = TraceSettings { width: 301, height: 101, bounces: 8, ..TraceSettings::default() };
        let traced = traced(&room.scene, &camera, &settings);
        // Images of the strip: z′ = −2 − 0.25, then by the second mirror, and so on; each lies on the mirrored planes.
        let planes = [-2.25, -3.75, -6.25, -7.75];
        for (bounce, plane) in [1u8, 2, 3, 4].into_iter().zip(planes) {
            let seen: Vec<_> = traced.points.iter().filter(|p| p.bounces == bounce).collect();
            assert!(!seen.is_empty(), "image {bounce} is missing");
            seen.iter().for_each(|p| assert!((p.position.z - plane).abs() < 1e-6 * 10.0, "{bounce}: {}", p.position));
        }
    }

    #[test]
    fn unlit_shows_its_colour_and_lamps_show_themselves() {
        let mut room = Room::default();
        let unlit = room.material(Material { unlit: true, ..Material::diffuse(Vec3::new(0.2, 0.4, 0.6)) });
        let lamp = room.material(Material::emitter(Vec3::new(5.0, 4.0, 3.0)));
        room.quad(DVec3::new(-2.0, -1.0, -2.0), DVec3::X * 2.0, DVec3::Y * 2.0, unlit);
        room.quad(DVec3::new(0.0, -1.0, -2.0), DVec3::X * 2.0, DVec3::Y * 2.0, lamp);
        let camera = Camera::looking_at(DVec3::ZERO, DVec3::NEG_Z, 0.8);
        let traced = traced(&room.scene, &camera, &TraceSettings { width: 8, height: 6, ..TraceSettings::default() });
        assert_eq!(traced.points.len(), 48);
        let close = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a / b - 1.0).abs() < 1e-6);
        assert!(close(traced.picture[0], [0.2, 0.4, 0.6]) && close(traced.points[0].radiance, [0.2, 0.4, 0.6]));
        assert!(close(traced.picture[7], [5.0, 4.0, 3.0]));
    }

    #[test]
    fn edges_are_averaged_over_their_pixel() {
        // A lamp whose edge runs through the middle column at a known fraction of its pixels.
        let mut room = Room::default();
        let lamp = room.material(Material::emitter(Vec3::ONE));
        room.quad(DVec3::new(-5.0, -5.0, -1.0), DVec3::X * 5.03, DVec3::Y * 10.0, lamp);
        let camera = Camera::looking_at(DVec3::ZERO, DVec3::NEG_Z, std::f64::consts::FRAC_PI_2);
        let settings = TraceSettings { width: 21, height: 21, edge_rays: 16, ..TraceSettings::default() };
        let traced = traced(&room.scene, &camera, &settings);
        // Pixel 10 covers x from −1/21 to 1/21; the lamp ends at 0.03.
        let expected = (0.03 + 1.0 / 21.0) * 10.5;
        let mean: f32 = (0..21).map(|row| traced.picture[row * 21 + 10][0]).sum::<f32>() / 21.0;
        assert!((f64::from(mean) - expected).abs() < 1e-2, "{mean} is not {expected}");
        assert!(traced.report.missed > 0 && traced.report.edges >= 42);
    }

    #[test]
    fn jittered_rays_stay_in_their_pixels_and_off_the_lattice() {
        let mut room = Room::default();
        let lamp = room.material(Material::emitter(Vec3::ONE));
        room.quad(DVec3::new(-5.0, -5.0, -1.0), DVec3::X * 10.0, DVec3::Y * 10.0, lamp);
        let camera = Camera::looking_at(DVec3::ZERO, DVec3::NEG_Z, std::f64::consts::FRAC_PI_2);
        let settings = TraceSettings { width: 30, height: 20, jitter: true, ..TraceSettings::default() };
        let traced = traced(&room.scene, &camera, &settings);
        assert_eq!(traced.points.len(), 600);
        let mut offsets = Vec::new();
        for point in &traced.points {
            // The picture is 3 wide and 2 high at distance 1: 0.1 a pixel.
            let (x, y) = ((point.position.x + 1.5) * 10.0, (1.0 - point.position.y) * 10.0);
            assert_eq!((x as u32, y as u32), (point.pixel % 30, point.pixel / 30));
            offsets.push(x.fract());
        }
        let mean = offsets.iter().sum::<f64>() / 600.0;
        let spread = (offsets.iter().map(|o| (o - mean).powi(2)).sum::<f64>() / 600.0).sqrt();
        // Uniform: mean 0.5 ± 0.012, standard deviation 0.289.
        assert!((mean - 0.5).abs() < 0.05 && (spread - 0.289).abs() < 0.03, "{mean} {spread}");
    }

    #[test]
    fn nothing_to_see_and_impossible_pictures() {
        let scene = Scene::default();
        let camera = Camera::looking_at(DVec3::ZERO, DVec3::NEG_Z, 1.0);
        let settings = TraceSettings { width: 4, height: 3, ..TraceSettings::default() };
        let empty = traced(&scene, &camera, &settings);
        assert!(empty.points.is_empty() && empty.picture.iter().all(|p| *p == [0.0; 3]));
        let bvh = SceneBvh::new(scene.clone());
        let light = Illumination::new(bvh, IlluminationSettings::default(), &Progress::new()).unwrap();
        assert!(trace(&light, &camera, &TraceSettings { width: 0, ..settings }, &Progress::new()).is_err());
        let stopped = Progress::new();
        stopped.stop();
        assert!(matches!(trace(&light, &camera, &settings, &stopped), Err(Error::Interrupted)));
    }
}
