//! The definition in double precision, term by term: slow, obvious, what every engine is tested against.

use super::Cull;
use super::definition::Optics;
use crate::error::Result;
use crate::field::{Complex64, Field, Grid};
use crate::points::PointSource;
use crate::progress::Progress;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Errors of the far form up to this are taken as exact by the oracle; nearer points are integrated.
const EXACT: f64 = 1e-5;

/// Edges of the frequency box that the integral covers: beyond b + 5s, W is below 1e-12.
const COVERED: f64 = 5.0;

/// Fresnel number of the edge below which the far form is not used, whatever its error.
const NEAREST_EDGE: f64 = 0.6;

/// Memory for the spectra of points that are integrated together [bytes].
const SPECTRA: u64 = 64 << 20;

/// Points that are prepared together.
const GROUP: usize = 1 << 14;

/// The field on the whole grid, in double precision.
pub fn oracle(points: &[PointSource], grid: &Grid, wavelength: f64, cull: Cull) -> Result<Field<f64>> {
    watched(points, grid, wavelength, cull, &Progress::new())
}

/// As [`oracle`], counting points and ready to stop.
pub(super) fn watched(
    points: &[PointSource],
    grid: &Grid,
    wavelength: f64,
    cull: Cull,
    progress: &Progress,
) -> Result<Field<f64>> {
    progress.start("hologram: oracle", points.len() as u64);
    let optics = Optics::new(grid, wavelength)?;
    let columns: Vec<f64> = (0..grid.width).map(|column| grid.x(column)).collect();
    let mut field = Field::<f64>::zeros(*grid, wavelength);
    in_groups(points, &optics, cull, progress, |kernels| {
        field.samples.par_chunks_mut(grid.width).enumerate().for_each(|(row, samples)| {
            for kernel in kernels.iter().take_while(|_| !progress.stopped()) {
                kernel.add(&optics, cull, &columns, grid.y(row), samples, progress);
            }
        });
    })?;
    Ok(field)
}

/// Gives kernels of all points to `add`, as many at once as memory takes.
fn in_groups(
    points: &[PointSource],
    optics: &Optics,
    cull: Cull,
    progress: &Progress,
    mut add: impl FnMut(&[Kernel]),
) -> Result<()> {
    let mut rest = points;
    while !rest.is_empty() {
        let (now, later) = rest.split_at(group(rest, optics, cull));
        let lit = |p: &&PointSource| p.amplitude != 0.0 && !progress.stopped();
        let kernels: Vec<Kernel> = now.par_iter().filter(lit).map(|p| Kernel::new(*p, optics, cull)).collect();
        progress.check()?;
        add(&kernels);
        progress.check()?;
        progress.advance(now.len() as u64);
        rest = later;
    }
    Ok(())
}

/// The field at sampled pixels (column, row) only, in their order.
pub fn oracle_at(
    points: &[PointSource],
    grid: &Grid,
    wavelength: f64,
    cull: Cull,
    pixels: &[(usize, usize)],
) -> Result<Vec<Complex64>> {
    let optics = Optics::new(grid, wavelength)?;
    let progress = Progress::new();
    let mut field = vec![Complex64::default(); pixels.len()];
    in_groups(points, &optics, cull, &progress, |kernels| {
        field.par_iter_mut().zip(pixels).for_each(|(u, &(column, row))| {
            let (x, y) = ([grid.x(column)], grid.y(row));
            kernels.iter().for_each(|kernel| kernel.add(&optics, cull, &x, y, std::slice::from_mut(u), &progress));
        });
    })?;
    Ok(field)
}

/// Memory beside points and the f32 field [bytes]: the f64 field, and the largest group of kernels.
pub(super) fn bytes(grid: &Grid, optics: &Optics, cull: Cull, distances: impl Iterator<Item = f64>) -> u64 {
    let (mut largest, mut sum, mut count) = (0, 0, 0);
    for distance in distances {
        let spectrum = spectrum_bytes(optics, cull, distance);
        (largest, sum, count) = (spectrum.max(largest), sum + spectrum, count + 1);
    }
    let kernels = GROUP.min(count) * size_of::<Kernel>();
    16 * grid.len() as u64 + sum.min(SPECTRA.max(largest)) + kernels as u64
}

/// Number of points at the front whose spectra fit together, at least one.
fn group(points: &[PointSource], optics: &Optics, cull: Cull) -> usize {
    let mut sum = 0;
    let fits = |p: &&PointSource| {
        sum += spectrum_bytes(optics, cull, p.position.z.abs());
        sum <= SPECTRA
    };
    points.iter().take(GROUP).take_while(fits).count().max(1)
}

/// Whether the integral is summed at this distance, instead of its far form.
fn integrated(optics: &Optics, cull: Cull, distance: f64) -> bool {
    let far = optics.far_error(distance) <= EXACT && optics.edge_fresnel_number(distance) >= NEAREST_EDGE;
    cull == Cull::Soft && !far
}

