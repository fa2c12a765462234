//! Views on a hologram plane, as of a holographic stereogram: each segment sends every view's own pixel to that view's place.
//!
//! A segment (hogel) of side h lights, at the distance D of the views, about λD/h about each place that it sends light to. Where the
//! views stand farther apart, light goes to several places in each view's zone, so that an eye between them sees the nearer view and
//! never a gap; where they stand closer, zones run into each other as far as h lets them. Views in one row are seen over a height:
//! the hologram then has parallax from left to right only.
//!
//! Waves of different segments and places have independent phases: what a segment shows is as matte as paper. Its wave towards a view
//! of radiance L at E is √L·D/|x−E|·exp(∓ik|x−E|), a point before (or behind) the plane like any other.

use super::plane::{PointPhase, Segments};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::light_field::LightField;
use crate::points::{Channel, PointSource};
use crate::random::Random;
use glam::{DVec2, DVec3};

/// Most places that one segment sends light to.
const MOST_PLACES: usize = 1 << 20;

/// Height of what views in one row are seen over, as a part of their distance, where none is asked.
const HEIGHT: f64 = 0.1;

/// Views before a plane, one pixel of each for each segment.
pub struct PlacedViews {
    light: LightField,
    /// Places in the zone of one view, across and down.
    parts: [usize; 2],
    /// Zone of one view [m].
    zone: DVec2,
}

/// The lattice of a plane's segments: a pixel for each.
///
/// # Errors
/// As [`Grid::new`].
pub(crate) fn lattice(plane: &Segments) -> Result<Grid> {
    let [wide, tall] = plane.size;
    let count = |pixels: usize, side: u64| pixels.div_ceil(side as usize);
    let (columns, rows) = (count(plane.grid.width, wide), count(plane.grid.height, tall));
    let side = plane.size.map(|side| side as f64);
    let ([left, top], [right, bottom]) = (plane.center([0, 0]), plane.center([columns as i64 - 1, rows as i64 - 1]));
    let grid = Grid::new(columns, rows, side[0] * plane.grid.pitch_x, side[1] * plane.grid.pitch_y)?;
    Ok(grid.centered_at([0.5 * (left + right), 0.5 * (top + bottom)]))
}

impl PlacedViews {
    /// Views whose window has a pixel for each of a plane's segments; those of one row are seen over `height` [m], by default a tenth of their distance.
    ///
    /// # Errors
    /// [`Error::Parameter`] for views that are dark or stand in no place, for a plane with a slit, and where a segment would send light to
    /// more places than make sense; [`Error::OutOfRange`] for a height that is not positive.
    pub fn new(light: LightField, plane: &Segments, height: Option<f64>) -> Result<Self> {
        if plane.slit.is_some() {
            let what = "shows what stands before it through a slit; views are for a plate without one";
            return Err(Error::parameter("plate", what));
        }
        if light.is_dark() {
            return Err(Error::parameter("views", "are dark: there is nothing to print"));
        }
        let eyes = light.eyes;
        let mut zone = DVec2::splat(eyes.spacing);
        if eyes.rows == 1 {
            zone.y = height.unwrap_or(HEIGHT * eyes.distance);
            crate::field::grid::positive("view height", zone.y)?;
        } else if height.is_some() {
            return Err(Error::parameter("view height", "is for views in one row: these stand in several"));
        }
        let side = DVec2::new(plane.size[0] as f64 * plane.grid.pitch_x, plane.size[1] as f64 * plane.grid.pitch_y);
        let lit = plane.wavelength * eyes.distance / side;
        let parts = (zone / lit).ceil().max(DVec2::ONE);
        if eyes.count() as f64 * parts.x * parts.y > MOST_PLACES as f64 {
            let what = format!(
                "{} views of {:.3} × {:.3} mm each are {:.0} places for a segment of {:.3} mm: give fewer views or smaller segments",
                eyes.count(),
                zone.x * 1e3,
                zone.y * 1e3,
                eyes.count() as f64 * parts.x * parts.y,
                side.x * 1e3
            );
            return Err(Error::parameter("views", what));
        }
        Ok(Self { light, parts: [parts.x as usize, parts.y as usize], zone })
    }

    /// Width and height from which each view is seen [m].
    pub fn zone(&self) -> [f64; 2] {
        self.zone.to_array()
    }

    /// Half width and half height of the box from which views are seen, about its middle [m]; and the box's distance.
    pub fn eye_box(&self) -> ([f64; 2], [f64; 2], f64) {
        let eyes = &self.light.eyes;
        let half = 0.5 * DVec2::new(eyes.columns as f64, eyes.rows as f64) * self.zone;
        (eyes.center.to_array(), half.to_array(), eyes.distance)
    }

