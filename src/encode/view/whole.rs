//! All the light of a panel, as an eyepiece, a camera or a 4-f bench takes it in: the way of the descent through planes.
//!
//! In focus is one plane z. The angular spectrum carries the panel's light there, on a lattice with room for what leaves the panel
//! aside; a cell of the picture holds the mean intensity of the part of the plane that is seen in it from the middle of the eye box,
//! through q at p + (q − p)·(Z − z)/Z. One frame cannot show all of a light field in full aperture, which has as many independent
//! samples as the panel has pixels and asks for intensities alone: what is in focus weighs more than what is blurred.

use super::ViewTarget;
use super::descent::{Rows, Sight};
use crate::error::{Error, Result};
use crate::field::{Complex32, Fft2, Grid, fast_length, phasor, zeroed};
use crate::light_field::retina::Targets;
use crate::light_field::{LightField, Look, Retina, Viewer};
use crate::progress::Progress;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Blur, in cells, from which something counts as out of focus; and what it weighs then, further than so many cells from all that
/// is in focus: an eye sees what is sharp with what is next to it.
const BLUR: f64 = 2.0;
const BLURRED: f64 = 0.1;
const BESIDE: usize = 4;
/// Values of the transfer that are made at once.
const AT_ONCE: usize = 64;
/// Rows of the picture that one task fills.
const CELL_ROWS: usize = 8;
/// Most samples of a plane: 0.5 GB.
const MOST: usize = 1 << 26;
/// Parts of the scene's depth, evenly in dioptres, and the share of the picture that makes one of them count.
const BINS: usize = 24;
const SOME: f64 = 0.005;

/// The panel on planes, and the pictures that should be there.
pub(super) struct Planes<'a> {
    targets: &'a Targets<'a>,
    light: &'a LightField,
    retina: &'a Retina,
    viewer: &'a Viewer,
    /// Depth of what the middle view shows in each of its pixels [m].
    depths: Option<&'a [f32]>,
    wavelength: f64,
    panel: Grid,
    /// Lattice of the transforms. The panel's first pixel stands in column and row `offset`; what is seen begins at 0.
    space: Grid,
    offset: [usize; 2],
    plan: Fft2<f32>,
    /// Memory for samples of the lattice, kept from step to step: fresh pages cost as much as the transforms.
    kept: Mutex<Vec<Vec<Complex32>>>,
    /// Squared spatial frequencies of the lattice's columns and rows, over the squared wave number.
    squares: [Vec<f32>; 2],
}

/// A plane in focus, made ready.
pub(super) struct Plane {
    depth: f64,
    /// Cells that each column and row of the lattice belongs to, as far as something is seen there.
    cells: [Vec<Cells>; 2],
    amplitude: Vec<f32>,
    weights: Vec<f32>,
}

/// The cell of the picture that a pixel belongs to, with the pixel's share of the cell's mean, and its share of the next one's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Cells {
    first: u32,
    shares: [f32; 2],
}

/// Cells of the pixels from `origin` on along an axis: cell c lies between `edge(c)` and `edge(c + 1)`, where pixel k stands for
/// k − ½ … k + ½; cells are at least a pixel wide.
fn cells_of_pixels(edge: impl Fn(usize) -> f64, count: usize, origin: i64) -> Vec<Cells> {
    let end = (edge(count) + 0.5).ceil() as i64;
    let mut first = 0;
    let pixel = |k: i64| {
        let (low, high) = (k as f64 - 0.5, k as f64 + 0.5);
        while first + 1 < count && edge(first + 1) <= low {
            first += 1;
        }
        let share = |cell: usize| {
            if cell >= count {
                return 0.0;
            }
            let (from, to) = (edge(cell), edge(cell + 1));
            ((high.min(to) - low.max(from)).max(0.0) / (to - from)) as f32
        };
        Cells { first: first as u32, shares: [share(first), share(first + 1)] }
    };
    (origin..end).map(pixel).collect()
}