fn spectrum_bytes(optics: &Optics, cull: Cull, distance: f64) -> u64 {
    if !integrated(optics, cull, distance) {
        return 0;
    }
    let count = |axis| Spectrum::lattice(optics, axis, distance).1 as u64;
    16 * count(0) * count(1)
}

/// One point, with its spectrum where the integral is summed.
struct Kernel {
    point: PointSource,
    near: Option<Spectrum>,
}

impl Kernel {
    fn new(point: PointSource, optics: &Optics, cull: Cull) -> Self {
        let distance = point.position.z.abs();
        let near = integrated(optics, cull, distance).then(|| Spectrum::new(distance, optics));
        Self { point, near }
    }

    /// Adds the point's field at the pixels (x, y) of one row.
    fn add(&self, optics: &Optics, cull: Cull, x: &[f64], y: f64, row: &mut [Complex64], progress: &Progress) {
        let p = &self.point;
        let (dy, distance) = (y - p.position.y, p.position.z.abs());
        let factor = Complex64::cis(p.phase) * f64::from(p.amplitude);
        let line = self.near.as_ref().map(|spectrum| spectrum.line(dy));
        for (x, u) in x.iter().zip(row) {
            // A pixel of a point that is integrated takes a millisecond far out.
            if line.is_some() && progress.stopped() {
                return;
            }
            let dx = x - p.position.x;
            let diverging = match (cull, &self.near, &line) {
                (Cull::Soft, Some(spectrum), Some(line)) => spectrum.at(line, dx),
                (Cull::Soft, ..) => optics.far(dx, dy, distance),
                (Cull::Hard | Cull::None, ..) => sphere(optics, cull, dx, dy, distance),
            };
            *u += factor * if p.position.z > 0.0 { diverging.conj() } else { diverging };
        }
    }
}

/// The bare sphere, cut at the square of the band limit or not at all.
fn sphere(optics: &Optics, cull: Cull, dx: f64, dy: f64, distance: f64) -> Complex64 {
    if cull == Cull::Hard && (dx.abs() > optics.cone(0, distance) || dy.abs() > optics.cone(1, distance)) {
        return Complex64::default();
    }
    let r = (dx * dx + dy * dy + distance * distance).sqrt();
    // The sphere has a pole at its centre; within a wavelength of it no sample can mean anything.
    Complex64::cis((r / optics.wavelength).fract() * TAU) / r.max(optics.wavelength)
}

/// The integrand of the definition without its plane waves, on a lattice of frequencies.
///
/// The trapezoid rule on a smooth integrand of compact support errs by the kernel's aliases at the lattice's period
/// alone; the period is chosen so that the field has died away there.
struct Spectrum {
    fx: Vec<f64>,
    fy: Vec<f64>,
    /// Row-major, fy by fx, i·W·W/f_z·exp(i2πf_z|z|)·df·df.
    values: Vec<Complex64>,
    /// Where the field is zero to 1e-10 [m].
    reach: [f64; 2],
}

impl Spectrum {
    /// Where the field has died away [m], and the number of frequencies, along an axis.
    fn lattice(optics: &Optics, axis: usize, distance: f64) -> (f64, usize) {
        let taper = optics.taper[axis];
        // The taper's transform decays as exp(−(πsx)²): 1e-12 at 1.67/s.
        let reach = optics.spread(axis, distance, optics.taper.map(|taper| taper.reach(3.2))) + 1.67 / taper.width;
        (reach, (2.2 * reach * 2.0 * taper.reach(COVERED)).ceil() as usize + 8)
    }

    fn new(distance: f64, optics: &Optics) -> Self {
        let axis = |axis: usize| -> (f64, Vec<f64>, f64) {
            let (reach, count) = Self::lattice(optics, axis, distance);
            let top = optics.taper[axis].reach(COVERED);
            let step = 2.0 * top / count as f64;
            (reach, (0..count).map(|i| (i as f64 + 0.5) * step - top).collect(), step)
        };
        let ((reach_x, fx, step_x), (reach_y, fy, step_y)) = (axis(0), axis(1));
        let reach = [reach_x, reach_y];
        let inverse = 1.0 / (optics.wavelength * optics.wavelength);
        let mut values = Vec::with_capacity(fx.len() * fy.len());
        let wx: Vec<f64> = fx.iter().map(|&f| optics.taper[0].at(f)).collect();
        for &y in &fy {
            let wy = optics.taper[1].at(y);
            for (&x, wx) in fx.iter().zip(&wx) {
                let fz = (inverse - x * x - y * y).sqrt();
                let weight = Complex64::new(0.0, wx * wy / fz * step_x * step_y);
                values.push(weight * Complex64::cis((fz * distance).fract() * TAU));
            }
        }
        Self { fx, fy, values, reach }
    }

    /// The integral over f_y at one Δy, for each f_x; empty where the field has died away.
    fn line(&self, dy: f64) -> Vec<Complex64> {
        if dy.abs() > self.reach[1] {
            return Vec::new();
        }
        let mut line = vec![Complex64::default(); self.fx.len()];
        for (row, fy) in self.values.chunks_exact(self.fx.len()).zip(&self.fy) {
            let wave = Complex64::cis((fy * dy).fract() * TAU);
            line.iter_mut().zip(row).for_each(|(sum, value)| *sum += value * wave);
        }
        line
    }

