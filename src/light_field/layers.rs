//! Light fields of layers: flat pictures at depths, each hiding what stands behind it.
//!
//! Layers need no renderer and no file, and what an eye sees of them is known in closed form: light at a pixel q of the view from
//! e comes from the first layer, counted from the viewer, that is opaque where the line from e through q meets it. They are the
//! scene of tests and comparisons.
//!
//! ```
//! use holodrive::glam::{DVec2, DVec3};
//! use holodrive::field::Grid;
//! use holodrive::light_field::{EyeGrid, LightField, Viewer, layers};
//!
//! let viewer = Viewer::at(DVec3::new(0.0, 0.0, 0.6));
//! let window = Grid::new(96, 54, 160e-6, 160e-6)?;
//! let scene = layers::occlusion(window.extent_x(), [-0.1, -0.15]);
//! let seen = LightField::of_layers(&scene, EyeGrid::covering(&viewer, 1e-3)?, window)?;
//! assert_eq!((seen.eyes.count(), seen.pixels(), seen.depth), (25, 96 * 54, [-0.1, -0.15]));
//! # Ok::<(), holodrive::Error>(())
//! ```

use super::{EyeGrid, LightField};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::random::Random;
use glam::DVec2;
use rayon::prelude::*;

/// Something on a plane: a value at each place (x, y) [m].
pub type OnPlane<'a> = Box<dyn Fn(DVec2) -> f32 + Sync + 'a>;

/// A flat picture at a depth.
pub struct Layer<'a> {
    /// Depth z [m].
    pub z: f64,
    /// Radiance over white's at a place of the layer (x, y) [m]; brighter than 1 is taken for 1.
    pub radiance: OnPlane<'a>,
    /// How much it hides of what stands behind it, 0 … 1.
    pub opacity: OnPlane<'a>,
    /// Colour of its light, linear red, green and blue; a scene whose layers are all white is gray.
    pub tint: [f32; 3],
}

impl<'a> Layer<'a> {
    /// A white layer.
    pub fn new(
        z: f64,
        radiance: impl Fn(DVec2) -> f32 + Sync + 'a,
        opacity: impl Fn(DVec2) -> f32 + Sync + 'a,
    ) -> Self {
        Self { z, radiance: Box::new(radiance), opacity: Box::new(opacity), tint: [1.0; 3] }
    }

    /// The same layer in a colour.
    pub fn tinted(mut self, tint: [f32; 3]) -> Self {
        self.tint = tint;
        self
    }
}

/// Samples of each pixel along each axis.
const SAMPLES: usize = 2;
/// The opacity from which a layer is what stands at a pixel's depth.
const OPAQUE: f32 = 0.5;

impl LightField {
    /// What the eyes see of layers through the pixels of a window, each pixel the mean of 2 × 2 samples.
    ///
    /// # Errors
    /// [`Error::Parameter`] without layers, and for one that does not stand behind the eyes.
    pub fn of_layers(layers: &[Layer], eyes: EyeGrid, window: Grid) -> Result<Self> {
        let mut order: Vec<&Layer> = layers.iter().collect();
        order.sort_by(|a, b| b.z.total_cmp(&a.z));
        let (Some(first), Some(last)) = (order.first(), order.last()) else {
            return Err(Error::parameter("layers", "there is none"));
        };
        if let Some(layer) = order.iter().find(|layer| !(layer.z.is_finite() && layer.z < eyes.distance)) {
            let limit = format!("must be behind the eyes, below {} m", eyes.distance);
            return Err(Error::out_of_range("layer", format_args!("z = {} m", layer.z), limit));
        }
        let count = if order.iter().all(|layer| layer.tint == [1.0; 3]) { 1 } else { 3 };
        let pixels = window.len();
        let views: Vec<Vec<u16>> = (0..eyes.count())
            .into_par_iter()
            .map(|index| {
                let eye = eyes.position(index).truncate();
                let see = |i: usize| light(&order, eye, eyes.distance, &window, i);
                // Channels one after another, as they are kept.
                let seen: Vec<[f32; 3]> = (0..pixels).map(see).collect();
                (0..count).flat_map(|c| seen.iter().map(move |rgb| Self::code(rgb[c], 1.0))).collect()
            })
            .collect();
        let channel = |c: usize| views.iter().flat_map(|view| &view[c * pixels..(c + 1) * pixels]).copied().collect();
        let mut field = Self {
            eyes,
            window,
            channels: (0..count).map(channel).collect(),
            peak: 1.0,
            depth: [first.z, last.z],
            middle_depths: None,
        };
        let middle = eyes.position(field.middle()).truncate();
        let depth = |i: usize| {
            let q = DVec2::new(window.x(i % window.width), window.y(i / window.width));
            let stands = |layer: &&&Layer| (layer.opacity)(seen_at(middle, q, eyes.distance, layer.z)) >= OPAQUE;
            order.iter().find(stands).map_or(last.z, |layer| layer.z) as f32
        };
        field.middle_depths = Some((0..pixels).map(depth).collect());
        Ok(field)
    }
}

