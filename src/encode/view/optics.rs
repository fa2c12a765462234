//! From the panel to pupils and back: the linear part of the loss, and its adjoint.
//!
//! Fresnel's integral from the panel to the eye's plane, sampled at X_k = k·λZ/(M·pitch):
//!
//! ```text
//! U(X) = Σ u(x)·exp(iπx²/λZ)·exp(−i2πkx/(M·pitch))        (times exp(iπX²/λZ), which the eye's lens takes up)
//! V(q) = Σ U(X)·P(X − p)·exp(iπ/λ·(1/Z − 1/(Z − z))·(X − p)²)·exp(+i2πkq/(M·pitch))
//! ```
//!
//! P is the pupil's disc about p, z the depth in focus. The first sum is one transform of M samples a row and a column for all
//! pupils; of its columns only those are made that some pupil needs. Both sums are unitary up to a factor, so that the adjoint
//! is the same way back.

use crate::field::fft::Fft1;
use crate::field::{Complex32, Complex64, Grid};
use crate::light_field::retina::coverage;
use crate::light_field::{Look, Retina, Viewer};
use glam::DVec2;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Rows that one task takes together: 16 complex f32 are two cache lines of a column.
const BLOCK: usize = 16;

/// The way from a panel's pixels to the retina, for one laser.
pub(super) struct Optics {
    pub(super) panel: Grid,
    pub(super) retina: Retina,
    wavelength: f64,
    /// exp(iπx²/λZ) of the panel's columns and rows, with the factor that makes the whole transform unitary.
    chirp: [Vec<Complex32>; 2],
    row: Fft1<f32>,
    column: Fft1<f32>,
    small_row: Fft1<f32>,
    small_column: Fft1<f32>,
}

/// A look's weights on the eye plane's samples about its pupil: mask × lens × the shift of the panel's middle, separable but
/// for the mask.
pub(super) struct Aperture {
    /// First sample of the pupil's square along x and y, as a signed index.
    first: [isize; 2],
    /// Its columns and rows.
    size: [usize; 2],
    factors: [Vec<Complex32>; 2],
    mask: Vec<f32>,
}

impl Aperture {
    /// Its columns, as signed indices.
    fn columns(&self) -> std::ops::Range<isize> {
        self.first[0]..self.first[0] + self.size[0] as isize
    }
}

/// Which columns of the eye's plane some pupil needs.
pub(super) struct Columns {
    /// The columns, 0 … M − 1.
    wanted: Vec<usize>,
    /// Where each column stands in `wanted`.
    place: Vec<u32>,
}

impl Columns {
    /// Those that these apertures need.
    pub(super) fn of(apertures: &[&Aperture], padded: usize) -> Self {
        Self::marked(apertures.iter().flat_map(|aperture| aperture.columns()), padded)
    }

    /// All columns between those of the outermost apertures.
    pub(super) fn within(apertures: &[Aperture], padded: usize) -> Self {
        let ends = apertures.iter().map(Aperture::columns);
        let between = ends.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end));
        Self::marked(between.unwrap_or(0..0), padded)
    }

    fn marked(columns: impl Iterator<Item = isize>, padded: usize) -> Self {
        let mut place = vec![u32::MAX; padded];
        columns.for_each(|k| place[wrapped(k, padded)] = 0);
        let wanted: Vec<usize> = (0..padded).filter(|&k| place[k] == 0).collect();
        wanted.iter().enumerate().for_each(|(at, &k)| place[k] = at as u32);
        Self { wanted, place }
    }

    fn at(&self, index: isize) -> usize {
        self.place[wrapped(index, self.place.len())] as usize
    }
}

fn wrapped(index: isize, count: usize) -> usize {
    index.rem_euclid(count as isize) as usize
}

impl Optics {
    pub(super) fn new(panel: &Grid, retina: &Retina, wavelength: f64) -> Self {
        let [mx, my] = retina.padded;
        let scale = 1.0 / ((mx * my) as f64).sqrt();
        let chirp = |count: usize, at: &dyn Fn(usize) -> f64, scale: f64| -> Vec<Complex32> {
            let wave = |i| Complex64::from_polar(scale, PI * at(i) * at(i) / (wavelength * retina.distance));
            (0..count).map(wave).map(|u| Complex32::new(u.re as f32, u.im as f32)).collect()
        };
        let (x0, y0) = (panel.center[0], panel.center[1]);
        Self {
            panel: *panel,
            retina: *retina,
            wavelength,
            chirp: [chirp(panel.width, &|i| panel.x(i) - x0, scale), chirp(panel.height, &|i| panel.y(i) - y0, 1.0)],
            row: Fft1::new(mx),
            column: Fft1::new(my),
            small_row: Fft1::new(retina.lattice.width),
            small_column: Fft1::new(retina.lattice.height),
        }
    }

    /// Distance of the eye plane's samples along x and y [m].
    fn step(&self) -> [f64; 2] {
        let across = self.wavelength * self.retina.distance;
        let [mx, my] = self.retina.padded.map(|n| n as f64);
        [across / (mx * self.panel.pitch_x), across / (my * self.panel.pitch_y)]
    }

