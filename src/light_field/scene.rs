//! The views of a lit scene, by rays: one for each pixel of each view.
//!
//! Diffuse light is the same for all eyes, and computed once (`illumination::irradiance_cache`); mirrors, glass and gloss are
//! followed ray by ray. Each ray goes through a place of its pixel of its own, so that the views together sample a pixel
//! evenly: the mean over a pupil has smooth edges, and a rough surface's lobe is the mean of one ray a view.

use super::codes::put;
use super::{EyeGrid, LightField, LightFieldReport, LightFieldSettings};
use crate::error::Result;
use crate::field::Grid;
use crate::illumination::IrradianceCache;
use crate::points::LitScene;
use crate::points::eye::{Footprint, Found, Looks};
use crate::points::placement::{EyeRays, Placing};
use crate::points::trace::MirrorDepth;
use crate::points::white::white_level;
use crate::progress::Progress;
use crate::random::Random;
use crate::scene::SceneBvh;
use glam::{DVec2, Vec3};
use rayon::prelude::*;
use std::time::Instant;

/// What is the same for all rays.
struct Views<'a> {
    bvh: &'a SceneBvh,
    cache: IrradianceCache<'a>,
    placing: &'a Placing,
    settings: &'a LightFieldSettings,
    window: Grid,
}

/// One view.
struct View {
    index: usize,
    rays: EyeRays,
    footprint: Footprint,
}

impl LightField {
    /// What eyes on a lattice see of a lit scene through the pixels `window` of the panel's plane.
    ///
    /// The depths of a window placement must be fixed ([`Placing::fixed_by`]), as those of
    /// [`ScenePoints`](crate::points::ScenePoints) are. Beyond the placement's window it is dark.
    ///
    /// # Errors
    /// [`Error::OutOfRange`](crate::Error::OutOfRange) for a white that is not greater than zero or eyes that are not before
    /// the panel, [`Error::Interrupted`](crate::Error::Interrupted) when asked to stop.
    pub fn of_scene(
        lit: &LitScene,
        placing: &Placing,
        settings: &LightFieldSettings,
        eyes: EyeGrid,
        window: Grid,
        progress: &Progress,
    ) -> Result<(Self, LightFieldReport)> {
        settings.check()?;
        let begin = Instant::now();
        let light = lit.illumination();
        let cache = IrradianceCache::new(light, settings.seed ^ 0xcac4e);
        let views = Views { bvh: light.bvh(), cache, placing, settings, window };
        let mut field = Self::black(eyes, window, if settings.channel.is_some() { 1 } else { 3 })?;
        let middle = views.view(&eyes, field.middle());
        let made: Vec<Option<View>> =
            (0..eyes.count()).map(|index| settings.makes(&eyes, index).then(|| views.view(&eyes, index))).collect();
        let count = made.iter().flatten().count();
        progress.start("casting views", (count * window.height) as u64);
        let (seen, depths) = views.look(&middle, progress);
        progress.check()?;
        let white = settings.white.unwrap_or_else(|| white_level(&seen));
        let cast = |(row, mut codes): (usize, Vec<&mut [u16]>)| {
            let Some(view) = made[row / window.height].as_ref().filter(|_| !progress.stopped()) else {
                return (0, 1.0);
            };
            progress.advance(1);
            let (line, rays) = views.row(view, row % window.height, white);
            (rays, put(&line, settings.channel, &mut codes))
        };
        let rows: Vec<(u64, f32)> = field.pieces(window.width).into_par_iter().enumerate().map(cast).collect();
        progress.check()?;
        let peaks: Vec<f32> = rows.iter().map(|row| row.1).collect();
        field.level(&peaks, window.width);
        field.stand_at(depths);
        let (rays, seconds) = (rows.iter().map(|row| row.0).sum::<u64>(), begin.elapsed().as_secs_f64());
        let report = LightFieldReport {
            views: count,
            rays,
            rays_per_second: rays as f64 / seconds.max(1e-9),
            cached: views.cache.vertices(),
            white,
            seconds,
        };
        Ok((field, report))
    }

    /// Takes the depths of the middle view's pixels, not a number where nothing is seen: there it is as far as anything.
    pub(super) fn stand_at(&mut self, mut depths: Vec<f32>) {
        let seen = || depths.iter().copied().filter(|z| !z.is_nan());
        let (far, near) = (seen().fold(f32::INFINITY, f32::min), seen().fold(f32::NEG_INFINITY, f32::max));
        if far <= near {
            self.depth = [near, far].map(f64::from);
            depths.iter_mut().filter(|z| z.is_nan()).for_each(|z| *z = far);
            self.middle_depths = Some(depths);
        }
    }
}

