//! Pictures that stay pictures: a picture with depth, or a focal stack, as planes of samples on a lattice.
//!
//! For the transforms of layers, which take light plane by plane: no points, and surfaces without gaps, since each
//! sample of a plane looks up the picture, not the other way round.

use super::colour::Lasers;
use super::images::{Picture16, PictureWindow, RgbDepth};
use super::{Channel, Placement};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::files::pictures;
use crate::scene::texture::linear_from_srgb;
use rayon::prelude::*;
use std::path::PathBuf;

/// What the light of a slice is taken from.
#[derive(Clone, Debug)]
enum SliceSource {
    /// A picture cut by its depth map.
    Depth(RgbDepth),
    /// Pictures sharp at one depth each, that fill the window there; z [m], farthest first.
    Stack(Vec<(f64, Picture16)>),
}

/// One colour of light.
#[derive(Clone, Copy, Debug)]
pub enum LightColor<'a> {
    /// A channel of linear Rec.709.
    Channel(Channel),
    /// The drive of one of three lasers.
    Laser(&'a Lasers, usize),
}

impl LightColor<'_> {
    fn of(&self, rgb: [f32; 3]) -> f32 {
        match self {
            Self::Channel(channel) => channel.of(rgb),
            Self::Laser(lasers, i) => lasers.drive(rgb).values[*i],
        }
    }
}

/// A plane of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Slice {
    /// Depth of the plane; negative behind the panel [m].
    pub z: f64,
    /// √radiance × distance from the eye, row-major on the lattice.
    pub amplitudes: Vec<f32>,
    /// Samples that a surface stands at, lit or black; of a focal stack none, since its pictures overlap.
    pub covered: Vec<bool>,
}

/// Slices of a picture or a stack, made one after another.
#[derive(Clone, Debug)]
pub struct Slices {
    source: SliceSource,
    window: PictureWindow,
    /// The lattice of all slices: the panel's pitch, wide enough for the farthest.
    pub lattice: Grid,
    depths: Vec<f64>,
}