impl<'a> Planes<'a> {
    /// # Errors
    /// [`Error::OutOfRange`] for depths whose planes have more samples than fit the memory.
    pub(super) fn new(targets: &'a Targets<'a>, target: &ViewTarget<'a>) -> Result<Self> {
        let ViewTarget { light, viewer, retina, wavelength, .. } = *target;
        let panel = retina.panel;
        // Foci are drawn a little beyond the scene's depths.
        let [near, far] = light.depth.map(|z| 1.0 / (viewer.eye.z - z));
        let margin = 0.06 * (near - far);
        let range = [near + margin, far - margin].map(|dioptre| viewer.eye.z - 1.0 / dioptre);
        // Edges of what is seen of the nearest and the farthest plane, in pixels of the panel, and how far its light goes aside.
        let ends = |axis: usize| {
            let (mut first, mut last) = (0, [panel.width, panel.height][axis] as i64);
            let far = range[0].abs().max(range[1].abs());
            for z in range {
                let edge = |cell| edge(retina, viewer, z, axis, cell);
                let count = [retina.lattice.width, retina.lattice.height][axis];
                first = first.min((edge(0) + 0.5).floor() as i64);
                last = last.max((edge(count) + 0.5).ceil() as i64);
            }
            let pitch = [panel.pitch_x, panel.pitch_y][axis];
            let sine = (0.5 * wavelength / pitch).min(0.7);
            let reach = (far * sine / (1.0 - sine * sine).sqrt() / pitch).min(MOST as f64).ceil() as i64;
            let length = (last - first + reach) as usize;
            ((-first) as usize, if length > MOST { length } else { fast_length(length, 1, &[1]) })
        };
        let ((left, width), (top, height)) = (ends(0), ends(1));
        if width.saturating_mul(height) > MOST {
            let what = format_args!("{} to {} m", light.depth[1], light.depth[0]);
            return Err(Error::out_of_range("depths", what, "are too far from the panel for all of its light"));
        }
        let space = Grid { width, height, ..panel };
        let square = |f: f64| ((f * wavelength).powi(2)) as f32;
        let squares = [
            (0..width).map(|k| square(space.frequency_x(k))).collect(),
            (0..height).map(|k| square(space.frequency_y(k))).collect(),
        ];
        let plan = Fft2::new(width, height);
        let offset = [left, top];
        let depths = light.middle_depths.as_deref().filter(|depths| depths.len() == light.window.len());
        let kept = Mutex::default();
        Ok(Self { targets, light, retina, viewer, depths, wavelength, panel, space, offset, plan, kept, squares })
    }

    /// Carries samples by the distance z of the angular spectrum; rows from `filled` on are dark, those from `wanted` on of no use.
    fn carry(&self, samples: &mut [Complex32], z: f64, filled: usize, wanted: usize, progress: &Progress) {
        let turns = (z / self.wavelength) as f32;
        let transfer = |column: usize, samples: &mut [Complex32]| {
            let along = self.squares[0][column];
            for (samples, squares) in samples.chunks_mut(AT_ONCE).zip(self.squares[1].chunks(AT_ONCE)) {
                let (mut re, mut im) = ([0.0; AT_ONCE], [0.0; AT_ONCE]);
                for ((re, im), &across) in re.iter_mut().zip(&mut im).zip(squares) {
                    let square = along + across;
                    // √(1 − s) − 1 = −s/(1 + √(1 − s)), which loses no digits; what does not travel is left out.
                    let travels = if square < 1.0 { 1.0 } else { 0.0 };
                    let u = phasor(-turns * (square / (1.0 + (1.0 - square).max(0.0).sqrt())));
                    (*re, *im) = (travels * u.re, travels * u.im);
                }
                samples.iter_mut().zip(re.iter().zip(&im)).for_each(|(u, (&re, &im))| *u *= Complex32::new(re, im));
            }
        };
        self.plan.filter(samples, filled, wanted, transfer, progress);
    }

    /// Memory for the lattice's samples, whatever it holds.
    fn take(&self) -> Vec<Complex32> {
        // What is kept is memory alone, which no panic leaves in a wrong state.
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner).pop();
        kept.unwrap_or_else(|| zeroed(self.space.len()))
    }

    fn give_back(&self, samples: Vec<Complex32>) {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner).push(samples);
    }

    /// Writes a row of the lattice, dark on both sides of the samples.
    fn fill(line: &mut [Complex32], first: usize, count: usize, write: impl FnOnce(&mut [Complex32])) {
        line[..first].fill(Complex32::default());
        write(&mut line[first..first + count]);
        line[first + count..].fill(Complex32::default());
    }
}

/// The greatest of the values at most `reach` columns and rows away.
fn greatest_within(values: &[f32], width: usize, reach: usize) -> Vec<f32> {
    let mut across = values.to_vec();
    for (out, row) in across.chunks_mut(width).zip(values.chunks(width)) {
        for by in 1..=reach.min(width - 1) {
            out[by..].iter_mut().zip(row).for_each(|(out, v)| *out = out.max(*v));
            out.iter_mut().zip(&row[by..]).for_each(|(out, v)| *out = out.max(*v));
        }
    }
    let mut both = across.clone();
    for by in 1..=reach.min(values.len() / width - 1) {
        both[by * width..].iter_mut().zip(&across).for_each(|(out, v)| *out = out.max(*v));
        both.iter_mut().zip(&across[by * width..]).for_each(|(out, v)| *out = out.max(*v));
    }
    both
}