    /// The weights of a look. Places are counted from the panel's middle, rows downwards.
    pub(super) fn aperture(&self, look: &Look) -> Aperture {
        let step = self.step();
        let radius = 0.5 * self.retina.pupil;
        let middle = [look.pupil.x - self.panel.center[0], self.panel.center[1] - look.pupil.y];
        let bound = |axis: usize, side: f64| (middle[axis] + side * (radius + step[axis])) / step[axis];
        let first = [0, 1].map(|axis| bound(axis, -1.0).ceil() as isize);
        let size = [0, 1].map(|axis| (bound(axis, 1.0).floor() as isize - first[axis] + 1).max(1) as usize);
        let defocus = 1.0 / self.retina.distance - 1.0 / (self.retina.distance - look.focus);
        let counts = [self.panel.width, self.panel.height];
        let lattice = [self.retina.lattice.width, self.retina.lattice.height];
        let factors = [0, 1].map(|axis| {
            let factor = |i: usize| {
                let k = (first[axis] + i as isize) as f64;
                let off = k * step[axis] - middle[axis];
                // The panel's first pixel stands half its width from its middle.
                let shift = TAU * k * 0.5 * (counts[axis] as f64 - 1.0) / self.retina.padded[axis] as f64;
                let lens = PI / self.wavelength * defocus * off * off;
                // (−1)^k puts the axis into the middle of the retina.
                let sign = if (first[axis] + i as isize).rem_euclid(2) == 0 { 1.0 } else { -1.0 };
                let scale = sign / (lattice[axis] as f64).sqrt();
                let u = Complex64::from_polar(1.0, (shift + lens) % TAU) * scale;
                Complex32::new(u.re as f32, u.im as f32)
            };
            (0..size[axis]).map(factor).collect::<Vec<_>>()
        });
        let off = |axis: usize, i: usize| (first[axis] + i as isize) as f64 * step[axis] - middle[axis];
        let mask = (0..size[0] * size[1])
            .map(|i| coverage(off(0, i % size[0]), off(1, i / size[0]), radius, step[0].max(step[1])))
            .collect();
        Aperture { first, size, factors, mask }
    }

    /// The wanted columns of the eye's plane, M rows each, of the field that `fill(row, samples)` gives for the panel's rows.
    pub(super) fn eye_plane(&self, columns: &Columns, fill: impl Fn(usize, &mut [Complex32]) + Sync) -> Vec<Complex32> {
        let ([mx, my], count) = (self.retina.padded, columns.wanted.len());
        let (width, height) = (self.panel.width, self.panel.height);
        // Rows' transforms, in blocks of rows: within a block column by column.
        let mut blocks = vec![Complex32::default(); height.div_ceil(BLOCK) * BLOCK * count];
        blocks.par_chunks_mut(BLOCK * count).enumerate().for_each_init(
            || (vec![Complex32::default(); mx], self.row.scratch()),
            |(line, scratch), (block, out)| {
                for i in 0..BLOCK.min(height - block * BLOCK) {
                    let row = block * BLOCK + i;
                    fill(row, &mut line[..width]);
                    let chirp = self.chirp[1][row];
                    line[..width].iter_mut().zip(&self.chirp[0]).for_each(|(u, c)| *u *= c * chirp);
                    line[width..].fill(Complex32::default());
                    self.row.forward(line, scratch);
                    columns.wanted.iter().enumerate().for_each(|(at, &k)| out[at * BLOCK + i] = line[k]);
                }
            },
        );
        let mut plane = vec![Complex32::default(); my * count];
        plane.par_chunks_mut(my).enumerate().for_each_init(
            || self.column.scratch(),
            |scratch, (at, column)| {
                for (block, piece) in column[..height].chunks_mut(BLOCK).enumerate() {
                    piece.copy_from_slice(&blocks[(block * count + at) * BLOCK..][..piece.len()]);
                }
                self.column.forward(column, scratch);
            },
        );
        plane
    }