/// Where the line from an eye through a point of the panel's plane meets the plane z.
fn seen_at(eye: DVec2, q: DVec2, distance: f64, z: f64) -> DVec2 {
    eye + (q - eye) * ((distance - z) / distance)
}

/// What one eye sees in pixel `i`; layers from the nearest on.
fn light(layers: &[&Layer], eye: DVec2, distance: f64, window: &Grid, i: usize) -> [f32; 3] {
    let middle = DVec2::new(window.x(i % window.width), window.y(i / window.width));
    let offset = |k: usize| crate::field::grid::offset(k as f64, SAMPLES as f64, 1.0 / SAMPLES as f64);
    let mut sum = [0.0; 3];
    for k in 0..SAMPLES * SAMPLES {
        let aside = DVec2::new(offset(k % SAMPLES) * window.pitch_x, offset(k / SAMPLES) * window.pitch_y);
        let mut left = 1.0;
        for layer in layers {
            let at = seen_at(eye, middle + aside, distance, layer.z);
            let opacity = (layer.opacity)(at).clamp(0.0, 1.0);
            if opacity > 0.0 {
                let radiance = left * opacity * (layer.radiance)(at).clamp(0.0, 1.0);
                sum.iter_mut().zip(layer.tint).for_each(|(sum, tint)| *sum += radiance * tint);
                left *= 1.0 - opacity;
            }
            if left <= 0.0 {
                break;
            }
        }
    }
    sum.map(|v| v / (SAMPLES * SAMPLES) as f32)
}

/// A scene with all that is hard to show: a wall with smooth tones, a checkerboard and fine relief; a shaded ball before it; in
/// front a block with bars and a beam. `width` [m] is that of the panel, whose view (16 : 9) the wall fills; the block stands at
/// the nearest depth, the wall at the farthest, the ball between them at two fifths.
///
/// Seen by an eye before the panel's middle it is the scene of three layers with which `view` holograms were first simulated (there
/// at 0.7, 0.72 and 0.75 m from an eye at 0.6 m, behind a panel 15.36 mm wide).
pub fn occlusion(width: f64, [near, far]: [f64; 2]) -> Vec<Layer<'static>> {
    // Lengths of the layers are in millimetres of a panel 15.36 mm wide.
    let unit = width / 15.36;
    let relief = Relief::new(3, 4);
    let wall = move |p: DVec2| {
        let p = p / unit;
        let (x, y) = (p.x, p.y);
        let tone = if (x + 5.0).abs() < 3.3 && (y - 0.5).abs() < 3.3 {
            0.15 + 0.7 * ((x / 1.1).floor() + (y / 1.1).floor()).rem_euclid(2.0)
        } else {
            0.45 + 0.25 * y / 8.0 + 0.1 * x / 12.0
        };
        (tone + relief.at(p)).clamp(0.02, 1.0) as f32
    };
    let height = move |p: DVec2| {
        let p = p / unit - DVec2::new(1.5, -0.6);
        1.0 - p.length_squared() / (2.6 * 2.6)
    };
    let ball = move |p: DVec2| {
        let from_middle = (p / unit - DVec2::new(1.5, -0.6)) / 2.6;
        let lit = 0.7 * height(p).max(0.0).sqrt() + 0.5 * from_middle.x - 0.4 * from_middle.y;
        (0.12 + 0.85 * lit.clamp(0.0, 1.0)).min(1.0) as f32
    };
    let block = move |p: DVec2| {
        let (x, y) = (p.x / unit, p.y / unit);
        let pillar = x > 4.2 && x < 8.8 && y > -3.4 && y < 3.0;
        let beam = x > -8.5 && x < -1.5 && y > -3.6 && y < -2.2;
        if pillar || beam { 1.0 } else { 0.0 }
    };
    let bars = move |p: DVec2| {
        let (x, y) = (p.x / unit, p.y / unit);
        let light = if y > 1.0 {
            0.5 + if (x / 0.5).rem_euclid(1.0) < 0.5 { 0.35 } else { -0.35 }
        } else {
            0.75 - 0.2 * y / 4.0
        };
        light.clamp(0.03, 1.0) as f32
    };
    vec![
        Layer::new(near, bars, block),
        Layer::new(near + 0.4 * (far - near), ball, move |p| if height(p) > 0.0 { 1.0 } else { 0.0 }),
        Layer::new(far, wall, |_| 1.0),
    ]
}