/// Where cell `cell` of the picture begins on the plane z, in pixels of the panel.
fn edge(retina: &Retina, viewer: &Viewer, z: f64, axis: usize, cell: usize) -> f64 {
    let spread = (retina.distance - z) / retina.distance;
    let place = cell as f64 - 0.5;
    let (lattice, panel) = (&retina.lattice, &retina.panel);
    let at = |q: f64, p: f64| p + (q - p) * spread;
    if axis == 0 {
        panel.column(at(lattice.x(0) + place * lattice.pitch_x, viewer.eye.x))
    } else {
        panel.row(at(lattice.y(0) - place * lattice.pitch_y, viewer.eye.y))
    }
}

/// The depths that the middle view shows, in parts that are evenly wide in dioptres; parts that next to nothing lies in left out.
pub(super) fn depths(light: &LightField, viewer: &Viewer) -> Vec<Vec<f32>> {
    let [near, far] = light.depth.map(|z| 1.0 / (viewer.eye.z - z));
    let mut bins = vec![Vec::new(); BINS];
    let depths = light.middle_depths.as_deref().unwrap_or_default();
    for &depth in depths.iter().filter(|depth| depth.is_finite()) {
        let share = (1.0 / (viewer.eye.z - f64::from(depth)) - far) / (near - far).max(f64::MIN_POSITIVE);
        if (-1e-6..=1.0 + 1e-6).contains(&share) {
            bins[((share * BINS as f64) as usize).min(BINS - 1)].push(depth);
        }
    }
    bins.retain(|bin| bin.len() as f64 > SOME * depths.len() as f64);
    bins
}