    /// The adjoint: hands the slopes at the panel's pixels, A*·g, row by row to `take(row block, first row, slopes)`, where
    /// `slopes` holds whole rows of the padded length of which the first are the panel's.
    pub(super) fn panel_slopes<T: Send>(
        &self,
        columns: &Columns,
        pulls: &[(&Aperture, &[Complex32])],
        rows: &mut [T],
        take: impl Fn(usize, &mut T, &[Complex32]) + Sync,
    ) {
        let ([mx, my], count) = (self.retina.padded, columns.wanted.len());
        let (width, height) = (self.panel.width, self.panel.height);
        let mut plane = vec![Complex32::default(); my * count];
        let by_column: Vec<Vec<(usize, usize)>> = {
            let mut lists = vec![Vec::new(); count];
            for (number, (aperture, _)) in pulls.iter().enumerate() {
                (0..aperture.size[0]).for_each(|i| lists[columns.at(aperture.first[0] + i as isize)].push((number, i)));
            }
            lists
        };
        plane.par_chunks_mut(my).enumerate().for_each_init(
            || self.column.scratch(),
            |scratch, (at, column)| {
                for &(number, i) in &by_column[at] {
                    let (aperture, pull) = &pulls[number];
                    for (j, u) in pull[i * aperture.size[1]..][..aperture.size[1]].iter().enumerate() {
                        column[wrapped(aperture.first[1] + j as isize, my)] += u;
                    }
                }
                self.column.inverse(column, scratch);
            },
        );
        rows.par_chunks_mut(BLOCK).enumerate().for_each_init(
            || (vec![Complex32::default(); mx], self.row.scratch()),
            |(line, scratch), (block, rows)| {
                for (i, state) in rows.iter_mut().enumerate() {
                    let row = block * BLOCK + i;
                    debug_assert!(row < height);
                    line.fill(Complex32::default());
                    columns.wanted.iter().enumerate().for_each(|(at, &k)| line[k] = plane[at * my + row]);
                    self.row.inverse(line, scratch);
                    let chirp = self.chirp[1][row];
                    line[..width].iter_mut().zip(&self.chirp[0]).for_each(|(u, c)| *u *= (c * chirp).conj());
                    take(row, state, &line[..width]);
                }
            },
        );
    }

    /// Energy on the eye's plane within reach of pupils whose middles stand in a viewer's eye box.
    pub(super) fn inside(&self, plane: &[Complex32], columns: &Columns, viewer: &Viewer) -> f64 {
        let (step, [mx, my]) = (self.step(), self.retina.padded);
        let radius = 0.5 * self.retina.pupil;
        let signed = |k: usize, count: usize| if 2 * k < count { k as f64 } else { k as f64 - count as f64 };
        let half = 0.5 * viewer.eye_box;
        let mut energy = 0.0;
        for (at, &k) in columns.wanted.iter().enumerate() {
            let x = signed(k, mx) * step[0] + self.panel.center[0] - viewer.eye.x;
            for (j, u) in plane[at * my..][..my].iter().enumerate() {
                let y = self.panel.center[1] - signed(j, my) * step[1] - viewer.eye.y;
                let beyond = (DVec2::new(x, y).abs() - half).max(DVec2::ZERO);
                energy += f64::from(coverage(beyond.x, beyond.y, radius, step[0].max(step[1])) * u.norm_sqr());
            }
        }
        energy
    }

    /// The field on the retina of one look.
    pub(super) fn seen(&self, plane: &[Complex32], columns: &Columns, aperture: &Aperture) -> Vec<Complex32> {
        let (my, [w, h]) = (self.retina.padded[1], aperture.size);
        let (width, height) = (self.retina.lattice.width, self.retina.lattice.height);
        // Columns first: only the pupil's have light.
        let mut turned = vec![Complex32::default(); w * height];
        let (mut scratch, mut row_scratch) = (self.small_column.scratch(), self.small_row.scratch());
        for (i, line) in turned.chunks_exact_mut(height).enumerate() {
            let column = &plane[columns.at(aperture.first[0] + i as isize) * my..][..my];
            let factor = aperture.factors[0][i];
            for j in 0..h {
                let weight = factor * aperture.factors[1][j] * aperture.mask[j * w + i];
                let k = aperture.first[1] + j as isize;
                line[wrapped(k, height)] = column[wrapped(k, my)] * weight;
            }
        }
        self.small_column.inverse(&mut turned, &mut scratch);
        let mut seen = vec![Complex32::default(); width * height];
        for (row, line) in seen.chunks_exact_mut(width).enumerate() {
            for i in 0..w {
                line[wrapped(aperture.first[0] + i as isize, width)] = turned[i * height + row];
            }
        }
        self.small_row.inverse(&mut seen, &mut row_scratch);
        seen
    }

    /// The adjoint of [`Optics::seen`]: the pull on the eye plane's samples about the pupil, column by column.
    pub(super) fn pulled(&self, mut pull: Vec<Complex32>, aperture: &Aperture) -> Vec<Complex32> {
        let [w, h] = aperture.size;
        let (width, height) = (self.retina.lattice.width, self.retina.lattice.height);
        let (mut scratch, mut row_scratch) = (self.small_column.scratch(), self.small_row.scratch());
        self.small_row.forward(&mut pull, &mut row_scratch);
        let mut turned = vec![Complex32::default(); w * height];
        for (row, line) in pull.chunks_exact(width).enumerate() {
            for i in 0..w {
                turned[i * height + row] = line[wrapped(aperture.first[0] + i as isize, width)];
            }
        }
        self.small_column.forward(&mut turned, &mut scratch);
        let mut out = vec![Complex32::default(); w * h];
        for (i, line) in turned.chunks_exact(height).enumerate() {
            let factor = aperture.factors[0][i];
            for j in 0..h {
                let weight = (factor * aperture.factors[1][j]).conj() * aperture.mask[j * w + i];
                out[i * h + j] = line[wrapped(aperture.first[1] + j as isize, height)] * weight;
            }
        }
        out
    }
}
