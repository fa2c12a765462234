//! The engines `direct` and `tiles`: every point at every pixel of its cone, near points and far ones each by their form.

use super::definition::Optics;
#[cfg(feature = "gpu")]
use super::gpu;
use super::lanes::InstructionSet;
use super::sources::{PointSum, PointWave};
use super::tiles::{self, Class, Products};
use super::{Cull, near, recurrence};
#[cfg(not(feature = "gpu"))]
use crate::error::Error;
use crate::error::Result;
use crate::field::Field;
use rayon::prelude::*;

/// Error of `direct`, whatever was asked: its tiles are chosen below this.
pub(crate) const DIRECT_ERROR: f64 = 1e-4;

/// Fresnel number of the taper's edge below which its blurring is too wide for the far form's cubics.
const NEAREST_EDGE: f64 = 0.94;

/// Rounding of phases and sums in f32 (relative L2, measured).
const ROUNDING: f64 = 1e-5;

/// Rounding of phases, and polynomials, in the shaders (relative L2).
pub(super) const GPU_ROUNDING: f64 = 1e-4;

/// What a build without the feature `gpu` says.
#[cfg(not(feature = "gpu"))]
pub(super) fn no_gpu() -> Error {
    Error::unsupported("this build has no GPU engine; build it with the feature gpu, or take tiles or planes")
}

/// How the points are divided among the two forms and the classes of distance.
#[derive(Clone, Debug)]
pub(crate) struct Division {
    /// Points near the panel, as indexes into the sources.
    pub(crate) near: Vec<usize>,
    /// Points far from it.
    pub(crate) far: Vec<Class>,
    /// Bound on the relative L2 error of the field.
    pub(crate) error: f64,
    /// Part of it that the separable far form makes.
    form: f64,
    /// Memory beside the field [bytes].
    pub(crate) bytes: u64,
}

impl Division {
    /// Divides points for a wanted error and the products that the engine has; incomplete when asked to stop.
    pub(crate) fn new(sum: &PointSum, products: Products, error: f64) -> Self {
        let PointSum { optics, sources, cull, .. } = *sum;
        let is_near = |source: &PointWave| {
            let inexact = optics.edge_fresnel_number(source.distance) < NEAREST_EDGE
                || optics.separable_far_error(source.distance) > 0.5 * error;
            cull == Cull::Soft && inexact && near::rank(optics, source.distance).is_some()
        };
        let flags: Vec<bool> = sources.par_iter().map(is_near).collect();
        let (near, rest): (Vec<usize>, Vec<usize>) = (0..sources.len()).partition(|&i| flags[i]);
        let far = tiles::classify(sum, &rest, products, 0.8 * error);
        // The form's error falls with distance.
        let nearest = rest.iter().map(|&i| sources[i].distance).min_by(f64::total_cmp);
        let form = match (cull, nearest) {
            (Cull::Soft, Some(distance)) => optics.separable_far_error(distance.max(optics.wavelength)),
            _ => 0.0,
        };
        let shape = far.iter().map(|class| class.shape.error).fold(0.0, f64::max);
        // Near points first, then one class after another; the lists of indexes stay.
        let engine = far.iter().map(|class| class.bytes(optics, cull)).max().unwrap_or(0);
        let bytes = near::bytes(optics, sources, &near).max(engine) + (size_of::<usize>() * sources.len()) as u64;
        Self { near, far, error: form + shape + ROUNDING, form, bytes }
    }

    /// Predicted work on AVX-512 [core-seconds].
    pub(crate) fn core_seconds(&self, sum: &PointSum) -> f64 {
        near::core_seconds(sum.optics, sum.sources, &self.near)
            + self.far.iter().map(|class| class.core_seconds(sum)).sum::<f64>()
    }

    /// Block lengths of the classes for the difference method, and the bound on the field's error.
    pub(crate) fn blocks(&self, optics: &Optics, error: f64) -> (Vec<usize>, f64) {
        let sine = optics.wavelength * optics.taper[0].limit;
        let blocks: Vec<(usize, f64)> =
            self.far.iter().map(|class| recurrence::block(optics, class.nearest(), sine, 0.8 * error)).collect();
        let worst = blocks.iter().map(|block| block.1).fold(0.0, f64::max);
        let form = self.form + ROUNDING;
        (blocks.into_iter().map(|block| block.0).collect(), worst + form)
    }

    /// Bound on the relative L2 error of [`Division::sum_on_gpu`].
    pub(crate) fn gpu_error(&self) -> f64 {
        self.error + GPU_ROUNDING
    }

    /// The near points' field, to which the far ones are added; `far` is the work that they are, in the unit that
    /// [`Progress`](crate::progress::Progress) counts: points × tiles.
    fn near_field(&self, sum: &PointSum, what: &str, far: u64) -> Result<Field> {
        sum.progress.start(what, self.near.len() as u64 + far);
        let mut field = Field::zeros(*sum.grid, sum.optics.wavelength);
        near::add(&mut field, sum, &self.near)?;
        Ok(field)
    }

    /// The sum.
    pub(crate) fn sum(&self, sum: &PointSum, set: InstructionSet) -> Result<Field> {
        let tiles = |class: &Class| {
            class.len() as u64
                * (sum.grid.width.div_ceil(class.shape.width) * sum.grid.height.div_ceil(class.shape.height)) as u64
        };
        let mut field = self.near_field(sum, "hologram: sum over points", self.far.iter().map(tiles).sum())?;
        for class in &self.far {
            tiles::add(&mut field, sum, class, set)?;
        }
        Ok(field)
    }

    /// The sum by the difference method.
    pub(crate) fn sum_by_recurrence(&self, sum: &PointSum, error: f64, set: InstructionSet) -> Result<Field> {
        let blocks = self.blocks(sum.optics, error).0;
        let tiles = |(class, &block): (&Class, &usize)| class.len() as u64 * recurrence::blocks(sum.grid, block) as u64;
        let work = self.far.iter().zip(&blocks).map(tiles).sum();
        let mut field = self.near_field(sum, "hologram: difference method", work)?;
        for (class, block) in self.far.iter().zip(blocks) {
            recurrence::add(&mut field, sum, class, block, set)?;
        }
        Ok(field)
    }

    /// The sum with the far points on the graphics processor.
    #[cfg(feature = "gpu")]
    pub(crate) fn sum_on_gpu(&self, sum: &PointSum) -> Result<Field> {
        let cells = (sum.grid.width.div_ceil(gpu::CELL) * sum.grid.height.div_ceil(gpu::CELL)) as u64;
        let far: u64 = self.far.iter().map(|class| class.len() as u64).sum();
        let mut field = self.near_field(sum, "hologram: sum over points", far * cells)?;
        gpu::add(&mut field, sum, &self.far)?;
        Ok(field)
    }
    /// The sum with the far points on the graphics processor: not in this build.
    #[cfg(not(feature = "gpu"))]
    pub(crate) fn sum_on_gpu(&self, _: &PointSum) -> Result<Field> {
        Err(no_gpu())
    }
}
