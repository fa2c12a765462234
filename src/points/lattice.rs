//! Flat pictures at depths, and pictures with a depth map, as points on a lattice of directions from the viewer's eye.
//!
//! A picture fills the largest window of its shape on the plane, seen from the eye; at a depth it is as much larger as the
//! window's pyramid is there. Its points are as far apart as the eye separates, whatever its own pixels are: each has the mean
//! radiance of what it covers, in linear light. What is nearer hides what is farther, as the viewer's eye sees it.

use super::images::{PictureWindow, RgbDepth};
use super::{Placement, PointCloud, PointSource, luminance};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::files::pictures;
use crate::scene::texture::linear_from_srgb;
use glam::{DVec2, DVec3};
use std::path::Path;

/// Most points of one picture.
const MOST: f64 = 16e6;

/// A picture in linear light.
struct Linear {
    size: [usize; 2],
    /// Radiance times opacity, and opacity.
    pixels: Vec<[f32; 4]>,
    /// Whether the picture says itself what is clear; of others what is black is.
    has_opacity: bool,
}

/// A picture on a lattice.
struct Cells {
    size: [usize; 2],
    cells: Vec<[f32; 4]>,
    has_opacity: bool,
}

/// Pictures that stand before or behind a plane.
pub enum Pictures {
    /// Flat pictures and their depths z [m], nearest first.
    Flat(Vec<(FlatPicture, f64)>),
    /// A picture with a depth for each pixel.
    Relief(Box<RgbDepth>),
}

/// A flat picture; what is clear in it, or black where it says nothing of that, hides nothing.
pub struct FlatPicture(Linear);

impl FlatPicture {
    /// Reads a picture (sRGB-coded, 8 or 16 bit).
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for a file that is no picture, or a picture without light.
    pub fn read(path: &Path) -> Result<Self> {
        let picture = pictures::open(path)?;
        let has_opacity = picture.color().has_alpha();
        let picture = picture.into_rgba16();
        let size = [picture.width() as usize, picture.height() as usize];
        let linear = |pixel: &image::Rgba<u16>| {
            let [r, g, b, a] = pixel.0.map(|code| f32::from(code) / 65535.0);
            let [r, g, b] = [r, g, b].map(|code| a * linear_from_srgb(code));
            [r, g, b, a]
        };
        let pixels: Vec<[f32; 4]> = picture.pixels().map(linear).collect();
        if pixels.iter().all(|[r, g, b, _]| *r <= 0.0 && *g <= 0.0 && *b <= 0.0) {
            return Err(Error::input(path, "is black or clear all over, so nothing of it would be seen"));
        }
        Ok(Self(Linear { size, pixels, has_opacity }))
    }
}

impl Linear {
    /// Means over `size` equal cells.
    fn on(&self, size: [usize; 2]) -> Cells {
        let [width, height] = self.size;
        let spans = |count: usize, cells: usize| -> Vec<Vec<(usize, f32)>> {
            let side = count as f64 / cells as f64;
            (0..cells)
                .map(|cell| {
                    let (from, to) = (cell as f64 * side, (cell + 1) as f64 * side);
                    let last = (to.ceil() as usize).min(count);
                    let share = |i: usize| (to.min((i + 1) as f64) - from.max(i as f64)) / side;
                    (from as usize..last).map(|i| (i, share(i) as f32)).filter(|(_, share)| *share > 0.0).collect()
                })
                .collect()
        };
        let (columns, rows) = (spans(width, size[0]), spans(height, size[1]));
        let mut cells = vec![[0.0f32; 4]; size[0] * size[1]];
        let mut line = vec![[0.0f32; 4]; width];
        for (cells, rows) in cells.chunks_exact_mut(size[0]).zip(&rows) {
            line.fill([0.0; 4]);
            for &(row, share) in rows {
                for (sum, pixel) in line.iter_mut().zip(&self.pixels[row * width..]) {
                    sum.iter_mut().zip(pixel).for_each(|(sum, v)| *sum += share * v);
                }
            }
            for (cell, columns) in cells.iter_mut().zip(&columns) {
                for &(column, share) in columns {
                    cell.iter_mut().zip(&line[column]).for_each(|(sum, v)| *sum += share * v);
                }
            }
        }
        Cells { size, cells, has_opacity: self.has_opacity }
    }
}

