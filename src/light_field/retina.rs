//! What a pupil sees of a light field: the incoherent picture on a retina, fast enough for every step of an iteration.
//!
//! The lattice of a retina is laid out so that one discrete transform of the field in a pupil fills it: `columns × rows` samples
//! over the extent of the panel's padded transform, in the coordinate q of the panel's plane, with sample (columns/2, rows/2) on
//! the axis. Views that lie on the same lattice are sheared by a constant shift each.

use super::{EyeGrid, LightField, Pupil, Viewer};
use crate::error::{Error, Result};
use crate::field::fft::{Fft1, fast_length};
use crate::field::{Complex32, Grid};
use crate::progress::Progress;
use crate::units::show_length;
use glam::DVec2;

/// Where a pupil stands, and what it focuses on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Middle of the pupil on the eye's plane, in the hologram frame [m].
    pub pupil: DVec2,
    /// Depth z in focus [m].
    pub focus: f64,
}

/// The lattice of the pictures that pupils see through a panel from one distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Retina {
    /// The panel's pixels.
    pub panel: Grid,
    /// Length of the padded transforms of the panel's rows and columns.
    pub padded: [usize; 2],
    /// Samples of the picture, on the panel's plane.
    pub lattice: Grid,
    /// Distance of the eye's plane [m].
    pub distance: f64,
    /// Diameter of the pupil [m]; infinite where all of the panel's light is taken in.
    pub pupil: f64,
    /// Width and height of what is taken in on the eye's plane [m]: the pupil's, or all that the panel sends, λZ/pitch.
    pub taken: DVec2,
}

/// Room about the panel in its padded transforms: what diffraction sends beyond the panel's edge does not come back at the other.
const PADDING: f64 = 1.06;
/// Pixels of the panel along a cell of the picture where all of its light is taken in: nine phases for each intensity in focus.
const PIXELS: usize = 3;
/// Views along the longer side of all that a panel sends.
const VIEWS: f64 = 16.0;

impl Retina {
    /// The lattice for a panel, an eye at `distance` [m] with a pupil [m], in light of wavelengths down to `shortest` [m]: at the
    /// shortest its cells are half of λZ/pupil or less, which is what intensities behind a pupil need.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] for a pupil wider than half of what the panel sends to that distance, λZ/pitch.
    pub fn new(panel: &Grid, distance: f64, pupil: f64, shortest: f64) -> Result<Self> {
        let widest = 0.5 * shortest * distance / panel.pitch_x.max(panel.pitch_y);
        if !(pupil > 0.0 && pupil <= widest) {
            let widest = show_length(widest);
            let what = format!("must be above zero and at most {widest} here, half of what the panel sends");
            return Err(Error::out_of_range("pupil", show_length(pupil), what));
        }
        let side = |count: usize, pitch: f64| {
            let padded = 2 * fast_length((PADDING * count as f64 * 0.5).ceil() as usize, 1, &[1]);
            let extent = padded as f64 * pitch;
            let least = 2.0 * pupil * extent / (shortest * distance);
            let samples = 2 * fast_length((0.5 * least).ceil() as usize + 1, 1, &[1]);
            (padded, samples.min(padded), extent)
        };
        let ((mx, columns, width), (my, rows, height)) =
            (side(panel.width, panel.pitch_x), side(panel.height, panel.pitch_y));
        let (pitch_x, pitch_y) = (width / columns as f64, height / rows as f64);
        // Sample (columns/2, rows/2) stands on the panel's middle.
        let center = [panel.center[0] - 0.5 * pitch_x, panel.center[1] + 0.5 * pitch_y];
        let lattice = Grid::new(columns, rows, pitch_x, pitch_y)?.centered_at(center);
        Ok(Self { panel: *panel, padded: [mx, my], lattice, distance, pupil, taken: DVec2::splat(pupil) })
    }

