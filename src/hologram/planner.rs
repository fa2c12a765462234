//! The choice of an engine: error and memory are conditions, predicted time decides.
//!
//! Predictions come from cost models of the engines ([`Division`], [`Parameters`]) in core-seconds of a 3.7 GHz Zen 4
//! with AVX-512, times a factor for the instruction set, over the threads. They rank the engines; on another machine
//! all of them are off by about the same factor.

use super::definition::Optics;
use super::exact::{DIRECT_ERROR, Division};
use super::planes::{self, Parameters};
use super::sources::{Coverage, Source, sources};
use super::{Cull, HologramSettings, InstructionSet, Method, Plan};
use crate::error::{Error, Result};
use crate::field::Grid;
use crate::points::PointSource;

/// Error of the oracle: the far form where it stands for the integral.
pub(super) const ORACLE_ERROR: f64 = 1e-5;

/// Time of the oracle for a point and a pixel [core-seconds]; points that are integrated take thousands of times that.
const ORACLE_PAIR: f64 = 1e-7;

/// An engine with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Engine {
    Oracle,
    /// `direct` and `tiles`, with the error that tiles are chosen for.
    Exact {
        error: f64,
    },
    Planes(Parameters),
}

/// One way to do the job.
struct Candidate {
    method: Method,
    engine: Engine,
    core_seconds: f64,
    error: f64,
    memory: u64,
    words: String,
}

/// The job, as the candidates see it.
struct Job<'a> {
    optics: Optics,
    grid: &'a Grid,
    sources: &'a [Source],
    settings: &'a HologramSettings,
}

impl Job<'_> {
    fn exact(&self, method: Method, error: f64) -> Candidate {
        let division = Division::new(&self.optics, self.grid, self.sources, self.settings.cull, error);
        let shape = division.far.iter().max_by_key(|class| class.len()).map(|class| class.shape);
        let words = match shape {
            Some(shape) if shape.exact => "every pixel from its own path".to_owned(),
            Some(shape) => format!("tiles of {}×{} px", shape.width, shape.height),
            None => "points near the panel as products of kernels".to_owned(),
        };
        let factor = set_factor(self.settings, method);
        Candidate {
            method,
            engine: Engine::Exact { error },
            core_seconds: division.core_seconds * factor,
            error: division.error,
            memory: division.bytes,
            words,
        }
    }

    fn planes(&self) -> Option<Candidate> {
        if self.settings.cull != Cull::Soft {
            return None;
        }
        let met = planes::met(&self.optics, self.grid, self.sources);
        let HologramSettings { error, memory, .. } = *self.settings;
        let (parameters, cost) = Parameters::choose(&self.optics, self.grid, &met, error, memory)?;
        Some(Candidate {
            method: Method::Planes,
            engine: Engine::Planes(parameters),
            core_seconds: cost * set_factor(self.settings, Method::Planes),
            error: parameters.error(&self.optics, &met, planes::steepness(&self.optics, self.grid, &met)),
            memory: parameters.bytes(&self.optics, self.grid, &met),
            words: format!("{} planes, rank {}", parameters.planes, parameters.rank),
        })
    }

    fn oracle(&self, pairs: f64) -> Candidate {
        Candidate {
            method: Method::Oracle,
            engine: Engine::Oracle,
            core_seconds: pairs * ORACLE_PAIR,
            error: ORACLE_ERROR,
            memory: 24 * self.sources.len() as u64 + 16 * self.grid.len() as u64,
            words: "double precision, term by term".to_owned(),
        }
    }
}

/// Slowness against AVX-512, measured.
fn set_factor(settings: &HologramSettings, method: Method) -> f64 {
    match (settings.instruction_set.unwrap_or_else(InstructionSet::detect), method) {
        (InstructionSet::Avx512, _) | (_, Method::Oracle) => 1.0,
        (InstructionSet::Avx2, _) => 1.3,
        (InstructionSet::Portable, Method::Direct) => 5.5,
        (InstructionSet::Portable, Method::Tiles) => 9.5,
        (InstructionSet::Portable, Method::Planes) => 4.0,
    }
}