impl Cells {
    /// Whether something stands at a place of the window, −1 … 1 to the right and up.
    fn covers(&self, place: DVec2) -> bool {
        let at = |part: f64, cells: usize| ((0.5 + 0.5 * part) * cells as f64).floor();
        let (column, row) = (at(place.x, self.size[0]), at(-place.y, self.size[1]));
        if !(0.0..self.size[0] as f64).contains(&column) || !(0.0..self.size[1] as f64).contains(&row) {
            return false;
        }
        let [r, g, b, opacity] = self.cells[row as usize * self.size[0] + column as usize];
        if self.has_opacity { opacity > 0.5 } else { r > 0.0 || g > 0.0 || b > 0.0 }
    }
}

/// Points of pictures, and how large the cells are that each stands for.
pub struct LatticePoints {
    /// The points; all phases are zero.
    pub cloud: PointCloud,
    /// Half width and half height of each point's cell at its depth [m].
    pub half: Vec<[f32; 2]>,
}

impl Pictures {
    /// Points as close as an eye at the distance `viewer` [m] separates by an angle `resolution` [rad], for a plane `panel`.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a depth at or beyond the eye; [`Error::Parameter`] for a picture that is black wherever it has
    /// a depth, or of too many points.
    pub fn points(&self, viewer: f64, resolution: f64, panel: &Grid) -> Result<LatticePoints> {
        let mut found =
            LatticePoints { cloud: PointCloud { points: Vec::new(), rgb: Some(Vec::new()) }, half: Vec::new() };
        let eye = DVec3::new(0.0, 0.0, viewer);
        let mut add = |place: DVec2, z: f64, half: DVec2, rgb: [f32; 3]| {
            if z >= viewer {
                return Err(Error::out_of_range(
                    "depth",
                    format!("{z} m"),
                    format!("must lie before the eye at {viewer} m"),
                ));
            }
            let spread = (viewer - z) / viewer;
            let position = (place * spread).extend(z);
            let amplitude = |l: f32| (f64::from(l.max(0.0)).sqrt() * (eye - position).length()) as f32;
            let rgb_amplitudes = rgb.map(amplitude);
            found.cloud.points.push(PointSource { position, amplitude: amplitude(luminance(rgb)), phase: 0.0 });
            found.cloud.rgb.get_or_insert_default().push(rgb_amplitudes);
            found.half.push((half * spread).as_vec2().to_array());
            Ok(())
        };
        // As many cells as directions that the eye separates.
        let lattice = |size: [u32; 2]| -> Result<(PictureWindow, [usize; 2])> {
            let window = PictureWindow::new(&Placement::Window { eye: viewer, near: 0.0, far: 0.0 }, size, panel)?;
            let cells = window.half.map(|half| (2.0 * half / (viewer * resolution.tan())).round().max(1.0));
            if cells[0] * cells[1] > MOST {
                let what = format!("{}×{} points are more than {MOST:.0e}; raise scene.resolution", cells[0], cells[1]);
                return Err(Error::parameter("picture", what));
            }
            Ok((window, cells.map(|count| count as usize)))
        };
        let at = |[columns, rows]: [usize; 2], index: usize| {
            let (column, row) = (index % columns, index / columns);
            DVec2::new((column as f64 + 0.5) / columns as f64 * 2.0 - 1.0, 1.0 - (row as f64 + 0.5) / rows as f64 * 2.0)
        };
        match self {
            Self::Flat(flat) => {
                let mut nearer: Vec<(DVec2, Cells)> = Vec::new();
                for (FlatPicture(picture), z) in flat {
                    let (window, size) = lattice(picture.size.map(|side| side as u32))?;
                    let (half, cells) = (DVec2::from_array(window.half), picture.on(size));
                    let cell = half / DVec2::new(size[0] as f64, size[1] as f64);
                    for (index, &[r, g, b, _]) in cells.cells.iter().enumerate() {
                        let place = at(size, index) * half;
                        let hidden = nearer.iter().any(|(half, cells)| cells.covers(place / *half));
                        if !hidden && [r, g, b].iter().any(|v| *v > 0.0) {
                            add(place, *z, cell, [r, g, b])?;
                        }
                    }
                    nearer.push((half, cells));
                }
            }
            Self::Relief(relief) => {
                let (window, size) = lattice(relief.size())?;
                let half = DVec2::from_array(window.half);
                let cell = half / DVec2::new(size[0] as f64, size[1] as f64);
                let linear = |pixel: &image::Rgb<u16>| {
                    let [r, g, b] = pixel.0.map(|code| linear_from_srgb(f32::from(code) / 65535.0));
                    [r, g, b, 1.0]
                };
                let pixels: Vec<[f32; 4]> = relief.picture.pixels().map(linear).collect();
                let picture = Linear { size: relief.size().map(|side| side as usize), pixels, has_opacity: false };
                for (index, &[r, g, b, _]) in picture.on(size).cells.iter().enumerate() {
                    // A depth is that of one pixel: means over an edge would stand where nothing is.
                    let [column, row] = [(index % size[0], size[0], 0), (index / size[0], size[1], 1)]
                        .map(|(i, n, axis)| ((i as f64 + 0.5) / n as f64 * f64::from(relief.size()[axis])) as u32);
                    if let Some(z) = relief.depth(column, row).filter(|_| [r, g, b].iter().any(|v| *v > 0.0)) {
                        add(at(size, index) * half, z, cell, [r, g, b])?;
                    }
                }
            }
        }
        if found.cloud.points.is_empty() {
            return Err(Error::parameter("picture", "is black wherever a depth is known, so it makes no points"));
        }
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(size: [usize; 2], pixels: Vec<[f32; 4]>, has_opacity: bool) -> FlatPicture {
        FlatPicture(Linear { size, pixels, has_opacity })
    }

    #[test]
    fn pixels_are_averaged_in_linear_light_or_repeated_and_stand_upright_on_the_windows_pyramid() {
        // A red upper left quarter; the rest black.
        let red = |i: usize| if i % 4 < 2 && i / 4 < 1 { [1.0, 0.0, 0.0, 1.0] } else { [0.0, 0.0, 0.0, 1.0] };
        let panel = Grid::new(400, 200, 10e-6, 10e-6).expect("panel");
        for z in [-20e-3, 10e-3] {
            let picture = Pictures::Flat(vec![(flat([4, 2], (0..8).map(red).collect(), false), z)]);
            // The plane is 4 × 2 mm; cells of 0.1 mm on it: 40 × 20, a quarter of them red.
            let found = picture.points(0.1, (1e-3f64).atan(), &panel).expect("points");
            assert_eq!(found.cloud.points.len(), 200);
            let spread = (0.1 - z) / 0.1;
            for (point, rgb) in found.cloud.points.iter().zip(found.cloud.rgb.iter().flatten()) {
                let DVec3 { x, y, z: depth } = point.position;
                assert!(depth == z && x < 0.0 && y > 0.0 && x > -2e-3 * spread && y < 1e-3 * spread, "{x} {y}");
                let distance = (x * x + y * y + (0.1 - z).powi(2)).sqrt();
                assert!((f64::from(rgb[0]) / distance - 1.0).abs() < 1e-5 && rgb[1] == 0.0);
            }
            assert!((f64::from(found.half[0][0]) - 50e-6 * spread).abs() < 1e-9);
        }
        // Two pixels of radiance 1 and 0 in one cell: half.
        let both = flat([2, 1], vec![[1.0; 4], [0.0, 0.0, 0.0, 1.0]], false).0.on([1, 1]);
        assert_eq!(both.cells[0][..3], [0.5; 3]);
        let thirds = flat([3, 1], vec![[0.9; 4], [0.3; 4], [0.0; 4]], false).0.on([2, 1]);
        assert!((thirds.cells[0][0] - (0.9 + 0.15) / 1.5).abs() < 1e-6 && (thirds.cells[1][0] - 0.1).abs() < 1e-6);
    }

    #[test]
    fn what_is_nearer_hides_and_what_is_clear_does_not() {
        let panel = Grid::new(100, 100, 10e-6, 10e-6).expect("panel");
        let white = || flat([1, 1], vec![[1.0; 4]], false);
        let count = |near: FlatPicture| {
            let pictures = Pictures::Flat(vec![(near, -5e-3), (white(), -10e-3)]);
            let points = pictures.points(0.1, (1e-3f64).atan(), &panel).expect("points").cloud.points;
            points.iter().filter(|p| p.position.z < -9e-3).count()
        };
        // Ten by ten cells; the near picture's left half is lit, or black and opaque, or clear.
        let halves =
            |left: [f32; 4], right: [f32; 4], has_opacity| flat([2, 2], vec![left, right, left, right], has_opacity);
        assert_eq!(count(halves([1.0; 4], [0.0, 0.0, 0.0, 1.0], false)), 50);
        assert_eq!(count(halves([1.0; 4], [0.0, 0.0, 0.0, 1.0], true)), 0);
        assert_eq!(count(halves([1.0; 4], [0.0; 4], true)), 50);
        let beyond = Pictures::Flat(vec![(white(), 0.2)]);
        assert!(beyond.points(0.1, 1e-3, &panel).is_err());
    }
}