    /// The lattice for an eyepiece, a camera or a bench at `distance` [m] that takes in all of a panel's light of wavelengths down to
    /// `shortest` [m]: cells of 3 × 3 pixels, of which each shows the mean intensity.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn whole(panel: &Grid, distance: f64, shortest: f64) -> Result<Self> {
        let (pitch_x, pitch_y) = (PIXELS as f64 * panel.pitch_x, PIXELS as f64 * panel.pitch_y);
        let side = |count: usize| 2 * count.div_ceil(2 * PIXELS);
        let center = [panel.center[0] - 0.5 * pitch_x, panel.center[1] + 0.5 * pitch_y];
        let lattice = Grid::new(side(panel.width), side(panel.height), pitch_x, pitch_y)?.centered_at(center);
        let taken = shortest * distance / DVec2::new(panel.pitch_x, panel.pitch_y);
        let padded = [panel.width, panel.height];
        Ok(Self { panel: *panel, padded, lattice, distance, pupil: f64::INFINITY, taken })
    }

    /// Where the views stand that a viewer takes in.
    ///
    /// # Errors
    /// As [`EyeGrid::over`].
    pub fn eyes(&self, viewer: &Viewer) -> Result<EyeGrid> {
        let spacing = if self.pupil.is_finite() { EyeGrid::SPACING } else { self.taken.max_element() / VIEWS };
        // The outermost cells end where all that is taken in does.
        let inside = if self.pupil.is_finite() { self.taken } else { self.taken - DVec2::splat(spacing) };
        EyeGrid::over(viewer.eye, viewer.eye_box + inside.max(DVec2::ZERO), spacing)
    }

    /// The lattice for a viewer.
    ///
    /// # Errors
    /// As [`Viewer::check`], [`Retina::new`] and [`Retina::whole`].
    pub fn of(viewer: &Viewer, panel: &Grid, shortest: f64) -> Result<Self> {
        viewer.check()?;
        match viewer.pupil {
            Pupil::Diameter(pupil) => Self::new(panel, viewer.eye.z, pupil, shortest),
            Pupil::All => Self::whole(panel, viewer.eye.z, shortest),
        }
    }

    /// The part of the lattice that covers ±`half` [m] about the panel's middle: pixels for the views of a light field.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn window(&self, half: DVec2) -> Result<Grid> {
        let lattice = &self.lattice;
        let side = |half: f64, pitch: f64, most: usize| 2 * ((half / pitch).ceil() as usize + 1).clamp(1, most / 2);
        let (width, height) =
            (side(half.x, lattice.pitch_x, lattice.width), side(half.y, lattice.pitch_y, lattice.height));
        Ok(Grid::new(width, height, lattice.pitch_x, lattice.pitch_y)?.centered_at(lattice.center))
    }

    /// Whether the views of a light field lie on this lattice.
    pub fn fits(&self, window: &Grid) -> bool {
        let lattice = &self.lattice;
        let even = |count: usize| count.is_multiple_of(2);
        let same = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1e-6 * scale;
        even(window.width)
            && even(window.height)
            && window.width <= lattice.width
            && window.height <= lattice.height
            && same(window.pitch_x, lattice.pitch_x, lattice.pitch_x)
            && same(window.pitch_y, lattice.pitch_y, lattice.pitch_y)
            && same(window.center[0], lattice.center[0], lattice.pitch_x)
            && same(window.center[1], lattice.center[1], lattice.pitch_y)
    }
}

/// What pupils see of one channel of a light field whose views lie on a retina's lattice.
pub(crate) struct Targets<'l> {
    retina: Retina,
    field: &'l LightField,
    samples: &'l [u16],
    /// Transfer function of the pupil's diffraction, real and even, on the transform of the lattice, with 1/N of the inverse; empty
    /// for a pupil that takes all.
    transfer: Vec<f32>,
    row: Fft1<f32>,
    column: Fft1<f32>,
    progress: &'l Progress,
}

