//! The engines `direct` and `tiles`: every point at every pixel of its cone, near points and far ones each by their form.

use super::definition::Optics;
use super::lanes::InstructionSet;
use super::tiles::{self, Class};
use super::{Cull, Source, near};
use crate::error::Result;
use crate::field::{Field, Grid};
use crate::progress::Progress;

/// Error of `direct`, whatever was asked: its tiles are chosen below this.
pub(crate) const DIRECT_ERROR: f64 = 1e-4;

/// Fresnel number of the taper's edge below which its blurring is too wide for the far form's cubics.
const NEAREST_EDGE: f64 = 0.94;

/// Rounding of phases and sums in f32 (relative L2, measured).
const ROUNDING: f64 = 1e-5;

/// How the points are divided among the two forms and the classes of distance.
#[derive(Clone, Debug)]
pub(crate) struct Division {
    /// Points near the panel, as indexes into the sources.
    pub(crate) near: Vec<usize>,
    /// Points far from it.
    pub(crate) far: Vec<Class>,
    /// Bound on the relative L2 error of the field.
    pub(crate) error: f64,
    /// Memory beside the field [bytes].
    pub(crate) bytes: u64,
}

impl Division {
    /// Divides points for a wanted error.
    pub(crate) fn new(optics: &Optics, grid: &Grid, sources: &[Source], cull: Cull, error: f64) -> Self {
        let is_near = |source: &Source| {
            let inexact = optics.edge_fresnel_number(source.distance) < NEAREST_EDGE
                || optics.separable_far_error(source.distance) > 0.5 * error;
            cull == Cull::Soft && inexact && near::rank(optics, source.distance).is_some()
        };
        let (near, rest): (Vec<usize>, Vec<usize>) = (0..sources.len()).partition(|&i| is_near(&sources[i]));
        let far = tiles::classify(optics, grid, sources, &rest, cull, 0.8 * error);
        let form = match cull {
            Cull::Soft => rest
                .iter()
                .map(|&i| optics.separable_far_error(sources[i].distance.max(optics.wavelength)))
                .fold(0.0, f64::max),
            Cull::Hard | Cull::None => 0.0,
        };
        let shape = far.iter().map(|class| class.shape.error).fold(0.0, f64::max);
        let bytes =
            near::bytes(optics, sources, &near) + far.iter().map(|class| class.bytes(optics, cull)).max().unwrap_or(0);
        Self { near, far, error: form + shape + ROUNDING, bytes }
    }

    /// Work in the unit that [`Progress`] counts: points of near sources, points × tiles of far ones.
    fn work(&self, grid: &Grid) -> u64 {
        let tiles =
            |class: &Class| (grid.width.div_ceil(class.shape.width) * grid.height.div_ceil(class.shape.height)) as u64;
        self.near.len() as u64 + self.far.iter().map(|class| class.len() as u64 * tiles(class)).sum::<u64>()
    }

    /// The sum.
    pub(crate) fn sum(
        &self,
        grid: &Grid,
        optics: &Optics,
        sources: &[Source],
        cull: Cull,
        set: InstructionSet,
        progress: &Progress,
    ) -> Result<Field> {
        progress.start("hologram: sum over points", self.work(grid));
        let mut field = Field::zeros(*grid, optics.wavelength);
        near::add(&mut field, optics, sources, &self.near, progress)?;
        for class in &self.far {
            tiles::add(&mut field, optics, sources, class, cull, set, progress)?;
        }
        Ok(field)
    }
}