    /// Lowest and highest z of what the views show [m].
    pub(super) fn depths(&self) -> [f64; 2] {
        let [a, b] = self.light.depth;
        [a.min(b), a.max(b)]
    }

    fn radiance(&self, index: usize, pixel: usize) -> f32 {
        let of = |channel: usize| self.light.radiance(self.light.view(channel, index)[pixel]);
        match self.light.channels.len() {
            3 => Channel::Luminance.of([of(0), of(1), of(2)]),
            _ => of(0),
        }
    }

    /// The pixel of a segment.
    fn pixel(&self, segment: [i64; 2]) -> usize {
        let window = &self.light.window;
        let within = |at: i64, count: usize| at.clamp(0, count as i64 - 1) as usize;
        within(segment[1], window.height) * window.width + within(segment[0], window.width)
    }

    /// The places that a segment sends light to, as points.
    pub(super) fn points(&self, plane: &Segments, segment: [i64; 2]) -> Vec<PointSource> {
        let (eyes, pixel) = (&self.light.eyes, self.pixel(segment));
        let [across, down] = self.parts;
        let step = self.zone / DVec2::new(across as f64, down as f64);
        let stream = (segment[1] as u64) << 42 ^ (segment[0] as u64) << 21;
        let mut points = Vec::with_capacity(eyes.count() * across * down);
        for index in 0..eyes.count() {
            let radiance = self.radiance(index, pixel);
            if radiance <= 0.0 {
                continue;
            }
            let amplitude = radiance.sqrt() * eyes.distance as f32;
            for part in 0..across * down {
                let at =
                    DVec2::new((part % across) as f64 + 0.5, (part / across) as f64 + 0.5) * step - 0.5 * self.zone;
                let place = (index * across * down + part) as u64;
                let phase = match plane.view.phase {
                    PointPhase::Random => Random::new(plane.seed, stream ^ place).phase(),
                    PointPhase::Path => Random::new(plane.seed, place).phase(),
                };
                let position = eyes.position(index) + DVec3::new(at.x, -at.y, 0.0);
                points.push(PointSource { position, amplitude, phase });
            }
        }
        points
    }

