//! From the panel to an eye: Fresnel's integral to the plane of the pupils, the pupil, its lens, and the retina.
//!
//! With Z the eye's distance the panel's field u makes on the eye's plane, up to a phase that is the same everywhere,
//!
//! ```text
//! U(e) = 1/(λZ) ∫ u(x')·exp(iπ|e − x'|²/(λZ)) dx'
//! ```
//!
//! and a pupil about p, focused on the plane z at the distance s = Z − z, sees in the direction of the panel's point q
//!
//! ```text
//! V(q) = 1/(λZ) ∫ U(p + d)·exp(−iπ|d|²/(λs))·exp(+i2π(q − p)·d/(λZ)) dd,   |d| ≤ D/2.
//! ```
//!
//! Both kernels are products of one factor in x and one in y, so each integral is two products of matrices. Energy is kept:
//! ∫|V|² dq is that through the pupil, and ∫|U|² de that of the panel. Of the exact wave the paraxial one differs, ρ off the axis of
//! a panel's point, by a place ρ³/(2Z²) on the panel's plane (8 µm at 18 mm before an eye at 0.6 m: a sixth of what a pupil resolves)
//! and less than a twentieth of a wave of aberrations.

use super::Look;
use super::matrix::Matrix;
use crate::error::Result;
use crate::field::{Complex64, Field, Grid};
use crate::progress::Progress;
use glam::DVec2;
use std::f64::consts::{PI, TAU};

/// How much finer than Nyquist's the lattice on the eye's plane is: what stands just outside the panel and the retina is not
/// folded into them.
const MARGIN: f64 = 1.25;
/// Samples along each side of a cell that the pupil's rim cuts.
const RIM: usize = 8;

/// What the looks share.
#[derive(Clone, Debug)]
pub(super) struct Sight {
    /// Distance Z of the eye's plane [m].
    pub(super) distance: f64,
    /// Diameter of the pupil [m]; infinite for all of the light.
    pub(super) pupil: f64,
    /// Where the retina samples the panel's plane.
    pub(super) retina: Grid,
    /// Middle and half size of the eye box [m].
    pub(super) middle: DVec2,
    pub(super) half_box: DVec2,
}

impl Sight {
    /// Curvature of the wave that the pupil's lens takes out [1/m].
    pub(super) fn curvature(&self, look: &Look) -> f64 {
        1.0 / (self.distance - look.focus)
    }

    /// The lattice on the eye's plane for waves of a field: it covers all pupils of the eye box and of the looks.
    ///
    /// For a point x' of the panel and a point q of the retina the integrand over d has the frequency (q − x')/(λZ) and, out
    /// of focus, up to r·|1/s − 1/Z|/λ more; samples are so close that neither is folded.
    fn lattice(&self, looks: &[Look], panel: &Grid, wavelength: f64) -> Result<Grid> {
        let radius = 0.5 * self.pupil;
        let blur = looks.iter().map(|look| radius * (self.curvature(look) * self.distance - 1.0).abs());
        let blur = blur.fold(0.0, f64::max);
        let (mut low, mut high) = (self.middle - self.half_box, self.middle + self.half_box);
        for look in looks {
            (low, high) = (low.min(look.pupil), high.max(look.pupil));
        }
        let (panel, retina) = (panel.edges(), self.retina.edges());
        let axis = |axis: usize| -> (f64, usize) {
            let ([a, b], [c, d]) = (panel[axis], retina[axis]);
            let pitch = wavelength * self.distance / (MARGIN * ((b - c).max(d - a) + blur));
            let extent = (high - low)[axis] + self.pupil;
            (pitch, (extent / pitch).ceil() as usize + 1)
        };
        let ((pitch_x, width), (pitch_y, height)) = (axis(0), axis(1));
        Ok(Grid::new(width, height, pitch_x, pitch_y)?.centered_at((0.5 * (low + high)).to_array()))
    }
}

/// The light of one exposure on the eye's plane.
pub(super) struct EyePlane {
    lattice: Grid,
    wavelength: f64,
    field: Matrix,
}

impl EyePlane {
    /// Carries a field from the panel to the eye's plane.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`]; [`crate::Error::OutOfRange`] where the eye box has too many samples.
    pub(super) fn of(field: &Field, sight: &Sight, looks: &[Look], progress: &Progress) -> Result<Self> {
        let lattice = sight.lattice(looks, &field.grid, field.wavelength)?;
        Self::at(field, sight.distance, lattice, progress)
    }

    /// Carries a field over a distance onto a lattice.
    pub(super) fn at(field: &Field, distance: f64, lattice: Grid, progress: &Progress) -> Result<Self> {
        let (panel, wavelength) = (field.grid, field.wavelength);
        let u = Matrix::new(panel.height, panel.width, |row, column| {
            let u = field.samples[row * panel.width + column];
            Complex64::new(u.re.into(), u.im.into())
        });
        let reach = wavelength * distance;
        let kernel = |offset: f64| Complex64::cis(TAU * (offset * offset / (2.0 * reach)).fract());
        let gain = panel.pitch_x * panel.pitch_y / reach;
        let down = Matrix::new(lattice.height, panel.height, |j, row| kernel(lattice.y(j) - panel.y(row)) * gain);
        let across = Matrix::new(panel.width, lattice.width, |column, i| kernel(lattice.x(i) - panel.x(column)));
        Ok(Self { lattice, wavelength, field: u.between(&down, &across, progress)? })
    }