impl Views<'_> {
    fn view(&self, eyes: &EyeGrid, index: usize) -> View {
        let rays = self.placing.rays(eyes.position(index));
        // The wider of the distances to two neighbours, at the ray's start and a metre on.
        let [here, across, down] =
            [[0.0, 0.0], [self.window.pitch_x, 0.0], [0.0, self.window.pitch_y]].map(|q| rays.through(q.into()));
        let apart = |at: f64| (across.at(at) - here.at(at)).length().max((down.at(at) - here.at(at)).length());
        let start = apart(0.0);
        View { index, rays, footprint: Footprint { start, growth: (apart(1.0) - start).max(0.0) } }
    }

    fn looks(&self, view: &View, mirror_depth: MirrorDepth) -> Looks<'_, IrradianceCache<'_>> {
        let (bvh, bounces) = (self.bvh, self.settings.bounces);
        Looks { light: &self.cache, bvh, footprint: view.footprint, bounces, mirror_depth, lobe_rays: 1.0 }
    }

    /// Radiance over white's of one row of a view as it is shown, and how many rays it took.
    fn row(&self, view: &View, row: usize, white: f32) -> (Vec<Vec3>, u64) {
        let looks = self.looks(view, MirrorDepth::Path);
        let (settings, mut found, mut rays) = (self.settings, Found::default(), 0);
        let mut pixel = |column: usize| {
            let pixel = (row * self.window.width + column) as u64;
            // The rays of one pixel stand on a lattice of low discrepancy (Roberts' R₂), each pixel's shifted by chance.
            let mut shift = Random::new(settings.seed ^ 0x317e, pixel);
            let shift = [shift.uniform(), shift.uniform()];
            let mut sum = Vec3::ZERO;
            for number in 0..settings.rays {
                let number = view.index as u64 * u64::from(settings.rays) + u64::from(number);
                let aside = |k: usize, step: f64| (shift[k] + number as f64 * step).fract() - 0.5;
                let [x, y] = [aside(0, 0.754_877_666_246_692_7), aside(1, 0.569_840_290_998_053_2)];
                let at = DVec2::new(
                    self.window.x(column) + x * self.window.pitch_x,
                    self.window.y(row) + y * self.window.pitch_y,
                );
                if at.abs().cmpgt(self.placing.window).any() {
                    continue;
                }
                rays += 1;
                let mut random = Random::new(settings.seed ^ 0x1f1e1d, number * self.window.len() as u64 + pixel);
                looks.follow(view.rays.through(at), 1, &mut found, &mut random);
                sum += settings.shown(found.seen.radiance, white);
            }
            sum / settings.rays as f32
        };
        ((0..self.window.width).map(&mut pixel).collect(), rays)
    }

    /// Radiance and depth z [m] in the middle of each pixel of a view; no number of a depth where nothing is seen.
    fn look(&self, view: &View, progress: &Progress) -> (Vec<[f32; 3]>, Vec<f32>) {
        let looks = self.looks(view, MirrorDepth::Focus);
        let nothing = ([0.0; 3], f32::NAN);
        let pixel = |found: &mut Found, pixel: usize| {
            let at = DVec2::new(self.window.x(pixel % self.window.width), self.window.y(pixel / self.window.width));
            if at.abs().cmpgt(self.placing.window).any() || progress.stopped() {
                return nothing;
            }
            let ray = view.rays.through(at);
            looks.follow(ray, 1, found, &mut Random::new(self.settings.seed ^ 0xde97, pixel as u64));
            found.seen.gather();
            if found.seen.ends.is_empty() {
                return nothing;
            }
            (found.seen.radiance.to_array(), self.placing.depth_of(ray.at(found.seen.depth)) as f32)
        };
        (0..self.window.len()).into_par_iter().map_init(Found::default, pixel).unzip()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Pupil, Viewer};
    use super::*;
    use crate::illumination::IlluminationSettings;
    use crate::illumination::test_rooms::Room;
    use crate::points::{Channel, Placement, SceneSettings};
    use crate::scene::{Camera, Material, gltf};
    use glam::DVec3;

    fn lit(room: Room, camera: Camera) -> LitScene {
        let mut scene = room.scene;
        scene.cameras.push(camera);
        let loaded = gltf::Loaded { scene: scene.into(), warnings: Vec::new() };
        LitScene::new("room".as_ref(), loaded, IlluminationSettings::default().coarse(), &Progress::new()).expect("lit")
    }

    fn panel() -> Grid {
        Grid::new(1920, 1080, 8e-6, 8e-6).expect("panel")
    }

    fn window_of(placing: &Placing, width: usize, height: usize) -> Grid {
        let size = 2.0 * placing.window / DVec2::new(width as f64, height as f64);
        Grid::new(width, height, size.x, size.y).expect("window")
    }

    /// Mean column of what is bright in some rows of a view.
    fn bright(field: &LightField, index: usize, rows: std::ops::Range<usize>) -> f64 {
        let (mut sum, mut weight) = (0.0, 0.0);
        for i in rows.start * field.window.width..rows.end * field.window.width {
            let light = f64::from(field.radiance(field.view(0, index)[i]));
            sum += light * (i % field.window.width) as f64;
            weight += light;
        }
        sum / weight
    }

    #[test]
    fn a_mirror_image_shifts_as_deep_as_it_stands() {
        // A bar that glows towards the viewer, seen straight (above), and one that glows towards a mirror behind it (below),
        // seen in the mirror only: each shifts as the depth says at which it stands or seems to stand.
        let mut room = Room::default();
        let glow = room.material(Material::emitter(Vec3::ONE));
        let mirror = room.material(Material::mirror(Vec3::ONE));
        room.quad(DVec3::new(-0.1, 0.6, -2.0), DVec3::X * 0.2, DVec3::Y * 0.3, glow);
        room.quad(DVec3::new(-0.1, -0.9, -2.0), DVec3::Y * 0.3, DVec3::X * 0.2, glow);
        room.quad(DVec3::new(-4.0, -4.0, -7.0), DVec3::X * 8.0, DVec3::Y * 8.0, mirror);
        let lit = lit(room, Camera::looking_at(DVec3::ZERO, DVec3::NEG_Z, 0.8));
        let placement = Placement::Model { eye: 0.6, z: -0.13, scale: Some(0.02) };
        let mut placing = placement.prepare(lit.scene(), lit.camera(), 1.0, &panel()).expect("placing");
        // The placement's own window is the panel's: here it is larger.
        placing.window = DVec2::splat(0.1);
        let map = placing.hologram_from_world().expect("a model");
        let direct = map.transform_point3(DVec3::new(0.0, 0.75, -2.0));
        let image = map.transform_point3(DVec3::new(0.0, -0.75, -12.0));
        let eyes = EyeGrid { distance: 0.6, center: DVec2::ZERO, spacing: 4e-3, columns: 3, rows: 1 };
        let window = Grid::new(121, 101, 0.5e-3, 0.5e-3).expect("window");
        let settings = LightFieldSettings { white: Some(1.0), rays: 4, ..LightFieldSettings::default() };
        let (field, report) =
            LightField::of_scene(&lit, &placing, &settings, eyes, window, &Progress::new()).expect("field");
        assert_eq!((report.views, report.rays), (3, 3 * 4 * 121 * 101));
        let row = |p: DVec3| window.row(p.y * 0.6 / (0.6 - p.z)).round() as usize;
        for p in [direct, image] {
            let rows = row(p) - 2..row(p) + 3;
            for index in 0..3 {
                let eye = eyes.position(index);
                let expected = eye.x + (p.x - eye.x) * 0.6 / (0.6 - p.z);
                let found = window.x(0) + bright(&field, index, rows.clone()) * window.pitch_x;
                assert!((found - expected).abs() < 0.2 * window.pitch_x, "{p} view {index}: {found} is not {expected}");
            }
        }
        let depths = field.middle_depths.as_ref().expect("depths");
        for p in [direct, image] {
            let z = depths[row(p) * 121 + 60];
            assert!((f64::from(z) - p.z).abs() < 1e-5, "{z} is not {}", p.z);
        }
    }

    /// Cornell's room: its light, and a placing in a window whose depths are fixed.
    fn cornell(settings: &SceneSettings) -> (LitScene, Placing, f32) {
        let progress = Progress::new();
        let lit = LitScene::load("scenes/cornell.gltf".as_ref(), settings, &progress).expect("scene");
        let points = lit.points(lit.camera(), settings, &panel(), 532e-9, &progress).expect("points");
        (lit, points.view.placing, points.white.white)
    }

    #[test]
    fn views_show_what_rays_that_are_lit_one_by_one_do() {
        let mut settings =
            SceneSettings { illumination: IlluminationSettings::default().coarse(), ..Default::default() };
        (settings.trace.width, settings.trace.height) = (50, 50);
        let (lit, placing, white) = cornell(&settings);
        let eyes = EyeGrid { distance: 0.6, center: DVec2::new(0.0, 1e-3), spacing: 3e-3, columns: 2, rows: 1 };
        let window = window_of(&placing, 70, 66);
        let (rays, progress) = (16, Progress::new());
        let views = LightFieldSettings { white: Some(white), channel: None, rays, ..LightFieldSettings::default() };
        let (field, report) = LightField::of_scene(&lit, &placing, &views, eyes, window, &progress).expect("field");
        assert!(report.rays == 2 * 16 * 70 * 66 && report.cached > 4000 && field.peak == 1.0, "{report:?}");
        // The same rays, each lit for itself.
        let footprint = Footprint { start: 0.0, growth: 0.0 };
        let (bvh, mirror_depth) = (lit.illumination().bvh(), MirrorDepth::Path);
        let light = lit.illumination();
        let looks = Looks { light, bvh, footprint, bounces: 32, mirror_depth, lobe_rays: 16.0 };
        let (mut difference, mut bias, mut count) = (0.0, Vec3::ZERO, 0.0);
        let mut found = Found::default();
        for index in 0..2 {
            let sight = placing.rays(eyes.position(index));
            for i in (0..window.len()).step_by(7) {
                let mut random = Random::new(5, (index * window.len() + i) as u64);
                let mut sum = Vec3::ZERO;
                for cell in 0..16 {
                    let x = (f64::from(cell % 4) + random.uniform()) / 4.0 - 0.5;
                    let y = (f64::from(cell / 4) + random.uniform()) / 4.0 - 0.5;
                    let at = DVec2::new(window.x(i % 70) + x * window.pitch_x, window.y(i / 70) + y * window.pitch_y);
                    looks.follow(sight.through(at), 16, &mut found, &mut random);
                    sum += views.shown(found.seen.radiance, white);
                }
                let seen = |c: usize| field.radiance(field.view(c, index)[i]);
                let off = Vec3::new(seen(0), seen(1), seen(2)) - sum / 16.0;
                difference += off.abs().element_sum() / 3.0;
                bias += off;
                count += 1.0;
            }
        }
        let (mean, bias) = (difference / count, bias.abs().max_element() / count);
        assert!(mean < 0.02 && bias < 0.004, "mean difference {mean}, bias {bias} of white");
    }

    #[test]
    fn the_same_bits_for_any_number_of_threads_and_black_views_for_nobody() {
        let mut settings =
            SceneSettings { illumination: IlluminationSettings::default().coarse(), ..Default::default() };
        (settings.trace.width, settings.trace.height) = (40, 40);
        let (lit, placing, _) = cornell(&settings);
        let viewer = Viewer { pupil: Pupil::Diameter(4e-3), ..Viewer::at(DVec3::new(0.0, 0.0, 0.6)) };
        let eyes = EyeGrid::covering(&viewer, 1e-3).expect("eyes");
        let window = window_of(&placing, 31, 40);
        let views = LightFieldSettings { viewer: Some(viewer), ..LightFieldSettings::default() };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
            pool.install(|| {
                LightField::of_scene(&lit, &placing, &views, eyes, window, &Progress::new()).expect("field")
            })
        };
        let ((one, report), (three, _)) = (run(1), run(3));
        assert!(one == three && report.white > 0.0);
        assert_eq!(report.views, 21);
        assert!(one.view(0, 0).iter().all(|code| *code == 0) && one.view(0, 12).iter().any(|code| *code > 0));
        // Luminance is that of the three colours.
        let colours = LightFieldSettings { channel: None, white: Some(report.white), ..views };
        let (rgb, _) = LightField::of_scene(&lit, &placing, &colours, eyes, window, &Progress::new()).expect("field");
        for i in 0..window.len() {
            let [r, g, b] = [0, 1, 2].map(|c| rgb.radiance(rgb.view(c, 12)[i]));
            assert!((one.radiance(one.view(0, 12)[i]) - Channel::Luminance.of([r, g, b])).abs() < 1e-4);
        }
        let stopped = Progress::new();
        stopped.stop();
        assert!(LightField::of_scene(&lit, &placing, &views, eyes, window, &stopped).is_err());
        for wrong in [0.0, f32::NAN] {
            let wrong = LightFieldSettings { white: Some(wrong), ..views };
            assert!(LightField::of_scene(&lit, &placing, &wrong, eyes, window, &Progress::new()).is_err());
        }
    }
}
