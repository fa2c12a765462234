//! Points → the field on the panel: one definition, engines with a stated error, and a planner that chooses.
//!
//! [`definition`] says what the field of a point is; [`oracle`] computes exactly that, slowly. The engines are a closed
//! set ([`Method`]), each tested against the oracle as a complex field. [`plan`] chooses one for a wanted error and says
//! why, in what time and memory; [`compute`] runs it and measures what error came of it.
//!
//! ```
//! use holodrive::glam::DVec3;
//! use holodrive::field::{Grid, relative_error};
//! use holodrive::hologram::{Cull, HologramSettings, compute, oracle, plan};
//! use holodrive::points::PointSource;
//! use holodrive::progress::Progress;
//!
//! // Ten points some 10 cm behind a small panel: the engine that is chosen keeps the bound that it states.
//! let panel = Grid::new(64, 48, 8e-6, 8e-6)?;
//! let position = |i: f64| DVec3::new(1e-5 * i, -2e-5 * i, -0.1 - 1e-3 * i);
//! let point = |i| PointSource { position: position(f64::from(i)), amplitude: 1.0, phase: f64::from(i) };
//! let points: Vec<PointSource> = (0..10).map(point).collect();
//! let plan = plan(&points, &panel, 532e-9, &HologramSettings::default())?;
//! let found = compute(&points, &panel, 532e-9, &plan, &Progress::new())?;
//! let exact = oracle(&points, &panel, 532e-9, Cull::Soft)?;
//! assert!(relative_error(&found.field.samples, &exact.samples) < found.report.error_bound);
//! # Ok::<(), holodrive::Error>(())
//! ```

mod check;
pub mod definition;
mod dispersion;
mod exact;
#[cfg(feature = "gpu")]
mod gpu;
mod lanes;
pub mod layers;
mod near;
mod oracle;
mod planes;
mod planner;
mod recurrence;
mod sources;
mod tiles;
mod verified;

pub use check::Measured;
pub use lanes::InstructionSet;
pub use oracle::{oracle, oracle_at};
pub use planner::plan;
pub use sources::Coverage;
pub use verified::compute;

use crate::error::{Error, Result};
use crate::field::{Field, Grid};
use crate::names::{Name, Named};
use crate::points::PointSource;
use crate::progress::Progress;
use planner::Engine;

/// How a field is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Double precision, term by term: for tests and small jobs.
    Oracle,
    /// Vectorised sum to 1e-4 whatever the wanted error.
    Direct,
    /// Vectorised sum as matrix products over tiles as large as the wanted error allows.
    Tiles,
    /// Spectral wavefront recording planes; [`Cull::Soft`] only.
    Planes,
    /// The sum of `tiles` on a graphics processor (feature `gpu`).
    Gpu,
    /// The planes of `planes` on a graphics processor (feature `gpu`); [`Cull::Soft`] only.
    GpuPlanes,
    /// Yoshikawa's difference method: for comparison, never chosen.
    Recurrence,
}

impl Named for Method {
    const KIND: &'static str = "engine";
    const NAMES: &'static [Name<Self>] = &[
        ("oracle", || Self::Oracle, "double precision, term by term: slow, for tests"),
        ("direct", || Self::Direct, "vectorised sum to 1e-4"),
        ("tiles", || Self::Tiles, "vectorised sum over tiles as large as the error allows"),
        ("planes", || Self::Planes, "spectral wavefront recording planes"),
        ("gpu", || Self::Gpu, "vectorised sum on a graphics processor"),
        ("gpu-planes", || Self::GpuPlanes, "recording planes on a graphics processor"),
        ("recurrence", || Self::Recurrence, "the difference method, for comparison"),
    ];
}

/// How a point's wave is limited to what the panel can diffract.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Cull {
    /// The definition's taper.
    #[default]
    Soft,
    /// The bare sphere inside |Δx| ≤ |z|·tan(asin(λ/2·pitch_x)) and the same in y, as other programs do it; its edge
    /// diffracts, 1–2 % of the field. `oracle`, `direct` and `tiles` only.
    Hard,
    /// The bare sphere everywhere, aliased where the panel cannot carry it. `oracle`, `direct` and `tiles` only.
    None,
}

/// What is asked of [`plan`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HologramSettings {
    /// Wanted relative L2 error of the field, above 1e-5.
    pub error: f64,
    /// The engine to take; the planner chooses where `None`.
    pub method: Option<Method>,
    /// How waves are limited.
    pub cull: Cull,
    /// Memory that the computation may take beside points and field [bytes].
    pub memory: u64,
    /// The instruction set to run on; the machine's widest where `None`.
    pub instruction_set: Option<InstructionSet>,
}

impl Default for HologramSettings {
    fn default() -> Self {
        Self { error: 1e-3, method: None, cull: Cull::Soft, memory: 1 << 30, instruction_set: None }
    }
}