    /// The samples U, row-major.
    #[cfg(test)]
    pub(super) fn samples(&self) -> Vec<Complex64> {
        self.field.re.iter().zip(&self.field.im).map(|(re, im)| Complex64::new(*re, *im)).collect()
    }

    /// ∫|U|² over the eye's plane, weighted by what passes there.
    pub(super) fn energy(&self, passes: impl Fn(DVec2) -> f64) -> f64 {
        let lattice = &self.lattice;
        let row = |j: usize| -> f64 {
            let one = |i: usize| match passes(DVec2::new(lattice.x(i), lattice.y(j))) {
                0.0 => 0.0,
                share => share * self.field.at(j, i).norm_sqr(),
            };
            (0..lattice.width).map(one).sum()
        };
        (0..lattice.height).map(row).sum::<f64>() * lattice.pitch_x * lattice.pitch_y
    }

    /// Share of the cell at `e` that lies in a pupil about `middle`.
    fn open(&self, e: DVec2, middle: DVec2, radius: f64) -> f64 {
        let cell = DVec2::new(self.lattice.pitch_x, self.lattice.pitch_y);
        disc_share(e - middle, cell, radius)
    }

    /// Energy that enters the pupil of a look.
    pub(super) fn entering(&self, sight: &Sight, look: &Look) -> f64 {
        self.energy(|e| self.open(e, look.pupil, 0.5 * sight.pupil))
    }

    /// Intensity |V|² on the retina.
    ///
    /// # Errors
    /// [`crate::Error::Interrupted`].
    pub(super) fn on_retina(&self, sight: &Sight, look: &Look, progress: &Progress) -> Result<Vec<f64>> {
        let (lattice, retina, radius) = (&self.lattice, &sight.retina, 0.5 * sight.pupil);
        let range = |middle: f64, margin: f64, count: usize| {
            let (first, last) = ((middle - margin).floor().max(0.0) as usize, (middle + margin).ceil() as usize + 1);
            (first.min(count), last.min(count))
        };
        let (left, right) = range(lattice.column(look.pupil.x), radius / lattice.pitch_x + 1.0, lattice.width);
        let (top, bottom) = range(lattice.row(look.pupil.y), radius / lattice.pitch_y + 1.0, lattice.height);
        let bend = sight.curvature(look) / (2.0 * self.wavelength);
        let offset =
            |row: usize, column: usize| DVec2::new(lattice.x(left + column), lattice.y(top + row)) - look.pupil;
        let pupil = Matrix::new(bottom - top, right - left, |row, column| {
            let d = offset(row, column);
            let open = self.open(look.pupil + d, look.pupil, radius);
            self.field.at(top + row, left + column) * Complex64::cis(-TAU * (bend * d.length_squared()).fract()) * open
        });
        let reach = self.wavelength * sight.distance;
        let wave = |q: f64, d: f64| Complex64::cis(TAU * (q * d / reach).fract());
        let gain = lattice.pitch_x * lattice.pitch_y / reach;
        let down =
            Matrix::new(retina.height, pupil.rows, |row, j| wave(retina.y(row) - look.pupil.y, offset(j, 0).y) * gain);
        let across =
            Matrix::new(pupil.columns, retina.width, |i, column| wave(retina.x(column) - look.pupil.x, offset(0, i).x));
        let seen = pupil.between(&down, &across, progress)?;
        Ok(seen.re.iter().zip(&seen.im).map(|(re, im)| re * re + im * im).collect())
    }
}

/// Share of a rectangular cell at `at` (from the disc's middle) that a disc covers.
pub(super) fn disc_share(at: DVec2, cell: DVec2, radius: f64) -> f64 {
    let (distance, half) = (at.length(), 0.5 * cell.length());
    if distance + half <= radius {
        return 1.0;
    }
    if distance - half >= radius {
        return 0.0;
    }
    let place = |k: usize| (k as f64 + 0.5) / RIM as f64 - 0.5;
    let inside =
        |k: &usize| (at + DVec2::new(place(k % RIM), place(k / RIM)) * cell).length_squared() <= radius * radius;
    (0..RIM * RIM).filter(inside).count() as f64 / (RIM * RIM) as f64
}

/// Transfer of contrast by a clear round pupil at a spatial frequency, in units of its cut-off D/(λZ) (Goodman, *Introduction to
/// Fourier Optics*, §6.3): the transform of its Airy pattern.
pub(super) fn contrast_transfer(frequency: f64) -> f64 {
    if frequency >= 1.0 {
        return 0.0;
    }
    2.0 / PI * (frequency.acos() - frequency * (1.0 - frequency * frequency).sqrt())
}