impl<'l> Targets<'l> {
    /// For a light field of one channel in light of a wavelength [m]. Pictures that are made while the job is asked to stop are of no
    /// use; the caller's next [`Progress::check`] fails.
    ///
    /// # Errors
    /// [`Error::Parameter`] for views that do not lie on the lattice, or stand in another plane.
    pub(crate) fn new(retina: &Retina, field: &'l LightField, wavelength: f64, progress: &'l Progress) -> Result<Self> {
        let samples = match field.channels.as_slice() {
            [one] => one.as_slice(),
            _ => return Err(Error::parameter("light field", "has several channels; each laser shows one")),
        };
        if !retina.fits(&field.window) || samples.len() != field.pixels() * field.eyes.count() {
            return Err(Error::parameter("light field", "its views do not lie on the retina's lattice"));
        }
        if (field.eyes.distance - retina.distance).abs() > 1e-9 + 1e-6 * retina.distance {
            let what =
                format!("its views stand {} m before the panel, the eye {} m", field.eyes.distance, retina.distance);
            return Err(Error::parameter("light field", what));
        }
        let (row, column) = (Fft1::new(retina.lattice.width), Fft1::new(retina.lattice.height));
        let mut targets = Self { retina: *retina, field, samples, transfer: Vec::new(), row, column, progress };
        if retina.pupil.is_finite() {
            targets.transfer = targets.diffraction(wavelength);
        }
        Ok(targets)
    }

    /// The transfer function of a disc of the pupil's diameter: its autocorrelation.
    fn diffraction(&self, wavelength: f64) -> Vec<f32> {
        let Grid { width, height, pitch_x, pitch_y, .. } = self.retina.lattice;
        let step = [pitch_x, pitch_y].map(|pitch| wavelength * self.retina.distance / pitch);
        let (dx, dy) = (step[0] / width as f64, step[1] / height as f64);
        let radius = 0.5 * self.retina.pupil;
        let mut disc: Vec<Complex32> = (0..width * height)
            .map(|i| {
                let (x, y) = (signed(i % width, width) * dx, signed(i / width, height) * dy);
                Complex32::new(coverage(x, y, radius, dx.max(dy)), 0.0)
            })
            .collect();
        let mut scratch = Scratch::new(&self.row, &self.column);
        self.transform(&mut disc, false, &mut scratch);
        disc.iter_mut().for_each(|u| *u = Complex32::new(u.norm_sqr(), 0.0));
        self.transform(&mut disc, true, &mut scratch);
        let scale = 1.0 / (disc[0].re * (width * height) as f32);
        disc.iter().map(|u| u.re * scale).collect()
    }

    /// The square root of the picture of a look, in units of white's: what amplitudes on the retina are compared with.
    pub(crate) fn amplitude(&self, look: &Look) -> Vec<f32> {
        let Grid { width, height, .. } = self.retina.lattice;
        let mut sum = self.gathered(look);
        if self.transfer.is_empty() {
            // In full aperture diffraction is finer than a cell, and few views stand for many.
            self.shade(&mut sum, look);
            return sum.iter().map(|u| u.re.max(0.0).sqrt()).collect();
        }
        let mut scratch = Scratch::new(&self.row, &self.column);
        self.transform(&mut sum, true, &mut scratch);
        sum.iter_mut().zip(&self.transfer).for_each(|(u, t)| *u *= *t);
        self.transform(&mut sum, false, &mut scratch);
        debug_assert_eq!(sum.len(), width * height);
        sum.iter().map(|u| u.re.max(0.0).sqrt()).collect()
    }

    /// The square root of the view from the eye point next to a place of the eye's plane.
    pub(crate) fn pinhole(&self, place: DVec2) -> Vec<f32> {
        let Grid { width, height, .. } = self.retina.lattice;
        let (window, eyes) = (&self.field.window, &self.field.eyes);
        let off = |index: &usize| (eyes.position(*index).truncate() - place).length();
        let index = (0..eyes.count()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0);
        let [w, h] = [window.width, window.height];
        let (left, top) = ((width - w) / 2, (height - h) / 2);
        let mut out = vec![0.0; width * height];
        for (row, codes) in self.samples[index * w * h..][..w * h].chunks_exact(w).enumerate() {
            let line = &mut out[(top + row) * width + left..][..w];
            line.iter_mut().zip(codes).for_each(|(a, &code)| *a = self.field.radiance(code).sqrt());
        }
        out
    }