impl Slices {
    /// A picture with its depth map, cut into at most `planes` evenly between its smallest and largest depth.
    ///
    /// # Errors
    /// [`Error::Parameter`] for no planes.
    pub fn of_depth(picture: RgbDepth, window: PictureWindow, panel: &Grid, planes: usize) -> Result<Self> {
        if planes == 0 || planes > 4096 {
            return Err(Error::out_of_range("layers", planes, "must be 1 to 4096"));
        }
        let known = picture.depths().flatten();
        let (low, high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
        let count = if high > low { planes } else { 1 };
        let step = (high - low) / count as f64;
        // Middles of equal parts: no sample is farther off than half a part.
        let depths = (0..count).map(|k| low + (k as f64 + 0.5) * step).collect();
        Self::new(SliceSource::Depth(picture), window, panel, depths)
    }

    /// A focal stack: pictures and the depth z of each [m].
    ///
    /// # Errors
    /// [`Error::Input`] for a file that is no picture, or of another size than the first; [`Error::Parameter`] for no
    /// files, a depth at or behind the eye, or a placement that has no window.
    pub fn of_stack(files: &[(PathBuf, f64)], placement: &Placement, panel: &Grid) -> Result<Self> {
        let mut stack: Vec<(f64, Picture16)> = Vec::new();
        for (path, z) in files {
            let picture = pictures::open(path)?.into_rgb16();
            if let Some((_, first)) = stack.first()
                && first.dimensions() != picture.dimensions()
            {
                let ((w, h), (fw, fh)) = (picture.dimensions(), first.dimensions());
                return Err(Error::input(
                    path,
                    format!("{w}×{h} pixels, but the first has {fw}×{fh}; they must be equal"),
                ));
            }
            stack.push((*z, picture));
        }
        let Some((_, first)) = stack.first() else {
            return Err(Error::parameter("focal stack", "has no pictures"));
        };
        let window = PictureWindow::new(placement, [first.width(), first.height()], panel)?;
        stack.sort_by(|a, b| a.0.total_cmp(&b.0));
        let depths = stack.iter().map(|(z, _)| *z).collect();
        Self::new(SliceSource::Stack(stack), window, panel, depths)
    }

    fn new(source: SliceSource, window: PictureWindow, panel: &Grid, depths: Vec<f64>) -> Result<Self> {
        if let Some(z) = depths.iter().find(|z| z.is_nan() || **z >= window.eye) {
            return Err(Error::out_of_range(
                "depth",
                format!("{z} m"),
                format!("is not in front of the eye at {} m", window.eye),
            ));
        }
        let spread = depths.iter().map(|z| window.spread(*z)).fold(0.0, f64::max);
        let size = |half: f64, pitch: f64| ((2.0 * half * spread / pitch).ceil() as usize).max(1);
        let lattice = Grid::new(
            size(window.half[0], panel.pitch_x),
            size(window.half[1], panel.pitch_y),
            panel.pitch_x,
            panel.pitch_y,
        )?;
        Ok(Self { source, window, lattice, depths })
    }

    /// Depths z of the planes, farthest first [m].
    pub fn depths(&self) -> &[f64] {
        &self.depths
    }

    /// Slice `index` in one colour of light.
    pub fn slice(&self, index: usize, light: LightColor) -> Slice {
        let z = self.depths[index];
        let lattice = self.lattice;
        let spread = self.window.spread(z);
        let mut slice = Slice { z, amplitudes: vec![0.0; lattice.len()], covered: vec![false; lattice.len()] };
        let half_step = match self.depths[..] {
            [first, second, ..] => 0.5 * (second - first),
            _ => f64::INFINITY,
        };
        let (picture, cut) = match &self.source {
            SliceSource::Depth(picture) => (&picture.picture, Some(picture)),
            SliceSource::Stack(stack) => (&stack[index].1, None),
        };
        // The picture's pixels under one sample, at least the nearest.
        let scale = [
            f64::from(picture.width()) / (2.0 * self.window.half[0] * spread),
            f64::from(picture.height()) / (2.0 * self.window.half[1] * spread),
        ];
        let range = |at: f64, axis: usize, pitch: f64, size: u32| {
            let middle = at * scale[axis] + 0.5 * f64::from(size);
            let half = 0.5 * pitch * scale[axis];
            let inside = middle >= 0.0 && middle < f64::from(size);
            let (first, last) = if half > 0.5 { (middle - half, middle + half) } else { (middle, middle) };
            inside.then(|| {
                let first = first.clamp(0.0, f64::from(size - 1)) as u32;
                first..=((last.clamp(0.0, f64::from(size - 1)) as u32).max(first))
            })
        };
        let last = index + 1 == self.depths.len();
        let rows = slice.amplitudes.par_chunks_mut(lattice.width).zip(slice.covered.par_chunks_mut(lattice.width));
        rows.enumerate().for_each(|(row, (amplitudes, covered))| {
            let y = lattice.y(row);
            let Some(lines) = range(-y, 1, lattice.pitch_y, picture.height()) else { return };
            for column in 0..lattice.width {
                let x = lattice.x(column);
                let Some(columns) = range(x, 0, lattice.pitch_x, picture.width()) else { continue };
                let (mut sum, mut taken, mut all) = ([0.0f32; 3], 0u32, 0u32);
                for line in lines.clone() {
                    for pixel in columns.clone() {
                        all += 1;
                        let here = cut.is_none_or(|cut| {
                            let Some(depth) = cut.depth(pixel, line) else { return false };
                            depth >= z - half_step && (depth < z + half_step || last)
                        });
                        if here {
                            let rgb =
                                picture.get_pixel(pixel, line).0.map(|c| linear_from_srgb(f32::from(c) / 65535.0));
                            sum = std::array::from_fn(|i| sum[i] + rgb[i]);
                            taken += 1;
                        }
                    }
                }
                if taken > 0 {
                    let radiance = light.of(sum.map(|s| s / all as f32)).max(0.0);
                    let distance = (x * x + y * y + (self.window.eye - z).powi(2)).sqrt();
                    amplitudes[column] = (f64::from(radiance).sqrt() * distance) as f32;
                    covered[column] = cut.is_some() && 2 * taken >= all;
                }
            }
        });
        slice
    }

    /// Memory of one slice's samples as layers hold them [bytes]: a complex number and a flag each.
    pub fn bytes(&self) -> u64 {
        (self.depths.len() * self.lattice.len() * 9) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::points::depth_map::DepthReading;

    /// Left half near and red, right half far and green, its lower right corner black.
    fn picture(folder: &std::path::Path) -> [PathBuf; 2] {
        let (rgb, depth) = (folder.join("rgb.png"), folder.join("depth.png"));
        image::RgbImage::from_fn(8, 4, |x, y| {
            image::Rgb(if x < 4 {
                [255, 0, 0]
            } else if y == 3 && x == 7 {
                [0; 3]
            } else {
                [0, 255, 0]
            })
        })
        .save(&rgb)
        .expect("rgb");
        image::GrayImage::from_fn(8, 4, |x, _| image::Luma([if x < 4 { 255 } else { 0 }])).save(&depth).expect("depth");
        [rgb, depth]
    }

    #[test]
    fn a_picture_is_cut_where_its_depth_says_upright_and_without_gaps() {
        let folder = tempfile::tempdir().expect("folder");
        let [rgb, depth] = picture(folder.path());
        let panel = Grid::new(160, 80, 8e-6, 8e-6).expect("panel");
        let placement = Placement::Window { eye: 0.5, near: 0.0, far: -0.1 };
        let window = PictureWindow::new(&placement, [8, 4], &panel).expect("window");
        let picture = RgbDepth::read(&rgb, &depth, &DepthReading::default(), &placement).expect("picture");
        let slices = Slices::of_depth(picture, window, &panel, 5).expect("slices");
        let depths = slices.depths().to_vec();
        assert!(depths.len() == 5 && depths[0] < depths[4], "{depths:?}");
        // At the far plane the window is 1.2 times as wide, less a tenth of a part.
        assert_eq!(slices.lattice.width, (160.0f64 * slices.window.spread(depths[0])).ceil() as usize);
        let red = |k: usize| slices.slice(k, LightColor::Channel(Channel::Red));
        let green = |k: usize| slices.slice(k, LightColor::Channel(Channel::Green));
        let lit = |s: &Slice| s.amplitudes.iter().filter(|a| **a > 0.0).count();
        let covered = |s: &Slice| s.covered.iter().filter(|c| **c).count();
        assert_eq!(lit(&red(0)) + lit(&green(4)) + (1..4).map(|k| covered(&red(k))).sum::<usize>(), 0);
        let (near, far) = (red(4), green(0));
        let lattice = slices.lattice;
        for row in 0..lattice.height {
            for column in 0..lattice.width {
                let (i, x, y) = (row * lattice.width + column, lattice.x(column), lattice.y(row));
                let inside = |z: f64| {
                    let [hx, hy] = slices.window.half.map(|h| h * slices.window.spread(z));
                    x.abs() < hx && y.abs() < hy
                };
                assert_eq!(near.covered[i], inside(depths[4]) && x < 0.0, "{column} {row}");
                assert_eq!(near.amplitudes[i] > 0.0, near.covered[i]);
                assert_eq!(far.covered[i], inside(depths[0]) && x >= 0.0, "{column} {row}");
                let [hx, hy] = slices.window.half.map(|h| h * slices.window.spread(depths[0]));
                // Black, and there: it hides what is behind it.
                let black = x >= 0.75 * hx && y < -0.5 * hy;
                assert_eq!(far.amplitudes[i] > 0.0, far.covered[i] && !black, "{column} {row}");
            }
        }
    }

    #[test]
    fn fine_pictures_are_averaged_and_a_stack_keeps_its_depths() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("checks.png");
        image::GrayImage::from_fn(400, 200, |x, y| image::Luma([if (x + y) % 2 == 0 { 255 } else { 0 }]))
            .save(&path)
            .expect("picture");
        let panel = Grid::new(40, 20, 8e-6, 8e-6).expect("panel");
        let placement = Placement::Window { eye: 0.5, near: 0.0, far: -0.1 };
        let slices = Slices::of_stack(&[(path.clone(), 0.0), (path, -0.05)], &placement, &panel).expect("stack");
        assert_eq!(slices.depths(), [-0.05, 0.0]);
        let slice = slices.slice(1, LightColor::Channel(Channel::Luminance));
        assert!(!slice.covered.contains(&true));
        let (lattice, mut lit) = (slices.lattice, 0);
        for (i, amplitude) in slice.amplitudes.iter().enumerate().filter(|(_, a)| **a > 0.0) {
            let (x, y) = (lattice.x(i % lattice.width), lattice.y(i / lattice.width));
            let radiance = (f64::from(*amplitude) / (x * x + y * y + 0.25).sqrt()).powi(2);
            assert!((radiance - 0.5).abs() < 0.03, "{radiance}");
            lit += 1;
        }
        assert!((40 * 20..=41 * 21).contains(&lit), "{lit}");
    }
}
