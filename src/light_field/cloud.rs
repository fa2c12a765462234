//! The views of a point cloud: each point a small square of a surface, the nearer hiding the farther.
//!
//! Points carry no surface. Each is taken for a square as wide as the cloud is dense where its own eye sees it, so that
//! neighbours close up; a pixel shows the mean of the points that cover it and stand no farther behind the nearest one than a
//! tolerance, weighted by a tent about each point.
//!
//! Points on one ray of their own eye are what it sees by several ways through glass: the brightest is taken for a surface, the
//! light of the others is added to it, and hides nothing.

use super::codes::put;
use super::{EyeGrid, LightField, LightFieldReport, LightFieldSettings};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::points::PointCloud;
use crate::points::white::white_level;
use crate::progress::Progress;
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;
use std::time::Instant;

/// Width of a point's square over the distance of neighbouring points: more than one, since a surface that is seen from
/// another place is stretched.
const SPREAD: f64 = 1.6;
/// Points of a bin when the density is counted.
const BIN: f64 = 24.0;
/// Points that stand behind the nearest one by less than this part of the cloud's depth belong to the same surface.
const SAME_SURFACE: f64 = 0.02;
/// Points that their own eye sees no farther apart than this on the panel's plane stand on one ray [m].
const ONE_RAY: f64 = 1e-7;
/// Points nearer to the eyes than this part of their distance from the panel are left out.
const NEAREST: f64 = 0.05;

/// A point as it is splatted.
#[derive(Clone, Copy)]
struct Splat {
    position: DVec3,
    /// Radiance over white's.
    light: Vec3,
    /// For what is seen past a brighter point of its ray: the nearer of their depths [m].
    past: Option<f64>,
}

/// One view's picture as it grows.
#[derive(Clone, Default)]
struct Canvas {
    /// Depth z of the nearest point; −∞ where there is none.
    nearest: Vec<f32>,
    sums: Vec<Vec3>,
    weights: Vec<f32>,
}

impl LightField {
    /// What eyes on a lattice see of a point cloud through the pixels `window` of the panel's plane.
    ///
    /// Amplitudes are √radiance × distance from the eye `placed_for` [m], as [`place`](crate::points::place) gives them. A
    /// cloud without colours makes one channel.
    ///
    /// # Errors
    /// [`Error::Parameter`] for a cloud of which no point stands before the eyes; as for
    /// [`of_scene`](LightField::of_scene).
    pub fn of_cloud(
        cloud: &PointCloud,
        placed_for: DVec3,
        settings: &LightFieldSettings,
        eyes: EyeGrid,
        window: Grid,
        progress: &Progress,
    ) -> Result<(Self, LightFieldReport)> {
        settings.check()?;
        cloud.check()?;
        let begin = Instant::now();
        let mono = cloud.rgb.is_none() || settings.channel.is_some();
        let mut field = Self::black(eyes, window, if mono { 1 } else { 3 })?;
        let (splats, white) = splats(cloud, placed_for, settings, eyes.distance)?;
        let z = || splats.iter().map(|s| s.position.z);
        field.depth = [z().fold(f64::NEG_INFINITY, f64::max), z().fold(f64::INFINITY, f64::min)];
        let middle = field.middle();
        let spacing = spacing(&splats, eyes.position(middle));
        let painter = Painter {
            splats: &splats,
            window,
            half: [window.pitch_x, window.pitch_y].map(|pitch| 0.5 * pitch.max(SPREAD * spacing)),
            same: SAME_SURFACE * (field.depth[0] - field.depth[1]),
        };
        let views = (0..eyes.count()).filter(|&index| settings.makes(&eyes, index)).count();
        progress.start("drawing views", (views * splats.len()) as u64);
        let mut stand = vec![f32::NAN; window.len()];
        painter.hide(eyes.position(middle), &mut stand);
        let draw = |canvas: &mut Canvas, (index, mut codes): (usize, Vec<&mut [u16]>)| {
            if progress.stopped() || !settings.makes(&eyes, index) {
                return 1.0;
            }
            painter.draw(eyes.position(index), canvas, progress);
            let mean = |(sum, weight): (&Vec3, &f32)| if *weight > 0.0 { *sum / *weight } else { Vec3::ZERO };
            let means = canvas.sums.iter().zip(&canvas.weights).map(mean);
            let light: Vec<Vec3> = means.map(|light| settings.shown(light, 1.0)).collect();
            put(&light, settings.channel.filter(|_| cloud.rgb.is_some()), &mut codes)
        };
        let pieces = field.pieces(window.len()).into_par_iter().enumerate();
        let peaks: Vec<f32> = pieces.map_init(Canvas::default, draw).collect();
        progress.check()?;
        field.level(&peaks, window.len());
        let depth = field.depth;
        stand.iter_mut().filter(|z| z.is_infinite()).for_each(|z| *z = f32::NAN);
        field.stand_at(stand);
        field.depth = depth;
        let (rays, seconds) = ((views * splats.len()) as u64, begin.elapsed().as_secs_f64());
        let rays_per_second = rays as f64 / seconds.max(1e-9);
        Ok((field, LightFieldReport { views, rays, rays_per_second, cached: 0, white, seconds }))
    }
}