    /// Radiance that an eye at `eye` sees along the ray to a place behind or before the plane, both in the hologram frame [m]: that of the
    /// view in whose zone it stands; none beside the plane or the box.
    pub(crate) fn seen(&self, eye: DVec3, place: DVec3) -> f32 {
        let (eyes, window) = (&self.light.eyes, &self.light.window);
        let along = place - eye;
        if along.z == 0.0 || eye.z <= 0.0 {
            return 0.0;
        }
        let on_plane = eye - along * (eye.z / along.z);
        let nearest = |at: f64, count: usize| {
            let at = at.round();
            (at >= 0.0 && at < count as f64).then_some(at as usize)
        };
        let (Some(column), Some(row)) =
            (nearest(window.column(on_plane.x), window.width), nearest(window.row(on_plane.y), window.height))
        else {
            return 0.0;
        };
        // Where the ray passes the views' plane.
        let there = (on_plane + (eye - on_plane) * (eyes.distance / eye.z)).truncate() - eyes.center;
        let (across, up) = (there.x / self.zone.x, there.y / self.zone.y);
        let (Some(x), Some(y)) = (
            nearest(across + 0.5 * (eyes.columns as f64 - 1.0), eyes.columns),
            nearest(0.5 * (eyes.rows as f64 - 1.0) - up, eyes.rows),
        ) else {
            return 0.0;
        };
        self.radiance(y * eyes.columns + x, row * window.width + column)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Complex64;
    use crate::light_field::EyeGrid;
    use crate::progress::Progress;
    use crate::segments::{Object, ObjectWave};
    use std::f64::consts::TAU;

    /// Views in a row (or two) before a plane of 4 × 3 segments, every pixel of each of its own radiance.
    fn views(rows: usize, spacing: f64) -> (PlacedViews, Segments) {
        let grid = Grid::new(200, 150, 2e-6, 2e-6).expect("grid");
        let plane = Segments::of_panel(grid, 633e-9, 50).expect("plane");
        let window = lattice(&plane).expect("lattice");
        assert_eq!((window.width, window.height), (4, 3));
        let eyes = EyeGrid { distance: 0.05, center: DVec2::new(1e-3, 0.0), spacing, columns: 3, rows };
        let mut light = LightField::black(eyes, window, 1).expect("views");
        for (i, code) in light.channels[0].iter_mut().enumerate() {
            *code = LightField::code(0.02 + 0.9 * ((i * 37) % 60) as f32 / 60.0, 1.0);
        }
        light.depth = [-1e-3, -5e-3];
        (PlacedViews::new(light, &plane, None).expect("placed"), plane)
    }

    #[test]
    fn a_segment_sends_every_view_its_own_pixel() {
        let (placed, plane) = views(2, 0.9e-3);
        // λD/h = 0.317 mm: three places in a zone of 0.9 mm each way.
        assert_eq!(placed.parts, [3, 3]);
        assert_eq!(placed.depths(), [-5e-3, -1e-3]);
        let wave = ObjectWave::new(plane.clone(), Object::Views(Box::new(placed)));
        let field = wave.whole(&Progress::new()).expect("field").field;
        let Object::Views(placed) = &wave.object else { unreachable!("views") };
        let k = TAU / plane.wavelength;
        for segment in [[0, 0], [3, 1], [1, 2]] {
            // What of the segment's own light arrives about each view, by the direct sum of its pixels' waves, over a lattice of
            // places in the zone's middle third; against the radiance of the view's pixel, up to one factor.
            let [x0, y0] = [segment[0] as usize * 50, segment[1] as usize * 50];
            let arrives = |at: DVec3| -> f64 {
                let wave = |i: usize| {
                    let (column, row) = (x0 + i % 50, y0 + i / 50);
                    let u = field.samples[row * 200 + column];
                    let r = (DVec3::new(plane.grid.x(column), plane.grid.y(row), 0.0) - at).length();
                    Complex64::new(f64::from(u.re), f64::from(u.im)) * Complex64::cis(k * r) / r
                };
                (0..2500).map(wave).sum::<Complex64>().norm_sqr()
            };
            let eyes = placed.light.eyes;
            let mut ratios = Vec::new();
            for index in 0..eyes.count() {
                let places = (0..81).map(|i| {
                    let at = DVec3::new((i % 9) as f64 - 4.0, (i / 9) as f64 - 4.0, 0.0) * (0.8e-3 / 9.0);
                    arrives(eyes.position(index) + at)
                });
                let mean = places.sum::<f64>() / 81.0;
                ratios.push(mean / f64::from(placed.radiance(index, placed.pixel(segment))));
            }
            let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
            // Nine grains of speckle a zone, and some of the neighbours' light.
            let spread = ratios.iter().map(|r| (r / mean - 1.0).powi(2)).sum::<f64>() / ratios.len() as f64;
            assert!(spread.sqrt() < 0.5, "{segment:?}: {ratios:?}");
        }
    }

    #[test]
    fn an_eye_sees_the_view_in_whose_zone_it_stands() {
        let (placed, plane) = views(1, 0.9e-3);
        // A row is seen over a tenth of the distance, 5 mm.
        let [across, down] = placed.zone();
        assert!(across == 0.9e-3 && (down - 5e-3).abs() < 1e-12);
        let ([x, _], [half, tall], distance) = placed.eye_box();
        assert!((x - 1e-3).abs() < 1e-12 && (half - 1.35e-3).abs() < 1e-12 && (tall - 2.5e-3).abs() < 1e-12);
        for (dx, dy, view) in
            [(-0.9e-3, 0.0, Some(0)), (0.3e-3, 2.4e-3, Some(1)), (1.3e-3, -2.4e-3, Some(2)), (1.4e-3, 0.0, None)]
        {
            let eye = DVec3::new(x + dx, dy, distance);
            for segment in [[0, 0], [2, 1], [3, 2]] {
                let [sx, sy] = plane.center(segment);
                // Along the ray that passes the segment's middle, wherever its end stands.
                for z in [-2e-3, 0.0, 1e-3] {
                    let place = eye + (DVec3::new(sx, sy, 0.0) - eye) * ((eye.z - z) / eye.z);
                    let expected = view.map_or(0.0, |view| placed.radiance(view, placed.pixel(segment)));
                    assert_eq!(placed.seen(eye, place), expected, "{dx} {dy} {segment:?}");
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_printed_is_refused() {
        let (placed, plane) = views(1, 0.9e-3);
        let light = || placed.light.clone();
        let dark = LightField::black(light().eyes, light().window, 1).expect("dark");
        let mut many = light();
        many.eyes.spacing = 10.0;
        let two = views(2, 0.9e-3).0.light;
        for (light, height, word) in [
            (dark, None, "dark"),
            (many, None, "fewer views"),
            (light(), Some(0.0), "height"),
            (two, Some(1e-3), "one row"),
        ] {
            let refused = PlacedViews::new(light, &plane, height).err().expect(word).to_string();
            assert!(refused.contains(word) && !refused.contains('\n'), "{word}: {refused}");
        }
    }
}