    fn at(&self, line: &[Complex64], dx: f64) -> Complex64 {
        if dx.abs() > self.reach[0] {
            return Complex64::default();
        }
        line.iter().zip(&self.fx).map(|(value, fx)| value * Complex64::cis((fx * dx).fract() * TAU)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::relative_error;
    use glam::DVec3;

    fn point(x: f64, y: f64, z: f64) -> PointSource {
        PointSource { position: DVec3::new(x, y, z), amplitude: 1.0, phase: 0.4 }
    }

    #[test]
    fn integral_and_far_form_are_one_field() {
        // One point, integrated although the far form is taken as exact there; pitch x ≠ y, odd sizes, off axis.
        for (pitch, distance) in [([8e-6, 6e-6], 0.03), ([3.74e-6, 5e-6], 0.02)] {
            let grid = Grid::new(33, 21, 11.0 * pitch[0], 13.0 * pitch[1]).expect("grid");
            let fine = Grid::new(33, 21, pitch[0], pitch[1]).expect("grid");
            let optics = Optics::new(&fine, 532e-9).expect("optics");
            let spectrum = Spectrum::new(distance, &optics);
            let (mut integral, mut far) = (Vec::new(), Vec::new());
            for row in 0..grid.height {
                let dy = grid.y(row) + 0.3e-3;
                let line = spectrum.line(dy);
                for column in 0..grid.width {
                    let dx = grid.x(column) - 0.2e-3;
                    integral.push(spectrum.at(&line, dx));
                    far.push(optics.far(dx, dy, distance));
                }
            }
            let error = relative_error(&far, &integral);
            assert!(error < optics.far_error(distance), "{pitch:?} {distance}: {error:.2e}");
        }
    }

    #[test]
    fn bare_sphere_inside_the_flat_band_on_both_sides() {
        let grid = Grid::new(9, 7, 4e-6, 5e-6).expect("grid").centered_at([1e-4, -2e-4]);
        for z in [-0.2, 0.2] {
            let p = point(2e-4, -1e-4, z);
            let u = oracle(&[p], &grid, 633e-9, Cull::Soft).expect("oracle");
            let bare = oracle(&[p], &grid, 633e-9, Cull::None).expect("bare");
            assert!(relative_error(&u.samples, &bare.samples) < 1e-6);
            let r = ((grid.x(3) - 2e-4).powi(2) + (grid.y(2) + 1e-4).powi(2) + z * z).sqrt();
            let sign = if z > 0.0 { -1.0 } else { 1.0 };
            let expected = Complex64::cis(sign * TAU / 633e-9 * r + 0.4) / r;
            assert!((u.samples[2 * 9 + 3] - expected).norm() * r < 1e-6);
        }
    }

    #[test]
    fn a_point_on_the_plane_is_the_taper_s_own_spot_and_continuous_in_depth() {
        let grid = Grid::new(15, 15, 8e-6, 8e-6).expect("grid");
        let at = |z: f64| oracle(&[point(0.0, 0.0, z)], &grid, 633e-9, Cull::Soft).expect("oracle").samples;
        let on = at(0.0);
        // ∫∫ W·W/f_z ≈ λ·(2b)²·(1 + θ²/3) at the spot itself, b = 0.85·B.
        let b = 0.85 * 62_500.0;
        let expected = 633e-9 * (2.0 * b) * (2.0 * b) * (1.0 + (633e-9f64 * b).powi(2) / 3.0);
        let spot = on[7 * 15 + 7] * Complex64::cis(-0.4);
        assert!((spot.im / expected - 1.0).abs() < 1e-5 && spot.re.abs() < 1e-6 * expected, "{spot} {expected}");
        // Half a wavelength behind, the phase is half a turn on; in front, the conjugate of that behind.
        let behind = at(-633e-9 / 2.0);
        let turned: Vec<Complex64> = on.iter().map(|u| -u).collect();
        assert!(relative_error(&behind, &turned) < 5e-3);
        let front = at(633e-9 / 2.0);
        let conjugate: Vec<Complex64> = behind.iter().map(|u| (u * Complex64::cis(-0.4)).conj()).collect();
        let front: Vec<Complex64> = front.iter().map(|u| u * Complex64::cis(-0.4)).collect();
        assert!(relative_error(&front, &conjugate) < 1e-12);
    }

    #[test]
    fn sampled_pixels_are_those_of_the_whole_field() {
        let grid = Grid::new(11, 5, 8e-6, 7e-6).expect("grid");
        let points = [point(1e-5, 0.0, -0.1), point(0.0, 2e-5, 1e-3), point(0.0, 0.0, 0.0)];
        let whole = oracle(&points, &grid, 500e-9, Cull::Soft).expect("whole");
        let some = oracle_at(&points, &grid, 500e-9, Cull::Soft, &[(10, 0), (3, 4)]).expect("some");
        assert_eq!(some, [whole.samples[10], whole.samples[4 * 11 + 3]]);
    }
}
