//! Where a leg's light goes, how far it spreads on the way, and what of it is left out.

use crate::field::{Grid, fast_length};
use crate::hologram::definition::Optics;

/// Columns or rows that one task takes together: two cache lines of complex f32.
pub(super) const STRIP: usize = 16;

/// Samples beyond the cone of the steepest wave that light may take: the tails of its edges.
const TAIL: usize = 64;

/// Width of the soft edge of what reaches a window, in Fresnel widths √(λd). A hard edge would ring into the window: by
/// 5 % for 700 samples at 0.2 m.
const GUARD: f64 = 4.0;

/// Half of it in widths of the error function: erfc(2.63)/2 = 1e-4.
const EDGE: f64 = 2.63;

/// A grid that light from the lattice goes to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Window {
    /// Its first sample from the lattice's [m].
    pub(super) first: [f64; 2],
    /// Its middle from the lattice's [m].
    middle: [f64; 2],
    /// Greatest distance of its samples and the lattice's, from that of the middles: half the sum of their sizes [m].
    half: [f64; 2],
    /// The larger number of samples of both.
    least: [usize; 2],
}

impl Window {
    /// A grid of the lattice's pitch.
    pub(super) fn new(lattice: &Grid, to: &Grid) -> Self {
        Self {
            first: [to.x(0) - lattice.x(0), to.y(0) - lattice.y(0)],
            middle: [0, 1].map(|axis| to.center[axis] - lattice.center[axis]),
            half: [0.5 * (lattice.extent_x() + to.extent_x()), 0.5 * (lattice.extent_y() + to.extent_y())],
            least: [lattice.width.max(to.width), lattice.height.max(to.height)],
        }
    }

    /// Size of the transforms for light over up to `distance` [m]: where its aliases, one period away, miss the window,
    /// be it that the cone ends before or that what lies beyond the guard is left out.
    pub(super) fn size(&self, optics: &Optics, distance: f64) -> [usize; 2] {
        let sine = [0, 1].map(|axis| 0.5 * optics.wavelength / optics.pitch[axis]);
        let cosine = (1.0 - sine[0] * sine[0] - sine[1] * sine[1]).max(0.0).sqrt();
        [0, 1].map(|axis| {
            // Without bound at the finest pitches, and nothing at no distance.
            let cone = (distance.abs() * sine[axis] / cosine).max(0.0);
            let tail = TAIL as f64 * optics.pitch[axis];
            let ends = self.middle[axis].abs() + self.half[axis] + cone + tail;
            let whole = 2.0 * self.half[axis] + guard(optics, distance);
            let least = ((ends.min(whole) / optics.pitch[axis] - 1e-6).ceil() as usize).max(self.least[axis]);
            fast_length(least, STRIP, &[1])
        })
    }

    /// Weight of the waves of frequency f [cycles/m] along an axis: 1 where they meet the window after a distance [m].
    pub(super) fn weight(&self, optics: &Optics, axis: usize, f: f64, distance: f64) -> f64 {
        let sine = optics.wavelength * f;
        if sine.abs() >= 1.0 {
            return 0.0;
        }
        if distance == 0.0 {
            return 1.0;
        }
        let aside = (distance * sine / (1.0 - sine * sine).sqrt() - self.middle[axis]).abs();
        let guard = guard(optics, distance);
        0.5 * libm::erfc((aside - self.half[axis] - 0.5 * guard) * 2.0 * EDGE / guard)
    }
}

/// Width of the soft edge [m].
fn guard(optics: &Optics, distance: f64) -> f64 {
    GUARD * (optics.wavelength * distance.abs()).sqrt()
}