/// The points before the eyes with their light, and the white that it is over.
fn splats(
    cloud: &PointCloud,
    placed_for: DVec3,
    settings: &LightFieldSettings,
    distance: f64,
) -> Result<(Vec<Splat>, f32)> {
    let mut splats = Vec::with_capacity(cloud.points.len());
    for (number, point) in cloud.points.iter().enumerate() {
        let squared = (point.position - placed_for).length_squared() as f32;
        let amplitudes = cloud.rgb.as_ref().map_or([point.amplitude; 3], |rgb| rgb[number]);
        let light = Vec3::from_array(amplitudes.map(|a| a * a / squared));
        if light.is_finite() && point.position.is_finite() && point.position.z < distance * (1.0 - NEAREST) {
            splats.push(Splat { position: point.position, light, past: None });
        }
    }
    let one_ray =
        |a: &Splat, b: &Splat| (seen_at(a.position, placed_for) - seen_at(b.position, placed_for)).length() < ONE_RAY;
    for ray in splats.chunk_by_mut(one_ray).filter(|ray| ray.len() > 1) {
        let Some(brightest) = (0..ray.len()).max_by(|&a, &b| {
            let light = |i: usize| ray[i].light.element_sum();
            light(a).total_cmp(&light(b))
        }) else {
            continue;
        };
        let solid = ray[brightest].position.z;
        let others = ray.iter_mut().enumerate().filter(|(number, _)| *number != brightest);
        others.for_each(|(_, other)| other.past = Some(solid.max(other.position.z)));
    }
    if splats.is_empty() {
        return Err(Error::parameter("points", "none stands before the eyes"));
    }
    let seen: Vec<[f32; 3]> = splats.iter().map(|s| s.light.to_array()).collect();
    let white = settings.white.unwrap_or_else(|| white_level(&seen));
    splats.iter_mut().for_each(|s| s.light = settings.shown(s.light, white));
    Ok((splats, white))
}

/// Where a point is seen from an eye on the panel's plane [m].
fn seen_at(position: DVec3, eye: DVec3) -> DVec2 {
    eye.truncate() + (position - eye).truncate() * (eye.z / (eye.z - position.z))
}

/// Distance of neighbouring points as an eye sees them [m]: of the area per point where the middle one of the points stands.
fn spacing(splats: &[Splat], eye: DVec3) -> f64 {
    let surfaces = splats.iter().filter(|s| s.past.is_none());
    let seen: Vec<DVec2> = surfaces.map(|s| seen_at(s.position, eye)).collect();
    let low = seen.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let size = seen.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max) - low;
    let mut side = (size.x * size.y * BIN / seen.len() as f64).sqrt();
    // A cloud that fills a part of its box is denser than that: the bins are made smaller once.
    for _ in 0..2 {
        if side.is_nan() || side <= 0.0 {
            return 0.0;
        }
        let columns = (size.x / side) as u64 + 1;
        let mut bins: Vec<u64> = seen
            .iter()
            .map(|q| {
                let at = (*q - low) / side;
                at.y as u64 * columns + at.x as u64
            })
            .collect();
        bins.sort_unstable();
        let mut counts: Vec<usize> = bins.chunk_by(|a, b| a == b).flat_map(|bin| vec![bin.len(); bin.len()]).collect();
        let (_, median, _) = counts.select_nth_unstable(seen.len() / 2);
        side *= (BIN / *median as f64).sqrt();
    }
    side / BIN.sqrt()
}

/// What is the same for all views.
struct Painter<'a> {
    splats: &'a [Splat],
    window: Grid,
    /// Half width and half height of a point's square [m].
    half: [f64; 2],
    /// Difference of depth within a surface [m].
    same: f64,
}