    /// Makes the steps smooth in which the window's edges cut views off one after another: what they should leave is the share of
    /// all that is taken in from which a place is seen through the window.
    fn shade(&self, sum: &mut [Complex32], look: &Look) {
        let (lattice, window, eyes) = (&self.retina.lattice, &self.field.window, &self.field.eyes);
        let shear = 1.0 - self.retina.distance / (self.retina.distance - look.focus);
        let factor = |off: f64, half: f64, views: &mut dyn Iterator<Item = f64>, taken: f64| {
            // Views d to d + 1 cell, of which the window shows off + d·shear.
            let inside = |d: f64| (off + d * shear).abs() <= half;
            let (mut seen, mut count) = (0.0, 0.0);
            for d in views {
                count += 1.0;
                seen += f64::from(u8::from(inside(d)));
            }
            let reach = 0.5 * taken * shear.abs();
            let share = if reach > 0.0 {
                ((off + reach).min(half) - (off - reach).max(-half)).max(0.0) / (2.0 * reach)
            } else {
                f64::from(u8::from(off.abs() <= half))
            };
            if seen > 0.0 { (share * count / seen) as f32 } else { 1.0 }
        };
        let at = |index: usize| eyes.position(index).truncate() - look.pupil;
        let columns: Vec<f32> = (0..lattice.width)
            .map(|column| {
                let off = lattice.x(column) - window.center[0];
                factor(off, 0.5 * window.extent_x(), &mut (0..eyes.columns).map(|i| at(i).x), self.retina.taken.x)
            })
            .collect();
        for (row, line) in sum.chunks_exact_mut(lattice.width).enumerate() {
            let off = lattice.y(row) - window.center[1];
            let mut views = (0..eyes.rows).map(|i| at(i * eyes.columns).y);
            let own = factor(off, 0.5 * window.extent_y(), &mut views, self.retina.taken.y);
            line.iter_mut().zip(&columns).for_each(|(u, column)| *u *= own * column);
        }
    }

    /// The mean of the views in the pupil, each sheared, by cubic interpolation (Catmull & Rom) along x, then y.
    fn gathered(&self, look: &Look) -> Vec<Complex32> {
        let Grid { width, height, pitch_x, pitch_y, .. } = self.retina.lattice;
        let (window, eyes) = (&self.field.window, &self.field.eyes);
        let [w, h] = [window.width, window.height];
        let unit = self.field.peak / (LightField::FULL * LightField::FULL);
        // Views whose cells the pupil covers, by how much.
        let spacing = eyes.spacing;
        let near = |index: usize| {
            let off = eyes.position(index).truncate() - look.pupil;
            let weight = cell_coverage(off, spacing, 0.5 * self.retina.pupil);
            (weight > 0.0).then_some((index, off, weight as f32))
        };
        let views: Vec<_> = (0..eyes.count()).filter_map(near).collect();
        let total: f32 = views.iter().map(|(_, _, weight)| weight).sum();
        let shear = 1.0 - self.retina.distance / (self.retina.distance - look.focus);
        let mut sum = vec![0.0f32; width * height];
        // The views of a row of eye points together, shifted along x: they are shifted alike along y.
        let mut together = vec![0.0f32; width * h];
        let mut line = vec![0.0f32; w + 6];
        for views in views.chunk_by(|a, b| a.0 / eyes.columns == b.0 / eyes.columns) {
            if self.progress.stopped() {
                break;
            }
            together.fill(0.0);
            for (index, off, weight) in views {
                // The retina's sample q shows the view's place q + d·shear: place j of the view goes to j − d·shear.
                let (whole, taps) = split(-off.x * shear / pitch_x);
                let scale = weight / total * unit;
                let first = (width / 2) as isize - (w / 2) as isize + whole - 1;
                let (skip, first) = if first < 0 { (-first as usize, 0) } else { (0, first as usize) };
                if skip >= w + 3 || first >= width {
                    continue;
                }
                let view = &self.samples[index * w * h..][..w * h];
                for (row, out) in view.chunks_exact(w).zip(together.chunks_exact_mut(width)) {
                    for (cell, &code) in line[3..].iter_mut().zip(row) {
                        let amplitude = f32::from(code);
                        *cell = amplitude * amplitude * scale;
                    }
                    let count = (w + 3 - skip).min(width - first);
                    let of = |tap: usize| &line[skip + tap..][..count];
                    let (a, b, c, d) = (of(0), of(1), of(2), of(3));
                    let out = &mut out[first..][..count];
                    for i in 0..count {
                        out[i] += a[i] * taps[3] + b[i] * taps[2] + c[i] * taps[1] + d[i] * taps[0];
                    }
                }
            }
            let (whole, taps) = split(views[0].1.y * shear / pitch_y);
            let first = (height / 2) as isize - (h / 2) as isize + whole - 1;
            for (row, line) in together.chunks_exact(width).enumerate() {
                for (tap, &share) in taps.iter().enumerate() {
                    let at = first + (row + tap) as isize;
                    if share != 0.0 && (0..height as isize).contains(&at) {
                        let out = &mut sum[at as usize * width..][..width];
                        out.iter_mut().zip(line).for_each(|(out, value)| *out += share * value);
                    }
                }
            }
        }
        sum.into_iter().map(|value| Complex32::new(value, 0.0)).collect()
    }