/// Smooth relief: Gaussian noise blurred to standard deviations of 0.36 and 0.12 mm, of 0.05 and 0.03 high.
struct Relief {
    values: Vec<f32>,
}

impl Relief {
    const WIDTH: usize = 867;
    const HEIGHT: usize = 533;
    /// Distance of its samples [mm].
    const STEP: f64 = 0.06;

    fn new(coarse_seed: u64, fine_seed: u64) -> Self {
        let (coarse, fine) = (Self::noise(coarse_seed, 6.0, 0.05), Self::noise(fine_seed, 2.0, 0.03));
        Self { values: coarse.iter().zip(&fine).map(|(a, b)| (a + b) as f32).collect() }
    }

    /// Blurred noise of this standard deviation.
    fn noise(seed: u64, sigma: f64, height: f64) -> Vec<f64> {
        let mut random = Random::new(seed, 0);
        // The sum of a few uniform numbers is near enough to a normal one: it is blurred.
        let white: Vec<f64> =
            (0..Self::WIDTH * Self::HEIGHT).map(|_| (0..4).map(|_| random.uniform() - 0.5).sum()).collect();
        let rows = blurred_and_turned(&white, Self::WIDTH, sigma);
        let smooth = blurred_and_turned(&rows, Self::HEIGHT, sigma);
        let deviation = (smooth.iter().map(|v| v * v).sum::<f64>() / smooth.len() as f64).sqrt();
        smooth.into_iter().map(|v| v * height / deviation).collect()
    }

    /// Height at a place [mm], bilinear.
    fn at(&self, p: DVec2) -> f64 {
        let split = |at: f64, count: usize| {
            let place = (at / Self::STEP + 0.5 * (count as f64 - 1.0)).clamp(0.0, count as f64 - 1.001);
            (place as usize, place.fract())
        };
        let ((column, u), (row, v)) = (split(p.x, Self::WIDTH), split(p.y, Self::HEIGHT));
        let value = |c: usize, r: usize| f64::from(self.values[r * Self::WIDTH + c]);
        let line = |r: usize| value(column, r) * (1.0 - u) + value(column + 1, r) * u;
        line(row) * (1.0 - v) + line(row + 1) * v
    }
}