/// Chooses engine and parameters for these points on this grid.
///
/// Refused: points that are not finite, settings out of their domain, a method that does not serve them, a job that
/// does not fit its memory.
pub fn plan(points: &[PointSource], grid: &Grid, wavelength: f64, settings: &HologramSettings) -> Result<Plan> {
    let optics = Optics::new(grid, wavelength)?;
    let error = settings.error;
    if !(1e-5..1.0).contains(&error) {
        return Err(Error::parameter("error", format!("{error:e} must lie between 1e-5 and 1")));
    }
    let set = settings.instruction_set.unwrap_or_else(InstructionSet::detect);
    if !InstructionSet::available().contains(&set) {
        return Err(Error::unsupported(format!("this machine has no {}", set.name())));
    }
    let sources = sources(points)?;
    let pairs = Coverage::of(points.len(), &sources, grid, &optics, settings.cull).pairs;
    let job = Job { optics, grid, sources: &sources, settings };
    let (best, reason) = match settings.method {
        Some(method) => {
            let candidate = match method {
                Method::Oracle => job.oracle(pairs),
                Method::Direct => job.exact(method, DIRECT_ERROR),
                Method::Tiles => job.exact(method, error),
                Method::Planes => job.planes().ok_or_else(|| refuse_planes(settings))?,
            };
            let reason = format!("{} as asked for", candidate.words);
            (candidate, reason)
        }
        None => choose(&job, error)?,
    };
    if best.memory > settings.memory {
        let hint = "give more memory, a smaller panel or fewer points".to_owned();
        let (needed, budget) = (best.memory.div_ceil(1 << 20), settings.memory >> 20);
        return Err(Error::Memory { what: best.method.name(), needed, budget, hint });
    }
    Ok(Plan {
        method: best.method,
        reason,
        seconds: best.core_seconds / rayon::current_num_threads() as f64,
        error: best.error,
        memory: best.memory,
        instruction_set: set,
        settings: *settings,
        engine: best.engine,
    })
}

fn refuse_planes(settings: &HologramSettings) -> Error {
    let what = match settings.cull {
        Cull::Soft => format!("planes reach no error of {:.0e} for this cloud; take direct or tiles", settings.error),
        Cull::Hard | Cull::None => "planes know the soft taper only; take direct or tiles".to_owned(),
    };
    Error::parameter("method", what)
}

/// The fastest that keeps error and memory, and why.
fn choose(job: &Job, error: f64) -> Result<(Candidate, String)> {
    let mut candidates = vec![job.exact(Method::Direct, DIRECT_ERROR)];
    if error > DIRECT_ERROR {
        candidates.push(job.exact(Method::Tiles, error));
    }
    candidates.extend(job.planes());
    candidates.sort_by(|a, b| a.core_seconds.total_cmp(&b.core_seconds));
    let others: Vec<String> =
        candidates.iter().map(|c| format!("{} {:.2e} core-seconds", c.method.name(), c.core_seconds)).collect();
    let fits = |c: &Candidate| c.memory <= job.settings.memory && (c.error <= error || c.method == Method::Direct);
    let Some(best) = candidates.iter().position(fits) else {
        let least = candidates.iter().min_by_key(|c| c.memory);
        let needed = least.map_or(0, |c| c.memory.div_ceil(1 << 20));
        let hint = "give more memory, a smaller panel or fewer points".to_owned();
        return Err(Error::Memory { what: "hologram", needed, budget: job.settings.memory >> 20, hint });
    };
    let best = candidates.swap_remove(best);
    let reason = format!("{}; least of {} within an error of {error:.0e}", best.words, others.join(", "));
    Ok((best, reason))
}