    /// Two-dimensional transform on one thread, without factor.
    fn transform(&self, samples: &mut [Complex32], forward: bool, scratch: &mut Scratch) {
        let (width, height) = (self.retina.lattice.width, self.retina.lattice.height);
        let run = |plan: &Fft1<f32>, lines: &mut [Complex32], scratch: &mut [Complex32]| {
            if forward { plan.forward(lines, scratch) } else { plan.inverse(lines, scratch) }
        };
        run(&self.row, samples, &mut scratch.row);
        const STRIP: usize = 8;
        let mut strip = vec![Complex32::default(); STRIP * height];
        for first in (0..width).step_by(STRIP) {
            let count = STRIP.min(width - first);
            for row in 0..height {
                for i in 0..count {
                    strip[i * height + row] = samples[row * width + first + i];
                }
            }
            run(&self.column, &mut strip[..count * height], &mut scratch.column);
            for row in 0..height {
                for i in 0..count {
                    samples[row * width + first + i] = strip[i * height + row];
                }
            }
        }
    }
}

struct Scratch {
    row: Vec<Complex32>,
    column: Vec<Complex32>,
}

impl Scratch {
    fn new(row: &Fft1<f32>, column: &Fft1<f32>) -> Self {
        Self { row: row.scratch(), column: column.scratch() }
    }
}

/// Index of a transform's sample, negative in its upper half.
fn signed(index: usize, count: usize) -> f64 {
    if 2 * index < count { index as f64 } else { index as f64 - count as f64 }
}

/// Part of a cell of width `step` that a disc of that radius covers, to first order across its edge.
pub(crate) fn coverage(x: f64, y: f64, radius: f64, step: f64) -> f32 {
    ((radius - x.hypot(y)) / step + 0.5).clamp(0.0, 1.0) as f32
}

/// Part of the square cell about `off` from the disc's middle that the disc covers, from 8 × 8 places of it.
fn cell_coverage(off: DVec2, side: f64, radius: f64) -> f64 {
    if off.abs().max_element() > radius + side {
        return 0.0;
    }
    let place = |i: usize| (i as f64 + 0.5) / 8.0 - 0.5;
    let inside = |i: &usize| (off + side * DVec2::new(place(i % 8), place(i / 8))).length() <= radius;
    (0..64).filter(inside).count() as f64 / 64.0
}

/// A shift as whole samples and the weights of the four samples about the rest: out[j + whole − 1 + tap] += weight[tap]·in[j].
fn split(shift: f64) -> (isize, [f32; 4]) {
    let whole = shift.floor();
    let t = (shift - whole) as f32;
    // Catmull & Rom's kernel at distances 1 + t, t, 1 − t, 2 − t of the output sample's place from the input's.
    let (t2, t3) = (t * t, t * t * t);
    let weights =
        [-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2];
    (whole as isize, weights)
}