/// Rows convolved with a Gaussian, periodic, and put as columns.
fn blurred_and_turned(values: &[f64], width: usize, sigma: f64) -> Vec<f64> {
    let height = values.len() / width;
    let reach = (4.0 * sigma) as isize;
    let weights: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let mut out = vec![0.0; values.len()];
    out.par_chunks_mut(height).enumerate().for_each(|(column, out)| {
        let from: Vec<usize> =
            (-reach..=reach).map(|i| (column as isize + i).rem_euclid(width as isize) as usize).collect();
        for (row, out) in out.iter_mut().enumerate() {
            let line = &values[row * width..(row + 1) * width];
            *out = from.iter().zip(&weights).map(|(&c, w)| line[c] * w).sum();
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light_field::Viewer;
    use glam::DVec3;

    fn window() -> Grid {
        Grid::new(75, 41, 200e-6, 200e-6).expect("window")
    }

    fn eyes(at: DVec3) -> EyeGrid {
        EyeGrid::covering(&Viewer::at(at), 2e-3).expect("eyes")
    }

    /// Middle of light of a view [m].
    fn middle_of_light(field: &LightField, view: usize) -> DVec2 {
        let (mut sum, mut at) = (0.0, DVec2::ZERO);
        for (i, &code) in field.view(0, view).iter().enumerate() {
            let light = f64::from(field.radiance(code));
            let (column, row) = (i % field.window.width, i / field.window.width);
            at += light * DVec2::new(field.window.x(column), field.window.y(row));
            sum += light;
        }
        at / sum
    }

    #[test]
    fn a_spot_stands_where_the_line_from_the_eye_meets_the_panel_in_every_view() {
        let spot = DVec2::new(2.1e-3, -1.3e-3);
        let z = -0.2;
        let layer = Layer::new(z, move |p| f32::from(u8::from((p - spot).length() < 1.2e-3)), |_| 1.0);
        let at = DVec3::new(3e-3, -1e-3, 0.5);
        let field = LightField::of_layers(&[layer], eyes(at), window()).expect("field");
        for view in 0..field.eyes.count() {
            let eye = field.eyes.position(view);
            let wanted = eye.truncate() + (spot - eye.truncate()) * (eye.z / (eye.z - z));
            let found = middle_of_light(&field, view);
            // The spot's edge is cut into half pixels.
            assert!((found - wanted).length() < 30e-6, "view {view}: {found} is not {wanted}");
        }
        // The first view is the upper left one: behind the panel things go along with the eye, up and to the left.
        let (first, last) = (middle_of_light(&field, 0), middle_of_light(&field, field.eyes.count() - 1));
        assert!(first.x < last.x && first.y > last.y, "{first} {last}");
    }

    #[test]
    fn the_nearer_layer_hides_the_farther_one_whatever_their_order() {
        let layers = || {
            vec![
                Layer::new(-0.1, |_| 0.25, |_| 1.0).tinted([1.0, 0.5, 0.0]),
                Layer::new(0.02, |_| 1.0, |p| if p.x > 0.0 { 0.5 } else { 0.0 }),
            ]
        };
        let mut turned = layers();
        turned.reverse();
        let at = DVec3::new(0.0, 0.0, 0.4);
        let field = LightField::of_layers(&layers(), eyes(at), window()).expect("field");
        assert_eq!(field, LightField::of_layers(&turned, eyes(at), window()).expect("field"));
        assert_eq!((field.channels.len(), field.depth), (3, [0.02, -0.1]));
        let middle = field.middle();
        let seen = |x: usize| [0, 1, 2].map(|c| field.radiance(field.view(c, middle)[20 * 75 + x]));
        let close = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(close(seen(5), [0.25, 0.125, 0.0]), "{:?}", seen(5));
        assert!(close(seen(70), [0.625, 0.5625, 0.5]), "{:?}", seen(70));
        let depths = field.middle_depths.as_ref().expect("depths");
        assert_eq!([depths[20 * 75 + 5], depths[20 * 75 + 70]], [-0.1, 0.02]);
    }

    #[test]
    fn layers_at_or_before_the_eye_are_refused() {
        let at = DVec3::new(0.0, 0.0, 0.3);
        assert!(LightField::of_layers(&[], eyes(at), window()).is_err());
        for z in [0.3, 0.5, f64::NAN] {
            assert!(LightField::of_layers(&[Layer::new(z, |_| 1.0, |_| 1.0)], eyes(at), window()).is_err());
        }
    }

    #[test]
    fn the_scene_shows_tones_bars_and_occlusion() {
        let window = Grid::new(171, 96, 90e-6, 90e-6).expect("window");
        let at = DVec3::new(0.0, 0.0, 0.6);
        let scene = occlusion(15.36e-3, [-0.1, -0.15]);
        let field = LightField::of_layers(&scene, eyes(at), window).expect("field");
        let depths = field.middle_depths.as_ref().expect("depths");
        let share = |z: f32| depths.iter().filter(|d| **d == z).count() as f64 / depths.len() as f64;
        let (block, ball, wall) = (share(-0.1), share(-0.12), share(-0.15));
        assert!((0.15..0.35).contains(&block) && (0.08..0.2).contains(&ball) && wall > 0.4, "{block} {ball} {wall}");
        let light = |i: usize| field.radiance(field.view(0, field.middle())[i]);
        let mean = (0..window.len()).map(light).sum::<f32>() / window.len() as f32;
        assert!((0.35..0.65).contains(&mean), "{mean}");
    }
}