/// What will be done, why, and at what cost.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Plan {
    /// The engine.
    pub method: Method,
    /// Why this one.
    pub reason: String,
    /// Predicted wall time on this machine [s].
    pub seconds: f64,
    /// Predicted relative L2 error of the field.
    pub error: f64,
    /// Memory beside points and field [bytes].
    pub memory: u64,
    /// Instruction set of the kernels.
    pub instruction_set: InstructionSet,
    /// Settings that the plan answers.
    pub settings: HologramSettings,
    engine: Engine,
}

/// What was done.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct HologramReport {
    /// The engine.
    pub method: Method,
    /// Why this one.
    pub reason: String,
    /// Instruction set of the kernels.
    pub instruction_set: InstructionSet,
    /// Wall time [s].
    pub seconds: f64,
    /// Time that the plan predicted [s].
    pub predicted_seconds: f64,
    /// Bound on the relative L2 error against the definition, relative to the field that is there: the engine's, or the
    /// measured limit where that is higher or all pixels were measured.
    pub error_bound: f64,
    /// The error that was measured after the field was made.
    pub measured: Measured,
    /// Memory beside points and field [bytes].
    pub memory: u64,
    /// Points reached, left out and lost light; point–pixel pairs.
    pub coverage: Coverage,
    /// Errors that could not be kept, with the numbers.
    pub warnings: Vec<String>,
}

/// A field and how it came about.
#[derive(Clone, Debug)]
pub struct Computed {
    /// The field on the panel.
    pub field: Field,
    /// How it came about.
    pub report: HologramReport,
}

/// Computes the field in `passes` that are shown as they come: first a quarter to the power of (`passes` − 1) of the
/// points, then four times as many, and so on; each pass adds the points that are new to it.
///
/// `show` gets the field so far, and by what to multiply it to have the brightness of the whole (for random phases).
/// The last one is the whole field; the passes' errors are independent, so the report's bound is the largest. Every
/// pass is planned for itself: fixed costs (tables, transforms) are paid `passes` times.
///
/// # Errors
/// Those of [`plan`] and [`compute`]; [`Error::Parameter`] for no passes or more than eight.
pub fn compute_progressively(
    points: &[PointSource],
    grid: &Grid,
    wavelength: f64,
    settings: &HologramSettings,
    passes: u32,
    progress: &Progress,
    mut show: impl FnMut(&Field, f32),
) -> Result<Computed> {
    if !(1..=8).contains(&passes) {
        return Err(Error::out_of_range("passes", passes, "must be one to eight"));
    }
    let step = |pass: u32| 4usize.pow(passes - 1 - pass);
    let mut whole: Option<Computed> = None;
    for pass in 0..passes {
        let is_new = |i: usize| i.is_multiple_of(step(pass)) && (pass == 0 || !i.is_multiple_of(step(pass - 1)));
        let new: Vec<PointSource> = points.iter().enumerate().filter(|(i, _)| is_new(*i)).map(|(_, p)| *p).collect();
        let plan = plan(&new, grid, wavelength, settings)?;
        let next = compute(&new, grid, wavelength, &plan, progress)?;
        whole = Some(match whole {
            None => next,
            Some(before) => before.and(next),
        });
        if let Some(sum) = &whole {
            show(&sum.field, (step(pass) as f32).sqrt());
        }
    }
    whole.ok_or_else(|| Error::parameter("passes", "none"))
}

impl Computed {
    /// The sum with a later pass.
    fn and(mut self, next: Computed) -> Self {
        self.field.samples.iter_mut().zip(&next.field.samples).for_each(|(u, add)| *u += add);
        let (a, b) = (self.report.coverage, next.report.coverage);
        let light = [&a, &b].map(|c| (c.points - c.dark) as f64);
        let outside = (a.light_outside * light[0] + b.light_outside * light[1]) / (light[0] + light[1]).max(1.0);
        self.report.coverage = Coverage {
            points: a.points + b.points,
            dark: a.dark + b.dark,
            unreached: a.unreached + b.unreached,
            light_outside: outside,
            pairs: a.pairs + b.pairs,
        };
        let report = next.report;
        self.report.seconds += report.seconds;
        self.report.predicted_seconds += report.predicted_seconds;
        self.report.error_bound = self.report.error_bound.max(report.error_bound);
        self.report.measured = self.report.measured.or_worse(report.measured);
        self.report.warnings.extend(report.warnings);
        self.report.memory = self.report.memory.max(report.memory) + 8 * self.field.samples.len() as u64;
        (self.report.method, self.report.reason) = (report.method, report.reason);
        self
    }
}

/// Name of the graphics processor that [`Method::Gpu`] and [`Method::GpuPlanes`] compute on.
///
/// # Errors
/// [`Error::Unsupported`] where there is none, or in a build without the feature `gpu`.
pub fn gpu_adapter() -> Result<&'static str> {
    #[cfg(feature = "gpu")]
    return gpu::adapter();
    #[cfg(not(feature = "gpu"))]
    Err(exact::no_gpu())
}

#[cfg(test)]
mod adversarial;
#[cfg(test)]
mod properties;
#[cfg(test)]
mod tests;