impl Sight for Planes<'_> {
    type Ready = Plane;

    fn ready(&self, look: &Look) -> Plane {
        let (lattice, z) = (&self.retina.lattice, look.focus);
        let amplitude = self.targets.amplitude(look);
        let cells = [lattice.width, lattice.height];
        let cells = [0, 1].map(|axis| {
            cells_of_pixels(|c| edge(self.retina, self.viewer, z, axis, c), cells[axis], -(self.offset[axis] as i64))
        });
        // Blur grows with the difference of the magnifications and the width of what is taken in.
        let magnified = |z: f64| self.retina.distance / (self.retina.distance - z);
        let (taken, cell) = (self.retina.taken.max_element(), lattice.pitch_x.max(lattice.pitch_y));
        let weight = |depth: f32| {
            let blur = taken * (magnified(depth.into()) - magnified(z)).abs() / cell;
            (BLURRED + (1.0 - BLURRED) / (1.0 + (blur / BLUR).powi(4))) as f32
        };
        let weights = self.depths.map_or_else(Vec::new, |depths| {
            // The window lies in the middle of the lattice; about it nothing is in focus.
            let (w, h) = (self.light.window.width, self.light.window.height);
            let mut weights = vec![BLURRED as f32; lattice.len()];
            let (left, top) = ((lattice.width - w) / 2, (lattice.height - h) / 2);
            for (row, depths) in depths.chunks(w).enumerate() {
                let line = &mut weights[(top + row) * lattice.width + left..][..w];
                line.iter_mut().zip(depths).for_each(|(out, &depth)| *out = weight(depth));
            }
            greatest_within(&weights, lattice.width, BESIDE)
        });
        Plane { depth: z, cells, amplitude, weights }
    }

    fn wanted<'r>(&self, ready: &'r Plane) -> &'r [f32] {
        &ready.amplitude
    }

    fn weights<'r>(&self, ready: &'r Plane) -> &'r [f32] {
        &ready.weights
    }

    fn fields(&self, looks: &[&Plane], light: Rows, progress: &Progress) -> Vec<Vec<Complex32>> {
        let (width, [left, top]) = (self.space.width, self.offset);
        let one = |plane: &&Plane| {
            let mut samples = self.take();
            let filled = top + self.panel.height;
            samples[..top * width].fill(Complex32::default());
            samples[top * width..filled * width].par_chunks_mut(width).enumerate().for_each(|(row, line)| {
                Self::fill(line, left, self.panel.width, |samples| light(row, samples));
            });
            self.carry(&mut samples, plane.depth, filled, plane.cells[1].len(), progress);
            samples
        };
        looks.iter().map(one).collect()
    }

    fn expose(&self, plane: &Plane, field: &[Complex32], share: f32, picture: &mut [f32]) {
        let [columns, rows] = &plane.cells;
        let width = self.retina.lattice.width;
        // Rows of the picture in blocks, each with the plane's rows that show in one of them, in their order.
        picture.par_chunks_mut(CELL_ROWS * width).enumerate().for_each(|(block, picture)| {
            let first = block * CELL_ROWS;
            let end = first + picture.len() / width;
            let begin = rows.partition_point(|row| (row.first as usize + 1) < first);
            let mut line = vec![0.0f32; width + 1];
            for (field, row) in field.chunks(self.space.width).zip(rows).skip(begin) {
                let cell = row.first as usize;
                if cell >= end {
                    break;
                }
                line.fill(0.0);
                for (u, cells) in field.iter().zip(columns) {
                    let (at, intensity) = (cells.first as usize, share * u.norm_sqr());
                    line[at] += cells.shares[0] * intensity;
                    line[at + 1] += cells.shares[1] * intensity;
                }
                for (cell, share) in [cell, cell + 1].into_iter().zip(row.shares) {
                    if share > 0.0 && (first..end).contains(&cell) {
                        let picture = &mut picture[(cell - first) * width..][..width];
                        picture.iter_mut().zip(&line).for_each(|(sum, v)| *sum += share * v);
                    }
                }
            }
        });
    }

    fn pulled(&self, plane: &Plane, mut field: Vec<Complex32>, pull: &[f32]) -> Vec<Complex32> {
        let [columns, rows] = &plane.cells;
        let width = self.retina.lattice.width;
        field.par_chunks_mut(self.space.width).zip(rows).for_each_init(
            || vec![0.0f32; width + 1],
            |line, (field, row)| {
                line.fill(0.0);
                let first = row.first as usize * width;
                for (pull, share) in pull[first..].chunks(width).zip(row.shares) {
                    line.iter_mut().zip(pull).for_each(|(sum, v)| *sum += share * v);
                }
                Self::fill(field, 0, columns.len(), |samples| {
                    for (u, cells) in samples.iter_mut().zip(columns) {
                        let at = cells.first as usize;
                        *u *= cells.shares[0] * line[at] + cells.shares[1] * line[at + 1];
                    }
                });
            },
        );
        field
    }

    fn slopes<T: Send>(
        &self,
        pulls: Vec<(&Plane, Vec<Complex32>)>,
        rows: &mut [T],
        take: impl Fn(usize, &mut T, &[Complex32]) + Sync,
        progress: &Progress,
    ) {
        let (width, [left, top]) = (self.space.width, self.offset);
        let wanted = top + self.panel.height;
        let carried = pulls.into_iter().map(|(plane, mut samples)| {
            self.carry(&mut samples, -plane.depth, plane.cells[1].len(), wanted, progress);
            samples
        });
        let sum = carried.reduce(|mut sum, samples| {
            sum.par_iter_mut().zip(&samples).for_each(|(sum, u)| *sum += u);
            self.give_back(samples);
            sum
        });
        let Some(sum) = sum else { return };
        rows.par_iter_mut().enumerate().for_each(|(row, state)| {
            take(row, state, &sum[(top + row) * width + left..][..self.panel.width]);
        });
        self.give_back(sum);
    }

    fn done(&self, fields: Vec<Vec<Complex32>>) {
        fields.into_iter().for_each(|samples| self.give_back(samples));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_greatest_within_reach_is_that_of_a_square() {
        let (width, height) = (7, 5);
        let values: Vec<f32> = (0..width * height).map(|i| ((i * 17) % 31) as f32).collect();
        for reach in [0, 1, 3, 9] {
            let found = greatest_within(&values, width, reach);
            for (i, &found) in found.iter().enumerate() {
                let near = |j: &usize| (j % width).abs_diff(i % width).max((j / width).abs_diff(i / width)) <= reach;
                let expected = (0..values.len()).filter(near).map(|j| values[j]).fold(0.0, f32::max);
                assert_eq!(found, expected, "{i} within {reach}");
            }
        }
    }

    /// Each cell's shares are those of a mean, each pixel stands in its place.
    #[test]
    fn cells_share_pixels_out() {
        let (origin, start, width, count) = (-5, -3.3, 2.7, 6);
        let pixels = cells_of_pixels(|c| start + width * c as f64, count, origin);
        let mut sums = vec![0.0f32; count + 1];
        let mut middles = vec![0.0f32; count + 1];
        for (i, cells) in pixels.iter().enumerate() {
            for (k, share) in cells.shares.iter().enumerate() {
                sums[cells.first as usize + k] += share;
                middles[cells.first as usize + k] += share * (i as i64 + origin) as f32;
            }
        }
        for cell in 0..count {
            assert!((sums[cell] - 1.0).abs() < 1e-5, "{cell}: {}", sums[cell]);
            let middle = start + width * (cell as f64 + 0.5);
            assert!((f64::from(middles[cell]) - middle).abs() < 0.5, "{cell}: {}", middles[cell]);
        }
        assert_eq!(sums[count], 0.0);
    }
}