impl Painter<'_> {
    /// Calls `on` with the pixels whose middle a point covers, and how far from its middle each is, 0 … 1 along x and y.
    fn covered(&self, splat: &Splat, eye: DVec3, mut on: impl FnMut(usize, [f64; 2])) {
        let q = seen_at(splat.position, eye);
        let (column, row) = (self.window.column(q.x), self.window.row(q.y));
        let [x, y] = [self.half[0] / self.window.pitch_x, self.half[1] / self.window.pitch_y];
        let range = |middle: f64, half: f64, count: usize| {
            (middle - half).ceil().max(0.0) as usize..((middle + half).floor() + 1.0).clamp(0.0, count as f64) as usize
        };
        for r in range(row, y, self.window.height) {
            for c in range(column, x, self.window.width) {
                on(r * self.window.width + c, [(c as f64 - column).abs() / x, (r as f64 - row).abs() / y]);
            }
        }
    }

    /// Depth z of the nearest point in each pixel; −∞ where there is none.
    fn hide(&self, eye: DVec3, nearest: &mut Vec<f32>) {
        nearest.clear();
        nearest.resize(self.window.len(), f32::NEG_INFINITY);
        for splat in self.splats.iter().filter(|s| s.past.is_none()) {
            let z = splat.position.z as f32;
            self.covered(splat, eye, |pixel, _| nearest[pixel] = nearest[pixel].max(z));
        }
    }

    fn draw(&self, eye: DVec3, canvas: &mut Canvas, progress: &Progress) {
        self.hide(eye, &mut canvas.nearest);
        canvas.sums.clear();
        canvas.sums.resize(self.window.len(), Vec3::ZERO);
        canvas.weights.clear();
        canvas.weights.resize(self.window.len(), 0.0);
        for splats in self.splats.chunks(1 << 16) {
            if progress.stopped() {
                return;
            }
            for splat in splats {
                let behind = (splat.past.unwrap_or(splat.position.z) + self.same) as f32;
                self.covered(splat, eye, |pixel, [x, y]| {
                    if behind >= canvas.nearest[pixel] {
                        // The least keeps the weight of a point at the border of its square.
                        let weight = ((1.0 - x) * (1.0 - y)).max(1e-6) as f32;
                        canvas.sums[pixel] += splat.light * weight;
                        if splat.past.is_none() {
                            canvas.weights[pixel] += weight;
                        }
                    }
                });
            }
            progress.advance(splats.len() as u64);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::PointSource;

    const EYE: DVec3 = DVec3::new(0.0, 0.0, 0.6);

    /// A card of `side`² points with a radiance, seen from `EYE` between two corners of the panel's plane.
    fn card(cloud: &mut PointCloud, side: usize, z: f64, [low, high]: [DVec2; 2], radiance: f32) {
        for i in 0..side * side {
            let part = DVec2::new((i % side) as f64 + 0.5, (i / side) as f64 + 0.5) / side as f64;
            let q = low + (high - low) * part;
            let position = (q * ((EYE.z - z) / EYE.z)).extend(z);
            let amplitude = (f64::from(radiance).sqrt() * (position - EYE).length()) as f32;
            cloud.points.push(PointSource { position, amplitude, phase: 0.0 });
        }
    }

    fn two_cards() -> PointCloud {
        let mut cloud = PointCloud::default();
        let wide = DVec2::new(6e-3, 4e-3);
        card(&mut cloud, 190, -0.15, [-wide, wide], 0.2);
        card(&mut cloud, 90, -0.05, [DVec2::splat(-1e-3), DVec2::new(2e-3, 1.5e-3)], 0.8);
        cloud
    }

    #[test]
    fn a_near_card_hides_a_far_one_without_holes_and_moves_against_it() {
        let eyes = EyeGrid { distance: 0.6, center: DVec2::ZERO, spacing: 4e-3, columns: 3, rows: 3 };
        // Pixels coarser and finer than the points.
        for count in [61usize, 201] {
            let pitch = 8e-3 / count as f64;
            let window = Grid::new(count, count / 2, pitch, pitch).expect("window");
            let settings = LightFieldSettings { white: Some(1.0), ..LightFieldSettings::default() };
            let (field, report) =
                LightField::of_cloud(&two_cards(), EYE, &settings, eyes, window, &Progress::new()).expect("field");
            assert!(report.views == 9 && field.channels.len() == 1);
            assert!((field.depth[0] + 0.05).abs() < 1e-9 && (field.depth[1] + 0.15).abs() < 1e-9);
            let mut wrong = 0;
            for (index, i) in (0..9).flat_map(|index| (0..window.len()).map(move |i| (index, i))) {
                let eye = eyes.position(index);
                let q = DVec2::new(window.x(i % count), window.y(i / count));
                let p = (eye.truncate() + (q - eye.truncate()) * (0.65 / 0.6)) * (0.6 / 0.65);
                // Edges may be off by a pixel and a point.
                let edge = pitch + 33e-6;
                let within = |grow: f64| {
                    p.cmpge(DVec2::splat(-1e-3 - grow)).all() && p.cmple(DVec2::new(2e-3, 1.5e-3) + grow).all()
                };
                let found = field.radiance(field.view(0, index)[i]);
                let expected = if within(-edge) { 0.8 } else { 0.2 };
                if within(edge) == within(-edge) && (found - expected).abs() > 0.01 {
                    wrong += 1;
                }
            }
            assert_eq!(wrong, 0, "pixels of {count} columns");
            let depths = field.middle_depths.as_ref().expect("depths");
            let at = |q: DVec2| depths[window.row(q.y) as usize * count + window.column(q.x) as usize];
            assert!(
                (at(DVec2::new(5e-4, 2e-4)) + 0.05).abs() < 1e-6 && (at(DVec2::new(-3e-3, 0.0)) + 0.15).abs() < 1e-6
            );
        }
    }

    #[test]
    fn a_faint_reflection_adds_to_what_is_seen_through_it_and_hides_nothing() {
        // A card behind glass, on each of whose rays a reflection stands before it; beside it the card alone.
        let mut cloud = PointCloud::default();
        let corners = [DVec2::new(-3e-3, -2e-3), DVec2::new(3e-3, 2e-3)];
        card(&mut cloud, 120, -0.12, corners, 0.5);
        let mut ghosts = PointCloud::default();
        card(&mut ghosts, 120, -0.05, corners, 0.25);
        let both = cloud
            .points
            .iter()
            .zip(&ghosts.points)
            .enumerate()
            .flat_map(|(i, (p, ghost))| [Some(*p), Some(*ghost).filter(|_| i % 120 < 60)].into_iter().flatten());
        let cloud = PointCloud { points: both.collect(), rgb: None };
        let eyes = EyeGrid { distance: 0.6, center: DVec2::ZERO, spacing: 2e-3, columns: 3, rows: 1 };
        let window = Grid::new(80, 50, 1e-4, 1e-4).expect("window");
        let settings = LightFieldSettings { white: Some(1.0), ..LightFieldSettings::default() };
        let (field, _) = LightField::of_cloud(&cloud, EYE, &settings, eyes, window, &Progress::new()).expect("field");
        for (index, column) in (0..3).flat_map(|index| [(index, 20), (index, 60)]) {
            let found = field.radiance(field.view(0, index)[25 * 80 + column]);
            let expected = if column < 40 { 0.75 } else { 0.5 };
            assert!((found - expected).abs() < 0.03, "view {index}, column {column}: {found}");
        }
        assert!(field.middle_depths.is_some_and(|depths| (depths[25 * 80 + 20] + 0.12).abs() < 1e-6));
    }

    #[test]
    fn the_density_is_that_of_most_points_whatever_shape_the_cloud_has() {
        let mut cloud = PointCloud::default();
        // A card of 100 × 100 points 40 µm apart, and a few far off that widen the box.
        card(&mut cloud, 100, -0.1, [DVec2::splat(-2e-3), DVec2::splat(2e-3)], 1.0);
        for corner in [DVec2::splat(-9e-3), DVec2::splat(9e-3)] {
            card(&mut cloud, 2, -0.1, [corner, corner + 1e-4], 1.0);
        }
        let (splats, white) = splats(&cloud, EYE, &LightFieldSettings::default(), 0.6).expect("points");
        assert!((white - 1.25).abs() < 1e-5);
        let found = spacing(&splats, EYE);
        assert!((found / 40e-6 - 1.0).abs() < 0.1, "{found}");
        assert_eq!(spacing(&splats[..1], EYE), 0.0);
    }

    #[test]
    fn colours_stay_and_clouds_behind_the_eyes_are_refused() {
        let mut cloud = PointCloud::default();
        card(&mut cloud, 40, -0.1, [DVec2::splat(-1e-3), DVec2::splat(1e-3)], 1.0);
        let tint = Vec3::new(0.5, 0.25, 0.125);
        let rgb = |p: &PointSource| (tint.to_array()).map(|l| l.sqrt() * p.amplitude);
        cloud.rgb = Some(cloud.points.iter().map(rgb).collect());
        let eyes = EyeGrid { distance: 0.6, center: DVec2::ZERO, spacing: 1e-3, columns: 1, rows: 1 };
        let window = Grid::new(9, 7, 1e-4, 1e-4).expect("window");
        let settings = LightFieldSettings { white: Some(0.25), channel: None, clips: false, ..Default::default() };
        let (field, _) = LightField::of_cloud(&cloud, EYE, &settings, eyes, window, &Progress::new()).expect("field");
        assert_eq!(field.channels.len(), 3);
        for c in 0..3 {
            let found = field.radiance(field.view(c, 0)[31]);
            assert!((found / (4.0 * tint[c]) - 1.0).abs() < 1e-3, "{c}: {found}");
        }
        let behind = EyeGrid { distance: 0.01, ..eyes };
        cloud.points.iter_mut().for_each(|p| p.position.z = 0.2);
        assert!(LightField::of_cloud(&cloud, EYE, &settings, behind, window, &Progress::new()).is_err());
    }
}
